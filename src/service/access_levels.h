/* SPDX-License-Identifier: MIT
 * access_levels.h - who may ask for what: each request has a level, each client of a control socket has one. A client's follows
 * from its groups, as the kernel tells them (SO_PEERCRED, SO_PEERGROUPS), and from the socket it came by. Nothing is allocated
 * but in levels_open().
 */
#ifndef HEAVE_SERVICE_ACCESS_H
#define HEAVE_SERVICE_ACCESS_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "config/config.h"

/** The lowest first. */
typedef enum {
    LEVEL_LOOK,    /**< status, watch, incidents, tick, counts; and hold, which is never refused to anybody */
    LEVEL_OPERATE, /**< engage, resume, park, intensity down, seen */
    LEVEL_SERVICE  /**< reset, intensity up, dump, shutdown, acknowledge, commissioned; service and everything in it that moves or
                      switches */
} level_t;

/** Who has them; private. */
typedef struct {
    bool has_operate_group; /**< else whoever may connect has the level, where no service group says otherwise */
    bool has_service_group;
    gid_t operate_gid;
    gid_t service_gid;
} levels_t;

/** The process at the other end of a socket. */
typedef struct {
    uid_t uid;
    gid_t gid;
    pid_t pid; /**< 0 where it is not known */
    level_t level;
} level_peer_t;

/** Looks the groups of a configuration up.
 *  @return EXIT_DONE; EXIT_UNAVAILABLE: this machine has no such group, which is said */
int levels_open(levels_t *self, const config_t *config);

/** The level of a user in these groups; root has every one. Pure. */
level_t levels_of(const levels_t *self, uid_t uid, const gid_t *gid, unsigned count);

/** Who has connected. Where the kernel does not tell, nobody may do more than look. */
level_peer_t levels_peer(const levels_t *self, int fd);

/** "look", "operate", "service": constant text. */
const char *level_name(level_t level);

#endif
