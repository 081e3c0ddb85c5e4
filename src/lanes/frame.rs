use super::number::{Lanes, WIDTH};
use crate::robot::Pose;
use nalgebra::{Matrix3, Rotation3, Translation3, Vector3};
use std::ops::{Add, Mul, Sub};

/// A vector of each of eight targets.
#[derive(Clone, Copy, Debug, Default)]
pub struct Vector {
    pub(crate) x: Lanes,
    pub(crate) y: Lanes,
    pub(crate) z: Lanes,
}

impl Vector {
    #[inline(always)]
    pub(crate) fn new(x: Lanes, y: Lanes, z: Lanes) -> Self {
        Self { x, y, z }
    }

    /// The same in every lane.
    #[inline(always)]
    pub(crate) fn of(vector: &Vector3<f64>) -> Self {
        Self::new(Lanes::of(vector.x), Lanes::of(vector.y), Lanes::of(vector.z))
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> Lanes {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, vector: &Vector3<f64>) {
        self.x.set(lane, vector.x);
        self.y.set(lane, vector.y);
        self.z.set(lane, vector.z);
    }

    /// Each lane the one before, the first another.
    pub(crate) fn behind(&self, first: &Vector3<f64>) -> Self {
        let mut behind = Self::of(first);
        for (behind, all) in [(&mut behind.x, &self.x), (&mut behind.y, &self.y), (&mut behind.z, &self.z)] {
            behind.0[1..].copy_from_slice(&all.0[..WIDTH - 1]);
        }
        behind
    }

    #[inline(always)]
    pub(crate) fn lane(&self, lane: usize) -> Vector3<f64> {
        Vector3::new(self.x.lane(lane), self.y.lane(lane), self.z.lane(lane))
    }
}

impl Add for Vector {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl Sub for Vector {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Mul<Lanes> for Vector {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: Lanes) -> Self {
        Self::new(self.x * by, self.y * by, self.z * by)
    }
}

impl Mul<f64> for Vector {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: f64) -> Self {
        Self::new(self.x * by, self.y * by, self.z * by)
    }
}

/// A pose of each of eight targets, axis by axis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Frame {
    pub(crate) x: Vector,
    pub(crate) y: Vector,
    pub(crate) z: Vector,
    pub(crate) origin: Vector,
}

impl Frame {
    /// The same in every lane.
    #[inline(always)]
    pub(crate) fn of(pose: &Pose) -> Self {
        let axes = pose.rotation.matrix();
        let axis = |k: usize| Vector::of(&axes.column(k).into());
        Self { x: axis(0), y: axis(1), z: axis(2), origin: Vector::of(&pose.translation.vector) }
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, pose: &Pose) {
        self.set_axes(lane, &pose.rotation);
        self.origin.set(lane, &pose.translation.vector);
    }

    #[inline(always)]
    pub(crate) fn set_axes(&mut self, lane: usize, rotation: &Rotation3<f64>) {
        let m = rotation.matrix();
        self.x.set(lane, &m.column(0).into());
        self.y.set(lane, &m.column(1).into());
        self.z.set(lane, &m.column(2).into());
    }

    #[inline(always)]
    pub(crate) fn lane(&self, lane: usize) -> Pose {
        Pose::from_parts(Translation3::from(self.origin.lane(lane)), self.rotation(lane))
    }

    #[inline(always)]
    pub(crate) fn rotation(&self, lane: usize) -> Rotation3<f64> {
        let (x, y, z) = (self.x.lane(lane), self.y.lane(lane), self.z.lane(lane));
        Rotation3::from_matrix_unchecked(Matrix3::new(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z))
    }

    /// A place, m, and a quaternion, scalar first, of any length.
    #[inline(always)]
    pub(crate) fn of_quaternion(origin: Vector, quat: [Lanes; 4]) -> Self {
        let [w, i, j, k] = quat;
        let size = (w * w + i * i + j * j + k * k).sqrt();
        let (w, i, j, k) = (w / size, i / size, j / size, k / size);
        let one = Lanes::of(1.0);
        let twice = |a: Lanes, b: Lanes| a * b * 2.0;
        Self {
            x: Vector::new(one - twice(j, j) - twice(k, k), twice(i, j) + twice(w, k), twice(i, k) - twice(w, j)),
            y: Vector::new(twice(i, j) - twice(w, k), one - twice(i, i) - twice(k, k), twice(j, k) + twice(w, i)),
            z: Vector::new(twice(i, k) + twice(w, j), twice(j, k) - twice(w, i), one - twice(i, i) - twice(j, j)),
            origin,
        }
    }

    /// A direction of this frame in the frame that this one stands in.
    #[inline(always)]
    pub(crate) fn turn(&self, v: Vector) -> Vector {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// A direction in the axes of this frame.
    #[inline(always)]
    pub(crate) fn turn_back(&self, v: Vector) -> Vector {
        Vector::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// A point of this frame in the frame that this one stands in.
    #[inline(always)]
    pub(crate) fn point(&self, v: Vector) -> Vector {
        self.origin + self.turn(v)
    }

    /// `self · other`.
    #[inline(always)]
    pub(crate) fn then(&self, other: &Self) -> Self {
        Self { x: self.turn(other.x), y: self.turn(other.y), z: self.turn(other.z), origin: self.point(other.origin) }
    }

    /// `self⁻¹ · other`.
    #[inline(always)]
    pub(crate) fn back_to(&self, other: &Self) -> Self {
        Self {
            x: self.turn_back(other.x),
            y: self.turn_back(other.y),
            z: self.turn_back(other.z),
            origin: self.turn_back(other.origin - self.origin),
        }
    }

    /// `self · other⁻¹`.
    #[inline(always)]
    pub(crate) fn without(&self, other: &Self) -> Self {
        let transposed = Self {
            x: Vector::new(other.x.x, other.y.x, other.z.x),
            y: Vector::new(other.x.y, other.y.y, other.z.y),
            z: Vector::new(other.x.z, other.y.z, other.z.z),
            origin: Vector::default(),
        };
        let axes = self.then(&transposed);
        Self { origin: self.origin - axes.turn(other.origin), ..axes }
    }
}
