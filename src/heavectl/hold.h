/* SPDX-License-Identifier: MIT
 * hold.h - requests that are held by a key. heaved decides whether the key is still held. heavectl only sends a beat every
 * 50 ms, as long as the terminal repeats the key.
 */
#ifndef HEAVE_HEAVECTL_HOLD_H
#define HEAVE_HEAVECTL_HOLD_H

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>

#define HOLD_KEY_GAP_MS 150 /* largest time between two repeats of a held key */
#define HOLD_KEY_RUN_MS 120 /* a key counts as held after this time: a tap does not, nor does a burst from a slow link */
#define HOLD_KEY_READS  3u  /* and after at least this many reads */
#define HOLD_BEAT_MS    50
#define HOLD_ABSENCE_MS 100  /* longer between two reads: this program itself was stopped */
#define HOLD_SILENCE_MS 2000 /* without an answer for this time, heaved counts as gone */

/** The key, as seen through the terminal; all zero: it is not held. */
typedef struct {
    int64_t since_ms; /**< begin of the run of repeats */
    int64_t last_ms;
    unsigned reads; /**< reads in this run; 0: no run */
} hold_key_t;

/** Notes that bytes of the key have arrived. */
void hold_key_repeat(hold_key_t *self, int64_t now_ms);

/** Whether the key is held now. */
bool hold_key_is_held(hold_key_t *self, int64_t now_ms);

/** Whether the key has been released: no byte has arrived for long enough, while this program was running. */
bool hold_key_is_let_go(const hold_key_t *self, int64_t now_ms);

/** Notes that this program was stopped until now. Bytes of that time, or their absence, do not count. */
void hold_key_miss(hold_key_t *self, int64_t now_ms);

/** An observer of a held key. */
typedef struct {
    bool (*is_over)(void *context, bool is_pressed); /**< true: the purpose is reached, and the key may be released */
    void *context;
} hold_watch_t;

/** Sends a held request over a connected socket, with the keys of the terminal at standard input. A key that is down already has
 * to be let go first, and Enter does not count: it may still be down from an answer. Ends with q, Ctrl-C, the end
 * of homing or of a signal, or a refusal.
 *  @param request as heaved expects it, without the tick at its end
 *  @param watch observer, has to stay valid until the end; NULL: none
 *  @param is_interrupted set by a signal that ends the program
 *  @return exit code; errors have been printed */
int hold_run(int fd, const char *request, const hold_watch_t *watch, const volatile sig_atomic_t *is_interrupted);

/** Whether the last run was ended by the observer, or because the held motion came to its end by itself. */
bool hold_has_arrived(void);

#endif
