/* SPDX-License-Identifier: MIT
 * objects.h - the object dictionary of a simulated CiA 402 drive: values, access, and the rules of PDO mapping, as strict as the
 * strictest of several real stacks. What passes here passes there. Shares nothing with the driver that it is to test.
 */
#ifndef HEAVE_TWIN_OBJECTS_H
#define HEAVE_TWIN_OBJECTS_H

#include <stdbool.h>
#include <stdint.h>

#define OBJECTS_MAX   320u
#define OBJECT_PLACES 512u /* a power of two above it */
#define OBJECT_PDOS   4u
#define OBJECT_AXES   4u

/** SDO abort codes. */
enum {
    OBJECT_UNSUPPORTED = 0x06010000,
    OBJECT_READ_ONLY = 0x06010002,
    OBJECT_MISSING = 0x06020000,
    OBJECT_NOT_MAPPABLE = 0x06040041,
    OBJECT_PDO_LENGTH = 0x06040042,
    OBJECT_TOO_LONG = 0x06070012,
    OBJECT_TOO_SHORT = 0x06070013,
    OBJECT_NO_SUB = 0x06090011,
    OBJECT_BAD_VALUE = 0x06090030,
    OBJECT_WRONG_STATE = 0x08000022
};

/** One value; of signed ones the bits. */
typedef struct {
    uint16_t index;
    uint8_t sub;
    uint8_t bytes;
    bool is_read_only;
    bool is_in_rpdo; /**< may be mapped into one */
    bool is_in_tpdo;
    bool is_missing;  /**< taken away: as if it were not there */
    bool is_silent;   /**< nothing comes back when it is asked for */
    uint32_t refusal; /**< writes end with this abort code; 0 = none */
    uint32_t value;
    uint32_t fallback; /**< what it holds after a reset */
    bool is_forced;    /**< made to hold a value; what it was before: */
    bool was_read_only;
    uint32_t was_value, was_fallback;
} object_t;

/** All objects of one drive, as the first axis of a node has them. */
typedef struct objects {
    uint32_t count;
    object_t row[OBJECTS_MAX];
    uint16_t place[OBJECT_PLACES];     /**< where to look for a row: its number from 1; 0 = nothing */
    struct objects *axis[OBJECT_AXES]; /**< of the node: what a PDO may have in it; NULL = there is none */
} objects_t;

/** As the drive leaves the factory.
 *  @param identity 1018h, sub 1 to 4
 *  @param is_first the first axis of its node, whose PDOs have identifiers by themselves */
void objects_start(objects_t *self, uint8_t node, const uint32_t identity[4], bool is_first);

/** One more, of the maker; none where there is no room. Its value is the one after a reset. */
void objects_add(objects_t *self, object_t row);

/** What a PDO has in it from the factory.
 *  @param mapping  1600h to 1603h, 1A00h to 1A03h
 *  @param entry    index << 16 | sub << 8 | bits
 *  @param is_fixed and cannot be changed */
void objects_map(objects_t *self, uint16_t mapping, const uint32_t *entry, uint8_t entries, bool is_fixed);

/** What an entry of a mapping means, of whichever axis of the node; NULL where there is no such thing. */
object_t *objects_mapped(const objects_t *self, uint32_t entry);

/** Gives communication objects (1000h to 1FFFh) what they hold after a reset. */
void objects_reset(objects_t *self);

/** NULL where there is none. */
object_t *objects_find(objects_t *self, uint16_t index, uint8_t sub);

/** Of an object that every drive has. One that is forced keeps its value, and has this one when it is let go. */
uint32_t objects_get(const objects_t *self, uint16_t index, uint8_t sub);
void objects_put(objects_t *self, uint16_t index, uint8_t sub, uint32_t value);

/** Whether a communication record (1400h, 1800h, ...) is switched on. */
bool objects_is_pdo(const objects_t *self, uint16_t record);

/** Bytes of a mapping (1600h, 1A00h, ...). */
uint8_t objects_mapped_bytes(const objects_t *self, uint16_t mapping);

/** The abort code of an access by SDO; 0 = none, and the object is there. */
uint32_t objects_read_refusal(objects_t *self, uint16_t index, uint8_t sub);

/** Writes by SDO. Returns the abort code; 0 = done. */
uint32_t objects_write(objects_t *self, uint16_t index, uint8_t sub, uint32_t value, uint8_t bytes, bool is_operational);

#endif
