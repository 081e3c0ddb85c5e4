//! What a writer of programs has to know before the first point.

use crate::jbi::SpeedUnit;
use crate::{EXTERNAL_AXES, ToolData, WobjData};

/// The plan of a posted program, before its first point.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct PostPlan {
    /// Name of the program, usually the stem of the file's name, from which an identifier is made.
    pub name: String,
    /// Lines of the head comment.
    pub title: Vec<String>,
    /// Tools, by the index of [`PostedPoint::tool`](super::PostedPoint::tool); `tool0` is not declared.
    pub tools: Vec<(String, ToolData)>,
    /// Work objects, by the index of [`PostedPoint::wobj`](super::PostedPoint::wobj); `wobj0` is not declared.
    pub wobjs: Vec<(String, WobjData)>,
    /// The mechanical unit that is the user frame of each work object, if there is one.
    pub units: Vec<Option<String>>,
    /// Positions of the external axes, mm or degrees; `None` for one that is not in use.
    pub external: [Option<f64>; EXTERNAL_AXES],
    /// Cutting speeds, mm/s, which are declared unless a predefined name has them. Other speeds are written in the motions.
    pub speeds: Vec<f64>,
    /// Number of points.
    pub points: usize,
    /// Most points of a module; a longer program is split into several, with a main module that loads them in turn.
    pub max_points: Option<usize>,
    /// Speed of rapid travel, mm/s.
    pub rapid_mm_s: f64,
    /// The unit of speeds in INFORM.
    pub speed_unit: SpeedUnit,
    /// Largest distance of a zone's rounding from a corner that cuts, mm.
    pub corner_tolerance_mm: f64,
}

impl PostPlan {
    /// Lines of the head comment in printable ASCII characters.
    pub(super) fn plain_title(&self) -> impl Iterator<Item = String> {
        let plain = |c: char| if c.is_ascii_graphic() { c } else { ' ' };
        self.title.iter().map(move |line| line.chars().map(plain).collect::<String>().trim_end().to_owned())
    }
}
