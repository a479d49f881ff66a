/* SPDX-License-Identifier: MIT
 * kin.c - the mechanism and its inverse solution: from a pose to cylinder extensions, in closed form.
 *
 * The pose places the motion reference point m of the plate and turns the plate about it:
 *     joint_i = (0, 0, zero height) + m + (x, y, z) + R (P_i - m),   R = Rz(yaw) Ry(pitch) Rx(roll)
 *     extension_i = |joint_i - B_i| - retracted length_i
 * A central guide leaves roll, pitch and the height of m. On a 3-RPS, hinges hold each plate joint in a vertical plane through
 * the base's Z axis; with the planes 120 degrees apart and the joints on a circle of radius r this asks for R12 = R21 and puts
 * the circle's centre at x = r (R11 - R22) / 2, y = -r R21, which in roll and pitch is
 *     cos(yaw) = (cos p + cos r) / (1 + cos p cos r),   sin(yaw) = sin p sin r / (1 + cos p cos r).
 *
 * Widths: sines and cosines Q62; rotation elements Q60; arms Q48, so that the upper half of a product is Q44; coordinates Q44
 * below 2^16 mm, so that squares stay below 2^120 and their sum below 2^122.
 */
#include "kin_internal.h"

#define COORDINATE_MAX_MM   4000
#define LENGTH_MAX_MM       8000
#define TRANSLATION_MAX_MM  8000
#define HINGE_ANGLE_MAX_DEG 90

static bool is_within(q16_t value_q16, int32_t limit_mm)
{
    return value_q16 >= -limit_mm * Q16_ONE && value_q16 <= limit_mm * Q16_ONE;
}

static bool is_point_within(const q16_t point_q16[3], int32_t limit_mm)
{
    return is_within(point_q16[0], limit_mm) && is_within(point_q16[1], limit_mm) && is_within(point_q16[2], limit_mm);
}

/* Cylinders of a kind; 0 if there is no such kind. */
static uint8_t count_cylinders(kin_kind_t kind)
{
    switch (kind) {
    case KIN_HEXAPOD:
        return 6;
    case KIN_TRIPOD:
    case KIN_TRIPOD_3RPS:
        return 3;
    }
    return 0;
}

static bool are_values_in_range(const kin_geometry_t *geometry, unsigned cylinders)
{
    bool is_good = geometry->zero_height_mm_q16 >= 0 && is_within(geometry->zero_height_mm_q16, LENGTH_MAX_MM) &&
                   is_point_within(geometry->mrp_mm_q16, COORDINATE_MAX_MM);
    for (unsigned i = 0; i < cylinders; i++) {
        is_good = is_good && is_point_within(geometry->base_mm_q16[i], COORDINATE_MAX_MM) &&
                  is_point_within(geometry->plate_mm_q16[i], COORDINATE_MAX_MM) && geometry->retracted_mm_q16[i] > 0 &&
                  is_within(geometry->retracted_mm_q16[i], LENGTH_MAX_MM);
    }
    return is_good;
}

/* A joint seen along the plane of its hinge: how far out, and how far beside the plane. */
static void hinge_coordinates(const q16_t joint_q16[3], unsigned cylinder, int64_t *out_q16, int64_t *beside_q16)
{
    q62_t sine, cosine;
    fx_sincos_deg(q32_from_int((int32_t)cylinder * 120), &sine, &cosine);
    *out_q16 = fx_mul_shift_fit(cosine, joint_q16[0], 62) + fx_mul_shift_fit(sine, joint_q16[1], 62);
    *beside_q16 = fx_mul_shift_fit(cosine, joint_q16[1], 62) - fx_mul_shift_fit(sine, joint_q16[0], 62);
}

static bool is_rounding(int64_t deviation_q16)
{
    return fx_abs(deviation_q16) <= KIN_HINGE_TOLERANCE_MM_Q16;
}

/* Whether the closed form of the 3-RPS describes this mechanism. */
static bool is_hinged(const kin_geometry_t *geometry)
{
    const q16_t radius_q16 = geometry->plate_mm_q16[0][0];
    bool is_good = radius_q16 >= Q16_ONE;
    for (unsigned i = 0; i < 3; i++) {
        int64_t base_out, base_beside, plate_out, plate_beside;
        hinge_coordinates(geometry->base_mm_q16[i], i, &base_out, &base_beside);
        hinge_coordinates(geometry->plate_mm_q16[i], i, &plate_out, &plate_beside);
        const int64_t height_difference = (int64_t)geometry->plate_mm_q16[i][2] - geometry->plate_mm_q16[0][2];
        is_good = is_good && base_out > 0 && is_rounding(base_beside) && is_rounding(plate_out - radius_q16) &&
                  is_rounding(plate_beside) && is_rounding(height_difference);
    }
    return is_good;
}

/* The smallest power of two of mm that no arm exceeds. */
static uint8_t find_reach_shift(const kin_t *self)
{
    uint64_t longest_q48 = 0;
    for (unsigned i = 0; i < self->cylinders; i++) {
        const uint64_t length_q48 = fx_sqrt_u128(fx_square3(self->arm_mm_q48[i]));
        longest_q48 = length_q48 > longest_q48 ? length_q48 : longest_q48;
    }
    uint8_t shift = 0;
    while ((UINT64_C(1) << (48 + shift)) < longest_q48) {
        shift++;
    }
    return shift;
}

static int64_t q44_from_q16(int64_t value_q16)
{
    return value_q16 * (INT64_C(1) << 28);
}

static int64_t q48_from_q16(int64_t value_q16)
{
    return value_q16 * (INT64_C(1) << 32);
}

hv_status_t kin_init(kin_t *self, const kin_geometry_t *geometry)
{
    const uint8_t cylinders = count_cylinders(geometry->kind);
    if (cylinders == 0 || !are_values_in_range(geometry, cylinders) ||
        (geometry->kind == KIN_TRIPOD_3RPS && !is_hinged(geometry))) {
        return HV_ERR_RANGE;
    }
    *self = (kin_t){.kind = geometry->kind, .cylinders = cylinders};
    for (unsigned axis = 0; axis < 3; axis++) {
        const int64_t mrp_q16 = geometry->mrp_mm_q16[axis];
        const bool is_height = axis == 2;
        self->centre_mm_q44[axis] = q44_from_q16(mrp_q16 + (is_height ? geometry->zero_height_mm_q16 : 0));
        self->hinge_offset_mm_q48[axis] = q48_from_q16(mrp_q16 - (is_height ? geometry->plate_mm_q16[0][2] : 0));
        for (unsigned i = 0; i < cylinders; i++) {
            self->base_mm_q44[i][axis] = q44_from_q16(geometry->base_mm_q16[i][axis]);
            self->arm_mm_q48[i][axis] = q48_from_q16(geometry->plate_mm_q16[i][axis] - mrp_q16);
        }
    }
    for (unsigned i = 0; i < cylinders; i++) {
        self->retracted_mm_q32[i] = q32_from_q16(geometry->retracted_mm_q16[i]);
    }
    self->hinge_half_radius_mm_q48 = geometry->plate_mm_q16[0][0] * (INT64_C(1) << 31);
    self->reach_shift = find_reach_shift(self);
    return HV_OK;
}

static bool is_between(q32_t value_q32, q32_t limit_q32)
{
    return value_q32 >= -limit_q32 && value_q32 <= limit_q32;
}

/* Whether the axes that the mechanism uses are in the range that the widths above allow. */
static bool is_pose_in_range(const kin_t *self, const pose_t *pose)
{
    const q32_t limit = q32_from_int(TRANSLATION_MAX_MM);
    const q32_t angle_limit = q32_from_int(HINGE_ANGLE_MAX_DEG);
    const q32_t *axis = pose->axis_q32;
    if (!is_between(axis[AXIS_Z], limit)) {
        return false;
    }
    switch (self->kind) {
    case KIN_HEXAPOD:
        return is_between(axis[AXIS_X], limit) && is_between(axis[AXIS_Y], limit);
    case KIN_TRIPOD:
        return true;
    case KIN_TRIPOD_3RPS:
        return is_between(axis[AXIS_ROLL], angle_limit) && is_between(axis[AXIS_PITCH], angle_limit);
    }
    return false;
}

/* Sine and cosine of the yaw of a 3-RPS from those of roll and pitch. Sums in Q61, as 1 + cos cos may be 2. */
static void set_hinged_yaw(kin_placement_t *at)
{
    const q62_t *sine = at->sine_q62, *cosine = at->cosine_q62;
    const int64_t divisor_q61 = Q62_ONE / 2 + fx_mul_shift_fit(cosine[AXIS_PITCH], cosine[AXIS_ROLL], 63);
    const int64_t cosine_sum_q61 = fx_shift_round(cosine[AXIS_PITCH], 1) + fx_shift_round(cosine[AXIS_ROLL], 1);
    const int64_t sine_product_q61 = fx_mul_shift_fit(sine[AXIS_PITCH], sine[AXIS_ROLL], 63);
    at->cosine_q62[AXIS_YAW] = fx_mul_div(cosine_sum_q61, Q62_ONE, divisor_q61);
    at->sine_q62[AXIS_YAW] = fx_mul_div(sine_product_q61, Q62_ONE, divisor_q61);
}

/* Sines and cosines of roll, pitch and the yaw that is commanded or follows. Out of line: where gcc sees that the yaw comes from
 * three places it takes its sign apart there, and then needs three multiplications for each product with it. */
HV_OUT_OF_LINE static void set_angles(const kin_t *self, const pose_t *pose, kin_placement_t *at)
{
    fx_sincos_deg(pose->axis_q32[AXIS_ROLL], &at->sine_q62[AXIS_ROLL], &at->cosine_q62[AXIS_ROLL]);
    fx_sincos_deg(pose->axis_q32[AXIS_PITCH], &at->sine_q62[AXIS_PITCH], &at->cosine_q62[AXIS_PITCH]);
    switch (self->kind) {
    case KIN_HEXAPOD:
        fx_sincos_deg(pose->axis_q32[AXIS_YAW], &at->sine_q62[AXIS_YAW], &at->cosine_q62[AXIS_YAW]);
        break;
    case KIN_TRIPOD:
        at->sine_q62[AXIS_YAW] = 0;
        at->cosine_q62[AXIS_YAW] = Q62_ONE;
        break;
    case KIN_TRIPOD_3RPS:
        set_hinged_yaw(at);
        break;
    }
}

/* R = Rz(yaw) Ry(pitch) Rx(roll). An upper half of a product of Q62 is Q60, at most 1 LSB too small: 1e-14 mm on the longest
 * arm. */
static void set_rotation(kin_placement_t *at)
{
    const q62_t sr = at->sine_q62[AXIS_ROLL], cr = at->cosine_q62[AXIS_ROLL];
    const q62_t sp = at->sine_q62[AXIS_PITCH], cp = at->cosine_q62[AXIS_PITCH];
    const q62_t sy = at->sine_q62[AXIS_YAW], cy = at->cosine_q62[AXIS_YAW];
    const q62_t sp_sr = fx_mul_high(sp, sr) * 4, sp_cr = fx_mul_high(sp, cr) * 4;
    int64_t(*r)[3] = at->rotation_q60;
    r[0][0] = fx_mul_high(cy, cp);
    r[0][1] = fx_mul_high(cy, sp_sr) - fx_mul_high(sy, cr);
    r[0][2] = fx_mul_high(cy, sp_cr) + fx_mul_high(sy, sr);
    r[1][0] = fx_mul_high(sy, cp);
    r[1][1] = fx_mul_high(sy, sp_sr) + fx_mul_high(cy, cr);
    r[1][2] = fx_mul_high(sy, sp_cr) - fx_mul_high(cy, sr);
    r[2][0] = -fx_shift_round(sp, 2);
    r[2][1] = fx_mul_high(cp, sr);
    r[2][2] = fx_mul_high(cp, cr);
}

/* One coordinate of R * v, at most 3 LSB too small. */
static int64_t rotate_q44(const int64_t row_q60[3], const int64_t v_q48[3])
{
    return fx_dot2_high(row_q60, v_q48) + fx_mul_high(row_q60[2], v_q48[2]);
}

static int64_t q44_from_q32(q32_t value_q32)
{
    return value_q32 * (1 << KIN_GUARD_BITS);
}

/* x and y of the motion reference point of a 3-RPS against pose zero. */
static void hinged_translation(const kin_t *self, const kin_placement_t *at, int64_t translation_q44[2])
{
    const int64_t(*r)[3] = at->rotation_q60;
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t *offset_q48 = self->hinge_offset_mm_q48;
        translation_q44[axis] = rotate_q44(r[axis], offset_q48) - fx_shift_down(offset_q48[axis], 4);
    }
    translation_q44[0] += fx_mul_high(r[0][0] - r[1][1], self->hinge_half_radius_mm_q48);
    translation_q44[1] -= fx_mul_high(2 * r[1][0], self->hinge_half_radius_mm_q48);
}

/* Where the motion reference point is. Added up in each case: values that are stored one by one and then read two at a time, as
 * an array of translations would be, wait for all stores before them. */
static void set_mrp(const kin_t *self, const pose_t *pose, kin_placement_t *at)
{
    const int64_t *centre_q44 = self->centre_mm_q44;
    int64_t *mrp_q44 = at->mrp_mm_q44;
    mrp_q44[2] = centre_q44[2] + q44_from_q32(pose->axis_q32[AXIS_Z]);
    switch (self->kind) {
    case KIN_HEXAPOD:
        mrp_q44[0] = centre_q44[0] + q44_from_q32(pose->axis_q32[AXIS_X]);
        mrp_q44[1] = centre_q44[1] + q44_from_q32(pose->axis_q32[AXIS_Y]);
        break;
    case KIN_TRIPOD:
        mrp_q44[0] = centre_q44[0];
        mrp_q44[1] = centre_q44[1];
        break;
    case KIN_TRIPOD_3RPS:
        hinged_translation(self, at, mrp_q44);
        mrp_q44[0] += centre_q44[0];
        mrp_q44[1] += centre_q44[1];
        break;
    }
}

hv_status_t kin_place(const kin_t *self, const pose_t *pose, kin_placement_t *placement)
{
    if (!is_pose_in_range(self, pose)) {
        return HV_ERR_RANGE;
    }
    set_angles(self, pose, placement);
    set_rotation(placement);
    set_mrp(self, pose, placement);
    return HV_OK;
}

void kin_leg(const kin_t *self, const kin_placement_t *placement, unsigned cylinder, kin_leg_t *leg)
{
    for (unsigned axis = 0; axis < 3; axis++) {
        leg->arm_mm_q44[axis] = rotate_q44(placement->rotation_q60[axis], self->arm_mm_q48[cylinder]);
        leg->vector_mm_q44[axis] = placement->mrp_mm_q44[axis] + leg->arm_mm_q44[axis] - self->base_mm_q44[cylinder][axis];
    }
    leg->length_mm_q44 = (int64_t)fx_sqrt_u128(fx_square3(leg->vector_mm_q44));
}

/* The point of the plate that is straight above its motion reference point, at the height of a joint. */
static void set_hub(const kin_placement_t *placement, int64_t height_mm_q48, int64_t hub_mm_q44[3])
{
    for (unsigned axis = 0; axis < 3; axis++) {
        hub_mm_q44[axis] = placement->mrp_mm_q44[axis] + fx_mul_high(placement->rotation_q60[axis][2], height_mm_q48);
    }
}

/* One coordinate of the vector of a leg, as kin_leg() has it. */
static inline int64_t vector_q44(const kin_t *self, const kin_placement_t *placement, const int64_t hub_mm_q44[3],
                                 unsigned cylinder, unsigned axis)
{
    const int64_t aside_q44 = fx_dot2_high(placement->rotation_q60[axis], self->arm_mm_q48[cylinder]);
    return hub_mm_q44[axis] + aside_q44 - self->base_mm_q44[cylinder][axis];
}

/* Squares of the lengths of all legs. Joints of a plate mostly are at one height: then a third of the products is worked out
 * once. */
HV_INNER_LOOP static void square_legs(const kin_t *self, const kin_placement_t *placement, fx_u128_t square_q88[CYLINDERS_MAX])
{
    const unsigned cylinders = self->cylinders;
    int64_t height_mm_q48 = self->arm_mm_q48[0][2];
    int64_t hub_mm_q44[3];
    set_hub(placement, height_mm_q48, hub_mm_q44);
    for (unsigned i = 0; i < cylinders; i++) {
        if (HV_RARELY(self->arm_mm_q48[i][2] != height_mm_q48)) {
            height_mm_q48 = self->arm_mm_q48[i][2];
            set_hub(placement, height_mm_q48, hub_mm_q44);
        }
        const int64_t vector_mm_q44[3] = {vector_q44(self, placement, hub_mm_q44, i, 0),
                                          vector_q44(self, placement, hub_mm_q44, i, 1),
                                          vector_q44(self, placement, hub_mm_q44, i, 2)};
        square_q88[i] = fx_square3(vector_mm_q44);
    }
}

hv_status_t kin_inverse(const kin_t *self, const pose_t *pose, q32_t extension_mm_q32[CYLINDERS_MAX])
{
    kin_placement_t placement;
    const hv_status_t status = kin_place(self, pose, &placement);
    if (status != HV_OK) {
        return status;
    }
    fx_u128_t square_q88[CYLINDERS_MAX];
    square_legs(self, &placement, square_q88);
    const unsigned cylinders = self->cylinders;
    for (unsigned i = 0; i < cylinders; i++) {
        extension_mm_q32[i] = fx_root_q32(square_q88[i]) - self->retracted_mm_q32[i];
    }
    return HV_OK;
}

/* The angle of -90 to 90 degrees that has this sine and cosine. Adding sin(angle - estimate) to the estimate leaves a sixth of
 * the cube of its error: from at worst 33 degrees to 1.8, to 0.0003, to nothing. */
static q32_t angle_of_deg(q62_t sine, q62_t cosine)
{
    q32_t angle_deg_q32 = fx_mul_shift_fit(sine, KIN_DEG_PER_RAD_Q56, 86);
    for (unsigned step = 0; step < 3; step++) {
        q62_t estimate_sine, estimate_cosine;
        fx_sincos_deg(angle_deg_q32, &estimate_sine, &estimate_cosine);
        const q62_t error_sine = fx_mul_shift_fit(sine, estimate_cosine, 62) - fx_mul_shift_fit(cosine, estimate_sine, 62);
        angle_deg_q32 += fx_mul_shift_fit(error_sine, KIN_DEG_PER_RAD_Q56, 86);
    }
    return angle_deg_q32;
}

/* The parasitic motion of a 3-RPS. */
static void constrain_hinged(const kin_t *self, pose_t *pose)
{
    const q32_t angle_limit = q32_from_int(HINGE_ANGLE_MAX_DEG);
    pose_t reachable = *pose;
    reachable.axis_q32[AXIS_ROLL] = fx_clamp(pose->axis_q32[AXIS_ROLL], -angle_limit, angle_limit);
    reachable.axis_q32[AXIS_PITCH] = fx_clamp(pose->axis_q32[AXIS_PITCH], -angle_limit, angle_limit);
    kin_placement_t at;
    int64_t translation_q44[2];
    set_angles(self, &reachable, &at);
    set_rotation(&at);
    hinged_translation(self, &at, translation_q44);
    pose->axis_q32[AXIS_YAW] = angle_of_deg(at.sine_q62[AXIS_YAW], at.cosine_q62[AXIS_YAW]);
    pose->axis_q32[AXIS_X] = fx_shift_round(translation_q44[0], KIN_GUARD_BITS);
    pose->axis_q32[AXIS_Y] = fx_shift_round(translation_q44[1], KIN_GUARD_BITS);
}

void kin_constrain(const kin_t *self, pose_t *pose)
{
    switch (self->kind) {
    case KIN_HEXAPOD:
        break;
    case KIN_TRIPOD:
        pose->axis_q32[AXIS_YAW] = 0;
        pose->axis_q32[AXIS_X] = 0;
        pose->axis_q32[AXIS_Y] = 0;
        break;
    case KIN_TRIPOD_3RPS:
        constrain_hinged(self, pose);
        break;
    }
}
