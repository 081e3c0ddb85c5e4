//! The fits to rows that were not in the search: those that were set aside are judged, and the held-out rows, when they
//! have judged the answer, are evidence like the others.

use super::differences::Reuse;
use super::engine::Engine;
use super::found::Posterior;
use super::search::Search;
use deflex_effects::Shape;
use nalgebra::DVector;

/// Largest number of rows to which the written numbers are fitted again. In a denser table the rows of the search
/// determine them well enough.
const FITTED: usize = 4_000;

impl Engine {
    /// The residuals of the declared and of the extended cell at all rows, also those that were set aside for the
    /// search, mm. `before` is the residual of the declared cell at the rows of the search. The numbers are fitted again
    /// if there are not too many rows.
    pub(super) fn residuals_of_all_rows(&mut self, before: DVector<f64>) -> (DVector<f64>, DVector<f64>) {
        if self.aside.is_empty() {
            return (before, self.left_by_cell());
        }
        // The columns of the rows of the search are no longer needed.
        (self.comb, self.reuse) = (None, Reuse::of(0));
        self.problem.add_again(std::mem::take(&mut self.aside));
        self.mark_outliers();
        if self.problem.rows.len() <= FITTED {
            let map = self.map.take();
            self.refit();
            self.map = map.and_then(|map| self.renewed_map(map));
        }
        (self.problem.residual(&self.declared), self.left_by_cell())
    }

    /// Fits the chosen numbers to all rows, for the cell that is written, and computes the probabilities of the members
    /// and of their rivals from all rows. The reported errors remain those of the fit without the held-out rows. Over
    /// the whole robot, and in a dense table, the fitted rows are enough.
    pub(super) fn take_all_rows(&mut self, posteriors: &mut [Posterior]) {
        if self.problem.is_of_robot() || self.problem.rows.len() > FITTED {
            return;
        }
        let marks: Vec<(bool, bool)> = self.problem.rows.iter().map(|row| (row.held_out, row.outlier)).collect();
        let state = (self.candidates.clone(), self.covariance.clone());
        self.problem.rows.iter_mut().for_each(|row| row.held_out = false);
        let map = self.map.take();
        self.refit();
        // Of the held-out rows only blunders were marked; now that they are fitted, the limit of the fitted rows holds
        // for them.
        if self.mark_outliers() > 0 {
            self.refit();
        }
        if self.residual().iter().any(|v| !v.is_finite()) {
            (self.candidates, self.covariance) = state;
        } else if !self.is_whole_arm() {
            self.recompute_posteriors(posteriors);
        }
        self.map = map.and_then(|map| self.renewed_map(map));
        for (row, (held_out, outlier)) in self.problem.rows.iter_mut().zip(marks) {
            (row.held_out, row.outlier) = (held_out, outlier);
        }
    }

    /// Computes the posteriors of the chosen members, and over sets, about the present fit.
    pub(super) fn recompute_posteriors(&mut self, posteriors: &mut [Posterior]) {
        let shapes = self.shapes_about();
        let (all, set): (Vec<usize>, _) = ((0..self.candidates.len()).collect(), self.chosen.clone());
        let linear = self.linearise(&all, &shapes);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        search.narrow(&all);
        // A map names nothing and has no rivals.
        let named = |c: usize| self.candidates[c].law().is_none_or(|law| law.shape != Shape::Map);
        for (c, posterior) in posteriors.iter_mut().filter(|(c, _)| named(*c)) {
            *posterior = search.rivals(&set, *c);
        }
        let score = search.full(&set);
        (self.sets, self.spread) = self.posterior_over_sets(&search, &linear, &set, (score.sigma, score.shape));
        drop(linear);
        self.weigh_springs(posteriors);
    }
}
