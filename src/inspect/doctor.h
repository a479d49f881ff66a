/* SPDX-License-Identifier: MIT
 * doctor.h - heaved --doctor: looks at the machine, the CAN interface and the drives of a stopped daemon, and names each problem
 * with what helps. Changes nothing: it reads objects, sends the position query of [can-raw], and listens.
 */
#ifndef HEAVE_INSPECT_DOCTOR_H
#define HEAVE_INSPECT_DOCTOR_H

#include <stdio.h>

#include "config/config.h"

/** Looks and prints. Takes some seconds.
 *  @param file of the configuration: as NAME.ini it is that of the service heave@NAME, which is not to run
 *  @return true where nothing is wrong */
bool doctor_run(const config_t *config, const char *file, FILE *out);

#endif
