//! What is wrong today: a construct that is mended comes off the list, or the test fails.

/// A motion goes elsewhere, or stays uncorrected without a word.
pub const WRONG: &[&str] = &[];

/// Less is corrected than could be; said.
pub const LEFT: &[&str] =
    &["displacement on and off", "GOTO always", "target assigned another", "target assigned behind its use"];

/// So many of the first thousand generated programs are wrong; no more may become so.
pub const WRONG_PROGRAMS: usize = 3;

/// CL constructs: a path that is another, or a statement dropped without a word.
pub const CL_WRONG: &[&str] = &[];

/// CL constructs that are refused and could be understood.
pub const CL_REFUSED: &[&str] = &[];
