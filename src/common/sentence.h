/* SPDX-License-Identifier: MIT
 * sentence.h - what was said in English, in the language of who reads it.
 *
 * Answers of the control socket are English, with their numbers and names filled in. The catalogue has the formats that they were
 * made from: the one that fits is looked for, and its arguments are set into the translation.
 */
#ifndef HEAVE_COMMON_SENTENCE_H
#define HEAVE_COMMON_SENTENCE_H

#include <stddef.h>

#define SENTENCE_MAX 1024u

/** @param english a text without arguments, a format with its arguments filled in, or several of these behind `: ` and `; `
 *  @return out; or english itself where there is no translation */
const char *sentence(const char *english, char *out, size_t size);

#endif
