//! What a program asks of the machine besides motion: tools, spindle, coolant, stops (CL).

use crate::text::Span;
use std::sync::Arc;

/// Something done between two motions.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Action {
    /// Index into [`Program::targets`](super::Program::targets) of the target before whose motion it is done; their count
    /// after the last.
    pub before: usize,
    /// What is done.
    pub kind: ActionKind,
    /// The statement.
    pub span: Span,
    /// Line of its first byte, from 1.
    pub line: usize,
}

/// What is done.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ActionKind {
    /// Another tool is taken (`LOADTL`, `LOAD/TOOL`, `TOOLNO`, `TURRET`, a named `TOOL PATH`).
    ToolChange {
        /// Its number or name, as printed.
        number: Arc<str>,
    },
    /// The spindle turns (`SPINDL`).
    SpindleOn {
        /// Its speed, 1/min, where known.
        rpm: Option<f64>,
        /// Seen from behind.
        clockwise: bool,
    },
    /// The spindle stops.
    SpindleOff,
    /// Coolant flows (`COOLNT`).
    CoolantOn {
        /// Which: `ON`, `FLOOD`, `MIST`, …
        kind: Arc<str>,
    },
    /// Coolant stops.
    CoolantOff,
    /// The program waits for the operator.
    Stop,
    /// It waits where the operator has requested it (optional stop).
    OptionalStop,
    /// It waits (`DELAY`).
    Dwell {
        /// Seconds.
        seconds: f64,
    },
    /// The machine goes to its home position (`GOHOME`).
    Home,
}

impl ActionKind {
    /// What it is, in words that can be counted.
    #[must_use]
    pub fn what(&self) -> &'static str {
        match self {
            Self::ToolChange { .. } => "a tool change",
            Self::SpindleOn { .. } => "the start of the spindle",
            Self::SpindleOff => "the stop of the spindle",
            Self::CoolantOn { .. } => "coolant on",
            Self::CoolantOff => "coolant off",
            Self::Stop => "a stop for the operator",
            Self::OptionalStop => "an optional stop",
            Self::Dwell { .. } => "a delay",
            Self::Home => "the motion to the machine's home position",
        }
    }

    /// The key of its template under `[cl.post]`; none for what RAPID itself has.
    #[must_use]
    pub fn template(&self) -> Option<&'static str> {
        Some(match self {
            Self::ToolChange { .. } => "tool_change",
            Self::SpindleOn { .. } => "spindle_on",
            Self::SpindleOff => "spindle_off",
            Self::CoolantOn { .. } => "coolant_on",
            Self::CoolantOff => "coolant_off",
            Self::Stop => "stop",
            Self::OptionalStop => "optional_stop",
            Self::Home => "home",
            Self::Dwell { .. } => return None,
        })
    }
}
