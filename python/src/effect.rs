use crate::arrays::shaped;
use deflex::cell::{NewEffect, Uncertainty};
use deflex::effects::{self, Parameter};
use deflex::nalgebra::DMatrix;
use deflex::toml::{Table, Value};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A physical effect with its parameters.
#[pyclass(frozen, eq, module = "deflex")]
pub(crate) struct Effect {
    pub(crate) effect: Box<dyn effects::Effect>,
    pub(crate) covariance: Option<DMatrix<f64>>,
}

impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        self.effect.to_table() == other.effect.to_table() && self.covariance == other.covariance
    }
}

impl Effect {
    /// The effect as a cell file takes it.
    pub(crate) fn new_effect(&self) -> NewEffect {
        let rows = |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        let uncertainty = self.covariance.as_ref().map(|covariance| Uncertainty::Own(rows(covariance)));
        NewEffect { table: self.effect.to_table(), uncertainty, provenance: Table::new() }
    }

    fn of_each<'py, T>(&self, py: Python<'py>, value: impl Fn(Parameter) -> T) -> Bound<'py, PyArray1<T>>
    where
        T: numpy::Element,
    {
        PyArray1::from_iter(py, self.effect.parameters().into_iter().map(value))
    }
}

#[pymethods]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
impl Effect {
    /// Reads the keys of an `[[effect]]` table.
    #[staticmethod]
    #[pyo3(signature = (text, covariance = None))]
    fn parse(text: &str, covariance: Option<Vec<Vec<f64>>>) -> PyResult<Self> {
        let mut table: Table = text.parse().map_err(|error| PyValueError::new_err(format!("no TOML: {error}")))?;
        let Some(Value::String(name)) = table.remove("kind") else {
            return Err(PyValueError::new_err("the effect has no kind, for example kind = \"backlash\""));
        };
        let kind =
            effects::kind(&name).ok_or_else(|| PyValueError::new_err(format!("{name:?} is no kind of effect")))?;
        let effect =
            (kind.read)(table).map_err(|error| PyValueError::new_err(format!("{name}: {}", error.message())))?;
        let size = effect.uncertain();
        let covariance = covariance.map(|rows| match rows.len() == size && rows.iter().all(|row| row.len() == size) {
            true => Ok(DMatrix::from_row_iterator(size, size, rows.into_iter().flatten())),
            false => Err(PyValueError::new_err(format!("covariance: expected shape ({size}, {size})"))),
        });
        Ok(Self { effect, covariance: covariance.transpose()? })
    }

    /// The keys of its `[[effect]]` table.
    fn to_toml(&self) -> String {
        self.effect.to_table().to_string()
    }

    /// Name of the effect in cell files.
    #[getter]
    fn kind(&self) -> &str {
        self.effect.kind()
    }

    /// Keys of the parameters.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.effect.parameters().into_iter().map(|parameter| parameter.name).collect()
    }

    /// Units of the parameters.
    #[getter]
    fn units(&self) -> Vec<&'static str> {
        self.effect.parameters().into_iter().map(|parameter| parameter.unit).collect()
    }

    /// Values of the parameters.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of_each(py, |parameter| parameter.value)
    }

    /// Means of the physical priors.
    #[getter]
    fn prior_mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of_each(py, |parameter| parameter.neutral)
    }

    /// Standard deviations of the physical priors.
    #[getter]
    fn prior_std<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of_each(py, |parameter| parameter.typical)
    }

    /// Physical bounds.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let bounds: Vec<[f64; 2]> = self.effect.parameters().iter().map(|parameter| parameter.bounds.into()).collect();
        let count = bounds.len();
        shaped(py, bounds.into_flattened(), [count, 2])
    }

    /// Covariance of the parameters, if the cell states one.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(covariance) = &self.covariance else { return Ok(None) };
        let numbers = covariance.transpose().as_slice().to_vec();
        shaped(py, numbers, [covariance.nrows(), covariance.ncols()]).map(Some)
    }

    /// The same effect with other values of its parameters.
    fn with_values(&self, values: Vec<f64>) -> PyResult<Self> {
        let parameters = self.effect.parameters();
        if values.len() != parameters.len() {
            let message = format!("values has {} numbers, expected {}", values.len(), parameters.len());
            return Err(PyValueError::new_err(message));
        }
        for (Parameter { name, bounds: (low, high), .. }, value) in parameters.iter().zip(&values) {
            if !(low..=high).contains(&value) {
                return Err(PyValueError::new_err(format!("{name} is {value}, expected {low} to {high}")));
            }
        }
        Ok(Self { effect: self.effect.with_values(&values), covariance: None })
    }

    fn __repr__(&self) -> String {
        format!("Effect({:?}, {} parameters)", self.kind(), self.effect.parameters().len())
    }
}
