//! What a program is corrected to, as a whole and in chunks.

use deflex::cell::Cell;
use deflex::correct::{Options, Sinks, StreamError, Streamed, compensate};
use deflex::program::Program;
use deflex::report::html::PathKind;
use deflex::report::{CSV_HEADER, FileSummary, csv_rows, summary_line, write_csv};
use deflex::text::{Diagnostic, apply};

/// A corrected program, and what is said about it.
#[derive(Debug, PartialEq)]
pub(crate) struct Written {
    pub(crate) program: Vec<u8>,
    pub(crate) report: Vec<u8>,
    /// The line about the program, and the figures of its driven path.
    pub(crate) said: String,
    pub(crate) notes: Vec<Diagnostic>,
}

/// What a run gives.
pub(crate) type Came = Result<Written, Vec<Diagnostic>>;

pub(crate) fn whole(program: &Program, cell: &Cell, options: &Options) -> Came {
    let corrected = compensate(program, cell, options)?;
    if !corrected.failures.is_empty() {
        return Err(corrected.failures);
    }
    let (mut bytes, mut report) = (Vec::new(), Vec::new());
    apply(&program.sources[0].bytes, &corrected.rewritten.as_ref().unwrap().edits[0], &mut bytes).unwrap();
    write_csv(&corrected.rows, &mut report).unwrap();
    let said = summary_line(&FileSummary::new("", &corrected), PathKind::Compensate);
    Ok(Written { program: bytes, report, said: format!("{said} {:?}", corrected.driven), notes: corrected.notes })
}

/// The result of a run that writes the program and its report. `None` where the program has to be read as a whole.
pub(crate) fn in_chunks(
    run: impl FnOnce(&mut Vec<u8>, &mut Sinks<'_>) -> Result<Streamed, StreamError>,
) -> Option<Came> {
    let (mut program, mut report) = (Vec::new(), CSV_HEADER.as_bytes().to_vec());
    let mut sinks =
        Sinks { report: &mut report, rows: &|rows| csv_rows(rows), each: &mut |_| (), progress: &|_, _| () };
    Some(match run(&mut program, &mut sinks) {
        Ok(Streamed { summary, failures, notes, driven, .. }) if failures.is_empty() => {
            let said = summary_line(&FileSummary::of("", &summary, &[]), PathKind::Compensate);
            Ok(Written { program, report, said: format!("{said} {driven:?}"), notes })
        }
        Ok(Streamed { failures, .. }) | Err(StreamError::Refused(failures)) => Err(failures),
        Err(StreamError::NotStreamable) => return None,
        Err(error) => panic!("{error:?}"),
    })
}

/// The messages of a run, with the lines that they show.
pub(crate) fn words(came: &Came) -> Vec<String> {
    let said = match came {
        Ok(written) => &written.notes,
        Err(errors) => errors,
    };
    said.iter().map(|d| format!("{d} {:?}", d.snippet)).collect()
}
