/* SPDX-License-Identifier: MIT
 * doctor_judge.h - what follows from what heaved --doctor has found: facts in, findings out. Touches no device.
 */
#ifndef HEAVE_INSPECT_DOCTOR_JUDGE_H
#define HEAVE_INSPECT_DOCTOR_JUDGE_H

#include "config/config.h"
#include "heave/cia402.h"
#include "inspect/doctor_report.h"
#include "linux_can_link.h"

/** What the machine permits. */
typedef struct {
    unsigned kernel_major;
    unsigned kernel_minor;
    bool is_realtime_allowed;
    bool is_memory_lock_allowed;
    bool is_clock_trusted;  /**< clock_is_trusted() */
    bool is_date_of_matter; /**< a self-test is due each day */
} doctor_host_t;

/** Objects that are read from a CiA 402 drive. */
typedef enum {
    DOCTOR_TYPE,     /**< 1000h */
    DOCTOR_VENDOR,   /**< 1018h */
    DOCTOR_PRODUCT,  /**< */
    DOCTOR_REVISION, /**< */
    DOCTOR_SERIAL,   /**< */
    DOCTOR_SERIAL_2, /**< once more: two drives on one node may take turns */
    DOCTOR_MODES,    /**< 6502h */
    DOCTOR_STATUS,   /**< 6041h */
    DOCTOR_ERROR,    /**< 603Fh */
    DOCTOR_RPDO,     /**< 1400h */
    DOCTOR_RPDO_MAP, /**< 1600h */
    DOCTOR_TPDO,     /**< 1800h */
    DOCTOR_TPDO_MAP, /**< 1A00h */
    DOCTOR_PERIOD_VALUE,
    DOCTOR_PERIOD_EXPONENT,
    DOCTOR_SYNC_PERIOD, /**< 1006h */
    DOCTOR_CONSUMER,    /**< 1016h, the first of the guards */
    DOCTOR_PRODUCER,    /**< 1017h */
    DOCTOR_GUARD_TIME,  /**< 100Ch */
    DOCTOR_LIFE_FACTOR, /**< 100Dh */
    DOCTOR_ABORT_OPTION,
    DOCTOR_QUICK_STOP,
    DOCTOR_FAULT_REACTION,
    DOCTOR_WINDOW,
    DOCTOR_OBJECTS
} doctor_object_t;

/** Where an object is. */
typedef struct {
    uint16_t index;
    uint8_t sub;
} doctor_address_t;

extern const doctor_address_t doctor_address[DOCTOR_OBJECTS];

/** What a drive answered. */
typedef enum { DOCTOR_NO_ANSWER, DOCTOR_REFUSED, DOCTOR_READ } doctor_answer_t;

/** What a drive calls itself; each may be missing. */
typedef enum { DOCTOR_DEVICE, DOCTOR_HARDWARE, DOCTOR_SOFTWARE, DOCTOR_NAMES } doctor_name_t;

#define DOCTOR_NAME_MAX 65u /**< bytes, with the NUL */

extern const uint16_t doctor_name_index[DOCTOR_NAMES];

typedef struct {
    doctor_answer_t answer[DOCTOR_OBJECTS];
    uint32_t value[DOCTOR_OBJECTS];           /**< or the abort code */
    unsigned extra_answers;                   /**< beyond one for each request */
    int nmt;                                  /**< state in its heartbeat, -1 = none heard */
    char name[DOCTOR_NAMES][DOCTOR_NAME_MAX]; /**< as text that prints; "" where it has none */
} doctor_node_t;

/** What became of what was sent. */
typedef struct {
    bool is_heard;          /**< anybody has sent anything */
    uint32_t unconfirmed;   /**< frames of ours that never were on the wire */
    bool is_unacknowledged; /**< the controller says that nobody acknowledges */
    hal_can_state_t state;
    uint8_t tx_errors;
    uint8_t rx_errors;
} doctor_wire_t;

/** The interface.
 *  @return true where the bus can be used */
bool doctor_judge_link(doctor_report_t *report, const config_can_t *config, const linux_can_link_t *link,
                       const doctor_host_t *host);

/** Whether there is anybody at all.
 *  @return true where nobody is, and it has been said: asking single drives would only repeat it */
bool doctor_judge_wire(doctor_report_t *report, const config_can_t *config, const doctor_wire_t *wire);

/** What the machine permits. */
void doctor_judge_host(doctor_report_t *report, const doctor_host_t *host);

/** Keeps what prints of a name that a drive gives. */
void doctor_copy_name(char name[DOCTOR_NAME_MAX], const uint8_t *bytes, size_t length);

/** What drives answered, as lines of [cia402]: identities where all have the same, serial numbers, and a comment for each.
 *  @param node for each drive of the configuration */
void doctor_write_inventory(FILE *out, const cia402_config_t *config, const doctor_node_t node[DRIVES_MAX]);

/** One CiA 402 drive. */
void doctor_judge_node(doctor_report_t *report, const cia402_config_t *config, unsigned axis, const doctor_node_t *node);

#endif
