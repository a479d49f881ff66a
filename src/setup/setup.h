/* SPDX-License-Identifier: MIT
 * setup.h - commissioning as a conversation: a list of questions, each with what it may be answered and what follows. Whoever
 * shows it (heavectl setup does) asks for the next question, gives the answer back, and does what a step asks to be done.
 *
 * The state is nothing but the answers in their order. Everything else follows from them, so that a file of them is all that has
 * to be kept, and a setup goes on after whatever has ended it. Nothing here touches a drive.
 */
#ifndef HEAVE_SETUP_SETUP_H
#define HEAVE_SETUP_SETUP_H

#include <stdbool.h>
#include <stddef.h>

#include "setup/ini_text.h"

#define SETUP_KEY_MAX     32u
#define SETUP_ANSWER_MAX  256u
#define SETUP_ANSWERS_MAX 192u
#define SETUP_TEXT_MAX    2048u
#define SETUP_ERROR_MAX   512u
#define SETUP_DRIVES_MAX  6u
#define SETUP_PATH_MAX    4096u

typedef struct {
    char key[SETUP_KEY_MAX];
    char text[SETUP_ANSWER_MAX];
} setup_answer_t;

/** All that is known. */
typedef struct {
    setup_answer_t answer[SETUP_ANSWERS_MAX];
    unsigned count;
    ini_text_t start; /**< the file that it begins from: a preset, a file of the person's, or a template; not kept */
} setup_t;

/** What a step wants. */
typedef enum {
    SETUP_CHOICE,  /**< one of the letters of `choices` */
    SETUP_NUMBER,  /**< from `least` to `most` */
    SETUP_TEXT,    /**< words */
    SETUP_DO,      /**< `act` is to be done; its result is the answer */
    SETUP_FINISHED /**< there is no next step */
} setup_kind_t;

/** What is to be done. Results are texts; what could not be done has none, and is done again. */
typedef enum {
    SETUP_ACT_NONE,
    SETUP_ACT_START,  /**< look up the file that answer "start" names: "hexapod" or the like, and the driver, as that file says */
    SETUP_ACT_CHECK,  /**< heaved --check: "right", "exchanged A B" (joints), else "wrong" */
    SETUP_ACT_SCAN,   /**< who is on the bus: addresses, separated by commas; behind one its serial number, "3/0x1A2B" */
    SETUP_ACT_JOG,    /**< drive `index`, by `way_mm`, held: how far it went by its own count */
    SETUP_ACT_HOME,   /**< all drives find their zero, held: "homed" */
    SETUP_ACT_COUNTS, /**< what the drives count, separated by commas */
    SETUP_ACT_SAME,   /**< "same" where they still count what "zero.counts" (or "supply.counts") says, else "moved" */
    SETUP_ACT_POSE,   /**< where heaved takes the platform to be: six numbers */
    SETUP_ACT_LIMITS, /**< the limits that heaved suggests are shown: "shown" */
    SETUP_ACT_RELAY,  /**< relay `index`, held: "switched" */
    SETUP_ACT_SWITCH, /**< the person works a switch of `index` (below), and heaved sees it: "seen", or "not seen" */
    SETUP_ACT_RISE,   /**< up by `way_mm`, or down where there is no room, held: how far */
    SETUP_ACT_TILT,   /**< by `way_mm` in degrees, held; `index` 1 and 2: pitch, 3 and 4: roll: how far */
    SETUP_ACT_ENDS,   /**< all cylinders as far as they may go, held; in where `way_mm` is below 0: "there", or "stopped K MM":
                           cylinder K did not follow beyond that extension */
    SETUP_ACT_WRITE   /**< the file and the report are written: "written" */
} setup_act_t;

/** How far the configuration is made, for a heaved that helps. */
typedef enum {
    SETUP_STAGE_GEOMETRY, /**< simulated drives: for --check */
    SETUP_STAGE_BUS,      /**< drives as they were found; their zero is made up, so that each has room in both directions */
    SETUP_STAGE_LEGS,     /**< likewise, and each on its cylinder */
    SETUP_STAGE_ZERO,     /**< drives that home do so */
    SETUP_STAGE_FULL      /**< as it will be written */
} setup_stage_t;

/** A step. */
typedef struct {
    char key[SETUP_KEY_MAX]; /**< its answer's name */
    setup_kind_t kind;
    char text[SETUP_TEXT_MAX];       /**< the question; of SETUP_DO what the person is to know before */
    const char *help;                /**< NULL: none */
    const char *choices;             /**< letters, each with its meaning: "y yes|n no" */
    char fallback[SETUP_ANSWER_MAX]; /**< taken for an empty answer; "": there is none */
    double least, most;
    const char *unit;
    setup_act_t act;
    setup_stage_t stage; /**< of the heaved that the act needs */
    unsigned index;      /**< from 1; 0: of all */
    double way_mm;
} setup_question_t;

/** The step that comes next. */
void setup_next(const setup_t *self, setup_question_t *out);

/** Takes an answer, or the result of what was done.
 *  @param error out: why it is not taken, where false is returned; nothing has changed then */
bool setup_accept(setup_t *self, const setup_question_t *question, const char *text, char error[SETUP_ERROR_MAX]);

/** Takes the newest answer of the person back, and what was done since. @return false: there is none */
bool setup_back(setup_t *self);

/** @return the answer of a step; NULL: none yet */
const char *setup_get(const setup_t *self, const char *key);

/** Makes `self->start` the configuration of a stage.
 *  @param counts what each drive counts now, for a zero that is made up; NULL: not needed */
void setup_configure(const setup_t *self, setup_stage_t stage, const double *counts, ini_text_t *out);

/** Which drivers' keys and which cylinders; "" and 0 before they are known. */
const char *setup_driver(const setup_t *self);
unsigned setup_cylinders(const setup_t *self);

/** Name and address of the bus, for a scan: as heaved --scan takes it. @return false: it has none */
bool setup_bus(const setup_t *self, char out[SETUP_ANSWER_MAX]);

/** Keeps the answers: the file is there as a whole or as it was. @return false: errno says why */
bool setup_save(const setup_t *self, const char *path);

/** @return false: there is none (errno ENOENT), it cannot be read (errno), or it is no such file (errno EINVAL) */
bool setup_load(setup_t *self, const char *path);

/** The answers, mistakes and what was checked: FILE.report.json for programs, FILE.report.html to print, FILE.report.txt.
 *  @param path out: the last of them, or that which is not on the disk
 *  @return false: errno says why */
bool setup_write_report(const setup_t *self, const char *file, const char *when, char path[SETUP_PATH_MAX]);

#endif
