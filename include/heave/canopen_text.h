/* SPDX-License-Identifier: MIT
 * canopen_text.h - numbers of CANopen and CiA 402 in words, for people. Constant texts.
 */
#ifndef HEAVE_CANOPEN_TEXT_H
#define HEAVE_CANOPEN_TEXT_H

#include "heave/status.h"

/** What an SDO abort code means (CiA 301): "there is no such object", ... */
const char *canopen_abort_text(uint32_t code);

/** What an error code of an emergency message or of 603Fh means (CiA 301, CiA 402): that code where it is known, else its class.
 */
const char *canopen_error_text(uint16_t code);

#endif
