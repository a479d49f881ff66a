/* SPDX-License-Identifier: MIT
 * canmaster.h - whether another master leads the drives of a CAN bus: listened for before the first frame is sent, and watched
 * for afterwards. A driver behind drives.h says what only a master sends; our own frames are never received. Pure.
 */
#ifndef HEAVE_CANMASTER_H
#define HEAVE_CANMASTER_H

#include <stdbool.h>
#include <stdint.h>

/** One bus; all zero: not listened for. Members are private, except those with a comment. */
typedef struct {
    bool is_listening; /**< nothing may be sent */
    bool is_new;
    uint32_t what;     /**< the driver's word for the newest frame; while listening: for the first */
    uint32_t count;    /**< frames heard */
    uint64_t heard_us; /**< time of the step behind the newest; 0 = none */
    uint32_t listen_us;
    uint64_t until_us;
} canmaster_t;

/** What follows from what was heard since the last step. */
typedef enum {
    CANMASTER_QUIET,
    CANMASTER_LISTENING, /**< nothing may be sent */
    CANMASTER_BEGIN,     /**< nobody was heard for long enough: speak from now on */
    CANMASTER_HEARD      /**< another one speaks beside us */
} canmaster_verdict_t;

/** Begins to listen; where no drive has torque or a stop to hear of.
 *  @param listen_ms for so long, and once somebody was heard until there was silence for 1 s; 0 = not at all */
void canmaster_listen(canmaster_t *self, uint32_t listen_ms, uint64_t now_us);

/** Nothing can be heard at present, the bus is down: this time does not count. Once per cycle, in place of canmaster_step(). */
void canmaster_deaf(canmaster_t *self, uint64_t now_us);

/** A frame came that only a master sends.
 *  @param what for the caller */
void canmaster_note(canmaster_t *self, uint32_t what);

/** Once per cycle, behind all that was received.
 *  @param now_us never decreasing */
canmaster_verdict_t canmaster_step(canmaster_t *self, uint64_t now_us);

/** True if another master was heard in the last seconds. For display. */
bool canmaster_was_heard(const canmaster_t *self, uint64_t now_us);

/** True if another master leads the drives and nothing may be sent. */
bool canmaster_leads(const canmaster_t *self, uint64_t now_us);

#endif
