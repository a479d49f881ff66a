/* SPDX-License-Identifier: MIT
 * main.c - judges a trace of set-points, fast enough for tens of millions of cycles.
 *
 *   trace_judge CONFIG [FRAMES] <TRACE    what was judged, one figure a line; then what was broken, and the first of
 * it
 *
 * With the frames that were played it is also judged whether they were followed.
 *
 * Exit status: 0 nothing broken, 1 something, 2 a configuration that cannot be read.
 * What tools/check_trace does more: relays, states, engage and rest times, timed moves, and being readable. test_judge.py lets
 * both judge the same traces, seeded with faults.
 */
#include <stdio.h>
#include <string.h>

#include "following.h"
#include "rules.h"

#define BEFORE_ZERO "before-zero\n"
#define LINE_BYTES  1024u

static size_t next_line(char line[LINE_BYTES])
{
    if (fgets(line, LINE_BYTES, stdin) == NULL) {
        return 0;
    }
    return strlen(line);
}

int main(int argc, char **argv)
{
    static mechanism_t s_mechanism;
    static rules_t s_rules;
    static following_t s_following;
    char line[LINE_BYTES];
    const bool has_frames = argc == 3;
    if (argc < 2 || argc > 3 || !mechanism_read(&s_mechanism, argv[1]) ||
        (has_frames && !following_read(&s_following, &s_mechanism, argv[2]))) {
        fputs("usage: trace_judge CONFIG [FRAMES] <TRACE\n", stderr);
        return 2;
    }
    rules_init(&s_rules, &s_mechanism);
    size_t length = next_line(line);
    if (length != strlen(row_header) + 1 || memcmp(line, row_header, length - 1) != 0) {
        rules_bad_line(&s_rules);
    }
    while ((length = next_line(line)) > 0) {
        row_t row;
        if (strstr(line, BEFORE_ZERO) != NULL) {
            continue; /* the drives move by themselves, or not at all: nothing is led yet */
        }
        if (line[length - 1] == '\n' && row_read(&row, line, length - 1)) {
            rules_row(&s_rules, &row);
            if (has_frames) {
                following_row(&s_following, &row, stdout);
            }
        } else {
            rules_bad_line(&s_rules);
        }
    }
    if (s_rules.rows == 0) {
        rules_bad_line(&s_rules);
    }
    rules_report(&s_rules, stdout);
    const uint64_t not_followed = has_frames ? following_report(&s_following, stdout) : 0;
    return rules_broken(&s_rules) + not_followed == 0 ? 0 : 1;
}
