/* SPDX-License-Identifier: MIT
 * service_json.c - SERVICE as JSON; see service_json.h.
 */
#include "service/service_json.h"

static const char *drive_state_name(drive_state_t state)
{
    static const char *const k_names[] = {"offline", "disabled", "enabling", "enabled", "homing", "fault"};
    return (unsigned)state < sizeof k_names / sizeof k_names[0] ? k_names[state] : "?";
}

/* What is led, or looks for its zero, or is switched: a number, the axis of a pose, or all. */
static void put_axis(json_t *json, const service_view_t *service)
{
    static const char *const k_axes[POSE_AXES] = {"roll", "pitch", "yaw", "x", "y", "z"};
    if (service->doing == SERVICE_NOTHING) {
        json_null(json, "axis");
    } else if (service->axis == SERVICE_ALL) {
        json_text(json, "axis", "all");
    } else if ((service->doing == SERVICE_JOG_POSE || service->doing == SERVICE_SIGNAL_POSE) && service->axis <= POSE_AXES) {
        json_text(json, "axis", k_axes[service->axis - 1u]);
    } else {
        json_number(json, "axis", service->axis);
    }
}

void service_json_hand(json_t *json, const snapshot_t *snapshot)
{
    const service_view_t *service = &snapshot->service;
    json_number(json, "tick", service->tick_us);
    json_number(json, "series", service->series);
    json_number(json, "finished", service->finished);
    json_bool(json, "held", service->is_held);
    json_text(json, "doing", service_verb_name(service->doing));
    put_axis(json, service);
}

static void put_drive(json_t *json, const snapshot_t *s, unsigned i)
{
    const drive_feedback_t *drive = &s->drive[i];
    const char *actual = i < s->cylinders ? "actual_mm" : "actual_deg";
    json_open(json, NULL, '{');
    json_number(json, "drive", i + 1u);
    json_text(json, "state", drive_state_name(drive->state));
    if ((s->service.has_counts >> i & 1u) != 0) {
        json_integer(json, "counts", s->service.counts[i]);
    } else {
        json_null(json, "counts");
    }
    if (drive->has_actual) {
        json_q32(json, actual, drive->actual_mm_q32);
    } else {
        json_null(json, actual);
    }
    json_bool(json, "homed", drive->is_homed);
    json_bool(json, "torque", s->state == STATE_SERVICE ? (s->service.torque >> i & 1u) != 0 : drive->is_energized);
    json_close(json, '}');
}

void service_json_drives(json_t *json, const snapshot_t *snapshot)
{
    json_open(json, "drives", '[');
    for (unsigned i = 0; i < snapshot->cylinders + (snapshot->has_angle ? 1u : 0u); i++) {
        put_drive(json, snapshot, i);
    }
    json_close(json, ']');
}

void service_json_selftest(json_t *json, const status_lost_t *lost, const config_t *config)
{
    const lifetime_selftest_t *last = lost->life != NULL && lost->life->selftest.day != 0 ? &lost->life->selftest : NULL;
    json_open(json, "selftest", '{');
    json_text(json, "when", config->selftest.when == CONFIG_SELFTEST_DAILY ? "daily" : "none");
    json_bool(json, "due", lost->is_untested);
    if (last != NULL) {
        json_number(json, "day", last->day);
        json_bool(json, "passed", last->is_passed);
        json_text(json, "configuration", last->hash);
    } else {
        json_null(json, "day");
        json_null(json, "passed");
        json_null(json, "configuration");
    }
    json_close(json, '}');
}
