// SPDX-License-Identifier: GPL-2.0-or-later
//! The class `Machine`: a machine from its INI file, or from the dimensions of `pkm new`.

use crate::arrays::{Rows, triple};
use crate::batch::Answer;
use crate::kinematics::{Batch, Margins, POSE, Seeds, pose};
use crate::refusal::machine_error;
use crate::sections::Parts;
use crate::studies::{self, Look, Sensitivity, Stiffness, Workspace};
use ::studies::study::workspace::tilts;
use kinematics::{Letter, POSE_LETTERS, Vector3};
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use new::kinds::KINDS;
use new::make::sketched;
use new::values::Values;
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::{PyDeprecationWarning, PyNotImplementedError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Number of directions of a tilt, as in `pkm workspace`.
const DIRECTIONS: usize = 12;
const STEPS: f64 = 300.0;

/// A machine with its limits. It is immutable, and any number of threads may use it.
#[pyclass(frozen, module = "pkmkins")]
pub struct Machine {
    config: Mechanism,
}

impl Machine {
    fn of(machine: MachineConfig) -> PyResult<Self> {
        let config = machine.first();
        match config.second_letters {
            None => Ok(Self { config: config.clone() }),
            Some(_) => Err(PyNotImplementedError::new_err(format!(
                "{}: the machine has two mechanisms (second=): not supported in Python; use the command pkm",
                config.file.display()
            ))),
        }
    }

    fn of_ini(ini: &Ini) -> PyResult<Self> {
        Self::of(MachineConfig::leniently(ini, Some(Lenient::Constraints)).map_err(machine_error)?)
    }

    /// Returns the tool vector, spindle offset included, as in `pkm joints --tool`.
    fn offset(&self, given: Option<Vec<f64>>) -> PyResult<Vector3<f64>> {
        Ok(self.config.spindle + Vector3::from(triple("tool", given)?))
    }

    /// Returns the tool vector of the machine's own poses: 0 if an axis carries the tool or the platform carries the work.
    fn tool(&self, given: Option<Vec<f64>>) -> PyResult<Vector3<f64>> {
        Ok(self.config.chain.machine_tool(&self.offset(given)?))
    }

    /// Reads the poses and the tool of a call.
    fn batch<'py>(
        &self,
        poses: &Bound<'py, PyAny>,
        tool: Option<Vec<f64>>,
    ) -> PyResult<Batch<'_, 'py>> {
        let rows = Rows::of("poses", poses, POSE)?;
        Ok(Batch { py: poses.py(), config: &self.config, rows, tool: self.tool(tool)? })
    }
}

#[pymethods]
impl Machine {
    #[new]
    #[pyo3(signature = (legs, coordinates="XYZABC", *, table="", home=None, unit="mm", pkm=None))]
    fn new(
        legs: Vec<Bound<'_, PyDict>>,
        coordinates: &str,
        table: &str,
        home: Option<Vec<f64>>,
        unit: &str,
        pkm: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let home = triple("home", home)?;
        let (coordinates, table, unit) = (coordinates.into(), table.into(), unit.into());
        let parts = Parts { legs, coordinates, table, home, unit, pkm };
        Self::from_text(&parts.text()?, "machine")
    }

    #[staticmethod]
    fn from_ini(path: PathBuf) -> PyResult<Self> {
        Self::of_ini(&Ini::read(&path).map_err(machine_error)?)
    }

    #[staticmethod]
    #[pyo3(signature = (text, name="machine.ini"))]
    fn from_text(text: &str, name: &str) -> PyResult<Self> {
        Self::of_ini(&Ini::parse(Path::new(name), text).map_err(machine_error)?)
    }

    /// Creates a machine of a kind of `pkm new` from its values as words, keyed as the command's options.
    #[staticmethod]
    fn of_kind(py: Python<'_>, kind: &str, given: BTreeMap<String, Vec<String>>) -> PyResult<Self> {
        let Some(of_kind) = KINDS.iter().find(|known| known.name == kind) else {
            let names: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
            let text =
                format!("{kind}: unknown kind of machine; expected one of {}", names.join(", "));
            return Err(PyValueError::new_err(text));
        };
        let parameters = of_kind.parameters();
        let mut named = BTreeMap::new();
        for (name, words) in given {
            let Some(parameter) = parameters.iter().find(|parameter| parameter.name == name) else {
                let names: Vec<&str> = parameters.iter().map(|parameter| parameter.name).collect();
                let text = format!(
                    "{name}: unknown value of a {kind}; expected one of {}",
                    names.join(", ")
                );
                return Err(PyValueError::new_err(text));
            };
            named.insert(parameter.name, words);
        }
        let values = Values::new(of_kind.name, &parameters, &named).map_err(machine_error)?;
        let config = py.detach(|| sketched(of_kind, &values)).map_err(machine_error)?;
        Self::of(config)
    }

    #[getter]
    fn text(&self) -> &str {
        self.config.ini.text()
    }

    #[getter]
    fn joints(&self) -> Vec<String> {
        self.config.joints.iter().map(|joint| joint.name.clone()).collect()
    }

    #[getter]
    fn coordinates(&self) -> String {
        let layout = self.config.machine.layout();
        Letter::ALL.iter().filter(|l| !layout.is_held(**l)).map(|l| l.name()).collect()
    }

    #[getter]
    fn dependent(&self) -> String {
        self.config.dependent().iter().map(|letter| letter.name()).collect()
    }

    #[getter]
    fn home<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.config.home.to_vec().into_pyarray(py)
    }

    #[getter]
    fn unit(&self) -> &str {
        self.config.length_unit()
    }

    #[getter]
    fn scale(&self) -> f64 {
        self.config.machine.size()
    }

    #[getter]
    fn size(&self, py: Python<'_>) -> PyResult<f64> {
        let text =
            c"Machine.size is deprecated: use scale; what the machine occupies is space(poses)";
        PyErr::warn(py, &py.get_type::<PyDeprecationWarning>(), text, 1)?;
        Ok(self.scale())
    }

    #[getter]
    fn radius(&self) -> f64 {
        self.config.machine.radius()
    }

    #[getter]
    fn geometry_hash(&self) -> u32 {
        self.config.hash
    }

    #[pyo3(signature = (poses, *, tool=None))]
    fn inverse(&self, poses: &Bound<'_, PyAny>, tool: Option<Vec<f64>>) -> PyResult<Answer> {
        self.batch(poses, tool)?.inverse()
    }

    #[pyo3(signature = (poses, *, tool=None))]
    fn full_poses(&self, poses: &Bound<'_, PyAny>, tool: Option<Vec<f64>>) -> PyResult<Answer> {
        self.batch(poses, tool)?.full_poses()
    }

    #[pyo3(signature = (positions, *, tool=None))]
    fn own_poses(&self, positions: &Bound<'_, PyAny>, tool: Option<Vec<f64>>) -> PyResult<Answer> {
        let rows = Rows::of("positions", positions, POSE_LETTERS.len())?;
        let (py, tool) = (positions.py(), self.offset(tool)?);
        Batch { py, config: &self.config, rows, tool }.own_poses()
    }

    #[pyo3(signature = (joints, *, seed=None, follow=false, tool=None))]
    fn forward(
        &self,
        joints: &Bound<'_, PyAny>,
        seed: Option<&Bound<'_, PyAny>>,
        follow: bool,
        tool: Option<Vec<f64>>,
    ) -> PyResult<Answer> {
        let given = seed.map(|seed| Rows::of("seed", seed, POSE)).transpose()?;
        let seeds = match given {
            Some(own) if !own.is_single && follow => {
                return Err(PyValueError::new_err(
                    "seed: expected a single pose when rows are followed",
                ));
            }
            Some(own) if !own.is_single => Seeds::Own(own),
            one => {
                let own = one.map(|one| pose(&one.view().row(0).to_vec()));
                let seed = own.unwrap_or(self.config.home_pose());
                if follow { Seeds::Followed(seed) } else { Seeds::One(seed) }
            }
        };
        let (py, rows) = (joints.py(), Rows::of("joints", joints, self.config.joints.len())?);
        Batch { py, config: &self.config, rows, tool: self.tool(tool)? }.forward(&seeds)
    }

    #[pyo3(signature = (poses, *, tool=None))]
    fn jacobian(&self, poses: &Bound<'_, PyAny>, tool: Option<Vec<f64>>) -> PyResult<Answer> {
        self.batch(poses, tool)?.jacobian()
    }

    #[pyo3(signature = (poses, *, tool=None))]
    fn conditioning(&self, poses: &Bound<'_, PyAny>, tool: Option<Vec<f64>>) -> PyResult<Answer> {
        self.batch(poses, tool)?.conditioning()
    }

    #[pyo3(signature = (poses, *, tool=None))]
    fn space(&self, poses: &Bound<'_, PyAny>, tool: Option<Vec<f64>>) -> PyResult<Answer> {
        self.batch(poses, tool)?.space()
    }

    #[pyo3(signature = (poses, *, tool=None))]
    fn margins(&self, poses: &Bound<'_, PyAny>, tool: Option<Vec<f64>>) -> PyResult<Margins> {
        self.batch(poses, tool)?.margins()
    }

    #[pyo3(signature = (poses, study, *, tool=None))]
    fn stiffness(
        &self,
        poses: &Bound<'_, PyAny>,
        study: &str,
        tool: Option<Vec<f64>>,
    ) -> PyResult<Stiffness> {
        let study = studies::study(Some(study))?;
        studies::stiffness(&self.batch(poses, tool)?, &study)
    }

    #[pyo3(signature = (poses, *, length=None, tool=None))]
    fn sensitivity(
        &self,
        poses: &Bound<'_, PyAny>,
        length: Option<f64>,
        tool: Option<Vec<f64>>,
    ) -> PyResult<Sensitivity> {
        let length = length.unwrap_or(self.config.machine.radius());
        if !(length > 0.0 && length.is_finite()) {
            return Err(PyValueError::new_err(format!("length: {length}; expected more than 0")));
        }
        studies::sensitivity(&self.batch(poses, tool)?, length)
    }

    #[pyo3(signature = (*, orientations=None, tilt=None, start=None, study=None, bands=60, grid=0, tool=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "named in Python, one for each option of pkm workspace"
    )]
    fn workspace(
        &self,
        py: Python<'_>,
        orientations: Option<Vec<[f64; 3]>>,
        tilt: Option<f64>,
        start: Option<Vec<f64>>,
        study: Option<&str>,
        bands: usize,
        grid: usize,
        tool: Option<Vec<f64>>,
    ) -> PyResult<Workspace> {
        let orientations = match (orientations, tilt) {
            (Some(_), Some(_)) => {
                return Err(PyValueError::new_err("use either orientations or tilt, not both"));
            }
            (Some(given), None) if given.is_empty() => {
                return Err(PyValueError::new_err("orientations: expected at least one"));
            }
            (Some(given), None) => given,
            (None, Some(tilt)) if (0.0..90.0).contains(&tilt) => {
                tilts(&self.config, tilt, DIRECTIONS)
            }
            (None, Some(tilt)) => {
                let text = format!("tilt: {tilt}; expected at least 0 and less than 90 degrees");
                return Err(PyValueError::new_err(text));
            }
            (None, None) => vec![[0.0; 3]],
        };
        if !(4..=2000).contains(&bands) || grid > 2000 {
            return Err(PyValueError::new_err("bands: expected 4 to 2000, grid: 0 to 2000"));
        }
        let from = match start {
            Some(start) => Vector3::from(triple("start", Some(start))?),
            None => self.config.home_pose().position,
        };
        let (study, tool) = (studies::study(study)?, self.tool(tool)?);
        let look = Look { bands, grid, steps: STEPS };
        studies::seen(py, &self.config, tool, orientations, from, &study, &look)
    }

    fn __repr__(&self) -> String {
        format!(
            "<pkmkins.Machine {}: {} joints, {}, {}>",
            self.config.file.display(),
            self.config.joints.len(),
            self.coordinates(),
            self.unit()
        )
    }
}
