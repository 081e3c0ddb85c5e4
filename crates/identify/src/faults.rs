//! Adds the fault of the table that the model leaves open.
//!
//! The search of sets does not try faults of the forces: under wrong forces a few effects imitate almost any fault, and
//! under sound forces a fault imitates the errors of their laws. Such a fault is compared with the whole model instead,
//! on rows that neither has seen.

use super::candidates;
use super::decisions::{FAULT_GAIN, MATERIAL};
use super::engine::Engine;
use super::found::LeavingOut;
use super::noise::Shape;
use super::pattern::Consequence;
use super::search::Search;

/// Number of faults that are fitted together with all members. On five cells of another plant with a turned or swapped
/// column the right fault was among them.
const FITTED: usize = 3;

impl Engine {
    /// Adds the fault of the table to the chosen members that gains most, if it reduces the mean square error at places,
    /// postures and loads left out of the fit by a material share.
    pub(super) fn add_fault(&mut self) {
        let survey = candidates::survey(&self.declared, &self.problem);
        let first = self.candidates.len();
        self.candidates.extend(candidates::force_faults(&survey, &self.problem));
        let members = self.chosen.clone();
        let is_open = |c: &usize| {
            let candidate = &self.candidates[*c];
            let differs = |&m: &usize| self.candidates[m].family != candidate.family;
            candidate.consequence() == Some(Consequence::Fault) && members.iter().all(differs)
        };
        let faults: Vec<usize> = (0..self.candidates.len()).filter(is_open).collect();
        // With the right fault, the discrepancy that stood for it is no longer needed.
        let mut shapes = vec![self.shape];
        shapes.extend(self.shape.field.map(|_| Shape { field: None, ..self.shape }));
        let linear = self.linearise(&[&members[..], &faults].concat(), &shapes);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let with = |c: usize| [&members[..], &[c]].concat();
        let evidence = |set: &[usize]| search.near(set, Some(self.sigma)).evidence;
        let value = evidence(&members);
        let least = FAULT_GAIN * (value - evidence(&[])).max(0.0);
        let mut gains: Vec<(f64, usize)> = faults
            .iter()
            .map(|&c| (evidence(&with(c)) - value - search.price(c), c))
            .filter(|(gain, _)| *gain > least)
            .collect();
        gains.sort_by(|a, b| b.0.total_cmp(&a.0));
        gains.truncate(FITTED);
        let unseen = |set: &[usize]| {
            let left = self.left_out(&linear, &search.columns(set), LeavingOut::Places);
            self.errors(&left.extended, |row| !row.held_out).rms_mm.powi(2)
        };
        // On most tables no fault gains enough, and nothing is left out.
        let most = if gains.is_empty() { 0.0 } else { (1.0 - MATERIAL) * unseen(&members) };
        let tried = gains.into_iter().map(|(_, c)| c).filter(|&c| unseen(&with(c)) < most).collect();
        let fault = self.best_fitted(&members, tried);
        let new = fault.filter(|&c| c >= first).map(|c| self.candidates[c].clone());
        self.candidates.truncate(first);
        self.candidates.extend(new);
        if let Some(fault) = fault {
            self.choose([members, vec![fault.min(first)]].concat());
        }
    }

    /// The fault with which the members have most evidence when all numbers are fitted together with it. Numbers that were fitted under wrong
    /// forces are so far off that the columns about them confuse the faults.
    fn best_fitted(&mut self, members: &[usize], faults: Vec<usize>) -> Option<usize> {
        if faults.len() < 2 {
            return faults.first().copied();
        }
        let (candidates, chosen) = (self.candidates.clone(), self.chosen.clone());
        let mut best: Option<(f64, usize)> = None;
        for fault in faults {
            let set = [members, &[fault]].concat();
            self.choose(set.clone());
            let linear = self.linearise(&set, &[Shape { field: None, ..self.shape }]);
            let search = Search::new(&self.candidates, &linear.moments, &linear.always);
            let evidence = search.near(&set, None).evidence - search.price(fault);
            if best.is_none_or(|(most, _)| evidence > most) {
                best = Some((evidence, fault));
            }
            (self.candidates, self.chosen) = (candidates.clone(), chosen.clone());
        }
        best.map(|(_, fault)| fault)
    }
}
