/* SPDX-License-Identifier: MIT
 * pictures.c - see pictures.h. Lines that begin with a blank are shown as they are.
 */
#include "setup/pictures.h"

#include "common/translate.h"

static const char k_hexapod[] =
    N_("Seen from above, cylinders are numbered clockwise, 1 and 2 in front:\n"
       " \n"
       "           +x, forward                        +x, forward\n"
       " \n"
       "            1 .---. 2                              .\n"
       "          /           \\                       1 /     \\ 2\n"
       "         /             \\                       /       \\\n"
       "        /     lower     \\      +y, right      /  upper  \\      +y, right\n"
       "       6                 3                   6           3\n"
       "        \\               /                     \\         /\n"
       "          5 ._________4                         5 .---. 4\n"
       " \n"
       "Lower joints are in pairs 1 2, 3 4, 5 6, upper ones in pairs 2 3, 4 5, 6 1. +z is up; each frame has its origin in the "
       "middle of its joints. Measure from the centre of one joint to the centre of the other.");

static const char k_tripod[] = N_(
    "Seen from above, cylinders are numbered clockwise, 1 in front; lower and upper joints alike:\n"
    " \n"
    "             +x, forward\n"
    " \n"
    "                  1\n"
    "                 / \\\n"
    "                /   \\\n"
    "               /     \\         +y, right\n"
    "              /       \\\n"
    "             3 ------- 2\n"
    " \n"
    "+z is up; each frame has its origin in the middle of its joints. Measure from the centre of one joint to the centre of the "
    "other.");

const char *pictures_of(const setup_t *self)
{
    return setup_cylinders(self) == 3u ? _(k_tripod) : _(k_hexapod);
}
