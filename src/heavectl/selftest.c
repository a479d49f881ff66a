/* SPDX-License-Identifier: MIT
 * selftest.c - the daily check of a platform; see selftest.h.
 * Each thing that is held has a connection of its own: what a hold leaves unanswered belongs to nobody after it.
 */
#include "heavectl/selftest.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/samples.h"
#include "common/translate.h"
#include "heavectl/ctl.h"
#include "heavectl/hold.h"
#include "heavectl/scope.h"
#include "heavectl/heaved_link.h"
#include "heavectl/selftest_report.h"
#include "heavectl/selftest_seen.h"
#include "common/sentence.h"

#define PERSON_MS    120000 /* for a switch to be turned */
#define DRIVES_MS    15000  /* for torque, and for a reset to take effect */
#define REST_MS      1500   /* a set-point that stands for so long has come to its end */
#define LEAST_WAY_MM 5.0    /* between the ends: less is no way */
#define BRAKE_MM     15.0   /* above the lower end, where the brakes are tried: what slips has not far to fall */
#define DRIFT_MS     5000
#define CYLINDERS    6u

static double larger(double a, double b)
{
    return a > b ? a : b;
}

static double apart(double a, double b)
{
    return a > b ? a - b : b - a;
}

/* The way of a jog, from the samples of every cycle. */
typedef struct {
    samples_reader_t *reader;
    unsigned cylinders;
    double least_mm[CYLINDERS], most_mm[CYLINDERS], off_mm[CYLINDERS];
    double first_z_mm, last_z_mm, until_mm; /* until_mm: the way after which it is over; 0: its end */
    bool has_first;
    int64_t moved_ms;
} way_t;

/* A run. */
typedef struct {
    const char *path;
    heaved_link_t link;
    samples_reader_t reader;
    selftest_report_t report;
    double following_mm, drift_mm, jog_mm_s;
    unsigned cylinders;
} run_t;

/* What is kept is English, what is shown is not. */
static __attribute__((format(printf, 4, 5))) void note(run_t *self, const char *name, selftest_result_t result,
                                                       const char *format, ...)
{
    char text[SELFTEST_NOTE_MAX], shown[SELFTEST_NOTE_MAX];
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    (void)vsnprintf(text, sizeof text, format, arguments);
    (void)vsnprintf(shown, sizeof shown, translate(format), again);
    va_end(again);
    va_end(arguments);
    selftest_note(&self->report, name, result, text, shown);
}

/* The same of a text without numbers, or of what heaved has answered. */
static void note_text(run_t *self, const char *name, selftest_result_t result, const char *text)
{
    char shown[SELFTEST_NOTE_MAX];
    selftest_note(&self->report, name, result, text, sentence(text, shown, sizeof shown));
}

static int complain(int code, const char *why)
{
    char shown[SELFTEST_NOTE_MAX];
    return ctl_complain(code, "selftest: %s", sentence(why, shown, sizeof shown));
}

static void note_answer(run_t *self, const char *name, int key, const char *failure)
{
    note_text(self, name,
              key == 'y'   ? SELFTEST_PASSED
              : key == 'n' ? SELFTEST_FAILED
                           : SELFTEST_SKIPPED,
              key == 'n'   ? failure
              : key == 'y' ? ""
                           : N_("left out"));
}

static bool enter_service(run_t *self)
{
    char error[SELFTEST_NOTE_MAX];
    const int64_t until_ms = heaved_link_now_ms() + DRIVES_MS;
    const struct timespec pause = {.tv_nsec = HEAVED_LINK_LOOK_MS * 1000000L};
    cJSON *status = heaved_link_ask(&self->link, "tick");
    bool is_in = status != NULL && !selftest_is_out(status);
    cJSON_Delete(status);
    while (!is_in && !self->link.is_over) {
        is_in = heaved_link_has_done(&self->link, "service", error);
        if (!is_in && heaved_link_now_ms() >= until_ms) {
            (void)complain(EXIT_REFUSED, error);
            self->link.is_over = true;
        }
        if (!is_in) {
            (void)nanosleep(&pause, NULL);
        }
    }
    return is_in;
}

/* --- Switches --- */

/* One that ends SERVICE and comes back.
 * @param on what to do, off how to undo it; each with what heaved shows then
 * Returns whether it worked. */
static bool try_switch(run_t *self, const char *name, const char *on, heaved_link_seen_t is_on, const char *off,
                       heaved_link_seen_t is_off)
{
    char error[SELFTEST_NOTE_MAX];
    printf(_("%s (s leaves it out)\n"), on);
    int key = heaved_link_wait(&self->link, "status", is_on, PERSON_MS);
    if (key != 'y') {
        note_answer(self, name, key, N_("nothing changed within two minutes"));
        return false;
    }
    printf("%s\n", off);
    key = heaved_link_wait(&self->link, "status", is_off, PERSON_MS);
    if (key != 'y') {
        note_answer(self, name, key == 's' ? 'n' : key, N_("it did not go back"));
        return false;
    }
    if (is_on == selftest_is_estop) {
        (void)heaved_link_has_done(&self->link, "reset", error);
    }
    note_text(self, name, SELFTEST_PASSED, "");
    return true;
}

static bool is_always(const cJSON *status)
{
    (void)status;
    return true;
}

/* The enable key ends SERVICE; that it is on again is seen by entering it. */
static void try_switches(run_t *self, const cJSON *plan)
{
    const cJSON *switches = cJSON_GetObjectItemCaseSensitive(plan, "switches");
    if (heaved_link_is_set(switches, "estop") && !self->link.is_over && enter_service(self)) {
        const bool is_tried = try_switch(self, N_("e-stop"), _("Press the e-stop."), selftest_is_estop, _("Release the e-stop."),
                                         selftest_is_no_estop);
        if (heaved_link_is_set(plan, "healthy_pulse") && !self->link.is_over) {
            const char *question = _("Did the safety relay drop while the e-stop was pressed, and does it hold now?");
            note_answer(self, N_("healthy pulse"), is_tried ? heaved_link_question(&self->link, question) : 's',
                        N_("the relay of the healthy pulse did not follow"));
        }
    }
    if (heaved_link_is_set(switches, "enable") && !self->link.is_over && enter_service(self)) {
        (void)try_switch(self, N_("enable key"), _("Turn the enable key off."), selftest_is_out,
                         _("Turn the enable key on, and wait."), is_always);
    }
    if (heaved_link_is_set(switches, "power") && !self->link.is_over && enter_service(self)) {
        (void)try_switch(self, N_("power failing"), _("Let the supply's contact tell that the supply fails."),
                         selftest_is_failing, _("Let it be well again."), selftest_is_supplied);
    }
}

/* --- What is held --- */

static int hold(run_t *self, const char *request, const hold_watch_t *watch)
{
    const int fd = heaved_link_open(self->path);
    if (fd < 0) {
        self->link.is_over = true;
        return EXIT_UNAVAILABLE;
    }
    const int code = hold_run(fd, request, watch, self->link.is_interrupted);
    (void)close(fd);
    (void)tcflush(STDIN_FILENO, TCIFLUSH);
    return code;
}

static void try_relays(run_t *self, unsigned relays)
{
    char text[64], request[32], name[32];
    for (unsigned i = 1; i <= relays && !self->link.is_over; i++) {
        (void)snprintf(text, sizeof text, _("Relay %u: try it? n: nothing is connected to it."), i);
        (void)snprintf(name, sizeof name, N_("relay %u"), i);
        (void)snprintf(request, sizeof request, "relay %u", i);
        int key = heaved_link_question(&self->link, text);
        if (key == 'y') {
            key = hold(self, request, NULL) == EXIT_DONE ? heaved_link_question(&self->link, _("Did it switch, and back again?"))
                                                         : 'n';
            note_answer(self, name, key, N_("it did not switch"));
        } else if (key == 'n') {
            note_text(self, name, SELFTEST_UNUSED, N_("nothing is connected"));
        } else {
            note_answer(self, name, key, "");
        }
    }
}

/* --- Ends and brakes --- */

static double value(const run_t *self, const samples_record_t *record, const char *format, unsigned cylinder)
{
    char name[32];
    (void)snprintf(name, sizeof name, "%s%u_mm", format, cylinder + 1);
    const samples_column_t *column = samples_column_named(self->reader.header, name, strlen(name));
    return column != NULL ? samples_value(column, record) : 0.0;
}

static void add_sample(const run_t *self, way_t *way, const samples_record_t *record)
{
    const samples_column_t *z = samples_column_named(self->reader.header, "sent_z_mm", strlen("sent_z_mm"));
    const double z_mm = z != NULL ? samples_value(z, record) : 0.0;
    for (unsigned i = 0; i < self->cylinders; i++) {
        const double actual_mm = value(self, record, "actual_c", i);
        way->off_mm[i] = larger(way->off_mm[i], apart(value(self, record, "sent_c", i), actual_mm));
        way->least_mm[i] = way->has_first && way->least_mm[i] < actual_mm ? way->least_mm[i] : actual_mm;
        way->most_mm[i] = way->has_first ? larger(way->most_mm[i], actual_mm) : actual_mm;
    }
    if (!way->has_first || apart(z_mm, way->last_z_mm) > 1e-4) {
        way->moved_ms = heaved_link_now_ms();
        way->last_z_mm = z_mm;
    }
    way->first_z_mm = way->has_first ? way->first_z_mm : z_mm;
    way->has_first = true;
}

/* A run and one of its ways, for a hold that looks on. */
typedef struct {
    run_t *run;
    way_t way;
} watched_t;

static bool is_at_end(void *context, bool is_pressed)
{
    watched_t *self = context;
    samples_record_t record;
    while (samples_reader_next(&self->run->reader, &record)) {
        add_sample(self->run, &self->way, &record);
    }
    if (!is_pressed) {
        self->way.moved_ms = heaved_link_now_ms();
        return false;
    }
    const double gone_mm = apart(self->way.last_z_mm, self->way.first_z_mm);
    return self->way.until_mm > 0 ? gone_mm >= self->way.until_mm : heaved_link_now_ms() - self->way.moved_ms > REST_MS;
}

static void judge_way(run_t *self, const char *name, const way_t *way)
{
    unsigned worst = 0, shortest = 0;
    for (unsigned i = 1; i < self->cylinders; i++) {
        worst = way->off_mm[i] > way->off_mm[worst] ? i : worst;
        shortest = way->most_mm[i] - way->least_mm[i] < way->most_mm[shortest] - way->least_mm[shortest] ? i : shortest;
    }
    const double least_mm = way->most_mm[shortest] - way->least_mm[shortest];
    if (way->off_mm[worst] > self->following_mm) {
        note(self, name, SELFTEST_FAILED, "cylinder %u was %.2f mm off its set-point, allowed are %.2f", worst + 1,
             way->off_mm[worst], self->following_mm);
    } else if (way->until_mm <= 0 && least_mm < LEAST_WAY_MM) {
        note(self, name, SELFTEST_FAILED, "cylinder %u moved %.2f mm only", shortest + 1, least_mm);
    } else {
        note(self, name, SELFTEST_PASSED,
             "every cylinder moved %.1f mm or more and was %.2f mm off its set-point at most (allowed: %.2f)", least_mm,
             way->off_mm[worst], self->following_mm);
    }
}

/* Jogs the platform up or down.
 * Returns false: it did not get there. */
static bool try_way(run_t *self, const char *name, double speed_mm_s, double until_mm)
{
    char request[48];
    watched_t watched = {.run = self, .way = {.until_mm = until_mm, .moved_ms = heaved_link_now_ms()}};
    samples_record_t record;
    while (samples_reader_next(&self->reader, &record)) { /* what was before says nothing */
    }
    (void)snprintf(request, sizeof request, "jog z %.3f", speed_mm_s);
    const hold_watch_t watch = {is_at_end, &watched};
    const int code = hold(self, request, &watch);
    (void)is_at_end(&watched, false);
    if (code != EXIT_DONE || !watched.way.has_first) {
        note_text(self, name, SELFTEST_FAILED, N_("it was not led there; see what heaved said"));
        return false;
    }
    if (!hold_has_arrived()) {
        note_text(self, name, SELFTEST_SKIPPED, N_("ended before it was there"));
        return false;
    }
    judge_way(self, name, &watched.way);
    return true;
}

/* Torque off: brakes or friction hold what stands. */
static void try_brakes(run_t *self)
{
    char error[SELFTEST_NOTE_MAX];
    watched_t watched = {.run = self, .way = {.moved_ms = heaved_link_now_ms()}};
    const struct timespec pause = {.tv_nsec = HEAVED_LINK_LOOK_MS * 1000000L};
    while (!is_at_end(&watched, true) && *self->link.is_interrupted == 0) { /* it comes to rest first */
        (void)nanosleep(&pause, NULL);
    }
    if (!heaved_link_has_done(&self->link, "torque all off", error)) {
        note_text(self, N_("brakes"), SELFTEST_FAILED, error);
        return;
    }
    (void)nanosleep(&pause, NULL);
    (void)is_at_end(&watched, false);
    watched.way = (way_t){0}; /* what was before, with torque, says nothing */
    printf(_("Torque is off: the platform has to stay where it is for %d s.\n"), DRIFT_MS / 1000);
    const int64_t until_ms = heaved_link_now_ms() + DRIFT_MS;
    while (heaved_link_now_ms() < until_ms && *self->link.is_interrupted == 0) {
        (void)nanosleep(&pause, NULL);
        (void)is_at_end(&watched, false);
    }
    unsigned worst = 0;
    for (unsigned i = 1; i < self->cylinders; i++) {
        worst = watched.way.most_mm[i] - watched.way.least_mm[i] > watched.way.most_mm[worst] - watched.way.least_mm[worst]
                    ? i
                    : worst;
    }
    const double most_mm = watched.way.most_mm[worst] - watched.way.least_mm[worst];
    note(self, N_("brakes"), watched.way.has_first && most_mm <= self->drift_mm ? SELFTEST_PASSED : SELFTEST_FAILED,
         _("cylinder %u moved %.2f mm without torque (allowed: %.2f)"), worst + 1, most_mm, self->drift_mm);
}

static void try_motion(run_t *self)
{
    char error[SELFTEST_NOTE_MAX];
    if (!enter_service(self)) {
        return;
    }
    printf(_("Now the platform moves, while you hold the space bar. Nobody may be on it or near it.\n"));
    const int key = heaved_link_question(&self->link, _("Go on?"));
    if (key != 'y') {
        note_answer(self, N_("ends"), 's', "");
        return;
    }
    if (!heaved_link_has_done(&self->link, "torque all on", error)) {
        note_text(self, N_("torque"), SELFTEST_FAILED, error);
        return;
    }
    if (heaved_link_wait(&self->link, "counts", selftest_has_torque, DRIVES_MS) != 'y') {
        note_text(self, N_("torque"), SELFTEST_FAILED, N_("not every drive has torque; heavectl counts shows which"));
        return;
    }
    note_text(self, N_("torque"), SELFTEST_PASSED, "");
    if (heaved_link_wait(&self->link, "counts", selftest_is_homed, 2 * HEAVED_LINK_LOOK_MS) == 'n' &&
        hold(self, "home all", NULL) != EXIT_DONE) {
        note_text(self, N_("home"), SELFTEST_FAILED, N_("not every drive has found its zero"));
        return;
    }
    printf(_("Up, to the end. "));
    bool is_there = !self->link.is_over && try_way(self, N_("upper end"), self->jog_mm_s, 0);
    if (is_there) {
        printf(_("Down, to the end. "));
    }
    is_there = is_there && try_way(self, N_("lower end"), -self->jog_mm_s, 0);
    if (is_there) {
        printf(_("A little up, where the brakes are tried. "));
    }
    if (is_there && try_way(self, N_("off the lower end"), self->jog_mm_s, BRAKE_MM)) {
        try_brakes(self);
    }
}

/* --- All of it --- */

static int finish(run_t *self, const char *file, const char *configuration, const char *version, const char *build)
{
    char error[SELFTEST_NOTE_MAX];
    const bool is_passed = selftest_has_passed(&self->report) && !self->link.is_over;
    const bool is_accepted = heaved_link_has_done(&self->link, is_passed ? "selftest passed" : "selftest failed", error);
    if (!is_accepted) {
        (void)complain(EXIT_REFUSED, error);
    }
    (void)heaved_link_has_done(&self->link, "service-off", error);
    const int wrong = file != NULL ? selftest_write(&self->report, file, configuration, version, build) : 0;
    if (wrong != 0) {
        (void)ctl_complain(EXIT_IO, "%s: %s", file, error_text(wrong));
    }
    printf("%s\n", is_passed ? _("self-test: passed") : _("self-test: failed"));
    return !is_accepted ? EXIT_UNAVAILABLE : wrong != 0 ? EXIT_IO : is_passed ? EXIT_DONE : EXIT_REFUSED;
}

static bool begin(run_t *self, cJSON **plan, cJSON **status)
{
    self->link.fd = heaved_link_open(self->path);
    if (self->link.fd < 0) {
        (void)ctl_complain(EXIT_UNAVAILABLE, "heaved is not running at %s: %s", self->path, error_text(errno));
        return false;
    }
    *plan = heaved_link_ask(&self->link, "selftest");
    *status = heaved_link_ask(&self->link, "status");
    if (!heaved_link_is_set(*plan, "ok") || !heaved_link_is_set(*status, "ok")) {
        (void)complain(EXIT_REFUSED, *plan != NULL ? heaved_link_text(*plan, "error") : N_("heaved does not answer"));
        return false;
    }
    self->following_mm = heaved_link_number(*plan, "following_mm");
    self->drift_mm = heaved_link_number(*plan, "drift_mm");
    self->jog_mm_s = heaved_link_number(*plan, "jog_mm_s");
    self->cylinders = (unsigned)cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(*status, "cylinders"));
    self->cylinders = self->cylinders < CYLINDERS ? self->cylinders : CYLINDERS;
    if (send(self->link.fd, "samples\n", 8, MSG_NOSIGNAL) != 8) {
        return false;
    }
    const int samples = scope_receive(self->link.fd, self->link.line, sizeof self->link.line);
    const char *wrong = samples < 0 ? N_("there are no samples; [samples] seconds has to be above 0")
                                    : samples_reader_open(&self->reader, samples);
    if (samples >= 0) {
        (void)close(samples);
    }
    if (wrong != NULL) {
        (void)complain(EXIT_REFUSED, wrong);
    }
    return wrong == NULL;
}

int selftest_run(const char *path, const char *file, const volatile sig_atomic_t *is_interrupted)
{
    static run_t run;
    cJSON *plan = NULL, *status = NULL;
    run = (run_t){.path = path, .link = {.is_interrupted = is_interrupted, .fd = -1}};
    if (isatty(STDIN_FILENO) == 0) {
        return ctl_complain(EXIT_BAD_USAGE, "selftest takes a terminal: a person presses, looks and holds");
    }
    int code = EXIT_UNAVAILABLE;
    if (begin(&run, &plan, &status)) {
        const cJSON *program = cJSON_GetObjectItemCaseSensitive(plan, "configuration");
        printf(_("Self-test of configuration %s, with nobody on board.\n"), cJSON_IsString(program) ? program->valuestring : "?");
        if (enter_service(&run)) {
            try_switches(&run, plan);
            if (!run.link.is_over && enter_service(&run)) {
                try_relays(&run, (unsigned)heaved_link_number(plan, "relays"));
            }
            if (!run.link.is_over) {
                try_motion(&run);
            }
            code = finish(&run, file, heaved_link_text(plan, "configuration"), heaved_link_text(status, "version"),
                          heaved_link_text(status, "build"));
        } else {
            code = EXIT_REFUSED;
        }
        samples_reader_close(&run.reader);
    }
    cJSON_Delete(plan);
    cJSON_Delete(status);
    if (run.link.fd >= 0) {
        (void)close(run.link.fd);
    }
    return code;
}
