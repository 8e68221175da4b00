// SPDX-License-Identifier: GPL-2.0-or-later
//! Legs: what joins base and platform. Each kind is one file with its equation.
//!
//! Every kind is a constraint |p − c(q)| = d(q) between the platform anchor p and a
//! *moving base anchor* c: a strut keeps c and changes d, a rod on a carriage or a
//! crank moves c and keeps d. The platform anchor is a point of the platform, or the nearest
//! point of a ring that turns freely about the tool axis. The solvers see only (c, d) and the unit
//! vector u = (p − c)/d; with q' = dq/dt
//!
//! ```text
//! u · ṗ = (u · ∂c/∂q + ∂d/∂q) q'
//! ```
//!
//! is the one gradient row that Jacobian and Newton's method need.
//!
//! Where the factor of q' is 0 the joint does not drive the leg: its *dead point*, where
//! the two joint values that one platform anchor may have meet. A rod (d constant) stands
//! square to the motion of its lower end there, and `side` tells carriage or crank
//! positions apart: the sign of u · ∂c/∂q is −side.

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
/// the dead point joint speeds grow beyond twenty times the platform's.
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
    /// Rod of fixed length on a turning arm.
    Crank = "crank",
    /// Telescopic strut to a ring about the tool axis.
    Ring = "ring",
}

/// What the integrator wrote for one leg, by kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegKind {
    /// Telescopic strut; joint value = length.
    Strut(StrutGeometry),
    /// Rod on a straight guide; joint value = place of the carriage along it.
    Slider(SliderGeometry),
    /// Rod on an arm that turns about a fixed axis; joint value = its angle in degrees.
    Crank(CrankGeometry),
    /// Telescopic strut to a ring that turns freely about the tool axis; joint value = length. The
    /// platform anchor is the centre of the ring.
    Ring(RingGeometry),
}

impl LegKind {
    /// Whether a joint value is an angle.
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

    /// Lengths of rod and arm, or radius of the ring; 0 for what the kind does not have.
    pub fn lengths(&self) -> [f64; 2] {
        match self {
            LegKind::Strut(_) => [0.0; 2],
            LegKind::Slider(s) => [s.rod, 0.0],
            LegKind::Crank(c) => [c.rod, Vector3::from(c.arm).norm()],
            LegKind::Ring(r) => [r.radius, 0.0],
        }
    }

    /// Every value that enters the hash, in its order, the kind's number first; zeros for the axes
    /// of a strut without a lead.
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

    /// Radius of the circle on which the platform anchor is free to slide; 0 for a point.
    pub const fn ring_radius(&self) -> f64 {
        match self {
            LegKind::Ring(ring) => ring.radius,
            LegKind::Strut(_) | LegKind::Slider(_) | LegKind::Crank(_) => 0.0,
        }
    }

    /// Whether the base anchor stands still.
    pub const fn stands(&self) -> bool {
        match self {
            LegKind::Strut(_) | LegKind::Ring(_) => true,
            LegKind::Slider(_) | LegKind::Crank(_) => false,
        }
    }

    /// The checked leg; what its ring does is no matter of the joint, see [`Self::ring_radius`].
    pub(crate) fn checked(&self) -> Result<Leg, Refusal> {
        match self {
            LegKind::Strut(_) => Ok(Leg::Strut),
            LegKind::Slider(s) => Slider::new(s).map(Leg::Slider),
            LegKind::Crank(c) => Crank::new(c).map(Leg::Crank),
            LegKind::Ring(r) => ring::radius(r).map(|_| Leg::Strut),
        }
    }
}

/// Why a leg refuses, and the number that helps to understand it.
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
    /// Its product with the way from moving base anchor to platform anchor is [`Leg::margin`] there; 0
    /// for a leg without dead point.
    pub towards: Vector3<f64>,
}

impl Leg {
    /// Native joint value for a platform anchor at `w` from the base anchor, |w| = `length`.
    pub fn joint(&self, w: &Vector3<f64>, length: f64) -> Result<f64, Refusal> {
        match self {
            Leg::Strut => Ok(strut::joint(length)),
            Leg::Slider(slider) => slider.joint(w),
            Leg::Crank(crank) => crank.joint(w),
        }
    }

    /// Where the native joint value `q` puts the moving base anchor, and the length it sets.
    pub fn drive(&self, q: f64) -> Result<Drive, Cause> {
        match self {
            Leg::Strut => strut::drive(q),
            Leg::Slider(slider) => Ok(slider.drive(q)),
            Leg::Crank(crank) => crank.drive(q),
        }
    }

    /// u · ∂c/∂q + ∂d/∂q at the native joint value `q`: speed of the platform anchor along
    /// `u`, the unit vector from moving base anchor to platform anchor, per joint rate.
    pub fn transmission(&self, q: f64, u: &Vector3<f64>) -> f64 {
        match self {
            Leg::Strut => strut::TRANSMISSION,
            Leg::Slider(slider) => slider.transmission(u),
            Leg::Crank(crank) => crank.transmission(q, u),
        }
    }

    /// How far a leg is from its dead point: its `transmission`, positive on its side, as a share of
    /// the largest one; for a rod −side · cos of the angle between u and the motion of the
    /// lower end. `None` for a leg without dead point.
    pub fn margin(&self, transmission: f64) -> Option<f64> {
        match self {
            Leg::Strut => None,
            Leg::Slider(slider) => Some(slider.margin(transmission)),
            Leg::Crank(crank) => Some(crank.margin(transmission)),
        }
    }

    /// [`Leg::margin`] of a leg without dead point: nothing is lost there. 0 of others.
    pub fn rest(&self) -> f64 {
        if *self == Leg::Strut { 1.0 } else { 0.0 }
    }

    /// Bound of the second derivative of the way of the lower end while the platform anchor moves, times
    /// length and third power of the margin: 1, and for a crank the length over the arm's beside it.
    pub fn bend(&self) -> f64 {
        match self {
            Leg::Strut | Leg::Slider(_) => 1.0,
            Leg::Crank(crank) => 1.0 + crank.ratio(),
        }
    }

    /// Second derivatives of the leg over any joint step of size `dq`.
    pub fn second_derivatives(&self, dq: f64) -> SecondDerivatives {
        match self {
            Leg::Strut | Leg::Slider(_) => SecondDerivatives::NONE,
            Leg::Crank(crank) => crank.second_derivatives(dq),
        }
    }
}

/// Second derivatives of a leg over a step that is run through in unit time: upper bounds for every
/// moment of it. Forward's proof rests on them.
pub(crate) struct SecondDerivatives {
    /// Largest change of [`Leg::margin`] while u stands still: the angle by which the
    /// direction of ∂c/∂q turns, radians, or the change of ∂d/∂q.
    pub turn: f64,
    /// |c''|: second derivative of the moving base anchor's place, a length.
    pub anchor: f64,
    /// |d''|: second derivative of the length that the joint sets.
    pub length: f64,
}

impl SecondDerivatives {
    /// Of a leg whose c and d are linear in q.
    const NONE: Self = Self { turn: 0.0, anchor: 0.0, length: 0.0 };
}

/// Checked rod length.
pub(crate) fn rod_length(rod: f64) -> Result<f64, Refusal> {
    if rod > 0.0 { Ok(rod) } else { Err((Cause::RodNotPositive, rod)) }
}

/// `side` as a factor.
pub(crate) fn side_sign(side: i32) -> Result<f64, Refusal> {
    match side {
        1 => Ok(1.0),
        -1 => Ok(-1.0),
        _ => Err((Cause::SideInvalid, f64::from(side))),
    }
}

/// Unit vector of a direction as given, any length; `None` where it has none.
pub(crate) fn direction(given: &[f64; 3]) -> Option<Vector3<f64>> {
    let v = Vector3::from(*given);
    let largest = v.amax();
    if !(largest > 0.0) {
        return None;
    }
    // Scaled first: the squares of very long or very short vectors leave f64's range.
    let scaled = v / largest;
    Some(scaled / scaled.norm())
}
