//! FANUC TP, as controllers print their programs (`.ls`).
//!
//! A program is statements (`/MN`) and positions (`/POS`). A position has a number, and is relative to the user frame and the tool with
//! which it was recorded, or that are selected when the motion runs. Registers (`R[…]`), the selected frames and the values of frames
//! belong to the controller: any program may change them. The lowering therefore represents a called program by the possible effects of it
//! and of all programs that it calls, in any order. A register is known if the program has set it to a whole number: the controller stores
//! real numbers in single precision, so that deflex cannot know whether two of them are equal.
//!
//! Source: FANUC, *R-30iB Operator's Manual (Basic Operation)*.

mod calls;
mod code;
mod effects;
mod expression;
#[doc(hidden)]
pub mod lex;
pub mod lines;
mod lower;
mod motion;
mod statement;

use crate::dialect::{Arguments, Dialect};
use crate::inform::Inform;
use crate::ir::{Slot, Switch};
use crate::reason::Reason;
use crate::store::Store;
use crate::value::{Content, Value, is_whole};
use nalgebra::Isometry3;
use std::ops::Range;

pub use code::Code;
pub use effects::Calls;
pub use expression::count;
pub use lower::{Held, lower};
pub use motion::{Lasting, Motion, Point, Speed, lasting};
pub use statement::{Frame, NamedPosition, StatementKind, kind, positions_named, runs};

/// Numbers of the routines to which programs are lowered.
mod builtin {
    /// The whole part of a quotient of whole numbers.
    pub(super) const QUOTIENT: u16 = 0;
    /// The value of a register, by its number.
    pub(super) const REGISTER: u16 = 1;
    /// Sets a register, by its number.
    pub(super) const SET: u16 = 2;
    /// Selects a user frame or a tool, by its number.
    pub(super) const SELECT: [u16; 2] = [3, 4];
    /// Records that a user frame or a tool, by its number, has other values from here on.
    pub(super) const REDEFINE: [u16; 2] = [5, 6];
    /// Records that a program runs in parallel from here on.
    pub(super) const CONCURRENT: u16 = 7;
    /// Records that another program may have moved the arm.
    pub(super) const ELSEWHERE: u16 = 8;
    /// A position, by its number, with the frames whose values a program has set.
    pub(super) const POSITION: u16 = 9;
}

/// Whether something runs in parallel.
const CONCURRENT: u32 = Switch::ALL.len() as u32;
/// Where the arm stands: it depends on the position that it was sent to last.
const STANDS: u32 = CONCURRENT + 1;
/// All positions.
const POSITIONS: u32 = STANDS + 1;
/// Whether any user frame, any tool may have other values than in the cell.
const ANY: [u32; 2] = [POSITIONS + 1, POSITIONS + 2];
/// The first user frame.
const FRAMES: u32 = ANY[1] + 1;

/// The semantics of TP for one program.
#[derive(Clone, Debug)]
pub struct Tp {
    /// Variables that record whether a program has set the values of each user frame and of each tool.
    frames: [Range<u32>; 2],
    /// Registers, from `R[0]` on.
    registers: Range<u32>,
}

impl Tp {
    fn register(&self, index: &Value) -> Option<Slot> {
        slot(&self.registers, index)
    }

    /// Sets a register. If its number is unknown, all registers become unknown.
    fn set(&self, arguments: &Arguments<'_>, store: &mut Store) {
        let (Some(index), Some(value)) = (arguments.get("", 0), arguments.get("", 1)) else { return };
        if whole(index).is_none() {
            self.registers.clone().for_each(|slot| store.lose(Slot::Global(slot), Reason::Computed));
        } else if let Some(slot) = self.register(index) {
            let is_concurrent = runs_in_parallel(store);
            *store.get_mut(slot) = known(value, is_concurrent);
        }
    }

    /// Numbers of frames whose values a program has set; unknown if it may be any frame.
    fn redefined(&self, frame: usize, store: &Store) -> Value {
        let is_set = |slot: u32| !matches!(store.get(Slot::Global(slot)).content, Content::Truth(false));
        if is_set(ANY[frame]) {
            return Value::unknown([Reason::FrameRedefined, Reason::ToolRedefined][frame]);
        }
        let own = &self.frames[frame];
        let numbers: Vec<Value> =
            own.clone().filter(|slot| is_set(*slot)).map(|slot| number(f64::from(slot - own.start))).collect();
        if numbers.is_empty() { Content::Nothing.into() } else { Content::List(numbers.into()).into() }
    }
}

fn number(value: f64) -> Value {
    Content::Number(crate::value::Number::constant(value)).into()
}

/// The value, if it is a whole number from 0 on in every arithmetic.
fn whole(value: &Value) -> Option<u32> {
    match value.content {
        Content::Number(number) if number.exact => expression::counted(number.value),
        _ => None,
    }
}

/// The variable with a number.
fn slot(all: &Range<u32>, index: &Value) -> Option<Slot> {
    let slot = all.start.checked_add(whole(index)?)?;
    all.contains(&slot).then_some(Slot::Global(slot))
}

fn runs_in_parallel(store: &Store) -> bool {
    !matches!(store.get(Slot::Global(CONCURRENT)).content, Content::Truth(false))
}

/// The value if it is whole and nothing that runs in parallel may change it; otherwise unknown.
fn known(value: &Value, is_concurrent: bool) -> Value {
    match value.content {
        _ if is_concurrent => Value::unknown(Reason::Thread),
        Content::Number(number) if !(number.exact && is_whole(number.value)) => Value::unknown(Reason::Rounding),
        _ => value.clone(),
    }
}

impl Dialect for Tp {
    /// X, Y, Z in millimetres, and W, P, R in degrees about the fixed axes x, y, z, as in INFORM.
    fn pose(&self, numbers: &[f64]) -> Option<Isometry3<f64>> {
        Inform.pose(numbers)
    }

    fn numbers(&self, pose: &Isometry3<f64>, near: &[f64]) -> Vec<f64> {
        Inform.numbers(pose, near)
    }

    fn call(&self, builtin: u16, arguments: &Arguments<'_>, store: &mut Store) -> Value {
        let first = || arguments.get("", 0).cloned().unwrap_or_else(|| Value::unknown(Reason::Input));
        match builtin {
            builtin::QUOTIENT => {
                let exact = |at| match arguments.get("", at)?.content {
                    Content::Number(number) if number.exact => Some(number.value),
                    _ => None,
                };
                let quotient = exact(0).zip(exact(1)).filter(|(_, by)| *by != 0.0).map(|(of, by)| of / by);
                // No public manual says whether the quotient is rounded down or towards zero.
                let known = quotient.filter(|quotient| *quotient >= 0.0 || is_whole(*quotient));
                return known.map_or_else(|| Value::unknown(Reason::Rounding), |quotient| number(quotient.trunc()));
            }
            builtin::REGISTER => {
                let known = self.register(&first()).map(|slot| store.get(slot).clone());
                return known.unwrap_or_else(|| Value::unknown(Reason::Input));
            }
            builtin::SET => self.set(arguments, store),
            builtin::CONCURRENT => {
                store.lose(Slot::Global(CONCURRENT), Reason::Thread);
                self.registers.clone().for_each(|slot| store.lose(Slot::Global(slot), Reason::Thread));
                [Switch::Frame, Switch::Tool].into_iter().for_each(|of| store.lose(of.slot(), Reason::Thread));
            }
            builtin::ELSEWHERE => store.lose_place(),
            builtin::POSITION => {
                let index = match whole(&first()) {
                    Some(index) => number(f64::from(index)),
                    None => Value::unknown(Reason::PositionUnknown),
                };
                return Content::List([index, self.redefined(0, store), self.redefined(1, store)].into()).into();
            }
            _ => {
                for (frame, switch) in [Switch::Frame, Switch::Tool].into_iter().enumerate() {
                    if builtin == builtin::SELECT[frame] {
                        let is_concurrent = runs_in_parallel(store);
                        store.set(switch, known(&first(), is_concurrent));
                    } else if builtin == builtin::REDEFINE[frame] {
                        let slot = slot(&self.frames[frame], &first()).unwrap_or(Slot::Global(ANY[frame]));
                        store.lose(slot, Reason::Computed);
                    }
                }
            }
        }
        Content::Nothing.into()
    }

    /// Called programs are not lowered to routines; their effects are applied at the call. So this list is not needed.
    fn writes(&self, _: u16) -> &[Slot] {
        &[]
    }

    /// The changes of a program that is not given are applied at the call.
    fn left_by_foreign(&self) -> &[Switch] {
        &Switch::ALL
    }
}
