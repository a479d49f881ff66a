/* SPDX-License-Identifier: MIT
 * test_translate.c - catalogues: which one is chosen, what a damaged one does, sentences found by their format, and widths.
 */
#include "common/translate.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/columns.h"
#include "common/sentence.h"
#include "heave/status.h"
#include "unity.h"

#define BYTES_MAX 4096u

/* Sorted, as msgfmt sorts them. */
static const char *const k_texts[][2] = {
    {"", "Content-Type: text/plain; charset=UTF-8\n"},
    {"%s in %s; possible: %s", "%s，当前状态 %s；可用：%s"},
    {"%u of %s are wrong", "%2$s 中有 %1$u 个错误"},
    {"HOLD", "暂停"},
    {"the value is too long", "值过长"},
    {"there is nothing to resume", "没有可以继续的动作"},
    {"unfinished", ""},
};
#define TEXTS (sizeof k_texts / sizeof k_texts[0])

static char m_folder[64];
static uint8_t m_bytes[BYTES_MAX];
static size_t m_length;

static void put_number(size_t at, size_t value)
{
    for (unsigned i = 0; i < 4; i++) {
        m_bytes[at + i] = (uint8_t)(value >> (8u * i));
    }
}

/* A catalogue as msgfmt writes it. */
static void build(void)
{
    memset(m_bytes, 0, sizeof m_bytes);
    put_number(0, 0x950412DEu);
    put_number(8, TEXTS);
    put_number(12, 28);
    put_number(16, 28 + 8 * TEXTS);
    m_length = 28 + 16 * TEXTS;
    for (size_t i = 0; i < 2 * TEXTS; i++) {
        const char *text = k_texts[i % TEXTS][i / TEXTS];
        put_number(28 + 8 * i, strlen(text));
        put_number(32 + 8 * i, m_length);
        memcpy(&m_bytes[m_length], text, strlen(text));
        m_length += strlen(text) + 1;
    }
}

static const char *path_of(const char *language)
{
    static char path[128];
    (void)snprintf(path, sizeof path, "%s/%s", m_folder, language);
    (void)mkdir(path, 0700);
    (void)snprintf(path, sizeof path, "%s/%s/LC_MESSAGES", m_folder, language);
    (void)mkdir(path, 0700);
    (void)snprintf(path, sizeof path, "%s/%s/LC_MESSAGES/heave.mo", m_folder, language);
    return path;
}

static void write_file(size_t length)
{
    FILE *file = fopen(path_of("zh_CN"), "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL(length, fwrite(m_bytes, 1, length, file));
    (void)fclose(file);
}

/* "LANG=... LC_ALL=..." */
static void set_environment(const char *settings)
{
    static const char *const k_names[] = {"LANGUAGE", "LC_ALL", "LC_MESSAGES", "LC_CTYPE", "LANG"};
    char text[128];
    for (size_t i = 0; i < sizeof k_names / sizeof k_names[0]; i++) {
        (void)unsetenv(k_names[i]);
    }
    (void)snprintf(text, sizeof text, "%s", settings);
    for (char *word = strtok(text, " "); word != NULL; word = strtok(NULL, " ")) {
        char *value = strchr(word, '=');
        *value = '\0';
        (void)setenv(word, value + 1, 1);
    }
}

void setUp(void)
{
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-translate-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    (void)setenv("HEAVE_LOCALES", m_folder, 1);
    build();
    write_file(m_length);
}

void tearDown(void)
{
    char command[128];
    translate_end();
    (void)snprintf(command, sizeof command, "rm -r %s", m_folder);
    TEST_ASSERT_EQUAL(0, system(command));
}

static void begin(const char *settings)
{
    set_environment(settings);
    translate_begin();
}

static void test_translate_locale_chooses_the_language(void)
{
    static const char *const k_chinese[] = {
        "LANG=zh_CN.UTF-8", "LC_ALL=zh_CN.utf8 LANG=C",        "LANG=C.UTF-8 LC_MESSAGES=zh_CN.UTF-8",
        "LANG=zh_SG.UTF-8", "LANG=en_US.UTF-8 LANGUAGE=zh_CN", "LANG=C.UTF-8 LANGUAGE=fr:zh_CN:en",
        "LANG=zh_TW.UTF-8", "LANGUAGE=zh LANG=de_DE.UTF-8",
    };
    static const char *const k_english[] = {
        "LANG=en_US.UTF-8",
        "LANG=C",
        "LANG=POSIX LANGUAGE=zh_CN",
        "",
        "LANG=zh_CN.UTF-8 LANGUAGE=en:zh_CN",
        "LANG=zh_CN.GBK",
        "LC_ALL=C LANG=zh_CN.UTF-8",
        "LANG=zh_CN.UTF-8 LC_CTYPE=C LC_MESSAGES=zh_CN",
        "LANG=fr_FR.UTF-8",
        "LANG=C.UTF-8 LANGUAGE=../zh_CN",
    };
    for (size_t i = 0; i < sizeof k_chinese / sizeof k_chinese[0]; i++) {
        begin(k_chinese[i]);
        TEST_ASSERT_EQUAL_STRING_MESSAGE("暂停", _("HOLD"), k_chinese[i]);
        TEST_ASSERT_EQUAL_STRING_MESSAGE("zh_CN", translate_language(), k_chinese[i]);
    }
    for (size_t i = 0; i < sizeof k_english / sizeof k_english[0]; i++) {
        begin(k_english[i]);
        TEST_ASSERT_EQUAL_STRING_MESSAGE("HOLD", _("HOLD"), k_english[i]);
        TEST_ASSERT_EQUAL_STRING_MESSAGE("en", translate_language(), k_english[i]);
    }
}

static void test_translate_unknown_and_empty_texts_stay_english(void)
{
    begin("LANG=zh_CN.UTF-8");
    TEST_ASSERT_EQUAL_STRING("RISING", _("RISING"));
    TEST_ASSERT_EQUAL_STRING("unfinished", _("unfinished"));
    TEST_ASSERT_EQUAL_STRING("", translate(""));
    TEST_ASSERT_EQUAL_STRING("one", translate_count("one", "many", 1));
    TEST_ASSERT_EQUAL_STRING("many", translate_count("one", "many", 0));
    TEST_ASSERT_EQUAL_STRING("暂停", translate_count("HOLD", "HOLDS", 5));
    translate_end();
    TEST_ASSERT_EQUAL_STRING("HOLD", _("HOLD"));
}

/* Cut anywhere it is refused; with any byte changed it is refused or harmless (a sanitizer looks on). */
static void test_translate_damaged_catalogues_are_refused_or_harmless(void)
{
    char out[SENTENCE_MAX];
    unsigned refused = 0;
    for (size_t length = 0; length < m_length; length++) {
        write_file(length);
        begin("LANG=zh_CN.UTF-8");
        TEST_ASSERT_EQUAL_STRING("en", translate_language());
    }
    for (size_t at = 0; at < m_length; at++) {
        for (unsigned change = 1; change < 256; change += 51) {
            m_bytes[at] ^= (uint8_t)change;
            write_file(m_length);
            begin("LANG=zh_CN.UTF-8");
            refused += strcmp(translate_language(), "en") == 0;
            for (size_t i = 0; i < TEXTS; i++) {
                TEST_ASSERT_NOT_NULL(translate(k_texts[i][0]));
            }
            TEST_ASSERT_NOT_NULL(sentence("7 of them are wrong", out, sizeof out));
            m_bytes[at] ^= (uint8_t)change;
        }
    }
    TEST_ASSERT_GREATER_THAN(100, refused);
}

static void expect(const char *expected, const char *english)
{
    char out[SENTENCE_MAX];
    TEST_ASSERT_EQUAL_STRING(expected, sentence(english, out, sizeof out));
}

static void test_sentence_is_found_by_its_format(void)
{
    begin("LANG=zh_CN.UTF-8");
    expect("值过长", "the value is too long");
    expect("them 中有 7 个错误", "7 of them are wrong");
    expect("resume: 没有可以继续的动作，当前状态 暂停；可用：engage, park",
           "resume: there is nothing to resume in HOLD; possible: engage, park");
    expect("dump: 值过长", "dump: the value is too long");
    expect("nobody knows this one", "nobody knows this one");
    expect("x of them are wrong", "x of them are wrong");
    expect("7 of them are wrong!", "7 of them are wrong!");
    translate_end();
    expect("the value is too long", "the value is too long");
}

/* What does not fit ends with a NUL. */
static void test_sentence_is_cut_where_it_does_not_fit(void)
{
    char out[8];
    begin("LANG=zh_CN.UTF-8");
    (void)sentence("7 of them are wrong", out, sizeof out);
    TEST_ASSERT_EQUAL(7, strlen(out));
}

static void test_columns_chinese_characters_take_two(void)
{
    begin("LANG=zh_CN.UTF-8");
    TEST_ASSERT_EQUAL(0, columns_of(""));
    TEST_ASSERT_EQUAL(4, columns_of("HOLD"));
    TEST_ASSERT_EQUAL(4, columns_of("暂停"));
    TEST_ASSERT_EQUAL(8, columns_of("缸 1：mm"));
    TEST_ASSERT_EQUAL(5, columns_lacking("暂停", 9));
    TEST_ASSERT_EQUAL(0, columns_lacking("暂停", 3));
    TEST_ASSERT_EQUAL(3, columns_of("a\xFF"
                                    "b"));
}

static void test_columns_breaks_keep_marks_with_their_words(void)
{
    begin("LANG=zh_CN.UTF-8");
    TEST_ASSERT_TRUE(columns_may_break("暂", "停"));
    TEST_ASSERT_TRUE(columns_may_break("停", "mm"));
    TEST_ASSERT_FALSE(columns_may_break("停", "，"));
    TEST_ASSERT_FALSE(columns_may_break("（", "停"));
    TEST_ASSERT_FALSE(columns_may_break("a", "b"));
    TEST_ASSERT_FALSE(columns_may_break(NULL, "停"));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_translate_locale_chooses_the_language);
    RUN_TEST(test_translate_unknown_and_empty_texts_stay_english);
    RUN_TEST(test_translate_damaged_catalogues_are_refused_or_harmless);
    RUN_TEST(test_sentence_is_found_by_its_format);
    RUN_TEST(test_sentence_is_cut_where_it_does_not_fit);
    RUN_TEST(test_columns_chinese_characters_take_two);
    RUN_TEST(test_columns_breaks_keep_marks_with_their_words);
    return UNITY_END();
}
