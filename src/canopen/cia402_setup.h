/* SPDX-License-Identifier: MIT
 * cia402_setup.h - leads one drive through rows of the table of objects, by SDO.
 */
#ifndef CIA402_SETUP_H
#define CIA402_SETUP_H

#include "heave/cia402.h"

/** How it goes. */
typedef enum {
    CIA402_SETUP_BUSY,
    CIA402_SETUP_DONE,
    CIA402_SETUP_REFUSED, /**< trouble, trouble_object and trouble_code of the axis say why */
    CIA402_SETUP_SILENT   /**< the drive does not answer any more, or not when it is asked for this object */
} cia402_setup_result_t;

/** Begins a job; one that goes on is given up.
 *  @param mode that the drive shall end in (the jobs SETUP and MODE) */
void cia402_setup_begin(cia402_axis_t *self, cia402_job_t job, cia402_mode_t mode, uint64_t now_us);

/** The object that it is at, index << 8 | sub. */
uint32_t cia402_setup_object(const cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis);

/** Goes on as far as it can. Idle jobs are DONE. */
cia402_setup_result_t cia402_setup_step(cia402_axis_t *self, const cia402_config_t *config, const cia402_axis_config_t *axis,
                                        uint64_t now_us);

#endif
