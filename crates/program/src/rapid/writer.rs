//! Corrections as text: the new tokens of literals, and the poses that the text states afterwards.

use super::literal::Literal;
use super::value::{Number, quarters, unit};
use super::{Given, Layout, TargetInText};
use crate::EXTERNAL_AXES;
use crate::token::{New, signed, single};
use crate::{Change, Conf, Editable, Goal, Program, Reason, RewriteOptions};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Content, Edit, Span, Token};
use std::borrow::Cow;
use std::collections::HashSet;

/// New token texts of one literal; `None` for tokens that stay.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Print {
    pub(super) tokens: [Option<Token>; 11],
    /// The tokens of the external axes, with their spans.
    pub(super) axes: Vec<(Span, Token)>,
    /// The numbers of position and orientation after the edit, where known.
    pub(super) values: [Option<f64>; 7],
    /// The configuration after the edit, if it changes.
    pub(super) conf: Option<Conf>,
}

impl Print {
    /// Whether the configuration changes.
    pub(super) fn changes_conf(&self) -> bool {
        self.tokens[7..].iter().any(Option::is_some)
    }
}

/// Position and orientation as the controller holds them.
pub(super) type Pose = ([f64; 3], [f64; 4]);

/// Turns corrections into text.
pub(super) struct Writer<'a> {
    pub(super) program: &'a Program,
    pub(super) layout: &'a Layout,
    pub(super) options: &'a RewriteOptions<'a>,
    pub(super) edits: Vec<Vec<Edit>>,
    pub(super) kept: Vec<(usize, Reason)>,
    /// Numbers that stay because another target depends on them.
    pub(super) frozen: HashSet<Number>,
    /// Whether each target goes along with the numbers of others; empty if none can.
    pub(super) along: Vec<bool>,
}

impl<'a> Writer<'a> {
    pub(super) fn new(program: &'a Program, layout: &'a Layout, options: &'a RewriteOptions<'a>) -> Self {
        Self {
            program,
            layout,
            options,
            edits: vec![Vec::new(); program.written],
            kept: Vec::new(),
            frozen: HashSet::new(),
            along: Vec::new(),
        }
    }

    pub(super) fn bytes(&self, place: SourceSpan) -> &'a [u8] {
        self.program.sources[place.source as usize].slice(place.span)
    }

    pub(super) fn token(&self, literal: &Literal, i: usize) -> &'a [u8] {
        self.bytes(SourceSpan { source: literal.source, span: literal.token(i) })
    }

    pub(super) fn reason(&self, i: usize) -> Reason {
        if let Editable::No(reason) = self.program.targets[i].editable { reason } else { Reason::SharedTarget }
    }

    /// Whether a change differs from the text.
    pub(super) fn differs(&self, i: usize, change: &Change) -> bool {
        let mut goal = self.program.targets[i].goal;
        let conf = if let Goal::Pose { conf, .. } = goal { conf } else { None };
        if let (Goal::Pose { position_mm, .. }, Some(base)) = (&mut goal, self.base(i)) {
            *position_mm = base;
        }
        change.differs(&goal) || change.conf.is_some() && change.conf != conf || change.external.is_some()
    }

    /// The position as written of the base of a target that is corrected by its base, mm.
    fn base(&self, i: usize) -> Option<[f64; 3]> {
        let TargetInText::Literal { literal, given: Given::Base } = self.layout.sites[i] else { return None };
        let literal = &self.layout.literals[literal as usize];
        Some(std::array::from_fn(|k| signed(self.token(literal, k)).unwrap_or(f64::NAN)))
    }

    /// Where a target is if its numbers state this position, mm.
    pub(super) fn position_by_base(&self, i: usize, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (Some(base), Goal::Pose { position_mm, .. }) = (self.base(i), self.program.targets[i].goal) else {
            return [x, y, z];
        };
        std::array::from_fn(|k| position_mm[k] + ([x, y, z][k] - base[k]))
    }

    /// The changes of the numbers: those of bases instead of those of targets that are corrected by them.
    pub(super) fn of_numbers<'c>(&self, changes: &'c [Option<Change>]) -> Cow<'c, [Option<Change>]> {
        let mut all = Cow::Borrowed(changes);
        for (i, change) in changes.iter().enumerate() {
            if let (Some(change), Some(base), Goal::Pose { position_mm, .. }) =
                (change, self.base(i), self.program.targets[i].goal)
            {
                let position_mm = std::array::from_fn(|k| base[k] + (change.position_mm[k] - position_mm[k]));
                all.to_mut()[i] = Some(Change { position_mm, ..change.clone() });
            }
        }
        all
    }

    /// Records that a target keeps its pose, if it has a change that differs from the text.
    pub(super) fn keep(&mut self, i: usize, change: Option<&Change>, why: impl Fn(&Self) -> Reason) {
        if change.is_some_and(|change| self.differs(i, change)) {
            self.kept.push((i, why(self)));
        }
    }

    /// The new tokens of a literal for the change of one user.
    pub(super) fn print(&self, i: usize, literal: &Literal, change: &Change) -> Print {
        let mut print = Print::default();
        let Goal::Pose { quat, conf, .. } = self.program.targets[i].goal else { return print };
        for axis in 0..3 {
            let new = New::of(self.token(literal, axis), change.position_mm[axis], self.options.position_decimals);
            (print.tokens[axis], print.values[axis]) = (new.token, new.value);
        }
        if let Some(wanted) = change.turn(quat) {
            for (c, value) in toward(wanted, quat).into_iter().enumerate() {
                let new = New::of(self.token(literal, 3 + c), value, self.options.quat_decimals);
                (print.tokens[3 + c], print.values[3 + c]) = (new.token, new.value);
            }
        }
        if let Some(wanted) = change.conf.filter(|c| Some(*c) != conf).and_then(quarters) {
            for (c, value) in wanted.into_iter().enumerate() {
                // A configuration given by name stays, because other targets may use it.
                if !literal.token(7 + c).is_empty() {
                    print.tokens[7 + c] = New::of(self.token(literal, 7 + c), f64::from(value), 0).token;
                    print.conf = change.conf;
                }
            }
        }
        if let (Some(wanted), Some(places)) = (&change.external, self.axes(literal)) {
            let new = wanted.iter().zip(places).filter_map(|(wanted, span)| {
                let old = self.bytes(SourceSpan { source: literal.source, span });
                Some((span, New::of(old, (*wanted)?, self.options.position_decimals).token?))
            });
            print.axes = new.collect();
        }
        print
    }

    /// The spans of the six external axes of a literal; `None` if not all are numbers.
    pub(super) fn axes(&self, literal: &Literal) -> Option<[Span; EXTERNAL_AXES]> {
        literal.axes(&self.program.sources[literal.source as usize].bytes)
    }

    pub(super) fn edit_literal(&mut self, literal: &Literal, print: Print) {
        let Some(edits) = self.edits.get_mut(literal.source as usize) else { return };
        for (i, token) in print.tokens.into_iter().enumerate() {
            if let Some(content) = token {
                edits.push(Edit { span: literal.token(i), content: Content::from_slice(&content) });
            }
        }
        edits.extend(print.axes.into_iter().map(|(span, token)| Edit { span, content: Content::from_slice(&token) }));
    }

    /// The text of a literal with its new tokens, for a clone.
    pub(super) fn literal_text(&self, literal: &Literal, print: &Print) -> Vec<u8> {
        let span = literal.span();
        let bytes = self.bytes(SourceSpan { source: literal.source, span });
        let mut out = Vec::new();
        let mut done = 0;
        let pose = print.tokens.iter().enumerate().filter_map(|(i, token)| Some((literal.token(i), token.as_ref()?)));
        for (place, content) in pose.chain(print.axes.iter().map(|(place, token)| (*place, token))) {
            let (from, to) = ((place.start - span.start) as usize, (place.end - span.start) as usize);
            out.extend_from_slice(&bytes[done..from]);
            out.extend_from_slice(content);
            done = to;
        }
        out.extend_from_slice(&bytes[done..]);
        out
    }

    /// Position and orientation as written after `print`, rounded to single precision.
    pub(super) fn literal_pose(&self, literal: &Literal, print: Option<&Print>) -> Pose {
        let value = |i: usize| {
            if let Some(value) = print.and_then(|p| p.values[i]) {
                return single(value);
            }
            let new = print.and_then(|p| p.tokens[i].as_deref());
            // Text that is not a number becomes NaN, which leads to an error, never to another number.
            single(signed(new.unwrap_or_else(|| self.token(literal, i))).unwrap_or(f64::NAN))
        };
        (std::array::from_fn(value), std::array::from_fn(|i| value(i + 3)))
    }
}

/// A unit quaternion of the same orientation, with the signs of another.
pub(super) fn toward(wanted: [f64; 4], quat: [f64; 4]) -> [f64; 4] {
    let wanted = unit(wanted);
    let against = wanted.iter().zip(&quat).map(|(a, b)| a * b).sum::<f64>() < 0.0;
    if against { wanted.map(|c| -c) } else { wanted }
}
