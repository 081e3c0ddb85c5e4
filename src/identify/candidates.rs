//! What may be added to a cell.

use super::data::Problem;
use super::pattern::{self, Pattern, Standing};
use super::smooth::{Curve, Smoothness};
use crate::effects::Shape as Follows;
use crate::effects::{Effect, KINDS, Kind, Part, Survey, joint_error_curve, kind};
use crate::equilibrium::Arm;
use crate::robot::{EXTERNAL_AXES, Joints, Unit};
use nalgebra::{DMatrix, DVector, Vector3};
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
    fn known_to(self, covariance: Option<&DMatrix<f64>>) -> Self {
        let known =
            covariance.and_then(|covariance| Smoothness::of_covariance(covariance, &self.typical)).map(Arc::new);
        Self { known, ..self }
    }

    /// What ties its numbers to one another under their prior.
    pub(super) fn precision(&self) -> Option<&Arc<Smoothness>> {
        self.curve.as_ref().map(|curve| &curve.smoothness).or(self.known.as_ref())
    }

    /// The same within what its kind says of its numbers beyond their bounds: of one sign, one candidate for each, and with a time
    /// constant that the run could show.
    fn bounded(self, kind: &Kind, survey: &Survey) -> Vec<Self> {
        /// Of the least time constant that is tried: what is over sooner is an offset from the first rows on.
        const LEAST: f64 = 0.5;
        let Home::New(shape) = &self.home else { return vec![self] };
        let names: Vec<String> = shape.0.parameters().into_iter().map(|p| p.name).collect();
        let least = survey.time.map_or(0.0, |(from, to)| LEAST * TIME_CONSTANTS[0] * (to - from));
        let of_sign = |positive: bool| {
            let mut new = self.clone();
            for (name, (low, high)) in names.iter().zip(&mut new.bounds) {
                match name.as_str() {
                    name if kind.time_constant == Some(name) => *low = low.max(least),
                    name if !kind.one_sign.contains(&name) => {}
                    _ if positive => *low = 0.0,
                    _ => *high = 0.0,
                }
            }
            new
        };
        let signs = if kind.one_sign.is_empty() { &[true][..] } else { &[true, false] };
        signs.iter().map(|&positive| of_sign(positive)).collect()
    }

    /// The candidate as a curve whose smoothness the data choose; `None` if it is no curve of one joint.
    fn into_curve(self) -> Option<Self> {
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

/// Priors of the twins of each candidate, as shares of the typical sizes: milling cells are calibrated before they cut.
const SIZES: [f64; 2] = [0.3, 0.08];
/// The same for robots seen whole by a tracker: as they left the factory, and a reflector that nobody measured.
const SIZES_WHOLE: [f64; 3] = [40.0, 6.0, 0.3];

/// Time constants that are tried, as shares of the run's length.
const TIME_CONSTANTS: [f64; 6] = [0.1, 0.2, 0.4, 0.8, 1.6, 3.0];

/// Every candidate that the data can show; `covariances` are what the cell has of its effects' numbers.
pub(super) fn all(arm: &Arm, problem: &Problem, covariances: &[Option<DMatrix<f64>>]) -> Vec<Candidate> {
    let survey = survey(arm, problem);
    let mut found: Vec<Candidate> = Vec::new();
    for (slot, effect) in arm.effects.iter().enumerate() {
        // A device frame of its own swallows the work object's.
        let like_device = kind(effect.kind()).is_some_and(|kind| kind.like_device_frame);
        if !(effect.parameters().is_empty() || problem.free_device && like_device) {
            let covariance = covariances.get(slot).and_then(Option::as_ref);
            found.push(Candidate::new(effect.as_ref(), Home::Declared(slot), 1.0).known_to(covariance));
        }
    }
    for kind in KINDS {
        let declared = arm.effects.iter().any(|effect| effect.kind() == kind.name);
        // A map is what patterns stand for here: it names no effect.
        // A device frame of its own swallows the work object's; curves over the whole robot are made below.
        let other = kind.like_device_frame || kind.shape == Follows::Curve;
        if declared || kind.shape == Follows::Map || problem.free_device && other {
            continue;
        }
        let mut variants = (kind.candidates)(&survey);
        if let Some(name) = kind.time_constant {
            variants = time_constants(variants, name, &survey);
        }
        let signs = if kind.one_sign.is_empty() { 1 } else { 2 };
        let count = (signs * variants.len().max(1)) as f64;
        let new =
            |effect: Box<dyn Effect>| Candidate::new(effect.as_ref(), Home::New(Shape(effect.clone_box())), count);
        found.extend(variants.into_iter().map(new).flat_map(|new| new.bounded(kind, &survey)));
    }
    // Effects of other sizes than the typical one compete too, on the same columns.
    let sizes = if problem.free_device { &SIZES_WHOLE[..] } else { &SIZES };
    let open = |candidate: &&mut Candidate| candidate.known.is_none();
    found.iter_mut().filter(open).for_each(|candidate| candidate.variants *= (sizes.len() + 1) as f64);
    let twin = |c: &Candidate| sizes.iter().map(|&scale| Candidate { scale, ..c.clone() }).collect::<Vec<_>>();
    let twins: Vec<Candidate> = found.iter().filter(|candidate| candidate.known.is_none()).flat_map(twin).collect();
    found.extend(twins);
    let is_curve = |effect: &dyn Effect| kind(effect.kind()).is_some_and(|kind| kind.shape == Follows::Curve);
    if problem.free_device && !arm.effects.iter().any(|effect| is_curve(effect.as_ref())) {
        found.extend(curves(&survey));
    }
    found.extend(pattern::faults(&survey, problem));
    found
}

/// The curve of every joint that moved, with knots as fine as its range allows: smoothness makes the coarser ones of it.
fn curves(survey: &Survey) -> Vec<Candidate> {
    /// Degrees: delivered robots show waves of 12° and more, and shorter ones that only many rows a degree hold.
    const SPACINGS_DEG: (f64, f64) = (1.25, 2.5);
    /// Knots of a joint from which on they are spaced wider: the work grows as their cube.
    const MOST: f64 = 100.0;
    /// A joint that moved less shows no curve, degrees.
    const LEAST_RANGE_DEG: f64 = 4.0;
    let of_joint = |joint: usize| {
        let (from, to) = (survey.motor_min[joint].to_degrees(), survey.motor_max[joint].to_degrees());
        let spacing = ((to - from) / MOST).clamp(SPACINGS_DEG.0, SPACINGS_DEG.1);
        let curve = (to - from >= LEAST_RANGE_DEG).then(|| joint_error_curve(joint + 1, from, to, spacing))?;
        Candidate::new(curve.as_ref(), Home::New(Shape(curve.clone_box())), 1.0).into_curve()
    };
    (0..6).filter_map(of_joint).collect()
}

/// Variants over time constants: the parameter of that name is searched, not fitted from nothing.
fn time_constants(variants: Vec<Box<dyn Effect>>, name: &str, survey: &Survey) -> Vec<Box<dyn Effect>> {
    let length = survey.time.map_or(0.0, |(from, to)| to - from);
    let mut out: Vec<Box<dyn Effect>> = Vec::new();
    for effect in variants {
        let parameters = effect.parameters();
        match parameters.iter().position(|p| p.name == name) {
            Some(at) if length > 0.0 => out.extend(TIME_CONSTANTS.iter().map(|share| {
                let mut values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
                values[at] = share * length;
                effect.with_values(&values)
            })),
            Some(_) => {}
            None => out.push(effect),
        }
    }
    out
}

/// Names of the units that move over the rows.
fn moving_units(problem: &Problem) -> Vec<String> {
    /// Less than this tells nothing of where a unit stands, mm or degrees.
    const LEAST: f64 = 1.0;
    let mut range = [(f64::INFINITY, f64::NEG_INFINITY); EXTERNAL_AXES];
    for row in &problem.rows {
        let Some(external) = problem.runs[row.run].external(row.point) else { continue };
        for (range, position) in range.iter_mut().zip(external).filter(|(_, position)| !position.is_nan()) {
            *range = (range.0.min(*position), range.1.max(*position));
        }
    }
    let moves = |unit: &&Unit| range[unit.axis].1 - range[unit.axis].0 > LEAST;
    problem.units.all().iter().filter(moves).map(|unit| unit.name.clone()).collect()
}

/// What the data offer.
pub(super) fn survey<'a>(arm: &'a Arm, problem: &Problem) -> Survey<'a> {
    let big = f64::INFINITY;
    let mut survey = Survey {
        robot: &arm.robot,
        stiffness_declared: arm.stiffness.is_some(),
        has_force: false,
        has_payload: false,
        has_speed: false,
        time: None,
        temperature: None,
        moving_units: moving_units(problem),
        motor_min: Joints::repeat(big),
        motor_max: Joints::repeat(-big),
        position_min: Vector3::repeat(big),
        position_max: Vector3::repeat(-big),
    };
    let widen = |range: &mut Option<(f64, f64)>, value: f64| {
        *range = Some(range.map_or((value, value), |(a, b)| (a.min(value), b.max(value))));
    };
    for row in &problem.rows {
        let point = &problem.runs[row.run].points[row.point];
        survey.has_force |= point.cuts();
        survey.has_payload |= point.payload > 0.0;
        survey.has_speed |= point.velocity != Vector3::zeros();
        widen(&mut survey.time, point.time);
        if let Some(temperature) = point.temperature {
            widen(&mut survey.temperature, temperature);
        }
        // Curves end where fitted rows do: beyond, nothing was seen. Over a part's blocks the difference is none.
        if !(row.held_out && problem.free_device) {
            survey.motor_min = survey.motor_min.inf(&row.motor);
            survey.motor_max = survey.motor_max.sup(&row.motor);
        }
        survey.position_min = survey.position_min.inf(&point.reference.translation.vector);
        survey.position_max = survey.position_max.sup(&point.reference.translation.vector);
    }
    survey.time = survey.time.filter(|(from, to)| to > from);
    survey
}

/// Whether two candidates are one pattern.
pub(super) fn same_pattern(a: &Candidate, b: &Candidate) -> bool {
    matches!((&a.home, &b.home), (Home::Pattern(a), Home::Pattern(b)) if a == b)
}

/// Whether two candidates differ in their prior's size and their numbers' bounds only.
pub(super) fn twins(a: &Candidate, b: &Candidate) -> bool {
    let same = matches!((&a.home, &b.home), (Home::Declared(a), Home::Declared(b)) if a == b)
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
