//! How long the compliance of a wall on a foot takes, and how close it comes at places that it has not seen:
//! `cargo run --release -p deflex-elastic --example wall -- 1.0`, with the size of the cells in mm.
//!
//! The part is 100 × 60 × 60 mm: a foot 30 mm high, and on it a wall of 2 mm, whose upper half a second stage cuts to 1 mm.

use deflex_elastic::{Accuracy, Body, Clamp, ComplianceMap, Grid, Material, Solid};
use std::error::Error;
use std::io::Write;
use std::time::Instant;

/// How far a point is inside of a box.
fn inside(p: [f64; 3], low: [f64; 3], high: [f64; 3]) -> f64 {
    (0..3).map(|k| (p[k] - low[k]).min(high[k] - p[k])).fold(f64::INFINITY, f64::min)
}

fn main() -> Result<(), Box<dyn Error>> {
    let spacing: f64 = std::env::args().nth(1).ok_or("give the size of the cells, mm")?.parse()?;
    let mut out = std::io::stdout();
    let grid = Grid::over([0.0; 3], [100.0, 60.0, 60.0], spacing);
    let foot = |p| inside(p, [0.0, 0.0, -1.0], [100.0, 60.0, 30.0]);
    let wall = |p: [f64; 3], front: f64| foot(p).max(inside(p, [0.0, 29.0, -1.0], [100.0, front, 60.0]));
    let clamp = Clamp { bounds: [[0.0; 3], [100.0, 60.0, 0.0]], stiffness: [f64::INFINITY; 3] };
    let mut before = None;
    for front in [31.0, 30.0] {
        let start = Instant::now();
        let front_at = |p: [f64; 3]| if p[2] > 45.0 { front } else { 31.0 };
        let solid = Solid::of(grid, |p| wall(p, front_at(p)));
        let body = Body::new(&solid, Material { e: 71_000.0, nu: 0.33 }, &[clamp])?;
        writeln!(out, "{} elements, equations after {:.1} s", body.elements(), start.elapsed().as_secs_f64())?;
        let on_wall = |x: f64, z: f64| [[x, 29.0, z], [x, front_at([x, 0.0, z]), z]];
        let all = (0..=50).flat_map(|i| (0..30).map(move |k| (2.0 * f64::from(i), 30.5 + f64::from(k))));
        let places: Vec<[f64; 3]> = all.flat_map(|(x, z)| on_wall(x, z)).collect();
        let map = ComplianceMap::over(&body, &places, &Accuracy::default(), before.take());
        writeln!(
            out,
            "map after {:.1} s: {} places, {} rounds, off by up to {:.1e} mm/N at the last of them",
            start.elapsed().as_secs_f64(),
            map.places(),
            map.rounds(),
            map.off()
        )?;
        let start = Instant::now();
        let most = places.iter().map(|place| map.at(&body, *place)[(1, 1)]).fold(0.0, f64::max);
        let each = start.elapsed().as_secs_f64() / places.len() as f64;
        writeln!(out, "{:.1} µs a place, at most {most:.3e} mm/N", 1e6 * each)?;
        let unseen: Vec<[f64; 3]> = (0..50)
            .flat_map(|n| on_wall(0.7 + f64::from(n * 37 % 50) * 1.97, 60.0 - f64::from(n * 13 % 50) * 0.58))
            .collect();
        let (mut worst, mut worst_off) = (0.0_f64, 0.0_f64);
        for (place, exact) in unseen.iter().zip(ComplianceMap::solved_at(&body, &unseen)) {
            let off = (map.at(&body, *place) - exact).symmetric_eigenvalues().amax();
            worst_off = worst_off.max(off);
            if off > Accuracy::default().absolute {
                worst = worst.max(off / exact.symmetric_eigenvalues().amax());
            }
        }
        writeln!(
            out,
            "at {} unseen places: off by up to {worst_off:.1e} mm/N; where that is more than {:.0e}, up to {:.2} %",
            unseen.len(),
            Accuracy::default().absolute,
            100.0 * worst
        )?;
        before = Some(map);
    }
    Ok(())
}
