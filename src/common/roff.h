/* SPDX-License-Identifier: MIT
 * roff.h - text as a manual page has it: escaped, in short lines. Macros of man(7).
 * By hand: scdoc and asciidoctor would have to be installed for every build, and what they save here is the escaping alone.
 */
#ifndef HEAVE_COMMON_ROFF_H
#define HEAVE_COMMON_ROFF_H

#include <stdio.h>

/** The page's head. */
void roff_title(const char *name, const char *section, const char *date, const char *version, FILE *out);

/** A section's heading. */
void roff_heading(const char *title, FILE *out);

/** Running text; `words` between backquotes are bold. Ends its line. */
void roff_text(const char *text, FILE *out);

/** Text on a line of its own in bold. */
void roff_bold(const char *text, FILE *out);

/** An item of a list in bold; its text follows. */
void roff_item(const char *text, FILE *out);

/** Paragraphs, and between them lines that begin with a blank, printed as they are. */
void roff_paragraphs(const char *text, FILE *out);

#endif
