// SPDX-License-Identifier: GPL-2.0-or-later
//! Why a path cannot be taken.

use crate::curve::gcode::SetupError;
use crate::curve::whole::CurveError;
use kinematics::Fault;

/// A path that is none, or that the machine cannot take.
#[derive(Debug, thiserror::Error)]
pub enum RouteError {
    /// The curve.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// The program's keys, or a coordinate that the machine holds.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// A gap that no key says how to cross.
    #[error(
        "at t = {t}: the curve has a gap from {from:?} to {to:?}, mm; [program] clear_z_mm or clear_x_mm says how the tool crosses it"
    )]
    Gap {
        /// Where on the curve.
        t: f64,
        /// The end before it, mm.
        from: [f64; 3],
        /// The start behind it, mm.
        to: [f64; 3],
    },
    /// A limit of the machine.
    #[error("at t = {t}: {text}")]
    Leaves {
        /// Where on the curve.
        t: f64,
        /// Which limit.
        text: String,
    },
    /// A limit of the machine on the way to the curve or from it.
    #[error("line {line} of the program, on the way to or from the curve: {text}")]
    Beside {
        /// The program's line.
        line: u32,
        /// Which limit.
        text: String,
    },
    /// Too fast for a joint.
    #[error("at t = {t}: {joint} needs {speed:.3}/s, MAX_VELOCITY allows {most}/s; a share of {share:.3} of the programmed speed fits there", share = most / speed)]
    TooFast {
        /// Where on the curve.
        t: f64,
        /// The joint.
        joint: String,
        /// Its speed.
        speed: f64,
        /// Its limit.
        most: f64,
    },
    /// A tool that the machine cannot take, or a pose out of its reach.
    #[error("at t = {t}: {fault}")]
    Fault {
        /// Where on the curve.
        t: f64,
        /// Why.
        fault: Fault,
    },
}
