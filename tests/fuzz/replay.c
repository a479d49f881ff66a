/* SPDX-License-Identifier: MIT
 * replay.c - runs a fuzz target over files, for compilers without libFuzzer: `fuzz_NAME FILE...`.
 */
#include <stdio.h>
#include <stdlib.h>

#include "fuzz.h"

#define INPUT_MAX 65536u

static bool replay(const char *path)
{
    static uint8_t bytes[INPUT_MAX];
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        perror(path);
        return false;
    }
    const size_t length = fread(bytes, 1, sizeof bytes, file);
    (void)fclose(file);
    uint8_t *exact = malloc(length > 0 ? length : 1); /* so that a sanitizer sees what is read beyond the end */
    if (exact == NULL) {
        return false;
    }
    for (size_t i = 0; i < length; i++) {
        exact[i] = bytes[i];
    }
    (void)LLVMFuzzerTestOneInput(exact, length);
    free(exact);
    return true;
}

int main(int count, char **arguments)
{
    for (int i = 1; i < count; i++) {
        if (!replay(arguments[i])) {
            return EXIT_FAILURE;
        }
    }
    printf("%d inputs\n", count - 1);
    return count > 1 ? EXIT_SUCCESS : EXIT_FAILURE;
}
