//! The languages: the one list of them, and where each is read and written.

use super::cl::{self, ClOptions};
use super::front_end::FrontEnd;
use super::{Mark, Program, krl, lowered, rapid, tp, ur};
use crate::text::{Diagnostic, Source};

/// Which language a program is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Language {
    /// ABB RAPID modules.
    Rapid,
    /// APT/CL cutter location data.
    Cl,
    /// KUKA KRL: `.src` with its `.dat`.
    Krl,
    /// FANUC TP as text: `.ls`.
    Ls,
    /// Universal Robots' URScript: `.script`.
    Ur,
}

impl Language {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Rapid, Self::Cl, Self::Krl, Self::Ls, Self::Ur];

    /// Its word, as in `--input-format`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Rapid => "rapid",
            Self::Cl => "cl",
            Self::Krl => "krl",
            Self::Ls => "ls",
            Self::Ur => "ur",
        }
    }

    /// What people call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rapid => "RAPID",
            Self::Cl => "CL/APT",
            Self::Krl => "KRL",
            Self::Ls => "FANUC TP",
            Self::Ur => "URScript",
        }
    }

    /// Endings of its files, lower case.
    #[must_use]
    pub fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Rapid => &["mod", "sys", "prg", "modx", "sysx"],
            Self::Cl => &[
                "cl",
                "cls",
                "clsf",
                "cldata",
                "cld",
                "apt",
                "aptsource",
                "ncl",
                "clt",
                "cutloc",
                "aptcl",
                "aut",
                "nci",
            ],
            Self::Krl => &["src"],
            Self::Ls => &["ls"],
            Self::Ur => &["script", "urscript"],
        }
    }

    /// Whether a corrected program is the same text with other numbers; CL data are posted in another language instead.
    #[must_use]
    pub fn is_edited(self) -> bool {
        self != Self::Cl
    }

    /// Code and help of what a controller does not load or could not run as its text says.
    pub(super) fn fault(self) -> (&'static str, &'static str) {
        match self {
            Self::Rapid => ("rapid.motion", "write the numbers of the robtarget; a controller does not load this"),
            Self::Cl => ("cl.motion", "give motion in numbers, as a CAM system writes it, or take the statement out"),
            Self::Krl => ("krl.motion", "write the numbers of the position; a controller does not load this"),
            Self::Ls => ("ls.motion", "write the numbers of the position; a controller does not load this"),
            Self::Ur => ("ur.motion", "write the numbers of the pose; a controller does not run this"),
        }
    }

    /// The comment that marks a stretch, as this language writes it: `! deflex air`.
    #[must_use]
    pub fn mark(self, mark: Mark) -> String {
        let word = match mark {
            Mark::Air => "air",
            Mark::Cut => "cut",
        };
        match self.comment() {
            Some(comment) => format!("{} deflex {word}", char::from(comment)),
            None => format!("PPRINT/DEFLEX {}", word.to_ascii_uppercase()),
        }
    }

    /// The name of the work object that is the robot's base, which no cell has to declare.
    pub(crate) fn robot_base(self) -> Option<&'static str> {
        match self {
            Self::Ur => Some(ur::STYLE.frame),
            Self::Rapid | Self::Cl | Self::Krl | Self::Ls => None,
        }
    }

    /// The character that begins a comment; CL data have a statement for it.
    pub(super) fn comment(self) -> Option<u8> {
        match self {
            Self::Rapid | Self::Ls => Some(b'!'),
            Self::Cl => None,
            Self::Krl => Some(b';'),
            Self::Ur => Some(b'#'),
        }
    }
}

/// How programs are read.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions<'a> {
    /// What the cell says of CL data.
    pub cl: &'a ClOptions,
    /// Nothing will be written: a file that is cut off may be looked at.
    pub look: bool,
}

/// Reads the files of one program; `context` only declares names.
///
/// # Errors
/// The program as a whole is refused: every reason found.
pub fn read(
    language: Language,
    mut sources: Vec<Source>,
    context: Vec<Source>,
    options: &ReadOptions<'_>,
) -> Result<Program, Vec<Diagnostic>> {
    match language {
        Language::Rapid if options.look => rapid::look(sources, context),
        Language::Rapid => rapid::read(sources, context),
        Language::Cl if sources.len() == 1 => cl::read(sources.remove(0), options.cl),
        Language::Cl => {
            let message = format!("{} CL files are as many programs", sources.len());
            Err(Diagnostic::error("cl.several", "", message).help("give them one by one").into())
        }
        Language::Krl if options.look => krl::look(sources, context),
        Language::Krl => krl::read(sources, context),
        Language::Ls => tp::read(sources, context),
        Language::Ur => ur::read(sources, context),
    }
}

/// Language-specific positions of everything that [`Program::rewrite`] may change.
#[derive(Debug)]
pub(crate) enum Layout {
    /// RAPID.
    Rapid(rapid::Layout),
    /// CL.
    Cl(cl::Layout),
    /// FANUC TP.
    Ls(tp::Layout),
    /// KRL.
    Krl(krl::Layout),
    /// What `deflex-lang` reads.
    Lowered(lowered::Layout),
}

impl Layout {
    pub(super) fn front_end(&self) -> &dyn FrontEnd {
        match self {
            Self::Rapid(layout) => layout,
            Self::Cl(layout) => layout,
            Self::Ls(layout) => layout,
            Self::Krl(layout) => layout,
            Self::Lowered(layout) => layout,
        }
    }
}
