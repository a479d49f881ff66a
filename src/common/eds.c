/* SPDX-License-Identifier: MIT
 * eds.c - reads an EDS or DCF; see eds.h.
 */
#include "common/eds.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/encoding.h"
#include "common/translate.h"
#define LINE_BYTES  1024u
#define NAME_BYTES  40u
#define OBJECTS_MAX 65536u
#define BLANKS      " \t\r\n"

/* Kinds of objects. */
#define TYPE_ARRAY  8
#define TYPE_RECORD 9

#define TYPE_U8   5u
#define RPDOS     0x1400u
#define TPDOS     0x1800u
#define PDOS_END  0x1C00u
#define PDO_COUNT 0x200u /* from the communication of a PDO to its map */

const unsigned eds_bitrates_kbps[] = {10, 20, 50, 125, 250, 500, 800, 1000, 0};

static const struct {
    uint16_t type;
    uint8_t bytes;
    const char *name;
} k_types[] = {{1, 1, "u8"}, {2, 1, "i8"}, {3, 2, "i16"}, {4, 4, "i32"}, {5, 1, "u8"}, {6, 2, "u16"}, {7, 4, "u32"}};
#define TYPES (sizeof k_types / sizeof k_types[0])

/** A file while it is read. */
typedef struct {
    eds_t *eds;
    const char *name;
    FILE *errors;
    unsigned line;
    eds_object_t *object; /* whose section this is, NULL where it is another one */
    bool is_group;        /* it is an array or a record */
    bool is_device;       /* [DeviceInfo] */
    bool is_drive;        /* [DeviceComissioning], as the standard spells it */
    bool has_values;      /* [1010Value]: of an array written in short */
    uint16_t array;       /* whose values these are */
    bool is_bad;
} reader_t;

static void complain(reader_t *self, const char *what, const char *about)
{
    fprintf(self->errors, "%s:%u: %.60s: %s\n", self->name, self->line, about, what);
    self->is_bad = true;
}

/* Cuts blanks off both ends. */
static char *trimmed(char *text)
{
    text += strspn(text, BLANKS);
    size_t length = strlen(text);
    while (length > 0 && strchr(BLANKS, text[length - 1u]) != NULL) {
        text[--length] = '\0';
    }
    return text;
}

/* FNV-1a, so that equal texts are seen. */
static int64_t hash_of(const char *text)
{
    uint64_t hash = 0xCBF29CE484222325u;
    for (; *text != '\0'; text++) {
        hash = (hash ^ (unsigned char)*text) * 0x100000001B3u;
    }
    return (int64_t)hash;
}

/* A number, $NODEID, or the sum of both in any order; what is none is a text. */
static eds_number_t number(const char *text)
{
    static const char k_node[] = "$NODEID";
    eds_number_t out = {.is_there = true};
    const char *at = text;
    bool has_value = false;
    do {
        char *end = NULL;
        at += strspn(at, " ");
        if (!out.has_node && strncasecmp(at, k_node, sizeof k_node - 1u) == 0) {
            out.has_node = true;
            at += sizeof k_node - 1u;
        } else {
            errno = 0;
            out.value = strtoll(at, &end, 0);
            out.is_there = out.is_there && !has_value && end != at && errno == 0;
            has_value = true;
            at = end;
        }
        at += strspn(at, " ");
    } while (out.is_there && *at++ == '+');
    if (!out.is_there || at[-1] != '\0') {
        out = (eds_number_t){.is_text = true, .value = hash_of(text)};
    }
    return out;
}

/* --- Sections --- */

/* "605A", "1018sub1": hexadecimal. */
static bool read_place(const char *name, uint16_t *index, uint8_t *sub)
{
    char *end = NULL;
    const unsigned long first = strtoul(name, &end, 16);
    *index = (uint16_t)first;
    *sub = 0;
    if (end - name != 4 || strspn(name, "0123456789ABCDEFabcdef") < 4) {
        return false;
    }
    if (*end == '\0') {
        return true;
    }
    const char *digits = end + 3;
    if (strncasecmp(end, "sub", 3) != 0 || *digits == '\0' || strlen(digits) > 2) {
        return false;
    }
    *sub = (uint8_t)strtoul(digits, &end, 16);
    return *end == '\0';
}

/* The section of an object; a record and its first entry are both index and 0. */
static void enter_object(reader_t *self, uint16_t index, uint8_t sub, bool is_entry)
{
    eds_t *eds = self->eds;
    if (eds->objects == eds->room) {
        const size_t room = eds->room == 0 ? 256 : 2 * eds->room;
        if (room > OBJECTS_MAX) {
            complain(self, _("too many objects"), _("object"));
            return;
        }
        eds_object_t *grown = realloc(eds->object, room * sizeof *grown);
        if (grown == NULL) {
            complain(self, error_text(ENOMEM), _("object"));
            return;
        }
        eds->object = grown;
        eds->room = room;
    }
    self->object = &eds->object[eds->objects++];
    const eds_object_t *before = eds->objects > 1 ? self->object - 1 : NULL;
    *self->object = (eds_object_t){.index = index,
                                   .sub = sub,
                                   .line = self->line,
                                   .is_parent = !is_entry,
                                   .is_place = before != NULL && before->index == index && before->is_place};
}

/* An array or a record may have the type of its entries, and no value. */
static void leave_object(reader_t *self)
{
    if (self->object != NULL && self->is_group && self->object->compact == 0) {
        self->object->is_parent = true;
    }
    self->object = NULL;
    self->is_group = false;
}

/* "1010Value" */
static bool read_array(const char *name, uint16_t *index)
{
    uint8_t sub = 0;
    char first[] = "1000";
    if (strlen(name) != sizeof first - 1u + strlen("Value") || strcasecmp(name + sizeof first - 1u, "Value") != 0) {
        return false;
    }
    memcpy(first, name, sizeof first - 1u);
    return read_place(first, index, &sub);
}

static void note_stray(reader_t *self)
{
    self->eds->stray_line = self->eds->strays == 0 ? self->line : self->eds->stray_line;
    self->eds->strays++;
}

static void enter(reader_t *self, char *text)
{
    char *end = strchr(text, ']');
    uint16_t index = 0;
    uint8_t sub = 0;
    leave_object(self);
    self->is_device = self->is_drive = self->has_values = false;
    if (end == NULL) {
        complain(self, _("a section without ]"), text);
        return;
    }
    if (end[1 + strspn(end + 1, BLANKS)] != '\0' && end[1 + strspn(end + 1, BLANKS)] != ';') {
        complain(self, _("text behind the ] of a section"), text);
        return;
    }
    *end = '\0';
    text = trimmed(text + 1);
    if (read_place(text, &index, &sub)) {
        enter_object(self, index, sub, strlen(text) > 4);
    } else {
        self->is_device = strcasecmp(text, "DeviceInfo") == 0;
        self->is_drive = strcasecmp(text, "DeviceComissioning") == 0 || strcasecmp(text, "DeviceCommissioning") == 0;
        self->has_values = read_array(text, &self->array);
    }
}

/* --- Keys --- */

static void parse_access(reader_t *self, const char *value)
{
    const bool is_write_only = strcasecmp(value, "wo") == 0;
    const bool is_both = strncasecmp(value, "rw", 2) == 0;
    if (!is_write_only && !is_both && strcasecmp(value, "ro") != 0 && strcasecmp(value, "const") != 0) {
        complain(self, _("no AccessType that there is; allowed: ro, wo, rw, rwr, rww, const"), value);
    }
    self->object->is_readable = !is_write_only;
    self->object->is_writable = is_write_only || is_both;
}

static bool is_name_of_place(const char *name)
{
    static const char *const k_words[] = {"node id", "node-id", "nodeid", "node_id", "baud", "bit rate", "bitrate", "bit-rate"};
    for (size_t i = 0; i < sizeof k_words / sizeof k_words[0]; i++) {
        if (strcasestr(name, k_words[i]) != NULL) {
            return true;
        }
    }
    return false;
}

static void parse_type(reader_t *self, const eds_number_t *found, const char *value)
{
    self->object->type = (uint16_t)found->value;
    self->object->is_parent = false;
    if (!found->is_there || found->value < 1 || found->value > UINT16_MAX) {
        complain(self, _("no DataType that there is"), value);
    }
}

/* Keys whose value is kept as it is; false where it is another one. */
static bool keep_number(eds_object_t *object, const char *key, const eds_number_t *found)
{
    eds_number_t *place = strcasecmp(key, "LowLimit") == 0       ? &object->low
                          : strcasecmp(key, "HighLimit") == 0    ? &object->high
                          : strcasecmp(key, "DefaultValue") == 0 ? &object->fallback
                                                                 : NULL;
    if (place != NULL) {
        *place = *found;
    }
    return place != NULL;
}

static bool keep_kind(reader_t *self, const char *key, const eds_number_t *found)
{
    if (strcasecmp(key, "ObjectType") != 0) {
        return false;
    }
    self->is_group = found->value == TYPE_ARRAY || found->value == TYPE_RECORD;
    return true;
}

static void parse_of_object(reader_t *self, const char *key, const char *value)
{
    eds_object_t *object = self->object;
    const eds_number_t found = number(value);
    if (keep_kind(self, key, &found) || keep_number(object, key, &found)) {
        return;
    }
    if (strcasecmp(key, "AccessType") == 0) {
        parse_access(self, value);
    } else if (strcasecmp(key, "DataType") == 0) {
        parse_type(self, &found, value);
    } else if (strcasecmp(key, "PDOMapping") == 0) {
        object->is_mappable = found.value != 0;
    } else if (strcasecmp(key, "CompactSubObj") == 0) {
        object->compact = found.value >= 0 && found.value < UINT8_MAX ? (uint8_t)found.value : 0;
    } else if (strcasecmp(key, "ParameterValue") == 0) {
        if (object->parameter.is_there || object->parameter.is_text) {
            note_stray(self);
        }
        object->parameter = found;
    } else if (strcasecmp(key, "DownloadFile") == 0) {
        object->parameter = (eds_number_t){.is_text = true, .value = hash_of(value)};
    } else if (strcasecmp(key, "ParameterName") == 0) {
        object->is_place = object->is_place || is_name_of_place(value);
    }
}

/* A value of an array that is written in short, as an object with the attributes of the array. */
static void parse_of_array(reader_t *self, const char *key, const char *value)
{
    const eds_number_t sub = number(key);
    const eds_t *eds = self->eds;
    if (strcasecmp(key, "NrOfEntries") == 0) {
        return;
    }
    if (!sub.is_there || sub.has_node || sub.value < 1 || sub.value > UINT8_MAX) {
        note_stray(self);
        return;
    }
    const eds_object_t *array = eds_find(eds, self->array, (uint8_t)sub.value);
    eds_object_t filled = {.index = self->array, .line = self->line};
    if (array != NULL) {
        filled = *array;
        filled.line = self->line;
    }
    filled.sub = (uint8_t)sub.value;
    filled.compact = 0;
    filled.parameter = number(value);
    enter_object(self, self->array, filled.sub, true);
    if (self->object != NULL) {
        *self->object = filled;
    }
    self->object = NULL;
}

static void parse_of_device(reader_t *self, const char *key, const char *value)
{
    const eds_number_t found = number(value);
    char name[NAME_BYTES];
    if (strcasecmp(key, "VendorNumber") == 0) {
        self->eds->vendor = found;
    } else if (strcasecmp(key, "ProductNumber") == 0) {
        self->eds->product = found;
    }
    self->eds->has_compact_pdos |= strcasecmp(key, "CompactPDO") == 0 && found.value > 0;
    self->eds->rpdos = strcasecmp(key, "NrOfRXPDO") == 0 ? (unsigned)found.value : self->eds->rpdos;
    self->eds->tpdos = strcasecmp(key, "NrOfTXPDO") == 0 ? (unsigned)found.value : self->eds->tpdos;
    for (unsigned i = 0; eds_bitrates_kbps[i] != 0; i++) {
        (void)snprintf(name, sizeof name, "BaudRate_%u", eds_bitrates_kbps[i]);
        if (strcasecmp(key, name) == 0) {
            self->eds->has_bitrates = true;
            self->eds->bitrates |= found.value == 1 ? 1u << i : 0u;
        }
    }
}

static void parse_line(reader_t *self, char *text)
{
    text = trimmed(text);
    if (text[0] == '\0' || text[0] == ';') {
        return;
    }
    if (text[0] == '[') {
        enter(self, text);
        return;
    }
    char *equals = strchr(text, '=');
    if (equals == NULL) {
        complain(self, _("neither a section nor key=value: is this an EDS or DCF?"), text);
        return;
    }
    *equals = '\0';
    char *comment = strpbrk(equals + 1, ";"); /* not allowed for, and there; one in a value is a part of it */
    if (comment != NULL && strchr(BLANKS "=", comment[-1]) != NULL) {
        *comment = '\0';
    }
    const char *key = trimmed(text);
    const char *value = trimmed(equals + 1);
    if (value[0] == '\0') {
        return;
    }
    if (self->object != NULL) {
        parse_of_object(self, key, value);
    } else if (self->is_device) {
        parse_of_device(self, key, value);
    } else if (self->is_drive && strcasecmp(key, "NodeID") == 0) {
        self->eds->node = number(value);
    } else if (self->has_values) {
        parse_of_array(self, key, value);
    } else if (strcasecmp(key, "ParameterValue") == 0 || strcasecmp(key, "DownloadFile") == 0) {
        note_stray(self);
    }
}

/* What an entry leaves out is that of its array or record. Entry 0 is the number of the others. */
static void inherit(eds_t *self)
{
    const eds_object_t *parent = NULL;
    for (size_t i = 0; i < self->objects; i++) {
        eds_object_t *object = &self->object[i];
        if (object->is_parent) {
            parent = object;
        } else if (parent != NULL && parent->index == object->index) {
            const bool has_access = object->is_readable || object->is_writable;
            object->type = object->type != 0 ? object->type : object->sub == 0 ? TYPE_U8 : parent->type;
            object->is_readable |= !has_access && (object->sub == 0 || parent->is_readable);
            object->is_writable |= !has_access && object->sub != 0 && parent->is_writable;
        }
    }
}

bool eds_read(eds_t *self, FILE *in, const char *name, FILE *errors)
{
    char text[LINE_BYTES];
    reader_t reader = {.eds = self, .name = name, .errors = errors};
    *self = (eds_t){.object = NULL};
    bool is_rest = false; /* of a comment that is longer than the buffer */
    while (!reader.is_bad && fgets(text, sizeof text, in) != NULL) {
        const bool is_whole = strchr(text, '\n') != NULL || feof(in);
        if (is_rest) {
            is_rest = !is_whole;
            continue;
        }
        const size_t mark = reader.line++ == 0 ? encoding_mark(text, strlen(text)) : 0;
        if (reader.line == 1 && encoding_is_utf16(text, strlen(text))) {
            complain(&reader, _("allowed: plain text (UTF-8)"), _("the file is UTF-16"));
        } else if (!is_whole && text[mark + strspn(text + mark, BLANKS)] == ';') {
            is_rest = true;
        } else if (!is_whole) {
            complain(&reader, _("the line is too long"), text);
        } else {
            parse_line(&reader, text + mark);
        }
    }
    leave_object(&reader);
    inherit(self);
    if (!reader.is_bad && ferror(in)) {
        complain(&reader, error_text(errno), _("cannot be read"));
    }
    if (!reader.is_bad && self->objects == 0) {
        complain(&reader, _("allowed: an EDS or DCF"), _("no object in it"));
    }
    return !reader.is_bad;
}

void eds_free(eds_t *self)
{
    free(self->object);
    *self = (eds_t){.object = NULL};
}

const eds_object_t *eds_find(const eds_t *self, uint16_t index, uint8_t sub)
{
    const eds_object_t *compact = NULL;
    for (size_t i = 0; i < self->objects; i++) {
        const eds_object_t *object = &self->object[i];
        if (object->index == index && object->sub == sub && !object->is_parent && (object->compact == 0 || sub != 0)) {
            return object;
        }
        if (object->index == index && object->sub == 0 && sub >= 1 && sub <= object->compact) {
            compact = object;
        }
    }
    return compact;
}

bool eds_is_compact_pdo(const eds_t *self, uint16_t index)
{
    const unsigned number = index & (PDO_COUNT - 1u);
    const bool is_pdo = index >= RPDOS && index < PDOS_END;
    return self->has_compact_pdos && is_pdo && number < (index < TPDOS ? self->rpdos : self->tpdos);
}

uint8_t eds_bytes(const eds_object_t *object)
{
    for (size_t i = 0; i < TYPES; i++) {
        if (k_types[i].type == object->type) {
            return k_types[i].bytes;
        }
    }
    return 0;
}

int64_t eds_shown(const eds_object_t *object, uint32_t value)
{
    const char *name = eds_type_name(object);
    if (name[0] != 'i') {
        return value;
    }
    return name[1] == '8' ? (int8_t)value : name[1] == '1' ? (int16_t)value : (int32_t)value;
}

const char *eds_type_name(const eds_object_t *object)
{
    for (size_t i = 0; i < TYPES; i++) {
        if (k_types[i].type == object->type) {
            return k_types[i].name;
        }
    }
    return "";
}
