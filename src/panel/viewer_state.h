/* SPDX-License-Identifier: MIT
 * viewer_state.h - what is known of somebody's page, for viewer.c, feed.c and outbox.c.
 */
#ifndef HEAVE_PANEL_VIEWER_STATE_H
#define HEAVE_PANEL_VIEWER_STATE_H

#include "panel/access.h"
#include "panel/upstream.h"
#include "service/access_levels.h"

#define VIEWER_QUEUE       64u
#define VIEWER_MESSAGE_MAX 2048u /* of a page's message */
#define VIEWER_COLUMNS_MAX 32u
#define VIEWER_STREAMS_MAX 4u
#define VIEWER_PLATFORMS   16u
#define VIEWER_HEARD_MAX   16u /* messages of a page in a turn of 33 ms: what is more waits for the next one */

/** A message that waits. */
typedef struct {
    bool is_binary;
    size_t length;
    unsigned char *data; /**< with room for the library's head before it */
} message_t;

#define FEED_NOTHING UINT32_MAX

/** Samples that it wants. */
typedef struct {
    uint32_t number; /**< 0: free */
    upstream_t *upstream;
    samples_reader_t reader;
    unsigned columns;
    uint32_t column[VIEWER_COLUMNS_MAX]; /**< by place in the table */
    uint32_t less[VIEWER_COLUMNS_MAX];   /**< the column that is taken off it; FEED_NOTHING: none */
    uint32_t every;
    uint64_t lost_logged;
    uint32_t dropped; /**< rows that its link did not take */
    uint32_t held;    /**< records in the group that is not complete */
    double least[VIEWER_COLUMNS_MAX], most[VIEWER_COLUMNS_MAX];
    uint64_t first; /**< number of the group's first record */
} feed_t;

/** A page. */
typedef struct viewer {
    struct viewer *next;
    uint64_t number; /**< never used again */
    void *handle;    /**< of its connection */
    int role;
    char name[UPSTREAM_BY_MAX];     /**< for the operator log and for others: role@address */
    char session[ACCESS_TOKEN_MAX]; /**< "" where none is needed */
    message_t queue[VIEWER_QUEUE];
    unsigned first, count;
    char in[VIEWER_MESSAGE_MAX];
    size_t in_length;
    unsigned status_hz[VIEWER_PLATFORMS];
    int64_t status_ms[VIEWER_PLATFORMS]; /**< when it was sent last */
    bool wants_ticks[VIEWER_PLATFORMS];
    uint32_t series[VIEWER_PLATFORMS]; /**< of what it holds; 0 = nothing */
    feed_t stream[VIEWER_STREAMS_MAX];
    uint32_t last_stream;
    unsigned heard; /**< messages since the last turn of viewers_pump() */
    bool is_over;   /**< to be closed */
} viewer_t;

#endif
