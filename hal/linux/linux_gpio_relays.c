/* SPDX-License-Identifier: MIT
 * linux_gpio_relays.c - relays on GPIO lines and the thread that writes them; see linux_gpio_relays.h.
 */
#include "linux_gpio_relays.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "linux_gpio_thread.h"

#define CHECK_MS 100     /* lines that nobody changes are looked at so often: a chip that has gone is noticed */
#define LATE_US  300000u /* a mask that has not been carried out by then: the worker hangs in the kernel */

/* --- The worker --- */

static uint16_t mask_of(uint32_t word)
{
    return (uint16_t)(word & 0xFFFFu);
}

/* Writes what is asked for, if it is new or does not stand there, and looks at what stands there. */
static void serve(linux_gpio_relays_t *self)
{
    const uint32_t asked = __atomic_load_n(&self->asked, __ATOMIC_ACQUIRE);
    uint32_t seen = 0;
    int error = 0;
    if (asked != self->done || self->is_lost != 0) {
        error = linux_gpio_chip_set(&self->chip, mask_of(asked));
    }
    error = error == 0 ? linux_gpio_chip_get(&self->chip, &seen) : error;
    if (error == 0) {
        __atomic_store_n(&self->done, (asked & 0xFFFF0000u) | seen, __ATOMIC_RELEASE);
    }
    __atomic_store_n(&self->is_lost, error != 0, __ATOMIC_RELEASE);
}

static void *worker(void *argument)
{
    linux_gpio_relays_t *self = argument;
    linux_gpio_thread_ask_for_priority();
    while (__atomic_load_n(&self->is_ending, __ATOMIC_ACQUIRE) == 0) {
        struct pollfd wake = {.fd = self->wake, .events = POLLIN};
        uint64_t woken;
        (void)linux_gpio_thread_wait(&wake, 1, CHECK_MS);
        (void)!read(self->wake, &woken, sizeof woken);
        serve(self);
    }
    (void)!linux_gpio_chip_set(&self->chip, self->safe_mask);
    return NULL;
}

/* --- The motion thread's side --- */

static hv_status_t relays_write(void *ctx, uint16_t mask)
{
    linux_gpio_relays_t *self = ctx;
    if ((uint32_t)mask >> self->count != 0) {
        return HV_ERR_RANGE;
    }
    if (self->count == 0) {
        return HV_OK;
    }
    if (mask_of(self->asked) != mask) {
        self->asked_us = linux_gpio_thread_now_us();
        __atomic_store_n(&self->asked, ((self->asked & 0xFFFF0000u) + 0x10000u) | mask, __ATOMIC_RELEASE);
        linux_gpio_thread_wake(self->wake);
    }
    return __atomic_load_n(&self->is_lost, __ATOMIC_ACQUIRE) != 0 ? HV_ERR_IO : HV_OK;
}

static hv_status_t relays_read_back(void *ctx, uint16_t *mask)
{
    const linux_gpio_relays_t *self = ctx;
    const uint32_t done = __atomic_load_n(&self->done, __ATOMIC_ACQUIRE);
    if (__atomic_load_n(&self->is_lost, __ATOMIC_ACQUIRE) != 0) {
        return HV_ERR_IO;
    }
    if (done >> 16 != self->asked >> 16) {
        return linux_gpio_thread_now_us() - self->asked_us > LATE_US ? HV_ERR_IO : HV_ERR_AGAIN;
    }
    *mask = mask_of(done);
    return HV_OK;
}

static uint8_t relays_count(void *ctx)
{
    const linux_gpio_relays_t *self = ctx;
    return self->count;
}

hal_relays_t linux_gpio_relays_hal(linux_gpio_relays_t *self)
{
    static const hal_relays_ops_t k_ops = {relays_write, relays_read_back, relays_count};
    return (hal_relays_t){&k_ops, self};
}

/* --- Opening and closing --- */

hv_status_t linux_gpio_relays_open(linux_gpio_relays_t *self, const linux_gpio_relays_config_t *config)
{
    linux_gpio_request_t request = {
        .consumer = config->consumer, .is_output = true, .is_active_low = config->is_active_low, .values = config->safe_mask};
    memset(self, 0, sizeof *self);
    self->wake = -1;
    self->asked = config->safe_mask;
    self->done = config->safe_mask;
    if (config->names.count == 0) {
        return HV_OK;
    }
    if (linux_gpio_request(&self->chip, &config->names, &request, self->error_text) != HV_OK) {
        return HV_ERR_IO;
    }
    self->count = (uint8_t)config->names.count;
    const int error = linux_gpio_thread_start(&self->thread, &self->wake, worker, self);
    if (error != 0) {
        (void)snprintf(self->error_text, sizeof self->error_text, "gpio: no thread for the relays: %s", strerror(error));
        linux_gpio_chip_close(&self->chip);
        return HV_ERR_IO;
    }
    self->is_open = true;
    return HV_OK;
}

bool linux_gpio_relays_close(linux_gpio_relays_t *self, uint16_t safe_mask)
{
    if (!self->is_open) {
        return true;
    }
    self->is_open = false;
    self->safe_mask = safe_mask;
    __atomic_store_n(&self->is_ending, 1, __ATOMIC_RELEASE);
    if (!linux_gpio_thread_end(self->thread, self->wake)) {
        return false;
    }
    linux_gpio_chip_close(&self->chip);
    return true;
}
