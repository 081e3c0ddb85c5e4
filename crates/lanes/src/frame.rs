use super::real::{Mask, Real};
use super::trigonometry::{SinCos, horner};
use super::{Lanes, WIDTH};
use nalgebra::{Matrix3, Rotation3, Translation3, Vector3};
use std::ops::{Add, Mul, Neg, Sub};

/// A pose, metres: `base_from_tcp` maps coordinates in the TCP frame to the base frame.
pub type Pose = nalgebra::IsometryMatrix3<f64>;

/// A vector of one target, or of each of eight targets.
///
/// # Examples
/// ```
/// use deflex_lanes::{Lanes, Real, Vector};
/// use nalgebra::Vector3;
///
/// let (x, y) = (Vector::new(1.0, 0.0, 0.0), Vector::new(0.0, 1.0, 0.0));
/// assert_eq!((x.cross(y).z, x.dot(y)), (1.0, 0.0));
/// assert_eq!(y.scaled([2.0, 3.0, 4.0]).y, 3.0);
///
/// // Eight at once: the first one differs, and then each gets the vector of the lane before.
/// let mut eight = Vector::<Lanes>::of(&Vector3::y());
/// eight.set(0, &Vector3::z());
/// assert_eq!(eight.shifted(&Vector3::x()).lane(1), Vector3::z());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Vector<R = Lanes> {
    /// Component along x.
    pub x: R,
    /// Component along y.
    pub y: R,
    /// Component along z.
    pub z: R,
}

impl<R: Real> Vector<R> {
    /// The vector of length zero.
    pub const ZERO: Self = Self { x: R::ZERO, y: R::ZERO, z: R::ZERO };

    /// The vector with these components.
    #[inline(always)]
    pub fn new(x: R, y: R, z: R) -> Self {
        Self { x, y, z }
    }

    /// The same vector in every lane.
    #[inline(always)]
    pub fn of(vector: &Vector3<f64>) -> Self {
        Self::new(R::of(vector.x), R::of(vector.y), R::of(vector.z))
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> R {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Multiplies each coordinate by a factor of its own.
    #[inline(always)]
    pub fn scaled(self, by: [f64; 3]) -> Self {
        Self::new(self.x * by[0], self.y * by[1], self.z * by[2])
    }

    /// Sets the vector of one target.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, vector: &Vector3<f64>) {
        self.x.set(lane, vector.x);
        self.y.set(lane, vector.y);
        self.z.set(lane, vector.z);
    }

    /// The vector of one target.
    #[inline(always)]
    pub fn lane(&self, lane: usize) -> Vector3<f64> {
        Vector3::new(self.x.lane(lane), self.y.lane(lane), self.z.lane(lane))
    }
}

impl Vector<Lanes> {
    /// The vectors shifted by one lane: each lane gets the vector of the lane before, the first lane gets `first`.
    pub fn shifted(&self, first: &Vector3<f64>) -> Self {
        let mut shifted = Self::of(first);
        for (shifted, all) in [(&mut shifted.x, &self.x), (&mut shifted.y, &self.y), (&mut shifted.z, &self.z)] {
            shifted.0[1..].copy_from_slice(&all.0[..WIDTH - 1]);
        }
        shifted
    }
}

impl<R: Real> Add for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl<R: Real> Sub for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl<R: Real> Mul<R> for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: R) -> Self {
        Self::new(self.x * by, self.y * by, self.z * by)
    }
}

impl<R: Real> Neg for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

/// A pose of one target, or of each of eight targets, as its axes and its origin; all zero in lanes that were not set.
///
/// # Examples
/// ```
/// use deflex_lanes::{Frame, Pose, Vector};
/// use nalgebra::{Matrix3, Rotation3};
///
/// // A quarter turn about z, 1 m above the parent frame.
/// let turn = Vector::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
/// let quarter = Frame { origin: Vector::new(0.0, 0.0, 1.0), ..Frame::of_rotation_vector(turn) };
/// let along_x = Vector::new(1.0, 0.0, 0.0);
/// let turned = quarter.turn(along_x);
/// assert!((turned.y - 1.0).abs() < 1e-15);
/// assert!((quarter.turn_back(turned).x - 1.0).abs() < 1e-15);
/// assert!((quarter.point(along_x).z - 1.0).abs() < 1e-15);
///
/// // The same products as of poses: self · other, self⁻¹ · other, self · other⁻¹.
/// let pose = quarter.lane(0);
/// let close = |found: Frame<f64>, wanted: Pose| (found.lane(0).to_matrix() - wanted.to_matrix()).amax() < 1e-15;
/// assert!(close(quarter.then(&quarter), pose * pose));
/// assert!(close(quarter.back_to(&quarter), Pose::identity()));
/// assert!(close(quarter.without(&quarter), Pose::identity()));
/// assert!(close(Frame::of(&pose), pose));
///
/// // A small turn, and the same turn as a quaternion of any length.
/// let small = Frame::identity().turned_by(Vector::new(0.0, 0.0, 0.1));
/// let quat = [0.05_f64.cos(), 0.0, 0.0, 0.05_f64.sin()].map(|part| 2.0 * part);
/// assert!(close(Frame::of_quaternion(Vector::ZERO, quat), small.lane(0)));
///
/// // One lane of eight.
/// let mut eight = Frame::<deflex_lanes::Lanes>::default();
/// eight.set(3, &pose);
/// eight.set_axes(4, &Rotation3::identity());
/// assert_eq!((eight.rotation(3), eight.rotation(4)), (pose.rotation, Rotation3::identity()));
/// assert_eq!(*eight.rotation(5).matrix(), Matrix3::zeros());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Frame<R = Lanes> {
    /// The x axis, in the coordinates of the parent frame.
    pub x: Vector<R>,
    /// The y axis, in the coordinates of the parent frame.
    pub y: Vector<R>,
    /// The z axis, in the coordinates of the parent frame.
    pub z: Vector<R>,
    /// The origin, in the coordinates of the parent frame.
    pub origin: Vector<R>,
}

impl<R: Real> Frame<R> {
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        let (one, none) = (R::of(1.0), R::ZERO);
        let axis = Vector::new;
        Self { x: axis(one, none, none), y: axis(none, one, none), z: axis(none, none, one), origin: Vector::ZERO }
    }

    /// The rotation of a rotation vector of any length, rad.
    #[inline(always)]
    pub fn of_rotation_vector(turn: Vector<R>) -> Self {
        /// Below this angle, rad, the series of sin(a/2)/a is exact to rounding.
        const SMALL: f64 = 1e-4;
        let square = turn.dot(turn);
        let angle = square.sqrt();
        let half = SinCos::of(angle * 0.5);
        let series = square * (-1.0 / 48.0) + 0.5;
        let per_rad = angle.lt(SMALL).select(series, half.sin / angle);
        let v = turn * per_rad;
        Self::of_quaternion(Vector::ZERO, [half.cos, v.x, v.y, v.z])
    }

    /// Rotates the frame by a small rotation vector in its own axes, rad; exact to rounding up to 0.2.
    #[inline(always)]
    pub fn turned_by(&self, turn: Vector<R>) -> Self {
        let square = turn.dot(turn);
        // sin a / a and (1 − cos a) / a².
        let sine = horner(square, [1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0, 1.0]);
        let less = horner(square, [1.0 / 3_628_800.0, -1.0 / 40320.0, 1.0 / 720.0, -1.0 / 24.0, 0.5]);
        // v + sin a · n × v + (1 − cos a) · n × (n × v), of each axis, whose coordinates are a one and zeros.
        let (s, l) = (turn * sine, turn * less);
        let one = R::of(1.0);
        let x = Vector::new(one - (l.y * turn.y + l.z * turn.z), l.x * turn.y + s.z, l.x * turn.z - s.y);
        let y = Vector::new(l.x * turn.y - s.z, one - (l.x * turn.x + l.z * turn.z), l.y * turn.z + s.x);
        let z = Vector::new(l.x * turn.z + s.y, l.y * turn.z - s.x, one - (l.x * turn.x + l.y * turn.y));
        Self { x: self.turn(x), y: self.turn(y), z: self.turn(z), origin: self.origin }
    }

    /// The same pose in every lane.
    #[inline(always)]
    pub fn of(pose: &Pose) -> Self {
        let axes = pose.rotation.matrix();
        let axis = |k: usize| Vector::of(&axes.column(k).into());
        Self { x: axis(0), y: axis(1), z: axis(2), origin: Vector::of(&pose.translation.vector) }
    }

    /// Sets the pose of one target.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, pose: &Pose) {
        self.set_axes(lane, &pose.rotation);
        self.origin.set(lane, &pose.translation.vector);
    }

    /// Sets the axes of one target; its origin stays.
    #[inline(always)]
    pub fn set_axes(&mut self, lane: usize, rotation: &Rotation3<f64>) {
        let m = rotation.matrix();
        self.x.set(lane, &Vector3::new(m.m11, m.m21, m.m31));
        self.y.set(lane, &Vector3::new(m.m12, m.m22, m.m32));
        self.z.set(lane, &Vector3::new(m.m13, m.m23, m.m33));
    }

    /// The pose of one target.
    #[inline(always)]
    pub fn lane(&self, lane: usize) -> Pose {
        Pose::from_parts(Translation3::from(self.origin.lane(lane)), self.rotation(lane))
    }

    /// The rotation of one target.
    #[inline(always)]
    pub fn rotation(&self, lane: usize) -> Rotation3<f64> {
        let (x, y, z) = (self.x.lane(lane), self.y.lane(lane), self.z.lane(lane));
        Rotation3::from_matrix_unchecked(Matrix3::new(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z))
    }

    /// A frame from a position, m, and a quaternion of any length, scalar first.
    #[inline(always)]
    pub fn of_quaternion(origin: Vector<R>, quat: [R; 4]) -> Self {
        let [w, i, j, k] = quat;
        let size = (w * w + i * i + j * j + k * k).sqrt();
        let (w, i, j, k) = (w / size, i / size, j / size, k / size);
        let one = R::of(1.0);
        let twice = |a: R, b: R| a * b * 2.0;
        Self {
            x: Vector::new(one - twice(j, j) - twice(k, k), twice(i, j) + twice(w, k), twice(i, k) - twice(w, j)),
            y: Vector::new(twice(i, j) - twice(w, k), one - twice(i, i) - twice(k, k), twice(j, k) + twice(w, i)),
            z: Vector::new(twice(i, k) + twice(w, j), twice(j, k) - twice(w, i), one - twice(i, i) - twice(j, j)),
            origin,
        }
    }

    /// A direction in this frame, expressed in the parent frame.
    #[inline(always)]
    pub fn turn(&self, v: Vector<R>) -> Vector<R> {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// A direction in the parent frame, expressed in this frame.
    #[inline(always)]
    pub fn turn_back(&self, v: Vector<R>) -> Vector<R> {
        Vector::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// A point in this frame, expressed in the parent frame.
    #[inline(always)]
    pub fn point(&self, v: Vector<R>) -> Vector<R> {
        self.origin + self.turn(v)
    }

    /// `self · other`.
    #[inline(always)]
    pub fn then(&self, other: &Self) -> Self {
        Self { x: self.turn(other.x), y: self.turn(other.y), z: self.turn(other.z), origin: self.point(other.origin) }
    }

    /// `self⁻¹ · other`.
    #[inline(always)]
    pub fn back_to(&self, other: &Self) -> Self {
        Self {
            x: self.turn_back(other.x),
            y: self.turn_back(other.y),
            z: self.turn_back(other.z),
            origin: self.turn_back(other.origin - self.origin),
        }
    }

    /// `self · other⁻¹`.
    #[inline(always)]
    pub fn without(&self, other: &Self) -> Self {
        let transposed = Self {
            x: Vector::new(other.x.x, other.y.x, other.z.x),
            y: Vector::new(other.x.y, other.y.y, other.z.y),
            z: Vector::new(other.x.z, other.y.z, other.z.z),
            origin: Vector::ZERO,
        };
        let axes = self.then(&transposed);
        Self { origin: self.origin - axes.turn(other.origin), ..axes }
    }
}
