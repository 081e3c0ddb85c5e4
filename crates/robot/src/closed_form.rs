//! The explicit inverse of arms with a spherical wrist and parallel axes 2 and 3.

use super::links::DhRow;
use super::{Joints, Pose};
use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// One of the eight solutions of the explicit inverse, by its three signs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[doc(hidden)]
pub struct Branch {
    /// Wrist centre behind axis 1.
    pub rear: bool,
    /// Wrist centre behind the lower arm.
    pub behind: bool,
    /// Axis 5 negative.
    pub flipped: bool,
}

impl Branch {
    /// All eight, in the order of cfx.
    pub(crate) const ALL: [Self; 8] = {
        let mut all = [Self { rear: false, behind: false, flipped: false }; 8];
        let mut i = 0;
        while i < 8 {
            all[i] = Self { rear: i & 4 != 0, behind: i & 2 != 0, flipped: i & 1 != 0 };
            i += 1;
        }
        all
    };

    /// cfx of RAPID confdata: also the index into [`Branch::ALL`].
    #[must_use]
    pub fn cfx(self) -> usize {
        4 * usize::from(self.rear) + 2 * usize::from(self.behind) + usize::from(self.flipped)
    }
}

/// Motor angles of each branch (index: [`Branch::cfx`]), rad, within ±π; `None` if the branch does not reach the pose.
pub(crate) type Solutions = [Option<Joints>; 8];

/// Below this |sin q5| the wrist is singular: axes 4 and 6 are parallel, and q4 keeps its value. With q4 kept, the
/// orientation is missed by at most this angle, which moves a point at a distance of 0.3 m by 0.03 µm, far less than a
/// printed digit.
const SINGULAR_WRIST: f64 = 1e-7;

/// Angles (rad) and lengths (m) that differ by less than this from a special value are taken to be that value. Cells
/// declare them to 1e-9 at best.
const SAME: f64 = 1e-9;

/// The explicit inverse of an arm with parallel axes 2 and 3 and a spherical wrist.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClosedForm {
    pub(super) a1: f64,
    pub(super) a2: f64,
    pub(super) d1: f64,
    /// Lateral offset of the arm plane from axis 1.
    pub(super) b: f64,
    /// Length of the forearm from elbow to wrist centre.
    pub(super) l3: f64,
    /// Angle between the forearm and x of link 3.
    pub(super) gamma: f64,
    pub(super) sin_gamma: f64,
    pub(super) cos_gamma: f64,
    pub(super) d6: f64,
    pub(super) theta: [f64; 6],
}

impl ClosedForm {
    /// The explicit inverse for these rows; `None` if they have none.
    pub(super) fn of(rows: &[DhRow; 6]) -> Option<Self> {
        const TWISTS: [f64; 6] = [0.0, -FRAC_PI_2, 0.0, -FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2];
        let same = |a: f64, b: f64| (a - b).abs() < SAME;
        let twists = rows.iter().zip(TWISTS).all(|(row, twist)| same(row.alpha, twist));
        let wrist = same(rows[0].a, 0.0) && same(rows[4].a, 0.0) && same(rows[5].a, 0.0) && same(rows[4].d, 0.0);
        let (a3, d4) = (rows[3].a, rows[3].d);
        (twists && wrist && rows[2].a > 0.0 && a3.hypot(d4) > 0.0).then(|| Self {
            a1: rows[1].a,
            a2: rows[2].a,
            d1: rows[0].d,
            b: rows[1].d + rows[2].d,
            l3: a3.hypot(d4),
            gamma: d4.atan2(a3),
            sin_gamma: d4 / d4.hypot(a3),
            cos_gamma: a3 / d4.hypot(a3),
            d6: rows[5].d,
            theta: rows.map(|row| row.theta),
        })
    }

    /// [`Robot::posture`] at serial joint angles, rad.
    pub(super) fn posture(&self, serial: &Joints) -> (bool, bool) {
        let (upper, elbow) = (serial[1] + self.theta[1], serial[2] + self.theta[2] + self.gamma);
        let ahead = self.a1 + self.a2 * upper.cos() + self.l3 * (upper + elbow).cos();
        (ahead < 0.0, wrap(elbow) < 0.0)
    }

    /// All branches as serial joint angles. A singular wrist keeps `q4` (rad). If no branch reaches the pose, the error
    /// is the distance of the wrist centre from the reach of the arm, m.
    pub(super) fn solve(&self, base_from_flange: &Pose, q4: f64) -> Result<Solutions, f64> {
        let flange = base_from_flange.rotation.matrix();
        let wrist = base_from_flange.translation.vector - flange.column(2) * self.d6;
        let mut solutions = [None; 8];
        let mut out_of_reach = f64::INFINITY;
        let planar = wrist.x * wrist.x + wrist.y * wrist.y - self.b * self.b;
        if planar < 0.0 {
            return Err(self.b.abs() - wrist.x.hypot(wrist.y));
        }
        for rear in [false, true] {
            let forward = if rear { -planar.sqrt() } else { planar.sqrt() };
            let theta1 = self.theta1(&wrist, forward);
            let (r, s) = (forward - self.a1, wrist.z - self.d1);
            let rho = r.hypot(s);
            let cosine = (rho * rho + self.a2 * self.a2 - self.l3 * self.l3) / (2.0 * self.a2 * rho);
            if !(-1.0..=1.0).contains(&cosine) {
                let by = (rho - (self.a2 + self.l3)).max((self.a2 - self.l3).abs() - rho);
                out_of_reach = out_of_reach.min(by.max(0.0));
                continue;
            }
            for behind in [false, true] {
                let lift = if behind { -cosine.acos() } else { cosine.acos() };
                let (e2, e3) = self.elevations(r, s, lift);
                let wrist = Wrist::new(flange, theta1, e3);
                for flipped in [false, true] {
                    let serial = self.serial(theta1, e2, e3, wrist.angles(flipped, q4 + self.theta[3]));
                    solutions[Branch { rear, behind, flipped }.cfx()] = Some(serial);
                }
            }
        }
        if solutions.iter().all(Option::is_none) { Err(out_of_reach) } else { Ok(solutions) }
    }

    /// Distance of the wrist centre from the reach of the arm that points forward, or to the rear, m.
    pub(super) fn out_of_reach(&self, base_from_flange: &Pose, rear: bool) -> f64 {
        let wrist = base_from_flange.translation.vector - base_from_flange.rotation.matrix().column(2) * self.d6;
        let planar = (wrist.x * wrist.x + wrist.y * wrist.y - self.b * self.b).max(0.0).sqrt();
        let rho = (if rear { -planar } else { planar } - self.a1).hypot(wrist.z - self.d1);
        (rho - (self.a2 + self.l3)).max((self.a2 - self.l3).abs() - rho).max(0.0)
    }

    fn theta1(&self, wrist: &Vector3<f64>, forward: f64) -> f64 {
        wrist.y.atan2(wrist.x) - self.b.atan2(forward)
    }

    /// Elevations of lower arm and link 3 for a wrist centre at (r, s) from the shoulder.
    fn elevations(&self, r: f64, s: f64, lift: f64) -> (f64, f64) {
        let e2 = s.atan2(r) + lift;
        let (sin, cos) = e2.sin_cos();
        let forearm = (s - self.a2 * sin).atan2(r - self.a2 * cos);
        (e2, forearm + self.gamma)
    }

    fn serial(&self, theta1: f64, e2: f64, e3: f64, [theta4, theta5, theta6]: [f64; 3]) -> Joints {
        let theta = [theta1, -e2, e2 - e3, theta4, theta5, theta6];
        Vector6::from_fn(|i, _| theta[i] - self.theta[i])
    }

    /// The solution in the branch of the serial angles `near`, equal to that of [`ClosedForm::solve`], and the distance
    /// (rad) from them up to which it is certainly nearer than any other; `None` where branches meet.
    pub(super) fn branch_of(&self, base_from_flange: &Pose, near: &Joints) -> Option<(Joints, f64)> {
        let flange = base_from_flange.rotation.matrix();
        let wrist = base_from_flange.translation.vector - flange.column(2) * self.d6;
        let planar = wrist.x * wrist.x + wrist.y * wrist.y - self.b * self.b;
        // Here the solutions in front and to the rear can differ by less than a quarter turn of axis 1.
        if planar <= self.b * self.b {
            return None;
        }
        let dh = near + Vector6::from(self.theta);
        let front = self.theta1(&wrist, planar.sqrt());
        let rear = wrap(dh[0] - front).abs() > FRAC_PI_2;
        let forward = if rear { -planar.sqrt() } else { planar.sqrt() };
        let theta1 = if rear { self.theta1(&wrist, forward) } else { front };
        let (r, s) = (forward - self.a1, wrist.z - self.d1);
        let rho = r.hypot(s);
        let cosine = (rho * rho + self.a2 * self.a2 - self.l3 * self.l3) / (2.0 * self.a2 * rho);
        if !(-1.0..=1.0).contains(&cosine) {
            return None;
        }
        let lift = cosine.acos();
        // The wrist centre is behind the lower arm, or in front of it.
        let behind = wrap(dh[2] + self.gamma) < 0.0;
        let (e2, e3) = self.elevations(r, s, if behind { -lift } else { lift });
        let wrist = Wrist::new(flange, theta1, e3);
        if wrist.sine < SINGULAR_WRIST {
            return None;
        }
        let serial = self.serial(theta1, e2, e3, wrist.angles(wrap(dh[4]) < 0.0, 0.0));
        // In other branches, axis 1 differs by a quarter turn at least, axis 2 by twice the lift, or axis 4 by half a
        // turn.
        Some((serial, lift.min(PI - lift).min(FRAC_PI_4)))
    }
}

/// The part of a pose that the wrist produces: `link3ᵀ · flange · Rx(90°) = Ry(θ4) Rz(θ5) Ry(θ6)`.
struct Wrist {
    turn: Matrix3<f64>,
    /// |sin θ5|.
    sine: f64,
}

impl Wrist {
    fn new(flange: &Matrix3<f64>, theta1: f64, e3: f64) -> Self {
        let (s1, c1) = theta1.sin_cos();
        let (se, ce) = e3.sin_cos();
        // Link 3 in the base frame: x points along the elevation e3 in the plane of the arm, z is perpendicular to this
        // plane.
        let link3 = Matrix3::new(c1 * ce, c1 * se, -s1, s1 * ce, s1 * se, c1, se, -ce, 0.0);
        let m = link3.transpose() * flange;
        let turn = Matrix3::from_columns(&[m.column(0).into_owned(), m.column(2).into_owned(), -m.column(1)]);
        Self { turn, sine: turn[(0, 1)].hypot(turn[(2, 1)]) }
    }

    /// DH angles of axes 4, 5 and 6. A singular wrist keeps `theta4`.
    fn angles(&self, flipped: bool, theta4: f64) -> [f64; 3] {
        let (m, sign) = (&self.turn, if flipped { -1.0 } else { 1.0 });
        let theta5 = (sign * self.sine).atan2(m[(1, 1)]);
        if self.sine < SINGULAR_WRIST {
            let rest = (Rotation3::from_axis_angle(&Vector3::y_axis(), theta4)
                * Rotation3::from_axis_angle(&Vector3::z_axis(), theta5))
            .inverse()
                * m;
            return [theta4, theta5, rest[(0, 2)].atan2(rest[(0, 0)])];
        }
        let theta4 = (sign * m[(2, 1)]).atan2(-sign * m[(0, 1)]);
        [theta4, theta5, (sign * m[(1, 2)]).atan2(sign * m[(1, 0)])]
    }
}

/// An angle reduced to ±π, rad.
#[doc(hidden)]
pub fn wrap(angle: f64) -> f64 {
    // Written without `round`, which is a function call on processors without that instruction.
    if angle.abs() < 3.0 { angle } else { angle - (angle / TAU).round() * TAU }
}
