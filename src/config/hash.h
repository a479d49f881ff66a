/* SPDX-License-Identifier: MIT
 * hash.h - what a configuration is recognised by: the same for every file that makes the same platform, whatever its
 * comments and the order of its keys, and another one where any key that counts has another value, defaults included.
 */
#ifndef HEAVE_CONFIG_HASH_H
#define HEAVE_CONFIG_HASH_H

#include "config/config.h"

/** Takes a line: "section.key = value", or a section and an item of its start-up list.
 *  @param is_of_machine it is of what config->machine_hash is made from */
typedef void (*config_line_visit_t)(void *ctx, const char *line, bool is_of_machine);

/** Gives every line that a configuration comes to, always in the same order. */
void config_each_line(const config_t *config, config_line_visit_t visit, void *ctx);

/** Fills in config->hash, and config->machine_hash. [platform] approved is part of neither. The machine's has what a person sees
 *  in how the platform rises, and no limits or senders: kind, joints, lengths, strokes, drives with their buses and scales, and
 *  the lines of the switches, where they are no defaults. Allocates nothing. */
void config_hash(config_t *config);

/** True where the configuration says which one was approved, and is another one. */
bool config_is_unapproved(const config_t *config);

#endif
