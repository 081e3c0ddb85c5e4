//! The list of the languages, with their readers and writers.

use super::cl::{self, ClOptions};
use super::front_end::FrontEnd;
use super::{ArcTurn, Mark, Program, jbi, krl, lowered, post, rapid, tp, ur};
use crate::orientation::from_zyx_deg;
use deflex_text::{Diagnostic, Source};
use nalgebra::Rotation3;

/// The language of a program.
///
/// # Examples
/// ```
/// use deflex_program::{Language, Mark, detect};
///
/// assert_eq!(detect("part.mod", b"MODULE part\nENDMODULE\n"), Some(Language::Rapid));
/// assert_eq!(Language::Krl.word(), "krl"); // as `--post` and `--input-format` have it
/// assert!(Language::Krl.endings().contains(&"src"), "{}", Language::Krl.name());
/// assert_eq!(Language::Rapid.mark(Mark::Air), "! deflex air");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
    /// Yaskawa's INFORM: `.JBI`.
    Jbi,
}

/// The properties of a language that are one word, one text or one yes or no.
#[derive(Debug)]
#[doc(hidden)]
pub struct About {
    /// Its word in `--input-format`.
    word: &'static str,
    name: &'static str,
    /// Endings of its files, lower case.
    endings: &'static [&'static str],
    /// The maker of the robots whose controllers run it.
    pub maker: &'static str,
    /// Code and help for a statement that a controller does not load or cannot run as its text states.
    pub(super) fault: (&'static str, &'static str),
    /// The character that begins a comment; CL data have a statement for it.
    comment: Option<u8>,
    /// A character that ends a statement, and a comment with it.
    pub(super) comment_end: Option<u8>,
    /// Words of statements at which a program waits, in upper case: the controller does not know the motion after one of them in time to
    /// round the corner before it. Empty if no manual says so.
    pub(super) waits: &'static [&'static str],
    /// The statement at which a program waits for a time.
    pub(super) dwell: Dwell,
    /// The name of the work object that is the robot's base; cells need not declare it.
    robot_base: Option<&'static str>,
    /// The beginnings of the names of tools and of work objects, if only its controllers have them.
    pub prefixes: Option<[&'static str; 2]>,
    /// Whether names of tools and work objects are these prefixes with a number.
    pub(super) are_names_numbers: bool,
    /// Text for messages: where a frame may be declared, other than in the cell.
    pub or_context: &'static str,
    /// Text for messages: why the posture at the first target is unknown.
    pub start: &'static str,
    /// Whether files use each other's names, from which follows which files are one program.
    pub has_modules: bool,
    /// How the files of programs that call each other are connected, if they stay programs of their own.
    pub calls: Option<CallWords>,
    /// The ending of a file that belongs to one of the same name.
    pub companion: Option<&'static str>,
    /// Whether every point has a name of its own.
    pub(super) are_points_named: bool,
    /// Whether a program that states the frame of a tool states its load too. If not, the load is that of the cell.
    pub states_load: bool,
    /// How its controllers turn the tool on arcs, if the program does not state it.
    pub arc_turn: ArcTurn,
    /// Whether the orientation of a circle point chooses between the shorter and the longer turn on an arc, if the controller does not use
    /// it otherwise.
    pub chooses_turn: bool,
    /// Whether a program can state positions of external axes, so that they may be chosen.
    pub chooses_external: bool,
    /// Whether the controller skips a motion whose blend overlaps that of its neighbour. Others reduce both.
    pub skips_overlapping_blends: bool,
    /// Makes files with an empty routine for each name: their names and texts.
    pub declare: fn(&[&str]) -> Vec<(String, String)>,
    /// The orientation of a pose that the user types as three numbers after the position.
    pub turn: fn([f64; 3]) -> Rotation3<f64>,
    /// Statements that posted programs need.
    pub post: post::Statements,
}

/// The words of a statement at which a program waits for a number of seconds.
#[derive(Debug)]
pub(super) struct Dwell {
    /// Its first word.
    pub(super) word: &'static str,
    /// A word that may stand between it and the number.
    pub(super) before_number: Option<&'static str>,
}

/// Words before the names of programs, in upper case.
#[doc(hidden)]
#[derive(Debug)]
pub struct CallWords {
    /// Before the name of the program itself.
    pub(super) own: &'static str,
    /// Before the name of a program that it calls.
    pub(super) called: &'static [&'static str],
}

impl Language {
    /// All languages.
    pub const ALL: [Self; 6] = [Self::Rapid, Self::Cl, Self::Krl, Self::Ls, Self::Ur, Self::Jbi];

    #[doc(hidden)]
    pub fn about(self) -> &'static About {
        match self {
            Self::Rapid => &RAPID,
            Self::Cl => &CL,
            Self::Krl => &KRL,
            Self::Ls => &TP,
            Self::Ur => &UR,
            Self::Jbi => &JBI,
        }
    }

    /// Its word, as in `--input-format`.
    #[must_use]
    pub fn word(self) -> &'static str {
        self.about().word
    }

    /// Its name for people.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.about().name
    }

    /// Endings of its files, lower case.
    #[must_use]
    pub fn endings(self) -> &'static [&'static str] {
        self.about().endings
    }

    /// Whether a corrected program is the same text with other numbers. CL data are posted instead.
    #[must_use]
    #[doc(hidden)]
    pub fn is_edited(self) -> bool {
        self != Self::Cl
    }

    /// The comment that marks a stretch, as this language writes it: `! deflex air`.
    #[must_use]
    pub fn mark(self, mark: Mark) -> String {
        match self.comment() {
            Some(comment) => format!("{} {}", char::from(comment), mark.comment()),
            None => format!("PPRINT/{}", mark.comment().to_ascii_uppercase()),
        }
    }

    /// The name of the work object that is the robot's base; cells need not declare it.
    #[doc(hidden)]
    pub fn robot_base(self) -> Option<&'static str> {
        self.about().robot_base
    }

    /// The character that begins a comment; CL data have a statement for it.
    #[doc(hidden)]
    pub fn comment(self) -> Option<u8> {
        self.about().comment
    }
}

/// One file with these lines for each name.
fn one_file(names: &[&str], each: impl Fn(&str) -> String) -> Vec<(String, String)> {
    vec![("[controller] harmless".to_owned(), names.iter().map(|name| each(name)).collect())]
}

/// The properties of a language where the table states no other.
const BASE: About = About {
    word: "",
    name: "",
    endings: &[],
    maker: "",
    fault: ("", ""),
    comment: None,
    comment_end: None,
    waits: &[],
    dwell: Dwell { word: "", before_number: None },
    robot_base: None,
    prefixes: None,
    are_names_numbers: false,
    or_context: "",
    start: "",
    has_modules: false,
    calls: None,
    companion: None,
    are_points_named: false,
    states_load: true,
    arc_turn: ArcTurn::Even,
    chooses_turn: false,
    chooses_external: false,
    skips_overlapping_blends: false,
    declare: |_| Vec::new(),
    turn: from_zyx_deg,
    post: post::Statements::RAPID,
};

static RAPID: About = About {
    word: "rapid",
    name: "RAPID",
    endings: &["mod", "sys", "prg", "modx", "sysx"],
    maker: "ABB",
    fault: ("rapid.motion", "write the numbers of the robtarget; a controller does not load this"),
    comment: Some(b'!'),
    waits: &[
        "WAITTIME", "WAITUNTIL", "WAITDI", "WAITDO", "WAITGI", "WAITGO", "WAITAI", "WAITAO", "WAITSYNCTASK", "STOP",
        "TPREADFK", "TPREADNUM", "UIMSGBOX",
    ],
    dwell: Dwell { word: "WAITTIME", before_number: Some("INPOS") },
    or_context: ", or give the module that declares it with --context",
    start: "no MoveAbsJ, no `[robot] start_deg` and no suitable confdata says",
    has_modules: true,
    // RAPID reference manual, CirPathMode: `\PathFrame` is the default. An IRB 6640 turns so to 0.01° (logs `movec_30_car` and
    // `movec_30_ori` in `realrobot` of github.com/hehonglu123/ABB_Primitive_Study).
    arc_turn: ArcTurn::WithPath,
    // RAPID reference manual, MoveC.
    chooses_turn: true,
    chooses_external: true,
    declare: |names| {
        let routines: String = names.iter().map(|name| format!("PROC {name}()\nENDPROC\n")).collect();
        vec![("[controller] harmless".to_owned(), format!("MODULE deflex_harmless\n{routines}ENDMODULE\n"))]
    },
    ..BASE
};

static CL: About = About {
    word: "cl",
    name: "CL/APT",
    endings: &["cl", "cls", "clsf", "cldata", "cld", "apt", "aptsource", "ncl", "clt", "cutloc", "aptcl", "aut", "nci"],
    fault: ("cl.motion", "give motion in numbers, as a CAM system writes it, or take the statement out"),
    dwell: Dwell { word: "DELAY", before_number: None },
    start: "CL data state no posture, and no `[robot] start_deg` says",
    chooses_external: true,
    ..BASE
};

static KRL: About = About {
    word: "krl",
    name: "KRL",
    endings: &["src"],
    maker: "KUKA",
    fault: ("krl.motion", "write the numbers of the position; a controller does not load this"),
    comment: Some(b';'),
    waits: &["WAIT", "HALT"],
    dwell: Dwell { word: "WAIT", before_number: Some("SEC") },
    prefixes: Some(["TOOL_DATA[", "BASE_DATA["]),
    or_context: ", or give the file that sets it with --context",
    start: "no PTP to axis angles, no `[robot] start_deg` and no suitable S and T say",
    has_modules: true,
    companion: Some("dat"),
    declare: |names| one_file(names, |name| format!("GLOBAL DEF {name} ( )\nEND\n")),
    post: post::krl::STATEMENTS,
    ..BASE
};

static TP: About = About {
    word: "ls",
    name: "FANUC TP",
    endings: &["ls"],
    maker: "FANUC",
    fault: ("ls.motion", "write the numbers of the position; a controller does not load this"),
    comment: Some(b'!'),
    comment_end: Some(b';'),
    dwell: Dwell { word: "WAIT", before_number: None },
    prefixes: Some(["UT ", "UF "]),
    are_names_numbers: true,
    start: "no joint position, no `[robot] start_deg` and no suitable CONFIG says",
    calls: Some(CallWords { own: "PROG", called: &["CALL", "RUN"] }),
    are_points_named: true,
    states_load: false,
    declare: |names| {
        let program = |name: &&str| ((*name).to_owned(), format!("/PROG {name}\n/ATTR\n/MN\n/POS\n/END\n"));
        names.iter().map(program).collect()
    },
    turn: |[w, p, r]| from_zyx_deg([r, p, w]),
    post: post::tp::STATEMENTS,
    ..BASE
};

static UR: About = About {
    word: "ur",
    name: "URScript",
    endings: &["script", "urscript"],
    maker: "Universal Robots",
    fault: ("ur.motion", "write the numbers of the pose; a controller does not run this"),
    comment: Some(b'#'),
    dwell: Dwell { word: "sleep", before_number: None },
    robot_base: Some("base"),
    start: "no movej to axis angles, no `[robot] start_deg` and no qnear says",
    skips_overlapping_blends: true,
    declare: |names| one_file(names, |name| format!("def {name}():\nend\n")),
    turn: |[rx, ry, rz]| Rotation3::new([rx, ry, rz].into()),
    post: post::ur::STATEMENTS,
    ..BASE
};

static JBI: About = About {
    word: "jbi",
    name: "INFORM",
    endings: &["jbi"],
    maker: "Yaskawa",
    fault: ("jbi.motion", "write the numbers of the position; a controller does not load this"),
    comment: Some(b'\''),
    dwell: Dwell { word: "TIMER", before_number: Some("T") },
    robot_base: Some(deflex_lang::inform::ROBOT),
    prefixes: Some(["TOOL ", "USER "]),
    are_names_numbers: true,
    start: "INFORM jobs state axis angles in pulses, and no `[robot] start_deg` says",
    calls: Some(CallWords { own: "NAME", called: &["JOB"] }),
    // Assumed: every MOVC is a step of its own, which the robot reaches with the recorded orientation.
    arc_turn: ArcTurn::ThroughCirclePoint,
    declare: |names| one_file(names, |name| format!("/JOB\n//NAME {name}\n//INST\nNOP\nEND\n")),
    turn: |[rx, ry, rz]| from_zyx_deg([rz, ry, rx]),
    post: post::jbi::STATEMENTS,
    ..BASE
};

/// Options for reading programs.
///
/// # Examples
/// ```
/// use deflex_program::{Language, ReadOptions, cl::ClOptions, read};
/// use deflex_text::Source;
///
/// let source = Source::new("slot.mod", std::fs::read("../../samples/slot/slot.mod")?);
/// let options = ReadOptions { cl: &ClOptions::default(), look: true };
/// println!("{} targets", read(Language::Rapid, vec![source], vec![], &options)?.targets.len());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions<'a> {
    /// The options of the cell for CL data.
    pub cl: &'a ClOptions,
    /// Whether the program will only be shown and not written: then the file may be incomplete.
    pub look: bool,
}

/// Reads the files of one program; `context` only declares names.
///
/// # Errors
/// The program is refused: all reasons that were found.
///
/// # Examples
/// ```
/// use deflex_program::{Language, ReadOptions, cl::ClOptions, read};
/// use deflex_text::Source;
///
/// let text = std::fs::read("../../samples/ur/contour.script")?;
/// let options = ReadOptions { cl: &ClOptions::default(), look: false };
/// let program = read(Language::Ur, vec![Source::new("contour.script", text)], vec![], &options)?;
/// assert!(program.arcs > 0);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
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
            let message = format!("{} CL files are separate programs", sources.len());
            Err(Diagnostic::error("cl.several", "", message).help("give them one by one").into())
        }
        Language::Krl if options.look => krl::look(sources, context),
        Language::Krl => krl::read(sources, context),
        Language::Ls => tp::read(sources, context),
        Language::Ur => ur::read(sources, context),
        Language::Jbi => jbi::read(sources, context),
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
