//! The index of a long program: the lines that declare its targets, and the lines of its routines, unread.

use super::lines::{LONGEST_HEAD, first_word, is_motion};
use super::predefined::harmless;
use super::routines::Routine;
use crate::Mark;
use deflex_text::lines;
use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::ops::Range;

/// Longest line, bytes.
const LONGEST: u64 = 4096;

/// The declarations of targets, one a line.
#[derive(Debug)]
pub(super) struct Index {
    /// In the order of the file.
    entries: Vec<Entry>,
    /// Indices of `entries`, sorted by [`Entry::name`].
    by_name: Vec<u32>,
}

/// The line of a declaration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Hash of the name in upper case; the reader of the line compares the name itself.
    name: u64,
    /// Offset of the line in the file.
    pub(super) start: u64,
    /// Bytes of the line, with its line end.
    pub(super) len: u32,
    uses: Uses,
}

/// How often motions go to a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Uses {
    None,
    Once,
    More,
}

impl Entry {
    /// Whether several motions go there.
    pub(super) fn shared(&self) -> bool {
        self.uses == Uses::More
    }
}

/// A program up to its first routine.
pub(super) struct Head {
    /// Everything but the targets' declarations.
    pub(super) text: Vec<u8>,
    /// Where declarations belong: after the module's name.
    pub(super) data: usize,
}

/// The part of a program in which a line stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Within {
    Nothing,
    Data,
    Routine,
    /// After a routine.
    Module,
    /// After the module.
    End,
}

/// A program up to the line that the scan has reached.
struct Scan {
    head: Head,
    index: Index,
    routines: Vec<Routine>,
    within: Within,
    /// The declaration that follows the last one looked up.
    next: usize,
    /// The text before the name in the last declaration.
    lead: Vec<u8>,
}

impl Scan {
    /// Takes the next line of the file; `None` if it is anything but a motion, a call or a declaration.
    fn take(&mut self, line: &[u8], start: u64, lines_before: usize) -> Option<()> {
        let text = line.trim_ascii();
        // Most lines resemble the line before.
        if self.within == Within::Data
            && !self.lead.is_empty()
            && text.starts_with(&self.lead)
            && let Some(name) = declared_after(text, self.lead.len())
        {
            return self.declare(text, name, start, line.len());
        }
        let word = first_word(text);
        let len = line.len() as u64;
        let routine = procedure(text);
        match (self.within, routine) {
            (Within::Data | Within::Module, Some(name)) => {
                if self.within == Within::Data {
                    self.head.text.extend_from_slice(line);
                    self.index.sort()?;
                }
                self.routines.push(Routine::new(name));
                self.within = Within::Routine;
            }
            (Within::Nothing | Within::Data, None) => {
                if let Some(name) = declared(text).filter(|_| self.within == Within::Data) {
                    return self.declare(text, name, start, line.len());
                }
                if self.head.text.len() > LONGEST_HEAD || is_motion(word) {
                    return None;
                }
                self.head.text.extend_from_slice(line);
                if word.eq_ignore_ascii_case(b"MODULE") {
                    (self.within, self.head.data) = (Within::Data, self.head.text.len());
                }
            }
            (Within::Routine, None) if text.eq_ignore_ascii_case(b"ENDPROC") => self.within = Within::Module,
            (Within::Routine, None) => self.statement(text, start, len, lines_before)?,
            (Within::Module, None) if text.eq_ignore_ascii_case(b"ENDMODULE") => self.within = Within::End,
            // A mark outside the routines is in force somewhere else.
            (Within::Module | Within::End, None) if is_comment(text) && text.get(1..).and_then(Mark::of).is_none() => {}
            _ => return None,
        }
        Some(())
    }

    /// Takes the declaration of a target.
    fn declare(&mut self, text: &[u8], name: Range<usize>, start: u64, len: usize) -> Option<()> {
        if self.lead != text[..name.start] {
            self.lead = text[..name.start].to_vec();
        }
        let entry = Entry { name: hash(&text[name]), start, len: u32::try_from(len).ok()?, uses: Uses::None };
        self.index.entries.push(entry);
        Some(())
    }

    /// Takes a line of a routine.
    fn statement(&mut self, text: &[u8], start: u64, len: u64, lines_before: usize) -> Option<()> {
        let routine = self.routines.last_mut()?;
        let word = first_word(text);
        let moves = is_motion(word);
        if is_comment(text) || moves || harmless(text) {
            routine.moves |= moves;
            routine.line(start, len, lines_before);
            if moves && let Some(name) = target(text) {
                self.next = self.index.count(&text[name], self.next).unwrap_or(self.next);
            }
            return Some(());
        }
        let name = self::word(text, 0)?;
        (text[name.end..].trim_ascii_start() == b";").then(|| routine.call(&text[name]))
    }
}

/// Whether a text is empty or only a comment.
fn is_comment(text: &[u8]) -> bool {
    text.first().is_none_or(|first| *first == b'!')
}

/// The name of the procedure without parameters whose first line this is.
fn procedure(text: &[u8]) -> Option<&[u8]> {
    let mut keyword = word(text, 0)?;
    if text[keyword.clone()].eq_ignore_ascii_case(b"LOCAL") {
        keyword = word(text, keyword.end)?;
    }
    if !text[keyword.clone()].eq_ignore_ascii_case(b"PROC") {
        return None;
    }
    let name = word(text, keyword.end)?;
    let after = text[name.end..].trim_ascii_start();
    let alone = after.strip_prefix(b"(")?.trim_ascii_start() == b")";
    // A procedure named like an instruction would run wherever the instruction is meant.
    let name = &text[name];
    (alone && !is_motion(name) && !harmless(name)).then_some(name)
}

impl Index {
    /// Scans a program; `None` unless it is one module of procedures that only move and call each other.
    pub(super) fn read(input: &mut impl BufRead) -> io::Result<Option<(Self, Head, Vec<Routine>)>> {
        let mut scan = Scan {
            head: Head { text: Vec::new(), data: 0 },
            index: Self { entries: Vec::new(), by_name: Vec::new() },
            routines: Vec::new(),
            within: Within::Nothing,
            next: 0,
            lead: Vec::new(),
        };
        let (mut line, mut start, mut lines) = (Vec::new(), 0, 0);
        loop {
            line.clear();
            let len = input.by_ref().take(LONGEST).read_until(b'\n', &mut line)? as u64;
            if len == 0 {
                break;
            }
            // No program has a line of this length; a line without an end is the last of the file.
            if len == LONGEST || scan.take(&line, start, lines).is_none() {
                return Ok(None);
            }
            start += len;
            lines += 1;
        }
        Ok((scan.within == Within::End).then_some((scan.index, scan.head, scan.routines)))
    }

    /// Sorts the declarations by name; `None` if a name is declared twice.
    fn sort(&mut self) -> Option<()> {
        self.entries.shrink_to_fit();
        let number = |(i, entry): (usize, &Entry)| Some((entry.name, u32::try_from(i).ok()?));
        let mut names = self.entries.iter().enumerate().map(number).collect::<Option<Vec<_>>>()?;
        names.sort_unstable();
        let twice = names.windows(2).any(|pair| pair[0].0 == pair[1].0);
        self.by_name = names.into_iter().map(|(_, i)| i).collect();
        (!twice).then_some(())
    }

    /// Counts a motion to a target; returns the declaration that follows the target's.
    fn count(&mut self, name: &[u8], next: usize) -> Option<usize> {
        let entry = self.position(name, next)?;
        let uses = &mut self.entries[entry].uses;
        *uses = if *uses == Uses::None { Uses::Once } else { Uses::More };
        Some(entry + 1)
    }

    /// The index of the declaration with this name, most often `next`.
    fn position(&self, name: &[u8], next: usize) -> Option<usize> {
        let name = hash(name);
        if self.entries.get(next).is_some_and(|entry| entry.name == name) {
            return Some(next);
        }
        let at = self.by_name.binary_search_by_key(&name, |entry| self.entries[*entry as usize].name).ok()?;
        Some(self.by_name[at] as usize)
    }

    /// Whether the program moves to a target of this name.
    pub(super) fn uses(&self, name: &[u8]) -> bool {
        self.position(name, 0).is_some_and(|at| self.entries[at].uses != Uses::None)
    }

    /// The declarations of the targets that motions go to, in the order of the file.
    pub(super) fn of(&self, body: &[u8]) -> Vec<Entry> {
        let (mut found, mut next) = (Vec::new(), 0);
        for text in lines(body).map(<[u8]>::trim_ascii) {
            if let Some(entry) = target(text).and_then(|name| self.position(&text[name], next)) {
                found.push(entry);
                next = entry + 1;
            }
        }
        found.sort_unstable();
        found.dedup();
        found.into_iter().map(|entry| self.entries[entry]).collect()
    }

    /// Whether the program declares no target.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Whether several motions go to the same target.
    pub(super) fn shares(&self) -> bool {
        self.entries.iter().any(Entry::shared)
    }
}

/// The lines of declarations, one after the other.
pub(super) fn lines_of(entries: &[Entry], file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    let all: usize = entries.iter().map(|entry| entry.len as usize).sum();
    let mut text = Vec::with_capacity(all);
    let mut rest = entries;
    while let Some(first) = rest.first() {
        // Lines that adjoin in the file are read together.
        let apart = rest.windows(2).position(|pair| pair[0].start + u64::from(pair[0].len) != pair[1].start);
        let (run, others) = rest.split_at(apart.map_or(rest.len(), |at| at + 1));
        let len: u64 = run.iter().map(|entry| u64::from(entry.len)).sum();
        file.seek(SeekFrom::Start(first.start))?;
        file.by_ref().take(len).read_to_end(&mut text)?;
        rest = others;
    }
    if text.len() == all { Ok(text) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

/// FNV-1a of a name in upper case.
pub(super) fn hash(name: &[u8]) -> u64 {
    name.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte.to_ascii_uppercase())).wrapping_mul(0x100_0000_01b3)
    })
}

/// The range of the name of the target that a line declares, if the line holds nothing else.
pub(super) fn declared(text: &[u8]) -> Option<Range<usize>> {
    let mut storage = word(text, 0)?;
    while [&b"LOCAL"[..], b"TASK"].iter().any(|scope| scope.eq_ignore_ascii_case(&text[storage.clone()])) {
        storage = word(text, storage.end)?;
    }
    if ![&b"CONST"[..], b"PERS", b"VAR"].iter().any(|known| known.eq_ignore_ascii_case(&text[storage.clone()])) {
        return None;
    }
    let kind = word(text, storage.end)?;
    declared_after(text, kind.end).filter(|_| text[kind].eq_ignore_ascii_case(b"robtarget"))
}

/// The same, from after storage class and type.
fn declared_after(text: &[u8], from: usize) -> Option<Range<usize>> {
    let name = word(text, from)?;
    let value = text[name.end..].trim_ascii_start().strip_prefix(b":=")?.trim_ascii_start().strip_suffix(b";")?;
    let alone = value.starts_with(b"[") && memchr::memchr3(b';', b'!', b'"', value).is_none();
    alone.then_some(name)
}

/// The range of the first argument of a motion, if it is a name.
pub(super) fn target(text: &[u8]) -> Option<Range<usize>> {
    let motion = first_word(text);
    let name = word(text, motion.len())?;
    (is_motion(motion) && text[name.end..].trim_ascii_start().starts_with(b",")).then_some(name)
}

/// The range of the next word, after blanks.
fn word(text: &[u8], from: usize) -> Option<Range<usize>> {
    let rest = text[from..].trim_ascii_start();
    let start = text.len() - rest.len();
    let len = rest.iter().position(|b| !is_word(*b)).unwrap_or(rest.len());
    (len > 0).then_some(start..start + len)
}

/// Whether a byte can be part of a name.
pub(super) fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

#[cfg(test)]
mod tests {
    #[test]
    fn declarations_of_one_line_are_known() {
        let declared = |text: &'static [u8]| super::declared(text).map(|name| &text[name]);
        assert_eq!(declared(b"CONST robtarget p10:=[[1,2,3],[1,0,0,0]];"), Some(&b"p10"[..]));
        assert_eq!(declared(b"LOCAL PERS RobTarget p_1 := [[1,2,3]] ;"), Some(&b"p_1"[..]));
        for other in ["CONST jointtarget j:=[[1]];", "CONST robtarget p{2}:=[[1]];", "VAR robtarget p;"] {
            assert_eq!(super::declared(other.as_bytes()), None);
        }
        assert_eq!(declared(b"CONST robtarget p:=[[1]]; CONST num n:=1;"), None);
    }

    #[test]
    fn names_of_motions_are_known() {
        let target = |text: &'static [u8]| super::target(text).map(|name| &text[name]);
        assert_eq!(target(b"MoveL p10,v50,z1,t;"), Some(&b"p10"[..]));
        assert_eq!(target(b"movej  P_1 , v50,z1,t;"), Some(&b"P_1"[..]));
        assert_eq!(
            [target(b"MoveL [[1]],v50;"), target(b"MoveL Offs(p,0,0,1),v;"), target(b"MoveL p{1},v;")],
            [None; 3]
        );
    }
}
