/* SPDX-License-Identifier: MIT
 * envelope_csv.h - an envelope as CSV: one row per figure, each with the pose where it holds. docs/envelope.md describes the
 * columns.
 */
#ifndef HEAVE_INSPECT_ENVELOPE_CSV_H
#define HEAVE_INSPECT_ENVELOPE_CSV_H

#include <stdio.h>

#include "platform/envelope.h"

/** Writes the header and all rows. Errors are left in the stream. */
void envelope_csv_write(const envelope_t *envelope, FILE *out);

#endif
