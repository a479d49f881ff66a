/* SPDX-License-Identifier: MIT
 * request_table.c - see request_table.h.
 */
#include "service/request_table.h"

#include <string.h>

#include "service/operator_requests.h"

/** How a request may be written. */
typedef enum {
    ALONE,      /**< its name, nothing else */
    WITH_WORDS, /**< its name, a blank, and what follows */
    EITHER
} form_t;

/** What it does; some depend on its words. */
typedef enum {
    LOOKS,
    SAFE,           /**< changes something, but starts and enlarges no motion */
    MOVES,          /**< can start or enlarge a motion, or makes that possible */
    MOVES_UP,       /**< where the percentage is more than the one in force */
    MOVES_BUT_OFF,  /**< unless its words say off */
    LOOKS_OR_MOVES, /**< reads, or with a value writes */
    HELD
} deed_t;

/** A row. */
typedef struct {
    const char *name;
    form_t form;
    level_t level;
    deed_t deed;
    request_kind_t kind;
} row_t;

/* clang-format off */
static const row_t k_rows[] = {
    {"status",          ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_STATUS},
    {"watch",           EITHER,     LEVEL_LOOK,    LOOKS,          REQUEST_WATCH},
    {"tick",            ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_TICK},
    {"counts",          ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_COUNTS},
    {"times",           ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_TIMES},
    {"geometry",        ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_GEOMETRY},
    {"configuration",   ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_CONFIGURATION},
    {"samples",         ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_SAMPLES},
    {"incidents",       ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_INCIDENTS},
    {"incident-folder", ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_INCIDENT_FOLDER},
    {"selftest",        ALONE,      LEVEL_LOOK,    LOOKS,          REQUEST_SELFTEST},
    {"by",              WITH_WORDS, LEVEL_LOOK,    LOOKS,          REQUEST_BY},
    {"hold",            ALONE,      LEVEL_LOOK,    SAFE,           REQUEST_STATE},

    {"operator-log",    ALONE,      LEVEL_OPERATE, LOOKS,          REQUEST_OPERATOR_LOG},
    {"seen",            ALONE,      LEVEL_OPERATE, SAFE,           REQUEST_SEEN},
    {"engage",          ALONE,      LEVEL_OPERATE, MOVES,          REQUEST_STATE},
    {"resume",          ALONE,      LEVEL_OPERATE, MOVES,          REQUEST_STATE},
    {"park",            ALONE,      LEVEL_OPERATE, MOVES,          REQUEST_STATE},
    {"intensity",       WITH_WORDS, LEVEL_OPERATE, MOVES_UP,       REQUEST_INTENSITY}, /* upwards: LEVEL_SERVICE */

    {"reset",           ALONE,      LEVEL_SERVICE, MOVES,          REQUEST_STATE},
    {"shutdown",        ALONE,      LEVEL_SERVICE, MOVES,          REQUEST_STATE},
    {"service",         ALONE,      LEVEL_SERVICE, MOVES,          REQUEST_STATE},
    {"service-off",     ALONE,      LEVEL_SERVICE, SAFE,           REQUEST_STATE},
    {"torque",          EITHER,     LEVEL_SERVICE, MOVES_BUT_OFF,  REQUEST_HAND},
    {"jog",             EITHER,     LEVEL_SERVICE, HELD,           REQUEST_HAND},
    {"signal",          EITHER,     LEVEL_SERVICE, HELD,           REQUEST_HAND},
    {"home",            EITHER,     LEVEL_SERVICE, HELD,           REQUEST_HAND},
    {"relay",           EITHER,     LEVEL_SERVICE, HELD,           REQUEST_HAND},
    {"beat",            EITHER,     LEVEL_SERVICE, LOOKS,          REQUEST_HAND},
    {"release",         EITHER,     LEVEL_SERVICE, SAFE,           REQUEST_HAND},
    {"sdo",             EITHER,     LEVEL_SERVICE, LOOKS_OR_MOVES, REQUEST_OBJECT},
    {"dump",            ALONE,      LEVEL_SERVICE, SAFE,           REQUEST_DUMP},
    {"acknowledge",     ALONE,      LEVEL_SERVICE, MOVES,          REQUEST_ACKNOWLEDGE},
    {"commissioned",    ALONE,      LEVEL_SERVICE, MOVES,          REQUEST_COMMISSIONED},
    {"selftest passed", ALONE,      LEVEL_SERVICE, MOVES,          REQUEST_SELFTEST_PASSED},
    {"selftest failed", ALONE,      LEVEL_SERVICE, SAFE,           REQUEST_SELFTEST_FAILED},
    {"configure",       WITH_WORDS, LEVEL_SERVICE, MOVES,          REQUEST_CONFIGURE},
};
/* clang-format on */

/* What stands behind the name; NULL: it is another request. */
static const char *words_behind(const row_t *row, const char *line)
{
    const size_t length = strlen(row->name);
    if (strncmp(line, row->name, length) != 0) {
        return NULL;
    }
    const bool has_words = line[length] == ' ';
    const bool is_there = has_words ? row->form != ALONE : line[length] == '\0' && row->form != WITH_WORDS;
    return !is_there ? NULL : has_words ? &line[length + 1u] : &line[length];
}

static unsigned words_of(const char *text)
{
    unsigned words = 0;
    for (; *text != '\0'; text++) {
        words += *text != ' ' && (text[1] == ' ' || text[1] == '\0');
    }
    return words;
}

/* Less intensity, or as much as there is; what is no percentage is not less. */
static bool is_downwards(const char *words, unsigned percent)
{
    uint32_t wanted = 0;
    return operator_read_percent(words, &wanted) && wanted <= percent;
}

static bool is_moving(deed_t deed, const char *words, unsigned percent)
{
    return deed == MOVES || (deed == MOVES_UP && !is_downwards(words, percent)) ||
           (deed == MOVES_BUT_OFF && strstr(words, "off") == NULL) || (deed == LOOKS_OR_MOVES && words_of(words) > 2u);
}

static bool is_read_whole(request_kind_t kind)
{
    return kind == REQUEST_STATE || kind == REQUEST_HAND || kind == REQUEST_OBJECT;
}

request_t request_read(const char *line, unsigned percent)
{
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        const row_t *row = &k_rows[i];
        const char *words = words_behind(row, line);
        if (words != NULL) {
            const bool moves = is_moving(row->deed, words, percent);
            return (request_t){.kind = row->kind,
                               .words = is_read_whole(row->kind) ? line : words,
                               .level = row->deed == MOVES_UP && moves ? LEVEL_SERVICE : row->level,
                               .is_look = row->deed == LOOKS || (row->deed == LOOKS_OR_MOVES && !moves),
                               .is_moving = moves,
                               .is_held = row->deed == HELD};
        }
    }
    return (request_t){.kind = REQUEST_UNKNOWN, .words = "", .level = LEVEL_LOOK};
}

level_t request_level(const char *said, unsigned percent)
{
    bool has_heard = false;
    uint64_t tick_us = 0;
    const char *const line = operator_request_behind_heard(said, &has_heard, &tick_us);
    return line != NULL ? request_read(line, percent).level : LEVEL_LOOK; /* else it will be rejected */
}
