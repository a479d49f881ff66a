/* SPDX-License-Identifier: MIT
 * sealed.h - texts that go from one process to another as a descriptor: who gets one can rely on it that nobody changes it
 * meanwhile.
 */
#ifndef HEAVE_COMMON_SEALED_H
#define HEAVE_COMMON_SEALED_H

#include <fcntl.h>
#include <stddef.h>

/** Seals without which a text may still change. */
#define SEALED_AGAINST (F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW)

/** A file in memory with that text, sealed for good, close-on-exec, its offset at 0.
 *  @param name for who looks at /proc
 *  @return its descriptor; -1: errno says why */
int sealed_text(const char *name, const char *text, size_t length);

#endif
