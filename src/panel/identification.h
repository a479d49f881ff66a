/* SPDX-License-Identifier: MIT
 * identification.h - what the drives of a platform do with a chirp: recorded while somebody holds the button, worked out as
 * `heavectl identify` does, in a process of its own. One at a time for each platform.
 */
#ifndef HEAVE_PANEL_IDENTIFICATION_H
#define HEAVE_PANEL_IDENTIFICATION_H

#include <cjson/cJSON.h>

#include "identify/identify_report.h"
#include "panel/upstream.h"

#define IDENTIFICATION_AXIS_MAX 8u

/** One. Zeroed: none. */
typedef struct {
    uint64_t viewer; /**< 0: none */
    void *viewers;   /**< of the viewers */
    bool is_working; /**< it is being worked out */
    uint32_t series; /**< of its signal; 0: not begun */
    char axis[IDENTIFICATION_AXIS_MAX];
    samples_reader_t reader;
    identify_report_t report;
    const samples_column_t *sent[IDENTIFY_CHANNELS_MAX], *actual[IDENTIFY_CHANNELS_MAX];
    double *sent_at[IDENTIFY_CHANNELS_MAX], *actual_at[IDENTIFY_CHANNELS_MAX];
    unsigned channels;
    size_t count, capacity;
    int64_t until_ms; /**< when what lags has come to rest; 0: the signal goes on */
} identification_t;

/** Prepares one, and says what to press.
 *  @param message `axis`, and `amplitude`, `from_hz`, `to_hz`, `seconds` where they are not as usual
 *  @param line out: the request of heaved, without its tick
 *  @return false, and why */
bool identification_begin(identification_t *self, const upstream_t *upstream, const cJSON *message, char *line, size_t line_size,
                          char *why, size_t size);

/** Takes in what is new. @return true: it is complete, and may be worked out */
bool identification_collect(identification_t *self, int64_t now_ms);

/** The signal has come to its end. */
void identification_arrived(identification_t *self, int64_t now_ms);

/** Works it out, in a process of its own: child_work(). context is the identification_t. Writes JSON, docs/identify.md. */
int identification_work(void *context, int fd);

/** Harmless on none. */
void identification_end(identification_t *self);

#endif
