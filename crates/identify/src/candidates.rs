//! Makes the candidates of an identification: all effects and patterns that the rows can show.

use super::candidate::{Candidate, Home, Shape};
use super::data::{Observation, Problem};
use super::pattern::{MIXED, MIXED_SPREAD, Pattern, SETTLES, Slips};
use super::returns::never_returns;
use deflex_effects::Shape as Follows;
use deflex_effects::{Cutting, Effect, KINDS, Kind, Survey, joint_error_curve, kind};
use deflex_equilibrium::Arm;
use deflex_robot::{EXTERNAL_AXES, Joints, Unit};
use nalgebra::{DMatrix, Vector3};

/// Number of rows of a run, evenly spaced, at which a jump is a candidate before its row is searched.
const JUMPS: usize = 16;
/// Prior sizes of clampings, as shares of the sizes of a clamping: a part that is probed, placed against stops, or
/// placed by hand.
const CLAMPED_SIZES: [f64; 3] = [0.25, 1.0, 5.0];
/// Prior sizes of drifts, as shares of the size of a drift: an instrument that has settled, and one that warms up.
const DRIFT_SIZES: [f64; 2] = [1.0, 5.0];
/// Prior sizes of the twins of each candidate, as shares of the typical sizes: most milling cells are calibrated, and a
/// few are far off. Without the large size, a second effect would describe what a number cannot reach.
const SIZES: [f64; 3] = [0.3, 0.08, 4.0];
/// The same for numbers with a covariance from an earlier identification, which already states how far off they may be.
const SIZES_IDENTIFIED: [f64; 2] = [0.3, 0.08];
/// The same for poses over the whole robot. The large ones are for robots that were not calibrated, and for reflectors
/// whose position was not measured.
const SIZES_WHOLE: [f64; 3] = [40.0, 6.0, 0.3];

/// Time constants that are tried, as shares of the duration of the run.
const TIME_CONSTANTS: [f64; 6] = [0.1, 0.2, 0.4, 0.8, 1.6, 3.0];

/// All candidates that the rows can show. `covariances` has, for each effect of the arm, the covariance of its numbers
/// if the cell has one.
pub(super) fn all(arm: &Arm, problem: &Problem, covariances: &[Option<DMatrix<f64>>]) -> Vec<Candidate> {
    let survey = survey(arm, problem);
    let mut found: Vec<Candidate> = Vec::new();
    for (slot, effect) in arm.effects.iter().enumerate() {
        // The frame of the device is fitted in any case, and the frame of the work object looks the same.
        let like_device = kind(effect.kind()).is_some_and(|kind| kind.like_device_frame);
        if !(effect.parameters().is_empty() || problem.is_of_robot() && like_device) {
            // The instrument is registered to the part anew for every measurement, and the part may have been clamped
            // anew. So the covariance of the frame from an earlier measurement says nothing about the frame of this one.
            let covariance = covariances.get(slot).and_then(Option::as_ref).filter(|_| !like_device);
            found.push(Candidate::new(effect.as_ref(), Home::Declared(slot), 1.0).known_to(covariance));
        }
    }
    for kind in KINDS {
        let declared = arm.effects.iter().any(|effect| effect.kind() == kind.name);
        // For the frame see above; curves over the whole robot are made below.
        let other = kind.like_device_frame || kind.shape == Follows::Curve;
        if declared || problem.is_of_robot() && other {
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
        found.extend(variants.into_iter().map(new).flat_map(|new| bounded(new, kind, &survey)));
    }
    // Each candidate has twins with other prior sizes, which have the same columns.
    let sizes = |candidate: &Candidate| match candidate.known {
        None if problem.is_of_robot() => &SIZES_WHOLE[..],
        None => &SIZES,
        Some(_) => &SIZES_IDENTIFIED,
    };
    found.iter_mut().for_each(|candidate| candidate.variants *= (sizes(candidate).len() + 1) as f64);
    let twin = |c: &Candidate| sizes(c).iter().map(|&scale| Candidate { scale, ..c.clone() }).collect::<Vec<_>>();
    let twins: Vec<Candidate> = found.iter().flat_map(twin).collect();
    found.extend(twins);
    let is_curve = |effect: &dyn Effect| kind(effect.kind()).is_some_and(|kind| kind.shape == Follows::Curve);
    if problem.is_of_robot() && !arm.effects.iter().any(|effect| is_curve(effect.as_ref())) {
        found.extend(curves(&survey));
    }
    found.extend(faults(problem));
    if never_returns(problem) {
        found.iter_mut().filter(|candidate| candidate.has_time_constant()).for_each(|candidate| {
            // If the arm never returns, all functions of time look alike, and they are one family with the drift.
            candidate.family = Pattern::Drift { settles: None }.family();
        });
    }
    found
}

/// A candidate with the bounds that its kind requires: its time constant is not too short for the run, and numbers that
/// must have the same sign make one candidate for each sign.
fn bounded(candidate: Candidate, kind: &Kind, survey: &Survey) -> Vec<Candidate> {
    /// Lowest time constant, as a share of the shortest one that is tried. A shorter one would be a constant offset
    /// from the first rows on.
    const SHORTEST: f64 = 0.5;
    let Home::New(shape) = &candidate.home else { return vec![candidate] };
    let names: Vec<String> = shape.0.parameters().into_iter().map(|p| p.name).collect();
    let least = survey.time.map_or(0.0, |(from, to)| SHORTEST * TIME_CONSTANTS[0] * (to - from));
    let of_sign = |positive: bool| {
        let mut new = candidate.clone();
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

/// The curve of every joint that moved, with knots as fine as its range allows; coarser curves differ only in their
/// smoothness.
fn curves(survey: &Survey) -> Vec<Candidate> {
    /// Smallest and largest spacing of knots, degrees. The errors of delivered robots have waves of 12° and more, and
    /// shorter ones that only many rows for each degree determine.
    const SPACINGS_DEG: (f64, f64) = (1.25, 2.5);
    /// Number of knots of a joint beyond which the spacing is increased, because the work grows as its cube.
    const MOST_KNOTS: f64 = 100.0;
    /// Smallest range of a joint that can show a curve, degrees.
    const LEAST_RANGE_DEG: f64 = 4.0;
    let of_joint = |joint: usize| {
        let (from, to) = (survey.motor_min[joint].to_degrees(), survey.motor_max[joint].to_degrees());
        let spacing = ((to - from) / MOST_KNOTS).clamp(SPACINGS_DEG.0, SPACINGS_DEG.1);
        let curve = (to - from >= LEAST_RANGE_DEG).then(|| joint_error_curve(joint + 1, from, to, spacing))?;
        Candidate::new(curve.as_ref(), Home::New(Shape(curve.clone_box())), 1.0).into_curve()
    };
    (0..6).filter_map(of_joint).collect()
}

/// The variants with each time constant that is tried. The time constant is the parameter with this name, which a fit
/// cannot find from a neutral start. Without a duration there are no such variants.
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

/// Names of the mechanical units that move over the rows.
fn moving_units(problem: &Problem) -> Vec<String> {
    /// Smallest motion of a unit that can show its position, mm or degrees.
    const LEAST_TRAVEL: f64 = 1.0;
    let mut range = [(f64::INFINITY, f64::NEG_INFINITY); EXTERNAL_AXES];
    for row in &problem.rows {
        let Some(external) = problem.runs[row.run].external(row.point) else { continue };
        for (range, position) in range.iter_mut().zip(external).filter(|(_, position)| !position.is_nan()) {
            *range = (range.0.min(*position), range.1.max(*position));
        }
    }
    let moves = |unit: &&Unit| range[unit.axis].1 - range[unit.axis].0 > LEAST_TRAVEL;
    problem.units.all().iter().filter(moves).map(|unit| unit.name.clone()).collect()
}

/// The quantities that the rows contain, on which the candidates of each kind depend.
pub(super) fn survey(arm: &Arm, problem: &Problem) -> Survey {
    let big = f64::INFINITY;
    let mut survey = Survey {
        axes: arm.robot.axes,
        stiffness_declared: arm.stiffness.is_some(),
        part_declared: false,
        clamps: 0,
        has_force: false,
        has_cut_length: problem.has_cut_length,
        cut_mm: None,
        has_payload: false,
        has_speed: false,
        time: None,
        temperature: None,
        moving_units: moving_units(problem),
        motor_min: Joints::repeat(big),
        motor_max: Joints::repeat(-big),
    };
    let widen = |range: &mut Option<(f64, f64)>, value: f64| {
        *range = Some(range.map_or((value, value), |(a, b)| (a.min(value), b.max(value))));
    };
    for row in &problem.rows {
        let point = &problem.runs[row.run].points[row.point];
        if let Some(part) = point.yielding_part() {
            survey.part_declared = true;
            survey.clamps = part.clamps();
        }
        if point.cuts() {
            survey.has_force = true;
            let place_mm = 1e3 * point.reference.translation.vector;
            let ranges = survey.cut_mm.get_or_insert([[f64::INFINITY, f64::NEG_INFINITY]; 2]);
            for (range, place) in ranges.iter_mut().zip(place_mm.iter()) {
                *range = [range[0].min(*place), range[1].max(*place)];
            }
        }
        survey.has_payload |= point.payload > 0.0;
        survey.has_speed |= point.velocity != Vector3::zeros();
        // The surface of a finished part does not say when it was cut: the program may have waited, or run more than once.
        if problem.read_in_order {
            widen(&mut survey.time, point.time);
        }
        if let Some(temperature) = point.temperature {
            widen(&mut survey.temperature, temperature);
        }
        // Curves cover only the range of the fitted rows. For parts the blocks are so small that it makes no
        // difference.
        if !(row.held_out && problem.is_of_robot()) {
            survey.motor_min = survey.motor_min.inf(&row.motor);
            survey.motor_max = survey.motor_max.sup(&row.motor);
        }
    }
    survey.time = survey.time.filter(|(from, to)| to > from);
    survey
}

/// The candidate of a pattern, which is one of `variants`.
fn of_pattern(pattern: Pattern, problem: &Problem, variants: f64) -> Candidate {
    let scale = if pattern.expected(0) > 0.0 { MIXED_SPREAD } else { 1.0 };
    Candidate { variants, scale, ..Candidate::pattern(pattern, pattern.size(problem)) }
}

/// The candidates of a jump before a row of a run: of the part as a whole or the instrument, and of each clamp of the
/// part.
pub(super) fn jumps(problem: &Problem, run: usize, order: usize) -> Vec<Candidate> {
    // A part with one clamp moves as a whole with it.
    let clamps = Some(clamps(problem)).filter(|clamps| *clamps > 1).unwrap_or(0);
    // A shift of the whole part before the first row is its clamping and no jump.
    let all = Some(Slips::All).filter(|_| order > 0);
    let count = (problem.rows.len() * (1 + clamps)) as f64;
    let slips = all.into_iter().chain((0..clamps).map(Slips::Clamp));
    slips.map(|slips| of_pattern(Pattern::Jump { run, order, slips }, problem, count)).collect()
}

/// Number of clamps of the part, if the cell declares how it yields with them; zero otherwise.
fn clamps(problem: &Problem) -> usize {
    let of_row = |row: &Observation| problem.runs[row.run].points[row.point].clamps();
    problem.rows.iter().map(of_row).max().unwrap_or(0)
}

/// Clampings and faults that the rows can show, except those of the forces; none over the whole robot.
pub(super) fn faults(problem: &Problem) -> Vec<Candidate> {
    if problem.is_of_robot() {
        return Vec::new();
    }
    let mut all = Vec::new();
    if problem.runs.len() > 1 {
        let clamping = of_pattern(Pattern::Clamping, problem, 1.0);
        all.extend(CLAMPED_SIZES.map(|scale| Candidate { scale, ..clamping.clone() }));
    }
    let bends = || std::iter::once(None).chain((0..SETTLES.len()).map(Some));
    let count = (bends().count() * DRIFT_SIZES.len()) as f64;
    for settles in bends().filter(|_| problem.read_in_order) {
        let drift = of_pattern(Pattern::Drift { settles }, problem, count);
        all.extend(DRIFT_SIZES.map(|scale| Candidate { scale, ..drift.clone() }));
    }
    for run in 0..problem.runs.len() {
        let count = problem.rows.iter().filter(|row| row.run == run).count();
        all.extend((0..JUMPS).flat_map(|at| jumps(problem, run, at * count / JUMPS)));
    }
    all
}

/// Most rows by which a table can give the forces early or late: half a second of a filter or a buffer, for targets that
/// are 2 mm apart at 40 mm/s.
const MOST_LATE: isize = 10;

/// Faults of the forces that the rows can show.
pub(super) fn force_faults(survey: &Survey, problem: &Problem) -> Vec<Candidate> {
    // Forces that follow from a law or a stock are no readings.
    let read = |row: &Observation| {
        let run = &problem.runs[row.run];
        !run.follows_stock() && matches!(run.situation(row.point).cutting, Cutting::Constant(_))
    };
    if !survey.has_force || !survey.stiffness_declared || !problem.rows.iter().any(read) {
        return Vec::new();
    }
    let count = MIXED.len() as f64;
    let mixed = (0..MIXED.len()).map(|which| of_pattern(Pattern::MixedForce(which), problem, count));
    let lags = (1..=MOST_LATE).flat_map(|by| [by, -by]);
    let late = lags.map(|by| of_pattern(Pattern::LateForce(by), problem, (2 * MOST_LATE) as f64));
    mixed.chain([of_pattern(Pattern::Crosstalk, problem, 1.0)]).chain(late).collect()
}

/// Patterns of effects in no list that the rows can show.
pub(super) fn unlisted(survey: &Survey, problem: &Problem) -> Vec<Candidate> {
    let mut all: Vec<Pattern> = (0..6).map(Pattern::Joint).collect();
    if survey.time.is_some() {
        all.push(Pattern::Time);
    }
    if survey.has_force {
        all.push(Pattern::Force);
    }
    all.push(Pattern::Direction);
    all.into_iter().map(|pattern| of_pattern(pattern, problem, 1.0)).collect()
}
