//! Posts CL data: makes a program of corrected points.

use super::machine_actions::MachineActions;
use super::messages::Messages;
use super::{Corrected, Row, Status, StreamError, frames};
use deflex_cell::{Cell, CutForce, SpinRule};
use deflex_program::cl::{self, CorrectedPoint};
use deflex_program::orientation::rotation;
use deflex_program::post::refuse_names;
use deflex_program::post::{PostPlan, PostWriter, PostedPoint, Templates, Text, WriterPosition};
use deflex_program::{Action, ChunkReader, Goal, Language, Mark, Next, Program, Role, Tool, ToolData, Wobj, WobjData};
use deflex_robot::{AxisName, EXTERNAL_AXES, Pose, turn_numbers};
use deflex_text::{Diagnostic, Severity};
use nalgebra::Vector3;
use smallvec::SmallVec;
use std::sync::Arc;

/// Properties of the posted program that CL data do not state.
///
/// # Examples
/// ```
/// use deflex_correct::{PostOptions, RAPID_MM_S};
/// use deflex_program::Language;
///
/// let options = PostOptions {
///     name: "Blade".to_owned(),
///     title: vec!["posted for the milling cell".to_owned()],
///     max_targets: None,
///     rapid_mm_s: RAPID_MM_S,
///     feed_mm_s: None,
///     language: Language::Rapid,
/// };
/// ```
#[derive(Clone, Debug)]
pub struct PostOptions {
    /// Name of the program, from which an identifier is made.
    pub name: String,
    /// Lines of the head comment.
    pub title: Vec<String>,
    /// Most targets of a module.
    pub max_targets: Option<usize>,
    /// Speed of rapid travel, mm/s.
    pub rapid_mm_s: f64,
    /// Speed of motions if the file has no feed at all, mm/s.
    pub feed_mm_s: Option<f64>,
    /// Language of the program: RAPID, KRL, FANUC TP, URScript, INFORM, or CL as it was.
    pub language: Language,
}

/// Speed of rapid travel, mm/s, unless `--rapid-speed` gives another one. CL data do not state it; a milling robot is not sent faster
/// near a part.
pub const RAPID_MM_S: f64 = 200.0;

/// Largest distance of a zone's rounding from a corner that cuts, mm: below what a robot repeats.
const CORNER_TOLERANCE_MM: f64 = 0.05;

/// Data of a whole program on which the head of its posted program depends.
///
/// # Examples
/// ```
/// use deflex_correct::{Outline, StreamError};
/// use deflex_program::cl;
///
/// /// The number of points of long CL data.
/// fn points(chunks: cl::Chunks<std::fs::File>) -> Result<usize, StreamError> {
///     Ok(Outline::of_chunks(chunks, |_, _| ())?.points())
/// }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Outline {
    /// Number of points.
    pub(super) points: usize,
    /// The first feed of a motion.
    first_feed: Option<f64>,
    /// The first motion without a feed.
    early: Option<Diagnostic>,
    /// Feeds of motions, mm/s, in rising order.
    feeds: Vec<f64>,
    /// Whether some travel is rapid.
    rapid: bool,
    /// Actions of the machine other than motion.
    actions: MachineActions,
    tools: Vec<Tool>,
    wobjs: Vec<Wobj>,
    /// Positions of the external axes.
    external: [Option<f64>; EXTERNAL_AXES],
    /// Warnings about the text.
    pub(super) warnings: Vec<Diagnostic>,
}

impl Outline {
    /// Reads a long file. `progress` receives the targets and the bytes of input done so far.
    ///
    /// # Errors
    /// [`StreamError::NotStreamable`], [`StreamError::Read`]; [`StreamError::Refused`] if a motion is not what its text states.
    pub fn of_chunks(mut chunks: impl ChunkReader, progress: impl Fn(usize, u64)) -> Result<Self, StreamError> {
        let (mut outline, mut bytes, mut faults) = (Self::default(), 0, Messages::default());
        loop {
            match chunks.take().map_err(StreamError::Read)? {
                Next::Chunk(chunk) => {
                    let chunk = chunk.read().ok_or(StreamError::NotStreamable)?;
                    outline.add(&chunk.program);
                    faults.add(chunk.program.faults());
                    bytes += chunk.own.len() as u64;
                    progress(outline.points, bytes);
                }
                Next::End => break,
                Next::NotStreamable => return Err(StreamError::NotStreamable),
            }
        }
        let faults = faults.all();
        if !faults.is_empty() {
            return Err(StreamError::Refused(faults));
        }
        outline.warnings = chunks.warnings();
        Ok(outline)
    }

    /// Adds a program, or its next chunk.
    pub(crate) fn add(&mut self, program: &Program) {
        self.actions.add(program, self.points);
        self.points += program.targets.len();
        self.rapid |= program.targets.iter().any(|target| target.rapid);
        for target in program.targets.iter().filter(|target| !target.rapid) {
            match (target.feed_mm_s, program.sources.first()) {
                (Some(feed), _) => {
                    self.first_feed.get_or_insert(feed);
                    self.speed(feed);
                }
                (None, Some(source)) if self.early.is_none() => {
                    let message = "this move has no feed";
                    self.early = Some(
                        Diagnostic::error("post.feed", &source.name, message).on_line(source, target.span, target.line),
                    );
                }
                _ => {}
            }
        }
        // Later chunks of a program have the tools of the earlier ones, and maybe more.
        if self.tools.len() < program.tools.len() {
            self.tools.clone_from(&program.tools);
        }
        if self.wobjs.is_empty() {
            self.wobjs.clone_from(&program.wobjs);
        }
        if let Some(external) = program.targets.first().and_then(|target| target.external.as_ref()) {
            self.external = std::array::from_fn(|axis| external.position(AxisName::External(axis)));
        }
    }

    /// Number of points of the program, without inserted targets.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points
    }

    fn speed(&mut self, feed: f64) {
        if let Err(at) = self.feeds.binary_search_by(|known| known.total_cmp(&feed)) {
            self.feeds.insert(at, feed);
        }
    }
}

/// A program posted as a whole.
///
/// # Examples
/// ```
/// use deflex_correct::PostedProgram;
///
/// let posted = PostedProgram { files: vec![("Blade.mod".to_owned(), b"MODULE Blade\n".to_vec())], notes: vec![] };
/// assert_eq!(posted.files[0].0, "Blade.mod"); // the file to be started
/// ```
#[derive(Clone, Debug)]
pub struct PostedProgram {
    /// Its files by name; the first one is to be started.
    pub files: Vec<(String, Vec<u8>)>,
    /// Notes about it.
    pub notes: Vec<Diagnostic>,
}

/// Writes the program.
///
/// Motions before the file's first feed get that feed, which is slow and safe. Rapid travel and air are marked, so that a reader of the
/// posted program can distinguish them.
///
/// # Errors
/// No feed is known.
///
/// # Examples
/// ```
/// use deflex_correct::{Options, PostOptions, RAPID_MM_S, compensate, post};
/// use deflex_cell::Cell;
/// use deflex_program::{Language, cl};
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/blade/cell.toml")?))?;
/// let file = Source::new("blade.aptsource", std::fs::read("../../samples/blade/blade.aptsource")?);
/// let program = cl::read(file, &cell.cl.as_ref().expect("[cl]").options)?;
/// let corrected = compensate(&program, &cell, &Options::default())?;
/// let options = PostOptions {
///     name: "Blade".to_owned(),
///     title: vec![],
///     max_targets: None,
///     rapid_mm_s: RAPID_MM_S,
///     feed_mm_s: None,
///     language: Language::Rapid,
/// };
/// let posted = post(&program, &cell, &corrected, &options)?;
/// assert_eq!(posted.files.len(), 1);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn post(
    program: &Program,
    cell: &Cell,
    corrected: &Corrected,
    options: &PostOptions,
) -> Result<PostedProgram, Vec<Diagnostic>> {
    if options.language == Language::Cl {
        return post_cl(program, corrected, options);
    }
    let mut outline = Outline::default();
    outline.add(program);
    outline.points = corrected.posted.len();
    let poster = Poster::new(outline, cell, options)?;
    let points = poster.points(program, corrected);
    if let Some(write) = options.language.about().post.write {
        let axes: Vec<[f64; 6]> = corrected.posted.iter().map(|posted| posted.motor_deg).collect();
        let files = write(&poster.post, &points, &axes, &poster.end(program))?;
        return Ok(PostedProgram { files, notes: poster.notes });
    }
    let body = poster.post.chunk(&WriterPosition::default(), &points, Some(&poster.end(program)));
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for Text { bytes, files: starts } in [poster.post.head(), &body] {
        let ends = starts.iter().map(|(start, _)| *start).skip(1).chain([bytes.len()]);
        if let Some((_, file)) = files.last_mut() {
            file.extend_from_slice(&bytes[..starts.first().map_or(bytes.len(), |(start, _)| *start)]);
        }
        files.extend(starts.iter().zip(ends).map(|((start, name), end)| (name.clone(), bytes[*start..end].to_vec())));
    }
    Ok(PostedProgram { files, notes: poster.notes })
}

/// The CL data themselves, with corrected tips and tool axes.
fn post_cl(program: &Program, corrected: &Corrected, options: &PostOptions) -> Result<PostedProgram, Vec<Diagnostic>> {
    if options.max_targets.is_some() || options.feed_mm_s.is_some() {
        let message = "`--post cl` changes only points: it neither splits the file nor gives it a feed";
        return Err(Diagnostic::error("post.cl", "", message).help("leave out --max-targets and --feed").into());
    }
    if corrected.posted.iter().any(|posted| posted.external.is_some()) {
        let message =
            "`--post cl` cannot write positions of external axes, and this cell lets deflex choose them along the path";
        return Err(Diagnostic::error("post.unit", "", message)
            .help("post RAPID, or leave `free` out of the cell's [[unit]]")
            .into());
    }
    let point = |posted: &super::Posted| CorrectedPoint {
        target: posted.target,
        position_mm: posted.position_mm,
        axis: (-(rotation(posted.quat) * Vector3::z())).into(),
    };
    let points: Vec<CorrectedPoint> = corrected.posted.iter().map(point).collect();
    let bytes = cl::write(program, &points, &options.title)?;
    let message = "your post-processor chooses the turn about the tool axis: the correction is right for the turn that `spin` in the cell gives";
    let mut notes = vec![Diagnostic::error("post.spin", "", message).severity(Severity::Note)];
    if program.targets.iter().any(|target| target.role == Role::Interpolated) {
        let message = "arcs and drilling cycles are written as points; their statements stay as comments";
        notes.push(Diagnostic::error("post.points", "", message).severity(Severity::Note));
    }
    let ending = Language::Cl.endings()[0];
    Ok(PostedProgram { files: vec![(format!("{}.{ending}", options.name), bytes)], notes })
}

/// Posts a program whose outline is known, whole or a chunk at a time.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_correct::{Outline, PostOptions, Poster};
/// use deflex_text::Diagnostic;
///
/// /// How many files a posted program will have.
/// fn files(outline: Outline, cell: &Cell, options: &PostOptions) -> Result<usize, Vec<Diagnostic>> {
///     Ok(Poster::new(outline, cell, options)?.files())
/// }
/// ```
#[derive(Debug)]
pub struct Poster {
    pub(super) post: PostWriter,
    /// Warnings about the text of a long program.
    pub(super) warnings: Vec<Diagnostic>,
    /// Notes about the posted program.
    pub(super) notes: Vec<Diagnostic>,
    /// Speed of motions before the first feed, mm/s.
    first_feed: f64,
    /// Whether no force acts anywhere: then all motions are air, and need no marks.
    no_force: bool,
    templates: Templates,
    language: Language,
    /// The mark of motions that have none of their own: the end of a mark on rapid travel.
    unmarked: Option<Mark>,
}

impl Poster {
    /// Lays out the posted program.
    ///
    /// # Errors
    /// No feed is known; the language has no place for the names of tools and work objects.
    pub fn new(mut outline: Outline, cell: &Cell, options: &PostOptions) -> Result<Self, Vec<Diagnostic>> {
        moved(&outline, cell, options.language)?;
        let statements = options.language.about().post;
        if let Some(why) = statements.unsplit.filter(|_| options.max_targets.is_some()) {
            return Err(Diagnostic::error("post.split", "", why).help("leave out --max-targets").into());
        }
        let first_feed = outline.first_feed.or(options.feed_mm_s);
        let templates = cell.cl.as_ref().map(|cl| cl.post.clone()).unwrap_or_default();
        let mut notes = outline.actions.unwritten(&templates)?;
        if let Some(early) = outline.early.take() {
            let Some(feed) = first_feed else {
                return Err(vec![early.help("add FEDRAT/ to the file, or give --feed MM_S")]);
            };
            outline.speed(feed);
            let message = format!("moves before the first feed get {feed} mm/s");
            notes.push(Diagnostic { message, ..early }.severity(Severity::Note));
        }
        let plan = PostPlan {
            name: options.name.clone(),
            title: options.title.clone(),
            tools: outline.tools.iter().map(|tool| (tool.name.to_string(), tool_data(cell, &tool.name))).collect(),
            wobjs: outline
                .wobjs
                .iter()
                .map(|wobj| (wobj.name.to_string(), wobj_data(cell, &wobj.name, options.language)))
                .collect(),
            units: outline.wobjs.iter().map(|wobj| unit_of(cell, &wobj.name).map(str::to_owned)).collect(),
            external: outline.external,
            speeds: outline.feeds,
            points: outline.points,
            max_points: options.max_targets.or(statements.most_points),
            rapid_mm_s: options.rapid_mm_s,
            speed_unit: cell.controller.speed_unit,
            corner_tolerance_mm: CORNER_TOLERANCE_MM,
        };
        refuse_names(&plan, options.language)?;
        let help = "compare it with a job that this controller has saved, and run the job slowly first";
        let warning = |check| Diagnostic::error("post.check", "", check).severity(Severity::Warning).help(help);
        notes.extend(statements.check.map(warning));
        let no_force = cell.cut.as_ref().is_none_or(|cut| cut.force == CutForce::None);
        Ok(Self {
            post: PostWriter::new(plan),
            warnings: outline.warnings,
            notes,
            first_feed: first_feed.unwrap_or(options.rapid_mm_s),
            no_force,
            templates,
            language: options.language,
            unmarked: (no_force && outline.rapid).then_some(Mark::Cut),
        })
    }

    /// Name of the file to start.
    #[must_use]
    pub(crate) fn main_file(&self) -> &str {
        self.post.head().files.first().map_or("", |(_, name)| name)
    }

    /// Number of files.
    #[must_use]
    pub fn files(&self) -> usize {
        self.post.files()
    }

    /// The points of a program, or of a chunk of it.
    pub(super) fn points(&self, program: &Program, corrected: &Corrected) -> Vec<PostedPoint> {
        let mut actions = program.actions.iter().peekable();
        let point = |posted: &super::Posted| {
            let target = &program.targets[posted.target];
            let own = target.mark.or(target.rapid.then_some(Mark::Air));
            let here: SmallVec<[&Action; 4]> =
                std::iter::from_fn(|| actions.next_if(|action| action.before <= posted.target)).collect();
            PostedPoint {
                position_mm: posted.position_mm,
                quat: posted.quat,
                conf: posted.conf,
                turns: turn_numbers(&posted.motor_deg),
                speed_mm_s: target.feed_mm_s.unwrap_or(self.first_feed),
                rapid: target.rapid,
                stop: matches!(target.goal, Goal::Joints { .. }),
                joint: here.iter().any(|action| action.kind.leaves_path()),
                lines: self.lines(&here, program, target.tool),
                mark: own.or_else(|| self.mark(&corrected.rows, target.ordinal)),
                tool: target.tool,
                wobj: target.wobj,
                external: posted.external.clone(),
            }
        };
        corrected.posted.iter().map(point).collect()
    }

    /// Instructions after the last motion.
    pub(super) fn end(&self, program: &Program) -> String {
        let behind: SmallVec<[&Action; 4]> =
            program.actions.iter().filter(|action| action.before >= program.targets.len()).collect();
        let tool = program.targets.last().map_or(0, |target| target.tool);
        self.lines(&behind, program, tool).map_or_else(String::new, |lines| lines.to_string())
    }

    fn lines(&self, actions: &[&Action], program: &Program, tool: u16) -> Option<Arc<str>> {
        let tool = program.tools.get(usize::from(tool)).map_or("", |tool| &tool.name);
        let lines: Vec<String> =
            actions.iter().filter_map(|action| self.templates.lines(&action.kind, tool, self.language)).collect();
        (!lines.is_empty()).then(|| lines.join("\n").into())
    }

    /// Whether a motion cuts, for those that have no mark of their own.
    fn mark(&self, rows: &[Row], ordinal: u32) -> Option<Mark> {
        if self.no_force {
            return self.unmarked;
        }
        let row = rows.binary_search_by_key(&ordinal, |row| row.target).ok().map(|at| &rows[at]);
        row.map(|row| if row.status == Status::Ok { Mark::Cut } else { Mark::Air })
    }
}

fn tool_data(cell: &Cell, name: &str) -> ToolData {
    let tool = cell.tools.get(&name.to_ascii_uppercase());
    let (tcp_mm, tcp_quat) = frames::millimetres(&tool.map_or_else(Pose::identity, |tool| tool.flange_from_tcp));
    ToolData {
        robhold: true,
        tcp_mm,
        tcp_quat,
        mass_kg: tool.map_or(0.0, |tool| tool.mass),
        cog_mm: tool.map_or([0.0; 3], |tool| (tool.cog * 1e3).into()),
    }
}

/// The unit that carries a work object of the cell.
fn unit_of<'a>(cell: &'a Cell, name: &str) -> Option<&'a str> {
    cell.wobj_units.get(&name.to_ascii_uppercase()).map(|unit| cell.units.all()[*unit].name.as_str())
}

/// Refuses mechanical units that cannot be posted in a language.
fn moved(outline: &Outline, cell: &Cell, language: Language) -> Result<(), Vec<Diagnostic>> {
    let statements = language.about().post;
    let on_unit = || outline.wobjs.iter().find(|wobj| unit_of(cell, &wobj.name).is_some());
    let message = match (statements.without_axes, statements.stands_still.then(on_unit).flatten()) {
        (Some(why), _) if outline.external.iter().any(Option::is_some) || are_chosen(cell) => why.to_owned(),
        (_, Some(wobj)) => {
            let (name, wobj) = (language.name(), &wobj.name);
            format!("{name} is posted only with work objects that stand still: `{wobj}` is on a mechanical unit")
        }
        _ => return Ok(()),
    };
    let help = "post RAPID, or put the work object where it is for this program and leave the [[unit]] out";
    Err(vec![Diagnostic::error("post.unit", "", message).help(help)])
}

/// Whether positions of units are chosen along the path.
fn are_chosen(cell: &Cell) -> bool {
    let stiffest = cell.cl.as_ref().is_some_and(|cl| cl.spin.rule == SpinRule::Stiffest);
    stiffest && cell.units.all().iter().any(|unit| unit.free)
}

fn wobj_data(cell: &Cell, name: &str, language: Language) -> WobjData {
    const NONE: ([f64; 3], [f64; 4]) = ([0.0; 3], [1.0, 0.0, 0.0, 0.0]);
    let pose = cell.wobjs.get(&name.to_ascii_uppercase()).copied().unwrap_or_else(Pose::identity);
    // A controller that counts from the robot's base has no world frame.
    let in_base = || cell.arm.robot.world_from_base.inverse() * pose;
    let own = frames::millimetres(&if language.robot_base().is_some() { in_base() } else { pose });
    // The user frame of a work object on a unit is the unit's own.
    let fixed = unit_of(cell, name).is_none();
    let (user, object) = if fixed { (own, NONE) } else { (NONE, own) };
    let ((uframe_mm, uframe_quat), (oframe_mm, oframe_quat)) = (user, object);
    WobjData { robhold: false, fixed, uframe_mm, uframe_quat, oframe_mm, oframe_quat }
}
