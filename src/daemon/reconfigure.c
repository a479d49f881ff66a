/* SPDX-License-Identifier: MIT
 * reconfigure.c - see reconfigure.h.
 */
#include "daemon/reconfigure.h"

#include <stdio.h>
#include <string.h>

#include "common/translate.h"
#include "config/hash.h"
#include "service/control_configuration.h"

/* Hands the configuration to the motion thread, and tells everybody. */
static bool come_into_force(reconfigure_t *self, const char *path)
{
    if (!motion_loop_reload(self->loop, self->config)) {
        writers_say(self->writers, "too many reloads at once: send SIGHUP again");
        return false;
    }
    writers_say(self->writers, "%s has been read again: configuration %s", path, self->config->hash);
    writers_tell_hash(self->writers, self->config->hash);
    if (!config_is_unapproved(self->config)) {
        __atomic_store_n(&self->loop->handover.is_unapproved, 0, __ATOMIC_RELEASE);
    }
    return true;
}

bool reconfigure_reload(reconfigure_t *self)
{
    const char *text = NULL;
    size_t length = 0;
    if (config_store_is_busy(self->store)) {
        writers_say(self->writers, "a configuration is just being written: send SIGHUP again");
        return false;
    }
    const char *const path = config_store_read(self->store, &text, &length);
    /* a pipe, or what cannot be read, goes the way of the start: that says what is wrong */
    const int mistakes = path != NULL ? config_reload_text(path, text, length, self->config, self->errors)
                                      : config_reload(self->store->file, self->config, self->errors);
    if (mistakes != 0) {
        writers_say(self->writers, "%s is not right: nothing has changed", path != NULL ? path : self->store->file);
        return false;
    }
    if (path != NULL) {
        config_store_adopt(self->store, path);
    }
    return come_into_force(self, path != NULL ? path : self->store->file);
}

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

static const char *take_over(reconfigure_t *self, const char *text, size_t length)
{
    if (config_reload_text(self->store->kept, text, length, self->config, self->errors) != 0 ||
        !come_into_force(self, self->store->kept)) {
        return N_("it is kept, but did not come into force: send SIGHUP");
    }
    config_store_adopt(self->store, self->store->kept);
    return NULL;
}

bool reconfigure_serve(reconfigure_t *self, control_t *control)
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
    if (error != 0) {
        (void)snprintf(said, sizeof said, N_("%.100s: %s; it is not in force"), self->store->kept, strerror(error));
        why = said;
    } else if (!control_configuration_fits(control_state(control), is_restart)) { /* the disk may have taken its time */
        why = N_("the state has changed meanwhile: it is kept, and comes into force with SIGHUP, or when heaved starts anew");
    } else {
        why = is_restart ? restart(self, control) : take_over(self, text, length);
    }
    control_configuration_end(control, why, is_restart);
    return why == NULL && !is_restart;
}

bool reconfigure_starts_anew(const reconfigure_t *self, const control_t *control)
{
    return self->is_restart_wanted && !self->is_end_wanted && !control->is_end_wanted;
}

bool reconfigure_stay_off(reconfigure_t *self)
{
    return push(self, EVENT_HOLD);
}
