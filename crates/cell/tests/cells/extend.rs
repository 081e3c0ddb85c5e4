//! Cell files with added effects, read again.

use deflex_cell::{Cell, NewEffect, Uncertainty, extended};

fn backlash(gap: f64) -> NewEffect {
    let mut table = toml::Table::new();
    table.insert("kind".to_owned(), "backlash".into());
    table.insert("half_gap_rad".to_owned(), vec![gap, 0.0, 0.0, 0.0, 0.0, 0.0].into());
    let mut provenance = toml::Table::new();
    provenance.insert("rows".to_owned(), 304.into());
    NewEffect { table, uncertainty: Some(Uncertainty::Own(vec![vec![1.5e-13; 6]; 6])), provenance }
}

#[test]
fn comments_stay_and_an_effect_of_the_same_kind_is_replaced() {
    let cell = "# my cell\n[robot]\nmodel = \"irb6660-205-1.9\" # the big one\n\n[cut]\nforce = \"none\"\n";
    let once = extended(cell, &[backlash(6e-5)]).unwrap_or_default();
    assert!(once.starts_with(cell), "{once}");
    let twice = extended(&once, &[backlash(7.25e-5)]).unwrap_or_default();
    assert_eq!(twice, once.replace("6e-5", "7.25e-5"));
    insta::assert_snapshot!(twice);
    let source = deflex_text::Source::new("cell.toml", twice);
    let read = Cell::read(&source).unwrap_or_else(|errors| panic!("{errors:?}"));
    approx::assert_relative_eq!(read.arm.effects[0].parameters()[0].value, 7.25e-5);
    assert!(read.covariances[0].is_some());
}
