/* SPDX-License-Identifier: MIT
 * linux_modbus.c - the worker of a Modbus line and the hand-over to it; see linux_modbus.h.
 */
#include "linux_modbus.h"

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#define STACK_BYTES (128u * 1024u) /* locked into memory, so no more than needed */

/* --- The worker --- */

/* The next slot in turn that waits, so that none starves; false where none does. */
static bool pop_next(linux_modbus_t *self)
{
    for (unsigned i = 1; i <= HAL_MODBUS_SLOTS; i++) {
        const unsigned slot = (self->last + i) % HAL_MODBUS_SLOTS;
        if (newest_pop(&self->slot[slot].asked)) {
            self->last = slot;
            return true;
        }
    }
    return false;
}

static void serve(linux_modbus_t *self)
{
    linux_modbus_slot_t *slot = &self->slot[self->last];
    const modbus_request_t *request = &slot->request[newest_front(&slot->asked)];
    modbus_result_t *result = &slot->result[newest_back(&slot->answered)];
    linux_modbus_link_run(&self->link, request, result);
    result->tag = request->tag;
    (void)newest_put(&slot->answered);
    __atomic_store_n(&self->served, self->served + 1, __ATOMIC_RELEASE);
}

/* Until someone asks something, the link says something, or it is time to make it again. */
static void wait_for_work(linux_modbus_t *self)
{
    struct pollfd watched[] = {{.fd = self->wake, .events = POLLIN}, {.fd = linux_modbus_link_fd(&self->link), .events = POLLIN}};
    const uint64_t now_us = linux_modbus_now_us();
    const uint64_t pause_us = self->link.retry_us > now_us ? self->link.retry_us - now_us : 0;
    const struct timespec pause = {.tv_sec = (time_t)(pause_us / 1000000u), .tv_nsec = (long)(pause_us % 1000000u) * 1000L};
    if (ppoll(watched, 2, self->link.is_linked ? NULL : &pause, NULL) > 0 && watched[1].revents != 0) {
        linux_modbus_link_look(&self->link);
    }
}

static void *worker(void *argument)
{
    linux_modbus_t *self = argument;
    for (;;) {
        uint64_t woken;
        (void)!read(self->wake, &woken, sizeof woken); /* before looking, so that nothing asked after is slept through */
        const bool is_ending = __atomic_load_n(&self->is_ending, __ATOMIC_ACQUIRE) != 0;
        linux_modbus_link_mend(&self->link);
        if (pop_next(self)) {
            serve(self);
        } else if (is_ending) {
            return NULL;
        } else {
            wait_for_work(self);
        }
    }
}

/* --- The motion thread's side --- */

static void wake_worker(linux_modbus_t *self)
{
    const uint64_t one = 1;
    (void)!write(self->wake, &one, sizeof one); /* cannot block; full means that it is awake */
}

static hv_status_t submit_op(void *ctx, unsigned index, const modbus_request_t *request)
{
    linux_modbus_t *self = ctx;
    if (index >= HAL_MODBUS_SLOTS || !modbus_is_valid(request) || (self->is_serial && request->unit == 255)) {
        return HV_ERR_ARG;
    }
    linux_modbus_slot_t *slot = &self->slot[index];
    slot->request[newest_back(&slot->asked)] = *request;
    self->asked++;
    self->replaced += newest_put(&slot->asked);
    wake_worker(self);
    return HV_OK;
}

static hv_status_t poll_op(void *ctx, unsigned index, modbus_result_t *result)
{
    linux_modbus_t *self = ctx;
    if (index >= HAL_MODBUS_SLOTS) {
        return HV_ERR_ARG;
    }
    linux_modbus_slot_t *slot = &self->slot[index];
    if (!newest_pop(&slot->answered)) {
        return HV_ERR_AGAIN;
    }
    *result = slot->result[newest_front(&slot->answered)];
    return HV_OK;
}

hal_modbus_t linux_modbus_hal(linux_modbus_t *self)
{
    static const hal_modbus_ops_t k_ops = {submit_op, poll_op};
    return (hal_modbus_t){&k_ops, self};
}

void linux_modbus_status(const linux_modbus_t *self, linux_modbus_status_t *out)
{
    const linux_modbus_counts_t *count = &self->link.count;
    *out = (linux_modbus_status_t){.trouble = __atomic_load_n(&self->link.trouble, __ATOMIC_ACQUIRE),
                                   .count = {.transactions = __atomic_load_n(&count->transactions, __ATOMIC_RELAXED),
                                             .timeouts = __atomic_load_n(&count->timeouts, __ATOMIC_RELAXED),
                                             .damaged = __atomic_load_n(&count->damaged, __ATOMIC_RELAXED),
                                             .exceptions = __atomic_load_n(&count->exceptions, __ATOMIC_RELAXED),
                                             .links = __atomic_load_n(&count->links, __ATOMIC_RELAXED),
                                             .strays = __atomic_load_n(&count->strays, __ATOMIC_RELAXED),
                                             .probes = __atomic_load_n(&count->probes, __ATOMIC_RELAXED)},
                                   .replaced = self->replaced,
                                   .waiting = self->asked - self->replaced - __atomic_load_n(&self->served, __ATOMIC_ACQUIRE)};
}

const char *linux_modbus_text(linux_modbus_t *self)
{
    const linux_modbus_trouble_t trouble = __atomic_load_n(&self->link.trouble, __ATOMIC_ACQUIRE);
    const int error = __atomic_load_n(&self->link.error, __ATOMIC_RELAXED);
    if (!self->is_open) {
        return self->text; /* why it could not be opened */
    }
    if (trouble == LINUX_MODBUS_FINE) {
        return "";
    }
    const bool has_reason = trouble == LINUX_MODBUS_SYSTEM_ERROR || trouble == LINUX_MODBUS_NOT_ALLOWED;
    (void)snprintf(self->text, sizeof self->text, "modbus: %s: %s%s%s", self->name, linux_modbus_trouble_text(trouble),
                   has_reason ? ": " : "", has_reason ? strerror(error) : "");
    return self->text;
}

/* --- Opening and closing --- */

static hv_status_t reject(linux_modbus_t *self, hv_status_t status, const char *what)
{
    (void)snprintf(self->text, sizeof self->text, "modbus: %s: %s", self->name, what);
    linux_modbus_link_close(&self->link);
    return status;
}

/* An ordinary thread whatever the caller's priority is, deaf to signals, which are the program's. */
static int start_worker(linux_modbus_t *self)
{
    static const struct sched_param k_ordinary = {.sched_priority = 0};
    pthread_attr_t attributes;
    sigset_t all, before;
    (void)pthread_attr_init(&attributes);
    (void)pthread_attr_setstacksize(&attributes, STACK_BYTES);
    (void)pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    (void)pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    (void)pthread_attr_setschedparam(&attributes, &k_ordinary);
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int error = pthread_create(&self->thread, &attributes, worker, self);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    (void)pthread_attr_destroy(&attributes);
    return error;
}

hv_status_t linux_modbus_open(linux_modbus_t *self, const linux_modbus_config_t *config)
{
    const char *what;
    memset(self, 0, sizeof *self);
    if (config->host != NULL) {
        (void)snprintf(self->name, sizeof self->name, "%.100s:%u", config->host, (unsigned)config->port);
    } else {
        (void)snprintf(self->name, sizeof self->name, "%.127s", config->device != NULL ? config->device : "");
    }
    for (unsigned i = 0; i < HAL_MODBUS_SLOTS; i++) {
        self->slot[i].asked = newest_start();
        self->slot[i].answered = newest_start();
    }
    self->last = HAL_MODBUS_SLOTS - 1;
    self->is_serial = config->host == NULL;
    const hv_status_t status = linux_modbus_link_open(&self->link, config, &what);
    if (status != HV_OK) {
        return reject(self, status, what);
    }
    self->wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (self->wake < 0) {
        return reject(self, HV_ERR_IO, strerror(errno));
    }
    const int error = start_worker(self);
    if (error != 0) {
        (void)close(self->wake);
        return reject(self, HV_ERR_IO, strerror(error));
    }
    self->is_open = true;
    return HV_OK;
}

void linux_modbus_close(linux_modbus_t *self)
{
    if (!self->is_open) {
        return;
    }
    __atomic_store_n(&self->is_ending, 1, __ATOMIC_RELEASE);
    wake_worker(self);
    (void)pthread_join(self->thread, NULL);
    linux_modbus_link_close(&self->link);
    (void)close(self->wake);
    self->is_open = false;
    self->text[0] = '\0';
}
