//! Whether a text is derived by a grammar: all ends that a rule can have from a place, each found once.

use crate::notation::{Expr, Grammar, Id};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// Finds what derives a text.
#[derive(Debug)]
pub struct Recogniser<'g, 't> {
    grammar: &'g Grammar,
    text: &'t [u8],
    known: HashMap<(Id, usize), Rc<BTreeSet<usize>>>,
    /// How far any terminal has reached.
    furthest: usize,
}

/// Where no derivation goes on.
#[derive(Debug)]
pub struct Stopped {
    /// Bytes before it.
    pub at: usize,
}

impl<'g, 't> Recogniser<'g, 't> {
    /// Of a text by a grammar.
    pub fn new(grammar: &'g Grammar, text: &'t [u8]) -> Self {
        Self { grammar, text, known: HashMap::new(), furthest: 0 }
    }

    /// Whether the whole text is one `rule`, with space before and after it.
    pub fn whole(&mut self, rule: &str) -> Result<(), Stopped> {
        let rule = &self.grammar.rules[rule];
        let ends = self.ends(rule.body, 0, rule.lexical);
        let done =
            ends.iter().any(|end| *end == self.text.len() || !rule.lexical && self.space(*end) == self.text.len());
        if done { Ok(()) } else { Err(Stopped { at: self.furthest }) }
    }

    /// Whether the whole text is this expression.
    pub(crate) fn is(&mut self, id: Id, lexical: bool) -> bool {
        self.ends(id, 0, lexical).contains(&self.text.len())
    }

    fn ends(&mut self, id: Id, at: usize, lexical: bool) -> Rc<BTreeSet<usize>> {
        if let Some(known) = self.known.get(&(id, at)) {
            return Rc::clone(known);
        }
        let grammar = self.grammar;
        let ends = Rc::new(match &grammar.exprs[id] {
            Expr::Text(text) => self.text(text, at, lexical).into_iter().collect(),
            Expr::Range(from, to) => {
                let at = if lexical { at } else { self.space(at) };
                let hit = self.text.get(at).is_some_and(|byte| (from..=to).contains(&byte));
                hit.then_some(at + 1).into_iter().collect()
            }
            Expr::Name(name) => {
                let rule = &grammar.rules[name];
                if rule.lexical && !lexical {
                    // A lexeme is as long as it can be.
                    let at = self.space(at);
                    self.ends(rule.body, at, true).last().copied().filter(|end| *end > at).into_iter().collect()
                } else {
                    (*self.ends(rule.body, at, rule.lexical)).clone()
                }
            }
            Expr::Sequence(parts) => {
                let mut ends = BTreeSet::from([at]);
                for part in parts {
                    ends = ends.iter().flat_map(|at| (*self.ends(*part, *at, lexical)).clone()).collect();
                }
                ends
            }
            Expr::Choice(parts) => parts.iter().flat_map(|part| (*self.ends(*part, at, lexical)).clone()).collect(),
            Expr::Optional(part) => {
                let mut ends = (*self.ends(*part, at, lexical)).clone();
                ends.insert(at);
                ends
            }
            Expr::Repeat(part) => {
                let (mut ends, mut open) = (BTreeSet::from([at]), vec![at]);
                while let Some(at) = open.pop() {
                    open.extend(self.ends(*part, at, lexical).iter().filter(|end| ends.insert(**end)));
                }
                ends
            }
            Expr::Except(part, not) => {
                let not: HashSet<usize> = self.ends(*not, at, lexical).iter().copied().collect();
                self.ends(*part, at, lexical).iter().filter(|end| !not.contains(end)).copied().collect()
            }
        });
        self.furthest = ends.last().map_or(self.furthest, |end| self.furthest.max(*end));
        self.known.insert((id, at), Rc::clone(&ends));
        ends
    }

    fn text(&mut self, text: &[u8], at: usize, lexical: bool) -> Option<usize> {
        let at = if lexical { at } else { self.space(at) };
        let end = at + text.len();
        let hit = self.text.get(at..end).is_some_and(|found| found.eq_ignore_ascii_case(text));
        // A word is no part of a longer one.
        let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
        let ends = lexical || !text.last().is_some_and(is_word) || !self.text.get(end).is_some_and(is_word);
        (hit && ends).then_some(end)
    }

    /// The place after the space at a place.
    fn space(&mut self, at: usize) -> usize {
        match self.grammar.rules.get("space") {
            Some(rule) => self.ends(rule.body, at, true).last().copied().unwrap_or(at),
            None => at,
        }
    }
}
