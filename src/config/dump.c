/* SPDX-License-Identifier: MIT
 * dump.c - the table of keys written out: as a configuration file with the values of a platform, and as a reference.
 */
#include <string.h>

#include "common/roff.h"
#include "common/translate.h"
#include "config/startup.h"
#include "config/value.h"

/* "required", or the default. */
static void add_default(const config_key_t *key, config_text_t *text)
{
    if (key->fallback == NULL) {
        config_text_add(text, _("required"));
    } else {
        config_text_add(text, _("default %s"), key->fallback);
    }
}

/* A key with its help; as a comment where it means nothing on this platform. */
static void dump_key(const config_key_t *key, const config_t *config, bool is_section_used, FILE *out)
{
    const bool is_used = is_section_used && config_is_applicable(key->needs, config);
    config_text_t allowed, value;
    config_text_clear(&allowed);
    config_text_clear(&value);
    config_value_allowed(key, &allowed);
    config_text_add(&allowed, "; ");
    add_default(key, &allowed);
    fprintf(out, "; %s\n; %s\n", translate(key->help), allowed.data);
    if (is_used) {
        config_value_format(key, config, &value);
        fprintf(out, "%s = %s\n", key->name, value.data);
    } else {
        fprintf(out, _("; %s: not on this platform\n"), key->name);
    }
}

void config_dump(const config_t *self, FILE *out)
{
    for (size_t i = 0; i < config_section_count; i++) {
        const config_section_t *section = &config_sections[i];
        const bool is_used = config_is_applicable(section->needs, self);
        fprintf(out, "%s; %s\n%s[%s]\n", i == 0 ? "" : "\n", translate(section->help),
                is_used ? "" : _("; not on this platform: "), section->name);
        for (size_t k = 0; k < config_key_count; k++) {
            if (strcmp(config_keys[k].section, section->name) == 0) {
                dump_key(&config_keys[k], self, is_used, out);
            }
        }
        config_startup_dump(section, self, out);
    }
}

/* A cell of a Markdown table. */
static void write_cell(const char *text, FILE *out)
{
    for (; *text != '\0'; text++) {
        if (*text == '|') {
            fputc('\\', out);
        }
        fputc(*text, out);
    }
    fputs(" | ", out);
}

static const char *need_text(config_needs_t needs)
{
    switch (needs) {
    case CONFIG_NEEDS_NOTHING:
        return "";
    case CONFIG_NEEDS_HEXAPOD:
        return _(" (hexapod only)");
    case CONFIG_NEEDS_ANGLE:
        return _(" (with `present = yes` only)");
    }
    return "";
}

static void write_row(const config_key_t *key, FILE *out)
{
    config_text_t allowed;
    config_text_clear(&allowed);
    config_value_allowed(key, &allowed);
    fprintf(out, "| `%s` | ", key->name);
    write_cell(allowed.data, out);
    fprintf(out, "%s | ", key->fallback == NULL ? _("required") : key->fallback);
    fprintf(out, "%s%s%s |\n", translate(key->help), need_text(key->needs), key->is_live ? " (SIGHUP)" : "");
}

void config_write_reference(FILE *out)
{
    const char *languages = strcmp(translate_language(), "en") == 0 ? "English | [\u4e2d\u6587](configuration.zh-CN.md)"
                                                                    : "[English](configuration.md) | \u4e2d\u6587";
    fprintf(
        out, "# %s\n\n%s\n\n%s\n", _("Configuration reference"), languages,
        _("One INI file. Comments start with `;`. Decimal point, no thousands separator. Written by the build from the table of "
          "keys in src/config/keys.c. Keys marked (SIGHUP) change in operation when heaved gets that signal and the whole file "
          "is right; the others need a restart."));
    for (size_t i = 0; i < config_section_count; i++) {
        const config_section_t *section = &config_sections[i];
        fprintf(out, "\n## [%s]\n\n%s%s\n\n", section->name, translate(section->help), need_text(section->needs));
        if (config_startup_is_list(section)) {
            fputs(translate(config_startup_help), out);
            continue;
        }
        fprintf(out, "%s\n| --- | --- | --- | --- |\n", _("| key | allowed | default | meaning |"));
        for (size_t k = 0; k < config_key_count; k++) {
            if (strcmp(config_keys[k].section, section->name) == 0) {
                write_row(&config_keys[k], out);
            }
        }
    }
}

static void write_item(const config_key_t *key, FILE *out)
{
    config_text_t allowed, head;
    config_text_clear(&head);
    config_text_add(&head, "%s =", key->name);
    roff_item(head.data, out);
    config_text_clear(&allowed);
    config_value_allowed(key, &allowed);
    config_text_add(&allowed, "; ");
    add_default(key, &allowed);
    roff_text(allowed.data, out);
    fputs(".br\n", out);
    config_text_clear(&allowed);
    config_text_add(&allowed, "%s%s%s", translate(key->help), need_text(key->needs), key->is_live ? " (SIGHUP)" : "");
    roff_text(allowed.data, out);
}

void config_write_manual(FILE *out)
{
    for (size_t i = 0; i < config_section_count; i++) {
        const config_section_t *section = &config_sections[i];
        fprintf(out, ".SH %s [%s]\n", _("SECTION"), section->name);
        config_text_t text;
        config_text_clear(&text);
        config_text_add(&text, "%s%s", translate(section->help), need_text(section->needs));
        roff_text(text.data, out);
        if (config_startup_is_list(section)) {
            fputs(".PP\n", out);
            roff_text(translate(config_startup_help), out);
        }
        for (size_t k = 0; k < config_key_count; k++) {
            if (strcmp(config_keys[k].section, section->name) == 0) {
                write_item(&config_keys[k], out);
            }
        }
    }
}
