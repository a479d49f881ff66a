/* SPDX-License-Identifier: MIT
 * feed.c - see feed.h.
 */
#include "panel/feed.h"

#include <stdio.h>
#include <string.h>

#include "panel/outbox.h"

#define ROWS_MAX    512u /* of a block */
#define BLOCKS_MAX  8u   /* at once: what was before a page came fills its curves quickly */
#define HEAD_BYTES  24u
#define HISTORY_MAX 30.0

static feed_t *free_place(viewer_t *viewer)
{
    for (unsigned i = 0; i < VIEWER_STREAMS_MAX; i++) {
        if (viewer->stream[i].number == 0) {
            return &viewer->stream[i];
        }
    }
    return NULL;
}

/* The place of a column in the table; FEED_NOTHING: there is no such column. */
static uint32_t find_column(const samples_header_t *header, const char *name, size_t length)
{
    uint32_t at = 0;
    const samples_column_t *column = samples_column(header, 0);
    while (column != NULL && (strnlen(column->name, sizeof column->name) != length || memcmp(column->name, name, length) != 0)) {
        column = samples_column(header, ++at);
    }
    return column != NULL ? at : FEED_NOTHING;
}

/* A name, or `a-b`: the difference of two columns with the same unit. */
static bool add_column(feed_t *stream, const char *name)
{
    const samples_header_t *const header = stream->reader.header;
    const char *const minus = strchr(name, '-');
    if (stream->columns == VIEWER_COLUMNS_MAX) {
        return false;
    }
    const uint32_t at = find_column(header, name, minus != NULL ? (size_t)(minus - name) : strlen(name));
    const uint32_t less = minus != NULL ? find_column(header, minus + 1, strlen(minus + 1)) : FEED_NOTHING;
    stream->column[stream->columns] = at;
    stream->less[stream->columns++] = less;
    return at != FEED_NOTHING && (minus == NULL || (less != FEED_NOTHING &&
                                                    strncmp(samples_column(header, at)->unit, samples_column(header, less)->unit,
                                                            sizeof samples_column(header, at)->unit) == 0));
}

static bool find_columns(feed_t *stream, const cJSON *names, char *error, size_t size)
{
    const cJSON *name = NULL;
    cJSON_ArrayForEach(name, names)
    {
        if (!cJSON_IsString(name) || !add_column(stream, name->valuestring)) {
            (void)snprintf(error, size,
                           "samples: there is no column %.40s, or there are more than %u; `a-b` takes two of one unit",
                           cJSON_IsString(name) ? name->valuestring : "", VIEWER_COLUMNS_MAX);
            return false;
        }
    }
    if (stream->columns == 0) {
        (void)snprintf(error, size, "samples: name at least one column");
    }
    return stream->columns > 0;
}

feed_t *feed_begin(viewer_t *viewer, upstream_t *upstream, const cJSON *json, char *error, size_t size)
{
    const cJSON *const every = cJSON_GetObjectItemCaseSensitive(json, "every");
    const cJSON *const history = cJSON_GetObjectItemCaseSensitive(json, "history_s");
    feed_t *const stream = free_place(viewer);
    if (stream == NULL || upstream->samples.header == NULL) {
        (void)snprintf(error, size, "%s",
                       stream == NULL ? "samples: a page has four streams at most"
                                      : "samples: heaved keeps none; [samples] seconds says how long");
        return NULL;
    }
    *stream = (feed_t){.upstream = upstream, .reader = upstream->samples};
    const samples_header_t *const header = stream->reader.header;
    stream->every =
        cJSON_IsNumber(every) && every->valuedouble >= 1 && every->valuedouble <= 100000 ? (uint32_t)every->valuedouble : 1;
    if (!find_columns(stream, cJSON_GetObjectItemCaseSensitive(json, "columns"), error, size)) {
        return NULL;
    }
    const double wanted_s = cJSON_IsNumber(history) && history->valuedouble > 0 ? history->valuedouble : 0;
    const double history_s = wanted_s < HISTORY_MAX ? wanted_s : HISTORY_MAX;
    uint64_t back = (uint64_t)(history_s * 1e6 / header->cycle_us);
    back = back < header->capacity / 2 ? back : header->capacity / 2;
    const uint64_t written = __atomic_load_n(&header->written, __ATOMIC_ACQUIRE);
    stream->reader.next = written > back ? written - back : 0;
    stream->reader.lost = 0;
    stream->number = ++viewer->last_stream;
    return stream;
}

cJSON *feed_describe(const feed_t *stream, int64_t id)
{
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddNumberToObject(json, "id", (double)id);
    cJSON_AddNumberToObject(json, "stream", stream->number);
    cJSON_AddNumberToObject(json, "cycle_us", stream->reader.header->cycle_us);
    cJSON_AddNumberToObject(json, "every", stream->every);
    cJSON *const columns = cJSON_AddArrayToObject(json, "columns");
    for (unsigned i = 0; i < stream->columns; i++) {
        const samples_column_t *const column = samples_column(stream->reader.header, stream->column[i]);
        cJSON *const one = cJSON_CreateObject();
        char name[2 * sizeof column->name + 1];
        const bool is_difference = stream->less[i] != FEED_NOTHING;
        (void)snprintf(name, sizeof name, "%s%s%s", column->name, is_difference ? "-" : "",
                       is_difference ? samples_column(stream->reader.header, stream->less[i])->name : "");
        cJSON_AddStringToObject(one, "name", name);
        cJSON_AddStringToObject(one, "unit", column->unit);
        cJSON_AddItemToArray(columns, one);
    }
    return json;
}

void feed_end(viewer_t *viewer, uint32_t number)
{
    for (unsigned i = 0; i < VIEWER_STREAMS_MAX; i++) {
        viewer->stream[i].number = viewer->stream[i].number == number ? 0 : viewer->stream[i].number;
    }
}

static void put_u32(unsigned char *at, uint32_t value)
{
    for (unsigned i = 0; i < 4; i++) {
        at[i] = (unsigned char)(value >> (8 * i));
    }
}

/* A block: number, rows, first sequence number (8 bytes), rows lost before it, 0; then each column's values. Little endian, as
 * the machines are that this runs on. */
static bool put_block(viewer_t *viewer, feed_t *stream, const double *value, uint32_t rows, uint64_t first)
{
    static unsigned char block[HEAD_BYTES + sizeof(double) * ROWS_MAX * VIEWER_COLUMNS_MAX];
    const uint64_t lost = stream->reader.lost - stream->lost_logged + stream->dropped;
    put_u32(block, stream->number);
    put_u32(block + 4, rows);
    put_u32(block + 8, (uint32_t)first);
    put_u32(block + 12, (uint32_t)(first >> 32));
    put_u32(block + 16, lost < UINT32_MAX ? (uint32_t)lost : UINT32_MAX);
    put_u32(block + 20, 0);
    for (unsigned c = 0; c < stream->columns; c++) {
        memcpy(block + HEAD_BYTES + sizeof(double) * rows * c, &value[ROWS_MAX * c], sizeof(double) * rows);
    }
    if (!outbox_put(viewer, block, HEAD_BYTES + sizeof(double) * rows * stream->columns, true)) {
        stream->dropped += rows;
        return false;
    }
    stream->lost_logged = stream->reader.lost;
    stream->dropped = 0;
    return true;
}

static double value_of(const feed_t *stream, unsigned c, const samples_record_t *record)
{
    const samples_header_t *const header = stream->reader.header;
    const double value = samples_value(samples_column(header, stream->column[c]), record);
    return stream->less[c] == FEED_NOTHING ? value : value - samples_value(samples_column(header, stream->less[c]), record);
}

/* Takes a record into the group. @return true: the group is complete */
static bool gather(feed_t *stream, const samples_record_t *record)
{
    for (unsigned c = 0; c < stream->columns; c++) {
        const double now = value_of(stream, c, record);
        stream->least[c] = stream->held == 0 || now < stream->least[c] ? now : stream->least[c];
        stream->most[c] = stream->held == 0 || now > stream->most[c] ? now : stream->most[c];
    }
    stream->first = stream->held == 0 ? record->word[0] - 1 : stream->first;
    stream->held++;
    const bool is_complete = stream->held >= stream->every;
    stream->held = is_complete ? 0 : stream->held;
    return is_complete;
}

static bool send_block(viewer_t *viewer, feed_t *stream)
{
    static double value[ROWS_MAX * VIEWER_COLUMNS_MAX];
    const uint32_t rows_each = stream->every > 1 ? 2 : 1;
    samples_record_t record;
    uint32_t rows = 0;
    uint64_t first = 0;
    while (rows + rows_each <= ROWS_MAX && samples_reader_next(&stream->reader, &record)) {
        if (!gather(stream, &record)) {
            continue;
        }
        first = rows == 0 ? stream->first : first;
        for (unsigned c = 0; c < stream->columns; c++) {
            value[ROWS_MAX * c + rows] = stream->least[c];
            value[ROWS_MAX * c + rows + rows_each - 1] = stream->most[c];
        }
        rows += rows_each;
    }
    return rows > 0 && put_block(viewer, stream, value, rows, first) && rows + rows_each > ROWS_MAX;
}

bool feed_pump(viewer_t *viewer)
{
    for (unsigned i = 0; i < VIEWER_STREAMS_MAX; i++) {
        feed_t *const stream = &viewer->stream[i];
        unsigned blocks = 0;
        while (stream->number != 0 && blocks < BLOCKS_MAX && viewer->count < VIEWER_QUEUE / 2 && send_block(viewer, stream)) {
            blocks++;
        }
    }
    return viewer->count > 0;
}
