// SPDX-License-Identifier: GPL-2.0-or-later
//! Arrays of numpy as rows of numbers, without copies where they are float64 in any order.

use numpy::ndarray::{ArrayView2, Axis, Ix1, Ix2};
use numpy::{
    PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// Most numbers of a row: joints of a machine.
pub const WIDEST: usize = kinematics::MAX_JOINTS;

/// Rows from Python: an array (n, width), or one row (width,).
pub struct Rows<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    /// Whether a single row was given, whose answer is a single row too.
    pub is_single: bool,
}

impl<'py> Rows<'py> {
    /// Converts an array of float64, or anything that numpy converts to one.
    ///
    /// # Errors
    /// The array has another type of number, or another shape.
    pub fn of(name: &str, given: &Bound<'py, PyAny>, width: usize) -> PyResult<Self> {
        let array = match given.cast::<PyUntypedArray>() {
            Ok(array) => float64(name, array)?,
            Err(_) => {
                let numpy = given.py().import("numpy")?;
                let made = numpy.call_method1("asarray", (given, "float64")).map_err(|error| {
                    PyTypeError::new_err(format!("{name}: not an array of numbers: {error}"))
                })?;
                made.cast_into::<PyArrayDyn<f64>>()?
            }
        };
        let shape = array.shape().to_vec();
        if shape.len() > 2 || shape.last() != Some(&width) {
            return Err(PyValueError::new_err(format!(
                "{name}: shape {shape:?}; expected (n, {width}), or ({width},) for one row"
            )));
        }
        let is_single = shape.len() == 1;
        Ok(Self { array: array.try_readonly()?, is_single })
    }

    pub fn view(&self) -> ArrayView2<'_, f64> {
        let view = self.array.as_array();
        match self.is_single {
            true => view.into_dimensionality::<Ix1>().map(|row| row.insert_axis(Axis(0))),
            false => view.into_dimensionality::<Ix2>(),
        }
        .expect("the shape was looked at")
    }

    /// Returns the number of rows.
    pub fn count(&self) -> usize {
        self.view().nrows()
    }
}

/// Refuses anything but float64 instead of copying it silently.
fn float64<'py>(
    name: &str,
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let found = array.dtype();
    if !found.is_equiv_to(&numpy::dtype::<f64>(array.py())) {
        return Err(PyTypeError::new_err(format!(
            "{name}: numbers of type {found}; expected float64: pass {name}.astype(float)"
        )));
    }
    Ok(array.cast::<PyArrayDyn<f64>>()?.clone())
}

/// Returns three numbers of an optional argument.
pub fn triple(name: &str, given: Option<Vec<f64>>) -> PyResult<[f64; 3]> {
    let given = given.unwrap_or_else(|| vec![0.0; 3]);
    let count = given.len();
    given.try_into().map_err(|_| {
        PyValueError::new_err(format!("{name}: {count} numbers; expected three, X Y Z"))
    })
}
