/* SPDX-License-Identifier: MIT
 * trace.c - rows of a trace; see trace.h.
 */
#include "record/trace.h"

#include <string.h>

#include "common/decimal.h"
#include "heave/motion.h" // MOTION_CLAMPED and its kin

#define PLACES 9u

/* Flags that are no motion flags follow those in the same word. */
enum {
    FLAG_FAULT = 1u << 8,
    FLAG_ESTOP = 1u << 9,
    FLAG_SILENT = 1u << 10,
    FLAG_LATE = 1u << 11,
    FLAG_BEFORE_ZERO = 1u << 12,
    FLAG_LOOSE = 1u << 13
};

static const struct {
    unsigned flag;
    const char *word;
} k_words[] = {
    {MOTION_CLAMPED, "clamped"},     {MOTION_SPEED, "speed"},           {MOTION_ACCEL, "accel"},
    {MOTION_STRETCHED, "stretched"}, {MOTION_TAKEOVER, "takeover"},     {MOTION_IN_CYLINDERS, "cylinders"},
    {MOTION_OFF_PATH, "off-path"},   {MOTION_NO_POSE, "no-pose"},       {FLAG_FAULT, "fault"},
    {FLAG_ESTOP, "estop"},           {FLAG_SILENT, "silent"},           {FLAG_LATE, "late"},
    {FLAG_LOOSE, "loose"},           {FLAG_BEFORE_ZERO, "before-zero"},
};

/* In service, a drive has no torque or moves by itself: its set-point is where it is. */
static bool is_loose(const snapshot_t *s)
{
    const uint32_t all = (1u << (s->cylinders + (s->has_angle ? 1u : 0u))) - 1u;
    return s->state == STATE_SERVICE && (s->service.torque & ~s->service.homing) != all;
}

static unsigned flags_of(const snapshot_t *s, bool is_late)
{
    return (s->flags & 0xFFu) | (s->state == STATE_FAULT ? FLAG_FAULT : 0u) |
           (s->state == STATE_ESTOP || s->is_estop_active ? FLAG_ESTOP : 0u) | (s->is_held_by_silence ? FLAG_SILENT : 0u) |
           (is_late ? FLAG_LATE : 0u) | (is_loose(s) ? FLAG_LOOSE : 0u);
}

void trace_fill(trace_row_t *self, const snapshot_t *snapshot, uint64_t t_us, bool is_late, bool is_before_zero)
{
    *self = (trace_row_t){.t_us = t_us,
                          .relay_mask = snapshot->relay_mask,
                          .flags = (uint16_t)(flags_of(snapshot, is_late) | (is_before_zero ? FLAG_BEFORE_ZERO : 0u)),
                          .state = (uint8_t)snapshot->state};
    memcpy(self->value_q32, snapshot->sent.axis_q32, sizeof snapshot->sent.axis_q32);
    self->value_q32[AXIS_ANGLE] = snapshot->has_angle ? snapshot->angle_deg_q32 : 0;
    for (unsigned i = 0; i < snapshot->cylinders; i++) {
        self->value_q32[POSE_AXES + 1 + i] = snapshot->extension_mm_q32[i];
    }
}

size_t trace_header(char to[TRACE_LINE_MAX])
{
    static const char k_header[] = "t_ms,state,roll_deg,pitch_deg,yaw_deg,x_mm,y_mm,z_mm,angle_deg,"
                                   "c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm,relays,flags\n";
    memcpy(to, k_header, sizeof k_header - 1);
    return sizeof k_header - 1;
}

static size_t put_flags(char *to, unsigned flags)
{
    size_t length = 0;
    for (size_t i = 0; flags != 0 && i < sizeof k_words / sizeof k_words[0]; i++) {
        if ((flags & k_words[i].flag) != 0) {
            if (length > 0) {
                to[length++] = '|';
            }
            length += decimal_put_text(&to[length], k_words[i].word);
            flags &= ~k_words[i].flag;
        }
    }
    return length;
}

size_t trace_format(const trace_row_t *self, char to[TRACE_LINE_MAX])
{
    size_t length = decimal_put_ms(to, self->t_us);
    to[length++] = ',';
    length += decimal_put_text(&to[length], state_name((state_t)self->state));
    to[length++] = ',';
    for (unsigned i = 0; i < TRACE_VALUES; i++) {
        length += decimal_put_q32(&to[length], self->value_q32[i], PLACES);
        to[length++] = ',';
    }
    length += decimal_put_hex(&to[length], self->relay_mask, 4);
    to[length++] = ',';
    length += put_flags(&to[length], self->flags);
    to[length++] = '\n';
    return length;
}
