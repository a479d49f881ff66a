/* SPDX-License-Identifier: MIT
 * status.h - the one result type of every function that can fail, and the assertion for programmer errors.
 * Zero is success, negatives are errors; positive values stay free for counts. Device codes are never returned this way.
 */
#ifndef HEAVE_STATUS_H
#define HEAVE_STATUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** Result of an operation; each function documents which of these it returns. */
typedef enum {
    HV_OK = 0,
    HV_ERR_ARG = -1,     /**< the caller broke the contract */
    HV_ERR_RANGE = -2,   /**< a value outside its documented range */
    HV_ERR_FORMAT = -3,  /**< malformed wire data */
    HV_ERR_AGAIN = -4,   /**< nothing consumed or produced; try next cycle */
    HV_ERR_TIMEOUT = -5, /**< the deadline passed */
    HV_ERR_FULL = -6,    /**< the queue is full, nothing was taken */
    HV_ERR_STATE = -7,   /**< not allowed in this state */
    HV_ERR_IO = -8,      /**< the backend failed; its context keeps the detail */
    HV_ERR_NOSUP = -9    /**< an optional operation that is absent */
} hv_status_t;

#if defined(__GNUC__)
#define HV_MUST_CHECK __attribute__((warn_unused_result))
#else
#define HV_MUST_CHECK
#endif

/** Marks a function whose unsigned arithmetic is modulo 2^N on purpose (counters that wrap, two's complement by hand): clang's
 * check for unsigned overflow, which all other code of the core passes, leaves it out. */
#if defined(__clang__)
#define HV_WRAPS __attribute__((no_sanitize("unsigned-integer-overflow")))
#else
#define HV_WRAPS
#endif

/** A condition that is rarely true: the compiler keeps the other path short. */
#if defined(__GNUC__)
#define HV_RARELY(condition) (__builtin_expect((condition), 0) != 0)
#else
#define HV_RARELY(condition) (condition)
#endif

/** A function that is rarely called. It is not inlined, so that callers need not save registers for it. */
#if defined(__GNUC__)
#define HV_OUT_OF_LINE __attribute__((noinline))
#else
#define HV_OUT_OF_LINE
#endif

/** A processor on which long products are function calls: inner loops are not flattened there. */
#if defined(__ARM_ARCH_ISA_THUMB) && __ARM_ARCH_ISA_THUMB == 1
#define HV_LONG_PRODUCTS_ARE_CALLS
#endif

/** An inner loop: everything that the function calls is inlined, also when optimising for size. */
#if defined(__GNUC__) && !defined(HV_LONG_PRODUCTS_ARE_CALLS)
#define HV_INNER_LOOP __attribute__((flatten))
#else
#define HV_INNER_LOOP
#endif

/** A function that is not inlined when optimising for size, so that its variables use the stack only while it runs. */
#if defined(__GNUC__) && defined(__OPTIMIZE_SIZE__)
#define HV_OWN_FRAME __attribute__((noinline))
#else
#define HV_OWN_FRAME
#endif

/** Called when an HV_ASSERT fails: supplied by the program (hosted: print and abort; firmware: fail silent). Never returns. */
void hv_assert_failed(const char *file, int line);

/** For programmer errors only. Errors that input can cause are an hv_status_t. */
#define HV_ASSERT(condition) ((condition) ? (void)0 : hv_assert_failed(__FILE__, __LINE__))

#endif
