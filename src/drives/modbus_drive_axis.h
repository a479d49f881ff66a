/* SPDX-License-Identifier: MIT
 * modbus_drive_axis.h - one drive on Modbus: its life, judged from what it answers and what it was asked. Private to src/drives.
 * Knows no line: it says what is to be read and written next, and is told what became of it.
 */
#ifndef MODBUS_DRIVE_AXIS_H
#define MODBUS_DRIVE_AXIS_H

#include "heave/guard.h"
#include "heave/modbus_drive.h"

/** Whether the driver can use a map. */
bool modbus_drive_map_is_valid(const modbus_drive_map_t *map);

/** A drive of which nothing is known yet. */
void modbus_drive_axis_init(modbus_drive_axis_t *self, const modbus_drive_map_t *map);

/** What became of a transaction of its read or its write slot.
 *  @return true where a set-point was confirmed by it */
void modbus_drive_axis_receive_read(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const counts_scale_t *scale,
                                    const modbus_result_t *result, uint64_t now_us);
bool modbus_drive_axis_receive_write(modbus_drive_axis_t *self, const modbus_drive_map_t *map,
                                     const modbus_drive_axis_map_t *axis, const modbus_result_t *result, uint64_t now_us);

/** A stop has gone to all drives of its line: now to itself. */
void modbus_drive_axis_end_broadcast(modbus_drive_axis_t *self);

/** What follows from the time. Once per poll, after what came in. */
void modbus_drive_axis_step(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us);

/** What is to be read, written next; unit and tag are filled in.
 *  @return false where nothing is */
bool modbus_drive_axis_next_read(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint8_t unit, uint64_t now_us,
                                 modbus_request_t *out);
bool modbus_drive_axis_next_write(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                                  uint64_t now_us, modbus_request_t *out);

/** Carries out a request that is allowed. */
void modbus_drive_axis_request(modbus_drive_axis_t *self, const modbus_drive_map_t *map, drives_request_t request,
                               uint64_t now_us);

/** Every drive has torque: set-points are followed from where this one was placed. */
void modbus_drive_axis_begin(modbus_drive_axis_t *self, const counts_scale_t *scale, uint64_t now_us);

/** A set-point, as the line can carry it: what is written next is the mean since the last one written. */
void modbus_drive_axis_offer(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                             uint64_t now_us);

/** The speed field of the position that is written next. */
void modbus_drive_axis_choose_speed(modbus_drive_axis_t *self, const modbus_drive_map_t *map,
                                    const modbus_drive_axis_map_t *axis);

/** A position is in the drive. */
void modbus_drive_axis_confirm(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                               int64_t counts);

/** Stops following where a set-point is too far away. */
void modbus_drive_axis_watch(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                             q32_t setpoint_q32, uint64_t now_us);

/** State as drives.h has it. */
drive_state_t modbus_drive_axis_state(const modbus_drive_axis_t *self);

void modbus_drive_axis_feedback(const modbus_drive_axis_t *self, drive_feedback_t *feedback);

/** In words. */
void modbus_drive_axis_words(const modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint8_t unit, drive_report_t *out);

#endif
