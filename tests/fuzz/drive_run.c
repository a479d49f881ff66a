/* SPDX-License-Identifier: MIT
 * drive_run.c - what the fuzz targets of drivers share; see drive_run.h.
 */
#include "drive_run.h"

#define CYCLES_MAX 10000u

record_t record_read(fuzz_input_t *in)
{
    record_t record = {.op = fuzz_u8(in), .kind = fuzz_u8(in), .drive = fuzz_u8(in), .length = fuzz_u8(in)};
    for (unsigned i = 0; i < sizeof record.data; i++) {
        record.data[i] = fuzz_u8(in);
    }
    record.drive %= DRIVES_MAX;
    record.length %= 9;
    return record;
}

bool drive_run_are_all(const drive_run_t *self, drive_state_t state)
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        if (self->feedback[k].state != state) {
            return false;
        }
    }
    return true;
}

void drive_run_follow_actual(drive_run_t *self)
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        self->setpoint_q32[k] = self->feedback[k].actual_mm_q32;
    }
}

void drive_run_await(drive_run_t *self, drive_state_t state, void (*cycle)(void *world), void *world)
{
    for (unsigned i = 0; i < CYCLES_MAX && !drive_run_are_all(self, state); i++) {
        cycle(world);
        drive_run_follow_actual(self);
    }
    FUZZ_REQUIRE(drive_run_are_all(self, state));
}

/* The contract: from now on nobody follows. */
static void stop_all(drive_run_t *self)
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        drive_state_t *state = &self->feedback[k].state;
        *state = *state == DRIVE_FAULT || *state == DRIVE_OFFLINE ? *state : DRIVE_DISABLED;
    }
}

hv_status_t drive_run_ask(drive_run_t *self, const record_t *record)
{
    const drives_request_t request = (drives_request_t)(record->kind % (DRIVES_RESET_FAULT + 1u));
    const hv_status_t status = drives_request(self->drives, request);
    if (record->data[0] % 2 != 0) {
        drive_run_follow_actual(self);
    }
    if (status == HV_OK && (request == DRIVES_DISABLE || request == DRIVES_QUICK_STOP)) {
        stop_all(self);
    }
    return status;
}

void drive_run_move(drive_run_t *self, const record_t *record)
{
    const int32_t way = (int32_t)((uint32_t)record->data[0] | (uint32_t)record->data[1] << 8 | (uint32_t)record->data[2] << 16);
    self->setpoint_q32[record->drive] += (record->kind % 2 != 0 ? 1 : -1) * ((q32_t)way << (record->kind / 2 % 24));
}

bool drive_run_is_beyond(q32_t a_q32, q32_t b_q32, q32_t limit_q32)
{
    return a_q32 > b_q32 ? a_q32 - b_q32 > limit_q32 : b_q32 - a_q32 > limit_q32;
}

__extension__ typedef __int128 wide_t;

int64_t drive_run_counts(q32_t mm_q32, int64_t per_3_mm, int64_t zero)
{
    const wide_t one = (wide_t)3 * Q32_ONE;
    const wide_t limit = (wide_t)1 << 60;
    const wide_t scaled = (wide_t)mm_q32 * per_3_mm;
    const wide_t counts = scaled / one - (scaled % one < 0) + zero;
    return (int64_t)(counts > limit ? limit : counts < -limit ? -limit : counts);
}
