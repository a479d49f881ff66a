/* SPDX-License-Identifier: MIT
 * malloc_guard.c - preloaded into a program: tells of every allocation made while a file exists.
 * The file's name is in HEAVE_MALLOC_GUARD. Telling is one line on standard error; the allocation then goes on as usual.
 */
#include <errno.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* glibc's own, behind the names interposed here. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

static void tell(const char *what)
{
    const int error = errno;
    const char *armed = getenv("HEAVE_MALLOC_GUARD");
    if (armed != NULL && access(armed, F_OK) == 0) {
        static const char k_text[] = "malloc guard: ";
        (void)!write(STDERR_FILENO, k_text, sizeof k_text - 1);
        (void)!write(STDERR_FILENO, what, strlen(what));
    }
    errno = error;
}

/* -std=c99 hides these two in stdlib.h. */
void *aligned_alloc(size_t alignment, size_t size);
int posix_memalign(void **memory, size_t alignment, size_t size);

void *malloc(size_t size)
{
    tell("malloc\n");
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    tell("calloc\n");
    return __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size)
{
    tell("realloc\n");
    return __libc_realloc(memory, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    tell("aligned_alloc\n");
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    tell("posix_memalign\n");
    *memory = __libc_memalign(alignment, size);
    return *memory != NULL ? 0 : ENOMEM;
}
