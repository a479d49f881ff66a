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

static uint64_t ppm_of(const canload_entry_t *entry, uint64_t interval_us, uint32_t bitrate_bps)
{
    return divide_up(bits_of(entry) * PPM * US_PER_S, interval_us * bitrate_bps);
}

/* The interval of an entry; as long as keeps the products inside 64 bits. */
static uint64_t interval_of(const canload_entry_t *entry, uint32_t period_us)
{
    const uint64_t interval_us = entry->periods > 0 ? (uint64_t)entry->periods * period_us : entry->interval_us;
    return interval_us < UINT32_MAX ? interval_us : UINT32_MAX;
}

uint32_t canload_ppm(const canload_entry_t *entry, size_t count, uint32_t period_us, uint32_t bitrate_bps)
{
    uint32_t sum = 0;
    for (size_t i = 0; i < count; i++) {
        const uint64_t ppm = ppm_of(&entry[i], interval_of(&entry[i], period_us), bitrate_bps);
        sum = ppm < UINT32_MAX - sum ? sum + (uint32_t)ppm : UINT32_MAX;
    }
    return sum;
}

uint32_t canload_fitting_period_us(const canload_entry_t *entry, size_t count, uint32_t bitrate_bps, uint32_t limit_ppm,
                                   uint32_t step_us)
{
    uint64_t low = 0; /* steps that are too few, and enough */
    uint64_t high = UINT32_MAX / step_us;
    if (canload_ppm(entry, count, (uint32_t)high * step_us, bitrate_bps) > limit_ppm) {
        return 0;
    }
    while (high - low > 1) {
        const uint64_t middle = low + (high - low) / 2;
        if (canload_ppm(entry, count, (uint32_t)middle * step_us, bitrate_bps) <= limit_ppm) {
            high = middle;
        } else {
            low = middle;
        }
    }
    return (uint32_t)high * step_us;
}
