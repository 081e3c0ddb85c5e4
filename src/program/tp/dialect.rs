//! Who made a program, by what its makers write into its head and its first remarks.

use crate::text::Source;
use std::ops::Range;

/// Bytes after the attributes that are looked at: generators sign with their first remark.
const BEHIND: usize = 1024;

/// Signs in lower case and the maker that they mean; the first that is found counts.
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

/// The maker of a program: `fanuc` where it has the attributes that a controller prints, `ls` where nothing tells.
pub(super) fn of(source: &Source, head: Range<usize>) -> &'static str {
    let end = source.bytes.len().min(head.end + BEHIND);
    let text = source.bytes[head.start.min(end)..end].to_ascii_lowercase();
    let contains = |sign: &str| memchr::memmem::find(&text, sign.as_bytes()).is_some();
    match SIGNS.iter().find(|(sign, _)| contains(sign)) {
        Some((_, maker)) => maker,
        // Both are what a controller works out from the stored program.
        None if contains("memory_size") || contains("speichergr") => "fanuc",
        None => "ls",
    }
}
