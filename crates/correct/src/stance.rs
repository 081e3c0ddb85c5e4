//! The posture of the arm at a target, for pictures and for charts of its margins.

use super::Prepared;
use super::collected::points_of;
use super::context::Context;
use super::row::{Row, Stance};
use super::segment::Kind;
use deflex_cell::Cell;
use deflex_robot::{EXTERNAL_AXES, Pose};
use std::sync::Arc;

/// Fills `stance`.
pub(super) fn fill(rows: &mut [Row], Context { program, cell, .. }: Context<'_>, prepared: &Prepared) {
    let at = points_of(rows, program);
    for (row, at) in rows.iter_mut().zip(at) {
        row.stance = at.and_then(|i| stance(cell, prepared, i, Kind::of(program, i))).map(Arc::new);
    }
}

fn stance(cell: &Cell, prepared: &Prepared, i: usize, kind: Kind) -> Option<Stance> {
    let (robot, point) = (&cell.arm.robot, &prepared.points[i]);
    if point.unsolved.is_some() {
        return None;
    }
    let wobj_from_base = prepared.base_from_wobj(i).inverse();
    let table = prepared.mount(i).wobj_from_unit().map(|unit| {
        let axis = unit.rotation.matrix().column(2).into_owned();
        six(&(unit.translation.vector * 1e3), &axis)
    });
    let wrist = robot.serial_from_motor(&point.motor)[4];
    Some(Stance {
        axes_deg: robot.axes_deg_from_motor(&point.motor),
        limit_margin_deg: robot.limit_margin(&point.motor).to_degrees(),
        singular_margin_deg: wrist.sin().abs().asin().to_degrees(),
        base: millimetres_and_degrees(&wobj_from_base),
        external: prepared.external(i).copied().unwrap_or([f64::NAN; EXTERNAL_AXES]),
        table,
        circle_point: (kind == Kind::Arc)
            .then(|| (1e3 * prepared.points[i - 1].wobj_from_tcp.translation.vector).into()),
    })
}

/// Position, mm, and rotation vector, degrees.
#[doc(hidden)]
pub fn millimetres_and_degrees(pose: &Pose) -> [f64; 6] {
    // Through the quaternion: the matrix loses digits near the identity and near half a turn.
    let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation).scaled_axis();
    six(&(pose.translation.vector * 1e3), &turn.map(f64::to_degrees))
}

fn six(a: &nalgebra::Vector3<f64>, b: &nalgebra::Vector3<f64>) -> [f64; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}
