/* SPDX-License-Identifier: MIT
 * quirks.h - in what simulated CiA 402 drives differ from the usual ones on purpose, as real ones do: by name.
 */
#ifndef HEAVE_TWIN_QUIRKS_H
#define HEAVE_TWIN_QUIRKS_H

#include <stdbool.h>
#include <stdint.h>

/** By bit. */
typedef enum {
    QUIRK_HIDES_MODE = 1 << 0,    /**< 6061h is 0 without torque */
    QUIRK_NEEDS_BITS = 1 << 1,    /**< follows set-points in CSP with bits 4 to 6 of the controlword only */
    QUIRK_NO_BIT_10 = 1 << 2,     /**< does not set bit 10 in homing */
    QUIRK_SLOW_RESET = 1 << 3,    /**< resets a fault when bit 7 of the controlword has been set for 100 ms */
    QUIRK_FAULT_BLOCKS = 1 << 4,  /**< does not become operational with a fault */
    QUIRK_LONG_PDO = 1 << 5,      /**< TPDOs have 8 bytes, whatever is mapped */
    QUIRK_SHORT_PDO = 1 << 6,     /**< TPDOs lack their last byte */
    QUIRK_LENGTH_BIT = 1 << 7,    /**< bit 7 is set in the lengths of mapped objects */
    QUIRK_SENDS_CHANGES = 1 << 8, /**< one more TPDO when the statusword changes */
    QUIRK_BOOTS_TWICE = 1 << 9,   /**< two boot-up messages */
    QUIRK_SHORT_SDO = 1 << 10,    /**< SDO answers end behind the last byte in use */
    QUIRK_SEGMENTS = 1 << 11,     /**< SDO answers with values in segments, whatever their size */
    QUIRK_WRONG_TOGGLE = 1 << 12  /**< in segments, with the toggle bit inverted */
} quirk_t;

static inline bool quirk_is(uint32_t quirks, quirk_t quirk)
{
    return (quirks & (uint32_t)quirk) != 0;
}

/** Name i of the table, with its bit; false behind the last one. */
bool quirk_describe(unsigned i, const char **name, quirk_t *bit);

#endif
