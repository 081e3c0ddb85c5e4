//! The kinematic chain of the arm, for a single target or for several lanes. The scalar functions of
//! [`Robot`](super::Robot) and the equilibria of batches both use it.

use super::Joints;
use deflex_lanes::{Frame, Real, SinCos, Vector, six};

/// Six numbers, one for each joint, of one target or of several lanes: for example motor angles, rad, or torques, N·m.
#[doc(hidden)]
pub type Six<R> = [R; 6];

/// Sets a lane to the numbers of one target.
#[inline(always)]
#[doc(hidden)]
pub fn set<R: Real>(all: &mut Six<R>, lane: usize, one: &Joints) {
    // Iterating over a slice is faster than over the matrix, whose iterator counts strides.
    for (all, one) in all.iter_mut().zip(one.as_slice()) {
        all.set(lane, *one);
    }
}

/// The numbers of one lane.
#[inline(always)]
#[doc(hidden)]
pub fn one<R: Real>(all: &Six<R>, lane: usize) -> Joints {
    Joints::from(six!(i => all[i].lane(lane)))
}

/// Sum of products.
#[inline(always)]
#[doc(hidden)]
pub fn dot<R: Real>(a: &Six<R>, b: &Six<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}

/// Modified Denavit-Hartenberg rows: `Rx(alpha) Tx(a) Rz(theta + joint) Tz(d)`, m and rad.
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct Rows<R> {
    pub a: Six<R>,
    pub d: Six<R>,
    pub theta: Six<R>,
    pub alpha: [SinCos<R>; 6],
}

/// The frames of the links in the base, m, and the directions of the joint axes in base axes.
///
/// A joint axis is the z axis of its link, without the tilt of the link that acts after its own joint.
#[derive(Clone, Copy, Debug, Default)]
#[doc(hidden)]
pub struct Chain<R> {
    pub links: [Frame<R>; 6],
    pub axes: [Vector<R>; 6],
}

impl<R: Real> Rows<R> {
    /// Frames of the links at joint angles, given by the sines and cosines of joint plus theta; `tilt`, where given, turns
    /// each link about x and y of its own frame, rad.
    #[inline(always)]
    pub fn chain(&self, joints: &[SinCos<R>; 6], tilt: Option<&[[R; 2]; 6]>, chain: &mut Chain<R>) {
        self.links(joints, tilt, |i, link, axis| (chain.links[i], chain.axes[i]) = (link, axis));
    }

    /// The frame of the last link.
    #[inline(always)]
    pub fn end(&self, joints: &[SinCos<R>; 6]) -> Frame<R> {
        self.links(joints, None, |_, _, _| ())
    }

    /// Computes the frame of each link and the axis of its joint, and returns the last frame.
    #[inline(always)]
    fn links(
        &self,
        joints: &[SinCos<R>; 6],
        tilt: Option<&[[R; 2]; 6]>,
        mut give: impl FnMut(usize, Frame<R>, Vector<R>),
    ) -> Frame<R> {
        let mut link = Frame::identity();
        for i in 0..6 {
            let (SinCos { sin: sa, cos: ca }, SinCos { sin, cos }) = (self.alpha[i], joints[i]);
            // Column by column.
            let across = link.y * ca + link.z * sa;
            let z = link.z * ca - link.y * sa;
            let origin = link.origin + (link.x * self.a[i] + z * self.d[i]);
            link = Frame { x: link.x * cos + across * sin, y: across * cos - link.x * sin, z, origin };
            if let Some(tilt) = tilt {
                link = link.turned_by(Vector::new(tilt[i][0], tilt[i][1], R::ZERO));
            }
            give(i, link, z);
        }
        link
    }
}
