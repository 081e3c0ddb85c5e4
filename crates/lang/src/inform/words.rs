//! The instructions of INFORM that have no rule of their own in the parser.
//!
//! Source: Yaskawa, *DX100 / DX200 / YRC1000 Options, Instructions: INFORM Language*. An instruction that is not here may change anything.

use super::builtin::{SHIFT, UNSHIFT, UNWEAVE, WEAVE};
use crate::ir::Switch;
use crate::reason::Reason;

/// The effect of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Does {
    /// Changes nothing on which a motion depends.
    Nothing,
    /// Makes the variable that it names first unknown, for this reason.
    Gives(Reason),
    /// Redefines a setting, for this reason.
    Defines(Switch, Reason),
    /// Begins or ends a shift of positions: a routine of the dialect.
    Calls(u16),
}

/// The effect of an instruction; `None` for other words.
pub(super) fn find(word: &[u8]) -> Option<Does> {
    let word = std::str::from_utf8(word).ok()?;
    INSTRUCTIONS
        .iter()
        .find(|(words, _)| words.split_ascii_whitespace().any(|known| known == word))
        .map(|(_, does)| *does)
}

const INSTRUCTIONS: [(&str, Does); 9] = [
    (
        "NOP DOUT PULSE AOUT TIMER MSG CWAIT PAUSE CLS PRINT HAND HSEN SPEED REFP SETREG SETUALM ADVINIT ADVSTOP \
         LATESTJOB SETTM ARATION ARATIOF ANTOUT ARCON ARCOF ARCSET ARCCTS ARCCTE VWELD AWELD RETRY REPLAY ANTSTK GUNCL \
         GUNCHG SPOT STROKE STRWAIT TOOLON TOOLOF HTRAJON HTRAJOF HPVELON HPVELOF HPMMVON HPMMVOF SMOOTH NWAIT ENDWAIT
         WVADJ CLRSENS COMARCOF SHCKSET SHCKRST",
        Does::Nothing,
    ),
    (
        "DIN INPUT GETREG GETS GETARG GETNAME GETFILE GETTOOL GETPRM DIALOG VAL LEN ASC STRSTR CHR$ MID$ CAT$ VAL2STR",
        Does::Gives(Reason::Input),
    ),
    ("CNVRT MULMAT INVMAT MSHIFT SQRT SIN COS TAN ATAN AND OR NOT XOR GETPOS", Does::Gives(Reason::Computed)),
    ("MFRAME", Does::Defines(Switch::Frame, Reason::Frame)),
    ("SETTOOL", Does::Defines(Switch::Tool, Reason::Tool)),
    ("SFTON3D COMARCON", Does::Calls(SHIFT)),
    ("SFTOF SFTOF3D", Does::Calls(UNSHIFT)),
    ("WVON", Does::Calls(WEAVE)),
    ("WVOF", Does::Calls(UNWEAVE)),
];
