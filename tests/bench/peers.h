/* SPDX-License-Identifier: MIT
 * peers.h - what people would use instead of Heave's parts, for bench_peers.c to time beside them.
 * Written for speed with the usual means, in double precision; shares no code with src/.
 */
#ifndef BENCH_PEERS_H
#define BENCH_PEERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** One frame as a peer reads it. */
typedef struct {
    char command[2];
    bool is_timed;
    uint16_t relay_mask; /**< the low 12 bits; 0 in the timed form */
    uint32_t time_ms;    /**< 0 in the untimed form */
    unsigned count;
    int32_t value_q16[7]; /**< to the nearest */
} peer_frame_t;

/** What all parsers begin with: head, command, T and colon.
 *  @return the first value, NULL where it is no frame */
static inline const char *peer_read_head(const char *text, peer_frame_t *frame)
{
    if (text[0] != '@' || (text[1] != 'A' && text[1] != 'C') || text[2] < '3' || text[2] > '7') {
        return NULL;
    }
    frame->command[0] = text[1];
    frame->command[1] = text[2];
    frame->count = (unsigned)(text[2] - '0');
    frame->is_timed = text[3] == 'T';
    frame->relay_mask = 0;
    frame->time_ms = 0;
    return text[3 + frame->is_timed] == ':' ? text + 4 + frame->is_timed : NULL;
}

static inline int32_t peer_q16(double value)
{
    return (int32_t)(value < 0 ? value * 65536 - 0.5 : value * 65536 + 0.5);
}

/** Reads one frame, which is complete and ends in NUL. float values. */
bool peer_sscanf(const char *text, size_t length, peer_frame_t *frame);
bool peer_strtof(const char *text, size_t length, peer_frame_t *frame);

/** C++17; double, as that is not slower. */
bool peer_from_chars(const char *text, size_t length, peer_frame_t *frame);

/** A hexapod in mm. */
typedef struct {
    double base[6][3];
    double plate[6][3];
    double retracted[6];
    double mrp[3];
    double zero_height;
} peer_hexapod_t;

/** The textbook inverse solution: extensions in mm for roll, pitch, yaw [deg], x, y, z [mm]. */
void peer_inverse(const peer_hexapod_t *hexapod, const double pose[6], double extension[6]);

/** The textbook forward solution: Newton's method from a guess, LU decomposition with partial pivoting. Stops after the step
 * taken from less than 0.5 um. @return false where 20 steps do not do. */
bool peer_forward(const peer_hexapod_t *hexapod, const double extension[6], const double guess[6], double pose[6]);

/** Ruckig for seven axes, 1 ms, limits in mm (or deg), s; at rest on 0. */
void peer_ruckig_start(double speed, double accel, double jerk);

/** Plans to the new target, to be reached at rest, and goes on by a cycle. @return false where Ruckig gives up: it stays where it
 * was. */
bool peer_ruckig_step(const double target[7], double position[7]);

#ifdef __cplusplus
}
#endif
#endif
