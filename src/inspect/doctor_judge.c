/* SPDX-License-Identifier: MIT
 * doctor_judge.c - findings from facts; see doctor_judge.h.
 */
#include "inspect/doctor_judge.h"

#include <inttypes.h>
#include <string.h>

#include "common/translate.h"
#include "heave/canopen_text.h"

#define QUEUE_LENGTH 16u
#define IDENTITY_ANY 0u

#define NODE_NAME_MAX 8u
#define OBJECTS       0x6000u
#define CHANNEL       0x800u /* from the objects of an axis to those of the next one of its node */
#define SECOND_AXIS   0x68000000u

const doctor_address_t doctor_address[DOCTOR_OBJECTS] = {
    [DOCTOR_TYPE] = {0x1000, 0},        [DOCTOR_VENDOR] = {0x1018, 1},         [DOCTOR_PRODUCT] = {0x1018, 2},
    [DOCTOR_REVISION] = {0x1018, 3},    [DOCTOR_SERIAL] = {0x1018, 4},         [DOCTOR_SERIAL_2] = {0x1018, 4},
    [DOCTOR_MODES] = {0x6502, 0},       [DOCTOR_STATUS] = {0x6041, 0},         [DOCTOR_ERROR] = {0x603F, 0},
    [DOCTOR_RPDO] = {0x1400, 1},        [DOCTOR_RPDO_MAP] = {0x1600, 0},       [DOCTOR_TPDO] = {0x1800, 1},
    [DOCTOR_TPDO_MAP] = {0x1A00, 0},    [DOCTOR_PERIOD_VALUE] = {0x60C2, 1},   [DOCTOR_PERIOD_EXPONENT] = {0x60C2, 2},
    [DOCTOR_SYNC_PERIOD] = {0x1006, 0}, [DOCTOR_CONSUMER] = {0x1016, 1},       [DOCTOR_PRODUCER] = {0x1017, 0},
    [DOCTOR_GUARD_TIME] = {0x100C, 0},  [DOCTOR_LIFE_FACTOR] = {0x100D, 0},    [DOCTOR_ABORT_OPTION] = {0x6007, 0},
    [DOCTOR_QUICK_STOP] = {0x605A, 0},  [DOCTOR_FAULT_REACTION] = {0x605E, 0}, [DOCTOR_WINDOW] = {0x6065, 0},
};

const uint16_t doctor_name_index[DOCTOR_NAMES] = {
    [DOCTOR_DEVICE] = 0x1008, [DOCTOR_HARDWARE] = 0x1009, [DOCTOR_SOFTWARE] = 0x100A};

/* --- The machine --- */

void doctor_judge_host(doctor_report_t *report, const doctor_host_t *host)
{
    if (host->is_realtime_allowed) {
        doctor_say(report, DOCTOR_OK, "real-time priority is permitted");
    } else {
        doctor_say(report, DOCTOR_WARN,
                   "no real-time priority for this user: cycles may be late -> start heaved by its systemd unit, "
                   "or LimitRTPRIO=50");
    }
    if (host->is_memory_lock_allowed) {
        doctor_say(report, DOCTOR_OK, "memory may be locked");
    } else {
        doctor_say(report, DOCTOR_WARN,
                   "memory may not be locked for this user -> start heaved by its systemd unit, or LimitMEMLOCK=infinity");
    }
    if (host->is_date_of_matter && !host->is_clock_trusted) {
        doctor_say(report, DOCTOR_WARN,
                   "the date may be wrong: this machine has no clock chip, and systemd-timesyncd has heard no time server; after "
                   "each start of the "
                   "machine the self-test is due again -> a clock chip with a battery, or a time server");
    }
}

/* --- The interface --- */

static void judge_settings(doctor_report_t *report, const char *name, const config_can_t *config, const linux_can_link_t *link)
{
    if (link->has_controller && link->bitrate != config->bitrate_bps) {
        doctor_say(report, DOCTOR_FAIL,
                   "%s runs at %u bit/s, [can] bitrate_bps = %u -> ip link set %s down && ip link set %s type can bitrate %u && "
                   "ip link set %s up",
                   name, link->bitrate, config->bitrate_bps, name, name, config->bitrate_bps, name);
    }
    if (link->has_controller && link->restart_ms != 0) {
        doctor_say(report, DOCTOR_FAIL,
                   "%s restarts by itself (restart-ms %u) and would send old set-points -> ip link set %s down && ip link set %s "
                   "type can restart-ms 0 "
                   "&& ip link set %s up",
                   name, link->restart_ms, name, name, name);
    }
    if (link->queue_length != QUEUE_LENGTH) {
        doctor_say(report, DOCTOR_WARN, "%s: txqueuelen is %u, not %u -> ip link set %s txqueuelen %u", name, link->queue_length,
                   QUEUE_LENGTH, name, QUEUE_LENGTH);
    }
}

static void judge_adapter(doctor_report_t *report, const char *name, const linux_can_link_t *link, const doctor_host_t *host)
{
    const bool is_old = host->kernel_major < 6 || (host->kernel_major == 6 && host->kernel_minor < 6);
    if (!link->has_echo) {
        doctor_say(
            report, DOCTOR_FAIL,
            "%s: no echo, heaved cannot see what has left -> another adapter (docs/can.md); for vcan: modprobe vcan echo=1",
            name);
    }
    if (is_old && strcmp(link->driver, "gs_usb") == 0) {
        doctor_say(report, DOCTOR_WARN, "%s: gs_usb of kernel %u.%u may reorder frames -> kernel 6.6 or newer", name,
                   host->kernel_major, host->kernel_minor);
    }
}

/* The controller, with its counters. False: nothing can be sent. */
static bool judge_state(doctor_report_t *report, const char *name, const linux_can_link_t *link)
{
    switch (link->state) {
    case HAL_CAN_BUS_OFF:
        doctor_say(report, DOCTOR_FAIL,
                   "%s is bus-off (errors tx %u rx %u, %u times bus-off) -> check wiring, 120 ohm at both ends and bit "
                   "rate; then ip link set %s down && ip link set %s up",
                   name, link->tx_errors, link->rx_errors, link->bus_offs, name, name);
        return false;
    case HAL_CAN_PASSIVE:
    case HAL_CAN_WARNING:
        doctor_say(report, link->state == HAL_CAN_PASSIVE ? DOCTOR_FAIL : DOCTOR_WARN,
                   _("%s is %s (errors tx %u rx %u) -> check wiring, 120 ohm at both ends, bit rate, and that a drive is on"),
                   name, link->state == HAL_CAN_PASSIVE ? "error-passive" : _("at its warning limit"), link->tx_errors,
                   link->rx_errors);
        return true;
    case HAL_CAN_ACTIVE:
    case HAL_CAN_DOWN:
    case HAL_CAN_GONE:
        break;
    }
    return true;
}

bool doctor_judge_link(doctor_report_t *report, const config_can_t *config, const linux_can_link_t *link,
                       const doctor_host_t *host)
{
    const char *name = config->interface;
    if (!link->is_can) {
        doctor_say(report, DOCTOR_FAIL, "%s is not a CAN interface -> [can] interface: one of `ip -br link show type can`", name);
        return false;
    }
    const unsigned before = report->count[DOCTOR_WARN] + report->count[DOCTOR_FAIL];
    judge_settings(report, name, config, link);
    judge_adapter(report, name, link, host);
    if (!link->is_up) {
        doctor_say(report, DOCTOR_FAIL, "%s is down -> ip link set %s up (for good: systemctl enable --now heave-can@%s)", name,
                   name, name);
        return false;
    }
    const bool is_on = judge_state(report, name, link);
    if (is_on && link->waiting > 0) {
        doctor_say(report, DOCTOR_FAIL,
                   "%s: %u frames wait in it: a program uses it, or nobody acknowledges -> end that program; or check cable and "
                   "supply of the drives, then ip link set %s down && ip link set %s up",
                   name, link->waiting, name, name);
        return false;
    }
    if (before == report->count[DOCTOR_WARN] + report->count[DOCTOR_FAIL]) {
        doctor_say(report, DOCTOR_OK, "%s is up%s%s", name, link->driver[0] != '\0' ? _(", driver ") : "", link->driver);
    }
    return is_on;
}

bool doctor_judge_wire(doctor_report_t *report, const config_can_t *config, const doctor_wire_t *wire)
{
    const char *name = config->interface;
    const bool is_disturbed = wire->state == HAL_CAN_PASSIVE || wire->state == HAL_CAN_BUS_OFF;
    if (wire->is_heard || (wire->unconfirmed == 0 && !wire->is_unacknowledged && !is_disturbed)) {
        return false;
    }
    doctor_say(
        report, DOCTOR_FAIL,
        "nobody acknowledges on %s (%s, errors tx %u rx %u): no drive is on, or none hears us -> supply of the drives, cable, "
        "120 ohm at both ends, CAN-H and CAN-L not exchanged, the drives set to [can] bitrate_bps = %u; then ip link set %s down "
        "&& ip link set %s up",
        name, is_disturbed ? wire->state == HAL_CAN_PASSIVE ? "error-passive" : "bus-off" : _("what was sent never left"),
        wire->tx_errors, wire->rx_errors, config->bitrate_bps, name, name);
    return true;
}

/* --- Drives --- */

/** A drive being judged. */
typedef struct {
    doctor_report_t *report;
    const cia402_config_t *config;
    const cia402_axis_config_t *axis;
    const doctor_node_t *node;
    char name[NODE_NAME_MAX];
} patient_t;

/* "2"; "2.1" where several axes share the node. */
static void put_node_name(const cia402_config_t *config, const cia402_axis_config_t *axis, char name[NODE_NAME_MAX])
{
    if (cia402_axis_of(config, axis->node, SECOND_AXIS) == config->axes) {
        (void)snprintf(name, NODE_NAME_MAX, "%u", axis->node);
    } else {
        (void)snprintf(name, NODE_NAME_MAX, "%u.%u", axis->node, axis->channel + 1u);
    }
}

/* As the axis has it. */
static unsigned index_of(const patient_t *self, doctor_object_t object)
{
    const unsigned index = doctor_address[object].index;
    return index >= OBJECTS ? index + self->axis->channel * CHANNEL : index;
}

static cia402_mode_t mode_of(const patient_t *self)
{
    return cia402_mode(self->config, (unsigned)(self->axis - self->config->axis));
}

static bool is_read(const patient_t *self, doctor_object_t object)
{
    return self->node->answer[object] == DOCTOR_READ;
}

static void judge_identity(const patient_t *self)
{
    static const struct {
        doctor_object_t object;
        unsigned at;
        const char *key;
    } k_parts[] = {{DOCTOR_VENDOR, 0, "vendor_id"},
                   {DOCTOR_PRODUCT, 1, "product_code"},
                   {DOCTOR_REVISION, 2, "revision_number"},
                   {DOCTOR_SERIAL, 3, "serial_numbers"}};
    for (unsigned i = 0; i < sizeof k_parts / sizeof k_parts[0]; i++) {
        const uint32_t wanted = self->axis->identity[k_parts[i].at];
        const uint32_t found = self->node->value[k_parts[i].object];
        if (wanted != IDENTITY_ANY && (!is_read(self, k_parts[i].object) || found != wanted)) {
            doctor_say(self->report, DOCTOR_FAIL,
                       "node %s: %s is %u (0x%X), configured %u -> the right drive, or [cia402] %s = %u", self->name,
                       k_parts[i].key, found, found, wanted, k_parts[i].key, found);
        }
    }
}

static void judge_uniqueness(const patient_t *self)
{
    const doctor_node_t *node = self->node;
    const bool is_alternating = is_read(self, DOCTOR_SERIAL) && is_read(self, DOCTOR_SERIAL_2) &&
                                node->value[DOCTOR_SERIAL] != node->value[DOCTOR_SERIAL_2];
    if (node->extra_answers > 0 || is_alternating) {
        doctor_say(self->report, DOCTOR_FAIL,
                   "node %s answers twice: two drives have this number -> give one of them another number at the drive",
                   self->name);
    }
}

static void judge_mode(const patient_t *self)
{
    static const char *const k_names[] = {[CIA402_MODE_PP] = "pp", [CIA402_MODE_IP] = "ip", [CIA402_MODE_CSP] = "csp"};
    const uint32_t modes = self->node->value[DOCTOR_MODES];
    const char *usable = (modes & 0x80u) != 0 ? "csp" : (modes & 0x40u) != 0 ? "ip" : (modes & 1u) != 0 ? "pp" : NULL;
    if (!is_read(self, DOCTOR_MODES) || (modes >> ((unsigned)mode_of(self) - 1u) & 1u) != 0) {
        return;
    }
    if (usable == NULL) {
        doctor_say(self->report, DOCTOR_FAIL, "node %s: none of csp, ip and pp (6502h = 0x%X) -> another drive", self->name,
                   modes);
        return;
    }
    doctor_say(self->report, DOCTOR_FAIL, "node %s does not have mode %s (6502h = 0x%X) -> [cia402] mode = %s", self->name,
               k_names[mode_of(self)], modes, usable);
}

/* Objects without which it cannot be set up. Whether they take a value only writing shows, which heaved does when it starts. */
static void judge_objects(const patient_t *self)
{
    static const doctor_object_t k_needed[] = {DOCTOR_RPDO, DOCTOR_RPDO_MAP, DOCTOR_TPDO, DOCTOR_TPDO_MAP, DOCTOR_PERIOD_VALUE};
    for (unsigned i = 0; i < sizeof k_needed / sizeof k_needed[0]; i++) {
        const doctor_object_t object = k_needed[i];
        if (is_read(self, object) || (object == DOCTOR_PERIOD_VALUE && mode_of(self) == CIA402_MODE_PP)) {
            continue;
        }
        doctor_say(self->report, DOCTOR_FAIL, "node %s: %04Xh cannot be read: %s -> %s", self->name, index_of(self, object),
                   self->node->answer[object] == DOCTOR_REFUSED ? translate(canopen_abort_text(self->node->value[object]))
                                                                : _("no answer"),
                   object == DOCTOR_PERIOD_VALUE ? _("[cia402] mode = pp, or another drive")
                                                 : _("a drive whose PDOs can be mapped"));
    }
}

static bool is_guarding(const patient_t *self, doctor_object_t object)
{
    const uint32_t value = self->node->value[object];
    if (object == DOCTOR_CONSUMER) {
        return (value >> 16 & 0x7Fu) == self->config->master_node && (value & 0xFFFFu) != 0;
    }
    return value != 0 && (object != DOCTOR_WINDOW || value != UINT32_MAX);
}

/* Of heartbeats where nodes are guarded, or of guarding where there are heartbeats. */
static bool is_other_control(const patient_t *self, doctor_object_t object)
{
    return self->config->is_guarded ? object == DOCTOR_CONSUMER || object == DOCTOR_PRODUCER
                                    : object == DOCTOR_GUARD_TIME || object == DOCTOR_LIFE_FACTOR;
}

/* Missing guards are wrong; those that are off at power-up are what heaved switches on. */
static void judge_guards(const patient_t *self)
{
    char off[64] = "";
    for (unsigned object = DOCTOR_CONSUMER; object <= DOCTOR_WINDOW; object++) {
        const unsigned index = index_of(self, object);
        if (is_other_control(self, object)) {
            continue;
        }
        if (!is_read(self, object)) {
            doctor_say(self->report, cia402_accepts_without(self->config, (uint16_t)index) ? DOCTOR_WARN : DOCTOR_FAIL,
                       _("node %s has no watchdog %04Xh -> another drive, or [cia402] accept_without = %04X where it has been "
                         "tried that "
                         "the drive stops without it"),
                       self->name, index, index);
        } else if (!is_guarding(self, object)) {
            const size_t length = strlen(off);
            (void)snprintf(off + length, sizeof off - length, " %04Xh", index);
        }
    }
    if (off[0] != '\0') {
        doctor_say(self->report, DOCTOR_OK, "node %s: watchdogs off until heaved sets them at its start:%s", self->name, off);
    }
}

/* What the drive has now; heaved writes its own. Only a leftover of another master is worth a word. */
static void judge_period(const patient_t *self)
{
    const uint32_t sync_us = self->node->value[DOCTOR_SYNC_PERIOD];
    if (is_read(self, DOCTOR_SYNC_PERIOD) && sync_us != 0 && sync_us != self->config->period_us) {
        doctor_say(self->report, DOCTOR_WARN,
                   "node %s: 1006h is %u us, [cia402] period_us = %u -> nothing, heaved sets it when it starts", self->name,
                   sync_us, self->config->period_us);
    }
}

static void judge_state_machine(const patient_t *self)
{
    const char *number = self->name;
    const uint16_t status = (uint16_t)self->node->value[DOCTOR_STATUS];
    const uint16_t error = (uint16_t)self->node->value[DOCTOR_ERROR];
    if (!is_read(self, DOCTOR_STATUS)) {
        doctor_say(self->report, DOCTOR_FAIL, "node %s: 6041h (its state) cannot be read -> another drive", number);
        return;
    }
    const cia402_state_t state = cia402_state(status);
    if (state == CIA402_FAULT || state == CIA402_FAULT_REACTION) {
        doctor_say(self->report, DOCTOR_FAIL,
                   "node %s is in fault, 603Fh = %04Xh: %s -> mend the cause, start heaved, then heavectl reset", number, error,
                   is_read(self, DOCTOR_ERROR) ? translate(canopen_error_text(error)) : _("not to be read"));
    } else if (cia402_has_torque(state)) {
        doctor_say(self->report, DOCTOR_FAIL, "node %s has torque (%s) without heaved -> end the other master", number,
                   translate(cia402_state_name(state)));
    } else if ((status & CIA402_STATUS_REMOTE) == 0) {
        doctor_say(self->report, DOCTOR_WARN,
                   "node %s: remote is off (6041h bit 9) -> give control to the bus at the drive or in its maker's program",
                   number);
    }
}

static const char *nmt_name(int state)
{
    switch (state) {
    case -1:
        return _("no heartbeat yet");
    case 0:
        return _("booted just now");
    case 4:
        return _("stopped");
    case 5:
        return _("operational");
    case 127:
        return _("pre-operational");
    default:
        return _("of an unknown NMT state");
    }
}

void doctor_judge_node(doctor_report_t *report, const cia402_config_t *config, unsigned axis, const doctor_node_t *node)
{
    patient_t self = {.report = report, .config = config, .axis = &config->axis[axis], .node = node};
    put_node_name(config, self.axis, self.name);
    const char *number = self.name;
    const unsigned before = report->count[DOCTOR_FAIL];
    if (node->answer[DOCTOR_TYPE] == DOCTOR_NO_ANSWER) {
        doctor_say(report, DOCTOR_FAIL, "node %s (drive %u) does not answer -> its supply, cable, node number and bit rate%s%s",
                   number, axis + 1u, node->nmt >= 0 ? _("; it is there: heartbeat ") : "",
                   node->nmt >= 0 ? nmt_name(node->nmt) : "");
        return;
    }
    if (!is_read(&self, DOCTOR_TYPE) || (node->value[DOCTOR_TYPE] & 0xFFFFu) != 402u) {
        doctor_say(report, DOCTOR_FAIL, "node %s is no CiA 402 drive (1000h = 0x%X) -> [cia402] nodes, or driver = can-raw",
                   number, node->value[DOCTOR_TYPE]);
        return;
    }
    judge_identity(&self);
    judge_uniqueness(&self);
    judge_mode(&self);
    judge_objects(&self);
    judge_guards(&self);
    judge_period(&self);
    judge_state_machine(&self);
    if (before == report->count[DOCTOR_FAIL]) {
        doctor_say(report, DOCTOR_OK, "node %s (drive %u): vendor 0x%X product 0x%X, %s, %s", number, axis + 1u,
                   node->value[DOCTOR_VENDOR], node->value[DOCTOR_PRODUCT],
                   translate(cia402_state_name(cia402_state((uint16_t)node->value[DOCTOR_STATUS]))), nmt_name(node->nmt));
    }
}

/* --- Inventory --- */

void doctor_copy_name(char name[DOCTOR_NAME_MAX], const uint8_t *bytes, size_t length)
{
    size_t at = 0;
    for (; at < length && at < DOCTOR_NAME_MAX - 1u && bytes[at] != 0; at++) {
        name[at] = '?';
        if (bytes[at] >= ' ' && bytes[at] <= '~') {
            name[at] = (char)bytes[at];
        }
    }
    while (at > 0 && name[at - 1u] == ' ') {
        at--;
    }
    name[at] = '\0';
}

static bool is_drive(const doctor_node_t *node)
{
    return node->answer[DOCTOR_TYPE] == DOCTOR_READ && (node->value[DOCTOR_TYPE] & 0xFFFFu) == 402u;
}

/* A key for all of them where they agree: a number that is 0 means any. */
static void write_common(FILE *out, const char *key, doctor_object_t object, unsigned axes, const doctor_node_t *node)
{
    uint32_t common = 0;
    for (unsigned k = 0; k < axes; k++) {
        const uint32_t own = node[k].answer[object] == DOCTOR_READ ? node[k].value[object] : 0;
        if (is_drive(&node[k]) && common != 0 && own != common) {
            (void)fprintf(out, _("; %s: they differ\n"), key);
            return;
        }
        common = is_drive(&node[k]) ? own : common;
    }
    if (common != 0) {
        (void)fprintf(out, "%s = 0x%X\n", key, common);
    }
}

static void write_drive(FILE *out, const char *number, unsigned axis, const doctor_node_t *node)
{
    if (!is_drive(node)) {
        (void)fprintf(out, _("; drive %u, node %s: not found\n"), axis + 1u, number);
        return;
    }
    (void)fprintf(out, _("; drive %u, node %s: %s, hardware %s, software %s, revision 0x%X\n"), axis + 1u, number,
                  node->name[DOCTOR_DEVICE][0] != '\0' ? node->name[DOCTOR_DEVICE] : _("(no name)"),
                  node->name[DOCTOR_HARDWARE][0] != '\0' ? node->name[DOCTOR_HARDWARE] : _("(not told)"),
                  node->name[DOCTOR_SOFTWARE][0] != '\0' ? node->name[DOCTOR_SOFTWARE] : _("(not told)"),
                  node->answer[DOCTOR_REVISION] == DOCTOR_READ ? node->value[DOCTOR_REVISION] : 0);
}

void doctor_write_inventory(FILE *out, const cia402_config_t *config, const doctor_node_t node[DRIVES_MAX])
{
    bool is_any = false;
    bool has_serial = false;
    for (unsigned k = 0; k < config->axes; k++) {
        is_any |= is_drive(&node[k]);
        has_serial |= is_drive(&node[k]) && node[k].answer[DOCTOR_SERIAL] == DOCTOR_READ && node[k].value[DOCTOR_SERIAL] != 0;
    }
    if (!is_any) {
        return;
    }
    (void)fprintf(out, _("\n; the drives that were found, for [cia402]: a drive that is exchanged is then refused by name\n"));
    for (unsigned k = 0; k < config->axes; k++) {
        char name[NODE_NAME_MAX];
        put_node_name(config, &config->axis[k], name);
        write_drive(out, name, k, &node[k]);
    }
    write_common(out, "vendor_id", DOCTOR_VENDOR, config->axes, node);
    write_common(out, "product_code", DOCTOR_PRODUCT, config->axes, node);
    for (unsigned k = 0; has_serial && k < config->axes; k++) {
        const bool is_known = is_drive(&node[k]) && node[k].answer[DOCTOR_SERIAL] == DOCTOR_READ;
        (void)fprintf(out, "%s0x%X", k == 0 ? "serial_numbers = " : ", ", is_known ? node[k].value[DOCTOR_SERIAL] : 0);
    }
    (void)fprintf(out, "%s\n", has_serial ? "\n" : "");
}
