/* SPDX-License-Identifier: MIT
 * semihost.h - files and the end of the program, by ARM's semihosting: the emulator does them.
 */
#ifndef SEMIHOST_H
#define SEMIHOST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** The command line.
 *  @return false where it does not fit */
bool semihost_arguments(char *to, size_t capacity);

/** Opens a file.
 *  @return -1 where it cannot be */
int semihost_open(const char *path, bool is_written);

/** Reads up to `bytes`.
 *  @return how many */
size_t semihost_read(int file, void *to, size_t bytes);

/** @return false where not everything was written */
bool semihost_write(int file, const void *from, size_t bytes);

/** Onto the emulator's standard error. */
void semihost_say(const char *text);

/** A line of its own: what, a blank, the number. */
void semihost_say_number(const char *what, uint32_t number);

/** Never returns. */
void semihost_exit(bool is_good);

#endif
