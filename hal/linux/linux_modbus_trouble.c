/* SPDX-License-Identifier: MIT
 * linux_modbus_trouble.c - what is wrong with a line, in words.
 */
#include "linux_modbus_link.h"

const char *linux_modbus_trouble_text(linux_modbus_trouble_t trouble)
{
    switch (trouble) {
    case LINUX_MODBUS_FINE:
        return "";
    case LINUX_MODBUS_NOT_TRIED:
        return "no link yet";
    case LINUX_MODBUS_NO_DEVICE:
        return "there is no such serial device: is the adapter plugged in? (ls -l /dev/serial/by-id)";
    case LINUX_MODBUS_NOT_SERIAL:
        return "this is not a serial device";
    case LINUX_MODBUS_NO_RS485:
        return "its driver cannot turn an RS-485 line around by itself: most adapters do it without being asked";
    case LINUX_MODBUS_NOT_ALLOWED:
        return "not allowed: serial devices usually belong to the group dialout";
    case LINUX_MODBUS_IN_USE:
        return "another program has the serial device open";
    case LINUX_MODBUS_REFUSED:
        return "the connection is refused: is the address right, and is another master connected?";
    case LINUX_MODBUS_UNREACHABLE:
        return "nobody answers there: is it switched on and plugged in, and is the address right?";
    case LINUX_MODBUS_LOST:
        return "the link broke";
    case LINUX_MODBUS_SYSTEM_ERROR:
        return "the system refuses";
    }
    return "";
}
