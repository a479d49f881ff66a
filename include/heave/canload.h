/* SPDX-License-Identifier: MIT
 * canload.h - how much of a classic CAN bus a set of frames takes in the worst case, stuffing bits included.
 * Pure; used when a configuration is checked.
 */
#ifndef HEAVE_CANLOAD_H
#define HEAVE_CANLOAD_H

#include "heave/status.h"

#define CANLOAD_BYTES_MAX 8u /**< of data in a frame */

/** Frames of one kind that the bus carries again and again. */
typedef struct {
    bool is_extended;     /**< 29-bit identifiers */
    uint8_t bytes;        /**< of data, [0, CANLOAD_BYTES_MAX] */
    uint32_t frames;      /**< per interval */
    uint32_t interval_us; /**< above 0 */
} canload_entry_t;

/** Most bits that one data frame takes, with the three bits of intermission behind it (ISO 11898-1): start, identifier, control,
 *  data and checksum are stuffed, one bit after four at worst (the first after five); the delimiters and the end are not.
 *  @param bytes [0, CANLOAD_BYTES_MAX] */
uint32_t canload_frame_bits(bool is_extended, uint8_t bytes);

/** Load of all entries together, in millionths of what the bit rate carries, rounded up.
 *  @param bitrate_bps above 0
 *  @return saturates at UINT32_MAX */
uint32_t canload_ppm(const canload_entry_t *entry, size_t count, uint32_t bitrate_bps);

/** Shortest interval for which the entries whose interval is `interval_us` would keep the load within a limit, the others
 *  staying as they are. Rounded up to a multiple of step_us.
 *  @param interval_us marks the entries that may become slower or quicker
 *  @param limit_ppm   above 0
 *  @param step_us     above 0
 *  @return 0 where no interval does: the other entries alone take too much */
uint32_t canload_fitting_interval_us(const canload_entry_t *entry, size_t count, uint32_t bitrate_bps, uint32_t interval_us,
                                     uint32_t limit_ppm, uint32_t step_us);

#endif
