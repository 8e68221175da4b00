// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse and forward kinematics, Jacobians and margins of many poses.

use crate::arrays::Rows;
use crate::batch::{Answer, Found, each, in_order};
use kinematics::{At, Fault, Limits, Margin, Pose, Vector3, World};
use machine::limits;
use machine::read::mechanism::Mechanism;
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PySlice;

/// The six numbers of a pose, angles in degrees.
pub const POSE: usize = 6;

pub fn pose(row: &[f64]) -> Pose {
    Pose::from_degrees(*row.first_chunk().expect("the shape was looked at"))
}

/// The seeds of forward.
pub enum Seeds<'py> {
    /// Every row starts from the same pose.
    One(Pose),
    /// Each starts from a separate row.
    Own(Rows<'py>),
    /// The first starts from this pose, each other one from the last pose found.
    Followed(Pose),
}

/// Rows of a call from Python, and the machine and tool vector that they are for.
pub struct Batch<'a, 'py> {
    pub py: Python<'py>,
    pub config: &'a Mechanism,
    /// Poses; joint values for forward, LinuxCNC's positions for own poses.
    pub rows: Rows<'py>,
    pub tool: Vector3<f64>,
}

impl Batch<'_, '_> {
    pub fn inverse(&self) -> PyResult<Answer> {
        let Self { config, tool, .. } = self;
        let joints = config.joints.len();
        let ask = |row: &[f64], answer: &mut [f64]| {
            let found = config.machine.inverse(&pose(row), tool)?;
            answer.iter_mut().zip(found).for_each(|(joint, value)| *joint = value);
            Ok(())
        };
        self.each(joints, ask).answer(self.py, &self.rows, &[joints])
    }

    /// Computes the poses of the control point in base, with the coordinates that constraints determine.
    pub fn full_poses(&self) -> PyResult<Answer> {
        let ask = |at: &At, answer: &mut [f64]| {
            answer.copy_from_slice(&at.full_pose().to_degrees());
            Ok(())
        };
        self.at_each(POSE, ask).answer(self.py, &self.rows, &[POSE])
    }

    /// Converts positions of LinuxCNC, X Y Z A B C U V W, to the machine's own poses.
    pub fn own_poses(&self) -> PyResult<Answer> {
        let Self { config, tool, .. } = self;
        let ask = |row: &[f64], answer: &mut [f64]| {
            let world: World = *row.first_chunk().expect("the shape was looked at");
            answer.copy_from_slice(&config.machine.pose_of_world(&config.chain, &world, tool)?);
            Ok(())
        };
        self.each(POSE, ask).answer(self.py, &self.rows, &[POSE])
    }

    pub fn forward(&self, seeds: &Seeds) -> PyResult<Answer> {
        let Self { py, config, rows: joints, tool } = self;
        let ask = |seed: &Pose, row: &[f64], answer: &mut [f64]| -> Result<Pose, Fault> {
            let values = std::array::from_fn(|i| row.get(i).copied().unwrap_or(0.0));
            let pose = config.machine.forward(&values, seed, tool, &config.solver)?.pose;
            answer.copy_from_slice(&pose.to_degrees());
            Ok(pose)
        };
        let found = match seeds {
            Seeds::One(seed) => self.each(POSE, |row, to| ask(seed, row, to).map(|_| ())),
            Seeds::Own(own) => {
                let (given, wanted) = (own.count(), joints.count());
                if given != wanted {
                    let text =
                        format!("seed: {given} rows; expected one, or {wanted} as joints has");
                    return Err(PyValueError::new_err(text));
                }
                let own = own.view();
                let seed = |n| Pose::from_degrees(std::array::from_fn(|k| own[[n, k]]));
                let ask = |(): &mut (), n, row: &[f64], to: &mut [f64]| {
                    ask(&seed(n), row, to).map(|_| ())
                };
                each(*py, joints, POSE, || (), ask)
            }
            Seeds::Followed(first) => in_order(*py, joints, POSE, *first, |seed, _, row, to| {
                *seed = ask(seed, row, to)?;
                Ok(())
            }),
        };
        found.answer(*py, joints, &[POSE])
    }

    pub fn jacobian(&self) -> PyResult<Answer> {
        let joints = self.config.joints.len();
        let ask = |at: &At, answer: &mut [f64]| {
            let rows = at.pose_jacobian()?;
            for (to, row) in answer.chunks_exact_mut(POSE).zip(rows.row_iter()) {
                to.iter_mut().zip(row.iter()).for_each(|(to, value)| *to = *value);
            }
            Ok(())
        };
        self.at_each(joints * POSE, ask).answer(self.py, &self.rows, &[joints, POSE])
    }

    pub fn conditioning(&self) -> PyResult<Answer> {
        let ask = |at: &At, answer: &mut [f64]| {
            answer[0] = at.smallest_singular_value();
            Ok(())
        };
        self.at_each(1, ask).answer(self.py, &self.rows, &[])
    }

    /// Returns least and largest X, Y and Z of the machine at each pose: (n, 2, 3).
    pub fn space(&self) -> PyResult<Answer> {
        let config = self.config;
        let ask = |at: &At, answer: &mut [f64]| {
            let ends = machine::space::space(config, at);
            answer.iter_mut().zip(ends.iter().flatten()).for_each(|(to, value)| *to = *value);
            Ok(())
        };
        self.at_each(2 * 3, ask).answer(self.py, &self.rows, &[2, 3])
    }

    pub fn margins(&self) -> PyResult<Margins> {
        let Self { py, config, .. } = *self;
        let all = limits::of(config);
        let columns = columns(config, &all);
        let count = columns.len();
        let ask = |at: &At, answer: &mut [f64]| {
            let (values, shares) = answer.split_at_mut(count);
            // The visited limits depend on the machine, not on the pose.
            let mut places = values.iter_mut().zip(shares);
            limits::each(at, &all, |margin| {
                if let Some((value, share)) = places.next() {
                    (*value, *share) = (margin.value, margin.share());
                }
            });
            Ok(())
        };
        let found = self.at_each(2 * count, ask);
        let name = |margin: &Margin| {
            format!("{}: {}", margin.limit.name(), limits::part(config, margin.limit, margin.part))
        };
        let ends = |k: usize| columns.iter().map(|margin| margin.range[k]).collect::<Vec<_>>();
        Ok(Margins {
            answer: Py::new(py, found.answer(py, &self.rows, &[2, count])?)?,
            low: ends(0).into_pyarray(py).unbind(),
            high: ends(1).into_pyarray(py).unbind(),
            names: columns.iter().map(name).collect(),
        })
    }

    /// Computes `width` numbers of every row.
    pub fn each(
        &self,
        width: usize,
        ask: impl Fn(&[f64], &mut [f64]) -> Result<(), Fault> + Sync,
    ) -> Found {
        each(self.py, &self.rows, width, || (), |(), _, row, answer| ask(row, answer))
    }

    /// Computes at every pose, moving from one to the next in the same memory.
    fn at_each(
        &self,
        width: usize,
        ask: impl Fn(&At, &mut [f64]) -> Result<(), Fault> + Sync,
    ) -> Found {
        let Self { config, tool, .. } = self;
        let new = || config.machine.nowhere();
        each(self.py, &self.rows, width, new, |at, _, row, answer| {
            at.move_to(&pose(row), tool)?;
            ask(at, answer)
        })
    }
}

/// Margins of many poses: columns are the limits of the machine's file.
#[pyclass(frozen, get_all, module = "pkmkins")]
pub struct Margins {
    /// Values and shares, (n, 2, columns), with the codes of poses that have none.
    pub answer: Py<Answer>,
    /// Smallest allowed value of each column, −inf if there is none.
    pub low: Py<PyArray1<f64>>,
    /// Largest allowed value of each column, inf if there is none.
    pub high: Py<PyArray1<f64>>,
    /// Description of each column.
    pub names: Vec<String>,
}

#[pymethods]
impl Margins {
    /// Returns the value of each limit, machine units, degrees or no dimension.
    #[getter]
    fn value<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.plane(py, 0)
    }

    /// Returns the room as a fraction of the range: 0 at the limit, negative beyond it, inf if there is none.
    #[getter]
    fn share<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.plane(py, 1)
    }
}

impl Margins {
    fn plane<'py>(&self, py: Python<'py>, plane: usize) -> PyResult<Bound<'py, PyAny>> {
        let values = self.answer.get().values.bind(py);
        values.get_item((py.Ellipsis(), plane, PySlice::full(py)))
    }
}

/// Returns the margins at home, where every machine has all of them.
fn columns(config: &Mechanism, all: &Limits) -> Vec<Margin> {
    let mut columns = vec![];
    if let Ok(at) = config.machine.at(&config.home_pose(), &config.spindle) {
        limits::each(&at, all, |margin| columns.push(margin));
    }
    columns
}
