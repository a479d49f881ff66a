/* SPDX-License-Identifier: MIT
 * start.h - what start-up expects of the program, beside main().
 */
#ifndef START_H
#define START_H

#include <stdint.h>

/** The stack grows down from the end of RAM to the end of the variables; from cortex-m.ld. */
extern uint32_t start_bss_end[];
extern uint32_t start_stack_end[];

/** Every processor fault and every interrupt without a handler ends here: fail silent, never return. */
void start_fail(void);

#endif
