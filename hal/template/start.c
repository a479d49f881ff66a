/* SPDX-License-Identifier: MIT
 * start.c - from reset to main() on any Cortex-M: vector table, variables, and traps for what C leaves undefined.
 * A chip's clocks, watchdog and interrupts are the port's; their handlers go into the table behind the sixteen of the core.
 */
#include "start.h"

#include <string.h>

/* From cortex-m.ld. */
extern uint32_t start_data[];
extern uint32_t start_data_end[];
extern uint32_t start_data_flash[];
extern uint32_t start_bss[];

#define CCR         (*(volatile uint32_t *)0xE000ED14u) /* configuration and control register of the core */
#define UNALIGN_TRP (1u << 3)                           /* unaligned words trap on a Cortex-M0 anyway */
#define DIV_0_TRP   (1u << 4)

int main(void);
void start_reset(void);

void start_reset(void)
{
    memcpy(start_data, start_data_flash, (uintptr_t)start_data_end - (uintptr_t)start_data);
    memset(start_bss, 0, (uintptr_t)start_bss_end - (uintptr_t)start_bss);
    CCR |= UNALIGN_TRP | DIV_0_TRP;
    (void)main();
    start_fail();
}

/** Vector table: where the stack begins, then sixteen less one exceptions of the core. */
typedef struct {
    uint32_t *stack;
    void (*handler[15])(void);
} start_vectors_t;

extern const start_vectors_t k_start_vectors;
const start_vectors_t k_start_vectors
    __attribute__((section(".vectors"), used)) = {start_stack_end,
                                                  {start_reset, start_fail, start_fail, start_fail, start_fail, start_fail, NULL,
                                                   NULL, NULL, NULL, start_fail, start_fail, NULL, start_fail, start_fail}};
