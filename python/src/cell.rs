use crate::arrays::{Rows, column, rows, rows_for, shaped};
use crate::effect::Effect;
use crate::errors::{Diagnostic, OrRaise, diagnostics};
use crate::robot::Robot;
use crate::work;
use deflex::cell::{NewEffect, with_effects, with_stiffness};
use deflex::correct::{ArmState, Standing, external_of, predict_poses, tool_of};
use deflex::robot::{PoseMatrix, pose_matrix};
use deflex::session::CellFile;
use deflex::text::Source;
use numpy::{PyArray2, PyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// A milling cell.
#[pyclass(frozen, eq, hash, module = "deflex")]
#[derive(Clone, PartialEq, Hash)]
pub(crate) struct Cell {
    pub(crate) file: Arc<CellFile>,
}

#[pymethods]
impl Cell {
    #[staticmethod]
    #[allow(clippy::needless_pass_by_value)] // as PyO3 extracts it
    /// Reads and checks a cell file.
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let file = CellFile::read(&path).or_raise(py)?;
        Ok(Self { file: Arc::new(file) })
    }

    /// Checks the text of a cell file; `name` is its name in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name = "cell.toml"))]
    pub(crate) fn parse(py: Python<'_>, text: &str, name: &str) -> PyResult<Self> {
        let file = CellFile::parse(Source::new(name, text)).or_raise(py)?;
        Ok(Self { file: Arc::new(file) })
    }

    /// The text of the cell file, with its comments.
    fn to_toml(&self) -> String {
        String::from_utf8_lossy(&self.file.source().bytes).into_owned()
    }

    /// The file.
    #[getter]
    fn name(&self) -> &str {
        &self.file.source().name
    }

    /// The arm, with the declared stiffness.
    #[getter]
    fn robot(&self) -> Robot {
        Robot::of(&self.file)
    }

    /// Names of the declared tools, upper case.
    #[getter]
    fn tools(&self) -> Vec<&str> {
        self.file.cell().tools.keys().map(String::as_str).collect()
    }

    /// Names of the declared work objects, upper case.
    #[getter]
    fn wobjs(&self) -> Vec<&str> {
        self.file.cell().wobjs.keys().map(String::as_str).collect()
    }

    /// The effects that act, in order.
    #[getter]
    fn effects(&self) -> Vec<Effect> {
        let cell = self.file.cell();
        let effects = cell.arm.effects.iter().zip(&cell.covariances);
        effects
            .map(|(effect, covariance)| Effect { effect: effect.clone_box(), covariance: covariance.clone() })
            .collect()
    }

    /// The same cell with exactly these effects.
    #[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
    fn with_effects(&self, py: Python<'_>, effects: Vec<PyRef<'_, Effect>>) -> PyResult<Self> {
        let effects: Vec<NewEffect> = effects.iter().map(|effect| effect.new_effect()).collect();
        Self::parse(py, &with_effects(&self.to_toml(), &effects).or_raise(py)?, self.name())
    }

    /// The same cell with another stiffness of the joints.
    fn with_stiffness(&self, py: Python<'_>, joint_nm_per_rad: [f64; 6]) -> PyResult<Self> {
        Self::parse(py, &with_stiffness(&self.to_toml(), joint_nm_per_rad).or_raise(py)?, self.name())
    }

    /// Warnings about values that are possible but seldom intended.
    #[getter]
    fn notes(&self) -> Vec<Diagnostic> {
        diagnostics(self.file.cell().notes.clone())
    }

    /// The TCP of a tool in the flange, (4, 4), mm; without a name, that of the cell's only tool.
    #[pyo3(signature = (name = None))]
    fn tool<'py>(&self, py: Python<'py>, name: Option<&str>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let tool = tool_of(self.file.cell(), name).or_raise(py)?;
        shaped(py, pose_matrix(&tool.flange_from_tcp).as_flattened().to_vec(), [4, 4])
    }

    /// Names of the mechanical units in addition to the robot.
    #[getter]
    fn units(&self) -> Vec<&str> {
        self.file.cell().units.all().iter().map(|unit| &*unit.name).collect()
    }

    #[pyo3(signature = (q, forces = None, *, tool = None, wobj = None, units = None, travel = None, velocity = None,
                        time_s = None, temperature_c = None, cut_m = None))]
    #[allow(clippy::needless_pass_by_value, clippy::too_many_arguments)] // as PyO3 extracts them, and Python names them
    /// The actual TCP poses of the loaded arm, (N, 4, 4), mm; NaN if there is no equilibrium.
    ///
    /// `q` (N, 6), commanded axis angles, degrees; `forces` (N, 3) on the tool at the TCP, N. Both forces and poses are in the axes
    /// of the robot's base, or of the work object `wobj`. `units` has the positions of mechanical units by the unit's name, (N,) or one
    /// for all, mm or degrees. Effects may need more, each an (N, …) array or one row or value for all: `travel`
    /// (N, 6), how each axis moved into the pose (only the signs matter); `velocity` (N, 3) of the TCP, mm/s; `time_s`, `temperature_c` and
    /// `cut_m`, the length cut (N,). Raises `DeflexError` if a needed value is missing, or a unit is beyond its limits.
    ///
    /// >>> import deflex, numpy
    /// >>> cell = deflex.Cell.read("samples/slot/cell.toml")
    /// >>> q = [[0, 20, 10, 0, 60, 0]]
    /// >>> free, loaded = cell.predict_poses(q), cell.predict_poses(q, [[0, 0, 500]])
    /// >>> bool(0.05 < numpy.linalg.norm((loaded - free)[0, :3, 3]) < 5.0)
    /// True
    fn predict_poses<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        forces: Option<Rows<'py>>,
        tool: Option<&str>,
        wobj: Option<&str>,
        units: Option<Bound<'py, PyDict>>,
        travel: Option<Rows<'py>>,
        velocity: Option<Rows<'py>>,
        time_s: Option<Bound<'py, PyAny>>,
        temperature_c: Option<Bound<'py, PyAny>>,
        cut_m: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let q = rows::<6>("q", &q)?;
        let travel = travel.map(|travel| rows_for::<6>("travel", &travel, q.len())).transpose()?;
        let velocity = velocity.map(|velocity| rows_for::<3>("velocity", &velocity, q.len())).transpose()?;
        let values = |values: Option<Bound<'py, PyAny>>| values.map(|values| column(&values, q.len())).transpose();
        let (time_s, temperature_c, cut_m) = (values(time_s)?, values(temperature_c)?, values(cut_m)?);
        let state = ArmState {
            travel: travel.as_deref(),
            velocity_mm_s: velocity.as_deref(),
            time_s: time_s.as_deref(),
            temperature_c: temperature_c.as_deref(),
            cut_m: cut_m.as_deref(),
        };
        let forces = match forces {
            Some(forces) => rows::<3>("forces", &forces)?,
            None => vec![[0.0; 3]; q.len()],
        };
        if forces.len() != q.len() {
            let message = format!("forces has {} rows and q has {}: expected as many", forces.len(), q.len());
            return Err(PyValueError::new_err(message));
        }
        let tool = tool_of(self.file.cell(), tool).or_raise(py)?;
        let count = q.len();
        let units: Vec<(String, Vec<f64>)> = match &units {
            Some(units) => {
                units.iter().map(|(name, at)| Ok((name.extract()?, column(&at, count)?))).collect::<PyResult<_>>()?
            }
            None => Vec::new(),
        };
        let units: Vec<(&str, &[f64])> = units.iter().map(|(name, at)| (&**name, &**at)).collect();
        let external = external_of(self.file.cell(), &units, count).or_raise(py)?;
        let standing = Standing { wobj, external: &external, state };
        let found =
            work::detached(py, || predict_poses(self.file.cell(), &tool, &q, &forces, standing)).or_raise(py)?;
        let poses: Vec<PoseMatrix> = work::detached(py, || {
            found.into_iter().map(|pose| pose.map_or([[f64::NAN; 4]; 4], |pose| pose_matrix(&pose))).collect()
        });
        shaped(py, poses.into_flattened().into_flattened(), [count, 4, 4])
    }

    fn __repr__(&self) -> String {
        let cell = self.file.cell();
        let kinds: Vec<&str> = cell.arm.effects.iter().map(|effect| effect.kind()).collect();
        let effects = if kinds.is_empty() { "no effects".to_owned() } else { kinds.join(", ") };
        format!("Cell({:?}, {}: {effects})", self.name(), cell.arm.robot.model)
    }
}

/// The parts of a robot, which `pickle` passes to another process: its model, and the cell that describes it.
#[pyfunction]
pub(crate) fn robot_parts(robot: &Robot) -> (&str, Option<Cell>) {
    (robot.model(), robot.cell.clone().map(|file| Cell { file }))
}
