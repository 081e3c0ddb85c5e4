//! Writes corrected poses into the number tokens of the text: only signs and digits change.

use super::numbers::{ANGLE_DECIMALS, POSITION_DECIMALS, bytes, follows_a_name, near};
use super::run::PositionTokens;
use super::{Layout, insert, names};
use crate::front_end::{FrontEnd, Wanted};
use crate::orientation::{quaternion_of_zyx_deg, rotation, zyx_deg};
use crate::shared::{Agreed, agreed};
use crate::token::{New, signed, single};
use crate::{Change, Goal, NO_TURN, Passing, Program, Reason, Rewritten, Role};
use deflex_lang::shared::agree;
use deflex_text::{Content, Edit, Span, Token};
use std::collections::{HashMap, HashSet};

/// New texts of the six tokens of a motion; `None` for a token that stays.
#[derive(Clone, Debug, Default)]
struct NewTokens {
    tokens: [Option<Token>; 6],
    values: [Option<f64>; 6],
}

impl FrontEnd for Layout {
    fn passing(&self, program: &Program, target: usize) -> Passing {
        // A motion without a word of approximation positions exactly (KUKA, Operating and Programming Instructions for System
        // Integrators, *Approximate positioning*). With `C_DIS` it leaves its way `$APO.CDIS` before its end; by what distance the
        // other words do, depends on speed and orientation.
        let approximation_mm = self.sites.get(target).and_then(|site| site.approximation_mm);
        let target = &program.targets[target];
        let text = &program.sources[usize::from(target.source)].bytes[target.span.range()];
        let words = || text.split(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_');
        let is = |known: &[u8]| words().any(|word| word.eq_ignore_ascii_case(known));
        match approximation_mm.filter(|_| is(b"C_DIS")) {
            Some(distance) if distance > 0.0 => Passing::Zone(distance),
            Some(_) => Passing::Stop,
            None if names::APPROXIMATE.iter().any(|known| is(known)) => Passing::Unstated,
            None => Passing::Stop,
        }
    }

    fn insertions_refused(&self, program: &Program, before: &[usize]) -> Vec<Option<Reason>> {
        insert::refused(program, self, before)
    }

    fn passing_edits(&self, program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
        insert::without_approximation(program, wanted)
    }

    fn rewrite(&self, program: &Program, wanted: Wanted<'_>) -> Rewritten {
        let Wanted { changes, inserts, .. } = wanted;
        let mut out = Rewritten { edits: vec![Vec::new(); program.written], ..Rewritten::default() };
        let apart = self.are_apart();
        let tokens = |i: usize| self.sites[i].tokens.into_iter().flatten().collect();
        let shared = (!apart).then(|| agreed(program, &wanted, tokens));
        let (changes, along) = match &shared {
            Some(Agreed { changes, along, .. }) => (&**changes, &along[..]),
            None => (changes, &[][..]),
        };
        // A joint motion whose status or turn would be untrue stays with its numbers.
        let untrue = |i: usize| changes[i].as_ref().is_some_and(|change| change.conf.is_some());
        let tokens_of = |i: usize| {
            let change = changes[i].as_ref().filter(|_| !untrue(i));
            new_tokens_of(program, &self.sites[i], i, change)
        };
        // Where no literal is shared, there are no conflicts to resolve.
        let new_tokens: Vec<NewTokens> = if apart { Vec::new() } else { (0..changes.len()).map(tokens_of).collect() };
        let agreed = self.agreed(program, &new_tokens, along);
        let mut settled = HashMap::new();
        for (i, own) in new_tokens.iter().enumerate().filter(|(i, _)| agreed[*i] && along.contains(&true)) {
            let new = self.sites[i].tokens.iter().zip(own.values);
            settled.extend(new.filter_map(|(place, value)| Some(((*place)?, value?))));
        }
        let mut new_tokens = new_tokens.into_iter();
        let mut done = HashSet::new();
        out.written.reserve(changes.len());
        if let Some(edits) = out.edits.first_mut() {
            edits.reserve(6 * changes.len());
        }
        for i in 0..changes.len() {
            let mut own = new_tokens.next().unwrap_or_else(|| tokens_of(i));
            let site = &self.sites[i];
            if along.get(i) == Some(&true) {
                own.values = site.tokens.map(|place| settled.get(&place?).copied());
                out.along.extend(Some(i).filter(|_| own.values.iter().any(Option::is_some)));
            }
            let stays = untrue(i) || agreed.get(i) == Some(&false);
            if stays || site.tokens.iter().all(Option::is_none) {
                if changes[i].as_ref().is_some_and(|change| change.differs(&program.targets[i].goal)) {
                    let own = match program.targets[i].editable {
                        crate::Editable::No(reason) => reason,
                        _ if untrue(i) => Reason::StatusChanges,
                        _ => Reason::SharedNumbers,
                    };
                    out.kept.push((i, own));
                }
                out.written.push(written(program, site, i, &NewTokens::default()));
                continue;
            }
            out.written.push(written(program, site, i, &own));
            if apart && let Some((source, edit)) = together(program, site, &own) {
                out.edits[source].push(edit);
                continue;
            }
            for (place, token) in site.tokens.iter().zip(own.tokens) {
                let (Some(place), Some(token)) = (place, token) else { continue };
                if apart || done.insert(*place) {
                    let edit = Edit { span: place.span, content: Content::from_slice(&token) };
                    out.edits[usize::from(place.source)].push(edit);
                }
            }
        }
        for insert in inserts {
            out.insert(insert.before, insert::line(program, self, insert));
        }
        for edits in &mut out.edits {
            edits.sort_by_key(|edit| (edit.span.start, edit.span.end));
        }
        out
    }

    fn motion_targets(&self, _: &Program) -> usize {
        self.motions
    }
}

impl Layout {
    /// Whether no number is used twice: the tokens are in the order of the targets.
    fn are_apart(&self) -> bool {
        let places = || self.sites.iter().flat_map(|site| site.tokens.into_iter().flatten());
        places().zip(places().skip(1)).all(|(a, b)| a < b)
    }

    /// Decides which targets get their new numbers. All targets that share a number must need the same one, and an arc is edited as a
    /// whole.
    fn agreed(&self, program: &Program, new_tokens: &[NewTokens], along: &[bool]) -> Vec<bool> {
        let wishes_of = |i: usize| {
            let wishes = self.sites[i].tokens.iter().zip(&new_tokens[i].tokens);
            wishes.filter_map(|(place, token)| Some(((*place)?, token.as_ref())))
        };
        let wishes = |i: usize| {
            let end = (program.targets[i].role == Role::Via && i + 1 < self.sites.len()).then_some(i + 1);
            std::iter::once(i).chain(end).filter(|i| !along[*i]).flat_map(wishes_of).collect()
        };
        agree(&(0..new_tokens.len()).map(wishes).collect::<Vec<_>>())
    }
}

/// One edit for all numbers that change, including the text between them; `None` if none changes, or if they are far apart.
fn together(program: &Program, site: &PositionTokens, own: &NewTokens) -> Option<(usize, Edit)> {
    /// Number of bytes that an edit stores without an allocation.
    const NEAR: usize = 80;
    let mut changed =
        site.tokens.iter().zip(&own.tokens).filter_map(|(place, token)| place.as_ref().zip(token.as_ref()));
    let (first, token) = changed.next()?;
    let source = usize::from(first.source);
    let text = &program.sources[source].bytes;
    let (start, mut end) = (first.span.start as usize, first.span.end as usize);
    let mut content = Content::from_slice(token);
    for (place, token) in changed {
        let own = place.span.range();
        let between = text.get(end..own.start).filter(|_| place.source == first.source && own.end - start <= NEAR)?;
        // An inserted target stands before the start of a line, so the statement must begin its line.
        if memchr::memchr2(b'\n', b'\r', between).is_some() {
            return None;
        }
        content.extend_from_slice(between);
        content.extend_from_slice(token);
        end = own.end;
    }
    Some((source, Edit { span: Span::new(start, end), content }))
}

fn new_tokens_of(program: &Program, site: &PositionTokens, i: usize, change: Option<&Change>) -> NewTokens {
    let mut own = NewTokens::default();
    let (Some(change), Goal::Pose { quat, .. }) = (change, program.targets[i].goal) else { return own };
    let mut put = |axis: usize, value: f64, decimals: usize| {
        if let Some(place) = site.tokens[axis] {
            let mut new = New::of(bytes(program, place), value - site.offset(axis), decimals);
            // `X-0.1` without its sign would be another name.
            if let Some(token) = &mut new.token
                && token[0] != b'-'
                && follows_a_name(program, place)
            {
                token.insert(0, b' ');
            }
            (own.tokens[axis], own.values[axis]) = (new.token, new.value);
        }
    };
    for axis in 0..3 {
        put(axis, change.position_mm[axis], POSITION_DECIMALS);
    }
    if let (Some(wanted), [_, _, _, Some(a), Some(b), Some(c)]) = (change.turn(quat), site.tokens) {
        let old = [a, b, c].map(|place| signed(bytes(program, place)).unwrap_or(0.0));
        for (axis, value) in near(zyx_deg(&rotation(wanted)), old).into_iter().enumerate() {
            put(3 + axis, value, ANGLE_DECIMALS);
        }
    }
    own
}

/// Position and orientation as the controller will store them.
fn written(program: &Program, site: &PositionTokens, i: usize, own: &NewTokens) -> ([f64; 3], [f64; 4]) {
    let Goal::Pose { position_mm, quat, .. } = program.targets[i].goal else { return ([0.0; 3], NO_TURN) };
    let value = |axis: usize| {
        let stands = || site.tokens[axis].and_then(|place| signed(bytes(program, place)));
        own.values[axis].or_else(stands).map(|value| single(single(value) + site.offset(axis)))
    };
    let position = std::array::from_fn(|axis| value(axis).unwrap_or(position_mm[axis]));
    let angles = [3, 4, 5].map(value);
    let quat = match angles {
        [Some(a), Some(b), Some(c)] => quaternion_of_zyx_deg([a, b, c]),
        _ => quat,
    };
    (position, quat)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::orientation::from_zyx_deg;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nearer_angles_are_the_same_rotation(
            angles in prop::array::uniform3(-180.0..180.0_f64), old in prop::array::uniform3(-180.0..180.0_f64),
        ) {
            let chosen = near(angles, old);
            prop_assert!((from_zyx_deg(chosen).matrix() - from_zyx_deg(angles).matrix()).amax() < 1e-9);
            prop_assert!(chosen.iter().all(|angle| angle.abs() <= 180.0 + 1e-9));
        }
    }

    #[test]
    fn angles_stay_near_what_was_written() {
        assert_eq!(near([179.0, 1.0, -179.0], [-1.0, 179.0, 1.0]).to_vec(), [-1.0, 179.0, 1.0]);
        assert_eq!(near([-179.5, 0.0, 0.0], [180.0, 0.0, 0.0]).to_vec(), [-179.5, 0.0, 0.0]);
        assert_eq!(near([10.0, 0.0, 0.0], [370.5, 0.0, 0.0]).to_vec(), [370.0, 0.0, 0.0]);
    }
}
