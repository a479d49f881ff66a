/* SPDX-License-Identifier: MIT
 * stream_state.h - definition of stream_t. Members are private to src/stream; include stream.h instead.
 */
#ifndef HEAVE_STREAM_STATE_H
#define HEAVE_STREAM_STATE_H

#include "heave/stream.h"

enum {
    STREAM_GAPS = 24,       /**< intervals that are watched for another rate */
    STREAM_POINTS = 64,     /**< ring of points, a power of 2 */
    STREAM_EVIDENCE = 5,    /**< samples for a decision about one of them */
    STREAM_LOSSES_MAX = 4,  /**< so often it counts that a long interval was a loss */
    STREAM_STOOD_MAX = 3,   /**< for so many frames the values of a sender that freezes may stand */
    STREAM_MOVED_MAX = 2,   /**< so many frames in a row tell a step */
    STREAM_CAUGHT_MAX = 3,  /**< so often it counts that values caught up */
    STREAM_WINDOW_MAX = 10, /**< points in the longest mean of coarse values; the ring has room for three of them */
    STREAM_WEIGHTS = 3 * STREAM_WINDOW_MAX - 2 /**< points of a control point in that case */
};

/** The sender's time line; members are private to src/stream. */
typedef struct {
    uint64_t last_us;                  /**< arrival of the newest sample */
    int64_t late_us_q16;               /**< that arrival against the time line */
    int64_t period_us_q16;             /**< 0 while unknown */
    int64_t jitter_us_q16;             /**< recent lateness of the latest samples */
    int64_t margin_us_q16;             /**< waiting time for a sample beyond its time */
    int64_t per_us_q46;                /**< 1 / period: periods per us, Q46 */
    uint32_t gap_us[STREAM_GAPS];      /**< newest intervals, a ring; the first `gaps` are filled */
    uint16_t gap_periods[STREAM_GAPS]; /**< number of periods of each interval */
    unsigned gap_next;
    unsigned gaps;         /**< intervals in the ring that belong to the present rate */
    unsigned settled;      /**< samples used for the line */
    uint32_t hint_us;      /**< the period the sender states, 0 = none */
    uint32_t delay_max_us; /**< upper limit of the delay, margin included */
    unsigned memory;       /**< most samples that the line may use */
    int64_t drift_us_q16;  /**< mean lateness of the newest samples */
    int64_t rough_us_q16;  /**< largest recent change of the lateness between two samples */
    unsigned counted;      /**< samples that losses are counted in */
    int32_t lost_q16;      /**< lost samples for each that came */
    unsigned each;         /**< for a while, the sender sends one sample per this many periods */
    bool is_sparse;        /**< so sparse that the curve waits for each sample until the next one is here */
    unsigned stalled;      /**< samples at the usual pace that were too late to wait for */
} stream_clock_t;

/** Decides from the values to which time a sender's samples belong; members are private to src/stream. */
typedef struct {
    q32_t value_q32[STREAM_EVIDENCE][AXES_MAX]; /**< the newest samples as they came, the newest first */
    q32_t late_q32[STREAM_EVIDENCE];            /**< lateness of each against the line, in periods */
    q32_t shift_q32[STREAM_EVIDENCE];           /**< lateness of each against the line according to its value */
    int32_t index[STREAM_EVIDENCE];             /**< periods of each before the newest */
    unsigned count;
    unsigned axes;
    int64_t by_lateness_q32; /**< deviation from the neighbours that the lateness explains */
    int64_t off_q32;         /**< total deviation from the neighbours */
    int64_t moved_q32;       /**< deviation if the samples belonged to their arrivals */
    q32_t weight_q32;        /**< [0, Q32_ONE]: 0 by the line, 1 by arrivals */
} stream_evidence_t;

/** How the step of a motion follows from the two before it; private to src/stream. */
typedef struct {
    q32_t by_newest_q32; /**< [-1, 2] */
    q32_t by_before_q32; /**< [-1, 1] */
} stream_predictor_t;

/** Extrapolation of an axis where samples are missing; private to src/stream. */
typedef struct {
    q32_t step_q32;    /**< the newest step, guessed or not */
    q32_t before_q32;  /**< the step before it */
    q32_t first_q32;   /**< the first guessed step, before it slows down */
    q32_t most_q32;    /**< no guessed step is larger */
    uint32_t rise_q32; /**< share of its time in which the acceleration builds up, [0, 0.5] */
    int32_t reach_q16; /**< duration of the extrapolation, in periods */
    int32_t full_q16;  /**< periods of these before it slows down */
} stream_extrapolation_t;

/** Resolution of a sender's values on one axis; private to src/stream. */
typedef struct {
    q32_t quantum_q32; /**< 0: none, or too fine to distinguish from a smooth motion */
    q32_t found_q32;   /**< of the steps since the watch began, 0 = there were none */
    q32_t step_q32;    /**< the newest step, of one period */
    bool is_up;        /**< the newest change of the step was upwards */
    uint8_t turns;     /**< changes of the step, up and down in turn, since the watch began */
} stream_quantum_t;

/** The points of the curve, by index modulo the ring; members are private to src/stream. */
typedef struct {
    q32_t point_q32[STREAM_POINTS][AXES_MAX]; /**< best known value of each index: a sample, or the committed guess */
    bool is_sample[STREAM_POINTS];            /**< for the indices after head: the point is a sample */
    q32_t control_q32[AXES_MAX];  /**< the oldest of the four committed control points: point plus offset at that time */
    int64_t way_q36[3][AXES_MAX]; /**< distance from each of these four to the next */
    q32_t off_q32[AXES_MAX][3];   /**< offset: control point minus point at head, and its change per period and period^2 */
    q32_t low_q32[AXES_MAX];      /**< recent range of the motion, lower end: the offset never leads the curve out of it */
    q32_t high_q32[AXES_MAX];     /**< upper end */
    stream_extrapolation_t extrapolation[AXES_MAX];
    stream_predictor_t predictor; /**< of the guesses */
    stream_quantum_t quantum[AXES_MAX];
    uint32_t watched; /**< samples since the watch for a quantum began */
    int32_t window;   /**< each control point is a running mean of this many points, applied three times; 1: the point itself */
    uint8_t weight[STREAM_WEIGHTS]; /**< of the points in that mean, the newest first: 75 at most */
    int64_t period_cycles_q16;      /**< cycles in a period */
    int64_t lead_q32;               /**< distance of a control point ahead of its point, as share of the last step */
    q32_t mean_q32;                 /**< a point is replaced by a mean of some points to this share */
    q32_t led_q32;                  /**< share of the distance to the predicted point by which control points are led */
    uint32_t mean_points;           /**< number of points in that mean */
    int32_t reach_min_q16;          /**< shortest and longest time, in periods, of a motion without samples */
    int32_t reach_max_q16;
    int32_t change; /**< how much the points at head have changed since the curve passed them, in guesses; 0: not at all */
    q32_t was_q32[3][AXES_MAX]; /**< if changed: points at head and before it that the curve has passed */
    bool is_off;                /**< an axis has an offset */
    int64_t bandwidth_q32;      /**< rate at which the offset is taken back, per period */
    int64_t softest_q32;        /**< smallest bandwidth_q32 */
    int32_t age;                /**< samples since the stream began at rest, up to a maximum */
    int32_t patience;           /**< number of guesses after which the stream counts as ended */
    governor_limits_t limits[AXES_MAX];
    governor_t governor;
    int32_t scale_q16;          /**< factor by which the references will be multiplied, for the governor */
    q32_t newest_q32[AXES_MAX]; /**< the newest sample, as it came ... */
    q32_t last_q32[AXES_MAX];   /**< ... and at its place on the time line */
    uint32_t head;              /**< index of the newest point committed */
    int32_t ahead;              /**< index of the newest sample less head; negative where the curve is extrapolated */
    unsigned axes;
} stream_curve_t;

/** Selection of samples from a stream that is too fast; members are private to src/stream. */
typedef struct {
    uint64_t last_us;          /**< newest arrival, taken or not */
    uint32_t gaps_us;          /**< mean interval of arrivals, times 64 */
    uint32_t each;             /**< one of this many samples is taken */
    uint32_t each_taken;       /**< value of each when the last sample was taken */
    uint32_t passed;           /**< samples skipped since the last one that was taken */
    bool has_spare;            /**< the newest sample was not taken */
    q32_t spare_q32[AXES_MAX]; /**< that sample */
} stream_thin_t;

/** What is known of a sender's frames, for the decision what is a sample; members are private to src/stream. */
typedef struct {
    q32_t misfit_q32;  /**< recent distance of values from the predicted motion, in units of the speed limit */
    unsigned losses;   /**< long intervals in a row that were losses according to their values, up to a maximum */
    unsigned stood;    /**< frames in a row that came in time with the newest values again, up to a maximum */
    unsigned moved;    /**< frames in a row before these that came with new values, up to a maximum */
    unsigned caught;   /**< how much more often than not values have caught up after standing, up to a maximum */
    unsigned halves;   /**< frames that lay half-way between two of the line */
    uint32_t doubt_us; /**< the newest sample looks like an old one; for so long the one in whose place it is may come; 0: it does
                          not */
} stream_sample_t;

/** How often a sender repeats each value; members are private to src/stream. */
typedef struct {
    uint64_t began_us;    /**< arrival of the first of the equal samples */
    uint32_t run;         /**< equal samples so far */
    uint32_t each;        /**< repetitions of each value; 1: the sender does not repeat values */
    uint32_t frames;      /**< frames in the newest counted runs */
    uint32_t span_us;     /**< duration of these runs */
    uint32_t runs;        /**< number of these runs */
    uint32_t significant; /**< runs of these whose step is larger than rounding */
    uint32_t longest;     /**< longest of these runs */
} stream_repeat_t;

struct stream {
    uint32_t cycle_us;
    stream_style_t style;
    stream_phase_t phase;
    stream_thin_t thin;
    stream_repeat_t repeat;
    bool is_fresh;        /**< no reference given since the start */
    bool is_hidden;       /**< see stream_hide_start() */
    unsigned pair;        /**< number of samples so far that may become a stream */
    uint32_t pair_gap_us; /**< longest interval between them */
    uint64_t began_us;    /**< arrival of the first of them */
    stream_clock_t clock;
    stream_evidence_t evidence;
    stream_sample_t sample;
    stream_curve_t curve;
    q32_t between_q32; /**< render phase behind head, [0, 1) */
    q32_t rate_q32[2]; /**< periods per cycle behind the first and the second low-pass; the second is rendered */
    q32_t error_q32;   /**< how far rendering is behind its time, in periods */
    history_t previous[AXES_MAX];
    uint64_t back_us;          /**< when it came back after its last silence, 0: it has not been silent */
    q32_t left_q32[POSE_AXES]; /**< its last sample before that */
};

#endif
