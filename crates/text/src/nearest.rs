/// A prefix must have at least this number of letters.
const BEGINNING: usize = 2;
/// A part of a word that is not its prefix must have at least this number of letters.
const PART: usize = 4;

/// The known word most similar to a mistyped one, if any is similar: it begins with the mistyped word or contains it,
/// or about a third of the letters differ. Case, blanks and separators do not count.
#[must_use]
#[doc(hidden)]
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = letters(word);
    let rank = |candidate: &str| {
        let begins = word.len() >= BEGINNING && candidate.starts_with(&word);
        let part = begins || word.len() >= PART && candidate.contains(&word);
        // Two letters in exchanged order count as one difference.
        let distance = strsim::osa_distance(&word, candidate);
        (part || 3 * distance <= candidate.len().max(word.len()) + 1).then_some((!part, distance))
    };
    let candidates = known.into_iter().filter_map(|known| Some((rank(&letters(known))?, known)));
    candidates.min_by_key(|(rank, _)| *rank).map(|(_, known)| known)
}

fn letters(word: &str) -> String {
    word.chars().filter(|c| !matches!(c, ' ' | '-' | '_' | '/')).map(|c| c.to_ascii_lowercase()).collect()
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn finds_what_was_meant_and_nothing_far() {
        let known = ["joint_stiffness", "backlash", "gravity"];
        assert_eq!(nearest("backlahs", known), Some("backlash"));
        assert_eq!(nearest("Gravty", known), Some("gravity"));
        assert_eq!(nearest("temperature", known), None);
        assert_eq!(nearest("stiffness", known), Some("joint_stiffness"));
        assert_eq!(nearest("back lash", known), Some("backlash"));
        assert_eq!(nearest("mechanical", ["none", "constant", "table", "mechanistic"]), Some("mechanistic"));
        assert_eq!(nearest("tooth", ["diameter_mm", "corner_radius_mm", "teeth"]), Some("teeth"));
        assert_eq!(nearest("fx", ["qx", "x_mm", "fx_n"]), Some("fx_n"));
        let robots = ["irb6700-150-3.20", "irb6660-205-1.9", "irb120-3-0.58"];
        assert_eq!([nearest("IRB 6660", robots), nearest("6660", robots)], [Some("irb6660-205-1.9"); 2]);
        assert_eq!([nearest("kr210", robots), nearest("mm", ["inch"])], [None; 2]);
    }
}
