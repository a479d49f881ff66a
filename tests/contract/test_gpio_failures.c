/* SPDX-License-Identifier: MIT
 * test_gpio_failures.c - relays and switches on GPIO lines where the system refuses: each call of hal/linux/linux_gpio*.c fails
 * with each error that matters, once and for ever; and what finding lines by name may meet. Chips are played, see played_gpio.h.
 */
#include "unity.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "failing.h"
#include "linux_gpio_inputs.h"
#include "linux_gpio_relays.h"
#include "played_gpio.h"

#define LIMIT_S    60
#define POLL_MS    2 /* the longest that a worker sleeps here */
#define FDS_MAX    4096
#define SAFE       1u
#define ALL_INPUTS (INPUT_ESTOP | INPUT_ENABLE | INPUT_RESET)

static const failing_errors_t k_errors[] = {
    {"opendir", {EACCES, EMFILE, ENOENT}},
    {"readdir", {EIO}},
    {"eventfd", {EMFILE, ENOMEM}},
    {"pthread_create", {EAGAIN, EPERM}},
    {"pthread_setschedparam", {EPERM}},
    {"pthread_timedjoin_np", {ETIMEDOUT}},
    {"poll", {EINTR, ENOMEM}},
    {"read", {EINTR, EAGAIN, EIO}},
    {"write", {EINTR, EAGAIN, EIO}},
    /* libgpiod 1.x */
    {"gpiod_chip_open", {EACCES, ENODEV, EMFILE, ENOENT}},
    {"gpiod_chip_get_line", {EINVAL, ENOMEM}},
    {"gpiod_line_request_bulk", {EBUSY, EINVAL, ENOMEM, EPERM}},
    {"gpiod_line_set_value_bulk", {EIO, ENODEV, EAGAIN}},
    {"gpiod_line_get_value_bulk", {EIO, ENODEV, EAGAIN}},
    {"gpiod_line_event_get_fd", {EPERM}},
    {"gpiod_line_event_read_multiple", {EIO, ENODEV, EAGAIN}},
    /* libgpiod 2.x */
    {"gpiod_chip_get_info", {ENOMEM, EIO}},
    {"gpiod_chip_get_line_info", {ENOMEM, EIO}},
    {"gpiod_line_settings_new", {ENOMEM}},
    {"gpiod_line_config_new", {ENOMEM}},
    {"gpiod_request_config_new", {ENOMEM}},
    {"gpiod_edge_event_buffer_new", {ENOMEM}},
    {"gpiod_line_settings_set_direction", {EINVAL}},
    {"gpiod_line_settings_set_edge_detection", {EINVAL}},
    {"gpiod_line_settings_set_bias", {EINVAL}},
    {"gpiod_line_settings_set_output_value", {EINVAL}},
    {"gpiod_line_config_add_line_settings", {ENOMEM}},
    {"gpiod_chip_request_lines", {EBUSY, EINVAL, ENOMEM, EPERM}},
    {"gpiod_line_request_set_values", {EIO, ENODEV, EAGAIN}},
    {"gpiod_line_request_get_values", {EIO, ENODEV, EAGAIN}},
    {"gpiod_line_request_read_edge_events", {EIO, ENODEV, EAGAIN}},
    {NULL, {0}},
};

/* --- The system --- */

played_gpio_t played_gpio;

static struct {
    bool is_wake[FDS_MAX]; /* open eventfds */
    unsigned folders;
    unsigned entry; /* of /dev, that comes next */
    bool has_joined;
    bool holds; /* workers sleep in their poll; atomic, as is_held */
    bool is_held;
    unsigned pauses; /* of workers that the system refuses to wait for; atomic */
} m;

DIR *__wrap_opendir(const char *path);
struct dirent *__wrap_readdir(DIR *folder);
int __wrap_closedir(DIR *folder);
int __real_eventfd(unsigned count, int flags);
int __wrap_eventfd(unsigned count, int flags);
int __real_close(int fd);
int __wrap_close(int fd);
int __real_poll(struct pollfd *fds, nfds_t count, int ms);
int __wrap_poll(struct pollfd *fds, nfds_t count, int ms);
int __wrap_nanosleep(const struct timespec *pause, struct timespec *left);
ssize_t __real_read(int fd, void *bytes, size_t size);
ssize_t __wrap_read(int fd, void *bytes, size_t size);
ssize_t __real_write(int fd, const void *bytes, size_t size);
ssize_t __wrap_write(int fd, const void *bytes, size_t size);
int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *), void *argument);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *), void *argument);
int __wrap_pthread_setschedparam(pthread_t thread, int policy, const struct sched_param *parameters);
int __real_pthread_timedjoin_np(pthread_t thread, void **result, const struct timespec *until);
int __wrap_pthread_timedjoin_np(pthread_t thread, void **result, const struct timespec *until);

static int folder; /* whose address is /dev */

DIR *__wrap_opendir(const char *path)
{
    FAILING("opendir", NULL);
    TEST_ASSERT_EQUAL_STRING("/dev", path);
    m.folders++;
    m.entry = 0;
    return (DIR *)&folder;
}

struct dirent *__wrap_readdir(DIR *self)
{
    static const char *const k_others[] = {"null", "gpiochip-of-a-name-that-is-too-long"};
    static struct dirent entry;
    FAILING("readdir", NULL);
    (void)self;
    const unsigned at = m.entry++;
    if (at < 2) {
        (void)snprintf(entry.d_name, sizeof entry.d_name, "%s", k_others[at]);
    } else if (at - 2 < played_gpio.chips) {
        (void)snprintf(entry.d_name, sizeof entry.d_name, "gpiochip%u", at - 2);
    } else {
        return NULL;
    }
    return &entry;
}

int __wrap_closedir(DIR *self)
{
    (void)self;
    m.folders--;
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

int __wrap_poll(struct pollfd *fds, nfds_t count, int ms)
{
    FAILING("poll", -1);
    while (__atomic_load_n(&m.holds, __ATOMIC_ACQUIRE)) {
        __atomic_store_n(&m.is_held, true, __ATOMIC_RELEASE);
        (void)__real_poll(NULL, 0, 1);
    }
    return __real_poll(fds, count, ms < POLL_MS ? ms : POLL_MS);
}

int __wrap_nanosleep(const struct timespec *pause, struct timespec *left)
{
    TEST_ASSERT_TRUE(pause->tv_sec == 0 && pause->tv_nsec >= 1000000);
    (void)__atomic_fetch_add(&m.pauses, 1, __ATOMIC_ACQ_REL);
    return clock_nanosleep(CLOCK_MONOTONIC, 0, pause, left);
}

ssize_t __wrap_read(int fd, void *bytes, size_t size)
{
    FAILING("read", -1);
    return __real_read(fd, bytes, size);
}

ssize_t __wrap_write(int fd, const void *bytes, size_t size)
{
    FAILING("write", -1);
    return __real_write(fd, bytes, size);
}

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*function)(void *), void *argument)
{
    FAILING_NUMBER("pthread_create");
    return __real_pthread_create(thread, attributes, function, argument);
}

int __wrap_pthread_setschedparam(pthread_t thread, int policy, const struct sched_param *parameters)
{
    FAILING_NUMBER("pthread_setschedparam");
    (void)thread;
    (void)policy;
    (void)parameters;
    return 0;
}

/* Where it does not fail, it waits for as long as it takes. */
int __wrap_pthread_timedjoin_np(pthread_t thread, void **result, const struct timespec *until)
{
    FAILING_NUMBER("pthread_timedjoin_np");
    (void)until;
    m.has_joined = pthread_join(thread, result) == 0;
    return 0;
}

/* --- The chips --- */

played_chip_t *played_chip_at(const char *path)
{
    unsigned number = PLAYED_CHIPS_MAX;
    if (sscanf(path, "/dev/gpiochip%u", &number) != 1 || number >= played_gpio.chips) {
        errno = ENOENT;
        return NULL;
    }
    played_chip_t *chip = &played_gpio.chip[number];
    errno = chip->refusal != 0 ? chip->refusal : chip->opens_left == 0 ? ENODEV : 0;
    chip->opens_left--;
    return errno == 0 ? chip : NULL;
}

int played_take_edges(unsigned pipe, unsigned *line, bool *rose, int most)
{
    uint8_t told[2];
    int count = 0;
    while (count < most && __real_read(played_gpio.edge[pipe][0], told, sizeof told) == (ssize_t)sizeof told) {
        line[count] = told[0];
        rose[count++] = told[1] != 0;
    }
    return count;
}

static void tell_edge(unsigned line, bool rose)
{
    const uint8_t told[] = {(uint8_t)line, rose};
    TEST_ASSERT_EQUAL_INT(2, (int)__real_write(played_gpio.edge[played_pipe_of(line)][1], told, sizeof told));
}

static void set_values(uint32_t values)
{
    __atomic_store_n(&played_gpio.chip[0].values, values, __ATOMIC_RELEASE);
}

static uint32_t values_now(void)
{
    return __atomic_load_n(&played_gpio.chip[0].values, __ATOMIC_ACQUIRE);
}

static void begin(void)
{
    const unsigned before = played_gpio.things;
    memset(&m, 0, sizeof m);
    TEST_ASSERT_EQUAL(0, before);
    played_gpio.chips = 2;
    played_gpio.chip[0] = (played_chip_t){.label = "desk", .line = {"DESK1", "DESK2", "DESK3", NULL}, .opens_left = -1};
    played_gpio.chip[1] =
        (played_chip_t){.label = "other", .line = {"OTHER1", NULL, "BOTH", NULL}, .consumer = "somebody else", .opens_left = -1};
}

static void assert_nothing_open(void)
{
    TEST_ASSERT_EQUAL_MESSAGE(0, played_gpio.things, failing_text());
    TEST_ASSERT_EQUAL_MESSAGE(0, m.folders, failing_text());
    for (int fd = 0; fd < FDS_MAX; fd++) {
        TEST_ASSERT_FALSE_MESSAGE(m.is_wake[fd], failing_text());
    }
}

void setUp(void)
{
    for (unsigned i = 0; i < PLAYED_LINES; i++) {
        TEST_ASSERT_EQUAL_INT(0, pipe2(played_gpio.edge[i], O_NONBLOCK | O_CLOEXEC));
    }
}

void tearDown(void)
{
    failing_end();
    for (unsigned i = 0; i < PLAYED_LINES; i++) {
        (void)__real_close(played_gpio.edge[i][0]);
        (void)__real_close(played_gpio.edge[i][1]);
    }
}

static void assert_told(const char *text)
{
    TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE("gpio: ", text, 6, failing_text());
}

static void pass(time_t limit)
{
    static const struct timespec k_pause = {.tv_nsec = 200000};
    TEST_ASSERT_TRUE_MESSAGE(time(NULL) < limit, failing_text());
    (void)clock_nanosleep(CLOCK_MONOTONIC, 0, &k_pause, NULL);
}

/* --- Relays --- */

static const linux_gpio_relays_config_t k_bank = {.names = {.count = 3, .line = {"DESK1", "DESK2", "DESK3"}}, .safe_mask = SAFE};
static linux_gpio_relays_t bank;
static hal_relays_t relays;

/* Until the mask stands, or, with an expectation of trouble, until that is told. */
static void await_mask(uint16_t mask, hv_status_t expected)
{
    const time_t limit = time(NULL) + LIMIT_S;
    hv_status_t status;
    uint16_t stands = 0xFFFF;
    do {
        pass(limit);
        (void)!hal_relays_write(relays, mask);
        status = hal_relays_read_back(relays, &stands);
    } while (status != expected || (status == HV_OK && stands != mask));
    TEST_ASSERT_MESSAGE(expected != HV_OK || values_now() == mask, failing_text());
}

static void await_failure(void)
{
    const time_t limit = time(NULL) + LIMIT_S;
    const unsigned gets = __atomic_load_n(&played_gpio.gets, __ATOMIC_ACQUIRE);
    while (failing_count() == 0 && __atomic_load_n(&played_gpio.gets, __ATOMIC_ACQUIRE) - gets < 3) {
        pass(limit);
    }
}

/* Whether the system goes on refusing to wait, then until that is stale. A worker waits before each look, and pauses for each
 * wait that was refused. */
static bool refuses_to_wait(void)
{
    static const struct timespec k_stale = {.tv_nsec = 300000000};
    const time_t limit = time(NULL) + LIMIT_S;
    const unsigned gets = __atomic_load_n(&played_gpio.gets, __ATOMIC_ACQUIRE);
    while (failing_is("poll") && __atomic_load_n(&played_gpio.gets, __ATOMIC_ACQUIRE) - gets < 3) {
        pass(limit);
    }
    const unsigned refused = failing_is("poll") ? failing_count() : 0;
    TEST_ASSERT_MESSAGE(__atomic_load_n(&m.pauses, __ATOMIC_ACQUIRE) + 1 >= refused, failing_text());
    if (refused > 1) {
        (void)clock_nanosleep(CLOCK_MONOTONIC, 0, &k_stale, NULL);
    }
    return refused > 1;
}

static bool concerns_values(void)
{
    return failing_is("gpiod_line_set_value_bulk") || failing_is("gpiod_line_get_value_bulk") ||
           failing_is("gpiod_line_request_set_values") || failing_is("gpiod_line_request_get_values");
}

static void open_bank(void)
{
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_gpio_relays_open(&bank, &k_bank), bank.error_text);
    TEST_ASSERT_EQUAL_HEX32(SAFE, values_now());
    relays = linux_gpio_relays_hal(&bank);
}

static void close_bank(void)
{
    TEST_ASSERT_TRUE_MESSAGE(linux_gpio_relays_close(&bank, SAFE), failing_text());
    TEST_ASSERT_EQUAL_HEX32_MESSAGE(SAFE, values_now(), failing_text());
    assert_nothing_open();
}

static void try_relays_open(void)
{
    begin();
    failing_begin();
    const hv_status_t status = linux_gpio_relays_open(&bank, &k_bank);
    failing_end();
    TEST_ASSERT_MESSAGE(status == HV_OK || (status == HV_ERR_IO && failing_count() > 0), failing_text());
    if (status != HV_OK) {
        assert_told(bank.error_text);
        TEST_ASSERT_NULL_MESSAGE(strstr(bank.error_text, "has no GPIO chip"), failing_text()); /* nobody has seen that */
        assert_nothing_open();
        open_bank();
    }
    relays = linux_gpio_relays_hal(&bank);
    await_mask(5, HV_OK);
    close_bank();
}

static void try_relays_running(void)
{
    begin();
    open_bank();
    failing_begin();
    (void)!hal_relays_write(relays, 6);
    await_failure();
    if (concerns_values() && failing_count() > 1) { /* for ever */
        await_mask(6, HV_ERR_IO);
    } else if (refuses_to_wait()) {
        await_mask(5, HV_OK);
    }
    failing_end();
    await_mask(6, HV_OK);
    await_mask(3, HV_OK);
    close_bank();
}

/* Nobody asks for another mask: the lines are looked at all the same, and set again after a failure. */
static void try_relays_resting(void)
{
    uint16_t stands;
    begin();
    open_bank();
    await_mask(6, HV_OK);
    failing_begin();
    await_failure();
    if (concerns_values() && failing_count() > 1) {
        await_mask(6, HV_ERR_IO);
        TEST_ASSERT_EQUAL(HV_ERR_IO, hal_relays_read_back(relays, &stands));
        set_values(0); /* the chip was away, and came back as new */
    }
    failing_end();
    await_mask(6, HV_OK);
    close_bank();
}

/* The worker cannot be waited for: what it uses is not given back. */
static void end_what_hangs(pthread_t thread, int wake, linux_gpio_chip_t *chip)
{
    TEST_ASSERT_MESSAGE(failing_is("pthread_timedjoin_np"), failing_text());
    TEST_ASSERT_TRUE(played_gpio.things > 0 && m.is_wake[wake] && !m.has_joined);
    TEST_ASSERT_EQUAL_INT(0, pthread_join(thread, NULL));
    linux_gpio_chip_close(chip);
    (void)close(wake);
}

static void try_relays_close(void)
{
    begin();
    open_bank();
    await_mask(6, HV_OK);
    failing_begin();
    const bool has_ended = linux_gpio_relays_close(&bank, SAFE);
    failing_end();
    if (!has_ended) {
        end_what_hangs(bank.thread, bank.wake, &bank.chip);
    }
    TEST_ASSERT_MESSAGE(values_now() == SAFE || concerns_values(), failing_text());
    assert_nothing_open();
    TEST_ASSERT_TRUE(linux_gpio_relays_close(&bank, SAFE));
}

/* --- Switches: line 0 is the e-stop's, which opens --- */

static const linux_gpio_inputs_config_t k_desk = {.names = {.count = 3, .line = {"DESK1", "DESK2", "DESK3"}},
                                                  .input = {INPUT_ESTOP, INPUT_ENABLE, INPUT_RESET},
                                                  .is_active_low = true};
static linux_gpio_inputs_t desk;
static hal_inputs_t inputs;

static void await_levels(uint32_t expected)
{
    const time_t limit = time(NULL) + LIMIT_S;
    hv_status_t status;
    uint32_t levels;
    do {
        pass(limit);
        levels = 0xDEAD;
        status = hal_inputs_read(inputs, &levels);
        TEST_ASSERT_MESSAGE(status == HV_OK || (status == HV_ERR_IO && levels == 0xDEAD), failing_text());
    } while (status != HV_OK || levels != expected);
}

static void await_loss(void)
{
    const time_t limit = time(NULL) + LIMIT_S;
    uint32_t levels;
    while (hal_inputs_read(inputs, &levels) != HV_ERR_IO) {
        pass(limit);
    }
}

static void open_desk(void)
{
    set_values(INPUT_ESTOP);
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_gpio_inputs_open(&desk, &k_desk), desk.error_text);
    inputs = linux_gpio_inputs_hal(&desk);
    await_levels(0);
}

static void close_desk(void)
{
    TEST_ASSERT_TRUE_MESSAGE(linux_gpio_inputs_close(&desk), failing_text());
    assert_nothing_open();
}

static void assert_switches_work(void)
{
    set_values(INPUT_ENABLE);
    await_levels(INPUT_ENABLE | INPUT_ESTOP);
    set_values(INPUT_ESTOP | INPUT_RESET);
    await_levels(INPUT_RESET);
}

static void try_inputs_open(void)
{
    begin();
    set_values(INPUT_ESTOP);
    failing_begin();
    const hv_status_t status = linux_gpio_inputs_open(&desk, &k_desk);
    failing_end();
    TEST_ASSERT_MESSAGE(status == HV_OK || (status == HV_ERR_IO && failing_count() > 0), failing_text());
    if (status != HV_OK) {
        assert_told(desk.error_text);
        assert_nothing_open();
        open_desk();
    }
    inputs = linux_gpio_inputs_hal(&desk);
    assert_switches_work();
    close_desk();
}

/* A chip without interrupts: opened without edges, after a second request. */
static void try_inputs_without_edges(void)
{
    begin();
    played_gpio.chip[0].has_no_edges = true;
    set_values(INPUT_ESTOP);
    failing_begin();
    const hv_status_t status = linux_gpio_inputs_open(&desk, &k_desk);
    failing_end();
    TEST_ASSERT_MESSAGE(status == HV_OK || (status == HV_ERR_IO && failing_count() > 0), failing_text());
    if (status != HV_OK) {
        assert_told(desk.error_text);
        assert_nothing_open();
        return;
    }
    inputs = linux_gpio_inputs_hal(&desk);
    TEST_ASSERT_FALSE(desk.has_edges);
    assert_switches_work();
    close_desk();
}

/* Whatever fails but reading the lines themselves, or listening for edges that there are, switches are seen. */
static void run_inputs(bool has_edges)
{
    begin();
    played_gpio.chip[0].has_no_edges = !has_edges;
    open_desk();
    failing_begin();
    tell_edge(0, false);
    tell_edge(1, true);
    await_failure();
    if (concerns_values() ? failing_count() > 1 : refuses_to_wait() && has_edges) { /* for ever */
        await_loss();
    } else if (!concerns_values()) {
        assert_switches_work();
    }
    failing_end();
    assert_switches_work();
    close_desk();
}

static void try_inputs_running(void)
{
    run_inputs(true);
}

static void try_inputs_running_without_edges(void)
{
    run_inputs(false);
}

static void try_inputs_close(void)
{
    begin();
    open_desk();
    failing_begin();
    const bool has_ended = linux_gpio_inputs_close(&desk);
    failing_end();
    if (!has_ended) {
        end_what_hangs(desk.thread, desk.wake, &desk.chip);
    }
    assert_nothing_open();
    TEST_ASSERT_TRUE(linux_gpio_inputs_close(&desk));
}

static unsigned failures;

static void test_relays(void)
{
    failures += failing_sweep(k_errors, try_relays_open);
    failures += failing_sweep(k_errors, try_relays_running);
    failures += failing_sweep(k_errors, try_relays_resting);
    failures += failing_sweep(k_errors, try_relays_close);
}

static void test_inputs(void)
{
    failures += failing_sweep(k_errors, try_inputs_open);
    failures += failing_sweep(k_errors, try_inputs_without_edges);
    failures += failing_sweep(k_errors, try_inputs_running);
    failures += failing_sweep(k_errors, try_inputs_running_without_edges);
    failures += failing_sweep(k_errors, try_inputs_close);
}

/* --- Lines by name --- */

static void assert_found(const linux_gpio_names_t *names, hv_status_t expected, const char *said)
{
    linux_gpio_place_t place;
    char text[LINUX_GPIO_TEXT_SIZE];
    TEST_ASSERT_EQUAL_MESSAGE(expected, linux_gpio_find(names, &place, text), text);
    TEST_ASSERT_EQUAL_STRING(said, text);
    assert_nothing_open();
}

static void test_find_by_name_number_and_label(void)
{
    linux_gpio_place_t place;
    char text[LINUX_GPIO_TEXT_SIZE];
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_find(&(linux_gpio_names_t){NULL, 1, {"OTHER1"}}, &place, text));
    TEST_ASSERT_EQUAL_STRING("/dev/gpiochip1", place.path);
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_find(&(linux_gpio_names_t){"desk", 2, {"3", "DESK1"}}, &place, text));
    TEST_ASSERT_EQUAL_STRING("desk", place.label);
    TEST_ASSERT_TRUE(place.offset[0] == 3 && place.offset[1] == 0);
    played_gpio.chip[1].line[0] = "3"; /* a name of digits is not its number */
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_find(&(linux_gpio_names_t){"other", 1, {"3"}}, &place, text));
    TEST_ASSERT_EQUAL(3, place.offset[0]);
    assert_nothing_open();
}

static void test_find_says_what_is_wrong(void)
{
    begin();
    assert_found(&(linux_gpio_names_t){"", 1, {"3"}}, HV_ERR_RANGE, "gpio: 3 alone is no line: it takes the label of its chip");
    assert_found(&(linux_gpio_names_t){NULL, 2, {"DESK1", "DESK9"}}, HV_ERR_RANGE,
                 "gpio: no chip has a line DESK9 (gpioinfo lists what there is)");
    assert_found(&(linux_gpio_names_t){NULL, 1, {""}}, HV_ERR_RANGE, "gpio: no chip has a line  (gpioinfo lists what there is)");
    assert_found(&(linux_gpio_names_t){"desk", 1, {"4"}}, HV_ERR_RANGE,
                 "gpio: chip desk has no line 4 (gpioinfo lists what there is)");
    assert_found(&(linux_gpio_names_t){NULL, 2, {"DESK1", "OTHER1"}}, HV_ERR_RANGE,
                 "gpio: the lines are not all on one chip, as they have to be");
    assert_found(&(linux_gpio_names_t){"dsek", 1, {"DESK1"}}, HV_ERR_RANGE,
                 "gpio: no chip has the label dsek; there are: desk, other");
    played_gpio.chip[0].line[3] = "BOTH";
    assert_found(&(linux_gpio_names_t){NULL, 1, {"BOTH"}}, HV_ERR_RANGE,
                 "gpio: 2 chips have these lines: say which one by its label");
    played_gpio.chip[1].label = "desk";
    assert_found(&(linux_gpio_names_t){"desk", 1, {"BOTH"}}, HV_ERR_RANGE,
                 "gpio: 2 chips have the label desk and these lines: name lines that only one has");
    played_gpio.chips = 0;
    assert_found(&(linux_gpio_names_t){NULL, 1, {"DESK1"}}, HV_ERR_NOSUP, "gpio: this machine has no GPIO chip (/dev/gpiochip*)");
}

/* Chips that are there and cannot be opened: all, or the one that has the lines. */
static void test_find_says_what_could_not_be_looked_at(void)
{
    begin();
    played_gpio.chip[0].refusal = EPERM;
    assert_found(&(linux_gpio_names_t){NULL, 1, {"DESK1"}}, HV_ERR_RANGE,
                 "gpio: no chip has a line DESK1 (gpioinfo lists what there is); not every chip could be looked at: Operation "
                 "not permitted");
    assert_found(&(linux_gpio_names_t){NULL, 1, {"OTHER1"}}, HV_OK, "");
    played_gpio.chip[1].refusal = EPERM;
    assert_found(&(linux_gpio_names_t){NULL, 1, {"DESK1"}}, HV_ERR_NOSUP,
                 "gpio: not allowed to open /dev/gpiochip*: this user has to be in their group (see docs/gpio.md)");
}

static void test_lines_in_use_are_named(void)
{
    static const linux_gpio_relays_config_t k_other = {.names = {NULL, 2, {"OTHER1", "BOTH"}}};
    begin();
    played_gpio.chip[1].is_used[2] = true;
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_gpio_relays_open(&bank, &k_other));
    TEST_ASSERT_EQUAL_STRING("gpio: line BOTH of chip other is in use by \"somebody else\"", bank.error_text);
    played_gpio.chip[1].consumer = NULL;
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_gpio_relays_open(&bank, &k_other));
    TEST_ASSERT_EQUAL_STRING("gpio: line BOTH of chip other is in use by somebody", bank.error_text);
    assert_nothing_open();
}

/* It has gone between looking and requesting. */
static void test_chip_that_goes_after_it_was_found(void)
{
    begin();
    played_gpio.chip[0].opens_left = 1;
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_gpio_relays_open(&bank, &k_bank));
    TEST_ASSERT_EQUAL_STRING("gpio: /dev/gpiochip0 cannot be opened: No such device", bank.error_text);
    assert_nothing_open();
}

static void test_none_at_all_opens_nothing(void)
{
    uint32_t levels = 7;
    uint16_t mask = 7;
    begin();
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_relays_open(&bank, &(linux_gpio_relays_config_t){.safe_mask = 0}));
    relays = linux_gpio_relays_hal(&bank);
    TEST_ASSERT_EQUAL(0, hal_relays_count(relays));
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(relays, 0));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, hal_relays_write(relays, 1));
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_read_back(relays, &mask));
    TEST_ASSERT_EQUAL_HEX16(0, mask);
    TEST_ASSERT_TRUE(linux_gpio_relays_close(&bank, 0));
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_inputs_open(&desk, &(linux_gpio_inputs_config_t){.is_active_low = true}));
    inputs = linux_gpio_inputs_hal(&desk);
    TEST_ASSERT_EQUAL(HV_OK, hal_inputs_read(inputs, &levels));
    TEST_ASSERT_EQUAL_HEX32(0, levels);
    TEST_ASSERT_EQUAL_HEX32(0, hal_inputs_present(inputs));
    TEST_ASSERT_TRUE(linux_gpio_inputs_close(&desk));
    assert_nothing_open();
}

static void hold(void)
{
    const time_t limit = time(NULL) + LIMIT_S;
    __atomic_store_n(&m.holds, true, __ATOMIC_RELEASE);
    while (!__atomic_load_n(&m.is_held, __ATOMIC_ACQUIRE)) {
        pass(limit);
    }
}

static void release(void)
{
    __atomic_store_n(&m.holds, false, __ATOMIC_RELEASE);
}

/* The worker hangs in the kernel for longer than a chip may take: both sides say so, and no longer when it goes on. */
static void test_chip_that_hangs_is_told_of(void)
{
    begin();
    open_bank();
    await_mask(2, HV_OK);
    hold();
    await_mask(4, HV_ERR_IO);
    release();
    await_mask(4, HV_OK);
    close_bank();
    begin();
    open_desk();
    hold();
    await_loss();
    release();
    assert_switches_work();
    close_desk();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_relays);
    RUN_TEST(test_inputs);
    RUN_TEST(test_find_by_name_number_and_label);
    RUN_TEST(test_find_says_what_is_wrong);
    RUN_TEST(test_find_says_what_could_not_be_looked_at);
    RUN_TEST(test_lines_in_use_are_named);
    RUN_TEST(test_chip_that_goes_after_it_was_found);
    RUN_TEST(test_none_at_all_opens_nothing);
    RUN_TEST(test_chip_that_hangs_is_told_of);
    printf("# figure %u failures of system calls injected\n", failures);
    return UNITY_END();
}
