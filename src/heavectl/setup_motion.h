/* SPDX-License-Identifier: MIT
 * setup_motion.h - what setup does with drives, relays and switches. Nothing moves but while a key is held, and heaved hears of
 * it.
 */
#ifndef HEAVE_HEAVECTL_SETUP_MOTION_H
#define HEAVE_HEAVECTL_SETUP_MOTION_H

#include "heavectl/setup_session.h"
#include "setup/setup.h"

/** Each does what the act of its name in setup_dialog.h says, and writes its result; false: session->error says why not. */
typedef bool setup_motion_t(setup_session_t *session, const setup_t *setup, const setup_question_t *question,
                            char result[SETUP_ANSWER_MAX]);

setup_motion_t setup_motion_jog, setup_motion_home, setup_motion_counts, setup_motion_same, setup_motion_pose, setup_motion_rise,
    setup_motion_tilt, setup_motion_ends, setup_motion_relay, setup_motion_switch;

#endif
