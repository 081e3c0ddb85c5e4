//! Lines that differ from another in digits alone: all bytes are compared at once, and all digits read at once.

use super::literal::{Literal, POSE};
use crate::lanes::widest;
use crate::text::number::{MOST_DIGITS, Runs};

/// Most bytes of a line; a longer one is not compared at once.
const ROOM: usize = 256;

/// Bytes that are compared side by side.
const CHUNK: usize = 64;

/// Eight bytes begin before the end of a line.
const WINDOW: usize = ROOM + 8;

/// A line: which bytes others have to have at each place to be like it.
pub(super) struct Shape {
    /// The least byte, and how much more another may have.
    least: [u8; ROOM],
    more: [u8; ROOM],
    /// Where the eight bytes begin that end with the digits of each number: before its point, and behind it.
    starts: [[u8; 8]; 2],
    runs: Runs,
}

impl Shape {
    /// The line, given where its literal begins; `None` where the pose has numbers of other forms than the usual ones.
    pub(super) fn new(line: &[u8], literal_at: usize, literal: &Literal) -> Option<Self> {
        let mut shape = Self { least: [0; ROOM], more: [u8::MAX; ROOM], starts: [[0; 8]; 2], runs: Runs::new() };
        shape.least.get_mut(..line.len())?.copy_from_slice(line);
        shape.more[..line.len()].fill(0);
        for k in 0..POSE {
            let token = literal.token(k).range();
            let at = literal_at + token.start - literal.span().range().start;
            let (end, decimals) = (at + token.len(), literal.decimals(k)?);
            let negative = *line.get(at)? == b'-';
            let first = at + usize::from(negative);
            let point = if decimals > 0 { end - decimals - 1 } else { end };
            let whole = point.checked_sub(first)?;
            if whole + decimals > MOST_DIGITS || !shape.runs.set(k, negative, whole, decimals) {
                return None;
            }
            for (starts, end) in shape.starts.iter_mut().zip([point, end]) {
                starts[k] = u8::try_from(end.checked_sub(8)?).ok()?;
            }
            for digits in [first..point, end - decimals..end] {
                shape.least.get_mut(digits.clone())?.fill(b'0');
                shape.more.get_mut(digits)?.fill(9);
            }
            if whole > 1 {
                // A zero before the others is not among the usual forms.
                (shape.least[first], shape.more[first]) = (b'1', 8);
            }
        }
        Some(shape)
    }

    /// The pose of a line like this one at the beginning of a text; `None` where there is none, or too little text behind it
    /// to see that.
    pub(super) fn read(&self, text: &[u8]) -> Option<[f64; POSE]> {
        let text = text.first_chunk::<WINDOW>()?;
        let mut digits = [[0; 8]; 2];
        for (digits, starts) in digits.iter_mut().zip(&self.starts) {
            for k in 0..POSE {
                let Some(eight) = text[usize::from(starts[k])..].first_chunk() else { return None };
                digits[k] = u64::from_le_bytes(*eight);
            }
        }
        let (mut values, mut odd) = ([0.0; 8], true);
        widest!(<'a>(
            shape: &'a Shape = self,
            text: &'a [u8; WINDOW] = text,
            digits: &'a [[u64; 8]; 2] = &digits,
            values: &'a mut [f64; 8] = &mut values,
            odd: &'a mut bool = &mut odd,
        ) {
            *values = shape.runs.read(digits);
            // A zero with a minus is not among the usual forms.
            let zeros = values.iter().fold(0, |any, value| any | u64::from(value.to_bits() == (-0.0_f64).to_bits()));
            *odd = shape.has_others(text) | (zeros != 0);
        });
        let [pose @ .., _] = values;
        (!odd).then_some(pose)
    }

    /// Whether any byte is not such as it may be.
    #[inline(always)]
    fn has_others(&self, text: &[u8; WINDOW]) -> bool {
        let over = |i: usize| text[i].wrapping_sub(self.least[i]).saturating_sub(self.more[i]);
        let mut any = [0; CHUNK];
        for i in 0..CHUNK {
            any[i] = over(i) | over(i + CHUNK) | over(i + 2 * CHUNK) | over(i + 3 * CHUNK);
        }
        let mut eight = [0; 8];
        for i in 0..8 {
            eight[i] =
                any[i] | any[i + 8] | any[i + 16] | any[i + 24] | any[i + 32] | any[i + 40] | any[i + 48] | any[i + 56];
        }
        u64::from_le_bytes(eight) != 0
    }
}
