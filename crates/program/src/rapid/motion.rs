//! The motion instructions, and the positions of their arguments.

use crate::Motion;

/// The positions of a motion's arguments, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) motion: Motion,
    /// Circle point.
    pub(super) via: Option<usize>,
    /// The target; the speed follows it.
    pub(super) to: usize,
    pub(super) tool: ToolAt,
    /// The position of the zone.
    pub(super) zone: Zone,
    /// The instruction only moves: no signal, trigger, search, or procedure during the motion that could fail.
    pub(super) plain: bool,
    /// Whether nothing happens on the way that depends on where the motion begins. A signal at its end does not depend on it.
    pub(super) is_only_motion: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ToolAt {
    Index(usize),
    Last,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Zone {
    BeforeTool,
    Absent,
}

/// The shape of a known motion instruction; `None` for any other name.
pub(super) fn shape(name: &[u8]) -> Option<Shape> {
    let mut upper = [0_u8; 32];
    let upper = upper.get_mut(..name.len())?;
    upper.copy_from_slice(name);
    upper.make_ascii_uppercase();
    let upper: &[u8] = upper;
    if upper == b"MOVEABSJ" {
        let zone = Zone::BeforeTool;
        return Some(Shape {
            motion: Motion::AbsoluteJoint,
            via: None,
            to: 0,
            tool: ToolAt::Index(3),
            zone,
            plain: true,
            is_only_motion: true,
        });
    }
    // A name is the family, the kind of motion, and what else the instruction does.
    const FAMILIES: [(&[u8], usize); 11] = [
        (b"EGMMOVE", 1),
        (b"MOVE", 0),
        (b"TRIGG", 0),
        (b"SEARCH", 2),
        (b"ARC", 0),
        (b"CAP", 0),
        (b"DISP", 0),
        (b"SPOTM", 0),
        (b"SPOT", 0),
        (b"PAINT", 0),
        (b"FCPRESS", 0),
    ];
    let (family, first) = FAMILIES.iter().find(|(f, _)| upper.starts_with(f) && upper.len() > f.len())?;
    let motion = match upper[family.len()] {
        b'L' => Motion::Linear,
        b'J' => Motion::Joint,
        b'C' => Motion::Circular,
        _ => return None,
    };
    let rest = &upper[family.len() + 1..];
    let known: &[&[u8]] = match *family {
        b"MOVE" => &[b"", b"DO", b"AO", b"GO", b"SYNC"],
        b"TRIGG" => &[b"", b"IOS"],
        b"SEARCH" | b"SPOT" | b"SPOTM" | b"EGMMOVE" | b"FCPRESS" | b"PAINT" => &[b""],
        _ => &[b"", b"START", b"END", b"1", b"2", b"1START", b"1END", b"2START", b"2END"],
    };
    if !known.contains(&rest) {
        return None;
    }
    let circular = motion == Motion::Circular;
    let to = first + usize::from(circular);
    let tool = match *family {
        b"MOVE" => ToolAt::Index(to + 3),
        _ if rest == b"IOS" => ToolAt::Index(to + 3),
        _ => ToolAt::Last,
    };
    let zone = if *family == b"SEARCH" { Zone::Absent } else { Zone::BeforeTool };
    let is_only_motion = *family == b"MOVE";
    let plain = is_only_motion && rest.is_empty();
    Some(Shape { motion, via: circular.then_some(*first), to, tool, zone, plain, is_only_motion })
}
