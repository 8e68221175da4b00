// SPDX-License-Identifier: GPL-2.0-or-later
//! Telescopic strut from a base anchor to a ring that turns freely about the tool axis.
//!
//! The ring is a circle of radius r about an axis k through its centre, both fixed in the platform
//! and k along the platform's Z. Its joint is a hinge along the circle, so that the ring turns until
//! the strut lies in the plane of axis and base anchor. With ρ the distance of the base anchor from
//! the axis and h its height over the plane of the circle, both seen from the platform
//!
//! ```text
//! q = √((ρ − r)² + h²)
//! ```
//!
//! That is the distance to the nearest point p of the circle: |p − a| = q with c(q) = a and d(q) = q
//! as for any strut, but p slides along the circle while the platform moves. Where p is chosen so that
//! |p − a| is least, its own motion along the circle does not change that length (to first order), so
//! that the gradient is that of a strut to the point of the platform that p is at just now,
//! u · (v + ω × p) = q'. To second order it does: with y the speed of the platform's point that would
//! be at the base anchor, and e the direction of the circle at p
//!
//! ```text
//! q'' = q''(strut to p) − (r/ρ) (e · y)²/q
//! ```
//!
//! (least value over the turn ψ of the ring: q'' = g_xx − g_xψ²/g_ψψ, g_ψψ = r ρ/q, g_xψ = ∓ (r/q)
//! e · y). The module `rings` has it in lanes; bounds for a ball of poses are in `certificate`.
//!
//! Dead points: at ρ = 0 the tool axis runs through the base anchor, every point of the circle is as
//! near as any other, and the ring does not know where to turn; at q = 0 there is no strut. *Branch*:
//! the near side of the circle. The far side, √((ρ + r)² + h²), would be −r in place of r, which is
//! refused. Where ρ < r the base anchor stands within the cylinder over the ring and the strut would
//! have to lean outwards: refused as well, and with it ρ = 0 for every ring but that of radius 0,
//! which is a point and knows no side.

use super::Refusal;
use crate::fault::Cause;

/// What belongs to a strut on a ring beside its base anchor and the centre of its ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingGeometry {
    /// Radius of the ring about an axis along the platform's Z, machine units; 0 is a point.
    pub radius: f64,
}

/// Checked radius.
pub(super) fn radius(given: &RingGeometry) -> Result<f64, Refusal> {
    if given.radius >= 0.0 { Ok(given.radius) } else { Err((Cause::RingNegative, given.radius)) }
}
