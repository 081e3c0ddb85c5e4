//! Statements that move the tool straight: `GOTO`, `GODLTA`, `FROM`.

use super::Point;
use super::dialect::Dialect;
use super::layout::{Slot, StartSlot};
use super::lex::{Record, TokenKind};
use super::modal::Xyz;
use super::reader::Reader;
use super::refusal::Outcome;
use super::state::PendingArc;
use super::statement::{Numbers, Statement};
use super::vector::{add, dot, norm, scale, sub, unit};
use crate::{Goal, Motion, Predecessor, Reason, Role, Target};
use deflex_lang::ir::SourceSpan;
use deflex_text::number;

/// A printed axis shorter or longer than this is no unit vector; four printed digits give 0.9998.
const AXIS_LENGTH: std::ops::Range<f64> = 0.9..1.1;

/// Largest difference from unit length of a printed triple that is an axis and not a further point.
const UNIT_TRIPLE: f64 = 2e-3;

/// The properties of a target other than its position.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetProperties {
    pub(super) role: Role,
    /// 1 for a point of a motion whose end is not counted yet.
    pub(super) ahead: u32,
    pub(super) slot: Slot,
    pub(super) rapid: bool,
    pub(super) feed_mm_s: Option<f64>,
}

/// Three numbers with their places.
type Triple = (Xyz, [f64; 3]);

/// One position of a `GOTO`: a point, and the tool axis where it is printed.
type RecordStart = (Triple, Option<[f64; 3]>);

impl Reader {
    /// `GOTO/x,y,z[,i,j,k[,u,v,w]]`, or several positions (Creo).
    pub(super) fn goto(&mut self, record: Record, s: &Statement) -> Outcome {
        let read = self.position(record, s);
        self.lose_position_after(read)
    }

    /// After a refused statement, the machine still moves, to an unknown position.
    fn lose_position_after(&mut self, read: Outcome) -> Outcome {
        if read.is_err() {
            (self.modal.position, self.modal.rapid) = (None, false);
            (self.pending, self.checked) = (None, None);
        }
        read
    }

    fn position(&mut self, record: Record, s: &Statement) -> Outcome {
        let Some(numbers) = s.numbers() else {
            if s.items.first().is_some_and(|t| t.kind == TokenKind::Word && is_name(&s.bytes[t.span.range()])) {
                self.source_word(record);
            }
            return Err(Reason::PositionNotNumbers);
        };
        let triples = triples(&numbers);
        match numbers.count() {
            0..3 => return Err(Reason::PositionNotThree),
            n if n % 3 != 0 => return Err(Reason::PositionCount),
            _ if s.items.windows(2).any(|two| two.iter().all(|item| item.kind == TokenKind::Comma)) => {
                return Err(Reason::PositionLeavesOut);
            }
            _ => {}
        }
        self.ensure_units(record, s)?;
        let axis_before = self.modal.axis;
        let places = self.places(&triples);
        // Ambiguous triples count as positions too.
        self.literal_targets += places.as_ref().map_or(triples.len(), Vec::len);
        let places = places?;
        if let [(place, axis)] = places[..] {
            self.modal.axis = axis.unwrap_or_else(|| self.axis_where_none_is_printed());
            self.modal.normal = triples.get(2).and_then(|(_, printed)| self.normal(*printed, place.1));
            if self.cycle.is_active() {
                self.hole_at(record, place, axis_before);
            } else {
                self.arrive(record, place.0, place.1, true);
            }
            self.modal.normal = None;
            return Ok(());
        }
        if self.cycle.is_active() {
            return Err(Reason::CycleForm);
        }
        self.several(record, &places);
        Ok(())
    }

    /// Distinguishes positions and tool axes among the triples.
    fn places(&self, triples: &[Triple]) -> Result<Vec<RecordStart>, Reason> {
        let plain = || triples.iter().map(|triple| (*triple, None)).collect();
        let with_axes = || triples.chunks_exact(2).map(|pair| (pair[0], axis(pair[1].1))).collect();
        // A further point of an arc lies on its circle.
        let on_arc = |printed: [f64; 3]| {
            let arc = self.pending.zip(self.modal.position);
            arc.is_some_and(|(arc, start)| arc.circle.holds(start, printed))
        };
        match *triples {
            [_] => Ok(plain()),
            [_, (_, second)] => match (self.pending.is_some(), is_unit(second), on_arc(second)) {
                (true, true, true) => Err(Reason::AmbiguousList),
                (true, false, _) => Ok(plain()),
                _ if axis(second).is_some() => Ok(with_axes()),
                _ => Err(Reason::ToolAxisNotUnit),
            },
            [point, (_, second), (_, third)] => match (is_unit(second), is_unit(third)) {
                (true, true) if on_arc(second) && on_arc(third) => Err(Reason::AmbiguousList),
                (true, true) => Ok(vec![(point, axis(second))]),
                (false, false) => Ok(plain()),
                _ if self.pending.is_some() && on_arc(second) && on_arc(third) => Ok(plain()),
                _ => Err(Reason::AmbiguousList),
            },
            _ => {
                let units = |from: usize, step: usize| {
                    triples[from..].iter().step_by(step).map(|(_, printed)| is_unit(*printed))
                };
                let on_circle = |step: usize| triples.iter().step_by(step).all(|(_, printed)| on_arc(*printed));
                // Four triples may be a point, its axis, the contact and the normal there as well.
                let listed = self.pending.is_some() || triples.len() > 4;
                let paired = triples.len().is_multiple_of(2) && listed && units(1, 2).all(|is| is);
                match (on_circle(1), paired && on_circle(2)) {
                    // Points of a circle of radius 1 about the origin all have unit length.
                    (true, true) if !units(0, 1).all(|is| is) => Err(Reason::AmbiguousList),
                    (true, _) => Ok(plain()),
                    (false, true) => Ok(with_axes()),
                    (false, false) if !units(1, 1).any(|is| is) => Ok(plain()),
                    (false, false) if paired => Ok(with_axes()),
                    (false, false) => Err(Reason::AmbiguousList),
                }
            }
        }
    }

    /// The third triple of a position as the surface normal at the contact, in printed axes.
    ///
    /// CATIA and NX print the contact normal; others (NCL, ICAM) the forward direction, which also follows from the path. A forward direction
    /// is along the feed; a normal is at a right angle to it and leans towards the spindle.
    fn normal(&mut self, printed: [f64; 3], position: [f64; 3]) -> Option<[f64; 3]> {
        /// Cosines of a direction along the feed, and of one that leans to neither side.
        const ALONG: f64 = 0.9;
        const LEANING: f64 = 0.02;
        let normal = unit(printed)?;
        let to_spindle = dot(normal, self.modal.axis);
        let feed = self.modal.position.and_then(|before| unit(sub(position, before)));
        let along = feed.is_some_and(|feed| dot(normal, feed).abs() > ALONG);
        let contact =
            matches!(self.dialect, Dialect::Catia | Dialect::Nx) && to_spindle > -LEANING || to_spindle > LEANING;
        if along || !contact {
            self.warn(
                "cl.third-vector",
                "the third vector of positions is taken as the forward direction where it is not a surface normal",
            );
            return None;
        }
        Some(normal)
    }

    /// A position under a cycle.
    fn hole_at(&mut self, record: Record, (xyz, position): Triple, axis_before: [f64; 3]) {
        if let Some(arc) = self.pending.take() {
            self.refuse(arc.record, Reason::CycleForm);
        }
        self.checked = None;
        match self.cycle.hole() {
            Some(hole) => self.drill(record, &hole, xyz, position, axis_before),
            // Positions of a refused cycle are still counted.
            None => self.arrive(record, xyz, position, true),
        }
    }

    /// Several points of one statement: on an arc they lie on it, and the last is its end.
    fn several(&mut self, record: Record, places: &[RecordStart]) {
        if self.pending.is_some() {
            let points: Vec<[f64; 3]> = places.iter().map(|((_, point), _)| *point).collect();
            self.sense_of_list(&points);
        }
        let pending = self.pending;
        for (i, &((xyz, position), axis)) in places.iter().enumerate() {
            let last = i + 1 == places.len();
            self.modal.axis = axis.unwrap_or_else(|| self.axis_where_none_is_printed());
            if let (Some(arc), true) = (pending, i > 0) {
                self.pending = Some(PendingArc { centres: [None; 2], ..arc });
            }
            self.arrive(record, xyz, position, last || pending.is_none());
        }
        self.checked = None;
    }

    /// The tool arrives at a printed position, straight or on the pending arc.
    pub(super) fn arrive(&mut self, record: Record, xyz: Xyz, position: [f64; 3], end: bool) {
        let slot = Slot::Point { xyz, frame: self.frame };
        self.arrive_in(record, position, slot, end, |group, frame| Slot::GroupEnd { xyz, frame, group });
    }

    /// The same, for any slot of the position, and as the end of a group.
    fn arrive_in(
        &mut self,
        record: Record,
        position: [f64; 3],
        slot: Slot,
        end: bool,
        grouped: impl Fn(u32, u16) -> Slot,
    ) {
        if self.checked.is_some() && self.pending.is_none() {
            self.check_sense(position);
        }
        let arc = self.pending.take();
        if end {
            self.ordinal += 1;
        }
        let slot = match arc {
            Some(arc) => grouped(self.arc_points(arc, position, !end), self.frame),
            None => slot,
        };
        let role = if end { Role::End } else { Role::Interpolated };
        self.push(record, position, TargetProperties { role, ahead: u32::from(!end), ..self.step(slot) });
        let before = self.modal.position.replace(position);
        self.modal.fed = before.filter(|_| arc.is_none() && !self.modal.rapid).map(|before| sub(position, before));
        if end {
            self.modal.rapid = false;
        }
    }

    /// `GODLTA/dx,dy,dz[,i,j,k]`, or `GODLTA/d` along the tool axis.
    pub(super) fn godlta(&mut self, record: Record, s: &Statement) -> Outcome {
        let read = self.increment(record, s);
        self.lose_position_after(read)
    }

    fn increment(&mut self, record: Record, s: &Statement) -> Outcome {
        let numbers = s.numbers().ok_or(Reason::IncrementNotNumbers)?;
        let start = self.modal.position.ok_or(Reason::IncrementFromUnknown)?;
        if self.cycle.is_active() {
            return Err(Reason::CycleForm);
        }
        self.ensure_units(record, s)?;
        let (step, slot) = match (numbers.count(), &triples(&numbers)[..]) {
            (1, _) => {
                let [along] = numbers.first().ok_or(Reason::IncrementCount)?;
                (scale(self.modal.axis, along), Slot::AlongAxis { frame: self.frame })
            }
            (3 | 6, [(xyz, step), printed @ ..]) => {
                if let [(_, printed)] = printed {
                    self.modal.axis = axis(*printed).ok_or(Reason::ToolAxisNotUnit)?;
                }
                (*step, Slot::Step { xyz: *xyz, frame: self.frame })
            }
            _ => return Err(Reason::IncrementCount),
        };
        if self.pending.is_some() && matches!(slot, Slot::AlongAxis { .. }) {
            return Err(Reason::ArcAlongAxis);
        }
        self.literal_targets += 1;
        self.arrive_in(record, add(start, step), slot, true, |group, frame| Slot::StepEnd { frame, group });
        Ok(())
    }

    pub(super) fn from(&mut self, s: &Statement) -> Outcome {
        let numbers = s.number_items();
        let Some([x, y, z]) = numbers.first::<3>() else {
            return if s.items.is_empty() { Ok(()) } else { Err(Reason::StartNotNumbers) };
        };
        if let Some(axis) = numbers.first::<6>().and_then(|v| axis([v[3], v[4], v[5]])) {
            self.modal.axis = axis;
        }
        let mut spans = numbers.iter().map(|t| t.span);
        let mut next = || spans.next().unwrap_or_default();
        self.modal.from = Some(([next(), next(), next()], self.frame));
        self.modal.position = Some([x, y, z]);
        self.checked = None;
        Ok(())
    }

    /// The properties of a target in the modal state.
    pub(super) fn step(&self, slot: Slot) -> TargetProperties {
        let rapid = self.modal.rapid;
        let feed_mm_s = if rapid { None } else { self.modal.feed_mm_s() };
        TargetProperties { role: Role::End, ahead: 0, slot, rapid, feed_mm_s }
    }

    /// A printed position as that of the tip in the work object, mm; the tool axis is in the object's axes.
    pub(super) fn in_object(&self, printed: [f64; 3], axis: [f64; 3]) -> [f64; 3] {
        let position_mm = self.layout.frames[self.frame as usize].position(printed);
        match self.options.point {
            Point::Tip => position_mm,
            Point::Centre => sub(position_mm, scale(axis, self.corner_radius_mm())),
        }
    }

    pub(super) fn push(&mut self, record: Record, printed: [f64; 3], step: TargetProperties) {
        let has_left_path = self.machine.leaves_path() && self.ordinal + step.ahead > 1;
        let predecessor = if has_left_path { Predecessor::Unknown } else { Predecessor::Previous };
        if self.machine.is_waiting() {
            self.take_in_hand(record);
        }
        let TargetProperties { role, ahead, slot, rapid, feed_mm_s } = step;
        if self.finished {
            self.refuse(record, Reason::AfterFini);
        }
        if !rapid && feed_mm_s.is_none() && self.modal.lacks_spindle() {
            self.refuse(record, Reason::FeedWithoutSpindle);
        }
        let frame = &self.layout.frames[self.frame as usize];
        let turned = |v: [f64; 3]| unit(frame.turn(v)).unwrap_or(v);
        let (axis, normal) = (turned(self.modal.axis), self.modal.normal.map(turned));
        let position_mm = self.in_object(printed, axis);
        if !rapid && self.cutter.is_none() {
            self.cutter = self.modal.cutter;
        }
        if let Some((xyz, frame)) = self.modal.from.take() {
            self.layout.starts.push(StartSlot { first: self.targets.len(), xyz, frame });
        }
        self.layout.slots.push(slot);
        let goal = Goal::Axis { position_mm, axis, normal };
        let place = SourceSpan { source: 0, span: record.span };
        let (frames, line) = ([self.machine.tool(), 0], u32::try_from(record.line).unwrap_or(u32::MAX));
        self.targets.push(Target {
            role,
            feed_mm_s,
            spindle_rpm: self.modal.rpm(),
            rapid,
            mark: self.modal.mark,
            external: self.options.external.clone(),
            predecessor,
            ..Target::new(self.ordinal + ahead, Motion::Linear, goal, frames, place, line)
        });
    }

    /// The axis of a position that prints none, by dialect.
    pub(super) fn axis_where_none_is_printed(&self) -> [f64; 3] {
        match self.dialect {
            // Creo leaves out the axis if it is the machine's z.
            Dialect::Creo => [0.0, 0.0, 1.0],
            Dialect::SolidWorks => self.setup_axis,
            _ => self.modal.axis,
        }
    }
}

/// A printed axis, normalised.
pub(super) fn axis(printed: [f64; 3]) -> Option<[f64; 3]> {
    AXIS_LENGTH.contains(&norm(printed)).then(|| unit(printed)).flatten()
}

/// Whether a word is a name, and not a NaN or a number out of range (`NaN`, `-inf`, `1E999`, `1..5`).
fn is_name(word: &[u8]) -> bool {
    word.first().is_some_and(u8::is_ascii_alphabetic) && !number::is_none(word)
}

fn is_unit(v: [f64; 3]) -> bool {
    (norm(v) - 1.0).abs() < UNIT_TRIPLE
}

/// Numbers in groups of three, with their places.
fn triples(numbers: &Numbers) -> Vec<Triple> {
    let tokens: Vec<_> = numbers.iter().collect();
    tokens.chunks_exact(3).map(|t| ([t[0].span, t[1].span, t[2].span], [t[0].value, t[1].value, t[2].value])).collect()
}

pub(super) fn xyz_of(s: &Statement) -> Xyz {
    let mut spans = s.number_items().iter().map(|t| t.span);
    std::array::from_fn(|_| spans.next().unwrap_or_default())
}
