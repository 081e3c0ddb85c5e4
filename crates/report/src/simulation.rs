//! The part, before it is really cut: the deviation of the surface that the loaded arm leaves from the programmed surface.

use deflex_cell::Cell;
use deflex_cutting::Cutter;
use deflex_program::orientation::rotation;
use deflex_program::{Goal, Motion, Program, Role, Target};
use deflex_stock::{Blank, Mesh, Stock, ToolPose};
use deflex_text::number::write_fixed;
use nalgebra::{Unit, Vector3};
use rayon::prelude::*;
use serde::Serialize;

/// Approximate largest number of corners of the map; for larger stocks its cells are larger.
const MOST_NODES: f64 = 6e6;

/// A corner of the map that is farther from the surface than this, m, is on an edge, where the deviation is not defined.
const ON_SURFACE: f64 = 2e-6;

/// Where the surface is nearer to that of the blank than this, m, nothing was cut.
const UNCUT: f64 = 2e-6;

/// How far along its normal a probed point is searched for the surface, m.
const PROBE_REACH: f64 = 10e-3;

/// A point of the programmed surface and the deviation there: actual minus programmed, out of the material, mm.
///
/// # Examples
/// ```
/// use deflex_report::SurfacePoint;
///
/// let gouge = SurfacePoint { position_mm: [10.0, 5.0, -2.0], deviation_mm: -0.08 };
/// assert!(gouge.deviation_mm < 0.0); // too much is cut
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position in the frame of the stock, mm.
    pub position_mm: [f64; 3],
    /// Deviation, mm: above zero material is left over, below zero the part is gouged.
    pub deviation_mm: f64,
}

/// One side of the deviations.
///
/// # Examples
/// ```
/// use deflex_report::OneSide;
///
/// let none = OneSide::default();
/// assert_eq!((none.share, none.max_mm), (0.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct OneSide {
    /// Share of the surface, 0 to 1.
    pub share: f64,
    /// Mean over it, mm.
    pub mean_mm: f64,
    /// Largest, mm.
    pub max_mm: f64,
}

/// Figures of a map.
///
/// # Examples
/// ```
/// use deflex_report::MapFigures;
///
/// let figures = MapFigures::of(&[0.02, -0.04]);
/// assert_eq!((figures.max_mm, figures.gouge.max_mm, figures.leftover.max_mm), (0.04, 0.04, 0.02));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MapFigures {
    /// Points of the cut surface.
    pub points: usize,
    /// Root mean square, mm.
    pub rms_mm: f64,
    /// Mean of the sizes, mm.
    pub mean_mm: f64,
    /// Mean with its sign, mm: above zero, more is left than programmed.
    pub mean_signed_mm: f64,
    /// Largest size, mm.
    pub max_mm: f64,
    /// Where too much was cut.
    pub gouge: OneSide,
    /// Where too little was cut.
    pub leftover: OneSide,
}

impl MapFigures {
    /// The figures of deviations, mm.
    #[must_use]
    pub fn of(deviations: &[f64]) -> Self {
        let n = deviations.len().max(1) as f64;
        // The sum of no numbers is -0.0.
        let sum = |numbers: &mut dyn Iterator<Item = f64>| numbers.sum::<f64>() + 0.0;
        let side = |sign: f64| {
            let own: Vec<f64> = deviations.iter().map(|d| sign * d).filter(|d| *d > 0.0).collect();
            let count = own.len();
            OneSide {
                share: count as f64 / n,
                mean_mm: sum(&mut own.iter().copied()) / count.max(1) as f64,
                max_mm: own.iter().fold(0.0, |a: f64, b| a.max(*b)),
            }
        };
        let (gouge, leftover) = (side(-1.0), side(1.0));
        Self {
            points: deviations.len(),
            rms_mm: (sum(&mut deviations.iter().map(|d| d * d)) / n).sqrt(),
            mean_mm: sum(&mut deviations.iter().map(|d| d.abs())) / n,
            mean_signed_mm: sum(&mut deviations.iter().copied()) / n,
            max_mm: gouge.max_mm.max(leftover.max_mm),
            gouge,
            leftover,
        }
    }
}

/// The programmed surface, and deviations of an actual one from it.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_report::DeviationMap;
/// use deflex_stock::{Blank, Stock};
///
/// let blank = Blank::Box([Vector3::zeros(), Vector3::new(0.04, 0.03, 0.02)]);
/// let block = Stock::new(blank.clone(), 1e-3);
/// // Nothing is cut, and nothing had to be cut.
/// let map = DeviationMap::new(block.surface(2e-3), &block, &blank, &block);
/// assert_eq!((map.figures().points, map.points().len()), (0, 0));
/// ```
#[derive(Clone, Debug)]
pub struct DeviationMap {
    /// The programmed surface.
    pub programmed: Mesh,
    /// At its corners, mm; `None` where nothing was cut, and on edges.
    pub deviations_mm: Vec<Option<f64>>,
}

impl DeviationMap {
    /// Compares an actual stock with the intended surface, which is the programmed one or that of the nominal part. Where this surface is that
    /// of the `blank`, nothing has to be cut.
    #[must_use]
    pub fn new(programmed: Mesh, intended: &Stock, blank: &Blank, actual: &Stock) -> Self {
        let deviation = |point: &Vector3<f64>| {
            let cut = blank.depth(point) > UNCUT && intended.depth(point).abs() < ON_SURFACE;
            cut.then(|| 1e3 * actual.distance(point))
        };
        let deviations_mm = programmed.points.par_iter().map(deviation).collect();
        Self { programmed, deviations_mm }
    }

    /// Figures over the cut surface.
    #[must_use]
    pub fn figures(&self) -> MapFigures {
        MapFigures::of(&self.deviations_mm.iter().flatten().copied().collect::<Vec<_>>())
    }

    /// The points of the cut surface.
    #[must_use]
    pub fn points(&self) -> Vec<SurfacePoint> {
        let both = self.programmed.points.iter().zip(&self.deviations_mm);
        both.filter_map(|(at, deviation)| {
            Some(SurfacePoint { position_mm: (at * 1e3).into(), deviation_mm: (*deviation)? })
        })
        .collect()
    }
}

/// A cutter at a place of its path, in the frame of the stock.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct CutterAt {
    /// Its pose.
    pub pose: ToolPose,
    /// The cutter.
    pub cutter: Cutter,
}

impl CutterAt {
    /// The programmed cutter on its path as near as possible to the largest deviation of a map; the stock stands in `wobj`. `None` if nothing
    /// was cut, or if no motion in the work object of the stock has a tool with a cutter.
    #[must_use]
    pub fn worst(map: &DeviationMap, program: &Program, cell: &Cell, wobj: &str) -> Option<Self> {
        let places = map.programmed.points.iter().zip(&map.deviations_mm);
        let deviation = |(place, deviation): (_, &Option<f64>)| deviation.map(|mm| (place, mm.abs()));
        let (worst, _) = places.filter_map(deviation).max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let path = Self::path(program, cell, wobj);
        let nearest = |pair: &[Self]| {
            let along = pair[1].pose.tip - pair[0].pose.tip;
            let share =
                ((worst - pair[0].pose.tip).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            Self { pose: pair[0].pose.between(&pair[1].pose, share), cutter: pair[1].cutter }
        };
        let ways = path.windows(2).filter(|pair| pair[0].cutter == pair[1].cutter).map(nearest);
        let far = |at: &Self| (at.pose.tip - worst).norm();
        ways.chain(path.iter().copied()).min_by(|a, b| far(a).total_cmp(&far(b)))
    }

    /// The cutter at each target of lines and arcs in the work object of the stock.
    fn path(program: &Program, cell: &Cell, wobj: &str) -> Vec<Self> {
        let moves =
            |target: &&Target| target.role == Role::End && matches!(target.motion, Motion::Linear | Motion::Circular);
        let name = |target: &Target| program.wobjs.get(usize::from(target.wobj)).map(|wobj| &*wobj.name);
        let at = |target: &Target| {
            let (position_mm, axis) = match target.goal {
                // The z axis of a tool points away from the spindle.
                Goal::Pose { position_mm, quat, .. } => (position_mm, rotation(quat) * -Vector3::z()),
                Goal::Axis { position_mm, axis, .. } => (position_mm, Vector3::from(axis)),
                Goal::Joints { .. } => return None,
            };
            let tool = program.tools.get(usize::from(target.tool))?;
            let cutter = cell.milling(&tool.name).ok()?.cutter;
            Some(Self {
                pose: ToolPose { tip: 1e-3 * Vector3::from(position_mm), axis: Unit::new_normalize(axis) },
                cutter,
            })
        };
        let here = |target: &&Target| name(target).is_some_and(|own| own.eq_ignore_ascii_case(wobj));
        program.targets.iter().filter(moves).filter(here).filter_map(at).collect()
    }
}

/// Distance of a map's corners, m, for a stock.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::{Blank, Stock};
///
/// let block = Stock::new(Blank::Box([Vector3::zeros(), Vector3::new(0.1, 0.1, 0.05)]), 1e-3);
/// assert!(deflex_report::map_cell(&block) >= 1e-3); // m
/// ```
#[must_use]
pub fn map_cell(stock: &Stock) -> f64 {
    let [low, high] = stock.blank().bounds();
    stock.spacing().max(((high - low).product() / MOST_NODES).cbrt())
}

/// Deviation at a nominal point (m) of a part, mm, along its normal if one is given: a virtual measuring machine. `None` if no surface is
/// near.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_report::probe;
/// use deflex_stock::{Blank, Stock};
///
/// let block = Stock::new(Blank::Box([Vector3::zeros(), Vector3::new(0.04, 0.03, 0.02)]), 1e-3);
/// let nominal = Vector3::new(0.02, 0.015, 0.0198); // 0.2 mm below the top of the block
/// let deviation = probe(&block, &nominal, Some(&Vector3::z())).expect("a surface nearby");
/// assert!((deviation - 0.2).abs() < 1e-3); // mm: material is left
/// ```
#[must_use]
pub fn probe(actual: &Stock, point: &Vector3<f64>, normal: Option<&Vector3<f64>>) -> Option<f64> {
    let Some(normal) = normal else {
        let distance = actual.distance(point);
        return (distance.abs() < PROBE_REACH).then_some(1e3 * distance);
    };
    let depth = actual.depth(point);
    let sign = if depth > 0.0 { 1.0 } else { -1.0 };
    let at = |way: f64| sign * actual.depth(&(point + normal * (sign * way)));
    // The depth changes by at most the length of a step, so steps as long as the depth cannot pass the surface.
    let (mut low, mut way) = (0.0, 0.0);
    const LEAST_STEP: f64 = 1e-6;
    while at(way) > 0.0 {
        low = way;
        way += at(way).max(LEAST_STEP);
        if way > PROBE_REACH {
            return None;
        }
    }
    let mut high = way;
    while high - low > 1e-9 {
        let middle = 0.5 * (low + high);
        if at(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(1e3 * sign * 0.5 * (low + high))
}

/// CSV with the columns `x_mm,y_mm,z_mm,deviation_mm`, one row for each point.
#[must_use]
#[doc(hidden)]
pub fn map_csv(points: &[SurfacePoint]) -> Vec<u8> {
    let mut out = b"x_mm,y_mm,z_mm,deviation_mm\n".to_vec();
    for point in points {
        for value in point.position_mm {
            write_fixed(&mut out, value, 6);
            out.push(b',');
        }
        write_fixed(&mut out, point.deviation_mm, 6);
        out.push(b'\n');
    }
    out
}

/// A mesh as binary STL, mm.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_report::stl;
/// use deflex_stock::{Blank, Stock, read_stl};
///
/// let block = Stock::new(Blank::Box([Vector3::zeros(), Vector3::new(0.04, 0.03, 0.02)]), 1e-3);
/// let triangles = read_stl(&stl(&block.surface(2e-3))).expect("an STL file");
/// assert!(!triangles.is_empty());
/// ```
#[must_use]
pub fn stl(mesh: &Mesh) -> Vec<u8> {
    const HEADER: usize = 80;
    let mut out = vec![0; HEADER];
    let title = b"deflex simulate, mm";
    out[..title.len()].copy_from_slice(title);
    out.extend(u32::try_from(mesh.triangles.len()).unwrap_or(u32::MAX).to_le_bytes());
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| mesh.points[i as usize] * 1e3);
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
        for value in [normal, a, b, c].iter().flat_map(Vector3::iter) {
            #[expect(clippy::cast_possible_truncation, reason = "STL holds single precision")]
            out.extend((*value as f32).to_le_bytes());
        }
        out.extend([0, 0]);
    }
    out
}
