/* SPDX-License-Identifier: MIT
 * access_levels.c - who may ask for what; see access_levels.h.
 */
#include "service/access_levels.h"

#include <errno.h>
#include <grp.h>
#include <string.h>
#include <sys/socket.h>

#include "common/message.h"
#include "record/service_words.h"
#include "service/operator_requests.h"

#define GROUPS_MAX 256u

static const char k_intensity[] = "intensity ";

static int find_group(const char *key, const config_label_t *name, bool *has_group, gid_t *gid)
{
    *has_group = name->text[0] != '\0';
    if (!*has_group) {
        return EXIT_DONE;
    }
    errno = 0;
    const struct group *const group = getgrnam(name->text);
    if (group == NULL) {
        return print_message(EXIT_UNAVAILABLE,
                             "[control] %s: there is no group %s on this machine%s%s; addgroup --system %s makes one", key,
                             name->text, errno != 0 ? ": " : "", errno != 0 ? strerror(errno) : "", name->text);
    }
    *gid = group->gr_gid;
    return EXIT_DONE;
}

int levels_open(levels_t *self, const config_t *config)
{
    const int code = find_group("operate_group", &config->operate_group, &self->has_operate_group, &self->operate_gid);
    return code != EXIT_DONE ? code
                             : find_group("service_group", &config->service_group, &self->has_service_group, &self->service_gid);
}

static bool is_in(gid_t wanted, const gid_t *gid, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        if (gid[i] == wanted) {
            return true;
        }
    }
    return false;
}

level_t levels_of(const levels_t *self, uid_t uid, const gid_t *gid, unsigned count)
{
    const bool is_operator = !self->has_operate_group || is_in(self->operate_gid, gid, count);
    const bool is_service = self->has_service_group ? is_in(self->service_gid, gid, count) : is_operator;
    if (uid == 0 || is_service) {
        return LEVEL_SERVICE;
    }
    return is_operator ? LEVEL_OPERATE : LEVEL_LOOK;
}

level_peer_t levels_peer(const levels_t *self, int fd)
{
    gid_t gid[GROUPS_MAX + 1u];
    struct ucred peer;
    socklen_t peer_bytes = sizeof peer;
    socklen_t bytes = GROUPS_MAX * sizeof gid[0];
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &peer_bytes) != 0) {
        return (level_peer_t){.uid = (uid_t)-1, .gid = (gid_t)-1, .level = LEVEL_LOOK};
    }
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, &gid[1], &bytes) != 0) {
        bytes = 0; /* more than fit: those of its own group remain */
    }
    gid[0] = peer.gid;
    const unsigned count = 1u + (unsigned)(bytes / sizeof gid[0]);
    return (level_peer_t){.uid = peer.uid, .gid = peer.gid, .pid = peer.pid, .level = levels_of(self, peer.uid, gid, count)};
}

level_t levels_needed(const char *said, unsigned percent)
{
    uint32_t wanted = 0;
    bool has_heard = false;
    uint64_t tick_us = 0;
    const char *const request = operator_request_behind_heard(said, &has_heard, &tick_us);
    if (request == NULL) { /* it will be refused */
        return LEVEL_LOOK;
    }
    if (strncmp(request, k_intensity, sizeof k_intensity - 1) == 0) {
        const bool is_down = operator_read_percent(&request[sizeof k_intensity - 1], &wanted) && wanted <= percent;
        return is_down ? LEVEL_OPERATE : LEVEL_SERVICE;
    }
    if (strcmp(request, "seen") == 0 || strcmp(request, "operator-log") == 0) {
        return LEVEL_OPERATE;
    }
    if (service_words_are(request, strlen(request)) || strcmp(request, "dump") == 0 || strcmp(request, "acknowledge") == 0 ||
        strncmp(request, "sdo", 3) == 0 || strncmp(request, "selftest ", 9) == 0 || strncmp(request, "configure ", 10) == 0) {
        return LEVEL_SERVICE;
    }
    const event_t event = operator_request_find(request);
    if (event == EVENTS || event == EVENT_HOLD) {
        return LEVEL_LOOK;
    }
    return event == EVENT_RESET || event == EVENT_SHUTDOWN || event == EVENT_SERVICE || event == EVENT_SERVICE_OFF
               ? LEVEL_SERVICE
               : LEVEL_OPERATE;
}

const char *level_name(level_t level)
{
    static const char *const k_names[] = {"look", "operate", "service"};
    return (unsigned)level <= LEVEL_SERVICE ? k_names[level] : "?";
}
