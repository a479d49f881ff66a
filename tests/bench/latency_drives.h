/* SPDX-License-Identifier: MIT
 * latency_drives.h - the drives of bench_latency.c, on Modbus TCP or on CAN, and what they tell of set-points. Times are ns of
 * the wall clock, in which the kernel stamps what it receives: when a thread here gets to look at it is in no figure.
 */
#ifndef LATENCY_DRIVES_H
#define LATENCY_DRIVES_H

#include <stdint.h>
#include <sys/socket.h>

#define DRIVES    6u
#define URGENT    90 /* above heaved: drives and wires of a platform are other machines */
#define STAMP_MAX 64u

/** Ends the program. */
__attribute__((noreturn)) void fail(const char *what);

uint64_t wall_ns(void);

/** Runs the calling thread before others, where that is permitted. Returns 0, or an errno. */
int be_urgent(int priority);

/** Asks for stamps on a socket. */
void ask_for_stamps(int link);

/** When the kernel received what recvmsg() has just returned; now where it does not say. */
uint64_t stamp_of(struct msghdr *message);

/** A drive got a set-point that differs from the one before. */
void note_other(unsigned drive, uint64_t arrived_ns);

/** A SYNC was on the bus. */
void note_sync(uint64_t arrived_ns);

/** Starts drives on loopback and prints their ports. */
void start_modbus(void);

/** Starts CiA 402 drives, nodes 1 to 6, at half their stroke, one count a nanometre. */
void start_can(const char *interface);

#endif
