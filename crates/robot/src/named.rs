//! Search for built-in robots by the names that users type: "IRB 6700-150/3.20", "kr240".

use super::{BUILTIN, Builtin};

/// How many similar robots a message names if none was found.
const FEW: usize = 8;

/// A part of a name: letters, or a number, of which 3.2 and 3.20 are one.
#[derive(Clone, Debug, PartialEq)]
enum NamePart {
    Letters(String),
    Number(f64),
}

/// The parts of a name, without blanks and signs that join words.
fn parts(name: &str) -> Vec<NamePart> {
    let number = |c: char| c.is_ascii_digit() || c == '.';
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c: char| number(c) != number(first) || !c.is_alphanumeric() && c != '.');
        let (part, next) = rest.split_at(end.unwrap_or(rest.len()).max(first.len_utf8()));
        rest = next;
        match part.parse::<f64>() {
            Ok(value) if number(first) => parts.push(NamePart::Number(value)),
            _ if first.is_alphanumeric() => parts.push(NamePart::Letters(part.to_lowercase())),
            _ => {}
        }
    }
    parts
}

/// Whether parts occur in a name one after the other. The last word may be abbreviated.
fn stand_in(wanted: &[NamePart], name: &[NamePart]) -> bool {
    let alike = |(i, (a, b)): (usize, (&NamePart, &NamePart))| match (a, b) {
        (NamePart::Letters(a), NamePart::Letters(b)) if i + 1 == wanted.len() => b.starts_with(&a[..]),
        _ => a == b,
    };
    !wanted.is_empty() && name.windows(wanted.len()).any(|name| wanted.iter().zip(name).enumerate().all(alike))
}

impl Builtin {
    /// The robot of a name. Case, blanks and hyphens do not matter.
    ///
    /// # Errors
    /// No robot has this name. The error is a list of the few most similar names, the best first.
    pub fn named(name: &str) -> Result<&'static Self, Vec<&'static Self>> {
        let wanted = parts(name);
        let exact = BUILTIN.iter().find(|robot| robot.model == name);
        exact.or_else(|| BUILTIN.iter().find(|robot| parts(&robot.model) == wanted)).ok_or_else(|| {
            let holding: Vec<&Self> = Self::listed(name).into_iter().take(FEW).collect();
            let letters = |name: &str| parts_text(&parts(name));
            let distance = |robot: &&Self| strsim::osa_distance(&letters(name), &letters(&robot.model));
            if holding.is_empty() {
                // At most about half of the letters may differ, because another number is often another robot.
                let near = |robot: &&Self| 2 * distance(robot) <= letters(&robot.model).len();
                let mut near: Vec<&Self> = BUILTIN.iter().filter(near).collect();
                near.sort_by_key(distance);
                near.truncate(FEW);
                near
            } else {
                holding
            }
        })
    }

    /// The robots of a maker, or those whose names contain `filter`; all robots if it is empty. They are sorted by
    /// maker, name and number.
    #[must_use]
    #[doc(hidden)]
    pub fn listed(filter: &str) -> Vec<&'static Self> {
        let wanted = parts(filter);
        let held = |robot: &&Self| {
            wanted.is_empty() || stand_in(&wanted, &parts(&robot.model)) || stand_in(&wanted, &parts(&robot.maker))
        };
        let mut robots: Vec<&Self> = BUILTIN.iter().filter(held).collect();
        robots.sort_by(|a, b| {
            a.maker.cmp(&b.maker).then_with(|| {
                let order = |(a, b): (&NamePart, &NamePart)| match (a, b) {
                    (NamePart::Number(a), NamePart::Number(b)) => a.total_cmp(b),
                    (NamePart::Letters(a), NamePart::Letters(b)) => a.cmp(b),
                    (NamePart::Number(_), NamePart::Letters(_)) => std::cmp::Ordering::Less,
                    (NamePart::Letters(_), NamePart::Number(_)) => std::cmp::Ordering::Greater,
                };
                let (a, b) = (parts(&a.model), parts(&b.model));
                a.iter().zip(&b).map(order).find(|order| order.is_ne()).unwrap_or(a.len().cmp(&b.len()))
            })
        });
        robots
    }

    /// A sentence that names the robots most similar to an unknown name.
    #[must_use]
    #[doc(hidden)]
    pub fn meant(near: &[&Self]) -> String {
        let Some((first, others)) = near.split_first() else {
            return "`deflex init --list` names the built-in robots; any other goes into [robot.kinematics]".to_owned();
        };
        let others: Vec<String> = others.iter().map(|robot| format!("`{}`", robot.model)).collect();
        let others =
            if others.is_empty() { String::new() } else { format!(" Near it are also {}.", others.join(", ")) };
        format!("did you mean `{}`?{others} `deflex init --list` shows all built-in robots", first.model)
    }
}

/// The text of parts, without the characters between them.
fn parts_text(parts: &[NamePart]) -> String {
    let text = |part: &NamePart| match part {
        NamePart::Letters(letters) => letters.clone(),
        NamePart::Number(value) => value.to_string(),
    };
    parts.iter().map(text).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn models(robots: &[&Builtin]) -> Vec<String> {
        robots.iter().map(|robot| robot.model.clone()).collect()
    }

    #[test]
    fn names_are_understood_as_makers_write_them() {
        for (typed, model) in [
            ("IRB 6700-150/3.20", "irb6700-150-3.20"),
            ("IRB6700-150/3.2", "irb6700-150-3.20"),
            ("KR 240 R2900-2", "kr240-r2900-2"),
            ("R-2000iC/165F", "r-2000ic-165f"),
            ("LR Mate 200iD/7L", "lr-mate-200id-7l"),
            ("UR10", "ur10"),
            ("TX2-90 XL", "tx2-90xl"),
        ] {
            assert_eq!(Builtin::named(typed).map(|robot| &robot.model[..]).map_err(|near| models(&near)), Ok(model));
        }
        let near = models(&Builtin::named("kr240").unwrap_err());
        assert!(near.len() <= FEW && near.iter().all(|model| model.starts_with("kr240-")), "{near:?}");
        assert_eq!(models(&Builtin::named("6660").unwrap_err()), ["irb6660-130-3.10", "irb6660-205-1.9"]);
        assert_eq!(models(&Builtin::named("irb660-205-1.9").unwrap_err())[0], "irb6660-205-1.9");
        assert_eq!(models(&Builtin::named("scara").unwrap_err()), [""; 0]);
    }

    #[test]
    fn the_list_is_in_order_and_all_variants_of_a_series_are_there() {
        assert_eq!(Builtin::listed("").len(), BUILTIN.len());
        assert_eq!(
            models(&Builtin::listed("IRB 6700")),
            [
                "irb6700-150-3.20", "irb6700-155-2.85", "irb6700-175-3.05", "irb6700-200-2.60", "irb6700-205-2.80",
                "irb6700-235-2.65", "irb6700-245-3.00", "irb6700-300-2.70"
            ]
        );
        assert!(Builtin::listed("kuka").iter().all(|robot| robot.maker == "KUKA"));
        let irb = models(&Builtin::listed("irb"));
        assert!(irb[0] == "irb120-3-0.58" && irb[1].starts_with("irb140-"), "{irb:?}");
    }
}
