//! The data and states that routines change, as found by `changes`.

use super::lasting::LastingStates;
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::rc::Rc;

type Name = Box<[u8]>;

/// A routine by file, module and index in the module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct RoutineId {
    pub(super) file: usize,
    pub(super) module: usize,
    pub(super) routine: usize,
}

/// Everything that some statements, with all that they call, could change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Changes {
    /// Data of modules.
    pub(super) data: BTreeSet<usize>,
    /// The routine's own data and parameters.
    pub(super) own: BTreeSet<Name>,
    /// Names that nothing in the files declares.
    pub(super) foreign: BTreeSet<Name>,
    /// Everything that a routine outside the files could change.
    pub(super) anything: bool,
    /// Lasting states, in addition to data, that they may change.
    pub(super) states: LastingStates,
    /// The lasting states that their instructions set, without those that a routine outside the files could set.
    pub(super) sets: LastingStates,
    /// The cycle may end in them.
    pub(super) end_cycle: bool,
}

/// The changes of each routine, and those that may happen at any moment.
#[derive(Default)]
pub(super) struct Known {
    /// Changes by body and handlers of each routine, with all that they call.
    pub(super) routines: HashMap<RoutineId, Changes>,
    /// Changes by traps, handlers and synchronised procedures, and all data that an unknown routine could change.
    pub(super) at_any_moment: Changes,
    /// Routines whose motions may run at any moment, or in a function.
    pub(super) unfollowed: BTreeSet<RoutineId>,
    /// Data that a routine outside the files could change.
    pub(super) everything: Rc<BTreeSet<usize>>,
    /// By the address of a block.
    pub(super) blocks: RefCell<HashMap<usize, Rc<Changes>>>,
}
