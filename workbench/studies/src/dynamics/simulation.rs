// SPDX-License-Identifier: GPL-2.0-or-later
//! Simulation in time: a rigid body on springs and dampers that follow their actual directions.
//!
//! ```text
//! m v' = Σ f n + F + m g        I ω' + ω × I ω = Rᵀ [Σ (p - r) × f n + (tip - r) × F]
//! f = f⁰ - k (l - l⁰ - δq) - c (l' - δq')
//! ```
//!
//! about the center of mass r (paper 004, equations 11 to 14; about another pole a term ρ × m a is
//! missing there). f⁰ supports the weight at the start. With the torque of a thread, l is the joint value
//! and n with its moment the row of the joint. Guides constrain their coordinates by the principle of
//! virtual work; constraints of the platform have reactions ([`Reactions`]). Legs with mass rotate ([`StrutMass`]); accelerations of their base joints are neglected, and drives
//! have no mass here. A damping ratio is converted to dampers between the legs that produce it at the start.

use crate::dynamics::chart::Chart;
use crate::dynamics::drives::Drives;
use crate::dynamics::model::Model;
use crate::dynamics::reactions::Reactions;
use crate::dynamics::rotation::{Acceleration, Motion};
use crate::dynamics::structure::{LegAt, Structure, has_lead, legs, tip};
use crate::dynamics::strut::StrutMass;
use crate::study::file::Screw;
use kinematics::{At, Fault, Letter, Matrix3, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, Vector6};

/// Rate at which errors of constraints decay, as a share of the fastest mode's: slow for the step of the integration.
const RETURN: f64 = 0.1;

/// A machine simulated in time.
pub struct Simulation<'a> {
    config: &'a Mechanism,
    model: Model,
    at: At<'a>,
    tool: Vector3<f64>,
    springs: Vec<Strut>,
    /// Force of a leg per rate of another one's length, N s/mm.
    dampers: DMatrix<f64>,
    has_legs_with_mass: bool,
    /// The constraints of the platform, if there are any.
    reactions: Option<Reactions>,
    /// Whether a thread's torque reaches the platform.
    is_turning: bool,
    /// Force of every leg in the last step.
    pub forces: Vec<f64>,
}

/// A leg.
struct Strut {
    /// From the center of mass to the platform anchor, body axes.
    arm: Vector3<f64>,
    stiffness: f64,
    bearing: f64,
    mass: StrutMass,
    has_lead: bool,
}

/// Action of a leg at a moment.
struct Pull {
    /// Force and moment about the center of mass per unit of its force.
    row: Vector6<f64>,
    /// From the base anchor to the platform anchor, and its rate.
    span: Vector3<f64>,
    speed: Vector3<f64>,
    arm: Vector3<f64>,
    longer: f64,
    rate: f64,
}

impl<'a> Simulation<'a> {
    /// Creates a simulation of a machine that starts at a pose; `None` if it is singular.
    ///
    /// # Errors
    /// As [`Structure::at`].
    pub fn new(
        config: &'a Mechanism,
        model: &Model,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Option<Self>, Fault> {
        let model = model.without_drive_masses();
        let structure = Structure::at(config, &model, pose, tool)?;
        let at = config.machine.at(pose, tool)?;
        let legs = legs(config, &at, tool, model.screw)?;
        let leg = |(i, leg): (usize, &LegAt)| Strut {
            arm: leg.anchor - model.body.centre,
            stiffness: model.legs[i].spring.along(leg.gain),
            bearing: structure.bearing[i],
            mass: StrutMass::new(model.legs[i].axial, model.legs[i].across, leg.length),
            has_lead: has_lead(config, i),
        };
        let springs: Vec<Strut> = legs.iter().enumerate().map(leg).collect();
        let Some(dampers) = dampers(&structure, &model) else { return Ok(None) };
        let is_turning = model.screw == Screw::Backdrivable && springs.iter().any(|s| s.has_lead);
        let has_legs_with_mass = springs.iter().any(|s| s.mass.is_there());
        let fastest = structure.shapes().and_then(|shapes| shapes.omegas.last().copied());
        let rate = RETURN * fastest.unwrap_or_default();
        let reactions = Reactions::new(config, &model.body.centre, rate);
        let forces = structure.bearing;
        let tool = *tool;
        let held = structure.stiffness.cholesky().is_some();
        let simulation = Self {
            config,
            model,
            at,
            tool,
            springs,
            dampers,
            has_legs_with_mass,
            reactions,
            is_turning,
            forces,
        };
        Ok(held.then_some(simulation))
    }

    /// Changes the tool, whose tip is recorded from now on.
    pub fn hold(&mut self, tool: &Vector3<f64>) {
        self.tool = *tool;
    }

    /// Computes the drive state that positions the tip at a pose; `tool` is the tool vector there.
    ///
    /// # Errors
    /// As [`Drives::at`].
    pub fn drives(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<Drives, Fault> {
        Drives::at(self.config, &mut self.at, pose, tool, self.is_turning)
    }

    /// Returns the motion at rest at a pose, with the state of the drives there.
    ///
    /// # Errors
    /// As [`kinematics::Machine::full_pose`].
    pub fn resting(&self, pose: &Pose, drives: &Drives) -> Result<Motion, Fault> {
        let rotation = match self.reactions {
            Some(_) => self.config.machine.full_pose(pose, &self.tool)?.rotation(),
            None => pose.rotation(),
        };
        let of_tip = self.model.body.centre - tip(self.config, &self.tool);
        let place = drives.tip - drives.table + rotation * of_tip;
        Ok(Motion {
            place,
            velocity: Vector3::zeros(),
            rotation,
            spin: Vector3::zeros(),
            table: drives.table,
            table_velocity: Vector3::zeros(),
        })
    }

    /// Computes the position of the tool tip in the work, mm.
    pub fn tip(&self, motion: &Motion) -> Vector3<f64> {
        let of_centre = tip(self.config, &self.tool) - self.model.body.centre;
        motion.place + motion.rotation * of_centre + motion.table
    }

    /// Computes the derivatives of the velocities from commanded drives, their rates, and a force on the tip.
    ///
    /// # Errors
    /// The nut's rotation is undefined at that pose.
    pub fn rates(
        &mut self,
        motion: &Motion,
        [drives, moving]: [&Drives; 2],
        force: &Vector3<f64>,
    ) -> Result<Acceleration, Fault> {
        let omega = motion.rotation * motion.spin;
        let pulls = self.pulls(motion, &omega, [drives, moving])?;
        let Model { body, gravity, table, .. } = &self.model;
        let lever = motion.rotation * (tip(self.config, &self.tool) - body.centre);
        let mut wrench = Vector6::zeros();
        let mut push = |force: Vector3<f64>, moment: Vector3<f64>| {
            let mut part = wrench.fixed_rows_mut::<3>(0);
            part += force;
            let mut part = wrench.fixed_rows_mut::<3>(3);
            part += moment;
        };
        push(force + gravity * body.mass, lever.cross(force));
        let inertia = motion.rotation * body.inertia * motion.rotation.transpose();
        push(Vector3::zeros(), -omega.cross(&(inertia * omega)));
        for (i, pull) in pulls.iter().enumerate() {
            let damped: f64 =
                pulls.iter().enumerate().map(|(j, other)| self.dampers[(i, j)] * other.rate).sum();
            let spring = &self.springs[i];
            self.forces[i] = spring.bearing - spring.stiffness * pull.longer - damped;
            wrench += pull.row * self.forces[i];
            if spring.mass.is_there() {
                // The platform joint accelerates by the platform's rotation as well.
                let towards = omega.cross(&omega.cross(&pull.arm));
                let force = spring.mass.matrix(&pull.span) * towards
                    + spring.mass.rotation(&pull.span, &pull.speed);
                let mut part = wrench.fixed_rows_mut::<3>(0);
                part -= force;
                let mut part = wrench.fixed_rows_mut::<3>(3);
                part -= pull.arm.cross(&force);
            }
        }
        let change = self.accelerated(motion, &omega, &inertia, &wrench, &pulls);
        let turning = Vector3::new(change[3], change[4], change[5]);
        let mut of_table = Vector3::zeros();
        for axis in table {
            let k = axis.axis;
            let off = motion.table[k] - drives.table[k];
            let rate = motion.table_velocity[k] - moving.table[k];
            of_table[k] = (force[k] - axis.stiffness * off - axis.damping * rate) / axis.mass;
        }
        Ok(Acceleration {
            place: change.fixed_rows::<3>(0).into(),
            spin: motion.rotation.tr_mul(&turning),
            table: of_table,
        })
    }

    fn pulls(
        &mut self,
        motion: &Motion,
        omega: &Vector3<f64>,
        [drives, moving]: [&Drives; 2],
    ) -> Result<Vec<Pull>, Fault> {
        let mut pulls = vec![];
        for ((spring, drive), moved) in self.springs.iter().zip(&drives.legs).zip(&moving.legs) {
            let arm = motion.rotation * spring.arm;
            let span = motion.place + arm - drive.base;
            let length = span.norm();
            let along = span / length;
            let speed = motion.velocity + omega.cross(&arm) - moved.base;
            let mut row = Vector6::zeros();
            row.fixed_rows_mut::<3>(0).copy_from(&along);
            row.fixed_rows_mut::<3>(3).copy_from(&arm.cross(&along));
            let (longer, rate) = (length - drive.length, along.dot(&speed) - moved.length);
            pulls.push(Pull { row, span, speed, arm, longer, rate });
        }
        if self.is_turning {
            self.turn_nuts(motion, omega, &mut pulls, moving)?;
        }
        Ok(pulls)
    }

    /// Replaces the rows of struts with a lead by those of their joints.
    fn turn_nuts(
        &mut self,
        motion: &Motion,
        omega: &Vector3<f64>,
        pulls: &mut [Pull],
        moving: &Drives,
    ) -> Result<(), Fault> {
        let pose = self.pose(motion);
        self.at.move_to(&pose, &self.tool)?;
        let (corrections, jacobian) = (self.at.corrections(), self.at.inverse_jacobian()?);
        let per_mm = self.config.units_per_mm;
        let lever = motion.rotation * (tip(self.config, &self.tool) - self.model.body.centre);
        for (i, pull) in pulls.iter_mut().enumerate().filter(|(i, _)| self.springs[*i].has_lead) {
            let row = jacobian.row(i);
            let force = Vector3::new(row[0], row[1], row[2]);
            let moment = Vector3::new(row[3], row[4], row[5]) / per_mm + lever.cross(&force);
            pull.row.fixed_rows_mut::<3>(0).copy_from(&force);
            pull.row.fixed_rows_mut::<3>(3).copy_from(&moment);
            pull.longer += corrections[i] / per_mm;
            // A strut's base anchor is fixed.
            let speed = force.dot(&motion.velocity) + moment.dot(omega);
            pull.rate = speed - moving.legs[i].length;
        }
        Ok(())
    }

    /// Converts a motion to the pose, machine units.
    fn pose(&self, motion: &Motion) -> Pose {
        let r = &motion.rotation;
        let angles = Vector3::new(
            r[(2, 1)].atan2(r[(2, 2)]),
            (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)])),
            r[(1, 0)].atan2(r[(0, 0)]),
        );
        let tip = self.tip(motion) * self.config.units_per_mm;
        let mut pose = Pose { position: tip + self.tool, angles };
        // In LinuxCNC's pose, coordinates that follow are 0.
        let layout = self.config.machine.layout();
        let follows = |letter: &Letter| layout.is_dependent(*letter) && layout.is_held(*letter);
        for letter in Letter::ALL.into_iter().filter(follows) {
            match letter.index() {
                k @ 0..3 => pose.position[k] = 0.0,
                k => pose.angles[k - 3] = 0.0,
            }
        }
        pose
    }

    /// Computes linear and angular acceleration, machine axes.
    fn accelerated(
        &self,
        motion: &Motion,
        omega: &Vector3<f64>,
        inertia: &Matrix3<f64>,
        wrench: &Vector6<f64>,
        pulls: &[Pull],
    ) -> Vector6<f64> {
        let mut mass = Matrix6::from_diagonal_element(self.model.body.mass);
        mass.fixed_view_mut::<3, 3>(3, 3).copy_from(inertia);
        if self.has_legs_with_mass {
            for (pull, spring) in pulls.iter().zip(&self.springs) {
                let own = spring.mass.matrix(&pull.span);
                let mut moved = SMatrix::<f64, 3, 6>::zeros();
                moved.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
                moved.fixed_view_mut::<3, 3>(0, 3).copy_from(&-pull.arm.cross_matrix());
                mass += moved.transpose() * own * moved;
            }
        }
        if let Some(reactions) = &self.reactions {
            return reactions.accelerated(motion, omega, &mass, wrench);
        }
        if self.config.machine.layout().coordinates().len() == 6 {
            let factors = mass.cholesky().expect("mass and inertia of a body are positive");
            return factors.solve(wrench);
        }
        self.guided(motion, omega, &mass, wrench)
    }

    /// Computes the accelerations if guides constrain coordinates: a = P η'' + P' η' with P the free motions, and
    /// Pᵀ M a = Pᵀ Q.
    fn guided(
        &self,
        motion: &Motion,
        omega: &Vector3<f64>,
        mass: &Matrix6<f64>,
        wrench: &Vector6<f64>,
    ) -> Vector6<f64> {
        let letters = self.config.machine.layout().coordinates();
        let coordinates = letters.as_slice().iter().map(|letter| letter.index());
        let mut coordinates: Vec<usize> = coordinates.collect();
        coordinates.sort_unstable();
        let centre = Vector3::from(self.config.geometry.centre) / self.config.units_per_mm;
        let chart = Chart::new(coordinates, centre, &self.pose(motion));
        let of_centre = motion.rotation * (centre - self.model.body.centre);
        let speed = motion.velocity + omega.cross(&of_centre);
        let rates = chart.rates(&speed, omega);
        let mut free = DMatrix::zeros(6, chart.count());
        free.rows_mut(0, 3).copy_from(&chart.displacement(&self.model.body.centre));
        free.rows_mut(3, 3).copy_from(&chart.turns());
        let mut curved = DVector::zeros(6);
        curved.rows_mut(0, 3).copy_from(&chart.bend(&self.model.body.centre, &rates));
        curved.rows_mut(3, 3).copy_from(&chart.turning(&rates));
        let left = free.tr_mul(&(wrench - mass * &curved));
        let own = free.tr_mul(&(mass * &free));
        // Fails where two angles rotate about one axis, which no guided machine reaches: the motion ends.
        let solved = own.cholesky().map(|factors| free * factors.solve(&left) + curved);
        solved.map_or(Vector6::repeat(f64::NAN), |change| {
            Vector6::from_column_slice(change.as_slice())
        })
    }

    /// Computes the kinetic energy plus that of the springs relative to their bearing forces, N mm.
    pub fn energy(&mut self, motion: &Motion, drives: &Drives) -> Result<f64, Fault> {
        let omega = motion.rotation * motion.spin;
        let still = Drives::default();
        let pulls = self.pulls(motion, &omega, [drives, &still])?;
        let Model { body, gravity, .. } = &self.model;
        let mut energy = body.mass * motion.velocity.norm_squared() / 2.0;
        energy += motion.spin.dot(&(body.inertia * motion.spin)) / 2.0;
        energy -= body.mass * gravity.dot(&motion.place);
        for (pull, spring) in pulls.iter().zip(&self.springs) {
            energy += spring.stiffness * pull.longer.powi(2) / 2.0 - spring.bearing * pull.longer;
            energy += spring.mass.energy(&pull.span, &pull.speed);
        }
        Ok(energy)
    }

    /// Computes the power dissipated by the dampers, N mm/s.
    pub fn loss(&mut self, motion: &Motion, drives: &Drives) -> Result<f64, Fault> {
        let omega = motion.rotation * motion.spin;
        let still = Drives::default();
        let pulls = self.pulls(motion, &omega, [drives, &still])?;
        let rates = DVector::from_iterator(pulls.len(), pulls.iter().map(|pull| pull.rate));
        Ok(rates.dot(&(&self.dampers * &rates)))
    }
}

/// Computes the dampers between the legs: one in each leg, or those that give every mode its ratio at the start,
/// C = Gᵀ D G with D = G⁺ᵀ C G⁺.
fn dampers(structure: &Structure, model: &Model) -> Option<DMatrix<f64>> {
    let own = DVector::from_iterator(model.legs.len(), model.legs.iter().map(|leg| leg.damping));
    if model.ratio.is_none() {
        return Some(DMatrix::from_diagonal(&own));
    }
    let count = structure.mass.nrows() - model.table.len();
    let rows = structure.elongation.columns(0, count).into_owned();
    let inverse = rows.tr_mul(&rows).cholesky()?.inverse() * rows.transpose();
    let damping = structure.damping.view((0, 0), (count, count));
    Some(inverse.tr_mul(&(damping * &inverse)))
}
