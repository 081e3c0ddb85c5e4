//! Clones: if users of a declared target need different corrections, one keeps the declaration, and the others get their own.

use super::lex::{Cursor, Key, LexemeKind, key};
use super::writer::{Print, Writer};
use super::{Given, TargetInText};
use crate::line::{indent, line_end};
use crate::{Change, Editable, Reason};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Edit, Source, Span};
use std::collections::HashMap;

/// Longest name of RAPID.
const MAX_NAME: usize = 32;

/// Settles a literal whose users disagree: by clones if they are allowed and possible; otherwise every user is kept.
pub(super) fn resolve(
    writer: &mut Writer<'_>,
    literal: u32,
    changes: &[Option<Change>],
    prints: &mut [Option<Print>],
    cloned: &mut HashMap<usize, Print>,
    reason: Reason,
) {
    let mut groups: Vec<(Print, Vec<usize>)> = Vec::new();
    for (i, site) in writer.layout.sites.iter().enumerate() {
        let TargetInText::Literal { literal: of, .. } = *site else { continue };
        if of != literal || writer.along[i] || writer.program.targets[i].editable != Editable::Pose {
            continue;
        }
        let print = changes[i]
            .as_ref()
            .map_or_else(Print::default, |c| writer.print(i, &writer.layout.literals[literal as usize], c));
        match groups.iter_mut().find(|(p, _)| *p == print) {
            Some((_, users)) => users.push(i),
            None => groups.push((print, vec![i])),
        }
    }
    if !writer.options.allow_clones || !try_clones(writer, literal, &groups, prints, cloned) {
        for (print, users) in &groups {
            if *print != Print::default() {
                writer.kept.extend(users.iter().map(|&i| (i, reason)));
            }
        }
    }
}

/// Writes the clones. Returns `false` and writes nothing if an instruction belongs to several groups.
fn try_clones(
    writer: &mut Writer<'_>,
    literal: u32,
    groups: &[(Print, Vec<usize>)],
    prints: &mut [Option<Print>],
    cloned: &mut HashMap<usize, Print>,
) -> bool {
    let place = writer.layout.literals[literal as usize];
    let source = &writer.program.sources[place.source as usize];
    let Some((start, end, kind)) = declaration(source, place.span()) else { return false };
    // The argument that names the literal, and the group that it runs for.
    let mut arguments: HashMap<SourceSpan, usize> = HashMap::new();
    for (g, (_, users)) in groups.iter().enumerate() {
        for &i in users {
            // A parameter or a copy has the literal in this run alone, and may be seen where the declaration is not.
            let TargetInText::Literal { given: Given::Declared(argument), .. } = writer.layout.sites[i] else {
                return false;
            };
            let direct = argument.source == writer.program.targets[i].source
                && argument.span.start >= writer.program.targets[i].span.start
                && argument.span.end <= writer.program.targets[i].span.end;
            if !direct
                || argument.source as usize >= writer.program.written
                || *arguments.entry(argument).or_insert(g) != g
            {
                return false;
            }
        }
    }
    // An element with a variable index names other elements too, and a statement may cut in one run and not in another.
    let others = writer.layout.sites.iter().zip(&writer.along).any(|(site, along)| {
        matches!(site, TargetInText::Literal { literal: of, given: Given::Declared(argument) }
            if (*of != literal || *along) && arguments.contains_key(argument))
    });
    if others {
        return false;
    }
    let mut sorted: Vec<(SourceSpan, usize)> = arguments.into_iter().collect();
    sorted.sort_unstable_by_key(|(p, _)| (p.source, p.span));
    let (indent, line_end) = (indent(&source.bytes, start as usize), line_end(&source.bytes, end as usize).0);
    for (g, (print, users)) in groups.iter().enumerate() {
        if g == 0 {
            prints[literal as usize] = Some(print.clone());
            continue;
        }
        let clone = free_name(writer, source.slice(kind.name), literal, g);
        let mut content = line_end.to_vec();
        content.extend_from_slice(indent);
        if kind.local {
            content.extend_from_slice(b"LOCAL ");
        }
        content.extend_from_slice(b"CONST robtarget ");
        content.extend_from_slice(clone.as_bytes());
        content.extend_from_slice(b":=");
        content.extend_from_slice(&writer.literal_text(&place, print));
        content.push(b';');
        writer.edits[place.source as usize].push(Edit { span: Span { start: end, end }, content: content.into() });
        for (argument, _) in sorted.iter().filter(|(_, of)| *of == g) {
            let edit = Edit { span: argument.span, content: clone.as_bytes().into() };
            writer.edits[argument.source as usize].push(edit);
        }
        cloned.extend(users.iter().map(|&i| (i, print.clone())));
    }
    true
}

struct Declared {
    name: Span,
    local: bool,
}

/// The declaration around a literal: its first byte, the byte after its `;`, what it declares.
fn declaration(source: &Source, literal: Span) -> Option<(u32, u32, Declared)> {
    let bytes = &source.bytes;
    let semicolon = bytes[literal.end as usize..].iter().position(|b| *b == b';')?;
    // A statement has a `;` only at its end, except in strings and comments. There the search ends early, and the target
    // is not cloned.
    let from = bytes[..literal.start as usize].iter().rposition(|b| *b == b';').map_or(0, |p| p + 1);
    let end = literal.end as usize + semicolon + 1;
    let mut cursor = Cursor::new(bytes, Span::new(from, end));
    let (mut local, mut start) = (false, None);
    loop {
        let lexeme = cursor.next();
        match (lexeme.kind, key(cursor.text(lexeme))) {
            (LexemeKind::End, _) => return None,
            (LexemeKind::Word, Some(Key::Local)) => (local, start) = (true, Some(lexeme.start)),
            (LexemeKind::Word, Some(Key::Task)) => start = Some(lexeme.start),
            (LexemeKind::Word, Some(Key::Const | Key::Pers | Key::Var)) => {
                cursor.accept(LexemeKind::Word)?;
                let name = cursor.accept(LexemeKind::Word)?.span();
                let start = start.unwrap_or(lexeme.start);
                return Some((u32::try_from(start).ok()?, u32::try_from(end).ok()?, Declared { name, local }));
            }
            _ => {}
        }
    }
}

/// A name that does not occur in the program.
fn free_name(writer: &Writer<'_>, name: &[u8], literal: u32, group: usize) -> String {
    // Letters beyond ASCII mean one thing in ISO 8859-1 and another in UTF-8.
    let base: String = name.iter().filter(|b| b.is_ascii()).map(|&b| b as char).collect();
    let mut number = group + 1;
    loop {
        let tail = format!("_{number}");
        let mut clone: String = base.chars().take(MAX_NAME - tail.len()).collect();
        clone.push_str(&tail);
        let needle = clone.as_bytes();
        let taken = |s: &Source| s.bytes.windows(needle.len()).any(|w| w.eq_ignore_ascii_case(needle));
        let ours = |e: &Edit| e.content.windows(needle.len()).any(|w| w.eq_ignore_ascii_case(needle));
        if !writer.program.sources.iter().any(taken) && !writer.edits.iter().flatten().any(ours) {
            return clone;
        }
        number += literal as usize % 7 + 1;
    }
}
