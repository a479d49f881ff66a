/* SPDX-License-Identifier: MIT
 * config_reference.c - prints docs/configuration.md as the table of keys has it, in the language of the environment.
 */
#include <stdlib.h>

#include "common/translate.h"
#include "config/config.h"
#include "heave/status.h"

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d: assertion failed\n", file, line);
    abort();
}

int main(void)
{
    translate_begin();
    config_write_reference(stdout);
    translate_end();
    return fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
