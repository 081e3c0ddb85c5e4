//! The motion of a part whose clamps give way.
//!
//! A clamp that gives way moves as a whole, along the axes of the grid. Let W be the displacements of the part under single clamp
//! motions of 1 mm, K the forces that these motions require at the clamps, and c the (diagonal) compliance of the clamps. A clamp
//! on which the part presses with a force F moves by d = c F. A force f at a place presses on the clamps with Wᵀ f (theorem of
//! Betti), and the motion d reduces this by K d. So d = (1 + c K)⁻¹ c Wᵀ f. The place moves by W d, and the compliance there
//! increases by W (1 + c K)⁻¹ c Wᵀ.

use crate::body::{Body, Load, Solved};
use crate::level::LANES;
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;

/// The iteration ends when its last rounds change the force at a clamp by less than this share of the force with all free nodes
/// held. The bound is small because the result is the small difference of large forces.
const SETTLED: f64 = 1e-7;

/// The displacements of a body when its clamps move.
///
/// # Examples
/// ```
/// # use deflex_elastic::{Body, Clamp, Grid, Material, Solid};
/// # let bar = Solid::of(Grid::over([0.0; 3], [40.0, 4.0, 4.0], 1.0), |_| 1.0);
/// # let end = Clamp { bounds: [[0.0; 3], [0.0, 4.0, 4.0]], stiffness: [f64::INFINITY; 3] };
/// # let body = Body::new(&bar, Material { e: 71_000.0, nu: 0.33 }, &[end])?;
/// use deflex_elastic::ClampMotions;
///
/// let motions = ClampMotions::of(&body);
/// assert_eq!(motions.stiffness().nrows(), 3); // one clamp, three axes
/// // The bar follows its only clamp: 1 mm along z at the clamp is 1 mm along z at the tip.
/// assert!((motions.at(&body, [40.0, 2.0, 2.0])[2].z - 1.0).abs() < 1e-3);
/// # Ok::<(), deflex_elastic::HoldError>(())
/// ```
pub struct ClampMotions {
    /// For each motion, the displacement of each node.
    fields: Vec<Vec<[f32; 3]>>,
    stiffness: DMatrix<f64>,
}

impl ClampMotions {
    /// The motions of all clamps of a body, along x, y and z each.
    #[must_use]
    pub fn of(body: &Body) -> Self {
        let count = body.pulled.loads.len();
        let mut fields = Vec::new();
        let mut stiffness = body.pulled.at_clamps.clone();
        let numbered = |node: &u32, force: &Vector3<f64>| Some((body.number(*node as usize)?, *force));
        let loads: Vec<Load> = body
            .pulled
            .loads
            .iter()
            .map(|load| load.iter().filter_map(|(node, force)| numbered(node, force)).collect())
            .collect();
        let mut lefts = Vec::new();
        for (batch, loads) in loads.chunks(LANES).enumerate() {
            let most = |lane: usize| {
                let motion = batch * LANES + lane;
                if motion < count { body.pulled.at_clamps[(motion, motion)] } else { 0.0 }
            };
            let solved = body.solve(body.loaded(loads), |lane, _, latest| latest <= SETTLED * most(lane));
            let Solved { change, left, .. } = solved;
            let of_lane = |x: &[[[f32; LANES]; 3]], lane: usize| -> Vec<[f32; 3]> {
                x.par_iter().map(|x| std::array::from_fn(|k| x[k][lane])).collect()
            };
            fields.extend((0..loads.len()).map(|lane| of_lane(&change, lane)));
            lefts.extend((0..loads.len()).map(|lane| of_lane(&left, lane)));
        }
        // K − bᵀ w, with the work of the residual of b in w: the error is then of second order, as that of an energy.
        for (j, load) in loads.iter().enumerate() {
            for (k, (field, left)) in fields.iter().zip(&lefts).enumerate() {
                let work = |(number, force): &(u32, Vector3<f64>)| {
                    force.dot(&Vector3::from(field[*number as usize].map(f64::from)))
                };
                let of_load: f64 = load.iter().map(work).sum();
                let of_left: f64 = fields[j]
                    .iter()
                    .zip(left)
                    .map(|(a, b)| (0..3).map(|k| f64::from(a[k]) * f64::from(b[k])).sum::<f64>())
                    .sum();
                stiffness[(j, k)] -= of_load + of_left;
            }
        }
        let stiffness = (&stiffness + stiffness.transpose()) * 0.5;
        for (motion, field) in fields.iter_mut().enumerate() {
            body.move_held(motion, field);
        }
        Self { fields, stiffness }
    }

    /// Forces at the clamps that motions of 1 mm require, along the axes of the motions, N/mm. Row and column have the number
    /// 3·clamp + axis.
    #[must_use]
    pub fn stiffness(&self) -> &DMatrix<f64> {
        &self.stiffness
    }

    /// Displacement at a place on the surface for each motion of 1 mm, averaged over the same cells as in
    /// [`ComplianceMap::at`](crate::ComplianceMap::at). `body` is the body of the motions.
    #[must_use]
    pub fn at(&self, body: &Body, place: [f64; 3]) -> Vec<Vector3<f64>> {
        let spot = body.spread(place);
        let at = |field: &Vec<[f32; 3]>| {
            let share = |(number, share): &(u32, f64)| Vector3::from(field[*number as usize].map(f64::from)) * *share;
            spot.0.iter().map(share).sum()
        };
        self.fields.iter().map(at).collect()
    }
}
