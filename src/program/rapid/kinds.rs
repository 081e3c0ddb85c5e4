//! What lines of a kind mean: read once, whatever number of chunks has them.

use super::index::{hash, is_word};
use crate::program::{Target, Tool, Wobj};
use std::collections::HashMap;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Most kinds of lines that are remembered, of all chunks together.
const MOST_KINDS: usize = 256;

/// The motion that a line is, but for its target; `None` where it moves nothing.
pub(super) type Meaning = Option<Motion>;

/// What all motions of a kind have.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Of any of them: its tool and its work object are those below.
    pub(super) like: Target,
    pub(super) tool: Tool,
    pub(super) wobj: Wobj,
}

/// What the chunks of a program have met so far.
#[derive(Debug, Default)]
pub(super) struct Kinds {
    /// By the text of their lines.
    known: Mutex<HashMap<Vec<u8>, Meaning>>,
    words: OnceLock<Vec<u64>>,
}

impl Kinds {
    /// What a line of this kind means; `read` tells where no chunk before has met one.
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

    /// Hashes of the words of the program's head, which is the same text in all its chunks.
    pub(super) fn words_of_head(&self, head: impl FnOnce() -> Vec<u8>) -> &[u64] {
        self.words.get_or_init(|| words(&head()).collect())
    }
}

/// Hashes of the words of a text.
pub(super) fn words(text: &[u8]) -> impl Iterator<Item = u64> {
    text.split(|b| !is_word(*b)).filter(|word| !word.is_empty()).map(hash)
}
