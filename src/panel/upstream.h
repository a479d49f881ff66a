/* SPDX-License-Identifier: MIT
 * upstream.h - one platform as the panel knows it: its connections to heaved, its newest status, its samples. Every request of
 * every viewer goes over two of them: one for what has to be quick (hold, hands and ticks), one for what may take its time. A
 * connection that is lost, or that gave way to another client of heaved, is made anew.
 */
#ifndef HEAVE_PANEL_UPSTREAM_H
#define HEAVE_PANEL_UPSTREAM_H

#include <stdbool.h>
#include <stdint.h>

#include "common/samples.h"
#include "common/socket_path.h"

#define UPSTREAM_NAME_MAX 32u
#define UPSTREAM_LINE_MAX 65536u
#define UPSTREAM_WAITING  64u
#define UPSTREAM_REQUEST  64u /* bytes of a request, as heaved takes them */

/** Which connection. */
typedef enum { LINK_WATCH, LINK_QUICK, LINK_SLOW, LINKS } link_kind_t;

/** Whom an answer is for. */
typedef struct {
    uint64_t viewer; /**< 0: nobody; the answer is thrown away, or is a tick */
    int64_t id;
    char by[UPSTREAM_NAME_MAX]; /**< for the operator log */
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
    char by[UPSTREAM_NAME_MAX];        /**< whom heaved was told last */
} link_t;

/** What happens. Called from upstream_*(). */
typedef struct {
    void (*watch_fd)(link_t *link); /**< a descriptor to be looked at; upstream_readable() when it can be read */
    void (*status)(struct upstream *self);
    void (*answer)(struct upstream *self, const asker_t *asker, const char *line);
    void (*gone)(struct upstream *self);
} upstream_calls_t;

/** A platform. */
typedef struct upstream {
    char name[UPSTREAM_NAME_MAX];
    char path[SOCKET_PATH_MAX];
    const upstream_calls_t *calls;
    link_t link[LINKS];
    char *status; /**< the newest, one JSON object; "" before the first */
    bool is_there;
    samples_reader_t samples; /**< header NULL: none */
    uint64_t holder;          /**< viewer with the controls; 0 = nobody */
    char holder_name[UPSTREAM_NAME_MAX + 64];
    unsigned intensity; /**< percent in force, for levels */
} upstream_t;

/** Prepares one; nothing is connected yet. */
bool upstream_init(upstream_t *self, const char *name, const char *path, const upstream_calls_t *calls);

/** Connects what is not connected. Once a second. */
void upstream_connect(upstream_t *self);

/** Sends a request. @return NULL, or why not */
const char *upstream_send(upstream_t *self, link_kind_t kind, const char *line, const asker_t *asker);

/** Reads what a connection has. @return false: it is over, and closed */
bool upstream_readable(link_t *link);

/** The event loop has closed a connection's descriptor. */
void upstream_closed(link_t *link);

#endif
