//! Makes a cell from a robot description (URDF), whose chain of joints is converted to modified Denavit-Hartenberg
//! rows.

use deflex_robot::{Axes, DhRow, Joints, Limits, Pose, Robot};
use deflex_text::limits::URDF_JOINTS;
use deflex_text::{Diagnostic, Source};
use nalgebra::{Matrix3, Rotation3, Translation3, Vector3};
use roxmltree::{Node, ParsingOptions};
use std::collections::{HashMap, HashSet};
use std::f64::consts::{PI, TAU};

/// Axes are parallel if the sine of their angle is below this. Descriptions have at least six digits, and the common
/// normal of axes that are closer to parallel is not determined.
const PARALLEL: f64 = 1e-7;
/// Largest distance between the flange of the rows and that of the description, m.
const SAME: f64 = 1e-12;
/// Number of random postures in which rows and description are compared.
const TRIALS: usize = 32;

/// A robot read from a description.
///
/// # Examples
/// ```
/// use deflex_cell::{Described, described};
/// use deflex_text::Source;
///
/// /// The name of the robot in a description.
/// fn name(description: &Source) -> Option<String> {
///     described(description, None).ok().map(|Described { name, .. }| name)
/// }
/// assert!(name(&Source::new("arm.urdf", "<robot name=\"arm\"/>")).is_none()); // it has no joints
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Described {
    /// Name of the robot in the file.
    pub name: String,
    /// The arm. Its base is the description's base frame in the world.
    pub robot: Robot,
    /// Pose of the last link in the flange frame of the rows, if they differ. It becomes a tool.
    pub flange_from_tip: Option<Pose>,
    /// Name of the last link.
    pub tip: String,
}

/// Reads a robot description. `tip` names its last link; `None` takes `tool0`, `flange`, or the end of the only chain
/// of six revolute joints.
///
/// # Errors
/// The file is not a URDF, or it contains no chain of six revolute joints to the tip; every reason is reported.
///
/// # Examples
/// ```
/// use deflex_cell::described;
/// use deflex_text::Source;
///
/// let refused = described(&Source::new("arm.urdf", "<robot name=\"arm\"/>"), None);
/// assert!(refused.is_err()); // it has no joints
/// ```
pub fn described(source: &Source, tip: Option<&str>) -> Result<Described, Vec<Diagnostic>> {
    let refuse = |message: String, help: &str| vec![Diagnostic::error("urdf", &source.name, message).help(help)];
    let text = String::from_utf8_lossy(&source.bytes);
    if text.contains("<xacro:") {
        return Err(refuse(
            "the file is xacro: expected URDF".to_owned(),
            "expand it first: xacro FILE.xacro > robot.urdf",
        ));
    }
    let urdf = Description::read(&text).map_err(|reason| {
        refuse(format!("the file is not URDF: {reason}"), "give a .urdf file, an XML with <robot> at its top")
    })?;
    if let Some(over) = URDF_JOINTS.exceeded(urdf.joints.len().max(urdf.links.len()) as f64) {
        return Err(refuse(over, URDF_JOINTS.help));
    }
    let tip = match tip {
        Some(tip) if urdf.links.iter().any(|link| link == tip) => tip.to_owned(),
        Some(tip) => {
            let near = super::nearest(tip, urdf.links.iter().map(String::as_str));
            let help =
                near.map_or_else(|| "name one of its links".to_owned(), |near| format!("did you mean `{near}`?"));
            return Err(refuse(format!("--tip {tip}: the description has no such link"), &help));
        }
        None => urdf.tip().map_err(|message| refuse(message, "name the last link with --tip"))?,
    };
    let chain = urdf.chain_to(&tip);
    let turning: Vec<&&Joint> = chain.iter().filter(|joint| joint.kind != JointType::Fixed).collect();
    let turns = |joint: &Joint| matches!(joint.kind, JointType::Revolute | JointType::Continuous);
    if turning.len() != 6 || !turning.iter().all(|joint| turns(joint)) {
        let names: Vec<String> = turning.iter().map(|joint| format!("{} ({:?})", joint.name, joint.kind)).collect();
        let message = format!(
            "the chain to `{tip}` has {} joints that move, expected six that turn: {}",
            names.len(),
            names.join(", ")
        );
        return Err(refuse(
            message,
            "a track or a table goes into [[unit]]: give the arm's own description, or another --tip",
        ));
    }
    let of_joint = |joint: &Joint| {
        let [roll, pitch, yaw] = joint.rpy;
        Pose::from_parts(Translation3::from(Vector3::from(joint.xyz)), Rotation3::from_euler_angles(roll, pitch, yaw))
    };
    // The controller's base frame, if the description has a `base` link that differs from its root.
    let root = chain.first().map_or_else(|| tip.clone(), |joint| joint.parent.clone());
    let start = urdf.chain_to("base");
    let counted = start.first().is_some_and(|joint| joint.parent == root)
        && start.iter().all(|joint| joint.kind == JointType::Fixed);
    let root_from_base =
        if counted { start.iter().fold(Pose::identity(), |at, joint| at * of_joint(joint)) } else { Pose::identity() };

    let (mut at, mut axes) = (root_from_base.inverse(), Vec::with_capacity(6));
    for joint in &chain {
        at *= of_joint(joint);
        if turns(joint) {
            let axis = Vector3::from(joint.axis);
            let Some(along) = axis.try_normalize(0.0) else {
                return Err(refuse(
                    format!("joint {}: its axis has no direction", joint.name),
                    "give it an <axis xyz=…/>",
                ));
            };
            axes.push(Line { point: at.translation.vector, along: at.rotation * along });
        }
    }
    let rows = Rows::of(&axes, &at).map_err(|(i, message)| {
        refuse(
            format!("joint {}: {message}", turning[i].name),
            "deflex needs six axes, of which no two neighbours coincide",
        )
    })?;
    let limit = |i: usize| {
        let joint = turning[i];
        let [lower, upper] = joint.limit;
        if joint.kind == JointType::Continuous || !(lower.is_finite() && upper.is_finite()) {
            (-TAU, TAU)
        } else {
            (lower, upper)
        }
    };
    if let Some(i) = (0..6).find(|&i| limit(i).0 >= limit(i).1) {
        return Err(refuse(
            format!("joint {}: its limits leave no room", turning[i].name),
            "lower must lie below upper, in radians",
        ));
    }
    let limits =
        Limits { min: Joints::from_fn(|i, _| limit(i).0), max: Joints::from_fn(|i, _| limit(i).1), elbow: None };
    let axes_of = Axes { sign: rows.sign, ..Axes::SERIAL };
    let robot = Robot::new(&urdf.name, rows.rows, axes_of, limits).standing_at(rows.base);

    // The rows are used only if they reproduce the description.
    let flange_from_tip = rows.flange_from_tip;
    for trial in 0..TRIALS {
        let angles = Joints::from_fn(|i, _| PI * ((trial * 6 + i) as f64 * 0.754_877_666).fract().mul_add(2.0, -1.0));
        let mut described = root_from_base.inverse();
        let mut next = angles.iter();
        for joint in &chain {
            described *= of_joint(joint);
            if turns(joint) {
                let axis = Vector3::from(joint.axis).normalize();
                described *= Rotation3::new(axis * *next.next().unwrap_or(&0.0));
            }
        }
        let ours = rows.base * robot.forward(&angles) * flange_from_tip;
        let off = (ours.translation.vector - described.translation.vector).norm();
        let turned = (ours.rotation.matrix() - described.rotation.matrix()).amax();
        // NaN fails this test too.
        if !(off <= SAME && turned <= SAME) {
            let message = format!("the rows differ from the description by {:.1e} mm", 1e3 * off);
            return Err(refuse(message, "please report this description: its chain should be one of six axes"));
        }
    }
    let identity = flange_from_tip.translation.vector.norm() < SAME
        && (flange_from_tip.rotation.matrix() - Matrix3::identity()).amax() < SAME;
    Ok(Described { name: urdf.name, robot, flange_from_tip: (!identity).then_some(flange_from_tip), tip })
}

/// The type of a joint, as the file names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum JointType {
    Revolute,
    Continuous,
    Prismatic,
    Fixed,
    Floating,
    Planar,
    Spherical,
}

impl JointType {
    const ALL: [(&'static str, Self); 7] = [
        ("revolute", Self::Revolute),
        ("continuous", Self::Continuous),
        ("prismatic", Self::Prismatic),
        ("fixed", Self::Fixed),
        ("floating", Self::Floating),
        ("planar", Self::Planar),
        ("spherical", Self::Spherical),
    ];
}

/// A joint between two links: its frame in the parent's frame (m, rad), its axis in its own frame, and its limits
/// (rad).
struct Joint {
    name: String,
    kind: JointType,
    parent: String,
    child: String,
    xyz: [f64; 3],
    rpy: [f64; 3],
    axis: [f64; 3],
    limit: [f64; 2],
}

impl Joint {
    fn read(node: Node<'_, '_>) -> Result<Self, String> {
        let name = attribute(node, "name")?;
        let kind = attribute(node, "type")?;
        let known = JointType::ALL.iter().find(|(word, _)| *word == kind);
        let (_, kind) = known.ok_or_else(|| format!("{}joint {name}: there is no type `{kind}`", at(node)))?;
        let part = |tag: &str| node.children().find(|child| child.has_tag_name(tag));
        let link = |tag: &str| {
            let part = part(tag).ok_or_else(|| format!("{}joint {name}: <{tag} link=…/> is missing", at(node)))?;
            attribute(part, "link")
        };
        let of = |tag: &str, key: &str, absent: [f64; 3]| part(tag).map_or(Ok(absent), |part| three(part, key, absent));
        let limit = |key: &str| match part("limit").and_then(|limit| limit.attribute(key)) {
            None => Ok(0.0),
            Some(text) => number(text).ok_or_else(|| format!("{}joint {name}: `{text}` is not a number", at(node))),
        };
        Ok(Self {
            kind: *kind,
            parent: link("parent")?,
            child: link("child")?,
            xyz: of("origin", "xyz", [0.0; 3])?,
            rpy: of("origin", "rpy", [0.0; 3])?,
            axis: of("axis", "xyz", [1.0, 0.0, 0.0])?,
            limit: [limit("lower")?, limit("upper")?],
            name,
        })
    }
}

/// The line of an element in the file.
fn at(node: Node<'_, '_>) -> String {
    format!("line {}: ", node.document().text_pos_at(node.range().start).row)
}

fn attribute(node: Node<'_, '_>, key: &str) -> Result<String, String> {
    let missing = || format!("{}<{}> has no {key}=\"…\"", at(node), node.tag_name().name());
    node.attribute(key).map(str::to_owned).ok_or_else(missing)
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|value: &f64| !value.is_nan())
}

/// Three finite numbers separated by blanks.
fn three(node: Node<'_, '_>, key: &str, absent: [f64; 3]) -> Result<[f64; 3], String> {
    let Some(text) = node.attribute(key) else { return Ok(absent) };
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(number).collect();
    let three = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    three
        .filter(|three| three.iter().all(|value| value.is_finite()))
        .ok_or_else(|| format!("{}{key}=\"{text}\" of <{}>: expected three numbers", at(node), node.tag_name().name()))
}

/// The content of a description.
struct Description {
    name: String,
    links: Vec<String>,
    joints: Vec<Joint>,
    /// Index of the joint that carries a link, by the link's name.
    carries: HashMap<String, usize>,
}

impl Description {
    fn read(text: &str) -> Result<Self, String> {
        /// Largest number of XML nodes: the largest real descriptions have about ten thousand.
        const MOST_NODES: u32 = 10_000_000;
        let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
        let document = roxmltree::Document::parse_with_options(text, options).map_err(|error| error.to_string())?;
        let robot = document.root_element();
        if !robot.has_tag_name("robot") {
            return Err(format!("<{}> stands at its top", robot.tag_name().name()));
        }
        let all = |tag: &'static str| robot.children().filter(move |child| child.has_tag_name(tag));
        let links = all("link").map(|link| attribute(link, "name")).collect::<Result<_, _>>()?;
        let joints: Vec<Joint> = all("joint").map(Joint::read).collect::<Result<_, _>>()?;
        let mut carries = HashMap::new();
        for (i, joint) in joints.iter().enumerate() {
            carries.entry(joint.child.clone()).or_insert(i);
        }
        Ok(Self { name: attribute(robot, "name")?, links, joints, carries })
    }

    /// The joints from the root to a link, in this order.
    fn chain_to(&self, tip: &str) -> Vec<&Joint> {
        let mut chain = Vec::new();
        let mut link = tip;
        // The chain is limited, because a description could name a link as its own ancestor.
        while let Some(&i) = self.carries.get(link).filter(|_| chain.len() <= self.joints.len()) {
            chain.push(&self.joints[i]);
            link = &self.joints[i].parent;
        }
        chain.reverse();
        chain
    }

    /// The last link, if the caller names none.
    fn tip(&self) -> Result<String, String> {
        let moves = |link: &str| self.chain_to(link).iter().filter(|joint| joint.kind != JointType::Fixed).count();
        if let Some(usual) = ["tool0", "flange"].into_iter().find(|usual| moves(usual) == 6) {
            return Ok(usual.to_owned());
        }
        let moving = || self.joints.iter().filter(|joint| joint.kind != JointType::Fixed);
        let parents: HashSet<&str> = moving().map(|joint| &joint.parent[..]).collect();
        let ends = moving().map(|joint| &joint.child[..]).filter(|link| !parents.contains(link) && moves(link) == 6);
        match ends.collect::<Vec<_>>()[..] {
            [end] => Ok(end.to_owned()),
            [] => Err("no chain of six joints that turn was found".to_owned()),
            ref ends => Err(format!("several chains have six joints, to {}", ends.join(", "))),
        }
    }
}

/// An axis in space, base frame, m.
#[derive(Clone, Copy)]
struct Line {
    point: Vector3<f64>,
    along: Vector3<f64>,
}

impl Line {
    /// The point of this axis that is nearest to another axis.
    fn foot(&self, other: &Self) -> Vector3<f64> {
        let normal = self.along.cross(&other.along);
        let between = other.point - self.point;
        let along = between.cross(&other.along).dot(&normal) / normal.norm_squared();
        self.point + self.along * along
    }

    /// The point of this axis that is nearest to a point.
    fn foot_of(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.point + self.along * self.along.dot(&(point - self.point))
    }

    fn parallel(&self, other: &Self) -> bool {
        self.along.cross(&other.along).norm() < PARALLEL
    }
}

struct Rows {
    rows: [DhRow; 6],
    sign: [f64; 6],
    /// The frame in which the first row starts, in the base frame of the description.
    base: Pose,
    flange_from_tip: Pose,
}

impl Rows {
    /// Modified rows (Craig) of six axes and the last link at zero joint angles. The error names the axis that has no
    /// row, and the reason.
    ///
    /// The directions of the axes are chosen so that an arm with parallel axes 2 and 3 and a spherical wrist gets the
    /// twists 0, −90, 0, −90, 90, −90 degrees, for which there is an explicit inverse.
    fn of(given: &[Line], tip: &Pose) -> Result<Self, (usize, &'static str)> {
        const TWIST: [f64; 5] = [-1.0, 1.0, -1.0, 1.0, -1.0];
        let mut axes: Vec<Line> = given.to_vec();
        let mut point_along = |i: usize, direction: Vector3<f64>| {
            if axes[i].along.dot(&direction) < 0.0 {
                axes[i].along = -axes[i].along;
            }
        };
        point_along(0, Vector3::z());
        point_along(5, tip.rotation * Vector3::z());
        let (first, second) = (axes[0], axes[1]);
        if !first.parallel(&second) {
            // Axis 2 is in front of axis 1, or points to the left.
            let ahead = second.foot(&first) - first.foot(&second);
            let turned = first.along.cross(&second.along);
            let flip = if ahead.norm() > SAME { turned.dot(&ahead) > 0.0 } else { second.along.y < 0.0 };
            if flip {
                axes[1].along = -second.along;
            }
        }
        for i in [2, 4] {
            let along = axes[1].along;
            if axes[i].along.dot(&along) < 0.0 {
                axes[i].along = -axes[i].along;
            }
        }
        // The axis of the forearm points from the elbow to the wrist.
        let forearm = if axes[3].parallel(&axes[2]) { axes[2].along } else { axes[4].point - axes[2].point };
        if axes[3].along.dot(&forearm) < 0.0 {
            axes[3].along = -axes[3].along;
        }

        // The base frame is that of the description if axis 1 passes vertically through its origin.
        let upright =
            axes[0].along.cross(&Vector3::z()).norm() < PARALLEL && axes[0].foot_of(&Vector3::zeros()).norm() < SAME;
        let base = if upright {
            Pose::identity()
        } else {
            let z = axes[0].along;
            let x = (Vector3::x() - z * z.x).try_normalize(1e-3).unwrap_or_else(|| z.cross(&Vector3::y()).normalize());
            Pose::from_parts(Translation3::from(axes[0].foot_of(&Vector3::zeros())), frame(&x, &z))
        };
        let mut frames = vec![(base.translation.vector, base.rotation * Vector3::x(), base.rotation * Vector3::z())];
        for i in 0..5 {
            let (axis, next) = (axes[i], axes[i + 1]);
            let (origin, x) = if axis.parallel(&next) {
                let before = frames[i];
                let from = Line { point: before.0, along: before.2 };
                let origin = if i == 0 || from.parallel(&axis) { axis.foot_of(&before.0) } else { axis.foot(&from) };
                let across = next.foot_of(&origin) - origin;
                (origin, across.try_normalize(SAME).ok_or((i + 1, "it turns about the same axis as the one before"))?)
            } else {
                let normal = axis.along.cross(&next.along).normalize();
                (axis.foot(&next), normal * if i == 1 { 1.0 } else { TWIST[i] })
            };
            frames.push((origin, x, axis.along));
        }
        let (last, point) = (axes[5], tip.translation.vector);
        let tip_z = tip.rotation * Vector3::z();
        let origin = last.foot_of(&point);
        let tip_x = tip.rotation * Vector3::x();
        let x = if tip_z.cross(&last.along).norm() < PARALLEL {
            (tip_x - last.along * tip_x.dot(&last.along)).normalize()
        } else {
            frames[5].1
        };
        frames.push((origin, x, last.along));
        let base_from_flange = Pose::from_parts(Translation3::from(origin), frame(&x, &last.along));
        let rows = std::array::from_fn(|i| {
            let ((o0, x0, z0), (o1, x1, z1)) = (frames[i], frames[i + 1]);
            DhRow {
                alpha: z0.cross(&z1).dot(&x0).atan2(z0.dot(&z1)),
                a: (o1 - o0).dot(&x0),
                theta: x0.cross(&x1).dot(&z1).atan2(x0.dot(&x1)),
                d: (o1 - o0).dot(&z1),
            }
        });
        let sign = std::array::from_fn(|i| axes[i].along.dot(&given[i].along).signum());
        Ok(Self { rows, sign, base, flange_from_tip: base_from_flange.inv_mul(tip) })
    }
}

/// A frame from two of its axes, which are perpendicular unit vectors.
fn frame(x: &Vector3<f64>, z: &Vector3<f64>) -> Rotation3<f64> {
    let mut frame = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[*x, z.cross(x), *z]));
    frame.renormalize();
    frame
}
