//! Bodies whose compliance a book has.

use deflex_elastic::{Accuracy, Body, Clamp, ClampMotions, ComplianceMap, Grid, HoldError, Material, Solid};
use nalgebra::{DMatrix, Matrix3};

const ALUMINIUM: Material = Material { e: 71_000.0, nu: 0.33 };
const RIGID: [f64; 3] = [f64::INFINITY; 3];

fn within(found: f64, exact: f64, share: f64) {
    assert!(
        (found / exact - 1.0).abs() < share,
        "{found:.6e}, not {exact:.6e}: {:+.2} %",
        100.0 * (found / exact - 1.0)
    );
}

/// The cells that a body fills. `Solid::of` is compiled for each kind of function, so all tests give it the same kind.
fn solid(grid: Grid, depth: &(dyn Fn([f64; 3]) -> f64 + Sync)) -> Solid {
    Solid::of(grid, depth)
}

/// A body that fills all cells.
fn full(grid: Grid) -> Solid {
    solid(grid, &|_| 1.0)
}

fn clamp(low: [f64; 3], high: [f64; 3]) -> Clamp {
    Clamp { bounds: [low, high], stiffness: RIGID }
}

/// Timoshenko's beam with a force at its end: l³/(3EI) + 6 l/(5 G A) for a rectangle.
fn cantilever(length: f64, height: f64, width: f64) -> f64 {
    let inertia = width * height.powi(3) / 12.0;
    let shear = ALUMINIUM.e / (2.0 * (1.0 + ALUMINIUM.nu));
    length.powi(3) / (3.0 * ALUMINIUM.e * inertia) + 1.2 * length / (shear * width * height)
}

#[test]
fn a_cantilever_of_two_cells_bends_as_timoshenko_has_it() {
    // The clamp holds the width too, which stiffens the first few millimetres: 1 % of a beam 20 times as long as high.
    let grid = Grid::over([0.0; 3], [40.0, 2.0, 2.0], 1.0);
    let body = Body::new(&full(grid), ALUMINIUM, &[clamp([0.0; 3], [0.0, 2.0, 2.0])]).unwrap();
    let tip = body.compliance(&[[40.0, 1.0, 1.0]])[0];
    within(tip[(2, 2)], cantilever(40.0, 2.0, 2.0), 0.015);
    within(tip[(1, 1)], tip[(2, 2)], 1e-6);
    // Along it: l/(E A), and the dent of the force.
    assert!(tip[(0, 0)] > 40.0 / (71_000.0 * 4.0) && tip[(0, 0)] < 1.3 * 40.0 / (71_000.0 * 4.0));
}

#[test]
fn faces_within_cells_bend_as_they_would_between_them() {
    // A beam of height 2.5 of cells of 1: the uppermost is half full. Whole cells would be off by (3/2.5)³ = 1.7.
    let exact = cantilever(40.0, 2.5, 2.0);
    let grid = Grid::over([0.0; 3], [40.0, 2.0, 3.0], 1.0);
    let solid = solid(grid, &|p| 2.5 - p[2]);
    let end = clamp([0.0; 3], [0.0, 2.0, 3.0]);
    let tip = |solid: &Solid| Body::new(solid, ALUMINIUM, &[end]).unwrap().compliance(&[[40.0, 1.0, 1.0]])[0][(2, 2)];
    within(tip(&solid), exact, 0.02);
    assert!((tip(&solid.in_whole_cells()) / exact - 1.0).abs() > 0.3);
}

#[test]
fn a_beam_across_the_grid_converges() {
    // A bar of 3 × 3 mm, 40 mm long, turned by 25° in the grid: cells are cut in every way. Finer cells come closer.
    let (sin, cos) = 25.0_f64.to_radians().sin_cos();
    let exact = cantilever(40.0, 3.0, 3.0);
    let off = |spacing: f64| {
        let grid = Grid::over([-3.0, -3.0, 0.0], [42.0, 24.0, 3.0], spacing);
        let depth = |p: [f64; 3]| {
            let (along, across) = (p[0] * cos + p[1] * sin, p[1] * cos - p[0] * sin);
            (along + 2.0).min(40.0 - along).min(across + 1.5).min(1.5 - across)
        };
        let root = clamp([-3.0, -3.0, 0.0], [0.0, 24.0, 3.0]);
        let body = Body::new(&solid(grid, &depth), ALUMINIUM, &[root]).unwrap();
        let tip = body.compliance(&[[40.0 * cos, 40.0 * sin, 1.5]])[0];
        tip[(2, 2)] / exact
    };
    let (coarse, fine, finest) = (off(1.5), off(0.75), off(0.5));
    assert!((finest - 1.0).abs() < 0.03 && (fine - 1.0).abs() < 0.04, "{coarse} {fine} {finest}");
    assert!((finest - fine).abs() < 0.5 * (fine - coarse).abs(), "{coarse} {fine} {finest}");
}

/// Plate stiffness D, N·mm.
fn plate(thickness: f64, nu: f64) -> f64 {
    ALUMINIUM.e * thickness.powi(3) / (12.0 * (1.0 - nu * nu))
}

#[test]
fn a_clamped_plate_yields_as_timoshenko_and_woinowsky_krieger_have_it() {
    // Square plate, all edges clamped, force in the middle: w = 0.00560 P a²/D (Theory of Plates and Shells, 2nd ed., table 37).
    // Two cells of half a millimetre through the thickness. The dent of the force adds some 0.5 %.
    let material = Material { nu: 0.3, ..ALUMINIUM };
    let grid = Grid { low: [0.0; 3], size: [1.0, 1.0, 0.5], cells: [80, 80, 2] };
    let edges = [
        clamp([0.0; 3], [0.0, 80.0, 1.0]),
        clamp([80.0, 0.0, 0.0], [80.0, 80.0, 1.0]),
        clamp([0.0; 3], [80.0, 0.0, 1.0]),
        clamp([0.0, 80.0, 0.0], [80.0, 80.0, 1.0]),
    ];
    let body = Body::new(&full(grid), material, &edges).unwrap();
    let middle = body.compliance(&[[40.0, 40.0, 1.0]])[0];
    within(middle[(2, 2)], 0.00560 * 80.0 * 80.0 / plate(1.0, 0.3), 0.02);
}

/// Values of a polynomial's derivative of this order at `x`, from its coefficients, lowest first.
fn derivative(coefficients: &[f64], order: usize, x: f64) -> f64 {
    let falling = |power: usize| (0..order).map(|k| (power - k) as f64).product::<f64>();
    let term = |(power, c): (usize, &f64)| c * falling(power) * x.powi((power - order) as i32);
    coefficients.iter().enumerate().skip(order).map(term).sum()
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        b.iter().enumerate().for_each(|(j, y)| out[i + j] += x * y);
    }
    out
}

/// Legendre polynomials over 0 to 1, times a factor that meets the supports.
fn shapes(support: &[f64], count: usize) -> Vec<Vec<f64>> {
    let mut all = vec![vec![1.0], vec![-1.0, 2.0]];
    while all.len() < count {
        let n = all.len() as f64;
        let mut next = product(&all[all.len() - 1], &[-(2.0 * n - 1.0) / n, 2.0 * (2.0 * n - 1.0) / n]);
        all[all.len() - 2].iter().enumerate().for_each(|(k, c)| next[k] -= (n - 1.0) / n * c);
        all.push(next);
    }
    all.iter().map(|polynomial| product(support, polynomial)).collect()
}

/// The integrals over 0 to 1 of derivatives of two orders, by Simpson's rule.
fn integrals(shapes: &[Vec<f64>], left: usize, right: usize) -> DMatrix<f64> {
    const STEPS: usize = 400;
    let mut out = DMatrix::zeros(shapes.len(), shapes.len());
    for step in 0..=STEPS {
        let weight = if step == 0 || step == STEPS { 1.0 } else { 2.0 + 2.0 * (step % 2) as f64 };
        let x = step as f64 / STEPS as f64;
        let values = |order: usize| shapes.iter().map(|c| derivative(c, order, x)).collect::<Vec<f64>>();
        let (a, b) = (values(left), values(right));
        out += DMatrix::from_fn(a.len(), b.len(), |i, j| a[i] * b[j]) * (weight / (3.0 * STEPS as f64));
    }
    out
}

/// Factors that meet the supports of a plate at 0 and 1: clamped at both, and clamped at 0.
const CLAMPED: &[f64] = &[0.0, 0.0, 1.0, -2.0, 1.0];
const CLAMPED_AND_FREE: &[f64] = &[0.0, 0.0, 1.0];

/// The compliance of a thin plate of a × b at half of its width, and at this share of its height, by the method of Ritz.
fn ritz([a, b]: [f64; 2], supports: [&[f64]; 2], height: f64, stiffness: f64, nu: f64) -> Option<f64> {
    let [x, y] = supports.map(|support| shapes(support, 11));
    let over = |shapes: &[Vec<f64>]| [(0, 0), (1, 1), (2, 2), (0, 2), (2, 0)].map(|(l, r)| integrals(shapes, l, r));
    let ([x00, x11, x22, x02, x20], [y00, y11, y22, y02, y20]) = (over(&x), over(&y));
    let energy = x22.kronecker(&y00) * (b / a.powi(3))
        + x00.kronecker(&y22) * (a / b.powi(3))
        + (x02.kronecker(&y20) + x20.kronecker(&y02)) * (nu / (a * b))
        + x11.kronecker(&y11) * (2.0 * (1.0 - nu) / (a * b));
    let at =
        |shapes: &[Vec<f64>], place: f64| DMatrix::from_fn(shapes.len(), 1, |i, _| derivative(&shapes[i], 0, place));
    let push = at(&x, 0.5).kronecker(&at(&y, height));
    Some(push.dot(&(energy * stiffness).cholesky()?.solve(&push)))
}

#[test]
fn a_plate_that_is_clamped_on_three_sides_yields_as_ritz_has_it() {
    // The method itself gives what the book has for a square plate with four clamped edges.
    within(ritz([80.0; 2], [CLAMPED; 2], 0.5, 1.0, 0.3).unwrap(), 0.00560 * 6400.0, 0.02);
    let material = Material { nu: 0.3, ..ALUMINIUM };
    let grid = Grid { low: [0.0; 3], size: [1.0, 1.0, 0.5], cells: [60, 40, 2] };
    let edges = [
        clamp([0.0; 3], [0.0, 40.0, 1.0]),
        clamp([60.0, 0.0, 0.0], [60.0, 40.0, 1.0]),
        clamp([0.0; 3], [60.0, 0.0, 1.0]),
    ];
    let body = Body::new(&full(grid), material, &edges).unwrap();
    let free = body.compliance(&[[30.0, 40.0, 1.0]])[0];
    let exact = ritz([60.0, 40.0], [CLAMPED, CLAMPED_AND_FREE], 1.0, plate(1.0, 0.3), 0.3).unwrap();
    within(free[(2, 2)], exact, 0.03);
}

#[test]
fn a_blade_that_grows_thinner_bends_as_a_tapered_beam() {
    // 4 mm thick at the root and 1.5 mm at the tip, 50 mm long, 5 mm wide: the beam of Timoshenko, integrated along its length.
    let (length, width) = (50.0, 5.0);
    let thickness = |x: f64| 4.0 - 2.5 * x / length;
    let grid = Grid::over([0.0; 3], [length, width, 4.0], 0.5);
    let solid = solid(grid, &|p| 0.5 * thickness(p[0]) - (p[2] - 2.0).abs());
    let body = Body::new(&solid, ALUMINIUM, &[clamp([0.0; 3], [0.0, width, 4.0])]).unwrap();
    let tip = body.compliance(&[[length, 2.5, 2.0]])[0];
    let shear = ALUMINIUM.e / (2.0 * (1.0 + ALUMINIUM.nu));
    let steps = 2_000;
    let slice = |k: usize| {
        let x = length * (k as f64 + 0.5) / f64::from(steps);
        let (lever, height) = (length - x, thickness(x));
        12.0 * lever * lever / (ALUMINIUM.e * width * height.powi(3)) + 1.2 / (shear * width * height)
    };
    let exact = (0..steps as usize).map(slice).sum::<f64>() * length / f64::from(steps);
    within(tip[(2, 2)], exact, 0.03);
}

#[test]
fn a_strip_clamped_along_one_side_yields_as_an_infinite_cantilever_plate() {
    // Jaramillo (1950): force at the free edge of a long cantilever plate, under it w = 0.168 P a²/D (ν = 0.3).
    let material = Material { nu: 0.3, ..ALUMINIUM };
    let grid = Grid::over([0.0; 3], [160.0, 30.0, 1.0], 1.0);
    let body = Body::new(&full(grid), material, &[clamp([0.0; 3], [160.0, 0.0, 1.0])]).unwrap();
    let edge = body.compliance(&[[80.0, 30.0, 1.0]])[0];
    within(edge[(2, 2)], 0.168 * 900.0 / plate(1.0, 0.3), 0.03);
}

#[test]
fn a_thin_tube_bends_as_a_beam_of_its_ring() {
    // Outer radius 6, wall 1.2 mm, 70 mm long; the load on a stiff end plate. Shear: the coefficient of a thin ring is 2.
    let (outer, inner, length) = (6.0_f64, 4.8_f64, 70.0);
    let grid = Grid::over([-6.0, -6.0, 0.0], [6.0, 6.0, length + 2.0], 0.75);
    let depth = |p: [f64; 3]| {
        let r = p[0].hypot(p[1]);
        let wall = (outer - r).min(r - inner);
        wall.max((outer - r).min(p[2] - length))
    };
    let solid = solid(grid, &depth);
    let body = Body::new(&solid, ALUMINIUM, &[clamp([-6.0, -6.0, 0.0], [6.0, 6.0, 0.0])]).unwrap();
    let tip = body.compliance(&[[0.0, 0.0, length]])[0];
    let pi = std::f64::consts::PI;
    let (inertia, area) = (pi * (outer.powi(4) - inner.powi(4)) / 4.0, pi * (outer * outer - inner * inner));
    let shear = ALUMINIUM.e / (2.0 * (1.0 + ALUMINIUM.nu));
    let exact = length.powi(3) / (3.0 * ALUMINIUM.e * inertia) + 2.0 * length / (shear * area);
    within(tip[(0, 0)], exact, 0.03);
    within(tip[(1, 1)], tip[(0, 0)], 1e-3);
}

#[test]
fn springs_under_a_block_give_what_they_say() {
    // A cube on a spring of 1000 N/mm in each direction: pushed from above over its middle, it sinks by F/k and a dent.
    let grid = Grid::over([0.0; 3], [10.0; 3], 1.0);
    let foot = Clamp { bounds: [[0.0; 3], [10.0, 10.0, 0.0]], stiffness: [1000.0, 2000.0, 500.0] };
    let body = Body::new(&full(grid), ALUMINIUM, &[foot]).unwrap();
    let push = body.compliance(&[[5.0, 5.0, 10.0]])[0];
    within(push[(2, 2)], 1.0 / 500.0, 0.015);
    // Pushed sideways at the top it also tilts: by F h² / (k_z Σ x²/n), the feet at x = −5 … 5.
    let square: f64 = (0..=10).map(|i| f64::from(i - 5).powi(2)).sum::<f64>() / 11.0;
    within(push[(0, 0)], 1.0 / 1000.0 + 100.0 / (500.0 * square), 0.01);
}

#[test]
fn what_is_not_held_is_said() {
    let grid = Grid::over([0.0; 3], [10.0; 3], 1.0);
    let solid = full(grid);
    let body = |clamps: &[Clamp]| Body::new(&solid, ALUMINIUM, clamps).err();
    assert_eq!(body(&[]), Some(HoldError::Free { turns: false }));
    assert_eq!(body(&[clamp([20.0; 3], [30.0; 3])]), Some(HoldError::Untouched(0)));
    // A line of nodes is a hinge.
    assert_eq!(body(&[clamp([0.0; 3], [10.0, 0.0, 0.0])]), Some(HoldError::Free { turns: true }));
    assert_eq!(body(&[clamp([0.0; 3], [10.0, 10.0, 0.0])]), None);
}

#[test]
fn loose_pieces_carry_nothing() {
    // A slot through the block leaves its far half loose: a force there is taken by what is nearest and held.
    let grid = Grid::over([0.0; 3], [10.0, 4.0, 4.0], 1.0);
    let solid = solid(grid, &|p| if p[0] > 4.0 && p[0] < 6.0 { -1.0 } else { 1.0 });
    let body = Body::new(&solid, ALUMINIUM, &[clamp([0.0; 3], [0.0, 4.0, 4.0])]).unwrap();
    assert_eq!(body.elements(), 4 * 4 * 4);
}

#[test]
fn a_map_has_what_is_solved_for_at_places_it_has_not_seen() {
    let grid = Grid::over([0.0; 3], [60.0, 40.0, 2.0], 1.0);
    let body = Body::new(&full(grid), ALUMINIUM, &[clamp([0.0; 3], [60.0, 0.0, 2.0])]).unwrap();
    let all: Vec<[f64; 3]> =
        (0..=30).flat_map(|i| (1..=20).map(move |j| [2.0 * f64::from(i), 2.0 * f64::from(j), 2.0])).collect();
    let map = ComplianceMap::over(&body, &all, &Accuracy::default(), None);
    let unseen: Vec<[f64; 3]> = (0..30).map(|n| [1.3 + f64::from(n) * 1.9, 3.0 + f64::from(n * 7 % 37), 2.0]).collect();
    assert_as_solved_for(&body, &map, &unseen, 0.03);
}

#[test]
fn a_force_at_one_place_moves_another() {
    // A cantilever of 40 × 2 × 2 mm. Under a force F at a from the clamp, the place at x < a goes by F x² (3 a − x) / (6 E I), and beyond
    // a the bar stays straight: by F a² (3 x − a) / (6 E I). Shear adds less than 1 %, and the clamp that holds the width takes away some
    // thousandths.
    let grid = Grid::over([0.0; 3], [40.0, 2.0, 2.0], 1.0);
    let body = Body::new(&full(grid), ALUMINIUM, &[clamp([0.0; 3], [0.0, 2.0, 2.0])]).unwrap();
    let at = |x: f64| [x, 1.0, 2.0];
    let all: Vec<[f64; 3]> = (10..=40).map(|x| at(f64::from(x))).collect();
    let map = ComplianceMap::over(&body, &all, &Accuracy { relative: 0.003, ..Accuracy::default() }, None);
    let inertia = 2.0_f64.powi(4) / 12.0;
    let exact = |near: f64, far: f64| near.powi(2) * (3.0 * far - near) / (6.0 * ALUMINIUM.e * inertia);
    for (near, far) in [(20.0, 35.0), (30.0, 33.0), (36.0, 40.0)] {
        within(map.between(&body, at(near), at(far))[(2, 2)], exact(near, far), 0.025);
        within(map.between(&body, at(far), at(near))[(2, 2)], exact(near, far), 0.025);
    }
}

/// The map is within a share of what is solved for, or within the absolute accuracy, and mostly much closer.
fn assert_as_solved_for(body: &Body, map: &ComplianceMap, places: &[[f64; 3]], share: f64) {
    let absolute = Accuracy::default().absolute;
    for (place, exact) in places.iter().zip(ComplianceMap::solved_at(body, places)) {
        let off = (exact - map.at(body, *place)).symmetric_eigenvalues().amax();
        let size = exact.symmetric_eigenvalues().amax();
        assert!(off < (share * size).max(absolute), "{place:?}: {off:.2e} of {size:.2e}");
    }
}

#[test]
fn a_map_finds_each_of_many_walls() {
    // Five walls of 1.5 mm, 3 mm apart, on a block: closer to each other than the places that are solved for.
    let grid = Grid { low: [0.0; 3], size: [2.0, 0.75, 2.0], cells: [15, 30, 15] };
    let solid = solid(grid, &|p| {
        let in_wall = 0.75 - ((p[1] - 2.25).rem_euclid(4.5) - 0.75).abs();
        (10.0 - p[2]).max(in_wall)
    });
    let foot = clamp([0.0; 3], [30.0, 22.5, 0.0]);
    let body = Body::new(&solid, ALUMINIUM, &[foot]).unwrap();
    let on_wall = |wall: u32, x: f64, z: f64| [x, 2.25 + 4.5 * f64::from(wall), z];
    let all: Vec<[f64; 3]> = (0..5)
        .flat_map(|wall| {
            (0..=15).flat_map(move |i| (6..=15).map(move |k| on_wall(wall, 2.0 * f64::from(i), 2.0 * f64::from(k))))
        })
        .collect();
    let map = ComplianceMap::over(&body, &all, &Accuracy::default(), None);
    let unseen: Vec<[f64; 3]> =
        (0..5).flat_map(|wall| [(3.1, 29.0), (16.7, 30.0), (24.9, 21.0)].map(|(x, z)| on_wall(wall, x, z))).collect();
    assert_as_solved_for(&body, &map, &unseen, 0.03);
}

#[test]
fn a_stage_goes_on_from_the_one_before() {
    let material = ALUMINIUM;
    let end = [clamp([0.0; 3], [60.0, 0.0, 4.0])];
    let grid = Grid::over([0.0; 3], [60.0, 40.0, 4.0], 1.0);
    let thick = Body::new(&full(grid), material, &end).unwrap();
    let thin = Body::new(&solid(grid, &|p| if p[1] > 20.0 { 3.0 - p[2] } else { 1.0 }), material, &end).unwrap();
    let places: Vec<[f64; 3]> =
        (0..=12).flat_map(|i| (1..=8).map(move |j| [5.0 * f64::from(i), 5.0 * f64::from(j), 0.0])).collect();
    let first = ComplianceMap::over(&thick, &places, &Accuracy::default(), None);
    let anew = ComplianceMap::over(&thin, &places, &Accuracy::default(), None);
    let on = ComplianceMap::over(&thin, &places, &Accuracy::default(), Some(first));
    assert!(on.rounds() < anew.rounds(), "{} rounds, {} anew", on.rounds(), anew.rounds());
    for place in &places {
        let (a, b) = (on.at(&thin, *place)[(2, 2)], anew.at(&thin, *place)[(2, 2)]);
        // Each map is off by what it states.
        assert!((a - b).abs() < ((on.error() + anew.error()) * b).max(6e-5), "{place:?}: {a} {b}");
    }
}

#[test]
fn threads_change_nothing() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let grid = Grid::over([0.0; 3], [40.0, 30.0, 3.0], 1.0);
            let solid = solid(grid, &|p| 2.6 - p[2] + 0.01 * p[0]);
            let body = Body::new(&solid, ALUMINIUM, &[clamp([0.0; 3], [40.0, 0.0, 3.0])]).unwrap();
            let places: Vec<[f64; 3]> = (0..20).map(|n| [2.0 * f64::from(n), 28.0, 1.0]).collect();
            let map = ComplianceMap::over(&body, &places, &Accuracy::default(), None);
            places.iter().map(|place| map.at(&body, *place)[(2, 2)].to_bits()).collect::<Vec<u64>>()
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(5));
}

/// Compliance at a place where clamps give way by so much, mm/N, along x, y and z each.
fn with_soft_clamps(body: &Body, place: [f64; 3], compliances: &[f64]) -> Matrix3<f64> {
    let motions = ClampMotions::of(body);
    let at = motions.at(body, place);
    let w = DMatrix::from_fn(3, at.len(), |row, motion| at[motion][row]);
    let c = DMatrix::from_diagonal(&compliances.to_vec().into());
    let both = DMatrix::identity(at.len(), at.len()) + &c * motions.stiffness();
    let more = &w * both.lu().solve(&(c * w.transpose())).unwrap_or_else(|| panic!("no part is so stiff"));
    ComplianceMap::solved_at(body, &[place])[0] + Matrix3::from_fn(|i, j| more[(i, j)])
}

#[test]
fn one_clamp_that_gives_way_takes_the_part_with_it() {
    // All of the part goes with the only clamp: what is added is the clamp's compliance, at any place, and no motion takes force.
    let grid = Grid::over([0.0; 3], [20.0, 10.0, 10.0], 1.0);
    let foot = [clamp([0.0; 3], [20.0, 10.0, 0.0])];
    let body = Body::new(&full(grid), ALUMINIUM, &foot).unwrap();
    let place = [17.0, 3.0, 10.0];
    let more = with_soft_clamps(&body, place, &[1e-4, 2e-4, 3e-5]) - ComplianceMap::solved_at(&body, &[place])[0];
    let wanted = Matrix3::from_diagonal(&[1e-4, 2e-4, 3e-5].into());
    assert!((more - wanted).amax() < 3e-7, "{more}");
}

#[test]
fn soft_clamps_are_those_of_a_body_with_springs_in_their_place() {
    // Each clamp holds one node, so that a spring in its place moves as the clamp does. The motions are of the rigid clamps, or of
    // ones on springs already; the other body has all of it in its springs. Soft ones give way by up to 40 times as much as the part.
    let grid = Grid::over([0.0; 3], [24.0, 16.0, 4.0], 1.0);
    let solid = full(grid);
    let corners = [[0.0, 0.0, 0.0], [24.0, 0.0, 0.0], [0.0, 16.0, 0.0], [24.0, 16.0, 0.0]];
    let body = |stiffness: &dyn Fn(usize) -> [f64; 3]| {
        let clamps: Vec<Clamp> =
            corners.iter().enumerate().map(|(n, at)| Clamp { bounds: [*at; 2], stiffness: stiffness(n) }).collect();
        Body::new(&solid, ALUMINIUM, &clamps).unwrap()
    };
    let c: [f64; 12] = [2e-5, 1e-5, 1e-4, 0.0, 3e-5, 2e-3, 0.0, 0.0, 1e-3, 5e-5, 0.0, 0.0];
    let soft = body(&|n| std::array::from_fn(|k| 1.0 / c[3 * n + k]));
    let rigid = body(&|_| RIGID);
    let sprung = body(&|n| std::array::from_fn(|k| if n == 1 { 2.0 / c[3 + k] } else { f64::INFINITY }));
    let left: Vec<f64> = (0..12).map(|n| if n / 3 == 1 { 0.5 * c[n] } else { c[n] }).collect();
    for place in [[12.0, 8.0, 4.0], [21.0, 3.0, 4.0], [2.5, 14.0, 4.0]] {
        let wanted = ComplianceMap::solved_at(&soft, &[place])[0];
        for (declared, found) in
            [("rigid", with_soft_clamps(&rigid, place, &c)), ("sprung", with_soft_clamps(&sprung, place, &left))]
        {
            assert!((found - wanted).amax() < 2e-3 * wanted.amax(), "{declared}, {place:?}: {found} {wanted}");
        }
    }
}
