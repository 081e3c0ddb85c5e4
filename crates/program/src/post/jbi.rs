//! Writes points as Yaskawa's INFORM: one `.JBI`, or parts and a job that calls them in turn.

use super::names::{self, identifier};
use super::statements::{Files, Held, Statements};
use super::writer::{PostWriter, PostedPoint, WriterPosition};
use crate::Language;
use crate::jbi::DECIMALS;
use crate::orientation::{from_zyx_deg, quaternion, rotation, zyx_deg};
use deflex_text::Diagnostic;
use deflex_text::number::{printed, write_fixed};
use std::collections::BTreeSet;

/// Most points of a job if the options give no number: a job has at most 9,999 lines (Yaskawa, *DX200 Instructions*), some of which are
/// marks and calls.
const MOST_POINTS: usize = 9500;
/// Speed of joint motions, per cent: CL data state none.
const JOINT_PERCENT: &str = "10.00";
/// Characters of a job name that are reserved for an ending (`_12`).
const ENDING: usize = 4;

/// The statements of INFORM in posted programs.
pub(crate) const STATEMENTS: Statements = Statements {
    dwell: |seconds| format!("TIMER T={seconds:.2}"),
    stops_with_message: |text| {
        /// Most characters of a message.
        const MESSAGE: usize = 32;
        let short: String = text.replace('"', "'").chars().take(MESSAGE).collect();
        vec![format!("MSG \"{short}\""), "PAUSE".to_owned()]
    },
    write: Some(jobs),
    held: Some(held_pose),
    without_axes: Some("INFORM is posted without external axes: their group is not known"),
    check: Some(
        "deflex writes the first flag of RCONF by the sign of axis B, and controllers differ in the meaning of this flag",
    ),
    ..Statements::RAPID
};

/// A pose (mm, scalar first) that is printed as X … Rz, in the controller's precision.
pub(crate) fn held_pose(mm: [f64; 3], quat: [f64; 4]) -> Held {
    let turn = zyx_deg(&rotation(quat)).map(|deg| printed(deg, DECIMALS[1]));
    (mm.map(|mm| printed(mm, DECIMALS[0])), quaternion(&from_zyx_deg(turn)))
}

/// Writes the job: points with the axis angles there (degrees), and the lines of its end.
///
/// # Errors
/// A tool or a work object whose name is not a number (`TOOL 1`, `USER 1`).
fn jobs(post: &PostWriter, points: &[PostedPoint], axes_deg: &[[f64; 6]], end: &str) -> Result<Files, Vec<Diagnostic>> {
    let plan = post.plan();
    names::refuse(plan, Language::Jbi)?;
    let name = identifier(&plan.name, ENDING).to_ascii_uppercase();
    let most = plan.max_points.unwrap_or(MOST_POINTS).max(1);
    let title: String = plan.plain_title().map(|line| format!("'{line}\n")).collect();
    let mut place = WriterPosition::default();
    if points.len() <= most {
        let text = job(post, &mut place, (&name, &title), points, axes_deg, end);
        return Ok(vec![(format!("{name}.JBI"), text)]);
    }
    let (mut main, mut files) = (title, Vec::new());
    for (i, (part, axes)) in points.chunks(most).zip(axes_deg.chunks(most)).enumerate() {
        let part_name = format!("{name}_{}", i + 1);
        main += &format!("CALL JOB:{part_name}\n");
        let last = if (i + 1) * most >= points.len() { end } else { "" };
        files.push((format!("{part_name}.JBI"), job(post, &mut place, (&part_name, ""), part, axes, last)));
    }
    files.insert(0, (format!("{name}.JBI"), whole(&name, 0, "", None, &main)));
    Ok(files)
}

/// Points as a job with a name and a title, from a position in the program on.
fn job(
    post: &PostWriter,
    place: &mut WriterPosition,
    (name, title): (&str, &str),
    points: &[PostedPoint],
    axes_deg: &[[f64; 6]],
    end: &str,
) -> Vec<u8> {
    let plan = post.plan();
    let (mut positions, mut lines) = (String::new(), title.to_owned());
    let (mut group, mut mark, mut frames) = (String::new(), None, BTreeSet::new());
    for (i, (point, axes)) in points.iter().zip(axes_deg).enumerate() {
        let here = place.after(std::slice::from_ref(point));
        point.lines.iter().flat_map(|text| text.lines()).for_each(|line| lines.extend([line, "\n"]));
        if mark != point.mark {
            point.mark.iter().for_each(|mark| lines += &format!("'{}\n", mark.comment()));
            mark = point.mark;
        }
        let number = |named: Option<&str>, prefix| named.and_then(|name| names::number(name, prefix));
        let tool = number(plan.tools.get(usize::from(point.tool)).map(|tool| &*tool.0), "TOOL").unwrap_or(0);
        let user = number(plan.wobjs.get(usize::from(point.wobj)).map(|wobj| &*wobj.0), "USER");
        frames.insert(user);
        let frame = user.map_or("///POSTYPE ROBOT\n".to_owned(), |user| format!("///USER {user}\n///POSTYPE USER\n"));
        let now = format!("///TOOL {tool}\n{frame}///RECTAN\n///RCONF {}\n", posture(point, axes));
        if now != group {
            positions.push_str(&now);
            group = now;
        }
        position(&mut positions, i, point);
        // The path to the first point is unknown: a joint motion, not a straight line.
        if here.is_first() || point.joint {
            lines += &format!("MOVJ C{i:05} VJ={JOINT_PERCENT} PL=0\n");
        } else {
            let (speed, corner) = (post.speed_mm_s(point), post.corner_mm(&here, point, points.get(i + 1)));
            let passes = corner.map_or("PL=0".to_owned(), |radius| format!("CR={radius:.1}"));
            let speed = (speed / plan.speed_unit.mm_s()).max(0.1);
            lines += &format!("MOVL C{i:05} V={speed:.1} {passes}\n");
        }
        *place = here;
    }
    end.lines().for_each(|line| lines.extend([line, "\n"]));
    // A job states one frame; where its points have several, each group of them states its own.
    let frame = match frames.into_iter().collect::<Vec<_>>()[..] {
        [Some(user)] => Some(format!("USER {user}")),
        [None] => Some("ROBOT".to_owned()),
        _ => None,
    };
    whole(name, points.len(), &positions, frame.as_deref(), &lines)
}

/// A job with its head. Its date is fixed: the same input gives the same bytes. A job with positions in one frame is a relative job, which
/// names it (attribute RJ; Yaskawa's knowledge base, *Inform Header Fields*).
fn whole(name: &str, count: usize, positions: &str, frame: Option<&str>, lines: &str) -> Vec<u8> {
    let (relative, frame) = match frame {
        Some(frame) => (",RJ", format!("////FRAME {frame}\n")),
        None => ("", String::new()),
    };
    let text = format!(
        "/JOB\n//NAME {name}\n//POS\n///NPOS {count},0,0,0,0,0\n{positions}//INST\n///DATE 2000/01/01 00:00\n\
         ///ATTR SC,RW{relative}\n{frame}///GROUP1 RB1\nNOP\n{lines}END\n"
    );
    text.replace('\n', "\r\n").into_bytes()
}

/// RCONF: no flip, lower arm, rear, and axes R, T, S half a turn on. Wrists whose axis B is below zero are no flip, as in jobs of
/// later controllers (Yaskawa's knowledge base, *Inform Header Fields*: a tool that points down has RCONF 1,0,0); the manual of the
/// NX100 has it by axis R (RE-CSO-A031, section 3.9).
fn posture(point: &PostedPoint, axes_deg: &[f64; 6]) -> String {
    let bit = |bit: i32| i32::from(point.conf.cfx & bit != 0);
    let beyond = |axis: usize| i32::from(axes_deg[axis].abs() >= 180.0);
    let flags = [1 - bit(1), bit(2), bit(4), beyond(3), beyond(5), beyond(0)];
    flags.map(|flag| flag.to_string()).join(",") + &",0".repeat(18)
}

fn position(out: &mut String, number: usize, point: &PostedPoint) {
    let [rz, ry, rx] = zyx_deg(&rotation(point.quat));
    let mut text = format!("C{number:05}").into_bytes();
    for (at, value) in point.position_mm.into_iter().chain([rx, ry, rz]).enumerate() {
        text.push(if at == 0 { b'=' } else { b',' });
        write_fixed(&mut text, value, DECIMALS[usize::from(at > 2)]);
    }
    out.extend([&*String::from_utf8_lossy(&text), "\n"]);
}
