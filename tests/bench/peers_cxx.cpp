/* SPDX-License-Identifier: MIT
 * peers_cxx.cpp - peers that are C++: std::from_chars, and Ruckig where the build has its source.
 */
#include "peers.h"

#include <charconv>

bool peer_from_chars(const char *text, size_t length, peer_frame_t *frame)
{
    const char *const end = text + length;
    const char *at = peer_read_head(text, frame);
    for (unsigned i = 0; at != nullptr && i < frame->count; i++) {
        double value = 0;
        const auto result = std::from_chars(at, end, value);
        if (result.ec != std::errc() || result.ptr == end || *result.ptr != ',') {
            return false;
        }
        frame->value_q16[i] = peer_q16(value);
        at = result.ptr + 1;
    }
    if (at == nullptr) {
        return false;
    }
    uint32_t last = 0;
    const auto result = std::from_chars(at, end, last, frame->is_timed ? 10 : 16);
    if (frame->is_timed) {
        frame->time_ms = last;
    } else {
        frame->relay_mask = static_cast<uint16_t>(last & 0xFFFu);
    }
    return result.ec == std::errc() && result.ptr + 1 == end && *result.ptr == '#';
}

#ifdef BENCH_RUCKIG
#include <ruckig/ruckig.hpp>

namespace
{
ruckig::Ruckig<7> s_otg(0.001);
ruckig::InputParameter<7> s_given;
ruckig::OutputParameter<7> s_out;
} // namespace

void peer_ruckig_start(double speed, double accel, double jerk)
{
    s_otg.reset();
    s_given = ruckig::InputParameter<7>();
    for (unsigned i = 0; i < 7; i++) {
        s_given.current_position[i] = 0; /* which its constructor leaves open */
        s_given.max_velocity[i] = speed;
        s_given.max_acceleration[i] = accel;
        s_given.max_jerk[i] = jerk;
    }
}

bool peer_ruckig_step(const double target[7], double position[7])
{
    for (unsigned i = 0; i < 7; i++) {
        s_given.target_position[i] = target[i];
    }
    const ruckig::Result result = s_otg.update(s_given, s_out);
    const bool is_good = result == ruckig::Result::Working || result == ruckig::Result::Finished;
    if (is_good) {
        s_out.pass_to_input(s_given);
    }
    for (unsigned i = 0; i < 7; i++) {
        position[i] = s_given.current_position[i];
    }
    return is_good;
}
#endif
