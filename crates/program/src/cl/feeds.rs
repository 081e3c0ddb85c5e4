//! Follows the feed in CL data with written motions, and makes the statements that change it.

use super::lex::{Record, TokenKind};
use super::modal::{Feed, INCH_MM, Modal};
use super::statement::Statement;
use crate::{Reason, Target};

/// Feeds that differ by less than this share are equal: digits of the conversion between units.
const SAME: f64 = 1e-9;

/// Follows the feed.
pub(super) struct Feeds<'a> {
    /// The feed of the file.
    modal: Modal,
    mm_per_unit: f64,
    /// The texts before and after the number in the file's last statement.
    form: Option<[&'a [u8]; 2]>,
    /// The feed that is in force in the written file.
    in_force: Feed,
}

impl<'a> Feeds<'a> {
    pub(super) fn new(mm_per_unit: f64) -> Self {
        Self { modal: Modal::default(), mm_per_unit, form: None, in_force: Feed::Unknown }
    }

    /// Adds a feed of the file.
    pub(super) fn add(&mut self, bytes: &'a [u8], record: Record, statement: &Statement<'_>) {
        // A file with a feed that is not understood was refused before.
        if self.modal.read_feed(statement, self.mm_per_unit).is_err() {
            return;
        }
        let Some(number) = statement.items.iter().find(|item| item.kind == TokenKind::Number) else { return };
        let (all, number) = (record.span.range(), number.span.range());
        // Without a sequence number or a label, which occur once.
        let word = bytes[all.clone()].windows(statement.major.len()).position(|word| word == statement.major);
        let start = all.start + word.unwrap_or(0);
        self.form = Some([&bytes[start..number.start], &bytes[number.end..all.end]]);
        self.in_force = self.modal.feed(self.mm_per_unit).0;
    }

    /// The statement that a motion needs before it, in the form and the unit of the file's last one.
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
        let [before, after] = self.form.unwrap_or([b"FEDRAT/", if self.is_in_inches() { b",IPM" } else { b",MMPM" }]);
        Ok(Some([before, short(value).as_bytes(), after].concat()))
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
