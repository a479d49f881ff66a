/* SPDX-License-Identifier: MIT
 * frame_command.h - a command by its name. Private to src/protocol.
 */
#ifndef FRAME_COMMAND_H
#define FRAME_COMMAND_H

#include "heave/frame.h"

/** FRAME_COMMANDS where there is none of that name. */
frame_command_t frame_find_command(char letter, uint8_t digit);

#endif
