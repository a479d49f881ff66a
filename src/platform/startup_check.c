/* SPDX-License-Identifier: MIT
 * startup_check.c - start-up lists of CANopen drives beside what heaved sets itself; see check.h.
 */
#include "common/translate.h"
#include "platform/check.h"
#include "platform/cia402_section.h"
#include "platform/startup_denied.h"
#include "config/startup.h"

/* An item of a drive that heaved writes as well. */
static bool is_written_by_heaved(const cia402_config_t *drives, unsigned axis, const cia402_item_t *item)
{
    cia402_wish_t wish = {0};
    while (item->is_written && cia402_next_wish(drives, axis, &wish)) {
        if (wish.is_own && wish.is_written && wish.index == item->index && wish.sub == item->sub) {
            return true;
        }
    }
    return false;
}

/* The first and the last axis whose drives get a list. */
static void find_axes(const config_cia402_t *cia402, const config_startup_t *list, unsigned angle, unsigned axes[2])
{
    if (list == &cia402->startup) {
        axes[0] = 0;
        axes[1] = angle - 1u;
    } else {
        axes[0] = axes[1] = list == &cia402->angle_startup ? angle : (unsigned)(list - cia402->drive_startup);
    }
}

static void check_item(config_source_t *self, const cia402_config_t *drives, const unsigned axes[2], const char *section,
                       const cia402_item_t *item, unsigned line)
{
    const char *denied =
        item->is_written ? config_startup_denied(item->index, item->sub, item->value, self->config->cia402.vendor_id) : NULL;
    bool is_own = false;
    for (unsigned axis = axes[0]; axis <= axes[1]; axis++) {
        is_own = is_own || is_written_by_heaved(drives, axis, item);
    }
    if (is_own) {
        config_source_error(self, line, "[%s] 0x%04X:%02X: heaved sets it itself; allowed: the keys of [cia402] for that",
                            section, item->index, item->sub);
    } else if (denied != NULL) {
        config_source_error(self, line, "[%s] 0x%04X:%02X %s; allowed: other objects, or `is` to look", section, item->index,
                            item->sub, denied);
    }
}

void config_startup_check(config_source_t *self)
{
    static cia402_config_t drives;
    config_cia402(self->config, &drives);
    const unsigned angle = drives.axes - (self->config->settings.has_angle ? 1u : 0u);
    for (size_t i = 0; i < config_section_count; i++) {
        const config_startup_t *list = config_startup_of(&config_sections[i], self->config);
        unsigned axes[2];
        if (list == NULL || !config_is_applicable(config_sections[i].needs, self->config)) {
            continue;
        }
        find_axes(&self->config->cia402, list, angle, axes);
        for (unsigned k = 0; k < list->count; k++) {
            check_item(self, &drives, axes, config_sections[i].name, &list->item[k], self->startup_line[i][k]);
        }
    }
}
