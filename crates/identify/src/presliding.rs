//! Chooses the presliding angles over which the friction in the joints builds up after a reversal: those of most
//! evidence.

use super::candidate::{Candidate, Home, Shape};
use super::data::Problem;
use super::engine::{Engine, stacked};
use super::moments::Moments;
use super::noise;
use super::pattern::Pattern;
use super::score::score;
use super::search::Search;
use super::whole_arm::SHARES;
use deflex_effects::Presliding;
use deflex_equilibrium::Dragged;
use deflex_robot::Joints;

/// Presliding angles that are tried, rad. Below the smallest positive one, a metre of arm moves by less than the
/// distance between two targets, and friction looks sharp. Above the largest, friction looks like a softer spring.
/// Neighbouring angles differ by a factor of about three, and their predictions by less than a tenth of the part that
/// they explain.
const ANGLES: [f64; 4] = [0.0, 3e-4, 1e-3, 3e-3];

/// Presliding angles with the drift of the noise under which they have most evidence, nats.
#[derive(Clone, Copy)]
struct Choice {
    presliding: Presliding,
    drift: noise::Shape,
    evidence: f64,
}

impl Problem {
    /// Sets the presliding angles, on which the direction of travel at every row depends.
    pub(super) fn set_presliding(&mut self, presliding: Presliding) {
        self.presliding = presliding;
        let into: Vec<Vec<Joints>> = self.runs.iter().map(|run| run.travels(&presliding)).collect();
        for row in &mut self.rows {
            row.probing.iter_mut().for_each(|probing| probing.set_presliding(&presliding));
            row.travel = match row.way_from {
                None => into[row.run][row.point],
                Some(from) => {
                    let points = &self.runs[row.run].points;
                    let twist = points[from].twist();
                    let from = Dragged { motor: points[from].motor, twist, travel: into[row.run][from] };
                    from.travel_to(&row.motor, &points[row.point].twist(), &presliding)
                }
            };
        }
    }
}

impl Engine {
    /// Sets the presliding angles of the rows and of all effects that can be added.
    pub(super) fn set_presliding(&mut self, presliding: Presliding) {
        self.problem.set_presliding(presliding);
        for (c, candidate) in self.candidates.iter_mut().enumerate() {
            match &mut candidate.home {
                Home::New(Shape(effect)) if effect.presliding().is_some() => {
                    *effect = effect.with_presliding(presliding);
                }
                Home::Pattern(Pattern::Direction) => {}
                _ => continue,
            }
            self.reuse.forget(c);
        }
    }

    /// Sets the presliding angles of most evidence, computed with every effect at a common share of its typical size:
    /// first one angle for all joints, then, unless friction is sharp, one for each joint in turn, with the drift of the
    /// noise that is best for the common angle. If the cell declares effects that depend on the direction of travel,
    /// their angles are kept.
    pub(super) fn choose_presliding(&mut self) {
        let has_friction = |candidate: &Candidate| match &candidate.home {
            Home::New(Shape(effect)) => effect.presliding().is_some(),
            Home::Declared(_) | Home::Pattern(_) => false,
        };
        if self.declared.follows_travel() || !self.candidates.iter().any(has_friction) {
            return;
        }
        let every: Vec<usize> = (0..self.candidates.len()).collect();
        let shapes = self.shapes_about();
        let linear = self.linearise(&every, &shapes);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let members = self.members_of_whole_arm(&search, &self.chosen);
        let mut best = Choice { presliding: Presliding::default(), drift: self.shape, evidence: f64::NEG_INFINITY };
        best = self.best_presliding(&members, ANGLES.map(Presliding::alike), &noise::few(), best);
        for joint in 0..6 {
            if best.presliding.is_sharp() {
                break;
            }
            let with = |angle| best.presliding.with(joint, angle);
            let others = ANGLES.into_iter().filter(|angle| *angle > 0.0).map(with);
            let others = others.filter(|other| *other != best.presliding);
            best = self.best_presliding(&members, others, &[best.drift], best);
        }
        self.set_presliding(best.presliding);
    }

    /// The choice of most evidence among the presliding angles that are tried, each with the best of these drifts, and the best choice so
    /// far.
    fn best_presliding(
        &mut self,
        members: &[usize],
        tried: impl IntoIterator<Item = Presliding>,
        drifts: &[noise::Shape],
        mut best: Choice,
    ) -> Choice {
        for presliding in tried {
            let choice = self.weighed(presliding, members, drifts);
            if choice.evidence > best.evidence {
                best = choice;
            }
        }
        best
    }

    /// Sets presliding angles, and finds the evidence of all members, less their price, with the best common share of their typical sizes
    /// and the best of these drifts.
    fn weighed(&mut self, presliding: Presliding, members: &[usize], drifts: &[noise::Shape]) -> Choice {
        self.set_presliding(presliding);
        let linear = self.linearise(members, &[]);
        let stacked = stacked(linear.design.kept(), &linear.data);
        let series = self.problem.series(|row| !row.held_out);
        let declared = self.problem.declared_sigma_mm;
        let of = |shape: &noise::Shape| Moments { declared, ..Moments::of(&stacked, &series, *shape) };
        let moments: Vec<Moments> = drifts.iter().map(of).collect();
        let mut best = Choice { presliding, drift: self.shape, evidence: f64::NEG_INFINITY };
        let mut sigma = self.sigma;
        for share in SHARES {
            let trial = self.trial(members, share, &linear.always);
            let score = score(&moments, &trial.columns, Some(sigma));
            sigma = score.sigma;
            let evidence = score.evidence - trial.price;
            if evidence > best.evidence {
                best = Choice { drift: drifts[score.shape], evidence, ..best };
            }
        }
        best
    }
}
