//! Declarations of the targets to which a chunk moves by name, read line by line. Lines that differ only in name and numbers
//! form one kind and are read alike.

use super::axes::as_written;
use super::index::{declared, hash, is_word};
use super::lines::line_of;
use super::literal::Literal;
use super::sample::Sample;
use super::shape::pose;
use crate::{ExternalAxes, Goal};
use std::ops::Range;
use std::sync::Arc;

/// Longest name, as in RAPID.
const LONGEST: usize = 32;

/// Most kinds of declarations in a chunk; with more, reading line by line gains nothing.
const MOST_KINDS: usize = 4;

/// Declared targets of a chunk, in the order of the file.
pub(super) struct Declarations<'a> {
    templates: Vec<DeclarationTemplate<'a>>,
    targets: Vec<Declaration<'a>>,
    /// Targets by the hash of their names; built when a motion first goes to another target than the next.
    by_name: Vec<(u64, u32)>,
    /// The target that follows the last one looked up.
    next: usize,
}

/// A kind of declaration: a line without its name and numbers.
pub(super) struct DeclarationTemplate<'a> {
    before: &'a [u8],
    between: &'a [u8],
    after: &'a [u8],
    /// The last line of this kind, with its end.
    pub(super) line: &'a [u8],
    /// The part of that line before the name.
    lead: &'a [u8],
    /// The part of that line after the name.
    sample: Option<Sample<'a>>,
    /// External axes of the last line.
    external: Option<Arc<ExternalAxes>>,
}

/// A declared target.
pub(super) struct Declaration<'a> {
    name: &'a [u8],
    hash: u64,
    pub(super) template: usize,
    pub(super) goal: Goal,
    pub(super) external: Option<Arc<ExternalAxes>>,
    /// Its name as spelled at its first use.
    used: Option<Arc<str>>,
}

impl<'a> Declarations<'a> {
    /// Reads these lines and the positions of their numbers; `None` if a line needs the full reader.
    pub(super) fn read(bytes: &'a [u8], lines: Range<usize>) -> Option<(Self, Vec<Literal>)> {
        let bytes = &bytes[..lines.end];
        let mut read = Self { templates: Vec::new(), targets: Vec::new(), by_name: Vec::new(), next: 0 };
        let mut literals = Vec::new();
        let (mut start, mut last) = (lines.start, 0);
        while start < bytes.len() {
            if let Some(template) = read.templates.get_mut(last)
                && let Some((name, literal, goal, len)) = template.read(bytes, start)
            {
                let external = template.external.clone();
                read.push(name, last, (goal, external))?;
                literals.push(literal);
                start += len;
                continue;
            }
            let line = line_of(&bytes[start..]);
            let (template, name, literal, goal) = DeclarationTemplate::of(bytes, start, line)?;
            read.push(name, 0, (goal, template.external.clone()))?;
            literals.push(literal);
            last = read.templates.iter().position(|known| known.is(&template)).unwrap_or(read.templates.len());
            match read.templates.get_mut(last) {
                Some(known) => *known = template,
                None if last < MOST_KINDS => read.templates.push(template),
                None => return None,
            }
            read.targets.last_mut()?.template = last;
            start += line.len();
        }
        Some((read, literals))
    }

    fn push(
        &mut self,
        name: &'a [u8],
        template: usize,
        (goal, external): (Goal, Option<Arc<ExternalAxes>>),
    ) -> Option<()> {
        // Words of the language have no digits; names from the head of a program are searched in its text.
        let own = name.first().is_some_and(u8::is_ascii_alphabetic)
            && name.iter().any(|b| !b.is_ascii_alphabetic())
            && name.len() <= LONGEST;
        own.then(|| self.targets.push(Declaration { name, hash: hash(name), template, goal, external, used: None }))
    }

    /// The target with a name, most often the next one.
    pub(super) fn find(&mut self, name: &[u8]) -> Option<usize> {
        let is = |target: &Declaration| target.name.eq_ignore_ascii_case(name);
        if !self.targets.get(self.next).is_some_and(is) {
            if self.by_name.is_empty() {
                let number = |(i, target): (usize, &Declaration)| Some((target.hash, u32::try_from(i).ok()?));
                self.by_name = self.targets.iter().enumerate().map(number).collect::<Option<_>>()?;
                self.by_name.sort_unstable();
            }
            let hash = hash(name);
            let at = self.by_name.partition_point(|(other, _)| *other < hash);
            let target = self.by_name.get(at)?.1 as usize;
            self.next = Some(target).filter(|target| is(&self.targets[*target]))?;
        }
        self.next += 1;
        Some(self.next - 1)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    pub(super) fn template(&self, target: usize) -> usize {
        self.targets[target].template
    }

    pub(super) fn templates(&self) -> &[DeclarationTemplate<'a>] {
        &self.templates
    }

    pub(super) fn goal(&self, target: usize) -> Goal {
        self.targets[target].goal
    }

    pub(super) fn external(&self, target: usize) -> &Option<Arc<ExternalAxes>> {
        &self.targets[target].external
    }

    /// The name of a target, as spelled at its first use.
    pub(super) fn name(&mut self, target: usize, spelled: &[u8]) -> Option<Arc<str>> {
        let used = &mut self.targets[target].used;
        if used.is_none() {
            *used = Some(std::str::from_utf8(spelled).ok()?.into());
        }
        used.clone()
    }

    /// Whether a target has one of these names, given by their hashes.
    pub(super) fn any_of(&self, words: &[u64]) -> bool {
        debug_assert!(words.is_sorted());
        self.targets.iter().any(|target| words.binary_search(&target.hash).is_ok())
    }
}

impl<'a> DeclarationTemplate<'a> {
    /// The kind of the declaration at `start`, and what it declares.
    fn of(bytes: &'a [u8], start: usize, line: &'a [u8]) -> Option<(Self, &'a [u8], Literal, Goal)> {
        let text = line.trim_ascii();
        let indent = line.len() - line.trim_ascii_start().len();
        let name = declared(text)?;
        let open = name.end + text[name.end..].iter().position(|b| *b == b'[')?;
        let (literal, written) = Literal::read(bytes, 0, start + indent + open)?;
        let after = literal.span().range().end.checked_sub(start + indent)?;
        // The two readers count such line ends differently.
        if line.trim_ascii_end().contains(&b'\r') {
            return None;
        }
        let lead = indent + name.end;
        let template = Self {
            before: &text[..name.start],
            between: &text[name.end..open],
            after: text.get(after..)?,
            line,
            lead: &line[..indent + name.start],
            sample: Sample::new(&line[lead..], start + lead, literal, &written),
            external: as_written(&written.external),
        };
        let (position_mm, quat) = pose(written.position_mm, written.quat)?;
        Some((template, &text[name], literal, Goal::Pose { position_mm, quat, conf: written.conf }))
    }

    /// Reads the line at `start` if it is of this kind: name, robtarget, and length with the line end.
    fn read(&mut self, bytes: &'a [u8], start: usize) -> Option<(&'a [u8], Literal, Goal, usize)> {
        let rest = bytes.get(start..)?.strip_prefix(self.lead)?;
        let name = &rest[..rest.iter().position(|b| !is_word(*b))?];
        let lead = self.lead.len() + name.len();
        let (found, len) = self.sample.as_mut()?.read(bytes, start + lead)?;
        Some((name, found.literal(), found.goal(), lead + len))
    }

    fn is(&self, other: &Self) -> bool {
        (self.before, self.between, self.after) == (other.before, other.between, other.after)
    }

    /// The text that all lines of this kind share.
    pub(super) fn text(&self) -> [&'a [u8]; 3] {
        [self.before, self.between, self.after]
    }
}
