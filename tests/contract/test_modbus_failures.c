/* SPDX-License-Identifier: MIT
 * test_modbus_failures.c - Modbus lines where the system refuses: each call of hal/linux/linux_modbus*.c fails with each error
 * that matters, once and for ever, on TCP and on serial lines.
 *
 * libmodbus and the device behind it are played, and so is time, which passes where somebody waits: nothing here takes any.
 */
#include "unity.h"

#include <errno.h>
#include <modbus.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "failing.h"
#include "linux_modbus.h"

#define LINE_FD 5000 /* of a link; more than any real one */
#define LIMIT_S 60
#define VALUE   4242u
#define TRIES   40  /* seconds that a line may take to be itself again */
#define ROUNDS  100 /* of the worker */
#define SECOND  1000000u
#define FDS_MAX 4096
#define ANSWERED                                                                                                                 \
    {                                                                                                                            \
        ETIMEDOUT, EAGAIN, ECONNRESET, EPIPE, EIO, EBADF, EMBXILVAL, EMBXGTAR, EMBBADCRC, EMBBADSLAVE                            \
    }

static const failing_errors_t k_errors[] = {
    {"modbus_new_rtu", {ENOMEM, EINVAL}},
    {"modbus_new_tcp", {ENOMEM}},
    {"modbus_connect",
     {ECONNREFUSED, ETIMEDOUT, EINPROGRESS, EHOSTUNREACH, ENETUNREACH, EMFILE, ENOENT, ENODEV, EACCES, EPERM, EBUSY, ENOTTY}},
    {"setsockopt", {ENOMEM, EINVAL}},
    {"ioctl", {EIO, ENOTTY, ENODEV, EBUSY}},
    {"tcflush", {EIO, ENOTTY}},
    {"modbus_rtu_set_serial_mode", {ENOTTY, EINVAL}},
    {"modbus_rtu_set_rts", {EIO}},
    {"read", {EINTR, EAGAIN, EIO, ECONNRESET}},
    {"write", {EINTR, EAGAIN}},
    {"ppoll", {EINTR, ENOMEM}},
    {"clock_nanosleep", {EINTR, EINVAL}},
    {"modbus_read_bits", ANSWERED},
    {"modbus_read_input_bits", ANSWERED},
    {"modbus_read_registers", ANSWERED},
    {"modbus_read_input_registers", ANSWERED},
    {"modbus_write_bit", ANSWERED},
    {"modbus_write_bits", ANSWERED},
    {"modbus_write_register", ANSWERED},
    {"modbus_write_registers", ANSWERED},
    {"modbus_send_raw_request", {EIO, ECONNRESET, EAGAIN}},
    {"modbus_flush", {EIO}},
    {"eventfd", {EMFILE, ENOMEM}},
    {"pthread_create", {EAGAIN, EPERM}},
    {NULL, {0}},
};

/* --- Time, and the system --- */

static struct {
    uint64_t now_us;  /* atomic */
    unsigned strays;  /* bytes that wait on the link; atomic */
    bool has_hung_up; /* the host has */
    bool is_connected;
    unsigned contexts; /* of libmodbus */
    unsigned asked;    /* transactions that have reached the device */
    int connect_error;
    uint8_t raw[260];
    int raw_length;
    bool is_wake[FDS_MAX];
} m;

int __wrap_clock_gettime(clockid_t clock, struct timespec *now);
int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *until, struct timespec *left);
ssize_t __real_read(int fd, void *bytes, size_t size);
ssize_t __wrap_read(int fd, void *bytes, size_t size);
ssize_t __real_write(int fd, const void *bytes, size_t size);
ssize_t __wrap_write(int fd, const void *bytes, size_t size);
int __wrap_setsockopt(int fd, int level, int option, const void *value, socklen_t size);
int __wrap_ioctl(int fd, unsigned long what, ...);
int __wrap_tcflush(int fd, int what);
int __wrap_ppoll(struct pollfd *fds, nfds_t count, const struct timespec *wait, const sigset_t *mask);
int __real_eventfd(unsigned count, int flags);
int __wrap_eventfd(unsigned count, int flags);
int __real_close(int fd);
int __wrap_close(int fd);
int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *), void *argument);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *), void *argument);

static uint64_t us_of(const struct timespec *time)
{
    return (uint64_t)time->tv_sec * 1000000u + (uint64_t)time->tv_nsec / 1000u;
}

static void let_pass(uint64_t us)
{
    (void)__atomic_fetch_add(&m.now_us, us, __ATOMIC_ACQ_REL);
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *now)
{
    (void)clock;
    const uint64_t us = __atomic_fetch_add(&m.now_us, 1, __ATOMIC_ACQ_REL);
    *now = (struct timespec){(time_t)(us / 1000000u), (long)(us % 1000000u) * 1000};
    return 0;
}

int __wrap_clock_nanosleep(clockid_t clock, int flags, const struct timespec *until, struct timespec *left)
{
    (void)clock;
    (void)flags;
    (void)left;
    let_pass(1); /* so that what is interrupted for ever ends */
    if (__atomic_load_n(&m.now_us, __ATOMIC_ACQUIRE) >= us_of(until)) {
        return 0;
    }
    FAILING_NUMBER("clock_nanosleep");
    __atomic_store_n(&m.now_us, us_of(until), __ATOMIC_RELEASE);
    return 0;
}

static bool is_readable(void)
{
    return m.is_connected && (m.has_hung_up || __atomic_load_n(&m.strays, __ATOMIC_ACQUIRE) > 0);
}

int __wrap_ppoll(struct pollfd *fds, nfds_t count, const struct timespec *wait, const sigset_t *mask)
{
    struct pollfd wake = {.fd = -1, .events = POLLIN};
    int ready = 0;
    FAILING("ppoll", -1);
    (void)mask;
    for (nfds_t i = 0; i < count; i++) {
        fds[i].revents = fds[i].fd == LINE_FD && is_readable() ? POLLIN : 0;
        ready += fds[i].revents != 0;
        wake.fd = fds[i].fd == LINE_FD ? wake.fd : fds[i].fd;
    }
    if (ready == 0 && wake.fd >= 0 && poll(&wake, 1, 1) > 0) {
        fds[0].revents = POLLIN;
        return 1;
    }
    if (ready == 0 && wait != NULL) {
        let_pass(us_of(wait));
    }
    return ready;
}

ssize_t __wrap_read(int fd, void *bytes, size_t size)
{
    FAILING("read", -1);
    if (fd != LINE_FD) {
        return __real_read(fd, bytes, size);
    }
    if (m.has_hung_up) {
        return 0;
    }
    const unsigned waiting = __atomic_exchange_n(&m.strays, 0, __ATOMIC_ACQ_REL);
    return waiting < size ? (ssize_t)waiting : (ssize_t)size;
}

ssize_t __wrap_write(int fd, const void *bytes, size_t size)
{
    FAILING("write", -1);
    return __real_write(fd, bytes, size);
}

int __wrap_setsockopt(int fd, int level, int option, const void *value, socklen_t size)
{
    FAILING("setsockopt", -1);
    (void)level;
    (void)option;
    (void)value;
    (void)size;
    TEST_ASSERT_EQUAL(LINE_FD, fd);
    return 0;
}

int __wrap_ioctl(int fd, unsigned long what, ...)
{
    FAILING("ioctl", -1);
    (void)what;
    TEST_ASSERT_EQUAL(LINE_FD, fd);
    return 0;
}

int __wrap_tcflush(int fd, int what)
{
    FAILING("tcflush", -1);
    (void)what;
    TEST_ASSERT_EQUAL(LINE_FD, fd);
    return 0;
}

int __wrap_eventfd(unsigned count, int flags)
{
    FAILING("eventfd", -1);
    const int fd = __real_eventfd(count, flags);
    TEST_ASSERT_TRUE(fd >= 0 && fd < FDS_MAX);
    m.is_wake[fd] = true;
    return fd;
}

int __wrap_close(int fd)
{
    if (fd >= 0 && fd < FDS_MAX) {
        m.is_wake[fd] = false;
    }
    return __real_close(fd);
}

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *), void *argument)
{
    FAILING_NUMBER("pthread_create");
    return __real_pthread_create(thread, attributes, function, argument);
}

/* --- libmodbus, and a device that has VALUE everywhere --- */

struct _modbus {
    int unused;
};

static struct _modbus context;

modbus_t *modbus_new_tcp(const char *host, int port)
{
    FAILING("modbus_new_tcp", NULL);
    (void)host;
    (void)port;
    m.contexts++;
    return &context;
}

modbus_t *modbus_new_rtu(const char *device, int baud, char parity, int data_bits, int stop_bits)
{
    FAILING("modbus_new_rtu", NULL);
    (void)device;
    (void)baud;
    (void)parity;
    (void)data_bits;
    (void)stop_bits;
    m.contexts++;
    return &context;
}

void modbus_free(modbus_t *self)
{
    (void)self;
    m.contexts--;
}

int modbus_connect(modbus_t *self)
{
    FAILING("modbus_connect", -1);
    (void)self;
    TEST_ASSERT_FALSE(m.is_connected);
    errno = m.connect_error;
    m.is_connected = errno == 0;
    m.has_hung_up = false;
    __atomic_store_n(&m.strays, 0, __ATOMIC_RELEASE);
    return m.is_connected ? 0 : -1;
}

void modbus_close(modbus_t *self)
{
    (void)self;
    m.is_connected = false;
}

int modbus_get_socket(modbus_t *self)
{
    (void)self;
    return m.is_connected ? LINE_FD : -1;
}

int modbus_flush(modbus_t *self)
{
    FAILING("modbus_flush", -1);
    (void)self;
    return 0;
}

int modbus_set_slave(modbus_t *self, int unit)
{
    (void)self;
    (void)unit;
    return 0;
}

int modbus_set_response_timeout(modbus_t *self, uint32_t s, uint32_t us)
{
    (void)self;
    (void)s;
    return us < 1000000u ? 0 : -1;
}

int modbus_set_byte_timeout(modbus_t *self, uint32_t s, uint32_t us)
{
    (void)self;
    (void)s;
    (void)us;
    return 0;
}

int modbus_rtu_set_rts(modbus_t *self, int mode)
{
    FAILING("modbus_rtu_set_rts", -1);
    (void)self;
    (void)mode;
    return 0;
}

int modbus_rtu_set_rts_delay(modbus_t *self, int us)
{
    (void)self;
    (void)us;
    return 0;
}

int modbus_rtu_set_serial_mode(modbus_t *self, int mode)
{
    FAILING("modbus_rtu_set_serial_mode", -1);
    (void)self;
    (void)mode;
    return 0;
}

static int answer(int count)
{
    m.asked++;
    let_pass(100);
    return count;
}

static int answer_bits(int count, uint8_t *to)
{
    memset(to, 1, (size_t)count);
    return answer(count);
}

static int answer_registers(int count, uint16_t *to)
{
    for (int i = 0; i < count; i++) {
        to[i] = VALUE;
    }
    return answer(count);
}

int modbus_read_bits(modbus_t *self, int address, int count, uint8_t *to)
{
    FAILING("modbus_read_bits", -1);
    (void)self;
    (void)address;
    return answer_bits(count, to);
}

int modbus_read_input_bits(modbus_t *self, int address, int count, uint8_t *to)
{
    FAILING("modbus_read_input_bits", -1);
    (void)self;
    (void)address;
    return answer_bits(count, to);
}

int modbus_read_registers(modbus_t *self, int address, int count, uint16_t *to)
{
    FAILING("modbus_read_registers", -1);
    (void)self;
    (void)address;
    return answer_registers(count, to);
}

int modbus_read_input_registers(modbus_t *self, int address, int count, uint16_t *to)
{
    FAILING("modbus_read_input_registers", -1);
    (void)self;
    (void)address;
    return answer_registers(count, to);
}

int modbus_write_bit(modbus_t *self, int address, int value)
{
    FAILING("modbus_write_bit", -1);
    (void)self;
    (void)address;
    (void)value;
    return answer(1);
}

int modbus_write_bits(modbus_t *self, int address, int count, const uint8_t *from)
{
    FAILING("modbus_write_bits", -1);
    (void)self;
    (void)address;
    (void)from;
    return answer(count);
}

int modbus_write_register(modbus_t *self, int address, const uint16_t value)
{
    FAILING("modbus_write_register", -1);
    (void)self;
    (void)address;
    (void)value;
    return answer(1);
}

int modbus_write_registers(modbus_t *self, int address, int count, const uint16_t *from)
{
    FAILING("modbus_write_registers", -1);
    (void)self;
    (void)address;
    (void)from;
    return answer(count);
}

int modbus_send_raw_request(modbus_t *self, const uint8_t *bytes, int length)
{
    FAILING("modbus_send_raw_request", -1);
    (void)self;
    memcpy(m.raw, bytes, (size_t)length);
    m.raw_length = length;
    return answer(length);
}

/* --- The link --- */

static const linux_modbus_config_t k_tcp = {.host = "127.0.0.1", .port = 502, .timeout_us = 50000, .broadcast_pause_us = 1000};
static const linux_modbus_config_t k_serial = {.device = "/dev/ttyUSB0",
                                               .baud_bps = 115200,
                                               .parity = 'N',
                                               .stop_bits = 1,
                                               .timeout_us = 50000,
                                               .direction = LINUX_MODBUS_RTS_HIGH};
static linux_modbus_config_t config;
static linux_modbus_link_t link_;
static const char *what;

void setUp(void) {}

void tearDown(void)
{
    failing_end();
}

static void begin(void)
{
    memset(&m, 0, sizeof m);
    m.now_us = 100 * SECOND;
}

static void assert_nothing_open(void)
{
    TEST_ASSERT_EQUAL_MESSAGE(0, m.contexts, failing_text());
    TEST_ASSERT_FALSE_MESSAGE(m.is_connected, failing_text());
    for (int fd = 0; fd < FDS_MAX; fd++) {
        TEST_ASSERT_FALSE_MESSAGE(m.is_wake[fd], failing_text());
    }
}

static modbus_result_t ask(modbus_function_t function, uint8_t unit)
{
    const bool is_single = function == MODBUS_WRITE_COIL || function == MODBUS_WRITE_REGISTER;
    const modbus_request_t request = {
        .function = function, .unit = unit, .address = 7, .count = is_single ? 1 : 2, .value = {VALUE, 0}};
    modbus_result_t result;
    const unsigned before = m.asked;
    linux_modbus_link_mend(&link_);
    linux_modbus_link_run(&link_, &request, &result);
    TEST_ASSERT_MESSAGE(result.status == HV_OK || result.status == HV_ERR_TIMEOUT || result.status == HV_ERR_FORMAT ||
                            result.status == HV_ERR_STATE || result.status == HV_ERR_IO,
                        failing_text());
    TEST_ASSERT_MESSAGE(result.status != HV_OK || m.asked > before, failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(result.status == HV_OK && !modbus_is_write(function) ? request.count : 0, result.count,
                              failing_text());
    TEST_ASSERT_MESSAGE((result.exception != 0) == (result.status == HV_ERR_STATE), failing_text());
    for (unsigned i = result.count; i < HAL_MODBUS_VALUES_MAX; i++) {
        const bool is_written = result.status == HV_OK && modbus_is_write(function) && i < request.count;
        TEST_ASSERT_EQUAL_MESSAGE(is_written ? request.value[i] : 0, result.value[i], failing_text());
    }
    TEST_ASSERT_MESSAGE(link_.is_linked || link_.trouble != LINUX_MODBUS_FINE, failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(link_.is_linked, m.is_connected, failing_text());
    TEST_ASSERT_EQUAL(link_.is_linked ? LINE_FD : -1, linux_modbus_link_fd(&link_));
    return result;
}

static const modbus_function_t k_functions[] = {MODBUS_READ_COILS,  MODBUS_READ_DISCRETE_INPUTS, MODBUS_READ_HOLDING,
                                                MODBUS_READ_INPUT,  MODBUS_WRITE_COIL,           MODBUS_WRITE_REGISTER,
                                                MODBUS_WRITE_COILS, MODBUS_WRITE_REGISTERS};
#define FUNCTIONS (sizeof k_functions / sizeof k_functions[0])

/* True where all went well. */
static bool ask_all(void)
{
    bool is_fine = true;
    for (size_t i = 0; i < FUNCTIONS; i++) {
        is_fine = ask(k_functions[i], 1).status == HV_OK && is_fine;
    }
    return is_fine;
}

static void broadcast_all(void)
{
    for (size_t i = 4; i < FUNCTIONS; i++) {
        (void)ask(k_functions[i], HAL_MODBUS_BROADCAST);
    }
}

static void meet_strays(void)
{
    __atomic_store_n(&m.strays, 5, __ATOMIC_RELEASE);
    linux_modbus_link_look(&link_);
    (void)ask_all();
    m.has_hung_up = true;
    linux_modbus_link_look(&link_);
    (void)ask_all();
}

/* The system is itself again, and time passes. */
static void recover(void)
{
    unsigned seconds = 0;
    while (!ask_all()) {
        TEST_ASSERT_TRUE_MESSAGE(seconds++ < TRIES, failing_text());
        let_pass(SECOND);
    }
    TEST_ASSERT_EQUAL_MESSAGE(LINUX_MODBUS_FINE, link_.trouble, failing_text());
}

static void try_link(void)
{
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_link_open(&link_, &config, &what));
    failing_begin();
    const bool is_fine = ask_all();
    TEST_ASSERT_MESSAGE(is_fine || failing_count() > 0, failing_text());
    (void)ask_all(); /* in doubt */
    broadcast_all();
    meet_strays();
    let_pass(SECOND);
    (void)ask_all();
    failing_end();
    recover();
    failing_begin();
    linux_modbus_link_close(&link_);
    failing_end();
    linux_modbus_link_close(&link_);
    assert_nothing_open();
}

static void try_link_open(void)
{
    begin();
    failing_begin();
    const hv_status_t status = linux_modbus_link_open(&link_, &config, &what);
    failing_end();
    TEST_ASSERT_MESSAGE(status == (failing_count() > 0 ? HV_ERR_IO : HV_OK), failing_text());
    TEST_ASSERT_MESSAGE(status == HV_OK || what != NULL, failing_text());
    linux_modbus_link_close(&link_);
    assert_nothing_open();
}

static unsigned failures;

static void sweep(const linux_modbus_config_t *of, linux_modbus_direction_t direction)
{
    config = *of;
    config.direction = direction;
    failures += failing_sweep(k_errors, try_link_open);
    failures += failing_sweep(k_errors, try_link);
}

static void test_link_tcp(void)
{
    sweep(&k_tcp, LINUX_MODBUS_AUTOMATIC);
}

static void test_link_serial(void)
{
    sweep(&k_serial, LINUX_MODBUS_AUTOMATIC);
    sweep(&k_serial, LINUX_MODBUS_KERNEL);
    sweep(&k_serial, LINUX_MODBUS_RTS_HIGH);
    sweep(&k_serial, LINUX_MODBUS_RTS_LOW);
}

/* --- The worker --- */

static linux_modbus_t line;

static void try_worker(void)
{
    const modbus_request_t request = {.function = MODBUS_READ_HOLDING, .unit = 1, .count = 1};
    const time_t limit = time(NULL) + LIMIT_S;
    modbus_result_t result = {.status = HV_ERR_IO};
    begin();
    failing_begin();
    hv_status_t status = linux_modbus_open(&line, &config);
    if (status != HV_OK) {
        TEST_ASSERT_MESSAGE(status == HV_ERR_IO && failing_count() > 0, failing_text());
        TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("modbus: ", linux_modbus_text(&line), 8, failing_text());
        linux_modbus_close(&line);
        assert_nothing_open();
        failing_end();
        TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, &config));
    }
    for (int i = 0; i < ROUNDS && failing_count() == 0; i++) { /* until what is to fail has been met, if it is met here at all */
        TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(linux_modbus_hal(&line), 0, &request));
        (void)usleep(100);
    }
    failing_end();
    __atomic_store_n(&m.strays, 3, __ATOMIC_RELEASE); /* wakes nobody here, but is there when somebody looks */
    while (result.status != HV_OK) {
        TEST_ASSERT_TRUE_MESSAGE(time(NULL) < limit, failing_text());
        TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(linux_modbus_hal(&line), 0, &request));
        (void)usleep(200);
        (void)!hal_modbus_poll(linux_modbus_hal(&line), 0, &result);
    }
    linux_modbus_close(&line);
    assert_nothing_open();
}

static void test_worker(void)
{
    config = k_tcp;
    failures += failing_sweep(k_errors, try_worker);
}

/* --- What a link may meet, in words --- */

static void assert_named(const linux_modbus_config_t *of, int error, linux_modbus_trouble_t trouble, const char *words)
{
    const time_t limit = time(NULL) + LIMIT_S;
    linux_modbus_status_t status;
    begin();
    m.connect_error = error;
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, of));
    do {
        TEST_ASSERT_TRUE_MESSAGE(time(NULL) < limit, words);
        linux_modbus_status(&line, &status);
    } while (status.trouble == LINUX_MODBUS_NOT_TRIED);
    TEST_ASSERT_EQUAL_MESSAGE(trouble, status.trouble, strerror(error));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(linux_modbus_text(&line), words), linux_modbus_text(&line));
    linux_modbus_close(&line);
    assert_nothing_open();
}

static void test_troubles_of_serial_lines_are_named(void)
{
    static const struct {
        int error;
        linux_modbus_trouble_t trouble;
        const char *words;
    } k_rows[] = {{ENOENT, LINUX_MODBUS_NO_DEVICE, "plugged in"},       {ENODEV, LINUX_MODBUS_NO_DEVICE, "plugged in"},
                  {ENXIO, LINUX_MODBUS_NO_DEVICE, "plugged in"},        {EIO, LINUX_MODBUS_NO_DEVICE, "plugged in"},
                  {ENOTTY, LINUX_MODBUS_NOT_SERIAL, "not a serial"},    {EISDIR, LINUX_MODBUS_NOT_SERIAL, "not a serial"},
                  {EINVAL, LINUX_MODBUS_NOT_SERIAL, "not a serial"},    {EBUSY, LINUX_MODBUS_IN_USE, "another program"},
                  {EACCES, LINUX_MODBUS_NOT_ALLOWED, "dialout"},        {EPERM, LINUX_MODBUS_NOT_ALLOWED, "not permitted"},
                  {EMFILE, LINUX_MODBUS_SYSTEM_ERROR, "Too many open"}, {0, LINUX_MODBUS_FINE, ""}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        assert_named(&k_serial, k_rows[i].error, k_rows[i].trouble, k_rows[i].words);
    }
}

static void test_troubles_of_hosts_are_named(void)
{
    static const struct {
        int error;
        linux_modbus_trouble_t trouble;
        const char *words;
    } k_rows[] = {
        {ECONNREFUSED, LINUX_MODBUS_REFUSED, "refused"},           {EINPROGRESS, LINUX_MODBUS_UNREACHABLE, "nobody answers"},
        {ETIMEDOUT, LINUX_MODBUS_UNREACHABLE, "nobody answers"},   {EHOSTUNREACH, LINUX_MODBUS_UNREACHABLE, "nobody answers"},
        {ENETUNREACH, LINUX_MODBUS_UNREACHABLE, "nobody answers"}, {EACCES, LINUX_MODBUS_NOT_ALLOWED, "not allowed"},
        {EPERM, LINUX_MODBUS_NOT_ALLOWED, "not allowed"},          {EMFILE, LINUX_MODBUS_SYSTEM_ERROR, "Too many open"}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        assert_named(&k_tcp, k_rows[i].error, k_rows[i].trouble, k_rows[i].words);
    }
}

static void test_pauses_between_tries_grow_to_a_second(void)
{
    begin();
    m.connect_error = ECONNREFUSED;
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_link_open(&link_, &k_tcp, &what));
    uint64_t last_us = 0;
    for (int i = 0; i < 8; i++) {
        linux_modbus_link_mend(&link_);
        const uint64_t pause_us = link_.retry_us - linux_modbus_now_us();
        TEST_ASSERT_TRUE(pause_us + 100 >= last_us && pause_us <= SECOND);
        last_us = pause_us;
        let_pass(pause_us + 1);
    }
    TEST_ASSERT_TRUE(last_us > SECOND - 100);
    linux_modbus_link_close(&link_);
}

/* Bit by bit as on the wire: unit, function, address 7, then what the standard says. */
static void test_broadcasts_are_packed_as_the_standard_says(void)
{
    static const struct {
        modbus_function_t function;
        int length;
        uint8_t bytes[12];
    } k_rows[] = {{MODBUS_WRITE_COIL, 6, {0, 5, 0, 7, 0xFF, 0}},
                  {MODBUS_WRITE_REGISTER, 6, {0, 6, 0, 7, 0x10, 0x92}},
                  {MODBUS_WRITE_COILS, 8, {0, 15, 0, 7, 0, 2, 1, 1}},
                  {MODBUS_WRITE_REGISTERS, 11, {0, 16, 0, 7, 0, 2, 4, 0x10, 0x92, 0, 0}}};
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_link_open(&link_, &k_serial, &what));
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        TEST_ASSERT_EQUAL(HV_OK, ask(k_rows[i].function, HAL_MODBUS_BROADCAST).status);
        TEST_ASSERT_EQUAL(k_rows[i].length, m.raw_length);
        TEST_ASSERT_EQUAL_UINT8_ARRAY(k_rows[i].bytes, m.raw, (unsigned)k_rows[i].length);
    }
    linux_modbus_link_close(&link_);
}

static void test_slow_lines_with_parity_are_taken(void)
{
    linux_modbus_config_t slow = k_serial;
    slow.baud_bps = 9600;
    slow.parity = 'E';
    slow.stop_bits = 2;
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_link_open(&link_, &slow, &what));
    TEST_ASSERT_EQUAL_UINT32(1250000, link_.character_ns); /* 12 bits */
    TEST_ASSERT_EQUAL_UINT32(4375, link_.silence_us);
    linux_modbus_link_close(&link_);
    slow.parity = 'O';
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_link_open(&link_, &slow, &what));
    linux_modbus_link_close(&link_);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_link_tcp);
    RUN_TEST(test_link_serial);
    RUN_TEST(test_worker);
    RUN_TEST(test_troubles_of_serial_lines_are_named);
    RUN_TEST(test_troubles_of_hosts_are_named);
    RUN_TEST(test_pauses_between_tries_grow_to_a_second);
    RUN_TEST(test_broadcasts_are_packed_as_the_standard_says);
    RUN_TEST(test_slow_lines_with_parity_are_taken);
    printf("# figure %u failures of system calls injected\n", failures);
    return UNITY_END();
}
