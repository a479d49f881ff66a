/* SPDX-License-Identifier: MIT
 * canload.c - worst-case load of a CAN bus; see canload.h.
 */
#include "heave/canload.h"

#define PPM      1000000u
#define US_PER_S 1000000u
#define BITS_MAX 10000000u /* of one kind per interval: times PPM and US_PER_S still fits */

/* Start, identifier, RTR, IDE, r0, length, checksum; with 29 bits also SRR, the longer identifier and r1. */
#define STUFFED_BITS          34u
#define STUFFED_BITS_EXTENDED 54u
/* Checksum delimiter, acknowledgement and its delimiter, end of frame, intermission. */
#define PLAIN_BITS 13u

uint32_t canload_frame_bits(bool is_extended, uint8_t bytes)
{
    HV_ASSERT(bytes <= CANLOAD_BYTES_MAX);
    const uint32_t stuffed = (is_extended ? STUFFED_BITS_EXTENDED : STUFFED_BITS) + 8u * bytes;
    return stuffed + (stuffed - 1u) / 4u + PLAIN_BITS;
}

/* Bits of an entry per interval; as many as keep the sums below inside 64 bits. */
static uint64_t bits_of(const canload_entry_t *entry)
{
    const uint64_t bits = (uint64_t)canload_frame_bits(entry->is_extended, entry->bytes) * entry->frames;
    return bits < BITS_MAX ? bits : BITS_MAX;
}

static uint64_t divide_up(uint64_t value, uint64_t divisor)
{
    return value / divisor + (value % divisor != 0);
}

/* Load of all entries but those with the interval except_us. */
static uint64_t sum_ppm(const canload_entry_t *entry, size_t count, uint32_t bitrate_bps, uint32_t except_us)
{
    uint64_t sum = 0;
    for (size_t i = 0; i < count; i++) {
        if (entry[i].interval_us != except_us) {
            sum += divide_up(bits_of(&entry[i]) * PPM * US_PER_S, (uint64_t)entry[i].interval_us * bitrate_bps);
        }
    }
    return sum;
}

uint32_t canload_ppm(const canload_entry_t *entry, size_t count, uint32_t bitrate_bps)
{
    const uint64_t sum = sum_ppm(entry, count, bitrate_bps, 0);
    return sum < UINT32_MAX ? (uint32_t)sum : UINT32_MAX;
}

uint32_t canload_fitting_interval_us(const canload_entry_t *entry, size_t count, uint32_t bitrate_bps, uint32_t interval_us,
                                     uint32_t limit_ppm, uint32_t step_us)
{
    const uint64_t fixed_ppm = sum_ppm(entry, count, bitrate_bps, interval_us);
    uint64_t bits = 0;
    for (size_t i = 0; i < count; i++) {
        bits += entry[i].interval_us == interval_us ? bits_of(&entry[i]) : 0;
    }
    if (fixed_ppm >= limit_ppm) {
        return 0;
    }
    bits = bits < BITS_MAX ? bits : BITS_MAX;
    const uint64_t least_us = divide_up(bits * PPM * US_PER_S, (limit_ppm - fixed_ppm) * bitrate_bps);
    const uint64_t fitting_us = divide_up(least_us, step_us) * step_us;
    return fitting_us <= UINT32_MAX ? (uint32_t)fitting_us : 0;
}
