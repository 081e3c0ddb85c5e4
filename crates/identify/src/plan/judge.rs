//! Judges a plan as `identify` will read it: d′ of each pair of kinds, and how often simulated effects are named
//! correctly.
//!
//! Each simulation has one effect of the wanted size, whose numbers are drawn from the priors, and white noise, in the
//! linear model of the planned rows. The set is searched as `identify` does it, and the held-out rows decide whether it
//! is better than none. The simulations have no drift, no outliers, no second effect and no effect that is in no list.

use super::criterion::{self, Criterion, Truth, truths};
use super::draws::Draws;
use super::{PlannedKind, PlannedPair, PlannedRow, listed};
use crate::candidate::{Candidate, Home, with};
use crate::data::Problem;
use crate::decisions::NAMED;
use crate::engine::{Engine, is_inflexible};
use crate::found::Linearised;
use crate::moments::Moments;
use crate::noise;
use crate::pattern::Pattern;
use crate::score::posterior;
use crate::search::Search;
use deflex_cell::{Cell, Instrument, PlanSection};
use deflex_effects::kind;
use deflex_measured::{MeasuredRow, Table, TargetRef};
use deflex_program::cl::ClOptions;
use deflex_program::{Language, ReadOptions};
use deflex_text::{Diagnostic, Source};
use nalgebra::{DVector, Vector3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of simulated measurements of each kind.
const SIMULATED: usize = 12;
/// Seed of the simulations, which differs from that of the truths by which the rows were chosen.
const SEED: u64 = 1_000;
/// d′ below which a pair is reported with the reason.
const HARD: f64 = 5.0;

/// The result of the judgement.
pub(super) struct Judged {
    pub(super) pairs: Vec<PlannedPair>,
    pub(super) kinds: Vec<PlannedKind>,
    pub(super) right: f64,
    pub(super) wrong: f64,
    pub(super) simulated: usize,
}

/// The result of one simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Verdict {
    /// The effect alone is named outright.
    Right,
    /// Another effect is named outright.
    Wrong,
    /// No effect is named outright.
    Open,
}

/// Judges a plan by its program and its rows, which are read as `identify` will read them.
///
/// # Errors
/// A program that cannot be read or prepared; targets that the arm reaches in another posture than planned.
pub(super) fn judge(
    cell: &Cell,
    section: &PlanSection,
    (program, language): (&str, Language),
    rows: &[PlannedRow],
    named: &[String],
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Judged, Vec<Diagnostic>> {
    let name = format!("plan.{}", language.endings()[0]);
    let options = ReadOptions { cl: &ClOptions::default(), look: false };
    let program = deflex_program::read(language, vec![Source::new(name, program.as_bytes())], Vec::new(), &options)?;
    let rows_of_table = rows.iter().map(|row| as_planned(section, row)).collect();
    let table = Table { file: "plan.csv".to_owned(), rows: rows_of_table, match_mm: None, notes: Vec::new() };
    let problem = Problem::of_runs(cell, vec![(program, table).into()])?;
    let robot = &cell.arm.robot;
    // Largest difference of an axis by the rounding in the program, degrees.
    const SAME: f64 = 1e-2;
    let elsewhere = problem.rows.iter().zip(rows).find(|(read, row)| {
        let deg = robot.axes_deg_from_motor(&read.motor);
        (0..6).any(|j| (deg[j] - row.axes_deg[j]).abs() > SAME)
    });
    if let Some((_, row)) = elsewhere {
        let message = format!("the arm would have another posture at target {} than the plan assumes", row.target);
        let help = "give `[robot] start_deg` near the middle of [plan] box_mm, with the tool upright";
        return Err(vec![Diagnostic::error("cell.plan", "", message).help(help)]);
    }
    let mut engine = Engine::new(with(&cell.arm, &[]), problem, &cell.covariances);
    let wanted: Vec<usize> = (0..engine.candidates.len()).collect();
    let linear = engine.linearise(&wanted, &noise::few());
    let laws = listed(engine.candidates.clone());
    let drift = |c: &&Candidate| matches!(c.home, Home::Pattern(Pattern::Drift { settles: None }));
    let drift = engine.candidates.iter().find(drift).into_iter().flat_map(Candidate::columns);
    let nuisance = linear.always.iter().copied().chain(drift).collect();
    let axes = engine.problem.scalars / rows.len().max(1);
    let mut criterion = Criterion::new(&laws, named, nuisance, (section.noise_mm, axes));
    let columns = linear.design.kept();
    criterion.scale(columns, section.effect_mm);
    let weights: Vec<f64> = engine.problem.rows.iter().map(|row| f64::from(u8::from(!row.held_out))).collect();
    let distances = criterion.discrimination(columns, &weights).distance;
    let pair = |(a, b, d_prime): (usize, usize, f64)| PlannedPair {
        a: criterion.kinds[a].clone(),
        b: criterion.kinds[b].clone(),
        d_prime,
        why: (d_prime < HARD).then(|| why(&criterion.kinds[a], &criterion.kinds[b])),
    };
    let pairs = criterion.pairs(&distances, named.len()).into_iter().map(pair).collect();
    let mut tried = truths(&laws, named, SEED, SIMULATED);
    criterion::scale(&mut tried, columns, axes, section.effect_mm);
    let simulation = Simulation { engine: &engine, linear: &linear, noise_mm: section.noise_mm };
    let done = AtomicUsize::new(0);
    let verdicts: Vec<Verdict> = tried
        .par_iter()
        .enumerate()
        .map(|(number, truth)| {
            let verdict = simulation.run(truth, &named[truth.kind], number as u64);
            progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / tried.len() as f64);
            verdict
        })
        .collect();
    // The expected probability under Jeffreys' prior (1946), because a dozen draws cannot show that a probability is 0
    // or 1.
    let chance = |of: &dyn Fn(usize) -> bool, verdict: Verdict| {
        let all = || tried.iter().zip(&verdicts).filter(|(truth, _)| of(truth.kind));
        let count = all().filter(|(_, found)| **found == verdict).count() as f64;
        (count + 0.5) / (all().count() as f64 + 1.0)
    };
    let of_kind = |kind: usize| PlannedKind {
        kind: named[kind].clone(),
        d_prime: criterion.distance_from_none(&distances, kind),
        chance_right: chance(&|of| of == kind, Verdict::Right),
        chance_wrong: chance(&|of| of == kind, Verdict::Wrong),
    };
    let mut kinds: Vec<PlannedKind> = (0..named.len()).map(of_kind).collect();
    kinds.sort_by(|a, b| a.chance_right.total_cmp(&b.chance_right));
    // Each kind is simulated equally often, so that the mean over all simulations is the mean over the kinds.
    let (right, wrong) = (chance(&|_| true, Verdict::Right), chance(&|_| true, Verdict::Wrong));
    Ok(Judged { pairs, kinds, right, wrong, simulated: tried.len() })
}

/// A planned row as if it were measured exactly at its programmed place.
fn as_planned(section: &PlanSection, row: &PlannedRow) -> MeasuredRow {
    let there = Vector3::from(row.position_mm);
    let mut measured = MeasuredRow {
        line: u64::from(row.target) + 1,
        target: Some(TargetRef::Ordinal(row.target)),
        force_n: Some(row.load_n),
        time_s: Some(row.time_s),
        ..MeasuredRow::default()
    };
    match (section.instrument, section.from) {
        (Instrument::Normal, _) => measured.normal_mm = Some(0.0),
        (Instrument::Distance, Some(from)) => measured.distance_mm = Some((there - from * 1e3).norm()),
        _ => measured.position_mm = Some(row.position_mm),
    }
    measured
}

/// Simulates measurements of single effects on the planned rows.
struct Simulation<'a> {
    engine: &'a Engine,
    linear: &'a Linearised,
    noise_mm: f64,
}

impl Simulation<'_> {
    /// The result of the simulation with this number, for an effect of the kind `name`.
    fn run(&self, truth: &Truth, name: &str, number: u64) -> Verdict {
        let mut draws = Draws::of(SEED + number);
        let mut data = truth.trace(self.linear.design.kept());
        data.iter_mut().for_each(|value| *value += self.noise_mm * draws.normal());
        let series = self.engine.problem.series(|row| !row.held_out);
        let moments: Vec<Moments> =
            self.linear.moments.iter().map(|m| m.clone().with_data(&self.linear.design, &data, &series)).collect();
        let search = Search::new(&self.engine.candidates, &moments, &self.linear.always);
        let set = search.best(&[], &is_inflexible);
        let score = search.full(&set);
        let columns = search.columns(&set);
        let mut left = data.clone();
        if let Some((mean, _)) = posterior(&moments[score.shape], &columns, score.sigma) {
            let numbers = columns.list.iter().zip(mean.iter()).map(|(&(column, size), value)| (column, -value * size));
            self.linear.design.add(numbers, &mut left);
        }
        let held_out = |left: &DVector<f64>| self.engine.errors(left, |row| row.held_out).rms_mm;
        if set.is_empty() || held_out(&left) > held_out(&data) {
            return Verdict::Open;
        }
        let sure = |c: usize| search.rivals(&set, c).0 >= NAMED;
        let (patterns, effects): (Vec<usize>, Vec<usize>) =
            set.iter().partition(|&&c| self.engine.candidates[c].is_pattern());
        let other = |&&c: &&usize| self.engine.candidates[c].kind != name;
        match () {
            () if effects.iter().filter(other).any(|&c| sure(c)) => Verdict::Wrong,
            () if patterns.is_empty()
                && effects.len() == 1
                && !effects.iter().any(|c| other(&c))
                && sure(effects[0]) =>
            {
                Verdict::Right
            }
            () => Verdict::Open,
        }
    }
}

/// The reason why two kinds are hard to distinguish.
fn why(a: &str, b: &str) -> &'static str {
    let (Some(one), Some(other)) = (kind(a), kind(b)) else { return "" };
    let nested = one.nested_in.contains(&b) || other.nested_in.contains(&a);
    let local = one.locally_like.contains(&b) || other.locally_like.contains(&a);
    match () {
        () if nested => {
            "every effect of the one kind is also one of the other: no rows can distinguish them with certainty"
        }
        () if local => {
            "alike while each joint turns over a small range only: a larger box, or more tilt, would distinguish them"
        }
        () if one.bends_under_load && other.bends_under_load => {
            "both follow the load: more loads in other directions, and more tilt under load, would distinguish them"
        }
        () if one.like_device_frame || other.like_device_frame => {
            "wrong frames look alike in a small area: a larger box, more tilt, or more turns about the tool axis would distinguish them"
        }
        () => "alike on these rows: more rows, a larger box, more tilt, or less noise would distinguish them",
    }
}
