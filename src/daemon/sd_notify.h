/* SPDX-License-Identifier: MIT
 * sd_notify.h - what heaved tells the service manager that started it (the protocol of sd_notify): that it is ready, what it is
 * doing, that its motion thread still runs, that it is about to end. Without a manager all of it does nothing. The service thread
 * calls it; nothing blocks, also where the manager does not read (libsystemd's own call would wait), nothing allocates.
 */
#ifndef HEAVE_DAEMON_SD_NOTIFY_H
#define HEAVE_DAEMON_SD_NOTIFY_H

#include <sys/socket.h>
#include <sys/un.h>

#include "heave/settings.h"
#include "heave/telemetry.h"

/** What was told last. */
typedef struct {
    uint64_t watchdog_us; /**< how often the manager wants to hear of it, halved; 0 = it does not */
    uint64_t next_us;
    uint64_t cycle;     /**< of the motion thread, when told last */
    uint64_t unsent_us; /**< how long the shutdown may take, not told yet; 0 = told, or there is none */
    bool is_ready_sent;
    bool is_sent;
    state_t state;
    fault_code_t fault;
    int fd; /**< -1 = there is no manager; private, as the address */
    socklen_t address_bytes;
    struct sockaddr_un address;
} sd_notify_t;

/** After everything has been opened and the first cycle has run. What the manager does not take is told again by sd_notify_serve.
 */
void sd_notify_ready(sd_notify_t *self, uint64_t now_us);

/** Often: tells changes of state, and pets the watchdog if the motion thread has run a cycle since the last time. */
void sd_notify_serve(sd_notify_t *self, const snapshot_t *snapshot, uint64_t now_us);

/** The longest that a shutdown takes: a stop, the longest cylinder's whole stroke at engage speed, and the drives going off. */
uint64_t sd_notify_shutdown_us(const settings_t *settings);

/** Once, when a shutdown has been asked for. What the manager does not take is told again by sd_notify_serve.
 *  @param within_us above 0, the longest that it takes: the manager waits as long, also where its unit says less */
void sd_notify_stopping(sd_notify_t *self, uint64_t within_us);

/** heaved starts anew in the same process: the watchdog has patience meanwhile.
 *  @param is_over it has started; after sd_notify_ready() */
void sd_notify_restart(const sd_notify_t *self, bool is_over);

/** Once, at the end. */
void sd_notify_close(sd_notify_t *self);

#endif
