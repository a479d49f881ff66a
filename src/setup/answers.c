/* SPDX-License-Identifier: MIT
 * answers.c - see answers.h and setup.h. As a file they are JSON, for whoever wants to look.
 */
#include "setup/answers.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/atomic_file.h"

#define VERSION  1
#define FILE_MAX 262144u

static int index_of(const setup_t *self, const char *key)
{
    for (unsigned i = 0; i < self->count; i++) {
        if (strcmp(self->answer[i].key, key) == 0) {
            return (int)i;
        }
    }
    return -1;
}

const char *setup_get(const setup_t *self, const char *key)
{
    const int index = index_of(self, key);
    return index >= 0 ? self->answer[index].text : NULL;
}

const char *answers_get_nth(const setup_t *self, const char *key, unsigned index)
{
    char name[SETUP_KEY_MAX];
    (void)snprintf(name, sizeof name, "%s.%u", key, index);
    return setup_get(self, index == 0 ? key : name);
}

double answers_number(const setup_t *self, const char *key, unsigned index)
{
    const char *text = answers_get_nth(self, key, index);
    return text != NULL ? strtod(text, NULL) : 0;
}

bool answers_is(const setup_t *self, const char *key, const char *text)
{
    const char *is = setup_get(self, key);
    return is != NULL && strcmp(is, text) == 0;
}

bool answers_set(setup_t *self, const char *key, const char *text)
{
    int index = index_of(self, key);
    if (index < 0 && self->count == SETUP_ANSWERS_MAX) {
        return false;
    }
    index = index < 0 ? (int)self->count++ : index;
    (void)snprintf(self->answer[index].key, SETUP_KEY_MAX, "%s", key);
    (void)snprintf(self->answer[index].text, SETUP_ANSWER_MAX, "%s", text);
    return true;
}

void answers_drop(setup_t *self, const char *beginning)
{
    unsigned kept = 0;
    for (unsigned i = 0; i < self->count; i++) {
        if (strncmp(self->answer[i].key, beginning, strlen(beginning)) != 0) {
            self->answer[kept++] = self->answer[i];
        }
    }
    self->count = kept;
}

/* One line each; what is said twice is said once. */
void answers_note(setup_t *self, const char *text)
{
    char key[SETUP_KEY_MAX], line[SETUP_ANSWER_MAX];
    while (*text != '\0') {
        const size_t length = strcspn(text, "\n");
        (void)snprintf(line, sizeof line, "%.*s", (int)length, text);
        text += length + (text[length] == '\n');
        unsigned number = 1;
        for (const char *old = answers_get_nth(self, "note", number); old != NULL && strcmp(old, line) != 0;
             old = answers_get_nth(self, "note", number)) {
            number++;
        }
        (void)snprintf(key, sizeof key, "note.%u", number);
        (void)answers_set(self, key, line);
    }
}

unsigned answers_list(const char *text, double *number, unsigned most)
{
    unsigned count = 0;
    while (text != NULL && count < most) {
        char *end = NULL;
        number[count] = strtod(text, &end);
        if (end == text) {
            break;
        }
        count++;
        end += strspn(end, " \t");
        end += *end == '/' ? strcspn(end, ",") : 0; /* "3/0x1A2B": what belongs to it */
        text = *end == ',' ? end + 1 : NULL;
    }
    return count;
}

const char *setup_driver(const setup_t *self)
{
    const char *driver = setup_get(self, "driver");
    return driver != NULL ? driver : "";
}

unsigned setup_cylinders(const setup_t *self)
{
    const char *kind = setup_get(self, "kind");
    return kind == NULL ? 0 : strcmp(kind, "hexapod") == 0 ? 6u : 3u;
}

bool setup_save(const setup_t *self, const char *path)
{
    static atomic_file_t file;
    cJSON *root = cJSON_CreateObject(), *list = cJSON_CreateArray();
    for (unsigned i = 0; i < self->count && list != NULL; i++) {
        cJSON *one = cJSON_CreateArray();
        (void)cJSON_AddItemToArray(one, cJSON_CreateString(self->answer[i].key));
        (void)cJSON_AddItemToArray(one, cJSON_CreateString(self->answer[i].text));
        (void)cJSON_AddItemToArray(list, one);
    }
    (void)cJSON_AddNumberToObject(root, "heave_setup", VERSION);
    (void)cJSON_AddItemToObject(root, "answers", list);
    char *text = cJSON_Print(root);
    cJSON_Delete(root);
    errno = ENOMEM;
    bool is_saved = text != NULL && atomic_file_open(&file, path);
    if (is_saved) {
        (void)fprintf(file.stream, "%s\n", text);
        is_saved = atomic_file_close(&file);
    }
    cJSON_free(text);
    return is_saved;
}

static bool parse(setup_t *self, const cJSON *root)
{
    const cJSON *one = NULL, *version = cJSON_GetObjectItemCaseSensitive(root, "heave_setup");
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(root, "answers");
    bool is_right = cJSON_IsNumber(version) && version->valueint == VERSION && cJSON_IsArray(list);
    cJSON_ArrayForEach(one, list)
    {
        const cJSON *key = cJSON_GetArrayItem(one, 0), *text = cJSON_GetArrayItem(one, 1);
        is_right = is_right && cJSON_IsString(key) && cJSON_IsString(text) && strlen(key->valuestring) < SETUP_KEY_MAX &&
                   strlen(text->valuestring) < SETUP_ANSWER_MAX && answers_set(self, key->valuestring, text->valuestring);
    }
    return is_right;
}

bool setup_load(setup_t *self, const char *path)
{
    static char text[FILE_MAX];
    self->count = 0;
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        return false;
    }
    const size_t length = fread(text, 1, sizeof text - 1u, file);
    const int error = ferror(file) != 0 ? errno : 0;
    (void)fclose(file);
    text[length] = '\0';
    cJSON *root = error == 0 ? cJSON_Parse(text) : NULL;
    const bool is_right = root != NULL && parse(self, root);
    cJSON_Delete(root);
    self->count = is_right ? self->count : 0;
    errno = error != 0 ? error : EINVAL;
    return is_right;
}
