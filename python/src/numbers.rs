//! Converts arrays of `NumPy` into tables, and back.

use numpy::ndarray::{ArrayView2, Dimension};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArray3, PyArrayDescrMethods as _, PyArrayMethods as _, PyReadonlyArray,
    PyUntypedArray, PyUntypedArrayMethods as _, dtype,
};
use pyo3::prelude::*;
use tautline::swarm::Rows;

use crate::errors::{wrong_input, wrong_type};

/// Borrows an array of doubles with these axes, such as `(T, N, 3)`, in any memory order.
///
/// # Errors
/// `TypeError` for anything but an array of doubles, `Error` for another number of axes.
pub(crate) fn borrowed<'py, D: Dimension>(
    given: &Bound<'py, PyAny>,
    what: &str,
    axes: &str,
) -> PyResult<PyReadonlyArray<'py, f64, D>> {
    let Ok(array) = given.cast::<PyUntypedArray>() else {
        let kind = given.get_type().qualname()?;
        return Err(wrong_type(format!(
            "{what}: a NumPy array is needed, not {kind}; give numpy.asarray(..., dtype=float)"
        )));
    };
    if given.hasattr("mask")? {
        return Err(wrong_type(format!("{what}: a masked array has unknown numbers; give it as .filled(numpy.nan)")));
    }
    if !array.dtype().is_equiv_to(&dtype::<f64>(given.py())) {
        let kind = array.dtype();
        return Err(wrong_type(format!(
            "{what}: an array of float64 is needed, not of {kind}; give it as .astype(float)"
        )));
    }
    let Ok(array) = given.cast::<PyArray<f64, D>>() else {
        let shape = shape_text(array.shape());
        return Err(wrong_input(format!("{what}: an array of shape {axes} is needed, not of shape {shape}")));
    };
    if !array.is_aligned() {
        return Err(wrong_type(format!(
            "{what}: its numbers are not aligned in memory; give a copy, numpy.array(...)"
        )));
    }
    array.try_readonly().map_err(|error| wrong_input(format!("{what}: {error}; give a copy")))
}

/// Returns a shape as Python shows it.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    let lengths: Vec<_> = shape.iter().map(ToString::to_string).collect();
    if lengths.len() == 1 { format!("({},)", lengths[0]) } else { format!("({})", lengths.join(", ")) }
}

/// Returns the rows of an array N x 3 or N x 2; the third column of the latter is 0.
pub(crate) fn to_rows(array: ArrayView2<'_, f64>) -> Rows {
    Rows::from_fn(array.nrows(), |i, axis| array.get((i, axis)).copied().unwrap_or(0.0))
}

/// Returns the numbers of a table row by row.
pub(crate) fn by_row(rows: &Rows) -> impl Iterator<Item = f64> + '_ {
    (0..rows.nrows()).flat_map(move |i| (0..3).map(move |axis| rows[(i, axis)]))
}

/// Returns a table as an array N x 3.
pub(crate) fn table<'py>(py: Python<'py>, rows: &Rows) -> PyResult<Bound<'py, PyArray2<f64>>> {
    vectors(py, by_row(rows).collect())
}

/// Returns consecutive vectors as an array M x 3.
pub(crate) fn vectors(py: Python<'_>, numbers: Vec<f64>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = numbers.len() / 3;
    PyArray1::from_vec(py, numbers).reshape([count, 3])
}

/// Returns consecutive numbers as an array with three axes.
pub(crate) fn cube<T: Element>(py: Python<'_>, numbers: Vec<T>, shape: [usize; 3]) -> PyResult<Bound<'_, PyArray3<T>>> {
    PyArray1::from_vec(py, numbers).reshape(shape)
}

/// Returns a separation [m] with at most six decimals, rounded down.
#[pyfunction]
pub(crate) fn separation_text(distance_m: f64) -> String {
    tautline::text::at_least(distance_m, 6)
}
