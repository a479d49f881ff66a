/* SPDX-License-Identifier: MIT
 * hostile.c - a storm of frames, garbage, requests, e-stops and drive faults on a whole gateway over simulated hardware.
 * Several platforms and cycle times.
 * What must hold in every cycle: every set-point within the limits (judged on the drive interface), no following error, and what
 * supervision.h looks at: all drives stop together, relays are safe, silence, one sender at a time, nothing un-latches itself.
 * After the storm the platform comes up again. Prints its seed; another one may be given as the first argument, cycles as the
 * second.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "random.h"
#include "rig.h"
#include "supervision.h"

#define CYCLES_DEFAULT 1500000 /* of each storm */

static rig_t m_rig;
static supervision_t m_supervision;
static unsigned m_cylinders;
static long m_judged, m_faults, m_cycles, m_together, m_estops, m_silences, m_owners;

static bool one_in(unsigned chances)
{
    return random_below(chances) == 0;
}

static double around(double range)
{
    return ((double)(random_bits() >> 11) / 4503599627370496.0 - 1) * range;
}

/* ---- what senders send ---- */

static unsigned m_host; /* the one that sends most */

static void send_bytes(const uint8_t *bytes, size_t length, uint64_t timed_ms)
{
    const unsigned host = one_in(30) ? 1 - m_host : m_host;
    const hal_udp_peer_t from = supervision_peer(host);
    supervision_sent(&m_supervision, host, timed_ms);
    (void)!sim_udp_push(&m_rig.udp, bytes, length, &from);
}

static void send_text(const char *text, uint64_t timed_ms)
{
    send_bytes((const uint8_t *)text, strlen(text), timed_ms);
}

typedef struct {
    double size;      /* of the values, as a share of what the platform has */
    unsigned gap_ms;  /* between frames; 0: irregular */
    unsigned command; /* that it keeps to; 0: any */
    double phase;
} mood_t;

static mood_t m_mood;

static void change_mood(void)
{
    static const unsigned k_gaps_ms[] = {0, 0, 1, 2, 3, 5, 10, 16, 20, 33, 40, 100, 250};
    static const double k_sizes[] = {0.01, 0.1, 0.3, 0.6, 1, 1.2, 50, 30000};
    m_mood = (mood_t){.size = k_sizes[random_below(8)], .gap_ms = k_gaps_ms[random_below(13)], .command = random_below(8)};
}

/* A value: noise, or something smooth that a stream may be. */
static double value_of(unsigned axis, double range)
{
    if (m_mood.gap_ms != 0 && m_mood.command != 0) {
        m_mood.phase += 0.003 * m_mood.gap_ms;
        return range * fmin(m_mood.size, 1.2) * sin(m_mood.phase * (1 + 0.3 * axis) + axis);
    }
    return around(range * m_mood.size);
}

static int put_values(char *text, size_t size, bool is_pose, unsigned count)
{
    int used = 0;
    for (unsigned i = 0; i < count; i++) {
        const bool is_angle = i == 6 || (is_pose && count == 4 && i == 3);
        const bool is_rotation = count <= 4 ? i < 2 : i < 3;
        const double range = is_angle ? 720 : !is_pose ? 100 : is_rotation ? 25 : 120;
        const double middle = is_pose || is_angle ? 0 : 100;
        used += snprintf(text + used, size - (size_t)used, "%.*f,", (int)random_below(7), middle + value_of(i, range));
    }
    return used;
}

static void send_frame(void)
{
    static const struct {
        const char *name;
        bool is_pose;
        unsigned count;
    } k_commands[] = {{"A6", true, 6}, {"A6", true, 6},  {"C6", false, 6}, {"A3", true, 3},
                      {"A7", true, 7}, {"C7", false, 7}, {"C3", false, 3}, {"A4", true, 4}};
    const unsigned command = m_mood.command != 0 ? m_mood.command : random_below(8);
    const bool is_timed = one_in(3);
    char text[400];
    int used = snprintf(text, sizeof text, "@%s%s:", k_commands[command].name, is_timed ? "T" : "");
    used += put_values(text + used, sizeof text - (size_t)used, k_commands[command].is_pose, k_commands[command].count);
    if (is_timed) {
        const unsigned ms = one_in(3) ? random_below(3000) : m_mood.gap_ms != 0 ? m_mood.gap_ms : random_below(60);
        (void)snprintf(text + used, sizeof text - (size_t)used, "%u#", ms);
        send_text(text, ms == 0 ? 1 : ms);
    } else {
        (void)snprintf(text + used, sizeof text - (size_t)used, "%X#", random_below(0x10000));
        send_text(text, 0);
    }
}

static void send_garbage(void)
{
    static const char *const k_garbage[] = {"@A6:nan,nan,nan,nan,nan,nan,0#",
                                            "@A6:inf,0,0,0,0,0,0#",
                                            "@A6:1e30,0,0,0,0,0,0#",
                                            "@A6:0,0,0,0,0,0",
                                            "@A6T:0,0,0,0,0,0,-5#",
                                            "@A6:0,0,0,0,0,0,12345#",
                                            "@@@@####",
                                            "",
                                            "@A6:1,2,3#",
                                            "@C6:-32768,32767,1e4,-1e4,0,0,0#",
                                            "@A6:32767,-32768,32767,-32768,32767,32767,0#",
                                            "@A6T:9,9,9,9,9,9,99999999#"};
    if (one_in(100)) {
        send_text("@A6T:0,0,0,0,0,0,3600000#", 3600000);
        return;
    }
    if (one_in(2)) {
        send_text(k_garbage[random_below(sizeof k_garbage / sizeof k_garbage[0])], 0);
        return;
    }
    uint8_t bytes[600];
    const size_t length = random_below(sizeof bytes);
    for (size_t i = 0; i < length; i++) {
        bytes[i] = one_in(3) ? (uint8_t) "@A6CT:,0.5-#"[random_below(12)] : (uint8_t)random_bits();
    }
    send_bytes(bytes, length, 60000); /* it may happen to be anything */
}

/* ---- what else happens ---- */

static void trouble(void)
{
    const uint8_t axis = (uint8_t)random_below(m_rig.drives.count);
    switch (random_below(6)) {
    case 0:
        sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
        break;
    case 1:
        rig_break(&m_rig, SIM_DRIVES_FAULT, axis, 0x2310);
        break;
    case 2:
        rig_break(&m_rig, SIM_DRIVES_BROKEN, axis, 0x7300);
        break;
    case 3:
        rig_break(&m_rig, SIM_DRIVES_OFFLINE, axis, 0);
        break;
    case 4:
        rig_break(&m_rig, SIM_DRIVES_OFFLINE, SIM_DRIVES_ALL, 0);
        break;
    default:
        rig_break(&m_rig, SIM_DRIVES_BUSY, 0, 0);
        break;
    }
}

static void mend(void)
{
    sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, false);
    rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
}

static void ask(event_t request)
{
    supervision_asked(&m_supervision, request);
    (void)!rig_request(&m_rig, request);
}

static void operate(void)
{
    static const event_t k_requests[] = {EVENT_ENGAGE, EVENT_ENGAGE, EVENT_ENGAGE, EVENT_HOLD,
                                         EVENT_RESUME, EVENT_RESUME, EVENT_PARK,   EVENT_RESET};
    ask(k_requests[random_below(8)]);
}

static unsigned gap_ms(void)
{
    if (m_mood.gap_ms != 0) {
        return m_mood.gap_ms + (one_in(4) ? random_below(3) : 0);
    }
    return one_in(5) ? random_below(400) : random_below(25);
}

/* ---- judgement ---- */

static int m_test;

static void report(bool is_ok, const char *what)
{
    printf("%s %d - %s, %u cylinders%s, %u us\n", is_ok ? "ok" : "not ok", ++m_test, what, m_cylinders,
           m_rig.settings.has_angle ? " and a motor" : "", (unsigned)m_rig.settings.cycle_us);
}

/* Engages as an operator would; once more where a drive that had broken down while OFF only shows when it is asked. */
static bool brings_up(void)
{
    mend();
    rig_run_ms(&m_rig, 3000);
    for (int attempt = 0; attempt < 2; attempt++) {
        ask(EVENT_RESET);
        rig_run_ms(&m_rig, 100);
        ask(EVENT_ENGAGE);
        if (m_rig.gateway.snapshot.state == STATE_ENGAGED || rig_run_until(&m_rig, STATE_ENGAGED, 60000)) {
            return true;
        }
    }
    return false;
}

static void judge_cycle(void *ctx)
{
    (void)ctx;
    m_cycles++;
    supervision_judge(&m_supervision);
}

static bool is_kept(void)
{
    if (m_supervision.wrong == NULL && rig_is_within_limits(&m_rig) && rig_following_errors(&m_rig) == 0) {
        return true;
    }
    const bool is_supervision = m_supervision.wrong != NULL;
    printf("# at %.3f s, now in %s: %s\n", (double)(is_supervision ? m_supervision.wrong_us : m_rig.now_us) / 1e6,
           state_name(m_rig.gateway.snapshot.state), is_supervision ? m_supervision.wrong : "a limit, or a following error");
    return false;
}

/* What the senders do next. */
static void traffic(void)
{
    if (one_in(60)) {
        change_mood();
    }
    if (one_in(400)) {
        m_host = 1 - m_host;
    }
    if (one_in(200)) { /* nobody sends */
        rig_run_ms(&m_rig, random_below(10000));
    }
    if (one_in(12)) {
        send_garbage();
    } else {
        send_frame();
    }
}

/* What operators and drives do. */
static void events(void)
{
    if (one_in(150)) {
        operate();
    }
    if (one_in(100)) {
        trouble();
        rig_run_ms(&m_rig, one_in(3) ? 1 : 5 + random_below(one_in(2) ? 20 : 2000));
        mend();
    }
}

static bool weather(long cycles)
{
    const uint64_t end_us = m_rig.now_us + (uint64_t)cycles * m_rig.settings.cycle_us;
    change_mood();
    while (m_rig.now_us < end_us) {
        traffic();
        events();
        rig_run_ms(&m_rig, gap_ms());
        if (m_rig.gateway.snapshot.state != STATE_ENGAGED && one_in(25)) {
            ask(one_in(3) ? EVENT_RESET : EVENT_ENGAGE);
        }
        if (!is_kept()) {
            return false;
        }
    }
    return true;
}

static bool storm(settings_t settings, long cycles)
{
    settings.silence_hold_ms = 1500;
    settings.silence_neutral_ms = 4000;
    settings.silence_settle_ms = 8000;
    settings.takeover_ms = 2500;
    settings.relay_safe_mask = 0x805;
    settings.relay_safe_after_ms = random_below(3) * 700;
    settings.axis[AXIS_ANGLE].wrap = one_in(2) ? ANGLE_SHORTEST : ANGLE_AS_SENT;
    for (unsigned i = AXIS_ROLL; i <= AXIS_YAW; i++) {
        settings.axis[i].wrap = one_in(2) ? ANGLE_SHORTEST : ANGLE_AS_SENT;
    }
    m_cylinders = settings.geometry.kind == KIN_HEXAPOD ? 6 : 3;
    rig_start(&m_rig, &settings, false);
    m_rig.now_us = one_in(3) ? 0 : random_bits() >> (2 + random_below(40)); /* up for years, or for longer than anything lasts */
    m_rig.is_auto_checking = true;
    supervision_init(&m_supervision, &m_rig);
    m_rig.after_cycle = judge_cycle;
    const bool is_up = rig_run_until(&m_rig, STATE_ENGAGED, 60000);
    report(is_up, "comes up");
    const bool is_good = weather(cycles);
    report(is_good, "limits, following errors and supervision");
    const bool is_back = brings_up() && is_kept();
    report(is_back, "engages again after the storm");
    const counters_t *c = &m_rig.gateway.snapshot.counters;
    printf("# shares: speed %.9f, acceleration %.9f, jerk %.9f; %u faults, %u impossible, %u stretched\n", m_rig.check.speed,
           m_rig.check.accel, m_rig.check.jerk, c->faults, c->impossible, c->stretched);
    m_judged += m_rig.check.cycles;
    m_faults += c->faults;
    m_together += m_supervision.faults;
    m_estops += m_supervision.estops;
    m_silences += m_supervision.holds;
    m_owners += m_supervision.owners;
    return is_up && is_good && is_back;
}

static settings_t with(settings_t settings, bool has_angle, uint32_t cycle_us)
{
    settings.has_angle = has_angle;
    settings.cycle_us = cycle_us;
    return settings;
}

static settings_t hinged(void)
{
    settings_t settings = rig_tripod();
    settings.geometry.kind = KIN_TRIPOD_3RPS;
    return settings;
}

int main(int count, char **arguments)
{
    const uint64_t seed = count > 1 ? strtoull(arguments[1], NULL, 0) : 20261121;
    const long cycles = count > 2 ? strtol(arguments[2], NULL, 0) : CYCLES_DEFAULT;
    const settings_t platforms[] = {with(rig_hexapod(), true, 1000), with(rig_hexapod(), false, 500),
                                    with(rig_hexapod(), true, 4000), with(rig_tripod(), false, 1000),
                                    with(rig_tripod(), true, 500),   with(hinged(), true, 1000)};
    const unsigned storms = sizeof platforms / sizeof platforms[0];
    bool is_ok = true;
    printf("TAP version 13\n1..%u\n# seed %llu, %ld cycles each; again: hostile SEED CYCLES\n", 3 * storms,
           (unsigned long long)seed, cycles);
    random_begin(seed * 0x9E3779B97F4A7C15u + 1);
    for (unsigned i = 0; i < storms; i++) {
        is_ok &= storm(platforms[i], cycles);
    }
    printf("# figure %ld cycles judged at the drives, with faults of drives and e-stops\n# figure %ld faults in them\n", m_judged,
           m_faults);
    printf("# figure %ld cycles in which supervision was judged: stops together, relays, silence, senders\n", m_cycles);
    printf("# %ld times a drive went bad, %ld e-stops, %ld holds by silence, %ld changes of the sender\n", m_together, m_estops,
           m_silences, m_owners);
    return is_ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
