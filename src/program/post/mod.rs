//! Points to a RAPID program: what a robot loads where the input was CL.
//!
//! | file | does |
//! |---|---|
//! | `names` | identifiers and predefined speeds |
//! | `zone` | corner zones suited to spacing and bend |
//! | `data` | declarations: tools, work objects, speeds |
//! | `writer` | modules, written stretch by stretch |

mod data;
mod names;
mod writer;
mod zone;

pub use names::identifier;
pub use writer::{Place, PostedPoint, RapidPlan, RapidPost, Text, as_written};
