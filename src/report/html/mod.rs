//! Pages for people: one self-contained HTML file each, that opens from disk and asks nothing of a network.
//!
//! The tables of a page are plain HTML, written here; its pictures are drawn in the browser from columns of numbers
//! that are those of the CSV report, digit for digit. A [`PathTrace`] holds the path, however
//! long, in bounded memory.
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

pub use diff::diff_page;
pub use identification::identification_page;
pub use path::{PathKind, PathPage, PathTrace};
pub use plan::{DrawnArm, plan_page};
pub use simulation::simulation_page;
