//! Reads lines that differ from another only in digits: it compares all bytes at once, and reads all digits at once.

use super::literal::{Literal, POSE};
use super::value::{MAX_NORM_ERROR, unit};
use deflex_lanes::widest;
use deflex_text::number::{MOST_DIGITS, Runs};

/// Most bytes of a line that is compared at once.
const ROOM: usize = 256;

/// Bytes that are compared side by side.
const CHUNK: usize = 64;

/// Eight bytes are read at each number, so the window extends beyond the line.
const WINDOW: usize = ROOM + 8;

/// The shape of a line: the bytes that a line of the same shape may have in each column.
pub(super) struct Shape {
    /// The smallest byte, and the largest excess over it.
    least: [u8; ROOM],
    more: [u8; ROOM],
    /// For each number, the starts of the eight bytes that end with its digits before the point and after it.
    starts: [[u8; 8]; 2],
    runs: Runs,
    /// Length of a line, bytes.
    len: usize,
    ahead: Ahead,
}

/// Lines that are read together.
const AHEAD: usize = 8;

/// Poses of following lines, read ahead, so that none is read right after it was written to memory.
#[derive(Default)]
struct Ahead {
    /// The start of the last line, the distance to the next line whose pose is read, and its index.
    last: usize,
    step: usize,
    next: usize,
    count: usize,
    /// The seven numbers of each pose; the eighth is unused.
    numbers: [[f64; 8]; AHEAD],
    /// The poses.
    poses: [Pose; AHEAD],
    /// Whether each pose has the usual form; other poses need the full reader.
    usual: [bool; AHEAD],
}

impl Shape {
    /// The shape of a line whose literal begins at `literal_at`; `None` if a number has an unusual form.
    pub(super) fn new(line: &[u8], literal_at: usize, literal: &Literal) -> Option<Self> {
        let mut shape = Self {
            least: [0; ROOM],
            more: [u8::MAX; ROOM],
            starts: [[0; 8]; 2],
            runs: Runs::default(),
            len: line.len(),
            ahead: Ahead::default(),
        };
        shape.least.get_mut(..line.len())?.copy_from_slice(line);
        shape.more[..line.len()].fill(0);
        for k in 0..POSE {
            let token = literal.token(k).range();
            let at = literal_at + token.start - literal.span().range().start;
            let (end, decimals) = (at + token.len(), literal.decimals(k)?);
            let negative = *line.get(at)? == b'-';
            let first = at + usize::from(negative);
            let point = if decimals > 0 { end - decimals - 1 } else { end };
            let whole = point.checked_sub(first)?;
            if whole + decimals > MOST_DIGITS || !shape.runs.set(k, negative, whole, decimals) {
                return None;
            }
            for (starts, end) in shape.starts.iter_mut().zip([point, end]) {
                starts[k] = u8::try_from(end.checked_sub(8)?).ok()?;
            }
            for digits in [first..point, end - decimals..end] {
                shape.least.get_mut(digits.clone())?.fill(b'0');
                shape.more.get_mut(digits)?.fill(9);
            }
            if whole > 1 {
                // A leading zero is an unusual form.
                (shape.least[first], shape.more[first]) = (b'1', 8);
            }
        }
        Some(shape)
    }

    /// Whether the line at `start` has this shape, so that its [pose](Self::pose) is known. False also if too little text
    /// follows. All calls must be for the same text.
    #[inline]
    pub(super) fn read(&mut self, text: &[u8], start: usize) -> bool {
        let step = start.wrapping_sub(std::mem::replace(&mut self.ahead.last, start));
        if self.ahead.next == self.ahead.count || self.ahead.step != step {
            // Most lines keep the distance of the last two, even with other lines between them.
            self.ahead.step = if (self.len..self.len + ROOM).contains(&step) { step } else { self.len };
            self.read_ahead(text, start);
        }
        let known = self.ahead.usual[..self.ahead.count].get(self.ahead.next).copied().unwrap_or(false);
        self.ahead.next += usize::from(known);
        known
    }

    /// The pose of the line that was read last.
    #[inline]
    pub(super) fn pose(&self) -> &Pose {
        &self.ahead.poses[(self.ahead.next + AHEAD - 1) % AHEAD]
    }

    /// Reads the line at `start` and the following ones, as long as they have this shape.
    #[inline(never)]
    fn read_ahead(&mut self, text: &[u8], start: usize) {
        let mut digits = [[[0; 8]; 2]; AHEAD];
        (self.ahead.next, self.ahead.count) = (0, 0);
        for digits in &mut digits {
            let line =
                text.get(start + self.ahead.count * self.ahead.step..).and_then(|text| text.first_chunk::<WINDOW>());
            let Some(line) = line else { break };
            let mut others = true;
            widest!(<'a>(
                shape: &'a Shape = self,
                line: &'a [u8; WINDOW] = line,
                others: &'a mut bool = &mut others,
            ) {
                *others = shape.has_others(line);
            });
            if others {
                break;
            }
            for (digits, starts) in digits.iter_mut().zip(&self.starts) {
                for k in 0..POSE {
                    let eight = line[usize::from(starts[k])..].first_chunk();
                    digits[k] = eight.map_or(0, |eight| u64::from_le_bytes(*eight));
                }
            }
            self.ahead.count += 1;
        }
        let Ahead { count, numbers, poses, usual, .. } = &mut self.ahead;
        for (digits, numbers) in digits[..*count].iter().zip(&mut *numbers) {
            widest!(<'a>(
                runs: &'a Runs = &self.runs,
                digits: &'a [[u64; 8]; 2] = digits,
                numbers: &'a mut [f64; 8] = numbers,
            ) {
                *numbers = runs.read(digits);
            });
        }
        for ((numbers, to), known) in numbers[..*count].iter().zip(poses).zip(usual) {
            let [x, y, z, quat @ .., _] = *numbers;
            // A negative zero is an unusual form.
            let usual = numbers.iter().all(|number| number.to_bits() != (-0.0_f64).to_bits());
            let pose = pose([x, y, z], quat).filter(|_| usual);
            *known = pose.is_some();
            if let Some(pose) = pose {
                *to = pose;
            }
        }
    }

    /// Whether any byte does not fit the shape.
    #[inline(always)]
    fn has_others(&self, text: &[u8; WINDOW]) -> bool {
        let over = |i: usize| text[i].wrapping_sub(self.least[i]).saturating_sub(self.more[i]);
        let mut any = [0; CHUNK];
        for i in 0..CHUNK {
            any[i] = over(i) | over(i + CHUNK) | over(i + 2 * CHUNK) | over(i + 3 * CHUNK);
        }
        let mut eight = [0; 8];
        for i in 0..8 {
            eight[i] =
                any[i] | any[i + 8] | any[i + 16] | any[i + 24] | any[i + 32] | any[i + 40] | any[i + 48] | any[i + 56];
        }
        u64::from_le_bytes(eight) != 0
    }
}

/// Position, mm, and orientation, of unit norm.
pub(super) type Pose = ([f64; 3], [f64; 4]);

/// The pose of a robtarget; `None` if its orientation is invalid.
#[inline]
pub(super) fn pose(position_mm: [f64; 3], quat: [f64; 4]) -> Option<Pose> {
    let norm = quat.iter().map(|c| c * c).sum::<f64>();
    ((norm - 1.0).abs() <= MAX_NORM_ERROR).then(|| (position_mm, unit(quat)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A number's sign, its digits before the point and after it.
    type Layout = (bool, usize, usize);

    /// A line, with more text after it.
    fn text(layouts: &[Layout], mut digit: impl FnMut() -> u8) -> (Vec<u8>, usize) {
        let mut digits = |count: usize| (0..count).map(|_| char::from(b'0' + digit())).collect::<String>();
        let numbers: Vec<String> = layouts
            .iter()
            .map(|(negative, whole, decimals)| {
                let (sign, point) = (if *negative { "-" } else { "" }, if *decimals > 0 { "." } else { "" });
                format!("{sign}{}{point}{}", digits(*whole), digits(*decimals))
            })
            .collect();
        let (position, quat) = numbers.split_at(3);
        let literal = format!("[[{}],[{}],[0,-1,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]]", position.join(","), quat.join(","));
        let line = format!("  MoveL {literal},v50,z1,tA;\n");
        ((line.clone() + &"x".repeat(WINDOW)).into_bytes(), line.len())
    }

    fn of(text: &[u8], len: usize) -> Option<Shape> {
        Shape::new(&text[..len], 8, &Literal::find(text, 0, 8).unwrap())
    }

    /// The pose of the line at `start`, if the line has the shape.
    fn read(shape: &mut Shape, text: &[u8], start: usize) -> Option<Pose> {
        shape.read(text, start).then(|| *shape.pose())
    }

    fn plain(text: &[u8]) -> Option<[u64; POSE]> {
        let (_, written) = Literal::read(text, 0, 8)?;
        pose(written.position_mm, written.quat).map(bits)
    }

    fn bits(([x, y, z], [a, b, c, d]): Pose) -> [u64; POSE] {
        [x, y, z, a, b, c, d].map(f64::to_bits)
    }

    proptest! {
        #[test]
        fn a_line_like_another_has_its_own_numbers(
            layouts in prop::array::uniform7((any::<bool>(), 1..7_usize, 0..9_usize)),
            digits in prop::collection::vec(0..10_u8, 7 * 15),
            at in 0..120_usize,
            byte in prop_oneof![1 => any::<u8>(), 3 => b'0'..=b'9'],
        ) {
            let (first, len) = text(&layouts, || 1);
            let mut shape = of(&first, len).unwrap();
            let mut digits = digits.into_iter();
            let (mut other, _) = text(&layouts, || digits.next().unwrap());
            let usual = of(&other, len).is_some();
            prop_assert_eq!(read(&mut shape, &other, 0).map(bits), plain(&other).filter(|_| usual));
            // Change any one byte.
            let at = at.min(len - 1);
            other[at] = byte;
            if let Some(pose) = read(&mut of(&first, len).unwrap(), &other, 0) {
                prop_assert_eq!(Some(bits(pose)), plain(&other));
                let around = |text: &[u8]| text[..len].split(|b| *b == b'[').map(<[u8]>::to_vec).collect::<Vec<_>>();
                let (own, others) = (around(&first), around(&other));
                prop_assert_eq!((&own[0], &own[4..]), (&others[0], &others[4..]));
            }
        }

        #[test]
        fn lines_are_read_ahead_up_to_another(
            layouts in prop::array::uniform7((any::<bool>(), 1..4_usize, 0..5_usize)),
            seed in 1..9_u8,
            count in 1..20_usize,
        ) {
            let (first, len) = text(&layouts, || 1);
            let mut shape = of(&first, len).unwrap();
            let lines: Vec<Vec<u8>> = (0..count).map(|i| text(&layouts, || 1 + (seed + i as u8) % 9).0[..len].to_vec()).collect();
            let all = [lines.concat(), vec![b'x'; WINDOW]].concat();
            for (i, line) in lines.iter().enumerate() {
                prop_assert_eq!(read(&mut shape, &all, i * len).map(bits), plain(line));
            }
            prop_assert_eq!(read(&mut shape, &all, count * len), None);
            prop_assert_eq!(read(&mut shape, &all, 0).map(bits), plain(&lines[0]));
        }
    }
}
