// SPDX-License-Identifier: GPL-2.0-or-later
//! Studies of a machine as in `pkm`: workspace, stiffness, sensitivity.

use crate::batch::Answer;
use crate::kinematics::{Batch, POSE, pose};
use crate::refusal::machine_error;
use kinematics::{Cause, Fault, Vector3};
use machine::read::mechanism::Mechanism;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use studies::study::body::{Body, Effort, counted};
use studies::study::file::Study;
use studies::study::sensitivity;
use studies::study::springs::Springs;
use studies::study::stiffness;
use studies::study::workspace;

/// Reads a study from the text of its file.
pub fn study(text: Option<&str>) -> PyResult<Study> {
    let parsed = text.map_or(Ok(Study::default()), Study::parse);
    parsed.map_err(|error| machine_error(format!("study: {error}")))
}

/// Size of a compliance matrix.
const MATRIX: usize = POSE * POSE;
const AXES: usize = 3;

/// The refusal at a singular pose, as from forward.
const SINGULAR: Fault = Fault::with_value(Cause::Singular, 0.0);

/// Stiffness at the tool tip of many poses.
#[pyclass(frozen, get_all, module = "pkmkins")]
pub struct Stiffness {
    /// (n, 6, 6): displacements in mm and turns in rad for forces in N and moments in N mm, machine axes.
    pub compliance: Py<Answer>,
    /// (n, 3): stiffness along the principal axes of displacements, smallest first, N/mm.
    pub translation: Py<Answer>,
    /// (n, 3): the same for rotations, N mm/rad.
    pub rotation: Py<Answer>,
}

pub fn stiffness(batch: &Batch, study: &Study) -> PyResult<Stiffness> {
    let Batch { py, config, rows, tool } = batch;
    let py = *py;
    let springs = Springs::of(config, study).map_err(machine_error)?;
    let ask = |row: &[f64], answer: &mut [f64]| {
        let at = stiffness::Stiffness::at(config, &pose(row), tool, &springs)?.ok_or(SINGULAR)?;
        let (compliance, principal) = answer.split_at_mut(MATRIX);
        let (translation, rotation) = principal.split_at_mut(AXES);
        compliance.copy_from_slice(at.compliance.as_slice());
        translation.copy_from_slice(&at.translation().stiffness);
        rotation.copy_from_slice(&at.rotation().stiffness);
        Ok(())
    };
    let (turns, all) = (MATRIX + AXES, MATRIX + 2 * AXES);
    let found = batch.each(all, ask).answer(py, rows, &[all])?;
    Ok(Stiffness {
        compliance: Py::new(py, found.numbers(py, [0, MATRIX], &[POSE, POSE])?)?,
        translation: Py::new(py, found.numbers(py, [MATRIX, turns], &[AXES])?)?,
        rotation: Py::new(py, found.numbers(py, [turns, all], &[AXES])?)?,
    })
}

/// The effect of errors of joints on many poses.
#[pyclass(frozen, get_all, module = "pkmkins")]
pub struct Sensitivity {
    /// (n, 6, joints): change of the pose, machine units and degrees, per change of a joint.
    pub gain: Py<Answer>,
    /// (n, 2): largest and smallest singular value of the inverse Jacobian, angles times the length.
    pub singular_values: Py<Answer>,
}

pub fn sensitivity(batch: &Batch, length: f64) -> PyResult<Sensitivity> {
    let Batch { py, config, rows, tool } = batch;
    let py = *py;
    let joints = config.joints.len();
    let (gains, all) = (POSE * joints, POSE * joints + 2);
    let ask = |row: &[f64], answer: &mut [f64]| {
        let at = sensitivity::Sensitivity::at(config, &pose(row), tool, length)?.ok_or(SINGULAR)?;
        let (gain, values) = answer.split_at_mut(gains);
        for (to, row) in gain.chunks_exact_mut(joints).zip(at.gain.row_iter()) {
            to.iter_mut().zip(row.iter()).for_each(|(to, value)| *to = *value);
        }
        values.copy_from_slice(&at.singular_values);
        Ok(())
    };
    let found = batch.each(all, ask).answer(py, rows, &[all])?;
    Ok(Sensitivity {
        gain: Py::new(py, found.numbers(py, [0, gains], &[POSE, joints])?)?,
        singular_values: Py::new(py, found.numbers(py, [gains, all], &[2])?)?,
    })
}

/// The resolution of a workspace.
pub struct Look {
    /// Rays from pole to pole.
    pub bands: usize,
    /// Points of the grid along its longest side.
    pub grid: usize,
    /// Steps along a ray.
    pub steps: f64,
}

/// The workspace around a start pose.
#[pyclass(frozen, get_all, module = "pkmkins")]
pub struct Workspace {
    /// Volume within the boundary, machine units cubed; the area, squared, if there are two dimensions.
    pub volume: f64,
    /// Number of dimensions: 2 on a planar machine.
    pub dimensions: usize,
    /// The same by counting a grid; NaN without a grid.
    pub volume_by_grid: f64,
    /// Fraction of the directions that each limit ends.
    pub limits: Py<PyDict>,
    /// Points of the boundary, (n, 3).
    pub vertices: Py<PyArray2<f64>>,
    /// Triangles of the boundary, (m, 3) indices of vertices.
    pub triangles: Py<PyArray2<usize>>,
    /// Origin of the rays, X Y Z.
    pub start: Py<PyArray1<f64>>,
}

pub fn seen(
    py: Python<'_>,
    config: &Mechanism,
    tool: Vector3<f64>,
    orientations: Vec<[f64; 3]>,
    from: Vector3<f64>,
    study: &Study,
    look: &Look,
) -> PyResult<Workspace> {
    let space =
        workspace::Workspace::new(config, tool, orientations, study).map_err(machine_error)?;
    let step = space.extent() / look.steps;
    let effort = Effort { bands: look.bands, step, grid: look.grid, progress: &|_| () };
    let found = py.detach(|| {
        let body = Body::seen(&space, from, &effort)?;
        let grid = (look.grid > 0).then(|| counted(&space, &body.corners(), &effort).volume);
        Ok((body, grid))
    });
    let (body, grid) = found.map_err(|limit: workspace::Border| {
        let text = format!("X{} Y{} Z{} is not in the workspace: {limit}", from.x, from.y, from.z);
        machine_error(text)
    })?;
    let limits = PyDict::new(py);
    for (limit, share) in body.shares() {
        limits.set_item(limit.to_string(), share)?;
    }
    let (points, triangles) = body.mesh();
    let flat: Vec<f64> = points.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
    let numbers: Vec<usize> = triangles.iter().flatten().copied().collect();
    Ok(Workspace {
        volume: body.volume(),
        dimensions: space.axes().len(),
        volume_by_grid: grid.unwrap_or(f64::NAN),
        limits: limits.unbind(),
        vertices: flat.into_pyarray(py).reshape([points.len(), 3])?.unbind(),
        triangles: numbers.into_pyarray(py).reshape([triangles.len(), 3])?.unbind(),
        start: vec![from.x, from.y, from.z].into_pyarray(py).unbind(),
    })
}
