//! Makes text from outside safe to show.

use std::borrow::Cow;

/// Text of a file, or the name of a file, as it can be shown to people. Characters that would control a terminal or
/// change the direction of text are replaced one by one, so that columns stay the same. Line feeds and tabs are kept.
///
/// C0 control characters and DEL become their pictures (from U+2400). C1 control characters (U+009B is CSI) and the
/// directional controls of Unicode (UAX #9, see CVE-2021-42574) become U+FFFD.
#[must_use]
#[doc(hidden)]
pub fn printable(text: &str) -> Cow<'_, str> {
    replaced(text, |c| !matches!(c, '\n' | '\t'))
}

/// The text in one line: line feeds and tabs become pictures too.
///
/// # Examples
/// ```
/// use deflex_text::printable_line;
///
/// assert_eq!(printable_line("part.mod"), "part.mod");
/// assert!(!printable_line("two\nlines").contains('\n'));
/// ```
#[must_use]
pub fn printable_line(text: &str) -> Cow<'_, str> {
    replaced(text, |_| true)
}

fn replaced(text: &str, concerns: impl Fn(char) -> bool) -> Cow<'_, str> {
    let instead = |c: char| picture(c).filter(|_| concerns(c));
    if text.is_ascii() && !text.bytes().any(|b| b.is_ascii_control()) || text.chars().all(|c| instead(c).is_none()) {
        return Cow::Borrowed(text);
    }
    text.chars().map(|c| instead(c).unwrap_or(c)).collect::<String>().into()
}

/// The replacement of a character; `None` if it is shown as it is.
fn picture(c: char) -> Option<char> {
    match c {
        '\0'..='\x1f' => char::from_u32(0x2400 + u32::from(c)),
        '\x7f' => Some('\u{2421}'),
        '\u{80}'..='\u{9f}'
        | '\u{61c}'
        | '\u{200e}'
        | '\u{200f}'
        | '\u{2028}'..='\u{202e}'
        | '\u{2066}'..='\u{2069}'
        // Code points that are not characters: XML does not allow them.
        | '\u{fffe}'..='\u{ffff}' => Some(char::REPLACEMENT_CHARACTER),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_steers_a_terminal_is_pictured() {
        assert_eq!(printable("a\x1b]0;t\x07\u{9b}2J\u{202e}b\r\n\tc"), "a␛]0;t␇\u{fffd}2J\u{fffd}b␍\n\tc");
        assert_eq!(printable_line("a\n\tc"), "a␊␉c");
        assert!(matches!(printable("Größe 5°\n"), Cow::Borrowed(_)));
    }

    proptest! {
        #[test]
        fn nothing_that_steers_is_left_and_columns_stay(text in any::<String>()) {
            let shown = printable_line(&text);
            prop_assert_eq!(shown.chars().count(), text.chars().count());
            prop_assert!(!shown.chars().any(char::is_control));
            prop_assert_eq!(printable_line(&shown), &*shown);
        }
    }
}
