//! The stiffness of one cell: a hexahedron of eight nodes with nine incompatible modes, of which material may fill a part.
//!
//! The displacement is trilinear between the nodes, plus the modes 1 − ξ², 1 − η², 1 − ζ² in each direction (Wilson et al. 1973),
//! so that one layer of cells can bend. The mean of the modes' strains over the material of the cell is subtracted (Taylor,
//! Beresford and Wilson 1976). A uniform stress then does no work on the modes, and the patch test holds, also in cut cells.
//!
//! Products of strains have at most degree two in each of ξ, η, ζ. A rule at the 3 × 3 × 3 Gauss points is therefore exact over
//! *any* part of the cell, if the weight of each point is the integral of its Lagrange polynomial over that part.

use nalgebra::SMatrix;

/// Corners of a cell; number `a` is at x = bit 0, y = bit 1, z = bit 2 of `a`.
pub(crate) const CORNERS: usize = 8;
/// Number of displacements of a cell.
pub(crate) const SIZE: usize = 3 * CORNERS;
const MODES: usize = 9;
const ALL: usize = SIZE + MODES;
/// Points of the rule, x running fastest.
pub(crate) const POINTS: usize = 27;

/// Share of the material's stiffness that the empty part of a cut cell keeps (the finite cell method's α, Düster et al. 2008):
/// it bounds the condition of slivers, and stiffens a wall by less than a thousandth.
const EMPTY: f64 = 1e-4;

/// Stiffness of a cell, N/mm, by displacement 3·corner + axis.
pub(crate) type Matrix = SMatrix<f64, SIZE, SIZE>;
type Strain = SMatrix<f64, 6, ALL>;

/// Weights of the 27 points, as shares of the cell's volume: the sum is the share that is material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rule(pub(crate) [f64; POINTS]);

/// The three Gauss points in −1…1.
fn gauss() -> [f64; 3] {
    [-0.6_f64.sqrt(), 0.0, 0.6_f64.sqrt()]
}

/// Integrals of the Lagrange polynomials of the Gauss points over an interval of −1…1.
fn integrals(low: f64, high: f64) -> [f64; 3] {
    let x = gauss();
    std::array::from_fn(|i| {
        let (a, b) = (x[(i + 1) % 3], x[(i + 2) % 3]);
        let whole = |t: f64| t * t * t / 3.0 - (a + b) * t * t / 2.0 + a * b * t;
        (whole(high) - whole(low)) / ((x[i] - a) * (x[i] - b))
    })
}

impl Rule {
    pub(crate) const NONE: Self = Self([0.0; POINTS]);

    /// The rule of a cell that is full of material.
    pub(crate) fn full() -> Self {
        let mut rule = Self::NONE;
        rule.add([0.0; 3], [1.0; 3], 1.0);
        rule
    }

    /// Adds a box between two corners (coordinates 0…1 of the cell) that is filled to a share.
    pub(crate) fn add(&mut self, low: [f64; 3], high: [f64; 3], share: f64) {
        let along: [[f64; 3]; 3] = std::array::from_fn(|k| integrals(2.0 * low[k] - 1.0, 2.0 * high[k] - 1.0));
        for (point, weight) in self.0.iter_mut().enumerate() {
            let [i, j, k] = [point % 3, point / 3 % 3, point / 9];
            *weight += share * along[0][i] * along[1][j] * along[2][k] / 8.0;
        }
    }

    /// Share of the cell that is material.
    pub(crate) fn share(&self) -> f64 {
        self.0.iter().sum()
    }
}

/// The data that all cells of a grid share: products of strains at each point of the rule.
pub(crate) struct Element {
    strains: Vec<Strain>,
    products: Vec<SMatrix<f64, ALL, ALL>>,
    elasticity: SMatrix<f64, 6, 6>,
    volume: f64,
}

impl Element {
    /// The element for cells of a size (mm) and a material with Young's modulus (N/mm²) and Poisson's ratio.
    pub(crate) fn new(size: [f64; 3], e: f64, nu: f64) -> Self {
        let (lambda, mu) = (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)));
        let elasticity = SMatrix::<f64, 6, 6>::from_fn(|i, j| match (i, j) {
            (0..3, 0..3) => lambda + if i == j { 2.0 * mu } else { 0.0 },
            _ if i == j => mu,
            _ => 0.0,
        });
        let x = gauss();
        let strains: Vec<Strain> = (0..POINTS).map(|p| strain(size, [x[p % 3], x[p / 3 % 3], x[p / 9]])).collect();
        let products = strains.iter().map(|b| b.transpose() * elasticity * b).collect();
        Self { strains, products, elasticity, volume: size.iter().product() }
    }

    /// Stiffness of a cell with the material that a rule describes, N/mm. The modes are eliminated by static condensation.
    pub(crate) fn stiffness(&self, rule: &Rule) -> Matrix {
        let full = Rule::full();
        let weights: [f64; POINTS] = std::array::from_fn(|p| rule.0[p] + EMPTY * (full.0[p] - rule.0[p]));
        let whole: f64 = weights.iter().sum();
        let (mut sum, mut strain) = (SMatrix::<f64, ALL, ALL>::zeros(), Strain::zeros());
        for ((weight, product), b) in weights.iter().zip(&self.products).zip(&self.strains) {
            sum += product * *weight;
            strain += b * *weight;
        }
        // The strains of the modes without their mean over the material.
        let mean = strain.fixed_columns::<MODES>(SIZE) / whole;
        let stress = self.elasticity * mean;
        let nodes = strain.fixed_columns::<SIZE>(0);
        let coupling = sum.fixed_view::<SIZE, MODES>(0, SIZE) - nodes.transpose() * stress;
        let modes = sum.fixed_view::<MODES, MODES>(SIZE, SIZE) - mean.transpose() * stress * whole;
        let outer = sum.fixed_view::<SIZE, SIZE>(0, 0).into_owned();
        let condensed = match modes.cholesky() {
            Some(factor) => outer - coupling * factor.solve(&coupling.transpose()),
            None => outer,
        };
        (condensed + condensed.transpose()) * (0.5 * self.volume)
    }
}

/// Trilinear shape functions at coordinates 0…1 of a cell.
pub(crate) fn shape(at: [f64; 3]) -> [f64; CORNERS] {
    std::array::from_fn(|a| (0..3).map(|k| if a >> k & 1 == 1 { at[k] } else { 1.0 - at[k] }).product())
}

/// Strains xx, yy, zz, yz, zx, xy at a point ξ of −1…1.
fn strain(size: [f64; 3], xi: [f64; 3]) -> Strain {
    let mut b = Strain::zeros();
    let mut put = |column: usize, gradient: [f64; 3]| {
        for axis in 0..3 {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            // Shear strain 3 + k is between the two axes other than k.
            b[(axis, column + axis)] = gradient[axis];
            b[(3 + last, column + axis)] = gradient[next];
            b[(3 + next, column + axis)] = gradient[last];
        }
    };
    for a in 0..CORNERS {
        let sign: [f64; 3] = std::array::from_fn(|k| if a >> k & 1 == 1 { 1.0 } else { -1.0 });
        let half: [f64; 3] = std::array::from_fn(|k| 0.5 * (1.0 + sign[k] * xi[k]));
        let gradient = std::array::from_fn(|k| sign[k] * half[(k + 1) % 3] * half[(k + 2) % 3] / size[k]);
        put(3 * a, gradient);
    }
    for mode in 0..3 {
        let mut gradient = [0.0; 3];
        gradient[mode] = -4.0 * xi[mode] / size[mode];
        put(SIZE + 3 * mode, gradient);
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Displacements of the corners under a linear field u = G x, for a cell of a size.
    fn linear(size: [f64; 3], gradient: [[f64; 3]; 3]) -> SMatrix<f64, SIZE, 1> {
        SMatrix::from_fn(|row, _| {
            let (a, axis) = (row / 3, row % 3);
            (0..3).map(|k| gradient[axis][k] * if a >> k & 1 == 1 { size[k] } else { 0.0 }).sum()
        })
    }

    fn energy(k: &Matrix, u: &SMatrix<f64, SIZE, 1>) -> f64 {
        0.5 * (u.transpose() * k * u)[0]
    }

    #[test]
    fn a_rule_integrates_degree_two_over_any_box() {
        let mut rule = Rule::NONE;
        rule.add([0.1, 0.0, 0.25], [0.7, 1.0, 0.5], 1.0);
        let x = gauss().map(|t| 0.5 * (t + 1.0));
        // ∫ x² z dV = (0.7³ − 0.1³)/3 · (0.5² − 0.25²)/2.
        let sum: f64 = (0..POINTS).map(|p| rule.0[p] * x[p % 3].powi(2) * x[p / 9]).sum();
        let exact = (0.343 - 0.001) / 3.0 * (0.25 - 0.0625) / 2.0;
        assert!((sum - exact).abs() < 1e-15, "{sum} {exact}");
    }

    #[test]
    fn stretching_a_cut_cell_costs_what_its_material_costs() {
        // Uniaxial strain: energy = ½ (λ + 2μ) ε² V.
        let size = [1.0, 2.0, 0.5];
        let element = Element::new(size, 70_000.0, 0.3);
        let mut rule = Rule::NONE;
        rule.add([0.0; 3], [1.0, 1.0, 0.4], 1.0);
        let strain = [[1e-3, 0.0, 0.0], [0.0; 3], [0.0; 3]];
        let found = energy(&element.stiffness(&rule), &linear(size, strain));
        let modulus = 70_000.0 * 0.7 / (1.3 * 0.4);
        let exact = 0.5 * modulus * 1e-6 * (0.4 + EMPTY * 0.6);
        assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
    }

    #[test]
    fn motions_of_a_rigid_body_cost_nothing() {
        let size = [1.0, 2.0, 0.5];
        let k = Element::new(size, 70_000.0, 0.3).stiffness(&Rule::full());
        let turn = linear(size, [[0.0, -1.0, 0.5], [1.0, 0.0, 0.25], [-0.5, -0.25, 0.0]]);
        let shift = SMatrix::<f64, SIZE, 1>::from_fn(|row, _| [1.0, 2.0, 3.0][row % 3]);
        assert!((k * turn).amax() < 1e-9 && (k * shift).amax() < 1e-9);
    }

    #[test]
    fn one_cell_bends_as_a_beam_does() {
        // Pure bending of a unit cell: u = κ x z at the corners. Energy = ½ E I κ² l with ν = 0, I = 1/12 of the full cell, and
        // of half of it, about its own middle, once the nodes have moved with it: the membrane strain is what it is about there.
        let size = [1.0; 3];
        let element = Element::new(size, 1000.0, 0.0);
        let bend = SMatrix::<f64, SIZE, 1>::from_fn(|row, _| {
            let (a, axis) = (row / 3, row % 3);
            let at: [f64; 3] = std::array::from_fn(|k| f64::from(u8::from(a >> k & 1 == 1)) - 0.5);
            if axis == 0 { at[0] * at[2] } else { 0.0 }
        });
        let found = energy(&element.stiffness(&Rule::full()), &bend);
        assert!((found / (0.5 * 1000.0 / 12.0) - 1.0).abs() < 1e-12, "{found}");
        let mut rule = Rule::NONE;
        rule.add([0.0; 3], [1.0, 1.0, 0.5], 1.0);
        let found = energy(&element.stiffness(&rule), &bend);
        // ∫ z² over −½…0 is 1/24.
        assert!((found / (0.5 * 1000.0 / 24.0) - 1.0).abs() < 2e-4, "{found}");
    }
}
