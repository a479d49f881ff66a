/* SPDX-License-Identifier: MIT
 * twin_faults.c - what can be made to go wrong; see twin_faults.h.
 */
#include "twin/twin_faults.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "twin/fault_words.h"
#include "twin/frame_faults.h"
#include "twin/line_faults.h"
#include "twin/modbus_faults.h"
#include "twin/node_internal.h"

#define INDEX_MAX    0xFFFFu
#define GENERIC      0x2310u     /* continuous over-current */
#define NOT_NOW      0x08000000u /* SDO: general error */
#define HOT_C        120.0
#define REGISTER_SET 0x81u

/** One name. form: d = drives, o = an object, n = a number, N = one that may be left out, s = a switch's state, g = a section, q
 * = a quirk. */
typedef struct {
    const char *name;
    const char *form;
    const char *arguments;
    const char *help;
    double fallback[FAULT_NUMBERS];                                               /**< of numbers left out */
    double most;                                                                  /**< largest number */
    void (*act)(twin_t *twin, unsigned k, const fault_t *fault, uint64_t now_us); /**< once per drive; NULL: bus */
    bus_fault_t bus;
} row_t;

static node_t *node_of(twin_t *twin, unsigned k)
{
    return &twin->node[k];
}

/* What has the supply and the bus of a drive. */
static node_t *head_of(twin_t *twin, unsigned k)
{
    return node_head(&twin->node[k]);
}

/* As the first axis of a node has it. */
static object_t *object_of(twin_t *twin, unsigned k, const fault_t *fault)
{
    const uint32_t index = fault->object >> 8;
    node_t *node = index < 0x1400 ? head_of(twin, k) : node_of(twin, k);
    return objects_find(&node->drive.od, (uint16_t)(index < 0x6000 ? index : 0x6000 + index % 0x800), (uint8_t)fault->object);
}

/* --- One function per name --- */

ACT(act_fault)
{
    drive_fault(&node_of(twin, k)->drive, (uint16_t)fault->number[0]);
}

ACT(act_broken)
{
    act_fault(twin, k, fault, now_us);
    node_of(twin, k)->drive.is_broken = true;
}

ACT(act_mend)
{
    node_t *node = node_of(twin, k);
    node_t *head = head_of(twin, k);
    node->drive.is_broken = node->drive.is_deaf = node->drive.is_homing_broken = false;
    node->drive.motor.is_jammed = false;
    node->drive.motor.slip = 0;
    node->drive.motor.temperature_c = node->drive.motor.ambient_c;
    head->is_mute = head->is_cut = head->is_sdo_silent = head->has_no_heartbeat = false;
    node->tpdo_drop = node->tpdo_us = 0;
    head->sdo_us = 1000;
    node->drive.bits_set = node->drive.bits_clear = 0;
    node->drive.quirks = head->drive.quirks = 0;
    for (uint32_t i = 0; i < node->drive.od.count; i++) {
        object_t *row = &node->drive.od.row[i];
        row->is_missing = row->is_silent = false;
        row->refusal = 0;
        if (row->is_forced) {
            row->value = row->was_value;
            row->fallback = row->was_fallback;
            row->is_read_only = row->was_read_only;
            row->is_forced = false;
        }
    }
    if (head->own_number != 0) {
        head->number = head->own_number;
        head->own_number = 0;
        node_reboot(head, now_us);
    }
}

ACT(act_emcy)
{
    node_emergency(head_of(twin, k), (uint16_t)fault->number[0], REGISTER_SET);
}

ACT(act_heartbeat)
{
    head_of(twin, k)->has_no_heartbeat = true;
}

ACT(act_reboot)
{
    node_reboot(head_of(twin, k), now_us);
}

ACT(act_power_off)
{
    node_power(node_of(twin, k), false, now_us);
}

ACT(act_power_on)
{
    node_power(node_of(twin, k), true, now_us);
}

ACT(act_mute)
{
    head_of(twin, k)->is_mute = true;
}

ACT(act_cut)
{
    head_of(twin, k)->is_cut = true;
}

ACT(act_ignore)
{
    node_of(twin, k)->drive.is_deaf = true;
}

ACT(act_jam)
{
    node_of(twin, k)->drive.motor.is_jammed = true;
}

ACT(act_drop)
{
    drive_drop(&node_of(twin, k)->drive);
}

ACT(act_lose)
{
    node_of(twin, k)->tpdo_drop = (uint32_t)fault->number[0];
}

ACT(act_late)
{
    node_of(twin, k)->tpdo_us = (uint32_t)(fault->number[0] * 1000);
}

ACT(act_preop)
{
    if (fault->number[0] > 0) {
        act_emcy(twin, k, fault, now_us);
    }
    node_enter(head_of(twin, k), 0x7F);
}

ACT(act_stopped)
{
    node_enter(head_of(twin, k), 0x04);
}

ACT(act_mode)
{
    node_of(twin, k)->drive.mode = (int8_t)fault->number[0];
}

ACT(act_status)
{
    node_of(twin, k)->drive.bits_set = (uint16_t)fault->number[0];
    node_of(twin, k)->drive.bits_clear = (uint16_t)fault->number[1];
}

ACT(act_no_homing)
{
    node_of(twin, k)->drive.is_homing_broken = true;
}

ACT(act_sdo_silent)
{
    head_of(twin, k)->is_sdo_silent = true;
}

ACT(act_sdo_slow)
{
    head_of(twin, k)->sdo_us = (uint32_t)(fault->number[0] * 1000);
}

ACT(act_sdo_reject)
{
    object_of(twin, k, fault)->refusal = (uint32_t)fault->number[0];
}

ACT(act_sdo_mute)
{
    object_of(twin, k, fault)->is_silent = true;
}

ACT(act_sdo_missing)
{
    object_of(twin, k, fault)->is_missing = true;
}

/* Holds it over a reset, too, and takes no other. */
ACT(act_object)
{
    object_t *row = object_of(twin, k, fault);
    if (!row->is_forced) {
        row->was_value = row->value;
        row->was_fallback = row->fallback;
        row->was_read_only = row->is_read_only;
        row->is_forced = true;
    }
    row->value = row->fallback = (uint32_t)fault->number[0];
    row->is_read_only = true;
}

/* Of all axes of a drive. */
ACT(act_quirk)
{
    const uint32_t quirk = (uint32_t)fault->number[0];
    head_of(twin, k)->drive.quirks |= quirk;
    node_of(twin, k)->drive.quirks |= quirk;
}

ACT(act_node)
{
    node_t *node = head_of(twin, k);
    node->own_number = node->own_number != 0 ? node->own_number : node->number;
    node->number = (uint8_t)fault->number[0];
    node_reboot(node, now_us);
}

ACT(act_hot)
{
    node_of(twin, k)->drive.motor.temperature_c = HOT_C;
}

ACT(act_slip)
{
    node_of(twin, k)->drive.motor.slip = fault->number[0] * twin->per_unit[k];
}

ACT(act_load)
{
    node_of(twin, k)->drive.motor.load = fault->number[0] * twin->per_unit[k];
}

ACT(act_friction)
{
    node_of(twin, k)->drive.motor.friction = fault->number[0] * fabs(twin->per_unit[k]);
}

ACT(act_encoder)
{
    node_of(twin, k)->drive.origin -= fault->number[0] * twin->per_unit[k];
}

ACT(act_lag)
{
    node_of(twin, k)->drive.motor.lag_us = fault->number[0] * 1000;
}

ACT(act_other_master)
{
    twin->other = (other_master_t){k, now_us, now_us + (uint64_t)(fault->number[0] * 1000)};
}

/* Not of CiA 402 drives: modbus_faults.c and frame_faults.c have what it does. */
ACT(act_none)
{
    (void)twin;
    (void)k;
}

/* clang-format off */ /* a row is a record */
static const row_t k_rows[] = {
    {"fault", "dN", "DRIVE [CODE]", "the drive finds a fault, with its EMCY; else 0x2310", {GENERIC}, INDEX_MAX, act_fault, BUS_OFF},
    {"broken", "dN", "DRIVE [CODE]", "the same, and no reset leads out of it before mend", {GENERIC}, INDEX_MAX, act_broken, BUS_OFF},
    {"emcy", "dn", "DRIVE CODE", "an EMCY without a fault", {0}, INDEX_MAX, act_emcy, BUS_OFF},
    {"heartbeat-lost", "d", "DRIVE", "sends no heartbeat any more", {0}, 0, act_heartbeat, BUS_OFF},
    {"reboot", "d", "DRIVE", "starts again by itself, as after a dip of its supply", {0}, 0, act_reboot, BUS_OFF},
    {"power-off", "d", "DRIVE", "its supply goes", {0}, 0, act_power_off, BUS_OFF},
    {"power-on", "d", "DRIVE", "its supply is back", {0}, 0, act_power_on, BUS_OFF},
    {"mute", "d", "DRIVE", "hears, but says nothing", {0}, 0, act_mute, BUS_OFF},
    {"cut", "d", "DRIVE", "the cable of this drive is out: neither hears nor says anything", {0}, 0, act_cut, BUS_OFF},
    {"ignore", "d", "DRIVE", "answers, but acts on nothing", {0}, 0, act_ignore, BUS_OFF},
    {"jam", "d", "DRIVE", "the cylinder is stuck", {0}, 0, act_jam, BUS_OFF},
    {"drop", "d", "DRIVE", "loses its torque by itself", {0}, 0, act_drop, BUS_OFF},
    {"lose", "dn", "DRIVE COUNT", "so many of its answers (TPDOs) are lost", {0}, 1e6, act_lose, BUS_OFF},
    {"late", "dn", "DRIVE MS", "its answers come so late", {0}, 1e4, act_late, BUS_OFF},
    {"pre-operational", "dN", "DRIVE [CODE]", "leaves operational, with this EMCY", {0}, INDEX_MAX, act_preop, BUS_OFF},
    {"stopped", "d", "DRIVE", "goes into the NMT state stopped", {0}, 0, act_stopped, BUS_OFF},
    {"mode", "dn", "DRIVE NUMBER", "leaves its mode of operation for this one", {0}, 127, act_mode, BUS_OFF},
    {"status", "dnN", "DRIVE SET [CLEAR]", "bits of the statusword that it shows whatever it does", {0}, INDEX_MAX, act_status, BUS_OFF},
    {"homing-fails", "d", "DRIVE", "homing ends with an error", {0}, 0, act_no_homing, BUS_OFF},
    {"sdo-silent", "d", "DRIVE", "answers no SDO", {0}, 0, act_sdo_silent, BUS_OFF},
    {"sdo-slow", "dn", "DRIVE MS", "answers SDOs so late", {0}, 1e5, act_sdo_slow, BUS_OFF},
    {"sdo-refuse", "doN", "DRIVE INDEX[:SUB] [ABORT]", "refuses to write that object; else 0x08000000", {NOT_NOW}, UINT32_MAX, act_sdo_reject, BUS_OFF},
    {"sdo-mute", "do", "DRIVE INDEX[:SUB]", "never answers for that object", {0}, 0, act_sdo_mute, BUS_OFF},
    {"missing", "do", "DRIVE INDEX[:SUB]", "has not got that object", {0}, 0, act_sdo_missing, BUS_OFF},
    {"object", "don", "DRIVE INDEX[:SUB] VALUE", "that object holds this until mend or the next power-up, and takes nothing else", {0}, UINT32_MAX, act_object, BUS_OFF},
    {"node", "dn", "DRIVE NODE", "gets this node id, which another one may have, and starts again", {0}, 127, act_node, BUS_OFF},
    {"quirk", "dq", "DRIVE NAME", "differs from the usual drives, as some do; docs/twin.md has the names", {0}, 0, act_quirk, BUS_OFF},
    {"hot", "d", "DRIVE", "the motor is too hot", {0}, 0, act_hot, BUS_OFF},
    {"slip", "dn", "DRIVE MM_S", "the brake does not hold: sinks so fast without torque", {0}, 1e4, act_slip, BUS_OFF},
    {"load", "dn", "DRIVE MM", "gives way so far under its load", {0}, 1e4, act_load, BUS_OFF},
    {"friction", "dn", "DRIVE MM", "breaks loose so far behind its demand", {0}, 1e4, act_friction, BUS_OFF},
    {"encoder", "dn", "DRIVE MM", "its encoder tells so much more from now on", {0}, 1e4, act_encoder, BUS_OFF},
    {"lag", "dn", "DRIVE MS", "follows with this time constant", {0}, 1e5, act_lag, BUS_OFF},
    {"other-master", "dN", "DRIVE [MS]", "another master on the bus commands it, once or for so long", {1}, 1e7, act_other_master, BUS_OFF},
    {"damaged", "dn", "DRIVE COUNT", "Modbus, own frames: so many of its answers are damaged, the check byte, CRC or function", {0}, 1e6, act_none, BUS_OFF},
    {"stuck-counter", "d", "DRIVE", "own frames: its alive counter stands still", {0}, 0, act_none, BUS_OFF},
    {"half", "dn", "DRIVE COUNT", "Modbus: of so many of its answers only a half comes", {0}, 1e6, act_none, BUS_OFF},
    {"exception", "dnN", "DRIVE COUNT [CODE]", "Modbus: it answers so many times with an exception; else 6, busy", {0}, 1e6, act_none, BUS_OFF},
    {"register", "dnn", "DRIVE ADDRESS VALUE", "Modbus: that register holds this, and takes nothing else", {0}, INDEX_MAX, act_none, BUS_OFF},
    {"mend", "d", "DRIVE", "ends the lasting faults above; load, friction, lag and encoder take 0 or another value", {0}, 0, act_mend, BUS_OFF},
    {"bus-off", "", "", "heaved's controller goes bus-off", {0}, 0, NULL, BUS_OFF},
    {"passive", "", "", "heaved's controller becomes error-passive", {0}, 0, NULL, BUS_PASSIVE},
    {"active", "", "", "and recovers", {0}, 0, NULL, BUS_ACTIVE},
    {"storm", "n", "COUNT", "so many error frames at once", {0}, 10000, NULL, BUS_STORM},
    {"cable-out", "", "", "the cable of heaved is out: nobody acknowledges", {0}, 0, NULL, BUS_CABLE_OUT},
    {"queue-full", "", "", "the same behind a queue that takes one frame: ENOBUFS", {0}, 0, NULL, BUS_FULL},
    {"cable-in", "", "", "and is back", {0}, 0, NULL, BUS_CABLE_IN},
    {"down", "", "", "the interface goes down", {0}, 0, NULL, BUS_DOWN},
    {"up", "", "", "and up", {0}, 0, NULL, BUS_UP},
    {"unplug", "", "", "Modbus, slcan: the adapters and the hosts are gone", {0}, 0, NULL, BUS_UNPLUG},
    {"plug", "", "", "and back", {0}, 0, NULL, BUS_PLUG},
    {"relays-silent", "", "", "the board of relays on Modbus does not answer", {0}, 0, NULL, BUS_RELAYS_SILENT},
    {"relays-forget", "", "", "it opens all its relays by itself, as after a dip of its supply", {0}, 0, NULL, BUS_RELAYS_FORGET},
    {"relays-back", "", "", "it answers again", {0}, 0, NULL, BUS_RELAYS_BACK},
    {"estop", "s", "open|closed", "GPIO: the contact of the e-stop, which is closed while nobody presses it", {0, SWITCH_ESTOP}, 0, NULL, BUS_SWITCH},
    {"estop2", "s", "open|closed", "GPIO: its second channel", {0, SWITCH_ESTOP2}, 0, NULL, BUS_SWITCH},
    {"enable", "s", "open|closed", "GPIO: the enable key, closed while it is on", {0, SWITCH_ENABLE}, 0, NULL, BUS_SWITCH},
    {"reset", "s", "open|closed", "GPIO: the reset button, closed while it is pressed", {0, SWITCH_RESET}, 0, NULL, BUS_SWITCH},
    {"power", "s", "open|closed", "GPIO: the contact of the supply, closed while it is good", {0, SWITCH_POWER}, 0, NULL, BUS_SWITCH},
    {"chip-gone", "g", "SECTION", "GPIO: the chip with the lines of relays, inputs or healthy goes", {0}, 0, NULL, BUS_CHIP_GONE},
    {"chip-back", "g", "SECTION", "and is back", {0}, 0, NULL, BUS_CHIP_BACK},
};
/* clang-format on */

#define ROWS (sizeof k_rows / sizeof k_rows[0])

bool fault_describe(unsigned i, const char **name, const char **arguments, const char **help)
{
    if (i >= ROWS) {
        return false;
    }
    *name = k_rows[i].name;
    *arguments = k_rows[i].arguments[0] == '\0' ? NULL : k_rows[i].arguments;
    *help = k_rows[i].help;
    return true;
}

/* --- Reading --- */

static bool reject_form(const row_t *row, char why[FAULT_WHY_MAX])
{
    (void)snprintf(why, FAULT_WHY_MAX, "this is written as: %s%s%s", row->name, row->arguments[0] == '\0' ? "" : " ",
                   row->arguments);
    return false;
}

/* A word that is no drive. number: where it belongs if it is no object either. */
static bool read_word(fault_t *self, const row_t *row, char form, const char *word, double *number, char why[FAULT_WHY_MAX])
{
    switch (form) {
    case 'o':
        return fault_read_object(word, &self->object, why);
    case 's':
        return line_fault_read_state(word, number, why);
    case 'g':
        return line_fault_read_section(word, number, why);
    case 'q':
        return fault_read_quirk(word, number, why);
    default:
        return fault_read_number(word, row->most, number, why);
    }
}

static bool read_arguments(fault_t *self, const row_t *row, const char *at, unsigned drives, char why[FAULT_WHY_MAX])
{
    char word[FAULT_WORD_MAX];
    unsigned numbers = 0;
    for (const char *form = row->form; *form != '\0'; form++) {
        if (!fault_next_word(&at, word)) {
            if (*form == 'N' && at[strspn(at, " \t")] == '\0') {
                continue;
            }
            return reject_form(row, why);
        }
        if (!(*form == 'd' ? fault_read_drives(word, drives, &self->drives, why)
                           : read_word(self, row, *form, word, &self->number[numbers], why))) {
            return false;
        }
        numbers += *form != 'd' && *form != 'o';
    }
    return at[strspn(at, " \t")] == '\0' || reject_form(row, why);
}

bool fault_read(fault_t *self, const char *line, unsigned drives, char why[FAULT_WHY_MAX])
{
    char name[FAULT_WORD_MAX];
    const char *at = line;
    if (!fault_next_word(&at, name)) {
        (void)snprintf(why, FAULT_WHY_MAX, "no name of a fault; heave-twin --help lists them");
        return false;
    }
    for (unsigned i = 0; i < ROWS; i++) {
        if (strcmp(k_rows[i].name, name) == 0) {
            *self = (fault_t){.row = i, .number = {k_rows[i].fallback[0], k_rows[i].fallback[1]}};
            return read_arguments(self, &k_rows[i], at, drives, why);
        }
    }
    (void)snprintf(why, FAULT_WHY_MAX, "there is no fault %s; heave-twin --help lists them", name);
    return false;
}

/* What a name does to drives of that kind; NULL: they have no such fault. */
static fault_act_t act_on(const row_t *row, twin_drives_t kind)
{
    bool is_shared = false;
    fault_act_t act = NULL;
    if (kind == TWIN_DRIVES_CIA402) {
        return row->act == act_none ? NULL : row->act;
    }
    if (kind == TWIN_DRIVES_NONE) {
        return NULL;
    }
    act = kind == TWIN_DRIVES_MODBUS ? modbus_fault_find(row->name, &is_shared) : frame_fault_find(row->name, &is_shared);
    return is_shared ? row->act : act;
}

static bool suits_bus(const fault_t *self, bus_fault_t fault, const fault_machine_t *machine)
{
    const bool is_modbus = machine->kind == TWIN_DRIVES_MODBUS;
    return line_fault_is(fault)                ? line_fault_suits(self, fault, machine->lines)
           : modbus_fault_is_board(fault)      ? machine->has_board
           : modbus_fault_is_lines(fault)      ? is_modbus || machine->has_board || machine->has_adapter
           : machine->kind == TWIN_DRIVES_NONE ? false
                                               : !is_modbus || fault == BUS_CABLE_OUT || fault == BUS_CABLE_IN;
}

bool fault_suits(const fault_t *self, const fault_machine_t *machine, char why[FAULT_WHY_MAX])
{
    static const char *const k_drives[] = {"CiA 402 drives", "drives with CAN frames of their own", "drives on Modbus",
                                           "drives that heaved simulates"};
    const row_t *row = &k_rows[self->row];
    const bool is_right = row->act == NULL ? suits_bus(self, row->bus, machine) : act_on(row, machine->kind) != NULL;
    if (!is_right && row->act == NULL && line_fault_is(row->bus)) {
        (void)snprintf(why, FAULT_WHY_MAX, "%s: the configuration has no such GPIO line, or --no-gpio leaves it alone",
                       row->name);
    } else if (!is_right && row->act == NULL && modbus_fault_is_board(row->bus)) {
        (void)snprintf(why, FAULT_WHY_MAX, "%s: the configuration has no board of relays on Modbus", row->name);
    } else if (!is_right) {
        (void)snprintf(why, FAULT_WHY_MAX, "%s: %s have no such fault; docs/twin.md says which they have", row->name,
                       k_drives[machine->kind]);
    }
    return is_right;
}

bool fault_do(const fault_t *self, twin_t *twin, uint64_t now_us, char why[FAULT_WHY_MAX])
{
    const row_t *row = &k_rows[self->row];
    const fault_machine_t machine = {twin->kind, twin->modbus.board.is_there, twin->bus.has_adapter, twin->lines};
    if (!fault_suits(self, &machine, why)) {
        return false;
    }
    if (row->act == NULL && line_fault_is(row->bus)) {
        return line_fault_do(self, row->bus, twin->lines, why);
    }
    if (row->act == NULL && modbus_fault_do(&twin->modbus, row->bus) &&
        !(machine.has_adapter && modbus_fault_is_lines(row->bus))) {
        return true;
    }
    if (row->act == NULL) {
        return twin->bus.act(twin->bus.ctx, row->bus, (uint32_t)self->number[0], why, FAULT_WHY_MAX);
    }
    for (unsigned k = 0; k < twin->drives; k++) {
        if ((self->drives >> k & 1u) != 0 && self->object != 0 && object_of(twin, k, self) == NULL) {
            (void)snprintf(why, FAULT_WHY_MAX, "drive %u has no object %04X:%X; it has those of its start-up list", k + 1u,
                           (unsigned)self->object >> 8, (unsigned)self->object & 0xFFu);
            return false;
        }
        if ((self->drives >> k & 1u) != 0) {
            act_on(row, twin->kind)(twin, k, self, now_us);
        }
    }
    return true;
}
