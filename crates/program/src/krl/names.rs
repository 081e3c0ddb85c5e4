//! Names of the language and of KUKA's own files, by their effect on where the robot goes.
//!
//! Source: KUKA System Software, *Operating and Programming Instructions for System Integrators*, KSS 8.3, chapter on KRL, and
//! the comments of the controller's own BAS.SRC, as cited in public programs.

use crate::{Motion, Reason};

/// A motion statement.
pub(super) fn motion(word: &[u8]) -> Option<Motion> {
    Some(match word {
        b"PTP" | b"SPTP" => Motion::Joint,
        b"LIN" | b"SLIN" | b"SPL" => Motion::Linear,
        b"CIRC" | b"SCIRC" => Motion::Circular,
        _ => return None,
    })
}

/// Why the motion of a word is not followed: it is relative to the present position, or moves external axes asynchronously to the program.
/// `None` for other words.
pub(super) fn relative(word: &[u8]) -> Option<Reason> {
    Some(match word {
        b"PTP_REL" | b"LIN_REL" | b"CIRC_REL" | b"SPTP_REL" | b"SLIN_REL" | b"SCIRC_REL" | b"SPL_REL" => {
            Reason::RelativeMotion
        }
        b"ASYPTP" | b"ASYCONT" => Reason::AsynchronousMotion,
        _ => return None,
    })
}

/// `WITH`, and the words that say how a motion is blended into the next one.
pub(super) const APPROXIMATE: [&[u8]; 6] = [b"WITH", b"C_DIS", b"C_VEL", b"C_ORI", b"C_PTP", b"C_SPL"];

/// Statements that change no data and move nothing.
pub(super) const HARMLESS_STATEMENTS: [&[u8]; 14] = [
    b"WAIT", b"HALT", b"CONTINUE", b"BRAKE", b"RESUME", b"INTERRUPT", b"GLOBAL", b"PULSE", b"ANOUT", b"CONFIRM",
    b"CONST_VEL", b"STOP", b"SYNC", b"ON_ERROR_PROCEED",
];

/// Words of the language that may be before a bracket without a call.
pub(super) const NO_CALLS: [&[u8]; 15] = [
    b"AND", b"OR", b"NOT", b"EXOR", b"B_AND", b"B_OR", b"B_NOT", b"B_EXOR", b"FOR", b"SEC", b"CA", b"DO", b"WHEN",
    b"TO", b"STEP",
];

/// System data that keep an assigned value; all others change by themselves.
pub(super) const SETTLED: [&[u8]; 9] =
    [b"$BASE", b"$TOOL", b"$LOAD", b"$VEL", b"$APO", b"$IPO_MODE", b"$ORI_TYPE", b"$NULLFRAME", b"$WORLD"];

/// System data that change the meaning of motions; deflex models them itself.
pub(super) const MODELLED_SYSTEM_VARIABLES: [&[u8]; 5] =
    [b"$EX_AX_IGNORE", b"$ASYNC_AXIS", b"$CIRC_TYPE", b"$CIRC_MODE", b"$OV_PRO"];

/// Switches with which BAS corrects a base or a tool by an additional frame; `BAS (#INITMOV,0)` resets them.
pub(super) const CORRECTIONS: [[&[u8]; 2]; 2] =
    [[b"BASE_CORR_ON", b"M_BAS_COR_ON"], [b"TOOL_CORR_ON", b"TOOL_CORR_W_ON"]];

/// Commands of BAS that leave `$APO` as it is.
pub(super) const KEEPS_APPROXIMATION: [&[u8]; 7] =
    [b"BASE", b"TOOL", b"VEL_CP", b"VEL_PTP", b"ACC_CP", b"ACC_PTP", b"OV_PRO"];

/// Commands of BAS that change neither where the robot goes nor its speed along a path.
pub(super) const HARMLESS_COMMANDS: [&[u8]; 9] =
    [b"VEL_PTP", b"ACC_PTP", b"ACC_CP", b"ACC_GLUE", b"VEL_GLUE", b"PTP_DAT", b"OUT_SYNC", b"OUT_ASYNC", b"GROUP"];

/// Functions of inline forms that return a frame of a table, a speed, or the control of the orientation.
pub(super) fn is_frame_function(name: &[u8]) -> bool {
    const CIRCLES: [&[u8]; 2] = [b"SCIRC_TYP", b"SCIRC_M"];
    CIRCLES.contains(&name)
        || matches!(name, b"STOOL" | b"STOOL2" | b"SBASE" | b"SLOAD" | b"SIPO_MODE" | b"SORI_TYP" | b"SVEL_CP")
}
