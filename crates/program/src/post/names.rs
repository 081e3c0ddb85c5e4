//! Identifiers, predefined names, and the check whether a language has a place for the names of the cell.

use super::plan::PostPlan;
use crate::Language;
use crate::rapid::SPEEDS;
use deflex_text::Diagnostic;

/// Longest RAPID identifier.
const LONGEST: usize = 32;

/// Words that cannot be a module's name, in upper case, and `MAIN`, which is the program's entry.
const TAKEN: [&str; 75] = [
    "ALIAS", "AND", "BACKWARD", "CASE", "CONNECT", "CONST", "DEFAULT", "DIV", "DO", "ELSE", "ELSEIF", "ENDFOR",
    "ENDFUNC", "ENDIF", "ENDMODULE", "ENDPROC", "ENDRECORD", "ENDTEST", "ENDTRAP", "ENDWHILE", "ERROR", "EXIT",
    "FALSE", "FOR", "FROM", "FUNC", "GOTO", "IF", "INOUT", "LOCAL", "MOD", "MODULE", "NOSTEPIN", "NOT", "NOVIEW", "OR",
    "PERS", "PROC", "RAISE", "READONLY", "RECORD", "RETRY", "RETURN", "STEP", "SYSMODULE", "TASK", "TEST", "THEN",
    "TO", "TRAP", "TRUE", "TRYNEXT", "UNDO", "VAR", "VIEWONLY", "WHILE", "WITH", "XOR", "MAIN", "BASE", "USER", "BOOL",
    "NUM", "STRING", "POS", "ORIENT", "POSE", "CONFDATA", "ROBTARGET", "TOOLDATA", "WOBJDATA", "SPEEDDATA", "ZONEDATA",
    "TOOL0", "WOBJ0",
];

/// A valid RAPID identifier made of `name`, leaving `reserve` characters for an ending.
#[must_use]
pub(crate) fn identifier(name: &str, reserve: usize) -> String {
    let mut out: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if !out.starts_with(|c: char| c.is_ascii_alphabetic()) || TAKEN.contains(&out.to_ascii_uppercase().as_str()) {
        out.insert_str(0, "m_");
    }
    out.truncate(LONGEST.saturating_sub(reserve).max(1));
    out
}

/// Number of a tool (`UT 1`) or a work object (`UF 1`) by which some languages know it.
pub(super) fn number(name: &str, prefix: &str) -> Option<u32> {
    name.to_ascii_uppercase().strip_prefix(prefix)?.trim().parse().ok()
}

/// Refuses names that the posted program cannot have. RAPID declares tools and work objects under these names; TP and INFORM have numbers for
/// both. KRL writes the frames themselves if a name is no entry of its tables.
///
/// # Errors
/// Every tool and work object whose name does not fit.
#[doc(hidden)]
pub fn refuse(plan: &PostPlan, language: Language) -> Result<(), Vec<Diagnostic>> {
    let about = language.about();
    let [tool, wobj] = about.prefixes.unwrap_or_default().map(str::trim_end);
    let fits = |name: &str, prefix: &str, predefined: &str| {
        let is_predefined = name.eq_ignore_ascii_case(predefined);
        if about.are_names_numbers {
            number(name, prefix).is_some() || is_predefined
        } else {
            language != Language::Rapid || is_predefined || identifier(name, 0) == name
        }
    };
    let expected = |prefix: &str| {
        let known = language.name();
        if about.are_names_numbers {
            format!("a {known} program has only a number for it: expected a name like `{prefix} 1`")
        } else {
            format!("{known} cannot declare it: expected a letter, then letters, digits and _, at most {LONGEST}")
        }
    };
    let refused = |what: &str, prefix: &str, name: &str| {
        let help =
            "rename it in the cell and where it is used ([cl], [plan]), or post for the controller that has this name";
        Diagnostic::error("post.name", "", format!("{what} `{name}`: {}", expected(prefix))).help(help)
    };
    let [no_tool, base] =
        if about.are_names_numbers { ["", language.robot_base().unwrap_or_default()] } else { ["tool0", "wobj0"] };
    let tools = plan.tools.iter().filter(|(name, _)| !fits(name, tool, no_tool));
    let wobjs = plan.wobjs.iter().filter(|(name, _)| !fits(name, wobj, base));
    let tools = tools.map(|(name, _)| refused("tool", tool, name));
    let all: Vec<Diagnostic> = tools.chain(wobjs.map(|(name, _)| refused("work object", wobj, name))).collect();
    if all.is_empty() { Ok(()) } else { Err(all) }
}

/// Speeds that differ by less than this are equal, mm/s: half of the last of four printed decimals.
pub(super) const SAME_SPEED: f64 = 0.5e-4;

/// The predefined speed that prints as `mm_s`.
pub(super) fn predefined_speed(mm_s: f64) -> Option<u32> {
    SPEEDS.into_iter().find(|&v| (f64::from(v) - mm_s).abs() < SAME_SPEED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_file_name_becomes_an_identifier() {
        for (name, expected) in
            [("part", "part"), ("12-öse", "m_12__se"), ("Main", "m_Main"), ("", "m_"), ("a.b", "a_b")]
        {
            assert_eq!(identifier(name, 0), expected);
        }
        assert_eq!(identifier(&"x".repeat(40), 4).len(), 28);
    }

    #[test]
    fn there_is_no_v25() {
        assert_eq!(predefined_speed(25.0), None);
        assert_eq!(predefined_speed(50.000_01), Some(50));
    }
}
