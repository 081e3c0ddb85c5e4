//! Converts values to number tokens with a fixed number of decimals.

use super::{MOST_DECIMALS, TENS, WHOLE_TENS};

/// Appends `value` with exactly `decimals` digits after the point, rounded half to even on the
/// exact binary value, and never a negative zero.
#[doc(hidden)]
pub fn write_fixed(out: &mut Vec<u8>, value: f64, decimals: usize) {
    match Fixed::of(value, decimals) {
        Some(fixed) => fixed.write(out),
        None => write_fixed_plain(out, value, decimals),
    }
}

/// The text of [`write_fixed`].
#[must_use]
#[doc(hidden)]
pub fn fixed(value: f64, decimals: usize) -> String {
    let mut text = Vec::new();
    write_fixed(&mut text, value, decimals);
    String::from_utf8_lossy(&text).into_owned()
}

/// The reference for [`write_fixed`].
pub(crate) fn write_fixed_plain(out: &mut Vec<u8>, value: f64, decimals: usize) {
    use std::io::Write;
    let start = out.len();
    // Writing to a Vec cannot fail.
    let _ = write!(out, "{value:.decimals$}");
    if out[start] == b'-' && out[start + 1..].iter().all(|b| matches!(b, b'0' | b'.')) {
        out.remove(start);
    }
}

/// The value that a reader gets from a value printed with this number of decimals.
#[must_use]
#[doc(hidden)]
pub fn printed(value: f64, decimals: usize) -> f64 {
    Fixed::of(value, decimals).and_then(Fixed::value).unwrap_or_else(|| {
        let mut text = Vec::new();
        write_fixed_plain(&mut text, value, decimals);
        super::read(&text).unwrap_or(value)
    })
}

/// Appends a whole number.
#[doc(hidden)]
pub fn write_whole(out: &mut Vec<u8>, value: u32) {
    let place = room(out);
    let (high, low) = (u64::from(value) / EIGHT_DIGITS, u64::from(value) % EIGHT_DIGITS);
    let len = if high == 0 {
        put_whole(low, place)
    } else {
        // There are at most two more digits.
        let [tens, ones] = pair(high);
        let mut at = 0;
        for digit in [tens, ones].into_iter().skip(usize::from(tens == b'0')) {
            place[at] = digit;
            at += 1;
        }
        place[at..at + 8].copy_from_slice(&eight(low).to_le_bytes());
        at + 8
    };
    give_back(out, len);
}

/// A number as [`write_fixed`] prints it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[doc(hidden)]
pub struct Fixed {
    negative: bool,
    digits: u64,
    decimals: usize,
}

impl Fixed {
    /// `value` with this number of decimals; `None` for values that do not occur in programs.
    #[must_use]
    #[inline]
    pub fn of(value: f64, decimals: usize) -> Option<Self> {
        let digits = scaled_soon(value, decimals).or_else(|| scaled(value, decimals))?;
        Some(Self { negative: value < 0.0 && digits != 0, digits, decimals })
    }

    /// The value that a reader of the digits gets, correctly rounded; `None` if there are too many digits for a single
    /// division.
    #[must_use]
    #[inline]
    pub fn value(self) -> Option<f64> {
        const EXACT: u64 = 1 << 53;
        #[allow(clippy::cast_precision_loss)] // below 2^53
        let value = (self.digits < EXACT).then(|| self.digits as f64 / TENS[self.decimals])?;
        Some(if self.negative { -value } else { value })
    }

    /// Appends the digits.
    pub(crate) fn write(self, out: &mut Vec<u8>) {
        let len = self.put(room(out));
        give_back(out, len);
    }

    /// Largest length: a sign, 20 digits and a point.
    pub const SIZE: usize = 24;

    /// Writes the digits to the start of `place`. Returns their count. The bytes after them are undefined.
    #[inline]
    pub fn put(self, place: &mut [u8; Self::SIZE]) -> usize {
        let Self { negative, digits, decimals } = self;
        // The forms that programs and reports use.
        match decimals {
            0 if digits < EIGHT_DIGITS => {
                place[0] = b'-';
                let sign = usize::from(negative);
                sign + put_whole(digits, &mut place[sign..])
            }
            3 if fits::<3>(digits) => put::<3>(negative, digits, place),
            4 if fits::<4>(digits) => put::<4>(negative, digits, place),
            6 if fits::<6>(digits) => put::<6>(negative, digits, place),
            8 if fits::<8>(digits) => put::<8>(negative, digits, place),
            _ => self.put_any(place),
        }
    }

    /// Writes the digits of any number.
    fn put_any(self, place: &mut [u8; Self::SIZE]) -> usize {
        let mut at = Self::SIZE;
        let mut whole = self.digits;
        if self.decimals > 0 {
            let ten = WHOLE_TENS[self.decimals];
            whole = self.digits / ten;
            let mut part = self.digits - whole * ten;
            for _ in 0..self.decimals / 2 {
                at -= 2;
                place[at..at + 2].copy_from_slice(&pair(part % 100));
                part /= 100;
            }
            if self.decimals % 2 == 1 {
                at -= 1;
                place[at] = pair(part)[1];
            }
            at -= 1;
            place[at] = b'.';
        }
        while whole >= 100 {
            at -= 2;
            place[at..at + 2].copy_from_slice(&pair(whole % 100));
            whole /= 100;
        }
        let [tens, ones] = pair(whole);
        at -= 1;
        place[at] = ones;
        if tens != b'0' {
            at -= 1;
            place[at] = tens;
        }
        if self.negative {
            at -= 1;
            place[at] = b'-';
        }
        place.copy_within(at.., 0);
        Self::SIZE - at
    }
}

/// Numbers below this have at most eight digits.
const EIGHT_DIGITS: u64 = 100_000_000;

/// Reserves room for a number at the end of a text. [`give_back`] releases what is not used.
#[inline]
fn room(out: &mut Vec<u8>) -> &mut [u8; Fixed::SIZE] {
    out.extend_from_slice(&[0; Fixed::SIZE]);
    let Some(place) = out.last_chunk_mut() else { unreachable!("there are as many bytes now") };
    place
}

#[inline]
fn give_back(out: &mut Vec<u8>, len: usize) {
    out.truncate(out.len() - (Fixed::SIZE - len));
}

/// Whether [`put`] can write these digits.
#[inline]
fn fits<const DECIMALS: usize>(digits: u64) -> bool {
    digits < EIGHT_DIGITS * WHOLE_TENS[DECIMALS]
}

/// Writes digits to the start of `place`. Returns their count.
#[inline]
fn put<const DECIMALS: usize>(negative: bool, digits: u64, place: &mut [u8; Fixed::SIZE]) -> usize {
    const { assert!(0 < DECIMALS && DECIMALS <= 8) };
    debug_assert!(fits::<DECIMALS>(digits));
    let (whole, part) = (digits / WHOLE_TENS[DECIMALS], digits % WHOLE_TENS[DECIMALS]);
    place[0] = b'-';
    let sign = usize::from(negative);
    let at = sign + put_whole(whole, &mut place[sign..]);
    let part = eight(part * WHOLE_TENS[8 - DECIMALS]).to_le_bytes();
    place[at] = b'.';
    place[at + 1..at + 9].copy_from_slice(&part);
    at + 1 + DECIMALS
}

/// Writes a number of at most eight digits to the start of `place`, which has room for eight. Returns their count.
#[inline]
fn put_whole(number: u64, place: &mut [u8]) -> usize {
    if number < 10 {
        place[0] = pair(number)[1];
        return 1;
    }
    let (text, len) = without_zeros(eight(number));
    place[..8].copy_from_slice(&text.to_le_bytes());
    len
}

/// Eight digits without leading zeros, and the count of the zeros. The last digit is kept even if it is zero.
#[inline]
fn without_zeros(text: u64) -> (u64, usize) {
    let zeros = bits_of_zeros(text);
    (text >> zeros, 8 - zeros as usize / 8)
}

/// Number of bits of the leading zeros of eight digits, without the last digit.
#[inline(always)]
pub(super) fn bits_of_zeros(text: u64) -> u64 {
    let digits = text & 0x0F0F_0F0F_0F0F_0F0F | 1 << 56;
    u64::from(digits.trailing_zeros()) & 56
}

/// The eight digits of a number below [`EIGHT_DIGITS`], with leading zeros. The first character is the lowest byte.
#[inline]
fn eight(number: u64) -> u64 {
    // The register holds two parts of four digits, then four of two, then eight of one; the first part is the lowest.
    let high = (number * 109_951_163) >> 40;
    let fours = high | ((number - 10_000 * high) << 32);
    let hundreds = (fours * 5243) >> 19 & 0x7F_0000_007F;
    let pairs = hundreds | ((fours - 100 * hundreds) << 16);
    let tens = (pairs * 103) >> 10 & 0xF_000F_000F_000F;
    let digits = tens | ((pairs - 10 * tens) << 8);
    digits | ZEROS
}

/// Eight zeros.
pub(super) const ZEROS: u64 = 0x3030_3030_3030_3030;

/// Two digits of a number below 100.
fn pair(number: u64) -> [u8; 2] {
    PAIRS[usize::from(number.to_le_bytes()[0])]
}

/// The digit pairs 00, 01 … 99. The rest of the array is padding.
const PAIRS: [[u8; 2]; 256] = {
    let mut pairs = [[b'0'; 2]; 256];
    let mut i = 0;
    while i < 100 {
        pairs[i as usize] = [b'0' + i / 10, b'0' + i % 10];
        i += 1;
    }
    pairs
};

/// The products below have errors of less than 1e9 · 2^-53, a tenth of the required distance from a tie.
pub(super) const SMALL: f64 = 1e9;
pub(super) const FROM_TIE: f64 = 1e-6;

/// From this value on, floating-point numbers are integers. A number that is added to it is rounded to an integer, in
/// the lowest bits.
pub(super) const INTEGERS: f64 = 4_503_599_627_370_496.0;

/// A number that is not negative times a power of ten, as the nearest integer. False if it is not small, or if it is so
/// close to a tie that the rounding of the product could change the result.
#[inline]
fn nearest(size: f64, ten: f64) -> (u64, bool) {
    let product = size * ten;
    let rounded = product + INTEGERS;
    let valid = (product < SMALL) & ((product - (rounded - INTEGERS)).abs() < 0.5 - FROM_TIE);
    (rounded.to_bits() & ((1 << 52) - 1), valid)
}

/// [`scaled`] for small numbers that are not close to a tie, where the rounding of the product has no effect.
#[inline]
fn scaled_soon(value: f64, decimals: usize) -> Option<u64> {
    let ten = TENS.get(decimals).filter(|_| decimals <= MOST_DECIMALS)?;
    let (digits, valid) = nearest(value.abs(), *ten);
    valid.then_some(digits)
}

/// |value| · 10^decimals as an integer, rounded half to even on the exact value; `None` if it is too large.
fn scaled(value: f64, decimals: usize) -> Option<u64> {
    const FRACTION: u32 = 52;
    let bits = value.to_bits();
    let exponent = i32::try_from(bits >> FRACTION & 0x7FF).ok()?;
    // Subnormal numbers, infinities and NaN do not occur in programs.
    if decimals > MOST_DECIMALS || exponent == 0x7FF {
        return None;
    }
    if exponent == 0 {
        return (value == 0.0).then_some(0);
    }
    let mantissa = bits & ((1 << FRACTION) - 1) | 1 << FRACTION;
    let product = u128::from(mantissa) * 10_u128.pow(u32::try_from(decimals).ok()?);
    // value = mantissa · 2^(exponent − 1075)
    let shift = u32::try_from(1075 - exponent).ok()?;
    if shift >= 120 {
        return Some(0); // below 2^103 / 2^120: less than half
    }
    let whole = product >> shift;
    let rest = product & ((1 << shift) - 1);
    let half = if shift == 0 { u128::MAX } else { 1 << (shift - 1) };
    let up = rest > half || rest == half && whole & 1 == 1;
    u64::try_from(whole + u128::from(up)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_digits_are_two_times_four() {
        for four in 0..10_000 {
            for number in [four, 10_000 * four, 10_001 * four] {
                assert_eq!(std::str::from_utf8(&eight(number).to_le_bytes()), Ok(&*format!("{number:08}")));
            }
        }
    }
}
