/* SPDX-License-Identifier: MIT
 * blackbox_kept.c - what the black box keeps in memory; see blackbox_kept.h.
 */
#include "record/blackbox_kept.h"

#include <string.h>

#define AFTER_US 2000000u /* of what a fault leads to: every stop has ended by then */

static uint64_t time_of(const blackbox_lane_t *lane, const blackbox_item_t *item)
{
    uint64_t t_us = 0;
    memcpy(&t_us, (const uint8_t *)item + lane->time_at, sizeof t_us);
    return t_us;
}

static void lose_until(blackbox_lane_t *lane, uint64_t t_us)
{
    lane->lost_until_us = t_us > lane->lost_until_us ? t_us : lane->lost_until_us;
}

/* The newest item in, and as many of the oldest ones out as that takes; what an incident still has to be written from stays. */
static void keep(blackbox_t *self, blackbox_lane_t *lane, size_t length)
{
    while (!ring_push(&lane->kept, &self->item, length, NULL, 0)) {
        const bool is_needed = lane->is_reading && lane->reader.taken == lane->kept.taken;
        if (is_needed || ring_pop(&lane->kept, &self->oldest, sizeof self->oldest) == 0) {
            lose_until(lane, time_of(lane, &self->item));
            return;
        }
        lose_until(lane, time_of(lane, &self->oldest));
    }
}

/* What was not handed over was so before this row came. */
static void end_gap(blackbox_lane_t *lane, const blackbox_row_t *row)
{
    if (lane->is_gap) {
        lane->is_gap = false;
        lose_until(lane, row->now_us);
    }
}

/* Looks at a row on its way in: the time, and whether an incident has begun. */
static void watch(blackbox_t *self, const blackbox_row_t *row)
{
    end_gap(&self->records, row);
    end_gap(&self->rows, row);
    const bool is_latched = row->row.state == STATE_FAULT || row->row.state == STATE_ESTOP;
    self->newest_us = row->now_us;
    if (is_latched && row->row.state != self->last_state && self->due_us == 0) {
        self->cause = *row;
        self->due_us = row->now_us + AFTER_US;
    }
    self->last_state = row->row.state;
}

static void pop_rows(blackbox_t *self)
{
    size_t length = ring_pop(self->rows.from, &self->item, sizeof self->item);
    for (; length > 0; length = ring_pop(self->rows.from, &self->item, sizeof self->item)) {
        watch(self, &self->item.row);
        keep(self, &self->rows, length);
    }
}

static void pop_records(blackbox_t *self)
{
    size_t length = ring_pop(self->records.from, &self->item, sizeof self->item);
    for (; length > 0; length = ring_pop(self->records.from, &self->item, sizeof self->item)) {
        if (self->item.record.head.kind == RECORD_ZERO) {
            self->zero_us = self->item.record.head.t_us;
        } else if (self->item.record.head.kind == RECORD_RELOAD) {
            self->reloaded_us = self->item.record.head.t_us;
        }
        keep(self, &self->records, length);
    }
}

static void pop_states(blackbox_t *self)
{
    size_t length = ring_pop(self->states.from, &self->item, sizeof self->item);
    for (; length > 0; length = ring_pop(self->states.from, &self->item, sizeof self->item)) {
        keep(self, &self->states, length);
    }
}

/* What the motion thread could not hand over. When that was, the first row tells that comes after all those that had come by
 * the time of this count. */
static void note_drops(blackbox_lane_t *lane, uint32_t dropped)
{
    lane->is_gap = lane->is_gap || dropped != lane->dropped;
    lane->dropped = dropped;
}

void blackbox_pop(blackbox_t *self)
{
    pop_rows(self);
    pop_records(self);
    const uint32_t records = ring_dropped(self->records.from);
    const uint32_t rows = ring_dropped(self->rows.from);
    pop_rows(self);
    note_drops(&self->records, records);
    note_drops(&self->rows, rows);
    pop_states(self);
}
