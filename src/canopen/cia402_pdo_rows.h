/* SPDX-License-Identifier: MIT
 * cia402_pdo_rows.h - the objects that set a PDO up, in the order that every known stack accepts.
 */
#ifndef CIA402_PDO_ROWS_H
#define CIA402_PDO_ROWS_H

#include "cia402_objects.h"

#define CIA402_PDOS_USUAL 4u /**< records of a channel and direction that are switched off whether they are used or not */

/** Rows of the PDO; 0 where it is not used. */
unsigned cia402_pdo_rows(const cia402_pdo_t *pdo);

/** One of them; CIA402_SKIP where nothing is to be done, as beyond the last.
 *  @param is_off_already nobody has to switch it off before it is mapped */
cia402_object_t cia402_pdo_row(const cia402_pdo_t *pdo, unsigned item, bool is_off_already);

#endif
