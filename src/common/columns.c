/* SPDX-License-Identifier: MIT
 * columns.c - see columns.h.
 */
#include "common/columns.h"

#include <string.h>
#include <wchar.h>

glyph_t columns_glyph(const char *text)
{
    mbstate_t state;
    wchar_t wide = 0;
    if (text[0] == '\0') {
        return (glyph_t){0, 0};
    }
    memset(&state, 0, sizeof state);
    const size_t bytes = mbrtowc(&wide, text, strlen(text), &state);
    const int columns = bytes < (size_t)-2 ? wcwidth(wide) : -1;
    return columns >= 0 ? (glyph_t){bytes, (unsigned)columns} : (glyph_t){1, 1};
}

unsigned columns_of(const char *text)
{
    unsigned columns = 0;
    for (glyph_t glyph = columns_glyph(text); glyph.bytes > 0; glyph = columns_glyph(text)) {
        columns += glyph.columns;
        text += glyph.bytes;
    }
    return columns;
}

int columns_lacking(const char *text, unsigned columns)
{
    const unsigned has = columns_of(text);
    return has < columns ? (int)(columns - has) : 0;
}

void columns_put(FILE *out, const char *text, unsigned columns)
{
    fprintf(out, "%s%*s", text, columns_lacking(text, columns), "");
}

/* Whether a character is one of these. */
static bool is_one_of(const char *text, const char *const *marks, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (strncmp(text, marks[i], strlen(marks[i])) == 0) {
            return true;
        }
    }
    return false;
}

bool columns_is_closing(const char *text)
{
    static const char *const k_closing[] = {"，", "。", "、", "；", "：", "？", "！", "）", "”", "’", "》",
                                            "】", "…",  ",",  ".",  ";",  ":",  ")",  "]",  "%", "?"};
    return is_one_of(text, k_closing, sizeof k_closing / sizeof k_closing[0]);
}

bool columns_may_break(const char *previous, const char *text)
{
    static const char *const k_opening[] = {"（", "“", "‘", "《", "【", "(", "["};
    if (previous == NULL || columns_is_closing(text) || is_one_of(previous, k_opening, sizeof k_opening / sizeof k_opening[0])) {
        return false;
    }
    return columns_glyph(previous).columns == 2u || columns_glyph(text).columns == 2u;
}
