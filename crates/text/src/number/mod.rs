//! Reads number tokens exactly, and writes numbers with a fixed number of decimals.
//!
//! Numbers of the usual forms are converted by integer arithmetic, all others by the standard library. `read_plain`
//! and `write_fixed_plain` are the references with which the fast paths must agree.

mod read;
mod row;
mod runs;
mod write;

#[cfg(test)]
pub(crate) use read::read_plain;
pub use read::{Leading, decimals, is_none, read, read_leading};
pub use row::{Digits, Numbers, Printed, Row, SIDE};
pub use runs::Runs;
#[cfg(test)]
pub(crate) use write::write_fixed_plain;
pub use write::{Fixed, fixed, printed, write_fixed, write_whole};

/// The powers of ten that are exact as floating-point numbers.
const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// Whole numbers with up to this number of digits are below 2^53, so they are exact.
#[doc(hidden)]
pub const MOST_DIGITS: usize = 15;

/// Largest number of decimals: 2^53 · 10^15 is below 2^103.
const MOST_DECIMALS: usize = 15;

/// Powers of ten for every number of decimals that is written.
const WHOLE_TENS: [u64; MOST_DECIMALS + 1] = {
    let mut tens = [1; MOST_DECIMALS + 1];
    let mut i = 1;
    while i <= MOST_DECIMALS {
        tens[i] = 10 * tens[i - 1];
        i += 1;
    }
    tens
};

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

    #[test]
    fn reads_digits_up_to_any_byte() {
        for byte in 0..=u8::MAX {
            let text = [b'1', b'.', b'2', byte, b'3', b'4', b'5', b'6', b'7', b'8', b','];
            let len = if byte.is_ascii_digit() { 10 } else { 3 };
            let leading = read_leading(&text).map(|leading| (leading.value, leading.len()));
            assert_eq!(leading, read_plain(&text[..len]).map(|value| (value, len)), "{byte:#x}");
        }
    }

    proptest! {
        #[test]
        fn whole_numbers_print_as_the_reference_does(value in any::<u32>(), bits in 0..32) {
            let value = value >> bits;
            let mut text = Vec::new();
            write_whole(&mut text, value);
            prop_assert_eq!(text, value.to_string().into_bytes());
        }

        #[test]
        fn rows_print_as_the_reference_does(values in any::<[i32; 3]>(), bits in 0..32, close in -2_i64..3) {
            // Numbers around ties, too.
            let values = values.map(|v| f64::from_bits((f64::from(v >> bits) / 2048.0).to_bits().wrapping_add_signed(close)));
            let [a, b, c] = values;
            let row = [a, b, c, f64::from(bits), 0.0, 0.0, 0.0, 0.0];
            let mut digits = [Digits::default()];
            if Row::new(&[3, 6, 7, 1]).read(&[row], &mut digits) {
                let [digits] = digits;
                let mut place = [0; Fixed::SIZE];
                let mut fast = Vec::new();
                let mut take = |len: usize, place: &[u8]| fast.extend_from_slice(&place[..len]);
                take(digits.put::<3>(0, &mut place), &place);
                take(digits.put::<6>(1, &mut place), &place);
                take(digits.put::<7>(2, &mut place), &place);
                take(digits.put_whole(3, &mut place), &place);
                let mut plain = Vec::new();
                for (value, decimals) in row.into_iter().zip([3, 6, 7, 0]) {
                    write_fixed_plain(&mut plain, value, decimals);
                    plain.push(b',');
                }
                prop_assert_eq!(String::from_utf8_lossy(&fast), String::from_utf8_lossy(&plain));
            }
        }

        #[test]
        fn numbers_instead_of_others_print_as_the_reference_does(
            value in prop_oneof![any::<f64>(), -20_000.0..20_000.0, (-1_000_000..1_000_000).prop_map(|v| f64::from(v) / 1024.0)],
            was in 0_u8..10,
            least in 0_u8..9,
        ) {
            let decimals = was.max(least);
            let numbers = Numbers::new([decimals; 8]);
            prop_assert_eq!(numbers.is_some(), (1..=8).contains(&decimals));
            let Some(numbers) = numbers else { return Ok(()) };
            let mut printed = Printed::default();
            let (mut place, mut plain, mut before) = ([0; Fixed::SIZE], Vec::new(), Vec::new());
            write_fixed_plain(&mut plain, value, decimals.into());
            write_fixed_plain(&mut before, value, was.into());
            if numbers.print(&[value; 8], &mut printed) {
                let len = printed.put(6, &mut place);
                prop_assert_eq!(String::from_utf8_lossy(&place[..len]), String::from_utf8_lossy(&plain));
                let new = read_plain(&plain).unwrap();
                prop_assert_eq!(printed.values[6].to_bits(), new.to_bits());
                prop_assert_eq!(printed.held[6].to_bits(), f64::from(new as f32).to_bits());
                prop_assert_eq!(printed.may_be_the_same(6, was), was < decimals && read_plain(&before) == Some(new));
            }
        }

        #[test]
        fn what_is_printed_is_what_a_reader_gets(value in -20_000.0_f64..20_000.0, decimals in 0_usize..16) {
            let mut text = Vec::new();
            write_fixed_plain(&mut text, value, decimals);
            prop_assert_eq!(Some(printed(value, decimals).to_bits()), read_plain(&text).map(f64::to_bits));
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
            if let Some(leading) = read_leading(text.as_bytes()) {
                let (value, places) = (leading.value, leading.decimals());
                prop_assert_eq!((leading.len(), places), (token.len(), decimals(token.as_bytes())));
                let mut printed = Vec::new();
                write_fixed_plain(&mut printed, value, places);
                prop_assert_eq!(leading.bare, printed == token.as_bytes());
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
