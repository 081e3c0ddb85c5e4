//! What must hold for any bytes at all. The fuzz targets ask it of made-up bytes, `tests/suite/fuzz_regressions.rs` of those that
//! once broke it.

#![allow(dead_code)] // each fuzz target asks one of the questions

use deflex::cell::{Cell, backup_template, described, described_template};
use deflex::correct::{self, Options};
use deflex::measured::Table;
use deflex::program::cl::{self, ClOptions, Units};
use deflex::program::{
    Goal, Language, Program, ReadOptions, RewriteOptions, Target, detect, jbi, krl, rapid, read, tp, ur,
};
use deflex::robot::BUILTIN;
use deflex::session::write;
use deflex::stock::{ClosedMesh, read_stl};
use deflex::text::{Diagnostic, Source, apply};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// A cell whose only load is a constant force: what is asked for is the way through, not the figures.
static CELL: LazyLock<Cell> = LazyLock::new(|| {
    let text = include_str!("cell.toml");
    Cell::read(&Source::new("cell.toml", text)).expect("the cell of the fuzz targets is read")
});

/// Targets of a program for each of its bytes, and those that a loop may make of a short one.
const TARGETS_PER_BYTE: usize = 1;
const TARGETS_OF_LOOPS: usize = 200_000;

fn cl_options() -> ClOptions {
    ClOptions {
        tool: Some("tMill".into()),
        wobj: "wPart".into(),
        units: Some(Units::Millimetre),
        arc_tolerance_mm: 0.01,
        ..ClOptions::default()
    }
}

/// RAPID: read or refused in words; what is read survives a write.
pub(crate) fn rapid(bytes: &[u8]) {
    judge(bytes, rapid::read(vec![Source::new("part.mod", bytes)], Vec::new()));
}

/// CL: the same.
pub(crate) fn cl(bytes: &[u8]) {
    judge(bytes, cl::read(Source::new("part.cl", bytes), &cl_options()));
}

/// A KRL program, routines and data list in one file: the same.
pub(crate) fn krl(bytes: &[u8]) {
    judge(bytes, krl::read(vec![Source::new("part.src", bytes)], Vec::new()));
}

/// A FANUC TP program: what holds for any program holds for it.
pub(crate) fn tp(bytes: &[u8]) {
    judge(bytes, tp::read(vec![Source::new("part.ls", bytes)], Vec::new()));
}

/// A URScript program: what holds for any program holds for it.
pub(crate) fn ur(bytes: &[u8]) {
    judge(bytes, ur::read(vec![Source::new("part.script", bytes)], Vec::new()));
}

/// An INFORM job: what holds for any program holds for it.
pub(crate) fn jbi(bytes: &[u8]) {
    judge(bytes, jbi::read(vec![Source::new("part.jbi", bytes)], Vec::new()));
}

/// A cell file: read, or refused in words.
pub(crate) fn cell(bytes: &[u8]) {
    if let Err(errors) = Cell::read(&Source::new("cell.toml", bytes)) {
        said(&errors);
    }
}

/// A measured file: read, or refused in words.
pub(crate) fn measured(bytes: &[u8]) {
    match Table::read(&Source::new("measured.csv", bytes)) {
        Ok(table) => drop(table.forces()),
        Err(errors) => said(&errors),
    }
}

/// A cell file that was made is TOML, whatever it was made from.
fn is_toml(text: &str) {
    if let Err(error) = text.parse::<toml::Table>() {
        panic!("{error}\n{text}");
    }
}

/// A robot description: refused in words, or a cell file.
pub(crate) fn urdf(bytes: &[u8]) {
    let source = Source::new("robot.urdf", bytes);
    match described(&source, None) {
        Ok(described) => is_toml(&described_template(&described, "robot.urdf")),
        Err(errors) => said(&errors),
    }
}

/// A backup, `MOC.cfg` up to the first word MODULE and a module from there on: refused in words, or a cell file.
pub(crate) fn backup(bytes: &[u8]) {
    let at = bytes.windows(6).position(|word| word == b"MODULE").unwrap_or(bytes.len());
    let (moc, module) = (Source::new("MOC.cfg", &bytes[..at]), Source::new("user.sys", &bytes[at..]));
    match backup_template(&moc, &[module], Some(&BUILTIN[0].model)) {
        Ok(text) => is_toml(&text),
        Err(errors) => said(&errors),
    }
}

/// An STL file: refused in words, or a solid of a size that is a number.
pub(crate) fn stl(bytes: &[u8]) {
    match read_stl(bytes).map(|triangles| ClosedMesh::new(&triangles)) {
        Ok(Ok(mesh)) => assert!(mesh.bounds().iter().all(|corner| corner.iter().all(|value| value.is_finite()))),
        Ok(Err(error)) => assert!(!error.to_string().is_empty()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// A run's ID in the name of a marker.
const ID: &str = "00112233445566778899aabbccddeeff";

/// A marker that a killed run is said to have left: whatever stands in it, no file of the user changes.
pub(crate) fn marker(bytes: &[u8]) {
    /// Two files of the user, in the marker's folder and beside it; and what the marker may name as staged.
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
        let memory = Path::new("/dev/shm");
        let root = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let folder = root.join(format!("deflex-marker-{}", std::process::id())).join("out");
        fs::create_dir_all(&folder).expect("a folder to try in");
        for file in [folder.join("mine.txt"), folder.join("../mine.txt")] {
            fs::write(file, "mine").expect("a file of the user");
        }
        folder
    });
    let (mark, staged) =
        (FOLDER.join(format!("deflex-unfinished-{ID}.json")), FOLDER.join(format!(".deflex-{ID}-0.tmp")));
    fs::write(&mark, bytes).expect("a marker");
    fs::write(&staged, "staged").expect("a staged file");
    write([(FOLDER.join("new.txt"), &b"new"[..])], [] as [&Path; 0]).expect("an output");
    for file in [FOLDER.join("mine.txt"), FOLDER.join("../mine.txt")] {
        assert_eq!(fs::read(file).expect("a file of the user"), b"mine");
    }
    assert_eq!(fs::read(FOLDER.join("new.txt")).expect("the output"), b"new");
    let names = fs::read_dir(&*FOLDER).expect("the folder").count();
    assert!(names <= 4, "{names} files");
}

/// The whole way from program bytes to corrected ones.
pub(crate) fn compensate(bytes: &[u8]) {
    let source = Source::new("part", bytes);
    let language = detect(&source.name, bytes).unwrap_or(Language::Rapid);
    let program = read(language, vec![source], Vec::new(), &ReadOptions { cl: &cl_options(), look: false });
    // Programs of thousands of targets say nothing new and take long.
    let Some(program) = program.ok().filter(|program| program.targets.len() < 500) else { return };
    for allow_clones in [false, true] {
        let options = Options { allow_clones, subdivide: Some(1e-5), ..Options::default() };
        match correct::compensate(&program, &CELL, &options) {
            Err(errors) => said(&errors),
            Ok(corrected) => {
                if let Some(rewritten) = corrected.rewritten.filter(|_| corrected.failures.is_empty()) {
                    for (source, edits) in program.sources.iter().zip(&rewritten.edits) {
                        let mut written = Vec::new();
                        apply(&source.bytes, edits, &mut written).expect("a vector takes every byte");
                    }
                }
            }
        }
    }
}

/// What holds for any program that is read, and for any that is not.
fn judge(bytes: &[u8], program: Result<Program, Vec<Diagnostic>>) {
    let program = match program {
        Ok(program) => program,
        Err(errors) => return said(&errors),
    };
    assert_eq!(program.sources[0].bytes, bytes, "the bytes are kept as they are");
    let most = TARGETS_OF_LOOPS + TARGETS_PER_BYTE * bytes.len();
    assert!(program.targets.len() <= most, "{} targets of {} bytes", program.targets.len(), bytes.len());
    assert!(program.kept.iter().all(|kept| kept.span.range().end <= bytes.len() && !kept.reason.text().is_empty()));
    let unchanged = program.rewrite(&vec![None; program.targets.len()], &[], &RewriteOptions::default());
    assert!(unchanged.edits.iter().all(Vec::is_empty), "nothing changed, yet edited");
    // Further out a controller's single precision holds no millimetre: nothing comes back to a tenth there.
    const FAR_MM: f64 = 1e6;
    let far = |target: &Target| match target.goal {
        Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => position_mm.iter().any(|v| v.abs() > FAR_MM),
        Goal::Joints { .. } => false,
    };
    if program.targets.iter().any(far) {
        return;
    }
    let language = program.language;
    let proof = deflex::program::round_trip(&program, |written, context| {
        read(language, written, context, &ReadOptions { cl: &cl_options(), look: false })
    });
    assert!(proof.identical, "writing without a change changes bytes");
    assert!(proof.shifted_ok, "a shift does not come back: {:?}", proof.why);
}

/// A refusal has a code and words.
fn said(errors: &[Diagnostic]) {
    assert!(!errors.is_empty(), "refused without a reason");
    assert!(errors.iter().all(|error| !error.code.is_empty() && !error.message.is_empty()));
}
