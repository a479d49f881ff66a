/* SPDX-License-Identifier: MIT
 * cia402_objects.c - the table of objects; see cia402_objects.h.
 * The order is the one every known stack accepts: PDOs are switched off, then typed, then mapped from 0 to n, then switched on.
 */
#include "cia402_objects.h"

#include "cia402_map.h"
#include "cia402_pdo_rows.h"

#define COB_INVALID 0x80000000u
#define COB_NO_RTR  0x40000000u
#define RECORDS     0x1400u
#define RECORDS_END 0x1C00u
#define OBJECTS     0x6000u
#define CHANNEL     0x800u
#define TPDOS       0x1800u
#define CONSUMER    0x1016u
#define GUARD_TIME  0x100Cu
#define LIFE_FACTOR 0x100Du
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
/* An object that a node has once, whatever its channels. */
#define NODE(at, sub_, size, deed_, need_, trouble_, from) {.index = (at), .sub = (sub_), .bytes = (size), .deed = (deed_), \
     .need = (need_), .when = CIA402_IF_FIRST, .source = (from), .trouble = (trouble_)}
/* What both sides are watched by. */
#define LIFE(when_, at, sub_, size, from) {.index = (at), .sub = (sub_), .bytes = (size), .deed = CIA402_SET, .need = CIA402_GUARD, \
     .when = (when_), .source = (from), .trouble = CIA402_UNGUARDED}
/* A PDO that may be there and is not wanted. */
#define SPARE(at) {.index = (at), .sub = 1, .bytes = 4, .deed = CIA402_PDO_OFF, .need = CIA402_IF_THERE, .when = CIA402_IF_OWN_RECORD}
/* Stands for the rows that set a PDO up. */
#define PDO(which) {.deed = CIA402_PDO, .constant = (which)}
#define LIMIT(sub_) {.index = 0x607D, .sub = (sub_), .bytes = 4, .deed = CIA402_WRITE, .need = CIA402_IF_THERE, \
     .when = CIA402_IF_LIMITED, .source = CIA402_POSITION_LIMIT, .constant = (sub_) - 1u}
#define IDENTITY(sub_) {.index = 0x1018, .sub = (sub_), .bytes = 4, .deed = CIA402_CHECK, .when = CIA402_IF_IDENTITY, \
     .source = CIA402_IDENTITY, .constant = (sub_) - 1u, .trouble = CIA402_WRONG_IDENTITY}

const cia402_object_t cia402_objects[] = {
    {.index = 0x1000, .bytes = 4, .deed = CIA402_CHECK, .when = CIA402_IF_FIRST, .constant = 0x0192, .trouble = CIA402_NOT_402},
    IDENTITY(1), IDENTITY(2), IDENTITY(3), IDENTITY(4),
    {.deed = CIA402_LIST, .constant = false},
    {.index = 0x6502, .bytes = 4, .deed = CIA402_HAS, .need = CIA402_IF_ANSWERED, .when = CIA402_IF_SUPPORT, .source = CIA402_MODE_BITS,
     .trouble = CIA402_NO_SUCH_MODE},
    {.index = 0x60E3, .bytes = 1, .deed = CIA402_LISTED, .need = CIA402_IF_ANSWERED, .when = CIA402_IF_STANDARD_HOMING,
     .source = CIA402_HOMING_METHOD, .trouble = CIA402_NO_SUCH_HOMING},

    LIFE(CIA402_IF_HEARTBEAT, 0x1017, 0, 2, CIA402_HEARTBEAT),
    {.index = 0x1017, .bytes = 2, .deed = CIA402_WRITE, .need = CIA402_IF_THERE, .when = CIA402_IF_GUARDED}, /* not both */
    LIFE(CIA402_IF_GUARDED, GUARD_TIME, 0, 2, CIA402_HEARTBEAT),
    LIFE(CIA402_IF_GUARDED, LIFE_FACTOR, 0, 1, CIA402_LIFE_FACTOR),
    {.deed = CIA402_PREOPERATIONAL, .need = CIA402_GUARD, .when = CIA402_IF_FIRST, .trouble = CIA402_NO_HEARTBEAT},
    LIFE(CIA402_IF_HEARTBEAT, CONSUMER, 1, 4, CIA402_CONSUMER),
    NODE(0x1029, 1, 1, CIA402_WRITE, CIA402_IF_THERE, 0, CIA402_CONSTANT),
    NODE(0x1006, 0, 4, CIA402_WRITE, CIA402_IF_THERE, 0, CIA402_CONSTANT), /* 1019h may be written only while this is 0 */
    {.index = 0x1019, .bytes = 1, .deed = CIA402_SET, .when = CIA402_IF_COUNTER, .source = CIA402_COUNTER, .trouble = CIA402_NOT_TAKEN},
    NODE(0x1019, 0, 1, CIA402_WRITE, CIA402_IF_THERE, 0, CIA402_COUNTER),
    NODE(0x1006, 0, 4, CIA402_WRITE, CIA402_IF_THERE, 0, CIA402_SYNC_PERIOD),

    MUST(0x1400, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    SPARE(0x1401), SPARE(0x1402), SPARE(0x1403),
    MUST(0x1800, 1, 4, CIA402_PDO_OFF, CIA402_CONSTANT, 0),
    SPARE(0x1801), SPARE(0x1802), SPARE(0x1803),

    PDO(CIA402_COMMAND), PDO(CIA402_COMMAND + 1), PDO(CIA402_COMMAND + 2),
    PDO(CIA402_ANSWER), PDO(CIA402_ANSWER + 1), PDO(CIA402_ANSWER + 2),
    PDO(CIA402_TELEMETRY), PDO(CIA402_TELEMETRY + 1),

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

    /* a fault that keeps the drive from becoming operational: no PDO can reset it */
    IF_THERE(0x6040, 0, 2, CIA402_WRITE, CIA402_CONSTANT, 0),
    IF_THERE(0x6040, 0, 2, CIA402_WRITE, CIA402_CONSTANT, CIA402_WORD_RESET),
    {.deed = CIA402_PAUSE},
    IF_THERE(0x6040, 0, 2, CIA402_WRITE, CIA402_CONSTANT, 0),
};
/* clang-format on */

#define ROWS ((uint8_t)(sizeof cia402_objects / sizeof cia402_objects[0]))

const uint8_t cia402_objects_setup_end = ROWS - 5u;
const uint8_t cia402_objects_mode_begin = ROWS - 8u;
const uint8_t cia402_objects_error_begin = ROWS - 5u;
const uint8_t cia402_objects_reset_begin = ROWS - 4u;
const uint8_t cia402_objects_end = ROWS;

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

/* --- Rows that stand for several --- */

static bool is_list_row(const cia402_axis_config_t *axis, const cia402_setup_t *setup)
{
    const cia402_object_t *row = &cia402_objects[setup->row];
    return row->deed == CIA402_LIST && setup->item < axis->items && axis->item[setup->item].is_last == (row->constant != 0);
}

static cia402_object_t list_row(const cia402_item_t *item)
{
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

static unsigned index_of(const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    return (unsigned)(axis - config->axis);
}

/* As the axis has it: records of its channel, and objects at their distance. */
static uint16_t index_in_channel(uint16_t index, const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    if (index >= OBJECTS) {
        return (uint16_t)(index + axis->channel * CHANNEL);
    }
    const unsigned step = config->pdo_step != 0 ? config->pdo_step : 64u;
    return (uint16_t)(index >= RECORDS && index < RECORDS_END ? index + axis->channel * step : index);
}

/* The first PDOs of each channel are switched off by rows of their own, whether they are used or not. */
static bool is_off_already(const cia402_config_t *config, const cia402_axis_config_t *axis, uint16_t record)
{
    const unsigned first = index_in_channel(record >= TPDOS ? TPDOS : RECORDS, config, axis);
    return record >= first && record - first < CIA402_PDOS_USUAL;
}

/* The other axes of a node whose PDOs are of the whole node may have no records at all. */
static bool may_have_no_record(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    const cia402_maps_t *maps = row->index >= TPDOS ? &config->answers : &config->commands;
    return row->deed == CIA402_PDO_OFF && axis->channel > 0 && cia402_map_is_shared(maps);
}

cia402_object_t cia402_objects_at(const cia402_config_t *config, const cia402_axis_config_t *axis, const cia402_setup_t *setup)
{
    cia402_object_t row = cia402_objects[setup->row];
    if (is_list_row(axis, setup)) {
        row = list_row(&axis->item[setup->item]);
    } else if (row.deed == CIA402_PDO) {
        const cia402_pdo_t pdo = cia402_pdo(config, index_of(config, axis), row.constant);
        return cia402_pdo_row(&pdo, setup->item, is_off_already(config, axis, pdo.record));
    }
    if (may_have_no_record(&row, config, axis)) {
        row.need = CIA402_IF_THERE;
    }
    row.index = row.index != 0 ? index_in_channel(row.index, config, axis) : 0;
    return row;
}

void cia402_objects_next(const cia402_config_t *config, const cia402_axis_config_t *axis, cia402_setup_t *setup)
{
    const cia402_object_t *row = &cia402_objects[setup->row];
    unsigned items = row->deed == CIA402_LIST ? axis->items : 0;
    if (row->deed == CIA402_PDO) {
        const cia402_pdo_t pdo = cia402_pdo(config, index_of(config, axis), row->constant);
        items = cia402_pdo_rows(&pdo);
    }
    if (setup->item < items) {
        setup->item++;
        return;
    }
    setup->row++;
    setup->item = 0;
}

static uint32_t mode_bits(const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    const uint32_t homing = axis->homing_method != 0 ? 1u << ((uint32_t)CIA402_MODE_HOMING - 1u) : 0;
    return homing | 1u << ((uint32_t)cia402_mode(config, index_of(config, axis)) - 1u);
}

/* Requests that a drive may miss: at least the time that we are allowed to be silent. */
static uint32_t life_factor(const cia402_config_t *config, uint32_t guard_ms)
{
    const uint32_t factor = (config->heartbeat_timeout_ms + guard_ms - 1u) / guard_ms;
    return factor < UINT8_MAX ? factor : UINT8_MAX;
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
    case CIA402_LIFE_FACTOR:
        return life_factor(config, setup->guard_ms != 0 ? setup->guard_ms : config->heartbeat_ms);
    case CIA402_SYNC_PERIOD:
        return config->is_sync_watched ? config->period_us : 0;
    case CIA402_COUNTER:
        return config->sync_counter;
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
    case CIA402_MODE_BITS:
        return mode_bits(config, axis);
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

/* A length in a map has at most 64 bits. Some drives mark signed objects with bit 7 of it. */
uint32_t cia402_object_mask(const cia402_object_t *row)
{
    const bool is_mapping = row->index >= RECORDS && row->index < RECORDS_END && (row->index & 0x200u) != 0 && row->sub > 0;
    return row->index == 0x1000u ? 0xFFFFu : is_mapping ? ~0x80u : all_bits(row->bytes);
}

bool cia402_object_is_late(const cia402_object_t *row, const cia402_config_t *config, const cia402_setup_t *setup, uint32_t value)
{
    const uint64_t life_ms = (uint64_t)config->heartbeat_ms * life_factor(config, config->heartbeat_ms);
    switch (row->index) {
    case CONSUMER:
        return (value & 0xFFFFu) > 2u * config->heartbeat_timeout_ms;
    case GUARD_TIME: /* with a life factor of 1 at least */
        return value > 2u * life_ms;
    case LIFE_FACTOR:
        return (uint64_t)value * setup->guard_ms > 2u * life_ms;
    default:
        return false;
    }
}

bool cia402_object_is_guarding(const cia402_object_t *row, const cia402_config_t *config, const cia402_setup_t *setup,
                               uint32_t value)
{
    if (cia402_object_is_late(row, config, setup, value)) {
        return false;
    }
    if (row->index == CONSUMER) {
        return value >> 16 == config->master_node && (value & 0xFFFFu) != 0;
    }
    return value != 0 && value != all_bits(row->bytes); /* all ones: no window, or -1, no reaction */
}

/* Not one of the next channel, where channels have less than the usual records. */
static bool is_own_record(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    const unsigned step = config->pdo_step != 0 ? config->pdo_step : 64u;
    const unsigned channel = (row->index & 0xFFu) / step;
    const uint32_t entry = (OBJECTS + CHANNEL * channel) << 16;
    return channel == axis->channel || cia402_axis_of(config, axis->node, entry) == config->axes;
}

bool cia402_object_applies(const cia402_object_t *row, const cia402_config_t *config, const cia402_axis_config_t *axis)
{
    if (row->deed == CIA402_LIST || row->deed == CIA402_SKIP) {
        return false; /* no item, or one of the other row */
    }
    const cia402_mode_t mode = cia402_mode(config, index_of(config, axis));
    switch ((cia402_when_t)row->when) {
    case CIA402_ALWAYS:
        return true;
    case CIA402_IF_FIRST:
        return axis->channel == 0;
    case CIA402_IF_HEARTBEAT:
        return axis->channel == 0 && !config->is_guarded;
    case CIA402_IF_GUARDED:
        return axis->channel == 0 && config->is_guarded;
    case CIA402_IF_CYCLIC:
        return mode != CIA402_MODE_PP;
    case CIA402_IF_IP:
        return mode == CIA402_MODE_IP;
    case CIA402_IF_PP:
        return mode == CIA402_MODE_PP;
    case CIA402_IF_HOMING:
        return axis->homing_method != 0;
    case CIA402_IF_NONZERO:
        return cia402_object_value(row, config, axis, &(cia402_setup_t){.job = CIA402_JOB_NONE}) != 0;
    case CIA402_IF_IDENTITY:
        return axis->channel == 0 && axis->identity[row->constant] != 0;
    case CIA402_IF_COUNTER:
        return axis->channel == 0 && config->sync_counter != 0;
    case CIA402_IF_LIMITED:
        return axis->has_limits;
    case CIA402_IF_OWN_RECORD:
        return is_own_record(row, config, axis);
    case CIA402_IF_SUPPORT:
        return config->is_support_checked;
    case CIA402_IF_STANDARD_HOMING: /* makers leave methods of their own out of the list */
        return config->is_support_checked && axis->homing_method > 0;
    }
    return false;
}

/* --- For others --- */

bool cia402_accepts_without(const cia402_config_t *config, uint16_t index)
{
    static const uint16_t k_guards[CIA402_GUARDS] = {
        [CIA402_GUARD_CONSUMER] = 0x1016, [CIA402_GUARD_PRODUCER] = 0x1017,   [CIA402_GUARD_TIME] = 0x100C,
        [CIA402_GUARD_LIFE] = 0x100D,     [CIA402_GUARD_CONNECTION] = 0x6007, [CIA402_GUARD_QUICK_STOP] = 0x605A,
        [CIA402_GUARD_FAULT] = 0x605E,    [CIA402_GUARD_WINDOW] = 0x6065,
    };
    for (unsigned i = 0; i < CIA402_GUARDS; i++) {
        if (k_guards[i] == cia402_plain_index(index)) {
            return (config->accepted_without >> i & 1u) != 0;
        }
    }
    return false;
}

static cia402_wish_need_t need_of(const cia402_object_t *row)
{
    if (row->need == CIA402_GUARD) {
        return CIA402_WISH_GUARD;
    }
    return row->need == CIA402_MUST ? CIA402_WISH_NEEDED : CIA402_WISH_IF_THERE;
}

/* What is asked of the drive, not wished of it. */
static bool is_question(const cia402_object_t *row)
{
    return row->deed == CIA402_HAS || row->deed == CIA402_LISTED;
}

static bool is_written(const cia402_object_t *row)
{
    return row->deed == CIA402_WRITE || row->deed == CIA402_SET || row->deed == CIA402_PDO_OFF || row->deed == CIA402_PDO_ON;
}

bool cia402_next_wish(const cia402_config_t *config, unsigned axis, cia402_wish_t *wish)
{
    const cia402_axis_config_t *own = &config->axis[axis];
    cia402_setup_t at = {.row = wish->row, .item = wish->item, .mode = (uint8_t)cia402_mode(config, axis)};
    for (; at.row < cia402_objects_setup_end; cia402_objects_next(config, own, &at)) {
        const cia402_object_t row = cia402_objects_at(config, own, &at);
        if (row.index == 0 || is_question(&row) || !cia402_object_applies(&row, config, own)) {
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
        cia402_objects_next(config, own, &at);
        wish->row = at.row;
        wish->item = at.item;
        return true;
    }
    return false;
}

/* A row that writes it, of those that count always, or of any. */
static bool is_set_by_row(uint16_t index, uint8_t sub, bool is_always)
{
    if (index >= RECORDS && index < RECORDS_END && (index & 0x3Fu) < CIA402_PDOS_USUAL) { /* whichever of them are in use */
        return true;
    }
    index = cia402_plain_index(index);
    for (uint8_t i = 0; i < cia402_objects_setup_end; i++) {
        const cia402_object_t *row = &cia402_objects[i];
        if (row->index == index && row->sub == sub && is_written(row) && (!is_always || row->when == CIA402_ALWAYS)) {
            return true;
        }
    }
    return false;
}

bool cia402_is_own_object(uint16_t index, uint8_t sub)
{
    return is_set_by_row(index, sub, false);
}

bool cia402_is_always_own(uint16_t index, uint8_t sub)
{
    return is_set_by_row(index, sub, true);
}
