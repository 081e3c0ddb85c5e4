//! Writes corrected poses into the tokens that decide them.

use super::{Layout, PoseSource};
use crate::front_end::Wanted;
use crate::shared::{Agreed, agreed};
use crate::token::{New, signed};
use crate::{Change, Editable, Goal, NO_TURN, Program, Reason, RewriteOptions, Rewritten};
use deflex_lang::ir::TokenId;
use deflex_lang::shared::agree;
use deflex_text::{Content, Edit, Token};
use std::collections::BTreeMap;

/// The new tokens of one target.
pub(super) struct Print {
    pub(super) tokens: Vec<(TokenId, Option<Token>)>,
    /// Position, mm, and orientation in the controller's precision.
    pub(super) written: ([f64; 3], [f64; 4]),
}

pub(super) fn rewrite(program: &Program, layout: &Layout, wanted: Wanted<'_>) -> Rewritten {
    let options = wanted.options;
    let tokens = |i: usize| {
        let affine = layout.sites[i].iter().flat_map(|site| site.affine).flatten();
        affine.map(|affine| affine.token).collect()
    };
    let Agreed { changes, along, .. } = agreed(program, &wanted, tokens);
    let mut kept = Vec::new();
    let mut prints: Vec<Option<Print>> = Vec::with_capacity(changes.len());
    for (i, (site, change)) in layout.sites.iter().zip(&*changes).enumerate() {
        let target = &program.targets[i];
        let print = match (target.editable, site, change) {
            (Editable::No(why), _, Some(change)) if change.differs(&target.goal) => Err(why),
            (Editable::No(_), ..) | (_, None, _) => Ok(None),
            _ if along[i] => Ok(None),
            (_, Some(site), None) => Ok(Some(unchanged(site, &target.goal))),
            (editable, Some(site), Some(change)) => {
                print(program, layout, i, site, change, editable == Editable::Position, options).map(Some)
            }
        };
        match print {
            Ok(print) => prints.push(print),
            Err(why) => {
                kept.push((i, why));
                prints.push(site.as_ref().map(|site| unchanged(site, &target.goal)));
            }
        }
    }
    // The points of an arc count as one user.
    let mut groups: Vec<std::ops::Range<usize>> = Vec::new();
    let mut arcs = layout.arcs.clone();
    arcs.sort_by_key(|arc| arc.start);
    let mut at = 0;
    for arc in arcs {
        groups.extend((at..arc.start).map(|i| i..i + 1));
        at = arc.end.max(at);
        groups.push(arc);
    }
    groups.extend((at..prints.len()).map(|i| i..i + 1));
    let refused = |group: &std::ops::Range<usize>| group.clone().any(|i| kept.iter().any(|(kept, _)| *kept == i));
    let wishes: Vec<Vec<(TokenId, Option<Token>)>> = groups
        .iter()
        .map(|group| {
            let hold = group.len() > 1 && refused(group);
            let tokens = group.clone().filter_map(|i| prints[i].as_ref()).flat_map(|print| &print.tokens);
            tokens.map(|(token, text)| (*token, text.clone().filter(|_| !hold))).collect()
        })
        .collect();
    let agreed = agree(&wishes);
    let mut texts: BTreeMap<TokenId, Token> = BTreeMap::new();
    let mut written: Vec<([f64; 3], [f64; 4])> = program.targets.iter().map(|target| held(&target.goal)).collect();
    for ((group, agreed), wish) in groups.iter().zip(agreed).zip(wishes) {
        let whole = group.len() == 1 || !group.clone().any(|i| kept.iter().any(|(kept, _)| *kept == i));
        if agreed && whole {
            texts.extend(wish.into_iter().filter_map(|(token, text)| Some((token, text?))));
            for i in group.clone() {
                if let Some(print) = &prints[i] {
                    written[i] = print.written;
                }
            }
            continue;
        }
        for i in group.clone() {
            let wanted = changes[i].as_ref().is_some_and(|change| change.differs(&program.targets[i].goal));
            if wanted && !kept.iter().any(|(kept, _)| *kept == i) {
                kept.push((i, Reason::SharedNumbers));
            }
        }
    }
    let mut went = Vec::new();
    for i in (0..along.len()).filter(|i| along[*i]) {
        if let (Some(site), Goal::Pose { quat, .. }) = (&layout.sites[i], program.targets[i].goal) {
            let new = |at: usize| {
                let affine = site.affine[at]?;
                Some(affine.scale * signed(texts.get(&affine.token)?)? + affine.offset)
            };
            if (0..6).all(|at| new(at).is_none()) {
                continue;
            }
            went.push(i);
            written[i] = layout.held(site, std::array::from_fn(|at| new(at).unwrap_or(site.numbers[at])));
            if (3..6).all(|at| new(at).is_none()) {
                written[i].1 = quat;
            }
        }
    }
    let mut edits = vec![Vec::new(); program.written];
    for (token, text) in texts {
        let place = layout.place(token);
        edits[usize::from(place.source)].push(Edit { span: place.span, content: Content::from_slice(&text) });
    }
    edits.iter_mut().for_each(|edits: &mut Vec<Edit>| edits.sort_by_key(|edit| edit.span));
    kept.sort_unstable();
    Rewritten { edits, written, kept, along: went, ..Rewritten::default() }
}

fn held(goal: &Goal) -> ([f64; 3], [f64; 4]) {
    match *goal {
        Goal::Pose { position_mm, quat, .. } => (position_mm, quat),
        _ => ([0.0; 3], NO_TURN),
    }
}

fn unchanged(site: &PoseSource, goal: &Goal) -> Print {
    let tokens = site.affine.iter().flatten().map(|affine| (affine.token, None)).collect();
    Print { tokens, written: held(goal) }
}

/// New texts of the tokens of a target.
pub(super) fn print(
    program: &Program,
    layout: &Layout,
    target: usize,
    site: &PoseSource,
    change: &Change,
    position_only: bool,
    options: &RewriteOptions,
) -> Result<Print, Reason> {
    let (style, goal) = (layout.style, &program.targets[target].goal);
    if !change.differs(goal) {
        return Ok(unchanged(site, goal));
    }
    let Goal::Pose { quat: was, .. } = *goal else { return Ok(unchanged(site, goal)) };
    let quat = change.turn(was);
    let mut values = site.numbers;
    let changed = match quat {
        Some(_) if position_only => return Err(Reason::PositionOnly),
        Some(quat) => {
            let wanted = layout.pose(change.position_mm, quat);
            let own = site.left.inverse() * wanted * site.right.inverse();
            for (value, new) in values.iter_mut().zip(style.dialect.numbers(&own, &site.numbers)) {
                *value = new;
            }
            6
        }
        None => {
            // The turn stays, number by number: only the position moves.
            let wanted = nalgebra::Point3::from(change.position_mm.map(|mm| mm / style.mm));
            let inner = site.left.inverse() * wanted - site.own.rotation * site.right.translation.vector;
            values[..3].copy_from_slice(inner.coords.as_slice());
            3
        }
    };
    let mut tokens = Vec::with_capacity(6);
    let mut printed = site.numbers;
    for at in 0..6 {
        let Some(affine) = site.affine[at] else { continue };
        if at >= changed {
            tokens.push((affine.token, None));
            continue;
        }
        let position = style.position_decimals.unwrap_or(options.position_decimals + style.more_decimals);
        let least = if at < 3 { position } else { style.turn_decimals };
        // As many decimals of the token that the number is as accurate as a plain one.
        #[allow(clippy::cast_possible_truncation)]
        let step = affine.scale.abs().log10().ceil().clamp(-12.0, 12.0) as i64;
        let decimals = usize::try_from(least as i64 + step).unwrap_or(0);
        let place = layout.place(affine.token);
        let bytes = &program.sources[usize::from(place.source)].bytes;
        let new = New::of(&bytes[place.span.range()], (values[at] - affine.offset) / affine.scale, decimals);
        if let (Some(_), Some(value)) = (&new.token, new.value) {
            printed[at] = affine.scale * value + affine.offset;
        }
        tokens.push((affine.token, new.token));
    }
    let (position_mm, turn) = layout.held(site, printed);
    Ok(Print { tokens, written: (position_mm, if quat.is_some() { turn } else { was }) })
}
