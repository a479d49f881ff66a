/* SPDX-License-Identifier: MIT
 * hold.c - requests that go on while a key is held; see hold.h.
 * One request is on its way at a time, so that each answer belongs to it; the newest tick of the answers is what goes back.
 */
#include "heavectl/hold.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/translate.h"
#include "heavectl/ctl.h"
#include "common/sentence.h"

#define LINE_BYTES    4096u
#define REQUEST_BYTES 192u
#define CTRL_C        3
#define CTRL_D        4

/** What an answer is to. */
typedef enum { ASKED_NOTHING, ASKED_TICK, ASKED_PRESS, ASKED_BEAT, ASKED_RELEASE } asked_t;

/** A run. */
typedef struct {
    int fd;
    const char *request;
    hold_key_t key;
    asked_t asked;
    int64_t asked_ms;
    uint64_t tick;
    uint64_t series;  /**< of the newest press */
    uint32_t counter; /**< of beats in it */
    bool has_tick;
    bool is_pressed;    /**< heaved holds it */
    bool is_let_go_due; /**< the key has to be let go before it can begin again */
    bool is_shown;      /**< and the screen says so */
    bool is_over;       /**< the run is */
    bool has_arrived;   /**< because of watch, or by itself */
    const hold_watch_t *watch;
    int code; /**< then */
    char line[LINE_BYTES];
    size_t length;
} hold_t;

void hold_key_repeat(hold_key_t *self, int64_t now_ms)
{
    if (!hold_key_is_held(self, now_ms) && (self->reads == 0 || now_ms - self->last_ms > HOLD_KEY_GAP_MS)) {
        *self = (hold_key_t){.since_ms = now_ms};
    }
    self->last_ms = now_ms;
    self->reads++;
}

bool hold_key_is_held(hold_key_t *self, int64_t now_ms)
{
    if (self->reads > 0 && now_ms - self->last_ms > HOLD_KEY_GAP_MS) {
        self->reads = 0;
    }
    return self->reads >= HOLD_KEY_READS && self->last_ms - self->since_ms >= HOLD_KEY_RUN_MS;
}

bool hold_key_is_let_go(const hold_key_t *self, int64_t now_ms)
{
    return now_ms - self->last_ms > HOLD_KEY_GAP_MS;
}

void hold_key_miss(hold_key_t *self, int64_t now_ms)
{
    *self = (hold_key_t){.last_ms = now_ms};
}

static int64_t now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static void end(hold_t *self, int code, const char *text)
{
    if (text != NULL) {
        char shown[SENTENCE_MAX];
        fprintf(stderr, "\r\x1b[Kheavectl: %s\r\n", sentence(text, shown, sizeof shown));
    }
    self->is_over = true;
    self->code = code;
}

static void show(const char *text)
{
    printf("\r\x1b[K%s", text);
    (void)fflush(stdout);
}

/* --- To heaved --- */

static void ask(hold_t *self, asked_t asked, const char *line)
{
    const size_t length = strlen(line);
    if (send(self->fd, line, length, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)length) {
        end(self, EXIT_UNAVAILABLE, N_("heaved cannot be asked"));
    }
    self->asked = asked;
    self->asked_ms = now_ms();
}

static void press(hold_t *self)
{
    char line[REQUEST_BYTES];
    self->counter = 0;
    (void)snprintf(line, sizeof line, "%s %llu\n", self->request, (unsigned long long)self->tick);
    ask(self, ASKED_PRESS, line);
}

static void beat(hold_t *self)
{
    char line[REQUEST_BYTES];
    self->counter++;
    (void)snprintf(line, sizeof line, "beat %llu %u %llu\n", (unsigned long long)self->series, (unsigned)self->counter,
                   (unsigned long long)self->tick);
    ask(self, ASKED_BEAT, line);
}

static void release(hold_t *self)
{
    char line[REQUEST_BYTES];
    self->is_pressed = false;
    (void)snprintf(line, sizeof line, "release %llu\n", (unsigned long long)self->series);
    ask(self, ASKED_RELEASE, line);
}

/* What there is to say now, if the last has been answered. */
static void speak(hold_t *self)
{
    const bool is_held = hold_key_is_held(&self->key, now_ms());
    self->is_let_go_due = self->is_let_go_due && !hold_key_is_let_go(&self->key, now_ms());
    self->is_shown = self->is_shown && self->is_let_go_due;
    if (self->asked != ASKED_NOTHING) {
        return;
    }
    if (self->is_pressed && !is_held) {
        show(_("let go; hold a key to go on, q to end"));
        release(self);
    } else if (now_ms() - self->asked_ms < HOLD_BEAT_MS) {
        return;
    } else if (self->is_pressed) {
        beat(self);
    } else if (is_held && !self->is_let_go_due && self->has_tick) {
        press(self);
    } else {
        ask(self, ASKED_TICK, "tick\n");
    }
}

/* --- From heaved --- */

static uint64_t number_of(const cJSON *answer, const char *name)
{
    const cJSON *number = cJSON_GetObjectItemCaseSensitive(answer, name);
    return cJSON_IsNumber(number) && number->valuedouble > 0 ? (uint64_t)number->valuedouble : 0;
}

static const char *text_of(const cJSON *answer, const char *name)
{
    const cJSON *text = cJSON_GetObjectItemCaseSensitive(answer, name);
    return cJSON_IsString(text) ? text->valuestring : "";
}

static void receive_press(hold_t *self, const cJSON *answer, bool is_done)
{
    const char *why = text_of(answer, "why");
    self->is_pressed = is_done;
    self->series = number_of(answer, "series");
    if (is_done) {
        show(_("goes on while the key is held"));
    } else if (strcmp(why, "busy") != 0 && strcmp(why, "stale") != 0) { /* these pass: it is tried again, with a newer tick */
        end(self, EXIT_REFUSED, text_of(answer, "error"));
    }
}

/* What ends by itself has arrived; what ended otherwise takes a new press. */
static void receive_beat(hold_t *self, const cJSON *answer, bool is_done)
{
    const bool is_finished = strcmp(text_of(answer, "doing"), "nothing") == 0;
    const bool has_come = is_finished && number_of(answer, "finished") == self->series && self->series != 0;
    if (strcmp(text_of(answer, "state"), "SERVICE") != 0) {
        end(self, EXIT_REFUSED, N_("the platform is not in SERVICE any more; heavectl status says why"));
    } else if (has_come) {
        self->is_pressed = false;
        self->has_arrived = true;
        show(strncmp(self->request, "home ", 5) == 0 ? _("home has ended; heavectl counts shows what is homed")
                                                     : _("there: let go of the key"));
        end(self, EXIT_DONE, NULL);
    } else if (!is_done && is_finished) {
        self->is_pressed = false;
        self->is_let_go_due = true;
        self->is_shown = true;
        show(_("stopped: let go of the key and hold it again"));
    }
}

static void receive_answer(hold_t *self, const cJSON *answer)
{
    const asked_t asked = self->asked;
    const bool is_done = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(answer, "ok"));
    const uint64_t tick = number_of(answer, "tick");
    self->asked = ASKED_NOTHING;
    self->has_tick = self->has_tick || tick != 0;
    self->tick = tick > self->tick ? tick : self->tick;
    if (asked == ASKED_PRESS) {
        receive_press(self, answer, is_done);
    } else if (asked == ASKED_BEAT) {
        receive_beat(self, answer, is_done);
    } else if (!is_done) {
        end(self, EXIT_REFUSED, text_of(answer, "error"));
    }
}

static void receive_lines(hold_t *self)
{
    char *newline = memchr(self->line, '\n', self->length);
    while (newline != NULL && !self->is_over) {
        *newline = '\0';
        cJSON *answer = cJSON_Parse(self->line);
        receive_answer(self, answer);
        cJSON_Delete(answer);
        self->length -= (size_t)(newline + 1 - self->line);
        memmove(self->line, newline + 1, self->length);
        newline = memchr(self->line, '\n', self->length);
    }
}

static void hear(hold_t *self)
{
    const ssize_t received = recv(self->fd, &self->line[self->length], sizeof self->line - self->length, MSG_DONTWAIT);
    if (received > 0) {
        self->length += (size_t)received;
        receive_lines(self);
    } else if (received == 0 || (errno != EAGAIN && errno != EINTR)) {
        end(self, EXIT_UNAVAILABLE, N_("heaved has ended"));
    }
}

/* --- The terminal --- */

/* A key that is down already was meant for something else. Enter never counts: it ended the answer before, and the pause before
 * a key's first repeat looks as if it had been let go. */
static void accept_key(hold_t *self, bool is_enter)
{
    if (!is_enter) {
        hold_key_repeat(&self->key, now_ms());
    } else if (!self->is_pressed) {
        hold_key_miss(&self->key, now_ms());
        self->is_let_go_due = true;
    }
    if (self->is_let_go_due && !self->is_shown) {
        self->is_shown = true;
        show(_("let go of the key first, then hold the space bar; q ends"));
    }
}

static void read_keys(hold_t *self)
{
    char keys[64];
    bool is_enter = false;
    const ssize_t count = read(STDIN_FILENO, keys, sizeof keys);
    if (count <= 0) {
        end(self, EXIT_DONE, NULL);
        return;
    }
    for (ssize_t i = 0; i < count; i++) {
        if (keys[i] == 'q' || keys[i] == CTRL_C || keys[i] == CTRL_D) {
            end(self, EXIT_DONE, NULL);
            return;
        }
        is_enter = is_enter || keys[i] == '\r' || keys[i] == '\n';
    }
    accept_key(self, is_enter);
}

/* Stopped, or starved: whoever holds the key has to say so anew. */
static void watch_absence(hold_t *self, int64_t looked_ms)
{
    if (now_ms() - looked_ms > HOLD_ABSENCE_MS) {
        hold_key_miss(&self->key, now_ms());
        self->is_let_go_due = true;
    }
}

/* Silence of heaved, or the end of what is watched. */
static void watch_ends(hold_t *self)
{
    if (self->asked != ASKED_NOTHING && now_ms() - self->asked_ms > HOLD_SILENCE_MS) {
        end(self, EXIT_UNAVAILABLE, N_("heaved does not answer"));
    }
    if (!self->is_over && self->watch != NULL && self->watch->is_over(self->watch->context, self->is_pressed)) {
        show(self->is_pressed ? _("there: let go of the key") : _("let go"));
        self->has_arrived = true;
        end(self, EXIT_DONE, NULL);
    }
}

static void run(hold_t *self, const volatile sig_atomic_t *is_interrupted)
{
    int64_t looked_ms = now_ms();
    while (!self->is_over && *is_interrupted == 0) {
        struct pollfd wait[2] = {{.fd = STDIN_FILENO, .events = POLLIN}, {.fd = self->fd, .events = POLLIN}};
        if (poll(wait, 2, HOLD_BEAT_MS / 5) < 0 && errno != EINTR) {
            end(self, EXIT_UNAVAILABLE, error_text(errno));
            return;
        }
        watch_absence(self, looked_ms);
        looked_ms = now_ms();
        if (wait[1].revents != 0) {
            hear(self);
        }
        if (wait[0].revents != 0 && !self->is_over) {
            read_keys(self);
        }
        watch_ends(self);
        if (!self->is_over) {
            speak(self);
        }
    }
}

static bool s_has_arrived; /* of the last run */

bool hold_has_arrived(void)
{
    return s_has_arrived;
}

int hold_run(int fd, const char *request, const hold_watch_t *watch, const volatile sig_atomic_t *is_interrupted)
{
    static hold_t hold;
    struct termios before;
    hold = (hold_t){.fd = fd, .request = request, .watch = watch, .is_let_go_due = true};
    if (tcgetattr(STDIN_FILENO, &before) != 0) {
        return ctl_complain(EXIT_BAD_USAGE, "%s: goes on while a key is held, which takes a terminal", request);
    }
    struct termios raw = before;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO | ISIG | IEXTEN);
    raw.c_iflag &= ~(tcflag_t)(IXON | ICRNL);
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    (void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &raw);
    hold_key_miss(&hold.key, now_ms());
    show(_("hold a key, the space bar for one; q ends"));
    run(&hold, is_interrupted);
    if (hold.is_pressed) {
        release(&hold); /* nobody waits for the answer: without it heaved lets go by itself */
    }
    s_has_arrived = hold.has_arrived;
    printf("\r\n");
    (void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &before);
    return hold.code;
}
