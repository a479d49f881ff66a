/* SPDX-License-Identifier: MIT
 * linux_can_trouble.c - what is wrong with a CAN interface, in words; see linux_can_trouble.h.
 */
#include "linux_can_trouble.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

void linux_can_trouble_forget(linux_can_t *self)
{
    self->trouble = LINUX_CAN_FINE;
    self->failing = NULL;
    self->error_text[0] = '\0';
}

hv_status_t linux_can_trouble_report(linux_can_t *self, linux_can_trouble_t trouble, int error, const char *what)
{
    self->trouble = trouble;
    self->failing = NULL;
    self->error = error;
    (void)snprintf(self->error_text, sizeof self->error_text, "can: %s: %s%s%s", self->name, what, error != 0 ? ": " : "",
                   error != 0 ? strerror(error) : "");
    return HV_ERR_IO;
}

void linux_can_trouble_cut_off(linux_can_t *self, hal_can_state_t state)
{
    self->state = state;
    self->is_cut = true;
    self->has_kept = false;
}

hv_status_t linux_can_trouble_say_gone(linux_can_t *self)
{
    linux_can_trouble_cut_off(self, HAL_CAN_GONE);
    (void)linux_can_trouble_report(self, LINUX_CAN_NO_INTERFACE, 0,
                                   "there is no such interface: is the adapter plugged in? (ip -br link show type can)");
    return HV_ERR_AGAIN;
}

hv_status_t linux_can_trouble_say_down(linux_can_t *self)
{
    linux_can_trouble_cut_off(self, HAL_CAN_DOWN);
    return linux_can_trouble_report(self, LINUX_CAN_IS_DOWN, 0,
                                    "the interface is down (as root: ip link set it up, with its bitrate)");
}

hv_status_t linux_can_trouble_say_bus_off(linux_can_t *self)
{
    linux_can_trouble_cut_off(self, HAL_CAN_BUS_OFF);
    return linux_can_trouble_report(self, LINUX_CAN_IS_BUS_OFF, 0,
                                    "bus-off: the controller gave up; check wiring, termination and bit rate");
}

hv_status_t linux_can_trouble_note_failure(linux_can_t *self, int error, const char *what)
{
    switch (error) {
    case ENETDOWN:
        return linux_can_trouble_say_down(self);
    case ENODEV:
    case ENXIO:
        (void)linux_can_trouble_say_gone(self);
        return HV_ERR_IO;
    default:
        (void)linux_can_trouble_report(self, error == EPERM || error == EACCES ? LINUX_CAN_NOT_ALLOWED : LINUX_CAN_SYSTEM_ERROR,
                                       error, what);
        self->failing = what;
        return HV_ERR_IO;
    }
}

void linux_can_trouble_note_success(linux_can_t *self, const char *what)
{
    if (self->failing == what) {
        linux_can_trouble_forget(self);
    }
}
