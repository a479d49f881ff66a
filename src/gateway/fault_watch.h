/* SPDX-License-Identifier: MIT
 * fault_watch.h - finds faults of bus, drives, e-stop channels and supply, each one once. Knows nothing of what follows.
 * Private to src/gateway.
 */
#ifndef GATEWAY_FAULT_WATCH_H
#define GATEWAY_FAULT_WATCH_H

#include "heave/gateway.h"
#include "feedback.h"

/** Of this cycle. */
typedef struct {
    const settings_t *settings;
    drives_t drives; /**< for what they say about a fault */
    feedback_t feedback;
    const q32_t *setpoint_mm_q32; /**< of the cylinders, of the last cycle */
    unsigned cylinders;           /**< one more drive is the rotation motor */
    uint32_t torque;              /**< drives that have to hold or move something: bit i for axis i + 1 */
    bool is_coming_up;            /**< the drives are being enabled, or home by themselves */
    uint64_t now_us;
} fault_watch_in_t;

/** The bus is lost: the drives no longer get set-points.
 *  @return the fault where it begins, else FAULT_NONE */
fault_code_t fault_watch_bus(fault_watch_t *self, bool is_lost);

/** The bus is about to be lost; the drives still get set-points.
 *  @return the fault where it begins, else FAULT_NONE */
fault_code_t fault_watch_bus_failing(fault_watch_t *self, bool is_failing);

/** Judges a drive.
 *  @param i from 0
 *  @return the fault where another one than before begins, else FAULT_NONE */
fault_code_t fault_watch_axis(fault_watch_t *self, const fault_watch_in_t *in, unsigned i);

/** The two channels of the e-stop disagree.
 *  @return the fault where it begins, else FAULT_NONE */
fault_code_t fault_watch_channels(fault_watch_t *self, bool is_apart);

/** The supply fails.
 *  @param settle_ms a fault if the platform is not down so long after; 0 = never
 *  @return the fault where it begins, else FAULT_NONE */
fault_code_t fault_watch_power(fault_watch_t *self, bool is_failing, uint32_t settle_ms, bool is_down, uint64_t now_us);

/** A fault of drive i, with how far off its axis is where heaved has found that, and what the drive says of it. */
fault_t fault_watch_fault_of(const fault_watch_in_t *in, fault_code_t code, unsigned i);

#endif
