//! Every major word: its effect on a machine, how it is treated, and the source.
//!
//! A word that moves the tool or changes the meaning of positions is understood or refused, never dropped. All others pass, and are
//! listed if the program of a robot lacks them.

use crate::Reason;
use std::sync::LazyLock;

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

/// The words with one effect and one treatment, by the source in which they are described or occur.
type Group = (Class, Meaning, &'static str, &'static [&'static str]);

#[rustfmt::skip] // rows with a list of words each
const GROUPS: &[Group] = {
    use Class::{Cuts, Harmless, Moves, Positions, Source};
    use Meaning::{Listed, Passes, Refused};
    &[
        (Harmless, Passes, ISO, &[
            "ARCSLP", "BREAK", "CLDIST", "CLEARP", "CLRSRF", "DISPLY", "DRESS", "END", "ENDSUB", "INDEX", "INTCOD",
            "INTOL", "LEADER", "LIMIT", "LINTOL", "MACHIN", "MAXDPM", "MCHTOL", "OUTTOL", "PENDWN", "PENUP", "PITCH",
            "PIVOTZ", "PLABEL", "PLOT", "PPFUN", "PRINT", "RESERV", "REWIND", "SAFETY", "SELCTL", "SEQNO", "SLOWDN",
            "STAN", "TLSPEC", "TMARK", "WPLANE",
        ]),
        (Harmless, Passes, SOLIDWORKS, &[
            "BOX", "CYCLEPARAM", "ID", "MOVE_ATTRIB", "OPFEATEND", "OPFEATSTART", "PBS", "RECIPE", "SETUP", "SPLIT",
        ]),
        (Harmless, Passes, VERICUT, &["ATANGL", "CHECK", "DRAFT", "HEADER", "PPTOL", "RESET", "TIME", "VERIFY"]),
        (Harmless, Listed(Reason::MachineFunction), ISO, &["AIR", "CHUCK", "CLAMP", "COUPLE", "LOCK"]),
        (Harmless, Passes, CATIA, &["AUTOPS", "MULTAX", "PSIS", "SWITCH"]),
        (Harmless, Listed(Reason::OptionalSkip), ISO, &["OPSKIP"]),
        (Harmless, Meaning::Finish, ISO, &["FINI"]),
        (Harmless, Passes, CREO, &["CAMERA", "PPWORD"]),
        (Harmless, Passes, NX, &["END-OF-PATH", "PAINT"]),
        (Harmless, Listed(Reason::MachineFunction), SOLIDWORKS, &["FEEDOVER"]),
        (Source, Meaning::Source, APT, &[
            "CALL", "CANON", "CLPRNT", "CUT", "DNTCUT", "GO", "GOBACK", "GODOWN", "GOFWD", "GOLFT", "GORGT", "GOUP",
            "IF", "JUMPTO", "LIBRY", "LOOPND", "LOOPST", "MACRO", "NOPOST", "NUMF", "OBTAIN", "POCKET", "REFSYS",
            "TERMAC", "THICK", "TLLFT", "TLNDON", "TLRGT", "UNTIL", "ZSURF",
        ]),
        (Cuts, Meaning::LoadTool, ISO, &["LOADTL", "TOOLNO", "TURRET"]),
        (Cuts, Meaning::Code, ISO, &["AUXFUN"]),
        (Cuts, Meaning::Coolant, ISO, &["COOLNT"]),
        (Cuts, Meaning::Cutter, ISO, &["CUTTER"]),
        (Cuts, Meaning::Cutter, NX, &["TLDATA"]),
        (Cuts, Meaning::Delay, ISO, &["DELAY", "DWELL"]),
        (Cuts, Meaning::Feed, ISO, &["FEDRAT", "FEDRATE"]),
        (Cuts, Meaning::Load, ISO, &["LOAD"]),
        (Cuts, Meaning::OptionalStop, ISO, &["OPSTOP"]),
        (Cuts, Meaning::Select, ISO, &["SELECT"]),
        (Cuts, Meaning::Spindle, ISO, &["SPINDL", "SPINDLE"]),
        (Cuts, Meaning::Stop, ISO, &["STOP"]),
        (Cuts, Meaning::ToolPath, NX, &["TOOL"]),
        (Cuts, Listed(Reason::MachineFunction), ISO, &["UNLOAD"]),
        (Positions, Meaning::Rotary, ISO, &["ROTABL", "ROTATE", "ROTHED"]),
        (Positions, Refused(Reason::MachineOffset), VERICUT, &["FIXOFF", "OFSTNO", "ZOFF"]),
        (Positions, Meaning::Code, ISO, &["PREFUN"]),
        (Positions, Meaning::Csys, SOLIDWORKS, &["CSYS"]),
        (Positions, Meaning::CutCom, ISO, &["CUTCOM", "TLCOMP"]),
        (Positions, Meaning::From, ISO, &["FROM"]),
        (Positions, Meaning::Head, ISO, &["HEAD"]),
        (Positions, Meaning::Mode, ISO, &["MODE"]),
        (Positions, Meaning::Msys, NX, &["MSYS"]),
        (Positions, Meaning::Origin, CATIA, &["ORIGIN"]),
        (Positions, Meaning::Set, MAKINO, &["SET"]),
        (Positions, Meaning::Synonym, APT, &["SYN"]),
        (Positions, Meaning::TlAxis, CATIA, &["TLAXIS"]),
        (Positions, Meaning::Transform, APT, &["TRACUT"]),
        (Positions, Meaning::Transform, ISO, &["TRANS"]),
        (Positions, Meaning::TrnTyp, SOLIDWORKS, &["TRNTYP"]),
        (Positions, Meaning::Units, SOLIDWORKS, &["UNIT"]),
        (Positions, Meaning::Units, ISO, &["UNITS"]),
        (Positions, Refused(Reason::MachineOffset), ISO, &["ADJUST"]),
        (Positions, Refused(Reason::Transformation), ISO, &["MIRROR", "ZERO"]),
        (Positions, Refused(Reason::Transformation), VERICUT, &["SCALE"]),
        (Moves, Refused(Reason::SplineCurve), NX, &["CNTRL", "KNOT", "NURBS", "SPLINE"]),
        (Moves, Refused(Reason::Subprogram), ISO, &["CALLSUB", "CALSUB", "DEFSUB"]),
        (Moves, Meaning::Circle, CREO, &["CIRCLE"]),
        (Moves, Meaning::Cycle, CREO, &["CYCLE"]),
        (Moves, Meaning::GoHome, ISO, &["GOHOME"]),
        (Moves, Meaning::Godlta, CATIA, &["GODLTA"]),
        (Moves, Meaning::Goto, ISO, &["GOTO"]),
        (Moves, Meaning::Indirv, CATIA, &["INDIRV"]),
        (Moves, Meaning::MovArc, AUTODESK, &["MOVARC"]),
        (Moves, Meaning::Rapid, ISO, &["RAPID"]),
        (Moves, Meaning::Tlon, CATIA, &["TLON"]),
        (Moves, Refused(Reason::ArcForm), VERICUT, &["ARC", "HELIX"]),
        (Moves, Refused(Reason::ClearancePlane), ISO, &["GOCLER", "RETRCT"]),
        (Moves, Refused(Reason::Copy), ISO, &["COPY"]),
        (Moves, Refused(Reason::MotionUnread), VERICUT, &["MOVETO"]),
        (Moves, Refused(Reason::MotionUnread), ISO, &["SADDLE"]),
        (Moves, Refused(Reason::Probing), ISO, &["PROBE"]),
        (Moves, Refused(Reason::Tapping), ISO, &["MAGTAP"]),
        (Moves, Refused(Reason::Threading), ISO, &["THREAD"]),
    ]
};

/// All words, by name.
static WORDS: LazyLock<Vec<Word>> = LazyLock::new(|| {
    let mut words: Vec<Word> = GROUPS.iter().flat_map(words_of).collect();
    words.sort_unstable_by_key(|word| word.name);
    words
});

fn words_of(&(class, meaning, source, names): &Group) -> impl Iterator<Item = Word> {
    names.iter().map(move |name| Word { name, class, meaning, source })
}

/// Words of one maker that have a common beginning.
const VENDOR: [(&[u8], Word); 1] = {
    let (class, meaning, source) = (Class::Harmless, Meaning::Passes, SOLIDWORKS);
    [(b"CSI_", Word { name: "CSI_…", class, meaning, source })]
};

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
        for word in WORDS.iter() {
            let passes = matches!(word.meaning, Meaning::Passes | Meaning::Listed(_));
            assert!(!(passes && decides_motion(word.class)), "{}", word.name);
        }
    }

    #[test]
    fn the_documentation_lists_every_word_with_its_class_and_its_source() {
        let page = include_str!("../../../../docs/cl-words.md");
        for Word { name, class, source, .. } in WORDS.iter() {
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
