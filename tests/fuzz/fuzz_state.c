/* SPDX-License-Identifier: MIT
 * fuzz_state.c - a saved state that somebody has changed, as whoever replays an incident is handed one. Input: which platform and
 * which moment of a ride, then records of eight bytes: where, how and what to write into the saved gateway. What must hold: it is
 * refused, and then the gateway is as it was; or the gateway runs on, with frames and requests, within its own memory and without
 * anything undefined (which the sanitizers say). Where nothing was written it is taken.
 */
#include <string.h>

#include "fuzz.h"
#include "rig.h"

#define PLATFORMS   2u
#define MOMENTS     6u
#define RECORDS_MAX 8u
#define CYCLES      400u

static rig_t m_rig; /* handles point in here */
static rig_t m_start[PLATFORMS][MOMENTS];
static gateway_t m_saved, m_prepared, m_before;
static bool m_is_up;

static settings_t settings_of(unsigned platform)
{
    return platform == 0 ? rig_hexapod() : rig_tripod();
}

static const char *pose_of(unsigned platform, unsigned i)
{
    static const char *const k_poses[PLATFORMS][3] = {{"@A6:1,2,0,3,4,9,1#", "@A6:2,1,0,4,3,12,2#", "@A6T:3,-3,1,9,0,20,900#"},
                                                      {"@A3:1,2,9,1#", "@A3:2,1,12,2#", "@A3T:3,-3,20,900#"}};
    return k_poses[platform][i];
}

/* At rest, at a take-over, in a stream, in a timed move, in extensions, in hold. */
static void go_to(unsigned platform, unsigned moment)
{
    if (moment == 0) {
        return;
    }
    FUZZ_REQUIRE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
    for (unsigned i = 0; i < (moment == 1 ? 2u : 100u); i++) {
        rig_send(&m_rig, pose_of(platform, i / 3 % 2));
        rig_run_ms(&m_rig, 20);
    }
    if (moment == 3) {
        rig_run_ms(&m_rig, 1000);
        rig_send(&m_rig, pose_of(platform, 2));
    } else if (moment == 4) {
        rig_send(&m_rig, platform == 0 ? "@C6:90,95,100,95,90,95,1#" : "@C3:90,95,100,1#");
    } else if (moment == 5) {
        (void)!rig_request(&m_rig, EVENT_HOLD);
    }
    rig_run_ms(&m_rig, 50);
}

static void bring_up(void)
{
    for (unsigned platform = 0; platform < PLATFORMS; platform++) {
        for (unsigned moment = 0; moment < MOMENTS; moment++) {
            const settings_t settings = settings_of(platform);
            rig_start(&m_rig, &settings, true);
            go_to(platform, moment);
            m_start[platform][moment] = m_rig;
        }
    }
}

/* The rig judges limits in every cycle, which hold for nothing that somebody made up. */
static void run_on(unsigned platform)
{
    m_rig.is_checking = m_rig.is_auto_checking = false;
    for (unsigned i = 0; i < CYCLES; i++) {
        if (i % 20 == 0) {
            rig_send(&m_rig, pose_of(platform, i / 20 % 3));
        }
        if (i == CYCLES / 2) {
            (void)!rig_request(&m_rig, EVENT_RESUME);
        }
        m_rig.now_us += m_rig.settings.cycle_us;
        gateway_cycle(&m_rig.gateway, m_rig.now_us);
    }
}

/* Returns whether something was written. */
static bool spoil(fuzz_input_t *in)
{
    static const uint64_t k_extremes[] = {0, 1, UINT64_MAX, INT64_MAX, (uint64_t)INT64_MAX + 1, 1ull << 40, 255, 1ull << 31};
    static const size_t k_sizes[] = {1, 2, 4, 8};
    uint8_t *const bytes = (uint8_t *)&m_saved;
    const size_t size = k_sizes[fuzz_u8(in) % 4];
    const uint8_t how = fuzz_u8(in);
    const size_t offset = fuzz_u16(in) % (sizeof m_saved / size) * size;
    uint64_t value = fuzz_u32(in);
    if (how % 3 == 0) {
        value = k_extremes[value % (sizeof k_extremes / sizeof k_extremes[0])];
    } else if (how % 3 == 1) {
        uint64_t was = 0;
        memcpy(&was, bytes + offset, size);
        value = was ^ 1ull << value % 64;
    }
    memcpy(bytes + offset, &value, size);
    return true;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input_t in = {data, size};
    if (!m_is_up) {
        bring_up();
        m_is_up = true;
    }
    const uint8_t choice = fuzz_u8(&in);
    const unsigned platform = choice % PLATFORMS;
    m_rig = m_start[platform][choice / PLATFORMS % MOMENTS];
    const settings_t settings = settings_of(platform);
    const gateway_io_t io = m_rig.gateway.io;
    gateway_save(&m_rig.gateway, &m_saved);
    FUZZ_REQUIRE(gateway_init(&m_prepared, &settings, &io) == HV_OK);
    bool is_spoilt = false;
    for (unsigned i = 0; i < RECORDS_MAX && in.left > 0; i++) {
        is_spoilt |= spoil(&in);
    }
    m_before = m_prepared;
    const hv_status_t status = gateway_resume(&m_prepared, &m_saved, &io);
    FUZZ_REQUIRE(status == HV_OK || status == HV_ERR_ARG);
    FUZZ_REQUIRE(is_spoilt || status == HV_OK);
    FUZZ_REQUIRE(status == HV_OK || memcmp(&m_prepared, &m_before, sizeof m_before) == 0);
    if (status == HV_OK) {
        m_rig.gateway = m_prepared;
        run_on(platform);
    }
    return 0;
}
