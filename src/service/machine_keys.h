/* SPDX-License-Identifier: MIT
 * machine_keys.h - the keys that described the machine when somebody saw it rise as it should, kept in a file, so that what has
 * changed since can be named. The service thread keeps and compares, another one writes. Nothing is allocated.
 */
#ifndef HEAVE_SERVICE_MACHINE_KEYS_H
#define HEAVE_SERVICE_MACHINE_KEYS_H

#include "config/config.h"
#include "config/config_text.h"

#define MACHINE_KEYS_SUFFIX ".machine" /**< of the file, behind the path of the machine's life */
#define MACHINE_KEYS_BYTES  65536u     /**< of the text; of a longer one nothing is kept */

/** Private. */
typedef struct {
    char path[CONFIG_PATH_MAX + sizeof MACHINE_KEYS_SUFFIX];
    char text[MACHINE_KEYS_BYTES]; /**< lines of config_each_line(); "" = not known */
    size_t length;
    bool is_cut;
    uint32_t is_due; /**< atomic: text waits to be written, and belongs to who writes it */
} machine_keys_t;

/** Reads what was kept. Before other threads start.
 *  @param life         path of the machine's life; "" = nothing is kept
 *  @param machine_hash of the configuration that was commissioned: a file of another one is none */
void machine_keys_read(machine_keys_t *self, const char *life, const char *machine_hash);

/** Keeps the keys of a configuration, to be written. The service thread.
 *  @return false: the ones before them are being written; try again */
bool machine_keys_note(machine_keys_t *self, const config_t *config);

/** Writes what waits; blocks. The thread that writes.
 *  @return 0, or an errno: it goes on waiting */
int machine_keys_write(machine_keys_t *self);

/** Names what has changed: the first keys with both values, and how many there are besides. The service thread.
 *  @param text out: "" where nothing has, or nothing is known */
void machine_keys_compare(const machine_keys_t *self, const config_t *config, config_text_t *text);

#endif
