//! How long a wall of so many cells takes: `cargo run --release -p deflex-elastic --example wall -- 400 250 2`, cells along each
//! axis.

use deflex_elastic::{Accuracy, Body, Clamp, ComplianceMap, Grid, Material, Solid};
use std::error::Error;
use std::io::Write;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let cells: Vec<usize> = std::env::args().skip(1).map(|cells| cells.parse()).collect::<Result<_, _>>()?;
    let [x, y, z] = cells[..] else { return Err("give the cells along x, y and z".into()) };
    let high = [x as f64, y as f64, z as f64];
    let start = Instant::now();
    let solid = Solid::of(Grid::over([0.0; 3], high, 1.0), |_| 1.0);
    let clamp = Clamp { bounds: [[0.0; 3], [high[0], 0.0, high[2]]], stiffness: [f64::INFINITY; 3] };
    let material = Material { e: 71_000.0, nu: 0.33 };
    let body = Body::new(&solid, material, &[clamp])?;
    let mut out = std::io::stdout();
    writeln!(out, "{} elements, equations after {:.1} s", body.elements(), start.elapsed().as_secs_f64())?;
    let places: Vec<[f64; 3]> = (0..=40)
        .flat_map(|i| (1..=40).map(move |j| [high[0] * f64::from(i) / 40.0, high[1] * f64::from(j) / 40.0, high[2]]))
        .collect();
    let map = ComplianceMap::over(&body, &places, &Accuracy::default(), None);
    writeln!(
        out,
        "map after {:.1} s: {} places, {} rounds, error {:.4}",
        start.elapsed().as_secs_f64(),
        map.places(),
        map.rounds(),
        map.error()
    )?;
    let start = Instant::now();
    let most = places.iter().map(|place| map.at(&body, *place)[(2, 2)]).fold(0.0, f64::max);
    let each = start.elapsed().as_secs_f64() / places.len() as f64;
    writeln!(out, "{:.1} µs a place, at most {most:.3e} mm/N", 1e6 * each)?;
    Ok(())
}
