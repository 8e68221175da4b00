// SPDX-License-Identifier: GPL-2.0-or-later
//! Why a path is refused.

use crate::gcode::SetupError;
use crate::whole::CurveError;
use kinematics::Fault;

/// Why a path is refused.
#[derive(Debug, thiserror::Error)]
pub enum RouteError {
    #[error(transparent)]
    Curve(#[from] CurveError),
    #[error(transparent)]
    Setup(#[from] SetupError),
    #[error(
        "at t = {t}: the curve has a gap from {from:?} to {to:?}, mm; set [program] clear_z_mm or clear_x_mm to cross it"
    )]
    Gap {
        t: f64,
        /// End point before the gap, mm.
        from: [f64; 3],
        /// Start point after the gap, mm.
        to: [f64; 3],
    },
    #[error("at t = {t}: {text}")]
    Leaves { t: f64, text: String },
    #[error("line {line} of the program, on the approach or retract: {text}")]
    Beside {
        /// Line of the program.
        line: u32,
        text: String,
    },
    #[error("at t = {t}: {joint} needs {speed:.3}/s, but MAX_VELOCITY allows {most}/s; reduce the programmed speed to {share:.3} of it there", share = most / speed)]
    TooFast { t: f64, joint: String, speed: f64, most: f64 },
    #[error("at t = {t}: {fault}")]
    Fault { t: f64, fault: Fault },
}
