/* SPDX-License-Identifier: MIT
 * translate.c - see translate.h.
 */
#include "common/translate.h"

#include <langinfo.h>
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define LANGUAGE_BYTES 32u
#define PATH_BYTES     512u

/* One language for all of a program, as its reader is one. Set before there are threads. */
static struct {
    catalogue_t catalogue;
    char language[LANGUAGE_BYTES];
} s_texts;

/* What the locale's variables say of a category; "" where they say nothing. */
static const char *locale_of(const char *category)
{
    const char *const names[] = {"LC_ALL", category, "LANG"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const char *value = getenv(names[i]);
        if (value != NULL && value[0] != '\0') {
            return value;
        }
    }
    return "";
}

/* Characters as the terminal has them: also where the locale that is asked for was never made on this box.
 * Returns whether they are UTF-8. */
static bool set_characters(void)
{
    const char *codeset = strchr(locale_of("LC_CTYPE"), '.');
    if (setlocale(LC_CTYPE, "") == NULL) {
        const bool is_utf8 = codeset != NULL && (strncasecmp(codeset, ".UTF-8", 6) == 0 || strncasecmp(codeset, ".utf8", 5) == 0);
        (void)setlocale(LC_CTYPE, is_utf8 ? "C.UTF-8" : "C");
    }
    return strcmp(nl_langinfo(CODESET), "UTF-8") == 0;
}

/* Tries a folder of the catalogues: HEAVE_LOCALES names another place for all of them. */
static bool open_language(const char *language, size_t length)
{
    const char *elsewhere = getenv("HEAVE_LOCALES");
    char path[PATH_BYTES];
    if (length == 0 || length >= LANGUAGE_BYTES || memchr(language, '/', length) != NULL) {
        return false;
    }
    const int bytes =
        snprintf(path, sizeof path, "%s/%.*s/LC_MESSAGES/heave.mo",
                 elsewhere != NULL && elsewhere[0] != '\0' ? elsewhere : HEAVE_LOCALE_DIRECTORY, (int)length, language);
    if (bytes < 0 || (size_t)bytes >= sizeof path || !catalogue_open(&s_texts.catalogue, path)) {
        return false;
    }
    (void)snprintf(s_texts.language, sizeof s_texts.language, "%.*s", (int)length, language);
    return true;
}

/* A locale's name without codeset and modifier, then its language alone. There is one written Chinese, which is better than none
 * for those who read another.
 * Returns true: it is settled; English needs no catalogue. */
static bool open_locale(const char *name, size_t length)
{
    const size_t territory = strcspn(name, ".@:");
    const size_t language = strcspn(name, "_.@:");
    length = territory < length ? territory : length;
    const size_t alone = language < length ? language : length;
    if ((alone == 2u && memcmp(name, "en", 2) == 0) || (length == 1u && name[0] == 'C')) {
        return true;
    }
    return open_language(name, length) || open_language(name, alone) ||
           (alone == 2u && memcmp(name, "zh", 2) == 0 && open_language("zh_CN", 5));
}

void translate_begin(void)
{
    const char *locale = locale_of("LC_MESSAGES");
    const char *wishes = getenv("LANGUAGE");
    translate_end();
    if (!set_characters() || locale[0] == '\0' || strcmp(locale, "C") == 0 || strcmp(locale, "POSIX") == 0) {
        return;
    }
    while (wishes != NULL && wishes[0] != '\0') {
        const size_t length = strcspn(wishes, ":");
        if (length > 0 && open_locale(wishes, length)) {
            return;
        }
        wishes += length + (wishes[length] == ':' ? 1u : 0u);
    }
    (void)open_locale(locale, strlen(locale));
}

bool translate_begin_in(const char *language)
{
    translate_end();
    return open_language(language, strlen(language));
}

void translate_end(void)
{
    catalogue_close(&s_texts.catalogue);
    (void)snprintf(s_texts.language, sizeof s_texts.language, "en");
}

const char *translate_language(void)
{
    return s_texts.language[0] != '\0' ? s_texts.language : "en";
}

const char *translate(const char *text)
{
    const char *found = catalogue_find(&s_texts.catalogue, text);
    return found != NULL ? found : text;
}

const char *translate_count(const char *one, const char *many, unsigned long count)
{
    const char *found = catalogue_find(&s_texts.catalogue, one);
    return found != NULL ? found : count == 1u ? one : many;
}

const catalogue_t *translate_catalogue(void)
{
    return &s_texts.catalogue;
}

const char *error_text(int error)
{
    /* Those of the C library, which a catalogue translates; others are shown by their name there. */
    static const char *const k_known[] = {
        N_("Operation not permitted"),
        N_("No such file or directory"),
        N_("Input/output error"),
        N_("No such device or address"),
        N_("Bad file descriptor"),
        N_("Resource temporarily unavailable"),
        N_("Cannot allocate memory"),
        N_("Permission denied"),
        N_("Device or resource busy"),
        N_("File exists"),
        N_("Invalid cross-device link"),
        N_("No such device"),
        N_("Not a directory"),
        N_("Is a directory"),
        N_("Invalid argument"),
        N_("Too many open files in system"),
        N_("Too many open files"),
        N_("Inappropriate ioctl for device"),
        N_("Text file busy"),
        N_("File too large"),
        N_("No space left on device"),
        N_("Read-only file system"),
        N_("Broken pipe"),
        N_("File name too long"),
        N_("Directory not empty"),
        N_("Too many levels of symbolic links"),
        N_("Protocol not supported"),
        N_("Operation not supported"),
        N_("Address family not supported by protocol"),
        N_("Address already in use"),
        N_("Cannot assign requested address"),
        N_("Network is down"),
        N_("Network is unreachable"),
        N_("Connection reset by peer"),
        N_("No buffer space available"),
        N_("Connection timed out"),
        N_("Connection refused"),
        N_("No route to host"),
        N_("Disk quota exceeded"),
        N_("Interrupted system call"),
    };
    static char unknown[32]; /* one thread tells a person of an error; the log uses strerror() */
    const char *text = strerror(error);
    for (size_t i = 0; i < sizeof k_known / sizeof k_known[0]; i++) {
        if (strcmp(k_known[i], text) == 0) {
            return translate(k_known[i]);
        }
    }
    if (s_texts.catalogue.count == 0) {
        return text;
    }
    (void)snprintf(unknown, sizeof unknown, "%s", strerrorname_np(error) != NULL ? strerrorname_np(error) : "?");
    return unknown;
}
