/* SPDX-License-Identifier: MIT
 * identify_report.c - see identify_report.h. The recommendations are rules of thumb, and say what they go by.
 */
#include "identify/identify_report.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/message.h" // exit codes
#include "common/columns.h"
#include "common/translate.h"

#define ADVICE_MAX       12u
#define ADVICE_BYTES     240u
#define WINDOW_FACTOR    1.5 /* of the following error to be expected at full speed */
#define LEAST_WINDOW_MM  0.5 /* 0 would switch the watch off */
#define APART_SHARE      0.2 /* cylinders whose lags differ by more pull against each other */
#define APART_MS         2.0
#define GAIN_SHARE       0.02 /* a scale that is wrong by more is seen */
#define LEAST_COHERENCE  0.9
#define HYSTERESIS_SHARE 0.02 /* of the amplitude */

typedef struct {
    char text[ADVICE_MAX][ADVICE_BYTES];
    unsigned count;
} advice_t;

static __attribute__((format(printf, 2, 3))) void advise(advice_t *self, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    if (self->count < ADVICE_MAX) {
        (void)vsnprintf(self->text[self->count++], ADVICE_BYTES, format, arguments);
    }
    va_end(arguments);
}

/* --- Advice --- */

/* The channels that are drives in mm: the cylinders of a pose, or the one that was asked for. */
static unsigned first_drive(const identify_report_t *self)
{
    return self->is_posed ? 1u : 0u;
}

static bool are_cylinders(const identify_report_t *self)
{
    return self->is_posed || strcmp(self->unit, "mm") == 0;
}

static int compare(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return *x < *y ? -1 : *x > *y;
}

static double median_lag_ms(const identify_report_t *self)
{
    double lag[IDENTIFY_CHANNELS_MAX];
    unsigned count = 0;
    for (unsigned i = first_drive(self); i < self->channels; i++) {
        if (self->channel[i].response.is_moved) {
            lag[count++] = self->channel[i].response.lag_ms;
        }
    }
    qsort(lag, count, sizeof lag[0], compare);
    return count > 0 ? lag[count / 2] : 0;
}

/* What is wrong with a drive by itself, or differs from the others. */
static void look_at_drive(const identify_report_t *self, const identify_channel_t *channel, double median_ms, advice_t *advice)
{
    const response_t *found = &channel->response;
    if (!found->is_moved) {
        advise(advice, "drive %s: no feedback moved with the set-point; look at its encoder, or its scaling", channel->name);
        return;
    }
    if (fabs(found->lag_ms - median_ms) > fmax(APART_MS, APART_SHARE * median_ms)) {
        advise(advice,
               "drive %s lags by %.1f ms, the others by %.1f: they pull against each other; give all drives the same gains",
               channel->name, found->lag_ms, median_ms);
    }
    if (fabs(found->gain - 1) > GAIN_SHARE) {
        advise(advice, "drive %s makes %.3f of the way it is asked for: look at lead_mm, gear and counts_per_turn", channel->name,
               found->gain);
    }
    if (found->hysteresis > fmax(0.01, HYSTERESIS_SHARE * self->amplitude)) {
        advise(advice, "drive %s: %.3f mm between up and down: backlash or friction", channel->name, found->hysteresis);
    }
}

/* Limits of every cylinder, from the slowest of them. */
static void look_at_limits(const identify_report_t *self, advice_t *advice)
{
    double lag_ms = 0, hysteresis = 0, corner_hz = INFINITY;
    bool is_each_seen = true;
    for (unsigned i = first_drive(self); i < self->channels; i++) {
        const response_t *found = &self->channel[i].response;
        if (found->is_moved) {
            lag_ms = fmax(lag_ms, found->lag_ms);
            hysteresis = fmax(hysteresis, found->hysteresis);
            corner_hz = found->gain_3db_hz > 0 ? fmin(corner_hz, found->gain_3db_hz) : corner_hz;
        }
        is_each_seen = is_each_seen && found->is_moved && found->lag_ms > 0;
    }
    const double window_mm = WINDOW_FACTOR * (lag_ms / 1000 * self->speed_mm_s + hysteresis);
    if (!is_each_seen || self->speed_mm_s <= 0) {
        /* no window from a drive that was not seen to follow */
    } else if (self->window_mm > 0 && self->window_mm < window_mm) {
        advise(advice,
               "following_error_mm = %.1f at least: at %.0f mm/s a lag of %.1f ms is %.1f mm, and half as much again stays free; "
               "it is "
               "%.1f, which allows %.0f mm/s",
               window_mm, self->speed_mm_s, lag_ms, lag_ms / 1000 * self->speed_mm_s, self->window_mm,
               fmax(self->window_mm / WINDOW_FACTOR - hysteresis, 0) / lag_ms * 1000);
    } else if (self->window_mm > 4 * fmax(window_mm, LEAST_WINDOW_MM)) {
        advise(advice, "following_error_mm = %.1f would do (it is %.1f): a drive that stays behind is seen earlier",
               fmax(ceil(window_mm * 10) / 10, LEAST_WINDOW_MM), self->window_mm);
    }
    if (isfinite(corner_hz) && self->jerk_mm_s3 > 2 * corner_hz * self->accel_mm_s2) {
        advise(advice,
               "jerk_mm_s3 = %.0f at most with accel_mm_s2 = %.0f (it is %.0f): the drives fall by 3 dB at %.1f Hz, and an "
               "acceleration "
               "that comes within less than half a period of that is not made",
               2 * corner_hz * self->accel_mm_s2, self->accel_mm_s2, self->jerk_mm_s3, corner_hz);
    }
}

static void look(const identify_report_t *self, advice_t *advice)
{
    const response_t *first = &self->channel[0].response;
    const double median_ms = median_lag_ms(self);
    unsigned unsure = 0;
    for (unsigned i = 0; i < RESPONSE_POINTS; i++) {
        unsure += first->is_moved && first->point[i].coherence < LEAST_COHERENCE;
    }
    for (unsigned i = first_drive(self); i < self->channels; i++) {
        look_at_drive(self, &self->channel[i], median_ms, advice);
    }
    if (unsure > 0) {
        advise(advice, "%u of %u frequencies have a coherence below %.1f: a larger --amplitude, or a longer --for, tells more",
               unsure, RESPONSE_POINTS, LEAST_COHERENCE);
    }
    if (are_cylinders(self)) {
        look_at_limits(self, advice);
    }
}

/* --- For people --- */

static void print_or_none(double hz)
{
    if (hz > 0) {
        printf("  %9.2f", hz);
    } else {
        printf("  %9s", "-");
    }
}

static void print_table(const identify_report_t *self, const advice_t *advice)
{
    printf(_("%s: chirp of %g %s, %g to %g Hz, %g s\n\n"), self->axis, self->amplitude, self->unit, self->from_hz, self->to_hz,
           self->seconds);
    if (self->channel[0].response.is_moved) {
        printf(_("      Hz    gain      dB  phase deg   lag ms  coherence\n"));
    }
    for (unsigned i = 0; i < RESPONSE_POINTS && self->channel[0].response.is_moved; i++) {
        const response_point_t *at = &self->channel[0].response.point[i];
        printf("%8.2f  %6.3f  %6.2f  %9.1f  %7.2f  %9.3f\n", at->hz, at->gain, 20 * log10(at->gain), at->phase_deg,
               -at->phase_deg / 360 / at->hz * 1000, at->coherence);
    }
    printf("\n%s\n", _("           lag ms    gain   -3 dB Hz  -90deg Hz  following        RMS  hysteresis"));
    for (unsigned i = 0; i < self->channels; i++) {
        const response_t *found = &self->channel[i].response;
        const bool is_drive = i > 0 || !self->is_posed;
        printf("%s%-*s", is_drive ? "drive " : "", is_drive ? 2 : 8, self->channel[i].name);
        if (!found->is_moved) {
            printf(_("  no feedback\n"));
            continue;
        }
        printf("  %7.2f  %6.3f", found->lag_ms, found->gain);
        print_or_none(found->gain_3db_hz);
        print_or_none(found->phase_90_hz);
        printf("  %9.3f  %9.3f  %9.3f  %s\n", found->following_most, found->following_rms, found->hysteresis,
               i >= 1u ? "mm" : self->unit);
    }
    printf("\n");
    for (unsigned i = 0; i < advice->count; i++) {
        printf("- %s\n", advice->text[i]);
    }
    if (advice->count == 0) {
        printf(_("Nothing to recommend: limits and following window suit what was measured.\n"));
    }
}

/* --- For programs --- */

static void add_or_null(cJSON *to, const char *name, double hz)
{
    if (hz > 0) {
        (void)cJSON_AddNumberToObject(to, name, hz);
    } else {
        (void)cJSON_AddNullToObject(to, name);
    }
}

static void add_channel(cJSON *list, const identify_channel_t *channel)
{
    const response_t *found = &channel->response;
    cJSON *entry = cJSON_CreateObject();
    (void)cJSON_AddItemToArray(list, entry);
    (void)cJSON_AddStringToObject(entry, "name", channel->name);
    (void)cJSON_AddBoolToObject(entry, "moved", found->is_moved);
    if (!found->is_moved) {
        return;
    }
    (void)cJSON_AddNumberToObject(entry, "lag_ms", found->lag_ms);
    (void)cJSON_AddNumberToObject(entry, "gain", found->gain);
    add_or_null(entry, "gain_3db_hz", found->gain_3db_hz);
    add_or_null(entry, "phase_90_hz", found->phase_90_hz);
    (void)cJSON_AddNumberToObject(entry, "following_most", found->following_most);
    (void)cJSON_AddNumberToObject(entry, "following_rms", found->following_rms);
    (void)cJSON_AddNumberToObject(entry, "hysteresis", found->hysteresis);
    cJSON *points = cJSON_AddArrayToObject(entry, "response");
    for (unsigned i = 0; i < RESPONSE_POINTS; i++) {
        cJSON *point = cJSON_CreateObject();
        (void)cJSON_AddNumberToObject(point, "frequency_hz", found->point[i].hz);
        (void)cJSON_AddNumberToObject(point, "gain", found->point[i].gain);
        (void)cJSON_AddNumberToObject(point, "phase_deg", found->point[i].phase_deg);
        (void)cJSON_AddNumberToObject(point, "coherence", found->point[i].coherence);
        (void)cJSON_AddItemToArray(points, point);
    }
}

static void print_json(const identify_report_t *self, const advice_t *advice, FILE *out)
{
    cJSON *report = cJSON_CreateObject();
    (void)cJSON_AddBoolToObject(report, "ok", true);
    (void)cJSON_AddStringToObject(report, "axis", self->axis);
    (void)cJSON_AddStringToObject(report, "unit", self->unit);
    (void)cJSON_AddNumberToObject(report, "amplitude", self->amplitude);
    (void)cJSON_AddNumberToObject(report, "from_hz", self->from_hz);
    (void)cJSON_AddNumberToObject(report, "to_hz", self->to_hz);
    (void)cJSON_AddNumberToObject(report, "seconds", self->seconds);
    cJSON *channels = cJSON_AddArrayToObject(report, "channels");
    for (unsigned i = 0; i < self->channels; i++) {
        add_channel(channels, &self->channel[i]);
    }
    cJSON *texts = cJSON_AddArrayToObject(report, "advice");
    for (unsigned i = 0; i < advice->count; i++) {
        (void)cJSON_AddItemToArray(texts, cJSON_CreateString(advice->text[i]));
    }
    char *text = cJSON_PrintUnformatted(report);
    fprintf(out, "%s\n", text != NULL ? text : "{\"ok\":false}");
    free(text);
    cJSON_Delete(report);
}

/* Columns as tools/plot takes them. */
static bool write_csv(const identify_report_t *self, FILE *out)
{
    fprintf(out, "# heavectl identify %s: chirp of %g %s, %g to %g Hz, %g s\n", self->axis, self->amplitude, self->unit,
            self->from_hz, self->to_hz, self->seconds);
    fprintf(out, "axis,frequency_hz,gain,gain_db,phase_deg,lag_ms,coherence\n");
    for (unsigned i = 0; i < self->channels; i++) {
        const response_t *found = &self->channel[i].response;
        for (unsigned k = 0; k < RESPONSE_POINTS && found->is_moved; k++) {
            const response_point_t *at = &found->point[k];
            fprintf(out, "%s,%.4f,%.6f,%.4f,%.3f,%.4f,%.5f\n", self->channel[i].name, at->hz, at->gain, 20 * log10(at->gain),
                    at->phase_deg, -at->phase_deg / 360 / at->hz * 1000, at->coherence);
        }
    }
    return fflush(out) == 0 && ferror(out) == 0;
}

void identify_report_json(const identify_report_t *self, FILE *out)
{
    advice_t advice = {.count = 0};
    look(self, &advice);
    print_json(self, &advice, out);
}

int identify_report_write(const identify_report_t *self, const char *file, bool is_json)
{
    advice_t advice = {.count = 0};
    look(self, &advice);
    if (is_json) {
        print_json(self, &advice, stdout);
    } else {
        print_table(self, &advice);
    }
    if (file == NULL) {
        return EXIT_DONE;
    }
    FILE *out = fopen(file, "we");
    const bool is_written = out != NULL && write_csv(self, out);
    const int error = errno;
    if (out != NULL) {
        (void)fclose(out);
    }
    if (!is_written) {
        fprintf(stderr, "heavectl: identify: %s: %s\n", file, error_text(error));
        return EXIT_IO;
    }
    return EXIT_DONE;
}
