/* SPDX-License-Identifier: MIT
 * mutate_frames.c - custom mutator for datagrams: pieces of frames are put in, taken out and exchanged; the rest libFuzzer does.
 */
#include "mutate.h"

#include <string.h>

static const char *const k_pieces[] = {
    "@A6:",
    "@A3:",
    "@A7T:",
    "@C6:",
    "@C7T:",
    "@A4:",
    "@C3:",
    "#",
    "##",
    "@",
    ",",
    "T:",
    "0,",
    "-0,",
    "1e-05,",
    "1E5,",
    ".5,",
    "5.,",
    "32767.99,",
    "-32768,",
    "32768,",
    "0.00000762939453125,",
    "0x0FFF",
    "0xFFFF",
    "F0",
    " ",
    "\t",
    "\r\n",
    "+1,",
    "1e400,",
    "nan,",
    "1.#",
    "-1.#IND00,",
    "3600000#",
    "3600000.5#",
    "-1#",
    "@A6:1,2,3,4,5,6,F#",
    "@C6T:0,0,0,0,0,0,100#",
    "a3:",
    "#A6:",
    "\xD0\x90",
    "\xEF\xBC\x8C",
    "99999999999999999999,",
};

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed)
{
    mutate_t random = mutate_start(seed);
    if (size == 0 || mutate_below(&random, 4) == 0) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    const char *piece = k_pieces[mutate_below(&random, sizeof k_pieces / sizeof k_pieces[0])];
    const size_t at = 1 + mutate_below(&random, size); /* behind the dialect */
    switch (mutate_below(&random, 3)) {
    case 0:
        return mutate_insert(data, size, max_size, at, (const uint8_t *)piece, strlen(piece));
    case 1:
        return mutate_remove(data, size, at, 1 + mutate_below(&random, 8));
    default:
        size = mutate_remove(data, size, at, strlen(piece));
        return mutate_insert(data, size, max_size, at, (const uint8_t *)piece, strlen(piece));
    }
}
