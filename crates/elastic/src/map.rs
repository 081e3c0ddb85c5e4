//! The compliance at any number of places, from the displacements under forces at a few of them.
//!
//! Under a force anywhere on its surface, a body moves mostly by a sum of a few smooth motions. The displacement fields that have
//! been solved span a space, and Galerkin's method gives the answer to any other force in this space at the cost of some sums.
//! The result is never larger than the compliance. It lacks the part that is local to the place. This part is zero where a force
//! has been solved, and grows with the square of the distance from such places, as the deflection of a plate does. Each new
//! solution measures how large it is. The next forces are solved where the largest part is missing.
//!
//! A map begins with forces of random signs all over the surface, so that no soft region is overlooked. After material has been
//! removed, the motions of the previous stage still span most of the space. Those that move the surface most are kept.

use crate::body::{Body, Load, Solved, Spot};
use crate::level::{LANES, Node, Vector, rows};
use crate::widest::widest;
use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen, Vector3};
use rayon::prelude::*;

/// How close a map has to come to the compliance that a solution at each place would give.
///
/// # Examples
/// ```
/// use deflex_elastic::Accuracy;
///
/// let accuracy = Accuracy { relative: 0.02, absolute: 1e-6, most_fields: 100 }; // 1e-6 mm/N
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Share of the largest compliance at the place, in its softest direction.
    pub relative: f64,
    /// Errors below this do not matter, mm/N.
    pub absolute: f64,
    /// Largest number of fields that are kept: one for each force that is solved.
    pub most_fields: usize,
}

impl Default for Accuracy {
    /// 3 %, or 30 nm/N. Under a milling force of 200 N this is 6 µm, a tenth of the repeatability of a robot.
    fn default() -> Self {
        Self { relative: 0.03, absolute: 3e-5, most_fields: 240 }
    }
}

impl Accuracy {
    /// Allowed error of a compliance, mm/N.
    fn of(&self, compliance: f64) -> f64 {
        self.absolute.max(self.relative * compliance)
    }
}

/// Largest number of values in all fields together: 0.7 GB.
const NUMBERS: usize = 180_000_000;
/// Approximate number of places from which the next ones are chosen: several times as many as are solved.
const CANDIDATES: usize = 1000;
/// A combination of fields with less than this share of the largest energy adds rounding errors only.
const NOTHING_NEW: f64 = 1e-4;
/// The iteration ends when its last rounds change the result by less than this share of the allowed error. The remaining error is
/// then less than half of it.
const SETTLED: f64 = 0.2;
/// Smallest distance between two places in weighted means, as a share of the extent of all places. Nearer places count as being
/// this far apart.
const NEAR: f64 = 1e-3;
/// The expected error may be wrong by a factor of two, so it has to be below this share of the allowed one.
const SURE: f64 = 0.5;
/// Number of nodes in one task.
const CHUNK: usize = 256;

type Field = Vec<[f32; 3]>;
/// Displacements at a spot in each field.
type Sampled = Vec<[f64; 3]>;

/// The compliance over the surface of a body.
///
/// # Examples
/// ```
/// # use deflex_elastic::{Body, Clamp, Grid, Material, Solid};
/// # let bar = Solid::of(Grid::over([0.0; 3], [40.0, 4.0, 4.0], 1.0), |_| 1.0);
/// # let end = Clamp { bounds: [[0.0; 3], [0.0, 4.0, 4.0]], stiffness: [f64::INFINITY; 3] };
/// # let body = Body::new(&bar, Material { e: 71_000.0, nu: 0.33 }, &[end])?;
/// use deflex_elastic::{Accuracy, ComplianceMap};
///
/// let places: Vec<[f64; 3]> = (0..=20).map(|i| [20.0 + f64::from(i), 2.0, 4.0]).collect();
/// let map = ComplianceMap::over(&body, &places, &Accuracy { relative: 0.02, absolute: 1e-6, most_fields: 100 }, None);
/// let (tip, middle) = (map.at(&body, places[20]), map.at(&body, places[0]));
/// assert!(tip[(2, 2)] > middle[(2, 2)]); // mm/N
/// let exact = ComplianceMap::solved_at(&body, &places[20..])[0];
/// assert!((tip[(2, 2)] / exact[(2, 2)] - 1.0).abs() < 0.05);
/// let across = map.between(&body, places[19], places[20]);
/// assert!(across[(2, 2)] < tip[(2, 2)]);
/// println!("{} places, {} rounds, error {:.1e}, {:.1e} mm/N", map.places(), map.rounds(), map.error(), map.off());
/// # Ok::<(), deflex_elastic::HoldError>(())
/// ```
pub struct ComplianceMap {
    fields: Vec<Field>,
    /// The node of the whole grid for each node of a field.
    nodes: Vec<u32>,
    /// Work that the forces of one field do in another.
    work: DMatrix<f64>,
    /// Combinations of fields, by column, that are orthonormal in energy.
    basis: DMatrix<f64>,
    /// Places at which forces have been solved.
    solved: Vec<SolvedPlace>,
    /// Largest distance between two places, mm.
    size: f64,
    rounds: usize,
    error: f64,
    off: f64,
}

/// A place at which forces have been solved.
struct SolvedPlace {
    at: [f64; 3],
    spot: Spot,
    sampled: Sampled,
    known: Known,
    /// The part of the compliance that the earlier fields did not have there. `None` for the first places, where it says nothing
    /// about other places.
    lacked: Option<Lacked>,
}

/// The part of the compliance that the fields did not have at a place before it was solved.
struct Lacked {
    /// The missing part divided by the square root of the compliance that was found, √(mm/N).
    compliance: Matrix3<f64>,
    /// Distance from the nearest place that had been solved before, mm.
    distance: f64,
}

/// The compliance at a place that follows from the fields.
#[derive(Clone)]
struct Known {
    compliance: Matrix3<f64>,
    /// The largest compliance, by direction.
    most: f64,
    /// Share of each combination of fields in the response to a force in that direction, as a unit vector.
    moved: DVector<f64>,
}

/// A place at which forces may be solved.
struct Candidate {
    at: [f64; 3],
    spot: Spot,
    sampled: Sampled,
    /// Distance from the nearest place that has been solved, mm.
    distance: f64,
}

/// Unit forces at a place that are solved together.
struct Chosen {
    candidate: usize,
    known: Known,
    distance: f64,
    /// The part of the compliance that the fields are expected to lack.
    lacks: Matrix3<f64>,
    directions: Vec<Vector3<f64>>,
}

impl ComplianceMap {
    /// The map over places on the surface of a body (mm). It gives the compliance at these places and at all places between them.
    ///
    /// `before` is the map of the same grid when it had more material or other clamps.
    #[must_use]
    pub fn over(body: &Body, places: &[[f64; 3]], accuracy: &Accuracy, before: Option<Self>) -> Self {
        let most = accuracy.most_fields.min(NUMBERS / (3 * body.fine().len())).max(4 * LANES);
        let mut candidates = candidates(body, places);
        let mut map = Self::empty(body);
        map.size = extent(places).max(f64::MIN_POSITIVE);
        if let Some(before) = before {
            map.take_over(body, before, &candidates, most / 2);
        }
        map.probe(body, &candidates, accuracy);
        loop {
            candidates.par_iter_mut().for_each(|candidate| map.sample(&candidate.spot, &mut candidate.sampled));
            map.set_basis();
            let Some(chosen) = map.choose(&mut candidates, accuracy) else { break };
            if map.fields.len() + LANES > most {
                break;
            }
            map.solve_for(body, &candidates, chosen, accuracy);
        }
        map
    }

    /// Compliance at a place, mm/N: displacement by axis (rows) under a unit force by axis (columns). Both are spread over the
    /// material within two cells of the place. `body` is the body of the map.
    #[must_use]
    pub fn at(&self, body: &Body, place: [f64; 3]) -> Matrix3<f64> {
        self.between(body, place, place)
    }

    /// Displacement of one place by axis (rows) under a unit force by axis (columns) at another, mm/N. The part that the fields
    /// lack is that of the place of the force, so the distance of the two places should be small compared with the size of the
    /// body.
    ///
    /// By the theorem of Maxwell and Betti, exchanging the two places gives the transpose.
    #[must_use]
    pub fn between(&self, body: &Body, moved: [f64; 3], loaded: [f64; 3]) -> Matrix3<f64> {
        let sampled = |place: [f64; 3]| {
            let mut sampled = Sampled::new();
            self.sample(&body.spread(place), &mut sampled);
            sampled
        };
        let under = sampled(loaded);
        let known = self.known(&under);
        let lacks = self.lacking(&loaded, &known, self.nearest(&loaded, &known));
        let [moved, under] = [&sampled(moved), &under].map(|sampled| self.orthonormal(sampled));
        let found = Matrix3::from_fn(|i, j| moved.column(i).dot(&under.column(j)));
        found + lacks.unwrap_or_else(Matrix3::zeros)
    }

    /// Compliances at places, each solved by itself, mm/N. [`ComplianceMap::at`] approximates them.
    #[must_use]
    pub fn solved_at(body: &Body, places: &[[f64; 3]]) -> Vec<Matrix3<f64>> {
        body.compliance_at(&places.iter().map(|place| body.spread(*place)).collect::<Vec<_>>())
    }

    /// Number of places that were solved in this stage.
    #[must_use]
    pub fn places(&self) -> usize {
        self.solved.len()
    }

    /// Number of rounds of the iteration for all of them, with sixteen loads at a time.
    #[must_use]
    pub fn rounds(&self) -> usize {
        self.rounds
    }

    /// Largest error of the map at the last places that were solved, before their fields were added, as a share of the compliance
    /// there. Errors below [`Accuracy::absolute`] do not count. It is about the error between places.
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
            work: DMatrix::zeros(0, 0),
            basis: DMatrix::zeros(0, 0),
            solved: Vec::new(),
            size: 0.0,
            rounds: 0,
            error: 0.0,
            off: 0.0,
        }
    }

    /// Adds the displacements at a spot for the fields that `sampled` does not have yet.
    fn sample(&self, spot: &Spot, sampled: &mut Sampled) {
        for field in &self.fields[sampled.len()..] {
            let mut sum = [0.0; 3];
            for (number, share) in &spot.0 {
                for k in 0..3 {
                    sum[k] += f64::from(field[*number as usize][k]) * share;
                }
            }
            sampled.push(sum);
        }
    }

    /// Displacements at a spot in each combination of fields that is orthonormal in energy, with one column for each axis.
    fn orthonormal(&self, sampled: &Sampled) -> DMatrix<f64> {
        let sampled = DMatrix::from_fn(self.basis.nrows(), 3, |row, k| sampled[row][k]);
        self.basis.tr_mul(&sampled)
    }

    /// The compliance at a place that follows from the fields by Galerkin's method.
    fn known(&self, sampled: &Sampled) -> Known {
        let moved = self.orthonormal(sampled);
        let compliance = Matrix3::from_fn(|i, j| moved.column(i).dot(&moved.column(j)));
        let eigen = compliance.symmetric_eigen();
        let most = eigen.eigenvalues.imax();
        let mut moved = moved * eigen.eigenvectors.column(most);
        let size = moved.norm();
        if size > 0.0 {
            moved /= size;
        }
        Known { compliance, most: eigen.eigenvalues[most], moved }
    }

    /// Distance between two places, mm. It is larger than the distance in space if the two places move differently.
    fn apart(&self, a: (&[f64; 3], &Known), b: (&[f64; 3], &Known)) -> f64 {
        let distance = square(a.0, b.0).sqrt();
        let together = a.1.moved.dot(&b.1.moved).powi(2);
        if distance < self.size * together { distance / together } else { self.size }
    }

    /// Distance of a place from the nearest one that has been solved, mm.
    fn nearest(&self, place: &[f64; 3], known: &Known) -> f64 {
        let distances = self.solved.iter().map(|solved| self.apart((place, known), (&solved.at, &solved.known)));
        distances.fold(self.size, f64::min)
    }

    /// The part of the compliance that the fields are expected to lack at a place, at a distance from the nearest solved one. It
    /// is the mean of the parts that were missing at the solved places, weighted by the inverse fourth power of their distances
    /// (Shepard). Each is scaled by the square of the distance and by the square root of the compliance, which is lower near a
    /// clamp and where the part is thick.
    fn lacking(&self, place: &[f64; 3], known: &Known, distance: f64) -> Option<Matrix3<f64>> {
        let (mut sum, mut weights) = (Matrix3::zeros(), 0.0);
        for solved in &self.solved {
            let Some(lacked) = &solved.lacked else { continue };
            let apart = self.apart((place, known), (&solved.at, &solved.known));
            let weight = apart.max(NEAR * self.size).powi(-4);
            sum += lacked.compliance * (weight * (distance / lacked.distance).min(1.0).powi(2));
            weights += weight;
        }
        (weights > 0.0).then(|| sum * (known.most.max(0.0).sqrt() / weights))
    }

    /// Makes the fields orthonormal in energy.
    fn set_basis(&mut self) {
        let count = self.fields.len();
        let scale: Vec<f64> = (0..count).map(|n| self.work[(n, n)].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
        let scaled =
            DMatrix::from_fn(count, count, |row, column| self.work[(row, column)] * scale[row] * scale[column]);
        let eigen = SymmetricEigen::new(scaled);
        let least = NOTHING_NEW * eigen.eigenvalues.amax();
        let kept: Vec<usize> = (0..count).filter(|n| eigen.eigenvalues[*n] > least).collect();
        self.basis = DMatrix::from_fn(count, kept.len(), |row, column| {
            let n = kept[column];
            scale[row] * eigen.eigenvectors[(row, n)] / eigen.eigenvalues[n].sqrt()
        });
        let mut solved = std::mem::take(&mut self.solved);
        solved.par_iter_mut().for_each(|place| {
            self.sample(&place.spot, &mut place.sampled);
            place.known = self.known(&place.sampled);
        });
        self.solved = solved;
    }

    /// The places to be solved next; `None` if the expected error is within the allowed one everywhere.
    fn choose(&self, candidates: &mut [Candidate], accuracy: &Accuracy) -> Option<Vec<Chosen>> {
        let look = |candidate: &mut Candidate| {
            let known = self.known(&candidate.sampled);
            candidate.distance = self.nearest(&candidate.at, &known);
            let lacks = self.lacking(&candidate.at, &known, candidate.distance);
            (known, lacks)
        };
        let looked_at: Vec<(Known, Option<Matrix3<f64>>)> = candidates.par_iter_mut().map(look).collect();
        // The expected error as a share of the allowed one. As long as no error is known, the compliance itself takes its place.
        let score = |(known, lacks): &(Known, Option<Matrix3<f64>>)| match lacks {
            Some(lacks) => {
                lacks.symmetric_eigenvalues().max() / accuracy.of(known.most + lacks.symmetric_eigenvalues().max())
            }
            None => known.most / accuracy.of(known.most),
        };
        let scores: Vec<f64> = looked_at.iter().map(score).collect();
        let is_known = looked_at.iter().any(|(_, lacks)| lacks.is_some());
        let mut distances: Vec<f64> = candidates.iter().map(|candidate| candidate.distance).collect();
        let (mut chosen, mut room): (Vec<Chosen>, usize) = (Vec::new(), LANES);
        loop {
            let now = |n: usize| {
                let nearer = distances[n] / candidates[n].distance.max(f64::MIN_POSITIVE);
                scores[n] * nearer * nearer
            };
            let best = (0..candidates.len()).max_by(|a, b| now(*a).total_cmp(&now(*b)).then(b.cmp(a)))?;
            let least = if is_known { SURE } else { 0.0 };
            let wanted = now(best);
            // A batch is filled up with places that are accurate enough already.
            if wanted <= 0.0 || (chosen.is_empty() && wanted <= least) {
                break;
            }
            let (known, lacks) = &looked_at[best];
            let lacks = lacks.unwrap_or_else(Matrix3::zeros);
            let eigen = (known.compliance + lacks).symmetric_eigen();
            let mut order = [0, 1, 2];
            order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
            let bound = accuracy.of(eigen.eigenvalues.max());
            let directions: Vec<Vector3<f64>> = order
                .into_iter()
                .enumerate()
                .filter(|(rank, n)| *rank == 0 || eigen.eigenvalues[*n] > bound)
                .map(|(_, n)| eigen.eigenvectors.column(n).into_owned())
                .collect();
            if directions.len() > room {
                break;
            }
            room -= directions.len();
            for (n, distance) in distances.iter_mut().enumerate() {
                let from = (&candidates[n].at, &looked_at[n].0);
                *distance = distance.min(self.apart(from, (&candidates[best].at, known)));
            }
            distances[best] = 0.0;
            let distance = candidates[best].distance;
            chosen.push(Chosen { candidate: best, known: known.clone(), distance, lacks, directions });
        }
        (!chosen.is_empty()).then_some(chosen)
    }

    /// Solves forces of random signs at all candidates, so that every soft region moves in some field.
    fn probe(&mut self, body: &Body, candidates: &[Candidate], accuracy: &Accuracy) {
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        let mut sign = || {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            if seed >> 63 == 1 { 1.0 } else { -1.0 }
        };
        let mut loads = vec![Load::new(); LANES];
        for candidate in candidates {
            for load in &mut loads {
                load.extend(candidate.spot.under(&Vector3::new(sign(), sign(), sign())));
            }
        }
        self.solve(body, &loads, |work, latest| latest <= accuracy.relative * work);
    }

    /// Solves forces at places that have been chosen.
    fn solve_for(&mut self, body: &Body, candidates: &[Candidate], chosen: Vec<Chosen>, accuracy: &Accuracy) {
        let under = |place: &Chosen| -> Vec<Load> {
            let spot = &candidates[place.candidate].spot;
            place.directions.iter().map(|direction| spot.under(direction)).collect()
        };
        let loads: Vec<Load> = chosen.iter().flat_map(under).collect();
        let won = self.solve(body, &loads, |work, latest| latest <= SETTLED * accuracy.of(work));
        let mut won = won.into_iter();
        (self.error, self.off) = (0.0, 0.0);
        for Chosen { candidate, known, distance, lacks, directions } in chosen {
            let mut lacked = Matrix3::zeros();
            for direction in &directions {
                let won = won.next().unwrap_or(0.0);
                let off = (won - direction.dot(&(lacks * direction))).abs();
                self.off = self.off.max(off);
                if off > accuracy.absolute {
                    self.error = self.error.max(off / (known.most + won));
                }
                lacked += direction * direction.transpose() * won;
            }
            let found = (known.compliance + lacked).symmetric_eigenvalues().max().max(f64::MIN_POSITIVE);
            let lacked = Lacked { compliance: lacked / found.sqrt(), distance };
            let lacked = (distance < self.size).then_some(lacked);
            let Candidate { at, spot, sampled, .. } = &candidates[candidate];
            self.solved.push(SolvedPlace { at: *at, spot: spot.clone(), sampled: sampled.clone(), known, lacked });
        }
    }

    /// Solves loads, starting from the answer of the fields, and adds the new part to the fields. Returns the work of each load
    /// in the new part. `settled` decides when the iteration ends, from the work of a load and the part of it that the last
    /// rounds added.
    fn solve(&mut self, body: &Body, loads: &[Load], settled: impl Fn(f64, f64) -> bool) -> Vec<f64> {
        let mut forces = body.loaded(loads);
        let mut had = [0.0; LANES];
        if !self.fields.is_empty() {
            let work = self.work_of(loads);
            let factors = &self.basis * self.basis.tr_mul(&work);
            had = std::array::from_fn(|lane| work.column(lane).dot(&factors.column(lane)));
            let factors: Vec<[f32; LANES]> =
                (0..factors.nrows()).map(|row| std::array::from_fn(|lane| factors[(row, lane)] as f32)).collect();
            let (mut start, mut q) = (body.zeros(), body.zeros());
            self.add(&factors, &mut start);
            body.fine().apply(&start, &mut q);
            subtract(&mut forces, &q);
        }
        let solved = body.solve(forces.clone(), |lane, won, latest| settled(had[lane] + won, latest));
        let Solved { change, left, won, rounds } = solved;
        self.rounds += rounds;
        // The forces of the change.
        subtract(&mut forces, &left);
        let is_new = |lane: &usize| won[*lane] > NOTHING_NEW * (had[*lane] + won[*lane]);
        self.take_in(&change, &forces, &(0..loads.len()).filter(is_new).collect::<Vec<_>>());
        won[..loads.len()].to_vec()
    }

    /// Work of each load (columns) in each field (rows).
    fn work_of(&self, loads: &[Load]) -> DMatrix<f64> {
        let under = |field: &Field| {
            let mut work = [0.0; LANES];
            for (work, load) in work.iter_mut().zip(loads) {
                *work = load.iter().map(|(n, force)| Vector3::from(field[*n as usize].map(f64::from)).dot(force)).sum();
            }
            work
        };
        let work: Vec<[f64; LANES]> = self.fields.par_iter().map(under).collect();
        DMatrix::from_fn(work.len(), LANES, |row, lane| work[row][lane])
    }

    /// Adds the displacements of some lanes, and their forces, to the fields.
    fn take_in(&mut self, x: &Vector, forces: &Vector, lanes: &[usize]) {
        let first = self.fields.len();
        let nodes = self.nodes.len();
        self.fields.extend(lanes.iter().map(|lane| -> Field {
            x[..nodes].par_iter().with_min_len(CHUNK).map(|x| std::array::from_fn(|k| x[k][*lane])).collect()
        }));
        let products = self.products(forces);
        let all = self.fields.len();
        self.work.resize_mut(all, all, 0.0);
        for (row, products) in products.iter().enumerate() {
            for (column, lane) in lanes.iter().enumerate() {
                let column = first + column;
                if row < first {
                    (self.work[(row, column)], self.work[(column, row)]) = (products[*lane], products[*lane]);
                } else {
                    // The mean of both, which is symmetric.
                    self.work[(row, column)] += 0.5 * products[*lane];
                    self.work[(column, row)] += 0.5 * products[*lane];
                }
            }
        }
    }

    /// Scalar product of each field with each lane of a vector.
    fn products(&self, q: &Vector) -> Vec<[f64; LANES]> {
        let part = |chunk: usize| -> Vec<[f64; LANES]> {
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.nodes.len());
            let q: Vec<[[f64; LANES]; 3]> = q[range.clone()].iter().map(|q| q.map(|q| q.map(f64::from))).collect();
            let of = |field: &Field| {
                widest!(<'a> _simd: S; (field: &'a [[f32; 3]] = &field[range.clone()], q: &'a [[[f64; LANES]; 3]] = &q) -> [f64; LANES] {
                    let mut sum = [0.0; LANES];
                    for (v, q) in field.iter().zip(q) {
                        for k in 0..3 {
                            for l in 0..LANES {
                                sum[l] += f64::from(v[k]) * q[k][l];
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

    /// Adds the fields, multiplied by factors, to a vector.
    fn add(&self, factors: &[[f32; LANES]], x: &mut Vector) {
        let nodes = self.nodes.len();
        x[..nodes].par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, x)| {
            // A few fields at a time, because processors prefetch from few arrays at once, and not from hundreds.
            for (fields, factors) in self.fields.chunks(LANES).zip(factors.chunks(LANES)) {
                widest!(<'a> simd: S; (x: &'a mut [Node] = x, fields: &'a [Field] = fields, factors: &'a [[f32; LANES]] = factors, first: usize = chunk * CHUNK) -> () {
                    for (i, x) in x.iter_mut().enumerate() {
                        for part in 0..LANES / S::F32_LANES {
                            let mut sums = rows::<S>(x, part);
                            for (field, factor) in fields.iter().zip(factors) {
                                let (v, factor) = (&field[first + i], S::as_simd_f32s(factor).0[part]);
                                for k in 0..3 {
                                    sums[k] = simd.add_f32s(sums[k], simd.mul_f32s(factor, simd.splat_f32s(v[k])));
                                }
                            }
                            for k in 0..3 {
                                S::as_mut_simd_f32s(&mut x[k]).0[part] = sums[k];
                            }
                        }
                    }
                });
            }
        });
    }

    /// Takes over those motions of an earlier map of the same grid that move the candidates most.
    fn take_over(&mut self, body: &Body, before: Self, candidates: &[Candidate], most: usize) {
        let Self { fields, nodes, basis, .. } = before;
        let mut place = vec![None; body.fine().number.len()];
        for (n, node) in nodes.iter().enumerate() {
            place[*node as usize] = Some(n);
        }
        let renumbered = |field: &Field| -> Field {
            self.nodes.iter().map(|node| place[*node as usize].map_or([0.0; 3], |n| field[n])).collect()
        };
        let mut own = Self::empty(body);
        own.fields = fields.into_iter().map(|field| renumbered(&field)).collect();
        let sampled = |candidate: &Candidate| {
            let mut sampled = Sampled::new();
            own.sample(&candidate.spot, &mut sampled);
            basis.tr_mul(&DMatrix::from_fn(basis.nrows(), 3, |row, k| sampled[row][k]))
        };
        let sampled: Vec<DMatrix<f64>> = candidates.par_iter().map(sampled).collect();
        let mut moved = DMatrix::zeros(basis.ncols(), basis.ncols());
        for sampled in &sampled {
            moved += sampled * sampled.transpose();
        }
        let eigen = SymmetricEigen::new(moved);
        let mut order: Vec<usize> = (0..basis.ncols()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        order.truncate(most);
        let motions = basis
            * DMatrix::from_fn(eigen.eigenvectors.nrows(), order.len(), |row, column| {
                eigen.eigenvectors[(row, order[column])]
            });
        let columns: Vec<usize> = (0..order.len()).collect();
        for columns in columns.chunks(LANES) {
            let factors: Vec<[f32; LANES]> = (0..motions.nrows())
                .map(|row| std::array::from_fn(|lane| columns.get(lane).map_or(0.0, |n| motions[(row, *n)] as f32)))
                .collect();
            let (mut x, mut q) = (body.zeros(), body.zeros());
            own.add(&factors, &mut x);
            body.hold(&mut x);
            body.fine().apply(&x, &mut q);
            self.take_in(&x, &q, &(0..columns.len()).collect::<Vec<_>>());
        }
        self.set_basis();
    }
}

/// a −= b.
fn subtract(a: &mut Vector, b: &Vector) {
    let less = |(a, b): (&mut Node, &Node)| {
        for k in 0..3 {
            for l in 0..LANES {
                a[k][l] -= b[k][l];
            }
        }
    };
    a.par_iter_mut().zip(b).with_min_len(CHUNK).for_each(less);
}

/// The first place in each cell of a grid. The grid is as coarse as the number of candidates requires.
fn candidates(body: &Body, places: &[[f64; 3]]) -> Vec<Candidate> {
    let mut size = body.grid.size.iter().fold(0.0_f64, |most, size| most.max(*size));
    let mut chosen = places.to_vec();
    loop {
        let mut seen = std::collections::BTreeSet::new();
        chosen.retain(|place| seen.insert(place.map(|x| (x / size).floor() as i64)));
        if chosen.len() <= CANDIDATES {
            break;
        }
        size *= 1.25;
    }
    let candidate = |at: [f64; 3]| Candidate { at, spot: body.spread(at), sampled: Sampled::new(), distance: 0.0 };
    chosen.into_par_iter().map(candidate).collect()
}

/// Diagonal of the bounding box of places.
fn extent(places: &[[f64; 3]]) -> f64 {
    let along = |k: usize| {
        let low = places.iter().map(|place| place[k]).fold(f64::INFINITY, f64::min);
        let high = places.iter().map(|place| place[k]).fold(f64::NEG_INFINITY, f64::max);
        (high - low).max(0.0)
    };
    (0..3).map(|k| along(k).powi(2)).sum::<f64>().sqrt()
}

fn square(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum()
}
