//! Builds targets from executed motions: their position, their frames, and whether the numbers may be edited.

use super::arcs;
use super::builder::{Builder, Built, EditablePosition, Visit, are_in_one_frame, refuse};
use super::position::{Body, Number, Pose, Position};
use crate::EXTERNAL_AXES;
use crate::lowered::intern;
use crate::orientation::{from_zyx_deg, quaternion};
use crate::shared::follows;
use crate::{
    Conf, Editable, ExternalAxes, Goal, GroupAxis, Mark, Motion as Path, Predecessor, Reason, Role, Target, Tool,
    ToolData, Wobj, WobjData,
};
use deflex_lang::ir;
use deflex_lang::run::Outcome;
use deflex_lang::tp::{self, Defined, Frame, Held, Motion, Point, Speed, StatementKind};
use nalgebra::{Isometry3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

const SELECTED_LATER: [Reason; 2] = [Reason::FrameSelected, Reason::ToolSelected];
const OTHER_SELECTED: [Reason; 2] = [Reason::OtherFrameSelected, Reason::OtherToolSelected];
const REDEFINED: [Reason; 2] = [Reason::FrameRedefined, Reason::ToolRedefined];

impl<'a> Builder<'a> {
    /// All of it.
    pub(super) fn build(mut self, outcome: &'a Outcome) -> Built {
        let code = self.code;
        for (line, kind) in code.lines.iter().zip(&code.kinds) {
            for named in tp::positions_named(line, kind) {
                let number = tp::count(named.index);
                self.freeze(number, Reason::PositionNamed);
                if named.is_assigned {
                    self.assigned.insert(number);
                }
            }
        }
        let visits: Vec<Visit<'_>> = outcome
            .motions
            .iter()
            .enumerate()
            .filter_map(|(run, moved)| {
                let at = code.lines.binary_search_by_key(&moved.place.span, |line| line.span).ok()?;
                let StatementKind::Motion(motion) = &code.kinds[at] else { return None };
                Some(Visit { run, at, motion, held: Held(moved) })
            })
            .collect();
        let rows = arcs::rows(code);
        let mut open = &visits[..];
        while let Some(visit) = open.first() {
            let row = &rows[rows.partition_point(|row| row.end <= visit.at)..];
            let count = match row.first().filter(|row| row.contains(&visit.at)) {
                Some(row) => self.row(open, row.clone()),
                None => {
                    self.motion(visit);
                    1
                }
            };
            open = &open[count..];
        }
        self.hold_what_others_use(outcome);
        self.keep_halves_of_arcs();
        self.report_kept(outcome);
        self.built
    }

    /// The position with a number.
    fn position(&self, number: Option<u32>) -> Result<usize, Reason> {
        match self.numbers.get(&number.ok_or(Reason::PositionUnknown)?) {
            Some((at, false)) => Ok(*at),
            Some((_, true)) => Err(Reason::PositionTwice),
            None => Err(Reason::PositionMissing),
        }
    }

    /// The position to which a motion goes, or from which the position register comes to which it goes.
    fn comes_from(&self, visit: &Visit<'_>, role: Role) -> Result<usize, Reason> {
        match (visit.number(role), &visit.held.origins()[..]) {
            (Err(Reason::PositionRegister), [origin]) => Ok(origin.0 as usize),
            (number, _) => self.position(number?),
        }
    }

    fn freeze(&mut self, number: Option<u32>, why: Reason) {
        match self.position(number) {
            Ok(at) => drop(self.frozen.entry(at).or_insert(why)),
            Err(Reason::PositionUnknown) => drop(self.all_frozen.get_or_insert(why)),
            Err(_) => {}
        }
    }

    /// A motion to a position that is known only at run time may go to each position that was recorded in the selected frames: a
    /// controller refuses all others.
    fn freeze_where_it_may_go(&mut self, held: Held<'_>) {
        for (at, position) in self.positions.iter().enumerate() {
            let frames = match &position.body {
                Body::Pose(pose) => pose.frames,
                Body::Joints { frames, .. } => *frames,
                Body::None(_) => continue,
            };
            let is_refused =
                [Frame::User, Frame::Tool].into_iter().zip(frames).any(|(frame, recorded)| match recorded {
                    Number::Known(own) => held.selected(frame).is_some_and(|selected| selected != own),
                    Number::Selected => false,
                });
            if !is_refused {
                self.frozen.entry(at).or_insert(Reason::MayGoThere);
            }
        }
    }

    fn motion(&mut self, visit: &Visit<'a>) {
        self.built.motions += 1;
        self.built.arcs += usize::from(visit.motion.path == ir::Path::Circular);
        let points: Result<Vec<_>, _> = visit.roles().iter().map(|role| self.point(visit, *role)).collect();
        let points =
            points.and_then(|points| if are_in_one_frame(&points) { Ok(points) } else { Err(Reason::ArcFrames) });
        match points {
            Ok(points) => {
                let first = self.built.targets.len();
                points.into_iter().for_each(|point| self.push(visit, point));
                if visit.motion.via.is_some() {
                    self.built.points.push(first..self.built.targets.len());
                }
            }
            Err(why) => self.lose(visit, why),
        }
    }

    /// Adds a point of a motion.
    pub(super) fn push(&mut self, visit: &Visit<'a>, (mut target, site): (Target, EditablePosition)) {
        target.predecessor = match visit.held.0.from {
            // The end of an arc comes after its circle point.
            _ if self.last == Some(visit.run) => Predecessor::Previous,
            Predecessor::Previous if self.last.is_none_or(|last| last + 1 != visit.run) => Predecessor::Unknown,
            from => from,
        };
        target.begin_at(self.ends.begin_of(visit.held.0));
        if target.is_end() {
            self.ends.add(visit.held.0, &target);
        }
        self.last = Some(visit.run);
        if is_in_tool(visit.motion) {
            self.built.in_tool.insert(self.built.targets.len());
        }
        self.built.targets.push(target);
        self.built.sites.push(site);
    }

    /// Records a motion with an unknown end. The positions that it names must not be edited.
    pub(super) fn lose(&mut self, visit: &Visit<'_>, why: Reason) {
        for number in visit.roles().iter().filter_map(|role| visit.number(*role).ok()) {
            match number {
                Some(_) => self.freeze(number, Reason::MovedToo),
                None => {
                    self.built.anywhere.get_or_insert(visit.at);
                    self.freeze_where_it_may_go(visit.held);
                }
            }
        }
        for origin in visit.held.origins() {
            self.frozen.entry(origin.0 as usize).or_insert(Reason::PositionNamed);
        }
        self.unknown(visit.at, why);
    }

    /// The target for a point of a motion; `Err` has the reason if its place is unknown.
    pub(super) fn point(&mut self, visit: &Visit<'_>, role: Role) -> Result<(Target, EditablePosition), Reason> {
        let motion = visit.motion;
        let known = self.comes_from(visit, role)?;
        let position = &self.positions[known];
        // The program may have given it another value, in this cycle or in the one before.
        if self.assigned.contains(&Some(position.number)) || self.assigned.contains(&None) {
            return Err(Reason::PositionNamed);
        }
        let spline = motion.moved.filter(|_| stays_at_its_point(motion));
        // The register may also move external axes.
        let is_alone = position.external == [None; EXTERNAL_AXES] && position.groups.is_empty();
        let offset = visit.held.offset_mm().filter(|_| is_alone && motion.shifted().is_some());
        let shifted = motion.shifted().filter(|_| offset.is_none());
        let follows = matches!(position.body, Body::Pose(_));
        let is_known = spline.is_some() || (offset.is_some() || shifted.is_some()) && follows;
        if let Some(why) = motion.moved.or(shifted).filter(|_| !is_known) {
            return Err(why);
        }
        if let Some(why) = visit.held.displaced() {
            return Err(why);
        }
        if motion.coordinated && position.groups.is_empty() {
            return Err(Reason::Coordinated);
        }
        let (goal, frames, site, why) = match &position.body {
            Body::None(why) => return Err(*why),
            Body::Pose(pose) => {
                (goal(pose, motion, offset.unwrap_or_default()), pose.frames, Some(known as u32), spline)
            }
            Body::Joints { deg, frames } => (Goal::Joints { deg: *deg }, *frames, None, Some(Reason::Joints)),
        };
        let mark = visit.held.mark();
        let why = why.or(mark.err()).or(self.all_frozen).or(shifted);
        let mark = match mark {
            Ok(Some(b"air")) => Some(Mark::Air),
            Ok(Some(b"cut")) => Some(Mark::Cut),
            _ => None,
        };
        let (frames, name) = match motion.end {
            // A position register names no frames.
            Point::Register(index) if visit.number(role).is_err() => {
                ([Number::Selected; 2], format!("PR[{}]", String::from_utf8_lossy(index)))
            }
            _ => (frames, format!("P[{}]", position.number)),
        };
        let frames = self.frames(frames, visit.held)?;
        let path = match (motion.path, &goal) {
            (ir::Path::Joint, Goal::Joints { .. }) => Path::AbsoluteJoint,
            (ir::Path::Joint, _) => Path::Joint,
            (ir::Path::Circular, _) => Path::Circular,
            _ => Path::Linear,
        };
        let line = &self.code.lines[visit.at];
        let ordinal = u32::try_from(self.built.motions).unwrap_or(u32::MAX);
        let (place, number) =
            (ir::SourceSpan { source: 0, span: line.span }, u32::try_from(line.line).unwrap_or(u32::MAX));
        // `push` sets the predecessor: the points before are not added yet.
        let target = Target {
            role,
            // A run multiplies the number in a register by the override, per cent.
            feed_mm_s: motion.speed.zip(visit.held.0.speed).and_then(|(speed, percent)| {
                let (Speed::Number(unit_mm_s) | Speed::Register { unit_mm_s, .. }) = speed;
                Some(unit_mm_s * percent / 100.0).filter(|mm_s| *mm_s > 0.0)
            }),
            mark,
            editable: why.map_or(Editable::Pose, Editable::No),
            located: shifted.is_none(),
            external: self.external(position, motion),
            name: Some(name.into()),
            ..Target::new(ordinal, path, goal, frames, place, number)
        };
        Ok((target, site))
    }

    /// The external axes, including those of other motion groups.
    fn external(&self, position: &Position, motion: &Motion<'_>) -> Option<Arc<ExternalAxes>> {
        let written = position.external;
        if written == [None; EXTERNAL_AXES] && position.groups.is_empty() {
            return None;
        }
        let at_rest = self.axes.map(|used| !used);
        let rests = |axis: &GroupAxis| GroupAxis { at_rest: !self.groups.contains(&axis.axis), ..*axis };
        let (groups, coordinated) = (position.groups.iter().map(rests).collect(), motion.coordinated);
        Some(Arc::new(ExternalAxes { written, at_rest, groups, coordinated, ..ExternalAxes::default() }))
    }

    /// Indices of tool and work object.
    fn frames(&mut self, recorded: [Number; 2], held: Held<'_>) -> Result<[u16; 2], Reason> {
        let (mut numbers, mut own) = ([0; 2], [None; 2]);
        for (i, frame) in [Frame::User, Frame::Tool].into_iter().enumerate() {
            numbers[i] = match (recorded[i], held.selected(frame)) {
                (Number::Known(own), Some(selected)) if own != selected => return Err(OTHER_SELECTED[i]),
                (Number::Known(own), _) => own,
                (Number::Selected, Some(selected)) => selected,
                (Number::Selected, None) => return Err(SELECTED_LATER[i]),
            };
            own[i] = match held.defined(frame, numbers[i]) {
                Defined::InCell => (numbers[i] == 0).then(Isometry3::identity),
                Defined::InProgram(pose) => Some(pose),
                Defined::AtRunTime => return Err(REDEFINED[i]),
            };
        }
        let [user, tool] = own
            .map(|own| own.map(|own| (own.translation.vector.into(), quaternion(&own.rotation.to_rotation_matrix()))));
        let user = user.map(|(uframe_mm, uframe_quat)| WobjData { uframe_mm, uframe_quat, ..WobjData::WORLD });
        let tool = tool.map(|(tcp_mm, tcp_quat)| ToolData { tcp_mm, tcp_quat, ..ToolData::FLANGE });
        let wobj = Wobj { name: format!("UF {}", numbers[0]).into(), data: user, unit: None };
        let tool = Tool { name: format!("UT {}", numbers[1]).into(), data: tool };
        Ok([intern(&mut self.built.tools, tool), intern(&mut self.built.wobjs, wobj)])
    }

    /// Records a motion with an unknown end.
    fn unknown(&mut self, at: usize, why: Reason) {
        let ordinal = u32::try_from(self.built.motions).unwrap_or(u32::MAX);
        let motion = self.built.kept.unknown_motion(ordinal, 0, self.code.lines[at].span, why);
        self.built.unknown.push(motion);
        self.keep(at, why);
    }

    fn keep(&mut self, at: usize, reason: Reason) {
        self.built.kept.keep(0, self.code.lines[at].span, reason);
    }

    /// Keeps the targets whose numbers must not be edited because of other uses.
    fn hold_what_others_use(&mut self, outcome: &Outcome) {
        let built = &mut self.built;
        let is_copied = |site: u32| {
            let own = tp::Whole::Taught(self.positions[site as usize].number);
            self.code.kinds.iter().any(|kind| matches!(kind, StatementKind::PositionRegister(_, of) if *of == own))
        };
        for (target, site) in built.targets.iter_mut().zip(&built.sites) {
            let Some(site) = site else { continue };
            if outcome.used.contains_key(&ir::TokenId(*site)) {
                refuse(target, if is_copied(*site) { Reason::PositionNamed } else { Reason::CountedFrom });
            }
            if let Some(why) = self.frozen.get(&(*site as usize)).copied().or(self.all_frozen) {
                refuse(target, why);
            }
        }
        // A target that must stay fixes its numbers for all motions that use them. Whether one that moves with them may do so is known when
        // the corrections are.
        let mut held: BTreeMap<u32, Reason> = BTreeMap::new();
        for (target, site) in built.targets.iter().zip(&built.sites).filter(|(target, _)| !follows(target.editable)) {
            if let (Editable::No(why), Some(site)) = (target.editable, site) {
                held.entry(*site).or_insert(why);
            }
        }
        for (target, site) in built.targets.iter_mut().zip(&built.sites) {
            if let Some(why) = site.and_then(|site| held.get(&site).copied()) {
                refuse(target, why);
            }
        }
    }

    fn report_kept(&mut self, outcome: &Outcome) {
        let spans: BTreeMap<_, _> = self.code.lines.iter().enumerate().map(|(at, line)| (line.span, at)).collect();
        let kept: BTreeSet<_> = self
            .built
            .targets
            .iter()
            // Circle points that are not in the text have the reason of their arc.
            .filter(|target| target.motion != Path::AbsoluteJoint && target.name.is_some())
            .filter_map(|target| match target.editable {
                Editable::No(why) => Some((spans[&target.span], why)),
                _ => None,
            })
            .collect();
        kept.into_iter().for_each(|(at, why)| self.keep(at, why));
        let ran: BTreeSet<_> = outcome.motions.iter().map(|moved| moved.place.span).collect();
        for at in 0..self.code.lines.len() {
            if matches!(self.code.kinds[at], StatementKind::Motion(_)) && !ran.contains(&self.code.lines[at].span) {
                self.keep(at, Reason::NotReached);
            }
        }
    }
}

/// Motion options that do not change where the motion ends.
fn stays_at_its_point(motion: &Motion<'_>) -> bool {
    motion.moved == Some(Reason::SplineOption)
}

/// Whether a motion ends at a distance from its position in the axes of the tool.
fn is_in_tool(motion: &Motion<'_>) -> bool {
    motion.shifted() == Some(Reason::ToolMovedByRegister)
}

/// A pose at a distance from X, Y, Z with W, P, R, which are turns about the fixed axes x, y, z.
fn goal(pose: &Pose, motion: &Motion<'_>, offset: [f64; 3]) -> Goal {
    let [x, y, z, w, p, r] = pose.values;
    let rotation = from_zyx_deg([r, p, w]);
    let [dx, dy, dz] = if is_in_tool(motion) { (rotation * Vector3::from(offset)).into() } else { offset };
    Goal::Pose {
        position_mm: [x + dx, y + dy, z + dz],
        quat: quaternion(&rotation),
        conf: pose.config.map(|config| Conf::Turns(config.config)),
    }
}
