//! What routines change, once that has been found out (see `changes`).

use super::state::Switches;
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::rc::Rc;

type Name = Box<[u8]>;

/// A routine by file, module and place in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct RoutineId {
    pub(super) file: usize,
    pub(super) module: usize,
    pub(super) routine: usize,
}

/// What running some statements, and all that they call, could change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Changes {
    /// Data of modules.
    pub(super) data: BTreeSet<usize>,
    /// The routine's own data and parameters.
    pub(super) own: BTreeSet<Name>,
    /// Names that nothing in the files declares.
    pub(super) foreign: BTreeSet<Name>,
    /// Whatever a routine can that is not in the files.
    pub(super) anything: bool,
    /// What besides data.
    pub(super) switches: Switches,
    /// What of it is switched off: nothing, but where a jump may leave it on.
    pub(super) switches_off: Switches,
}

/// What each routine changes, and what may change at any moment.
#[derive(Default)]
pub(super) struct Known {
    /// By file, module and place: body and handlers, with all that they call.
    pub(super) routines: HashMap<RoutineId, Changes>,
    /// What traps, handlers and synchronised procedures change, and all data that an unknown routine could.
    pub(super) at_any_moment: Changes,
    /// Routines whose motions may run at any moment, or in a function.
    pub(super) aside: BTreeSet<RoutineId>,
    /// Data that a routine that is not in the files could change.
    pub(super) everything: Rc<BTreeSet<usize>>,
    /// By the address of a block.
    pub(super) blocks: RefCell<HashMap<usize, Rc<Changes>>>,
}
