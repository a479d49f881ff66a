/* SPDX-License-Identifier: MIT
 * test_can_adapter.c - SocketCAN with a controller that has states, a bit rate and a wire that can be cut: the kernel's slcan
 * driver, and at the other end of its terminal this program as the adapter. As root on a kernel of its own
 * (tests/lib/kernel.py).
 *
 * The adapter is a child that acknowledges whatever it is sent and passes each frame on through a pipe. While it is stopped
 * (SIGSTOP) nobody acknowledges; when it and the terminal are gone, the adapter has been unplugged.
 */
#include "unity.h"

#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include "linux_can.h"

#define SLCAN_DISCIPLINE 17

static int terminal = -1, line = -1, seen = -1;
static pid_t adapter;
static linux_can_t lin;
static hal_can_t hal;
static struct mnl_socket *netlink;

static void shell(const char *command)
{
    TEST_ASSERT_EQUAL_MESSAGE(0, system(command), command);
}

static void wait_ms(unsigned ms)
{
    (void)usleep(ms * 1000);
}

/* The adapter's own life: reads for ever, tells of each frame ("t" or "T" and its end). */
static void adapter_loop(int out)
{
    char heard[256];
    ssize_t length;
    while ((length = read(terminal, heard, sizeof heard)) > 0) {
        for (ssize_t i = 0; i < length; i++) {
            if (heard[i] == 't' || heard[i] == 'T') {
                (void)!write(out, "f", 1);
            }
        }
    }
    _exit(0);
}

static void make_raw(int fd)
{
    struct termios mode;
    TEST_ASSERT_EQUAL(0, tcgetattr(fd, &mode));
    cfmakeraw(&mode);
    TEST_ASSERT_EQUAL(0, tcsetattr(fd, TCSANOW, &mode));
}

static void start_adapter(void)
{
    int ends[2];
    TEST_ASSERT_EQUAL(0, pipe(ends));
    seen = ends[0];
    TEST_ASSERT_EQUAL(0, fcntl(seen, F_SETFL, O_NONBLOCK));
    adapter = fork();
    if (adapter == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
        (void)close(line);
        adapter_loop(ends[1]);
    }
    (void)close(ends[1]);
}

static void plug_in(void)
{
    const int discipline = SLCAN_DISCIPLINE;
    terminal = posix_openpt(O_RDWR | O_NOCTTY);
    TEST_ASSERT_TRUE(terminal >= 0 && grantpt(terminal) == 0 && unlockpt(terminal) == 0);
    line = open(ptsname(terminal), O_RDWR | O_NOCTTY);
    TEST_ASSERT_TRUE(line >= 0);
    make_raw(terminal);
    make_raw(line);
    TEST_ASSERT_EQUAL(0, ioctl(line, TIOCSETD, &discipline));
    start_adapter();
    shell("ip link set can0 txqueuelen 16 type can bitrate 1000000 && ip link set can0 up");
}

static void unplug(void)
{
    (void)kill(adapter, SIGKILL);
    (void)waitpid(adapter, NULL, 0);
    (void)close(line);
    (void)close(terminal);
    (void)close(seen);
    wait_ms(50);
}

static void acknowledge(bool is_there)
{
    (void)kill(adapter, is_there ? SIGCONT : SIGSTOP);
    wait_ms(50);
}

/* Frames that have come out of the far end since the last call. */
static uint32_t frames_seen(void)
{
    char told[256];
    uint32_t frames = 0;
    ssize_t length;
    wait_ms(100);
    while ((length = read(seen, told, sizeof told)) > 0) {
        frames += (uint32_t)length;
    }
    return frames;
}

static void say(const char *text)
{
    TEST_ASSERT_EQUAL(strlen(text), write(terminal, text, strlen(text)));
    wait_ms(50);
}

void setUp(void)
{
    plug_in();
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_can_open(&lin, &(linux_can_config_t){.interface = "can0"}), lin.error_text);
    hal = linux_can_hal(&lin);
    netlink = linux_can_link_open();
    (void)frames_seen();
}

void tearDown(void)
{
    (void)kill(adapter, SIGCONT);
    linux_can_link_close(netlink);
    linux_can_close(&lin);
    unplug();
}

static linux_can_link_t look(void)
{
    linux_can_link_t link = {.index = 0};
    TEST_ASSERT_EQUAL(HV_OK, linux_can_link_look(netlink, "can0", &link));
    return link;
}

static hv_status_t send_one(void)
{
    return hal_can_send(hal, &(can_frame_t){.id = 0x201, .length = 6, .data = {1, 2, 3, 4, 5, 6}});
}

static uint32_t send_until_full(void)
{
    uint32_t taken = 0;
    while (taken < 1000 && send_one() == HV_OK) {
        taken++;
    }
    return taken;
}

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
    hal_can_state_t state;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_bus_state(hal, &state));
    return state;
}

static void test_link_controller_bit_rate_and_restart_are_told(void)
{
    const linux_can_link_t link = look();
    TEST_ASSERT_TRUE(link.is_can && link.is_up && link.has_controller);
    TEST_ASSERT_EQUAL_UINT32(1000000, link.bitrate);
    TEST_ASSERT_EQUAL_UINT32(0, link.restart_ms);
    TEST_ASSERT_EQUAL_UINT32(16, link.queue_length);
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, link.state);
}

static void test_unconfirmed_without_echo_says_so(void)
{
    uint32_t frames = 7;
    TEST_ASSERT_FALSE(look().has_echo);
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, hal_can_unconfirmed(hal, &frames));
    TEST_ASSERT_EQUAL_UINT32(7, frames);
}

static void test_send_reaches_the_wire(void)
{
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    TEST_ASSERT_EQUAL_UINT32(1, frames_seen());
}

static void test_controller_states_are_reported_and_counted(void)
{
    static const struct {
        const char *text;
        uint32_t report;
        hal_can_state_t state;
    } k_rows[] = {{"sw100100\r", CAN_ERROR_WARNING, HAL_CAN_WARNING},
                  {"sp000128\r", CAN_ERROR_PASSIVE, HAL_CAN_PASSIVE},
                  {"e1a00\r", CAN_ERROR_NO_ACK, HAL_CAN_PASSIVE},
                  {"sb000256\r", CAN_ERROR_BUS_OFF, HAL_CAN_BUS_OFF}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        say(k_rows[i].text);
        TEST_ASSERT_BITS_MESSAGE(k_rows[i].report, k_rows[i].report, receive_reports(), k_rows[i].text);
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].state, state_now(), k_rows[i].text);
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].state, look().state, k_rows[i].text);
    }
    const linux_can_link_t link = look();
    TEST_ASSERT_EQUAL_UINT32(1, link.warnings);
    TEST_ASSERT_EQUAL_UINT32(1, link.passives);
    TEST_ASSERT_EQUAL_UINT32(1, link.bus_offs);
}

/* Before any report was taken in; what only a restart takes back is left to the reports. */
static void test_ask_state_is_the_controllers_own(void)
{
    hal_can_state_t state = HAL_CAN_GONE;
    say("sp000128\r");
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_PASSIVE, state);
    (void)receive_reports();
    say("sw000100\r");
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_WARNING, state);
    say("sb000256\r");
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_WARNING, state);
    TEST_ASSERT_EQUAL_HEX32(CAN_ERROR_BUS_OFF, receive_reports() & CAN_ERROR_BUS_OFF);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_BUS_OFF, state);
}

static void test_bus_off_nothing_is_sent_until_restart_brings_the_controller_back(void)
{
    say("sb000256\r");
    TEST_ASSERT_EQUAL_HEX32(CAN_ERROR_BUS_OFF, receive_reports() & CAN_ERROR_BUS_OFF);
    TEST_ASSERT_EQUAL(HV_ERR_IO, send_one());
    TEST_ASSERT_EQUAL_UINT32(0, frames_seen());
    TEST_ASSERT_EQUAL(0, seteuid(65534));
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_restart(hal));
    TEST_ASSERT_EQUAL(LINUX_CAN_IS_BUS_OFF, lin.trouble);
    TEST_ASSERT_EQUAL(0, seteuid(0));
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, hal_can_restart(hal), lin.error_text);
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state_now());
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    TEST_ASSERT_EQUAL_UINT32(1, frames_seen());
}

/* What this is all about: without the flush these frames reach the drives when the wire is back, however long that takes. */
static void test_stalled_wire_old_frames_are_bounded_and_a_flush_drops_them(void)
{
    for (int with_flush = 0; with_flush <= 1; with_flush++) {
        acknowledge(false);
        const uint32_t taken = send_until_full();
        TEST_ASSERT_TRUE(taken > 0);
        wait_ms(500);
        TEST_ASSERT_TRUE(look().waiting > 0);
        if (with_flush) {
            (void)!linux_can_link_flush("can0");
        }
        const uint32_t waiting = look().waiting;
        acknowledge(true);
        const uint32_t stale = frames_seen();
        printf("stalled wire: %u frames taken, %u went out late%s\n", (unsigned)taken, (unsigned)stale,
               with_flush ? " after a flush" : "");
        TEST_ASSERT_TRUE(with_flush ? waiting == 0 : stale == taken);
        TEST_ASSERT_TRUE(stale <= (with_flush ? 1u : LINUX_CAN_QUEUE_FRAMES)); /* the one that the driver has already */
        TEST_ASSERT_EQUAL_MESSAGE(HV_OK, hal_can_restart(hal), lin.error_text);
    }
}

static void test_unplugged_and_plugged_in_again_works_after_restart(void)
{
    can_frame_t got;
    uint64_t time_us;
    unplug();
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_recv(hal, &got, &time_us));
    TEST_ASSERT_EQUAL(HAL_CAN_GONE, state_now());
    TEST_ASSERT_EQUAL(HV_ERR_IO, send_one());
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_restart(hal));
    plug_in();
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, hal_can_restart(hal), lin.error_text);
    (void)frames_seen();
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    TEST_ASSERT_EQUAL_UINT32(1, frames_seen());
}

int main(void)
{
    (void)signal(SIGPIPE, SIG_IGN);
    UNITY_BEGIN();
    RUN_TEST(test_link_controller_bit_rate_and_restart_are_told);
    RUN_TEST(test_unconfirmed_without_echo_says_so);
    RUN_TEST(test_send_reaches_the_wire);
    RUN_TEST(test_controller_states_are_reported_and_counted);
    RUN_TEST(test_ask_state_is_the_controllers_own);
    RUN_TEST(test_bus_off_nothing_is_sent_until_restart_brings_the_controller_back);
    RUN_TEST(test_stalled_wire_old_frames_are_bounded_and_a_flush_drops_them);
    RUN_TEST(test_unplugged_and_plugged_in_again_works_after_restart);
    return UNITY_END();
}
