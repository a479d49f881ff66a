/* SPDX-License-Identifier: MIT
 * eds_judge.c - a drive's file against the table of objects; see eds_judge.h.
 */
#include "inspect/eds_judge.h"

#include <inttypes.h>
#include <string.h>

#include "common/translate.h"
#include "platform/cia402_section.h"
#include "inspect/doctor_report.h"

#define FINDINGS_MAX  128u
#define FINDING_BYTES 256u
#define PDO_FIRST     0x1400u
#define PDO_LAST      0x1BFFu
#define CONSUMER      0x1016u
#define TYPE_REAL32   8u

/** A file being judged. Drives are alike: what has been said of one is not said again. */
typedef struct {
    const eds_t *eds;
    const config_t *config;
    const cia402_config_t *drives;
    doctor_report_t report;
    char said[FINDINGS_MAX][FINDING_BYTES];
    unsigned sayings;
    char left[FINDING_BYTES]; /* objects that heaved goes on without */
} judge_t;

/* The key that a value comes from. */
static const struct {
    uint16_t index;
    const char *key;
} k_keys[] = {
    {0x1006, "sync_watched"},
    {0x100C, "heartbeat_ms"},
    {0x100D, "heartbeat_timeout_ms"},
    {0x1016, "heartbeat_timeout_ms"},
    {0x1017, "heartbeat_ms"},
    {0x1018, "vendor_id"},
    {0x1019, "sync_counter"},
    {0x6007, "when_gateway_lost"},
    {0x6060, "mode"},
    {0x6065, "following_error_mm"},
    {0x6066, "following_error_ms"},
    {0x607D, "software_limit_mm"},
    {0x6081, "[cylinders] speed_mm_s"},
    {0x6083, "[cylinders] accel_mm_s2"},
    {0x6084, "[cylinders] accel_mm_s2"},
    {0x6085, "quick_stop_mm_s2"},
    {0x6098, "homing_method"},
    {0x6099, "homing_speed_mm_s"},
    {0x609A, "homing_accel_mm_s2"},
    {0x60C2, "period_us"},
};

static const char *key_of(const cia402_wish_t *wish)
{
    for (size_t i = 0; wish->is_own && i < sizeof k_keys / sizeof k_keys[0]; i++) {
        if (k_keys[i].index == wish->index) {
            return k_keys[i].key;
        }
    }
    return wish->is_own ? NULL : "[cia402-startup]";
}

static void say(judge_t *self, doctor_level_t level, const char *text)
{
    for (unsigned i = 0; i < self->sayings; i++) {
        if (strcmp(self->said[i], text) == 0) {
            return;
        }
    }
    if (self->sayings < FINDINGS_MAX) {
        (void)snprintf(self->said[self->sayings++], FINDING_BYTES, "%s", text);
    }
    doctor_say(&self->report, level, "%s", text);
}

static doctor_level_t level_of(const judge_t *self, const cia402_wish_t *wish)
{
    if (wish->need == CIA402_WISH_IF_THERE ||
        (wish->need == CIA402_WISH_GUARD && cia402_accepts_without(self->drives, wish->index))) {
        return DOCTOR_WARN;
    }
    return DOCTOR_FAIL;
}

static const char *remedy_of(const judge_t *self, const cia402_wish_t *wish)
{
    if (wish->need == CIA402_WISH_IF_THERE) {
        return _("nothing, heaved goes on without it");
    }
    if (wish->need == CIA402_WISH_GUARD) {
        return cia402_accepts_without(self->drives, wish->index)
                   ? _("nothing, [cia402] accepts drives without it")
                   : _("another drive, or [cia402] accept_without where it has been tried that the drive stops without it");
    }
    return wish->index >= PDO_FIRST && wish->index <= PDO_LAST ? _("a drive whose PDOs can be mapped")
                                                               : _("another drive, or firmware");
}

static void judge_missing(judge_t *self, const cia402_wish_t *wish)
{
    char text[FINDING_BYTES];
    if (wish->need == CIA402_WISH_IF_THERE) {
        (void)snprintf(text, sizeof text, " %04Xh:%02X", wish->index, wish->sub);
        if (strstr(self->left, text) == NULL && strlen(self->left) + strlen(text) < sizeof self->left) {
            strcat(self->left, text);
        }
        return;
    }
    const char *remedy =
        !wish->is_own && wish->need == CIA402_WISH_NEEDED ? _("if-there behind the item, or without it") : remedy_of(self, wish);
    (void)snprintf(text, sizeof text, _("%04Xh:%02X is not in it%s -> %s"), wish->index, wish->sub,
                   wish->is_own ? "" : _(", and is in [cia402-startup]"), remedy);
    say(self, level_of(self, wish), text);
}

static void judge_value(judge_t *self, const cia402_wish_t *wish, const eds_object_t *object)
{
    char text[FINDING_BYTES];
    const int64_t value = eds_shown(object, wish->value);
    const bool is_low = object->low.is_there && !object->low.has_node && value < eds_shown(object, (uint32_t)object->low.value);
    const bool is_high =
        object->high.is_there && !object->high.has_node && value > eds_shown(object, (uint32_t)object->high.value);
    const bool is_unlimited = object->low.value == 0 && object->high.value == 0; /* so some files write "none" */
    const char *key = key_of(wish);
    /* COB-IDs and mappings are heaved's own affair; limits of 1016h are those of its time, without the node above it */
    if (key == NULL || (!is_low && !is_high) || is_unlimited || wish->index == CONSUMER) {
        return;
    }
    (void)snprintf(text, sizeof text, _("%04Xh:%02X (line %u) takes %s %lld, heaved sets %lld -> %s%s"), wish->index, wish->sub,
                   object->line, is_low ? _("at least") : _("at most"),
                   (long long)eds_shown(object, (uint32_t)(is_low ? object->low.value : object->high.value)), (long long)value,
                   key[0] == '[' ? "" : "[cia402] ", key);
    say(self, level_of(self, wish), text);
}

/* It is what heaved would set. */
static bool is_set_already(const cia402_wish_t *wish, const eds_object_t *object)
{
    const uint32_t bits = wish->bytes >= 4u ? UINT32_MAX : (1u << 8u * wish->bytes) - 1u;
    const eds_number_t *holds = &object->fallback;
    return wish->is_compared && holds->is_there && !holds->has_node && (((uint32_t)holds->value ^ wish->value) & bits) == 0;
}

static void judge_access(judge_t *self, const cia402_wish_t *wish, const eds_object_t *object)
{
    char text[FINDING_BYTES];
    const uint8_t bytes = object->type == TYPE_REAL32 ? 4 : eds_bytes(object); /* a list has the bits of such a number */
    if (wish->is_written && !object->is_writable && !is_set_already(wish, object)) {
        char holds[48] = "";
        if (object->fallback.is_there) {
            (void)snprintf(holds, sizeof holds, _(" and holds %lld"), (long long)object->fallback.value);
        }
        (void)snprintf(text, sizeof text, _("%04Xh:%02X (line %u) can only be read%s, heaved sets %lld -> %s"), wish->index,
                       wish->sub, object->line, holds, (long long)eds_shown(object, wish->value), remedy_of(self, wish));
        say(self, level_of(self, wish), text);
    } else if (wish->is_written && bytes != wish->bytes && wish->index != 0x1000) {
        (void)snprintf(text, sizeof text,
                       translate_count("%04Xh:%02X (line %u) is no value of %u byte, as heaved writes it -> %s",
                                       "%04Xh:%02X (line %u) is no value of %u bytes, as heaved writes it -> %s", wish->bytes),
                       wish->index, wish->sub, object->line, wish->bytes,
                       wish->is_own ? remedy_of(self, wish) : _("the type in [cia402-startup]"));
        say(self, level_of(self, wish), text);
    } else if (wish->is_compared && !object->is_readable) {
        (void)snprintf(text, sizeof text, _("%04Xh:%02X (line %u) can only be written, heaved reads it -> %s"), wish->index,
                       wish->sub, object->line, wish->is_own ? remedy_of(self, wish) : _("unchecked behind the item"));
        say(self, level_of(self, wish), text);
    } else if (wish->is_written) {
        judge_value(self, wish, object);
    }
}

static void judge_wishes(judge_t *self, unsigned axis)
{
    cia402_wish_t wish = {0};
    while (cia402_next_wish(self->drives, axis, &wish)) {
        const eds_object_t *object = eds_find(self->eds, wish.index, wish.sub);
        if (object == NULL && !eds_is_compact_pdo(self->eds, wish.index)) {
            judge_missing(self, &wish);
        } else if (object != NULL) {
            judge_access(self, &wish, object);
        }
    }
}

/* Why an object does not go into a PDO; NULL: it does.
 * @param bits   that heaved maps
 * @param is_sent by the drive */
static const char *misfit_of(const eds_object_t *object, unsigned bits, bool is_sent)
{
    if (object == NULL) {
        return _("is not in it");
    }
    if (!object->is_mappable) {
        return _("cannot be mapped into a PDO");
    }
    if (8u * eds_bytes(object) != bits) {
        return _("has another size than heaved maps");
    }
    if (!is_sent && !object->is_writable) {
        return _("can only be read, and heaved commands it");
    }
    return is_sent && !object->is_readable ? _("can only be written, and heaved needs its value") : NULL;
}

/* Positions are below 0, too. */
static bool has_wrong_sign(const eds_object_t *object)
{
    const bool is_signed = object->index == 0x6064 || object->index == 0x607A || object->index == 0x60C1;
    return is_signed && eds_type_name(object)[0] != 'i';
}

/* An object that heaved maps into a PDO. */
static void judge_entry(judge_t *self, uint32_t entry, bool is_sent, bool is_fixed)
{
    char text[FINDING_BYTES];
    const unsigned index = entry >> 16;
    const unsigned sub_index = entry >> 8 & 0xFFu;
    const eds_object_t *object = eds_find(self->eds, (uint16_t)index, (uint8_t)sub_index);
    const char *misfit = misfit_of(object, entry & 0xFFu, is_sent);
    if (misfit != NULL && !(is_fixed && object != NULL && !object->is_mappable)) { /* what is mapped already can be */
        (void)snprintf(text, sizeof text, _("%04Xh:%02X %s -> another drive, or firmware"), index, sub_index, misfit);
        say(self, DOCTOR_FAIL, text);
    } else if (object != NULL && has_wrong_sign(object)) {
        (void)snprintf(text, sizeof text, _("%04Xh:%02X (line %u) has no sign: heaved takes it for a number with one"), index,
                       sub_index, object->line);
        say(self, DOCTOR_WARN, text);
    }
}

static void judge_mapping(judge_t *self, unsigned axis)
{
    for (unsigned which = 0; which < CIA402_PDOS; which++) {
        const cia402_pdo_t pdo = cia402_pdo(self->drives, axis, which);
        for (unsigned i = 0; i < pdo.entries; i++) {
            judge_entry(self, pdo.entry[i], which >= CIA402_ANSWER, pdo.is_fixed);
        }
    }
}

static void judge_identity(judge_t *self)
{
    const struct {
        const char *key;
        uint32_t wanted;
        const eds_number_t *found;
    } k_parts[] = {{"vendor_id", self->config->cia402.vendor_id, &self->eds->vendor},
                   {"product_code", self->config->cia402.product_code, &self->eds->product}};
    char text[FINDING_BYTES];
    for (unsigned i = 0; i < 2; i++) {
        if (k_parts[i].wanted != 0 && k_parts[i].found->is_there && (uint32_t)k_parts[i].found->value != k_parts[i].wanted) {
            (void)snprintf(text, sizeof text, _("it is the file of another device: 0x%X -> the right file, or [cia402] %s"),
                           (uint32_t)k_parts[i].found->value, k_parts[i].key);
            say(self, DOCTOR_FAIL, text);
        }
    }
}

static void judge_bitrate(judge_t *self)
{
    char text[FINDING_BYTES];
    const unsigned kbps = self->config->can.bitrate_bps / 1000u;
    for (unsigned i = 0; self->eds->has_bitrates && eds_bitrates_kbps[i] != 0; i++) {
        if (eds_bitrates_kbps[i] == kbps && (self->eds->bitrates >> i & 1u) == 0) {
            (void)snprintf(text, sizeof text, _("no %u kbit/s (BaudRate_%u) -> [can] bitrate_bps"), kbps, kbps);
            say(self, DOCTOR_FAIL, text);
        }
    }
}

/* 6502h has a default in some files, and is not reliable: worth a word, no more. */
static void judge_mode(judge_t *self)
{
    static const char *const k_names[] = {[CIA402_MODE_PP] = "pp", [CIA402_MODE_IP] = "ip", [CIA402_MODE_CSP] = "csp"};
    const eds_object_t *modes = eds_find(self->eds, 0x6502, 0);
    char text[FINDING_BYTES];
    if (modes == NULL || !modes->fallback.is_there || modes->fallback.value == 0 ||
        (modes->fallback.value >> ((unsigned)self->drives->mode - 1u) & 1) != 0) {
        return;
    }
    (void)snprintf(text, sizeof text, _("6502h:00 (line %u) does not name mode %s (0x%llX) -> [cia402] mode"), modes->line,
                   k_names[self->drives->mode], (unsigned long long)modes->fallback.value);
    say(self, DOCTOR_WARN, text);
}

bool eds_judge(const eds_t *eds, const config_t *config, FILE *out)
{
    static cia402_config_t drives;
    static judge_t self;
    const unsigned cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
    config_cia402(config, &drives);
    self = (judge_t){.eds = eds, .config = config, .drives = &drives, .report = {.out = out}};
    judge_identity(&self);
    judge_bitrate(&self);
    judge_mode(&self);
    for (unsigned k = 0; k < cylinders; k++) {
        judge_mapping(&self, k);
    }
    for (unsigned k = 0; k < cylinders; k++) {
        judge_wishes(&self, k);
    }
    if (self.left[0] != '\0') {
        doctor_say(&self.report, DOCTOR_OK, "not in it, and heaved goes on without:%s", self.left);
    }
    if (self.report.count[DOCTOR_FAIL] == 0) {
        doctor_say(&self.report, DOCTOR_OK, "%zu objects: all that heaved needs is there and takes what it is set to",
                   eds->objects);
    }
    doctor_sum(&self.report);
    return self.report.count[DOCTOR_FAIL] == 0;
}
