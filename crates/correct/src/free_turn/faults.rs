//! Faults between the targets of a choice. If an axis exceeds its limits or its speed, the wrist becomes singular or the arm does not
//! reach, the next search keeps farther from that state.

use super::path::Path;
use crate::along::{FollowedSegment, WayFault, WayFinding};
use crate::carried::Chosen;
use deflex_drive::Track;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Additional distance from an axis limit that was exceeded, rad.
const SPARE: f64 = PI / 180.0;

/// By how much the margin from a singular wrist grows, rad.
const WIDER: f64 = 3.0 * PI / 180.0;

/// Additional factor for the speed of an axis that was exceeded.
const SLOWER: f64 = 1.1;

impl Path<'_> {
    /// Faults on the segments between chosen targets.
    pub(super) fn way_faults(&self, chosen: &[Chosen]) -> Vec<WayFinding> {
        let faults = |i: usize| {
            let is_chosen = |i: usize| chosen[i].turn.is_some();
            if self.moves[i].free || !(is_chosen(i) || is_chosen(i - 1)) {
                return Vec::new();
            }
            let [from, to] = [i - 1, i].map(|i| self.chosen_point(i, &chosen[i]));
            let mount = self.mount(i);
            let setting = |share: f64| {
                let moved = mount.between(from.moved.as_ref(), to.moved.as_ref(), share);
                moved.map_or(mount.setting, |moved| moved.setting)
            };
            let begins = if from.setting == to.setting {
                from.wobj_from_tcp
            } else {
                let Some(there) = mount.at(from.moved.as_ref()) else { return Vec::new() };
                let before = from.moved.as_ref().map_or(self.mount(i - 1).setting, |moved| moved.setting);
                there.wobj_from_tcp(&before.base_from_flange(&from.wobj_from_tcp))
            };
            let segment = FollowedSegment {
                index: i,
                robot: self.robot(),
                track: Track::line(&begins, &to.wobj_from_tcp),
                setting: &setting,
                motors: [from.motor, to.motor],
                feed_mm_s: self.moves[i].time.map(|time| 1e3 * self.moves[i].length / time),
            };
            segment.faults()
        };
        (1..chosen.len()).into_par_iter().flat_map_iter(faults).collect()
    }

    /// Keeps the next search farther from these faults.
    pub(super) fn keep_clear_of(&mut self, faults: &[WayFinding]) {
        for fault in faults {
            for at in [fault.index - 1, fault.index] {
                let clear = self.kept_clear.entry(at).or_default();
                match fault.fault {
                    WayFault::AxisLimit => clear.limits += (fault.value - fault.limit).abs().to_radians() + SPARE,
                    WayFault::Singular | WayFault::Unreachable => clear.singular += WIDER,
                    WayFault::AxisSpeed if at == fault.index => {
                        clear.speed *= SLOWER * (fault.value / fault.limit).max(1.0)
                    }
                    WayFault::AxisSpeed => {}
                }
            }
        }
    }
}
