/* SPDX-License-Identifier: MIT
 * canraw_words.c - what a drive of a raw CAN map is at, in words; see canraw_axis.h.
 */
#include "canraw_axis.h"

#define TROUBLE_SHOWN_US 1000000u /* after a frame that was not believed */

static const char *phase_of(const canraw_axis_t *self)
{
    static const char *const k_phases[] = {[DRIVE_OFFLINE] = "missing", [DRIVE_DISABLED] = "ready", [DRIVE_ENABLING] = "enabling",
                                           [DRIVE_ENABLED] = "enabled", [DRIVE_HOMING] = "homing",  [DRIVE_FAULT] = "fault"};
    return k_phases[self->is_online ? self->state : DRIVE_OFFLINE];
}

const char *canraw_fault_text(uint32_t code)
{
    switch (code) {
    case CANRAW_FAULT_FOLLOWING:
        return "following error";
    case CANRAW_FAULT_HOMING:
        return "homing has failed";
    case CANRAW_OTHER_MASTER:
        return "another master is on the bus: somebody else sends frames with the identifiers of ours";
    default:
        return "fault of the drive";
    }
}

static const char *text_of_strange(canraw_verdict_t verdict)
{
    switch (verdict) {
    case CANRAW_BAD_CHECK:
        return "the check byte of what it sends is wrong";
    case CANRAW_BAD_NUMBER:
        return "it sends a position that is no number, or beyond what there is";
    case CANRAW_REPEATED:
        return "its alive counter stands still";
    case CANRAW_MATCH:
    case CANRAW_OTHER:
        break;
    }
    return "it sends other bytes than its replies in the configuration";
}

/* At the start there is time for the first frame. */
static void describe_missing(const canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us, drive_report_t *out)
{
    if (self->heard_us == 0 && now_us - self->phase_us <= (uint64_t)map->offline_periods * map->period_us) {
        return;
    }
    const bool has_position = self->is_placed && map->status_reply.length != 0;
    if (self->failed_step != 0) {
        out->code = CANRAW_NO_ANSWER;
        out->trouble = "it does not answer as it should when it is started up";
        out->detail = "step";
        out->detail_code = self->failed_step;
        return;
    }
    out->code = has_position ? CANRAW_NO_STATUS : CANRAW_SILENT;
    out->trouble = has_position ? "its position comes, but no status" : "nothing comes from it: supply, cable, identifier";
}

/* In the direction of the extension, whichever way the drive counts. */
static drive_telemetry_t telemetry_of(const canraw_axis_t *self, const canraw_map_t *map, unsigned k)
{
    if (!self->has_torque || map->rated_torque == 0) {
        return (drive_telemetry_t){.at_us = 0};
    }
    const int64_t permille = fx_clamp(self->torque * 1000 / (int64_t)map->rated_torque, -INT32_MAX, INT32_MAX);
    return (drive_telemetry_t){.at_us = self->torque_us,
                               .torque_permille = (int32_t)(map->axis[k].scale.num < 0 ? -permille : permille),
                               .has = DRIVE_HAS_TORQUE};
}

void canraw_listening_words(bool is_led, drive_report_t *out)
{
    out->phase = "listening";
    out->code = is_led ? CANRAW_OTHER_MASTER : 0;
    out->trouble = is_led ? canraw_fault_text(CANRAW_OTHER_MASTER) : "";
    out->detail = "";
    out->detail_code = 0;
}

void canraw_axis_words(const canraw_axis_t *self, const canraw_map_t *map, unsigned k, uint64_t now_us, drive_report_t *out)
{
    *out = (drive_report_t){.phase = phase_of(self),
                            .trouble = "",
                            .detail = "",
                            .address = (uint8_t)(k + 1u),
                            .identifier = map->axis[k].reply_id,
                            .telemetry = telemetry_of(self, map, k),
                            .since_us = self->phase_us};
    if (self->is_online && self->state == DRIVE_FAULT) {
        out->code = self->fault_code;
        out->trouble = canraw_fault_text(self->fault_code);
    } else if (self->trouble != CANRAW_MATCH && now_us - self->trouble_us <= TROUBLE_SHOWN_US) {
        out->code = CANRAW_STRANGE + (uint32_t)self->trouble - CANRAW_OTHER;
        out->trouble = text_of_strange(self->trouble);
    } else if (!self->is_online) {
        describe_missing(self, map, now_us, out);
    } else if (self->reported_code != 0) {
        out->code = CANRAW_REPORTS_ERROR;
        out->trouble = "it tells of an error, and goes on";
        out->detail = "its fault code";
        out->detail_code = self->reported_code;
    }
}
