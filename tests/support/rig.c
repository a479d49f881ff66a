/* SPDX-License-Identifier: MIT
 * rig.c - a whole gateway over simulated hardware for tests.
 */
#include "rig.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define Q(x) ((q16_t)lround((x)*65536.0))

static void axes_of(settings_t *s)
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const bool is_rotation = i < AXIS_X || i == AXIS_ANGLE;
        s->axis[i] = (axis_settings_t){.sign = 1,
                                       .scale_q16 = Q16_ONE,
                                       .min_q16 = Q(is_rotation ? -25 : -120),
                                       .max_q16 = Q(is_rotation ? 25 : 120),
                                       .speed_q16 = Q(is_rotation ? 40 : 400),
                                       .accel_q16 = Q(is_rotation ? 300 : 3000),
                                       .jerk = is_rotation ? 5000 : 50000};
    }
    s->axis[AXIS_ANGLE].min_q16 = Q(-3600);
    s->axis[AXIS_ANGLE].max_q16 = Q(3600);
}

static settings_t common(void)
{
    settings_t s = {.cycle_us = 1000,
                    .engage = ENGAGE_AUTO,
                    .settled_extension_mm_q16 = Q(6),
                    .margin_mm_q16 = Q(5),
                    .cylinder_speed_mm_s_q16 = Q(400),
                    .cylinder_accel_mm_s2_q16 = Q(3000),
                    .cylinder_jerk_mm_s3 = 50000,
                    .intensity_start_percent = 100,
                    .intensity_max_percent = 100,
                    .intensity_ramp_ms = 2000,
                    .engage_speed_mm_s_q16 = Q(50),
                    .engage_accel_mm_s2_q16 = Q(200),
                    .jog_mm_s_q16 = Q(20),
                    .jog_deg_s_q16 = Q(5),
                    .signal_mm_q16 = Q(10),
                    .signal_deg_q16 = Q(3),
                    .signal_mm_s_q16 = Q(100),
                    .spike_gate = 10,
                    .relays.count = 12,
                    .healthy = {.toggle_ms = 10, .off_ms = 100, .late_cycles = 3}};
    axes_of(&s);
    return s;
}

static void joint(q16_t *at, double radius, double degrees)
{
    at[0] = Q(radius * cos(degrees * acos(-1) / 180));
    at[1] = Q(radius * sin(degrees * acos(-1) / 180));
}

/* Height at which cylinder 1 is half out. */
static q16_t height_for(const kin_geometry_t *g, double length)
{
    const double dx = (g->base_mm_q16[0][0] - g->plate_mm_q16[0][0]) / 65536.0;
    const double dy = (g->base_mm_q16[0][1] - g->plate_mm_q16[0][1]) / 65536.0;
    return Q(sqrt(length * length - dx * dx - dy * dy));
}

settings_t rig_hexapod(void)
{
    static const double k_base[] = {-8, 8, 112, 128, 232, 248};
    static const double k_plate[] = {-52, 52, 68, 172, 188, 292};
    settings_t s = common();
    s.has_angle = true;
    for (unsigned i = 0; i < 6; i++) {
        joint(s.geometry.base_mm_q16[i], 600, k_base[i]);
        joint(s.geometry.plate_mm_q16[i], 500, k_plate[i]);
        s.geometry.retracted_mm_q16[i] = Q(700);
        s.stroke_mm_q16[i] = Q(200);
    }
    s.geometry.zero_height_mm_q16 = height_for(&s.geometry, 800);
    return s;
}

settings_t rig_tripod(void)
{
    settings_t s = common();
    s.geometry.kind = KIN_TRIPOD;
    for (unsigned i = 0; i < 3; i++) {
        joint(s.geometry.base_mm_q16[i], 420, 120.0 * i);
        joint(s.geometry.plate_mm_q16[i], 380, 120.0 * i);
        s.geometry.retracted_mm_q16[i] = Q(520);
        s.stroke_mm_q16[i] = Q(200);
    }
    s.geometry.zero_height_mm_q16 = height_for(&s.geometry, 620);
    return s;
}

static double share(q32_t value, double per_unit, double limit)
{
    return fabs((double)value) / 4294967296.0 * per_unit / limit;
}

static void max_into(double *worst, double value)
{
    *worst = value > *worst ? value : *worst;
}

/* How far a cylinder is outside the stroke less its margins. */
static double outside_mm(const settings_t *s, unsigned i, q32_t pos)
{
    const double mm = (double)pos / 4294967296.0;
    return fmax(s->margin_mm_q16 / 65536.0 - mm, mm - (s->stroke_mm_q16[i] - s->margin_mm_q16) / 65536.0);
}

static void check_axis(rig_t *self, unsigned i, q32_t pos)
{
    rig_check_t *c = &self->check;
    const settings_t *s = &self->settings;
    const bool is_motor = i == self->gateway.snapshot.cylinders;
    const axis_settings_t *motor = &s->axis[AXIS_ANGLE];
    const double rate = 1e6 / s->cycle_us;
    const q32_t vel = pos - c->last_q32[i];
    const q32_t acc = vel - c->last_vel_q32[i];
    const q32_t jerk = acc - c->last_acc_q32[i];
    if (c->history >= 3) {
        max_into(&c->speed, share(vel, rate, (is_motor ? motor->speed_q16 : s->cylinder_speed_mm_s_q16) / 65536.0));
        max_into(&c->accel, share(acc, rate * rate, (is_motor ? motor->accel_q16 : s->cylinder_accel_mm_s2_q16) / 65536.0));
        max_into(&c->jerk, share(jerk, rate * rate * rate, is_motor ? motor->jerk : s->cylinder_jerk_mm_s3));
    }
    if (!is_motor && c->history > 0) {
        const double outside = outside_mm(s, i, pos);
        max_into(&c->outside_mm,
                 outside > outside_mm(s, i, c->last_q32[i]) ? outside : 0); /* it may come in from where homing ended */
    }
    c->last_q32[i] = pos;
    c->last_vel_q32[i] = vel;
    c->last_acc_q32[i] = acc;
}

/* Drives that follow, apart from those that are broken. */
static bool are_drives_led(const rig_t *self)
{
    for (unsigned i = 0; i < self->drives.count; i++) {
        const sim_drive_t *axis = &self->drives.axis[i];
        if (!axis->is_offline && axis->state != DRIVE_ENABLED && axis->state != DRIVE_FAULT) {
            return false;
        }
    }
    return true;
}

static bool are_drives_enabled(const rig_t *self)
{
    for (unsigned i = 0; i < self->drives.count; i++) {
        if (self->drives.axis[i].is_offline || self->drives.axis[i].state != DRIVE_ENABLED) {
            return false;
        }
    }
    return true;
}

/* Steps between two cycles with every drive enabled, whatever the gateway is doing. */
static void watch_steps(rig_t *self, const q32_t *setpoint_q32)
{
    const bool is_enabled = are_drives_enabled(self);
    for (unsigned i = 0; i < self->drives.count; i++) {
        const q32_t step =
            setpoint_q32[i] > self->sent_q32[i] ? setpoint_q32[i] - self->sent_q32[i] : self->sent_q32[i] - setpoint_q32[i];
        self->step_max_q32 = is_enabled && self->was_enabled && step > self->step_max_q32 ? step : self->step_max_q32;
        self->sent_q32[i] = setpoint_q32[i];
    }
    self->was_enabled = is_enabled;
}

static hv_status_t spy_send(void *ctx, uint64_t now_us, const q32_t *setpoint_q32)
{
    rig_t *self = ctx;
    if (self->drives.is_busy) { /* what the drives never get is not judged: the next set follows on the last one taken */
        return drives_send(self->inner, now_us, setpoint_q32);
    }
    watch_steps(self, setpoint_q32);
    if (self->is_auto_checking) {
        self->is_checking = are_drives_led(self) && !self->gateway.sequencer.drive_control.is_tracking;
    }
    for (unsigned i = 0; self->is_checking && i < self->drives.count; i++) {
        check_axis(self, i, setpoint_q32[i]);
    }
    self->check.cycles += self->is_checking;
    self->check.history = self->is_checking ? self->check.history + 1 : 0;
    return drives_send(self->inner, now_us, setpoint_q32);
}

static hv_status_t spy_poll(void *ctx, uint64_t now_us, drive_feedback_t *feedback)
{
    return drives_poll(((rig_t *)ctx)->inner, now_us, feedback);
}

static hv_status_t spy_request(void *ctx, drives_request_t request)
{
    return drives_request(((rig_t *)ctx)->inner, request);
}

static uint8_t spy_count(void *ctx)
{
    return drives_count(((rig_t *)ctx)->inner);
}

static bool spy_is_failing(void *ctx)
{
    return ((rig_t *)ctx)->is_failing;
}

static hv_status_t spy_request_one(void *ctx, uint8_t axis, drives_request_t request)
{
    return drives_request_one(((rig_t *)ctx)->inner, axis, request);
}

static bool spy_counts(void *ctx, uint8_t axis, int64_t *out)
{
    return drives_counts(((rig_t *)ctx)->inner, axis, out);
}

static const drives_ops_t k_spy = {.poll = spy_poll,
                                   .send = spy_send,
                                   .request = spy_request,
                                   .count = spy_count,
                                   .is_failing = spy_is_failing,
                                   .request_one = spy_request_one,
                                   .counts = spy_counts};

static void fail(const char *what)
{
    fprintf(stderr, "rig: %s\n", what);
    abort();
}

void rig_start(rig_t *self, const settings_t *settings, bool is_settled)
{
    memset(self, 0, sizeof *self);
    self->settings = *settings;
    const unsigned cylinders = settings->geometry.kind == KIN_HEXAPOD ? 6 : 3;
    const unsigned count = cylinders + (settings->has_angle ? 1 : 0);
    for (unsigned i = 0; i < count; i++) {
        const bool is_motor = i == cylinders;
        self->drive_config[i] = (sim_drive_config_t){
            .start_q32 = is_motor     ? 0
                         : is_settled ? q32_from_q16(settings->settled_extension_mm_q16)
                                      : q32_from_int(20 + (int)i),
            .travel_min_q32 = is_motor ? q32_from_int(-100000) : 0,
            .travel_max_q32 = is_motor ? q32_from_int(100000) : q32_from_q16(settings->stroke_mm_q16[i]),
            .time_constant_us = 8000,
            .enable_us = 50000,
            .homing_per_s_q32 = q32_from_int(30),
            .step_max_q32 =
                Q32_ONE / 2000 * (settings->cycle_us > 2000 ? settings->cycle_us : 2000), /* 500 mm/s, at least 1 mm */
            .lag_max_q32 = q32_from_int(20),
            .is_homed = is_settled,
            .is_enabled = is_settled};
    }
    if (sim_drives_init(&self->drives, (uint8_t)count, self->drive_config, NULL, 0) != HV_OK) {
        fail("sim_drives_init");
    }
    sim_udp_init(&self->udp);
    sim_relays_init(&self->relays, 12);
    sim_relays_init(&self->healthy, 1);
    sim_inputs_init(&self->inputs, INPUT_ESTOP);
    sim_log_init(&self->log);
    self->inner = sim_drives_hal(&self->drives);
    const gateway_io_t io = {.udp = sim_udp_hal(&self->udp),
                             .drives = {.ops = &k_spy, .ctx = self},
                             .relays = sim_relays_hal(&self->relays),
                             .inputs = sim_inputs_hal(&self->inputs),
                             .log = sim_log_hal(&self->log),
                             .healthy = sim_relays_hal(&self->healthy)};
    if (gateway_init(&self->gateway, &self->settings, &io) != HV_OK) {
        fail("gateway_init");
    }
    if (is_settled) {
        gateway_start_settled(&self->gateway);
    }
    self->is_checking = is_settled;
}

void rig_send(rig_t *self, const char *text)
{
    if (sim_udp_push(&self->udp, (const uint8_t *)text, strlen(text), NULL) != HV_OK) {
        fail("sim_udp_push");
    }
}

void rig_send_from(rig_t *self, uint8_t host, const char *text)
{
    const hal_udp_peer_t from = {.address = {10, 0, 0, host}, .port = 4000};
    if (sim_udp_push(&self->udp, (const uint8_t *)text, strlen(text), &from) != HV_OK) {
        fail("sim_udp_push");
    }
}

void rig_sendf(rig_t *self, const char *format, ...)
{
    char text[600];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    rig_send(self, text);
}

void rig_break(rig_t *self, sim_drives_fault_kind_t kind, uint8_t axis, uint32_t code)
{
    sim_drives_inject(&self->drives, &(sim_drives_fault_t){.kind = kind, .axis = axis, .code = code});
}

hv_status_t rig_request(rig_t *self, event_t request)
{
    return gateway_request(&self->gateway, request, self->now_us);
}

bool rig_was_logged(rig_t *self, const char *text)
{
    const sim_log_line_t *line;
    while ((line = sim_log_pop(&self->log)) != NULL) {
        if (strstr(line->text, text) != NULL) {
            return true;
        }
    }
    return false;
}

bool rig_is_within_limits(const rig_t *self)
{
    const rig_check_t *c = &self->check;
    const bool is_within = c->speed <= 1 + 1e-9 && c->accel <= 1 + 1e-9 && c->jerk <= 1 + 1e-9 && c->outside_mm <= 1e-9;
    if (!is_within) {
        printf("limits: speed %.10f, acceleration %.10f, jerk %.10f, outside %.9f mm\n", c->speed, c->accel, c->jerk,
               c->outside_mm);
    }
    return is_within;
}

unsigned rig_following_errors(const rig_t *self)
{
    unsigned errors = 0;
    for (unsigned i = 0; i < self->drives.count; i++) {
        errors += self->drives.axis[i].following_errors;
    }
    return errors;
}

static void cycle(rig_t *self)
{
    gateway_cycle(&self->gateway, self->now_us);
    self->now_us += self->settings.cycle_us;
    if (self->after_cycle != NULL) {
        self->after_cycle(self->after_cycle_ctx);
    }
}

void rig_run_ms(rig_t *self, unsigned ms)
{
    for (uint64_t end_us = self->now_us + (uint64_t)ms * 1000; self->now_us < end_us;) {
        cycle(self);
    }
}

bool rig_run_until(rig_t *self, state_t state, unsigned most_ms)
{
    for (uint64_t end_us = self->now_us + (uint64_t)most_ms * 1000; self->now_us < end_us;) {
        cycle(self);
        if (self->gateway.snapshot.state == state) {
            return true;
        }
    }
    return false;
}

double rig_cylinder_mm(const rig_t *self, unsigned cylinder)
{
    return (double)self->gateway.snapshot.extension_mm_q32[cylinder - 1] / 4294967296.0;
}

double rig_angle_deg(const rig_t *self)
{
    return (double)self->gateway.snapshot.angle_deg_q32 / 4294967296.0;
}

double rig_pose(const rig_t *self, unsigned axis)
{
    return (double)self->gateway.snapshot.sent.axis_q32[axis] / 4294967296.0;
}

void rig_check_reset(rig_t *self)
{
    self->check = (rig_check_t){0};
}

__attribute__((weak)) void hv_assert_failed(const char *file, int line) /* a test may have its own */
{
    fprintf(stderr, "%s:%d: assertion failed\n", file, line);
    abort();
}
