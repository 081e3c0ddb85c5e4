//! The tolerances of a check, and what they find in a program.

use super::CellFile;
use crate::session::report::{Noticed, Rows};
use crate::session::setup::Setup;
use deflex::correct::{Judged, KeptCount, KeptReason, Messages, Options, Row, Streamed, Summary, compensate, predict};
use deflex::program::{Program, Role, Target};
use deflex::report::html::PathTrace;
use deflex::report::{CheckFile, Digest, FileSummary, Findings, Judgement, Verdict, Verdicts, kept_text};
use deflex::text::{Diagnostic, Severity};

/// Refusals that are findings about the program, not failures of the run.
const ABOUT_THE_PROGRAM: [&str; 1] = ["robot.unreachable"];

/// What a check allows, mm.
///
/// # Examples
/// ```
/// use deflex::session::Tolerances;
///
/// let strict = Tolerances { max_error: 0.02, max_jump: Some(0.1), ..Tolerances::default() };
/// assert!(strict.max_path_error.is_none()); // the path has to keep `max_error` too
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerances {
    /// Largest error of a target, and of the path to it unless `max_path_error` states another: `--max-error`.
    pub max_error: f64,
    /// Largest distance from the programmed path between targets: `--max-path-error`.
    pub max_path_error: Option<f64>,
    /// Largest jump of the tip where the force starts, ends or turns at once: `--max-jump`. `None` reports jumps without judging them.
    pub max_jump: Option<f64>,
    /// Largest correction of a target: `--max-correction`.
    pub max_correction: Option<f64>,
    /// Whether only the targets are judged, not the path between them: `--at-targets`.
    pub at_targets: bool,
    /// Whether the check may pass although targets cannot be judged: `--allow-unjudged`.
    pub allow_unjudged: bool,
}

/// A program to check, and its original.
pub(crate) struct Programs<'a> {
    pub(crate) name: &'a str,
    pub(crate) program: &'a Program,
    pub(crate) original: Option<&'a Program>,
}

/// Result of a long program that was checked chunk by chunk.
pub(crate) struct Chunks<'a> {
    pub(crate) name: &'a str,
    pub(crate) streamed: Streamed,
    /// The targets with the largest errors.
    pub(crate) digest: Digest,
    pub(crate) listed: Listed,
    /// The path for the page.
    pub(crate) path: Option<PathTrace>,
}

/// What was found in one program.
pub(crate) struct Found {
    pub(crate) file: CheckFile,
    /// Rows of a program that was held as a whole.
    pub(crate) rows: Option<Rows>,
    /// Summary and path for the page.
    pub(crate) path: Option<(FileSummary, PathTrace)>,
    /// Targets that could not be judged, and notes about how the program was read.
    pub(crate) notes: Vec<Diagnostic>,
}

/// The findings of one program.
#[derive(Default)]
pub(crate) struct Listed {
    wrong: Findings,
    /// Targets that were not judged.
    unjudged: Findings,
}

impl Listed {
    /// Adds the findings in a chunk.
    pub(crate) fn add(&mut self, found: Vec<Diagnostic>) {
        let (unjudged, wrong) = found.into_iter().partition(|found| found.severity != Severity::Error);
        self.wrong.add(wrong);
        self.unjudged.add(unjudged);
    }
}

impl Tolerances {
    /// Whether the program is corrected so that `max_correction` can judge the correction. With an original the correction is known.
    pub(crate) fn corrects(&self, has_original: bool) -> bool {
        self.max_correction.is_some() && !has_original
    }

    /// Findings in a program or a chunk of it: an error for each fault, and a warning for each target that is not judged.
    pub(crate) fn findings(&self, judged: Judged<'_>) -> Vec<Diagnostic> {
        let Judged { program, rows, failures, moved_mm, on_the_way } = judged;
        let place = Places::new(program);
        let mut findings = failures;
        for row in rows {
            let path = row.path.filter(|_| !self.at_targets).unwrap_or_default();
            let most = self.max_path_error.unwrap_or(self.max_error);
            if !row.is_solved() {
                findings.push(place.unjudged(row));
            } else if row.is_through_air {
                // Only the jump counts where the cut ends.
            } else if row.error_norm_mm() > self.max_error {
                findings.push(place.error(row, self.max_error));
            } else if path.way_mm > most {
                // The target itself has a finding already if its own error is too large.
                findings.push(place.path(row, path.way_mm, most));
            }
            if let Some(most) = self.max_jump.filter(|most| path.jump_mm > *most) {
                findings.push(place.jump(row, path.jump_mm, most));
            }
        }
        findings.extend(on_the_way.iter().map(|found| found.diagnostic(program)));
        if let Some(most) = self.max_correction {
            let moved = program.targets.iter().map(|target| target.ordinal).zip(moved_mm.iter().copied());
            findings.extend(moved.filter(|(_, mm)| *mm > most).map(|(target, mm)| place.correction(target, mm, most)));
        }
        findings
    }

    /// What was found in a program that was checked chunk by chunk.
    pub(crate) fn streamed(&self, chunks: Chunks<'_>, cell: &CellFile) -> Result<Found, Vec<Diagnostic>> {
        let Chunks { name, streamed, digest, listed, path } = chunks;
        let (found, judgement, sum) = if streamed.refused.is_empty() {
            let targets = streamed.last as usize;
            let judgement = self.judgement(targets, &streamed.summary, listed.unjudged, digest);
            (listed.wrong.into_parts(), judgement, streamed.summary)
        } else {
            let (refused, more) = streamed.refused.into_parts();
            let judgement = self.refused_judgement(streamed.last as usize);
            ((about_the_program(cell, refused)?, more), judgement, Summary::default())
        };
        let notes = streamed.notes.into_iter().chain(not_judged(name, &judgement)).chain(self.uncertain(name, &sum));
        let notes = notes.collect();
        let file = CheckFile::new(name, judgement, found);
        let path = path.map(|path| (FileSummary::of(name, &sum, &[]).with_findings(&file.findings, file.more), path));
        Ok(Found { file, rows: None, path, notes })
    }

    /// What is found in a program that is held as a whole. `path` is an empty path to fill.
    pub(crate) fn whole(
        &self,
        programs: &Programs<'_>,
        setup: &Setup,
        options: &Options,
        path: Option<PathTrace>,
    ) -> Result<Found, Vec<Diagnostic>> {
        let &Programs { name, program, original } = programs;
        let cell = &setup.cell.cell;
        let targets = program.targets.iter().filter(|target| target.role == Role::End).count() + program.unknown.len();
        let mut predicted = match predict(program, cell, options, original) {
            Ok(predicted) => predicted,
            Err(refused) => {
                let mut held = Messages::with_room(Findings::MOST);
                held.add(about_the_program(&setup.cell, refused)?);
                let file = CheckFile::new(name, self.refused_judgement(targets), held.into_parts());
                let nothing = FileSummary::of(name, &Summary::default(), &[]).with_findings(&file.findings, file.more);
                let path = path.map(|path| (nothing, path));
                return Ok(Found { file, rows: Some(Rows::new(&[])), path, notes: Vec::new() });
            }
        };
        let mut failures = std::mem::take(&mut predicted.failures);
        if self.corrects(original.is_some()) {
            failures.extend(compensate(program, cell, options).map_err(|e| setup.cell.own(e))?.failures);
        }
        let (mut listed, mut noticed) = (Listed::default(), Noticed::new(setup.options.forces.as_ref(), None));
        let (moved_mm, on_the_way) = (&predicted.moved_mm, &predicted.on_the_way);
        listed.add(self.findings(Judged { program, rows: &predicted.rows, failures, moved_mm, on_the_way }));
        noticed.take(&predicted.rows);
        let left_out = noticed.notes(name)?;
        let sum = Summary::of(&predicted.rows);
        let judgement = self.judgement(targets, &sum, listed.unjudged, noticed.into_digest());
        let not_judged: Vec<Diagnostic> = not_judged(name, &judgement).chain(self.uncertain(name, &sum)).collect();
        let file = CheckFile::new(name, judgement, listed.wrong.into_parts());
        let rows = Rows::new(&predicted.rows);
        let path = path.map(|mut path| {
            rows.draw(&mut path, &predicted.rows);
            path.quote(|target, _| program.line_of(target));
            (FileSummary::new(name, &predicted).with_findings(&file.findings, file.more), path)
        });
        let notes = predicted.notes.into_iter().chain(left_out).chain(not_judged).collect();
        Ok(Found { file, rows: Some(rows), path, notes })
    }

    /// A warning if the errors are less certain than they are limited: a target within the limit may be off by more.
    fn uncertain(&self, name: &str, sum: &Summary) -> Option<Diagnostic> {
        let message = format!(
            "the standard uncertainty of the predicted errors is up to {:.3} mm per axis, more than the {} mm allowed: the check \
             cannot show that the part is within the tolerance",
            sum.max_sigma_mm, self.max_error
        );
        let warning = Diagnostic::error("check.uncertain", name, message).severity(Severity::Warning);
        let help = "measure this program, or one at the same place with the same postures, and give `deflex identify` these rows too";
        (sum.max_sigma_mm > self.max_error).then(|| warning.help(help))
    }

    /// The judgement of a program with this number of targets.
    fn judgement(&self, targets: usize, sum: &Summary, unjudged: Findings, digest: Digest) -> Judgement {
        let (skipped, more_skipped) = unjudged.into_parts();
        let ways = Some(self.max_path_error.unwrap_or(self.max_error)).filter(|_| !self.at_targets);
        Judgement {
            targets,
            air: sum.air,
            unjudged: sum.unjudged.clone(),
            skipped,
            more_skipped,
            allows_unjudged: self.allow_unjudged,
            verdicts: Verdicts {
                targets: Verdict { limit_mm: Some(self.max_error), largest: digest.worst.into_iter().next() },
                ways: Verdict { limit_mm: ways, largest: digest.way },
                jumps: Verdict { limit_mm: self.max_jump, largest: digest.jump },
            },
        }
    }

    /// The judgement of a program that is refused because a target is out of reach: no target of it is judged.
    fn refused_judgement(&self, targets: usize) -> Judgement {
        let unjudged = vec![KeptCount { reason: KeptReason::ProgramRefused, count: targets }];
        Judgement { targets, unjudged, allows_unjudged: self.allow_unjudged, ..Judgement::default() }
    }
}

/// Turns refusals into findings if all of them are about the program; otherwise returns them as errors.
fn about_the_program(cell: &CellFile, refused: Vec<Diagnostic>) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
    let all = refused.iter().all(|error| ABOUT_THE_PROGRAM.contains(&error.code));
    if all && !refused.is_empty() { Ok(refused) } else { Err(cell.own(refused)) }
}

/// One warning for each reason for which targets were not judged.
fn not_judged<'a>(name: &'a str, judgement: &'a Judgement) -> impl Iterator<Item = Diagnostic> + 'a {
    judgement.unjudged.iter().filter(|unjudged| unjudged.reason != KeptReason::ProgramRefused).map(move |unjudged| {
        let diagnostic = Diagnostic::error("check.not-judged", name, format!("not judged: {}", kept_text(unjudged)));
        diagnostic.severity(Severity::Warning).help(match judgement.allows_unjudged {
            true => "`deflex predict --report` names their lines",
            false => "declare in the cell what is missing; or let them pass unjudged with `--allow-unjudged`",
        })
    })
}

/// Finds the places of targets in the text, for messages.
struct Places<'a> {
    program: &'a Program,
    /// All targets, in running order.
    ends: Vec<&'a Target>,
}

impl<'a> Places<'a> {
    fn new(program: &'a Program) -> Self {
        Self { program, ends: program.targets.iter().filter(|target| target.role == Role::End).collect() }
    }

    fn error(&self, row: &Row, most: f64) -> Diagnostic {
        let message =
            format!("target {}: error of {:.4} mm, more than the {most} mm allowed", row.target, row.error_norm_mm());
        self.at(row.target, "check.max-error", message, "correct the program with `deflex compensate`")
    }

    fn path(&self, row: &Row, left: f64, most: f64) -> Diagnostic {
        let message = format!(
            "target {}: on the path to it the tip is {left:.4} mm off the programmed path, more than the {most} mm allowed",
            row.target
        );
        let help = "insert targets with `deflex compensate --subdivide MM`; `--max-path-error` is a limit for the paths alone, \
                    `--at-targets` leaves them unjudged";
        self.at(row.target, "check.max-path-error", message, help)
    }

    fn jump(&self, row: &Row, left: f64, most: f64) -> Diagnostic {
        let message = format!(
            "target {}: on the path to it the force sets in, ends or turns at once, and the tip is {left:.4} mm off the \
             programmed path there, more than the {most} mm allowed",
            row.target
        );
        let help = "lead in and out of the cut gently: no inserted target can be near enough to remove a jump";
        self.at(row.target, "check.max-jump", message, help)
    }

    fn unjudged(&self, row: &Row) -> Diagnostic {
        let message = format!("target {} is not judged: {}", row.target, row.reason());
        let help = "declare in the cell what is missing, or let it pass with `--allow-unjudged`";
        self.at(row.target, "check.not-judged", message, help).severity(Severity::Warning)
    }

    fn correction(&self, target: u32, mm: f64, most: f64) -> Diagnostic {
        let message = format!("target {target}: correction of {mm:.4} mm, more than the {most} mm allowed");
        self.at(target, "limits.max-correction", message, "check the cell that the correction was made with")
    }

    fn at(&self, ordinal: u32, code: &'static str, message: String, help: &str) -> Diagnostic {
        let diagnostic = Diagnostic::error(code, "", message).help(help);
        let end = self.ends.binary_search_by_key(&ordinal, |target| target.ordinal).ok().map(|i| self.ends[i]);
        let unknown = &self.program.unknown;
        let place = match (end, unknown.binary_search_by_key(&ordinal, |motion| motion.ordinal)) {
            (Some(target), _) => (target.source, target.span, target.line),
            (None, Ok(i)) => (unknown[i].source, unknown[i].span, unknown[i].line),
            (None, Err(_)) => return diagnostic,
        };
        diagnostic.on_line(&self.program.sources[usize::from(place.0)], place.1, place.2)
    }
}
