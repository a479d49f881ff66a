/* SPDX-License-Identifier: MIT
 * setup_session.c - see setup_session.h.
 */
#include "heavectl/setup_session.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/presets.h"
#include "common/sentence.h"
#include "common/translate.h"
#include "heavectl/neighbours.h"

#define START_MS   30000 /* until the drives of a bus are there */
#define TORQUE_MS  15000
#define END_MS     15000
#define LOOK_MS    100
#define SETTLED_MS 2000 /* after its start heaved knows its inputs */
#define NOT_RUN    127
#define USUAL_PORT 9800

static void pause_ms(long ms)
{
    const struct timespec pause = {.tv_nsec = ms * 1000000L};
    (void)nanosleep(&pause, NULL);
}

static bool fail(setup_session_t *self, const char *what, const char *why)
{
    (void)snprintf(self->error, sizeof self->error, "%.400s%s%.1600s", what, why[0] != '\0' ? _(": ") : "", why);
    return false;
}

/* --- Folder and programs --- */

/* The heaved that was built or installed with this heavectl; else the one that the shell would find. */
static void find_program(setup_session_t *self)
{
    const ssize_t length = readlink("/proc/self/exe", self->program, sizeof self->program - sizeof "heaved");
    char *slash = NULL;
    if (length > 0) {
        self->program[length] = '\0';
        slash = strrchr(self->program, '/');
    }
    if (slash != NULL) {
        memcpy(slash + 1, "heaved", sizeof "heaved");
    }
    if (slash == NULL || access(self->program, X_OK) != 0) {
        memcpy(self->program, "heaved", sizeof "heaved");
    }
}

bool setup_session_open(setup_session_t *self, const volatile sig_atomic_t *is_interrupted)
{
    self->is_interrupted = is_interrupted;
    self->link.is_interrupted = is_interrupted;
    self->link.fd = -1;
    self->pid = 0;
    self->jog[0] = '\0';
    find_program(self);
    (void)snprintf(self->folder, sizeof self->folder, "/tmp/heave-setup-XXXXXX");
    if (mkdtemp(self->folder) == NULL) {
        return fail(self, self->folder, error_text(errno));
    }
    (void)snprintf(self->config, sizeof self->config, "%s/setup.ini", self->folder);
    (void)snprintf(self->socket, sizeof self->socket, "%s/heaved.sock", self->folder);
    (void)snprintf(self->log, sizeof self->log, "%s/log", self->folder);
    return true;
}

void setup_session_close(setup_session_t *self)
{
    setup_session_stop(self);
    (void)unlink(self->config);
    (void)unlink(self->socket);
    (void)unlink(self->log);
    (void)rmdir(self->folder);
}

static bool write_config(setup_session_t *self, const ini_text_t *config)
{
    FILE *file = fopen(self->config, "we");
    if (config->is_cut) {
        errno = EFBIG;
    }
    const bool is_written = file != NULL && !config->is_cut && fputs(config->text, file) >= 0;
    return (file == NULL || fclose(file) == 0) && is_written;
}

/* What a child writes, as long as it runs. @return 0, or errno: it is not all of it */
static int collect(setup_session_t *self, int fd)
{
    size_t length = 0;
    ssize_t got = 0;
    char rest[256];
    do {
        const size_t room = sizeof self->output - 1u - length;
        got = read(fd, room > 0 ? &self->output[length] : rest, room > 0 ? room : sizeof rest);
        length += room > 0 && got > 0 ? (size_t)got : 0;
    } while (got > 0 || (got < 0 && errno == EINTR));
    const int error = got < 0 ? errno : 0;
    self->output[length] = '\0';
    return error;
}

/* Runs the program with what it says kept. Returns its exit code; -1: it was not run, which has been said. */
static int run_program(setup_session_t *self, char *const arguments[])
{
    int ends[2], status = 0;
    if (pipe2(ends, O_CLOEXEC) != 0) {
        (void)fail(self, "pipe", error_text(errno));
        return -1;
    }
    const pid_t pid = fork();
    const int fork_error = pid < 0 ? errno : 0;
    if (pid == 0) {
        (void)dup2(ends[1], STDOUT_FILENO);
        (void)dup2(ends[1], STDERR_FILENO);
        (void)execvp(self->program, arguments);
        _exit(NOT_RUN);
    }
    (void)close(ends[1]);
    const int collect_error = collect(self, ends[0]);
    const int error = fork_error != 0 ? fork_error : collect_error;
    (void)close(ends[0]);
    while (pid > 0 && waitpid(pid, &status, 0) < 0 && errno == EINTR) {}
    if (error != 0 || !WIFEXITED(status) || WEXITSTATUS(status) == NOT_RUN) {
        (void)fail(self, self->program, error != 0 ? error_text(error) : _("cannot be run"));
        return -1;
    }
    return WEXITSTATUS(status);
}

int setup_session_run(setup_session_t *self, const ini_text_t *config, const char *const *options)
{
    char *arguments[8] = {self->program};
    unsigned count = 1;
    if (config != NULL && !write_config(self, config)) {
        (void)fail(self, self->config, error_text(errno));
        return -1;
    }
    if (config != NULL) {
        arguments[count++] = (char *)"--config";
        arguments[count++] = self->config;
    }
    for (; *options != NULL && count < 7u; options++) {
        arguments[count++] = (char *)(uintptr_t)*options;
    }
    return run_program(self, arguments);
}

/* --- What it begins from --- */

bool setup_session_load(setup_session_t *self, setup_t *setup)
{
    char path[4096];
    const char *start = setup_get(setup, "start"), *kind = setup_get(setup, "kind");
    if (start == NULL) {
        return true;
    }
    if (strcmp(start, "none") != 0) {
        const bool is_path = strchr(start, '/') != NULL;
        if (!is_path && !presets_path(start, path, sizeof path)) {
            return fail(self, start, _("no such platform"));
        }
        return ini_text_read(&setup->start, is_path ? start : path) || fail(self, is_path ? start : path, error_text(errno));
    }
    const char *driver = setup_driver(setup);
    const char *const options[] = {"--template", kind != NULL ? kind : "hexapod", driver[0] != '\0' ? driver : "sim", NULL};
    const int code = setup_session_run(self, NULL, options);
    if (code < 0) {
        return false; /* why is said already */
    }
    if (code != 0) {
        return fail(self, self->program, self->output);
    }
    ini_text_load(&setup->start, self->output);
    return true;
}

/* --- heaved --- */

/* A port that nobody has: this heaved hears no sender. */
static unsigned free_port(void)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const bool has_port = fd >= 0 && bind(fd, (const struct sockaddr *)&address, sizeof address) == 0 &&
                          getsockname(fd, (struct sockaddr *)&address, &size) == 0;
    if (fd >= 0) {
        (void)close(fd);
    }
    return has_port ? ntohs(address.sin_port) : USUAL_PORT;
}

/* Files, sockets and ports of the machine are not for a heaved that is there for a while. */
static void make_private(ini_text_t *config)
{
    static const char *const k_dropped[][2] = {{"platform", "life_file"},
                                               {"platform", "approved"},
                                               {"control", "socket"},
                                               {"control", "look_socket"},
                                               {"control", "metrics"},
                                               {"control", "operator_log"},
                                               {"control", "operate_group"},
                                               {"control", "service_group"},
                                               {"black-box", "directory"},
                                               {"service", "selftest"},
                                               {"udp", "group"}};
    char port[16];
    (void)snprintf(port, sizeof port, "%u", free_port());
    for (size_t i = 0; i < sizeof k_dropped / sizeof k_dropped[0]; i++) {
        ini_text_drop(config, k_dropped[i][0], k_dropped[i][1]);
    }
    ini_text_set(config, "platform", "engage", "manual", NULL);
    ini_text_set(config, "geometry", "mrp_mm", "0, 0, 0", NULL); /* a pose is then where the plate's joints are */
    ini_text_set(config, "udp", "bind", "127.0.0.1", NULL);
    ini_text_set(config, "udp", "port", port, NULL);
}

static void be_heaved(const setup_session_t *self, pid_t parent)
{
    const int log = open(self->log, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600),
              null = log >= 0 ? open("/dev/null", O_RDONLY | O_CLOEXEC) : -1;
    if (log < 0 || null < 0) {
        fprintf(stderr, "heavectl: setup: %s: %s\n", log < 0 ? self->log : "/dev/null", error_text(errno));
    }
    (void)setpgid(0, 0); /* Ctrl-C is for setup */
    (void)prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() == parent && log >= 0 && null >= 0) {
        (void)dup2(null, STDIN_FILENO);
        (void)dup2(log, STDOUT_FILENO);
        (void)dup2(log, STDERR_FILENO);
        (void)execlp(self->program, self->program, "--config", self->config, "--socket", self->socket, (char *)NULL);
    }
    _exit(NOT_RUN);
}

void setup_session_stop(setup_session_t *self)
{
    const int64_t until_ms = heaved_link_now_ms() + END_MS;
    if (self->link.fd >= 0) {
        (void)close(self->link.fd);
        self->link.fd = -1;
    }
    if (self->pid > 0) {
        (void)kill(self->pid, SIGTERM);
        while (waitpid(self->pid, NULL, WNOHANG) == 0) {
            if (heaved_link_now_ms() > until_ms) {
                (void)kill(self->pid, SIGTERM); /* a second one ends at once */
            }
            pause_ms(LOOK_MS / 2);
        }
    }
    self->pid = 0;
}

/* The last lines of the log say why. */
static bool fail_by_log(setup_session_t *self)
{
    char text[1024];
    FILE *log = fopen(self->log, "re");
    text[0] = '\0';
    if (log != NULL) {
        (void)fseek(log, 0, SEEK_END);
        const long size = ftell(log);
        (void)fseek(log, size > (long)sizeof text - 1 ? size - (long)sizeof text + 1 : 0, SEEK_SET);
        const size_t length = fread(text, 1, sizeof text - 1u, log);
        text[length] = '\0';
    }
    if (log == NULL || ferror(log) != 0) {
        (void)snprintf(text, sizeof text, "%.400s: %s", self->log, error_text(errno));
    }
    if (log != NULL) {
        (void)fclose(log);
    }
    return fail(self, _("heaved has ended"), text);
}

static bool is_running(setup_session_t *self)
{
    if (self->pid > 0 && waitpid(self->pid, NULL, WNOHANG) == self->pid) {
        self->pid = 0;
    }
    return self->pid > 0;
}

/* What the drives say that are not there. */
bool setup_session_fail(setup_session_t *self, const char *what)
{
    char text[SETUP_TEXT_MAX / 2], one[SENTENCE_MAX], other[SENTENCE_MAX];
    size_t length = 0;
    unsigned number = 0;
    const cJSON *drive = NULL;
    cJSON *status = heaved_link_ask(&self->link, "status");
    const cJSON *fault = cJSON_GetObjectItemCaseSensitive(status, "fault");
    text[0] = '\0';
    if (heaved_link_number(fault, "code") > 0) {
        length += (size_t)snprintf(text, sizeof text, _("%s. "), sentence(heaved_link_text(fault, "text"), one, sizeof one));
    }
    cJSON_ArrayForEach(drive, cJSON_GetObjectItemCaseSensitive(status, "cylinders"))
    {
        const char *state = heaved_link_text(drive, "drive");
        const cJSON *report = cJSON_GetObjectItemCaseSensitive(drive, "report");
        number++;
        if ((strcmp(state, "offline") == 0 || strcmp(state, "fault") == 0) && length < sizeof text - 400u) {
            length += (size_t)snprintf(&text[length], sizeof text - length, _("Drive %u is %s: %.120s %.180s. "), number,
                                       _(state), sentence(heaved_link_text(report, "trouble"), one, sizeof one),
                                       sentence(heaved_link_text(report, "detail"), other, sizeof other));
        }
    }
    cJSON_Delete(status);
    return fail(self, what, text);
}

unsigned setup_session_counts(setup_session_t *self, double *counts, double *actual_mm)
{
    unsigned number = 0, known = 0;
    const cJSON *drive = NULL;
    cJSON *answer = heaved_link_ask(&self->link, "counts");
    cJSON_ArrayForEach(drive, cJSON_GetObjectItemCaseSensitive(answer, "drives"))
    {
        const cJSON *count = cJSON_GetObjectItemCaseSensitive(drive, "counts");
        const cJSON *actual = cJSON_GetObjectItemCaseSensitive(drive, "actual_mm");
        const bool is_known =
            cJSON_IsNumber(count) && cJSON_IsNumber(actual) && strcmp(heaved_link_text(drive, "state"), "offline") != 0;
        if (number < SETUP_DRIVES_MAX && counts != NULL) {
            counts[number] = heaved_link_number(drive, "counts");
        }
        if (number < SETUP_DRIVES_MAX && actual_mm != NULL) {
            actual_mm[number] = heaved_link_number(drive, "actual_mm");
        }
        known += is_known;
        number++;
    }
    cJSON_Delete(answer);
    return known == number && number <= SETUP_DRIVES_MAX ? number : 0;
}

/* Starts it, and waits until the drives are there. */
static bool start(setup_session_t *self, const ini_text_t *config, bool is_bus)
{
    const int64_t until_ms = heaved_link_now_ms() + START_MS;
    setup_session_stop(self);
    self->on = *config;
    static ini_text_t private;
    private = *config;
    make_private(&private);
    if (!write_config(self, &private)) {
        return fail(self, self->config, error_text(errno));
    }
    const pid_t parent = getpid();
    self->started_ms = heaved_link_now_ms();
    self->pid = fork();
    if (self->pid == 0) {
        be_heaved(self, parent);
    }
    if (self->pid < 0) {
        return fail(self, self->program, error_text(errno));
    }
    while (heaved_link_now_ms() < until_ms && *self->is_interrupted == 0) {
        if (!is_running(self)) {
            return fail_by_log(self);
        }
        if (self->link.fd < 0) {
            self->link.fd = heaved_link_open(self->socket);
            self->link.is_over = false;
        } else if (!is_bus || setup_session_counts(self, NULL, NULL) > 0) {
            return true;
        }
        pause_ms(LOOK_MS);
    }
    return setup_session_fail(self, _("the drives are not ready"));
}

/* It may take a while until heaved lets anybody in: drives are still set up. An e-stop that is pressed ends it: whoever releases
 * it may be about to reach in, and says anew that the drives may have torque. */
static bool enter_service(setup_session_t *self)
{
    char error[HEAVED_LINK_ERROR_MAX] = "", shown[SENTENCE_MAX];
    const int64_t until_ms = heaved_link_now_ms() + START_MS;
    while (heaved_link_now_ms() < until_ms && *self->is_interrupted == 0 && is_running(self)) {
        cJSON *status = heaved_link_ask(&self->link, "status");
        const bool is_estop = heaved_link_is_set(status, "estop_active");
        const bool is_in = strcmp(heaved_link_text(status, "state"), "SERVICE") == 0;
        const bool is_fault =
            strcmp(heaved_link_text(status, "state"), "FAULT") == 0 ||
            strcmp(heaved_link_text(status, "state"), "ESTOP") == 0; /* where every heaved with an e-stop begins */
        cJSON_Delete(status);
        if (is_in) {
            return true;
        }
        if (is_estop && heaved_link_now_ms() - self->started_ms > SETTLED_MS) {
            return fail(self,
                        _("the e-stop is pressed: release it first, then try again. Where it is released, its line is another "
                          "one, or its contact of "
                          "the other kind: \"back\""),
                        "");
        }
        if (!is_estop) {
            (void)heaved_link_has_done(&self->link, is_fault ? "reset" : "service", error);
        }
        pause_ms(LOOK_MS);
    }
    return self->pid == 0 ? fail_by_log(self)
                          : fail(self, _("heaved does not go into SERVICE"), sentence(error, shown, sizeof shown));
}

bool setup_session_is_bus_free(setup_session_t *self, const setup_t *setup)
{
    const char *driver = setup_driver(setup), *interface = setup_get(setup, "interface"), *hosts = setup_get(setup, "hosts");
    const char *device = setup_get(setup, "device");
    const char *bus = interface != NULL ? interface : hosts != NULL ? hosts : device;
    setup_session_stop(self);
    return bus == NULL || !neighbours_have(driver, bus, self->error, sizeof self->error);
}

bool setup_session_need(setup_session_t *self, const setup_t *setup, setup_stage_t stage)
{
    static ini_text_t config;
    double counts[SETUP_DRIVES_MAX];
    const bool is_made_up = stage == SETUP_STAGE_BUS || stage == SETUP_STAGE_LEGS;
    const bool is_bus = strcmp(setup_driver(setup), "sim") != 0;
    setup_configure(setup, stage, NULL, &config);
    /* a zero that is made up is another one with each start; without it the two are the same or not */
    const bool is_taken = is_running(self) && strcmp(config.text, self->on.text) == 0;
    if (!is_taken && !(setup_session_is_bus_free(self, setup) && start(self, &config, is_bus))) {
        return false;
    }
    if (!is_taken && is_made_up && is_bus) {
        static ini_text_t with_zero;
        if (setup_session_counts(self, counts, NULL) == 0) {
            return setup_session_fail(self, _("the drives are not ready"));
        }
        setup_configure(setup, stage, counts, &with_zero);
        if (!start(self, &with_zero, is_bus)) {
            return false;
        }
        self->on = config;
    }
    return enter_service(self);
}

static bool has_torque(setup_session_t *self)
{
    bool has = true;
    const cJSON *drive = NULL;
    cJSON *answer = heaved_link_ask(&self->link, "counts");
    has = answer != NULL;
    cJSON_ArrayForEach(drive, cJSON_GetObjectItemCaseSensitive(answer, "drives"))
    {
        has = has && heaved_link_is_set(drive, "torque");
    }
    cJSON_Delete(answer);
    return has;
}

bool setup_session_is_homed(setup_session_t *self)
{
    const cJSON *drive = NULL;
    cJSON *answer = heaved_link_ask(&self->link, "counts");
    bool is_homed = answer != NULL;
    cJSON_ArrayForEach(drive, cJSON_GetObjectItemCaseSensitive(answer, "drives"))
    {
        is_homed = is_homed && heaved_link_is_set(drive, "homed");
    }
    cJSON_Delete(answer);
    return is_homed;
}

bool setup_session_need_torque(setup_session_t *self, const setup_t *setup, setup_stage_t stage)
{
    char error[HEAVED_LINK_ERROR_MAX] = "";
    const int64_t until_ms = heaved_link_now_ms() + TORQUE_MS;
    if (!setup_session_need(self, setup, stage)) {
        return false;
    }
    bool is_asked = false;
    while (heaved_link_now_ms() < until_ms && *self->is_interrupted == 0 && is_running(self)) {
        if (has_torque(self)) {
            return true;
        }
        is_asked = is_asked || heaved_link_has_done(&self->link, "torque all on", error);
        pause_ms(LOOK_MS);
    }
    return setup_session_fail(self, _("the drives are not ready"));
}
