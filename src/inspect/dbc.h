/* SPDX-License-Identifier: MIT
 * dbc.h - the frames of [can-raw] and the PDOs of [cia402] as a DBC file, for the tools that show and record CAN buses.
 */
#ifndef HEAVE_INSPECT_DBC_H
#define HEAVE_INSPECT_DBC_H

#include "config/config.h"

/** Writes a message per drive and direction: set-points and positions in mm (deg), with their limits. Where the frames of an
 *  identifier begin with bytes that tell them apart, these are a multiplexor `kind`; else only the first of them is described.
 *  @param config of CONFIG_DRIVES_CAN_RAW drives */
void dbc_write(const config_t *config, FILE *out);

/** Likewise a message per drive and PDO, and its EMCY.
 *  @param config of CONFIG_DRIVES_CIA402 drives */
void dbc_write_cia402(const config_t *config, FILE *out);

/** The shortest decimal that is this number. */
const char *dbc_decimal(double value, char text[32]);

#endif
