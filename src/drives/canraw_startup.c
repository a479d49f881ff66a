/* SPDX-License-Identifier: MIT
 * canraw_startup.c - the frames that start a drive up; see canraw_startup.h.
 */
#include "canraw_startup.h"

#define ANSWER_US  500000u  /* after a step that has one */
#define AGAIN_US   1000000u /* between attempts */
#define TALKING_US 5000000u /* of a drive that says something, but not where it is */

bool canraw_startup_is_over(const canraw_axis_t *self, const canraw_map_t *map)
{
    return self->step >= CANRAW_STEPS_MAX || map->step[self->step].frame.length == 0;
}

static void start_again(canraw_axis_t *self, uint64_t at_us)
{
    self->step = 0;
    self->is_step_sent = false;
    self->step_us = at_us;
}

static void end_step(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    self->step_us = now_us + map->step[self->step].wait_us;
    self->is_step_sent = false;
    self->step++;
    self->failed_step = canraw_startup_is_over(self, map) ? 0 : self->failed_step;
}

/* Of this length: a reply that begins in the same way may be longer. */
static bool is_answer(const canraw_frame_t *answer, const can_frame_t *frame)
{
    return frame->length == answer->length && canraw_matches(answer, frame->data, frame->length);
}

bool canraw_startup_is_mixed(const canraw_step_t *step, const canraw_frame_t *reply)
{
    return reply->length <= step->answer.length && canraw_is_ambiguous(&step->answer, reply);
}

/* Anything from a drive that was silent: whatever it was sent meanwhile it may not have heard.
 * Returns true for the answer to a step. */
bool canraw_startup_receive(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, const can_frame_t *frame,
                            uint64_t now_us)
{
    const bool is_awaited = self->is_step_sent && frame->id == axis->reply_id;
    if (is_awaited && is_answer(&map->step[self->step].answer, frame)) {
        self->is_talking = true;
        end_step(self, map, now_us);
        return true;
    }
    if (!self->is_talking) {
        self->is_talking = true;
        start_again(self, now_us);
    }
    return false;
}

const canraw_frame_t *canraw_startup_next(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    if (self->is_step_sent && now_us - self->step_us > ANSWER_US) {
        self->failed_step = (uint8_t)(self->step + 1u);
        start_again(self, now_us + AGAIN_US);
    }
    const uint64_t again_us = self->is_talking ? TALKING_US : AGAIN_US;
    if (canraw_startup_is_over(self, map) && !self->is_online && self->step != 0 && now_us >= self->step_us + again_us) {
        start_again(self, now_us);
    }
    const bool is_due = !self->is_online && !self->is_step_sent && !canraw_startup_is_over(self, map) && now_us >= self->step_us;
    return is_due ? &map->step[self->step].frame : NULL;
}

void canraw_startup_sent(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    self->is_step_sent = map->step[self->step].answer.length != 0;
    self->step_us = now_us;
    if (!self->is_step_sent) {
        end_step(self, map, now_us);
    }
}
