/* SPDX-License-Identifier: MIT
 * linux_modbus_link.h - a Modbus connection by libmodbus, TCP or serial, with what libmodbus leaves to its user: silence between
 * frames, a line cleared of what nobody asked for, answers that come too late, links that break and come back.
 * Every call may wait, up to the timeout and the time the line takes; for the worker thread only. Nothing is allocated after
 * open.
 */
#ifndef LINUX_MODBUS_LINK_H
#define LINUX_MODBUS_LINK_H

#include "heave/hal/modbus.h"
#include "linux_modbus_doubt.h"

/** Longest path of a serial device, or address, with its end. */
#define LINUX_MODBUS_NAME_SIZE 128u

/** Who turns an RS-485 line around between sending and listening. */
typedef enum {
    LINUX_MODBUS_AUTOMATIC, /**< the adapter itself, as nearly every USB adapter does; also RS-232 */
    LINUX_MODBUS_KERNEL,    /**< the serial driver (TIOCSRS485), as on boards with an RS-485 port of their own */
    LINUX_MODBUS_RTS_HIGH,  /**< this program by RTS, high while sending */
    LINUX_MODBUS_RTS_LOW    /**< likewise, low while sending */
} linux_modbus_direction_t;

/** A line. The texts are copied. */
typedef struct {
    const char *host;   /**< TCP: IPv4 address in numbers; NULL = serial */
    uint16_t port;      /**< TCP: [1, 65535], usually 502 */
    const char *device; /**< serial: its path; one below /dev/serial/by-id stays the same whatever is plugged in first */
    uint32_t baud_bps;  /**< serial: a rate that Linux has, 1200 to 4000000 */
    char parity;        /**< serial: 'N', 'E' or 'O' */
    uint8_t stop_bits;  /**< serial: 1 or 2 */
    linux_modbus_direction_t direction; /**< serial */
    uint32_t direction_delay_us;        /**< serial: between RTS and the first bit, and the last bit and RTS; [0, 10000] */
    uint32_t timeout_us; /**< for an answer, and for a connection; [1000, 10000000], usually 20000 to 50000. On a serial line it
                            begins when the question is out and ends with the longest answer's own time added */
    uint32_t broadcast_pause_us; /**< after a broadcast, for the devices to act; [0, 999999] */
} linux_modbus_config_t;

/** What is wrong, as far as it can be told apart. */
typedef enum {
    LINUX_MODBUS_FINE,
    LINUX_MODBUS_NOT_TRIED,  /**< just opened */
    LINUX_MODBUS_NO_DEVICE,  /**< no serial device of that name: unplugged */
    LINUX_MODBUS_NOT_SERIAL, /**< the name is of something else */
    LINUX_MODBUS_NO_RS485,   /**< its driver cannot turn the line around */
    LINUX_MODBUS_NOT_ALLOWED,
    LINUX_MODBUS_IN_USE,      /**< another program has the serial device */
    LINUX_MODBUS_REFUSED,     /**< the host is there, but nothing listens at that port, or it has no connection left */
    LINUX_MODBUS_UNREACHABLE, /**< no answer from the host, or no way to it */
    LINUX_MODBUS_LOST,        /**< the link was there and broke */
    LINUX_MODBUS_SYSTEM_ERROR
} linux_modbus_trouble_t;

/** Counts since open. */
typedef struct {
    uint32_t transactions; /**< tried, broadcasts too; without those that found no link */
    uint32_t timeouts;
    uint32_t damaged; /**< answers with errors, or not to the question */
    uint32_t exceptions;
    uint32_t links;  /**< times a link was made */
    uint32_t strays; /**< bytes that nobody had asked for */
    uint32_t probes; /**< questions only to see that no late answer is to come */
} linux_modbus_counts_t;

/** A link; trouble, error and count may be read, the rest is private. */
typedef struct {
    linux_modbus_trouble_t trouble;
    int error; /**< errno of the trouble, 0 = none */
    linux_modbus_counts_t count;

    void *modbus; /**< libmodbus' own */
    bool is_serial;
    bool is_linked;
    bool has_worked; /**< something was answered since the link was made */
    linux_modbus_direction_t direction;
    uint32_t timeout_us;
    uint32_t broadcast_pause_us;
    uint32_t character_ns;
    uint32_t silence_us;
    uint64_t silent_until_us; /**< the next frame may leave then */
    uint64_t retry_us;        /**< the next try to make the link */
    uint32_t retry_pause_us;
    linux_modbus_doubt_t doubt;
} linux_modbus_link_t;

/** Looks for a figure that no line has.
 *  @return NULL, or which one and its range */
const char *linux_modbus_config_find_wrong(const linux_modbus_config_t *config);

/** Prepares a link; touches no device. Allocates.
 *  @return HV_OK; HV_ERR_ARG: the configuration, what says which figure and its range; HV_ERR_IO: no memory. */
hv_status_t linux_modbus_link_open(linux_modbus_link_t *self, const linux_modbus_config_t *config,
                                   const char **what) HV_MUST_CHECK;

/** Ends it: a TCP connection by reset, so that nothing it holds is delivered later. Harmless on one that is not open. */
void linux_modbus_link_close(linux_modbus_link_t *self);

/** Makes the link where it is not there and its pause is over. trouble tells how it went. */
void linux_modbus_link_mend(linux_modbus_link_t *self);

/** Looks after an idle link: what came in is thrown away, a broken one is given up. */
void linux_modbus_link_look(linux_modbus_link_t *self);

/** Runs one transaction on a link that linux_modbus_link_mend() has mended.
 *  @param result status, exception, count, value and done_us are filled */
void linux_modbus_link_run(linux_modbus_link_t *self, const modbus_request_t *request, modbus_result_t *result);

/** What poll() should watch on an idle link.
 *  @return a file descriptor, -1: not linked */
int linux_modbus_link_fd(const linux_modbus_link_t *self);

/** What is wrong and what helps.
 *  @return English; "" where nothing is */
const char *linux_modbus_trouble_text(linux_modbus_trouble_t trouble);

/** us since the same instant as hal_clock_now_us(). */
uint64_t linux_modbus_now_us(void);

#endif
