//! The meaning of each kind of line, read once for all chunks that contain it.

use super::index::{hash, is_word};
use crate::{Target, Tool, Wobj};
use std::collections::HashMap;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Most kinds of lines that are remembered over all chunks.
const MOST_KINDS: usize = 256;

/// The motion on a line, without its target; `None` if the line moves nothing.
pub(super) type Meaning = Option<Motion>;

/// What all motions of one kind have in common.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// One of these motions, with the tool and work object below.
    pub(super) like: Target,
    pub(super) tool: Tool,
    pub(super) wobj: Wobj,
}

/// The kinds of lines that the chunks of a program have met so far.
#[derive(Debug, Default)]
pub(super) struct Kinds {
    /// By the text of their lines.
    known: Mutex<HashMap<Vec<u8>, Meaning>>,
    words: OnceLock<Vec<u64>>,
}

impl Kinds {
    /// The meaning of a line of this kind; calls `read` if no earlier chunk has met the kind.
    pub(super) fn meaning(&self, kind: Vec<u8>, read: impl FnOnce() -> Option<Meaning>) -> Option<Meaning> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(meaning) = known.get(&kind) {
            return Some(meaning.clone());
        }
        let meaning = read()?;
        if known.len() == MOST_KINDS {
            known.clear();
        }
        known.insert(kind, meaning.clone());
        Some(meaning)
    }

    /// Hashes of the words in the program's head, which all chunks repeat.
    pub(super) fn words_of_head(&self, head: impl FnOnce() -> Vec<u8>) -> &[u64] {
        self.words.get_or_init(|| words(&head()).collect())
    }
}

/// Hashes of the words in a text.
pub(super) fn words(text: &[u8]) -> impl Iterator<Item = u64> {
    text.split(|b| !is_word(*b)).filter(|word| !word.is_empty()).map(hash)
}
