//! Makes a statement of the tokens of one record: its major word and its items.

use super::lex::{Token, TokenKind};
use super::words::{self, Meaning};

/// `[seqno] [label)] major [/ items]`
#[derive(Clone, Copy, Debug)]
pub(super) struct Statement<'a> {
    pub(super) bytes: &'a [u8],
    /// First word.
    pub(super) major: &'a [u8],
    /// Whether `=` follows the first word, or the index in brackets after it: a definition, not CL.
    pub(super) defines: bool,
    /// All after the major word and its slash.
    pub(super) items: &'a [Token],
}

impl<'a> Statement<'a> {
    /// The statement; `None` if the record does not begin with a word.
    pub(super) fn parse(bytes: &'a [u8], tokens: &'a [Token]) -> Option<Self> {
        let tokens = unnumbered(bytes, unlabelled(tokens));
        let (first, rest) = tokens.split_first()?;
        if first.kind != TokenKind::Word {
            return None;
        }
        let defines = match rest {
            [Token { kind: TokenKind::Equals, .. }, ..] => true,
            [Token { kind: TokenKind::Open, .. }, _, Token { kind: TokenKind::Close, .. }, after, ..] => {
                after.kind == TokenKind::Equals
            }
            _ => false,
        };
        // `TOOL PATH/…`: the words up to the slash are one major word, known by the first.
        let words = rest.iter().take_while(|t| t.kind == TokenKind::Word).count();
        let items = match rest.get(words) {
            Some(Token { kind: TokenKind::Slash, .. }) => &rest[words + 1..],
            _ => rest,
        };
        Some(Self { bytes, major: &bytes[first.span.range()], defines, items })
    }

    /// The statement after `RAPID,` in the same line.
    pub(super) fn after_rapid(&self) -> Option<Self> {
        let word = words::find(self.major).filter(|word| matches!(word.meaning, Meaning::Rapid));
        let at = word.and_then(|_| self.items.iter().position(|t| t.kind == TokenKind::Word))?;
        Self::parse(self.bytes, &self.items[at..])
    }

    /// The items if all of them are numbers; commas count as blanks.
    pub(super) fn numbers(&self) -> Option<Numbers<'a>> {
        let plain = self.items.iter().all(|t| matches!(t.kind, TokenKind::Number | TokenKind::Comma));
        plain.then(|| Numbers::new(self.items))
    }

    /// The numbers among the items, in order.
    pub(super) fn number_items(&self) -> Numbers<'a> {
        Numbers::new(self.items)
    }

    /// The words among the items, in order.
    pub(super) fn words(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let bytes = self.bytes;
        self.items.iter().filter(|t| t.kind == TokenKind::Word).map(move |t| &bytes[t.span.range()])
    }

    /// The number directly after `word`.
    pub(super) fn number_after(&self, word: &[u8]) -> Option<f64> {
        let is_word = |t: &Token| t.kind == TokenKind::Word && self.bytes[t.span.range()].eq_ignore_ascii_case(word);
        let values = self.values();
        values
            .clone()
            .zip(values.skip(1))
            .find(|(t, _)| is_word(t))
            .map(|(_, t)| t)
            .filter(|t| t.kind == TokenKind::Number)
            .map(|t| t.value)
    }

    /// The first number that does not follow a word other than `words`.
    pub(super) fn number_without_word(&self, words: &[&[u8]]) -> Option<f64> {
        let mut is_free = true;
        for t in self.values() {
            match t.kind {
                TokenKind::Number if is_free => return Some(t.value),
                TokenKind::Word => {
                    is_free = words.iter().any(|word| self.bytes[t.span.range()].eq_ignore_ascii_case(word));
                }
                _ => is_free = true,
            }
        }
        None
    }

    /// The words and numbers among the items.
    fn values(&self) -> impl Iterator<Item = &'a Token> + Clone + use<'a> {
        self.items.iter().filter(|t| matches!(t.kind, TokenKind::Word | TokenKind::Number))
    }

    /// Whether `word` is among the items, in any case.
    pub(super) fn has(&self, word: &[u8]) -> bool {
        self.words().any(|w| w.eq_ignore_ascii_case(word))
    }

    /// The numbers after `(word/` up to the closing bracket.
    pub(super) fn nested(&self, word: &[u8]) -> Option<Numbers<'a>> {
        let at = self
            .items
            .iter()
            .position(|t| t.kind == TokenKind::Word && self.bytes[t.span.range()].eq_ignore_ascii_case(word))?;
        let rest = &self.items[at + 1..];
        let end = rest.iter().position(|t| t.kind == TokenKind::Close).unwrap_or(rest.len());
        Some(Numbers::new(&rest[..end]))
    }
}

/// Numbers among tokens.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbers<'a>(&'a [Token]);

impl<'a> Numbers<'a> {
    fn new(tokens: &'a [Token]) -> Self {
        Self(tokens)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &'a Token> + use<'a> {
        self.0.iter().filter(|t| t.kind == TokenKind::Number)
    }

    pub(super) fn count(&self) -> usize {
        self.iter().count()
    }

    /// All numbers, if there are exactly `N`.
    pub(super) fn only<const N: usize>(&self) -> Option<[f64; N]> {
        self.first().filter(|_| self.count() == N)
    }

    /// The first `N` numbers, if there are as many.
    pub(super) fn first<const N: usize>(&self) -> Option<[f64; N]> {
        let mut values = self.iter().map(|t| t.value);
        let mut out = [0.0; N];
        for slot in &mut out {
            *slot = values.next()?;
        }
        Some(out)
    }
}

fn unlabelled(tokens: &[Token]) -> &[Token] {
    match tokens {
        [Token { kind: TokenKind::Word | TokenKind::Number, .. }, Token { kind: TokenKind::Close, .. }, rest @ ..] => {
            rest
        }
        _ => tokens,
    }
}

/// Drops `120` or `N120` before a word.
fn unnumbered<'a>(bytes: &[u8], tokens: &'a [Token]) -> &'a [Token] {
    let [first, second, ..] = tokens else { return tokens };
    let text = &bytes[first.span.range()];
    let numbered = match first.kind {
        TokenKind::Number => true,
        TokenKind::Word => {
            matches!(text, [b'N' | b'n', digits @ ..] if !digits.is_empty() && digits.iter().all(u8::is_ascii_digit))
        }
        _ => false,
    };
    if numbered && second.kind == TokenKind::Word { &tokens[1..] } else { tokens }
}
