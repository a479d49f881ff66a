/* SPDX-License-Identifier: MIT
 * access.h - who may do what at the panel: passwords of the roles, sessions, names that a browser may call it by, and how often
 * somebody may try. Time is an argument, in s.
 */
#ifndef HEAVE_PANEL_ACCESS_H
#define HEAVE_PANEL_ACCESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "service/access_levels.h"

#define ACCESS_TOKEN_MAX    65u
#define ACCESS_SESSIONS_MAX 64u
#define ACCESS_HOSTS_MAX    16u
#define ACCESS_HOST_MAX     128u
#define ACCESS_HASH_MAX     256u
#define ACCESS_ROLES        3u
#define ACCESS_ADDRESS_MAX  46u
#define ACCESS_NOBODY       (-1)

/** A session. */
typedef struct {
    char token[ACCESS_TOKEN_MAX];
    level_t role;
    int64_t used_s;
    int64_t began_s; /**< 0: free */
} access_session_t;

/** Somebody whose password was wrong. */
typedef struct {
    char address[ACCESS_ADDRESS_MAX];
    unsigned failures;
    int64_t last_s;
} access_failure_t;

/** All of it. */
typedef struct {
    char hash[ACCESS_ROLES][ACCESS_HASH_MAX]; /**< "": the role has no password */
    bool has_password;                        /**< any of them; else everybody on this machine is service */
    char host[ACCESS_HOSTS_MAX][ACCESS_HOST_MAX];
    unsigned hosts;
    access_session_t session[ACCESS_SESSIONS_MAX];
    access_failure_t failure[ACCESS_SESSIONS_MAX];
    int64_t window_s; /**< passwords are compared so often in ten seconds: */
    unsigned tries;
} access_t;

/** What came of a login. */
typedef enum { ACCESS_IN, ACCESS_WRONG, ACCESS_TOO_OFTEN } access_login_t;

/** Reads the passwords of a state directory; none is no error.
 *  @return false: the file is there and cannot be read, or is not one of ours; why says so */
bool access_load(access_t *self, const char *directory, char *why, size_t size);

/** Sets the password of a role. @return false, and why */
bool access_set_password(const char *directory, level_t role, const char *password, char *why, size_t size);

/** A name that a browser may call the panel by, without its port. */
bool access_allow_host(access_t *self, const char *name);

/** Whether a Host header is one of these names. */
bool access_is_host(const access_t *self, const char *host);

/** Whether an Origin header is the page of that Host itself. */
bool access_is_own_origin(const char *origin, const char *host);

/** A role of a word: "look", "operate", "service"; ACCESS_NOBODY for others. */
int access_role(const char *word);

access_login_t access_login(access_t *self, level_t role, const char *password, const char *address, int64_t now_s,
                            char token[ACCESS_TOKEN_MAX]);

/** The role of a token, ACCESS_NOBODY where it is none (any more). */
int access_find(access_t *self, const char *token, int64_t now_s);

void access_logout(access_t *self, const char *token);

#endif
