//! Words without motion: what a statement that is not in the reader's list is.

/// Statements that machine or describe something but move nothing: they pass as they are.
const WITHOUT_MOTION: [&[u8]; 78] = [
    b"AIR",
    b"AUXFUN",
    b"BOX",
    b"BREAK",
    b"CAMERA",
    b"CALLSUB",
    b"CHUCK",
    b"CLAMP",
    b"CLDIST",
    b"CLRSRF",
    b"COOLNT",
    b"CSI_",
    b"CUTTER",
    b"CYCLEPARAM",
    b"DEFSUB",
    b"DELAY",
    b"DISPLY",
    b"DRESS",
    b"DWELL",
    b"END",
    b"END-OF-PATH",
    b"ENDSUB",
    b"FEEDOVER",
    b"FINI",
    b"GOCLER",
    b"HEAD",
    b"ID",
    b"INTCOD",
    b"INTOL",
    b"LEADER",
    b"LIMIT",
    b"LINTOL",
    b"LOAD",
    b"LOADTL",
    b"LOCK",
    b"MACHIN",
    b"MAXDPM",
    b"MCHTOL",
    b"MODE",
    b"MOVE_ATTRIB",
    b"MULTAX",
    b"OPFEATEND",
    b"OPFEATSTART",
    b"OPSKIP",
    b"OPSTOP",
    b"OUTTOL",
    b"PAINT",
    b"PBS",
    b"PIVOTZ",
    b"PLOT",
    b"PPFUN",
    b"PPWORD",
    b"PREFUN",
    b"PRINT",
    b"PROBE",
    b"RECIPE",
    b"RESERV",
    b"RETRCT",
    b"REWIND",
    b"SAFETY",
    b"SELCTL",
    b"SELECT",
    b"SEQNO",
    b"SET",
    b"SETUP",
    b"SPLIT",
    b"STAN",
    b"STOP",
    b"SWITCH",
    b"SYN",
    b"THREAD",
    b"TLCOMP",
    b"TLSPEC",
    b"TMARK",
    b"TOOL",
    b"TOOLNO",
    b"TURRET",
    b"WPLANE",
];

/// Words that only the APT-360 language has: symbolic geometry, motion along it, control flow.
const SOURCE_WORDS: [&[u8]; 30] = [
    b"GO", b"GOLFT", b"GORGT", b"GOBACK", b"GOUP", b"GODOWN", b"GOFWD", b"TLLFT", b"TLRGT", b"LOOPST", b"LOOPND",
    b"MACRO", b"TERMAC", b"CALL", b"IF", b"JUMPTO", b"POCKET", b"CANON", b"OBTAIN", b"ZSURF", b"REFSYS", b"CLPRNT",
    b"NOPOST", b"DNTCUT", b"THICK", b"TLNDON", b"UNTIL", b"LIBRY", b"NUMF", b"CUT",
];

/// Statements that move the tool, or say how positions are meant: without them it goes elsewhere.
const MOTION_WORDS: [&[u8]; 20] = [
    b"GOTO", b"GODLTA", b"RAPID", b"CIRCLE", b"MOVARC", b"TLON", b"NURBS", b"KNOT", b"CNTRL", b"COPY", b"TRANS",
    b"ROTABL", b"ROTATE", b"ROTHED", b"MSYS", b"CSYS", b"ORIGIN", b"UNITS", b"UNIT", b"TLAXIS",
];

/// Whether the tool goes elsewhere where a statement is not read.
pub(super) fn decides_motion(major: &[u8]) -> bool {
    is_source(major) || MOTION_WORDS.iter().any(|w| w.eq_ignore_ascii_case(major))
}

/// Whether a statement moves nothing, so that it needs no understanding to be kept.
pub(super) fn is_without_motion(major: &[u8]) -> bool {
    starts_with(major, b"CSI_") || WITHOUT_MOTION.iter().any(|w| w.eq_ignore_ascii_case(major))
}

/// Whether a statement belongs to APT-360 source rather than to CL data.
pub(super) fn is_source(major: &[u8]) -> bool {
    SOURCE_WORDS.iter().any(|w| w.eq_ignore_ascii_case(major))
}

fn starts_with(word: &[u8], prefix: &[u8]) -> bool {
    word.len() >= prefix.len() && word[..prefix.len()].eq_ignore_ascii_case(prefix)
}
