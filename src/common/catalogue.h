/* SPDX-License-Identifier: MIT
 * catalogue.h - a file of translations as msgfmt of GNU gettext writes it (.mo), looked into where it lies.
 *
 * Not by gettext() of the C library: that translates in locales only that were made on the box, of which a small Debian has none
 * but C and C.UTF-8; it allocates when it meets a text for the first time; and it cannot be walked through, which heavectl needs
 * to find the text of a sentence that heaved has filled in already.
 */
#ifndef HEAVE_COMMON_CATALOGUE_H
#define HEAVE_COMMON_CATALOGUE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** An open file. All zero: none, in which nothing is found. */
typedef struct {
    const uint8_t *bytes; /**< mapped, read only */
    size_t size;
    uint32_t count;     /**< of its texts */
    uint32_t originals; /**< offset of their table, sorted by strcmp() */
    uint32_t translations;
} catalogue_t;

/** Maps a file and looks at it as a whole, so that nothing is checked later. Blocks on the disk; no other function does.
 *  @return false: there is none, or it is none that can be used; *self is empty then */
bool catalogue_open(catalogue_t *self, const char *path);
void catalogue_close(catalogue_t *self);

/** @return the translation, in place; NULL: there is none, or it is empty. Of texts with a plural the first form */
const char *catalogue_find(const catalogue_t *self, const char *original);

/** The text at a place below count, and its translation. */
const char *catalogue_original(const catalogue_t *self, uint32_t at);
const char *catalogue_translation(const catalogue_t *self, uint32_t at);

#endif
