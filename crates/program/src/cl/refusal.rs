//! Reasons why a statement is refused, and what to change in the file or the cell.

use crate::Reason;

/// A reason with its help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// A short fixed phrase, by which refusals are counted.
    pub(crate) reason: Reason,
    /// The help; empty for the one that all motions share.
    pub(super) help: &'static str,
}

impl From<&'static Refusal> for Refusal {
    fn from(refusal: &'static Refusal) -> Self {
        *refusal
    }
}

impl From<Reason> for Refusal {
    fn from(reason: Reason) -> Self {
        Self { reason, help: "" }
    }
}

/// Nothing, or why a statement is not understood.
pub(super) type Outcome = Result<(), Refusal>;

const fn refusal(reason: Reason, help: &'static str) -> Refusal {
    Refusal { reason, help }
}

pub(super) const MOTION: Refusal = refusal(
    Reason::MotionUnread,
    "let the CAM system write it as GOTO; if it moves nothing on your machine, list the word in `[cl] harmless`",
);
pub(super) const UNKNOWN_MOTION: Refusal = refusal(
    Reason::WordMayMove,
    "let the CAM system write its motion as GOTO; if the word moves nothing, list it in `[cl] harmless`",
);
pub(super) const UNKNOWN_NUMBERS: Refusal = refusal(
    Reason::WordMayBePosition,
    "let the CAM system write motion as GOTO; if the word moves nothing, list it in `[cl] harmless`",
);
pub(super) const ARC: Refusal = refusal(Reason::ArcForm, "let the CAM system write CIRCLE and GOTO, or points");
pub(super) const SPLINE: Refusal =
    refusal(Reason::SplineCurve, "let the CAM system write points (GOTO) instead of NURBS");
pub(super) const CLEARANCE: Refusal = refusal(
    Reason::ClearancePlane,
    "let the CAM system write the retraction as GOTO; if it moves nothing on your machine, list the word in `[cl] harmless`",
);
pub(super) const SUBPROGRAM: Refusal =
    refusal(Reason::Subprogram, "let the CAM system write the motion out where it happens");
pub(super) const COPY: Refusal = refusal(Reason::Copy, "let the CAM system write the repeated motion out");
pub(super) const PROBE: Refusal = refusal(
    Reason::Probing,
    "take the measurement out of the program; if it moves nothing, list the word in `[cl] harmless`",
);
pub(super) const THREAD: Refusal = refusal(Reason::Threading, "let the CAM system write the motion out as GOTO");
pub(super) const TAP: Refusal = refusal(Reason::Tapping, "take the tapping out of the program");
pub(super) const OFFSET: Refusal = refusal(
    Reason::MachineOffset,
    "let the CAM system write positions without it; if it is zero, list the word in `[cl] harmless`",
);
pub(super) const TRANSFORM: Refusal = refusal(
    Reason::Transformation,
    "let the CAM system write transformed positions; if they are so already, list the word in `[cl] harmless`",
);
pub(super) const TURNED: Refusal = refusal(
    Reason::Rotary,
    "let the CAM system write positions and tool axes of the part as it stands; if they are so, list the word in `[cl] harmless`",
);
pub(super) const CUTTER_COMPENSATION: Refusal = refusal(
    Reason::RadiusCompensation,
    "let the CAM system write the path of the tool's centre; if it does so already, list CUTCOM in `[cl] harmless`",
);
pub(super) const INCREMENTAL: Refusal = refusal(Reason::Increments, "let the CAM system write absolute positions");
pub(super) const SECOND_HEAD: Refusal = refusal(
    Reason::SecondHead,
    "give each head a program of its own; if it is the robot's only one, list the word in `[cl] harmless`",
);
pub(super) const SYNONYM: Refusal = refusal(Reason::Synonym, "let the CAM system write the words themselves");
pub(super) const CONTROL_CODE: Refusal = refusal(
    Reason::ControlCode,
    "let the CAM system write the positions themselves; if the code does nothing here, list PREFUN in `[cl] harmless`",
);
pub(super) const SECOND_TOOL: Refusal = refusal(
    Reason::SecondTool,
    "map the tool numbers in the cell: `[cl] tools = { \"1\" = \"tRough\", \"2\" = \"tFinish\" }`, or give --tool NAME",
);
pub(super) const UNMAPPED_TOOL: Refusal =
    refusal(Reason::UnmappedTool, "add it: `[cl] tools = { \"NUMBER\" = \"NAME\" }`");
pub(super) const NO_TOOL: Refusal =
    refusal(Reason::NoTool, "name the tool that is in hand at the start: `[cl] tool = \"NAME\"`");
pub(super) const NO_TOOL_NUMBER: Refusal =
    refusal(Reason::NoToolNumber, "let the CAM system write the tool's number (LOADTL/1)");
pub(super) const SECOND_CUTTER: Refusal =
    refusal(Reason::SecondCutter, "let the CAM system write LOADTL with the tool's number, and map it in `[cl] tools`");
pub(super) const FEED_UNIT: Refusal =
    refusal(Reason::FeedUnit, "expected IPM, MMPM, FPM, MPM, IPS, MMPS, IPR, MMPR, PERMIN or PERREV");
pub(super) const INVERSE_TIME: Refusal =
    refusal(Reason::InverseTime, "let the CAM system write feeds per minute or per revolution");
pub(super) const NO_FEED: Refusal = refusal(Reason::NoFeed, "let the CAM system write a feed above 0");
pub(super) const FEED_UNIT_LOST: Refusal =
    refusal(Reason::FeedUnitLost, "say the unit with every FEDRAT: IPM, MMPM, IPR, MMPR, …");
pub(super) const FEED_WITHOUT_SPINDLE: Refusal =
    refusal(Reason::FeedWithoutSpindle, "let the CAM system write SPINDL/ with its speed before, or feeds per minute");
pub(super) const CYCLE_FORM: Refusal =
    refusal(Reason::CycleForm, "let the CAM system write CYCLE/DRILL,DEPTH,d,MMPM,f,CLEAR,c, or the drilling as GOTO");
pub(super) const CYCLE_KIND: Refusal = refusal(
    Reason::CycleKind,
    "let the CAM system write its motion out as GOTO; DRILL, FACE, DEEP, BRKCHP, REAM and BORE are read",
);
pub(super) const CYCLE_FEED: Refusal = refusal(Reason::CycleFeed, "give its feed in CYCLE or with FEDRAT before");
pub(super) const CYCLE_BEFORE: Refusal = refusal(Reason::CycleBefore, "define the cycle first: CYCLE/DRILL,…");
pub(super) const ARC_SENSE: Refusal =
    refusal(Reason::ArcSense, "check the points after CIRCLE, or let the CAM system write CLW or CCLW");
pub(super) const ARC_TANGENT: Refusal =
    refusal(Reason::ArcTangent, "check the axis of CIRCLE, or let the CAM system write CLW or CCLW");
pub(super) const BEHIND_END: Refusal = refusal(Reason::AfterFini, "give each program a file of its own");
pub(super) const LOOSE_NUMBERS: Refusal =
    refusal(Reason::LooseNumbers, "a continuation ($) may be missing at the end of the line before");
/// Numbers that are a position or a vector depending on their values: after a shift they might be read as the other kind.
pub(crate) const AMBIGUOUS_LIST: Refusal =
    refusal(Reason::AmbiguousList, "let the CAM system write one position (three, six or nine numbers) in a GOTO");
