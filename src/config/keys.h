/* SPDX-License-Identifier: MIT
 * keys.h - the one table of all sections and keys of the configuration file.
 * Parsing, range checks, --dump-config and the reference are walks over it. Constant data, private to src/config.
 */
#ifndef HEAVE_CONFIG_KEYS_H
#define HEAVE_CONFIG_KEYS_H

#include "config/config.h"
#include "config/config_text.h"

typedef struct config_key config_key_t;

/** How the values of some keys are written: one row for each kind, constant data. `none` in a file means that all bytes are 0,
 * where has_none says so; a value that format writes as nothing stands as `none`. */
typedef struct {
    bool has_none;
    bool is_number; /**< one decimal or whole number, or several, with the unit of the key */
    bool is_list;   /**< several numbers may stand there, with commas between them */

    /** Stores a value into its field.
     *  @param text without blanks around it
     *  @param why  takes what is wrong and what is allowed, where the text is refused
     *  @return false where it is refused (nothing outside the field is changed) */
    bool (*parse)(const config_key_t *key, const char *text, void *field, config_text_t *why);

    /** Appends a value as it stands in a file. */
    void (*format)(const config_key_t *key, const config_t *config, const void *field, config_text_t *text);

    /** Appends what the key takes: "a number from -90 to 90 deg". */
    void (*allowed)(const config_key_t *key, config_text_t *text);
} config_type_t;

extern const config_type_t
    config_type_decimal,      /**< `count` numbers, stored as q16_t; or the word in `words`, stored as CONFIG_NONE */
    config_type_per_cylinder, /**< one number for all cylinders, or one for each; stored as q16_t[CYLINDERS_MAX] */
    config_type_integer,      /**< a whole number, stored in `size` bytes; or the word in `words`, stored as CONFIG_NONE */
    config_type_mask,         /**< hexadecimal, stored as uint16_t */
    config_type_sign,         /**< 1 or -1, stored as int8_t */
    config_type_word,         /**< one of `words`, stored as its index */
    config_type_yes_no,       /**< stored as bool */
    config_type_address,      /**< numeric IPv4 or IPv6 address, stored as text */
    config_type_group,        /**< `none`, or a multicast address, % and a network interface; stored as text, empty for none */
    config_type_networks,     /**< the word for an empty list, or addresses and networks, stored as hal_udp_networks_t */
    config_type_path,         /**< absolute path, stored as text */
    config_type_label,        /**< `none`, or the name or number of a line, or the name of a chip; stored as config_label_t */
    config_type_lines,        /**< `none`, or names or numbers of lines, stored as config_lines_t */
    config_type_per_relay,    /**< one whole number for all relays, or one for each; stored as uint32_t[CONFIG_RELAYS_MAX] */
    config_type_name,         /**< of a network interface, stored as text */
    config_type_ids,          /**< `none`, or CAN identifiers, stored as config_ids_t; `words`: what they are called instead */
    config_type_ratios,       /**< `none`, or up to `count` ratios such as 20000/10, stored as config_ratios_t */
    config_type_wholes,       /**< up to `count` whole numbers, stored as config_wholes_t */
    config_type_frame, /**< `none`, or bytes and fields of a CAN frame, stored as canraw_frame_t; `words`: the fields it may
                            have, in replies (`count` 1) also bytes that may be anything */
    config_type_step,  /**< `none`, or a frame, -> and its answer, wait and ms, stored as canraw_step_t; `words` as for a frame */
    config_type_when,  /**< `none`, or value/mask, stored as canraw_when_t */
    config_type_nodes, /**< nodes and their axes, stored as config_ids_t */
    config_type_set,   /**< `none`, or some of `words`, stored as a bit for each in `size` bytes */
    config_type_words, /**< one of `words` for all drives, or one for each, stored as config_words_t */
    config_type_maps,  /**< `none`, or maps of PDOs, stored as config.h has them */
    config_type_hosts, /**< `none`, or IPv4 addresses with or without a port, stored as config_hosts_t */
    config_type_blocks, /**< `none`, or blocks of registers, stored as modbus_drive_blocks_t; `words`, `count` as for a frame */
    config_type_items;  /**< `none`, or what registers have to hold, stored as config_items_t */

/** What a platform must have for a section or key to mean anything. */
typedef enum { CONFIG_NEEDS_NOTHING, CONFIG_NEEDS_HEXAPOD, CONFIG_NEEDS_ANGLE } config_needs_t;

/** One section. */
typedef struct {
    const char *name;
    const char *help;
    config_needs_t needs;
    bool is_of_machine; /**< of what is built, as hash.h has it; [platform] kind is, too */
} config_section_t;

/** One key. */
struct config_key {
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
    const config_type_t *type;
    config_needs_t needs;
    uint8_t count; /**< values of a list of numbers; see also the types */
    bool is_live;  /**< may change in operation (SIGHUP); gateway_reload() or daemon/motion_loop.c take it over */
};

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
