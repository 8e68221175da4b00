// SPDX-License-Identifier: GPL-2.0-or-later
//! Refusals as exceptions: of a machine file, of a pose, and of a subcommand.

use kinematics::{CAUSES, Cause, Fault};
use pyo3::exceptions::{PyKeyError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

pyo3::create_exception!(
    pkmkins,
    MachineError,
    PyValueError,
    "An INI file, a study or dimensions that do not describe a machine; the text has location and remedy."
);
pyo3::create_exception!(
    pkmkins,
    CommandFailed,
    PyRuntimeError,
    "A call that corresponds to a subcommand of `pkm` gave no result (exit status 2); the text has the reason."
);
pyo3::create_exception!(
    pkmkins,
    Refused,
    PyValueError,
    "A pose or joint values without a solution: attributes code, name, part, value and remedy."
);

/// Converts a fault to an exception.
pub fn refused(py: Python<'_>, fault: &Fault) -> PyErr {
    let error = Refused::new_err(fault.to_string());
    let instance = error.value(py);
    let cause = fault.cause;
    let set = || -> PyResult<()> {
        instance.setattr("code", cause.code())?;
        instance.setattr("name", cause.name())?;
        instance.setattr("part", fault.number())?;
        instance.setattr("value", fault.value)?;
        instance.setattr("remedy", cause.remedy())
    };
    match set() {
        Ok(()) => error,
        Err(other) => other,
    }
}

/// Converts an error of a machine, with the text of `pkm`.
pub fn machine_error(error: impl ToString) -> PyErr {
    MachineError::new_err(error.to_string())
}

/// Converts the error of a call equivalent to a subcommand of `pkm`.
pub fn failed(error: impl ToString) -> PyErr {
    CommandFailed::new_err(error.to_string())
}

fn of_code(code: i32) -> Option<Cause> {
    CAUSES.iter().copied().find(|cause| cause.code() == code)
}

/// Describes a code: `{"code", "name", "text", "remedy"}`.
#[pyfunction]
pub fn cause(py: Python<'_>, code: i32) -> PyResult<Bound<'_, PyDict>> {
    let Some(cause) = of_code(code) else {
        return Err(PyKeyError::new_err(format!(
            "{code} is not the code of a refusal (0 means success)"
        )));
    };
    let described = PyDict::new(py);
    described.set_item("code", code)?;
    described.set_item("name", cause.name())?;
    described.set_item("text", cause.text())?;
    described.set_item("remedy", cause.remedy())?;
    Ok(described)
}
