//! A smooth map of errors that no physical effect explains, used only in the domain in which it was measured.
//!
//! A map over positions in the work object shifts the TCP in work object axes; one over commanded motor angles shifts it in base axes. It
//! fades to zero over the outer tenth of its domain, so that the correction does not jump at the edge.

pub(super) use super::discrepancy::Discrepancy;
pub(super) use super::empirical_field::EmpiricalField;
use super::empirical_field::NAME;
use super::{ANY, Effect, Kind, Number, Offset, Parts, Physics, Site, checked, indexed};
use deflex_lanes::{Mask, Real, Vector, six};
use serde::de::Error;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: NAME,
    summary: "no named effect explains it: a smooth map, only where it holds",
    forms: &[
        "domain_mm = [[-2000, 2000], [-2000, 2000], [-2000, 2000]]\ndegree = 1\nx_mm = [0, 0, 0, 0]\ny_mm = [0, 0, 0, 0]\nz_mm = [0, 0, 0, 0]",
        "domain_deg = [[-90, 90], [-90, 90], [-90, 90], [-90, 90], [-90, 90], [-90, 90]]\ndegree = 1\nx_mm = [0, 0, 0, 0, 0, 0, 0]\ny_mm = [0, 0, 0, 0, 0, 0, 0]\nz_mm = [0, 0, 0, 0, 0, 0, 0]",
        "reach_mm = 50\nwithin_mm = 20\nat_mm = [[900, 0, 400], [950, 0, 400]]\nshift_mm = [[0, 0, 0], [0, 0, 0]]",
        "reach = 2\nspread = [80, 5, 100]\nat_mm = [[900, 0, 400]]\nwrist_deg = [[0, 30, 0]]\nforce_n = [[0, 0, 0]]\nshift_mm = [[0, 0, 0]]",
    ],
    shape: super::Shape::Map,
    parts: Parts::LAG,
    read,
    ..Kind::PLAIN
};

/// Chooses the form of the table by its keys: a field has `reach_mm`, a discrepancy has `reach`, a polynomial has neither.
fn read(table: toml::Table) -> Result<Box<dyn Effect>, toml::de::Error> {
    if table.contains_key("reach") {
        return checked(table.try_into::<Discrepancy>()?.check().map_err(toml::de::Error::custom)?);
    }
    if table.contains_key("reach_mm") {
        return checked(table.try_into::<EmpiricalField>()?.check().map_err(toml::de::Error::custom)?);
    }
    checked(Empirical::try_from(table.try_into::<Keys>()?).map_err(toml::de::Error::custom)?)
}

/// Degrees per radian.
const RAD_TO_DEG: f64 = 180.0 / std::f64::consts::PI;

/// Share of the half range, from the middle of the domain, within which the map acts in full.
const FULL: f64 = 0.9;

/// Highest total degree. Polynomials of higher degree follow the noise between the measured points.
const MAX_DEGREE: usize = 5;

/// A polynomial shift of the TCP.
#[derive(Clone, Debug, Serialize)]
#[serde(into = "Keys")]
pub(super) struct Empirical {
    over: Over,
    /// Least and largest of each variable, mm or degrees.
    domain: Vec<[f64; 2]>,
    /// Total degree in Chebyshev polynomials of the variables scaled to −1 … 1.
    degree: usize,
    /// Degree of each variable in each term.
    terms: Vec<Vec<usize>>,
    /// Shift along x, y, z by each of `terms`, mm.
    shift_mm: [Vec<f64>; 3],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Over {
    Position,
    Motor,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// Domain over x, y, z in the work object.
    #[serde(skip_serializing_if = "Option::is_none")]
    domain_mm: Option<[[f64; 2]; 3]>,
    /// Domain over the commanded motor angles.
    #[serde(skip_serializing_if = "Option::is_none")]
    domain_deg: Option<[[f64; 2]; 6]>,
    degree: usize,
    x_mm: Vec<f64>,
    y_mm: Vec<f64>,
    z_mm: Vec<f64>,
}

impl TryFrom<Keys> for Empirical {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let (over, domain) = match (keys.domain_mm, keys.domain_deg) {
            (Some(domain), None) => (Over::Position, domain.to_vec()),
            (None, Some(domain)) => (Over::Motor, domain.to_vec()),
            _ => return Err("expected one of `domain_mm` (of x, y, z) and `domain_deg` (of the six motors)".to_owned()),
        };
        if !domain.iter().all(|[min, max]| min.is_finite() && max.is_finite() && min < max) {
            return Err("each pair of the domain must be finite, the least before the largest".to_owned());
        }
        if keys.degree > MAX_DEGREE {
            return Err(format!("`degree` is {}, expected 0 to {MAX_DEGREE}", keys.degree));
        }
        let terms = exponents(domain.len(), keys.degree);
        for (key, values) in [("x_mm", &keys.x_mm), ("y_mm", &keys.y_mm), ("z_mm", &keys.z_mm)] {
            if values.len() != terms.len() {
                let expected = terms.len();
                return Err(format!("`{key}` has {} values, expected {expected} at this degree", values.len()));
            }
        }
        Ok(Self { over, domain, degree: keys.degree, terms, shift_mm: [keys.x_mm, keys.y_mm, keys.z_mm] })
    }
}

impl From<Empirical> for Keys {
    fn from(Empirical { over, domain, degree, shift_mm: [x_mm, y_mm, z_mm], .. }: Empirical) -> Self {
        let (domain_mm, domain_deg) = match over {
            Over::Position => (domain.try_into().ok(), None),
            Over::Motor => (None, domain.try_into().ok()),
        };
        Self { domain_mm, domain_deg, degree, x_mm, y_mm, z_mm }
    }
}

/// Exponents of all terms up to a total degree, the first variable's changing slowest.
fn exponents(variables: usize, degree: usize) -> Vec<Vec<usize>> {
    if variables == 0 {
        return vec![vec![]];
    }
    let with = |first: usize| {
        exponents(variables - 1, degree - first).into_iter().map(move |rest| [vec![first], rest].concat())
    };
    (0..=degree).flat_map(with).collect()
}

impl Empirical {
    /// A variable scaled so that its domain is −1 … 1.
    #[inline(always)]
    fn scaled<R: Real>(&self, variable: usize, value: R) -> R {
        let [min, max] = self.domain[variable];
        (value * 2.0 - (min + max)) * (1.0 / (max - min))
    }

    /// The variables scaled, in the order of the domain; zeros after them.
    #[inline(always)]
    fn scaled_of<R: Real>(&self, site: &Site<R>) -> [R; 6] {
        let Vector { x, y, z } = site.wanted;
        match self.over {
            Over::Position => {
                let scaled = |variable: usize, value: R| self.scaled(variable, value * 1e3);
                [scaled(0, x), scaled(1, y), scaled(2, z), R::ZERO, R::ZERO, R::ZERO]
            }
            Over::Motor => six!(i => self.scaled(i, site.commanded[i] * RAD_TO_DEG)),
        }
    }

    /// Sums of the terms at scaled variables, each with its coefficient, along x, y and z.
    #[inline(always)]
    fn sums<R: Real>(&self, scaled: &[R; 6]) -> [R; 3] {
        let mut chebyshev = [[R::of(1.0); MAX_DEGREE + 1]; 6];
        for (powers, u) in chebyshev.iter_mut().zip(scaled) {
            powers[1] = *u;
            for k in 2..=self.degree {
                powers[k] = *u * powers[k - 1] * 2.0 - powers[k - 2];
            }
        }
        let mut sums = [R::ZERO; 3];
        for (n, term) in self.terms.iter().enumerate() {
            let mut product = R::of(1.0);
            for (powers, k) in chebyshev.iter().zip(term).filter(|(_, k)| **k > 0) {
                product = product * powers[*k];
            }
            for (sum, shift) in sums.iter_mut().zip(&self.shift_mm) {
                *sum = *sum + product * shift[n];
            }
        }
        sums
    }
}

/// 1 in the full part of the domain, 0 outside, smooth between.
#[inline(always)]
fn fade<R: Real>(scaled: &[R]) -> R {
    let (one, mut product) = (R::of(1.0), R::of(1.0));
    for u in scaled {
        let left = (one - u.abs()) * (1.0 / (1.0 - FULL));
        let left = left.lt(1.0).select(left, one);
        let left = R::ZERO.lt(left).select(left, R::ZERO);
        product = product * (left * left * (R::of(3.0) - left * 2.0));
    }
    product
}

impl Physics for Empirical {
    #[inline(always)]
    fn offset<R: Real>(&self, site: &Site<R>, out: &mut Offset<R>) {
        let scaled = self.scaled_of(site);
        let weight = fade(&scaled[..self.domain.len()]);
        let [x, y, z] = self.sums(&scaled);
        let shift = Vector::new(x, y, z) * (weight * 1e-3);
        // Far outside its domain a polynomial can be arbitrarily large.
        let acts = R::ZERO.lt(weight);
        let within = |value: R| acts.select(value, R::ZERO);
        let shift = Vector::new(within(shift.x), within(shift.y), within(shift.z));
        out.lag = out.lag
            + match self.over {
                Over::Position => site.base_from_wobj.turn(shift),
                Over::Motor => shift,
            };
    }
}

impl Effect for Empirical {
    fn follows_command(&self) -> bool {
        self.over == Over::Motor
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        let named = ["x_mm", "y_mm", "z_mm"].into_iter().zip(&mut self.shift_mm);
        named.flat_map(|(key, values)| indexed(key, values, "mm", 0.05, 0.0, ANY)).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    const MAP: &str = r#"domain_mm = [[-100, 100], [0, 10], [0, 10]]
        degree = 2
        x_mm = [0, 0, 0, 0, 0, 0, 0.04, 0, 0, 0.08]
        y_mm = [0.01, 0, 0, 0, 0, 0, 0, 0, 0, 0]
        z_mm = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"#;

    fn at(x: f64, y: f64) -> Vector3<f64> {
        let mut bench = Bench::default();
        bench.situation.wobj_from_tcp.translation.vector = Vector3::new(x, y, 5e-3);
        bench.run("empirical", MAP).1.lag
    }

    #[test]
    fn chebyshev_in_the_middle_and_nothing_outside() {
        // u = (½, 0, 0): 0.04 T₁ + 0.08 T₂ = 0.02 − 0.04 mm.
        assert_abs_diff_eq!(at(0.05, 5e-3), Vector3::new(-2e-5, 1e-5, 0.0), epsilon = 1e-18);
        assert_abs_diff_eq!(at(0.101, 5e-3), Vector3::zeros());
        // u = 0.95 is halfway through the fade.
        assert_abs_diff_eq!(at(0.095, 5e-3).y, 5e-6, epsilon = 1e-16);
    }
}
