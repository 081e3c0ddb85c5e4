//! The interface of the languages: how a program that was read is written.

use super::{Change, Goal, Insert, Passing, Program, Reason, RewriteOptions, Rewritten, Role};
use deflex_text::{Edit, Span};
use std::ops::Range;

/// What [`Program::rewrite`] is given.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'w> {
    pub(super) changes: &'w [Option<Change>],
    pub(super) inserts: &'w [Insert],
    pub(super) options: &'w RewriteOptions<'w>,
}

/// Writes the programs of a language.
pub(super) trait FrontEnd {
    /// See [`Program::rewrite`]; no insert is refused by [`Program::insertions_refused`].
    fn rewrite(&self, program: &Program, wanted: Wanted<'_>) -> Rewritten;

    /// The part of [`Program::insertions_refused`] that depends on the language.
    fn insertions_refused(&self, _program: &Program, before: &[usize]) -> Vec<Option<Reason>> {
        vec![None; before.len()]
    }

    /// See [`Program::removal`].
    fn removal(&self, program: &Program, source: usize, spans: &[Span]) -> Vec<Edit> {
        let bytes = &program.sources[source].bytes;
        let without = |span: &Span| {
            let is_over = |byte: &&u8| byte.is_ascii_whitespace() || **byte == b';';
            let blanks = bytes[span.end as usize..].iter().take_while(is_over).count();
            Edit { span: Span::new(span.start as usize, span.end as usize + blanks), content: Vec::new().into() }
        };
        spans.iter().map(without).collect()
    }

    /// See [`Program::writes_axes`].
    fn writes_axes(&self, program: &Program) -> Vec<bool> {
        vec![false; program.targets.len()]
    }

    /// See [`Program::joints_elsewhere`].
    fn joints_elsewhere(&self, _program: &Program) -> Vec<usize> {
        Vec::new()
    }

    /// See [`Program::bound_to_point`].
    fn bound_to_point(&self, _program: &Program) -> Vec<usize> {
        Vec::new()
    }

    /// See [`Program::motion_targets`].
    fn motion_targets(&self, program: &Program) -> usize {
        program.targets.iter().filter(|target| target.role == Role::End).count()
    }

    /// See [`Program::passing`].
    fn passing(&self, _program: &Program, _target: usize) -> Passing {
        Passing::Unstated
    }

    /// See [`Program::is_worded_like`].
    fn is_worded_like(&self, _program: &Program, _target: usize, _other: usize) -> bool {
        false
    }

    /// See [`Program::passing_edits`].
    fn passing_edits(&self, _program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
        vec![None; wanted.len()]
    }

    /// See [`Program::inserted_passing`].
    fn inserted_passing(&self, program: &Program, before: usize) -> Passing {
        self.passing(program, before)
    }
}

impl Change {
    /// Whether it moves or turns a target that goes there now.
    pub(super) fn differs(&self, goal: &Goal) -> bool {
        let Goal::Pose { position_mm, quat, .. } = *goal else { return true };
        #[allow(clippy::float_cmp)] // only exactly the number that was read means no change
        let moved = self.position_mm != position_mm;
        moved || self.turn(quat).is_some()
    }

    /// The new orientation, if it is another than this one.
    pub(super) fn turn(&self, quat: [f64; 4]) -> Option<[f64; 4]> {
        /// Two orientations closer than this are the same: rounding of the arithmetic between reading and writing.
        const SAME_QUAT: f64 = 1e-12;
        let wanted = self.quat?;
        let length = wanted.iter().map(|part| part * part).sum::<f64>().sqrt();
        let same = |sign: f64| wanted.iter().zip(quat).all(|(a, b)| (a / length - sign * b).abs() <= SAME_QUAT);
        (!same(1.0) && !same(-1.0)).then_some(wanted)
    }
}

/// Edits for [`Program::passing_edits`] of languages in which one word of a motion decides whether the controller passes its end.
/// `passes` finds the bytes of that word in the motion's text, and `stops` is the word for a stop.
pub(super) fn stops_at(
    program: &Program,
    wanted: &[(usize, Passing)],
    passes: impl Fn(&[u8]) -> Option<Range<usize>>,
    stops: &[u8],
) -> Vec<Option<Edit>> {
    let edit = |(target, passing): &(usize, Passing)| {
        let target = program.targets.get(*target)?;
        if *passing != Passing::Stop || usize::from(target.source) >= program.written {
            return None;
        }
        let motion = target.span.range();
        let word = passes(&program.sources[usize::from(target.source)].bytes[motion.clone()])?;
        let span = Span::new(motion.start + word.start, motion.start + word.end);
        Some(Edit { span, content: stops.to_vec().into() })
    };
    wanted.iter().map(edit).collect()
}
