/* SPDX-License-Identifier: MIT
 * test_supervisor.c - every situation x event against a matrix written from the requirement, and every permit against another,
 * then invariants over every state that can be reached at all, and over long random walks.
 */
#include "heave/supervisor.h"

#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include "random.h"
#include "unity.h"

static supervisor_t m_sup;
static supervisor_view_t m_view;

static jmp_buf m_assert_jump;
static bool m_is_assert_expected;

void hv_assert_failed(const char *file, int line)
{
    (void)file;
    (void)line;
    if (!m_is_assert_expected)
        TEST_FAIL_MESSAGE("assertion in supervisor.c");
    longjmp(m_assert_jump, 1);
}

void setUp(void)
{
    supervisor_init(&m_sup);
    m_view = (supervisor_view_t){.is_at_rest = true};
    random_begin(RANDOM_SEED);
    m_is_assert_expected = false;
}

void tearDown(void) {}

/* ---- the matrix, by hand ----
 * A cell says what an event does: four letters <state><goal><held by silence><action>, where
 *   state, goal   O OFF  H HOMING  S SETTLED  R RISING  N NEUTRAL  E ENGAGED  D HOLD  T SETTLING  V SERVICE  F FAULT  X ESTOP   =
 * as it was silence       0 no   1 yes   = as it was action        h home  t settle  r rise  f follow  s stop  y stay  o off  x
 * fault stop  v serve  e e-stop   - none
 * "." = not for this state: nothing changes and it is counted.   "-" = nothing to do and it is not counted. */
static const char k_states[STATES + 1] = {
    [STATE_OFF] = 'O',     [STATE_HOMING] = 'H',  [STATE_SETTLED] = 'S', [STATE_RISING] = 'R',
    [STATE_NEUTRAL] = 'N', [STATE_ENGAGED] = 'E', [STATE_HOLD] = 'D',    [STATE_SETTLING] = 'T',
    [STATE_SERVICE] = 'V', [STATE_FAULT] = 'F',   [STATE_ESTOP] = 'X'};
static const char k_actions[] = {
    [ACTION_NONE] = '-',       [ACTION_HOME] = 'h',  [ACTION_SETTLE] = 't', [ACTION_RISE] = 'r',
    [ACTION_FOLLOW] = 'f',     [ACTION_STOP] = 's',  [ACTION_STAY] = 'y',   [ACTION_OFF] = 'o',
    [ACTION_FAULT_STOP] = 'x', [ACTION_SERVE] = 'v', [ACTION_ESTOP] = 'e',  [ACTION_ESTOP + 1] = '\0'};

typedef enum { ANY, NO, YES } tri_t;

typedef struct {
    const char *name;
    char state;
    const char *goals;       /* any of these */
    const char *interrupted; /* any of these; only looked at in HOLD */
    tri_t by_silence;
    tri_t cond; /* OFF: at the settled extension; HOMING: drives come up; FAULT: cause gone and at rest; ESTOP: released and
                   cause gone */
    const char *cells; /* one per event, in the order of event_t, CELL characters apart */
} situation_t;

/* clang-format off */
static const situation_t k_matrix[] = {
    /*                                               REDY TICK DONE ENGA HOLD RESU PARK RESE SHUT SERV SOFF FRAM S_HO S_NE S_SE FAUL ESTO */
    {"off, at settled", 'O', "SNE",  "",  NO,  YES, "SS0y -    .    HE0h .    .    HS0h .    =O0- VO0v .    .    -    -    -    F=0x X=0e"},
    {"off, elsewhere",  'O', "SNE",  "",  NO,  NO,  "-    -    .    HE0h .    .    HS0h .    =O0- VO0v .    .    -    -    -    F=0x X=0e"},
    {"off on request",  'O', "O",    "",  NO,  ANY, "-    -    .    HE0h .    .    HS0h .    =O0- VO0v .    .    -    -    -    F=0x X=0e"},
    {"homing, to home", 'H', "OSNE", "",  NO,  YES, "-    -    S=0y =E0- D=0s .    =S0- .    DO0s .    .    .    -    -    -    F=0x X=0e"},
    {"homing, to place",'H', "OSNE", "",  NO,  NO,  "-    -    S=0y =E0- D=0s .    =S0- .    =O0- .    .    .    -    -    -    F=0x X=0e"},
    {"settled",         'S', "S",    "",  NO,  ANY, "-    -    .    RE0r .    .    =S0- .    OO0o VO0v .    .    -    -    -    F=0x X=0e"},
    {"settled, to up",  'S', "NE",   "",  NO,  ANY, "-    R=0r .    RE0r =S0- .    =S0- .    OO0o VO0v .    .    -    -    -    F=0x X=0e"},
    {"settled, to off", 'S', "O",    "",  NO,  ANY, "-    OO0o .    RE0r .    .    =S0- .    OO0o VO0v .    .    -    -    -    F=0x X=0e"},
    {"rising",          'R', "OSNE", "",  NO,  ANY, "-    -    N=0y =E0- D=0s .    TS0t .    TO0t .    .    .    -    -    -    F=0x X=0e"},
    {"rising, silent",  'R', "OSNE", "",  YES, ANY, "-    -    N=1y =E0- D=0s .    TS0t .    TO0t .    .    =E0- -    -    TS0t F=0x X=0e"},
    {"neutral",         'N', "OSN",  "",  NO,  ANY, "-    -    .    EE0f D=0s .    TS0t .    TO0t .    .    .    -    -    -    F=0x X=0e"},
    {"neutral, to up",  'N', "E",    "",  NO,  ANY, "-    EE0f .    EE0f D=0s .    TS0t .    TO0t .    .    .    -    -    -    F=0x X=0e"},
    {"neutral, silent", 'N', "N",    "",  YES, ANY, "-    -    .    EE0f D=0s .    TS0t .    TO0t .    .    EE0f -    -    TS0t F=0x X=0e"},
    {"engaged",         'E', "OSNE", "",  NO,  ANY, "-    -    .    -    D=0s .    TS0t .    TO0t .    .    -    D=1s RN1r TS0t F=0x X=0e"},
    {"homing held",     'D', "OSNE", "H", NO,  ANY, "-    -    .    HE0h -    H=0h HS0h .    OO0o .    .    .    -    -    -    F=0x X=0e"},
    {"rising held",     'D', "OSNE", "R", NO,  ANY, "-    -    .    RE0r -    R=0r TS0t .    TO0t .    .    .    -    -    -    F=0x X=0e"},
    {"neutral held",    'D', "OSNE", "N", NO,  ANY, "-    -    .    EE0f -    N=0y TS0t .    TO0t .    .    .    -    -    -    F=0x X=0e"},
    {"engaged held",    'D', "OSNE", "E", NO,  ANY, "-    -    .    EE0f -    EE0f TS0t .    TO0t .    .    .    -    -    -    F=0x X=0e"},
    {"engaged, silent", 'D', "OSNE", "E", YES, ANY, "-    -    .    EE0f ==0- EE0f TS0t .    TO0t .    .    EE0f -    RN1r TS0t F=0x X=0e"},
    {"settling held",   'D', "OSNE", "T", NO,  ANY, "-    -    .    RE0r -    T=0t TS0t .    TO0t .    .    .    -    -    -    F=0x X=0e"},
    {"settling",        'T', "OSNE", "",  NO,  ANY, "-    -    S=0y RE0r D=0s .    =S0- .    =O0- .    .    .    -    -    -    F=0x X=0e"},
    {"service",         'V', "OSNE", "",  NO,  ANY, "-    -    .    .    -    .    .    .    OO0o -    OO0o .    -    -    -    F=0x X=0e"},
    {"fault, gone",     'F', "OSNE", "",  NO,  YES, "-    -    .    .    .    .    .    OO0o =O0- .    .    .    -    -    -    -    X=0e"},
    {"fault",           'F', "OSNE", "",  NO,  NO,  "-    -    .    .    .    .    .    .    =O0- .    .    .    -    -    -    -    X=0e"},
    {"e-stop released", 'X', "OSNE", "",  NO,  YES, "-    -    .    .    .    .    .    OO0o =O0- .    .    .    -    -    -    -    -   "},
    {"e-stop",          'X', "OSNE", "",  NO,  NO,  "-    -    .    .    .    .    .    .    =O0- .    .    .    -    -    -    -    -   "},
};
/* clang-format on */
#define CELL       5
#define SITUATIONS (sizeof k_matrix / sizeof k_matrix[0])

static char letter(state_t state)
{
    return k_states[state];
}

static state_t state_of(char c)
{
    return (state_t)(strchr(k_states, c) - k_states);
}

static bool tri_fits(tri_t tri, bool value)
{
    return tri == ANY || (tri == YES) == value;
}

/* The condition a state's RESET or DRIVES_READY depends on, said again from the requirement. */
static bool condition(const supervisor_t *sup, const supervisor_view_t *view)
{
    if (sup->state == STATE_FAULT)
        return view->is_at_rest && !view->is_fault_present;
    if (sup->state == STATE_ESTOP)
        return !(view->is_estop_active || view->is_fault_present);
    return sup->state == STATE_HOMING ? view->is_coming_up : view->is_at_settled;
}

static bool situation_fits(const situation_t *s, const supervisor_t *sup, const supervisor_view_t *view)
{
    return s->state == letter(sup->state) && strchr(s->goals, letter(sup->goal)) != NULL &&
           (sup->state != STATE_HOLD || strchr(s->interrupted, letter(sup->interrupted)) != NULL) &&
           tri_fits(s->by_silence, sup->is_held_by_silence) && tri_fits(s->cond, condition(sup, view));
}

static const situation_t *situation_find(const supervisor_t *sup, const supervisor_view_t *view)
{
    const situation_t *found = NULL;
    for (size_t i = 0; i < SITUATIONS; i++)
        if (situation_fits(&k_matrix[i], sup, view)) {
            TEST_ASSERT_NULL_MESSAGE(found, k_matrix[i].name); /* the matrix itself is unambiguous */
            found = &k_matrix[i];
        }
    return found;
}

static supervisor_view_t view_of(unsigned bits)
{
    return (supervisor_view_t){bits & 1, bits >> 1 & 1, bits >> 2 & 1, bits >> 3 & 1, bits >> 4 & 1, bits >> 5 & 1, 0};
}
#define VIEWS 64u

/* Into SERVICE only what stands still gets: a V of another situation counts as a point. */
static const char *cell_of(const situation_t *s, event_t event, const supervisor_view_t *view)
{
    const char *cell = s->cells + CELL * event;
    return cell[0] == 'V' && (!view->is_at_rest || view->is_fault_present || view->is_going_off) ? ".    " : cell;
}

/* What a cell promises. */
static action_t cell_apply(const char *cell, event_t event, supervisor_t *sup)
{
    if (cell[0] == '.')
        sup->ignored[event]++;
    if (cell[1] == ' ')
        return ACTION_NONE;
    if (cell[0] == 'D')
        sup->interrupted = sup->state;
    sup->state = cell[0] == '=' ? sup->state : state_of(cell[0]);
    sup->goal = cell[1] == '=' ? sup->goal : state_of(cell[1]);
    sup->is_held_by_silence = cell[2] == '=' ? sup->is_held_by_silence : cell[2] == '1';
    return (action_t)(strchr(k_actions, cell[3]) - k_actions);
}

static void check_cell(const situation_t *s, const supervisor_t *before, event_t event, const supervisor_view_t *view)
{
    char text[120];
    snprintf(text, sizeof text, "%s (goal %s) + %s", s->name, state_name(before->goal), event_name(event));
    supervisor_t expected = *before, actual = *before;
    const action_t expected_action = cell_apply(cell_of(s, event, view), event, &expected);
    const action_t action = supervisor_event(&actual, event, view);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(state_name(expected.state), state_name(actual.state), text);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(state_name(expected.goal), state_name(actual.goal), text);
    TEST_ASSERT_EQUAL_MESSAGE(expected.is_held_by_silence, actual.is_held_by_silence, text);
    TEST_ASSERT_EQUAL_MESSAGE(expected.interrupted, actual.interrupted, text);
    TEST_ASSERT_EQUAL_MESSAGE(expected_action, action, text);
    TEST_ASSERT_EQUAL_UINT32_ARRAY_MESSAGE(expected.ignored, actual.ignored, EVENTS, text);
}

/* Every combination of the fields, reachable or not: calls visit for those a situation describes. */
static const char k_goals[] = "OSNE", k_interrupted[] = "HRNET";

static supervisor_t context_of(unsigned n)
{
    supervisor_t sup = {.state = (state_t)(n % STATES)};
    n /= STATES;
    sup.goal = state_of(k_goals[n % 4]);
    n /= 4;
    sup.interrupted = state_of(k_interrupted[n % 5]);
    sup.is_held_by_silence = n / 5;
    return sup;
}
#define CONTEXTS (STATES * 4u * 5u * 2u)

static unsigned context_number(const supervisor_t *sup)
{
    const char *const i = strchr(k_interrupted, letter(sup->interrupted));
    const unsigned interrupted =
        i == NULL ? 0 : (unsigned)(i - k_interrupted); /* before the first HOLD it is OFF, which nobody looks at */
    const unsigned goal = (unsigned)(strchr(k_goals, letter(sup->goal)) - k_goals);
    return sup->state + STATES * (goal + 4u * (interrupted + 5u * sup->is_held_by_silence));
}

static void test_supervisor_event_every_situation_matches_the_matrix(void)
{
    unsigned visits[SITUATIONS] = {0};
    for (size_t i = 0; i < SITUATIONS; i++)
        TEST_ASSERT_EQUAL_MESSAGE(CELL * EVENTS - 1, strlen(k_matrix[i].cells), k_matrix[i].name);
    for (unsigned n = 0; n < CONTEXTS; n++)
        for (unsigned bits = 0; bits < VIEWS; bits++) {
            const supervisor_t sup = context_of(n);
            const supervisor_view_t view = view_of(bits);
            const situation_t *const s = situation_find(&sup, &view);
            if (s == NULL)
                continue; /* held by silence where silence holds nothing: never reached, see the next test */
            visits[s - k_matrix]++;
            for (unsigned event = 0; event < EVENTS; event++)
                check_cell(s, &sup, (event_t)event, &view);
        }
    for (size_t i = 0; i < SITUATIONS; i++)
        TEST_ASSERT_GREATER_THAN_MESSAGE(0, visits[i], k_matrix[i].name);
}

/* ---- everything that can be reached ---- */

typedef void (*step_check_t)(const supervisor_t *before, event_t event, const supervisor_view_t *view, action_t action,
                             const supervisor_t *after);

/* Breadth first from both starts, over every event and view; calls check (may be NULL) for each step. Marks what it saw. */
static unsigned reach(bool seen[CONTEXTS], step_check_t check)
{
    unsigned queue[CONTEXTS], head = 0, tail = 0;
    supervisor_t start[2];
    supervisor_init(&start[0]);
    supervisor_init_settled(&start[1]);
    memset(seen, 0, CONTEXTS * sizeof seen[0]);
    for (int i = 0; i < 2; i++) {
        queue[tail++] = context_number(&start[i]);
        seen[queue[tail - 1]] = true;
    }
    while (head < tail) {
        const supervisor_t before = context_of(queue[head++]);
        for (unsigned i = 0; i < EVENTS * VIEWS; i++) {
            const event_t event = (event_t)(i / VIEWS);
            const supervisor_view_t view = view_of(i % VIEWS);
            supervisor_t after = before;
            const action_t action = supervisor_event(&after, event, &view);
            if (check != NULL)
                check(&before, event, &view, action, &after);
            if (!seen[context_number(&after)]) {
                seen[context_number(&after)] = true;
                queue[tail++] = context_number(&after);
            }
        }
    }
    return tail;
}

static void test_supervisor_event_every_reachable_context_is_in_the_matrix(void)
{
    bool seen[CONTEXTS];
    bool used[STATES] = {false};
    TEST_ASSERT_GREATER_THAN(STATES, reach(seen, NULL));
    for (unsigned n = 0; n < CONTEXTS; n++)
        for (unsigned bits = 0; seen[n] && bits < VIEWS; bits++) {
            const supervisor_t sup = context_of(n);
            const supervisor_view_t view = view_of(bits);
            TEST_ASSERT_NOT_NULL_MESSAGE(situation_find(&sup, &view), state_name(sup.state));
            used[sup.state] = true;
        }
    for (unsigned state = 0; state < STATES; state++)
        TEST_ASSERT_TRUE_MESSAGE(used[state], state_name((state_t)state));
}

/* text names the step */
#define IMPLIES(condition, claim) TEST_ASSERT_TRUE_MESSAGE(!(condition) || (claim), text)

static bool is_up_by_silence(const supervisor_t *sup)
{
    return sup->state == STATE_RISING || sup->state == STATE_NEUTRAL ||
           (sup->state == STATE_HOLD && sup->interrupted == STATE_ENGAGED);
}

static void check_invariants(const supervisor_t *before, event_t event, const supervisor_view_t *view, action_t action,
                             const supervisor_t *after)
{
    static const action_t k_entry[STATES] = {
        [STATE_OFF] = ACTION_OFF,          [STATE_HOMING] = ACTION_HOME,     [STATE_SETTLED] = ACTION_STAY,
        [STATE_RISING] = ACTION_RISE,      [STATE_NEUTRAL] = ACTION_STAY,    [STATE_ENGAGED] = ACTION_FOLLOW,
        [STATE_HOLD] = ACTION_STOP,        [STATE_SETTLING] = ACTION_SETTLE, [STATE_SERVICE] = ACTION_SERVE,
        [STATE_FAULT] = ACTION_FAULT_STOP, [STATE_ESTOP] = ACTION_ESTOP};
    const state_t from = before->state, to = after->state;
    char text[120];
    snprintf(text, sizeof text, "%s + %s -> %s", state_name(from), event_name(event), state_name(to));

    /* an action when, and only when, the state changes, and it is that of the new state */
    TEST_ASSERT_EQUAL_MESSAGE(from == to ? ACTION_NONE : k_entry[to], action, text);

    IMPLIES(from == STATE_ESTOP && to != from, event == EVENT_RESET && to == STATE_OFF && !view->is_estop_active);
    IMPLIES(from == STATE_FAULT && to != from && to != STATE_ESTOP, event == EVENT_RESET && to == STATE_OFF);
    IMPLIES(supervisor_is_latched(before) && to == STATE_OFF, !view->is_fault_present);
    IMPLIES(event == EVENT_ESTOP, to == STATE_ESTOP);
    IMPLIES(event == EVENT_FAULT, supervisor_is_latched(after));
    IMPLIES(supervisor_is_latched(after) && to != from, event == EVENT_FAULT || event == EVENT_ESTOP);

    /* the drives go off under nobody who is up */
    IMPLIES(to == STATE_OFF && from != to, from == STATE_SETTLED || from == STATE_SERVICE || supervisor_is_latched(before) ||
                                               (from == STATE_HOLD && before->interrupted == STATE_HOMING));
    /* SETTLED and NEUTRAL are arrived at, never declared */
    IMPLIES(to == STATE_NEUTRAL && from != to, from == STATE_RISING || (from == STATE_HOLD && before->interrupted == to));
    IMPLIES(to == STATE_SETTLED && from != to, event == EVENT_MOVE_DONE || view->is_at_settled);

    /* into SERVICE from where nobody rides, and out of it to OFF, which then comes up on request only */
    IMPLIES(to == STATE_SERVICE && from != to, event == EVENT_SERVICE && (from == STATE_OFF || from == STATE_SETTLED));
    IMPLIES(from == STATE_SERVICE && to != from, to == STATE_OFF || supervisor_is_latched(after));
    IMPLIES(to == STATE_SERVICE, after->goal == STATE_OFF);

    /* a frame raises nobody, and gives back only what silence took */
    IMPLIES(event == EVENT_FRAME, to == from || (to == STATE_ENGAGED && before->is_held_by_silence));
    IMPLIES(event == EVENT_FRAME && after->goal != before->goal, before->is_held_by_silence);
    IMPLIES(after->goal == STATE_ENGAGED && before->goal != STATE_ENGAGED, event == EVENT_ENGAGE || event == EVENT_FRAME);
    IMPLIES(after->is_held_by_silence, is_up_by_silence(after));
    IMPLIES(event == EVENT_HOLD, !after->is_held_by_silence);
    IMPLIES(to == STATE_ENGAGED, after->goal == STATE_ENGAGED);
}

static void test_supervisor_event_from_every_reachable_context_keeps_the_invariants(void)
{
    bool seen[CONTEXTS];
    TEST_ASSERT_GREATER_THAN(STATES, reach(seen, check_invariants));
}

/* The platform left alone: its moves end, the cycles go by. */
static void run_on(supervisor_t *sup)
{
    const supervisor_view_t view = {.is_at_rest = true};
    for (int i = 0; i < 8; i++) {
        supervisor_event(sup, EVENT_TICK, &view);
        if (sup->state == STATE_HOMING || sup->state == STATE_RISING || sup->state == STATE_SETTLING)
            supervisor_event(sup, EVENT_MOVE_DONE, &view);
    }
}

/* From every reachable context that is not latched, nor SERVICE where the request leads up: it is carried through to the end and
 * rests there. */
static void check_request_ends_in(event_t request, state_t end)
{
    bool seen[CONTEXTS];
    reach(seen, NULL);
    for (unsigned n = 0; n < CONTEXTS; n++) {
        supervisor_t sup = context_of(n);
        if (!seen[n] || supervisor_is_latched(&sup) || (sup.state == STATE_SERVICE && end != STATE_OFF))
            continue;
        char text[80];
        snprintf(text, sizeof text, "%s from %s", event_name(request), state_name(sup.state));
        supervisor_event(&sup, request, &m_view);
        run_on(&sup);
        TEST_ASSERT_EQUAL_STRING_MESSAGE(state_name(end), state_name(sup.state), text);
        TEST_ASSERT_EQUAL_MESSAGE(end, sup.goal, text);
        run_on(&sup);
        TEST_ASSERT_EQUAL_MESSAGE(end, sup.state, text);
    }
}

static void test_supervisor_event_engage_always_ends_engaged(void)
{
    check_request_ends_in(EVENT_ENGAGE, STATE_ENGAGED);
}

static void test_supervisor_event_park_always_ends_settled(void)
{
    check_request_ends_in(EVENT_PARK, STATE_SETTLED);
}

static void test_supervisor_event_shutdown_always_ends_off(void)
{
    check_request_ends_in(EVENT_SHUTDOWN, STATE_OFF);
}

static void test_supervisor_event_silence_settle_lowers_whatever_it_held(void)
{
    bool seen[CONTEXTS];
    unsigned held = 0;
    reach(seen, NULL);
    for (unsigned n = 0; n < CONTEXTS; n++) {
        supervisor_t sup = context_of(n);
        if (!seen[n] || !sup.is_held_by_silence)
            continue;
        held++;
        supervisor_event(&sup, EVENT_SILENCE_SETTLE, &m_view);
        supervisor_event(&sup, EVENT_FRAME, &m_view); /* too late: it stays down */
        run_on(&sup);
        TEST_ASSERT_EQUAL(STATE_SETTLED, sup.state);
    }
    TEST_ASSERT_GREATER_THAN(2, held);
}

/* ---- permits ----
 * What each request needs, by state: F key, supply, approval, self-test and no shutdown   U the same without a self-test   R no
 * shutdown   . nothing, or there is no such request. */
static const event_t k_requests[] = {EVENT_ENGAGE, EVENT_HOLD,     EVENT_RESUME,  EVENT_PARK,
                                     EVENT_RESET,  EVENT_SHUTDOWN, EVENT_SERVICE, EVENT_SERVICE_OFF};

static const char *needs_by_hand(const supervisor_t *sup)
{
    /*                                   EhrpRsSo */
    static const char *const k_needs = "O F..U..U."
                                       "H F..R...."
                                       "S F..R..U."
                                       "R U..R...."
                                       "N U..R...."
                                       "E U..R...."
                                       "D U.UR...."
                                       "T U..R...."
                                       "V ......UR"
                                       "F ........"
                                       "X ........";
    const bool is_homing_held = sup->state == STATE_HOLD && sup->interrupted == STATE_HOMING;
    const char *row = k_needs;
    while (*row != letter(sup->state)) {
        row += 10;
    }
    return is_homing_held ? "F.UU...." : row + 2;
}

static bool is_needed(char set, uint32_t permit)
{
    return permit == PERMIT_RUNNING                                                       ? set != '.'
           : permit == PERMIT_SELFTEST                                                    ? set == 'F'
           : permit == PERMIT_KEY || permit == PERMIT_SUPPLY || permit == PERMIT_APPROVAL ? set == 'F' || set == 'U'
                                                                                          : false;
}

static char needed_by(const supervisor_t *sup, event_t event)
{
    for (unsigned i = 0; i < sizeof k_requests / sizeof k_requests[0]; i++)
        if (k_requests[i] == event)
            return needs_by_hand(sup)[i];
    return '.';
}

/* Where there is no such request: what it needs anywhere. */
static char needed_anywhere(const supervisor_t *sup, event_t event)
{
    const char set = needed_by(sup, event);
    const bool is_lifting = event == EVENT_ENGAGE || event == EVENT_RESUME || event == EVENT_SERVICE;
    return set != '.' ? set : is_lifting ? 'U' : event == EVENT_PARK || event == EVENT_SERVICE_OFF ? 'R' : '.';
}

static void check_permit(const supervisor_t *before, event_t event, uint32_t permit)
{
    const bool needed = is_needed(needed_by(before, event), permit);
    const supervisor_view_t given = {.is_at_rest = true}, withheld = {.is_at_rest = true, .withheld = permit};
    supervisor_t expected = *before, actual = *before;
    char text[100];
    snprintf(text, sizeof text, "%s in %s without %u", event_name(event), state_name(before->state), (unsigned)permit);
    if (needed)
        expected.ignored[event]++;
    const action_t expected_action = needed ? ACTION_NONE : supervisor_event(&expected, event, &given);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(is_needed(needed_anywhere(before, event), permit) ? permit : 0,
                                     supervisor_missing(before, event, &withheld), text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, supervisor_missing(before, event, &given), text);
    TEST_ASSERT_EQUAL_MESSAGE(expected_action, supervisor_event(&actual, event, &withheld), text);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&expected, &actual, sizeof actual, text);
}

static void test_supervisor_event_without_a_permit_nothing_goes_up_and_everything_goes_down(void)
{
    bool seen[CONTEXTS];
    reach(seen, NULL);
    for (unsigned n = 0; n < CONTEXTS; n++)
        for (unsigned i = 0; seen[n] && i < EVENTS * 6u; i++) {
            const supervisor_t sup = context_of(n);
            check_permit(&sup, (event_t)(i / 6u), 1u << i % 6u);
        }
}

static void test_supervisor_missing_names_all_that_is_withheld_and_needed(void)
{
    const supervisor_view_t view = {.is_at_rest = true, .withheld = PERMIT_KEY | PERMIT_SELFTEST | PERMIT_PUNCTUAL};
    TEST_ASSERT_EQUAL_UINT32(PERMIT_KEY | PERMIT_SELFTEST, supervisor_missing(&m_sup, EVENT_ENGAGE, &view));
    TEST_ASSERT_EQUAL_UINT32(PERMIT_KEY, supervisor_missing(&m_sup, EVENT_PARK, &view));
    TEST_ASSERT_EQUAL_UINT32(PERMIT_KEY, supervisor_missing(&m_sup, EVENT_RESUME, &view)); /* and there is nothing to resume */
    TEST_ASSERT_EQUAL_UINT32(0, supervisor_missing(&m_sup, EVENT_HOLD, &view));
}

/* Said again from the requirement: down as long as there is power, but no hold of a person ends for that; the key ends it. */
static event_t response_by_hand(const supervisor_t *sup, uint32_t lost)
{
    const bool is_held = sup->state == STATE_HOLD, is_up = sup->goal == STATE_NEUTRAL || sup->goal == STATE_ENGAGED;
    const bool is_down = sup->state == STATE_OFF || (is_held && sup->interrupted == STATE_HOMING) || supervisor_is_latched(sup);
    if (sup->state == STATE_SERVICE)
        return lost == 0 ? EVENTS : lost == PERMIT_PUNCTUAL ? EVENT_HOLD : EVENT_SERVICE_OFF;
    if (!is_down && is_up && ((lost & PERMIT_KEY) != 0 || ((lost & PERMIT_SUPPLY) != 0 && (!is_held || sup->is_held_by_silence))))
        return EVENT_PARK;
    const bool is_led = sup->state == STATE_RISING || sup->state == STATE_NEUTRAL || sup->state == STATE_ENGAGED;
    return is_led && (lost & PERMIT_PUNCTUAL) != 0 ? EVENT_HOLD : EVENTS;
}

static void test_supervisor_response_leads_down_and_lacks_nothing(void)
{
    static const uint32_t k_lost[] = {PERMIT_KEY, PERMIT_SUPPLY, PERMIT_PUNCTUAL};
    bool seen[CONTEXTS];
    unsigned responses = 0;
    reach(seen, NULL);
    for (unsigned n = 0; n < CONTEXTS; n++)
        for (unsigned i = 0; seen[n] && i < 8u; i++) {
            supervisor_t sup = context_of(n);
            const uint32_t lost = (i & 1u ? k_lost[0] : 0) | (i & 2u ? k_lost[1] : 0) | (i & 4u ? k_lost[2] : 0);
            const supervisor_view_t view = {.is_at_rest = true, .withheld = lost};
            const event_t response = supervisor_response(&sup, lost);
            TEST_ASSERT_EQUAL_STRING_MESSAGE(event_name(response_by_hand(&sup, lost)), event_name(response),
                                             state_name(sup.state));
            if (response == EVENTS)
                continue;
            responses++;
            supervisor_event(&sup, response, &view);
            TEST_ASSERT_EQUAL_UINT32(0, sup.ignored[response]);
            run_on(&sup);
            TEST_ASSERT_TRUE(sup.state == STATE_SETTLED || sup.state == STATE_OFF || lost == PERMIT_PUNCTUAL);
        }
    TEST_ASSERT_GREATER_THAN(50, responses);
    TEST_ASSERT_EQUAL(EVENTS, supervisor_response(&m_sup, PERMIT_APPROVAL | PERMIT_SELFTEST | PERMIT_RUNNING));
}

/* ---- random walks ---- */

/* Who may be up: a model of one bit, set by an ENGAGE that was taken, taken back by all that means down. */
static bool consent_after(bool consent, event_t event, const supervisor_t *after, bool was_ignored)
{
    if (event == EVENT_ENGAGE && !was_ignored)
        return true;
    if (event == EVENT_PARK || event == EVENT_SHUTDOWN || after->state == STATE_SETTLING)
        return after->state == STATE_RISING && consent;
    if (after->state == STATE_OFF || supervisor_is_latched(after))
        return false;
    return consent;
}

static void test_supervisor_event_random_walks_raise_nobody_without_engage(void)
{
    bool consent = false;
    unsigned visits[STATES] = {0};
    for (unsigned step = 0; step < 1000000u; step++) {
        const event_t event = (event_t)(random_below(200) == 0 ? EVENT_FAULT + random_below(2) : random_below(EVENT_FAULT));
        const supervisor_view_t view = view_of(random_below(VIEWS));
        const supervisor_t before = m_sup;
        const action_t action = supervisor_event(&m_sup, event, &view);
        const uint32_t newly_ignored = m_sup.ignored[event] - before.ignored[event];

        check_invariants(&before, event, &view, action, &m_sup);
        TEST_ASSERT_LESS_OR_EQUAL(1, newly_ignored);
        TEST_ASSERT_TRUE(newly_ignored == 0 || (before.state == m_sup.state && before.goal == m_sup.goal));
        consent = consent_after(consent, event, &m_sup, newly_ignored != 0);
        const bool is_up = m_sup.state == STATE_RISING || m_sup.state == STATE_NEUTRAL || m_sup.state == STATE_ENGAGED;
        TEST_ASSERT_TRUE_MESSAGE(consent || !is_up, event_name(event));
        visits[m_sup.state]++;
    }
    for (unsigned state = 0; state < STATES; state++)
        TEST_ASSERT_GREATER_THAN_MESSAGE(1000, visits[state], state_name((state_t)state));
}

static void test_supervisor_event_same_walk_twice_gives_the_same_bytes(void)
{
    supervisor_t first, second;
    memset(&first, 0x00, sizeof first);
    memset(&second, 0xff, sizeof second); /* init leaves nothing of what was there */
    supervisor_init(&first);
    supervisor_init(&second);
    for (unsigned step = 0; step < 10000u; step++) {
        const event_t event = (event_t)random_below(EVENTS);
        const supervisor_view_t view = view_of(random_below(VIEWS));
        TEST_ASSERT_EQUAL(supervisor_event(&first, event, &view), supervisor_event(&second, event, &view));
    }
    TEST_ASSERT_EQUAL(first.state, second.state);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(first.ignored, second.ignored, EVENTS);
}

/* ---- stories ---- */

static void story(const event_t *events, const state_t *states, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        char text[60];
        snprintf(text, sizeof text, "step %u: %s", (unsigned)i, event_name(events[i]));
        supervisor_event(&m_sup, events[i], &m_view);
        TEST_ASSERT_EQUAL_STRING_MESSAGE(state_name(states[i]), state_name(m_sup.state), text);
    }
}

static void test_supervisor_event_engage_from_off_passes_every_state_on_the_way(void)
{
    static const event_t k_events[] = {EVENT_ENGAGE, EVENT_MOVE_DONE, EVENT_TICK, EVENT_MOVE_DONE, EVENT_TICK, EVENT_FRAME};
    static const state_t k_expected[] = {STATE_HOMING, STATE_SETTLED, STATE_RISING, STATE_NEUTRAL, STATE_ENGAGED, STATE_ENGAGED};
    story(k_events, k_expected, 6);
}

static void test_supervisor_event_drives_still_on_after_shutdown_stay_off(void)
{
    static const event_t k_events[] = {EVENT_DRIVES_READY, EVENT_SHUTDOWN, EVENT_DRIVES_READY, EVENT_TICK};
    static const state_t k_expected[] = {STATE_SETTLED, STATE_OFF, STATE_OFF, STATE_OFF};
    m_view.is_at_settled = true;
    story(k_events, k_expected, 4);
}

static void test_supervisor_event_operator_hold_over_silence_is_not_released_by_frames(void)
{
    static const event_t k_events[] = {EVENT_ENGAGE, EVENT_MOVE_DONE, EVENT_TICK,           EVENT_SILENCE_HOLD,
                                       EVENT_HOLD,   EVENT_FRAME,     EVENT_SILENCE_SETTLE, EVENT_RESUME};
    static const state_t k_expected[] = {STATE_RISING, STATE_NEUTRAL, STATE_ENGAGED, STATE_HOLD,
                                         STATE_HOLD,   STATE_HOLD,    STATE_HOLD,    STATE_ENGAGED};
    supervisor_init_settled(&m_sup);
    story(k_events, k_expected, 8);
    TEST_ASSERT_EQUAL_UINT32(1, m_sup.ignored[EVENT_FRAME]);
}

static void test_supervisor_event_hold_in_the_cycle_of_settling_keeps_it_down(void)
{
    static const event_t k_events[] = {EVENT_ENGAGE, EVENT_MOVE_DONE, EVENT_HOLD, EVENT_TICK, EVENT_FRAME};
    static const state_t k_expected[] = {STATE_HOMING, STATE_SETTLED, STATE_SETTLED, STATE_SETTLED, STATE_SETTLED};
    story(k_events, k_expected, 5);
}

static void test_supervisor_event_out_of_service_the_drives_stay_off_until_somebody_wants_them(void)
{
    static const event_t k_events[] = {EVENT_SERVICE, EVENT_ENGAGE,      EVENT_PARK,         EVENT_FRAME,
                                       EVENT_HOLD,    EVENT_SERVICE_OFF, EVENT_DRIVES_READY, EVENT_PARK};
    static const state_t k_expected[] = {STATE_SERVICE, STATE_SERVICE, STATE_SERVICE, STATE_SERVICE,
                                         STATE_SERVICE, STATE_OFF,     STATE_OFF,     STATE_HOMING};
    supervisor_init_settled(&m_sup);
    m_view.is_at_settled = true;
    story(k_events, k_expected, 8);
    TEST_ASSERT_EQUAL_UINT32(1, m_sup.ignored[EVENT_ENGAGE]);
}

static void test_supervisor_event_outside_the_enum_asserts_and_changes_nothing(void)
{
    static supervisor_t s_before;
    s_before = m_sup;
    m_is_assert_expected = true;
    if (setjmp(m_assert_jump) == 0) {
        supervisor_event(&m_sup, EVENTS, &m_view);
        TEST_FAIL_MESSAGE("taken");
    }
    TEST_ASSERT_EQUAL(s_before.state, m_sup.state);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(s_before.ignored, m_sup.ignored, EVENTS);
}

static void test_supervisor_is_latched_only_in_fault_and_estop(void)
{
    for (unsigned state = 0; state < STATES; state++) {
        m_sup.state = (state_t)state;
        TEST_ASSERT_EQUAL(state == STATE_FAULT || state == STATE_ESTOP, supervisor_is_latched(&m_sup));
    }
}

static void test_state_name_and_event_name_are_complete_and_distinct(void)
{
    for (unsigned a = 0; a < STATES; a++)
        for (unsigned b = 0; b < a; b++)
            TEST_ASSERT_TRUE(strcmp(state_name((state_t)a), state_name((state_t)b)) != 0);
    for (unsigned a = 0; a < EVENTS; a++)
        for (unsigned b = 0; b < a; b++)
            TEST_ASSERT_TRUE(strcmp(event_name((event_t)a), event_name((event_t)b)) != 0);
    TEST_ASSERT_EQUAL_STRING("SETTLED", state_name(STATE_SETTLED));
    TEST_ASSERT_EQUAL_STRING("engage", event_name(EVENT_ENGAGE));
    TEST_ASSERT_EQUAL_STRING("?", state_name(STATES));
    TEST_ASSERT_EQUAL_STRING("?", event_name(EVENTS));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_supervisor_event_every_situation_matches_the_matrix);
    RUN_TEST(test_supervisor_event_every_reachable_context_is_in_the_matrix);
    RUN_TEST(test_supervisor_event_from_every_reachable_context_keeps_the_invariants);
    RUN_TEST(test_supervisor_event_engage_always_ends_engaged);
    RUN_TEST(test_supervisor_event_park_always_ends_settled);
    RUN_TEST(test_supervisor_event_shutdown_always_ends_off);
    RUN_TEST(test_supervisor_event_silence_settle_lowers_whatever_it_held);
    RUN_TEST(test_supervisor_event_without_a_permit_nothing_goes_up_and_everything_goes_down);
    RUN_TEST(test_supervisor_missing_names_all_that_is_withheld_and_needed);
    RUN_TEST(test_supervisor_response_leads_down_and_lacks_nothing);
    RUN_TEST(test_supervisor_event_random_walks_raise_nobody_without_engage);
    RUN_TEST(test_supervisor_event_same_walk_twice_gives_the_same_bytes);
    RUN_TEST(test_supervisor_event_engage_from_off_passes_every_state_on_the_way);
    RUN_TEST(test_supervisor_event_drives_still_on_after_shutdown_stay_off);
    RUN_TEST(test_supervisor_event_operator_hold_over_silence_is_not_released_by_frames);
    RUN_TEST(test_supervisor_event_hold_in_the_cycle_of_settling_keeps_it_down);
    RUN_TEST(test_supervisor_event_out_of_service_the_drives_stay_off_until_somebody_wants_them);
    RUN_TEST(test_supervisor_event_outside_the_enum_asserts_and_changes_nothing);
    RUN_TEST(test_supervisor_is_latched_only_in_fault_and_estop);
    RUN_TEST(test_state_name_and_event_name_are_complete_and_distinct);
    return UNITY_END();
}
