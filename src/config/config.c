/* SPDX-License-Identifier: MIT
 * config.c - reads the configuration file: lines, sections, keys; every error with its line, none hides another.
 * inih splits the lines. It has no line numbers for its handler, cuts long lines and section names silently, ignores what stands
 * behind a section's bracket, and takes indented lines as continuations: so each line is inspected before inih sees it, and a
 * line that is refused is shown to inih as an empty one.
 */
#include "config/config.h"

#include <errno.h>
#include <fcntl.h>
#include <ini.h>
#include <poll.h>
#include <string.h>
#include <unistd.h>

#include "common/encoding.h"
#include "common/translate.h"
#include "config/source.h"
#include "config/startup.h"
#include "config/startup_read.h"
#include "config/value.h"

#define CONTINUE 1 /* inih: the handler took the pair */

/* --- Lines --- */

/* Reads one line without its end into text.
 * Returns false at the end of the file; *length is the line's whole length, also where text could not hold it. */
static bool copy_line(config_source_t *self, char *text, size_t capacity, size_t *length)
{
    *length = 0;
    if (self->at == self->end) {
        return false;
    }
    for (; self->at < self->end && *self->at != '\n'; self->at++) {
        if (*length < capacity - 1u) {
            text[*length] = *self->at;
        }
        ++*length;
    }
    self->at += self->at < self->end ? 1 : 0;
    self->line++;
    text[*length < capacity ? *length : capacity - 1u] = '\0';
    return true;
}

static bool is_blank(char byte)
{
    return byte == ' ' || byte == '\t';
}

/* Ends the text where a comment starts, by inih's rule: a `;` after a blank. */
static void cut_comment(char *text)
{
    for (size_t i = 1; text[0] != '\0' && text[i] != '\0'; i++) {
        if (text[i] == ';' && is_blank(text[i - 1u])) {
            text[i] = '\0';
            return;
        }
    }
}

static void cut_blanks(char *text)
{
    size_t length = strlen(text);
    while (length > 0 && is_blank(text[length - 1u])) {
        length--;
    }
    text[length] = '\0';
}

/* Offset of a byte that no text file has, or length. */
static size_t find_control(const char *text, size_t length)
{
    size_t i = 0;
    while (i < length && ((unsigned char)text[i] >= 0x20u || text[i] == '\t') && text[i] != 0x7F) {
        i++;
    }
    return i;
}

/* "did you mean [...]", or all sections there are. */
static void reject_section(config_source_t *self, const char *name)
{
    const char *near = config_section_suggest(name);
    config_text_t text;
    config_text_clear(&text);
    config_text_add(&text, "[");
    config_text_add_escaped(&text, name, strlen(name));
    config_text_add(&text, near != NULL ? _("]: unknown section; did you mean [%s]?") : _("]: unknown section; allowed:"), near);
    for (size_t i = 0; near == NULL && i < config_section_count; i++) {
        config_text_add(&text, " %s", config_sections[i].name);
    }
    config_source_error(self, self->line, "%s", text.data);
}

/* Enters the section of a line `[name]`, or refuses it; the keys of a refused section are skipped. */
static void enter_section(config_source_t *self, char *line)
{
    char *end = strchr(line, ']');
    self->section = CONFIG_SECTION_REFUSED;
    if (end == NULL || end[1] != '\0') {
        config_source_error(self, self->line, "malformed section header; allowed: [name] and nothing behind it but a ; comment");
        return;
    }
    *end = '\0';
    const char *name = line + 1;
    const int section = config_section_find(name);
    if (section < 0) {
        reject_section(self, name);
        return;
    }
    if (self->section_line[section] != 0) {
        config_source_error(self, self->line, "[%s]: section given again; allowed: once, and it is at line %u", name,
                            self->section_line[section]);
    } else {
        self->section_line[section] = self->line;
    }
    self->section = section;
}

/* What is neither blank, comment nor section has to have a separator. */
static bool is_pair(config_source_t *self, const char *line)
{
    config_text_t quoted;
    if (strpbrk(line, "=:") != NULL) {
        return true;
    }
    config_text_clear(&quoted);
    config_text_add_quoted(&quoted, line, strlen(line));
    config_source_error(self, self->line, "stray text %s; allowed: key = value, [section], ; comment", quoted.data);
    return false;
}

/* Inspects a line. Returns true where inih shall see it: a key and its value. */
static bool inspect(config_source_t *self, char *line, size_t length)
{
    const size_t blanks = strspn(line, " \t");
    const size_t control = find_control(line, length);
    if (control < length) {
        config_source_error(self, self->line, "control character \\x%02X; allowed: plain text (UTF-8)",
                            (unsigned char)line[control]);
        return false;
    }
    if (line[blanks] == '\0' || line[blanks] == ';' || line[blanks] == '#') {
        return false;
    }
    if (blanks > 0) {
        config_source_error(self, self->line,
                            "indented line; allowed: sections and keys in the first column, values on one line");
        return false;
    }
    cut_comment(line);
    cut_blanks(line);
    if (line[0] == '[') {
        enter_section(self, line);
        return false;
    }
    return is_pair(self, line);
}

/* An encoding that cannot be read is the only error that is told. */
static bool is_utf16(config_source_t *self, const char *line, size_t length)
{
    self->is_given_up = self->line == 1u && encoding_is_utf16(line, length);
    if (self->is_given_up) {
        config_source_error(self, self->line, "the file is UTF-16; allowed: plain text (UTF-8)");
    }
    return self->is_given_up;
}

/* inih's line source, as fgets. */
static char *read_line(char *text, int size, void *stream)
{
    config_source_t *self = stream;
    const size_t longest = (size_t)size - 3u; /* inih: room for CR, LF, NUL */
    size_t length = 0;
    if (self->is_given_up || !copy_line(self, text, (size_t)size, &length) || is_utf16(self, text, length)) {
        return NULL;
    }
    if (length > 0 && length < (size_t)size && text[length - 1u] == '\r') {
        text[--length] = '\0';
    }
    const size_t mark = self->line == 1u ? encoding_mark(text, length) : 0;
    if (length > longest) {
        if (text[mark] != ';' && text[mark] != '#') { /* a comment is as long as it likes: nobody keeps it */
            config_source_error(self, self->line, "line of %zu bytes; allowed: at most %zu", length, longest);
        }
        text[0] = '\0';
    } else {
        memmove(text, text + mark, length - mark + 1u);
        if (!inspect(self, text, length - mark)) {
            text[0] = '\0';
        }
    }
    strcat(text, "\n");
    return text;
}

/* --- Keys --- */

/* "did you mean ...", or where the key belongs, or what the section takes. */
static void suggest_key(const char *section, const char *name, config_text_t *text)
{
    const char *near = config_key_suggest(section, name);
    if (near != NULL) {
        config_text_add(text, _("did you mean %s?"), near);
        return;
    }
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].name, name) == 0) {
            config_text_add(text, _("it belongs to [%s]"), config_keys[i].section);
            return;
        }
    }
    config_text_add(text, _("[%s] takes"), section);
    for (size_t i = 0; i < config_key_count; i++) {
        if (strcmp(config_keys[i].section, section) == 0) {
            config_text_add(text, " %s", config_keys[i].name);
        }
    }
}

static void reject_key(config_source_t *self, const char *section, const char *name)
{
    config_text_t text;
    config_text_clear(&text);
    config_text_add(&text, "[%s] ", section);
    config_text_add_escaped(&text, name, strlen(name));
    config_text_add(&text, _(": unknown key; "));
    suggest_key(section, name, &text);
    config_source_error(self, self->line, "%s", text.data);
}

static void parse_value(config_source_t *self, const config_key_t *key, config_entry_t *entry, const char *value)
{
    config_text_t why;
    config_text_clear(&why);
    entry->line = self->line;
    entry->is_valid = config_value_parse(key, value, self->config, &entry->count, &why);
    if (!entry->is_valid) {
        config_source_error(self, self->line, "[%s] %s: %s", key->section, key->name, why.data);
    }
}

/* inih's handler: one key and its value. The reader keeps track of the section. */
static int parse_pair(void *user, const char *section, const char *name, const char *value)
{
    config_source_t *self = user;
    (void)section;
    if (self->section == CONFIG_SECTION_NONE) {
        config_source_error(self, self->line, "a key before any section; allowed: [section] first");
    }
    if (self->section < 0) {
        return CONTINUE;
    }
    const char *in = config_sections[self->section].name;
    if (config_startup_of(&config_sections[self->section], self->config) != NULL) {
        config_startup_parse(self, name, value);
        return CONTINUE;
    }
    const int key = config_key_find(in, name);
    if (key < 0) {
        reject_key(self, in, name);
    } else if (self->entry[key].line != 0) {
        config_source_error(self, self->line, "[%s] %s: given again; allowed: once, and it is at line %u", in, name,
                            self->entry[key].line);
    } else {
        parse_value(self, &config_keys[key], &self->entry[key], value);
    }
    return CONTINUE;
}

/* --- The file --- */

/* Gives every key that has one its default. */
static void set_defaults(config_source_t *self)
{
    for (size_t i = 0; i < config_key_count; i++) {
        config_text_t why;
        config_text_clear(&why);
        if (config_keys[i].fallback == NULL) {
            continue;
        }
        self->entry[i].is_valid =
            config_value_parse(&config_keys[i], config_keys[i].fallback, self->config, &self->entry[i].count, &why);
        HV_ASSERT(self->entry[i].is_valid);
    }
}

static void read_file(config_source_t *self)
{
    const int bad_line = ini_parse_stream(read_line, self, parse_pair, self);
    if (bad_line != 0 && self->error_count == 0) {
        config_source_error(self, bad_line > 0 ? (unsigned)bad_line : 0u, _("not understood; allowed: key = value"));
    }
}

/* Waits until there is something to read, or an end: a pipe may have nobody yet who writes.
 * Returns false: errno says why. */
static bool await_bytes(int fd, int wait_ms)
{
    struct pollfd wait = {.fd = fd, .events = POLLIN};
    int ready = -1;
    do {
        ready = poll(&wait, 1, wait_ms);
    } while (ready < 0 && errno == EINTR);
    if (ready == 0) {
        errno = ETIMEDOUT;
    }
    return ready > 0;
}

/* The bytes of a file: nothing is allocated, so that it may be read again in operation, and nothing is waited for in vain.
 * Returns their number, or -1: errno says why. */
static ssize_t read_bytes(const char *path, char *bytes, size_t capacity, int wait_ms)
{
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    size_t length = 0;
    ssize_t got = fd < 0 ? -1 : 1;
    while (got > 0 && length < capacity) {
        got = await_bytes(fd, wait_ms) ? read(fd, &bytes[length], capacity - length) : -1;
        length += got > 0 ? (size_t)got : 0u;
    }
    const int error = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return got < 0 ? -1 : (ssize_t)length;
}

ssize_t config_read(const char *path, char text[CONFIG_TEXT_BYTES])
{
    return read_bytes(path, text, CONFIG_TEXT_BYTES, 0);
}

/* Where the file is longer than what is kept of it, or cannot be read, that is the only error. */
static bool open_bytes(config_source_t *self, const config_text_source_t *from)
{
    static char bytes[CONFIG_TEXT_BYTES];
    ssize_t length = from->length;
    if (from->text == NULL) {
        length = read_bytes(self->path, bytes, sizeof bytes, self->wait_ms);
        length = length < 0 ? -errno : length;
    }
    if (length == -ETIMEDOUT) {
        config_source_error(self, 0, "nothing came from it within %d s; allowed: a file, or a pipe that somebody writes to",
                            self->wait_ms / 1000);
        return false;
    }
    if (length < 0) {
        const bool is_opened = length == -EISDIR || length == -EIO;
        config_source_error(self, 0, "cannot be %s: %s; allowed: a readable text file", is_opened ? _("read") : _("opened"),
                            error_text((int)-length));
        return false;
    }
    if (length > (ssize_t)CONFIG_FILE_MAX) {
        config_source_error(self, 0, "is larger than %u bytes; allowed: a configuration of one platform", CONFIG_FILE_MAX);
        return false;
    }
    self->at = from->text != NULL ? from->text : bytes;
    self->end = self->at + length;
    return true;
}

bool config_source_read(config_source_t *self, const config_text_source_t *from, config_t *config, FILE *errors)
{
    HV_ASSERT(config_key_count <= CONFIG_KEYS_MAX && config_section_count <= CONFIG_SECTIONS_MAX);
    memset(config, 0, sizeof *config);
    memset(self, 0, sizeof *self);
    self->path = from->name;
    self->wait_ms = from->wait_ms;
    self->errors = errors;
    self->config = config;
    self->section = CONFIG_SECTION_NONE;
    if (!open_bytes(self, from)) {
        return false;
    }
    set_defaults(self);
    read_file(self);
    return !self->is_given_up;
}
