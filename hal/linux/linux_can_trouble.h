/* SPDX-License-Identifier: MIT
 * linux_can_trouble.h - what is wrong with a CAN interface: kept, told in words, and forgotten once it has passed. Private to
 * linux_can*.c.
 */
#ifndef LINUX_CAN_TROUBLE_H
#define LINUX_CAN_TROUBLE_H

#include "linux_can.h"

/** Nothing is wrong. */
void linux_can_trouble_forget(linux_can_t *self);

/** Keeps what is wrong.
 *  @param error errno, 0 = none
 *  @param what  in words
 *  @return HV_ERR_IO */
hv_status_t linux_can_trouble_report(linux_can_t *self, linux_can_trouble_t trouble, int error, const char *what);

/** Nothing passes any more until a restart. */
void linux_can_trouble_cut_off(linux_can_t *self, hal_can_state_t state);

/** The interface is gone (HV_ERR_AGAIN), down, or bus-off (HV_ERR_IO): nothing passes until a restart. */
hv_status_t linux_can_trouble_say_gone(linux_can_t *self);
hv_status_t linux_can_trouble_say_down(linux_can_t *self);
hv_status_t linux_can_trouble_say_bus_off(linux_can_t *self);

/** A call has failed, for a reason of the interface or of the system.
 *  @param what constant text: names the call
 *  @return HV_ERR_IO */
hv_status_t linux_can_trouble_note_failure(linux_can_t *self, int error, const char *what);

/** That call works: what was wrong with it has passed. */
void linux_can_trouble_note_success(linux_can_t *self, const char *what);

#endif
