//! RAPID values and types, and poses.

/// A value: records and arrays are lists.
#[derive(Clone, Debug, PartialEq)]
pub enum Val {
    Num(f64),
    Bool(bool),
    Str(String),
    List(Vec<Val>),
}

impl Val {
    pub fn num(&self) -> Result<f64, String> {
        match self {
            Self::Num(v) => Ok(*v),
            other => Err(format!("expected a number, found {other:?}")),
        }
    }

    pub fn bool(&self) -> Result<bool, String> {
        match self {
            Self::Bool(v) => Ok(*v),
            other => Err(format!("expected TRUE or FALSE, found {other:?}")),
        }
    }

    pub fn str(&self) -> Result<&str, String> {
        match self {
            Self::Str(v) => Ok(v),
            other => Err(format!("expected a string, found {other:?}")),
        }
    }

    pub fn list(&self) -> Result<&[Self], String> {
        match self {
            Self::List(v) => Ok(v),
            other => Err(format!("expected a record, found {other:?}")),
        }
    }

    pub fn at(&self, i: usize) -> Result<&Self, String> {
        self.list()?.get(i).ok_or_else(|| format!("no component {i}"))
    }

    /// Follows indices.
    pub fn part(&self, path: &[usize]) -> Result<&Self, String> {
        path.iter().try_fold(self, |value, &i| value.at(i))
    }

    pub fn part_mut(&mut self, path: &[usize]) -> Result<&mut Self, String> {
        path.iter().try_fold(self, |value, &i| match value {
            Self::List(items) => items.get_mut(i).ok_or_else(|| format!("no component {i}")),
            other => Err(format!("no component {i} of {other:?}")),
        })
    }

    pub fn nums(values: &[f64]) -> Self {
        Self::List(values.iter().map(|v| Self::Num(*v)).collect())
    }

    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], String> {
        let mut out = [0.0; N];
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.at(i)?.num()?;
        }
        Ok(out)
    }

    /// As RAPID text.
    pub fn text(&self) -> String {
        match self {
            Self::Num(v) if *v >= 8.9e9 => "9E9".into(),
            Self::Num(v) => format!("{v:.9}"),
            Self::Bool(v) => if *v { "TRUE" } else { "FALSE" }.into(),
            Self::Str(v) => format!("\"{v}\""),
            Self::List(v) => format!("[{}]", v.iter().map(Self::text).collect::<Vec<_>>().join(",")),
        }
    }
}

/// Predefined records: components with their types.
pub fn components(ty: &str) -> &'static [(&'static str, &'static str)] {
    match ty {
        "POS" => &[("X", "NUM"), ("Y", "NUM"), ("Z", "NUM")],
        "ORIENT" => &[("Q1", "NUM"), ("Q2", "NUM"), ("Q3", "NUM"), ("Q4", "NUM")],
        "POSE" => &[("TRANS", "POS"), ("ROT", "ORIENT")],
        "CONFDATA" => &[("CF1", "NUM"), ("CF4", "NUM"), ("CF6", "NUM"), ("CFX", "NUM")],
        "EXTJOINT" => &[
            ("EAX_A", "NUM"),
            ("EAX_B", "NUM"),
            ("EAX_C", "NUM"),
            ("EAX_D", "NUM"),
            ("EAX_E", "NUM"),
            ("EAX_F", "NUM"),
        ],
        "ROBTARGET" => &[("TRANS", "POS"), ("ROT", "ORIENT"), ("ROBCONF", "CONFDATA"), ("EXTAX", "EXTJOINT")],
        "ROBJOINT" => &[
            ("RAX_1", "NUM"),
            ("RAX_2", "NUM"),
            ("RAX_3", "NUM"),
            ("RAX_4", "NUM"),
            ("RAX_5", "NUM"),
            ("RAX_6", "NUM"),
        ],
        "JOINTTARGET" => &[("ROBAX", "ROBJOINT"), ("EXTAX", "EXTJOINT")],
        "LOADDATA" => {
            &[("MASS", "NUM"), ("COG", "POS"), ("AOM", "ORIENT"), ("IX", "NUM"), ("IY", "NUM"), ("IZ", "NUM")]
        }
        "TOOLDATA" => &[("ROBHOLD", "BOOL"), ("TFRAME", "POSE"), ("TLOAD", "LOADDATA")],
        "WOBJDATA" => {
            &[("ROBHOLD", "BOOL"), ("UFPROG", "BOOL"), ("UFMEC", "STRING"), ("UFRAME", "POSE"), ("OFRAME", "POSE")]
        }
        "SPEEDDATA" => &[("V_TCP", "NUM"), ("V_ORI", "NUM"), ("V_LEAX", "NUM"), ("V_REAX", "NUM")],
        _ => &[],
    }
}

/// A pose: position in mm, orientation scalar first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    pub p: [f64; 3],
    pub q: [f64; 4],
}

pub const IDENTITY: Frame = Frame { p: [0.0; 3], q: [1.0, 0.0, 0.0, 0.0] };

fn hamilton(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    if norm < 1e-9 { [1.0, 0.0, 0.0, 0.0] } else { q.map(|v| v / norm) }
}

impl Frame {
    pub fn of(value: &Val) -> Result<Self, String> {
        Ok(Self { p: value.at(0)?.numbers()?, q: unit(value.at(1)?.numbers()?) })
    }

    pub fn val(&self) -> Val {
        Val::List(vec![Val::nums(&self.p), Val::nums(&self.q)])
    }

    /// A turn of `degrees` about axis 0, 1 or 2.
    pub fn turn(axis: usize, degrees: f64) -> Self {
        let (sin, cos) = (degrees.to_radians() / 2.0).sin_cos();
        let mut q = [cos, 0.0, 0.0, 0.0];
        q[axis + 1] = sin;
        Self { p: [0.0; 3], q }
    }

    pub fn shift(p: [f64; 3]) -> Self {
        Self { p, ..IDENTITY }
    }

    pub fn rotate(&self, v: [f64; 3]) -> [f64; 3] {
        let q = self.q;
        let turned = hamilton(hamilton(q, [0.0, v[0], v[1], v[2]]), [q[0], -q[1], -q[2], -q[3]]);
        [turned[1], turned[2], turned[3]]
    }

    pub fn then(&self, other: &Self) -> Self {
        let moved = self.rotate(other.p);
        Self { p: std::array::from_fn(|i| self.p[i] + moved[i]), q: unit(hamilton(self.q, other.q)) }
    }

    pub fn inverse(&self) -> Self {
        let back = Self { p: [0.0; 3], q: [self.q[0], -self.q[1], -self.q[2], -self.q[3]] };
        Self { p: back.rotate(self.p).map(|v| -v), q: back.q }
    }

    /// Distance in mm, and angle between in rad.
    pub fn apart(&self, other: &Self) -> (f64, f64) {
        let d: f64 = (0..3).map(|i| (self.p[i] - other.p[i]).powi(2)).sum::<f64>().sqrt();
        let between = self.inverse().then(other).q;
        let sin = between[1..].iter().map(|v| v * v).sum::<f64>().sqrt();
        (d, 2.0 * sin.atan2(between[0].abs()))
    }
}
