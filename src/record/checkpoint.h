/* SPDX-License-Identifier: MIT
 * checkpoint.h - all that a run knows at the end of a cycle, as a line of a frames file: an offline run goes on from there.
 * The bytes are those of this program's structs: another version refuses them. Pure.
 */
#ifndef HEAVE_RECORD_CHECKPOINT_H
#define HEAVE_RECORD_CHECKPOINT_H

#include "record/session.h"

/** Bytes that hold every line. */
#define CHECKPOINT_LINE_MAX (2u * sizeof(session_t) + 128u)

/** Takes everything but handles. */
void checkpoint_copy(const session_t *session, session_t *out);

/** `<t_ms> !state VERSION HASH CRC BYTES` with its newline; the time is that of the coming cycle.
 *  @param hash of the configuration at the start (config/hash.h)
 *  @return bytes written */
size_t checkpoint_format(const session_t *saved, const char *hash, char to[CHECKPOINT_LINE_MAX]);

/** Reads what stands behind `!state `.
 *  @param hash of the configuration that goes on
 *  @param out may hold anything where the text was forged: a gateway that goes on from it has to be in a cage (common/cage.h)
 *  @return NULL; or what is wrong, and what is allowed */
const char *checkpoint_parse(const uint8_t *text, size_t length, const char *hash, session_t *out);

#endif
