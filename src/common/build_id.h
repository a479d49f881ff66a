/* SPDX-License-Identifier: MIT
 * build_id.h - what this very program is recognised by: the identifier that the linker has made of all of it.
 */
#ifndef HEAVE_COMMON_BUILD_ID_H
#define HEAVE_COMMON_BUILD_ID_H

/** Hexadecimal digits; "unknown" where the linker has left none. Constant text. Once at the start, before there are threads. */
const char *build_id(void);

#endif
