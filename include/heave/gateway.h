/* SPDX-License-Identifier: MIT
 * gateway.h - the whole gateway: one cycle from datagrams and feedback to set-points and relays.
 * Owns the motion, the states and the counters. Uses the HAL handles that it is given for all I/O. One thread owns it
 * (the motion thread); time is an argument. Nothing here blocks or allocates.
 */
#ifndef HEAVE_GATEWAY_H
#define HEAVE_GATEWAY_H

#include "heave/confirm.h"
#include "heave/drives.h"
#include "heave/hal/inputs.h"
#include "heave/hal/log.h"
#include "heave/hal/relays.h"
#include "heave/hal/udp.h"
#include "heave/healthy.h"
#include "heave/mask_guard.h"
#include "heave/motion.h"
#include "heave/owner.h"
#include "heave/relay_policy.h"
#include "heave/service.h"
#include "heave/supervisor.h"
#include "heave/telemetry.h"

/** Most datagrams read in one cycle; the rest waits for the next. */
#define GATEWAY_DATAGRAMS_PER_CYCLE 64u

/** Most targets that motion gets one by one in one cycle, in order, when the network has bunched a sender's frames. Of more, only
 * the newest counts, so that the cost of a cycle is bounded. */
#define GATEWAY_TARGETS_PER_CYCLE 20u

/** Axes that turn: roll, pitch, yaw, the rotation motor. */
#define ROTATIONS 4u

/** Longest datagram taken. */
#define GATEWAY_DATAGRAM_MAX 512u

/** The HAL handles. All are valid, except that healthy is optional. Backends outlive the gateway. */
typedef struct {
    hal_udp_t udp;
    drives_t drives;
    hal_relays_t relays;
    hal_inputs_t inputs;
    hal_log_t log;
    hal_relays_t healthy; /**< a bank of one: the line of the healthy pulse; ops NULL: there is none */
} gateway_io_t;

/** Phase of bringing up the drives. */
typedef enum { BRING_UP_IDLE, BRING_UP_ENABLE, BRING_UP_HOME, BRING_UP_MOVE } bring_up_t;

#define AUTO_ENGAGE_FRAMES_MAX 100u

/** The auto policy; members are private to src/gateway. */
typedef struct {
    bool is_due; /**< engage = auto has not taken effect yet */
    uint32_t cycle_us;
    uint32_t frames; /**< valid frames within a second that it waits for */
    uint32_t seen;   /**< frames since a gap of more than a second; may wrap */
    uint64_t last_us;
    uint32_t span_cycles;                        /**< duration of the newest frames, at most `frames` of them */
    uint16_t gap_cycles[AUTO_ENGAGE_FRAMES_MAX]; /**< cycles before each of these; at most 2000 in a second */
} auto_engage_t;

/** Lines of the log about the same thing; members are private to src/gateway. */
typedef struct {
    uint64_t last_us; /**< of the last line; 0 = never */
    uint32_t logged;  /**< things that a line told of or counted */
    uint32_t events;  /**< things, where nobody else counts them */
} log_limit_t;

/** The last log line about a drive. Limits the rate, so that a drive that comes and goes does not fill the log. */
typedef struct {
    uint64_t next_us; /**< when the next line may be written; a burst may be earlier */
    uint32_t code;
    uint32_t detail_code;
    uint32_t left_out; /**< changes since then without a line */
} report_log_t;

/** Log lines about what the drives report; members are private to src/gateway. */
typedef struct {
    report_log_t change_log[DRIVES_MAX]; /**< the last line about the report of a drive */
    log_limit_t emergency_log[DRIVES_MAX];
} reports_t;

/** From datagrams to frames; members are private to src/gateway. */
typedef struct {
    frame_scanner_t scanner;
    uint8_t datagram[GATEWAY_DATAGRAM_MAX];
    size_t length;       /**< of the present datagram */
    size_t position;     /**< of the next byte in it */
    hal_udp_peer_t from; /**< its sender */
    uint32_t waited_us;  /**< time that it waited for its cycle */
    unsigned datagrams;  /**< received in this cycle */
    bool is_open;        /**< the present datagram may hold further frames */
    log_limit_t reject_log[FRAME_ERRORS];
} frame_receiver_t;

/** Roll, pitch, yaw and the angle of the motor of a frame, as sent. */
typedef struct {
    bool is_there[ROTATIONS];
    q16_t deg_q16[ROTATIONS];
} rotations_t;

/** The values of a pose as they stood in its frame. */
typedef struct {
    bool is_pose; /**< false: the frame had no pose, and the values are 0 */
    q16_t value_q16[POSE_AXES];
} received_t;

/** The sender in control and what it asks for; members are private to src/gateway. */
typedef struct {
    owner_t owner;
    owner_t other;          /**< the last one that did not drive */
    uint64_t start_us;      /**< start of the silence timer: last accepted frame or entry into ENGAGED */
    uint64_t last_frame_us; /**< accepted; 0 = none */
    uint16_t frame_mask;    /**< relay mask of the sender */
    mask_guard_t mask_guard;
    confirm_t confirm;
    unsigned targets; /**< of this cycle */
    bool has_newest;  /**< newest is of this cycle, and motion has not got it yet */
    motion_target_t newest;
    frame_command_t newest_command;
    hal_udp_peer_t newest_from;
    q32_t rotation_deg_q32[AXIS_YAW + 1u]; /**< of the last pose that was followed, within the limits */
    rotations_t rotations;                 /**< of the last frame, as sent */
    received_t received;                   /**< of the newest frame that was followed, as sent */
    log_limit_t other_log, spike_log, jump_log, turn_log, digits_log;
} sender_t;

/** Relays and the healthy pulse as they were written; members are private to src/gateway. */
typedef struct {
    relay_policy_t policy;
    healthy_t healthy;
    uint16_t effects_mask; /**< of this cycle, without the healthy pulse */
    uint16_t written_mask; /**< with it */
    bool is_mask_written;
    bool is_pulse_lost; /**< its line cannot be written */
    bool is_healthy;    /**< the healthy pulse runs, or would run if it had a line */
    bool is_unknown;    /**< the relays cannot be written or read back */
} relay_output_t;

/** Levels of the inputs; members are private to src/gateway. */
typedef struct {
    bool is_estop_active; /**< also where the inputs cannot be read */
    bool is_apart;        /**< the channels of the e-stop disagree */
    bool is_power_failing;
} input_levels_t;

/** What is kept of faults; members are private to src/gateway. */
typedef struct {
    uint32_t begun[DRIVES_MAX + 1u]; /**< in this cycle, by axis as in fault_t: bit N for fault_code_t N */
    fault_t first;                   /**< since the last reset */
    drive_report_t report;           /**< of its drive at that time */
    fault_reaction_t reaction;       /**< the worst since the last reset */
    uint32_t total;                  /**< since the start; wraps */
    uint64_t last_us[FAULT_CODES];   /**< last beginning of each fault, 0 = never */
    uint32_t count[FAULT_CODES];     /**< of each */
} faults_t;

/** What is wrong with bus, drives and inputs, so that each fault is found once; members are private to src/gateway. */
typedef struct {
    fault_code_t axis_fault[DRIVES_MAX];        /**< present fault of each drive */
    uint64_t following_since_us[CYLINDERS_MAX]; /**< start of a distance from the set-point that is too large; 0 = none */
    bool is_bus_lost;
    bool is_bus_failing;
    bool is_estop_apart;
    bool is_power_overdue;
    uint64_t power_since_us; /**< start of the failure of the supply; 0 = none */
} fault_watch_t;

/** Torque of all drives together; members are private to src/gateway. */
typedef struct {
    bring_up_t bring_up;
    uint64_t deadline_us;   /**< of the phase of bringing up */
    bool is_tracking;       /**< set-points follow the actual positions: drives off, or e-stop */
    bool is_disable_due;    /**< disable the drives once at rest */
    uint32_t unsent_cycles; /**< in a row, whose set-points the bus did not take */
} drive_control_t;

/** The end of the program; members are private to src/gateway. */
typedef struct {
    bool is_asked;     /**< the platform may not rise any more */
    bool is_overdue;   /**< the time for drives to confirm that their torque is off has passed */
    uint64_t since_us; /**< when it reached OFF, FAULT or ESTOP and the drives were told; 0 = not yet */
} shutdown_t;

/** The state of the platform and all that leads to another one; members are private to src/gateway. */
typedef struct {
    supervisor_t supervisor;
    drive_control_t drive_control;
    service_t service;
    fault_watch_t fault_watch;
    faults_t faults;
    input_levels_t inputs;
    auto_engage_t auto_engage;
    shutdown_t shutdown;
    uint32_t injected[DRIVES_MAX + 1u]; /**< faults that the next cycle has to find, as faults_t.begun */
    bool has_injected;                  /**< any of these */
    uint32_t withheld;                  /**< PERMIT_KEY | ... */
    uint32_t rides;                     /**< times that it was engaged from NEUTRAL */
    uint64_t reset_until_us;            /**< end of the time in which a reset waits for the drives; 0 = no reset */
    uint64_t state_since_us;            /**< when the state was entered */
    bool is_late;                       /**< the next cycle is too late for the healthy pulse */
} sequencer_t;

/** A gateway; members are private to src/gateway. */
typedef struct {
    const settings_t *settings; /**< in force, the owner's */
    gateway_io_t io;
    uint8_t cylinders;
    frame_receiver_t receiver;
    sender_t sender;
    sequencer_t sequencer;
    motion_t motion;
    motion_output_t output;
    relay_output_t relay_output;
    reports_t reports;
    log_limit_t singular_log;
    snapshot_t snapshot; /**< written at the end of a cycle; but feedback and counters come into it as they come up */
} gateway_t;

/** Prepares a gateway in OFF. Touches no device.
 *  @param settings read in every cycle: they stay where they are, and as they are, until gateway_reload()
 *  @return HV_OK; HV_ERR_ARG for an invalid handle or drives whose count does not fit the platform; HV_ERR_RANGE for settings. */
hv_status_t gateway_init(gateway_t *self, const settings_t *settings, const gateway_io_t *io) HV_MUST_CHECK;

/** Offline runs: starts in SETTLED, with drives that are enabled, homed and at the settled extension. After gateway_init. */
void gateway_start_settled(gateway_t *self);

/** Offline runs that came up to SETTLED by a request: the auto policy is as at the start. */
void gateway_restart_auto(gateway_t *self);

/** Everything a gateway knows but its handles and settings, so that an offline run can go on from there. Plain data: the same
 * bytes mean the same to a program built from the same sources for a machine of the same kind.
 *  @param out not a gateway that runs: gateway_resume() makes one of it */
void gateway_save(const gateway_t *self, gateway_t *out);

/** Continues from a saved state.
 *  @param self  prepared by gateway_init() with the settings that were in force; they and its handles are kept
 *  @param saved is believed: whoever has it from a file calls this, and all that follows, where it can do no harm */
void gateway_resume(gateway_t *self, const gateway_t *saved);

/** Other settings from the next cycle on.
 *  @param settings as for gateway_init(). May differ in silence, take-over and priorities, dialect, masks, safe mask and its
 *                  delay, following error, spike gate, confirmation of far jumps, supply; the others have to be as before */
void gateway_reload(gateway_t *self, const settings_t *settings);

/** What the machine and the people beside it do not permit from now on. Once in each cycle, before its requests. Where nobody
 * calls it, nothing is withheld.
 *  @param permits PERMIT_KEY | ... of supervisor.h, without PERMIT_RUNNING: the gateway knows of a shutdown by itself
 *  @return the request that follows from what is withheld since this call, for gateway_request(); EVENTS: none. The caller
 *          makes it, so that a recording holds it like an operator's */
event_t gateway_withhold(gateway_t *self, uint32_t permits) HV_MUST_CHECK;

/** Permits for want of which gateway_request() would refuse a request now: PERMIT_KEY | ...; 0: none, though the state may not
 * allow it (see supervisor_missing). */
uint32_t gateway_missing(gateway_t *self, event_t request);

/** Drives for want of which a request would end in a fault now: bit k for axis k, which does not answer, or is still being set
 * up. 0: none, or the request brings no drive up. gateway_request() does not look: who asks for a person asks here before. */
uint32_t gateway_absent(const gateway_t *self, event_t request);

/** A request of an operator: EVENT_ENGAGE, EVENT_HOLD, EVENT_RESUME, EVENT_PARK, EVENT_RESET, EVENT_SHUTDOWN, EVENT_SERVICE or
 *  EVENT_SERVICE_OFF.
 *  @return HV_OK; HV_ERR_STATE: the state does not allow it, or a permit is missing; nothing changes */
hv_status_t gateway_request(gateway_t *self, event_t request, uint64_t now_us) HV_MUST_CHECK;

/** A request for manual operation in SERVICE.
 *  @return SERVICE_DONE; or the reason why not: nothing changes */
service_answer_t gateway_service(gateway_t *self, const service_request_t *request, uint64_t now_us) HV_MUST_CHECK;

/** Begins a person's access to an object of a drive: reading in OFF, SERVICE, FAULT and ESTOP, writing in SERVICE while nothing
 *  moves. No cycle depends on it, so recordings do not hold it. gateway_object_end() returns its result.
 *  @param drive from 1
 *  @return SERVICE_DONE: begun; or the reason why not: nothing changes */
service_answer_t gateway_object_begin(gateway_t *self, unsigned drive, const drive_object_t *object) HV_MUST_CHECK;

/** As drives_object_end(). */
drive_object_state_t gateway_object_end(gateway_t *self, drive_object_t *out, uint32_t *code);

/** Age of a tick that a client sends back now. The snapshot showed it as service.tick_us; UINT64_MAX if the snapshot never
 * showed it. */
uint64_t gateway_tick_age(const gateway_t *self, uint64_t tick_us);

/** Sets the intensity, which changes by a ramp (see motion_set_intensity). Allowed in every state.
 *  @return HV_OK; HV_ERR_RANGE above intensity_max_percent: nothing changes. */
hv_status_t gateway_set_intensity(gateway_t *self, unsigned percent) HV_MUST_CHECK;

/** How fast the platform rises from now on, in percent of engage speed (see motion_set_rise_percent); 100 to begin with. Allowed
 *  in every state.
 *  @return HV_OK; HV_ERR_RANGE: not 1 to 100; nothing changes */
hv_status_t gateway_set_rise_percent(gateway_t *self, unsigned percent) HV_MUST_CHECK;

/** One cycle: receive, read feedback, supervise, plan, solve, limit, send, publish.
 *  @param now_us one cycle_us more than the last time */
void gateway_cycle(gateway_t *self, uint64_t now_us);

/** Result of the last cycle. Valid until the next one. */
const snapshot_t *gateway_snapshot(const gateway_t *self);

/** Reports cycles that were skipped just before the next one because the program was late. */
void gateway_note_late(gateway_t *self, uint32_t cycles);

/** Offline runs: the next cycle finds this fault, whatever the drives do. If the cycle finds it by itself, nothing is added.
 *  @param axis as in fault_t; ignored if the platform does not have this axis, or if it does not fit the code */
void gateway_inject_fault(gateway_t *self, fault_code_t code, unsigned axis);

/** True when a shutdown has ended: the state is OFF, or FAULT / ESTOP with a shutdown requested, the drives were told (if their
 * bus works), and no drive is energized as far as is known. Waits 3 s for drives that do not confirm this, or 1 s if none of them
 *  answers; then a line of the log names them. */
bool gateway_is_finished(const gateway_t *self);

/** Drives that have torque, as far as is known: bit i for axis i + 1. For lost drives: the last known state. */
uint32_t gateway_energized(const gateway_t *self);

#endif
