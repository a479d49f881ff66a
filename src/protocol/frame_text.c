/* SPDX-License-Identifier: MIT
 * frame_text.c - rejected frames in words, for people who write senders.
 * Says at which byte, what is wrong there and what would be right; names characters that only look like the right one.
 */
#include "heave/frame.h"

#include "heave/text.h"

/* Characters taken for ASCII ones: first to last look like ascii and those after it. */
typedef struct {
    uint32_t first;
    uint32_t last;
    char ascii; /* '\0': nothing is to be typed instead */
    const char *name;
} look_alike_t;

static const look_alike_t k_look_alikes[] = {
    {0x00A0, 0x00A0, ' ', "NO-BREAK SPACE"},
    {0x00AD, 0x00AD, '\0', "SOFT HYPHEN"},
    {0x00B7, 0x00B7, '.', "MIDDLE DOT"},
    {0x0391, 0x0391, 'A', "GREEK CAPITAL LETTER ALPHA"},
    {0x0392, 0x0392, 'B', "GREEK CAPITAL LETTER BETA"},
    {0x0395, 0x0395, 'E', "GREEK CAPITAL LETTER EPSILON"},
    {0x039F, 0x039F, '0', "GREEK CAPITAL LETTER OMICRON"},
    {0x03A4, 0x03A4, 'T', "GREEK CAPITAL LETTER TAU"},
    {0x03F9, 0x03F9, 'C', "GREEK CAPITAL LUNATE SIGMA SYMBOL"},
    {0x0410, 0x0410, 'A', "CYRILLIC CAPITAL LETTER A"},
    {0x0412, 0x0412, 'B', "CYRILLIC CAPITAL LETTER VE"},
    {0x0415, 0x0415, 'E', "CYRILLIC CAPITAL LETTER IE"},
    {0x0417, 0x0417, '3', "CYRILLIC CAPITAL LETTER ZE"},
    {0x041E, 0x041E, '0', "CYRILLIC CAPITAL LETTER O"},
    {0x0421, 0x0421, 'C', "CYRILLIC CAPITAL LETTER ES"},
    {0x0422, 0x0422, 'T', "CYRILLIC CAPITAL LETTER TE"},
    {0x0430, 0x0430, 'a', "CYRILLIC SMALL LETTER A"},
    {0x0435, 0x0435, 'e', "CYRILLIC SMALL LETTER IE"},
    {0x0441, 0x0441, 'c', "CYRILLIC SMALL LETTER ES"},
    {0x0660, 0x0669, '0', "ARABIC-INDIC DIGIT"},
    {0x066B, 0x066B, '.', "ARABIC DECIMAL SEPARATOR"},
    {0x06F0, 0x06F9, '0', "EXTENDED ARABIC-INDIC DIGIT"},
    {0x0966, 0x096F, '0', "DEVANAGARI DIGIT"},
    {0x2002, 0x200A, ' ', "TYPOGRAPHIC SPACE"},
    {0x200B, 0x200F, '\0', "INVISIBLE FORMAT CHARACTER"},
    {0x2010, 0x2010, '-', "HYPHEN"},
    {0x2011, 0x2011, '-', "NON-BREAKING HYPHEN"},
    {0x2012, 0x2012, '-', "FIGURE DASH"},
    {0x2013, 0x2013, '-', "EN DASH"},
    {0x2014, 0x2014, '-', "EM DASH"},
    {0x201A, 0x201A, ',', "SINGLE LOW-9 QUOTATION MARK"},
    {0x2022, 0x2022, ':', "BULLET"},
    {0x202F, 0x202F, ' ', "NARROW NO-BREAK SPACE"},
    {0x2212, 0x2212, '-', "MINUS SIGN"},
    {0x2236, 0x2236, ':', "RATIO"},
    {0x266F, 0x266F, '#', "MUSIC SHARP SIGN"},
    {0x3000, 0x3000, ' ', "IDEOGRAPHIC SPACE"},
    {0x3001, 0x3001, ',', "IDEOGRAPHIC COMMA"},
    {0x3002, 0x3002, '.', "IDEOGRAPHIC FULL STOP"},
    {0xFE13, 0xFE13, ':', "PRESENTATION FORM FOR VERTICAL COLON"},
    {0xFE50, 0xFE50, ',', "SMALL COMMA"},
    {0xFE55, 0xFE55, ':', "SMALL COLON"},
    {0xFE5F, 0xFE5F, '#', "SMALL NUMBER SIGN"},
    {0xFE63, 0xFE63, '-', "SMALL HYPHEN-MINUS"},
    {0xFE6B, 0xFE6B, '@', "SMALL COMMERCIAL AT"},
    {0xFEFF, 0xFEFF, '\0', "BYTE ORDER MARK"},
    {0xFF03, 0xFF03, '#', "FULLWIDTH NUMBER SIGN"},
    {0xFF0B, 0xFF0B, '+', "FULLWIDTH PLUS SIGN"},
    {0xFF0C, 0xFF0C, ',', "FULLWIDTH COMMA"},
    {0xFF0D, 0xFF0D, '-', "FULLWIDTH HYPHEN-MINUS"},
    {0xFF0E, 0xFF0E, '.', "FULLWIDTH FULL STOP"},
    {0xFF10, 0xFF19, '0', "FULLWIDTH DIGIT"},
    {0xFF1A, 0xFF1A, ':', "FULLWIDTH COLON"},
    {0xFF20, 0xFF20, '@', "FULLWIDTH COMMERCIAL AT"},
    {0xFF21, 0xFF3A, 'A', "FULLWIDTH LATIN CAPITAL LETTER"},
    {0xFF41, 0xFF5A, 'a', "FULLWIDTH LATIN SMALL LETTER"},
};

static const look_alike_t *look_alike_find(uint32_t code_point)
{
    for (size_t i = 0; i < sizeof k_look_alikes / sizeof k_look_alikes[0]; i++) {
        if (code_point >= k_look_alikes[i].first && code_point <= k_look_alikes[i].last) {
            return &k_look_alikes[i];
        }
    }
    return NULL;
}

/* Of those of the table: none is between the capital and the small letters, or behind these. */
static const char *kind_of(char ascii)
{
    if (ascii >= '0' && ascii <= '9') {
        return "digit";
    }
    return ascii >= 'A' ? "letter" : "character";
}

/* "U+0410 CYRILLIC CAPITAL LETTER A looks like A; type the ASCII letter" */
static void put_look_alike(text_t *line, uint32_t code_point)
{
    const look_alike_t *row = look_alike_find(code_point);
    text_put(line, "; U+");
    text_put_hex(line, code_point, 4);
    if (row == NULL) {
        text_put(line, " is not ASCII");
        return;
    }
    text_put(line, " ");
    text_put(line, row->name);
    if (row->ascii == '\0') {
        text_put(line, " is invisible; leave it out");
        return;
    }
    const char ascii = (char)(row->ascii + (uint8_t)(code_point - row->first));
    text_put(line, " looks like ");
    if (ascii == ' ') {
        text_put(line, "a blank");
    } else {
        text_put_char(line, ascii);
    }
    text_put(line, "; type the ASCII ");
    text_put(line, kind_of(ascii));
}

/* The offending byte, where it is one. */
static void put_found(text_t *line, const frame_reject_t *reject)
{
    if (reject->look_alike != 0) {
        put_look_alike(line, reject->look_alike);
    } else if (reject->byte > ' ' && reject->byte <= '~') {
        text_put(line, "; found '");
        text_put_char(line, (char)reject->byte);
        text_put(line, "'");
    } else if (reject->byte == ' ' || reject->byte == '\t') {
        text_put(line, "; found a blank");
    } else if (reject->byte == '\r' || reject->byte == '\n') {
        text_put(line, "; found a line break");
    } else if (reject->byte != 0) {
        text_put(line, "; found byte 0x");
        text_put_hex(line, reject->byte, 2);
        text_put(line, reject->byte >= 0x80 ? ", neither ASCII nor UTF-8" : "");
    }
}

static void put_command(text_t *line, const frame_reject_t *reject)
{
    if (reject->command < FRAME_COMMANDS) {
        text_put(line, frame_command_name(reject->command));
        text_put(line, reject->is_timed ? "T" : "");
    } else {
        text_put(line, "the command");
    }
}

#define POSE "roll", "pitch", "yaw", "x", "y", "z"
#define LEGS "cylinder 1", "cylinder 2", "cylinder 3", "cylinder 4", "cylinder 5", "cylinder 6"

static const char *const k_value_names[FRAME_COMMANDS][FRAME_VALUES_MAX] = {
    [FRAME_A3] = {"roll", "pitch", "z"},
    [FRAME_A4] = {"roll", "pitch", "z", "angle"},
    [FRAME_A6] = {POSE},
    [FRAME_A7] = {POSE, "angle"},
    [FRAME_C3] = {"cylinder 1", "cylinder 2", "cylinder 3"},
    [FRAME_C6] = {LEGS},
    [FRAME_C7] = {LEGS, "angle"},
};

/* "value 3 of A6 (yaw)" */
static void put_value(text_t *line, const frame_reject_t *reject)
{
    text_put(line, "value ");
    text_put_u32(line, reject->field);
    text_put(line, " of ");
    put_command(line, reject);
    if (reject->command < FRAME_COMMANDS && reject->field >= 1 && reject->field <= frame_value_count(reject->command)) {
        text_put(line, " (");
        text_put(line, k_value_names[reject->command][reject->field - 1]);
        text_put(line, ")");
    }
}

/* "A6 takes 6 values and a mask, found 8" */
static void put_count(text_t *line, const frame_reject_t *reject)
{
    put_command(line, reject);
    text_put(line, " takes ");
    text_put_u32(line, reject->expected);
    text_put(line, reject->is_timed ? " values and a time, found " : " values and a mask, found ");
    text_put_u32(line, reject->found);
    if (reject->found > reject->expected + 1u) {
        text_put(line, "; a decimal comma counts as a separator");
    }
}

static void put_unfinished(text_t *line, const frame_reject_t *reject)
{
    text_put(line, "the frame from byte ");
    text_put_u32(line, reject->start);
    text_put(line, " on has no '#' at its end; a frame must be whole within one datagram");
}

static void put_bad_command(text_t *line, const frame_reject_t *reject)
{
    text_put(line, "not a command; right are A3 A4 A6 A7 C3 C6 C7, and T behind them for a timed move");
    if (reject->byte >= 'a' && reject->byte <= 'z') {
        text_put(line, "; lower case needs dialect = lenient");
    }
    put_found(line, reject);
}

/* What would be right, then what was found. */
static void put_field(text_t *line, const frame_reject_t *reject, const char *what)
{
    text_put(line, what);
    if (reject->is_nan) {
        text_put(line, "; 1.# and a letter is a Windows program's NaN or infinity");
    } else {
        put_found(line, reject);
    }
}

static void put_reason(text_t *line, const frame_reject_t *reject)
{
    switch (reject->error) {
    case FRAME_ERR_NO_HEAD:
        text_put(line, reject->byte == 0 ? "no frame in this datagram" : "outside a frame");
        put_field(line, reject, "; a frame starts with '@', as in @A6:0,0,0,0,0,0,0#");
        break;
    case FRAME_ERR_UNFINISHED:
        put_unfinished(line, reject);
        break;
    case FRAME_ERR_COMMAND:
        put_bad_command(line, reject);
        break;
    case FRAME_ERR_SEPARATOR:
        put_command(line, reject);
        put_field(line, reject, " must be followed by ':'");
        break;
    case FRAME_ERR_COUNT:
        put_count(line, reject);
        break;
    case FRAME_ERR_VALUE_EMPTY:
        put_value(line, reject);
        text_put(line, " is empty; write 0");
        break;
    case FRAME_ERR_VALUE_SYNTAX:
        put_value(line, reject);
        put_field(line, reject, " is not a decimal number; write it as 5, -5.5 or 1E-05");
        break;
    case FRAME_ERR_VALUE_OVERFLOW:
        put_value(line, reject);
        text_put(line, " is outside -32768 to 32767.9999");
        break;
    case FRAME_ERR_MASK:
        put_field(line, reject, "the relay mask is 1 to 4 hexadecimal digits, as in F0");
        break;
    case FRAME_ERR_TIME:
        put_command(line, reject);
        put_field(line, reject, " ends with its time, a number of ms from 0 to 3600000");
        break;
    case FRAME_ERR_TIME_RANGE:
        put_command(line, reject);
        text_put(line, " has a time above 3600000 ms");
        break;
    case FRAME_ERR_PLATFORM:
        put_command(line, reject);
        text_put(line, " asks for an axis that this platform does not have");
        break;
    case FRAME_ERR_MASK_FORM:
        put_command(line, reject);
        text_put(line, " has a relay mask where its sender sends none, or none where it sends one");
        break;
    case FRAME_ERRORS:
        break;
    }
}

size_t frame_reject_describe(const frame_reject_t *reject, char *text, size_t capacity)
{
    text_t line = text_start(text, capacity);
    text_put(&line, "byte ");
    text_put_u32(&line, reject->offset);
    text_put(&line, ": ");
    put_reason(&line, reject);
    return line.length;
}

static const char *const k_error_names[FRAME_ERRORS] = {
    [FRAME_ERR_NO_HEAD] = "no_head",
    [FRAME_ERR_UNFINISHED] = "unfinished",
    [FRAME_ERR_COMMAND] = "command",
    [FRAME_ERR_SEPARATOR] = "separator",
    [FRAME_ERR_COUNT] = "count",
    [FRAME_ERR_VALUE_EMPTY] = "value_empty",
    [FRAME_ERR_VALUE_SYNTAX] = "value_syntax",
    [FRAME_ERR_VALUE_OVERFLOW] = "value_overflow",
    [FRAME_ERR_MASK] = "mask",
    [FRAME_ERR_TIME] = "time",
    [FRAME_ERR_TIME_RANGE] = "time_range",
    [FRAME_ERR_PLATFORM] = "platform",
    [FRAME_ERR_MASK_FORM] = "mask_form",
};

const char *frame_error_name(frame_error_t error)
{
    return k_error_names[error];
}
