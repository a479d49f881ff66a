/* SPDX-License-Identifier: MIT
 * linux_gpio_relays.h - relays on GPIO lines. A thread of its own writes them, since a chip on USB or I2C may take its time or
 * hang; between it and the motion thread is one word, and the newest mask wins. All lines are one request and are set in one call
 * of the kernel. They stand at the safe mask from the first moment, and again when the bank is closed. After the process has died
 * without closing they are what chip and driver make of them: nothing that is unsafe when left closed, or when opened, belongs
 * here. The caller owns linux_gpio_relays_t, which must not move while open; nothing is allocated after open.
 */
#ifndef LINUX_GPIO_RELAYS_H
#define LINUX_GPIO_RELAYS_H

#include <pthread.h>

#include "heave/hal/relays.h"
#include "linux_gpio.h"

/** A bank. */
typedef struct {
    linux_gpio_names_t names; /**< relay 1 first; count 0: no relays at all, nothing is opened */
    const char *consumer;     /**< what the kernel tells others of who has them */
    bool is_active_low;       /**< a low level closes a relay */
    uint16_t safe_mask;
} linux_gpio_relays_config_t;

/** An open bank; private. */
typedef struct {
    linux_gpio_chip_t chip;
    uint8_t count;
    uint16_t safe_mask;
    uint32_t asked;    /**< newest mask, and a number above it that tells two requests apart; the motion thread writes */
    uint32_t done;     /**< the number of the last one carried out and the mask read back; the worker writes */
    uint8_t is_lost;   /**< the last call of the kernel failed; the worker writes */
    uint8_t is_ending; /**< the worker is to end */
    bool is_open;
    int wake;          /**< eventfd */
    uint64_t asked_us; /**< when the newest mask was asked for */
    pthread_t thread;
    char error_text[LINUX_GPIO_TEXT_SIZE];
} linux_gpio_relays_t;

/** Finds and requests the lines and starts the worker.
 *  @return HV_OK; HV_ERR_IO: error_text says what is wrong */
hv_status_t linux_gpio_relays_open(linux_gpio_relays_t *self, const linux_gpio_relays_config_t *config) HV_MUST_CHECK;

/** Sets this mask, ends the worker and gives the lines back. Takes at most a second, where a chip hangs. Harmless on one that
 *  is not open.
 *  @return false: the chip hangs, and the worker may still use self */
bool linux_gpio_relays_close(linux_gpio_relays_t *self, uint16_t safe_mask);

/** The bank as hal/relays.h wants it. */
hal_relays_t linux_gpio_relays_hal(linux_gpio_relays_t *self);

#endif
