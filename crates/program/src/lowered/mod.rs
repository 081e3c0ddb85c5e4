//! Programs that `deflex-lang` reads and runs: their motions become targets, and corrected poses become edits of tokens.
//!
//! | file | from | to |
//! |---|---|---|
//! | `targets` | motions of a run | targets, and the places of their numbers |
//! | `rewrite` | wanted poses | edits on number tokens |
//! | `insert` | inserted targets | statements of their own |

mod insert;
mod rewrite;
mod targets;

pub(super) use targets::{Lowering, endless, intern, read};

use super::front_end::{FrontEnd, Wanted, stops_at};
use super::{Passing, Program, Reason, Rewritten};
use crate::orientation::quaternion;
use deflex_lang::dialect::Dialect;
use deflex_lang::ir::{SourceSpan, TokenId};
use deflex_lang::value::Affine;
use deflex_text::Edit;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use std::ops::Range;

/// The properties of a language on which the writing of its numbers depends.
pub(super) struct Style {
    pub(super) dialect: &'static (dyn Dialect + Sync),
    /// Millimetres of its unit of length.
    pub(super) mm: f64,
    /// Number of decimals of millimetres that controllers store, if it is limited; `None` for the number in the options.
    pub(super) position_decimals: Option<usize>,
    /// Number of additional decimals of its unit of length, compared with millimetres.
    pub(super) more_decimals: usize,
    /// Degrees of its unit of angles.
    pub(super) deg: f64,
    /// Least number of decimals of an orientation.
    pub(super) turn_decimals: usize,
    /// A printed number of a pose, by its index, in the controller's precision.
    pub(super) held: fn(usize, f64) -> f64,
    /// The controller's name of the tool that the program does not set; names of tools that it sets begin with it.
    pub(super) tool: &'static str,
    /// The name of the frame of poses.
    pub(crate) frame: &'static str,
    /// The bytes of a motion's text that let the controller pass its target without a stop.
    pub(super) passes: fn(&[u8]) -> Option<Range<usize>>,
    /// The text that replaces them and makes the controller stop at the target.
    pub(super) stops: &'static [u8],
}

impl std::fmt::Debug for Style {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "Style({})", self.tool)
    }
}

/// The places of the numbers of targets.
#[derive(Debug)]
pub(crate) struct Layout {
    style: &'static Style,
    tokens: Vec<SourceSpan>,
    /// One for each target.
    sites: Vec<Option<PoseSource>>,
    /// Groups of targets that are edited together or not at all.
    arcs: Vec<Range<usize>>,
    passings: Vec<Passing>,
    motions: usize,
}

/// The computation of a target's pose from numbers: `left · (pose of the numbers) · right`, lengths in the language's unit.
#[derive(Debug)]
struct PoseSource {
    left: Isometry3<f64>,
    right: Isometry3<f64>,
    own: Isometry3<f64>,
    numbers: [f64; 6],
    /// The token of each number that has one.
    affine: [Option<Affine>; 6],
}

impl Layout {
    fn place(&self, token: TokenId) -> SourceSpan {
        self.tokens[token.0 as usize]
    }

    /// Millimetres and a quaternion of a pose in the language's unit.
    fn millimetres(&self, pose: &Isometry3<f64>) -> ([f64; 3], [f64; 4]) {
        let position = pose.translation.vector * self.style.mm;
        (position.into(), quaternion(&pose.rotation.to_rotation_matrix()))
    }

    /// Position, mm, and orientation of a target in the controller's precision, from its numbers.
    fn held(&self, site: &PoseSource, numbers: [f64; 6]) -> ([f64; 3], [f64; 4]) {
        let held: [f64; 6] = std::array::from_fn(|at| (self.style.held)(at, numbers[at]));
        let own = self.style.dialect.pose(&held).unwrap_or(site.own);
        self.millimetres(&(site.left * own * site.right))
    }

    fn pose(&self, position_mm: [f64; 3], quat: [f64; 4]) -> Isometry3<f64> {
        let [x, y, z] = position_mm.map(|mm| mm / self.style.mm);
        let [w, i, j, k] = quat;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        Isometry3::from_parts(Translation3::new(x, y, z), turn)
    }
}

impl FrontEnd for Layout {
    fn rewrite(&self, program: &Program, wanted: Wanted<'_>) -> Rewritten {
        let mut out = rewrite::rewrite(program, self, wanted);
        for insert in wanted.inserts {
            out.insert(insert.before, insert::statement(program, self, insert, wanted.options));
        }
        out.edits.iter_mut().for_each(|edits| edits.sort_by_key(|edit| edit.span));
        out
    }

    fn passing(&self, _: &Program, target: usize) -> Passing {
        self.passings[target]
    }

    fn passing_edits(&self, program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
        stops_at(program, wanted, self.style.passes, self.style.stops)
    }

    fn insertions_refused(&self, program: &Program, before: &[usize]) -> Vec<Option<Reason>> {
        before.iter().map(|i| insert::refusal(program, self, *i)).collect()
    }

    fn motion_targets(&self, _: &Program) -> usize {
        self.motions
    }
}
