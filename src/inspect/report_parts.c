/* SPDX-License-Identifier: MIT
 * report_parts.c - figures as the report of --check writes them; see report_parts.h.
 */
#include "inspect/report_parts.h"

#include <math.h>

#include "common/translate.h"
#include "config/keys.h"

double report_zero_free(double value)
{
    return fabs(value) < 0.0005 ? 0.0 : value;
}

double report_number(q32_t value_q32)
{
    return report_zero_free((double)value_q32 / (double)Q32_ONE);
}

double report_number_q16(q16_t value_q16)
{
    return (double)value_q16 / (double)Q16_ONE;
}

const char *report_cause_text(unsigned cause, config_text_t *text)
{
    config_text_clear(text);
    if (cause < CYLINDERS_MAX) {
        config_text_add(text, _("cylinder %u"), cause + 1u);
    } else {
        config_text_add(text, "%s", cause == ENVELOPE_SINGULAR ? _("singularity") : _("range"));
    }
    return text->data;
}

const char *report_pose_text(const report_t *self, const pose_t *pose, config_text_t *text)
{
    config_text_clear(text);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        if (self->envelope.has_axis[axis]) {
            config_text_add(text, "%s%s %.1f", text->length > 0 ? " " : "", config_axis_section[axis],
                            fabs(report_number(pose->axis_q32[axis])) < 0.05 ? 0.0 : report_number(pose->axis_q32[axis]));
        }
    }
    return text->data;
}
