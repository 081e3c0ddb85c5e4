//! The compliance at any number of places, from the displacements under forces at a few of them.
//!
//! What a body does under a force is mostly a sum of a few smooth motions, whatever the place of the force; what is left is
//! local, and changes slowly from place to place. The displacements that have been solved for span a space, in which Galerkin's
//! answer to a force anywhere is had at the price of some sums. Of that space the map takes the motions that move the surface
//! most, half as many as there are places, and between places it interpolates what they lack at these: mode superposition with
//! residual compliance, as structural dynamics has it. Places are added, the furthest from those before first, until the map
//! from before agrees with what is solved for at them.
//!
//! When material goes, the displacements of the stage before span most of what is wanted still: they are kept, and places are
//! solved for only until the map agrees with them again.

use crate::body::{Body, Solved, Spot, unit};
use crate::level::{LANES, Level, Node, Vector, ZERO};
use nalgebra::{DMatrix, Matrix3, SMatrix, SymmetricEigen, Vector3};
use rayon::prelude::*;

/// How close a map comes to what would be solved for at each place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Share of the largest compliance at the place, in its softest direction.
    pub relative: f64,
    /// What is less than this, mm/N, is as good as nothing.
    pub absolute: f64,
    /// No more fields than this are kept, three for each place that is solved for.
    pub most_fields: usize,
}

impl Default for Accuracy {
    /// 3 %, or 30 nm/N: 6 µm under the 200 N that a robot mills with, a tenth of what it repeats itself to.
    fn default() -> Self {
        Self { relative: 0.03, absolute: 3e-5, most_fields: 180 }
    }
}

/// Numbers that all fields together may have: 0.7 GB.
const NUMBERS: usize = 90_000_000;
/// Places that are added together: 24 loads, three rounds of eight.
const TOGETHER: usize = LANES;
/// A field that keeps less than this share of its energy beyond the others adds nothing but rounding.
const NOTHING_NEW: f64 = 1e-10;
/// Nodes that a task takes at once.
const CHUNK: usize = 512;

type Field = Vec<[f64; 3]>;

/// The compliance over the surface of a body.
pub struct ComplianceMap {
    /// Orthonormal in energy.
    fields: Vec<Field>,
    /// Nodes of the whole grid that they are of, by number.
    nodes: Vec<u32>,
    /// Combinations of fields, by column: the motions that move the surface most.
    motions: DMatrix<f64>,
    /// Places that have been solved for in the stages before.
    earlier: Vec<[f64; 3]>,
    /// Places that have been solved for, the compliance there, and what of it the motions lack.
    solved: Vec<Place>,
    rounds: usize,
    error: f64,
    off: f64,
}

/// A place that has been solved for.
struct Place {
    at: [f64; 3],
    compliance: Matrix3<f64>,
    /// What the motions lack there.
    lacks: Matrix3<f64>,
}

impl ComplianceMap {
    /// The map over places on the surface of a body (mm): any of these, and others between them, can be looked up in it.
    ///
    /// `before` is the map of the same grid with more material or other clamps.
    #[must_use]
    pub fn over(body: &Body, places: &[[f64; 3]], accuracy: &Accuracy, before: Option<Self>) -> Self {
        let most = accuracy.most_fields.min(NUMBERS / (3 * body.fine().len())).max(3 * TOGETHER);
        let mut map = Self::empty(body);
        if let Some(before) = before {
            map.take_over(body, before, most.saturating_sub(3 * TOGETHER));
        }
        let mut order = Furthest::new(places, &map.earlier, body);
        let surface: Vec<Spot> = order.sparse().map(|place| body.spread(*place)).collect();
        map.set_motions(body, &surface);
        while map.fields.len() + 3 * TOGETHER <= most {
            let next: Vec<[f64; 3]> = std::iter::from_fn(|| order.next()).take(TOGETHER).collect();
            if next.is_empty() {
                // All of them have been solved for.
                (map.error, map.off) = (0.0, 0.0);
                break;
            }
            let spots: Vec<Spot> = next.iter().map(|place| body.spread(*place)).collect();
            let guess = |(spot, place): (&Spot, &[f64; 3])| map.moves(spot) + map.rest(place);
            let guesses: Vec<Matrix3<f64>> = spots.iter().zip(&next).map(guess).collect();
            let found = map.solve(body, &spots);
            let place = |(at, compliance)| Place { at, compliance, lacks: Matrix3::zeros() };
            map.solved.extend(next.into_iter().zip(found.iter().copied()).map(place));
            map.set_motions(body, &surface);
            (map.error, map.off) = (0.0, 0.0);
            for (guess, found) in guesses.iter().zip(&found) {
                let off = (found - guess).symmetric_eigenvalues().amax();
                map.off = map.off.max(off);
                if off > accuracy.absolute {
                    map.error = map.error.max(off / found.symmetric_eigenvalues().amax());
                }
            }
            if map.error <= accuracy.relative {
                break;
            }
        }
        map
    }

    /// Compliance at a place, mm/N: displacement by axis (rows) under a unit force by axis (columns), both spread over what is
    /// material within two cells of the place. `body` is the one that the map is of.
    #[must_use]
    pub fn at(&self, body: &Body, place: [f64; 3]) -> Matrix3<f64> {
        self.moves(&body.spread(place)) + self.rest(&place)
    }

    /// Compliance at a place from fields that are solved for it alone, mm/N: what [`ComplianceMap::at`] comes close to.
    #[must_use]
    pub fn solved_at(body: &Body, place: [f64; 3]) -> Matrix3<f64> {
        Self::empty(body).solve(body, &[body.spread(place)])[0]
    }

    /// Places that have been solved for, in this stage.
    #[must_use]
    pub fn places(&self) -> usize {
        self.solved.len()
    }

    /// Rounds of the iteration over all of them, eight loads at a time.
    #[must_use]
    pub fn rounds(&self) -> usize {
        self.rounds
    }

    /// Largest error of the map at the last places that were solved for, before their fields were added, as a share of the
    /// compliance there, where it is more than the accuracy's absolute bound: it is about the error between places.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.error
    }

    /// The largest of these errors itself, mm/N.
    #[must_use]
    pub fn off(&self) -> f64 {
        self.off
    }

    fn empty(body: &Body) -> Self {
        Self {
            fields: Vec::new(),
            nodes: body.fine().node.clone(),
            motions: DMatrix::zeros(0, 0),
            earlier: Vec::new(),
            solved: Vec::new(),
            rounds: 0,
            error: 0.0,
            off: 0.0,
        }
    }

    /// Displacements at a spot in each field, by row.
    fn sampled(&self, spot: &Spot) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.fields.len(), 3);
        for (row, field) in self.fields.iter().enumerate() {
            for (number, share) in &spot.0 {
                for k in 0..3 {
                    all[(row, k)] += field[*number as usize][k] * share;
                }
            }
        }
        all
    }

    /// Compliance by the motions.
    fn moves(&self, spot: &Spot) -> Matrix3<f64> {
        let moved = self.motions.tr_mul(&self.sampled(spot));
        Matrix3::from_fn(|i, j| moved.column(i).dot(&moved.column(j)))
    }

    /// What the motions lack at a place: the mean of what they lack at places that have been solved for, by the inverse fourth
    /// power of the distance (Shepard).
    fn rest(&self, place: &[f64; 3]) -> Matrix3<f64> {
        let (mut sum, mut weights) = (Matrix3::zeros(), 0.0);
        for solved in &self.solved {
            let distance = square(&solved.at, place);
            if distance <= 0.0 {
                return solved.lacks;
            }
            let weight = distance.powi(-2);
            sum += solved.lacks * weight;
            weights += weight;
        }
        if weights > 0.0 { sum / weights } else { sum }
    }

    /// Chooses the motions, from what the fields are at spots all over the surface, and finds what they lack.
    fn set_motions(&mut self, body: &Body, surface: &[Spot]) {
        let count = self.fields.len();
        let most = (self.solved.len() + self.earlier.len()) / 2;
        if count == 0 {
            self.motions = DMatrix::zeros(0, 0);
            return;
        }
        let sampled: Vec<DMatrix<f64>> = surface.par_iter().map(|spot| self.sampled(spot)).collect();
        let mut moved = DMatrix::zeros(count, count);
        for sampled in &sampled {
            moved += sampled * sampled.transpose();
        }
        let eigen = SymmetricEigen::new(moved);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        order.truncate(most);
        self.motions = DMatrix::from_fn(count, order.len(), |row, column| eigen.eigenvectors[(row, order[column])]);
        let moves: Vec<Matrix3<f64>> = self.solved.iter().map(|place| self.moves(&body.spread(place.at))).collect();
        for (place, moves) in self.solved.iter_mut().zip(moves) {
            place.lacks = place.compliance - moves;
        }
    }

    /// Solves for unit forces at spots, and takes the fields in; the compliance at each.
    fn solve(&mut self, body: &Body, spots: &[Spot]) -> Vec<Matrix3<f64>> {
        let loads: Vec<(usize, usize)> = (0..spots.len()).flat_map(|n| (0..3).map(move |k| (n, k))).collect();
        let mut found = vec![Matrix3::zeros(); spots.len()];
        for batch in loads.chunks(LANES) {
            let forces: Vec<(&Spot, Vector3<f64>)> = batch.iter().map(|(n, k)| (&spots[*n], unit(*k))).collect();
            let start = (!self.fields.is_empty()).then(|| {
                let mut start = body.zeros();
                self.add(&self.under(&forces), &mut start);
                start
            });
            let Solved { x, rounds } = body.solve(&forces, start);
            self.rounds += rounds;
            for (lane, (n, k)) in batch.iter().enumerate() {
                found[*n].set_column(*k, &body.sample(&x, lane, &spots[*n]));
            }
            self.take_in(body.fine(), x);
        }
        found.into_iter().map(|c| (c + c.transpose()) * 0.5).collect()
    }

    /// Work that forces do on each field.
    fn under(&self, forces: &[(&Spot, Vector3<f64>)]) -> Vec<[f64; LANES]> {
        let work = |field: &Field| {
            let mut work = [0.0; LANES];
            for (lane, (spot, force)) in forces.iter().enumerate() {
                for (number, share) in &spot.0 {
                    work[lane] += share * Vector3::from(field[*number as usize]).dot(force);
                }
            }
            work
        };
        self.fields.iter().map(work).collect()
    }

    /// Takes in displacements of eight loads: what of them the fields do not span already.
    fn take_in(&mut self, level: &Level, mut x: Vector) {
        let mut q = level.zeros();
        level.apply(&x, &mut q);
        let before = gram(&x, &q);
        // Twice is enough (Kahan, Parlett).
        for _ in 0..2 {
            let work = self.products(&q).into_iter().map(|work| work.map(|work| -work)).collect::<Vec<_>>();
            self.add(&work, &mut x);
            level.apply(&x, &mut q);
        }
        let left = gram(&x, &q);
        // Cholesky's factor of what is left, column by column, without those that have nothing new.
        let mut columns: Vec<[f64; LANES]> = Vec::new();
        for lane in 0..LANES {
            if left[(lane, lane)] <= NOTHING_NEW * before[(lane, lane)] || before[(lane, lane)] <= 0.0 {
                continue;
            }
            // The combination of loads that is orthonormal to those before, by modified Gram-Schmidt in the small space.
            let mut own = [0.0; LANES];
            own[lane] = 1.0;
            for column in &columns {
                let overlap: f64 =
                    (0..LANES).map(|l| column[l] * (0..LANES).map(|m| left[(l, m)] * own[m]).sum::<f64>()).sum();
                for l in 0..LANES {
                    own[l] -= overlap * column[l];
                }
            }
            let size: f64 = (0..LANES).map(|l| own[l] * (0..LANES).map(|m| left[(l, m)] * own[m]).sum::<f64>()).sum();
            if size > NOTHING_NEW * before[(lane, lane)] {
                columns.push(own.map(|v| v / size.sqrt()));
            }
        }
        let nodes = level.len();
        let field = |column: &[f64; LANES]| -> Field {
            let combine = |x: &[[f64; LANES]; 3]| x.map(|x| (0..LANES).map(|l| column[l] * x[l]).sum());
            x[..nodes].par_iter().with_min_len(CHUNK).map(combine).collect()
        };
        self.fields.extend(columns.iter().map(field));
    }

    /// Sums of products of each field with a vector.
    fn products(&self, q: &Vector) -> Vec<[f64; LANES]> {
        let arch = pulp::Arch::new();
        let part = |chunk: usize| -> Vec<[f64; LANES]> {
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.nodes.len());
            let of = |field: &Field| {
                arch.dispatch(|| {
                    let mut sum = [0.0; LANES];
                    for (v, q) in field[range.clone()].iter().zip(&q[range.clone()]) {
                        for k in 0..3 {
                            for l in 0..LANES {
                                sum[l] += v[k] * q[k][l];
                            }
                        }
                    }
                    sum
                })
            };
            self.fields.iter().map(of).collect()
        };
        let parts: Vec<Vec<[f64; LANES]>> = (0..self.nodes.len().div_ceil(CHUNK)).into_par_iter().map(part).collect();
        let mut sums = vec![[0.0; LANES]; self.fields.len()];
        for part in parts {
            for (sum, part) in sums.iter_mut().zip(part) {
                for l in 0..LANES {
                    sum[l] += part[l];
                }
            }
        }
        sums
    }

    /// Adds fields by their factors.
    fn add(&self, factors: &[[f64; LANES]], x: &mut Vector) {
        let arch = pulp::Arch::new();
        let nodes = self.nodes.len();
        x[..nodes].par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, x)| {
            for (field, factor) in self.fields.iter().zip(factors) {
                arch.dispatch(|| {
                    for (x, v) in x.iter_mut().zip(&field[chunk * CHUNK..]) {
                        for k in 0..3 {
                            for l in 0..LANES {
                                x[k][l] += factor[l] * v[k];
                            }
                        }
                    }
                });
            }
        });
    }

    /// Takes over the latest fields of a map of the same grid.
    fn take_over(&mut self, body: &Body, before: Self, most: usize) {
        let mut place = vec![None; body.fine().number.len()];
        for (n, node) in before.nodes.iter().enumerate() {
            place[*node as usize] = Some(n);
        }
        self.earlier = before.earlier;
        self.earlier.extend(before.solved.iter().map(|place| place.at));
        self.earlier.truncate(most / 3);
        let first = before.fields.len().saturating_sub(most);
        for fields in before.fields[first..].chunks(LANES) {
            let mut x = body.zeros();
            for (x, node) in x.iter_mut().zip(&self.nodes) {
                let Some(n) = place[*node as usize] else { continue };
                *x = ZERO;
                for (lane, field) in fields.iter().enumerate() {
                    for k in 0..3 {
                        x[k][lane] = field[n][k];
                    }
                }
            }
            body.hold(&mut x);
            self.take_in(body.fine(), x);
        }
    }
}

/// Products of eight vectors with eight others.
fn gram(x: &Vector, q: &Vector) -> SMatrix<f64, LANES, LANES> {
    let part = |(x, q): (&[Node], &[Node])| {
        let mut sum = [[0.0; LANES]; LANES];
        for (x, q) in x.iter().zip(q) {
            for k in 0..3 {
                for a in 0..LANES {
                    for b in 0..LANES {
                        sum[a][b] += x[k][a] * q[k][b];
                    }
                }
            }
        }
        sum
    };
    let parts: Vec<[[f64; LANES]; LANES]> = x.par_chunks(CHUNK).zip(q.par_chunks(CHUNK)).map(part).collect();
    let mut sum = SMatrix::<f64, LANES, LANES>::zeros();
    for part in parts {
        sum += SMatrix::from_fn(|a, b| part[a][b]);
    }
    (sum + sum.transpose()) * 0.5
}

/// Places in an order in which each is the one furthest from all before it; those in a cell that has had one are left out.
struct Furthest {
    places: Vec<[f64; 3]>,
    /// Squared distance from the ones that have been given out.
    distance: Vec<f64>,
    least: f64,
    first: bool,
}

impl Furthest {
    fn new(places: &[[f64; 3]], solved: &[[f64; 3]], body: &Body) -> Self {
        let size = body.grid.size.iter().fold(0.0_f64, |most, size| most.max(*size));
        let cell = |place: &[f64; 3]| place.map(|x| (x / size).floor() as i64);
        // One place a cell: the first.
        let mut seen = std::collections::BTreeSet::new();
        let places: Vec<[f64; 3]> = places.iter().filter(|place| seen.insert(cell(place))).copied().collect();
        let distance = |place| solved.iter().map(|other| square(place, other)).fold(f64::INFINITY, f64::min);
        let distance = places.iter().map(distance).collect();
        Self { distance, places, least: size * size, first: solved.is_empty() }
    }

    /// Some hundreds of the places, all over.
    fn sparse(&self) -> impl Iterator<Item = &[f64; 3]> {
        self.places.iter().step_by(self.places.len().div_ceil(400).max(1))
    }

    fn next(&mut self) -> Option<[f64; 3]> {
        let furthest = if self.first {
            // Far from the middle of all.
            let count = self.places.len().max(1) as f64;
            let middle: [f64; 3] = std::array::from_fn(|k| self.places.iter().map(|p| p[k]).sum::<f64>() / count);
            (0..self.places.len()).max_by(|a, b| {
                square(&self.places[*a], &middle).total_cmp(&square(&self.places[*b], &middle)).then(b.cmp(a))
            })
        } else {
            (0..self.places.len()).max_by(|a, b| self.distance[*a].total_cmp(&self.distance[*b]).then(b.cmp(a)))
        }?;
        if !self.first && self.distance[furthest] < self.least {
            return None;
        }
        self.first = false;
        let place = self.places[furthest];
        for (distance, other) in self.distance.iter_mut().zip(&self.places) {
            *distance = distance.min(square(&place, other));
        }
        Some(place)
    }
}

fn square(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum()
}
