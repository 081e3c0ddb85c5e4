//! The pages of `--html`: each is one self-contained HTML file that opens from disk and needs no network.
//!
//! The tables of a page are plain HTML, written here; its pictures are drawn in the browser from columns of numbers
//! with the same digits as in the CSV report. A [`PathTrace`] holds a path of any length in
//! bounded memory.
//!
//! Charts are uPlot's (MIT, 51 kB, shipped inside the page with its licence). The 3-D view is our own: a path is one
//! coloured line, which a plain canvas draws in 200 lines, works without a graphics card and prints; a general 3-D
//! library would be ten times the rest of the page.

mod diff;
mod identification;
mod markup;
mod path;
mod plan;
mod scene;
mod simulation;
mod trace;

pub use super::summary::PathKind;
pub use diff::diff_page;
pub use identification::identification_page;
pub(super) use markup::escape;
pub use path::{PathPage, PathTrace};
pub use plan::{DrawnArm, plan_page};
pub use simulation::simulation_page;
