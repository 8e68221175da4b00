// SPDX-License-Identifier: GPL-2.0-or-later
//! A simulated machine that differs from its drawing, and an operator who reads a gauge on it.

use calibrate::at_tool;
use calibrate::gauge::{Gauge, Kind, Object};
use calibrate::model::{Frame, Model, Tolerance};
use calibrate::propose::{Proposal, propose};
use calibrate::setup::Setup;
use calibrate::shape;
use calibrate::sheet;
use calibrate::study::{self, Given, SlipError, Wishes};
use kinematics::{Joints, Machine, Pose, Solver, Vector3};
use machine::read::mechanism::Mechanism;
use machine::rows::with_dependent;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, Normal};
use std::fs;
use test_support::shipped;

/// Returns a dial of 2 um on a plate and, if it must detect X and Y, on two edges of it as well.
pub(crate) fn dial(place: [f64; 3], size: f64, has_edges: bool, unit: &str) -> String {
    let [x, y, z] = place;
    let half = size / 2.0;
    let mm = if unit == "mm" { 1.0 } else { 1.0 / 25.4 };
    let mut text = format!(
        "unit = \"{unit}\"\ngauge = \"dial\"\nreading = \"um\"\ndeviation = 2.0\nrange = [0, 2000]\n\
         zero = {}\ntool = [0, 0, {}]\nclearance = {}\nfeed = {}\n\n\
         [[object]]\nname = \"plate\"\nplace = [{x}, {y}, {z}]\nsize = [{size}, {size}]\n",
        0.2 * mm,
        60.0 * mm,
        10.0 * mm,
        300.0 * mm
    );
    if has_edges {
        // Normal to X and to Y, seen from outside.
        for (name, place, angles) in [
            ("right", [x + half, y, z], [0.0, 90.0, 0.0]),
            ("rear", [x, y + half, z], [-90.0, 0.0, 0.0]),
        ] {
            let strip = if name == "right" { [4.0 * mm, size] } else { [size, 4.0 * mm] };
            text += &format!(
                "[[object]]\nname = \"{name}\"\nplace = {place:?}\nangles = {angles:?}\nsize = {strip:?}\n"
            );
        }
    }
    text
}

/// A machine that differs from its drawing, and the readings of a gauge on it.
pub(crate) struct Shop {
    pub(crate) config: Mechanism,
    pub(crate) setup: Setup,
    pub(crate) proposal: Proposal,
    tolerance: f64,
    random: Pcg64,
    pub(crate) truth: Machine,
    /// Travel of the drives per commanded travel.
    pub(crate) drives: f64,
    zeros: Vec<f64>,
    objects: Vec<Object>,
}

impl Shop {
    pub(crate) fn new(machine: &str, gauge: &str, tolerance: f64) -> Self {
        Self::of(shipped::config(machine), gauge, tolerance)
    }

    /// Opens a shop with a machine.
    pub(crate) fn of(config: Mechanism, gauge: &str, tolerance: f64) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("gauge.toml");
        fs::write(&file, gauge).unwrap();
        let setup = Setup::read(&config, &file).unwrap();
        let proposal = propose(&config, &setup, &Tolerance::of_lengths(tolerance), |_| {}).unwrap();
        let truth = config.machine.clone();
        let objects = setup.objects.clone();
        let random = Pcg64::seed_from_u64(0);
        let zeros = vec![];
        let mut shop =
            Self { config, setup, proposal, tolerance, random, truth, drives: 1.0, zeros, objects };
        shop.build(1);
        shop
    }

    fn normal(&mut self) -> f64 {
        Normal::standard().inverse_cdf(self.random.random_range(f64::EPSILON..1.0))
    }

    /// Builds another machine, with its objects slightly away from their nominal positions.
    pub(crate) fn build(&mut self, seed: u64) {
        self.random = Pcg64::seed_from_u64(seed);
        let tolerance = Tolerance::of_lengths(self.tolerance);
        let model = Model::new(self.config.geometry, self.config.offsets, &tolerance).unwrap();
        let deviations: Vec<f64> = model.parameters.iter().map(|p| p.deviation).collect();
        let changes: Vec<f64> = deviations.iter().map(|d| d * self.normal()).collect();
        self.truth = model.machine(&changes).unwrap();
        let zero = self.setup.gauge.zero;
        self.zeros = (0..self.objects.len()).map(|_| zero * self.normal()).collect();
        for (k, object) in self.setup.objects.clone().into_iter().enumerate() {
            let mut off = || 0.1 * self.config.units_per_mm * self.normal();
            let shift = Vector3::new(off(), off(), off());
            let turn = Pose::from_degrees([0.0, 0.0, 0.0, 0.05, -0.03, 0.02]).rotation();
            let Frame { origin, rotation } = object.frame;
            let frame = Frame { origin: origin + shift, rotation: turn * rotation };
            self.objects[k] = Object { frame, ..object };
        }
        self.find_objects();
    }

    /// Moves the planes to the positions at which the gauge shows about the expected value at the first pose of each,
    /// as an
    /// operator would find them.
    pub(crate) fn find_objects(&mut self) {
        let gauge = self.setup.gauge.clone();
        for object in 0..self.objects.len() {
            let stop = self.proposal.stops.iter().find(|stop| stop.object == object);
            let Some(stop) = stop.filter(|_| gauge.kind != Kind::Bar) else { continue };
            let (at, expected) = (stop.at, stop.expected);
            let normal: Vector3<f64> = self.objects[object].frame.rotation.column(2).into();
            let micrometre = 1e-3 * self.config.units_per_mm;
            let off = (self.shown(&gauge, object, at) - expected - 20.0) * micrometre;
            let sign = if gauge.kind == Kind::Dial { -1.0 } else { 1.0 };
            self.objects[object].frame.origin += normal * (sign * off);
        }
    }

    /// Returns the gauge reading at a pose, in its unit, without noise.
    fn shown(&self, gauge: &Gauge, object: usize, at: [f64; 6]) -> f64 {
        let tool = gauge.tool;
        let mut pose = Pose::from_degrees(at);
        pose.position += tool - self.config.spindle;
        let there = self.reached(&pose, &tool);
        let Frame { origin, rotation } = self.objects[object].frame;
        let away = there.position - tool - origin;
        let normal: Vector3<f64> = rotation.column(2).into();
        // Direction of the dial's point: the drawing's normal distinguishes platform axes.
        let drawn: Vector3<f64> = self.setup.objects[object].frame.rotation.column(2).into();
        let axis = drawn.map(|x| if x.abs() > 0.9 { x.signum() } else { 0.0 });
        let zero = self.zeros[object];
        let length = match gauge.kind {
            Kind::Dial => {
                (gauge.radius - away.dot(&normal)) / (there.rotation() * axis).dot(&normal) - zero
            }
            Kind::Feeler => (away + there.rotation() * axis * zero).dot(&normal) - gauge.radius,
            Kind::Bar => away.norm() - self.zeros[0],
        };
        let unit = match gauge.scale.name() {
            "um" => 1e-3,
            "mm" => 1.0,
            "thou" => 0.0254,
            _ => 25.4,
        };
        length / (unit * self.config.units_per_mm)
    }

    /// Returns the true pose when the control commands a pose.
    pub(crate) fn reached(&self, pose: &Pose, tool: &Vector3<f64>) -> Pose {
        let joints = self.driven(&self.config.machine.inverse(pose, tool).unwrap());
        let found = self.truth.forward(&joints, pose, tool, &Solver::default()).unwrap().pose;
        with_dependent(&self.truth, &found, tool).unwrap()
    }

    /// Returns the joints that the drives reach: all are homed at the joints of the pose at home.
    fn driven(&self, joints: &Joints) -> Joints {
        let home =
            self.config.machine.inverse(&self.config.home_pose(), &self.config.spindle).unwrap();
        std::array::from_fn(|i| home[i] + self.drives * (joints[i] - home[i]))
    }

    /// Fills in the table, in this number of runs with this noise.
    pub(crate) fn table(&mut self, runs: usize, noise: f64) -> String {
        let gauge = self.setup.gauge.clone();
        let stops = self.proposal.stops.clone();
        let empty = sheet::empty(&self.config, &gauge, &self.setup.objects, &stops);
        let lines: Vec<&str> = empty.lines().collect();
        let (heading, rows) = lines.split_at(lines.len() - stops.len());
        let mut text = heading.join("\n") + "\n";
        for (row, stop) in rows.iter().zip(&stops) {
            let shown = self.shown(&gauge, stop.object, stop.at);
            let typed: Vec<String> =
                (0..runs).map(|_| format!("{:.3}", shown + noise * self.normal())).collect();
            let row = row.strip_suffix(",,").unwrap();
            text += &format!("{row},{},{}\n", typed[0], typed.get(1).map_or("", |x| x));
        }
        text
    }

    pub(crate) fn given(&self, table: &str) -> Given {
        self.read(table).unwrap()
    }

    /// Reads a table as `pkm calibrate` does.
    pub(crate) fn read(&self, table: &str) -> Result<Given, SlipError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("table.csv");
        fs::write(&file, table).unwrap();
        let tolerance = Tolerance::of_lengths(self.tolerance);
        let wishes = Wishes { tolerance, noise: None, plate: None };
        let files = [file];
        let given = study::read(&self.config, &files, &wishes)?;
        study::look_for_mistakes(&self.config, &given, &files)?;
        Ok(given)
    }

    /// Returns the root mean square of the tip's error over poses that were not measured.
    pub(crate) fn error(&self, control: &Machine) -> f64 {
        let tool = self.setup.gauge.tool;
        let poses = at_tool::poses(&self.config, &tool, 200, 77);
        let errors =
            shape::errors(control, &self.truth, |joints| self.driven(joints), &poses, &tool)
                .unwrap();
        (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
    }
}
