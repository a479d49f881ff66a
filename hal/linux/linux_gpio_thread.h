/* SPDX-License-Identifier: MIT
 * linux_gpio_thread.h - the threads that talk to GPIO chips: started, woken and ended the same way. Below the motion thread,
 * above what is not real time. A call of the kernel that hangs hangs only them.
 */
#ifndef LINUX_GPIO_THREAD_H
#define LINUX_GPIO_THREAD_H

#include <poll.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

/** Starts a thread, deaf to signals, which are the program's.
 *  @param wake  out: a descriptor that becomes readable when it is woken; reading it never blocks
 *  @return 0 or an error number */
int linux_gpio_thread_start(pthread_t *thread, int *wake, void *(*function)(void *), void *argument);

/** Called by the thread: real-time priority where that is permitted. */
void linux_gpio_thread_ask_for_priority(void);

/** Called by the thread: as poll(2). Where the system refuses to wait, a millisecond passes all the same, so that nothing spins
 * at that priority.
 *  @return how many are ready; -1: refused, and whether one is ready is not known */
int linux_gpio_thread_wait(struct pollfd *fds, unsigned count, int ms);

/** Wakes it. Never blocks. */
void linux_gpio_thread_wake(int wake);

/** Wakes it and waits for its end.
 *  @return false: it hangs, and what it uses must not be given back */
bool linux_gpio_thread_end(pthread_t thread, int wake);

/** Monotonic time. */
uint64_t linux_gpio_thread_now_us(void);

#endif
