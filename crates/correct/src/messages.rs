//! Messages of a long run, in which a wrong cell may fail at every target.

use super::along::WayFinding;
use deflex_program::Program;
use deflex_text::Diagnostic;

/// The first messages, and the number of all.
///
/// # Examples
/// ```
/// use deflex_correct::Messages;
///
/// assert!(Messages::default().is_empty() && Messages::default().all().is_empty()); // none yet
/// ```
#[derive(Clone, Debug)]
pub struct Messages {
    first: Vec<Diagnostic>,
    count: usize,
    most: usize,
}

impl Default for Messages {
    fn default() -> Self {
        /// Further messages are only counted, because a user does not read more.
        const MOST_SHOWN: usize = 1000;
        Self::with_room(MOST_SHOWN)
    }
}

impl Messages {
    /// An empty list; messages beyond `most` will only be counted.
    #[must_use]
    #[doc(hidden)]
    pub fn with_room(most: usize) -> Self {
        Self { first: Vec::new(), count: 0, most }
    }

    /// Adds messages.
    #[doc(hidden)]
    pub fn add(&mut self, messages: Vec<Diagnostic>) {
        self.count += messages.len();
        let room = self.most - self.first.len();
        self.first.extend(messages.into_iter().take(room));
    }

    /// Adds messages that are not in the list yet: an undeclared name is missing in every chunk.
    pub(super) fn add_once(&mut self, mut messages: Vec<Diagnostic>) {
        let is_known = |new: &Diagnostic| self.first.iter().any(|old| old.message == new.message);
        messages.retain(|new| !(new.code.starts_with("cell.unknown-") && is_known(new)));
        self.add(messages);
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The first messages, and the number of the others.
    #[must_use]
    #[doc(hidden)]
    pub fn into_parts(self) -> (Vec<Diagnostic>, usize) {
        let more = self.count - self.first.len();
        (self.first, more)
    }

    /// The first messages, and one more with the number of the others.
    #[must_use]
    pub fn all(mut self) -> Vec<Diagnostic> {
        let more = self.count - self.first.len();
        if more > 0 {
            let more = format!("{more} more targets have messages like these");
            self.first.push(Diagnostic::error("target.more", "", more));
        }
        self.first
    }
}

/// Warnings with the same words for many targets: each is given once, for the first target, with the number of the others.
#[derive(Clone, Debug, Default)]
pub(super) struct Repeated(Vec<(Diagnostic, usize)>);

impl Repeated {
    /// Adds a warning.
    pub(super) fn add(&mut self, warning: Diagnostic) {
        self.add_often(warning, 1);
    }

    fn add_often(&mut self, warning: Diagnostic, count: usize) {
        match self.0.iter_mut().find(|(known, _)| known.code == warning.code && known.message == warning.message) {
            Some((_, known)) => *known += count,
            None => self.0.push((warning, count)),
        }
    }

    /// Adds the findings on segments.
    pub(super) fn add_of_segments(&mut self, program: &Program, found: &[WayFinding]) {
        found.iter().for_each(|found| self.add(found.warning(program)));
    }

    /// Adds the warnings of later targets.
    pub(super) fn append(&mut self, later: Self) {
        later.0.into_iter().for_each(|(warning, count)| self.add_often(warning, count));
    }

    /// The warnings in the order of their first targets, which is the same for a program in chunks and as a whole.
    pub(super) fn once(self) -> impl Iterator<Item = Diagnostic> {
        let mut all = self.0;
        all.sort_by(|(a, _), (b, _)| (&a.file, a.line, a.column).cmp(&(&b.file, b.line, b.column)));
        all.into_iter().map(|(warning, count)| match count {
            1 => warning,
            _ => Diagnostic { message: format!("{} ({count} targets)", warning.message), ..warning },
        })
    }
}
