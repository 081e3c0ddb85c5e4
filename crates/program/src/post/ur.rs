//! Writes points as URScript: one `.script` with one routine.

use super::names::identifier;
use super::statements::Statements;
use super::template::decimal;
use super::writer::{PostWriter, PostedPoint, WriterPosition};
use crate::orientation::{quaternion, rotation, rotation_vector};
use crate::token::single;
use crate::{Mark, ToolData};
use deflex_text::number::{printed, write_fixed};
use nalgebra::{Rotation3, Vector3};

/// Decimals of metres: a tenth of a micrometre.
const M: usize = 7;
/// Decimals of the numbers of a rotation vector, rad: 3e-6 mm at 300 mm.
const RAD: usize = 8;
/// Acceleration on a path, m/s², and of the axes, rad/s²: the controller's defaults.
const ACCELERATIONS: [&str; 2] = ["1.2", "1.4"];
/// Speed of the axes if the path is unknown, rad/s: a fifth of that of the fastest arms.
const JOINT_SPEED: &str = "0.6";
/// Characters of a name that are reserved for an ending: none.
const SHORTER: usize = 0;

/// The statements of URScript in posted programs.
pub(crate) const STATEMENTS: Statements = Statements {
    dwell: |seconds| format!("sleep({})", decimal(seconds)),
    stops_with_message: |text| vec![format!("popup(\"{text}\", blocking=True)")],
    write: Some(|post, points, axes, end| Ok(post.ur(points, axes, end))),
    held: Some(held_pose),
    unsplit: Some("a URScript program is one routine in one file: it is not split"),
    without_axes: Some("URScript is posted without external axes: the controller has none"),
    stands_still: true,
    ..Statements::RAPID
};

/// A pose (mm, scalar first) that is printed as `p[…]`, in the controller's precision.
pub(crate) fn held_pose(mm: [f64; 3], quat: [f64; 4]) -> ([f64; 3], [f64; 4]) {
    let held = |value: f64, decimals: usize| single(printed(value, decimals));
    let turn = rotation_vector(&rotation(quat)).map(|value| held(value, RAD));
    (mm.map(|mm| 1e3 * held(1e-3 * mm, M)), quaternion(&Rotation3::new(turn)))
}

impl PostWriter {
    /// Writes the program: points with the axis angles there (degrees), and the lines of its end. Work objects are frames in the
    /// robot's base.
    ///
    /// A motion whose path is unknown is a joint motion to axis angles, which decides the posture.
    #[must_use]
    pub(crate) fn ur(&self, points: &[PostedPoint], axes_deg: &[[f64; 6]], end: &str) -> Vec<(String, Vec<u8>)> {
        let name = identifier(&self.plan.name, SHORTER);
        let mut text = format!("def {name}():\n").into_bytes();
        self.plan.plain_title().for_each(|line| lines(&mut text, &format!("# {line}")));
        let frames: Vec<String> =
            (1..).zip(&self.plan.wobjs).map(|(n, (name, _))| format!("frame_{n}_{}", identifier(name, 10))).collect();
        for (frame, (_, data)) in frames.iter().zip(&self.plan.wobjs) {
            text.extend_from_slice(format!("  local {frame} = ").as_bytes());
            pose(&mut text, &data.uframe_mm, data.uframe_quat);
            text.push(b'\n');
        }
        let (mut place, mut in_force) = (WriterPosition::default(), InForce::default());
        for (i, point) in points.iter().enumerate() {
            let here = place.after(std::slice::from_ref(point));
            lines(&mut text, point.lines.as_deref().unwrap_or_default());
            if in_force.tool != Some(point.tool) {
                if let Some((_, data)) = self.plan.tools.get(usize::from(point.tool)) {
                    tool(&mut text, data);
                }
                in_force.tool = Some(point.tool);
            }
            if in_force.mark != point.mark {
                point.mark.iter().for_each(|mark| lines(&mut text, &format!("# {}", mark.comment())));
                in_force.mark = point.mark;
            }
            if here.is_first() || point.joint {
                text.extend_from_slice(b"  movej([");
                list(&mut text, &axes_deg[i].map(f64::to_radians), RAD);
                text.extend_from_slice(format!("], a={}, v={JOINT_SPEED})\n", ACCELERATIONS[1]).as_bytes());
            } else {
                text.extend_from_slice(format!("  movel(pose_trans({}, ", frames[usize::from(point.wobj)]).as_bytes());
                pose(&mut text, &point.position_mm, point.quat);
                text.extend_from_slice(format!("), a={}, v=", ACCELERATIONS[0]).as_bytes());
                write_fixed(&mut text, 1e-3 * self.speed_mm_s(point), M);
                if let Some(blend) = self.blend_mm(&here, point, points.get(i + 1)) {
                    text.extend_from_slice(b", r=");
                    write_fixed(&mut text, 1e-3 * blend, M);
                }
                text.extend_from_slice(b")\n");
            }
            place = here;
        }
        lines(&mut text, end);
        text.extend_from_slice(format!("end\n{name}()\n").as_bytes());
        vec![(format!("{name}.script"), text)]
    }

    /// Radius of the blend at a point, mm: that of its zone, if it does not overlap the blends of its neighbours. The controller skips a motion
    /// whose blend does (URScript Manual, movel), where others make zones smaller.
    fn blend_mm(&self, place: &WriterPosition, point: &PostedPoint, next: Option<&PostedPoint>) -> Option<f64> {
        /// Blends end before half of the way to a neighbour, so that rounded numbers do not make them overlap.
        const SHARE: f64 = 0.49;
        let zone_mm = self.corner_mm(place, point, next)?;
        let distance_mm =
            |other: &PostedPoint| (Vector3::from(point.position_mm) - Vector3::from(other.position_mm)).norm();
        let neighbours = place.point_before().into_iter().chain(next);
        Some(neighbours.map(distance_mm).fold(zone_mm, |blend_mm, distance| blend_mm.min(SHARE * distance)))
            .filter(|blend_mm| *blend_mm > 0.0)
    }
}

/// The state that the program has set so far.
#[derive(Default)]
struct InForce {
    tool: Option<u16>,
    mark: Option<Mark>,
}

fn lines(text: &mut Vec<u8>, lines: &str) {
    for line in lines.lines() {
        text.extend_from_slice(b"  ");
        text.extend_from_slice(line.as_bytes());
        text.push(b'\n');
    }
}

fn list(text: &mut Vec<u8>, values: &[f64], decimals: usize) {
    for (i, value) in values.iter().enumerate() {
        if i > 0 {
            text.extend_from_slice(b", ");
        }
        write_fixed(text, *value, decimals);
    }
}

/// `p[x, y, z, rx, ry, rz]`
fn pose(text: &mut Vec<u8>, mm: &[f64; 3], quat: [f64; 4]) {
    let turn = rotation_vector(&rotation(quat));
    text.extend_from_slice(b"p[");
    list(text, &mm.map(|mm| 1e-3 * mm), M);
    text.extend_from_slice(b", ");
    list(text, turn.as_slice(), RAD);
    text.push(b']');
}

fn tool(text: &mut Vec<u8>, data: &ToolData) {
    text.extend_from_slice(b"  set_tcp(");
    pose(text, &data.tcp_mm, data.tcp_quat);
    text.extend_from_slice(b")\n  set_payload(");
    write_fixed(text, data.mass_kg, 4);
    text.extend_from_slice(b", [");
    list(text, &data.cog_mm.map(|mm| 1e-3 * mm), M);
    text.extend_from_slice(b"])\n");
}
