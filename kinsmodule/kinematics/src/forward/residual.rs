// SPDX-License-Identifier: GPL-2.0-or-later
//! Residuals of the legs at a pose of the platform, which the searches reduce to zero.

use crate::certificate::Motion;
use crate::fault::{Cause, Fault};
use crate::lanes::{both, inner, pair, put};
use crate::layout::Joints;
use crate::mechanism::{Chart, Mechanism};
use crate::nut::Torsion;
use crate::placed::{Displacement, Place, Placed};
use crate::pose::{Pose, Trigonometry, cayley_change, cayley_rate};
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};

/// Residuals at a pose, and the quantities from which the rows are computed.
#[derive(Clone, Copy)]
pub(crate) struct Measured<const N: usize> {
    pub placed: Placed<N>,
    /// Meaningful only on machines with a nut.
    pub(super) torsion: Torsion<N>,
    pub(super) residual: [f64; N],
}

impl<const N: usize> Measured<N> {
    pub(super) const ZERO: Self =
        Self { placed: Placed::ZERO, torsion: Torsion::ZERO, residual: [0.0; N] };
}

/// A factored pose, the origin of the chart.
pub(super) struct Stance<const N: usize> {
    pub(super) place: Place,
    pub(super) at: Measured<N>,
    pub(super) inverse: PseudoInverse<N>,
}

impl<const N: usize> Stance<N> {
    /// Creates a stance that is still to be measured and factored.
    #[inline(always)]
    pub(super) fn new(place: Place) -> Self {
        Self { place, at: Measured::ZERO, inverse: PseudoInverse::ZERO }
    }
}

/// Displacement of the platform to a point of the chart.
pub(super) struct Way {
    by: Displacement,
    /// Of the angles there, in a chart of angles.
    trig: Trigonometry,
}

impl<const N: usize> Mechanism<N> {
    /// Returns the joint values of the legs; lanes beyond the last leg repeat the first one.
    #[inline(always)]
    pub(super) fn lanes_of(&self, joints: &Joints) -> [f64; N] {
        let mut lanes = *joints.first_chunk::<N>().unwrap_or(&[f64::NAN; N]);
        if self.count() < N {
            for lane in lanes.iter_mut().skip(self.count()) {
                *lane = joints[0];
            }
            for lane in lanes.iter_mut().take(self.equations()).skip(self.count()) {
                *lane = self.size;
            }
        }
        lanes
    }

    /// Computes the motion of the legs between two targets; `None` if all are struts.
    pub(super) fn motion(&self, from: &Target<N>, to: &Target<N>) -> Option<Motion<N>> {
        if !self.moving {
            return None;
        }
        let chord = |i: usize| to.anchors.get(i) - from.anchors.get(i);
        let mut shift = Vector3::zeros();
        // With nut corrections the platform is not shifted: they would change along the path.
        if self.nut.is_none() {
            for i in 0..self.count() {
                shift += chord(i);
            }
            shift = self.of_legs(shift / self.count() as f64);
        }
        let mut motion = Motion { shift, travel: [0.0; N], second: [0.0; N], turn: [0.0; N] };
        for i in 0..N {
            let second = self.legs[i].second_derivatives(to.joints[i] - from.joints[i]);
            motion.travel[i] = (chord(i) - shift).norm() + second.anchor / 2.0;
            motion.second[i] = second.anchor + second.length;
            motion.turn[i] = second.turn;
        }
        for travel in motion.travel.iter_mut().take(self.equations()).skip(self.count()) {
            *travel = 0.0;
        }
        Some(motion)
    }

    /// Shifts a pose by a motion of the base anchors.
    pub(super) fn taken_along(&self, place: &Place, motion: Option<&Motion<N>>) -> Place {
        let shift = motion.map_or(Vector3::zeros(), |motion| motion.shift);
        Place { centre: place.centre + shift, ..*place }
    }

    /// Computes the displacement from a pose to the point `x` = (v, r ω) of the chart around it.
    #[inline(always)]
    pub(super) fn way(&self, place: &Place, x: &[f64; 6]) -> Way {
        let mut trig = Trigonometry::LEVEL;
        let change = match self.chart {
            Chart::Group => cayley_change(&self.turn(x)),
            Chart::Angles => {
                trig = self.turned(place, x).trigonometry();
                trig.rotation() * place.rotation.transpose() - Matrix3::identity()
            }
            Chart::Level => Matrix3::zeros(),
        };
        let [shift, _] = parts(x);
        Way { by: Displacement { shift, change }, trig }
    }

    /// Returns the rotation of a point of the chart, in radians.
    #[inline(always)]
    pub(super) fn turn(&self, x: &[f64; 6]) -> Vector3<f64> {
        let [_, turn] = parts(x);
        turn * self.per_radius
    }

    /// Computes the pose of the reference point at a point of the chart of angles.
    pub(super) fn turned(&self, place: &Place, x: &[f64; 6]) -> Pose {
        Pose { position: place.centre, angles: place.angles + self.turn(x) }
    }

    /// Computes the pose at a point of the chart around another pose.
    #[inline(always)]
    pub(super) fn moved(&self, place: &Place, x: &[f64; 6]) -> Place {
        match self.chart {
            Chart::Angles => self.moved_by_angles(place, x, &self.turned(place, x).trigonometry()),
            Chart::Group | Chart::Level => self.moved_by(place, x, &self.way(place, x)),
        }
    }

    /// Like [`Self::moved`], with a known displacement.
    #[inline(always)]
    pub(super) fn moved_by(&self, place: &Place, x: &[f64; 6], way: &Way) -> Place {
        match self.chart {
            Chart::Angles => self.moved_by_angles(place, x, &way.trig),
            Chart::Group | Chart::Level => {
                let Displacement { shift, change } = &way.by;
                let rotation = place.rotation + product(change, &place.rotation);
                Place { centre: place.centre + shift, rotation, angles: place.angles }
            }
        }
    }

    #[inline(always)]
    fn moved_by_angles(&self, place: &Place, x: &[f64; 6], trig: &Trigonometry) -> Place {
        let Pose { position, angles } = self.turned(place, x);
        let [shift, _] = parts(x);
        Place { centre: position + shift, rotation: trig.rotation(), angles }
    }

    /// Computes the angular velocity of a platform at the point `x` of the chart around a pose, displacement
    /// `way`, that moves by `step` in unit time.
    #[inline(always)]
    fn angular(&self, x: &[f64; 6], way: &Way, step: &[f64; 6]) -> Vector3<f64> {
        let rate = self.turn(step);
        match self.chart {
            Chart::Group => cayley_rate(&self.turn(x), &rate),
            Chart::Angles => way.trig.rate_map() * rate,
            Chart::Level => Vector3::zeros(),
        }
    }

    /// Computes the angular velocity at the center of the chart.
    #[inline(always)]
    fn angular_at_middle(&self, place: &Place, step: &[f64; 6]) -> Vector3<f64> {
        match self.chart {
            Chart::Group => self.turn(step),
            Chart::Angles => {
                let pose = Pose { position: place.centre, angles: place.angles };
                pose.trigonometry().rate_map() * self.turn(step)
            }
            Chart::Level => Vector3::zeros(),
        }
    }

    /// Computes the residual of every leg: length + correction − target length.
    #[inline(always)]
    pub(super) fn measure(
        &self,
        target: &Target<N>,
        place: &Place,
        at: &mut Measured<N>,
    ) -> Result<(), Fault> {
        self.place(&target.anchors, place, &mut at.placed);
        if let Some(nut) = &self.nut {
            at.torsion = nut.torsion(&at.placed.directions(), &place.rotation);
        }
        self.compare(target, at)
    }

    /// Computes the residuals at a point of the chart around a pose, with less work than [`Self::measure`].
    #[inline(always)]
    pub(super) fn measure_from(
        &self,
        about: &Stance<N>,
        x: &[f64; 6],
        target: &Target<N>,
        at: &mut Measured<N>,
    ) -> Result<Way, Fault> {
        let way = self.way(&about.place, x);
        about.at.placed.moved(&way.by, &mut at.placed);
        if let Some(rings) = self.rings() {
            rings.turn(&self.moved_by(&about.place, x, &way).rotation, &mut at.placed);
        }
        if let Some(couplings) = self.couplings() {
            couplings.write_lengths(&self.moved_by(&about.place, x, &way), &mut at.placed.length);
        }
        if let Some(nut) = &self.nut {
            nut.torsion_from(
                &about.at.torsion,
                &at.placed.directions(),
                &way.by.change,
                &mut at.torsion,
            );
        }
        self.compare(target, at)?;
        Ok(way)
    }

    /// Computes a Newton step from the center of the chart, corrected for the curvature of the legs' lengths
    /// (Chebyshev's method): the error of s − M F''(s, s)/2 is of one order higher than that of s.
    #[inline(always)]
    pub(super) fn bent_step(&self, about: &Stance<N>, step: &[f64; 6]) -> [f64; 6] {
        let [v, _] = parts(step);
        let omega = self.angular_at_middle(&about.place, step);
        let second = self.length_accelerations(about, [&v, &omega]);
        along(step, -0.5, &about.inverse.solve(&second))
    }

    /// Computes the second derivatives of the legs' lengths while the platform moves at `v` and turns at `omega`.
    #[inline(always)]
    fn length_accelerations(&self, about: &Stance<N>, [v, omega]: [&Vector3<f64>; 2]) -> [f64; N] {
        let mut second = about.at.placed.length_accelerations(v, omega);
        if let Some(rings) = self.rings() {
            rings.bend(&about.place, &about.at.placed, [v, omega], &mut second);
        }
        if let Some(couplings) = self.couplings() {
            couplings.write_accelerations(&about.place, [v, omega], &mut second);
        }
        second
    }

    /// Computes Newton's step from a point `x` of the chart, displacement `way`, with the factorization at its center.
    ///
    /// With the rows J there and J' here, M = J⁻¹: s = −M F, corrected once by the
    /// remainder: s − M (F + J' s). That leaves ‖1 − M J'‖² of the error, as little as two steps with
    /// the old factorization, for one measurement. The nut's share of the rows
    /// is small and kept as it was.
    #[inline(always)]
    pub(super) fn refined_step(
        &self,
        about: &Stance<N>,
        (x, way): (&[f64; 6], &Way),
        at: &Measured<N>,
    ) -> [f64; 6] {
        let step = newton_step(&about.inverse, &at.residual);
        let [v, _] = parts(&step);
        let mut left = at.placed.length_rates(&v, &self.angular(x, way, &step));
        if let Some(couplings) = self.couplings() {
            let place = self.moved_by(&about.place, x, way);
            couplings.write_rates(&place, [&v, &self.angular(x, way, &step)], &mut left);
        }
        // J s = −F: without a nut, J is not needed.
        let was = match self.nut {
            Some(_) => self.rates_at_middle(about, &step).map(|v| -v),
            None => at.residual,
        };
        for i in (0..N).step_by(2) {
            let sum = pair(&left, i) + pair(&was, i);
            put(&mut left, i, sum);
        }
        along(&step, -1.0, &about.inverse.solve(&left))
    }

    /// Computes the rates of the lengths at the center of the chart.
    fn rates_at_middle(&self, about: &Stance<N>, step: &[f64; 6]) -> [f64; N] {
        let [v, _] = parts(step);
        let omega = self.angular_at_middle(&about.place, step);
        let mut rates = about.at.placed.length_rates(&v, &omega);
        if let Some(couplings) = self.couplings() {
            couplings.write_rates(&about.place, [&v, &omega], &mut rates);
        }
        rates
    }

    /// Computes the residuals of lengths and torsions; refuses legs for which they are undefined.
    #[inline(always)]
    pub(super) fn compare(&self, target: &Target<N>, at: &mut Measured<N>) -> Result<(), Fault> {
        self.refuse_short_legs(&at.placed.length)?;
        let mut corrections = [0.0; N];
        if let Some(nut) = &self.nut {
            nut.refuse_along_axis(&at.torsion)?;
            corrections = nut.corrections(&at.torsion);
        }
        for i in (0..N).step_by(2) {
            let length = pair(&at.placed.length, i) + pair(&corrections, i);
            let off = length - pair(&target.length, i);
            put(&mut at.residual, i, off * pair(&self.present, i));
        }
        Ok(())
    }

    pub(super) fn measured(&self, target: &Target<N>, place: &Place) -> Result<Measured<N>, Fault> {
        let mut at = Measured::ZERO;
        self.measure(target, place, &mut at)?;
        Ok(at)
    }

    /// Returns the torsion if the machine has any.
    pub(super) fn torsion_of<'a>(&self, at: &'a Measured<N>) -> Option<&'a Torsion<N>> {
        self.nut.is_some().then_some(&at.torsion)
    }

    /// Computes the rows of the residuals in the chart, column by column.
    #[inline(always)]
    pub(super) fn columns(&self, at: &Measured<N>, place: &Place) -> [[f64; N]; 6] {
        self.charted_rows(&at.placed, self.torsion_of(at), place)
    }

    #[inline(always)]
    pub(super) fn factor(
        &self,
        at: &Measured<N>,
        place: &Place,
        inverse: &mut PseudoInverse<N>,
    ) -> Result<(), Fault> {
        let regular = inverse.renew(&self.active, self.columns(at, place));
        match regular.unwrap_or_else(|| self.factor_flat(at, place, inverse)) {
            true => Ok(()),
            false => Err(Cause::Singular.into()),
        }
    }

    /// Factors if the fast path cannot. Recomputes the columns, which is faster than keeping them.
    fn factor_flat(&self, at: &Measured<N>, place: &Place, inverse: &mut PseudoInverse<N>) -> bool {
        inverse.renew_by_columns(&self.active, &self.columns(at, place))
    }

    /// Measures and factors at the pose of a stance.
    #[inline(always)]
    pub(super) fn settle(&self, target: &Target<N>, stance: &mut Stance<N>) -> Result<(), Fault> {
        self.measure(target, &stance.place, &mut stance.at)?;
        self.factor(&stance.at, &stance.place, &mut stance.inverse)
    }
}

#[inline(always)]
pub(super) fn newton_step<const N: usize>(
    inverse: &PseudoInverse<N>,
    residual: &[f64; N],
) -> [f64; 6] {
    along(&[0.0; 6], -1.0, &inverse.solve(residual))
}

/// Returns the translation of a point of the chart, and its rotation times the radius. Pairs, see `lanes`.
#[inline(always)]
fn parts(x: &[f64; 6]) -> [Vector3<f64>; 2] {
    let [a, b] = pair(x, 0).to_array();
    let [c, d] = pair(x, 2).to_array();
    let [e, f] = pair(x, 4).to_array();
    [Vector3::new(a, b, c), Vector3::new(d, e, f)]
}

/// Computes A B, written out because nalgebra's product is a function call.
#[inline(always)]
fn product(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Matrix3<f64> {
    let at = |i, j| a[(i, 0)] * b[(0, j)] + a[(i, 1)] * b[(1, j)] + a[(i, 2)] * b[(2, j)];
    Matrix3::new(
        at(0, 0),
        at(0, 1),
        at(0, 2),
        at(1, 0),
        at(1, 1),
        at(1, 2),
        at(2, 0),
        at(2, 1),
        at(2, 2),
    )
}

/// Computes x + share · y.
#[inline(always)]
pub(super) fn along(x: &[f64; 6], share: f64, y: &[f64; 6]) -> [f64; 6] {
    let mut sum = [0.0; 6];
    for k in (0..6).step_by(2) {
        put(&mut sum, k, pair(x, k) + both(share) * pair(y, k));
    }
    sum
}

#[inline(always)]
pub(super) fn norm<const M: usize>(v: &[f64; M]) -> f64 {
    sqrt(inner(v, v))
}

#[cfg(test)]
pub(super) mod tests {
    extern crate std;

    use super::*;
    use crate::certificate::tests::{CHARTS, machine, random, unit};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    /// A stance of a machine with the result of a step of this length.
    pub(crate) struct Trial {
        pub(crate) machine: Mechanism<6>,
        pub(crate) about: Stance<6>,
        pub(crate) target: Target<6>,
        pub(crate) step: [f64; 6],
    }

    impl Trial {
        /// Computes the residuals at a share of the step.
        fn at(&self, share: f64) -> Measured<6> {
            let mut at = Measured::ZERO;
            let x = self.step.map(|value| share * value);
            self.machine.measure_from(&self.about, &x, &self.target, &mut at).unwrap();
            at
        }
    }

    pub(crate) fn trial(rng: &mut Pcg64, coordinates: &[u8], length: f64) -> Option<Trial> {
        let (machine, place) = machine(rng, coordinates, false)?;
        let step = unit(rng, &machine).map(|value| value * length);
        let joints = machine.joints_at(&machine.moved(&place, &step)).ok()?;
        let target = machine.target(&joints).ok()?;
        let mut about = Stance::new(place);
        machine.settle(&target, &mut about).ok()?;
        // Excludes ill-conditioned random machines, whose condition would hide the effect.
        (about.inverse.inverse_norm() < 20.0).then_some(Trial { machine, about, target, step })
    }

    #[test]
    fn stretch_and_bend_are_the_first_and_second_derivatives_of_the_lengths() {
        // Second differences: rounding of a few hundred, divided by the square of the step.
        const STEP: f64 = 1e-2;
        for coordinates in [b"XYZABC".as_slice(), b"XYZ"] {
            let mut rng = Pcg64::seed_from_u64(31);
            let mut checked = 0;
            for _ in 0..400 {
                let Some(trial) = trial(&mut rng, coordinates, 1.0) else { continue };
                let lengths = |share: f64| trial.at(share).placed.length;
                let [v, _] = parts(&trial.step);
                let omega = trial.machine.angular_at_middle(&trial.about.place, &trial.step);
                let (low, middle, high) = (lengths(-STEP), lengths(0.0), lengths(STEP));
                let length_rates = trial.about.at.placed.length_rates(&v, &omega);
                let accelerations = trial.machine.length_accelerations(&trial.about, [&v, &omega]);
                for i in 0..6 {
                    let first = (high[i] - low[i]) / (2.0 * STEP);
                    let second = (high[i] + low[i] - 2.0 * middle[i]) / (STEP * STEP);
                    // Third and fourth derivatives add less, even for short legs.
                    assert!((length_rates[i] - first).abs() < 1e-4, "{} {first}", length_rates[i]);
                    assert!((accelerations[i] - second).abs() < 1e-4 + 1e-2 * second.abs());
                }
                checked += 1;
            }
            assert!(checked > 100, "{checked}");
        }
    }

    /// Computes geometric means over random machines of a chart: the error after a corrected first step as a
    /// share of that after Newton's, and after a refined second step as a share of that after one with the
    /// old factorization; also how often either leaves more.
    fn shares(coordinates: &[u8]) -> ([f64; 2], [u32; 2], f64) {
        let mut rng = Pcg64::seed_from_u64(32);
        let (mut logs, mut worse, mut count) = ([0.0; 2], [0; 2], 0.0);
        for _ in 0..2000 {
            let length = random(&mut rng, 0.1, 1.0);
            let Some(trial) = trial(&mut rng, coordinates, length) else { continue };
            let Trial { machine, about, target, step } = &trial;
            let off = |end: &[f64; 6]| norm(&along(end, -1.0, step));
            let first = newton_step(&about.inverse, &about.at.residual);
            let mut at = Measured::ZERO;
            machine.measure_from(about, &first, target, &mut at).unwrap();
            let chord = along(&first, 1.0, &newton_step(&about.inverse, &at.residual));
            let way = machine.way(&about.place, &first);
            let refined = along(&first, 1.0, &machine.refined_step(about, (&first, &way), &at));
            // Large enough not to be affected by rounding.
            if off(&chord) > 1e-9 {
                let shares = [
                    off(&machine.bent_step(about, &first)) / off(&first),
                    off(&refined) / off(&chord),
                ];
                for (k, share) in shares.into_iter().enumerate() {
                    logs[k] += libm::log(share);
                    worse[k] += u32::from(share >= 1.0);
                }
                count += 1.0;
            }
        }
        (logs.map(|sum| libm::exp(sum / count)), worse, count)
    }

    #[test]
    fn bent_and_refined_steps_leave_a_small_share_of_what_plain_ones_leave() {
        for coordinates in CHARTS {
            let (shares, worse, count) = shares(coordinates);
            let name = core::str::from_utf8(coordinates).unwrap();
            let [bent, refined] = shares;
            std::println!("{name}: {bent:.1e} {refined:.1e}, worse {worse:?} of {count}");
            assert!(count > 500.0, "{count}");
            assert!(refined < 0.01 && worse[1] == 0, "{name}: {refined} {worse:?}");
            // With two angles the axis of one rotates with the other, which is neglected.
            let two = coordinates.len() == 5;
            assert!(bent < if two { 0.5 } else { 0.01 }, "{name}: {bent}");
            assert!(two || worse[0] == 0, "{name}: {worse:?}");
        }
    }
}
