/* SPDX-License-Identifier: MIT
 * test_blackbox.c - the black box behind a real motion loop in virtual time: what it writes plays back to the same bytes.
 * The clock of the loop is the test: every sleep is a cycle in which things happen.
 */
#include <errno.h>
#include <ftw.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "platform/load.h"
#include "config/hash.h"
#include "daemon/motion_loop.h"
#include "daemon/play.h"
#include "record/blackbox.h"
#include "record/player.h"
#include "sim_log.h"
#include "sim_udp.h"
#include "unity.h"

#define STEP_CYCLES 10u /* the thread of the black box would come as often */
#define FRAME_US    16000u
#define FILE_BYTES  (64u << 20)

/* What happens in a run; times in us since its start, 0 = never. */
typedef struct {
    uint64_t end_us;
    uint64_t ask_us;
    uint64_t fault_us;
    uint64_t estop_us;
    uint64_t narrow_us; /**< a reload makes the following error's window too narrow for the drives' lag */
    uint64_t break_us;  /**< what of a drive, or of all, in a way that no line of `!drive` tells */
    sim_drives_fault_t broken;
    uint64_t deaf_us, hearing_us; /* the black box does not get a turn in between */
} story_t;

static config_t m_config;
static motion_loop_t m_loop;
static blackbox_t m_box;
static sim_udp_t m_udp;
static sim_log_t m_log;
static story_t m_story;
static uint64_t m_now_us;
static char m_home[64];
static char m_folder[BLACKBOX_PATH_MAX];
static char m_path[BLACKBOX_PATH_MAX + 64];

/* --- The world --- */

static void send_frame(void)
{
    static const hal_udp_peer_t k_from = {.address = {192, 168, 7, 3}, .port = 5000};
    char text[96];
    const double t = (double)m_now_us * 1e-6;
    const int length =
        snprintf(text, sizeof text, "@A6:%.3f,%.3f,0,0,0,%.3f,00#", 6 * sin(2 * t), 5 * sin(1.7 * t), 20 * sin(1.3 * t));
    (void)!sim_udp_push(&m_udp, (const uint8_t *)text, (size_t)length, &k_from);
}

static bool is_due(uint64_t at_us)
{
    return at_us != 0 && m_now_us >= at_us && m_now_us < at_us + m_config.settings.cycle_us;
}

static void live(void)
{
    if (m_now_us % FRAME_US < m_config.settings.cycle_us) {
        send_frame();
    }
    if (is_due(m_story.fault_us)) {
        sim_drives_inject(&m_loop.devices.sim_drives, &(sim_drives_fault_t){.kind = SIM_DRIVES_FAULT, .axis = 2, .code = 0x7305});
    }
    if (is_due(m_story.estop_us)) {
        sim_inputs_set(&m_loop.devices.sim_inputs, INPUT_ESTOP, true);
    }
    if (is_due(m_story.narrow_us)) {
        config_t config = m_config;
        config.settings.following_error_mm_q16 = 655; /* 0.01 mm */
        TEST_ASSERT_TRUE(motion_loop_reload(&m_loop, &config));
    }
    if (is_due(m_story.break_us)) {
        sim_drives_inject(&m_loop.devices.sim_drives, &m_story.broken);
    }
    if (is_due(m_story.ask_us)) {
        (void)blackbox_ask(&m_box);
    }
    const bool is_deaf = m_now_us >= m_story.deaf_us && m_now_us < m_story.hearing_us;
    if (m_now_us / m_config.settings.cycle_us % STEP_CYCLES == 0 && !is_deaf) {
        blackbox_step(&m_box, false);
    }
    if (m_now_us >= m_story.end_us) {
        motion_loop_quit(&m_loop);
    }
}

static uint64_t clock_now_us(void *ctx)
{
    (void)ctx;
    return m_now_us;
}

static hv_status_t clock_sleep(void *ctx, uint64_t deadline_us)
{
    (void)ctx;
    m_now_us = deadline_us;
    live();
    return HV_OK;
}

static void run(story_t story)
{
    static const hal_clock_ops_t k_ops = {clock_now_us, clock_sleep};
    m_story = story;
    sim_udp_init(&m_udp);
    sim_log_init(&m_log);
    config_hash(&m_config);
    TEST_ASSERT_NULL(blackbox_open(&m_box, "test.ini", &m_config));
    m_loop.blackbox = blackbox_feed(&m_box);
    TEST_ASSERT_EQUAL(
        HV_OK, motion_loop_init(&m_loop, &m_config, sim_udp_hal(&m_udp), sim_log_hal(&m_log), (hal_clock_t){&k_ops, NULL}));
    TEST_ASSERT_TRUE(motion_loop_start(&m_loop));
    TEST_ASSERT_EQUAL(0, pthread_join(m_loop.thread, NULL));
    blackbox_step(&m_box, true);
}

/* --- What was written --- */

static const char *file_of(const char *name)
{
    (void)snprintf(m_path, sizeof m_path, "%s/%s", m_folder, name);
    return m_path;
}

static char *contents(const char *path)
{
    FILE *file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    char *bytes = malloc(FILE_BYTES);
    const size_t length = fread(bytes, 1, FILE_BYTES - 1, file);
    bytes[length] = '\0';
    (void)fclose(file);
    return bytes;
}

/* The newest folder. */
static void find_folder(void)
{
    TEST_ASSERT_GREATER_THAN_UINT32(0, m_box.folders);
    (void)snprintf(m_folder, sizeof m_folder, "%s/%s", m_config.black_box.directory, m_box.folder[m_box.folders - 1].name);
}

/* Rows before time zero are there to be looked at; a replay that begins there does not have them. */
static void leave_out_before_zero(char *trace)
{
    char *to = trace;
    for (const char *line = trace; *line != '\0';) {
        const char *end = strchr(line, '\n') + 1;
        static const char k_flag[] = "before-zero\n";
        const size_t length = (size_t)(end - line);
        if (length < sizeof k_flag || memcmp(end - (sizeof k_flag - 1), k_flag, sizeof k_flag - 1) != 0) {
            memmove(to, line, length);
            to += length;
        }
        line = end;
    }
    *to = '\0';
}

/* Plays the incident; what it says it was has to be what comes out, byte for byte.
 * Returns the frames. */
static char *expect_replay_from(bool is_from_zero, unsigned rows_min)
{
    char played_path[96];
    config_t config;
    find_folder();
    (void)snprintf(played_path, sizeof played_path, "%s/played.csv", m_home);
    TEST_ASSERT_EQUAL(0, config_load(file_of("platform.ini"), &config, stderr));
    TEST_ASSERT_EQUAL(0, play_run(&config, file_of("frames"), played_path));
    char *played = contents(played_path);
    char *trace = contents(file_of("trace.csv"));
    if (is_from_zero) {
        leave_out_before_zero(trace);
    }
    unsigned rows = 0;
    for (const char *at = trace; (at = strchr(at, '\n')) != NULL; at++) {
        rows++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(rows_min, rows);
    size_t same = 0;
    while (trace[same] != '\0' && trace[same] == played[same]) {
        same++;
    }
    char around[120] = "";
    (void)snprintf(around, sizeof around, "%.100s", &trace[same > 60 ? same - 60 : 0]);
    TEST_ASSERT_TRUE_MESSAGE(trace[same] == 0 && played[same] == 0, around);
    free(played);
    free(trace);
    return contents(file_of("frames"));
}

static char *expect_replay(unsigned rows_min)
{
    return expect_replay_from(true, rows_min);
}

static void expect_in(const char *text, const char *part)
{
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, part), part);
}

void setUp(void)
{
    memset(&m_loop, 0, sizeof m_loop);
    memset(&m_box, 0, sizeof m_box);
    m_now_us = 0;
    TEST_ASSERT_EQUAL(0, config_load(HEAVE_CONFIG_DIR "/demo-hexapod.ini", &m_config, stderr));
    (void)snprintf(m_home, sizeof m_home, "/tmp/heave-blackbox-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_home));
    (void)snprintf(m_config.black_box.directory, sizeof m_config.black_box.directory, "%s/box", m_home);
    m_config.black_box.seconds = 10;
    m_config.inputs.estop_line.text[0] = '5';
    m_config.settings.engage = ENGAGE_AUTO;
    m_config.settings.auto_frames = 0;
}

static int remove_one(const char *path, const struct stat *about, int kind, struct FTW *walk)
{
    (void)about;
    (void)kind;
    (void)walk;
    return remove(path);
}

void tearDown(void)
{
    (void)blackbox_close(&m_box);
    TEST_ASSERT_EQUAL(0, nftw(m_home, remove_one, 8, FTW_DEPTH | FTW_PHYS));
}

/* --- Cases --- */

static void test_blackbox_short_run_replays_from_time_zero(void)
{
    run((story_t){.end_us = 6000000, .ask_us = 5000000});
    char *frames = expect_replay(4000);
    TEST_ASSERT_NULL(strstr(frames, "!state"));
    expect_in(frames, "; asked for by an operator\n");
    expect_in(frames, "!from 192.168.7.3\n");
    char *feedback = contents(file_of("feedback.csv"));
    expect_in(feedback, "t_ms,c1_state,c1_actual_mm,c1_code,c1_error,");
    expect_in(feedback, "enabled");
    free(feedback);
    free(frames);
}

/* Drives that home move by themselves: what they told is all there is to repeat. */
static void test_blackbox_dump_in_homing_has_every_row_and_replays(void)
{
    m_config.sim.is_homed = false;
    m_config.sim.start_extension_mm_q16 = 60 << 16;
    m_config.sim.enable_delay_ms = 300;
    run((story_t){.end_us = 1200000, .ask_us = 1100000});
    TEST_ASSERT_EQUAL(STATE_HOMING, gateway_snapshot(&m_loop.session.gateway)->state);
    free(expect_replay_from(false, 1000));
    char *trace = contents(file_of("trace.csv"));
    expect_in(trace, ",HOMING,");
    expect_in(trace, "before-zero\n");
    free(trace);
    char *feedback = contents(file_of("feedback.csv"));
    expect_in(feedback, ",enabling,");
    expect_in(feedback, ",homing,");
    free(feedback);
}

static void test_blackbox_long_ride_replays_from_the_middle(void)
{
    run((story_t){.end_us = 42000000, .ask_us = 41000000});
    char *frames = expect_replay(10000);
    expect_in(frames, " !state ");
    free(frames);
}

static void test_blackbox_drive_fault_is_written_by_itself_and_replays(void)
{
    run((story_t){.end_us = 45000000, .fault_us = 40123000});
    TEST_ASSERT_EQUAL_UINT32(1, m_box.folders);
    char *frames = expect_replay(10000);
    expect_in(frames, ", axis 3, at ");
    expect_in(frames, " !drive 3 fault 00007305\n");
    char *trace = contents(file_of("trace.csv"));
    expect_in(trace, ",FAULT,");
    free(trace);
    free(frames);
}

/* The replay shows the same rows up to the first one in FAULT: its set-points are where the drives are, and those of a replay
 * know nothing of what these have been through. */
static void expect_same_fault(const char *frames_line)
{
    char played_path[96];
    config_t config;
    find_folder();
    (void)snprintf(played_path, sizeof played_path, "%s/played.csv", m_home);
    char *frames = contents(file_of("frames"));
    expect_in(frames, frames_line);
    free(frames);
    TEST_ASSERT_EQUAL(0, config_load(file_of("platform.ini"), &config, stderr));
    TEST_ASSERT_EQUAL(0, play_run(&config, file_of("frames"), played_path));
    char *played = contents(played_path);
    char *trace = contents(file_of("trace.csv"));
    leave_out_before_zero(trace);
    const char *fault = strstr(trace, ",FAULT,");
    TEST_ASSERT_NOT_NULL(fault);
    TEST_ASSERT_EQUAL_MEMORY(trace, played, (size_t)(fault - trace) + strlen(",FAULT,"));
    free(played);
    free(trace);
}

static void test_blackbox_following_error_after_a_reload_replays(void)
{
    run((story_t){.end_us = 8000000, .narrow_us = 6000000});
    char *frames = expect_replay(5000);
    expect_in(frames,
              "; the configuration was read again: platform.ini is as it was at the start of heaved\n; what changed does not");
    expect_in(frames, " !fault following-error ");
    free(frames);
    char *trace = contents(file_of("trace.csv"));
    expect_in(trace, ",FAULT,");
    free(trace);
}

static void test_blackbox_following_error_in_the_middle_replays(void)
{
    run((story_t){.end_us = 44000000, .narrow_us = 40000000});
    char *frames = expect_replay(5000);
    expect_in(frames, " !state ");
    expect_in(frames, " !fault following-error ");
    free(frames);
}

static void test_blackbox_reload_before_the_replay_is_said(void)
{
    run((story_t){.end_us = 60000000, .narrow_us = 5000000, .ask_us = 59000000});
    char *frames = expect_replay(5000);
    expect_in(frames, "; what changed is part of the replay\n");
    free(frames);
}

static void test_blackbox_lost_bus_replays(void)
{
    run((story_t){.end_us = 8000000, .break_us = 6000000, .broken = {.kind = SIM_DRIVES_OFFLINE, .axis = SIM_DRIVES_ALL}});
    expect_same_fault(" !fault bus-lost\n");
}

static void test_blackbox_frozen_drive_replays(void)
{
    run((story_t){.end_us = 8000000, .break_us = 6000000, .broken = {.kind = SIM_DRIVES_FREEZE, .axis = 1}});
    expect_same_fault(" !fault ");
}

static void test_blackbox_estop_is_written_at_the_end_at_the_latest(void)
{
    run((story_t){.end_us = 8000000, .estop_us = 7000000});
    char *frames = expect_replay(6000);
    expect_in(frames, "; e-stop, at ");
    expect_in(frames, " !estop on\n");
    free(frames);
}

static void test_blackbox_what_was_not_handed_over_is_not_replayed(void)
{
    run((story_t){.end_us = 32000000, .deaf_us = 8000000, .hearing_us = 20000000, .ask_us = 31000000});
    char *frames = expect_replay(3000);
    expect_in(frames, " !state ");
    free(frames);
}

static void test_blackbox_nothing_to_begin_with_is_said(void)
{
    run((story_t){.end_us = 19100000, .deaf_us = 8000000, .hearing_us = 19000000, .ask_us = 19050000});
    find_folder();
    char *frames = contents(file_of("frames"));
    expect_in(frames, "; NO REPLAY: ");
    free(frames);
}

/* Another start of heaved, on the same directory. */
static void start_anew(void)
{
    (void)blackbox_close(&m_box);
    memset(&m_loop, 0, sizeof m_loop);
    memset(&m_box, 0, sizeof m_box);
    m_now_us = 0;
}

static bool is_kept(const char *folder)
{
    char path[BLACKBOX_PATH_MAX + 64];
    (void)snprintf(path, sizeof path, "%s/%s", m_config.black_box.directory, folder);
    return access(path, F_OK) == 0;
}

static unsigned dumps(void)
{
    unsigned count = 0;
    for (uint32_t i = 0; i < m_box.folders; i++) {
        TEST_ASSERT_TRUE(is_kept(m_box.folder[i].name));
        count += blackbox_is_dump(m_box.folder[i].name);
    }
    return count;
}

static void make_folder(const char *name)
{
    char path[BLACKBOX_PATH_MAX + 64];
    (void)snprintf(path, sizeof path, "%s/%s", m_config.black_box.directory, name);
    TEST_ASSERT_EQUAL(0, mkdir(path, 0700));
}

static void test_blackbox_dumps_are_bounded_and_delete_no_fault_and_a_part_is_removed(void)
{
    m_config.black_box.incidents = 2;
    (void)mkdir(m_config.black_box.directory, 0700);
    make_folder("incident-000040-20200101T000000Z");
    make_folder("incident-000041-20200101T000000Z");
    for (unsigned i = 0; i < 4; i++) {
        make_folder(".incident.part");
        if (i > 0) {
            start_anew();
        }
        run((story_t){.end_us = 1000000, .ask_us = 900000});
        TEST_ASSERT_EQUAL_UINT32(42 + i, m_box.number);
        TEST_ASSERT_EQUAL_UINT32(i < 2 ? i + 1 : 2, dumps());
        TEST_ASSERT_EQUAL_UINT32(2 + dumps(), m_box.folders);
        TEST_ASSERT_TRUE(is_kept("incident-000040-20200101T000000Z") && is_kept("incident-000041-20200101T000000Z"));
        TEST_ASSERT_FALSE(is_kept(".incident.part"));
    }
}

/* A folder that somebody has put there, or a copy of another machine's: there is always a number behind it. */
static void test_blackbox_highest_number_of_six_digits_is_not_the_last(void)
{
    static blackbox_folder_t folder[BLACKBOX_FOLDERS_MAX];
    uint32_t seen = 0;
    (void)mkdir(m_config.black_box.directory, 0700);
    make_folder("incident-999999-20200101T000000Z");
    make_folder("incident-4000000001-20200101T000000Z"); /* none of ours */
    make_folder("incident-99999-20200101T000000Z");
    run((story_t){.end_us = 1000000});
    blackbox_see(&m_box);
    blackbox_step(&m_box, false);
    for (unsigned i = 0; i < 2; i++) {
        start_anew();
        run((story_t){.end_us = 5000000, .fault_us = 2000000});
        TEST_ASSERT_EQUAL_UINT32(1000000 + i, m_box.number);
        TEST_ASSERT_EQUAL_UINT32(2 + i, blackbox_list(&m_box, folder, &seen));
        TEST_ASSERT_EQUAL_UINT32(999999, seen);
        TEST_ASSERT_EQUAL_STRING_LEN("incident-1000000-", folder[1].name, 17); /* in the order of their numbers */
    }
}

static void test_blackbox_first_fault_since_a_person_looked_is_never_dropped(void)
{
    static blackbox_folder_t folder[BLACKBOX_FOLDERS_MAX];
    uint32_t seen = 0;
    m_config.black_box.incidents = 1;
    (void)mkdir(m_config.black_box.directory, 0700);
    make_folder("incident-000007-20200101T000000Z");
    for (unsigned i = 0; i < 3; i++) { /* 8, 9, 10: each makes way for the next */
        run((story_t){.end_us = 5000000, .fault_us = 2000000});
        TEST_ASSERT_EQUAL_UINT32(2, m_box.folders);
        TEST_ASSERT_TRUE(is_kept("incident-000007-20200101T000000Z"));
        start_anew();
    }
    run((story_t){.end_us = 1000000});
    blackbox_see(&m_box);
    blackbox_step(&m_box, false);
    start_anew();                                           /* it is on the disk */
    run((story_t){.end_us = 5000000, .fault_us = 2000000}); /* 11: the first one since */
    TEST_ASSERT_EQUAL_UINT32(2, blackbox_list(&m_box, folder, &seen));
    TEST_ASSERT_EQUAL_UINT32(10, seen);
    TEST_ASSERT_FALSE(is_kept("incident-000007-20200101T000000Z"));
    start_anew();
    for (unsigned i = 0; i < 2; i++) {
        run((story_t){.end_us = 5000000, .fault_us = 2000000});
        TEST_ASSERT_EQUAL_UINT32(2, blackbox_list(&m_box, folder, &seen));
        TEST_ASSERT_EQUAL_UINT32(11, blackbox_number(folder[0].name));
        start_anew();
    }
    run((story_t){.end_us = 1000000});
}

static void expect_refusal(const char *why)
{
    bool is_good = true;
    char text[BLACKBOX_TEXT_MAX];
    TEST_ASSERT_TRUE(blackbox_answer(&m_box, 1, &is_good, text));
    TEST_ASSERT_FALSE(is_good);
    expect_in(text, why);
    TEST_ASSERT_EQUAL_UINT32(0, m_box.folders);
}

static void test_blackbox_full_disk_leaves_nothing_behind(void)
{
    struct rlimit before;
    (void)signal(SIGXFSZ, SIG_IGN);
    TEST_ASSERT_EQUAL(0, getrlimit(RLIMIT_FSIZE, &before));
    const struct rlimit small = {.rlim_cur = 200000, .rlim_max = before.rlim_max};
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &small));
    run((story_t){.end_us = 3000000, .ask_us = 2900000});
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &before));
    expect_refusal(strerror(EFBIG));
    TEST_ASSERT_EQUAL_MESSAGE(0, rmdir(m_config.black_box.directory), "an empty directory");
}

static void test_blackbox_directory_that_cannot_be_is_said_at_the_start(void)
{
    (void)fclose(fopen(m_config.black_box.directory, "w"));
    const char *why = blackbox_open(&m_box, "test.ini", &m_config);
    TEST_ASSERT_NOT_NULL(why);
    expect_in(why, "Not a directory");
    (void)blackbox_ask(&m_box);
    blackbox_step(&m_box, false);
    expect_refusal("Not a directory");
}

static void test_blackbox_without_directory_there_is_none(void)
{
    (void)strcpy(m_config.black_box.directory, "none");
    TEST_ASSERT_NULL(blackbox_open(&m_box, "test.ini", &m_config));
    TEST_ASSERT_NULL(blackbox_feed(&m_box));
    TEST_ASSERT_EQUAL_UINT32(0, blackbox_ask(&m_box));
    TEST_ASSERT_TRUE(blackbox_start(&m_box));
}

static void test_blackbox_whose_thread_could_not_be_started_says_so_at_once(void)
{
    TEST_ASSERT_NULL(blackbox_open(&m_box, "test.ini", &m_config));
    m_box.has_no_thread = true;
    TEST_ASSERT_EQUAL_UINT32(1, blackbox_ask(&m_box));
    expect_refusal("could not be started");
}

static void test_checkpoint_damaged_text_is_refused(void)
{
    static char line[CHECKPOINT_LINE_MAX];
    static session_t session, out;
    sim_log_init(&m_log);
    const size_t length = checkpoint_format(&session, "0123456789abcdef", line);
    char *text = strstr(line, "!state ") + strlen("!state ");
    const size_t rest = length - 1 - (size_t)(text - line);
    TEST_ASSERT_NULL(checkpoint_parse((const uint8_t *)text, rest, "0123456789abcdef", &out));
    const char *wrong = checkpoint_parse((const uint8_t *)text, rest, "0123456789abcdee", &out);
    TEST_ASSERT_NOT_NULL(strstr(wrong, "another configuration"));
    TEST_ASSERT_EQUAL_MEMORY(&session, &out, sizeof out);
    for (size_t i = 0; i < rest; i += 97) {
        const char was = text[i];
        text[i] = was == '1' ? '2' : '1';
        TEST_ASSERT_NOT_NULL(checkpoint_parse((const uint8_t *)text, rest, "0123456789abcdef", &out));
        text[i] = was;
    }
    for (size_t i = 0; i < rest; i += 997) {
        TEST_ASSERT_NOT_NULL(checkpoint_parse((const uint8_t *)text, i, "0123456789abcdef", &out));
    }
}

/* The processor time of a replay is limited by it. */
static void test_player_span_is_never_less_than_nothing(void)
{
    frames_line_t line[] = {{.kind = FRAMES_STATE, .t_us = UINT64_C(28800000000)}, {.kind = FRAMES_END}};
    const player_t player = {.line = line, .lines = 2};
    line[1].t_us = line[0].t_us + 5000000;
    TEST_ASSERT_EQUAL_UINT64(5000000, player_span_us(&player));
    line[1] = (frames_line_t){.kind = FRAMES_DATAGRAM}; /* hours before, as only a file made by hand has it */
    TEST_ASSERT_EQUAL_UINT64(UINT64_C(7200000000), player_span_us(&player));
}

int main(void)
{
    (void)unsetenv("STATE_DIRECTORY"); // NOLINT(concurrency-mt-unsafe): before any thread
    UNITY_BEGIN();
    RUN_TEST(test_blackbox_short_run_replays_from_time_zero);
    RUN_TEST(test_blackbox_dump_in_homing_has_every_row_and_replays);
    RUN_TEST(test_blackbox_long_ride_replays_from_the_middle);
    RUN_TEST(test_blackbox_drive_fault_is_written_by_itself_and_replays);
    RUN_TEST(test_blackbox_following_error_after_a_reload_replays);
    RUN_TEST(test_blackbox_following_error_in_the_middle_replays);
    RUN_TEST(test_blackbox_reload_before_the_replay_is_said);
    RUN_TEST(test_blackbox_lost_bus_replays);
    RUN_TEST(test_blackbox_frozen_drive_replays);
    RUN_TEST(test_blackbox_estop_is_written_at_the_end_at_the_latest);
    RUN_TEST(test_blackbox_what_was_not_handed_over_is_not_replayed);
    RUN_TEST(test_blackbox_nothing_to_begin_with_is_said);
    RUN_TEST(test_blackbox_dumps_are_bounded_and_delete_no_fault_and_a_part_is_removed);
    RUN_TEST(test_blackbox_highest_number_of_six_digits_is_not_the_last);
    RUN_TEST(test_blackbox_first_fault_since_a_person_looked_is_never_dropped);
    RUN_TEST(test_blackbox_full_disk_leaves_nothing_behind);
    RUN_TEST(test_blackbox_directory_that_cannot_be_is_said_at_the_start);
    RUN_TEST(test_blackbox_without_directory_there_is_none);
    RUN_TEST(test_blackbox_whose_thread_could_not_be_started_says_so_at_once);
    RUN_TEST(test_checkpoint_damaged_text_is_refused);
    RUN_TEST(test_player_span_is_never_less_than_nothing);
    return UNITY_END();
}
