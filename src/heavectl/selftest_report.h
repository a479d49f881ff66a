/* SPDX-License-Identifier: MIT
 * selftest_report.h - what a self-test has found, for people and for files.
 */
#ifndef HEAVE_HEAVECTL_SELFTEST_REPORT_H
#define HEAVE_HEAVECTL_SELFTEST_REPORT_H

#include <stdbool.h>

#define SELFTEST_ITEMS_MAX 64u
#define SELFTEST_NOTE_MAX  128u

typedef enum { SELFTEST_PASSED, SELFTEST_FAILED, SELFTEST_SKIPPED, SELFTEST_UNUSED } selftest_result_t;

/** One thing that was looked at. */
typedef struct {
    char name[32];
    selftest_result_t result;
    char note[SELFTEST_NOTE_MAX]; /**< numbers, or why */
} selftest_item_t;

/** All of them, in order. */
typedef struct {
    selftest_item_t item[SELFTEST_ITEMS_MAX];
    unsigned items;
} selftest_report_t;

/** Adds an item and prints its line.
 *  @param name in English, as the note: so they are kept
 *  @param shown the note in the language of who looks on */
void selftest_note(selftest_report_t *self, const char *name, selftest_result_t result, const char *note, const char *shown);

/** True where something has passed and nothing has failed or was left out: that was not seen to work. What is unused does not
 * count. */
bool selftest_has_passed(const selftest_report_t *self);

/** Writes the report as JSON, beside its place first.
 *  @param configuration, version, build of heaved
 *  @return 0, or an errno */
int selftest_write(const selftest_report_t *self, const char *file, const char *configuration, const char *version,
                   const char *build);

#endif
