// SPDX-License-Identifier: GPL-2.0-or-later
//! The report on a program: JSON, and the source of text and page.

use crate::cut::course::{Course, Position};
use crate::cut::moment::Subject;
use crate::cut::pass::{Found, OfLine, Peak, UM};
use crate::cut::place::Assessment;
use crate::cut::program::Line;
use crate::stability::path::{Depth, Stop};
use program::timeline::Abscissa;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Number of worst lines to report.
const WORST: usize = 10;

/// N mm per N m.
const MM_PER_M: f64 = 1e3;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The machine's INI file.
    pub machine: PathBuf,
    pub program: PathBuf,
    /// Whether all drives suffice and every feed move is stable; none if the program was not fully assessed
    /// and no violation was found.
    pub fits: Option<bool>,
    /// Seconds from start to end; none if unknown.
    pub seconds: Option<f64>,
    /// Seconds of the feed moves.
    pub cutting_seconds: Option<f64>,
    /// Why time and inertia are not judged.
    pub not_judged: Option<String>,
    /// LinuxCNC's message if it stopped the program.
    pub stopped: Option<String>,
    /// Whether the work rotates, so that the force is constant and shakes nothing.
    pub is_turning: bool,
    /// Depth of cut of the study, mm.
    pub depth_mm: f64,
    /// Number of assessed moments.
    pub moments: u64,
    /// Feed per tooth, or per revolution in turning, mm.
    pub chip_mm: Option<Most>,
    /// Force on the tool, N.
    pub force_n: Option<Most>,
    /// Displacement of the tool by the mean cutting force, um.
    pub deflection_um: Option<Most>,
    /// Displacement of the tool by inertia, um.
    pub inertia_um: Option<Most>,
    /// Amplitude of the tool's vibration under the teeth, um; none in turning.
    pub vibration_um: Option<Most>,
    /// Largest error in X, Y, Z if every drive is off by half a step; none without steps.
    pub resolution_um: Option<[f64; 3]>,
    /// All drives: legs, then table axes.
    pub drives: Vec<Drive>,
    /// Stability along the program.
    pub stability: Stability,
    /// The lines nearest to the machine's limits, worst first.
    pub worst_lines: Vec<LineReport>,
    pub lines: Vec<LineReport>,
    pub course: Course,
    /// Lines whose results need attention, in sentences.
    pub warnings: Vec<String>,
    /// Why rapid moves through the stock are not examined; none if they are.
    pub rapids_not_judged: Option<String>,
}

/// A largest value, and its location.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Most {
    pub value: f64,
    pub line: u32,
    /// Seconds from the start; none if unknown.
    pub at_s: Option<f64>,
    /// X Y Z A B C there, machine units and degrees.
    pub pose: [f64; 6],
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drive {
    /// Its joint.
    pub name: String,
    /// N, or Nm for an arm.
    pub unit: &'static str,
    /// The load of largest magnitude, positive towards increasing joint values.
    pub load: f64,
    pub line: u32,
    /// Seconds from the start; none if unknown.
    pub at_s: Option<f64>,
    /// X Y Z A B C there.
    pub pose: [f64; 6],
    /// The drive's capacity, if the study defines it.
    pub limit: Option<f64>,
    /// Torque of its motor, Nm, if the study defines the motor.
    pub motor_torque_n_m: Option<f64>,
    /// The motor's capacity, Nm.
    pub motor_limit_n_m: Option<f64>,
    /// The larger share of both limits.
    pub share: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stability {
    /// Number of positions assessed.
    pub places: usize,
    pub feed_moves: usize,
    /// Largest depth assessed, mm.
    pub deepest_mm: f64,
    /// Line with the smallest limit.
    pub line: u32,
    /// Seconds from the start; none if unknown.
    pub at_s: Option<f64>,
    /// X Y Z A B C there.
    pub pose: [f64; 6],
    /// Spindle speed there, 1/min.
    pub rpm: f64,
    /// Depth up to which every cut is stable there, mm.
    pub stable_to_mm: f64,
    /// Ratio of that depth to the depth of cut.
    pub margin: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LineReport {
    pub line: u32,
    /// The larger of the drive's share and the depth of cut divided by its limit: cannot be cut if above 1.
    pub share: f64,
    /// Seconds from the start to that share; none if unknown.
    pub at_s: Option<f64>,
    /// Seconds of all passes of the line; none if unknown. Like all values that depend on the motion, it is also none
    /// if LinuxCNC blends the line with its neighbors.
    pub seconds: Option<f64>,
    /// Spindle speed, 1/min.
    pub rpm: f64,
    /// Largest feed per tooth, mm.
    pub chip_mm: Option<f64>,
    /// Largest force on the tool, N.
    pub force_n: Option<f64>,
    /// The drive with the largest share of its capacity.
    pub drive: Option<String>,
    pub drive_share: Option<f64>,
    /// Displacement of the tool by the mean cutting force, um.
    pub deflection_um: Option<f64>,
    /// Displacement of the tool by inertia, um.
    pub inertia_um: Option<f64>,
    /// Amplitude of the tool's vibration under the teeth, um; none if no position was assessed.
    pub vibration_um: Option<f64>,
    /// Depth up to which every cut is stable, mm; none if no position was assessed.
    pub stable_to_mm: Option<f64>,
    /// Ratio of that depth to the depth of cut.
    pub margin: Option<f64>,
}

/// Assessed positions and their results.
#[derive(Clone, Debug, PartialEq)]
pub struct Looked {
    /// Stop, limit depth, and the other results.
    pub places: Vec<(Stop, Depth, Assessment)>,
    /// Abscissa of each; none if the program is stopped before it.
    pub at: Vec<Option<f64>>,
    pub feed_moves: usize,
    /// Largest depth assessed, mm.
    pub deepest: f64,
    /// As in [`Report`].
    pub warnings: Vec<String>,
    pub rapids: Option<String>,
}

/// How the run of a program ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Run {
    /// It reached its end, after this many seconds.
    Finished(f64),
    /// LinuxCNC stopped it after this many seconds, with this message.
    Stopped(f64, String),
    /// LinuxCNC could not run it.
    NotJudged(String),
}

/// Creates the report on a program.
pub fn report(
    subject: &Subject,
    program: PathBuf,
    depth_mm: f64,
    lines: &BTreeMap<u32, Line>,
    found: Found,
    looked: &Looked,
    run: &Run,
) -> Report {
    let config = subject.config;
    let seconds = match run {
        Run::Finished(seconds) | Run::Stopped(seconds, _) => Some(*seconds),
        Run::NotJudged(_) => None,
    };
    let period = seconds.map(|_| config.period);
    let lines: Vec<LineReport> = lines
        .iter()
        .map(|(number, line)| {
            let own = found.lines.get(number);
            of_line(subject, *number, line, own, looked, depth_mm, period)
        })
        .collect();
    let is_timed = seconds.is_some();
    let drives = drives(subject, &found, is_timed);
    let stability = stability(looked, depth_mm, is_timed);
    let is_above = drives.iter().filter_map(|drive| drive.share).any(|share| share > 1.0);
    let is_whole = stability.places == stability.feed_moves
        && drives.iter().all(|drive| drive.share.is_some());
    let fits = match run {
        _ if is_above || !(stability.margin > 1.0) => Some(false),
        Run::Stopped(..) => Some(false),
        Run::Finished(_) if is_whole => Some(true),
        Run::Finished(_) | Run::NotJudged(_) => None,
    };
    let [chip, force, deflection, lag] = &found.peaks;
    let most = |peak: &Option<Peak>, scale: f64| most(peak, scale, is_timed);
    Report {
        machine: config.file.clone(),
        program,
        fits,
        seconds,
        cutting_seconds: period.map(|period| found.cutting as f64 * period),
        not_judged: if let Run::NotJudged(why) = run { Some(why.clone()) } else { None },
        stopped: if let Run::Stopped(_, why) = run { Some(why.clone()) } else { None },
        is_turning: subject.teeth.is_turning(),
        depth_mm,
        moments: found.judged,
        chip_mm: most(chip, 1.0),
        force_n: most(force, 1.0),
        deflection_um: most(deflection, UM),
        inertia_um: seconds.and_then(|_| most(lag, UM)),
        vibration_um: vibration(looked, is_timed),
        resolution_um: resolution(looked),
        drives,
        stability,
        worst_lines: worst(&lines),
        lines,
        course: course(found, looked, seconds),
        warnings: looked.warnings.clone(),
        rapids_not_judged: looked.rapids.clone(),
    }
}

fn worst(lines: &[LineReport]) -> Vec<LineReport> {
    let mut worst = lines.to_vec();
    worst.sort_by(|a, b| b.share.total_cmp(&a.share));
    worst.truncate(WORST);
    worst
}

fn course(found: Found, looked: &Looked, seconds: Option<f64>) -> Course {
    let stretches = found.stretches.finish();
    let placed =
        looked.places.iter().zip(&looked.at).filter_map(|(place, at)| Some((place, (*at)?)));
    let position = |((stop, limit, place), at): (&(Stop, Depth, Assessment), f64)| Position {
        at,
        line: stop.line,
        stable_to_mm: limit.stable_to,
        vibration_um: place.vibration.map(|vibration| vibration * UM),
    };
    Course {
        over: if seconds.is_some() { Abscissa::Seconds } else { Abscissa::Length },
        end: seconds.unwrap_or_else(|| stretches.last().map_or(0.0, |last| last.at)),
        stretches,
        positions: placed.map(position).collect(),
    }
}

fn most(peak: &Option<Peak>, scale: f64, is_timed: bool) -> Option<Most> {
    let peak = peak.as_ref()?;
    let (line, pose) = (peak.judged.line, peak.judged.pose);
    let at_s = is_timed.then_some(peak.judged.at);
    Some(Most { value: peak.value * scale, line, at_s, pose })
}

fn of_line(
    subject: &Subject,
    number: u32,
    line: &Line,
    own: Option<&OfLine>,
    looked: &Looked,
    depth: f64,
    period: Option<f64>,
) -> LineReport {
    let places = looked.places.iter().zip(&looked.at);
    let places = || places.clone().filter(|((stop, ..), _)| stop.line == number);
    let least =
        places().min_by(|((_, a, _), _), ((_, b, _), _)| a.stable_to.total_cmp(&b.stable_to));
    let stable_to = least.map(|((_, depth, _), _)| depth.stable_to);
    let vibration = places().filter_map(|((_, _, place), _)| place.vibration);
    let vibration = vibration.map(|vibration| vibration * UM).reduce(f64::max);
    let drive = own.and_then(|own| own.drive);
    let drive_share = drive.map(|(_, share)| share);
    let of_depth = stable_to.map(|limit| depth / limit);
    let share = drive_share.into_iter().chain(of_depth).fold(0.0, f64::max);
    let at = match of_depth == Some(share) {
        true => least.and_then(|(_, at)| *at),
        false => own.map(|own| own.at),
    };
    LineReport {
        line: number,
        share,
        at_s: period.and(at),
        seconds: period.and_then(|period| Some(own?.cycles as f64 * period)),
        rpm: line.rpm,
        chip_mm: own.map(|own| own.chip),
        force_n: own.map(|own| own.force),
        drive: drive.map(|(drive, _)| subject.config.joints[drive].name.clone()),
        drive_share,
        deflection_um: own.map(|own| own.deflection * UM),
        inertia_um: period.and(own).map(|own| own.lag * UM),
        vibration_um: vibration,
        stable_to_mm: stable_to,
        margin: stable_to.map(|limit| limit / depth),
    }
}

fn drives(subject: &Subject, found: &Found, is_timed: bool) -> Vec<Drive> {
    let drive = |(i, peak): (usize, &Option<Peak>)| {
        let peak = peak.as_ref()?;
        let (scale, unit) = if subject.is_arm(i) { (MM_PER_M, "Nm") } else { (1.0, "N") };
        let own = &subject.drives[i];
        Some(Drive {
            name: subject.config.joints[i].name.clone(),
            unit,
            load: peak.value / scale,
            line: peak.judged.line,
            at_s: is_timed.then_some(peak.judged.at),
            pose: peak.judged.pose,
            limit: own.most.map(|most| most / scale),
            motor_torque_n_m: own.motor.map(|motor| motor.torque_of(peak.value) / MM_PER_M),
            motor_limit_n_m: own.motor.map(|motor| motor.torque / MM_PER_M),
            share: own.share(peak.value),
        })
    };
    found.drives.iter().enumerate().filter_map(drive).collect()
}

fn stability(looked: &Looked, depth: f64, is_timed: bool) -> Stability {
    let places = looked.places.iter().zip(&looked.at);
    let least = places.min_by(|(a, _), (b, _)| a.1.stable_to.total_cmp(&b.1.stable_to));
    let ((stop, limit, _), at) = least.expect("a program with feed moves has places");
    Stability {
        places: looked.places.len(),
        feed_moves: looked.feed_moves,
        deepest_mm: looked.deepest,
        line: stop.line,
        at_s: at.filter(|_| is_timed),
        pose: stop.programmed,
        rpm: stop.rpm,
        stable_to_mm: limit.stable_to,
        margin: limit.stable_to / depth,
    }
}

fn vibration(looked: &Looked, is_timed: bool) -> Option<Most> {
    let places = looked.places.iter().zip(&looked.at);
    let places = places.filter_map(|((stop, _, place), at)| Some((stop, place.vibration?, at)));
    let most = places.max_by(|(_, a, _), (_, b, _)| a.total_cmp(b));
    most.map(|(stop, vibration, at)| Most {
        value: vibration * UM,
        line: stop.line,
        at_s: at.filter(|_| is_timed),
        pose: stop.programmed,
    })
}

fn resolution(looked: &Looked) -> Option<[f64; 3]> {
    let all = looked.places.iter().filter_map(|(_, _, place)| place.resolution);
    let most = all.reduce(|a, b| std::array::from_fn(|k| a[k].max(b[k])));
    most.map(|most| most.map(|value| value * UM))
}
