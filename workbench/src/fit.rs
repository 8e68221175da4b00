// SPDX-License-Identifier: GPL-2.0-or-later
//! A shift of the work offset that makes a program fit.
//!
//! A compass search over X Y Z lowers how far some poses of the program lack of a margin to joint
//! ranges, cones, axis limits; whether the shift does is for [`crate::preflight`] to say, on the
//! moves that the interpreter makes of it.

use crate::cell::Reach;
use crate::interpreter::Move;
use crate::machine::MachineConfig;
use kinematics::{Fault, Vector3};

/// Poses of the program that are looked at.
const POSES: usize = 500;

/// Margin that is looked for, as a share of the limit's range: what lies between the poses.
const MARGIN: f64 = 0.02;

/// A pose without joint values lacks as much as this many ranges.
const UNREACHED: f64 = 3.0;

/// First and last step of the search, as shares of the machine's size.
const STEPS: [f64; 2] = [0.2, 2e-4];

/// Halvings of the shift found, which may be longer than needed.
const HALVINGS: usize = 12;

/// Steps taken at most.
const MOST: usize = 400;

/// A shift x y z, machine units, under which the poses looked at fit.
///
/// # Errors
/// A tool vector that the machine cannot take.
pub fn shift(config: &MachineConfig, moves: &[Move]) -> Result<Option<[f64; 3]>, Fault> {
    let search = Search::new(config, moves)?;
    let size = config.machine.size();
    let mut at = [0.0; 3];
    let mut lack = search.lack(&at);
    let mut step = STEPS[0] * size;
    for _ in 0..MOST {
        if lack == 0.0 || step < STEPS[1] * size {
            break;
        }
        let near = (0..6).map(|n| {
            let mut near: [f64; 3] = at;
            near[n / 2] += if n % 2 == 0 { step } else { -step };
            (search.lack(&near), near)
        });
        match near.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((less, near)) if less < lack => (lack, at) = (less, near),
            _ => step /= 2.0,
        }
    }
    if lack > 0.0 {
        return Ok(None);
    }
    // No more of it than needed.
    let (mut less, mut enough) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let share = (less + enough) / 2.0;
        *(if search.lack(&at.map(|x| share * x)) == 0.0 { &mut enough } else { &mut less }) = share;
    }
    // Digits that anybody can type, and that change nothing within the margin: away from 0.
    let per_unit = 10.0_f64.powi(-(size * 1e-4).log10().floor() as i32);
    Ok(Some(at.map(|x| (enough * x * per_unit).abs().ceil().copysign(x) / per_unit)))
}

struct Search<'a> {
    config: &'a MachineConfig,
    reaches: Vec<Reach<'a>>,
    /// Poses, with the number of the tool.
    poses: Vec<([f64; 6], usize)>,
}

impl<'a> Search<'a> {
    fn new(config: &'a MachineConfig, moves: &[Move]) -> Result<Self, Fault> {
        let mut search = Self { config, reaches: vec![], poses: vec![] };
        let mut tool = None;
        let mut from = config.home;
        let stride = (2 * moves.len()).div_ceil(POSES).max(1);
        let mut number = 0;
        for step in moves {
            if tool != Some(step.tool) {
                tool = Some(step.tool);
                let tool = config.spindle + Vector3::from(step.tool);
                search.reaches.push(Reach::with_tool(config, tool)?);
            }
            // What runs before the program does not follow its offset.
            if step.line > 0 {
                let middle = std::array::from_fn(|k| (from[k] + step.end[k]) / 2.0);
                for pose in [middle, step.end] {
                    if number % stride == 0 {
                        search.poses.push((pose, search.reaches.len() - 1));
                    }
                    number += 1;
                }
            }
            from = step.end;
        }
        Ok(search)
    }

    /// How much margin the poses lack together.
    fn lack(&self, shift: &[f64; 3]) -> f64 {
        let moved = |pose: &[f64; 6]| {
            std::array::from_fn(|k| pose[k] + shift.get(k).copied().unwrap_or(0.0))
        };
        self.poses.iter().map(|(pose, tool)| self.lack_of(&moved(pose), &self.reaches[*tool])).sum()
    }

    fn lack_of(&self, pose: &[f64; 6], reach: &Reach) -> f64 {
        let lacking = |margin: f64, range: f64| (MARGIN - margin / range).max(0.0);
        let axes: f64 = pose
            .iter()
            .zip(&self.config.axes)
            // An axis may stand at its limit.
            .map(|(x, axis)| (axis.min - x).max(x - axis.max).max(0.0) / self.config.machine.size())
            .sum();
        let Ok(way) = reach.way(pose, &[0.0; 6]) else { return axes + UNREACHED };
        let joints = way.joints.iter().zip(&self.config.joints).map(|(course, joint)| {
            let margin = (course.middle - joint.min).min(joint.max - course.middle);
            lacking(margin, joint.max - joint.min)
        });
        let cones = way.base.iter().zip(&self.config.base_cone);
        let cones = cones.chain(way.platform.iter().zip(&self.config.platform_cone));
        let cones = cones.filter_map(|(course, cone)| {
            let angle = course.middle.clamp(-1.0, 1.0).acos().to_degrees();
            cone.map(|cone| lacking(cone - angle, cone))
        });
        axes + joints.sum::<f64>() + cones.sum::<f64>()
    }
}
