//! Reads `[cut]` and the cutting parts of `[tools.X]`.

use super::check::Check;
use super::{Cell, ForceFrame, raw};
use deflex_cutting::{
    Coefficients, Cutter, CuttingError, Engagement, Milling, Mode, check_coefficients, check_cutter, check_feed,
    materials,
};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The `[cut]` table.
///
/// # Examples
/// ```
/// # let (_, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// let cut = cell.cut.as_ref().expect("a [cut] table");
/// assert!(cut.max_cutting_feed.is_none());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Cut {
    /// The force.
    pub force: CutForce,
    /// Faster motions do not cut, m/s.
    pub max_cutting_feed: Option<f64>,
    /// `[cut.cutter]`, `[cut.engagement]` and `[cut.coefficients]`, for tools without such tables of their own.
    pub(crate) milling: MillingParts,
}

/// The value of `[cut] force`.
///
/// # Examples
/// ```
/// # let (_, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// use deflex_cell::CutForce;
///
/// assert!(matches!(cell.cut.as_ref().expect("a [cut] table").force, CutForce::Mechanistic));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum CutForce {
    /// No force.
    None,
    /// The same force on every cutting target, N.
    Constant {
        /// Force on the tool.
        force: Vector3<f64>,
        /// Frame in which the force is given.
        frame: ForceFrame,
    },
    /// A force for each target from the table of `--forces`.
    Table,
    /// The milling force integral with the parts of each tool: see [`Cell::milling`].
    Mechanistic,
}

/// The declared parts of a milling cut, for one tool or for all tools.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub(crate) struct MillingParts {
    /// The cutter.
    pub cutter: Option<Cutter>,
    /// Spindle speed of the cutter if the program states none, 1/min.
    pub spindle_rpm: Option<f64>,
    /// How the cutter meets the material.
    pub engagement: Option<DeclaredEngagement>,
    /// Cutting force coefficients, as numbers or by the material's name.
    pub coefficients: Option<Coefficients>,
}

/// An `engagement` table. The cutter to which it applies may be in another table.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub(crate) struct DeclaredEngagement {
    /// What determines the engagement.
    pub mode: EngagementMode,
    /// Depth along the surface normal, m; 0 with [`EngagementMode::Stock`].
    pub depth: f64,
    /// Stepover, m; not needed for a slot.
    pub width: Option<f64>,
    /// Feed per tooth, m; `None` computes it from feed, spindle speed and number of teeth.
    pub feed_per_tooth: Option<f64>,
    /// Spindle speed if neither the program nor the cutter states one, 1/min.
    pub spindle_rpm: Option<f64>,
    /// Lead angle of the tool, rad.
    pub lead: f64,
    /// Tilt angle of the tool, rad.
    pub tilt: f64,
}

/// What determines an engagement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub(crate) enum EngagementMode {
    /// The declared depth and width.
    Declared(Mode),
    /// `mode = "stock"`: the material that is left of the blank.
    Stock,
}

/// A complete description of milling with one tool.
///
/// # Examples
/// ```
/// # let (_, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// let milling = cell.milling("tMill").expect("a complete description");
/// println!("{} mm, {} teeth", 1e3 * milling.cutter.diameter, milling.cutter.teeth);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct MillingCut {
    /// The cutter.
    pub cutter: Cutter,
    /// How it meets the material.
    pub engagement: EngagementSource,
    /// Feed per tooth, m; `None` computes it from feed, spindle speed and number of teeth.
    pub feed_per_tooth: Option<f64>,
    /// Spindle speed if the program states none, 1/min.
    pub spindle_rpm: Option<f64>,
    /// Cutting force coefficients.
    pub coefficients: Coefficients,
}

/// How the cutter of a [`MillingCut`] meets the material.
///
/// # Examples
/// ```
/// # let (_, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// use deflex_cell::EngagementSource;
///
/// let milling = cell.milling("tMill").expect("a complete description");
/// assert!(matches!(milling.engagement, EngagementSource::Declared(_)));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EngagementSource {
    /// The declared engagement at every target. Its feed per tooth is a placeholder if the program's feed determines it.
    Declared(Engagement),
    /// The engagement that follows from the stock.
    Stock,
}

/// A table that a run needs and that the cell does not have.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let text = "[robot]\nmodel = \"irb6660-205-1.9\"\n[cut]\nforce = \"none\"\n";
/// let cell = Cell::read(&Source::new("cell.toml", text))?;
/// assert_eq!(cell.milling("tMill").expect_err("there is no cutter").part, "cutter");
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the cell has neither [tools.X.{part}] nor [cut.{part}]")]
pub struct MissingCutKey {
    /// Name of the table: `cutter`, `engagement` or `coefficients`.
    pub part: &'static str,
}

impl Cell {
    /// The complete description of milling with the tool of a name. Parts that the tool does not declare are those of
    /// `[cut]`.
    ///
    /// # Errors
    /// The first part that neither the tool nor `[cut]` declares.
    pub fn milling(&self, tool: &str) -> Result<MillingCut, MissingCutKey> {
        let none = MillingParts::default();
        let shared = self.cut.as_ref().map_or(&none, |cut| &cut.milling);
        let own = self.tool_milling.get(&tool.to_ascii_uppercase()).unwrap_or(&none);
        own.over(shared)
    }

    /// The cutter of a tool, upper or lower case, or that of `[cut]`; `None` if neither is declared.
    #[must_use]
    #[doc(hidden)]
    pub fn cutter(&self, tool: &str) -> Option<Cutter> {
        let own = self.tool_milling.get(&tool.to_ascii_uppercase()).and_then(|own| own.cutter);
        own.or_else(|| self.cut.as_ref()?.milling.cutter)
    }
}

impl MillingParts {
    /// The parts of a tool, with the `shared` ones in place of those that it does not declare.
    fn over(&self, shared: &Self) -> Result<MillingCut, MissingCutKey> {
        let missing = |part| MissingCutKey { part };
        let cutter = self.cutter.or(shared.cutter).ok_or(missing("cutter"))?;
        let declared = self.engagement.or(shared.engagement).ok_or(missing("engagement"))?;
        let coefficients = self.coefficients.or(shared.coefficients).ok_or(missing("coefficients"))?;
        let engagement = match declared.mode {
            EngagementMode::Stock => EngagementSource::Stock,
            EngagementMode::Declared(mode) => EngagementSource::Declared(Engagement {
                mode,
                depth: declared.depth,
                // A slot is as wide as its cutter.
                width: declared.width.unwrap_or(cutter.diameter),
                feed_per_tooth: declared.feed_per_tooth.unwrap_or(ANY_FEED),
                lead: declared.lead,
                tilt: declared.tilt,
            }),
        };
        // The spindle speed of `[cut]` belongs to the cutter of `[cut]`, so a tool with its own cutter does not use it.
        let rpm = if self.cutter.is_some() { self.spindle_rpm } else { self.spindle_rpm.or(shared.spindle_rpm) };
        Ok(MillingCut {
            cutter,
            engagement,
            feed_per_tooth: declared.feed_per_tooth,
            spindle_rpm: rpm.or(declared.spindle_rpm),
            coefficients,
        })
    }
}

/// A placeholder, m, for engagements whose targets have their own feed per tooth.
const ANY_FEED: f64 = 1e-4;

pub(super) fn cut(check: &mut Check, raw: &raw::Cut, tools: &BTreeMap<String, MillingParts>) -> Option<Cut> {
    let force =
        match check.word("cut.force", &raw.force, &[("none", 0), ("constant", 1), ("table", 2), ("mechanistic", 3)])? {
            0 => CutForce::None,
            1 => {
                let force = check.need("cut", "force_n", raw.force_n, "force = \"constant\" needs the force")?;
                check.finite("cut.force_n", &force);
                let frame = check.need(
                    "cut",
                    "frame",
                    raw.frame.as_deref(),
                    "force = \"constant\" needs the axes that it is given in",
                )?;
                let frames = [("wobj", ForceFrame::Wobj), ("tool", ForceFrame::Tool), ("feed", ForceFrame::Feed)];
                CutForce::Constant { force: force.into(), frame: check.word("cut.frame", frame, &frames)? }
            }
            2 => CutForce::Table,
            _ => CutForce::Mechanistic,
        };
    if let Some(feed) = raw.max_cutting_feed_mm_s {
        check.positive("cut.max_cutting_feed_mm_s", &[feed]);
    }
    if force == CutForce::Mechanistic && tools.is_empty() {
        need_all_parts(check, raw);
    }
    // Other forces do not need them, but the cutter removes material from a stock.
    let milled_by = (raw.material.as_deref(), raw.coefficients.as_ref());
    let milling = milling_parts(check, "cut", raw.cutter.as_ref(), raw.engagement.as_ref(), milled_by);
    let own = tools.iter().map(|(name, own)| (format!("tools.{name}"), own));
    for (key, parts) in own.chain([("cut".to_owned(), &MillingParts::default())]) {
        // Checks the parts together. Missing parts are an error only when a tool needs them, and each part alone was
        // checked when it was read.
        if let Ok(MillingCut { cutter, engagement: EngagementSource::Declared(engagement), coefficients, .. }) =
            parts.over(&milling)
            && check.errors.is_empty()
            && let Err(error) = Milling::new(cutter, engagement, coefficients)
        {
            error_of_field(check, &key, error);
        }
    }
    Some(Cut { force, max_cutting_feed: raw.max_cutting_feed_mm_s.map(|feed| 1e-3 * feed), milling })
}

/// Without a tool that declares parts of its own, all parts have to be in `[cut]`.
fn need_all_parts(check: &mut Check, raw: &raw::Cut) {
    let why = "force = \"mechanistic\" needs it";
    check.need("cut", "cutter", raw.cutter.as_ref(), why);
    check.need("cut", "engagement", raw.engagement.as_ref(), why);
    if raw.coefficients.is_none() && raw.material.is_none() {
        check.error(
            "cut",
            "[cut.coefficients] is missing: force = \"mechanistic\" needs it",
            "give the six coefficients, or material = \"al7075\"",
        );
    }
}

/// Adds an error about a field of a cut, at its key in the section, or in `[cut]` if the section does not have the key.
fn error_of_field(check: &mut Check, section: &str, CuttingError { field, message }: CuttingError) {
    let key = match field {
        "diameter" => "cutter.diameter_mm",
        "corner_radius" => "cutter.corner_radius_mm",
        "teeth" => "cutter.teeth",
        "helix" => "cutter.helix_deg",
        "depth" => "engagement.depth_mm",
        "width" => "engagement.width_mm",
        "feed_per_tooth" => "engagement.feed_per_tooth_mm",
        "lead" => "engagement.lead_deg",
        "tilt" => "engagement.tilt_deg",
        "ktc" => "coefficients.ktc_n_mm2",
        "krc" => "coefficients.krc_n_mm2",
        "kac" => "coefficients.kac_n_mm2",
        "kte" => "coefficients.kte_n_mm",
        "kre" => "coefficients.kre_n_mm",
        "kae" => "coefficients.kae_n_mm",
        _ => "coefficients",
    };
    let sections = [section, "cut"].map(|section| format!("{section}.{key}"));
    let key = sections.iter().find(|key| check.has(key)).unwrap_or(&sections[0]);
    check.error(key, format!("{key}: {message}"), "check the value and its unit");
}

/// Reads the cutting parts of `[cut]` or of `[tools.X]`.
pub(super) fn milling_parts(
    check: &mut Check,
    section: &str,
    cutter: Option<&raw::CutterKeys>,
    engagement: Option<&raw::EngagementKeys>,
    (material, coefficients): (Option<&str>, Option<&raw::CoefficientKeys>),
) -> MillingParts {
    let spindle_rpm = cutter.and_then(|keys| keys.spindle_rpm);
    if let Some(rpm) = spindle_rpm {
        check.positive(&format!("{section}.cutter.spindle_rpm"), &[rpm]);
    }
    let cutter = cutter.map(|keys| Cutter {
        diameter: 1e-3 * keys.diameter_mm,
        corner_radius: 1e-3 * keys.corner_radius_mm,
        teeth: keys.teeth,
        helix: keys.helix_deg.unwrap_or(0.0).to_radians(),
    });
    let cutter_error = cutter.and_then(|cutter| check_cutter(&cutter).err());
    let engagement = engagement.and_then(|keys| self::engagement(check, &format!("{section}.engagement"), keys));
    let feed_error = engagement.and_then(|declared| check_feed(declared.feed_per_tooth?).err());
    let coefficients = self::coefficients(check, &format!("{section}.coefficients"), material, coefficients);
    let coefficient_error = coefficients.and_then(|coefficients| check_coefficients(&coefficients).err());
    for error in [cutter_error, feed_error, coefficient_error].into_iter().flatten() {
        error_of_field(check, section, error);
    }
    MillingParts { cutter, spindle_rpm, engagement, coefficients }
}

fn engagement(check: &mut Check, key: &str, keys: &raw::EngagementKeys) -> Option<DeclaredEngagement> {
    let modes = [
        ("slot", EngagementMode::Declared(Mode::Slot)),
        ("up", EngagementMode::Declared(Mode::Up)),
        ("down", EngagementMode::Declared(Mode::Down)),
        ("stock", EngagementMode::Stock),
    ];
    let mode = check.word(&format!("{key}.mode"), &keys.mode, &modes)?;
    for (name, value) in [("spindle_rpm", keys.spindle_rpm), ("width_mm", keys.width_mm)] {
        check.positive(&format!("{key}.{name}"), value.as_slice());
    }
    let (feed_per_tooth, spindle_rpm) = (keys.feed_per_tooth_mm.map(|mm| 1e-3 * mm), keys.spindle_rpm);
    if mode == EngagementMode::Stock {
        let declared = [
            ("depth_mm", keys.depth_mm),
            ("width_mm", keys.width_mm),
            ("lead_deg", keys.lead_deg),
            ("tilt_deg", keys.tilt_deg),
        ];
        for (name, _) in declared.iter().filter(|(_, value)| value.is_some()) {
            check.error(
                &format!("{key}.{name}"),
                format!("{name} is declared, but mode = \"stock\" finds it from the stock"),
                "remove it, or declare mode = \"slot\", \"up\" or \"down\"",
            );
        }
        let none =
            DeclaredEngagement { mode, depth: 0.0, width: None, feed_per_tooth, spindle_rpm, lead: 0.0, tilt: 0.0 };
        return Some(none);
    }
    let why = "a declared engagement needs it";
    let depth = check.need(key, "depth_mm", keys.depth_mm, why);
    let lead = check.need(key, "lead_deg", keys.lead_deg, why);
    let tilt = check.need(key, "tilt_deg", keys.tilt_deg, why);
    if mode != EngagementMode::Declared(Mode::Slot) {
        check.need(key, "width_mm", keys.width_mm, "up and down milling need the stepover")?;
    }
    Some(DeclaredEngagement {
        mode,
        depth: 1e-3 * depth?,
        width: keys.width_mm.map(|mm| 1e-3 * mm),
        feed_per_tooth,
        spindle_rpm,
        lead: lead?.to_radians(),
        tilt: tilt?.to_radians(),
    })
}

fn coefficients(
    check: &mut Check,
    key: &str,
    material: Option<&str>,
    keys: Option<&raw::CoefficientKeys>,
) -> Option<Coefficients> {
    let material = material.or_else(|| keys.and_then(|k| k.material.as_deref()));
    let own = keys.is_some_and(|k| {
        [k.ktc_n_mm2, k.krc_n_mm2, k.kac_n_mm2, k.kte_n_mm, k.kre_n_mm, k.kae_n_mm].iter().any(Option::is_some)
    });
    match (material, keys) {
        (Some(_), _) if own => {
            check.error(key, "both a material and coefficients are given", "keep one of them");
            None
        }
        (Some(name), _) => {
            let known: Vec<(&str, usize)> = materials::MATERIALS.iter().enumerate().map(|(i, m)| (m.name, i)).collect();
            check.word(&format!("{key}.material"), name, &known).map(|i| materials::MATERIALS[i].coefficients)
        }
        (None, Some(keys)) => {
            let mut get = |name: &str, value: Option<f64>, to_si: f64| {
                check.need(key, name, value, "all six coefficients are needed").map(|value| value * to_si)
            };
            let (area, edge) = (1e6, 1e3);
            Some(Coefficients {
                ktc: get("ktc_n_mm2", keys.ktc_n_mm2, area)?,
                krc: get("krc_n_mm2", keys.krc_n_mm2, area)?,
                kac: get("kac_n_mm2", keys.kac_n_mm2, area)?,
                kte: get("kte_n_mm", keys.kte_n_mm, edge)?,
                kre: get("kre_n_mm", keys.kre_n_mm, edge)?,
                kae: get("kae_n_mm", keys.kae_n_mm, edge)?,
            })
        }
        (None, None) => None,
    }
}
