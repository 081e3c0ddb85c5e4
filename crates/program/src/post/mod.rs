//! Posts points: writes a program for a robot's controller if the input was CL data.
//!
//! | file | does |
//! |---|---|
//! | `names` | identifiers, predefined speeds, names that a language has no place for |
//! | `zone` | zones that suit the spacing and the bend of the path |
//! | `data` | declarations: tools, work objects, speeds |
//! | `template` | lines that call the cell's own routines |
//! | `writer` | RAPID modules, written chunk by chunk |
//! | `tp` | FANUC TP programs |
//! | `krl` | the same points as KRL |
//! | `ur` | the same points as URScript |
//! | `jbi` | the same points as INFORM |
//! | `statements` | the statements that differ between languages |

mod data;
pub(crate) mod jbi;
pub(crate) mod krl;
mod names;
mod plan;
mod statements;
mod template;
pub(crate) mod tp;
pub(crate) mod ur;
mod writer;
mod zone;

pub use names::refuse as refuse_names;
pub use plan::PostPlan;
pub(crate) use statements::Statements;
pub use template::{TEMPLATES, Templates};
pub use writer::{PostWriter, PostedPoint, Text, WriterPosition};
