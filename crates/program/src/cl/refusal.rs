//! Help for refused statements: what to change in the file or the cell.

use crate::Reason;

/// Nothing, or why a statement is not understood.
pub(super) type Outcome = Result<(), Reason>;

/// What to do about a refused statement; `None` for the help that all motions share.
pub(crate) fn help(reason: Reason) -> Option<&'static str> {
    Some(match reason {
        Reason::MotionUnread => {
            "let the CAM system write it as GOTO; if it moves nothing on your machine, list the word in `[cl] harmless`"
        }
        Reason::WordMayMove => {
            "let the CAM system write its motion as GOTO; if the word moves nothing, list it in `[cl] harmless`"
        }
        Reason::WordMayBePosition => {
            "let the CAM system write motion as GOTO; if the word moves nothing, list it in `[cl] harmless`"
        }
        Reason::ArcForm => "let the CAM system write CIRCLE and GOTO, or points",
        Reason::SplineCurve => "let the CAM system write points (GOTO) instead of NURBS",
        Reason::ClearancePlane => {
            "let the CAM system write the retraction as GOTO; if it moves nothing on your machine, list the word in `[cl] harmless`"
        }
        Reason::Subprogram => "let the CAM system write the motion out where it happens",
        Reason::Copy => "let the CAM system write the repeated motion out",
        Reason::Probing => {
            "take the measurement out of the program; if it moves nothing, list the word in `[cl] harmless`"
        }
        Reason::Threading => "let the CAM system write the motion out as GOTO",
        Reason::Tapping => "take the tapping out of the program",
        Reason::MachineOffset => {
            "let the CAM system write positions without it; if it is zero, list the word in `[cl] harmless`"
        }
        Reason::Transformation => {
            "let the CAM system write transformed positions; if they are so already, list the word in `[cl] harmless`"
        }
        Reason::Rotary => {
            "let the CAM system write positions and tool axes of the part as it stands; if they are so, list the word in `[cl] harmless`"
        }
        Reason::RadiusCompensation => {
            "let the CAM system write the path of the tool's centre; if it does so already, list CUTCOM in `[cl] harmless`"
        }
        Reason::Increments => "let the CAM system write absolute positions",
        Reason::SecondHead => {
            "give each head a program of its own; if it is the robot's only one, list the word in `[cl] harmless`"
        }
        Reason::Synonym => "let the CAM system write the words themselves",
        Reason::ControlCode => {
            "let the CAM system write the positions themselves; if the code does nothing here, list PREFUN in `[cl] harmless`"
        }
        Reason::SecondTool => {
            "map the tool numbers in the cell: `[cl] tools = { \"1\" = \"tRough\", \"2\" = \"tFinish\" }`, or give --tool NAME"
        }
        Reason::UnmappedTool => "add it: `[cl] tools = { \"NUMBER\" = \"NAME\" }`",
        Reason::NoTool => "name the tool that is in hand at the start: `[cl] tool = \"NAME\"`",
        Reason::NoToolNumber => "let the CAM system write the tool's number (LOADTL/1)",
        Reason::SecondCutter => "let the CAM system write LOADTL with the tool's number, and map it in `[cl] tools`",
        Reason::FeedUnit => "expected IPM, MMPM, FPM, MPM, IPS, MMPS, IPR, MMPR, PERMIN or PERREV",
        Reason::InverseTime => "let the CAM system write feeds per minute or per revolution",
        Reason::NoFeed => "let the CAM system write a feed above 0",
        Reason::FeedUnitLost => "say the unit with every FEDRAT: IPM, MMPM, IPR, MMPR, …",
        Reason::FeedWithoutSpindle => "let the CAM system write SPINDL/ with its speed before, or feeds per minute",
        Reason::CycleForm => "let the CAM system write CYCLE/DRILL,DEPTH,d,MMPM,f,CLEAR,c, or the drilling as GOTO",
        Reason::CycleKind => {
            "let the CAM system write its motion out as GOTO; DRILL, FACE, DEEP, BRKCHP, REAM and BORE are read"
        }
        Reason::CycleFeed => "give its feed in CYCLE or with FEDRAT before",
        Reason::CycleBefore => "define the cycle first: CYCLE/DRILL,…",
        Reason::ArcSense => "check the points after CIRCLE, or let the CAM system write CLW or CCLW",
        Reason::ArcTangent => "check the axis of CIRCLE, or let the CAM system write CLW or CCLW",
        Reason::AfterFini => "give each program a file of its own",
        Reason::LooseNumbers => "a continuation ($) may be missing at the end of the line before",
        Reason::AmbiguousList => "let the CAM system write one position (three, six or nine numbers) in a GOTO",
        _ => return None,
    })
}
