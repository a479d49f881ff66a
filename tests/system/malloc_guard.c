/* SPDX-License-Identifier: MIT
 * malloc_guard.c - preloaded into a program: ends it where it allocates after its start, and counts the page faults of its motion
 * thread.
 *
 * A program's start ends with mlockall, whether that is granted or not: from then on no thread may allocate. A thread that asks
 * for a real-time priority may not from there on, and may not free either. The first allocation is a line on standard error with
 * the calls that led to it, and abort(). HEAVE_GUARD_REPORT is the number of a file (a memfd) to keep a report_t in, for whoever
 * started the program: it is there also when the program was killed. The thread that counts is the one that sleeps to absolute
 * times with a real-time priority.
 */
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#define CALLS_MAX 24

/** Read by tests/system/harness.py. */
typedef struct {
    uint64_t cycles;      /**< of the motion thread, under guard */
    uint64_t page_faults; /**< of the motion thread, in those */
    uint64_t is_locked;   /**< 1: mlockall has worked */
    uint64_t refused;     /**< allocations that ended the program */
} report_t;

/* glibc's own, behind the names interposed here. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *memory);

/* -std=c99 hides these in stdlib.h. */
void *aligned_alloc(size_t alignment, size_t size);
void *memalign(size_t alignment, size_t size);
int posix_memalign(void **memory, size_t alignment, size_t size);

static report_t g_own;
static report_t *g_report = &g_own;
static bool g_is_armed;
static bool g_has_own_faults; /**< User Mode Linux: see harness.py */
static __thread bool t_is_realtime __attribute__((tls_model("initial-exec")));
static __thread bool t_has_faults __attribute__((tls_model("initial-exec")));
static __thread uint64_t t_first_faults __attribute__((tls_model("initial-exec")));
static int (*g_mlockall)(int flags);
static int (*g_setschedparam)(pthread_t thread, int policy, const struct sched_param *parameters);
static int (*g_nanosleep)(clockid_t clock, int flags, const struct timespec *time, struct timespec *left);

/* A pointer to data is not one to a function in C99. */
static void find(void *function, const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(function, &found, sizeof found);
}

static __attribute__((constructor)) void start(void)
{
    void *calls[CALLS_MAX];
    const char *report = getenv("HEAVE_GUARD_REPORT");
    find(&g_mlockall, "mlockall");
    find(&g_setschedparam, "pthread_setschedparam");
    find(&g_nanosleep, "clock_nanosleep");
    g_has_own_faults = getenv("HEAVE_OWN_KERNEL") != NULL;
    (void)backtrace(calls, CALLS_MAX); /* the first one allocates */
    if (report != NULL) {
        const int fd = (int)strtol(report, NULL, 10);
        void *memory = mmap(NULL, sizeof *g_report, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        if (memory != MAP_FAILED) {
            g_report = memory;
            g_report->cycles = 0; /* the page is there from now on */
        }
        (void)close(fd);
    }
}

static bool is_over(void)
{
    return __atomic_load_n(&g_is_armed, __ATOMIC_ACQUIRE) || t_is_realtime;
}

static void refuse(const char *what, size_t size)
{
    char name[16] = "";
    char line[160];
    void *calls[CALLS_MAX];
    g_report->refused++;
    (void)pthread_getname_np(pthread_self(), name, sizeof name);
    const int length = snprintf(line, sizeof line, "malloc guard: %s, %zu bytes, after the start, in %s thread (%s):\n", what,
                                size, t_is_realtime ? "a real-time" : "an ordinary", name);
    (void)!write(STDERR_FILENO, line, (size_t)length);
    backtrace_symbols_fd(calls, backtrace(calls, CALLS_MAX), STDERR_FILENO);
    abort();
}

static void judge(const char *what, size_t size)
{
    if (is_over()) {
        refuse(what, size);
    }
}

/* --- What allocates --- */

void *malloc(size_t size)
{
    judge("malloc", size);
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    judge("calloc", count * size);
    return __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size)
{
    judge("realloc", size);
    return __libc_realloc(memory, size);
}

void *memalign(size_t alignment, size_t size)
{
    judge("memalign", size);
    return __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    judge("aligned_alloc", size);
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    judge("posix_memalign", size);
    *memory = __libc_memalign(alignment, size);
    return *memory != NULL ? 0 : ENOMEM;
}

void free(void *memory)
{
    if (memory != NULL && t_is_realtime) {
        refuse("free", 0);
    }
    __libc_free(memory);
}

/* --- Where the start ends, and what is counted then --- */

int mlockall(int flags)
{
    const int result = g_mlockall(flags);
    g_report->is_locked = result == 0;
    __atomic_store_n(&g_is_armed, true, __ATOMIC_RELEASE);
    return result;
}

int pthread_setschedparam(pthread_t thread, int policy, const struct sched_param *parameters)
{
    t_is_realtime = t_is_realtime || (pthread_equal(thread, pthread_self()) && policy == SCHED_FIFO);
    return g_setschedparam(thread, policy, parameters);
}

static void count_cycle(void)
{
    struct rusage used;
    g_report->cycles++;
    if (!g_has_own_faults && getrusage(RUSAGE_THREAD, &used) == 0) {
        const uint64_t faults = (uint64_t)used.ru_minflt + (uint64_t)used.ru_majflt;
        t_first_faults = t_has_faults ? t_first_faults : faults;
        t_has_faults = true;
        g_report->page_faults = faults - t_first_faults;
    }
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time, struct timespec *left)
{
    if (t_is_realtime && flags == TIMER_ABSTIME && __atomic_load_n(&g_is_armed, __ATOMIC_ACQUIRE)) {
        count_cycle();
    }
    return g_nanosleep(clock, flags, time, left);
}
