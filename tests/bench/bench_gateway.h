/* SPDX-License-Identifier: MIT
 * bench_gateway.h - a gateway between devices that do nothing, so that only the core is counted, and texts for it to read.
 */
#ifndef BENCH_GATEWAY_H
#define BENCH_GATEWAY_H

#include "rig.h"

#define BENCH_TEXTS    4096u /* a power of 2 */
#define BENCH_TEXT_MAX 128u

/** Datagrams, each ended by NUL. */
typedef struct {
    char text[BENCH_TEXTS][BENCH_TEXT_MAX];
    size_t length[BENCH_TEXTS];
    unsigned count; /**< in use: a power of 2 */
} bench_texts_t;

typedef struct {
    gateway_t gateway;
    settings_t settings;
    uint64_t now_us;
    q32_t setpoint_q32[DRIVES_MAX];
    const bench_texts_t *texts; /**< what arrives */
    unsigned next_text;
    unsigned due; /**< datagrams that wait */
    uint64_t sum; /**< of what the log is told, so that none is written in vain */
} bench_gateway_t;

/** Says what is wrong and ends the program with status 1. */
void bench_fail(const char *what);

void bench_put_text(bench_texts_t *texts, unsigned i, const char *text);

/** A6 poses of a smooth stream, one a frame, with so many decimals; all BENCH_TEXTS. */
void bench_make_stream(bench_texts_t *texts, double rate_hz, int decimals);

/** The pose of that stream at a time. deg and mm. */
void bench_stream_pose(double time_s, double pose[POSE_AXES]);

/** Up and engaged, the first pose taken over, at rest; the texts are still to be set. */
void bench_gateway_start(bench_gateway_t *self);

/** One cycle of 1 ms, the n-th, with a text at 60 Hz. */
void bench_gateway_stream_cycle(bench_gateway_t *self, unsigned n);

#endif
