//! What languages write differently in posted programs.

use super::template::decimal;
use super::writer::{PostedPoint, RapidPost};
use super::{jbi, krl, tp, ur};
use crate::text::Diagnostic;

/// Files by name.
pub(crate) type Files = Vec<(String, Vec<u8>)>;
/// Writes points, with the axis angles there (degrees) and the lines of the end, as files.
pub(crate) type Write = fn(&RapidPost, &[PostedPoint], &[[f64; 6]], &str) -> Result<Files, Vec<Diagnostic>>;
/// A position, mm, and an orientation, scalar first.
pub(crate) type Held = ([f64; 3], [f64; 4]);

/// How a language says what posted programs need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Statements {
    /// Waits for so many seconds, written as a number.
    pub(crate) dwell: fn(f64) -> String,
    /// Shows the operator a message that has to be acknowledged.
    pub(crate) asks: fn(&str) -> Vec<String>,
    /// Writes a program as a whole; RAPID is written in chunks.
    pub(crate) write: Option<Write>,
    /// What a controller holds of a pose that is printed; RAPID prints quaternions.
    pub(crate) held: Option<fn([f64; 3], [f64; 4]) -> Held>,
    /// Points of a file where none are asked for.
    pub(crate) most_points: Option<usize>,
    /// Why a program is not split into several files.
    pub(crate) unsplit: Option<&'static str>,
    /// Why programs are posted without external axes.
    pub(crate) without_axes: Option<&'static str>,
    /// Whether work objects of posted programs have to stand still.
    pub(crate) stands_still: bool,
    /// What has to be looked at before the program runs.
    pub(crate) check: Option<&'static str>,
}

pub(crate) const RAPID: Statements = Statements {
    dwell: |seconds| format!("WaitTime {};", decimal(seconds)),
    asks: |text| vec![format!("UIMsgBox \"{text}\";")],
    write: None,
    held: None,
    most_points: None,
    unsplit: None,
    without_axes: None,
    stands_still: false,
    check: None,
};

pub(crate) const KRL: Statements = Statements {
    dwell: |seconds| format!("WAIT SEC {}", decimal(seconds)),
    // A message with an answer needs declarations; the line of a HALT is shown, and the program goes on at Start.
    asks: |text| vec![format!("; {text}"), "HALT".to_owned()],
    write: Some(|post, points, axes, end| Ok(post.krl(points, axes, end))),
    most_points: Some(krl::MOST_POINTS),
    stands_still: true,
    ..RAPID
};

pub(crate) const TP: Statements = Statements {
    dwell: |seconds| format!("WAIT {seconds:.2}(sec)"),
    asks: |text| {
        /// Characters that a TP message has room for.
        const MESSAGE: usize = 24;
        let short: String = text.replace(',', "").chars().take(MESSAGE).collect();
        vec![format!("MESSAGE[{short}]"), "PAUSE".to_owned()]
    },
    write: Some(|post, points, _, end| tp::programs(post.plan(), points, end)),
    held: Some(tp::held_pose),
    without_axes: Some("FANUC TP is posted without external axes: their motion group is not known"),
    ..RAPID
};

pub(crate) const UR: Statements = Statements {
    dwell: |seconds| format!("sleep({})", decimal(seconds)),
    asks: |text| vec![format!("popup(\"{text}\", blocking=True)")],
    write: Some(|post, points, axes, end| Ok(post.ur(points, axes, end))),
    held: Some(ur::held_pose),
    unsplit: Some("a URScript program is one routine in one file: it is not split"),
    without_axes: Some("URScript is posted without external axes: the controller has none"),
    stands_still: true,
    ..RAPID
};

pub(crate) const JBI: Statements = Statements {
    dwell: |seconds| format!("TIMER T={seconds:.2}"),
    asks: |text| {
        /// Characters that a message has room for.
        const MESSAGE: usize = 32;
        let short: String = text.replace('"', "'").chars().take(MESSAGE).collect();
        vec![format!("MSG \"{short}\""), "PAUSE".to_owned()]
    },
    write: Some(jbi::jobs),
    held: Some(jbi::held_pose),
    without_axes: Some("INFORM is posted without external axes: their group is not known"),
    check: Some(
        "RCONF is written as YRC1000 controllers count it (the wrist by the sign of axis B): compare it with a job \
         that this controller has saved, and run the job slowly first",
    ),
    ..RAPID
};
