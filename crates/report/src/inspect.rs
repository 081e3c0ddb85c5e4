//! The answer of `inspect` as a table and as JSON (`docs/reference.md`, `inspect --json`).

use deflex_program::{Goal, Language, Program, RoundTrip};
use deflex_text::{Diagnostic, printable_line};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Name of the frame of positions in CL data: only a cell gives it another.
const CL_WOBJ: &str = "the part";

/// One inspected file.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// use deflex_report::InspectFile;
///
/// let file = InspectFile::read("slot.mod", &program, &deflex_program::round_trip(&program, deflex_program::rapid::read));
/// assert!(file.refused.is_none());
/// assert!(InspectFile::refused("part.mod", None, &[]).refused.is_some());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, Serialize)]
pub struct InspectFile {
    /// As the user typed it.
    pub path: String,
    /// Its [word](Language::word); `None` where it was not recognised.
    pub language: Option<&'static str>,
    /// The CAM system or post that wrote it, if the text shows it.
    pub dialect: Option<&'static str>,
    /// Executed motions.
    pub motion_targets: usize,
    /// Complete numeric positions in the text.
    pub literal_targets: usize,
    /// Arcs among the executed motions.
    pub arcs: usize,
    /// Why the file as a whole is not read.
    pub refused: Option<String>,
    /// Statements that are left as they are, with the reason.
    pub kept: Vec<KeptLine>,
    /// Whether the round trip succeeds: unchanged targets give the same bytes, and shifted ones are read back.
    pub round_trip: bool,
    /// The difference, if it does not succeed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub round_trip_fault: Option<String>,
    /// Names of the tools used.
    pub tools: Vec<String>,
    /// Names of the work objects used.
    pub wobjs: Vec<String>,
    /// Extents, feeds and run time.
    #[serde(flatten)]
    pub reach: Reached,
}

/// The extents of a program, its feeds and its run time.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// let reach = deflex_report::InspectFile::read("slot.mod", &program, &deflex_program::round_trip(&program, deflex_program::rapid::read)).reach;
/// println!("{:.0} s, external axes {:?}", reach.run_time_s, reach.external_axes);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Reached {
    /// The extent of the positions in each work object, in the order of the program.
    pub extents: Vec<Extent>,
    /// Slowest and fastest programmed feed, mm/s.
    pub feed_mm_s: Option<[f64; 2]>,
    /// External axes in use, as RAPID names them.
    pub external_axes: Vec<String>,
    /// Time of the moves with a feed, s: straight from position to position, without corners, waits and joint moves.
    pub run_time_s: f64,
}

/// The box that the positions in one work object lie in.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// for extent in deflex_report::InspectFile::read("slot.mod", &program, &deflex_program::round_trip(&program, deflex_program::rapid::read)).reach.extents {
///     println!("{}: from {:?} to {:?}", extent.wobj, extent.min_mm, extent.max_mm);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Extent {
    /// The work object.
    pub wobj: String,
    /// Smallest x, y and z, mm.
    pub min_mm: [f64; 3],
    /// Largest x, y and z, mm.
    pub max_mm: [f64; 3],
}

impl Reached {
    fn of(program: &Program, name: impl Fn(&str) -> String) -> Self {
        let mut reached = Self::default();
        let mut before: Option<(u16, [f64; 3])> = None;
        for target in &program.targets {
            let position_mm = match target.goal {
                Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => position_mm,
                Goal::Joints { .. } => {
                    before = None;
                    continue;
                }
            };
            let wobj = program.wobjs.get(usize::from(target.wobj)).map_or("", |wobj| &wobj.name);
            reached.widen(&Extent { wobj: name(wobj), min_mm: position_mm, max_mm: position_mm });
            let way = before
                .filter(|(wobj, _)| *wobj == target.wobj)
                .map(|(_, from)| (0..3).map(|k| (position_mm[k] - from[k]).powi(2)).sum::<f64>().sqrt());
            before = Some((target.wobj, position_mm));
            if let Some(feed) = target.feed_mm_s.filter(|feed| *feed > 0.0 && !target.rapid) {
                reached.feed_mm_s = Some(wider(reached.feed_mm_s, [feed; 2]));
                reached.run_time_s += way.unwrap_or(0.0) / feed;
            }
            for axis in target.external.iter().flat_map(|external| external.used()).map(|axis| axis.to_string()) {
                if !reached.external_axes.contains(&axis) {
                    reached.external_axes.push(axis);
                }
            }
        }
        reached.external_axes.sort_unstable();
        reached
    }

    /// A line for each of its figures.
    fn in_words(&self) -> Vec<String> {
        let range = |k: usize, extent: &Extent| format!("{:.1} to {:.1}", extent.min_mm[k], extent.max_mm[k]);
        let mut lines: Vec<String> = self
            .extents
            .iter()
            .map(|extent| {
                let [x, y, z] = [0, 1, 2].map(|k| range(k, extent));
                format!("in {}: x {x}, y {y}, z {z} mm", extent.wobj)
            })
            .collect();
        if let Some([slowest, fastest]) = self.feed_mm_s {
            let feeds =
                if slowest < fastest { format!("{slowest:.1} to {fastest:.1}") } else { format!("{fastest:.1}") };
            lines.push(format!(
                "feeds {feeds} mm/s; about {:.1} min without joint moves and waits",
                self.run_time_s / 60.0
            ));
        }
        if !self.external_axes.is_empty() {
            lines.push(format!("external axes {}", self.external_axes.join(", ")));
        }
        lines
    }

    /// Extends the box so that it contains another one.
    fn widen(&mut self, other: &Extent) {
        match self.extents.iter_mut().find(|known| known.wobj.eq_ignore_ascii_case(&other.wobj)) {
            Some(known) => {
                for k in 0..3 {
                    known.min_mm[k] = known.min_mm[k].min(other.min_mm[k]);
                    known.max_mm[k] = known.max_mm[k].max(other.max_mm[k]);
                }
            }
            None => self.extents.push(other.clone()),
        }
    }
}

/// The range that contains both.
fn wider(a: Option<[f64; 2]>, b: [f64; 2]) -> [f64; 2] {
    a.map_or(b, |a| [a[0].min(b[0]), a[1].max(b[1])])
}

/// Statements that are kept or refused, and actions of the machine that are not motions, sorted by line.
fn kept_lines(program: &Program) -> Vec<KeptLine> {
    let kept = program.kept.iter().map(|kept| KeptLine { line: kept.line, reason: kept.reason.text() });
    let actions = program.actions.iter().map(|action| KeptLine { line: action.line, reason: action.kind.what() });
    let mut lines: Vec<KeptLine> = kept.chain(actions).collect();
    lines.sort_by_key(|kept| kept.line);
    lines
}

/// A kept statement.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// for kept in deflex_report::InspectFile::read("slot.mod", &program, &deflex_program::round_trip(&program, deflex_program::rapid::read)).kept {
///     println!("line {}: {}", kept.line, kept.reason);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct KeptLine {
    /// Line.
    pub line: usize,
    /// Reason.
    pub reason: &'static str,
}

impl InspectFile {
    /// A program that was read, and what its round trip showed.
    #[must_use]
    pub fn read(path: &str, program: &Program, proof: &RoundTrip) -> Self {
        // The names of CL input are the cell's, not the file's.
        fn names<'a>(own: bool, names: impl Iterator<Item = &'a str>) -> Vec<String> {
            names.filter(|_| own).map(str::to_owned).collect()
        }
        let own = program.language != Language::Cl;
        Self {
            path: path.to_owned(),
            language: Some(program.language.word()),
            dialect: Some(program.dialect),
            motion_targets: program.motion_targets(),
            literal_targets: program.literal_targets,
            arcs: program.arcs,
            refused: None,
            kept: kept_lines(program),
            round_trip: proof.holds(),
            round_trip_fault: proof.why.clone(),
            tools: names(own, program.tools.iter().map(|tool| &*tool.name)),
            wobjs: names(own, program.wobjs.iter().map(|wobj| &*wobj.name)),
            reach: Reached::of(program, |wobj| if own { wobj.to_owned() } else { CL_WOBJ.to_owned() }),
        }
    }

    /// A file that is refused as a whole.
    #[must_use]
    pub fn refused(path: &str, language: Option<Language>, errors: &[Diagnostic]) -> Self {
        let reason = errors.first().map_or_else(|| "not read".to_owned(), |error| error.message.clone());
        Self { path: path.to_owned(), language: language.map(Language::word), refused: Some(reason), ..Self::default() }
    }
}

/// The answer as JSON.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// use deflex_report::{InspectFile, InspectFiles};
///
/// let files = [InspectFile::read("slot.mod", &program, &deflex_program::round_trip(&program, deflex_program::rapid::read))];
/// let json = serde_json::to_string(&InspectFiles { files: &files }).expect("values that JSON can hold");
/// assert!(json.contains("motion_targets"));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
pub struct InspectFiles<'a> {
    /// The files in the order in which they were given.
    pub files: &'a [InspectFile],
}

/// The answer as text: a row for each file, then what was kept and refused.
#[must_use]
#[doc(hidden)]
pub fn inspect_table(files: &[InspectFile]) -> String {
    let width = files.iter().map(|file| file.path.chars().count()).max().unwrap_or(0).max(4);
    let mut out = format!(
        "{:width$}  {:8}  {:14}  {:>8}  {:>8}  {:>5}  {:>5}  round trip\n",
        "file", "language", "dialect", "motions", "literals", "arcs", "kept"
    );
    for file in files {
        let (language, dialect) = (file.language.unwrap_or("?"), file.dialect.unwrap_or("-"));
        let proof = match (&file.refused, file.round_trip) {
            (Some(_), _) => "refused",
            (None, true) => "holds",
            (None, false) => "FAILS",
        };
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{:width$}  {language:8}  {dialect:14}  {:>8}  {:>8}  {:>5}  {:>5}  {proof}",
            printable_line(&file.path),
            file.motion_targets,
            file.literal_targets,
            file.arcs,
            file.kept.len(),
        );
    }
    for file in files {
        details(file, &mut out);
    }
    let read: Vec<&InspectFile> = files.iter().filter(|file| file.refused.is_none()).collect();
    if read.len() > 1 {
        together(&read, &mut out);
    }
    out
}

/// A summary of all files together.
fn together(files: &[&InspectFile], out: &mut String) {
    let mut all = Reached::default();
    for Reached { extents, feed_mm_s, external_axes, run_time_s } in files.iter().map(|file| &file.reach) {
        extents.iter().for_each(|extent| all.widen(extent));
        all.feed_mm_s = feed_mm_s.map(|feed| wider(all.feed_mm_s, feed)).or(all.feed_mm_s);
        all.external_axes.extend_from_slice(external_axes);
        all.run_time_s += run_time_s;
    }
    all.external_axes.sort_unstable();
    all.external_axes.dedup();
    let names = |of: fn(&InspectFile) -> &Vec<String>| {
        let mut names: Vec<&str> = Vec::new();
        for name in files.iter().flat_map(|file| of(file)) {
            if !names.iter().any(|known| known.eq_ignore_ascii_case(name)) {
                names.push(name);
            }
        }
        names.join(", ")
    };
    let motions: usize = files.iter().map(|file| file.motion_targets).sum();
    // Writing to a String cannot fail.
    let _ = writeln!(out, "together: {} files, {motions} motions", files.len());
    let tools = names(|file| &file.tools);
    if !tools.is_empty() {
        let _ = writeln!(out, "together: tools {tools}; work objects {}", names(|file| &file.wobjs));
    }
    for line in all.in_words() {
        let _ = writeln!(out, "together: {line}");
    }
}

/// Tools, kept statements by reason, and faults of one file.
fn details(file: &InspectFile, out: &mut String) {
    let mut add = |line: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{}: {}", printable_line(&file.path), printable_line(&line));
    };
    if let Some(reason) = &file.refused {
        add(format!("refused: {reason}"));
        return;
    }
    if !file.tools.is_empty() {
        add(format!("tools {}; work objects {}", file.tools.join(", "), file.wobjs.join(", ")));
    }
    file.reach.in_words().into_iter().for_each(&mut add);
    let mut reasons: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for kept in &file.kept {
        reasons.entry(kept.reason).or_default().push(kept.line);
    }
    for (reason, lines) in reasons {
        const SHOWN: usize = 5; // the rest is in the JSON
        let shown: Vec<String> = lines.iter().take(SHOWN).map(ToString::to_string).collect();
        let more = if lines.len() > SHOWN { ", …" } else { "" };
        add(format!("{} kept: {reason} (line {}{more})", lines.len(), shown.join(", ")));
    }
    if let Some(fault) = &file.round_trip_fault {
        add(format!("round trip: {fault}"));
    }
}
