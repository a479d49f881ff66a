/* SPDX-License-Identifier: MIT
 * dcf_startup.c - DCF files as start-up lists; see dcf_startup.h.
 */
#include "inspect/dcf_startup.h"

#include <inttypes.h>
#include <string.h>

#include "common/translate.h"
#include "config/config.h"
#include "platform/startup_denied.h"

#define FAMILY "cia402-startup"

/** What becomes of a setting. */
typedef enum {
    DCF_LISTED,
    DCF_DEFAULT, /**< the drive holds it anyway */
    DCF_KNOWN,   /**< nothing is lost: it cannot be set, or heaved sets it */
    DCF_KEYS,    /**< heaved sets it with some configurations */
    DCF_NODE,    /**< depends on the node */
    DCF_UNSAFE,  /**< no list may write it */
    DCF_STRANGE, /**< no list can hold it */
    DCF_TOO_MANY,
    DCF_VERDICTS
} dcf_verdict_t;

/** The import. */
typedef struct {
    const eds_t *file;
    unsigned files;
    const char *section; /**< NULL: the family's, and each drive's own */
    FILE *out;
} import_t;

static uint64_t mask_of(const eds_object_t *object)
{
    return (UINT64_C(1) << 8u * eds_bytes(object)) - 1u;
}

/* Signed and unsigned writing of the same bits are the same to a drive. */
static bool fits(const eds_object_t *object, int64_t value)
{
    const int64_t most = (int64_t)mask_of(object);
    return eds_bytes(object) > 0 && value >= -(most / 2) - 1 && value <= most;
}

static bool is_default(const eds_t *file, const eds_object_t *object)
{
    const eds_number_t *is = &object->parameter;
    const eds_number_t *was = &object->fallback;
    if (is->is_there != was->is_there || is->is_text != was->is_text) {
        return false;
    }
    if (was->has_node && !is->has_node && file->node.is_there) {
        return is->value == was->value + file->node.value;
    }
    const bool are_bits = is->is_there && fits(object, is->value) && fits(object, was->value);
    return is->has_node == was->has_node &&
           (is->value == was->value || (are_bits && (((uint64_t)is->value ^ (uint64_t)was->value) & mask_of(object)) == 0));
}

/* Why no list can hold it; NULL: one can. */
static const char *strangeness(const eds_t *file, const eds_object_t *object)
{
    if (object->type == 0) {
        return _("has no DataType in the file");
    }
    if (object->compact > 0 && object->sub == 0) {
        return _("is one value for several sub-indices; a list needs each of them");
    }
    if (eds_find(file, object->index, object->sub) != object) {
        return _("is in the file a second time");
    }
    if (!object->is_readable && !object->is_writable) {
        return _("has no AccessType in the file");
    }
    return NULL;
}

/* @param why  gets the rest of a sentence where it is not listed */
static dcf_verdict_t judge(const eds_t *file, const eds_object_t *object, bool is_for_all, const char **why)
{
    const uint32_t vendor = file->vendor.is_there ? (uint32_t)file->vendor.value : 0;
    if (is_default(file, object)) {
        return DCF_DEFAULT;
    }
    *why = strangeness(file, object);
    if (*why != NULL) {
        return DCF_STRANGE;
    }
    if (!object->is_writable) {
        *why = _("can only be read");
        return DCF_KNOWN;
    }
    if (cia402_is_own_object(object->index, object->sub)) {
        const bool is_always = cia402_is_always_own(object->index, object->sub);
        *why = is_always ? _("is set by heaved itself, by the keys of [cia402]")
                         : _("is set by heaved with some keys of [cia402]; set them, or write a line for it where they do not");
        return is_always ? DCF_KNOWN : DCF_KEYS;
    }
    *why = config_startup_denied(object->index, object->sub, (uint32_t)object->parameter.value, vendor);
    if (*why != NULL) {
        return DCF_UNSAFE;
    }
    if (object->is_place) {
        *why = _("is, by its name, the node id or the bit rate");
        return DCF_NODE;
    }
    if (object->parameter.has_node || (is_for_all && object->fallback.has_node)) {
        *why = _("depends on the node");
        return DCF_NODE;
    }
    *why = _("is no whole number of up to 32 bits that its type holds");
    return object->parameter.is_there && fits(object, object->parameter.value) ? DCF_LISTED : DCF_STRANGE;
}

static bool is_set(const eds_object_t *object)
{
    return object->parameter.is_there || object->parameter.is_text;
}

/* All drives are set to it alike. */
static bool is_common(const import_t *self, const eds_object_t *object)
{
    const char *why = NULL;
    for (unsigned f = 0; self->section == NULL && f < self->files; f++) {
        const eds_object_t *other = eds_find(&self->file[f], object->index, object->sub);
        if (other == NULL || !is_set(other) || other->type != object->type ||
            judge(&self->file[f], other, true, &why) != DCF_LISTED ||
            (((uint64_t)other->parameter.value ^ (uint64_t)object->parameter.value) & mask_of(object)) != 0) {
            return false;
        }
    }
    return self->section == NULL;
}

static bool is_of_family(const import_t *self)
{
    return self->section != NULL && strcmp(self->section, FAMILY) == 0;
}

/* A list: what is common of the first file, or what is not of this one, with its comments.
 * @param count  of each verdict, added to */
static void write_list(const import_t *self, const eds_t *file, bool is_common_wanted, unsigned count[DCF_VERDICTS])
{
    unsigned items = 0;
    for (size_t i = 0; i < file->objects; i++) {
        const eds_object_t *object = &file->object[i];
        const char *why = NULL;
        if (!is_set(object)) {
            continue;
        }
        dcf_verdict_t verdict = judge(file, object, is_of_family(self), &why);
        if (is_common_wanted != (verdict == DCF_LISTED && is_common(self, object))) {
            continue;
        }
        if (verdict == DCF_LISTED && items++ >= CONFIG_STARTUP_MAX) {
            verdict = DCF_TOO_MANY;
            why = _("is one too many: a list has up to 32; store the rest in the drive by its maker's program");
        }
        count[verdict]++;
        if (verdict == DCF_LISTED) {
            fprintf(self->out, "0x%04X:%s%02X = %" PRId64 " %s%s\n", object->index, object->sub > 9 ? "0x" : "", object->sub,
                    eds_shown(object, (uint32_t)((uint64_t)object->parameter.value & mask_of(object))), eds_type_name(object),
                    object->is_readable ? "" : " unchecked");
        } else if (verdict != DCF_DEFAULT) {
            fprintf(self->out, "; 0x%04X:%02X (line %u) %s\n", object->index, object->sub, object->line, why);
        }
    }
}

/* Values that belong to no object: what they were meant for nobody knows. */
static void show_strays(const import_t *self, const eds_t *file, unsigned count[DCF_VERDICTS])
{
    count[DCF_STRANGE] += file->strays;
    if (file->strays > 0) {
        fprintf(self->out, _("; %u values are of no object, or stand twice in its section; the first in line %u\n"), file->strays,
                file->stray_line);
    }
}

static unsigned say_left(const char *name, const unsigned count[DCF_VERDICTS], FILE *errors)
{
    const unsigned left = count[DCF_KEYS] + count[DCF_NODE] + count[DCF_UNSAFE] + count[DCF_STRANGE] + count[DCF_TOO_MANY];
    if (left > 0) {
        fprintf(errors,
                _("%s: left out, each with a comment in the list: %u that keys of [cia402] decide, %u of the node, %u that no "
                  "list may "
                  "write, %u that no list can hold, %u too many\n"),
                name, count[DCF_KEYS], count[DCF_NODE], count[DCF_UNSAFE], count[DCF_STRANGE], count[DCF_TOO_MANY]);
    }
    return left;
}

unsigned dcf_write_startup(const eds_t *files, const char *const *names, unsigned count, const char *section, FILE *out,
                           FILE *errors)
{
    const import_t self = {.file = files, .files = count, .section = section, .out = out};
    unsigned common[DCF_VERDICTS] = {0};
    unsigned left = 0;
    if (section == NULL) {
        fprintf(out, "[" FAMILY "]\n");
        write_list(&self, &files[0], true, common);
    }
    for (unsigned f = 0; f < count; f++) {
        unsigned own[DCF_VERDICTS] = {[DCF_TOO_MANY] = f == 0 ? common[DCF_TOO_MANY] : 0};
        if (section != NULL) {
            fprintf(out, "[%s]\n", section);
        } else {
            fprintf(out, "\n[" FAMILY "-%u]\n", f + 1u);
        }
        write_list(&self, &files[f], false, own);
        show_strays(&self, &files[f], own);
        if (own[DCF_DEFAULT] > 0) {
            fprintf(out, _("; %u more hold their defaults\n"), own[DCF_DEFAULT]);
        }
        left += say_left(names[f], own, errors);
    }
    return left;
}
