//! Reads chunks of streamable programs line by line. Lines that differ only in the numbers or the name of their robtarget are of
//! one kind: [`read_as`](super::read_as) reads the first of each kind, and only numbers or name are read of the others.

use super::axes::as_written;
use super::chunk::Chunk;
use super::index::{hash, target};
use super::kinds::{Meaning, Motion, words};
use super::lines::line_of;
use super::literal::Literal;
use super::named::Declarations;
use super::sample::{FoundTarget, Named, Sample};
use super::shape::pose;
use super::{Given, Layout, TargetInText};
use crate::{ExternalAxes, Language, Mark, Predecessor, Program, Target, Tool, Wobj, intern};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Source, Span};
use std::ops::Range;
use std::sync::Arc;

/// Most kinds of lines in a chunk; with more, reading line by line gains nothing.
const MOST_KINDS: usize = 16;

/// The part of a chunk that is read.
pub(super) struct Read {
    targets: Vec<Target>,
    literals: Vec<Literal>,
    sites: Vec<TargetInText>,
    tools: Vec<Tool>,
    wobjs: Vec<Wobj>,
    mark: Option<Mark>,
    /// Whether all targets are inline.
    streamable: bool,
}

/// A kind of lines.
struct AlikeLines<'a> {
    /// The text before the robtarget or its name; the whole line if there is none.
    before: &'a [u8],
    after: &'a [u8],
    /// The kind of the robtarget's declaration, if it has a name.
    template: Option<usize>,
    /// The motion, if the line is one, with its tool and work object.
    motion: Option<Target>,
    /// The last line of the kind.
    last: Last<'a>,
}

/// The last line of a kind.
enum Last<'a> {
    None,
    Inline(Box<(Sample<'a>, Option<Arc<ExternalAxes>>)>),
    Named(Named<'a>),
}

/// The target of a line.
enum To<'s> {
    /// None, or one without a position in the text.
    Nowhere,
    Inline(FoundTarget<'s>, &'s Option<Arc<ExternalAxes>>),
    /// A declared one, and the range of its name.
    Named(usize, Range<usize>),
}

/// Reads a chunk; `None` if it needs the full reader.
pub(super) fn read(chunk: &Chunk) -> Option<Read> {
    if !chunk.plain_head {
        return None;
    }
    let bytes = &chunk.source.bytes[..chunk.stretch.end];
    let (mut declarations, literals) = Declarations::read(bytes, chunk.declared.clone())?;
    let motions = chunk.motions as usize;
    let mut read = Read {
        targets: Vec::with_capacity(motions),
        literals,
        sites: Vec::with_capacity(motions),
        tools: Vec::new(),
        wobjs: Vec::new(),
        mark: chunk.mark_before,
        streamable: declarations.is_empty(),
    };
    if read.streamable {
        read.literals.reserve(motions);
    }
    let mut kinds: Vec<AlikeLines> = Vec::new();
    let mut last = 0;
    let (mut start, mut line_number) = (chunk.stretch.start, chunk.lines_before);
    while start < bytes.len() {
        line_number += 1;
        if let Some(AlikeLines { template, motion: Some(like), last, .. }) = kinds.get_mut(last)
            && let Some((to, text, end)) = last.again(*template, &mut declarations, bytes, start)
        {
            start = end;
            read.push(chunk, &mut declarations, like, line_number, text, to)?;
            continue;
        }
        let line = line_of(&bytes[start..]);
        let first = start + line.len() - line.trim_ascii_start().len();
        let text = line.trim_ascii();
        let line_start = start;
        start += line.len();
        match text.first() {
            None if line.contains(&b'\r') && !line.ends_with(b"\r\n") => return None,
            None => continue,
            Some(b'!') => {
                read.mark = Mark::of(&text[1..]).or(read.mark);
                if text.contains(&b'\r') {
                    return None;
                }
                continue;
            }
            Some(_) => {}
        }
        let open = text.iter().position(|b| *b == b'[').unwrap_or(text.len());
        let robtarget = Literal::read(bytes, 0, first + open);
        let named = target(text).filter(|_| !read.streamable && robtarget.is_none());
        let named = named.and_then(|name| Some((declarations.find(&text[name.clone()])?, name)));
        let (before, after) = match (&robtarget, &named) {
            // A literal over several lines is left to the full reader.
            (Some((literal, _)), _) => (&text[..open], text.get(literal.span().range().end - first..)?),
            (None, Some((_, name))) => (&text[..name.start], &text[name.end..]),
            (None, None) => (text, &[][..]),
        };
        let template = named.as_ref().map(|(target, _)| declarations.template(*target));
        let alike = |kind: &AlikeLines| kind.template == template && kind.after == after && kind.before == before;
        if !kinds.get(last).is_some_and(alike) {
            last = kinds.iter().position(alike).unwrap_or(kinds.len());
            if last == kinds.len() {
                if last == MOST_KINDS {
                    return None;
                }
                kinds.push(read.kind(chunk, &declarations, before, after, template, text)?);
            }
        }
        let kind = &mut kinds[last];
        let Some(like) = &kind.motion else { continue };
        let (at, axes);
        let to = match (&robtarget, named) {
            (Some((literal, written)), _) => {
                if bytes[literal.span().range()].contains(&b'\r') {
                    return None;
                }
                axes = as_written(&written.external);
                let sample = Sample::new(line, line_start, *literal, written);
                kind.last = sample.map_or(Last::None, |sample| Last::Inline(Box::new((sample, axes.clone()))));
                at = pose(written.position_mm, written.quat)?;
                To::Inline(FoundTarget { literal, start: literal.span().start, pose: &at, conf: &written.conf }, &axes)
            }
            (None, Some((target, name))) => {
                let name = first + name.start..first + name.end;
                let sample = Named::new(line, name.start - line_start..name.end - line_start);
                kind.last = sample.map_or(Last::None, Last::Named);
                To::Named(target, name)
            }
            (None, None) => To::Nowhere,
        };
        read.push(chunk, &mut declarations, like, line_number, first..first + text.len(), to)?;
    }
    // Names that also mean something else in the program.
    if !read.streamable {
        let texts = kinds.iter().flat_map(|kind| [kind.before, kind.after]);
        let mut taken: Vec<u64> = texts.flat_map(words).collect();
        taken.extend(chunk.kinds.words_of_head(|| chunk.head_with(b"")));
        taken.sort_unstable();
        if declarations.any_of(&taken) {
            return None;
        }
    }
    (read.targets.len() == motions).then_some(read)
}

impl<'a> Last<'a> {
    /// The line at `start`, if it is of this kind: its target, the start of its text, and its end.
    #[inline]
    fn again(
        &mut self,
        template: Option<usize>,
        declarations: &mut Declarations,
        bytes: &'a [u8],
        start: usize,
    ) -> Option<(To<'_>, Range<usize>, usize)> {
        match self {
            Self::None => None,
            Self::Inline(last) => {
                // The text after the pose is the same.
                let (sample, axes) = &mut **last;
                let (indent, trailing) = (sample.indent, sample.trailing);
                let (found, len) = sample.read(bytes, start)?;
                Some((To::Inline(found, axes), start + indent..start + len - trailing, start + len))
            }
            Self::Named(named) => {
                let (name, len) = named.read(bytes, start)?;
                let target = declarations.find(&bytes[name.clone()])?;
                let text = start + named.indent..start + len - named.trailing;
                (Some(declarations.template(target)) == template).then_some((
                    To::Named(target, name),
                    text,
                    start + len,
                ))
            }
        }
    }
}

impl Read {
    /// Adds the motion of a line of a known kind, from the start of its text and its target.
    fn push(
        &mut self,
        chunk: &Chunk,
        declarations: &mut Declarations,
        like: &Target,
        line: usize,
        text: Range<usize>,
        to: To<'_>,
    ) -> Option<()> {
        let ordinal = chunk.motions_before + u32::try_from(self.targets.len()).ok()? + 1;
        // Built in place.
        self.targets.push(like.clone());
        let target = self.targets.last_mut()?;
        let site = match to {
            To::Nowhere => TargetInText::None,
            To::Inline(found, axes) => {
                target.goal = found.goal();
                target.external.clone_from(axes);
                self.literals.push(*found.literal);
                self.literals.last_mut()?.move_to(found.start);
                TargetInText::Literal { literal: u32::try_from(self.literals.len() - 1).ok()?, given: Given::Inline }
            }
            To::Named(declared, name) => {
                target.goal = declarations.goal(declared);
                target.external.clone_from(declarations.external(declared));
                target.name = declarations.name(declared, &chunk.source.bytes[name.clone()]);
                let given = Given::Declared(SourceSpan { source: 0, span: Span::new(name.start, name.end) });
                TargetInText::Literal { literal: u32::try_from(declared).ok()?, given }
            }
        };
        self.sites.push(site);
        target.ordinal = ordinal;
        target.mark = self.mark;
        target.span = Span::new(text.start, text.end);
        target.line = u32::try_from(line).ok()?;
        Some(())
    }

    /// Adds a new kind of line.
    fn kind<'a>(
        &mut self,
        chunk: &Chunk,
        declarations: &Declarations,
        before: &'a [u8],
        after: &'a [u8],
        template: Option<usize>,
        text: &[u8],
    ) -> Option<AlikeLines<'a>> {
        let declared_as = template.map(|template| &declarations.templates()[template]);
        let inline = template.is_none() && before.len() < text.len();
        // A line contains no line end, so different kinds have different texts.
        let mut alike = vec![before];
        alike.extend((inline || template.is_some()).then_some(after));
        alike.extend(declared_as.into_iter().flat_map(|template| template.text()));
        let declaration = declared_as.map(|template| template.line);
        let meaning = chunk.kinds.meaning(alike.join(&b'\n'), || {
            let name = text.get(before.len()..text.len() - after.len()).filter(|_| template.is_some()).map(hash);
            let head = chunk.kinds.words_of_head(|| chunk.head_with(b""));
            // A target named like something else means that here, but not in other chunks.
            let taken = name.is_some_and(|name| {
                head.contains(&name) || [before, after].into_iter().flat_map(words).any(|word| word == name)
            });
            if taken { None } else { learn(chunk, text, declaration, usize::from(before != text)) }
        })?;
        let motion = match meaning {
            Some(Motion { like, tool, wobj }) => Some(Target {
                tool: intern(&mut self.tools, &tool, Tool::is)?,
                wobj: intern(&mut self.wobjs, &wobj, Wobj::is)?,
                // Read alone, it would be the first target.
                predecessor: Predecessor::Previous,
                ..like
            }),
            None => None,
        };
        Some(AlikeLines { before, after, template, motion, last: Last::None })
    }

    /// The chunk as a program.
    pub(super) fn into_program(self, dialect: &'static str, source: Source) -> Program {
        let literal_targets = self.literals.len();
        let layout = crate::Layout::Rapid(Layout {
            literals: Arc::new(self.literals),
            sites: self.sites,
            motions: self.targets.len(),
            streamable: self.streamable,
            plain: true,
            mark_at_end: self.mark,
            ..Layout::default()
        });
        Program {
            tools: self.tools,
            wobjs: self.wobjs,
            targets: self.targets,
            literal_targets,
            ..Program::empty(Language::Rapid, dialect, ([source].into(), 1), layout)
        }
    }
}

/// Reads a line with the full reader, after the program's head and the declaration of its target, if any.
fn learn(chunk: &Chunk, text: &[u8], declaration: Option<&[u8]>, robtargets: usize) -> Option<Meaning> {
    let head = chunk.head_with(declaration.unwrap_or_default());
    let whole = Span::new(head.len(), head.len() + text.len());
    let mut program = chunk.program_of(head, text)?;
    let crate::Layout::Rapid(layout) = &program.layout else { return None };
    let plain = if declaration.is_some() { layout.plain } else { layout.streamable };
    let plain = plain && program.diagnostics.is_empty() && program.kept.is_empty();
    if !plain || layout.literals.len() != robtargets || program.targets.len() < robtargets || text.contains(&b'\r') {
        return None;
    }
    let motion = program.targets.pop();
    if !program.targets.is_empty() || motion.as_ref().is_some_and(|target| target.span != whole) {
        return None;
    }
    Some(motion.map(|like| Motion {
        tool: program.tools[usize::from(like.tool)].clone(),
        wobj: program.wobjs[usize::from(like.wobj)].clone(),
        like,
    }))
}
