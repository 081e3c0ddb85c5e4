//! The statements of a program, with the links between those that belong together.

use super::expression;
use super::lines::Line;
use super::statement::{self, StatementKind};
use std::collections::BTreeMap;

/// The statements of a program with what belongs together.
///
/// # Examples
/// ```
/// use deflex_lang::tp::{Code, lines};
///
/// let text = b"1:R[1]=2 ;\n2:L P[1] 10mm/sec FINE ;\n";
/// let lines = lines::statements(text, 0..text.len());
/// assert_eq!(Code::new(&lines).kinds.len(), 2);
/// ```
#[derive(Debug)]
pub struct Code<'a> {
    /// Their texts.
    pub lines: &'a [Line<'a>],
    /// The kind of each statement.
    pub kinds: Vec<StatementKind<'a>>,
    /// Whether each statement is in a block of point logic, which runs in parallel with the motion before it.
    pub inner: Vec<bool>,
    pub(super) labels: BTreeMap<u32, usize>,
    /// For `IF`, the statement at which the program continues if the condition is false; for `ELSE`, the one after `ENDIF`; for `FOR` its
    /// `ENDFOR` and vice versa; for the cases of a `SELECT`, the one after it.
    pub(super) partner: BTreeMap<usize, usize>,
    /// The first case of the `SELECT`, for each of its cases.
    pub(super) first_case: BTreeMap<usize, usize>,
}

impl<'a> Code<'a> {
    /// Reads statements.
    #[must_use]
    pub fn new(lines: &'a [Line<'a>]) -> Self {
        let kinds: Vec<StatementKind<'a>> = lines.iter().map(statement::kind).collect();
        let (labels, partner, first_case) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        let mut code = Self { lines, inner: inner(lines, &kinds), kinds, labels, partner, first_case };
        code.link();
        code
    }

    /// Links the statements that belong together. A statement without its partner becomes an unknown one.
    fn link(&mut self) {
        let (mut open, mut select): (Vec<(usize, Vec<usize>)>, Option<usize>) = (Vec::new(), None);
        let mut odd = Vec::new();
        for at in 0..self.kinds.len() {
            if self.inner[at] {
                continue;
            }
            match &self.kinds[at] {
                StatementKind::Label(number) => {
                    if let Some(number) = expression::count(number) {
                        self.labels.entry(number).or_insert(at);
                    }
                }
                StatementKind::If(_) | StatementKind::For(..) => open.push((at, Vec::new())),
                StatementKind::Else => match open.last_mut() {
                    Some((first, ends)) if matches!(self.kinds[*first], StatementKind::If(_)) && ends.is_empty() => {
                        ends.push(at);
                    }
                    _ => odd.push(at),
                },
                StatementKind::EndIf | StatementKind::EndFor => {
                    let wanted = matches!(self.kinds[at], StatementKind::EndIf);
                    match open.pop_if(|(first, _)| matches!(self.kinds[*first], StatementKind::If(_)) == wanted) {
                        Some((first, _)) if !wanted => {
                            self.partner.insert(first, at);
                            self.partner.insert(at, first);
                        }
                        Some((first, other)) => {
                            self.partner.insert(first, other.first().map_or(at, |other| other + 1));
                            other.first().and_then(|other| self.partner.insert(*other, at));
                        }
                        None => odd.push(at),
                    }
                }
                _ => {}
            }
            select = match self.kinds[at] {
                StatementKind::SelectCase(..) => Some(at),
                StatementKind::Case(_) | StatementKind::ElseCase(_) if select.is_none() => {
                    odd.push(at);
                    None
                }
                StatementKind::Case(_) | StatementKind::ElseCase(_) => select,
                _ => None,
            };
            if let Some(first) = select {
                self.first_case.insert(at, first);
                // The last of them says where it goes on.
                for case in first..=at {
                    self.partner.insert(case, at + 1);
                }
            }
        }
        for at in odd.into_iter().chain(open.into_iter().map(|(first, _)| first)) {
            self.kinds[at] = StatementKind::Unknown;
        }
    }
}

/// Which statements are in blocks of point logic: from a motion that announces one up to a line of dashes.
fn inner(lines: &[Line<'_>], kinds: &[StatementKind<'_>]) -> Vec<bool> {
    let mut within = false;
    let one = |(line, kind): (&Line<'_>, &StatementKind<'_>)| {
        let was = within;
        within = match kind {
            StatementKind::Motion(motion) if !within => motion.point_logic,
            _ => within && !line.text.starts_with(b"---"),
        };
        was
    };
    lines.iter().zip(kinds).map(one).collect()
}
