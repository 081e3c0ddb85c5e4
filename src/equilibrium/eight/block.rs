use crate::effects::{Cutting, ForceLaw, ToolFrame};
use crate::lanes::{Frame, Lanes, Vector, WIDTH};
use crate::robot::Pose;
use nalgebra::Vector3;

/// Where a target is, and what acts on it there: as much of a [`Situation`](crate::effects::Situation) as simple effects ask.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site<'a> {
    pub(crate) base_from_wobj: &'a Pose,
    /// Where the TCP should be, m.
    pub(crate) wobj_from_tcp: &'a Pose,
    pub(crate) tool: &'a ToolFrame,
    /// kg
    pub(crate) payload: f64,
    pub(crate) cutting: Cutting<'a>,
}

/// The sites of eight targets.
#[derive(Default)]
pub(super) struct Block<'a> {
    pub(super) base_from_wobj: Frame,
    /// Where the TCP should be, work object axes, m.
    pub(super) wanted: Vector,
    pub(super) flange_from_tcp: Frame,
    /// kg
    pub(super) tool_mass: Lanes,
    /// Flange frame, m.
    pub(super) tool_cog: Vector,
    /// kg
    pub(super) payload: Lanes,
    /// Axes only.
    pub(super) wobj_from_feed: Frame,
    /// See [`ForceLaw::slope`].
    pub(super) slope: Vector,
    laws: [Option<&'a dyn ForceLaw>; WIDTH],
}

impl<'a> Block<'a> {
    pub(super) fn of<'b>(sites: impl Iterator<Item = &'b Site<'a>>) -> Self
    where
        'a: 'b,
    {
        let mut block = Self::default();
        for (lane, site) in sites.enumerate() {
            block.base_from_wobj.set(lane, site.base_from_wobj);
            block.wanted.set(lane, &site.wobj_from_tcp.translation.vector);
            block.flange_from_tcp.set(lane, &site.tool.flange_from_tcp);
            block.tool_mass.0[lane] = site.tool.mass;
            block.tool_cog.set(lane, &site.tool.cog);
            block.payload.0[lane] = site.payload;
            match &site.cutting {
                Cutting::Air => {}
                // As a law whose frame is the force's own: along its first axis.
                Cutting::Constant(force) => block.wobj_from_feed.x.set(lane, force),
                Cutting::Law { law, wobj_from_feed } => {
                    block.wobj_from_feed.set_axes(lane, wobj_from_feed);
                    block.slope.set(lane, &law.slope());
                    block.laws[lane] = Some(*law);
                }
            }
        }
        block
    }

    /// Cutting forces, N, feed frame, for shifts of the tip, m, and tool axes there.
    pub(super) fn forces(&self, shift: &Vector, axis: &Vector, force: &mut Vector) {
        let mut places = [(Vector3::zeros(), Vector3::zeros()); WIDTH];
        let mut forces = [Vector3::x(); WIDTH];
        for (lane, place) in places.iter_mut().enumerate() {
            *place = (shift.lane(lane), axis.lane(lane));
        }
        let mut from = 0;
        while from < WIDTH {
            let law = self.laws[from];
            let same = |other: &Option<&dyn ForceLaw>| match (law, other) {
                (Some(law), Some(other)) => std::ptr::addr_eq(law, *other),
                (None, None) => true,
                _ => false,
            };
            let to = from + self.laws[from..].iter().take_while(|other| same(other)).count();
            if let Some(law) = law {
                law.forces(&places[from..to], &mut forces[from..to]);
            }
            from = to;
        }
        for (lane, in_feed) in forces.iter().enumerate() {
            force.set(lane, in_feed);
        }
    }
}
