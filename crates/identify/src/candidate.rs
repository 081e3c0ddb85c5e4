//! Candidates: effects and patterns that a set can have, with their numbers and their prior.

use super::columns::Smoothness;
use super::pattern::{Consequence, Pattern};
use super::smooth::Curve;
use deflex_effects::Shape as Follows;
use deflex_effects::{Effect, Kind, Part, kind};
use deflex_equilibrium::Arm;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Family of the laws of the joints' springs.
pub(super) const SPRING: &str = "spring";

/// The family of an effect: the laws of the joints' springs are one family, a curve has a family for each joint, and
/// every other kind has its own.
fn family(effect: &dyn Effect) -> String {
    match (kind(effect.kind()).map(|kind| kind.part), effect.joint_curve()) {
        (Some(Part::JointSpring), _) => SPRING.to_owned(),
        (_, Some(curve)) => format!("{} {}", effect.kind(), curve.joint + 1),
        _ => effect.kind().to_owned(),
    }
}

/// The effect or pattern to which the numbers of a candidate belong.
#[derive(Clone, Debug)]
pub(super) enum Home {
    /// The effect of the declared cell with this index, whose numbers are fitted again.
    Declared(usize),
    /// A new effect, which is added to the arm.
    New(Shape),
    /// No effect: a clamping, a fault of the measurement, or a pattern of an effect in no list.
    Pattern(Pattern),
}

/// An effect that can be cloned, as the prototype of new effects.
#[derive(Debug)]
pub(super) struct Shape(pub(super) Box<dyn Effect>);

impl Clone for Shape {
    fn clone(&self) -> Self {
        Self(self.0.clone_box())
    }
}

/// A candidate with its present numbers.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Kind of the effect, or name of the pattern.
    pub(super) kind: String,
    /// Family, of which a set usually has at most one member.
    pub(super) family: String,
    pub(super) home: Home,
    /// Present values, in the units of the cell file.
    pub(super) values: Vec<f64>,
    /// Values at which a fit starts, as declared or of the prototype. The prior mean is counted from them.
    pub(super) start: Vec<f64>,
    /// Prior size as a share of the typical size. Twins of a candidate have other shares, because real effects are
    /// small and large.
    pub(super) scale: f64,
    /// Typical size of each number, in its unit.
    pub(super) typical: Vec<f64>,
    /// Smallest and largest value of each number, in its unit.
    pub(super) bounds: Vec<(f64, f64)>,
    /// Index of its first column in the design.
    pub(super) first: usize,
    /// Number of variants among which it was found; its logarithm is added to the price (the look-elsewhere effect).
    pub(super) variants: f64,
    /// The curve, if it is a curve whose smoothness is chosen by the evidence.
    pub(super) curve: Option<Curve>,
    /// The prior that an earlier identification left, in typical sizes.
    pub(super) known: Option<Arc<Smoothness>>,
}

impl Candidate {
    /// The candidate of an effect, which was found among `variants`.
    pub(super) fn new(effect: &dyn Effect, home: Home, variants: f64) -> Self {
        let parameters = effect.parameters();
        Self {
            kind: effect.kind().to_owned(),
            family: family(effect),
            home,
            values: parameters.iter().map(|p| p.value).collect(),
            start: parameters.iter().map(|p| p.value).collect(),
            scale: 1.0,
            typical: parameters.iter().map(|p| p.typical).collect(),
            bounds: parameters.iter().map(|p| p.bounds).collect(),
            first: 0,
            variants,
            curve: None,
            known: None,
        }
    }

    /// The same candidate with the covariance that the cell has of its numbers as their prior.
    pub(super) fn known_to(self, covariance: Option<&DMatrix<f64>>) -> Self {
        let known =
            covariance.and_then(|covariance| Smoothness::of_covariance(covariance, &self.typical)).map(Arc::new);
        Self { known, ..self }
    }

    /// The prior under which its numbers depend on one another; `None` if they are independent.
    pub(super) fn precision(&self) -> Option<&Arc<Smoothness>> {
        self.curve.as_ref().map(|curve| &curve.smoothness).or(self.known.as_ref())
    }

    /// The candidate as a curve whose smoothness is chosen by the evidence; `None` if it is no curve of one joint.
    pub(super) fn into_curve(self) -> Option<Self> {
        let Home::New(shape) = &self.home else { return None };
        let curve = Curve::new(shape.0.joint_curve()?)?;
        Some(Self { curve: Some(curve), variants: Curve::variants(), ..self })
    }

    /// Minus twice the log prior density of its numbers except for a constant.
    pub(super) fn prior_misfit(&self) -> f64 {
        let mean = |k: usize| self.start[k] + self.expected(k);
        let off = DVector::from_fn(self.values.len(), |k, _| (self.values[k] - mean(k)) / self.size(k));
        match self.precision() {
            Some(prior) => off.dot(&(&prior.precision * &off)),
            None => off.norm_squared(),
        }
    }

    /// The candidate of a pattern with `size` numbers.
    pub(super) fn pattern(pattern: Pattern, size: usize) -> Self {
        Self {
            kind: pattern.name().to_owned(),
            family: pattern.family(),
            home: Home::Pattern(pattern),
            values: vec![0.0; size],
            start: vec![0.0; size],
            scale: 1.0,
            typical: vec![1.0; size],
            bounds: vec![(f64::NEG_INFINITY, f64::INFINITY); size],
            first: 0,
            variants: 1.0,
            curve: None,
            known: None,
        }
    }

    /// The entry of its kind in the registry of effects; `None` for patterns.
    pub(super) fn law(&self) -> Option<&'static Kind> {
        if self.is_pattern() { None } else { kind(&self.kind) }
    }

    /// Whether it is a new effect with a time constant.
    pub(super) fn has_time_constant(&self) -> bool {
        let Home::New(shape) = &self.home else { return false };
        let named = |name: &str| shape.0.parameters().iter().any(|p| p.name == name);
        self.law().and_then(|law| law.time_constant).is_some_and(named)
    }

    /// The consequence of a pattern in the chosen set; `None` for effects.
    pub(super) fn consequence(&self) -> Option<Consequence> {
        match self.home {
            Home::Pattern(pattern) => Some(pattern.consequence()),
            Home::Declared(_) | Home::New(_) => None,
        }
    }

    /// Prior mean of number `k`, counted from its start value.
    pub(super) fn expected(&self, k: usize) -> f64 {
        match self.home {
            Home::Pattern(pattern) => pattern.expected(k),
            Home::Declared(_) | Home::New(_) => 0.0,
        }
    }

    /// Whether it can imitate many other effects: an unlisted pattern or a curve.
    pub(super) fn is_flexible(&self) -> bool {
        self.consequence() == Some(Consequence::Unlisted) || self.law().is_some_and(|law| law.shape == Follows::Curve)
    }

    /// Whether it has a name in the answer: an effect, or a fault of the measurement.
    pub(super) fn is_named(&self) -> bool {
        matches!(self.consequence(), None | Some(Consequence::Fault))
    }

    /// The columns of a pattern with its present numbers, in typical sizes.
    pub(super) fn pattern_numbers(&self) -> impl Iterator<Item = (usize, f64)> {
        self.columns().enumerate().map(|(k, column)| (column, self.values[k] / self.typical[k]))
    }

    /// Indices of its columns in the design.
    pub(super) fn columns(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.values.len()
    }

    /// The index of each bounded number with its bounds, counted from its start value, in prior sizes.
    pub(super) fn within(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let from_start = |k: usize, end: f64| (end - self.start[k]) / self.size(k);
        let bounded = self.bounds.iter().enumerate().filter(|(_, (low, high))| low.is_finite() || high.is_finite());
        bounded.map(move |(k, &(low, high))| (k, from_start(k, low), from_start(k, high)))
    }

    /// Prior size of number `k`, in its unit.
    pub(super) fn size(&self, k: usize) -> f64 {
        self.typical[k] * self.scale
    }

    /// Whether its prior sizes are the typical sizes, so that it is no twin.
    pub(super) fn is_typical_size(&self) -> bool {
        self.scale.total_cmp(&1.0).is_eq()
    }

    /// Whether it is a pattern that shifts the measured positions.
    pub(super) fn is_shift(&self) -> bool {
        matches!(self.home, Home::Pattern(pattern) if !pattern.is_of_force())
    }

    /// Whether it is a pattern and no effect.
    pub(super) fn is_pattern(&self) -> bool {
        matches!(self.home, Home::Pattern(_))
    }
}

/// Whether two candidates are the same pattern.
pub(super) fn same_pattern(a: &Candidate, b: &Candidate) -> bool {
    matches!((&a.home, &b.home), (Home::Pattern(a), Home::Pattern(b)) if a == b)
}

/// Whether two candidates belong to the same effect of the declared cell.
pub(super) fn same_numbers(a: &Candidate, b: &Candidate) -> bool {
    matches!((&a.home, &b.home), (Home::Declared(a), Home::Declared(b)) if a == b)
}

/// Whether two candidates differ only in their prior size or in the bounds of their numbers.
pub(super) fn twins(a: &Candidate, b: &Candidate) -> bool {
    let same = same_numbers(a, b)
        || matches!((&a.home, &b.home), (Home::New(_), Home::New(_)))
        || matches!((&a.home, &b.home), (Home::Pattern(a), Home::Pattern(b)) if a == b);
    a.family == b.family
        && same
        && a.start == b.start
        && a.start.len() == b.start.len()
        && ((a.scale - b.scale).abs() > 0.0 || a.bounds != b.bounds)
}

/// The arm with the numbers of some candidates: those of declared effects replaced, and new effects added.
pub(super) fn with(arm: &Arm, changes: &[(&Home, &[f64])]) -> Arm {
    let mut effects: Vec<Box<dyn Effect>> = arm.effects.iter().map(|effect| effect.clone_box()).collect();
    for (home, values) in changes {
        match home {
            Home::Declared(slot) => effects[*slot] = effects[*slot].with_values(values),
            Home::New(shape) => effects.push(shape.0.with_values(values)),
            Home::Pattern(_) => {}
        }
    }
    Arm { robot: arm.robot.clone(), stiffness: arm.stiffness, effects }
}

/// The effect of a candidate with its present numbers; `None` for patterns.
pub(super) fn fitted(declared: &Arm, candidate: &Candidate) -> Option<Box<dyn Effect>> {
    match &candidate.home {
        Home::Declared(slot) => Some(declared.effects[*slot].with_values(&candidate.values)),
        Home::New(shape) => Some(shape.0.with_values(&candidate.values)),
        Home::Pattern(_) => None,
    }
}
