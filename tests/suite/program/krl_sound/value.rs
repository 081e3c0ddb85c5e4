//! KRL values and frames.

use std::collections::BTreeMap;

pub(super) const POSE: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Val {
    Num(f64),
    Bool(bool),
    Word(String),
    Rec(BTreeMap<String, Val>),
    Arr(BTreeMap<i64, Val>),
    /// Nothing was assigned.
    Undef,
}

/// A component or an element.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Step {
    Part(String),
    Item(i64),
}

impl Val {
    pub(super) fn num(&self) -> Result<f64, String> {
        if let Self::Num(v) = self { Ok(*v) } else { Err(format!("no number: {self:?}")) }
    }

    pub(super) fn bool(&self) -> Result<bool, String> {
        if let Self::Bool(v) = self { Ok(*v) } else { Err(format!("no switch: {self:?}")) }
    }

    pub(super) fn rec(&self) -> Result<&BTreeMap<String, Val>, String> {
        if let Self::Rec(v) = self { Ok(v) } else { Err(format!("no record: {self:?}")) }
    }

    pub(super) fn get(&self, path: &[Step]) -> Self {
        path.iter().fold(self.clone(), |value, step| match (value, step) {
            (Self::Rec(parts), Step::Part(name)) => parts.get(name).cloned().unwrap_or(Self::Undef),
            (Self::Arr(items), Step::Item(at)) => items.get(at).cloned().unwrap_or(Self::Undef),
            _ => Self::Undef,
        })
    }

    pub(super) fn place(&mut self, path: &[Step]) -> &mut Self {
        path.iter().fold(self, |value, step| match step {
            Step::Part(name) => {
                if !matches!(value, Self::Rec(_)) {
                    *value = Self::Rec(BTreeMap::new());
                }
                let Self::Rec(parts) = value else { unreachable!() };
                parts.entry(name.clone()).or_insert(Self::Undef)
            }
            Step::Item(at) => {
                if !matches!(value, Self::Arr(_)) {
                    *value = Self::Arr(BTreeMap::new());
                }
                let Self::Arr(items) = value else { unreachable!() };
                items.entry(*at).or_insert(Self::Undef)
            }
        })
    }

    /// The six numbers of a frame.
    pub(super) fn six(&self) -> Result<[f64; 6], String> {
        let parts = self.rec()?;
        let mut out = [0.0; 6];
        for (to, name) in out.iter_mut().zip(POSE) {
            *to = parts.get(name).ok_or("a component is missing")?.num()?;
        }
        Ok(out)
    }

    pub(super) fn of_six(numbers: [f64; 6]) -> Self {
        Self::Rec(POSE.iter().zip(numbers).map(|(name, v)| ((*name).to_owned(), Self::Num(v))).collect())
    }
}

pub(super) type Matrix = [[f64; 3]; 3];

pub(super) fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..3).map(|k| a[r][k] * b[k][c]).sum()))
}

pub(super) fn turn(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|r| (0..3).map(|k| m[r][k] * v[k]).sum())
}

/// A about z, B about the turned y, C about the turned x (KUKA, Operating and Programming Instructions, frames).
pub(super) fn matrix([.., a, b, c]: [f64; 6]) -> Matrix {
    let (sa, ca) = a.to_radians().sin_cos();
    let (sb, cb) = b.to_radians().sin_cos();
    let (sc, cc) = c.to_radians().sin_cos();
    let z = [[ca, -sa, 0.0], [sa, ca, 0.0], [0.0, 0.0, 1.0]];
    let y = [[cb, 0.0, sb], [0.0, 1.0, 0.0], [-sb, 0.0, cb]];
    let x = [[1.0, 0.0, 0.0], [0.0, cc, -sc], [0.0, sc, cc]];
    times(&times(&z, &y), &x)
}

pub(super) fn of_quat([w, x, y, z]: [f64; 4]) -> Matrix {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// `a : b`
pub(super) fn chained(a: [f64; 6], b: [f64; 6]) -> [f64; 6] {
    let (ma, mb) = (matrix(a), matrix(b));
    let moved = turn(&ma, [b[0], b[1], b[2]]);
    let m = times(&ma, &mb);
    let tilt = (-m[2][0]).clamp(-1.0, 1.0).asin();
    let angles = [m[1][0].atan2(m[0][0]), tilt, m[2][1].atan2(m[2][2])].map(f64::to_degrees);
    [a[0] + moved[0], a[1] + moved[1], a[2] + moved[2], angles[0], angles[1], angles[2]]
}
