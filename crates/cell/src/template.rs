use super::Described;
use deflex_effects::KINDS;
use deflex_program::Language;
use deflex_program::orientation::quaternion;
use deflex_robot::{Builtin, Joints, Pose, Robot};
use deflex_text::{Diagnostic, Severity, Source, Span};
use std::fmt::Write;

/// Marks an example value of [`template`] that the user has to replace.
const MARK: &str = "# <<";

/// A commented cell file to start from. It describes the user's cell after every value marked `# <<` has been replaced.
///
/// # Examples
/// ```
/// use deflex_cell::template;
/// use deflex_robot::Builtin;
///
/// let text = template(Builtin::named("IRB 6660-205/1.9").expect("a built-in robot"));
/// assert!(text.contains("model = \"irb6660-205-1.9\"") && text.contains("# <<"));
/// ```
#[must_use]
pub fn template(robot: &Builtin) -> String {
    let speech = Speech::of(robot.language());
    let head = format!(
        r#"[robot]
model = "{model}"     # geometry from: {source}
{start}# base_mm = [0, 0, 0]               # where the base stands in the world
# base_{turn}

# Geometry of the model. For a similar robot, remove the comment signs and change the numbers; `model` is then only a name.
{kinematics}"#,
        model = robot.model,
        source = robot.source,
        start = start_line(&robot.robot()),
        turn = speech.upright,
        kinematics = kinematics(robot),
    );
    cell(&head, &stiffness(robot.stiffness_nm_per_rad), &Frames::examples(speech, ""), speech)
}

/// A cell file for a robot from a description (URDF). The comment names `file`.
///
/// # Examples
/// ```
/// use deflex_cell::{described, described_template};
/// use deflex_text::{Diagnostics, Source};
///
/// fn init(urdf: &str) -> Result<String, Diagnostics> {
///     let robot = described(&Source::new(urdf, std::fs::read(urdf)?), Some("tool0"))?;
///     Ok(described_template(&robot, urdf))
/// }
/// ```
#[must_use]
pub fn described_template(described: &Described, file: &str) -> String {
    let robot = &described.robot;
    let mut head = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        head,
        "[robot]\nmodel = {}     # a name; geometry from {}, up to link {}",
        quoted(&described.name),
        comment(file),
        comment(&described.tip)
    );
    head += &start_line(robot);
    let base = &robot.world_from_base;
    let at = if *base == Pose::identity() { "# " } else { "" };
    let (mm, quat) = ((base.translation.vector * 1e3).as_slice().to_vec(), quaternion(&base.rotation));
    let _ = writeln!(
        head,
        "{at}base_mm = {mm:?}   # where axis 1 stands in the description's base, and that in the world\n{at}base_quat = {quat:?}\n"
    );
    head += "[robot.kinematics]               # modified DH (Craig): Rx(alpha) Tx(a) Rz(theta + joint) Tz(d)\nparallelogram = false             # << true: motor 3 sets the forearm's angle to link 1, not to link 2\nlinks = [\n";
    for row in robot.links.rows() {
        let (alpha, a, d, theta) = (row.alpha.to_degrees(), 1e3 * row.a, 1e3 * row.d, row.theta.to_degrees());
        let _ = writeln!(head, "  {{ alpha_deg = {alpha:?}, a_mm = {a:?}, d_mm = {d:?}, theta_deg = {theta:?} }},");
    }
    let deg = |limits: &Joints| limits.map(f64::to_degrees).as_slice().to_vec();
    let _ = writeln!(
        head,
        "]\naxis_sign = {:?}   # joint = sign * axis\naxis_min_deg = {:?}\naxis_max_deg = {:?}",
        robot.axes.sign,
        deg(&robot.limits.min),
        deg(&robot.limits.max),
    );
    let tool = described.flange_from_tip.map_or_else(String::new, |tip| {
        let (mm, quat) = ((tip.translation.vector * 1e3).as_slice().to_vec(), quaternion(&tip.rotation));
        format!("\n# Link {} of the description, on the flange of the rows above.\n[tools.tip]\ntcp_mm = {mm:?}\ntcp_quat = {quat:?}\n", comment(&described.tip))
    });
    cell(&head, &stiffness(None), &Frames::examples(&RAPID, &tool), &RAPID)
}

/// `[robot] start_deg` as a comment, with the home position, which is the default.
pub(super) fn start_line(robot: &Robot) -> String {
    let home: Vec<String> = robot.home_deg().iter().map(f64::to_string).collect();
    format!(
        "# start_deg = [{}]   # posture of the arm at the first target, if the program does not state it\n",
        home.join(", ")
    )
}

/// The terms that a maker's controllers use.
struct Speech {
    /// Name of an example tool: its key in `[tools]`.
    tool: &'static str,
    /// Name of an example work object.
    wobj: &'static str,
    /// Key and value of an orientation without a turn, without the prefix `tcp_` or another one.
    upright: &'static str,
    /// Where the pendant shows a tool's frame, its orientation, its mass, its centre of gravity, and a work object's
    /// frame.
    places: [&'static str; 5],
    /// Further keys of a work object.
    object: &'static str,
    /// Templates of `[cl.post]`.
    post: [&'static str; 2],
    /// Name and axis of an example mechanical unit, and where the maker's language uses them.
    unit: [&'static str; 3],
    /// Comments about the path that the maker's controllers drive: what is known with its source, and the keys of
    /// `[controller.path]`. See docs/driven-path.md.
    path: &'static str,
}

const RAPID: Speech = Speech {
    tool: "tMill",
    wobj: "wPart",
    upright: "quat = [1.0, 0.0, 0.0, 0.0]",
    places: ["tooldata, tframe", "tooldata, tframe", "tooldata, tload", "tooldata, tload", "wobjdata, uframe"],
    object: "oframe_mm = [0.0, 0.0, 0.0]           # << wobjdata, oframe\n\
             oframe_quat = [1.0, 0.0, 0.0, 0.0]    # << wobjdata, oframe\n",
    post: ["rToolChange {number};", "rSpindle {rpm};"],
    unit: ["STN1", "eax_b", "as ActUnit and ufmec name it"],
    path: "\
# These numbers describe the joint logs of an IRB 6640 with its IRC5 controller (github.com/hehonglu123/ABB_Primitive_Study).
# [controller.path]
# zone_share = 0.87
# smoothing_s = [0.058, 0.058]
# acceleration_mm_s2 = 8000.0
# passing_acceleration_mm_s2 = 16000.0
# corner_acceleration_mm_s2 = 4000.0",
};

const KUKA: Speech = Speech {
    tool: "\"TOOL_DATA[1]\"",
    wobj: "\"BASE_DATA[1]\"",
    upright: "abc_deg = [0.0, 0.0, 0.0]",
    places: ["TOOL_DATA[1], X Y Z", "TOOL_DATA[1], A B C", "LOAD_DATA[1], M", "LOAD_DATA[1], CM X Y Z", "BASE_DATA[1]"],
    object: "",
    post: ["rToolChange({number})", "rSpindle({rpm})"],
    unit: ["E1", "eax_a", "E1 … E6 are eax_a … eax_f"],
    path: "\
# With C_DIS a motion leaves its path at the earliest $APO.CDIS before its end, and not before half of it (KUKA System Software,
# Operating and Programming Instructions for System Integrators, Approximate positioning). The shape of the rounding, smoothing and
# accelerations are not published: zone_share = 1.0 is the most that can be rounded.
# [controller.path]
# zone_share = 1.0
# zone_mm = 5.0                 # where the program does not say $APO.CDIS, and for C_VEL, C_ORI and C_SPL",
};

const FANUC: Speech = Speech {
    tool: "\"UT 1\"",
    wobj: "\"UF 1\"",
    upright: "wpr_deg = [0.0, 0.0, 0.0]",
    places: ["UTOOL 1, X Y Z", "UTOOL 1, W P R", "PAYLOAD", "PAYLOAD CENTER, which the pendant has in cm", "UFRAME 1"],
    object: "",
    post: ["CALL TOOLCHG({number})", "CALL SPINDLE({rpm})"],
    unit: ["GP2", "eax_a", "the motion group"],
    path: "\
# CNT is a share of the speed and no distance: how far a corner is rounded depends on speed and acceleration, which FANUC does not
# publish. The number of CR is not used: from where it is measured is not published. Measure a corner, or find the law from logs.
# [controller.path]
# zone_share = 1.0
# zone_mm = 5.0                 # measured with CNT at your speed",
};

const UR: Speech = Speech {
    tool: "TCP",
    wobj: "wPart",
    upright: "quat = [1.0, 0.0, 0.0, 0.0]",
    places: ["TCP, X Y Z", "TCP, RX RY RZ as a quaternion", "payload", "payload, CX CY CZ", "a feature, in the world"],
    object: "",
    post: ["tool_change({number})", "spindle({rpm})"],
    unit: ["TRACK1", "eax_a", "of the cell"],
    path: "\
# A motion may leave its way within the blend radius of its end, and blends cannot overlap (Universal Robots, User Manual, Blend
# parameters). The acceleration is the default of movel, a = 1.2 m/s^2 (URScript Manual). Shape and smoothing are not published.
# [controller.path]
# zone_share = 1.0
# acceleration_mm_s2 = 1200.0",
};

const YASKAWA: Speech = Speech {
    tool: "\"TOOL 1\"",
    wobj: "\"USER 1\"",
    upright: "wpr_deg = [0.0, 0.0, 0.0]",
    places: ["TOOL 1, X Y Z", "TOOL 1, Rx Ry Rz", "TOOL 1, W", "TOOL 1, Xg Yg Zg", "user coordinates 1"],
    object: "",
    post: ["CALL JOB:TOOLCHG ({number})", "CALL JOB:SPINDLE ({rpm})"],
    unit: ["ST1", "eax_a", "the station"],
    path: "\
# PL=0 stops; how near PL=1 to PL=8 pass is set in the controller's parameters (S1CxG33 and the following ones), and CR= states a
# radius. Shape, smoothing and accelerations are not published: zone_share = 1.0 is the most that can be rounded.
# [controller.path]
# zone_share = 1.0
# zone_mm = 5.0                 # of the position level of your programs",
};

impl Speech {
    /// The terms for a language; those of RAPID for controllers for which deflex does not write programs.
    fn of(language: Option<Language>) -> &'static Self {
        match language {
            Some(Language::Krl) => &KUKA,
            Some(Language::Ls) => &FANUC,
            Some(Language::Ur) => &UR,
            Some(Language::Jbi) => &YASKAWA,
            Some(Language::Rapid | Language::Cl) | None => &RAPID,
        }
    }

    /// An example of `[tools.…]`.
    fn tool_example(&self) -> String {
        let [frame, turn, mass, centre, _] = self.places;
        format!(
            "[tools.{}]\ntcp_mm = [0.0, 0.0, 310.0]      # << {frame}\ntcp_{} # << {turn}\n\
             mass_kg = 18.0                  # << {mass}\ncog_mm = [0.0, 0.0, 120.0]      # << {centre}\n",
            self.tool, self.upright
        )
    }

    /// An example of `[wobjs.…]`.
    fn wobj_example(&self) -> String {
        let frame = self.places[4];
        format!(
            "[wobjs.{}]\nuframe_mm = [1000.0, -400.0, 700.0]   # << {frame}\nuframe_{}    # << {frame}\n{}",
            self.wobj, self.upright, self.object
        )
    }
}

/// Text of the tools and work objects of a cell file, and the one of each that CL data use.
#[derive(Clone, Default)]
pub(super) struct Frames {
    pub(super) text: String,
    pub(super) tool: Option<String>,
    pub(super) wobj: Option<String>,
}

impl Frames {
    /// Examples of both, followed by a tool that is known.
    fn examples(speech: &Speech, tool: &str) -> Self {
        let text = format!("{}{tool}\n{}", speech.tool_example(), speech.wobj_example());
        Self { text, tool: None, wobj: None }
    }
}

/// The cell file made from the backup of a controller. `head` is the text before the stiffness.
pub(super) fn backup_cell(head: &str, published: Option<[f64; 6]>, frames: &Frames) -> String {
    let mut own = frames.clone();
    if frames.tool.is_none() {
        own.text += &RAPID.tool_example();
        own.text.push('\n');
    }
    if frames.wobj.is_none() {
        own.text += &RAPID.wobj_example();
    }
    cell(head, &stiffness(published), &own, &RAPID)
}

/// Text from another file as a TOML string.
pub(super) fn quoted(text: &str) -> String {
    toml_edit::Value::from(text).to_string()
}

/// Text from another file without line breaks and other control characters, for a comment.
pub(super) fn comment(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

fn cell(head: &str, stiffness: &str, frames: &Frames, speech: &Speech) -> String {
    let named = |own: &Option<String>, example: &str| {
        own.as_ref().map_or_else(|| format!("\"{}\"", example.trim_matches('"')), |own| format!("\"{own}\""))
    };
    let (tool, wobj) = (named(&frames.tool, speech.tool), named(&frames.wobj, speech.wobj));
    let frames = &frames.text;
    let ([tool_change, spindle_on], [unit, axis, unit_named], upright) = (speech.post, speech.unit, speech.upright);
    let path = speech.path;
    let mut text = String::new();
    let names: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
    let kinds: Vec<String> = names.chunks(7).map(|line| line.join(", ")).collect();
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        r#"# Cell file of deflex. Every value marked "<<" is an example: replace it by the value of your cell, then delete the "<<".
# Each run reports the examples that are left. Remove what you do not need (CL data, tools that the programs declare).
# Units are in the names. Orientations: `…_quat` = [q1, q2, q3, q4], scalar first, as RAPID writes them; `…_abc_deg` = KUKA's A, B, C;
# `…_wpr_deg` = FANUC's W, P, R.

{head}
{stiffness}

[limits]
max_correction_mm = 5.0         # a larger correction stops the run
max_step_mm = 0.5               # so does a larger step between neighbouring corrections

[controller]
compensates = []                # << "gravity", "geometry": what the controller corrects by itself (Absolute Accuracy)

# The path that the controller drives. Find the law of your controller: deflex identify --log PROGRAM LOG.csv
{path}
# axis_acceleration_deg_s2 = [300, 300, 300, 600, 600, 900]   # limits of your axes: they slow the arm down

# Tools and work objects, by the names in the program, that it uses and does not declare; and those of CL input.
{frames}
[cl]                            # CL input only
tool = {tool}                  # of [tools]
# tools = {{ "1" = "tRough", "2" = "tFinish" }}   # LOADTL numbers to [tools]; needed where the file has several
wobj = {wobj}                  # of [wobjs]
units = "mm"                    # << where the file does not say: mm | inch
point = "tip"                   # << what GOTO names: tip | centre
spin = "fixed"                  # the TCP's x axis: fixed | feed | towards | stiffest (chosen along the path)
spin_deg = 0.0
# singular_margin_deg = 10.0      # stiffest: how far axis 5 stays from 0
# external = {{ eax_a = 0.0 }}      # where the mechanical units ([[unit]]) stand, mm or degrees
# harmless = ["RETRCT"]           # words that do nothing on your machine: listed instead of refused
# [cl.post]                       # lines of the posted program; what has no line is listed, a tool change is an error
# tool_change = "{tool_change}"
# spindle_on = "{spindle_on}"

[cut]
force = "mechanistic"           # none | constant | table | mechanistic
max_cutting_feed_mm_s = 100.0   # << faster moves are air

[cut.cutter]
diameter_mm = 25.0              # <<
corner_radius_mm = 5.0          # << half the diameter: a ball
teeth = 2                       # <<
helix_deg = 30.0                # <<

[cut.engagement]
mode = "slot"                   # << slot | up (conventional) | down (climb) | stock (what is left of [stock])
depth_mm = 1.5                  # << along the surface normal
width_mm = 25.0                 # << stepover: distance to the neighbouring pass of the same cutter
feed_per_tooth_mm = 0.07        # << left out: from feed, spindle_rpm and teeth
lead_deg = 5.0                  # << tool axis against the surface normal, forward
tilt_deg = 10.0                 # << and sideways

[cut.coefficients]
material = "al7075"             # << a literature value is a start only: calibrate with a dynamometer

# What the cutters meet, where `mode = "stock"` in [cut.engagement] (or in [tools.X.engagement]): the blank, less all that is cut before.
# [stock]
# wobj = {wobj}                # in whose axes; left out: the first work object that cuts
# box_mm = [[0.0, 0.0, -40.0], [300.0, 200.0, 0.0]]
# stl = "blank.stl"             # instead of the box: a closed mesh, mm, relative to this file
# resolution_mm = 0.5           # left out: from the smallest cutter
# [part]
# stl = "part.stl"              # what `deflex simulate` compares with, in the stock's axes; left out: the part as programmed
# cell_mm = 1.0                 # where [part.material] is declared: size of the cells; left out: from the blank
# stages = 6                    # and in how many stages of the stock the part is computed at most
# [part.material]               # how the part yields follows from its shape and its clamps
# e_n_mm2 = 71000.0
# nu = 0.33
# [[part.clamp]]                # where it is held, in the stock's axes
# box_mm = [[0.0, 0.0, -40.0], [300.0, 20.0, -30.0]]
# stiffness_n_per_mm = [inf, inf, inf]   # of the clamp as a whole along x, y and z; inf: rigid

# What moves in addition to the robot: tracks, positioners (docs/formats.md).
# [[unit]]
# name = "{unit}"                 # {unit_named}
# axis = "{axis}"                # eax_a … eax_f
# kind = "rotary"               # rotary: degrees about z of its frame | linear: mm along `direction`
# carries = "part"              # part | robot
# min = -360.0
# max = 360.0
# max_speed = 90.0              # mm/s or degrees/s
# free = true                   # where the turn about the tool axis is chosen, so is its position
# base_mm = [1500.0, 0.0, 600.0]
# base_{upright}

# How this shop can measure, for `deflex plan`.
# [plan]
# wobj = {wobj}
# tool = {tool}
# box_mm = [[0.0, 0.0, 0.0], [600.0, 800.0, 250.0]]   # where the TCP may go
# tilt_deg = 30.0               # how far the tool may lean from the work object's z axis
# loads_n = [[0.0, 0.0, 0.0], [0.0, 0.0, 300.0]]      # forces on the tool that can be applied, work object axes
# load_changes = 3              # how often
# instrument = "position"       # position | normal | distance (from_mm = [x, y, z]: where the draw-wire is fixed)
# noise_mm = 0.02               # per axis: instrument and repeatability
# effect_mm = 0.03              # size of effect that must be found
# effects = ["backlash", "gravity"]                   # left out: all that the data could show

# Effects that make the real arm differ; `deflex identify` appends them from measured data. Their kinds:
# {kinds}.
# [[effect]]
# kind = "backlash"
# half_gap_rad = [6e-5, 0, 0, 1.2e-4, 0, 0]
"#,
        kinds = kinds.join(",\n# "),
    );
    text
}

/// `[robot.stiffness]`: the published values of this robot, or examples, because the stiffness of other robots does not
/// apply.
fn stiffness(published: Option<[f64; 6]>) -> String {
    const HOW: &str = "at the motors, axes 1 to 6: hang a known weight on the flange, read the deflection";
    match published {
        Some(stiffness) => format!(
            "[robot.stiffness]               # {HOW}\njoint_nm_per_rad = {stiffness:?}   # << published for this model; yours differs"
        ),
        None => format!(
            "# Needed as soon as a force acts. No stiffness is published for this robot, and that of another robot does not hold for it: measure it.\n\
             # [robot.stiffness]             # {HOW}\n# joint_nm_per_rad = [ , , , , , ]"
        ),
    }
}

/// `[robot.kinematics]` of a built-in robot, as a comment.
fn kinematics(robot: &Builtin) -> String {
    let row = |[alpha, a, d, theta]: &[f64; 4]| {
        format!("#   {{ alpha_deg = {alpha:?}, a_mm = {a:?}, d_mm = {d:?}, theta_deg = {theta:?} }},\n")
    };
    let rows: String = robot.rows.iter().map(row).collect();
    let elbow = robot.elbow_deg.map_or_else(String::new, |[min, max]| {
        let what = if robot.parallelogram { "motor 3 − motor 2" } else { "axis 3 + axis 2" };
        format!("# elbow_min_deg = {min:?}             # {what}\n# elbow_max_deg = {max:?}\n")
    });
    let (parallelogram, min, max) = (robot.parallelogram, robot.min_deg, robot.max_deg);
    let mut counting = String::new();
    if robot.axis_sign.contains(&-1.0) {
        counting += &format!("# axis_sign = {:?}   # joint = sign * axis + axis_offset_deg\n", robot.axis_sign);
    }
    if robot.coupled_23 {
        counting += "# coupled_23 = true                # the controller counts axis 3 against the ground\n";
    }
    format!(
        "# [robot.kinematics]\n# parallelogram = {parallelogram}          # true: motor 3 sets the forearm's angle to link 1, not to link 2\n\
         # links = [                       # modified DH (Craig): Rx(alpha) Tx(a) Rz(theta + joint) Tz(d)\n{rows}# ]\n{counting}\
         # axis_min_deg = {min:?}\n# axis_max_deg = {max:?}\n{elbow}"
    )
}

/// A warning if a cell file still contains example values of [`template`], which are followed by its mark.
#[must_use]
#[doc(hidden)]
pub fn examples_left(source: &Source) -> Option<Diagnostic> {
    let text = source.text(Span::new(0, source.bytes.len()));
    let (mut lines, mut first, mut start) = (Vec::new(), None, 0);
    for (i, line) in text.split_inclusive('\n').enumerate() {
        let value = line.find(MARK).map(|at| line[..at].trim()).filter(|value| !value.is_empty());
        if let Some(value) = value.filter(|value| !value.starts_with('#')) {
            lines.push((i + 1).to_string());
            let from = start + line.len() - line.trim_start().len();
            first.get_or_insert(Span::new(from, from + value.len()));
        }
        start += line.len();
    }
    let message = match &lines[..] {
        [_] => "a value is still the example that `deflex init` printed".to_owned(),
        several => format!(
            "{} values are still the examples that `deflex init` printed: lines {}",
            several.len(),
            several.join(", ")
        ),
    };
    let diagnostic = Diagnostic::error("cell.example", &source.name, message)
        .severity(Severity::Warning)
        .help("put in the value of your cell, then delete the `<<` after it");
    first.map(|span| diagnostic.at(source, span))
}
