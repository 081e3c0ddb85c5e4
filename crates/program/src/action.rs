//! Actions of the machine other than motion in CL data: tools, spindle, coolant, stops.

use deflex_text::Span;
use std::sync::Arc;

/// An action between two motions.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/blade.rs"));
/// for action in &program.actions {
///     println!("line {}: {:?}", action.line, action.kind);
/// }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Index into [`Program::targets`](super::Program::targets) of the target before whose motion it comes; their number after the last
    /// one.
    pub before: usize,
    /// Its kind.
    pub kind: ActionKind,
    /// The statement.
    pub span: Span,
    /// Line of its first byte, from 1.
    pub line: usize,
}

/// The kind of an action.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/blade.rs"));
/// use deflex_program::ActionKind;
///
/// let starts = program.actions.iter().filter(|action| matches!(action.kind, ActionKind::SpindleOn { .. }));
/// println!("the spindle starts {} times", starts.count());
/// assert_eq!(ActionKind::SpindleOff.template(), Some("spindle_off")); // its key under `[cl.post]`
/// assert_eq!(ActionKind::Dwell { seconds: 1.0 }.template(), None);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ActionKind {
    /// The tool changes (`LOADTL`, `LOAD/TOOL`, `TOOLNO`, `TURRET`, a named `TOOL PATH`).
    ToolChange {
        /// Its number or name, as printed.
        number: Arc<str>,
    },
    /// The spindle turns (`SPINDL`).
    SpindleOn {
        /// Its speed, 1/min, if it is known.
        rpm: Option<f64>,
        /// Whether it turns clockwise, seen from the spindle towards the tool.
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
    /// The program waits if the operator has requested it (optional stop).
    OptionalStop,
    /// The program waits for a time (`DELAY`).
    Dwell {
        /// Seconds.
        seconds: f64,
    },
    /// The machine goes to its home position (`GOHOME`).
    Home,
}

impl ActionKind {
    /// A fixed phrase for its kind, by which actions are counted.
    #[must_use]
    #[doc(hidden)]
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

    /// Whether the arm is elsewhere after it, at its home position or the tool changer.
    #[must_use]
    #[doc(hidden)]
    pub fn leaves_path(&self) -> bool {
        matches!(self, Self::ToolChange { .. } | Self::Home)
    }

    /// The key of its template under `[cl.post]`; `None` if every language has a statement for it.
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
