//! The stock: the material that each motion of a cutter removes, and the part of the cutter's front that is in material.
//!
//! The stock consists of **dexels with owners**: parallel lines through the blank with their intervals of material, and
//! for each end of an interval the sweep that made it. Nothing is interpolated between the lines: the exact distances
//! of the sweeps that own the nearby ends decide whether a point is in material. Walls, corners and cusps therefore lie
//! where the cutter left them, at any spacing of the lines, and one set of lines is enough where a tri-dexel needs
//! three. The spacing only limits what can be missed between lines: a sliver thinner than the spacing whose owner no
//! line has met.
//!
//! The lines are parallel to z of the stock's frame, on a square lattice that is turned about z by an angle with a golden tangent.
//! Walls along x, y and the diagonals are therefore never in step with it, so that volumes do not alias.
//!
//! At a target the front of the cutter is a mask over the angle φ about its axis and the position along its profile. The mean
//! force is the sum over the mask of the integrals of Tang et al. Eq. 6 (see [`deflex_cutting`]). A cell on the rim of the
//! engagement counts by the share that a straight rim leaves of it. These cells are quartered, the worst first, until the rim
//! can change the force only a little.
//!
//! The engagement of a tool can be computed later for the stock as it was at a [moment](Moment): as long as the history is kept, lines
//! keep their earlier states. The positions of a batch are therefore computed in parallel. The cuts of a batch are made in parallel
//! too: in their order on each line, but independently in each band of the lattice.
//!
//! Lengths are metres, in the stock's frame (the axes of its work object), volumes m³. A tool has no upper end: its shank removes
//! what it meets. Collisions are not reported.

mod band;
mod blank;
mod closed;
mod cut;
mod dexel;
mod engagement;
mod front;
mod history;
mod lattice;
mod line;
mod mask;
mod nearest;
mod refine;
mod rim;
mod solid;
mod stl;
mod surface;
mod sweep;
mod view;

pub use blank::Blank;
pub use closed::{ClosedMesh, OpenMesh};
pub use dexel::Stock;
pub use engagement::Engaged;
pub use front::Front;
pub use history::Moment;
pub use solid::Solid;
pub use stl::{StlError, read_stl};
pub use surface::Mesh;
pub use sweep::ToolPose;
