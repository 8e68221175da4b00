// SPDX-License-Identifier: GPL-2.0-or-later
//! Replay cases of tests/cases/replay.toml: a machine, a program, and the expectations.

use machine::read::machine::MachineConfig;
use program::mechanism_moves::moves_of;
use program::motion::{self, LINUXCNC_PROGRAMS};
use program::replay::{Replay, replay};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Prefix of programs that come with LinuxCNC.
const LINUXCNC: &str = "linuxcnc:";

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Folder and file name of the configuration: configs/NAME/NAME.ini.
    pub machine: String,
    /// Whether the second of two mechanisms is replayed.
    #[serde(default)]
    pub second: bool,
    /// Program next to the INI file, or `linuxcnc:NAME` for one that LinuxCNC ships.
    pub program: String,
    /// G54 for this run: x y z in machine units, a b c in degrees.
    pub work_offset: Option<[f64; 6]>,
    /// Least number of moves, if the program is read to its end.
    pub min_moves: usize,
    /// Lower bound of the largest correction, in machine units: the program does exercise the
    /// screws. Rods have no nut that rotates with the platform.
    #[serde(default)]
    pub min_correction: f64,
}

/// Seconds between poses.
const PERIOD: f64 = 1e-3;

/// Largest pose mismatch, as a share of the machine's size: guaranteed by the project over the workspace. About 1e-12
/// is observed, where the solver stops.
const MAX_RELATIVE_MISMATCH: f64 = 1e-10;

/// Most iterations of a forward call one servo step away: guaranteed by the project.
const MAX_ITERATIONS: u32 = 3;

/// Smallest share of poses proved by a single ball.
const MIN_CERTIFIED: f64 = 1.0;

/// Largest joint motion due to a change of tool length, in joint units: tools change while the platform is level, which
/// allows only rounding.
const MAX_TOOL_STEP: f64 = 1e-9;

/// Result of a case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The values.
    pub replay: Replay,
    /// One sentence for each violated expectation or limit.
    pub failures: Vec<String>,
}

impl Case {
    /// Returns the INI file, given the folder of the configurations.
    pub fn ini(&self, configs: &Path) -> PathBuf {
        configs.join(&self.machine).join(format!("{}.ini", self.machine))
    }

    /// Returns the program file, given the folder of the configurations.
    pub fn program(&self, configs: &Path) -> PathBuf {
        match self.program.strip_prefix(LINUXCNC) {
            Some(name) => Path::new(LINUXCNC_PROGRAMS).join(name),
            None => configs.join(&self.machine).join(&self.program),
        }
    }

    /// Runs the case.
    ///
    /// # Errors
    /// A sentence, if the machine or program cannot be read, or a pose fails.
    pub fn run(&self, configs: &Path) -> Result<Outcome, String> {
        let mut whole = MachineConfig::read(&self.ini(configs)).map_err(|e| e.to_string())?;
        // A case does not depend on the parameter file of an earlier run.
        for mechanism in &mut whole.mechanisms {
            Arc::make_mut(&mut mechanism.facts).program.parameter_file = None;
        }
        let number = usize::from(self.second);
        let config = whole.mechanisms.get(number).ok_or("no second mechanism")?;
        let program = self.program(configs);
        let block = self.work_offset.map(|[x, y, z, a, b, c]| {
            format!("G10 L2 P1 X{x:.12} Y{y:.12} Z{z:.12} A{a:.12} B{b:.12} C{c:.12}")
        });
        let moves = match whole.second_letters {
            Some(_) => moves_of(config, &whole, &program).map(|(moves, _)| moves),
            None => motion::moves(&whole, &program, block.as_deref()),
        };
        let moves = moves.map_err(|e| e.to_string())?;
        let replay =
            replay(config, &moves, PERIOD).map_err(|e| format!("{}: {e}", program.display()))?;
        let mut failures = self.failures(&replay);
        failures.extend(replay.violations(config));
        Ok(Outcome { replay, failures })
    }

    fn failures(&self, replay: &Replay) -> Vec<String> {
        let checks = [
            (
                replay.moves >= self.min_moves,
                format!("{} moves, expected {}", replay.moves, self.min_moves),
            ),
            (
                replay.relative_mismatch <= MAX_RELATIVE_MISMATCH,
                format!(
                    "mismatch {:e} of size in line {}",
                    replay.relative_mismatch, replay.mismatch.line
                ),
            ),
            (
                replay.iterations_max <= MAX_ITERATIONS,
                format!("{} iterations", replay.iterations_max),
            ),
            (replay.certified >= MIN_CERTIFIED, format!("only {} certified", replay.certified)),
            (
                replay.correction.value >= self.min_correction,
                format!("correction reaches only {}", replay.correction.value),
            ),
            (
                replay.tool_step.value <= MAX_TOOL_STEP,
                format!(
                    "tool change in line {} moves a joint by {}",
                    replay.tool_step.line, replay.tool_step.value
                ),
            ),
        ];
        checks.into_iter().filter(|(kept, _)| !kept).map(|(_, text)| text).collect()
    }
}
