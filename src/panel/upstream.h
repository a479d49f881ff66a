/* SPDX-License-Identifier: MIT
 * upstream.h - one platform as the panel knows it: its connections to heaved, its newest status, its samples. Every request of
 * every viewer goes over four of them: one for what has to be quick (hold, hands and ticks), one for most others, one for a
 * reset, which may take seconds, one for what may take many. A connection that is lost, or that gave way to another client of
 * heaved, is made anew.
 */
#ifndef HEAVE_PANEL_UPSTREAM_H
#define HEAVE_PANEL_UPSTREAM_H

#include <stdbool.h>
#include <stdint.h>

#include "common/samples.h"
#include "common/socket_path.h"

#define UPSTREAM_NAME_MAX   32u
#define UPSTREAM_BY_MAX     48u /* role@address */
#define UPSTREAM_LINE_MAX   65536u
#define UPSTREAM_WAITING    64u
#define UPSTREAM_LOG_MAX    128u
#define UPSTREAM_DIGEST_MAX 17u
#define UPSTREAM_PATH_MAX   256u
#define UPSTREAM_WHY_MAX    256u
#define UPSTREAM_WHY_ZH_MAX 1024u
#define UPSTREAM_REQUEST    64u                      /* bytes of a request, as heaved takes them */
#define UPSTREAM_HEARD      (UPSTREAM_REQUEST + 24u) /* with the tick that its page has seen */
#define UPSTREAM_BUSY       "too many requests wait for heaved: try again"

/** Which connection. */
typedef enum {
    LINK_WATCH,
    LINK_QUICK,
    LINK_SLOW,
    LINK_RESET, /**< made when they are needed: heaved answers the requests of a connection one after the other, and these */
    LINK_LONG,  /**< take long */
    LINKS
} link_kind_t;

/** Whom an answer is for. */
typedef struct {
    uint64_t viewer; /**< 0: nobody; the answer is thrown away, or is a tick */
    int64_t id;
    char by[UPSTREAM_BY_MAX]; /**< for the operator log */
} asker_t;

struct upstream;

/** One connection; private. */
typedef struct {
    struct upstream *upstream;
    link_kind_t kind;
    int fd;       /**< -1: none */
    void *handle; /**< of the event loop */
    char *line;
    size_t length;
    unsigned waits;
    asker_t waiting[UPSTREAM_WAITING]; /**< for answers, the first first */
    char by[UPSTREAM_BY_MAX];          /**< whom heaved was told last */
} link_t;

/** What happens. Called from upstream_*(). */
typedef struct {
    void (*watch_fd)(link_t *link); /**< a descriptor to be looked at; upstream_readable() when it can be read */
    void (*status)(struct upstream *self);
    void (*answer)(struct upstream *self, const asker_t *asker, const char *line);
    void (*gone)(struct upstream *self);
} upstream_calls_t;

/** Its configuration in force. */
typedef struct {
    char *text; /**< NULL: not known */
    size_t length;
    char digest[UPSTREAM_DIGEST_MAX]; /**< "": not asked yet */
    char file[UPSTREAM_PATH_MAX];     /**< that heaved was started with */
    bool is_applied;                  /**< another one has been applied over it */
    bool is_kept;                     /**< heaved has a place to keep one that is applied */
} configuration_t;

/** A platform. */
typedef struct upstream {
    char name[UPSTREAM_NAME_MAX];
    char path[SOCKET_PATH_MAX];
    const upstream_calls_t *calls;
    link_t link[LINKS];
    char *status; /**< the newest, one JSON object; "" before the first */
    bool is_there;
    samples_reader_t samples; /**< header NULL: none */
    int incidents;            /**< folder of the incidents as a place; -1: none */
    int log;                  /**< that of the operator log; -1: none */
    char log_name[UPSTREAM_LOG_MAX];
    uint64_t holder; /**< viewer with the controls; 0 = nobody */
    char holder_name[UPSTREAM_BY_MAX];
    configuration_t configuration;
    char put_back[UPSTREAM_WHY_MAX];       /**< why the configuration applied last is not in force; "": it is */
    char put_back_zh[UPSTREAM_WHY_ZH_MAX]; /**< the same in Chinese, as a JSON string with its quotes; "": none */
    unsigned intensity;                    /**< percent in force, for levels */
} upstream_t;

/** Prepares one; nothing is connected yet. */
bool upstream_init(upstream_t *self, const char *name, const char *path, const upstream_calls_t *calls);

/** Connects what is not connected. Once a second. */
void upstream_connect(upstream_t *self);

/** Sends a request. @return NULL, or why not */
const char *upstream_send(upstream_t *self, link_kind_t kind, const char *line, const asker_t *asker);

/** The same with a descriptor for heaved, which stays the caller's; -1: none. */
const char *upstream_send_with(upstream_t *self, link_kind_t kind, const char *line, const asker_t *asker, int fd);

/** Reads what a connection has. @return false: it is over, and closed */
bool upstream_readable(link_t *link);

/** The event loop has closed a connection's descriptor. */
void upstream_closed(link_t *link);

#endif
