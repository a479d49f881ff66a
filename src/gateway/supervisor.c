/* SPDX-License-Identifier: MIT
 * supervisor.c - the table of states: one row per transition, and the first row that matches counts. Without
 * such a row, or without a permit that it needs, the state stays, and the event is counted. Owns the state, its goal and the
 * counters; never moves anything itself.
 *
 * How to read it. The goal is the state in which the platform is to end. The platform goes there by itself, one state at a
 * time. Only ENGAGE makes it rise. If the sender is silent, the platform may hold, go to neutral or settle. The next frame
 * undoes only what silence has caused: it never releases an operator's hold and never raises a platform that has begun to
 * settle. SERVICE leads only to OFF, and after it only ENGAGE and PARK lead out of OFF.
 */
#include "heave/supervisor.h"

/** What must be true for a row to match. */
typedef enum {
    ALWAYS,
    COMES_UP_SETTLED, /**< the drives stand at the settled extension, and the goal is not OFF (else they may still be switching
                         off) */
    GOAL_OFF,
    GOAL_UP, /**< NEUTRAL or ENGAGED */
    GOAL_ENGAGED,
    BY_SILENCE, /**< see is_held_by_silence */
    WAS_HOMING, /**< HOLD interrupted it; the positions may be unknown */
    WAS_RISING,
    WAS_NEUTRAL,
    WAS_ENGAGED,
    WAS_SETTLING,
    COMING_UP,    /**< drives are being enabled or homed, which may take minutes */
    STANDS_STILL, /**< at rest, no drive is in fault or still to be disabled */
    FAULT_CLEARED,
    ESTOP_RELEASED
} guard_t;

/** What becomes of is_held_by_silence. */
typedef enum { SAME, SET, CLEAR } mark_t;

/* STATES is no state; the columns use it for these. */
#define ANY  STATES /* from: every state */
#define STAY STATES /* to: the state it is in */
#define KEEP STATES /* goal: as it was */

/* Sets of permits that rows need. */
#define NONE    0u
#define RUNNING PERMIT_RUNNING
#define UP      (PERMIT_RUNNING | PERMIT_KEY | PERMIT_SUPPLY | PERMIT_APPROVAL) /* whatever brings drives or platform up */
#define FIRST   (UP | PERMIT_SELFTEST)                                          /* the first time people are lifted */

/** A row. Its members are bytes, because an enumeration may take four. */
typedef struct {
    uint8_t from;       /**< state_t */
    uint8_t event;      /**< event_t */
    uint8_t guard;      /**< guard_t */
    uint8_t needs;      /**< PERMIT_KEY | ... */
    uint8_t to;         /**< state_t */
    uint8_t goal;       /**< state_t */
    uint8_t by_silence; /**< mark_t */
    uint8_t action;     /**< action_t */
} row_t;

/* clang-format off */
static const row_t k_rows[] = {
    /* from          event                  guard             needs    to              goal            silent action */

    /* latching: entered once, from every state */
    {STATE_ESTOP,    EVENT_ESTOP,           ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {ANY,            EVENT_ESTOP,           ALWAYS,           NONE,    STATE_ESTOP,    KEEP,           CLEAR, ACTION_ESTOP},
    {STATE_ESTOP,    EVENT_FAULT,           ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {STATE_FAULT,    EVENT_FAULT,           ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {ANY,            EVENT_FAULT,           ALWAYS,           NONE,    STATE_FAULT,    KEEP,           CLEAR, ACTION_FAULT_STOP},

    {STATE_FAULT,    EVENT_RESET,           FAULT_CLEARED,    NONE,    STATE_OFF,      STATE_OFF,      CLEAR, ACTION_OFF},
    {STATE_FAULT,    EVENT_SHUTDOWN,        ALWAYS,           NONE,    STAY,           STATE_OFF,      SAME,  ACTION_NONE},
    {STATE_ESTOP,    EVENT_RESET,           ESTOP_RELEASED,   NONE,    STATE_OFF,      STATE_OFF,      CLEAR, ACTION_OFF},
    {STATE_ESTOP,    EVENT_SHUTDOWN,        ALWAYS,           NONE,    STAY,           STATE_OFF,      SAME,  ACTION_NONE},

    {STATE_OFF,      EVENT_DRIVES_READY,    COMES_UP_SETTLED, NONE,    STATE_SETTLED,  STATE_SETTLED,  CLEAR, ACTION_STAY},
    {STATE_OFF,      EVENT_ENGAGE,          ALWAYS,           FIRST,   STATE_HOMING,   STATE_ENGAGED,  CLEAR, ACTION_HOME},
    {STATE_OFF,      EVENT_PARK,            ALWAYS,           UP,      STATE_HOMING,   STATE_SETTLED,  CLEAR, ACTION_HOME},
    {STATE_OFF,      EVENT_SHUTDOWN,        ALWAYS,           NONE,    STAY,           STATE_OFF,      CLEAR, ACTION_NONE},
    {STATE_OFF,      EVENT_SERVICE,         STANDS_STILL,     UP,      STATE_SERVICE,  STATE_OFF,      CLEAR, ACTION_SERVE},

    {STATE_HOMING,   EVENT_MOVE_DONE,       ALWAYS,           NONE,    STATE_SETTLED,  KEEP,           CLEAR, ACTION_STAY},
    {STATE_HOMING,   EVENT_ENGAGE,          ALWAYS,           FIRST,   STAY,           STATE_ENGAGED,  CLEAR, ACTION_NONE},
    {STATE_HOMING,   EVENT_PARK,            ALWAYS,           RUNNING, STAY,           STATE_SETTLED,  CLEAR, ACTION_NONE},
    {STATE_HOMING,   EVENT_SHUTDOWN,        COMING_UP,        NONE,    STATE_HOLD,     STATE_OFF,      CLEAR, ACTION_STOP},
    {STATE_HOMING,   EVENT_SHUTDOWN,        ALWAYS,           NONE,    STAY,           STATE_OFF,      CLEAR, ACTION_NONE},
    {STATE_HOMING,   EVENT_HOLD,            ALWAYS,           NONE,    STATE_HOLD,     KEEP,           CLEAR, ACTION_STOP},

    {STATE_SETTLED,  EVENT_TICK,            GOAL_UP,          NONE,    STATE_RISING,   KEEP,           CLEAR, ACTION_RISE},
    {STATE_SETTLED,  EVENT_TICK,            GOAL_OFF,         NONE,    STATE_OFF,      KEEP,           CLEAR, ACTION_OFF},
    {STATE_SETTLED,  EVENT_ENGAGE,          ALWAYS,           FIRST,   STATE_RISING,   STATE_ENGAGED,  CLEAR, ACTION_RISE},
    {STATE_SETTLED,  EVENT_HOLD,            GOAL_UP,          NONE,    STAY,           STATE_SETTLED,  CLEAR, ACTION_NONE},
    {STATE_SETTLED,  EVENT_PARK,            ALWAYS,           RUNNING, STAY,           STATE_SETTLED,  CLEAR, ACTION_NONE},
    {STATE_SETTLED,  EVENT_SHUTDOWN,        ALWAYS,           NONE,    STATE_OFF,      STATE_OFF,      CLEAR, ACTION_OFF},
    {STATE_SETTLED,  EVENT_SERVICE,         STANDS_STILL,     UP,      STATE_SERVICE,  STATE_OFF,      CLEAR, ACTION_SERVE},

    {STATE_RISING,   EVENT_MOVE_DONE,       ALWAYS,           NONE,    STATE_NEUTRAL,  KEEP,           SAME,  ACTION_STAY},
    {STATE_RISING,   EVENT_ENGAGE,          ALWAYS,           UP,      STAY,           STATE_ENGAGED,  CLEAR, ACTION_NONE},
    {STATE_RISING,   EVENT_HOLD,            ALWAYS,           NONE,    STATE_HOLD,     KEEP,           CLEAR, ACTION_STOP},
    {STATE_RISING,   EVENT_PARK,            ALWAYS,           RUNNING, STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},
    {STATE_RISING,   EVENT_SHUTDOWN,        ALWAYS,           NONE,    STATE_SETTLING, STATE_OFF,      CLEAR, ACTION_SETTLE},
    {STATE_RISING,   EVENT_FRAME,           BY_SILENCE,       NONE,    STAY,           STATE_ENGAGED,  CLEAR, ACTION_NONE},
    {STATE_RISING,   EVENT_SILENCE_SETTLE,  BY_SILENCE,       NONE,    STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},

    {STATE_NEUTRAL,  EVENT_TICK,            GOAL_ENGAGED,     NONE,    STATE_ENGAGED,  STATE_ENGAGED,  CLEAR, ACTION_FOLLOW},
    {STATE_NEUTRAL,  EVENT_ENGAGE,          ALWAYS,           UP,      STATE_ENGAGED,  STATE_ENGAGED,  CLEAR, ACTION_FOLLOW},
    {STATE_NEUTRAL,  EVENT_HOLD,            ALWAYS,           NONE,    STATE_HOLD,     KEEP,           CLEAR, ACTION_STOP},
    {STATE_NEUTRAL,  EVENT_PARK,            ALWAYS,           RUNNING, STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},
    {STATE_NEUTRAL,  EVENT_SHUTDOWN,        ALWAYS,           NONE,    STATE_SETTLING, STATE_OFF,      CLEAR, ACTION_SETTLE},
    {STATE_NEUTRAL,  EVENT_FRAME,           BY_SILENCE,       NONE,    STATE_ENGAGED,  STATE_ENGAGED,  CLEAR, ACTION_FOLLOW},
    {STATE_NEUTRAL,  EVENT_SILENCE_SETTLE,  BY_SILENCE,       NONE,    STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},

    {STATE_ENGAGED,  EVENT_ENGAGE,          ALWAYS,           UP,      STAY,           KEEP,           SAME,  ACTION_NONE},
    {STATE_ENGAGED,  EVENT_FRAME,           ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {STATE_ENGAGED,  EVENT_HOLD,            ALWAYS,           NONE,    STATE_HOLD,     KEEP,           CLEAR, ACTION_STOP},
    {STATE_ENGAGED,  EVENT_PARK,            ALWAYS,           RUNNING, STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},
    {STATE_ENGAGED,  EVENT_SHUTDOWN,        ALWAYS,           NONE,    STATE_SETTLING, STATE_OFF,      CLEAR, ACTION_SETTLE},
    {STATE_ENGAGED,  EVENT_SILENCE_HOLD,    ALWAYS,           NONE,    STATE_HOLD,     KEEP,           SET,   ACTION_STOP},
    {STATE_ENGAGED,  EVENT_SILENCE_NEUTRAL, ALWAYS,           NONE,    STATE_RISING,   STATE_NEUTRAL,  SET,   ACTION_RISE},
    {STATE_ENGAGED,  EVENT_SILENCE_SETTLE,  ALWAYS,           NONE,    STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},

    {STATE_HOLD,     EVENT_RESUME,          WAS_HOMING,       UP,      STATE_HOMING,   KEEP,           CLEAR, ACTION_HOME},
    {STATE_HOLD,     EVENT_RESUME,          WAS_RISING,       UP,      STATE_RISING,   KEEP,           CLEAR, ACTION_RISE},
    {STATE_HOLD,     EVENT_RESUME,          WAS_NEUTRAL,      UP,      STATE_NEUTRAL,  KEEP,           CLEAR, ACTION_STAY},
    {STATE_HOLD,     EVENT_RESUME,          WAS_ENGAGED,      UP,      STATE_ENGAGED,  STATE_ENGAGED,  CLEAR, ACTION_FOLLOW},
    {STATE_HOLD,     EVENT_RESUME,          WAS_SETTLING,     UP,      STATE_SETTLING, KEEP,           CLEAR, ACTION_SETTLE},
    {STATE_HOLD,     EVENT_ENGAGE,          WAS_HOMING,       FIRST,   STATE_HOMING,   STATE_ENGAGED,  CLEAR, ACTION_HOME},
    {STATE_HOLD,     EVENT_ENGAGE,          WAS_RISING,       UP,      STATE_RISING,   STATE_ENGAGED,  CLEAR, ACTION_RISE},
    {STATE_HOLD,     EVENT_ENGAGE,          WAS_NEUTRAL,      UP,      STATE_ENGAGED,  STATE_ENGAGED,  CLEAR, ACTION_FOLLOW},
    {STATE_HOLD,     EVENT_ENGAGE,          WAS_ENGAGED,      UP,      STATE_ENGAGED,  STATE_ENGAGED,  CLEAR, ACTION_FOLLOW},
    {STATE_HOLD,     EVENT_ENGAGE,          WAS_SETTLING,     UP,      STATE_RISING,   STATE_ENGAGED,  CLEAR, ACTION_RISE},
    {STATE_HOLD,     EVENT_HOLD,            ALWAYS,           NONE,    STAY,           KEEP,           CLEAR, ACTION_NONE},
    {STATE_HOLD,     EVENT_PARK,            WAS_HOMING,       UP,      STATE_HOMING,   STATE_SETTLED,  CLEAR, ACTION_HOME},
    {STATE_HOLD,     EVENT_PARK,            ALWAYS,           RUNNING, STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},
    {STATE_HOLD,     EVENT_SHUTDOWN,        WAS_HOMING,       NONE,    STATE_OFF,      STATE_OFF,      CLEAR, ACTION_OFF},
    {STATE_HOLD,     EVENT_SHUTDOWN,        ALWAYS,           NONE,    STATE_SETTLING, STATE_OFF,      CLEAR, ACTION_SETTLE},
    {STATE_HOLD,     EVENT_FRAME,           BY_SILENCE,       NONE,    STATE_ENGAGED,  STATE_ENGAGED,  CLEAR, ACTION_FOLLOW},
    {STATE_HOLD,     EVENT_SILENCE_NEUTRAL, BY_SILENCE,       NONE,    STATE_RISING,   STATE_NEUTRAL,  SET,   ACTION_RISE},
    {STATE_HOLD,     EVENT_SILENCE_SETTLE,  BY_SILENCE,       NONE,    STATE_SETTLING, STATE_SETTLED,  CLEAR, ACTION_SETTLE},

    {STATE_SETTLING, EVENT_MOVE_DONE,       ALWAYS,           NONE,    STATE_SETTLED,  KEEP,           CLEAR, ACTION_STAY},
    {STATE_SETTLING, EVENT_ENGAGE,          ALWAYS,           UP,      STATE_RISING,   STATE_ENGAGED,  CLEAR, ACTION_RISE},
    {STATE_SETTLING, EVENT_HOLD,            ALWAYS,           NONE,    STATE_HOLD,     KEEP,           CLEAR, ACTION_STOP},
    {STATE_SETTLING, EVENT_PARK,            ALWAYS,           RUNNING, STAY,           STATE_SETTLED,  CLEAR, ACTION_NONE},
    {STATE_SETTLING, EVENT_SHUTDOWN,        ALWAYS,           NONE,    STAY,           STATE_OFF,      CLEAR, ACTION_NONE},

    {STATE_SERVICE,  EVENT_SERVICE,         ALWAYS,           UP,      STAY,           KEEP,           SAME,  ACTION_NONE},
    {STATE_SERVICE,  EVENT_SERVICE_OFF,     ALWAYS,           RUNNING, STATE_OFF,      STATE_OFF,      CLEAR, ACTION_OFF},
    {STATE_SERVICE,  EVENT_HOLD,            ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {STATE_SERVICE,  EVENT_SHUTDOWN,        ALWAYS,           NONE,    STATE_OFF,      STATE_OFF,      CLEAR, ACTION_OFF},

    /* levels that match no row above are expected, and not counted */
    {ANY,            EVENT_DRIVES_READY,    ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {ANY,            EVENT_TICK,            ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {ANY,            EVENT_SILENCE_HOLD,    ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {ANY,            EVENT_SILENCE_NEUTRAL, ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
    {ANY,            EVENT_SILENCE_SETTLE,  ALWAYS,           NONE,    STAY,           KEEP,           SAME,  ACTION_NONE},
};

/** What the loss of a permit leads to; the first row that matches counts. */
typedef struct {
    uint8_t from;    /**< state_t */
    uint8_t lost;    /**< PERMIT_KEY | ...: any of them */
    uint8_t guard;   /**< guard_t */
    uint8_t request; /**< event_t; EVENTS: none */
} response_t;

static const response_t k_responses[] = {
    /* from          lost                        guard       request */
    {STATE_HOMING,   PERMIT_KEY | PERMIT_SUPPLY, GOAL_UP,    EVENT_PARK},
    {STATE_SETTLED,  PERMIT_KEY | PERMIT_SUPPLY, GOAL_UP,    EVENT_PARK},
    {STATE_RISING,   PERMIT_KEY | PERMIT_SUPPLY, ALWAYS,     EVENT_PARK},
    {STATE_RISING,   PERMIT_PUNCTUAL,            ALWAYS,     EVENT_HOLD},
    {STATE_NEUTRAL,  PERMIT_KEY | PERMIT_SUPPLY, ALWAYS,     EVENT_PARK},
    {STATE_NEUTRAL,  PERMIT_PUNCTUAL,            ALWAYS,     EVENT_HOLD},
    {STATE_ENGAGED,  PERMIT_KEY | PERMIT_SUPPLY, ALWAYS,     EVENT_PARK},
    {STATE_ENGAGED,  PERMIT_PUNCTUAL,            ALWAYS,     EVENT_HOLD},
    /* of drives that a hold has disabled nothing goes up; else the key ends a hold, a failing supply does not: somebody may be
     * below the platform */
    {STATE_HOLD,     PERMIT_KEY | PERMIT_SUPPLY, WAS_HOMING, EVENTS},
    {STATE_HOLD,     PERMIT_KEY,                 GOAL_UP,    EVENT_PARK},
    {STATE_HOLD,     PERMIT_SUPPLY,              BY_SILENCE, EVENT_PARK},
    {STATE_SERVICE,  PERMIT_KEY | PERMIT_SUPPLY, ALWAYS,     EVENT_SERVICE_OFF},
    {STATE_SERVICE,  PERMIT_PUNCTUAL,            ALWAYS,     EVENT_HOLD},
};
/* clang-format on */

static bool holds(guard_t guard, const supervisor_t *self, const supervisor_view_t *view)
{
    switch (guard) {
    case ALWAYS:
        return true;
    case COMES_UP_SETTLED:
        return view->is_at_settled && self->goal != STATE_OFF;
    case GOAL_OFF:
        return self->goal == STATE_OFF;
    case GOAL_UP:
        return self->goal == STATE_NEUTRAL || self->goal == STATE_ENGAGED;
    case GOAL_ENGAGED:
        return self->goal == STATE_ENGAGED;
    case BY_SILENCE:
        return self->is_held_by_silence;
    case WAS_HOMING:
        return self->interrupted == STATE_HOMING;
    case WAS_RISING:
        return self->interrupted == STATE_RISING;
    case WAS_NEUTRAL:
        return self->interrupted == STATE_NEUTRAL;
    case WAS_ENGAGED:
        return self->interrupted == STATE_ENGAGED;
    case WAS_SETTLING:
        return self->interrupted == STATE_SETTLING;
    case COMING_UP:
        return view->is_coming_up;
    case STANDS_STILL:
        return view->is_at_rest && !view->is_going_off && !view->is_fault_present;
    case FAULT_CLEARED:
        return !view->is_fault_present && view->is_at_rest;
    case ESTOP_RELEASED:
        return !view->is_estop_active && !view->is_fault_present;
    }
    return false;
}

/* The first row that matches, NULL if none does. */
static const row_t *find_row(const supervisor_t *self, event_t event, const supervisor_view_t *view)
{
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        const row_t *const row = &k_rows[i];
        if (row->event == event && (row->from == self->state || row->from == ANY) && holds(row->guard, self, view))
            return row;
    }
    return NULL;
}

static void apply(supervisor_t *self, const row_t *row)
{
    if (row->to == STATE_HOLD) {
        self->interrupted = self->state;
    }
    if (row->to != STAY) {
        self->state = row->to;
    }
    if (row->goal != KEEP) {
        self->goal = row->goal;
    }
    if (row->by_silence != SAME) {
        self->is_held_by_silence = row->by_silence == SET;
    }
}

void supervisor_init(supervisor_t *self)
{
    *self = (supervisor_t){.state = STATE_OFF, .goal = STATE_SETTLED};
}

void supervisor_init_settled(supervisor_t *self)
{
    *self = (supervisor_t){.state = STATE_SETTLED, .goal = STATE_SETTLED};
}

action_t supervisor_event(supervisor_t *self, event_t event, const supervisor_view_t *view)
{
    HV_ASSERT((unsigned)event < EVENTS && view != NULL);
    const row_t *const row = find_row(self, event, view);
    if (row == NULL || (row->needs & view->withheld) != 0) {
        self->ignored[event]++;
        return ACTION_NONE;
    }
    apply(self, row);
    return row->action;
}

/* What an event needs wherever it has a row. */
static uint32_t needs_everywhere(event_t event)
{
    uint32_t needs = NONE;
    bool has_row = false;
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if (k_rows[i].event == event) {
            needs = has_row ? needs & k_rows[i].needs : k_rows[i].needs;
            has_row = true;
        }
    }
    return needs;
}

uint32_t supervisor_missing(const supervisor_t *self, event_t event, const supervisor_view_t *view)
{
    HV_ASSERT((unsigned)event < EVENTS && view != NULL);
    const row_t *const row = find_row(self, event, view);
    return (row != NULL ? row->needs : needs_everywhere(event)) & view->withheld;
}

event_t supervisor_response(const supervisor_t *self, uint32_t lost)
{
    static const supervisor_view_t k_unseen = {.is_at_rest = false}; /* the guards of these rows look at the state alone */
    for (size_t i = 0; i < sizeof k_responses / sizeof k_responses[0]; i++) {
        const response_t *const row = &k_responses[i];
        if (row->from == self->state && (row->lost & lost) != 0 && holds(row->guard, self, &k_unseen)) {
            return row->request;
        }
    }
    return EVENTS;
}

bool supervisor_is_latched(const supervisor_t *self)
{
    return self->state == STATE_FAULT || self->state == STATE_ESTOP;
}

const char *state_name(state_t state)
{
    static const char *const k_names[STATES] = {
        [STATE_OFF] = "OFF",         [STATE_HOMING] = "HOMING",   [STATE_SETTLED] = "SETTLED", [STATE_RISING] = "RISING",
        [STATE_NEUTRAL] = "NEUTRAL", [STATE_ENGAGED] = "ENGAGED", [STATE_HOLD] = "HOLD",       [STATE_SETTLING] = "SETTLING",
        [STATE_SERVICE] = "SERVICE", [STATE_FAULT] = "FAULT",     [STATE_ESTOP] = "ESTOP",
    };
    return (unsigned)state < STATES ? k_names[state] : "?";
}

const char *event_name(event_t event)
{
    static const char *const k_names[EVENTS] = {
        [EVENT_DRIVES_READY] = "drives-ready",
        [EVENT_TICK] = "tick",
        [EVENT_MOVE_DONE] = "move-done",
        [EVENT_ENGAGE] = "engage",
        [EVENT_HOLD] = "hold",
        [EVENT_RESUME] = "resume",
        [EVENT_PARK] = "park",
        [EVENT_RESET] = "reset",
        [EVENT_SHUTDOWN] = "shutdown",
        [EVENT_SERVICE] = "service",
        [EVENT_SERVICE_OFF] = "service-off",
        [EVENT_FRAME] = "frame",
        [EVENT_SILENCE_HOLD] = "silence-hold",
        [EVENT_SILENCE_NEUTRAL] = "silence-neutral",
        [EVENT_SILENCE_SETTLE] = "silence-settle",
        [EVENT_FAULT] = "fault",
        [EVENT_ESTOP] = "estop",
    };
    return (unsigned)event < EVENTS ? k_names[event] : "?";
}
