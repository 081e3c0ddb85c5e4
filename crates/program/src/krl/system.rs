//! The only list of KUKA's own routines, with the data that each may change and that affect where the tool goes.
//!
//! Sources: KUKA System Software 8, *Operating and Programming Instructions for System Integrators* and *CREAD/CWRITE*, for the functions
//! of the language; the manuals of KUKA.EthernetKRL (`EKI_…`), KUKA.GripperTech and SpotTech (`H50`, `USER_GRP`, `USERSPOT`, `GRPg_…`),
//! KUKA.ArcTech (`A10`, `A20`, `ArcMainNG`) and KUKA.TouchSense (`H70`); and the text of the controller's own files (`System/bas.src`,
//! `ir_stopm.src`, `collmonlib.src`, `MsgLib.src`, `tm_bib.src`, `TP/p00.src`), read in four backups of KSS 8.2 to 8.7: their own
//! assignments and those of the routines that they call. A routine that is not listed may change anything. `docs/soundness.md` repeats
//! these lists. If the files of the program contain a routine of this name, that one is followed instead.

use super::names;

/// What a routine may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum System {
    /// Neither data of a program nor data that affect where the tool goes.
    Nothing,
    /// Only the variables in its arguments.
    Arguments,
    /// Only these data.
    Data(&'static [&'static str]),
    /// `H70`: nothing if it starts a search (`H70 (1, …)`) or runs as the handler of that search; otherwise the frames by which `BAS`
    /// corrects base and tool.
    TouchSense,
}

/// Functions and procedures that change nothing: of the language, of messages, of collision and torque monitoring, of grippers and guns.
pub(super) const NOTHING: &[&str] = &[
    "ABS", "ACOS", "ASIN", "ATAN2", "CLEAR_KRLMSG", "COLLDETECT_USERACTION", "COS", "EB", "EK", "ERR_CLEAR",
    "ERR_RAISE", "EXISTS_KRLDLG", "EXISTS_KRLMSG", "EXP", "GETSYSSTATE", "GET_AXESMASK", "GET_MSGBUFFER", "GRPG_CHECK",
    "GRPG_CHECKWITHTIMEOUT", "GRPG_MONINTOCC", "GRPG_MONINTONOFF", "GRPG_SETMON", "GRPG_SYNCHECK", "H50", "INV_POS",
    "IS_KEY_PRESSED", "K_ADDR", "K_NAME", "K_OFFS", "K_ROOT", "K_SHIFT", "K_TYPE", "LK", "LK_OFFS", "LOG", "MAX",
    "MBX_REC", "MD_CMD", "MD_GETSTATE", "MD_SETSTATE", "MIN", "MSGLOOP", "MSGNOTIFY", "MSGNOTIFYTEXTPAR", "MSGQUIT",
    "MSGQUITTEXTPAR", "MSGSTATE", "RESET_CD_PARAMS", "RESET_CM_MAX", "ROUND", "SACC_CP", "SACC_JOINT", "SACC_PTP",
    "SAPO", "SAPO_PTP", "SET_CD_PARAMS", "SET_CM_PRO_DEFAULT", "SET_CM_PRO_INACTIVE", "SET_CM_PRO_VALUES",
    "SET_KRLDLG", "SET_KRLMSG", "SET_TQ_VALUES", "SGEAR_JERK", "SIN", "SJERK", "SQRT", "STRCOMP", "STRDECLLEN",
    "STRFIND", "STRLEN", "SVEL_JOINT", "SVEL_PTP", "SYNC", "S_EXAX_IGN", "S_EXAX_IGN2", "TAN", "TM_USERACTION",
    "TORQUEDEFINITIONS", "TORQUE_MONITORING", "TQM_CHANGE_OFFSETS", "TQM_FIFO_READ", "TQM_INTER_STOP", "TQM_MON_OFF",
    "TQM_MON_ON", "TQM_START_MON", "TQM_SWAP_VALUES", "TQM_SWAP_VALUES_S", "TRUNC", "USERSPOT", "USER_GRP",
    "USE_CD_PARAMS", "USE_CM_PRO_SETTING", "USE_CM_PRO_VALUES", "VARSTATE", "VARTYPE", "WSPACEGIVE", "WSPACETAKE",
];

/// Routines that change the variables in their arguments: of texts, channels, kinematics and KUKA.EthernetKRL.
pub(super) const ARGUMENTS: &[&str] = &[
    "CAST_FROM", "CAST_TO", "CCLOSE", "CIOCTL", "COPEN", "CREAD", "CWRITE", "EKI_CHECKBUFFER", "EKI_CLEAR",
    "EKI_CLEARBUFFER", "EKI_CLOSE", "EKI_GETBOOL", "EKI_GETBOOLARRAY", "EKI_GETFRAME", "EKI_GETFRAMEARRAY",
    "EKI_GETINT", "EKI_GETINTARRAY", "EKI_GETREAL", "EKI_GETREALARRAY", "EKI_GETSTRING", "EKI_INIT", "EKI_LOCK",
    "EKI_OPEN", "EKI_SEND", "EKI_SETBOOL", "EKI_SETFRAME", "EKI_SETINT", "EKI_SETREAL", "EKI_SETSTRING", "EKI_UNLOCK",
    "FORWARD", "INVERSE", "MSGDIALOG", "SREAD", "STRADD", "STRCLEAR", "STRCOPY", "SWRITE",
];

/// Routines that change these data of their own, or the speed of a weld.
pub(super) const DATA: &[(&str, &[&str])] = &[
    ("A10", &["$VEL"]),
    ("A20", &["$VEL"]),
    ("ARCMAINNG", &["$VEL"]),
    ("GRPG_SETSTATE", &["$LOAD", "LOAD_DATA"]),
    ("GRPG_SETSTATEANDCHECK", &["$LOAD", "LOAD_DATA"]),
    ("IR_STOPM", &["PGNO", "PGNO_ERROR", "POWER", "STOPM_FLAG"]),
    ("P00", &["PGNO", "PGNO_ERROR"]),
];

/// The changes of a routine that is in no file, by its name in upper case; `None` if the routine is not known.
pub(super) fn system(name: &[u8]) -> Option<System> {
    let has = |list: &[&str]| list.binary_search_by(|known| known.as_bytes().cmp(name)).is_ok();
    if has(NOTHING) {
        return Some(System::Nothing);
    }
    if has(ARGUMENTS) {
        return Some(System::Arguments);
    }
    if name == b"H70" {
        return Some(System::TouchSense);
    }
    DATA.iter().find(|(known, _)| known.as_bytes() == name).map(|(_, data)| System::Data(data))
}

/// What the call of a routine of this name may change.
pub(crate) enum Called {
    Nothing,
    Data(&'static [&'static str]),
    /// The variables in its arguments, and what a routine in the files changes.
    Arguments,
}

/// The changes of a call, or of a word of the language before a bracket.
pub(crate) fn changes(name: &[u8]) -> Called {
    const WORDS: [&[u8]; 9] = [b"BAS", b"IF", b"WHILE", b"UNTIL", b"SWITCH", b"RETURN", b"PTP", b"LIN", b"CIRC"];
    if WORDS.contains(&name) || names::NO_CALLS.contains(&name) || names::is_frame_function(name) {
        return Called::Nothing;
    }
    match system(name) {
        Some(System::Nothing) => Called::Nothing,
        Some(System::Data(data)) => Called::Data(data),
        Some(System::Arguments | System::TouchSense) | None => Called::Arguments,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_sorted_and_the_page_on_soundness_has_them() {
        let page = include_str!("../../../../docs/soundness.md");
        for (title, list) in [
            ("KUKA routines that change nothing", NOTHING),
            ("KUKA routines that change only what they are given", ARGUMENTS),
        ] {
            assert!(list.is_sorted(), "{title}");
            let section = page.split(&format!("### {title}\n")).nth(1).unwrap_or_else(|| panic!("no section {title}"));
            let section = section.split("\n#").next().unwrap();
            let names: Vec<&str> = section.split('`').skip(1).step_by(2).collect();
            assert_eq!(names, list, "{title}");
        }
        for (name, data) in DATA {
            assert!([&[*name], *data].concat().iter().all(|name| page.contains(&format!("`{name}`"))), "{name}");
        }
    }
}
