use crate::arrays::{Matrices, Rows, matrices, rows, shaped};
use crate::work;
use deflex::cutting::{Coefficients, Cutter, Engagement, Mode, materials, mean_forces};
use deflex::robot::{self, BUILTIN, Builtin, Joints, Pose, Unreachable, pose_of_matrix};
use deflex::session::CellFile;
use numpy::{PyArray2, PyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// An arm as its controller knows it.
#[pyclass(frozen, module = "deflex")]
pub(crate) struct Robot {
    robot: robot::Robot,
    stiffness: Option<Joints>,
    start_deg: [f64; 6],
    /// The cell that describes it; a built-in robot has none.
    pub(crate) cell: Option<Arc<CellFile>>,
}

impl Robot {
    pub(crate) fn of(cell: &Arc<CellFile>) -> Self {
        let arm = &cell.cell().arm;
        let (robot, start_deg) = (arm.robot.clone(), arm.robot.home_deg());
        Self { robot, stiffness: arm.stiffness, start_deg, cell: Some(Arc::clone(cell)) }
    }
}

/// The frame whose pose is computed, in the flange; the flange itself if none is given.
fn frame(matrix: Option<&Rows<'_>>) -> PyResult<Pose> {
    let Some(matrix) = matrix else { return Ok(Pose::identity()) };
    let found = rows::<4>("tool", matrix)?;
    let pose = <&[[f64; 4]; 4]>::try_from(&found[..]).ok().and_then(pose_of_matrix);
    pose.ok_or_else(|| PyValueError::new_err("tool is no pose: expected a 4 by 4 homogeneous matrix in mm"))
}

#[pymethods]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
impl Robot {
    #[new]
    #[pyo3(signature = (model))]
    fn new(model: &str) -> PyResult<Self> {
        let unknown = |near: Vec<&Builtin>| {
            let meant = near.first().map_or_else(String::new, |near| format!(", did you mean {:?}?", near.model));
            PyValueError::new_err(format!("{model:?} is no built-in robot{meant}"))
        };
        let robot = Builtin::named(model).map_err(unknown)?.robot();
        Ok(Self { start_deg: robot.home_deg(), robot, stiffness: None, cell: None })
    }

    /// The models of the built-in robots.
    #[staticmethod]
    fn builtin() -> Vec<&'static str> {
        BUILTIN.iter().map(|builtin| &*builtin.model).collect()
    }

    /// Name.
    #[getter]
    pub(crate) fn model(&self) -> &str {
        &self.robot.model
    }

    /// Poses in the base, (N, 4, 4), mm, at axis angles `q` (N, 6), degrees.
    ///
    /// >>> import deflex
    /// >>> robot = deflex.Robot("irb6660-205-1.9")
    /// >>> robot.forward([[0, 0, 0, 0, 30, 0]]).shape
    /// (1, 4, 4)
    #[pyo3(signature = (q, *, tool = None))]
    fn forward<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        tool: Option<Rows<'py>>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (q, tool) = (rows::<6>("q", &q)?, frame(tool.as_ref())?);
        let count = q.len();
        let poses = work::detached(py, || self.robot.forward_table(&q, &tool));
        shaped(py, poses.into_flattened().into_flattened(), [count, 4, 4])
    }

    /// Axis angles (N, 6), degrees, that reach poses (N, 4, 4), mm, in the base; NaN if none do.
    ///
    /// `near` (N, 6) chooses the nearest solution for each pose. With `near` (1, 6), the poses are a path that starts there, and each
    /// solution is the nearest to the previous one.
    ///
    /// >>> import deflex, numpy
    /// >>> robot = deflex.Robot("irb6660-205-1.9")
    /// >>> q = [[10.0, 20.0, -5.0, 30.0, 40.0, -50.0]]
    /// >>> bool(numpy.allclose(robot.inverse(robot.forward(q), near=q), q, atol=1e-9))
    /// True
    #[pyo3(signature = (poses, near = None, *, tool = None))]
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        poses: Matrices<'py>,
        near: Option<Rows<'py>>,
        tool: Option<Rows<'py>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (matrices, tool) = (matrices("poses", &poses)?, frame(tool.as_ref())?);
        let near = near.map(|near| rows::<6>("near", &near)).transpose()?.unwrap_or_else(|| vec![self.start_deg]);
        let count = matrices.len();
        if near.len() != 1 && near.len() != count {
            let message = format!("near has {} rows, expected 1 or as many as poses: {count}", near.len());
            return Err(PyValueError::new_err(message));
        }
        let found = work::detached(py, || {
            let poses: Vec<Option<Pose>> = matrices.iter().map(pose_of_matrix).collect();
            if let Some(wrong) = poses.iter().position(Option::is_none) {
                return Err(wrong);
            }
            let poses: Vec<Pose> = poses.into_iter().flatten().collect();
            let found = match &near[..] {
                [start] => self.robot.inverse_path(&poses, &tool, start),
                _ => self.robot.inverse_table(&poses, &tool, &near),
            };
            let row = |found: Result<[f64; 6], Unreachable>| found.unwrap_or([f64::NAN; 6]);
            Ok(found.into_iter().map(row).collect::<Vec<_>>())
        });
        let found = found.map_err(|i| {
            PyValueError::new_err(format!("poses[{i}] is no pose: expected a 4 by 4 homogeneous matrix in mm"))
        })?;
        shaped(py, found.into_flattened(), [count, 6])
    }

    /// Jacobians (N, 6, 6): (vx, vy, vz) mm/rad, (wx, wy, wz) rad/rad, base axes, by motor angle.
    #[pyo3(signature = (q, *, tool = None))]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        tool: Option<Rows<'py>>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (q, tool) = (rows::<6>("q", &q)?, frame(tool.as_ref())?);
        let count = q.len();
        let found = work::detached(py, || self.robot.jacobian_table(&q, &tool));
        shaped(py, found.into_flattened().into_flattened(), [count, 6, 6])
    }

    /// Cartesian stiffness (N, 6, 6): force (N) and moment (N mm) for a displacement (mm) and a turn (rad).
    #[pyo3(signature = (q, *, tool = None, joint_nm_per_rad = None))]
    fn stiffness<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        tool: Option<Rows<'py>>,
        joint_nm_per_rad: Option<[f64; 6]>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (q, tool) = (rows::<6>("q", &q)?, frame(tool.as_ref())?);
        let Some(springs) = joint_nm_per_rad.map(Joints::from).or(self.stiffness) else {
            return Err(PyValueError::new_err("the joints' stiffness is not known: give joint_nm_per_rad"));
        };
        let count = q.len();
        let found = work::detached(py, || self.robot.stiffness_table(&q, &tool, &springs));
        shaped(py, found.into_flattened().into_flattened(), [count, 6, 6])
    }

    fn __repr__(&self) -> String {
        format!("Robot({:?})", self.robot.model)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.robot.model == other.robot.model && self.cell == other.cell
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        (&self.robot.model, &self.cell).hash(&mut hasher);
        hasher.finish()
    }
}

/// Mean cutting force; a row of `engagements` is depth, width, feed per tooth (mm), lead and tilt (degrees).
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // as PyO3 extracts them
pub(crate) fn cutting_force<'py>(
    py: Python<'py>,
    mode: &str,
    cutter: (f64, f64, u32, f64),
    material: Option<&str>,
    coefficients: Option<[f64; 6]>,
    engagements: Rows<'py>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let wrong = |message: String| Err(PyValueError::new_err(message));
    let mode = match mode {
        "slot" => Mode::Slot,
        "up" => Mode::Up,
        "down" => Mode::Down,
        _ => return wrong(format!("mode is {mode:?}, expected \"slot\", \"up\" or \"down\"")),
    };
    let coefficients = match (material, coefficients) {
        (None, Some([ktc, krc, kac, kte, kre, kae])) => {
            // N/mm² and N/mm in tables.
            let (area, edge) = (1e6, 1e3);
            Coefficients {
                ktc: ktc * area,
                krc: krc * area,
                kac: kac * area,
                kte: kte * edge,
                kre: kre * edge,
                kae: kae * edge,
            }
        }
        (Some(name), None) => match materials::find(name) {
            Some(material) => material.coefficients,
            None => return wrong(format!("{name:?} is no material that deflex knows")),
        },
        _ => return wrong("give either material or the six coefficients".to_owned()),
    };
    let (diameter_mm, corner_radius_mm, teeth, helix_deg) = cutter;
    let cutter = Cutter {
        diameter: 1e-3 * diameter_mm,
        corner_radius: 1e-3 * corner_radius_mm,
        teeth,
        helix: helix_deg.to_radians(),
    };
    let row = |[depth, width, feed_per_tooth, lead, tilt]: [f64; 5]| Engagement {
        mode,
        depth: 1e-3 * depth,
        width: 1e-3 * width,
        feed_per_tooth: 1e-3 * feed_per_tooth,
        lead: lead.to_radians(),
        tilt: tilt.to_radians(),
    };
    let all: Vec<Engagement> = rows::<5>("engagements", &engagements)?.into_iter().map(row).collect();
    let found = work::detached(py, || mean_forces(cutter, &all, coefficients));
    let forces = found.map_err(|(i, error)| PyValueError::new_err(format!("engagement {i}: {error}")))?;
    let numbers: Vec<f64> = forces.iter().flat_map(|force| [force.x, force.y, force.z]).collect();
    shaped(py, numbers, [all.len(), 3])
}
