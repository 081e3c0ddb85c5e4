//! What may be added to a cell, with its numbers and their prior.

use super::columns::Smoothness;
use super::pattern::{Pattern, Standing};
use super::smooth::Curve;
use crate::effects::Shape as Follows;
use crate::effects::{Effect, Kind, Part, kind};
use crate::equilibrium::Arm;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Family of the laws of the joints' springs.
pub(super) const SPRING: &str = "spring";

/// What a set has one of: the law of a part, a kind, or for curves of one joint each, the kind and its joint.
fn family(effect: &dyn Effect) -> String {
    match (kind(effect.kind()).map(|kind| kind.part), effect.joint_curve()) {
        (Some(Part::JointSpring), _) => SPRING.to_owned(),
        (_, Some(curve)) => format!("{} {}", effect.kind(), curve.joint + 1),
        _ => effect.kind().to_owned(),
    }
}

/// Where a candidate's numbers live.
#[derive(Clone, Debug)]
pub(super) enum Home {
    /// An effect that the cell has: its numbers are fitted anew.
    Declared(usize),
    /// A new effect, appended.
    New(Shape),
    /// No effect at all: a clamping, a fault of the measurement, or a pattern that stands for anything unlisted.
    Pattern(Pattern),
}

/// A prototype that can be copied.
#[derive(Debug)]
pub(super) struct Shape(pub(super) Box<dyn Effect>);

impl Clone for Shape {
    fn clone(&self) -> Self {
        Self(self.0.clone_box())
    }
}

/// A candidate with its current numbers.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) kind: String,
    /// Of variants of one family a set has one: a kind, or the curve of one joint.
    pub(super) family: String,
    pub(super) home: Home,
    /// Current values, in the cell file's units; the prototype's where it is not in the cell yet.
    pub(super) values: Vec<f64>,
    /// Where values start and what the prior is centred on: as declared, or the prototype's.
    pub(super) start: Vec<f64>,
    /// Share of the typical sizes that the prior has: real effects are small and large.
    pub(super) scale: f64,
    pub(super) typical: Vec<f64>,
    pub(super) bounds: Vec<(f64, f64)>,
    /// Index of the first of its columns in the design.
    pub(super) first: usize,
    /// How many variants were looked at: the look-elsewhere price is its logarithm.
    pub(super) variants: f64,
    /// A curve whose smoothness the data choose.
    pub(super) curve: Option<Curve>,
    /// What is known of its numbers from an identification before, in typical sizes.
    pub(super) known: Option<Arc<Smoothness>>,
}

impl Candidate {
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

    /// The same with the covariance that a cell has of its numbers as their prior.
    pub(super) fn known_to(self, covariance: Option<&DMatrix<f64>>) -> Self {
        let known =
            covariance.and_then(|covariance| Smoothness::of_covariance(covariance, &self.typical)).map(Arc::new);
        Self { known, ..self }
    }

    /// What ties its numbers to one another under their prior.
    pub(super) fn precision(&self) -> Option<&Arc<Smoothness>> {
        self.curve.as_ref().map(|curve| &curve.smoothness).or(self.known.as_ref())
    }

    /// The candidate as a curve whose smoothness the data choose; `None` if it is no curve of one joint.
    pub(super) fn into_curve(self) -> Option<Self> {
        let Home::New(shape) = &self.home else { return None };
        let curve = Curve::new(shape.0.joint_curve()?)?;
        Some(Self { curve: Some(curve), variants: Curve::variants(), ..self })
    }

    /// How unlikely its numbers are under its prior: twice nats.
    pub(super) fn unlikely(&self) -> f64 {
        let mean = |k: usize| self.start[k] + self.expected(k);
        let off = DVector::from_fn(self.values.len(), |k, _| (self.values[k] - mean(k)) / self.size(k));
        match self.precision() {
            Some(prior) => off.dot(&(&prior.precision * &off)),
            None => off.norm_squared(),
        }
    }

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

    /// What the tool knows of its kind; `None` for patterns.
    pub(super) fn law(&self) -> Option<&'static Kind> {
        if self.is_pattern() { None } else { kind(&self.kind) }
    }

    /// Whether it is a new effect that follows time with a constant of its own.
    pub(super) fn has_time_constant(&self) -> bool {
        let Home::New(shape) = &self.home else { return false };
        let named = |name: &str| shape.0.parameters().iter().any(|p| p.name == name);
        self.law().and_then(|law| law.time_constant).is_some_and(named)
    }

    /// What follows if a set has it, where it is no effect.
    pub(super) fn standing(&self) -> Option<Standing> {
        match self.home {
            Home::Pattern(pattern) => Some(pattern.standing()),
            Home::Declared(_) | Home::New(_) => None,
        }
    }

    /// What the prior of number `k` is about, from where it starts: a pattern that is there or is not is there once.
    pub(super) fn expected(&self, k: usize) -> f64 {
        match self.home {
            Home::Pattern(pattern) => pattern.expected(k),
            Home::Declared(_) | Home::New(_) => 0.0,
        }
    }

    /// Whether it passes for much: patterns of what is unlisted, and smooth curves.
    pub(super) fn is_flexible(&self) -> bool {
        self.standing() == Some(Standing::Unlisted) || self.law().is_some_and(|law| law.shape == Follows::Curve)
    }

    /// Whether it names something: an effect, or a fault of the measurement.
    pub(super) fn is_named(&self) -> bool {
        matches!(self.standing(), None | Some(Standing::Fault))
    }

    /// Columns of a pattern, each with the number that it is taken with.
    pub(super) fn pattern_numbers(&self) -> impl Iterator<Item = (usize, f64)> {
        self.columns().enumerate().map(|(k, column)| (column, self.values[k] / self.typical[k]))
    }

    pub(super) fn columns(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.values.len()
    }

    /// Numbers that are bounded, and between what they lie, from their start, in prior sizes.
    pub(super) fn within(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let from_start = |k: usize, end: f64| (end - self.start[k]) / self.size(k);
        let bounded = self.bounds.iter().enumerate().filter(|(_, (low, high))| low.is_finite() || high.is_finite());
        bounded.map(move |(k, &(low, high))| (k, from_start(k, low), from_start(k, high)))
    }

    /// Typical size of number `k` under this candidate's prior.
    pub(super) fn size(&self, k: usize) -> f64 {
        self.typical[k] * self.scale
    }

    /// Whether the prior has the typical sizes themselves: no smaller twin.
    pub(super) fn is_full_size(&self) -> bool {
        self.scale >= 1.0
    }

    /// Whether it is a pattern that shifts what is measured.
    pub(super) fn is_shift(&self) -> bool {
        matches!(self.home, Home::Pattern(pattern) if !pattern.is_of_force())
    }

    pub(super) fn is_pattern(&self) -> bool {
        matches!(self.home, Home::Pattern(_))
    }
}

/// Whether two candidates are one pattern.
pub(super) fn same_pattern(a: &Candidate, b: &Candidate) -> bool {
    matches!((&a.home, &b.home), (Home::Pattern(a), Home::Pattern(b)) if a == b)
}

/// Whether two candidates are numbers of one effect that the cell declares.
pub(super) fn same_numbers(a: &Candidate, b: &Candidate) -> bool {
    matches!((&a.home, &b.home), (Home::Declared(a), Home::Declared(b)) if a == b)
}

/// Whether two candidates differ in their prior's size and their numbers' bounds only.
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

/// The arm with a candidate's numbers in place.
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

/// The effect with its fitted numbers.
pub(super) fn fitted(declared: &Arm, candidate: &Candidate) -> Option<Box<dyn Effect>> {
    match &candidate.home {
        Home::Declared(slot) => Some(declared.effects[*slot].with_values(&candidate.values)),
        Home::New(shape) => Some(shape.0.with_values(&candidate.values)),
        Home::Pattern(_) => None,
    }
}
