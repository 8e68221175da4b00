// SPDX-License-Identifier: GPL-2.0-or-later
//! Input data of the page: the scene, the machine for its kinematics, names of limits, and a program.

use crate::track::{Point, Track, VALUES};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use kinematics::{Letter, Limit, Part};
use machine::files;
use machine::limits;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use machine::read::models::Model;
use machine::scene::Scene;
use page_core::Described;
use program::timeline::{Abscissa, Sample, Thinned};
use serde::Serialize;
use std::collections::BTreeMap;

/// Version of the data format; increased when the page's code and its data become incompatible.
const VERSION: u32 = 2;

/// Largest size of a shape file; the page contains the whole file.
const MOST_BYTES: u64 = 20_000_000;

/// All data of the page.
#[derive(Serialize)]
pub struct Data {
    version: u32,
    title: String,
    mechanisms: Vec<PageMechanism>,
    /// Whether the machine is shown live.
    is_live: bool,
    program: Option<Program>,
    /// Why there is no program to show, if one was requested.
    error: Option<String>,
    /// Parts that are drawn without their shape, with the reason.
    problems: Vec<String>,
}

#[derive(Serialize)]
struct PageMechanism {
    scene: Scene,
    /// Data of the page's kinematics, 64-bit floating point numbers.
    numbers: String,
    /// Names and units of limits, by [`key`].
    limits: BTreeMap<String, Named>,
    /// The tool vector without a tool.
    tool: [f64; 3],
    shapes: Vec<Shape>,
}

#[derive(Serialize)]
struct Shape {
    part: &'static str,
    name: String,
    scale: f64,
    place: [f64; 6],
    bytes: String,
}

/// The displayed name of a limit of a part.
#[derive(Serialize)]
struct Named {
    part: String,
    limit: &'static str,
    unit: String,
}

#[derive(Serialize)]
struct Program {
    name: String,
    text: String,
    end: f64,
    /// Times and values of points, one column after the other.
    points: Columns<f64>,
    /// Number of values of each mechanism; those of the extra axes follow.
    of_mechanism: usize,
    /// Start times of lines, and the lines.
    lines: Columns<f64>,
    curves: Option<Curves>,
    /// Output of `pkm preflight --format json`.
    report: serde_json::Value,
}

/// Quantities of the machine over time.
#[derive(Serialize)]
struct Curves {
    names: Vec<Curve>,
    /// Times, and the values of each curve.
    values: Columns<f32>,
}

#[derive(Serialize)]
struct Curve {
    /// The picture that contains the curve.
    group: String,
    name: String,
    unit: String,
    /// Smallest and largest allowed value.
    range: [Option<f64>; 2],
}

/// Numbers of equally long columns, one column after the other, little-endian.
#[derive(Serialize)]
struct Columns<T> {
    rows: usize,
    columns: usize,
    bytes: String,
    #[serde(skip)]
    kind: std::marker::PhantomData<T>,
}

impl<T> Columns<T> {
    fn new<const N: usize>(columns: &[Vec<T>], bytes: impl Fn(&T) -> [u8; N]) -> Self {
        let all: Vec<u8> = columns.iter().flatten().flat_map(bytes).collect();
        Self {
            rows: columns.first().map_or(0, Vec::len),
            columns: columns.len(),
            bytes: BASE64_STANDARD.encode(all),
            kind: std::marker::PhantomData,
        }
    }
}

impl Data {
    pub fn new(config: &MachineConfig, is_live: bool) -> Self {
        let stem = config.file.file_stem().unwrap_or_default();
        let shapes: Vec<Result<Shape, String>> =
            config.first().models.iter().map(Shape::read).collect();
        let problems = shapes.iter().filter_map(|shape| shape.as_ref().err().cloned()).collect();
        let mut mechanisms: Vec<_> = config.mechanisms.iter().map(PageMechanism::new).collect();
        mechanisms[0].shapes = shapes.into_iter().filter_map(Result::ok).collect();
        Self {
            version: VERSION,
            title: stem.to_string_lossy().into_owned(),
            mechanisms,
            problems,
            is_live,
            program: None,
            error: None,
        }
    }

    /// Returns whether it shows a program in motion.
    pub fn moves(&self) -> bool {
        self.program.as_ref().is_some_and(|program| program.points.rows > 1)
    }

    /// Returns the parts that are drawn without their shape, with the reason.
    pub fn problems(&self) -> &[String] {
        &self.problems
    }

    /// Sets the reason why there is no program.
    pub fn with_error(mut self, error: String) -> Self {
        self.error = Some(error);
        self
    }

    /// Adds a program: its name and text, its motion, and the preflight report.
    pub fn with_program(
        mut self,
        config: &Mechanism,
        [name, text]: [String; 2],
        track: &Track,
        course: Option<&Thinned>,
        report: serde_json::Value,
    ) -> Self {
        let points = track.points();
        let width = points.first().map_or(0, |point| point.values.len());
        let mut columns = vec![points.iter().map(|point| point.at).collect()];
        let value = |k: usize| move |point: &Point| rounded(point.values[k]);
        columns.extend((0..width).map(|k| points.iter().map(value(k)).collect()));
        let lines = track.lines();
        let lines = [
            lines.iter().map(|(at, _)| *at).collect(),
            lines.iter().map(|(_, line)| f64::from(*line)).collect(),
        ];
        self.program = Some(Program {
            name,
            text,
            end: track.end(),
            points: Columns::new(&columns, |value: &f64| value.to_le_bytes()),
            of_mechanism: VALUES,
            lines: Columns::new(&lines, |value: &f64| value.to_le_bytes()),
            curves: course.map(|course| Curves::new(config, course)),
            report,
        });
        self
    }

    pub fn json(&self) -> String {
        serde_json::to_string(self).expect("numbers and names")
    }
}

/// Rounds to 2⁻²⁴ of a unit, far below what is visible: numbers with trailing zeros compress better.
fn rounded(value: f64) -> f64 {
    const PLACES: f64 = (1 << 24) as f64;
    (value * PLACES).round() / PLACES
}

impl PageMechanism {
    fn new(config: &Mechanism) -> Self {
        let limits = limits::of(config);
        let described = Described { geometry: config.geometry, offsets: config.offsets, limits };
        let mut bytes = vec![];
        described.write(|value| bytes.extend(value.to_le_bytes()));
        Self {
            scene: Scene::new(config),
            numbers: BASE64_STANDARD.encode(bytes),
            limits: named(config),
            tool: config.spindle.into(),
            shapes: vec![],
        }
    }
}

impl Shape {
    fn read(model: &Model) -> Result<Self, String> {
        let Model { part, file, scale, place, .. } = model;
        let problem = |error: String| {
            format!("{part} is drawn without its model: {}: {error}", file.display())
        };
        let size = std::fs::metadata(file).map_err(|error| problem(error.to_string()))?.len();
        if size > MOST_BYTES {
            return Err(problem(format!(
                "{size} bytes, expected at most {MOST_BYTES}: use a coarser mesh"
            )));
        }
        let bytes = files::read(file).map_err(|error| problem(error.error.to_string()))?;
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Self { part, name, scale: *scale, place: *place, bytes: BASE64_STANDARD.encode(bytes) })
    }
}

/// Returns the names of every possible limit of all parts.
fn named(config: &Mechanism) -> BTreeMap<String, Named> {
    let letters = Letter::ALL.into_iter().map(Part::Axis);
    let joints = (0..config.joints.len() + config.extra.len()).map(Part::Joint);
    let legs = (0..config.legs()).map(Part::Leg);
    let pairs = config.pairs().into_iter().map(Part::Legs);
    let parts: Vec<Part> = std::iter::once(Part::Whole)
        .chain(letters)
        .chain(joints)
        .chain(legs)
        .chain(pairs)
        .collect();
    let all = Limit::ALL.into_iter().flat_map(|limit| parts.iter().map(move |part| (limit, *part)));
    all.filter(|(limit, part)| belongs(*limit, *part))
        .map(|(limit, part)| {
            let named = Named {
                part: limits::part(config, limit, part),
                limit: limit.name(),
                unit: limits::unit(config, limit, part),
            };
            (key(limit, part), named)
        })
        .collect()
}

/// Returns whether a limit applies to a kind of part.
fn belongs(limit: Limit, part: Part) -> bool {
    match limit {
        Limit::Axis => matches!(part, Part::Axis(_)),
        Limit::JointRange | Limit::JointSpeed | Limit::JointAcceleration => {
            matches!(part, Part::Joint(_))
        }
        Limit::Clearance => matches!(part, Part::Legs(_)),
        Limit::Tilt | Limit::Conditioning => part == Part::Whole,
        Limit::Reach
        | Limit::DeadPoint
        | Limit::BaseCone
        | Limit::PlatformCone
        | Limit::BasePyramid
        | Limit::PlatformPyramid => matches!(part, Part::Leg(_)),
    }
}

/// Returns the key by which the page's kinematics identify a limit and a part.
fn key(limit: Limit, part: Part) -> String {
    let [kind, first, second] = page_core::numbers(part);
    format!("{} {kind} {first} {second}", limit.index())
}

impl Curves {
    fn new(config: &Mechanism, course: &Thinned) -> Self {
        let mut all =
            Self { names: vec![], values: Columns::new(&[], |value: &f32| value.to_le_bytes()) };
        let mut columns = vec![course.samples.iter().map(|sample| sample.at as f32).collect()];
        let mut add = |curve: Curve, value: &dyn Fn(&Sample) -> f64| {
            all.names.push(curve);
            columns.push(course.samples.iter().map(|sample| value(sample) as f32).collect());
        };
        let joints = 0..config.joints.len() + config.extra.len();
        let name = |i: usize| config.joint(i).name.clone();
        for i in joints.clone() {
            let unit = config.unit_of(i);
            let curve = Curve {
                // A picture has one unit.
                group: match unit == config.unit_of(0) {
                    true => "joints".into(),
                    false => format!("joints in {unit}"),
                },
                name: name(i),
                unit: unit.into(),
                range: config.range_of(i).map(Some),
            };
            add(curve, &|sample| sample.joints[i][0]);
        }
        let share = |group: &str, name| {
            let (group, unit) = (group.into(), "%".into());
            Curve { group, name, unit, range: [None, Some(100.0)] }
        };
        if course.abscissa == Abscissa::Seconds {
            for i in joints.clone() {
                add(share("speeds", name(i)), &|sample| 100.0 * sample.speeds[i]);
            }
            for i in joints {
                add(share("following errors", name(i)), &|sample| 100.0 * sample.errors[i]);
            }
            add(share("feed", "feed allowed by the guard".into()), &|sample| 100.0 * sample.feed);
        }
        for limit in Limit::ALL {
            let room = |sample: &Sample| sample.rooms[limit.index()];
            if course.samples.iter().any(|sample| room(sample).is_finite()) {
                let curve = Curve {
                    group: "margins".into(),
                    name: limit.name().into(),
                    unit: "%".into(),
                    range: [Some(0.0), None],
                };
                add(curve, &|sample| 100.0 * room(sample));
            }
        }
        all.values = Columns::new(&columns, |value| value.to_le_bytes());
        all
    }
}
