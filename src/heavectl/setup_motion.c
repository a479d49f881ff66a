/* SPDX-License-Identifier: MIT
 * setup_motion.c - see setup_motion.h.
 */
#include "heavectl/setup_motion.h"

#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/translate.h"
#include "heavectl/hold.h"
#include "setup/configure.h"

#define JOG_MM_S    2.0
#define RISE_MM_S   5.0
#define TILT_DEG_S  1.0
#define END_MM      2.5    /* heaved leads a cylinder by hand to 2 mm before its end */
#define FAR_MM      5000.0 /* further than any cylinder goes */
#define NEAR_MM     0.02   /* a way that has come so near to its end has come to it */
#define SAME_MM     0.1
#define QUIET_MS    300 /* a key that is let go comes no more */
#define PERSON_MS   120000
#define RELEASED_MS 3000
#define SETTLE_MS   400 /* a drive comes to rest after its set-point */

static bool fail(setup_session_t *session, const char *text)
{
    (void)snprintf(session->error, sizeof session->error, "%.2000s", text);
    return false;
}

static void pause_ms(long ms)
{
    const struct timespec pause = {.tv_nsec = ms * 1000000L};
    (void)nanosleep(&pause, NULL);
}

/* What was held is still typed for a while. */
static void drain(void)
{
    char keys[64];
    struct pollfd wait = {.fd = STDIN_FILENO, .events = POLLIN};
    for (int64_t until_ms = heaved_link_now_ms() + QUIET_MS; heaved_link_now_ms() < until_ms;) {
        if (poll(&wait, 1, QUIET_MS / 4) > 0 && read(STDIN_FILENO, keys, sizeof keys) <= 0) {
            return;
        }
    }
}

/* A connection of its own for each: what a hold leaves unanswered belongs to nobody after it. @return whether it came to its end
 */
static bool hold(setup_session_t *session, const char *request, const hold_watch_t *watch)
{
    const int fd = heaved_link_open(session->socket);
    if (fd < 0) {
        return fail(session, _("heaved has gone; see its log"));
    }
    const int code = hold_run(fd, request, watch, session->is_interrupted);
    (void)close(fd);
    drain();
    if (code != EXIT_DONE) {
        return setup_session_fail(session, _("it has been refused, see above"));
    }
    return hold_has_arrived() || fail(session, _("it was let go before its end"));
}

/* What became of a press. */
typedef struct {
    bool was_pressed, is_let_go;
} press_t;

/* Over once it was held and let go. */
static bool is_let_go(void *context, bool is_pressed)
{
    press_t *press = context;
    press->is_let_go = press->was_pressed && !is_pressed;
    press->was_pressed = press->was_pressed || is_pressed;
    return press->is_let_go;
}

/* From where the step began, however often the key is let go in between: a press goes the rest of the way, never all of it again.
 */
static bool move(setup_session_t *session, const setup_question_t *question, double (*where)(setup_session_t *, unsigned),
                 const char *axis, double speed, char result[SETUP_ANSWER_MAX])
{
    char request[64];
    double at = where(session, question->index);
    if (strcmp(session->jog, question->key) != 0) {
        (void)snprintf(session->jog, sizeof session->jog, "%s", question->key);
        session->jog_from = at;
    }
    double left = session->jog_from + question->way_mm - at;
    bool is_at_end = false;
    while (fabs(left) > NEAR_MM && !is_at_end) {
        press_t press = {false};
        const hold_watch_t watch = {is_let_go, &press};
        (void)snprintf(request, sizeof request, "jog %s %.3f %.3f", axis, left < 0 ? -speed : speed, fabs(left));
        if (!hold(session, request, &watch)) {
            return false;
        }
        pause_ms(SETTLE_MS);
        const double before = at;
        at = where(session, question->index);
        is_at_end = !press.is_let_go && fabs(at - before) < NEAR_MM; /* it goes no further */
        left = session->jog_from + question->way_mm - at;
    }
    if (isnan(left)) {
        return fail(session, _("heaved does not know where it is"));
    }
    const double gone = at - session->jog_from;
    if (fabs(gone) < fabs(question->way_mm) / 2) {
        return fail(
            session,
            _("it has not gone its way: it stands at the end of what it can do, its drive does not follow, or the key was let "
              "go at once"));
    }
    session->jog[0] = '\0';
    (void)snprintf(result, SETUP_ANSWER_MAX, "%.2f", gone);
    return true;
}

static double where_drive(setup_session_t *session, unsigned index)
{
    double actual_mm[SETUP_DRIVES_MAX] = {0};
    return setup_session_counts(session, NULL, actual_mm) >= index ? actual_mm[index - 1u] : NAN;
}

bool setup_motion_jog(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                      char result[SETUP_ANSWER_MAX])
{
    char axis[8];
    const bool is_new = session->pid == 0;
    if (is_new) {
        session->jog[0] = '\0'; /* a zero that is made up is another one now */
    }
    if (!setup_session_need_torque(session, setup, question->stage)) {
        return false;
    }
    (void)snprintf(axis, sizeof axis, "%u", question->index);
    return move(session, question, where_drive, axis, JOG_MM_S, result);
}

static bool home(setup_session_t *session)
{
    if (setup_session_is_homed(session)) {
        return true;
    }
    printf("%s\n", _("The drives have to find their zero first."));
    if (!hold(session, "home all", NULL)) {
        return false;
    }
    return setup_session_is_homed(session) || fail(session, _("not every drive has found its zero"));
}

bool setup_motion_home(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                       char result[SETUP_ANSWER_MAX])
{
    (void)snprintf(result, SETUP_ANSWER_MAX, "homed");
    return setup_session_need_torque(session, setup, question->stage) && home(session);
}

bool setup_motion_counts(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                         char result[SETUP_ANSWER_MAX])
{
    double counts[SETUP_DRIVES_MAX] = {0};
    size_t length = 0;
    if (!setup_session_need_torque(session, setup, question->stage) || !home(session)) {
        return false;
    }
    const unsigned count = setup_session_counts(session, counts, NULL);
    for (unsigned i = 0; i < count; i++) {
        length += (size_t)snprintf(&result[length], SETUP_ANSWER_MAX - length, "%s%.0f", i > 0 ? "," : "", counts[i]);
    }
    return count > 0 || fail(session, _("not every drive says where it is"));
}

bool setup_motion_same(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                       char result[SETUP_ANSWER_MAX])
{
    char now[SETUP_ANSWER_MAX];
    if (!setup_motion_counts(session, setup, question, now)) {
        return false;
    }
    const double turn = strtod(setup_get(setup, "turn"), NULL), lead_mm = strtod(setup_get(setup, "lead"), NULL);
    const double gear = strtod(setup_get(setup, "gear"), NULL);
    const bool is_supply = strncmp(question->key, "supply.", 7) == 0;
    const char *then = setup_get(setup, is_supply ? "supply.counts" : "zero.counts"), *is = now;
    bool is_same = true;
    for (unsigned i = 1; then != NULL && is != NULL; i++) {
        const double off_mm = fabs(strtod(then, NULL) - strtod(is, NULL)) * lead_mm / (turn * gear);
        if (off_mm > SAME_MM) {
            printf(_("By its count cylinder %u has moved by %.2f mm since.\n"), i, off_mm);
            is_same = false;
        }
        then = strchr(then, ',');
        is = strchr(is, ',');
        then = then != NULL ? then + 1 : NULL;
        is = is != NULL ? is + 1 : NULL;
    }
    (void)snprintf(result, SETUP_ANSWER_MAX, is_same ? "same" : "moved");
    return true;
}

bool setup_motion_pose(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                       char result[SETUP_ANSWER_MAX])
{
    if (!setup_session_need_torque(session, setup, question->stage) || !home(session)) {
        return false;
    }
    cJSON *status = heaved_link_ask(&session->link, "status"), *geometry = heaved_link_ask(&session->link, "geometry");
    const cJSON *pose = cJSON_GetObjectItemCaseSensitive(status, "pose_actual");
    const bool is_known = cJSON_IsObject(pose);
    (void)snprintf(result, SETUP_ANSWER_MAX, "%.3f,%.3f,%.3f,%.3f,%.3f,%.3f", heaved_link_number(pose, "roll_deg"),
                   heaved_link_number(pose, "pitch_deg"), heaved_link_number(pose, "yaw_deg"), heaved_link_number(pose, "x_mm"),
                   heaved_link_number(pose, "y_mm"),
                   heaved_link_number(pose, "z_mm") + heaved_link_number(geometry, "zero_height_mm"));
    cJSON_Delete(status);
    cJSON_Delete(geometry);
    return is_known || fail(session, _("no pose of the plate has these lengths: \"back\", and measure them again"));
}

static double pose_member(setup_session_t *session, const char *name)
{
    cJSON *status = heaved_link_ask(&session->link, "status");
    const cJSON *pose = cJSON_GetObjectItemCaseSensitive(status, "pose_actual");
    const double value = cJSON_IsObject(pose) ? heaved_link_number(pose, name) : NAN;
    cJSON_Delete(status);
    return value;
}
static double where_up(setup_session_t *session, unsigned index)
{
    (void)index;
    return pose_member(session, "z_mm");
}
static double where_tilted(setup_session_t *session, unsigned index)
{
    return pose_member(session, index <= 2u ? "pitch_deg" : "roll_deg");
}

/* Whether the cylinders have room for twice a way outwards. */
static bool has_room(setup_session_t *session, const setup_t *setup, double way_mm)
{
    double actual_mm[SETUP_DRIVES_MAX] = {0};
    bool has = true;
    const unsigned count = setup_session_counts(session, NULL, actual_mm);
    for (unsigned i = 0; i < count; i++) {
        has = has && actual_mm[i] < configure_stroke(setup, i + 1u) - 2 * way_mm;
    }
    return has;
}

/* Once begun it goes on in its direction, however often the key is let go. */
bool setup_motion_rise(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                       char result[SETUP_ANSWER_MAX])
{
    setup_question_t way = *question;
    if (!setup_session_need_torque(session, setup, question->stage) || !home(session)) {
        return false;
    }
    if (strcmp(session->jog, question->key) != 0) {
        session->is_down = !has_room(session, setup, question->way_mm);
    }
    way.way_mm = session->is_down ? -way.way_mm : way.way_mm;
    return move(session, &way, where_up, "z", RISE_MM_S, result);
}

bool setup_motion_tilt(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                       char result[SETUP_ANSWER_MAX])
{
    return setup_session_need_torque(session, setup, question->stage) && home(session) &&
           move(session, question, where_tilted, question->index <= 2u ? "pitch" : "roll", TILT_DEG_S, result);
}

/* Whether heaved has stopped all because of one cylinder, and which. */
static bool find_stopped(setup_session_t *session, char result[SETUP_ANSWER_MAX])
{
    double actual_mm[SETUP_DRIVES_MAX] = {0};
    cJSON *status = heaved_link_ask(&session->link, "status");
    const cJSON *fault = cJSON_GetObjectItemCaseSensitive(status, "fault");
    const unsigned axis = (unsigned)heaved_link_number(fault, "axis");
    const bool is_fault = strcmp(heaved_link_text(status, "state"), "FAULT") == 0 && axis >= 1u && axis <= SETUP_DRIVES_MAX;
    cJSON_Delete(status);
    if (!is_fault || setup_session_counts(session, NULL, actual_mm) < axis) {
        return false;
    }
    (void)snprintf(result, SETUP_ANSWER_MAX, "stopped %u %.1f", axis, actual_mm[axis - 1u]);
    return true;
}

/* Whether a cylinder stands where there is no way left. */
static bool stands_at_end(setup_session_t *session, const setup_t *setup, bool is_in)
{
    double actual_mm[SETUP_DRIVES_MAX] = {0};
    bool is = false;
    const unsigned count = setup_session_counts(session, NULL, actual_mm);
    for (unsigned i = 0; i < count; i++) {
        is = is || (is_in ? actual_mm[i] < END_MM : actual_mm[i] > configure_stroke(setup, i + 1u) - END_MM);
    }
    return is;
}

/* The key may be let go in between, as often as somebody likes. */
bool setup_motion_ends(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                       char result[SETUP_ANSWER_MAX])
{
    char request[64];
    (void)snprintf(request, sizeof request, "jog z %g %g", question->way_mm < 0 ? -RISE_MM_S : RISE_MM_S, FAR_MM);
    if (!setup_session_need_torque(session, setup, question->stage) || !home(session)) {
        return false;
    }
    for (bool is_there = stands_at_end(session, setup, question->way_mm < 0); !is_there;) {
        press_t press = {false};
        const hold_watch_t watch = {is_let_go, &press};
        if (!hold(session, request, &watch)) {
            return find_stopped(session, result);
        }
        is_there = !press.is_let_go;
    }
    pause_ms(SETTLE_MS);
    (void)snprintf(result, SETUP_ANSWER_MAX, "there");
    return true;
}

/* --- Relays and switches --- */

bool setup_motion_relay(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                        char result[SETUP_ANSWER_MAX])
{
    char request[32];
    press_t press = {false};
    const hold_watch_t watch = {is_let_go, &press};
    (void)snprintf(request, sizeof request, "relay %u", question->index);
    (void)snprintf(result, SETUP_ANSWER_MAX, "switched");
    return setup_session_need(session, setup, question->stage) && hold(session, request, &watch);
}

static bool is_estop(const cJSON *status)
{
    return heaved_link_is_set(status, "estop_active");
}
static bool is_no_estop(const cJSON *status)
{
    return !heaved_link_is_set(status, "estop_active");
}
static bool is_out(const cJSON *status)
{
    return strcmp(heaved_link_text(status, "state"), "SERVICE") != 0;
}
static bool is_failing(const cJSON *status)
{
    return heaved_link_is_set(status, "power_failing");
}
static bool is_supplied(const cJSON *status)
{
    return !heaved_link_is_set(status, "power_failing");
}
static bool is_any(const cJSON *status)
{
    (void)status;
    return true;
}

bool setup_motion_switch(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                         char result[SETUP_ANSWER_MAX])
{
    static const heaved_link_seen_t k_on[] = {is_estop, is_out, is_any, is_failing},
                                    k_off[] = {is_no_estop, is_any, is_any, is_supplied};
    char error[HEAVED_LINK_ERROR_MAX];
    const unsigned index = question->index - 1u;
    if (!setup_session_need(session, setup, question->stage)) {
        return false;
    }
    printf("%s\n", _("Waiting for it; s and Enter: it is not seen."));
    (void)fflush(stdout);
    bool is_seen = heaved_link_wait(&session->link, "status", k_on[index], PERSON_MS) == 'y';
    is_seen = is_seen && heaved_link_wait(&session->link, "status", k_off[index], PERSON_MS) == 'y';
    for (int64_t until_ms = heaved_link_now_ms() + RELEASED_MS; index == 0 && is_seen && heaved_link_now_ms() < until_ms;) {
        if (heaved_link_has_done(&session->link, "reset", error)) {
            break;
        }
        pause_ms(HEAVED_LINK_LOOK_MS);
    }
    (void)snprintf(result, SETUP_ANSWER_MAX, is_seen ? "seen" : "not seen");
    return *session->is_interrupted == 0;
}
