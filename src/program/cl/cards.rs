//! Punched-card images: 80 columns, of which 73 to 80 are the card's number.

/// Significant columns of a card.
const COLUMNS: usize = 72;
/// All columns of a card.
const CARD: usize = 80;
/// Fewer lines than this prove nothing about a layout.
const FEWEST_LINES: usize = 3;

/// Whether a file is a deck of cards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cards(bool);

impl Cards {
    /// A deck: every line that is not empty has 80 columns and a number at the end of the last eight.
    /// Modern lines are of any length, and longer than 72 columns without meaning anything by it.
    pub(super) fn detect(bytes: &[u8]) -> Self {
        let mut lines = 0;
        for line in bytes.split(|b| matches!(b, b'\n' | b'\r')).filter(|l| !l.is_empty()) {
            let numbered = line.len() == CARD
                && line[CARD - 1].is_ascii_digit()
                && line[COLUMNS..].iter().all(|b| b.is_ascii_alphanumeric() || *b == b' ');
            if !numbered {
                return Self(false);
            }
            lines += 1;
        }
        Self(lines >= FEWEST_LINES)
    }

    pub(super) fn is_cards(self) -> bool {
        self.0
    }

    /// Where the significant columns end of the line that holds `at` and ends at `end`.
    pub(super) fn significant_end(self, bytes: &[u8], at: usize, end: usize) -> usize {
        let start = bytes[..at].iter().rposition(|b| matches!(b, b'\n' | b'\r')).map_or(0, |p| p + 1);
        end.min(start + COLUMNS).max(at)
    }
}
