//! Writes RAPID modules chunk by chunk.

use super::data::{robtarget, speeddata, speeds, tooldata, wobjdata};
use super::names::{SAME_SPEED, identifier, predefined_speed};
use super::plan::PostPlan;
use super::zone::{FINE, radius, zone};
use crate::EXTERNAL_AXES;
use crate::{Confdata, Mark};
use deflex_text::number::write_whole;
use std::sync::Arc;

/// A point of a posted program.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct PostedPoint {
    /// TCP in the work object, mm.
    pub position_mm: [f64; 3],
    /// Orientation in the work object, scalar first, unit norm.
    pub quat: [f64; 4],
    /// Configuration of the joints there.
    pub conf: Confdata,
    /// Whole turns of axes 1, 4, 6 there, as FANUC numbers them.
    pub turns: [i32; 3],
    /// Speed of the motion to the point, mm/s; rapid travel has that of the plan.
    pub speed_mm_s: f64,
    /// Whether it is reached in rapid travel.
    pub rapid: bool,
    /// Whether the motion stops at the point in any case.
    pub stop: bool,
    /// Whether the path to it is unknown, as after a tool change: then the motion is a joint motion, not a straight line.
    pub joint: bool,
    /// Instructions before the motion, one on each line.
    pub lines: Option<Arc<str>>,
    /// Mark in force.
    pub mark: Option<Mark>,
    /// Index into [`PostPlan::tools`].
    pub tool: u16,
    /// Index into [`PostPlan::wobjs`].
    pub wobj: u16,
    /// Positions of the external axes, mm or degrees; `None` for those of the plan.
    pub external: Option<Box<[Option<f64>; EXTERNAL_AXES]>>,
}

/// Text of a program: the continuation of the present file, and further files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[doc(hidden)]
pub struct Text {
    /// All bytes, one file after the other.
    pub bytes: Vec<u8>,
    /// Offsets at which new files begin, with their names (`part.mod`).
    pub files: Vec<(usize, String)>,
}

impl Text {
    fn line(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(b'\n');
    }

    fn start(&mut self, module: &str) {
        self.files.push((self.bytes.len(), format!("{module}.mod")));
        self.line(&format!("MODULE {module}"));
    }

    fn instructions(&mut self, lines: &str) {
        for line in lines.lines() {
            self.line(&format!("    {line}"));
        }
    }

    fn end(&mut self) {
        self.line("  ENDPROC\nENDMODULE");
    }
}

/// The position up to which a program is written, from which the next chunk continues.
#[derive(Clone, Debug, Default, PartialEq)]
#[doc(hidden)]
pub struct WriterPosition {
    /// Points written.
    written: usize,
    /// The last of them.
    before: Option<PostedPoint>,
    /// The point that waits for the next one, on which its zone depends.
    waiting: Option<PostedPoint>,
}

impl WriterPosition {
    /// Whether the point that waits is the program's first.
    pub(super) fn is_first(&self) -> bool {
        self.before.is_none()
    }

    /// The last point that is written.
    pub(super) fn point_before(&self) -> Option<&PostedPoint> {
        self.before.as_ref()
    }

    /// The position after further points, of which all except the last are written.
    #[must_use]
    pub fn after(&self, points: &[PostedPoint]) -> Self {
        let mut known = [&self.before, &self.waiting].into_iter().flatten().chain(points).rev();
        let waiting = known.next().cloned();
        let count = usize::from(self.waiting.is_some()) + points.len();
        Self { written: self.written + count.saturating_sub(1), before: known.next().cloned(), waiting }
    }
}

/// Writes a program as one module, or as parts and a main module that loads and calls them.
///
/// The head comes first, then chunks of points, each from its [`WriterPosition`] on; any thread may write any chunk.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct PostWriter {
    pub(super) plan: PostPlan,
    module: String,
    /// Names of the declared speeds, slowest first.
    speeds: Vec<(f64, String)>,
    /// Points of a part, if the program has parts.
    pub(super) part: Option<usize>,
    head: Text,
}

/// Longest ending of a part's names: `_12345_run`.
const ENDING: usize = 10;

impl PostWriter {
    /// Makes the layout of the program: its declarations and parts.
    #[must_use]
    pub fn new(plan: PostPlan) -> Self {
        let module = identifier(&plan.name, ENDING);
        let part = plan.max_points.map(|most| most.max(1)).filter(|most| plan.points > *most);
        let mut post = Self { plan, module, speeds: Vec::new(), part, head: Text::default() };
        post.declare();
        post
    }

    /// The plan of the layout.
    #[must_use]
    pub(crate) fn plan(&self) -> &PostPlan {
        &self.plan
    }

    /// Number of files of the program.
    #[must_use]
    pub fn files(&self) -> usize {
        1 + self.part.map_or(0, |most| self.plan.points.div_ceil(most))
    }

    /// Declarations and, for a program with parts, all of the main module except its end.
    #[must_use]
    pub fn head(&self) -> &Text {
        &self.head
    }

    fn declare(&mut self) {
        let (mut text, module) = (Text::default(), &self.module);
        text.start(module);
        self.plan.plain_title().for_each(|line| text.line(&format!("  ! {line}")));
        for (name, data) in self.plan.tools.iter().filter(|(n, _)| !n.eq_ignore_ascii_case("tool0")) {
            tooldata(&mut text.bytes, name, data);
        }
        for (i, (name, data)) in
            self.plan.wobjs.iter().enumerate().filter(|(_, (n, _))| !n.eq_ignore_ascii_case("wobj0"))
        {
            let unit = self.plan.units.get(i).and_then(Option::as_deref);
            wobjdata(&mut text.bytes, name, data, unit.unwrap_or_default());
        }
        let all = [&self.plan.speeds[..], &[self.plan.rapid_mm_s]].concat();
        self.speeds = speeds(&mut text.bytes, &all);
        self.speeds.sort_by(|a, b| a.0.total_cmp(&b.0));
        text.line("\n  PROC main()\n    ConfL\\On;\n    ConfJ\\On;");
        for part in 1..self.files() {
            text.line(&format!("    Load\\Dynamic,diskhome\\File:=\"{module}_{part}.mod\";"));
            text.line(&format!("    %\"{module}_{part}_run\"%;"));
            text.line(&format!("    UnLoad diskhome\\File:=\"{module}_{part}.mod\";"));
        }
        self.head = text;
    }

    /// The text of points from a position on. The last point waits for the next chunk. The last chunk ends with the instructions of `end`, one
    /// on each line.
    #[must_use]
    pub fn chunk(&self, from: &WriterPosition, points: &[PostedPoint], end: Option<&str>) -> Text {
        let mut text = Text { bytes: Vec::with_capacity(A_LINE * points.len()), files: Vec::new() };
        let mut place = from.clone();
        for point in points {
            self.movement(&mut text, &place, Some(point));
            place = place.after(std::slice::from_ref(point));
        }
        if let Some(lines) = end {
            self.movement(&mut text, &place, None);
            text.instructions(lines);
            text.end();
        }
        text
    }

    /// Writes the motion to the waiting point of a position.
    fn movement(&self, text: &mut Text, place: &WriterPosition, next: Option<&PostedPoint>) {
        let Some(point) = &place.waiting else { return };
        let part = self.part.filter(|most| place.written.is_multiple_of(*most)).map(|most| place.written / most + 1);
        if let Some(part) = part {
            text.end();
            text.start(&format!("{}_{part}", self.module));
            text.line(&format!("  PROC {}_{part}_run()", self.module));
        }
        text.instructions(point.lines.as_deref().unwrap_or_default());
        // Repeated in a part, so that each module is right by itself.
        let marked = place.before.as_ref().and_then(|before| before.mark).filter(|_| part.is_none());
        if marked != point.mark {
            point.mark.iter().for_each(|mark| text.line(&format!("    ! {}", mark.comment())));
        }
        let line = &mut text.bytes;
        // The path to the first point is unknown: a joint motion, not a straight line.
        let joint = place.before.is_none() || point.joint;
        line.extend_from_slice(if joint { b"    MoveJ " } else { b"    MoveL " });
        robtarget(line, &point.position_mm, &point.quat, point.conf, self.external(point));
        line.push(b',');
        self.speed(line, self.speed_mm_s(point));
        line.push(b',');
        line.extend_from_slice(self.zone_at(place, point, next));
        line.push(b',');
        let tool = self.plan.tools.get(usize::from(point.tool)).map_or("tool0", |t| t.0.as_str());
        let wobj = self.plan.wobjs.get(usize::from(point.wobj)).map_or("wobj0", |w| w.0.as_str());
        line.extend_from_slice(tool.as_bytes());
        line.extend_from_slice(b"\\WObj:=");
        line.extend_from_slice(wobj.as_bytes());
        line.extend_from_slice(b";\n");
    }

    /// Speed of the motion to a point, mm/s.
    pub(super) fn speed_mm_s(&self, point: &PostedPoint) -> f64 {
        if point.rapid { self.plan.rapid_mm_s } else { point.speed_mm_s }
    }

    /// Largest distance of the rounding from a point, mm; `None` if the arm stops there, or reaches `next` from rest or by a joint motion.
    pub(super) fn corner_mm(
        &self,
        place: &WriterPosition,
        point: &PostedPoint,
        next: Option<&PostedPoint>,
    ) -> Option<f64> {
        let next = next.filter(|next| next.lines.is_none() && !next.joint && next.tool == point.tool)?;
        radius(self.zone_at(place, point, Some(next)))
    }

    /// Positions of the external axes at a point.
    pub(super) fn external<'a>(&'a self, point: &'a PostedPoint) -> &'a [Option<f64>; EXTERNAL_AXES] {
        point.external.as_deref().unwrap_or(&self.plan.external)
    }

    fn speed(&self, line: &mut Vec<u8>, mm_s: f64) {
        if let Some(v) = predefined_speed(mm_s) {
            line.push(b'v');
            write_whole(line, v);
            return;
        }
        let from = self.speeds.partition_point(|(v, _)| *v <= mm_s - SAME_SPEED);
        match self.speeds.get(from).filter(|(v, _)| (v - mm_s).abs() < SAME_SPEED) {
            Some((_, name)) => line.extend_from_slice(name.as_bytes()),
            None => speeddata(line, mm_s),
        }
    }

    pub(super) fn zone_at(
        &self,
        place: &WriterPosition,
        point: &PostedPoint,
        next: Option<&PostedPoint>,
    ) -> &'static [u8] {
        let (Some(before), Some(next)) = (&place.before, next) else { return FINE };
        // The tool stops before it enters the material.
        let enters = point.rapid && !next.rapid;
        let ends_part = self.part.is_some_and(|most| (place.written + 1).is_multiple_of(most));
        // With a zone, the controller would run the instructions early.
        if point.stop || enters || ends_part || next.lines.is_some() || next.joint {
            return FINE;
        }
        let [q, p, n] = [before.position_mm, point.position_mm, next.position_mm];
        zone(q, p, n, point.rapid, self.plan.corner_tolerance_mm)
    }
}

/// Reserved bytes for a line.
const A_LINE: usize = 160;
