//! Number tokens: exact reading, fixed-decimal writing.
//!
//! The common numbers of programs go through integer arithmetic, all others through the standard
//! library: [`read_plain`] and [`write_fixed_plain`] are the reference that the fast paths agree with.

/// Reads a plain decimal token (`12`, `-1.5`, `.5`, `5.`, `9E+09`), exactly rounded.
///
/// Returns `None` for anything else, infinities and NaN among it.
#[must_use]
pub(crate) fn read(token: &[u8]) -> Option<f64> {
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

/// Whether a word is what programs print for a number that is none.
pub(crate) fn is_none(word: &[u8]) -> bool {
    [&b"nan"[..], b"inf", b"infinity"].iter().any(|none| word.eq_ignore_ascii_case(none))
}

/// Powers of ten that are exact in binary.
const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// Numbers of at most 15 digits whose power of ten is exact: one multiplication or division of two exact
/// numbers, which is exactly rounded (Clinger 1990).
fn read_short(token: &[u8]) -> Option<f64> {
    const MOST_DIGITS: usize = 15; // below 2^53
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Leading {
    /// Its value.
    pub(crate) value: f64,
    /// Its bytes.
    pub(crate) len: usize,
    /// Digits behind the point.
    pub(crate) decimals: usize,
}

/// The number that `bytes` begin with, where it is an optional sign, digits, and a point between digits: what [`read`] gives
/// for that token, found in one pass. `None` for any other form; whoever calls looks at what follows.
#[must_use]
pub(crate) fn read_leading(bytes: &[u8]) -> Option<Leading> {
    const MOST_DIGITS: usize = 15; // below 2^53
    let sign = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let (mut mantissa, mut point, mut len) = (0_u64, None, sign);
    for &byte in &bytes[sign..] {
        match byte {
            b'0'..=b'9' => mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(byte - b'0')),
            b'.' if point.is_none() && len > sign => point = Some(len),
            _ => break,
        }
        len += 1;
    }
    let decimals = point.map_or(0, |point| len - point - 1);
    let digits = len - sign - usize::from(point.is_some());
    if digits == 0 || digits > MOST_DIGITS || point == Some(len - 1) {
        return None;
    }
    #[allow(clippy::cast_precision_loss)] // below 2^53
    let value = mantissa as f64 / TENS[decimals];
    Some(Leading { value: if bytes[0] == b'-' { -value } else { value }, len, decimals })
}

/// A short exponent: `9`, `+09`, `-3`.
fn exponent(tail: &[u8]) -> Option<i32> {
    let (sign, digits) = match tail {
        [b'-', digits @ ..] => (-1, digits),
        [b'+', digits @ ..] => (1, digits),
        digits => (1, digits),
    };
    let short = matches!(digits.len(), 1..=3) && digits.iter().all(u8::is_ascii_digit);
    short.then(|| sign * digits.iter().fold(0, |e, d| e * 10 + i32::from(d - b'0')))
}

/// Digits behind the point of a token, 0 without one; the exponent is not counted.
#[must_use]
pub(crate) fn decimals(token: &[u8]) -> usize {
    let mantissa = token.split(|b| matches!(b, b'e' | b'E' | b'd' | b'D')).next().unwrap_or(token);
    mantissa.iter().position(|&b| b == b'.').map_or(0, |p| mantissa.len() - p - 1)
}

/// Appends `value` with exactly `decimals` digits behind the point, rounded half to even on the
/// exact binary value, and never a negative zero.
pub(crate) fn write_fixed(out: &mut Vec<u8>, value: f64, decimals: usize) {
    match Fixed::of(value, decimals) {
        Some(fixed) => fixed.write(out),
        None => write_fixed_plain(out, value, decimals),
    }
}

/// A number as [`write_fixed`] prints it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fixed {
    negative: bool,
    digits: u64,
    decimals: usize,
}

impl Fixed {
    /// `value` with so many digits behind the point; `None` for what no program has.
    #[must_use]
    pub(crate) fn of(value: f64, decimals: usize) -> Option<Self> {
        let digits = scaled_soon(value, decimals).or_else(|| scaled(value, decimals))?;
        Some(Self { negative: value < 0.0 && digits != 0, digits, decimals })
    }

    /// What a reader of the digits gets, exactly rounded; `None` where they are too many for that to be one division.
    #[must_use]
    pub(crate) fn value(self) -> Option<f64> {
        const EXACT: u64 = 1 << 53;
        #[allow(clippy::cast_precision_loss)] // below 2^53
        let value = (self.digits < EXACT).then(|| self.digits as f64 / TENS[self.decimals])?;
        Some(if self.negative { -value } else { value })
    }

    /// Appends the digits.
    pub(crate) fn write(self, out: &mut Vec<u8>) {
        out.extend_from_slice(self.text(&mut [0; Self::SIZE]));
    }

    /// Sign, 20 digits and a point, at most.
    pub(crate) const SIZE: usize = 24;

    /// The digits, at the end of a place for them.
    pub(crate) fn text(self, place: &mut [u8; Self::SIZE]) -> &[u8] {
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
        &place[at..]
    }
}

/// Two digits of a number below 100.
fn pair(number: u64) -> [u8; 2] {
    PAIRS[usize::from(number.to_le_bytes()[0])]
}

/// 00, 01 … 99; further on nothing that is asked for.
const PAIRS: [[u8; 2]; 256] = {
    let mut pairs = [[b'0'; 2]; 256];
    let mut i = 0;
    while i < 100 {
        pairs[i as usize] = [b'0' + i / 10, b'0' + i % 10];
        i += 1;
    }
    pairs
};

/// Powers of ten of as many decimals as are written.
const WHOLE_TENS: [u64; MOST_DECIMALS + 1] = {
    let mut tens = [1; MOST_DECIMALS + 1];
    let mut i = 1;
    while i <= MOST_DECIMALS {
        tens[i] = 10 * tens[i - 1];
        i += 1;
    }
    tens
};

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

/// [`scaled`] where the product's own rounding cannot matter: small numbers that are not close to a tie.
fn scaled_soon(value: f64, decimals: usize) -> Option<u64> {
    /// Products below are off by less than 1e9 · 2^-53, a tenth of what a tie is kept away.
    const SMALL: f64 = 1e9;
    const FROM_TIE: f64 = 1e-6;
    let product = value.abs() * TENS.get(decimals).filter(|_| decimals <= MOST_DECIMALS)?;
    if product.is_nan() || product >= SMALL {
        return None;
    }
    #[allow(clippy::cast_possible_truncation)]
    let whole = product as i64;
    #[allow(clippy::cast_precision_loss)]
    let off = product - whole as f64 - 0.5;
    (off.abs() > FROM_TIE).then_some(whole.unsigned_abs() + u64::from(off > 0.0))
}

/// 2^53 · 10^15 is below 2^103.
const MOST_DECIMALS: usize = 15;

/// |value| · 10^decimals as an integer, rounded half to even on the exact value; `None` where it does not fit.
fn scaled(value: f64, decimals: usize) -> Option<u64> {
    const FRACTION: u32 = 52;
    let bits = value.to_bits();
    let exponent = i32::try_from(bits >> FRACTION & 0x7FF).ok()?;
    // Subnormal numbers, infinities and NaN are none of a program's.
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
    use proptest::prelude::*;

    #[test]
    fn reads_every_form_and_no_words() {
        for (token, value) in [("5.", 5.0), (".5", 0.5), ("-.5", -0.5), ("9E+09", 9e9), ("+1", 1.0)] {
            assert_eq!(read(token.as_bytes()), Some(value), "{token}");
        }
        for token in ["", "inf", "nan", "-", ".", "-.", "1e400", "--1", "infinity", "1.D+03", "1.2.3"] {
            assert_eq!(read(token.as_bytes()), None, "{token}");
        }
    }

    #[test]
    fn writes_no_negative_zero() {
        let mut out = Vec::new();
        write_fixed(&mut out, -0.000_01, 3);
        assert_eq!(out, b"0.000");
    }

    /// Both writers, as text.
    fn both(value: f64, decimals: usize) -> (String, String) {
        let (mut fast, mut plain) = (Vec::new(), Vec::new());
        write_fixed(&mut fast, value, decimals);
        write_fixed_plain(&mut plain, value, decimals);
        (String::from_utf8_lossy(&fast).into_owned(), String::from_utf8_lossy(&plain).into_owned())
    }

    #[test]
    fn ties_and_edges_print_as_the_reference_does() {
        for value in [0.5, 1.5, 2.5, 0.125, 0.375, 1e15, 9.999_95, 0.999_995, -0.5, 1e-300, 5e-324, 1e22, f64::MAX, 0.0]
        {
            for decimals in 0..20 {
                let (fast, plain) = both(value, decimals);
                assert_eq!(fast, plain, "{value:e} with {decimals}");
            }
        }
    }

    proptest! {
        #[test]
        fn what_is_printed_is_what_a_reader_gets(value in -20_000.0_f64..20_000.0, decimals in 0_usize..16) {
            let mut text = Vec::new();
            write_fixed(&mut text, value, decimals);
            if let Some(read_back) = Fixed::of(value, decimals).and_then(Fixed::value) {
                prop_assert_eq!(Some(read_back.to_bits()), read_plain(&text).map(f64::to_bits));
            }
        }

        #[test]
        fn any_number_prints_as_the_reference_does(bits in any::<u64>(), decimals in 0_usize..18) {
            let value = f64::from_bits(bits);
            prop_assume!(value.is_finite());
            let (fast, plain) = both(value, decimals);
            prop_assert_eq!(fast, plain);
        }

        #[test]
        fn lengths_print_as_the_reference_does(value in -20_000.0_f64..20_000.0, decimals in 0_usize..16) {
            let (fast, plain) = both(value, decimals);
            prop_assert_eq!(fast, plain);
        }

        #[test]
        fn a_leading_number_is_the_token(token in "[-+]?[0-9]{0,17}\\.?[0-9]{0,9}", rest in "[,e\\] ]?") {
            let text = format!("{token}{rest}");
            if let Some(Leading { value, len, decimals: behind }) = read_leading(text.as_bytes()) {
                prop_assert_eq!((len, behind), (token.len(), decimals(token.as_bytes())));
                prop_assert_eq!(Some(value.to_bits()), read_plain(token.as_bytes()).map(f64::to_bits));
            }
        }

        #[test]
        fn tokens_read_as_the_reference_does(token in "[-+]?[0-9]{0,12}\\.?[0-9]{0,12}([eE][-+]?[0-9]{1,3})?") {
            let bits = |value: Option<f64>| value.map(f64::to_bits);
            prop_assert_eq!(bits(read(token.as_bytes())), bits(read_plain(token.as_bytes())));
        }
    }
}
