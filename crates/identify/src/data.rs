//! The measured rows of an identification, and the residuals of an arm at them.

use super::device::{Device, fixed_point};
use super::noise::{OVER, Places, Sample, Series};
use super::probing::Probing;
use super::reading::Reading;
use deflex_cell::Cell;
use deflex_correct::Prepared;
use deflex_effects::{Cutting, Presliding, Situation};
use deflex_equilibrium::{Arm, Batch, Nearby, Room, Setting, Settled, Site};
use deflex_lanes::WIDTH;
use deflex_measured::{MeasuredRow, Table};
use deflex_program::Program;
use deflex_robot::{Joints, Pose, Units};
use deflex_text::Diagnostic;
use nalgebra::{DVector, UnitQuaternion, Vector3};
use rayon::prelude::*;
use smallvec::SmallVec;
use std::ops::Range;
use std::sync::Arc;

/// One measured row with the point of the program, or the posture, that it belongs to.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    /// Index into the problem's prepared programs.
    pub(super) run: usize,
    /// Index of its point in that program.
    pub(super) point: usize,
    /// Position in the order in which the rows of the run were measured.
    pub(super) order: usize,
    /// Ordinal of its target; `None` between targets and without a program.
    pub(super) target: Option<u32>,
    /// Line of the measured file.
    pub(super) line: u64,
    /// Motor angles, rad.
    pub(super) motor: Joints,
    /// Direction of travel of each joint to this point, from −1 to 1, with the presliding angles of the problem.
    pub(super) travel: Joints,
    /// Index of the point before it, if it was measured between two targets.
    pub(super) way_from: Option<usize>,
    /// The reading of the instrument.
    pub(super) reading: Reading,
    /// The state of the arm when its own probe touched, if the robot itself probed the row.
    pub(super) probing: Option<Probing>,
    /// Measured orientation of the probe in the frame of the device.
    pub(super) turned: Option<UnitQuaternion<f64>>,
    /// Standard deviation of the row relative to the quadratic mean over all rows.
    pub(super) weight: f64,
    /// Factor of that standard deviation where the errors have heavy tails.
    pub(super) tail: f64,
    /// Whether the row is held out of every fit and choice.
    pub(super) held_out: bool,
    /// Index of its block in the run.
    pub(super) block: usize,
    /// Whether the row is left out as an outlier.
    pub(super) outlier: bool,
    /// Index of its first scalar in stacked vectors.
    pub(super) offset: usize,
}

impl Observation {
    /// Indices of its scalars in stacked vectors: those of the position, mm, then those of the orientation, mrad.
    pub(super) fn scalars(&self) -> Range<usize> {
        self.offset..self.offset + self.reading.len() + if self.turned.is_some() { TURNS } else { 0 }
    }

    /// Indices of the scalars of the orientation.
    pub(super) fn turns(&self) -> Range<usize> {
        self.offset + self.reading.len()..self.scalars().end
    }
}

/// Number of scalars of an orientation.
const TURNS: usize = 3;

/// The scalars of one row: those of its position, mm, of which it may have fewer than three, and those of its
/// orientation, mrad.
pub(super) type Parts = [[f64; 3]; 2];

/// A program that cuts a stock. The forces at the rows of its runs are computed from the cut.
#[derive(Debug)]
pub(super) struct StockCut {
    pub(super) program: Program,
    /// Indices of the runs of this program.
    pub(super) runs: Vec<usize>,
}

/// What the rows of a problem were measured on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// Parts: the rows belong to programs (`--run`).
    Part,
    /// The whole robot: the rows have their own motor angles, and the pose of the instrument is unknown (`--poses`).
    Robot,
}

/// The rows of all runs, with all that their predictions depend on except the arm.
#[derive(Debug)]
pub(super) struct Problem {
    pub(super) runs: Vec<Prepared>,
    pub(super) stocks: Vec<StockCut>,
    pub(super) rows: Vec<Observation>,
    /// Number of scalars of all rows.
    pub(super) scalars: usize,
    pub(super) extent: Extent,
    /// Number of measured orientations that are not used, because the rows of a program are judged by their positions.
    pub(super) orientations: usize,
    /// The unknown part of the instrument of each run.
    pub(super) devices: Vec<Device>,
    /// Standard deviation of an orientation, mrad, relative to that of a position, mm.
    pub(super) turn_weight: f64,
    /// Standard deviation for each axis that the table declares, mm: the quadratic mean over the rows.
    pub(super) declared_sigma_mm: Option<f64>,
    /// The mechanical units of the cell.
    pub(super) units: Arc<Units>,
    /// The step of which all readings are multiples, mm; `None` if it is too fine to be seen.
    pub(super) steps_mm: Option<f64>,
    /// Whether rows were read while the program ran, so that their order is the instrument's time. The surface of a
    /// finished part (`normal_mm` without `time_s`) is read afterwards, in any order.
    pub(super) read_in_order: bool,
    /// Whether the length that was cut before each row is known: see [`Survey`](deflex_effects::Survey).
    pub(super) has_cut_length: bool,
    /// Angles over which friction in the joints builds up: see [`Problem::set_presliding`].
    pub(super) presliding: Presliding,
}

/// The scalars of a row without an equilibrium.
const NO_EQUILIBRIUM: Parts = [[f64::NAN; 3]; 2];

/// Number of states of the arm that one thread solves with the same memory.
const TOGETHER: usize = 128;

/// A state of the arm that a row depends on.
#[derive(Clone, Copy)]
enum ArmState<'a> {
    /// The arm at the place of the row in the program.
    InProgram(&'a Observation),
    /// The arm that touches this place with its own probe.
    Touching(&'a Observation, &'a Probing),
}

impl<'a> ArmState<'a> {
    /// The circumstances of the state.
    fn situation(self, problem: &'a Problem) -> Situation<'a> {
        let (Self::InProgram(row) | Self::Touching(row, _)) = self;
        let in_program = problem.runs[row.run].situation(row.point);
        match self {
            Self::InProgram(_) => in_program,
            Self::Touching(_, probing) => probing.situation(in_program),
        }
    }

    /// Motor angles, rad, and the directions of travel to them.
    fn joints(self) -> (&'a Joints, &'a Joints) {
        match self {
            Self::InProgram(row) => (&row.motor, &row.travel),
            Self::Touching(_, probing) => (&probing.motor, &probing.travel),
        }
    }
}

/// The circumstances of some states, in the form in which a batch is solved.
struct Sites<'a> {
    situations: Vec<Situation<'a>>,
    settings: Vec<Setting>,
    /// Index of the setting of each state.
    setting: Vec<usize>,
}

impl<'a> Sites<'a> {
    fn of(problem: &'a Problem, states: &[ArmState<'a>]) -> Self {
        let situations: Vec<Situation> = states.iter().map(|state| state.situation(problem)).collect();
        // Successive states have the same setting unless units move.
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

/// Number of blocks of a run. Every fourth block is held out.
const BLOCKS: usize = 16;

impl Problem {
    /// A problem without rows.
    pub(super) fn empty(extent: Extent) -> Self {
        Self {
            runs: Vec::new(),
            stocks: Vec::new(),
            rows: Vec::new(),
            scalars: 0,
            extent,
            orientations: 0,
            devices: Vec::new(),
            turn_weight: 1.0,
            declared_sigma_mm: None,
            units: Arc::default(),
            steps_mm: None,
            read_in_order: true,
            has_cut_length: true,
            presliding: Presliding::default(),
        }
    }

    /// Whether the rows are poses over the whole robot.
    pub(super) fn is_of_robot(&self) -> bool {
        self.extent == Extent::Robot
    }

    /// Adds a row.
    #[allow(clippy::too_many_arguments)] // These are the fields of one row, and the callers name them.
    pub(super) fn push(
        &mut self,
        run: usize,
        point: usize,
        order: usize,
        row: &MeasuredRow,
        motor: Joints,
        travel: Joints,
        reading: Reading,
        blocks: &Blocks,
    ) {
        let offset = self.scalars;
        self.scalars += reading.len();
        self.rows.push(Observation {
            run,
            point,
            order,
            target: None,
            line: row.line,
            motor,
            travel,
            way_from: None,
            reading,
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

    /// Cuts the stocks with the poses that an arm takes, so that the rows are predicted under the forces that act on
    /// this arm.
    pub(super) fn cut_stocks(&mut self, arm: &Arm, cell: &Cell) -> Result<(), Vec<Diagnostic>> {
        for StockCut { program, runs } in &self.stocks {
            for run in runs {
                self.runs[*run].cut_by(arm, program, cell)?;
            }
        }
        Ok(())
    }

    /// The residual: measured minus predicted, as a stacked vector, mm and mrad. It is NaN at rows without an
    /// equilibrium.
    pub(super) fn residual(&self, arm: &Arm) -> DVector<f64> {
        self.residual_under(arm, |_, read| read)
    }

    /// As [`Problem::residual`], under the forces that `force` gives for the index of a state and the force that was
    /// read, N. The indices of the rows come first.
    pub(super) fn residual_under(
        &self,
        arm: &Arm,
        force: impl Fn(usize, Vector3<f64>) -> Vector3<f64> + Sync,
    ) -> DVector<f64> {
        let parts = self.solved(arm, force, |state, there| self.difference(state, &there.wobj_from_tcp));
        self.stacked_states(&parts.into_iter().map(|parts| parts.unwrap_or(NO_EQUILIBRIUM)).collect::<Vec<_>>())
    }

    /// The states that the rows depend on: one for each row, then a further one for each row that the robot itself
    /// probed.
    fn states(&self) -> Vec<ArmState<'_>> {
        let touching = self.rows.iter().filter_map(|row| Some(ArmState::Touching(row, row.probing.as_ref()?)));
        self.rows.iter().map(ArmState::InProgram).chain(touching).collect()
    }

    /// A stacked vector from the scalars of all states.
    fn stacked_states(&self, parts: &[Parts]) -> DVector<f64> {
        let (in_program, touching) = parts.split_at(self.rows.len());
        let mut out = self.stacked(in_program.iter().copied());
        let probed = self.rows.iter().filter(|row| row.probing.is_some());
        probed.zip(touching).for_each(|(row, [moved, _])| out[row.offset] += moved[0]);
        out
    }

    /// The equilibrium of every state, in the order of the rows, then of the touches of the robot's own probe;
    /// `None` where there is none.
    pub(super) fn equilibria(&self, arm: &Arm) -> Vec<Option<Settled>> {
        self.solved(arm, |_, read| read, |_, there| there)
    }

    /// Solves every state under the forces of `force`, and returns what `take` makes of its equilibrium; `None` where
    /// there is none.
    fn solved<T: Send>(
        &self,
        arm: &Arm,
        force: impl Fn(usize, Vector3<f64>) -> Vector3<f64> + Sync,
        take: impl Fn(ArmState<'_>, Settled) -> T + Sync,
    ) -> Vec<Option<T>> {
        let batch = Batch::new(arm);
        let states = self.states();
        let of = |(chunk, states): (usize, &[ArmState])| {
            let mut sites = Sites::of(self, states);
            for (i, situation) in sites.situations.iter_mut().enumerate() {
                if let Cutting::Constant(read) = situation.cutting {
                    situation.cutting = Cutting::Constant(force(chunk * TOGETHER + i, read));
                }
            }
            let mut room = Room::default();
            let mut found: Vec<Option<T>> = states.iter().map(|_| None).collect();
            for from in (0..states.len()).step_by(WIDTH) {
                let given = |lane: usize| {
                    let (motor, travel) = states[from + lane].joints();
                    (sites.site(from + lane), motor, travel)
                };
                batch.settle(&mut room, WIDTH.min(states.len() - from), given, |lane, there| {
                    found[from + lane] = Some(take(states[from + lane], there));
                });
            }
            let unsolved =
                found.iter_mut().zip(states).zip(&sites.situations).filter(|((found, _), _)| found.is_none());
            for ((found, state), situation) in unsolved {
                let (motor, travel) = state.joints();
                let there = arm.predict(situation, motor, travel).ok();
                *found = there.map(|there| take(*state, there.into()));
            }
            found
        };
        states.par_chunks(TOGETHER).enumerate().flat_map_iter(of).collect()
    }

    /// As [`Problem::residual`], for several arms near the one whose equilibria are `known`.
    pub(super) fn residuals_near(&self, arms: &[Arm], known: &[Option<Settled>]) -> Vec<DVector<f64>> {
        let batches: Vec<Batch> = arms.iter().map(Batch::new).collect();
        let states = self.states();
        let of = |(states, known): (&[ArmState], &[Option<Settled>])| {
            let sites = Sites::of(self, states);
            let mut room = Room::default();
            // All states of the first arm come first, then those of the next one.
            let mut parts = vec![NO_EQUILIBRIUM; states.len() * arms.len()];
            let found: Vec<usize> = (0..states.len()).filter(|&i| known[i].is_some()).collect();
            for lanes in found.chunks(WIDTH) {
                let near = |&i: &usize| {
                    let (motor, travel) = states[i].joints();
                    known[i].as_ref().map(|from| Nearby { site: sites.site(i), motor, travel, from })
                };
                room.near(&lanes.iter().filter_map(near).collect::<SmallVec<[Nearby; WIDTH]>>());
                for (batch, parts) in batches.iter().zip(parts.chunks_exact_mut(states.len())) {
                    batch.resolve_from_nearby(&mut room, |lane, there| {
                        let i = lanes[lane];
                        parts[i] = self.difference(states[i], &there);
                    });
                }
            }
            parts
        };
        let chunks = states.par_chunks(TOGETHER).zip(known.par_chunks(TOGETHER));
        let chunks: Vec<(usize, Vec<Parts>)> = chunks.map(|chunk| (chunk.0.len(), of(chunk))).collect();
        let of_arm = |n: usize| {
            let parts = chunks.iter().flat_map(|(states, parts)| &parts[n * states..(n + 1) * states]);
            self.stacked_states(&parts.copied().collect::<Vec<_>>())
        };
        (0..arms.len()).map(of_arm).collect()
    }

    /// Measured minus predicted scalars of a state whose TCP is at `wobj_from_tcp`. Both are in the work object, or in
    /// the frame of the device. A state that touches with the robot's own probe contributes the error of the arm there,
    /// which the controller does not see and which is added to the difference of the row.
    fn difference(&self, state: ArmState<'_>, wobj_from_tcp: &Pose) -> Parts {
        let row = match state {
            ArmState::InProgram(row) => row,
            ArmState::Touching(row, probing) => {
                let normal = &self.runs[row.run].points[row.point].normal;
                return [[probing.normal_error_mm(wobj_from_tcp, normal), 0.0, 0.0], [0.0; 3]];
            }
        };
        let wobj_from_tcp = &self.runs[row.run].seen(row.point, *wobj_from_tcp);
        let moved = match row.reading {
            Reading::Position(measured) => (measured - wobj_from_tcp.translation.vector * 1e3).into(),
            Reading::Normal(measured) => {
                [measured - 1e3 * self.runs[row.run].normal_error(row.point, wobj_from_tcp), 0.0, 0.0]
            }
            Reading::Distance(measured) => match self.devices[row.run] {
                Device::Point(from) => [measured - (wobj_from_tcp.translation.vector * 1e3 - from).norm(), 0.0, 0.0],
                _ => [f64::NAN; 3],
            },
        };
        let turned = match (row.turned, self.devices[row.run]) {
            (Some(measured), Device::Frame { tcp_from_probe }) => {
                let there = UnitQuaternion::from_rotation_matrix(&wobj_from_tcp.rotation) * tcp_from_probe;
                (1e3 * (measured * there.inverse()).scaled_axis()).into()
            }
            _ => [0.0; 3],
        };
        [moved, turned]
    }

    /// Subtracts from a stacked vector the mean of each axis of each run, which a shift of the clamped part can
    /// explain.
    pub(super) fn without_means(&self, of: &mut DVector<f64>) {
        for series in self.series(|_| true) {
            let scalars = || series.samples.iter().map(|sample| sample.0);
            let mean = scalars().map(|k| of[k]).sum::<f64>() / series.samples.len() as f64;
            scalars().for_each(|k| of[k] -= mean);
        }
    }

    /// The force of a row as it was read, work object axes, N; zero if it was not read but follows from a law or a
    /// stock.
    pub(super) fn force(&self, row: &Observation) -> Vector3<f64> {
        match self.runs[row.run].situation(row.point).cutting {
            Cutting::Constant(force) => force,
            _ => Vector3::zeros(),
        }
    }

    /// A stacked vector from the scalars of each row.
    pub(super) fn stacked(&self, parts: impl IntoIterator<Item = Parts>) -> DVector<f64> {
        let mut out = DVector::zeros(self.scalars);
        for (row, [moved, turned]) in self.rows.iter().zip(parts) {
            // Axes that were not measured are zero in every residual and in every column.
            let shown = |(k, value): (usize, f64)| if row.reading.has(k) { value } else { 0.0 };
            let moved = moved.into_iter().take(row.reading.len()).enumerate().map(shown);
            for (k, value) in row.scalars().zip(moved.chain(turned)) {
                out[k] = value;
            }
        }
        out
    }

    /// Estimates again, from the residual of the fitted rows, how much orientations scatter compared with positions,
    /// whose standard deviation is `position_mm`. Returns whether the change matters for the fit.
    pub(super) fn weigh_turns(&mut self, residual: &DVector<f64>, position_mm: f64) -> bool {
        /// Smallest relative change that matters for the fit.
        const CLOSE: f64 = 0.05;
        /// Number of medians from which on an orientation is a blunder.
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

    /// The series of the rows that `keep` accepts, without outliers: one for each axis of each run.
    pub(super) fn series(&self, keep: impl Fn(&Observation) -> bool) -> Vec<Series> {
        const AXES: usize = 3 + TURNS;
        let mut samples = vec![Vec::new(); AXES * self.runs.len()];
        let mut rows: Vec<Vec<&Observation>> = vec![Vec::new(); self.runs.len()];
        for row in self.rows.iter().filter(|row| !row.outlier && keep(row)) {
            rows[row.run].push(row);
            let mut add = |axis: usize, scalar: usize, weight: f64| {
                samples[AXES * row.run + axis].push((scalar, row.order, weight));
            };
            let shown = (0..row.reading.len()).filter(|&k| row.reading.has(k));
            shown.for_each(|k| add(k, row.offset + k, row.weight * row.tail));
            row.turns().enumerate().for_each(|(k, scalar)| add(3 + k, scalar, self.turn_weight));
        }
        let places = |rows: &[&Observation]| rows.iter().map(|row| self.places(row)).collect::<Arc<[Places]>>();
        let of_all: Vec<Arc<[Places]>> = rows.iter().map(|rows| places(rows)).collect();
        let of_axis = |(axis, samples): (usize, Vec<Sample>)| {
            let (run, axis) = (axis / AXES, axis % AXES);
            // Axes that all rows have share their places, which would otherwise be most of the memory of a long table.
            if samples.len() == rows[run].len() {
                return Series { samples, places: Arc::clone(&of_all[run]) };
            }
            let turned = |row: &Observation| axis >= 3 && !row.turns().is_empty();
            let has = |row: &&&Observation| turned(row) || axis < row.reading.len() && row.reading.has(axis);
            let own: Vec<&Observation> = rows[run].iter().filter(has).copied().collect();
            Series { samples, places: places(&own) }
        };
        samples.into_iter().enumerate().filter(|(_, samples)| !samples.is_empty()).map(of_axis).collect()
    }

    /// The block of a row in cross-validation: its whole run if there are enough runs, and a stretch of its run
    /// otherwise.
    pub(super) fn validation_block(&self, row: &Observation) -> (usize, usize) {
        /// Number of runs from which on the others are enough for a fit if one run is left out.
        const RUNS: usize = 3;
        (row.run, if self.runs.len() >= RUNS { 0 } else { row.block })
    }

    /// The programmed place of a row, base axes, mm.
    pub(super) fn place_mm(&self, row: &Observation) -> Vector3<f64> {
        let run = &self.runs[row.run];
        1e3 * (run.base_from_wobj(row.point) * run.points[row.point].reference).translation.vector
    }

    /// The time of a row, s.
    pub(super) fn time_s(&self, row: &Observation) -> f64 {
        self.runs[row.run].points[row.point].time
    }

    /// The coordinates of a row on which a field can depend.
    pub(super) fn places(&self, row: &Observation) -> Places {
        [self.place_mm(row), row.motor.fixed_rows::<3>(3).into(), self.force(row)]
    }

    /// For each coordinate the diagonal of the box around the values of all rows.
    pub(super) fn extents(&self) -> [f64; OVER.len()] {
        let none = [(Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)); OVER.len()];
        let boxes = self.rows.iter().fold(none, |boxes, row| {
            let places = self.places(row);
            std::array::from_fn(|k| (boxes[k].0.inf(&places[k]), boxes[k].1.sup(&places[k])))
        });
        boxes.map(|(low, high)| (high - low).norm())
    }

    /// Adds the measured orientations of the rows of a run, and numbers the scalars again.
    pub(super) fn take_turns(&mut self, run: usize, turned: &[Option<UnitQuaternion<f64>>]) {
        let of_run = self.rows.iter_mut().filter(|row| row.run == run);
        of_run.zip(turned).for_each(|(row, turned)| row.turned = *turned);
        self.number_scalars();
    }

    /// Finds the fixed point from which the lengths of a run were measured, if its rows are lengths.
    ///
    /// # Errors
    /// Only some of the rows are lengths, or they are too few.
    pub(super) fn find_fixed_point(&mut self, run: usize, table: &Table) -> Result<(), Vec<Diagnostic>> {
        let of_run = |row: &&Observation| row.run == run;
        let lengths = self.rows.iter().filter(of_run).filter(|row| matches!(row.reading, Reading::Distance(_))).count();
        if lengths == 0 {
            return Ok(());
        }
        if lengths < self.rows.iter().filter(of_run).count() {
            let message = "some rows have a distance and others a position: expected one kind of instrument a file";
            return Err(vec![table.row_error(1, message.to_owned()).help("give them as two runs")]);
        }
        let place = |row: &Observation| 1e3 * self.runs[run].points[row.point].wobj_from_tcp.translation.vector;
        let fitted = self.rows.iter().filter(of_run).filter(|row| !row.held_out);
        let measured = fitted.filter_map(|row| match row.reading {
            Reading::Distance(length) => Some((place(row), length)),
            Reading::Position(_) | Reading::Normal(_) => None,
        });
        let Some(point) = fixed_point(&measured.collect::<Vec<_>>()) else {
            let message = "too few distances to find the point that they were measured from".to_owned();
            return Err(vec![table.row_error(1, message)]);
        };
        self.devices[run] = Device::Point(point);
        Ok(())
    }

    /// Removes rows evenly along each run until about as many are left as a search needs, and returns the removed rows.
    pub(super) fn set_aside(&mut self) -> Vec<Observation> {
        /// Approximate number of rows of a part on which the search works.
        const SEARCHED_OF_PART: f64 = 1_000.0;
        /// The same over the whole robot, where there are hundreds of columns.
        const SEARCHED_OF_ROBOT: f64 = 12_500.0;
        /// The fractional parts of its multiples are uniformly distributed (Weyl 1916). Every n-th row instead would be
        /// the same few targets of a program that repeats.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let searched = match self.extent {
            Extent::Part => SEARCHED_OF_PART,
            Extent::Robot => SEARCHED_OF_ROBOT,
        };
        let share = searched / self.rows.len() as f64;
        if share >= 1.0 {
            return Vec::new();
        }
        let kept = |row: &Observation| (row.order as f64 * GOLDEN).fract() < share;
        let rows = std::mem::take(&mut self.rows);
        let (kept, aside) = rows.into_iter().partition(kept);
        self.rows = kept;
        self.number_scalars();
        aside
    }

    /// Adds the rows again that were set aside.
    pub(super) fn add_again(&mut self, rows: Vec<Observation>) {
        self.rows.reserve_exact(rows.len());
        self.rows.extend(rows);
        self.rows.sort_unstable_by_key(|row| (row.run, row.order));
        self.set_presliding(self.presliding);
        self.number_scalars();
    }

    /// Numbers the scalars of all rows again.
    fn number_scalars(&mut self) {
        self.scalars = 0;
        for row in &mut self.rows {
            row.offset = self.scalars;
            self.scalars = row.scalars().end;
        }
    }

    /// Divides the standard deviations of the rows by their quadratic mean, so that σ is in mm whether the table has
    /// them or not. If it has (`declared`), the mean is the declared σ.
    pub(super) fn scale_weights(&mut self, declared: bool) {
        let n = self.rows.len().max(1) as f64;
        let mean = (self.rows.iter().map(|row| row.weight * row.weight).sum::<f64>() / n).sqrt();
        if mean > 0.0 {
            self.rows.iter_mut().for_each(|row| row.weight /= mean);
            self.declared_sigma_mm = declared.then_some(mean);
        }
    }
}

/// Contiguous blocks of a run, some of which are held out.
pub(super) struct Blocks {
    /// Number of rows of a block.
    length: usize,
    /// Which rows the table itself holds out, if it says so of any.
    given: Option<Vec<bool>>,
}

impl Blocks {
    /// The blocks of a run, from the column `holdout` of its rows.
    pub(super) fn of(holdout: &[Option<bool>]) -> Self {
        let given = holdout.iter().any(Option::is_some).then(|| holdout.iter().map(|h| h.unwrap_or(false)).collect());
        Self { length: holdout.len().div_ceil(BLOCKS).max(1), given }
    }

    /// Index of the block of a row.
    fn of_row(&self, order: usize) -> usize {
        order / self.length
    }

    /// Whether a row is held out.
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
    use crate::candidate::with;
    use deflex_effects::{KINDS, Kind};
    use deflex_text::Source;

    /// For each form of every kind an arm with this effect, and poses without forces.
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
    fn rows_that_are_solved_together_have_the_same_equilibria_as_alone() {
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
    fn the_residual_of_an_arm_does_not_depend_on_the_other_arms_of_the_call() {
        let (arms, problem) = arms_and_poses();
        let known = problem.equilibria(&arms[0]);
        let together = problem.residuals_near(&arms, &known);
        for (arm, together) in arms.iter().zip(together) {
            let alone = problem.residuals_near(std::slice::from_ref(arm), &known);
            assert_eq!(alone, [together], "{arm:?}");
        }
    }
}
