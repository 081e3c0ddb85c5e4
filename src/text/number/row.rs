//! Rows of numbers of few digits: eight at once.

use super::TENS;
use super::write::{FROM_TIE, Fixed, INTEGERS, SMALL, ZEROS, without_zeros};
use crate::lanes::widest;

/// Numbers that are looked at side by side.
const SIDE: usize = 8;

/// What rows of `8 · BLOCKS` numbers have in common: how many decimals each of their numbers has.
pub(crate) struct Row<const BLOCKS: usize> {
    /// 10^decimals, and what fills these up to eight.
    scales: [Scale; BLOCKS],
}

struct Scale {
    tens: [f64; SIDE],
    tenths: [f64; SIDE],
    fill: [f64; SIDE],
}

/// Eight numbers as text.
#[derive(Clone, Copy, Default)]
struct Digits {
    /// Digits before the point with zeros before them, and behind it: each a text whose first byte is the lowest.
    whole: [u64; SIDE],
    part: [u64; SIDE],
    /// 1 where there is a minus before them.
    minus: [u64; SIDE],
    /// 1 where [`Fixed`] has to look closer.
    unsure: [u64; SIDE],
}

/// A row's text on its way, a comma behind each number.
pub(crate) struct Fields<const BLOCKS: usize> {
    digits: [Digits; BLOCKS],
    text: [[[u8; Fixed::SIZE]; SIDE]; BLOCKS],
    len: usize,
}

impl<const BLOCKS: usize> Row<BLOCKS> {
    /// One to eight decimals each; the row ends with as many zeros as it takes.
    pub(crate) const fn new(decimals: &[usize]) -> Self {
        const NONE: Scale = Scale { tens: [1.0; SIDE], tenths: [1.0; SIDE], fill: [1.0; SIDE] };
        let mut scales = [NONE; BLOCKS];
        let mut i = 0;
        while i < decimals.len() {
            assert!(0 < decimals[i] && decimals[i] <= 8);
            let scale = &mut scales[i / SIDE];
            scale.tens[i % SIDE] = TENS[decimals[i]];
            scale.tenths[i % SIDE] = 1.0 / TENS[decimals[i]];
            scale.fill[i % SIDE] = TENS[8 - decimals[i]];
            i += 1;
        }
        Self { scales }
    }

    /// Finds the digits of all numbers; false where [`write_fixed`](super::write_fixed) has to look closer at one.
    pub(crate) fn read(&self, values: &[[f64; SIDE]; BLOCKS], fields: &mut Fields<BLOCKS>) -> bool {
        fields.len = 0;
        let mut unsure = 0;
        for ((scale, values), digits) in self.scales.iter().zip(values).zip(&mut fields.digits) {
            widest!(<'a>(scale: &'a Scale = scale, values: &'a [f64; SIDE] = values, digits: &'a mut Digits = digits) {
                *digits = scale.digits(*values);
            });
            unsure |= digits.unsure.iter().fold(0, |any, one| any | one);
        }
        unsure == 0
    }
}

impl Scale {
    /// Step by step for all eight, so that the compiler has them side by side.
    #[inline(always)]
    fn digits(&self, values: [f64; SIDE]) -> Digits {
        let product = zip(values, self.tens, |value, ten| value.abs() * ten);
        let number = map(product, |product| product + INTEGERS - INTEGERS);
        let unsure = zip(product, number, |product, number| {
            u64::from(!((product < SMALL) & ((product - number).abs() < 0.5 - FROM_TIE)))
        });
        // Between two multiples of ten: what the product is off by does not matter.
        let whole = zip(number, self.tenths, |number, tenth| ((number + 0.5) * tenth).floor());
        let rest = zip(number, zip(whole, self.tens, |whole, ten| whole * ten), |number, whole| number - whole);
        let part = zip(rest, self.fill, |rest, fill| rest * fill);
        let minus = zip(values, number, |value, number| u64::from((value < 0.0) & (number > 0.0)));
        Digits { whole: eights(whole), part: eights(part), minus, unsure }
    }
}

/// [`eight`](super::write::eight) of each.
#[inline(always)]
fn eights(numbers: [f64; SIDE]) -> [u64; SIDE] {
    let numbers = map(numbers, |number| (number + INTEGERS).to_bits() & ((1 << 27) - 1));
    let high = map(numbers, |number| (number * 109_951_163) >> 40);
    let fours = zip(numbers, high, |number, high| high | ((number - 10_000 * high) << 32));
    let hundreds = map(fours, |fours| (fours * 5243) >> 19 & 0x7F_0000_007F);
    let pairs = zip(fours, hundreds, |fours, hundreds| hundreds | ((fours - 100 * hundreds) << 16));
    let tens = map(pairs, |pairs| (pairs * 103) >> 10 & 0xF_000F_000F_000F);
    zip(pairs, tens, |pairs, tens| tens | ((pairs - 10 * tens) << 8) | ZEROS)
}

#[inline(always)]
fn map<A: Copy, B: Copy + Default>(all: [A; SIDE], f: impl Fn(A) -> B) -> [B; SIDE] {
    let mut out = [B::default(); SIDE];
    for i in 0..SIDE {
        out[i] = f(all[i]);
    }
    out
}

#[inline(always)]
fn zip<A: Copy, B: Copy, C: Copy + Default>(all: [A; SIDE], others: [B; SIDE], f: impl Fn(A, B) -> C) -> [C; SIDE] {
    let mut out = [C::default(); SIDE];
    for i in 0..SIDE {
        out[i] = f(all[i], others[i]);
    }
    out
}

impl<const BLOCKS: usize> Fields<BLOCKS> {
    pub(crate) fn new() -> Self {
        Self { digits: [Digits::default(); BLOCKS], text: [[[0; Fixed::SIZE]; SIDE]; BLOCKS], len: 0 }
    }

    /// Takes the number at `i` of the row, of so many decimals.
    #[inline]
    pub(crate) fn push<const DECIMALS: usize>(&mut self, i: usize) {
        let digits = &self.digits[i / SIDE];
        let (whole, part) = (digits.whole[i % SIDE], digits.part[i % SIDE]);
        let minus = usize::from(digits.minus[i % SIDE] > 0);
        let text = self.text.as_flattened_mut().as_flattened_mut();
        let Some(place) = text[self.len..].first_chunk_mut::<{ Fixed::SIZE }>() else {
            unreachable!("there is room for all")
        };
        let (whole, len) = without_zeros(whole);
        place[0] = b'-';
        place[minus..minus + 8].copy_from_slice(&whole.to_le_bytes());
        let at = minus + len;
        place[at] = b'.';
        place[at + 1..at + 9].copy_from_slice(&part.to_le_bytes());
        place[at + 1 + DECIMALS] = b',';
        self.len += at + DECIMALS + 2;
    }

    /// What has been taken since the last time.
    pub(crate) fn take(&mut self) -> &[u8] {
        &self.text.as_flattened().as_flattened()[..std::mem::take(&mut self.len)]
    }
}
