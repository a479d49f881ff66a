/* SPDX-License-Identifier: MIT
 * build_id.c - what this very program is recognised by; see build_id.h.
 */
#include "common/build_id.h"

#include <elf.h>
#include <link.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define BUILD_ID_MAX 41u /* 20 bytes in hexadecimal, and a NUL */

static size_t padded(uint32_t bytes)
{
    return ((size_t)bytes + 3u) & ~(size_t)3u;
}

/* Looks through the notes of a segment. */
static int find(const uint8_t *at, size_t left, char *text)
{
    ElfW(Nhdr) note;
    while (left >= sizeof note) {
        memcpy(&note, at, sizeof note);
        const size_t whole = sizeof note + padded(note.n_namesz) + padded(note.n_descsz);
        const uint8_t *const name = at + sizeof note;
        if (whole > left) {
            return 0;
        }
        if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 && memcmp(name, "GNU", 4) == 0) {
            for (uint32_t i = 0; i < note.n_descsz && 2 * i + 2 < BUILD_ID_MAX; i++) {
                (void)snprintf(&text[2 * i], 3, "%02x", (unsigned)name[4 + i]);
            }
            return 1;
        }
        at += whole;
        left -= whole;
    }
    return 0;
}

/* The first object is the program; no other is looked at. */
static int look(struct dl_phdr_info *info, size_t size, void *text)
{
    (void)size;
    for (unsigned i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *segment = &info->dlpi_phdr[i];
        const uintptr_t at = (uintptr_t)(info->dlpi_addr + segment->p_vaddr);
        if (segment->p_type == PT_NOTE &&
            find((const uint8_t *)at, segment->p_memsz, text) != 0) { /* NOLINT(performance-no-int-to-ptr) */
            break;
        }
    }
    return 1;
}

const char *build_id(void)
{
    static char text[BUILD_ID_MAX];
    if (text[0] == '\0') {
        (void)snprintf(text, sizeof text, "unknown");
        (void)dl_iterate_phdr(look, text);
    }
    return text;
}
