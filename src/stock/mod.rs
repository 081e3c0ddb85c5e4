//! The stock: what every move of a cutter removes, and which part of its front is in material.
//!
//! The stock is kept as **dexels that know who cut them**: parallel lines through the blank with the intervals of material on
//! each, and at every end the sweep that made it. Between the lines nothing is interpolated: whether a point is in material
//! is computed from the sweeps that own the ends near it, by their exact distance. So walls, corners and cusps lie where the
//! cutter left them, whatever the spacing of the lines, and one set of lines does what a tri-dexel needs three for. What
//! the spacing limits is what fits between lines unseen: a sliver thinner than it whose owner no line has met.
//!
//! The lines stand along z of the stock's frame, on a square lattice that is turned about z by an angle with a golden tangent:
//! walls along x, y and the diagonals are never in step with it, so that volumes do not alias.
//!
//! At a target the front of the cutter is a mask over the angle φ about its axis and the place along its profile. The mean
//! force is the sum over the mask of the integrals of Tang et al. Eq. 6 (see [`cutting`](crate::cutting)), cells on the rim of
//! the engagement counted by the share that a straight rim leaves of them; these are quartered, the worst first, until the
//! rim can put the force off by little.
//!
//! The engagement of a tool can be computed later for the stock as it was at that [moment](Moment), because lines keep what they were before
//! while their history is wanted. So a batch of places is computed in parallel, and the cuts of a batch are made in parallel too:
//! one after the other on each line, but bands of the lattice know nothing of each other.
//!
//! Lengths are metres, in the stock's frame (the axes of its work object), volumes m³. A tool is as long as it needs to be:
//! its shank removes what it meets, collisions are not looked for.

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
