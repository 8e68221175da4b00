// SPDX-License-Identifier: GPL-2.0-or-later
//! A calibration from input files to results.

use super::at_tool::{self, CONFIDENCE, Ellipsoid};
use super::fit::{Fit, Misfit, chi_square, fit, held_out, residuals, rms};
use super::heading;
use super::log::{self, BadLog, HEADER};
use super::mistakes::{self, Typed};
use super::model::{Frame, Model, Parameter, Quantity, Tolerance};
use super::observe;
use super::plan;
use super::plate::{Astray, Plate, PlateError};
use super::points;
use super::reading::{Changed, Instrument, Measured, Reading};
use super::scale::{DriveScale, with_scale};
use super::shape::{self, Shape};
use super::sheet::{self, Sheet};
use super::table;
use kinematics::{Fault, Pose, Vector3};
use machine::files::{AtFile, Locate, read_text};
use machine::read::ini::IniError;
use machine::read::mechanism::Mechanism;
use nalgebra::{DMatrix, DVector};
use std::io;
use std::path::{Path, PathBuf};

/// Candidates for the next poses.
const CANDIDATES: usize = 200;

/// Settings of a calibration.
#[derive(Clone, Debug)]
pub struct Wishes {
    /// Deviation of the machine from its drawing.
    pub tolerance: Tolerance,
    /// Noise of one number of a reading; estimated if it is not given.
    pub noise: Option<f64>,
    pub plate: Option<PathBuf>,
}

/// Contents of the input files.
#[derive(Debug)]
pub struct Given {
    /// The machine as drawn, and its parameters.
    pub model: Model,
    pub readings: Vec<Reading>,
    /// Description of each frame, for messages.
    pub instruments: Vec<String>,
    /// Noise of one number, from settings and tables; `None` if it is to be estimated.
    pub noise: Option<f64>,
    /// Tables that the operator filled in.
    pub typed: Vec<Typed>,
}

/// Agreement of all readings with stated noise and tolerances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Sum of squares, see [`super::fit::Fit`], each in its standard deviations.
    pub chi_square: f64,
    pub numbers: usize,
    /// The value that it exceeds once in a thousand times if both are as stated.
    pub most: f64,
    /// The reading that, left out, would reduce the sum the most, and the reduction.
    pub foremost: (usize, f64),
}

/// Results of a calibration.
#[derive(Debug)]
pub struct Study {
    /// The machine as drawn, and its parameters.
    pub model: Model,
    pub readings: Vec<Reading>,
    /// Description of each frame, for messages.
    pub instruments: Vec<String>,
    /// Tables that the operator filled in.
    pub typed: Vec<Typed>,
    pub found: Fit,
    /// Root mean square residual with the machine as drawn, only frames fitted.
    pub as_drawn: f64,
    /// Root mean square of readings not used, see [`held_out`].
    pub held_out: f64,
    /// Number of independent changes that the readings determine, without noise.
    pub rank: usize,
    /// Number of independent changes that they determine better than the drawing does.
    pub improved: usize,
    /// Numbers of changes that no reading detects, and the reason.
    pub unseen: Vec<(usize, &'static str)>,
    /// Confidence regions of the tip, from the drawing alone and now: at home, and where they are largest. Relative to
    /// the first frame: `None` if the readings do not determine its pose.
    pub at_tool: Option<[(Ellipsoid, Ellipsoid); 2]>,
    /// Error of the tip over the workspace, independent of the workpiece's placement, from the drawing alone and
    /// now.
    pub shape: [Shape; 2],
    /// Scale of the drives, which the new geometry does not contain.
    pub scale: DriveScale,
    /// Agreement of the readings with their stated noise, if any is stated.
    pub agreement: Option<Agreement>,
    /// Errors of the holes as measured by the control, largest first.
    pub holes: Vec<HoleError>,
}

/// Error of a hole as measured by the control, at one orientation.
#[derive(Clone, Debug, PartialEq)]
pub struct HoleError {
    /// Name of one of its touches, for messages.
    pub name: String,
    /// Distance of its axis from the plate's position.
    pub miss: f64,
}

/// Why files cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    #[error(transparent)]
    Plate(#[from] PlateError),
    #[error(transparent)]
    Ini(#[from] IniError),
    #[error(transparent)]
    Geometry(#[from] AtFile<Fault>),
    /// A line of a file, counted from 1.
    #[error("{}:{}", .0.file.display(), .0.error)]
    Line(AtFile<BadLog>),
    #[error(transparent)]
    Astray(#[from] AtFile<Astray>),
    #[error("{}: its readings have no stated deviation, unlike others: add --noise", .0.display())]
    NoNoise(PathBuf),
    #[error("{}: the same readings as {}: give the file only once", .0.display(), .1.display())]
    Twice(PathBuf, PathBuf),
    #[error("{}: touches need the probed plate: add --plate FILE.toml", .0.display())]
    NoPlate(PathBuf),
}

impl From<AtFile<BadLog>> for ReadError {
    fn from(error: AtFile<BadLog>) -> Self {
        Self::Line(error)
    }
}

/// Reads files, and creates the model with a frame for each placement of plate or instrument.
///
/// # Errors
/// See [`ReadError`].
pub fn read(config: &Mechanism, files: &[PathBuf], wishes: &Wishes) -> Result<Given, ReadError> {
    let plate = match &wishes.plate {
        Some(file) => Some(Plate::read(file, config.units_per_mm)?),
        None => None,
    };
    let model = Model::new(config.geometry, config.offsets, &wishes.tolerance).at(&config.file)?;
    let (readings, instruments) = (vec![], vec![]);
    let mut given = Given { model, readings, instruments, noise: wishes.noise, typed: vec![] };
    let mut texts: Vec<String> = vec![];
    for (k, file) in files.iter().enumerate() {
        let text = read_text(file)?;
        if let Some(other) = texts.iter().position(|own| *own == text) {
            return Err(ReadError::Twice(file.clone(), files[other].clone()));
        }
        match sheet::is_one(&text) {
            true => given.add_sheet(config, file, &text, k)?,
            false => given.add_file(config, file, &text, plate.as_ref())?,
        }
        texts.push(text);
    }
    given.weigh(config, files)?;
    Ok(given)
}

impl Given {
    fn add_file(
        &mut self,
        config: &Mechanism,
        file: &Path,
        text: &str,
        plate: Option<&Plate>,
    ) -> Result<(), ReadError> {
        let number = self.model.frames.len();
        let (own, frame) = of_file(config, file, text, plate, number)?;
        self.instruments.push(format!("of {}", file.display()));
        self.model = self.model.clone().with_unknown_frame(frame);
        self.add(own);
        Ok(())
    }

    fn add_sheet(
        &mut self,
        config: &Mechanism,
        file: &Path,
        text: &str,
        number: usize,
    ) -> Result<(), ReadError> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let sheet = Sheet::read(config, text).at(file)?;
        let is_zero = |p: &Parameter| matches!(p.quantity, Quantity::Zero(_));
        let zero = self.model.parameters.iter().filter(|p| is_zero(p)).count();
        let (own, zeros) = sheet.readings(config, self.model.frames.len(), zero, &name).at(file)?;
        for object in &sheet.objects {
            self.instruments.push(format!("{} of {}", object.name, file.display()));
            self.model = self.model.clone().with_unknown_frame(object.frame);
        }
        for k in 0..zeros {
            self.model = self.model.clone().with_zero(zero + k, sheet.gauge.zero);
        }
        self.typed.push(Typed { file: number, sheet, first: self.readings.len() });
        self.add(own);
        Ok(())
    }

    fn add(&mut self, mut own: Vec<Reading>) {
        let groups = self.readings.iter().map(|reading| reading.group + 1).max().unwrap_or(0);
        own.iter_mut().for_each(|reading| reading.group += groups);
        self.readings.extend(own);
    }

    /// Weights readings of tables by their stated deviation, relative to the smallest.
    fn weigh(&mut self, config: &Mechanism, files: &[PathBuf]) -> Result<(), ReadError> {
        let of = |typed: &Typed| typed.sheet.gauge.length(config, typed.sheet.deviation());
        let Some(best) = self.typed.iter().map(of).min_by(f64::total_cmp) else { return Ok(()) };
        let silent = (0..files.len()).find(|k| !self.typed.iter().any(|typed| typed.file == *k));
        if let (Some(k), None) = (silent, self.noise) {
            return Err(ReadError::NoNoise(files[k].clone()));
        }
        let noise = *self.noise.get_or_insert(best);
        for typed in &self.typed {
            let count = typed.sheet.rows.iter().map(|row| row.shown.len()).sum::<usize>();
            for reading in &mut self.readings[typed.first..typed.first + count] {
                reading.instrument.weight = noise / of(typed);
            }
        }
        Ok(())
    }
}

fn of_file(
    config: &Mechanism,
    file: &Path,
    text: &str,
    plate: Option<&Plate>,
    frame: usize,
) -> Result<(Vec<Reading>, Frame), ReadError> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let plate = || plate.ok_or_else(|| ReadError::NoPlate(file.into()));
    let readings = match kind(text) {
        Some(Format::Table) => {
            let readings = table::readings(config, text, frame, &name).at(file)?;
            let frame = table::frame(&readings);
            return Ok((readings, frame));
        }
        Some(Format::Log) => log::readings(config, plate()?, text, frame, &name),
        Some(Format::Points) => points::readings(config, plate()?, text, frame, &name),
        None => Err(BadLog {
            line: 1,
            text: format!(
                "neither a log of the calibration program (\"{HEADER}\"), nor points of PROBEOPEN, nor \
                 a CSV table"
            ),
        }),
    };
    let readings = readings.at(file)?;
    let centres = log::centres(plate()?, &readings);
    let frame = plate()?.found_at(&centres).at(file)?;
    Ok((readings, frame))
}

enum Format {
    Log,
    Points,
    Table,
}

/// Detects the format by the first line that is no comment.
fn kind(text: &str) -> Option<Format> {
    let first = text.lines().map(str::trim).find(|line| !heading::is_comment(line))?;
    let word = first.split_ascii_whitespace().next()?;
    match word.parse::<f64>() {
        _ if first == HEADER => Some(Format::Log),
        _ if first.contains(',') => Some(Format::Table),
        Ok(_) => Some(Format::Points),
        Err(_) => None,
    }
}

/// Refuses typed readings that differ between two runs, are in another unit, or in which one mistake explains why they
/// do not fit, see [`mistakes`].
///
/// # Errors
/// The mistake, or a failed fit.
pub fn look_for_mistakes(
    config: &Mechanism,
    given: &Given,
    files: &[PathBuf],
) -> Result<(), SlipError> {
    let Given { model, readings, typed, .. } = given;
    let (Some(noise), false) = (given.noise, typed.is_empty()) else { return Ok(()) };
    let refused = |(file, error): (usize, BadLog)| -> Result<(), SlipError> {
        Err(ReadError::from(AtFile { file: files[file].clone(), error }).into())
    };
    mistakes::compare_runs(config, model, readings, typed, noise).map_or(Ok(()), refused)?;
    for table in typed {
        table.sheet.check_units().at(&files[table.file]).map_err(ReadError::from)?;
    }
    mistakes::look(config, model, readings, typed, noise)?.map_or(Ok(()), refused)
}

/// Why typed readings are refused.
#[derive(Debug, thiserror::Error)]
pub enum SlipError {
    #[error(transparent)]
    Slip(#[from] ReadError),
    #[error(transparent)]
    Misfit(#[from] Misfit),
}

/// Calibrates a machine; `progress` receives the share done.
///
/// # Errors
/// See [`Misfit`].
pub fn study(
    config: &Mechanism,
    given: Given,
    mut progress: impl FnMut(f64),
) -> Result<Study, Misfit> {
    let Given { model, readings, instruments, noise, typed } = given;
    let mut found = fit(&model, &readings, noise)?;
    progress(0.4);
    let (as_drawn, holes) = as_drawn(&model, &readings, &found)?;
    let held_out = held_out(&model, &readings, &found, |share| progress(0.4 + 0.5 * share))?;
    let unreachable = |fault| Misfit::Unreachable("the workspace".into(), fault);
    let used = believed(&readings, &found);
    let (wide_model, wide, scale) = with_scale(config, &model, &used, &found)?;
    let (stated_model, stated) =
        if scale.is_covered() { (&wide_model, &wide) } else { (&model, &found) };
    let at_tool = at_tool(config, stated_model, &readings, stated).map_err(unreachable)?;
    let shape = shape(config, stated_model, &readings, stated)?;
    let [rank, improved] = [
        observe::rank(&model, &found.jacobian),
        observe::improved(&model, &found.jacobian, found.noise),
    ];
    let unseen = observe::unseen(&model, &used, &found.jacobian);
    let agreement = noise.map(|noise| agreement(&model, &readings, &found, noise));
    if scale.is_covered() {
        let own = model.parameters.len();
        found.covariance = wide.covariance.view((0, 0), (own, own)).clone_owned();
    }
    progress(1.0);
    Ok(Study {
        as_drawn,
        held_out,
        rank,
        improved,
        unseen,
        at_tool,
        shape,
        scale,
        agreement,
        holes,
        model,
        readings,
        instruments,
        typed,
        found,
    })
}

fn agreement(model: &Model, readings: &[Reading], found: &Fit, noise: f64) -> Agreement {
    let chi_square = chi_square(model, &found.residuals, &found.changes, noise);
    let numbers = found.residuals.len();
    let (place, share) = found.foremost();
    let is_out = |i: &usize| found.outliers.iter().any(|outlier| outlier.reading == *i);
    let mut rows = (0..readings.len())
        .filter(|i| !is_out(i))
        .flat_map(|i| std::iter::repeat_n(i, readings[i].measured.rows()));
    let foremost = (rows.nth(place).unwrap_or_default(), share);
    Agreement { chi_square, numbers, most: mistakes::most(numbers), foremost }
}

/// Returns the readings that were not left out.
fn believed(readings: &[Reading], found: &Fit) -> Vec<Reading> {
    let is_out = |i: usize| found.outliers.iter().any(|outlier| outlier.reading == i);
    let kept = readings.iter().enumerate().filter(|(i, _)| !is_out(*i));
    kept.map(|(_, reading)| reading.clone()).collect()
}

/// Returns the residual of the machine as drawn, with only frames and probe fitted, and the holes as
/// measured by the control.
fn as_drawn(
    model: &Model,
    readings: &[Reading],
    found: &Fit,
) -> Result<(f64, Vec<HoleError>), Misfit> {
    let mut frames = model.clone();
    frames.parameters.retain(|parameter| !parameter.quantity.is_of_machine());
    let believed = believed(readings, found);
    let all: Vec<&Reading> = believed.iter().collect();
    let changes =
        super::fit::most_probable(&frames, &all, &vec![0.0; frames.parameters.len()], found.noise)?;
    let (left, _) = residuals(&frames, &all, &changes)?;
    Ok((rms(&left), holes(&frames, &believed, &changes)))
}

/// Computes the axes of the holes by least squares through the touches of their walls, at each orientation.
fn holes(frames: &Model, readings: &[Reading], changes: &[f64]) -> Vec<HoleError> {
    let groups = readings.iter().map(|reading| reading.group + 1).max().unwrap_or(0);
    let of = |group: usize| {
        let walls = readings.iter().filter(|r| r.group == group);
        let walls: Vec<(&Reading, [f64; 2])> = walls
            .filter_map(|r| match r.measured {
                Measured::Bore { axis, .. } => Some((r, axis)),
                _ => None,
            })
            .collect();
        let points: Vec<Vector3<f64>> = walls
            .iter()
            .map(|(r, _)| frames.frame(r.frame, changes).seen(&(r.pose.position - r.tool)))
            .collect();
        let (first, axis) = walls.first()?;
        let [x, y] = circle(&points)?;
        Some(HoleError { name: first.name.clone(), miss: (x - axis[0]).hypot(y - axis[1]) })
    };
    let mut all: Vec<HoleError> = (0..groups).filter_map(of).collect();
    all.sort_by(|a, b| b.miss.total_cmp(&a.miss));
    all
}

/// Returns the center of the circle through points, least squares: |p|² = 2 p·c + r² − |c|² is linear.
fn circle(points: &[Vector3<f64>]) -> Option<[f64; 2]> {
    if points.len() < 3 {
        return None;
    }
    let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let rows = DMatrix::from_fn(points.len(), 3, |i, k| match k {
        0 | 1 => 2.0 * (points[i] - mean)[k],
        _ => 1.0,
    });
    let right =
        nalgebra::DVector::from_fn(points.len(), |i, _| (points[i] - mean).xy().norm_squared());
    let solved = rows.svd(true, true).solve(&right, 1e-12).ok()?;
    Some([mean.x + solved[0], mean.y + solved[1]])
}

/// Returns the variances of the machine's parameters by the drawing, as a covariance: of the machine alone, because
/// the drawing does not determine the pose of the plate, and of its geometry alone.
fn drawn(model: &Model) -> DMatrix<f64> {
    let is_drawn = |quantity: Quantity| quantity.is_of_machine() && quantity != Quantity::Scale;
    DMatrix::from_diagonal(&DVector::from_iterator(
        model.parameters.len(),
        model
            .parameters
            .iter()
            .map(|p| if is_drawn(p.quantity) { p.deviation.powi(2) } else { 0.0 }),
    ))
}

/// Computes the tip's error over the workspace by the drawing and by the readings.
///
/// # Errors
/// No pose of the workspace is reachable, or as [`kinematics::Machine::inverse`].
pub fn shape(
    config: &Mechanism,
    model: &Model,
    readings: &[Reading],
    found: &Fit,
) -> Result<[Shape; 2], Misfit> {
    let tool = readings.first().map_or(config.spindle, |reading| reading.tool);
    let workspace = at_tool::whole_workspace(config, &tool);
    if workspace.is_empty() {
        return Err(Misfit::NoWorkspace(tool.z - config.spindle.z));
    }
    let unreachable = |fault| Misfit::Unreachable("the workspace".into(), fault);
    let changed = Changed::new(model, &found.changes).map_err(unreachable)?;
    let rates = shape::rates(model, &changed, &workspace, &tool).map_err(unreachable)?;
    let of = |covariance| shape::of_covariance(&rates, covariance, CONFIDENCE);
    Ok([of(&drawn(model)), of(&found.covariance)])
}

/// Returns whether readings determine the whole pose of a frame.
fn is_placed(reading: &Reading) -> bool {
    match reading.measured {
        Measured::Bore { .. } | Measured::Position(_) | Measured::Pose(..) => true,
        Measured::Face(_) | Measured::Distance(_) => false,
    }
}

/// Returns the confidence regions of the tip by the drawing and by the readings, at home and where they are largest.
fn at_tool(
    config: &Mechanism,
    model: &Model,
    readings: &[Reading],
    found: &Fit,
) -> Result<Option<[(Ellipsoid, Ellipsoid); 2]>, Fault> {
    if !readings.iter().any(|reading| reading.frame == 0 && is_placed(reading)) {
        return Ok(None);
    }
    let tool = readings.first().map_or(config.spindle, |reading| reading.tool);
    let changed = Changed::new(model, &found.changes)?;
    let drawn = drawn(model);
    // The tool offset does not move the machine.
    let home = config.home_pose();
    let mut poses = at_tool::workspace(config, &tool);
    poses.push(home);
    let both = |poses: &[Pose]| -> Result<(Ellipsoid, Ellipsoid), Fault> {
        let largest = |covariance| at_tool::largest(&changed, model, covariance, poses, &tool);
        let before = largest(&drawn)?;
        let after = largest(&found.covariance)?;
        Ok(before.zip(after).expect("there is the pose at home"))
    };
    Ok(Some([both(&[home])?, both(&poses)?]))
}

/// Returns the poses to measure next, best first: the tip's position is read at each. Tip and angles, machine
/// units and degrees.
///
/// # Errors
/// As [`kinematics::Machine::inverse`].
pub fn next_poses(config: &Mechanism, study: &Study, count: usize) -> Result<Vec<[f64; 6]>, Fault> {
    let Study { model, readings, found, .. } = study;
    let tool = readings.first().map_or(config.spindle, |reading| reading.tool);
    let changed = Changed::new(model, &found.changes)?;
    let poses = at_tool::poses(config, &tool, CANDIDATES, 1);
    let rows = |pose: &Pose| -> Result<DMatrix<f64>, Fault> {
        let reading = Reading {
            name: String::new(),
            group: 0,
            joints: changed.machine.inverse(pose, &tool)?,
            pose: *pose,
            tool,
            frame: 0,
            measured: Measured::Position(Vector3::zeros()),
            instrument: Instrument::default(),
        };
        Ok(changed.seen(&reading, &changed.at(*pose, &tool)?).1)
    };
    let candidates = poses.iter().map(rows).collect::<Result<Vec<_>, Fault>>()?;
    let tips = at_tool::workspace(config, &tool)
        .iter()
        .map(|pose| Ok(at_tool::rates(model, &changed.at(*pose, &tool)?)))
        .collect::<Result<Vec<_>, Fault>>()?;
    let best = plan::next_best(model, &found.jacobian, &candidates, &tips, found.noise, count);
    let shown = |k: usize| {
        let mut pose = poses[k];
        pose.position -= tool - config.spindle;
        pose.to_degrees()
    };
    Ok(best.into_iter().map(shown).collect())
}
