/* SPDX-License-Identifier: MIT
 * startup_denied.c - objects that no start-up list may write; see startup_denied.h.
 */
#include "platform/startup_denied.h"

#include <stdbool.h>
#include <stddef.h>

#include "common/translate.h"
#include "heave/cia402.h"

#define PDO_FIRST    0x1400u
#define PDO_LAST     0x1BFFu
#define PDO_IS_MAP   0x0200u     /* of an index: 1600h, 1A00h */
#define PDO_OFF      0x80000000u /* of an identifier: the PDO does not exist */
#define VENDOR_MAXON 0x000000FBu
#define VENDOR_NANO  0x0000026Cu /* Nanotec */

static const char k_moves[] = N_("can give a drive torque or move it, which nothing but engaging may do");
static const char k_outputs[] = N_("switches outputs of the drive, one of which may open its brake");
static const char k_bus[] = N_("changes the bus under heaved");
static const char k_place[] = N_("is the node id or the bit rate; set it by the maker's program");
static const char k_alone[] = N_("lets a drive start without heaved");
static const char k_silence[] = N_("is what a drive does when heaved falls silent");
static const char k_program[] = N_("is the drive's program");
static const char k_memory[] = N_("would write the drive's memory at each start, which wears it; store by the maker's program");
static const char k_pdo[] =
    N_("belongs to the PDOs, which heaved sets up; allowed is an identifier with bit 31, which switches a PDO off");

/* Both ends included. */
static const struct {
    uint16_t first;
    uint16_t last;
    uint32_t vendor; /* 0: any */
    const char *reason;
} k_denied[] = {
    {0x1005, 0x1006, 0, k_bus},     /* SYNC */
    {0x100B, 0x100B, 0, k_place},   /* node id, of older versions of CiA 301 */
    {0x1010, 0x1011, 0, k_memory},  /* store, restore */
    {0x1012, 0x1012, 0, k_bus},     /* identifier of the time stamp */
    {0x1014, 0x1014, 0, k_bus},     /* identifier of the emergency messages */
    {0x1016, 0x1017, 0, k_bus},     /* heartbeats */
    {0x1019, 0x1019, 0, k_bus},     /* SYNC counter */
    {0x1029, 0x1029, 0, k_silence}, /* error behaviour */
    {0x1200, 0x12FF, 0, k_bus},     /* SDO channels */
    {0x1F50, 0x1F57, 0, k_program},
    {0x1F80, 0x1F8A, 0, k_alone}, /* NMT start-up, slaves, boot time */
    {0x2000, 0x2001, VENDOR_MAXON, k_place},
    {0x2005, 0x2005, VENDOR_NANO, k_place},
    {0x2009, 0x2009, VENDOR_NANO, k_place},
    {0x6007, 0x6007, 0, k_silence}, /* abort connection option */
    {0x6040, 0x6040, 0, k_moves},   /* controlword */
    {0x6042, 0x6042, 0, k_moves},   /* target velocity of mode vl */
    {0x6060, 0x6060, 0, k_moves},   /* mode of operation */
    {0x6071, 0x6071, 0, k_moves},   /* target torque */
    {0x607A, 0x607A, 0, k_moves},   /* target position */
    {0x60B0, 0x60B2, 0, k_moves},   /* offsets of targets */
    {0x60C1, 0x60C1, 0, k_moves},   /* set-points of mode ip */
    {0x60FE, 0x60FE, 0, k_outputs}, /* digital outputs */
    {0x60FF, 0x60FF, 0, k_moves},   /* target velocity */
};

const char *config_startup_denied(uint16_t index, uint8_t sub, uint32_t value, uint32_t vendor)
{
    const uint16_t plain = cia402_plain_index(index);
    if (plain >= PDO_FIRST && plain <= PDO_LAST) {
        const bool is_switched_off = (plain & PDO_IS_MAP) == 0 && sub == 1 && (value & PDO_OFF) != 0;
        return is_switched_off ? NULL : translate(k_pdo);
    }
    for (size_t i = 0; i < sizeof k_denied / sizeof k_denied[0]; i++) {
        if (plain >= k_denied[i].first && plain <= k_denied[i].last &&
            (k_denied[i].vendor == 0 || k_denied[i].vendor == vendor)) {
            return translate(k_denied[i].reason);
        }
    }
    return NULL;
}
