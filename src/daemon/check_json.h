/* SPDX-License-Identifier: MIT
 * check_json.h - `--check --json`: for programs that let people edit a configuration.
 */
#ifndef HEAVE_DAEMON_CHECK_JSON_H
#define HEAVE_DAEMON_CHECK_JSON_H

/** Loads a file and writes a JSON object to standard output: `ok`, `errors[]` with `line` and `text`; where it is right, `hash`,
 *  `report` as of --check, and `geometry` as of the request of that name.
 *  @return an exit code: as of --check */
int check_json(const char *path);

#endif
