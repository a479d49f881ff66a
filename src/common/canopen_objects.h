/* SPDX-License-Identifier: MIT
 * canopen_objects.h - the common objects of CANopen drives (CiA 301, CiA 402) for people: names, types, what a value means; and
 * values of any object between text and bytes. Pure.
 */
#ifndef HEAVE_COMMON_CANOPEN_OBJECTS_H
#define HEAVE_COMMON_CANOPEN_OBJECTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** Types of values, by the names that start-up lists use. */
typedef enum {
    CANOPEN_U8,
    CANOPEN_U16,
    CANOPEN_U32,
    CANOPEN_I8,
    CANOPEN_I16,
    CANOPEN_I32,
    CANOPEN_TEXT, /**< read only */
    CANOPEN_TYPES
} canopen_type_t;

#define CANOPEN_TYPE_NAMES "u8, u16, u32, i8, i16, i32"

/** What an object is good for: bits of use. */
enum {
    CANOPEN_SHOWN = 1,   /**< what somebody wants to see who asks for a drive */
    CANOPEN_SETTING = 2, /**< what a drive is set to */
    CANOPEN_ERRORS = 4   /**< its history of errors */
};

/** A row: an object, or several that differ in the sub-index. */
typedef struct {
    uint16_t index;
    uint8_t sub;  /**< from */
    uint8_t last; /**< to */
    uint8_t type; /**< canopen_type_t */
    uint8_t use;
    const char *name;
} canopen_object_t;

/** Ends with a row without a name. */
extern const canopen_object_t canopen_objects[];

/** Index of an object of the first axis of a node (6000h to 67FFh) as another axis of it has it; other objects are the node's.
 *  @param channel [0, 3]; 0: the first axis */
uint16_t canopen_index_of_axis(uint16_t index, unsigned channel);

/** @param index of any axis of a node
 *  @return NULL where it is none of the common ones */
const canopen_object_t *canopen_object_find(uint16_t index, uint8_t sub);

/** Reads "6041", "6041:00", "0x6041:0": hexadecimal.
 *  @return false where it is no place */
bool canopen_place_read(const char *text, uint16_t *index, uint8_t *sub);

const char *canopen_type_name(canopen_type_t type);
uint8_t canopen_type_bytes(canopen_type_t type);

/** @return false where there is no such type */
bool canopen_type_find(const char *name, canopen_type_t *out);

/** Reads a value, decimal or 0x...
 *  @return false where it is no number, or does not fit */
bool canopen_value_read(canopen_type_t type, const char *text, int64_t *out);
void canopen_value_range(canopen_type_t type, int64_t *least, int64_t *most);

/** Bytes as a number, least significant first; of at most 4. */
int64_t canopen_value(canopen_type_t type, const uint8_t *bytes, size_t size);

/** What a value means: "operation enabled", "following error", ...
 *  @param index of any axis of a node
 *  @param text "" where that is not known, or the number says it all; cut to fit */
void canopen_object_meaning(uint16_t index, uint8_t sub, int64_t value, char *text, size_t capacity);

#endif
