/* SPDX-License-Identifier: MIT
 * kills.c - the gateway is killed at random moments, also between two frames of one set, and started again: on CANopen drives
 * that watch its heartbeat. A drive may have sagged meanwhile, or lost its power. Judged at the drives:
 * - no step above one count when a drive is enabled: the first target is where it is;
 * - no target after the kill but one that was on the wire, and none of the life before in the next one;
 * - every drive that had torque stops by itself, all of them together, when its watch has run out;
 * - between two targets no more than the speed limit;
 * - it comes up again.
 * Prints its seed; another one may be given as the first argument, kills as the second.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "canopen_drives.h"
#include "heave/cia402.h"
#include "random.h"
#include "rig.h"

#define KILLS_DEFAULT  1000
#define AXES           CANOPEN_DRIVES
#define CYCLE_US       1000u
#define PERIOD_US      4000u
#define FRAME_US       110u /* on the wire, at 1 Mbit/s */
#define WATCH_MS       150u
#define COUNTS         1000 /* of a mm, or a deg */
#define SETTLED_COUNTS 6000
#define UP_CYCLES_MOST 60000u
#define NEVER          UINT32_MAX

static struct {
    settings_t settings;
    cia402_config_t config;
    sim_can_bus_t bus;
    sim_can_t node;
    canopen_drives_t twin;
    cia402_t driver;
    gateway_t gateway;
    sim_udp_t udp;
    sim_relays_t relays;
    sim_inputs_t inputs;
    sim_log_t log;
    hal_can_t inner;
    uint64_t now_us;
    uint32_t sends_left; /* until the process dies */
    bool is_alive;
} m;

/* What is seen of a drive. */
static struct {
    uint32_t enabled, setpoints;
    int32_t position, target;
    bool is_first, had_torque;
} m_seen[AXES];

static long m_kills, m_enabled, m_targets, m_split, m_in_motion, m_sagged, m_without_power;
static int32_t m_largest_first;
static const char *m_wrong;

static void wrong(const char *what, unsigned drive)
{
    if (m_wrong == NULL) {
        printf("# kill %ld, at %.3f s, drive %u: %s\n", m_kills, (double)m.now_us / 1e6, drive + 1, what);
    }
    m_wrong = what;
}

/* ---- a process that can die ---- */

static hv_status_t dying_send(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    if (!m.is_alive) {
        return HV_ERR_IO; /* nothing of a dead one reaches the bus */
    }
    m.is_alive = m.sends_left == NEVER || m.sends_left-- > 1;
    return hal_can_send(m.inner, frame);
}

static hv_status_t dying_recv(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    (void)ctx;
    return hal_can_recv(m.inner, out, rx_time_us);
}

static hv_status_t dying_bus_state(void *ctx, hal_can_state_t *out)
{
    (void)ctx;
    return hal_can_bus_state(m.inner, out);
}

static hv_status_t dying_unconfirmed(void *ctx, uint32_t *frames)
{
    (void)ctx;
    return hal_can_unconfirmed(m.inner, frames);
}

static hv_status_t dying_restart(void *ctx)
{
    (void)ctx;
    return hal_can_restart(m.inner);
}

static const hal_can_ops_t k_dying = {dying_send, dying_recv, dying_bus_state, dying_unconfirmed, dying_restart, NULL};

static void give_up(const char *what)
{
    printf("Bail out! %s\n", what);
    exit(EXIT_FAILURE);
}

/* A new process: nothing is left of the one before but what is on the bus and in the drives. */
static void start(void)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    const uint32_t filters = cia402_filters(&m.config, filter);
    if (m_kills > 0) {
        sim_can_close(&m.node);
    }
    sim_udp_init(&m.udp);
    sim_relays_init(&m.relays, 12);
    sim_log_init(&m.log);
    m.inner = sim_can_hal(&m.node);
    m.sends_left = NEVER;
    m.is_alive = true;
    if (sim_can_open(&m.node, &m.bus, filter, filters) != HV_OK ||
        cia402_init(&m.driver, &m.config, (hal_can_t){&k_dying, NULL}) != HV_OK) {
        give_up("the driver does not start");
    }
    const gateway_io_t io = {.udp = sim_udp_hal(&m.udp),
                             .drives = cia402_hal(&m.driver),
                             .relays = sim_relays_hal(&m.relays),
                             .inputs = sim_inputs_hal(&m.inputs),
                             .log = sim_log_hal(&m.log)};
    if (gateway_init(&m.gateway, &m.settings, &io) != HV_OK) {
        give_up("the gateway does not start");
    }
}

/* ---- judgement, at the drives ---- */

static void judge_target(unsigned k, const canopen_drive_t *drive)
{
    const int32_t from = m_seen[k].is_first ? m_seen[k].position : m_seen[k].target;
    const int32_t step = abs(drive->last_target - from);
    const int32_t most = (int32_t)((k < 6 ? 400 : 40) * COUNTS * (PERIOD_US / 1e6)) + 1;
    m_targets++;
    if (m_seen[k].is_first) {
        m_largest_first = step > m_largest_first ? step : m_largest_first;
        m_seen[k].is_first = false;
        if (step > 1) {
            wrong("a step at enabling", k);
        }
    } else if (step > most) {
        wrong("a step beyond the speed limit", k);
    }
}

/* Once per cycle: a drive takes a target per period at most. */
static void judge(void)
{
    for (unsigned k = 0; k < AXES; k++) {
        const canopen_drive_t *drive = &m.twin.drive[k];
        if (drive->node.drive.enabled != m_seen[k].enabled) {
            m_seen[k].is_first = true;
            m_enabled++;
        }
        if (drive->setpoints != m_seen[k].setpoints) {
            judge_target(k, drive);
        }
        m_seen[k].enabled = drive->node.drive.enabled;
        m_seen[k].setpoints = drive->setpoints;
        m_seen[k].position = canopen_drives_position(&m.twin, k);
        m_seen[k].target = drive->last_target;
    }
}

/* Drives and bus, and the gateway if it lives. */
static void cycle(void)
{
    m.now_us += CYCLE_US;
    canopen_drives_step(&m.twin, m.now_us);
    judge();
    if (m.is_alive) {
        gateway_cycle(&m.gateway, m.now_us);
    }
}

static bool has_torque(unsigned k)
{
    const node_t *node = &m.twin.drive[k].node;
    return node->is_powered && node->nmt == 0x05 && drive_is_enabled(&node->drive);
}

/* ---- a life and a death ---- */

static void send_frame(void)
{
    char text[120];
    const double t = (double)m.now_us / 1e6;
    const int length = snprintf(text, sizeof text, "@A7:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,5#", 6 * sin(2 * t), 5 * sin(1.7 * t),
                                4 * sin(t), 20 * sin(1.1 * t), 15 * sin(1.3 * t), 40 * sin(1.9 * t), 30 * sin(0.7 * t));
    (void)!sim_udp_push(&m.udp, (const uint8_t *)text, (size_t)length, NULL);
}

/* What an operator does: takes faults back, and engages. */
static void operate(unsigned age)
{
    if (age % 500 == 499 && m.gateway.snapshot.state != STATE_ENGAGED) {
        (void)!gateway_request(&m.gateway, EVENT_RESET, m.now_us);
    } else if (age % 500 == 0 && age > 0) {
        (void)!gateway_request(&m.gateway, EVENT_ENGAGE, m.now_us);
    }
    if (age % 20 == 10 && m.gateway.snapshot.state == STATE_ENGAGED) {
        send_frame();
    }
}

static void live(unsigned cycles)
{
    for (unsigned age = 0; age < cycles && m.is_alive; age++) {
        operate(age);
        cycle();
    }
}

/* Every 100th life goes on until it is engaged. */
static void come_up(void)
{
    unsigned age = 0;
    for (; age < UP_CYCLES_MOST && m.gateway.snapshot.state != STATE_ENGAGED; age++) {
        operate(age);
        cycle();
    }
    if (age == UP_CYCLES_MOST) {
        wrong("it does not come up again", 0);
    }
}

/* Now, or within a set of frames. */
static void die(void)
{
    m.sends_left = 1 + random_below(12);
    const bool is_split = random_below(2) == 0;
    for (unsigned i = 0; is_split && i < PERIOD_US / CYCLE_US && m.is_alive; i++) {
        cycle();
    }
    m_split += is_split;
    m.is_alive = false;
    m_kills++;
}

/* From the last heartbeat on. The watch is as long as it is: one cycle to notice. */
static void judge_stops(uint64_t killed_us)
{
    uint64_t first_us = UINT64_MAX, last_us = 0;
    for (unsigned k = 0; k < AXES; k++) {
        const uint64_t left_us = m.twin.drive[k].left_us;
        if (has_torque(k)) {
            wrong("still has torque after its watch", k);
        } else if (m_seen[k].had_torque) {
            first_us = left_us < first_us ? left_us : first_us;
            last_us = left_us > last_us ? left_us : last_us;
        }
    }
    if (last_us != 0 && (last_us - first_us > CYCLE_US || last_us > killed_us + (WATCH_MS + 2) * 1000)) {
        wrong("the drives do not stop together, or too late", 0);
    }
}

static void be_dead(void)
{
    const uint64_t killed_us = m.now_us;
    uint32_t setpoints[AXES];
    unsigned torques = 0;
    for (unsigned k = 0; k < AXES; k++) {
        setpoints[k] = m.twin.drive[k].setpoints;
        m_seen[k].had_torque = has_torque(k);
        torques += m_seen[k].had_torque;
    }
    m_in_motion += torques == AXES;
    for (unsigned i = 0; i <= WATCH_MS + 1; i++) {
        cycle();
    }
    judge_stops(killed_us);
    for (unsigned i = random_below(800); i > 0; i--) {
        cycle();
    }
    for (unsigned k = 0; k < AXES; k++) {
        if (m.twin.drive[k].setpoints > setpoints[k] + 1) {
            wrong("more than one target after the kill", k);
        }
    }
}

/* What happens to drives without torque. */
static void suffer(void)
{
    const unsigned k = random_below(AXES);
    if (random_below(3) == 0) {
        canopen_drives_place(&m.twin, k, canopen_drives_position(&m.twin, k) + (int32_t)random_below(4001) - 2000);
        m_seen[k].position = canopen_drives_position(&m.twin, k);
        m_sagged++;
    }
    if (random_below(8) == 0) {
        canopen_drives_power(&m.twin, random_below(AXES), true);
        m_without_power++;
    }
}

static void configure(void)
{
    m.settings = rig_hexapod();
    m.settings.engage = ENGAGE_MANUAL;
    m.config = (cia402_config_t){.axes = AXES,
                                 .master_node = 127,
                                 .mode = CIA402_MODE_CSP,
                                 .period_us = PERIOD_US,
                                 .heartbeat_ms = 50,
                                 .heartbeat_timeout_ms = WATCH_MS,
                                 .sdo_timeout_ms = 50,
                                 .boot_timeout_ms = 500,
                                 .power_timeout_ms = 300,
                                 .window_ms = 20,
                                 .abort_option = 1,
                                 .is_reset_wanted = true};
    for (unsigned k = 0; k < AXES; k++) {
        m.config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k + 1),
                                                  .scale = {COUNTS, 1, 0},
                                                  .step_max_q32 = q32_from_int(2),
                                                  .following_max_q32 = q32_from_int(10),
                                                  .window_counts = 10 * COUNTS};
    }
}

static void power_up(void)
{
    m.now_us = 5000000;
    sim_can_bus_init(&m.bus, FRAME_US, NULL, 0);
    canopen_drives_open(&m.twin, &m.bus);
    sim_inputs_init(&m.inputs, INPUT_ESTOP);
    for (unsigned k = 0; k < AXES; k++) {
        canopen_drives_place(&m.twin, k, k < 6 ? SETTLED_COUNTS : 0);
        m_seen[k].position = canopen_drives_position(&m.twin, k);
    }
}

/* Three of four lives end before they are up: setting up and enabling are what is tried here. */
static unsigned lifetime(void)
{
    return random_below(4) == 0 ? 500 + random_below(6000) : random_below(2500);
}

int main(int count, char **arguments)
{
    const uint64_t seed = count > 1 ? strtoull(arguments[1], NULL, 0) : 20261122;
    const long kills = count > 2 ? strtol(arguments[2], NULL, 0) : KILLS_DEFAULT;
    printf("TAP version 13\n1..2\n# seed %llu, %ld kills; again: kills SEED KILLS\n", (unsigned long long)seed, kills);
    random_begin(seed * 0x9E3779B97F4A7C15u + 1);
    configure();
    power_up();
    while (m_kills < kills && m_wrong == NULL) {
        start();
        if (m_kills % 100 == 0) {
            come_up();
        }
        live(lifetime());
        die();
        be_dead();
        suffer();
    }
    printf("%s 1 - %s\n", m_wrong == NULL ? "ok" : "not ok",
           "killed at any moment, a thousand times: nothing steps, nothing old is followed, all stop by themselves");
    if (m_wrong == NULL) {
        start();
        come_up();
    }
    printf("%s 2 - after all that it engages as ever\n", m_wrong == NULL ? "ok" : "not ok");
    printf(
        "# %ld kills with torque, %ld within a set of frames; %ld sagged, %ld lost their power; largest first step %d counts\n",
        m_in_motion, m_split, m_sagged, m_without_power, (int)m_largest_first);
    printf(
        "# figure %ld kills and new starts on drives with a watch of their own\n# figure %ld times a drive was enabled in them\n",
        m_kills, m_enabled);
    const bool was_tried = kills < 100 || (m_in_motion > kills / 20 && m_enabled > kills && m_targets > kills);
    return m_wrong == NULL && was_tried ? EXIT_SUCCESS : EXIT_FAILURE;
}
