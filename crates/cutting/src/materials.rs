//! Named coefficient sets of common materials.

use super::Coefficients;

/// A named set of coefficients.
///
/// # Examples
/// ```
/// use deflex_cutting::materials::find;
///
/// let aluminium = find("al7075").expect("a material");
/// println!("{}: {:.0} N/mm², from {}", aluminium.name, 1e-6 * aluminium.coefficients.ktc, aluminium.source);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Name in the cell file.
    pub name: &'static str,
    /// The set, N/m² and N/m.
    pub coefficients: Coefficients,
    /// Publication from which the numbers come.
    pub source: &'static str,
}

const TYPICAL: &str = "typical of published mechanistic models for carbide end mills, \
     linearised at a chip thickness of 0.02 to 0.06 mm";

/// Every preset.
#[doc(hidden)]
pub const MATERIALS: [Material; 6] = [
    material(
        "al7075",
        [796.0, 169.0, 222.0],
        [28.0, 31.0, 1.4],
        "Al 7050/7075 end milling as commonly published (Kt 796, Kr 169, Ka 222 N/mm²)",
    ),
    material("al6061", [700.0, 180.0, 150.0], [15.0, 15.0, 2.0], TYPICAL),
    material("steel1045", [1900.0, 700.0, 250.0], [35.0, 50.0, 5.0], TYPICAL),
    material("cast-iron", [1150.0, 450.0, 150.0], [25.0, 35.0, 3.0], TYPICAL),
    material("ti6al4v", [1800.0, 500.0, 500.0], [27.0, 50.0, 2.0], TYPICAL),
    material("ni-al-bronze", [1300.0, 450.0, 200.0], [20.0, 30.0, 3.0], TYPICAL),
];

/// The preset of this name.
///
/// # Examples
/// ```
/// use deflex_cutting::materials::find;
///
/// assert!(find("al7075").is_some() && find("cheese").is_none());
/// ```
pub fn find(name: &str) -> Option<&'static Material> {
    MATERIALS.iter().find(|m| m.name == name)
}

/// Converts the units of published tables, N/mm² and N/mm.
const fn material(name: &'static str, cutting: [f64; 3], edge: [f64; 3], source: &'static str) -> Material {
    let coefficients = Coefficients {
        ktc: cutting[0] * 1e6,
        krc: cutting[1] * 1e6,
        kac: cutting[2] * 1e6,
        kte: edge[0] * 1e3,
        kre: edge[1] * 1e3,
        kae: edge[2] * 1e3,
    };
    Material { name, coefficients, source }
}
