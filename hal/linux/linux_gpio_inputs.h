/* SPDX-License-Identifier: MIT
 * linux_gpio_inputs.h - the operator's switches on GPIO lines: contacts that close towards ground (lines pulled up), or towards
 * supply (pulled down). The e-stop's contact is normally closed: open, or a broken wire, is an e-stop. Key and button close when
 * they are active. A thread of its own reads the lines, since a chip may take its time or hang: at every edge and every 10 ms, or
 * every millisecond where the chip tells of no edges. An e-stop that was active between two reads is told of by the next one.
 * Lines that cannot be read, were not read for a quarter of a second, or whose edges could not be listened to for as long, are
 * HV_ERR_IO. The caller owns linux_gpio_inputs_t, which must not move while open; nothing is allocated after open.
 */
#ifndef LINUX_GPIO_INPUTS_H
#define LINUX_GPIO_INPUTS_H

#include <pthread.h>

#include "heave/hal/inputs.h"
#include "linux_gpio.h"

#define LINUX_GPIO_INPUTS_MAX 5u

/** The switches. */
typedef struct {
    linux_gpio_names_t names;              /**< count 0: none at all, nothing is opened */
    uint32_t input[LINUX_GPIO_INPUTS_MAX]; /**< what each line is: INPUT_ESTOP, ... */
    bool is_active_low;                    /**< a closed contact pulls its line low */
} linux_gpio_inputs_config_t;

/** Open switches; private. */
typedef struct {
    linux_gpio_chip_t chip;
    uint32_t input[LINUX_GPIO_INPUTS_MAX];
    unsigned count;
    uint32_t present;
    bool has_edges;   /**< the worker's, once it runs */
    uint32_t levels;  /**< newest; the worker writes */
    uint32_t pressed; /**< channels of the e-stop that were open since the last read; the worker sets, a read clears */
    uint32_t read_ms; /**< when the lines were last read; the worker writes */
    uint8_t is_lost;  /**< the last call of the kernel failed; the worker writes */
    uint8_t is_ending;
    bool is_open;
    int wake; /**< eventfd */
    pthread_t thread;
    char error_text[LINUX_GPIO_TEXT_SIZE];
} linux_gpio_inputs_t;

/** Finds and requests the lines, reads them once and starts the worker.
 *  @return HV_OK; HV_ERR_IO: error_text says what is wrong */
hv_status_t linux_gpio_inputs_open(linux_gpio_inputs_t *self, const linux_gpio_inputs_config_t *config) HV_MUST_CHECK;

/** Ends the worker and gives the lines back. Takes at most a second, where a chip hangs. Harmless on ones that are not open.
 *  @return false: the chip hangs, and the worker may still use self */
bool linux_gpio_inputs_close(linux_gpio_inputs_t *self);

/** The switches as hal/inputs.h wants them. */
hal_inputs_t linux_gpio_inputs_hal(linux_gpio_inputs_t *self);

#endif
