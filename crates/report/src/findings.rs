//! The findings of a program, limited to a number that can be read.

use deflex_text::Diagnostic;

/// The findings of one program, by line. The first [`Findings::MOST`] are kept, the others only counted: the report has a row for every
/// target.
#[derive(Clone, Debug, Default)]
#[doc(hidden)]
pub struct Findings {
    first: Vec<Diagnostic>,
    count: usize,
}

impl Findings {
    /// The largest number of findings that are kept.
    pub const MOST: usize = 10_000;

    /// Adds findings. All findings about a target have to come in one call.
    pub fn add(&mut self, mut found: Vec<Diagnostic>) {
        sort(&mut found);
        // A correction and a prediction fail at the same targets.
        found.dedup();
        self.count += found.len();
        self.first.extend(found);
        if self.first.len() > 2 * Self::MOST {
            self.settle();
        }
    }

    fn settle(&mut self) {
        sort(&mut self.first);
        self.first.truncate(Self::MOST);
    }

    /// The findings that are kept, sorted by file, line and column, and the number of all others.
    #[must_use]
    pub fn into_parts(mut self) -> (Vec<Diagnostic>, usize) {
        self.settle();
        let more = self.count - self.first.len();
        (self.first, more)
    }
}

fn sort(findings: &mut [Diagnostic]) {
    findings.sort_by(|a, b| (&a.file, a.line, a.column).cmp(&(&b.file, b.line, b.column)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_first_by_place_are_held_in_whatever_order_they_come(turn in 0..5_usize, chunks in 1..40_usize) {
            let each = Findings::MOST / 8;
            let found = |chunk: usize| (0..each).map(move |i| {
                let mut finding = Diagnostic::error("check.max-error", "a.mod", "off");
                finding.line = chunk * each + i;
                finding
            });
            let mut findings = Findings::default();
            for i in 0..chunks {
                // Everything is found twice.
                findings.add((0..2).flat_map(|_| found((i + turn) % chunks)).collect());
            }
            let (first, more) = findings.into_parts();
            let lines: Vec<usize> = first.iter().map(|finding| finding.line).collect();
            prop_assert_eq!(&lines, &(0..Findings::MOST.min(chunks * each)).collect::<Vec<_>>());
            prop_assert_eq!(more, chunks * each - lines.len());
        }
    }
}
