// SPDX-License-Identifier: GPL-2.0-or-later
//! Every tolerance of the tests of this crate, with its reason.

/// Inverse against genhexkins, relative to the machine's size, as in README:
/// both round a few hundred times in double precision, 2⁻⁵² each.
pub const INVERSE_REL: f64 = 1e-12;

/// Joints of a migrated configuration beside its module, in machine units or degrees: what is promised. Both round lengths
/// of some hundred units by some tens of operations.
pub const MIGRATED_JOINT: f64 = 1e-9;

/// sin² of a torsion beyond which genhexkins' arcsin is no reference: its slope
/// there is above 1/√(1 − 0.9999) = 100 and turns one rounding into hundreds.
pub const ARCSIN_MAX_SINE_SQUARED: f64 = 0.9999;

/// sin² between strut and joint axis below which the torsion loses digits in both
/// modules: normalising by it amplifies roundings by its root, here ten times.
pub const AXIS_MIN_CLEARANCE: f64 = 0.01;

/// |cos φ| at home that a random machine of the fold test must have: the module
/// refuses less than 0.1, which this test does not cover.
pub const FOLD_MIN_COSINE: f64 = 0.15;

/// cos(φ − φ₀) below which the module may refuse a strut: it does so beyond 170°, and forward
/// if its ball reaches there, here 4° earlier at most.
pub const HALF_TURN_COSINE: f64 = -0.97;

/// forward(inverse(p)) against p as pose distance, relative to the machine's
/// size, as in README.
pub const ROUND_TRIP_REL: f64 = 1e-10;

/// Distance from the requested pose, relative to size, above which a success
/// is another pose, called wrong in README.
pub const WRONG_REL: f64 = 1e-9;

/// sin² between strut and joint axis below which forward proves nothing and
/// refuses: it refuses within 1° of the axis (sin² 3e-4), plus the ball of its search.
pub const CERTIFIABLE_CLEARANCE: f64 = 2e-3;

/// Share of servo steps on machines of random geometry that forward may refuse:
/// a few of their poses are close to singular. Another pose is never allowed.
pub const RANDOM_MACHINE_REFUSALS: f64 = 1e-3;

/// Golden joints, in millimeters: computed with 40 digits to 4e-13, plus
/// some thousand roundings of lengths around 1000.
pub const GOLDEN_JOINT_MM: f64 = 1e-9;

/// Golden Jacobian elements, per mm and per degree.
pub const GOLDEN_JACOBIAN: f64 = 1e-9;

/// Step of the central differences: share of the machine's size, and radians.
pub const DIFFERENCE_SHARE: f64 = 2e-4;

/// Jacobian against central differences, relative to a row's largest element or 1. The
/// quotient rounds by some ten operations of 2⁻⁵² over the step, 2e-11; its own error,
/// step⁴/30 times a fifth derivative, is below 1e-10 with rods as near to their dead
/// points (cosine 0.1) as the workspaces bring them. Seen: 5e-11.
pub const DIFFERENCE: f64 = 1e-9;

/// Elements of a rotation matrix, against the one of the pose that forward must
/// find: ROUND_TRIP_REL turns 1250 mm into 1.3e-7 mm at a radius of 200 mm.
pub const FRAME: f64 = 1e-9;

/// Largest number of iterations one servo step away from the seed, as in README.
pub const NEAR_ITERATIONS: f64 = 3.0;

/// Equal joints computed by another order of operations, in
/// millimeters: some thousand roundings of lengths around 1000.
pub const SAME_JOINT_MM: f64 = 1e-9;

/// Components of a pose found again, millimeters and degrees: ROUND_TRIP_REL of
/// 1250 mm, over the 200 mm radius for an angle, with a factor for 1/cos B.
pub const SAME_COMPONENT: f64 = 1e-7;

/// Pose components of genhexkins that count as found again, in its own unit: it
/// stops at an absolute convergence-criterion of 1e-9 of joint length.
pub const GENHEXKINS_SAME: f64 = 1e-6;

/// Volume spanned by the unit vectors along three legs, below which the two poses of the
/// joints are near each other: it amplifies roundings by its inverse, here twenty times.
pub const PEER_LEAST_VOLUME: f64 = 0.05;

/// Cosine between a rod and the motion of its lower end, below which a servo step may
/// lead to the module's own limit of 0.05.
pub const PEER_LEAST_DRIVE: f64 = 0.1;

/// Residual of the pyramid's four rods due to one carriage with an error of a millimeter at home, in
/// millimeters of their carriages: computed with the golden rows (numpy, least squares
/// of the length misfits).
pub const PYRAMID_RESIDUAL: f64 = 0.2503;
/// Accuracy of [`PYRAMID_RESIDUAL`].
pub const PYRAMID_RESIDUAL_MM: f64 = 1e-3;

/// Residual of consistent joints, relative to the machine's size: the search stops at a
/// pose error of 1e-12, and a joint moves up to twenty times as far as the platform.
pub const SETTLED_RESIDUAL_REL: f64 = 2e-11;

/// Step from a least-squares pose, millimeters and degrees: it must exceed the error
/// of the pose, 1e-9, enough to change the misfit's square in double precision.
pub const LEAST_SQUARES_STEP: f64 = 1e-4;

/// Second differences of joints over the square of a cycle, relative to a limit: each joint
/// rounds by some 2e-13 of 1000 mm, which 250 us turn into 1e-5 mm/s², a few millionths of the
/// least limit drawn, and four joint values take part in it.
pub const LIMIT_ROUNDING: f64 = 1e-4;
