/* SPDX-License-Identifier: MIT
 * doctor_modbus.c - see doctor_modbus.h.
 */
#include "inspect/doctor_modbus.h"

#include "common/sentence.h"
#include "common/translate.h"
#include "inspect/modbus_line.h"
#include "platform/modbus_section.h"

#define TRIES 3u /* one answer may be lost */

static void judge(doctor_report_t *report, unsigned drive, const modbus_request_t *request, const modbus_result_t *result)
{
    const unsigned unit = request->unit;
    const unsigned first = request->address;
    if (result->status == HV_OK) {
        doctor_say(report, DOCTOR_OK, "drive %u answers as unit %u", drive, unit);
    } else if (result->status == HV_ERR_STATE) {
        doctor_say(report, DOCTOR_FAIL,
                   "drive %u: unit %u refuses to read registers %u to %u, exception %u -> [modbus] feedback: docs/modbus.md",
                   drive, unit, first, first + request->count - 1u, result->exception);
    } else if (result->status == HV_ERR_FORMAT) {
        doctor_say(report, DOCTOR_FAIL,
                   "drive %u: the answer of unit %u is damaged -> bit rate, parity, terminating resistors; two drives with this "
                   "unit id?",
                   drive, unit);
    } else {
        doctor_say(report, DOCTOR_FAIL,
                   "drive %u: unit %u does not answer -> its supply and cable, its unit id; on a serial line bit rate and "
                   "parity",
                   drive, unit);
    }
}

static void ask(doctor_report_t *report, linux_modbus_link_t *link, const modbus_drive_map_t *map, unsigned axis)
{
    static modbus_result_t result;
    const modbus_drive_block_t *block = &map->feedback.block[0];
    const modbus_request_t request = {.function = map->is_input ? MODBUS_READ_INPUT : MODBUS_READ_HOLDING,
                                      .unit = map->axis[axis].unit,
                                      .address = block->address,
                                      .count = block->count};
    result.status = HV_ERR_IO;
    for (unsigned i = 0; i < TRIES && result.status != HV_OK && result.status != HV_ERR_STATE; i++) {
        linux_modbus_link_mend(link);
        linux_modbus_link_run(link, &request, &result);
    }
    judge(report, axis + 1u, &request, &result);
}

static void check_line(doctor_report_t *report, const config_t *config, const modbus_drive_map_t *map, unsigned line)
{
    static linux_modbus_link_t link;
    const linux_modbus_config_t setup = modbus_line_of_drives(config, line);
    const char *what = NULL;
    char shown[SENTENCE_MAX];
    if (linux_modbus_link_open(&link, &setup, &what) != HV_OK) {
        doctor_say(report, DOCTOR_FAIL, "%s -> docs/modbus.md",
                   what != NULL ? sentence(what, shown, sizeof shown) : _("no memory"));
        return;
    }
    linux_modbus_link_mend(&link);
    if (linux_modbus_link_fd(&link) < 0) {
        const char *trouble = sentence(linux_modbus_trouble_text(link.trouble), shown, sizeof shown);
        if (setup.host != NULL) {
            doctor_say(report, DOCTOR_FAIL, "%s:%u: %s -> docs/modbus.md", setup.host, setup.port, trouble);
        } else {
            doctor_say(report, DOCTOR_FAIL, "%s: %s -> docs/modbus.md", setup.device, trouble);
        }
    } else {
        for (unsigned axis = 0; axis < map->axes; axis++) {
            if (map->axis[axis].line == line) {
                ask(report, &link, map, axis);
            }
        }
    }
    linux_modbus_link_close(&link);
}

void doctor_modbus_check(doctor_report_t *report, const config_t *config)
{
    static modbus_drive_map_t map;
    config_modbus_map(config, &map);
    for (unsigned line = 0; line < config_modbus_lines(config); line++) {
        check_line(report, config, &map, line);
    }
}
