//! A wall through five stages of removal against CalculiX (`ccx`, Debian's package `calculix-ccx`): quadratic elements, that
//! share nothing with ours. Without `ccx` the test says so and passes.

use deflex_elastic::{Body, Clamp, Grid, Material, Solid};
use nalgebra::DMatrix;
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

/// A force at a corner of elements on the lower face, spread over it and its neighbours along x, 3 mm away, as far as they
/// exist: a dent that both resolve.
fn patch(x: usize, y: usize) -> Vec<(Node, f64)> {
    let all = [(x.wrapping_sub(1), 0.25), (x, 0.5), (x + 1, 0.25)];
    let there = || all.into_iter().filter(|(x, _)| *x <= ELEMENTS[0]);
    let sum: f64 = there().map(|(_, share)| share).sum();
    there().map(|(x, share)| ([2 * x, 2 * y, 0], share / sum)).collect()
}

/// Compliance along z of patches, by CalculiX: the inverse of the stiffness that is left when all other nodes are condensed.
fn calculix(folder: &Path, height: f64, patches: &[Vec<(Node, f64)>]) -> Vec<f64> {
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
    text += "*BOUNDARY\nFIX,1,3\n*STEP\n*SUBSTRUCTURE GENERATE\n*RETAINED NODAL DOFS,SORTED=NO\n";
    let retained: Vec<Node> =
        patches.iter().flatten().map(|(node, _)| *node).collect::<BTreeSet<_>>().into_iter().collect();
    for node in &retained {
        writeln!(text, "{},3,3", numbers[node]).unwrap();
    }
    text += "*SUBSTRUCTURE MATRIX OUTPUT,STIFFNESS=YES,OUTPUT FILE=USER DEFINED,FILE NAME=sub\n*END STEP\n";
    std::fs::write(folder.join("wall.inp"), text).unwrap();
    let run = Command::new("ccx").arg("wall").current_dir(folder).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stdout));
    let printed = std::fs::read_to_string(folder.join("sub.mtx")).unwrap();
    let (_, printed) = printed.split_once("TYPE=STIFFNESS").unwrap();
    let values: Vec<f64> = printed.split([',', '\n']).filter_map(|word| word.trim().parse().ok()).collect();
    let n = retained.len();
    assert_eq!(values.len(), n * (n + 1) / 2, "the lower triangle, row by row");
    let stiffness = DMatrix::from_fn(n, n, |i, j| values[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)]);
    let factor = stiffness.cholesky().expect("a stiffness is positive");
    let of = |patch: &Vec<(Node, f64)>| {
        let mut force = nalgebra::DVector::zeros(n);
        for (node, share) in patch {
            force[retained.binary_search(node).unwrap()] += share;
        }
        force.dot(&factor.solve(&force))
    };
    patches.iter().map(of).collect()
}

#[test]
fn a_wall_yields_as_calculix_has_it_through_five_stages() {
    if Command::new("ccx").arg("-v").output().is_err() {
        println!("skipped: there is no ccx; install Debian's package calculix-ccx");
        return;
    }
    // 40 places a stage: 8 columns, 5 rows.
    let patches: Vec<Vec<(Node, f64)>> = (0..8).flat_map(|i| [3, 6, 9, 12, 16].map(|j| patch(20 * i / 7, j))).collect();
    let clamp = Clamp { bounds: [[0.0; 3], [BLANK[0], 0.0, BLANK[2]]], stiffness: [f64::INFINITY; 3] };
    let mut worst = 0.0_f64;
    let mut squares = 0.0;
    for height in [40.0, 30.0, 20.0, 10.0, 0.0] {
        let folder = tempfile::tempdir().unwrap();
        let wanted = calculix(folder.path(), height, &patches);
        // Cells of 1 × 1 × 1.2 mm: the face of the wall lies within the second one.
        let grid = Grid { low: [0.0; 3], size: [1.0, 1.0, 1.2], cells: [60, 40, 5] };
        let solid = Solid::of(grid, |p| if p[1] > height { WALL - p[2] } else { 1.0 });
        let body = Body::new(&solid, MATERIAL, &[clamp]).unwrap();
        let places: Vec<Vec<([f64; 3], f64)>> =
            patches.iter().map(|patch| patch.iter().map(|(node, share)| (place(*node), *share)).collect()).collect();
        for ((found, wanted), patch) in body.compliance_of(&places).iter().zip(&wanted).zip(&places) {
            let off = found[(2, 2)] / wanted - 1.0;
            assert!(off.abs() < 0.03, "{height} mm uncut, at {:?}: {:+.2} %", patch[0].0, 100.0 * off);
            worst = worst.max(off.abs());
            squares += off * off;
        }
    }
    println!("200 places: within {:.2} %, rms {:.2} %", 100.0 * worst, 100.0 * (squares / 200.0).sqrt());
}
