/* SPDX-License-Identifier: MIT
 * rig_profile.h - several rigs for one service: the files in /etc/heave/NAME.d, of which /etc/heave/NAME.ini is a link to one.
 * Blocks; one thread.
 */
#ifndef HEAVE_HEAVECTL_RIG_PROFILE_H
#define HEAVE_HEAVECTL_RIG_PROFILE_H

#include "heavectl/ctl.h"

/** `heavectl profile [PROFILE]`: lists them, or goes over to one: only in OFF and SETTLED, and only to one that --check passes.
 *  Asks heaved itself, where it runs. @return exit code */
int profile_run(ctl_t *self);

#endif
