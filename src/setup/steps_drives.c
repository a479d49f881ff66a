/* SPDX-License-Identifier: MIT
 * steps_drives.c - what moves it: the bus, who is on it, and how far a turn goes.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/translate.h"
#include "setup/answers.h"
#include "setup/steps.h"

static bool is_driver(const setup_t *self, const char *driver)
{
    return strcmp(setup_driver(self), driver) == 0;
}
static unsigned if_blank(const setup_t *self)
{
    return answers_is(self, "start", "none");
}
static unsigned if_can(const setup_t *self)
{
    return is_driver(self, "cia402") || is_driver(self, "can-raw");
}
static unsigned if_tcp(const setup_t *self)
{
    return is_driver(self, "modbus-tcp");
}
static unsigned if_serial(const setup_t *self)
{
    return is_driver(self, "modbus-rtu");
}
static unsigned if_scanned(const setup_t *self)
{
    return is_driver(self, "cia402") || if_serial(self);
}
static unsigned if_bus(const setup_t *self)
{
    return !is_driver(self, "sim");
}

static void accept_driver(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    (void)answers_set(self, "driver", strcmp(text, "c") == 0 ? "cia402" : "sim");
}

/* What the file has is offered. */
static void offer(const setup_t *self, setup_question_t *out, const char *section, const char *key, const char *usual)
{
    char value[INI_VALUE_MAX];
    const bool has = ini_text_get(&self->start, section, key, value) && strlen(value) < sizeof out->fallback;
    (void)snprintf(out->fallback, sizeof out->fallback, "%s", has ? value : usual);
}

static void say_interface(const setup_t *self, setup_question_t *out)
{
    (void)snprintf(out->text, sizeof out->text, _("CAN interface of the drives?"));
    offer(self, out, "can", "interface", "can0");
}
static void say_hosts(const setup_t *self, setup_question_t *out)
{
    (void)snprintf(out->text, sizeof out->text,
                   _("Addresses of the drives, in the order of their numbers, separated by commas?"));
    offer(self, out, "modbus-tcp", "hosts", "");
}
static void say_device(const setup_t *self, setup_question_t *out)
{
    (void)snprintf(out->text, sizeof out->text, _("Serial port of the drives?"));
    offer(self, out, "modbus-rtu", "device", "");
}

static bool check_interface(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    static const char k_allowed[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
    (void)self;
    (void)index;
    if (strspn(text, k_allowed) == strlen(text) && strlen(text) <= 15u) {
        return true;
    }
    (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\" is no name of an interface: up to 15 letters, digits and . _ -"), text);
    return false;
}

static bool check_device(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    (void)self;
    (void)index;
    (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": a path such as /dev/serial/by-id/..."), text);
    return text[0] == '/' && strchr(text, ';') == NULL && strlen(text) < 108u;
}

static bool check_hosts(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    (void)self;
    (void)index;
    (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": addresses such as 192.168.1.11 or 192.168.1.11:1502, separated by commas"),
                   text);
    return strspn(text, "0123456789.:, ") == strlen(text);
}

/* --- Who is there --- */

/* Those that were found, without what belongs to each. */
static void list_found(const double *found, unsigned count, char list[SETUP_ANSWER_MAX])
{
    size_t length = 0;
    list[0] = '\0';
    for (unsigned i = 0; i < count && length < SETUP_ANSWER_MAX - 8u; i++) {
        length += (size_t)snprintf(&list[length], SETUP_ANSWER_MAX - length, "%s%g", i > 0 ? "," : "", found[i]);
    }
}

static void say_nodes(const setup_t *self, setup_question_t *out)
{
    double found[127];
    char list[SETUP_ANSWER_MAX];
    const unsigned count = answers_list(setup_get(self, "scan"), found, 127), wanted = setup_cylinders(self);
    list_found(found, count, list);
    if (count >= wanted) {
        list_found(found, wanted, out->fallback);
        (void)snprintf(out->text, sizeof out->text,
                       _("%u drives answer: %s. Which of them are drives 1 to %u? Their order does not matter yet.\n"
                         "\"a\" looks again."),
                       count, list, wanted);
    } else {
        (void)snprintf(
            out->text, sizeof out->text,
            _("%u of %u drives answer%s%s. Look at supply, cable, terminating resistors, bit rate and that no two drives have "
              "one address;\nthen \"a\" looks again."),
            count, wanted, count > 0 ? _(": ") : "", count > 0 ? list : "");
    }
}

static bool check_nodes(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    double number[16], found[127];
    const unsigned wanted = setup_cylinders(self), count = answers_list(text, number, 16);
    char list[SETUP_ANSWER_MAX];
    const unsigned there = answers_list(setup_get(self, "scan"), found, 127);
    (void)index;
    if (strcmp(text, "a") == 0) {
        return true;
    }
    if (count != wanted || strspn(text, "0123456789, ") != strlen(text)) {
        (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": %u numbers are needed, separated by commas, or a to look again"), text,
                       wanted);
        return false;
    }
    for (unsigned i = 0; i < count; i++) {
        bool is_there = false;
        for (unsigned k = 0; k < there; k++) {
            is_there = is_there || fabs(found[k] - number[i]) < 0.5;
        }
        for (unsigned k = 0; k < i; k++) {
            if (fabs(number[k] - number[i]) < 0.5) {
                (void)snprintf(error, SETUP_ERROR_MAX, _("%g stands there twice"), number[i]);
                return false;
            }
        }
        if (!is_there) {
            list_found(found, there, list);
            (void)snprintf(error, SETUP_ERROR_MAX, _("nobody answers at %g; allowed are those that do: %s"), number[i],
                           there > 0 ? list : _("none"));
            return false;
        }
    }
    return true;
}

static void accept_nodes(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "a") == 0) {
        answers_drop(self, "scan");
        answers_drop(self, "nodes");
    }
}

/* --- How far a turn goes --- */

/* From counts_per_mm = 131072/10 both follow. */
static void offer_scaling(const setup_t *self, setup_question_t *out, bool is_lead)
{
    char value[INI_VALUE_MAX], *end = NULL;
    const char *section = strncmp(setup_driver(self), "modbus", 6) == 0 ? "modbus" : setup_driver(self);
    if (ini_text_get(&self->start, "drives", is_lead ? "lead_mm" : "counts_per_turn", value) && strpbrk(value, "/,") == NULL) {
        (void)snprintf(out->fallback, sizeof out->fallback, "%.31s", value);
    } else if (ini_text_get(&self->start, section, "counts_per_mm", value) && strchr(value, ',') == NULL) {
        const double counts = fabs(strtod(value, &end)), mm = *end == '/' ? strtod(end + 1, NULL) : 1;
        (void)snprintf(out->fallback, sizeof out->fallback, "%.10g", is_lead ? fabs(mm) : counts);
    }
}
static void say_lead(const setup_t *self, setup_question_t *out)
{
    (void)snprintf(out->text, sizeof out->text, _("Lead: how far does the cylinder go with one turn of its screw?"));
    offer_scaling(self, out, true);
}
static void say_turn(const setup_t *self, setup_question_t *out)
{
    (void)snprintf(out->text, sizeof out->text, _("How many counts has one turn of the motor, as the drive tells them?"));
    offer_scaling(self, out, false);
}

static bool check_turn(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    const double counts = strtod(text, NULL);
    (void)self;
    (void)index;
    (void)snprintf(error, SETUP_ERROR_MAX, _("%g counts: a whole number of counts is needed; a factor belongs into the gear"),
                   counts);
    return fabs(counts - round(counts)) < 1e-9;
}

const step_t steps_drives[] = {
    {.key = "drives",
     .kind = SETUP_CHOICE,
     .times = if_blank,
     .took = accept_driver,
     .text = N_("What drives has it?"),
     .choices = N_("c CANopen drives (CiA 402)|s none yet: simulated ones"),
     .help = N_("Drives on Modbus and drives with CAN frames of their own begin from a file that has their registers or frames: "
                "\"back\" to the "
                "first question.")},
    {.key = "interface",
     .kind = SETUP_TEXT,
     .times = if_can,
     .say = say_interface,
     .check = check_interface,
     .help =
         N_("`ip -br link show type can` shows the interfaces; docs/can.md how one is set up. A name that begins with twin is a "
            "bus between "
            "programs, for heave-twin.")},
    {.key = "hosts", .kind = SETUP_TEXT, .times = if_tcp, .say = say_hosts, .check = check_hosts},
    {.key = "device",
     .kind = SETUP_TEXT,
     .times = if_serial,
     .say = say_device,
     .check = check_device,
     .help = N_("`ls /dev/serial/by-id` shows the adapters. Bit rate and parity are those of the file that was begun from.")},
    {.key = "scan", .kind = SETUP_DO, .times = if_scanned, .act = SETUP_ACT_SCAN},
    {.key = "nodes", .kind = SETUP_TEXT, .times = if_scanned, .say = say_nodes, .check = check_nodes, .took = accept_nodes},
    {.key = "turn",
     .kind = SETUP_NUMBER,
     .times = if_bus,
     .say = say_turn,
     .check = check_turn,
     .least = 1,
     .most = 2147483647,
     .unit = N_("counts"),
     .help = N_("With an encoder of 17 bits 131072. Count four times the lines of an encoder with two channels.")},
    {.key = "gear",
     .kind = SETUP_NUMBER,
     .times = if_bus,
     .least = 0.001,
     .most = 1000,
     .fallback = "1",
     .text = N_("Gear: turns of the motor for one turn of the screw?")},
    {.key = "lead",
     .kind = SETUP_NUMBER,
     .times = if_bus,
     .say = say_lead,
     .least = 0.1,
     .most = 1000,
     .unit = "mm",
     .help = N_("It stands on the plate of the cylinder. If it is wrong for one of them, the next chapter finds out.")},
    {.key = "accel",
     .kind = SETUP_NUMBER,
     .times = if_blank,
     .least = 1,
     .most = 32767,
     .unit = "mm/s^2",
     .fallback = "1000",
     .text = N_("How fast may a cylinder gain speed?"),
     .help = N_("Of every cylinder. Begin with little: it is one line of the file, and `heavectl identify` says later what the "
                "drives follow.")},
    {.key = "speed",
     .kind = SETUP_NUMBER,
     .times = if_blank,
     .least = 1,
     .most = 10000,
     .unit = "mm/s",
     .fallback = "200",
     .text = N_("How fast may a cylinder be?"),
     .help = N_("At most the rated speed of the motor, in turns a second, times the lead, over the gear.")},
    {.key = "jerk",
     .kind = SETUP_NUMBER,
     .times = if_blank,
     .least = 1,
     .most = 2147483647,
     .unit = "mm/s^3",
     .fallback = "20000",
     .text = N_("How fast may its acceleration change?")},
    {.key = "margin",
     .kind = SETUP_NUMBER,
     .times = if_blank,
     .least = 0,
     .most = 1000,
     .unit = "mm",
     .fallback = "5",
     .text = N_("How much of the stroke is to stay free at each end?")},
    {.key = "settled",
     .kind = SETUP_NUMBER,
     .times = if_blank,
     .least = 0,
     .most = 4000,
     .unit = "mm",
     .fallback = "10",
     .text = N_("How far are the cylinders out when the platform is down, for people to board?")},
    {.key = NULL},
};
