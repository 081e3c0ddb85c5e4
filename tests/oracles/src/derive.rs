//! Random texts of a grammar.

use crate::notation::{Expr, Grammar, Id};
use crate::recognise::Recogniser;

/// More parts than this of a repetition are not derived.
const MOST: u64 = 3;

/// How often a part is derived anew that is what it must not be.
const TRIES: usize = 100;

/// Derives texts from a grammar.
#[derive(Debug)]
pub struct Deriver<'g> {
    grammar: &'g Grammar,
    /// Least number of rules within one another that an expression takes.
    depths: Vec<usize>,
    state: u64,
    text: Vec<u8>,
}

impl<'g> Deriver<'g> {
    /// The same seed derives the same texts.
    pub fn new(grammar: &'g Grammar, seed: u64) -> Self {
        let mut depths = vec![usize::MAX; grammar.exprs.len()];
        // Until nothing gets less: as often as rules can stand within one another.
        loop {
            let before = depths.clone();
            for id in 0..depths.len() {
                let of = |id: &Id| depths[*id];
                depths[id] = match &grammar.exprs[id] {
                    Expr::Text(_) | Expr::Range(..) | Expr::Optional(_) | Expr::Repeat(_) => 0,
                    Expr::Name(name) => depths[grammar.rules[name].body].saturating_add(1),
                    Expr::Sequence(parts) => parts.iter().map(of).max().unwrap_or(0),
                    Expr::Choice(parts) => parts.iter().map(of).min().unwrap_or(0),
                    Expr::Except(part, _) => of(part),
                };
            }
            if depths == before {
                break;
            }
        }
        Self { grammar, depths, state: seed, text: Vec::new() }
    }

    /// A text of `rule`, of rules at most about `depth` within one another.
    pub fn derive(&mut self, rule: &str, depth: usize) -> Vec<u8> {
        let rule = &self.grammar.rules[rule];
        self.expr(rule.body, depth, rule.lexical);
        std::mem::take(&mut self.text)
    }

    /// SplitMix64 (Steele, Lea and Flood 2014).
    fn random(&mut self, below: u64) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % below
    }

    fn expr(&mut self, id: Id, depth: usize, lexical: bool) {
        let grammar = self.grammar;
        match &grammar.exprs[id] {
            Expr::Text(text) => {
                self.space(lexical);
                self.text.extend_from_slice(text);
            }
            Expr::Range(from, to) => {
                self.space(lexical);
                let byte = u64::from(*from) + self.random(u64::from(to - from) + 1);
                self.text.push(u8::try_from(byte).unwrap());
            }
            Expr::Name(name) => {
                let rule = &grammar.rules[name];
                if rule.lexical {
                    self.space(lexical);
                }
                self.expr(rule.body, depth.saturating_sub(1), rule.lexical);
            }
            Expr::Sequence(parts) => parts.iter().for_each(|part| self.expr(*part, depth, lexical)),
            Expr::Choice(parts) => {
                let least = parts.iter().map(|part| self.depths[*part]).min().unwrap_or(0);
                let open: Vec<Id> =
                    parts.iter().copied().filter(|part| self.depths[*part] <= depth.max(least)).collect();
                let chosen = open[usize::try_from(self.random(open.len() as u64)).unwrap()];
                self.expr(chosen, depth, lexical);
            }
            Expr::Optional(part) => {
                if self.depths[*part] <= depth && self.random(2) == 0 {
                    self.expr(*part, depth, lexical);
                }
            }
            Expr::Repeat(part) => {
                let times = if self.depths[*part] <= depth { self.random(MOST + 1) } else { 0 };
                (0..times).for_each(|_| self.expr(*part, depth, lexical));
            }
            Expr::Except(part, not) => {
                let from = self.text.len();
                for _ in 0..TRIES {
                    self.expr(*part, depth, lexical);
                    if !Recogniser::new(grammar, &self.text[from..]).is(*not, lexical) {
                        return;
                    }
                    self.text.truncate(from);
                }
                panic!("nothing but what it must not be: {:?}", grammar.exprs[*not]);
            }
        }
    }

    /// What stands between two parts of a rule that is not lexical.
    fn space(&mut self, lexical: bool) {
        if lexical {
            return;
        }
        self.text.push(b' ');
        let often = self.random(16) == 0;
        if let Some(rule) = self.grammar.rules.get("space").filter(|_| often) {
            self.expr(rule.body, 3, true);
        }
    }
}
