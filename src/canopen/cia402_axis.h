/* SPDX-License-Identifier: MIT
 * cia402_axis.h - one drive: from missing to up, what it sends, whether it is lost, and its next controlword.
 */
#ifndef CIA402_AXIS_H
#define CIA402_AXIS_H

#include "heave/cia402.h"

/** Number of the fault that the driver itself finds: like the drives' own. */
#define CIA402_FOLLOWING_ERROR 0x8611u
#define CIA402_HOMING_ERROR    0x8613u
#define CIA402_GENERIC_ERROR   0x1000u

#define CIA402_NODE_MAX      127u
#define CIA402_NMT_OPERATION 0x05u
#define CIA402_SURPLUS_MAX   2u /* answers that nobody asked for; CAN itself may repeat one */

/** One drive with what it is configured to be, for the functions below. */
typedef struct {
    cia402_axis_t *axis;
    cia402_axis_t *all; /**< the platform's, for the others of its node */
    const cia402_config_t *config;
    const cia402_axis_config_t *own; /**< its entry of the configuration */
    uint64_t now_us;
} cia402_drive_t;

/** Starts from nothing: nobody has answered yet. */
void cia402_axis_init(cia402_drive_t drive);

/** Received: by the kind of identifier. */
void cia402_axis_receive_position(cia402_drive_t drive, uint32_t bits);
void cia402_axis_receive_emergency(cia402_drive_t drive, const can_frame_t *frame);
void cia402_axis_receive_heartbeat(cia402_drive_t drive, const can_frame_t *frame);

/** True where its PDOs count. */
bool cia402_axis_is_commanded(const cia402_axis_t *self);

/** A TPDO with an answer came.
 *  @param n   which of them
 *  @param all bit N: there is an answer N */
void cia402_axis_note_answer(cia402_drive_t drive, unsigned n, uint8_t all);

/** The values of the first of them have been taken over. */
void cia402_axis_count_answer(cia402_drive_t drive);

/** SYNC went out: a TPDO is due, now or at a later one. */
void cia402_axis_note_sync(cia402_drive_t drive);

/** SYNC of another master: it is answered like ours. */
void cia402_axis_note_foreign_sync(cia402_drive_t drive);

/** Once per poll, behind what was received: goes on with setting up, finds out whether the drive is lost or fell out. */
void cia402_axis_step(cia402_drive_t drive);

/** Stops the drive and holds it as faulty until a reset.
 *  @param code cia402_trouble_t, or a number of the standard */
void cia402_axis_fail(cia402_drive_t drive, uint32_t code);

/** Begins to take a fault back, the drive's and ours; a refused drive is tried again. */
void cia402_axis_reset(cia402_drive_t drive);

/** True where its set-points are sent. */
bool cia402_axis_is_heard(const cia402_axis_t *self);

/** Chooses the controlword of the next RPDO; called once for each.
 *  @param mode_bits for operation enabled */
void cia402_axis_next_word(cia402_drive_t drive, uint16_t mode_bits);

/** State by the last statusword. */
cia402_state_t cia402_axis_state(const cia402_axis_t *self);

/** True until a statusword says that the power stage is off, and what the drive was told last cannot switch it on any more. */
bool cia402_axis_is_energized(const cia402_axis_t *self);

/** True where operation is enabled and set-points are followed. */
bool cia402_axis_is_operating(cia402_drive_t drive);

#endif
