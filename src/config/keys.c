/* SPDX-License-Identifier: MIT
 * keys.c - the table of all sections and keys, look-up in it, and the nearest name to a misspelt one.
 */
#include "config/keys.h"

#include <stddef.h>
#include <string.h>

#include "common/socket_path.h"
#include "common/translate.h"

#define SUGGEST_LENGTH_MAX 40u /* longer names are not worth a suggestion */

const char *const config_axis_section[AXES_MAX] = {"roll", "pitch", "yaw", "x", "y", "z", "angle"};

static const char k_drive_startup[] =
    N_("what the drive of this cylinder alone has to hold; a line here replaces that of the same object in [cia402-startup]");

const config_section_t config_sections[] = {
    {"platform", N_("what it is and how it starts"), CONFIG_NEEDS_NOTHING, false},
    {"geometry", N_("joint centres and lengths, as measured; left-handed frame, +X forward, +Y right, +Z up"),
     CONFIG_NEEDS_NOTHING, true},
    {"pose", N_("where the platform waits"), CONFIG_NEEDS_NOTHING, false},
    {"roll", N_("rotation about X: asked = sign * scale * sent + offset, then min to max"), CONFIG_NEEDS_NOTHING, false},
    {"pitch", N_("rotation about Y, as [roll]"), CONFIG_NEEDS_NOTHING, false},
    {"yaw", N_("rotation about Z, as [roll]"), CONFIG_NEEDS_HEXAPOD, false},
    {"angle", N_("rotation motor, limits as [roll]"), CONFIG_NEEDS_NOTHING, false},
    {"x", N_("forward and back, as [roll]"), CONFIG_NEEDS_HEXAPOD, false},
    {"y", N_("right and left, as [roll]"), CONFIG_NEEDS_HEXAPOD, false},
    {"z", N_("up and down from pose zero, as [roll]"), CONFIG_NEEDS_NOTHING, false},
    {"cylinders", N_("limits of every cylinder: the last word over all motion"), CONFIG_NEEDS_NOTHING, false},
    {"engage", N_("limits of the cylinders while rising, settling, homing and taking over a sender's first pose"),
     CONFIG_NEEDS_NOTHING, false},
    {"service", N_("what moves by hand, in SERVICE (`heavectl service`)"), CONFIG_NEEDS_NOTHING, false},
    {"intensity", N_("how much of a sender's motion is made, about neutral; the rotation motor is not scaled"),
     CONFIG_NEEDS_NOTHING, false},
    {"udp", N_("where frames come from"), CONFIG_NEEDS_NOTHING, false},
    {"control", N_("where heavectl reaches heaved"), CONFIG_NEEDS_NOTHING, false},
    {"black-box", N_("the last minutes, kept in memory; written on every fault and e-stop, and by `heavectl dump`"),
     CONFIG_NEEDS_NOTHING, false},
    {"samples", N_("every cycle in shared memory, for `heavectl scope` and other programs that look on; see docs/samples.md"),
     CONFIG_NEEDS_NOTHING, false},
    {"drives", N_("what moves the cylinders"), CONFIG_NEEDS_NOTHING, true},
    {"sim", N_("simulated drives ([drives] driver = sim)"), CONFIG_NEEDS_NOTHING, false},
    {"can", N_("the CAN bus of the drives, for every driver that uses one"), CONFIG_NEEDS_NOTHING, true},
    {"cia402", N_("CANopen drives with the profile CiA 402 ([drives] driver = cia402); see docs/cia402.md"), CONFIG_NEEDS_NOTHING,
     true},
    {"cia402-startup",
     N_("what the cylinders' drives have to hold beyond what heaved sets in every drive, an object in a line; see "
        "docs/cia402.md"),
     CONFIG_NEEDS_NOTHING, true},
    {"cia402-startup-1", k_drive_startup, CONFIG_NEEDS_NOTHING, true},
    {"cia402-startup-2", k_drive_startup, CONFIG_NEEDS_NOTHING, true},
    {"cia402-startup-3", k_drive_startup, CONFIG_NEEDS_NOTHING, true},
    {"cia402-startup-4", k_drive_startup, CONFIG_NEEDS_HEXAPOD, true},
    {"cia402-startup-5", k_drive_startup, CONFIG_NEEDS_HEXAPOD, true},
    {"cia402-startup-6", k_drive_startup, CONFIG_NEEDS_HEXAPOD, true},
    {"cia402-angle-startup", N_("the same of the rotation motor"), CONFIG_NEEDS_ANGLE, true},
    {"can-raw", N_("drives on CAN with frames of their own ([drives] driver = can-raw); see docs/can-raw.md"),
     CONFIG_NEEDS_NOTHING, true},
    {"modbus", N_("registers of drives on Modbus ([drives] driver = modbus-tcp or modbus-rtu); see docs/modbus.md"),
     CONFIG_NEEDS_NOTHING, true},
    {"modbus-tcp", N_("their connections, for driver = modbus-tcp"), CONFIG_NEEDS_NOTHING, true},
    {"modbus-rtu", N_("their serial line, for driver = modbus-rtu"), CONFIG_NEEDS_NOTHING, true},
    {"relays", N_("effects outputs"), CONFIG_NEEDS_NOTHING, false},
    {"relays-modbus",
     N_("a board of relays on Modbus coils ([relays] driver = modbus), on a line of its own; see docs/modbus.md"),
     CONFIG_NEEDS_NOTHING, false},
    {"inputs", N_("switches of the operator"), CONFIG_NEEDS_NOTHING, true},
    {"healthy",
     N_("an output that toggles as long as states, deadlines and drives are as they should be, for a watchdog outside; see "
        "docs/safety.md"),
     CONFIG_NEEDS_NOTHING, false},
};
const size_t config_section_count = sizeof config_sections / sizeof config_sections[0];

/* clang-format off */ /* a row is a record: one or two lines */

/* Pieces of a row. */
#define AT(member)       .offset = offsetof(config_t, member), .size = sizeof(((const config_t *)0)->member)
#define KEY(in, called)  .section = (in), .name = (called)
#define RANGE(low, high) .low_milli = (int64_t)(low)*1000, .high_milli = (int64_t)(high)*1000
#define ABOVE_ZERO(high) .low_milli = 1, .high_milli = (int64_t)(high)*1000
#define MOST_Q16         32767 /* whole units that Q16.16 holds */
#define MOST_INT32       2147483647

/* The rows of one joint pair: base joint and plate joint. */
#define JOINT(number, index, need)                                                                                              \
    {KEY("geometry", "base" number "_mm"), AT(settings.geometry.base_mm_q16[index]), .type = &config_type_decimal, .count = 3,        \
     .unit = "mm", RANGE(-4000, 4000), .needs = need,                                                                           \
     .help = "x, y, z of the lower joint of this cylinder, base frame; or base_radius_mm for all"},                                                  \
    {KEY("geometry", "plate" number "_mm"), AT(settings.geometry.plate_mm_q16[index]), .type = &config_type_decimal, .count = 3,      \
     .unit = "mm", RANGE(-4000, 4000), .needs = need,                                                                           \
     .help = "x, y, z of the upper joint of this cylinder, plate frame; or plate_radius_mm for all"}

/* The rows of joints on a circle, in place of joints one by one. */
#define CIRCLE(set, member, pairs)                                                                                              \
    {KEY("geometry", set "_radius_mm"), AT(member.radius_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",             \
     .fallback = "none", .words = "none", ABOVE_ZERO(4000),                                                                     \
     .help = "circle through these joints, in place of joints one by one: they follow from it (docs/geometry.md)"},\
    {KEY("geometry", set "_spread_deg"), AT(member.spread_deg_q16), .type = &config_type_decimal, .count = 1, .unit = "deg",          \
     .fallback = "none", .words = "none", RANGE(0, 119), .needs = CONFIG_NEEDS_HEXAPOD,                                         \
     .help = pairs},                                                                 \
    {KEY("geometry", set "_turn_deg"), AT(member.turn_deg_q16), .type = &config_type_decimal, .count = 1, .unit = "deg",              \
     .fallback = "0", RANGE(-180, 180), .help = "all these joints turned by so much, clockwise as seen from above"}

/* How a rotation of the pose is read. */
#define WRAP(name, index, need)                                                                                                 \
    {KEY(name, "wrap"), AT(settings.axis[index].wrap), .type = &config_type_word, .unit = "", .fallback = "as-sent",                  \
     .words = "as-sent|shortest", .needs = need,                                                                               \
     .help = "the number as it is; or modulo one turn, as of senders that count from 0 to 360: 358 is -2, the shorter way round from the last value sent, as far as the limits let it"}

/* The rows of one axis; left_out: what stands for limits that the file does not give. */
#define AXIS(name, u, index, need, low, high, left_out)                                                                         \
    {KEY(name, "sign"), AT(settings.axis[index].sign), .type = &config_type_sign, .unit = "", .fallback = "1", .needs = need,         \
     .help = "-1 turns the sense of the sent value round"},                                                                     \
    {KEY(name, "scale"), AT(settings.axis[index].scale_q16), .type = &config_type_decimal, .count = 1, .unit = "", .fallback = "1",   \
     RANGE(0, 100), .needs = need, .help = "factor of the sent value; 0 switches the axis off"},                                \
    {KEY(name, "offset_" u), AT(settings.axis[index].offset_q16), .type = &config_type_decimal, .count = 1, .unit = u,                \
     .fallback = "0", RANGE(low, high), .needs = need, .help = "added after sign and scale"},                                   \
    {KEY(name, "min_" u), AT(settings.axis[index].min_q16), .type = &config_type_decimal, .count = 1, .unit = u, RANGE(low, high), .fallback = left_out, .words = left_out, \
     .needs = need, .help = "lowest value the axis goes to"},                                                                   \
    {KEY(name, "max_" u), AT(settings.axis[index].max_q16), .type = &config_type_decimal, .count = 1, .unit = u, RANGE(low, high), .fallback = left_out, .words = left_out, \
     .needs = need, .help = "highest value the axis goes to"},                                                                  \
    {KEY(name, "speed_" u "_s"), AT(settings.axis[index].speed_q16), .type = &config_type_decimal, .count = 1, .unit = u "/s",        \
     ABOVE_ZERO(10000), .fallback = left_out, .words = left_out, .needs = need, .help = "speed limit"},                         \
    {KEY(name, "accel_" u "_s2"), AT(settings.axis[index].accel_q16), .type = &config_type_decimal, .count = 1, .unit = u "/s^2",     \
     ABOVE_ZERO(MOST_Q16), .fallback = left_out, .words = left_out, .needs = need,                                              \
     .help = "acceleration limit; reached only where accel^2 / jerk <= speed"},                                                 \
    {KEY(name, "jerk_" u "_s3"), AT(settings.axis[index].jerk), .type = &config_type_integer, .unit = u "/s^3",                       \
     RANGE(1, MOST_INT32), .fallback = left_out, .words = left_out, .needs = need, .help = "jerk limit: how fast the acceleration may change"}

const config_key_t config_keys[] = {
    {KEY("platform", "kind"), AT(settings.geometry.kind), .type = &config_type_word, .unit = "", .words = "hexapod|tripod|tripod-3rps",
     .help = "six cylinders; three round a central guide; three on hinges (yaw, x and y then follow from roll and pitch)"},
    {KEY("platform", "cycle_us"), AT(settings.cycle_us), .type = &config_type_integer, .unit = "us", .fallback = "1000",
     RANGE(500, 10000), .help = "period of the motion cycle"},
    {KEY("platform", "auto_frames"), AT(settings.auto_frames), .type = &config_type_integer, .unit = "", .fallback = "0", RANGE(0, 100),
     .help = "valid frames within a second that engage = auto waits for before it brings the platform up; 0 = none"},
    {KEY("platform", "late_hold_cycles"), AT(late_hold_cycles), .type = &config_type_integer, .unit = "", .fallback = "3",
     RANGE(0, 1000), .is_live = true, .help = "a cycle that is late by more cycles than that holds the platform while it rises, is neutral or engaged; 0 = never"},
    {KEY("platform", "engage"), AT(settings.engage), .type = &config_type_word, .unit = "", .fallback = "manual",
     .words = "manual|auto",
     .help = "who brings the platform up: an operator's request, or heaved by itself once after each start, also where a service manager "
             "starts it again after a crash"},
    {KEY("platform", "life_file"), AT(life_file), .type = &config_type_path, .unit = "", .fallback = "none", .words = "none",
     .help = "file, and beside it `FILE.2` and `FILE.machine`, that keeps hours, way and cycles of each axis for good, and what was commissioned; none: nothing is kept, unless a "
             "service manager has given a state directory"},
    {KEY("platform", "approved"), AT(approved), .type = &config_type_label, .unit = "", .fallback = "none", .is_live = true,
     .help = "hash of the approved configuration, as --check shows it: any other moves nothing before `heavectl acknowledge`; not "
             "with engage = auto"},

    JOINT("1", 0, CONFIG_NEEDS_NOTHING),
    JOINT("2", 1, CONFIG_NEEDS_NOTHING),
    JOINT("3", 2, CONFIG_NEEDS_NOTHING),
    JOINT("4", 3, CONFIG_NEEDS_HEXAPOD),
    JOINT("5", 4, CONFIG_NEEDS_HEXAPOD),
    JOINT("6", 5, CONFIG_NEEDS_HEXAPOD),
    CIRCLE("base", base, N_("angle between the two joints of a pair: 1 and 2 in front, 3 and 4, 5 and 6")),
    CIRCLE("plate", plate, N_("angle between the two joints of a pair: 6 and 1, 2 and 3, 4 and 5")),
    {KEY("geometry", "retracted_length_mm"), AT(settings.geometry.retracted_mm_q16), .type = &config_type_per_cylinder, .unit = "mm",
     ABOVE_ZERO(8000), .help = "joint to joint at extension 0"},
    {KEY("geometry", "stroke_mm"), AT(settings.stroke_mm_q16), .type = &config_type_per_cylinder, .unit = "mm", ABOVE_ZERO(4000),
     .help = "extension from end to end"},
    {KEY("geometry", "zero_height_mm"), AT(settings.geometry.zero_height_mm_q16), .type = &config_type_decimal, .count = 1,
     .unit = "mm", .fallback = "mid-stroke", .words = "mid-stroke", RANGE(0, 8000),
     .help = "plate origin above base origin at pose zero; mid-stroke: where the cylinders are half way out"},
    {KEY("geometry", "mrp_mm"), AT(settings.geometry.mrp_mm_q16), .type = &config_type_decimal, .count = 3, .unit = "mm",
     .fallback = "0, 0, 0", RANGE(-4000, 4000),
     .help = "x, y, z of the motion reference point, plate frame: poses place it and rotations turn about it"},
    {KEY("geometry", "as_measured"), AT(is_as_measured), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "whether joints that look like a slip (two exchanged, numbered from the wrong place, a digit, metres) are what they are: a "
             "warning then, else an error"},

    {KEY("pose", "neutral"), AT(settings.neutral_q16), .type = &config_type_decimal, .count = POSE_AXES, .unit = "deg and mm",
     .fallback = "0, 0, 0, 0, 0, 0", RANGE(-4000, 4000), .help = "roll, pitch, yaw, x, y, z the platform rises to"},
    {KEY("pose", "settled_extension_mm"), AT(settings.settled_extension_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     RANGE(0, 4000), .help = "of all cylinders, in which people board"},

    AXIS("roll", "deg", AXIS_ROLL, CONFIG_NEEDS_NOTHING, -90, 90, "suggested"),
    WRAP("roll", AXIS_ROLL, CONFIG_NEEDS_NOTHING),
    AXIS("pitch", "deg", AXIS_PITCH, CONFIG_NEEDS_NOTHING, -90, 90, "suggested"),
    WRAP("pitch", AXIS_PITCH, CONFIG_NEEDS_NOTHING),
    AXIS("yaw", "deg", AXIS_YAW, CONFIG_NEEDS_HEXAPOD, -180, 180, "suggested"),
    WRAP("yaw", AXIS_YAW, CONFIG_NEEDS_HEXAPOD),
    {KEY("angle", "present"), AT(settings.has_angle), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "whether there is a rotation motor; the other keys of the section are for yes only"},
    {KEY("angle", "wrap"), AT(settings.axis[AXIS_ANGLE].wrap), .type = &config_type_word, .unit = "", .fallback = "as-sent",
     .words = "as-sent|shortest", .needs = CONFIG_NEEDS_ANGLE,
     .help = "the number as it is, several turns allowed; or modulo one turn, the shorter way round from the last angle sent, as far as "
             "the limits let it"},
    AXIS("angle", "deg", AXIS_ANGLE, CONFIG_NEEDS_ANGLE, -MOST_Q16, MOST_Q16, NULL),
    AXIS("x", "mm", AXIS_X, CONFIG_NEEDS_HEXAPOD, -4000, 4000, "suggested"),
    AXIS("y", "mm", AXIS_Y, CONFIG_NEEDS_HEXAPOD, -4000, 4000, "suggested"),
    AXIS("z", "mm", AXIS_Z, CONFIG_NEEDS_NOTHING, -4000, 4000, "suggested"),

    {KEY("cylinders", "speed_mm_s"), AT(settings.cylinder_speed_mm_s_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s",
     ABOVE_ZERO(10000), .help = "speed limit"},
    {KEY("cylinders", "accel_mm_s2"), AT(settings.cylinder_accel_mm_s2_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s^2",
     ABOVE_ZERO(MOST_Q16), .help = "acceleration limit; reached only where accel^2 / jerk <= speed"},
    {KEY("cylinders", "jerk_mm_s3"), AT(settings.cylinder_jerk_mm_s3), .type = &config_type_integer, .unit = "mm/s^3",
     RANGE(1, MOST_INT32), .help = "jerk limit"},
    {KEY("cylinders", "margin_mm"), AT(settings.margin_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm", .fallback = "2",
     RANGE(0, 1000), .help = "kept free at both ends of the stroke"},

    {KEY("cylinders", "following_error_mm"), AT(settings.following_error_mm_q16), .type = &config_type_decimal, .count = 1,
     .unit = "mm", .fallback = "20", RANGE(0, 1000),
     .is_live = true, .help = "a cylinder further from its set-point than that for 20 ms is a fault; 0 = not watched"},

    {KEY("engage", "speed_mm_s"), AT(settings.engage_speed_mm_s_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s",
     .fallback = "30", ABOVE_ZERO(10000), .help = "speed limit, at most that of [cylinders]"},
    {KEY("engage", "accel_mm_s2"), AT(settings.engage_accel_mm_s2_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s^2",
     .fallback = "100", ABOVE_ZERO(MOST_Q16), .help = "acceleration limit, at most that of [cylinders]"},
    {KEY("engage", "blend_ms"), AT(settings.blend_ms), .type = &config_type_integer, .unit = "ms", .fallback = "2000",
     RANGE(250, 20000), .help = "least time in which a new sender is faded in"},

    {KEY("service", "jog_mm_s"), AT(settings.jog_mm_s_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s", .fallback = "5",
     ABOVE_ZERO(50), .help = "no cylinder is faster than that while a hand leads it, nor than the limit of [cylinders]"},
    {KEY("service", "jog_deg_s"), AT(settings.jog_deg_s_q16), .type = &config_type_decimal, .count = 1, .unit = "deg/s",
     .fallback = "2", ABOVE_ZERO(20), .help = "nor a rotation, nor the rotation motor"},
    {KEY("service", "signal_mm"), AT(settings.signal_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm", .fallback = "10",
     ABOVE_ZERO(100), .help = "no test signal (`heavectl signal`, `heavectl identify`) is wider, from its middle to one side"},
    {KEY("service", "signal_deg"), AT(settings.signal_deg_q16), .type = &config_type_decimal, .count = 1, .unit = "deg",
     .fallback = "3", ABOVE_ZERO(30), .help = "the same of a rotation, and of the rotation motor"},
    {KEY("service", "signal_mm_s"), AT(settings.signal_mm_s_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s",
     .fallback = "50", ABOVE_ZERO(500), .help = "no cylinder is faster in a test signal, nor than the limit of [cylinders]; the rotation motor goes by jog_deg_s"},
    {KEY("service", "selftest"), AT(selftest.when), .type = &config_type_word, .unit = "", .fallback = "none", .words = "none|daily",
     .help = "daily: `engage` is refused until `heavectl selftest` has passed on this calendar day, with this configuration; not with engage = auto"},
    {KEY("service", "selftest_following_mm"), AT(selftest.following_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     .fallback = "2", ABOVE_ZERO(100), .help = "how far a cylinder may be from its set-point while the self-test jogs it"},
    {KEY("service", "selftest_drift_mm"), AT(selftest.drift_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     .fallback = "1", ABOVE_ZERO(100), .help = "how far a cylinder may move within 5 s without torque, which its brake or its friction has to hold"},

    {KEY("intensity", "start_percent"), AT(settings.intensity_start_percent), .type = &config_type_integer, .unit = "%",
     .fallback = "max", .words = "max", RANGE(0, 100),
     .help = "at the start, at most max_percent; `heavectl intensity` changes it while heaved runs"},
    {KEY("intensity", "max_percent"), AT(settings.intensity_max_percent), .type = &config_type_integer, .unit = "%",
     .fallback = "100", RANGE(1, 100), .help = "the most that can be asked for"},
    {KEY("intensity", "ramp_ms"), AT(settings.intensity_ramp_ms), .type = &config_type_integer, .unit = "ms", .fallback = "2000",
     RANGE(500, 10000), .help = "from 0 to 100 %, jerk-limited; a change by half of that takes 0.8 of it, by a tenth 0.46"},

    {KEY("udp", "bind"), AT(udp.bind), .type = &config_type_address, .unit = "", .fallback = "127.0.0.1",
     .help = "address to listen on: 0.0.0.0 or :: for every network card; as it stands, this machine alone"},
    {KEY("udp", "group"), AT(udp.group), .type = &config_type_group, .unit = "", .fallback = "none", .words = "none",
     .help = "multicast group to join, for senders that send to many platforms at once, and the network card on which; bind is then "
             "0.0.0.0 or ::, of which :: hears IPv6 groups too"},
    {KEY("udp", "port"), AT(udp.port), .type = &config_type_integer, .unit = "", .fallback = "9800", RANGE(1, 65535),
     .help = "UDP port"},
    {KEY("udp", "allow"), AT(udp.allow), .type = &config_type_networks, .unit = "", .fallback = "any", .words = "any",
     .is_live = true, .help = "who may send: addresses or networks such as 192.168.7.0/24, separated by commas"},
    {KEY("udp", "takeover_ms"), AT(settings.takeover_ms), .type = &config_type_integer, .unit = "ms", .fallback = "2500",
     RANGE(0, 3600000),
     .is_live = true, .help = "silence of the sender that drives, after which another one may: one at a time, by address; 0 = all at once"},
    {KEY("udp", "priority"), AT(settings.priority), .type = &config_type_networks, .unit = "", .fallback = "none", .words = "none",
     .is_live = true, .help = "senders that take over from any behind them in the list, or not in it, without waiting"},
    {KEY("udp", "dialect"), AT(settings.dialect), .type = &config_type_word, .unit = "", .fallback = "v3", .words = "v3|lenient",
     .is_live = true, .help = "frames as in V3.0; or also with the head # or none, and commands in lower case"},
    {KEY("udp", "mask"), AT(settings.mask_policy), .type = &config_type_word, .unit = "", .fallback = "learnt",
     .words = "learnt|always|never|any", .is_live = true,
     .help = "whether frames have a relay mask: as the sender's first ten in a row, in each frame, in none, or in some; a decimal comma looks "
             "like one"},
    {KEY("udp", "stream"), AT(settings.stream_style), .type = &config_type_word, .unit = "", .fallback = "smooth",
     .words = "smooth|balanced", .help = "how a stream is rendered: 2 periods late and smoother, or 1.3 periods late"},
    {KEY("udp", "delay_max_ms"), AT(settings.delay_max_ms), .type = &config_type_integer, .unit = "ms", .fallback = "120",
     RANGE(0, 1000), .help = "what the delay of a stream may grow to where its frames come late or in bursts"},
    {KEY("udp", "spike_gate"), AT(settings.spike_gate), .type = &config_type_integer, .unit = "", .fallback = "10",
     RANGE(0, 1000), .is_live = true,
     .help = "a sample of a stream that would take more than so many times an axis' acceleration limit waits for the next one to confirm "
             "it; 0 = off"},
    {KEY("udp", "confirm_jump_mm"), AT(settings.confirm_jump_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     .fallback = "0", RANGE(0, 4000), .is_live = true,
     .help = "a frame whose x, y, z or extension is further than that from the last one followed is followed only once a second frame "
             "within a second is as near to it; 0 = every frame is followed"},
    {KEY("udp", "confirm_jump_deg"), AT(settings.confirm_jump_deg_q16), .type = &config_type_decimal, .count = 1, .unit = "deg",
     .fallback = "0", RANGE(0, 360), .is_live = true, .help = "the same of roll, pitch, yaw and the rotation motor"},
    {KEY("udp", "silence_hold_ms"), AT(settings.silence_hold_ms), .type = &config_type_integer, .unit = "ms", .fallback = "1000",
     RANGE(0, 3600000), .is_live = true, .help = "silence of the sender after which the platform holds; 0 = never"},
    {KEY("udp", "silence_neutral_ms"), AT(settings.silence_neutral_ms), .type = &config_type_integer, .unit = "ms", .fallback = "0",
     RANGE(0, 3600000), .is_live = true, .help = "silence after which it goes to neutral; 0 = never"},
    {KEY("udp", "silence_settle_ms"), AT(settings.silence_settle_ms), .type = &config_type_integer, .unit = "ms", .fallback = "0",
     RANGE(0, 3600000), .is_live = true, .help = "silence after which it settles; 0 = never"},

    {KEY("control", "socket"), AT(control_socket), .type = &config_type_path, .unit = "", .fallback = SOCKET_DEFAULT,
     .help = "local socket of heaved; as the service heave@NAME, this default stands for /run/heave/NAME/heaved.sock"},
    {KEY("control", "metrics"), AT(metrics_file), .type = &config_type_path, .unit = "", .fallback = "none", .words = "none",
     .help = "file for Prometheus (node_exporter's textfile collector: a name that ends in .prom), renewed every second; removed at "
             "the end"},

    {KEY("control", "look_socket"), AT(look_socket), .type = &config_type_path, .unit = "", .fallback = "none", .words = "none",
     .help = "a second socket, for everybody on this machine: status, watch and hold, and nothing else"},
    {KEY("control", "operate_group"), AT(operate_group), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "who may engage, resume, park, turn the intensity down and mark incidents as seen; none: whoever may use the socket. Everybody who may use it may "
             "look and hold"},
    {KEY("control", "service_group"), AT(service_group), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "who may do that and reset, turn the intensity up, dump and shut down; none: as operate_group; root always may"},
    {KEY("control", "operator_log"), AT(operator_log), .type = &config_type_path, .unit = "", .fallback = "none", .words = "none",
     .help = "file that takes a line per request: when, who, what, and what became of it; none: nothing is kept, unless a service "
             "manager has given a state directory, which then has operator.log"},
    {KEY("control", "operator_log_kb"), AT(operator_log_kb), .type = &config_type_integer, .unit = "KB", .fallback = "1024",
     RANGE(16, 1048576), .help = "size at which it becomes FILE.1, and a new one begins"},
    {KEY("control", "operator_log_files"), AT(operator_log_files), .type = &config_type_integer, .unit = "", .fallback = "20",
     RANGE(1, 100), .help = "older ones that are kept, FILE.1 the newest"},

    {KEY("black-box", "directory"), AT(black_box.directory), .type = &config_type_path, .unit = "", .fallback = "none", .words = "none",
     .help = "takes one folder per incident; none: nothing is kept or written, unless a service manager has given a state directory"},
    {KEY("black-box", "seconds"), AT(black_box.seconds), .type = &config_type_integer, .unit = "s", .fallback = "120", RANGE(10, 600),
     .help = "kept at least, of every cycle: up to 1 MB of memory and of disk space a second, at 1000 cycles a second"},
    {KEY("black-box", "incidents"), AT(black_box.incidents), .type = &config_type_integer, .unit = "", .fallback = "10", RANGE(1, 100),
     .help = "folders kept in the directory, of faults and of dumps each; the oldest one makes way, but not the first fault since `heavectl seen`"},

    {KEY("samples", "seconds"), AT(samples_seconds), .type = &config_type_integer, .unit = "s", .fallback = "30", RANGE(0, 600),
     .help = "how long they are kept: 0.5 MB of memory a second at 1000 cycles a second; 0 = there are none"},

    {KEY("drives", "driver"), AT(drives), .type = &config_type_word, .unit = "", .words = "sim|cia402|can-raw|modbus-tcp|modbus-rtu",
     .help = "the drives in use"},
    {KEY("drives", "lead_mm"), AT(drive_train.lead_mm), .type = &config_type_ratios, .unit = "", .fallback = "none",
     .count = CYLINDERS_MAX, .help = "travel of a cylinder for one turn of its screw, in place of counts_per_mm in the section of the drives; "
     "negative: the drive counts backwards"},
    {KEY("drives", "counts_per_turn"), AT(drive_train.counts_per_turn), .type = &config_type_integer, .unit = "counts", .fallback = "none",
     .words = "none", RANGE(1, MOST_INT32), .help = "counts of one turn of the motor: needed with lead_mm, and for rpm in --check"},
    {KEY("drives", "gear"), AT(drive_train.gear), .type = &config_type_ratios, .unit = "", .fallback = "1",
     .count = CYLINDERS_MAX, .help = "turns of the motor for one turn of the screw, with lead_mm"},

    {KEY("sim", "lag_ms"), AT(sim.lag_ms), .type = &config_type_integer, .unit = "ms", .fallback = "0", RANGE(0, 10000),
     .help = "time constant with which a cylinder follows its set-point; 0 = at once"},
    {KEY("sim", "enable_delay_ms"), AT(sim.enable_delay_ms), .type = &config_type_integer, .unit = "ms", .fallback = "0",
     RANGE(0, 60000), .help = "from the enable command to enabled"},
    {KEY("sim", "start_extension_mm"), AT(sim.start_extension_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     .fallback = "settled", .words = "settled", RANGE(0, 4000), .help = "of all cylinders at the start"},
    {KEY("sim", "homed"), AT(sim.is_homed), .type = &config_type_yes_no, .unit = "", .fallback = "yes",
     .help = "whether the drives know their position from the start"},

    {KEY("can", "interface"), AT(can.interface), .type = &config_type_name, .unit = "", .fallback = "can0",
     .help = "CAN interface of the system, set up with the bit rate below"},
    {KEY("can", "bitrate_bps"), AT(can.bitrate_bps), .type = &config_type_integer, .unit = "bit/s", .fallback = "1000000",
     RANGE(10000, 1000000), .help = "bit rate of the bus, for its load"},
    {KEY("can", "passive_stop_ms"), AT(can.passive_stop_ms), .type = &config_type_integer, .unit = "ms", .fallback = "1000",
     RANGE(0, 60000), .help = "error-passive for so long, the platform stops (fault bus-failing); 0 = never"},

    {KEY("cia402", "nodes"), AT(cia402.nodes), .type = &config_type_nodes, .unit = "", .fallback = "1",
     .help = "node id of drive 1, the next ones follow; or one for each drive, 5.2 is the second axis of node 5. The rotation motor "
             "is the last"},
    {KEY("cia402", "gateway_node"), AT(cia402.gateway_node), .type = &config_type_integer, .unit = "", .fallback = "127", RANGE(1, 127),
     .help = "node id of this gateway, whose heartbeat the drives watch"},
    {KEY("cia402", "mode"), AT(cia402.mode), .type = &config_type_words, .unit = "", .fallback = "csp", .words = "csp|ip|pp",
     .help = "cyclic synchronous position; interpolated position; or profile position, for slow moves only. For all drives, or for "
             "each"},
    {KEY("cia402", "command_map"), AT(cia402.command_map), .type = &config_type_maps, .unit = "", .fallback = "none",
     .help = "RPDOs, their numbers and what is in them; none = RPDO 1 with 6040h and the target. See docs/cia402.md"},
    {KEY("cia402", "answer_map"), AT(cia402.answer_map), .type = &config_type_maps, .unit = "", .fallback = "none",
     .help = "TPDOs likewise; none = TPDO 1 with 6041h, 6064h and 6061h"},
    {KEY("cia402", "map_written"), AT(cia402.is_map_written), .type = &config_type_yes_no, .unit = "", .fallback = "yes",
     .help = "no: command_map and answer_map are what the drives have and cannot change; it is compared"},
    {KEY("cia402", "pdo_step"), AT(cia402.pdo_step), .type = &config_type_integer, .unit = "", .fallback = "64", RANGE(1, 64),
     .help = "numbers from the PDOs of an axis of a node to those of the next one; 64 is that of the standard"},
    {KEY("cia402", "period_us"), AT(cia402.period_us), .type = &config_type_integer, .unit = "us", .fallback = "4000",
     RANGE(500, 255000), .help = "period of SYNC and set-points (60C2h), a multiple of cycle_us; whole ms suit every drive"},
    {KEY("cia402", "counts_per_mm"), AT(cia402.counts_per_mm), .type = &config_type_ratios, .unit = "", .fallback = "none",
     .count = CYLINDERS_MAX, .help = "exact, such as counts of a turn / lead; negative: the drive counts backwards"},
    {KEY("cia402", "zero_counts"), AT(cia402.zero_counts), .type = &config_type_wholes, .unit = "counts", .fallback = "0",
     .count = CYLINDERS_MAX, .help = "position (6064h) where the cylinder is fully in"},
    {KEY("cia402", "angle_counts_per_deg"), AT(cia402.angle_counts_per_deg), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "of the rotation motor"},
    {KEY("cia402", "angle_zero_counts"), AT(cia402.angle_zero_counts), .type = &config_type_wholes, .unit = "counts", .fallback = "0",
     .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "of the rotation motor at 0 deg"},
    {KEY("cia402", "homing_method"), AT(cia402.homing.method), .type = &config_type_wholes, .unit = "", .fallback = "0",
     .count = CYLINDERS_MAX, .help = "6098h, for all cylinders or for each; 0 = absolute encoders, nothing to find"},
    {KEY("cia402", "homing_speed_mm_s"), AT(cia402.homing.speed_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s",
     .fallback = "10", ABOVE_ZERO(1000), .help = "towards the switch or stop"},
    {KEY("cia402", "homing_zero_speed_mm_s"), AT(cia402.homing.zero_speed_q16), .type = &config_type_decimal, .count = 1,
     .unit = "mm/s", .fallback = "2", ABOVE_ZERO(1000), .help = "when searching for the zero itself"},
    {KEY("cia402", "homing_accel_mm_s2"), AT(cia402.homing.accel_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s^2",
     .fallback = "100", ABOVE_ZERO(MOST_Q16), .help = "acceleration of homing"},
    {KEY("cia402", "homing_order"), AT(cia402.homing_order), .type = &config_type_word, .unit = "", .fallback = "together",
     .words = "together|in-turn", .help = "all drives at once, so that a level platform sinks level; or one after the other"},
    {KEY("cia402", "angle_homing_method"), AT(cia402.angle_homing.method), .type = &config_type_wholes, .unit = "", .fallback = "0",
     .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "6098h of the rotation motor; 0 = absolute"},
    {KEY("cia402", "angle_homing_speed_deg_s"), AT(cia402.angle_homing.speed_q16), .type = &config_type_decimal, .count = 1,
     .unit = "deg/s", .fallback = "10", ABOVE_ZERO(1000), .needs = CONFIG_NEEDS_ANGLE, .help = "towards its switch"},
    {KEY("cia402", "angle_homing_zero_speed_deg_s"), AT(cia402.angle_homing.zero_speed_q16), .type = &config_type_decimal, .count = 1,
     .unit = "deg/s", .fallback = "2", ABOVE_ZERO(1000), .needs = CONFIG_NEEDS_ANGLE, .help = "when searching for its zero itself"},
    {KEY("cia402", "angle_homing_accel_deg_s2"), AT(cia402.angle_homing.accel_q16), .type = &config_type_decimal, .count = 1,
     .unit = "deg/s^2", .fallback = "100", ABOVE_ZERO(MOST_Q16), .needs = CONFIG_NEEDS_ANGLE, .help = "acceleration of its homing"},
    {KEY("cia402", "following_error_mm"), AT(cia402.following_error_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     .fallback = "10", ABOVE_ZERO(1000), .help = "window that each drive watches itself (6065h); set-points further off are not sent"},
    {KEY("cia402", "angle_following_error_deg"), AT(cia402.angle_following_error_deg_q16), .type = &config_type_decimal, .count = 1,
     .unit = "deg", .fallback = "10", ABOVE_ZERO(1000), .needs = CONFIG_NEEDS_ANGLE, .help = "the same of the rotation motor"},
    {KEY("cia402", "following_error_ms"), AT(cia402.following_error_ms), .type = &config_type_integer, .unit = "ms", .fallback = "20",
     RANGE(0, 1000), .help = "how long a drive may be outside its window (6066h)"},
    {KEY("cia402", "quick_stop_mm_s2"), AT(cia402.quick_stop_mm_s2_q16), .type = &config_type_decimal, .count = 1, .unit = "mm/s^2",
     .fallback = "0", RANGE(0, MOST_Q16), .help = "deceleration of a quick stop (6085h); 0 = as the drive has it"},
    {KEY("cia402", "angle_quick_stop_deg_s2"), AT(cia402.angle_quick_stop_deg_s2_q16), .type = &config_type_decimal, .count = 1,
     .unit = "deg/s^2", .fallback = "0", RANGE(0, MOST_Q16), .needs = CONFIG_NEEDS_ANGLE, .help = "the same of the rotation motor"},
    {KEY("cia402", "when_gateway_lost"), AT(cia402.when_gateway_lost), .type = &config_type_word, .unit = "", .fallback = "fault",
     .words = "fault|disable-voltage|quick-stop", .help = "what a drive does when this gateway falls silent (6007h)"},
    {KEY("cia402", "when_mode_left"), AT(cia402.reaction[0]), .type = &config_type_word, .unit = "", .fallback = "stop",
     .words = "ignore|tell|stop", .help = "another mode in 6061h than the drive was set to, in two answers in a row as all of these: stop = fault of the drive, all stop; tell = log and status"},
    {KEY("cia402", "when_not_following"), AT(cia402.reaction[1]), .type = &config_type_word, .unit = "", .fallback = "stop",
     .words = "ignore|tell|stop", .help = "bit 12 of 6041h, once it was set: the drive ignores its set-points"},
    {KEY("cia402", "when_local"), AT(cia402.reaction[2]), .type = &config_type_word, .unit = "", .fallback = "stop",
     .words = "ignore|tell|stop", .help = "bit 9 of 6041h is not set: the drive is not led by the bus, may ignore a quick stop, and is not enabled; tell or ignore for drives that never set it"},
    {KEY("cia402", "when_no_voltage"), AT(cia402.reaction[3]), .type = &config_type_word, .unit = "", .fallback = "stop",
     .words = "ignore|tell|stop", .help = "bit 4 of 6041h, once it was set in operation: no voltage at the power stage"},
    {KEY("cia402", "when_limited"), AT(cia402.reaction[4]), .type = &config_type_word, .unit = "", .fallback = "tell",
     .words = "ignore|tell|stop", .help = "bit 11 of 6041h: a limit of the drive itself is active"},
    {KEY("cia402", "when_warning"), AT(cia402.reaction[5]), .type = &config_type_word, .unit = "", .fallback = "tell",
     .words = "ignore|tell|stop", .help = "bit 7 of 6041h: the drive warns"},
    {KEY("cia402", "when_other_master"), AT(cia402.reaction[6]), .type = &config_type_word, .unit = "", .fallback = "stop",
     .words = "ignore|tell|stop", .help = "somebody else sends SYNC, NMT, set-points or our heartbeat: stop = heaved waits at the start until nobody does, sending nothing; later a fault of all drives"},
    {KEY("cia402", "error_control"), AT(cia402.error_control), .type = &config_type_word, .unit = "", .fallback = "heartbeat",
     .words = "heartbeat|node-guarding", .help = "how heaved and the drives watch each other; node-guarding for drives without heartbeats"},
    {KEY("cia402", "heartbeat_ms"), AT(cia402.heartbeat_ms), .type = &config_type_integer, .unit = "ms", .fallback = "50",
     RANGE(5, 10000), .help = "period of the heartbeats of the gateway and of the drives (1017h), or of node guarding (100Ch)"},
    {KEY("cia402", "heartbeat_timeout_ms"), AT(cia402.heartbeat_timeout_ms), .type = &config_type_integer, .unit = "ms",
     .fallback = "150", RANGE(10, 30000), .help = "without a heartbeat for so long the other side is lost (1016h); at least twice heartbeat_ms"},
    {KEY("cia402", "sdo_timeout_ms"), AT(cia402.sdo_timeout_ms), .type = &config_type_integer, .unit = "ms", .fallback = "500",
     RANGE(10, 10000), .help = "how long a drive may take to answer while it is set up"},
    {KEY("cia402", "boot_timeout_ms"), AT(cia402.boot_timeout_ms), .type = &config_type_integer, .unit = "ms", .fallback = "5000",
     RANGE(10, 60000), .help = "how long it may take to boot after a reset of its communication"},
    {KEY("cia402", "power_timeout_ms"), AT(cia402.power_timeout_ms), .type = &config_type_integer, .unit = "ms", .fallback = "4000",
     RANGE(10, 9000), .help = "how long the drives may take to switch on, and again to enable operation"},
    {KEY("cia402", "sync_counter"), AT(cia402.sync_counter), .type = &config_type_integer, .unit = "", .fallback = "0", RANGE(0, 240),
     .help = "SYNC carries a counter up to this (1019h); 0 = none"},
    {KEY("cia402", "sync_watched"), AT(cia402.is_sync_watched), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "whether the drives are told the period of SYNC (1006h): some need that, and some then stop where one is half a period late"},
    {KEY("cia402", "answer_every"), AT(cia402.answer_every), .type = &config_type_integer, .unit = "", .fallback = "1", RANGE(1, 10),
     .help = "the drives answer at every so manyth SYNC; where sync_counter is a multiple of it they take turns, else they may answer together; not for mode = pp"},
    {KEY("cia402", "tell_torque"), AT(cia402.has_torque_report), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "the drives tell their torque (6077h) in a second TPDO, for status and metrics"},
    {KEY("cia402", "tell_following_error"), AT(cia402.has_lag), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "likewise their following error (60F4h)"},
    {KEY("cia402", "tell_inputs"), AT(cia402.has_inputs), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "likewise their digital inputs (60FDh); all three need a third TPDO"},
    {KEY("cia402", "tell_every"), AT(cia402.telemetry_every), .type = &config_type_integer, .unit = "", .fallback = "10", RANGE(1, 240),
     .help = "at every so manyth SYNC; where sync_counter is a multiple of it the drives take turns"},
    {KEY("cia402", "reset_communication"), AT(cia402.is_reset_wanted), .type = &config_type_yes_no, .unit = "", .fallback = "yes",
     .help = "whether a drive's communication is reset before it is set up"},
    {KEY("cia402", "check_supported"), AT(cia402.is_support_checked), .type = &config_type_yes_no, .unit = "", .fallback = "yes",
     .help = "whether drives that have 6502h or 60E3h, and there not the mode or the homing method, are refused; no for drives whose lists are wrong"},
    {KEY("cia402", "rpdo_deadline_ms"), AT(cia402.rpdo_deadline_ms), .type = &config_type_integer, .unit = "ms", .fallback = "0",
     RANGE(0, 10000), .help = "a drive that gets no command for so long has lost heaved (1400h:05 of its RPDOs, which it then needs); 0 = not set"},
    {KEY("cia402", "accept_without"), AT(cia402.accepted_without), .type = &config_type_set, .unit = "", .fallback = "none",
     .words = "1016|1017|100C|100D|6007|605A|605E|6065", .help = "watchdogs that the drives may lack, or have off; drives that lack others are refused"},
    {KEY("cia402", "stop_confirmed"), AT(cia402.is_stop_confirmed), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "yes: somebody has tried that each drive stops by itself when heaved is killed and when its cable is pulled; accept_without needs it"},
    {KEY("cia402", "allow_no_watchdog"), AT(cia402.is_no_watchdog_allowed), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "accepts drives without any of these watchdogs, as older files have it; --check warns: write accept_without instead"},
    {KEY("cia402", "csp_control_bits"), AT(cia402.csp_control_bits), .type = &config_type_mask, .unit = "", .fallback = "000", RANGE(0, 0x70),
     .help = "bits 4 to 6 of 6040h that a drive needs to follow set-points in mode = csp: 70 sets all three; most need none"},
    {KEY("cia402", "vendor_id"), AT(cia402.vendor_id), .type = &config_type_integer, .unit = "", .fallback = "0",
     RANGE(0, 4294967295), .help = "1018h:1 that every drive must have; 0 = any"},
    {KEY("cia402", "product_code"), AT(cia402.product_code), .type = &config_type_integer, .unit = "", .fallback = "0",
     RANGE(0, 4294967295), .help = "1018h:2 that every drive must have; 0 = any"},
    {KEY("cia402", "revision_number"), AT(cia402.revision_number), .type = &config_type_integer, .unit = "", .fallback = "0",
     RANGE(0, 4294967295), .help = "1018h:3 that every drive must have; 0 = any"},
    {KEY("cia402", "serial_numbers"), AT(cia402.serial_numbers), .type = &config_type_ids, .unit = "", .fallback = "none",
     RANGE(0, 4294967295), .help = "1018h:4 of each drive, the rotation motor last, so that none is exchanged unnoticed; 0 = any; none: not checked"},
    {KEY("cia402", "software_limit_mm"), AT(cia402.software_limit_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     .fallback = "5", RANGE(0, 1000), .help = "a cylinder's own position limits (607Dh) are set so far outside its stroke, where it has them; 0 = left as they are"},

    {KEY("can-raw", "period_us"), AT(can_raw.period_us), .type = &config_type_integer, .unit = "us", .fallback = "4000",
     RANGE(500, 1000000), .help = "period of the set-points, a multiple of cycle_us"},
    {KEY("can-raw", "id_bits"), AT(can_raw.id_bits), .type = &config_type_word, .unit = "", .fallback = "11", .words = "11|29",
     .help = "width of the identifiers"},
    {KEY("can-raw", "command_id"), AT(can_raw.command_id), .type = &config_type_ids, .unit = "", .fallback = "none",
     .help = "identifier of what is sent to drive 1, the next ones follow; or one for each drive. The rotation motor is the last"},
    {KEY("can-raw", "setpoint_id"), AT(can_raw.setpoint_id), .type = &config_type_ids, .unit = "", .fallback = "none",
     .help = "identifier of setpoint, where it is not command_id; drives share it by fields {position.1:T} {position.2:T}"},
    {KEY("can-raw", "reply_id"), AT(can_raw.reply_id), .type = &config_type_ids, .unit = "", .fallback = "none",
     .help = "the same for what the drives send; drives may share it by such fields of position_reply"},
    {KEY("can-raw", "counts_per_mm"), AT(can_raw.counts_per_mm), .type = &config_type_ratios, .unit = "", .fallback = "none",
     .count = CYLINDERS_MAX, .help = "exact, such as counts of a turn / lead; negative: the drive counts backwards"},
    {KEY("can-raw", "zero_counts"), AT(can_raw.zero_counts), .type = &config_type_wholes, .unit = "counts", .fallback = "0",
     .count = CYLINDERS_MAX, .help = "where the cylinder is fully in"},
    {KEY("can-raw", "angle_counts_per_deg"), AT(can_raw.angle_counts_per_deg), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "of the rotation motor"},
    {KEY("can-raw", "angle_zero_counts"), AT(can_raw.angle_zero_counts), .type = &config_type_wholes, .unit = "counts", .fallback = "0",
     .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "of the rotation motor at 0 deg"},
    {KEY("can-raw", "setpoint"), AT(can_raw.setpoint), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "position|speed|counter", .help = "the frame that sends a drive to a position"},
    {KEY("can-raw", "send"), AT(can_raw.send), .type = &config_type_word, .unit = "", .fallback = "every-period",
     .words = "every-period|on-change", .help = "on-change leaves out a set-point that is the last one again"},
    {KEY("can-raw", "speed_counts"), AT(can_raw.speed_counts), .type = &config_type_integer, .unit = "", .fallback = "0",
     RANGE(0, MOST_INT32), .help = "what {speed} carries at least; always, where speed_counts_per_mm_s is none"},
    {KEY("can-raw", "speed_counts_per_mm_s"), AT(can_raw.speed_counts_per_mm_s), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = CYLINDERS_MAX, .help = "{speed} follows the speed of the set-points by this ratio"},
    {KEY("can-raw", "angle_speed_counts_per_deg_s"), AT(can_raw.angle_speed_counts_per_deg_s), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "the same of the rotation motor"},
    {KEY("can-raw", "enable"), AT(can_raw.enable), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "counter", .help = "torque on"},
    {KEY("can-raw", "disable"), AT(can_raw.disable), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "counter", .help = "torque off; without it drives hold their last set-point"},
    {KEY("can-raw", "stop"), AT(can_raw.stop), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "counter", .help = "stop now, for e-stop and faults; disable follows at rest. Without it disable, else no more set-points"},
    {KEY("can-raw", "reset"), AT(can_raw.reset), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "counter", .help = "take a fault back"},
    {KEY("can-raw", "home"), AT(can_raw.home), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "counter", .help = "find the zero; without it drives are taken to know it"},
    {KEY("can-raw", "position_query"), AT(can_raw.position_query), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "counter", .help = "asks for position_reply; none where drives send it unasked"},
    {KEY("can-raw", "position_reply"), AT(can_raw.position_reply), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "position|status|fault|torque|counter", .count = 1, .help = "where a drive is"},
    {KEY("can-raw", "homing_query"), AT(can_raw.homing_query), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "counter", .help = "asks for homing_reply; asked by turns with the position until a drive is homed"},
    {KEY("can-raw", "homing_reply"), AT(can_raw.homing_reply), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "status", .count = 1, .help = "how homing stands"},
    {KEY("can-raw", "status_id"), AT(can_raw.status_id), .type = &config_type_ids, .unit = "", .fallback = "none",
     .help = "identifier of status_reply, where it is not reply_id"},
    {KEY("can-raw", "status_reply"), AT(can_raw.status_reply), .type = &config_type_frame, .unit = "", .fallback = "none",
     .words = "status|fault|torque|counter", .count = 1, .help = "status of a drive that does not tell it with its position; comes unasked"},
    {KEY("can-raw", "status_every"), AT(can_raw.status_every), .type = &config_type_integer, .unit = "periods", .fallback = "1",
     RANGE(1, 1000), .help = "how often drives send status_reply; without it for offline_periods times as long a drive is gone"},
    {KEY("can-raw", "rated_torque_counts"), AT(can_raw.rated_torque), .type = &config_type_integer, .unit = "counts", .fallback = "1000",
     RANGE(1, MOST_INT32), .help = "what {torque} carries at the rated torque of the drive; 1000 where it tells tenths of a percent"},
    {KEY("can-raw", "startup1"), AT(can_raw.startup[0]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "frame that a drive gets before it is used, -> its answer, wait and ms; then startup2, up to startup8"},
    {KEY("can-raw", "startup2"), AT(can_raw.startup[1]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "the next one"},
    {KEY("can-raw", "startup3"), AT(can_raw.startup[2]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "the next one"},
    {KEY("can-raw", "startup4"), AT(can_raw.startup[3]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "the next one"},
    {KEY("can-raw", "startup5"), AT(can_raw.startup[4]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "the next one"},
    {KEY("can-raw", "startup6"), AT(can_raw.startup[5]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "the next one"},
    {KEY("can-raw", "startup7"), AT(can_raw.startup[6]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "the next one"},
    {KEY("can-raw", "startup8"), AT(can_raw.startup[7]), .type = &config_type_step, .unit = "", .fallback = "none",
     .words = "counter", .help = "the next one"},
    {KEY("can-raw", "enabled_when"), AT(can_raw.enabled_when), .type = &config_type_when, .unit = "", .fallback = "none",
     .help = "{status} of status_reply, else of position_reply, when torque is on"},
    {KEY("can-raw", "fault_when"), AT(can_raw.fault_when), .type = &config_type_when, .unit = "", .fallback = "none",
     .help = "the same when the drive has a fault"},
    {KEY("can-raw", "homing_done_when"), AT(can_raw.homing_done_when), .type = &config_type_when, .unit = "", .fallback = "none",
     .help = "{status} of homing_reply, or the same where there is no homing_query, when the drive has its zero"},
    {KEY("can-raw", "homing_failed_when"), AT(can_raw.homing_failed_when), .type = &config_type_when, .unit = "", .fallback = "none",
     .help = "the same when homing has failed"},
    {KEY("can-raw", "query_every"), AT(can_raw.query_every), .type = &config_type_integer, .unit = "periods", .fallback = "1",
     RANGE(1, 1000), .help = "how often each drive is asked; the drives take turns"},
    {KEY("can-raw", "offline_periods"), AT(can_raw.offline_periods), .type = &config_type_integer, .unit = "periods", .fallback = "20",
     RANGE(3, 10000), .help = "without a position for so long a drive is gone; more than twice query_every"},
    {KEY("can-raw", "when_other_master"), AT(can_raw.other_master), .type = &config_type_word, .unit = "", .fallback = "stop",
     .words = "ignore|tell|stop", .help = "somebody else sends frames with the identifiers of ours: stop = heaved waits at the start until nobody does, sending nothing; later a fault of all drives"},
    {KEY("can-raw", "following_error_mm"), AT(can_raw.following_error_mm_q16), .type = &config_type_decimal, .count = 1, .unit = "mm",
     .fallback = "20", RANGE(0, 1000), .help = "largest distance of a set-point from the position last heard; 0 = not watched"},
    {KEY("can-raw", "angle_following_error_deg"), AT(can_raw.angle_following_error_deg_q16), .type = &config_type_decimal, .count = 1,
     .unit = "deg", .fallback = "20", RANGE(0, 1000), .needs = CONFIG_NEEDS_ANGLE, .help = "the same of the rotation motor"},

    {KEY("modbus", "units"), AT(modbus.units), .type = &config_type_ids, .unit = "", .words = "a unit id from 1 to 247",
     .fallback = "1", .help = "unit id of drive 1, the next ones follow; with a host for each drive the same for all; or one for each. The rotation motor is the last"},
    {KEY("modbus", "period_us"), AT(modbus.period_us), .type = &config_type_integer, .unit = "us",
     .fallback = "10000", RANGE(500, 1000000), .help = "set-points and questions to a drive are no closer; a slow line takes the time it needs"},
    {KEY("modbus", "timeout_ms"), AT(modbus.timeout_ms), .type = &config_type_integer, .unit = "ms",
     .fallback = "30", RANGE(5, 900), .help = "how long a drive may take to answer"},
    {KEY("modbus", "turnaround_us"), AT(modbus.turnaround_us), .type = &config_type_integer, .unit = "us",
     .fallback = "2000", RANGE(0, 100000), .help = "how long it usually takes, for the rate that is expected; the rate in use is measured"},
    {KEY("modbus", "retries"), AT(modbus.retries), .type = &config_type_integer, .unit = "",
     .fallback = "2", RANGE(0, 10), .help = "failures in a row that are borne, of reads and of writes; one more, and the drive is gone"},
    {KEY("modbus", "feedback_timeout_ms"), AT(modbus.feedback_timeout_ms), .type = &config_type_integer, .unit = "ms",
     .fallback = "300", RANGE(10, 10000), .help = "a drive whose newest feedback is older is gone"},
    {KEY("modbus", "read"), AT(modbus.read), .type = &config_type_word, .unit = "",
     .fallback = "holding", .words = "holding|input", .help = "registers that feedback is read from: function 3 or 4"},
    {KEY("modbus", "write"), AT(modbus.write), .type = &config_type_word, .unit = "",
     .fallback = "multiple", .words = "multiple|single", .help = "blocks of one register are written by function 16 or 6, longer ones always by 16"},
    {KEY("modbus", "broadcast"), AT(modbus.is_broadcast), .type = &config_type_yes_no, .unit = "",
     .fallback = "no", .help = "whether the drives obey broadcasts (unit 0): a stop then goes to all of a line at once, before it goes to each"},
    {KEY("modbus", "counts_per_mm"), AT(modbus.counts_per_mm), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = CYLINDERS_MAX, .help = "exact, such as counts of a turn / lead; negative: the drive counts backwards"},
    {KEY("modbus", "zero_counts"), AT(modbus.zero_counts), .type = &config_type_wholes, .unit = "counts",
     .fallback = "0", .count = CYLINDERS_MAX, .help = "where the cylinder is fully in"},
    {KEY("modbus", "angle_counts_per_deg"), AT(modbus.angle_counts_per_deg), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "of the rotation motor"},
    {KEY("modbus", "angle_zero_counts"), AT(modbus.angle_zero_counts), .type = &config_type_wholes, .unit = "counts",
     .fallback = "0", .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "of the rotation motor at 0 deg"},
    {KEY("modbus", "setpoint"), AT(modbus.setpoint), .type = &config_type_blocks, .unit = "",
     .fallback = "none", .words = "position|speed", .help = "what sends a drive to a position"},
    {KEY("modbus", "speed_counts"), AT(modbus.speed_counts), .type = &config_type_integer, .unit = "",
     .fallback = "0", RANGE(0, MOST_INT32), .help = "what {speed} carries at least; always, where speed_counts_per_mm_s is none"},
    {KEY("modbus", "speed_counts_per_mm_s"), AT(modbus.speed_counts_per_mm_s), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = CYLINDERS_MAX, .help = "{speed} follows the speed of the set-points by this ratio"},
    {KEY("modbus", "angle_speed_counts_per_deg_s"), AT(modbus.angle_speed_counts_per_deg_s), .type = &config_type_ratios, .unit = "",
     .fallback = "none", .count = 1, .needs = CONFIG_NEEDS_ANGLE, .help = "the same of the rotation motor"},
    {KEY("modbus", "feedback"), AT(modbus.feedback), .type = &config_type_blocks, .unit = "",
     .fallback = "none", .words = "position|status|alarm", .count = 1, .help = "where a drive is, how it is, and its alarm"},
    {KEY("modbus", "enable"), AT(modbus.enable), .type = &config_type_blocks, .unit = "",
     .fallback = "none", .help = "torque on"},
    {KEY("modbus", "disable"), AT(modbus.disable), .type = &config_type_blocks, .unit = "",
     .fallback = "none", .help = "torque off; without it drives hold their last set-point"},
    {KEY("modbus", "stop"), AT(modbus.stop), .type = &config_type_blocks, .unit = "",
     .fallback = "none", .help = "stop now, for e-stop and faults; disable follows at rest. Without it disable, else no more set-points"},
    {KEY("modbus", "reset"), AT(modbus.reset), .type = &config_type_blocks, .unit = "",
     .fallback = "none", .help = "take a fault back"},
    {KEY("modbus", "target_after_enable"), AT(modbus.is_target_last), .type = &config_type_yes_no, .unit = "",
     .fallback = "no", .help = "no: a drive's target is set to where it is before enable; yes: right after it, for drives that writing a target starts"},
    {KEY("modbus", "home"), AT(modbus.home), .type = &config_type_blocks, .unit = "",
     .fallback = "none", .help = "find the zero; without it drives are taken to know it"},
    {KEY("modbus", "enabled_when"), AT(modbus.enabled_when), .type = &config_type_when, .unit = "",
     .fallback = "none", .help = "{status} when torque is on"},
    {KEY("modbus", "fault_when"), AT(modbus.fault_when), .type = &config_type_when, .unit = "",
     .fallback = "none", .help = "{status} when the drive has a fault; without it an {alarm} that is not 0"},
    {KEY("modbus", "homing_done_when"), AT(modbus.homing_done_when), .type = &config_type_when, .unit = "",
     .fallback = "none", .help = "{status} when the drive has its zero"},
    {KEY("modbus", "homing_failed_when"), AT(modbus.homing_failed_when), .type = &config_type_when, .unit = "",
     .fallback = "none", .help = "{status} when homing has failed"},
    {KEY("modbus", "startup"), AT(modbus.startup), .type = &config_type_items, .unit = "",
     .fallback = "none", .help = "registers that are written, read back or looked at, in this order, before a drive is ready"},
    {KEY("modbus", "drive_timeout"), AT(modbus.drive_timeout), .type = &config_type_items, .unit = "",
     .fallback = "none", .help = "the drive's own watch over the communication, as startup: what makes it stop when this gateway falls silent"},
    {KEY("modbus", "drive_timeout_confirmed"), AT(modbus.is_drive_timeout_confirmed), .type = &config_type_yes_no, .unit = "",
     .fallback = "no", .help = "yes, where drive_timeout is none: somebody has set that watch in every drive and has seen it stop the drive"},
    {KEY("modbus", "step_mm"), AT(modbus.step_mm_q16), .type = &config_type_decimal, .unit = "mm",
     .fallback = "5", .count = 1, RANGE(0, 1000), .help = "largest way from one set-point to the next: a slow line makes the motion slower, not the steps longer; 0 = any"},
    {KEY("modbus", "angle_step_deg"), AT(modbus.angle_step_deg_q16), .type = &config_type_decimal, .unit = "deg",
     .fallback = "5", .count = 1, RANGE(0, 1000), .needs = CONFIG_NEEDS_ANGLE, .help = "the same of the rotation motor"},
    {KEY("modbus", "following_error_mm"), AT(modbus.following_error_mm_q16), .type = &config_type_decimal, .unit = "mm",
     .fallback = "20", .count = 1, RANGE(0, 1000), .help = "largest distance of a set-point from the position last heard; 0 = not watched"},
    {KEY("modbus", "angle_following_error_deg"), AT(modbus.angle_following_error_deg_q16), .type = &config_type_decimal, .unit = "deg",
     .fallback = "20", .count = 1, RANGE(0, 1000), .needs = CONFIG_NEEDS_ANGLE, .help = "the same of the rotation motor"},

    {KEY("modbus-tcp", "hosts"), AT(modbus_tcp.hosts), .type = &config_type_hosts, .unit = "",
     .fallback = "none", .help = "address of each drive, port 502 unless given; or one gateway for all, which tells them by unit"},

    {KEY("modbus-rtu", "device"), AT(modbus_rtu.device), .type = &config_type_path, .unit = "",
     .fallback = "/dev/ttyUSB0", .help = "serial port; a name of /dev/serial/by-id stays the same whatever is plugged in"},
    {KEY("modbus-rtu", "baud_bps"), AT(modbus_rtu.baud_bps), .type = &config_type_integer, .unit = "bit/s",
     .fallback = "115200", RANGE(1200, 4000000), .help = "as set in the drives"},
    {KEY("modbus-rtu", "parity"), AT(modbus_rtu.parity), .type = &config_type_word, .unit = "",
     .fallback = "even", .words = "none|even|odd", .help = "as set in the drives"},
    {KEY("modbus-rtu", "stop_bits"), AT(modbus_rtu.stop_bits), .type = &config_type_integer, .unit = "",
     .fallback = "1", RANGE(1, 2), .help = "as set in the drives; 2 where there is no parity"},
    {KEY("modbus-rtu", "rs485"), AT(modbus_rtu.rs485), .type = &config_type_word, .unit = "",
     .fallback = "automatic", .words = "automatic|kernel|rts-high|rts-low", .help = "who turns the line around: the adapter, the serial driver (TIOCSRS485), or heaved by RTS, which is high or low while sending"},
    {KEY("modbus-rtu", "rs485_delay_us"), AT(modbus_rtu.rs485_delay_us), .type = &config_type_integer, .unit = "us",
     .fallback = "0", RANGE(0, 10000), .help = "between RTS and the first bit, and the last bit and RTS"},

    {KEY("relays", "driver"), AT(relays.driver), .type = &config_type_word, .unit = "", .fallback = "sim", .words = "sim|gpio|modbus",
     .help = "the outputs in use: simulated, GPIO lines (docs/gpio.md), or coils of a Modbus board (docs/modbus.md)"},
    {KEY("relays", "chip"), AT(relays.chip), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "GPIO: label of the chip that has the lines; none: whichever has lines of these names"},
    {KEY("relays", "lines"), AT(relays.lines), .type = &config_type_lines, .unit = "", .fallback = "none",
     .help = "output line of relay 1, of relay 2, ...; as many relays as lines. GPIO: names of lines, or with chip their numbers; "
             "Modbus: numbers of coils that follow each other, from 0"},
    {KEY("relays", "active_low"), AT(relays.is_active_low), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "whether a low level closes a relay"},
    {KEY("relays", "safe_mask"), AT(settings.relay_safe_mask), .type = &config_type_mask, .unit = "", .fallback = "0", RANGE(0, 0xFFF),
     .is_live = true, .help = "relays that are closed whenever no sender is followed (every state but ENGAGED); bit 0 = relay 1"},
    {KEY("relays", "safe_after_ms"), AT(settings.relay_safe_after_ms), .type = &config_type_integer, .unit = "ms", .fallback = "0",
     RANGE(0, 600000), .is_live = true, .help = "how long a hold leaves the relays as the sender set them; every other state at once"},
    {KEY("relays", "max_on_ms"), AT(settings.relays.max_on_ms), .type = &config_type_per_relay, .unit = "ms", .fallback = "0",
     RANGE(0, 86400000), .help = "a relay that has been closed for so long opens, until a sender has asked for open; 0 = never"},
    {KEY("relays", "min_toggle_ms"), AT(settings.relays.min_toggle_ms), .type = &config_type_per_relay, .unit = "ms", .fallback = "0",
     RANGE(0, 60000), .help = "a relay that has changed stays so for this time at least; safe_mask and max_on_ms do not wait for it"},

    {KEY("relays-modbus", "host"), AT(relays_modbus.hosts), .type = &config_type_hosts, .unit = "",
     .fallback = "none", .help = "address of the board, port 502 unless given; none: it is on a serial line"},
    {KEY("relays-modbus", "device"), AT(relays_modbus.serial.device), .type = &config_type_path, .unit = "",
     .fallback = "none", .words = "none", .help = "its serial port; a name of /dev/serial/by-id stays the same whatever is plugged in"},
    {KEY("relays-modbus", "baud_bps"), AT(relays_modbus.serial.baud_bps), .type = &config_type_integer, .unit = "bit/s",
     .fallback = "9600", RANGE(1200, 4000000), .help = "as set in the board"},
    {KEY("relays-modbus", "parity"), AT(relays_modbus.serial.parity), .type = &config_type_word, .unit = "",
     .fallback = "none", .words = "none|even|odd", .help = "as set in the board"},
    {KEY("relays-modbus", "stop_bits"), AT(relays_modbus.serial.stop_bits), .type = &config_type_integer, .unit = "",
     .fallback = "1", RANGE(1, 2), .help = "as set in the board"},
    {KEY("relays-modbus", "rs485"), AT(relays_modbus.serial.rs485), .type = &config_type_word, .unit = "",
     .fallback = "automatic", .words = "automatic|kernel|rts-high|rts-low", .help = "as in [modbus-rtu]"},
    {KEY("relays-modbus", "rs485_delay_us"), AT(relays_modbus.serial.rs485_delay_us), .type = &config_type_integer, .unit = "us",
     .fallback = "0", RANGE(0, 10000), .help = "as in [modbus-rtu]"},
    {KEY("relays-modbus", "unit"), AT(relays_modbus.unit), .type = &config_type_integer, .unit = "",
     .fallback = "1", RANGE(1, 255), .help = "of the board"},
    {KEY("relays-modbus", "timeout_ms"), AT(relays_modbus.timeout_ms), .type = &config_type_integer, .unit = "ms",
     .fallback = "100", RANGE(10, 999), .help = "how long an answer may take"},

    {KEY("inputs", "driver"), AT(inputs.driver), .type = &config_type_word, .unit = "", .fallback = "sim", .words = "sim|gpio",
     .help = "the inputs in use: simulated, or GPIO lines (docs/gpio.md)"},
    {KEY("inputs", "chip"), AT(inputs.chip), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "GPIO: label of the chip that has the lines; none: whichever has lines of these names"},
    {KEY("inputs", "estop"), AT(inputs.estop_line), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "line of a normally closed contact of the emergency stop: open, or a broken wire, stops"},
    {KEY("inputs", "estop2"), AT(inputs.estop2_line), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "line of a second channel of it, normally closed too: either one stops"},
    {KEY("inputs", "estop_discrepancy_ms"), AT(inputs.estop_discrepancy_ms), .type = &config_type_integer, .unit = "ms", .fallback = "500",
     RANGE(100, 10000), .help = "two channels that disagree for so long are a fault, until both have opened together and closed again"},
    {KEY("inputs", "power"), AT(inputs.power_line), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "line of a contact that is closed while the supply is good (of a UPS): open, the platform settles and stays; not with "
             "engage = auto"},
    {KEY("inputs", "power_settle_ms"), AT(settings.power_settle_ms), .type = &config_type_integer, .unit = "ms", .fallback = "20000",
     RANGE(100, 3600000), .is_live = true, .help = "what is not settled so long after the supply began to fail stops where it is and goes off"},
    {KEY("inputs", "enable"), AT(inputs.enable_line), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "line of the enable key, closed when on: off parks, and nobody engages"},
    {KEY("inputs", "reset"), AT(inputs.reset_line), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "line of the reset button, closed when pressed"},
    {KEY("inputs", "active_low"), AT(inputs.is_active_low), .type = &config_type_yes_no, .unit = "", .fallback = "yes",
     .help = "whether a closed contact pulls its line low (contacts to ground); no: high (contacts to supply)"},

    {KEY("healthy", "driver"), AT(healthy.driver), .type = &config_type_word, .unit = "", .fallback = "none", .words = "none|gpio|relay",
     .help = "what carries it: nothing, a GPIO line of its own, or one of the relays, coils of a Modbus board included"},
    {KEY("healthy", "chip"), AT(healthy.chip), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "GPIO: label of the chip that has the line; none: whichever has a line of this name"},
    {KEY("healthy", "line"), AT(healthy.line), .type = &config_type_label, .unit = "", .fallback = "none",
     .help = "GPIO: the output line, by name, or with chip by number"},
    {KEY("healthy", "active_low"), AT(healthy.is_active_low), .type = &config_type_yes_no, .unit = "", .fallback = "no",
     .help = "whether the line rests high"},
    {KEY("healthy", "relay"), AT(settings.healthy.relay), .type = &config_type_integer, .unit = "", .fallback = "0", RANGE(0, 12),
     .help = "driver = relay: its number; senders do not switch it any more, and max_on_ms and min_toggle_ms are not for it"},
    {KEY("healthy", "toggle_ms"), AT(settings.healthy.toggle_ms), .type = &config_type_integer, .unit = "ms", .fallback = "10",
     RANGE(1, 1000), .help = "time between two edges, rounded up to whole cycles; 100 and more for a Modbus board"},
    {KEY("healthy", "off_ms"), AT(settings.healthy.off_ms), .type = &config_type_integer, .unit = "ms", .fallback = "500",
     RANGE(0, 60000), .help = "once it stops it stays away for so long at least; longer than the watchdog waits for an edge"},
    {KEY("healthy", "late_cycles"), AT(settings.healthy.late_cycles), .type = &config_type_integer, .unit = "", .fallback = "3",
     RANGE(0, 1000), .help = "a cycle that is late by more cycles than that stops it"},
};
/* clang-format on */
const size_t config_key_count = sizeof config_keys / sizeof config_keys[0];

int config_section_find(const char *name)
{
    for (size_t i = 0; i < config_section_count; i++) {
        if (strcmp(config_sections[i].name, name) == 0) {
            return (int)i;
        }
    }
    return -1;
}

int config_key_find(const char *section, const char *name)
{
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].section, section) == 0 && strcmp(config_keys[i].name, name) == 0) {
            return (int)i;
        }
    }
    return -1;
}

static unsigned smallest(unsigned a, unsigned b, unsigned c)
{
    const unsigned ab = a < b ? a : b;
    return ab < c ? ab : c;
}

static int lower(char byte)
{
    return byte >= 'A' && byte <= 'Z' ? byte - 'A' + 'a' : byte;
}

/* Levenshtein distance, capitals and small letters alike; one row of the matrix at a time. */
static unsigned edit_distance(const char *from, const char *to)
{
    unsigned row[SUGGEST_LENGTH_MAX + 1u];
    const size_t width = strlen(to);
    if (width > SUGGEST_LENGTH_MAX || strlen(from) > SUGGEST_LENGTH_MAX) {
        return SUGGEST_LENGTH_MAX;
    }
    for (unsigned j = 0; j <= width; j++) {
        row[j] = j;
    }
    for (unsigned i = 1; from[i - 1u] != '\0'; i++) {
        unsigned diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= width; j++) {
            const unsigned above = row[j];
            row[j] = smallest(above + 1u, row[j - 1u] + 1u, diagonal + (lower(from[i - 1u]) != lower(to[j - 1u])));
            diagonal = above;
        }
    }
    return row[width];
}

/* Keeps the better of two suggestions. */
static void offer(const char *asked, const char *name, const char **best, unsigned *best_distance)
{
    const unsigned distance = edit_distance(asked, name);
    if (distance < *best_distance) {
        *best = name;
        *best_distance = distance;
    }
}

/* A suggestion may differ in a third of the letters. */
static unsigned distance_limit(const char *asked)
{
    return (unsigned)(strlen(asked) / 3u) + 2u;
}

const char *config_section_suggest(const char *name)
{
    const char *best = NULL;
    unsigned distance = distance_limit(name);
    for (size_t i = 0; i < config_section_count; i++) {
        offer(name, config_sections[i].name, &best, &distance);
    }
    return best;
}

const char *config_key_suggest(const char *section, const char *name)
{
    const char *best = NULL;
    unsigned distance = distance_limit(name);
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].section, section) == 0) {
            offer(name, config_keys[i].name, &best, &distance);
        }
    }
    return best;
}

bool config_is_applicable(config_needs_t needs, const config_t *config)
{
    switch (needs) {
    case CONFIG_NEEDS_NOTHING:
        return true;
    case CONFIG_NEEDS_HEXAPOD:
        return config->settings.geometry.kind == KIN_HEXAPOD;
    case CONFIG_NEEDS_ANGLE:
        return config->settings.has_angle;
    }
    return true;
}

const char *config_axis_unit(unsigned axis)
{
    return axis >= AXIS_X && axis <= AXIS_Z ? "mm" : "deg";
}

const char *config_kind_name(kin_kind_t kind)
{
    static const char *const names[] = {"hexapod", "tripod", "tripod-3rps"};
    return names[kind];
}

bool config_has_axis(const config_t *config, unsigned axis)
{
    if (axis == AXIS_ANGLE) {
        return config->settings.has_angle;
    }
    return config_is_applicable(config_sections[config_section_find(config_axis_section[axis])].needs, config);
}
