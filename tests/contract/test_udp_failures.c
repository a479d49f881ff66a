/* SPDX-License-Identifier: MIT
 * test_udp_failures.c - the UDP socket, its filter, the log and the clock where the system refuses: each call of linux_udp*.c,
 * linux_log.c and linux_clock.c fails with each error that matters, once and for ever. The sockets are real, on this machine.
 */
#include "unity.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "failing.h"
#include "linux_clock.h"
#include "linux_log.h"
#include "linux_udp.h"
#include "linux_udp_filter.h"

#define LIMIT_MS 60000
#define FDS_MAX  4096

static const failing_errors_t k_errors[] = {
    {"getaddrinfo", {EAI_AGAIN, EAI_MEMORY, EAI_SYSTEM}},
    {"socket", {EMFILE, ENOMEM, EACCES, EAFNOSUPPORT}},
    {"setsockopt", {ENOMEM, EPERM, ENOPROTOOPT}},
    {"bind", {EADDRINUSE, EADDRNOTAVAIL, EACCES, ENODEV}},
    {"getsockname", {ENOBUFS}},
    {"getsockopt", {ENOBUFS, ENOPROTOOPT}},
    {"recvmsg", {EINTR, EAGAIN, ENETDOWN, ENOMEM, ENOBUFS, ECONNREFUSED}},
    {"write", {EINTR, EAGAIN, ENOSPC, EPIPE, EIO}},
    {"clock_nanosleep", {EINTR, EINVAL}},
    {NULL, {0}},
};

static struct {
    bool is_open[FDS_MAX]; /* sockets */
    long stamp_step_s;     /* of the wall clock after a datagram came */
    bool is_bare;          /* no time, no count comes with a datagram */
    unsigned interruptions;
} m;

int __real_getaddrinfo(const char *node, const char *service, const struct addrinfo *hints, struct addrinfo **found);
int __wrap_getaddrinfo(const char *node, const char *service, const struct addrinfo *hints, struct addrinfo **found);
int __real_socket(int family, int type, int protocol);
int __wrap_socket(int family, int type, int protocol);
int __real_close(int fd);
int __wrap_close(int fd);
int __real_setsockopt(int fd, int level, int option, const void *value, socklen_t size);
int __wrap_setsockopt(int fd, int level, int option, const void *value, socklen_t size);
int __real_bind(int fd, const struct sockaddr *address, socklen_t size);
int __wrap_bind(int fd, const struct sockaddr *address, socklen_t size);
int __real_getsockname(int fd, struct sockaddr *address, socklen_t *size);
int __wrap_getsockname(int fd, struct sockaddr *address, socklen_t *size);
int __real_getsockopt(int fd, int level, int option, void *value, socklen_t *size);
int __wrap_getsockopt(int fd, int level, int option, void *value, socklen_t *size);
ssize_t __real_recvmsg(int fd, struct msghdr *message, int flags);
ssize_t __wrap_recvmsg(int fd, struct msghdr *message, int flags);
ssize_t __real_write(int fd, const void *bytes, size_t size);
ssize_t __wrap_write(int fd, const void *bytes, size_t size);
int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *until, struct timespec *left);

int __wrap_getaddrinfo(const char *node, const char *service, const struct addrinfo *hints, struct addrinfo **found)
{
    FAILING_NUMBER("getaddrinfo");
    return __real_getaddrinfo(node, service, hints, found);
}

int __wrap_socket(int family, int type, int protocol)
{
    FAILING("socket", -1);
    const int fd = __real_socket(family, type, protocol);
    TEST_ASSERT_TRUE(fd >= 0 && fd < FDS_MAX);
    m.is_open[fd] = true;
    return fd;
}

int __wrap_close(int fd)
{
    if (fd >= 0 && fd < FDS_MAX) {
        m.is_open[fd] = false;
    }
    return __real_close(fd);
}

int __wrap_setsockopt(int fd, int level, int option, const void *value, socklen_t size)
{
    FAILING("setsockopt", -1);
    return __real_setsockopt(fd, level, option, value, size);
}

int __wrap_bind(int fd, const struct sockaddr *address, socklen_t size)
{
    FAILING("bind", -1);
    return __real_bind(fd, address, size);
}

int __wrap_getsockname(int fd, struct sockaddr *address, socklen_t *size)
{
    FAILING("getsockname", -1);
    return __real_getsockname(fd, address, size);
}

int __wrap_getsockopt(int fd, int level, int option, void *value, socklen_t *size)
{
    FAILING("getsockopt", -1);
    return __real_getsockopt(fd, level, option, value, size);
}

static void step_stamp(struct msghdr *message)
{
    for (struct cmsghdr *item = CMSG_FIRSTHDR(message); item != NULL; item = CMSG_NXTHDR(message, item)) {
        if (item->cmsg_level == SOL_SOCKET && item->cmsg_type == SCM_TIMESTAMPNS) {
            struct timespec stamp;
            memcpy(&stamp, CMSG_DATA(item), sizeof stamp);
            stamp.tv_sec -= m.stamp_step_s;
            memcpy(CMSG_DATA(item), &stamp, sizeof stamp);
        }
    }
}

ssize_t __wrap_recvmsg(int fd, struct msghdr *message, int flags)
{
    FAILING("recvmsg", -1);
    const ssize_t length = __real_recvmsg(fd, message, flags);
    if (length >= 0) {
        step_stamp(message);
        message->msg_controllen = m.is_bare ? 0 : message->msg_controllen;
    }
    return length;
}

ssize_t __wrap_write(int fd, const void *bytes, size_t size)
{
    FAILING("write", -1);
    return __real_write(fd, bytes, size < 7 ? size : 7); /* a pipe takes what it likes */
}

int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *until, struct timespec *left)
{
    (void)clock;
    (void)flags;
    (void)until;
    (void)left;
    if (m.interruptions > 0) {
        m.interruptions--;
        FAILING_NUMBER("clock_nanosleep");
    }
    return 0;
}

/* --- UDP --- */

static linux_udp_t udp;
static linux_udp_config_t config;
static int sender = -1;

void setUp(void)
{
    sender = __real_socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    memset(&m, 0, sizeof m);
}

void tearDown(void)
{
    failing_end();
    (void)__real_close(sender);
}

static void assert_nothing_open(void)
{
    for (int fd = 0; fd < FDS_MAX; fd++) {
        TEST_ASSERT_FALSE_MESSAGE(m.is_open[fd], failing_text());
    }
}

static void send_one(void)
{
    const struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(udp.port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct pollfd there = {.fd = udp.fd, .events = POLLIN};
    TEST_ASSERT_EQUAL_INT(3, (int)sendto(sender, "@A6", 3, 0, (const struct sockaddr *)&to, sizeof to));
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, poll(&there, 1, LIMIT_MS), failing_text());
}

static hv_status_t receive(size_t *length)
{
    uint8_t bytes[16];
    hal_udp_peer_t from;
    *length = 99;
    return hal_udp_recv(linux_udp_hal(&udp), bytes, sizeof bytes, length, &from);
}

static void assert_receives(void)
{
    size_t length;
    send_one();
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, receive(&length), failing_text());
    TEST_ASSERT_EQUAL_UINT(3, length);
}

static void try_udp(void)
{
    static const linux_udp_form_t k_form = {{LINUX_UDP_SET("@!")}};
    const linux_udp_filter_t filter = {.forms = &k_form, .form_count = 1, .bytes_max = 1000};
    size_t length;
    uint32_t dropped = 77;
    failing_begin();
    hv_status_t status = linux_udp_open(&udp, &config);
    if (status != HV_OK) {
        TEST_ASSERT_MESSAGE(failing_count() > 0 && (status == HV_ERR_IO || status == HV_ERR_ARG), failing_text());
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("udp: ", udp.error_text, 5, failing_text());
        TEST_ASSERT_NOT_EQUAL_MESSAGE(0, udp.error, failing_text());
        assert_nothing_open();
        failing_end();
        TEST_ASSERT_EQUAL(HV_OK, linux_udp_open(&udp, &config));
    }
    send_one();
    status = receive(&length);
    TEST_ASSERT_MESSAGE(status == HV_OK || failing_count() > 0, failing_text());
    TEST_ASSERT_MESSAGE(status == HV_OK || ((status == HV_ERR_IO || status == HV_ERR_AGAIN) && length == 99), failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, hal_udp_dropped(linux_udp_hal(&udp), &dropped), failing_text());
    TEST_ASSERT_EQUAL_UINT32(0, dropped);
    status = linux_udp_filter_on(&udp, &filter);
    TEST_ASSERT_MESSAGE(status == HV_OK || (status == HV_ERR_IO && failing_count() > 0), failing_text());
    linux_udp_filter_off(&udp);
    failing_end();
    while (receive(&length) == HV_OK) {} /* what a failed receive has left */
    assert_receives();
    linux_udp_close(&udp);
    assert_nothing_open();
}

static unsigned failures;

static void test_udp_of_both_families(void)
{
    config = (linux_udp_config_t){.bind = "0.0.0.0", .group = "239.77.1.2%lo", .receive_buffer = 4096};
    failures += failing_sweep(k_errors, try_udp);
    const int fd = __real_socket(AF_INET6, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd >= 0) { /* a machine may be without */
        (void)__real_close(fd);
        config = (linux_udp_config_t){.bind = "::", .receive_buffer = 4096};
        failures += failing_sweep(k_errors, try_udp);
    }
}

static void test_udp_waiting_is_of_the_datagram_whatever_the_wall_clock_does(void)
{
    size_t length;
    uint32_t waited_us;
    config = (linux_udp_config_t){.bind = "127.0.0.1"};
    TEST_ASSERT_EQUAL(HV_OK, linux_udp_open(&udp, &config));
    for (long step_s = -86400; step_s <= 86400; step_s += 172800) {
        m.stamp_step_s = step_s;
        assert_receives();
        TEST_ASSERT_EQUAL(HV_OK, hal_udp_waited(linux_udp_hal(&udp), &waited_us));
        TEST_ASSERT_EQUAL_UINT32(0, waited_us);
    }
    m.stamp_step_s = 1;
    send_one();
    TEST_ASSERT_EQUAL(HV_OK, receive(&length));
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_waited(linux_udp_hal(&udp), &waited_us));
    TEST_ASSERT_TRUE(waited_us >= 1000000);
    m.is_bare = true;
    assert_receives();
    TEST_ASSERT_EQUAL(HV_OK, hal_udp_waited(linux_udp_hal(&udp), &waited_us));
    TEST_ASSERT_EQUAL_UINT32(0, waited_us);
    linux_udp_close(&udp);
}

/* --- The log --- */

static linux_log_t lines;

/* What cannot be written now is written later, once and whole. */
static void try_log(void)
{
    char text[600] = "";
    int ends[2];
    size_t length = 0;
    TEST_ASSERT_EQUAL_INT(0, pipe2(ends, O_NONBLOCK | O_CLOEXEC));
    linux_log_init(&lines, ends[1]);
    hal_log_write(linux_log_hal(&lines), HAL_LOG_WARNING, "a line of the log");
    failing_begin();
    const hv_status_t status =
        failing_is("write") && strstr(failing_text(), "EINTR for ever") != NULL ? HV_ERR_AGAIN : linux_log_flush(&lines);
    TEST_ASSERT_MESSAGE(status == HV_OK || status == HV_ERR_AGAIN || status == HV_ERR_IO, failing_text());
    failing_end();
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_log_flush(&lines), failing_text());
    while (length < sizeof text - 1 && read(ends[0], &text[length], 1) == 1) {
        length++;
    }
    TEST_ASSERT_EQUAL_STRING_MESSAGE("<4>a line of the log\n", text, failing_text());
    (void)__real_close(ends[0]);
    (void)__real_close(ends[1]);
}

static void test_log(void)
{
    failures += failing_sweep(k_errors, try_log);
}

/* --- The clock --- */

static void try_clock(void)
{
    const hal_clock_t clock = linux_clock_hal();
    m.interruptions = 3;
    failing_begin();
    const hv_status_t status = hal_clock_sleep_until_us(clock, hal_clock_now_us(clock) + 1);
    failing_end();
    TEST_ASSERT_MESSAGE(status == HV_OK || (status == HV_ERR_IO && strstr(failing_text(), "EINVAL") != NULL), failing_text());
}

static void test_clock(void)
{
    failures += failing_sweep(k_errors, try_clock);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_udp_of_both_families);
    RUN_TEST(test_udp_waiting_is_of_the_datagram_whatever_the_wall_clock_does);
    RUN_TEST(test_log);
    RUN_TEST(test_clock);
    printf("# figure %u failures of system calls injected\n", failures);
    return UNITY_END();
}
