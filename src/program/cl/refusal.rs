//! Why a statement is refused, and how to mend the file or the cell.

/// A reason with its help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// A short fixed phrase that can be counted.
    pub(crate) reason: &'static str,
    /// Empty for the help that all motions share.
    pub(super) help: &'static str,
}

impl From<&'static Refusal> for Refusal {
    fn from(refusal: &'static Refusal) -> Self {
        *refusal
    }
}

impl From<&'static str> for Refusal {
    fn from(reason: &'static str) -> Self {
        Self { reason, help: "" }
    }
}

/// Nothing, or why a statement is not understood.
pub(super) type Outcome = Result<(), Refusal>;

/// Why an arc is kept that no position follows.
pub(super) const ARC_WITHOUT_END: &str = "arc without an end";

const fn refusal(reason: &'static str, help: &'static str) -> Refusal {
    Refusal { reason, help }
}

pub(super) const MOTION: Refusal = refusal(
    "motion that is not read",
    "let the CAM system write it as GOTO; if it moves nothing on your machine, list the word in `[cl] harmless`",
);
pub(super) const UNKNOWN_MOTION: Refusal = refusal(
    "word not known that may move the tool",
    "let the CAM system write its motion as GOTO; if the word moves nothing, list it in `[cl] harmless`",
);
pub(super) const UNKNOWN_NUMBERS: Refusal = refusal(
    "word not known whose numbers may be a position",
    "let the CAM system write motion as GOTO; if the word moves nothing, list it in `[cl] harmless`",
);
pub(super) const ARC: Refusal =
    refusal("arc in a form that is not read", "let the CAM system write CIRCLE and GOTO, or points");
pub(super) const SPLINE: Refusal =
    refusal("spline curve is not read", "let the CAM system write points (GOTO) instead of NURBS");
pub(super) const CLEARANCE: Refusal = refusal(
    "retraction to a clearance plane that is the machine's",
    "let the CAM system write the retraction as GOTO; if it moves nothing on your machine, list the word in `[cl] harmless`",
);
pub(super) const SUBPROGRAM: Refusal = refusal(
    "subprogram of the machine's: its motion stands elsewhere",
    "let the CAM system write the motion out where it happens",
);
pub(super) const COPY: Refusal =
    refusal("COPY repeats what stands before", "let the CAM system write the repeated motion out");
pub(super) const PROBE: Refusal = refusal(
    "probing cycle: where the tool stops is known to the machine only",
    "take the measurement out of the program; if it moves nothing, list the word in `[cl] harmless`",
);
pub(super) const THREAD: Refusal =
    refusal("threading cycle of a lathe", "let the CAM system write the motion out as GOTO");
pub(super) const TAP: Refusal = refusal(
    "tapping: spindle and feed must be coupled, which a robot's program cannot say",
    "take the tapping out of the program",
);
pub(super) const OFFSET: Refusal = refusal(
    "offset whose size only the machine knows",
    "let the CAM system write positions without it; if it is zero, list the word in `[cl] harmless`",
);
pub(super) const TRANSFORM: Refusal = refusal(
    "transformation of the positions that follow",
    "let the CAM system write transformed positions; if they are so already, list the word in `[cl] harmless`",
);
pub(super) const TURNED: Refusal = refusal(
    "rotary table or head: geometry turns with it",
    "let the CAM system write positions and tool axes of the part as it stands; if they are so, list the word in `[cl] harmless`",
);
pub(super) const CUTTER_COMPENSATION: Refusal = refusal(
    "radius compensation, which a robot's controller has not",
    "let the CAM system write the path of the tool's centre; if it does so already, list CUTCOM in `[cl] harmless`",
);
pub(super) const INCREMENTAL: Refusal =
    refusal("positions from here on are increments", "let the CAM system write absolute positions");
pub(super) const SECOND_HEAD: Refusal = refusal(
    "a second head",
    "give each head a program of its own; if it is the robot's only one, list the word in `[cl] harmless`",
);
pub(super) const SYNONYM: Refusal =
    refusal("a word that moves the tool gets another name", "let the CAM system write the words themselves");
pub(super) const CONTROL_CODE: Refusal = refusal(
    "code of a numerical control that changes what positions mean",
    "let the CAM system write the positions themselves; if the code does nothing here, list PREFUN in `[cl] harmless`",
);
pub(super) const SECOND_TOOL: Refusal = refusal(
    "another tool, and the cell has one tool for all",
    "map the tool numbers in the cell: `[cl] tools = { \"1\" = \"tRough\", \"2\" = \"tFinish\" }`, or give --tool NAME",
);
pub(super) const UNMAPPED_TOOL: Refusal =
    refusal("tool number that `[cl] tools` does not map", "add it: `[cl] tools = { \"NUMBER\" = \"NAME\" }`");
pub(super) const NO_TOOL: Refusal = refusal(
    "position before the first tool number",
    "name the tool that is in hand at the start: `[cl] tool = \"NAME\"`",
);
pub(super) const NO_TOOL_NUMBER: Refusal =
    refusal("tool change without a number", "let the CAM system write the tool's number (LOADTL/1)");
pub(super) const SECOND_CUTTER: Refusal = refusal(
    "another cutter without a tool change",
    "let the CAM system write LOADTL with the tool's number, and map it in `[cl] tools`",
);
pub(super) const FEED_UNIT: Refusal =
    refusal("feed in a unit that is not known", "expected IPM, MMPM, FPM, MPM, IPS, MMPS, IPR, MMPR, PERMIN or PERREV");
pub(super) const INVERSE_TIME: Refusal =
    refusal("inverse-time feed (INVERS)", "let the CAM system write feeds per minute or per revolution");
pub(super) const NO_FEED: Refusal = refusal("feed without a number above 0", "let the CAM system write a feed above 0");
pub(super) const FEED_UNIT_LOST: Refusal =
    refusal("feed without a unit after one in another unit", "say the unit with every FEDRAT: IPM, MMPM, IPR, MMPR, …");
pub(super) const FEED_WITHOUT_SPINDLE: Refusal = refusal(
    "feed per revolution without a spindle speed",
    "let the CAM system write SPINDL/ with its speed before, or feeds per minute",
);
pub(super) const CYCLE_FORM: Refusal = refusal(
    "drilling cycle in a form that is not read",
    "let the CAM system write CYCLE/DRILL,DEPTH,d,MMPM,f,CLEAR,c, or the drilling as GOTO",
);
pub(super) const CYCLE_KIND: Refusal = refusal(
    "drilling cycle that a robot's program cannot say",
    "let the CAM system write its motion out as GOTO; DRILL, FACE, DEEP, BRKCHP, REAM and BORE are read",
);
pub(super) const CYCLE_FEED: Refusal =
    refusal("drilling cycle without a feed", "give its feed in CYCLE or with FEDRAT before");
pub(super) const CYCLE_BEFORE: Refusal =
    refusal("CYCLE/ON without a cycle before", "define the cycle first: CYCLE/DRILL,…");
pub(super) const ARC_SENSE: Refusal = refusal(
    "arc whose points contradict both senses",
    "check the points after CIRCLE, or let the CAM system write CLW or CCLW",
);
pub(super) const ARC_TANGENT: Refusal = refusal(
    "arc that turns back at its start: the other way round it would go on smoothly",
    "check the axis of CIRCLE, or let the CAM system write CLW or CCLW",
);
pub(super) const BEHIND_END: Refusal =
    refusal("motion after FINI, where the program ends", "give each program a file of its own");
pub(super) const LOOSE_NUMBERS: Refusal =
    refusal("numbers without a statement", "a continuation ($) may be missing at the end of the line before");
/// Numbers that are a position or a vector by where they lie: once shifted, they may be recognised as the other kind.
pub(crate) const AMBIGUOUS_LIST: Refusal = refusal(
    "positions and vectors that cannot be distinguished",
    "let the CAM system write one position (three, six or nine numbers) in a GOTO",
);
