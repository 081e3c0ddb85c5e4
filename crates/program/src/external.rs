//! External axes, as programs name and move them.

pub use deflex_text::limits::EXTERNAL_AXES;

/// Positions of the external axes, mm or degrees as programs count; NaN for an unknown one.
pub type External = [f64; EXTERNAL_AXES];

/// An external axis, as programs name it.
///
/// # Examples
/// ```
/// use deflex_program::AxisName;
///
/// assert_eq!(AxisName::read("E2"), Some(AxisName::External(1)));
/// assert_eq!(AxisName::External(1).to_string(), "eax_b");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum AxisName {
    /// `eax_a` … `eax_f` (RAPID), `E1` … `E6` (KRL, motion group 1 of FANUC TP), by its index.
    External(usize),
    /// `J1` … `J9` of another motion group (FANUC TP).
    Joint {
        /// Number of the motion group.
        group: u8,
        /// Number of the axis, from 1.
        number: u8,
    },
    /// `E1` … `E9` of another motion group (FANUC TP).
    Extended {
        /// Number of the motion group.
        group: u8,
        /// Number of the axis, from 1.
        number: u8,
    },
    /// All axes of another motion group (FANUC TP).
    Group(u8),
}

impl AxisName {
    /// RAPID's names of the external axes.
    const RAPID: [&str; EXTERNAL_AXES] = ["eax_a", "eax_b", "eax_c", "eax_d", "eax_e", "eax_f"];

    /// Reads `eax_a`, `E1`, `gp2_j1`, `gp2_e1`, `gp2`, in upper or lower case.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let lower = text.to_ascii_lowercase();
        if let Some(index) = Self::RAPID.iter().position(|name| *name == lower) {
            return Some(Self::External(index));
        }
        let digit = |text: &str| match text.as_bytes() {
            [digit @ b'1'..=b'9'] => Some(digit - b'0'),
            _ => None,
        };
        if let Some(number) = lower.strip_prefix('e').and_then(digit) {
            return Some(usize::from(number) - 1).filter(|index| *index < EXTERNAL_AXES).map(Self::External);
        }
        let (group, axis) = match lower.strip_prefix("gp")?.split_once('_') {
            Some((group, axis)) => (digit(group)?, Some(axis)),
            None => (digit(&lower[2..])?, None),
        };
        match (group, axis) {
            // Group 1 is that of the robot: its extended axes are E1 … E6.
            (1, _) => None,
            (group, None) => Some(Self::Group(group)),
            (group, Some(axis)) => match (axis.strip_prefix('j'), axis.strip_prefix('e')) {
                (Some(number), _) => Some(Self::Joint { group, number: digit(number)? }),
                (_, Some(number)) => Some(Self::Extended { group, number: digit(number)? }),
                _ => None,
            },
        }
    }

    /// Its motion group; `None` for that of the robot.
    #[must_use]
    #[doc(hidden)]
    pub fn group(self) -> Option<u8> {
        match self {
            Self::External(_) => None,
            Self::Joint { group, .. } | Self::Extended { group, .. } | Self::Group(group) => Some(group),
        }
    }

    /// Whether it names another axis, or all axes of that one's group.
    #[must_use]
    #[doc(hidden)]
    pub fn covers(self, other: Self) -> bool {
        self == other || matches!(self, Self::Group(group) if other.group() == Some(group))
    }
}

impl std::fmt::Display for AxisName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::External(index) => f.write_str(Self::RAPID.get(*index).copied().unwrap_or_default()),
            Self::Joint { group, number } => write!(f, "gp{group}_j{number}"),
            Self::Extended { group, number } => write!(f, "gp{group}_e{number}"),
            Self::Group(group) => write!(f, "gp{group}"),
        }
    }
}
