/* SPDX-License-Identifier: MIT
 * hold.h - requests that go on while a key is held. Whether the hand is still there is for heaved to decide: here it is only
 * told, every 50 ms, as long as the terminal repeats the key.
 */
#ifndef HEAVE_HEAVECTL_HOLD_H
#define HEAVE_HEAVECTL_HOLD_H

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>

#define HOLD_KEY_GAP_MS 150 /* a key that is held comes at least so often */
#define HOLD_KEY_RUN_MS 120 /* and has come for so long before it counts: a tap is none, nor is what a link has bunched */
#define HOLD_KEY_READS  3u  /* in so many pieces at least */
#define HOLD_BEAT_MS    50
#define HOLD_ABSENCE_MS 100  /* between two looks: this program was not there itself */
#define HOLD_SILENCE_MS 2000 /* without an answer: heaved is not there any more */

/** The key, as the terminal tells of it; all zero: it is not held. */
typedef struct {
    int64_t since_ms; /**< the run began */
    int64_t last_ms;
    unsigned reads; /**< of the run; 0: there is none */
} hold_key_t;

/** Bytes have come. */
void hold_key_take(hold_key_t *self, int64_t now_ms);

/** Whether it is held now. */
bool hold_key_is_held(hold_key_t *self, int64_t now_ms);

/** Whether it has been let go: nothing has come for long enough, while somebody was there to hear it. */
bool hold_key_is_let_go(const hold_key_t *self, int64_t now_ms);

/** Nobody was there to hear it until now: what came meanwhile says nothing, nor that nothing came. */
void hold_key_miss(hold_key_t *self, int64_t now_ms);

/** Looks on while a key is held; NULL in its place: nobody does. */
typedef struct {
    bool (*is_over)(void *context, bool is_pressed); /**< true: what was wanted is there, and the key may be let go */
    void *context;
} hold_watch_t;

/** Asks over a connected socket, in the terminal of standard input, until q, Ctrl-C, the end of homing, or a refusal.
 *  @param request as heaved takes it, without the tick at its end
 *  @param watch kept until the end; NULL: none
 *  @param is_interrupted set by a signal that ends the program
 *  @return exit code; what is wrong was said */
int hold_run(int fd, const char *request, const hold_watch_t *watch, const volatile sig_atomic_t *is_interrupted);

/** Whether the last run ended because the one who looked on said so. */
bool hold_has_arrived(void);

#endif
