/* SPDX-License-Identifier: MIT
 * service_text.c - requests and answers of SERVICE in words; see heave/service.h.
 */
#include "heave/service.h"

static const char k_at_end[] = "there is no way left in that direction, or the speed is too low to count; a signal takes its "
                               "amplitude of way to both sides";
static const char k_bad_signal[] =
    "a signal has 0.01 to 50 Hz, eight cycles for a period at least, and lasts 3 to 600 s, six periods "
    "of its lowest frequency at least, four of steps; a chirp takes four, and 1.3 for each octave";

static const char k_moving[] = "drives are read in OFF, SERVICE, FAULT and ESTOP only: elsewhere the bus belongs to the motion";
static const char k_relied_on[] =
    "heaved relies on this object and sets it itself, or the length of a count follows from it: nobody else writes it. The "
    "configuration says what it holds ([cia402], a start-up list), or the maker's own program, with heaved stopped";

const char *service_answer_text(service_answer_t answer)
{
    static const char *const k_texts[SERVICE_ANSWERS] = {
        [SERVICE_DONE] = "",
        [SERVICE_NOT_SERVING] = "this is possible in SERVICE only: `service` enters it from OFF or SETTLED",
        [SERVICE_STALE] = "the tick is older than 250 ms: echo the newest one",
        [SERVICE_OVER] = "the hand was away for 250 ms, or this series is not the one that is held: press again",
        [SERVICE_KNOWN] = "not newer than the last one: count upwards",
        [SERVICE_BUSY] = "something is held or moves: let go of it first",
        [SERVICE_NO_SUCH] = "this platform has no such drive, axis or relay",
        [SERVICE_NO_TORQUE] = "a drive has no torque: `torque` switches it on",
        [SERVICE_NOT_HOMED] = "a drive has not found its zero: `home` first",
        [SERVICE_AT_END] = k_at_end,
        [SERVICE_NO_POSE] = "no pose belongs to where the cylinders are: jog them one by one",
        [SERVICE_TOGETHER] = "this bus does that to all drives together only: `all`",
        [SERVICE_NOT_TAKEN] = "the drives do not take it now: try again",
        [SERVICE_PULSE] = "that relay carries the healthy pulse: nobody switches it",
        [SERVICE_TOO_WIDE] = "wider than [service] signal_mm, signal_deg allow",
        [SERVICE_BAD_SIGNAL] = k_bad_signal,
        [SERVICE_MOVING] = k_moving,
        [SERVICE_NO_OBJECTS] = "these drives have no objects: it takes CANopen drives ([drives] driver = cia402)",
        [SERVICE_ABSENT] = "the drive does not answer, or heaved is setting it up: try again",
        [SERVICE_RELIED_ON] = k_relied_on,
    };
    return (unsigned)answer < SERVICE_ANSWERS ? k_texts[answer] : "?";
}

const char *service_answer_name(service_answer_t answer)
{
    static const char *const k_names[SERVICE_ANSWERS] = {
        [SERVICE_DONE] = "",
        [SERVICE_NOT_SERVING] = "not-serving",
        [SERVICE_STALE] = "stale",
        [SERVICE_OVER] = "over",
        [SERVICE_KNOWN] = "known",
        [SERVICE_BUSY] = "busy",
        [SERVICE_NO_SUCH] = "no-such",
        [SERVICE_NO_TORQUE] = "no-torque",
        [SERVICE_NOT_HOMED] = "not-homed",
        [SERVICE_AT_END] = "at-end",
        [SERVICE_NO_POSE] = "no-pose",
        [SERVICE_TOGETHER] = "together",
        [SERVICE_NOT_TAKEN] = "not-taken",
        [SERVICE_PULSE] = "pulse",
        [SERVICE_TOO_WIDE] = "too-wide",
        [SERVICE_BAD_SIGNAL] = "bad-signal",
        [SERVICE_MOVING] = "moving",
        [SERVICE_NO_OBJECTS] = "no-objects",
        [SERVICE_ABSENT] = "absent",
        [SERVICE_RELIED_ON] = "relied-on",
    };
    return (unsigned)answer < SERVICE_ANSWERS ? k_names[answer] : "?";
}

const char *service_verb_name(service_verb_t verb)
{
    static const char *const k_names[SERVICE_VERBS] = {
        [SERVICE_NOTHING] = "nothing",    [SERVICE_TORQUE_ON] = "torque",   [SERVICE_TORQUE_OFF] = "torque",
        [SERVICE_JOG_AXIS] = "jog",       [SERVICE_JOG_POSE] = "jog",       [SERVICE_HOME] = "home",
        [SERVICE_SIGNAL_AXIS] = "signal", [SERVICE_SIGNAL_POSE] = "signal", [SERVICE_RELAY] = "relay",
        [SERVICE_BEAT] = "beat",          [SERVICE_RELEASE] = "release",
    };
    return (unsigned)verb < SERVICE_VERBS ? k_names[verb] : "?";
}
