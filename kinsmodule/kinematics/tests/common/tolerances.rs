// SPDX-License-Identifier: GPL-2.0-or-later
//! Tolerances of the core's tests, each with its reason.

/// forward(inverse(x)) against x, relative to the machine's size: the guarantee of README.
pub const ROUND_TRIP: f64 = 1e-10;

/// A success farther than this from the right pose, relative to size, is another pose:
/// ten times the tolerance of the round trip.
pub const WRONG: f64 = 1e-9;

/// L d of the ball that certifies a servo step: 0.060 is observed over 10⁶ poses. More means
/// that the bound of the legs' curvature has become looser.
pub const SERVO_REACH: f64 = 0.07;

/// Sub-steps from home: 52 are observed over 10⁵ poses, forward gives up at 96.
pub const SUB_STEPS_FROM_HOME: u32 = 60;

/// Joints against rows computed independently in double precision, mm: a few hundred
/// rounding errors of lengths near 1000 mm (2e-13 mm each).
pub const GOLDEN_JOINT: f64 = 1e-9;

/// Joints computed in two ways, per unit of the machine's size and of speed of the joint: some
/// four rounding errors in each way of values as long as the machine; 2.9 are observed over 600,000 poses.
pub const ROUNDED_JOINT: f64 = 8.0 * f64::EPSILON;

/// Jacobian against central differences with step 1e-4 (mm, degrees): rounding is
/// 2e-13 / 1e-4 = 2e-9 times the ratio of joint to platform speed, truncation step⁴
/// times fifth derivatives, which grow without bound toward a dead point.
pub const CENTRAL_DIFFERENCE: f64 = 1e-7;

/// Scaling by a power of two changes only exponents.
pub const EXACT: f64 = 0.0;

/// Largest speed that the look ahead allows, as a multiple of the speed that just suffices to brake for the path
/// ahead. It reserves 2 % of the joint speeds for the motion between its sampled poses; 1.025 is observed if a
/// rod comes near its dead point between two of them, which are checked again in every cycle.
pub const SPEED_BETWEEN_PLACES: f64 = 1.04;

/// The same at least: only these 2 % are lost, and rounding.
pub const SPEED_SHARE: f64 = 0.98 - 1e-6;
