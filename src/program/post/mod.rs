//! Points to a program that a robot loads where the input was CL.
//!
//! | file | does |
//! |---|---|
//! | `names` | identifiers, predefined speeds, names that fit no language |
//! | `zone` | corner zones suited to spacing and bend |
//! | `data` | declarations: tools, work objects, speeds |
//! | `template` | lines that call the cell's own routines |
//! | `writer` | RAPID modules, written chunk by chunk |
//! | `tp` | FANUC TP programs |
//! | `krl` | the same points as KRL |
//! | `ur` | the same points as URScript |
//! | `jbi` | the same points as INFORM |
//! | `statements` | what languages write differently in posted programs |

mod data;
pub(crate) mod jbi;
pub(crate) mod krl;
mod names;
mod statements;
mod template;
pub(crate) mod tp;
pub(crate) mod ur;
mod writer;
mod zone;

pub use names::identifier;
pub(crate) use names::refuse as refuse_names;
pub(crate) use statements::Statements;
pub(crate) use template::TEMPLATES;
pub use template::Templates;
pub use writer::{PostedPoint, RapidPlan, RapidPost, Text, WriterPosition, as_written};
