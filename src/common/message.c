/* SPDX-License-Identifier: MIT
 * message.c - lines on standard error; see message.h.
 */
#include "common/message.h"

#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>

#include "common/translate.h"

#define LINE_MAX_BYTES 1024
#define WAIT_MS        200 /* for a reader of standard error; a line that nobody takes must not hold the program up */

static bool m_is_patient;
static char *m_kept; /* NULL: nobody wants it */
static size_t m_kept_size;

void print_message_keep(char *buffer, size_t size)
{
    m_kept = buffer;
    m_kept_size = size;
}

void print_message_wait(void)
{
    m_is_patient = true;
}

int print_message(int code, const char *format, ...)
{
    char line[LINE_MAX_BYTES];
    const int prefix = snprintf(line, sizeof line, "heaved: ");
    va_list arguments;
    va_start(arguments, format);
    int length = prefix + vsnprintf(&line[prefix], sizeof line - (size_t)prefix - 1, translate(format), arguments);
    va_end(arguments);
    if (length > LINE_MAX_BYTES - 2) {
        length = LINE_MAX_BYTES - 2;
    }
    if (m_kept != NULL) { /* in English, whatever this terminal has: others translate it for who reads it */
        va_start(arguments, format);
        (void)vsnprintf(m_kept, m_kept_size, format, arguments);
        va_end(arguments);
    }
    line[length] = '\n';
    struct pollfd wait = {.fd = STDERR_FILENO, .events = POLLOUT};
    if (m_is_patient || poll(&wait, 1, WAIT_MS) > 0) {
        (void)!write(STDERR_FILENO, line, (size_t)length + 1); /* nobody is left to tell */
    }
    return code;
}
