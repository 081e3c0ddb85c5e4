//! Numbers of few digits to text: eight at once.

use super::TENS;
use super::write::{FROM_TIE, Fixed, INTEGERS, SMALL, ZEROS, without_zeros};
use crate::lanes::widest;

/// Numbers that are looked at side by side.
pub(crate) const SIDE: usize = 8;

/// What rows of `8 · BLOCKS` numbers have in common: how many decimals each of their numbers has.
pub(crate) struct Row<const BLOCKS: usize> {
    scales: [Scale; BLOCKS],
}

/// How eight numbers are printed.
struct Scale {
    /// 10^decimals, one by it, and what fills decimals up to eight.
    tens: [f64; SIDE],
    tenths: [f64; SIDE],
    fill: [f64; SIDE],
    /// Of eight decimals as text, those that are printed.
    own: [u64; SIDE],
    /// The point before them, and the comma behind.
    marks: [u64; SIDE],
}

/// Eight numbers as text.
#[derive(Clone, Copy, Default)]
pub(crate) struct Digits {
    /// Digits before the point with zeros before them, and behind it: each a text whose first byte is the lowest.
    whole: [u64; SIDE],
    part: [u64; SIDE],
    /// Up to seven of those behind the point with the point before them, and the comma behind if there is room for it.
    tail: [u64; SIDE],
    /// 1 where there is a minus before them.
    minus: [u64; SIDE],
    /// 1 where [`Fixed`] has to look closer.
    unsure: [u64; SIDE],
}

impl<const BLOCKS: usize> Row<BLOCKS> {
    /// One to eight decimals each; the row ends with as many zeros as it takes.
    pub(crate) const fn new(decimals: &[usize]) -> Self {
        let mut scales = [Scale::NONE; BLOCKS];
        let mut i = 0;
        while i < decimals.len() {
            scales[i / SIDE].set(i % SIDE, decimals[i]);
            i += 1;
        }
        Self { scales }
    }

    /// Finds the digits of all numbers; false where [`write_fixed`](super::write_fixed) has to look closer at one.
    pub(crate) fn read(&self, values: &[[f64; SIDE]; BLOCKS], digits: &mut [Digits; BLOCKS]) -> bool {
        widest!(<'a>(
            scales: &'a [Scale] = &self.scales,
            values: &'a [[f64; SIDE]] = values,
            digits: &'a mut [Digits] = digits,
        ) {
            for ((scale, values), digits) in scales.iter().zip(values).zip(digits) {
                *digits = scale.digits(*values).0;
            }
        });
        digits.iter().flat_map(|digits| digits.unsure).fold(0, |any, one| any | one) == 0
    }
}

impl Scale {
    const NONE: Self =
        Self { tens: [1.0; SIDE], tenths: [1.0; SIDE], fill: [1.0; SIDE], own: [0; SIDE], marks: [0; SIDE] };

    const fn set(&mut self, i: usize, decimals: usize) {
        assert!(0 < decimals && decimals <= 8);
        self.tens[i] = TENS[decimals];
        self.tenths[i] = 1.0 / TENS[decimals];
        self.fill[i] = TENS[8 - decimals];
        self.own[i] = u64::MAX >> (64 - 8 * decimals);
        self.marks[i] = b'.' as u64 | (b',' as u64).unbounded_shl(8 * (decimals as u32 + 1));
    }

    /// The digits, and what number they are without the point. Step by step for all eight, so that the compiler has them side
    /// by side.
    #[inline(always)]
    fn digits(&self, values: [f64; SIDE]) -> (Digits, [f64; SIDE]) {
        let product = zip(values, self.tens, |value, ten| value.abs() * ten);
        let number = map(product, |product| product + INTEGERS - INTEGERS);
        let unsure = zip(product, number, |product, number| {
            u64::from(!((product < SMALL) & ((product - number).abs() < 0.5 - FROM_TIE)))
        });
        // Between two multiples of ten: what the product is off by does not matter.
        let whole = zip(number, self.tenths, |number, tenth| ((number + 0.5) * tenth).floor());
        let rest = zip(number, zip(whole, self.tens, |whole, ten| whole * ten), |number, whole| number - whole);
        let part = eights(zip(rest, self.fill, |rest, fill| rest * fill));
        let tail = zip(zip(part, self.own, |part, own| (part & own) << 8), self.marks, |tail, marks| tail | marks);
        let minus = zip(values, number, |value, number| u64::from((value < 0.0) & (number > 0.0)));
        (Digits { whole: eights(whole), part, tail, minus, unsure }, number)
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

impl Digits {
    /// Writes a number of so many decimals to the beginning of a place for it, and a comma; their bytes.
    #[inline(always)]
    pub(crate) fn put<const DECIMALS: usize>(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        const { assert!(0 < DECIMALS && DECIMALS <= 8) };
        let at = self.put_signed(i, place);
        place[at..at + 8].copy_from_slice(&self.tail[i].to_le_bytes());
        if DECIMALS == 8 {
            let [.., last] = self.part[i].to_le_bytes();
            place[at + 8] = last;
        }
        if DECIMALS >= 7 {
            place[at + DECIMALS + 1] = b',';
        }
        at + DECIMALS + 2
    }

    /// Writes a number, which is not below zero, without its decimals, and a comma; their bytes.
    #[inline(always)]
    pub(crate) fn put_whole(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        let (whole, len) = without_zeros(self.whole[i]);
        place[..8].copy_from_slice(&whole.to_le_bytes());
        place[len] = b',';
        len + 1
    }

    /// Writes a number of so many decimals; its bytes.
    #[inline(always)]
    fn put_any(&self, i: usize, decimals: u8, place: &mut [u8; Fixed::SIZE]) -> usize {
        let at = self.put_signed(i, place);
        place[at] = b'.';
        place[at + 1..at + 9].copy_from_slice(&self.part[i].to_le_bytes());
        at + 1 + usize::from(decimals)
    }

    /// Writes what stands before the point.
    #[inline(always)]
    fn put_signed(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        let minus = usize::from(self.minus[i] > 0);
        let (whole, len) = without_zeros(self.whole[i]);
        place[0] = b'-';
        place[minus..minus + 8].copy_from_slice(&whole.to_le_bytes());
        minus + len
    }
}

/// Up to eight numbers, to be printed instead of others.
pub(crate) struct Numbers {
    scale: Scale,
    /// Decimals of the others, and of these.
    was: [u8; SIDE],
    decimals: [u8; SIDE],
    /// Of eight decimals as text, those that only these have; or any bit where there are none.
    added: [u64; SIDE],
    any: [u64; SIDE],
    digits: Digits,
    /// 1 where all of these are zeros: maybe nothing is new.
    zeros: [u64; SIDE],
    /// What a reader gets, and one of single precision.
    pub(crate) values: [f64; SIDE],
    pub(crate) held: [f64; SIDE],
}

impl Numbers {
    /// Instead of numbers of so many decimals each; `least` each are printed, but at least one and at most eight.
    pub(crate) fn new(was: [u8; SIDE], least: [u8; SIDE]) -> Option<Self> {
        let mut numbers = Self {
            scale: Scale::NONE,
            was,
            decimals: [0; SIDE],
            added: [0; SIDE],
            any: [1; SIDE],
            digits: Digits::default(),
            zeros: [0; SIDE],
            values: [0.0; SIDE],
            held: [0.0; SIDE],
        };
        for i in 0..SIDE {
            let decimals = was[i].max(least[i]);
            if !(1..=8).contains(&decimals) {
                return None;
            }
            numbers.decimals[i] = decimals;
            numbers.scale.set(i, decimals.into());
            if was[i] < decimals {
                let digits = |count: u8| u64::MAX.unbounded_shr(64 - 8 * u32::from(count));
                (numbers.added[i], numbers.any[i]) = ((digits(decimals) & !digits(was[i])) & !ZEROS, 0);
            }
        }
        Some(numbers)
    }

    /// Whether they stand instead of numbers of so many decimals.
    #[inline]
    pub(crate) fn are_instead_of(&self, was: [u8; SIDE]) -> bool {
        self.was == was
    }

    /// Finds the digits; false where [`Fixed`] has to look closer at one.
    #[inline]
    pub(crate) fn read(&mut self, values: &[f64; SIDE]) -> bool {
        widest!(<'a>(numbers: &'a mut Numbers = self, values: &'a [f64; SIDE] = values) {
            let (digits, number) = numbers.scale.digits(*values);
            let added = zip(digits.part, numbers.added, |part, added| part & added);
            numbers.zeros = zip(added, numbers.any, |added, any| u64::from(added | any == 0));
            let size = zip(number, numbers.scale.tens, |number, ten| number / ten);
            let signed = |size: f64, minus: u64| f64::from_bits(size.to_bits() | minus << 63);
            numbers.values = zip(size, digits.minus, signed);
            #[allow(clippy::cast_possible_truncation)] // that is what the reader does
            let held = map(size, |size| f64::from(size as f32));
            numbers.held = zip(held, digits.minus, signed);
            numbers.digits = digits;
        });
        self.digits.unsure.iter().fold(0, |any, one| any | one) == 0
    }

    /// Whether a number can be what stood there, with fewer decimals.
    #[inline]
    pub(crate) fn may_be_the_same(&self, i: usize) -> bool {
        self.zeros[i] != 0
    }

    /// Writes a number to the beginning of a place for it; its bytes.
    #[inline]
    pub(crate) fn put(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        self.digits.put_any(i, self.decimals[i], place)
    }
}
