/* SPDX-License-Identifier: MIT
 * access.h - who may do what at the panel: the passwords of the roles, the sessions, the host names of the panel, and the
 * limits on login attempts. Time is an argument, in s.
 */
#ifndef HEAVE_PANEL_ACCESS_H
#define HEAVE_PANEL_ACCESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "service/access_levels.h"

#define ACCESS_TOKEN_MAX    65u
#define ACCESS_SESSIONS_MAX 64u
#define ACCESS_KNOWN_MAX    32u
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

/** An address that has sent wrong passwords. */
typedef struct {
    char address[ACCESS_ADDRESS_MAX];
    unsigned failures;
    int64_t last_s;
} access_failure_t;

/** Everything that decides about access. */
typedef struct {
    char hash[ACCESS_ROLES][ACCESS_HASH_MAX]; /**< "": the role has no password */
    bool has_password; /**< a role has a password. If none has one, everybody on this machine has the role service */
    char host[ACCESS_HOSTS_MAX][ACCESS_HOST_MAX];
    unsigned hosts;
    access_session_t session[ACCESS_SESSIONS_MAX];
    access_failure_t failure[ACCESS_SESSIONS_MAX];
    int64_t window_s;                                 /**< begin of the present ten seconds */
    unsigned tries[2];                                /**< passwords compared since window_s, [1] from known addresses */
    char known[ACCESS_KNOWN_MAX][ACCESS_ADDRESS_MAX]; /**< addresses of the newest logins */
    unsigned next_known;
} access_t;

/** Reads the passwords of a state directory. A missing file is no error.
 *  @return false: the file cannot be read, or has another format; `why` tells which */
bool access_load(access_t *self, const char *directory, char *why, size_t size);

/** Sets the password of a role. @return false, and why */
bool access_set_password(const char *directory, level_t role, const char *password, char *why, size_t size);

/** Adds a host name that browsers may use for the panel; without port. */
bool access_allow_host(access_t *self, const char *name);

/** Whether a Host header is one of these names. */
bool access_is_host(const access_t *self, const char *host);

/** Whether an Origin header names the same host as the Host header.
 *  @param is_secure the page came over TLS: one that came without it is somebody else's who sits between */
bool access_is_own_origin(const char *origin, const char *host, bool is_secure);

/** The address that a proxy has added to X-Forwarded-For: the last one, with or without a port; what stands before it anybody can
 * say.
 *  @return false: it is no address, and `address` is as before */
bool access_forwarded(const char *header, char address[ACCESS_ADDRESS_MAX]);

/** Writes an address in the one form that the system gives it. @return false: it is none */
bool access_read_address(const char *text, char address[ACCESS_ADDRESS_MAX]);

/** The role that a word names: "look", "operate", "service"; ACCESS_NOBODY for other words. */
int access_role(const char *word);

/** Counts a try of an address. @return false: there were too many, and the password is not looked at */
bool access_begin(access_t *self, const char *address, int64_t now_s);

/** Compares a password; takes some 50 ms of a processor, and changes nothing: not for the thread that passes beats on. */
bool access_is_right(const access_t *self, level_t role, const char *password);

/** Begins a session. @param address whose try was right
 *  @return false: there is no random token to be had */
bool access_enter(access_t *self, level_t role, const char *address, int64_t now_s, char token[ACCESS_TOKEN_MAX]);

/** The role of a token; ACCESS_NOBODY if the token is not valid, or not any more. */
int access_find(access_t *self, const char *token, int64_t now_s);

void access_logout(access_t *self, const char *token);

#endif
