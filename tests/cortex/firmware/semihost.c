/* SPDX-License-Identifier: MIT
 * semihost.c - ARM's "Semihosting for AArch32 and AArch64": an operation in r0, a block of arguments in r1, BKPT 0xAB.
 */
#include "semihost.h"

#include <string.h>

enum { SYS_OPEN = 0x01, SYS_WRITE0 = 0x04, SYS_WRITE = 0x05, SYS_READ = 0x06, SYS_GET_CMDLINE = 0x15, SYS_EXIT = 0x18 };
enum { OPEN_RB = 1, OPEN_WB = 5 };

#define STOPPED_APPLICATION_EXIT 0x20026u
#define STOPPED_RUNTIME_ERROR    0x20023u

static uintptr_t call(uintptr_t operation, uintptr_t argument)
{
    register uintptr_t r0 __asm__("r0") = operation;
    register uintptr_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static size_t length_of(const char *text)
{
    size_t length = 0;
    while (text[length] != '\0') {
        length++;
    }
    return length;
}

bool semihost_arguments(char *to, size_t capacity)
{
    uintptr_t block[2] = {(uintptr_t)to, capacity};
    return call(SYS_GET_CMDLINE, (uintptr_t)block) == 0;
}

int semihost_open(const char *path, bool is_written)
{
    const uintptr_t block[3] = {(uintptr_t)path, is_written ? OPEN_WB : OPEN_RB, length_of(path)};
    return (int)call(SYS_OPEN, (uintptr_t)block);
}

size_t semihost_read(int file, void *to, size_t bytes)
{
    const uintptr_t block[3] = {(uintptr_t)file, (uintptr_t)to, bytes};
    return bytes - call(SYS_READ, (uintptr_t)block); /* it tells what is missing */
}

bool semihost_write(int file, const void *from, size_t bytes)
{
    const uintptr_t block[3] = {(uintptr_t)file, (uintptr_t)from, bytes};
    return call(SYS_WRITE, (uintptr_t)block) == 0;
}

void semihost_say(const char *text)
{
    (void)call(SYS_WRITE0, (uintptr_t)text);
}

void semihost_say_number(const char *what, uint32_t number)
{
    char digits[12] = {0};
    size_t at = sizeof digits - 2;
    digits[at] = '\n';
    do {
        digits[--at] = (char)('0' + number % 10);
        number /= 10;
    } while (number > 0);
    semihost_say(what);
    semihost_say(" ");
    semihost_say(&digits[at]);
}

void semihost_exit(bool is_good)
{
    (void)call(SYS_EXIT, is_good ? STOPPED_APPLICATION_EXIT : STOPPED_RUNTIME_ERROR);
    for (;;) {}
}
