//! Prints numbers of few digits, eight at once.

use super::TENS;
use super::write::{FROM_TIE, Fixed, INTEGERS, SMALL, ZEROS, bits_of_zeros};
use deflex_lanes::widest;

/// Number of values that are converted in parallel.
#[doc(hidden)]
pub const SIDE: usize = 8;

/// The format of rows with `8 · BLOCKS` numbers: the number of decimals of each.
#[doc(hidden)]
pub struct Row<const BLOCKS: usize> {
    scales: [Scale; BLOCKS],
}

/// The format of eight numbers.
struct Scale {
    /// 10^decimals, its inverse, and the factor that extends the decimals to eight digits.
    tens: [f64; SIDE],
    tenths: [f64; SIDE],
    fill: [f64; SIDE],
    /// Number of bits of the decimals as text, and of the digits before them in a text of eight digits.
    part: [u64; SIDE],
    rest: [u64; SIDE],
    /// For up to seven decimals: the text of the point before the decimals with the number of its bits, and of the
    /// comma after them.
    point: [u64; SIDE],
    marks: [u64; SIDE],
}

/// Eight numbers as text. The first character is the lowest byte.
#[derive(Clone, Copy, Default)]
#[doc(hidden)]
pub struct Digits {
    /// The text before the point, and its length in bytes, at most eight.
    head: [u64; SIDE],
    len: [u64; SIDE],
    /// The digits after the point. They include the point, and the comma after them, if there is room.
    tail: [u64; SIDE],
}

impl<const BLOCKS: usize> Row<BLOCKS> {
    /// A format with one to eight decimals for each number. The row is filled with zeros to a multiple of eight.
    pub const fn new(decimals: &[usize]) -> Self {
        let mut scales = [Scale::NONE; BLOCKS];
        let mut i = 0;
        while i < decimals.len() {
            scales[i / SIDE].set(i % SIDE, decimals[i]);
            if decimals[i] < 8 {
                scales[i / SIDE].mark(i % SIDE, decimals[i]);
            }
            i += 1;
        }
        Self { scales }
    }

    /// Finds the digits of all numbers. Returns false if [`write_fixed`](super::write_fixed) has to convert one of
    /// them.
    pub fn read(&self, values: &[[f64; SIDE]; BLOCKS], digits: &mut [Digits; BLOCKS]) -> bool {
        let mut valid = [false; BLOCKS];
        widest!(<'a>(
            scales: &'a [Scale] = &self.scales,
            values: &'a [[f64; SIDE]] = values,
            digits: &'a mut [Digits] = digits,
            valid: &'a mut [bool] = &mut valid,
        ) {
            for (((scale, values), digits), valid) in scales.iter().zip(values).zip(digits).zip(valid) {
                (*digits, *valid) = scale.eight(*values);
            }
        });
        (0..BLOCKS).all(|block| valid[block] || self.scales[block].nine_digits(&values[block], &mut digits[block]))
    }
}

impl Scale {
    const NONE: Self = Self {
        tens: [1.0; SIDE],
        tenths: [1.0; SIDE],
        fill: [1.0; SIDE],
        part: [0; SIDE],
        rest: [64; SIDE],
        point: [0; SIDE],
        marks: [0; SIDE],
    };

    const fn set(&mut self, i: usize, decimals: usize) {
        assert!(0 < decimals && decimals <= 8);
        self.tens[i] = TENS[decimals];
        self.tenths[i] = 1.0 / TENS[decimals];
        self.fill[i] = TENS[8 - decimals];
        self.part[i] = 8 * decimals as u64;
        self.rest[i] = 64 - self.part[i];
    }

    /// Adds the point and the comma to the text of the decimals.
    const fn mark(&mut self, i: usize, decimals: usize) {
        self.point[i] = 8;
        self.marks[i] = b'.' as u64 | (b',' as u64).unbounded_shl(8 * (decimals as u32 + 1));
    }

    /// Finds the digits of numbers with at most nine digits, which few numbers have. Returns false if a number needs
    /// [`write_fixed`](super::write_fixed).
    fn nine_digits(&self, values: &[f64; SIDE], digits: &mut Digits) -> bool {
        let mut valid = false;
        widest!(<'a>(
            scale: &'a Scale = self,
            values: &'a [f64; SIDE] = values,
            digits: &'a mut Digits = digits,
            valid: &'a mut bool = &mut valid,
        ) {
            (*digits, *valid) = scale.nine(*values);
        });
        valid
    }

    /// The numbers without their points, and 1 for those that are not valid. Here and below, each step is done for all
    /// eight numbers, so that the compiler uses vector instructions.
    #[inline(always)]
    fn rounded(&self, values: [f64; SIDE]) -> ([f64; SIDE], [u64; SIDE]) {
        let product = zip(values, self.tens, |value, ten| value.abs() * ten);
        let number = map(product, |product| product + INTEGERS - INTEGERS);
        let unsure = zip(product, number, |product, number| {
            u64::from(!((product < SMALL) & ((product - number).abs() < 0.5 - FROM_TIE)))
        });
        (number, unsure)
    }

    /// The digits of numbers with at most eight digits. Others are not valid.
    #[inline(always)]
    fn eight(&self, values: [f64; SIDE]) -> (Digits, bool) {
        let (number, unsure) = self.rounded(values);
        let unsure = zip(unsure, number, |unsure, number| unsure | u64::from(number >= EIGHT_DIGITS));
        let text = to_integers(number);
        // The digits before the point are extended to eight with leading zeros.
        let whole = zip(text, self.part, |text, part| text.unbounded_shl(part as u32));
        let zeros = map(self.rest, |rest| ZEROS.unbounded_shr(rest as u32));
        let part = zip(text, self.rest, |text, rest| text.unbounded_shr(rest as u32));
        self.printed(values, number, zip(whole, zeros, |whole, zeros| whole | zeros), part, unsure)
    }

    /// The digits of numbers with at most nine digits.
    #[inline(always)]
    fn nine(&self, values: [f64; SIDE]) -> (Digits, bool) {
        let (number, unsure) = self.rounded(values);
        // Adding one half puts the number between two multiples of ten, where the rounding of the product has no
        // effect.
        let whole = zip(number, self.tenths, |number, tenth| ((number + 0.5) * tenth).floor());
        let rest = zip(number, zip(whole, self.tens, |whole, ten| whole * ten), |number, whole| number - whole);
        let text = to_integers(zip(rest, self.fill, |rest, fill| rest * fill));
        let own = map(self.rest, |rest| u64::MAX.unbounded_shr(rest as u32));
        let part = zip(text, own, |text, own| text & own);
        // Eight digits before the point leave no room for a minus sign.
        let full = zip(values, whole, |value, whole| u64::from((value < 0.0) & (whole >= SEVEN_DIGITS)));
        self.printed(values, number, to_integers(whole), part, zip(unsure, full, |unsure, full| unsure | full))
    }

    /// Puts together the text before and after the point, given the eight digits before it.
    #[inline(always)]
    fn printed(
        &self,
        values: [f64; SIDE],
        number: [f64; SIDE],
        whole: [u64; SIDE],
        part: [u64; SIDE],
        unsure: [u64; SIDE],
    ) -> (Digits, bool) {
        let zeros = map(whole, bits_of_zeros);
        let bare = zip(whole, zeros, |whole, zeros| whole >> zeros);
        let minus = minus(values, number);
        let head = zip(bare, minus, |bare, minus| (bare << (8 * minus)) | (u64::from(b'-') * minus));
        let len = zip(zeros, minus, |zeros, minus| 8 - zeros / 8 + minus);
        let part = zip(part, self.point, |part, point| part << (point & 63));
        let tail = zip(part, self.marks, |part, marks| part | marks);
        (Digits { head, len, tail }, unsure.iter().fold(0, |any, one| any | one) == 0)
    }
}

/// 1 for each number with a minus sign.
#[inline(always)]
fn minus(values: [f64; SIDE], number: [f64; SIDE]) -> [u64; SIDE] {
    zip(values, number, |value, number| u64::from((value < 0.0) & (number > 0.0)))
}

/// Numbers below these have at most seven or eight digits.
const SEVEN_DIGITS: f64 = 1e7;
const EIGHT_DIGITS: f64 = 1e8;

/// [`eight`](super::write::eight) of each number.
#[inline(always)]
fn to_integers(numbers: [f64; SIDE]) -> [u64; SIDE] {
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
    /// Writes number `i` with its decimals and a comma to the start of `place`. Returns the length in bytes.
    #[inline(always)]
    pub fn put<const DECIMALS: usize>(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        const { assert!(0 < DECIMALS && DECIMALS <= 8) };
        if DECIMALS == 8 {
            let len = self.put_any(i, 8, place);
            place[len] = b',';
            return len + 1;
        }
        let at = self.put_head(i, place);
        place[at..at + 8].copy_from_slice(&self.tail[i].to_le_bytes());
        if DECIMALS == 7 {
            place[at + 8] = b',';
        }
        at + DECIMALS + 2
    }

    /// Writes number `i` without decimals, and a comma. Returns the length in bytes.
    #[inline(always)]
    pub fn put_whole(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        let at = self.put_head(i, place);
        place[at] = b',';
        at + 1
    }

    /// Writes number `i` with its decimals, without a comma. Returns the length in bytes.
    #[inline(always)]
    fn put_any(&self, i: usize, decimals: u8, place: &mut [u8; Fixed::SIZE]) -> usize {
        let at = self.put_head(i, place);
        place[at] = b'.';
        place[at + 1..at + 9].copy_from_slice(&self.tail[i].to_le_bytes());
        at + 1 + usize::from(decimals)
    }

    /// Writes the text before the point. Returns its length in bytes.
    #[inline(always)]
    fn put_head(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        place[..8].copy_from_slice(&self.head[i].to_le_bytes());
        // The length is at most eight. The mask shows that to the compiler.
        (self.len[i] & 15) as usize
    }
}

/// The format of up to eight numbers that replace others.
#[doc(hidden)]
pub struct Numbers {
    scale: Scale,
    decimals: [u8; SIDE],
}

/// Numbers that replace others, as text.
#[derive(Clone, Copy, Default)]
#[doc(hidden)]
pub struct Printed {
    digits: Digits,
    decimals: [u8; SIDE],
    /// The values that a reader of the text gets, and the same in single precision.
    pub values: [f64; SIDE],
    pub held: [f64; SIDE],
}

impl Numbers {
    /// A format with one to eight decimals for each number.
    pub fn new(decimals: [u8; SIDE]) -> Option<Self> {
        let mut scale = Scale::NONE;
        for i in 0..SIDE {
            if !(1..=8).contains(&decimals[i]) {
                return None;
            }
            scale.set(i, decimals[i].into());
        }
        Some(Self { scale, decimals })
    }

    /// Whether the format has these numbers of decimals.
    #[inline]
    pub fn have(&self, decimals: [u8; SIDE]) -> bool {
        self.decimals == decimals
    }

    /// Finds the digits. Returns false if [`Fixed`] has to convert one of the numbers.
    #[inline]
    pub fn print(&self, values: &[f64; SIDE], printed: &mut Printed) -> bool {
        let mut valid = false;
        printed.decimals = self.decimals;
        widest!(<'a>(
            numbers: &'a Numbers = self,
            values: &'a [f64; SIDE] = values,
            printed: &'a mut Printed = printed,
            valid: &'a mut bool = &mut valid,
        ) {
            (printed.digits, *valid) = numbers.scale.eight(*values);
            let (number, _) = numbers.scale.rounded(*values);
            let minus = minus(*values, number);
            let size = zip(number, numbers.scale.tens, |number, ten| number / ten);
            let signed = |size: f64, minus: u64| f64::from_bits(size.to_bits() | minus << 63);
            #[allow(clippy::cast_possible_truncation)] // that is what the reader does
            let held = map(size, |size| f64::from(size as f32));
            printed.values = zip(size, minus, signed);
            printed.held = zip(held, minus, signed);
        });
        valid || self.scale.nine_digits(values, &mut printed.digits)
    }
}

impl Printed {
    /// Whether number `i` can be equal to the number that it replaces, which has `was` decimals: it has more decimals, and those
    /// beyond `was` are zeros.
    #[inline]
    pub fn may_be_the_same(&self, i: usize, was: u8) -> bool {
        was < self.decimals[i] && (self.digits.tail[i] & !ZEROS).unbounded_shr(8 * u32::from(was)) == 0
    }

    /// Writes number `i` to the start of `place`. Returns the length in bytes.
    #[inline]
    pub fn put(&self, i: usize, place: &mut [u8; Fixed::SIZE]) -> usize {
        self.digits.put_any(i, self.decimals[i], place)
    }
}
