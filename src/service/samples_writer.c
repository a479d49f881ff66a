/* SPDX-License-Identifier: MIT
 * samples_writer.c - the writer of samples; see samples_writer.h. While a record is being written its sequence number is 0; it
 * gets its own when the rest stands there, and the count of records comes last.
 */
#include "service/samples_writer.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "platform/telemetry_section.h"

#define HEADER_BYTES 8192u
#define NO_FRAME     UINT32_MAX

/* A record: words of 8 bytes, the smaller ones together in two of them. */
typedef struct {
    uint64_t sequence;
    uint64_t cycle;
    uint64_t time_us;
    uint8_t state, goal, fault, fault_axis;
    uint16_t relays;
    uint8_t intensity_percent;
    uint8_t bits; /* SAMPLE_... */
    uint32_t flags;
    uint32_t frame_age_us;
    uint32_t wake_us, work_us;
    uint8_t drive[8];
    int64_t asked[POSE_AXES];
    int64_t sent[POSE_AXES];
    int64_t actual[POSE_AXES];
    int64_t sent_mm[CYLINDERS_MAX];
    int64_t actual_mm[CYLINDERS_MAX];
    int64_t sent_deg;
    int64_t actual_deg;
    int16_t torque_permille[8]; /* what a drive tells beside its position; 0 until it has */
    int32_t lag_q16[8];
    uint32_t inputs[8];
    uint8_t notes[8];
} sample_t;

#define WORDS (sizeof(sample_t) / 8u)

/* Bits of `bits`. */
enum { SAMPLE_ESTOP = 1u, SAMPLE_SILENT = 2u, SAMPLE_POSE_KNOWN = 4u, SAMPLE_RELAYS_UNKNOWN = 8u };

/* --- The table of columns --- */

static uint32_t column(samples_header_t *header, const char *name, const char *unit, const char *type, size_t at, double scale)
{
    samples_column_t *new_one = (samples_column_t *)(void *)(header + 1) + header->columns;
    (void)snprintf(new_one->name, sizeof new_one->name, "%s", name);
    (void)snprintf(new_one->unit, sizeof new_one->unit, "%s", unit);
    (void)snprintf(new_one->type, sizeof new_one->type, "%s", type);
    new_one->at = (uint32_t)at;
    new_one->scale = scale;
    return header->columns++;
}

static void pose_columns(samples_header_t *header, const char *what, size_t at)
{
    static const char *const k_axes[POSE_AXES] = {"roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        char name[32];
        (void)snprintf(name, sizeof name, "%s_%s", what, k_axes[i]);
        (void)column(header, name, i < 3 ? "deg" : "mm", "i8", at + 8u * i, 1.0 / (double)Q32_ONE);
    }
}

static void cylinder_columns(samples_header_t *header, const char *what, size_t at, unsigned cylinders)
{
    for (unsigned i = 0; i < cylinders; i++) {
        char name[32];
        (void)snprintf(name, sizeof name, "%s_c%u_mm", what, i + 1u);
        (void)column(header, name, "mm", "i8", at + 8u * i, 1.0 / (double)Q32_ONE);
    }
}

static void drive_column(samples_header_t *header, unsigned drive, const char *what, const char *unit, const char *type,
                         size_t at, double scale)
{
    char name[32];
    (void)snprintf(name, sizeof name, "drive%u%s%s", drive + 1u, what[0] != '\0' ? "_" : "", what);
    (void)column(header, name, unit, type, at, scale);
}

/* Only of what the drives are set up to tell. */
static void telemetry_columns(samples_header_t *header, const config_t *config, unsigned cylinders, unsigned drives)
{
    const uint8_t shown = config_telemetry(config);
    for (unsigned i = 0; i < drives; i++) {
        if ((shown & DRIVE_HAS_TORQUE) != 0) {
            drive_column(header, i, "torque_percent", "%", "i2", offsetof(sample_t, torque_permille) + 2u * i, 0.1);
        }
        if ((shown & DRIVE_HAS_LAG) != 0) {
            const bool is_angle = i >= cylinders;
            drive_column(header, i, is_angle ? "lag_deg" : "lag_mm", is_angle ? "deg" : "mm", "i4",
                         offsetof(sample_t, lag_q16) + 4u * i, 1.0 / (double)Q16_ONE);
        }
        if ((shown & DRIVE_HAS_INPUTS) != 0) {
            drive_column(header, i, "inputs", "", "u4", offsetof(sample_t, inputs) + 4u * i, 1);
        }
        if (config->drives == CONFIG_DRIVES_CIA402) {
            drive_column(header, i, "notes", "", "u1", offsetof(sample_t, notes) + i, 1);
        }
    }
}

static void write_table(samples_header_t *header, const config_t *config)
{
    const unsigned cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
    const unsigned drives = cylinders + (config->settings.has_angle ? 1u : 0u);
    (void)column(header, "cycle", "", "u8", offsetof(sample_t, cycle), 1);
    (void)column(header, "t_ms", "ms", "u8", offsetof(sample_t, time_us), 0.001);
    (void)column(header, "state", "", "u1", offsetof(sample_t, state), 1);
    (void)column(header, "goal", "", "u1", offsetof(sample_t, goal), 1);
    (void)column(header, "fault", "", "u1", offsetof(sample_t, fault), 1);
    (void)column(header, "fault_axis", "", "u1", offsetof(sample_t, fault_axis), 1);
    (void)column(header, "relays", "", "u2", offsetof(sample_t, relays), 1);
    (void)column(header, "intensity", "%", "u1", offsetof(sample_t, intensity_percent), 1);
    (void)column(header, "bits", "", "u1", offsetof(sample_t, bits), 1);
    (void)column(header, "flags", "", "u4", offsetof(sample_t, flags), 1);
    (void)column(header, "frame_age_ms", "ms", "u4", offsetof(sample_t, frame_age_us), 0.001);
    (void)column(header, "wake_us", "us", "u4", offsetof(sample_t, wake_us), 1);
    (void)column(header, "work_us", "us", "u4", offsetof(sample_t, work_us), 1);
    for (unsigned i = 0; i < drives; i++) {
        drive_column(header, i, "", "", "u1", offsetof(sample_t, drive) + i, 1);
    }
    pose_columns(header, "asked", offsetof(sample_t, asked));
    pose_columns(header, "sent", offsetof(sample_t, sent));
    pose_columns(header, "actual", offsetof(sample_t, actual));
    cylinder_columns(header, "sent", offsetof(sample_t, sent_mm), cylinders);
    cylinder_columns(header, "actual", offsetof(sample_t, actual_mm), cylinders);
    if (config->settings.has_angle) {
        (void)column(header, "sent_angle_deg", "deg", "i8", offsetof(sample_t, sent_deg), 1.0 / (double)Q32_ONE);
        (void)column(header, "actual_angle_deg", "deg", "i8", offsetof(sample_t, actual_deg), 1.0 / (double)Q32_ONE);
    }
    telemetry_columns(header, config, cylinders, drives);
}

static uint64_t clock_ns(clockid_t clock)
{
    struct timespec now = {0};
    (void)clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/* --- The memory --- */

/* Makes it, maps it, and takes the right to write from everybody else. Returns NULL: errno says why. */
static void *make_memory(samples_writer_t *self)
{
    self->fd = memfd_create("heave-samples", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (self->fd < 0 || ftruncate(self->fd, (off_t)self->bytes) != 0) {
        return NULL;
    }
    void *memory = mmap(NULL, self->bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, self->fd, 0);
    if (memory == MAP_FAILED) {
        return NULL;
    }
    memset(memory, 0, self->bytes); /* every page is there, and written */
    if (fcntl(self->fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) != 0) {
        (void)munmap(memory, self->bytes);
        return NULL;
    }
    return memory;
}

bool samples_writer_open(samples_writer_t *self, const config_t *config)
{
    const uint64_t cycles = (uint64_t)config->samples_seconds * 1000000u / config->settings.cycle_us;
    *self = (samples_writer_t){.fd = -1};
    if (cycles < 2u) {
        return true;
    }
    self->bytes = HEADER_BYTES + (size_t)cycles * sizeof(sample_t);
    samples_header_t *header = make_memory(self);
    if (header == NULL) {
        const int error = errno;
        if (self->fd >= 0) {
            (void)close(self->fd);
        }
        *self = (samples_writer_t){.fd = -1};
        errno = error;
        return false;
    }
    *header = (samples_header_t){.version = SAMPLES_VERSION,
                                 .header_bytes = HEADER_BYTES,
                                 .record_bytes = sizeof(sample_t),
                                 .capacity = (uint32_t)cycles,
                                 .column_bytes = sizeof(samples_column_t),
                                 .cycle_us = config->settings.cycle_us,
                                 .start_monotonic_ns = clock_ns(CLOCK_MONOTONIC),
                                 .start_realtime_ns = clock_ns(CLOCK_REALTIME)};
    memcpy(header->magic, SAMPLES_MAGIC, sizeof header->magic);
    write_table(header, config);
    self->header = header;
    return true;
}

void samples_writer_close(samples_writer_t *self)
{
    if (self->header != NULL) {
        (void)munmap(self->header, self->bytes);
        (void)close(self->fd);
    }
    *self = (samples_writer_t){.fd = -1};
}

/* --- A record --- */

static uint8_t bits_of(const snapshot_t *s)
{
    return (uint8_t)((s->is_estop_active ? SAMPLE_ESTOP : 0u) | (s->is_held_by_silence ? SAMPLE_SILENT : 0u) |
                     (s->plate.has_pose ? SAMPLE_POSE_KNOWN : 0u) | (s->is_relays_unknown ? SAMPLE_RELAYS_UNKNOWN : 0u));
}

static uint32_t frame_age_us(const snapshot_t *s)
{
    const uint64_t age_us = s->now_us - s->last_frame_us;
    return s->last_frame_us == 0 || age_us >= NO_FRAME ? NO_FRAME : (uint32_t)age_us;
}

static uint32_t at_most(uint64_t us)
{
    return us < UINT32_MAX ? (uint32_t)us : UINT32_MAX;
}

static int32_t within(int64_t value, int32_t most)
{
    return value > most ? most : value < -most ? -most : (int32_t)value;
}

static void fill_telemetry(sample_t *out, const snapshot_t *s)
{
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        const drive_telemetry_t *shown = &s->report[i].telemetry;
        out->torque_permille[i] = (int16_t)within(shown->torque_permille, INT16_MAX);
        out->lag_q16[i] = within(shown->lag_q32 / (Q32_ONE / Q16_ONE), INT32_MAX);
        out->inputs[i] = shown->inputs;
        out->notes[i] = (uint8_t)s->report[i].notes;
    }
    out->torque_permille[DRIVES_MAX] = 0;
    out->lag_q16[DRIVES_MAX] = 0;
    out->inputs[DRIVES_MAX] = 0;
    out->notes[DRIVES_MAX] = 0;
}

/* The motion's time stands still where a cycle was too late; that of a record goes on. */
static void fill(sample_t *out, const snapshot_t *s, uint32_t cycle_us)
{
    out->cycle = s->cycle;
    out->time_us = s->now_us + (uint64_t)s->counters.late_cycles * cycle_us;
    out->state = (uint8_t)s->state;
    out->goal = (uint8_t)s->goal;
    out->fault = (uint8_t)s->fault.code;
    out->fault_axis = s->fault.axis;
    out->relays = s->relay_mask;
    out->intensity_percent = s->intensity_percent;
    out->bits = bits_of(s);
    out->flags = s->flags;
    out->frame_age_us = frame_age_us(s);
    memcpy(out->asked, s->asked.axis_q32, sizeof out->asked);
    memcpy(out->sent, s->sent.axis_q32, sizeof out->sent);
    memcpy(out->actual, s->plate.pose.axis_q32, sizeof out->actual);
    memcpy(out->sent_mm, s->extension_mm_q32, sizeof out->sent_mm);
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        out->drive[i] = (uint8_t)s->drive[i].state;
    }
    out->drive[DRIVES_MAX] = 0;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        out->actual_mm[i] = i < s->cylinders ? s->drive[i].actual_mm_q32 : 0;
    }
    out->sent_deg = s->angle_deg_q32;
    out->actual_deg = s->has_angle ? s->drive[s->cylinders].actual_mm_q32 : 0;
    fill_telemetry(out, s);
}

void samples_writer_add(samples_writer_t *self, const snapshot_t *snapshot, uint64_t wake_us, uint64_t work_us)
{
    union {
        sample_t record;
        uint64_t word[WORDS];
    } filled;
    if (self->header == NULL) {
        return;
    }
    fill(&filled.record, snapshot, self->header->cycle_us);
    filled.record.wake_us = at_most(wake_us);
    filled.record.work_us = at_most(work_us);
    char *records = (char *)self->header + HEADER_BYTES;
    uint64_t *place = (uint64_t *)(void *)(records + (size_t)self->at * sizeof(sample_t));
    self->at = self->at + 1u == self->header->capacity ? 0 : self->at + 1u;
    self->written++;
    __atomic_store_n(&place[0], 0, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE); /* what follows is not seen before the 0 */
    for (unsigned i = 1; i < WORDS; i++) {
        __atomic_store_n(&place[i], filled.word[i], __ATOMIC_RELAXED);
    }
    __atomic_store_n(&place[0], self->written, __ATOMIC_RELEASE);
    __atomic_store_n(&self->header->written, self->written, __ATOMIC_RELEASE);
}
