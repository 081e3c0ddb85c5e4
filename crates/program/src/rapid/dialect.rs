//! Finds the system that wrote a program, from its comments and names.

use deflex_text::Source;

/// Bytes of each file that are examined: its header is at the start.
const HEAD: usize = 4096;

/// Texts in lower case, and the system that writes them; the first one that is found counts.
const SIGNS: [(&str, &str); 19] = [
    ("robodk", "robodk"),
    ("robotmaster", "robotmaster"),
    ("mastercam", "mastercam"),
    ("powermill", "powermill"),
    ("sprutcam", "sprutcam"),
    ("encycam", "sprutcam"),
    ("robotcomponents", "robotcomponents"),
    ("robot components", "robotcomponents"),
    ("visose", "robots"),
    ("robots-grasshopper", "robots"),
    ("grasshopper", "grasshopper"),
    ("hal robotics", "hal"),
    ("autodesk", "autodesk"),
    ("fusion 360", "autodesk"),
    ("compas_rrc", "compas_rrc"),
    ("machina", "machina"),
    ("kuka|prc", "taco"),
    ("robotstudio", "robotstudio"),
    ("delfoi", "delfoi"),
];

/// The system that wrote a program; `rapid` if it is unknown.
pub(super) fn of(sources: &[Source]) -> &'static str {
    for source in sources {
        let head = &source.bytes[..source.bytes.len().min(HEAD)];
        let head = head.to_ascii_lowercase();
        let found = SIGNS.iter().find(|(sign, _)| contains(&head, sign.as_bytes()));
        if let Some((_, maker)) = found {
            return maker;
        }
        // RobotStudio's own template for a new module, and what its path generator names things.
        if contains(&head, b"! description:") && contains(&head, b"! insert description here")
            || contains(&head, b"target_10:=") && contains(&head, b"wobj0")
        {
            return "robotstudio";
        }
        // Robots (visose) declares its speeds and zones by these names.
        if contains(&head, b"default_speed") || contains(&head, b"speed000") && contains(&head, b"zone000") {
            return "robots";
        }
    }
    "rapid"
}

fn contains(text: &[u8], sign: &[u8]) -> bool {
    memchr::memmem::find(text, sign).is_some()
}
