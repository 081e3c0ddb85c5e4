use super::{CellFile, ProgramFiles};
use crate::session::read::all;
use crate::session::report::pretty;
use deflex::identify::{self, Plan, PlanInput, PlanProgram};
use deflex::report::html::{DrawnArm, plan_page};
use deflex::report::{Origin, VERSION};
use deflex::text::{Diagnostic, Source};
use serde_json::Value;

/// A set of effects whose posterior probability is below this does not keep a question open.
const OPEN: f64 = 0.05;

/// A plan, and the cell that its reports name.
///
/// # Examples
/// ```
/// use deflex::session::Planned;
/// use deflex::text::Diagnostics;
///
/// /// Writes the plan for other programs, and its page.
/// fn write(planned: &Planned) -> Result<(), Diagnostics> {
///     std::fs::write("plan.json", planned.json()?)?;
///     Ok(std::fs::write("plan.html", planned.page())?)
/// }
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Planned {
    /// The plan.
    pub found: Plan,
    name: String,
    cell: Origin,
    arm: DrawnArm,
}

impl Planned {
    /// The text that `--json` writes.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn json(&self) -> Result<String, Vec<Diagnostic>> {
        #[derive(serde::Serialize)]
        struct Json<'a> {
            #[serde(flatten)]
            found: &'a Plan,
            deflex: &'static str,
            cell: &'a Origin,
        }
        pretty(&Json { found: &self.found, deflex: VERSION, cell: &self.cell })
    }

    /// The page that `--html` writes.
    #[must_use]
    pub fn page(&self) -> String {
        plan_page(&self.found, &self.name, &self.cell, &self.arm)
    }
}

/// Plans what to measure, as `deflex plan` does. The targets of the programs in `pool` are the candidate places. `after` is the
/// JSON of an identification whose open questions the plan is to decide, and `program` says in which language the plan is written.
/// `progress` receives the share of the work that is done, 0 to 1.
///
/// # Errors
/// Every error for which the command ends with exit code 2.
///
/// # Examples
/// ```no_run
/// use deflex::session::{CellFile, plan};
/// use deflex::identify::{Ask, PlanProgram};
/// use deflex::program::Language;
///
/// let cell = CellFile::read("cell.toml".as_ref())?; // with a [plan] table
/// let program = PlanProgram { name: "plan", language: Language::Rapid, ask: Ask::Never };
/// let planned = plan(&cell, 24, &[], None, program, &|_| ())?;
/// std::fs::write("plan.json", planned.json()?)?;
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn plan(
    cell: &CellFile,
    rows: usize,
    pool: &[ProgramFiles],
    after: Option<&Source>,
    program: PlanProgram<'_>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Planned, Vec<Diagnostic>> {
    let pool = all(pool.iter().map(|program| program.parse(cell, None)))?;
    let undecided = after.map(undecided).transpose()?;
    let pairs = undecided.as_deref().unwrap_or_default();
    let input = PlanInput { cell: &cell.cell, rows, pool: &pool, undecided: pairs, program, progress };
    let mut found = identify::plan(&input).map_err(|errors| cell.own(errors))?;
    if undecided.as_ref().is_some_and(Vec::is_empty) {
        found.notes.push("the identification left nothing undecided: the plan is for every pair of effects".to_owned());
    }
    let arm = DrawnArm::of(&cell.cell);
    Ok(Planned { found, name: program.name.to_owned(), cell: cell.origin(), arm })
}

/// Pairs of effects that an identification, read from its JSON, left undecided.
fn undecided(source: &Source) -> Result<Vec<(String, String)>, Vec<Diagnostic>> {
    let bad = |reason: String| {
        let message = format!("not the JSON of an identification: {reason}");
        vec![
            Diagnostic::error("plan.after", &source.name, message)
                .help("give what `deflex identify --json FILE` wrote"),
        ]
    };
    let value: Value = serde_json::from_slice(&source.bytes).map_err(|error| bad(error.to_string()))?;
    let added = value["added"].as_array().ok_or_else(|| bad("it has no `added`".to_owned()))?;
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let list = |value: &Value| value.as_array().into_iter().flatten().filter_map(text).collect::<Vec<_>>();
    let mut pairs: Vec<(String, String)> = Vec::new();
    let mut open = |a: &str, b: &str| {
        let pair = if a < b { (a.to_owned(), b.to_owned()) } else { (b.to_owned(), a.to_owned()) };
        let effects = [a, b].iter().all(|name| deflex::effects::kind(name).is_some());
        if a != b && effects && !pairs.contains(&pair) {
            pairs.push(pair);
        }
    };
    for effect in added {
        let kind = text(&effect["kind"]).ok_or_else(|| bad("an effect has no `kind`".to_owned()))?;
        list(&effect["not_told_apart_from"]).iter().for_each(|other| open(&kind, other));
    }
    let sets = value["sets"].as_array().into_iter().flatten();
    let sets: Vec<Vec<String>> =
        sets.filter(|set| set["probability"].as_f64().unwrap_or(0.0) >= OPEN).map(|set| list(&set["kinds"])).collect();
    for (i, one) in sets.iter().enumerate() {
        for other in &sets[i + 1..] {
            let only =
                |a: &[String], b: &[String]| a.iter().filter(|kind| !b.contains(kind)).cloned().collect::<Vec<_>>();
            for a in only(one, other) {
                only(other, one).iter().for_each(|b| open(&a, b));
            }
        }
    }
    Ok(pairs)
}
