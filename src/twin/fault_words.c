/* SPDX-License-Identifier: MIT
 * fault_words.c - the words of a fault's line; see fault_words.h.
 */
#include "twin/fault_words.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define INDEX_MAX    0xFFFFu
#define LISTED_FIRST 0x2000u

/* The next word of a line. False where there is none, or it is too long. */
bool fault_next_word(const char **at, char word[FAULT_WORD_MAX])
{
    const char *from = *at + strspn(*at, " \t");
    const size_t length = strcspn(from, " \t");
    if (length == 0 || length >= FAULT_WORD_MAX) {
        return false;
    }
    memcpy(word, from, length);
    word[length] = '\0';
    *at = from + length;
    return true;
}

bool fault_read_drives(const char *word, unsigned drives, uint32_t *out, char why[FAULT_WHY_MAX])
{
    uint32_t found = 0;
    if (drives == 0) {
        (void)snprintf(why, FAULT_WHY_MAX, "there are no drives here: heaved simulates them itself ([drives] driver = sim)");
        return false;
    }
    if (strcmp(word, "all") == 0) {
        *out = (1u << drives) - 1;
        return true;
    }
    for (const char *at = word; *at != '\0';) {
        char *end = NULL;
        const unsigned long number = *at >= '0' && *at <= '9' ? strtoul(at, &end, 10) : 0;
        if (number < 1 || number > drives || (*end != '\0' && (*end != ',' || end[1] == '\0'))) {
            (void)snprintf(why, FAULT_WHY_MAX, "there is no drive %s; the configuration has 1 to %u, several as 2,5, or all",
                           word, drives);
            return false;
        }
        found |= 1u << (number - 1);
        at = *end == ',' ? end + 1 : end;
    }
    *out = found;
    return found != 0;
}

bool fault_read_object(const char *word, uint32_t *out, char why[FAULT_WHY_MAX])
{
    char *end = NULL;
    const unsigned long index = strtoul(word, &end, 16);
    unsigned long sub = 0;
    if (*end == ':' && end[1] != '\0') {
        sub = strtoul(end + 1, &end, 16);
    }
    if (end == word || *end != '\0' || index < 0x1000 || index > INDEX_MAX || sub > 0xFF || word[0] == '-') {
        (void)snprintf(why, FAULT_WHY_MAX, "%s is no object; one is written as 6065 or 1016:1, hexadecimal", word);
        return false;
    }
    objects_t any;
    const uint32_t identity[4] = {0};
    const bool may_be_listed = index >= LISTED_FIRST; /* in a start-up list, which is not known here */
    objects_start(&any, 1, identity, true);
    if (!may_be_listed && objects_find(&any, (uint16_t)index, (uint8_t)sub) == NULL) {
        (void)snprintf(why, FAULT_WHY_MAX, "these drives have no object %04lX:%lX", index, sub);
        return false;
    }
    *out = (uint32_t)(index << 8 | sub);
    return true;
}

bool fault_read_quirk(const char *word, double *out, char why[FAULT_WHY_MAX])
{
    const char *name = NULL;
    quirk_t bit = QUIRK_HIDES_MODE;
    int used = snprintf(why, FAULT_WHY_MAX, "there is no quirk %s; there are", word);
    for (unsigned i = 0; quirk_describe(i, &name, &bit); i++) {
        if (strcmp(word, name) == 0) {
            *out = (double)bit;
            return true;
        }
        used += snprintf(why + used, FAULT_WHY_MAX - (size_t)used, "%s %s", i == 0 ? "" : ",", name);
    }
    return false;
}

bool fault_read_number(const char *word, double most, double *out, char why[FAULT_WHY_MAX])
{
    char *end = NULL;
    const bool is_hex = word[0] == '0' && (word[1] == 'x' || word[1] == 'X');
    const double number = is_hex ? (double)strtoul(word, &end, 16) : strtod(word, &end);
    if (end == word || *end != '\0' || !(number >= 0 && number <= most)) {
        (void)snprintf(why, FAULT_WHY_MAX, "%s is no number from 0 to %.0f", word, most);
        return false;
    }
    *out = number;
    return true;
}
