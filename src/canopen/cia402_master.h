/* SPDX-License-Identifier: MIT
 * cia402_master.h - another master on the bus: found while nothing is sent yet, and afterwards by what only a master sends.
 */
#ifndef CIA402_MASTER_H
#define CIA402_MASTER_H

#include "heave/cia402.h"

/** A frame was received, which is never our own.
 *  @return true: only a master sends it, and there is nothing else to be done with it */
bool cia402_master_receive(cia402_t *self, const can_frame_t *frame);

/** Once at the first poll: begins to listen, where the configuration wants it. */
void cia402_master_begin(cia402_t *self);

/** Once in each poll, behind what was received: drives stop, or tell.
 *  @return true: it still listens, and nothing may be sent */
bool cia402_master_step(cia402_t *self);

/** An operator asks for a reset. A node in the NMT state stopped answers no question: it is told to be pre-operational. Somebody
 * may have stopped it on purpose, so that nothing else leads to this, and it is not done while others have torque. */
void cia402_master_wake(cia402_t *self);

#endif
