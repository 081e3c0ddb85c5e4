//! Lines that differ from another in digits alone: all bytes are compared at once, and all digits read at once.

use super::literal::{Literal, POSE};
use crate::lanes::widest;
use crate::text::number::{MOST_DIGITS, Runs};

/// Bytes that are compared side by side.
const CHUNK: usize = 64;

/// Most chunks of a line; a longer one is not compared at once.
const CHUNKS: usize = 4;

/// A line: which bytes others have to have at each place to be like it.
pub(super) struct Shape {
    /// The least byte, and how much more another may have.
    least: [[u8; CHUNK]; CHUNKS],
    more: [[u8; CHUNK]; CHUNKS],
    /// Chunks that the line reaches into.
    chunks: usize,
    /// Where the digits of each number end: before its point, and behind it.
    ends: [[usize; 8]; 2],
    runs: Runs,
}

impl Shape {
    /// The line, given where its literal begins; `None` where the pose has numbers of other forms than the usual ones.
    pub(super) fn new(line: &[u8], literal_at: usize, literal: &Literal) -> Option<Self> {
        if line.len() > CHUNK * CHUNKS {
            return None;
        }
        let mut shape = Self {
            least: [[0; CHUNK]; CHUNKS],
            more: [[u8::MAX; CHUNK]; CHUNKS],
            chunks: line.len().div_ceil(CHUNK),
            ends: [[8; 8]; 2],
            runs: Runs::new(),
        };
        shape.least.as_flattened_mut()[..line.len()].copy_from_slice(line);
        shape.more.as_flattened_mut()[..line.len()].fill(0);
        for k in 0..POSE {
            let token = literal.token(k).range();
            let at = literal_at + token.start - literal.span().range().start;
            let (end, decimals) = (at + token.len(), literal.decimals(k)?);
            let negative = *line.get(at)? == b'-';
            let first = at + usize::from(negative);
            let point = if decimals > 0 { end - decimals - 1 } else { end };
            let whole = point.checked_sub(first)?;
            // Eight bytes are read up to the end of each run.
            if point < 8 || whole + decimals > MOST_DIGITS || !shape.runs.set(k, negative, whole, decimals) {
                return None;
            }
            (shape.ends[0][k], shape.ends[1][k]) = (point, end);
            for digits in [first..point, end - decimals..end] {
                shape.least.as_flattened_mut().get_mut(digits.clone())?.fill(b'0');
                shape.more.as_flattened_mut().get_mut(digits)?.fill(9);
            }
            if whole > 1 {
                // A zero before the others is not among the usual forms.
                shape.least.as_flattened_mut()[first] = b'1';
                shape.more.as_flattened_mut()[first] = 8;
            }
        }
        Some(shape)
    }

    /// The pose of a line like this one at the beginning of a text; `None` where there is none, or too little text behind it
    /// to see that.
    pub(super) fn read(&self, text: &[u8]) -> Option<[f64; POSE]> {
        let (chunks, _) = text.as_chunks::<CHUNK>();
        let chunks = chunks.get(..self.chunks)?;
        let mut digits = [[0; 8]; 2];
        for (digits, ends) in digits.iter_mut().zip(&self.ends) {
            for k in 0..POSE {
                digits[k] = u64::from_le_bytes(*text.get(..ends[k])?.last_chunk()?);
            }
        }
        let (mut values, mut odd) = ([0.0; 8], true);
        widest!(<'a>(
            shape: &'a Shape = self,
            chunks: &'a [[u8; CHUNK]] = chunks,
            digits: &'a [[u64; 8]; 2] = &digits,
            values: &'a mut [f64; 8] = &mut values,
            odd: &'a mut bool = &mut odd,
        ) {
            *values = shape.runs.read(digits);
            // A zero with a minus is not among the usual forms.
            let zeros = values.iter().fold(0, |any, value| any | u64::from(value.to_bits() == (-0.0_f64).to_bits()));
            *odd = (shape.others(chunks) != 0) | (zeros != 0);
        });
        let [pose @ .., _] = values;
        (!odd).then_some(pose)
    }

    /// Zero where all bytes are such as they may be.
    #[inline(always)]
    fn others(&self, chunks: &[[u8; CHUNK]]) -> u8 {
        let mut others = [0; CHUNK];
        for ((chunk, least), more) in chunks.iter().zip(&self.least).zip(&self.more) {
            for i in 0..CHUNK {
                others[i] |= chunk[i].wrapping_sub(least[i]).saturating_sub(more[i]);
            }
        }
        others.iter().fold(0, |any, one| any | one)
    }
}
