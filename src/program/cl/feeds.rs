//! The feed in force in CL data that are written with moves of their own, and the statements that change it.

use super::lex::{Record, TokenKind};
use super::modal::{Feed, INCH_MM, Modal};
use super::statement::Statement;
use crate::program::{Reason, Target};

/// Feeds this close, as a part of them, are one: digits of conversion between units.
const SAME: f64 = 1e-9;

/// Follows the feed.
pub(super) struct Feeds<'a> {
    /// As the file says it.
    modal: Modal,
    mm_per_unit: f64,
    /// What the file's last statement has before and after its number.
    form: Option<[&'a [u8]; 2]>,
    /// As written.
    in_force: Feed,
}

impl<'a> Feeds<'a> {
    pub(super) fn new(mm_per_unit: f64) -> Self {
        Self { modal: Modal::default(), mm_per_unit, form: None, in_force: Feed::Unknown }
    }

    /// A feed that the file says.
    pub(super) fn say(&mut self, bytes: &'a [u8], record: Record, statement: &Statement<'_>) {
        // What is not understood refuses the file before this.
        if self.modal.read_feed(statement, self.mm_per_unit).is_err() {
            return;
        }
        let Some(number) = statement.items.iter().find(|item| item.kind == TokenKind::Number) else { return };
        let (all, number) = (record.span.range(), number.span.range());
        // Without a sequence number or a label: there is one of each.
        let word = bytes[all.clone()].windows(statement.major.len()).position(|word| word == statement.major);
        let start = all.start + word.unwrap_or(0);
        self.form = Some([&bytes[start..number.start], &bytes[number.end..all.end]]);
        self.in_force = self.modal.feed(self.mm_per_unit).0;
    }

    /// The statement that a move needs before it, in the form and the unit of the file's last.
    pub(super) fn before(&mut self, target: &Target) -> Result<Option<Vec<u8>>, Reason> {
        if target.rapid {
            return Ok(None);
        }
        let (now, rpm) = (self.in_force.mm_s(target.spindle_rpm), target.spindle_rpm);
        let Some(wanted) = target.feed_mm_s else {
            return match now {
                None => Ok(None),
                Some(_) => Err(Reason::FeedAfterCycle),
            };
        };
        if now.is_some_and(|now| (now - wanted).abs() <= SAME * wanted) {
            return Ok(None);
        }
        let unit = self.modal.feed(self.mm_per_unit).1;
        let value = unit.value(wanted, rpm).ok_or(Reason::CycleFeedNeedsSpindle)?;
        self.in_force = unit.feed(value);
        let [before, behind] = self.form.unwrap_or([b"FEDRAT/", if self.is_in_inches() { b",IPM" } else { b",MMPM" }]);
        Ok(Some([before, short(value).as_bytes(), behind].concat()))
    }

    fn is_in_inches(&self) -> bool {
        (self.mm_per_unit - INCH_MM).abs() <= 0.0
    }
}

/// A number to six decimals at most, with one at least.
pub(super) fn short(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0');
    if text.ends_with('.') { format!("{text}0") } else { text.to_owned() }
}
