/* SPDX-License-Identifier: MIT
 * doctor_report.c - findings as lines; see doctor_report.h.
 */
#include "inspect/doctor_report.h"

#include <stdarg.h>
#include <string.h>

#include "common/columns.h"
#include "common/translate.h"

#define LINE_MAX_COLUMNS 92u /* what level and text take at most in one line */
#define LEVEL_COLUMNS    6u

void doctor_say(doctor_report_t *self, doctor_level_t level, const char *format, ...)
{
    static const char *const k_names[] = {[DOCTOR_OK] = N_("ok"), [DOCTOR_WARN] = N_("warn"), [DOCTOR_FAIL] = N_("FAIL")};
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, translate(format), arguments);
    va_end(arguments);
    self->count[level]++;
    columns_put(self->out, translate(k_names[level]), LEVEL_COLUMNS);
    char *remedy = columns_of(text) > LINE_MAX_COLUMNS ? strstr(text, " -> ") : NULL;
    if (remedy == NULL) {
        (void)fprintf(self->out, "%s\n", text);
        return;
    }
    *remedy = '\0';
    (void)fprintf(self->out, "%s\n      %s\n", text, remedy + 1);
}

void doctor_sum(const doctor_report_t *self)
{
    (void)fprintf(self->out, _("%u ok, %u to look at, %u wrong\n"), self->count[DOCTOR_OK], self->count[DOCTOR_WARN],
                  self->count[DOCTOR_FAIL]);
}
