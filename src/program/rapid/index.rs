//! Where a long program declares its targets, and where its routines stand: their lines, not what these say.

use super::lex;
use super::pieces::{PIECE, first_word, is_motion};
use super::routines::Routine;
use super::symbols::harmless;
use std::io::{self, BufRead, Read, Seek, SeekFrom};

/// Most bytes of a line.
const LONGEST: u64 = 4096;

/// Declarations of targets, each on a line of its own, by name.
#[derive(Debug)]
pub(super) struct Index {
    /// By [`Entry::name`].
    entries: Vec<Entry>,
}

/// A declaration's line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Hash of the name in upper case: whoever reads the line sees the name itself.
    name: u64,
    /// Offset of the line in the file.
    pub(super) start: u64,
    /// Its bytes, with its end.
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
    /// Where declarations belong: behind the module's name.
    pub(super) data: usize,
}

/// Where in a program a line stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Within {
    Nothing,
    Data,
    Routine,
    /// Behind a routine.
    Module,
    /// Behind the module.
    End,
}

/// A program as far as it was looked through.
struct Scan {
    head: Head,
    index: Index,
    routines: Vec<Routine>,
    within: Within,
}

impl Scan {
    /// Takes in a line of the file; `None` where it is more than motion, calls and data.
    fn take(&mut self, line: &[u8], start: u64, lines_before: usize) -> Option<()> {
        let text = line.trim_ascii();
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
                    let entry = Entry { name: hash(name), start, len: u32::try_from(len).ok()?, uses: Uses::None };
                    self.index.entries.push(entry);
                    return Some(());
                }
                if self.head.text.len() > PIECE || is_motion(word) {
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
            // A mark out here is in force somewhere else.
            (Within::Module | Within::End, None) if is_comment(text) && text.get(1..).and_then(lex::mark).is_none() => {
            }
            _ => return None,
        }
        Some(())
    }

    /// A line of a routine.
    fn statement(&mut self, text: &[u8], start: u64, len: u64, lines_before: usize) -> Option<()> {
        let routine = self.routines.last_mut()?;
        let word = first_word(text);
        let moves = is_motion(word);
        if is_comment(text) || moves || harmless(word) {
            routine.moves |= moves;
            routine.line(start, len, lines_before);
            if moves && let Some(name) = target(text) {
                self.index.count(name);
            }
            return Some(());
        }
        let (name, rest) = self::word(text)?;
        (rest == b";").then(|| routine.call(name))
    }
}

/// Nothing, or nothing but a comment.
fn is_comment(text: &[u8]) -> bool {
    text.first().is_none_or(|first| *first == b'!')
}

/// The name of a procedure without parameters that a line begins.
fn procedure(text: &[u8]) -> Option<&[u8]> {
    let (mut word, mut rest) = word(text)?;
    if word.eq_ignore_ascii_case(b"LOCAL") {
        (word, rest) = self::word(rest)?;
    }
    let (name, rest) = self::word(rest).filter(|_| word.eq_ignore_ascii_case(b"PROC"))?;
    let alone = rest.strip_prefix(b"(")?.trim_ascii_start() == b")";
    // One that is called like an instruction is called wherever that is meant.
    (alone && !is_motion(name) && !harmless(name)).then_some(name)
}

impl Index {
    /// Looks through a program; `None` where it is not one module of procedures that move and call each other.
    pub(super) fn read(input: &mut impl BufRead) -> io::Result<Option<(Self, Head, Vec<Routine>)>> {
        let mut scan = Scan {
            head: Head { text: Vec::new(), data: 0 },
            index: Self { entries: Vec::new() },
            routines: Vec::new(),
            within: Within::Nothing,
        };
        let (mut line, mut start, mut lines) = (Vec::new(), 0, 0);
        loop {
            line.clear();
            let len = input.by_ref().take(LONGEST).read_until(b'\n', &mut line)? as u64;
            if len == 0 {
                break;
            }
            // A line of this length is no program's; one without an end ends the file.
            if len == LONGEST || scan.take(&line, start, lines).is_none() {
                return Ok(None);
            }
            start += len;
            lines += 1;
        }
        Ok((scan.within == Within::End).then_some((scan.index, scan.head, scan.routines)))
    }

    /// Sorts the declarations by name; `None` where one stands there twice.
    fn sort(&mut self) -> Option<()> {
        self.entries.shrink_to_fit();
        self.entries.sort_unstable_by_key(|entry| entry.name);
        let twice = self.entries.windows(2).any(|pair| pair[0].name == pair[1].name);
        (!twice).then_some(())
    }

    /// Notes that a motion goes to a target.
    fn count(&mut self, name: &[u8]) {
        if let Some(entry) = self.position(name) {
            let uses = &mut self.entries[entry].uses;
            *uses = if *uses == Uses::None { Uses::Once } else { Uses::More };
        }
    }

    fn position(&self, name: &[u8]) -> Option<usize> {
        let name = hash(name);
        self.entries.binary_search_by_key(&name, |entry| entry.name).ok()
    }

    /// Whether the program moves to a target of this name.
    pub(super) fn uses(&self, name: &[u8]) -> bool {
        self.position(name).is_some_and(|at| self.entries[at].uses != Uses::None)
    }

    /// The declarations of the targets that motions go to, in the order of the file.
    pub(super) fn of(&self, body: &[u8]) -> Vec<Entry> {
        let names = body.split(|b| *b == b'\n').filter_map(|line| target(line.trim_ascii()));
        let mut found: Vec<Entry> = names.filter_map(|name| self.position(name)).map(|at| self.entries[at]).collect();
        found.sort_unstable_by_key(|entry| entry.start);
        found.dedup_by_key(|entry| entry.start);
        found
    }

    /// Whether it declares no target.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Whether several motions go to one target.
    pub(super) fn shares(&self) -> bool {
        self.entries.iter().any(Entry::shared)
    }
}

/// The lines of declarations, one behind the other.
pub(super) fn lines_of(entries: &[Entry], file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    let all: usize = entries.iter().map(|entry| entry.len as usize).sum();
    let mut text = Vec::with_capacity(all);
    let mut rest = entries;
    while let Some(first) = rest.first() {
        // Neighbours in the file are read together.
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
fn hash(name: &[u8]) -> u64 {
    name.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte.to_ascii_uppercase())).wrapping_mul(0x100_0000_01b3)
    })
}

/// The name of a target that a line, and nothing else on it, declares.
fn declared(text: &[u8]) -> Option<&[u8]> {
    let (mut word, mut rest) = word(text)?;
    while [&b"LOCAL"[..], b"TASK"].iter().any(|scope| scope.eq_ignore_ascii_case(word)) {
        (word, rest) = self::word(rest)?;
    }
    let stored = [&b"CONST"[..], b"PERS", b"VAR"].iter().any(|storage| storage.eq_ignore_ascii_case(word));
    let (kind, rest) = self::word(rest)?;
    let (name, rest) = self::word(rest)?;
    let value = rest.strip_prefix(b":=")?.trim_ascii_start().strip_suffix(b";")?;
    let alone = value.starts_with(b"[") && !value.iter().any(|b| matches!(b, b';' | b'!' | b'"'));
    (stored && kind.eq_ignore_ascii_case(b"robtarget") && alone).then_some(name)
}

/// The first argument of a motion, where it is a name.
fn target(text: &[u8]) -> Option<&[u8]> {
    let (name, rest) = word(&text[first_word(text).len()..])?;
    (is_motion(first_word(text)) && rest.starts_with(b",")).then_some(name)
}

/// A word and what follows, without the blanks around it.
fn word(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let text = text.trim_ascii_start();
    let len = text.iter().position(|b| !(b.is_ascii_alphanumeric() || *b == b'_')).unwrap_or(text.len());
    let (word, rest) = text.split_at(len);
    (!word.is_empty()).then(|| (word, rest.trim_ascii_start()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn declarations_of_one_line_are_known() {
        assert_eq!(declared(b"CONST robtarget p10:=[[1,2,3],[1,0,0,0]];"), Some(&b"p10"[..]));
        assert_eq!(declared(b"LOCAL PERS RobTarget p_1 := [[1,2,3]] ;"), Some(&b"p_1"[..]));
        for other in ["CONST jointtarget j:=[[1]];", "CONST robtarget p{2}:=[[1]];", "VAR robtarget p;"] {
            assert_eq!(declared(other.as_bytes()), None);
        }
        assert_eq!(declared(b"CONST robtarget p:=[[1]]; CONST num n:=1;"), None);
    }

    #[test]
    fn names_of_motions_are_known() {
        assert_eq!(target(b"MoveL p10,v50,z1,t;"), Some(&b"p10"[..]));
        assert_eq!(target(b"movej  P_1 , v50,z1,t;"), Some(&b"P_1"[..]));
        assert_eq!(
            [target(b"MoveL [[1]],v50;"), target(b"MoveL Offs(p,0,0,1),v;"), target(b"MoveL p{1},v;")],
            [None; 3]
        );
    }
}
