//! Statements that name a circle, which the next position ends: `CIRCLE`, `MOVARC`, `TLON`.

use super::arc::{Arc, Circle, Sense};
use super::layout::{GroupSlot, Slot};
use super::lex::Record;
use super::motion::{TargetProperties, xyz_of};
use super::reader::Reader;
use super::refusal::Outcome;
use super::state::{Checked, Known, PendingArc};
use super::statement::Statement;
use super::vector::{add, cross, dot, norm, scale, sub, unit};
use crate::{Reason, Role};
use deflex_text::Span;

/// Largest distance of the printed end of an arc from its centre, in radii: CATIA prints it on the circle, to a digit.
const FAR: f64 = 100.0;

impl Reader {
    /// `CIRCLE/x,y,z,i,j,k[,r[,t,f,d,e]][,TIMES,n]`: the next position is its end.
    pub(super) fn circle(&mut self, record: Record, s: &Statement) -> Outcome {
        let numbers = s.number_items();
        let turns = if s.has(b"TIMES") { numbers.iter().last().map_or(1.0, |t| t.value) } else { 1.0 };
        let Some([x, y, z, i, j, k]) = numbers.first() else {
            self.pending = None;
            return Err(Reason::CircleWithoutCentre);
        };
        let count = numbers.count() - usize::from(s.has(b"TIMES"));
        let (clockwise, sense) = if s.has(b"CLOCKWISE") || s.has(b"CLW") {
            (true, Known::Stated)
        } else if s.has(b"COUNTERCLOCKWISE") || s.has(b"CCLW") {
            (false, Known::Stated)
        } else if self.dialect.prints_circles_of_its_own() {
            (self.dialect.clockwise(count), Known::Dialect)
        } else {
            (self.dialect.clockwise(count), Known::Guessed)
        };
        let radius = if count > 6 { numbers.first::<7>().map(|v| v[6]) } else { None };
        let axis = scale([i, j, k], if clockwise { -1.0 } else { 1.0 });
        let circle = Circle { centre: [x, y, z], axis, radius, turns };
        self.open_arc(PendingArc { circle, centres: [Some(xyz_of(s)), None], record, sense })
    }

    /// `MOVARC/c,n,r,ANGLE,a`: right-handed; whole turns beyond the first are counted from the angle.
    pub(super) fn movarc(&mut self, record: Record, s: &Statement) -> Outcome {
        let Some([x, y, z, i, j, k, r]) = s.number_items().first() else {
            return Err(Reason::ArcWithoutCentre);
        };
        let angle = s.number_items().iter().nth(7).map_or(0.0, |t| t.value);
        let axis = scale([i, j, k], if angle < 0.0 { -1.0 } else { 1.0 });
        let turns = (angle.abs() / 360.0).ceil();
        let circle = Circle { centre: [x, y, z], axis, radius: Some(r), turns };
        self.open_arc(PendingArc { circle, centres: [Some(xyz_of(s)), None], record, sense: Known::Stated })
    }

    fn open_arc(&mut self, arc: PendingArc) -> Outcome {
        self.checked = None;
        if let Some(before) = self.pending.replace(arc) {
            self.refuse(before.record, Reason::ArcWithoutEnd);
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
            return Err(Reason::SymbolicGeometry);
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
            return Err(Reason::ArcWithoutLine);
        };
        if round.iter().any(|number| line.iter().any(|other| other.span == number.span)) {
            self.modal.position = None;
            return Err(Reason::ArcLineNotApart);
        }
        let (from, to) = ([ends[0], ends[1], ends[2]], [ends[3], ends[4], ends[5]]);
        // An end is projected onto the circle along its line: from a large distance, a shift of it would be lost.
        if !sub(to, from).iter().all(|along| along.abs() <= FAR * radius.abs()) {
            self.modal.position = None;
            return Err(Reason::ArcEndsFarOff);
        }
        self.ensure_units(record, s)?;
        let end = on_circle(centre, radius, from, to);
        let spans: Vec<Span> = line.iter().map(|t| t.span).collect();
        let centre_spans: Vec<Span> = round.iter().map(|t| t.span).take(3).collect();
        let xyz = [spans[3], spans[4], spans[5]];
        let centres = [Some([centre_spans[0], centre_spans[1], centre_spans[2]]), Some([spans[0], spans[1], spans[2]])];
        let axis = tangent.zip(self.modal.position).map(|(tangent, start)| cross(sub(start, centre), tangent));
        // Without a start or its direction it is no arc, but its centre still moves with its end.
        let circle = Circle { centre, axis: axis.unwrap_or([0.0; 3]), radius: Some(radius), turns: 1.0 };
        self.pending = Some(PendingArc { circle, centres, record, sense: Known::Stated });
        self.arrive(record, xyz, end, true);
        Ok(())
    }

    /// Adds the points of an arc before its end. Returns their group. If it is no arc, the motion is straight; its centre still moves with its
    /// end, so that the file reads the same afterwards.
    pub(super) fn arc_points(&mut self, pending: PendingArc, end: [f64; 3], ahead: bool) -> u32 {
        let tolerance = self.options.arc_tolerance_mm / self.mm_per_unit();
        let path = self.modal.position.ok_or(Reason::ArcWithoutStart).and_then(|start| {
            let arc = Arc::new(&pending.circle, start, end)?;
            arc.chords(tolerance).map(|n| (start, arc, n))
        });
        let group = u32::try_from(self.layout.groups.len()).unwrap_or(u32::MAX);
        let (first, straight) = (self.targets.len(), path.is_err());
        self.layout.groups.push(GroupSlot { first, centres: pending.centres, straight, with_start: true });
        match path {
            Ok((start, arc, chords)) => {
                self.arcs += usize::from(!ahead);
                let on_way = self.on_way(Slot::OnWay { group }, ahead);
                for i in 1..chords {
                    self.push(pending.record, arc.point(part(i, chords)), on_way);
                }
                if pending.sense != Known::Stated && pending.circle.turns <= 1.0 && !ahead {
                    self.checked = Some(Checked { arc: pending, start, end });
                    if self.modal.fed.is_some_and(|feed| arc.turns_back(feed)) {
                        self.refuse(pending.record, Reason::ArcTangent);
                    }
                }
            }
            Err(reason) => self.refuse(pending.record, reason),
        }
        group
    }

    fn on_way(&self, slot: Slot, ahead: bool) -> TargetProperties {
        TargetProperties { role: Role::Interpolated, ahead: u32::from(ahead), ..self.step(slot) }
    }

    /// Checks an arc whose direction of travel is not stated, with the next position after it, which is reached straight. If that position is
    /// on the arc, the direction was wrong, or a line crosses the circle.
    pub(super) fn check_sense(&mut self, next: [f64; 3]) {
        let Some(Checked { arc, start, end }) = self.checked.take() else { return };
        let contradicts = matches!(arc.circle.sense(start, &[end, next]), Sense::Reversed | Sense::Neither);
        // If the system is known, only points like those of an arc in the opposite direction contradict it.
        let like_an_arc = || arc.circle.reversed().steps(start, &[end, next]);
        if contradicts && (arc.sense == Known::Guessed || like_an_arc()) {
            self.refuse(arc.record, Reason::ArcSense);
        }
    }

    /// The direction of an arc whose points are listed: the points decide, and not its axis.
    pub(super) fn sense_of_list(&mut self, points: &[[f64; 3]]) {
        let (Some(arc), Some(start)) = (self.pending, self.modal.position) else { return };
        if arc.sense == Known::Stated || arc.circle.turns > 1.0 {
            return;
        }
        match arc.circle.sense(start, points) {
            Sense::AsSaid | Sense::Unknown => {}
            Sense::Reversed => {
                self.warn("cl.arc-sense", "the direction of arcs is taken from the points that follow them");
                self.pending = Some(PendingArc { circle: arc.circle.reversed(), sense: Known::Stated, ..arc });
            }
            Sense::Neither => self.refuse(arc.record, Reason::ArcSense),
        }
    }
}

#[allow(clippy::cast_precision_loss)] // some thousand chords
fn part(i: usize, chords: usize) -> f64 {
    i as f64 / chords as f64
}

/// The intersection of the line from the centre through `to` with the circle: `to` itself if it is on it.
fn on_circle(centre: [f64; 3], radius: f64, from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    /// Rounding of radius and ends by printed digits, as a share of the radius.
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
