/* SPDX-License-Identifier: MIT
 * cia402_objects.c - the table of objects; see cia402_objects.h.
 * The order is the one every known stack accepts: PDOs are switched off, then typed, then mapped from 0 to n, then switched on.
 */
#include "cia402_objects.h"

#define COB_INVALID 0x80000000u
#define COB_NO_RTR  0x40000000u
#define RPDO1       0x200u
#define TPDO1       0x180u
#define RAMP        1u /* 605Bh, 605Ch: slow down, then off */
#define QUICK_RAMP  2u /* 605Ah, 605Eh: by the quick-stop ramp, then off */
#define SYNCHRONOUS 1u /* PDO type: every SYNC */

/* clang-format off */ /* a row is a record */

/* A value that has to be taken; one that may be missing; one without which the drive would not stop by itself. */
#define MUST(at, sub_, size, deed_, from, number)     {.index = (at), .sub = (sub_), .bytes = (size), .deed = (deed_), .need = CIA402_MUST, \
     .source = (from), .constant = (number), .trouble = CIA402_NOT_TAKEN}
#define IF_THERE(at, sub_, size, deed_, from, number) {.index = (at), .sub = (sub_), .bytes = (size), .deed = (deed_), \
     .need = CIA402_IF_THERE, .source = (from), .constant = (number)}
#define GUARD(at, sub_, size, from, number)           {.index = (at), .sub = (sub_), .bytes = (size), .deed = CIA402_SET, \
     .need = CIA402_GUARD, .source = (from), .constant = (number), .trouble = CIA402_UNGUARDED}
#define ONLY(when_, at, sub_, size, deed_, from, number) {.index = (at), .sub = (sub_), .bytes = (size), .deed = (deed_), \
     .need = CIA402_MUST, .when = (when_), .source = (from), .constant = (number), .trouble = CIA402_NOT_TAKEN}
#define LIMIT(sub_) {.index = 0x607D, .sub = (sub_), .bytes = 4, .deed = CIA402_WRITE, .need = CIA402_IF_THERE, \
     .when = CIA402_IF_LIMITED, .source = CIA402_POSITION_LIMIT, .constant = (sub_) - 1u}
#define IDENTITY(sub_) {.index = 0x1018, .sub = (sub_), .bytes = 4, .deed = CIA402_CHECK, .when = CIA402_IF_NONZERO, \
     .source = CIA402_IDENTITY, .constant = (sub_) - 1u, .trouble = CIA402_WRONG_IDENTITY}

const cia402_object_t cia402_objects[] = {
    {.index = 0x1000, .bytes = 4, .deed = CIA402_CHECK, .constant = 0x0192, .trouble = CIA402_NOT_402},
    IDENTITY(1), IDENTITY(2), IDENTITY(3), IDENTITY(4),
    {.deed = CIA402_LIST, .constant = false},

    GUARD(0x1017, 0, 2, CIA402_HEARTBEAT, 0),
    {.deed = CIA402_PREOPERATIONAL, .need = CIA402_GUARD, .trouble = CIA402_NO_HEARTBEAT},
    GUARD(0x1016, 1, 4, CIA402_CONSUMER, 0),
    IF_THERE(0x1029, 1, 1, CIA402_WRITE, CIA402_CONSTANT, 0),
    IF_THERE(0x1006, 0, 4, CIA402_WRITE, CIA402_CONSTANT, 0), /* 1019h may be written only while this is 0 */
    {.index = 0x1019, .bytes = 1, .deed = CIA402_SET, .when = CIA402_IF_COUNTER, .source = CIA402_COUNTER, .trouble = CIA402_NOT_TAKEN},
    IF_THERE(0x1019, 0, 1, CIA402_WRITE, CIA402_COUNTER, 0),
    IF_THERE(0x1006, 0, 4, CIA402_WRITE, CIA402_SYNC_PERIOD, 0),

    MUST(0x1400, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    IF_THERE(0x1401, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    IF_THERE(0x1402, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    IF_THERE(0x1403, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    MUST(0x1800, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    IF_THERE(0x1801, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    IF_THERE(0x1802, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    IF_THERE(0x1803, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),

    MUST(0x1400, 2, 1, CIA402_WRITE, CIA402_CONSTANT, SYNCHRONOUS),
    MUST(0x1600, 0, 1, CIA402_WRITE, CIA402_CONSTANT, 0),
    MUST(0x1600, 1, 4, CIA402_WRITE, CIA402_CONSTANT, 0x60400010),
    MUST(0x1600, 2, 4, CIA402_WRITE, CIA402_TARGET_MAPPING, 0),
    MUST(0x1600, 0, 1, CIA402_WRITE, CIA402_CONSTANT, 2),
    MUST(0x1400, 1, 4, CIA402_PDO_ON, CIA402_RPDO_COB, 0),
    MUST(0x1400, 2, 1, CIA402_CHECK, CIA402_CONSTANT, SYNCHRONOUS),
    MUST(0x1600, 0, 1, CIA402_CHECK, CIA402_CONSTANT, 2),
    MUST(0x1600, 1, 4, CIA402_CHECK, CIA402_CONSTANT, 0x60400010),
    MUST(0x1600, 2, 4, CIA402_CHECK, CIA402_TARGET_MAPPING, 0),

    MUST(0x1800, 2, 1, CIA402_WRITE, CIA402_CONSTANT, SYNCHRONOUS),
    IF_THERE(0x1800, 3, 2, CIA402_WRITE, CIA402_CONSTANT, 0),
    IF_THERE(0x1800, 5, 2, CIA402_WRITE, CIA402_CONSTANT, 0),
    IF_THERE(0x1800, 6, 1, CIA402_WRITE, CIA402_CONSTANT, 0),
    MUST(0x1A00, 0, 1, CIA402_WRITE, CIA402_CONSTANT, 0),
    MUST(0x1A00, 1, 4, CIA402_WRITE, CIA402_CONSTANT, 0x60410010),
    MUST(0x1A00, 2, 4, CIA402_WRITE, CIA402_CONSTANT, 0x60640020),
    MUST(0x1A00, 3, 4, CIA402_WRITE, CIA402_CONSTANT, 0x60610008),
    MUST(0x1A00, 0, 1, CIA402_WRITE, CIA402_CONSTANT, 3),
    MUST(0x1800, 1, 4, CIA402_PDO_ON, CIA402_TPDO_COB, 0),
    MUST(0x1800, 2, 1, CIA402_CHECK, CIA402_CONSTANT, SYNCHRONOUS),
    MUST(0x1A00, 0, 1, CIA402_CHECK, CIA402_CONSTANT, 3),
    MUST(0x1A00, 1, 4, CIA402_CHECK, CIA402_CONSTANT, 0x60410010),
    MUST(0x1A00, 2, 4, CIA402_CHECK, CIA402_CONSTANT, 0x60640020),
    MUST(0x1A00, 3, 4, CIA402_CHECK, CIA402_CONSTANT, 0x60610008),

    GUARD(0x6007, 0, 2, CIA402_ABORT_OPTION, 0),
    GUARD(0x605A, 0, 2, CIA402_CONSTANT, QUICK_RAMP),
    IF_THERE(0x605B, 0, 2, CIA402_WRITE, CIA402_CONSTANT, RAMP),
    IF_THERE(0x605C, 0, 2, CIA402_WRITE, CIA402_CONSTANT, RAMP),
    GUARD(0x605E, 0, 2, CIA402_CONSTANT, QUICK_RAMP),
    {.index = 0x6085, .bytes = 4, .deed = CIA402_SET, .when = CIA402_IF_NONZERO, .source = CIA402_QUICK_STOP_ACCEL,
     .trouble = CIA402_NOT_TAKEN},
    GUARD(0x6065, 0, 4, CIA402_WINDOW, 0),
    IF_THERE(0x6066, 0, 2, CIA402_WRITE, CIA402_WINDOW_TIME, 0),
    LIMIT(1), LIMIT(2),
    ONLY(CIA402_IF_CYCLIC, 0x60C2, 2, 1, CIA402_SET, CIA402_PERIOD_EXPONENT, 0),
    ONLY(CIA402_IF_CYCLIC, 0x60C2, 1, 1, CIA402_SET, CIA402_PERIOD_VALUE, 0),
    {.index = 0x60C0, .bytes = 2, .deed = CIA402_WRITE, .need = CIA402_IF_THERE, .when = CIA402_IF_IP},
    ONLY(CIA402_IF_PP, 0x6081, 0, 4, CIA402_SET, CIA402_PROFILE_SPEED, 0),
    ONLY(CIA402_IF_PP, 0x6083, 0, 4, CIA402_SET, CIA402_PROFILE_ACCEL, 0),
    ONLY(CIA402_IF_PP, 0x6084, 0, 4, CIA402_SET, CIA402_PROFILE_ACCEL, 0),
    ONLY(CIA402_IF_HOMING, 0x6098, 0, 1, CIA402_SET, CIA402_HOMING_METHOD, 0),
    ONLY(CIA402_IF_HOMING, 0x6099, 1, 4, CIA402_SET, CIA402_HOMING_SPEED, 0),
    ONLY(CIA402_IF_HOMING, 0x6099, 2, 4, CIA402_SET, CIA402_HOMING_SPEED, 1),
    ONLY(CIA402_IF_HOMING, 0x609A, 0, 4, CIA402_SET, CIA402_HOMING_ACCEL, 0),
    ONLY(CIA402_IF_HOMING, 0x607C, 0, 4, CIA402_SET, CIA402_HOMING_OFFSET, 0),
    {.deed = CIA402_LIST, .constant = true},

    /* some drives act only on a mode that changes */
    IF_THERE(0x6060, 0, 1, CIA402_WRITE, CIA402_CONSTANT, 0),
    MUST(0x6060, 0, 1, CIA402_WRITE, CIA402_MODE, 0),
    {.index = 0x6061, .bytes = 1, .deed = CIA402_AWAIT, .source = CIA402_MODE, .trouble = CIA402_NO_MODE},

    IF_THERE(0x603F, 0, 2, CIA402_READ, CIA402_CONSTANT, 0),
};
/* clang-format on */

#define ROWS ((uint8_t)(sizeof cia402_objects / sizeof cia402_objects[0]))

const uint8_t cia402_objects_setup_end = ROWS - 1u;
const uint8_t cia402_objects_mode_begin = ROWS - 4u;
const uint8_t cia402_objects_error_begin = ROWS - 1u;
const uint8_t cia402_objects_error_end = ROWS;

bool cia402_period_parts(uint32_t period_us, uint8_t *value, int8_t *exponent)
{
    if (period_us == 0) {
        return false;
    }
    if (period_us % 1000u == 0 && period_us / 1000u <= UINT8_MAX) {
        *value = (uint8_t)(period_us / 1000u);
        *exponent = -3;
        return true;
    }
    if (period_us % 100u == 0 && period_us / 100u <= UINT8_MAX) {
        *value = (uint8_t)(period_us / 100u);
        *exponent = -4;
        return true;
    }
    return false;
}

bool cia402_is_period(uint32_t period_us)
{
    uint8_t value = 0;
    int8_t exponent = 0;
    return cia402_period_parts(period_us, &value, &exponent);
}

static bool is_list_row(const cia402_axis_config_t *axis, const cia402_setup_t *setup)
{
    const cia402_object_t *row = &cia402_objects[setup->row];
    return row->deed == CIA402_LIST && setup->item < axis->items && axis->item[setup->item].is_last == (row->constant != 0);
}

cia402_object_t cia402_objects_at(const cia402_axis_config_t *axis, const cia402_setup_t *setup)
{
    if (!is_list_row(axis, setup)) {
        return cia402_objects[setup->row];
    }
    const cia402_item_t *item = &axis->item[setup->item];
    const cia402_deed_t written = item->is_checked ? CIA402_SET : CIA402_WRITE;
    return (cia402_object_t){.index = item->index,
                             .sub = item->sub,
                             .bytes = item->bytes,
                             .deed = (uint8_t)(item->is_written ? written : CIA402_CHECK),
                             .need = item->is_optional ? CIA402_IF_THERE : CIA402_MUST,
                             .source = CIA402_ITEM,
                             .constant = item->value,
                             .trouble = CIA402_NOT_TAKEN};
}

void cia402_objects_next(const cia402_axis_config_t *axis, cia402_setup_t *setup)
{
    if (cia402_objects[setup->row].deed == CIA402_LIST && setup->item < axis->items) {
        setup->item++;
        return;
    }
    setup->row++;
    setup->item = 0;
}

static uint32_t source_value(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis,
                             const cia402_setup_t *setup)
{
    uint8_t period = 0;
    int8_t exponent = 0;
    (void)cia402_period_parts(config->period_us, &period, &exponent);
    switch ((cia402_source_t)row->source) {
    case CIA402_CONSTANT:
    case CIA402_ITEM:
        return row->constant;
    case CIA402_IDENTITY:
        return axis->identity[row->constant];
    case CIA402_CONSUMER:
        return (uint32_t)config->master_node << 16 | config->heartbeat_timeout_ms;
    case CIA402_HEARTBEAT:
        return config->heartbeat_ms;
    case CIA402_SYNC_PERIOD:
        return config->is_sync_watched ? config->period_us : 0;
    case CIA402_COUNTER:
        return config->sync_counter;
    case CIA402_RPDO_COB:
        return RPDO1 + axis->node;
    case CIA402_TPDO_COB:
        return TPDO1 + axis->node;
    case CIA402_TARGET_MAPPING:
        return config->mode == CIA402_MODE_IP ? 0x60C10120u : 0x607A0020u;
    case CIA402_ABORT_OPTION:
        return (uint32_t)config->abort_option;
    case CIA402_WINDOW:
        return axis->window_counts;
    case CIA402_WINDOW_TIME:
        return config->window_ms;
    case CIA402_POSITION_LIMIT:
        return (uint32_t)axis->limit_counts[row->constant];
    case CIA402_QUICK_STOP_ACCEL:
        return axis->quick_stop_accel;
    case CIA402_PERIOD_VALUE:
        return period;
    case CIA402_PERIOD_EXPONENT:
        return (uint32_t)exponent;
    case CIA402_HOMING_METHOD:
        return (uint32_t)axis->homing_method;
    case CIA402_HOMING_SPEED:
        return axis->homing_speed[row->constant];
    case CIA402_HOMING_ACCEL:
        return axis->homing_accel;
    case CIA402_HOMING_OFFSET:
        return (uint32_t)axis->homing_offset_counts;
    case CIA402_PROFILE_SPEED:
        return axis->profile_speed;
    case CIA402_PROFILE_ACCEL:
        return axis->profile_accel;
    case CIA402_MODE:
        return setup->mode;
    }
    return 0;
}

static uint32_t all_bits(uint8_t bytes)
{
    return bytes >= 4u ? UINT32_MAX : (1u << (8u * bytes)) - 1u;
}

uint32_t cia402_object_value(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis,
                             const cia402_setup_t *setup)
{
    const uint32_t value = source_value(row, config, axis, setup) & all_bits(row->bytes);
    if (row->deed == CIA402_PDO_OFF) {
        return setup->value | COB_INVALID;
    }
    return row->deed == CIA402_PDO_ON ? value | (setup->value & COB_NO_RTR) : value;
}

uint32_t cia402_object_mask(const cia402_object_t *row)
{
    return row->index == 0x1000u ? 0xFFFFu : all_bits(row->bytes);
}

bool cia402_object_is_guarding(const cia402_object_t *row, const cia402_config_t *config, uint32_t value)
{
    if (row->index == 0x1016u) {
        return value >> 16 == config->master_node && (value & 0xFFFFu) != 0;
    }
    return value != 0 && value != all_bits(row->bytes); /* all ones: no window, or -1, no reaction */
}

bool cia402_object_applies(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    if (row->deed == CIA402_LIST) {
        return false; /* no item, or one of the other row */
    }
    switch ((cia402_when_t)row->when) {
    case CIA402_ALWAYS:
        return true;
    case CIA402_IF_CYCLIC:
        return config->mode != CIA402_MODE_PP;
    case CIA402_IF_IP:
        return config->mode == CIA402_MODE_IP;
    case CIA402_IF_PP:
        return config->mode == CIA402_MODE_PP;
    case CIA402_IF_HOMING:
        return axis->homing_method != 0;
    case CIA402_IF_NONZERO:
        return cia402_object_value(row, config, axis, &(cia402_setup_t){.job = CIA402_JOB_NONE}) != 0;
    case CIA402_IF_COUNTER:
        return config->sync_counter != 0;
    case CIA402_IF_LIMITED:
        return axis->has_limits;
    }
    return false;
}

/* --- For others --- */

static cia402_wish_need_t need_of(const cia402_object_t *row)
{
    if (row->need == CIA402_GUARD) {
        return CIA402_WISH_GUARD;
    }
    return row->need == CIA402_MUST ? CIA402_WISH_NEEDED : CIA402_WISH_IF_THERE;
}

static bool is_written(const cia402_object_t *row)
{
    return row->deed == CIA402_WRITE || row->deed == CIA402_SET || row->deed == CIA402_PDO_OFF || row->deed == CIA402_PDO_ON;
}

bool cia402_next_wish(const cia402_config_t *config, unsigned axis, cia402_wish_t *wish)
{
    const cia402_axis_config_t *own = &config->axis[axis];
    cia402_setup_t at = {.row = wish->row, .item = wish->item, .mode = (uint8_t)config->mode};
    for (; at.row < cia402_objects_setup_end; cia402_objects_next(own, &at)) {
        const cia402_object_t row = cia402_objects_at(own, &at);
        if (row.index == 0 || !cia402_object_applies(&row, config, own)) {
            continue;
        }
        *wish = (cia402_wish_t){.index = row.index,
                                .sub = row.sub,
                                .bytes = row.bytes,
                                .value = source_value(&row, config, own, &at) & all_bits(row.bytes),
                                .is_written = is_written(&row),
                                .is_compared = row.deed != CIA402_WRITE && row.deed != CIA402_PDO_OFF,
                                .is_own = row.source != CIA402_ITEM,
                                .need = need_of(&row)};
        cia402_objects_next(own, &at);
        wish->row = at.row;
        wish->item = at.item;
        return true;
    }
    return false;
}

bool cia402_is_own_object(uint16_t index, uint8_t sub)
{
    for (uint8_t i = 0; i < cia402_objects_setup_end; i++) {
        const cia402_object_t *row = &cia402_objects[i];
        if (row->index == index && row->sub == sub && is_written(row)) {
            return true;
        }
    }
    return false;
}
