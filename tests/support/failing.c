/* SPDX-License-Identifier: MIT
 * failing.c - see failing.h.
 */
#include "failing.h"

#include <errno.h>
#include <link.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unity.h"

#define PLACES_MAX 128

typedef struct {
    const char *function;
    const void *returns_to;
    bool is_reached; /* in this sweep */
    bool has_failed; /* in any */
} place_t;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static place_t place[PLACES_MAX];
static unsigned places;
static const place_t *chosen; /* under trial; NULL = none */
static int chosen_error;
static bool is_for_ever, is_begun, was_met;
static unsigned failed;
static char text[160] = "nothing fails";

static place_t *place_of(const char *function, const void *returns_to)
{
    for (unsigned i = 0; i < places; i++) {
        if (place[i].returns_to == returns_to && strcmp(place[i].function, function) == 0) {
            return &place[i];
        }
    }
    if (places == PLACES_MAX) {
        return NULL;
    }
    place[places] = (place_t){.function = function, .returns_to = returns_to};
    return &place[places++];
}

int failing_error(const char *function, const void *returns_to)
{
    const int kept = errno;
    int error = 0;
    (void)pthread_mutex_lock(&lock);
    place_t *here = place_of(function, returns_to);
    if (here != NULL) {
        here->is_reached = true;
    }
    if (here != NULL && is_begun && here == chosen && (is_for_ever || failed == 0)) {
        here->has_failed = true;
        failed++;
        was_met = true;
        error = chosen_error;
    }
    (void)pthread_mutex_unlock(&lock);
    errno = kept;
    return error;
}

static void set_begun(bool begins)
{
    (void)pthread_mutex_lock(&lock);
    failed = begins ? 0 : failed;
    is_begun = begins;
    (void)pthread_mutex_unlock(&lock);
}

void failing_begin(void)
{
    set_begun(true);
}

void failing_end(void)
{
    set_begun(false);
}

unsigned failing_count(void)
{
    (void)pthread_mutex_lock(&lock);
    const unsigned count = failed;
    (void)pthread_mutex_unlock(&lock);
    return count;
}

const char *failing_text(void)
{
    return text;
}

bool failing_is(const char *function)
{
    return chosen != NULL && strcmp(chosen->function, function) == 0;
}

/* --- The sweep --- */

static int keep_base(struct dl_phdr_info *info, size_t size, void *base)
{
    (void)size;
    *(uintptr_t *)base = info->dlpi_addr; /* the first one is the program */
    return 1;
}

static unsigned long offset_of(const place_t *self)
{
    uintptr_t base = 0;
    (void)dl_iterate_phdr(keep_base, &base);
    return (unsigned long)((uintptr_t)self->returns_to - base);
}

static void choose(const place_t *self, int error, bool for_ever)
{
    (void)pthread_mutex_lock(&lock);
    chosen = self;
    chosen_error = error;
    is_for_ever = for_ever;
    is_begun = false;
    was_met = false;
    failed = 0;
    (void)pthread_mutex_unlock(&lock);
    (void)snprintf(text, sizeof text, self == NULL ? "nothing fails" : "%s at 0x%lx fails with %s%s",
                   self == NULL ? "" : self->function, self == NULL ? 0 : offset_of(self), strerrorname_np(error),
                   for_ever ? " for ever" : "");
}

static const int *errors_of(const failing_errors_t *errors, const char *function)
{
    while (errors->function != NULL && strcmp(errors->function, function) != 0) {
        errors++;
    }
    TEST_ASSERT_NOT_NULL_MESSAGE(errors->function, function);
    return errors->error;
}

/* An error may open a way to further places: these are tried as well, once the loop comes to them. */
unsigned failing_sweep(const failing_errors_t *errors, void (*trial)(void))
{
    unsigned total = 0;
    for (unsigned i = 0; i < places; i++) {
        place[i].is_reached = false;
    }
    choose(NULL, 0, false);
    trial();
    for (unsigned i = 0; i < places; i++) {
        const int *error = errors_of(errors, place[i].function);
        for (unsigned k = 0; place[i].is_reached && k < 2 * FAILING_ERRORS_MAX && error[k / 2] != 0; k++) {
            choose(&place[i], error[k / 2], k % 2 != 0);
            trial();
            total += was_met;
        }
    }
    choose(NULL, 0, false);
    TEST_ASSERT_TRUE(places < PLACES_MAX);
    return total;
}

static __attribute__((destructor)) void tell(void)
{
    const char *path = getenv("HEAVE_FAILED_PLACES");
    FILE *file = path != NULL ? fopen(path, "a") : NULL;
    for (unsigned i = 0; file != NULL && i < places; i++) {
        if (place[i].has_failed) {
            (void)fprintf(file, "%lx %s\n", offset_of(&place[i]), place[i].function);
        }
    }
    if (file != NULL) {
        (void)fclose(file);
    }
}
