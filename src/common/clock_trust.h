/* SPDX-License-Identifier: MIT
 * clock_trust.h - whether the time of day can be right. A box without a clock chip starts with a time that it saved, or that it
 * was built with: its date may be yesterday's until somebody tells it the time. Reads small files of the system; any thread.
 */
#ifndef HEAVE_COMMON_CLOCK_TRUST_H
#define HEAVE_COMMON_CLOCK_TRUST_H

#include <stdbool.h>
#include <stdint.h>

/** Where the system says it. */
typedef struct {
    const char *boot_id;      /**< 128 bits in hexadecimal, other ones after each start of the machine */
    const char *clock_chip;   /**< seconds since 1970 */
    const char *synchronised; /**< is there once systemd-timesyncd has heard a time server. (The kernel knows it, too, but
                                 sandboxes end a program that asks it: adjtimex is among the calls that set the clock.) */
} clock_trust_files_t;

extern const clock_trust_files_t clock_trust_files;

/** Number of this start of the machine: of HEAVE_BOOT_ID in the environment (the service has no other way), else of the system.
 *  @return 0: not known */
uint64_t clock_boot(const clock_trust_files_t *files);

/** True if a time server has been heard since the start of the machine, or a clock chip agrees with the time of day within 15 h:
 * it may run in local time. */
bool clock_is_trusted(const clock_trust_files_t *files);

#endif
