/* SPDX-License-Identifier: MIT
 * fuzz_panel.c - bytes of strangers, and of a page, at heave-panel: the whole server on TCP, with a heaved that answers
 * everything. Input: records: what happens, to which of three connections, length, bytes; see step(). What must hold: a
 * connection gets one answer at most; nobody gets in, or a session, who has not the token; of strangers heaved hears nothing; the
 * session of somebody else stays; all that a page gets is whole messages; and nothing stays open.
 */
#include <arpa/inet.h>
#include <cjson/cJSON.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "fuzz.h"
#include "panel/child.h"
#include "panel/http_answer.h"

#define CONNECTIONS 3u
#define LINKS_MAX   16u
#define RECORDS_MAX 32u
#define SENT_MAX    16384u
#define GOT_MAX     (1u << 20)
#define TURNS       4u
#define PATIENCE    20000u /* turns, until what was closed is closed */
#define TOKEN       "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
#define HOST        "127.0.0.1"

static const char k_page[] = "<!doctype html><title>page</title>";
static const char k_enter[] = "GET /ws HTTP/1.1\r\nHost: " HOST "\r\nOrigin: http://" HOST
                              "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                              "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: heave-panel.1\r\n"
                              "Cookie: heave=" TOKEN "\r\n\r\n";

/* One of them, as its client sees it. */
typedef struct {
    int fd;               /* -1: none */
    bool is_used;         /* each connects once */
    bool is_page, is_raw; /* it has sent something else than whole messages */
    char *sent;
    size_t sent_length;
    char *got;
    size_t got_length;
} peer_t;

static server_t m_server;
static listener_address_t m_where;
static access_t m_access;
static pages_t m_pages;
static upstream_t m_platform;
static viewers_t m_viewers = {.platform = &m_platform};
static peer_t m_connection[CONNECTIONS];
static char m_folder[] = "/tmp/heave-fuzz-panel-XXXXXX";
static bool m_has_token; /* somebody of this input */
static unsigned m_inputs, m_handles;

/* --- Programs that work for a page: they end when the input says so --- */

static struct {
    child_end_t *end;
    void *context;
} m_child[CHILDREN_MAX];

void (*child_watch)(child_t *child);

static bool begin_child(child_end_t *end, void *context)
{
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        if (m_child[i].end == NULL) {
            m_child[i].end = end;
            m_child[i].context = context;
            return true;
        }
    }
    return false;
}

bool child_run(const char *const *argv, const char *language, child_end_t *end, void *context, int64_t now_ms)
{
    (void)language;
    (void)now_ms;
    FUZZ_REQUIRE(argv[0] != NULL);
    return begin_child(end, context);
}

bool child_work(int (*work)(void *context, int fd), void *context, child_end_t *end, int64_t now_ms)
{
    (void)work;
    (void)now_ms;
    return begin_child(end, context);
}

unsigned child_count(child_end_t *end)
{
    unsigned count = 0;
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        count += m_child[i].end == end;
    }
    return count;
}

void child_forget(const void *context)
{
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        m_child[i].context = m_child[i].context == context ? NULL : m_child[i].context;
    }
}

bool child_readable(child_t *child)
{
    (void)child;
    return false;
}

void child_closed(child_t *child)
{
    (void)child;
}

void child_watch_time(int64_t now_ms)
{
    (void)now_ms;
}

static void end_child(unsigned which)
{
    child_end_t *const end = m_child[which].end;
    void *const context = m_child[which].context;
    m_child[which].end = NULL;
    m_child[which].context = NULL;
    if (end != NULL && context != NULL) {
        char *const text = strdup("{\"ok\":true}");
        end(context, EXIT_FAILURE, text, strlen(text));
    }
}

/* --- A heaved that answers everything --- */

static int m_heaved;
static int m_link[LINKS_MAX];
static unsigned m_links;
static unsigned m_heard; /* requests of pages */

static void answer_line(int fd, const char *line)
{
    static const char k_status[] = "{\"ok\":true,\"state\":\"OFF\",\"tick\":1,\"now_percent\":100}\n";
    static const char k_answer[] = "{\"ok\":true,\"series\":7,\"held\":true,\"tick\":1}\n";
    const bool is_watch = strncmp(line, "watch ", 6) == 0;
    m_heard += !is_watch && strncmp(line, "tick", 4) != 0;
    (void)send(fd, is_watch ? k_status : k_answer, (is_watch ? sizeof k_status : sizeof k_answer) - 1,
               MSG_DONTWAIT | MSG_NOSIGNAL);
}

static void serve_heaved(void)
{
    int fd = -1;
    while (m_links < LINKS_MAX && (fd = accept4(m_heaved, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0) {
        m_link[m_links++] = fd;
    }
    for (unsigned i = 0; i < m_links; i++) {
        char lines[8192];
        const ssize_t got = recv(m_link[i], lines, sizeof lines - 1, MSG_DONTWAIT);
        if (got == 0 || (got < 0 && errno != EAGAIN)) {
            (void)close(m_link[i]);
            m_link[i--] = m_link[--m_links];
            continue;
        }
        lines[got > 0 ? got : 0] = '\0';
        for (char *at = lines, *end; (end = strchr(at, '\n')) != NULL; at = end + 1) {
            *end = '\0';
            answer_line(m_link[i], at);
        }
    }
}

/* --- Turns --- */

static void take_output(peer_t *self)
{
    if (self->fd >= 0 && self->got_length < GOT_MAX) {
        const ssize_t got = recv(self->fd, self->got + self->got_length, GOT_MAX - self->got_length, MSG_DONTWAIT);
        self->got_length += got > 0 ? (size_t)got : 0;
    }
}

static void turn(unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        FUZZ_REQUIRE(server_turn(false));
        serve_heaved();
        for (unsigned k = 0; k < CONNECTIONS; k++) {
            take_output(&m_connection[k]);
        }
    }
}

/* Something is not there yet: the machine may be busy. */
static void turn_late(unsigned patience)
{
    turn(1);
    if (patience % 100 == 50) {
        (void)usleep(10000);
    }
}

static unsigned count_handles(void)
{
    DIR *const folder = opendir("/proc/self/fd");
    unsigned count = 0;
    FUZZ_REQUIRE(folder != NULL);
    while (readdir(folder) != NULL) {
        count++;
    }
    (void)closedir(folder);
    return count - m_links;
}

/* The panel's ends of its links are made when they are needed. */
static unsigned count_links(void)
{
    unsigned count = 0;
    for (unsigned i = 0; i < LINKS; i++) {
        count += m_platform.link[i].fd >= 0;
    }
    return count;
}

static unsigned count_viewers(void)
{
    unsigned count = 0;
    for (const viewer_t *viewer = m_viewers.first; viewer != NULL; viewer = viewer->next) {
        count++;
    }
    return count;
}

/* --- Once --- */

static void tidy(void)
{
    char command[64];
    (void)snprintf(command, sizeof command, "rm -rf %s", m_folder);
    (void)!system(command);
}

static int a_free_port(void)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof address;
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    FUZZ_REQUIRE(bind(fd, (const struct sockaddr *)&address, length) == 0);
    FUZZ_REQUIRE(getsockname(fd, (struct sockaddr *)&address, &length) == 0);
    (void)close(fd);
    return ntohs(address.sin_port);
}

static void listen_as_heaved(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    m_heaved = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    FUZZ_REQUIRE(bind(m_heaved, (const struct sockaddr *)&address, sizeof address) == 0 && listen(m_heaved, LINKS_MAX) == 0);
}

static void start_server(void)
{
    char where[64], path[96];
    for (unsigned i = 0; i < CONNECTIONS; i++) {
        m_connection[i] = (peer_t){.fd = -1, .sent = malloc(SENT_MAX), .got = malloc(GOT_MAX)};
    }
    FUZZ_REQUIRE(mkdtemp(m_folder) != NULL);
    (void)atexit(tidy);
    (void)snprintf(path, sizeof path, "%s/heaved.sock", m_folder);
    (void)snprintf(where, sizeof where, HOST ":%d", a_free_port());
    listen_as_heaved(path);
    FUZZ_REQUIRE(listener_read(&m_where, where) && access_allow_host(&m_access, HOST));
    FUZZ_REQUIRE(upstream_init(&m_platform, "ride", path, &server_upstream_calls));
    m_access.has_password = true;
    m_viewers.platforms = 1;
    m_viewers.state = m_folder;
    m_pages.page[m_pages.count++] = (page_t){
        .path = "/index.html", .type = "text/html", .data = (unsigned char *)strdup(k_page), .length = sizeof k_page - 1};
    m_server = (server_t){.where = &m_where,
                          .state = m_folder,
                          .heaved = "/nonexistent",
                          .access = &m_access,
                          .pages = &m_pages,
                          .viewers = &m_viewers,
                          .version = "fuzz"};
    FUZZ_REQUIRE(server_open(&m_server));
    while (!m_platform.is_there || count_links() < 3) {
        turn(1);
    }
    turn(200);
}

/* --- Each input --- */

static void connect_one(peer_t *self)
{
    static unsigned number; /* a network of clients, so that no port is used up */
    struct sockaddr_in from = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(0x7F010000u + number++ % 0xFE0000u)};
    struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)m_where.port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const struct linger at_once = {.l_onoff = 1};
    self->is_used = true;
    self->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    (void)setsockopt(self->fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    FUZZ_REQUIRE(bind(self->fd, (const struct sockaddr *)&from, sizeof from) == 0);
    FUZZ_REQUIRE(connect(self->fd, (const struct sockaddr *)&to, sizeof to) == 0);
}

static void send_bytes(peer_t *self, const void *bytes, size_t length)
{
    if (self->sent_length + length > SENT_MAX) {
        return;
    }
    memcpy(self->sent + self->sent_length, bytes, length);
    self->sent_length += length;
    (void)send(self->fd, bytes, length, MSG_DONTWAIT | MSG_NOSIGNAL);
    m_has_token = m_has_token || self->is_page || memmem(self->sent, self->sent_length, TOKEN, sizeof TOKEN - 1) != NULL;
}

/* A whole text message of a browser, with a mask of zeros. */
static void send_message(peer_t *self, const uint8_t *bytes, size_t length)
{
    const bool is_long = length >= 126;
    uint8_t head[8] = {0x81, (uint8_t)(0x80 | (is_long ? 126 : length))};
    if (is_long) {
        head[2] = (uint8_t)(length >> 8);
        head[3] = (uint8_t)length;
    }
    send_bytes(self, head, is_long ? 8 : 6);
    send_bytes(self, bytes, length);
}

static void enter(peer_t *self)
{
    const bool has_session = m_access.session[0].began_s != 0;
    if (self->is_used) {
        return;
    }
    connect_one(self);
    self->is_page = true;
    send_bytes(self, k_enter, sizeof k_enter - 1);
    turn(TURNS);
    for (unsigned patience = PATIENCE; self->got_length == 0 && patience > 0; patience--) {
        turn_late(patience);
    }
    FUZZ_REQUIRE(!has_session || memmem(self->got, self->got_length, " 101 ", 5) != NULL);
}

static void leave(peer_t *self)
{
    if (self->fd >= 0) {
        turn(1);
        (void)close(self->fd);
    }
    self->fd = -1;
}

static void step(fuzz_input_t *in)
{
    const uint8_t op = fuzz_u8(in), which = fuzz_u8(in);
    peer_t *const self = &m_connection[which % CONNECTIONS];
    size_t length = fuzz_u8(in);
    length = op % 8 == 3 ? length * 16 : length;
    const uint8_t *bytes = NULL;
    switch (op % 8) {
    case 4:
        if (self->fd >= 0) {
            (void)shutdown(self->fd, SHUT_WR);
        }
        break;
    case 5:
        enter(self);
        break;
    case 6:
        end_child(which % CHILDREN_MAX);
        break;
    default:
        bytes = fuzz_bytes(in, &length);
        if (!self->is_used) {
            connect_one(self);
        }
        if (self->fd >= 0 && self->is_page && !self->is_raw && op < 0x80) {
            send_message(self, bytes, length);
        } else if (self->fd >= 0) {
            self->is_raw = true;
            send_bytes(self, bytes, length);
        }
        break;
    }
    turn(op % 8 == 7 ? 0 : TURNS); /* 7: what follows is there at the same time */
}

/* --- What must hold --- */

static unsigned count(const char *text, size_t length, const char *what)
{
    unsigned found = 0;
    for (const char *at = text; (at = memmem(at, length - (size_t)(at - text), what, strlen(what))) != NULL; at++) {
        found++;
    }
    return found;
}

static void check_stranger(const peer_t *self)
{
    FUZZ_REQUIRE(count(self->got, self->got_length, "HTTP/1.") <= 1);
    FUZZ_REQUIRE(self->got_length == 0 || strncmp(self->got, "HTTP/1.", self->got_length < 7 ? self->got_length : 7) == 0);
    if (!m_has_token) {
        FUZZ_REQUIRE(memmem(self->got, self->got_length, " 101 ", 5) == NULL);
        FUZZ_REQUIRE(count(self->got, self->got_length, "et-cookie") == count(self->got, self->got_length, "heave=;"));
    }
}

/* Behind the head whole frames without a mask; texts are one JSON object each. */
static void check_page(const peer_t *self)
{
    const char *const end = memmem(self->got, self->got_length, "\r\n\r\n", 4);
    const uint8_t *at = (const uint8_t *)(end != NULL ? end + 4 : self->got + self->got_length);
    const uint8_t *const behind = (const uint8_t *)self->got + self->got_length;
    while (self->got_length < GOT_MAX && at + 4 <= behind) {
        const unsigned kind = at[0] & 15u, size = at[1];
        FUZZ_REQUIRE(size < 127 && (kind == 1 || kind == 2 || (kind >= 8 && kind <= 10)) && (at[0] & 0x80) != 0);
        const size_t length = size == 126 ? (size_t)at[2] << 8 | at[3] : size;
        at += size == 126 ? 4 : 2;
        if (at + length > behind) {
            return; /* cut by the end */
        }
        cJSON *const json = kind == 1 ? cJSON_ParseWithLength((const char *)at, length) : NULL;
        FUZZ_REQUIRE(kind != 1 || cJSON_IsObject(json));
        cJSON_Delete(json);
        at += length;
    }
}

static void start(void)
{
    if (m_inputs++ == 0) {
        start_server();
    }
    memset(m_access.session, 0, sizeof m_access.session);
    memset(m_access.failure, 0, sizeof m_access.failure);
    memset(m_access.known, 0, sizeof m_access.known);
    memset(m_access.tries, 0, sizeof m_access.tries);
    m_access.session[0] =
        (access_session_t){.token = TOKEN, .role = LEVEL_SERVICE, .used_s = http_seconds(), .began_s = http_seconds()};
    for (unsigned i = 0; i < CONNECTIONS; i++) {
        m_connection[i] = (peer_t){.fd = -1, .sent = m_connection[i].sent, .got = m_connection[i].got};
    }
    m_has_token = false;
    m_heard = 0;
    m_handles = count_handles() - count_links(); /* the fuzzer itself opens some now and then */
}

static void finish(void)
{
    const bool has_token = m_has_token;
    turn(TURNS);
    for (unsigned i = 0; i < CHILDREN_MAX; i++) {
        end_child(i);
    }
    turn(2 * TURNS);
    for (unsigned i = 0; i < CONNECTIONS; i++) {
        (m_connection[i].is_page ? check_page : check_stranger)(&m_connection[i]);
    }
    FUZZ_REQUIRE(has_token ||
                 (m_heard == 0 && count_viewers() == 0 && m_access.session[0].began_s != 0 && m_access.session[1].began_s == 0));
    for (unsigned i = 0; i < CONNECTIONS; i++) {
        leave(&m_connection[i]);
    }
    unsigned patience = PATIENCE;
    while ((count_viewers() > 0 || count_handles() - count_links() != m_handles) && patience-- > 0) {
        turn_late(patience);
    }
    FUZZ_REQUIRE(count_viewers() == 0 && count_handles() - count_links() == m_handles);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input_t in = {data, size};
    start();
    for (unsigned i = 0; i < RECORDS_MAX && in.left > 0; i++) {
        step(&in);
    }
    finish();
    return 0;
}
