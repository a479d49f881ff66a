/* SPDX-License-Identifier: MIT
 * fuzz_control.c - requests on the control socket. Input: records: what happens, to which of two clients, length, bytes; see
 * step(). What must hold: everything a client gets is lines of one JSON object each; every line it sends gets one answer, in the
 * end, but a `watch`, which gets the status again and again; the motion thread is asked for just what the lines ask for.
 */
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cjson/cJSON.h>

#include "platform/load.h"
#include "fuzz.h"
#include "record/service_words.h"
#include "service/control.h"
#include "service/operator_requests.h"

#define CLIENTS     2u
#define RECORDS_MAX 40u
#define PATIENCE    2000u    /* rounds at the end until everything has been answered */
#define ROUND_US    3000000u /* longer than anything waits but for a disk */

typedef struct {
    int fd;                         /* our end */
    char line[CONTROL_REQUEST_MAX]; /* being sent */
    size_t length;
    bool is_over; /* nothing it sends counts any more */
    bool is_watching;
    long due;      /* answers */
    long requests; /* of the motion thread */
    long answers;
    char got[CONTROL_OUT_BYTES * 4];
    size_t got_length;
} client_t;

static config_t m_config;
static handover_t m_handover;
static blackbox_t m_blackbox; /* there is none */
static control_t m_control;
static operator_log_t m_log; /* there is none: it takes no entry */
static client_t m_client[CLIENTS];
static uint64_t m_now_us;
static long m_asked; /* of the motion thread */
static long m_stale; /* requests that were too old for it, or came before a hold */

/* --- What the lines ask for, read anew --- */

static bool is_number(const char *text, long least, long most)
{
    const size_t digits = strspn(text, "0123456789");
    return digits >= 1 && digits <= 3 && text[digits] == '\0' && atol(text) >= least && atol(text) <= most;
}

/* Behind `heard TICK `. */
static const char *behind_tick(const char *line)
{
    const size_t digits = strncmp(line, "heard ", 6) == 0 ? strspn(line + 6, "0123456789") : 0;
    return digits >= 1 && digits <= 18 && line[6 + digits] == ' ' ? line + 7 + digits : line;
}

static const char *behind_blanks(const char *line)
{
    return line + strspn(line, " ");
}

static void expect_line(client_t *client, const char *said)
{
    const char *const line = behind_blanks(behind_tick(behind_blanks(said)));
    static const char *const k_requests[] = {"engage", "hold", "resume", "park", "reset", "shutdown", "service", "service-off"};
    if (strcmp(line, "watch") == 0 || (strncmp(line, "watch ", 6) == 0 && is_number(line + 6, 1, CONTROL_WATCH_MAX_HZ))) {
        client->is_watching = true;
        return;
    }
    client->due++;
    for (unsigned i = 0; i < sizeof k_requests / sizeof k_requests[0]; i++) {
        client->requests += strcmp(line, k_requests[i]) == 0;
    }
    client->requests += strncmp(line, "intensity ", 10) == 0 && is_number(line + 10, 0, 999);
    if (service_words_are(line, strlen(line))) { /* unit.service_words says what is one */
        service_request_t request;
        uint64_t tick_us = 0;
        client->requests += service_words_read(line, strlen(line), false, &request, &tick_us) == NULL;
    }
}

static void expect(client_t *client, const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length && !client->is_over; i++) {
        if (bytes[i] == '\n') {
            client->length -= client->length > 0 && client->line[client->length - 1] == '\r';
            const bool has_zero = memchr(client->line, '\0', client->length) != NULL;
            client->line[client->length] = '\0';
            client->length = 0;
            if (has_zero) {
                client->due++; /* no request is like that: what stands behind the zero counts, too */
            } else {
                expect_line(client, client->line);
            }
        } else {
            client->line[client->length++] = (char)bytes[i];
            client->is_over = client->length == CONTROL_REQUEST_MAX; /* told once that it is too long */
            client->due += client->is_over;
        }
    }
}

/* --- What the clients get --- */

static void check_line(client_t *client, const char *line, size_t length)
{
    cJSON *json = cJSON_ParseWithLength(line, length);
    FUZZ_REQUIRE(cJSON_IsObject(json));
    const cJSON *ok = cJSON_GetObjectItemCaseSensitive(json, "ok");
    const bool is_status = cJSON_GetObjectItemCaseSensitive(json, "counters") != NULL;
    const cJSON *error = cJSON_GetObjectItemCaseSensitive(json, "error");
    m_stale += cJSON_IsString(error) && (strstr(error->valuestring, "asked more than 1 s ago") != NULL ||
                                         strstr(error->valuestring, "a hold came after it was asked") != NULL);
    FUZZ_REQUIRE(is_status || cJSON_IsTrue(ok) || cJSON_IsString(cJSON_GetObjectItemCaseSensitive(json, "error")));
    client->answers += !(is_status && client->is_watching);
    cJSON_Delete(json);
}

static void take_output(client_t *client)
{
    const ssize_t got = recv(client->fd, client->got + client->got_length, sizeof client->got - client->got_length, MSG_DONTWAIT);
    char *newline = NULL;
    client->got_length += got > 0 ? (size_t)got : 0;
    while ((newline = memchr(client->got, '\n', client->got_length)) != NULL) {
        const size_t length = (size_t)(newline - client->got);
        check_line(client, client->got, length);
        client->got_length -= length + 1;
        memmove(client->got, newline + 1, client->got_length);
    }
}

/* --- What happens --- */

static void serve(uint64_t us)
{
    struct pollfd fds[CONTROL_FDS];
    m_now_us += us;
    control_fill(&m_control, fds, m_now_us);
    FUZZ_REQUIRE(control_timeout_ms(&m_control, m_now_us, 100) <= 100);
    (void)poll(fds, CONTROL_FDS, 0);
    control_serve(&m_control, fds, m_now_us);
    for (unsigned i = 0; i < CLIENTS; i++) {
        take_output(&m_client[i]);
        FUZZ_REQUIRE(m_control.client[i].out_length <= CONTROL_OUT_BYTES);
    }
}

/* The motion thread takes its requests and answers them. */
static void answer_requests(uint8_t how)
{
    static const hv_status_t k_status[] = {HV_OK, HV_ERR_STATE, HV_ERR_RANGE, HV_OK};
    motion_request_t request;
    while (ring_pop(&m_handover.requests, &request, sizeof request) > 0) {
        static motion_result_t result;
        FUZZ_REQUIRE(request.event <= OPERATOR_SERVICE && request.number <= 999);
        FUZZ_REQUIRE((request.event == OPERATOR_SERVICE) == (request.service.verb != SERVICE_NOTHING));
        FUZZ_REQUIRE(!service_is_held(request.service.verb) || request.service.series > 0);
        m_asked++;
        result = (motion_result_t){.id = request.id,
                                   .status = k_status[how % 4],
                                   .missing = how >= 0xF0 ? PERMIT_KEY : 0,
                                   .answer = (service_answer_t)(how % SERVICE_ANSWERS)};
        result.snapshot.state = (state_t)(how % STATES);
        (void)ring_push(&m_handover.results, &result, sizeof result, NULL, 0);
    }
}

static void change_state(uint8_t how)
{
    static motion_view_words_t view;
    view.view.snapshot.state = (state_t)(how % STATES);
    view.view.is_shutting_down = how >= 0x80;
    seqlock_write(&m_handover.view, view.word);
}

static void step(fuzz_input_t *in)
{
    const uint8_t op = fuzz_u8(in), which = fuzz_u8(in);
    client_t *client = &m_client[which % CLIENTS];
    size_t length = fuzz_u8(in);
    const uint8_t *bytes = NULL;
    switch (op % 4) {
    case 0:
    case 1:
        bytes = fuzz_bytes(in, &length);
        if (length > 0 && send(client->fd, bytes, length, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)length) {
            expect(client, bytes, length);
        }
        break;
    case 2:
        answer_requests((uint8_t)length);
        break;
    default:
        change_state((uint8_t)length);
        break;
    }
    serve(op >= 0x80 ? (uint64_t)which * 10000 : 1000);
}

/* --- Once per input --- */

static void start(void)
{
    if (m_config.settings.cycle_us == 0) {
        FUZZ_REQUIRE(config_load(HEAVE_CONFIG_DIR "/demo-hexapod.ini", &m_config, stderr) == 0);
    }
    handover_init(&m_handover);
    memset(&m_control, 0, sizeof m_control);
    control_init(&m_control);
    m_control.handover = &m_handover;
    m_control.config = &m_config;
    m_control.blackbox = &m_blackbox;
    m_control.log = &m_log;
    m_now_us = 1000000;
    m_asked = m_stale = 0;
    for (unsigned i = 0; i < CLIENTS; i++) {
        int ends[2];
        FUZZ_REQUIRE(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends) == 0);
        m_client[i].fd = ends[0];
        m_client[i].length = m_client[i].got_length = 0;
        m_client[i].is_over = m_client[i].is_watching = false;
        m_client[i].due = m_client[i].requests = m_client[i].answers = 0;
        m_control.client[i].fd = ends[1];
        m_control.client[i].peer.level = LEVEL_SERVICE;
    }
    change_state(0);
}

static long requests_of_all(void)
{
    long requests = 0;
    for (unsigned i = 0; i < CLIENTS; i++) {
        requests += m_client[i].requests;
    }
    return requests;
}

static bool is_answer_due(void)
{
    bool is_due = m_asked + m_stale < requests_of_all();
    for (unsigned i = 0; i < CLIENTS; i++) {
        is_due |= m_client[i].answers < m_client[i].due && !m_client[i].is_watching;
    }
    return is_due;
}

static void finish(void)
{
    for (unsigned round = 0; round < PATIENCE && (round == 0 || is_answer_due()); round++) {
        answer_requests(0);
        serve(ROUND_US);
    }
    for (unsigned i = 0; i < CLIENTS; i++) {
        client_t *client = &m_client[i];
        FUZZ_REQUIRE(client->got_length == 0); /* whole lines */
        FUZZ_REQUIRE(client->answers == client->due || (client->is_watching && client->answers <= client->due));
        (void)close(client->fd);
        if (m_control.client[i].fd >= 0) {
            (void)close(m_control.client[i].fd);
        }
    }
    /* what is too old or void is told so before its words are judged */
    FUZZ_REQUIRE(m_asked <= requests_of_all() && m_asked + m_stale >= requests_of_all());
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
