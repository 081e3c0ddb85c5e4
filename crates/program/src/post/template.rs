//! Lines of a posted program that call the cell's own routines (`[cl.post]`).

use crate::{ActionKind, Language};
use std::collections::BTreeMap;

/// Every key of `[cl.post]`, with the names that its braces may have.
#[doc(hidden)]
pub const TEMPLATES: [(&str, &[&str]); 8] = [
    ("tool_change", &["number", "tool"]),
    ("spindle_on", &["rpm", "direction"]),
    ("spindle_off", &[]),
    ("coolant_on", &["kind"]),
    ("coolant_off", &[]),
    ("stop", &[]),
    ("optional_stop", &[]),
    ("home", &[]),
];

/// Lines for actions of CL data that RAPID has no instruction for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[doc(hidden)]
pub struct Templates(BTreeMap<&'static str, String>);

impl Templates {
    /// Adds a template that [`Templates::fault`] has checked.
    pub fn insert(&mut self, key: &'static str, text: String) {
        self.0.insert(key, text);
    }

    /// What is wrong with a template, if anything.
    pub fn fault(key: &str, text: &str) -> Option<String> {
        let allowed = TEMPLATES.iter().find(|(known, _)| *known == key).map_or(&[][..], |(_, names)| names);
        if text.trim().is_empty() {
            return Some("the template is empty: to write nothing there, remove its key".to_owned());
        }
        if !text.chars().all(|c| c == '\n' || c == ' ' || c.is_ascii_graphic()) {
            return Some("a template is of printable ASCII characters".to_owned());
        }
        if text.contains('%') || text.to_ascii_uppercase().split(|c: char| !c.is_ascii_alphanumeric()).any(closes) {
            return Some("a template is a line of instructions, within a procedure".to_owned());
        }
        for (at, _) in text.match_indices('{') {
            let name = text[at + 1..].split('}').next().unwrap_or_default();
            if !allowed.contains(&name) {
                let names = allowed.iter().map(|name| format!("{{{name}}}")).collect::<Vec<_>>().join(", ");
                let may =
                    if names.is_empty() { "nothing is filled in here".to_owned() } else { format!("expected {names}") };
                return Some(format!("`{{{name}}}` is not known: {may}"));
            }
        }
        None
    }

    /// Whether an action is written.
    pub fn has(&self, kind: &ActionKind) -> bool {
        kind.template().is_none_or(|key| self.0.contains_key(key))
    }

    /// Whether a template has a name in braces.
    pub fn fills(&self, key: &str, name: &str) -> bool {
        self.0.get(key).is_some_and(|text| text.contains(&format!("{{{name}}}")))
    }

    /// Lines of an action, without their indentation; `None` if it has no template, or lacks a value that the template needs.
    pub fn lines(&self, kind: &ActionKind, tool: &str, language: Language) -> Option<String> {
        if let ActionKind::Dwell { seconds } = kind {
            return Some((language.about().post.dwell)(*seconds));
        }
        let text = self.0.get(kind.template()?)?;
        Some(match kind {
            ActionKind::ToolChange { number } => text.replace("{number}", number).replace("{tool}", tool),
            ActionKind::SpindleOn { rpm: None, .. } if text.contains("{rpm}") => return None,
            ActionKind::SpindleOn { rpm, clockwise } => text
                .replace("{rpm}", &rpm.map_or_else(String::new, decimal))
                .replace("{direction}", if *clockwise { "CLW" } else { "CCLW" }),
            ActionKind::CoolantOn { kind } => text.replace("{kind}", kind),
            _ => text.clone(),
        })
    }
}

/// Words that would end the procedure, or the module.
fn closes(word: &str) -> bool {
    matches!(word, "ENDPROC" | "ENDMODULE" | "PROC" | "MODULE" | "FUNC" | "TRAP")
}

/// A number without superfluous zeros.
pub(super) fn decimal(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_named() {
        assert_eq!(Templates::fault("tool_change", "rTool {number}, {tool};"), None);
        assert_eq!(Templates::fault("home", "rHome;"), None);
        assert!(Templates::fault("spindle_on", "rSpindle {number};").unwrap().contains("{rpm}, {direction}"));
        assert!(Templates::fault("stop", "{rpm};").unwrap().contains("nothing"));
        assert!(Templates::fault("stop", " ").is_some());
        assert!(Templates::fault("stop", "Stop; ENDPROC").is_some());
    }

    #[test]
    fn numbers_are_filled_in_as_people_write_them() {
        let mut templates = Templates::default();
        templates.insert("spindle_on", "rSpindle {rpm};".to_owned());
        let on = |rpm| ActionKind::SpindleOn { rpm, clockwise: true };
        assert_eq!(templates.lines(&on(Some(9000.0)), "", Language::Rapid).as_deref(), Some("rSpindle 9000;"));
        assert_eq!(templates.lines(&on(Some(0.5)), "", Language::Rapid).as_deref(), Some("rSpindle 0.5;"));
        assert_eq!(templates.lines(&on(None), "", Language::Rapid), None);
        assert_eq!(
            templates.lines(&ActionKind::Dwell { seconds: 2.5 }, "", Language::Rapid).as_deref(),
            Some("WaitTime 2.5;")
        );
        assert_eq!(templates.lines(&ActionKind::Stop, "", Language::Rapid), None);
    }
}
