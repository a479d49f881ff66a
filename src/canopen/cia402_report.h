/* SPDX-License-Identifier: MIT
 * cia402_report.h - what one drive is at, as feedback for the gateway and in words for people.
 */
#ifndef CIA402_REPORT_H
#define CIA402_REPORT_H

#include "heave/cia402.h"

/** State of a drive towards the gateway. */
drive_state_t cia402_report_state(const cia402_t *self, uint8_t index);

/** Feedback of a drive. */
void cia402_report_feedback(const cia402_t *self, uint8_t index, drive_feedback_t *out);

/** The same for people. */
void cia402_report_words(const cia402_t *self, uint8_t index, drive_report_t *out);

#endif
