/* SPDX-License-Identifier: MIT
 * frame_command.c - the commands of frames: names and numbers of values; see frame_command.h.
 */
#include "frame_command.h"

typedef struct {
    char name[3];
    uint8_t value_count;
} command_t;

static const command_t k_commands[FRAME_COMMANDS] = {
    [FRAME_A3] = {"A3", 3}, [FRAME_A4] = {"A4", 4}, [FRAME_A6] = {"A6", 6}, [FRAME_A7] = {"A7", 7},
    [FRAME_C3] = {"C3", 3}, [FRAME_C6] = {"C6", 6}, [FRAME_C7] = {"C7", 7},
};

unsigned frame_value_count(frame_command_t command)
{
    return k_commands[command].value_count;
}

const char *frame_command_name(frame_command_t command)
{
    return k_commands[command].name;
}

frame_command_t frame_find_command(char letter, uint8_t digit)
{
    unsigned command = 0;
    while (command < FRAME_COMMANDS && (k_commands[command].name[0] != letter || (uint8_t)k_commands[command].name[1] != digit)) {
        command++;
    }
    return (frame_command_t)command;
}
