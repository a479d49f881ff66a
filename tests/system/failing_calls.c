/* SPDX-License-Identifier: MIT
 * failing_calls.c - preloaded into a program: makes single calls of it fail as the system would, while it runs.
 *
 * A call is known by the address that it returns to, so that one place in the sources can fail and all others work; calls that
 * libraries make themselves always work. What is to fail stands in a page of memory shared with test_syscalls.py (HEAVE_FAILURES:
 * the number of a memfd), which also hears of every place that was reached. What this library exports is what can be made to
 * fail.
 */
#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define NAME_SIZE  48
#define PLACES_MAX 64
#define SEEN_MAX   1900

#define STREAM_ERROR 0x20 /* _IO_ERR_SEEN of glibc */

/** Read and written by test_syscalls.py. All places are offsets in the program. */
typedef struct {
    uint64_t left;              /**< so many calls will fail; written last */
    uint64_t failed;            /**< so many have */
    uint64_t error;             /**< errno */
    uint64_t places;            /**< of this function */
    char name[NAME_SIZE];       /**< the function */
    uint64_t place[PLACES_MAX]; /**< where it returns to */
    uint64_t seen_count;
    uint64_t seen[SEEN_MAX]; /**< where any function has returned to */
} page_t;

typedef long call_t(long a, long b, long c, long d, long e, long f);

/** How a function says that it has failed. */
typedef enum {
    SAYS_MINUS,  /**< -1, errno */
    SAYS_NULL,   /**< NULL, errno */
    SAYS_NUMBER, /**< the error's number */
    SAYS_EOF     /**< EOF, errno, but has done it: what it gives back is gone */
} says_t;

static page_t *g_page;
static uintptr_t g_base;

/* The first one is the program. */
static int find_base(struct dl_phdr_info *info, size_t size, void *to)
{
    (void)size;
    *(uintptr_t *)to = info->dlpi_addr;
    return 1;
}

static __attribute__((constructor)) void start(void)
{
    const char *given = getenv("HEAVE_FAILURES");
    if (given != NULL) {
        const int fd = (int)strtol(given, NULL, 10);
        void *memory = mmap(NULL, sizeof *g_page, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        (void)dl_iterate_phdr(find_base, &g_base);
        (void)unsetenv("HEAVE_FAILURES"); /* what it runs has other places at the same addresses */
        g_page = memory != MAP_FAILED ? memory : NULL;
    }
}

static bool is_in(const uint64_t *list, uint64_t count, uint64_t place)
{
    for (uint64_t i = 0; i < count; i++) {
        if (list[i] == place) {
            return true;
        }
    }
    return false;
}

static void note(uint64_t place)
{
    const uint64_t count = __atomic_load_n(&g_page->seen_count, __ATOMIC_ACQUIRE);
    if (!is_in(g_page->seen, count < SEEN_MAX ? count : SEEN_MAX, place)) {
        const uint64_t at = __atomic_fetch_add(&g_page->seen_count, 1, __ATOMIC_ACQ_REL);
        if (at < SEEN_MAX) {
            g_page->seen[at] = place;
        }
    }
}

/* Whether this call is to fail; then its error. */
static int error_of(const char *name, const void *back)
{
    if (g_page == NULL) {
        return 0;
    }
    const uint64_t place = (uint64_t)((uintptr_t)back - g_base);
    note(place);
    uint64_t left = __atomic_load_n(&g_page->left, __ATOMIC_ACQUIRE);
    if (left == 0 || strcmp(g_page->name, name) != 0 || !is_in(g_page->place, g_page->places, place)) {
        return 0;
    }
    do {
        if (left == 0) {
            return 0;
        }
    } while (!__atomic_compare_exchange_n(&g_page->left, &left, left - 1, false, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE));
    const int error = (int)g_page->error;
    (void)__atomic_fetch_add(&g_page->failed, 1, __ATOMIC_ACQ_REL);
    return error;
}

static long fail(says_t says, int error)
{
    errno = error;
    return says == SAYS_NULL ? 0 : says == SAYS_NUMBER ? error : -1;
}

/* A pointer to data is not one to a function in C99. */
static call_t *find(const char *name)
{
    call_t *found;
    void *data = dlsym(RTLD_NEXT, name);
    memcpy(&found, &data, sizeof found);
    return found;
}

/* Arguments and results of all these are integers and pointers, at most six: they pass through as they are. */
#define CALL(name, says)                                                                                                         \
    long failing_##name(long a, long b, long c, long d, long e, long f) __asm__(#name);                                          \
    long failing_##name(long a, long b, long c, long d, long e, long f)                                                          \
    {                                                                                                                            \
        static call_t *real;                                                                                                     \
        real = real != NULL ? real : find(#name);                                                                                \
        const int kept = errno;                                                                                                  \
        const int error = error_of(#name, __builtin_return_address(0));                                                          \
        if (error != 0 && (says) == SAYS_EOF) {                                                                                  \
            (void)real(a, b, c, d, e, f);                                                                                        \
        }                                                                                                                        \
        errno = kept;                                                                                                            \
        return error != 0 ? fail(says, error) : real(a, b, c, d, e, f);                                                          \
    }

CALL(accept4, SAYS_MINUS)
CALL(access, SAYS_MINUS)
CALL(bind, SAYS_MINUS)
CALL(chmod, SAYS_MINUS)
CALL(clock_nanosleep, SAYS_NUMBER)
CALL(connect, SAYS_MINUS)
CALL(dup3, SAYS_MINUS)
CALL(eventfd, SAYS_MINUS)
CALL(execv, SAYS_MINUS)
CALL(fchmod, SAYS_MINUS)
CALL(fcntl, SAYS_MINUS)
CALL(fclose, SAYS_EOF)
CALL(fdatasync, SAYS_MINUS)
CALL(fdopen, SAYS_NULL)
CALL(fflush, SAYS_EOF)
CALL(fmemopen, SAYS_NULL)
CALL(fopen, SAYS_NULL)
CALL(fork, SAYS_MINUS)
CALL(memfd_create, SAYS_MINUS)
CALL(mmap, SAYS_MINUS)
CALL(fstat, SAYS_MINUS)
CALL(fsync, SAYS_MINUS)
CALL(ftruncate, SAYS_MINUS)
CALL(getaddrinfo, SAYS_NUMBER)
CALL(getrlimit, SAYS_MINUS)
CALL(getgrnam, SAYS_NULL)
CALL(getrusage, SAYS_MINUS)
CALL(getsockname, SAYS_MINUS)
CALL(getsockopt, SAYS_MINUS)
CALL(ioctl, SAYS_MINUS)
CALL(link, SAYS_MINUS)
CALL(if_nametoindex, SAYS_NULL)
CALL(listen, SAYS_MINUS)
CALL(lstat, SAYS_MINUS)
CALL(mkdir, SAYS_MINUS)
CALL(mlockall, SAYS_MINUS)
CALL(open, SAYS_MINUS)
CALL(open_memstream, SAYS_NULL)
CALL(opendir, SAYS_NULL)
CALL(poll, SAYS_MINUS)
CALL(ppoll, SAYS_MINUS)
CALL(prctl, SAYS_MINUS)
CALL(pread, SAYS_MINUS)
CALL(pwrite, SAYS_MINUS)
CALL(pthread_create, SAYS_NUMBER)
CALL(pthread_setschedparam, SAYS_NUMBER)
CALL(pthread_timedjoin_np, SAYS_NUMBER)
CALL(read, SAYS_MINUS)
CALL(readdir, SAYS_NULL)
CALL(readlink, SAYS_MINUS)
CALL(realpath, SAYS_NULL)
CALL(recv, SAYS_MINUS)
CALL(recvmmsg, SAYS_MINUS)
CALL(recvmsg, SAYS_MINUS)
CALL(rename, SAYS_MINUS)
CALL(rmdir, SAYS_MINUS)
CALL(scandir, SAYS_MINUS)
CALL(sched_setscheduler, SAYS_MINUS)
CALL(send, SAYS_MINUS)
CALL(sendmsg, SAYS_MINUS)
CALL(sendto, SAYS_MINUS)
CALL(setrlimit, SAYS_MINUS)
CALL(setsockopt, SAYS_MINUS)
CALL(signalfd, SAYS_MINUS)
CALL(sigprocmask, SAYS_MINUS)
CALL(socket, SAYS_MINUS)
CALL(stat, SAYS_MINUS)
CALL(symlink, SAYS_MINUS)
CALL(tcflush, SAYS_MINUS)
CALL(adjtimex, SAYS_MINUS)
CALL(uname, SAYS_MINUS)
CALL(unlink, SAYS_MINUS)
CALL(waitpid, SAYS_MINUS)
CALL(write, SAYS_MINUS)

/* A stream that could not be read says so afterwards too. */
#define READING(name, stream)                                                                                                    \
    long failing_##name(long a, long b, long c, long d) __asm__(#name);                                                          \
    long failing_##name(long a, long b, long c, long d)                                                                          \
    {                                                                                                                            \
        static call_t *real;                                                                                                     \
        real = real != NULL ? real : find(#name);                                                                                \
        const int kept = errno;                                                                                                  \
        const int error = error_of(#name, __builtin_return_address(0));                                                          \
        errno = kept;                                                                                                            \
        if (error != 0) {                                                                                                        \
            ((FILE *)(stream))->_flags |= STREAM_ERROR;                                                                          \
        }                                                                                                                        \
        return error != 0 ? fail(SAYS_NULL, error) : real(a, b, c, d, 0, 0);                                                     \
    }

READING(fgets, c)
READING(fread, d)

/* libgpiod, libmnl and libmodbus: their calls are the system calls of hal/linux */
CALL(gpiod_chip_get_line, SAYS_NULL)
CALL(gpiod_chip_open, SAYS_NULL)
CALL(gpiod_line_event_get_fd, SAYS_MINUS)
CALL(gpiod_line_event_read_multiple, SAYS_MINUS)
CALL(gpiod_line_get_value_bulk, SAYS_MINUS)
CALL(gpiod_line_request_bulk, SAYS_MINUS)
CALL(gpiod_line_set_value_bulk, SAYS_MINUS)
CALL(mnl_socket_bind, SAYS_MINUS)
CALL(mnl_socket_open2, SAYS_NULL)
CALL(mnl_socket_recvfrom, SAYS_MINUS)
CALL(mnl_socket_sendto, SAYS_MINUS)
CALL(modbus_connect, SAYS_MINUS)
CALL(modbus_flush, SAYS_MINUS)
CALL(modbus_new_rtu, SAYS_NULL)
CALL(modbus_new_tcp, SAYS_NULL)
CALL(modbus_read_bits, SAYS_MINUS)
CALL(modbus_read_input_bits, SAYS_MINUS)
CALL(modbus_read_input_registers, SAYS_MINUS)
CALL(modbus_read_registers, SAYS_MINUS)
CALL(modbus_rtu_set_rts, SAYS_MINUS)
CALL(modbus_rtu_set_serial_mode, SAYS_MINUS)
CALL(modbus_send_raw_request, SAYS_MINUS)
CALL(modbus_write_bit, SAYS_MINUS)
CALL(modbus_write_bits, SAYS_MINUS)
CALL(modbus_write_register, SAYS_MINUS)
CALL(modbus_write_registers, SAYS_MINUS)

/* dlsym allocates: these are known without it. */
#define ALLOCATION(name)                                                                                                         \
    long __libc_##name(long a, long b, long c, long d, long e, long f);                                                          \
    long failing_##name(long a, long b, long c, long d, long e, long f) __asm__(#name);                                          \
    long failing_##name(long a, long b, long c, long d, long e, long f)                                                          \
    {                                                                                                                            \
        const int error = error_of(#name, __builtin_return_address(0));                                                          \
        return error != 0 ? fail(SAYS_NULL, error) : __libc_##name(a, b, c, d, e, f);                                            \
    }

ALLOCATION(calloc)
ALLOCATION(malloc)
ALLOCATION(realloc)
