//! Runs of digits whose lengths are known: eight numbers at once.

use super::TENS;
use super::write::{INTEGERS, ZEROS};

/// Where digits stand in eight numbers: those before the point and those after it are runs of their own.
pub(crate) struct Runs {
    /// Of eight bytes, the last of which is the run's last digit, those that are digits of it.
    own: [[u64; 8]; 2],
    /// 10^decimals.
    tens: [f64; 8],
    /// The sign bit where there is a minus.
    minus: [u64; 8],
}

impl Runs {
    /// Numbers without digits.
    pub(crate) fn new() -> Self {
        Self { own: [[0; 8]; 2], tens: [1.0; 8], minus: [0; 8] }
    }

    /// Says how many digits a number has; false where they are too many, or none before the point.
    pub(crate) fn set(&mut self, i: usize, negative: bool, whole: usize, decimals: usize) -> bool {
        let own = |digits: usize| u64::MAX.unbounded_shl(64 - 8 * digits as u32);
        if !(1..=8).contains(&whole) || decimals > 8 {
            return false;
        }
        (self.own[0][i], self.own[1][i]) = (own(whole), own(decimals));
        self.tens[i] = TENS[decimals];
        self.minus[i] = u64::from(negative) << 63;
        true
    }

    /// The numbers, exactly rounded, given the eight bytes up to the end of each run, the first the lowest. What is no digit
    /// gives any number.
    #[inline(always)]
    pub(crate) fn read(&self, text: &[[u64; 8]; 2]) -> [f64; 8] {
        let mut values = [0.0; 8];
        for i in 0..8 {
            let whole = number((text[0][i] ^ ZEROS) & self.own[0][i]);
            let part = number((text[1][i] ^ ZEROS) & self.own[1][i]);
            // Both are whole numbers below 10^8 and their sum is one of at most 15 digits: nothing is rounded but at last.
            let value = (whole * self.tens[i] + part) / self.tens[i];
            values[i] = f64::from_bits(value.to_bits() | self.minus[i]);
        }
        values
    }
}

/// The number that eight digits are, the first the lowest.
#[inline(always)]
fn number(digits: u64) -> f64 {
    // Ones and tens, pairs, fours are joined at once.
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8) & 0x00FF_00FF_00FF_00FF;
    let fours = pairs.wrapping_mul(100).wrapping_add(pairs >> 16) & 0x0000_FFFF_0000_FFFF;
    let eight = 10_000 * (fours & 0xFFFF) + (fours >> 32);
    f64::from_bits(eight | INTEGERS.to_bits()) - INTEGERS
}
