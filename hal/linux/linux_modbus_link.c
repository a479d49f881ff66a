/* SPDX-License-Identifier: MIT
 * linux_modbus_link.c - a Modbus connection by libmodbus; see linux_modbus_link.h.
 */
#include "linux_modbus_link.h"
#include "linux_modbus_request.h"

#include <errno.h>
#include <modbus.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define RETRY_FIRST_US  100000u
#define RETRY_LAST_US   1000000u
#define CLEAR_LIMIT_US  100000u /* a line that never falls silent is spoken on all the same: the answers then tell */
#define FAST_BPS        19200u  /* above, the silence between frames is not 3.5 characters any more */
#define FAST_SILENCE_US 1750u
#define QUESTION_HEAD   9u /* characters of the longest question without its values, and of an answer likewise */
#define ANSWER_HEAD     8u
#define SERIAL_BITS     8

/* --- Time --- */

static uint64_t to_us(struct timespec time)
{
    return (uint64_t)time.tv_sec * 1000000u + (uint64_t)time.tv_nsec / 1000u;
}

static struct timespec from_us(uint64_t us)
{
    return (struct timespec){(time_t)(us / 1000000u), (long)(us % 1000000u) * 1000L};
}

uint64_t linux_modbus_now_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return to_us(now);
}

static void sleep_until_us(uint64_t until_us)
{
    const struct timespec until = from_us(until_us);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {}
}

static uint64_t characters_us(const linux_modbus_link_t *self, size_t characters)
{
    return (characters * (uint64_t)self->character_ns + 999u) / 1000u;
}

/* --- The link comes and goes --- */

static linux_modbus_trouble_t trouble_of_serial(int error)
{
    switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
    case EIO:
        return LINUX_MODBUS_NO_DEVICE;
    case ENOTTY:
    case EISDIR:
    case EINVAL:
        return LINUX_MODBUS_NOT_SERIAL;
    case EBUSY:
        return LINUX_MODBUS_IN_USE;
    case EACCES:
    case EPERM:
        return LINUX_MODBUS_NOT_ALLOWED;
    default:
        return LINUX_MODBUS_SYSTEM_ERROR;
    }
}

static linux_modbus_trouble_t trouble_of_tcp(int error)
{
    switch (error) {
    case ECONNREFUSED:
        return LINUX_MODBUS_REFUSED;
    case EINPROGRESS:
    case ETIMEDOUT:
    case EHOSTUNREACH:
    case ENETUNREACH:
        return LINUX_MODBUS_UNREACHABLE;
    case EACCES:
    case EPERM:
        return LINUX_MODBUS_NOT_ALLOWED;
    default:
        return LINUX_MODBUS_SYSTEM_ERROR;
    }
}

static void set_trouble(linux_modbus_link_t *self, linux_modbus_trouble_t trouble, int error)
{
    __atomic_store_n(&self->error, error, __ATOMIC_RELAXED);
    __atomic_store_n(&self->trouble, trouble, __ATOMIC_RELEASE);
}

static void add(uint32_t *count, uint32_t more) /* NOLINT(readability-non-const-parameter): it is written to */
{
    (void)__atomic_fetch_add(count, more, __ATOMIC_RELAXED);
}

static void back_off(linux_modbus_link_t *self)
{
    const uint32_t twice_us = self->retry_pause_us * 2;
    self->retry_pause_us = twice_us < RETRY_FIRST_US ? RETRY_FIRST_US : twice_us < RETRY_LAST_US ? twice_us : RETRY_LAST_US;
    self->retry_us = linux_modbus_now_us() + self->retry_pause_us;
}

static void close_link(linux_modbus_link_t *self)
{
    const int fd = modbus_get_socket(self->modbus);
    if (self->is_serial && fd >= 0) {
        (void)tcflush(fd, TCIOFLUSH); /* close would wait for output that an unplugged or blocked line never takes */
    }
    modbus_close(self->modbus);
    self->is_linked = false;
}

/* A link that had worked is made again at once; one that breaks whenever it is made, after a pause. */
static void give_up(linux_modbus_link_t *self, int error)
{
    close_link(self);
    set_trouble(self, LINUX_MODBUS_LOST, error);
    self->retry_us = linux_modbus_now_us();
    if (!self->has_worked) {
        back_off(self);
    }
}

/* After an answer that is late or unfit nothing that this connection still brings can be trusted, and libmodbus would fail for
 * ever. The host is there, so there is no pause. */
static void start_over(linux_modbus_link_t *self, int error)
{
    close_link(self);
    set_trouble(self, LINUX_MODBUS_LOST, error);
    self->retry_us = linux_modbus_now_us();
}

static bool set_direction(linux_modbus_link_t *self)
{
    switch (self->direction) {
    case LINUX_MODBUS_AUTOMATIC:
        return true;
    case LINUX_MODBUS_KERNEL:
        return modbus_rtu_set_serial_mode(self->modbus, MODBUS_RTU_RS485) == 0;
    case LINUX_MODBUS_RTS_HIGH:
        return modbus_rtu_set_rts(self->modbus, MODBUS_RTU_RTS_UP) == 0;
    case LINUX_MODBUS_RTS_LOW:
        return modbus_rtu_set_rts(self->modbus, MODBUS_RTU_RTS_DOWN) == 0;
    }
    return false;
}

/* What a fresh link needs. Closing a TCP connection drops what the system has not delivered: an old set-point must not arrive
 * when a cable is plugged in again. */
static bool set_up(linux_modbus_link_t *self)
{
    static const struct linger k_reset = {.l_onoff = 1, .l_linger = 0};
    const int fd = modbus_get_socket(self->modbus);
    if (!self->is_serial) {
        return setsockopt(fd, SOL_SOCKET, SO_LINGER, &k_reset, sizeof k_reset) == 0;
    }
    (void)tcflush(fd, TCIOFLUSH);
    return ioctl(fd, TIOCEXCL) == 0 && set_direction(self);
}

static void set_timeout(linux_modbus_link_t *self, uint64_t us)
{
    (void)modbus_set_response_timeout(self->modbus, (uint32_t)(us / 1000000u), (uint32_t)(us % 1000000u));
}

static void fail_to_link(linux_modbus_link_t *self, linux_modbus_trouble_t trouble, int error)
{
    set_trouble(self, trouble, error);
    back_off(self);
}

void linux_modbus_link_mend(linux_modbus_link_t *self)
{
    if (self->is_linked || linux_modbus_now_us() < self->retry_us) {
        return;
    }
    set_timeout(self, self->timeout_us);
    if (modbus_connect(self->modbus) != 0) {
        const int error = errno;
        fail_to_link(self, self->is_serial ? trouble_of_serial(error) : trouble_of_tcp(error), error);
        return;
    }
    if (!set_up(self)) {
        const int error = errno;
        close_link(self);
        fail_to_link(self, self->direction == LINUX_MODBUS_KERNEL ? LINUX_MODBUS_NO_RS485 : LINUX_MODBUS_SYSTEM_ERROR, error);
        return;
    }
    self->is_linked = true;
    self->has_worked = false;
    self->silent_until_us = linux_modbus_now_us() + self->silence_us;
    add(&self->count.links, 1);
    set_trouble(self, LINUX_MODBUS_FINE, 0);
}

/* --- Silence --- */

/* Takes what came in unasked; false where the link is gone. On TCP nothing may: it would be taken for the next answer. */
static bool read_strays(linux_modbus_link_t *self)
{
    uint8_t bytes[LINUX_MODBUS_FRAME_MAX];
    const ssize_t got = read(modbus_get_socket(self->modbus), bytes, sizeof bytes);
    if (got > 0) {
        add(&self->count.strays, (uint32_t)got);
        if (!self->is_serial) {
            start_over(self, EBADMSG);
        }
        return self->is_linked;
    }
    give_up(self, got < 0 ? errno : ECONNRESET);
    return false;
}

/* Until the line has been silent for as long as a frame needs before it; false where the link is gone. */
static bool make_quiet(linux_modbus_link_t *self)
{
    struct pollfd line = {.fd = modbus_get_socket(self->modbus), .events = POLLIN};
    const uint64_t limit_us = linux_modbus_now_us() + CLEAR_LIMIT_US;
    for (;;) {
        const uint64_t now_us = linux_modbus_now_us();
        const struct timespec wait = from_us(self->silent_until_us > now_us ? self->silent_until_us - now_us : 0);
        if (ppoll(&line, 1, &wait, NULL) <= 0 || now_us >= limit_us) {
            return true;
        }
        if (!read_strays(self)) {
            return false;
        }
        self->silent_until_us = linux_modbus_now_us() + self->silence_us;
    }
}

void linux_modbus_link_look(linux_modbus_link_t *self)
{
    if (self->is_linked) {
        (void)make_quiet(self);
    }
}

/* --- Asking --- */

/* Characters of question and answer together, at most. */
static size_t characters_of(const modbus_request_t *request)
{
    return QUESTION_HEAD + ANSWER_HEAD + 2u * request->count;
}

static hv_status_t judge_silence(linux_modbus_link_t *self, int error)
{
    add(&self->count.timeouts, 1);
    if (self->is_serial) {
        (void)tcflush(modbus_get_socket(self->modbus), TCOFLUSH); /* a question that has not left must not leave later */
    } else {
        start_over(self, error);
    }
    return HV_ERR_TIMEOUT;
}

static hv_status_t judge_damage(linux_modbus_link_t *self, int error)
{
    add(&self->count.damaged, 1);
    if (!self->is_serial) {
        start_over(self, error);
    }
    return HV_ERR_FORMAT;
}

/* What a failed question means. */
static hv_status_t judge(linux_modbus_link_t *self, int error, uint8_t *exception)
{
    if (error > MODBUS_ENOBASE && error < MODBUS_ENOBASE + MODBUS_EXCEPTION_MAX) {
        *exception = (uint8_t)(error - MODBUS_ENOBASE);
        add(&self->count.exceptions, 1);
        return HV_ERR_STATE;
    }
    if (error >= MODBUS_ENOBASE) {
        return judge_damage(self, error);
    }
    if (error == ETIMEDOUT || error == EAGAIN) {
        return judge_silence(self, error);
    }
    give_up(self, error);
    return HV_ERR_IO;
}

static bool is_answer(hv_status_t status)
{
    return status == HV_OK || status == HV_ERR_STATE;
}

/* Quiet, and still a link: one that the host has closed while idle is made again at once. */
static bool make_ready(linux_modbus_link_t *self)
{
    if (!make_quiet(self)) {
        linux_modbus_link_mend(self);
    }
    return self->is_linked;
}

static void note_traffic(linux_modbus_link_t *self)
{
    add(&self->count.transactions, 1);
    self->silent_until_us = linux_modbus_now_us() + self->silence_us;
}

static hv_status_t converse(linux_modbus_link_t *self, const modbus_request_t *request, modbus_result_t *result)
{
    if (!make_ready(self)) {
        return HV_ERR_IO;
    }
    set_timeout(self, self->timeout_us + characters_us(self, characters_of(request)));
    (void)modbus_set_slave(self->modbus, request->unit);
    const int error = linux_modbus_request_ask(self->modbus, request, result->value);
    const hv_status_t status = error != 0 ? judge(self, error, &result->exception) : HV_OK;
    note_traffic(self);
    if (is_answer(status)) {
        self->has_worked = true;
        self->retry_pause_us = 0;
    }
    return status;
}

/* --- Serial lines: what can be trusted --- */

static hv_status_t converse_noting(linux_modbus_link_t *self, const modbus_request_t *request, modbus_result_t *result)
{
    const hv_status_t status = converse(self, request, result);
    if (is_answer(status)) {
        linux_modbus_note_answer(&self->doubt, request->unit);
    } else {
        linux_modbus_note_silence(&self->doubt, request->unit, request->function, linux_modbus_now_us());
    }
    return status;
}

/* Asks something whose answer can be no earlier one's. */
static bool clear_doubt(linux_modbus_link_t *self, const modbus_request_t *request)
{
    modbus_result_t result;
    modbus_request_t probe = {.unit = request->unit, .address = request->address, .count = 1};
    if (!linux_modbus_find_probe(&self->doubt, request->unit, linux_modbus_now_us(), &probe.function)) {
        return false;
    }
    add(&self->count.probes, 1);
    return is_answer(converse_noting(self, &probe, &result));
}

/* What is written has to leave whatever the answer is worth: it may be a stop. What is read is of no use without. */
static hv_status_t converse_doubtfully(linux_modbus_link_t *self, const modbus_request_t *request, modbus_result_t *result)
{
    if (!modbus_is_write(request->function)) {
        return clear_doubt(self, request) ? converse_noting(self, request, result) : HV_ERR_TIMEOUT;
    }
    const hv_status_t status = converse(self, request, result);
    linux_modbus_note_silence(&self->doubt, request->unit, request->function, linux_modbus_now_us());
    if (!is_answer(status)) {
        return status;
    }
    result->exception = 0;
    (void)clear_doubt(self, request);
    return HV_ERR_TIMEOUT;
}

/* --- Broadcasts, which libmodbus would wait an answer for --- */

static hv_status_t broadcast(linux_modbus_link_t *self, const modbus_request_t *request)
{
    uint8_t frame[LINUX_MODBUS_FRAME_MAX];
    if (!make_ready(self)) {
        return HV_ERR_IO;
    }
    const size_t length = linux_modbus_request_pack(frame, request);
    if (modbus_send_raw_request(self->modbus, frame, (int)length) < 0) {
        uint8_t exception;
        return judge(self, errno, &exception);
    }
    sleep_until_us(linux_modbus_now_us() + characters_us(self, length + 2) + self->broadcast_pause_us);
    if (!self->is_serial) {
        (void)modbus_flush(self->modbus); /* some hosts answer unit 0 all the same */
    }
    note_traffic(self);
    return HV_OK;
}

static hv_status_t run(linux_modbus_link_t *self, const modbus_request_t *request, modbus_result_t *result)
{
    if (!self->is_linked) {
        return HV_ERR_IO;
    }
    if (request->unit == HAL_MODBUS_BROADCAST) {
        return broadcast(self, request);
    }
    if (!self->is_serial) {
        return converse(self, request, result);
    }
    return linux_modbus_is_doubtful(&self->doubt, request->unit, request->function, linux_modbus_now_us())
               ? converse_doubtfully(self, request, result)
               : converse_noting(self, request, result);
}

void linux_modbus_link_run(linux_modbus_link_t *self, const modbus_request_t *request, modbus_result_t *result)
{
    memset(result, 0, sizeof *result);
    result->status = run(self, request, result);
    if (result->status == HV_OK && modbus_is_write(request->function)) {
        memcpy(result->value, request->value, sizeof result->value);
    } else if (result->status == HV_OK) {
        result->count = request->count;
    } else {
        memset(result->value, 0, sizeof result->value);
    }
    result->done_us = linux_modbus_now_us();
}

int linux_modbus_link_fd(const linux_modbus_link_t *self)
{
    return self->is_linked ? modbus_get_socket(self->modbus) : -1;
}

/* --- Opening --- */

static void describe_serial(linux_modbus_link_t *self, const linux_modbus_config_t *config)
{
    const uint32_t bits = 1u + SERIAL_BITS + (config->parity == 'N' ? 0u : 1u) + config->stop_bits;
    self->character_ns = (uint32_t)((bits * (uint64_t)1000000000u + config->baud_bps - 1) / config->baud_bps);
    self->silence_us = config->baud_bps > FAST_BPS ? FAST_SILENCE_US : (uint32_t)(characters_us(self, 7) / 2);
}

hv_status_t linux_modbus_link_open(linux_modbus_link_t *self, const linux_modbus_config_t *config, const char **what)
{
    memset(self, 0, sizeof *self);
    *what = linux_modbus_config_find_wrong(config);
    if (*what != NULL) {
        return HV_ERR_ARG;
    }
    self->is_serial = config->host == NULL;
    self->direction = config->direction;
    self->timeout_us = config->timeout_us;
    self->broadcast_pause_us = config->broadcast_pause_us;
    self->trouble = LINUX_MODBUS_NOT_TRIED;
    if (self->is_serial) {
        describe_serial(self, config);
        self->modbus = modbus_new_rtu(config->device, (int)config->baud_bps, config->parity, SERIAL_BITS, config->stop_bits);
    } else {
        self->modbus = modbus_new_tcp(config->host, config->port);
    }
    if (self->modbus == NULL) {
        *what = "no memory";
        return HV_ERR_IO;
    }
    (void)modbus_set_byte_timeout(self->modbus, 0, 0); /* the timeout is for the whole answer */
    if (self->is_serial) {
        (void)modbus_rtu_set_rts_delay(self->modbus, (int)config->direction_delay_us);
    }
    return HV_OK;
}

void linux_modbus_link_close(linux_modbus_link_t *self)
{
    if (self->modbus != NULL) {
        close_link(self);
        modbus_free(self->modbus);
        self->modbus = NULL;
    }
}
