//! Runs a program and its correction on the same inputs and compares every motion.
//!
//! What a motion's correction is comes from a program that leaves nothing to read: the motions that were executed, with
//! their frames as constants and their poses as inline targets.

use super::machine::{Goal, Machine, Mark, Motion};
use super::oracle::Oracle;
use super::syntax;
use super::tree::{Kind, Module};
use super::value::{Frame, Val};
use deflex::cell::Cell;
use deflex::correct::{self, Correct, Corrected, Options, Status};
use deflex::program::{Program, Role, rapid};
use deflex::text::{Diagnostic, Source, applied};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::Mutex;

/// Written numbers are held in single precision: 1.2e-4 mm between 1 m and 2 m, in the three axes of nested frames.
const TOLERANCE_MM: f64 = 1e-3;
/// Eight decimals in single precision, through a renormalisation.
const TOLERANCE_RAD: f64 = 2e-6;
/// `Offs` and `RelTool` take their orientation from a base that is corrected for itself: what that leaves of 4 mm.
const SHIFTED_MM: f64 = 2e-2;

/// A cell in which each correction is its own: a constant force in work object axes on an arm of unequal joints, and nothing
/// that depends on the motion before: the tool turns to the orientation in the text of a circle point.
pub const CELL: &str = r#"
[robot]
model = "irb6700-150-3.20"
start_deg = [0, 0, 0, 0, 60, 0]
[robot.stiffness]
joint_nm_per_rad = [6e5, 5e5, 4e5, 9e4, 8e4, 5e4]
[limits]
max_correction_mm = 100.0
max_step_mm = 500.0
[controller]
compensates = []
arc_turn = "circle_point"
[tools.tCell]
tcp_mm = [0.0, 0.0, 180.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 5.0
cog_mm = [0.0, 0.0, 60.0]
[wobjs.wCell]
uframe_mm = [1200.0, 150.0, 650.0]
uframe_quat = [0.9659258, 0.0, 0.0, 0.2588190]
oframe_mm = [0.0, 0.0, 0.0]
oframe_quat = [1.0, 0.0, 0.0, 0.0]
[cut]
force = "constant"
force_n = [310.0, -190.0, 240.0]
frame = "wobj"
"#;

/// The tools and work objects of [`CELL`], as the interpreter knows them.
pub fn cell_file() -> Vec<(String, String, Val)> {
    let module = "MODULE C PROC x() t:=[TRUE,[[0,0,180],[1,0,0,0]],[5,[0,0,60],[1,0,0,0],0,0,0]]; \
        w:=[FALSE,TRUE,\"\",[[1200,150,650],[0.9659258,0,0,0.2588190]],[[0,0,0],[1,0,0,0]]]; ENDPROC ENDMODULE";
    let module = [syntax::module(module).unwrap()];
    let value = |i: usize, ty: &str| {
        let Kind::Assign(_, expr) = &module[0].routines[0].body[i].kind else { panic!("assignment") };
        Machine::new(&module, &[], Oracle::new(0)).eval(expr, ty).unwrap()
    };
    vec![
        ("TCELL".into(), "TOOLDATA".into(), value(0, "TOOLDATA")),
        ("WCELL".into(), "WOBJDATA".into(), value(1, "WOBJDATA")),
    ]
}

/// Longest offset in the axes of the tool, mm.
const LEVER_MM: f64 = 300.0;

/// What became of a program.
#[derive(Debug)]
pub enum Verdict {
    /// Every motion is corrected (so many), or as it was and said to be (so many, lines).
    Right { corrected: usize, left: Vec<u32> },
    /// Nothing is written.
    Refused(String),
    /// A motion goes elsewhere, or stays without a word.
    Wrong(String),
    /// No program to ask about.
    Invalid(String),
}

/// What all comparisons share.
pub struct Bench {
    pub cell: Cell,
    pub cell_file: Vec<(String, String, Val)>,
    /// Where the correction puts motions, computed once each: none depends on the motion before.
    known: Mutex<BTreeMap<Asked, Option<Vec<Frame>>>>,
}

/// A motion with its frames, and whether its orientation is corrected.
type Asked = (bool, String);

impl Bench {
    pub fn new() -> Self {
        let cell = Cell::read(&Source::new("cell.toml", CELL.as_bytes())).unwrap();
        Self { cell, cell_file: cell_file(), known: Mutex::default() }
    }

    /// Compares on each of the seeds; a panic is as wrong as any answer.
    pub fn judge(&self, texts: &[String], seeds: std::ops::Range<u64>, options: &Options) -> Verdict {
        let judged = || self.compared(texts, seeds, options);
        let panicked = |why: Box<dyn std::any::Any + Send>| {
            let why = why.downcast_ref::<String>().map_or("", String::as_str);
            Verdict::Wrong(format!("panics: {why}"))
        };
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(judged)).unwrap_or_else(panicked)
    }

    fn compared(&self, texts: &[String], seeds: std::ops::Range<u64>, options: &Options) -> Verdict {
        let parse = |texts: &[String]| texts.iter().map(|text| syntax::module(text)).collect::<Result<Vec<_>, _>>();
        let original = match parse(texts) {
            Ok(modules) => modules,
            Err(why) => return Verdict::Invalid(why),
        };
        let sources = texts.iter().enumerate().map(|(i, text)| Source::new(format!("m{i}.mod"), text.as_bytes()));
        let first = |errors: Vec<Diagnostic>| errors.first().map_or_else(String::new, ToString::to_string);
        let program = match rapid::read(sources.collect(), Vec::new()) {
            Ok(program) => program,
            Err(errors) => return Verdict::Refused(first(errors)),
        };
        let faults = program.faults();
        if !faults.is_empty() {
            return Verdict::Refused(first(faults));
        }
        let corrected = match correct::compensate(&program, &self.cell, options) {
            Ok(corrected) if corrected.failures.is_empty() => corrected,
            Ok(corrected) => return Verdict::Refused(first(corrected.failures)),
            Err(errors) => return Verdict::Refused(first(errors)),
        };
        let written = written(&program, &corrected);
        let modules = match parse(&written) {
            Ok(modules) => modules,
            Err(why) => return Verdict::Wrong(format!("the corrected program does not read: {why}")),
        };
        let same_lines = texts.iter().zip(&written).all(|(a, b)| a.lines().count() == b.lines().count());
        let inserted = inserted_lines(&program, &corrected);
        let report = Report::new(&program, &corrected);
        let (mut most, mut left) = (0, Vec::new());
        for seed in seeds {
            let mut before = Machine::new(&original, &self.cell_file, Oracle::new(seed));
            let ended = before.run();
            if let Some(why) = &ended
                && !why.starts_with("error")
            {
                return Verdict::Invalid(why.clone());
            }
            let mut after = Machine::new(&modules, &self.cell_file, Oracle::again(seed, &before.oracle));
            let ended_after = after.run();
            let is_inserted = |motion: &&Motion| inserted.contains(&(motion.module, motion.line));
            let own: Vec<&Motion> = after.motions.iter().filter(|motion| !is_inserted(motion)).collect();
            if ended != ended_after || before.motions.len() != own.len() {
                let now = (own.len(), ended_after);
                return Verdict::Wrong(format!("runs differently: {} {ended:?}, now {now:?}", before.motions.len()));
            }
            let (mut divided, mut at) = (BTreeSet::new(), 0);
            for motion in &after.motions {
                if !is_inserted(&motion) {
                    at += 1;
                } else if let Err(why) = is_on_the_way(motion, &before.motions, at) {
                    return Verdict::Wrong(format!("{why} (seed {seed})"));
                } else {
                    divided.insert(at);
                }
            }
            let pairs: Vec<_> = before.motions.iter().zip(own).collect();
            match self.compare(&pairs, same_lines, (&report, &divided)) {
                Ok(seen) => {
                    most = most.max(seen.corrected);
                    left.extend(seen.left);
                }
                Err(why) => return Verdict::Wrong(format!("{why} (seed {seed})")),
            }
        }
        left.sort_unstable();
        left.dedup();
        Verdict::Right { corrected: most, left }
    }

    /// `divided` has the motions with inserted points before them.
    fn compare(
        &self,
        pairs: &[(&Motion, &Motion)],
        same_lines: bool,
        (report, divided): (&Report, &BTreeSet<usize>),
    ) -> Result<Seen, String> {
        let originals: Vec<&Motion> = pairs.iter().map(|(before, _)| *before).collect();
        let wanted = self.answers(&originals, Correct::Pose);
        let mut seen = Seen::default();
        for (i, ((before, after), wanted)) in pairs.iter().zip(&wanted).enumerate() {
            let what = format!("line {}: {}", before.line, before.kind);
            if before.kind != after.kind || same_lines && before.line != after.line {
                return Err(format!("{what} is now {} on line {}", after.kind, after.line));
            }
            if !same_frames(before, after) {
                return Err(format!("{what}: tool, work object or displacement is another"));
            }
            let (Goal::Poses(old, ..), Goal::Poses(new, ..)) = (&before.goal, &after.goal) else {
                match (&before.goal, &after.goal) {
                    (Goal::Joints(a), Goal::Joints(b)) if a == b => continue,
                    _ => return Err(format!("{what}: joint target is another")),
                }
            };
            // The circle point of an arc that is divided is that of its last part.
            let skipped = if divided.contains(&i) { old.len() - 1 } else { 0 };
            let (old, new) = (&old[skipped..], &new[skipped..]);
            let wanted = wanted.as_ref().map(|wanted| &wanted[skipped.min(wanted.len())..]);
            let (from, to) = (before.base()?, after.base()?);
            let moved = old.iter().zip(new).any(|(a, b)| a != b);
            let close = |a: &Frame, b: &Frame| {
                let (mm, rad) = a.apart(b);
                mm <= TOLERANCE_MM && rad <= TOLERANCE_RAD
            };
            if !moved {
                if wanted.iter().any(|w| w.iter().zip(old).all(|(w, p)| close(w, &from.then(p)))) {
                    continue;
                }
                if !report.left(before) {
                    return Err(format!("{what} is not corrected, and nothing says so"));
                }
                seen.left.push(before.line);
                continue;
            }
            // A motion through air may go along with the numbers that it shares with a cut.
            if before.mark() == Mark::Air {
                let moved = |(old, new): (&Frame, &Frame)| from.then(old).apart(&to.then(new)).0;
                let by = old.iter().zip(new).map(moved).fold(0.0, f64::max);
                if by > report.most_mm || !old.iter().zip(new).all(|(old, new)| report.says_air_goes(before, old, new))
                {
                    return Err(format!("{what} through air moved by {by:.4} mm, not as the report says"));
                }
                continue;
            }
            if report.only_kept(before) {
                return Err(format!("{what} is said to be kept, and moved"));
            }
            let Some(wanted) = wanted else { return Err(format!("{what} has no correction, and moved")) };
            let there: Vec<Frame> = new.iter().map(|p| to.then(p)).collect();
            let as_wanted = |wanted: &[Frame]| wanted.iter().zip(&there).all(|(w, p)| close(w, p));
            let position = || self.answers(&originals[i..=i], Correct::Position).remove(0);
            let right = as_wanted(wanted)
                || position().is_some_and(|wanted| as_wanted(&wanted[skipped.min(wanted.len())..]))
                || before.shifted && self.lands(before, after);
            if !right {
                let (mm, rad) = wanted[wanted.len() - 1].apart(&there[there.len() - 1]);
                let by = from.then(&old[old.len() - 1]).apart(&there[there.len() - 1]).0;
                return Err(format!("{what} moved by {by:.3} mm is {mm:.4} mm, {rad:.1e} rad from its correction"));
            }
            seen.corrected += 1;
        }
        Ok(seen)
    }

    fn answers(&self, motions: &[&Motion], correct: Correct) -> Vec<Option<Vec<Frame>>> {
        let options = Options { correct, ..Options::default() };
        let key = |motion: &Motion| (correct == Correct::Pose, flattened(&[motion]).unwrap_or_default());
        let keys: Vec<Asked> = motions.iter().map(|motion| key(motion)).collect();
        let mut new: BTreeMap<&Asked, &Motion> = BTreeMap::new();
        {
            let known = self.known.lock().unwrap();
            new.extend(keys.iter().zip(motions.iter().copied()).filter(|(key, _)| !known.contains_key(*key)));
        }
        if !new.is_empty() {
            let wanted: Vec<&Motion> = new.values().copied().collect();
            let all = self.flat(&wanted, &options);
            for (n, (key, motion)) in new.into_iter().enumerate() {
                let one = match &all {
                    Some(all) => Some(all[n].clone()),
                    // One that has no answer hides the others.
                    None => self.flat(&[motion], &options).map(|mut one| one.remove(0)),
                };
                self.known.lock().unwrap().insert(key.clone(), one);
            }
        }
        let known = self.known.lock().unwrap();
        keys.iter().map(|key| known[key].clone()).collect()
    }

    /// Whether the loaded TCP is where the original's target is, if not as it is turned.
    fn lands(&self, before: &Motion, after: &Motion) -> bool {
        let read = |motion: &Motion| {
            let text = flattened(&[motion]).ok()?;
            rapid::read(vec![Source::new("flat.mod", text.as_bytes())], Vec::new()).ok()
        };
        let (Some(before), Some(after)) = (read(before), read(after)) else { return false };
        let there = correct::predict(&after, &self.cell, &Options::default(), Some(&before));
        there.is_ok_and(|there| !there.rows.is_empty() && there.rows.iter().all(|r| r.error_norm_mm() < SHIFTED_MM))
    }

    /// Where the correction puts each motion, in the world.
    fn flat(&self, motions: &[&Motion], options: &Options) -> Option<Vec<Vec<Frame>>> {
        let text = flattened(motions).ok()?;
        let program = rapid::read(vec![Source::new("flat.mod", text.as_bytes())], Vec::new()).ok()?;
        let corrected = correct::compensate(&program, &self.cell, options).ok()?;
        if !corrected.failures.is_empty() {
            return None;
        }
        let module = [syntax::module(&written(&program, &corrected)[0]).ok()?];
        let mut machine = Machine::new(&module, &[], Oracle::new(0));
        machine.run();
        if machine.motions.len() != motions.len() {
            return None;
        }
        let poses = |motion: &Motion| match &motion.goal {
            Goal::Poses(poses, ..) => {
                let base = motion.base().ok()?;
                Some(poses.iter().map(|p| base.then(p)).collect())
            }
            Goal::Joints(_) => Some(Vec::new()),
        };
        machine.motions.iter().map(poses).collect()
    }
}

/// The options with which a generated program is corrected: some with clones, some with inserted targets. Further motions are further
/// moments for a trap, so that a program with a trap would run differently.
pub fn options_for(modules: &[String], seed: u64) -> Options {
    let has_trap = modules.iter().any(|module| module.contains("TRAP"));
    Options {
        allow_clones: seed % 4 == 3,
        subdivide: (seed % 4 == 1 && !has_trap).then_some(2e-5),
        ..Options::default()
    }
}

/// Modules and lines of the motions that a correction has inserted.
fn inserted_lines(program: &Program, corrected: &Corrected) -> BTreeSet<(usize, u32)> {
    let mut lines = BTreeSet::new();
    let edits = corrected.rewritten.as_ref().map_or(&[][..], |rewritten| &rewritten.edits[..]);
    for (module, (source, edits)) in program.sources.iter().zip(edits).enumerate() {
        let mut more = 0;
        for edit in edits.iter().filter(|edit| edit.span.start == edit.span.end) {
            let before = source.bytes[..edit.span.start as usize].iter().filter(|byte| **byte == b'\n').count();
            let count = edit.content.iter().filter(|byte| **byte == b'\n').count();
            let first = before + more + 1;
            lines.extend((first..first + count).map(|line| (module, line as u32)));
            more += count;
        }
    }
    lines
}

/// Whether an inserted motion lies near the way from one motion of the original to the next one, `at`, in this very run.
fn is_on_the_way(inserted: &Motion, originals: &[Motion], at: usize) -> Result<(), String> {
    /// Corrections of this cell are smaller, mm.
    const NEAR_MM: f64 = 15.0;
    let what = format!("line {} is inserted", inserted.line);
    let (Some(next), Some(from)) = (originals.get(at), at.checked_sub(1)) else {
        return Err(format!("{what} where no motion follows, or none comes before"));
    };
    let place = |motion: &Motion| -> Result<Option<[f64; 3]>, String> {
        let base = motion.base()?;
        Ok(match &motion.goal {
            Goal::Poses(poses, ..) => poses.last().map(|pose| base.then(pose).p),
            Goal::Joints(_) => None,
        })
    };
    // The TCP of another tool begins elsewhere.
    if next.kind.contains('C') || originals[from].tool != next.tool {
        return Ok(());
    }
    let (Some(a), Some(b), Some(p)) = (place(&originals[from])?, place(next)?, place(inserted)?) else { return Ok(()) };
    let way: [f64; 3] = std::array::from_fn(|i| b[i] - a[i]);
    let square: f64 = way.iter().map(|x| x * x).sum();
    let along: f64 = (0..3).map(|i| (p[i] - a[i]) * way[i]).sum();
    let share = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
    let off = (0..3).map(|i| (p[i] - a[i] - share * way[i]).powi(2)).sum::<f64>().sqrt();
    if off > NEAR_MM { Err(format!("{what} {off:.1} mm from the path of this run")) } else { Ok(()) }
}

#[derive(Default)]
struct Seen {
    corrected: usize,
    left: Vec<u32>,
}

fn written(program: &Program, corrected: &Corrected) -> Vec<String> {
    let edits = corrected.rewritten.as_ref().map_or(&[][..], |rewritten| &rewritten.edits[..]);
    let write = |(i, source): (usize, &Source)| {
        let bytes = applied(&source.bytes, edits.get(i).unwrap_or(&Vec::new()));
        String::from_utf8_lossy(&bytes).into_owned()
    };
    program.sources.iter().enumerate().map(write).collect()
}

fn same_frames(a: &Motion, b: &Motion) -> bool {
    let (mm, rad) = a.displacement.apart(&b.displacement);
    a.tool == b.tool && a.wobj == b.wobj && mm < 1e-9 && rad < 1e-9 && a.offsets == b.offsets
}

/// A program of the motions alone.
fn flattened(motions: &[&Motion]) -> Result<String, String> {
    let (mut data, mut body) = (String::new(), String::new());
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    let mut name = |ty: &str, value: String| {
        let next = format!("d{}", names.len());
        names
            .entry(format!("{ty}{value}"))
            .or_insert_with(|| {
                let _ = writeln!(data, "PERS {ty} {next}:={value};");
                next
            })
            .clone()
    };
    for motion in motions {
        let tool = name("tooldata", motion.tool.text());
        let wobj = name("wobjdata", motion.wobj.text());
        let joint = motion.kind.contains('J');
        let line = match &motion.goal {
            Goal::Joints(joints) => {
                format!("MoveAbsJ [{},[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,{tool}", joints.text())
            }
            Goal::Poses(poses, conf, axes) => {
                let target = |pose: &Frame| {
                    let pose = motion.displacement.then(pose);
                    let (p, q) = (Val::nums(&pose.p).text(), Val::nums(&pose.q).text());
                    format!("[{p},{q},{},{}]", conf.text(), axes.text())
                };
                let targets: Vec<String> = poses.iter().map(target).collect();
                let word = match (targets.len(), joint) {
                    (2, _) => "MoveC",
                    (_, true) => "MoveJ",
                    _ => "MoveL",
                };
                format!("{word} {},v50,fine,{tool}", targets.join(","))
            }
        };
        let mark = if motion.mark() == Mark::Air { "air" } else { "cut" };
        let _ = writeln!(body, "! deflex {mark}\n{line}\\WObj:={wobj};");
    }
    Ok(format!("MODULE Flat\n{data}PROC main()\n{body}ENDPROC\nENDMODULE\n"))
}

/// How far a motion goes from its programmed target.
struct Went {
    by_mm: [f64; 3],
    turn_rad: f64,
}

/// What was said of each line.
struct Report {
    /// By source and line: rows that are kept, rows that are not.
    rows: BTreeMap<(usize, u32), (usize, usize)>,
    /// The farthest that the correction of a cut moves anything, mm, also at the end of an offset in the axes of the tool. A cut that this run
    /// leaves out counts too.
    most_mm: f64,
    /// Where motions through air went along.
    air: BTreeMap<(usize, u32), Vec<Went>>,
    kept: Vec<(usize, u32)>,
    notes: Vec<String>,
}

impl Report {
    fn new(program: &Program, corrected: &Corrected) -> Self {
        let mut rows: BTreeMap<(usize, u32), (usize, usize)> = BTreeMap::new();
        let (mut air, mut most_mm) = (BTreeMap::<_, Vec<Went>>::new(), TOLERANCE_MM);
        for row in &corrected.rows {
            let target = program.targets.iter().find(|t| t.role == Role::End && t.ordinal == row.target);
            let source = target.map_or(0, |t| usize::from(t.source));
            let count = rows.entry((source, row.line)).or_default();
            let turn_rad = row.correction_deg.iter().map(|deg| deg.to_radians().powi(2)).sum::<f64>().sqrt();
            match row.status {
                Status::Air => {
                    air.entry((source, row.line)).or_default().push(Went { by_mm: row.correction_mm, turn_rad });
                }
                _ => most_mm = most_mm.max(row.correction_norm_mm() + LEVER_MM * turn_rad),
            }
            if row.status == Status::Ok { count.1 += 1 } else { count.0 += 1 }
        }
        let mut kept: Vec<_> = program.kept.iter().map(|k| (k.source, k.line as u32)).collect();
        let mut notes = Vec::new();
        for note in program.diagnostics.iter().chain(&corrected.notes) {
            if let Some(source) = program.sources.iter().position(|s| s.name == note.file) {
                kept.push((source, note.line as u32));
            }
            notes.push(note.message.to_uppercase());
        }
        Self { rows, most_mm, air, kept, notes }
    }

    /// Whether a row of a motion through air says that it goes from one pose to the other, in the work object.
    fn says_air_goes(&self, motion: &Motion, old: &Frame, new: &Frame) -> bool {
        let turn = old.apart(new).1;
        let is = |went: &Went| {
            let by = (0..3).map(|i| (new.p[i] - old.p[i] - went.by_mm[i]).powi(2)).sum::<f64>().sqrt();
            by <= TOLERANCE_MM && (turn - went.turn_rad).abs() <= TOLERANCE_RAD
        };
        self.air.get(&(motion.module, motion.line)).is_some_and(|all| all.iter().any(is))
    }

    fn left(&self, motion: &Motion) -> bool {
        let place = (motion.module, motion.line);
        self.kept.contains(&place)
            || self.rows.get(&place).is_some_and(|(kept, _)| *kept > 0)
            || self.notes.iter().any(|note| note.contains(&format!("`{}`", motion.routine)))
    }

    fn only_kept(&self, motion: &Motion) -> bool {
        self.rows.get(&(motion.module, motion.line)).is_some_and(|(kept, not)| *kept > 0 && *not == 0)
    }
}

/// What stands in modules, for those that print it.
pub fn motions(texts: &[String], seed: u64) -> Vec<Motion> {
    let modules: Vec<Module> = texts.iter().filter_map(|text| syntax::module(text).ok()).collect();
    let cell_file = cell_file();
    let mut machine = Machine::new(&modules, &cell_file, Oracle::new(seed));
    machine.run();
    machine.motions
}

/// Asks `f` of all, on as many threads as there are; each solves its programs alone, which are too small to be shared out.
pub fn spread<T: Sync, R: Send>(all: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    /// Programs call programs, and so does what runs them.
    const STACK: usize = 16 << 20;
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let part = all.len().div_ceil(threads).max(1);
    let f = &f;
    std::thread::scope(|scope| {
        let start = |part| {
            let alone = rayon::ThreadPoolBuilder::new().num_threads(1).stack_size(STACK).build().unwrap();
            scope.spawn(move || alone.install(|| <[T]>::iter(part).map(f).collect::<Vec<_>>()))
        };
        let parts: Vec<_> = all.chunks(part).map(start).collect();
        parts.into_iter().flat_map(|part| part.join().unwrap()).collect()
    })
}
