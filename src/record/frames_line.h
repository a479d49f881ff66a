/* SPDX-License-Identifier: MIT
 * frames_line.h - one line of a file of frames: what it says, and how it is read. Allocates nothing.
 */
#ifndef HEAVE_RECORD_FRAMES_LINE_H
#define HEAVE_RECORD_FRAMES_LINE_H

#include "heave/drives.h"
#include "heave/fault.h"
#include "heave/hal/udp.h"
#include "heave/service.h"
#include "heave/supervisor.h"

#define FRAMES_TIME_MAX_MS 4294967295u /**< 49 days */
#define FRAMES_TEXT_MAX    65507u      /**< longest datagram UDP carries */

/** What a line does. */
typedef enum {
    FRAMES_DATAGRAM,  /**< a sender sends text */
    FRAMES_REQUEST,   /**< `!engage` ...: what heavectl would ask for */
    FRAMES_INTENSITY, /**< `!intensity N`: percent of a sender's motion */
    FRAMES_RISE,      /**< `!rise N`: percent of engage speed with which it rises (recordings hold this) */
    FRAMES_SERVICE,   /**< `!jog ...`, `!torque ...`: by hand (service_words.h; recordings hold this) */
    FRAMES_ESTOP,     /**< `!estop on`, `!estop off` */
    FRAMES_LATE,      /**< `!late N`: N cycles are skipped and counted (recordings hold this) */
    FRAMES_FROM,      /**< `!from ADDRESS`: who sends the datagrams from here on */
    FRAMES_DRIVE,     /**< `!drive N fault CODE`, `!drive N offline`, `!drive N back`: what a drive did (recordings hold this) */
    FRAMES_FAULT,     /**< `!fault CODE`, `!fault CODE N`: what the gateway found wrong in that cycle (recordings hold this) */
    FRAMES_FEEDBACK,  /**< `!feedback N HEX`: what a drive told, before time zero (incidents hold this) */
    FRAMES_END,       /**< `!end`: the run ends with this cycle (incidents hold this) */
    FRAMES_STATE      /**< `!state ...`, the first line: the run goes on from there (incidents hold this; checkpoint.h) */
} frames_kind_t;

/** One line. */
typedef struct {
    uint64_t t_us;
    frames_kind_t kind;
    event_t request;     /**< FRAMES_REQUEST */
    uint8_t drive;       /**< FRAMES_DRIVE, FRAMES_FEEDBACK: from 1; FRAMES_FAULT: the axis, 0 where none is concerned */
    fault_code_t fault;  /**< FRAMES_FAULT */
    drive_state_t state; /**< FRAMES_DRIVE: DRIVE_FAULT, DRIVE_OFFLINE, else it is back */
    uint32_t number;     /**< FRAMES_INTENSITY, FRAMES_RISE: percent; FRAMES_ESTOP: 1 = on; FRAMES_LATE: cycles; FRAMES_DRIVE: a
                            fault's code */
    const uint8_t *text; /**< FRAMES_DATAGRAM: its bytes, escapes resolved; FRAMES_STATE: what stands behind the word */
    uint32_t length;
    drive_feedback_t feedback; /**< FRAMES_FEEDBACK; actual_us is its age */
    service_request_t service; /**< FRAMES_SERVICE */
    hal_udp_peer_t from;       /**< FRAMES_FROM: read from it; FRAMES_DATAGRAM: set by frames_load */
    uint32_t line;             /**< number in the file, from 1 */
} frames_line_t;

/** Reads one line, without its newline.
 *  @param text   changed: escapes are resolved in place, and the line's text points into it
 *  @param length without newline; a CR at the end does not count
 *  @param out    valid where true is returned and *is_empty is false; out->line is left alone
 *  @param why    constant text where false is returned: what is wrong; what is allowed
 *  @return false: the line is wrong */
bool frames_parse_line(char *text, size_t length, frames_line_t *out, bool *is_empty, const char **why);

#endif
