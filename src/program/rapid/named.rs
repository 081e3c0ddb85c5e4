//! Declarations of the targets that a chunk moves to by name, read line by line: lines that differ in nothing but name and
//! numbers declare alike.

use super::axes::as_written;
use super::index::{declared, hash, is_word};
use super::lines::line_of;
use super::literal::Literal;
use super::sample::Sample;
use super::shape::pose;
use crate::program::{ExternalAxes, Goal};
use std::ops::Range;
use std::sync::Arc;

/// Longest name; RAPID itself has the same.
const LONGEST: usize = 32;

/// A chunk of more ways to declare has nothing to gain.
const MOST_WAYS: usize = 4;

/// Declared targets of a chunk, in the order of the file.
pub(super) struct Declarations<'a> {
    ways: Vec<DeclarationTemplate<'a>>,
    targets: Vec<Declaration<'a>>,
    /// Targets by the hash of their names, once one is not the next.
    by_name: Vec<(u64, u32)>,
    /// The target after the one that was looked up last.
    next: usize,
}

/// How a target is declared: a line but for its name and its numbers.
pub(super) struct DeclarationTemplate<'a> {
    before: &'a [u8],
    between: &'a [u8],
    behind: &'a [u8],
    /// The last line of this kind, with its end.
    pub(super) line: &'a [u8],
    /// Of it, up to the name.
    lead: &'a [u8],
    /// What stands after the name.
    sample: Option<Sample<'a>>,
    /// External axes of the last line.
    external: Option<Arc<ExternalAxes>>,
}

/// A declared target.
pub(super) struct Declaration<'a> {
    name: &'a [u8],
    hash: u64,
    pub(super) way: usize,
    pub(super) goal: Goal,
    pub(super) external: Option<Arc<ExternalAxes>>,
    /// Its name where it was used first.
    used: Option<Arc<str>>,
}

impl<'a> Declarations<'a> {
    /// Reads the lines there, and where their numbers stand; `None` where only the plain way tells what one means.
    pub(super) fn read(bytes: &'a [u8], lines: Range<usize>) -> Option<(Self, Vec<Literal>)> {
        let bytes = &bytes[..lines.end];
        let mut read = Self { ways: Vec::new(), targets: Vec::new(), by_name: Vec::new(), next: 0 };
        let mut literals = Vec::new();
        let (mut start, mut last) = (lines.start, 0);
        while start < bytes.len() {
            if let Some(way) = read.ways.get_mut(last)
                && let Some((name, literal, goal, len)) = way.read(bytes, start)
            {
                let external = way.external.clone();
                read.push(name, last, (goal, external))?;
                literals.push(literal);
                start += len;
                continue;
            }
            let line = line_of(&bytes[start..]);
            let (way, name, literal, goal) = DeclarationTemplate::of(bytes, start, line)?;
            read.push(name, 0, (goal, way.external.clone()))?;
            literals.push(literal);
            last = read.ways.iter().position(|known| known.is(&way)).unwrap_or(read.ways.len());
            match read.ways.get_mut(last) {
                Some(known) => *known = way,
                None if last < MOST_WAYS => read.ways.push(way),
                None => return None,
            }
            read.targets.last_mut()?.way = last;
            start += line.len();
        }
        Some((read, literals))
    }

    fn push(&mut self, name: &'a [u8], way: usize, (goal, external): (Goal, Option<Arc<ExternalAxes>>)) -> Option<()> {
        // Words of the language have no digits; those that programs begin with are looked for in their text.
        let own = name.first().is_some_and(u8::is_ascii_alphabetic)
            && name.iter().any(|b| !b.is_ascii_alphabetic())
            && name.len() <= LONGEST;
        own.then(|| self.targets.push(Declaration { name, hash: hash(name), way, goal, external, used: None }))
    }

    /// Which target has a name: most often the next one.
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

    pub(super) fn way(&self, target: usize) -> usize {
        self.targets[target].way
    }

    pub(super) fn ways(&self) -> &[DeclarationTemplate<'a>] {
        &self.ways
    }

    pub(super) fn goal(&self, target: usize) -> Goal {
        self.targets[target].goal
    }

    pub(super) fn external(&self, target: usize) -> &Option<Arc<ExternalAxes>> {
        &self.targets[target].external
    }

    /// A target's name, as it is spelled where it is used first.
    pub(super) fn name(&mut self, target: usize, spelled: &[u8]) -> Option<Arc<str>> {
        let used = &mut self.targets[target].used;
        if used.is_none() {
            *used = Some(std::str::from_utf8(spelled).ok()?.into());
        }
        used.clone()
    }

    /// Whether one has a name of these, by their hashes.
    pub(super) fn any_of(&self, words: &[u64]) -> bool {
        debug_assert!(words.is_sorted());
        self.targets.iter().any(|target| words.binary_search(&target.hash).is_ok())
    }
}

impl<'a> DeclarationTemplate<'a> {
    /// How the line at `start` declares, and what.
    fn of(bytes: &'a [u8], start: usize, line: &'a [u8]) -> Option<(Self, &'a [u8], Literal, Goal)> {
        let text = line.trim_ascii();
        let indent = line.len() - line.trim_ascii_start().len();
        let name = declared(text)?;
        let open = name.end + text[name.end..].iter().position(|b| *b == b'[')?;
        let (literal, written) = Literal::read(bytes, 0, start + indent + open)?;
        let behind = literal.span().range().end.checked_sub(start + indent)?;
        // Line ends that only one of two ways counts.
        if line.trim_ascii_end().contains(&b'\r') {
            return None;
        }
        let lead = indent + name.end;
        let way = Self {
            before: &text[..name.start],
            between: &text[name.end..open],
            behind: text.get(behind..)?,
            line,
            lead: &line[..indent + name.start],
            sample: Sample::new(&line[lead..], start + lead, literal, &written),
            external: as_written(&written.external),
        };
        let (position_mm, quat) = pose(written.position_mm, written.quat)?;
        Some((way, &text[name], literal, Goal::Pose { position_mm, quat, conf: written.conf }))
    }

    /// Reads the line at `start`, if it is like the last one: name and robtarget, and its length with its end.
    fn read(&mut self, bytes: &'a [u8], start: usize) -> Option<(&'a [u8], Literal, Goal, usize)> {
        let rest = bytes.get(start..)?.strip_prefix(self.lead)?;
        let name = &rest[..rest.iter().position(|b| !is_word(*b))?];
        let lead = self.lead.len() + name.len();
        let (found, len) = self.sample.as_mut()?.read(bytes, start + lead)?;
        Some((name, found.literal(), found.goal(), lead + len))
    }

    fn is(&self, other: &Self) -> bool {
        (self.before, self.between, self.behind) == (other.before, other.between, other.behind)
    }

    /// All that two lines of this kind have alike.
    pub(super) fn text(&self) -> [&'a [u8]; 3] {
        [self.before, self.between, self.behind]
    }
}
