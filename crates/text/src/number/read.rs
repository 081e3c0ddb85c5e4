//! Converts number tokens to values, correctly rounded.

use super::{MOST_DIGITS, TENS, WHOLE_TENS};

/// Reads a plain decimal token (`12`, `-1.5`, `.5`, `5.`, `9E+09`), correctly rounded.
///
/// Returns `None` for all other texts, including infinities and NaN.
#[must_use]
#[doc(hidden)]
pub fn read(token: &[u8]) -> Option<f64> {
    read_short(token).or_else(|| read_plain(token))
}

/// The reference for [`read`].
#[must_use]
pub(crate) fn read_plain(token: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(token).ok()?;
    let digits = text.trim_start_matches(['+', '-']);
    if text.len() - digits.len() > 1 || !digits.bytes().next().is_some_and(|b| b.is_ascii_digit() || b == b'.') {
        return None;
    }
    text.parse::<f64>().ok().filter(|v| v.is_finite())
}

/// Whether a word is one that programs print for NaN or infinity.
#[doc(hidden)]
pub fn is_none(word: &[u8]) -> bool {
    [&b"nan"[..], b"inf", b"infinity"].iter().any(|none| word.eq_ignore_ascii_case(none))
}

/// Reads numbers of at most 15 digits whose power of ten is exact. The value is one multiplication or division of two
/// exact numbers, which is correctly rounded (Clinger 1990).
fn read_short(token: &[u8]) -> Option<f64> {
    let (negative, digits) = match token {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    let (mut mantissa, mut count, mut point, mut tail) = (0_u64, 0, None, None);
    for (at, &byte) in digits.iter().enumerate() {
        match byte {
            b'0'..=b'9' if count < MOST_DIGITS => {
                mantissa = mantissa * 10 + u64::from(byte - b'0');
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            b'e' | b'E' => {
                tail = Some(&digits[at + 1..]);
                break;
            }
            _ => return None,
        }
    }
    if count == 0 {
        return None;
    }
    let decimals = point.map_or(0, |p| count - p);
    let power = tail.map_or(Some(0), exponent)? - i32::try_from(decimals).ok()?;
    let ten = *TENS.get(usize::try_from(power.unsigned_abs()).ok()?)?;
    #[allow(clippy::cast_precision_loss)] // below 2^53
    let value = if power < 0 { mantissa as f64 / ten } else { mantissa as f64 * ten };
    Some(if negative { -value } else { value })
}

/// A number at the beginning of a text.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[doc(hidden)]
pub struct Leading {
    /// Value of the number.
    pub value: f64,
    /// Length of the token, bytes.
    pub len: u8,
    /// Number of digits after the point.
    decimals: u8,
    /// Whether the token has no plus sign and no leading zeros, and is no negative zero. Then value and decimals
    /// determine its text.
    pub bare: bool,
}

impl Leading {
    /// Length of the token, bytes.
    #[inline]
    #[allow(clippy::len_without_is_empty)] // a number has at least one digit
    pub fn len(self) -> usize {
        self.len.into()
    }

    /// Number of digits after the point.
    #[inline]
    pub fn decimals(self) -> usize {
        self.decimals.into()
    }

    /// In place of the number of decimals, if the number is not bare.
    pub const ODD: u8 = u8::MAX;

    /// Number of decimals of a bare number, which together with the value determines its text; otherwise
    /// [`Leading::ODD`].
    #[inline]
    pub fn bare_decimals(self) -> u8 {
        if self.bare { self.decimals } else { Self::ODD }
    }
}

/// The number with which `bytes` begin, if it consists of an optional sign, digits, and a point between digits. The
/// value is that of [`read`], but one pass finds value and length. `None` for any other form. The caller has to check
/// the bytes that follow.
#[must_use]
#[inline]
#[doc(hidden)]
pub fn read_leading(bytes: &[u8]) -> Option<Leading> {
    let first = *bytes.first()?;
    let negative = first == b'-';
    let sign = usize::from(negative | (first == b'+'));
    let (mut mantissa, whole) = append_digits(0, &bytes[sign..]);
    let (mut len, mut decimals) = (sign + whole, 0);
    if let Some((b'.', fraction)) = bytes[len..].split_first() {
        (mantissa, decimals) = append_digits(mantissa, fraction);
        if decimals == 0 {
            return None;
        }
        len += 1 + decimals;
    }
    if whole == 0 || whole + decimals > MOST_DIGITS {
        return None;
    }
    #[allow(clippy::cast_precision_loss)] // below 2^53
    let value = mantissa as f64 / TENS[decimals];
    let bare = first != b'+' && (whole == 1 || bytes[sign] != b'0') && !(negative && mantissa == 0);
    #[allow(clippy::cast_possible_truncation)] // at most a sign, a point and MOST_DIGITS
    let (len, decimals) = (len as u8, decimals as u8);
    Some(Leading { value: if negative { -value } else { value }, len, decimals, bare })
}

/// Appends the digits with which `bytes` begin to `number`, and returns their count. The number wraps if there are too
/// many.
#[inline]
fn append_digits(number: u64, bytes: &[u8]) -> (u64, usize) {
    if let Some(eight) = bytes.first_chunk() {
        let (value, len) = digits_of_eight(u64::from_le_bytes(*eight));
        if len < 8 || !bytes.get(8).is_some_and(u8::is_ascii_digit) {
            return (number.wrapping_mul(WHOLE_TENS[len]).wrapping_add(value), len);
        }
    }
    append_digits_plain(number, bytes)
}

/// [`append_digits`] digit by digit.
#[inline]
fn append_digits_plain(number: u64, bytes: &[u8]) -> (u64, usize) {
    let digits = bytes.iter().map(|b| b.wrapping_sub(b'0')).take_while(|digit| *digit < 10);
    digits.fold((number, 0), |(number, count), digit| (number.wrapping_mul(10).wrapping_add(digit.into()), count + 1))
}

/// The number at the beginning of eight bytes of text, and its count of digits. The first byte is the lowest.
#[inline]
fn digits_of_eight(text: u64) -> (u64, usize) {
    // The exclusive or turns a digit into its value. The highest bit of any other byte is then set, or becomes set by
    // adding 0x76 = 0x80 - 10.
    let digits = text ^ 0x3030_3030_3030_3030;
    let others = (digits.wrapping_add(0x7676_7676_7676_7676) | digits) & 0x8080_8080_8080_8080;
    let bits = others.trailing_zeros() & !7;
    // Zeros are inserted before the number to make eight digits. Ones and tens, then pairs, then fours are joined in
    // parallel.
    let digits = digits.unbounded_shl(64 - bits);
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let of_pairs = |pairs: u64, by: u64| (pairs & 0xFF_0000_00FF).wrapping_mul(by);
    let whole = of_pairs(pairs, 100 | 1_000_000 << 32).wrapping_add(of_pairs(pairs >> 16, 1 | 10_000 << 32)) >> 32;
    (whole, bits as usize / 8)
}

/// An exponent of one or two digits: `9`, `+09`, `-3`.
fn exponent(tail: &[u8]) -> Option<i32> {
    let (sign, digits) = match tail {
        [b'-', digits @ ..] => (-1, digits),
        [b'+', digits @ ..] => (1, digits),
        digits => (1, digits),
    };
    let short = matches!(digits.len(), 1..=3) && digits.iter().all(u8::is_ascii_digit);
    short.then(|| sign * digits.iter().fold(0, |e, d| e * 10 + i32::from(d - b'0')))
}

/// Number of digits after the point of a token; 0 without a point. The exponent is not counted.
#[must_use]
#[doc(hidden)]
pub fn decimals(token: &[u8]) -> usize {
    let mantissa = token.split(|b| matches!(b, b'e' | b'E' | b'd' | b'D')).next().unwrap_or(token);
    mantissa.iter().position(|&b| b == b'.').map_or(0, |p| mantissa.len() - p - 1)
}
