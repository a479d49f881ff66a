/* SPDX-License-Identifier: MIT
 * frame_print.c - frames as text that means exactly the same values; see frame_print.h.
 */
#include "frame_print.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define TENTH_QUADRILLIONTHS UINT64_C(152587890625) /* of 2^-16: 10^16 / 2^16, which is whole */

static size_t print_value(char *text, size_t capacity, q16_t value)
{
    const int64_t wide = value;
    const uint64_t magnitude = (uint64_t)(wide < 0 ? -wide : wide);
    return (size_t)snprintf(text, capacity, "%s%" PRIu64 ".%016" PRIu64 ",", wide < 0 ? "-" : "", magnitude >> 16,
                            (magnitude & 0xFFFF) * TENTH_QUADRILLIONTHS);
}

size_t frame_print(const frame_t *frame, char *text)
{
    size_t length =
        (size_t)snprintf(text, FRAME_PRINT_MAX, "@%s%s:", frame_command_name(frame->command), frame->is_timed ? "T" : "");
    for (unsigned i = 0; i < frame->count; i++) {
        length += print_value(text + length, FRAME_PRINT_MAX - length, frame->value_q16[i]);
    }
    if (frame->is_timed) {
        length += (size_t)snprintf(text + length, FRAME_PRINT_MAX - length, "%" PRIu32 "#", frame->time_ms);
    } else if (frame->has_mask) {
        length += (size_t)snprintf(text + length, FRAME_PRINT_MAX - length, "%X#", (unsigned)frame->relay_mask);
    } else {
        text[length - 1] = '#'; /* in place of the last comma */
    }
    return length;
}

bool frame_print_is_same(const frame_t *a, const frame_t *b)
{
    return a->command == b->command && a->is_timed == b->is_timed && a->has_mask == b->has_mask &&
           a->relay_mask == b->relay_mask && a->time_ms == b->time_ms && a->count == b->count &&
           memcmp(a->value_q16, b->value_q16, sizeof a->value_q16) == 0;
}
