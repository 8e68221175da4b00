// SPDX-License-Identifier: GPL-2.0-or-later
//! Models of a machine for simulators: rigid bodies, joints, and the loops that the legs close.
//!
//! - Input: a description of `machine`, and masses from a study.
//! - Output: a folder with an MJCF, SDF or URDF file, its shapes and a README; joint values of the model at a pose.
//! - Uses: `machine` and `studies`.
//!
//! `assemble` builds the one [`model::Model`] of a machine at home, `legs` and `constraints` the bodies and joints of each
//! kind, `mass` their masses; `state` computes the value of every joint at a pose. `mjcf`, `sdf` and `urdf` write the model
//! through `xml`, `readme` describes it, `stl` converts shapes, and `folder` writes the files.

pub mod assemble;
mod constraints;
pub mod folder;
mod legs;
mod mass;
mod mjcf;
pub mod model;
mod readme;
mod sdf;
mod split;
pub mod state;
mod stl;
mod universal;
mod urdf;
mod xml;
