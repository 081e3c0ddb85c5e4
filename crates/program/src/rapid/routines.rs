//! The routines of a long program, and the order in which they run.

use std::collections::HashMap;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

/// A stretch: the lines of a routine between two calls.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stretch {
    /// Offset in the file, bytes.
    pub(super) start: u64,
    /// Length, bytes.
    pub(super) len: u64,
    /// Number of lines before it in the file.
    pub(super) lines_before: usize,
    pub(super) lines: usize,
}

/// A procedure without parameters that only moves and calls others of its kind.
#[derive(Debug)]
pub(super) struct Routine {
    /// In upper case.
    name: Vec<u8>,
    steps: Vec<RoutineStep>,
    pub(super) moves: bool,
}

#[derive(Debug)]
enum RoutineStep {
    Lines(Stretch),
    /// A call of the routine of this name, in upper case.
    Call(Vec<u8>),
}

impl Routine {
    pub(super) fn new(name: &[u8]) -> Self {
        Self { name: name.to_ascii_uppercase(), steps: Vec::new(), moves: false }
    }

    /// Adds a line.
    pub(super) fn line(&mut self, start: u64, len: u64, lines_before: usize) {
        if !matches!(self.steps.last(), Some(RoutineStep::Lines(_))) {
            self.steps.push(RoutineStep::Lines(Stretch { start, lines_before, ..Stretch::default() }));
        }
        if let Some(RoutineStep::Lines(stretch)) = self.steps.last_mut() {
            stretch.len += len;
            stretch.lines += 1;
        }
    }

    pub(super) fn call(&mut self, name: &[u8]) {
        self.steps.push(RoutineStep::Call(name.to_ascii_uppercase()));
    }
}

/// The stretches in the order in which they run; `None` if a call is unknown or recursive, a motion runs twice or never, or a routine that
/// nothing calls has calls, because what these run also runs elsewhere.
pub(super) fn running(routines: &[Routine]) -> Option<Vec<Stretch>> {
    let by_name: HashMap<&[u8], usize> = routines.iter().enumerate().map(|(i, r)| (&r.name[..], i)).collect();
    if by_name.len() < routines.len() {
        return None;
    }
    let called = |routine: &Routine| {
        let step = |step: &RoutineStep| matches!(step, RoutineStep::Call(name) if *name == routine.name);
        routines.iter().any(|other| other.steps.iter().any(step))
    };
    // As in `run`: from `main`, or else from every procedure that no other calls.
    let entries = match by_name.get(&b"MAIN"[..]) {
        Some(main) => vec![*main],
        None => (0..routines.len()).filter(|i| !called(&routines[*i])).collect(),
    };
    let mut order = Order { routines, by_name, visits: vec![0; routines.len()], stretches: Vec::new() };
    for entry in entries {
        order.visit(entry, 0)?;
    }
    let calls = |routine: &Routine| routine.steps.iter().any(|step| matches!(step, RoutineStep::Call(_)));
    let once = |(routine, visits): (&Routine, &usize)| match visits {
        0 => !routine.moves && !calls(routine),
        1 => true,
        _ => !routine.moves,
    };
    routines.iter().zip(&order.visits).all(once).then_some(order.stretches)
}

struct Order<'a> {
    routines: &'a [Routine],
    by_name: HashMap<&'a [u8], usize>,
    visits: Vec<usize>,
    stretches: Vec<Stretch>,
}

impl Order<'_> {
    fn visit(&mut self, routine: usize, depth: usize) -> Option<()> {
        /// Posts nest two or three calls; recursion has no end.
        const DEEPEST: usize = 16;
        /// Calls of routines without motion may double at each depth.
        const MOST_CALLS: usize = 1 << 20;
        let routines = self.routines;
        self.visits[routine] += 1;
        if depth > DEEPEST || self.stretches.len() > MOST_CALLS || routines[routine].moves && self.visits[routine] > 1 {
            return None;
        }
        for step in &routines[routine].steps {
            match step {
                RoutineStep::Lines(stretch) => self.stretches.push(*stretch),
                RoutineStep::Call(name) => self.visit(*self.by_name.get(&name[..])?, depth + 1)?,
            }
        }
        Some(())
    }
}

/// The text that ends all stretches, as if they were one procedure.
const END: &[u8] = b"ENDPROC\nENDMODULE\n";

/// Reads the stretches of a file as one text, with an end of its own.
#[derive(Debug)]
pub(super) struct Running<R> {
    file: R,
    stretches: Arc<[Stretch]>,
    /// The stretch that is being read, and how many bytes of it are read.
    at: usize,
    done: u64,
}

impl<R> Running<R> {
    pub(super) fn new(file: R, stretches: Arc<[Stretch]>) -> Self {
        Self { file, stretches, at: 0, done: 0 }
    }
}

impl<R: Read + Seek> Read for Running<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let Some(stretch) = self.stretches.get(self.at) else {
            let mut end = END.get(usize::try_from(self.done).unwrap_or(usize::MAX)..).unwrap_or_default();
            let read = end.read(buffer)?;
            self.done += read as u64;
            return Ok(read);
        };
        if self.done == 0 {
            self.file.seek(SeekFrom::Start(stretch.start))?;
        }
        let read = self.file.by_ref().take(stretch.len - self.done).read(buffer)?;
        if read == 0 && !buffer.is_empty() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.done += read as u64;
        if self.done == stretch.len {
            (self.at, self.done) = (self.at + 1, 0);
        }
        Ok(read)
    }
}

/// A part of a stretch, in the order in which it runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct StretchPart {
    pub(super) start: u64,
    pub(super) len: usize,
    /// The first line of the stretch, in the file and among the lines of all stretches.
    pub(super) line: usize,
    pub(super) running_line: usize,
}

/// Maps the text of all stretches to positions in the file.
#[derive(Debug)]
pub(super) struct Parts {
    stretches: Arc<[Stretch]>,
    /// The present stretch, the bytes read of it, and the number of lines of the stretches before.
    at: usize,
    done: u64,
    lines: usize,
}

impl Parts {
    pub(super) fn new(stretches: Arc<[Stretch]>) -> Self {
        Self { stretches, at: 0, done: 0, lines: 0 }
    }

    /// The parts of the next so many bytes.
    pub(super) fn next(&mut self, mut len: usize) -> Vec<StretchPart> {
        let mut parts = Vec::new();
        while len > 0
            && let Some(stretch) = self.stretches.get(self.at)
        {
            let rest = usize::try_from(stretch.len - self.done).unwrap_or(usize::MAX);
            let taken = rest.min(len);
            let (line, running_line) = (stretch.lines_before + 1, self.lines + 1);
            parts.push(StretchPart { start: stretch.start + self.done, len: taken, line, running_line });
            len -= taken;
            self.done += taken as u64;
            if taken == rest {
                self.lines += stretch.lines;
                (self.at, self.done) = (self.at + 1, 0);
            }
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Routines, each with its calls; a name in lower case moves.
    fn routines(texts: &[(&str, &[&str])]) -> Vec<Routine> {
        let mut at = 0;
        let routine = |(name, calls): &(&str, &[&str])| {
            let mut routine = Routine::new(name.as_bytes());
            routine.moves = name.chars().all(char::is_lowercase);
            for (i, call) in calls.iter().enumerate() {
                for _ in 0..i {
                    routine.line(at, 4, at as usize / 4);
                    at += 4;
                }
                routine.call(call.as_bytes());
            }
            routine.line(at, 4, at as usize / 4);
            at += 4;
            routine
        };
        texts.iter().map(routine).collect()
    }

    fn starts(texts: &[(&str, &[&str])]) -> Option<Vec<u64>> {
        Some(running(&routines(texts))?.iter().map(|stretch| stretch.start).collect())
    }

    #[test]
    fn text_runs_from_main_into_what_it_calls() {
        assert_eq!(starts(&[("main", &["B", "a"]), ("a", &[]), ("B", &[])]), Some(vec![12, 0, 8, 4]));
        assert_eq!(starts(&[("a", &[]), ("b", &["a"]), ("c", &[])]), Some(vec![0, 4, 8]));
        // A routine without motion may run twice or never.
        assert_eq!(starts(&[("main", &["B", "B"]), ("B", &[]), ("C", &[])]), Some(vec![8, 0, 8, 4]));
    }

    #[test]
    fn motions_that_run_twice_or_never_are_not_in_one_order() {
        assert_eq!(starts(&[("main", &["a", "A"]), ("a", &[])]), None);
        assert_eq!(starts(&[("main", &[]), ("a", &[])]), None);
        assert_eq!(starts(&[("main", &["a"]), ("a", &[]), ("C", &["a"])]), None);
        assert_eq!(starts(&[("main", &["other"])]), None);
        assert_eq!(starts(&[("main", &[]), ("MAIN", &[])]), None);
        assert_eq!(starts(&[("A", &["B"]), ("B", &["A"]), ("main", &["A"])]), None);
    }

    #[test]
    fn stretches_are_read_in_order_and_found_again() {
        let file = b"0000111122223333".to_vec();
        let stretches: Arc<[Stretch]> =
            running(&routines(&[("main", &["B", "a"]), ("a", &[]), ("B", &[])])).unwrap().into();
        let mut text = String::new();
        Running::new(Cursor::new(&file), Arc::clone(&stretches)).read_to_string(&mut text).unwrap();
        assert_eq!(text, "3333000022221111ENDPROC\nENDMODULE\n");
        let mut parts = Parts::new(stretches);
        let mut found = String::new();
        for len in [1, 5, 2, 100] {
            for part in parts.next(len) {
                let start = part.start as usize;
                found += std::str::from_utf8(&file[start..start + part.len]).unwrap();
                assert_eq!(part.line, start / 4 + 1);
            }
        }
        assert_eq!(found, text[..16]);
    }
}
