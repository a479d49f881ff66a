/* SPDX-License-Identifier: MIT
 * eds.h - the file that a maker gives with a CANopen device (CiA 306): an EDS says which objects there are, a DCF also what they
 * are set to. Read for --check --eds, --import-dcf and heavectl drive; never by a thread of heaved.
 */
#ifndef HEAVE_COMMON_EDS_H
#define HEAVE_COMMON_EDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/** A number of the file. */
typedef struct {
    bool is_there;
    bool has_node; /**< the drive's node id is to be added ($NODEID) */
    bool is_text;  /**< not there, but a text is: a name, a decimal fraction, more than 64 bits; value is a hash of it */
    int64_t value;
} eds_number_t;

/** An object with its sub-index. */
typedef struct {
    uint16_t index;
    uint8_t sub;
    bool is_readable;
    bool is_writable;
    bool is_mappable;
    bool is_parent;  /**< has no value of its own, only sub-indices, which may have its type and access */
    bool is_place;   /**< by its name, or that of its record, the node id or the bit rate */
    uint16_t type;   /**< as in the file: 5 is u8, and so on */
    uint8_t compact; /**< so many sub-indices have the attributes of this */
    unsigned line;   /**< of its section */
    eds_number_t low, high, fallback, parameter;
} eds_object_t;

/** A file. */
typedef struct {
    eds_object_t *object; /**< in the order of the file */
    size_t objects;
    size_t room;
    eds_number_t vendor, product;
    eds_number_t node;   /**< of a DCF */
    unsigned strays;     /**< values in sections that are no objects, of sub-indices that cannot be, or given twice */
    unsigned stray_line; /**< of the first */
    unsigned bitrates;   /**< bit N: the Nth of eds_bitrates_kbps */
    bool has_bitrates;
    bool has_compact_pdos; /**< the objects of PDOs are not in the file (CompactPDO), but in the device: */
    unsigned rpdos, tpdos; /**< so many of them */
} eds_t;

/** What a file can say of bit rates; ends with 0. */
extern const unsigned eds_bitrates_kbps[];

/** Reads a file.
 *  @param name  of the file, for errors
 *  @return false: it has been said on `errors`, with the line; eds_free() is due all the same */
bool eds_read(eds_t *self, FILE *in, const char *name, FILE *errors);

void eds_free(eds_t *self);

/** @return NULL where there is no such object */
const eds_object_t *eds_find(const eds_t *self, uint16_t index, uint8_t sub);

/** Bytes of a value; 0 where it is no whole number of up to 32 bits. */
uint8_t eds_bytes(const eds_object_t *object);

/** True where the file leaves out an object of a PDO that the device has. */
bool eds_is_compact_pdo(const eds_t *self, uint16_t index);

/** A value as its type has it: 0xFFF9 is -7 in an i16. */
int64_t eds_shown(const eds_object_t *object, uint32_t value);

/** Its type as a start-up list has it: "u16". */
const char *eds_type_name(const eds_object_t *object);

#endif
