/* SPDX-License-Identifier: MIT
 * service_words.h - requests of SERVICE in words: as a client sends them, and as a frames file holds them. Pure.
 *
 *     torque N|all on|off          jog N|AXIS SPEED [WAY] ...     home N|all ...     relay N ...
 *     signal N|AXIS sine|step AMPLITUDE HZ SECONDS ...      signal N|AXIS chirp|noise AMPLITUDE HZ TO_HZ SECONDS ...
 *     beat SERIES COUNTER ...      release SERIES
 *
 * A client ends what is held, and a beat, with the tick that it echoes. A file has the series there, where the client has none
 * yet, and the age of that tick in us: `jog z -2.5 17 1000`.
 */
#ifndef HEAVE_RECORD_SERVICE_WORDS_H
#define HEAVE_RECORD_SERVICE_WORDS_H

#include "heave/service.h"

/** Bytes that hold every request of a file, without end. */
#define SERVICE_WORDS_MAX 160u

/** True where the first word is one of these. */
bool service_words_are(const char *text, size_t length);

/** Reads a request.
 *  @param is_file series and age; else a tick
 *  @param tick_us out: of a client; 0 where the request takes none
 *  @return NULL; or what is wrong: constant text that says what is allowed */
const char *service_words_read(const char *text, size_t length, bool is_file, service_request_t *out, uint64_t *tick_us);

/** Writes a request as a file has it.
 *  @return bytes written, without a NUL */
size_t service_words_put(char to[SERVICE_WORDS_MAX], const service_request_t *request);

#endif
