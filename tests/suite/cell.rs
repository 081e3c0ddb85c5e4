//! The cell file: what is read, what is left to the controller, what comes back.

use approx::assert_relative_eq;
use deflex::cell::Cell;
use deflex::text::{Diagnostic, Source};

const ROBOT: &str = "[robot]\nmodel = \"irb6660-205-1.9\"\n";
const STIFFNESS: &str = "[robot.stiffness]\njoint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n";

fn read(text: &str) -> Result<Cell, Vec<Diagnostic>> {
    Cell::read(&Source::new("cell.toml", text))
}

fn kinds(cell: &Cell) -> Vec<&'static str> {
    cell.arm.effects.iter().map(|effect| effect.kind()).collect()
}

#[test]
fn the_least_cell_is_a_robot() {
    let cell = read(ROBOT).unwrap();
    assert!(cell.arm.effects.is_empty() && cell.cut.is_none() && cell.cl.is_none() && cell.start.is_none());
    assert_relative_eq!(cell.limits.max_correction, 5e-3);
}

#[test]
fn declared_springs_come_first_unless_the_file_has_them() {
    let gap = "[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [6e-5, 0, 0, 1.2e-4, 0, 0]\n";
    let springs = "[[effect]]\nkind = \"joint_stiffness\"\nscale = [1, 1, 2, 1, 1, 1]\n";
    let cell = read(&format!("{ROBOT}{STIFFNESS}{gap}")).unwrap();
    assert_eq!(kinds(&cell), ["joint_stiffness", "backlash"]);
    assert_eq!(cell.covariances.len(), 2);
    let cell = read(&format!("{ROBOT}{STIFFNESS}{gap}{springs}")).unwrap();
    assert_eq!(kinds(&cell), ["backlash", "joint_stiffness"]);
    let refused = read(&format!("{ROBOT}{springs}")).unwrap_err();
    assert!(refused[0].message.contains("[robot.stiffness]"));
}

#[test]
fn only_a_parallelogram_has_a_rod() {
    let springs = "[[effect]]\nkind = \"joint_stiffness\"\nscale = [1, 1, 1, 1, 1, 1]\nrod_share = 0.2\n";
    assert!(read(&format!("{ROBOT}{STIFFNESS}{springs}")).is_ok());
    let serial = read(&format!("[robot]\nmodel = \"irb6700-150-3.20\"\n{STIFFNESS}{springs}")).unwrap_err();
    assert!(serial[0].message.contains("`rod_share` is for an arm with a parallelogram"), "{serial:?}");
}

#[test]
fn an_uncertainty_of_another_size_says_what_to_do() {
    let springs = "[[effect]]\nkind = \"joint_stiffness\"\nscale = [1, 1, 1, 1, 1, 1]\nrod_share = 0.2\n";
    let covariance = "[effect.uncertainty]\ncovariance = [[1e-4, 0], [0, 1e-4]]\n";
    let errors = read(&format!("{ROBOT}{STIFFNESS}{springs}{covariance}")).unwrap_err();
    let (message, help) = (&errors[0].message, errors[0].help.as_deref().unwrap_or_default());
    assert!(message.contains("does not fit the 7 parameters"), "{errors:?}");
    assert!(help.contains("remove this [effect.uncertainty]"), "{errors:?}");
}

#[test]
fn friction_builds_up_over_the_same_angles_in_all_effects() {
    let cell = |angle: &str| {
        let gap = "[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [6e-5, 0, 0, 1e-4, 0, 0]\npresliding_rad = 1e-3\n";
        let friction = format!("[[effect]]\nkind = \"hysteresis\"\nfraction = [0.1, 0, 0, 0, 0, 0]\n{angle}");
        read(&format!("{ROBOT}{STIFFNESS}{gap}{friction}"))
    };
    for same in ["presliding_rad = 1e-3\n", "presliding_rad = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]\n"] {
        assert!(cell(same).is_ok(), "{same}");
    }
    for other in ["presliding_rad = 2e-3\n", "presliding_rad = [2e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]\n", ""] {
        let refused = cell(other).unwrap_err();
        assert!(refused[0].message.contains("all effects of an arm have the same"), "{refused:?}");
    }
}

#[test]
fn what_the_controller_corrects_is_left_out_and_said() {
    let gravity = "[[effect]]\nkind = \"gravity\"\ntool = true\n";
    let zero = "[[effect]]\nkind = \"zero_offset\"\noffset_rad = [1e-4, 0, 0, 0, 0, 0]\n";
    let with = |compensates: &str| {
        read(&format!("{ROBOT}{STIFFNESS}[controller]\ncompensates = [{compensates}]\n{gravity}{zero}")).unwrap()
    };
    assert_eq!(kinds(&with("")), ["joint_stiffness", "gravity", "zero_offset"]);
    let cell = with("\"gravity\"");
    assert_eq!(
        (kinds(&cell), &cell.controller.left_out[..]),
        (vec!["joint_stiffness", "zero_offset"], &["gravity".to_owned()][..])
    );
    let cell = with("\"geometry\", \"gravity\"");
    assert_eq!(kinds(&cell), ["joint_stiffness"]);
}

#[test]
fn the_base_stands_where_it_is_put() {
    let cell = read(&format!("{ROBOT}base_mm = [100, 200, 300]\nbase_quat = [0, 0, 0, 1]\n")).unwrap();
    let world_from_base = cell.arm.robot.world_from_base;
    assert_relative_eq!(world_from_base.translation.vector, nalgebra::Vector3::new(0.1, 0.2, 0.3), epsilon = 1e-12);
    assert_relative_eq!(world_from_base.rotation * nalgebra::Vector3::x(), -nalgebra::Vector3::x(), epsilon = 1e-12);
}

#[test]
fn units_are_those_of_the_keys() {
    let text = format!(
        "{ROBOT}{STIFFNESS}[tools.tMill]\ntcp_mm = [0, 0, 310]\ntcp_quat = [1, 0, 0, 0]\nmass_kg = 18\ncog_mm = [0, 0, 120]\n\
         [cut]\nforce = \"mechanistic\"\nmax_cutting_feed_mm_s = 100\n[cut.cutter]\ndiameter_mm = 25\ncorner_radius_mm = 5\nteeth = 2\n\
         [cut.engagement]\nmode = \"slot\"\ndepth_mm = 1.5\nfeed_per_tooth_mm = 0.07\nlead_deg = 5\ntilt_deg = 10\n\
         [cut.coefficients]\nmaterial = \"al7075\"\n"
    );
    let cell = read(&text).unwrap();
    let tool = &cell.tools["TMILL"];
    assert_relative_eq!(tool.flange_from_tcp.translation.z, 0.31);
    assert_relative_eq!(tool.cog.z, 0.12);
    assert_relative_eq!(cell.cut.as_ref().unwrap().max_cutting_feed.unwrap(), 0.1);
    let deflex::cell::MillingCut { cutter, engagement, feed_per_tooth, .. } = cell.milling("tMill").unwrap();
    let deflex::cell::EngagementSource::Declared(engagement) = engagement else { panic!("from the stock") };
    assert_relative_eq!(cutter.diameter, 0.025);
    assert_relative_eq!(engagement.lead, 5_f64.to_radians());
    assert_relative_eq!(engagement.width, 0.025);
    assert_relative_eq!(feed_per_tooth.unwrap(), 0.07e-3);
}

#[test]
fn every_unknown_key_is_named_with_the_nearest() {
    let errors =
        read("[robot]\nmodel = \"irb6660-205-1.9\"\nbase_m = [0, 0, 0]\nstart = 3\n[limits]\nmax_stp_mm = 1\n")
            .unwrap_err();
    let lines_and_help: Vec<(usize, &str)> = errors.iter().map(|e| (e.line, e.help.as_deref().unwrap_or(""))).collect();
    assert_eq!(lines_and_help.len(), 3, "{errors:?}");
    assert_eq!((lines_and_help[0].0, lines_and_help[0].1), (3, "did you mean `base_mm`?"));
    assert_eq!((lines_and_help[2].0, lines_and_help[2].1), (6, "did you mean `max_step_mm`?"));
}

#[test]
#[ignore = "needs the practice cells: DEFLEX_SHARED=folder cargo test --test suite -- --ignored cell::"]
fn practice_cells_read() {
    let shared = std::env::var("DEFLEX_SHARED").unwrap_or_else(|_| "../shared".into());
    let entries = std::fs::read_dir(std::path::Path::new(&shared).join("practice")).unwrap();
    let cells = entries.flatten().map(|entry| entry.path().join("cell.toml")).filter(|path| path.is_file());
    for path in cells {
        let source = Source::new(path.display().to_string(), std::fs::read(&path).unwrap());
        Cell::read(&source).unwrap_or_else(|errors| panic!("{errors:?}"));
    }
}

/// A cutter, its feed and its coefficients are checked where they stand, whatever the engagement follows from.
#[test]
fn cutter_and_feed_are_checked_in_every_mode() {
    let cutter = "diameter_mm = 16.0\ncorner_radius_mm = 2.0\nteeth = 3\nhelix_deg = 30.0\n";
    let modes = [
        "mode = \"stock\"\nfeed_per_tooth_mm = 0.06\n",
        "mode = \"slot\"\nfeed_per_tooth_mm = 0.06\ndepth_mm = 1.0\nlead_deg = 0\ntilt_deg = 0\n",
        "mode = \"up\"\nfeed_per_tooth_mm = 0.06\ndepth_mm = 1.0\nwidth_mm = 4.0\nlead_deg = 0\ntilt_deg = 0\n",
    ];
    let faults = [
        ("diameter_mm = 16.0", "diameter_mm = 0.0", "diameter"),
        ("diameter_mm = 16.0", "diameter_mm = -16.0", "diameter"),
        ("diameter_mm = 16.0", "diameter_mm = nan", "diameter"),
        ("corner_radius_mm = 2.0", "corner_radius_mm = 8.1", "corner_radius"),
        ("corner_radius_mm = 2.0", "corner_radius_mm = -inf", "corner_radius"),
        ("corner_radius_mm = 2.0", "corner_radius_mm = nan", "corner_radius"),
        ("teeth = 3", "teeth = 0", "teeth"),
        ("helix_deg = 30.0", "helix_deg = 90.0", "helix"),
        ("feed_per_tooth_mm = 0.06", "feed_per_tooth_mm = -0.06", "feed_per_tooth"),
        ("feed_per_tooth_mm = 0.06", "feed_per_tooth_mm = nan", "feed_per_tooth"),
        ("ktc_n_mm2 = 1800", "ktc_n_mm2 = -1800", "ktc"),
    ];
    let coefficients =
        "ktc_n_mm2 = 1800\nkrc_n_mm2 = 900\nkac_n_mm2 = 300\nkte_n_mm = 20\nkre_n_mm = 25\nkae_n_mm = 5\n";
    let stock = "[stock]\nbox_mm = [[0, 0, -20], [48, 40, 0]]\n";
    for mode in modes {
        for section in ["cut", "tools.tA"] {
            let force = if section == "cut" { "" } else { "[cut]\nforce = \"mechanistic\"\n" };
            let own = if section == "cut" { "[cut]\nforce = \"mechanistic\"\n" } else { "" };
            let text = format!(
                "{ROBOT}{STIFFNESS}{force}{own}[{section}.cutter]\n{cutter}[{section}.engagement]\n{mode}[{section}.coefficients]\n{coefficients}{stock}"
            );
            read(&text).unwrap();
            for (from, to, field) in faults {
                let refused = read(&text.replace(from, to)).unwrap_err();
                assert_eq!(refused.len(), 1, "{to}: {refused:?}");
                let message = &refused[0].message;
                assert!(message.starts_with(&format!("{section}.")) && message.contains(field), "{to}: {refused:?}");
            }
        }
    }
}

#[test]
fn a_shared_slot_serves_a_smaller_cutter() {
    let engagement =
        "mode = \"slot\"\ndepth_mm = 1.0\nwidth_mm = 25.0\nfeed_per_tooth_mm = 0.06\nlead_deg = 0\ntilt_deg = 0\n";
    let cutter = |diameter: f64| format!("diameter_mm = {diameter:?}\ncorner_radius_mm = 1.0\nteeth = 3\n");
    let text = format!(
        "{ROBOT}{STIFFNESS}[cut]\nforce = \"mechanistic\"\n[cut.cutter]\n{}[cut.engagement]\n{engagement}[cut.coefficients]\nmaterial = \"al7075\"\n[tools.tSmall.cutter]\n{}",
        cutter(25.0),
        cutter(8.0)
    );
    assert!(read(&text).unwrap().notes.is_empty());
    let refused = read(&text.replace("\"slot\"", "\"up\"")).unwrap_err();
    assert!(refused.iter().any(|error| error.message.contains("wider than the cutter")), "{refused:?}");
}
