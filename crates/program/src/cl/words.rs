//! Every major word: its effect on a machine, how it is treated, and the source.
//!
//! A word that moves the tool or changes the meaning of positions is understood or refused, never dropped. All others pass, and are
//! listed if the program of a robot lacks them.

use crate::Reason;

/// The effect of a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// Moves the tool.
    Moves,
    /// Changes the meaning of positions.
    Positions,
    /// Cuts differently: tool, feed, spindle.
    Cuts,
    /// Neither.
    Harmless,
    /// Belongs to APT-360, the language that CL data are made from: symbolic geometry and control flow.
    Source,
}

/// How a statement is treated.
#[derive(Clone, Copy, Debug)]
pub(super) enum Meaning {
    Goto,
    Godlta,
    Rapid,
    From,
    GoHome,
    Circle,
    MovArc,
    Tlon,
    Indirv,
    TlAxis,
    Feed,
    Spindle,
    Coolant,
    Stop,
    OptionalStop,
    Delay,
    /// `LOADTL/n`, `TOOLNO/n`, `TURRET/n`.
    LoadTool,
    /// `LOAD/TOOL,n`; there are other things to load.
    Load,
    /// `TOOL PATH/name,TOOL,name`.
    ToolPath,
    Cutter,
    Cycle,
    CutCom,
    Units,
    Msys,
    Csys,
    Origin,
    TrnTyp,
    /// Turns of a rotary table or head.
    Rotary,
    /// `TRACUT`, `TRANS`: harmless if they end a transformation or move nothing.
    Transform,
    Mode,
    Set,
    Select,
    Head,
    /// `PREFUN/n`, `AUXFUN/n`: codes of a numerical control.
    Code,
    /// `SYN/new,old` gives words other names.
    Synonym,
    /// Refused as it stands.
    Refused(Reason),
    /// Passes, and is listed.
    Listed(Reason),
    /// `FINI`: the program ends.
    Finish,
    /// Passes without a message: the program of a robot does not need it.
    Passes,
    /// Refused as APT-360 source.
    Source,
}

/// A major word.
#[derive(Clone, Copy, Debug)]
pub(super) struct Word {
    pub(super) name: &'static str,
    pub(super) class: Class,
    pub(super) meaning: Meaning,
    /// The source in which it is described or occurs, as on the page that lists all words.
    #[cfg_attr(not(test), expect(dead_code))]
    pub(super) source: &'static str,
}

const ISO: &str = "ISO 4343";
const APT: &str = "ANSI X3.37 (APT)";
const CATIA: &str = "CATIA APT import";
const CREO: &str = "Creo CL output";
const NX: &str = "NX CLSF";
const VERICUT: &str = "VERICUT APT-CLS records";
const SOLIDWORKS: &str = "SolidWorks CAM and CAMWorks files";
const AUTODESK: &str = "Autodesk APT post";
const MAKINO: &str = "MAKINO APTCL";

const PROCESS: Meaning = Meaning::Passes;
const UNWRITTEN: Meaning = Meaning::Listed(Reason::MachineFunction);

const fn word(name: &'static str, class: Class, meaning: Meaning, source: &'static str) -> Word {
    Word { name, class, meaning, source }
}

/// By name.
pub(super) const WORDS: [Word; WORD_COUNT] = {
    use Class::{Cuts, Harmless, Moves, Positions, Source};
    use Meaning::{Listed, Passes, Refused};
    [
        word("ADJUST", Positions, Refused(Reason::MachineOffset), ISO),
        word("AIR", Harmless, UNWRITTEN, ISO),
        word("ARC", Moves, Refused(Reason::ArcForm), VERICUT),
        word("ARCSLP", Harmless, Passes, ISO),
        word("ATANGL", Harmless, Passes, VERICUT),
        word("AUTOPS", Harmless, Passes, CATIA),
        word("AUXFUN", Cuts, Meaning::Code, ISO),
        word("BOX", Harmless, Passes, SOLIDWORKS),
        word("BREAK", Harmless, Passes, ISO),
        word("CALL", Source, Meaning::Source, APT),
        word("CALLSUB", Moves, Refused(Reason::Subprogram), ISO),
        word("CALSUB", Moves, Refused(Reason::Subprogram), ISO),
        word("CAMERA", Harmless, Passes, CREO),
        word("CANON", Source, Meaning::Source, APT),
        word("CHECK", Harmless, Passes, VERICUT),
        word("CHUCK", Harmless, UNWRITTEN, ISO),
        word("CIRCLE", Moves, Meaning::Circle, CREO),
        word("CLAMP", Harmless, UNWRITTEN, ISO),
        word("CLDIST", Harmless, Passes, ISO),
        word("CLEARP", Harmless, Passes, ISO),
        word("CLPRNT", Source, Meaning::Source, APT),
        word("CLRSRF", Harmless, Passes, ISO),
        word("CNTRL", Moves, Refused(Reason::SplineCurve), NX),
        word("COOLNT", Cuts, Meaning::Coolant, ISO),
        word("COPY", Moves, Refused(Reason::Copy), ISO),
        word("COUPLE", Harmless, UNWRITTEN, ISO),
        word("CSYS", Positions, Meaning::Csys, SOLIDWORKS),
        word("CUT", Source, Meaning::Source, APT),
        word("CUTCOM", Positions, Meaning::CutCom, ISO),
        word("CUTTER", Cuts, Meaning::Cutter, ISO),
        word("CYCLE", Moves, Meaning::Cycle, CREO),
        word("CYCLEPARAM", Harmless, Passes, SOLIDWORKS),
        word("DEFSUB", Moves, Refused(Reason::Subprogram), ISO),
        word("DELAY", Cuts, Meaning::Delay, ISO),
        word("DISPLY", Harmless, Passes, ISO),
        word("DNTCUT", Source, Meaning::Source, APT),
        word("DRAFT", Harmless, Passes, VERICUT),
        word("DRESS", Harmless, Passes, ISO),
        word("DWELL", Cuts, Meaning::Delay, ISO),
        word("END", Harmless, Passes, ISO),
        word("END-OF-PATH", Harmless, Passes, NX),
        word("ENDSUB", Harmless, Passes, ISO),
        word("FEDRAT", Cuts, Meaning::Feed, ISO),
        word("FEDRATE", Cuts, Meaning::Feed, ISO),
        word("FEEDOVER", Harmless, UNWRITTEN, SOLIDWORKS),
        word("FINI", Harmless, Meaning::Finish, ISO),
        word("FIXOFF", Positions, Refused(Reason::MachineOffset), VERICUT),
        word("FROM", Positions, Meaning::From, ISO),
        word("GO", Source, Meaning::Source, APT),
        word("GOBACK", Source, Meaning::Source, APT),
        word("GOCLER", Moves, Refused(Reason::ClearancePlane), ISO),
        word("GODLTA", Moves, Meaning::Godlta, CATIA),
        word("GODOWN", Source, Meaning::Source, APT),
        word("GOFWD", Source, Meaning::Source, APT),
        word("GOHOME", Moves, Meaning::GoHome, ISO),
        word("GOLFT", Source, Meaning::Source, APT),
        word("GORGT", Source, Meaning::Source, APT),
        word("GOTO", Moves, Meaning::Goto, ISO),
        word("GOUP", Source, Meaning::Source, APT),
        word("HEAD", Positions, Meaning::Head, ISO),
        word("HEADER", Harmless, Passes, VERICUT),
        word("HELIX", Moves, Refused(Reason::ArcForm), VERICUT),
        word("ID", Harmless, Passes, SOLIDWORKS),
        word("IF", Source, Meaning::Source, APT),
        word("INDEX", Harmless, Passes, ISO),
        word("INDIRV", Moves, Meaning::Indirv, CATIA),
        word("INTCOD", Harmless, Passes, ISO),
        word("INTOL", Harmless, Passes, ISO),
        word("JUMPTO", Source, Meaning::Source, APT),
        word("KNOT", Moves, Refused(Reason::SplineCurve), NX),
        word("LEADER", Harmless, Passes, ISO),
        word("LIBRY", Source, Meaning::Source, APT),
        word("LIMIT", Harmless, Passes, ISO),
        word("LINTOL", Harmless, Passes, ISO),
        word("LOAD", Cuts, Meaning::Load, ISO),
        word("LOADTL", Cuts, Meaning::LoadTool, ISO),
        word("LOCK", Harmless, UNWRITTEN, ISO),
        word("LOOPND", Source, Meaning::Source, APT),
        word("LOOPST", Source, Meaning::Source, APT),
        word("MACHIN", Harmless, Passes, ISO),
        word("MACRO", Source, Meaning::Source, APT),
        word("MAGTAP", Moves, Refused(Reason::Tapping), ISO),
        word("MAXDPM", Harmless, Passes, ISO),
        word("MCHTOL", Harmless, Passes, ISO),
        word("MIRROR", Positions, Refused(Reason::Transformation), ISO),
        word("MODE", Positions, Meaning::Mode, ISO),
        word("MOVARC", Moves, Meaning::MovArc, AUTODESK),
        word("MOVETO", Moves, Refused(Reason::MotionUnread), VERICUT),
        word("MOVE_ATTRIB", Harmless, Passes, SOLIDWORKS),
        word("MSYS", Positions, Meaning::Msys, NX),
        word("MULTAX", Harmless, Passes, CATIA),
        word("NOPOST", Source, Meaning::Source, APT),
        word("NUMF", Source, Meaning::Source, APT),
        word("NURBS", Moves, Refused(Reason::SplineCurve), NX),
        word("OBTAIN", Source, Meaning::Source, APT),
        word("OFSTNO", Positions, Refused(Reason::MachineOffset), VERICUT),
        word("OPFEATEND", Harmless, Passes, SOLIDWORKS),
        word("OPFEATSTART", Harmless, Passes, SOLIDWORKS),
        word("OPSKIP", Harmless, Listed(Reason::OptionalSkip), ISO),
        word("OPSTOP", Cuts, Meaning::OptionalStop, ISO),
        word("ORIGIN", Positions, Meaning::Origin, CATIA),
        word("OUTTOL", Harmless, Passes, ISO),
        word("PAINT", Harmless, Passes, NX),
        word("PBS", Harmless, Passes, SOLIDWORKS),
        word("PENDWN", Harmless, Passes, ISO),
        word("PENUP", Harmless, Passes, ISO),
        word("PITCH", Harmless, Passes, ISO),
        word("PIVOTZ", Harmless, Passes, ISO),
        word("PLABEL", Harmless, Passes, ISO),
        word("PLOT", Harmless, Passes, ISO),
        word("POCKET", Source, Meaning::Source, APT),
        word("PPFUN", Harmless, Passes, ISO),
        word("PPTOL", Harmless, Passes, VERICUT),
        word("PPWORD", Harmless, Passes, CREO),
        word("PREFUN", Positions, Meaning::Code, ISO),
        word("PRINT", Harmless, Passes, ISO),
        word("PROBE", Moves, Refused(Reason::Probing), ISO),
        word("PSIS", Harmless, Passes, CATIA),
        word("RAPID", Moves, Meaning::Rapid, ISO),
        word("RECIPE", Harmless, Passes, SOLIDWORKS),
        word("REFSYS", Source, Meaning::Source, APT),
        word("RESERV", Harmless, Passes, ISO),
        word("RESET", Harmless, Passes, VERICUT),
        word("RETRCT", Moves, Refused(Reason::ClearancePlane), ISO),
        word("REWIND", Harmless, Passes, ISO),
        word("ROTABL", Positions, Meaning::Rotary, ISO),
        word("ROTATE", Positions, Meaning::Rotary, ISO),
        word("ROTHED", Positions, Meaning::Rotary, ISO),
        word("SADDLE", Moves, Refused(Reason::MotionUnread), ISO),
        word("SAFETY", Harmless, Passes, ISO),
        word("SCALE", Positions, Refused(Reason::Transformation), VERICUT),
        word("SELCTL", Harmless, Passes, ISO),
        word("SELECT", Cuts, Meaning::Select, ISO),
        word("SEQNO", Harmless, Passes, ISO),
        word("SET", Positions, Meaning::Set, MAKINO),
        word("SETUP", Harmless, Passes, SOLIDWORKS),
        word("SLOWDN", Harmless, Passes, ISO),
        word("SPINDL", Cuts, Meaning::Spindle, ISO),
        word("SPINDLE", Cuts, Meaning::Spindle, ISO),
        word("SPLINE", Moves, Refused(Reason::SplineCurve), NX),
        word("SPLIT", Harmless, Passes, SOLIDWORKS),
        word("STAN", Harmless, Passes, ISO),
        word("STOP", Cuts, Meaning::Stop, ISO),
        word("SWITCH", Harmless, PROCESS, CATIA),
        word("SYN", Positions, Meaning::Synonym, APT),
        word("TERMAC", Source, Meaning::Source, APT),
        word("THICK", Source, Meaning::Source, APT),
        word("THREAD", Moves, Refused(Reason::Threading), ISO),
        word("TIME", Harmless, Passes, VERICUT),
        word("TLAXIS", Positions, Meaning::TlAxis, CATIA),
        word("TLCOMP", Positions, Meaning::CutCom, ISO),
        word("TLDATA", Cuts, Meaning::Cutter, NX),
        word("TLLFT", Source, Meaning::Source, APT),
        word("TLNDON", Source, Meaning::Source, APT),
        word("TLON", Moves, Meaning::Tlon, CATIA),
        word("TLRGT", Source, Meaning::Source, APT),
        word("TLSPEC", Harmless, Passes, ISO),
        word("TMARK", Harmless, Passes, ISO),
        word("TOOL", Cuts, Meaning::ToolPath, NX),
        word("TOOLNO", Cuts, Meaning::LoadTool, ISO),
        word("TRACUT", Positions, Meaning::Transform, APT),
        word("TRANS", Positions, Meaning::Transform, ISO),
        word("TRNTYP", Positions, Meaning::TrnTyp, SOLIDWORKS),
        word("TURRET", Cuts, Meaning::LoadTool, ISO),
        word("UNIT", Positions, Meaning::Units, SOLIDWORKS),
        word("UNITS", Positions, Meaning::Units, ISO),
        word("UNLOAD", Cuts, UNWRITTEN, ISO),
        word("UNTIL", Source, Meaning::Source, APT),
        word("VERIFY", Harmless, Passes, VERICUT),
        word("WPLANE", Harmless, Passes, ISO),
        word("ZERO", Positions, Refused(Reason::Transformation), ISO),
        word("ZOFF", Positions, Refused(Reason::MachineOffset), VERICUT),
        word("ZSURF", Source, Meaning::Source, APT),
    ]
};

const WORD_COUNT: usize = 173;

/// Words of one maker that have a common beginning.
const VENDOR: [(&[u8], Word); 1] = [(b"CSI_", word("CSI_…", Class::Harmless, Meaning::Passes, SOLIDWORKS))];

/// Beginnings of unknown words that may move the tool, and therefore do not pass.
const LIKE_MOTION: [&[u8]; 16] = [
    b"GO", b"MOV", b"CIRC", b"ARC", b"CYCL", b"ROT", b"TRAN", b"HELI", b"NURB", b"SPLI", b"PROB", b"RETR", b"DRIL",
    b"THRE", b"INCR", b"TURN",
];

/// Longest name in the list, with a margin.
const LONGEST: usize = 16;

/// Looks a major word up, in any case.
pub(super) fn find(major: &[u8]) -> Option<&'static Word> {
    // Most statements that are not read as plain positions are positions too.
    let mut upper = [0; LONGEST];
    let Some(name) = upper.get_mut(..major.len()) else { return vendor(major) };
    name.copy_from_slice(major);
    name.make_ascii_uppercase();
    let found = WORDS.binary_search_by(|word| word.name.as_bytes().cmp(name));
    found.ok().map(|at| &WORDS[at]).or_else(|| vendor(major))
}

fn vendor(major: &[u8]) -> Option<&'static Word> {
    VENDOR.iter().find(|(prefix, _)| begins(major, prefix)).map(|(_, word)| word)
}

/// Whether an unknown word may be one that moves the tool.
pub(super) fn looks_like_motion(major: &[u8]) -> bool {
    LIKE_MOTION.iter().any(|prefix| begins(major, prefix))
}

/// Whether the path is another one if a statement is not read.
pub(super) fn decides_motion(class: Class) -> bool {
    matches!(class, Class::Moves | Class::Positions | Class::Source)
}

/// Whether a cell may declare a word to be harmless: not if deflex understands it.
#[must_use]
#[doc(hidden)]
pub fn may_be_declared_harmless(name: &str) -> bool {
    find(name.as_bytes()).is_none_or(|word| {
        matches!(
            word.meaning,
            Meaning::Refused(_)
                | Meaning::CutCom
                | Meaning::Rotary
                | Meaning::Transform
                | Meaning::Mode
                | Meaning::Set
                | Meaning::Head
                | Meaning::Code
                | Meaning::Synonym
                | Meaning::Listed(_)
                | Meaning::Passes
        )
    })
}

fn begins(word: &[u8], prefix: &[u8]) -> bool {
    word.get(..prefix.len()).is_some_and(|start| start.eq_ignore_ascii_case(prefix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_in_order_and_each_stands_once() {
        assert!(WORDS.windows(2).all(|pair| pair[0].name < pair[1].name));
        assert!(WORDS.iter().all(|word| word.name.len() <= LONGEST && !word.source.is_empty()));
        assert_eq!(find(b"goto").map(|word| word.name), Some("GOTO"));
        assert_eq!(find(b"csi_set_flute_length").map(|word| word.class), Some(Class::Harmless));
    }

    #[test]
    fn nothing_that_moves_the_tool_or_changes_positions_passes_without_a_word() {
        for word in &WORDS {
            let passes = matches!(word.meaning, Meaning::Passes | Meaning::Listed(_));
            assert!(!(passes && decides_motion(word.class)), "{}", word.name);
        }
    }

    #[test]
    fn the_documentation_lists_every_word_with_its_class_and_its_source() {
        let page = include_str!("../../../../docs/cl-words.md");
        for Word { name, class, source, .. } in &WORDS {
            let class = match class {
                Class::Moves => "moves the tool",
                Class::Positions => "changes positions",
                Class::Cuts => "cuts differently",
                Class::Harmless => "harmless",
                Class::Source => "APT-360 source",
            };
            assert!(page.contains(&format!("| `{name}` | {class} |")), "| `{name}` | {class} | … | {source} |");
            assert!(page.contains(source), "{source}");
        }
    }
}
