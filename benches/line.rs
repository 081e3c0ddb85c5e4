//! The line from text to text, stage by stage and as a whole, and identification.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use deflex::cell::Cell;
use deflex::correct::{Options, Prepared, Sinks, compensate, compensate_chunks};
use deflex::identify::{Input, identify};
use deflex::measured::Table;
use deflex::program::rapid::{self, Chunks};
use deflex::program::{Change, Goal, Program, RewriteOptions, cl};
use deflex::report::csv_rows;
use deflex::text::{Source, apply};
use std::fmt::Write;
use std::hint::black_box;
use std::path::Path;

/// Targets of a benchmark: some chunks of a stream.
const TARGETS: usize = 2000;

fn file(path: &str) -> Source {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    Source::new(path.display().to_string(), std::fs::read(path).expect("a file of the repository"))
}

fn cell() -> Cell {
    Cell::read(&file("benches/cell.toml")).expect("a valid cell")
}

/// A row over a wavy surface with five degrees of lead: x mm, height mm, half the angle of the tool from straight down.
fn surface(i: usize) -> (f64, f64, f64) {
    let x = 0.3 * i as f64;
    (x, 40.0 + 15.0 * (0.02 * x).sin(), 0.0436 + 0.5 * (0.3 * (0.02 * x).cos()).atan())
}

fn rapid_program() -> String {
    let mut text = "MODULE Mill
  PERS tooldata tMill:=[TRUE,[[321.5,0,148.25],[0.70710678,0,0.70710678,0]],[38,[90,0,60],[1,0,0,0],0,0,0]];
  PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[1600,-200,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PROC main()
"
    .to_owned();
    for (x, z, half) in (0..TARGETS).map(surface) {
        let (sin, cos) = half.sin_cos();
        let _ = writeln!(
            text,
            "    MoveL [[{x:.3},0.000,{z:.3}],[0.00000000,{cos:.8},0.00000000,{sin:.8}],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tMill\\WObj:=wPart;",
        );
    }
    text + "  ENDPROC\nENDMODULE\n"
}

fn cl_program() -> String {
    let mut text = "UNITS/MM\nCUTTER/20,2\nSPINDL/RPM,12000,CLW\nFEDRAT/3000,MMPM\nMULTAX/ON\n".to_owned();
    for (x, z, half) in (0..TARGETS).map(surface) {
        let (sin, cos) = (2.0 * half).sin_cos();
        let _ = writeln!(text, "GOTO/ {x:.4}, 0.0000, {z:.4}, {:.9}, 0.000000000, {cos:.9}", -sin);
    }
    text + "FINI\n"
}

fn read(text: &str) -> Program {
    rapid::read(vec![Source::new("part.mod", text.as_bytes())], Vec::new()).expect("a valid program")
}

/// Every target a tenth of a millimetre higher.
fn raised(program: &Program) -> Vec<Option<Change>> {
    let raise = |target: &deflex::program::Target| match target.goal {
        Goal::Pose { position_mm: [x, y, z], quat, .. } => {
            Some(Change { position_mm: [x, y, z + 0.1], quat: Some(quat), conf: None, external: None })
        }
        _ => None,
    };
    program.targets.iter().map(raise).collect()
}

fn text(c: &mut Criterion) {
    let (rapid_text, cl_text, cell) = (rapid_program(), cl_program(), cell());
    let options = cell.cl.as_ref().expect("[cl]").options.clone();
    let program = read(&rapid_text);
    let changes = raised(&program);
    let rows = compensate(&program, &cell, &Options::default()).expect("a valid program").rows;
    let mut group = c.benchmark_group("text");
    group.throughput(Throughput::Elements(TARGETS as u64));
    group.bench_function("parse RAPID", |b| b.iter(|| read(black_box(&rapid_text))));
    group.bench_function("parse CL", |b| {
        b.iter(|| cl::read(Source::new("part.apt", black_box(cl_text.as_bytes())), &options));
    });
    group.bench_function("rewrite RAPID", |b| {
        b.iter(|| {
            let rewritten = program.rewrite(black_box(&changes), &[], &RewriteOptions::default());
            let mut out = Vec::with_capacity(2 * rapid_text.len());
            apply(&program.sources[0].bytes, &rewritten.edits[0], &mut out).map(|()| out)
        });
    });
    group.bench_function("format report", |b| b.iter(|| csv_rows(black_box(&rows))));
}

fn mechanics(c: &mut Criterion) {
    let (cell, program) = (cell(), read(&rapid_program()));
    let prepared = Prepared::new(&program, &cell, &Options::default()).expect("a valid program");
    let mut group = c.benchmark_group("mechanics");
    let (point, situation) = (&prepared.points[TARGETS / 2], prepared.situation(TARGETS / 2));
    let arm = &cell.arm;
    let flange = arm.robot.forward(&point.motor);
    group.bench_function("inverse kinematics", |b| {
        b.iter(|| arm.robot.inverse_near(black_box(&flange), black_box(&point.motor)));
    });
    group.bench_function("inverse equilibrium", |b| {
        b.iter(|| arm.command(black_box(&situation), &point.reference, &point.motor, &point.travel));
    });
    group.bench_function("forward equilibrium", |b| {
        b.iter(|| arm.predict(black_box(&situation), &point.motor, &point.travel));
    });
    group.throughput(Throughput::Elements(TARGETS as u64));
    group.bench_function("ordered pass", |b| b.iter(|| Prepared::new(black_box(&program), &cell, &Options::default())));
}

fn job(c: &mut Criterion) {
    let (cell, text) = (cell(), rapid_program());
    let mut group = c.benchmark_group("job");
    group.throughput(Throughput::Elements(TARGETS as u64));
    group.bench_function("whole program, all threads", |b| {
        b.iter(|| compensate(&read(black_box(&text)), &cell, &Options::default()));
    });
    group.bench_function("in chunks, one thread", |b| {
        b.iter(|| {
            let (mut program, mut report) = (Vec::new(), Vec::new());
            let chunks = Chunks::new("part.mod", black_box(text.as_bytes()), &[]).ok().flatten()?;
            let mut sinks =
                Sinks { report: &mut report, rows: &|rows| csv_rows(rows), each: &mut |_| (), progress: &|_, _| () };
            compensate_chunks(chunks, &cell, &Options::default(), 1, &mut program, &mut sinks).ok()
        });
    });
}

fn identification(c: &mut Criterion) {
    let cell = Cell::read(&file("samples/closed-loop/cell.toml")).expect("a valid cell");
    let runs = || {
        let program = rapid::read(vec![file("samples/closed-loop/part.mod")], Vec::new()).expect("a valid program");
        vec![(program, Table::read(&file("samples/closed-loop/measured.csv")).expect("a valid table")).into()]
    };
    let mut group = c.benchmark_group("identification");
    group.sample_size(10);
    group.bench_function("closed-loop sample", |b| {
        let identified = |runs| {
            identify(Input {
                cell: &cell,
                runs: black_box(runs),
                poses: vec![],
                tool: None,
                data_hash: "",
                written: Default::default(),
                progress: &|_| true,
            })
        };
        b.iter_batched(runs, identified, BatchSize::PerIteration);
    });
}

criterion_group!(benches, text, mechanics, job, identification);
criterion_main!(benches);
