//! Inserted targets: the statement of the target after them, with other numbers.

use super::Layout;
use super::rewrite::print;
use crate::line::{indent, line_end, line_start};
use crate::{Change, Editable, Insert, Inserted, Motion, Passing, Program, Reason, RewriteOptions, Role};
use deflex_text::{Content, Edit, Span};

/// Why nothing can be inserted before a target.
pub(super) fn refusal(program: &Program, layout: &Layout, before: usize) -> Option<Reason> {
    let target = program.targets.get(before)?;
    if target.motion != Motion::Linear || target.role != Role::End {
        return Some(Reason::OnlyLines);
    }
    // The time of the whole motion would be the time of each part.
    if target.feed_mm_s.is_none() {
        return Some(Reason::NoOwnSpeed);
    }
    let within = |at: usize| {
        let affine = layout.sites[before].as_ref()?.affine[at]?;
        let place = layout.place(affine.token);
        let inside =
            place.source == target.source && target.span.start <= place.span.start && place.span.end <= target.span.end;
        inside.then_some(())
    };
    if target.editable != Editable::Pose || (0..6).any(|at| within(at).is_none()) {
        return Some(Reason::NumbersElsewhere);
    }
    let bytes = &program.sources[usize::from(target.source)].bytes;
    let start = target.span.start as usize;
    let is_first = line_start(bytes, start) + indent(bytes, start).len() == start;
    (!is_first).then_some(Reason::SharesLine)
}

/// The motion for an insert.
pub(super) fn statement(
    program: &Program,
    layout: &Layout,
    insert: &Insert,
    options: &RewriteOptions,
) -> Result<Inserted, Reason> {
    if insert.via.is_some() {
        return Err(Reason::OnlyLines);
    }
    let (target, site) = match (program.targets.get(insert.before), &layout.sites[insert.before]) {
        (Some(target), Some(site)) => (target, site),
        _ => return Err(Reason::NumbersElsewhere),
    };
    // Blends of neighbours must not overlap.
    if let Passing::Zone(radius_mm) = layout.passings[insert.before]
        && 2.0 * radius_mm > insert.room_mm
    {
        return Err(Reason::BlendTooWide);
    }
    let change = Change { position_mm: insert.position_mm, quat: Some(insert.quat), conf: None, external: None };
    let printed = print(program, layout, insert.before, site, &change, false, options)?;
    let bytes = &program.sources[usize::from(target.source)].bytes;
    let mut edits: Vec<Edit> = printed
        .tokens
        .into_iter()
        .filter_map(|(token, text)| Some(Edit { span: layout.place(token).span, content: Content::from_slice(&text?) }))
        .collect();
    edits.sort_by_key(|edit| edit.span);
    let mut text = Vec::new();
    // Writing to a Vec cannot fail.
    let _ = deflex_text::apply_within(bytes, target.span.range(), &edits, &mut text);
    let start = target.span.start as usize;
    text.extend_from_slice(line_end(bytes, target.span.end as usize).0);
    text.extend_from_slice(indent(bytes, start));
    let at = Span { start: target.span.start, end: target.span.start };
    Ok(Inserted { source: usize::from(target.source), at, text, pose: printed.written })
}
