/* SPDX-License-Identifier: MIT
 * canload_table.c - prints what canload_frame_bits says of every frame: `extended bytes bits` per line.
 */
#include <stdio.h>
#include <stdlib.h>

#include "heave/canload.h"

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d: assertion failed\n", file, line);
    abort();
}

int main(void)
{
    for (int extended = 0; extended < 2; extended++) {
        for (unsigned bytes = 0; bytes <= CANLOAD_BYTES_MAX; bytes++) {
            printf("%d %u %u\n", extended, bytes, (unsigned)canload_frame_bits(extended != 0, (uint8_t)bytes));
        }
    }
    return fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
