/* SPDX-License-Identifier: MIT
 * panel_options.h - the command line of heave-panel.
 */
#ifndef HEAVE_PANEL_PANEL_OPTIONS_H
#define HEAVE_PANEL_PANEL_OPTIONS_H

#include "common/usage.h"

#define OPTIONS_LIST_MAX 16u

/** What was asked for. */
typedef struct {
    bool is_help, is_version;
    const char *listen; /**< ADDRESS:PORT */
    const char *www, *state;
    const char *heaved; /**< the program, to check configurations with */
    const char *certificate, *key;
    const char *proxy;                      /**< ADDRESS; NULL: none */
    const char *platform[OPTIONS_LIST_MAX]; /**< NAME=SOCKET */
    const char *host[OPTIONS_LIST_MAX];
    unsigned platforms, hosts;
    const char *password_of; /**< the role of `passwd ROLE`; NULL: it serves */
} panel_options_t;

extern const usage_t heave_panel_usage;

/** @return an exit code: EXIT_DONE, or what was wrong was said */
int panel_options_read(panel_options_t *self, int argc, char **argv);

#endif
