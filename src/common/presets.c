/* SPDX-License-Identifier: MIT
 * presets.c - the folder of ready-made platforms; see presets.h.
 */
#include "common/presets.h"

#include <dirent.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/translate.h"

#define ENDING    ".ini"
#define FOLDER    "/share/heave/presets"
#define NAME_ROOM 20 /* columns of a name */

/* Where they are beside the program: in a build folder, or where an installation was moved to. Empty: they are not there. */
static const char *beside_program(void)
{
    static char path[PATH_MAX + sizeof FOLDER];
    const ssize_t length = readlink("/proc/self/exe", path, PATH_MAX);
    path[length > 0 ? length : 0] = '\0';
    for (unsigned i = 0; i < 2; i++) { /* from bin/heaved */
        char *slash = strrchr(path, '/');
        path[slash != NULL ? slash - path : 0] = '\0';
    }
    memcpy(&path[strlen(path)], FOLDER, sizeof FOLDER);
    return access(path, R_OK) == 0 ? path : "";
}

const char *presets_directory(void)
{
    const char *named = getenv("HEAVE_PRESETS");
    const char *beside = named == NULL || named[0] == '\0' ? beside_program() : named;
    return beside[0] != '\0' ? beside : HEAVE_PRESET_DIRECTORY;
}

bool presets_path(const char *name, char *path, size_t size)
{
    const int length = snprintf(path, size, "%s/%s" ENDING, presets_directory(), name);
    return name[0] != '\0' && name[0] != '.' && strchr(name, '/') == NULL && length > 0 && (size_t)length < size;
}

static int is_preset(const struct dirent *entry)
{
    const size_t length = strlen(entry->d_name);
    return length > strlen(ENDING) && entry->d_name[0] != '.' && strcmp(&entry->d_name[length - strlen(ENDING)], ENDING) == 0;
}

/* "; hexapod-400.ini - a large hexapod" says "a large hexapod". */
static void write_summary(const char *path, FILE *out)
{
    char line[200] = "";
    FILE *file = fopen(path, "re");
    if (file != NULL) {
        if (fgets(line, sizeof line, file) == NULL) {
            line[0] = '\0';
        }
        (void)fclose(file);
    }
    const char *summary = strstr(line, " - ");
    line[strcspn(line, "\r\n")] = '\0';
    fprintf(out, "%s\n", summary == NULL || line[0] != ';' ? "" : translate(summary + strlen(" - ")));
}

int presets_list(FILE *out)
{
    struct dirent **entries = NULL;
    const int count = scandir(presets_directory(), &entries, is_preset, alphasort);
    for (int i = 0; i < count; i++) {
        char path[4096];
        char *name = entries[i]->d_name;
        name[strlen(name) - strlen(ENDING)] = '\0';
        fprintf(out, "%-*s  ", NAME_ROOM, name);
        if (presets_path(name, path, sizeof path)) {
            write_summary(path, out);
        } else {
            fputc('\n', out);
        }
        free(entries[i]);
    }
    free(entries);
    return count;
}
