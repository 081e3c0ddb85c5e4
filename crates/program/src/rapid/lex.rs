//! Splits bytes into lexemes, in linear time and without allocation; every byte belongs to a lexeme.

use crate::Mark;
use crate::lexeme::{self, Bytes, Found, decimal};
use deflex_text::Span;
use nom::Parser;
use nom::bytes::complete::{take_till, take_while};
use nom::character::complete::{char, one_of};
use nom::combinator::recognize;
use nom::sequence::preceded;

/// The kind of a lexeme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LexemeKind {
    /// Blanks and line ends.
    Space,
    /// `!` to the end of the line.
    Comment,
    /// Identifier or reserved word.
    Word,
    /// Unsigned number: the sign is an operator.
    Number,
    /// `"…"`.
    Text,
    /// `<SMT>` and the like: a part that the author left to fill in.
    Placeholder,
    /// `:=`
    Assign,
    /// `<>`
    Unequal,
    /// `<=`
    AtMost,
    /// `>=`
    AtLeast,
    /// Any other printable character.
    Mark(u8),
    /// A byte that RAPID does not use, or a string without an end.
    Junk,
    /// The end of the input.
    End,
}

pub(super) type Lexeme = lexeme::Lexeme<LexemeKind>;

/// A lexeme outside the text.
const NONE: Lexeme = Lexeme { kind: LexemeKind::End, start: usize::MAX, end: usize::MAX };

/// Whether a byte is blank to RAPID; NUL and the control characters count too, because real files contain them.
pub(super) fn is_space(byte: u8) -> bool {
    byte <= b' ' || byte == 0x7F
}

fn is_word_start(byte: u8) -> bool {
    byte.is_ascii_alphabetic() || byte == b'_' || byte >= 0xC0
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 0x80
}

/// `12`, `1.5`, `5.`, `.5`, `9E+09`, `0x1F`, `0o17`, `0b101`: without a sign.
pub(super) fn number(input: Bytes<'_>) -> Found<'_> {
    if let [b'0', b'x' | b'X' | b'o' | b'O' | b'b' | b'B', digit, ..] = input
        && digit.is_ascii_hexdigit()
    {
        return recognize((char('0'), one_of("xXoObB"), take_while(|b: u8| b.is_ascii_hexdigit()))).parse(input);
    }
    decimal(input)
}

fn comment(input: Bytes<'_>) -> Found<'_> {
    take_till(|b| matches!(b, b'\n' | b'\r')).parse(input)
}

/// `"…"` on one line; `""` is a quote inside it.
fn text(input: Bytes<'_>) -> Found<'_> {
    let mut end = 1;
    loop {
        match input.get(end) {
            Some(b'"') if input.get(end + 1) == Some(&b'"') => end += 2,
            Some(b'"') => return Ok((&input[end + 1..], &input[..=end])),
            None | Some(b'\n' | b'\r') => return Err(nom::Err::Error(())),
            Some(_) => end += 1,
        }
    }
}

const PLACEHOLDERS: [&[u8]; 13] =
    [b"SMT", b"EXP", b"ARG", b"VAR", b"ID", b"DDN", b"RDN", b"TDN", b"PAR", b"ALT", b"DIM", b"EIT", b"CSE"];

/// A placeholder of a known name: `a<B>c` is two comparisons.
fn placeholder(input: Bytes<'_>) -> Found<'_> {
    let (_, name) = preceded(char('<'), take_while(|b: u8| b.is_ascii_alphabetic())).parse(input)?;
    let end = name.len() + 1;
    let known = PLACEHOLDERS.iter().any(|p| p.eq_ignore_ascii_case(name));
    if known && input.get(end) == Some(&b'>') {
        Ok((&input[end + 1..], &input[..=end]))
    } else {
        Err(nom::Err::Error(()))
    }
}

/// The lexeme at the start of `input`: its kind and length, which is 0 only at the end.
pub(super) fn lexeme(input: Bytes<'_>) -> (LexemeKind, usize) {
    let Some(&first) = input.first() else { return (LexemeKind::End, 0) };
    // Most lexemes are ASCII words.
    if first.is_ascii_alphabetic() {
        let end = input.iter().position(|b| !(b.is_ascii_alphanumeric() || *b == b'_')).unwrap_or(input.len());
        if input.get(end).is_none_or(u8::is_ascii) {
            return (LexemeKind::Word, end);
        }
    }
    let taken = |kind: LexemeKind, found: Found<'_>| match found {
        Ok((_, part)) => (kind, part.len()),
        Err(_) => (LexemeKind::Junk, 1),
    };
    match first {
        _ if is_space(first) => taken(LexemeKind::Space, take_while(is_space).parse(input)),
        // A no-break space, in Latin-1 or UTF-8, and the byte order mark.
        0xA0 => (LexemeKind::Space, 1),
        0xC2 if input.get(1) == Some(&0xA0) => (LexemeKind::Space, 2),
        0xEF if input.starts_with(b"\xEF\xBB\xBF") => (LexemeKind::Space, 3),
        b'!' => taken(LexemeKind::Comment, comment(input)),
        _ if is_word_start(first) => {
            let end = input.iter().zip(&input[1..]).position(|(&before, &b)| !is_word(b) || b == 0xA0 && before < 0xC2);
            (LexemeKind::Word, end.map_or(input.len(), |e| e + 1))
        }
        b'0'..=b'9' => taken(LexemeKind::Number, number(input)),
        b'.' if input.get(1).is_some_and(u8::is_ascii_digit) => taken(LexemeKind::Number, number(input)),
        b'"' => match text(input) {
            Ok((_, part)) => (LexemeKind::Text, part.len()),
            Err(_) => taken(LexemeKind::Junk, comment(input)),
        },
        b':' if input.get(1) == Some(&b'=') => (LexemeKind::Assign, 2),
        b'<' => match (input.get(1), placeholder(input)) {
            (_, Ok((_, part))) => (LexemeKind::Placeholder, part.len()),
            (Some(b'>'), _) => (LexemeKind::Unequal, 2),
            (Some(b'='), _) => (LexemeKind::AtMost, 2),
            _ => (LexemeKind::Mark(b'<'), 1),
        },
        b'>' if input.get(1) == Some(&b'=') => (LexemeKind::AtLeast, 2),
        b'#'..=b'~' => (LexemeKind::Mark(first), 1),
        _ => (LexemeKind::Junk, 1),
    }
}

/// A cursor over the lexemes that are neither blank nor comment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    /// Offset of the next lexeme or of blanks before it.
    pub(super) at: usize,
    /// Offset at which the cursor stops.
    pub(super) end: usize,
    /// End of the lexeme taken last.
    pub(super) passed: usize,
    /// The last `! deflex …` comment passed, for the code that walks statements.
    pub(super) mark: Option<Mark>,
    /// The lexeme last peeked at, often several times before it is passed.
    seen: Lexeme,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], span: Span) -> Self {
        let range = span.range();
        Self { bytes, at: range.start, end: range.end.min(bytes.len()), passed: range.start, mark: None, seen: NONE }
    }

    /// Passes blanks and comments.
    pub(super) fn skip(&mut self) {
        while self.at < self.end {
            let first = self.bytes[self.at];
            // The two common cases first.
            if first == b' ' {
                self.at += 1;
                continue;
            }
            if first.is_ascii_alphanumeric() {
                return;
            }
            let (kind, len) = lexeme(&self.bytes[self.at..self.end]);
            match kind {
                LexemeKind::Space => self.at += len,
                LexemeKind::Comment => {
                    self.mark = Mark::of(&self.bytes[self.at + 1..self.at + len]).or(self.mark);
                    self.at += len;
                }
                _ => return,
            }
        }
    }

    /// The next lexeme that is not blank, without passing it.
    pub(super) fn peek(&mut self) -> Lexeme {
        if self.seen.start != self.at {
            self.skip();
            let (kind, len) = lexeme(&self.bytes[self.at..self.end]);
            self.seen = Lexeme { kind, start: self.at, end: self.at + len };
        }
        self.seen
    }

    /// Passes and returns the next lexeme that is not blank.
    pub(super) fn next(&mut self) -> Lexeme {
        let lexeme = self.peek();
        self.pass(lexeme);
        lexeme
    }

    /// Passes a lexeme that was seen by [`Cursor::peek`].
    pub(super) fn pass(&mut self, lexeme: Lexeme) {
        self.at = lexeme.end;
        self.passed = lexeme.end;
    }

    /// Passes the next lexeme if it is of this kind.
    pub(super) fn accept(&mut self, kind: LexemeKind) -> Option<Lexeme> {
        let lexeme = self.peek();
        (lexeme.kind == kind).then(|| {
            self.pass(lexeme);
            lexeme
        })
    }

    /// Passes the next lexeme if it is this word.
    pub(super) fn accept_word(&mut self, word: &[u8]) -> bool {
        let lexeme = self.peek();
        let is = lexeme.kind == LexemeKind::Word && self.text(lexeme).eq_ignore_ascii_case(word);
        if is {
            self.pass(lexeme);
        }
        is
    }

    pub(super) fn text(&self, lexeme: Lexeme) -> &'a [u8] {
        &self.bytes[lexeme.start..lexeme.end]
    }
}

macro_rules! keys {
    ($($key:ident: $($word:literal)|+,)*) => {
        /// A reserved word that opens, divides or closes a block, so that no statement continues across it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Key {
            $($key,)*
        }

        /// The reserved word that `word` is, in any case.
        pub(super) fn key(word: &[u8]) -> Option<Key> {
            let mut upper = [0_u8; 9];
            let upper = upper.get_mut(..word.len())?;
            upper.copy_from_slice(word);
            upper.make_ascii_uppercase();
            Some(match &*upper {
                $($($word)|+ => Key::$key,)*
                _ => return None,
            })
        }
    };
}

keys! {
    Module: b"MODULE" | b"SYSMODULE", EndModule: b"ENDMODULE", Proc: b"PROC", EndProc: b"ENDPROC",
    Func: b"FUNC", EndFunc: b"ENDFUNC", Trap: b"TRAP", EndTrap: b"ENDTRAP", Record: b"RECORD", EndRecord: b"ENDRECORD",
    Alias: b"ALIAS", Local: b"LOCAL", Task: b"TASK", Var: b"VAR", Pers: b"PERS", Const: b"CONST",
    If: b"IF", Then: b"THEN", ElseIf: b"ELSEIF", Else: b"ELSE", EndIf: b"ENDIF", For: b"FOR", Do: b"DO", EndFor: b"ENDFOR",
    While: b"WHILE", EndWhile: b"ENDWHILE", Test: b"TEST", Case: b"CASE", Default: b"DEFAULT", EndTest: b"ENDTEST",
    Error: b"ERROR", Undo: b"UNDO", Backward: b"BACKWARD", Goto: b"GOTO", Return: b"RETURN", Raise: b"RAISE",
    Exit: b"EXIT", Retry: b"RETRY", TryNext: b"TRYNEXT", Connect: b"CONNECT",
}
