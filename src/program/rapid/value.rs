//! Values known at read time: what an expression comes to, and where its numbers stand.

use super::expr::{Arg, Expr};
use super::module::Symbols;
use crate::text::Span;
use std::collections::BTreeMap;

/// Names bound by a call or a loop.
pub(super) type Scope = BTreeMap<String, Bound>;

/// A bound name: an expression of another place, fully known.
#[derive(Clone, Debug)]
pub(super) struct Bound {
    pub(super) source: usize,
    pub(super) expr: Expr,
}

/// Where to look names up.
pub(super) struct Names<'a> {
    pub(super) symbols: &'a Symbols,
    pub(super) scope: &'a Scope,
}

/// A found literal: its file and its expression, the declared name it came through.
pub(super) struct Found<'a> {
    pub(super) source: usize,
    pub(super) expr: &'a Expr,
    pub(super) name: Option<&'a str>,
}

/// Names refer to names at most this often.
const HOPS: usize = 16;

impl<'a> Names<'a> {
    /// Follows names and array elements to the literal behind an expression.
    ///
    /// # Errors
    /// The reason why it is not known, for the report.
    pub(super) fn follow(&self, source: usize, expr: &'a Expr) -> Result<Found<'a>, &'static str> {
        self.follow_from(source, expr, None, HOPS)
    }

    fn follow_from(
        &self,
        source: usize,
        expr: &'a Expr,
        through: Option<&'a str>,
        hops: usize,
    ) -> Result<Found<'a>, &'static str> {
        let Expr::Name { name, indices, .. } = expr else { return Ok(Found { source, expr, name: through }) };
        if hops == 0 {
            return Err("names refer to each other in a circle");
        }
        if let Some(bound) = self.scope.get(name) {
            return self.element(bound.source, &bound.expr, indices, through, hops);
        }
        let Some(datum) = self.symbols.data.get(name) else { return Err("target not declared here") };
        if self.symbols.assigned.contains(name) {
            return Err("target computed at run time");
        }
        let Some(value) = &datum.value else { return Err("target has no initial value") };
        self.element(datum.source, value, indices, Some(&datum.name), hops)
    }

    fn element(
        &self,
        source: usize,
        mut expr: &'a Expr,
        indices: &'a [Expr],
        through: Option<&'a str>,
        hops: usize,
    ) -> Result<Found<'a>, &'static str> {
        for index in indices {
            let index = self.number(index).ok_or("array index computed at run time")?;
            let Expr::List(items) = expr else { return Err("an index on something that is no array") };
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let at = index.round().max(0.0) as usize;
            expr = at.checked_sub(1).and_then(|at| items.get(at)).ok_or("array index out of range")?;
        }
        self.follow_from(source, expr, through, hops - 1)
    }

    /// A number, where every part is known.
    pub(super) fn number(&self, expr: &Expr) -> Option<f64> {
        match expr {
            Expr::Number { value, .. } => Some(*value),
            Expr::Binary(a, op, b) => {
                let (a, b) = (self.number(a)?, self.number(b)?);
                let value = match op {
                    b'+' => a + b,
                    b'-' => a - b,
                    b'*' => a * b,
                    _ => a / b,
                };
                value.is_finite().then_some(value)
            }
            Expr::Name { name, indices, .. } => {
                let bound = self.scope.get(name).map(|b| &b.expr).filter(|_| indices.is_empty());
                if let Some(bound) = bound {
                    return self.number(bound);
                }
                let datum = self.symbols.data.get(name).filter(|_| !self.symbols.assigned.contains(name))?;
                let mut value = datum.value.as_ref()?;
                for index in indices {
                    let Expr::List(items) = value else { return None };
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    let at = self.number(index)?.round().max(0.0) as usize;
                    value = items.get(at.checked_sub(1)?)?;
                }
                self.number(value)
            }
            _ => None,
        }
    }

    /// `N` numbers of a list.
    pub(super) fn numbers<const N: usize>(&self, expr: &Expr) -> Option<[f64; N]> {
        let Expr::List(items) = expr else { return None };
        let mut out = [0.0; N];
        if items.len() != N {
            return None;
        }
        for (out, item) in out.iter_mut().zip(items) {
            *out = self.number(item)?;
        }
        Some(out)
    }
}

/// Spans of `N` number tokens of a list, where all are literals.
pub(super) fn tokens<const N: usize>(expr: &Expr) -> Option<[Span; N]> {
    let Expr::List(items) = expr else { return None };
    let mut out = [Span::default(); N];
    if items.len() != N {
        return None;
    }
    for (out, item) in out.iter_mut().zip(items) {
        let Expr::Number { token: Some(token), .. } = item else { return None };
        *out = *token;
    }
    Some(out)
}

/// Positional arguments.
pub(super) fn positional(args: &[Arg]) -> impl Iterator<Item = &Arg> {
    args.iter().filter(|arg| arg.option.is_none())
}

/// An optional argument.
pub(super) fn option<'a>(args: &'a [Arg], name: &str) -> Option<&'a Arg> {
    args.iter().find(|arg| arg.option.as_deref() == Some(name))
}
