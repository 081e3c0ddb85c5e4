//! Reads runs of digits of known length, eight numbers at once.

use super::TENS;
use super::write::{INTEGERS, ZEROS};

/// The positions of the digits of eight numbers. Each number has a run before the point and a run after it.
#[doc(hidden)]
pub struct Runs {
    /// Mask of the bytes that are digits of a run, in the eight bytes of which the last is the run's last digit.
    own: [[u64; 8]; 2],
    /// 10^decimals.
    tens: [f64; 8],
    /// The sign bit of negative numbers.
    minus: [u64; 8],
}

impl Default for Runs {
    /// Eight numbers without digits.
    fn default() -> Self {
        Self { own: [[0; 8]; 2], tens: [1.0; 8], minus: [0; 8] }
    }
}

impl Runs {
    /// Sets the numbers of digits of a number. Returns false if there are too many, or none before the point.
    pub fn set(&mut self, i: usize, negative: bool, whole: usize, decimals: usize) -> bool {
        let own = |digits: usize| u64::MAX.unbounded_shl(64 - 8 * digits as u32);
        if !(1..=8).contains(&whole) || decimals > 8 {
            return false;
        }
        (self.own[0][i], self.own[1][i]) = (own(whole), own(decimals));
        self.tens[i] = TENS[decimals];
        self.minus[i] = u64::from(negative) << 63;
        true
    }

    /// The numbers, correctly rounded, given the eight bytes up to the end of each run. The first byte is the lowest.
    /// Bytes other than digits give arbitrary numbers.
    #[inline(always)]
    pub fn read(&self, text: &[[u64; 8]; 2]) -> [f64; 8] {
        let mut values = [0.0; 8];
        for i in 0..8 {
            let whole = number((text[0][i] ^ ZEROS) & self.own[0][i]);
            let part = number((text[1][i] ^ ZEROS) & self.own[1][i]);
            // Both are whole numbers below 10^8, and their sum has at most 15 digits. Only the division rounds.
            let value = (whole * self.tens[i] + part) / self.tens[i];
            values[i] = f64::from_bits(value.to_bits() | self.minus[i]);
        }
        values
    }
}

/// The number of eight digits. The first digit is the lowest byte.
#[inline(always)]
fn number(digits: u64) -> f64 {
    // Ones and tens, then pairs, then fours are joined in parallel.
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8) & 0x00FF_00FF_00FF_00FF;
    let fours = pairs.wrapping_mul(100).wrapping_add(pairs >> 16) & 0x0000_FFFF_0000_FFFF;
    let eight = 10_000 * (fours & 0xFFFF) + (fours >> 32);
    f64::from_bits(eight | INTEGERS.to_bits()) - INTEGERS
}
