/* SPDX-License-Identifier: MIT
 * test_hal_can.c - the contract of hal/can.h on every backend; the simulated bus: arbitration, timing, fault plan; and what
 * goes wrong with interfaces of Linux.
 *
 *     test_contract_hal_can           the simulated bus
 *     test_contract_hal_can --local   the bus between programs, as heave-twin is it
 *     test_contract_hal_can --linux   SocketCAN on vcan0, as root on a kernel of its own (tests/lib/kernel.py)
 */
#include "contract.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "linux_can.h"
#include "linux_can_local.h"
#include "linux_clock.h"
#include "sim_can.h"
#include "twin/wire.h"

/** A backend under test, with a partner on the same bus that acknowledges, sends and listens to everything. */
typedef struct {
    const char *name;
    bool (*open)(hal_can_t *can, const hal_can_filter_t *filter, uint32_t filters); /**< false: not to be had on this machine */
    void (*close)(void);
    void (*settle)(void);                     /**< until everything that can move on the wire has moved */
    void (*inject)(const can_frame_t *frame); /**< the partner sends */
    bool (*fetch)(can_frame_t *frame);        /**< the partner takes the next frame it heard, false: none */
    uint32_t queue_max;                       /**< send must have refused by then while nothing leaves */
    void (*set_partner)(bool is_there);       /**< NULL: the partner cannot leave */
    void (*set_plugged)(bool is_plugged);     /**< pulls the adapter out; NULL: cannot */
    void (*set_bus_off)(void);                /**< NULL: cannot */
} fixture_t;

static const fixture_t *fixture;
static hal_can_t hal;

static sim_can_bus_t bus;
static sim_can_t node, partner;
static uint64_t sim_now_us;

static void open_bus(uint32_t frame_us, const sim_can_fault_t *plan, uint32_t planned, const hal_can_filter_t *filter,
                     uint32_t filters)
{
    sim_now_us = 0;
    sim_can_bus_init(&bus, frame_us, plan, planned);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, filter, filters));
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&partner, &bus, NULL, 0));
}

static bool open_sim(hal_can_t *can, const hal_can_filter_t *filter, uint32_t filters)
{
    open_bus(115, NULL, 0, filter, filters);
    *can = sim_can_hal(&node);
    return true;
}

static void close_sim(void)
{
    sim_can_close(&node);
    sim_can_close(&partner);
}

static void settle_sim(void)
{
    sim_now_us += 100000;
    sim_can_bus_step(&bus, sim_now_us);
}

static void inject_sim(const can_frame_t *frame)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&partner), frame));
}

static bool fetch_sim(can_frame_t *frame)
{
    uint64_t time_us;
    while (hal_can_recv(sim_can_hal(&partner), frame, &time_us) == HV_OK) {
        if (!frame->is_error) {
            return true;
        }
    }
    return false;
}

static void set_partner_sim(bool is_there)
{
    if (is_there) {
        TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&partner, &bus, NULL, 0));
    } else {
        sim_can_close(&partner);
    }
}

static void set_plugged_sim(bool is_plugged)
{
    (is_plugged ? sim_can_plug : sim_can_unplug)(&node);
}

static void bus_off_sim(void)
{
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
}

static const fixture_t k_sim = {"sim",     open_sim, close_sim,       settle_sim,      inject_sim,
                                fetch_sim, 1000,     set_partner_sim, set_plugged_sim, bus_off_sim};

/* SocketCAN on vcan0; the partner is a plain socket. The wire is stopped by a token bucket that never fills again. */

static linux_can_t lin;
static int peer = -1;

static void shell(const char *command)
{
    TEST_ASSERT_EQUAL_MESSAGE(0, system(command), command);
}

static int open_peer(void)
{
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex("vcan0")};
    const int fd = socket(AF_CAN, SOCK_RAW | SOCK_NONBLOCK, CAN_RAW);
    TEST_ASSERT_TRUE(fd >= 0 && bind(fd, (struct sockaddr *)&address, sizeof address) == 0);
    return fd;
}

static bool open_linux(hal_can_t *can, const hal_can_filter_t *filter, uint32_t filters)
{
    TEST_ASSERT_EQUAL(HV_OK,
                      linux_can_open(&lin, &(linux_can_config_t){.interface = "vcan0", .filter = filter, .filters = filters}));
    TEST_ASSERT_EQUAL_STRING("", lin.error_text);
    peer = open_peer();
    *can = linux_can_hal(&lin);
    return true;
}

#define LOOK_AGAIN_US 500000 /* as the drivers do */

static void close_linux(void)
{
    linux_can_close(&lin);
    close(peer);
    shell("ip link show vcan0 >/dev/null 2>&1 || ip link add vcan0 txqueuelen 16 type vcan");
    shell("tc qdisc del dev vcan0 root 2>/dev/null; ip link set vcan0 up");
}

static void settle_linux(void)
{
    (void)usleep(20000);
}

static void write_peer(const struct can_frame *frame)
{
    if (write(peer, frame, sizeof *frame) < 0) { /* it may have to hear first that the interface was down */
        TEST_ASSERT_EQUAL((int)sizeof *frame, (int)write(peer, frame, sizeof *frame));
    }
}

static void inject_linux(const can_frame_t *frame)
{
    struct can_frame out = {.can_id = frame->id | (frame->is_extended ? CAN_EFF_FLAG : 0u) | (frame->is_rtr ? CAN_RTR_FLAG : 0u),
                            .can_dlc = frame->length};
    memcpy(out.data, frame->data, 8);
    write_peer(&out);
}

static bool fetch_linux(can_frame_t *frame)
{
    struct can_frame in;
    if (read(peer, &in, sizeof in) != (ssize_t)sizeof in) {
        return false;
    }
    *frame = (can_frame_t){.is_extended = (in.can_id & CAN_EFF_FLAG) != 0, .is_rtr = (in.can_id & CAN_RTR_FLAG) != 0};
    frame->id = in.can_id & (frame->is_extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame->length = in.can_dlc;
    memcpy(frame->data, in.data, 8);
    return true;
}

/* One frame uses up what the bucket holds, and one is needed to wake it again. Both are the partner's own. */
static void pass_by(void)
{
    can_frame_t got;
    uint64_t time_us;
    inject_linux(&(can_frame_t){.id = 0});
    settle_linux();
    (void)!hal_can_recv(hal, &got, &time_us);
}

static void set_partner_linux(bool is_there)
{
    if (is_there) {
        shell("tc qdisc change dev vcan0 root tbf rate 1gbit burst 5000 limit 4000");
    } else {
        shell("tc qdisc replace dev vcan0 root tbf rate 8bit burst 16 limit 4000");
    }
    pass_by();
}

static void set_plugged_linux(bool is_plugged)
{
    if (!is_plugged) {
        shell("ip link del vcan0");
        return;
    }
    shell("ip link add vcan0 txqueuelen 16 type vcan && ip link set vcan0 up");
    close(peer);
    peer = open_peer();
}

static void report_linux(uint32_t what, uint8_t of_controller)
{
    write_peer(&(struct can_frame){.can_id = what | CAN_ERR_FLAG, .can_dlc = 8, .data = {0, of_controller, 0, 0, 0, 0, 130, 7}});
    settle_linux();
}

static void bus_off_linux(void)
{
    report_linux(CAN_ERR_BUSOFF, 0);
}

static const fixture_t k_linux = {"linux",     open_linux, close_linux,       settle_linux,      inject_linux,
                                  fetch_linux, 1000,       set_partner_linux, set_plugged_linux, bus_off_linux};

/* The bus between programs; the partner is heave-twin's end of it. */

#define HEARD_MAX 64u

static linux_can_local_t local;
static wire_t wire;
static can_frame_t received_frame[HEARD_MAX];
static unsigned heards, fetched;

static void note_heard(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    TEST_ASSERT_TRUE(heards < HEARD_MAX);
    received_frame[heards++] = *frame;
}

static void settle_local(void)
{
    TEST_ASSERT_TRUE(wire_hear(&wire, note_heard, NULL));
}

static void fault_local(bus_fault_t fault)
{
    char why[WIRE_WHY_MAX] = "";
    TEST_ASSERT_TRUE_MESSAGE(wire_fault(&wire, fault, 0, why, sizeof why), why);
}

static bool open_local(hal_can_t *can, const hal_can_filter_t *filter, uint32_t filters)
{
    config_can_t setup = {.bitrate_bps = 1000000};
    char why[WIRE_WHY_MAX];
    (void)filter;
    (void)snprintf(setup.interface, sizeof setup.interface, LINUX_CAN_LOCAL_PREFIX "%u", (unsigned)getpid());
    heards = fetched = 0;
    TEST_ASSERT_TRUE_MESSAGE(wire_open(&wire, &setup, NULL, NULL, false, why), why);
    TEST_ASSERT_EQUAL(HV_OK, linux_can_local_open(&local, setup.interface));
    *can = linux_can_local_hal(&local);
    settle_local();
    return filters == 0; /* whoever is on it hears all of it */
}

static void close_local(void)
{
    linux_can_local_close(&local);
    wire_close(&wire);
}

static void inject_local(const can_frame_t *frame)
{
    wire_put(&wire, frame);
}

static bool fetch_local(can_frame_t *frame)
{
    if (fetched == heards) {
        return false;
    }
    *frame = received_frame[fetched++];
    return true;
}

static void set_partner_local(bool is_there)
{
    fault_local(is_there ? BUS_CABLE_IN : BUS_CABLE_OUT);
}

static void set_plugged_local(bool is_plugged)
{
    fault_local(is_plugged ? BUS_UP : BUS_DOWN);
}

static void bus_off_local(void)
{
    fault_local(BUS_OFF);
}

static const fixture_t k_local = {"local",     open_local, close_local,       settle_local,      inject_local,
                                  fetch_local, 1000,       set_partner_local, set_plugged_local, bus_off_local};

void setUp(void)
{
    if (!fixture->open(&hal, NULL, 0)) {
        TEST_IGNORE_MESSAGE("not to be had on this machine");
    }
}

void tearDown(void)
{
    fixture->close();
}

static can_frame_t make(uint32_t id, uint8_t length)
{
    can_frame_t frame = {.id = id, .length = length};
    for (uint8_t i = 0; i < length; i++) {
        frame.data[i] = (uint8_t)((id & 0xFFFFu) * 31u + i + 1u);
    }
    return frame;
}

static can_frame_t make_extended(uint32_t id, uint8_t length)
{
    can_frame_t frame = make(id, length);
    frame.is_extended = true;
    return frame;
}

static void assert_same(const can_frame_t *expected, const can_frame_t *got)
{
    TEST_ASSERT_EQUAL_HEX32(expected->id, got->id);
    TEST_ASSERT_EQUAL(expected->is_extended, got->is_extended);
    TEST_ASSERT_EQUAL(expected->is_rtr, got->is_rtr);
    TEST_ASSERT_EQUAL(expected->is_error, got->is_error);
    TEST_ASSERT_EQUAL_UINT8(expected->length, got->length);
    TEST_ASSERT_EQUAL_UINT8_ARRAY(expected->data, got->data, 8);
}

static void send_ok(const can_frame_t *frame)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(hal, frame));
}

static void assert_fetched(const can_frame_t *expected)
{
    can_frame_t got;
    TEST_ASSERT_TRUE(fixture->fetch(&got));
    assert_same(expected, &got);
}

static void assert_received(const can_frame_t *expected)
{
    can_frame_t got;
    uint64_t time_us;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(hal, &got, &time_us));
    assert_same(expected, &got);
}

static void assert_nothing_received(void)
{
    can_frame_t got = {.id = 0x123};
    uint64_t time_us = 77;
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_recv(hal, &got, &time_us));
    TEST_ASSERT_EQUAL_HEX32(0x123, got.id);
    TEST_ASSERT_EQUAL_UINT64(77, time_us);
}

static void assert_nothing_fetched(void)
{
    can_frame_t got;
    TEST_ASSERT_FALSE(fixture->fetch(&got));
}

/* The reports that wait, as one set of bits; frames are not expected. */
static uint32_t receive_reports(void)
{
    uint32_t reports = 0;
    can_frame_t got;
    uint64_t time_us;
    while (hal_can_recv(hal, &got, &time_us) == HV_OK) {
        TEST_ASSERT_TRUE(got.is_error);
        reports |= got.id;
    }
    return reports;
}

static hal_can_state_t state_now(void)
{
    hal_can_state_t state = HAL_CAN_DOWN;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_bus_state(hal, &state));
    return state;
}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(hal_can_valid(hal));
}

static void test_valid_mandatory_op_missing_refuses(void)
{
    hal_can_ops_t ops = *hal.ops;
    TEST_ASSERT_FALSE(hal_can_valid((hal_can_t){NULL, NULL}));
    ops.send = NULL;
    TEST_ASSERT_FALSE(hal_can_valid((hal_can_t){&ops, hal.ctx}));
    ops = *hal.ops;
    ops.recv = NULL;
    TEST_ASSERT_FALSE(hal_can_valid((hal_can_t){&ops, hal.ctx}));
}

static void test_optional_ops_absent_have_their_documented_answers(void)
{
    const hal_can_ops_t ops = {.send = hal.ops->send, .recv = hal.ops->recv};
    const hal_can_t bare = {&ops, hal.ctx};
    hal_can_state_t state = HAL_CAN_DOWN;
    uint32_t frames = 5;
    TEST_ASSERT_TRUE(hal_can_valid(bare));
    TEST_ASSERT_EQUAL(HV_OK, hal_can_bus_state(bare, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state);
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, hal_can_unconfirmed(bare, &frames));
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, hal_can_restart(bare));
}

static void test_recv_nothing_waiting_says_again_and_keeps_outputs(void)
{
    assert_nothing_received();
}

static void test_send_every_length_reaches_the_partner(void)
{
    for (uint8_t length = 0; length <= 8; length++) {
        const can_frame_t standard = make(0x600u + length, length);
        const can_frame_t extended = make_extended(CAN_ID_EXTENDED_MAX - length, length);
        send_ok(&standard);
        send_ok(&extended);
        fixture->settle();
        assert_fetched(&standard);
        assert_fetched(&extended);
        assert_nothing_received();
    }
}

static void test_send_remote_frame_reaches_the_partner(void)
{
    const can_frame_t frame = {.id = 0x701, .is_rtr = true, .length = 3};
    send_ok(&frame);
    fixture->settle();
    assert_fetched(&frame);
}

static void test_send_bytes_beyond_length_arrive_as_zero(void)
{
    can_frame_t frame = make(0x181, 8);
    frame.length = 3;
    send_ok(&frame);
    fixture->settle();
    memset(frame.data + 3, 0, 5);
    assert_fetched(&frame);
}

static void test_send_invalid_frame_is_refused_and_nothing_leaves(void)
{
    const can_frame_t wrong[] = {
        make(CAN_ID_MAX + 1, 0), make_extended(CAN_ID_EXTENDED_MAX + 1, 0), {.id = 1, .length = 9}, {.id = 1, .is_error = true}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &wrong[i]));
    }
    fixture->settle();
    assert_nothing_fetched();
}

static void test_send_burst_keeps_order(void)
{
    for (uint32_t i = 0; i < 8; i++) {
        const can_frame_t frame = make(0x207u - i, 6);
        send_ok(&frame);
    }
    fixture->settle();
    for (uint32_t i = 0; i < 8; i++) {
        const can_frame_t frame = make(0x207u - i, 6);
        assert_fetched(&frame);
    }
    assert_nothing_fetched();
}

static void test_send_own_frames_do_not_come_back(void)
{
    const can_frame_t frame = make(0x201, 6);
    send_ok(&frame);
    fixture->settle();
    assert_nothing_received();
}

static void test_recv_burst_keeps_order_and_times_rise(void)
{
    uint64_t last_us = 0;
    for (uint32_t i = 0; i < 14; i++) {
        const can_frame_t frame = make(0x180u + i, 8);
        fixture->inject(&frame);
    }
    fixture->settle();
    for (uint32_t i = 0; i < 14; i++) {
        const can_frame_t expected = make(0x180u + i, 8);
        can_frame_t got;
        uint64_t time_us = 0;
        TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(hal, &got, &time_us));
        assert_same(&expected, &got);
        TEST_ASSERT_TRUE(time_us >= last_us);
        last_us = time_us;
    }
    assert_nothing_received();
}

static void test_send_full_queue_says_again_and_what_was_taken_arrives(void)
{
    uint32_t taken = 0;
    hv_status_t status = HV_OK;
    if (fixture->set_partner == NULL) {
        TEST_IGNORE_MESSAGE("the wire of this backend cannot be stopped");
    }
    fixture->set_partner(false);
    while (status == HV_OK && taken <= fixture->queue_max) {
        const can_frame_t frame = make(taken & CAN_ID_MAX, 4);
        status = hal_can_send(hal, &frame);
        taken += status == HV_OK;
    }
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, status);
    TEST_ASSERT_TRUE(taken > 0);
    fixture->set_partner(true);
    fixture->settle();
    for (uint32_t i = 0; i < taken; i++) {
        const can_frame_t expected = make(i & CAN_ID_MAX, 4);
        assert_fetched(&expected);
    }
    assert_nothing_fetched();
}

static void test_unconfirmed_falls_to_zero_when_the_frames_are_on_the_wire(void)
{
    uint32_t frames = 99;
    if (hal_can_unconfirmed(hal, &frames) == HV_ERR_NOSUP) {
        TEST_IGNORE_MESSAGE("this backend gets no echo");
    }
    TEST_ASSERT_EQUAL_UINT32(0, frames);
    for (uint32_t i = 1; i <= 7; i++) {
        const can_frame_t frame = make(0x200u + i, 6);
        send_ok(&frame);
        TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &frames));
        TEST_ASSERT_TRUE(frames <= i);
    }
    fixture->settle();
    assert_nothing_received();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &frames));
    TEST_ASSERT_EQUAL_UINT32(0, frames);
}

static void test_unconfirmed_without_a_partner_stays_until_restart(void)
{
    uint32_t frames = 0;
    const can_frame_t frame = make(0x201, 6);
    if (fixture->set_partner == NULL || hal_can_unconfirmed(hal, &frames) == HV_ERR_NOSUP) {
        TEST_IGNORE_MESSAGE("no partner that leaves, or no echo");
    }
    fixture->set_partner(false);
    send_ok(&frame);
    fixture->settle();
    (void)receive_reports();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &frames));
    TEST_ASSERT_EQUAL_UINT32(1, frames);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &frames));
    TEST_ASSERT_EQUAL_UINT32(0, frames);
}

static void reopen(const hal_can_filter_t *filter, uint32_t filters)
{
    fixture->close();
    if (!fixture->open(&hal, filter, filters)) {
        TEST_IGNORE_MESSAGE("this backend has no filters");
    }
}

static void test_filter_only_matching_frames_of_its_width_pass(void)
{
    static const hal_can_filter_t k_filters[] = {{0x180, 0x780, false}, {0x12345, CAN_ID_EXTENDED_MAX, true}};
    reopen(k_filters, 2);
    const can_frame_t frames[] = {make(0x17F, 1), make(0x180, 1), make_extended(0x180, 1),   make(0x1FF, 1),
                                  make(0x200, 1), make(0x345, 1), make_extended(0x12345, 1), make_extended(0x12344, 1)};
    for (size_t i = 0; i < sizeof frames / sizeof frames[0]; i++) {
        fixture->inject(&frames[i]);
    }
    fixture->settle();
    assert_received(&frames[1]);
    assert_received(&frames[3]);
    assert_received(&frames[6]);
    assert_nothing_received();
}

static void test_unplugged_says_io_and_works_again_after_restart(void)
{
    const can_frame_t frame = make(0x201, 6);
    can_frame_t got;
    uint64_t time_us;
    if (fixture->set_plugged == NULL) {
        TEST_IGNORE_MESSAGE("this backend cannot be unplugged from here");
    }
    fixture->set_plugged(false);
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_recv(hal, &got, &time_us));
        TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_send(hal, &frame));
        TEST_ASSERT_EQUAL(HAL_CAN_GONE, state_now());
        TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_restart(hal));
    }
    fixture->set_plugged(true);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    fixture->settle();
    assert_nothing_received();
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state_now());
    send_ok(&frame);
    fixture->settle();
    assert_fetched(&frame);
}

static void test_bus_off_is_reported_and_nothing_passes_until_restart(void)
{
    const can_frame_t stale = make(0x201, 6), fresh = make(0x202, 6);
    if (fixture->set_bus_off == NULL) {
        TEST_IGNORE_MESSAGE("this backend cannot be driven bus-off from here");
    }
    fixture->set_bus_off();
    fixture->settle();
    TEST_ASSERT_TRUE(receive_reports() & CAN_ERROR_BUS_OFF);
    TEST_ASSERT_EQUAL(HAL_CAN_BUS_OFF, state_now());
    (void)!hal_can_send(hal, &stale);
    fixture->inject(&fresh);
    fixture->settle();
    assert_nothing_fetched();
    assert_nothing_received();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    fixture->settle();
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state_now());
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_mandatory_op_missing_refuses);
    RUN_TEST(test_optional_ops_absent_have_their_documented_answers);
    RUN_TEST(test_recv_nothing_waiting_says_again_and_keeps_outputs);
    RUN_TEST(test_send_every_length_reaches_the_partner);
    RUN_TEST(test_send_remote_frame_reaches_the_partner);
    RUN_TEST(test_send_bytes_beyond_length_arrive_as_zero);
    RUN_TEST(test_send_invalid_frame_is_refused_and_nothing_leaves);
    RUN_TEST(test_send_burst_keeps_order);
    RUN_TEST(test_send_own_frames_do_not_come_back);
    RUN_TEST(test_recv_burst_keeps_order_and_times_rise);
    RUN_TEST(test_send_full_queue_says_again_and_what_was_taken_arrives);
    RUN_TEST(test_unconfirmed_falls_to_zero_when_the_frames_are_on_the_wire);
    RUN_TEST(test_unconfirmed_without_a_partner_stays_until_restart);
    RUN_TEST(test_filter_only_matching_frames_of_its_width_pass);
    RUN_TEST(test_unplugged_says_io_and_works_again_after_restart);
    RUN_TEST(test_bus_off_is_reported_and_nothing_passes_until_restart);
}

/* The simulated bus. */

static void reopen_sim(uint32_t frame_us, const sim_can_fault_t *plan, uint32_t planned)
{
    open_bus(frame_us, plan, planned, NULL, 0);
    hal = sim_can_hal(&node);
}

static void test_sim_wire_takes_its_time_per_frame(void)
{
    can_frame_t got;
    uint64_t time_us;
    reopen_sim(115, NULL, 0);
    sim_can_bus_step(&bus, 1000);
    for (uint32_t i = 0; i < 7; i++) {
        const can_frame_t frame = make(0x201u + i, 6);
        send_ok(&frame);
    }
    for (uint64_t now_us = 1000; now_us <= 2000; now_us++) {
        uint32_t left = 0;
        sim_can_bus_step(&bus, now_us);
        TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
        const uint64_t gone = (now_us - 1000) / 115;
        TEST_ASSERT_EQUAL_UINT64(gone < 7 ? 7 - gone : 0, left);
    }
    for (uint32_t i = 1; i <= 7; i++) {
        TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(sim_can_hal(&partner), &got, &time_us));
        TEST_ASSERT_EQUAL_UINT64(1000 + 115 * i, time_us);
    }
}

/* Against a sort: of frames that all wait, the lowest arbitration field goes first. */
static void test_sim_arbitration_lowest_identifier_wins(void)
{
    static sim_can_t sender[5];
    const can_frame_t frames[] = {make(0x300, 1), make_extended(0x300u << 18, 1), make_extended((0x2FFu << 18) + 5, 1),
                                  make(0x000, 1), make(0x7FF, 1)};
    static const uint32_t k_expected[] = {3, 2, 0, 1, 4};
    reopen_sim(115, NULL, 0);
    for (size_t i = 0; i < 5; i++) {
        TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&sender[i], &bus, NULL, 0));
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(sim_can_hal(&sender[i]), &frames[i]));
    }
    settle_sim();
    for (size_t i = 0; i < 5; i++) {
        assert_received(&frames[k_expected[i]]);
    }
}

static void test_sim_receive_queue_overrun_is_reported_after_the_last_kept_frame(void)
{
    for (uint32_t i = 0; i < SIM_CAN_RX_FRAMES + 5; i++) {
        const can_frame_t frame = make(i, 1);
        fixture->inject(&frame);
        settle_sim();
    }
    TEST_ASSERT_EQUAL_UINT32(5, node.lost);
    for (uint32_t i = 0; i < SIM_CAN_RX_FRAMES; i++) {
        const can_frame_t expected = make(i, 1);
        assert_received(&expected);
    }
    TEST_ASSERT_EQUAL_HEX32(CAN_ERROR_OVERRUN, receive_reports());
    assert_nothing_received();
}

/* With a third controller there to acknowledge, so that the wire goes on. */
static void test_sim_controller_in_bus_off_hears_nothing(void)
{
    static sim_can_t third;
    const can_frame_t missed = make(0x181, 8), heard = make(0x182, 8);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&third, &bus, NULL, 0));
    sim_can_set_state(&node, HAL_CAN_BUS_OFF);
    TEST_ASSERT_EQUAL_HEX32(CAN_ERROR_BUS_OFF, receive_reports());
    fixture->inject(&missed);
    settle_sim();
    TEST_ASSERT_EQUAL_UINT32(1, bus.frames);
    assert_nothing_received();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    fixture->inject(&heard);
    settle_sim();
    assert_received(&heard);
}

static void test_sim_open_too_many_is_refused(void)
{
    static sim_can_t extra[SIM_CAN_NODES_MAX];
    static hal_can_filter_t filters[SIM_CAN_FILTERS_MAX + 1];
    TEST_ASSERT_EQUAL(HV_ERR_ARG, sim_can_open(&extra[0], &bus, filters, SIM_CAN_FILTERS_MAX + 1));
    for (uint32_t i = 2; i < SIM_CAN_NODES_MAX; i++) {
        TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&extra[i], &bus, NULL, 0));
    }
    TEST_ASSERT_EQUAL(HV_ERR_FULL, sim_can_open(&extra[0], &bus, NULL, 0));
}

#define SWEEP 12u

/* Sends SWEEP frames one by one with one fault at frame `at`; fills how often each arrived and how many were taken. */
static uint32_t sweep(sim_can_fault_kind_t kind, uint32_t at, uint32_t arrived[SWEEP])
{
    const sim_can_fault_t plan = {kind, at, 1000};
    uint32_t taken = 0;
    can_frame_t got;
    reopen_sim(100, &plan, 1);
    memset(arrived, 0, SWEEP * sizeof arrived[0]);
    for (uint32_t i = 0; i < SWEEP; i++) {
        const can_frame_t frame = make(i, 2);
        const hv_status_t status = hal_can_send(hal, &frame);
        TEST_ASSERT_TRUE(status == HV_OK || status == HV_ERR_AGAIN);
        taken += status == HV_OK;
        sim_now_us += 200;
        sim_can_bus_step(&bus, sim_now_us);
    }
    sim_can_bus_step(&bus, sim_now_us + 10000);
    for (uint32_t last = 0; fetch_sim(&got); last = got.id) {
        TEST_ASSERT_TRUE(got.id >= last && got.id < SWEEP);
        arrived[got.id]++;
    }
    return taken;
}

static void test_sim_one_fault_at_every_step_hits_that_frame_only(void)
{
    static const struct {
        sim_can_fault_kind_t kind;
        uint32_t arrives;
        uint32_t taken;
    } k_rows[] = {
        {SIM_CAN_DROP, 0, SWEEP}, {SIM_CAN_DUPLICATE, 2, SWEEP}, {SIM_CAN_DELAY, 1, SWEEP}, {SIM_CAN_FULL, 0, SWEEP - 1}};
    for (size_t row = 0; row < sizeof k_rows / sizeof k_rows[0]; row++) {
        for (uint32_t at = 1; at <= SWEEP; at++) {
            uint32_t arrived[SWEEP], left;
            TEST_ASSERT_EQUAL_UINT32(k_rows[row].taken, sweep(k_rows[row].kind, at, arrived));
            for (uint32_t i = 0; i < SWEEP; i++) {
                TEST_ASSERT_EQUAL_UINT32(i + 1 == at ? k_rows[row].arrives : 1, arrived[i]);
            }
            TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
            TEST_ASSERT_EQUAL_UINT32(0, left);
        }
    }
}

static void test_sim_bus_off_at_every_step_stops_everything_from_there(void)
{
    for (uint32_t at = 1; at <= SWEEP; at++) {
        uint32_t arrived[SWEEP], left;
        TEST_ASSERT_EQUAL_UINT32(SWEEP, sweep(SIM_CAN_BUS_OFF, at, arrived));
        for (uint32_t i = 0; i < SWEEP; i++) {
            TEST_ASSERT_EQUAL_UINT32(i + 1 < at ? 1 : 0, arrived[i]);
        }
        TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
        TEST_ASSERT_EQUAL_UINT32(SWEEP + 1 - at, left);
        TEST_ASSERT_EQUAL(HAL_CAN_BUS_OFF, state_now());
        TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
        settle_sim();
        assert_nothing_fetched();
    }
}

static void run_sim(void)
{
    RUN_TEST(test_sim_wire_takes_its_time_per_frame);
    RUN_TEST(test_sim_arbitration_lowest_identifier_wins);
    RUN_TEST(test_sim_receive_queue_overrun_is_reported_after_the_last_kept_frame);
    RUN_TEST(test_sim_controller_in_bus_off_hears_nothing);
    RUN_TEST(test_sim_open_too_many_is_refused);
    RUN_TEST(test_sim_one_fault_at_every_step_hits_that_frame_only);
    RUN_TEST(test_sim_bus_off_at_every_step_stops_everything_from_there);
}

/* Interfaces of Linux. */

/* What the kernel refuses to those who may not change interfaces. */
static void as_plain_user(bool is_plain)
{
    TEST_ASSERT_EQUAL(0, seteuid(is_plain ? 65534 : 0));
}

static void reopen_linux(const linux_can_config_t *config, hv_status_t expected)
{
    linux_can_close(&lin);
    TEST_ASSERT_EQUAL_MESSAGE(expected, linux_can_open(&lin, config), lin.error_text);
    hal = linux_can_hal(&lin);
}

static const linux_can_config_t k_plain = {.interface = "vcan0"};

static void assert_says(linux_can_trouble_t trouble, const char *text)
{
    TEST_ASSERT_EQUAL_MESSAGE(trouble, lin.trouble, lin.error_text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(lin.error_text, text), lin.error_text);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(lin.error_text, lin.name), lin.error_text);
}

static void assert_dead(void)
{
    const can_frame_t frame = make(0x201, 6);
    can_frame_t got;
    uint64_t time_us;
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_send(hal, &frame));
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_recv(hal, &got, &time_us));
}

static void assert_alive(void)
{
    const can_frame_t out = make(0x201, 6), in = make(0x181, 8);
    send_ok(&out);
    fixture->inject(&in);
    settle_linux();
    assert_fetched(&out);
    assert_received(&in);
    assert_nothing_received();
}

static void test_linux_open_no_such_interface_can_be_retried(void)
{
    reopen_linux(&(linux_can_config_t){.interface = "vcan7"}, HV_ERR_AGAIN);
    assert_says(LINUX_CAN_NO_INTERFACE, "plugged in");
    TEST_ASSERT_EQUAL(HAL_CAN_GONE, state_now());
    assert_dead();
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_restart(hal));
    shell("ip link add vcan7 type vcan && ip link set vcan7 up");
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state_now());
    TEST_ASSERT_EQUAL_STRING("", lin.error_text);
    shell("ip link del vcan7");
}

static void test_linux_open_something_else_of_that_name_is_refused(void)
{
    reopen_linux(&(linux_can_config_t){.interface = "lo"}, HV_ERR_ARG);
    assert_says(LINUX_CAN_NOT_CAN, "not a CAN interface");
    reopen_linux(&(linux_can_config_t){.interface = "a-name-of-16-chr"}, HV_ERR_ARG);
    TEST_ASSERT_NOT_NULL(strstr(lin.error_text, "too long"));
}

static void test_linux_open_down_needs_somebody_who_may_take_it_up(void)
{
    shell("ip link set vcan0 down");
    as_plain_user(true);
    reopen_linux(&k_plain, HV_ERR_AGAIN);
    assert_says(LINUX_CAN_IS_DOWN, "is down");
    TEST_ASSERT_EQUAL(HAL_CAN_DOWN, state_now());
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_restart(hal));
    assert_dead();
    as_plain_user(false);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    assert_alive();
}

/* The kernel tells of it once only. */
static void test_linux_taken_down_is_noticed_by_either_op_and_stays_until_restart(void)
{
    for (int by_send = 0; by_send <= 1; by_send++) {
        const can_frame_t frame = make(0x201, 6);
        can_frame_t got;
        uint64_t time_us;
        shell("ip link set vcan0 down");
        TEST_ASSERT_EQUAL(HV_ERR_IO, by_send ? hal_can_send(hal, &frame) : hal_can_recv(hal, &got, &time_us));
        TEST_ASSERT_EQUAL(HAL_CAN_DOWN, state_now());
        assert_says(LINUX_CAN_IS_DOWN, "is down");
        shell("ip link set vcan0 up");
        assert_dead();
        as_plain_user(true);
        TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
        as_plain_user(false);
        assert_alive();
    }
}

static void test_linux_unplugged_and_another_one_plugged_in_keeps_its_filters(void)
{
    static const hal_can_filter_t k_filter = {0x181, 0x7FF, false}, k_own = {0x201, 0x7FF, false};
    const can_frame_t unwanted = make(0x182, 8);
    reopen_linux(&(linux_can_config_t){"vcan0", &k_filter, 1, &k_own, 1, 0, NULL}, HV_OK);
    set_plugged_linux(false);
    assert_dead();
    assert_says(LINUX_CAN_NO_INTERFACE, "plugged in");
    shell("ip link add vcan9 type vcan"); /* takes the number that the old one had */
    set_plugged_linux(true);
    assert_dead();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    fixture->inject(&unwanted);
    assert_alive();
    shell("ip link del vcan9");
}

static void test_linux_own_list_echoes_pass_others_do_not_and_the_rest_is_refused(void)
{
    static const hal_can_filter_t k_filter = {0x180, 0x780, false};
    static const hal_can_filter_t k_own[] = {{0x200, 0x780, false}, {0x12345, CAN_ID_EXTENDED_MAX, true}};
    const can_frame_t ours = make(0x207, 6), wide = make_extended(0x12345, 2), foreign = make(0x301, 1),
                      twin = make_extended(0x207, 6);
    uint32_t left = 9;
    reopen_linux(&(linux_can_config_t){"vcan0", &k_filter, 1, k_own, 2, 0, NULL}, HV_OK);
    send_ok(&ours);
    send_ok(&wide);
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &foreign));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &twin));
    fixture->inject(&ours); /* somebody else has our identifier */
    settle_linux();
    assert_nothing_received();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
    TEST_ASSERT_EQUAL_UINT32(0, left);
}

static void test_linux_every_report_is_passed_on_as_itself(void)
{
    static const struct {
        uint32_t what;
        uint8_t of_controller;
        uint32_t expected;
        hal_can_state_t state;
    } k_rows[] = {
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, CAN_ERROR_WARNING, HAL_CAN_WARNING},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, CAN_ERROR_PASSIVE, HAL_CAN_PASSIVE},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, CAN_ERROR_OTHER, HAL_CAN_ACTIVE},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING, CAN_ERROR_WARNING, HAL_CAN_WARNING},
        {CAN_ERR_CRTL | CAN_ERR_ACK, CAN_ERR_CRTL_RX_PASSIVE, CAN_ERROR_PASSIVE | CAN_ERROR_NO_ACK, HAL_CAN_PASSIVE},
        {CAN_ERR_ACK, 0, CAN_ERROR_NO_ACK, HAL_CAN_PASSIVE},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW, CAN_ERROR_OVERRUN, HAL_CAN_PASSIVE},
        {CAN_ERR_PROT | CAN_ERR_BUSERROR, 0, CAN_ERROR_OTHER, HAL_CAN_PASSIVE},
        {CAN_ERR_BUSOFF, 0, CAN_ERROR_BUS_OFF, HAL_CAN_BUS_OFF},
        {CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, CAN_ERROR_WARNING, HAL_CAN_BUS_OFF},
        {CAN_ERR_RESTARTED, 0, CAN_ERROR_RESTARTED, HAL_CAN_ACTIVE},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        report_linux(k_rows[i].what, k_rows[i].of_controller);
        TEST_ASSERT_EQUAL_HEX32(k_rows[i].expected, receive_reports());
        TEST_ASSERT_EQUAL(k_rows[i].state, state_now());
    }
    TEST_ASSERT_EQUAL_UINT32(sizeof k_rows / sizeof k_rows[0], lin.reports);
    TEST_ASSERT_EQUAL_UINT8(130, lin.tx_errors);
    TEST_ASSERT_EQUAL_UINT8(7, lin.rx_errors);
}

/* The kernel would send again by itself: with the old frames first. */
static void test_linux_controller_that_restarts_by_itself_stays_cut_off_until_restart(void)
{
    const can_frame_t frame = make(0x201, 6), in = make(0x181, 8);
    report_linux(CAN_ERR_BUSOFF, 0);
    report_linux(CAN_ERR_RESTARTED, 0);
    TEST_ASSERT_EQUAL_HEX32(CAN_ERROR_BUS_OFF | CAN_ERROR_RESTARTED, receive_reports());
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_send(hal, &frame));
    fixture->inject(&in);
    settle_linux();
    assert_nothing_received();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    assert_alive();
}

static void test_linux_one_whole_set_fits_and_no_more(void)
{
    uint32_t left = 0;
    set_partner_linux(false);
    for (uint32_t i = 0; i < LINUX_CAN_QUEUE_FRAMES; i++) {
        const can_frame_t frame = make(0x200 + i, 8);
        send_ok(&frame);
    }
    const can_frame_t frame = make(0x300, 8);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_send(hal, &frame));
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
    TEST_ASSERT_EQUAL_UINT32(LINUX_CAN_QUEUE_FRAMES, left);
    TEST_ASSERT_EQUAL_UINT32(0, lin.refused);
}

/* A bus of 1 Mbit/s: 115 us a frame. What is confirmed has left, at its time and not before. */
static void test_linux_confirmed_is_what_has_left_the_queue(void)
{
    shell("tc qdisc replace dev vcan0 root tbf rate 1113kbit burst 16 limit 256");
    pass_by();
    for (uint32_t i = 0; i < 9; i++) {
        const can_frame_t frame = make(0x200 + i, 6);
        send_ok(&frame);
    }
    for (uint32_t tenth_ms = 1; tenth_ms <= 11; tenth_ms++) {
        uint32_t left;
        (void)usleep(100);
        assert_nothing_received();
        TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
        const uint32_t gone = 1 + tenth_ms * 100 / 115; /* the first one found the bus free */
        TEST_ASSERT_UINT32_WITHIN(1, gone < 9 ? 9 - gone : 0, left);
    }
}

static void test_linux_short_interface_queue_refuses_and_is_counted(void)
{
    uint32_t taken = 0, left;
    shell("tc qdisc replace dev vcan0 root tbf rate 8bit burst 16 limit 80"); /* five frames */
    pass_by();
    for (uint32_t i = 0; i < 9; i++) {
        const can_frame_t frame = make(0x200 + i, 8);
        taken += hal_can_send(hal, &frame) == HV_OK;
    }
    TEST_ASSERT_EQUAL_UINT32(5, taken);
    TEST_ASSERT_EQUAL_UINT32(4, lin.refused);
    TEST_ASSERT_EQUAL(LINUX_CAN_FINE, lin.trouble);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
    TEST_ASSERT_EQUAL_UINT32(5, left);
}

static uint32_t frames_waiting(void)
{
    linux_can_link_t link;
    struct mnl_socket *netlink = linux_can_link_open();
    TEST_ASSERT_NOT_NULL(netlink);
    TEST_ASSERT_EQUAL(HV_OK, linux_can_link_look(netlink, "vcan0", &link));
    linux_can_link_close(netlink);
    return link.waiting;
}

static void leave_frames_waiting(void)
{
    const can_frame_t stale = make(0x201, 6);
    set_partner_linux(false);
    for (int i = 0; i < 7; i++) {
        send_ok(&stale);
    }
}

/* The wire works again: whatever still waits arrives at the partner. */
static void assert_no_stale_frame(void)
{
    shell("tc qdisc replace dev vcan0 root tbf rate 1gbit burst 5000 limit 4000");
    pass_by();
    assert_nothing_fetched();
    assert_alive();
}

static void test_linux_stale_frames_restart_drops_them(void)
{
    leave_frames_waiting();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    assert_no_stale_frame();
}

static void test_linux_stale_frames_close_drops_them(void)
{
    leave_frames_waiting();
    reopen_linux(&k_plain, HV_OK);
    assert_no_stale_frame();
}

/* As after a crash: nobody but the interface knows of the frames. */
static void forget_what_was_sent(void)
{
    close(lin.fd);
    lin.fd = -1;
}

static void test_linux_stale_frames_of_a_dead_program_second_look_drops_them(void)
{
    leave_frames_waiting();
    forget_what_was_sent();
    reopen_linux(&k_plain, HV_ERR_AGAIN);
    assert_says(LINUX_CAN_FRAMES_WAIT, "frames of another program wait");
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_restart(hal)); /* too early to tell */
    TEST_ASSERT_EQUAL_UINT32(7, frames_waiting());
    (void)usleep(LOOK_AGAIN_US);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    assert_no_stale_frame();
}

/* A program beside us that works on the same interface: frames of it are in the queue at each look, and go out. */
static void test_linux_frames_of_a_program_that_works_are_left_alone(void)
{
    static linux_can_t other;
    uint32_t left;
    shell("tc qdisc replace dev vcan0 root tbf rate 1113kbit burst 16 limit 1600");
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&other, &k_plain));
    const can_frame_t frame = make(0x201, 6);
    hv_status_t status = HV_OK;
    for (int burst = 0; burst < 6; burst++) { /* a look before the first one has gone out, and one with the last one */
        const int look = burst == 0 ? 0 : burst == 5 ? 1 : -1;
        for (int i = 0; i < 16; i++) {
            TEST_ASSERT_EQUAL(HV_OK, hal_can_send(linux_can_hal(&other), &frame));
        }
        TEST_ASSERT_GREATER_THAN_UINT32(0, frames_waiting());
        if (look == 0) {
            reopen_linux(&k_plain, HV_ERR_AGAIN);
        } else if (look == 1) {
            status = hal_can_restart(hal);
        }
        (void)usleep(LOOK_AGAIN_US / 5);
        can_frame_t got;
        uint64_t time_us;
        TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_recv(linux_can_hal(&other), &got, &time_us)); /* never down */
        TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(linux_can_hal(&other), &left));
        TEST_ASSERT_EQUAL_UINT32(0, left); /* none was dropped */
    }
    TEST_ASSERT_EQUAL(HV_OK, status);
    linux_can_close(&other);
    can_frame_t theirs;
    uint64_t when_us;
    while (hal_can_recv(hal, &theirs, &when_us) == HV_OK) {
        TEST_ASSERT_EQUAL_HEX32(0x201, theirs.id);
    }
    for (int i = 0; i < 6 * 16; i++) {
        TEST_ASSERT_TRUE(fetch_linux(&theirs));
        TEST_ASSERT_EQUAL_HEX32(0x201, theirs.id);
    }
    assert_alive();
}

static void test_linux_stale_frames_that_may_not_be_dropped_keep_the_bus_closed(void)
{
    leave_frames_waiting();
    as_plain_user(true);
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_restart(hal));
    assert_says(LINUX_CAN_FRAMES_WAIT, "old frames wait");
    reopen_linux(&k_plain, HV_ERR_AGAIN);
    (void)usleep(LOOK_AGAIN_US);
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_restart(hal));
    assert_says(LINUX_CAN_FRAMES_WAIT, "old frames wait");
    as_plain_user(false);
    shell("ip link set vcan0 down && ip link set vcan0 up"); /* as the text says */
    as_plain_user(true);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    as_plain_user(false);
    assert_no_stale_frame();
}

/* As the service does it: the daemon has no rights, a unit of systemd has. */
static void test_linux_stale_frames_are_dropped_by_the_helper_on_request(void)
{
    shell("rm -rf /run/heave-can && mkdir -p -m 777 /run/heave-can");
    leave_frames_waiting();
    as_plain_user(true);
    reopen_linux(&(linux_can_config_t){.interface = "vcan0", .run_dir = "/run/heave-can"}, HV_ERR_AGAIN);
    TEST_ASSERT_NOT_EQUAL(0, access("/run/heave-can/flush-vcan0", F_OK)); /* nobody knows yet */
    (void)usleep(LOOK_AGAIN_US);
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_restart(hal));
    TEST_ASSERT_EQUAL(0, access("/run/heave-can/flush-vcan0", F_OK));
    as_plain_user(false);
    shell(HEAVE_PACKAGING "/heave-can flush vcan0");
    TEST_ASSERT_NOT_EQUAL(0, access("/run/heave-can/flush-vcan0", F_OK));
    as_plain_user(true);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(hal));
    TEST_ASSERT_NOT_EQUAL(0, access("/run/heave-can/flush-vcan0", F_OK));
    as_plain_user(false);
    assert_no_stale_frame();
}

static void test_linux_received_too_many_is_reported_before_the_next_kept_frame(void)
{
    const int small = 0;
    can_frame_t got = {.id = 0};
    uint64_t time_us;
    uint32_t kept = 0;
    TEST_ASSERT_EQUAL(0, setsockopt(lin.fd, SOL_SOCKET, SO_RCVBUF, &small, sizeof small));
    for (uint32_t i = 0; i < 20; i++) {
        inject_linux(&(can_frame_t){.id = i});
    }
    settle_linux();
    while (hal_can_recv(hal, &got, &time_us) == HV_OK) {
        TEST_ASSERT_FALSE(got.is_error);
        TEST_ASSERT_EQUAL_UINT32(kept++, got.id);
    }
    const can_frame_t next = make(0x181, 8);
    inject_linux(&next);
    settle_linux();
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(hal, &got, &time_us));
    TEST_ASSERT_TRUE(got.is_error);
    TEST_ASSERT_EQUAL_HEX32(CAN_ERROR_OVERRUN, got.id);
    assert_received(&next);
    assert_nothing_received();
    TEST_ASSERT_TRUE(kept > 0 && kept < 20);
    TEST_ASSERT_EQUAL_UINT32(20 - kept, lin.lost);
}

static uint64_t time_of_a_frame(void)
{
    can_frame_t got;
    uint64_t time_us = 0;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(hal, &got, &time_us));
    return time_us;
}

static void step_wall_clock(long seconds)
{
    struct timespec now;
    if (getenv("HEAVE_OWN_KERNEL") == NULL) {
        TEST_IGNORE_MESSAGE("this machine's clock is not ours to set");
    }
    TEST_ASSERT_EQUAL(0, clock_gettime(CLOCK_REALTIME, &now));
    now.tv_sec += seconds;
    TEST_ASSERT_EQUAL(0, clock_settime(CLOCK_REALTIME, &now));
}

static void test_linux_times_are_of_the_hal_clock_whatever_the_wall_clock_does(void)
{
    static const long k_steps_s[] = {0, 86400, -86400};
    const hal_clock_t clock = linux_clock_hal();
    for (size_t i = 0; i < sizeof k_steps_s / sizeof k_steps_s[0]; i++) {
        const uint64_t before_us = hal_clock_now_us(clock);
        inject_linux(&(can_frame_t){.id = 0x181});
        const uint64_t after_us = hal_clock_now_us(clock);
        settle_linux();
        if (k_steps_s[i] != 0) {
            step_wall_clock(k_steps_s[i]);
        }
        const uint64_t time_us = time_of_a_frame();
        TEST_ASSERT_TRUE(time_us + 1 >= before_us);
        TEST_ASSERT_TRUE(time_us <= (k_steps_s[i] == 0 ? after_us + 1 : hal_clock_now_us(clock)));
    }
}

static void test_linux_link_tells_what_is_there(void)
{
    struct mnl_socket *netlink = linux_can_link_open();
    linux_can_link_t link;
    TEST_ASSERT_NOT_NULL(netlink);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, linux_can_link_look(netlink, "vcan7", &link));
    TEST_ASSERT_EQUAL(HV_OK, linux_can_link_look(netlink, "lo", &link));
    TEST_ASSERT_FALSE(link.is_can);
    leave_frames_waiting();
    TEST_ASSERT_EQUAL(HV_OK, linux_can_link_look(netlink, "vcan0", &link));
    TEST_ASSERT_TRUE(link.is_can && link.is_up && link.has_echo);
    TEST_ASSERT_FALSE(link.has_controller);
    TEST_ASSERT_EQUAL_STRING("vcan", link.kind);
    TEST_ASSERT_EQUAL_UINT32(16, link.queue_length);
    TEST_ASSERT_EQUAL_UINT32(7, link.waiting);
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, link.state);
    shell("ip link set vcan0 down");
    TEST_ASSERT_EQUAL(HV_OK, linux_can_link_look(netlink, "vcan0", &link));
    TEST_ASSERT_FALSE(link.is_up);
    TEST_ASSERT_EQUAL(HAL_CAN_DOWN, link.state);
    linux_can_link_close(netlink);
}

static void run_linux(void)
{
    RUN_TEST(test_linux_open_no_such_interface_can_be_retried);
    RUN_TEST(test_linux_open_something_else_of_that_name_is_refused);
    RUN_TEST(test_linux_open_down_needs_somebody_who_may_take_it_up);
    RUN_TEST(test_linux_taken_down_is_noticed_by_either_op_and_stays_until_restart);
    RUN_TEST(test_linux_unplugged_and_another_one_plugged_in_keeps_its_filters);
    RUN_TEST(test_linux_own_list_echoes_pass_others_do_not_and_the_rest_is_refused);
    RUN_TEST(test_linux_every_report_is_passed_on_as_itself);
    RUN_TEST(test_linux_controller_that_restarts_by_itself_stays_cut_off_until_restart);
    RUN_TEST(test_linux_one_whole_set_fits_and_no_more);
    RUN_TEST(test_linux_confirmed_is_what_has_left_the_queue);
    RUN_TEST(test_linux_short_interface_queue_refuses_and_is_counted);
    RUN_TEST(test_linux_stale_frames_restart_drops_them);
    RUN_TEST(test_linux_stale_frames_close_drops_them);
    RUN_TEST(test_linux_stale_frames_of_a_dead_program_second_look_drops_them);
    RUN_TEST(test_linux_frames_of_a_program_that_works_are_left_alone);
    RUN_TEST(test_linux_stale_frames_that_may_not_be_dropped_keep_the_bus_closed);
    RUN_TEST(test_linux_stale_frames_are_dropped_by_the_helper_on_request);
    RUN_TEST(test_linux_received_too_many_is_reported_before_the_next_kept_frame);
    RUN_TEST(test_linux_times_are_of_the_hal_clock_whatever_the_wall_clock_does);
    RUN_TEST(test_linux_link_tells_what_is_there);
}

int main(int argc, char **argv)
{
    const bool is_linux = argc > 1 && strcmp(argv[1], "--linux") == 0;
    const bool is_local = argc > 1 && strcmp(argv[1], "--local") == 0;
    fixture = is_linux ? &k_linux : is_local ? &k_local : &k_sim;
    contract_backend = fixture->name;
    UNITY_BEGIN();
    run_contract();
    if (!is_local) {
        (is_linux ? run_linux : run_sim)();
    }
    return UNITY_END();
}
