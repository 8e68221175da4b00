// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC's motion controller from the kinematics' view: its calls in order, its changes of mode,
//! and its interpolators. Nothing is queued, so it counts as in position. Drives follow exactly.

use crate::module::{Joints, Module, Pose};

/// Modes of the motion controller while the machine is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Free,
    /// World mode, jogging.
    Teleop,
    /// World mode, moves of programs and MDI.
    Coordinated,
}

/// One joint's interpolator: the uniform cubic B-spline of the last four points.
#[derive(Clone, Copy, Default)]
struct Spline {
    points: Option<[f64; 4]>,
    /// Servo cycles since the last point.
    cycles: u32,
}

impl Spline {
    fn needs_point(&self, rate: u32) -> bool {
        self.points.is_none() || self.cycles >= rate
    }

    /// Adds the next point if one is due. The first one fills the spline.
    fn add(&mut self, point: f64, rate: u32) {
        if self.needs_point(rate) {
            let [_, a, b, c] = self.points.unwrap_or([point; 4]);
            *self = Self { points: Some([a, b, c, point]), cycles: 0 };
        }
    }

    fn next(&mut self, rate: u32) -> f64 {
        let t = f64::from(self.cycles) / f64::from(rate);
        self.cycles += 1;
        let weights = [
            (1.0 - t).powi(3),
            3.0 * t.powi(3) - 6.0 * t * t + 4.0,
            -3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0,
            t.powi(3),
        ];
        let points = self.points.expect("a point was added");
        // Differences from a point, so that equal points are reproduced exactly.
        let pairs = weights.iter().zip(points);
        points[3] + pairs.map(|(w, p)| w * (p - points[3]) / 6.0).sum::<f64>()
    }
}

/// The motion controller with one module. Must not be moved once cycles have run: the module distinguishes
/// LinuxCNC's poses by their addresses.
pub struct Controller<'a> {
    module: &'a Module,
    /// Servo period in nanoseconds.
    pub period: i64,
    /// Servo cycles from one point of the trajectory to the next.
    pub rate: u32,
    mode: Mode,
    wanted: Mode,
    is_on: bool,
    is_homed: bool,
    kinematics: i32,
    wanted_kinematics: i32,
    home: Pose,
    pub command: Pose,
    is_command_known: bool,
    feedback: Pose,
    is_feedback_known: bool,
    coarse: Joints,
    splines: [Spline; 16],
    /// End point of a queued move that feed-inhibit delays.
    pub queued: Option<Pose>,
    /// Values that LinuxCNC writes to the pins of the tool offset in this cycle.
    pub request: Option<[f64; 3]>,
    /// Commanded joint positions after the interpolators, cycle by cycle.
    pub positions: Vec<Joints>,
    pub refusals: Vec<i32>,
}

impl<'a> Controller<'a> {
    /// Creates a controller, homed and on, in coordinated mode at a pose.
    /// # Panics
    /// If the module refuses the pose.
    pub fn new(module: &'a Module, pose: Pose) -> Self {
        let coarse = module.inverse(&pose).expect("a pose of the workspace");
        Self {
            module,
            period: 1_000_000,
            rate: 1,
            mode: Mode::Coordinated,
            wanted: Mode::Coordinated,
            is_on: true,
            is_homed: true,
            kinematics: 0,
            wanted_kinematics: 0,
            home: pose,
            command: pose,
            is_command_known: true,
            feedback: pose,
            is_feedback_known: true,
            coarse,
            splines: [Spline::default(); 16],
            queued: None,
            request: None,
            positions: vec![coarse],
            refusals: vec![],
        }
    }

    /// Requests a mode, as LinuxCNC's task does.
    pub fn set_mode(&mut self, mode: Mode) {
        self.wanted = mode;
    }

    /// Switches the machine on or off.
    pub fn turn(&mut self, on: bool) {
        if !on && self.is_on {
            self.drain();
        }
        self.is_on = on;
    }

    /// Homes or unhomes all joints at their positions; LinuxCNC unhomes in joint mode or with the machine off.
    pub fn set_homed(&mut self, is_homed: bool) {
        assert!(is_homed || !self.is_on || self.mode == Mode::Free, "refused by LinuxCNC");
        self.is_homed = is_homed;
    }

    /// Requests kinematics by their number.
    pub fn switch(&mut self, kinematics: i32) {
        self.wanted_kinematics = kinematics;
    }

    /// Runs a servo cycle: command handler, motion controller, monitor.
    pub fn cycle(&mut self) {
        if let Some(end) = self.queued {
            self.module.inverse(&end).expect("an end point within reach");
        }
        self.handle_switch();
        let found = *self.positions.last().expect("the start");
        if self.is_homed {
            if !self.is_feedback_known {
                self.feedback = self.home;
            }
            self.is_feedback_known = self.module.forward_into(&found, &mut self.feedback) >= 0;
        }
        self.change_mode();
        let positions = if self.is_on { self.commanded(found) } else { found };
        if !self.is_on {
            self.command = self.feedback;
        }
        self.positions.push(positions);
        self.module.set("machine-on", f64::from(self.is_on));
        if let Some(request) = self.request.take() {
            for (pin, value) in
                ["tool-offset-x", "tool-offset-y", "tool-offset"].iter().zip(request)
            {
                self.module.set(pin, value);
            }
        }
        self.module.monitor_in_cycle_of(self.period);
    }

    fn handle_switch(&mut self) {
        if self.kinematics == self.wanted_kinematics {
            return;
        }
        self.kinematics = self.wanted_kinematics;
        if self.module.switch(self.kinematics) == 0 {
            let positions = *self.positions.last().expect("the start");
            let _ = self.module.forward_into(&positions, &mut self.command);
        }
    }

    fn change_mode(&mut self) {
        if self.mode == self.wanted || !self.is_on {
            return;
        }
        if self.wanted != Mode::Free {
            self.drain();
        }
        if self.wanted == Mode::Teleop {
            // LinuxCNC ignores the code.
            let _ = self.module.forward_into(&self.coarse, &mut self.command);
        }
        self.mode = self.wanted;
    }

    fn drain(&mut self) {
        self.splines = [Spline::default(); 16];
    }

    /// Returns the commanded joint positions of this cycle.
    fn commanded(&mut self, before: Joints) -> Joints {
        if self.mode == Mode::Free {
            let coarse = std::mem::replace(&mut self.coarse, before);
            if self.is_homed {
                if !self.is_command_known {
                    self.command = self.home;
                }
                self.is_command_known = self.module.forward_into(&coarse, &mut self.command) >= 0;
            } else {
                self.is_command_known = false;
            }
            return before;
        }
        let rate = self.rate;
        if self.mode == Mode::Teleop || self.splines[0].needs_point(rate) {
            let code = self.module.inverse_into(&self.command, &mut self.coarse);
            if code != 0 {
                self.refusals.push(code);
                self.turn(false);
                return before;
            }
            for (spline, point) in self.splines.iter_mut().zip(self.coarse) {
                spline.add(point, rate);
            }
        }
        let mut positions = before;
        for (position, spline) in positions.iter_mut().zip(&mut self.splines) {
            *position = spline.next(rate);
        }
        positions
    }

    /// Returns the largest ratios to the joints' speed and acceleration limits over successive cycles.
    pub fn shares(&self, limits: &[(f64, f64)]) -> (f64, f64) {
        let dt = self.period as f64 * 1e-9;
        let (mut speed, mut acceleration) = (0.0_f64, 0.0_f64);
        for (j, (most_speed, most_acceleration)) in limits.iter().enumerate() {
            for three in self.positions.windows(3) {
                let [a, b, c] = [three[0][j], three[1][j], three[2][j]];
                speed = speed.max((c - b).abs() / dt / most_speed);
                acceleration =
                    acceleration.max(((c - b) - (b - a)).abs() / (dt * dt) / most_acceleration);
            }
        }
        (speed, acceleration)
    }
}
