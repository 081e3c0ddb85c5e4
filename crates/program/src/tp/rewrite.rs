//! Writes corrected poses into the numbers of `/POS`: only signs and digits change. Points between targets are [inserted](super::insert).

use super::Layout;
use super::position::{Body, Pose, WrittenConfig};
use super::written::{DECIMALS, nearest};
use super::{arcs, insert};
use crate::front_end::Wanted;
use crate::orientation::{from_zyx_deg, halfway, quaternion, rotation, zyx_deg};
use crate::shared::{Agreed, agreed, follows};
use crate::token::{New, single};
use crate::{Change, Conf, Editable, Goal, NO_TURN, Program, Reason, RewriteOptions, Rewritten};
use deflex_text::{Content, Edit, Span, Token};
use std::collections::{BTreeMap, BTreeSet};

/// New texts of the tokens of a position; `None` for a token that stays.
#[derive(Clone, Debug, Default, PartialEq)]
struct Print {
    tokens: [Option<Token>; 6],
    turns: [Option<Token>; 3],
    /// The numbers that these texts have.
    values: [f64; 6],
    /// Whether the angles change.
    turned: bool,
}

impl Print {
    fn of(pose: &Pose) -> Self {
        Self { values: pose.values, ..Self::default() }
    }

    fn is_empty(&self) -> bool {
        self.tokens.iter().all(Option::is_none) && self.turns.iter().all(Option::is_none)
    }
}

pub(super) fn rewrite(program: &Program, layout: &Layout, wanted: Wanted<'_>) -> Rewritten {
    let Wanted { inserts, options, .. } = wanted;
    // The changes of positions: motions to one position may end at different distances from it.
    let own = |(i, change): (usize, &Option<Change>)| {
        let quat = change.as_ref().and_then(|change| change.quat);
        let offset = layout.offset(program, i, quat);
        change.clone().map(|change| Change { position_mm: minus(change.position_mm, offset), ..change })
    };
    let changes: Vec<Option<Change>> = wanted.changes.iter().enumerate().map(own).collect();
    let wanted = Wanted { changes: &changes, ..wanted };
    let Agreed { changes, along, .. } = agreed(program, &wanted, |i| layout.sites[i].into_iter().collect());
    // A motion that a register moves with its position holds the position if it cuts, and otherwise its turn numbers: where the motion ends, they
    // may be others.
    let followers = (0..along.len()).filter(|i| follows(program.targets[*i].editable));
    let (free, cutting): (Vec<usize>, Vec<usize>) = followers.partition(|i| along[*i]);
    let frozen = cutting.into_iter().filter_map(|i| Some((layout.sites[i]?, Reason::MovedToo))).collect();
    let followed = free.into_iter().filter_map(|i| layout.sites[i]).collect();
    let mut writer = Writer { program, layout, options, along, frozen, followed };
    let (prints, mut kept) = loop {
        let (prints, kept) = writer.prints(&changes);
        if !writer.freeze(&kept) {
            break (prints, kept);
        }
    };
    kept.sort_unstable();
    let mut edits: Vec<Edit> = Vec::new();
    for (position, print) in layout.positions.iter().zip(&prints) {
        if let (Body::Pose(pose), Some(print)) = (&position.body, print) {
            let turns = pose.config.map_or([Span::default(); 3], |config| config.tokens);
            let all = pose.tokens.iter().zip(&print.tokens).chain(turns.iter().zip(&print.turns));
            edits.extend(all.filter_map(|(span, token)| {
                Some(Edit { span: *span, content: Content::from_slice(token.as_deref()?) })
            }));
        }
    }
    edits.sort_by_key(|edit| edit.span);
    let mut all = vec![Vec::new(); program.written];
    if let Some(first) = all.first_mut() {
        *first = edits;
    }
    let mut written: Vec<_> = (0..program.targets.len()).map(|i| writer.written(i, &prints)).collect();
    for between in &layout.between {
        // Its place follows from the points as they are written.
        let [a, b, c] = between.circle.map(|i| written[i]);
        let (from, to) = if between.first_half { (a, b) } else { (b, c) };
        written[between.target] = (arcs::middle([a.0, b.0, c.0], between.first_half), halfway(from.1, to.1));
    }
    let moves = |i: usize| layout.sites[i].is_some_and(|site| prints[site as usize].is_some());
    let along = (0..writer.along.len()).filter(|i| writer.along[*i] && moves(*i)).collect();
    let mut out = Rewritten { edits: all, written, kept, along, ..Rewritten::default() };
    insert::write(program, layout, inserts, options, &mut out);
    out
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|at| a[at] - b[at])
}

impl Layout {
    /// The distance from its position at which a motion ends, mm (`Offset,PR[1]`), if the position gets this orientation: `Tool_Offset` turns with
    /// the tool.
    fn offset(&self, program: &Program, i: usize, turned: Option<[f64; 4]>) -> [f64; 3] {
        match (program.targets[i].goal, self.sites[i].and_then(|site| self.pose(site))) {
            (Goal::Pose { position_mm, quat, .. }, Some(Pose { values: [x, y, z, ..], .. })) => {
                let offset = minus(position_mm, [*x, *y, *z]);
                let differs = |turned: &[f64; 4]| turned.iter().zip(&quat).any(|(new, old)| new.total_cmp(old).is_ne());
                match turned.filter(|turned| self.in_tool.contains(&i) && differs(turned)) {
                    Some(turned) => {
                        (rotation(turned) * (rotation(quat).inverse() * nalgebra::Vector3::from(offset))).into()
                    }
                    None => offset,
                }
            }
            _ => [0.0; 3],
        }
    }

    fn pose(&self, site: u32) -> Option<&Pose> {
        match &self.positions.get(site as usize)?.body {
            Body::Pose(pose) => Some(pose),
            _ => None,
        }
    }
}

struct Writer<'a> {
    program: &'a Program,
    layout: &'a Layout,
    options: &'a RewriteOptions<'a>,
    /// Whether each target goes where its position goes, without a wish of its own.
    along: Vec<bool>,
    /// Positions that must stay because another motion or another point of their arc must, with the reason.
    frozen: BTreeMap<u32, Reason>,
    /// Positions with which motions move that end elsewhere.
    followed: BTreeSet<u32>,
}

impl Writer<'_> {
    /// The new numbers of each position, on which all motions that use it agree, and the targets whose change is not written.
    fn prints(&self, changes: &[Option<Change>]) -> (Vec<Option<Print>>, Vec<(usize, Reason)>) {
        let mut prints: Vec<Option<Print>> = vec![None; self.layout.positions.len()];
        let (mut kept, mut refused) = (Vec::new(), BTreeSet::new());
        let mut wishes: Vec<(usize, u32, Result<Print, Reason>)> = Vec::new();
        for (i, (site, change)) in self.layout.sites.iter().zip(changes).enumerate().filter(|(i, _)| !self.along[*i]) {
            let target = &self.program.targets[i];
            let pose = site.and_then(|site| Some((site, self.layout.pose(site)?)));
            let wish = match (target.editable, pose, change) {
                (Editable::Pose, Some((site, pose)), change) => {
                    let print =
                        change.as_ref().map_or_else(|| Ok(Print::of(pose)), |change| self.print(i, pose, change));
                    (site, print)
                }
                (Editable::No(why), _, Some(change)) if self.differs(i, change) => {
                    kept.push((i, why));
                    continue;
                }
                _ => continue,
            };
            wishes.push((i, wish.0, wish.1));
        }
        for (_, site, wish) in &wishes {
            let slot = &mut prints[*site as usize];
            match wish {
                Ok(print) if slot.is_none() => *slot = Some(print.clone()),
                Ok(print) if slot.as_ref() == Some(print) => {}
                _ => drop(refused.insert(*site)),
            }
        }
        for (i, site, wish) in wishes {
            let frozen = self.frozen.get(&site).copied();
            if refused.contains(&site) || frozen.is_some() {
                prints[site as usize] = None;
                if changes[i].as_ref().is_some_and(|change| self.differs(i, change)) {
                    kept.push((i, wish.err().or(frozen).unwrap_or(Reason::SharedNumbers)));
                }
            }
        }
        for print in &mut prints {
            print.take_if(|print| print.is_empty());
        }
        (prints, kept)
    }

    /// Keeps the other points of arcs of which one point is kept. Returns whether there are any.
    fn freeze(&mut self, kept: &[(usize, Reason)]) -> bool {
        let count = self.frozen.len();
        let points = &self.layout.points;
        for &(i, _) in kept {
            let arc = points[points.partition_point(|arc| arc.end <= i)..].first().filter(|arc| arc.contains(&i));
            let sites = arc.into_iter().flat_map(|arc| self.layout.sites[arc.clone()].iter().flatten());
            for site in sites {
                self.frozen.entry(*site).or_insert(Reason::Arc);
            }
        }
        self.frozen.len() > count
    }

    /// Whether a change differs from the present numbers.
    fn differs(&self, i: usize, change: &Change) -> bool {
        let Goal::Pose { position_mm, quat, conf } = self.program.targets[i].goal else { return true };
        let own = minus(position_mm, self.layout.offset(self.program, i, None));
        let is_other = change.differs(&Goal::Pose { position_mm: own, quat, conf });
        is_other || change.conf.is_some() && change.conf != conf
    }

    /// New tokens of a position for the change of one motion.
    fn print(&self, i: usize, pose: &Pose, change: &Change) -> Result<Print, Reason> {
        let mut print = Print::of(pose);
        let Goal::Pose { quat, .. } = self.program.targets[i].goal else { return Ok(print) };
        let put = |print: &mut Print, at: usize, value: f64| {
            let old = self.program.sources[0].slice(pose.tokens[at]);
            let new = New::of(old, value, DECIMALS.min(self.options.position_decimals));
            (print.tokens[at], print.values[at]) = (new.token, new.value.unwrap_or(value));
        };
        for (at, value) in change.position_mm.into_iter().enumerate() {
            put(&mut print, at, value);
        }
        if let Some(wanted) = change.turn(quat) {
            let [r, p, w] = zyx_deg(&rotation(wanted));
            let [w0, p0, r0] = [pose.values[3], pose.values[4], pose.values[5]];
            for (at, value) in nearest([w, p, r], [w0, p0, r0]).into_iter().enumerate() {
                put(&mut print, 3 + at, value);
            }
            print.turned = true;
        }
        if let (Some(Conf::Turns(wanted)), Some(written)) = (change.conf, pose.config) {
            if self.layout.sites[i].is_some_and(|site| self.followed.contains(&site)) {
                return Err(Reason::TurnsChange);
            }
            self.turns(&mut print, written, wanted.posture, wanted.turns)?;
        }
        Ok(print)
    }

    /// New turn numbers. The letters of CONFIG are never edited, so a position that needs other letters is kept.
    fn turns(&self, print: &mut Print, written: WrittenConfig, posture: i32, turns: [i32; 3]) -> Result<(), Reason> {
        if posture != written.config.posture {
            return Err(Reason::ConfigChanges);
        }
        for (at, turn) in turns.into_iter().enumerate() {
            let old = self.program.sources[0].slice(written.tokens[at]);
            print.turns[at] = New::of(old, f64::from(turn), 0).token;
        }
        Ok(())
    }

    /// A target as the controller will store it: the printed numbers in single precision.
    fn written(&self, i: usize, prints: &[Option<Print>]) -> ([f64; 3], [f64; 4]) {
        let Goal::Pose { position_mm, quat, .. } = self.program.targets[i].goal else {
            return ([0.0; 3], NO_TURN);
        };
        let Some(site) = self.layout.sites[i] else { return (position_mm, quat) };
        let print = prints[site as usize].as_ref();
        let Some(values) = print.map(|print| print.values).or_else(|| Some(self.layout.pose(site)?.values)) else {
            return (position_mm, quat);
        };
        let [x, y, z, w, p, r] = values.map(single);
        let turned = print.filter(|print| print.turned).map(|_| quaternion(&from_zyx_deg([r, p, w])));
        let [dx, dy, dz] = self.layout.offset(self.program, i, turned);
        ([x + dx, y + dy, z + dz], turned.unwrap_or(quat))
    }
}
