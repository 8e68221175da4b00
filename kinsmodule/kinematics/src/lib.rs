// SPDX-License-Identifier: GPL-2.0-or-later
//! Kinematics of parallel machines: legs between a fixed base and a moving platform.
//!
//! Pure functions of (machine, input); no allocation, no unsafe code, no state
//! between calls. The same code runs in LinuxCNC's servo thread and on the host.
//!
//! Data flows one way: [`Geometry`] (what the integrator wrote) is checked once by
//! [`Machine::freeze`]; a [`Machine`] then answers [`Machine::inverse`],
//! [`Machine::forward`] and [`Machine::inverse_jacobian`].
//!
//! Frames: *base* is the machine frame that G-code poses are given in; *platform*
//! moves with the tool. Lengths are in the machine's own unit (mm, inch or m: no
//! constant of this crate has a length in it), angles in radians.
#![no_std]
#![forbid(unsafe_code)]

mod ahead;
mod boxes;
mod certificate;
mod fault;
mod forward;
mod freeze;
mod geometry;
mod inverse;
mod jacobian;
mod lanes;
mod layout;
pub mod leg;
mod load;
mod machine;
mod nut;
mod pose;
mod qr;
mod text;
mod watch;

pub use ahead::{Limits, Motion, Outlook, Planner};
pub use boxes::{
    BOX_TOLERANCE, LAST_STEP, MAX_BOX_STEPS, MAX_BOXES, Progress, STEPS_PER_CALL, Search,
    WorkspaceBox,
};
pub use fault::{CAUSES, Cause, Fault, MachinePart};
pub use forward::{Certificate, MAX_ITERATIONS, MAX_SUB_STEPS, Method, Solution, Solver};
pub use geometry::{Geometry, LegGeometry};
pub use layout::{Joints, Layout, Letter, Letters, MAX_JOINTS, MAX_LEGS, PerLeg};
pub use leg::LegKind;
pub use load::{Load, LoadError};
pub use machine::{Jacobian, Machine, Moving, Segment};
pub use nalgebra::{Matrix3, Vector3};
pub use pose::Pose;
pub use text::{Part, Text};
pub use watch::{Cones, Nearest, Watch};
