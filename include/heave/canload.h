/* SPDX-License-Identifier: MIT
 * canload.h - worst-case load of a classic CAN bus by a set of frames, stuffing bits included.
 * Pure; used when a configuration is checked.
 */
#ifndef HEAVE_CANLOAD_H
#define HEAVE_CANLOAD_H

#include "heave/status.h"

#define CANLOAD_BYTES_MAX 8u /**< of data in a frame */

/** Periodic frames of one kind. */
typedef struct {
    bool is_extended; /**< 29-bit identifiers */
    uint8_t bytes;    /**< of data, [0, CANLOAD_BYTES_MAX] */
    uint32_t frames;  /**< per interval */
    uint32_t
        periods; /**< interval in bus periods, for frames that are sent in step with them; 0: interval_us holds the interval */
    uint32_t interval_us;
} canload_entry_t;

/** Most bits that one data frame takes, with the three bits of intermission behind it (ISO 11898-1): start, identifier, control,
 *  data and checksum are stuffed, one bit after four at worst (the first after five); the delimiters and the end are not.
 *  @param bytes [0, CANLOAD_BYTES_MAX] */
uint32_t canload_frame_bits(bool is_extended, uint8_t bytes);

/** Load of all entries together, in millionths of what the bit rate carries, rounded up.
 *  @param period_us   of the bus, above 0
 *  @param bitrate_bps above 0
 *  @return saturates at UINT32_MAX */
uint32_t canload_ppm(const canload_entry_t *entry, size_t count, uint32_t period_us, uint32_t bitrate_bps);

/** Shortest bus period, a multiple of step_us, that keeps the load within a limit.
 *  @param limit_ppm above 0
 *  @param step_us   above 0
 *  @return 0 if no period does: the frames with an interval_us of their own already exceed the limit */
uint32_t canload_fitting_period_us(const canload_entry_t *entry, size_t count, uint32_t bitrate_bps, uint32_t limit_ppm,
                                   uint32_t step_us);

#endif
