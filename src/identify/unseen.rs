//! What fitted rows say of rows that no fit has seen: some of them are left out together, and predicted by a fit to the others.

use super::columns::Columns;
use super::data::Observation;
use super::engine::{Engine, stacked};
use super::found::{Elsewhere, LeavingOut, Linearised, Refused};
use super::moments::Moments;
use super::noise;
use super::pattern::Standing;
use super::score::posterior;
use super::search::Search;
use nalgebra::DVector;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Groups of rows near one another in place, posture and load: each is left out in turn.
const GROUPS: usize = 8;

/// What is left of fitted rows, each of which was left out of a fit with all rows of its group.
pub(super) struct LeftOut {
    /// By the declared cell and by the extended one, mm: patterns that no cell has are taken off both, as far as they are listed.
    declared: DVector<f64>,
    extended: DVector<f64>,
    /// Variance of what all columns leave over the one that the fits promised.
    wider: f64,
}

/// Whose part of an error a column is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Explained {
    /// An effect: of the extended cell.
    Effect,
    /// Of the clamping, the frames or the instrument: it is in neither cell, and no error of either.
    Measurement,
    /// A pattern that no effect explains: both cells have this error.
    Unlisted,
}

/// What the fit without a group comes to on its rows.
struct Part {
    declared: DVector<f64>,
    extended: DVector<f64>,
    /// Sums of squares that all columns leave, and that the fit promised, mm².
    found: f64,
    promised: f64,
}

impl Engine {
    /// The group of every fitted row, by the row's first scalar.
    pub(super) fn groups(&self, leaving_out: LeavingOut) -> BTreeMap<usize, usize> {
        let fitted: Vec<&Observation> = self.problem.rows.iter().filter(|row| !row.held_out).collect();
        let offsets = fitted.iter().map(|row| row.offset);
        match leaving_out {
            LeavingOut::Places => {
                let places: Vec<noise::Places> = fitted.iter().map(|row| self.problem.places(row)).collect();
                offsets.zip(near_one_another(&places, self.spreads())).collect()
            }
            LeavingOut::Stretches => {
                let mut blocks = BTreeMap::new();
                let group = |row: &&Observation| {
                    let next = blocks.len();
                    *blocks.entry(self.problem.validation_block(row)).or_insert(next)
                };
                offsets.zip(fitted.iter().map(group).collect::<Vec<_>>()).collect()
            }
        }
    }

    /// What is left of fitted rows by columns that are fitted without them.
    fn left_out(&self, linear: &Linearised, columns: &Columns, leaving_out: LeavingOut) -> LeftOut {
        let groups = self.groups(leaving_out);
        let kept = linear.design.kept().select_columns(columns.list.iter().map(|column| &column.0));
        let (stacked, local) = (stacked(&kept, &linear.data), columns.numbered());
        let explained = |&(column, _): &(usize, f64)| {
            let own = self.chosen.iter().map(|&c| &self.candidates[c]).find(|own| own.columns().contains(&column));
            match own {
                Some(effect) if !effect.is_pattern() => Explained::Effect,
                Some(pattern) if pattern.standing() == Some(Standing::Unlisted) => Explained::Unlisted,
                _ => Explained::Measurement,
            }
        };
        let explained: Vec<Explained> = columns.list.iter().map(explained).collect();
        let part = |group: usize| {
            let series = self.problem.series(|row| !row.held_out && groups[&row.offset] != group);
            let (mean, covariance) = posterior(&Moments::of(&stacked, &series, self.shape), &local, self.sigma)?;
            let less = |left: &DVector<f64>, by: Explained| {
                let mut left = left.clone();
                let numbers = columns.list.iter().enumerate().filter(|(k, _)| explained[*k] == by);
                linear.design.add(numbers.map(|(k, &(column, size))| (column, -size * mean[k])), &mut left);
                left
            };
            let declared = less(&linear.data, Explained::Measurement);
            let extended = less(&declared, Explained::Effect);
            let all = less(&extended, Explained::Unlisted);
            let (mut found, mut promised) = (0.0, 0.0);
            for k in self.scalars_of(&groups, group) {
                let sizes = columns.list.iter().enumerate();
                let slope =
                    DVector::from_iterator(columns.list.len(), sizes.map(|(c, (_, size))| stacked[(k, c)] * size));
                promised += slope.dot(&(&covariance * &slope)) + self.sigma.powi(2) * (1.0 + self.shape.drift);
                found += all[k].powi(2);
            }
            Some(Part { declared, extended, found, promised })
        };
        let count = groups.values().max().map_or(0, |last| last + 1);
        let parts: Vec<Option<Part>> = (0..count).into_par_iter().map(part).collect();
        let [mut declared, mut extended] = [&linear.data; 2].map(DVector::clone);
        let (mut found, mut promised) = (0.0, 0.0);
        for (group, part) in parts.into_iter().enumerate() {
            let Some(part) = part else { continue };
            for k in self.scalars_of(&groups, group) {
                (declared[k], extended[k]) = (part.declared[k], part.extended[k]);
            }
            (found, promised) = (found + part.found, promised + part.promised);
        }
        LeftOut { declared, extended, wider: if promised > 0.0 { found / promised } else { 1.0 } }
    }

    /// The scalars of a group's rows, without those of outliers.
    fn scalars_of(&self, groups: &BTreeMap<usize, usize>, group: usize) -> impl Iterator<Item = usize> {
        let own = move |row: &&Observation| !row.outlier && groups.get(&row.offset) == Some(&group);
        self.problem.rows.iter().filter(own).flat_map(|row| row.offset..row.offset + row.seen.len())
    }

    /// The present fit, linearised, and the columns of what is chosen.
    fn linear_of_chosen(&mut self) -> (Linearised, Columns) {
        let linear = self.linearise(&self.chosen.clone(), &[]);
        let columns = Search::new(&self.candidates, &[], &linear.always).columns(&self.chosen);
        (linear, columns)
    }

    /// Errors of the extended cell at places, postures and loads that its fit has not seen. `None` over the whole robot, where held-out
    /// rows are elsewhere already.
    pub(super) fn elsewhere(&mut self) -> Option<Elsewhere> {
        if self.problem.free_device {
            return None;
        }
        let (linear, columns) = self.linear_of_chosen();
        let there = self.left_out(&linear, &columns, LeavingOut::Places);
        Some(Elsewhere { extended: self.errors(&there.extended, |row| !row.held_out), wider: there.wider })
    }

    /// Why the chosen effects are worse than none on rows that are left out, if they are: stretches of the runs, or places.
    pub(super) fn worse_where_left_out(&mut self) -> Option<Refused> {
        let (linear, columns) = self.linear_of_chosen();
        [LeavingOut::Stretches, LeavingOut::Places].into_iter().find_map(|leaving_out| {
            let there = self.left_out(&linear, &columns, leaving_out);
            let [declared_mm, extended_mm] =
                [&there.declared, &there.extended].map(|left| self.errors(left, |row| !row.held_out).rms_mm);
            (extended_mm > declared_mm).then_some(Refused { leaving_out, extended_mm, declared_mm })
        })
    }
}

/// Rows of one group each: near one another in place, posture and load (Lloyd 1982, from rows spread evenly along the table).
fn near_one_another(places: &[noise::Places], spreads: [f64; noise::OVER.len()]) -> Vec<usize> {
    /// Rounds after which rows hardly change their group.
    const LLOYD_ROUNDS: usize = 20;
    let scaled = |place: &noise::Places| -> DVector<f64> {
        DVector::from_iterator(
            9,
            (0..3).flat_map(|k| {
                let spread = if spreads[k] > 0.0 { spreads[k] } else { 1.0 };
                (place[k] / spread).iter().copied().collect::<Vec<_>>()
            }),
        )
    };
    let points: Vec<DVector<f64>> = places.iter().map(scaled).collect();
    let count = GROUPS.min(points.len());
    let mut centres: Vec<DVector<f64>> =
        (0..count).map(|g| points[g * (points.len() - 1) / (count - 1).max(1)].clone()).collect();
    let mut nearest = vec![0; points.len()];
    for _ in 0..LLOYD_ROUNDS {
        for (group, point) in nearest.iter_mut().zip(&points) {
            let apart = |g: &usize| (point - &centres[*g]).norm_squared();
            *group = (0..count).min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(0);
        }
        for (g, centre) in centres.iter_mut().enumerate() {
            let own: Vec<&DVector<f64>> =
                points.iter().zip(&nearest).filter(|(_, n)| **n == g).map(|(p, _)| p).collect();
            if !own.is_empty() {
                *centre = own.iter().fold(DVector::zeros(9), |sum, p| sum + *p) / own.len() as f64;
            }
        }
    }
    nearest
}
