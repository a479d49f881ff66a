/* SPDX-License-Identifier: MIT
 * canopen_objects.c - see canopen_objects.h.
 */
#include "common/canopen_objects.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "heave/canopen_text.h"
#include "heave/cia402.h"
#include "heave/cia402_state.h"

#define HEX        "0123456789ABCDEFabcdef"
#define AXIS_FIRST 0x6000u
#define AXIS_LAST  0x67FFu
#define AXIS_STEP  0x800u

/* clang-format off */ /* a row is a record */
#define ROW(at, from, to, kind, good, text) {.index = (at), .sub = (from), .last = (to), .type = CANOPEN_##kind, .use = (good), .name = (text)}
#define NO 0
#define SHOW CANOPEN_SHOWN
#define SET CANOPEN_SETTING

const canopen_object_t canopen_objects[] = {
    ROW(0x1000, 0, 0, U32, SHOW, "device type"),
    ROW(0x1001, 0, 0, U8, SHOW, "error register"),
    ROW(0x1002, 0, 0, U32, NO, "manufacturer status"),
    ROW(0x1003, 0, 0, U8, CANOPEN_ERRORS, "errors kept"),
    ROW(0x1003, 1, 254, U32, CANOPEN_ERRORS, "error, newest first"),
    ROW(0x1005, 0, 0, U32, NO, "COB-ID of SYNC"),
    ROW(0x1006, 0, 0, U32, NO, "SYNC period, us"),
    ROW(0x1007, 0, 0, U32, NO, "SYNC window, us"),
    ROW(0x1008, 0, 0, TEXT, SHOW, "device name"),
    ROW(0x1009, 0, 0, TEXT, SHOW, "hardware version"),
    ROW(0x100A, 0, 0, TEXT, SHOW, "firmware version"),
    ROW(0x100C, 0, 0, U16, NO, "guard time, ms"),
    ROW(0x100D, 0, 0, U8, NO, "life time factor"),
    ROW(0x1010, 1, 127, U32, NO, "store parameters"),
    ROW(0x1011, 1, 127, U32, NO, "restore default parameters"),
    ROW(0x1014, 0, 0, U32, NO, "COB-ID of emergencies"),
    ROW(0x1016, 1, 127, U32, NO, "heartbeat watched"),
    ROW(0x1017, 0, 0, U16, NO, "heartbeat sent, ms"),
    ROW(0x1018, 1, 1, U32, SHOW, "vendor"),
    ROW(0x1018, 2, 2, U32, SHOW, "product"),
    ROW(0x1018, 3, 3, U32, SHOW, "revision"),
    ROW(0x1018, 4, 4, U32, SHOW, "serial number"),
    ROW(0x1019, 0, 0, U8, NO, "SYNC counter overflow"),
    ROW(0x1029, 1, 254, U8, NO, "error behaviour"),
    ROW(0x6007, 0, 0, I16, SET, "abort connection option"),
    ROW(0x603F, 0, 0, U16, SHOW, "error code"),
    ROW(0x6040, 0, 0, U16, SHOW, "controlword"),
    ROW(0x6041, 0, 0, U16, SHOW, "statusword"),
    ROW(0x605A, 0, 0, I16, SET, "quick stop option"),
    ROW(0x605B, 0, 0, I16, SET, "shutdown option"),
    ROW(0x605C, 0, 0, I16, SET, "disable operation option"),
    ROW(0x605D, 0, 0, I16, SET, "halt option"),
    ROW(0x605E, 0, 0, I16, SET, "fault reaction option"),
    ROW(0x6060, 0, 0, I8, NO, "mode of operation asked for"),
    ROW(0x6061, 0, 0, I8, SHOW, "mode of operation"),
    ROW(0x6062, 0, 0, I32, SHOW, "position demand, counts"),
    ROW(0x6064, 0, 0, I32, SHOW, "position, counts"),
    ROW(0x6065, 0, 0, U32, SET, "following error window, counts"),
    ROW(0x6066, 0, 0, U16, SET, "following error time, ms"),
    ROW(0x6067, 0, 0, U32, SET, "position window, counts"),
    ROW(0x6068, 0, 0, U16, SET, "position window time, ms"),
    ROW(0x606C, 0, 0, I32, SHOW, "velocity, counts/s"),
    ROW(0x6071, 0, 0, I16, NO, "target torque, 0.1 %"),
    ROW(0x6072, 0, 0, U16, SET, "max torque, 0.1 %"),
    ROW(0x6073, 0, 0, U16, SET, "max current, 0.1 %"),
    ROW(0x6075, 0, 0, U32, SET, "rated current of the motor, mA"),
    ROW(0x6076, 0, 0, U32, SET, "rated torque of the motor, mNm"),
    ROW(0x6077, 0, 0, I16, SHOW, "torque, 0.1 %"),
    ROW(0x6078, 0, 0, I16, SHOW, "current, 0.1 %"),
    ROW(0x6079, 0, 0, U32, SHOW, "DC link voltage, mV"),
    ROW(0x607A, 0, 0, I32, SHOW, "target position, counts"),
    ROW(0x607B, 1, 2, I32, SET, "position range limit, counts"),
    ROW(0x607C, 0, 0, I32, SET, "home offset, counts"),
    ROW(0x607D, 1, 1, I32, SET, "software limit, least, counts"),
    ROW(0x607D, 2, 2, I32, SET, "software limit, most, counts"),
    ROW(0x607E, 0, 0, U8, SET, "polarity"),
    ROW(0x607F, 0, 0, U32, SET, "max profile velocity, counts/s"),
    ROW(0x6080, 0, 0, U32, SET, "max motor speed, rpm"),
    ROW(0x6081, 0, 0, U32, SET, "profile velocity, counts/s"),
    ROW(0x6083, 0, 0, U32, SET, "profile acceleration, counts/s^2"),
    ROW(0x6084, 0, 0, U32, SET, "profile deceleration, counts/s^2"),
    ROW(0x6085, 0, 0, U32, SET, "quick stop deceleration, counts/s^2"),
    ROW(0x6086, 0, 0, I16, SET, "motion profile type"),
    ROW(0x608F, 1, 1, U32, SET, "encoder increments"),
    ROW(0x608F, 2, 2, U32, SET, "per motor revolutions"),
    ROW(0x6091, 1, 1, U32, SET, "gear ratio, motor revolutions"),
    ROW(0x6091, 2, 2, U32, SET, "per shaft revolutions"),
    ROW(0x6092, 1, 1, U32, SET, "feed, counts"),
    ROW(0x6092, 2, 2, U32, SET, "per shaft revolutions"),
    ROW(0x6098, 0, 0, I8, SET, "homing method"),
    ROW(0x6099, 1, 1, U32, SET, "homing speed to the switch, counts/s"),
    ROW(0x6099, 2, 2, U32, SET, "homing speed to the zero, counts/s"),
    ROW(0x609A, 0, 0, U32, SET, "homing acceleration, counts/s^2"),
    ROW(0x60B8, 0, 0, U16, SET, "touch probe function"),
    ROW(0x60C0, 0, 0, I16, SET, "interpolation submode"),
    ROW(0x60C2, 1, 1, U8, SET, "interpolation period"),
    ROW(0x60C2, 2, 2, I8, SET, "interpolation period, exponent of s"),
    ROW(0x60C5, 0, 0, U32, SET, "max acceleration, counts/s^2"),
    ROW(0x60C6, 0, 0, U32, SET, "max deceleration, counts/s^2"),
    ROW(0x60E0, 0, 0, U16, SET, "positive torque limit, 0.1 %"),
    ROW(0x60E1, 0, 0, U16, SET, "negative torque limit, 0.1 %"),
    ROW(0x60F4, 0, 0, I32, SHOW, "following error, counts"),
    ROW(0x60FD, 0, 0, U32, SHOW, "digital inputs"),
    ROW(0x60FE, 1, 1, U32, SHOW, "digital outputs"),
    ROW(0x60FF, 0, 0, I32, NO, "target velocity, counts/s"),
    ROW(0x6402, 0, 0, U16, SET, "motor type"),
    ROW(0x6502, 0, 0, U32, SHOW, "supported modes"),
    {0},
};
/* clang-format on */

uint16_t canopen_index_of_axis(uint16_t index, unsigned channel)
{
    return (uint16_t)(index >= AXIS_FIRST && index <= AXIS_LAST ? index + channel * AXIS_STEP : index);
}

const canopen_object_t *canopen_object_find(uint16_t index, uint8_t sub)
{
    const uint16_t plain = cia402_plain_index(index);
    for (const canopen_object_t *row = canopen_objects; row->name != NULL; row++) {
        if (row->index == plain && sub >= row->sub && sub <= row->last) {
            return row;
        }
    }
    return NULL;
}

bool canopen_place_read(const char *text, uint16_t *index, uint8_t *sub)
{
    const char *digits = strncmp(text, "0x", 2) == 0 || strncmp(text, "0X", 2) == 0 ? text + 2 : text;
    const size_t first = strspn(digits, HEX);
    const char *colon = digits + first;
    const size_t second = *colon == ':' ? strspn(colon + 1, HEX) : 0;
    if (first != 4 || (*colon == ':' && (second < 1 || second > 2)) || colon[*colon == ':' ? 1 + second : 0] != '\0') {
        return false;
    }
    *index = (uint16_t)strtoul(digits, NULL, 16);
    *sub = *colon == ':' ? (uint8_t)strtoul(colon + 1, NULL, 16) : 0;
    return true;
}

/* --- Types --- */

static const struct {
    const char *name;
    uint8_t bytes;
    bool is_signed;
} k_types[CANOPEN_TYPES] = {
    [CANOPEN_U8] = {"u8", 1, false},     [CANOPEN_U16] = {"u16", 2, false}, [CANOPEN_U32] = {"u32", 4, false},
    [CANOPEN_I8] = {"i8", 1, true},      [CANOPEN_I16] = {"i16", 2, true},  [CANOPEN_I32] = {"i32", 4, true},
    [CANOPEN_TEXT] = {"text", 0, false},
};

const char *canopen_type_name(canopen_type_t type)
{
    return (unsigned)type < CANOPEN_TYPES ? k_types[type].name : "?";
}

uint8_t canopen_type_bytes(canopen_type_t type)
{
    return (unsigned)type < CANOPEN_TYPES ? k_types[type].bytes : 0;
}

bool canopen_type_find(const char *name, canopen_type_t *out)
{
    for (unsigned i = 0; i < CANOPEN_TEXT; i++) {
        if (strcmp(k_types[i].name, name) == 0) {
            *out = (canopen_type_t)i;
            return true;
        }
    }
    return false;
}

void canopen_value_range(canopen_type_t type, int64_t *least, int64_t *most)
{
    const unsigned bits = 8u * k_types[type].bytes;
    *most = ((int64_t)1 << (k_types[type].is_signed ? bits - 1u : bits)) - 1;
    *least = k_types[type].is_signed ? -*most - 1 : 0;
}

bool canopen_value_read(canopen_type_t type, const char *text, int64_t *out)
{
    int64_t least = 0, most = 0;
    char *end = NULL;
    if (type >= CANOPEN_TEXT || strspn(text, "-0123456789xX" HEX) != strlen(text)) {
        return false;
    }
    const char *digits = text + (*text == '-');
    const bool is_hex = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X');
    errno = 0;
    const long long value = strtoll(text, &end, is_hex ? 16 : 10);
    canopen_value_range(type, &least, &most);
    *out = value;
    return errno == 0 && end != text && *end == '\0' && value >= least && value <= most;
}

int64_t canopen_value(canopen_type_t type, const uint8_t *bytes, size_t size)
{
    int64_t value = 0;
    for (size_t i = 0; i < size && i < 4u; i++) {
        value |= (int64_t)bytes[i] << (8u * i);
    }
    const bool is_signed = (unsigned)type < CANOPEN_TYPES && k_types[type].is_signed;
    const int64_t sign = size > 0 && size <= 4u ? (int64_t)1 << (8u * size - 1u) : 0;
    return is_signed && value >= sign ? value - 2 * sign : value;
}

/* --- Meanings --- */

/* The names of the bits that are set, with commas. */
static void put_bits(char *text, size_t capacity, int64_t value, const char *const *name, unsigned names)
{
    size_t length = 0;
    text[0] = '\0';
    for (unsigned i = 0; i < names; i++) {
        if ((value >> i & 1) != 0 && name[i] != NULL && length < capacity) {
            length += (size_t)snprintf(&text[length], capacity - length, "%s%s", length > 0 ? ", " : "", name[i]);
        }
    }
}

static const char *mode_text(int64_t mode)
{
    static const char *const k_modes[] = {"none",
                                          "profile position",
                                          "velocity",
                                          "profile velocity",
                                          "torque",
                                          NULL,
                                          "homing",
                                          "interpolated position",
                                          "cyclic synchronous position",
                                          "cyclic synchronous velocity",
                                          "cyclic synchronous torque"};
    const bool is_known = mode >= 0 && mode < (int64_t)(sizeof k_modes / sizeof k_modes[0]);
    return mode < 0 ? "of the drive's maker" : is_known && k_modes[mode] != NULL ? k_modes[mode] : "";
}

static void put_status(char *text, size_t capacity, int64_t value)
{
    static const char *const k_bits[] = {NULL,
                                         NULL,
                                         NULL,
                                         NULL,
                                         "voltage",
                                         NULL,
                                         NULL,
                                         "warning",
                                         NULL,
                                         "under remote control",
                                         "target reached",
                                         "at a limit of its own"};
    const char *state = cia402_state_name(cia402_state((uint16_t)value));
    char bits[96];
    put_bits(bits, sizeof bits, value, k_bits, sizeof k_bits / sizeof k_bits[0]);
    (void)snprintf(text, capacity, "%s%s%s", state, bits[0] != '\0' ? "; " : "", bits);
}

static void put_error(char *text, size_t capacity, int64_t code)
{
    (void)snprintf(text, capacity, "%s", code == 0 ? "none" : canopen_error_text((uint16_t)code));
}

void canopen_object_meaning(uint16_t index, uint8_t sub, int64_t value, char *text, size_t capacity)
{
    static const char *const k_register[] = {"generic",       "current",        "voltage", "temperature",
                                             "communication", "of the profile", NULL,      "of the maker"};
    static const char *const k_inputs[] = {"negative limit", "positive limit", "home"};
    static const char *const k_supported[] = {"pp", "vl", "pv", "tq", NULL, "hm", "ip", "csp", "csv", "cst"};
    text[0] = '\0';
    index = cia402_plain_index(index);
    if (index == 0x1000 && sub == 0) {
        (void)snprintf(text, capacity, "%s", (value & 0xFFFF) == 402 ? "CiA 402 drive" : "no CiA 402 drive");
    } else if (index == 0x1001) {
        put_bits(text, capacity, value, k_register, sizeof k_register / sizeof k_register[0]);
    } else if (index == 0x1003 && sub > 0) {
        put_error(text, capacity, value & 0xFFFF);
    } else if (index == 0x603F) {
        put_error(text, capacity, value);
    } else if (index == 0x6041) {
        put_status(text, capacity, value);
    } else if (index == 0x6060 || index == 0x6061) {
        (void)snprintf(text, capacity, "%s", mode_text(value));
    } else if (index == 0x60FD) {
        put_bits(text, capacity, value, k_inputs, sizeof k_inputs / sizeof k_inputs[0]);
    } else if (index == 0x6502) {
        put_bits(text, capacity, value, k_supported, sizeof k_supported / sizeof k_supported[0]);
    }
}
