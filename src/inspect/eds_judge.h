/* SPDX-License-Identifier: MIT
 * eds_judge.h - what follows from the file of a drive for a platform, before anything has power.
 */
#ifndef HEAVE_INSPECT_EDS_JUDGE_H
#define HEAVE_INSPECT_EDS_JUDGE_H

#include "config/config.h"
#include "common/eds.h"

/** Says which objects the cylinders' drives lack and which settings do not fit them.
 *  @param config  whose drives are CiA 402
 *  @return true where such a drive can be used */
bool eds_judge(const eds_t *eds, const config_t *config, FILE *out);

#endif
