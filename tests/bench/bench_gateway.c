/* SPDX-License-Identifier: MIT
 * bench_gateway.c - see bench_gateway.h.
 */
#include "bench_gateway.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RISE_CYCLES 20000u
#define PI          3.14159265358979

void bench_fail(const char *what)
{
    fprintf(stderr, "bench: %s\n", what);
    exit(1);
}

void bench_put_text(bench_texts_t *texts, unsigned i, const char *text)
{
    texts->length[i] = strlen(text);
    memcpy(texts->text[i], text, texts->length[i] + 1);
}

void bench_stream_pose(double time_s, double pose[POSE_AXES])
{
    static const double k_size[POSE_AXES] = {3, 3, 5, 30, 30, 30};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose[i] = k_size[i] * sin(2 * PI * (0.2 + 0.1 * i) * time_s);
    }
}

void bench_make_stream(bench_texts_t *texts, double rate_hz, int decimals)
{
    texts->count = BENCH_TEXTS;
    for (unsigned n = 0; n < BENCH_TEXTS; n++) {
        double v[POSE_AXES];
        char text[BENCH_TEXT_MAX];
        bench_stream_pose(n / rate_hz, v);
        (void)snprintf(text, sizeof text, "@A6:%.*f,%.*f,%.*f,%.*f,%.*f,%.*f,F0#", decimals, v[0], decimals, v[1], decimals, v[2],
                       decimals, v[3], decimals, v[4], decimals, v[5]);
        bench_put_text(texts, n, text);
    }
}

/* --- Devices that do nothing --- */

static hv_status_t take_text(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    bench_gateway_t *b = ctx;
    if (b->due == 0) {
        return HV_ERR_AGAIN;
    }
    const unsigned i = b->next_text++ % b->texts->count;
    b->due--;
    *length = b->texts->length[i] < capacity ? b->texts->length[i] : capacity;
    memcpy(buffer, b->texts->text[i], *length);
    *from = (hal_udp_peer_t){.port = 9};
    return HV_OK;
}

static hv_status_t poll_drives(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    const bench_gateway_t *b = ctx;
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        feedback[i] = (drive_feedback_t){.state = DRIVE_ENABLED,
                                         .is_homed = true,
                                         .has_actual = true,
                                         .actual_mm_q32 = b->setpoint_q32[i],
                                         .actual_us = now_us};
    }
    return HV_OK;
}

static hv_status_t send_drives(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    bench_gateway_t *b = ctx;
    (void)now_us;
    memcpy(b->setpoint_q32, setpoint_q32, sizeof b->setpoint_q32);
    return HV_OK;
}

static hv_status_t request_drives(void *ctx, drives_request_t request)
{
    (void)ctx;
    (void)request;
    return HV_OK;
}

static uint8_t count_drives(void *ctx)
{
    (void)ctx;
    return DRIVES_MAX;
}

static hv_status_t write_relays(void *ctx, uint16_t mask)
{
    (void)ctx;
    (void)mask;
    return HV_OK;
}

static uint8_t count_relays(void *ctx)
{
    (void)ctx;
    return 12;
}

static hv_status_t read_inputs(void *ctx, uint32_t *levels)
{
    (void)ctx;
    *levels = 0;
    return HV_OK;
}

static uint32_t present_inputs(void *ctx)
{
    (void)ctx;
    return 0;
}

static void write_log(void *ctx, hal_log_level_t level, const char *text)
{
    bench_gateway_t *b = ctx;
    b->sum += (uint64_t)level + (uint8_t)text[0];
}

static uint32_t dropped_log(void *ctx)
{
    (void)ctx;
    return 0;
}

static gateway_io_t io_of(bench_gateway_t *b)
{
    static const hal_udp_ops_t k_udp = {.recv = take_text};
    static const drives_ops_t k_drives = {
        .poll = poll_drives,
        .send = send_drives,
        .request = request_drives,
        .count = count_drives,
    };
    static const hal_relays_ops_t k_relays = {write_relays, NULL, count_relays};
    static const hal_inputs_ops_t k_inputs = {read_inputs, present_inputs};
    static const hal_log_ops_t k_log = {write_log, dropped_log};
    return (gateway_io_t){{&k_udp, b}, {&k_drives, b}, {&k_relays, b}, {&k_inputs, b}, {&k_log, b}, {NULL, NULL}};
}

void bench_gateway_start(bench_gateway_t *self)
{
    static const bench_texts_t k_zero = {.text = {"@A6:0,0,0,0,0,0,0#"}, .length = {18}, .count = 1};
    const gateway_io_t io = io_of(self);
    self->settings = rig_hexapod();
    self->texts = &k_zero;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->setpoint_q32[i] = q32_from_q16(self->settings.settled_extension_mm_q16);
    }
    if (gateway_init(&self->gateway, &self->settings, &io) != HV_OK) {
        bench_fail("the gateway does not start");
    }
    gateway_start_settled(&self->gateway);
    for (unsigned i = 0; i < RISE_CYCLES; i++) {
        self->due = i == RISE_CYCLES / 2;
        gateway_cycle(&self->gateway, self->now_us += self->settings.cycle_us);
    }
    if (self->gateway.snapshot.state != STATE_ENGAGED || !motion_is_at_rest(&self->gateway.motion)) {
        bench_fail("the gateway is not engaged and at rest");
    }
}

void bench_gateway_stream_cycle(bench_gateway_t *self, unsigned n)
{
    self->due = n * 60 / 1000 != (n + 1) * 60 / 1000;
    gateway_cycle(&self->gateway, self->now_us += 1000);
}
