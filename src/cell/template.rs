use crate::effects::KINDS;
use crate::robot::Builtin;
use crate::text::{Diagnostic, Severity, Source, Span};
use std::fmt::Write;

/// Stands after a value that is an example of [`template`], until the cell's own is put in.
const MARK: &str = "# <<";

/// A commented cell file to start from: it is the cell's once every value marked `# <<` is the cell's own.
#[must_use]
pub fn template(robot: &Builtin) -> String {
    let mut text = String::new();
    let names: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
    let kinds: Vec<String> = names.chunks(7).map(|line| line.join(", ")).collect();
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        r#"# Cell file of deflex. Every value with "<<" behind it is an example: put in your cell's own, then delete the "<<".
# As long as one is left, each run says so. What a cell does not need (CL input, tools that programs declare) can go.
# Units are in the names. Quaternions are [q1, q2, q3, q4], scalar first, as RAPID writes them.

[robot]
model = "{model}"     # geometry from: {source}
# start_deg = [0, 0, 0, 0, 30, 0]   # how the arm stands at the first target, where the program does not say
# base_mm = [0, 0, 0]               # where the base stands in the world
# base_quat = [1, 0, 0, 0]

# The model's geometry, for a robot that is like it: uncommented, it counts, and `model` is just a name.
{kinematics}
[robot.stiffness]               # at the motors, axes 1 to 6: hang a known weight on the flange, read the deflection
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]   # << example: an IRB 6660-205/1.9

[limits]
max_correction_mm = 5.0         # a larger correction stops the run
max_step_mm = 0.5               # so does a larger step between neighbouring corrections

[controller]
compensates = []                # << "gravity", "geometry": what the controller corrects by itself (Absolute Accuracy)

# Tools and work objects, by the names in the program, that it uses and does not declare; and those of CL input.
[tools.tMill]
tcp_mm = [0.0, 0.0, 310.0]      # << tooldata, tframe
tcp_quat = [1.0, 0.0, 0.0, 0.0] # << tooldata, tframe
mass_kg = 18.0                  # << tooldata, tload
cog_mm = [0.0, 0.0, 120.0]      # << tooldata, tload

[wobjs.wPart]
uframe_mm = [1000.0, -400.0, 700.0]   # << wobjdata, uframe
uframe_quat = [1.0, 0.0, 0.0, 0.0]    # << wobjdata, uframe
oframe_mm = [0.0, 0.0, 0.0]           # << wobjdata, oframe
oframe_quat = [1.0, 0.0, 0.0, 0.0]    # << wobjdata, oframe

[cl]                            # CL input only
tool = "tMill"                  # of [tools]
wobj = "wPart"                  # of [wobjs]
units = "mm"                    # << where the file does not say: mm | inch
point = "tip"                   # << what GOTO names: tip | centre
spin = "fixed"                  # the TCP's x axis: fixed | feed | towards
spin_deg = 0.0

[cut]
force = "mechanistic"           # none | constant | table | mechanistic
max_cutting_feed_mm_s = 100.0   # << faster moves are air

[cut.cutter]
diameter_mm = 25.0              # <<
corner_radius_mm = 5.0          # << half the diameter: a ball
teeth = 2                       # <<
helix_deg = 30.0                # <<

[cut.engagement]
mode = "slot"                   # << slot | up (conventional) | down (climb)
depth_mm = 1.5                  # << along the tool axis
width_mm = 25.0                 # << across the feed
feed_per_tooth_mm = 0.07        # << left out: from feed, spindle_rpm and teeth
lead_deg = 5.0                  # << tool axis against the surface normal, forward
tilt_deg = 10.0                 # << and sideways

[cut.coefficients]
material = "al7075"             # << a literature value is a start only: calibrate with a dynamometer

# Effects that make the real arm differ; `deflex identify` appends them from measured data. Their kinds:
# {kinds}.
# [[effect]]
# kind = "backlash"
# half_gap_rad = [6e-5, 0, 0, 1.2e-4, 0, 0]
"#,
        model = robot.model,
        source = robot.source,
        kinematics = kinematics(robot),
        kinds = kinds.join(",\n# "),
    );
    text
}

/// `[robot.kinematics]` of a built-in robot, commented out.
fn kinematics(robot: &Builtin) -> String {
    let row = |[alpha, a, d, theta]: &[f64; 4]| {
        format!("#   {{ alpha_deg = {alpha:?}, a_mm = {a:?}, d_mm = {d:?}, theta_deg = {theta:?} }},\n")
    };
    let rows: String = robot.rows.iter().map(row).collect();
    let elbow = robot.elbow_deg.map_or_else(String::new, |[min, max]| {
        format!("# elbow_min_deg = {min:?}             # motor 3 − motor 2\n# elbow_max_deg = {max:?}\n")
    });
    let (parallelogram, min, max) = (robot.parallelogram, robot.min_deg, robot.max_deg);
    format!(
        "# [robot.kinematics]\n# parallelogram = {parallelogram}          # true: motor 3 sets the forearm's angle to link 1, not to link 2\n\
         # links = [                       # modified DH (Craig): Rx(alpha) Tx(a) Rz(theta + joint) Tz(d)\n{rows}# ]\n\
         # axis_min_deg = {min:?}\n# axis_max_deg = {max:?}\n{elbow}"
    )
}

/// A warning where a cell file still holds examples of [`template`]: values with its mark behind them.
#[must_use]
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
        .help("put in the cell's own value, then delete the `<<` behind it");
    first.map(|span| diagnostic.at(source, span))
}
