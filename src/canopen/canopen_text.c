/* SPDX-License-Identifier: MIT
 * canopen_text.c - numbers in words; see canopen_text.h.
 */
#include "heave/canopen_text.h"

/** A number under a mask. */
typedef struct {
    uint32_t code;
    uint32_t mask;
    const char *text;
} row_t;

static const row_t k_aborts[] = {
    {0x05030000u, 0xFFFFFFFFu, "toggle bit not alternated"},
    {0x05040000u, 0xFFFFFFFFu, "the transfer timed out"},
    {0x05040001u, 0xFFFFFFFFu, "unknown command"},
    {0x05040005u, 0xFFFFFFFFu, "out of memory"},
    {0x06010000u, 0xFFFFFFFFu, "this access is not supported now"},
    {0x06010001u, 0xFFFFFFFFu, "the object can only be written"},
    {0x06010002u, 0xFFFFFFFFu, "the object can only be read"},
    {0x06020000u, 0xFFFFFFFFu, "there is no such object"},
    {0x06040041u, 0xFFFFFFFFu, "the object cannot be mapped to a PDO"},
    {0x06040042u, 0xFFFFFFFFu, "too much is mapped to the PDO"},
    {0x06040043u, 0xFFFFFFFFu, "the parameter is incompatible"},
    {0x06040047u, 0xFFFFFFFFu, "internal incompatibility in the device"},
    {0x06060000u, 0xFFFFFFFFu, "hardware error"},
    {0x06070010u, 0xFFFFFFFFu, "the length does not match"},
    {0x06070012u, 0xFFFFFFFFu, "the value is too long"},
    {0x06070013u, 0xFFFFFFFFu, "the value is too short"},
    {0x06090011u, 0xFFFFFFFFu, "there is no such sub-index"},
    {0x06090030u, 0xFFFFFFFFu, "the value is out of range"},
    {0x06090031u, 0xFFFFFFFFu, "the value is too high"},
    {0x06090032u, 0xFFFFFFFFu, "the value is too low"},
    {0x06090036u, 0xFFFFFFFFu, "the maximum is below the minimum"},
    {0x060A0023u, 0xFFFFFFFFu, "no resources for the transfer"},
    {0x08000000u, 0xFFFFFFFFu, "general error"},
    {0x08000020u, 0xFFFFFFFFu, "cannot be stored"},
    {0x08000021u, 0xFFFFFFFFu, "the device is under local control"},
    {0x08000022u, 0xFFFFFFFFu, "not in the present state of the device"},
    {0x08000023u, 0xFFFFFFFFu, "there is no object dictionary"},
    {0x08000024u, 0xFFFFFFFFu, "no data"},
    {0, 0, "unknown abort code"},
};

/* The first row that matches counts. */
static const row_t k_errors[] = {
    {0x0000, 0xFFFF, "no error"},
    {0x2310, 0xFFFF, "continuous over-current"},
    {0x3210, 0xFFFF, "over-voltage of the DC link"},
    {0x3220, 0xFFFF, "under-voltage of the DC link"},
    {0x4210, 0xFFFF, "the drive is too hot"},
    {0x4310, 0xFFFF, "the motor is too hot"},
    {0x7305, 0xFFFF, "encoder"},
    {0x8110, 0xFFFF, "CAN overrun: messages were lost"},
    {0x8120, 0xFFFF, "CAN error-passive"},
    {0x8130, 0xFFFF, "the gateway's heartbeat was lost"},
    {0x8140, 0xFFFF, "recovered from bus-off"},
    {0x8150, 0xFFFF, "identifier used twice on the bus"},
    {0x8210, 0xFFFF, "a PDO was too short"},
    {0x8220, 0xFFFF, "a PDO was too long"},
    {0x8240, 0xFFFF, "SYNC of the wrong length"},
    {0x8250, 0xFFFF, "set-points did not come in time"},
    {0x8611, 0xFFFF, "following error"},
    {0x8612, 0xFFFF, "limit of the travel"},
    {0x8613, 0xFFFF, "homing failed"},
    {0x8700, 0xFFFF, "synchronisation with the bus"},
    {0x1000, 0xF000, "generic error"},
    {0x2000, 0xF000, "current"},
    {0x3000, 0xF000, "voltage"},
    {0x4000, 0xF000, "temperature"},
    {0x5000, 0xF000, "hardware of the drive"},
    {0x6000, 0xF000, "software of the drive"},
    {0x7000, 0xF000, "additional modules: encoder, brake chopper, memory"},
    {0x8000, 0xFE00, "communication"},
    {0x8400, 0xFF00, "speed controller"},
    {0x8500, 0xFF00, "position controller"},
    {0x8000, 0xF000, "supervision"},
    {0x9000, 0xF000, "an external error"},
    {0xF000, 0xF000, "a code of the drive's maker"},
    {0, 0, "unknown code"},
};

/* Ends at the row that takes every number. */
static const char *look_up(const row_t *row, uint32_t code)
{
    while ((code & row->mask) != row->code) {
        row++;
    }
    return row->text;
}

const char *canopen_abort_text(uint32_t code)
{
    return look_up(k_aborts, code);
}

const char *canopen_error_text(uint16_t code)
{
    return look_up(k_errors, code);
}
