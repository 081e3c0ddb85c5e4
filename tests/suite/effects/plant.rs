//! The independent plant (MuJoCo, see `samples/plant`) as witness: with what was really added to a cell, the prediction of
//! every measured program must leave the measurement noise and nothing else.
//!
//! `DEFLEX_PLANT_CASES=DIR cargo test effects::plant -- --nocapture` tries further cells of that form.

use super::every::read;
use crate::identify::source;
use deflex::cell::Cell;
use deflex::effects::{Cutting, KINDS, Situation, ToolFrame};
use deflex::measured::Table;
use deflex::robot::{Joints, Pose};
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Rows over which the plant's slow wander keeps its direction.
const WANDER_ROWS: f64 = 10.0;

/// Scatter of the residual's size that chance explains, in standard deviations.
const CHANCE: f64 = 4.5;

/// A target as the plant's own programs write it.
struct Move {
    wobj_from_tcp: Pose,
    speed: f64,
}

struct Program {
    tool: ToolFrame,
    world_from_wobj: Pose,
    moves: Vec<Move>,
}

/// All numbers of a line, in order.
fn numbers(text: &str) -> Vec<f64> {
    text.split(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c))).filter_map(|word| word.parse().ok()).collect()
}

fn pose(n: &[f64]) -> Pose {
    let quaternion = UnitQuaternion::new_normalize(Quaternion::new(n[3], n[4], n[5], n[6]));
    Pose::from_parts(Translation3::new(1e-3 * n[0], 1e-3 * n[1], 1e-3 * n[2]), quaternion.to_rotation_matrix())
}

/// The plant's programs are one `MoveL` a line, one tool, one work object.
fn program(text: &str) -> Program {
    let after = |start: &str| {
        let line = text.lines().find(|line| line.trim_start().starts_with(start)).unwrap();
        numbers(line.split_once(":=").unwrap().1)
    };
    let (tool, wobj) = (after("PERS tooldata"), after("PERS wobjdata"));
    let moves = text.lines().filter_map(|line| line.trim_start().strip_prefix("MoveL ")).map(|line| {
        let speed = line.rsplit("],v").next().and_then(|rest| rest.split(',').next()).unwrap();
        Move { wobj_from_tcp: pose(&numbers(line)), speed: 1e-3 * speed.parse::<f64>().unwrap() }
    });
    Program {
        tool: ToolFrame {
            flange_from_tcp: pose(&tool),
            mass: tool[7],
            cog: 1e-3 * Vector3::new(tool[8], tool[9], tool[10]),
        },
        world_from_wobj: pose(&wobj) * pose(&wobj[7..]),
        moves: moves.collect(),
    }
}

/// The declared cell with what was really added, or `None` where that is in no list.
fn cell(folder: &Path, truth: &serde_json::Value) -> Option<Cell> {
    let mut cell = Cell::read(&source(&folder.join("cell.toml"))).unwrap();
    for effect in truth["effect"].as_array().unwrap() {
        let mut table = toml::Table::try_from(effect).unwrap();
        table.remove("note");
        let name = table["kind"].as_str().unwrap().to_owned();
        let kind = KINDS.iter().find(|kind| kind.name == name)?;
        if kind.implied_by_stiffness {
            cell.arm.effects.clear();
        }
        cell.arm.effects.push(read(table).unwrap());
    }
    Some(cell)
}

/// Measured minus predicted position of every row, m.
fn residual(cell: &Cell, program: &Program, measured: &Table) -> Vec<Vector3<f64>> {
    let robot = &cell.arm.robot;
    let base_from_wobj = robot.world_from_base.inv_mul(&program.world_from_wobj);
    // As the plant starts: the first quadrant solution nearest to the work, then the nearest to the one before.
    let ahead = base_from_wobj * program.moves[0].wobj_from_tcp.translation.vector;
    let mut near = cell.start.unwrap_or_else(|| Joints::from([ahead.y.atan2(ahead.x), 0.0, 0.0, 0.0, 0.5, 0.0]));
    let mut travel = Joints::zeros();
    let mut cut_length = 0.0;
    let mut time = 0.0;
    let mut feed = Vector3::zeros();
    let mut states = Vec::new();
    for (i, target) in program.moves.iter().enumerate() {
        let row = &measured.rows[i];
        let flange = base_from_wobj * target.wobj_from_tcp * program.tool.flange_from_tcp.inverse();
        let motor = robot.inverse_near(&flange, &near).unwrap();
        if i > 0 {
            let step = motor - near;
            travel = travel.zip_map(&step, |held, step| if step.abs() > 1e-7 { step.signum() } else { held });
        }
        near = motor;
        let (from, to) = if i == 0 { (0, 1) } else { (i - 1, i) };
        let chord =
            program.moves[to].wobj_from_tcp.translation.vector - program.moves[from].wobj_from_tcp.translation.vector;
        if chord.norm() > 1e-9 {
            feed = chord.normalize();
        }
        let force = Vector3::from(row.force_n.unwrap_or_default());
        if i > 0 {
            time += chord.norm() / target.speed;
            if force != Vector3::zeros() {
                cut_length += chord.norm();
            }
        }
        let situation = Situation {
            base_from_wobj,
            gravity: robot.gravity(),
            cutting: Cutting::Constant(force),
            normal: -(target.wobj_from_tcp.rotation * Vector3::z()),
            velocity: target.speed * feed,
            cut_length,
            time: row.time_s.unwrap_or(time),
            temperature: row.temperature_c,
            ..Situation::in_air(program.tool, target.wobj_from_tcp)
        };
        states.push((situation, motor, travel, 1e-3 * Vector3::from(row.position_mm.unwrap())));
    }
    let left = |(situation, motor, travel, seen): &(Situation, Joints, Joints, Vector3<f64>)| {
        seen - cell.arm.predict(situation, motor, travel).unwrap().wobj_from_tcp.translation.vector
    };
    states.par_iter().map(left).collect()
}

fn folders(root: &Path, into: &mut Vec<PathBuf>) {
    if root.join("truth.json").exists() {
        into.push(root.to_owned());
    } else if let Ok(entries) = std::fs::read_dir(root) {
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()).collect();
        paths.sort();
        paths.iter().for_each(|path| folders(path, into));
    }
}

#[test]
fn what_was_really_added_explains_what_was_measured() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut cells = Vec::new();
    folders(&here.join("samples/closed-loop"), &mut cells);
    let practice = here.join("../shared/practice");
    if practice.exists() {
        folders(&practice, &mut cells);
    } else {
        eprintln!("{} is absent: only the sample is tried", practice.display());
    }
    if let Ok(more) = std::env::var("DEFLEX_PLANT_CASES") {
        folders(Path::new(&more), &mut cells);
    }
    assert!(!cells.is_empty());
    let mut failures = Vec::new();
    for folder in &cells {
        let truth: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
        let Some(cell) = cell(folder, &truth) else { continue };
        let size = |key: &str| 1e-3 * truth[key].as_f64().unwrap_or_default();
        let noise = size("sigma_mm").hypot(size("wander_mm"));
        for (program_file, measured_file) in [("part.mod", "measured.csv"), ("transfer.mod", "transfer_measured.csv")] {
            let text = std::fs::read_to_string(folder.join(program_file)).unwrap();
            let measured = Table::read(&source(&folder.join(measured_file))).unwrap();
            let left = residual(&cell, &program(&text), &measured);
            let rms = (left.iter().map(Vector3::norm_squared).sum::<f64>() / (3.0 * left.len() as f64)).sqrt();
            // The wander's rows are not independent of each other: its size is known less well, as is its mean.
            let rows = 3.0 * left.len() as f64;
            let scatter = |size: f64, rows: f64| size.powi(2) * (2.0 / rows).sqrt();
            let chance = scatter(size("sigma_mm"), rows).hypot(scatter(size("wander_mm"), rows / WANDER_ROWS));
            let off = (rms.powi(2) - noise.powi(2)) / chance;
            let name = format!("{} {measured_file}", folder.strip_prefix(here).unwrap_or(folder).display());
            eprintln!("{name}: rms {:.2} µm an axis, noise {:.2} µm, {off:+.1} σ", 1e6 * rms, 1e6 * noise);
            if off >= CHANCE || !off.is_finite() {
                failures.push(format!("{name}: {off:+.1} σ"));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
