//! Comments and free text that have a meaning: frames, cutters, deflex's own marks.

use super::frame::Frame;
use super::lex::Record;
use super::number::number;
use super::reader::Reader;
use super::state::MatrixRows;
use crate::{CutterInfo, Mark, Reason};

impl Reader {
    pub(super) fn comment(&mut self, record: Record, text: &[u8]) {
        if text.starts_with(b"$$-> CSYS") {
            let values = numbers_in(text);
            if let Some(m) = first_of::<12>(&values)
                && let Some(frame) = Frame::from_rows(m, self.mm_per_unit())
            {
                self.set_frame(frame, false);
            }
        } else if text.starts_with(b"$$-> CUTTER") {
            if let Some([diameter]) = first_of::<1>(&numbers_in(text)) {
                let diameter_mm = diameter * self.mm_per_unit();
                self.set_cutter(record, CutterInfo { diameter_mm, corner_radius_mm: 0.0 });
            }
        } else if text.starts_with(b"$$*CATIA0") {
            self.matrix = MatrixRows { open: true, ..MatrixRows::default() };
        } else if self.matrix.open {
            self.matrix_row(record, text);
        }
    }

    /// A row below `$$*CATIA0`: a name, then three rows of four.
    fn matrix_row(&mut self, record: Record, text: &[u8]) {
        let values = numbers_in(text);
        match (first_of::<4>(&values), values.len()) {
            (Some(row), 4) => {
                self.matrix.values[4 * self.matrix.rows..][..4].copy_from_slice(&row);
                self.matrix.rows += 1;
                self.matrix.open = self.matrix.rows < 3;
                if self.matrix.open {
                    return;
                }
                match Frame::from_rows(self.matrix.values, self.mm_per_unit()) {
                    Some(frame) => self.set_frame(frame, self.dialect.positions_follow_frame()),
                    None => self.refuse(record, Reason::MatrixNoRotation),
                }
            }
            _ if self.matrix.rows > 0 => self.matrix.open = false,
            _ => {}
        }
    }

    /// `PPRINT/DEFLEX AIR` and `PPRINT/DEFLEX CUT`; `INSERT` is text for a numerical control, which is listed.
    pub(super) fn free_text(&mut self, record: Record, text: &[u8]) {
        const MARK: &[u8] = b"PPRINT";
        const INSERT: &[u8] = b"INSERT";
        let begins = |word: &[u8]| text.len() >= word.len() && text[..word.len()].eq_ignore_ascii_case(word);
        if begins(INSERT) {
            self.list(record, Reason::InsertUnwritten);
        } else if begins(MARK) {
            let marked: Vec<u8> = text[MARK.len()..]
                .iter()
                .copied()
                .skip_while(|b| matches!(b, b' ' | b'\t' | b'/' | b'\'' | b'"'))
                .map(|b| b.to_ascii_uppercase())
                .collect();
            let mut words = marked.split(|b| matches!(b, b' ' | b'\t' | b'\'' | b'"' | b',')).filter(|w| !w.is_empty());
            if words.next() == Some(b"DEFLEX") {
                match words.next() {
                    Some(b"AIR") => self.modal.mark = Some(Mark::Air),
                    Some(b"CUT") => self.modal.mark = Some(Mark::Cut),
                    _ => self.list(record, Reason::UnknownMark),
                }
            }
        }
        self.understood += usize::from(text.contains(&b'/'));
    }
}

fn numbers_in(text: &[u8]) -> Vec<f64> {
    text.split(|b| b.is_ascii_whitespace() || matches!(b, b',' | b'/' | b'$')).filter_map(number).collect()
}

fn first_of<const N: usize>(values: &[f64]) -> Option<[f64; N]> {
    values.get(..N)?.try_into().ok()
}
