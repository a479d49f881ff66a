/* SPDX-License-Identifier: MIT
 * fault_reference.c - prints docs/faults.md from the tables of faults; a check compares the two.
 */
#include <stdio.h>
#include <stdlib.h>

#include "heave/fault.h"

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d: assertion failed\n", file, line);
    abort();
}

static void print_language(fault_language_t language, const char *title, const char *head)
{
    printf("\n## %s\n\n%s\n| --- | --- | --- | --- | --- | --- |\n", title, head);
    for (unsigned code = 1; code < FAULT_CODES; code++) {
        const fault_help_t *help = fault_help((fault_code_t)code);
        const char *text = language == FAULT_ENGLISH ? fault_text((fault_code_t)code) : help->text_zh;
        printf("| %u | `%s` | %s | %s | %s | %s |\n", code, help->name, text, help->cause[language],
               fault_reaction_name(fault_reaction((fault_code_t)code)), help->remedy[language]);
    }
}

int main(void)
{
    printf("# Faults\n\nMade from the tables in `src/gateway/fault.c` and `fault_help.c`. Every fault latches: the platform goes "
           "to `FAULT` and "
           "stays there until\n"
           "`heavectl reset` with the cause gone. The first one is shown, all are counted, and the worst reaction wins.\n\n"
           "Reactions: `stop` is a controlled stop of all axes together, then the drives are disabled. `quick-stop` lets every "
           "drive stop now\n"
           "by its own ramp, all in the same cycle; its torque goes off when it stands still, after 5 s at the latest. `silent` "
           "ends "
           "all set-points, as nobody hears them: the drives' own "
           "watchdogs act.\n");
    print_language(FAULT_ENGLISH, "English", "| code | name | what | cause | reaction | remedy |");
    print_language(FAULT_CHINESE, "中文", "| 代码 | 名称 | 现象 | 原因 | 反应 | 处理 |");
    return fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
