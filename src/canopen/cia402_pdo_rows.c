/* SPDX-License-Identifier: MIT
 * cia402_pdo_rows.c - the objects of a PDO; see cia402_pdo_rows.h.
 */
#include "cia402_pdo_rows.h"

#define MAP   0x200u /* from the record of a PDO to its map */
#define TPDOS 0x1800u

/* Rows of a PDO: what has to be set before its map, */
#define PDO_HEAD 5u
#define PDO_TAIL 5u /* beside the entries, which are written and compared */

static cia402_object_t pdo_value(unsigned index, unsigned sub, uint8_t bytes, cia402_deed_t deed, uint32_t value)
{
    return (cia402_object_t){.index = (uint16_t)index,
                             .sub = (uint8_t)sub,
                             .bytes = bytes,
                             .deed = (uint8_t)deed,
                             .need = CIA402_MUST,
                             .source = CIA402_CONSTANT,
                             .constant = value,
                             .trouble = CIA402_NOT_TAKEN};
}

static cia402_object_t nothing(void)
{
    return (cia402_object_t){.deed = CIA402_SKIP};
}

static cia402_object_t if_there(unsigned index, unsigned sub, uint8_t bytes)
{
    cia402_object_t row = pdo_value(index, sub, bytes, CIA402_WRITE, 0);
    row.need = CIA402_IF_THERE;
    return row;
}

/* Type, gap, event timer or deadline, SYNC start value: what does not concern RPDOs is left out. */
static cia402_object_t pdo_head(const cia402_pdo_t *pdo, unsigned item, bool is_off_already)
{
    const bool is_sent = pdo->record >= TPDOS;
    switch (item) {
    case 0:
        return is_off_already ? nothing() : pdo_value(pdo->record, 1, 4, CIA402_PDO_OFF, 0);
    case 1:
        return pdo_value(pdo->record, 2, 1, CIA402_WRITE, pdo->every);
    case 2:
        return is_sent ? if_there(pdo->record, 3, 2) : nothing();
    case 3:
        if (pdo->deadline_ms != 0) {
            return pdo_value(pdo->record, 5, 2, CIA402_SET, pdo->deadline_ms);
        }
        return is_sent ? if_there(pdo->record, 5, 2) : nothing();
    default:
        if (is_sent && pdo->start != 0) {
            return pdo_value(pdo->record, 6, 1, CIA402_SET, pdo->start);
        }
        return is_sent ? if_there(pdo->record, 6, 1) : nothing();
    }
}

static cia402_object_t map_row(const cia402_pdo_t *pdo, unsigned sub, cia402_deed_t deed)
{
    const bool is_left = deed == CIA402_WRITE && pdo->is_fixed;
    const unsigned index = pdo->record + MAP;
    if (is_left) {
        return nothing();
    }
    return sub == 0 ? pdo_value(index, 0, 1, deed, pdo->entries) : pdo_value(index, sub, 4, deed, pdo->entry[sub - 1u]);
}

unsigned cia402_pdo_rows(const cia402_pdo_t *pdo)
{
    return pdo->entries == 0 ? 0 : PDO_HEAD + 2u * pdo->entries + PDO_TAIL;
}

/* The map from 0 to n entries, then on, then everything once more. */
cia402_object_t cia402_pdo_row(const cia402_pdo_t *pdo, unsigned item, bool is_off_already)
{
    if (item >= cia402_pdo_rows(pdo)) {
        return nothing();
    }
    if (item < PDO_HEAD) {
        return pdo_head(pdo, item, is_off_already);
    }
    const unsigned map = item - PDO_HEAD; /* 0: emptied; then the entries; then their count */
    if (map == 0 && !pdo->is_fixed) {
        return pdo_value(pdo->record + MAP, 0, 1, CIA402_WRITE, 0);
    }
    if (map <= pdo->entries + 1u) {
        return map == 0 ? nothing() : map_row(pdo, map <= pdo->entries ? map : 0, CIA402_WRITE);
    }
    const unsigned end = map - pdo->entries - 2u;
    switch (end) {
    case 0:
        return pdo_value(pdo->record, 1, 4, CIA402_PDO_ON, pdo->id);
    case 1:
        return pdo_value(pdo->record, 2, 1, CIA402_CHECK, pdo->every);
    default:
        return map_row(pdo, end - 2u, CIA402_CHECK);
    }
}
