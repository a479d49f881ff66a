/* SPDX-License-Identifier: MIT
 * linux_clock.c - CLOCK_MONOTONIC; see linux_clock.h.
 */
#include "linux_clock.h"

#include <errno.h>
#include <time.h>

static uint64_t clock_now_us(void *ctx)
{
    struct timespec now;
    (void)ctx;
    (void)clock_gettime(CLOCK_MONOTONIC, &now); /* cannot fail: a valid clock and a valid address */
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

static hv_status_t clock_sleep_until_us(void *ctx, uint64_t deadline_us)
{
    const struct timespec deadline = {(time_t)(deadline_us / 1000000u), (long)(deadline_us % 1000000u) * 1000L};
    int error;
    (void)ctx;
    do {
        error = clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, NULL);
    } while (error == EINTR);
    return error == 0 ? HV_OK : HV_ERR_IO;
}

hal_clock_t linux_clock_hal(void)
{
    static const hal_clock_ops_t k_ops = {clock_now_us, clock_sleep_until_us};
    return (hal_clock_t){&k_ops, NULL};
}
