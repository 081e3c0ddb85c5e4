//! Predefined instructions, and those of modules that are not at hand.

use super::machine::{Goal, Machine, Mark, Motion, Place, Ran, Stop, error_number};
use super::tree::{Arg, Data, Expr, Storage};
use super::value::{Frame, IDENTITY, Val};

/// Required arguments of motions, by position: circle point, target, tool; `None` where there is none.
struct Layout {
    via: Option<usize>,
    to: usize,
    tool: usize,
    joints: bool,
    signal: Option<usize>,
    routine: Option<usize>,
}

fn layout(name: &str) -> Option<Layout> {
    let of = |via, to, tool| Some(Layout { via, to, tool, joints: false, signal: None, routine: None });
    match name {
        "MOVEL" | "MOVEJ" | "MOVELDO" | "MOVEJDO" | "MOVELAO" | "MOVEJAO" | "MOVELGO" | "MOVEJGO" => of(None, 0, 3),
        "MOVEC" | "MOVECDO" | "MOVECAO" | "MOVECGO" => of(Some(0), 1, 4),
        "TRIGGL" | "TRIGGJ" => of(None, 0, 4),
        "TRIGGC" => of(Some(0), 1, 5),
        "ARCL" | "ARCLSTART" | "ARCLEND" => of(None, 0, 5),
        "MOVELSYNC" | "MOVEJSYNC" => of(None, 0, 3).map(|l| Layout { routine: Some(4), ..l }),
        "MOVECSYNC" => of(Some(0), 1, 4).map(|l| Layout { routine: Some(5), ..l }),
        "SEARCHL" => of(None, 2, 4).map(|l| Layout { signal: Some(0), ..l }),
        "SEARCHC" => of(Some(2), 3, 5).map(|l| Layout { signal: Some(0), ..l }),
        "MOVEABSJ" => of(None, 0, 3).map(|l| Layout { joints: true, ..l }),
        _ => None,
    }
}

/// Instructions that change neither frames nor data.
const HARMLESS: [&str; 43] = [
    "TPWRITE", "TPERASE", "SET", "RESET", "SETDO", "SETAO", "SETGO", "PULSEDO", "INVERTDO", "WAITTIME", "WAITROB",
    "CONFL", "CONFJ", "SINGAREA", "ACCSET", "VELSET", "GRIPLOAD", "ACTUNIT", "DEACTUNIT", "STOP", "BREAK", "ISLEEP",
    "STOPMOVE", "STARTMOVE", "STOREPATH", "RESTOPATH", "CLEARPATH", "TRIGGIO", "TRIGGEQUIP", "TRIGGINT", "CLKRESET",
    "CLKSTART", "CLKSTOP", "OPEN", "CLOSE", "WRITE", "UIMSGBOX", "BOOKERRNO", "SPEEDREFRESH", "MOTIONSUP",
    "PATHACCLIM", "WORLDACCLIM", "IWATCH",
];

impl Machine<'_> {
    pub fn is_parameter_absent(&self, name: &str) -> bool {
        !self.present(name) && self.is_bound(name)
    }

    fn required(args: &[Arg], i: usize) -> Ran<&Expr> {
        let arg = args.iter().filter(|arg| arg.option.is_none()).nth(i);
        arg.and_then(|arg| arg.value.as_ref()).ok_or_else(|| Stop::Broken("too few arguments".into()))
    }

    fn named<'e>(&self, args: &'e [Arg], name: &str) -> Option<&'e Expr> {
        let value = args.iter().find(|arg| arg.option.as_deref() == Some(name))?.value.as_ref()?;
        let absent = matches!(value, Expr::Data(d) if d.steps.is_empty() && self.is_parameter_absent(&d.name));
        (!absent).then_some(value)
    }

    fn given(args: &[Arg], name: &str) -> bool {
        args.iter().any(|arg| arg.option.as_deref() == Some(name))
    }

    fn slot(&mut self, expr: &Expr) -> Ran<Place> {
        let Expr::Data(data) = expr else { return Err(Stop::Broken("expected data".into())) };
        self.place(data)?.ok_or_else(|| Stop::Broken(format!("{} is not declared", data.name)))
    }

    fn bump(&mut self, args: &[Arg], by: impl Fn(f64) -> f64) -> Ran<()> {
        let place = self.slot(Self::required(args, 0)?)?;
        let value = self.read(&place)?.num()?;
        self.write(&place, Val::Num(by(value)))
    }

    pub fn instruction(&mut self, name: &str, args: &[Arg], line: u32) -> Ran<()> {
        if let Some((module, routine)) = self.here(name) {
            return self.call(module, &routine, args).map(|_| ());
        }
        if let Some(layout) = layout(name) {
            return self.motion(name, &layout, args, line);
        }
        if HARMLESS.contains(&name) {
            return Ok(());
        }
        match name {
            "PDISPSET" => self.displacement = Frame::of(&self.eval(Self::required(args, 0)?, "POSE")?)?,
            "MARK_AIR" => self.mark = Some(Mark::Air),
            "MARK_CUT" => self.mark = Some(Mark::Cut),
            "PDISPOFF" => self.displacement = IDENTITY,
            "PDISPON" => self.displace(args)?,
            "EOFFSSET" => self.offsets = self.eval(Self::required(args, 0)?, "EXTJOINT")?.numbers::<6>()?.to_vec(),
            "EOFFSOFF" => self.offsets = vec![0.0; 6],
            "EOFFSON" => self.offsets = vec![0.0; 6],
            "INCR" => self.bump(args, |v| v + 1.0)?,
            "DECR" => self.bump(args, |v| v - 1.0)?,
            "CLEAR" => self.bump(args, |_| 0.0)?,
            "ADD" => {
                let by = self.eval(Self::required(args, 1)?, "NUM")?.num()?;
                self.bump(args, |v| v + by)?;
            }
            "TPREADNUM" | "TPREADFK" => {
                let place = self.slot(Self::required(args, 0)?)?;
                let value = self.oracle.number();
                self.write(&place, Val::Num(value))?;
            }
            "WAITDI" | "WAITUNTIL" | "WAITDO" | "WAITAI" => {
                if Self::given(args, "MAXTIME") && self.oracle.one_in(2) {
                    return Err(Stop::Raise(error_number("ERR_WAIT_MAXTIME").unwrap_or(0)));
                }
            }
            "SETDATAVAL" | "GETDATAVAL" | "SETALLDATAVAL" => self.data_value(name, args)?,
            "CALLBYVAR" => {
                let stem = self.eval(Self::required(args, 0)?, "STRING")?.str()?.to_uppercase();
                let number = self.eval(Self::required(args, 1)?, "NUM")?.num()?;
                let called = format!("{stem}{number}");
                match self.here(&called) {
                    Some((module, routine)) => {
                        self.call(module, &routine, &[])?;
                    }
                    None => return Err(Stop::Raise(error_number("ERR_REFUNKPRC").unwrap_or(0))),
                }
            }
            "ISIGNALDI" | "ITIMER" | "IPERS" | "IENABLE" | "IDISABLE" | "IDELETE" => {
                let at = if name == "ISIGNALDI" { 2 } else { usize::from(matches!(name, "ITIMER" | "IPERS")) };
                if let Ok(expr) = Self::required(args, at) {
                    let place = self.slot(expr)?;
                    let number = self.read(&place)?.num()?;
                    for interrupt in &mut self.interrupts {
                        if (interrupt.number - number).abs() < 0.5 {
                            interrupt.ordered = name != "IDELETE";
                        }
                    }
                }
            }
            "EXITCYCLE" => return Err(Stop::End),
            _ => self.elsewhere(args, Some(line))?,
        }
        Ok(())
    }

    fn displace(&mut self, args: &[Arg]) -> Ran<()> {
        let from = Frame::of(&self.eval(Self::required(args, 0)?, "ROBTARGET")?)?;
        let wobj = self.named(args, "WOBJ").cloned();
        let to = match self.named(args, "EXEP").cloned() {
            Some(place) => Frame::of(&self.eval(&place, "ROBTARGET")?)?,
            None => {
                // Where the robot stands, seen without a displacement.
                let args: Vec<Arg> = wobj
                    .map(|value| Arg { option: Some("WOBJ".into()), value: Some(value), conditional: false })
                    .into_iter()
                    .collect();
                let before = std::mem::replace(&mut self.displacement, IDENTITY);
                let standing = self.standing(&args);
                self.displacement = before;
                Frame::of(&standing?)?
            }
        };
        self.displacement = if Self::given(args, "ROT") {
            to.then(&from.inverse())
        } else {
            Frame::shift([to.p[0] - from.p[0], to.p[1] - from.p[1], to.p[2] - from.p[2]])
        };
        Ok(())
    }

    fn data_value(&mut self, name: &str, args: &[Arg]) -> Ran<()> {
        if name == "SETALLDATAVAL" {
            let ty = self.eval(Self::required(args, 0)?, "STRING")?.str()?.to_uppercase();
            let value = self.eval(Self::required(args, 1)?, &ty)?;
            let all: Vec<usize> = (0..self.cells.len())
                .filter(|&c| {
                    let cell = &self.cells[c];
                    cell.ty == ty && cell.storage != Storage::Const && cell.dims == 0 && cell.module != usize::MAX
                })
                .collect();
            for cell in all {
                self.write(&self.whole(cell), value.clone())?;
            }
            return Ok(());
        }
        let object = self.eval(Self::required(args, 0)?, "STRING")?.str()?.to_uppercase();
        let expr = super::syntax::data(&object)?;
        let place = self.place(&expr)?.ok_or_else(|| format!("{object} is not declared"))?;
        if name == "SETDATAVAL" {
            let value = self.eval(Self::required(args, 1)?, &place.ty)?;
            self.write(&place, value)
        } else {
            let value = self.read(&place)?;
            let to = self.slot(Self::required(args, 1)?)?;
            self.write(&to, value)
        }
    }

    fn motion(&mut self, name: &str, layout: &Layout, args: &[Arg], line: u32) -> Ran<()> {
        let tool = self.eval(Self::required(args, layout.tool)?, "TOOLDATA")?;
        let wobj = match self.named(args, "WOBJ").cloned() {
            Some(expr) => self.eval(&expr, "WOBJDATA")?,
            None => self.eval(&Expr::Data(Data { name: "WOBJ0".into(), steps: Vec::new() }), "WOBJDATA")?,
        };
        let to = Self::required(args, layout.to)?;
        let mut shifted = matches!(to, Expr::Call(..));
        let goal = if layout.joints {
            Goal::Joints(self.eval(to, "JOINTTARGET")?.at(0)?.clone())
        } else {
            let mut poses = Vec::new();
            if let Some(via) = layout.via {
                poses.push(Frame::of(&self.eval(Self::required(args, via)?, "ROBTARGET")?)?);
            }
            let target = self.eval(to, "ROBTARGET")?;
            shifted |= self.computed.contains(&target);
            poses.push(Frame::of(&target)?);
            Goal::Poses(poses, target.at(2)?.clone(), target.at(3)?.clone())
        };
        let (module, routine) = self.current();
        let (displacement, offsets) = (self.displacement, self.offsets.clone());
        let speed = self.speed(args, layout.to + 1)?;
        let motion = Motion {
            module,
            line,
            routine,
            kind: name.to_owned(),
            mark: self.mark,
            shifted,
            goal,
            speed,
            tool,
            wobj,
            displacement,
            offsets,
        };
        self.motions.push(motion);
        if layout.signal.is_some() {
            if self.oracle.one_in(4) {
                return Err(Stop::Raise(error_number("ERR_WHLSEARCH").unwrap_or(0)));
            }
            let Some(Motion { goal: Goal::Poses(poses, ..), .. }) = self.motions.last() else { return Ok(()) };
            let mut found = poses[poses.len() - 1];
            let back = 3.0 + self.oracle.number();
            found.p[2] += back;
            let found = self.target(&found);
            let found = self.oracle.place(|_| found);
            let place = self.slot(Self::required(args, 1)?)?;
            self.write(&place, found)?;
        }
        if let Some(routine) = layout.routine {
            let called = self.eval(Self::required(args, routine)?, "STRING")?.str()?.to_uppercase();
            let (module, routine) = self.here(&called).ok_or_else(|| format!("no procedure {called}"))?;
            self.call(module, &routine, &[])?;
        }
        Ok(())
    }

    /// Speed of a motion: `v100` by its name, a record by its first component.
    fn speed(&mut self, args: &[Arg], at: usize) -> Ran<Option<f64>> {
        let Ok(expr) = Self::required(args, at) else { return Ok(None) };
        if let Expr::Data(data) = expr
            && !self.is_bound(&data.name)
        {
            return Ok(data.name.strip_prefix('V').and_then(|number| number.parse().ok()));
        }
        let speed = self.eval(expr, "SPEEDDATA")?;
        Ok(speed.at(0).and_then(Val::num).ok())
    }

    /// An instruction or function of a module that is not at hand: it may do what a procedure there can do.
    pub fn elsewhere(&mut self, args: &[Arg], line: Option<u32>) -> Ran<()> {
        let (mut target, mut tool) = (None, None);
        for arg in args {
            let Some(expr) = &arg.value else { continue };
            match expr {
                Expr::Aggregate(items) if items.len() == 4 => target = Some(self.eval(expr, "ROBTARGET")?),
                Expr::Data(data) => {
                    let Some(place) = self.place(data)? else { continue };
                    match place.ty.as_str() {
                        "ROBTARGET" if place.dims == 0 => target = Some(self.read(&place)?),
                        "TOOLDATA" if place.dims == 0 => tool = Some(self.read(&place)?),
                        _ => {}
                    }
                }
                _ => {}
            }
        }
        if let (Some(target), Some(line)) = (target, line) {
            // With a tool it is a motion of a maker's own, in the frames it is given.
            let own = tool.is_some();
            let wobj = match (self.named(args, "WOBJ").cloned(), own) {
                (Some(expr), _) => self.eval(&expr, "WOBJDATA")?,
                (None, true) => self.eval(&Expr::Data(Data { name: "WOBJ0".into(), steps: Vec::new() }), "WOBJDATA")?,
                (None, false) => self.unknown("WOBJDATA"),
            };
            let tool = tool.unwrap_or_else(|| self.unknown("TOOLDATA"));
            let poses = vec![Frame::of(&target)?];
            let goal = Goal::Poses(poses, target.at(2)?.clone(), target.at(3)?.clone());
            let (displacement, offsets) = (self.displacement, self.offsets.clone());
            let (module, routine) = self.current();
            self.motions.push(Motion {
                module,
                line,
                routine,
                kind: "ELSEWHERE".into(),
                mark: self.mark,
                shifted: false,
                goal,
                speed: None,
                tool,
                wobj,
                displacement,
                offsets,
            });
            if own {
                return Ok(());
            }
        }
        // It may change what it is handed ...
        for arg in args {
            if let Some(Expr::Data(data)) = &arg.value
                && self.oracle.one_in(2)
                && let Some(place) = self.place(data)?
            {
                self.disturb(&place)?;
            }
        }
        // ... the displacement, and what every module sees.
        match self.oracle.below(4) {
            0 => self.displacement = self.oracle.frame(),
            1 => {
                let seen: Vec<usize> = (0..self.cells.len())
                    .filter(|&c| {
                        let cell = &self.cells[c];
                        !cell.local && cell.storage != Storage::Const && cell.module != usize::MAX
                    })
                    .collect();
                if !seen.is_empty() {
                    let at = self.oracle.below(seen.len() as u64) as usize;
                    self.disturb(&self.whole(seen[at]))?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Changes data as another program or an operator would.
    fn disturb(&mut self, place: &Place) -> Ran<()> {
        if self.cells[place.cell].storage == Storage::Const || place.dims > 0 {
            return Ok(());
        }
        let value = self.read(place)?;
        let new = match (place.ty.as_str(), value) {
            ("TOOLDATA" | "WOBJDATA" | "ROBTARGET" | "POSE" | "POS" | "ORIENT" | "BOOL", _) => self.unknown(&place.ty),
            ("NUM", Val::Num(_)) => Val::Num(self.oracle.number()),
            (_, value) => value,
        };
        self.write(place, new)
    }
}
