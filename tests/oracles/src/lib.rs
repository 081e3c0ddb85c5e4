//! What the tests of deflex compute by themselves and compare with deflex, with no code of deflex.
//!
//! A package of its own is compiled with optimisation. `tests/suite` is not, because its compilation would take longer than its run.

#![allow(clippy::unwrap_used)] // a failure here is a failed test

pub mod cut;
mod derive;
mod notation;
mod recognise;
pub mod swept;
pub mod walk;

pub use derive::Deriver;
pub use notation::{Grammar, Rule};
pub use recognise::{Recogniser, Stopped};

/// A milling cutter with the forces on its edges, in SI units.
#[derive(Clone, Copy, Debug)]
pub struct Mill {
    /// m
    pub diameter: f64,
    /// m
    pub corner_radius: f64,
    /// Their number.
    pub teeth: u32,
    /// Tangential, radial and axial force for the area of the chip, N/m².
    pub chip: [f64; 3],
    /// Tangential, radial and axial force for the length of the edge, N/m.
    pub edge: [f64; 3],
}

impl Mill {
    /// Tangential, radial and axial force for the length of the edge under a chip of `thickness` (m), N/m.
    fn edge_force(&self, thickness: f64) -> [f64; 3] {
        [0, 1, 2].map(|i| self.chip[i] * thickness + self.edge[i])
    }
}
