//! Motions that run to targets: which position, in which frames, and whether its numbers may be edited.

use super::arcs;
use super::builder::{Builder, Built, Site, are_in_one_frame, refuse};
use super::expression;
use super::motion::{Motion, Point};
use super::position::{Body, Number, Pose, Position};
use super::run::Visit;
use super::state::{Marked, ModalState};
use super::statement::{self, Frame, StatementKind};
use crate::program::EXTERNAL_AXES;
use crate::program::orientation::{from_zyx_deg, quaternion};
use crate::program::{
    Conf, Editable, ExternalAxes, Goal, GroupAxis, Kept, Motion as Path, Predecessor, Reason, Role, Target, Tool,
    ToolData, UnknownMotion, Wobj, WobjData,
};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

const SELECTED_LATER: [Reason; 2] = [Reason::FrameSelected, Reason::ToolSelected];
const OTHER_SELECTED: [Reason; 2] = [Reason::OtherFrameSelected, Reason::OtherToolSelected];
const REDEFINED: [Reason; 2] = [Reason::FrameRedefined, Reason::ToolRedefined];

impl Builder<'_> {
    /// All of it.
    pub(super) fn build(mut self, visits: &[Visit]) -> Built {
        for (line, kind) in self.lines.iter().zip(&self.flow.kinds) {
            for index in statement::positions_named(line, kind) {
                self.freeze(index, &ModalState::default(), Reason::PositionNamed);
            }
        }
        let rows = arcs::rows(self.lines, &self.flow.kinds);
        let mut open = visits;
        while let Some((at, state)) = open.first() {
            let row = &rows[rows.partition_point(|row| row.end <= *at)..];
            let count = match (row.first().filter(|row| row.contains(at)), &self.flow.kinds[*at]) {
                (Some(row), _) => self.row(open, row.clone()),
                (None, StatementKind::Motion(motion)) => {
                    self.motion(*at, motion, state);
                    1
                }
                // Something is called that counts from where the robot stands.
                _ => {
                    self.counted_from.extend(&state.standing);
                    1
                }
            };
            open = &open[count..];
        }
        self.hold_what_others_use();
        self.keep_halves_of_arcs();
        self.say_what_is_kept();
        self.built
    }

    /// The position of an index.
    fn position(&self, index: &[u8], state: &ModalState) -> Result<usize, Reason> {
        let number = expression::count(index, &state.registers).ok_or(Reason::PositionUnknown)?;
        match self.numbers.get(&number) {
            Some((at, false)) => Ok(*at),
            Some((_, true)) => Err(Reason::PositionTwice),
            None => Err(Reason::PositionMissing),
        }
    }

    fn freeze(&mut self, index: &[u8], state: &ModalState, why: Reason) {
        match self.position(index, state) {
            Ok(at) => drop(self.frozen.entry(at).or_insert(why)),
            Err(Reason::PositionUnknown) => drop(self.all_frozen.get_or_insert(Reason::MayGoThere)),
            Err(_) => {}
        }
    }

    /// Counts a motion that runs.
    pub(super) fn count(&mut self, motion: &Motion<'_>, state: &ModalState) {
        self.built.motions += 1;
        if motion.moved == Some(Reason::Increment) {
            // What the robot stands at is part of where it goes.
            self.counted_from.extend(&state.standing);
        }
    }

    fn motion(&mut self, at: usize, motion: &Motion<'_>, state: &ModalState) {
        self.count(motion, state);
        self.built.arcs += usize::from(motion.path == Path::Circular);
        let points: Result<Vec<_>, _> = match motion.via {
            Some(via) => [(via, Role::Via), (motion.end, Role::End)]
                .into_iter()
                .map(|(point, role)| self.point(at, motion, point, role, state))
                .collect(),
            None => self.point(at, motion, motion.end, Role::End, state).map(|point| vec![point]),
        };
        let points =
            points.and_then(|points| if are_in_one_frame(&points) { Ok(points) } else { Err(Reason::ArcFrames) });
        match points {
            Ok(points) => {
                let first = self.built.targets.len();
                points.into_iter().for_each(|point| self.push(at, point));
                if motion.via.is_some() {
                    self.built.points.push(first..self.built.targets.len());
                }
            }
            Err(why) => self.lose(at, motion, state, why),
        }
    }

    /// Where the way into a point of a motion begins.
    fn predecessor(&self, motion: &Motion<'_>, role: Role, state: &ModalState) -> Predecessor {
        let Some(last) = self.last else { return Predecessor::Start };
        let behind_via = role == Role::End && motion.via.is_some();
        let stands = state.standing.len() == 1 && state.standing.contains(&last) && !state.elsewhere;
        if behind_via || stands { Predecessor::Previous } else { Predecessor::Unknown }
    }

    /// Takes a point of the motion of statement `at`.
    pub(super) fn push(&mut self, at: usize, (target, site): (Target, Site)) {
        self.ends.entry(at).or_default().push(self.built.targets.len());
        self.last = Some(at);
        self.built.targets.push(target);
        self.built.sites.push(site);
    }

    /// A motion whose end is not known: what it names stays.
    pub(super) fn lose(&mut self, at: usize, motion: &Motion<'_>, state: &ModalState, why: Reason) {
        for point in motion.via.iter().chain([&motion.end]) {
            if let Point::Position(index) = *point {
                self.freeze(index, state, Reason::MovedToo);
            }
        }
        self.unknown(at, why);
    }

    /// A point that a motion goes to or through; or why its place is not known.
    pub(super) fn point(
        &mut self,
        at: usize,
        motion: &Motion<'_>,
        point: Point<'_>,
        role: Role,
        state: &ModalState,
    ) -> Result<(Target, Site), Reason> {
        let index = match point {
            Point::Position(index) => index,
            Point::RunTime(why) => return Err(why),
        };
        let known = self.position(index, state)?;
        let position = &self.positions[known];
        let spline = motion.moved.filter(|_| stays_at_its_point(motion));
        if let Some(why) = motion.moved.filter(|_| spline.is_none()) {
            return Err(why);
        }
        if let Some(why) = state.displaced {
            return Err(why);
        }
        if motion.coordinated && position.groups.is_empty() {
            return Err(Reason::Coordinated);
        }
        let (goal, frames, site, why) = match &position.body {
            Body::None(why) => return Err(*why),
            Body::Pose(pose) => (goal(pose), pose.frames, Some(known as u32), spline),
            Body::Joints { deg, frames } => (Goal::Joints { deg: *deg }, *frames, None, Some(Reason::Joints)),
        };
        let mark = match state.mark {
            Marked::Known(mark) => mark,
            Marked::Unknown => None,
        };
        let unmarked = (state.mark == Marked::Unknown).then_some(Reason::MarkUnknown);
        let why = why.or(unmarked).or(self.all_frozen);
        let [wobj, tool] = self.frames(frames, state)?;
        let path = match (motion.path, &goal) {
            (Path::Joint, Goal::Joints { .. }) => Path::AbsoluteJoint,
            (path, _) => path,
        };
        let line = &self.lines[at];
        let target = Target {
            ordinal: u32::try_from(self.built.motions).unwrap_or(u32::MAX),
            role,
            motion: path,
            goal,
            tool,
            wobj,
            feed_mm_s: motion.feed_mm_s,
            spindle_rpm: None,
            rapid: false,
            mark,
            editable: why.map_or(Editable::Pose, Editable::No),
            located: true,
            extra_load: false,
            external: self.external(position, motion),
            name: Some(format!("P[{}]", position.number).into()),
            source: 0,
            span: line.span,
            line: u32::try_from(line.line).unwrap_or(u32::MAX),
            predecessor: self.predecessor(motion, role, state),
        };
        Ok((target, site))
    }

    /// External axes and those of other motion groups.
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

    /// Indices of work object and tool.
    fn frames(&mut self, recorded: [Number; 2], state: &ModalState) -> Result<[u16; 2], Reason> {
        let mut numbers = [0; 2];
        for (i, frame) in [Frame::User, Frame::Tool].into_iter().enumerate() {
            numbers[i] = match (recorded[i], state.selected[i]) {
                (Number::Known(own), Some(selected)) if own != selected => return Err(OTHER_SELECTED[i]),
                (Number::Known(own), _) => own,
                (Number::Selected, Some(selected)) => selected,
                (Number::Selected, None) => return Err(SELECTED_LATER[i]),
            };
            if state.all_redefined.contains(&frame) || state.redefined.contains(&(frame, numbers[i])) {
                return Err(REDEFINED[i]);
            }
        }
        let wobj =
            Wobj { name: format!("UF {}", numbers[0]).into(), data: (numbers[0] == 0).then_some(WORLD), unit: None };
        let tool = Tool { name: format!("UT {}", numbers[1]).into(), data: (numbers[1] == 0).then_some(FLANGE) };
        Ok([intern(&mut self.built.wobjs, wobj), intern(&mut self.built.tools, tool)])
    }

    /// A motion whose end is not known.
    fn unknown(&mut self, at: usize, why: Reason) {
        let (line, most) = (&self.lines[at], u32::MAX);
        self.built.unknown.push(UnknownMotion {
            ordinal: u32::try_from(self.built.motions).unwrap_or(most),
            reason: why,
            source: 0,
            span: line.span,
            line: u32::try_from(line.line).unwrap_or(most),
        });
        self.keep(at, why);
    }

    fn keep(&mut self, at: usize, reason: Reason) {
        let line = &self.lines[at];
        let known = self.built.kept.iter().any(|kept| kept.span == line.span && kept.reason == reason);
        if !known {
            self.built.kept.push(Kept { source: 0, span: line.span, line: line.line, reason, fault: false, help: "" });
        }
    }

    /// Numbers that something else uses, too, stay as they are.
    fn hold_what_others_use(&mut self) {
        let built = &mut self.built;
        for target in self.counted_from.iter().filter_map(|at| self.ends.get(at)).flatten() {
            refuse(&mut built.targets[*target], Reason::CountedFrom);
        }
        for (target, site) in built.targets.iter_mut().zip(&built.sites) {
            let Some(site) = site else { continue };
            if let Some(why) = self.frozen.get(&(*site as usize)).copied().or(self.all_frozen) {
                refuse(target, why);
            }
        }
        // One that stays for a reason of its own holds its numbers for all that use them.
        let mut held: BTreeMap<u32, Reason> = BTreeMap::new();
        for (target, site) in built.targets.iter().zip(&built.sites) {
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

    fn say_what_is_kept(&mut self) {
        let spans: BTreeMap<_, _> = self.lines.iter().enumerate().map(|(at, line)| (line.span, at)).collect();
        let kept: BTreeSet<_> = self
            .built
            .targets
            .iter()
            // Circle points that no text states have the reason of their arc.
            .filter(|target| target.motion != Path::AbsoluteJoint && target.name.is_some())
            .filter_map(|target| match target.editable {
                Editable::No(why) => Some((spans[&target.span], why)),
                _ => None,
            })
            .collect();
        kept.into_iter().for_each(|(at, why)| self.keep(at, why));
        self.built.kept.sort_by_key(|kept| kept.span);
    }
}

/// Options that leave the end of a motion where its position says.
fn stays_at_its_point(motion: &Motion<'_>) -> bool {
    motion.moved == Some(Reason::SplineOption)
}

fn intern<T: PartialEq>(known: &mut Vec<T>, wanted: T) -> u16 {
    let at = known.iter().position(|known| *known == wanted).unwrap_or_else(|| {
        known.push(wanted);
        known.len() - 1
    });
    u16::try_from(at).unwrap_or(u16::MAX)
}

/// A pose as the correction sees it: W, P, R turn about the fixed x, y, z.
fn goal(pose: &Pose) -> Goal {
    let [x, y, z, w, p, r] = pose.values;
    Goal::Pose {
        position_mm: [x, y, z],
        quat: quaternion(&from_zyx_deg([r, p, w])),
        conf: pose.config.map(|config| Conf::Turns(config.config)),
    }
}

const UNTURNED: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

/// User frame 0.
const WORLD: WobjData = WobjData {
    robhold: false,
    fixed: true,
    uframe_mm: [0.0; 3],
    uframe_quat: UNTURNED,
    oframe_mm: [0.0; 3],
    oframe_quat: UNTURNED,
};

/// Tool 0: the flange.
const FLANGE: ToolData =
    ToolData { robhold: true, tcp_mm: [0.0; 3], tcp_quat: UNTURNED, mass_kg: 0.0, cog_mm: [0.0; 3] };
