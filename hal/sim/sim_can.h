/* SPDX-License-Identifier: MIT
 * sim_can.h - a CAN bus in memory: several controllers, arbitration, acknowledgement, finite speed, and a fault plan.
 * Frames move in sim_can_bus_step() only. The caller owns bus and controllers; all of one bus belong to one thread.
 */
#ifndef SIM_CAN_H
#define SIM_CAN_H

#include "heave/hal/can.h"

#define SIM_CAN_NODES_MAX   16u /**< controllers on one bus */
#define SIM_CAN_TX_FRAMES   16u /**< send queue of a controller */
#define SIM_CAN_RX_FRAMES   64u /**< receive queue of a controller */
#define SIM_CAN_FILTERS_MAX 104u

/** What goes wrong with a frame. */
typedef enum {
    SIM_CAN_DROP,      /**< acknowledged, but no other controller takes it in */
    SIM_CAN_DUPLICATE, /**< received twice */
    SIM_CAN_DELAY,     /**< leaves delay_us later than it could, frames behind it wait */
    SIM_CAN_BUS_OFF,   /**< its controller goes bus-off instead of sending it */
    SIM_CAN_FULL       /**< send returns HV_ERR_AGAIN */
} sim_can_fault_kind_t;

/** One entry of a plan. */
typedef struct {
    sim_can_fault_kind_t kind;
    uint32_t at;       /**< number of the send call on this bus, from 1 */
    uint32_t delay_us; /**< SIM_CAN_DELAY only */
} sim_can_fault_t;

/** A frame that waits to be sent; private. */
typedef struct {
    can_frame_t frame;
    uint64_t ready_us;
    uint8_t copies; /**< how often the others receive it */
    bool is_fatal;  /**< sends its controller bus-off */
} sim_can_tx_t;

/** A received frame; private. */
typedef struct {
    can_frame_t frame;
    uint64_t time_us;
} sim_can_rx_t;

/** A bus; private but for the counters. */
typedef struct {
    struct sim_can *node[SIM_CAN_NODES_MAX];
    uint32_t nodes;
    const sim_can_fault_t *plan;
    uint32_t planned;
    uint32_t frame_us;
    uint64_t now_us;
    uint64_t free_us; /**< the wire is busy until then */
    uint32_t sends;   /**< send calls so far, whatever their result */
    uint32_t frames;  /**< frames that went over the wire */
} sim_can_bus_t;

/** A controller; private but for lost and room. */
typedef struct sim_can {
    sim_can_bus_t *bus;
    hal_can_filter_t filter[SIM_CAN_FILTERS_MAX];
    uint32_t filters;
    sim_can_tx_t tx[SIM_CAN_TX_FRAMES];
    uint32_t tx_first;
    uint32_t tx_count;
    sim_can_rx_t rx[SIM_CAN_RX_FRAMES];
    uint32_t rx_first;
    uint32_t rx_count;
    uint32_t room; /**< frames that the send queue takes, [1, SIM_CAN_TX_FRAMES]; after sim_can_open() all of them */
    uint32_t lost; /**< received frames for which there was no room */
    bool is_overrun;
    bool is_plugged;
    hal_can_state_t state;
} sim_can_t;

/** Starts without controllers.
 *  @param frame_us time of one frame on the wire; 0 = at once
 *  @param plan     kept, entries in any order; NULL where planned is 0 */
void sim_can_bus_init(sim_can_bus_t *self, uint32_t frame_us, const sim_can_fault_t *plan, uint32_t planned);

/** Lets the wire work until now_us: of the frames that wait, the lowest identifier goes first. A frame leaves only where
 *  another controller is there to acknowledge it. */
void sim_can_bus_step(sim_can_bus_t *self, uint64_t now_us);

/** Puts a controller on the bus.
 *  @param filter copied; filters 0 = everything passes
 *  @return HV_OK; HV_ERR_FULL: no place on the bus; HV_ERR_ARG: too many filters. */
hv_status_t sim_can_open(sim_can_t *self, sim_can_bus_t *bus, const hal_can_filter_t *filter, uint32_t filters) HV_MUST_CHECK;

/** Takes the controller off its bus. */
void sim_can_close(sim_can_t *self);

/** Pulls the adapter out, or plugs it in again: then it stays down until restart. */
void sim_can_unplug(sim_can_t *self);
void sim_can_plug(sim_can_t *self);

/** The controller's errors as if the wire were bad: its state changes and is reported. Not for HAL_CAN_DOWN and
 *  HAL_CAN_GONE. */
void sim_can_set_state(sim_can_t *self, hal_can_state_t state);

/** A report of the controller beside those of its own: CAN_ERROR_*. */
void sim_can_report(sim_can_t *self, uint32_t error);

/** The controller as hal/can.h wants it. */
hal_can_t sim_can_hal(sim_can_t *self);

#endif
