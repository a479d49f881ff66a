/* SPDX-License-Identifier: MIT
 * access_levels.c - who may ask for what; see access_levels.h.
 */
#include "service/access_levels.h"

#include <errno.h>
#include <grp.h>
#include <string.h>
#include <sys/socket.h>

#include "common/message.h"

#define GROUPS_MAX 256u

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

const char *level_name(level_t level)
{
    static const char *const k_names[] = {"look", "operate", "service"};
    return (unsigned)level <= LEVEL_SERVICE ? k_names[level] : "?";
}
