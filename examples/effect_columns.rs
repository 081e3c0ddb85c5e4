//! What every number of every effect does to measured rows, as CSV: the columns that any linear fit could use.
//!
//! `cargo run --release --example effect_columns -- CELL (PROGRAM MEASURED OUT)…`: the effects are those that the first program's rows can
//! show; each column is the motion of the TCP (mm, work object axes, three lines a row: x, y, z) for one typical size of a number.
//! `samples/plant/judge.py` fits plain rivals of `deflex identify` to them.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use deflex::cell::Cell;
use deflex::correct::{Options, Prepared};
use deflex::effects::{Effect, KINDS, Shape, Survey, gear_harmonic};
use deflex::equilibrium::Arm;
use deflex::measured::Table;
use deflex::program::rapid;
use deflex::robot::Joints;
use deflex::text::Source;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::fmt::Write;
use std::path::Path;

/// Waves a turn that every joint is given: what an axis or an encoder off its centre does.
const ECCENTRIC_ORDERS: [f64; 2] = [1.0, 2.0];
/// Time constants that are tried, as shares of the run.
const TIME_CONSTANTS: [f64; 3] = [0.2, 0.8, 3.0];
/// Step of a column, as a share of the number's typical size.
const STEP: f64 = 1e-2;

struct Run {
    prepared: Prepared,
    out: String,
}

fn source(path: &str) -> Source {
    Source::new(path, std::fs::read(Path::new(path)).unwrap())
}

fn run(cell: &Cell, program: &str, measured: &str, out: &str) -> Run {
    let program = rapid::read(vec![source(program)], Vec::new()).unwrap();
    let forces = Some(Table::read(&source(measured)).unwrap().forces());
    let prepared = Prepared::new(&program, cell, &Options { forces, ..Options::default() }).unwrap();
    Run { prepared, out: out.to_owned() }
}

/// Where the arm takes every target, mm.
fn positions(arm: &Arm, run: &Run) -> Vec<Vector3<f64>> {
    let points = &run.prepared.points;
    let at = |i: usize| {
        let found = arm.predict(&run.prepared.situation(i), &points[i].motor, &points[i].travel).unwrap();
        run.prepared.seen(i, found.wobj_from_tcp).translation.vector * 1e3
    };
    (0..points.len()).into_par_iter().map(at).collect()
}

fn survey(cell: &Cell, run: &Run) -> Survey {
    let points = &run.prepared.points;
    let motors = || points.iter().map(|point| point.motor);
    let times = || points.iter().map(|point| point.time);
    Survey {
        axes: cell.arm.robot.axes,
        stiffness_declared: cell.arm.stiffness.is_some(),
        part_declared: false,
        clamps: 0,
        has_force: true,
        has_cut_length: true,
        cut_mm: None,
        has_payload: false,
        has_speed: true,
        time: Some((times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max))),
        temperature: None,
        moving_units: Vec::new(),
        motor_min: motors().reduce(|a, b| a.inf(&b)).unwrap(),
        motor_max: motors().reduce(|a, b| a.sup(&b)).unwrap_or_else(Joints::zeros),
    }
}

/// Every effect of the registry with each time constant that it may have, and waves of an eccentric axis.
fn effects(survey: &Survey) -> Vec<Box<dyn Effect>> {
    let mut all: Vec<Box<dyn Effect>> = Vec::new();
    for kind in KINDS.iter().filter(|kind| kind.shape != Shape::Map) {
        for effect in (kind.candidates)(survey) {
            let Some(name) = kind.time_constant else {
                all.push(effect);
                continue;
            };
            let Some((from, to)) = survey.time else { continue };
            let with = |share: f64| {
                let values = effect.parameters();
                let values = values.iter().map(|p| if p.name == name { share * (to - from) } else { p.value });
                effect.with_values(&values.collect::<Vec<_>>())
            };
            all.extend(TIME_CONSTANTS.map(with));
        }
    }
    let waves: Vec<_> = (1..=6).flat_map(|joint| ECCENTRIC_ORDERS.map(|order| (joint, order))).collect();
    all.push(gear_harmonic(&waves));
    all
}

/// The arm with one effect more, which stands in place of one of its kind: springs that a cell has without saying so are there once.
fn with(cell: &Cell, effect: Option<Box<dyn Effect>>) -> Arm {
    #[allow(clippy::borrowed_box)] // what a filter over a list of effects is handed
    let stays = |other: &&Box<dyn Effect>| effect.as_ref().is_none_or(|effect| effect.kind() != other.kind());
    let stay: Vec<_> = cell.arm.effects.iter().filter(stays).map(|effect| effect.clone_box()).collect();
    let effects = stay.into_iter().chain(effect).collect();
    Arm { robot: cell.arm.robot.clone(), stiffness: cell.arm.stiffness, effects }
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let cell = Cell::read(&source(&args[0])).unwrap();
    let runs: Vec<Run> = args[1..].chunks_exact(3).map(|of| run(&cell, &of[0], &of[1], &of[2])).collect();
    let plain: Vec<_> = runs.iter().map(|run| positions(&with(&cell, None), run)).collect();
    let mut head = "row,axis,programmed,declared,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg".to_owned();
    let mut columns: Vec<Vec<Vec<Vector3<f64>>>> = Vec::new();
    for (number, effect) in effects(&survey(&cell, &runs[0])).iter().enumerate() {
        let parameters = effect.parameters();
        for (i, parameter) in parameters.iter().enumerate() {
            let mut values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
            values[i] += STEP * parameter.typical;
            let arm = with(&cell, Some(effect.with_values(&values)));
            let moved = |(run, plain): (&Run, &Vec<Vector3<f64>>)| {
                positions(&arm, run).iter().zip(plain).map(|(a, b)| (a - b) / STEP).collect::<Vec<_>>()
            };
            let column: Vec<Vec<Vector3<f64>>> = runs.iter().zip(&plain).map(moved).collect();
            // What moves nothing by a hundredth of a micrometre in the first run cannot be fitted.
            if column[0].iter().any(|v| v.norm() > 1e-5) {
                write!(head, ",{}.{number}.{}", effect.kind(), parameter.name).unwrap();
                columns.push(column);
            }
        }
    }
    for (r, run) in runs.iter().enumerate() {
        let mut text = head.clone() + "\n";
        for (i, point) in run.prepared.points.iter().enumerate() {
            for axis in 0..3 {
                let programmed = point.reference.translation.vector[axis] * 1e3;
                write!(text, "{},{axis},{programmed:.4},{:.5}", i + 1, plain[r][i][axis]).unwrap();
                point.motor.iter().for_each(|q| write!(text, ",{:.5}", q.to_degrees()).unwrap());
                columns.iter().for_each(|column| write!(text, ",{:.6}", column[r][i][axis]).unwrap());
                text.push('\n');
            }
        }
        std::fs::write(&run.out, text).unwrap();
    }
    println!("{} columns", columns.len());
}
