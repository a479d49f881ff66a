/* SPDX-License-Identifier: MIT
 * pages.c - see pages.h.
 */
#include "panel/pages.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

#define FILE_BYTES_MAX ((long)4 << 20)

static const char *type_of(const char *name)
{
    static const char *const k_types[][2] = {{".html", "text/html; charset=utf-8"},
                                             {".js", "text/javascript; charset=utf-8"},
                                             {".css", "text/css; charset=utf-8"},
                                             {".json", "application/json"},
                                             {".svg", "image/svg+xml"},
                                             {".png", "image/png"},
                                             {".webmanifest", "application/manifest+json"}};
    const char *const dot = strrchr(name, '.');
    for (unsigned i = 0; dot != NULL && i < sizeof k_types / sizeof k_types[0]; i++) {
        if (strcmp(dot, k_types[i][0]) == 0) {
            return k_types[i][1];
        }
    }
    return NULL;
}

static bool load(page_t *page, const char *path, char *why, size_t size)
{
    struct stat status;
    FILE *const file = fopen(path, "rbe");
    const bool is_sized = file != NULL && fstat(fileno(file), &status) == 0 && status.st_size <= FILE_BYTES_MAX;
    page->data = is_sized ? malloc((size_t)status.st_size + 1) : NULL;
    page->length = page->data != NULL ? fread(page->data, 1, (size_t)status.st_size, file) : 0;
    const bool is_read = page->data != NULL && page->length == (size_t)status.st_size;
    if (!is_read) {
        (void)snprintf(why, size, "%s: %s", path, errno != 0 ? strerror(errno) : "larger than 4 MiB");
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return is_read;
}

#define GZIP_WINDOW (MAX_WBITS + 16) /* zlib's way to ask for gzip's head */

/* Phones on a weak network get it in a third of the bytes. What cannot be packed is sent as it is. */
static void pack(page_t *page)
{
    z_stream stream = {.next_in = page->data, .avail_in = (uInt)page->length};
    page->packed = NULL;
    page->packed_length = 0;
    if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, GZIP_WINDOW, MAX_MEM_LEVEL, Z_DEFAULT_STRATEGY) != Z_OK) {
        return;
    }
    unsigned char *const packed = malloc(page->length + 1);
    stream.next_out = packed;
    stream.avail_out = packed != NULL ? (uInt)page->length : 0;
    if (packed != NULL && deflate(&stream, Z_FINISH) == Z_STREAM_END) {
        page->packed = packed;
        page->packed_length = stream.total_out;
    } else {
        free(packed);
    }
    (void)deflateEnd(&stream);
}

bool pages_load(pages_t *self, const char *folder, char *why, size_t size)
{
    DIR *const directory = opendir(folder);
    bool is_right = directory != NULL;
    self->count = 0;
    errno = is_right ? 0 : errno;
    const struct dirent *entry = is_right ? readdir(directory) : NULL;
    for (; is_right && entry != NULL; entry = readdir(directory)) {
        char path[512];
        page_t *const page = &self->page[self->count];
        const char *const type = type_of(entry->d_name);
        if (type == NULL || entry->d_name[0] == '.' || self->count == PAGES_MAX || strlen(entry->d_name) + 2 > PAGES_PATH_MAX) {
            continue;
        }
        (void)snprintf(path, sizeof path, "%s/%.90s", folder, entry->d_name);
        (void)snprintf(page->path, sizeof page->path, "/%.90s", entry->d_name);
        page->type = type;
        is_right = load(page, path, why, size);
        if (is_right) {
            pack(page);
        }
        self->count += is_right;
    }
    if (directory != NULL) {
        (void)closedir(directory);
    }
    if (is_right && pages_find(self, "/") == NULL) {
        (void)snprintf(why, size, "%s: there is no index.html in it", folder);
        return false;
    }
    if (directory == NULL) {
        (void)snprintf(why, size, "%s: %s", folder, strerror(errno));
    }
    return is_right;
}

const page_t *pages_find(const pages_t *self, const char *path)
{
    const char *const wanted = strcmp(path, "/") == 0 ? "/index.html" : path;
    for (unsigned i = 0; i < self->count; i++) {
        if (strcmp(self->page[i].path, wanted) == 0) {
            return &self->page[i];
        }
    }
    return NULL;
}
