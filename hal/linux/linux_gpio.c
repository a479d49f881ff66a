/* SPDX-License-Identifier: MIT
 * linux_gpio.c - from names of lines to a chip and offsets, and requesting them; see linux_gpio.h.
 */
#include "linux_gpio.h"

#include <dirent.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ALL_LINES(count) ((1u << (count)) - 1u)

/** What looking at all chips has come to. */
typedef struct {
    const linux_gpio_names_t *names;
    linux_gpio_place_t *place; /**< the first chip that has them all */
    unsigned chips;            /**< that could be looked at */
    unsigned refused;          /**< that could not, or are not known of */
    int error;                 /**< of the last one refused */
    unsigned labelled;         /**< of those with the right label */
    unsigned complete;         /**< of these, with all lines */
    uint32_t found;            /**< lines that are on any of them */
    char labels[96];           /**< of all chips, as far as they fit */
} search_t;

__attribute__((format(printf, 2, 3))) static void put(char text[LINUX_GPIO_TEXT_SIZE], const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, LINUX_GPIO_TEXT_SIZE, format, arguments);
    va_end(arguments);
}

static bool is_number(const char *text)
{
    return text[0] != '\0' && strspn(text, "0123456789") == strlen(text);
}

static bool has_label(const linux_gpio_names_t *names)
{
    return names->chip != NULL && names->chip[0] != '\0';
}

/* --- Looking at chips --- */

/* Finds what is asked for among the lines of a chip.
 * Returns a bit for each that is there. */
static uint32_t find_lines(linux_gpio_chip_t *chip, unsigned lines, const linux_gpio_names_t *names, unsigned *offset)
{
    uint32_t found = 0;
    for (unsigned i = 0; i < names->count; i++) {
        const unsigned long number = strtoul(names->line[i], NULL, 10);
        if (is_number(names->line[i]) && number < lines) {
            offset[i] = (unsigned)number;
            found |= 1u << i;
        }
    }
    for (unsigned at = 0; at < lines; at++) {
        linux_gpio_line_info_t info;
        if (linux_gpio_chip_line(chip, at, &info) != 0) {
            continue;
        }
        for (unsigned i = 0; i < names->count; i++) {
            if (info.name[0] != '\0' && strcmp(info.name, names->line[i]) == 0 && (found >> i & 1u) == 0) {
                offset[i] = at;
                found |= 1u << i;
            }
        }
    }
    return found;
}

static void look_at_lines(search_t *search, linux_gpio_chip_t *chip, const char *path, const linux_gpio_chip_info_t *info)
{
    linux_gpio_place_t place = {.count = search->names->count};
    const uint32_t found = find_lines(chip, info->lines, search->names, place.offset);
    search->labelled++;
    search->found |= found;
    if (found != ALL_LINES(search->names->count)) {
        return;
    }
    if (search->complete == 0) {
        (void)snprintf(place.path, sizeof place.path, "%s", path);
        memcpy(place.label, info->label, sizeof place.label);
        *search->place = place;
    }
    search->complete++;
}

static void note_label(search_t *search, const char *label)
{
    const size_t used = strlen(search->labels);
    (void)snprintf(&search->labels[used], sizeof search->labels - used, "%s%s", used == 0 ? "" : ", ", label);
}

static void note_refused(search_t *search, int error)
{
    search->refused++;
    search->error = error;
}

static void look_at_chip(search_t *search, const char *path)
{
    linux_gpio_chip_t chip;
    linux_gpio_chip_info_t info;
    const int error = linux_gpio_chip_open(&chip, path, &info);
    if (error != 0) {
        note_refused(search, error);
        return;
    }
    search->chips++;
    note_label(search, info.label);
    if (!has_label(search->names) || strcmp(info.label, search->names->chip) == 0) {
        look_at_lines(search, &chip, path, &info);
    }
    linux_gpio_chip_close(&chip);
}

/* The next entry; NULL at the end, or where the folder cannot be read any further. */
static const struct dirent *next_entry(search_t *search, DIR *folder)
{
    errno = 0;
    const struct dirent *entry = readdir(folder);
    if (entry == NULL && errno != 0) {
        note_refused(search, errno);
    }
    return entry;
}

static void look_at_all(search_t *search)
{
    DIR *folder = opendir("/dev");
    const struct dirent *entry;
    if (folder == NULL) {
        note_refused(search, errno);
        return;
    }
    while ((entry = next_entry(search, folder)) != NULL) {
        char path[LINUX_GPIO_NAME_SIZE];
        if (strncmp(entry->d_name, "gpiochip", 8) == 0 &&
            snprintf(path, sizeof path, "/dev/%s", entry->d_name) < (int)sizeof path) {
            look_at_chip(search, path);
        }
    }
    (void)closedir(folder);
}

/* --- What came of it, in words --- */

static hv_status_t describe_nothing_seen(const search_t *search, char text[LINUX_GPIO_TEXT_SIZE])
{
    if (search->refused == 0) {
        put(text, "gpio: this machine has no GPIO chip (/dev/gpiochip*)");
    } else if (search->error == EACCES || search->error == EPERM) {
        put(text, "gpio: not allowed to open /dev/gpiochip*: this user has to be in their group (see docs/gpio.md)");
    } else {
        put(text, "gpio: /dev/gpiochip* cannot be opened: %s", strerror(search->error));
    }
    return HV_ERR_NOSUP;
}

static hv_status_t describe_missing(const search_t *search, char text[LINUX_GPIO_TEXT_SIZE])
{
    const linux_gpio_names_t *names = search->names;
    unsigned first = 0;
    while ((search->found >> first & 1u) != 0) {
        first++;
    }
    if (first == names->count) {
        put(text, "gpio: the lines are not all on one chip, as they have to be");
    } else if (has_label(names)) {
        put(text, "gpio: chip %s has no line %s (gpioinfo lists what there is)", names->chip, names->line[first]);
    } else {
        put(text, "gpio: no chip has a line %s (gpioinfo lists what there is)", names->line[first]);
    }
    return HV_ERR_RANGE;
}

static hv_status_t describe(const search_t *search, char text[LINUX_GPIO_TEXT_SIZE])
{
    if (search->complete == 1) {
        text[0] = '\0';
        return HV_OK;
    }
    if (search->chips == 0) {
        return describe_nothing_seen(search, text);
    }
    if (search->labelled == 0) {
        put(text, "gpio: no chip has the label %s; there are: %s", search->names->chip, search->labels);
        return HV_ERR_RANGE;
    }
    if (search->complete > 1) {
        put(text,
            has_label(search->names) ? "gpio: %u chips have the label %s and these lines: name lines that only one has"
                                     : "gpio: %u chips have these lines: say which one by its label",
            search->complete, search->names->chip);
        return HV_ERR_RANGE;
    }
    return describe_missing(search, text);
}

hv_status_t linux_gpio_find(const linux_gpio_names_t *names, linux_gpio_place_t *place, char text[LINUX_GPIO_TEXT_SIZE])
{
    search_t search = {.names = names, .place = place};
    for (unsigned i = 0; i < names->count; i++) {
        if (!has_label(names) && is_number(names->line[i])) {
            put(text, "gpio: %s alone is no line: it takes the label of its chip", names->line[i]);
            return HV_ERR_RANGE;
        }
    }
    look_at_all(&search);
    const hv_status_t status = describe(&search, text);
    if (search.chips > 0 && search.complete == 0 && search.refused > 0) {
        const size_t used = strlen(text);
        (void)snprintf(&text[used], LINUX_GPIO_TEXT_SIZE - used, "; not every chip could be looked at: %s",
                       strerror(search.error));
    }
    return status;
}

/* --- Requesting --- */

static void describe_refused(linux_gpio_chip_t *chip, const linux_gpio_names_t *names, const linux_gpio_place_t *place, int error,
                             char text[LINUX_GPIO_TEXT_SIZE])
{
    for (unsigned i = 0; error == EBUSY && i < place->count; i++) {
        linux_gpio_line_info_t info;
        if (linux_gpio_chip_line(chip, place->offset[i], &info) == 0 && info.is_used) {
            put(text, "gpio: line %s of chip %s is in use by %s%s%s", names->line[i], place->label,
                info.consumer[0] != '\0' ? "\"" : "", info.consumer[0] != '\0' ? info.consumer : "somebody",
                info.consumer[0] != '\0' ? "\"" : "");
            return;
        }
    }
    put(text, "gpio: the lines of chip %s cannot be requested: %s", place->label, strerror(error));
}

hv_status_t linux_gpio_request(linux_gpio_chip_t *chip, const linux_gpio_names_t *names, linux_gpio_request_t *request,
                               char text[LINUX_GPIO_TEXT_SIZE])
{
    linux_gpio_place_t place;
    linux_gpio_chip_info_t info;
    memset(chip, 0, sizeof *chip);
    if (linux_gpio_find(names, &place, text) != HV_OK) {
        return HV_ERR_IO;
    }
    request->count = place.count;
    memcpy(request->offset, place.offset, sizeof request->offset);
    int error = linux_gpio_chip_open(chip, place.path, &info);
    if (error != 0) {
        put(text, "gpio: %s cannot be opened: %s", place.path, strerror(error));
        return HV_ERR_IO;
    }
    error = linux_gpio_chip_request(chip, request);
    if (error != 0 && error != EBUSY && request->has_edges) { /* a chip without interrupts */
        request->has_edges = false;
        error = linux_gpio_chip_request(chip, request);
    }
    if (error != 0) {
        describe_refused(chip, names, &place, error, text);
        linux_gpio_chip_close(chip);
        return HV_ERR_IO;
    }
    return HV_OK;
}
