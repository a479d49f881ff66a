/* SPDX-License-Identifier: MIT
 * fuzz_gateway.c - datagrams through a whole gateway that follows. Input: platform, dialect and confirmation of jumps, then
 * records: cycles to wait, sender, length, datagram. What must hold: a second gateway that only gets the good frames, printed
 * anew, is in the same state all the time (what was rejected has changed nothing but counters and log); accepted, rejected and
 * other senders' frames add up to what came; set-points stay within the limits and no drive finds a following error.
 */
#include <string.h>

#include "frame_print.h"
#include "fuzz.h"
#include "rig.h"

#define PLATFORMS    2u
#define RECORDS_MAX  16u
#define WAIT_MAX     24u /* cycles */
#define FRAMES_MAX   20u /* of a datagram */
#define HOSTS        3u
#define OVERSIZE_MAX 600u

/* The one that gets everything, and the one that gets the good frames alone. */
typedef struct {
    rig_t all;
    rig_t good;
} pair_t;

static pair_t m_start[PLATFORMS]; /* when they had come up */
static pair_t m_pair;             /* handles point in here */
static gateway_t m_all, m_good;   /* what is compared of them */
static bool m_is_up;

static void bring_up(unsigned platform)
{
    const settings_t settings = platform == 0 ? rig_hexapod() : rig_tripod();
    rig_t *const rig[] = {&m_pair.all, &m_pair.good};
    for (unsigned i = 0; i < 2; i++) {
        rig_start(rig[i], &settings, true);
        FUZZ_REQUIRE(rig_run_until(rig[i], STATE_ENGAGED, 60000));
    }
    m_start[platform] = m_pair;
}

static void start(uint8_t choice)
{
    if (!m_is_up) {
        bring_up(0);
        bring_up(1);
        m_is_up = true;
    }
    m_pair = m_start[choice % PLATFORMS];
    const frame_dialect_t dialect = (choice & 2) != 0 ? FRAME_LENIENT : FRAME_V3;
    const q16_t confirm_mm_q16 = (choice & 4) != 0 ? 20 * 65536 : 0;
    m_pair.all.settings.dialect = m_pair.good.settings.dialect = dialect;
    m_pair.all.settings.confirm_jump_mm_q16 = m_pair.good.settings.confirm_jump_mm_q16 = confirm_mm_q16;
}

static void push(rig_t *rig, unsigned host, const void *bytes, size_t length)
{
    const hal_udp_peer_t from = {.address = {10, 0, 0, (uint8_t)host}, .port = (uint16_t)(4000 + host)};
    FUZZ_REQUIRE(sim_udp_push(&rig->udp, bytes, length, &from) == HV_OK);
}

/* Sends a datagram to the one and its frames to the other.
 * Returns how many events it leads to; *frames: good ones. */
static uint32_t send_both(unsigned host, const uint8_t *bytes, size_t length, uint32_t *frames)
{
    frame_scanner_t scanner;
    frame_t frame;
    frame_reject_t reject;
    frame_event_t event = FRAME_EVENT_NONE;
    size_t position = 0;
    uint32_t events = 0;
    *frames = 0;
    push(&m_pair.all, host, bytes, length);
    if (length > GATEWAY_DATAGRAM_MAX) {
        return 0;
    }
    frame_scanner_init(&scanner, m_pair.all.settings.dialect);
    while ((event = frame_next(&scanner, bytes, length, &position, &frame, &reject)) != FRAME_EVENT_NONE) {
        events++;
        if (event == FRAME_EVENT_FRAME) {
            char text[FRAME_PRINT_MAX];
            push(&m_pair.good, host, text, frame_print(&frame, text));
            ++*frames;
        }
    }
    return events;
}

/* Frames that were judged, whatever the verdict. */
static uint32_t judged(const counters_t *counters)
{
    uint32_t sum = counters->other_sender;
    for (unsigned i = 0; i < FRAME_COMMANDS; i++) {
        sum += counters->accepted[i];
    }
    for (unsigned i = 0; i < FRAME_ERRORS; i++) {
        sum += counters->rejected[i];
    }
    return sum;
}

/* The same with nothing in the gaps between its members. */
static void tidy_owner(owner_t *owner)
{
    const owner_t was = *owner;
    memset(owner, 0, sizeof *owner);
    owner->is_taken = was.is_taken;
    owner->last_us = was.last_us;
    memcpy(owner->peer.address, was.peer.address, sizeof was.peer.address);
    owner->peer.scope_id = was.peer.scope_id;
    owner->peer.port = was.peer.port;
    owner->peer.is_ipv6 = was.peer.is_ipv6;
    owner->is_port_fixed = was.is_port_fixed;
    owner->ports = was.ports;
    owner->turns = was.turns;
    owner->first_port = was.first_port;
    owner->turn_us = was.turn_us;
    memcpy(owner->port, was.port, sizeof was.port);
}

static void tidy_target(motion_target_t *target)
{
    const motion_target_t was = *target;
    memset(target, 0, sizeof *target);
    target->space = was.space;
    memcpy(target->value_q32, was.value_q32, sizeof was.value_q32);
    target->has_angle = was.has_angle;
    target->angle_deg_q32 = was.angle_deg_q32;
    target->is_timed = was.is_timed;
    target->time_ms = was.time_ms;
}

static void tidy_jump(confirm_jump_t *jump)
{
    const confirm_jump_t was = *jump;
    memset(jump, 0, sizeof *jump);
    jump->space = was.space;
    jump->axis = was.axis;
    jump->value_q32 = was.value_q32;
    jump->from_q32 = was.from_q32;
}

static void tidy_feedback(drive_feedback_t *feedback)
{
    const drive_feedback_t was = *feedback;
    memset(feedback, 0, sizeof *feedback);
    feedback->state = was.state;
    feedback->is_homed = was.is_homed;
    feedback->has_actual = was.has_actual;
    feedback->is_energized = was.is_energized;
    feedback->actual_mm_q32 = was.actual_mm_q32;
    feedback->actual_us = was.actual_us;
    feedback->fault_code = was.fault_code;
    feedback->guard = was.guard;
}

/* All a gateway knows but what is said and counted of rejects. */
static void forget_rejects(const gateway_t *gateway, gateway_t *out)
{
    gateway_save(gateway, out);
    counters_t *counters = &out->snapshot.counters;
    const uint32_t platform = counters->rejected[FRAME_ERR_PLATFORM], form = counters->rejected[FRAME_ERR_MASK_FORM];
    memset(counters->rejected, 0, sizeof counters->rejected);
    counters->rejected[FRAME_ERR_PLATFORM] = platform; /* of good frames */
    counters->rejected[FRAME_ERR_MASK_FORM] = form;    /* as well */
    counters->datagrams = counters->oversize = 0;
    const uint32_t waited_us = out->receiver.waited_us;
    memset(&out->receiver, 0, sizeof out->receiver);
    out->receiver.waited_us = waited_us;
    tidy_owner(&out->sender.owner);
    tidy_owner(&out->snapshot.owner);
    tidy_owner(&out->snapshot.other);
    tidy_target(&out->sender.confirm.last);
    tidy_target(&out->sender.confirm.waiting);
    tidy_jump(&out->sender.confirm.jump);
    tidy_jump(&out->sender.confirm.drop);
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        tidy_feedback(&out->snapshot.drive[i]);
    }
}

static void compare(void)
{
    forget_rejects(&m_pair.all.gateway, &m_all);
    forget_rejects(&m_pair.good.gateway, &m_good);
    FUZZ_REQUIRE(memcmp(&m_all, &m_good, sizeof m_all) == 0);
    FUZZ_REQUIRE(memcmp(m_pair.all.sent_q32, m_pair.good.sent_q32, sizeof m_pair.all.sent_q32) == 0);
}

static void cycles(uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        rig_run_ms(&m_pair.all, 1);
        rig_run_ms(&m_pair.good, 1);
    }
    compare();
}

static bool take_record(fuzz_input_t *in)
{
    uint32_t frames = 0;
    const uint32_t wait = fuzz_u8(in) % WAIT_MAX;
    const unsigned host = 1u + fuzz_u8(in) % HOSTS;
    size_t length = fuzz_u16(in) % OVERSIZE_MAX;
    const uint8_t *bytes = fuzz_bytes(in, &length);
    const counters_t before = m_pair.all.gateway.snapshot.counters;
    const uint32_t events = send_both(host, bytes, length, &frames);
    if (frames > FRAMES_MAX) {
        return false;
    }
    cycles(1);
    const counters_t *after = &m_pair.all.gateway.snapshot.counters;
    const uint32_t sum = judged(after) - judged(&before);
    const bool may_be_refused_late = frames > GATEWAY_TARGETS_PER_CYCLE; /* it has been counted as accepted before */
    FUZZ_REQUIRE(after->datagrams - before.datagrams == 1);
    FUZZ_REQUIRE(after->oversize - before.oversize == (length > GATEWAY_DATAGRAM_MAX));
    FUZZ_REQUIRE(sum == events || (may_be_refused_late && sum == events + 1));
    cycles(wait);
    return true;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input_t in = {data, size};
    start(fuzz_u8(&in));
    for (unsigned i = 0; i < RECORDS_MAX && in.left > 0 && take_record(&in); i++) {}
    FUZZ_REQUIRE(rig_is_within_limits(&m_pair.all));
    FUZZ_REQUIRE(rig_following_errors(&m_pair.all) == 0);
    return 0;
}
