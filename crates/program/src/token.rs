//! The new text of a number token, in its own style.

use deflex_text::{Token, number};

/// Most printed decimals: single precision has no more for any quaternion.
pub(crate) const MAX_DECIMALS: usize = 15;

/// A number as a controller stores it whose numbers are IEEE singles.
#[allow(clippy::cast_possible_truncation)]
pub(crate) fn single(value: f64) -> f64 {
    f64::from(value as f32)
}

/// The value of a token with its sign; blanks between them are allowed.
pub(crate) fn signed(token: &[u8]) -> Option<f64> {
    let (negative, rest) = match token {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        rest => (false, rest),
    };
    let value = unsigned(rest.trim_ascii_start())?;
    Some(if negative { -value } else { value })
}

/// The value of `12`, `1.5E3`, and of RAPID's `0x1F`, `0o17`, `0b101`.
pub(crate) fn unsigned(token: &[u8]) -> Option<f64> {
    let Some((radix, digits)) = based(token) else { return number::read(token) };
    u32::from_str_radix(std::str::from_utf8(digits).ok()?, radix).ok().map(f64::from)
}

/// Base and digits of a number that is not decimal.
fn based(token: &[u8]) -> Option<(u32, &[u8])> {
    let [b'0', base, digits @ ..] = token else { return None };
    let radix = match base.to_ascii_lowercase() {
        b'x' => 16,
        b'o' => 8,
        b'b' => 2,
        _ => return None,
    };
    Some((radix, digits))
}

/// A new token.
pub(crate) struct New {
    /// Its new text, in its own style; `None` if the printed value does not change.
    pub(crate) token: Option<Token>,
    /// The number in the new text, if it is known.
    pub(crate) value: Option<f64>,
}

impl New {
    pub(crate) fn of(old: &[u8], value: f64, least: usize) -> Self {
        let decimals = |places: usize| places.max(least).min(MAX_DECIMALS);
        // The usual form: only the number of decimals has to be kept.
        if let Some(was) = number::read_leading(old).filter(|was| was.len() == old.len() && was.bare)
            && let Some(fixed) = number::Fixed::of(value, decimals(was.decimals()))
            && let Some(printed) = fixed.value()
        {
            #[allow(clippy::float_cmp)] // only exactly the same number means no change
            let same = printed == was.value;
            let mut place = [0; number::Fixed::SIZE];
            let token = (!same).then(|| fixed.put(&mut place)).map(|len| Token::from_slice(&place[..len]));
            return Self { token, value: Some(if same { was.value } else { printed }) };
        }
        let mut out = Vec::new();
        number::write_fixed(&mut out, value, decimals(places(old)));
        let printed = number::read(&out);
        let was = signed(old);
        if printed.is_some() && printed == was {
            return Self { token: None, value: was };
        }
        // `+1.5` and `0012.5` keep their form.
        let digits = old.trim_start_with_sign();
        let whole = digits.iter().take_while(|b| b.is_ascii_digit()).count();
        if whole > 1 && digits[0] == b'0' {
            let sign = usize::from(out[0] == b'-');
            let now = out[sign..].iter().take_while(|b| b.is_ascii_digit()).count();
            out.splice(sign..sign, std::iter::repeat_n(b'0', whole.saturating_sub(now)));
        }
        if old.first() == Some(&b'+') && out[0] != b'-' {
            out.insert(0, b'+');
        }
        // `.500` and `-.500` too: they have no digit before the point.
        if whole == 0
            && let Some(point) = out.iter().position(|b| *b == b'.').filter(|at| *at > 0)
            && out[point - 1] == b'0'
            && !out[..point - 1].iter().any(u8::is_ascii_digit)
        {
            out.remove(point - 1);
        }
        Self { token: Some(out.into()), value: printed }
    }
}

/// Decimal places that a token's value has: digits after the point, less its exponent.
fn places(token: &[u8]) -> usize {
    if based(token.trim_start_with_sign()).is_some() {
        return 0;
    }
    let digits = number::decimals(token);
    if token.iter().all(|b| !b.is_ascii_alphabetic()) {
        return digits;
    }
    let exponent = token
        .iter()
        .position(|b| matches!(b, b'e' | b'E'))
        .and_then(|p| std::str::from_utf8(&token[p + 1..]).ok()?.parse::<i32>().ok());
    let shift = exponent.unwrap_or(0).clamp(-400, 400);
    usize::try_from(i64::try_from(digits).unwrap_or(0) - i64::from(shift)).unwrap_or(0)
}

trait Sign {
    fn trim_start_with_sign(&self) -> &[u8];
}

impl Sign for [u8] {
    /// Without a sign and the blanks after it.
    fn trim_start_with_sign(&self) -> &[u8] {
        self.strip_prefix(b"-").or_else(|| self.strip_prefix(b"+")).unwrap_or(self).trim_ascii_start()
    }
}
