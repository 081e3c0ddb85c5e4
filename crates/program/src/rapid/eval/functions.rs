//! Evaluates predefined functions whose arguments are known when reading.

use super::super::expression::{Arguments, Call, Expression, ExpressionKind, PartStep};
use super::super::known::RoutineId;
use super::super::predefined;
use super::super::runner::{Frame, Runner};
use super::super::symbols::{Names, Upper};
use super::super::tree::{Param, Statement, StatementKind};
use super::super::value::{Number, OffsetStep, Value, multiply, rotate, unit};
use super::Scope;
use crate::orientation::quaternion;
use crate::{NO_TURN, Reason};
use deflex_lang::ir::{Binary, SourceSpan};
use deflex_text::number::write_fixed;
use nalgebra::{Rotation3, Vector3};
use std::rc::Rc;

impl<'a> Runner<'a> {
    /// A call in an expression.
    pub(super) fn function(&mut self, scope: Scope, call: &'a Call) -> Value {
        let bytes = self.bytes(scope.source as usize);
        let (name, arguments) = (Upper::new(&bytes[call.name.range()]), &call.arguments);
        let values: Vec<Value> = arguments.positional.iter().map(|argument| self.value(scope, argument)).collect();
        let routine = self.symbols.find_routine(scope.module, &bytes[call.name.range()]);
        if arguments.is_cut {
            self.unknown_call(scope, arguments);
            return Value::Unknown(Reason::Expression);
        }
        if let Some(value) = routine.and_then(|id| self.returned(id, arguments, &values)) {
            self.counters.events += 1;
            return value;
        }
        if let Some(id) = routine {
            values.iter().for_each(|v| self.numbers.pin_value(v));
            self.not_followed(scope, id, arguments, Reason::ByFunction);
            self.expression_may_fail();
            return Value::Unknown(Reason::Computed);
        }
        match predefined::function(&name) {
            Some(predefined::Function::Nothing) => {}
            Some(predefined::Function::Arguments) => {
                self.counters.events += 1;
                for argument in arguments.given() {
                    self.forget_argument(scope, argument, Reason::Computed);
                }
            }
            None => self.unknown_function(scope, call),
        }
        if !matches!(&*name, b"RELTOOL") {
            for value in arguments.optional_values() {
                let value = self.value(scope, value);
                self.numbers.pin_value(&value);
            }
        }
        let known = match (&*name, values.len()) {
            (b"PRESENT", 1) => return present(&values[0]),
            (b"OFFS", 4) => return self.shifted(&values, false, Some(NO_TURN)),
            (b"RELTOOL", 4) => {
                let turn = self.turn(scope, arguments);
                return self.shifted(&values, true, turn);
            }
            (b"NUMTOSTR", 2) => printed(&values[0], &values[1]),
            (b"ORIENTZYX", 3) => orientation(&values),
            (b"DIM", 2) => dimension(&values[0], &values[1]),
            (b"NORIENT", 1) => values[0].nums().map(|quat| list(unit(quat))),
            (b"POSEMULT", 2) => pose_of(&values[0]).zip(pose_of(&values[1])).map(|(a, b)| frame(product(a, b))),
            (b"POSEINV", 1) => pose_of(&values[0]).map(|(position, [w, x, y, z])| {
                let back = [w, -x, -y, -z];
                frame((rotate(back, position.map(|v| -v)), back))
            }),
            (b"POSEVECT", 2) => {
                pose_of(&values[0]).zip(values[1].nums()).map(|(a, at)| list(product(a, (at, NO_TURN)).0))
            }
            (b"DEFFRAME", 3) if arguments.optional.is_empty() => {
                values.iter().for_each(|v| self.numbers.pin_value(v));
                // Points that are too near to each other or to one line are an error.
                self.expression_may_fail();
                let points = [0, 1, 2].map(|at| self.as_target(&values[at]).map(|pose| pose.written.position_mm));
                through(points)
            }
            _ => arithmetic(&name, &values, arguments.optional.is_empty()),
        };
        if known.is_none() && !predefined::never_fails(&name) {
            self.expression_may_fail();
        }
        known.unwrap_or_else(|| {
            values.iter().for_each(|v| self.numbers.pin_value(v));
            Value::Unknown(Reason::Computed)
        })
    }

    /// The value of a function of the program that only returns an expression of copies of its arguments, which changes nothing and raises no
    /// error. Other calls use the numbers in its text too.
    fn returned(&mut self, id: RoutineId, arguments: &Arguments, values: &[Value]) -> Option<Value> {
        let (routine, bytes, module) = (self.symbols.routine(id), self.bytes(id.file), self.symbols.module_of(id));
        let [Statement { kind: StatementKind::Return(Some(returned)), .. }] = &routine.body[..] else { return None };
        let is_copy = |param: &Param| !param.by_reference && !param.optional;
        let mut is_plain = routine.data.is_empty()
            && routine.handlers.is_empty()
            && arguments.optional.is_empty()
            && routine.params.len() == values.len()
            && routine.params.iter().all(is_copy);
        returned.each(&mut |part: &Expression| {
            is_plain &= match &part.kind {
                ExpressionKind::Call(call) => {
                    let name = &bytes[call.name.range()];
                    self.symbols.find_routine(module, name).is_none() && predefined::never_fails(name)
                }
                ExpressionKind::Chain(chain) => chain
                    .operations
                    .iter()
                    .all(|operation| matches!(operation.operator, Binary::Add | Binary::Subtract | Binary::Multiply)),
                ExpressionKind::Part(part) => part.steps.iter().all(|step| matches!(step, PartStep::Component(_))),
                ExpressionKind::Unknown(..) => false,
                _ => true,
            }
        });
        if !is_plain {
            return None;
        }
        let first = self.symbols.variables.len();
        let mut names = Names::new();
        for (param, value) in routine.params.iter().zip(values) {
            let value = value.without_tokens();
            let at = self.new_variable(bytes, id.file, module, param.kind, param.name, value);
            names.insert(Box::from(&*Upper::new(&bytes[param.name.range()])), at);
        }
        self.frames.push(Frame { routine: id, module, names, ..Frame::default() });
        let value = self.value(self.scope(), returned);
        self.frames.pop();
        self.symbols.variables.truncate(first);
        Some(match value {
            Value::Target(pose) => {
                let mut pose = (*pose).clone();
                let is_own = |place: SourceSpan| {
                    usize::from(place.source) == id.file && routine.text.range().contains(&place.span.range().start)
                };
                pose.steps
                    .iter_mut()
                    .filter(|step| step.place().is_some_and(is_own))
                    .for_each(|step| step.tokens = None);
                Value::Target(Rc::new(pose))
            }
            other => other.without_tokens(),
        })
    }

    /// `\Rx`, `\Ry`, `\Rz` of `RelTool`: turns about x, then the new y, then the new z.
    fn turn(&mut self, scope: Scope, arguments: &'a Arguments) -> Option<[f64; 4]> {
        let bytes = self.bytes(scope.source as usize);
        let mut turn = NO_TURN;
        for (axis, name) in [&b"Rx"[..], b"Ry", b"Rz"].into_iter().enumerate() {
            if !arguments.has(bytes, name) {
                continue;
            }
            let half = self.value(scope, arguments.named(bytes, name)?).num()?.to_radians() / 2.0;
            let mut q = [half.cos(), 0.0, 0.0, 0.0];
            q[axis + 1] = half.sin();
            turn = multiply(turn, q);
        }
        Some(turn)
    }

    /// `Offs` or `RelTool`.
    fn shifted(&mut self, values: &[Value], in_tool: bool, turn: Option<[f64; 4]>) -> Value {
        let (offset_mm, tokens) = match &values[1..4] {
            [Value::Num(x, tx), Value::Num(y, ty), Value::Num(z, tz)] => {
                (Some([*x, *y, *z]), tx.zip(*ty).zip(*tz).map(|((x, y), z)| [x, y, z]))
            }
            _ => (None, None),
        };
        let (Some(base), Some(offset_mm), Some(turn)) = (self.as_target(&values[0]), offset_mm, turn) else {
            // Another run of this statement would edit numbers that are used here too.
            self.numbers.held.extend(tokens.map(|tokens| Number::Offset(tokens[0])));
            self.numbers.pin_value(&values[0]);
            return Value::Unknown(values[0].unknown().unwrap_or(Reason::Computed));
        };
        let step = OffsetStep { offset_mm, tokens, in_tool, turn, stated_mm: [None; 3] };
        let mut pose = (*base).clone();
        (pose.written.position_mm, pose.written.quat) = step.apply(pose.written.position_mm, pose.written.quat);
        if pose.root.is_some() {
            pose.steps.push(step);
        } else {
            // This pose cannot be edited, and another run of the same statement must not edit the offset.
            self.numbers.held.extend(tokens.map(|tokens| Number::Offset(tokens[0])));
        }
        Value::Target(Rc::new(pose))
    }
}

/// `Present`: whether an optional parameter is given.
fn present(value: &Value) -> Value {
    match value {
        Value::Unknown(Reason::OptionalArgumentMissing) => Value::Bool(false),
        Value::Unknown(Reason::ArgumentUnknown) => Value::Unknown(Reason::Computed),
        _ => Value::Bool(true),
    }
}

/// Functions of numbers, with angles in degrees; functions that round are known only if they round to `whole` numbers.
fn arithmetic(name: &[u8], values: &[Value], whole: bool) -> Option<Value> {
    let value = match values {
        [Value::Num(v, _)] => match name {
            b"ABS" => v.abs(),
            b"SQRT" => v.sqrt(),
            b"SIN" => v.to_radians().sin(),
            b"COS" => v.to_radians().cos(),
            b"TAN" => v.to_radians().tan(),
            b"ASIN" => v.asin().to_degrees(),
            b"ACOS" => v.acos().to_degrees(),
            b"ATAN" => v.atan().to_degrees(),
            b"EXP" => v.exp(),
            b"ROUND" if whole => v.round(),
            b"TRUNC" if whole => v.trunc(),
            _ => return None,
        },
        [Value::Num(a, _), Value::Num(b, _)] => match name {
            b"ATAN2" => a.atan2(*b).to_degrees(),
            b"POW" => a.powf(*b),
            _ => return None,
        },
        _ => return None,
    };
    value.is_finite().then_some(Value::Num(value, None))
}

/// `OrientZYX`: turns about z, then the new y, then the new x, degrees.
fn orientation(values: &[Value]) -> Option<Value> {
    let mut turn = NO_TURN;
    for (axis, value) in [3, 2, 1].into_iter().zip(values) {
        let half = value.num()?.to_radians() / 2.0;
        let mut q = [half.cos(), 0.0, 0.0, 0.0];
        q[axis] = half.sin();
        turn = multiply(turn, q);
    }
    Some(list(turn))
}

fn list<const N: usize>(numbers: [f64; N]) -> Value {
    Value::List(numbers.into_iter().map(|v| Value::Num(v, None)).collect(), None)
}

/// Position and orientation of a `pose`.
fn pose_of(value: &Value) -> Option<([f64; 3], [f64; 4])> {
    let [position, quat] = value.list()? else { return None };
    Some((position.nums()?, unit(quat.nums()?)))
}

fn frame((position, quat): ([f64; 3], [f64; 4])) -> Value {
    Value::List([list(position), list(quat)].into(), None)
}

/// The product of two poses.
fn product(a: ([f64; 3], [f64; 4]), b: ([f64; 3], [f64; 4])) -> ([f64; 3], [f64; 4]) {
    let moved = rotate(a.1, b.0);
    (std::array::from_fn(|i| a.0[i] + moved[i]), multiply(a.1, b.1))
}

/// `DefFrame`: the frame at the first point, with x through the second and y on the side of the third.
fn through(points: [Option<[f64; 3]>; 3]) -> Option<Value> {
    let [origin, on_x, in_plane] = points.map(|point| point.map(Vector3::from));
    let (origin, on_x, in_plane) = (origin?, on_x?, in_plane?);
    let x = (on_x - origin).try_normalize(0.0)?;
    let z = x.cross(&(in_plane - origin)).try_normalize(0.0)?;
    let axes = Rotation3::from_basis_unchecked(&[x, z.cross(&x), z]);
    Some(frame((origin.into(), quaternion(&axes))))
}

/// `NumToStr`.
fn printed(value: &Value, decimals: &Value) -> Option<Value> {
    let (value, decimals) = (value.num()?, decimals.num()?);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let decimals = decimals.clamp(0.0, 9.0) as usize;
    let mut text = Vec::new();
    write_fixed(&mut text, value, decimals);
    Some(Value::Text(text.into()))
}

/// `Dim`: how many elements an array has in a dimension, counted from 1.
fn dimension(array: &Value, number: &Value) -> Option<Value> {
    let mut items = array.list()?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    for _ in 1..number.num()?.clamp(1.0, 3.0) as usize {
        items = items.first()?.list()?;
    }
    #[allow(clippy::cast_precision_loss)]
    Some(Value::Num(items.len() as f64, None))
}
