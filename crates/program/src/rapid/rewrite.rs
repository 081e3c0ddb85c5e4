//! Writes corrected poses back into number tokens: only sign and digits change.

use super::literal::Literal;
use super::value::{Number, OffsetStep, rotate, unit};
use super::writer::{Pose, Print, Writer};
use super::{Layout, Offset, TargetInText, clone, insert, own};
use crate::front_end::Wanted;
use crate::shared::{Agreed, Numbers, agreed};
use crate::token::{New, signed, single};
use crate::{Change, Conf, Editable, Goal, Insert, Motion, NO_TURN, Program, Reason, Rewritten, Role};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Content, Edit, Token};
use std::collections::{BTreeSet, HashMap, HashSet};

/// New arguments of `Offs` and `RelTool`, by the position of the first; absent for offsets that stay.
pub(super) type NewOffsets = HashMap<SourceSpan, NewOffset>;

/// The new tokens of one offset.
type NewOffset = [Option<Token>; 3];

/// The new literals and offsets.
#[derive(Debug, Default)]
pub(super) struct Settled {
    /// One per literal; `None` if the literal stays.
    pub(super) prints: Vec<Option<Print>>,
    /// Literals of targets that get a declaration of their own.
    pub(super) cloned: HashMap<usize, Print>,
    pub(super) offsets: NewOffsets,
    /// Numbers that stay because another target depends on them.
    pub(super) frozen: HashSet<Number>,
    /// Literals whose users ask for different numbers.
    pub(super) disputed: BTreeSet<u32>,
    /// Numbers of motions that are not free to go along with them.
    pub(super) owned: HashSet<Number>,
}

impl Settled {
    /// Whether a number of a target changes.
    pub(super) fn moves(&self, layout: &Layout, i: usize) -> bool {
        layout.numbers(i).iter().any(|number| match number {
            Number::Literal(literal) => self.prints.get(*literal as usize).is_some_and(Option::is_some),
            Number::Offset(place) => is_edited(&self.offsets, place),
        })
    }

    /// The configurations that change, by target.
    pub(super) fn confs(&self, layout: &Layout) -> Vec<(usize, Conf)> {
        let conf = |i: usize| {
            let root = || self.prints.get(layout.root(i)? as usize)?.as_ref();
            Some((i, self.cloned.get(&i).or_else(root)?.conf?))
        };
        (0..layout.sites.len()).filter_map(conf).collect()
    }
}

impl Layout {
    /// The literal from which a target is made.
    pub(super) fn root(&self, i: usize) -> Option<u32> {
        self.sites[i].root(&self.offsets)
    }

    /// The numbers of a target.
    pub(super) fn numbers(&self, i: usize) -> Numbers<Number> {
        let steps = self.offset(&self.sites[i]).into_iter().flat_map(|offset| &offset.steps);
        let offsets = steps.filter_map(OffsetStep::place).map(Number::Offset);
        self.root(i).map(Number::Literal).into_iter().chain(offsets).collect()
    }
}

fn is_edited(offsets: &NewOffsets, place: &SourceSpan) -> bool {
    offsets.get(place).is_some_and(|new| new.iter().any(Option::is_some))
}

pub(super) fn rewrite(program: &Program, layout: &Layout, wanted: Wanted<'_>) -> Rewritten {
    let others_go = !layout.standing.is_empty() || !layout.joints_elsewhere.is_empty();
    if !own::is_own(&layout.sites) || others_go || wanted.options.stays.contains(&true) {
        return rewrite_agreed(program, layout, wanted).0;
    }
    let mut writer = Writer::new(program, layout, wanted.options);
    let written = writer.own(wanted.changes);
    writer.done(written, wanted.inserts)
}

/// As [`rewrite`], for literals with several users, with the new literals and offsets.
pub(super) fn rewrite_agreed(program: &Program, layout: &Layout, wanted: Wanted<'_>) -> (Rewritten, Settled) {
    let writer = Writer::new(program, layout, wanted.options);
    let wanted = Wanted { changes: &writer.of_numbers(wanted.changes), ..wanted };
    let Agreed { changes, along, owned } = agreed(program, &wanted, |i| layout.numbers(i));
    let changes = &*changes;
    let mut writer = Writer { along, ..writer };
    let stays = (0..changes.len()).filter(|i| wanted.options.stays.get(*i) == Some(&true));
    writer.frozen.extend(stays.filter_map(|i| layout.root(i)).map(Number::Literal));
    let mut settled = Settled::default();
    // A target that stays must not move with another number, so that number stays too: repeat until nothing changes.
    while changes.iter().any(Option::is_some) {
        let before = writer.frozen.len();
        writer.start_over();
        settled = writer.literals(changes);
        settled.offsets = writer.offsets(changes, &settled.prints);
        writer.freeze(&settled.prints, &settled.offsets);
        if writer.frozen.len() == before {
            break;
        }
    }
    settled.frozen.clone_from(&writer.frozen);
    settled.owned = owned;
    let Settled { prints, cloned, offsets, .. } = &settled;
    let written = (0..program.targets.len()).map(|i| writer.written(i, prints, cloned, offsets)).collect();
    for (literal, print) in prints.iter().enumerate() {
        if let Some(print) = print {
            writer.edit_literal(&layout.literals[literal], print.clone());
        }
    }
    let along = (0..writer.along.len()).filter(|i| writer.along[*i] && settled.moves(layout, *i)).collect();
    let confs = settled.confs(layout);
    (Rewritten { along, confs, ..writer.done(written, wanted.inserts) }, settled)
}

impl Writer<'_> {
    fn start_over(&mut self) {
        self.edits.iter_mut().for_each(Vec::clear);
        self.kept.clear();
    }

    fn literal_of(&self, offset: &Offset) -> &'_ Literal {
        &self.layout.literals[offset.root as usize]
    }

    /// Freezes the numbers that would move a kept target: the base and steps of an offset, and the other point of an arc.
    fn freeze(&mut self, prints: &[Option<Print>], offsets: &NewOffsets) {
        let kept: BTreeSet<usize> = self.kept.iter().map(|kept| kept.0).collect();
        let targets = &self.program.targets;
        for (i, site) in self.layout.sites.iter().enumerate() {
            let Some(offset) = self.layout.offset(site) else { continue };
            let print = prints.get(offset.root as usize).and_then(Option::as_ref);
            let stays = !self.along[i] && (kept.contains(&i) || targets[i].editable != Editable::Position);
            // A joint motion goes by the configuration of its base, which may be another one than its own. The decision that it goes along has
            // judged that.
            let goes_by_it = targets[i].motion == Motion::Joint && targets[i].conf().is_some();
            let is_judged = self.along[i];
            if print.is_some_and(|print| stays || goes_by_it && !is_judged && print.changes_conf()) {
                self.frozen.insert(Number::Literal(offset.root));
            }
            if !stays {
                continue;
            }
            let places = offset.steps.iter().filter_map(OffsetStep::place);
            self.frozen.extend(places.filter(|place| is_edited(offsets, place)).map(Number::Offset));
        }
        for offset in &*self.layout.standing {
            // Motions of other kinds and at other moments go by the configuration and the external axes of the base.
            let goes_by = |print: &Print| print.changes_conf() || !print.axes.is_empty();
            let is_held = |offset: &Offset| {
                offset.steps.iter().filter_map(OffsetStep::place).all(|place| offsets.contains_key(&place))
            };
            let print = prints.get(offset.root as usize).and_then(Option::as_ref);
            if print.is_some_and(|print| goes_by(print) || !is_held(offset)) {
                self.frozen.insert(Number::Literal(offset.root));
            }
        }
        for &i in &kept {
            let other = match targets[i].role {
                Role::Via => i + 1,
                _ if i > 0 && targets[i - 1].role == Role::Via => i - 1,
                _ => continue,
            };
            if kept.contains(&other) || matches!(targets.get(other).map(|t| t.editable), None | Some(Editable::No(_))) {
                continue;
            }
            match self.layout.sites[other] {
                TargetInText::Literal { literal, .. } => drop(self.frozen.insert(Number::Literal(literal))),
                TargetInText::Offset(at) => {
                    let last = self.layout.offsets[at as usize].steps.last();
                    self.frozen.extend(last.and_then(OffsetStep::place).map(Number::Offset));
                }
                TargetInText::None => {}
            }
        }
    }

    fn done(mut self, written: Vec<Pose>, inserts: &[Insert]) -> Rewritten {
        self.kept.sort_unstable();
        let (edits, kept) = (std::mem::take(&mut self.edits), std::mem::take(&mut self.kept));
        let mut out = Rewritten { edits, written, kept, ..Rewritten::default() };
        for insert in inserts {
            out.insert(insert.before, insert::instruction(&self, insert));
        }
        out.edits.iter_mut().for_each(|edits| edits.sort_by_key(|edit| edit.span));
        out
    }

    /// The new numbers of each literal, on which all its users agree; clones if they do not.
    fn literals(&mut self, changes: &[Option<Change>]) -> Settled {
        let mut prints: Vec<Option<Print>> = vec![None; self.layout.literals.len()];
        let mut first: Vec<u32> = vec![u32::MAX; self.layout.literals.len()];
        let mut disputed: Vec<u32> = Vec::new();
        for (i, (site, change)) in self.layout.sites.iter().zip(changes).enumerate() {
            let TargetInText::Literal { literal, .. } = *site else {
                if matches!(site, TargetInText::None) {
                    self.keep(i, change.as_ref(), |writer| writer.reason(i));
                }
                continue;
            };
            if self.along[i] {
                continue;
            }
            let print = match (self.program.targets[i].editable, change) {
                (Editable::Pose, Some(change)) => self.print(i, &self.layout.literals[literal as usize], change),
                (Editable::Pose, None) => Print::default(),
                (_, change) => {
                    self.keep(i, change.as_ref(), |writer| writer.reason(i));
                    continue;
                }
            };
            if self.frozen.contains(&Number::Literal(literal)) {
                self.keep(i, change.as_ref(), |_| Reason::MovesKept);
                continue;
            }
            let slot = literal as usize;
            if first[slot] == u32::MAX {
                first[slot] = u32::try_from(i).unwrap_or(u32::MAX - 1);
                prints[slot] = Some(print);
            } else if prints[slot].as_ref() != Some(&print) {
                disputed.push(literal);
            }
        }
        disputed.sort_unstable();
        disputed.dedup();
        let mut cloned = HashMap::new();
        for &literal in &disputed {
            prints[literal as usize] = None;
            clone::resolve(self, literal, changes, &mut prints, &mut cloned, Reason::SharedTarget);
        }
        for print in &mut prints {
            if print.as_ref().is_some_and(|p| p.tokens.iter().all(Option::is_none) && p.axes.is_empty()) {
                *print = None;
            }
        }
        Settled { prints, cloned, disputed: disputed.into_iter().collect(), ..Settled::default() }
    }

    /// New arguments of `Offs` and `RelTool`.
    fn offsets(&mut self, changes: &[Option<Change>], prints: &[Option<Print>]) -> NewOffsets {
        let mut wishes = NewOffsets::new();
        let mut users: Vec<(Option<usize>, SourceSpan, [SourceSpan; 3])> = Vec::new();
        let offset_of = |i: &usize| self.layout.offset(&self.layout.sites[*i]);
        let mut sites: Vec<usize> = (0..changes.len()).filter(|i| offset_of(i).is_some() && !self.along[*i]).collect();
        // An offset of an offset comes after it.
        sites.sort_by_key(|i| offset_of(i).map(|offset| offset.steps.len()));
        for i in sites {
            let Some(offset) = self.layout.offset(&self.layout.sites[i]) else { continue };
            let change = &changes[i];
            if self.program.targets[i].editable != Editable::Position {
                self.keep(i, change.as_ref(), |writer| writer.reason(i));
                continue;
            }
            let Goal::Pose { position_mm, .. } = self.program.targets[i].goal else { continue };
            let wanted = change.as_ref().map_or(position_mm, |c| c.position_mm);
            let Some(tokens) = offset.steps.last().and_then(|last| last.tokens) else { continue };
            let wish = self.wish(offset, (position_mm, wanted), (prints, &wishes));
            if wish.is_some() {
                users.push((Some(i), tokens[0], tokens));
            }
            // A target that stays needs its numbers as they are.
            self.agree(&mut wishes, tokens[0], wish.unwrap_or_default());
        }
        for offset in &*self.layout.standing {
            let Some(tokens) = offset.steps.last().and_then(|last| last.tokens) else { continue };
            let at = self.after(&offset.steps, self.literal_pose(self.literal_of(offset), None), &NewOffsets::new()).0;
            let wish = self.wish(offset, (at, at), (prints, &wishes));
            if wish.is_some() {
                users.push((None, tokens[0], tokens));
            }
            self.agree(&mut wishes, tokens[0], wish.unwrap_or_default());
        }
        wishes.retain(|place, _| !self.frozen.contains(&Number::Offset(*place)));
        let mut done = HashSet::new();
        for (i, place, tokens) in users {
            match wishes.get(&place) {
                None => self.kept.extend(i.map(|i| (i, Reason::SharedOffset))),
                Some(print) if done.insert(place) => {
                    for (token, content) in tokens.iter().zip(print) {
                        if let (Some(content), Some(edits)) = (content, self.edits.get_mut(token.source as usize)) {
                            edits.push(Edit { span: token.span, content: Content::from_slice(content) });
                        }
                    }
                }
                Some(_) => {}
            }
        }
        wishes
    }

    /// New tokens of an offset that lead to another pose; `None` if neither the offset nor its base changes.
    pub(super) fn wish(
        &self,
        offset: &Offset,
        (written, wanted): ([f64; 3], [f64; 3]),
        (prints, wishes): (&[Option<Print>], &NewOffsets),
    ) -> Option<NewOffset> {
        let (last, before) = offset.steps.split_last()?;
        let base = prints.get(offset.root as usize).and_then(Option::as_ref);
        let moved =
            base.is_some() || before.iter().filter_map(OffsetStep::place).any(|place| is_edited(wishes, &place));
        #[allow(clippy::float_cmp)] // the very number that was read means no change
        let moves = moved || wanted != written;
        let tokens = last.tokens.filter(|_| moves)?;
        let root = self.literal_pose(self.literal_of(offset), base);
        let (position, quat) = self.after(before, root, wishes);
        let mut d: [f64; 3] = std::array::from_fn(|k| wanted[k] - position[k]);
        if last.in_tool {
            let [w, x, y, z] = unit(quat);
            d = rotate([w, -x, -y, -z], d);
        }
        Some(std::array::from_fn(|k| New::of(self.bytes(tokens[k]), d[k], self.options.position_decimals).token))
    }

    /// Adds the tokens that one user of an offset needs; an offset whose users need different tokens stays.
    fn agree(&mut self, wishes: &mut NewOffsets, place: SourceSpan, wish: [Option<Token>; 3]) {
        if !self.frozen.contains(&Number::Offset(place)) && *wishes.entry(place).or_insert_with(|| wish.clone()) != wish
        {
            self.frozen.insert(Number::Offset(place));
        }
    }

    /// The pose after these steps from a base, with their new arguments as the controller holds them.
    fn after(&self, steps: &[OffsetStep], base: Pose, offsets: &NewOffsets) -> Pose {
        steps.iter().fold(base, |(position, quat), step| {
            let mut step = *step;
            if let Some(tokens) = step.tokens {
                let new = offsets.get(&tokens[0]);
                step.offset_mm = std::array::from_fn(|k| {
                    let token = new.and_then(|new| new[k].as_deref()).unwrap_or_else(|| self.bytes(tokens[k]));
                    single(signed(token).unwrap_or(step.offset_mm[k]))
                });
            }
            step.apply(position, quat)
        })
    }

    /// A target as the controller will hold it.
    pub(super) fn written(
        &self,
        i: usize,
        prints: &[Option<Print>],
        cloned: &HashMap<usize, Print>,
        offsets: &NewOffsets,
    ) -> Pose {
        let print = |literal: u32| prints.get(literal as usize).and_then(Option::as_ref);
        let (position, quat) = match self.layout.sites[i] {
            TargetInText::Literal { literal, .. } => {
                let print = cloned.get(&i).or_else(|| print(literal));
                let (position, quat) = self.literal_pose(&self.layout.literals[literal as usize], print);
                (self.position_by_base(i, position), quat)
            }
            TargetInText::Offset(at) => {
                let offset = &self.layout.offsets[at as usize];
                let base = self.literal_pose(self.literal_of(offset), print(offset.root));
                self.after(&offset.steps, base, offsets)
            }
            TargetInText::None => match self.program.targets[i].goal {
                Goal::Pose { position_mm, quat, .. } => (position_mm, quat),
                Goal::Axis { position_mm, .. } => (position_mm, NO_TURN),
                Goal::Joints { .. } => return ([0.0; 3], NO_TURN),
            },
        };
        (position.map(single), quat)
    }
}
