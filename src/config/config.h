/* SPDX-License-Identifier: MIT
 * config.h - the configuration file of heaved: what it holds, and how it is loaded, reported on and written out.
 * One table (keys.c) gives each key its type, unit, range, default and help; everything here follows from it.
 * Used at start-up and by offline modes only; nothing here is called while the platform moves.
 */
#ifndef HEAVE_CONFIG_CONFIG_H
#define HEAVE_CONFIG_CONFIG_H

#include <stdio.h>
#include <sys/types.h>

#include "heave/canraw.h"
#include "heave/cia402.h"
#include "heave/modbus_drive.h"
#include "heave/settings.h"

#define CONFIG_ADDRESS_MAX 64u  /**< bytes of an address as text, with its NUL */
#define CONFIG_PATH_MAX    108u /**< bytes of a socket path, with its NUL (the size of sun_path) */
#define CONFIG_NAME_MAX    16u  /**< bytes of the name of a network interface, with its NUL (IFNAMSIZ) */
#define CONFIG_RELAYS_MAX  12u
#define CONFIG_LABEL_MAX   32u       /**< bytes of the name of a GPIO line or chip, with its NUL (GPIO_MAX_NAME_SIZE) */
#define CONFIG_NONE        INT32_MIN /**< a number in whose place the file has a word ("none", "settled") */

/** Where frames come in. */
typedef struct {
    char bind[CONFIG_ADDRESS_MAX];  /**< numeric IPv4 or IPv6 address */
    char group[CONFIG_ADDRESS_MAX]; /**< joined: multicast address, % and its network interface; empty: none */
    uint16_t port;
    hal_udp_networks_t allow; /**< who may send; none at all means everyone who reaches the port */
} config_udp_t;

/** What drives the cylinders. */
typedef enum {
    CONFIG_DRIVES_SIM,
    CONFIG_DRIVES_CIA402,
    CONFIG_DRIVES_CAN_RAW,
    CONFIG_DRIVES_MODBUS_TCP,
    CONFIG_DRIVES_MODBUS_RTU
} config_drives_t;

/** Simulated drives. */
typedef struct {
    uint32_t lag_ms;              /**< time constant with which a cylinder follows its set-point */
    uint32_t enable_delay_ms;     /**< from the enable command to enabled */
    q16_t start_extension_mm_q16; /**< of all cylinders; CONFIG_NONE: the settled extension */
    bool is_homed;                /**< the position is known from the start */
} config_sim_t;

/** CAN identifiers: one for each drive, or the first drive's, the others following it; none where count is 0. */
typedef struct {
    uint8_t count;
    uint32_t id[DRIVES_MAX];
} config_ids_t;

/** Nodes are such numbers: the node, and its axis from 0. */
#define CONFIG_CHANNEL_SHIFT 24u
#define CONFIG_NODE_MASK     0xFFFFFFu

/** Indices of words: one, or one for each drive. */
typedef struct {
    uint8_t count;
    uint8_t word[DRIVES_MAX];
} config_words_t;

/** Exact ratios: one, or one for each cylinder; none where count is 0. */
typedef struct {
    uint8_t count;
    int32_t num[CYLINDERS_MAX];
    int32_t den[CYLINDERS_MAX];
} config_ratios_t;

/** Whole numbers: one, or one for each cylinder. */
typedef struct {
    uint8_t count;
    int32_t value[CYLINDERS_MAX];
} config_wholes_t;

/** Joints of the base or of the plate, given by a circle in place of coordinates: see sizes.h. Empty once the joints are filled
 * in. */
typedef struct {
    q16_t radius_mm_q16;  /**< CONFIG_NONE: joints one by one */
    q16_t spread_deg_q16; /**< between the two joints of a pair; CONFIG_NONE: three cylinders */
    q16_t turn_deg_q16;   /**< clockwise, seen from above */
} config_circle_t;

/** Screw and gear between motor and cylinder, given in place of counts_per_mm: see scaling.h. */
typedef struct {
    config_ratios_t lead_mm; /**< travel for one turn of the screw; none once counts_per_mm has been filled in */
    config_ratios_t gear;    /**< turns of the motor for one turn of the screw */
    int32_t counts_per_turn; /**< of the motor; CONFIG_NONE: unknown */
} config_drive_train_t;

/** Width of CAN identifiers. */
typedef enum { CONFIG_ID_11_BITS, CONFIG_ID_29_BITS } config_id_bits_t;

/** When set-points are sent. */
typedef enum { CONFIG_SEND_EVERY_PERIOD, CONFIG_SEND_ON_CHANGE } config_send_t;

/** The CAN bus of the drives. */
typedef struct {
    char interface[CONFIG_NAME_MAX];
    uint32_t bitrate_bps;
    uint32_t passive_stop_ms;
} config_can_t;

/** What follows from something that is watched: as cia402.h and canraw.h have it. */
typedef enum { CONFIG_REACTION_IGNORE, CONFIG_REACTION_REPORT, CONFIG_REACTION_STOP } config_reaction_t;

/** Drives with CAN frames of their own. canraw.h describes the frames. */
typedef struct {
    uint32_t period_us;
    config_id_bits_t id_bits;
    config_ids_t command_id;
    config_ids_t setpoint_id; /**< count 0: command_id */
    config_ids_t reply_id;
    config_ratios_t counts_per_mm;
    config_wholes_t zero_counts;
    config_ratios_t angle_counts_per_deg;
    config_wholes_t angle_zero_counts;
    config_send_t send;
    uint32_t rated_torque;
    uint32_t speed_counts;
    config_ratios_t speed_counts_per_mm_s;
    config_ratios_t angle_speed_counts_per_deg_s;
    canraw_frame_t setpoint;
    canraw_frame_t enable, disable, stop, reset, home;
    canraw_frame_t position_query, position_reply, homing_query, homing_reply;
    canraw_step_t startup[CANRAW_STEPS_MAX];
    config_ids_t status_id; /**< count 0: reply_id */
    canraw_frame_t status_reply;
    uint32_t status_every;
    canraw_when_t enabled_when, fault_when, homing_done_when, homing_failed_when;
    uint32_t query_every;
    uint32_t offline_periods;
    config_reaction_t other_master;
    q16_t following_error_mm_q16;
    q16_t angle_following_error_deg_q16;
} config_can_raw_t;

/** A Modbus server: an IPv4 address as text, and its port. */
typedef struct {
    char address[16];
    uint16_t port;
} config_host_t;

/** One for each drive, or one for all; none where count is 0. */
typedef struct {
    uint8_t count;
    config_host_t host[DRIVES_MAX];
} config_hosts_t;

#define CONFIG_ITEMS_MAX 12u /**< two lists of a map */

/** What registers have to hold. */
typedef struct {
    uint8_t count;
    modbus_drive_item_t item[CONFIG_ITEMS_MAX];
} config_items_t;

/** Which registers are read, how single ones are written, what the characters of a line have. */
typedef enum { CONFIG_READ_HOLDING, CONFIG_READ_INPUT } config_read_t;
typedef enum { CONFIG_WRITE_MULTIPLE, CONFIG_WRITE_SINGLE } config_write_t;
typedef enum { CONFIG_PARITY_NONE, CONFIG_PARITY_EVEN, CONFIG_PARITY_ODD } config_parity_t;

/** Who turns a serial line around; in the order of linux_modbus_direction_t. */
typedef enum { CONFIG_RS485_AUTOMATIC, CONFIG_RS485_KERNEL, CONFIG_RS485_RTS_HIGH, CONFIG_RS485_RTS_LOW } config_rs485_t;

/** Drives on Modbus; what the registers are is in modbus_drive.h. */
typedef struct {
    config_ids_t units;
    uint32_t period_us;
    uint32_t timeout_ms;
    uint32_t turnaround_us;
    uint8_t retries;
    uint32_t feedback_timeout_ms;
    config_read_t read;
    config_write_t write;
    bool is_broadcast;
    bool is_target_last;
    config_ratios_t counts_per_mm;
    config_wholes_t zero_counts;
    config_ratios_t angle_counts_per_deg;
    config_wholes_t angle_zero_counts;
    uint32_t speed_counts;
    config_ratios_t speed_counts_per_mm_s;
    config_ratios_t angle_speed_counts_per_deg_s;
    modbus_drive_blocks_t setpoint, feedback;
    modbus_drive_blocks_t enable, disable, stop, reset, home;
    canraw_when_t enabled_when, fault_when, homing_done_when, homing_failed_when;
    config_items_t startup;
    config_items_t drive_timeout;
    bool is_drive_timeout_confirmed;
    q16_t step_mm_q16;
    q16_t angle_step_deg_q16;
    q16_t following_error_mm_q16;
    q16_t angle_following_error_deg_q16;
} config_modbus_t;

/** Their lines on TCP. */
typedef struct {
    config_hosts_t hosts;
} config_modbus_tcp_t;

/** Their serial line. */
typedef struct {
    char device[CONFIG_PATH_MAX];
    uint32_t baud_bps;
    config_parity_t parity;
    uint8_t stop_bits;
    config_rs485_t rs485;
    uint32_t rs485_delay_us;
} config_modbus_rtu_t;

/** Mode of operation of CANopen drives. */
typedef enum { CONFIG_MODE_CSP, CONFIG_MODE_IP, CONFIG_MODE_PP } config_mode_t;

/** What CANopen drives do when the gateway falls silent: 6007h less 1. */
typedef enum { CONFIG_LOST_FAULT, CONFIG_LOST_DISABLE_VOLTAGE, CONFIG_LOST_QUICK_STOP } config_lost_t;

#define CONFIG_REACTIONS 7u /* to what is watched in what CANopen drives say: in the order of cia402_section.h */

/** How CANopen drives and the gateway watch each other. */
typedef enum { CONFIG_CONTROL_HEARTBEAT, CONFIG_CONTROL_GUARDING } config_error_control_t;

/** In which order CANopen drives home. */
typedef enum { CONFIG_HOMING_TOGETHER, CONFIG_HOMING_IN_TURN } config_homing_order_t;

/** How drives home; unit u is mm or deg. */
typedef struct {
    config_wholes_t method;
    q16_t speed_q16;      /**< u/s, towards the switch */
    q16_t zero_speed_q16; /**< u/s, to the zero */
    q16_t accel_q16;      /**< u/s^2 */
} config_homing_t;

#define CONFIG_STARTUP_MAX (CIA402_ITEMS_MAX / 2u) /**< of a list: a drive gets that of its family and its own */

/** Objects that CANopen drives have to hold, in the order of the file. */
typedef struct {
    uint8_t count;
    cia402_item_t item[CONFIG_STARTUP_MAX];
} config_startup_t;

/** CANopen drives; what it means is in cia402_section.h. */
typedef struct {
    config_ids_t nodes;
    uint8_t gateway_node;
    config_words_t mode; /**< config_mode_t of each */
    uint8_t pdo_step;
    cia402_maps_t command_map;
    cia402_maps_t answer_map;
    bool is_map_written;
    uint32_t period_us;
    config_ratios_t counts_per_mm;
    config_wholes_t zero_counts;
    config_ratios_t angle_counts_per_deg;
    config_wholes_t angle_zero_counts;
    config_homing_t homing;
    config_homing_t angle_homing;
    config_homing_order_t homing_order;
    q16_t following_error_mm_q16;
    q16_t angle_following_error_deg_q16;
    uint16_t following_error_ms;
    q16_t quick_stop_mm_s2_q16;
    q16_t angle_quick_stop_deg_s2_q16;
    config_lost_t when_gateway_lost;
    config_reaction_t reaction[CONFIG_REACTIONS];
    config_error_control_t error_control;
    uint16_t heartbeat_ms;
    uint16_t heartbeat_timeout_ms;
    uint16_t sdo_timeout_ms;
    uint16_t boot_timeout_ms;
    uint16_t power_timeout_ms;
    uint8_t sync_counter;
    bool is_sync_watched;
    bool is_reset_wanted;
    bool is_support_checked;
    uint16_t csp_control_bits;
    uint8_t answer_every;
    bool has_torque_report;
    bool has_lag;
    bool has_inputs;
    uint8_t telemetry_every;
    bool is_no_watchdog_allowed;
    uint16_t rpdo_deadline_ms;
    uint16_t accepted_without; /**< bit N for cia402_guard_t N */
    bool is_stop_confirmed;
    q16_t software_limit_mm_q16;
    uint32_t vendor_id;
    uint32_t product_code;
    uint32_t revision_number;
    config_ids_t serial_numbers;
    config_startup_t startup;                      /**< of all cylinders' drives */
    config_startup_t drive_startup[CYLINDERS_MAX]; /**< of one */
    config_startup_t angle_startup;
} config_cia402_t;

/** The name of a line or of a chip in the file; "" if the file gives none. */
typedef struct {
    char text[CONFIG_LABEL_MAX];
} config_label_t;

/** Outputs. The number of lines is the number of relays. */
typedef struct {
    uint8_t count;
    config_label_t line[CONFIG_RELAYS_MAX];
} config_lines_t;

/** What switches the relays. */
typedef enum { CONFIG_RELAYS_SIM, CONFIG_RELAYS_GPIO, CONFIG_RELAYS_MODBUS } config_relays_driver_t;

/** Relay outputs, relay 1 first. */
typedef struct {
    config_relays_driver_t driver;
    config_label_t chip; /**< of GPIO lines; if empty, any chip that has lines of these names */
    config_lines_t lines;
    bool is_active_low;
} config_relays_t;

/** The relay board on Modbus. It has a line of its own: TCP if a host is given, else serial. */
typedef struct {
    config_hosts_t hosts;       /**< at most one */
    config_modbus_rtu_t serial; /**< device "none": there is none */
    uint32_t unit;
    uint32_t timeout_ms;
} config_relays_modbus_t;

/** The output of the healthy pulse. */
typedef enum { CONFIG_HEALTHY_NONE, CONFIG_HEALTHY_GPIO, CONFIG_HEALTHY_RELAY } config_healthy_driver_t;

/** The line of the healthy pulse. Its relay and its times are in the settings of the core. */
typedef struct {
    config_healthy_driver_t driver;
    config_label_t chip; /**< as of the relays */
    config_label_t line;
    bool is_active_low;
} config_healthy_t;

/** What reads the operator's switches. */
typedef enum { CONFIG_INPUTS_SIM, CONFIG_INPUTS_GPIO } config_inputs_driver_t;

/** Switch inputs. An input whose line has no name does not exist. */
typedef struct {
    config_inputs_driver_t driver;
    config_label_t chip; /**< as of the relays */
    config_label_t estop_line;
    config_label_t enable_line;
    config_label_t reset_line;
    config_label_t estop2_line;
    config_label_t power_line;
    uint32_t estop_discrepancy_ms;
    bool is_active_low; /**< a closed contact pulls its line low */
} config_inputs_t;

/** The black box: how much it keeps, and where it writes incidents. */
typedef struct {
    char directory[CONFIG_PATH_MAX]; /**< "none" = there is none */
    uint32_t seconds;                /**< kept at least, of an ordinary stream */
    uint32_t incidents;              /**< most folders kept in the directory */
} config_black_box_t;

#define CONFIG_HASH_MAX 17u /**< digits of the hash of a configuration, with its NUL */

/** Values of [service] selftest. */
typedef enum { CONFIG_SELFTEST_NONE, CONFIG_SELFTEST_DAILY } config_selftest_when_t;

/** When a self-test is required, and its limits. */
typedef struct {
    config_selftest_when_t when;
    q16_t following_mm_q16; /**< largest difference between set-point and drive while it is jogged */
    q16_t drift_mm_q16;     /**< largest distance that a cylinder may move without torque */
} config_selftest_t;

/** A whole configuration: the settings of the core, and those that only the hosted program needs. Plain data. */
typedef struct {
    settings_t settings;
    config_udp_t udp;
    config_circle_t base, plate;
    bool is_as_measured;                /**< joints that look wrong are intended: see layout.h */
    uint32_t late_hold_cycles;          /**< of the program: see daemon/motion_loop.h */
    char life_file[CONFIG_PATH_MAX];    /**< "none" = none */
    config_label_t approved;            /**< hash of the one that was approved, "" = any */
    char hash[CONFIG_HASH_MAX];         /**< of this one; follows from the rest (hash.h) */
    char machine_hash[CONFIG_HASH_MAX]; /**< of the keys that describe the machine; likewise */
    config_selftest_t selftest;
    char control_socket[CONFIG_PATH_MAX];
    char metrics_file[CONFIG_PATH_MAX]; /**< "none" = none */
    char look_socket[CONFIG_PATH_MAX];  /**< likewise */
    config_label_t operate_group;       /**< "" = none */
    config_label_t service_group;       /**< likewise */
    char operator_log[CONFIG_PATH_MAX]; /**< "none" = none */
    uint32_t operator_log_kb;
    uint32_t operator_log_files;
    config_black_box_t black_box;
    uint32_t samples_seconds; /**< 0 = no samples */
    config_drives_t drives;
    config_drive_train_t drive_train;
    config_sim_t sim;
    config_can_t can;
    config_can_raw_t can_raw;
    config_cia402_t cia402;
    config_modbus_t modbus;
    config_modbus_tcp_t modbus_tcp;
    config_modbus_rtu_t modbus_rtu;
    config_relays_t relays;
    config_relays_modbus_t relays_modbus;
    config_inputs_t inputs;
    config_healthy_t healthy;
} config_t;

#define CONFIG_FILE_MAX   131072u                /**< bytes of a configuration file */
#define CONFIG_TEXT_BYTES (CONFIG_FILE_MAX + 1u) /**< of memory for one; full: it is longer than a configuration may be */

/** The bytes of a file, without waiting for a pipe and without allocating.
 *  @return their number, CONFIG_TEXT_BYTES: it is too long; -1: errno says why */
ssize_t config_read(const char *path, char text[CONFIG_TEXT_BYTES]);

/** Writes every key with its value, unit, range and help, as a file that loads to the same configuration. */
void config_dump(const config_t *self, FILE *out);

/** Writes the table of keys as JSON: for editors (docs/control-socket.md). */
void config_write_keys(FILE *out);

/** Writes a file to fill in, for a kind of platform and a driver.
 *  @return NULL; else the words that are allowed, separated by |, of the first argument that is none of them: nothing is written
 */
const char *config_write_template(const char *kind, const char *driver, FILE *out);

/** Writes the reference of all keys as Markdown. */
void config_write_reference(FILE *out);

/** Writes it as sections of a manual page. */
void config_write_manual(FILE *out);

#endif
