//! Cells with impossible numbers of a cut.

use deflex_cell::Cell;
use deflex_text::Source;

const CELL: &str = "[robot]\nmodel = \"irb6660-205-1.9\"\n[tools.T.engagement]\nmode = \"slot\"\ndepth_mm = 1.5\n\
    width_mm = 25.0\nfeed_per_tooth_mm = 0.07\nlead_deg = 5.0\ntilt_deg = 0.0\n[cut]\nforce = \"mechanistic\"\n\
    [cut.cutter]\ndiameter_mm = 25.0\ncorner_radius_mm = 5.0\nteeth = 3\n[cut.coefficients]\nktc_n_mm2 = 1800.0\n\
    krc_n_mm2 = 900.0\nkac_n_mm2 = 300.0\nkte_n_mm = 20.0\nkre_n_mm = 25.0\nkae_n_mm = 5.0\n";

/// Every number of a cut is checked, and its error is at the number.
#[test]
fn a_number_that_is_not_possible_is_reported_once_at_its_key() {
    assert!(Cell::read(&Source::new("cell.toml", CELL)).is_ok());
    let keys = CELL.lines().filter(|line| line.contains("_mm") || line.contains("_deg") || line.contains("teeth"));
    for line in keys {
        let key = line.split(' ').next().unwrap();
        let wrong = if key == "teeth" { "teeth = 0".to_owned() } else { format!("{key} = nan") };
        let errors = Cell::read(&Source::new("cell.toml", CELL.replace(line, &wrong))).unwrap_err();
        let place = CELL.lines().position(|other| other == line).unwrap() + 1;
        assert_eq!(errors.iter().map(|error| error.line).collect::<Vec<_>>(), [place], "{key}: {errors:?}");
        assert!(errors[0].message.contains(key), "{key}: {}", errors[0].message);
    }
}
