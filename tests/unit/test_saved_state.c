/* SPDX-License-Identifier: MIT
 * test_saved_state.c - a saved gateway in all kinds of motion: what was saved is taken, in every moment; what no motion has in
 * any of its members is refused. Whoever replays an incident runs a file of somebody else.
 */
#include <math.h>
#include <string.h>

#include "rig.h"
#include "unity.h"

#define EACH 3u /* cycles between two looks */

static rig_t m_rig; /* handles point in here */
static settings_t m_settings;
static gateway_t m_saved, m_spoiled, m_other, m_before;
static unsigned m_taken;

void setUp(void)
{
    m_settings = rig_hexapod();
    m_taken = 0;
}

void tearDown(void) {}

static hv_status_t resume(const gateway_t *saved)
{
    memset(&m_other, 0, sizeof m_other);
    TEST_ASSERT_EQUAL(HV_OK, gateway_init(&m_other, &m_settings, &m_rig.gateway.io));
    m_before = m_other;
    const hv_status_t status = gateway_resume(&m_other, saved, &m_rig.gateway.io);
    if (status != HV_OK) {
        TEST_ASSERT_EQUAL_MEMORY(&m_before, &m_other, sizeof m_other);
    }
    return status;
}

/* Runs on; what is saved now and then is taken. */
static void run_and_save(unsigned ms)
{
    for (unsigned i = 0; i < ms; i++) {
        rig_run_ms(&m_rig, 1);
        if (i % EACH == 0) {
            gateway_save(&m_rig.gateway, &m_saved);
            TEST_ASSERT_EQUAL_MESSAGE(HV_OK, resume(&m_saved), "what a gateway saved");
            m_taken++;
        }
    }
}

static void engage(void)
{
    rig_start(&m_rig, &m_settings, true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
}

/* A ride of poses; step_ms 0: two frames at once, then none for two periods. */
static void ride(unsigned frames, unsigned step_ms, double mm, double hz, const char *format)
{
    double t_s = 0;
    for (unsigned i = 0; i < frames; i++) {
        const unsigned wait_ms = step_ms > 0 ? step_ms : i % 2 == 0 ? 1 : 33;
        const double z = mm * sin(6.283185 * hz * t_s);
        rig_sendf(&m_rig, format, 0.05 * z, 0.03 * z, 0.02 * z, 0.4 * z, 0.3 * z, z);
        run_and_save(wait_ms);
        t_s += step_ms > 0 ? wait_ms / 1000.0 : 0.017;
    }
}

static const char k_fine[] = "@A6:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f#";
static const char k_coarse[] = "@A6:%.1f,%.1f,%.1f,%.0f,%.0f,%.0f#";
static const char k_timed[] = "@A6T:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,100#";
static const char k_move[] = "@A6T:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,1500#";

static void test_streams_of_all_kinds(void)
{
    static const stream_style_t k_styles[] = {STREAM_SMOOTH, STREAM_BALANCED};
    for (unsigned i = 0; i < 2; i++) {
        m_settings.stream_style = k_styles[i];
        engage();
        ride(60, 16, 20, 0.5, k_fine);
        ride(60, 10, 40, 3, k_fine);  /* beyond the limits */
        ride(200, 2, 10, 1, k_fine);  /* thinned out */
        ride(40, 0, 20, 0.5, k_fine); /* in bursts */
        ride(60, 20, 2, 0.3, k_coarse);
        run_and_save(400); /* a pause */
        ride(30, 100, 20, 0.3, k_timed);
        ride(20, 16, 20, 0.5, k_fine);
        run_and_save(3000); /* to rest */
    }
    TEST_ASSERT_GREATER_THAN(5000, m_taken);
}

static void test_moves_steps_and_holds(void)
{
    engage();
    ride(20, 16, 20, 0.5, k_fine);
    ride(3, 700, 40, 0.4, k_move);        /* planned anew in motion */
    rig_send(&m_rig, "@A6:1,2,3,4,5,6#"); /* a step in motion */
    run_and_save(700);
    rig_send(&m_rig, "@A6T:1,2,3,4,5,6,1#"); /* stretched */
    run_and_save(1500);
    rig_send(&m_rig, "@C6:60,65,70,65,60,65#");
    run_and_save(1000);
    ride(30, 16, 20, 0.5, k_fine);
    TEST_ASSERT_EQUAL(HV_OK, motion_set_intensity(&m_rig.gateway.motion, 30));
    ride(60, 16, 20, 0.5, k_fine);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    run_and_save(800);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESUME));
    ride(60, 16, 20, 0.5, k_fine);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    run_and_save(4000);
}

static void test_the_way_up_and_spikes(void)
{
    m_settings.spike_gate = 4;
    rig_start(&m_rig, &m_settings, false);
    run_and_save(1);
    for (unsigned i = 0; i < 20000 && m_rig.gateway.snapshot.state != STATE_ENGAGED; i += 10) {
        run_and_save(10);
    }
    TEST_ASSERT_EQUAL(STATE_ENGAGED, m_rig.gateway.snapshot.state);
    for (unsigned i = 0; i < 20; i++) {
        ride(10, 16, 5, 0.5, k_fine);
        rig_send(&m_rig, "@A6:0,0,0,0,0,60#");
        run_and_save(16);
    }
    TEST_ASSERT_GREATER_THAN(0, spike_filter_spikes(&m_rig.gateway.motion.gate));
}

static void test_three_cylinders(void)
{
    m_settings = rig_tripod();
    engage();
    for (unsigned i = 0; i < 100; i++) {
        rig_sendf(&m_rig, "@A3:%.3f,%.3f,%.3f#", 2 * sin(i * 0.1), 1.5 * sin(i * 0.1), 10 * sin(i * 0.1));
        run_and_save(16);
    }
    rig_send(&m_rig, "@A3T:3,-3,20,900#");
    run_and_save(1500);
}

#define SPOIL(member, value)                                                                                                     \
    do {                                                                                                                         \
        m_spoiled = m_saved;                                                                                                     \
        m_spoiled.motion.member = (value);                                                                                       \
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_ARG, resume(&m_spoiled), #member);                                                      \
    } while (0)

/* The byte of a bool that is none. */
#define SPOIL_BOOL(member)                                                                                                       \
    do {                                                                                                                         \
        m_spoiled = m_saved;                                                                                                     \
        memset(&m_spoiled.motion.member, 2, 1);                                                                                  \
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_ARG, resume(&m_spoiled), #member);                                                      \
    } while (0)

static void test_a_stream_that_no_motion_has_is_refused(void)
{
    engage();
    ride(60, 16, 20, 0.5, k_fine);
    gateway_save(&m_rig.gateway, &m_saved);
    TEST_ASSERT_EQUAL(HV_OK, resume(&m_saved));
    TEST_ASSERT_EQUAL(STREAM_RUNNING, m_saved.motion.stream.phase);
    SPOIL(stream.cycle_us, 999);
    SPOIL(stream.style, STREAM_BALANCED);
    SPOIL(stream.phase, (stream_phase_t)(STREAM_RUNNING + 1));
    SPOIL(stream.thin.gaps_us, UINT32_MAX);
    SPOIL(stream.thin.each, 0);
    SPOIL(stream.thin.each_taken, 0);
    SPOIL(stream.thin.passed, UINT32_MAX);
    SPOIL_BOOL(stream.thin.has_spare);
    SPOIL(stream.thin.spare_q32[6], INT64_MAX);
    SPOIL(stream.thin.last_us, UINT64_MAX);
    SPOIL(stream.repeat.began_us, UINT64_MAX);
    SPOIL(stream.repeat.run, 0);
    SPOIL(stream.repeat.each, 0);
    SPOIL(stream.repeat.frames, UINT32_MAX);
    SPOIL(stream.repeat.span_us, UINT32_MAX);
    SPOIL(stream.repeat.runs, 16);
    SPOIL(stream.repeat.telling, 17);
    SPOIL(stream.repeat.longest, UINT32_MAX);
    SPOIL_BOOL(stream.is_fresh);
    SPOIL_BOOL(stream.is_hidden);
    SPOIL(stream.pair, 0);
    SPOIL(stream.began_us, UINT64_MAX);
    SPOIL(stream.back_us, UINT64_MAX);
    SPOIL(stream.left_q32[5], INT64_MAX);
    SPOIL(stream.sample.misfit_q32, -1);
    SPOIL(stream.sample.losses, STREAM_LOSSES_MAX + 1);
    SPOIL(stream.sample.stood, STREAM_STOOD_MAX + 2);
    SPOIL(stream.sample.moved, STREAM_MOVED_MAX + 1);
    SPOIL(stream.sample.caught, STREAM_CAUGHT_MAX + 1);
    SPOIL(stream.sample.halves, UINT32_MAX);
    SPOIL(stream.sample.doubt_us, UINT32_MAX);
    SPOIL(stream.between_q32, Q32_ONE);
    SPOIL(stream.rate_q32[1], INT64_MAX);
    SPOIL(stream.error_q32, INT64_MIN);
    SPOIL(stream.previous[6].acc_per_cycle2_q32, INT64_MAX);
    SPOIL(stream.clock.last_us, UINT64_MAX);
    SPOIL(stream.clock.late_us_q16, INT64_MIN);
    SPOIL(stream.clock.period_us_q16, 0);
    SPOIL(stream.clock.period_us_q16, 1);
    SPOIL(stream.clock.per_us_q46, 1);
    SPOIL(stream.clock.jitter_us_q16, -1);
    SPOIL(stream.clock.margin_us_q16, INT64_MAX);
    SPOIL(stream.clock.gap_us[3], UINT32_MAX);
    SPOIL(stream.clock.gap_periods[(m_saved.motion.stream.clock.gap_next + STREAM_GAPS - 1) % STREAM_GAPS], 0);
    SPOIL(stream.clock.gap_next, STREAM_GAPS);
    SPOIL(stream.clock.gaps, STREAM_GAPS + 1);
    SPOIL(stream.clock.settled, 1025);
    SPOIL(stream.clock.hint_us, UINT32_MAX);
    SPOIL(stream.clock.delay_max_us, 1);
    SPOIL(stream.clock.memory, 1025);
    SPOIL(stream.clock.drift_us_q16, INT64_MIN);
    SPOIL(stream.clock.rough_us_q16, -1);
    SPOIL(stream.clock.counted, 257);
    SPOIL(stream.clock.lost_q16, INT32_MIN);
    SPOIL(stream.clock.each, 0);
    SPOIL_BOOL(stream.clock.is_sparse);
    SPOIL(stream.clock.stalled, 2);
    SPOIL(stream.evidence.value_q32[4][6], INT64_MAX);
    SPOIL(stream.evidence.late_q32[0], 2 * Q32_ONE);
    SPOIL(stream.evidence.shift_q32[4], -2 * Q32_ONE);
    SPOIL(stream.evidence.index[2], -1);
    SPOIL(stream.evidence.count, STREAM_EVIDENCE + 1);
    SPOIL(stream.evidence.axes, AXES_MAX + 1);
    SPOIL(stream.evidence.told_q32, INT64_MIN);
    SPOIL(stream.evidence.off_q32, -1);
    SPOIL(stream.evidence.moved_q32, -1);
    SPOIL(stream.evidence.weight_q32, Q32_ONE + 1);
}

static void test_a_curve_that_no_motion_has_is_refused(void)
{
    engage();
    ride(60, 16, 20, 0.5, k_fine);
    gateway_save(&m_rig.gateway, &m_saved);
    TEST_ASSERT_EQUAL(HV_OK, resume(&m_saved));
    const stream_curve_t *curve = &m_saved.motion.stream.curve;
    SPOIL(stream.curve.point_q32[63][6], INT64_MIN);
    SPOIL_BOOL(stream.curve.is_sample[63]);
    if (curve->ahead > 0) { /* the curve looks for it */
        SPOIL(stream.curve.is_sample[(curve->head + (unsigned)curve->ahead) % STREAM_POINTS], false);
    }
    SPOIL(stream.curve.control_q32[0], INT64_MAX);
    SPOIL(stream.curve.way_q36[2][6], INT64_MAX);
    SPOIL(stream.curve.off_q32[6][2], INT64_MAX);
    SPOIL(stream.curve.lead[3].first_q32, INT64_MAX);
    SPOIL(stream.curve.lead[3].step_q32, INT64_MIN);
    SPOIL(stream.curve.lead[3].before_q32, INT64_MAX);
    SPOIL(stream.curve.lead[3].rise_q32, UINT32_MAX);
    SPOIL(stream.curve.lead[3].reach_q16, -1);
    SPOIL(stream.curve.lead[3].full_q16, INT32_MAX);
    SPOIL(stream.curve.lead[3].most_q32, -1);
    SPOIL(stream.curve.predictor.by_newest_q32, 3 * Q32_ONE);
    SPOIL(stream.curve.predictor.by_before_q32, -2 * Q32_ONE);
    SPOIL(stream.curve.low_q32[6], INT64_MIN);
    SPOIL(stream.curve.high_q32[0], INT64_MAX);
    SPOIL(stream.curve.grain[6].quantum_q32, -1);
    SPOIL(stream.curve.grain[6].found_q32, INT64_MAX);
    SPOIL(stream.curve.grain[6].step_q32, INT64_MIN);
    SPOIL_BOOL(stream.curve.grain[6].is_up);
    SPOIL(stream.curve.grain[6].turns, 5);
    SPOIL(stream.curve.watched, 65);
    SPOIL(stream.curve.window, 0);
    SPOIL(stream.curve.window, STREAM_WINDOW_MAX + 1);
    SPOIL(stream.curve.window, 9); /* with other weights */
    SPOIL(stream.curve.period_cycles_q16, 0);
    SPOIL(stream.curve.lead_q32, 1);
    SPOIL(stream.curve.mean_q32, -1);
    SPOIL(stream.curve.led_q32, 2 * Q32_ONE);
    SPOIL(stream.curve.mean_points, 6);
    SPOIL(stream.curve.reach_min_q16, -1);
    SPOIL(stream.curve.reach_max_q16, INT32_MAX);
    SPOIL(stream.curve.change, -1);
    SPOIL(stream.curve.was_q32[2][6], INT64_MAX);
    SPOIL_BOOL(stream.curve.is_off);
    SPOIL(stream.curve.grip_q32, Q32_ONE);
    SPOIL(stream.curve.softest_q32, 0); /* what grip falls to */
    SPOIL(stream.curve.age, 101);
    SPOIL(stream.curve.patience, INT32_MAX);
    SPOIL(stream.curve.limits[2].jerk_per_cycle3_q32, 1);
    SPOIL(stream.curve.scale_q16, -1);
    SPOIL(stream.curve.newest_q32[6], INT64_MAX);
    SPOIL(stream.curve.last_q32[6], INT64_MIN);
    SPOIL(stream.curve.ahead, 64);
    SPOIL(stream.curve.ahead, INT32_MIN);
    SPOIL(stream.curve.axes, AXES_MAX + 1);
    SPOIL(stream.curve.governor.limits[11].vel_per_cycle_q32, 0);
    SPOIL(stream.curve.governor.channels, GOVERNOR_CHANNELS + 1);
    SPOIL(stream.curve.governor.period_us, 0);
    SPOIL(stream.curve.governor.per_limit_q62[0][2], 1);
    SPOIL(stream.curve.governor.brake_q16[11], -1);
    SPOIL(stream.curve.governor.share_q32[6], -1);
    SPOIL(stream.curve.governor.level_q32[7][11], INT64_MAX);
    SPOIL(stream.curve.governor.each, 0);
    SPOIL(stream.curve.governor.since, UINT32_MAX);
    SPOIL(stream.curve.governor.track[7][11].acc_q32, INT64_MAX);
    SPOIL(stream.curve.governor.out[11].vel_q32, INT64_MIN);
    SPOIL(stream.curve.governor.event[3].need_q16[7], -1);
    SPOIL(stream.curve.governor.event[7].age_us, UINT32_MAX);
    SPOIL(stream.curve.governor.asked_q32[11], INT64_MAX);
    SPOIL(stream.curve.governor.behind_q32[0], INT64_MIN);
    SPOIL_BOOL(stream.curve.governor.is_slowed);
    SPOIL(stream.curve.governor.single_us, GOVERNOR_BEGIN_US + 1);
    SPOIL(stream.curve.governor.target_q32, -1);
    SPOIL(stream.curve.governor.pole_q32[2], 8 * Q32_ONE); /* no level is there */
    SPOIL(stream.curve.governor.fall_q32, -1);
    SPOIL(stream.curve.governor.glide_q32, INT64_MAX);
    SPOIL(stream.curve.governor.strength_q32, 8 * Q32_ONE);
}

static void test_a_filter_and_a_fade_that_no_motion_has_are_refused(void)
{
    m_settings.spike_gate = 4;
    engage();
    ride(60, 16, 20, 0.5, k_fine);
    gateway_save(&m_rig.gateway, &m_saved);
    SPOIL(gate.factor, SPIKE_FILTER_FACTOR_MAX + 1);
    SPOIL(gate.accel_q32[0], 0);
    SPOIL(gate.quantum_q32[5], -1);
    SPOIL(gate.settled, 9);
    SPOIL(gate.period_us, 0);
    SPOIL(gate.last_us, UINT64_MAX);
    SPOIL(gate.past_q32[2][5], INT64_MAX);
    SPOIL_BOOL(gate.is_withholding);
    SPOIL_BOOL(gate.is_step);
    SPOIL(gate.withheld_us, UINT64_MAX);
    SPOIL(gate.withheld_periods, -1);
    SPOIL(gate.withheld.axis, POSE_AXES);
    SPOIL(gate.spike.axis, POSE_AXES);
    SPOIL(gate.withheld_q32[5], INT64_MIN);
    SPOIL(fade.from_q32[5], INT64_MIN);
    SPOIL(fade.plan_travel_mm_q32, -1);
    SPOIL(fade.least_cycles, FADE_CYCLES_MIN - 1);
    SPOIL(fade.share_q46[3], INT64_MAX);
    SPOIL(fade_limits.jerk_q32, m_saved.motion.fade_limits.jerk_q32 + 1);
    SPOIL(blend_cycles, m_saved.motion.blend_cycles + 1);
    SPOIL_BOOL(is_return);
    SPOIL(intensity.share_q46[0], 0);
    SPOIL(intensity.share_q46[2], 0); /* a jump */
    SPOIL(timed_share_q46, -1);
    SPOIL(timed_way_q32[6], INT64_MAX);
    SPOIL(slot_q32[0], INT64_MAX);
}

static void hold_at(unsigned frames, double z)
{
    for (unsigned i = 0; i < frames; i++) {
        rig_sendf(&m_rig, k_fine, 0.1 * z, 0.0, 0.0, z, 0.0, z);
        run_and_save(16);
    }
}

static void test_jumps_go_on_and_one_that_no_motion_has_is_refused(void)
{
    m_settings.spike_gate = 10;
    engage();
    hold_at(80, 0);
    hold_at(10, 40);
    hold_at(20, -20);
    hold_at(10, 20);
    gateway_save(&m_rig.gateway, &m_saved);
    TEST_ASSERT_TRUE(m_saved.motion.is_jumping);
    SPOIL_BOOL(is_jumping);
    SPOIL(plan.jump.off[5].state.pos_q32, INT64_MAX);
    SPOIL(plan.jump.off[5].state.vel_per_cycle_q32, m_saved.motion.plan.jump.off[5].limits.vel_per_cycle_q32 + 1);
    SPOIL(plan.jump.off[0].limits.jerk_per_cycle3_q32, 0);
    SPOIL(plan.jump.off[0].limits.vel_per_cycle_q32, INT64_MAX);
    SPOIL(plan.jump.off[0].acc_safe_q32, m_saved.motion.plan.jump.off[0].acc_safe_q32 + 1);
    SPOIL(plan.jump.off[0].acc_cycles, 0);
    SPOIL(plan.jump.off[3].per_jerk_q62, 1);
    SPOIL(plan.jump.off[3].per_acc_q62, 1);
    SPOIL(plan.jump.off[3].brake_reach_q32, 1);
    SPOIL(plan.jump.off[3].brake_cycles, 1);
}

static void test_plans_that_no_motion_has_are_refused(void)
{
    engage();
    ride(20, 16, 20, 0.5, k_fine);
    run_and_save(3000);
    rig_send(&m_rig, "@A6T:1,2,3,4,5,30,3000#"); /* from rest: a quintic */
    rig_run_ms(&m_rig, 500);
    gateway_save(&m_rig.gateway, &m_saved);
    TEST_ASSERT_EQUAL(MOTION_TIMED, m_saved.motion.source);
    SPOIL(plan.quintic.axes, AXES_MAX + 1);
    SPOIL(plan.quintic.cycles, 0);
    SPOIL(plan.quintic.elapsed, -1);
    SPOIL(plan.quintic.target_q32[6], INT64_MAX);
    SPOIL(plan.quintic.start_q32[6], INT64_MAX);
    SPOIL(plan.quintic.coefficient_q32[6][4], INT64_MAX);
    SPOIL(plan.quintic.history[6].vel_per_cycle_q32, INT64_MAX);
    rig_send(&m_rig, "@A6T:0,0,0,0,0,-30,1#"); /* in motion: a stop and a straight way */
    rig_run_ms(&m_rig, 20);
    gateway_save(&m_rig.gateway, &m_saved);
    TEST_ASSERT_EQUAL(MOTION_HALTING, m_saved.motion.source);
    SPOIL(halt.axes, AXES_MAX + 1);
    SPOIL(halt.cycles, 0);
    SPOIL(halt.elapsed, -1);
    SPOIL(halt.times[0].change, 0);
    SPOIL(halt.times[0].hold, INT64_MAX);
    SPOIL(halt.times[0].back, 0);
    SPOIL(halt.start[6].pos_q32, INT64_MIN);
    SPOIL(halt.now[6].pos_q32, INT64_MIN);
    SPOIL(halt.rest_q32[6], INT64_MIN);
    SPOIL_BOOL(is_time_idle);
    SPOIL(straight_after, -1);
    SPOIL(plan.straight.path.nj, 0);
    SPOIL(plan.straight.path.na, INT64_MAX);
    SPOIL(plan.straight.path.nv, -1);
    SPOIL(plan.straight.path.elapsed, -1);
    SPOIL(plan.straight.path.acc, INT64_MAX);
    SPOIL(plan.straight.path.vel, -1);
    SPOIL(plan.straight.path.pos, -1);
    SPOIL(plan.straight.path.total, 0);
    SPOIL(plan.straight.from_q32[6], INT64_MAX);
    SPOIL(plan.straight.to_q32[6], INT64_MAX);
    SPOIL(plan.straight.history[6].pos_q32, INT64_MAX);
}

/* Whoever adds a member finds here that nobody judges it yet: judge it in the module's *_sane.c, spoil it above, then change the
 * size. Sizes are those of 64-bit machines. */
static void test_no_member_is_forgotten(void)
{
    if (sizeof(void *) != 8) {
        TEST_IGNORE_MESSAGE("sizes are those of 64-bit machines");
    }
    TEST_ASSERT_EQUAL(256, sizeof(stream_clock_t));
    TEST_ASSERT_EQUAL(424, sizeof(stream_evidence_t));
    TEST_ASSERT_EQUAL(9928, sizeof(stream_curve_t));
    TEST_ASSERT_EQUAL(48, sizeof(stream_lead_t));
    TEST_ASSERT_EQUAL(32, sizeof(stream_quantum_t));
    TEST_ASSERT_EQUAL(88, sizeof(stream_thin_t));
    TEST_ASSERT_EQUAL(40, sizeof(stream_repeat_t));
    TEST_ASSERT_EQUAL(11064, sizeof(stream_t));
    TEST_ASSERT_EQUAL(4608, sizeof(governor_t));
    TEST_ASSERT_EQUAL(392, sizeof(spike_filter_t));
    TEST_ASSERT_EQUAL(96, sizeof(fade_t));
    TEST_ASSERT_EQUAL(584, sizeof(sync_stop_t));
    TEST_ASSERT_EQUAL(584, sizeof(quintic_t));
    TEST_ASSERT_EQUAL(344, sizeof(motion_straight_t));
    TEST_ASSERT_EQUAL(64, sizeof(scurve_t));
    TEST_ASSERT_EQUAL(168, sizeof(intensity_t));
    TEST_ASSERT_EQUAL(17800, sizeof(motion_t));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_streams_of_all_kinds);
    RUN_TEST(test_moves_steps_and_holds);
    RUN_TEST(test_the_way_up_and_spikes);
    RUN_TEST(test_three_cylinders);
    RUN_TEST(test_a_stream_that_no_motion_has_is_refused);
    RUN_TEST(test_a_curve_that_no_motion_has_is_refused);
    RUN_TEST(test_a_filter_and_a_fade_that_no_motion_has_are_refused);
    RUN_TEST(test_jumps_go_on_and_one_that_no_motion_has_is_refused);
    RUN_TEST(test_plans_that_no_motion_has_are_refused);
    RUN_TEST(test_no_member_is_forgotten);
    return UNITY_END();
}
