//! The state of the ordered pass over the targets.

use super::Shared;
use super::laws::Laws;
use super::mount::Mount;
use super::point::Point;
use deflex_cell::Cell;
use deflex_robot::{External, Joints, StartedFrom};
use deflex_text::Diagnostic;
use nalgebra::Vector3;
use smallvec::SmallVec;
use std::collections::HashMap;
use std::sync::Arc;

/// The state that the ordered pass carries from target to target, and from chunk to chunk of a long program.
pub(super) struct Carried<'a> {
    pub(super) laws: Laws<'a>,
    pub(super) settings: Vec<Mount>,
    /// Indices of `settings` by the origins of tool and work object: programs can have tens of thousands.
    places: HashMap<[u64; 6], SmallVec<[u32; 1]>>,
    pub(super) started: StartedFrom,
    /// Nominal joints of the target before, which choose the branch.
    pub(super) near: Option<Joints>,
    /// What is unknown of the travel of each joint: see [`Arm::unknown_travel`](deflex_equilibrium::Arm::unknown_travel).
    pub(super) unknown_travel: Joints,
    /// The last point of the chunks before.
    pub(super) before: Option<Point>,
    /// Last direction of the TCP's x axis (CL data), kept where the spin rule gives none.
    pub(super) spun: Option<Vector3<f64>>,
    /// Whether the note was given that a cutting force acts on an arm without a stiffness.
    pub(super) unsprung: bool,
    /// The turn about the tool axis, if the program leaves it free.
    pub(super) free: Free,
    /// Number of targets of the chunks before.
    pub(super) done: usize,
    /// Targets that are out of reach while the turn is sought, in rising order.
    pub(super) unreached: Vec<usize>,
    /// Notes about the choice, each once.
    pub(super) notes: Vec<Diagnostic>,
}

/// The turns about the tool axis, and the positions of free external axes, that were chosen along a program.
///
/// # Examples
/// ```
/// use deflex_correct::{ChosenTurns, Options};
///
/// /// The options for a run with turns that were chosen before.
/// fn with_turns(turns: ChosenTurns) -> Options {
///     Options { turns: Some(turns), ..Options::default() }
/// }
/// ```
#[derive(Clone, Debug)]
pub struct ChosenTurns {
    pub(super) chosen: Arc<[Chosen]>,
    /// Notes about the gain.
    pub(super) notes: Vec<Diagnostic>,
}

/// The turn about the tool axis.
#[derive(Clone, Debug, Default)]
pub(super) enum Free {
    /// It is that of the program or of the cell's rule.
    #[default]
    No,
    /// It will be chosen: poses and cuts are computed even if they are out of reach.
    Sought,
    /// It was chosen for each target of the program.
    Chosen(Arc<[Chosen]>),
}

impl<'a> Carried<'a> {
    /// The state before the first target.
    pub(super) fn new(cell: &'a Cell) -> Self {
        Self {
            laws: Laws::new(cell),
            settings: Vec::new(),
            places: HashMap::new(),
            started: StartedFrom::NearestHome,
            near: None,
            unknown_travel: Joints::zeros(),
            before: None,
            spun: None,
            unsprung: false,
            free: Free::No,
            done: 0,
            unreached: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// The state before the first target of a program whose turns may be chosen already.
    pub(super) fn with_turns(cell: &'a Cell, turns: Option<&ChosenTurns>) -> Self {
        let mut carried = Self::new(cell);
        if let Some(ChosenTurns { chosen, notes }) = turns {
            (carried.free, carried.notes) = (Free::Chosen(Arc::clone(chosen)), notes.clone());
        }
        carried
    }

    /// The data to which points refer.
    pub(super) fn shared(&self) -> Arc<Shared> {
        let Laws { laws, fronts, .. } = &self.laws;
        Arc::new(Shared { settings: self.settings.clone(), laws: laws.clone(), fronts: fronts.clone() })
    }

    /// Index of a mount in `settings`, which has each mount once.
    pub(super) fn setting(&mut self, wanted: Mount) -> u32 {
        let alike = self.places.entry(wanted.place()).or_default();
        if let Some(known) = alike.iter().find(|known| self.settings[**known as usize] == wanted) {
            return *known;
        }
        // Programs number their tools and work objects by u16.
        let index = self.settings.len() as u32;
        alike.push(index);
        self.settings.push(wanted);
        index
    }
}

/// The choice at a target.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    /// Turn about the tool axis, rad, see [`turned`](super::spin::turned); `None` if it stays as in the program.
    pub(super) turn: Option<f64>,
    /// Motor angles nearby, which choose branch and whole turns, rad.
    pub(super) near: Joints,
    /// Positions of the external axes, mm or degrees; NaN for one that stays as in the program.
    pub(super) external: Option<Arc<External>>,
}

/// Setting and tool of a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SettingAndTool {
    /// Index of its setting.
    pub(super) setting: u32,
    /// Index of its tool among the [`Laws`].
    pub(super) tool: usize,
}
