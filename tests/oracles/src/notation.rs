//! The notation that the grammars are written in, read with nom.
//!
//! `name = … ;` is a rule; `|` parts alternatives, `[ ]` is optional, `{ }` any number of times, `a - b` is `a` that is not `b`;
//! a text in quotes stands for itself, letters in any case; `#x41` is a byte, `a … b` the bytes from one to the other. In the
//! rules of a section `---- lex.rs` nothing stands between the parts; in all others `space` may.

use nom::branch::alt;
use nom::bytes::complete::{tag, take_till, take_until, take_while, take_while1};
use nom::character::complete::{char, multispace1};
use nom::combinator::{all_consuming, map, map_res, opt, value};
use nom::multi::{many0, many1, separated_list1};
use nom::sequence::{delimited, preceded, terminated};
use nom::{IResult, Parser};
use std::collections::BTreeMap;

/// Index of an expression of a [`Grammar`].
pub(crate) type Id = usize;

#[derive(Debug)]
pub(crate) enum Expr {
    /// Letters in any case.
    Text(Vec<u8>),
    /// A byte from one to another.
    Range(u8, u8),
    Name(String),
    Sequence(Vec<Id>),
    Choice(Vec<Id>),
    Optional(Id),
    Repeat(Id),
    Except(Id, Id),
}

/// A rule of a grammar.
#[derive(Debug)]
pub struct Rule {
    pub(crate) body: Id,
    /// Files that the section names.
    pub files: Vec<String>,
    /// Nothing stands between its parts.
    pub lexical: bool,
}

/// A grammar in its notation.
#[derive(Debug, Default)]
pub struct Grammar {
    /// By their names.
    pub rules: BTreeMap<String, Rule>,
    pub(crate) exprs: Vec<Expr>,
}

enum Tree {
    Leaf(Expr),
    Sequence(Vec<Tree>),
    Choice(Vec<Tree>),
    Optional(Box<Tree>),
    Repeat(Box<Tree>),
    Except(Box<Tree>, Box<Tree>),
}

enum Item<'a> {
    Section(&'a str),
    Rule(&'a str, Tree),
}

impl Grammar {
    /// Reads a grammar.
    pub fn read(text: &str) -> Self {
        let (_, items) = all_consuming(terminated(many0(item), opt(blank))).parse(text).unwrap();
        let mut grammar = Self::default();
        let mut files = Vec::new();
        for item in items {
            match item {
                Item::Section(head) => {
                    let names = head.split(['-', ' ', ',', ':']).filter(|word| word.ends_with(".rs"));
                    let named: Vec<String> = names.map(str::to_owned).collect();
                    files = if named.is_empty() { files } else { named };
                }
                Item::Rule(name, body) => {
                    let body = grammar.add(body);
                    let lexical = files.iter().any(|file| file == "lex.rs");
                    let before = grammar.rules.insert(name.to_owned(), Rule { body, files: files.clone(), lexical });
                    assert!(before.is_none(), "two rules {name}");
                }
            }
        }
        for expr in &grammar.exprs {
            if let Expr::Name(name) = expr {
                assert!(grammar.rules.contains_key(name), "no rule {name}");
            }
        }
        grammar
    }

    fn add(&mut self, tree: Tree) -> Id {
        let expr = match tree {
            Tree::Leaf(expr) => expr,
            Tree::Sequence(parts) => Expr::Sequence(parts.into_iter().map(|part| self.add(part)).collect()),
            Tree::Choice(parts) => Expr::Choice(parts.into_iter().map(|part| self.add(part)).collect()),
            Tree::Optional(part) => Expr::Optional(self.add(*part)),
            Tree::Repeat(part) => Expr::Repeat(self.add(*part)),
            Tree::Except(part, not) => Expr::Except(self.add(*part), self.add(*not)),
        };
        self.exprs.push(expr);
        self.exprs.len() - 1
    }
}

fn comment(text: &str) -> IResult<&str, &str> {
    delimited(tag("(*"), take_until("*)"), tag("*)")).parse(text)
}

/// Blanks and comments, but for heads of sections.
fn blank(text: &str) -> IResult<&str, ()> {
    let plain = |text| {
        let (rest, inner) = comment(text)?;
        if inner.contains("----") {
            return Err(nom::Err::Error(nom::error::Error::new(text, nom::error::ErrorKind::Not)));
        }
        Ok((rest, ()))
    };
    value((), many0(alt((value((), multispace1), plain)))).parse(text)
}

fn token<'a, O>(
    inner: impl Parser<&'a str, Output = O, Error = nom::error::Error<&'a str>>,
) -> impl Parser<&'a str, Output = O, Error = nom::error::Error<&'a str>> {
    terminated(inner, blank)
}

fn item(text: &str) -> IResult<&str, Item<'_>> {
    let section = map(comment, Item::Section);
    let rule = map((token(name), token(char('=')), choice, char(';')), |(name, _, body, _)| Item::Rule(name, body));
    preceded(blank, alt((section, rule))).parse(text)
}

fn name(text: &str) -> IResult<&str, &str> {
    take_while1(|c: char| c.is_ascii_lowercase() || c == '_').parse(text)
}

fn byte(text: &str) -> IResult<&str, u8> {
    let hex =
        map_res(preceded(tag("#x"), take_while(|c: char| c.is_ascii_hexdigit())), |hex| u8::from_str_radix(hex, 16));
    let one = map_res(quoted, |text| <[u8; 1]>::try_from(text.as_bytes()).map(|[byte]| byte));
    alt((hex, one)).parse(text)
}

fn quoted(text: &str) -> IResult<&str, &str> {
    let between = |quote| delimited(char(quote), take_till(move |c| c == quote), char(quote));
    alt((between('"'), between('\''))).parse(text)
}

fn choice(text: &str) -> IResult<&str, Tree> {
    map(separated_list1(token(char('|')), sequence), |mut parts| match parts.len() {
        1 => parts.remove(0),
        _ => Tree::Choice(parts),
    })
    .parse(text)
}

fn sequence(text: &str) -> IResult<&str, Tree> {
    map(many1(factor), |mut parts| match parts.len() {
        1 => parts.remove(0),
        _ => Tree::Sequence(parts),
    })
    .parse(text)
}

fn factor(text: &str) -> IResult<&str, Tree> {
    let except = (primary, opt(preceded(token(char('-')), primary)));
    map(except, |(part, not)| match not {
        Some(not) => Tree::Except(Box::new(part), Box::new(not)),
        None => part,
    })
    .parse(text)
}

fn primary(text: &str) -> IResult<&str, Tree> {
    let range = map((token(byte), token(char('…')), byte), |(from, _, to)| Tree::Leaf(Expr::Range(from, to)));
    let hex = preceded(nom::combinator::peek(char('#')), map(byte, |byte| Tree::Leaf(Expr::Range(byte, byte))));
    let word = map(quoted, |text| Tree::Leaf(Expr::Text(text.as_bytes().to_vec())));
    let name = map(name, |name| Tree::Leaf(Expr::Name(name.to_owned())));
    let optional = map(delimited(token(char('[')), choice, char(']')), |part| Tree::Optional(Box::new(part)));
    let repeat = map(delimited(token(char('{')), choice, char('}')), |part| Tree::Repeat(Box::new(part)));
    let group = delimited(token(char('(')), choice, char(')'));
    token(alt((range, hex, word, name, optional, repeat, group))).parse(text)
}
