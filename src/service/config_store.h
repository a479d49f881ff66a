/* SPDX-License-Identifier: MIT
 * config_store.h - keeps the text of the configuration in force, for clients that edit it, and stores a configuration that was
 * applied over the control socket.
 *
 * heaved never writes the file that it was started with. It keeps an applied configuration in its state directory. The last
 * line of this copy holds a digest of the file's text. Once somebody has edited the file, the digest does not match, and the
 * file is used again. A thread of its own reads and writes; the service thread hands over and never waits. Nothing is allocated
 * after config_store_open().
 */
#ifndef HEAVE_SERVICE_CONFIG_STORE_H
#define HEAVE_SERVICE_CONFIG_STORE_H

#include "common/worker.h"
#include "config/config.h"

#define CONFIG_STORE_NAME       "configuration.ini" /* in the state directory */
#define CONFIG_STORE_OLDER      5u                  /* older ones are kept as .1 (the newest of them) to .5 */
#define CONFIG_STORE_DIGEST_MAX 17u                 /* digits of a digest, with its NUL */
#define CONFIG_STORE_FOOT_MAX   96u
#define CONFIG_STORE_TEXT_MAX   (CONFIG_FILE_MAX - CONFIG_STORE_FOOT_MAX) /* the kept file is no longer than any other */
#define CONFIG_STORE_WHY_MAX    240u

/** The store. Others may read the first group of members; the rest is private to config_store.c. */
typedef struct {
    const char *file;                     /**< the file that heaved was started with */
    char kept[CONFIG_PATH_MAX];           /**< path of an applied configuration; "": it cannot be kept */
    bool is_applied;                      /**< the configuration in force is the applied one */
    int fd;                               /**< sealed text in force, for readers; -1: none yet */
    size_t length;                        /**< of the text in force */
    char digest[CONFIG_STORE_DIGEST_MAX]; /**< of the text in force; "": it came from a pipe, and readers cannot get it */
    const char *no_restart;               /**< why heaved must not restart by itself; NULL: it may */
    char put_back[CONFIG_STORE_WHY_MAX];  /**< set by the owner: why the applied configuration could not be started and was
                                             replaced by the one before; "" once another one is in force */

    char file_digest[CONFIG_STORE_DIGEST_MAX];            /**< of the file whose text, or over which one, is in force */
    char read_digest[CONFIG_STORE_DIGEST_MAX];            /**< of the file as it was read again; "": it was not */
    char text[CONFIG_TEXT_BYTES + CONFIG_STORE_FOOT_MAX]; /**< being read, or written */
    size_t text_length;
    const char *path;    /**< of what was read; NULL: it cannot be put into force again from there */
    ssize_t read_length; /**< -errno: it cannot be read */
    uint32_t phase;      /**< atomic */
    int32_t error;       /**< of the write */
    worker_t worker;
} config_store_t;

/** Chooses between the file and the configuration that was applied over it.
 *  @param kept out: path of an applied configuration; "": it cannot be kept
 *  @return the path to load from: file or kept */
const char *config_store_choose(const char *file, char kept[CONFIG_PATH_MAX]);

/** Replaces the configuration applied last by the one before it, or by the file. The replaced one stays as .failed.
 *  @param kept as config_store_choose() named it
 *  @return false: errno says why, and nothing has changed */
bool config_store_put_back(const char *kept);

/** Opens the store, once, with the path that the configuration was loaded from. */
void config_store_open(config_store_t *self, const char *file, const char *loaded);
bool config_store_start(config_store_t *self);

/** @return false: a write still waits for the disk, and self has to stay */
bool config_store_close(config_store_t *self);

/** Starts to choose and read again, for a reload. The store may not be busy, and is until config_store_has_read(). */
void config_store_read(config_store_t *self);

/** Returns what was read, once.
 *  @param path out: of the text, for config_store_adopt(); NULL: it came from a pipe, or cannot be read
 *  @param text,length out: valid until the next call; length as config_reload() takes it
 *  @return false: no reading has ended */
bool config_store_has_read(config_store_t *self, const char **path, const char **text, ssize_t *length);

/** Puts the text that was last read or written into force.
 *  @param path as config_store_has_read() returned it; for a written text `kept` */
void config_store_adopt(config_store_t *self, const char *path);

/** Takes the text of a client, if it can be read without waiting, cannot change any more, and has 1 to CONFIG_STORE_TEXT_MAX
 * bytes.
 *  @param fd a sealed memfd
 *  @return NULL, or a text that says what is wrong */
const char *config_store_accept(config_store_t *self, int fd, const char **text, size_t *length);

/** Starts to write the text that was taken. The store may not be busy, and is until config_store_done(). */
void config_store_write(config_store_t *self);

/** True from config_store_read() or config_store_write() until their result has been taken: nothing else may be taken, read or
 *  written meanwhile. */
bool config_store_is_busy(const config_store_t *self);

/** Returns the result of a write, once. The text comes into force by config_store_adopt().
 *  @param error out: errno; 0: the text is on the disk; ESTALE: nothing was written, as the file is another one than that in
 * force
 *  @return false: no write has ended */
bool config_store_done(config_store_t *self, int *error, const char **text, size_t *length);

#endif
