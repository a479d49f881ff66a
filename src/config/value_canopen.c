/* SPDX-License-Identifier: MIT
 * value_canopen.c - values that only CANopen drives have: nodes and their axes, modes, maps of PDOs.
 */
#include "config/value.h"

#include "common/translate.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define ITEM_BYTES 160u /* longer ones are no value, and are cut */
#define BLANKS     " \t"
#define DECIMAL    "0123456789"
#define HEX        "0123456789ABCDEFabcdef"

/* A whole number, hexadecimal behind 0x. Returns what follows, NULL where it is none or too large. */
static const char *read_number(const char *text, uint32_t most, uint32_t *value)
{
    const bool is_hex = text[0] == '0' && text[1] == 'x';
    const char *digits = text + (is_hex ? 2 : 0);
    const size_t length = strspn(digits, is_hex ? HEX : DECIMAL);
    if (length == 0 || length > 9) {
        return NULL;
    }
    *value = (uint32_t)strtoul(digits, NULL, is_hex ? 16 : 10);
    return *value <= most ? digits + length : NULL;
}

/* --- Nodes: 5, or 5.2 for the second axis of node 5 --- */

static bool read_node(const char *item, uint32_t *id)
{
    uint32_t node = 0;
    uint32_t axis = 1;
    const char *end = read_number(item, 0xFFFF, &node);
    if (end != NULL && *end == '.') {
        end = strncmp(end, ".0", 2) != 0 ? read_number(end + 1, CIA402_CHANNELS_MAX, &axis) : NULL;
    }
    *id = node | (axis - 1u) << CONFIG_CHANNEL_SHIFT;
    return end != NULL && *end == '\0';
}

static bool parse_nodes(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_ids_t *nodes = field;
    char item[ITEM_BYTES];
    memset(nodes, 0, sizeof *nodes);
    for (const char *rest = text; rest != NULL; nodes->count++) {
        (void)span_copy_item(&rest, item, sizeof item);
        if (nodes->count == DRIVES_MAX) {
            return config_value_reject_text(key, item, _("is one more than drives there can be"), why);
        }
        if (!read_node(item, &nodes->id[nodes->count])) {
            return config_value_reject_text(key, item, _("is no node"), why);
        }
    }
    return true;
}

static void format_nodes(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_ids_t *nodes = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < nodes->count; i++) {
        const uint32_t channel = nodes->id[i] >> CONFIG_CHANNEL_SHIFT;
        config_text_add(text, "%s0x%X", i == 0 ? "" : ", ", (unsigned)(nodes->id[i] & CONFIG_NODE_MASK));
        if (channel > 0) {
            config_text_add(text, ".%u", (unsigned)channel + 1u);
        }
    }
}

static void allowed_nodes(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text,
                    _("a node id from 1 to 127, such as 5, or with the axis in the node, such as 5.2, or one for each drive"));
}

const config_type_t config_type_nodes = {
    .has_none = true, .is_list = true, .parse = parse_nodes, .format = format_nodes, .allowed = allowed_nodes};

/* --- Words, one for all drives or one for each --- */

static bool parse_words(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_words_t *out = field;
    memset(out, 0, sizeof *out);
    for (const char *rest = text; rest != NULL; out->count++) {
        const span_t item = span_next_item(&rest);
        const int index = span_find_word(key->words, item);
        if (index < 0 || out->count == DRIVES_MAX) {
            return config_value_reject(key, item, index < 0 ? _("is not allowed") : _("is one more than drives there can be"),
                                       why);
        }
        out->word[out->count] = (uint8_t)index;
    }
    return true;
}

static void format_words(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_words_t *words = field;
    (void)config;
    for (unsigned i = 0; i < words->count; i++) {
        const char *word = key->words;
        for (unsigned n = 0; n < words->word[i]; n++) {
            word += strcspn(word, "|") + 1;
        }
        config_text_add(text, "%s%.*s", i == 0 ? "" : ", ", (int)strcspn(word, "|"), word);
    }
}

static void add_all_words(const config_key_t *key, config_text_t *text)
{
    for (const char *word = key->words; word != NULL;) {
        const size_t length = strcspn(word, "|");
        config_text_add(text, "%s%.*s", word == key->words ? "" : word[length] == '|' ? ", " : _(" or "), (int)length, word);
        word = word[length] == '|' ? word + length + 1 : NULL;
    }
}

static void allowed_words(const config_key_t *key, config_text_t *text)
{
    add_all_words(key, text);
    config_text_add(text, _("; or one for each drive"));
}

const config_type_t config_type_words = {.parse = parse_words, .format = format_words, .allowed = allowed_words};

/* --- Some of the words --- */

static bool parse_set(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    int64_t bits = 0;
    for (const char *rest = text; rest != NULL;) {
        const span_t item = span_next_item(&rest);
        const int index = span_find_word(key->words, item);
        if (index < 0) {
            return config_value_reject(key, item, _("is not allowed"), why);
        }
        bits |= (int64_t)1 << index;
    }
    config_value_store(field, key->size, bits);
    return true;
}

static void format_set(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const int64_t bits = config_value_load(field, key->size);
    const char *separator = "";
    unsigned index = 0;
    (void)config;
    for (const char *word = key->words; word != NULL; index++) {
        const size_t length = strcspn(word, "|");
        if ((bits >> index & 1) != 0) {
            config_text_add(text, "%s%.*s", separator, (int)length, word);
            separator = ", ";
        }
        word = word[length] == '|' ? word + length + 1 : NULL;
    }
}

static void allowed_set(const config_key_t *key, config_text_t *text)
{
    add_all_words(key, text);
    config_text_add(text, _("; several with commas"));
}

const config_type_t config_type_set = {
    .has_none = true, .is_list = true, .parse = parse_set, .format = format_set, .allowed = allowed_set};

/* --- Maps: 1: 0x6040/16 0x607A/32, 3: 0x60C1:01/32 --- */

static const char *read_entry(const char *at, uint32_t *entry)
{
    uint32_t index = 0;
    uint32_t sub = 0;
    uint32_t bits = 0;
    at = strncmp(at, "0x", 2) == 0 ? read_number(at, UINT16_MAX, &index) : NULL;
    if (at != NULL && *at == ':') { /* hexadecimal, as everywhere; behind 0x where the two bases differ */
        at = read_number(at + 1, strncmp(at + 1, "0x", 2) == 0 ? UINT8_MAX : 9, &sub);
    }
    at = at != NULL && *at == '/' ? read_number(at + 1, 64, &bits) : NULL;
    *entry = index << 16 | sub << 8 | bits;
    return bits != 0 && bits % 8u == 0 ? at : NULL;
}

static const char *wrong_map(const char *item, cia402_map_t *map)
{
    uint32_t number = 0;
    unsigned bits = 0;
    const char *at = read_number(item, CIA402_PDO_NUMBER_MAX, &number);
    if (at == NULL || number == 0 || *at != ':') {
        return _("does not begin with the number of a PDO and a colon");
    }
    map->number = (uint16_t)number;
    for (at += 1 + strspn(at + 1, BLANKS); *at != '\0'; at += strspn(at, BLANKS)) {
        if (map->entries == CIA402_PDO_ENTRIES) {
            return _("has more than 8 objects");
        }
        at = read_entry(at, &map->entry[map->entries]);
        if (at == NULL || (*at != '\0' && strchr(BLANKS, *at) == NULL)) {
            return _("has something that is no object with whole bytes");
        }
        bits += map->entry[map->entries++] & 0xFFu;
    }
    return map->entries == 0 ? _("has no object") : bits > 64u ? _("has more than 8 bytes") : NULL;
}

static bool parse_maps(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    cia402_maps_t *maps = field;
    char item[ITEM_BYTES];
    memset(maps, 0, sizeof *maps);
    for (const char *rest = text; rest != NULL; maps->count++) {
        (void)span_copy_item(&rest, item, sizeof item);
        const char *wrong =
            maps->count == CIA402_MAPS_MAX ? _("is one PDO more than there can be") : wrong_map(item, &maps->map[maps->count]);
        if (wrong != NULL) {
            return config_value_reject_text(key, item, wrong, why);
        }
    }
    return true;
}

static void format_maps(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const cia402_maps_t *maps = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < maps->count; i++) {
        config_text_add(text, "%s%u:", i == 0 ? "" : ", ", maps->map[i].number);
        for (unsigned n = 0; n < maps->map[i].entries; n++) {
            const uint32_t entry = maps->map[i].entry[n];
            config_text_add(text, " 0x%04" PRIX32 ":%02" PRIX32 "/%" PRIu32, entry >> 16, entry >> 8 & 0xFFu, entry & 0xFFu);
        }
    }
}

static void allowed_maps(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("none, or up to %u PDOs such as 1: 0x6040/16 0x607A/32"), CIA402_MAPS_MAX);
}

const config_type_t config_type_maps = {.has_none = true, .parse = parse_maps, .format = format_maps, .allowed = allowed_maps};
