//! Statements that change the meaning of positions: units, frames, cutter, cycles, compensation.

use super::dialect::Dialect;
use super::frame::Frame;
use super::lex::Record;
use super::reader::Reader;
use super::refusal::Outcome;
use super::statement::Statement;
use super::units::{one_unit, unit_further_down};
use super::vector::{cross, scale};
use crate::lowered::intern;
use crate::{CutterInfo, Reason};

impl Reader {
    pub(super) fn units(&mut self, s: &Statement) -> Outcome {
        let unit = one_unit(s.words()).ok_or(Reason::UnitsUnnamed)?;
        self.set_units(unit);
        Ok(())
    }

    pub(super) fn set_units(&mut self, mm: f64) {
        if self.units == Some(mm) {
            return;
        }
        // The tool stays at its position, which is printed in other units from now on.
        let ratio = self.units.unwrap_or(mm) / mm;
        self.modal.position = self.modal.position.map(|p| scale(p, ratio));
        self.units = Some(mm);
        let now = self.layout.frames.get(self.frame as usize).copied();
        let frame = Frame { mm_per_unit: mm, ..now.unwrap_or(Frame::identity(mm)) };
        self.frame = intern(&mut self.layout.frames, frame);
    }

    pub(super) fn mm_per_unit(&self) -> f64 {
        self.units.unwrap_or(1.0)
    }

    /// A position needs a unit: that of the file, or that of the options. Without one, the file is refused.
    pub(super) fn ensure_units(&mut self, record: Record, s: &Statement) -> Outcome {
        if self.units.is_some() {
            return Ok(());
        }
        match unit_further_down(&s.bytes[record.span.start as usize..]) {
            Some(mm) => {
                self.set_units(mm);
                Ok(())
            }
            None => {
                self.no_unit = Some(record.span);
                Err(Reason::NoUnit)
            }
        }
    }

    /// `CUTTER/d,r,…`, `TLDATA/kind,d,r,…`.
    pub(super) fn read_cutter(&mut self, record: Record, s: &Statement) {
        let mm = self.mm_per_unit();
        let mut numbers = s.number_items().iter();
        if let Some(diameter) = numbers.next().filter(|d| d.value > 0.0) {
            let corner = numbers.next().map_or(0.0, |r| r.value.max(0.0));
            self.set_cutter(record, CutterInfo { diameter_mm: diameter.value * mm, corner_radius_mm: corner * mm });
        }
    }

    pub(super) fn msys(&mut self, s: &Statement) -> Outcome {
        let mm = self.mm_per_unit();
        match s.number_items().first().map(|m| Frame::from_msys(m, mm)) {
            Some(Some(frame)) => {
                self.set_frame(frame, self.dialect.positions_follow_frame() || self.dialect == Dialect::Unknown);
                Ok(())
            }
            _ => Err(Reason::MsysNoFrame),
        }
    }

    pub(super) fn csys(&mut self, s: &Statement) -> Outcome {
        let mm = self.mm_per_unit();
        match s.number_items().first().map(|m| Frame::from_rows(m, mm)) {
            Some(Some(frame)) => {
                self.setup_axis = if self.local { [0.0, 0.0, 1.0] } else { frame.z_axis() };
                self.set_frame(frame, self.local);
                Ok(())
            }
            _ => Err(Reason::CsysNoFrame),
        }
    }

    pub(super) fn origin(&mut self, s: &Statement) -> Outcome {
        let Some(origin) = s.number_items().first::<3>() else { return Err(Reason::OriginNotNumbers) };
        let mm = self.mm_per_unit();
        let (x, z) = match s.number_items().first::<9>() {
            Some(m) => ([m[3], m[4], m[5]], [m[6], m[7], m[8]]),
            None => ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        };
        let [y0, y1, y2] = cross(z, x);
        let m = Frame::from_msys([origin[0], origin[1], origin[2], x[0], x[1], x[2], y0, y1, y2], mm);
        match m {
            Some(frame) if self.base.is_none_or(|base| same_frame(&base, &frame)) => {
                self.set_frame(frame, false);
                Ok(())
            }
            // It depends on the post-processor whether positions follow a second origin.
            _ => Err(Reason::SecondOrigin),
        }
    }

    /// Sets a frame. The first one of the file is the work object. If positions follow frames, further ones are relative to it.
    pub(super) fn set_frame(&mut self, frame: Frame, follow: bool) {
        let base = *self.base.get_or_insert(frame);
        if follow {
            let mm = frame.mm_per_unit;
            let frame = if same_frame(&base, &frame) { Frame::identity(mm) } else { frame.seen_from(&base) };
            let before = self.frame;
            self.frame = intern(&mut self.layout.frames, frame);
            if self.frame != before {
                self.modal.position = None;
                self.modal.from = None;
                self.warn(
                    "cl.several-frames",
                    "positions in several frames: all are taken into the first, the work object",
                );
            }
        } else if !same_frame(&base, &frame) && self.dialect == Dialect::Creo {
            self.warn(
                "cl.several-frames",
                "several CSYS: positions are taken as printed, in the operation's own frame",
            );
        }
    }
}

fn same_frame(a: &Frame, b: &Frame) -> bool {
    *a == Frame { mm_per_unit: a.mm_per_unit, ..*b }
}
