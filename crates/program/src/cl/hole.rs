//! Drilling cycles as motions.
//!
//! Under a cycle each position is the mouth of a hole: rapid travel over it and down to the clearance, feed to the depth (in pecks), dwell,
//! retraction. Sources: Creo's "CL Output for Holemaking Cycles" (couplets `DEPTH`, `CLEAR`, `RAPTO`, `RETURN`, `STEP`, and
//! the fixed format), NX and SolidWorks CAM files (`RAPTO`, `FEDTO`, `RTRCTO`, `1STPECK`, `SUBPECK`), ISO 4343 and Autodesk's
//! APT post (depth, feed with its unit, clearance). If these differ, feed begins at the higher position, which is slow and safe.

use super::dialect::Dialect;
use super::layout::{GroupSlot, Slot};
use super::lex::{Record, Token, TokenKind};
use super::modal::{Feed, Xyz, feed_unit};
use super::motion::TargetProperties;
use super::reader::Reader;
use super::refusal::Outcome;
use super::state::Hole;
use super::statement::Statement;
use super::vector::{add, dot, norm, scale, sub};
use crate::{Reason, Role};

/// Height above the last peck at which rapid travel ends, and by which a broken chip is lifted, mm: the default of controls.
const PECK_GAP_MM: f64 = 1.0;

/// Most pecks of a hole; more come from a wrong number.
const MOST_PECKS: usize = 1000;

/// Motions shorter than this share of the hole's depth are left out.
const NO_MOVE: f64 = 1e-9;

/// How a cycle is performed.
#[derive(Clone, Copy, PartialEq)]
enum Style {
    /// Down, up.
    Drill,
    /// In pecks, out of the hole between them.
    Deep,
    /// In pecks, within the hole.
    BreakChips,
    /// Out with feed.
    FeedOut,
    /// Only a motion to the position.
    Mill,
}

/// The values of a `CYCLE`.
#[derive(Default)]
struct CycleWords {
    depth: Option<f64>,
    clear: Option<f64>,
    rapto: Option<f64>,
    retract: Option<f64>,
    /// The first peck and those after it.
    pecks: Vec<f64>,
    feed: Option<Feed>,
    dwell: f64,
}

impl Reader {
    /// `CYCLE/…`: the meaning of the following positions.
    pub(super) fn define_cycle(&mut self, s: &Statement) -> Outcome {
        self.cycle.initial = None;
        self.cycle.refused = false;
        self.cycle.active = None;
        let words: Vec<Vec<u8>> = s.words().map(<[u8]>::to_ascii_uppercase).collect();
        match &words.iter().map(Vec::as_slice).collect::<Vec<_>>()[..] {
            [] if s.items.is_empty() => return Ok(()),
            [b"OFF" | b"NOMORE" | b"INIT"] => return Ok(()),
            [b"ON"] => {
                self.cycle.active = Some(self.cycle.last.clone().ok_or(Reason::CycleBefore)?);
                return Ok(());
            }
            _ => {}
        }
        match self.hole(s) {
            Ok(hole) => {
                self.cycle.last.clone_from(&hole);
                self.cycle.active = hole;
                Ok(())
            }
            Err(why) => {
                self.cycle.refused = true;
                Err(why)
            }
        }
    }

    /// The cycle that a statement defines; none for plain positions.
    fn hole(&self, s: &Statement) -> Result<Option<Hole>, Reason> {
        let tokens: Vec<&Token> = s.items.iter().filter(|t| t.kind != TokenKind::Comma).collect();
        let (style, rest) = style(s.bytes, &tokens)?;
        if style == Style::Mill {
            return Ok(None);
        }
        let stated = self.words_of_cycle(s.bytes, rest, style)?;
        let depth = stated.depth.map(f64::abs).filter(|d| *d > 0.0).ok_or(Reason::CycleForm)?;
        // Creo counts RAPTO from the clearance towards the part, the others from the part.
        let (approach, clear) = match (stated.clear, stated.rapto) {
            (Some(clear), Some(rapto)) if self.dialect == Dialect::Creo => (clear, clear - rapto),
            (Some(clear), Some(rapto)) => (clear.max(rapto), clear.max(rapto)),
            (Some(height), None) | (None, Some(height)) => (height, height),
            (None, None) => return Err(Reason::CycleForm),
        };
        // No CAM system intends rapid travel into the part.
        if approach < 0.0 || clear < 0.0 || stated.retract.is_some_and(|r| r < 0.0) || stated.dwell < 0.0 {
            return Err(Reason::CycleForm);
        }
        let peck = match (style, &stated.pecks[..]) {
            (Style::Deep | Style::BreakChips, [first, rest @ ..]) => {
                Some((*first, rest.last().copied().unwrap_or(*first)))
            }
            (Style::Deep | Style::BreakChips, []) => return Err(Reason::CycleForm),
            _ => None,
        };
        // An explicit 0 leaves it to the machine (Creo): the height from which the tool came.
        let retract = match stated.retract {
            Some(height) if height > 0.0 => Some(height.max(clear)),
            Some(_) => None,
            None => Some(approach),
        };
        Ok(Some(Hole {
            clear,
            approach,
            retract,
            depth,
            pecks: pecks(depth, peck)?,
            breaks_chips: style == Style::BreakChips,
            feeds_out: style == Style::FeedOut,
            feed: stated.feed,
            dwell: stated.dwell,
        }))
    }

    /// Reads keywords with their numbers, and numbers by their order.
    fn words_of_cycle(&self, bytes: &[u8], tokens: &[&Token], style: Style) -> Result<CycleWords, Reason> {
        let mut stated = CycleWords::default();
        let mut numbers: Vec<f64> = Vec::new();
        let mut unit: Option<(Vec<u8>, usize)> = None;
        let mut tokens = tokens.iter().peekable();
        while let Some(token) = tokens.next() {
            if token.kind == TokenKind::Number {
                numbers.push(token.value);
                continue;
            }
            if token.kind != TokenKind::Word {
                return Err(Reason::CycleForm);
            }
            let word = bytes[token.span.range()].to_ascii_uppercase();
            let mut value = || -> Result<f64, Reason> {
                let number = tokens.next_if(|t| t.kind == TokenKind::Number);
                number.map(|t| t.value).ok_or(Reason::CycleForm)
            };
            match word.as_slice() {
                b"DEPTH" | b"FEDTO" => stated.depth = Some(value()?),
                b"CLEAR" => stated.clear = Some(value()?),
                b"RAPTO" => stated.rapto = Some(value()?),
                b"RTRCTO" | b"RETURN" => {
                    // `AUTO` and `MANUAL` come with or without a height (NX).
                    stated.retract = value().ok().or(stated.retract);
                    while tokens.next_if(|t| is_mode_of_retraction(bytes, t)).is_some() {}
                }
                b"STEP" | b"INCR" | b"1STPECK" | b"SUBPECK" => {
                    stated.pecks.push(value()?);
                    while let Some(more) = tokens.next_if(|t| t.kind == TokenKind::Number && word == b"STEP") {
                        stated.pecks.push(more.value);
                    }
                }
                b"DWELL" => {
                    stated.dwell = value()?;
                    if tokens.next_if(|t| bytes[t.span.range()].eq_ignore_ascii_case(b"REV")).is_some() {
                        let rpm = self.modal.rpm().ok_or(Reason::DwellWithoutSpindle)?;
                        stated.dwell *= 60.0 / rpm;
                    }
                }
                _ if feed_unit(&word, self.mm_per_unit()).is_some() && unit.is_none() => {
                    unit = Some((word, numbers.len()));
                }
                _ => return Err(Reason::CycleForm),
            }
        }
        let feed = |unit: &[u8], value: f64| feed_unit(unit, self.mm_per_unit()).map(|unit| unit.feed(value));
        match (unit, &numbers[..]) {
            // Couplets: the remaining number is the feed after its unit.
            (Some((unit, 0)), &[value]) if stated.depth.is_some() => stated.feed = feed(&unit, value),
            (None, []) if stated.depth.is_some() => {}
            // Depth, unit, feed[, clearance], or depth, feed, unit, clearance[, peck]. CATIA has more numbers before the unit, in an order that the file does not state.
            (Some((unit, 1 | 2)), &[depth, value, ref more @ ..]) if stated.depth.is_none() => {
                stated.depth = Some(depth);
                stated.feed = feed(&unit, value);
                clearance_and_peck(&mut stated, more, style)?;
            }
            _ => return Err(Reason::CycleForm),
        }
        if stated.feed.is_some_and(|feed| !feed.is_positive()) {
            return Err(Reason::NoFeed);
        }
        Ok(stated)
    }

    /// Adds the motions at a hole whose mouth is at a printed position, with the tool axis of the modal state.
    pub(super) fn drill(&mut self, record: Record, hole: &Hole, xyz: Xyz, mouth: [f64; 3], axis_before: [f64; 3]) {
        let axis = self.modal.axis;
        let feed_mm_s = match hole.feed {
            Some(feed) => feed.mm_s(self.modal.rpm()),
            None => self.modal.feed_mm_s(),
        };
        if feed_mm_s.is_none() {
            self.refuse(record, Reason::CycleFeed);
        }
        self.modal.rapid = false;
        self.ordinal += 1;
        let group = u32::try_from(self.layout.groups.len()).unwrap_or(u32::MAX);
        let first = self.targets.len();
        self.layout.groups.push(GroupSlot { first, centres: [None; 2], straight: false, with_start: false });
        let at = |height: f64| add(mouth, scale(axis, height));
        let (on_way, rapid, fed) = (Slot::OnWay { group }, (true, None), (false, feed_mm_s));
        let go = |reader: &mut Self, point: [f64; 3], (rapid, feed_mm_s): (bool, Option<f64>)| {
            let step = TargetProperties { role: Role::Interpolated, ahead: 0, slot: on_way, rapid, feed_mm_s };
            reader.push(record, point, step);
        };

        // Over the hole: up first if it is higher, across first if it is lower.
        if let Some(from) = self.modal.position.filter(|_| norm(sub(axis, axis_before)) < NO_MOVE) {
            let height = dot(sub(from, mouth), axis);
            self.cycle.initial.get_or_insert(height);
            let across = norm(sub(sub(from, mouth), scale(axis, height)));
            if across > NO_MOVE * hole.depth && height < hole.approach {
                go(self, add(from, scale(axis, hole.approach - height)), rapid);
            } else if across > NO_MOVE * hole.depth && height > hole.approach {
                go(self, at(height), rapid);
            }
        }
        go(self, at(hole.approach), rapid);
        if hole.clear < hole.approach {
            go(self, at(hole.clear), rapid);
        }
        let gap = PECK_GAP_MM / self.mm_per_unit();
        let mut drilled = 0.0;
        for (i, &depth) in hole.pecks.iter().enumerate() {
            if i > 0 && hole.breaks_chips {
                go(self, at(-(drilled - gap).max(0.0)), rapid);
            } else if i > 0 {
                go(self, at(hole.clear), rapid);
                go(self, at(-(drilled - gap).max(0.0)), rapid);
            }
            if i + 1 < hole.pecks.len() {
                go(self, at(-depth), fed);
            }
            drilled = depth;
        }
        let slot = Slot::GroupEnd { xyz, frame: self.frame, group };
        self.push(
            record,
            at(-hole.depth),
            TargetProperties { role: Role::End, ahead: 0, slot, rapid: false, feed_mm_s },
        );
        if hole.dwell > 0.0 {
            self.machine.dwell(hole.dwell, record);
        }
        let retract = hole.retract.unwrap_or_else(|| self.cycle.initial.map_or(hole.clear, |h| h.max(hole.clear)));
        if hole.feeds_out {
            go(self, at(hole.clear), fed);
        }
        if !hole.feeds_out || retract > hole.clear {
            go(self, at(retract), rapid);
        }
        self.modal.position = Some(at(retract));
        self.modal.fed = None;
    }
}

/// Numbers after depth and feed.
fn clearance_and_peck(stated: &mut CycleWords, numbers: &[f64], style: Style) -> Outcome {
    match *numbers {
        [] => {}
        [clear] if stated.clear.is_none() => stated.clear = Some(clear),
        [clear, peck] if stated.clear.is_none() && matches!(style, Style::Deep | Style::BreakChips) => {
            stated.clear = Some(clear);
            stated.pecks.push(peck);
        }
        _ => return Err(Reason::CycleForm),
    }
    Ok(())
}

fn is_mode_of_retraction(bytes: &[u8], token: &Token) -> bool {
    let text = &bytes[token.span.range()];
    [&b"AUTO"[..], b"MANUAL", b"ON"].iter().any(|word| text.eq_ignore_ascii_case(word))
}

/// Reads the words of the style. Returns the remaining items, which have the lengths.
fn style<'t, 's>(bytes: &[u8], tokens: &'t [&'s Token]) -> Result<(Style, &'t [&'s Token]), Reason> {
    let mut style = None;
    for (i, token) in tokens.iter().enumerate() {
        let word = bytes[token.span.range()].to_ascii_uppercase();
        let more = match word.as_slice() {
            b"DRILL" | b"FACE" | b"CSINK" | b"CBORE" | b"SPOT" | b"SPOTDR" | b"SPDRL" => Style::Drill,
            b"DEEP" | b"DEEP2" | b"DEEPHL" | b"PECK" => Style::Deep,
            b"BRKCHP" | b"CHPBRK" => Style::BreakChips,
            b"REAM" | b"BORE" => Style::FeedOut,
            b"MILL" => Style::Mill,
            b"TAP" | b"RTAP" | b"MAGTAP" => return Err(Reason::Tapping),
            b"THRU" | b"BOREOR" | b"BOREBK" | b"BACK" | b"BORBK" => return Err(Reason::CycleKind),
            _ => return Ok((style.ok_or(Reason::CycleForm)?, &tokens[i..])),
        };
        // `DRILL,DEEP`: the second word is the style (NX).
        style = match style {
            None | Some(Style::Drill) => Some(more),
            Some(_) => return Err(Reason::CycleForm),
        };
    }
    Ok((style.ok_or(Reason::CycleForm)?, &[]))
}

/// Depths of pecks, rising: a first peck, then equal ones.
fn pecks(depth: f64, peck: Option<(f64, f64)>) -> Result<Vec<f64>, Reason> {
    let Some((first, further)) = peck else { return Ok(vec![depth]) };
    if !(first > 0.0 && further > 0.0) {
        return Err(Reason::CycleForm);
    }
    let mut depths = Vec::new();
    let mut next = first;
    while next < depth * (1.0 - NO_MOVE) {
        depths.push(next);
        next += further;
        if depths.len() > MOST_PECKS {
            return Err(Reason::CycleForm);
        }
    }
    depths.push(depth);
    Ok(depths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pecks_end_at_the_depth() {
        assert_eq!(pecks(10.0, None).unwrap(), [10.0]);
        assert_eq!(pecks(10.0, Some((4.0, 3.0))).unwrap(), [4.0, 7.0, 10.0]);
        assert_eq!(pecks(10.0, Some((4.0, 4.0))).unwrap(), [4.0, 8.0, 10.0]);
        assert!(pecks(10.0, Some((0.0, 3.0))).is_err());
        assert!(pecks(10.0, Some((1e-9, 1e-9))).is_err());
    }
}
