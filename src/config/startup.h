/* SPDX-License-Identifier: MIT
 * startup.h - start-up lists of CANopen drives: sections with an object in each line instead of keys.
 */
#ifndef HEAVE_CONFIG_STARTUP_H
#define HEAVE_CONFIG_STARTUP_H

#include "config/keys.h"
#include "config/config_text.h"

/** What a line may be, for the reference. */
extern const char config_startup_help[];

/** The same in an error. */
extern const char config_startup_allowed[];

/** True where a section is such a list. */
bool config_startup_is_list(const config_section_t *section);

/** The list of a section.
 *  @return NULL where it has keys */
const config_startup_t *config_startup_of(const config_section_t *section, const config_t *config);

/** Appends an item as it stands in a file. */
void config_startup_format(const cia402_item_t *item, config_text_t *text);

/** Writes the items of a section as lines of a file; nothing where it has keys. */
void config_startup_dump(const config_section_t *section, const config_t *config, FILE *out);

#endif
