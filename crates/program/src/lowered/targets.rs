//! Makes targets of the motions of a run.

use super::{Layout, PoseSource, Style};
use crate::ends::Ends;
use crate::kept::KeptStatements;
use crate::{
    ArcTurn, Conf, Editable, Goal, Language, Mark, Motion, Passing, Predecessor, Program, Reason, Role, Target, Tool,
    ToolData, UnknownMotion, Wobj,
};
use deflex_lang::dialect::Dialect;
use deflex_lang::ir::{self, Path, SourceSpan, Switch};
use deflex_lang::run::{Moved, run};
use deflex_lang::shared::editable;
use deflex_lang::value::{Content, Pose, Value};
use deflex_text::{Diagnostic, Severity, Source, Span};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

const ENDLESS: &str =
    "the program does not end within 5 million statements, or its loops make more than 200,000 motions";

/// The error for a program that is too long to be run.
pub(crate) fn endless(source: &Source) -> Diagnostic {
    Diagnostic::error("program.endless", &source.name, ENDLESS).help("split it into several programs")
}

/// The properties of a language on which the reading of its files depends.
pub(crate) struct Lowering {
    pub(crate) language: Language,
    pub(crate) style: &'static Style,
    pub(crate) parse: fn(&[&[u8]], usize) -> Result<ir::Program, ir::Fault>,
    /// Codes of the errors for a file that is too large, for one that is no text, and for one in another language.
    pub(crate) codes: [&'static str; 3],
    /// Text for a file that is no text: what was expected, and which file to give.
    pub(crate) expected: &'static str,
    pub(crate) which: &'static str,
    /// Text for a file in another language: what to do.
    pub(crate) again: &'static str,
    /// Finds the system that wrote the files.
    pub(crate) dialect: fn(&[Source]) -> &'static str,
    pub(crate) warnings: fn(&[Source]) -> Vec<Diagnostic>,
}

/// Reads files as one program, and makes targets of the motions of its run; `context` files only define routines.
pub(crate) fn read(
    lowering: &Lowering,
    mut sources: Vec<Source>,
    context: Vec<Source>,
) -> Result<Program, Vec<Diagnostic>> {
    let written = sources.len();
    sources.extend(context);
    if let Some(error) = sources.iter().find_map(|source| refused(source, lowering)) {
        return Err(error.into());
    }
    let texts: Vec<&[u8]> = sources.iter().map(|source| &source.bytes[..]).collect();
    let program = (lowering.parse)(&texts, written).map_err(|fault| {
        let source = &sources[usize::from(fault.place.source)];
        let error = Diagnostic::error(lowering.codes[2], &source.name, fault.message).at(source, fault.place.span);
        Vec::from(error.help(lowering.again))
    })?;
    build(lowering, &program, sources, written)
}

/// Runs a program and makes targets of its motions.
fn build(
    lowering: &Lowering,
    program: &ir::Program,
    sources: Vec<Source>,
    written: usize,
) -> Result<Program, Vec<Diagnostic>> {
    let style = lowering.style;
    let Ok(mut outcome) = run(program, style.dialect) else { return Err(endless(&sources[0]).into()) };
    // Numbers in a context file are never edited.
    for (at, token) in program.tokens.iter().enumerate() {
        let before = &sources[usize::from(token.source)].bytes[..token.span.start as usize];
        if usize::from(token.source) >= written {
            outcome.used.insert(ir::TokenId(at as u32), Reason::InContextFile);
        } else if !may_have_sign(before) {
            outcome.used.insert(ir::TokenId(at as u32), Reason::Computed);
        }
    }
    let edits = editable(&outcome);
    let mut builder = Builder {
        style,
        tools: Vec::new(),
        wobjs: Vec::new(),
        set: Vec::new(),
        targets: Vec::new(),
        sites: Vec::new(),
        passings: Vec::new(),
        unknown: Vec::new(),
        kept: KeptStatements::new(&sources, sources.len()),
        arcs: Vec::new(),
        ordinal: 0,
        last: None,
        ends: Ends::default(),
    };
    for (i, (motion, edit)) in outcome.motions.iter().zip(edits).enumerate() {
        let previous = i.checked_sub(1).filter(|before| builder.last == Some(*before)).is_some();
        if builder.motion(motion, edit, previous) {
            builder.last = Some(i);
        }
    }
    let ran: BTreeSet<SourceSpan> = outcome.motions.iter().map(|motion| motion.place).collect();
    for place in motions(program).filter(|place| usize::from(place.source) < written && !ran.contains(place)) {
        builder.kept.keep(place.source.into(), place.span, Reason::NotReached);
    }
    for place in &program.not_understood {
        builder.kept.keep(place.source.into(), place.span, Reason::NotUnderstood);
    }
    let mut diagnostics = (lowering.warnings)(&sources[..written]);
    diagnostics.extend(not_given(program, &sources, style.dialect));
    diagnostics.extend(builder.without_mass(lowering.language));
    let Builder { tools, wobjs, targets, sites, passings, unknown, kept, arcs, ordinal, .. } = builder;
    let dialect = (lowering.dialect)(&sources[..written]);
    let motions = ordinal as usize;
    let layout = Layout { style, tokens: program.tokens.clone(), sites, arcs, passings, motions };
    Ok(Program {
        tools,
        wobjs,
        targets,
        unknown,
        kept: kept.in_order(),
        literal_targets: literals(program, written),
        arcs: layout.arcs.len(),
        diagnostics,
        ..Program::empty(lowering.language, dialect, (sources.into(), written), crate::Layout::Lowered(layout))
    })
}

/// The places of all motions in the text.
fn motions(program: &ir::Program) -> impl Iterator<Item = SourceSpan> {
    let mut places = Vec::new();
    for statement in program.functions.iter().flat_map(|function| &function.body) {
        statement.each(&mut |statement| {
            places.extend(matches!(statement.kind, ir::StatementKind::Move(_)).then_some(statement.place));
        });
    }
    places.into_iter()
}

/// Whether a negative number may follow this text: not directly after an operator.
fn may_have_sign(before: &[u8]) -> bool {
    before.trim_ascii_end().last().is_none_or(|b| matches!(b, b'[' | b'(' | b',' | b'=' | b'\n' | b';' | b':'))
}

/// Why a file as a whole is not read as a program of a language.
fn refused(source: &Source, lowering: &Lowering) -> Option<Diagnostic> {
    let [too_large, no_text, _] = lowering.codes;
    let whole = |code, message: &str, at: usize| {
        let end = (at + 1).min(source.bytes.len());
        Diagnostic::error(code, &source.name, message).at(source, Span { start: at as u32, end: end as u32 })
    };
    if u32::try_from(source.bytes.len()).is_err() {
        return Some(whole(too_large, "file is larger than 4 GiB", 0).help("split it"));
    }
    let at = deflex_text::no_text(&source.bytes)?;
    Some(whole(no_text, &format!("the file is not text: expected {}", lowering.expected), at).help(lowering.which))
}

/// Number of poses in the text whose numbers are all literals.
fn literals(program: &ir::Program, written: usize) -> usize {
    let mut places = BTreeSet::new();
    for function in &program.functions {
        for statement in &function.body {
            statement.each(&mut |statement| {
                for expression in statement.expressions() {
                    expression.each(&mut |part| {
                        if let ir::ExpressionKind::Pose(items, _) = &part.kind {
                            let literal = items.iter().all(|item| matches!(item.kind, ir::ExpressionKind::Number(..)));
                            places.extend((literal && usize::from(part.place.source) < written).then_some(part.place));
                        }
                    });
                }
            });
        }
    }
    places.len()
}

/// A warning for called routines that are in no file, at the first of them.
fn not_given(program: &ir::Program, sources: &[Source], dialect: &dyn Dialect) -> Option<Diagnostic> {
    /// Most names in the message; the others are only counted.
    const SHOWN: usize = 8;
    let (_, first) = program.foreign.first()?;
    let mut listed: Vec<&str> = program.foreign.iter().take(SHOWN).map(|(name, _)| &**name).collect();
    let more = format!("{} more", program.foreign.len().saturating_sub(SHOWN));
    if program.foreign.len() > SHOWN {
        listed.push(&more);
    }
    let source = &sources[usize::from(first.source)];
    let is_tool_left = dialect.left_by_foreign().contains(&Switch::Tool);
    let changed = if is_tool_left { "every variable and shift" } else { "the tool and every global variable" };
    let message = format!("these routines are in no file, and may change {changed}: {}", listed.join(", "));
    let help = "give the files that define them with --context, or name those that do not change them in `[controller] harmless` of the cell";
    let warning = Diagnostic::error("program.called", &source.name, message).at(source, first.span);
    Some(warning.severity(Severity::Warning).help(help))
}

struct Builder<'a> {
    style: &'static Style,
    tools: Vec<Tool>,
    wobjs: Vec<Wobj>,
    /// The values to which each tool was set.
    set: Vec<(Content, Content)>,
    targets: Vec<Target>,
    sites: Vec<Option<PoseSource>>,
    passings: Vec<Passing>,
    unknown: Vec<UnknownMotion>,
    kept: KeptStatements,
    /// Targets of each circle.
    arcs: Vec<Range<usize>>,
    ordinal: u32,
    /// The last motion that gave a target.
    last: Option<usize>,
    ends: Ends<'a>,
}

impl<'a> Builder<'a> {
    /// Adds a motion. Returns whether it has a target.
    fn motion(&mut self, motion: &'a Moved, editable: Editable, follows: bool) -> bool {
        self.ordinal += 1;
        match self.points(motion, editable, follows) {
            Ok(()) => true,
            Err(reason) => {
                let SourceSpan { source, span } = motion.place;
                self.unknown.push(self.kept.unknown_motion(self.ordinal, source, span, reason));
                self.kept.keep(source.into(), span, reason);
                false
            }
        }
    }

    fn points(&mut self, motion: &'a Moved, editable: Editable, follows: bool) -> Result<(), Reason> {
        let switch = |switch: Switch| &motion.switches[switch as usize];
        if motion.in_thread {
            return Err(Reason::InThread);
        }
        if let Path::Unknown(why) = motion.path {
            return Err(why);
        }
        for value in motion.via.iter().chain([&motion.to]) {
            if let Some(why) = value.reason() {
                return Err(why);
            }
        }
        for (of, why) in
            [(Switch::Tool, Some(Reason::Tool)), (Switch::Frame, Some(Reason::Frame)), (Switch::Shift, None)]
        {
            if let Some(reason) = switch(of).reason() {
                return Err(why.unwrap_or(reason));
            }
        }
        let (to, joints) = self.goal(&motion.to).ok_or(Reason::Computed)?;
        let path = match (motion.path, joints) {
            (Path::Joint, true) => Motion::AbsoluteJoint,
            (Path::Joint, false) => Motion::Joint,
            (Path::Circular | Path::Tangent, true) => return Err(Reason::CircleThroughAxes),
            (Path::Circular | Path::Tangent, false) => Motion::Circular,
            _ => Motion::Linear,
        };
        let via = match (&motion.via, path) {
            (Some(via), Motion::Circular) => match self.goal(via) {
                Some((goal, false)) => Some(goal),
                _ => return Err(Reason::CircleThroughAxes),
            },
            (None, Motion::Circular) if self.style.tool == "TCP" => {
                return Err(Reason::CircleWithoutPoint);
            }
            _ => None,
        };
        let frames = self.frames(motion)?;
        let first = self.targets.len();
        let mark = match &switch(Switch::Mark).content {
            Content::Text(word) if **word == *b"air" => Some(Mark::Air),
            Content::Text(word) if **word == *b"cut" => Some(Mark::Cut),
            _ => None,
        };
        let is_path = matches!(path, Motion::Linear | Motion::Circular);
        let line = self.kept.line(motion.place.source, motion.place.span);
        let end = Target {
            feed_mm_s: motion.speed.filter(|_| is_path).map(|speed| speed * self.style.mm),
            mark,
            editable,
            extra_load: switch(Switch::Load).reason().is_some(),
            predecessor: match motion.from {
                Predecessor::Previous if !follows => Predecessor::Unknown,
                from => from,
            },
            arc_turn: (motion.path == Path::Tangent).then_some(ArcTurn::Fixed),
            ..Target::new(self.ordinal, path, to, frames, motion.place, line)
        };
        if let Some(goal) = via {
            let via = Target { role: Role::Via, goal, ..end.clone() };
            self.put(via, motion.via.as_ref(), Passing::Unstated);
        }
        let circle = path == Motion::Circular && motion.via.is_some();
        let mut end = if circle { Target { predecessor: Predecessor::Previous, ..end } } else { end };
        end.begin_at(self.ends.begin_of(motion));
        self.ends.add(motion, &end);
        let passing = match motion.blend {
            Some(radius) if radius <= 0.0 => Passing::Stop,
            Some(radius) => Passing::Zone(radius * self.style.mm),
            None => Passing::Unstated,
        };
        self.put(end, Some(&motion.to), passing);
        if circle {
            self.arcs.push(first..self.targets.len());
        }
        if let (Editable::No(why), false) = (editable, path == Motion::AbsoluteJoint) {
            self.kept.keep(motion.place.source.into(), motion.place.span, why);
        }
        Ok(())
    }

    fn put(&mut self, target: Target, value: Option<&Value>, passing: Passing) {
        let site = value.and_then(Value::pose).filter(|_| !matches!(target.editable, Editable::No(_))).and_then(site);
        self.targets.push(target);
        self.sites.push(site);
        self.passings.push(passing);
    }

    /// A value as a goal, and whether it is axis angles.
    fn goal(&self, value: &Value) -> Option<(Goal, bool)> {
        let deg = |angles: &[f64]| <[f64; 6]>::try_from(angles).ok().map(|angles| angles.map(|a| a * self.style.deg));
        let posed = |pose: &Pose, conf| {
            let pose = pose.pose();
            let position_mm = (pose.translation.vector * self.style.mm).into();
            let quat = crate::orientation::quaternion(&pose.rotation.to_rotation_matrix());
            (Goal::Pose { position_mm, quat, conf }, false)
        };
        Some(match &value.content {
            Content::Pose(pose) => posed(pose, None),
            Content::AxesOf(axes) => {
                let near = axes.near.as_ref().map(|near| deg(near).ok_or(())).transpose().ok()?;
                posed(&axes.pose, near.map(Conf::near))
            }
            Content::List(_) => (Goal::Joints { deg: deg(&value.numbers()?)? }, true),
            _ => return None,
        })
    }

    /// Indices of tool and work object.
    fn frames(&mut self, motion: &Moved) -> Result<[u16; 2], Reason> {
        if let Some(given) = motion.to.pose().and_then(|pose| pose.given.as_ref()) {
            let tool = intern(&mut self.tools, Tool { name: Arc::clone(&given.tool), data: None });
            let wobj = Wobj { name: Arc::clone(&given.frame), data: None, unit: None };
            return Ok([tool, intern(&mut self.wobjs, wobj)]);
        }
        let [tool, load, frame] =
            [Switch::Tool, Switch::Load, Switch::Frame].map(|switch| &motion.switches[switch as usize]);
        // The pose is that of the TCP for which the angles were computed. With another tool the motion ends elsewhere.
        if let Content::AxesOf(axes) = &motion.to.content
            && axes.tool != tool.pose().map(Pose::pose)
        {
            return Err(Reason::Tool);
        }
        let named = |value: &Value| match &value.content {
            Content::Text(name) => Some(String::from_utf8_lossy(name).into_owned()),
            _ => None,
        };
        let tool = match (tool.pose(), named(tool)) {
            (_, Some(name)) => intern(&mut self.tools, Tool { name: name.into(), data: None }),
            (None, None) => intern(&mut self.tools, Tool { name: self.style.tool.into(), data: None }),
            (Some(pose), None) => {
                let known = (content_of(pose), load.content.clone());
                let at = self.set.iter().position(|set| *set == known).unwrap_or_else(|| {
                    self.set.push(known);
                    self.set.len() - 1
                });
                let name = Arc::from(format!("{} {}", self.style.tool, at + 1));
                let tool = Tool { name, data: Some(self.tool_data(pose, load)) };
                intern(&mut self.tools, tool)
            }
        };
        let name = named(frame).map_or_else(|| self.style.frame.into(), Arc::from);
        Ok([tool, intern(&mut self.wobjs, Wobj { name, data: None, unit: None })])
    }

    fn tool_data(&self, pose: &Pose, load: &Value) -> ToolData {
        let pose = pose.pose();
        let held = match &load.content {
            Content::List(two) => two.first().and_then(Value::number).zip(two.get(1).and_then(Value::numbers)),
            _ => None,
        };
        let (mass_kg, cog) = held.unwrap_or_default();
        let cog = <[f64; 3]>::try_from(cog).unwrap_or_default();
        ToolData {
            robhold: true,
            tcp_mm: (pose.translation.vector * self.style.mm).into(),
            tcp_quat: crate::orientation::quaternion(&pose.rotation.to_rotation_matrix()),
            mass_kg,
            cog_mm: cog.map(|c| c * self.style.mm),
        }
    }

    /// A note for tools for which the program sets the frame and not the mass.
    fn without_mass(&self, language: Language) -> Option<Diagnostic> {
        let light = self.tools.iter().find(|tool| tool.data.is_some_and(|data| data.mass_kg == 0.0))?;
        let message = format!("the program does not say the mass of `{}`: taken as 0 kg", light.name);
        let help =
            format!("{} programs say it with set_payload; it counts only with a `gravity` effect", language.name());
        Some(Diagnostic::error("program.no-mass", "", message).severity(Severity::Note).help(help))
    }
}

fn content_of(pose: &Pose) -> Content {
    Content::Pose(Arc::new(Pose::constant(pose.pose())))
}

/// The index of a value in a list, to which it is added if it is missing.
pub(crate) fn intern<T: PartialEq>(known: &mut Vec<T>, wanted: T) -> u16 {
    let at = known.iter().position(|known| *known == wanted).unwrap_or_else(|| {
        known.push(wanted);
        known.len() - 1
    });
    u16::try_from(at).unwrap_or(u16::MAX)
}

/// The places of the numbers of a pose.
fn site(pose: &Pose) -> Option<PoseSource> {
    let numbers: Vec<f64> = pose.numbers.iter().map(|value| value.number()).collect::<Option<_>>()?;
    let affine = std::array::from_fn(|at| pose.affine(at));
    Some(PoseSource { left: pose.left, right: pose.right, own: pose.own, numbers: numbers.try_into().ok()?, affine })
}
