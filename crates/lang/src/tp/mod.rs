//! FANUC TP, as controllers print their programs (`.ls`).
//!
//! A program is statements (`/MN`) and positions (`/POS`). A position has a number, and is relative to the user frame and the tool with
//! which it was recorded, or that are selected when the motion runs. Registers (`R[…]`), the selected frames and the values of frames
//! belong to the controller: any program may change them. The lowering therefore represents a called program by the possible effects of it
//! and of all programs that it calls, in any order. A register is known if the program has set it to a whole number: the controller stores
//! real numbers in single precision, so that deflex cannot know whether two of them are equal. The elements of a position register (`PR[…,…]`)
//! are known if the program has set all six; a frame that it then sets to this register is known too.
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
use crate::value::{Content, Pose, Value, is_whole};
use nalgebra::Isometry3;
use std::ops::Range;
use std::sync::Arc;

pub use calls::Shared;
pub use code::Code;
pub use effects::Calls;
pub use expression::count;
pub use lower::{Defined, Held, lower};
pub use motion::{Lasting, Motion, Point, Speed, lasting};
pub use statement::{Frame, NamedPosition, StatementKind, Whole, kind, positions_named, runs};

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
    /// Sets a user frame or a tool, by its number, to a position register, by its number.
    pub(super) const REDEFINE: [u16; 2] = [5, 6];
    /// Records that a program runs in parallel from here on.
    pub(super) const CONCURRENT: u16 = 7;
    /// Records that another program may have moved the arm.
    pub(super) const ELSEWHERE: u16 = 8;
    /// A position, by its number, with the user frames and tools, with the value that depends on the positions of a position register, and with
    /// the pose in a position register, by its number.
    pub(super) const POSITION: u16 = 9;
    /// Sets an element of a position register, by their numbers; all elements if the number of the element is unknown.
    pub(super) const ELEMENT: u16 = 10;
    /// The value of an element of a position register, by their numbers.
    pub(super) const VALUE: u16 = 11;
}

/// Whether something runs in parallel.
const CONCURRENT: u32 = Switch::ALL.len() as u32;
/// Where the arm stands: it depends on the position that it was sent to last.
const STANDS: u32 = CONCURRENT + 1;
/// All positions.
const POSITIONS: u32 = STANDS + 1;
/// Whether any user frame, any tool may have other values than in the cell.
const ANY: [u32; 2] = [POSITIONS + 1, POSITIONS + 2];
/// The speed override, per cent.
const OVERRIDE: u32 = ANY[1] + 1;
/// The positions from which the position registers come that the program sets to positions, in the order of their numbers.
const ORIGINS: u32 = OVERRIDE + 1;

/// The semantics of TP for one program.
#[derive(Clone, Debug)]
pub struct Tp {
    /// Variables for the values of each user frame and of each tool: false for those of the cell, a pose, or unknown.
    frames: [Range<u32>; 2],
    /// Registers, from `R[0]` on.
    registers: Range<u32>,
    /// The six elements of each position register, from `PR[0]` on.
    elements: Range<u32>,
}

/// X, Y, Z, W, P, R of a position register.
const ELEMENTS: u32 = 6;

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
            *store.get_mut(slot) = alone(value, store);
        }
    }

    /// The values of all user frames or tools: first of those that have no variable, then of each by its number.
    fn values_of(&self, frame: usize, store: &Store) -> Value {
        let slots = [ANY[frame]].into_iter().chain(self.frames[frame].clone());
        let values: Vec<Value> = slots.map(|slot| store.get(Slot::Global(slot)).clone()).collect();
        Content::List(values.into()).into()
    }

    /// The variables of the elements of a position register.
    fn elements_of(&self, register: &Value) -> Option<Range<u32>> {
        let start = self.elements.start.checked_add(whole(register)?.checked_mul(ELEMENTS)?)?;
        self.elements.contains(&start).then(|| start..start + ELEMENTS)
    }

    /// Sets one element of a position register; everything that it may be, if a number is unknown.
    fn set_element(&self, arguments: &Arguments<'_>, store: &mut Store) {
        let [Some(register), Some(element), Some(value)] = [0, 1, 2].map(|at| arguments.get("", at)) else { return };
        let Some(all) = self.elements_of(register) else {
            // Registers beyond those that have variables are never known.
            if whole(register).is_none() {
                self.elements.clone().for_each(|slot| store.lose(Slot::Global(slot), Reason::Computed));
            }
            return;
        };
        match whole(element) {
            Some(at @ 1..=ELEMENTS) => {
                *store.get_mut(Slot::Global(all.start + at - 1)) = alone(value, store);
            }
            // An external axis.
            Some(_) => {}
            None => all.for_each(|slot| store.lose(Slot::Global(slot), Reason::Computed)),
        }
    }

    /// The pose in a position register, if all of its elements are known.
    fn in_register(&self, register: &Value, store: &Store) -> Option<Value> {
        let elements = self.elements_of(register)?.map(|slot| store.get(Slot::Global(slot)).number());
        let pose = self.pose(&elements.collect::<Option<Vec<f64>>>()?)?;
        Some(Content::Pose(Arc::new(Pose::constant(pose))).into())
    }

    /// Sets a user frame or a tool.
    fn redefine(&self, frame: usize, arguments: &Arguments<'_>, store: &mut Store) {
        let [Some(index), Some(register)] = [0, 1].map(|at| arguments.get("", at)) else { return };
        let slots = &self.frames[frame];
        match slot(slots, index) {
            Some(of) => match self.in_register(register, store).filter(|_| !runs_in_parallel(store)) {
                Some(pose) => *store.get_mut(of) = pose,
                None => store.lose(of, Reason::Computed),
            },
            None => [ANY[frame]].into_iter().chain(slots.clone()).for_each(|slot| {
                store.lose(Slot::Global(slot), Reason::Computed);
            }),
        }
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

/// The value; unknown if something that runs in parallel may change it.
fn alone(value: &Value, store: &Store) -> Value {
    if runs_in_parallel(store) { Value::unknown(Reason::Thread) } else { value.clone() }
}

/// The same for the number of a frame; unknown if it is not whole.
fn frame_number(value: &Value, store: &Store) -> Value {
    match alone(value, store) {
        Value { content: Content::Number(number), .. } if !(number.exact && is_whole(number.value)) => {
            Value::unknown(Reason::Rounding)
        }
        value => value,
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
            builtin::VALUE => {
                let element = || whole(arguments.get("", 1)?)?.checked_sub(1).filter(|element| *element < ELEMENTS);
                let slot = self.elements_of(&first()).zip(element()).map(|(all, element)| all.start + element);
                let known = slot.map(|slot| store.get(Slot::Global(slot)).clone());
                return known.unwrap_or_else(|| Value::unknown(Reason::Input));
            }
            builtin::SET => self.set(arguments, store),
            builtin::ELEMENT => self.set_element(arguments, store),
            builtin::CONCURRENT => {
                store.lose(Slot::Global(CONCURRENT), Reason::Thread);
                let registers = self.registers.clone().chain(self.elements.clone());
                registers.for_each(|slot| store.lose(Slot::Global(slot), Reason::Thread));
                [Switch::Frame, Switch::Tool].into_iter().for_each(|of| store.lose(of.slot(), Reason::Thread));
            }
            builtin::ELSEWHERE => store.lose_place(),
            builtin::POSITION => {
                let index = match whole(&first()) {
                    Some(index) => number(f64::from(index)),
                    None => Value::unknown(Reason::PositionUnknown),
                };
                let origin = arguments.get("", 1).cloned().unwrap_or_else(|| Content::Nothing.into());
                let offset = arguments.get("", 2).and_then(|register| self.in_register(register, store));
                let offset = offset.unwrap_or_else(|| Content::Nothing.into());
                let [users, tools] = [0, 1].map(|frame| self.values_of(frame, store));
                return Content::List([index, users, tools, origin, offset].into()).into();
            }
            _ => {
                for (frame, switch) in [Switch::Frame, Switch::Tool].into_iter().enumerate() {
                    if builtin == builtin::SELECT[frame] {
                        let number = frame_number(&first(), store);
                        store.set(switch, number);
                    } else if builtin == builtin::REDEFINE[frame] {
                        self.redefine(frame, arguments, store);
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
