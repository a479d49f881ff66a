/* SPDX-License-Identifier: MIT
 * doctor_report.c - findings as lines; see doctor_report.h.
 */
#include "inspect/doctor_report.h"

#include <stdarg.h>
#include <string.h>

#define LINE_MAX_CHARS 92u /* what level and text take at most in one line */

void doctor_say(doctor_report_t *self, doctor_level_t level, const char *format, ...)
{
    static const char *const k_names[] = {[DOCTOR_OK] = "ok  ", [DOCTOR_WARN] = "warn", [DOCTOR_FAIL] = "FAIL"};
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    self->count[level]++;
    char *remedy = strlen(text) > LINE_MAX_CHARS ? strstr(text, " -> ") : NULL;
    if (remedy == NULL) {
        (void)fprintf(self->out, "%s  %s\n", k_names[level], text);
        return;
    }
    *remedy = '\0';
    (void)fprintf(self->out, "%s  %s\n      %s\n", k_names[level], text, remedy + 1);
}

void doctor_sum(const doctor_report_t *self)
{
    (void)fprintf(self->out, "%u ok, %u to look at, %u wrong\n", self->count[DOCTOR_OK], self->count[DOCTOR_WARN],
                  self->count[DOCTOR_FAIL]);
}
