/* SPDX-License-Identifier: MIT
 * command_usage.h - the options of heavectl's table, which is in common/usage.h.
 */
#ifndef HEAVE_HEAVECTL_COMMAND_USAGE_H
#define HEAVE_HEAVECTL_COMMAND_USAGE_H

enum {
    OPTION_JSON = 1,
    OPTION_SOCKET,
    OPTION_PLATFORM,
    OPTION_WAIT,
    OPTION_FOR,
    OPTION_HZ,
    OPTION_AMPLITUDE,
    OPTION_BAND,
    OPTION_SAVE,
    OPTION_COMPARE,
    OPTION_EDS,
    OPTION_HELP,
    OPTION_VERSION
};

#endif
