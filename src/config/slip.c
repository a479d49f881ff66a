/* SPDX-License-Identifier: MIT
 * slip.c - slips of people who write numbers; see slip.h. Only what was refused already is looked at, so a guess may be wrong
 * without harm.
 */
#include "config/slip.h"

#include "common/translate.h"

#include <string.h>

/* Signs of other keyboards that stand where a plain one belongs. */
static const struct {
    const char *bytes;
    const char *what;
} k_signs[] = {
    {"\xEF\xBC\x8C", N_("has a full-width comma; write a plain one")},
    {"\xE3\x80\x81", N_("has a Chinese comma; write a plain one")},
    {"\xEF\xBC\x8E", N_("has a full-width point; write a plain one")},
    {"\xE3\x80\x82", N_("has a Chinese full stop; write a plain point")},
    {"\xEF\xBC\x8D", N_("has a full-width minus; write a plain one")},
    {"\xE2\x88\x92", N_("has a typographic minus; write a plain -")},
    {"\xE2\x80\x93", N_("has a dash; write a plain -")},
    {"\xEF\xBC\x9B", N_("has a full-width semicolon; comments begin with a blank and a plain ;")},
    {"\xE3\x80\x80", N_("has a full-width blank; write plain ones")},
    {"\xC2\xA0", N_("has a no-break space; write plain blanks")},
    {"\xC2\xB0", N_("has a degree sign; write the number alone")},
    {"\xEF\xBC\x90", N_("has full-width digits; write plain ones")},
};

static bool is_digit(char byte)
{
    return byte >= '0' && byte <= '9';
}

static bool is_blank(char byte)
{
    return byte == ' ' || byte == '\t';
}

/* Full-width digits are ten signs. */
static bool has_wide_digit(const char *text)
{
    for (const char *at = strstr(text, "\xEF\xBC"); at != NULL; at = strstr(at + 2, "\xEF\xBC")) {
        if ((unsigned char)at[2] >= 0x90u && (unsigned char)at[2] <= 0x99u) {
            return true;
        }
    }
    return false;
}

static const char *find_sign(const char *text)
{
    for (size_t i = 0; i < sizeof k_signs / sizeof k_signs[0]; i++) {
        if (strstr(text, k_signs[i].bytes) != NULL) {
            return k_signs[i].what;
        }
    }
    return has_wide_digit(text) ? _("has full-width digits; write plain ones") : NULL;
}

/* "30 # fast": behind a value only `;` begins a comment. */
static bool has_hash_comment(const char *text)
{
    const char *hash = strchr(text, '#');
    return hash != NULL && hash > text && is_blank(hash[-1]);
}

/* "600,5": a comma between digits, in a list that has too many values, or where there is no list. */
static bool has_decimal_comma(const config_key_t *key, const char *text)
{
    unsigned commas = 0;
    bool is_tight = false;
    for (size_t i = 1; text[0] != '\0' && text[i] != '\0'; i++) {
        commas += text[i] == ',';
        is_tight = is_tight || (text[i] == ',' && is_digit(text[i - 1]) && is_digit(text[i + 1]));
    }
    const unsigned values = key->count > 0 ? key->count : 1u;
    return key->type->is_number && is_tight && commas >= values;
}

/* "0 -3 600": numbers with blanks alone between them. */
static bool has_no_commas(const config_key_t *key, const char *text)
{
    bool has_gap = false;
    for (size_t i = 0; text[i] != '\0'; i++) {
        if (strchr("0123456789+-. \t,", text[i]) == NULL) {
            return false;
        }
        has_gap = has_gap || (i > 0 && is_blank(text[i]) && is_digit(text[i - 1]) &&
                              strchr("0123456789+-.", text[i + strspn(&text[i], " \t")]) != NULL);
    }
    const bool is_one = key->type->is_number && key->count == 1;
    return has_gap && key->type->is_list && !is_one;
}

/* "600 mm" or "600mm". */
static bool has_unit(const config_key_t *key, const char *text)
{
    const size_t number = strspn(text, "0123456789+-.");
    const size_t gap = strspn(&text[number], " \t");
    return key->type->is_number && number > 0 && key->unit[0] != '\0' &&
           strncmp(&text[number + gap], key->unit, strcspn(key->unit, " /^")) == 0;
}

static const char *find(const config_key_t *key, const char *text)
{
    const char *sign = find_sign(text);
    if (sign != NULL) {
        return sign;
    }
    if (has_hash_comment(text)) {
        return _("has a # comment behind it; write it with a semicolon");
    }
    if (has_decimal_comma(key, text)) {
        return _("has a comma where a decimal point belongs");
    }
    if (has_no_commas(key, text)) {
        return _("lacks commas between its numbers");
    }
    return has_unit(key, text) ? _("has its unit behind it; write the number alone") : NULL;
}

bool config_slip_find(const config_key_t *key, const char *text, config_text_t *why)
{
    const char *slip = find(key, text);
    if (slip == NULL) {
        return false;
    }
    config_text_add_quoted(why, text, strlen(text));
    config_text_add(why, " %s", translate(slip));
    return true;
}
