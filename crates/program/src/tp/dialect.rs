//! Finds the software that wrote a program, from its head and its first remarks.

use deflex_text::Source;
use std::ops::Range;

/// Number of bytes after the attributes that are searched, because generators name themselves in the first remark.
const SEARCHED: usize = 1024;

/// Texts in lower case and the software that they identify; the first one that is found counts.
const SIGNS: [(&str, &str); 10] = [
    ("robodk", "robodk"),
    ("robotmaster", "robotmaster"),
    ("mastercam", "mastercam"),
    ("powermill", "powermill"),
    ("sprutcam", "sprutcam"),
    ("octopuz", "octopuz"),
    ("delfoi", "delfoi"),
    ("robots for", "robots"),
    ("grasshopper", "grasshopper"),
    ("posted by deflex", "deflex"),
];

/// The software that wrote a program: `fanuc` if it has the attributes that a controller prints, `ls` if it is unknown.
pub(super) fn of(source: &Source, head: Range<usize>) -> &'static str {
    let end = source.bytes.len().min(head.end + SEARCHED);
    let text = source.bytes[head.start.min(end)..end].to_ascii_lowercase();
    let contains = |sign: &str| memchr::memmem::find(&text, sign.as_bytes()).is_some();
    match SIGNS.iter().find(|(sign, _)| contains(sign)) {
        Some((_, maker)) => maker,
        // A controller computes both from the stored program.
        None if contains("memory_size") || contains("speichergr") => "fanuc",
        None => "ls",
    }
}
