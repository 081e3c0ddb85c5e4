use crate::robot::Builtin;
use std::fmt::Write;

/// A commented cell file to start from: it runs once the values marked `<<` are the cell's own.
#[must_use]
pub fn template(robot: &Builtin) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        r#"# Cell file of deflex. Lines marked << hold examples: put in your cell's own values.
# Units are in the key names. Quaternions are [q1, q2, q3, q4], scalar first, as RAPID writes them.

[robot]
model = "{model}"            # geometry from: {source}
# start_deg = [0, 0, 0, 0, 30, 0]   # how the arm stands at the first target, where the program does not say
# base_mm = [0, 0, 0]               # where the base stands in the world
# base_quat = [1, 0, 0, 0]

[robot.stiffness]
# Torsional stiffness at the motors, axes 1 to 6: hang a known weight on the flange, read the deflection.
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]   # <<

[limits]
max_correction_mm = 5.0       # a larger correction stops the run
max_step_mm = 0.5             # so does a larger step between neighbouring corrections

[controller]
compensates = []              # << "gravity" and "geometry" where the controller already corrects them (Absolute Accuracy)

# Tools and work objects that the program uses and does not declare, and those of CL input.
[tools.tMill]                 # <<
tcp_mm = [0.0, 0.0, 310.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 18.0
cog_mm = [0.0, 0.0, 120.0]

[wobjs.wPart]                 # <<
uframe_mm = [1000.0, -400.0, 700.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]

[cl]                          # CL input only
tool = "tMill"
wobj = "wPart"
units = "mm"                  # where the file does not say: mm | inch
point = "tip"                 # what GOTO names: tip | centre
spin = "fixed"                # the TCP's x axis: fixed | feed | towards
spin_deg = 0.0

[cut]
force = "mechanistic"         # none | constant | table | mechanistic
max_cutting_feed_mm_s = 100.0 # faster moves are air

[cut.cutter]                  # <<
diameter_mm = 25.0
corner_radius_mm = 5.0
teeth = 2
helix_deg = 30.0

[cut.engagement]              # <<
mode = "slot"                 # slot | up | down
depth_mm = 1.5
width_mm = 25.0
feed_per_tooth_mm = 0.07
lead_deg = 5.0
tilt_deg = 10.0

[cut.coefficients]            # << literature values are a start only: calibrate with a dynamometer
material = "al7075"

# Effects that make the real arm differ; `deflex identify` appends them from measured data.
# [[effect]]
# kind = "backlash"
# half_gap_rad = [6e-5, 0, 0, 1.2e-4, 0, 0]
"#,
        model = robot.model,
        source = robot.source,
    );
    text
}
