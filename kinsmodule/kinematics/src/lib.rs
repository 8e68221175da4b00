// SPDX-License-Identifier: GPL-2.0-or-later
//! Kinematics of parallel machines: legs between a fixed base and a moving platform.
//!
//! Pure functions of (machine, input); no allocation, no unsafe code, no state
//! between calls. The same code runs in LinuxCNC's servo thread and on the host.
//!
//! Data flows one way: a [`Geometry`] (as the integrator wrote it) is checked once by
//! [`Machine::freeze`]; the resulting [`Machine`] provides [`Machine::inverse`],
//! [`Machine::forward`] and [`Machine::at`] for everything else about a pose.
//!
//! Frames: *base* is the machine frame of G-code poses; *platform*
//! moves with the tool. Lengths are in the machine's own unit (mm, inch or m: no
//! constant of this crate contains a length), angles in radians.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod ahead;
mod at;
mod between;
mod boxes;
mod carried;
mod certificate;
mod chain;
mod constraint;
mod corner;
mod coupling;
mod extra;
mod fault;
mod forward;
mod freeze;
mod geometry;
mod inverse;
mod jacobian;
mod lanes;
mod layout;
pub mod leg;
mod legs_at;
mod letters;
mod limits;
mod load;
mod load_error;
mod machine;
mod mechanism;
mod nut;
mod placed;
mod pose;
mod pseudo_inverse;
mod rings;
mod second;
mod segment;
mod side;
mod singular;
mod spheres;
mod target;
mod text;
mod trig;
mod watch;

pub use ahead::{Motion, Outlook, Planner, Sight};
pub use at::At;
pub use between::{Body, Gap};
pub use boxes::{
    BOX_TOLERANCE, LAST_STEP, MAX_BOX_STEPS, MAX_BOXES, Progress, STEPS_PER_CALL, Search,
    WorkspaceBox,
};
pub use certificate::{CERTAIN_AT_ALL, CERTIFIED};
pub use chain::{Carries, Chain, ChainGeometry, Link, LinkGeometry, MAX_LINKS, World, WorldRates};
pub use constraint::{ConstraintGeometry, MAX_CONSTRAINTS};
pub use corner::{Corner, Straight};
pub use extra::{ExtraAxes, MAX_EXTRA, POSE_LETTERS};
pub use fault::{CAUSES, Cause, Fault, MachinePart};
pub use forward::{Certificate, MAX_ITERATIONS, MAX_SUB_STEPS, Method, Solution, Solver};
pub use geometry::{Geometry, LegGeometry};
pub use jacobian::Jacobian;
pub use layout::{Joints, Layout, MAX_JOINTS, MAX_LEGS, PerLeg};
pub use leg::{LEAST_DRIVE, LegKind};
pub use letters::{Letter, Letters};
pub use limits::{CONDITIONING_LIMIT, Limit, Limits, Margin, Part};
pub use load::{LOAD_PARAMETERS, Load};
pub use load_error::LoadError;
pub use machine::Machine;
pub use nalgebra::{Matrix3, Vector3};
pub use nut::{LEAST_SINE_TO_AXIS, MIN_SIN_SQUARED};
pub use pose::Pose;
pub use second::Second;
pub use segment::Segment;
pub use side::Side;
pub use text::{Piece, Text};
pub use watch::{Cones, Nearest, Turns, Watch};
