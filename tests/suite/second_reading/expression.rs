//! Expressions and predefined functions.

use super::machine::Goal;
use super::machine::{Machine, Motion, Ran, Stop, error_number};
use super::tree::{Arg, Data, Expr};
use super::value::{Frame, IDENTITY, Val};

/// Tool down, its x axis aside.
const DOWN: [f64; 4] = [0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 0.0];

impl Machine<'_> {
    /// Value of an expression; `ty` is what is expected, for values that only the oracle knows.
    pub fn eval(&mut self, expr: &Expr, ty: &str) -> Ran<Val> {
        Ok(match expr {
            Expr::Num(v) => Val::Num(*v),
            Expr::Str(v) => Val::Str(v.clone()),
            Expr::Bool(v) => Val::Bool(*v),
            Expr::Aggregate(items) => {
                let components = self.components(ty);
                let mut out = Vec::new();
                for (i, item) in items.iter().enumerate() {
                    // An array's elements are of the array's own type.
                    let element = if components.len() == items.len() { &components[i].1 } else { ty };
                    out.push(self.eval(item, element)?);
                }
                Val::List(out)
            }
            Expr::Unary(operator, inner) => {
                let value = self.eval(inner, if *operator == "NOT" { "BOOL" } else { ty })?;
                match (*operator, value) {
                    ("NOT", value) => Val::Bool(!value.bool()?),
                    (_, Val::List(items)) => {
                        Val::List(items.iter().map(|v| v.num().map(|v| Val::Num(-v))).collect::<Result<_, _>>()?)
                    }
                    (_, value) => Val::Num(-value.num()?),
                }
            }
            Expr::Binary(operator, left, right) => self.binary(operator, left, right, ty)?,
            Expr::Data(data) => self.data(data, ty)?,
            Expr::Call(name, args) => self.function(name, args, ty)?,
        })
    }

    fn binary(&mut self, operator: &str, left: &Expr, right: &Expr, ty: &str) -> Ran<Val> {
        if matches!(operator, "AND" | "OR" | "XOR") {
            let (a, b) = (self.eval(left, "BOOL")?.bool()?, self.eval(right, "BOOL")?.bool()?);
            return Ok(Val::Bool(match operator {
                "AND" => a && b,
                "OR" => a || b,
                _ => a != b,
            }));
        }
        let hint = if matches!(operator, "+" | "-") { ty } else { "NUM" };
        let (a, b) = (self.eval(left, hint)?, self.eval(right, hint)?);
        Ok(match (operator, &a, &b) {
            ("=", ..) => Val::Bool(a == b),
            ("<>", ..) => Val::Bool(a != b),
            ("+", Val::Str(a), Val::Str(b)) => {
                if a.len() + b.len() > 80 {
                    return Err(Stop::Broken("string too long".into()));
                }
                Val::Str(format!("{a}{b}"))
            }
            ("+" | "-", Val::List(_), Val::List(_)) => {
                let (a, b) = (a.numbers::<3>()?, b.numbers::<3>()?);
                let sign = if operator == "+" { 1.0 } else { -1.0 };
                Val::nums(&[a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2]])
            }
            ("*", Val::List(x), Val::List(y)) if x.len() == 4 && y.len() == 4 => {
                let turn = |v: &Val| v.numbers().map(|q| Frame { p: [0.0; 3], q });
                Val::nums(&turn(&a)?.then(&turn(&b)?).q)
            }
            ("*", Val::List(_), Val::List(_)) => {
                let (a, b) = (a.numbers::<3>()?, b.numbers::<3>()?);
                Val::nums(&[a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
            }
            ("*", Val::List(items), Val::Num(k)) | ("*", Val::Num(k), Val::List(items)) => {
                Val::List(items.iter().map(|v| v.num().map(|v| Val::Num(v * k))).collect::<Result<_, _>>()?)
            }
            ("/", Val::List(items), Val::Num(k)) => {
                Val::List(items.iter().map(|v| v.num().map(|v| Val::Num(v / k))).collect::<Result<_, _>>()?)
            }
            _ => {
                let (a, b) = (a.num()?, b.num()?);
                if matches!(operator, "/" | "DIV" | "MOD") && b == 0.0 {
                    return Err(Stop::Raise(error_number("ERR_DIVZERO").unwrap_or(0)));
                }
                match operator {
                    "+" => Val::Num(a + b),
                    "-" => Val::Num(a - b),
                    "*" => Val::Num(a * b),
                    "/" => Val::Num(a / b),
                    "DIV" => Val::Num((a / b).trunc()),
                    "MOD" => Val::Num(a % b),
                    "<" => Val::Bool(a < b),
                    ">" => Val::Bool(a > b),
                    "<=" => Val::Bool(a <= b),
                    _ => Val::Bool(a >= b),
                }
            }
        })
    }

    fn data(&mut self, data: &Data, ty: &str) -> Ran<Val> {
        if let Some(place) = self.place(data)? {
            return self.read(&place);
        }
        let name = data.name.as_str();
        if let Some(n) = error_number(name) {
            return Ok(Val::Num(f64::from(n)));
        }
        let zero = Val::nums(&[0.0; 6]);
        Ok(match name {
            "ERRNO" => Val::Num(f64::from(self.error())),
            "TRUE" | "FALSE" => Val::Bool(name == "TRUE"),
            "PI" => Val::Num(std::f64::consts::PI),
            "TOOL0" => Val::List(vec![Val::Bool(true), IDENTITY.val(), self.blank("LOADDATA")]),
            "WOBJ0" => {
                let frame = IDENTITY.val();
                Val::List(vec![Val::Bool(false), Val::Bool(true), Val::Str(String::new()), frame.clone(), frame])
            }
            _ => match self.cell_file.iter().find(|(known, ..)| known == name) {
                Some((_, _, value)) => value.clone(),
                None => match ty {
                    // Speeds and zones by their names, signals.
                    "SPEEDDATA" | "ZONEDATA" | "SIGNAL" => zero,
                    "TOOLDATA" | "WOBJDATA" | "ROBTARGET" => {
                        return Err(Stop::Broken(format!("{name} is not declared")));
                    }
                    _ => self.unknown(ty),
                },
            },
        })
    }

    /// A value that no text tells.
    pub fn unknown(&mut self, ty: &str) -> Val {
        match ty {
            "" | "NUM" | "DNUM" => Val::Num(self.oracle.signal()),
            "BOOL" => Val::Bool(self.oracle.one_in(2)),
            "STRING" => Val::Str(String::new()),
            "POSE" => self.oracle.frame().val(),
            "POS" => Val::nums(&self.oracle.frame().p),
            "ORIENT" => Val::nums(&self.oracle.frame().q),
            "TOOLDATA" => {
                let frame = Frame::shift([0.0, 0.0, 150.0]).then(&self.oracle.frame());
                Val::List(vec![Val::Bool(true), frame.val(), self.blank("LOADDATA")])
            }
            "WOBJDATA" => {
                let frame = Frame::shift([1000.0, 100.0, 600.0]).then(&self.oracle.frame());
                let ends = [Val::Bool(false), Val::Bool(true), Val::Str(String::new()), frame.val(), IDENTITY.val()];
                Val::List(ends.to_vec())
            }
            "ROBTARGET" => {
                let shift = self.oracle.frame().p;
                let pose = Frame { p: shift, q: DOWN };
                self.target(&pose)
            }
            other => self.blank(other),
        }
    }

    /// A robtarget at a pose.
    pub fn target(&self, pose: &Frame) -> Val {
        Val::List(vec![Val::nums(&pose.p), Val::nums(&pose.q), Val::nums(&[0.0; 4]), Val::nums(&[9e9; 6])])
    }

    fn option(&mut self, args: &[Arg], name: &str, ty: &str) -> Ran<Option<Val>> {
        match args.iter().find(|arg| arg.option.as_deref() == Some(name)) {
            Some(Arg { value: Some(value), .. }) => {
                let is_absent =
                    matches!(value, Expr::Data(d) if d.steps.is_empty() && self.is_parameter_absent(&d.name));
                if is_absent { Ok(None) } else { self.eval(value, ty).map(Some) }
            }
            _ => Ok(None),
        }
    }

    /// Where the robot stands now, in the frames given or those last used.
    pub fn standing(&mut self, args: &[Arg]) -> Ran<Val> {
        let wobj = self.option(args, "WOBJ", "WOBJDATA")?;
        self.option(args, "TOOL", "TOOLDATA")?;
        let displacement = self.displacement;
        let now = match self.motions.iter().rev().find(|m| matches!(m.goal, Goal::Poses(..))) {
            Some(Motion { goal: Goal::Poses(poses, ..), .. }) if poses.is_empty() => IDENTITY,
            Some(motion) => {
                let Goal::Poses(poses, ..) = &motion.goal else { return Err(Stop::Broken("no pose".into())) };
                let world = motion.base()?.then(&poses[poses.len() - 1]);
                let wobj = wobj.unwrap_or_else(|| motion.wobj.clone());
                let base = Frame::of(wobj.at(3)?)?.then(&Frame::of(wobj.at(4)?)?).then(&displacement);
                base.inverse().then(&world)
            }
            None => Frame { p: [0.0; 3], q: DOWN },
        };
        Ok(self.target(&now))
    }

    fn function(&mut self, name: &str, args: &[Arg], ty: &str) -> Ran<Val> {
        if let Some((module, routine)) = self.here(name) {
            let value = self.call(module, &routine, args)?;
            return value.ok_or_else(|| Stop::Broken(format!("{name} returns nothing")));
        }
        if name == "PRESENT" {
            let Some(Expr::Data(data)) = args[0].value.as_ref() else { return Err(Stop::Broken("Present".into())) };
            return Ok(Val::Bool(self.present(&data.name)));
        }
        let types: &[&str] = match name {
            "OFFS" | "RELTOOL" => &["ROBTARGET", "NUM", "NUM", "NUM"],
            "POSEMULT" => &["POSE", "POSE"],
            "POSEINV" => &["POSE"],
            "POSEVECT" => &["POSE", "POS"],
            "NORIENT" => &["ORIENT"],
            "STRPART" => &["STRING", "NUM", "NUM"],
            "DIM" => &["", "NUM"],
            "CROBT" | "CPOS" | "CJOINTT" => &[],
            _ => &["NUM"; 8],
        };
        let mut values = Vec::new();
        for (i, arg) in args.iter().filter(|arg| arg.option.is_none()).enumerate() {
            let value = arg.value.as_ref().ok_or_else(|| "no value".to_owned())?;
            values.push(self.eval(value, types.get(i).copied().unwrap_or("NUM"))?);
        }
        let at = |i: usize| values.get(i).ok_or_else(|| format!("{name}: too few arguments"));
        let num = |i: usize| at(i)?.num();
        let angle = |v: f64| Ok(Val::Num(v.to_degrees()));
        match name {
            "OFFS" => {
                let mut target = at(0)?.clone();
                let p = target.at(0)?.numbers::<3>()?;
                *target.part_mut(&[0])? = Val::nums(&[p[0] + num(1)?, p[1] + num(2)?, p[2] + num(3)?]);
                self.computed.push(target.clone());
                Ok(target)
            }
            "RELTOOL" => {
                let target = at(0)?.clone();
                let mut pose = Frame::of(&target)?.then(&Frame::shift([num(1)?, num(2)?, num(3)?]));
                for (axis, name) in ["RX", "RY", "RZ"].into_iter().enumerate() {
                    if let Some(degrees) = self.option(args, name, "NUM")? {
                        pose = pose.then(&Frame::turn(axis, degrees.num()?));
                    }
                }
                let turned = [Val::nums(&pose.p), Val::nums(&pose.q), target.at(2)?.clone(), target.at(3)?.clone()];
                let target = Val::List(turned.into());
                self.computed.push(target.clone());
                Ok(target)
            }
            "CROBT" | "CPOS" => {
                let standing = self.standing(args)?;
                let standing = self.oracle.place(|_| standing);
                Ok(if name == "CROBT" { standing } else { standing.at(0)?.clone() })
            }
            "POSEMULT" => Ok(Frame::of(at(0)?)?.then(&Frame::of(at(1)?)?).val()),
            "POSEINV" => Ok(Frame::of(at(0)?)?.inverse().val()),
            "POSEVECT" => Ok(Val::nums(&Frame::of(at(0)?)?.then(&Frame::shift(at(1)?.numbers()?)).p)),
            "ORIENTZYX" => {
                let turned = Frame::turn(2, num(0)?).then(&Frame::turn(1, num(1)?)).then(&Frame::turn(0, num(2)?));
                Ok(Val::nums(&turned.q))
            }
            "NORIENT" => Ok(Val::nums(&Frame { p: [0.0; 3], q: at(0)?.numbers()? }.then(&IDENTITY).q)),
            "ABS" => Ok(Val::Num(num(0)?.abs())),
            "SQRT" => Ok(Val::Num(num(0)?.sqrt())),
            "SIN" => Ok(Val::Num(num(0)?.to_radians().sin())),
            "COS" => Ok(Val::Num(num(0)?.to_radians().cos())),
            "TAN" => Ok(Val::Num(num(0)?.to_radians().tan())),
            "ASIN" => angle(num(0)?.asin()),
            "ACOS" => angle(num(0)?.acos()),
            "ATAN" => angle(num(0)?.atan()),
            "ATAN2" => angle(num(0)?.atan2(num(1)?)),
            "POW" => Ok(Val::Num(num(0)?.powf(num(1)?))),
            "ROUND" | "TRUNC" => {
                let decimals = self.option(args, "DEC", "NUM")?.map_or(Ok(0.0), |v| v.num())?;
                let scale = 10_f64.powf(decimals);
                let v = num(0)? * scale;
                Ok(Val::Num(if name == "ROUND" { v.round() } else { v.trunc() } / scale))
            }
            "DIM" => {
                let mut array = at(0)?;
                for _ in 1..num(1)? as usize {
                    array = array.at(0)?;
                }
                Ok(Val::Num(array.list()?.len() as f64))
            }
            "NUMTOSTR" => Ok(Val::Str(format!("{:.*}", num(1)? as usize, num(0)?))),
            "STRLEN" => Ok(Val::Num(at(0)?.str()?.len() as f64)),
            "STRPART" => {
                let from = num(1)? as usize - 1;
                Ok(Val::Str(at(0)?.str()?.chars().skip(from).take(num(2)? as usize).collect()))
            }
            "READNUM" | "AINPUT" | "GINPUT" | "UINUMENTRY" | "RAND" => Ok(Val::Num(self.oracle.number())),
            "DINPUT" | "DOUTPUT" | "TESTDI" => {
                let on = self.oracle.signal();
                Ok(if name == "TESTDI" { Val::Bool(on > 0.5) } else { Val::Num(on) })
            }
            _ => {
                // Of a module that is not at hand.
                self.elsewhere(args, None)?;
                Ok(self.unknown(ty))
            }
        }
    }
}
