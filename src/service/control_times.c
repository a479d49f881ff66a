/* SPDX-License-Identifier: MIT
 * control_times.c - see control_times.h.
 */
#include "service/control_times.h"

#include "service/control_client.h"

/* Where bins begin, us: even on a logarithmic scale. The last one has all that is longer. */
static const uint16_t k_bound_us[] = {0,   1,   2,   3,   5,   7,   10,   15,   20,   30,   50,  70,
                                      100, 150, 200, 300, 500, 700, 1000, 1500, 2000, 3000, 4000};
#define BINS (sizeof k_bound_us / sizeof k_bound_us[0])

static void put_counts(json_t *json, const char *name, const histogram_t *times)
{
    json_open(json, name, '[');
    for (unsigned i = 0; i < BINS; i++) {
        json_number(json, NULL, histogram_between(times, k_bound_us[i], i + 1u < BINS ? k_bound_us[i + 1u] : HISTOGRAM_BINS));
    }
    json_close(json, ']');
}

void control_times_answer(const control_t *self, control_client_t *client)
{
    const motion_times_t *times = &self->handover->times;
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_open(&json, "bounds_us", '[');
    for (unsigned i = 0; i < BINS; i++) {
        json_number(&json, NULL, k_bound_us[i]);
    }
    json_close(&json, ']');
    put_counts(&json, "wake_latency", &times->wake);
    put_counts(&json, "cycle_time", &times->work);
    put_counts(&json, "frame_latency", &times->frame);
    json_close(&json, '}');
    control_client_answer(client, &json);
}
