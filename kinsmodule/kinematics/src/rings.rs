// SPDX-License-Identifier: GPL-2.0-or-later
//! Rings that rotate freely about the tool axis, in lanes: the ends of their struts, see
//! [`crate::leg::ring`].

use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, both, cross, dot, pair, put, scaled, sum, times, wide};
use crate::placed::{Place, Placed};
use libm::{hypot, sqrt};
use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

/// The rings of a machine; legs that end at a point have radius 0.
#[derive(Clone, Copy)]
pub(crate) struct Rings<'a, const N: usize> {
    pub radius: &'a [f64; N],
    /// Their centers about the reference point, in the platform frame.
    pub centre: &'a Lanes3<N>,
    /// 1 over the platform radius; 0 if the platform never rotates.
    pub per_radius: f64,
}

/// Two base anchors relative to their rings.
struct Seen {
    /// From the reference point to the centers of the rings.
    centre: [f64x2; 3],
    /// From the reference point to the base anchors.
    base: [f64x2; 3],
    /// From the rings' axes to the base anchors, perpendicular to the axes.
    outward: [f64x2; 3],
    /// The length of that.
    rho: f64x2,
}

impl<const N: usize> Rings<'_, N> {
    /// Computes legs i and i + 1, which `placed` may have anywhere on their rings, or at their centers.
    #[inline(always)]
    fn seen(&self, rotation: &Matrix3<f64>, placed: &Placed<N>, i: usize) -> Seen {
        let centre = times(rotation, &self.centre.pair(i));
        let (arm, span) = (placed.arms.pair(i), placed.span.pair(i));
        let base: [f64x2; 3] = core::array::from_fn(|k| arm[k] - span[k]);
        let from_centre: [f64x2; 3] = core::array::from_fn(|k| base[k] - centre[k]);
        let axis = wide(&axis_of(rotation));
        let outward = sum(&from_centre, &scaled(&axis, -dot(&from_centre, &axis)));
        Seen { centre, base, outward, rho: dot(&outward, &outward).sqrt() }
    }

    /// Rotates the rings until their struts are shortest.
    pub fn turn(&self, rotation: &Matrix3<f64>, placed: &mut Placed<N>) {
        for i in (0..N).step_by(2) {
            let seen = self.seen(rotation, placed, i);
            // If the axis passes through the base anchor, the direction is undefined.
            let share =
                seen.rho.simd_gt(both(0.0)).select(pair(self.radius, i) / seen.rho, both(0.0));
            let arm = sum(&seen.centre, &scaled(&seen.outward, share));
            placed.arms.put(i, arm);
            placed.put(i, core::array::from_fn(|k| arm[k] - seen.base[k]));
            put(&mut placed.rho, i, seen.rho);
        }
    }

    /// Subtracts the effect of the rings' rotation from the second derivatives of the lengths
    /// while the platform moves at `v` and rotates at `omega`.
    pub fn bend(
        &self,
        place: &Place,
        placed: &Placed<N>,
        [v, omega]: [&Vector3<f64>; 2],
        second: &mut [f64; N],
    ) {
        let axis = wide(&axis_of(&place.rotation));
        for i in (0..N).step_by(2) {
            let seen = self.seen(&place.rotation, placed, i);
            let per_rho = seen.rho.simd_gt(both(0.0)).select(both(1.0) / seen.rho, both(0.0));
            let along = scaled(&cross(&axis, &seen.outward), per_rho);
            let speed = dot(&along, &sum(&wide(v), &cross(&wide(omega), &seen.base)));
            let taken = pair(self.radius, i) * per_rho * speed * speed * placed.curved(i);
            put(second, i, pair(second, i) - taken);
        }
    }

    /// Bounds, within a ball of radius `reach` of poses, whose base anchors move by `travel` in addition:
    /// the largest r/ρ of leg `i`, and the largest speed of the platform's point at its base
    /// anchor. `None` if the tool axis may reach the base anchor.
    pub fn widened(
        &self,
        placed: &Placed<N>,
        i: usize,
        reach: f64,
        travel: f64,
    ) -> Option<Widened> {
        // The compiler knows this bound.
        let i = i.min(N - 1);
        if !(self.radius[i] > 0.0) {
            return Some(Widened { ratio: 0.0, speed: 0.0 });
        }
        let base = placed.arms.get(i) - placed.span.get(i);
        let turning = (base.norm() + reach + travel) * self.per_radius;
        let speed = sqrt(1.0 + turning * turning);
        let ratio = self.ratio(placed, i, speed * reach + travel)?;
        Some(Widened { ratio, speed })
    }

    /// Computes r/ϱ of leg `i` if its base anchor may be nearer to the axis by `nearer`; `None` if the axis
    /// may reach it.
    pub fn ratio(&self, placed: &Placed<N>, i: usize, nearer: f64) -> Option<f64> {
        let i = i.min(N - 1);
        if !(self.radius[i] > 0.0) {
            return Some(0.0);
        }
        let rho = placed.rho[i] - nearer;
        (rho > 0.0).then(|| self.radius[i] / rho)
    }

    /// Refuses poses whose base anchors are within the cylinders over their rings.
    pub fn refuse_within(&self, placed: &Placed<N>, count: usize) -> Result<(), Fault> {
        for i in 0..count.min(N) {
            if !(placed.rho[i] >= self.radius[i]) {
                return Err(Fault::of_leg(Cause::AxisAtAnchor, i, placed.rho[i]));
            }
        }
        Ok(())
    }

    /// Returns the distance of the ring's farthest point from the reference point.
    pub fn farthest(&self, i: usize) -> f64 {
        let i = i.min(N - 1);
        let centre = self.centre.get(i);
        hypot(hypot(centre.x, centre.y) + self.radius[i], centre.z)
    }
}

/// Returns the tool axis in base.
#[inline(always)]
fn axis_of(rotation: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(rotation[(0, 2)], rotation[(1, 2)], rotation[(2, 2)])
}

/// Bounds of a ring's rotation, see [`Rings::widened`].
pub(crate) struct Widened {
    /// Radius divided by distance from the axis.
    pub ratio: f64,
    /// Per unit of motion in the chart.
    pub speed: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few roundings of numbers below 20.
    const ROUNDING: f64 = 1e-14;

    /// Passes on rings of radius 3 that are 1 over the reference point, and points there.
    fn with_rings<T>(see: impl FnOnce(&Rings<4>) -> T) -> T {
        let centre = Lanes3::from_fn(|_| Vector3::new(0.0, 0.0, 1.0));
        see(&Rings { radius: &[3.0, 3.0, 0.0, 0.0], centre: &centre, per_radius: 0.5 })
    }

    /// Creates legs from these base anchors, about a reference point in the origin.
    fn legs(bases: [[f64; 3]; 4], rotation: &Matrix3<f64>) -> Placed<4> {
        let mut placed = Placed::ZERO;
        for (i, base) in bases.into_iter().enumerate() {
            placed.span.set(i, -Vector3::from(base));
        }
        with_rings(|rings| rings.turn(rotation, &mut placed));
        placed
    }

    #[test]
    fn a_strut_ends_where_the_ring_is_nearest_whichever_point_it_was_at() {
        // The first base is 4 outside the ring of radius 3 and 3 below it: a strut of length 5. The second is equal, in
        // the direction (-0.6, 0.8).
        let bases = [[7.0, 0.0, -2.0], [-4.2, 5.6, 4.0], [3.0, 0.0, 5.0], [0.0, 0.0, 3.0]];
        let mut placed = legs(bases, &Matrix3::identity());
        for _ in 0..2 {
            for (i, (length, rho)) in
                [(5.0, 7.0), (5.0, 7.0), (5.0, 3.0), (2.0, 0.0)].into_iter().enumerate()
            {
                assert!((placed.length[i] - length).abs() < ROUNDING, "{i}: {:?}", placed.length);
                assert!((placed.rho[i] - rho).abs() < ROUNDING, "{i}: {:?}", placed.rho);
            }
            let off = placed.arms.get(1) - Vector3::new(-1.8, 2.4, 1.0);
            assert!(off.norm() < ROUNDING, "{off}");
            assert_eq!(placed.arms.get(3), Vector3::new(0.0, 0.0, 1.0));
            with_rings(|rings| rings.turn(&Matrix3::identity(), &mut placed));
        }
    }

    #[test]
    fn the_axis_of_a_ring_is_that_of_a_tilted_platform() {
        // Half a turn about the bisector of X and Z: up becomes X.
        let tilted = Matrix3::new(0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0);
        let placed = legs([[-2.0, 0.0, 7.0], [4.0, 5.6, -4.2], [0.0; 3], [0.0; 3]], &tilted);
        for i in 0..2 {
            assert!((placed.length[i] - 5.0).abs() < ROUNDING, "{i}: {:?}", placed.length);
        }
    }

    #[test]
    fn base_anchors_nearer_to_the_axis_than_the_ring_are_refused_and_named() {
        let refused = |rho: f64| {
            let bases = [[7.0, 0.0, 0.0], [0.0, rho, 9.0], [0.0; 3], [0.0; 3]];
            let placed = legs(bases, &Matrix3::identity());
            with_rings(|rings| rings.refuse_within(&placed, 4))
        };
        assert_eq!(refused(3.0), Ok(()));
        for rho in [2.999, 0.5, 0.0, f64::NAN] {
            let fault = refused(rho).expect_err("within the cylinder");
            assert_eq!((fault.cause, fault.number()), (Cause::AxisAtAnchor, Some(1)));
            assert!(fault.value == rho || rho.is_nan(), "{fault}");
        }
    }

    #[test]
    fn an_axis_through_the_base_anchor_leaves_numbers_and_is_refused() {
        let bases = [[0.0, 0.0, -2.0], [7.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
        let placed = legs(bases, &Matrix3::identity());
        assert_eq!((placed.rho[0], placed.length[0]), (0.0, 3.0));
        let fault = with_rings(|rings| rings.refuse_within(&placed, 4)).expect_err("no direction");
        assert_eq!(fault, Fault::of_leg(Cause::AxisAtAnchor, 0, 0.0));
    }

    #[test]
    fn a_ring_is_as_far_as_its_farthest_point() {
        let centre = Lanes3::from_fn(|i| Vector3::new(0.0, i as f64, 4.0));
        let rings = Rings { radius: &[3.0; 4], centre: &centre, per_radius: 1.0 };
        assert!((rings.farthest(0) - 5.0).abs() < ROUNDING);
        assert!((rings.farthest(3) - hypot(6.0, 4.0)).abs() < ROUNDING);
    }
}
