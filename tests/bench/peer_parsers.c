/* SPDX-License-Identifier: MIT
 * peer_parsers.c - frames read with what the C library has.
 */
#include "peers.h"

#include <stdio.h>
#include <stdlib.h>

bool peer_sscanf(const char *text, size_t length, peer_frame_t *frame)
{
    /* by count of values: the last field is hexadecimal, or a time */
    static const char *const k_format[8][2] = {
        [3] = {"%f,%f,%f,%x#%n", "%f,%f,%f,%u#%n"},
        [4] = {"%f,%f,%f,%f,%x#%n", "%f,%f,%f,%f,%u#%n"},
        [6] = {"%f,%f,%f,%f,%f,%f,%x#%n", "%f,%f,%f,%f,%f,%f,%u#%n"},
        [7] = {"%f,%f,%f,%f,%f,%f,%f,%x#%n", "%f,%f,%f,%f,%f,%f,%f,%u#%n"},
    };
    const char *at = peer_read_head(text, frame);
    float v[7] = {0};
    unsigned last = 0;
    int end = 0;
    if (at == NULL || k_format[frame->count][0] == NULL) {
        return false;
    }
    const char *format = k_format[frame->count][frame->is_timed];
    switch (frame->count) {
    case 3:
        (void)sscanf(at, format, &v[0], &v[1], &v[2], &last, &end);
        break;
    case 4:
        (void)sscanf(at, format, &v[0], &v[1], &v[2], &v[3], &last, &end);
        break;
    case 6:
        (void)sscanf(at, format, &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &last, &end);
        break;
    default:
        (void)sscanf(at, format, &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &v[6], &last, &end);
        break;
    }
    for (unsigned i = 0; i < frame->count; i++) {
        frame->value_q16[i] = peer_q16((double)v[i]);
    }
    if (frame->is_timed) {
        frame->time_ms = last;
    } else {
        frame->relay_mask = (uint16_t)(last & 0xFFFu);
    }
    return end != 0 && (size_t)(at - text) + (size_t)end == length;
}

bool peer_strtof(const char *text, size_t length, peer_frame_t *frame)
{
    const char *at = peer_read_head(text, frame);
    char *end = NULL;
    for (unsigned i = 0; at != NULL && i < frame->count; i++) {
        const float value = strtof(at, &end);
        if (end == at || *end != ',') {
            return false;
        }
        frame->value_q16[i] = peer_q16((double)value);
        at = end + 1;
    }
    if (at == NULL) {
        return false;
    }
    const unsigned long last = strtoul(at, &end, frame->is_timed ? 10 : 16);
    if (frame->is_timed) {
        frame->time_ms = (uint32_t)last;
    } else {
        frame->relay_mask = (uint16_t)(last & 0xFFFu);
    }
    return end != at && *end == '#' && (size_t)(end - text) + 1 == length;
}
