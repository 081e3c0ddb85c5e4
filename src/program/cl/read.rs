//! Statements to targets: the meaning of each word, with what holds from one to the next.

use super::arc::{Arc, Circle};
use super::dialect::Dialect;
use super::frame::Frame;
use super::layout::{ArcSlot, Slot};
use super::lex::{Lexer, Record, RecordKind, Token};
use super::modal::{INCH_MM, Modal, Xyz};
use super::statement::Statement;
use super::vector::{add, cross, norm, scale, sub, unit};
use super::words::{is_source, is_without_motion};
use super::{ClOptions, Layout, Point, Units};
use crate::program::{CutterInfo, Editable, Goal, Kept, Mark, Motion, Role, Target};
use crate::text::{Diagnostic, Severity, Source, Span};

/// A printed axis shorter or longer than this is no unit vector; four printed digits give 0.9998.
const AXIS_LENGTH: std::ops::Range<f64> = 0.9..1.1;

/// How much a printed triple may differ from unit length to be an axis rather than a further point.
const UNIT_TRIPLE: f64 = 2e-3;

/// Where the unit is looked for before the first statement; further down it counts from there on.
const HEAD: usize = 16 * 1024;

/// Arc read, its end not yet.
#[derive(Clone, Copy, Debug)]
struct PendingArc {
    circle: Circle,
    centres: [Option<Xyz>; 2],
    record: Record,
}

/// Everything that reading collects.
pub(super) struct Reader<'a> {
    source: &'a Source,
    options: &'a ClOptions,
    pub(super) dialect: Dialect,
    modal: Modal,
    pending: Option<PendingArc>,
    units: Option<f64>,
    /// The frame that positions are printed in now: index into the layout's.
    frame: u16,
    /// The file's first frame, in its absolute axes.
    base: Option<Frame>,
    /// z of the frame last named, for systems that drop it from their positions.
    setup_axis: [f64; 3],
    /// Positions are printed in the frame last named (`TRNTYP/LOCAL`).
    local: bool,
    matrix: MatrixRows,
    ordinal: u32,
    /// First target since `INDEX`, which `COPY` repeats.
    index: usize,
    pub(super) targets: Vec<Target>,
    pub(super) kept: Vec<Kept>,
    pub(super) diagnostics: Vec<Diagnostic>,
    pub(super) layout: Layout,
    pub(super) literal_targets: usize,
    pub(super) arcs: usize,
    pub(super) cutter: Option<CutterInfo>,
    /// Statements that only APT-360 source has, and the first of them.
    pub(super) source_words: usize,
    pub(super) first_source_word: Option<Span>,
    /// Statements understood.
    pub(super) understood: usize,
    said: Vec<&'static str>,
}

/// A CATIA matrix in comments: rows still to come.
#[derive(Clone, Copy, Debug, Default)]
struct MatrixRows {
    open: bool,
    rows: usize,
    values: [f64; 12],
}

/// Stops reading: the file as a whole cannot be read.
pub(super) struct Refusal(pub(super) Diagnostic);

impl<'a> Reader<'a> {
    pub(super) fn new(source: &'a Source, options: &'a ClOptions) -> Self {
        Self {
            source,
            options,
            dialect: Dialect::detect(&source.bytes),
            modal: Modal::default(),
            pending: None,
            units: unit_further_down(&source.bytes[..source.bytes.len().min(HEAD)]).or(options.units.map(mm_per_unit)),
            frame: 0,
            base: None,
            setup_axis: [0.0, 0.0, 1.0],
            local: false,
            matrix: MatrixRows::default(),
            ordinal: 0,
            index: 0,
            targets: Vec::new(),
            kept: Vec::new(),
            diagnostics: Vec::new(),
            layout: Layout::default(),
            literal_targets: 0,
            arcs: 0,
            cutter: None,
            source_words: 0,
            first_source_word: None,
            understood: 0,
            said: Vec::new(),
        }
    }

    /// Reads the whole source.
    pub(super) fn run(&mut self) -> Result<(), Refusal> {
        self.layout.frames.push(Frame::identity(self.units.unwrap_or(1.0)));
        let mut lexer = Lexer::new(&self.source.bytes, self.source.lines_before);
        let mut tokens = Vec::new();
        while let Some(record) = lexer.next(&mut tokens) {
            match record.kind {
                RecordKind::Comment => self.comment(record)?,
                RecordKind::FreeText => self.free_text(record),
                RecordKind::Statement => self.record(record, &tokens)?,
            }
        }
        if let Some(arc) = self.pending.take() {
            self.keep(arc.record, "arc without an end");
        }
        Ok(())
    }

    fn record(&mut self, record: Record, tokens: &[Token]) -> Result<(), Refusal> {
        let Some(statement) = Statement::parse(&self.source.bytes, tokens) else {
            self.keep(record, "no statement");
            return Ok(());
        };
        if statement.defines {
            self.source_word(record);
            self.keep(record, "symbolic definition");
            return Ok(());
        }
        match self.statement(record, &statement)? {
            Ok(()) => self.understood += 1,
            Err(reason) => self.keep(record, reason),
        }
        Ok(())
    }

    /// What a statement means; inside, why it is kept instead.
    fn statement(&mut self, record: Record, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        let mut upper = [0; 16];
        let len = s.major.len().min(upper.len());
        upper[..len].copy_from_slice(&s.major[..len]);
        upper.make_ascii_uppercase();
        Ok(match &upper[..len] {
            b"GOTO" => return self.goto(record, s),
            b"GODLTA" => return self.godlta(record, s),
            b"RAPID" => {
                self.modal.rapid = true;
                // `rapid, goto/…`: two statements in a line.
                match s.items.iter().position(|t| t.kind == super::lex::Kind::Word) {
                    Some(at) => {
                        if let Some(next) = Statement::parse(&self.source.bytes, &s.items[at..])
                            && matches!(next.major.to_ascii_uppercase().as_slice(), b"GOTO" | b"GODLTA")
                        {
                            return self.statement(record, &next);
                        }
                        Ok(())
                    }
                    None => Ok(()),
                }
            }
            b"FROM" => self.from(s)?,
            b"FEDRAT" | b"FEDRATE" => {
                let mm = self.mm_per_unit();
                self.modal.read_feed(s, mm)
            }
            b"SPINDL" | b"SPINDLE" => {
                self.modal.read_spindle(s);
                Ok(())
            }
            b"UNITS" | b"UNIT" => self.units(s),
            b"CIRCLE" => self.circle(record, s),
            b"MOVARC" => self.movarc(record, s),
            b"TLON" => return self.tlon(record, s),
            b"AUTOPS" | b"PSIS" => Ok(()),
            b"INDIRV" => {
                self.modal.tangent = s.number_items().first();
                Ok(())
            }
            b"TLAXIS" => match s.number_items().first().and_then(axis) {
                Some(axis) => {
                    self.modal.axis = axis;
                    Ok(())
                }
                None => Err("tool axis is not given by numbers"),
            },
            b"CUTTER" | b"TLDATA" => {
                self.read_cutter(s);
                Ok(())
            }
            b"CYCLE" => self.cycle(s),
            b"CUTCOM" => self.cutcom(s),
            b"MSYS" => self.msys(s)?,
            b"CSYS" => self.csys(s)?,
            b"ORIGIN" => self.origin(s)?,
            b"TRNTYP" => {
                self.local = s.has(b"LOCAL");
                Ok(())
            }
            b"ROTABL" | b"ROTATE" | b"ROTHED" => {
                let turned = self.modal.turn_table(s);
                self.modal.blocked = turned.then_some("under a turned rotary table");
                if turned { Err("rotary table: geometry turns with it") } else { Ok(()) }
            }
            b"TRANS" => self.block("shifted by TRANS", "TRANS shifts what follows"),
            b"COPY" => {
                for target in &mut self.targets[self.index..] {
                    target.editable = Editable::No("repeated by COPY");
                }
                Err("COPY repeats what stands before")
            }
            b"INDEX" => {
                self.index = self.targets.len();
                Err("INDEX marks what COPY repeats")
            }
            b"TRACUT" => Err("TRACUT is taken as information"),
            b"GOHOME" => {
                self.modal.position = None;
                self.modal.rapid = false;
                Err("home position is the machine's")
            }
            b"NURBS" | b"KNOT" | b"CNTRL" => {
                self.modal.position = None;
                Err("NURBS curve is not read")
            }
            _ if is_source(s.major) => {
                self.source_word(record);
                Err("APT-360 source statement")
            }
            _ if is_without_motion(s.major) => Ok(()),
            _ => Err("statement not known"),
        })
    }

    fn block(&mut self, reason: &'static str, kept: &'static str) -> Result<(), &'static str> {
        self.modal.blocked = Some(reason);
        Err(kept)
    }

    // ---- motion -------------------------------------------------------------------------------

    fn goto(&mut self, record: Record, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        let Some(numbers) = s.numbers() else {
            self.modal.position = None;
            self.pending = None;
            if s.items.first().is_some_and(|t| t.kind == super::lex::Kind::Word) {
                self.source_word(record);
            }
            return Ok(Err("position is not given by numbers"));
        };
        let count = numbers.count();
        let mut tokens = numbers.iter();
        let mut triple = || -> Option<(Xyz, [f64; 3])> {
            let t = [tokens.next()?, tokens.next()?, tokens.next()?];
            Some((t.map(|t| t.span), t.map(|t| t.value)))
        };
        let Some((xyz, position)) = triple() else {
            return Ok(Err("position without three numbers"));
        };
        self.ensure_units(record)?;
        self.literal_targets += 1;
        match count {
            3 => self.modal.axis = self.axis_where_none_is_printed(),
            // A Creo list of two points on an arc looks like a position with an axis.
            6 => match triple() {
                Some((_, printed)) if self.pending.is_none() || is_unit(printed) => match axis(printed) {
                    Some(axis) => self.modal.axis = axis,
                    None => {
                        self.literal_targets -= 1;
                        return Ok(Err("tool axis is no unit vector"));
                    }
                },
                Some((next_xyz, next)) => {
                    self.literal_targets += 1;
                    self.modal.axis = self.axis_where_none_is_printed();
                    self.list(record, &[(xyz, position), (next_xyz, next)]);
                    return Ok(Ok(()));
                }
                None => {}
            },
            n if n % 3 == 0 => {
                let mut points = vec![(xyz, position)];
                while let Some(point) = triple() {
                    points.push(point);
                }
                // Every second triple of unit length: positions with axes.
                if n % 6 == 0 && points.iter().skip(1).step_by(2).all(|(_, v)| is_unit(*v)) {
                    if let Some(axis) = points.last().and_then(|p| axis(p.1)) {
                        self.modal.axis = axis;
                    }
                    points = points.into_iter().step_by(2).collect();
                } else {
                    self.modal.axis = self.axis_where_none_is_printed();
                }
                self.literal_targets += points.len() - 1;
                self.list(record, &points);
                return Ok(Ok(()));
            }
            _ => {
                self.literal_targets -= 1;
                return Ok(Err("position with a wrong count of numbers"));
            }
        }
        self.arrive(record, xyz, position, true);
        Ok(Ok(()))
    }

    /// Several points of one statement: on an arc they lie on it, and the last is its end.
    fn list(&mut self, record: Record, points: &[(Xyz, [f64; 3])]) {
        let pending = self.pending;
        for (i, &(xyz, position)) in points.iter().enumerate() {
            let last = i + 1 == points.len();
            if let (Some(arc), true) = (pending, i > 0) {
                self.pending = Some(PendingArc { centres: [None; 2], ..arc });
            }
            self.arrive(record, xyz, position, last || pending.is_none());
        }
    }

    /// The tool arrives at a printed position, straight or on the pending arc.
    fn arrive(&mut self, record: Record, xyz: Xyz, position: [f64; 3], end: bool) {
        let arc = self.pending.take();
        if end {
            self.ordinal += 1;
        }
        let frame = self.frame;
        let slot = match arc {
            Some(arc) => self.arc_points(arc, position, !end, xyz),
            None => None,
        };
        let role = if end { Role::End } else { Role::Interpolated };
        if end && slot.is_some() {
            self.arcs += 1;
        }
        let slot = slot.unwrap_or(Slot::Point { xyz, frame });
        self.push(record, position, self.modal.axis, role, u32::from(!end), slot);
        self.modal.position = Some(position);
        self.modal.from = None;
        if end {
            self.modal.rapid = false;
        }
    }

    /// Points on the way of an arc; the slot of its end, or `None` where it is no arc.
    fn arc_points(&mut self, pending: PendingArc, end: [f64; 3], ahead: bool, xyz: Xyz) -> Option<Slot> {
        let mm = self.mm_per_unit();
        let start = self.modal.position;
        let path = start.ok_or("arc without a start").and_then(|start| {
            let arc = Arc::new(&pending.circle, start, end)?;
            arc.chords(self.options.arc_tolerance_mm / mm).map(|n| (arc, n))
        });
        let (arc, chords) = match path {
            Ok(path) => path,
            Err(reason) => {
                self.keep(pending.record, reason);
                return None;
            }
        };
        let slot = u32::try_from(self.layout.arcs.len()).unwrap_or(u32::MAX);
        self.layout.arcs.push(ArcSlot {
            first: self.targets.len(),
            centres: pending.centres,
            from: self.modal.from,
            frame: self.frame,
        });
        for i in 1..chords {
            #[allow(clippy::cast_precision_loss)]
            let point = arc.point(i as f64 / chords as f64);
            let slot = Slot::OnArc { arc: slot };
            self.push(pending.record, point, self.modal.axis, Role::Interpolated, u32::from(ahead), slot);
        }
        Some(Slot::ArcEnd { xyz, frame: self.frame, arc: slot })
    }

    fn godlta(&mut self, record: Record, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        self.pending = None;
        let Some(numbers) = s.numbers() else {
            self.modal.position = None;
            return Ok(Err("increment is not given by numbers"));
        };
        let Some(start) = self.modal.position else { return Ok(Err("increment from an unknown position")) };
        self.ensure_units(record)?;
        let mut spans = numbers.iter().map(|t| t.span);
        let (step, slot) = match (numbers.count(), numbers.first::<3>(), numbers.first::<1>()) {
            (3.., Some(step), _) => {
                let mut next = || spans.next().unwrap_or_default();
                (step, Slot::Step { xyz: [next(), next(), next()], frame: self.frame })
            }
            (1, _, Some([along])) => (scale(self.modal.axis, along), Slot::AlongAxis { frame: self.frame }),
            _ => return Ok(Err("increment with a wrong count of numbers")),
        };
        self.literal_targets += 1;
        self.ordinal += 1;
        let position = add(start, step);
        self.push(record, position, self.modal.axis, Role::End, 0, slot);
        self.modal.position = Some(position);
        self.modal.from = None;
        self.modal.rapid = false;
        Ok(Ok(()))
    }

    fn from(&mut self, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        let numbers = s.number_items();
        let Some([x, y, z]) = numbers.first::<3>() else {
            return Ok(if s.items.is_empty() { Ok(()) } else { Err("start is not given by numbers") });
        };
        if let Some(axis) = numbers.first::<6>().and_then(|v| axis([v[3], v[4], v[5]])) {
            self.modal.axis = axis;
        }
        let mut spans = numbers.iter().map(|t| t.span);
        let mut next = || spans.next().unwrap_or_default();
        self.modal.from = Some([next(), next(), next()]);
        self.modal.position = Some([x, y, z]);
        Ok(Ok(()))
    }

    /// `CIRCLE/x,y,z,i,j,k[,r[,t,f,d,e]][,TIMES,n]`: the next position is its end.
    fn circle(&mut self, record: Record, s: &Statement) -> Result<(), &'static str> {
        let numbers = s.number_items();
        let turns = if s.has(b"TIMES") { numbers.iter().last().map_or(1.0, |t| t.value) } else { 1.0 };
        let Some([x, y, z, i, j, k]) = numbers.first() else {
            self.pending = None;
            return Err("circle without centre and axis");
        };
        let count = numbers.count() - usize::from(s.has(b"TIMES"));
        let clockwise = if s.has(b"CLOCKWISE") || s.has(b"CLW") {
            true
        } else if s.has(b"COUNTERCLOCKWISE") || s.has(b"CCLW") {
            false
        } else {
            self.dialect.clockwise(count)
        };
        let radius = if count > 6 { numbers.first::<7>().map(|v| v[6]) } else { None };
        let axis = scale([i, j, k], if clockwise { -1.0 } else { 1.0 });
        self.open_arc(record, Circle { centre: [x, y, z], axis, radius, turns }, [Some(xyz_of(s)), None])
    }

    /// `MOVARC/c,n,r,ANGLE,a`: right-handed; whole turns beyond the first are counted from the angle.
    fn movarc(&mut self, record: Record, s: &Statement) -> Result<(), &'static str> {
        let Some([x, y, z, i, j, k, r]) = s.number_items().first() else {
            return Err("arc without centre, axis and radius");
        };
        let angle = s.number_items().iter().nth(7).map_or(0.0, |t| t.value);
        let axis = scale([i, j, k], if angle < 0.0 { -1.0 } else { 1.0 });
        let turns = (angle.abs() / 360.0).ceil();
        let circle = Circle { centre: [x, y, z], axis, radius: Some(r), turns };
        self.open_arc(record, circle, [Some(xyz_of(s)), None])
    }

    fn open_arc(&mut self, record: Record, circle: Circle, centres: [Option<Xyz>; 2]) -> Result<(), &'static str> {
        if let Some(arc) = self.pending.replace(PendingArc { circle, centres, record }) {
            self.keep(arc.record, "arc without an end");
        }
        Ok(())
    }

    /// `TLON,GOFWD/(CIRCLE/c,r),ON,(LINE/c,e)`, after `INDIRV/` with the tangent at the start.
    fn tlon(&mut self, record: Record, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        let tangent = self.modal.tangent.take();
        let (circle, cylinder) = (s.nested(b"CIRCLE"), s.nested(b"CYLNDR"));
        let Some(round) = circle.or(cylinder) else {
            self.source_word(record);
            self.modal.position = None;
            return Ok(Err("motion along symbolic geometry"));
        };
        let line = s.nested(b"LINE");
        let radius = match cylinder {
            Some(c) if circle.is_none() => c.first::<7>().map(|v| v[6]),
            _ => round.first::<4>().map(|v| v[3]),
        };
        let (Some(centre), Some(radius), Some(line), Some(ends)) =
            (round.first::<3>(), radius, line, line.and_then(|l| l.first::<6>()))
        else {
            self.modal.position = None;
            return Ok(Err("arc without circle and line"));
        };
        self.ensure_units(record)?;
        let (from, to) = ([ends[0], ends[1], ends[2]], [ends[3], ends[4], ends[5]]);
        let end = on_circle(centre, radius, from, to);
        let spans: Vec<Span> = line.iter().map(|t| t.span).collect();
        let centre_spans: Vec<Span> = round.iter().map(|t| t.span).take(3).collect();
        let xyz = [spans[3], spans[4], spans[5]];
        let centres = [Some([centre_spans[0], centre_spans[1], centre_spans[2]]), Some([spans[0], spans[1], spans[2]])];
        match (tangent, self.modal.position) {
            (Some(tangent), Some(start)) => {
                let axis = cross(sub(start, centre), tangent);
                let circle = Circle { centre, axis, radius: Some(radius), turns: 1.0 };
                self.pending = Some(PendingArc { circle, centres, record });
            }
            _ => self.keep(record, "arc without a start or its direction"),
        }
        self.arrive(record, xyz, end, true);
        Ok(Ok(()))
    }

    fn push(&mut self, record: Record, printed: [f64; 3], axis: [f64; 3], role: Role, ahead: u32, slot: Slot) {
        let frame = &self.layout.frames[self.frame as usize];
        let axis = unit(frame.turn(axis)).unwrap_or(axis);
        let mut position_mm = frame.position(printed);
        if self.options.point == Point::Centre {
            let radius = self.options.corner_radius_mm.unwrap_or(0.0);
            position_mm = sub(position_mm, scale(axis, radius));
        }
        let rapid = self.modal.rapid;
        if !rapid && self.cutter.is_none() {
            self.cutter = self.modal.cutter;
        }
        let editable = match self.modal.blocked {
            Some(reason) => Editable::No(reason),
            None if self.modal.cutcom => Editable::No("under radius compensation (CUTCOM)"),
            None => Editable::Pose,
        };
        self.layout.slots.push(slot);
        self.targets.push(Target {
            ordinal: self.ordinal + ahead,
            role,
            motion: Motion::Linear,
            goal: Goal::Axis { position_mm, axis },
            tool: 0,
            wobj: 0,
            feed_mm_s: if rapid { None } else { self.modal.feed_mm_s() },
            spindle_rpm: self.modal.rpm(),
            rapid,
            mark: self.modal.mark,
            editable,
            name: None,
            source: 0,
            span: record.span,
            line: u32::try_from(record.line).unwrap_or(u32::MAX),
        });
    }

    /// The axis of a position that prints none, by dialect.
    fn axis_where_none_is_printed(&self) -> [f64; 3] {
        match self.dialect {
            // Creo leaves the axis out where it is the machine's z.
            Dialect::Creo => [0.0, 0.0, 1.0],
            Dialect::SolidWorks => self.setup_axis,
            _ => self.modal.axis,
        }
    }

    // ---- state --------------------------------------------------------------------------------

    fn units(&mut self, s: &Statement) -> Result<(), &'static str> {
        let unit = s.words().find_map(unit_of).ok_or("unit not known")?;
        self.set_units(unit);
        Ok(())
    }

    fn set_units(&mut self, mm: f64) {
        if self.units == Some(mm) {
            return;
        }
        self.units = Some(mm);
        let now = self.layout.frames.get(self.frame as usize).copied();
        let frame = Frame { mm_per_unit: mm, ..now.unwrap_or(Frame::identity(mm)) };
        self.frame = self.layout.frame(frame);
    }

    fn mm_per_unit(&self) -> f64 {
        self.units.unwrap_or(1.0)
    }

    /// A position needs a unit: the file's, else the options', else the file is refused.
    fn ensure_units(&mut self, record: Record) -> Result<(), Refusal> {
        if self.units.is_some() {
            return Ok(());
        }
        match unit_further_down(&self.source.bytes[record.span.start as usize..]) {
            Some(mm) => {
                self.set_units(mm);
                Ok(())
            }
            None => Err(Refusal(
                Diagnostic::error(
                    "cl.no-unit",
                    &self.source.name,
                    "no UNITS statement, and no `units` in [cl]: expected millimetres or inches",
                )
                .at(self.source, record.span)
                .help("set `units = \"mm\"` or `units = \"inch\"` under [cl] in the cell file"),
            )),
        }
    }

    fn read_cutter(&mut self, s: &Statement) {
        let mm = self.mm_per_unit();
        let mut numbers = s.number_items().iter();
        if let Some(diameter) = numbers.next().filter(|d| d.value > 0.0) {
            let corner = numbers.next().map_or(0.0, |r| r.value.max(0.0));
            self.modal.cutter = Some(CutterInfo { diameter_mm: diameter.value * mm, corner_radius_mm: corner * mm });
        }
    }

    fn cycle(&mut self, s: &Statement) -> Result<(), &'static str> {
        self.modal.cycle = !(s.has(b"OFF") || s.has(b"INIT") || s.has(b"NOMORE") || s.items.is_empty());
        let drills = self.modal.cycle && !(s.has(b"ON") && s.items.len() == 1);
        if drills { Err("drilling cycle: its hole points are read, its own moves are not") } else { Ok(()) }
    }

    fn cutcom(&mut self, s: &Statement) -> Result<(), &'static str> {
        if s.has(b"LEFT") || s.has(b"RIGHT") {
            self.modal.cutcom = true;
        } else if s.has(b"OFF") {
            self.modal.cutcom = false;
        }
        if self.modal.cutcom { Err("radius compensation, which a robot's controller has not") } else { Ok(()) }
    }

    fn msys(&mut self, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        let mm = self.mm_per_unit();
        Ok(match s.number_items().first().map(|m| Frame::from_msys(m, mm)) {
            Some(Some(frame)) => {
                self.set_frame(frame, self.dialect.positions_follow_frame() || self.dialect == Dialect::Unknown);
                Ok(())
            }
            _ => self.block("in a frame that is not read", "MSYS is no frame"),
        })
    }

    fn csys(&mut self, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        let mm = self.mm_per_unit();
        Ok(match s.number_items().first().map(|m| Frame::from_rows(m, mm)) {
            Some(Some(frame)) => {
                self.setup_axis = if self.local { [0.0, 0.0, 1.0] } else { frame.z_axis() };
                self.set_frame(frame, self.local);
                Ok(())
            }
            _ => Err("CSYS is no frame"),
        })
    }

    fn origin(&mut self, s: &Statement) -> Result<Result<(), &'static str>, Refusal> {
        let Some(origin) = s.number_items().first::<3>() else { return Ok(Err("origin is not given by numbers")) };
        let mm = self.mm_per_unit();
        let (x, z) = match s.number_items().first::<9>() {
            Some(m) => ([m[3], m[4], m[5]], [m[6], m[7], m[8]]),
            None => ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        };
        let [y0, y1, y2] = cross(z, x);
        let m = Frame::from_msys([origin[0], origin[1], origin[2], x[0], x[1], x[2], y0, y1, y2], mm);
        Ok(match m {
            Some(frame) if self.base.is_none_or(|base| same_frame(&base, &frame)) => {
                self.set_frame(frame, false);
                Ok(())
            }
            // Whether positions follow a second origin depends on the post processor.
            _ => self.block("behind a second ORIGIN", "a second ORIGIN"),
        })
    }

    /// A frame is named. The first one of the file is the work object; where positions follow frames,
    /// a further one is seen from it.
    fn set_frame(&mut self, frame: Frame, follow: bool) {
        let base = *self.base.get_or_insert(frame);
        if follow {
            let mm = frame.mm_per_unit;
            let frame = if same_frame(&base, &frame) { Frame::identity(mm) } else { frame.seen_from(&base) };
            let before = self.frame;
            self.frame = self.layout.frame(frame);
            if self.frame != before {
                self.modal.position = None;
                self.say(
                    "cl.several-frames",
                    "positions in several frames: all are taken into the first, the work object",
                );
            }
        } else if !same_frame(&base, &frame) && self.dialect == Dialect::Creo {
            self.say("cl.several-frames", "several CSYS: positions are taken as printed, in the operation's own frame");
        }
    }

    fn comment(&mut self, record: Record) -> Result<(), Refusal> {
        let text = self.source.slice(record.span);
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
                self.modal.cutter = Some(CutterInfo { diameter_mm, corner_radius_mm: 0.0 });
            }
        } else if text.starts_with(b"$$*CATIA0") {
            self.matrix = MatrixRows { open: true, ..MatrixRows::default() };
        } else if self.matrix.open {
            self.matrix_row(text);
        }
        self.understood += 1;
        Ok(())
    }

    /// A row below `$$*CATIA0`: a name, then three rows of four.
    fn matrix_row(&mut self, text: &[u8]) {
        let values = numbers_in(text);
        match (first_of::<4>(&values), values.len()) {
            (Some(row), 4) => {
                self.matrix.values[4 * self.matrix.rows..][..4].copy_from_slice(&row);
                self.matrix.rows += 1;
                self.matrix.open = self.matrix.rows < 3;
                if !self.matrix.open
                    && let Some(frame) = Frame::from_rows(self.matrix.values, self.mm_per_unit())
                {
                    self.set_frame(frame, self.dialect.positions_follow_frame());
                }
            }
            _ if self.matrix.rows > 0 => self.matrix.open = false,
            _ => {}
        }
    }

    /// `PPRINT/DEFLEX AIR` and `PPRINT/DEFLEX CUT`; all other text means nothing here.
    fn free_text(&mut self, record: Record) {
        let text = self.source.slice(record.span);
        if text.len() > 6 && text[..6].eq_ignore_ascii_case(b"PPRINT") {
            let said: Vec<u8> = text[6..]
                .iter()
                .copied()
                .skip_while(|b| matches!(b, b' ' | b'\t' | b'/' | b'\'' | b'"'))
                .map(|b| b.to_ascii_uppercase())
                .collect();
            let mut words = said.split(|b| matches!(b, b' ' | b'\t' | b'\'' | b'"' | b',')).filter(|w| !w.is_empty());
            match (words.next(), words.next()) {
                (Some(b"DEFLEX"), Some(b"AIR")) => self.modal.mark = Some(Mark::Air),
                (Some(b"DEFLEX"), Some(b"CUT")) => self.modal.mark = Some(Mark::Cut),
                _ => {}
            }
        }
        self.understood += 1;
    }

    // ---- what is said -------------------------------------------------------------------------

    fn keep(&mut self, record: Record, reason: &'static str) {
        self.kept.push(Kept { source: 0, span: record.span, line: record.line, reason });
    }

    fn say(&mut self, code: &'static str, message: &'static str) {
        if !self.said.contains(&code) {
            self.said.push(code);
            self.diagnostics.push(Diagnostic::error(code, &self.source.name, message).severity(Severity::Warning));
        }
    }

    fn source_word(&mut self, record: Record) {
        self.source_words += 1;
        self.first_source_word.get_or_insert(record.span);
    }
}

fn mm_per_unit(units: Units) -> f64 {
    match units {
        Units::Millimetre => 1.0,
        Units::Inch => INCH_MM,
    }
}

fn unit_of(word: &[u8]) -> Option<f64> {
    match word.to_ascii_uppercase().as_slice() {
        b"MM" | b"MILLIMETERS" | b"MILLIMETRES" | b"METRIC" => Some(1.0),
        b"INCHES" | b"INCH" | b"IN" => Some(INCH_MM),
        b"CM" => Some(10.0),
        _ => None,
    }
}

/// The unit of the first `UNITS` statement in what is left of a file.
fn unit_further_down(rest: &[u8]) -> Option<f64> {
    rest.split(|b| matches!(b, b'\n' | b'\r')).find_map(|line| {
        let line = line.trim_ascii_start();
        let head = line.get(..4)?;
        if !head.eq_ignore_ascii_case(b"UNIT") {
            return None;
        }
        line.split(|b| !b.is_ascii_alphabetic()).skip(1).find_map(unit_of)
    })
}

/// A printed axis, normalised.
fn axis(printed: [f64; 3]) -> Option<[f64; 3]> {
    AXIS_LENGTH.contains(&norm(printed)).then(|| unit(printed)).flatten()
}

fn is_unit(v: [f64; 3]) -> bool {
    (norm(v) - 1.0).abs() < UNIT_TRIPLE
}

fn xyz_of(s: &Statement) -> Xyz {
    let mut spans = s.number_items().iter().map(|t| t.span);
    std::array::from_fn(|_| spans.next().unwrap_or_default())
}

/// Where the line from the centre through `to` meets the circle: `to` itself where it lies on it.
fn on_circle(centre: [f64; 3], radius: f64, from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    /// Printed digits of radius and ends, as a part of the radius.
    const PRINTED: f64 = 1e-3;
    let off = (norm(sub(to, centre)) - radius).abs();
    if off <= PRINTED * radius.abs() {
        return to;
    }
    let Some(along) = unit(sub(to, from)) else { return to };
    let a = sub(from, centre);
    let b = super::vector::dot(a, along);
    let root = b * b - super::vector::dot(a, a) + radius * radius;
    if root < 0.0 { to } else { add(from, scale(along, root.sqrt() - b)) }
}

fn same_frame(a: &Frame, b: &Frame) -> bool {
    a.rows == b.rows && a.origin_mm == b.origin_mm
}

fn numbers_in(text: &[u8]) -> Vec<f64> {
    text.split(|b| b.is_ascii_whitespace() || matches!(b, b',' | b'/' | b'$')).filter_map(super::lex::number).collect()
}

fn first_of<const N: usize>(values: &[f64]) -> Option<[f64; N]> {
    values.get(..N)?.try_into().ok()
}
