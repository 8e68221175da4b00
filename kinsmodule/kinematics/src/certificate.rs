// SPDX-License-Identifier: GPL-2.0-or-later
//! The certificate: on which ball about a pose the leg lengths determine the pose.
//!
//! Chart at a pose (p₀, R₀): X = (p₀ + v, exp([ω]) R₀), with norm ‖(v, r ω)‖ and r
//! the platform radius. A platform anchor moves with |Ds| ≤ s₁ and |D²s| ≤ s₂, so
//! within a ball of radius ρ a leg of length l has
//!
//! ```text
//! |D²f| ≤ k = s₁²/l_min + s₂  (+ the nut term),   l_min = l − s₁ρ
//! ```
//!
//! With L = ‖J⁻¹‖_F √Σk² of the ball: if L ρ < 1, then ‖I − J⁻¹J(X)‖ < 1 on it, so
//! forward is one-to-one and J regular there. A solution at distance d with L(d) d < 1
//! is therefore the only one in its ball, and h = L η ≤ 1/2 (η = first Newton step, L of
//! the ball of radius 2η) proves a priori that the platform's path along the straight
//! joint path to the target stays inside (Newton-Kantorovich). Steps turn the platform
//! by Cayley's formula instead of exp: a smaller turn by at most |ω|³/12, which the
//! margin between 0.4 and 1/2 covers.

use crate::fault::{Cause, Fault};
use crate::machine::{Machine, Placed};
use crate::nut::{Ball, Twist};
use crate::qr::Qr;
use libm::sqrt;

/// Largest h = L η that counts as certified: Newton-Kantorovich allows 1/2, the rest
/// covers what a sub-step leaves unconverged.
pub(crate) const CERTIFIED: f64 = 0.4;

/// A pose whose ball is smaller than this share of the size is too near a singular one.
pub(crate) const CERTAIN_AT_ALL: f64 = 1e-6;

/// L of the ball of radius `rho`: 1/L bounds the ball on which legs determine the pose.
///
/// # Errors
/// Where the ball is too large for any statement: it reaches a leg of no length, or a
/// strut that points along one of its joint axes, or the edge of the nut correction.
#[inline]
pub(crate) fn flatness<const N: usize>(
    machine: &Machine<N>,
    placed: &Placed<N>,
    twist: Option<&Twist<N>>,
    qr: &Qr<N>,
    rho: f64,
) -> Result<f64, Fault> {
    let mut sum = 0.0;
    for i in 0..N {
        let k = curvature(machine, placed, twist, i, rho)?;
        sum += k * k;
    }
    Ok(qr.inverse_norm() * sqrt(sum))
}

/// k of leg `i`: bound of the second derivative of its residual within the ball.
#[inline]
fn curvature<const N: usize>(
    machine: &Machine<N>,
    placed: &Placed<N>,
    twist: Option<&Twist<N>>,
    i: usize,
    rho: f64,
) -> Result<f64, Fault> {
    let (s1, s2) = (machine.s1[i], machine.s2[i]);
    let shortest = placed.length[i] - s1 * rho;
    if !(shortest > 0.0) {
        return Err(Fault::of_leg(Cause::StrutTooShort, i, shortest));
    }
    let of_length = s1 * s1 / shortest + s2;
    let (Some(nut), Some(twist)) = (&machine.nut, twist) else { return Ok(of_length) };
    let ball = Ball { rho, radius: machine.radius, length: shortest, s1, s2 };
    let Some(of_nut) = nut.curvature(twist, i, &ball) else {
        return Err(Fault::of_leg(Cause::StrutAlongAxis, i, twist.room(i)));
    };
    Ok(of_length + of_nut)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Coordinates, Geometry, LegGeometry};
    use crate::leg::StrutGeometry;
    use nalgebra::{Matrix3, Rotation3, Vector3};
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    fn random(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
        low + (high - low) * rng.random::<f64>()
    }

    fn vector(rng: &mut Pcg64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| random(rng, -1.0, 1.0))
    }

    /// A random machine of six screws about one metre above its base.
    fn machine(rng: &mut Pcg64) -> Machine<6> {
        let legs = core::array::from_fn(|_| {
            let base = vector(rng) * 500.0;
            let platform = vector(rng) * 200.0;
            let strut = StrutGeometry {
                base_axis: vector(rng).into(),
                platform_axis: vector(rng).into(),
                lead: random(rng, -50.0, 50.0),
            };
            LegGeometry::strut(base.into(), platform.into(), strut)
        });
        let geometry = Geometry { legs, home: None, coordinates: Coordinates::XYZABC };
        Machine::freeze(&geometry, &[0.0; 6]).expect("random anchors are not degenerate")
    }

    /// A point of the chart, or a direction in it: (v, r ω).
    type Chart = (Vector3<f64>, Vector3<f64>);

    fn unit(rng: &mut Pcg64) -> Chart {
        let (v, w) = (vector(rng), vector(rng));
        let length = sqrt(v.norm_squared() + w.norm_squared());
        (v / length, w / length)
    }

    /// Second derivative of every joint at a point of the chart, by differences.
    fn bending(
        machine: &Machine<6>,
        centre: &Vector3<f64>,
        r: &Matrix3<f64>,
        point: &Chart,
        direction: &Chart,
    ) -> Option<[f64; 6]> {
        // Step in units of the ray: rounding 2e-13/1e-2² stays below 1e-8 of k's 1e-3.
        const STEP: f64 = 0.05;
        let joints = |s: f64| {
            let turn = (point.1 + direction.1 * s) / machine.radius;
            let rotation = Rotation3::new(turn).matrix() * r;
            let position = centre + point.0 + direction.0 * s - rotation * machine.centroid;
            machine.joints_at(&position, &rotation, &Vector3::zeros()).ok()
        };
        let (a, b, c) = (joints(-STEP)?, joints(0.0)?, joints(STEP)?);
        Some(core::array::from_fn(|i| (a[i] - 2.0 * b[i] + c[i]) / (STEP * STEP)))
    }

    #[test]
    fn no_direction_in_the_ball_bends_a_leg_more_than_the_bound_says() {
        let mut rng = Pcg64::seed_from_u64(11);
        let mut largest = 0.0_f64;
        let mut checked = 0;
        for _ in 0..4000 {
            let machine = machine(&mut rng);
            let centre = vector(&mut rng) * 100.0 + Vector3::new(0.0, 0.0, 900.0);
            let r = *Rotation3::new(vector(&mut rng) * 0.5).matrix();
            let rho = random(&mut rng, 0.1, 40.0);
            let placed = machine.placed(&machine.base, &centre, &r).unwrap();
            let Ok(twist) = machine.twist(&placed.directions(), &r) else { continue };
            // Differences reach a little beyond the point where they are taken.
            let away = random(&mut rng, 0.0, rho - 0.06);
            let (v, w) = unit(&mut rng);
            let point = (v * away, w * away);
            let direction = if rng.random() { (v, w) } else { unit(&mut rng) };
            let second = bending(&machine, &centre, &r, &point, &direction);
            let Some(second) = second else { continue };
            for i in 0..6 {
                if let Ok(k) = curvature(&machine, &placed, twist.as_ref(), i, rho) {
                    largest = largest.max(second[i].abs() / k);
                    checked += 1;
                }
            }
        }
        assert!(checked > 10_000, "{checked}");
        assert!(largest < 1.0, "{largest}");
        // A bound that is far too wide would be sound and useless.
        assert!(largest > 0.2, "{largest}");
    }
}
