/* SPDX-License-Identifier: MIT
 * control_object.c - see control_object.h.
 */
#include "common/translate.h"
#include "service/control_object.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "common/canopen_objects.h"
#include "heave/canopen_text.h"
#include "service/operator_requests.h"

#define WORDS_MAX 5u

static const char k_usage[] =
    N_("sdo: needs N INDEX:SUB to read, N INDEX:SUB [TYPE] VALUE to write; as in `sdo 3 6041:00`, `sdo 3 2000:01 u16 5`");

/* The words of a line, cut in place.
 * Returns how many; WORDS_MAX + 1 where there are more. */
static unsigned split(char *text, char *word[WORDS_MAX])
{
    unsigned count = 0;
    for (char *rest = text, *next = strtok_r(text, " ", &rest); next != NULL; next = strtok_r(NULL, " ", &rest)) {
        if (count == WORDS_MAX) {
            return WORDS_MAX + 1u;
        }
        word[count++] = next;
    }
    return count;
}

/* The value of a write into the object; false: error says what is wrong. */
static bool parse_value(control_client_t *client, const char *text, drive_object_t *object)
{
    const canopen_type_t type = (canopen_type_t)client->object_type;
    int64_t value = 0, least = 0, most = 0;
    if (!canopen_value_read(type, text, &value)) {
        canopen_value_range(type, &least, &most);
        (void)snprintf(client->object_error, sizeof client->object_error,
                       N_("sdo: %.12s is no value of %04X:%02X; allowed: a whole number from %lld to %lld (%s)"), text,
                       object->index, object->sub, (long long)least, (long long)most, canopen_type_name(type));
        return false;
    }
    object->is_write = true;
    object->size = canopen_type_bytes(type);
    for (unsigned i = 0; i < object->size; i++) {
        object->value[i] = (uint8_t)((uint64_t)value >> (8u * i));
    }
    return true;
}

/* The type of a write: as it is said, else that of the object. */
static bool parse_type(control_client_t *client, const char *name, const drive_object_t *object)
{
    const canopen_object_t *row = canopen_object_find(object->index, object->sub);
    canopen_type_t type = row != NULL ? (canopen_type_t)row->type : CANOPEN_TEXT;
    const bool is_known = name != NULL ? canopen_type_find(name, &type) : type != CANOPEN_TEXT;
    client->object_type = (uint8_t)type;
    if (!is_known && name != NULL) {
        (void)snprintf(client->object_error, sizeof client->object_error, N_("sdo: %.12s is no type; allowed: %s"), name,
                       CANOPEN_TYPE_NAMES);
    } else if (!is_known) {
        (void)snprintf(client->object_error, sizeof client->object_error,
                       N_("sdo: the type of %04X:%02X is not known here: say it, as in `sdo 3 2000:01 u16 5`; allowed: %s"),
                       object->index, object->sub, CANOPEN_TYPE_NAMES);
    }
    return is_known;
}

const char *control_object_read(control_client_t *client, const char *line, motion_request_t *out)
{
    char text[CONTROL_REQUEST_MAX];
    char *word[WORDS_MAX];
    drive_object_t *object = &out->object;
    *out = (motion_request_t){.event = OPERATOR_OBJECT};
    (void)snprintf(text, sizeof text, "%s", line);
    const unsigned words = split(text, word);
    if (words < 3u || words > WORDS_MAX || strlen(word[1]) > 2 || strspn(word[1], "0123456789") != strlen(word[1]) ||
        !canopen_place_read(word[2], &object->index, &object->sub)) {
        return k_usage;
    }
    for (const char *digit = word[1]; *digit != '\0'; digit++) {
        out->number = out->number * 10u + (uint32_t)(*digit - '0');
    }
    const canopen_object_t *row = canopen_object_find(object->index, object->sub);
    client->object_type = row != NULL ? row->type : CANOPEN_TYPES;
    if (words > 3u &&
        (!parse_type(client, words == 5u ? word[3] : NULL, object) || !parse_value(client, word[words - 1u], object))) {
        return client->object_error;
    }
    client->object_drive = (uint8_t)out->number;
    return NULL;
}

/* --- Answers --- */

static void answer_not(control_client_t *client, const motion_result_t *result)
{
    const drive_object_t *object = &result->object;
    char error[320];
    const char *why = service_answer_name(result->answer);
    if (result->answer != SERVICE_DONE) {
        (void)snprintf(error, sizeof error, "sdo: %s", service_answer_text(result->answer));
    } else if (result->object_state == DRIVE_OBJECT_REFUSED) {
        why = "refused";
        (void)snprintf(error, sizeof error, N_("sdo: drive %u refuses %04X:%02X: %s (0x%08X)"), client->object_drive,
                       object->index, object->sub, canopen_abort_text(result->object_code), result->object_code);
    } else {
        const bool is_silent = result->object_state == DRIVE_OBJECT_SILENT;
        why = is_silent ? "silent" : "left";
        (void)snprintf(error, sizeof error, N_("sdo: drive %u: %s"), client->object_drive,
                       is_silent ? N_("no answer in time")
                                 : N_("heaved had to talk to the drive itself, or has lost it: try again"));
    }
    control_client_log(client, error, result->snapshot.state);
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", false);
    json_text(&json, "error", error);
    json_text(&json, "why", why);
    if (result->object_state == DRIVE_OBJECT_REFUSED) {
        char code[16];
        (void)snprintf(code, sizeof code, "0x%08" PRIX32, result->object_code);
        json_text(&json, "abort", code);
    }
    json_text(&json, "state", state_name(result->snapshot.state));
    json_close(&json, '}');
    control_client_answer(client, &json);
}

/* Text as drives keep it: ends at a zero, and has no other bytes than printable ones. */
static bool is_text(const drive_object_t *object, char text[DRIVE_OBJECT_BYTES + 1u])
{
    size_t length = 0;
    while (length < object->size && object->value[length] != 0) {
        if (isprint(object->value[length]) == 0) {
            return false;
        }
        text[length] = (char)object->value[length];
        length++;
    }
    text[length] = '\0';
    return length > 0;
}

static void put_value(json_t *json, const control_client_t *client, const drive_object_t *object)
{
    char hex[2u * DRIVE_OBJECT_BYTES + 1u] = "";
    char text[DRIVE_OBJECT_BYTES + 1u];
    char meaning[160] = "";
    const bool is_number = client->object_type != CANOPEN_TEXT && object->size >= 1 && object->size <= 4;
    for (unsigned i = 0; i < object->size; i++) {
        (void)snprintf(&hex[2u * i], 3, "%02X", object->value[i]);
    }
    json_number(json, "bytes", object->size);
    json_text(json, "hex", hex);
    if (is_number) {
        const int64_t value = canopen_value((canopen_type_t)client->object_type, object->value, object->size);
        json_integer(json, "value", value);
        canopen_object_meaning(object->index, object->sub, value, meaning, sizeof meaning);
    } else if (is_text(object, text)) {
        json_text(json, "text", text);
    }
    if (meaning[0] != '\0') {
        json_text(json, "meaning", meaning);
    }
}

void control_object_answer(control_client_t *client, const motion_result_t *result)
{
    const drive_object_t *object = &result->object;
    const canopen_object_t *row = canopen_object_find(object->index, object->sub);
    char place[8];
    if (result->answer != SERVICE_DONE || result->object_state != DRIVE_OBJECT_DONE) {
        answer_not(client, result);
        return;
    }
    control_client_log(client, "", result->snapshot.state);
    (void)snprintf(place, sizeof place, "%04X:%02X", object->index, object->sub);
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(result->snapshot.state));
    json_number(&json, "drive", client->object_drive);
    json_text(&json, "object", place);
    json_text(&json, "name", row != NULL ? row->name : "");
    json_text(&json, "type",
              (unsigned)client->object_type < CANOPEN_TYPES ? canopen_type_name((canopen_type_t)client->object_type) : "");
    json_bool(&json, "written", object->is_write);
    put_value(&json, client, object);
    json_close(&json, '}');
    control_client_answer(client, &json);
}
