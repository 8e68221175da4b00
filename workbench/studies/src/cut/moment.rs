// SPDX-License-Identifier: GPL-2.0-or-later
//! A moment of a program: drive loads and tool deflection due to motion and cutting.
//!
//! Forces are linear in the loads on the tool: the forces under each unit load, and those of weight and
//! inertia, determine the rest. A displacement of the tool along an axis is the sum of f n/k over the
//! springs, with f the force in a spring and n its force under a unit load along that axis (the
//! unit load method, any book on structures).

use crate::cut::teeth::Teeth;
use crate::dynamics::capacity::Capacity;
use crate::dynamics::loads::{Held, Loads, Moving, Wrench};
use crate::dynamics::model::Model;
use kinematics::{Fault, Joints, MAX_JOINTS, Matrix3, Pose, Vector3};
use machine::read::joints::JointKind;
use machine::read::mechanism::Mechanism;

/// A machine with its drives and its cutter.
#[derive(Clone, Debug)]
pub struct Subject<'a> {
    pub config: &'a Mechanism,
    /// Masses and springs.
    pub model: Model,
    /// Capacities of the drives.
    pub drives: Vec<Capacity>,
    /// The cutter.
    pub teeth: Teeth,
}

/// Three servo cycles, of which the middle one is assessed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    pub line: u32,
    /// Seconds from the start, or machine units along the feed moves.
    pub at: f64,
    /// The commanded pose, machine units and degrees.
    pub programmed: [f64; 6],
    /// The machine's own poses, machine units and degrees.
    pub poses: [[f64; 6]; 3],
    /// Tool vector on the platform, machine units.
    pub tool: Vector3<f64>,
    /// Orientation of the tool in base.
    pub rotation: Matrix3<f64>,
    /// Speed along the path, mm/s.
    pub speed: f64,
    /// Direction of the feed in machine axes, any length.
    pub feed: Vector3<f64>,
    /// Spindle speed in 1/min while cutting.
    pub rpm: Option<f64>,
}

/// Results for a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    pub line: u32,
    /// As in [`Moment`].
    pub at: f64,
    /// The commanded pose, machine units and degrees.
    pub pose: [f64; 6],
    /// Feed per tooth, mm; `None` if nothing is cut.
    pub chip: Option<f64>,
    /// Largest force on the tool, N.
    pub force: f64,
    /// Smallest and largest load of every drive: N, or N mm for an arm.
    pub drives: Vec<[f64; 2]>,
    /// Displacement of the tool by the mean cutting force, machine axes, mm.
    pub deflection: Vector3<f64>,
    /// Displacement of the tool by inertia.
    pub lag: Vector3<f64>,
}

/// Why a moment cannot be assessed.
#[derive(Clone, Copy, Debug, thiserror::Error)]
pub enum NoMoment {
    #[error(transparent)]
    Fault(#[from] Fault),
    #[error("singular pose: the legs do not constrain the platform; choose another pose")]
    Singular,
    #[error(
        "at B = 90 degrees A and C rotate about the same axis, so forces are undefined; choose a pose with another B"
    )]
    Angles,
}

impl Moment {
    /// Computes the machine's motion from differences of the poses and their joint values.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn moving(&self, config: &Mechanism) -> Result<Moving, Fault> {
        let period = config.period;
        let poses = self.poses.map(Pose::from_degrees);
        let of = |pose: &Pose| -> [f64; 6] {
            std::array::from_fn(|k| if k < 3 { pose.position[k] } else { pose.angles[k - 3] })
        };
        let [a, b, c] = [0, 1, 2].map(|k| of(&poses[k]));
        if a == b && b == c {
            return Ok(Moving::still(poses[1], self.tool));
        }
        let mut values = [[0.0; MAX_JOINTS]; 3];
        for (values, pose) in values.iter_mut().zip(&poses) {
            *values = config.machine.inverse(pose, &self.tool)?;
        }
        // With the coordinates that constraints determine.
        let full = |pose: &Pose| match config.machine.layout().constraints() {
            0 => Ok(*pose),
            _ => config.machine.full_pose(pose, &self.tool),
        };
        let [a, b, c] = [of(&full(&poses[0])?), of(&full(&poses[1])?), of(&full(&poses[2])?)];
        let [before, now, after]: [Joints; 3] = values;
        let bend = |a: f64, b: f64, c: f64| (a - 2.0 * b + c) / (period * period);
        Ok(Moving {
            pose: poses[1],
            tool: self.tool,
            rate: std::array::from_fn(|k| (c[k] - a[k]) / (2.0 * period)),
            acceleration: std::array::from_fn(|k| bend(a[k], b[k], c[k])),
            joints: std::array::from_fn(|i| bend(before[i], now[i], after[i])),
        })
    }
}

impl Subject<'_> {
    /// Assesses a moment.
    ///
    /// # Errors
    /// See [`NoMoment`].
    pub fn judge(&self, moment: &Moment) -> Result<Judged, NoMoment> {
        let moving = moment.moving(self.config)?;
        let held = Held::at(self.config, &self.model, &moving.pose, &moving.tool)?;
        let held = held.ok_or(NoMoment::Singular)?;
        let under = |moving: &Moving, force: Vector3<f64>| {
            held.loads(moving, &Wrench { force, moment: Vector3::zeros() })
        };
        let still = Moving::still(moving.pose, moving.tool);
        let weight = under(&still, Vector3::zeros());
        let all = under(&moving, Vector3::zeros());
        if !all.drives.iter().all(|load| load.is_finite()) {
            return Err(NoMoment::Angles);
        }
        let units = [0, 1, 2].map(|k| less(&under(&still, Vector3::ith(k, 1.0)), &weight));
        let table = self.model.table.iter().map(|axis| axis.stiffness);
        let springs: Vec<f64> = held.springs().chain(table).collect();
        let chip = moment.rpm.map(|rpm| self.teeth.chip(moment.speed, rpm));
        let frame = self.teeth.frame(&moment.feed, &moment.rotation);
        let mean = chip.map_or_else(Vector3::zeros, |chip| frame * self.teeth.mean(chip));
        let borne: Vec<Vec<f64>> = units.iter().map(|unit| self.borne(unit)).collect();
        let of_mean: Vec<f64> =
            (0..springs.len()).map(|i| (0..3).map(|k| borne[k][i] * mean[k]).sum()).collect();
        let inertia = self.borne(&less(&all, &weight));
        let yields = |forces: &[f64]| {
            let along = |unit: &[f64]| {
                forces.iter().zip(unit).zip(&springs).map(|((f, n), k)| f * n / k).sum()
            };
            Vector3::from_fn(|k, _| along(&borne[k]))
        };
        Ok(Judged {
            line: moment.line,
            at: moment.at,
            pose: moment.programmed,
            chip,
            force: chip.map_or(0.0, |chip| self.teeth.peak(chip)),
            drives: self.ranges(&all, &units, chip, &frame),
            deflection: yields(&of_mean),
            lag: yields(&inertia),
        })
    }

    /// Computes the smallest and largest load of every drive over one tooth pitch.
    fn ranges(
        &self,
        all: &Loads,
        units: &[Loads],
        chip: Option<f64>,
        frame: &Matrix3<f64>,
    ) -> Vec<[f64; 2]> {
        let mut ranges: Vec<[f64; 2]> = all.drives.iter().map(|load| [*load; 2]).collect();
        let Some(chip) = chip else { return ranges };
        let gains: Vec<Vector3<f64>> = (0..ranges.len())
            .map(|i| frame.transpose() * Vector3::from_fn(|k, _| units[k].drives[i]))
            .collect();
        ranges.fill([f64::INFINITY, f64::NEG_INFINITY]);
        for force in self.teeth.forces(chip) {
            for (i, range) in ranges.iter_mut().enumerate() {
                let load = all.drives[i] + gains[i].dot(&force);
                *range = [range[0].min(load), range[1].max(load)];
            }
        }
        ranges
    }

    /// Returns the forces in the springs of the legs, then of the table axes.
    fn borne(&self, loads: &Loads) -> Vec<f64> {
        let table = &loads.drives[loads.legs.len()..];
        loads.legs.iter().chain(table).copied().collect()
    }

    /// Returns the drive with the largest share of its capacity, and the share.
    pub fn hardest(&self, ranges: &[[f64; 2]]) -> Option<(usize, f64)> {
        let share = |(i, range): (usize, &[f64; 2])| {
            let [low, high] = range.map(|load| self.drives[i].share(load));
            Some((i, low?.max(high?)))
        };
        let shares = ranges.iter().enumerate().filter_map(share);
        shares.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns whether a drive moves an arm, so that its load is a torque.
    pub fn is_arm(&self, drive: usize) -> bool {
        self.config.joints[drive].kind == JointKind::Arm
    }
}

fn less(loads: &Loads, other: &Loads) -> Loads {
    let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
    Loads { legs: less(&loads.legs, &other.legs), drives: less(&loads.drives, &other.drives) }
}
