/* SPDX-License-Identifier: MIT
 * reconfigure.c - see reconfigure.h.
 */
#include "daemon/reconfigure.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "common/translate.h"
#include "config/hash.h"
#include "service/control_configuration.h"
#include "platform/load.h"

#define LINE_MOST  (HAL_LOG_TEXT_MAX - 16u) /* without the prefix of writers_say() */
#define LINE_LEAST (LINE_MOST / 2u)
#define SLOW_US    2000000u

/* Hands the configuration to the motion thread, and tells everybody. */
static bool come_into_force(reconfigure_t *self, const char *path)
{
    if (!motion_loop_reload(self->loop, self->config)) {
        writers_say(self->writers, "too many reloads at once: send SIGHUP again");
        return false;
    }
    writers_say(self->writers, "%s has been read again: configuration %s", path, self->config->hash);
    writers_put_hash(self->writers, self->config->hash);
    if (!config_is_unapproved(self->config)) {
        (void)handover_withhold(&self->loop->handover, PERMIT_APPROVAL, false);
    }
    return true;
}

/* --- What a configuration has to say --- */

/* A line of the report as lines of the log, which have a longest length. */
static void say_line(const reconfigure_t *self, const char *line)
{
    while (strlen(line) > LINE_MOST) {
        size_t length = LINE_MOST;
        while (length > LINE_LEAST && line[length] != ' ') {
            length--;
        }
        writers_say(self->writers, "%.*s", (int)length, line);
        line += length;
    }
    writers_say(self->writers, "%s", line);
}

/* Takes a configuration over, if all of it is right. Its words go the way of all words: nobody who does not read them keeps this
 * thread from its clients. */
static bool load_text(reconfigure_t *self, const char *name, const char *text, ssize_t length)
{
    memset(self->words, 0, sizeof self->words);
    rewind(self->stream);
    const int mistakes = config_reload(name, text, length, self->config, self->stream);
    (void)fflush(self->stream);
    const bool is_full = strlen(self->words) >= sizeof self->words - 2u;
    char *rest = NULL;
    for (char *line = strtok_r(self->words, "\n", &rest); line != NULL; line = strtok_r(NULL, "\n", &rest)) {
        say_line(self, line);
    }
    if (is_full) {
        writers_say(self->writers, "%s: this is not all there is to say; `heaved --config FILE --check` says the rest", name);
    }
    return mistakes == 0;
}

bool reconfigure_open(reconfigure_t *self)
{
    self->stream = fmemopen(self->words, sizeof self->words - 1u, "w");
    if (self->stream != NULL) {
        (void)setvbuf(self->stream, NULL, _IONBF, 0);
    }
    return self->stream != NULL;
}

void reconfigure_close(reconfigure_t *self)
{
    if (self->stream != NULL) {
        (void)fclose(self->stream);
        self->stream = NULL;
    }
}

/* --- The file again --- */

void reconfigure_reload(reconfigure_t *self)
{
    self->is_reload_wanted = true;
}

static bool load_file(reconfigure_t *self, const char *path, const char *text, ssize_t length)
{
    const char *const name = path != NULL ? path : self->store->file;
    if (!load_text(self, name, text, length)) {
        writers_say(self->writers, "%s is not right: nothing has changed", name);
        return false;
    }
    if (path != NULL) {
        config_store_adopt(self->store, path);
    }
    return come_into_force(self, name);
}

static bool serve_reload(reconfigure_t *self, uint64_t now_us)
{
    const char *path = NULL;
    const char *text = NULL;
    ssize_t length = 0;
    if (self->is_reading && config_store_has_read(self->store, &path, &text, &length)) {
        self->is_reading = false;
        return load_file(self, path, text, length);
    }
    if (self->is_reading && now_us >= self->slow_us) {
        self->slow_us = UINT64_MAX;
        writers_say(self->writers, "%s is not read yet: its disk does not answer; until it does, nothing has changed",
                    self->store->file);
    }
    if (self->is_reload_wanted && !config_store_is_busy(self->store)) {
        self->is_reload_wanted = false;
        self->is_reading = true;
        self->slow_us = now_us + SLOW_US;
        config_store_read(self->store);
    }
    return false;
}

/* --- One that is applied --- */

static bool push(reconfigure_t *self, event_t event)
{
    const motion_request_t request = {.event = (uint32_t)event};
    return ring_push(&self->loop->handover.requests, &request, sizeof request, NULL, 0);
}

/* The drives go off, heaved starts anew. */
static const char *restart(reconfigure_t *self, const control_t *control)
{
    if (self->is_end_wanted || control->is_end_wanted || !push(self, EVENT_SHUTDOWN)) {
        return N_("heaved ends: it is kept, and comes into force at the next start");
    }
    config_store_adopt(self->store, self->store->kept);
    self->is_restart_wanted = true;
    writers_say(self->writers, "configuration %s has been applied: heaved starts anew", control->changes.hash);
    return NULL;
}

static const char *apply(reconfigure_t *self, const char *text, size_t length)
{
    if (!load_text(self, self->store->kept, text, (ssize_t)length) || !come_into_force(self, self->store->kept)) {
        return N_("it is kept, but did not come into force: send SIGHUP");
    }
    config_store_adopt(self->store, self->store->kept);
    return NULL;
}

static bool serve_applied(reconfigure_t *self, control_t *control)
{
    const char *text = NULL;
    const char *why = NULL;
    char said[160];
    size_t length = 0;
    int error = 0;
    if (!config_store_done(self->store, &error, &text, &length)) {
        return false;
    }
    const bool is_restart = control->changes.restart > 0;
    if (error == ESTALE) {
        why = N_("the file that heaved was started with has changed meanwhile: `systemctl reload` (SIGHUP) reads it first");
    } else if (error != 0) {
        (void)snprintf(said, sizeof said, N_("%.100s: %s; it is not in force"), self->store->kept, strerror(error));
        why = said;
    } else if (!control_configuration_fits(control_state(control), is_restart)) { /* the disk may have taken its time */
        why = N_("the state has changed meanwhile: it is kept, and comes into force with SIGHUP, or when heaved starts anew");
    } else {
        why = is_restart ? restart(self, control) : apply(self, text, length);
    }
    control_configuration_end(control, why, is_restart);
    return why == NULL && !is_restart;
}

bool reconfigure_serve(reconfigure_t *self, control_t *control, uint64_t now_us)
{
    const bool is_applied = serve_applied(self, control);
    return serve_reload(self, now_us) || is_applied;
}

bool reconfigure_starts_anew(const reconfigure_t *self, const control_t *control)
{
    return self->is_restart_wanted && !self->is_end_wanted && !control->is_end_wanted;
}

bool reconfigure_stay_off(reconfigure_t *self)
{
    return push(self, EVENT_HOLD);
}
