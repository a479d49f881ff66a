/* SPDX-License-Identifier: MIT
 * drive_object.c - asks for an object of a drive, and shows it; see drive_commands.h.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/message.h" // exit codes
#include "common/sentence.h"
#include "common/translate.h"
#include "heavectl/drive_commands.h"

#define ANSWER_MS 30000 /* a drive that is slow, and slow settings for it */
#define TRIES     40u
#define PAUSE_NS  50000000

const char *drive_text(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsString(item) ? item->valuestring : "";
}

static double number(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsNumber(item) ? item->valuedouble : 0.0;
}

cJSON *drive_request(ctl_t *self, const char *request, int *code)
{
    *code = ctl_send(self, request);
    if (*code != EXIT_DONE) {
        return NULL;
    }
    const char *line = ctl_receive(self, ctl_now_ms() + ANSWER_MS);
    cJSON *answer = line != NULL ? cJSON_Parse(line) : NULL;
    if (answer == NULL) {
        *code = ctl_not_heard(self, _("heaved does not answer"));
    }
    return answer;
}

bool drive_is_good(const cJSON *answer)
{
    return cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(answer, "ok"));
}

bool drive_is_missing(const cJSON *answer)
{
    const char *why = drive_text(answer, "why");
    return strcmp(why, "refused") == 0 || strcmp(why, "silent") == 0;
}

static bool is_worth_another_try(const cJSON *answer)
{
    const char *why = drive_text(answer, "why");
    return !drive_is_good(answer) && (strcmp(why, "not-taken") == 0 || strcmp(why, "left") == 0 || strcmp(why, "absent") == 0);
}

cJSON *drive_ask(ctl_t *self, unsigned drive, uint16_t index, uint8_t sub, int *code)
{
    const struct timespec pause = {.tv_nsec = PAUSE_NS};
    char request[32];
    (void)snprintf(request, sizeof request, "sdo %u %04X:%02X", drive, index, sub);
    cJSON *answer = drive_request(self, request, code);
    for (unsigned i = 1; i < TRIES && answer != NULL && is_worth_another_try(answer) && ctl_is_interrupted == 0; i++) {
        cJSON_Delete(answer);
        (void)nanosleep(&pause, NULL);
        answer = drive_request(self, request, code);
    }
    return answer;
}

/* A number: also in hexadecimal where people know it so. */
static void put_number(const cJSON *answer)
{
    const double value = number(answer, "value");
    const bool is_unsigned = drive_text(answer, "type")[0] != 'i';
    printf("%.0f", value);
    if (is_unsigned && value > 9.0) {
        printf(" (0x%0*" PRIX64 ")", (int)(2.0 * number(answer, "bytes")), (uint64_t)value);
    }
}

void drive_show_object(const cJSON *answer)
{
    const char *name = drive_text(answer, "name");
    const char *meaning = drive_text(answer, "meaning");
    char shown[SENTENCE_MAX];
    printf("%s%s%s: ", drive_text(answer, "object"), name[0] != '\0' ? " " : "", translate(name));
    if (cJSON_HasObjectItem(answer, "text")) {
        printf("%s", drive_text(answer, "text"));
    } else if (cJSON_HasObjectItem(answer, "value")) {
        put_number(answer);
    } else {
        printf("%s", drive_text(answer, "hex"));
    }
    printf("%s%s%s\n", meaning[0] != '\0' ? _(": ") : "", sentence(meaning, shown, sizeof shown),
           cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(answer, "written")) ? _(", written") : "");
}
