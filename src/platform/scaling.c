/* SPDX-License-Identifier: MIT
 * scaling.c - the scaling of drives; see scaling.h.
 */
#include "platform/scaling.h"

#include "common/columns.h"
#include "common/translate.h"

#include <inttypes.h>
#include <string.h>

#include "platform/canraw_section.h"
#include "platform/cia402_section.h"
#include "platform/drives_check.h"
#include "platform/modbus_section.h"

#define SECTION          "drives"
#define COUNTS_OF_STROKE 100 /* a cylinder that knows no more places than that is none */

static unsigned cylinders_of(const config_t *config)
{
    return config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

/* --- From the screw --- */

/* The ratios that the driver in use goes by, and their section; NULL for simulated drives. */
static config_ratios_t *target_of(config_t *config, const char **section)
{
    switch (config->drives) {
    case CONFIG_DRIVES_CIA402:
        *section = "cia402";
        return &config->cia402.counts_per_mm;
    case CONFIG_DRIVES_CAN_RAW:
        *section = "can-raw";
        return &config->can_raw.counts_per_mm;
    case CONFIG_DRIVES_MODBUS_TCP:
    case CONFIG_DRIVES_MODBUS_RTU:
        *section = "modbus";
        return &config->modbus.counts_per_mm;
    case CONFIG_DRIVES_SIM:
        break;
    }
    return NULL;
}

/* Takes out of both what divides both. */
static void reduce(int64_t *above, int64_t *below)
{
    int64_t a = fx_abs(*above);
    int64_t b = *below;
    while (b != 0) {
        const int64_t rest = a % b;
        a = b;
        b = rest;
    }
    *above /= a;
    *below /= a;
}

/* Multiplies the factors of a fraction, of which none divides what is on the other side any more. */
static bool multiply(const int64_t *factor, unsigned count, int32_t *product)
{
    int64_t sum = 1;
    for (unsigned i = 0; i < count; i++) {
        sum *= factor[i]; /* both within 32 bits */
        if (fx_abs(sum) > INT32_MAX) {
            return false;
        }
    }
    *product = (int32_t)sum;
    return true;
}

/* counts per turn * gear / lead, exactly. Returns false where 32 bits do not hold it. */
static bool divide(const config_drive_train_t *train, unsigned i, int32_t *num, int32_t *den)
{
    const unsigned lead = train->lead_mm.count == 1 ? 0 : i;
    const unsigned gear = train->gear.count == 1 ? 0 : i;
    const bool is_backwards = train->lead_mm.num[lead] < 0;
    int64_t above[] = {train->counts_per_turn, train->gear.num[gear], train->lead_mm.den[lead]};
    int64_t below[] = {fx_abs(train->lead_mm.num[lead]), train->gear.den[gear]};
    for (unsigned a = 0; a < 3; a++) {
        for (unsigned b = 0; b < 2; b++) {
            reduce(&above[a], &below[b]);
        }
    }
    above[0] = is_backwards ? -above[0] : above[0];
    return multiply(above, 3, num) && multiply(below, 2, den);
}

/* Returns false after an error. */
static bool fill_in(config_source_t *self, const config_drive_train_t *train, config_ratios_t *target, unsigned cylinders)
{
    const bool is_same = train->lead_mm.count == 1 && train->gear.count == 1;
    target->count = (uint8_t)(is_same ? 1u : cylinders);
    for (unsigned i = 0; i < target->count; i++) {
        if (!divide(train, i, &target->num[i], &target->den[i])) {
            config_source_key_error(self, SECTION, "lead_mm",
                                    "counts_per_turn * gear / lead of drive %u is no ratio of numbers of 32 bits; allowed: lead "
                                    "and gear as shorter numbers, or counts_per_mm",
                                    i + 1u);
            return false;
        }
    }
    return true;
}

/* What has to stand beside lead_mm, and what may not. */
static bool is_train_complete(config_source_t *self, const char *section, const config_ratios_t *target, unsigned cylinders)
{
    const config_drive_train_t *train = &self->config->drive_train;
    if (target->count != 0) {
        config_source_key_error(self, SECTION, "lead_mm",
                                "counts_per_mm of [%s] gives the scaling already, at line %u; allowed: one of the two", section,
                                config_source_line_of(self, section, "counts_per_mm"));
        return false;
    }
    if (train->counts_per_turn == CONFIG_NONE) {
        config_source_key_error(self, SECTION, "counts_per_turn",
                                "missing beside lead_mm; allowed: the counts of one turn of the motor");
        return false;
    }
    return config_drives_is_length(self, SECTION, "lead_mm", train->lead_mm.count, cylinders) &&
           config_drives_is_length(self, SECTION, "gear", train->gear.count, cylinders);
}

void config_scaling_resolve(config_source_t *self)
{
    config_drive_train_t *train = &self->config->drive_train;
    const char *section = NULL;
    config_ratios_t *target = target_of(self->config, &section);
    if (target != NULL && !config_source_has_all(self, SECTION) && self->entry[config_key_find(SECTION, "lead_mm")].line != 0) {
        self->entry[config_key_find(section, "counts_per_mm")].is_valid = false; /* what it follows from was refused */
    }
    if (target == NULL || !config_source_has_all(self, SECTION) || !config_source_has(self, "platform", "kind") ||
        !config_source_has(self, section, "counts_per_mm")) {
        return;
    }
    if (train->lead_mm.count == 0) {
        if (train->gear.count != 1 || train->gear.num[0] != train->gear.den[0]) {
            config_source_key_error(self, SECTION, "gear",
                                    "means nothing without lead_mm; allowed: with lead_mm and counts_per_turn");
        }
        return;
    }
    if (!is_train_complete(self, section, target, cylinders_of(self->config)) ||
        !fill_in(self, train, target, cylinders_of(self->config))) {
        self->entry[config_key_find(section, "counts_per_mm")].is_valid = false; /* said once is enough */
    }
    train->lead_mm.count = 0;
    train->gear = (config_ratios_t){.count = 1, .num = {1}, .den = {1}};
}

/* --- What it comes to --- */

bool config_scaling_of(const config_t *config, unsigned cylinder, counts_scale_t *scale)
{
    switch (config->drives) {
    case CONFIG_DRIVES_CIA402:
        *scale = config_cia402_scale(config, cylinder);
        return true;
    case CONFIG_DRIVES_CAN_RAW:
        *scale = config_canraw_scale(config, cylinder);
        return true;
    case CONFIG_DRIVES_MODBUS_TCP:
    case CONFIG_DRIVES_MODBUS_RTU:
        *scale = config_modbus_scale(config, cylinder);
        return true;
    case CONFIG_DRIVES_SIM:
        break;
    }
    return false;
}

/* The counts from end to end; negative where the drive counts backwards. */
static int64_t stroke_counts(const counts_scale_t *scale, q16_t stroke_mm_q16)
{
    const counts_scale_t ratio = {scale->num, scale->den, 0};
    int64_t counts = INT64_MAX; /* too many: reported where fields are looked at */
    if (counts_from_units(&ratio, q32_from_q16(stroke_mm_q16), &counts) != HV_OK) {
        return INT64_MAX;
    }
    return counts;
}

void config_scaling_check(config_source_t *self)
{
    const char *section = NULL;
    const config_ratios_t *target = target_of(self->config, &section);
    const unsigned cylinders = cylinders_of(self->config);
    if (target == NULL || (target->count != 1 && target->count != cylinders) ||
        !config_source_has(self, "geometry", "stroke_mm") || !config_source_has(self, section, "counts_per_mm")) {
        return;
    }
    for (unsigned i = 0; i < cylinders; i++) {
        counts_scale_t scale = {0, 1, 0};
        const bool is_scaled = config_scaling_of(self->config, i, &scale);
        const q16_t stroke_q16 = self->config->settings.stroke_mm_q16[i];
        if (is_scaled && fx_abs(stroke_counts(&scale, stroke_q16)) < COUNTS_OF_STROKE) {
            config_source_key_error(self, section, "counts_per_mm",
                                    "a stroke of %g mm would be %lld counts of drive %u; allowed: counts per mm, not mm per "
                                    "count: counts of a turn / lead",
                                    (double)stroke_q16 / (double)Q16_ONE, (long long)stroke_counts(&scale, stroke_q16), i + 1u);
            return;
        }
    }
}

/* 500000 as "500,000". */
static void add_grouped(config_text_t *text, int64_t value)
{
    char digits[24];
    const int length = snprintf(digits, sizeof digits, "%" PRIu64, (uint64_t)fx_abs(value));
    config_text_add(text, "%s", value < 0 ? "-" : "");
    for (int i = 0; i < length; i++) {
        config_text_add(text, "%s%c", i > 0 && (length - i) % 3 == 0 ? "," : "", digits[i]);
    }
}

/* "stroke of 250 mm = 500,000 counts (0 to 500,000), 250 mm/s = 3000 rpm". */
static void describe(const config_t *config, unsigned i, config_text_t *text)
{
    const q16_t speed_q16 = config->settings.cylinder_speed_mm_s_q16;
    const q16_t stroke_q16 = config->settings.stroke_mm_q16[i];
    counts_scale_t scale = {1, 1, 0};
    (void)config_scaling_of(config, i, &scale);
    const int64_t counts = stroke_counts(&scale, stroke_q16);
    const double counts_per_s = (double)speed_q16 / (double)Q16_ONE * (double)scale.num / (double)scale.den;
    config_text_add(text, _("stroke of "));
    config_text_add_q16(text, stroke_q16);
    config_text_add(text, _(" mm = "));
    add_grouped(text, counts);
    config_text_add(text, _(" counts ("));
    add_grouped(text, scale.zero);
    config_text_add(text, _(" to "));
    add_grouped(text, scale.zero + counts);
    config_text_add(text, _("), "));
    config_text_add_q16(text, speed_q16);
    config_text_add(text, _(" mm/s = "));
    if (config->drive_train.counts_per_turn != CONFIG_NONE) {
        config_text_add(text, _("%.0f rpm"), 60.0 * counts_per_s / config->drive_train.counts_per_turn);
    } else {
        add_grouped(text, (int64_t)counts_per_s);
        config_text_add(text, _(" counts/s"));
    }
}

void config_scaling_report(const config_t *config, FILE *out)
{
    config_text_t text[CYLINDERS_MAX];
    const unsigned cylinders = cylinders_of(config);
    counts_scale_t scale;
    bool is_same = true;
    if (!config_scaling_of(config, 0, &scale)) {
        return;
    }
    for (unsigned i = 0; i < cylinders; i++) {
        config_text_clear(&text[i]);
        describe(config, i, &text[i]);
        is_same = is_same && strcmp(text[i].data, text[0].data) == 0;
    }
    for (unsigned i = 0; i < (is_same ? 1u : cylinders); i++) {
        columns_put(out, i == 0 ? _("counts of the drives") : "", CONFIG_LABEL_COLUMNS);
        if (!is_same) {
            fprintf(out, _("drive %u: "), i + 1u);
        }
        fprintf(out, "%s\n", text[i].data);
    }
}
