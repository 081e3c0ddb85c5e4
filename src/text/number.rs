//! Number tokens: exact reading, fixed-decimal writing.

/// Reads a plain decimal token (`12`, `-1.5`, `.5`, `5.`, `9E+09`), exactly rounded.
///
/// Returns `None` for anything else, infinities and NaN among it.
#[must_use]
pub fn read(token: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(token).ok()?;
    let digits = text.trim_start_matches(['+', '-']);
    if text.len() - digits.len() > 1 || !digits.bytes().next().is_some_and(|b| b.is_ascii_digit() || b == b'.') {
        return None;
    }
    text.parse::<f64>().ok().filter(|v| v.is_finite())
}

/// Digits behind the point of a token, 0 without one; the exponent is not counted.
#[must_use]
pub fn decimals(token: &[u8]) -> usize {
    let mantissa = token.split(|b| matches!(b, b'e' | b'E' | b'd' | b'D')).next().unwrap_or(token);
    mantissa.iter().position(|&b| b == b'.').map_or(0, |p| mantissa.len() - p - 1)
}

/// Appends `value` with exactly `decimals` digits behind the point, rounded half to even on the
/// exact binary value, and never a negative zero. This is the reference; fast paths must agree.
pub fn write_fixed(out: &mut Vec<u8>, value: f64, decimals: usize) {
    use std::io::Write;
    let start = out.len();
    // Writing to a Vec cannot fail.
    let _ = write!(out, "{value:.decimals$}");
    if out[start] == b'-' && out[start + 1..].iter().all(|b| matches!(b, b'0' | b'.')) {
        out.remove(start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_every_form_and_no_words() {
        for (token, value) in [("5.", 5.0), (".5", 0.5), ("-.5", -0.5), ("9E+09", 9e9), ("+1", 1.0)] {
            assert_eq!(read(token.as_bytes()), Some(value), "{token}");
        }
        for token in ["", "inf", "nan", "-", "1e400", "--1", "infinity", "1.D+03"] {
            assert_eq!(read(token.as_bytes()), None, "{token}");
        }
    }

    #[test]
    fn writes_no_negative_zero() {
        let mut out = Vec::new();
        write_fixed(&mut out, -0.000_01, 3);
        assert_eq!(out, b"0.000");
    }
}
