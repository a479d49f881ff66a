/* SPDX-License-Identifier: MIT
 * editor.h - configurations that pages edit: staged in the panel's own state directory, a file for each platform, until heaved
 * takes them over. No path of a request: a file is named by the platform's name, which the panel has.
 */
#ifndef HEAVE_PANEL_EDITOR_H
#define HEAVE_PANEL_EDITOR_H

#include "panel/upstream.h"

#define EDITOR_PATH_MAX   512u
#define EDITOR_TEXT_MAX   131072u /* bytes of a configuration, as heaved has it */
#define EDITOR_DIGEST_MAX 17u

/** Keeps a text. @param path out: of its file
 *  @return false, and why */
bool editor_stage(const char *state, const upstream_t *upstream, const char *text, size_t length, char path[EDITOR_PATH_MAX],
                  char digest[EDITOR_DIGEST_MAX], char *why, size_t size);

/** What was staged, as a descriptor for heaved, sealed.
 *  @param digest of what the page has checked: another text is refused
 *  @return -1, and why */
int editor_open(const char *state, const upstream_t *upstream, const char *digest, char *why, size_t size);

#endif
