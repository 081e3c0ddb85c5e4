//! Statements that move the tool.

use super::Point;
use super::arc::{Arc, Circle};
use super::dialect::Dialect;
use super::layout::{ArcSlot, Slot, StartSlot};
use super::lex::{Kind, Record};
use super::modal::Xyz;
use super::read::{ARC_WITHOUT_END, Outcome, Reader};
use super::statement::Statement;
use super::vector::{add, cross, dot, norm, scale, sub, unit};
use crate::program::{Editable, Goal, Motion, Role, Target};
use crate::text::{Span, number};

/// A printed axis shorter or longer than this is no unit vector; four printed digits give 0.9998.
const AXIS_LENGTH: std::ops::Range<f64> = 0.9..1.1;

/// How much a printed triple may differ from unit length to be an axis rather than a further point.
const UNIT_TRIPLE: f64 = 2e-3;

/// Radii by which the printed end of an arc may be off its centre: CATIA prints it on the circle, give or take a digit.
const FAR: f64 = 100.0;

/// Arc read, its end not yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingArc {
    pub(super) circle: Circle,
    pub(super) centres: [Option<Xyz>; 2],
    pub(super) record: Record,
}

impl Reader {
    /// `GOTO/x,y,z[,i,j,k]`, or several positions (Creo).
    pub(super) fn goto(&mut self, record: Record, s: &Statement) -> Outcome {
        let read = self.position(record, s);
        if read.is_err() {
            // The machine moves all the same: where to is unknown.
            self.modal.position = None;
            self.modal.rapid = false;
            self.pending = None;
        }
        read
    }

    fn position(&mut self, record: Record, s: &Statement) -> Outcome {
        let Some(numbers) = s.numbers() else {
            if s.items.first().is_some_and(|t| t.kind == Kind::Word && is_name(&s.bytes[t.span.range()])) {
                self.source_word(record);
            }
            return Err("position is not given by numbers");
        };
        let count = numbers.count();
        let mut tokens = numbers.iter();
        let mut triple = || -> Option<(Xyz, [f64; 3])> {
            let t = [tokens.next()?, tokens.next()?, tokens.next()?];
            Some((t.map(|t| t.span), t.map(|t| t.value)))
        };
        let Some((xyz, position)) = triple() else {
            return Err("position without three numbers");
        };
        self.ensure_units(record, s)?;
        self.literal_targets += 1;
        match count {
            3 => self.modal.axis = self.axis_where_none_is_printed(),
            // A Creo list of two points on an arc looks like a position with an axis.
            6 => match triple() {
                Some((_, printed)) if self.pending.is_none() || is_unit(printed) => match axis(printed) {
                    Some(axis) => self.modal.axis = axis,
                    None => {
                        self.literal_targets -= 1;
                        return Err("tool axis is no unit vector");
                    }
                },
                Some((next_xyz, next)) => {
                    self.literal_targets += 1;
                    self.modal.axis = self.axis_where_none_is_printed();
                    self.list(record, &[(xyz, position), (next_xyz, next)]);
                    return Ok(());
                }
                None => {}
            },
            n if n % 3 == 0 => {
                let mut points = vec![(xyz, position)];
                while let Some(point) = triple() {
                    points.push(point);
                }
                // Every second triple of unit length: positions with axes.
                if n % 6 == 0 && points.iter().skip(1).step_by(2).all(|(_, v)| is_unit(*v)) {
                    if let Some(axis) = points.last().and_then(|p| axis(p.1)) {
                        self.modal.axis = axis;
                    }
                    points = points.into_iter().step_by(2).collect();
                } else {
                    self.modal.axis = self.axis_where_none_is_printed();
                }
                self.literal_targets += points.len() - 1;
                self.list(record, &points);
                return Ok(());
            }
            _ => {
                self.literal_targets -= 1;
                return Err("position with a wrong count of numbers");
            }
        }
        self.arrive(record, xyz, position, true);
        Ok(())
    }

    /// Several points of one statement: on an arc they lie on it, and the last is its end.
    pub(super) fn list(&mut self, record: Record, points: &[(Xyz, [f64; 3])]) {
        let pending = self.pending;
        for (i, &(xyz, position)) in points.iter().enumerate() {
            let last = i + 1 == points.len();
            if let (Some(arc), true) = (pending, i > 0) {
                self.pending = Some(PendingArc { centres: [None; 2], ..arc });
            }
            self.arrive(record, xyz, position, last || pending.is_none());
        }
    }

    /// The tool arrives at a printed position, straight or on the pending arc.
    pub(super) fn arrive(&mut self, record: Record, xyz: Xyz, position: [f64; 3], end: bool) {
        let arc = self.pending.take();
        if end {
            self.ordinal += 1;
        }
        let slot = match arc {
            Some(arc) => self.arc_points(arc, position, !end, xyz),
            None => Slot::Point { xyz, frame: self.frame },
        };
        let role = if end { Role::End } else { Role::Interpolated };
        self.push(record, position, self.modal.axis, role, u32::from(!end), slot);
        self.modal.position = Some(position);
        if end {
            self.modal.rapid = false;
        }
    }

    /// Points on the way of an arc, and the slot of its end. What is no arc goes straight, yet its
    /// centre moves along when its end does, so that it reads the same afterwards.
    fn arc_points(&mut self, pending: PendingArc, end: [f64; 3], ahead: bool, xyz: Xyz) -> Slot {
        let tolerance = self.options.arc_tolerance_mm / self.mm_per_unit();
        let path = self.modal.position.ok_or("arc without a start").and_then(|start| {
            let arc = Arc::new(&pending.circle, start, end)?;
            arc.chords(tolerance).map(|n| (arc, n))
        });
        let slot = u32::try_from(self.layout.arcs.len()).unwrap_or(u32::MAX);
        self.layout.arcs.push(ArcSlot { first: self.targets.len(), centres: pending.centres, straight: path.is_err() });
        match path {
            Ok((arc, chords)) => {
                self.arcs += usize::from(!ahead);
                for i in 1..chords {
                    #[allow(clippy::cast_precision_loss)]
                    let point = arc.point(i as f64 / chords as f64);
                    let slot = Slot::OnArc { arc: slot };
                    self.push(pending.record, point, self.modal.axis, Role::Interpolated, u32::from(ahead), slot);
                }
            }
            Err(reason) => self.keep_fault(pending.record, reason),
        }
        Slot::ArcEnd { xyz, frame: self.frame, arc: slot }
    }

    /// `GODLTA/dx,dy,dz`, or `GODLTA/d` along the tool axis.
    pub(super) fn godlta(&mut self, record: Record, s: &Statement) -> Outcome {
        self.pending = None;
        let Some(numbers) = s.numbers() else {
            self.modal.position = None;
            return Err("increment is not given by numbers");
        };
        let Some(start) = self.modal.position else { return Err("increment from an unknown position") };
        self.ensure_units(record, s)?;
        let mut spans = numbers.iter().map(|t| t.span);
        let (step, slot) = match (numbers.count(), numbers.first::<3>(), numbers.first::<1>()) {
            (3.., Some(step), _) => {
                let mut next = || spans.next().unwrap_or_default();
                (step, Slot::Step { xyz: [next(), next(), next()], frame: self.frame })
            }
            (1, _, Some([along])) => (scale(self.modal.axis, along), Slot::AlongAxis),
            _ => return Err("increment with a wrong count of numbers"),
        };
        self.literal_targets += 1;
        self.ordinal += 1;
        let position = add(start, step);
        self.push(record, position, self.modal.axis, Role::End, 0, slot);
        self.modal.position = Some(position);
        self.modal.rapid = false;
        Ok(())
    }

    pub(super) fn from(&mut self, s: &Statement) -> Outcome {
        let numbers = s.number_items();
        let Some([x, y, z]) = numbers.first::<3>() else {
            return if s.items.is_empty() { Ok(()) } else { Err("start is not given by numbers") };
        };
        if let Some(axis) = numbers.first::<6>().and_then(|v| axis([v[3], v[4], v[5]])) {
            self.modal.axis = axis;
        }
        let mut spans = numbers.iter().map(|t| t.span);
        let mut next = || spans.next().unwrap_or_default();
        self.modal.from = Some(([next(), next(), next()], self.frame));
        self.modal.position = Some([x, y, z]);
        Ok(())
    }

    /// `CIRCLE/x,y,z,i,j,k[,r[,t,f,d,e]][,TIMES,n]`: the next position is its end.
    pub(super) fn circle(&mut self, record: Record, s: &Statement) -> Outcome {
        let numbers = s.number_items();
        let turns = if s.has(b"TIMES") { numbers.iter().last().map_or(1.0, |t| t.value) } else { 1.0 };
        let Some([x, y, z, i, j, k]) = numbers.first() else {
            self.pending = None;
            return Err("circle without centre and axis");
        };
        let count = numbers.count() - usize::from(s.has(b"TIMES"));
        let clockwise = if s.has(b"CLOCKWISE") || s.has(b"CLW") {
            true
        } else if s.has(b"COUNTERCLOCKWISE") || s.has(b"CCLW") {
            false
        } else {
            self.dialect.clockwise(count)
        };
        let radius = if count > 6 { numbers.first::<7>().map(|v| v[6]) } else { None };
        let axis = scale([i, j, k], if clockwise { -1.0 } else { 1.0 });
        self.open_arc(record, Circle { centre: [x, y, z], axis, radius, turns }, [Some(xyz_of(s)), None])
    }

    /// `MOVARC/c,n,r,ANGLE,a`: right-handed; whole turns beyond the first are counted from the angle.
    pub(super) fn movarc(&mut self, record: Record, s: &Statement) -> Outcome {
        let Some([x, y, z, i, j, k, r]) = s.number_items().first() else {
            return Err("arc without centre, axis and radius");
        };
        let angle = s.number_items().iter().nth(7).map_or(0.0, |t| t.value);
        let axis = scale([i, j, k], if angle < 0.0 { -1.0 } else { 1.0 });
        let turns = (angle.abs() / 360.0).ceil();
        let circle = Circle { centre: [x, y, z], axis, radius: Some(r), turns };
        self.open_arc(record, circle, [Some(xyz_of(s)), None])
    }

    pub(super) fn open_arc(&mut self, record: Record, circle: Circle, centres: [Option<Xyz>; 2]) -> Outcome {
        if let Some(arc) = self.pending.replace(PendingArc { circle, centres, record }) {
            self.keep_fault(arc.record, ARC_WITHOUT_END);
        }
        Ok(())
    }

    /// `TLON,GOFWD/(CIRCLE/c,r),ON,(LINE/c,e)`, after `INDIRV/` with the tangent at the start.
    pub(super) fn tlon(&mut self, record: Record, s: &Statement) -> Outcome {
        let tangent = self.modal.tangent.take();
        let (circle, cylinder) = (s.nested(b"CIRCLE"), s.nested(b"CYLNDR"));
        let Some(round) = circle.or(cylinder) else {
            self.source_word(record);
            self.modal.position = None;
            return Err("motion along symbolic geometry");
        };
        let line = s.nested(b"LINE");
        let radius = match cylinder {
            Some(c) if circle.is_none() => c.first::<7>().map(|v| v[6]),
            _ => round.first::<4>().map(|v| v[3]),
        };
        let (Some(centre), Some(radius), Some(line), Some(ends)) =
            (round.first::<3>(), radius, line, line.and_then(|l| l.first::<6>()))
        else {
            self.modal.position = None;
            return Err("arc without circle and line");
        };
        if round.iter().any(|number| line.iter().any(|other| other.span == number.span)) {
            self.modal.position = None;
            return Err("arc whose circle and line are not apart");
        }
        let (from, to) = ([ends[0], ends[1], ends[2]], [ends[3], ends[4], ends[5]]);
        // An end is put onto the circle along its line: from far off, a shift of it would be lost.
        if !sub(to, from).iter().all(|along| along.abs() <= FAR * radius.abs()) {
            self.modal.position = None;
            return Err("arc that ends far off its circle");
        }
        self.ensure_units(record, s)?;
        let end = on_circle(centre, radius, from, to);
        let spans: Vec<Span> = line.iter().map(|t| t.span).collect();
        let centre_spans: Vec<Span> = round.iter().map(|t| t.span).take(3).collect();
        let xyz = [spans[3], spans[4], spans[5]];
        let centres = [Some([centre_spans[0], centre_spans[1], centre_spans[2]]), Some([spans[0], spans[1], spans[2]])];
        let axis = tangent.zip(self.modal.position).map(|(tangent, start)| cross(sub(start, centre), tangent));
        // Without a start or its direction it is no arc; its centre moves with its end all the same.
        let circle = Circle { centre, axis: axis.unwrap_or([0.0; 3]), radius: Some(radius), turns: 1.0 };
        self.pending = Some(PendingArc { circle, centres, record });
        self.arrive(record, xyz, end, true);
        Ok(())
    }

    pub(super) fn push(
        &mut self,
        record: Record,
        printed: [f64; 3],
        axis: [f64; 3],
        role: Role,
        ahead: u32,
        slot: Slot,
    ) {
        let frame = &self.layout.frames[self.frame as usize];
        let axis = unit(frame.turn(axis)).unwrap_or(axis);
        let mut position_mm = frame.position(printed);
        if self.options.point == Point::Centre {
            let radius = self.options.corner_radius_mm.unwrap_or(0.0);
            position_mm = sub(position_mm, scale(axis, radius));
        }
        let rapid = self.modal.rapid;
        if !rapid && self.cutter.is_none() {
            self.cutter = self.modal.cutter;
        }
        let editable = match self.modal.blocked {
            Some(reason) => Editable::No(reason),
            None if self.modal.cutcom => Editable::No("under radius compensation (CUTCOM)"),
            None => Editable::Pose,
        };
        if let Some((xyz, frame)) = self.modal.from.take() {
            self.layout.starts.push(StartSlot { first: self.targets.len(), xyz, frame });
        }
        self.layout.slots.push(slot);
        self.targets.push(Target {
            ordinal: self.ordinal + ahead,
            role,
            motion: Motion::Linear,
            goal: Goal::Axis { position_mm, axis },
            tool: 0,
            wobj: 0,
            feed_mm_s: if rapid { None } else { self.modal.feed_mm_s() },
            spindle_rpm: self.modal.rpm(),
            rapid,
            mark: self.modal.mark,
            editable,
            name: None,
            source: 0,
            span: record.span,
            line: u32::try_from(record.line).unwrap_or(u32::MAX),
        });
    }

    /// The axis of a position that prints none, by dialect.
    pub(super) fn axis_where_none_is_printed(&self) -> [f64; 3] {
        match self.dialect {
            // Creo leaves the axis out where it is the machine's z.
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

/// Whether a word names something, rather than being a number that is none (`NaN`, `-inf`, `1E999`, `1..5`).
fn is_name(word: &[u8]) -> bool {
    word.first().is_some_and(u8::is_ascii_alphabetic) && !number::is_none(word)
}

fn is_unit(v: [f64; 3]) -> bool {
    (norm(v) - 1.0).abs() < UNIT_TRIPLE
}

fn xyz_of(s: &Statement) -> Xyz {
    let mut spans = s.number_items().iter().map(|t| t.span);
    std::array::from_fn(|_| spans.next().unwrap_or_default())
}

/// Where the line from the centre through `to` meets the circle: `to` itself where it lies on it.
fn on_circle(centre: [f64; 3], radius: f64, from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    /// Printed digits of radius and ends, as a part of the radius.
    const PRINTED: f64 = 1e-3;
    let off = (norm(sub(to, centre)) - radius).abs();
    if off <= PRINTED * radius.abs() {
        return to;
    }
    let Some(along) = unit(sub(to, from)) else { return to };
    let a = sub(from, centre);
    let b = dot(a, along);
    let root = b * b - dot(a, a) + radius * radius;
    if root < 0.0 { to } else { add(from, scale(along, root.sqrt() - b)) }
}
