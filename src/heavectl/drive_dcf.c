/* SPDX-License-Identifier: MIT
 * drive_dcf.c - what a drive is set to, as a file of the standard (DCF, CiA 306), and what differs from such a file; see
 * drive_commands.h.
 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/canopen_objects.h"
#include "common/eds.h"
#include "common/message.h" // exit codes
#include "common/sentence.h"
#include "common/translate.h"
#include "heave/cia402.h"
#include "heavectl/drive_commands.h"

#define SETTINGS_MAX 4096u
#define IDENTITY     0x1018
#define PROGRAM_FROM 0x1F50 /* a drive's program is no setting, */
#define PROGRAM_TO   0x1F5F
#define STORE_FROM   0x1010 /* nor are the commands that store and restore them */
#define STORE_TO     0x1011

/** An object that a drive is set to, or is to be. */
typedef struct {
    uint16_t index;
    uint8_t sub;
    uint8_t bytes;
    bool is_signed;
    bool has_value;
    int64_t value;
} setting_t;

/** All of them, in their order. */
typedef struct {
    setting_t row[SETTINGS_MAX];
    size_t count;
} settings_list_t;

static uint16_t data_type(const setting_t *setting)
{
    const uint16_t least = setting->is_signed ? 2 : 5;
    return (uint16_t)(least + (setting->bytes == 4 ? 2 : setting->bytes - 1));
}

static void add(settings_list_t *list, setting_t setting)
{
    if (list->count < SETTINGS_MAX && setting.bytes > 0) {
        list->row[list->count++] = setting;
    }
}

/* --- Which objects --- */

static bool is_setting(uint16_t index)
{
    const uint16_t plain = cia402_plain_index(index);
    return !(index >= PROGRAM_FROM && index <= PROGRAM_TO) && !(index >= STORE_FROM && index <= STORE_TO) && index != 0x1003 &&
           plain != 0x6040 && plain != 0x6060;
}

static setting_t setting_of(const eds_object_t *object, uint8_t sub)
{
    const bool is_signed = eds_type_name(object)[0] == 'i';
    return (setting_t){.index = object->index, .sub = sub, .bytes = eds_bytes(object), .is_signed = is_signed};
}

static void add_of_file(settings_list_t *list, const eds_t *eds, const eds_object_t *object)
{
    if (object->is_parent || !object->is_readable || !object->is_writable || !is_setting(object->index)) {
        return;
    }
    if (object->compact == 0) {
        add(list, setting_of(object, object->sub));
    }
    for (unsigned sub = 1; sub <= object->compact; sub++) {
        if (eds_find(eds, object->index, (uint8_t)sub) == object) { /* else it has a section of its own */
            add(list, setting_of(object, (uint8_t)sub));
        }
    }
}

static void add_common(settings_list_t *list, unsigned channel)
{
    for (const canopen_object_t *row = canopen_objects; row->name != NULL; row++) {
        const canopen_type_t type = (canopen_type_t)row->type;
        const bool is_signed = canopen_type_name(type)[0] == 'i';
        for (unsigned sub = row->sub; (row->use & CANOPEN_SETTING) != 0 && sub <= row->last; sub++) {
            add(list, (setting_t){.index = canopen_index_of_axis(row->index, channel),
                                  .sub = (uint8_t)sub,
                                  .bytes = canopen_type_bytes(type),
                                  .is_signed = is_signed});
        }
    }
}

static int read_file(const char *path, eds_t *eds)
{
    FILE *in = fopen(path, "re");
    *eds = (eds_t){.object = NULL};
    if (in == NULL) {
        return ctl_complain(EXIT_NO_INPUT, "%s: %s", path, error_text(errno));
    }
    const bool is_good = eds_read(eds, in, path, stderr);
    (void)fclose(in);
    return is_good ? EXIT_DONE : EXIT_BAD_DATA;
}

/* Objects of --eds, which are those of the whole node, else the common ones of the axis. */
static int choose(const ctl_t *self, unsigned channel, settings_list_t *list)
{
    eds_t eds;
    if (self->eds == NULL) {
        add_common(list, channel);
        return EXIT_DONE;
    }
    const int code = read_file(self->eds, &eds);
    for (size_t i = 0; code == EXIT_DONE && i < eds.objects; i++) {
        add_of_file(list, &eds, &eds.object[i]);
    }
    eds_free(&eds);
    return code == EXIT_DONE && list->count == 0
               ? ctl_complain(EXIT_BAD_DATA, "%s: no object in it that can be read and written", self->eds)
               : code;
}

/* --- Reading --- */

/* Bytes of an answer as a number; false: it has none, or of another length. */
static bool parse_value(const cJSON *answer, setting_t *setting)
{
    const char *hex = drive_text(answer, "hex");
    uint8_t bytes[4];
    const size_t count = strlen(hex) / 2u;
    if (count != setting->bytes || count > sizeof bytes) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const char digits[3] = {hex[2u * i], hex[2u * i + 1u], '\0'};
        bytes[i] = (uint8_t)strtoul(digits, NULL, 16);
    }
    setting->value = canopen_value(setting->is_signed ? CANOPEN_I32 : CANOPEN_U32, bytes, count);
    setting->has_value = true;
    return true;
}

/* What the drive holds. Exit code; what is wrong was said. A drive without the object, or with another length, leaves it without.
 * @param refusal gets the drive's words; "" */
static int read_setting(ctl_t *self, unsigned drive, setting_t *setting, char *refusal, size_t capacity)
{
    int code = EXIT_DONE;
    cJSON *answer = drive_ask(self, drive, setting->index, setting->sub, &code);
    refusal[0] = '\0';
    setting->has_value = false;
    if (answer == NULL) {
        return code;
    }
    if (!drive_is_good(answer)) {
        (void)snprintf(refusal, capacity, "%s", drive_text(answer, "error"));
        code = drive_is_missing(answer) ? EXIT_DONE : ctl_judge(answer);
    } else if (!parse_value(answer, setting)) {
        (void)snprintf(refusal, capacity, N_("has %zu bytes"), strlen(drive_text(answer, "hex")) / 2u);
    }
    cJSON_Delete(answer);
    return ctl_is_interrupted != 0 ? ctl_complain(EXIT_REFUSED, "interrupted") : code;
}

/* Vendor, product, revision, serial number; 0 where the drive does not say. */
static int read_identity(ctl_t *self, unsigned drive, uint32_t identity[4])
{
    char refusal[320];
    for (uint8_t i = 0; i < 4; i++) {
        setting_t own = {.index = IDENTITY, .sub = (uint8_t)(i + 1u), .bytes = 4};
        const int code = read_setting(self, drive, &own, refusal, sizeof refusal);
        if (code != EXIT_DONE) {
            return code;
        }
        identity[i] = own.has_value ? (uint32_t)own.value : 0;
    }
    return EXIT_DONE;
}

/* --- Writing --- */

static void put_value(FILE *out, const setting_t *setting)
{
    const canopen_object_t *row = canopen_object_find(setting->index, setting->sub);
    fprintf(out, "ParameterName=%s\nObjectType=0x7\nDataType=0x%04X\nAccessType=rw\nPDOMapping=0\n",
            row != NULL ? row->name : "setting", data_type(setting));
    if (setting->is_signed) {
        fprintf(out, "ParameterValue=%" PRId64 "\n\n", setting->value);
    } else {
        fprintf(out, "ParameterValue=0x%0*" PRIX64 "\n\n", 2 * setting->bytes, (uint64_t)setting->value);
    }
}

static bool is_first_of_index(const settings_list_t *list, size_t i)
{
    return i == 0 || list->row[i - 1u].index != list->row[i].index;
}

static unsigned subs_of(const settings_list_t *list, size_t i)
{
    unsigned count = 0;
    for (size_t k = i; k < list->count && list->row[k].index == list->row[i].index; k++) {
        count++;
    }
    return count;
}

static bool is_listed(const settings_list_t *list, size_t i, uint16_t from, uint16_t to)
{
    return is_first_of_index(list, i) && list->row[i].index >= from && list->row[i].index <= to;
}

static void put_list(FILE *out, const char *name, const settings_list_t *list, uint16_t from, uint16_t to)
{
    unsigned count = 0, at = 0;
    for (size_t i = 0; i < list->count; i++) {
        count += is_listed(list, i, from, to);
    }
    fprintf(out, "[%s]\nSupportedObjects=%u\n", name, count);
    for (size_t i = 0; i < list->count; i++) {
        if (is_listed(list, i, from, to)) {
            fprintf(out, "%u=0x%04X\n", ++at, list->row[i].index);
        }
    }
    fputc('\n', out);
}

static void put_head(FILE *out, const ctl_t *self, unsigned drive, const uint32_t identity[4])
{
    const time_t now = time(NULL);
    char date[64] = "";
    const char *slash = strrchr(self->save, '/');
    const char *name = slash != NULL ? slash + 1 : self->save;
    struct tm parts;
    if (gmtime_r(&now, &parts) != NULL) {
        (void)strftime(date, sizeof date, "CreationDate=%m-%d-%Y\nCreationTime=%I:%M%p\n", &parts);
    }
    fprintf(out, "; what drive %u was set to; heavectl drive %u --compare %s says what differs\n", drive, drive, name);
    fprintf(out,
            "[FileInfo]\nFileName=%s\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n%sCreatedBy=heavectl " HEAVE_VERSION "\n\n",
            name, date);
    fprintf(out, "[DeviceInfo]\nVendorNumber=0x%08" PRIX32 "\nProductNumber=0x%08" PRIX32 "\nRevisionNumber=0x%08" PRIX32 "\n\n",
            identity[0], identity[1], identity[2]);
    fprintf(out, "[DeviceComissioning]\nNodeName=drive %u\nLSS_SerialNumber=0x%08" PRIX32 "\n\n", drive, identity[3]);
}

static void put_objects(FILE *out, const settings_list_t *list)
{
    for (size_t i = 0; i < list->count; i++) {
        const setting_t *setting = &list->row[i];
        if (setting->sub == 0 && is_first_of_index(list, i) && subs_of(list, i) == 1) {
            fprintf(out, "[%04X]\n", setting->index);
            put_value(out, setting);
            continue;
        }
        if (is_first_of_index(list, i)) {
            fprintf(out, "[%04X]\nParameterName=record\nObjectType=0x9\nSubNumber=%u\n\n", setting->index, subs_of(list, i));
        }
        fprintf(out, "[%04Xsub%X]\n", setting->index, setting->sub);
        put_value(out, setting);
    }
}

/* Takes those out that the drive has not got. */
static void keep_those_with_values(settings_list_t *list)
{
    size_t kept = 0;
    for (size_t i = 0; i < list->count; i++) {
        if (list->row[i].has_value) {
            list->row[kept++] = list->row[i];
        }
    }
    list->count = kept;
}

/* On the disk, whole; half a file would be taken for all that the drive was set to. */
static int finish(const ctl_t *self, FILE *out)
{
    int error = fflush(out) != 0 ? errno : ferror(out) != 0 ? EIO : 0;
    if (error == 0 && fsync(fileno(out)) != 0) {
        error = errno;
    }
    if (fclose(out) != 0 && error == 0) {
        error = errno;
    }
    if (error == 0) {
        return EXIT_DONE;
    }
    (void)unlink(self->save);
    return ctl_complain(EXIT_IO, "%s: %s", self->save, error_text(error));
}

int drive_save(ctl_t *self, unsigned drive, unsigned channel)
{
    static settings_list_t list;
    char refusal[320];
    uint32_t identity[4] = {0};
    int code = choose(self, channel, &list);
    code = code == EXIT_DONE ? read_identity(self, drive, identity) : code;
    for (size_t i = 0; code == EXIT_DONE && i < list.count; i++) {
        code = read_setting(self, drive, &list.row[i], refusal, sizeof refusal);
    }
    if (code != EXIT_DONE) {
        return code;
    }
    keep_those_with_values(&list);
    FILE *out = fopen(self->save, "wxe"); /* what was saved before is what somebody may need */
    if (out == NULL) {
        return ctl_complain(EXIT_NO_OUTPUT, "%s: %s", self->save, error_text(errno));
    }
    put_head(out, self, drive, identity);
    put_list(out, "MandatoryObjects", &list, 1, 0);
    put_list(out, "OptionalObjects", &list, 0x6000, 0xFFFF);
    put_list(out, "ManufacturerObjects", &list, 0x1000, 0x5FFF);
    put_objects(out, &list);
    code = finish(self, out);
    if (code == EXIT_DONE && !self->is_json) {
        printf(_("drive %u: %zu objects saved in %s\n"), drive, list.count, self->save);
    }
    return code;
}

/* --- Comparing --- */

/** What a comparison has come to. */
typedef struct {
    unsigned same;
    unsigned differ;
    unsigned skipped; /* no whole numbers of up to 32 bits */
    cJSON *list;      /* of those that differ */
} verdict_t;

/* A number of the file as the object has it: files write -1 as 0xFFFF. */
static int64_t as_the_object_has_it(const setting_t *setting, int64_t value)
{
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)((uint64_t)value >> 8), (uint8_t)((uint64_t)value >> 16),
                              (uint8_t)((uint64_t)value >> 24)};
    return canopen_value(setting->is_signed ? CANOPEN_I32 : CANOPEN_U32, bytes, setting->bytes);
}

static void show_verdict(const ctl_t *self, verdict_t *verdict, const setting_t *setting, int64_t wanted, const char *refusal)
{
    const canopen_object_t *row = canopen_object_find(setting->index, setting->sub);
    char place[16];
    verdict->differ++;
    (void)snprintf(place, sizeof place, "%04X:%02X", setting->index, setting->sub);
    char shown[SENTENCE_MAX];
    cJSON *one = cJSON_CreateObject();
    (void)cJSON_AddStringToObject(one, "object", place);
    (void)cJSON_AddNumberToObject(one, "file", (double)wanted);
    (void)cJSON_AddItemToObject(one, "drive",
                                setting->has_value ? cJSON_CreateNumber((double)setting->value) : cJSON_CreateNull());
    (void)cJSON_AddItemToArray(verdict->list, one);
    if (self->is_json) {
        return;
    }
    printf("%s%s%s: ", place, row != NULL ? " " : "", row != NULL ? translate(row->name) : "");
    if (setting->has_value) {
        printf(_("the drive has %lld, the file %lld\n"), (long long)setting->value, (long long)wanted);
    } else {
        printf(_("the file has %lld; %s\n"), (long long)wanted, sentence(refusal, shown, sizeof shown));
    }
}

static int compare_one(ctl_t *self, unsigned drive, const eds_object_t *object, uint32_t node, verdict_t *verdict)
{
    char refusal[320];
    setting_t setting = setting_of(object, object->sub);
    const int64_t wanted = as_the_object_has_it(&setting, object->parameter.value + (object->parameter.has_node ? node : 0));
    const int code = read_setting(self, drive, &setting, refusal, sizeof refusal);
    if (code == EXIT_DONE && setting.has_value && setting.value == wanted) {
        verdict->same++;
    } else if (code == EXIT_DONE) {
        show_verdict(self, verdict, &setting, wanted, refusal);
    }
    return code;
}

static bool is_wanted(const eds_object_t *object)
{
    return (object->parameter.is_there || object->parameter.is_text) && is_setting(object->index);
}

static bool is_compared(const eds_object_t *object)
{
    return !object->is_parent && object->parameter.is_there && object->is_readable && eds_bytes(object) > 0;
}

static int compare_all(ctl_t *self, unsigned drive, uint32_t node, const eds_t *eds, verdict_t *verdict)
{
    const eds_number_t named[2] = {eds->vendor, eds->product};
    uint32_t identity[4] = {0};
    int code = read_identity(self, drive, identity);
    for (uint8_t i = 0; i < 2 && code == EXIT_DONE; i++) {
        setting_t own = {.index = IDENTITY, .sub = (uint8_t)(i + 1u), .bytes = 4, .has_value = true, .value = identity[i]};
        if (named[i].is_there && named[i].value != 0 && (uint32_t)named[i].value != identity[i]) {
            show_verdict(self, verdict, &own, named[i].value, "");
        }
    }
    for (size_t i = 0; i < eds->objects && code == EXIT_DONE; i++) {
        if (!is_wanted(&eds->object[i])) {
            continue;
        }
        if (is_compared(&eds->object[i])) {
            code = compare_one(self, drive, &eds->object[i], node, verdict);
        } else {
            verdict->skipped++;
        }
    }
    return code;
}

int drive_compare(ctl_t *self, unsigned drive, uint32_t node)
{
    eds_t eds;
    verdict_t verdict = {.list = cJSON_CreateArray()};
    int code = read_file(self->compare, &eds);
    code = code == EXIT_DONE ? compare_all(self, drive, node, &eds, &verdict) : code;
    eds_free(&eds);
    if (code == EXIT_DONE && verdict.same + verdict.differ == 0) {
        code = ctl_complain(EXIT_BAD_DATA, "%s: no ParameterValue in it: a DCF is needed, an EDS has none", self->compare);
    } else if (code == EXIT_DONE && self->is_json) {
        char *text = cJSON_PrintUnformatted(verdict.list);
        printf("{\"ok\":true,\"drive\":%u,\"same\":%u,\"not_compared\":%u,\"differ\":%s}\n", drive, verdict.same, verdict.skipped,
               text != NULL ? text : "[]");
        free(text);
    } else if (code == EXIT_DONE) {
        printf(_("drive %u and %s: %u objects are the same, %u differ\n"), drive, self->compare, verdict.same, verdict.differ);
        if (verdict.skipped > 0) {
            printf(_("settings of the file that are not compared (no whole number of up to 32 bits, or write-only): %u\n"),
                   verdict.skipped);
        }
    }
    cJSON_Delete(verdict.list);
    return code == EXIT_DONE && verdict.differ > 0 ? EXIT_REFUSED : code;
}
