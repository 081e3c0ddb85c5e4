//! The corrections of motions that run more than once, on which all of their runs have to agree.
//!
//! Each chunk adds the wanted values of its motions. For equal motions, enough of these values are stored to know which of them disagree. The
//! new numbers of the text follow from them as for a program that is held as a whole, and each chunk receives them.

use super::rewrite::{Settled, rewrite_agreed};
use super::value::{Number, OffsetStep};
use super::writer::{Print, Writer};
use super::{Layout, TargetInText};
use crate::shared::{goes_along, is_free};
use crate::token::MAX_DECIMALS;
use crate::{Change, Editable, Goal, Program, Reason, RewriteOptions, Rewritten, Target, front_end};
use deflex_text::Edit;
use smallvec::SmallVec;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The equal motions of a chunk's targets, and the state of the agreement on them.
#[derive(Debug)]
pub(super) struct Again {
    /// One for each target.
    alike: Vec<u32>,
    agreement: Agreement,
}

/// The state of the agreement on corrections.
#[derive(Clone, Debug)]
pub(super) enum Agreement {
    /// Nothing will be written.
    None,
    /// It is being determined.
    Open(Arc<WantedValues>),
    /// It is known.
    Known(Arc<Agreed>),
}

/// The wanted values of motions, by the first target of equal ones.
#[derive(Debug, Default)]
pub(super) struct WantedValues(Mutex<HashMap<u32, Vec<Wanted>>>);

/// The wanted values of one motion.
#[derive(Clone, Debug)]
struct Wanted {
    ordinal: u32,
    edits: SmallVec<[WantedEdit; 2]>,
    changes: SmallVec<[Option<Change>; 2]>,
}

/// The edit that a target needs.
#[derive(Clone, Debug, PartialEq)]
struct WantedEdit {
    /// Whether it may go along with others instead.
    is_free: bool,
    text: WantedText,
}

/// The edit of the text that a changed target needs.
#[derive(Clone, Debug, PartialEq)]
enum WantedText {
    Nothing,
    /// New tokens of its literal.
    Print(Box<Print>),
    /// The wanted position of an offset, in shares of the last printed digit.
    Position([i64; 3]),
}

/// Number of different values that the runs of one target may want before they count as a disagreement. Positions that print equally may be
/// on both sides of a rounding boundary.
const MOST_WANTED: usize = 4;

/// The new numbers of the text.
#[derive(Debug)]
pub(super) struct Agreed {
    settled: Settled,
    /// Edits of each source.
    pub(super) edits: Vec<Vec<Edit>>,
    /// Whether a run wanted a value that none before had.
    contradicted: AtomicBool,
}

impl Again {
    pub(super) fn new(alike: Vec<u32>, agreement: Agreement) -> Self {
        Self { alike, agreement }
    }

    pub(super) fn rewrite(&self, program: &Program, layout: &Layout, wanted: front_end::Wanted<'_>) -> Rewritten {
        let changes = wanted.changes;
        let mut writer = Writer::new(program, layout, wanted.options);
        let (nothing, mut along) = (Settled::default(), Vec::new());
        let of_numbers = writer.of_numbers(changes);
        let settled = match &self.agreement {
            Agreement::None => &nothing,
            Agreement::Open(wanted) => {
                wanted.add(&writer, &self.alike, [changes, &of_numbers]);
                &nothing
            }
            Agreement::Known(agreed) => {
                along = agreed.keep(&mut writer, &of_numbers);
                &agreed.settled
            }
        };
        let written = (0..program.targets.len())
            .map(|i| writer.written(i, &settled.prints, &settled.cloned, &settled.offsets))
            .collect();
        let confs = settled.confs(layout);
        Rewritten { written, kept: writer.kept, along, confs, ..Rewritten::default() }
    }
}

impl WantedValues {
    /// Adds the wanted values of a chunk's targets, from their changes and those of their numbers.
    fn add(&self, writer: &Writer<'_>, alike: &[u32], [changes, of_numbers]: [&[Option<Change>]; 2]) {
        let targets = &writer.program.targets;
        let mut at = 0;
        while at < targets.len() {
            let end = at + usize::from(!targets[at].is_end());
            let motion = at..(end + 1).min(targets.len());
            let wanted = Wanted {
                ordinal: targets[at].ordinal,
                edits: motion.clone().map(|i| wanted_edit(writer, i, of_numbers[i].as_ref())).collect(),
                changes: changes[motion.clone()].iter().cloned().collect(),
            };
            let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            add(all.entry(alike[at]).or_default(), wanted);
            at = motion.end;
        }
    }

    /// The agreement on all wanted values, in the program with one motion for all equal ones.
    pub(super) fn agreed(&self, like: &Program, options: &RewriteOptions) -> Option<Agreed> {
        let layout = super::Layout::of(like)?;
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut firsts: Vec<u32> = all.keys().copied().collect();
        firsts.sort_unstable();
        let (mut targets, mut sites, mut changes) = (Vec::<Target>::new(), Vec::new(), Vec::new());
        let mut air = Vec::new();
        for first in firsts {
            for wanted in &all[&first] {
                air.extend(wanted.edits.iter().map(|edit| edit.is_free));
                for (i, change) in (first as usize..).zip(&wanted.changes) {
                    targets.push(like.targets.get(i)?.clone());
                    sites.push(*layout.sites.get(i)?);
                    changes.push(change.clone());
                }
            }
        }
        let all_runs = Layout {
            literals: Arc::clone(&layout.literals),
            sites,
            offsets: layout.offsets.clone(),
            standing: Arc::clone(&layout.standing),
            joints_elsewhere: layout.joints_elsewhere.clone(),
            ..Layout::default()
        };
        // Whether other motions may go along is not judged here.
        let stays: Vec<bool> = (0..targets.len()).map(|i| all_runs.is_joint_elsewhere(i)).collect();
        let (files, layout) = ((Arc::clone(&like.sources), like.written), Layout::default());
        let layout = crate::Layout::Rapid(layout);
        let program = Program { targets, ..Program::empty(like.language, like.dialect, files, layout) };
        let options = &RewriteOptions { air: &air, stays: &stays, ..*options };
        let (rewritten, settled) =
            rewrite_agreed(&program, &all_runs, front_end::Wanted { changes: &changes, inserts: &[], options });
        Some(Agreed { settled, edits: rewritten.edits, contradicted: AtomicBool::new(false) })
    }
}

/// Stores the wanted value of a motion if it is new.
fn add(known: &mut Vec<Wanted>, wanted: Wanted) {
    if let Some(same) = known.iter_mut().find(|known| known.edits == wanted.edits) {
        // The first of them, whichever thread comes first.
        if wanted.ordinal < same.ordinal {
            *same = wanted;
        }
        return;
    }
    let is_new = |k: usize| {
        let mut different: SmallVec<[&WantedEdit; MOST_WANTED]> = SmallVec::new();
        for known in known.iter().filter(|known| known.edits[k].is_free == wanted.edits[k].is_free) {
            if !different.contains(&&known.edits[k]) {
                different.push(&known.edits[k]);
            }
        }
        different.len() < MOST_WANTED && !different.contains(&&wanted.edits[k])
    };
    if (0..wanted.edits.len()).any(is_new) {
        known.push(wanted);
    }
}

/// The wanted change of the text for a target.
fn wanted_edit(writer: &Writer<'_>, i: usize, change: Option<&Change>) -> WantedEdit {
    /// Parts of the last printed digit.
    const PARTS: f64 = 100.0;
    let target = &writer.program.targets[i];
    let text = match (writer.layout.sites[i], target.editable, target.goal) {
        (TargetInText::Literal { literal, .. }, Editable::Pose, _) => {
            let literal = &writer.layout.literals[literal as usize];
            WantedText::Print(Box::new(change.map_or_else(Print::default, |change| writer.print(i, literal, change))))
        }
        (TargetInText::Offset(_), Editable::Position, Goal::Pose { position_mm, .. }) => {
            let wanted = change.map_or(position_mm, |change| change.position_mm);
            let decimals = writer.options.position_decimals.min(MAX_DECIMALS);
            let scale = PARTS * 10_f64.powi(i32::try_from(decimals).unwrap_or(0));
            #[allow(clippy::cast_possible_truncation)] // metres in parts of a micrometre
            WantedText::Position(wanted.map(|mm| (mm * scale).round() as i64))
        }
        _ => WantedText::Nothing,
    };
    WantedEdit { is_free: is_free(writer.program, writer.options, i), text }
}

impl Agreed {
    /// Whether all runs wanted the values that they had before; if not, nothing may be written.
    pub(super) fn holds(&self) -> bool {
        !self.contradicted.load(Ordering::Relaxed)
    }

    /// Records the targets of a chunk that do not get their wanted values, with the reason. Returns those that go along.
    fn keep(&self, writer: &mut Writer<'_>, changes: &[Option<Change>]) -> Vec<usize> {
        let layout = writer.layout;
        let mut along = Vec::new();
        for (i, change) in changes.iter().enumerate() {
            let is_free = is_free(writer.program, writer.options, i);
            if is_free && goes_along(writer.program, i, &layout.numbers(i), &self.settled.owned) {
                along.extend(Some(i).filter(|i| self.settled.moves(layout, *i)));
                continue;
            }
            let target = &writer.program.targets[i];
            let differs = |writer: &Writer<'_>| change.as_ref().is_some_and(|change| writer.differs(i, change));
            let reason = match (layout.sites[i], target.editable) {
                (TargetInText::Literal { literal, .. }, Editable::Pose) => {
                    let Some(change) = change else { continue };
                    let print = || writer.print(i, &layout.literals[literal as usize], change);
                    if self.settled.frozen.contains(&Number::Literal(literal)) {
                        differs(writer).then_some(Reason::MovesKept)
                    } else if self.settled.disputed.contains(&literal) {
                        (print() != Print::default()).then_some(Reason::SharedTarget)
                    } else {
                        None
                    }
                }
                (TargetInText::Offset(at), Editable::Position) => self.offset(writer, i, at, change.as_ref()),
                _ => differs(writer).then(|| writer.reason(i)),
            };
            writer.kept.extend(reason.map(|reason| (i, reason)));
        }
        along
    }

    /// Why an offset is kept although another one is wanted.
    fn offset(&self, writer: &Writer<'_>, i: usize, at: u32, change: Option<&Change>) -> Option<Reason> {
        let offset = writer.layout.offsets.get(at as usize)?;
        let Goal::Pose { position_mm, .. } = writer.program.targets[i].goal else { return None };
        let wanted = change.map_or(position_mm, |change| change.position_mm);
        let place = offset.steps.last().and_then(OffsetStep::place)?;
        let settled = (&self.settled.prints[..], &self.settled.offsets);
        let wish = writer.wish(offset, (position_mm, wanted), settled);
        match self.settled.offsets.get(&place) {
            None => wish.map(|_| Reason::SharedOffset),
            Some(agreed) if wish.unwrap_or_default() == *agreed => None,
            Some(_) => {
                self.contradicted.store(true, Ordering::Relaxed);
                Some(Reason::SharedOffset)
            }
        }
    }
}
