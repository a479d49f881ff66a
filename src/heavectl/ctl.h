/* SPDX-License-Identifier: MIT
 * ctl.h - a run of heavectl: what was asked for, and the connection to heaved. All of it blocks; one thread.
 */
#ifndef HEAVE_HEAVECTL_CTL_H
#define HEAVE_HEAVECTL_CTL_H

#include <cjson/cJSON.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/socket_path.h"

#define CTL_LINE_BYTES 65536u

/** A run of the program. */
typedef struct {
    const char *command;
    const char *argument; /**< what follows the command, one blank between words; NULL: nothing */
    char words[128];      /**< of that, without units */
    int unit;             /**< 'm' or 'd', which these were in; '?' both, '\0' none was given */
    const char *socket;   /**< NULL = not named */
    const char *platform; /**< NULL = not named */
    char path[SOCKET_PATH_MAX];
    bool is_json;
    bool is_waiting;                  /* --wait */
    double for_s;                     /**< 0 = until interrupted */
    int64_t until_ms, ready_by_ms;    /**< when that is; how long to wait for heaved and its drives */
    double amplitude, from_hz, to_hz; /**< of identify; 0 = as usual */
    const char *save, *compare, *eds; /* of drive; NULL = not named */
    unsigned hz;                      /**< 0 = as it suits the output */
    int fd;
    int error; /**< why the system does not let it hear heaved, an errno; 0 = it does */
    char line[CTL_LINE_BYTES];
    size_t length;   /**< bytes in line */
    size_t consumed; /**< of those, given out already */
} ctl_t;

/* --- connection.c --- */

/** Set by a signal that ends the program. */
extern volatile sig_atomic_t ctl_is_interrupted;

/** From now on SIGINT, SIGTERM and SIGHUP end the program by the above. */
void ctl_catch_signals(void);

/** Says what is wrong.
 *  @return code */
int ctl_complain(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));

int64_t ctl_now_ms(void);

/** Connects, and asks. @return exit code; what is wrong was said */
int ctl_open(ctl_t *self);
int ctl_send(const ctl_t *self, const char *request);

/** @return the next answer, ended by a NUL, valid until the next call; NULL: none came */
const char *ctl_receive(ctl_t *self, int64_t until_ms);

/** No answer, or no more of them: says why. @return exit code */
int ctl_not_heard(const ctl_t *self, const char *why);

/* --- show.c --- */

/** Prints the status as a table. @param is_watching refreshed on a screen of its own */
void ctl_show_table(const cJSON *status, bool is_watching);

/** A text of heaved in the language of the messages; some it tells in several, as text and text_zh. */
const char *ctl_own_words(const cJSON *object, const char *name);

/** What heaved said, and whether it said no. @return exit code */
int ctl_judge(const cJSON *answer);
int ctl_show(const ctl_t *self, const char *line);

/* --- command_line.c --- */

/** Takes options and the command.
 *  @return NULL; or what is wrong with them */
const char *ctl_parse_options(ctl_t *self, int argc, char **argv);
const char *ctl_parse_command(ctl_t *self, int argc, char **argv);

/** Whom to ask: what the command line names, then the environment, then what is there. @return exit code */
int ctl_choose_socket(ctl_t *self);

/** Where a request leads to; NULL: nowhere that could be waited for. */
const char *ctl_destination(const char *command);

#endif
