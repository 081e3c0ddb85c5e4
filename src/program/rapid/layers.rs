//! What branches change and leave.

use super::state::ModalState;
use super::symbols::Content;
use super::value::Value;
use std::collections::BTreeMap;

/// What was there when a branch began.
pub(super) struct Layer {
    pub(super) old: BTreeMap<usize, Content>,
    pub(super) state: ModalState,
    /// Variables that existed then.
    pub(super) variables: usize,
}

/// What a branch left.
#[derive(Clone, Debug)]
pub(super) struct Left {
    pub(super) changed: BTreeMap<usize, Value>,
    pub(super) state: ModalState,
}
