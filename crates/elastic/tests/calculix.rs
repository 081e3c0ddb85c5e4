//! A wall through five stages of removal against CalculiX (`ccx`, Debian's package `calculix-ccx`): quadratic elements, that
//! share nothing with ours. Without `ccx` the test says so and passes.

// What a test finds, or why it is skipped, is printed.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use deflex_elastic::{Body, Clamp, Grid, Material, Solid};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

const MATERIAL: Material = Material { e: 71_000.0, nu: 0.33 };
/// The blank, mm; the part is a wall of 2 mm over its lower face.
const BLANK: [f64; 3] = [60.0, 40.0, 6.0];
const WALL: f64 = 2.0;
/// Elements of CalculiX: 3 × 2.5 mm, two of 1 mm through the wall and two of 2 mm above it. Their corners are nodes.
const ELEMENTS: [usize; 3] = [20, 16, 4];

/// Whether there is material in an element over `height` mm of the clamped edge: above it the wall has been cut.
fn is_there(element: [usize; 3], height: f64) -> bool {
    2.5 * (element[1] as f64) < height || element[2] < 2
}

/// Nodes of half an element's spacing: what a quadratic element has.
type Node = [usize; 3];

/// The nodes of a 20-node element in the order of CalculiX.
fn nodes_of([i, j, k]: [usize; 3]) -> [Node; 20] {
    const LOCAL: [[usize; 3]; 20] = [
        [0, 0, 0],
        [2, 0, 0],
        [2, 2, 0],
        [0, 2, 0],
        [0, 0, 2],
        [2, 0, 2],
        [2, 2, 2],
        [0, 2, 2],
        [1, 0, 0],
        [2, 1, 0],
        [1, 2, 0],
        [0, 1, 0],
        [1, 0, 2],
        [2, 1, 2],
        [1, 2, 2],
        [0, 1, 2],
        [0, 0, 1],
        [2, 0, 1],
        [2, 2, 1],
        [0, 2, 1],
    ];
    LOCAL.map(|[x, y, z]| [2 * i + x, 2 * j + y, 2 * k + z])
}

fn place(node: Node) -> [f64; 3] {
    let z = if node[2] <= 4 { 0.5 * node[2] as f64 } else { node[2] as f64 - 2.0 };
    [1.5 * node[0] as f64, 1.25 * node[1] as f64, z]
}

/// A corner of elements on the lower face, and its neighbours along x, 3 mm away, as far as they exist, by their shares; and the
/// same nodes on the face opposite.
struct Patch {
    front: Vec<(Node, f64)>,
    back: Vec<(Node, f64)>,
}

fn patch(x: usize, y: usize, height: f64) -> Patch {
    let all = [(x.wrapping_sub(1), 0.25), (x, 0.5), (x + 1, 0.25)];
    let there = || all.into_iter().filter(|(x, _)| *x <= ELEMENTS[0]);
    let sum: f64 = there().map(|(_, share)| share).sum();
    let at = |z: usize| there().map(|(x, share)| ([2 * x, 2 * y, z], share / sum)).collect();
    Patch { front: at(0), back: at(if 2.5 * y as f64 <= height { 8 } else { 4 }) }
}

/// Shift along z of the back of each patch under a unit force on its front, mm/N, by CalculiX: so that the dent of the force, which
/// depends on the elements, is left out.
fn calculix(folder: &Path, height: f64, patches: &[Patch]) -> Vec<f64> {
    let mut numbers: BTreeMap<Node, usize> = BTreeMap::new();
    let mut elements = String::new();
    let mut count = 0;
    for k in 0..ELEMENTS[2] {
        for j in 0..ELEMENTS[1] {
            for i in 0..ELEMENTS[0] {
                if !is_there([i, j, k], height) {
                    continue;
                }
                count += 1;
                write!(elements, "{count}").unwrap();
                for (n, node) in nodes_of([i, j, k]).into_iter().enumerate() {
                    let next = numbers.len() + 1;
                    let number = *numbers.entry(node).or_insert(next);
                    write!(elements, ",{}{number}", if n == 10 { "\n" } else { "" }).unwrap();
                }
                elements.push('\n');
            }
        }
    }
    let mut text = String::from("*NODE,NSET=ALL\n");
    for (node, number) in &numbers {
        let [x, y, z] = place(*node);
        writeln!(text, "{number},{x},{y},{z}").unwrap();
    }
    writeln!(
        text,
        "*ELEMENT,TYPE=C3D20R,ELSET=EALL\n{elements}*MATERIAL,NAME=M\n*ELASTIC\n{},{}",
        MATERIAL.e, MATERIAL.nu
    )
    .unwrap();
    text += "*SOLID SECTION,ELSET=EALL,MATERIAL=M\n*NSET,NSET=FIX\n";
    for (_, number) in numbers.iter().filter(|(node, _)| node[1] == 0) {
        writeln!(text, "{number},").unwrap();
    }
    let once = |nodes: &mut dyn Iterator<Item = Node>| nodes.collect::<BTreeSet<_>>().into_iter().collect::<Vec<_>>();
    let loaded = once(&mut patches.iter().flat_map(|patch| &patch.front).map(|(node, _)| *node));
    let looked_at = once(&mut patches.iter().flat_map(|patch| &patch.back).map(|(node, _)| *node));
    text += "*NSET,NSET=BACK\n";
    for node in &looked_at {
        writeln!(text, "{},", numbers[node]).unwrap();
    }
    // One factor, and the displacements under a unit force at each of these nodes.
    text += "*BOUNDARY\nFIX,1,3\n*STEP\n*GREEN\n*CLOAD\n";
    for node in &loaded {
        writeln!(text, "{},3,1.", numbers[node]).unwrap();
    }
    text += "*NODE PRINT,NSET=BACK\nU\n*END STEP\n";
    std::fs::write(folder.join("wall.inp"), text).unwrap();
    let run = Command::new("ccx").arg("wall").current_dir(folder).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stdout));
    let printed = std::fs::read_to_string(folder.join("wall.dat")).unwrap();
    // A block for each force, in their order: node, and its displacements along x, y and z.
    let column = |block: &str| -> BTreeMap<usize, f64> {
        let row = |line: &str| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let [node, _, _, z] = words[..] else { return None };
            Some((node.parse().ok()?, z.parse().ok()?))
        };
        block.lines().filter_map(row).collect()
    };
    let columns: Vec<BTreeMap<usize, f64>> = printed.split("displacements (vx").skip(1).map(column).collect();
    assert_eq!(columns.len(), loaded.len());
    let of = |patch: &Patch| -> f64 {
        let pair = |(a, share_a): &(Node, f64), (b, share_b): &(Node, f64)| {
            share_a * share_b * columns[loaded.binary_search(a).unwrap()][&numbers[b]]
        };
        patch.front.iter().map(|a| patch.back.iter().map(|b| pair(a, b)).sum::<f64>()).sum()
    };
    patches.iter().map(of).collect()
}

#[test]
#[ignore = "a minute: cargo test -p deflex-elastic --test calculix -- --ignored --nocapture"]
fn a_wall_yields_as_calculix_has_it_through_five_stages() {
    if Command::new("ccx").arg("-v").output().is_err() {
        println!("skipped: there is no ccx; install Debian's package calculix-ccx");
        return;
    }
    let clamp = Clamp { bounds: [[0.0; 3], [BLANK[0], 0.0, BLANK[2]]], stiffness: [f64::INFINITY; 3] };
    let mut worst = 0.0_f64;
    let mut squares = 0.0;
    for height in [40.0, 30.0, 20.0, 10.0, 0.0] {
        // 40 places a stage: 8 columns, 5 rows.
        let patches: Vec<Patch> =
            (0..8).flat_map(|i| [6, 8, 11, 14, 16].map(|j| patch(20 * i / 7, j, height))).collect();
        let folder = tempfile::tempdir().unwrap();
        let wanted = calculix(folder.path(), height, &patches);
        // Cells of 1 × 1 × 0.75 mm: the face of the wall lies within the third one.
        let grid = Grid { low: [0.0; 3], size: [1.0, 1.0, 0.75], cells: [60, 40, 8] };
        let solid = Solid::of(grid, |p| if p[1] > height { WALL - p[2] } else { 1.0 });
        let body = Body::new(&solid, MATERIAL, &[clamp]).unwrap();
        // The front, the back, and half of both: what one does to the other follows.
        let spread = |nodes: &[(Node, f64)], share: f64| -> Vec<([f64; 3], f64)> {
            nodes.iter().map(|(node, own)| (place(*node), own * share)).collect()
        };
        let places: Vec<Vec<([f64; 3], f64)>> = patches
            .iter()
            .flat_map(|Patch { front, back }| {
                let both = [spread(front, 0.5), spread(back, 0.5)].concat();
                [spread(front, 1.0), spread(back, 1.0), both]
            })
            .collect();
        let found = body.compliance_of(&places);
        for ((found, wanted), patch) in found.chunks(3).zip(&wanted).zip(&patches) {
            let [front, back, both] = [0, 1, 2].map(|k| found[k][(2, 2)]);
            let found = 2.0 * both - 0.5 * (front + back);
            let off = found / wanted - 1.0;
            assert!(off.abs() < 0.03, "{height} mm uncut, at {:?}: {:+.2} %", place(patch.front[0].0), 100.0 * off);
            worst = worst.max(off.abs());
            squares += off * off;
        }
    }
    println!("200 places: within {:.2} %, rms {:.2} %", 100.0 * worst, 100.0 * (squares / 200.0).sqrt());
}
