/* SPDX-License-Identifier: MIT
 * configuration.c - see configuration.h.
 */
#include "heavectl/configuration.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "heavectl/scope.h"

#define ANSWER_MS 12000 /* heaved gives the disk 10 s */
#define SEALS     (F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL)

/* Copies until the end. @return false: errno says why */
static bool copy(int from, int to)
{
    char bytes[4096];
    ssize_t got;
    while ((got = read(from, bytes, sizeof bytes)) > 0) {
        for (ssize_t done = 0, put = 0; done < got; done += put) {
            put = write(to, &bytes[done], (size_t)(got - done));
            if (put < 0) {
                return false;
            }
        }
    }
    return got == 0;
}

/* A file in memory that nobody can change any more. @return -1: errno says why */
static int seal(const char *path)
{
    const int from = strcmp(path, "-") == 0 ? STDIN_FILENO : open(path, O_RDONLY | O_CLOEXEC);
    const int fd = from >= 0 ? memfd_create("configuration", MFD_CLOEXEC | MFD_ALLOW_SEALING) : -1;
    bool is_done = fd >= 0 && copy(from, fd) && fcntl(fd, F_ADD_SEALS, SEALS) == 0;
    const int error = errno;
    if (from > STDIN_FILENO) {
        (void)close(from);
    }
    if (!is_done && fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return is_done ? fd : -1;
}

static bool send_with(int socket_fd, const char *line, int fd)
{
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(sizeof(int))];
    } passed;
    struct iovec bytes = {(char *)(uintptr_t)line, strlen(line)};
    struct msghdr message = {
        .msg_iov = &bytes, .msg_iovlen = 1, .msg_control = passed.bytes, .msg_controllen = sizeof passed.bytes};
    memset(&passed, 0, sizeof passed);
    struct cmsghdr *header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof fd);
    memcpy(CMSG_DATA(header), &fd, sizeof fd);
    return sendmsg(socket_fd, &message, MSG_NOSIGNAL) == (ssize_t)bytes.iov_len;
}

/* Asks what is in force. @param fd out: its text; -1: there is none, and it was said why
 *  @return exit code */
static int ask(ctl_t *self, int *fd)
{
    *fd = -1;
    const int code = ctl_send(self, "configuration");
    if (code != EXIT_DONE) {
        return code;
    }
    *fd = scope_receive(self->fd, self->line, sizeof self->line);
    if (*fd >= 0) {
        return EXIT_DONE;
    }
    return self->line[0] != '\0' ? ctl_show(self, self->line) : ctl_not_heard(self, "heaved does not answer");
}

static int show(ctl_t *self, int fd)
{
    if (self->is_json) {
        printf("%s\n", self->line);
        return EXIT_DONE;
    }
    (void)fflush(stdout);
    return lseek(fd, 0, SEEK_SET) == 0 && copy(fd, STDOUT_FILENO) ? EXIT_DONE
                                                                  : ctl_complain(EXIT_IO, "standard output: %s", strerror(errno));
}

/* What was made from the text that is in force now. */
static int apply(ctl_t *self)
{
    char line[64] = "configure ";
    cJSON *const answer = cJSON_Parse(self->line);
    const cJSON *const digest = cJSON_GetObjectItemCaseSensitive(answer, "digest");
    (void)snprintf(line, sizeof line, "configure %.40s\n", cJSON_IsString(digest) ? digest->valuestring : "");
    cJSON_Delete(answer);
    const int fd = seal(self->argument);
    if (fd < 0) {
        return ctl_complain(EXIT_NO_INPUT, "%s: %s", self->argument, strerror(errno));
    }
    const bool is_sent = send_with(self->fd, line, fd);
    (void)close(fd);
    const char *const heard = is_sent ? ctl_receive(self, ctl_now_ms() + ANSWER_MS) : NULL;
    return heard != NULL ? ctl_show(self, heard) : ctl_not_heard(self, "heaved does not answer");
}

int configuration_run(ctl_t *self)
{
    int fd = -1;
    const int code = ask(self, &fd);
    if (code != EXIT_DONE || fd < 0) {
        return code;
    }
    const int result = self->argument == NULL ? show(self, fd) : apply(self);
    (void)close(fd);
    return result;
}
