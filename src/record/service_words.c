/* SPDX-License-Identifier: MIT
 * service_words.c - requests of SERVICE in words; see service_words.h.
 */
#include "record/service_words.h"

#include <string.h>

#include "common/decimal.h"
#include "heave/number.h"

#define WORDS_MAX 9u

static const char k_bad_torque[] = "torque: `torque N on`, `torque N off`, `torque all on` and `torque all off` are allowed";
static const char k_bad_jog[] =
    "jog: `jog N SPEED TICK` or `jog N SPEED WAY TICK` with a drive's number or roll, pitch, yaw, x, y, z and mm/s or deg/s, "
    "as in `jog 3 -2.5 184000`, is allowed";
static const char k_bad_signal[] = "signal: `signal N|AXIS sine|step AMPLITUDE HZ SECONDS TICK` and `signal N|AXIS chirp|noise "
                                   "AMPLITUDE HZ TO_HZ SECONDS TICK`, "
                                   "as in `signal z chirp 2 0.2 20 60 184000`, are allowed";
static const char k_bad_home[] = "home: `home N TICK` and `home all TICK` are allowed";
static const char k_bad_relay[] = "relay: `relay N TICK` is allowed";
static const char k_bad_beat[] = "beat: `beat SERIES COUNTER TICK` is allowed, the counter from 1 upwards";
static const char k_bad_release[] = "release: `release SERIES` is allowed";

static const char *const k_signals[EXCITATION_KINDS] = {"sine", "step", "chirp", "noise"};
static const char *const k_axes[POSE_AXES] = {"roll", "pitch", "yaw", "x", "y", "z"};

typedef struct {
    const char *at;
    size_t length;
} word_t;

/* Splits into words. Returns their number; with more than WORDS_MAX words, WORDS_MAX + 1. */
static unsigned split(const char *text, size_t length, word_t word[WORDS_MAX])
{
    unsigned count = 0;
    for (size_t i = 0; i < length;) {
        size_t end = i;
        while (end < length && text[end] != ' ') {
            end++;
        }
        if (end > i) {
            if (count == WORDS_MAX) {
                return count + 1u;
            }
            word[count++] = (word_t){&text[i], end - i};
        }
        i = end + 1;
    }
    return count;
}

static bool is_word(const word_t *word, const char *text)
{
    return strlen(text) == word->length && memcmp(word->at, text, word->length) == 0;
}

static bool read_whole(const word_t *word, uint64_t most, uint64_t *out)
{
    *out = 0;
    for (size_t i = 0; i < word->length; i++) {
        const char c = word->at[i];
        if (c < '0' || c > '9' || *out > most / 10u) {
            return false;
        }
        *out = *out * 10u + (uint64_t)(c - '0');
    }
    return word->length > 0 && *out <= most;
}

static bool read_u32(const word_t *word, uint32_t least, uint32_t *out)
{
    uint64_t value = 0;
    const bool is_read = read_whole(word, UINT32_MAX, &value) && value >= least;
    *out = (uint32_t)value;
    return is_read;
}

/* A number from 1, or `all` where that is allowed. */
static bool read_axis(const word_t *word, bool is_all_allowed, uint8_t *out)
{
    uint64_t value = SERVICE_ALL;
    if (is_all_allowed && is_word(word, "all")) {
        *out = SERVICE_ALL;
        return true;
    }
    const bool is_read = read_whole(word, UINT8_MAX, &value) && value > 0;
    *out = (uint8_t)value;
    return is_read;
}

/* A drive's number, or an axis of the pose by its name. */
static bool read_led(const word_t *axis, service_verb_t of_axis, service_verb_t of_pose, service_request_t *out)
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        if (is_word(axis, k_axes[i])) {
            out->verb = of_pose;
            out->axis = (uint8_t)(i + 1u);
            return true;
        }
    }
    out->verb = of_axis;
    return read_axis(axis, false, &out->axis);
}

static bool read_jog(const word_t *axis, const word_t *speed, service_request_t *out)
{
    return read_led(axis, SERVICE_JOG_AXIS, SERVICE_JOG_POSE, out) &&
           number_parse(speed->at, speed->length, &out->speed_q16) == NUMBER_OK && out->speed_q16 != 0;
}

static bool read_way(const word_t *way, service_request_t *out)
{
    return number_parse(way->at, way->length, &out->way_q16) == NUMBER_OK && out->way_q16 > 0;
}

/* A number above 0 in thousandths. */
static bool read_milli(const word_t *word, uint32_t *out)
{
    q16_t value_q16 = 0;
    const bool is_read = number_parse(word->at, word->length, &value_q16) == NUMBER_OK && value_q16 > 0;
    *out = is_read ? (uint32_t)(((int64_t)value_q16 * 1000 + 32768) >> 16) : 0;
    return is_read;
}

/* The words between the verb and the proof.
 * @param used out: how many */
static bool read_signal(const word_t *word, unsigned count, service_request_t *out, unsigned *used)
{
    excitation_request_t *signal = &out->signal;
    unsigned kind = 0;
    while (kind < EXCITATION_KINDS && !is_word(&word[1], k_signals[kind])) {
        kind++;
    }
    signal->kind = (excitation_kind_t)kind;
    const bool has_band = kind == EXCITATION_CHIRP || kind == EXCITATION_NOISE;
    *used = has_band ? 6u : 5u;
    return kind < EXCITATION_KINDS && count > *used && read_led(&word[0], SERVICE_SIGNAL_AXIS, SERVICE_SIGNAL_POSE, out) &&
           number_parse(word[2].at, word[2].length, &signal->amplitude_q16) == NUMBER_OK && signal->amplitude_q16 > 0 &&
           read_milli(&word[3], &signal->from_mhz) && (!has_band || read_milli(&word[4], &signal->to_mhz)) &&
           read_milli(&word[*used - 1u], &signal->duration_ms);
}

/* What stands at the end of a request that is held: a tick, or series and age. */
static bool read_proof(const word_t *word, unsigned count, bool is_file, service_request_t *out, uint64_t *tick_us)
{
    if (!is_file) {
        return count == 1u && read_whole(&word[0], UINT64_MAX / 4u, tick_us);
    }
    return count == 2u && read_u32(&word[0], 1, &out->series) && read_whole(&word[1], UINT64_MAX / 4u, &out->age_us);
}

static const char *read_torque(const word_t *word, unsigned count, service_request_t *out)
{
    if (count != 3u || !read_axis(&word[1], true, &out->axis) || (!is_word(&word[2], "on") && !is_word(&word[2], "off"))) {
        return k_bad_torque;
    }
    out->verb = is_word(&word[2], "on") ? SERVICE_TORQUE_ON : SERVICE_TORQUE_OFF;
    return NULL;
}

static bool read_beat(const word_t *word, unsigned count, bool is_file, service_request_t *out, uint64_t *tick_us)
{
    out->verb = SERVICE_BEAT;
    return count == 4u && read_u32(&word[1], 1, &out->series) && read_u32(&word[2], 1, &out->counter) &&
           read_whole(&word[3], UINT64_MAX / 4u, is_file ? &out->age_us : tick_us);
}

bool service_words_are(const char *text, size_t length)
{
    static const char *const k_verbs[] = {"torque", "jog", "home", "relay", "signal", "beat", "release"};
    word_t word[WORDS_MAX];
    const unsigned count = split(text, length, word);
    for (size_t i = 0; count > 0 && i < sizeof k_verbs / sizeof k_verbs[0]; i++) {
        if (is_word(&word[0], k_verbs[i])) {
            return true;
        }
    }
    return false;
}

static const char *read_jog_words(const word_t *word, unsigned count, bool is_file, service_request_t *out, uint64_t *tick_us)
{
    const unsigned proof = is_file ? 2u : 1u;
    const bool has_way = count == 4u + proof;
    const bool is_good = (has_way || count == 3u + proof) && read_jog(&word[1], &word[2], out) &&
                         (!has_way || read_way(&word[3], out)) && read_proof(&word[count - proof], proof, is_file, out, tick_us);
    return is_good ? NULL : k_bad_jog;
}

static const char *read_signal_words(const word_t *word, unsigned count, bool is_file, service_request_t *out, uint64_t *tick_us)
{
    unsigned used = 0;
    const bool is_good = count > 1u && count <= WORDS_MAX && read_signal(&word[1], count - 1u, out, &used) &&
                         read_proof(&word[1u + used], count - 1u - used, is_file, out, tick_us);
    return is_good ? NULL : k_bad_signal;
}

static const char *read_home_or_relay(const word_t *word, unsigned count, bool is_file, service_request_t *out, uint64_t *tick_us)
{
    const bool is_home = is_word(&word[0], "home");
    out->verb = is_home ? SERVICE_HOME : SERVICE_RELAY;
    const bool is_good = count > 2u && count <= WORDS_MAX && read_axis(&word[1], is_home, &out->axis) &&
                         read_proof(&word[2], count - 2u, is_file, out, tick_us);
    return is_good ? NULL : is_home ? k_bad_home : k_bad_relay;
}

const char *service_words_read(const char *text, size_t length, bool is_file, service_request_t *out, uint64_t *tick_us)
{
    word_t word[WORDS_MAX];
    const unsigned count = split(text, length, word);
    *out = (service_request_t){.verb = SERVICE_NOTHING};
    *tick_us = 0;
    if (count == 0 || is_word(&word[0], "torque")) {
        return read_torque(word, count, out);
    }
    if (is_word(&word[0], "jog")) {
        return read_jog_words(word, count, is_file, out, tick_us);
    }
    if (is_word(&word[0], "signal")) {
        return read_signal_words(word, count, is_file, out, tick_us);
    }
    if (is_word(&word[0], "home") || is_word(&word[0], "relay")) {
        return read_home_or_relay(word, count, is_file, out, tick_us);
    }
    if (is_word(&word[0], "beat")) {
        return read_beat(word, count, is_file, out, tick_us) ? NULL : k_bad_beat;
    }
    out->verb = SERVICE_RELEASE;
    return is_word(&word[0], "release") && count == 2u && read_u32(&word[1], 1, &out->series) ? NULL : k_bad_release;
}

static size_t put_number(char *to, uint64_t number)
{
    to[0] = ' ';
    return 1u + decimal_put_u64(&to[1], number);
}

static size_t put_axis(char *to, const service_request_t *request)
{
    const bool is_posed = request->verb == SERVICE_JOG_POSE || request->verb == SERVICE_SIGNAL_POSE;
    const bool is_named = is_posed && request->axis >= 1 && request->axis <= POSE_AXES;
    if (is_named || request->axis == SERVICE_ALL) {
        to[0] = ' ';
        return 1u + decimal_put_text(&to[1], is_named ? k_axes[request->axis - 1u] : "all");
    }
    return put_number(to, request->axis);
}

static size_t put_milli(char *to, uint32_t milli)
{
    to[0] = ' ';
    return 1u + decimal_put_q32(&to[1], fx_mul_div(milli, Q32_ONE, 1000), 3);
}

static size_t put_signal(char *to, const excitation_request_t *signal)
{
    size_t at = 0;
    to[at++] = ' ';
    at += decimal_put_text(&to[at], signal->kind < EXCITATION_KINDS ? k_signals[signal->kind] : "?");
    to[at++] = ' ';
    at += decimal_put_q32(&to[at], q32_from_q16(signal->amplitude_q16), 6);
    at += put_milli(&to[at], signal->from_mhz);
    at += signal->to_mhz != 0 ? put_milli(&to[at], signal->to_mhz) : 0;
    return at + put_milli(&to[at], signal->duration_ms);
}

size_t service_words_put(char to[SERVICE_WORDS_MAX], const service_request_t *request)
{
    size_t at = decimal_put_text(to, service_verb_name(request->verb));
    if (request->verb == SERVICE_BEAT || request->verb == SERVICE_RELEASE) {
        at += put_number(&to[at], request->series);
        if (request->verb == SERVICE_BEAT) {
            at += put_number(&to[at], request->counter);
            at += put_number(&to[at], request->age_us);
        }
        return at;
    }
    at += put_axis(&to[at], request);
    if (!service_is_held(request->verb)) {
        return at + decimal_put_text(&to[at], request->verb == SERVICE_TORQUE_ON ? " on" : " off");
    }
    if (request->verb == SERVICE_JOG_AXIS || request->verb == SERVICE_JOG_POSE) {
        to[at++] = ' ';
        at += decimal_put_q32(&to[at], q32_from_q16(request->speed_q16), 6); /* enough to be read back as the same Q16 */
        if (request->way_q16 > 0) {
            to[at++] = ' ';
            at += decimal_put_q32(&to[at], q32_from_q16(request->way_q16), 6);
        }
    }
    if (request->verb == SERVICE_SIGNAL_AXIS || request->verb == SERVICE_SIGNAL_POSE) {
        at += put_signal(&to[at], &request->signal);
    }
    at += put_number(&to[at], request->series);
    return at + put_number(&to[at], request->age_us);
}
