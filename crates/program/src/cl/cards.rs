//! Punched-card images: 80 columns, of which 73 to 80 are the card's number.

/// Significant columns of a card.
const COLUMNS: usize = 72;
/// All columns of a card.
const CARD: usize = 80;
/// Least number of lines from which the layout follows.
const FEWEST_LINES: usize = 3;

/// Whether a file is a deck of cards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cards(bool);

impl Cards {
    /// Whether a file is a deck: every line that is not empty has 80 columns and a number at the end of the last eight. Modern lines have any
    /// length, also more than 72 columns.
    pub(super) fn detect(bytes: &[u8]) -> Self {
        Self(!Self::excluded(bytes) && lines(bytes).take(FEWEST_LINES).count() == FEWEST_LINES)
    }

    /// Whether a line is no card, so that the file is no deck.
    pub(super) fn excluded(bytes: &[u8]) -> bool {
        lines(bytes).any(|line| !is_card(line))
    }

    pub(super) fn is_cards(self) -> bool {
        self.0
    }

    /// End of the significant columns of the line that has `at` and ends at `end`.
    pub(super) fn significant_end(self, bytes: &[u8], at: usize, end: usize) -> usize {
        let start = bytes[..at].iter().rposition(|b| matches!(b, b'\n' | b'\r')).map_or(0, |p| p + 1);
        end.min(start + COLUMNS).max(at)
    }
}

/// Lines that are not empty.
fn lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split(|b| matches!(b, b'\n' | b'\r')).filter(|line| !line.is_empty())
}

fn is_card(line: &[u8]) -> bool {
    line.len() == CARD
        && line[CARD - 1].is_ascii_digit()
        && line[COLUMNS..].iter().all(|b| b.is_ascii_alphanumeric() || *b == b' ')
}
