/* SPDX-License-Identifier: MIT
 * startup.c - start-up lists of CANopen drives as text; see startup.h.
 */
#include "config/startup.h"

#include "common/translate.h"

#include <inttypes.h>
#include <string.h>

const char config_startup_help[] = N_(
    "A line is `0x2030:01 = 50 u16`: object, value, type (u8 i8 u16 i16 u32 i32), written before everything that heaved sets and "
    "read back. `is` instead of `=`: only looked at. Behind the type may stand `unchecked`: not read back; `if-there`: a drive "
    "may be without it, or refuse it; `last`: after everything else.\n");

const char config_startup_allowed[] =
    N_("0x2030:01 = 50 u16, is instead of = to look only; type u8 i8 u16 i16 u32 i32; then unchecked, if-there, last");

const config_startup_t *config_startup_of(const config_section_t *section, const config_t *config)
{
    static const char k_name[] = "cia402-startup";
    if (strcmp(section->name, "cia402-angle-startup") == 0) {
        return &config->cia402.angle_startup;
    }
    if (strncmp(section->name, k_name, sizeof k_name - 1u) != 0) {
        return NULL;
    }
    const char *number = section->name + sizeof k_name; /* behind the "-" */
    return section->name[sizeof k_name - 1u] == '\0' ? &config->cia402.startup : &config->cia402.drive_startup[number[0] - '1'];
}

bool config_startup_is_list(const config_section_t *section)
{
    static const config_t k_none;
    return config_startup_of(section, &k_none) != NULL;
}

/* Signed numbers are what they were as unsigned ones: to the drive it is the same. */
void config_startup_format(const cia402_item_t *item, config_text_t *text)
{
    config_text_add(text, "0x%04X:%s%02X %s 0x%" PRIX32 " u%u%s%s%s", (unsigned)item->index, item->sub > 9 ? "0x" : "", item->sub,
                    item->is_written ? "=" : "is", item->value, 8u * item->bytes, item->is_checked ? "" : " unchecked",
                    item->is_optional ? " if-there" : "", item->is_last ? " last" : "");
}

void config_startup_dump(const config_section_t *section, const config_t *config, FILE *out)
{
    const config_startup_t *list = config_startup_of(section, config);
    config_text_t text;
    if (list == NULL) {
        return;
    }
    fprintf(out, _("; lines such as %s\n"), translate(config_startup_allowed));
    for (unsigned i = 0; i < list->count && config_is_applicable(section->needs, config); i++) {
        config_text_clear(&text);
        config_startup_format(&list->item[i], &text);
        fprintf(out, "%s\n", text.data);
    }
}
