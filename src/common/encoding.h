/* SPDX-License-Identifier: MIT
 * encoding.h - how text of people begins: with the marks of Windows editors. Comments may be in any encoding whose bytes below
 * 128 are ASCII (UTF-8, GBK, Windows code pages).
 */
#ifndef HEAVE_COMMON_ENCODING_H
#define HEAVE_COMMON_ENCODING_H

#include <stdbool.h>
#include <stddef.h>

/** Bytes of the mark in front of UTF-8 at the beginning of a file: 3 or 0. */
size_t encoding_mark(const char *bytes, size_t length);

/** Whether a file begins as UTF-16 does, which nobody here reads. */
bool encoding_is_utf16(const char *bytes, size_t length);

#endif
