/* SPDX-License-Identifier: MIT
 * string.h - the four functions of it that a freestanding compiler wants; hal/template/libc.c has them.
 */
#ifndef TEMPLATE_STRING_H
#define TEMPLATE_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t bytes);
void *memmove(void *to, const void *from, size_t bytes);
void *memset(void *to, int value, size_t bytes);
int memcmp(const void *a, const void *b, size_t bytes);

#endif
