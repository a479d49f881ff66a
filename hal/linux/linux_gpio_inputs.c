/* SPDX-License-Identifier: MIT
 * linux_gpio_inputs.c - the operator's switches on GPIO lines and the thread that reads them; see linux_gpio_inputs.h.
 */
#include "linux_gpio_inputs.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "linux_gpio_thread.h"

#define LOOK_MS 10  /* with edges: the kernel forgets some where there are very many */
#define POLL_MS 1   /* without */
#define LOST_MS 100 /* what has gone hardly ever comes back */
#define STALE_MS                                                                                                                 \
    250 /* lines that were not read for so long: the worker hangs in the kernel; or edges that were not listened to */

static uint32_t now_ms(void)
{
    return (uint32_t)(linux_gpio_thread_now_us() / 1000u);
}

/* --- The worker --- */

#define CHANNELS      (INPUT_ESTOP | INPUT_ESTOP2)
#define ACTIVE_OPENED (CHANNELS | INPUT_POWER)

/* Which inputs are active when these contacts are closed: those of the e-stop and of the supply are when they are open. */
static uint32_t levels_of(const linux_gpio_inputs_t *self, uint32_t closed)
{
    uint32_t levels = 0;
    for (unsigned i = 0; i < self->count; i++) {
        const bool is_closed = (closed >> i & 1u) != 0;
        levels |= is_closed != ((self->input[i] & ACTIVE_OPENED) != 0) ? self->input[i] : 0u;
    }
    return levels;
}

static void note_pressed(linux_gpio_inputs_t *self, uint32_t levels)
{
    if ((levels & CHANNELS) != 0) {
        (void)__atomic_fetch_or(&self->pressed, levels & CHANNELS, __ATOMIC_RELEASE);
    }
}

/* Reads the lines. Returns 0 or an error number.
 * @param is_deaf of edges that come meanwhile nothing is heard: a short opening could be lost */
static int look(linux_gpio_inputs_t *self, bool is_deaf)
{
    uint32_t closed = 0;
    const int error = linux_gpio_chip_get(&self->chip, &closed);
    if (error == 0) {
        const uint32_t levels = levels_of(self, closed);
        __atomic_store_n(&self->levels, levels, __ATOMIC_RELEASE);
        note_pressed(self, levels);
        __atomic_store_n(&self->read_ms, now_ms(), __ATOMIC_RELEASE);
    }
    __atomic_store_n(&self->is_lost, error != 0 || is_deaf, __ATOMIC_RELEASE);
    return error;
}

/* An e-stop whose contact has moved was open, whichever way: the kernel says how a line stands when it gets to an edge, so that
 * of a short opening only the closing is left. */
static void read_edges(linux_gpio_inputs_t *self, const struct pollfd *edge, unsigned edges)
{
    uint32_t rose = 0, fell = 0;
    for (unsigned i = 0; i < edges; i++) {
        const bool is_broken = (edge[i].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0; /* would be ready for ever */
        const bool is_ready = (edge[i].revents & POLLIN) != 0;
        if (is_broken || (is_ready && linux_gpio_chip_edges(&self->chip, i, &rose, &fell) != 0)) {
            self->has_edges = false;
        }
    }
    for (unsigned i = 0; i < self->count; i++) {
        note_pressed(self, ((rose | fell) >> i & 1u) != 0 ? self->input[i] : 0u);
    }
}

/* Sleeps until an edge, or until it is time to look again. Returns false: edges could not be listened to. */
static bool await_edges(linux_gpio_inputs_t *self, bool is_lost)
{
    struct pollfd poll_fd[1 + LINUX_GPIO_LINES_MAX] = {{.fd = self->wake, .events = POLLIN}};
    int fd[LINUX_GPIO_LINES_MAX];
    const unsigned edges = self->has_edges ? linux_gpio_chip_fds(&self->chip, fd) : 0;
    for (unsigned i = 0; i < edges; i++) {
        poll_fd[1 + i] = (struct pollfd){.fd = fd[i], .events = POLLIN};
    }
    const int ready = linux_gpio_thread_wait(poll_fd, 1 + edges, is_lost ? LOST_MS : edges > 0 ? LOOK_MS : POLL_MS);
    if (ready > 0) {
        read_edges(self, &poll_fd[1], edges);
    }
    return ready >= 0 || edges == 0;
}

static void *worker(void *argument)
{
    linux_gpio_inputs_t *self = argument;
    uint32_t heard_ms = now_ms();
    int error = 0;
    linux_gpio_thread_ask_for_priority();
    while (__atomic_load_n(&self->is_ending, __ATOMIC_ACQUIRE) == 0) {
        if (await_edges(self, error != 0)) {
            heard_ms = now_ms();
        }
        error = look(self, now_ms() - heard_ms > STALE_MS);
    }
    return NULL;
}

/* --- The motion thread's side --- */

static hv_status_t inputs_read(void *ctx, uint32_t *levels)
{
    linux_gpio_inputs_t *self = ctx;
    if (self->count == 0) {
        *levels = 0;
        return HV_OK;
    }
    const uint32_t age_ms = now_ms() - __atomic_load_n(&self->read_ms, __ATOMIC_ACQUIRE);
    if (__atomic_load_n(&self->is_lost, __ATOMIC_ACQUIRE) != 0 || (age_ms > STALE_MS && age_ms < UINT32_MAX / 2u)) {
        return HV_ERR_IO;
    }
    const uint32_t pressed = __atomic_exchange_n(&self->pressed, 0, __ATOMIC_ACQ_REL);
    *levels = __atomic_load_n(&self->levels, __ATOMIC_ACQUIRE) | pressed;
    return HV_OK;
}

static uint32_t inputs_present(void *ctx)
{
    const linux_gpio_inputs_t *self = ctx;
    return self->present;
}

hal_inputs_t linux_gpio_inputs_hal(linux_gpio_inputs_t *self)
{
    static const hal_inputs_ops_t k_ops = {inputs_read, inputs_present};
    return (hal_inputs_t){&k_ops, self};
}

/* --- Opening and closing --- */

/* Reads for the first time, and hands the lines to the worker. Returns 0 or an error number. */
static int start(linux_gpio_inputs_t *self)
{
    const int error = look(self, false);
    return error != 0 ? error : linux_gpio_thread_start(&self->thread, &self->wake, worker, self);
}

hv_status_t linux_gpio_inputs_open(linux_gpio_inputs_t *self, const linux_gpio_inputs_config_t *config)
{
    linux_gpio_request_t request = {.consumer = "heaved inputs", .is_active_low = config->is_active_low, .has_edges = true};
    memset(self, 0, sizeof *self);
    self->wake = -1;
    if (config->names.count == 0) {
        return HV_OK;
    }
    if (linux_gpio_request(&self->chip, &config->names, &request, self->error_text) != HV_OK) {
        return HV_ERR_IO;
    }
    self->count = config->names.count;
    self->has_edges = request.has_edges;
    for (unsigned i = 0; i < self->count; i++) {
        self->input[i] = config->input[i];
        self->present |= config->input[i];
    }
    const int error = start(self);
    if (error != 0) {
        (void)snprintf(self->error_text, sizeof self->error_text, "gpio: the inputs cannot be read: %s", strerror(error));
        linux_gpio_chip_close(&self->chip);
        return HV_ERR_IO;
    }
    self->is_open = true;
    return HV_OK;
}

bool linux_gpio_inputs_close(linux_gpio_inputs_t *self)
{
    if (!self->is_open) {
        return true;
    }
    self->is_open = false;
    __atomic_store_n(&self->is_ending, 1, __ATOMIC_RELEASE);
    if (!linux_gpio_thread_end(self->thread, self->wake)) {
        return false;
    }
    linux_gpio_chip_close(&self->chip);
    return true;
}
