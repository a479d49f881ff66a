/* SPDX-License-Identifier: MIT
 * keys.h - the one table of all sections and keys of the configuration file.
 * Parsing, range checks, --dump-config and the reference are walks over it. Constant data, private to src/config.
 */
#ifndef HEAVE_CONFIG_KEYS_H
#define HEAVE_CONFIG_KEYS_H

#include "config/config.h"

/** How a value is written. */
typedef enum {
    CONFIG_DECIMAL,      /**< `count` numbers, stored as q16_t; or the word in `words`, stored as CONFIG_NONE */
    CONFIG_PER_CYLINDER, /**< one number for all cylinders, or one for each; stored as q16_t[CYLINDERS_MAX] */
    CONFIG_INTEGER,      /**< a whole number, stored in `size` bytes; or the word in `words`, stored as CONFIG_NONE */
    CONFIG_MASK,         /**< hexadecimal, stored as uint16_t */
    CONFIG_SIGN,         /**< 1 or -1, stored as int8_t */
    CONFIG_WORD,         /**< one of `words`, stored as its index */
    CONFIG_YES_NO,       /**< stored as bool */
    CONFIG_ADDRESS,      /**< numeric IPv4 or IPv6 address, stored as text */
    CONFIG_GROUP,        /**< `none`, or a multicast address, % and a network interface; stored as text, empty for none */
    CONFIG_NETWORKS,     /**< the word for an empty list, or addresses and networks, stored as hal_udp_networks_t */
    CONFIG_PATH,         /**< absolute path, stored as text */
    CONFIG_LABEL,        /**< `none`, or the name or number of a line, or the name of a chip; stored as config_label_t */
    CONFIG_LINES,        /**< `none`, or names or numbers of lines, stored as config_lines_t */
    CONFIG_PER_RELAY,    /**< one whole number for all relays, or one for each; stored as uint32_t[CONFIG_RELAYS_MAX] */
    CONFIG_NAME,         /**< of a network interface, stored as text */
    CONFIG_IDS,          /**< `none`, or CAN identifiers, stored as config_ids_t; `words`: what they are called instead */
    CONFIG_RATIOS,       /**< `none`, or up to `count` ratios such as 20000/10, stored as config_ratios_t */
    CONFIG_WHOLES,       /**< up to `count` whole numbers, stored as config_wholes_t */
    CONFIG_FRAME, /**< `none`, or bytes and fields of a CAN frame, stored as canraw_frame_t; `words`: the fields it may have,
                       in replies (`count` 1) also bytes that may be anything */
    CONFIG_STEP,  /**< `none`, or a frame, -> and its answer, wait and ms, stored as canraw_step_t; `words` as for CONFIG_FRAME */
    CONFIG_WHEN,  /**< `none`, or value/mask, stored as canraw_when_t */
    CONFIG_NODES, /**< nodes and their axes, stored as config_ids_t */
    CONFIG_WORDS, /**< one of `words` for all drives, or one for each, stored as config_words_t */
    CONFIG_MAPS,  /**< `none`, or maps of PDOs, stored as config.h has them */
    CONFIG_HOSTS, /**< `none`, or IPv4 addresses with or without a port, stored as config_hosts_t */
    CONFIG_BLOCKS, /**< `none`, or blocks of registers, stored as modbus_drive_blocks_t; `words` and `count` as for CONFIG_FRAME
                    */
    CONFIG_ITEMS   /**< `none`, or what registers have to hold, stored as config_items_t */
} config_type_t;

/** What a platform must have for a section or key to mean anything. */
typedef enum { CONFIG_NEEDS_NOTHING, CONFIG_NEEDS_HEXAPOD, CONFIG_NEEDS_ANGLE } config_needs_t;

/** A number that people know in hexadecimal: one of 32 bits, as identities are. Takes both. */
#define CONFIG_IS_HEX(key) ((key)->type == CONFIG_INTEGER && (key)->high_milli == (int64_t)UINT32_MAX * 1000)

/** One section. */
typedef struct {
    const char *name;
    const char *help;
    config_needs_t needs;
} config_section_t;

/** One key. */
typedef struct {
    const char *section;
    const char *name;
    const char *unit;     /**< "" where it has none */
    const char *fallback; /**< the default as it would stand in a file; NULL: required */
    const char *words;    /**< separated by `|`, in the order of the enum they are stored in */
    const char *absent;   /**< words of drivers that are known but not built in; NULL where there are none */
    const char *help;     /**< one line */
    int64_t low_milli;    /**< range in thousandths of the unit, ends included */
    int64_t high_milli;
    size_t offset; /**< in config_t */
    size_t size;
    config_type_t type;
    config_needs_t needs;
    uint8_t count; /**< values of a CONFIG_DECIMAL; see also the types */
    bool is_live;  /**< may change in operation (SIGHUP); gateway_reload() or daemon/motion_loop.c take it over */
} config_key_t;

#define CONFIG_KEYS_MAX     352u /**< bound of arrays with one element per key */
#define CONFIG_SECTIONS_MAX 40u

extern const config_section_t config_sections[];
extern const size_t config_section_count;
extern const config_key_t config_keys[];
extern const size_t config_key_count;

/** Section names of the axes, in the order of axes.h. */
extern const char *const config_axis_section[AXES_MAX];

/** "mm" or "deg". */
const char *config_axis_unit(unsigned axis);

/** The kind of a mechanism as the file has it. */
const char *config_kind_name(kin_kind_t kind);

/** True where the platform has the axis. */
bool config_has_axis(const config_t *config, unsigned axis);

/** Index of a section or key.
 *  @return -1 where there is none */
int config_section_find(const char *name);
int config_key_find(const char *section, const char *name);

/** Nearest name by edit distance, for "did you mean".
 *  @return NULL where nothing is near */
const char *config_section_suggest(const char *name);
const char *config_key_suggest(const char *section, const char *name);

/** True where a platform has what the section or key needs. */
bool config_is_applicable(config_needs_t needs, const config_t *config);

#endif
