// SPDX-License-Identifier: GPL-2.0-or-later
//! Complete simulations: at a pose under a force, or along a program.

use crate::dynamics::drives::Drives;
use crate::dynamics::layer::{Layer, UPRIGHT};
use crate::dynamics::milling::Milling;
use crate::dynamics::model::Model;
use crate::dynamics::noise::Noise;
use crate::dynamics::record::Record;
use crate::dynamics::rotation::Motion;
use crate::dynamics::simulation::Simulation;
use crate::dynamics::structure::Structure;
use kinematics::{Fault, Matrix3, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use std::f64::consts::TAU;

/// Steps in a period of the fastest mode or force: the fourth-order error is below a
/// thousandth of the amplitude after ten periods.
const STEPS_PER_PERIOD: f64 = 40.0;

/// Time constants of the slowest mode after which the initial state has decayed: e^-5.
const FORGOTTEN: f64 = 5.0;

/// Largest number of steps of a simulation: minutes of time and, as a record, half a gigabyte.
const MOST_STEPS: f64 = 2e7;

/// A force on the tool tip.
#[derive(Clone, Debug)]
pub enum Force {
    None,
    /// A constant force, N.
    Steady(Vector3<f64>),
    /// Random, sampled at the steps.
    Noise(Noise),
    /// Force of a cutter, in a frame of feed, across and tool axis.
    Milling(Milling, Matrix3<f64>),
    /// Force of a cutter on the layer in front of its teeth.
    Layer(Box<Layer>),
}

impl Force {
    /// Returns the force at a time, with the tip in the work at a place.
    fn now(&mut self, time: f64, tip: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::None => Vector3::zeros(),
            Self::Steady(force) => *force,
            Self::Noise(noise) => noise.force(),
            Self::Milling(milling, frame) => milling.at(time, frame),
            Self::Layer(layer) => layer.force(time, tip),
        }
    }

    fn step(&mut self) {
        if let Self::Noise(noise) = self {
            noise.step();
        }
    }
}

/// Why a simulation ends early.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Ended {
    #[error(transparent)]
    Fault(#[from] Fault),
    #[error("singular pose: the legs do not constrain the platform; choose another pose")]
    Singular,
    #[error(
        "{steps:.0} steps ({warm_up:.3} s of settling and {seconds} s) exceed {MOST_STEPS:.0} steps; \
         use more damping, lower frequencies or fewer seconds"
    )]
    Long {
        steps: f64,
        /// Seconds until the initial state has decayed.
        warm_up: f64,
        seconds: f64,
    },
    #[error("{0:.4} s: the motion diverges; reduce the cut or add damping")]
    Unbound(f64),
    #[error(
        "the tool is inclined by {0:.2} degrees, but [stock] is a map of heights for a vertical tool; remove [stock], \
         or use a program without A and B"
    )]
    Inclined(f64),
}

/// Times of a simulation, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    pub step: f64,
    /// Until the initial state has decayed.
    pub warm_up: f64,
}

impl Times {
    /// Chooses the times for a structure, under a force of frequencies up to `reach` in Hz; `None` if a motion is
    /// unconstrained.
    pub fn of(structure: &Structure, reach: f64) -> Option<Self> {
        let fastest = structure.shapes()?.omegas.last()?.max(TAU * reach) / TAU;
        let decay = structure
            .modes()?
            .iter()
            .map(|mode| mode.zeta * mode.omega)
            .fold(f64::INFINITY, f64::min);
        Some(Self { step: 1.0 / (STEPS_PER_PERIOD * fastest), warm_up: FORGOTTEN / decay })
    }
}

/// A running simulation.
struct Going<'a> {
    simulation: Simulation<'a>,
    motion: Motion,
    force: Force,
    time: f64,
}

impl Going<'_> {
    /// Performs one step, with the drives as a function of the share of the step.
    fn step(&mut self, step: f64, drives: impl Fn(f64) -> [Drives; 2]) -> Result<(), Ended> {
        let upright = self.motion.rotation[(2, 2)];
        if matches!(self.force, Force::Layer(_)) && upright < UPRIGHT {
            return Err(Ended::Inclined(upright.clamp(-1.0, 1.0).acos().to_degrees()));
        }
        let force = self.force.now(self.time, &self.simulation.tip(&self.motion));
        let simulation = &mut self.simulation;
        self.motion = self.motion.after(step, |motion, share| {
            let [drives, moving] = &drives(share);
            simulation.rates(motion, [drives, moving], &force)
        })?;
        self.time += step;
        self.force.step();
        let is_finite = self.motion.place.iter().chain(&self.motion.spin).all(|v| v.is_finite());
        if is_finite { Ok(()) } else { Err(Ended::Unbound(self.time)) }
    }

    fn off(&self, drives: &Drives) -> Vector3<f64> {
        self.simulation.tip(&self.motion) - drives.tip
    }
}

/// Simulates a machine at a pose under a force, for `seconds` after the initial state has decayed; `see`
/// receives the completed share.
///
/// # Errors
/// See [`Ended`].
pub fn standing(
    config: &Mechanism,
    model: &Model,
    (pose, tool): (&Pose, &Vector3<f64>),
    force: Force,
    (times, seconds): (&Times, f64),
    see: impl Fn(f64),
) -> Result<Record, Ended> {
    let steps = (times.warm_up + seconds) / times.step;
    if !(steps <= MOST_STEPS) {
        return Err(Ended::Long { steps, warm_up: times.warm_up, seconds });
    }
    let mut simulation = Simulation::new(config, model, pose, tool)?.ok_or(Ended::Singular)?;
    let drives = simulation.drives(pose, tool)?;
    let motion = simulation.resting(pose, &drives)?;
    let mut going = Going { simulation, motion, force, time: 0.0 };
    let still = Drives::default();
    let count = |time: f64| (time / times.step).ceil() as usize;
    let (before, after) = (count(times.warm_up), count(seconds));
    let mut record = Record { step: times.step, ..Record::default() };
    for k in 0..before + after {
        if k >= before {
            record.see(going.off(&drives), &going.simulation.forces);
        }
        going.step(times.step, |_| [drives, still])?;
        see(k as f64 / (before + after) as f64);
    }
    Ok(record)
}

/// A machine that follows the servo cycles of a program.
pub struct Follower<'a> {
    config: &'a Mechanism,
    model: Model,
    force: Option<Force>,
    /// Steps per servo cycle.
    steps: usize,
    going: Option<Going<'a>>,
    /// The last commands, oldest first.
    window: Vec<(Drives, Vector3<f64>)>,
    /// Results, once per servo cycle.
    pub record: Record,
}

impl<'a> Follower<'a> {
    /// Creates a follower, also under a force; `step` is the longest step in seconds.
    pub fn new(config: &'a Mechanism, model: &Model, force: Force, step: f64) -> Self {
        Self {
            config,
            model: model.clone(),
            force: Some(force),
            steps: (config.period / step).ceil() as usize,
            going: None,
            window: vec![],
            record: Record { step: config.period, ..Record::default() },
        }
    }

    /// Returns the number of steps per servo cycle.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Returns the volume that a cutter has removed from a stock, mm³; `None` without a stock.
    pub fn removed(&self) -> Option<f64> {
        match &self.going {
            Some(Going { force: Force::Layer(layer), .. }) => Some(layer.stock.removed()),
            _ => None,
        }
    }

    /// Processes the commanded pose of a servo cycle, machine units, and the tool vector there.
    ///
    /// # Errors
    /// See [`Ended`].
    pub fn see(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<(), Ended> {
        if self.going.is_none() {
            self.start(pose, tool)?;
        }
        let Some(going) = &mut self.going else { return Ok(()) };
        let command = (going.simulation.drives(pose, tool)?, *tool);
        if self.window.is_empty() {
            self.window = vec![command; 3];
        }
        self.window.push(command);
        self.cycle()
    }

    fn start(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<(), Ended> {
        let simulation = Simulation::new(self.config, &self.model, pose, tool)?;
        let mut simulation = simulation.ok_or(Ended::Singular)?;
        let drives = simulation.drives(pose, tool)?;
        let motion = simulation.resting(pose, &drives)?;
        let force = self.force.take().unwrap_or(Force::None);
        self.going = Some(Going { simulation, motion, force, time: 0.0 });
        Ok(())
    }

    /// Simulates between the middle two of the last four commands.
    fn cycle(&mut self) -> Result<(), Ended> {
        let (Some(going), [(a, _), (b, tool), (c, _), (d, _)]) =
            (&mut self.going, &self.window[..])
        else {
            return Ok(());
        };
        let (period, steps) = (self.config.period, self.steps);
        going.simulation.hold(tool);
        self.record.see(going.off(b), &going.simulation.forces);
        for k in 0..steps {
            let drives = |share: f64| {
                Drives::between([a, b, c, d], (k as f64 + share) / steps as f64, period)
            };
            going.step(period / steps as f64, drives)?;
        }
        self.window.remove(0);
        Ok(())
    }

    /// Simulates the last two cycles, with the last command kept constant.
    ///
    /// # Errors
    /// See [`Ended`].
    pub fn finish(mut self) -> Result<Record, Ended> {
        for _ in 0..2 {
            if let Some(last) = self.window.last().copied() {
                self.window.push(last);
                self.cycle()?;
            }
        }
        self.record.removed = self.removed();
        Ok(self.record)
    }
}
