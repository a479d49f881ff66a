/* SPDX-License-Identifier: MIT
 * supervisor.h - the state machine of a platform: two tables, pure, no clock and no I/O. One has the transitions and what each
 * of them needs, the other what the loss of a permit leads to.
 * The gateway generates the events and carries out the action of each transition. The tables are in supervisor.c;
 * tools/gen_states.py draws docs/operation.md from them. One caller at a time per instance; nothing blocks.
 */
#ifndef HEAVE_SUPERVISOR_H
#define HEAVE_SUPERVISOR_H

#include "heave/status.h"

/** States of a platform. */
typedef enum {
    STATE_OFF,      /**< drives disabled */
    STATE_HOMING,   /**< drives come up, find their zero, go to the settled extension at engage speed */
    STATE_SETTLED,  /**< lowest, at rest; people may board */
    STATE_RISING,   /**< to the neutral pose at engage speed */
    STATE_NEUTRAL,  /**< up, at rest, not listening */
    STATE_ENGAGED,  /**< follows the sender */
    STATE_HOLD,     /**< stopped where it is, drives enabled */
    STATE_SETTLING, /**< to the settled extension at engage speed */
    STATE_SERVICE,  /**< nobody on board: single drives are moved while a person holds a button; senders are not followed */
    STATE_FAULT,    /**< latched: stopped with the reaction of the fault, then drives disabled */
    STATE_ESTOP,    /**< latched: targets stopped, set-points follow the actual positions */
    STATES
} state_t;

/** Events. A level may be passed in every cycle while it lasts; it is not counted if it changes nothing. */
typedef enum {
    EVENT_DRIVES_READY,    /**< level: every drive answers, is enabled and its position is known */
    EVENT_TICK,            /**< level, once a cycle and first: SETTLED and NEUTRAL go on to the goal after one visible cycle */
    EVENT_MOVE_DONE,       /**< the move of HOMING, RISING or SETTLING has ended at rest on its target; offer it before the
                                requests of the cycle, else it would end the move that a request has only just begun */
    EVENT_ENGAGE,          /**< operator, enable key, or the auto policy */
    EVENT_HOLD,            /**< operator */
    EVENT_RESUME,          /**< operator: continue what a hold interrupted */
    EVENT_PARK,            /**< operator: settle */
    EVENT_RESET,           /**< operator: leave FAULT or ESTOP, once the cause is gone */
    EVENT_SHUTDOWN,        /**< operator or SIGTERM: settle, then off */
    EVENT_SERVICE,         /**< operator: into SERVICE, from OFF or SETTLED */
    EVENT_SERVICE_OFF,     /**< operator: out of it, drives off */
    EVENT_FRAME,           /**< a valid frame came */
    EVENT_SILENCE_HOLD,    /**< level: the sender has been silent for silence_hold_ms */
    EVENT_SILENCE_NEUTRAL, /**< level: for silence_neutral_ms */
    EVENT_SILENCE_SETTLE,  /**< level: for silence_settle_ms */
    EVENT_FAULT,           /**< level: a machine fault was raised, drives that drop out included */
    EVENT_ESTOP,           /**< level: the e-stop input is active */
    EVENTS
} event_t;

/** What the gateway must do on entering the new state. Each state that is entered has one action, whatever led to it. */
typedef enum {
    ACTION_NONE,
    ACTION_HOME,       /**< enable and home the drives, then move to the settled extension */
    ACTION_SETTLE,     /**< controlled stop, then move to the settled extension */
    ACTION_RISE,       /**< controlled stop, then move to the neutral pose */
    ACTION_FOLLOW,     /**< follow the sender, the first pose at engage speed */
    ACTION_STOP,       /**< controlled stop where it is */
    ACTION_STAY,       /**< arrived: nothing to move */
    ACTION_OFF,        /**< bring all axes to rest, then disable the drives */
    ACTION_FAULT_STOP, /**< stop with the reaction of the fault, disable the drives; relays to the safe mask */
    ACTION_SERVE,      /**< only manual motion is possible; the drives do not change */
    ACTION_ESTOP       /**< stop targets at once, set-points follow actual; relays to the safe mask */
} action_t;

/** What a request may need of the machine and the people beside it. What nobody withholds is given: where there is no enable key,
 * its permit always is. */
enum {
    PERMIT_KEY = 1u,      /**< the enable key is on */
    PERMIT_SUPPLY = 2u,   /**< the supply is well */
    PERMIT_APPROVAL = 4u, /**< somebody has approved this configuration */
    PERMIT_SELFTEST = 8u, /**< no self-test is due */
    PERMIT_RUNNING = 16u, /**< no shutdown has been asked for */
    PERMIT_PUNCTUAL = 32u /**< the cycles come in time; no request needs it, its loss leads to one */
};

/** Inputs of the guards of the table; the gateway fills it before each event. */
typedef struct {
    bool is_at_settled;    /**< actual extensions at the settled extension */
    bool is_at_rest;       /**< set-points at rest */
    bool is_fault_present; /**< the cause of a fault is still there */
    bool is_estop_active;
    bool is_going_off; /**< the drives are still to be disabled */
    bool is_coming_up; /**< the drives are being enabled or homed */
    uint32_t withheld; /**< PERMIT_KEY | ... */
} supervisor_view_t;

/** A platform's state; others read it, only supervisor.c writes it. */
typedef struct {
    state_t state;
    state_t goal;             /**< state to end in: STATE_OFF, STATE_SETTLED, STATE_NEUTRAL or STATE_ENGAGED */
    state_t interrupted;      /**< in HOLD: the state that was interrupted */
    bool is_held_by_silence;  /**< HOLD, RISING or NEUTRAL because the sender fell silent: its next frame engages again */
    uint32_t ignored[EVENTS]; /**< events that had no row for the state or lacked a permit, by event; wraps */
} supervisor_t;

/** Starts in OFF with the goal SETTLED: changes to SETTLED if the drives are already enabled at the settled extension. After
 * SHUTDOWN or RESET (goal OFF), only ENGAGE and PARK leave OFF. */
void supervisor_init(supervisor_t *self);

/** Starts in SETTLED (offline runs: simulated drives that are enabled and at the settled extension). */
void supervisor_init_settled(supervisor_t *self);

/** Takes an event.
 *  @return the action to carry out now. Every change of state has one; ACTION_NONE where the state stays. An event that has no
 *  row, or lacks a permit, is counted in ignored[], nothing else. */
action_t supervisor_event(supervisor_t *self, event_t event, const supervisor_view_t *view);

/** Permits that the event would need now and that are withheld: PERMIT_KEY | ... Where it has no row: those that it needs in
 * every state that has one; a person gives them before looking for such a state. */
uint32_t supervisor_missing(const supervisor_t *self, event_t event, const supervisor_view_t *view);

/** The request that follows from the loss of permits. It is a request like an operator's, so that a recording can hold it.
 *  @param lost PERMIT_KEY | ...: those that are withheld in this cycle and were not in the last one
 *  @return EVENTS: none */
event_t supervisor_response(const supervisor_t *self, uint32_t lost);

/** True in FAULT and ESTOP, which only RESET leaves for OFF. */
bool supervisor_is_latched(const supervisor_t *self);

/** "SETTLED", "engage", ...: constant text; "?" outside the enum. */
const char *state_name(state_t state);
const char *event_name(event_t event);

#endif
