/* SPDX-License-Identifier: MIT
 * access.c - see access.h. Passwords are hashed by libcrypt (yescrypt).
 */
#include "panel/access.h"

#include <arpa/inet.h>
#include <crypt.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILE_NAME     "passwords"
#define PATH_BYTES    512u
#define LINE_BYTES    (ACCESS_HASH_MAX + 32u)
#define LEAST_LENGTH  8u
#define IDLE_S        (12 * 3600) /* a shift */
#define LONGEST_S     (7 * 24 * 3600)
#define FREE_FAILURES 5u
#define PENALTY_S     5
#define WINDOW_S      10
#define WINDOW_TRIES  20u /* each takes some 50 ms of a processor */

bool access_read_address(const char *text, char address[ACCESS_ADDRESS_MAX])
{
    struct in6_addr bytes;
    const int family = strchr(text, ':') != NULL ? AF_INET6 : AF_INET;
    return inet_pton(family, text, &bytes) == 1 && inet_ntop(family, &bytes, address, ACCESS_ADDRESS_MAX) != NULL;
}

bool access_forwarded(const char *header, char address[ACCESS_ADDRESS_MAX])
{
    char text[ACCESS_ADDRESS_MAX + 2];
    const char *const comma = strrchr(header, ',');
    const char *last = comma != NULL ? comma + 1 : header;
    last += strspn(last, " \t");
    const char *const bracket = last[0] == '[' ? strchr(last, ']') : NULL;
    const char *const colon = strchr(last, ':');
    const bool has_port = colon != NULL && strchr(colon + 1, ':') == NULL;
    const size_t length = bracket != NULL ? (size_t)(bracket - last) - 1 : has_port ? (size_t)(colon - last) : strlen(last);
    const char *const behind = bracket != NULL ? bracket + 1 : has_port ? colon : "";
    if (length >= sizeof text ||
        (behind[0] != '\0' && (behind[0] != ':' || strspn(behind + 1, "0123456789") != strlen(behind + 1)))) {
        return false;
    }
    (void)snprintf(text, sizeof text, "%.*s", (int)length, bracket != NULL ? last + 1 : last);
    return access_read_address(text, address);
}

int access_role(const char *word)
{
    for (int i = 0; i < (int)ACCESS_ROLES; i++) {
        if (strcmp(word, level_name((level_t)i)) == 0) {
            return i;
        }
    }
    return ACCESS_NOBODY;
}

static bool parse_line(access_t *self, char *line)
{
    char *const colon = strchr(line, ':');
    line[strcspn(line, "\n")] = '\0';
    if (line[0] == '\0') {
        return true;
    }
    if (colon == NULL) {
        return false;
    }
    *colon = '\0';
    const int role = access_role(line);
    if (role < 0 || colon[1] != '$' || strlen(colon + 1) >= ACCESS_HASH_MAX) {
        return false;
    }
    (void)snprintf(self->hash[role], ACCESS_HASH_MAX, "%s", colon + 1);
    self->has_password = true;
    return true;
}

bool access_load(access_t *self, const char *directory, char *why, size_t size)
{
    char path[PATH_BYTES];
    char line[LINE_BYTES];
    memset(self->hash, 0, sizeof self->hash);
    self->has_password = false;
    (void)snprintf(path, sizeof path, "%s/" FILE_NAME, directory);
    FILE *const file = fopen(path, "re");
    if (file == NULL) {
        (void)snprintf(why, size, "%s: %s", path, strerror(errno));
        return errno == ENOENT;
    }
    unsigned number = 0;
    bool is_right = true;
    while (is_right && fgets(line, sizeof line, file) != NULL) {
        number++;
        is_right = parse_line(self, line);
    }
    (void)fclose(file);
    if (!is_right) {
        (void)snprintf(why, size, "%s:%u: not `ROLE:HASH`; heave-panel passwd writes it", path, number);
    }
    return is_right;
}

/* Root sets passwords, and the service reads them with less rights: the file is whose the directory is. */
static bool hand_over(int fd, const char *directory)
{
    struct stat status;
    return geteuid() != 0 || (stat(directory, &status) == 0 && fchown(fd, status.st_uid, status.st_gid) == 0);
}

/* All roles anew, in a file of its own that then takes the place of the old one. */
static bool store(const access_t *self, const char *directory, char *why, size_t size)
{
    char path[PATH_BYTES];
    char next[PATH_BYTES + 8];
    (void)snprintf(path, sizeof path, "%s/" FILE_NAME, directory);
    (void)snprintf(next, sizeof next, "%s.new", path);
    (void)unlink(next); /* nobody's link leads elsewhere */
    const int fd = open(next, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    FILE *const file = fd >= 0 ? fdopen(fd, "w") : NULL;
    bool is_done = file != NULL && hand_over(fileno(file), directory);
    for (unsigned i = 0; is_done && i < ACCESS_ROLES; i++) {
        is_done = self->hash[i][0] == '\0' || fprintf(file, "%s:%s\n", level_name((level_t)i), self->hash[i]) > 0;
    }
    is_done = is_done && fflush(file) == 0 && fsync(fileno(file)) == 0;
    if (!is_done) {
        (void)snprintf(why, size, "%s: %s", next, strerror(errno));
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    if (is_done && rename(next, path) != 0) {
        (void)snprintf(why, size, "%s: %s", path, strerror(errno));
        return false;
    }
    return is_done;
}

bool access_set_password(const char *directory, level_t role, const char *password, char *why, size_t size)
{
    static access_t all;
    char salt[CRYPT_GENSALT_OUTPUT_SIZE];
    if (strlen(password) < LEAST_LENGTH) {
        (void)snprintf(why, size, "a password has at least %u characters", LEAST_LENGTH);
        return false;
    }
    if (!access_load(&all, directory, why, size)) {
        return false;
    }
    const char *const hash = crypt_gensalt_rn("$y$", 0, NULL, 0, salt, (int)sizeof salt) != NULL ? crypt(password, salt) : NULL;
    if (hash == NULL || hash[0] != '$' || strlen(hash) >= ACCESS_HASH_MAX) {
        (void)snprintf(why, size, "libcrypt: %s", strerror(errno));
        return false;
    }
    (void)snprintf(all.hash[role], ACCESS_HASH_MAX, "%s", hash);
    (void)mkdir(directory, 0700); /* the service has not run yet */
    return store(&all, directory, why, size);
}

bool access_allow_host(access_t *self, const char *name)
{
    if (self->hosts == ACCESS_HOSTS_MAX || strlen(name) >= ACCESS_HOST_MAX || name[0] == '\0') {
        return false;
    }
    (void)snprintf(self->host[self->hosts++], ACCESS_HOST_MAX, "%s", name);
    return true;
}

/* Length of a Host header without its port. */
static size_t name_length(const char *host)
{
    const char *const bracket = host[0] == '[' ? strchr(host, ']') : NULL;
    if (bracket != NULL && bracket[1] != '\0' && bracket[1] != ':') {
        return strlen(host); /* no address, whatever it is */
    }
    return bracket != NULL ? (size_t)(bracket + 1 - host) : strcspn(host, ":");
}

bool access_is_host(const access_t *self, const char *host)
{
    const size_t length = name_length(host);
    for (unsigned i = 0; i < self->hosts; i++) {
        if (strlen(self->host[i]) == length && strncasecmp(self->host[i], host, length) == 0) {
            return true;
        }
    }
    return false;
}

bool access_is_own_origin(const char *origin, const char *host, bool is_secure)
{
    const char *const slashes = strstr(origin, "://");
    const bool is_web = (!is_secure && strncmp(origin, "http://", 7) == 0) || strncmp(origin, "https://", 8) == 0;
    return is_web && slashes != NULL && strcasecmp(slashes + 3, host) == 0;
}

/* Compares without telling by its time how much of it was right. */
static bool is_same(const char *a, const char *b)
{
    const size_t length = strlen(a);
    unsigned difference = strlen(b) != length;
    for (size_t i = 0; difference == 0 && i < length; i++) {
        difference |= (unsigned)(a[i] ^ b[i]);
    }
    for (size_t i = 0; i < length && strlen(b) == length; i++) {
        difference |= (unsigned)(a[i] ^ b[i]);
    }
    return difference == 0;
}

static access_failure_t *failure_of(access_t *self, const char *address)
{
    access_failure_t *oldest = &self->failure[0];
    for (unsigned i = 0; i < ACCESS_SESSIONS_MAX; i++) {
        access_failure_t *const one = &self->failure[i];
        if (strcmp(one->address, address) == 0) {
            return one;
        }
        oldest = one->last_s < oldest->last_s ? one : oldest;
    }
    *oldest = (access_failure_t){.failures = 0};
    (void)snprintf(oldest->address, sizeof oldest->address, "%s", address);
    return oldest;
}

static bool may_try(access_t *self, const access_failure_t *failure, bool is_known, int64_t now_s)
{
    if (now_s - self->window_s >= WINDOW_S) {
        self->window_s = now_s;
        self->tries[false] = self->tries[true] = 0;
    }
    const bool is_penalised = failure->failures >= FREE_FAILURES && now_s - failure->last_s < PENALTY_S;
    return !is_penalised && self->tries[is_known] < WINDOW_TRIES;
}

/* Somebody has logged in from there: tries of strangers, however many addresses they have, do not use up its own. */
static bool is_known(const access_t *self, const char *address)
{
    for (unsigned i = 0; i < ACCESS_KNOWN_MAX; i++) {
        if (strcmp(self->known[i], address) == 0) {
            return true;
        }
    }
    return false;
}

static void know(access_t *self, const char *address)
{
    if (!is_known(self, address)) {
        (void)snprintf(self->known[self->next_known++ % ACCESS_KNOWN_MAX], ACCESS_ADDRESS_MAX, "%s", address);
    }
}

static bool make_token(char token[ACCESS_TOKEN_MAX])
{
    uint8_t bytes[32];
    if (getrandom(bytes, sizeof bytes, 0) != (ssize_t)sizeof bytes) {
        return false;
    }
    for (unsigned i = 0; i < sizeof bytes; i++) {
        (void)snprintf(&token[2 * i], 3, "%02x", bytes[i]);
    }
    return true;
}

/* A free place, else that of the session that was not used for longest. */
static access_session_t *place(access_t *self)
{
    access_session_t *oldest = &self->session[0];
    for (unsigned i = 0; i < ACCESS_SESSIONS_MAX; i++) {
        access_session_t *const one = &self->session[i];
        if (one->began_s == 0) {
            return one;
        }
        oldest = one->used_s < oldest->used_s ? one : oldest;
    }
    return oldest;
}

bool access_begin(access_t *self, const char *address, int64_t now_s)
{
    access_failure_t *const failure = failure_of(self, address);
    const bool has_own = is_known(self, address);
    if (!may_try(self, failure, has_own, now_s)) {
        return false;
    }
    self->tries[has_own]++;
    failure->failures++; /* until it is known to be right: several may be looked at together */
    failure->last_s = now_s;
    return true;
}

bool access_is_right(const access_t *self, level_t role, const char *password)
{
    const char *const wanted = self->hash[role];
    const char *const got = wanted[0] != '\0' ? crypt(password, wanted) : NULL;
    return got != NULL && is_same(got, wanted);
}

bool access_enter(access_t *self, level_t role, const char *address, int64_t now_s, char token[ACCESS_TOKEN_MAX])
{
    if (!make_token(token)) {
        return false;
    }
    failure_of(self, address)->failures = 0;
    know(self, address);
    access_session_t *const session = place(self);
    *session = (access_session_t){.role = role, .used_s = now_s, .began_s = now_s > 0 ? now_s : 1};
    (void)snprintf(session->token, sizeof session->token, "%s", token);
    return true;
}

static access_session_t *session_of(access_t *self, const char *token)
{
    for (unsigned i = 0; i < ACCESS_SESSIONS_MAX; i++) {
        if (self->session[i].began_s != 0 && is_same(self->session[i].token, token)) {
            return &self->session[i];
        }
    }
    return NULL;
}

int access_find(access_t *self, const char *token, int64_t now_s)
{
    access_session_t *const session = session_of(self, token);
    if (session == NULL) {
        return ACCESS_NOBODY;
    }
    if (now_s - session->used_s > IDLE_S || now_s - session->began_s > LONGEST_S) {
        *session = (access_session_t){.began_s = 0};
        return ACCESS_NOBODY;
    }
    session->used_s = now_s;
    return (int)session->role;
}

void access_logout(access_t *self, const char *token)
{
    access_session_t *const session = session_of(self, token);
    if (session != NULL) {
        *session = (access_session_t){.began_s = 0};
    }
}
