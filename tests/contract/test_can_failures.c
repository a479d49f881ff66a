/* SPDX-License-Identifier: MIT
 * test_can_failures.c - SocketCAN on a system that refuses: each call of hal/linux/linux_can*.c fails with each error that
 * matters, once and for ever.
 *
 * The kernel is played: an interface that is there or not, up or down, with a controller and frames that wait, and the far end of
 * its wire. It keeps to what a kernel does with each call, so that a frame that was taken is on the wire, and sockets and
 * connections are counted.
 */
#include "unity.h"

#include <errno.h>
#include <fcntl.h>
#include <libmnl/libmnl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/pkt_sched.h>
#include <linux/rtnetlink.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "failing.h"
#include "linux_can.h"

#define FD_FIRST    1000
#define FDS_MAX     16
#define FRAMES_MAX  64u
#define MESSAGES    8u
#define INDEX       5
#define PORT        4711u
#define REQUEST_DIR "/run/of-nobody"

static const failing_errors_t k_errors[] = {
    {"socket", {EMFILE, ENOMEM, EACCES, EAFNOSUPPORT, EPROTONOSUPPORT}},
    {"setsockopt", {ENOMEM, EPERM, ENOPROTOOPT}},
    {"bind", {EACCES, EADDRNOTAVAIL, ENODEV, ENETDOWN}},
    {"send", {EAGAIN, EINTR, ENOBUFS, ENETDOWN, ENXIO, ENODEV, EPERM, EIO}},
    {"recvmmsg", {EINTR, EAGAIN, ENETDOWN, ENOMEM, ENODEV, ENOBUFS}},
    {"recv", {EINTR, ENOBUFS, ENOMEM}},
    {"ioctl", {EIO, ENODEV, EBUSY, EPERM}},
    {"open", {EACCES, ENOENT, EMFILE, ENOSPC}},
    {"readlink", {EACCES, ENOENT}},
    {"mnl_socket_open2", {EMFILE, EAFNOSUPPORT}},
    {"mnl_socket_bind", {ENOMEM}},
    {"mnl_socket_sendto", {ENOBUFS, EPERM, EINTR}},
    {"mnl_socket_recvfrom", {ENOBUFS, EINTR, EAGAIN, ENOMEM}},
    {NULL, {0}},
};

/* --- The kernel --- */

/** What an interface is like. */
typedef struct {
    bool is_there;
    bool is_up;
    bool may_change; /**< CAP_NET_ADMIN */
    uint32_t waiting;
    uint32_t controller; /**< CAN_STATE_* */
    uint16_t type;
    bool is_bare; /**< tells neither what it is nor of a controller, and confirms nothing */
} interface_t;

typedef struct {
    struct can_frame frame;
    bool is_own;
} delivery_t;

static struct {
    interface_t link;
    bool is_open[FDS_MAX];
    bool is_bound;
    bool was_misused; /**< a call with a descriptor that is not open */
    unsigned netlinks;
    unsigned requests; /**< files that ask for a flush */
    struct can_frame wire[FRAMES_MAX];
    unsigned sent;
    delivery_t inbox[FRAMES_MAX];
    unsigned first, last;
    uint8_t message[MESSAGES][1024];
    size_t length[MESSAGES];
    unsigned told, heard;   /**< netlink messages */
    unsigned interruptions; /**< so many lists of queues are not whole */
    uint32_t lost;
    long clock_step_s; /**< of the wall clock since frames came in */
    long later_s;      /**< both clocks against the true ones */
    uint64_t gone_out; /**< frames, of whatever program */
    const char *driver;
} m;

static int open_fd(void)
{
    for (int i = 0; i < FDS_MAX; i++) {
        if (!m.is_open[i]) {
            m.is_open[i] = true;
            return FD_FIRST + i;
        }
    }
    errno = EMFILE;
    return -1;
}

static bool is_open(int fd)
{
    const bool is = fd >= FD_FIRST && fd < FD_FIRST + FDS_MAX && m.is_open[fd - FD_FIRST];
    m.was_misused |= !is;
    errno = EBADF;
    return is;
}

static unsigned fds_open(void)
{
    unsigned count = 0;
    for (int i = 0; i < FDS_MAX; i++) {
        count += m.is_open[i];
    }
    return count;
}

int __real_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...);
int __real_close(int fd);
int __wrap_close(int fd);
int __wrap_socket(int family, int type, int protocol);
int __wrap_setsockopt(int fd, int level, int option, const void *value, socklen_t size);
int __wrap_bind(int fd, const struct sockaddr *address, socklen_t size);
ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags);
ssize_t __wrap_recv(int fd, void *bytes, size_t size, int flags);
int __wrap_recvmmsg(int fd, struct mmsghdr *message, unsigned int count, int flags, struct timespec *limit);
int __wrap_ioctl(int fd, unsigned long what, ...);
int __real_clock_gettime(clockid_t clock, struct timespec *out);
int __wrap_clock_gettime(clockid_t clock, struct timespec *out);
ssize_t __wrap_readlink(const char *path, char *out, size_t size);

/* Others open files as well: the library that counts what tests reach. */
int __wrap_open(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    const int mode = va_arg(arguments, int);
    va_end(arguments);
    if (strncmp(path, REQUEST_DIR, strlen(REQUEST_DIR)) != 0) {
        return __real_open(path, flags, mode);
    }
    FAILING("open", -1);
    m.requests++;
    return open_fd();
}

int __wrap_close(int fd)
{
    if (fd < FD_FIRST) {
        return __real_close(fd);
    }
    m.is_bound = is_open(fd) && m.is_bound;
    m.is_open[fd - FD_FIRST] = false;
    return 0;
}

int __wrap_socket(int family, int type, int protocol)
{
    FAILING("socket", -1);
    (void)type;
    (void)protocol;
    m.first = family == AF_CAN ? m.last : m.first; /* what came for the last one is gone with it */
    return open_fd();
}

int __wrap_setsockopt(int fd, int level, int option, const void *value, socklen_t size)
{
    FAILING("setsockopt", -1);
    (void)level;
    (void)option;
    (void)value;
    (void)size;
    return is_open(fd) ? 0 : -1;
}

int __wrap_bind(int fd, const struct sockaddr *address, socklen_t size)
{
    FAILING("bind", -1);
    (void)address;
    (void)size;
    m.is_bound = is_open(fd);
    return m.is_bound ? 0 : -1;
}

static int state_of_wire(void)
{
    return !m.link.is_there ? ENODEV : !m.link.is_up ? ENETDOWN : 0;
}

ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags)
{
    FAILING("send", -1);
    (void)flags;
    errno = is_open(fd) ? state_of_wire() : EBADF;
    if (errno != 0) {
        return -1;
    }
    TEST_ASSERT_TRUE(m.sent < FRAMES_MAX);
    memcpy(&m.wire[m.sent++], bytes, size);
    return (ssize_t)size;
}

static void put_ancillary(struct msghdr *message)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    now.tv_sec -= m.clock_step_s;
    struct cmsghdr *item = CMSG_FIRSTHDR(message);
    *item = (struct cmsghdr){.cmsg_len = CMSG_LEN(sizeof now), .cmsg_level = SOL_SOCKET, .cmsg_type = SCM_TIMESTAMPNS};
    memcpy(CMSG_DATA(item), &now, sizeof now);
    item = CMSG_NXTHDR(message, item);
    *item = (struct cmsghdr){.cmsg_len = CMSG_LEN(sizeof m.lost), .cmsg_level = SOL_SOCKET, .cmsg_type = SO_RXQ_OVFL};
    memcpy(CMSG_DATA(item), &m.lost, sizeof m.lost);
}

static void deliver(struct msghdr *message)
{
    const delivery_t *next = &m.inbox[m.first++ % FRAMES_MAX];
    memcpy(message->msg_iov->iov_base, &next->frame, sizeof next->frame);
    memset(message->msg_control, 0, message->msg_controllen);
    put_ancillary(message);
    message->msg_flags = next->is_own ? MSG_CONFIRM : 0;
}

int __wrap_recvmmsg(int fd, struct mmsghdr *message, unsigned int count, int flags, struct timespec *limit)
{
    unsigned int delivered = 0;
    FAILING("recvmmsg", -1);
    (void)flags;
    (void)limit;
    errno = is_open(fd) ? state_of_wire() : EBADF;
    errno = errno == 0 && m.first == m.last ? EAGAIN : errno;
    if (errno != 0) {
        return -1;
    }
    while (delivered < count && m.first != m.last) {
        deliver(&message[delivered++].msg_hdr);
    }
    return (int)delivered;
}

int __wrap_ioctl(int fd, unsigned long what, ...)
{
    va_list arguments;
    va_start(arguments, what);
    struct ifreq *request = va_arg(arguments, struct ifreq *);
    va_end(arguments);
    FAILING("ioctl", -1);
    errno = !is_open(fd) ? EBADF : !m.link.is_there ? ENODEV : what == SIOCSIFFLAGS && !m.link.may_change ? EPERM : 0;
    if (errno != 0) {
        return -1;
    }
    if (what == SIOCSIFFLAGS) {
        const bool goes_up = (request->ifr_flags & IFF_UP) != 0;
        m.link.waiting = goes_up ? m.link.waiting : 0;
        m.link.controller = goes_up && m.link.controller == CAN_STATE_BUS_OFF ? CAN_STATE_ERROR_ACTIVE : m.link.controller;
        m.link.is_up = goes_up;
    }
    request->ifr_flags = (short)(m.link.is_up ? IFF_UP : 0);
    return 0;
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *out)
{
    const int result = __real_clock_gettime(clock, out);
    out->tv_sec += m.later_s;
    return result;
}

ssize_t __wrap_readlink(const char *path, char *out, size_t size)
{
    const char *driver = m.driver != NULL ? m.driver : "../../../../bus/usb/drivers/gs_usb";
    FAILING("readlink", -1);
    (void)path;
    TEST_ASSERT_TRUE(strlen(driver) <= size);
    memcpy(out, driver, strlen(driver));
    return (ssize_t)strlen(driver);
}

/* --- rtnetlink: in the place of libmnl's, which is not asked for these --- */

static struct nlmsghdr *put_message(uint16_t type, uint16_t flags, uint32_t sequence)
{
    TEST_ASSERT_TRUE_MESSAGE(m.told - m.heard < MESSAGES, "answers that nobody takes pile up");
    struct nlmsghdr *message = mnl_nlmsg_put_header(m.message[m.told % MESSAGES]);
    message->nlmsg_type = type;
    message->nlmsg_flags = flags;
    message->nlmsg_seq = sequence;
    message->nlmsg_pid = PORT;
    return message;
}

static void end_message(const struct nlmsghdr *message)
{
    m.length[m.told++ % MESSAGES] = message->nlmsg_len;
}

static void put_error(uint32_t sequence, int error)
{
    struct nlmsghdr *message = put_message(NLMSG_ERROR, 0, sequence);
    struct nlmsgerr *said = mnl_nlmsg_put_extra_header(message, sizeof *said);
    said->error = -error;
    end_message(message);
}

static void put_link(uint32_t sequence)
{
    const struct can_bittiming timing = {.bitrate = 1000000, .sample_point = 875};
    const struct can_berr_counter errors = {.txerr = 12, .rxerr = 3};
    const struct can_device_stats stats = {.bus_error = 1};
    struct nlmsghdr *message = put_message(RTM_NEWLINK, 0, sequence);
    struct ifinfomsg *head = mnl_nlmsg_put_extra_header(message, sizeof *head);
    *head = (struct ifinfomsg){.ifi_type = m.link.type,
                               .ifi_index = INDEX,
                               .ifi_flags = (m.link.is_bare ? 0u : IFF_ECHO) | (m.link.is_up ? IFF_UP : 0u)};
    if (m.link.is_bare) {
        mnl_attr_put_u32(message, 70, 1); /* of a newer kernel */
        end_message(message);
        put_error(sequence, 0);
        return;
    }
    const struct rtnl_link_stats64 counts = {.rx_packets = 7, .tx_packets = m.gone_out, .rx_bytes = 8};
    mnl_attr_put_u32(message, IFLA_TXQLEN, 16);
    mnl_attr_put(message, IFLA_STATS64, sizeof counts, &counts);
    struct nlattr *info = mnl_attr_nest_start(message, IFLA_LINKINFO);
    mnl_attr_put_strz(message, IFLA_INFO_KIND, "can");
    struct nlattr *data = mnl_attr_nest_start(message, IFLA_INFO_DATA);
    mnl_attr_put_u32(message, IFLA_CAN_STATE, m.link.controller);
    mnl_attr_put_u32(message, IFLA_CAN_RESTART_MS, 0);
    mnl_attr_put(message, IFLA_CAN_BITTIMING, sizeof timing, &timing);
    mnl_attr_put(message, IFLA_CAN_BERR_COUNTER, sizeof errors, &errors);
    mnl_attr_nest_end(message, data);
    mnl_attr_put(message, IFLA_INFO_XSTATS, sizeof stats, &stats);
    mnl_attr_nest_end(message, info);
    end_message(message);
    put_error(sequence, 0);
}

static void put_queues(uint32_t sequence)
{
    const struct tc_stats stats = {.qlen = m.link.waiting};
    for (int other = 1; other >= 0; other--) {
        struct nlmsghdr *message = put_message(RTM_NEWQDISC, NLM_F_MULTI | (m.interruptions > 0 ? NLM_F_DUMP_INTR : 0), sequence);
        struct tcmsg *head = mnl_nlmsg_put_extra_header(message, sizeof *head);
        *head = (struct tcmsg){.tcm_ifindex = INDEX + other, .tcm_parent = TC_H_ROOT};
        mnl_attr_put(message, TCA_STATS, sizeof stats, &stats);
        end_message(message);
    }
    m.interruptions -= m.interruptions > 0;
    struct nlmsghdr *message = put_message(NLMSG_DONE, NLM_F_MULTI, sequence);
    (void)mnl_nlmsg_put_extra_header(message, sizeof(int));
    end_message(message);
}

static int netlink; /* whose address is a connection */

struct mnl_socket *mnl_socket_open2(int bus, int flags)
{
    FAILING("mnl_socket_open2", NULL);
    (void)bus;
    (void)flags;
    m.netlinks++;
    m.heard = m.told;
    return (struct mnl_socket *)&netlink;
}

int mnl_socket_bind(struct mnl_socket *self, unsigned groups, pid_t pid)
{
    FAILING("mnl_socket_bind", -1);
    (void)self;
    (void)groups;
    (void)pid;
    return 0;
}

int mnl_socket_close(struct mnl_socket *self)
{
    (void)self;
    m.netlinks--;
    return 0;
}

unsigned mnl_socket_get_portid(const struct mnl_socket *self)
{
    (void)self;
    return PORT;
}

int mnl_socket_get_fd(const struct mnl_socket *self)
{
    (void)self;
    return -1;
}

ssize_t mnl_socket_sendto(const struct mnl_socket *self, const void *bytes, size_t size)
{
    const struct nlmsghdr *request = bytes;
    FAILING("mnl_socket_sendto", -1);
    (void)self;
    if (request->nlmsg_type == RTM_GETQDISC) {
        put_queues(request->nlmsg_seq);
    } else if (m.link.is_there) {
        put_link(request->nlmsg_seq);
    } else {
        put_error(request->nlmsg_seq, ENODEV);
    }
    return (ssize_t)size;
}

static ssize_t take_message(void *bytes, size_t size)
{
    if (m.heard == m.told) {
        errno = EAGAIN;
        return -1;
    }
    const size_t length = m.length[m.heard % MESSAGES];
    TEST_ASSERT_TRUE(length <= size);
    memcpy(bytes, m.message[m.heard++ % MESSAGES], length);
    return (ssize_t)length;
}

ssize_t mnl_socket_recvfrom(const struct mnl_socket *self, void *bytes, size_t size)
{
    FAILING("mnl_socket_recvfrom", -1);
    (void)self;
    TEST_ASSERT_TRUE_MESSAGE(m.heard != m.told, "would wait for ever");
    return take_message(bytes, size);
}

/* What is left of an answer. */
ssize_t __wrap_recv(int fd, void *bytes, size_t size, int flags)
{
    FAILING("recv", -1);
    TEST_ASSERT_EQUAL_HEX32(MSG_DONTWAIT, flags & MSG_DONTWAIT);
    (void)fd;
    return take_message(bytes, size);
}

/* --- The far end --- */

/* Everything on the wire is acknowledged. */
static void confirm(void)
{
    for (unsigned i = 0; i < m.sent; i++) {
        m.inbox[m.last++ % FRAMES_MAX] = (delivery_t){.frame = m.wire[i], .is_own = true};
    }
    m.sent = 0;
}

static void inject(uint32_t id, uint8_t what)
{
    m.inbox[m.last++ % FRAMES_MAX] = (delivery_t){.frame = {.can_id = id, .can_dlc = 8, .data = {0, what, 0, 0, 0, 0, 130, 7}}};
}

/* --- Trials --- */

static const interface_t k_fine = {true, true, true, 0, CAN_STATE_ERROR_ACTIVE, ARPHRD_CAN, false};
static const hal_can_filter_t k_filter = {0x180, 0x780, false}, k_own = {0x200, 0x780, false};
static const linux_can_config_t k_config = {"can0", &k_filter, 1, &k_own, 1, 0, REQUEST_DIR};
static linux_can_t can;
static hal_can_t hal;
static interface_t at_start;

void setUp(void) {}

void tearDown(void)
{
    failing_end();
    if (Unity.CurrentTestFailed) {
        printf("# %s\n", failing_text());
    }
}

static void assert_told(hv_status_t status)
{
    TEST_ASSERT_MESSAGE(status == HV_ERR_IO || status == HV_ERR_AGAIN, failing_text());
    TEST_ASSERT_NOT_EQUAL_MESSAGE(LINUX_CAN_FINE, can.trouble, failing_text());
    TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("can: can0: ", can.error_text, 11, failing_text());
}

static void assert_nothing_open(void)
{
    TEST_ASSERT_EQUAL_MESSAGE(0, fds_open(), failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(0, m.netlinks, failing_text());
    TEST_ASSERT_FALSE_MESSAGE(m.was_misused, failing_text());
}

static hv_status_t send_one(void)
{
    return hal_can_send(hal, &(can_frame_t){.id = 0x201, .length = 6});
}

static hal_can_state_t state_now(void)
{
    hal_can_state_t state;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_bus_state(hal, &state));
    return state;
}

/* Frames for us, up to the first that does not come; outputs stay as they were then. */
static unsigned receive_all(hv_status_t *status)
{
    for (unsigned count = 0;; count++) {
        can_frame_t got = {.id = 0x77};
        uint64_t time_us = 77;
        *status = hal_can_recv(hal, &got, &time_us);
        if (*status != HV_OK) {
            TEST_ASSERT_TRUE_MESSAGE(got.id == 0x77 && time_us == 77, failing_text());
            return count;
        }
    }
}

static void assert_alive(void)
{
    hv_status_t status;
    uint32_t left;
    (void)receive_all(&status);
    m.sent = 0;
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, send_one(), failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(1, m.sent, failing_text());
    confirm();
    inject(0x181, 0);
    TEST_ASSERT_EQUAL_MESSAGE(1, receive_all(&status), failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_AGAIN, status, failing_text());
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(hal, &left));
    TEST_ASSERT_EQUAL_MESSAGE(0, left, failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(HAL_CAN_ACTIVE, state_now(), failing_text());
    TEST_ASSERT_TRUE_MESSAGE(m.is_bound, failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(LINUX_CAN_FINE, can.trouble, failing_text());
    TEST_ASSERT_EQUAL_STRING_MESSAGE("", can.error_text, failing_text());
}

/* After a restart that failed nothing passes either way, and the state says so. */
static void assert_cut_off(void)
{
    const unsigned before = m.sent;
    TEST_ASSERT_TRUE_MESSAGE(state_now() >= HAL_CAN_BUS_OFF, failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_IO, send_one(), failing_text());
    TEST_ASSERT_EQUAL(before, m.sent);
}

static void begin(void)
{
    memset(&m, 0, sizeof m);
    m.link = at_start;
}

static void end(void)
{
    failing_end();
    linux_can_close(&can);
    assert_nothing_open();
}

/* The system is itself again, and the interface there: the backend has to come back, whatever it was told meanwhile. */
static void recover_and_end(void)
{
    failing_end();
    m.link = (interface_t){true, m.link.is_up, true, m.link.waiting, m.link.controller, ARPHRD_CAN, false};
    if (m.link.waiting > 0 && m.sent == 0) { /* whose they are takes two looks; of ours none is needed */
        (void)!hal_can_restart(hal);
        m.later_s++;
    }
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, hal_can_restart(hal), failing_text());
    TEST_ASSERT_EQUAL_UINT32(0, m.link.waiting);
    TEST_ASSERT_EQUAL_MESSAGE(1, fds_open(), failing_text());
    assert_alive();
    end();
}

static void try_open(void)
{
    begin();
    failing_begin();
    const hv_status_t status = linux_can_open(&can, &k_config);
    failing_end();
    hal = linux_can_hal(&can);
    TEST_ASSERT_MESSAGE(failing_count() > 0 || status == HV_OK || !at_start.is_there || !at_start.may_change ||
                            at_start.waiting > 0,
                        failing_text());
    if (status == HV_OK) {
        assert_alive();
        end();
        return;
    }
    assert_told(status);
    if (status == HV_ERR_AGAIN) {
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_IO, send_one(), failing_text());
        TEST_ASSERT_EQUAL(0, m.sent);
        recover_and_end();
        return;
    }
    assert_nothing_open();
    begin();
    m.link = k_fine;
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, &k_config));
    recover_and_end();
}

/* A cycle: what the motion thread does. True where nothing was wrong. */
static bool do_cycle(void)
{
    hv_status_t status;
    inject(0x181, 0);
    const unsigned got = receive_all(&status);
    TEST_ASSERT_MESSAGE(status == HV_ERR_AGAIN || status == HV_ERR_IO, failing_text());
    const bool is_received = status == HV_ERR_AGAIN;
    if (!is_received) {
        assert_told(status);
    }
    const unsigned before = m.sent;
    status = send_one();
    TEST_ASSERT_EQUAL_MESSAGE(status == HV_OK ? 1 : 0, m.sent - before, failing_text());
    if (status != HV_OK) {
        TEST_ASSERT_MESSAGE(status == HV_ERR_IO || status == HV_ERR_AGAIN, failing_text());
    }
    if (status == HV_ERR_IO) {
        assert_told(status);
    }
    confirm();
    return is_received && got > 0 && status == HV_OK;
}

/* What its helper does now and then. */
static bool ask_state(void)
{
    hal_can_state_t state = HAL_CAN_GONE;
    const hv_status_t status = hal_can_ask_state(hal, &state);
    TEST_ASSERT_MESSAGE(status == HV_OK || (status == HV_ERR_IO && state == HAL_CAN_GONE), failing_text());
    return status == HV_OK;
}

static void try_running(void)
{
    hv_status_t status;
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, &k_config));
    hal = linux_can_hal(&can);
    failing_begin();
    bool is_fine = do_cycle();
    is_fine = ask_state() && is_fine;
    is_fine = do_cycle() && is_fine;
    TEST_ASSERT_MESSAGE(is_fine || failing_count() > 0, failing_text());
    failing_end();
    if (!can.is_cut) { /* what has passed has passed */
        (void)receive_all(&status);
        TEST_ASSERT_TRUE_MESSAGE(ask_state(), failing_text());
        assert_alive();
    }
    recover_and_end();
}

/* Frames of ours wait, as after a stall: restart has to take the interface down and up. */
static void try_restart(void)
{
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, &k_config));
    hal = linux_can_hal(&can);
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    m.link.waiting = at_start.waiting + 1;
    m.link.controller = CAN_STATE_BUS_OFF;
    inject(CAN_ERR_FLAG | CAN_ERR_BUSOFF, 0);
    hv_status_t status;
    (void)receive_all(&status);
    for (int i = 0; i < 3; i++) {
        failing_begin();
        status = hal_can_restart(hal);
        failing_end();
        TEST_ASSERT_MESSAGE(failing_count() > 0 || status == HV_OK, failing_text());
        if (status == HV_OK) {
            assert_alive();
        } else {
            assert_told(status);
            assert_cut_off();
        }
    }
    recover_and_end();
}

/* A restart of something that works, with frames on their way. */
static void try_restart_in_doubt(void)
{
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, &k_config));
    hal = linux_can_hal(&can);
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    failing_begin();
    const hv_status_t status = hal_can_restart(hal);
    failing_end();
    TEST_ASSERT_MESSAGE(failing_count() > 0 || status == HV_OK, failing_text());
    if (status == HV_OK) {
        assert_alive();
    } else {
        assert_told(status);
        assert_cut_off();
    }
    recover_and_end();
}

static void try_close(void)
{
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, &k_config));
    hal = linux_can_hal(&can);
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    failing_begin();
    linux_can_close(&can);
    failing_end();
    assert_nothing_open();
    linux_can_close(&can);
}

static unsigned failures;

static void test_open_on_every_kind_of_interface(void)
{
    static const interface_t k_starts[] = {{true, true, true, 0, CAN_STATE_ERROR_ACTIVE, ARPHRD_CAN, false},
                                           {true, true, true, 7, CAN_STATE_ERROR_ACTIVE, ARPHRD_CAN, false},
                                           {true, true, false, 7, CAN_STATE_ERROR_ACTIVE, ARPHRD_CAN, false},
                                           {true, true, true, 0, CAN_STATE_BUS_OFF, ARPHRD_CAN, false},
                                           {true, true, false, 0, CAN_STATE_BUS_OFF, ARPHRD_CAN, false},
                                           {true, false, true, 0, CAN_STATE_STOPPED, ARPHRD_CAN, false},
                                           {true, false, false, 0, CAN_STATE_STOPPED, ARPHRD_CAN, false},
                                           {false, false, true, 0, CAN_STATE_STOPPED, ARPHRD_CAN, false}};
    for (size_t i = 0; i < sizeof k_starts / sizeof k_starts[0]; i++) {
        at_start = k_starts[i];
        failures += failing_sweep(k_errors, try_open);
    }
}

static void test_running(void)
{
    at_start = k_fine;
    failures += failing_sweep(k_errors, try_running);
}

static void test_restart(void)
{
    at_start = k_fine;
    failures += failing_sweep(k_errors, try_restart);
    failures += failing_sweep(k_errors, try_restart_in_doubt);
}

static void test_close(void)
{
    at_start = k_fine;
    failures += failing_sweep(k_errors, try_close);
}

/* --- What an interface may be like, and comes to be --- */

static void open_fine(const linux_can_config_t *config)
{
    at_start = k_fine;
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, config));
    hal = linux_can_hal(&can);
}

static const linux_can_config_t k_open_to_all = {.interface = "can0"};

/* Where others change queues meanwhile the list is not whole, and the system says so. */
static void test_list_of_queues_that_is_not_whole_is_asked_for_again(void)
{
    hal_can_state_t state;
    open_fine(&k_config);
    m.interruptions = 2;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    m.interruptions = 3;
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    end();
}

static can_frame_t take_one(void)
{
    can_frame_t got = {.id = 0};
    uint64_t time_us;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(hal, &got, &time_us));
    return got;
}

static void test_frames_of_every_kind(void)
{
    open_fine(&k_open_to_all);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(hal, &(can_frame_t){.id = 0x12345, .is_extended = true, .is_rtr = true, .length = 2}));
    TEST_ASSERT_EQUAL_HEX32(0x12345 | CAN_EFF_FLAG | CAN_RTR_FLAG, m.wire[0].can_id);
    inject(0x54321 | CAN_EFF_FLAG | CAN_RTR_FLAG, 9);
    can_frame_t got = take_one();
    TEST_ASSERT_TRUE(got.is_extended && got.is_rtr && got.id == 0x54321 && got.data[1] == 0);
    inject(0x123, 9);
    m.inbox[m.first % FRAMES_MAX].frame.can_dlc = 15;
    got = take_one();
    TEST_ASSERT_TRUE(got.length == 8 && got.data[1] == 9 && !got.is_extended);
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &(can_frame_t){.is_error = true}));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &(can_frame_t){.length = 9}));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &(can_frame_t){.id = CAN_ID_MAX + 1}));
    end();
}

static void test_what_is_not_on_the_lists_passes_neither_way(void)
{
    hv_status_t status;
    open_fine(&k_config);
    inject(0x301, 0);
    inject(0x181 | CAN_EFF_FLAG, 0);
    TEST_ASSERT_EQUAL(0, receive_all(&status));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &(can_frame_t){.id = 0x301}));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(hal, &(can_frame_t){.id = 0x201, .is_extended = true}));
    confirm();
    m.inbox[m.last++ % FRAMES_MAX] = (delivery_t){.is_own = true}; /* of a frame that was forgotten */
    TEST_ASSERT_EQUAL(0, receive_all(&status));
    end();
}

static void test_no_more_than_the_queue_takes(void)
{
    linux_can_config_t config = k_open_to_all;
    config.queue_frames = 2;
    open_fine(&config);
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    TEST_ASSERT_EQUAL(HV_OK, send_one());
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, send_one());
    TEST_ASSERT_EQUAL(2, m.sent);
    end();
}

static void test_reports_of_the_controller(void)
{
    static const struct {
        uint32_t what;
        uint8_t of_controller;
        uint32_t report;
        hal_can_state_t state;
    } k_rows[] = {{CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, CAN_ERROR_WARNING, HAL_CAN_WARNING},
                  {CAN_ERR_CRTL | CAN_ERR_ACK, CAN_ERR_CRTL_RX_PASSIVE, CAN_ERROR_PASSIVE | CAN_ERROR_NO_ACK, HAL_CAN_PASSIVE},
                  {CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW, CAN_ERROR_OVERRUN, HAL_CAN_PASSIVE},
                  {CAN_ERR_PROT, 0, CAN_ERROR_OTHER, HAL_CAN_PASSIVE},
                  {CAN_ERR_BUSOFF, 0, CAN_ERROR_BUS_OFF, HAL_CAN_BUS_OFF},
                  {CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, CAN_ERROR_OTHER, HAL_CAN_BUS_OFF},
                  {CAN_ERR_RESTARTED, 0, CAN_ERROR_RESTARTED, HAL_CAN_ACTIVE}};
    open_fine(&k_config);
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        inject(CAN_ERR_FLAG | k_rows[i].what, k_rows[i].of_controller);
        TEST_ASSERT_EQUAL_HEX32(k_rows[i].report, take_one().id);
        TEST_ASSERT_EQUAL(k_rows[i].state, state_now());
    }
    hv_status_t status;
    inject(0x181, 0); /* it has restarted by itself: nothing passes until we do */
    TEST_ASSERT_EQUAL(0, receive_all(&status));
    TEST_ASSERT_EQUAL(HV_ERR_IO, send_one());
    recover_and_end();
}

static void test_lost_frames_are_told_of_before_the_next(void)
{
    open_fine(&k_config);
    m.lost = 5;
    inject(0x181, 1);
    const can_frame_t gap = take_one();
    TEST_ASSERT_TRUE(gap.is_error && gap.id == CAN_ERROR_OVERRUN);
    TEST_ASSERT_EQUAL_HEX32(0x181, take_one().id);
    TEST_ASSERT_EQUAL_UINT32(5, can.lost);
    end();
}

static void test_times_do_not_follow_the_wall_clock(void)
{
    can_frame_t got;
    uint64_t time_us, last_us = 0;
    open_fine(&k_config);
    for (long step_s = -86400; step_s <= 86400; step_s += 86400) {
        m.clock_step_s = step_s;
        inject(0x181, 0);
        TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(hal, &got, &time_us));
        TEST_ASSERT_TRUE(time_us >= last_us && (last_us == 0 || time_us < last_us + 60000000u));
        last_us = time_us;
    }
    end();
}

static void test_interface_without_controller_or_echo(void)
{
    linux_can_link_t link;
    uint32_t left;
    hal_can_state_t state;
    at_start = (interface_t){true, true, true, 0, 0, ARPHRD_CAN, true};
    begin();
    m.driver = "vcan";
    TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, &k_open_to_all));
    hal = linux_can_hal(&can);
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, hal_can_unconfirmed(hal, &left));
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state);
    TEST_ASSERT_EQUAL(HV_OK, linux_can_link_look(can.netlink, "can0", &link));
    TEST_ASSERT_FALSE(link.has_controller);
    TEST_ASSERT_EQUAL_STRING("", link.kind);
    TEST_ASSERT_EQUAL_STRING("vcan", link.driver);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, linux_can_link_look(can.netlink, "a-name-of-16-chr", &link));
    end();
}

static void test_controller_in_any_state(void)
{
    static const hal_can_state_t k_states[] = {[CAN_STATE_ERROR_ACTIVE] = HAL_CAN_ACTIVE,
                                               [CAN_STATE_ERROR_WARNING] = HAL_CAN_WARNING,
                                               [CAN_STATE_ERROR_PASSIVE] = HAL_CAN_PASSIVE,
                                               [CAN_STATE_BUS_OFF] = HAL_CAN_ACTIVE, /* taken out of it */
                                               [CAN_STATE_STOPPED] = HAL_CAN_ACTIVE,
                                               [CAN_STATE_SLEEPING] = HAL_CAN_ACTIVE,
                                               [CAN_STATE_MAX] = HAL_CAN_ACTIVE};
    for (uint32_t i = 0; i <= CAN_STATE_MAX; i++) {
        at_start = k_fine;
        at_start.controller = i;
        begin();
        TEST_ASSERT_EQUAL(HV_OK, linux_can_open(&can, &k_config));
        hal = linux_can_hal(&can);
        TEST_ASSERT_EQUAL(k_states[i], state_now());
        end();
    }
}

/* What only a restart takes back stays. */
static void test_asked_state_follows_where_it_may(void)
{
    hal_can_state_t state;
    open_fine(&k_config);
    m.link.controller = CAN_STATE_ERROR_PASSIVE;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_PASSIVE, state);
    m.link.controller = CAN_STATE_BUS_OFF;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_PASSIVE, state);
    m.link.is_up = false;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_ask_state(hal, &state));
    TEST_ASSERT_EQUAL(HAL_CAN_PASSIVE, state);
    end();
}

/* Frames wait at each look; some have gone out since the look before, and some were added. */
static void test_frames_of_others_are_dropped_where_they_stand_still(void)
{
    enum { LOOKS = 3 };
    static const struct {
        struct {
            uint32_t gone_out, waiting;
            long later_s;
            hv_status_t expected;
        } look[LOOKS];
        uint32_t left;
    } k_cases[] = {
        {{{0, 5, 0, HV_ERR_IO}, {0, 5, 1, HV_OK}}, 0},                          /* too early to tell, then dead */
        {{{70, 5, 0, HV_OK}}, 5},                                               /* alive: it has added 70 */
        {{{70, 3, 1, HV_OK}}, 3},                                               /* */
        {{{2, 3, 1, HV_ERR_IO}, {0, 3, 1, HV_OK}}, 0},                          /* two have gone out, none was added: dead */
        {{{2, 3, 1, HV_ERR_IO}, {1, 2, 1, HV_ERR_IO}, {2, 0, 1, HV_OK}}, 0},    /* all of them go out */
        {{{2, 4, 1, HV_ERR_IO}, {0, 4, 1, HV_OK}}, 0},                          /* one was in the adapter */
        {{{0, 5, 10, HV_ERR_IO}, {0, 5, 1, HV_OK}}, 0},                         /* the first look was long ago */
        {{{30, 5, 1, HV_ERR_IO}, {30, 5, 1, HV_ERR_IO}, {30, 5, 1, HV_OK}}, 5}, /* alive, and slow */
        {{{9, 9, 10, HV_ERR_IO}, {200, 9, 1, HV_OK}}, 9},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        at_start = k_fine;
        at_start.waiting = 5;
        begin();
        m.gone_out = 41;
        TEST_ASSERT_EQUAL(HV_ERR_AGAIN, linux_can_open(&can, &k_config));
        hal = linux_can_hal(&can);
        TEST_ASSERT_EQUAL(LINUX_CAN_FRAMES_WAIT, can.trouble);
        hv_status_t status = HV_ERR_IO;
        for (unsigned k = 0; k < LOOKS && status != HV_OK; k++) {
            TEST_ASSERT_EQUAL(HV_ERR_IO, send_one());
            m.gone_out += k_cases[i].look[k].gone_out;
            m.link.waiting = k_cases[i].look[k].waiting;
            m.later_s += k_cases[i].look[k].later_s;
            status = hal_can_restart(hal);
            TEST_ASSERT_EQUAL(k_cases[i].look[k].expected, status);
            TEST_ASSERT_EQUAL_UINT(0, m.requests);
        }
        TEST_ASSERT_EQUAL_UINT32(k_cases[i].left, m.link.waiting);
        assert_alive();
        linux_can_close(&can);
    }
    at_start = k_fine;
}

static void test_something_else_of_that_name(void)
{
    open_fine(&k_config);
    m.link.type = ARPHRD_ETHER;
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_restart(hal));
    TEST_ASSERT_EQUAL(LINUX_CAN_NOT_CAN, can.trouble);
    recover_and_end();
    at_start = (interface_t){.is_there = true, .type = ARPHRD_ETHER};
    begin();
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_can_open(&can, &k_config));
    assert_nothing_open();
}

static void test_configurations_that_are_too_long(void)
{
    linux_can_config_t config = k_config;
    config.interface = "a-name-of-16-chr";
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_can_open(&can, &config));
    TEST_ASSERT_NOT_NULL(strstr(can.error_text, "too long"));
    config = k_config;
    config.filters = LINUX_CAN_FILTERS_MAX + 1;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_can_open(&can, &config));
    config = k_config;
    config.owns = LINUX_CAN_FILTERS_MAX + 1;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_can_open(&can, &config));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_open_on_every_kind_of_interface);
    RUN_TEST(test_running);
    RUN_TEST(test_restart);
    RUN_TEST(test_close);
    RUN_TEST(test_list_of_queues_that_is_not_whole_is_asked_for_again);
    RUN_TEST(test_frames_of_every_kind);
    RUN_TEST(test_what_is_not_on_the_lists_passes_neither_way);
    RUN_TEST(test_no_more_than_the_queue_takes);
    RUN_TEST(test_reports_of_the_controller);
    RUN_TEST(test_lost_frames_are_told_of_before_the_next);
    RUN_TEST(test_times_do_not_follow_the_wall_clock);
    RUN_TEST(test_interface_without_controller_or_echo);
    RUN_TEST(test_controller_in_any_state);
    RUN_TEST(test_asked_state_follows_where_it_may);
    RUN_TEST(test_frames_of_others_are_dropped_where_they_stand_still);
    RUN_TEST(test_something_else_of_that_name);
    RUN_TEST(test_configurations_that_are_too_long);
    printf("# figure %u failures of system calls injected\n", failures);
    return UNITY_END();
}
