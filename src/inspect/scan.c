/* SPDX-License-Identifier: MIT
 * scan.c - see scan.h.
 */
#include "inspect/scan.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "common/sentence.h"
#include "common/translate.h"
#include "inspect/doctor_probe.h"
#include "linux_modbus_link.h"

#define LISTEN_MS     300u
#define CALL_MS       1000u /* some drives take 700 ms for 1000h */
#define NODE_MS       1000u
#define UNIT_US       60000u
#define UNITS         247u
#define USUAL_BAUD    115200u
#define DRIVE_PROFILE 402u

/* --- CANopen --- */

static void show_node(const doctor_node_t *node, unsigned id, FILE *out)
{
    const uint32_t *value = node->value;
    if (node->answer[DOCTOR_TYPE] == DOCTOR_READ && (value[DOCTOR_TYPE] & 0xFFFFu) != DRIVE_PROFILE) {
        fprintf(out, _("other node %u: device profile %u, no drive\n"), id, (unsigned)(value[DOCTOR_TYPE] & 0xFFFFu));
        return;
    }
    fprintf(out, _("node %u: drive, vendor 0x%X product 0x%X revision 0x%X serial 0x%X %s\n"), id, (unsigned)value[DOCTOR_VENDOR],
            (unsigned)value[DOCTOR_PRODUCT], (unsigned)value[DOCTOR_REVISION], (unsigned)value[DOCTOR_SERIAL],
            node->name[DOCTOR_DEVICE]);
    if (node->extra_answers > 0) {
        fprintf(out, "%s ", _("FAIL"));
        fprintf(out, _("node %u: two drives answer: they have the same node id\n"), id);
    }
}

/* Returns false where the bus has trouble. */
static bool ask_nodes(doctor_probe_t *probe, FILE *out)
{
    static doctor_node_t node;
    char shown[SENTENCE_MAX];
    bool is_well = true;
    doctor_probe_listen(probe, LISTEN_MS);
    doctor_probe_call(probe, CALL_MS);
    const doctor_wire_t *wire = doctor_probe_wire(probe);
    if (!wire->is_heard && wire->is_unacknowledged) {
        fprintf(out, "%s %s\n", _("FAIL"),
                _("nobody acknowledges on this bus: supply of the drives, cable, terminating resistors, bit rate"));
        return false;
    }
    for (unsigned id = 1; id < DOCTOR_NODES && is_well; id++) {
        if (!doctor_probe_is_there(probe, id)) {
            continue;
        }
        doctor_probe_node(probe, &(cia402_axis_config_t){.node = (uint8_t)id}, NODE_MS, &node);
        if (node.answer[DOCTOR_TYPE] != DOCTOR_NO_ANSWER) {
            show_node(&node, id, out);
            is_well = node.extra_answers == 0;
        } else {
            fprintf(out, _("other node %u: has a heartbeat, and answers no SDO\n"), id);
        }
        if (doctor_probe_trouble(probe) != NULL) {
            fprintf(out, "%s %s\n", _("FAIL"), sentence(doctor_probe_trouble(probe), shown, sizeof shown));
            return false;
        }
    }
    if (probe->is_synced) {
        fprintf(out, "%s %s\n", _("FAIL"), _("somebody sends SYNC: there is another master on the bus; end it first"));
    }
    return is_well && !probe->is_synced;
}

static bool scan_can(const char *interface, FILE *out)
{
    static doctor_probe_t probe;
    char shown[SENTENCE_MAX];
    if (!doctor_probe_open(&probe, interface)) {
        const char *trouble = doctor_probe_trouble(&probe);
        fprintf(out, "%s %s: %s\n", _("FAIL"), interface,
                trouble != NULL ? sentence(trouble, shown, sizeof shown) : _("cannot be opened"));
        return false;
    }
    const bool is_well = ask_nodes(&probe, out);
    doctor_probe_close(&probe);
    return is_well;
}

/* --- Modbus --- */

static bool ask_units(linux_modbus_link_t *link, const char *device, FILE *out)
{
    static modbus_result_t result;
    char shown[SENTENCE_MAX];
    linux_modbus_link_mend(link);
    for (unsigned unit = 1; unit <= UNITS; unit++) {
        const modbus_request_t request = {.function = MODBUS_READ_HOLDING, .unit = (uint8_t)unit, .count = 1};
        if (linux_modbus_link_fd(link) < 0) {
            fprintf(out, "%s %s: %s\n", _("FAIL"), device,
                    sentence(linux_modbus_trouble_text(link->trouble), shown, sizeof shown));
            return false;
        }
        linux_modbus_link_run(link, &request, &result);
        if (result.status == HV_OK || result.status == HV_ERR_STATE) {
            fprintf(out, _("unit %u: answers\n"), unit);
        } else if (result.status == HV_ERR_FORMAT) {
            fprintf(out, _("other unit %u: a damaged answer: bit rate, parity, or two drives with this unit id\n"), unit);
        }
    }
    return true;
}

/* "/dev/ttyUSB0,115200,even,1", all but the first as in the sections of the configuration. */
static bool scan_serial(const char *bus, FILE *out)
{
    static linux_modbus_link_t link;
    char copy[LINUX_MODBUS_NAME_SIZE], shown[SENTENCE_MAX], *rest = NULL;
    const char *what = NULL;
    if (strlen(bus) >= sizeof copy) {
        fprintf(out, "%s %s: %s\n", _("FAIL"), bus, _("is too long"));
        return false;
    }
    memcpy(copy, bus, strlen(bus) + 1u);
    const char *device = strtok_r(copy, ",", &rest), *baud = strtok_r(NULL, ",", &rest);
    const char *parity = strtok_r(NULL, ",", &rest), *stop_bits = strtok_r(NULL, ",", &rest);
    const linux_modbus_config_t config = {.device = device,
                                          .baud_bps = baud != NULL ? (uint32_t)strtoul(baud, NULL, 10) : USUAL_BAUD,
                                          .parity = (char)(parity != NULL ? toupper((unsigned char)parity[0]) : 'E'),
                                          .stop_bits = stop_bits != NULL ? (uint8_t)strtoul(stop_bits, NULL, 10) : 1u,
                                          .timeout_us = UNIT_US};
    if (linux_modbus_link_open(&link, &config, &what) != HV_OK) {
        fprintf(out, "%s %s: %s\n", _("FAIL"), bus, what != NULL ? sentence(what, shown, sizeof shown) : _("no memory"));
        return false;
    }
    const bool is_well = ask_units(&link, device, out);
    linux_modbus_link_close(&link);
    return is_well;
}

bool scan_run(const char *bus, FILE *out)
{
    return strchr(bus, '/') != NULL ? scan_serial(bus, out) : scan_can(bus, out);
}
