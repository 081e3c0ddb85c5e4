//! Warns about values that are possible but seldom intended: most of them are right numbers in another unit.
//!
//! The usual ranges are wide, so that a value outside deserves a look. Each range names its source. A value that no
//! machine can have is an error.

use super::check::Check;
use super::raw;
use deflex_robot::Robot;

/// The usual range of a value.
struct Usual<'a> {
    unit: &'a str,
    least: f64,
    most: f64,
    /// Source of the range.
    source: &'a str,
    /// Other units, and the factor by which a number in them is larger.
    units: &'a [(&'a str, f64)],
}

/// A value larger than the usual range by this factor is an error.
const IMPOSSIBLE: f64 = 1e3;

impl Usual<'_> {
    /// Reports a value outside of the range: as a warning, or as an error if it is impossible and `may_stop` is set.
    fn look(&self, check: &mut Check, key: &str, value: f64, may_stop: bool) {
        let Self { unit, least, most, source, units } = self;
        // Other checks report zero and negative values.
        if !value.is_finite() || value <= 0.0 || (*least..=*most).contains(&value) {
            return;
        }
        let meant = units.iter().find(|(_, factor)| (*least..=*most).contains(&(value / factor)));
        let looks = meant.map_or_else(String::new, |(unit, _)| format!(": it looks like {unit}"));
        let message = format!(
            "{key} is {} {unit}, usually {} to {} {unit} ({source}){looks}",
            if value < 1e9 { value.to_string() } else { format!("{value:e}") },
            figure(*least),
            figure(*most)
        );
        let help = match meant {
            Some((_, factor)) => format!("{} {unit} would be usual; check the unit", figure(value / factor)),
            None => "check the value and its unit".to_owned(),
        };
        if may_stop && value > most * IMPOSSIBLE {
            check.error(key, message, help);
        } else {
            check.warn(key, message, help);
        }
    }
}

/// The number with two digits, in the shorter of two notations.
fn figure(value: f64) -> String {
    let rounded: f64 = format!("{value:.1e}").parse().unwrap_or(value);
    if (1e-3..1e5).contains(&rounded) { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// Adds warnings and errors about implausible values of a cell.
pub(super) fn check(check: &mut Check, raw: &raw::Cell, robot: Option<&Robot>) {
    if let Some(robot) = robot {
        stiffness(check, raw, robot);
        kinematics(check, raw);
    }
    tools(check, raw);
    frames(check, raw);
    if let Some(cut) = &raw.cut {
        cutting(check, cut);
    }
}

/// Joint stiffness grows with the square of a robot's size. The range of 8,000 to 2,000,000 N·m/rad for each square
/// metre of reach covers the published values, from Dumas et al. 2011 (KUKA KR 270: 4e5 to 4e6), Abele et al. 2007 and
/// Klimchik et al. 2014 down to arms with a payload of a few kilograms.
fn stiffness(check: &mut Check, raw: &raw::Cell, robot: &Robot) {
    const PER_M2: [f64; 2] = [8e3, 2e6];
    let Some(stiffness) = &raw.robot.stiffness else { return };
    let values = stiffness.joint_nm_per_rad;
    if values.iter().any(|value| !value.is_finite() || *value <= 0.0) {
        return;
    }
    let mean = (values.iter().map(|value| value.ln()).sum::<f64>() / 6.0).exp();
    let reach = robot.links.rows().iter().map(|row| row.a.abs().max(row.d.abs())).skip(1).sum::<f64>();
    let [least, most] = PER_M2.map(|value| value * reach * reach);
    let usual = Usual {
        unit: "N·m/rad (mean of the six)",
        least,
        most,
        source: "published identifications of arms of this reach, such as Dumas et al. 2011, Robotics and CIM 27",
        units: &[("N·mm/rad", 1e3), ("N·m/deg", 1.0 / 57.295_779_513_082_32), ("kN·m/rad", 1e-3)],
    };
    usual.look(check, "robot.stiffness.joint_nm_per_rad", rounded(mean), false);
}

/// The number rounded to six digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Checks the lengths of links and the limits of axes.
fn kinematics(check: &mut Check, raw: &raw::Cell) {
    let Some(own) = &raw.robot.kinematics else { return };
    let (Some(links), Some(min), Some(max)) = (&own.links, &own.axis_min_deg, &own.axis_max_deg) else { return };
    let size: f64 = links.iter().flat_map(|link| [link.a_mm, link.d_mm]).flatten().map(f64::abs).sum();
    let length = Usual {
        unit: "mm (all lengths together)",
        least: 100.0,
        most: 20_000.0,
        source: "industrial robots reach 0.3 to 5 m",
        units: &[("m", 1e-3), ("µm", 1e3)],
    };
    length.look(check, "robot.kinematics.links", rounded(size), true);
    // Limits smaller than two turns in radians look like radians, because no robot has limits of a few degrees on every
    // axis.
    const RAD: f64 = 13.0;
    let widest = min.iter().chain(max).fold(0.0_f64, |most, limit| most.max(limit.abs()));
    if widest > 0.0 && widest < RAD {
        check.warn(
            "robot.kinematics.axis_max_deg",
            format!(
                "no axis turns by more than {widest}°, usually 100° to 400° (makers' data sheets): it looks like rad"
            ),
            "give degrees",
        );
    }
}

fn tools(check: &mut Check, raw: &raw::Cell) {
    let mass = Usual {
        unit: "kg",
        least: 0.01,
        most: 1000.0,
        source: "the strongest robots in series carry 2,300 kg, a spindle weighs 5 to 150 kg",
        units: &[("g", 1e3)],
    };
    let length = Usual {
        unit: "mm",
        least: 2.0,
        most: 3000.0,
        source: "tool centre points are 50 to 1,500 mm from the flange",
        units: &[("m", 1e-3), ("µm", 1e3)],
    };
    for (name, tool) in &raw.tools {
        mass.look(check, &format!("tools.{name}.mass_kg"), tool.mass_kg, false);
        if let Some(tcp_mm) = tool.tcp_mm {
            length.look(check, &format!("tools.{name}.tcp_mm"), rounded(norm(tcp_mm)), true);
        }
        length.look(check, &format!("tools.{name}.cog_mm"), rounded(norm(tool.cog_mm)), true);
        let of_cut = raw.cut.as_ref();
        let own = Milling {
            key: &format!("tools.{name}"),
            cutter: tool.cutter.as_ref(),
            engagement: tool.engagement.as_ref(),
            coefficients: tool.coefficients.as_ref(),
        };
        own.look(check, of_cut.and_then(|cut| cut.engagement.as_ref()).filter(|_| tool.engagement.is_none()));
    }
}

/// Checks that work objects are metres, not millimetres or kilometres, from the base.
fn frames(check: &mut Check, raw: &raw::Cell) {
    let usual = Usual {
        unit: "mm",
        least: 10.0,
        most: 100_000.0,
        source: "work objects stand within the reach of the robot, on tracks up to 100 m",
        units: &[("m", 1e-3), ("µm", 1e3)],
    };
    for (name, wobj) in &raw.wobjs {
        if let Some(mm) = wobj.uframe_mm {
            usual.look(check, &format!("wobjs.{name}.uframe_mm"), rounded(norm(mm)), true);
        }
    }
}

fn cutting(check: &mut Check, raw: &raw::Cut) {
    let force = Usual {
        unit: "N",
        least: 2.0,
        most: 50_000.0,
        source: "0.1 mm² of chip take 80 N in aluminium, 250 N in steel",
        units: &[("kN", 1e-3), ("mN", 1e3)],
    };
    if let Some(values) = raw.force_n {
        force.look(check, "cut.force_n", rounded(norm(values)), true);
    }
    let own = Milling {
        key: "cut",
        cutter: raw.cutter.as_ref(),
        engagement: raw.engagement.as_ref(),
        coefficients: raw.coefficients.as_ref(),
    };
    own.look(check, None);
}

/// The tables of a cut: those of `[cut]`, or a tool's own.
struct Milling<'a> {
    key: &'a str,
    cutter: Option<&'a raw::CutterKeys>,
    engagement: Option<&'a raw::EngagementKeys>,
    coefficients: Option<&'a raw::CoefficientKeys>,
}

impl Milling<'_> {
    /// `engagement` is that of `[cut]`, which applies to tools without their own.
    fn look(&self, check: &mut Check, engagement: Option<&raw::EngagementKeys>) {
        let Self { key, cutter, engagement: own, coefficients } = *self;
        if let Some(cutter) = cutter {
            diameter(check, key, cutter);
        }
        if let Some(own) = own {
            feed_and_speed(check, key, own);
        }
        if let (Some(cutter), Some(engagement)) = (cutter, own.or(engagement)) {
            wider_than_the_cutter(check, if own.is_some() { key } else { "cut" }, key, cutter, engagement);
        }
        if let Some(coefficients) = coefficients {
            self::coefficients(check, key, coefficients);
        }
    }
}

fn diameter(check: &mut Check, key: &str, cutter: &raw::CutterKeys) {
    let diameter = Usual {
        unit: "mm",
        least: 0.2,
        most: 500.0,
        source: "makers' catalogues of milling cutters",
        units: &[("m", 1e-3), ("µm", 1e3), ("inch", 1.0 / 25.4)],
    };
    diameter.look(check, &format!("{key}.cutter.diameter_mm"), cutter.diameter_mm, true);
}

fn feed_and_speed(check: &mut Check, key: &str, engagement: &raw::EngagementKeys) {
    let feed = Usual {
        unit: "mm",
        least: 5e-4,
        most: 3.0,
        source: "feeds per tooth are 0.01 to 0.5 mm",
        units: &[("m", 1e-3), ("µm", 1e3)],
    };
    if let Some(value) = engagement.feed_per_tooth_mm {
        feed.look(check, &format!("{key}.engagement.feed_per_tooth_mm"), value, true);
    }
    let speed = Usual {
        unit: "1/min",
        least: 50.0,
        most: 200_000.0,
        source: "milling spindles",
        units: &[("1/s", 1.0 / 60.0), ("1000/min", 1e-3)],
    };
    if let Some(value) = engagement.spindle_rpm {
        speed.look(check, &format!("{key}.engagement.spindle_rpm"), value, true);
    }
}

/// Reports a stepover that is wider than the cutter. In a slot the width has no effect, so a width in `[cut]` may be
/// meant for other cutters.
fn wider_than_the_cutter(
    check: &mut Check,
    engaged: &str,
    key: &str,
    cutter: &raw::CutterKeys,
    engagement: &raw::EngagementKeys,
) {
    let Some(width) = engagement.width_mm.filter(|width| *width > cutter.diameter_mm && cutter.diameter_mm > 0.0)
    else {
        return;
    };
    let is_slot = engagement.mode == "slot";
    if is_slot && engaged != key {
        return;
    }
    let place = format!("{engaged}.engagement.width_mm");
    let message =
        format!("{place} is {width} mm, wider than the cutter ({key}.cutter.diameter_mm = {})", cutter.diameter_mm);
    if is_slot {
        check.warn(&place, message, "a slot is as wide as its cutter: leave the width out");
    } else {
        check.error(&place, message, "the width is the stepover to the neighbouring pass: at most the diameter");
    }
}

/// Checks the specific cutting forces against those of metals, wood and plastics.
fn coefficients(check: &mut Check, section: &str, keys: &raw::CoefficientKeys) {
    let area = Usual {
        unit: "N/mm²",
        least: 1.0,
        most: 20_000.0,
        source: "Altintas 2012, Manufacturing Automation: 500 to 4,000 N/mm² for metals",
        units: &[("N/m² (Pa)", 1e6), ("kN/mm² (GPa)", 1e-3)],
    };
    let edge = Usual {
        unit: "N/mm",
        least: 0.05,
        most: 500.0,
        source: "Altintas 2012, Manufacturing Automation: 2 to 60 N/mm for metals",
        units: &[("N/m", 1e3), ("kN/mm", 1e-3)],
    };
    let (of_area, of_edge) = (
        [("ktc_n_mm2", keys.ktc_n_mm2), ("krc_n_mm2", keys.krc_n_mm2), ("kac_n_mm2", keys.kac_n_mm2)],
        [("kte_n_mm", keys.kte_n_mm), ("kre_n_mm", keys.kre_n_mm), ("kae_n_mm", keys.kae_n_mm)],
    );
    for (usual, keys) in [(area, of_area), (edge, of_edge)] {
        for (key, value) in keys {
            if let Some(value) = value {
                usual.look(check, &format!("{section}.coefficients.{key}"), value.abs(), true);
            }
        }
    }
}

fn norm(values: [f64; 3]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}
