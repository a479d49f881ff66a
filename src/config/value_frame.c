/* SPDX-License-Identifier: MIT
 * value_frame.c - frames of CAN drives, and steps of starting up.
 */
#include "config/value.h"

#include "common/translate.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FIELD_BYTES             64u /* longer ones are none */
#define CONFIG_STEP_BYTES       256u
#define CONFIG_STEP_WAIT_MAX_MS 10000u

static const char *const k_values[CANRAW_VALUES] = {"position", "speed", "status", "counter", "fault",
                                                    "torque",   "sum",   "xor",    "crc8"};

static bool is_whole_bytes(const canraw_field_t *field)
{
    return field->skip == 0 && field->bits % 8u == 0;
}

/* --- Check bytes --- */

static bool has_check(const canraw_frame_t *frame)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        if (canraw_is_check(frame->field[i].value)) {
            return true;
        }
    }
    return false;
}

/* Two hexadecimal digits. Returns what follows, NULL where there are none. */
static const char *read_byte(const char *text, uint8_t *byte)
{
    char digits[3] = "";
    strncat(digits, text, 2);
    if (strspn(digits, "0123456789ABCDEFabcdef") < 2) {
        return NULL;
    }
    *byte = (uint8_t)strtoul(digits, NULL, 16);
    return text + 2;
}

/* `:1D`, `:1D/FF` or `:1D/FF/FF}`: polynomial, initial value, exclusive or at the end. Returns what follows, NULL where it is
 * none. */
static const char *read_crc(const char *text, bool is_inverted, canraw_frame_t *frame)
{
    const char *end = *text == ':' ? read_byte(text + 1, &frame->data[frame->length]) : NULL;
    frame->crc_initial = frame->crc_final = is_inverted ? 0xFFu : 0;
    if (end != NULL && *end == '/' && !is_inverted) {
        end = read_byte(end + 1, &frame->crc_initial);
    }
    if (end != NULL && *end == '/' && !is_inverted) {
        end = read_byte(end + 1, &frame->crc_final);
    }
    return end;
}

/* `{sum}`, `{xor}`, `{crc8:07}`, `{crc8:1D/FF/FF}`, and `{crc8ff:1D}` for that.
 * Returns whether it is one; *wrong says what is wrong with it. */
static bool add_check(const char *token, size_t length, canraw_frame_t *frame, const char **wrong)
{
    const char *colon = memchr(token, ':', length);
    const size_t name_length = (colon != NULL ? (size_t)(colon - token) : length - 1u) - 1u;
    const bool is_inverted = span_is_word((span_t){token + 1, name_length}, "crc8ff");
    canraw_field_t field = {.at = frame->length, .bits = 8};
    for (unsigned i = CANRAW_SUM; i < CANRAW_VALUES && length > 2 && token[length - 1] == '}'; i++) {
        const bool is_it = span_is_word((span_t){token + 1, name_length}, k_values[i]) || (i == CANRAW_CRC8 && is_inverted);
        field.value = is_it ? (canraw_value_t)i : field.value;
    }
    if (!canraw_is_check(field.value)) {
        return false;
    }
    const bool is_crc = field.value == CANRAW_CRC8;
    if (has_check(frame)) {
        *wrong = _("is a second check byte");
    } else if (frame->length == CANRAW_BYTES_MAX) {
        *wrong = _("goes beyond the 8 bytes of a frame");
    } else if (!is_crc && colon != NULL) {
        *wrong = _("takes no type");
    } else if (is_crc && read_crc(token + 1 + name_length, is_inverted, frame) != token + length - 1) {
        *wrong =
            _("has no polynomial of two digits, such as {crc8:07}, or {crc8:1D/FF/00} with initial value and final exclusive or");
    } else {
        frame->field[frame->fields++] = field;
        frame->length++;
    }
    return true;
}

/* --- Fields --- */

/* A whole number of few digits. Returns what follows, NULL where there is none. */
static const char *read_small(const char *text, unsigned low, unsigned high, unsigned *value)
{
    const size_t digits = strspn(text, "0123456789");
    *value = digits >= 1 && digits <= 7 ? (unsigned)strtoul(text, NULL, 10) : high + 1u;
    return *value >= low && *value <= high && (digits == 1 || text[0] != '0') ? text + digits : NULL;
}

/* "u16le", "i20be", "u4", "f32le/1000". Returns what follows, NULL where it is none. */
static const char *read_type(const char *text, canraw_field_t *field, bool *has_order)
{
    const char kind = text[0];
    unsigned bits = 0;
    const char *end = kind != '\0' && strchr("uif", kind) != NULL ? read_small(text + 1, kind == 'i' ? 2 : 1, 32, &bits) : NULL;
    if (end == NULL || (kind == 'f' && bits != 32u)) {
        return NULL;
    }
    field->bits = (uint8_t)bits;
    field->is_signed = kind != 'u';
    field->divisor = kind == 'f' ? 1u : 0;
    field->is_big_endian = strncmp(end, "be", 2) == 0;
    *has_order = field->is_big_endian || strncmp(end, "le", 2) == 0;
    end += *has_order ? 2 : 0;
    if (kind == 'f' && *end == '/') {
        unsigned divisor = 0;
        end = read_small(end + 1, 1, CANRAW_DIVISOR_MAX, &divisor);
        field->divisor = divisor;
    }
    return end;
}

/* "@1.4": byte 1, bit 4, where the lowest bit is, of a big-endian field the highest. Returns what follows, NULL where it is none.
 */
static const char *read_place(const char *text, canraw_field_t *field)
{
    unsigned byte = 0;
    unsigned bit = 0;
    const char *end = read_small(text + 1, 0, CANRAW_BYTES_MAX - 1u, &byte);
    end = end != NULL && *end == '.' ? read_small(end + 1, 0, 7, &bit) : NULL;
    field->at = (uint8_t)byte;
    field->skip = (uint8_t)(field->is_big_endian ? 7u - bit : bit);
    return end;
}

/* Under a field that has a place are bytes, and their bits there are 0. Returns what is wrong, NULL where nothing is. */
static const char *judge_place(const canraw_frame_t *frame, const canraw_field_t *field)
{
    uint8_t used[CANRAW_BYTES_MAX] = {0};
    uint8_t own[CANRAW_BYTES_MAX] = {0};
    if (field->at + canraw_field_span(field) > frame->length) {
        return _("covers bytes beyond the frame; write them before the field, as 00 where they carry nothing else");
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        (void)canraw_field_cover(&frame->field[i], used);
    }
    if (!canraw_field_cover(field, used)) {
        return _("lies on bits of another field");
    }
    (void)canraw_field_cover(field, own);
    for (unsigned at = 0; at < frame->length; at++) {
        if ((frame->constant >> at & 1u) != 0 && (frame->data[at] & own[at]) != 0) {
            return _("lies on bits that are 1; write 0 for them");
        }
    }
    return NULL;
}

/* A value has one field, or one for each slot. */
static bool is_there(const canraw_frame_t *frame, const canraw_field_t *field)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        const uint8_t slot = frame->field[i].slot;
        if (frame->field[i].value == field->value && (slot == field->slot || slot == 0 || field->slot == 0)) {
            return true;
        }
    }
    return false;
}

static const char *judge_type(const canraw_frame_t *frame, const canraw_field_t *field, bool has_order, bool has_place)
{
    if (!has_place && field->bits % 8u != 0) {
        return _("needs a place, such as @1.4 behind its type for byte 1, bit 4");
    }
    if (!has_order && canraw_field_span(field) > 1) {
        return _("needs an order of its bytes, le or be");
    }
    if (has_order && !has_place && field->bits == 8u) {
        return _("has an order of bytes, but only one byte");
    }
    if (field->divisor != 0 && field->value != CANRAW_POSITION && field->value != CANRAW_SPEED && field->value != CANRAW_TORQUE) {
        return _("is to be whole: a type u or i");
    }
    return is_there(frame, field) ? _("is there twice") : NULL;
}

static const char *append(canraw_frame_t *frame, canraw_field_t *field, bool has_place)
{
    if (frame->fields == CANRAW_FIELDS_MAX) {
        return _("is a field more than a frame can have");
    }
    if (!has_place) {
        field->at = frame->length;
        if (field->at + canraw_field_span(field) > CANRAW_BYTES_MAX) {
            return _("goes beyond the 8 bytes of a frame");
        }
        frame->length = (uint8_t)(frame->length + canraw_field_span(field));
    }
    for (unsigned i = 0; i < canraw_field_span(field) && is_whole_bytes(field); i++) { /* as if it stood in their place */
        frame->constant = (uint8_t)(frame->constant & ~(1u << (field->at + i)));
    }
    frame->field[frame->fields++] = *field;
    return NULL;
}

/* `name` or `name.3` between the brace and the colon. Returns what is wrong, NULL where nothing is. */
static const char *read_name(const config_key_t *key, const char *token, const char *colon, canraw_field_t *field)
{
    const char *point = memchr(token, '.', (size_t)(colon - token));
    const span_t name = {token + 1, (size_t)((point != NULL ? point : colon) - token) - 1u};
    unsigned slot = 0;
    if (point != NULL && read_small(point + 1, 1, DRIVES_MAX, &slot) != colon) {
        return _("has no number of a drive from 1 to 7 behind its point");
    }
    field->slot = (uint8_t)slot;
    if (span_find_word(key->words, name) < 0) {
        return _("is no field of this frame");
    }
    for (unsigned i = 0; i < CANRAW_VALUES; i++) {
        field->value = span_is_word(name, k_values[i]) ? (canraw_value_t)i : field->value;
    }
    return slot != 0 && field->value == CANRAW_COUNTER ? _("is of the whole frame, and takes no number") : NULL;
}

/* The type, and a place if there is one, up to the brace. Returns what is wrong, NULL where nothing is. */
static const char *read_form(const char *at, const char *brace, const canraw_frame_t *frame, canraw_field_t *field,
                             bool *has_place)
{
    bool has_order = false;
    const char *end = read_type(at, field, &has_order);
    *has_place = end != NULL && *end == '@';
    if (end == NULL || (*end != '}' && !*has_place)) {
        return _("has no type that there is");
    }
    end = *has_place ? read_place(end, field) : end;
    if (end != brace) {
        return _("has no place that there is, such as @1.4 for byte 1, bit 4");
    }
    const char *wrong = judge_type(frame, field, has_order, *has_place);
    return wrong == NULL && *has_place ? judge_place(frame, field) : wrong;
}

/* Reads `{name:type}` into the next field. Returns what is wrong, NULL where nothing is. */
static const char *add_field(const config_key_t *key, const char *token, size_t length, canraw_frame_t *frame)
{
    const char *colon = memchr(token, ':', length);
    const char *wrong = NULL;
    if (add_check(token, length, frame, &wrong)) {
        return wrong;
    }
    if (length < 2 || length > FIELD_BYTES || token[length - 1] != '}' || colon == NULL) {
        return _("is no field");
    }
    canraw_field_t field = {.at = 0};
    bool has_place = false;
    wrong = read_name(key, token, colon, &field);
    if (wrong == NULL) {
        wrong = read_form(colon + 1, token + length - 1, frame, &field, &has_place);
    }
    return wrong != NULL ? wrong : append(frame, &field, has_place);
}

static const char *add_byte(const config_key_t *key, const char *token, size_t length, canraw_frame_t *frame)
{
    const bool is_any = length == 2 && memcmp(token, "..", 2) == 0;
    if (is_any && key->count == 0) {
        return _("stands for any byte, which only replies can have");
    }
    if (!is_any && (length != 2 || strspn(token, "0123456789ABCDEFabcdef") < 2)) {
        return _("is no byte");
    }
    if (frame->length == CANRAW_BYTES_MAX) {
        return _("goes beyond the 8 bytes of a frame");
    }
    if (!is_any) {
        (void)read_byte(token, &frame->data[frame->length]);
        frame->constant = (uint8_t)(frame->constant | 1u << frame->length);
    }
    frame->length++;
    return NULL;
}

static bool parse_frame(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    canraw_frame_t *frame = field;
    const char *wrong = *text == '\0' ? _("is no frame") : NULL;
    memset(frame, 0, sizeof *frame);
    while (*text != '\0' || wrong != NULL) {
        const size_t length = strcspn(text, " \t");
        if (wrong == NULL) {
            wrong = text[0] == '{' ? add_field(key, text, length, frame) : add_byte(key, text, length, frame);
        }
        if (wrong != NULL) {
            return config_value_reject(key, (span_t){text, length}, wrong, why);
        }
        text += length;
        text += strspn(text, " \t");
    }
    return true;
}

/* --- Steps of starting up --- */

/* A part of a line without the blanks at its end. */
static bool parse_part(const config_key_t *key, const char *start, size_t length, canraw_frame_t *frame, config_text_t *why)
{
    char part[CONFIG_STEP_BYTES];
    while (length > 0 && (start[length - 1] == ' ' || start[length - 1] == '\t')) {
        length--;
    }
    (void)snprintf(part, sizeof part, "%.*s", (int)length, start);
    return parse_frame(key, part, frame, why);
}

/* `2B 10 00 -> 60 .. wait 50`: a frame, its answer, ms before the next. */
static bool parse_step(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    canraw_step_t *step = field;
    const char *wait = strstr(text, "wait");
    const size_t length = wait != NULL ? (size_t)(wait - text) : strlen(text);
    const char *arrow = strstr(text, "->");
    const size_t sent = arrow != NULL && arrow < text + length ? (size_t)(arrow - text) : length;
    config_key_t answer = *key;
    memset(step, 0, sizeof *step);
    answer.words = NULL;
    answer.count = 1; /* any bytes, too */
    if (wait != NULL) {
        unsigned wait_ms = 0;
        const char *end = read_small(wait + 4 + strspn(wait + 4, " \t"), 0, CONFIG_STEP_WAIT_MAX_MS, &wait_ms);
        if (end == NULL || *end != '\0') {
            config_text_add_quoted(why, wait, strlen(wait));
            config_text_add(why, _(" is no time; allowed: at its end, wait and milliseconds up to %u"), CONFIG_STEP_WAIT_MAX_MS);
            return false;
        }
        step->wait_us = wait_ms * 1000u;
    }
    if (!parse_part(key, text, sent, &step->frame, why)) {
        return false;
    }
    if (sent == length) {
        return true;
    }
    arrow += 2 + strspn(arrow + 2, " \t");
    return parse_part(&answer, arrow, (size_t)(text + length - arrow), &step->answer, why);
}

/* --- To text --- */

static void format_check(const canraw_frame_t *frame, const canraw_field_t *field, config_text_t *text)
{
    config_text_add(text, "{%s", k_values[field->value]);
    if (field->value != CANRAW_SUM && field->value != CANRAW_XOR) {
        config_text_add(text, ":%02X", (unsigned)frame->data[field->at]);
        if (frame->crc_initial != 0 || frame->crc_final != 0) {
            config_text_add(text, "/%02X", (unsigned)frame->crc_initial);
        }
        if (frame->crc_final != 0) {
            config_text_add(text, "/%02X", (unsigned)frame->crc_final);
        }
    }
    config_text_add(text, "}");
}

static void format_field(const canraw_frame_t *frame, const canraw_field_t *field, config_text_t *text)
{
    const char *name = k_values[field->value];
    if (canraw_is_check(field->value)) {
        format_check(frame, field, text);
        return;
    }
    config_text_add(text, "{%s", name);
    if (field->slot != 0) {
        config_text_add(text, ".%u", (unsigned)field->slot);
    }
    config_text_add(text, ":%s%u", field->divisor != 0 ? "f" : field->is_signed ? "i" : "u", (unsigned)field->bits);
    if (field->is_big_endian || canraw_field_span(field) > 1) {
        config_text_add(text, "%s", field->is_big_endian ? field->bits == 8 && field->skip == 0 ? "" : "be" : "le");
    }
    if (field->divisor > 1) {
        config_text_add(text, "/%" PRIu32, field->divisor);
    }
    if (!is_whole_bytes(field)) {
        config_text_add(text, "@%u.%u", (unsigned)field->at, field->is_big_endian ? 7u - field->skip : (unsigned)field->skip);
    }
    config_text_add(text, "}");
}

static const canraw_field_t *whole_field_at(const canraw_frame_t *frame, unsigned at)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        if (frame->field[i].at == at && is_whole_bytes(&frame->field[i])) {
            return &frame->field[i];
        }
    }
    return NULL;
}

static void add_frame(const canraw_frame_t *frame, config_text_t *text)
{
    for (unsigned at = 0; at < frame->length;) {
        const canraw_field_t *field = whole_field_at(frame, at);
        config_text_add(text, "%s", at == 0 ? "" : " ");
        if (field != NULL) {
            format_field(frame, field, text);
        } else if ((frame->constant >> at & 1u) != 0) {
            config_text_add(text, "%02X", (unsigned)frame->data[at]);
        } else {
            config_text_add(text, "..");
        }
        at += field != NULL ? canraw_field_span(field) : 1u;
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        if (!is_whole_bytes(&frame->field[i])) {
            config_text_add(text, " ");
            format_field(frame, &frame->field[i], text);
        }
    }
}

static void format_frame(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    (void)key, (void)config;
    add_frame(field, text);
}

static void format_step(const config_key_t *key, const config_t *config, const void *field, config_text_t *text)
{
    const canraw_step_t *step = field;
    (void)key, (void)config;
    add_frame(&step->frame, text);
    if (step->answer.length > 0) {
        config_text_add(text, " -> ");
        add_frame(&step->answer, text);
    }
    if (step->wait_us > 0) {
        config_text_add(text, " wait %" PRIu32, step->wait_us / 1000u);
    }
}

static void allowed_frame(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _("none, or up to 8 bytes such as 01 1F%s"), key->count != 0 ? " .." : "");
    for (const char *word = key->words; word != NULL; word = strchr(word, '|') != NULL ? strchr(word, '|') + 1 : NULL) {
        config_text_add(text, "%s{%.*s:T}", word == key->words ? ", " : " ", (int)strcspn(word, "|"), word);
    }
    if (key->words != NULL) {
        config_text_add(text, _(" with T u8 i16le u24be f32le/1000 i12le@1.4"));
    }
    config_text_add(text, _(", {sum} {xor} {crc8:07}"));
}

static void allowed_step(const config_key_t *key, config_text_t *text)
{
    allowed_frame(key, text);
    config_text_add(text, _("; then -> and an answer such as 60 ..; then wait 50"));
}

const config_type_t config_type_frame = {
    .has_none = true, .parse = parse_frame, .format = format_frame, .allowed = allowed_frame};
const config_type_t config_type_step = {.has_none = true, .parse = parse_step, .format = format_step, .allowed = allowed_step};
