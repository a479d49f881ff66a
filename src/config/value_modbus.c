/* SPDX-License-Identifier: MIT
 * value_modbus.c - values that only Modbus drives have: hosts, blocks of registers, start-up lists.
 */
#include "config/value.h"

#include "common/translate.h"

#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>

#define TOKEN_BYTES  48u /* longer ones are no value */
#define BLANKS       " \t"
#define PORT_DEFAULT 502

/* How a field may be written: hl and lh tell which half of a number comes first. */
typedef struct {
    const char *name;
    uint8_t registers;
    bool is_signed;
    bool is_low_first;
} field_type_t;

static const field_type_t k_types[] = {
    {"u16", 1, false, false},  {"i16", 1, true, false},   {"u32hl", 2, false, false},
    {"u32lh", 2, false, true}, {"i32hl", 2, true, false}, {"i32lh", 2, true, true},
};
#define TYPES (sizeof k_types / sizeof k_types[0])

static const char *const k_values[MODBUS_DRIVE_VALUES] = {"position", "speed", "status", "alarm"};

/* The next piece up to one of the ends, copied without the blanks round it; *rest becomes NULL with the last one. */
static void copy_piece(const char **rest, const char *ends, char token[TOKEN_BYTES])
{
    const char *start = *rest + strspn(*rest, BLANKS);
    size_t length = strcspn(start, ends);
    const char *behind = start + length + strspn(start + length, BLANKS);
    const bool is_blank_end = strchr(ends, ' ') != NULL;
    *rest = *behind == '\0' ? NULL : is_blank_end ? behind : behind + 1;
    while (length > 0 && strchr(BLANKS, start[length - 1]) != NULL) {
        length--;
    }
    (void)snprintf(token, TOKEN_BYTES, "%.*s", (int)length, start);
}

/* A register's number or value, decimal or with 0x. */
static bool read_word(const char *text, uint16_t *value)
{
    char *end = NULL;
    const bool is_hex = text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
    if (strchr(is_hex ? "0123456789ABCDEFabcdef" : "0123456789", text[is_hex ? 2 : 0]) == NULL || text[is_hex ? 2 : 0] == '\0' ||
        strlen(text) > 10) {
        return false;
    }
    const unsigned long number = strtoul(text, &end, is_hex ? 16 : 10);
    *value = (uint16_t)number;
    return *end == '\0' && number <= 65535;
}

/* --- Hosts --- */

static bool read_host(char *text, config_host_t *host)
{
    uint8_t address[4];
    char *colon = strchr(text, ':');
    uint16_t port = PORT_DEFAULT;
    if (colon != NULL) {
        *colon = '\0';
        if (!read_word(colon + 1, &port) || port == 0) {
            return false;
        }
    }
    if (inet_pton(AF_INET, text, address) != 1 || inet_ntop(AF_INET, address, host->address, sizeof host->address) == NULL) {
        return false;
    }
    host->port = port;
    return true;
}

static bool parse_hosts(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_hosts_t *hosts = field;
    char token[TOKEN_BYTES];
    memset(hosts, 0, sizeof *hosts);
    for (const char *rest = text; rest != NULL; hosts->count++) {
        (void)span_copy_item(&rest, token, sizeof token);
        if (hosts->count == DRIVES_MAX) {
            return config_value_reject_text(key, token, _("is one too many"), why);
        }
        if (!read_host(token, &hosts->host[hosts->count])) {
            return config_value_reject_text(key, token, _("is no IPv4 address with or without :port"), why);
        }
    }
    return true;
}

/* --- Blocks --- */

static bool is_twice(const modbus_drive_blocks_t *blocks, modbus_drive_value_t value)
{
    return modbus_drive_find(blocks, value, NULL) != NULL;
}

/* Reads `{name:type}`. Returns what is wrong, NULL where nothing is. */
static const char *add_field(const config_key_t *key, const char *token, modbus_drive_blocks_t *blocks)
{
    modbus_drive_block_t *block = &blocks->block[blocks->count - 1u];
    const size_t length = strlen(token);
    const char *colon = strchr(token, ':');
    if (length < 2 || token[length - 1] != '}' || colon == NULL) {
        return _("is no field");
    }
    const size_t name_length = (size_t)(colon - token) - 1u;
    if (span_find_word(key->words, (span_t){token + 1, name_length}) < 0) {
        return _("is no field of these blocks");
    }
    modbus_drive_field_t field = {.at = block->count};
    for (unsigned i = 0; i < MODBUS_DRIVE_VALUES; i++) {
        field.value = span_is_word((span_t){token + 1, name_length}, k_values[i]) ? (modbus_drive_value_t)i : field.value;
    }
    for (unsigned i = 0; i < TYPES; i++) {
        if (span_is_word((span_t){colon + 1, length - name_length - 3u}, k_types[i].name)) {
            field.registers = k_types[i].registers;
            field.is_signed = k_types[i].is_signed;
            field.is_low_first = k_types[i].is_low_first;
        }
    }
    if (field.registers == 0) {
        return _("has no type that there is");
    }
    if (is_twice(blocks, field.value)) {
        return _("is there twice");
    }
    if (block->count + field.registers > MODBUS_DRIVE_REGISTERS_MAX) {
        return _("goes beyond the 16 registers of a block");
    }
    block->field[block->fields++] = field;
    block->count = (uint8_t)(block->count + field.registers);
    return NULL;
}

static const char *add_register(const config_key_t *key, const char *token, modbus_drive_blocks_t *blocks)
{
    modbus_drive_block_t *block = &blocks->block[blocks->count - 1u];
    const bool is_any = strcmp(token, "..") == 0;
    if (is_any && key->count == 0) {
        return _("stands for any register, which only feedback can have");
    }
    if (block->count == MODBUS_DRIVE_REGISTERS_MAX) {
        return _("goes beyond the 16 registers of a block");
    }
    if (!is_any && key->count != 0) {
        return _("is neither a field nor .. for any register");
    }
    if (!is_any && !read_word(token, &block->data[block->count])) {
        return _("is no value of a register");
    }
    block->any = (uint16_t)(block->any | (is_any ? 1u << block->count : 0u));
    block->count++;
    return NULL;
}

static const char *add_block(const char *token, modbus_drive_blocks_t *blocks)
{
    if (blocks->count == MODBUS_DRIVE_BLOCKS_MAX) {
        return _("begins a fifth block, and there are up to four");
    }
    return read_word(token, &blocks->block[blocks->count++].address) ? NULL : _("is no register to begin a block with");
}

static bool end_block(const config_key_t *key, const char *text, const modbus_drive_blocks_t *blocks, config_text_t *why)
{
    const modbus_drive_block_t *block = &blocks->block[blocks->count - 1u];
    if (blocks->count == 0 || block->count == 0) {
        return config_value_reject_text(key, text, _("has a block without registers"), why);
    }
    if (block->address + (unsigned)block->count > 65536u) {
        return config_value_reject_text(key, text, _("goes beyond register 65535"), why);
    }
    return true;
}

static bool parse_blocks(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    modbus_drive_blocks_t *blocks = field;
    char token[TOKEN_BYTES];
    bool is_start = true;
    memset(blocks, 0, sizeof *blocks);
    for (const char *rest = text; rest != NULL;) {
        copy_piece(&rest, BLANKS, token);
        if (strcmp(token, "|") == 0) {
            if (!end_block(key, text, blocks, why)) {
                return false;
            }
            is_start = true;
            continue;
        }
        const char *wrong = is_start          ? add_block(token, blocks)
                            : token[0] == '{' ? add_field(key, token, blocks)
                                              : add_register(key, token, blocks);
        if (wrong != NULL) {
            return config_value_reject_text(key, token, wrong, why);
        }
        is_start = false;
    }
    return is_start ? config_value_reject_text(key, text, _("ends where a block should begin"), why)
                    : end_block(key, text, blocks, why);
}

/* --- Start-up lists --- */

/* "0x0304 = 50", "0x0304 = 50 unchecked", or "0x0000 is 0x0203". */
static const char *read_item(const char *text, modbus_drive_item_t *item)
{
    char token[4][TOKEN_BYTES] = {"", "", "", ""};
    unsigned count = 0;
    for (const char *rest = text; rest != NULL && count < 4;) {
        copy_piece(&rest, BLANKS, token[count++]);
    }
    const bool is_written = strcmp(token[1], "=") == 0;
    const bool is_unchecked = is_written && strcmp(token[3], "unchecked") == 0;
    if ((!is_written && strcmp(token[1], "is") != 0) || count < 3 || (count == 4 && !is_unchecked)) {
        return _("is no item");
    }
    if (!read_word(token[0], &item->address) || !read_word(token[2], &item->value)) {
        return _("has a register or a value that is none");
    }
    item->is_written = is_written;
    item->is_checked = !is_unchecked;
    return NULL;
}

static bool parse_items(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    config_items_t *items = field;
    char token[TOKEN_BYTES];
    memset(items, 0, sizeof *items);
    for (const char *rest = text; rest != NULL; items->count++) {
        (void)span_copy_item(&rest, token, sizeof token);
        if (items->count == CONFIG_ITEMS_MAX) {
            return config_value_reject_text(key, token, _("is one too many"), why);
        }
        const char *wrong = read_item(token, &items->item[items->count]);
        if (wrong != NULL) {
            return config_value_reject_text(key, token, wrong, why);
        }
    }
    return true;
}

/* --- To text --- */

static void format_hosts(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_hosts_t *hosts = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < hosts->count; i++) {
        config_text_add(text, "%s%s", i == 0 ? "" : ", ", hosts->host[i].address);
        if (hosts->host[i].port != PORT_DEFAULT) {
            config_text_add(text, ":%u", hosts->host[i].port);
        }
    }
}

static void allowed_hosts(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text, _("none, or IPv4 addresses such as 192.168.1.11 or 192.168.1.11:1502, one for each drive"));
}

const config_type_t config_type_hosts = {
    .has_none = true, .parse = parse_hosts, .format = format_hosts, .allowed = allowed_hosts};

static const modbus_drive_field_t *field_at(const modbus_drive_block_t *block, unsigned at)
{
    for (unsigned i = 0; i < block->fields; i++) {
        if (block->field[i].at == at) {
            return &block->field[i];
        }
    }
    return NULL;
}

static const char *type_name(const modbus_drive_field_t *field)
{
    for (unsigned i = 0; i < TYPES; i++) {
        if (k_types[i].registers == field->registers && k_types[i].is_signed == field->is_signed &&
            k_types[i].is_low_first == field->is_low_first) {
            return k_types[i].name;
        }
    }
    return "";
}

static void format_block(const modbus_drive_block_t *block, config_text_t *text)
{
    config_text_add(text, "0x%04X", (unsigned)block->address);
    for (unsigned at = 0; at < block->count;) {
        const modbus_drive_field_t *field = field_at(block, at);
        if (field != NULL) {
            config_text_add(text, " {%s:%s}", k_values[field->value], type_name(field));
        } else if ((block->any >> at & 1u) != 0) {
            config_text_add(text, " ..");
        } else {
            config_text_add(text, " 0x%04X", (unsigned)block->data[at]);
        }
        at += field != NULL ? field->registers : 1u;
    }
}

static void format_blocks(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const modbus_drive_blocks_t *blocks = field;
    (void)key, (void)config;
    for (unsigned b = 0; b < blocks->count; b++) {
        config_text_add(text, "%s", b == 0 ? "" : " | ");
        format_block(&blocks->block[b], text);
    }
}

static void allowed_blocks(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("none, or a register and what it holds, such as 0x6200%s"), key->count != 0 ? "" : " 0x0001");
    for (const char *word = key->words; word != NULL; word = strchr(word, '|') != NULL ? strchr(word, '|') + 1 : NULL) {
        config_text_add(text, " {%.*s:T}", (int)strcspn(word, "|"), word);
    }
    config_text_add(text, _("%s%s, more behind |"), key->words != NULL ? _(" with T u16 i16 u32hl ... i32lh") : "",
                    key->count != 0 ? _(", .. for any register") : "");
}

const config_type_t config_type_blocks = {
    .has_none = true, .parse = parse_blocks, .format = format_blocks, .allowed = allowed_blocks};

static void format_items(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const config_items_t *items = field;
    (void)key, (void)config;
    for (unsigned i = 0; i < items->count; i++) {
        const modbus_drive_item_t *item = &items->item[i];
        config_text_add(text, "%s0x%04X %s %u%s", i == 0 ? "" : ", ", (unsigned)item->address, item->is_written ? "=" : "is",
                        (unsigned)item->value, item->is_checked ? "" : " unchecked");
    }
}

static void allowed_items(const config_key_t *key, config_text_t *text)
{
    (void)key;
    config_text_add(text,
                    _("none, or items such as 0x0304 = 50 (written and read back), 0x0304 = 50 unchecked, 0x0000 is 3 (only "
                      "looked at), up to %u"),
                    CONFIG_ITEMS_MAX);
}

const config_type_t config_type_items = {
    .has_none = true, .parse = parse_items, .format = format_items, .allowed = allowed_items};
