//! An arm of its own, and dense walks of its tip over programs of lines and arcs.
//!
//! Modified DH by matrices, inverse kinematics by Newton on a numeric Jacobian, springs by a fixed point. The force is constant in
//! the frame of the programmed path's direction and the tool axis.

use nalgebra::{Matrix4, Matrix6, Quaternion, Rotation3, UnitQuaternion, Vector3, Vector6};
use std::f64::consts::{FRAC_PI_2, PI};

/// alpha, a (mm), d (mm), theta.
const LINKS: [[f64; 4]; 6] = [
    [0.0, 0.0, 780.0, 0.0],
    [-FRAC_PI_2, 320.0, 0.0, -FRAC_PI_2],
    [0.0, 1075.0, 0.0, 0.0],
    [-FRAC_PI_2, 200.0, 1142.5, 0.0],
    [FRAC_PI_2, 0.0, 0.0, 0.0],
    [-FRAC_PI_2, 0.0, 200.0, PI],
];
/// N·mm/rad
const STIFFNESS: [f64; 6] = [8.86e8, 5.5e8, 1.85e9, 3.3e8, 2.1e8, 0.881e8];
/// Force in the feed frame: along the feed, across it, along the normal, N.
const FORCE: [f64; 3] = [-35.0, 95.0, 85.0];
/// Origin of the work object of the programs in the base of the arm, mm.
pub const WOBJ: [f64; 3] = [1350.0, -250.0, 620.0];
/// Distance of the tip from the flange along its axis, mm.
pub const TOOL_LENGTH: f64 = 260.0;

type Pose = (Vector3<f64>, UnitQuaternion<f64>);

/// One motion of a program: a line, or an arc through a point.
#[derive(Clone, Copy, Debug)]
struct Move {
    via: Option<Pose>,
    to: Pose,
}

fn matrix((p, q): &Pose) -> Matrix4<f64> {
    let mut m = q.to_homogeneous();
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(p);
    m
}

fn forward(joints: &Vector6<f64>) -> Matrix4<f64> {
    let mut pose = Matrix4::<f64>::identity();
    for (i, [alpha, a, d, theta]) in LINKS.into_iter().enumerate() {
        let (sa, ca) = alpha.sin_cos();
        let (st, ct) = (theta + joints[i]).sin_cos();
        pose *= Matrix4::new(
            ct,
            -st,
            0.0,
            a,
            st * ca,
            ct * ca,
            -sa,
            -sa * d,
            st * sa,
            ct * sa,
            ca,
            ca * d,
            0.0,
            0.0,
            0.0,
            1.0,
        );
    }
    pose * Matrix4::new_translation(&Vector3::new(0.0, 0.0, TOOL_LENGTH))
}

/// Translation (mm) and rotation vector from one pose to another.
fn gap(from: &Matrix4<f64>, to: &Matrix4<f64>) -> Vector6<f64> {
    let rotation = |m: &Matrix4<f64>| Rotation3::from_matrix_unchecked(m.fixed_view::<3, 3>(0, 0).into_owned());
    let turn = UnitQuaternion::from_rotation_matrix(&(rotation(to) * rotation(from).inverse())).scaled_axis();
    let shift = to.fixed_view::<3, 1>(0, 3) - from.fixed_view::<3, 1>(0, 3);
    Vector6::new(shift[0], shift[1], shift[2], turn[0], turn[1], turn[2])
}

fn jacobian(joints: &Vector6<f64>) -> Matrix6<f64> {
    const STEP: f64 = 1e-6;
    let mut out = Matrix6::zeros();
    for i in 0..6 {
        let step = Vector6::ith(i, STEP);
        out.set_column(i, &(gap(&forward(&(joints - step)), &forward(&(joints + step))) / (2.0 * STEP)));
    }
    out
}

fn inverse(wanted: &Matrix4<f64>, near: &Vector6<f64>) -> Vector6<f64> {
    let mut joints = *near;
    // Newton with the Jacobian of where it begins: a step away.
    let jacobian = jacobian(near).lu();
    for _ in 0..50 {
        let left = gap(&forward(&joints), wanted);
        if left.norm() < 1e-7 {
            break;
        }
        joints += jacobian.solve(&left).expect("regular");
    }
    joints
}

/// Where the tip of a commanded arm ends up under a force on it (base axes, N), mm.
fn tip(commanded: &Vector6<f64>, force: &Vector3<f64>) -> Vector3<f64> {
    let mut joints = *commanded;
    // A round gains three digits.
    for _ in 0..3 {
        let torque = jacobian(&joints).fixed_rows::<3>(0).transpose() * force;
        joints = Vector6::from_fn(|i, _| commanded[i] + torque[i] / STIFFNESS[i]);
    }
    forward(&joints).fixed_view::<3, 1>(0, 3).into_owned()
}

/// Place and direction at a share of a move.
fn along(from: &Pose, to: &Move, share: f64) -> (Pose, Vector3<f64>) {
    let turned = |a: &Pose, b: &Pose, t: f64| a.1.slerp(&b.1, t);
    let Some(via) = to.via else {
        return ((from.0.lerp(&to.to.0, share), turned(from, &to.to, share)), (to.to.0 - from.0).normalize());
    };
    let (ab, ac) = (via.0 - from.0, to.to.0 - from.0);
    let n = ab.cross(&ac);
    let centre =
        from.0 + (ac.norm_squared() * n.cross(&ab) + ab.norm_squared() * ac.cross(&n)) / (2.0 * n.norm_squared());
    let axis = nalgebra::Unit::new_normalize(n);
    let angle = |p: &Vector3<f64>| {
        let (a, b) = (from.0 - centre, p - centre);
        a.cross(&b).dot(&axis).atan2(a.dot(&b)).rem_euclid(2.0 * PI)
    };
    let whole = angle(&to.to.0);
    let out = Rotation3::from_axis_angle(&axis, share * whole) * (from.0 - centre);
    // The path turns the tool, which also turns evenly by what is left: the way round that passes the orientation of the circle point nearer.
    let by_path = |angle: f64| UnitQuaternion::from_axis_angle(&axis, angle);
    let left = (by_path(-whole) * to.to.1 * from.1.inverse()).scaled_axis();
    let there =
        |own: Vector3<f64>, share: f64| by_path(share * whole) * UnitQuaternion::from_scaled_axis(own * share) * from.1;
    let off = |own: &Vector3<f64>| there(*own, angle(&via.0) / whole).angle_to(&via.1);
    let other = if left.norm() > 0.0 { left - left.normalize() * (2.0 * PI) } else { left };
    let own = if off(&other) < off(&left) { other } else { left };
    ((centre + out, there(own, share)), axis.cross(&out).normalize())
}

fn length(from: &Pose, to: &Move) -> f64 {
    const PARTS: usize = 64;
    let at = |k: usize| along(from, to, k as f64 / PARTS as f64).0.0;
    (0..PARTS).map(|k| (at(k + 1) - at(k)).norm()).sum()
}

/// The numbers of every motion of a program, read by brackets alone.
fn moves(text: &str) -> Vec<Move> {
    let number = |text: &str| text.trim().parse::<f64>().expect("a number");
    let pose = |text: &str| {
        let groups: Vec<Vec<f64>> = text
            .split('[')
            .filter(|group| group.contains(']'))
            .take(2)
            .map(|group| group.split(']').next().expect("one").split(',').map(number).collect())
            .collect();
        let q = &groups[1];
        let q = UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
        (Vector3::from_column_slice(&groups[0]), q)
    };
    text.lines()
        .filter_map(|line| {
            let (kind, rest) = line.trim().split_once(' ')?;
            let mut targets = rest.split("[[").skip(1);
            match kind {
                "MoveL" | "MoveJ" => Some(Move { via: None, to: pose(targets.next()?) }),
                "MoveC" => Some(Move { via: Some(pose(targets.next()?)), to: pose(targets.next()?) }),
                _ => None,
            }
        })
        .collect()
}

/// The way into the second motion of a program.
#[derive(Debug)]
pub struct Way {
    /// Joint angles at even shares of the way, from 0 to 1, rad.
    pub joints: Vec<Vector6<f64>>,
    /// mm
    pub length: f64,
}

/// Follows the way into the second motion of a program in so many steps.
pub fn followed(text: &str, steps: usize) -> Way {
    let moves = moves(text);
    let base = |(place, orientation): Pose| matrix(&(place + Vector3::from(WOBJ), orientation));
    // From where the cell starts, in small steps on one branch.
    let mut joints = Vector6::from([0.0, 0.0, 0.0, 0.0, 60_f64.to_radians(), 0.0]);
    let at_home = forward(&joints);
    let place = at_home.fixed_view::<3, 1>(0, 3).into_owned() - Vector3::from(WOBJ);
    let rotation = Rotation3::from_matrix_unchecked(at_home.fixed_view::<3, 3>(0, 0).into_owned());
    let home = (place, UnitQuaternion::from_rotation_matrix(&rotation));
    let first = Move { via: None, to: moves[0].to };
    let mut go = |from: &Pose, to: &Move, share: f64| {
        joints = inverse(&base(along(from, to, share).0), &joints);
        joints
    };
    const APPROACH_STEPS: i32 = 100;
    for k in 1..=APPROACH_STEPS {
        go(&home, &first, f64::from(k) / f64::from(APPROACH_STEPS));
    }
    let joints = (0..=steps).map(|k| go(&moves[0].to, &moves[1], k as f64 / steps as f64)).collect();
    Way { joints, length: length(&moves[0].to, &moves[1]) }
}

/// Contour errors of a dense walk, mm, each with the length that it stands for.
#[derive(Debug)]
pub struct Walk(Vec<(f64, f64)>);

impl Walk {
    /// The walk over the text of a `written` program against the path of the `programmed` one.
    pub fn of(written: &str, programmed: &str) -> Self {
        /// mm
        const STEP: f64 = 2.0;
        let base = |p: &Vector3<f64>| p + Vector3::from(WOBJ);
        // The programmed path, finely: place, direction, orientation.
        let mut path: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
        for pair in moves(programmed).windows(2) {
            let parts = (length(&pair[0].to, &pair[1]) / 0.02).ceil() as usize;
            for k in 0..=parts {
                let ((place, _), direction) = along(&pair[0].to, &pair[1], k as f64 / parts as f64);
                path.push((place, direction));
            }
        }
        let mut joints = Vector6::from([0.0, 0.0, 0.0, 0.0, 60_f64.to_radians(), 0.0]);
        let (mut at, mut out) = (0, Vec::new());
        for pair in moves(written).windows(2) {
            let size = length(&pair[0].to, &pair[1]);
            let parts = (size / STEP).ceil().max(2.0) as usize;
            for k in 0..parts {
                let ((place, orientation), _) = along(&pair[0].to, &pair[1], (k as f64 + 0.5) / parts as f64);
                joints = inverse(&matrix(&(base(&place), orientation)), &joints);
                // The nearest place of the path, not going back and not far ahead.
                let nearest = |p: &Vector3<f64>, from: usize| {
                    let ahead = path[from..path.len().min(from + 150)].iter().enumerate();
                    let best = ahead.min_by(|a, b| (a.1.0 - p).norm().total_cmp(&(b.1.0 - p).norm())).expect("a path");
                    from + best.0
                };
                at = nearest(&place, at);
                // The normal is the tool axis, the feed what is seen along it.
                let (z, x) = (orientation * -Vector3::z(), path[at].1);
                let x = (x - z * z.dot(&x)).normalize();
                let force = x * FORCE[0] + z.cross(&x) * FORCE[1] + z * FORCE[2];
                let tip = tip(&joints, &force) - Vector3::from(WOBJ);
                let there = nearest(&tip, at.saturating_sub(75));
                let (place, direction) = path[there];
                let off = tip - place;
                out.push(((off - direction * direction.dot(&off)).norm(), size / parts as f64));
            }
        }
        Self(out)
    }

    /// Root mean square over the length, mm.
    pub fn rms(&self) -> f64 {
        let (squares, length) = self.0.iter().fold((0.0, 0.0), |(s, l), (e, w)| (s + e * e * w, l + w));
        (squares / length).sqrt()
    }

    /// What is not passed on 95 % of the length, mm.
    pub fn most(&self) -> f64 {
        let mut all = self.0.clone();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (total, mut sum) = (all.iter().map(|e| e.1).sum::<f64>(), 0.0);
        all.iter()
            .find(|e| {
                sum += e.1;
                sum >= 0.95 * total
            })
            .map_or(0.0, |e| e.0)
    }
}
