/* SPDX-License-Identifier: MIT
 * child.h - programs that the panel runs for a page: heaved, to check a text, or this process itself, to work something out.
 * Few at a time, with limits of time, memory and output; they get no descriptor but the null device and a pipe. The panel never
 * waits for them.
 */
#ifndef HEAVE_PANEL_CHILD_H
#define HEAVE_PANEL_CHILD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#define CHILD_PROGRAMS   4u /* at a time */
#define CHILD_WORKS      2u /* of each kind at a time: a program that somebody runs keeps no login away */
#define CHILDREN_MAX     8u
#define CHILD_OUTPUT_MAX (2u * 1024u * 1024u)
#define CHILD_LONGEST_MS 15000

/** What became of it. @param code its exit code; -1: it was ended, or never began
 *  @param text its output, the receiver's to free */
typedef void child_end_t(void *context, int code, char *text, size_t length);

/** One. */
typedef struct child {
    pid_t pid; /**< 0: free */
    bool is_program;
    int fd;
    void *handle; /**< of the event loop */
    char *text;
    size_t length;
    int64_t until_ms;
    child_end_t *end;
    void *context; /**< NULL: nobody wants to know any more */
} child_t;

/** What the event loop has to do: look at fd, child_readable() when it can be read. Set once. */
extern void (*child_watch)(child_t *child);

/** Runs a program. @param argv its path first, NULL last @param language of its messages, as "zh"; "" = English
 *  @return false: too many run, or it cannot be started */
bool child_run(const char *const *argv, const char *language, child_end_t *end, void *context, int64_t now_ms);

/** Runs a function in a process of its own; it writes to the descriptor and returns an exit code. */
bool child_work(int (*work)(void *context, int fd), void *context, child_end_t *end, int64_t now_ms);

/** How many run that end so. */
unsigned child_count(child_end_t *end);

/** Reads what there is. @return false: it has ended, and its end was told once the loop has closed fd (child_closed) */
bool child_readable(child_t *child);
void child_closed(child_t *child);

/** Ends those that take too long. Once a second. */
void child_watch_time(int64_t now_ms);

/** Who wanted to know is gone. */
void child_forget(const void *context);

#endif
