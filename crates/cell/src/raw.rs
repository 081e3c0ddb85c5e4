//! The cell file with the keys of `docs/formats.md`. The names of the keys state the units.

use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cell {
    pub(super) robot: Robot,
    pub(super) limits: Option<Limits>,
    pub(super) controller: Option<Controller>,
    #[serde(default)]
    pub(super) tools: BTreeMap<String, Tool>,
    #[serde(default)]
    pub(super) wobjs: BTreeMap<String, Wobj>,
    pub(super) cl: Option<Cl>,
    pub(super) cut: Option<Cut>,
    pub(super) stock: Option<Stock>,
    pub(super) part: Option<Part>,
    pub(super) plan: Option<Plan>,
    pub(super) measured: Option<Measured>,
    #[serde(default)]
    pub(super) unit: Vec<Unit>,
    #[serde(default)]
    pub(super) effect: Vec<toml::Table>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Robot {
    pub(super) model: String,
    pub(super) start_deg: Option<[f64; 6]>,
    pub(super) base_mm: Option<[f64; 3]>,
    pub(super) base_quat: Option<[f64; 4]>,
    pub(super) base_abc_deg: Option<[f64; 3]>,
    pub(super) base_wpr_deg: Option<[f64; 3]>,
    pub(super) kinematics: Option<Kinematics>,
    pub(super) stiffness: Option<Stiffness>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Kinematics {
    #[serde(default)]
    pub(super) parallelogram: bool,
    pub(super) axis_sign: Option<[f64; 6]>,
    pub(super) axis_offset_deg: Option<[f64; 6]>,
    #[serde(default)]
    pub(super) coupled_23: bool,
    // Required, but optional for the parser, so that the reader can report all missing keys at once.
    pub(super) links: Option<Vec<Link>>,
    pub(super) axis_min_deg: Option<[f64; 6]>,
    pub(super) axis_max_deg: Option<[f64; 6]>,
    pub(super) elbow_min_deg: Option<f64>,
    pub(super) elbow_max_deg: Option<f64>,
    pub(super) axis_speed_deg_s: Option<[f64; 6]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Link {
    pub(super) alpha_deg: Option<f64>,
    pub(super) a_mm: Option<f64>,
    pub(super) d_mm: Option<f64>,
    pub(super) theta_deg: Option<f64>,
}

impl Link {
    pub(super) const KEYS: [&str; 4] = ["alpha_deg", "a_mm", "d_mm", "theta_deg"];

    /// The values, in the order of [`Link::KEYS`].
    pub(super) fn values(&self) -> [Option<f64>; 4] {
        [self.alpha_deg, self.a_mm, self.d_mm, self.theta_deg]
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stiffness {
    pub(super) joint_nm_per_rad: [f64; 6],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Limits {
    pub(super) max_correction_mm: Option<f64>,
    pub(super) max_step_mm: Option<f64>,
    pub(super) max_path_error_mm: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Controller {
    pub(super) compensates: Option<Vec<String>>,
    #[serde(default)]
    pub(super) harmless: Vec<String>,
    pub(super) arc_turn: Option<String>,
    pub(super) speed_unit: Option<String>,
    pub(super) path: Option<ControllerPath>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ControllerPath {
    pub(super) zone_share: f64,
    pub(super) smoothing_s: Option<[f64; 2]>,
    pub(super) acceleration_mm_s2: Option<f64>,
    pub(super) passing_acceleration_mm_s2: Option<f64>,
    pub(super) corner_acceleration_mm_s2: Option<f64>,
    #[serde(default)]
    pub(super) axis_lead_s2: [f64; 6],
    #[serde(default)]
    pub(super) lag_s: [f64; 6],
    #[serde(default)]
    pub(super) stop_s: f64,
    pub(super) zone_mm: Option<f64>,
    #[serde(default)]
    pub(super) error_share: f64,
    pub(super) planning_s: Option<f64>,
    pub(super) axis_acceleration_deg_s2: Option<[f64; 6]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tool {
    pub(super) tcp_mm: Option<[f64; 3]>,
    pub(super) tcp_quat: Option<[f64; 4]>,
    pub(super) tcp_abc_deg: Option<[f64; 3]>,
    pub(super) tcp_wpr_deg: Option<[f64; 3]>,
    #[serde(default)]
    pub(super) mass_kg: f64,
    #[serde(default)]
    pub(super) cog_mm: [f64; 3],
    pub(super) cutter: Option<CutterKeys>,
    pub(super) engagement: Option<EngagementKeys>,
    pub(super) coefficients: Option<CoefficientKeys>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Wobj {
    pub(super) uframe_mm: Option<[f64; 3]>,
    pub(super) uframe_quat: Option<[f64; 4]>,
    pub(super) uframe_abc_deg: Option<[f64; 3]>,
    pub(super) uframe_wpr_deg: Option<[f64; 3]>,
    pub(super) oframe_mm: Option<[f64; 3]>,
    pub(super) oframe_quat: Option<[f64; 4]>,
    pub(super) oframe_abc_deg: Option<[f64; 3]>,
    pub(super) oframe_wpr_deg: Option<[f64; 3]>,
    pub(super) unit: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cl {
    pub(super) tool: Option<String>,
    #[serde(default)]
    pub(super) tools: BTreeMap<String, String>,
    #[serde(default)]
    pub(super) harmless: Vec<String>,
    #[serde(default)]
    pub(super) post: BTreeMap<String, String>,
    pub(super) wobj: String,
    pub(super) units: Option<String>,
    pub(super) point: Option<String>,
    pub(super) spin: String,
    pub(super) spin_deg: Option<f64>,
    pub(super) singular_margin_deg: Option<f64>,
    pub(super) towards_mm: Option<[f64; 3]>,
    pub(super) arc_tolerance_mm: Option<f64>,
    #[serde(default)]
    pub(super) external: BTreeMap<String, f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cut {
    pub(super) force: String,
    pub(super) max_cutting_feed_mm_s: Option<f64>,
    pub(super) force_n: Option<[f64; 3]>,
    pub(super) frame: Option<String>,
    pub(super) cutter: Option<CutterKeys>,
    pub(super) engagement: Option<EngagementKeys>,
    pub(super) coefficients: Option<CoefficientKeys>,
    pub(super) material: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CutterKeys {
    pub(super) diameter_mm: f64,
    pub(super) corner_radius_mm: f64,
    pub(super) teeth: u32,
    pub(super) helix_deg: Option<f64>,
    pub(super) spindle_rpm: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EngagementKeys {
    pub(super) mode: String,
    pub(super) depth_mm: Option<f64>,
    pub(super) width_mm: Option<f64>,
    pub(super) feed_per_tooth_mm: Option<f64>,
    pub(super) spindle_rpm: Option<f64>,
    pub(super) lead_deg: Option<f64>,
    pub(super) tilt_deg: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CoefficientKeys {
    pub(super) material: Option<String>,
    pub(super) ktc_n_mm2: Option<f64>,
    pub(super) krc_n_mm2: Option<f64>,
    pub(super) kac_n_mm2: Option<f64>,
    pub(super) kte_n_mm: Option<f64>,
    pub(super) kre_n_mm: Option<f64>,
    pub(super) kae_n_mm: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Unit {
    pub(super) name: String,
    pub(super) axis: String,
    pub(super) kind: Option<String>,
    pub(super) carries: String,
    pub(super) direction: Option<[f64; 3]>,
    pub(super) base_mm: Option<[f64; 3]>,
    pub(super) base_quat: Option<[f64; 4]>,
    pub(super) base_abc_deg: Option<[f64; 3]>,
    pub(super) base_wpr_deg: Option<[f64; 3]>,
    pub(super) on: Option<String>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    pub(super) max_speed: Option<f64>,
    #[serde(default)]
    pub(super) free: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stock {
    pub(super) wobj: Option<String>,
    pub(super) box_mm: Option<[[f64; 3]; 2]>,
    pub(super) stl: Option<String>,
    pub(super) resolution_mm: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Part {
    pub(super) stl: Option<String>,
    pub(super) cell_mm: Option<f64>,
    pub(super) stages: Option<usize>,
    pub(super) material: Option<PartMaterial>,
    #[serde(default)]
    pub(super) clamp: Vec<PartClamp>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartMaterial {
    pub(super) e_n_mm2: f64,
    pub(super) nu: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartClamp {
    pub(super) box_mm: [[f64; 3]; 2],
    pub(super) stiffness_n_per_mm: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Plan {
    pub(super) wobj: String,
    pub(super) tool: String,
    pub(super) box_mm: [[f64; 3]; 2],
    pub(super) tilt_deg: f64,
    pub(super) loads_n: Option<Vec<[f64; 3]>>,
    pub(super) load_changes: Option<u32>,
    pub(super) instrument: String,
    pub(super) from_mm: Option<[f64; 3]>,
    pub(super) noise_mm: f64,
    pub(super) effect_mm: f64,
    #[serde(default)]
    pub(super) effects: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Measured {
    #[serde(default)]
    pub(super) columns: BTreeMap<String, String>,
}
