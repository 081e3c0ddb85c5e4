//! Blanks and parts from STL files.

use super::{FEED_PER_TOOTH, MM, block, coefficients, cutter, line, run, upright};
use crate::html::data;
use deflex::cell::Cell;
use deflex::report::html::{PathKind, PathPage};
use deflex::report::{DeviationMap, Origin, stl};
use deflex::stock::{Blank, ClosedMesh, Front, OpenMesh, StlError, Stock, read_stl};
use deflex::text::{Diagnostic, Source};
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::sync::Arc;

/// The twelve triangles of a box, mm, as text.
fn box_text(low: [f64; 3], high: [f64; 3]) -> String {
    let corner = |n: usize| [0, 1, 2].map(|k| if n >> k & 1 == 1 { high[k] } else { low[k] });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut text = "solid blank\n".to_owned();
    for [a, b, c, d] in faces {
        for triangle in [[a, b, c], [a, c, d]] {
            text += "facet normal 0 0 0\n outer loop\n";
            for [x, y, z] in triangle.map(corner) {
                text += &format!("  vertex {x} {y} {z}\n");
            }
            text += " endloop\nendfacet\n";
        }
    }
    text + "endsolid blank\n"
}

fn mesh(text: &str) -> ClosedMesh {
    ClosedMesh::new(&read_stl(text.as_bytes()).unwrap()).unwrap()
}

#[test]
fn a_box_from_a_file_is_the_box() {
    let (low, high) = ([0.0, 0.0, -10.0], [40.0, 30.0, 0.0]);
    let mesh = mesh(&box_text(low, high));
    assert!((mesh.volume() / (40.0 * 30.0 * 10.0 * MM.powi(3)) - 1.0).abs() < 1e-12);
    assert_eq!(mesh.bounds(), [Vector3::from(low) * MM, Vector3::from(high) * MM]);
    let plain = block(40.0, 30.0, 10.0);
    for x in [-1.0, -0.5, 0.4, 7.0, 20.0, 39.9, 41.0] {
        for y in [-0.3, 0.3, 15.0, 29.0, 30.5] {
            for z in [-11.0, -9.9, -5.0, -0.2, 0.1] {
                let point = Vector3::new(x, y, z) * MM;
                let (found, wanted) = (mesh.depth(&point), plain.depth(&point));
                assert_eq!(found > 0.0, wanted > 0.0, "{point:?}");
                // Outside of an edge the box says less than the distance.
                let inside = wanted > 0.0;
                assert!(!inside || (found - wanted.min(MM)).abs() < 1e-12, "{point:?} {found} {wanted}");
                assert!(found.abs() <= MM + 1e-12);
            }
        }
    }
    // The same cut in both.
    let front = Front::new(&cutter(10.0, 2.0), &coefficients());
    let poses = line(upright(-8.0, 15.0, -2.0), upright(30.0, 15.0, -2.0), 2.0);
    let [a, b] = [Blank::Mesh(Arc::new(mesh)), plain].map(|blank| {
        let mut stock = Stock::new(blank, 0.4 * MM);
        run(&mut stock, &front, &poses)
    });
    for ((engaged, removed), (wanted, volume)) in a.iter().zip(&b) {
        assert!((removed - volume).abs() < 1e-15, "{removed} {volume}");
        let (force, wanted) = (engaged.force.at(FEED_PER_TOOTH), wanted.force.at(FEED_PER_TOOTH));
        assert!((force - wanted).norm() <= 1e-3 * wanted.norm().max(1.0), "{force:?} {wanted:?}");
    }
}

/// A ball, binary, as `simulate --stl` writes meshes: a stock that was cut, its surface written and read again.
#[test]
fn a_surface_that_was_written_is_a_blank() {
    let mut stock = Stock::new(block(30.0, 30.0, 10.0), 0.5 * MM);
    let front = Front::new(&cutter(12.0, 6.0), &coefficients());
    run(&mut stock, &front, &[upright(15.0, 15.0, 2.0), upright(15.0, 15.0, -4.0)]);
    let bytes = stl(&stock.surface(0.7 * MM));
    let mesh = ClosedMesh::new(&read_stl(&bytes).unwrap()).unwrap();
    // A cap 4 deep of a ball of radius 6.
    let wanted = (9000.0 - PI * 4.0 * 4.0 * (18.0 - 4.0) / 3.0) * MM.powi(3);
    assert!((mesh.volume() / wanted - 1.0).abs() < 5e-3, "{} {wanted}", mesh.volume());
    let again = Stock::new(Blank::Mesh(Arc::new(mesh)), 0.3 * MM);
    assert!((again.volume() / wanted - 1.0).abs() < 5e-3, "{} {wanted}", again.volume());
    let bottom = Vector3::new(15.0, 15.0, -4.5) * MM;
    assert!((again.depth(&bottom) - 0.5 * MM).abs() < 0.03 * MM, "{}", again.depth(&bottom));
}

#[test]
fn edges_are_where_the_surface_turns() {
    let edges = mesh(&box_text([0.0; 3], [40.0, 30.0, 10.0])).sharp_edges(0.35);
    let length: f64 = edges.iter().map(|[a, b]| (b - a).norm()).sum();
    assert_eq!(edges.len(), 12);
    assert!((length - 4.0 * (40.0 + 30.0 + 10.0) * MM).abs() < 1e-12);
    assert!(mesh(&box_text([0.0; 3], [40.0, 30.0, 10.0])).sharp_edges(1.6).is_empty(), "by a right angle, no more");
}

#[test]
fn meshes_that_are_no_solids_are_refused() {
    let text = box_text([0.0; 3], [1.0; 3]);
    let open = text.replacen("facet normal 0 0 0\n outer loop\n", "", 1).replacen("endfacet\n", "", 1);
    assert!(matches!(read_stl(open.as_bytes()), Err(StlError::Text { .. })));
    let first = text.find("facet").unwrap();
    let second = first + 5 + text[first + 5..].find("facet normal").unwrap();
    let open = format!("{}{}", &text[..first], &text[second..]);
    let refused = ClosedMesh::new(&read_stl(open.as_bytes()).unwrap()).unwrap_err();
    assert!(matches!(refused, OpenMesh::Edges { edges: 3, .. }), "{refused}");
    assert!(matches!(read_stl(&[0; 100]), Err(StlError::Length { .. })));
    assert!(matches!(read_stl(b"nothing"), Err(StlError::Neither)));
    assert_eq!(ClosedMesh::new(&[]).unwrap_err(), OpenMesh::Empty);
}

#[test]
fn a_cell_names_its_meshes() {
    let cell = |stock: &str| {
        let text = format!("[robot]\nmodel = \"irb6660-205-1.9\"\n[stock]\n{stock}");
        Cell::read(&Source::new("cell.toml", text.into_bytes()))
    };
    let read = |name: &str| match name {
        "blank.stl" => Ok(Source::new(name, box_text([0.0; 3], [20.0, 10.0, 5.0]).into_bytes())),
        _ => Err(vec![Diagnostic::error("io.read", name, "cannot be read")]),
    };
    let mut own = cell("stl = \"blank.stl\"\n[part]\nstl = \"blank.stl\"\n").unwrap();
    own.take_meshes(read).unwrap();
    let origin = Origin::of("cell.toml", b"");
    let page =
        PathPage { kind: PathKind::Compensate, cell: &origin, programs: &[], scene: Some(&own), tolerance_mm: None }
            .html();
    let scene = &data(&page)["scene"];
    for body in ["stock", "part"] {
        assert_eq!(scene[body].as_array().unwrap().len(), 12, "the edges of a box: no diagonal of its faces");
    }
    assert_eq!(own.stock.unwrap().blank.unwrap().bounds()[1], Vector3::new(20.0, 10.0, 5.0) * MM);
    assert!(own.part.unwrap().mesh.is_some());
    let missing = cell("stl = \"none.stl\"\n").unwrap().take_meshes(read).unwrap_err();
    assert_eq!(missing[0].code, "io.read");
    let both = cell("stl = \"blank.stl\"\nbox_mm = [[0, 0, 0], [1, 1, 1]]\n").unwrap_err();
    assert_eq!(both[0].line, 4, "{both:?}");
}

/// The nominal part has a pocket floor 0.3 mm lower than the program cuts it: so much is left over.
#[test]
fn a_part_is_what_the_cut_is_held_against() {
    let floor = |z: f64| {
        let mut stock = Stock::new(block(16.0, 14.0, 5.0), 0.4 * MM);
        let front = Front::new(&cutter(10.0, 0.0), &coefficients());
        run(&mut stock, &front, &[upright(-8.0, 7.0, z), upright(24.0, 7.0, z)]);
        stock
    };
    let nominal = read_stl(&stl(&floor(-2.3).surface(0.5 * MM))).unwrap();
    let part = Stock::new(Blank::Mesh(Arc::new(ClosedMesh::new(&nominal).unwrap())), 0.4 * MM);
    let actual = floor(-2.0);
    let map = DeviationMap::new(part.surface(0.8 * MM), &part, actual.blank(), &actual);
    let bottom: Vec<f64> = map
        .points()
        .iter()
        .filter(|p| (p.position_mm[2] + 2.3).abs() < 1e-3 && (p.position_mm[1] - 7.0).abs() < 4.0)
        .map(|p| p.deviation_mm)
        .collect();
    assert!(bottom.len() > 50 && bottom.iter().all(|d| (d - 0.3).abs() < 2e-3), "{:?}", &bottom[..5.min(bottom.len())]);
}
