//! Cross-validation on the fitted rows: groups of them are left out in turn, and are predicted by a fit to the others.

use super::columns::Columns;
use super::data::Observation;
use super::engine::{Engine, stacked};
use super::found::{Elsewhere, LeavingOut, Linearised, Refused};
use super::moments::Moments;
use super::noise;
use super::pattern::Consequence;
use super::score::posterior;
use super::search::Search;
use nalgebra::DVector;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Number of groups of rows that are near one another in place, posture and load.
const GROUPS: usize = 8;

/// Residuals of the fitted rows, each predicted by a fit without the rows of its group.
pub(super) struct LeftOut {
    /// Residual of the declared cell, mm, without clampings, frames and faults of the measurement.
    declared: DVector<f64>,
    /// Residual of the extended cell, mm, without the same.
    pub(super) extended: DVector<f64>,
    /// Variance of the residual of all columns, relative to the variance that the fits predict.
    wider: f64,
}

/// What a column describes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Explained {
    /// An effect of the extended cell.
    Effect,
    /// The clamping, a frame, the instrument or a fault of the measurement. It is an error of neither cell.
    Measurement,
    /// A pattern that no effect explains. It is an error of both cells.
    Unlisted,
}

/// The result of the fit without one group, at the rows of the group.
struct GroupFit {
    declared: DVector<f64>,
    extended: DVector<f64>,
    /// Sum of the squared residuals of all columns, mm².
    found: f64,
    /// The expectation of this sum under the fit, mm².
    predicted: f64,
}

impl Engine {
    /// The group of every fitted row, by the index of the row's first scalar.
    pub(super) fn groups(&self, leaving_out: LeavingOut) -> BTreeMap<usize, usize> {
        let fitted: Vec<&Observation> = self.problem.rows.iter().filter(|row| !row.held_out).collect();
        let offsets = fitted.iter().map(|row| row.offset);
        match leaving_out {
            LeavingOut::Places => {
                let places: Vec<noise::Places> = fitted.iter().map(|row| self.problem.places(row)).collect();
                offsets.zip(clusters(&places, self.spreads())).collect()
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

    /// The residuals of the fitted rows by the columns of a set, each fitted without the group of the row.
    pub(super) fn left_out(&self, linear: &Linearised, columns: &Columns, leaving_out: LeavingOut) -> LeftOut {
        let groups = self.groups(leaving_out);
        let kept = linear.design.kept().select_columns(columns.list.iter().map(|column| &column.0));
        let (stacked, local) = (stacked(&kept, &linear.data), columns.numbered());
        let explained = |&(column, _): &(usize, f64)| {
            let own = self.chosen.iter().map(|&c| &self.candidates[c]).find(|own| own.columns().contains(&column));
            match own {
                Some(effect) if !effect.is_pattern() => Explained::Effect,
                Some(pattern) if pattern.consequence() == Some(Consequence::Unlisted) => Explained::Unlisted,
                _ => Explained::Measurement,
            }
        };
        let explained: Vec<Explained> = columns.list.iter().map(explained).collect();
        let fit_without = |group: usize| {
            let series = self.problem.series(|row| !row.held_out && groups[&row.offset] != group);
            let (mean, covariance) =
                posterior(&Moments::of(&stacked, &series, self.shape), &local, self.sigma_of_fit())?;
            let less = |left: &DVector<f64>, by: Explained| {
                let mut left = left.clone();
                let numbers = columns.list.iter().enumerate().filter(|(k, _)| explained[*k] == by);
                linear.design.add(numbers.map(|(k, &(column, size))| (column, -size * mean[k])), &mut left);
                left
            };
            let declared = less(&linear.data, Explained::Measurement);
            let extended = less(&declared, Explained::Effect);
            let all = less(&extended, Explained::Unlisted);
            let (mut found, mut predicted) = (0.0, 0.0);
            for k in self.scalars_of(&groups, group) {
                let sizes = columns.list.iter().enumerate();
                let slope =
                    DVector::from_iterator(columns.list.len(), sizes.map(|(c, (_, size))| stacked[(k, c)] * size));
                predicted += slope.dot(&(&covariance * &slope)) + self.sigma.powi(2) * (1.0 + self.shape.drift);
                found += all[k].powi(2);
            }
            Some(GroupFit { declared, extended, found, predicted })
        };
        let count = groups.values().max().map_or(0, |last| last + 1);
        let fits: Vec<Option<GroupFit>> = (0..count).into_par_iter().map(fit_without).collect();
        let [mut declared, mut extended] = [&linear.data; 2].map(DVector::clone);
        let (mut found, mut predicted) = (0.0, 0.0);
        for (group, fit) in fits.into_iter().enumerate() {
            let Some(fit) = fit else { continue };
            for k in self.scalars_of(&groups, group) {
                (declared[k], extended[k]) = (fit.declared[k], fit.extended[k]);
            }
            (found, predicted) = (found + fit.found, predicted + fit.predicted);
        }
        LeftOut { declared, extended, wider: if predicted > 0.0 { found / predicted } else { 1.0 } }
    }

    /// Indices of the scalars of the positions of a group's rows, without outliers.
    fn scalars_of(&self, groups: &BTreeMap<usize, usize>, group: usize) -> impl Iterator<Item = usize> {
        let own = move |row: &&Observation| !row.outlier && groups.get(&row.offset) == Some(&group);
        self.problem.rows.iter().filter(own).flat_map(|row| row.offset..row.offset + row.reading.len())
    }

    /// The present fit, linearised, and the columns of the chosen set.
    fn linear_of_chosen(&mut self) -> (Linearised, Columns) {
        let linear = self.linearise(&self.chosen.clone(), &[]);
        let columns = Search::new(&self.candidates, &[], &linear.always).columns(&self.chosen);
        (linear, columns)
    }

    /// Errors of the extended cell at places, postures and loads that its fit has not seen. `None` over the whole
    /// robot, where the held-out rows are already at such places.
    pub(super) fn elsewhere(&mut self) -> Option<Elsewhere> {
        if self.problem.is_of_robot() {
            return None;
        }
        let (linear, columns) = self.linear_of_chosen();
        let there = self.left_out(&linear, &columns, LeavingOut::Places);
        Some(Elsewhere { extended: self.errors(&there.extended, |row| !row.held_out), wider: there.wider })
    }

    /// The errors on rows that are left out by stretches or by places, if the error of the extended cell there is
    /// larger than that of the declared cell.
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

/// The group of each row, so that the rows of a group are near one another in place, posture and load: k-means by the
/// algorithm of Lloyd (1982), which begins with rows that are spread evenly along the table.
fn clusters(places: &[noise::Places], spreads: [f64; noise::OVER.len()]) -> Vec<usize> {
    /// Number of rounds, after which rows hardly change their group.
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
