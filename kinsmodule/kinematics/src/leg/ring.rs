// SPDX-License-Identifier: GPL-2.0-or-later
//! Telescopic strut from a base anchor to a ring that rotates freely about the tool axis.
//!
//! The ring is a circle of radius r about an axis k through its center, both fixed in the platform
//! and k along the platform's Z. Its joint is a hinge along the circle, so that the ring rotates until
//! the strut lies in the plane of axis and base anchor. With ρ the distance of the base anchor from
//! the axis and h its height over the plane of the circle, both relative to the platform
//!
//! ```text
//! q = √((ρ − r)² + h²)
//! ```
//!
//! That is the distance to the nearest point p of the circle: |p − a| = q with c(q) = a and d(q) = q
//! as for any strut, but p slides along the circle while the platform moves. Because p minimizes
//! |p − a|, its own motion along the circle does not change that length to first order, so
//! the gradient is that of a strut to the platform's point that presently coincides with p,
//! u · (v + ω × p) = q'. To second order it does: with y the velocity of the platform's point
//! at the base anchor, and e the direction of the circle at p
//!
//! ```text
//! q'' = q''(strut to p) − (r/ρ) (e · y)²/q
//! ```
//!
//! (minimum over the angle ψ of the ring: q'' = g_xx − g_xψ²/g_ψψ, g_ψψ = r ρ/q, g_xψ = ∓ (r/q)
//! e · y). The module `rings` computes it in lanes; bounds for a ball of poses are in `certificate`.
//!
//! Dead points: at ρ = 0 the tool axis passes through the base anchor, every point of the circle is
//! equally near, and the angle of the ring is undefined; at q = 0 the strut has no length. *Branch*:
//! the near side of the circle. The far side, √((ρ + r)² + h²), corresponds to −r in place of r, which is
//! refused. For ρ < r the base anchor is within the cylinder over the ring and the strut would
//! have to lean outwards: refused as well, and with it ρ = 0 for every ring except radius 0,
//! which is a point without sides.

use super::Refusal;
use crate::fault::Cause;

/// Parameters of a strut on a ring besides its base anchor and the center of its ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingGeometry {
    /// Radius of the ring about an axis along the platform's Z, machine units; 0 is a point.
    pub radius: f64,
}

/// Checks the radius.
pub(super) fn radius(given: &RingGeometry) -> Result<f64, Refusal> {
    if given.radius >= 0.0 { Ok(given.radius) } else { Err((Cause::RingNegative, given.radius)) }
}
