//! Measured rows, and what the cell predicts for them.

use super::device::{Device, fixed_point};
use super::noise::{OVER, Places, Sample, Series};
use super::probing::Probing;
use super::seen::Seen;
use crate::cell::Cell;
use crate::correct::Prepared;
use crate::effects::{Cutting, Situation};
use crate::equilibrium::{Arm, Batch, Nearby, Room, Setting, Settled, Site};
use crate::lanes::WIDTH;
use crate::measured::{MeasuredRow, Table};
use crate::program::Program;
use crate::robot::{Joints, Pose, Units};
use crate::text::Diagnostic;
use nalgebra::{DVector, UnitQuaternion, Vector3};
use rayon::prelude::*;
use smallvec::SmallVec;
use std::ops::Range;
use std::sync::Arc;

/// One measured row, aligned.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    /// Index into the problem's prepared programs.
    pub(super) run: usize,
    /// Point of that program.
    pub(super) point: usize,
    /// Position in the run's order.
    pub(super) order: usize,
    /// Ordinal of its target, where it is of one.
    pub(super) target: Option<u32>,
    pub(super) line: u64,
    pub(super) motor: Joints,
    /// Travel of the joints there, with the presliding angle of the problem.
    pub(super) travel: Joints,
    /// The point before it, where it was taken on the way into a target.
    pub(super) way_from: Option<usize>,
    pub(super) seen: Seen,
    /// How the arm stood when its own probe touched, where the robot itself probed the row.
    pub(super) probing: Option<Probing>,
    /// How the probe was turned, in the device's frame.
    pub(super) turned: Option<UnitQuaternion<f64>>,
    /// Relative standard deviation, as given.
    pub(super) weight: f64,
    /// How much wider than that the row's error must be taken where errors have heavy tails.
    pub(super) tail: f64,
    pub(super) held_out: bool,
    pub(super) block: usize,
    pub(super) outlier: bool,
    /// First of its scalars in stacked vectors.
    pub(super) offset: usize,
}

impl Observation {
    /// Its scalars in stacked vectors: of the position, mm, then of the turn, mrad.
    pub(super) fn scalars(&self) -> Range<usize> {
        self.offset..self.offset + self.seen.len() + if self.turned.is_some() { TURNS } else { 0 }
    }

    /// Those of the turn alone.
    pub(super) fn turns(&self) -> Range<usize> {
        self.offset + self.seen.len()..self.scalars().end
    }
}

/// Scalars of a turn.
const TURNS: usize = 3;

/// What a row adds to a stacked vector: as many as it has of a position, mm, and a turn, mrad.
pub(super) type Parts = [[f64; 3]; 2];

/// A program that cuts the stock, from which the forces at its rows follow.
#[derive(Debug)]
pub(super) struct StockCut {
    pub(super) program: Program,
    /// Runs of it.
    pub(super) runs: Vec<usize>,
}

/// Everything that is fitted to.
#[derive(Debug)]
pub(super) struct Problem {
    pub(super) runs: Vec<Prepared>,
    pub(super) stocks: Vec<StockCut>,
    pub(super) rows: Vec<Observation>,
    /// Scalars in all.
    pub(super) scalars: usize,
    /// Whether rows carry their own motor angles (`--poses`), over the whole robot.
    pub(super) free_device: bool,
    /// Measured orientations that are not used: a program's rows are judged by positions.
    pub(super) orientations: usize,
    /// What is unknown of each run's instrument.
    pub(super) devices: Vec<Device>,
    /// Standard deviation of a turn (mrad) over that of a position (mm).
    pub(super) turn_weight: f64,
    /// Standard deviation that the table declares, per axis, quadratic mean, mm.
    pub(super) declared_sigma_mm: Option<f64>,
    /// The cell's mechanical units.
    pub(super) units: Arc<Units>,
    /// Steps that all readings come in, mm, where they are that coarse.
    pub(super) steps_mm: Option<f64>,
    /// Whether rows were read while the program ran, so that their order is the instrument's time. The surface of a finished part
    /// (`normal_mm` without `time_s`) is read afterwards, in any order.
    pub(super) read_in_order: bool,
    /// Angle over which friction in the joints builds up, rad: see [`Problem::set_presliding`].
    pub(super) presliding_rad: f64,
}

/// A row whose arm finds no equilibrium.
const LOST: Parts = [[f64::NAN; 3]; 2];

/// Rows that share a workspace.
const TOGETHER: usize = 128;

/// A state of the arm that a row depends on.
#[derive(Clone, Copy)]
enum Visit<'a> {
    /// The arm at the row's place on the program.
    Ran(&'a Observation),
    /// The arm that touches there with its own probe.
    Touched(&'a Observation, &'a Probing),
}

impl<'a> Visit<'a> {
    fn situation(self, problem: &'a Problem) -> Situation<'a> {
        let (Self::Ran(row) | Self::Touched(row, _)) = self;
        let ran = problem.runs[row.run].situation(row.point);
        match self {
            Self::Ran(_) => ran,
            Self::Touched(_, probing) => probing.situation(ran),
        }
    }

    /// Motor angles, and the travel into them.
    fn joints(self) -> (&'a Joints, &'a Joints) {
        match self {
            Self::Ran(row) => (&row.motor, &row.travel),
            Self::Touched(_, probing) => (&probing.motor, &probing.travel),
        }
    }
}

/// What some visits are solved with.
struct Sites<'a> {
    situations: Vec<Situation<'a>>,
    settings: Vec<Setting>,
    /// Index of each visit's.
    setting: Vec<usize>,
}

impl<'a> Sites<'a> {
    fn of(problem: &'a Problem, visits: &[Visit<'a>]) -> Self {
        let situations: Vec<Situation> = visits.iter().map(|visit| visit.situation(problem)).collect();
        // Neighbours share theirs, but where units move.
        let mut settings: Vec<Setting> = Vec::new();
        let setting = |situation: &Situation| {
            let own = Setting::of(situation);
            if settings.last() != Some(&own) {
                settings.push(own);
            }
            settings.len() - 1
        };
        let setting = situations.iter().map(setting).collect();
        Self { situations, settings, setting }
    }

    fn site(&self, i: usize) -> Site<'_> {
        Site::of(&self.situations[i], &self.settings[self.setting[i]])
    }
}

/// Blocks that a run is cut into; every fourth is held out.
const BLOCKS: usize = 16;

impl Problem {
    pub(super) fn empty(free_device: bool) -> Self {
        Self {
            runs: Vec::new(),
            stocks: Vec::new(),
            rows: Vec::new(),
            scalars: 0,
            free_device,
            orientations: 0,
            devices: Vec::new(),
            turn_weight: 1.0,
            declared_sigma_mm: None,
            units: Arc::default(),
            steps_mm: None,
            read_in_order: true,
            presliding_rad: 0.0,
        }
    }

    #[allow(clippy::too_many_arguments)] // one row's fields, named at the only two callers
    pub(super) fn push(
        &mut self,
        run: usize,
        point: usize,
        order: usize,
        row: &MeasuredRow,
        motor: Joints,
        travel: Joints,
        seen: Seen,
        blocks: &Blocks,
    ) {
        let offset = self.scalars;
        self.scalars += seen.len();
        self.rows.push(Observation {
            run,
            point,
            order,
            target: None,
            line: row.line,
            motor,
            travel,
            way_from: None,
            seen,
            probing: None,
            turned: None,
            weight: row.sigma_mm.unwrap_or(1.0),
            tail: 1.0,
            held_out: blocks.held_out(order),
            block: blocks.of_row(order),
            outlier: false,
            offset,
        });
    }

    /// Whether the robot itself probed some rows.
    pub(super) fn is_probed(&self) -> bool {
        self.rows.iter().any(|row| row.probing.is_some())
    }

    /// Cuts the stocks with the poses that an arm takes: where forces follow from them, rows are predicted under those that act on
    /// this arm.
    pub(super) fn cut_stocks(&mut self, arm: &Arm, cell: &Cell) -> Result<(), Vec<Diagnostic>> {
        for StockCut { program, runs } in &self.stocks {
            for run in runs {
                self.runs[*run].cut_by(arm, program, cell)?;
            }
        }
        Ok(())
    }

    /// Measured minus predicted, stacked, mm; NaN where the arm finds no equilibrium.
    pub(super) fn residual(&self, arm: &Arm) -> DVector<f64> {
        self.residual_under(arm, |_, read| read)
    }

    /// As [`Problem::residual`], under other forces than were read, by the row's index and what was read.
    pub(super) fn residual_under(
        &self,
        arm: &Arm,
        force: impl Fn(usize, Vector3<f64>) -> Vector3<f64> + Sync,
    ) -> DVector<f64> {
        let parts = self.solved(arm, force, |visit, there| self.gap(visit, &there.wobj_from_tcp));
        self.stacked_visits(&parts.into_iter().map(|parts| parts.unwrap_or(LOST)).collect::<Vec<_>>())
    }

    /// The states that the rows depend on: one for each row, then one more for each that the robot itself probed.
    fn visits(&self) -> Vec<Visit<'_>> {
        let touched = self.rows.iter().filter_map(|row| Some(Visit::Touched(row, row.probing.as_ref()?)));
        self.rows.iter().map(Visit::Ran).chain(touched).collect()
    }

    /// A stacked vector from the parts of all visits.
    fn stacked_visits(&self, parts: &[Parts]) -> DVector<f64> {
        let (ran, touched) = parts.split_at(self.rows.len());
        let mut out = self.stacked(ran.iter().copied());
        let probed = self.rows.iter().filter(|row| row.probing.is_some());
        probed.zip(touched).for_each(|(row, [moved, _])| out[row.offset] += moved[0]);
        out
    }

    /// Equilibrium at every row, then at every touch of the robot's own probe, where there is one.
    pub(super) fn equilibria(&self, arm: &Arm) -> Vec<Option<Settled>> {
        self.solved(arm, |_, read| read, |_, there| there)
    }

    /// What is taken of the equilibrium at every visit, where there is one.
    fn solved<T: Send>(
        &self,
        arm: &Arm,
        force: impl Fn(usize, Vector3<f64>) -> Vector3<f64> + Sync,
        take: impl Fn(Visit<'_>, Settled) -> T + Sync,
    ) -> Vec<Option<T>> {
        let batch = Batch::new(arm);
        let visits = self.visits();
        let of = |(chunk, visits): (usize, &[Visit])| {
            let mut sites = Sites::of(self, visits);
            for (i, situation) in sites.situations.iter_mut().enumerate() {
                if let Cutting::Constant(read) = situation.cutting {
                    situation.cutting = Cutting::Constant(force(chunk * TOGETHER + i, read));
                }
            }
            let mut room = Room::default();
            let mut found: Vec<Option<T>> = visits.iter().map(|_| None).collect();
            for from in (0..visits.len()).step_by(WIDTH) {
                let given = |lane: usize| {
                    let (motor, travel) = visits[from + lane].joints();
                    (sites.site(from + lane), motor, travel)
                };
                batch.settle(&mut room, WIDTH.min(visits.len() - from), given, |lane, there| {
                    found[from + lane] = Some(take(visits[from + lane], there));
                });
            }
            let left = found.iter_mut().zip(visits).zip(&sites.situations).filter(|((found, _), _)| found.is_none());
            for ((found, visit), situation) in left {
                let (motor, travel) = visit.joints();
                let there = arm.predict(situation, motor, travel).ok();
                *found = there.map(|there| take(*visit, there.into()));
            }
            found
        };
        visits.par_chunks(TOGETHER).enumerate().flat_map_iter(of).collect()
    }

    /// As [`Problem::residual`], for arms near the one that settled at `known`.
    pub(super) fn residuals_near(&self, arms: &[Arm], known: &[Option<Settled>]) -> Vec<DVector<f64>> {
        let batches: Vec<Batch> = arms.iter().map(Batch::new).collect();
        let visits = self.visits();
        let of = |(visits, known): (&[Visit], &[Option<Settled>])| {
            let sites = Sites::of(self, visits);
            let mut room = Room::default();
            // Those of one arm together.
            let mut parts = vec![LOST; visits.len() * arms.len()];
            let found: Vec<usize> = (0..visits.len()).filter(|&i| known[i].is_some()).collect();
            for lanes in found.chunks(WIDTH) {
                let near = |&i: &usize| {
                    let (motor, travel) = visits[i].joints();
                    known[i].as_ref().map(|from| Nearby { site: sites.site(i), motor, travel, from })
                };
                room.near(&lanes.iter().filter_map(near).collect::<SmallVec<[Nearby; WIDTH]>>());
                for (batch, parts) in batches.iter().zip(parts.chunks_exact_mut(visits.len())) {
                    batch.resolve_from_nearby(&mut room, |lane, there| {
                        let i = lanes[lane];
                        parts[i] = self.gap(visits[i], &there);
                    });
                }
            }
            parts
        };
        let chunks = visits.par_chunks(TOGETHER).zip(known.par_chunks(TOGETHER));
        let chunks: Vec<(usize, Vec<Parts>)> = chunks.map(|chunk| (chunk.0.len(), of(chunk))).collect();
        let of_arm = |n: usize| {
            let parts = chunks.iter().flat_map(|(visits, parts)| &parts[n * visits..(n + 1) * visits]);
            self.stacked_visits(&parts.copied().collect::<Vec<_>>())
        };
        (0..arms.len()).map(of_arm).collect()
    }

    /// What was measured minus where the TCP is, both in the work object or both in what stands for it. Where the robot touches with
    /// its own probe, what it is off by there was not read: it adds to what was.
    fn gap(&self, visit: Visit<'_>, wobj_from_tcp: &Pose) -> Parts {
        let row = match visit {
            Visit::Ran(row) => row,
            Visit::Touched(row, probing) => {
                let normal = &self.runs[row.run].points[row.point].normal;
                return [[probing.normal_error_mm(wobj_from_tcp, normal), 0.0, 0.0], [0.0; 3]];
            }
        };
        let wobj_from_tcp = &self.runs[row.run].seen(row.point, *wobj_from_tcp);
        let moved = match row.seen {
            Seen::Position(seen) => (seen - wobj_from_tcp.translation.vector * 1e3).into(),
            Seen::Normal(seen) => [seen - 1e3 * self.runs[row.run].normal_error(row.point, wobj_from_tcp), 0.0, 0.0],
            Seen::Distance(seen) => match self.devices[row.run] {
                Device::Point(from) => [seen - (wobj_from_tcp.translation.vector * 1e3 - from).norm(), 0.0, 0.0],
                _ => [f64::NAN; 3],
            },
        };
        let turned = match (row.turned, self.devices[row.run]) {
            (Some(seen), Device::Frame { tcp_from_probe }) => {
                let there = UnitQuaternion::from_rotation_matrix(&wobj_from_tcp.rotation) * tcp_from_probe;
                (1e3 * (seen * there.inverse()).scaled_axis()).into()
            }
            _ => [0.0; 3],
        };
        [moved, turned]
    }

    /// Takes each run's mean off, axis by axis: where its part is clamped.
    pub(super) fn without_means(&self, of: &mut DVector<f64>) {
        for series in self.series(|_| true) {
            let scalars = || series.samples.iter().map(|sample| sample.0);
            let mean = scalars().map(|k| of[k]).sum::<f64>() / series.samples.len() as f64;
            scalars().for_each(|k| of[k] -= mean);
        }
    }

    /// The force that a row was measured under, as read, N.
    pub(super) fn force(&self, row: &Observation) -> Vector3<f64> {
        match self.runs[row.run].situation(row.point).cutting {
            Cutting::Constant(force) => force,
            _ => Vector3::zeros(),
        }
    }

    /// A stacked vector from its parts, row by row.
    pub(super) fn stacked(&self, parts: impl IntoIterator<Item = Parts>) -> DVector<f64> {
        let mut out = DVector::zeros(self.scalars);
        for (row, [moved, turned]) in self.rows.iter().zip(parts) {
            // What was not measured is in no residual and in no column.
            let shown = |(k, value): (usize, f64)| if row.seen.shows(k) { value } else { 0.0 };
            let moved = moved.into_iter().take(row.seen.len()).enumerate().map(shown);
            for (k, value) in row.scalars().zip(moved.chain(turned)) {
                out[k] = value;
            }
        }
        out
    }

    /// Finds anew how much turns scatter compared with positions of this standard deviation, from what is left of the fitted
    /// rows; whether that matters.
    pub(super) fn weigh_turns(&mut self, residual: &DVector<f64>, position_mm: f64) -> bool {
        /// Changes below this share make no difference to what is fitted.
        const CLOSE: f64 = 0.05;
        /// Medians from which on a turn is a blunder.
        const FAR: f64 = 7.0;
        let fitted = self.rows.iter().filter(|row| !row.held_out && !row.outlier);
        let mut sizes: Vec<f64> = fitted.flat_map(Observation::turns).map(|k| residual[k].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let Some(&median) = sizes.get(sizes.len() / 2).filter(|median| **median > 0.0) else { return false };
        sizes.truncate(sizes.partition_point(|size| *size < FAR * median));
        let rms = (sizes.iter().map(|size| size * size).sum::<f64>() / sizes.len() as f64).sqrt();
        let before = std::mem::replace(&mut self.turn_weight, rms / position_mm);
        (self.turn_weight / before - 1.0).abs() > CLOSE
    }

    /// Series of the rows that `keep` lets in: one a run and axis.
    pub(super) fn series(&self, keep: impl Fn(&Observation) -> bool) -> Vec<Series> {
        const AXES: usize = 3 + TURNS;
        let mut samples = vec![Vec::new(); AXES * self.runs.len()];
        let mut rows: Vec<Vec<&Observation>> = vec![Vec::new(); self.runs.len()];
        for row in self.rows.iter().filter(|row| !row.outlier && keep(row)) {
            rows[row.run].push(row);
            let mut add = |axis: usize, scalar: usize, weight: f64| {
                samples[AXES * row.run + axis].push((scalar, row.order, weight));
            };
            let shown = (0..row.seen.len()).filter(|&k| row.seen.shows(k));
            shown.for_each(|k| add(k, row.offset + k, row.weight * row.tail));
            row.turns().enumerate().for_each(|(k, scalar)| add(3 + k, scalar, self.turn_weight));
        }
        let places = |rows: &[&Observation]| rows.iter().map(|row| self.places(row)).collect::<Arc<[Places]>>();
        let of_all: Vec<Arc<[Places]>> = rows.iter().map(|rows| places(rows)).collect();
        let of_axis = |(axis, samples): (usize, Vec<Sample>)| {
            let (run, axis) = (axis / AXES, axis % AXES);
            // Axes that all rows have share their places: of many rows these are most of it.
            if samples.len() == rows[run].len() {
                return Series { samples, places: Arc::clone(&of_all[run]) };
            }
            let turned = |row: &Observation| axis >= 3 && !row.turns().is_empty();
            let has = |row: &&&Observation| turned(row) || axis < row.seen.len() && row.seen.shows(axis);
            let own: Vec<&Observation> = rows[run].iter().filter(has).copied().collect();
            Series { samples, places: places(&own) }
        };
        samples.into_iter().enumerate().filter(|(_, samples)| !samples.is_empty()).map(of_axis).collect()
    }

    /// What is left out together when something is tried on rows that its fit has not seen: whole runs where there are
    /// several, else stretches of one.
    pub(super) fn validation_block(&self, row: &Observation) -> (usize, usize) {
        /// From this number of runs on, one run can be left out and the others are still enough.
        const RUNS: usize = 3;
        (row.run, if self.runs.len() >= RUNS { 0 } else { row.block })
    }

    /// Where a row was to be measured, base axes, mm.
    pub(super) fn place_mm(&self, row: &Observation) -> Vector3<f64> {
        let run = &self.runs[row.run];
        1e3 * (run.base_from_wobj(row.point) * run.points[row.point].reference).translation.vector
    }

    /// When a row was measured, s.
    pub(super) fn time_s(&self, row: &Observation) -> f64 {
        self.runs[row.run].points[row.point].time
    }

    /// A row's coordinates in all that a field may be over.
    pub(super) fn places(&self, row: &Observation) -> Places {
        [self.place_mm(row), row.motor.fixed_rows::<3>(3).into(), self.force(row)]
    }

    /// Diagonals of the boxes around all of them.
    pub(super) fn extents(&self) -> [f64; OVER.len()] {
        let none = [(Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)); OVER.len()];
        let boxes = self.rows.iter().fold(none, |boxes, row| {
            let places = self.places(row);
            std::array::from_fn(|k| (boxes[k].0.inf(&places[k]), boxes[k].1.sup(&places[k])))
        });
        boxes.map(|(low, high)| (high - low).norm())
    }

    /// Takes the orientations of a run's rows, where it has any: the scalars are numbered anew.
    pub(super) fn take_turns(&mut self, run: usize, turned: &[Option<UnitQuaternion<f64>>]) {
        let of_run = self.rows.iter_mut().filter(|row| row.run == run);
        of_run.zip(turned).for_each(|(row, turned)| row.turned = *turned);
        self.number();
    }

    /// Finds the fixed point that a run's lengths were measured from.
    pub(super) fn find_fixed_point(&mut self, run: usize, table: &Table) -> Result<(), Vec<Diagnostic>> {
        let of_run = |row: &&Observation| row.run == run;
        let lengths = self.rows.iter().filter(of_run).filter(|row| matches!(row.seen, Seen::Distance(_))).count();
        if lengths == 0 {
            return Ok(());
        }
        if lengths < self.rows.iter().filter(of_run).count() {
            let message = "some rows have a distance and others a position: expected one kind of instrument a file";
            return Err(vec![table.row_error(1, message.to_owned()).help("give them as two runs")]);
        }
        let place = |row: &Observation| 1e3 * self.runs[run].points[row.point].wobj_from_tcp.translation.vector;
        let fitted = self.rows.iter().filter(of_run).filter(|row| !row.held_out);
        let measured = fitted.filter_map(|row| match row.seen {
            Seen::Distance(length) => Some((place(row), length)),
            Seen::Position(_) | Seen::Normal(_) => None,
        });
        let Some(point) = fixed_point(&measured.collect::<Vec<_>>()) else {
            let message = "too few distances to find the point that they were measured from".to_owned();
            return Err(vec![table.row_error(1, message)]);
        };
        self.devices[run] = Device::Point(point);
        Ok(())
    }

    /// Sets rows aside, as many along all of each run, until about as many are left as a search needs; returns them.
    pub(super) fn set_aside(&mut self) -> Vec<Observation> {
        /// Rows that are searched on, but for a few: from one part, and over the whole robot with its hundreds of columns.
        const SEARCHED_ROWS: [usize; 2] = [1_000, 12_500];
        /// Its multiples leave no gaps (Weyl 1916): every so-many-th row would be the same few targets of a program that repeats.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let share = SEARCHED_ROWS[usize::from(self.free_device)] as f64 / self.rows.len() as f64;
        if share >= 1.0 {
            return Vec::new();
        }
        let kept = |row: &Observation| (row.order as f64 * GOLDEN).fract() < share;
        let rows = std::mem::take(&mut self.rows);
        let (kept, aside) = rows.into_iter().partition(kept);
        self.rows = kept;
        self.number();
        aside
    }

    /// Takes rows back that were set aside.
    pub(super) fn take_back(&mut self, rows: Vec<Observation>) {
        self.rows.reserve_exact(rows.len());
        self.rows.extend(rows);
        self.rows.sort_unstable_by_key(|row| (row.run, row.order));
        self.set_presliding(self.presliding_rad);
        self.number();
    }

    /// Numbers the scalars anew.
    fn number(&mut self) {
        self.scalars = 0;
        for row in &mut self.rows {
            row.offset = self.scalars;
            self.scalars = row.scalars().end;
        }
    }

    /// Standard deviations become relative to their quadratic mean, so that σ is in mm whether they are given or not.
    pub(super) fn scale_weights(&mut self, declared: bool) {
        let n = self.rows.len().max(1) as f64;
        let mean = (self.rows.iter().map(|row| row.weight * row.weight).sum::<f64>() / n).sqrt();
        if mean > 0.0 {
            self.rows.iter_mut().for_each(|row| row.weight /= mean);
            self.declared_sigma_mm = declared.then_some(mean);
        }
    }
}

/// Contiguous blocks of a run and which are held out.
pub(super) struct Blocks {
    length: usize,
    given: Option<Vec<bool>>,
}

impl Blocks {
    pub(super) fn of(holdout: &[Option<bool>]) -> Self {
        let given = holdout.iter().any(Option::is_some).then(|| holdout.iter().map(|h| h.unwrap_or(false)).collect());
        Self { length: holdout.len().div_ceil(BLOCKS).max(1), given }
    }

    fn of_row(&self, order: usize) -> usize {
        order / self.length
    }

    pub(super) fn held_out(&self, order: usize) -> bool {
        match &self.given {
            Some(given) => given[order],
            None => self.of_row(order) % 4 == 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{KINDS, Kind};
    use crate::identify::candidate::with;
    use crate::text::Source;

    /// An arm with each form of every kind, and poses of it under no forces.
    fn arms_and_poses() -> (Vec<Arm>, Problem) {
        let text = "[robot]\nmodel = \"irb120-3-0.58\"\n[robot.stiffness]\njoint_nm_per_rad = [2e4, 2e4, 2e4, 5e3, 5e3, 5e3]\n\
                    [tools.t]\ntcp_mm = [0, 0, 100]\ntcp_quat = [1, 0, 0, 0]\nmass_kg = 2\n[cut]\nforce = \"none\"\n";
        let cell = Cell::read(&Source::new("cell.toml", text.as_bytes().to_vec())).unwrap();
        let mut csv = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n".to_owned();
        for i in 0..20 {
            let deg: [f64; 6] = std::array::from_fn(|j| 40.0 * ((i * (2 * j + 3)) as f64 * 0.7).sin());
            let there =
                cell.arm.robot.forward(&Joints::from(deg.map(f64::to_radians))) * cell.tools["T"].flange_from_tcp;
            let place = there.translation.vector * 1e3;
            let row: Vec<String> = deg.iter().chain(place.iter()).map(f64::to_string).collect();
            csv += &(row.join(",") + "\n");
        }
        let table = Table::read(&Source::new("poses.csv", csv.into_bytes())).unwrap();
        let problem = Problem::of_poses(&cell, vec![table], None).unwrap();
        let arm = |(kind, form): (&Kind, &&str)| {
            let mut arm = with(&cell.arm, &[]);
            arm.effects.push((kind.read)(form.parse().unwrap()).unwrap());
            arm
        };
        let forms = KINDS.iter().flat_map(|kind| kind.forms.iter().map(move |form| (kind, form)));
        (forms.map(arm).collect(), problem)
    }

    #[test]
    fn rows_that_are_solved_together_come_to_what_each_comes_to_alone() {
        let (arms, problem) = arms_and_poses();
        for arm in &arms {
            for (row, together) in problem.rows.iter().zip(problem.equilibria(arm)) {
                let alone = arm.predict(&problem.runs[row.run].situation(row.point), &row.motor, &row.travel).ok();
                assert_eq!(
                    together.map(|there| there.wobj_from_tcp),
                    alone.map(|there| there.wobj_from_tcp),
                    "{arm:?}"
                );
            }
        }
    }

    #[test]
    fn what_an_arm_comes_to_does_not_depend_on_which_others_are_asked() {
        let (arms, problem) = arms_and_poses();
        let known = problem.equilibria(&arms[0]);
        let together = problem.residuals_near(&arms, &known);
        for (arm, together) in arms.iter().zip(together) {
            let alone = problem.residuals_near(std::slice::from_ref(arm), &known);
            assert_eq!(alone, [together], "{arm:?}");
        }
    }
}
