/* SPDX-License-Identifier: MIT
 * motion_loop.c - the motion thread; see motion_loop.h.
 */
#include "daemon/motion_loop.h"

#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>

#include "daemon/motion_notes.h"
#include "daemon/motion_objects.h"
#include "heave/quick_stop.h"
#include "heave/text.h"
#include "service/operator_requests.h"

#define PRIORITY           80 /* above threaded interrupts, which have 50 */
#define STACK_BYTES        (512u * 1024u)
#define STACK_TOUCH        (128u * 1024u)
#define PAGE_BYTES         4096u
#define REQUESTS_PER_CYCLE 4u
#define QUIT_MOST_US       100000u                         /* for drives to take their last word */
#define QUIT_STOP_US       (QUICK_STOP_MOST_US + 1000000u) /* where that is another one at the end of their stop */
#define KERNEL_ASKED_US    100000u

hv_status_t motion_loop_init(motion_loop_t *self, const config_t *config, hal_udp_t udp, hal_log_t log, hal_clock_t clock)
{
    self->clock = clock;
    self->late_hold_cycles = config->late_hold_cycles;
    self->allow = config->udp.allow;
    self->rise_percent = MOTION_RISE_PERCENT_MAX;
    handover_init(&self->handover);
    self->tap = (udp_recorder_t){
        .behind = udp,
        .allow = &self->allow,
        .record = {self->is_recording ? &self->handover.record : NULL, self->blackbox != NULL ? &self->blackbox->records : NULL},
        .now_us = &self->session.now_us,
        .clock = clock,
        .cycle_us = config->settings.cycle_us};
    self->io = (gateway_io_t){.udp = udp_recorder_hal(&self->tap), .log = log};
    const hv_status_t status = devices_open(&self->devices, config, &self->io);
    if (status != HV_OK) {
        return status;
    }
    const bool has_channels = config->inputs.estop2_line.text[0] != '\0';
    switches_init(&self->switches, self->io.inputs, has_channels ? config->inputs.estop_discrepancy_ms * 1000 : 0);
    self->io.inputs = switches_hal(&self->switches);
    return session_init(&self->session, &config->settings, &self->io);
}

/* --- Hand-overs --- */

static void apply_reloads(motion_loop_t *self)
{
    motion_reload_t reload;
    while (ring_pop(&self->handover.reloads, &reload, sizeof reload) > 0) {
        motion_note(self, RECORD_RELOAD, 0);
        session_reload(&self->session, &reload.settings);
        self->allow = reload.allow;
        self->late_hold_cycles = reload.late_hold_cycles;
    }
}

/* --- The operator: requests, switches --- */

/* What was refused has changed nothing: a recording does without. */
static service_answer_t serve(motion_loop_t *self, const motion_request_t *request)
{
    service_request_t service = request->service;
    const bool is_proof = service_is_held(service.verb) || service.verb == SERVICE_BEAT;
    service.age_us = is_proof ? gateway_tick_age(&self->session.gateway, request->tick_us) : 0;
    const service_answer_t answer = gateway_service(&self->session.gateway, &service, self->session.now_us);
    if (answer == SERVICE_DONE) {
        motion_note_service(self, &service);
    }
    return answer;
}

static hv_status_t hold(motion_loop_t *self)
{
    self->current.view.held_tick_us = gateway_tick_age(&self->session.gateway, 0);
    self->current.view.hold_late_cycles = 0;
    if (!delayed_end_hold(&self->end)) {
        return HV_ERR_STATE;
    }
    motion_note(self, RECORD_REQUEST, EVENT_HOLD);
    return gateway_request(&self->session.gateway, EVENT_HOLD, self->session.now_us);
}

static hv_status_t ask(motion_loop_t *self, event_t event)
{
    if (event == EVENT_HOLD) {
        return hold(self);
    }
    motion_note(self, RECORD_REQUEST, event);
    self->current.view.is_shutting_down |= event == EVENT_SHUTDOWN;
    self->end.is_asked |= event == EVENT_SHUTDOWN;
    return gateway_request(&self->session.gateway, event, self->session.now_us);
}

static hv_status_t set_intensity(motion_loop_t *self, uint32_t percent)
{
    motion_note(self, RECORD_INTENSITY, percent);
    return gateway_set_intensity(&self->session.gateway, percent);
}

/* What lacks a permit is not asked, nor recorded: a replay knows of no permits, and would carry it out. Nor is what would end in
 * a fault because drives are not there yet. */
static void carry_out(motion_loop_t *self, const motion_request_t *request, motion_result_t *result)
{
    if (request->event == OPERATOR_SERVICE) {
        result->answer = serve(self, request);
        result->status = HV_OK;
    } else if (request->event == OPERATOR_OBJECT) {
        motion_objects_accept(self, request, result);
    } else if (request->event == OPERATOR_INTENSITY) {
        result->status = set_intensity(self, request->number);
    } else {
        const event_t event = (event_t)request->event;
        result->missing = gateway_missing(&self->session.gateway, event);
        result->absent = gateway_absent(&self->session.gateway, event);
        result->status = result->missing != 0 || result->absent != 0 ? HV_ERR_STATE : ask(self, event);
    }
}

/* By what has been asked so far: the service thread knows an earlier one. */
static bool is_raising(const motion_loop_t *self, const motion_request_t *request)
{
    return request->event == OPERATOR_INTENSITY && request->number > motion_intensity(&self->session.gateway.motion)->percent;
}

/* Who asked for a motion long ago may have given up, and turned to something else. */
static bool is_old(const motion_loop_t *self, const motion_request_t *request)
{
    if (!request->has_age && !is_raising(self, request)) {
        return false;
    }
    const uint64_t now_us = hal_clock_now_us(self->clock);
    const uint64_t since_us = now_us > request->since_us ? now_us - request->since_us : 0;
    return since_us >= REQUEST_FRESH_US ||
           (request->has_heard && gateway_tick_age(&self->session.gateway, request->heard_us) >= REQUEST_FRESH_US);
}

/* Who asked for it did not know of the last hold. Where the client does not say what it has heard, the service thread has judged,
 * but for a hold that it did not know of itself. */
static bool is_void(const motion_loop_t *self, const motion_request_t *request)
{
    const motion_view_t *view = &self->current.view;
    const bool is_press = request->event == OPERATOR_SERVICE && service_is_held(request->service.verb);
    const bool is_unaware = request->own_holds != view->own_holds ||
                            (request->has_heard && request->heard_us < view->held_tick_us) ||
                            (is_press && request->tick_us < view->held_tick_us);
    return is_unaware && (request->is_voidable || is_raising(self, request));
}

/* Requests that wait, in order, before the cycle. Returns how many; their results are complete after the cycle. */
static unsigned pop_requests(motion_loop_t *self, motion_result_t result[REQUESTS_PER_CYCLE])
{
    unsigned count = 0;
    motion_request_t request;
    for (; count < REQUESTS_PER_CYCLE && ring_pop(&self->handover.requests, &request, sizeof request) > 0; count++) {
        result[count].id = request.id;
        result[count].is_later = false;
        result[count].missing = result[count].absent = 0;
        result[count].is_old = is_old(self, &request);
        result[count].is_void = is_void(self, &request);
        result[count].status = HV_ERR_STATE;
        if (!result[count].is_old && !result[count].is_void) {
            carry_out(self, &request, &result[count]);
        }
    }
    return count;
}

static void step_end(motion_loop_t *self)
{
    const bool is_due = __atomic_exchange_n(&self->handover.is_end_due, 0, __ATOMIC_ACQ_REL) != 0;
    const snapshot_t *s = gateway_snapshot(&self->session.gateway);
    const bool is_held = s->state == STATE_HOLD && s->interrupted != STATE_HOMING;
    if (delayed_end_step(&self->end, is_due, is_held, self->session.now_us)) {
        (void)!ask(self, EVENT_SHUTDOWN);
    }
    self->current.view.is_end_held = delayed_end_is_held(&self->end);
}

static void log_blind(motion_loop_t *self)
{
    const bool is_blind = switches_is_lost(&self->switches);
    if (is_blind != self->was_blind) {
        hal_log_write(self->io.log, is_blind ? HAL_LOG_ERROR : HAL_LOG_NOTICE,
                      is_blind ? "inputs: cannot be read, which counts as an e-stop" : "inputs: read again");
    }
    self->was_blind = is_blind;
}

/* --- What is withheld --- */

/* A line of the log about what happens by itself, with what follows from it. */
static void log_loss(motion_loop_t *self, hal_log_level_t level, const char *what, event_t response)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, what);
    text_put(&text, response == EVENT_PARK ? ": parking" : response == EVENT_SERVICE_OFF ? ": service ends" : "");
    hal_log_write(self->io.log, level, line);
}

static void log_late(motion_loop_t *self, uint32_t cycles)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put_u32(&text, cycles);
    text_put(&text, " cycles late: holding ([platform] late_hold_cycles)");
    hal_log_write(self->io.log, HAL_LOG_ERROR, line);
}

static void log_losses(motion_loop_t *self, switches_change_t change, event_t response)
{
    if ((change.off & INPUT_ENABLE) != 0) {
        log_loss(self, HAL_LOG_NOTICE, "the enable key was turned off", response);
    }
    if ((change.on & INPUT_POWER) != 0) {
        const bool is_held = response == EVENTS && gateway_snapshot(&self->session.gateway)->state == STATE_HOLD;
        log_loss(self, HAL_LOG_ERROR,
                 is_held ? "the supply is failing: on hold, park settles the platform" : "the supply is failing", response);
    }
    if ((change.off & INPUT_POWER) != 0) {
        hal_log_write(self->io.log, HAL_LOG_NOTICE, "the supply is back");
    }
}

/* Cycles that are late count where the drives have had no set-points for so long that going on as if nothing had happened would
 * be a guess. */
static void withhold_permits(motion_loop_t *self, switches_change_t change, uint32_t late_cycles)
{
    const bool is_too_late = self->late_hold_cycles != 0 && late_cycles > self->late_hold_cycles;
    const uint32_t permits =
        __atomic_load_n(&self->handover.withheld, __ATOMIC_ACQUIRE) | (switches_is_key_off(&self->switches) ? PERMIT_KEY : 0u) |
        (switches_is_power_failing(&self->switches) ? PERMIT_SUPPLY : 0u) | (is_too_late ? PERMIT_PUNCTUAL : 0u);
    const event_t response = gateway_withhold(&self->session.gateway, permits);
    log_losses(self, change, response);
    if (response == EVENT_HOLD) {
        log_late(self, late_cycles);
        self->current.view.own_holds++;
    }
    if (response != EVENTS) {
        (void)!ask(self, response);
        self->current.view.hold_late_cycles = response == EVENT_HOLD ? late_cycles : self->current.view.hold_late_cycles;
    }
}

/* Other than a permit it changes a motion, so a recording has it. */
static void set_rise_percent(motion_loop_t *self)
{
    const uint32_t percent = handover_rise_percent(&self->handover);
    if (percent != self->rise_percent) {
        self->rise_percent = percent;
        motion_note(self, RECORD_RISE, percent);
        (void)!gateway_set_rise_percent(&self->session.gateway, percent);
    }
}

static void press_reset(motion_loop_t *self)
{
    hal_log_write(self->io.log, HAL_LOG_NOTICE, "the reset button was pressed");
    if (ask(self, EVENT_RESET) != HV_OK) {
        hal_log_write(self->io.log, HAL_LOG_WARNING, "reset refused: the e-stop is still active, or there is nothing to reset");
    }
}

static void answer_requests(motion_loop_t *self, motion_result_t *result, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        if (result[i].is_later) {
            continue;
        }
        result[i].snapshot = *gateway_snapshot(&self->session.gateway);
        result[i].is_shutting_down = self->current.view.is_shutting_down;
        (void)ring_push(&self->handover.results, &result[i], sizeof result[i], NULL, 0);
    }
}

/* The bus' reason, in the words of its backend, which only this thread may read. */
static void note_bus(motion_view_t *view, devices_t *devices)
{
    (void)snprintf(view->bus_trouble, sizeof view->bus_trouble, "%s", devices_trouble(devices));
    if (view->bus_trouble[0] != '\0') {
        memcpy(view->bus_last_trouble, view->bus_trouble, sizeof view->bus_last_trouble);
    }
}

/* The kernel is asked for its counts ten times a second, not in each cycle: each question is a system call. */
static bool is_kernel_asked(const motion_loop_t *self, uint64_t phase_us)
{
    return (self->session.now_us + phase_us) % KERNEL_ASKED_US < self->session.settings.cycle_us;
}

/* Page faults of this thread, once it is known whether there should be any. */
static void note_page_faults(motion_loop_t *self, motion_view_t *view)
{
    struct rusage used;
    const uint32_t memory = __atomic_load_n(&self->handover.memory, __ATOMIC_ACQUIRE);
    const bool is_due = !self->has_first_faults || is_kernel_asked(self, 0);
    if (memory == MOTION_MEMORY_UNKNOWN || !is_due || getrusage(RUSAGE_THREAD, &used) != 0) {
        return;
    }
    const uint32_t faults = (uint32_t)used.ru_minflt + (uint32_t)used.ru_majflt;
    if (!self->has_first_faults) {
        self->has_first_faults = true;
        self->first_faults = faults;
    }
    view->is_memory_locked = memory == MOTION_MEMORY_LOCKED;
    view->page_faults = faults - self->first_faults;
}

static void publish(motion_loop_t *self)
{
    motion_view_t *view = &self->current.view;
    view->snapshot = *gateway_snapshot(&self->session.gateway);
    view->udp_refused = self->tap.refused;
    view->udp_stale = self->tap.stale;
    if (is_kernel_asked(self, KERNEL_ASKED_US / 2)) {
        (void)!hal_udp_dropped(self->tap.behind, &view->udp_dropped);
    }
    note_bus(view, &self->devices);
    note_page_faults(self, view);
    seqlock_write(&self->handover.view, self->current.word);
}

/* --- The thread --- */

/* How long a frame took to the drives. Measured beside the motion: nothing depends on it. */
static void note_latency(motion_loop_t *self)
{
    const snapshot_t *snapshot = gateway_snapshot(&self->session.gateway);
    const bool is_followed = snapshot->state == STATE_ENGAGED && snapshot->last_frame_us == snapshot->now_us;
    if (!is_followed || self->tap.arrival_us == 0) {
        return;
    }
    const uint64_t now_us = hal_clock_now_us(self->clock);
    if (self->tap.arrival_us <= now_us) {
        histogram_add(&self->handover.times.frame, now_us - self->tap.arrival_us);
    }
}

static void run_cycle(motion_loop_t *self, uint64_t late_us)
{
    motion_result_t result[REQUESTS_PER_CYCLE];
    const uint32_t skipped = (uint32_t)(late_us / self->session.settings.cycle_us);
    if (skipped > 0) {
        motion_note(self, RECORD_LATE, skipped);
        gateway_note_late(&self->session.gateway, skipped);
    }
    apply_reloads(self);
    const switches_change_t change = switches_step(&self->switches, self->session.now_us);
    log_blind(self);
    withhold_permits(self, change, skipped);
    set_rise_percent(self);
    if ((change.on & INPUT_RESET) != 0) {
        press_reset(self);
    }
    const unsigned requests = pop_requests(self, result);
    step_end(self);
    self->tap.arrival_us = 0;
    self->tap.late_us = late_us;
    const bool is_zero = session_cycle(&self->session);
    note_latency(self);
    motion_write_down(self, is_zero);
    publish(self);
    samples_writer_add(&self->samples, gateway_snapshot(&self->session.gateway), late_us, self->work_us);
    answer_requests(self, result, requests);
    motion_objects_step(self);
}

/* One cycle of the drives alone, with the set-points of the last one. */
static void run_drives(motion_loop_t *self)
{
    const snapshot_t *s = gateway_snapshot(&self->session.gateway);
    q32_t setpoint_q32[DRIVES_MAX] = {0};
    drive_feedback_t feedback[DRIVES_MAX];
    self->is_energized = false;
    memcpy(setpoint_q32, s->extension_mm_q32, s->cylinders * sizeof setpoint_q32[0]);
    setpoint_q32[s->cylinders] = s->angle_deg_q32;
    (void)!drives_poll(self->io.drives, self->session.now_us, feedback);
    (void)!drives_send(self->io.drives, self->session.now_us, setpoint_q32);
    for (unsigned i = 0; i < drives_count(self->io.drives); i++) {
        self->is_energized |= feedback[i].is_energized;
    }
    self->session.now_us += self->session.settings.cycle_us;
}

/* All drives stop now by their own ramps. What tells them may need some cycles: room on the bus, a SYNC behind it, a second try.
 * Late cycles are skipped: polls one right after the other would take a bus that had no time to answer for lost. */
static void quit(motion_loop_t *self, uint64_t now_us)
{
    const uint64_t last_us = now_us + QUIT_STOP_US;
    uint64_t until_us = now_us + QUIT_MOST_US;
    hv_status_t status = drives_request(self->io.drives, DRIVES_QUICK_STOP);
    run_drives(self);
    while (self->is_energized && now_us < until_us) {
        status = status == HV_ERR_AGAIN ? drives_request(self->io.drives, DRIVES_QUICK_STOP) : status;
        (void)!hal_clock_sleep_until_us(self->clock, now_us + self->session.settings.cycle_us);
        now_us = hal_clock_now_us(self->clock);
        run_drives(self);
        if (drives_is_stopping(self->io.drives) && now_us < last_us) {
            until_us = now_us + QUIT_MOST_US;
        }
    }
}

/* Cycle after cycle until the end; deadlines are absolute, so that nothing adds up. */
static void run(motion_loop_t *self)
{
    const uint64_t cycle_us = self->session.settings.cycle_us;
    uint64_t deadline_us = hal_clock_now_us(self->clock) + cycle_us;
    while (!gateway_is_finished(&self->session.gateway)) {
        if (hal_clock_sleep_until_us(self->clock, deadline_us) != HV_OK) {
            (void)!drives_request(self->io.drives, DRIVES_QUICK_STOP);
            self->has_lost_clock = true;
            break;
        }
        const uint64_t now_us = hal_clock_now_us(self->clock);
        const uint64_t late_us = now_us > deadline_us ? now_us - deadline_us : 0;
        if (__atomic_load_n(&self->handover.is_quit, __ATOMIC_ACQUIRE) != 0) {
            quit(self, now_us);
            break;
        }
        run_cycle(self, late_us);
        histogram_add(&self->handover.times.wake, late_us);
        self->work_us = hal_clock_now_us(self->clock) - now_us;
        histogram_add(&self->handover.times.work, self->work_us);
        deadline_us += cycle_us * (1 + late_us / cycle_us);
    }
}

/* Pages of the stack are there before the first cycle needs them. */
static __attribute__((noinline)) void touch_stack(void)
{
    volatile uint8_t page[STACK_TOUCH];
    for (size_t i = 0; i < sizeof page; i += PAGE_BYTES) {
        page[i] = 0;
    }
}

static void ask_for_priority(motion_loop_t *self)
{
    const struct sched_param parameters = {.sched_priority = PRIORITY};
    const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
    self->current.view.is_realtime = error == 0;
    if (error != 0) {
        hal_log_write(self->io.log, HAL_LOG_NOTICE,
                      "no real-time priority (SCHED_FIFO is not permitted): cycles may be late on a busy machine");
    }
}

static void *motion_thread(void *argument)
{
    motion_loop_t *self = argument;
    touch_stack();
    ask_for_priority(self);
    run(self);
    __atomic_store_n(&self->handover.is_ended, 1, __ATOMIC_RELEASE);
    return NULL;
}

bool motion_loop_start(motion_loop_t *self)
{
    pthread_attr_t attributes;
    (void)pthread_attr_init(&attributes);
    (void)pthread_attr_setstacksize(&attributes, STACK_BYTES);
    const int error = pthread_create(&self->thread, &attributes, motion_thread, self);
    (void)pthread_attr_destroy(&attributes);
    errno = error;
    return error == 0;
}

bool motion_loop_reload(motion_loop_t *self, const config_t *config)
{
    const motion_reload_t reload = {config->settings, config->udp.allow, config->late_hold_cycles};
    return ring_push(&self->handover.reloads, &reload, sizeof reload, NULL, 0);
}

void motion_loop_memory(motion_loop_t *self, motion_memory_t memory)
{
    __atomic_store_n(&self->handover.memory, (uint32_t)memory, __ATOMIC_RELEASE);
}

void motion_loop_quit(motion_loop_t *self)
{
    __atomic_store_n(&self->handover.is_quit, 1, __ATOMIC_RELEASE);
}

bool motion_loop_has_ended(const motion_loop_t *self)
{
    return __atomic_load_n(&self->handover.is_ended, __ATOMIC_ACQUIRE) != 0;
}
