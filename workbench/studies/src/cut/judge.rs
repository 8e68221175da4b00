// SPDX-License-Identifier: GPL-2.0-or-later
//! Assesses a program while it cuts, from its moves to the report.

use crate::cut::course::Clock;
use crate::cut::moment::{NoMoment, Subject};
use crate::cut::pass::{self, Found, Pass};
use crate::cut::place::half_steps;
use crate::cut::program::{Line, against_thicker, length, lengths, lines, stops, thinner};
use crate::cut::rapids::through_stock;
use crate::cut::report::{Looked, Report, Run, report};
use crate::cut::teeth::Teeth;
use crate::dynamics::capacity::Capacity;
use crate::dynamics::model::Model;
use crate::stability::path::{self, Stop};
use crate::stability::pose::{NoSetup, Setup};
use crate::study::file::{Lacking, Study};
use kinematics::Pose;
use linuxcnc::process::{self, Event, Options};
use linuxcnc::row::{Beside, Ending, Row};
use machine::files::AtPlace;
use machine::read::columns::in_words;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use program::motion::{Move, Translator};
use program::verdict::Step;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;

/// Default of the largest depth that is evaluated, as a multiple of the depth of cut.
const DEEPEST: f64 = 20.0;

/// Lines of the program, by number.
type Lines = BTreeMap<u32, Line>;

/// A machine and its cutter, as described in a study.
pub struct Cut<'a> {
    subject: Subject<'a>,
    setup: Setup<'a>,
    /// Depth of cut, mm.
    depth: f64,
    study: &'a Study,
}

impl<'a> Cut<'a> {
    /// Prepares a machine and its cutter.
    ///
    /// # Errors
    /// A value missing in the study, or see [`NoSetup`].
    pub fn new(config: &'a Mechanism, study: &'a Study) -> Result<Self, NoSetup> {
        let setup = Setup::new(config, study)?;
        let lacks = |section| Lacking::Key { section, key: "depth_mm" };
        let (depth, teeth) = match (&study.cutting, &study.turning) {
            (_, Some(turning)) => {
                let depth = turning.depth_mm.ok_or_else(|| lacks("turning"))?.0;
                (depth, Teeth::of_edge(turning, depth))
            }
            (Some(cutter), None) => {
                let depth = cutter.depth_mm.ok_or_else(|| lacks("cutting"))?;
                (depth, Teeth::of(cutter, study.milling.as_ref(), depth))
            }
            (None, None) => return Err(NoSetup::Process),
        };
        let model = Model::of(config, study)?;
        let drives = Capacity::of(config, study)?;
        Ok(Self { subject: Subject { config, model, drives, teeth }, setup, depth, study })
    }

    /// Assesses a program, with its stability at `most_places` positions, up to the depth `deepest` in mm. `show` receives
    /// the progress.
    ///
    /// # Errors
    /// The error, with its location in the program.
    pub fn judge(
        &self,
        program: &Path,
        moves: &[Move],
        options: &Options,
        most_places: usize,
        deepest: Option<f64>,
        mut show: impl FnMut(Step) + Send,
    ) -> Result<Report, AtPlace> {
        let Self { subject, setup, depth, study } = self;
        let no_cut = |error| AtPlace::new(program.display(), error);
        let lines = lines(moves).map_err(no_cut)?;
        let against = match &study.turning {
            Some(turning) => against_thicker(subject.config, moves, turning).map_err(no_cut)?,
            None => None,
        };
        let rapids = through_stock(subject.config, study, moves);
        let (stops, feed_moves) = stops(subject.config, moves, most_places).map_err(no_cut)?;
        let at = |Stop { line, programmed, .. }: &Stop| {
            let pose = in_words(&Pose::from_degrees(*programmed));
            format!("{}: line {line}: {pose}", program.display())
        };
        let deepest = deepest.unwrap_or(DEEPEST * depth);
        let path = path::Path::new(setup, &stops, deepest);
        let path = path.map_err(|(k, error)| AtPlace::new(at(&stops[k]), error))?;
        path.check(f64::INFINITY).map_err(|(k, error)| AtPlace::new(at(&stops[k]), error))?;
        let (found, ran, clock) = self.passed(program, moves, options, &lines, &mut show)?;
        let show = Mutex::new(|share| show(Step::Search("limit depths", share)));
        let shown = |share| show.lock().expect("never poisoned")(share);
        shown(0.0);
        let depths = path.depths(shown);
        let steps = half_steps(subject.config);
        let window = pass::WINDOW as f64 * subject.config.period;
        let mut places = vec![];
        let ends: Vec<Option<f64>> = match &ran {
            Run::NotJudged(_) => lengths(moves, &stops).into_iter().map(Some).collect(),
            Run::Finished(_) | Run::Stopped(..) => {
                stops.iter().map(|stop| clock.end_of(stop.step)).collect()
            }
        };
        for ((stop, limit), end) in stops.iter().zip(depths).zip(&ends) {
            let part = match &ran {
                Run::NotJudged(_) => end.map(|end| {
                    let step = stop.step;
                    [end - length([&moves[step - 1], &moves[step]]), end]
                }),
                // The moment of a window may be outside of the move.
                Run::Finished(_) | Run::Stopped(..) => {
                    clock.of_command(stop.step).map(|[begin, end]| [begin - window, end + window])
                }
            };
            let of_line = match found.lines.get(&stop.line) {
                Some(line) => line.chip,
                // LinuxCNC blended the line with its neighbors: use the largest value observed.
                None => found.peaks[0].as_ref().map_or(0.0, |peak| peak.value),
            };
            // A loop executes the line at several speeds.
            let of_pass = part.and_then(|part| found.stretches.chip_between(part));
            let chip = of_pass.map_or(of_line, |chip| chip.min(of_line));
            let place = subject.look(stop, chip, steps.as_deref());
            places.push((*stop, limit, place.map_err(|error| AtPlace::new(at(stop), error))?));
        }
        let into = rapids.iter().flatten().map(|line| {
            format!(
                "line {line}: a rapid move goes through the material of [stock] that is left there"
            )
        });
        let warnings = against.map(thinner).into_iter().chain(into).collect();
        let not_examined = rapids.err();
        let looked =
            Looked { places, at: ends, feed_moves, deepest, warnings, rapids: not_examined };
        Ok(report(subject, program.into(), *depth, &lines, found, &looked, &ran))
    }

    /// Runs a program and assesses its moments, with the times of its moves; assesses only its moves if LinuxCNC cannot
    /// run it.
    fn passed(
        &self,
        program: &Path,
        moves: &[Move],
        options: &Options,
        lines: &Lines,
        show: &mut impl FnMut(Step),
    ) -> Result<(Found, Run, Clock), AtPlace> {
        let Subject { config, .. } = self.subject;
        let failed = |(line, error): (u32, NoMoment)| {
            AtPlace::new(format!("{}: line {line}", program.display()), error)
        };
        let mut pass = Pass::new(&self.subject, lines);
        let mut error = None;
        let whole = MachineConfig::whole_of(config)
            .map_err(|error| AtPlace::new(config.file.display(), error))?;
        let mut clock = Clock::default();
        let mut translator = Translator::new(&whole);
        let outcome = process::run_with_moves(&whole, program, options, |event| {
            match event {
                Event::Row(row) => {
                    show(Step::Row(row));
                    let Beside { pose, tool } = row.of(config);
                    let own = Row { pose, tool, ..*row };
                    clock.see(&own, row.cycle as f64 * config.period);
                    error = pass.see(&own).err();
                }
                Event::Move(commanded) => {
                    pass.command(commanded);
                    let mut count = 0;
                    translator.see(commanded, |_| count += 1);
                    clock.command(count);
                }
                Event::File(_) => {}
            }
            if error.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        if let Some(error) = error {
            return Err(failed(error));
        }
        Ok(match outcome {
            Ok(outcome) => {
                let found = pass.finish().map_err(failed)?;
                let errors = outcome.messages.iter().filter(|message| message.is_error());
                let texts: Vec<&str> = errors.map(|message| message.text.as_str()).collect();
                let run = match outcome.ending {
                    Ending::Finished => Run::Finished(outcome.seconds),
                    Ending::Stopped => Run::Stopped(outcome.seconds, texts.join("; ")),
                };
                (found, run, clock)
            }
            Err(why) => {
                let pass = Pass::new(&self.subject, lines);
                let found = pass.of_moves(moves).map_err(failed)?;
                (found, Run::NotJudged(why.to_string()), clock)
            }
        })
    }
}
