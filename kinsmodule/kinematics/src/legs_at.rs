// SPDX-License-Identifier: GPL-2.0-or-later
//! The legs of a machine at a pose, in its lanes: the implementation of [`crate::At`].

use crate::fault::{Cause, Fault};
use crate::inverse::Placement;
use crate::lanes::{cross, dot, put, scaled, sum, wide};
use crate::layout::{Joints, MAX_JOINTS, MAX_LEGS, PerLeg};
use crate::mechanism::Mechanism;
use crate::nut::Torsion;
use crate::placed::Placed;
use crate::pose::{Pose, Trigonometry};
use crate::segment::Segment;
use crate::singular::{is_surely_above, smallest_singular_value};
use crate::target::Target;
use crate::trig::{DEGREES, RADIANS};
use core::cell::Cell;
use nalgebra::Vector3;

/// The legs of a machine at a pose.
pub(crate) struct LegsAt<'a, const N: usize> {
    pub machine: &'a Mechanism<N>,
    pub tool: Vector3<f64>,
    pub trig: Trigonometry,
    pub placement: Placement,
    pub corrections: [f64; N],
    /// Joint values of the legs, and the moving base anchors at these.
    pub target: Target<N>,
    /// The legs from there.
    pub placed: Placed<N>,
    /// Meaningful only on machines with a nut.
    torsion: Torsion<N>,
    gradients: Cell<Option<Result<[Gradient; N], Fault>>>,
    singular_value: Cell<Option<f64>>,
}

/// Gradient of one joint value.
#[derive(Clone, Copy)]
pub(crate) struct Gradient {
    /// Per velocity of the reference point.
    pub force: Vector3<f64>,
    /// Per angular velocity, about the reference point.
    pub moment: Vector3<f64>,
}

/// Returns the content of a cell, computing it first if it is empty.
pub(crate) fn once<T: Copy>(cell: &Cell<Option<T>>, compute: impl FnOnce() -> T) -> T {
    match cell.get() {
        Some(value) => value,
        None => {
            let value = compute();
            cell.set(Some(value));
            value
        }
    }
}

impl<const N: usize> Mechanism<N> {
    /// Creates legs without a pose; call [`LegsAt::move_to`] before use.
    pub(crate) fn nowhere(&self) -> LegsAt<'_, N> {
        LegsAt {
            machine: self,
            tool: Vector3::zeros(),
            trig: Trigonometry::LEVEL,
            placement: Placement::LEVEL,
            corrections: [0.0; N],
            target: Target::of([0.0; N]),
            placed: Placed::ZERO,
            torsion: Torsion::ZERO,
            gradients: Cell::new(None),
            singular_value: Cell::new(None),
        }
    }
}

impl<const N: usize> LegsAt<'_, N> {
    /// Moves to another pose in the same memory.
    pub(crate) fn move_to(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<(), Fault> {
        let machine = self.machine;
        pose.check()?;
        machine.check_tool(tool)?;
        let pose = &if machine.holds { machine.held(pose, true)? } else { *pose };
        self.tool = *tool;
        self.trig = pose.trigonometry();
        self.placement = machine.placement(pose, &self.trig, tool)?;
        if let Some(couplings) = machine.couplings() {
            let place = &mut self.placement.place;
            *place = couplings.with_angles(*place);
            self.trig = Pose { position: place.centre, angles: place.angles }.trigonometry();
        }
        let place = &self.placement.place;
        let torsion = &mut self.torsion;
        self.corrections = machine.corrected(place, &mut self.placed, |found| *torsion = *found)?;
        self.target.joints = machine.leg_joints(&self.placed, &self.corrections)?;
        machine.aim(&mut self.target)?;
        if machine.moving {
            machine.place(&self.target.anchors, &self.placement.place, &mut self.placed);
        }
        self.gradients.set(None);
        self.singular_value.set(None);
        Ok(())
    }

    /// Returns the joint values of legs and table.
    pub fn all_joints(&self) -> Result<Joints, Fault> {
        self.machine.all_joints(&self.target.joints, &self.placement.point)
    }

    /// Returns the pose of the control point in base, with the coordinates that depend on others; `None` without
    /// constraints.
    pub fn full_pose(&self) -> Option<Pose> {
        let couplings = self.machine.couplings()?;
        Some(couplings.pose(&self.placement.place, &self.tool))
    }

    pub fn corrections(&self) -> PerLeg {
        self.machine.per_leg(&self.corrections)
    }

    pub fn write_segments(&self, segments: &mut [Segment; MAX_LEGS]) {
        for (i, segment) in segments.iter_mut().enumerate().take(self.machine.count()) {
            *segment = Segment {
                base: self.target.anchors.get(i),
                platform: self.placement.place.centre + self.placed.arms.get(i),
            };
        }
    }

    /// Returns the vector from the control point to the reference point, in base.
    pub fn lever(&self) -> Vector3<f64> {
        self.placement.place.rotation * (self.tool + self.machine.reference)
    }

    /// Returns the torsion of the legs, if any has a lead.
    pub fn torsion(&self) -> Option<&Torsion<N>> {
        self.machine.nut.is_some().then_some(&self.torsion)
    }

    /// Computes the speed of the platform anchor along the leg per joint rate.
    fn transmission(&self, i: usize, n: &Vector3<f64>) -> f64 {
        self.machine.legs[i].transmission(self.target.joints[i] + self.machine.offset[i], n)
    }

    /// Returns how far leg `i` is from its dead point, see [`crate::leg`]; `None` if it has none.
    pub fn drive(&self, i: usize) -> Option<f64> {
        let machine = self.machine;
        (i < machine.count())
            .then(|| machine.margin(&self.placed, i, self.target.joints[i] + machine.offset[i]))?
    }

    /// Computes the gradients of the legs' joint values.
    pub fn gradients(&self) -> Result<[Gradient; N], Fault> {
        once(&self.gradients, || self.find_gradients())
    }

    fn find_gradients(&self) -> Result<[Gradient; N], Fault> {
        let rows = self.machine.rows(&self.placed, self.torsion());
        let n = self.placed.directions();
        let mut rates = [0.0; N];
        for (i, rate) in rates.iter_mut().enumerate() {
            *rate = 1.0 / self.transmission(i, &n.get(i));
            // A joint value is so large that the leg's length is lost in rounding.
            if !rate.is_finite() {
                return Err(Fault::of_leg(Cause::DeadPoint, i, 0.0));
            }
        }
        Ok(core::array::from_fn(|i| {
            let rate = rates[i];
            let force = Vector3::new(rows[0][i], rows[1][i], rows[2][i]);
            let moment = Vector3::new(rows[3][i], rows[4][i], rows[5][i]);
            Gradient { force: force * rate, moment: moment * rate }
        }))
    }

    pub fn speed_ratios(&self) -> Result<Joints, Fault> {
        let (machine, legs) = (self.machine, self.gradients()?);
        let mut ratios = [0.0; MAX_JOINTS];
        if machine.couplings().is_some() {
            let jacobian = self.pose_jacobian()?;
            for (ratio, row) in ratios.iter_mut().zip(jacobian.row_iter()) {
                *ratio = row.fixed_columns::<3>(0).norm();
            }
            return Ok(ratios);
        }
        for ratio in ratios.iter_mut().take(machine.layout.joints()) {
            *ratio = 1.0;
        }
        for (ratio, leg) in ratios.iter_mut().zip(&legs).take(machine.count()) {
            *ratio = machine.of_legs(leg.force).norm();
        }
        Ok(ratios)
    }

    /// Computes joint rates while the pose changes at `rate` per second, angles in degrees.
    pub fn rates(&self, rate: &[f64; 6]) -> Result<Joints, Fault> {
        let machine = self.machine;
        let own = self.full_rates(rate)?;
        let [vx, vy, vz, a, b, c] = own.unwrap_or(*rate);
        let angles = Vector3::new(a, b, c) * RADIANS;
        let omega = self.trig.rate_map() * angles;
        let speed = Vector3::new(vx, vy, vz) + omega.cross(&self.lever());
        let legs = self.leg_rates(&machine.of_legs(speed), &omega)?;
        let mut rates = [0.0; MAX_JOINTS];
        for (rate, leg) in rates.iter_mut().zip(legs).take(machine.count()) {
            *rate = leg;
        }
        let table = rates.iter_mut().skip(machine.count()).zip(machine.layout.table().as_slice());
        for (joint, letter) in table {
            let k = letter.index().min(2);
            *joint = match &own {
                None => speed[k],
                Some(own) => rate[k] - own[k],
            };
        }
        Ok(rates)
    }

    /// Computes joint rates while the tool vector changes at `change` and LinuxCNC's pose stays.
    pub fn tool_rates(&self, change: &Vector3<f64>) -> Result<Joints, Fault> {
        let machine = self.machine;
        let (place, lever) = (&self.placement.place, self.lever());
        let drift = place.rotation * change - change;
        let own = match machine.couplings() {
            None => [0.0; 6],
            Some(couplings) => couplings
                .rates(place, (&lever, &drift), &[0.0; 6])
                .ok_or(Fault::from(Cause::ConstraintSingular))?,
        };
        let [vx, vy, vz, a, b, c] = own;
        let omega = self.trig.rate_map() * Vector3::new(a, b, c);
        let speed = Vector3::new(vx, vy, vz) + drift + omega.cross(&lever);
        let legs = self.leg_rates(&machine.of_legs(speed), &omega)?;
        let mut rates = [0.0; MAX_JOINTS];
        for (rate, leg) in rates.iter_mut().zip(legs).take(machine.count()) {
            *rate = leg;
        }
        let table = rates.iter_mut().skip(machine.count()).zip(machine.layout.table().as_slice());
        for (rate, letter) in table {
            let k = letter.index().min(2);
            *rate = if machine.couplings().is_some() { -own[k] } else { drift[k] };
        }
        Ok(rates)
    }

    /// Computes the rates of all coordinates of the control point in base, angles in degrees; `None` without constraints.
    pub fn full_rates(&self, rate: &[f64; 6]) -> Result<Option<[f64; 6]>, Fault> {
        let Some(couplings) = self.machine.couplings() else { return Ok(None) };
        let radians = core::array::from_fn(|k| if k < 3 { rate[k] } else { rate[k] * RADIANS });
        let lever = (&self.lever(), &Vector3::zeros());
        let rates = couplings.rates(&self.placement.place, lever, &radians);
        let rates = rates.ok_or(Fault::from(Cause::ConstraintSingular))?;
        Ok(Some(core::array::from_fn(|k| if k < 3 { rates[k] } else { rates[k] * DEGREES })))
    }

    /// Computes the angular velocity of the platform while the pose changes at `rate` per second, angles in degrees, and
    /// the tool vector at `change`.
    pub fn turning(&self, rate: &[f64; 6], change: &Vector3<f64>) -> Result<Vector3<f64>, Fault> {
        let mut rates = core::array::from_fn(|k| if k < 3 { rate[k] } else { rate[k] * RADIANS });
        if let Some(couplings) = self.machine.couplings() {
            let place = &self.placement.place;
            let drift = place.rotation * change - change;
            rates = couplings
                .rates(place, (&self.lever(), &drift), &rates)
                .ok_or(Fault::from(Cause::ConstraintSingular))?;
        }
        let [.., a, b, c] = rates;
        Ok(self.trig.rate_map() * Vector3::new(a, b, c))
    }

    /// Computes the rates of the legs' joints while the reference point moves at `v` and the platform rotates at
    /// `omega`: the products of the gradients with both, with less work than the gradients.
    fn leg_rates(&self, v: &Vector3<f64>, omega: &Vector3<f64>) -> Result<[f64; N], Fault> {
        let (v, omega) = (wide(v), wide(omega));
        let mut rates = [0.0; N];
        for i in (0..N).step_by(2) {
            let curved = self.placed.curved(i);
            let n = scaled(&self.placed.span.pair(i), curved);
            let speed = sum(&v, &cross(&omega, &self.placed.arms.pair(i)));
            let mut rate = dot(&n, &speed);
            if let Some(nut) = &self.machine.nut {
                let of_nut = nut.rates(&self.torsion, i, &n, curved);
                rate += dot(&of_nut.along, &speed) + dot(&of_nut.moment, &omega);
            }
            put(&mut rates, i, rate);
        }
        if self.machine.moving {
            let n = self.placed.directions();
            for i in 0..N {
                let per_rate = 1.0 / self.transmission(i, &n.get(i));
                // A joint value is so large that the leg's length is lost in rounding.
                if !per_rate.is_finite() {
                    return Err(Fault::of_leg(Cause::DeadPoint, i, 0.0));
                }
                rates[i] *= per_rate;
            }
        }
        Ok(rates)
    }

    /// Computes the unit constraint rows without nut corrections, column by column, see
    /// [`Mechanism::to_chart`].
    pub fn constraint_columns(&self) -> [[f64; N]; 6] {
        self.machine.charted_rows(&self.placed, None, &self.placement.place)
    }

    pub fn smallest_singular_value(&self) -> f64 {
        once(&self.singular_value, || {
            smallest_singular_value(&self.constraint_columns(), &self.machine.active)
        })
    }

    pub fn is_surely_above(&self, least: f64) -> bool {
        is_surely_above(&self.constraint_columns(), &self.machine.active, least)
    }
}
