// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm dynamics`.

use super::failure::{Failure, refused, report_error};
use super::poses::At;
use super::run::{Control, Progress};
use super::vibration::{
    Answer, EllipseAnswer, LinearAnswer, ModeAnswer, Spectra, UM, of_record, report,
    response_header, response_row, roots,
};
use super::{Bar, MachineFile, Verdict, in_words, output};
use draw::dynamics::{of_deviation, of_map, of_response, of_spectrum, of_trace};
use draw::plot::Plot;
use kinematics::{Carries, Matrix3, Pose, Vector3};
use linuxcnc::process::{Event, run_with_moves};
use linuxcnc::row::{CommandedKind, Ending};
use machine::files::{Locate, csv, open};
use machine::proof::axis_box;
use machine::read::mechanism::Mechanism;
use program::motion::{self, MoveKind, Spindle};
use program::preflight::JudgeError;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use studies::dynamics::layer::Layer;
use studies::dynamics::linear::Linear;
use studies::dynamics::milling::{Milling, frame};
use studies::dynamics::model::Model;
use studies::dynamics::noise::{Noise, Spectrum};
use studies::dynamics::record::Record;
use studies::dynamics::response::frequencies;
use studies::dynamics::run::{Ended, Follower, Force, Times, standing};
use studies::dynamics::structure::{Structure, legs};
use studies::study::file::{Lacking, Study};
use studies::study::forcing::Force as Random;
use studies::study::map::Map;
use studies::study::number::Positive;
use studies::study::workspace::Workspace;

/// Top of a response's frequency range, relative to the highest natural frequency.
const BEYOND: f64 = 1.5;

/// Compute the vibration of the machine
///
/// Models the platform as a rigid body on the springs and dampers of its legs, from a study file.
/// Reports at one pose: natural frequencies, damping ratios, and the motion of the tool tip in
/// each mode. --shake simulates the machine under a random or a milling force; --program
/// simulates it under the commands that LinuxCNC gives the drives for a program in virtual time.
/// Both report the deviation of the tip from its command; for a random force also the result of
/// the linear theory.
///
/// Damping and cutting coefficients are your measurements: the results are no more accurate than these.
/// The modes of spindle and tool are not included.
///
/// Hz, mm, um, N, degrees; machine axes.
///
///     [platform]                       # everything that moves with the platform joints
///     mass_kg = 25
///     centre_mm = [0, 0, 120]          # center of mass in the platform frame
///     inertia_kg_m2 = [[0.45, 0, 0], [0, 0.45, 0], [0, 0, 0.60]]
///     [legs]                           # one number, or a list with one per leg
///     stiffness_n_per_um = 10
///     damping_n_s_per_mm = 0.8         # or damping_ratio = 0.02
///     [force]                          # for --shake noise
///     sigma_n = [30, 30, 15]
///     corner_hz = 150                  # or band_hz and band_quality
///     seconds = 5
///
/// `pkm help studies/dynamics` lists all keys.
///
/// Exit status: 0, 1 if the pose is singular or LinuxCNC stops the program, 2 if input or output
/// failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Read masses, springs and dampers from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: PathBuf,
    #[command(flatten)]
    at: At,
    /// Draw responses, maps and motions as SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
    /// Write the frequency response of the tip as CSV: Hz, then mm/N
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    response: Option<PathBuf>,
    /// Highest frequency of the response, Hz [default: 1.5 times that of the highest mode]
    #[arg(long, value_name = "HZ")]
    top: Option<f64>,
    /// Write a map of the lowest natural frequency and the largest compliance as CSV, in three
    /// planes through the pose within axis limits and machine limits; --plots also draws it
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    map: Option<PathBuf>,
    /// Number of points along each side of a map
    #[arg(long, value_name = "N", default_value_t = 41, value_parser = clap::value_parser!(u16).range(2..=1001))]
    grid: u16,
    /// Simulate the machine under a force on its tip
    #[arg(long, value_enum)]
    shake: Option<Shake>,
    /// Simulate the machine under the commands of a program, from its first pose
    #[arg(long, value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = super::input::Program)]
    program: Option<PathBuf>,
    /// Write the simulated motion as CSV: seconds, and the deviation of the tip from its command in
    /// um
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    trace: Option<PathBuf>,
    /// Write the spectrum of that motion as CSV: Hz, densities of the tip in um²/Hz, and for a
    /// random force those of the linear theory
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    spectrum: Option<PathBuf>,
    #[command(flatten)]
    control: Control,
}

/// A force.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq)]
enum Shake {
    /// Random force, [force] of the study
    Noise,
    /// Force of a milling cutter, [cutting] and [milling] of the study; with [stock], on its layers
    Milling,
}

/// A machine at a pose, and its files.
struct Subject<'a> {
    arguments: &'a Arguments,
    config: &'a Mechanism,
    study: &'a Study,
    model: Model,
    pose: Pose,
    tool: Vector3<f64>,
    structure: Structure,
    /// Orientation of the platform in base.
    rotation: Matrix3<f64>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    check(arguments)?;
    let config = arguments.machine.read_constrained()?;
    let mut study = Study::read(&arguments.study)?;
    let is_cut = study.stock.is_some() && arguments.shake == Some(Shake::Milling);
    if let (true, Some(run), Some(program)) = (is_cut, &mut study.milling, &arguments.program) {
        run.speed_rpm = Positive(turning(&config, program)?);
    }
    let model = Model::of(&config, &study).at(&arguments.study)?;
    let (pose, tool) = arguments.at.read(&config)?;
    let structure = Structure::at(&config, &model, &pose, &tool)
        .map_err(|fault| Failure::at(in_words(&pose), fault))?;
    let rotation = config.machine.full_pose(&pose, &tool)?.rotation();
    let subject = Subject {
        arguments,
        config: &config,
        study: &study,
        model,
        pose,
        tool,
        structure,
        rotation,
    };
    let bar = Bar::spinner("vibration modes");
    let Some(mut answer) = subject.answer() else {
        drop(bar);
        report_error(&format!("{}: {}", in_words(&pose), Ended::Singular));
        return Ok(Verdict::Misfit);
    };
    drop(bar);
    let moved = subject.moved()?;
    let bar = Bar::spinner("linear theory");
    let linear = match (&moved, subject.noise()) {
        (Some((record, _)), Some(noise)) if arguments.program.is_none() => {
            subject.linear(&noise, record).map(|linear| (linear, noise))
        }
        _ => None,
    };
    bar.say("drawing".into());
    subject.write(&answer, moved.as_ref().map(|(record, _)| record), linear.as_ref())?;
    drop(bar);
    let verdict = moved.as_ref().map_or(Verdict::Fits, |(_, verdict)| *verdict);
    let reported = linear.map(|(found, _)| LinearAnswer {
        rms_um: roots(&found.tip),
        ellipse: EllipseAnswer::of(&found.tip),
        axis_rms_urad: found.axis_urad,
        leg_rms_n: found.legs,
        spread: found.spread,
    });
    answer.motion = moved.map(|(record, _)| of_record(&record, reported));
    output::answer(&answer)?;
    report(&answer, &pose)?;
    Ok(verdict)
}

/// Checks combinations of arguments that the command line's grammar accepts.
fn check(arguments: &Arguments) -> Result<(), Failure> {
    let moves = arguments.shake.is_some() || arguments.program.is_some();
    for (name, file) in [("--trace", &arguments.trace), ("--spectrum", &arguments.spectrum)] {
        if file.is_some() && !moves {
            return Err(refused(format!("{name}: nothing moves; add --shake or --program")));
        }
    }
    match arguments.top {
        Some(top) if !(top > 0.0 && top.is_finite()) => {
            Err(refused(format!("--top {top}: expected more than 0 Hz")))
        }
        _ => Ok(()),
    }
}

/// Returns the spindle speed of all feed moves of a program, 1/min.
fn turning(config: &Mechanism, program: &Path) -> Result<f64, Failure> {
    open(program)?;
    let (moves, _) = motion::read(&config.clone().into(), program, None)?;
    let mut turning = None;
    for step in moves.iter().filter(|step| step.kind == MoveKind::Feed) {
        let place = format!("{}: line {}", program.display(), step.line);
        match (step.spindle, turning) {
            (Spindle::Turning(rpm), None) if rpm > 0.0 => turning = Some(rpm),
            (Spindle::Turning(rpm), Some(other)) if rpm == other => {}
            (Spindle::Turning(rpm), Some(other)) => {
                return Err(refused(format!(
                    "{place}: the tool cuts at {rpm} 1/min, before at {other}; [stock] needs one speed"
                )));
            }
            (Spindle::Standing(_) | Spindle::Turning(_), _) => {
                return Err(refused(format!(
                    "{place}: the tool cuts with the spindle stopped; add S and M3 or M4"
                )));
            }
            (Spindle::Surface | Spindle::Unknown, _) => {
                return Err(refused(format!(
                    "{place}: the spindle speed is unknown; set one with G97 and S"
                )));
            }
        }
    }
    turning.ok_or_else(|| refused(format!("{}: the program has no feed moves", program.display())))
}

/// Linear theory of a random force.
struct OfNoise {
    /// Covariance of the tip.
    tip: Matrix3<f64>,
    /// Standard deviations of the spindle axis: its inclination, urad.
    axis_urad: [f64; 3],
    /// Standard deviations of the legs' forces.
    legs: Vec<f64>,
    /// Standard deviations of variances of a record.
    spread: [f64; 3],
}

impl Subject<'_> {
    fn answer(&self) -> Option<Answer> {
        let mode = |mode: &studies::dynamics::mode::Mode| ModeAnswer {
            hz: mode.omega / TAU,
            damping_ratio: mode.zeta,
            // 1 t is 1000 kg.
            tip: (mode.tip / 1e3_f64.sqrt()).into(),
        };
        let still = self.structure.receptance(0.0)?.map(|h| h.re * UM);
        Some(Answer {
            machine: self.config.file.clone(),
            pose: self.pose.to_degrees(),
            modes: self.structure.modes()?.iter().map(mode).collect(),
            poles: self.structure.poles()?.iter().map(|pole| [pole.re, pole.im]).collect(),
            compliance_um_per_n: [0, 1, 2].map(|i| [0, 1, 2].map(|k| still[(i, k)])),
            bearing_n: self.structure.bearing.clone(),
            motion: None,
        })
    }

    fn lacks(&self, section: &'static str, key: &'static str) -> Failure {
        let lacking: Result<(), Lacking> = Err(Lacking::Key { section, key });
        match lacking.at(&self.arguments.study) {
            Err(error) => error.into(),
            Ok(()) => refused(section),
        }
    }

    /// Returns the random force, if requested and defined.
    fn noise(&self) -> Option<Random> {
        self.study.force.filter(|_| self.arguments.shake == Some(Shake::Noise))
    }

    /// Returns the requested force, its highest frequency, and its duration.
    fn force(&self) -> Result<(f64, f64), Failure> {
        match self.arguments.shake {
            None => Ok((0.0, 0.0)),
            Some(Shake::Noise) => {
                let force = self.study.force.ok_or_else(|| self.lacks("force", "sigma_n"))?;
                Ok((Spectrum::from(force.band).reach(), force.seconds))
            }
            Some(Shake::Milling) => {
                let (milling, seconds) = self.milling()?;
                Ok((milling.reach(), seconds))
            }
        }
    }

    fn milling(&self) -> Result<(Milling, f64), Failure> {
        let cutter = self.study.cutting.ok_or_else(|| self.lacks("cutting", "teeth"))?;
        let run = self.study.milling.ok_or_else(|| self.lacks("milling", "speed_rpm"))?;
        let depth = cutter.depth_mm.ok_or_else(|| self.lacks("cutting", "depth_mm"))?;
        Ok((Milling::of(&cutter, &run, depth), run.seconds.0))
    }

    /// Returns the force on the tip, sampled every `step` seconds.
    fn acting(&self, step: f64) -> Result<Force, Failure> {
        match self.arguments.shake {
            None => Ok(Force::None),
            Some(Shake::Noise) => {
                let force = self.study.force.ok_or_else(|| self.lacks("force", "sigma_n"))?;
                let spectrum = force.band.into();
                Ok(Force::Noise(Noise::new(force.sigma_n.into(), &spectrum, step, force.seed)))
            }
            Some(Shake::Milling) if self.study.stock.is_some() => self.layer(step),
            Some(Shake::Milling) => {
                let (milling, _) = self.milling()?;
                let feed = self.study.milling.and_then(|run| run.feed);
                let feed = feed.map_or(Vector3::x(), |feed| feed.0);
                let frame = frame(&feed, &self.rotation.column(2).into_owned());
                let frame = frame.ok_or_else(|| {
                    refused(format!(
                        "{}: feed of [milling] points along the tool axis; choose one perpendicular to it",
                        self.arguments.study.display()
                    ))
                })?;
                Ok(Force::Milling(milling, frame))
            }
        }
    }

    /// Returns the force on the layers of the stock.
    fn layer(&self, step: f64) -> Result<Force, Failure> {
        if self.arguments.program.is_none() {
            return Err(refused(format!(
                "{}: [stock] is cut along a program; add --program, or remove [stock] for a cut at a pose",
                self.arguments.study.display()
            )));
        }
        if self.config.chain.of(Carries::Work).next().is_some() {
            return Err(refused(format!(
                "{}: [stock] does not turn with an axis that carries the work; remove [stock]",
                self.arguments.study.display()
            )));
        }
        let cutter = self.study.cutting.ok_or_else(|| self.lacks("cutting", "teeth"))?;
        let run = self.study.milling.ok_or_else(|| self.lacks("milling", "speed_rpm"))?;
        let stock = self.study.stock.ok_or_else(|| self.lacks("stock", "low_mm"))?;
        let layer = Layer::new(&cutter, &run, &stock, step).at(&self.arguments.study)?;
        Ok(Force::Layer(Box::new(layer)))
    }

    /// Simulates the requested motion in time.
    fn moved(&self) -> Result<Option<(Record, Verdict)>, Failure> {
        if self.arguments.shake.is_none() && self.arguments.program.is_none() {
            return Ok(None);
        }
        let (reach, seconds) = self.force()?;
        let times = Times::of(&self.structure, reach);
        let times = times.ok_or_else(|| Failure::at(in_words(&self.pose), Ended::Singular))?;
        if let Some(program) = &self.arguments.program {
            return self.followed(program, &times).map(Some);
        }
        let force = self.acting(times.step)?;
        let bar = Bar::new("shaking");
        let at = (&self.pose, &self.tool);
        let show = |share: f64| bar.set(share);
        let record = standing(self.config, &self.model, at, force, (&times, seconds), show)?;
        Ok(Some((record, Verdict::Fits)))
    }

    fn followed(&self, program: &Path, times: &Times) -> Result<(Record, Verdict), Failure> {
        open(program)?;
        if self.config.chain.is_bare() {
            return Err(refused(
                "not judged: an axis carries the tool, or the work is on the platform, so the point where the force \
                 acts is unknown along a program; use --pose or --shake without --program",
            ));
        }
        let cycles = (self.config.period / times.step).ceil();
        let force = self.acting(self.config.period / cycles)?;
        let mut follower = Follower::new(self.config, &self.model, force, times.step);
        let mut ended = None;
        let mut progress = Progress::new(self.config, program)?;
        let options = self.arguments.control.options();
        // The start, or a rapid move through the block, is no cut.
        let (mut feeds, mut cut) = (vec![], 0.0);
        let outcome = run_with_moves(&self.config.clone().into(), program, &options, |event| {
            let row = match event {
                Event::Row(row) => row,
                Event::Move(commanded) => {
                    feeds.push(commanded.kind == CommandedKind::Feed);
                    return ControlFlow::Continue(());
                }
                Event::File(_) => return ControlFlow::Continue(()),
            };
            progress.see(row);
            let (pose, tool) = row.machine(self.config);
            let before = follower.removed().unwrap_or_default();
            match follower.see(&Pose::from_degrees(pose), &tool) {
                Ok(()) => {
                    if row.line > 0 && feeds.get(row.number) == Some(&true) {
                        cut += follower.removed().unwrap_or_default() - before;
                    }
                    ControlFlow::Continue(())
                }
                Err(error) => {
                    ended = Some(Failure::at(
                        format!("{}: line {}", program.display(), row.line),
                        error,
                    ));
                    ControlFlow::Break(())
                }
            }
        });
        drop(progress);
        if let Some(error) = ended {
            return Err(error);
        }
        let outcome = outcome?;
        let record = follower.finish()?;
        if record.tip.is_empty() {
            return Err(JudgeError::MovesNothing(program.into()).into());
        }
        if record.removed.is_some() && !(cut > 0.0) && outcome.ending == Ending::Finished {
            return Err(refused(format!(
                "{}: not judged: the tool does not touch the block in a feed move; compare the program with [stock] of {}",
                program.display(),
                self.arguments.study.display()
            )));
        }
        let verdict = match outcome.ending {
            Ending::Finished => Verdict::Fits,
            Ending::Stopped => {
                outcome.messages.iter().filter(|message| message.is_error()).for_each(|message| {
                    report_error(&format!("{}: {}", program.display(), message.text));
                });
                Verdict::Misfit
            }
        };
        Ok((record, verdict))
    }

    fn linear(&self, force: &Random, record: &Record) -> Option<OfNoise> {
        // The simulation has massless drives, so its linear theory does, too.
        let model = self.model.without_drive_masses();
        let structure = Structure::at(self.config, &model, &self.pose, &self.tool).ok()?;
        let at = self.config.machine.at(&self.pose, &self.tool).ok()?;
        let found = legs(self.config, &at, &self.tool, model.screw).ok()?;
        let stiffness: Vec<f64> =
            found.iter().zip(&model.legs).map(|(leg, own)| own.spring.along(leg.gain)).collect();
        let dampers: Vec<f64> = model.legs.iter().map(|leg| leg.damping).collect();
        let sigma = force.sigma_n.into();
        let linear = Linear::of(&structure, &stiffness, &sigma, &force.band.into())?;
        let linear = linear.with_dampers(&structure, &dampers)?;
        let covariance = linear.covariance()?;
        let seconds = record.tip.len() as f64 * record.step;
        let spread = [0, 1, 2].map(|axis| linear.spread(&covariance, axis, seconds).unwrap_or(0.0));
        // A unit vector along the axis moves by the rotation times it: Ω × a.
        let across = self.rotation.column(2).into_owned().cross_matrix();
        let axis = across * linear.of_turns(&covariance) * across.transpose();
        Some(OfNoise {
            tip: linear.of_tip(&covariance),
            axis_urad: [0, 1, 2].map(|k| axis[(k, k)].sqrt() * 1e6),
            legs: linear.of_legs(&covariance),
            spread,
        })
    }

    fn write(
        &self,
        answer: &Answer,
        record: Option<&Record>,
        linear: Option<&(OfNoise, Random)>,
    ) -> Result<(), Failure> {
        let modes = self.structure.modes().unwrap_or_default();
        let highest = answer.modes.iter().map(|mode| mode.hz).fold(0.0, f64::max);
        let top = self.arguments.top.unwrap_or(BEYOND * highest);
        let at = |hz: f64| self.structure.receptance(TAU * hz).map(|h| (hz, h));
        let frequencies = frequencies(&modes, top);
        let response: Vec<_> = frequencies.iter().copied().filter_map(at).collect();
        let maps = self.arguments.map.as_ref().map(|_| self.maps()).transpose()?;
        let force = linear.map(|(_, force)| force);
        let is_asked = self.arguments.spectrum.is_some() || self.arguments.plots.is_some();
        let spectra = record
            .filter(|_| is_asked)
            .map(|record| Spectra::of(&self.structure, record, force, &frequencies));
        let mut plots = vec![];
        if self.arguments.plots.is_some() {
            plots.push(of_response(&response)?);
            for map in maps.iter().flatten() {
                plots.extend(of_map(self.config, map)?);
            }
            if let Some(record) = record {
                plots.push(of_trace(record, linear.map(|(found, _)| &found.tip))?);
                plots.push(of_deviation(record)?);
            }
            if let Some(Spectra { hz, found, linear }) = &spectra {
                plots.push(of_spectrum(hz, found, linear)?);
            }
        }
        let mut files = vec![];
        if let (Some(file), Some(spectra)) = (&self.arguments.spectrum, &spectra) {
            files.push((file.clone(), spectra.csv()));
        }
        if let Some(file) = &self.arguments.response {
            let rows = response.iter().map(response_row);
            files.push((file.clone(), csv(&response_header(), rows)));
        }
        if let (Some(file), Some(maps)) = (&self.arguments.map, &maps) {
            let header = ["x", "y", "z", "lowest_hz", "largest_swing_um_per_n"];
            let rows = maps.iter().flat_map(Map::rows);
            let rows = rows.map(|([x, y, z], [hz, swing])| [x, y, z, hz, swing * UM]);
            files.push((file.clone(), csv(&header, rows)));
        }
        if let (Some(file), Some(record)) = (&self.arguments.trace, record) {
            let header = ["time", "x_um", "y_um", "z_um"];
            let rows = record
                .tip
                .iter()
                .enumerate()
                .map(|(n, tip)| [n as f64 * record.step, tip.x * UM, tip.y * UM, tip.z * UM]);
            files.push((file.clone(), csv(&header, rows)));
        }
        Ok(Plot::write_with(&plots, self.arguments.plots.as_deref(), files)?)
    }

    fn maps(&self) -> Result<Vec<Map<2>>, Failure> {
        let [_, _, _, a, b, c] = self.pose.to_degrees();
        let workspace = Workspace::new(self.config, self.tool, vec![[a, b, c]], self.study)?;
        let range = axis_box::range(self.config);
        let bar = Bar::new("mapping");
        let planes = workspace.planes();
        let map = |(done, plane): (usize, &[usize; 2])| {
            bar.set(done as f64 / planes.len() as f64);
            let corners = [&range.low, &range.high];
            Map::over(&self.pose, *plane, corners, self.arguments.grid.into(), |pose| {
                workspace.check(&pose.position).ok()?;
                Structure::at(self.config, &self.model, pose, &self.tool).ok()?.softest()
            })
        };
        let maps: Vec<Map<2>> = planes.iter().enumerate().map(map).collect();
        match maps.iter().all(Map::is_empty) {
            true => Err(refused(format!(
                "{}: no point of the maps is within the machine's limits; choose another pose with --pose, or \
                 review the axis limits with pkm check",
                self.config.file.display()
            ))),
            false => Ok(maps),
        }
    }
}
