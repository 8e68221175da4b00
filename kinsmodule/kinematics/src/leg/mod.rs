// SPDX-License-Identifier: GPL-2.0-or-later
//! Legs: the connections between base and platform. Each kind is one file with its equation.
//!
//! Every kind is a constraint |p − c(q)| = d(q) between the platform anchor p and a
//! *moving base anchor* c: a strut keeps c and changes d, a rod on a carriage or a
//! crank moves c and keeps d. The platform anchor is a point of the platform, or the nearest
//! point of a ring that rotates freely about the tool axis. The solvers use only (c, d) and the unit
//! vector u = (p − c)/d; with q' = dq/dt
//!
//! ```text
//! u · ṗ = (u · ∂c/∂q + ∂d/∂q) q'
//! ```
//!
//! is the one gradient row that Jacobian and Newton's method need.
//!
//! Where the factor of q' is 0 the joint does not drive the leg: its *dead point*, where
//! the two joint values for one platform anchor coincide. A rod (d constant) is
//! perpendicular to the motion of its lower end there, and `side` distinguishes the two carriage or
//! crank positions: the sign of u · ∂c/∂q is −side.

pub mod crank;
pub mod ring;
pub mod slider;
pub mod strut;

pub use crank::CrankGeometry;
pub use ring::RingGeometry;
pub use slider::SliderGeometry;
pub use strut::StrutGeometry;

use crate::fault::Cause;
use crank::Crank;
use nalgebra::Vector3;
use slider::Slider;

/// Least |cos| of the angle between a rod and the motion of its lower end: nearer to
/// the dead point, joint speeds exceed twenty times the platform's.
pub const LEAST_DRIVE: f64 = 0.05;

macro_rules! kinds {
    ($($(#[$doc:meta])* $kind:ident = $name:literal,)*) => {
        /// A kind of leg, as the load parameter `legs=` names it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Kind {
            $($(#[$doc])* $kind,)*
        }

        impl Kind {
            /// Every kind of leg.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// Returns the name in the load parameter `legs=`.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)*
                }
            }
        }
    };
}

kinds! {
    /// Telescopic strut.
    Strut = "strut",
    /// Rod of fixed length on a carriage.
    Slider = "slider",
    /// Rod of fixed length on a rotating arm.
    Crank = "crank",
    /// Telescopic strut to a ring about the tool axis.
    Ring = "ring",
}

/// Parameters of one leg as the integrator wrote them, by kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegKind {
    /// Telescopic strut; joint value = length.
    Strut(StrutGeometry),
    /// Rod on a straight guide; joint value = position of the carriage along it.
    Slider(SliderGeometry),
    /// Rod on an arm that rotates about a fixed axis; joint value = its angle in degrees.
    Crank(CrankGeometry),
    /// Telescopic strut to a ring that rotates freely about the tool axis; joint value = length. The
    /// platform anchor is the center of the ring.
    Ring(RingGeometry),
}

impl LegKind {
    /// Returns whether a joint value is an angle.
    pub const fn is_angular(&self) -> bool {
        match self {
            LegKind::Crank(_) => true,
            LegKind::Strut(_) | LegKind::Slider(_) | LegKind::Ring(_) => false,
        }
    }

    /// Returns lead and axes of a strut's screw, and zeros for the kinds without a screw.
    pub fn screw(&self) -> StrutGeometry {
        match self {
            LegKind::Strut(strut) => *strut,
            LegKind::Slider(_) | LegKind::Crank(_) | LegKind::Ring(_) => StrutGeometry::default(),
        }
    }

    /// Returns the direction of the straight guide on which the lower end runs, of any length.
    pub const fn guide(&self) -> Option<[f64; 3]> {
        match self {
            LegKind::Slider(slider) => Some(slider.guide),
            LegKind::Strut(_) | LegKind::Crank(_) | LegKind::Ring(_) => None,
        }
    }

    /// Returns the length of the rod; `None` for the kinds whose length is the joint value.
    pub const fn rod(&mut self) -> Option<&mut f64> {
        match self {
            LegKind::Slider(slider) => Some(&mut slider.rod),
            LegKind::Crank(crank) => Some(&mut crank.rod),
            LegKind::Strut(_) | LegKind::Ring(_) => None,
        }
    }

    /// Returns the lengths of rod and arm, or the radius of the ring; 0 for lengths that the kind lacks.
    pub fn lengths(&self) -> [f64; 2] {
        match self {
            LegKind::Strut(_) => [0.0; 2],
            LegKind::Slider(s) => [s.rod, 0.0],
            LegKind::Crank(c) => [c.rod, Vector3::from(c.arm).norm()],
            LegKind::Ring(r) => [r.radius, 0.0],
        }
    }

    /// Passes on every value that enters the hash, in its order, starting with the kind's number; zeros for
    /// the axes of a strut without a lead.
    pub(crate) fn for_each_value(&self, mut see: impl FnMut(&[f64])) {
        match self {
            LegKind::Strut(s) => {
                let axes = [s.base_axis, s.platform_axis];
                let [base, platform] = if s.lead == 0.0 { [[0.0; 3]; 2] } else { axes };
                see(&[1.0]);
                see(&base);
                see(&platform);
                see(&[s.lead]);
            }
            LegKind::Slider(s) => {
                see(&[2.0]);
                see(&s.guide);
                see(&[s.rod, f64::from(s.side)]);
            }
            LegKind::Crank(c) => {
                see(&[3.0]);
                see(&c.axis);
                see(&[c.rod, f64::from(c.side)]);
                see(&c.arm);
            }
            LegKind::Ring(r) => {
                see(&[4.0]);
                see(&[r.radius]);
            }
        }
    }

    /// Returns the radius of the circle on which the platform anchor slides freely; 0 for a point.
    pub const fn ring_radius(&self) -> f64 {
        match self {
            LegKind::Ring(ring) => ring.radius,
            LegKind::Strut(_) | LegKind::Slider(_) | LegKind::Crank(_) => 0.0,
        }
    }

    /// Returns whether the base anchor is fixed.
    pub const fn stands(&self) -> bool {
        match self {
            LegKind::Strut(_) | LegKind::Ring(_) => true,
            LegKind::Slider(_) | LegKind::Crank(_) => false,
        }
    }

    /// Checks the leg; its ring does not affect the joint, see [`Self::ring_radius`].
    pub(crate) fn checked(&self) -> Result<Leg, Refusal> {
        match self {
            LegKind::Strut(_) => Ok(Leg::Strut),
            LegKind::Slider(s) => Slider::new(s).map(Leg::Slider),
            LegKind::Crank(c) => Crank::new(c).map(Leg::Crank),
            LegKind::Ring(r) => ring::radius(r).map(|_| Leg::Strut),
        }
    }
}

/// Cause of a refusal, and the number that helps to understand it.
pub(crate) type Refusal = (Cause, f64);

/// A checked leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Leg {
    Strut,
    Slider(Slider),
    Crank(Crank),
}

/// Moving base anchor (as displacement from the base anchor) and target length.
#[derive(Clone, Copy)]
pub(crate) struct Drive {
    pub displacement: Vector3<f64>,
    pub length: f64,
    /// Its product with the vector from moving base anchor to platform anchor is [`Leg::margin`] there; 0
    /// for a leg without dead point.
    pub towards: Vector3<f64>,
}

impl Leg {
    /// Computes the native joint value for a platform anchor at `w` from the base anchor, |w| = `length`.
    pub fn joint(&self, w: &Vector3<f64>, length: f64) -> Result<f64, Refusal> {
        match self {
            Leg::Strut => Ok(strut::joint(length)),
            Leg::Slider(slider) => slider.joint(w),
            Leg::Crank(crank) => crank.joint(w),
        }
    }

    /// Computes the moving base anchor for the native joint value `q`, and the length it sets.
    pub fn drive(&self, q: f64) -> Result<Drive, Cause> {
        match self {
            Leg::Strut => strut::drive(q),
            Leg::Slider(slider) => Ok(slider.drive(q)),
            Leg::Crank(crank) => crank.drive(q),
        }
    }

    /// Computes u · ∂c/∂q + ∂d/∂q at the native joint value `q`: speed of the platform anchor along
    /// `u`, the unit vector from moving base anchor to platform anchor, per joint rate.
    pub fn transmission(&self, q: f64, u: &Vector3<f64>) -> f64 {
        match self {
            Leg::Strut => strut::TRANSMISSION,
            Leg::Slider(slider) => slider.transmission(u),
            Leg::Crank(crank) => crank.transmission(q, u),
        }
    }

    /// Computes how far a leg is from its dead point: its `transmission`, positive on its side, as a share of
    /// the largest one; for a rod −side · cos of the angle between u and the motion of the
    /// lower end. `None` for a leg without dead point.
    pub fn margin(&self, transmission: f64) -> Option<f64> {
        match self {
            Leg::Strut => None,
            Leg::Slider(slider) => Some(slider.margin(transmission)),
            Leg::Crank(crank) => Some(crank.margin(transmission)),
        }
    }

    /// Returns [`Leg::margin`] for a leg without dead point; 0 for others.
    pub fn rest(&self) -> f64 {
        if *self == Leg::Strut { 1.0 } else { 0.0 }
    }

    /// Bounds the second derivative of the lower end's travel while the platform anchor moves, times
    /// length and third power of the margin: 1, and for a crank the ratio of rod to arm as well.
    pub fn bend(&self) -> f64 {
        match self {
            Leg::Strut | Leg::Slider(_) => 1.0,
            Leg::Crank(crank) => 1.0 + crank.ratio(),
        }
    }

    /// Returns the second derivatives of the leg over any joint step of size `dq`.
    pub fn second_derivatives(&self, dq: f64) -> SecondDerivatives {
        match self {
            Leg::Strut | Leg::Slider(_) => SecondDerivatives::NONE,
            Leg::Crank(crank) => crank.second_derivatives(dq),
        }
    }
}

/// Second derivatives of a leg over a step in unit time: upper bounds throughout the step.
/// Forward's proof depends on them.
pub(crate) struct SecondDerivatives {
    /// Largest change of [`Leg::margin`] for constant u: the angle by which the
    /// direction of ∂c/∂q rotates, radians, or the change of ∂d/∂q.
    pub turn: f64,
    /// |c''|: second derivative of the moving base anchor's position, a length.
    pub anchor: f64,
    /// |d''|: second derivative of the length set by the joint.
    pub length: f64,
}

impl SecondDerivatives {
    /// Values for a leg whose c and d are linear in q.
    const NONE: Self = Self { turn: 0.0, anchor: 0.0, length: 0.0 };
}

/// Checks a rod length.
pub(crate) fn rod_length(rod: f64) -> Result<f64, Refusal> {
    if rod > 0.0 { Ok(rod) } else { Err((Cause::RodNotPositive, rod)) }
}

/// Converts `side` to a factor.
pub(crate) fn side_sign(side: i32) -> Result<f64, Refusal> {
    match side {
        1 => Ok(1.0),
        -1 => Ok(-1.0),
        _ => Err((Cause::SideInvalid, f64::from(side))),
    }
}

/// Computes the unit vector of a direction as given, any length; `None` for a zero or non-finite one.
pub(crate) fn direction(given: &[f64; 3]) -> Option<Vector3<f64>> {
    let v = Vector3::from(*given);
    let largest = v.amax();
    if !(largest > 0.0) {
        return None;
    }
    // Scaled first: the squares of very long or very short vectors exceed f64's range.
    let scaled = v / largest;
    Some(scaled / scaled.norm())
}
