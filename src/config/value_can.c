/* SPDX-License-Identifier: MIT
 * value_can.c - values that only CAN drives have; see value_can.h.
 */
#include "config/value_can.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define ITEM_BYTES 64u /* longer ones are no value, and are cut */
#define NAME_BYTES "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-"

/* How a field may be written. */
typedef struct {
    const char *name;
    uint8_t bytes;
    bool is_signed;
    bool is_big_endian;
} field_type_t;

static const field_type_t k_types[] = {
    {"u8", 1, false, false},   {"i8", 1, true, false},   {"u16le", 2, false, false}, {"u16be", 2, false, true},
    {"i16le", 2, true, false}, {"i16be", 2, true, true}, {"u32le", 4, false, false}, {"u32be", 4, false, true},
    {"i32le", 4, true, false}, {"i32be", 4, true, true}, {"u24le", 3, false, false}, {"u24be", 3, false, true},
    {"i24le", 3, true, false}, {"i24be", 3, true, true},
};
#define TYPES (sizeof k_types / sizeof k_types[0])

static const char *const k_values[CANRAW_VALUES] = {"position", "speed", "status", "counter", "fault",
                                                    "sum",      "xor",   "crc8",   "crc8ff"};

static bool refuse(const config_key_t *key, const char *item, size_t length, const char *what, config_text_t *why)
{
    config_text_add_quoted(why, item, length);
    config_text_add(why, " %s; allowed: ", what);
    config_value_can_allowed(key, why);
    return false;
}

/* A whole number with nothing behind it but `end`; hexadecimal with 0x. Returns what follows, NULL where it is none. */
static const char *read_number(const char *text, int64_t low, int64_t high, int64_t *value)
{
    const char *digits = text + (text[0] == '-' || text[0] == '+');
    const bool is_hex = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X');
    char *end = NULL;
    if (strchr(is_hex ? "0123456789ABCDEFabcdef" : "0123456789", digits[is_hex ? 2 : 0]) == NULL ||
        digits[is_hex ? 2 : 0] == '\0') {
        return NULL;
    }
    errno = 0;
    *value = strtoll(text, &end, is_hex ? 16 : 10);
    return errno == 0 && *value >= low && *value <= high ? end : NULL;
}

/* The next item of a list, copied without the blanks round it; *rest becomes NULL with the last one. */
static const char *take_item(const char **rest, char item[ITEM_BYTES])
{
    const char *start = *rest + strspn(*rest, " \t");
    size_t length = strcspn(start, ",");
    *rest = start[length] == ',' ? start + length + 1 : NULL;
    while (length > 0 && (start[length - 1] == ' ' || start[length - 1] == '\t')) {
        length--;
    }
    snprintf(item, ITEM_BYTES, "%.*s", (int)length, start);
    return item;
}

static bool refuse_many(const config_key_t *key, unsigned most, config_text_t *why)
{
    config_text_add(why, "has more than %u values; allowed: ", most);
    config_value_can_allowed(key, why);
    return false;
}

static bool parse_name(const config_key_t *key, const char *text, char *name, config_text_t *why)
{
    const size_t length = strlen(text);
    if (length == 0 || strspn(text, NAME_BYTES) != length || length >= key->size) {
        return refuse(key, text, length, "is no name of an interface", why);
    }
    memset(name, 0, key->size);
    (void)snprintf(name, key->size, "%s", text);
    return true;
}

/* Of a key with a range: numbers of another kind. */
static bool parse_ids(const config_key_t *key, const char *text, config_ids_t *ids, config_text_t *why)
{
    const int64_t most = key->high_milli > 0 ? key->high_milli / 1000 : (int64_t)CAN_ID_EXTENDED_MAX;
    char item[ITEM_BYTES];
    memset(ids, 0, sizeof *ids);
    for (const char *rest = text; rest != NULL;) {
        int64_t value = 0;
        const char *end = read_number(take_item(&rest, item), 0, most, &value);
        if (end == NULL || *end != '\0') {
            const bool is_identifier = key->high_milli == 0 && key->words == NULL;
            return refuse(key, item, strlen(item), is_identifier ? "is no identifier" : "is no such number", why);
        }
        if (ids->count == DRIVES_MAX) {
            return refuse_many(key, DRIVES_MAX, why);
        }
        ids->id[ids->count++] = (uint32_t)value;
    }
    return true;
}

/* The digits behind a point: 5.08 is 508/100. Returns what follows, NULL where 32 bits do not hold them. */
static const char *read_decimals(const char *digits, bool is_negative, int64_t *above, int64_t *below)
{
    if (*digits < '0' || *digits > '9') {
        return NULL;
    }
    for (; *digits >= '0' && *digits <= '9'; digits++) {
        *above = *above * 10 + (is_negative ? '0' - *digits : *digits - '0');
        *below *= 10;
        if (*above < -INT32_MAX || *above > INT32_MAX || *below > INT32_MAX) {
            return NULL;
        }
    }
    return digits;
}

/* "20000/10", "2000" or "5.08". */
static bool read_ratio(const char *text, int32_t *num, int32_t *den)
{
    int64_t above = 0;
    int64_t below = 1;
    const char *end = read_number(text, -INT32_MAX, INT32_MAX, &above);
    if (end != NULL && *end == '.' && strpbrk(text, "xX") == NULL) {
        end = read_decimals(end + 1, text[0] == '-', &above, &below);
    } else if (end != NULL && *end == '/') {
        end = read_number(end + 1, 1, INT32_MAX, &below);
    }
    *num = (int32_t)above;
    *den = (int32_t)below;
    return end != NULL && *end == '\0' && above != 0;
}

static bool parse_ratios(const config_key_t *key, const char *text, config_ratios_t *ratios, config_text_t *why)
{
    char item[ITEM_BYTES];
    memset(ratios, 0, sizeof *ratios);
    for (const char *rest = text; rest != NULL; ratios->count++) {
        take_item(&rest, item);
        if (ratios->count == key->count) {
            return refuse_many(key, key->count, why);
        }
        if (!read_ratio(item, &ratios->num[ratios->count], &ratios->den[ratios->count])) {
            return refuse(key, item, strlen(item), "is no ratio", why);
        }
    }
    return true;
}

static bool parse_wholes(const config_key_t *key, const char *text, config_wholes_t *wholes, config_text_t *why)
{
    char item[ITEM_BYTES];
    memset(wholes, 0, sizeof *wholes);
    for (const char *rest = text; rest != NULL; wholes->count++) {
        int64_t value = 0;
        const char *end = read_number(take_item(&rest, item), -INT32_MAX, INT32_MAX, &value);
        if (wholes->count == key->count) {
            return refuse_many(key, key->count, why);
        }
        if (end == NULL || *end != '\0') {
            return refuse(key, item, strlen(item), "is no whole number", why);
        }
        wholes->value[wholes->count] = (int32_t)value;
    }
    return true;
}

/* --- Frames --- */

static bool is_listed(const char *words, const char *name, size_t length)
{
    for (; words != NULL; words = strchr(words, '|') != NULL ? strchr(words, '|') + 1 : NULL) {
        if (strcspn(words, "|") == length && memcmp(words, name, length) == 0) {
            return true;
        }
    }
    return false;
}

static bool has_check(const canraw_frame_t *frame)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        if (canraw_is_check(frame->field[i].value)) {
            return true;
        }
    }
    return false;
}

/* `{sum}`, `{xor}`, `{crc8:07}`, `{crc8ff:1D}`.
 * Returns whether it is one; *wrong says what is wrong with it. */
static bool add_check(const char *token, size_t length, canraw_frame_t *frame, const char **wrong)
{
    const char *colon = memchr(token, ':', length);
    const size_t name_length = (colon != NULL ? (size_t)(colon - token) : length - 1u) - 1u;
    canraw_field_t field = {.at = frame->length, .bytes = 1};
    for (unsigned i = CANRAW_SUM; i < CANRAW_VALUES && length > 2 && token[length - 1] == '}'; i++) {
        field.value = is_listed(k_values[i], token + 1, name_length) ? (canraw_value_t)i : field.value;
    }
    if (!canraw_is_check(field.value)) {
        return false;
    }
    const bool is_crc = field.value == CANRAW_CRC8 || field.value == CANRAW_CRC8_FF;
    const size_t digits = colon != NULL ? length - name_length - 3u : 0;
    if (is_crc != (colon != NULL) || (is_crc && (digits != 2 || strspn(colon + 1, "0123456789ABCDEFabcdef") < 2))) {
        *wrong = is_crc ? "has no polynomial of two digits, such as {crc8:07}" : "takes no type";
    } else if (has_check(frame)) {
        *wrong = "is a second check byte";
    } else if (frame->length == CANRAW_BYTES_MAX) {
        *wrong = "goes beyond the 8 bytes of a frame";
    } else {
        frame->data[frame->length] = is_crc ? (uint8_t)strtoul(colon + 1, NULL, 16) : 0;
        frame->field[frame->fields++] = field;
        frame->length++;
    }
    return true;
}

/* Reads `{name:type}` into the next field. Returns what is wrong, NULL where nothing is. */
static const char *add_field(const config_key_t *key, const char *token, size_t length, canraw_frame_t *frame)
{
    const char *colon = memchr(token, ':', length);
    const char *wrong = NULL;
    if (add_check(token, length, frame, &wrong)) {
        return wrong;
    }
    if (length < 2 || token[length - 1] != '}' || colon == NULL) {
        return "is no field";
    }
    const size_t name_length = (size_t)(colon - token) - 1u;
    const size_t type_length = length - name_length - 3u;
    if (!is_listed(key->words, token + 1, name_length)) {
        return "is no field of this frame";
    }
    canraw_field_t field = {.at = frame->length};
    for (unsigned i = 0; i < CANRAW_VALUES; i++) {
        field.value = is_listed(k_values[i], token + 1, name_length) ? (canraw_value_t)i : field.value;
    }
    for (unsigned i = 0; i < TYPES; i++) {
        if (is_listed(k_types[i].name, colon + 1, type_length)) {
            field.bytes = k_types[i].bytes;
            field.is_signed = k_types[i].is_signed;
            field.is_big_endian = k_types[i].is_big_endian;
        }
    }
    if (field.bytes == 0) {
        return "has no type that there is";
    }
    if (canraw_find(frame, field.value) != NULL) {
        return "is there twice";
    }
    if (frame->length + field.bytes > CANRAW_BYTES_MAX) {
        return "goes beyond the 8 bytes of a frame";
    }
    frame->field[frame->fields++] = field;
    frame->length = (uint8_t)(frame->length + field.bytes);
    return NULL;
}

static const char *add_byte(const config_key_t *key, const char *token, size_t length, canraw_frame_t *frame)
{
    const bool is_any = length == 2 && memcmp(token, "..", 2) == 0;
    if (is_any && key->count == 0) {
        return "stands for any byte, which only replies can have";
    }
    if (!is_any && (length != 2 || strspn(token, "0123456789ABCDEFabcdef") < 2)) {
        return "is no byte";
    }
    if (frame->length == CANRAW_BYTES_MAX) {
        return "goes beyond the 8 bytes of a frame";
    }
    if (!is_any) {
        const char digits[3] = {token[0], token[1], '\0'};
        frame->data[frame->length] = (uint8_t)strtoul(digits, NULL, 16);
        frame->constant = (uint8_t)(frame->constant | 1u << frame->length);
    }
    frame->length++;
    return NULL;
}

static bool parse_frame(const config_key_t *key, const char *text, canraw_frame_t *frame, config_text_t *why)
{
    memset(frame, 0, sizeof *frame);
    if (*text == '\0') {
        return refuse(key, text, 0, "is no frame", why);
    }
    while (*text != '\0') {
        const size_t length = strcspn(text, " \t");
        const char *wrong = text[0] == '{' ? add_field(key, text, length, frame) : add_byte(key, text, length, frame);
        if (wrong != NULL) {
            return refuse(key, text, length, wrong, why);
        }
        text += length;
        text += strspn(text, " \t");
    }
    return true;
}

/* "0x27/0x6F": these bits of the mask. */
static bool parse_when(const config_key_t *key, const char *text, canraw_when_t *when, config_text_t *why)
{
    int64_t value = 0;
    int64_t mask = 0;
    const char *slash = read_number(text, 0, UINT32_MAX, &value);
    const char *end = slash != NULL && *slash == '/' ? read_number(slash + 1, 1, UINT32_MAX, &mask) : NULL;
    if (end == NULL || *end != '\0') {
        return refuse(key, text, strlen(text), "is no value/mask", why);
    }
    if ((value & ~mask) != 0) {
        return refuse(key, text, strlen(text), "has a value with bits outside its mask", why);
    }
    *when = (canraw_when_t){.value = (uint32_t)value, .mask = (uint32_t)mask};
    return true;
}

bool config_value_can_parse(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    if (strcmp(text, "none") == 0 && key->type != CONFIG_NAME && key->type != CONFIG_WHOLES) {
        memset(field, 0, key->size);
        return true;
    }
    if (key->type == CONFIG_NAME) {
        return parse_name(key, text, field, why);
    }
    if (key->type == CONFIG_IDS) {
        return parse_ids(key, text, field, why);
    }
    if (key->type == CONFIG_RATIOS) {
        return parse_ratios(key, text, field, why);
    }
    if (key->type == CONFIG_WHOLES) {
        return parse_wholes(key, text, field, why);
    }
    return key->type == CONFIG_FRAME ? parse_frame(key, text, field, why) : parse_when(key, text, field, why);
}

/* --- To text --- */

static void format_ids(const config_ids_t *ids, config_text_t *text)
{
    for (unsigned i = 0; i < ids->count; i++) {
        config_text_add(text, "%s0x%X", i == 0 ? "" : ", ", (unsigned)ids->id[i]);
    }
}

static void format_ratios(const config_ratios_t *ratios, config_text_t *text)
{
    for (unsigned i = 0; i < ratios->count; i++) {
        config_text_add(text, "%s%" PRId32, i == 0 ? "" : ", ", ratios->num[i]);
        if (ratios->den[i] != 1) {
            config_text_add(text, "/%" PRId32, ratios->den[i]);
        }
    }
}

static const char *type_name(const canraw_field_t *field)
{
    for (unsigned i = 0; i < TYPES; i++) {
        const bool is_order = field->bytes == 1 || k_types[i].is_big_endian == field->is_big_endian;
        if (k_types[i].bytes == field->bytes && k_types[i].is_signed == field->is_signed && is_order) {
            return k_types[i].name;
        }
    }
    return "";
}

static const canraw_field_t *field_at(const canraw_frame_t *frame, unsigned at)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        if (frame->field[i].at == at) {
            return &frame->field[i];
        }
    }
    return NULL;
}

static void format_frame(const canraw_frame_t *frame, config_text_t *text)
{
    for (unsigned at = 0; at < frame->length;) {
        const canraw_field_t *field = field_at(frame, at);
        config_text_add(text, "%s", at == 0 ? "" : " ");
        if (field != NULL && (field->value == CANRAW_SUM || field->value == CANRAW_XOR)) {
            config_text_add(text, "{%s}", k_values[field->value]);
        } else if (field != NULL && canraw_is_check(field->value)) {
            config_text_add(text, "{%s:%02X}", k_values[field->value], (unsigned)frame->data[at]);
        } else if (field != NULL) {
            config_text_add(text, "{%s:%s}", k_values[field->value], type_name(field));
        } else if ((frame->constant >> at & 1u) != 0) {
            config_text_add(text, "%02X", (unsigned)frame->data[at]);
        } else {
            config_text_add(text, "..");
        }
        at += field != NULL ? field->bytes : 1u;
    }
}

void config_value_can_format(const config_key_t *key, const void *field, config_text_t *text)
{
    const size_t length = text->length;
    if (key->type == CONFIG_NAME) {
        config_text_add(text, "%s", (const char *)field);
    } else if (key->type == CONFIG_IDS) {
        format_ids(field, text);
    } else if (key->type == CONFIG_RATIOS) {
        format_ratios(field, text);
    } else if (key->type == CONFIG_WHOLES) {
        const config_wholes_t *wholes = field;
        for (unsigned i = 0; i < wholes->count; i++) {
            config_text_add(text, "%s%" PRId32, i == 0 ? "" : ", ", wholes->value[i]);
        }
    } else if (key->type == CONFIG_FRAME) {
        format_frame(field, text);
    } else if (((const canraw_when_t *)field)->mask != 0) {
        const canraw_when_t *when = field;
        config_text_add(text, "0x%X/0x%X", (unsigned)when->value, (unsigned)when->mask);
    }
    if (text->length == length) {
        config_text_add(text, "none");
    }
}

static void allowed_frame(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, "none, or up to 8 bytes such as 01 1F%s", key->count != 0 ? ", .. for any" : "");
    for (const char *word = key->words; word != NULL; word = strchr(word, '|') != NULL ? strchr(word, '|') + 1 : NULL) {
        config_text_add(text, "%s{%.*s:T}", word == key->words ? ", " : " ", (int)strcspn(word, "|"), word);
    }
    if (key->words != NULL) {
        config_text_add(text, " with T u8 i8 u16le ... i32be");
    }
    config_text_add(text, ", {sum} {xor} {crc8:07} {crc8ff:1D}");
}

void config_value_can_allowed(const config_key_t *key, config_text_t *text)
{
    if (key->type == CONFIG_NAME) {
        config_text_add(text, "a name of up to %u letters, digits and . _ -", (unsigned)key->size - 1u);
    } else if (key->type == CONFIG_IDS && key->high_milli > 0) {
        config_text_add(text, "none, or whole numbers up to %" PRId64 ", one for each drive", key->high_milli / 1000);
    } else if (key->type == CONFIG_IDS) {
        config_text_add(text, "%s, or one for each drive",
                        key->words != NULL ? key->words : "none, or an identifier such as 0x601");
    } else if (key->type == CONFIG_RATIOS) {
        config_text_add(text, "none, or a ratio such as 20000/10, 2000 or 5.08%s",
                        key->count > 1 ? ", or one for each cylinder" : "");
    } else if (key->type == CONFIG_WHOLES) {
        config_text_add(text, "a whole number%s", key->count > 1 ? ", or one for each cylinder" : "");
    } else if (key->type == CONFIG_FRAME) {
        allowed_frame(key, text);
    } else {
        config_text_add(text, "none, or value/mask such as 0x27/0x6F");
    }
}
