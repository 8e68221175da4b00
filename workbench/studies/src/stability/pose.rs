// SPDX-License-Identifier: GPL-2.0-or-later
//! The machine's modes at a pose, for the cutting process.

use crate::dynamics::milling::frame;
use crate::dynamics::mode::Mode;
use crate::dynamics::model::Model;
use crate::dynamics::structure::Structure;
use crate::stability::lobes::{Limit, Lobes};
use crate::stability::process::{AlongAxis, Process, Row, milling_rows, turned, turning_rows};
use crate::stability::spindle::{NoSpindle, Nose};
use crate::study::cutting::Turning;
use crate::study::file::{Lacking, Study};
use kinematics::{Fault, Matrix3, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use std::f64::consts::PI;

/// Why a study does not describe a cutting process.
#[derive(Debug, thiserror::Error)]
pub enum NoSetup {
    #[error(transparent)]
    Lacking(#[from] Lacking),
    #[error("the study has neither [cutting] (a milling cutter) nor [turning]: add one of them")]
    Process,
    #[error("the study has both [cutting] and [turning]; remove one of them")]
    Both,
    #[error(
        "[[measured]] has no effect here: a measured response has no modes to add to the machine's; remove it, or use \
         pkm stability lag"
    )]
    Measured,
    #[error(transparent)]
    Spindle(#[from] NoSpindle),
}

/// Why the machine has no modes at a pose, or no damped ones.
#[derive(Clone, Copy, Debug, thiserror::Error)]
pub enum NoModes {
    #[error(transparent)]
    Fault(#[from] Fault),
    #[error("singular pose: the legs do not constrain the platform; choose another pose")]
    Free,
    #[error(transparent)]
    Feed(#[from] AlongAxis),
    #[error(
        "a mode at {0:.3} Hz has no damping; add damping_n_s_per_mm or damping_ratio to [legs]"
    )]
    Undamped(f64),
}

/// A machine with the masses and the cutting process of its study.
#[derive(Clone, Debug)]
pub struct Setup<'a> {
    config: &'a Mechanism,
    model: Model,
    pub process: Process,
    turning: Option<Turning>,
    nose: Option<Nose>,
}

/// Feed directions per half turn that a map evaluates: one every ten degrees.
const FEEDS: usize = 18;

impl<'a> Setup<'a> {
    /// Creates the setup of a machine and its study.
    ///
    /// # Errors
    /// See [`NoSetup`].
    pub fn new(config: &'a Mechanism, study: &Study) -> Result<Self, NoSetup> {
        if !study.measured.is_empty() {
            return Err(NoSetup::Measured);
        }
        let process = match (&study.cutting, &study.turning) {
            (Some(cutting), None) => Process::from(cutting),
            (None, Some(turning)) => Process::from(turning),
            (None, None) => return Err(NoSetup::Process),
            (Some(_), Some(_)) => return Err(NoSetup::Both),
        };
        let nose = study.spindle.as_ref().map(|spindle| spindle.nose()).transpose()?;
        let model = Model::of(config, study)?;
        Ok(Self { config, model, process, turning: study.turning, nose })
    }

    /// Returns whether the process is milling.
    pub fn is_milling(&self) -> bool {
        self.turning.is_none()
    }

    /// Returns the modes at the tool tip, those of the spindle included. `tool` is the tool vector of the pose,
    /// as for [`kinematics::Machine::at`].
    ///
    /// # Errors
    /// See [`NoModes`].
    pub fn modes(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Vec<Mode>, NoModes> {
        self.modes_with(pose, tool, &pose.rotation())
    }

    fn modes_with(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        rotation: &Matrix3<f64>,
    ) -> Result<Vec<Mode>, NoModes> {
        let structure = Structure::at(self.config, &self.model, pose, tool)?;
        let mut modes = structure.modes().ok_or(NoModes::Free)?;
        let nose = self.nose.as_ref();
        modes.extend(nose.map_or(vec![], |nose| nose.modes_across(rotation)));
        match modes.iter().find(|mode| !(mode.zeta > 0.0)) {
            Some(mode) => Err(NoModes::Undamped(mode.omega / (2.0 * PI))),
            None => Ok(modes),
        }
    }

    /// Returns the modes as rows of the process; `feed` is in machine axes, and has no effect in turning.
    ///
    /// # Errors
    /// See [`NoModes`].
    pub fn rows(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        feed: &Vector3<f64>,
    ) -> Result<Vec<Row>, NoModes> {
        self.rows_with(pose, tool, feed, &pose.rotation())
    }

    /// Returns the rows of a tool with its own orientation in base, because an axis carries it.
    ///
    /// # Errors
    /// See [`NoModes`].
    pub fn rows_with(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        feed: &Vector3<f64>,
        rotation: &Matrix3<f64>,
    ) -> Result<Vec<Row>, NoModes> {
        let modes = self.modes_with(pose, tool, rotation)?;
        if let Some(turning) = &self.turning {
            return Ok(turning_rows(&modes, turning));
        }
        let axis = rotation.column(2).into_owned();
        Ok(milling_rows(&modes, &frame(feed, &axis).ok_or(AlongAxis)?))
    }

    /// Returns the least zero-order limit at a pose over feeds in all directions: at a spindle speed, or
    /// over all of them. `None` if every depth is stable.
    ///
    /// # Errors
    /// See [`NoModes`].
    pub fn least(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        rpm: Option<f64>,
    ) -> Result<Option<Limit>, NoModes> {
        let rows = self.rows(pose, tool, &pose.rotation().column(0).into_owned())?;
        let lobes = Lobes::coarse(&rows, &self.process, rpm.unwrap_or(f64::INFINITY));
        let limit = |lobes: &Lobes| match rpm {
            Some(rpm) => lobes.limit(rpm),
            None => lobes.floor(),
        };
        let limits = self.feeds().into_iter().filter_map(|angle| limit(&lobes.turned(angle)));
        Ok(limits.min_by(|a, b| a.depth.total_cmp(&b.depth)))
    }

    /// Returns the angle in the cutter plane, from the feed of `rows`, of the feed whose zero-order limit
    /// over all speeds is least.
    pub fn worst_feed(&self, rows: &[Row]) -> f64 {
        let lobes = Lobes::coarse(rows, &self.process, f64::INFINITY);
        let depth = |angle: &f64| lobes.turned(*angle).floor().map_or(f64::INFINITY, |l| l.depth);
        let worst = self.feeds().into_iter().min_by(|a, b| depth(a).total_cmp(&depth(b)));
        worst.unwrap_or_default()
    }

    pub fn at_worst_feed(&self, rows: &[Row]) -> Vec<Row> {
        turned(rows, self.worst_feed(rows))
    }

    /// Returns the angles of the evaluated feeds. The opposite feed has the same limit if no force
    /// acts along the axis: x and y change sign, and so do forces.
    fn feeds(&self) -> Vec<f64> {
        if self.turning.is_some() {
            return vec![0.0];
        }
        let turns = if self.process.is_flat() { 1 } else { 2 };
        (0..turns * FEEDS).map(|k| PI * k as f64 / FEEDS as f64).collect()
    }
}
