//! Layers: the changes that a branch makes to data and state.

use super::state::ModalState;
use super::symbols::Content;
use super::value::Value;
use std::collections::BTreeMap;

/// The state when a branch began.
pub(super) struct Layer<'a> {
    pub(super) old: BTreeMap<usize, Content<'a>>,
    pub(super) state: ModalState,
    /// Variables that existed then.
    pub(super) variables: usize,
}

/// The state that a branch leaves.
#[derive(Clone, Debug)]
pub(super) struct EndState {
    pub(super) changed: BTreeMap<usize, Value>,
    pub(super) state: ModalState,
}
