/* SPDX-License-Identifier: MIT
 * heaved_link.h - the two whom a guided run talks to: heaved over its socket, and the person at the terminal. All of it blocks.
 */
#ifndef HEAVE_HEAVECTL_HEAVED_LINK_H
#define HEAVE_HEAVECTL_HEAVED_LINK_H

#include <cjson/cJSON.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>

#define HEAVED_LINK_LINE_BYTES 65536u
#define HEAVED_LINK_ERROR_MAX  128u
#define HEAVED_LINK_LOOK_MS    100 /* between looks at the state */

typedef struct {
    const volatile sig_atomic_t *is_interrupted;
    int fd;
    bool is_over; /**< the person wants to end, or heaved is gone */
    char line[HEAVED_LINK_LINE_BYTES];
} heaved_link_t;

/** Whether an answer shows what is waited for. */
typedef bool (*heaved_link_seen_t)(const cJSON *answer);

int64_t heaved_link_now_ms(void);

/** @return a connected socket; -1: errno says why there is none */
int heaved_link_open(const char *path);

/** @return the answer to a request, to be deleted; NULL: none came */
cJSON *heaved_link_ask(heaved_link_t *self, const char *request);

/** Members of an answer: "", 0 and false where there are none of that type. */
const char *heaved_link_text(const cJSON *object, const char *name);
double heaved_link_number(const cJSON *object, const char *name);
bool heaved_link_is_set(const cJSON *object, const char *name);

/** Asks for something to be done.
 *  @param error out: why not, where it returns false; "" else */
bool heaved_link_has_done(heaved_link_t *self, const char *request, char error[HEAVED_LINK_ERROR_MAX]);

/** Asks again and again until heaved shows something.
 *  @return 'y': it does; 's': the person leaves it out; 'q': it is ended; 'n': time is up */
int heaved_link_wait(heaved_link_t *self, const char *request, heaved_link_seen_t is_seen, int64_t most_ms);

/** Asks the person. Keys that were typed or held before do not count.
 *  @return 'y', 'n', 's' (leaves it out) or 'q' */
int heaved_link_question(heaved_link_t *self, const char *text);

#endif
