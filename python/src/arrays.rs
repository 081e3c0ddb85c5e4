//! Converts NumPy arrays to tables and tables to arrays. An array takes over the memory of a result without a copy.

use crate::work;
use deflex::limits::ARRAY_ROWS;
use deflex::report::{Column, ColumnValues, columns};
use numpy::{
    AllowTypeChange, IntoPyArray, PyArray1, PyArrayLike1, PyArrayLike2, PyArrayLike3, PyArrayMethods, PyReadonlyArray1,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedStr;
use pyo3::types::{PyBytes, PyDict};
use std::fmt::Write;

use crate::errors::OrRaise;

/// Anything that NumPy takes for rows of numbers.
pub(crate) type Rows<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;
/// The same for matrices.
pub(crate) type Matrices<'py> = PyArrayLike3<'py, f64, AllowTypeChange>;

/// Rows of `N` numbers each.
pub(crate) fn rows<const N: usize>(name: &str, array: &Rows<'_>) -> PyResult<Vec<[f64; N]>> {
    let shape = array.shape();
    if shape[1] != N {
        let message = format!("{name} has shape ({}, {}), expected (N, {N})", shape[0], shape[1]);
        return Err(PyValueError::new_err(message));
    }
    bounded(name, shape[0])?;
    // Most arrays have the order of C and are copied at once.
    let all = match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => slice.as_chunks::<N>().0.to_vec(),
        _ => array.as_array().iter().copied().collect::<Vec<f64>>().as_chunks::<N>().0.to_vec(),
    };
    finite(name, all.as_flattened(), N)?;
    Ok(all)
}

/// Rows of `N` numbers each, as many as `count`: one row given stands for all.
pub(crate) fn rows_for<const N: usize>(name: &str, array: &Rows<'_>, count: usize) -> PyResult<Vec<[f64; N]>> {
    let all = rows::<N>(name, array)?;
    Ok(if let [one] = all[..] { vec![one; count] } else { all })
}

/// A number for each row, or one for all.
pub(crate) fn column(values: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<f64>> {
    match values.extract::<f64>() {
        Ok(value) => Ok(vec![value; count]),
        Err(_) => Ok(values.extract::<PyArrayLike1<'_, f64, AllowTypeChange>>()?.as_array().iter().copied().collect()),
    }
}

/// Matrices of 4 by 4.
pub(crate) fn matrices(name: &str, array: &Matrices<'_>) -> PyResult<Vec<[[f64; 4]; 4]>> {
    let shape = array.shape();
    if shape[1..] != [4, 4] {
        let message = format!("{name} has shape ({}, {}, {}), expected (N, 4, 4)", shape[0], shape[1], shape[2]);
        return Err(PyValueError::new_err(message));
    }
    bounded(name, shape[0])?;
    let all: Vec<f64> = match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => slice.to_vec(),
        _ => array.as_array().iter().copied().collect(),
    };
    Ok(all.as_chunks::<4>().0.as_chunks::<4>().0.to_vec())
}

/// Checks the number of rows before memory is allocated, because a view of a few numbers may have any number of rows.
fn bounded(name: &str, count: usize) -> PyResult<()> {
    let over = ARRAY_ROWS.exceeded(count as f64);
    over.map_or(Ok(()), |over| Err(PyValueError::new_err(format!("{name}: {over}; {}", ARRAY_ROWS.help))))
}

fn finite(name: &str, all: &[f64], width: usize) -> PyResult<()> {
    match all.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(PyValueError::new_err(format!("{name}[{}, {}] is not finite", at / width, at % width))),
        None => Ok(()),
    }
}

/// A column of a table: an array of numbers, or the text of each field.
#[derive(FromPyObject)]
pub(crate) enum GivenColumn<'py> {
    Whole(PyReadonlyArray1<'py, i64>),
    Number(PyReadonlyArray1<'py, f64>),
    Text(Vec<PyBackedStr>),
}

impl GivenColumn<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Whole(values) => values.len(),
            Self::Number(values) => values.len(),
            Self::Text(texts) => texts.len(),
        }
    }
}

/// The text of a CSV file with columns of one length. Numbers have the fewest digits that read back as the same number;
/// NaN is an empty field.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts it
pub(crate) fn table_text<'py>(
    py: Python<'py>,
    columns: Vec<(String, GivenColumn<'py>)>,
) -> PyResult<Bound<'py, PyBytes>> {
    let failed = |error: csv::Error| PyValueError::new_err(error.to_string());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns.iter().map(|(name, _)| name)).map_err(failed)?;
    let mut field = String::new();
    for row in 0..columns.first().map_or(0, |(_, column)| column.len()) {
        for (_, column) in &columns {
            field.clear();
            let text = match column {
                GivenColumn::Whole(values) => write!(field, "{}", values.as_array()[row]).map(|()| &field[..]),
                GivenColumn::Number(values) if values.as_array()[row].is_nan() => Ok(""),
                GivenColumn::Number(values) => write_number(&mut field, values.as_array()[row]).map(|()| &field[..]),
                GivenColumn::Text(texts) => Ok(&texts[row][..]),
            };
            writer.write_field(text.unwrap_or_default()).map_err(failed)?;
        }
        writer.write_record(None::<&[u8]>).map_err(failed)?;
    }
    let text = writer.into_inner().map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(PyBytes::new(py, &text))
}

/// Writes a whole number without a fraction, as ordinals are written, and others with an exponent where they are very large or small.
#[allow(clippy::cast_possible_truncation)] // of a whole number that an f64 represents exactly
fn write_number(field: &mut String, value: f64) -> std::fmt::Result {
    let is_whole = value.fract() == 0.0 && value.abs() < 9e15;
    if is_whole { write!(field, "{}", value as i64) } else { write!(field, "{value:?}") }
}

/// Numbers as an array of this shape.
pub(crate) fn shaped<'py, D: numpy::ndarray::IntoDimension>(
    py: Python<'py>,
    numbers: Vec<f64>,
    shape: D,
) -> PyResult<Bound<'py, numpy::PyArray<f64, D::Dim>>> {
    numbers.into_pyarray(py).reshape(shape)
}

/// Makes an array read-only, because a result returns the same array at each access.
fn kept<'a, 'py>(array: &'a Bound<'py, PyAny>) -> PyResult<&'a Bound<'py, PyAny>> {
    array.getattr("flags")?.setattr("writeable", false)?;
    Ok(array)
}

/// Columns of numbers by their names.
pub(crate) fn numbers_by_name<'py>(py: Python<'py>, columns: Vec<(&str, Vec<f64>)>) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (name, values) in columns {
        all.set_item(name, kept(PyArray1::from_vec(py, values).as_any())?)?;
    }
    Ok(all)
}

/// The columns of a report by their names.
pub(crate) fn report<'py>(py: Python<'py>, csv: &[u8]) -> PyResult<Bound<'py, PyDict>> {
    let all = work::detached(py, || columns(csv)).or_raise(py)?;
    let report = PyDict::new(py);
    for Column { name, values, .. } in all {
        match values {
            ColumnValues::Whole(values) => report.set_item(name, kept(PyArray1::from_vec(py, values).as_any())?)?,
            ColumnValues::Number(values) => report.set_item(name, kept(PyArray1::from_vec(py, values).as_any())?)?,
            ColumnValues::Text(values) => {
                let array = py.import("numpy")?.call_method1("array", (values, "str"))?;
                report.set_item(name, kept(&array)?)?;
            }
        }
    }
    Ok(report)
}
