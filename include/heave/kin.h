/* SPDX-License-Identifier: MIT
 * kin.h - kinematics of hexapods and three-cylinder platforms: pose <-> cylinder extensions.
 * Inverse (pose to extensions) is closed-form; forward (extensions to pose) is a bounded Newton iteration.
 * A prepared kin_t is constant afterwards and may be shared; every function here is pure and does not block.
 */
#ifndef HEAVE_KIN_H
#define HEAVE_KIN_H

#include "heave/axes.h"

/** Kind of mechanism. */
typedef enum {
    KIN_HEXAPOD,    /**< six cylinders, six free axes */
    KIN_TRIPOD,     /**< three cylinders round a central guide that holds the motion reference point: x = y = yaw = 0 */
    KIN_TRIPOD_3RPS /**< three cylinders on hinges: yaw, x and y follow from roll and pitch (parasitic motion) */
} kin_kind_t;

/** The mechanism as measured. Joint centres in their own frames; lengths joint to joint. All mm, Q16.16.
 *  KIN_TRIPOD: the motion reference point must be the joint between guide and plate, as that is the point the plate turns about.
 *  KIN_TRIPOD_3RPS: each cylinder swings in a vertical plane through the base origin, the plane of cylinder 1 along +X, those of
 *  2 and 3 at 120 and 240 degrees towards +Y; plate joints on one circle round the plate's Z axis, all at one height; its radius
 *  is taken from joint 1. Deviations up to KIN_HINGE_TOLERANCE_MM_Q16 are taken as rounding, larger ones refused. */
typedef struct {
    kin_kind_t kind;
    q16_t base_mm_q16[CYLINDERS_MAX][3];   /**< base joints, base frame; |coordinate| <= 4000 mm */
    q16_t plate_mm_q16[CYLINDERS_MAX][3];  /**< plate joints, plate frame; |coordinate| <= 4000 mm */
    q16_t retracted_mm_q16[CYLINDERS_MAX]; /**< length at extension 0; (0, 8000] mm */
    q16_t zero_height_mm_q16;              /**< plate origin above base origin at pose zero; [0, 8000] mm */
    q16_t mrp_mm_q16[3]; /**< motion reference point, plate frame: poses place it and turn about it; +-4000 mm */
} kin_geometry_t;

/** Largest distance of a 3-RPS joint from the position that its hinge defines: 0.1 mm. */
#define KIN_HINGE_TOLERANCE_MM_Q16 ((q16_t)6554)

/** A mechanism prepared for solving. Members are private to src/kinematics. */
typedef struct {
    kin_kind_t kind;
    uint8_t cylinders;
    uint8_t reach_shift; /**< 2^reach_shift mm is at least the longest arm */
    int64_t base_mm_q44[CYLINDERS_MAX][3];
    int64_t arm_mm_q48[CYLINDERS_MAX][3]; /**< plate joint minus motion reference point; whole multiples of 2^32 */
    q32_t retracted_mm_q32[CYLINDERS_MAX];
    int64_t centre_mm_q44[3];         /**< motion reference point at pose zero, base frame */
    int64_t hinge_half_radius_mm_q48; /**< 3-RPS: half of that of the circle of plate joints */
    int64_t hinge_offset_mm_q48[3];   /**< 3-RPS: motion reference point minus centre of that circle, plate frame */
} kin_t;

/** Prepares a mechanism.
 *  @return HV_OK; HV_ERR_RANGE where a value is outside the ranges above. On error *self is unchanged. */
hv_status_t kin_init(kin_t *self, const kin_geometry_t *geometry) HV_MUST_CHECK;

/** Cylinders of the mechanism: 6 or 3. */
static inline unsigned kin_cylinders(const kin_t *self)
{
    return self->cylinders;
}

/** Extensions (length minus retracted length) that give a pose. Not limited to any stroke.
 *  Tripods use roll, pitch and z only. Worst error 0.51 LSB of Q32 (1.2e-10 mm) against the exact solution for the pose.
 *  @param pose translations within +-8000 mm; angles free, but roll and pitch of a 3-RPS within +-90 degrees
 *  @param extension_mm_q32 out: one per cylinder; entries beyond kin_cylinders() are not written
 *  @return HV_OK; HV_ERR_RANGE if a value used is outside its range (outputs unchanged). */
hv_status_t kin_inverse(const kin_t *self, const pose_t *pose, q32_t extension_mm_q32[CYLINDERS_MAX]) HV_MUST_CHECK;

/** Completes a pose with what the mechanism imposes: nothing for a hexapod; x = y = yaw = 0 for a tripod with a central guide;
 *  the parasitic yaw, x, y of the motion reference point for a 3-RPS (roll and pitch beyond +-90 degrees count as +-90). */
void kin_constrain(const kin_t *self, pose_t *pose);

/** Most steps kin_forward takes; from pose zero 4 or 5 are usual, from the pose of the last cycle 1 or 2. */
#define KIN_FORWARD_ITERATIONS_MAX 16u

/** Pose that gives the extensions, by Newton's method from a nearby pose.
 *  The result is within a few LSB of Q32, times the mechanism's own amplification, of the exact solution (1e-8 mm and deg on
 *  ordinary platforms), so that motion continues smoothly from it.
 *  @param extension_mm_q32 one per cylinder; retracted length + extension in (0, 65536] mm
 *  @param guess  where to start: the last known pose, or pose zero. Axes the mechanism imposes are ignored
 *  @param pose   out: the solution (complete, see kin_constrain); may be guess; unchanged on error
 *  @param iterations out, may be NULL: steps taken, also on error
 *  @return HV_OK; HV_ERR_RANGE if a length is outside its range, it did not converge or the mechanism is singular there. */
hv_status_t kin_forward(const kin_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], const pose_t *guess, pose_t *pose,
                        unsigned *iterations) HV_MUST_CHECK;

/** Smallest singularity margin for operation, 0.1. Here, cylinder forces and the effect of play and elasticity are ten times as
 * large as at margin 1, and below they grow without bound. Ordinary platforms have 0.2 to 1. */
#define KIN_MARGIN_LEAST_Q32 ((q32_t)429496730)

/** Singularity margin of a pose, 0 to 1: the smallest of
 *      (root mean square of the speeds of the cylinders) / (root mean square of the speeds of the plate joints)
 *  over all motions of the plate that the mechanism allows. It is the smallest singular value of the inverse Jacobian (cylinder
 *  speeds per plate motion) with the joints' speeds as the measure of a motion: free of units, and the same for every choice of
 *  scale, frame and motion reference point. At 0 the plate can move although every cylinder stands still. Its inverse is the
 *  largest factor from the cylinders' play to the joints' play. A characteristic length is not needed, as the speeds of points
 *  measure rotations and translations alike (Gosselin, "Dexterity indices for planar and spatial robotic manipulators", 1990;
 *  Voglewede and Ebert-Uphoff, "Overarching framework for measuring closeness to singularities of parallel manipulators", 2005).
 *  @return Q32, to 2^-16; 0 for a pose that kin_inverse() refuses and where a cylinder is shorter than 1 mm */
q32_t kin_margin(const kin_t *self, const pose_t *pose);

/** Whether the singularity margin of a pose is above a value; the same as comparing kin_margin() at a tenth of its cost.
 *  @param margin_q32 0 to 1 */
bool kin_has_margin(const kin_t *self, const pose_t *pose, q32_t margin_q32);

#endif
