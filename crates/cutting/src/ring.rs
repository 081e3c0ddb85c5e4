//! Circles of the cutter's envelope, and the conditions that limit the cutting arcs on them, in the cutter frame.

use nalgebra::Vector3;

/// A circle of the envelope about the tool axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    /// Sine and cosine of the profile angle κ: the outward normal's part across the axis, and
    /// minus its part along it.
    pub(super) sin: f64,
    pub(super) cos: f64,
    /// Radius and height above the tip, m.
    pub(super) radius: f64,
    pub(super) height: f64,
    /// Length of the profile from the flat or tip, m.
    pub(super) along: f64,
}

impl Ring {
    pub(super) fn point(&self, (cos, sin): (f64, f64)) -> Vector3<f64> {
        Vector3::new(self.radius * cos, self.radius * sin, self.height)
    }
}

/// Points p (from the tip) with `offset + direction·p < 0`.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    /// Unit vector that points out of the material, perpendicular to the feed.
    pub(super) direction: Vector3<f64>,
    pub(super) offset: f64,
    /// Length of the part of `direction` across the tool axis, and the direction into the material there.
    pub(super) slope: f64,
    pub(super) inward: (f64, f64),
    /// Angle of `inward`, rad.
    pub(super) angle: f64,
}

impl HalfSpace {
    pub(super) fn new(direction: Vector3<f64>, offset: f64) -> Self {
        let slope = direction.x.hypot(direction.y);
        let inward = if slope > 0.0 { (-direction.x / slope, -direction.y / slope) } else { (1.0, 0.0) };
        let angle = inward.1.atan2(inward.0);
        HalfSpace { direction, offset, slope, inward, angle }
    }

    pub(super) fn value(&self, point: &Vector3<f64>) -> f64 {
        self.offset + self.direction.dot(point)
    }
}

/// End of an arc: its angle from the feed towards +y, with cosine and sine.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(super) angle: f64,
    pub(super) cos: f64,
    pub(super) sin: f64,
}

/// From one end to the other with a growing angle.
pub(super) type Arc = (End, End);
