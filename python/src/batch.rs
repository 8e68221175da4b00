// SPDX-License-Identifier: GPL-2.0-or-later
//! A calculation for every row of an array, on all cores and without the interpreter's lock.

use crate::arrays::{Rows, WIDEST};
use crate::refusal::refused;
use kinematics::Fault;
use numpy::ndarray::ArrayView2;
use numpy::{IntoPyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PySlice;
use rayon::prelude::*;

/// Rows per task: some ten microseconds of work at least, so that distributing
/// them costs little.
const CHUNK: usize = 256;

/// The answer of a batch: values, and for each row a code, 0 if it has an answer.
#[pyclass(frozen, get_all, module = "pkmkins")]
pub struct Answer {
    /// One row for each input row; NaN if there is no answer.
    pub values: Py<PyArrayDyn<f64>>,
    /// Codes of refusals, int32, 0 if there is an answer; `pkmkins.cause` explains them.
    pub code: Py<PyArray1<i32>>,
    /// Number of the leg or joint that a refusal names, int32, −1 if it names none.
    pub part: Py<PyArray1<i32>>,
}

#[pymethods]
impl Answer {
    /// Returns whether each row has an answer.
    #[getter]
    fn ok<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.code.bind(py).call_method1("__eq__", (0,))
    }
}

impl Answer {
    /// Returns the numbers `from` to `to` of every row with shape `inner`, in the same memory.
    pub fn numbers(
        &self,
        py: Python<'_>,
        [from, to]: [usize; 2],
        inner: &[usize],
    ) -> PyResult<Self> {
        let values = self.values.bind(py);
        let outer = &values.shape()[..values.ndim() - 1];
        let shape: Vec<usize> = outer.iter().chain(inner).copied().collect();
        let columns = PySlice::new(py, from as isize, to as isize, 1);
        let part = values.get_item((py.Ellipsis(), columns))?.cast_into::<PyArrayDyn<f64>>()?;
        Ok(Self {
            values: part.reshape(shape)?.unbind(),
            code: self.code.clone_ref(py),
            part: self.part.clone_ref(py),
        })
    }
}

/// Numbers of the rows, with their codes and parts, before they are converted to Python objects.
pub struct Found {
    pub values: Vec<f64>,
    pub codes: Vec<i32>,
    pub parts: Vec<i32>,
    first: Option<Fault>,
}

impl Found {
    fn of(count: usize, width: usize) -> Self {
        Self {
            values: vec![0.0; count * width],
            codes: vec![0; count],
            parts: vec![-1; count],
            first: None,
        }
    }

    /// Converts to arrays; the shape of one row is `inner`.
    ///
    /// # Errors
    /// A single row was given and has no answer.
    pub fn answer(self, py: Python<'_>, rows: &Rows, inner: &[usize]) -> PyResult<Answer> {
        if let (true, Some(fault)) = (rows.is_single, self.first) {
            return Err(refused(py, &fault));
        }
        let outer: &[usize] = if rows.is_single { &[] } else { &[self.codes.len()] };
        let shape: Vec<usize> = outer.iter().chain(inner).copied().collect();
        let values = self.values.into_pyarray(py).reshape(shape)?;
        Ok(Answer {
            values: values.unbind(),
            code: self.codes.into_pyarray(py).unbind(),
            part: self.parts.into_pyarray(py).unbind(),
        })
    }
}

/// The input rows in their memory layout.
struct Given<'a> {
    view: ArrayView2<'a, f64>,
    /// All numbers, if the rows are contiguous.
    flat: Option<&'a [f64]>,
}

impl<'a> Given<'a> {
    fn of(view: &'a ArrayView2<f64>) -> Self {
        Self { view: view.view(), flat: view.as_slice() }
    }

    /// Returns one row; `copy` stores it if its numbers are not contiguous.
    fn row<'b>(&'b self, number: usize, copy: &'b mut [f64; WIDEST]) -> &'b [f64] {
        let width = self.view.ncols();
        if let Some(flat) = self.flat {
            return &flat[number * width..][..width];
        }
        let row = &mut copy[..width];
        row.iter_mut().zip(self.view.row(number)).for_each(|(to, from)| *to = *from);
        row
    }
}

/// Consecutive rows of answers, and the number of the first one.
struct Piece<'a> {
    start: usize,
    width: usize,
    values: &'a mut [f64],
    codes: &'a mut [i32],
    parts: &'a mut [i32],
}

impl Piece<'_> {
    /// Computes one row after the other; returns the first one without an answer.
    fn ask<S>(
        self,
        given: &Given,
        state: &mut S,
        ask: impl Fn(&mut S, usize, &[f64], &mut [f64]) -> Result<(), Fault>,
    ) -> Option<(usize, Fault)> {
        let (mut first, mut copy) = (None, [0.0; WIDEST]);
        let answers = self.values.chunks_exact_mut(self.width).zip(self.codes).zip(self.parts);
        for (number, ((answer, code), part)) in (self.start..).zip(answers) {
            if let Err(fault) = ask(state, number, given.row(number, &mut copy), answer) {
                answer.fill(f64::NAN);
                *code = fault.cause.code();
                *part = fault.number().map_or(-1, i32::from);
                first = first.or(Some((number, fault)));
            }
        }
        first
    }
}

/// Computes every row, on all cores; `new` creates the state kept between the rows of a piece, `ask` writes the
/// `width` numbers of an answer.
pub fn each<S>(
    py: Python<'_>,
    rows: &Rows,
    width: usize,
    new: impl Fn() -> S + Sync,
    ask: impl Fn(&mut S, usize, &[f64], &mut [f64]) -> Result<(), Fault> + Sync,
) -> Found {
    let (view, count) = (rows.view(), rows.count());
    py.detach(|| {
        let given = Given::of(&view);
        let mut found = Found::of(count, width);
        let pieces = found
            .values
            .par_chunks_mut(CHUNK * width)
            .zip(found.codes.par_chunks_mut(CHUNK))
            .zip(found.parts.par_chunks_mut(CHUNK))
            .enumerate();
        let faults = pieces.filter_map(|(n, ((values, codes), parts))| {
            let piece = Piece { start: n * CHUNK, width, values, codes, parts };
            piece.ask(&given, &mut new(), &ask)
        });
        found.first = faults.min_by_key(|(number, _)| *number).map(|(_, fault)| fault);
        found
    })
}

/// Computes one row after the other, each with the `state` left by the one before.
pub fn in_order<S: Send>(
    py: Python<'_>,
    rows: &Rows,
    width: usize,
    mut state: S,
    ask: impl Fn(&mut S, usize, &[f64], &mut [f64]) -> Result<(), Fault> + Send,
) -> Found {
    let (view, count) = (rows.view(), rows.count());
    py.detach(|| {
        let mut found = Found::of(count, width);
        let Found { values, codes, parts, .. } = &mut found;
        let piece = Piece { start: 0, width, values, codes, parts };
        found.first = piece.ask(&Given::of(&view), &mut state, ask).map(|(_, fault)| fault);
        found
    })
}
