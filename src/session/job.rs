//! Finds out which files form one program, and their language. The files are not parsed yet.

use super::context::Context;
use super::read::{all, parted, source};
use super::text::Text;
use deflex::program::cl::ClOptions;
use deflex::program::{Language, LongProgram, ModuleGroup, ModuleNames, Shared, detect, group_modules, unknown_marks};
use deflex::report::Origin;
use deflex::text::{Diagnostic, Source, Span, cannot_read};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::File;
use std::path::{Component, Path, PathBuf};

/// A program in one text.
pub(crate) type Long<'a> = LongProgram<'a, &'a Text>;

/// Files that form one program, not yet parsed.
#[derive(Clone, Debug)]
pub(crate) struct Job {
    /// Name in messages and reports: the paths as the user typed them.
    pub(crate) name: String,
    /// Texts that are corrected.
    pub(crate) texts: Vec<Text>,
    /// Names of the files in an output folder.
    pub(crate) files: Vec<PathBuf>,
    /// Files that are copied into the output folder without a change: the `.pgf` list.
    pub(crate) companions: Vec<(PathBuf, Vec<u8>)>,
    /// Language of all files.
    pub(crate) language: Language,
    /// Texts of other inputs that are read with this program and belong to programs of their own: those that it calls, those that call it,
    /// and what others read and change of its data.
    pub(crate) context: Vec<Text>,
    /// The name of another input that calls this program.
    pub(crate) caller: Option<String>,
    /// Whether a `.pgf` list names the modules: they are one program even if they do not use each other.
    listed: bool,
}

impl Job {
    /// The job of one input file, before files are grouped into programs.
    pub(crate) fn of(path: &Path, format: Option<Language>) -> Result<Self, Vec<Diagnostic>> {
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pgf")) {
            return Self::listed(path);
        }
        Self::of_text(Text::of(path)?, path, format)
    }

    /// The job of texts that have been grouped already.
    pub(crate) fn of_parts(
        name: String,
        texts: Vec<Text>,
        files: Vec<PathBuf>,
        companions: Vec<(PathBuf, Vec<u8>)>,
        language: Language,
    ) -> Self {
        Self { name, texts, files, companions, language, context: Vec::new(), caller: None, listed: false }
    }

    /// The one program that these files form; an error if they are several programs.
    pub(crate) fn one(jobs: Vec<Self>) -> Result<Self, Vec<Diagnostic>> {
        let jobs = grouped(jobs, &Context::default())?;
        let are_modules = |job: &Self| job.language == jobs[0].language && job.language.about().has_modules;
        if jobs.len() > 1 && !jobs.iter().all(are_modules) {
            let message = "several files are one program only if all of them are modules of one language";
            return Err(Diagnostic::error("program.several", &jobs[0].name, message)
                .help("give them one by one")
                .into());
        }
        let none = || Diagnostic::error("program.none", "", "expected the files of a program, and there are none");
        let mut one = jobs.into_iter().reduce(Self::with).ok_or_else(none)?;
        one.context.clear();
        Ok(one)
    }

    /// The same job, read with what another one is read with.
    pub(crate) fn with_context_of(mut self, other: &Self) -> Self {
        self.context.clone_from(&other.context);
        self
    }

    /// Reads the texts into memory.
    pub(crate) fn held(mut self) -> Result<Self, Vec<Diagnostic>> {
        self.texts = all(self.texts.into_iter().map(|text| text.read().map(Text::Held)))?;
        Ok(self)
    }

    /// Adds the modules of another job.
    fn with(mut self, more: Self) -> Self {
        self.name = format!("{} + {}", self.name, more.name);
        self.texts.extend(more.texts);
        self.files.extend(more.files);
        self.companions.extend(more.companions);
        self
    }

    /// The program as one text that can be read in chunks; `None` if it has several files. `context` declares names
    /// that the text does not declare, and CL data are read with `cl`.
    pub(crate) fn long<'a>(&'a self, context: Cow<'a, [Source]>, cl: Option<ClOptions>) -> Option<Long<'a>> {
        let [text] = &self.texts[..] else { return None };
        Some(LongProgram::new(text, self.language, context, cl))
    }

    /// Refuses comments that look like a mark for deflex, such as `! deflex air`, and are not one.
    pub(crate) fn marked(&self) -> Result<(), Vec<Diagnostic>> {
        let marks = |text: &Text| {
            let found = match text {
                Text::Held(source) => unknown_marks(&source.name, self.language, &source.bytes[..]),
                Text::File { name, path } => File::open(path).and_then(|file| unknown_marks(name, self.language, file)),
            };
            match found {
                Ok(errors) if errors.is_empty() => Ok(()),
                Ok(errors) => Err(errors),
                Err(error) => Err(cannot_read(text.name(), &error)),
            }
        };
        all(self.texts.iter().map(marks)).map(drop)
    }

    /// Names and hashes of the files.
    pub(crate) fn origins(&self) -> Result<Vec<Origin>, Vec<Diagnostic>> {
        all(self.texts.iter().map(Text::origin))
    }

    /// The job of an input whose text has been opened.
    pub(crate) fn of_text(text: Text, path: &Path, format: Option<Language>) -> Result<Self, Vec<Diagnostic>> {
        let head = text.head()?;
        let unknown = || unknown_language(&Source::new(text.name(), head.clone()));
        if head.iter().all(u8::is_ascii_whitespace) {
            return Err(unknown());
        }
        let language = match format {
            Some(format) => format,
            None => detect(text.name(), &head).ok_or_else(unknown)?,
        };
        let mut job = Self {
            name: text.name().to_owned(),
            texts: vec![text],
            files: vec![file_name(path)],
            companions: Vec::new(),
            language,
            context: Vec::new(),
            caller: None,
            listed: false,
        };
        if let Some(data) = language.about().companion.and_then(|ending| with_ending(path, ending)) {
            job.texts.push(Text::of(&data)?);
            job.files.push(file_name(&data));
        }
        Ok(job)
    }

    /// Names that the files declare and use.
    fn names(&self) -> Result<ModuleNames, Vec<Diagnostic>> {
        let mut names = ModuleNames::new(self.language);
        all(self.texts.iter().map(|text| text.names(&mut names)))?;
        Ok(names)
    }

    /// The job of a `.pgf` file, an XML list of modules in the same folder.
    fn listed(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        let list = source(path)?;
        let text = String::from_utf8_lossy(&list.bytes);
        let folder = path.parent().unwrap_or(Path::new(""));
        let names = text.split("<Module>").skip(1).filter_map(|rest| rest.split("</Module>").next());
        let files: Vec<PathBuf> = names.map(|name| PathBuf::from(name.trim().replace('\\', "/"))).collect();
        let outside =
            |file: &PathBuf| file.is_absolute() || file.components().any(|part| matches!(part, Component::ParentDir));
        if files.is_empty() || files.iter().any(outside) {
            let message = "expected a list of <Module>NAME.mod</Module> in the folder of the .pgf file";
            return Err(vec![
                Diagnostic::error("program.pgf", &list.name, message).help("give the modules themselves instead"),
            ]);
        }
        let paths: Vec<PathBuf> = files.iter().map(|file| folder.join(file)).collect();
        let missing: Vec<String> = paths
            .iter()
            .zip(&files)
            .filter(|(path, _)| !path.is_file())
            .map(|(_, file)| file.display().to_string())
            .collect();
        if !missing.is_empty() {
            let message = format!("the list names modules that are not in its folder: {}", missing.join(", "));
            return Err(vec![
                Diagnostic::error("program.pgf", &list.name, message)
                    .help("copy them there, or give the modules themselves"),
            ]);
        }
        Ok(Self {
            name: list.name.clone(),
            texts: all(paths.iter().map(|path| Text::of(path)))?,
            files,
            companions: vec![(PathBuf::from(path.file_name().unwrap_or(path.as_os_str())), list.bytes)],
            language: Language::Rapid,
            context: Vec::new(),
            caller: None,
            listed: true,
        })
    }
}

fn file_name(path: &Path) -> PathBuf {
    PathBuf::from(path.file_name().unwrap_or(path.as_os_str()))
}

/// The file with the same name and another ending, if it exists. Upper and lower case count as the same, as on the controller.
fn with_ending(path: &Path, ending: &str) -> Option<PathBuf> {
    if path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending)) {
        return None;
    }
    let others = [ending.to_ascii_lowercase(), ending.to_ascii_uppercase()].map(|ending| path.with_extension(ending));
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let same = |name: &OsString| others[0].file_name().is_some_and(|wanted| name.eq_ignore_ascii_case(wanted));
    let in_folder = || {
        let names = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.file_name());
        names.filter(same).min().map(|name| path.with_file_name(name))
    };
    others.iter().find(|other| other.is_file()).cloned().or_else(in_folder)
}

/// Whether the file is read as part of another: KRL data are read with the `.src` file of the same name.
pub(crate) fn belongs_to_another(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("dat")) && with_ending(path, "src").is_some()
}

/// Groups input files into programs. Those that a file of the context calls are one program.
pub(crate) fn jobs(
    inputs: &[PathBuf],
    format: Option<Language>,
    context: &Context,
) -> Result<Vec<Job>, Vec<Diagnostic>> {
    grouped(all(inputs.iter().map(|path| Job::of(path, format)))?, context)
}

/// Groups the input files that can be read, and returns the errors of the others.
pub(crate) fn jobs_that_can_be(
    inputs: &[PathBuf],
    format: Option<Language>,
    context: &Context,
) -> Result<Looked, Vec<Diagnostic>> {
    let (jobs, failed) = parted(inputs.iter().map(|path| Job::of(path, format)));
    Ok((grouped(jobs, context)?, failed))
}

/// Programs, and the errors of inputs that cannot be read.
pub(crate) type Looked = (Vec<Job>, Vec<Diagnostic>);

fn grouped(mut jobs: Vec<Job>, context: &Context) -> Result<Vec<Job>, Vec<Diagnostic>> {
    // Data files that the user gave in addition to the program to which they belong.
    let with: BTreeSet<String> =
        jobs.iter().flat_map(|job| &job.texts[1..]).map(|text| text.name().to_owned()).collect();
    jobs.retain(|job| job.texts.len() > 1 || !with.contains(job.texts[0].name()));
    if jobs.len() <= 1 {
        return Ok(jobs);
    }
    let is_single = |job: &Job| job.language.about().has_modules && !job.listed;
    let (modules, others): (Vec<_>, Vec<_>) = jobs.into_iter().enumerate().partition(|(_, job)| is_single(job));
    let mut names = all(modules.par_iter().map(|(_, job)| job.names()).collect::<Vec<_>>())?;
    let is_input =
        |source: &Source| modules.iter().any(|(_, job)| job.texts.iter().any(|text| text.name() == source.name));
    let given = context.sources().iter().filter(|source| !is_input(source));
    names.extend(all(given.filter_map(module_names))?);
    let mut out = others;
    connect(&mut out)?;
    for ModuleGroup { members, context, others } in group_modules(&names, modules.len()) {
        let members = members.into_iter().map(|i| modules[i].clone());
        let context = context.into_iter().flat_map(|i| modules[i].1.texts.clone());
        let context: Vec<Text> = context.chain(others.map(Text::Held)).collect();
        let joined = members.reduce(|(place, job), (_, more)| (place, job.with(more)));
        out.extend(joined.map(|(place, job)| (place, Job { context, ..job })));
    }
    out.sort_by_key(|(place, _)| *place);
    Ok(out.into_iter().map(|(_, job)| job).collect())
}

/// Names of a module of the context; `None` if it is no module.
fn module_names(source: &Source) -> Option<Result<ModuleNames, Vec<Diagnostic>>> {
    let language = detect(&source.name, &source.bytes).filter(|language| language.about().has_modules)?;
    let mut names = ModuleNames::new(language);
    let read = names.read(&source.bytes[..]);
    Some(read.map(|()| names).map_err(|error| cannot_read(&source.name, &error)))
}

/// Gives each program the others that it calls, with those that they call, those that call it, and those whose data matter to it; and the name of
/// one that calls it.
fn connect(jobs: &mut [(usize, Job)]) -> Result<(), Vec<Diagnostic>> {
    let may_call = |job: &Job| job.language.about().calls.is_some();
    let names = jobs.par_iter().filter(|(_, job)| may_call(job)).map(|(_, job)| job.names());
    let names = all(names.collect::<Vec<_>>())?;
    let mut jobs: Vec<&mut Job> = jobs.iter_mut().map(|(_, job)| job).filter(|job| may_call(job)).collect();
    let calls = |i: usize, k: usize| i != k && names[i].calls(&names[k]);
    let called: Vec<BTreeSet<usize>> = (0..names.len())
        .map(|i| {
            let (mut all, mut open) = (BTreeSet::new(), vec![i]);
            while let Some(caller) = open.pop() {
                open.extend((0..names.len()).filter(|k| calls(caller, *k) && *k != i && all.insert(*k)));
            }
            all
        })
        .collect();
    for i in 0..names.len() {
        let is_caller = |k: usize| called[k].contains(&i);
        let mut own = names[i].shared().clone();
        called[i].iter().for_each(|k| own.extend(names[*k].shared()));
        // Of programs in which the same matters to this one, one is enough: each of a hundred programs is not read with each. What another program
        // leaves does not matter if a caller of this one calls it too, so that such programs do not stand for others.
        let siblings: BTreeSet<usize> = called.iter().filter(|called| called.contains(&i)).flatten().copied().collect();
        let mut known = [Shared::default(), Shared::default()];
        let mut adds =
            |k: usize| k != i && names[i].learn(&names[k], &own, &mut known[usize::from(siblings.contains(&k))]);
        let related = (0..names.len()).filter(|k| called[i].contains(k) || is_caller(*k) || adds(*k));
        jobs[i].context = related.map(|k| jobs[k].texts[0].clone()).collect();
        jobs[i].caller = (0..names.len()).find(|k| calls(*k, i)).map(|k| jobs[k].name.clone());
    }
    Ok(())
}

fn unknown_language(head: &Source) -> Vec<Diagnostic> {
    let what = if head.bytes.iter().all(u8::is_ascii_whitespace) {
        "the file is empty".to_owned()
    } else {
        let names = Language::ALL.map(Language::name);
        format!("neither {} nor {} was recognised", names[..names.len() - 1].join(", "), names[names.len() - 1])
    };
    let expected = "expected MODULE (RAPID), DEF or DEFDAT (KRL), /PROG (FANUC TP), def (URScript), /JOB (INFORM), or GOTO/ \
                    (CL data)";
    let words = Language::ALL.map(Language::word).join(" | ");
    Diagnostic::error("program.language", "", format!("{what}: {expected}"))
        .at(head, Span::new(0, 0))
        .help(format!("check that it is a program; `--input-format {words}` states its language"))
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::input::program_alone;

    fn job(name: &str, text: &str) -> Job {
        Job::of_text(Text::Held(Source::new(name, text)), Path::new(name), None).unwrap()
    }

    #[test]
    fn a_program_is_read_with_the_other_inputs_that_matter_to_it() {
        let part = |name: &str| {
            format!(
                "MODULE {name}\nPROC main()\nrCut wP;\nMoveL [[0,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tM;\nENDPROC\nENDMODULE\n"
            )
        };
        let data = "MODULE Data\nPERS tooldata tM:=[TRUE,[[0,0,310],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\nPERS wobjdata wP:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nPROC rCut(PERS wobjdata w)\nENDPROC\nENDMODULE\n";
        let inputs = || vec![job("one.mod", &part("One")), job("two.mod", &part("Two")), job("data.mod", data)];
        let jobs = grouped(inputs(), &Context::default()).unwrap();
        let names: Vec<&str> = jobs.iter().map(|job| &job.name[..]).collect();
        assert_eq!(names, ["one.mod + data.mod", "two.mod"]);
        let context = |job: &Job| job.context.iter().map(|text| text.name().to_owned()).collect::<Vec<_>>();
        assert_eq!([context(&jobs[0]), context(&jobs[1])], [["two.mod"], ["data.mod"]]);
        for job in jobs {
            let context = Context::default();
            assert_eq!(context.with(&job.context, job.language, None).unwrap().len(), 1);
            // A file that the command gives with --context too is read once.
            let given = Context::from(vec![Source::new("data.mod", data), Source::new("two.mod", part("Two"))]);
            assert_eq!(given.with(&job.context, job.language, None).unwrap().len(), 2);
            let program = program_alone(job, &context).unwrap();
            assert!(program.tools[0].data.is_some() && program.diagnostics.is_empty(), "{:?}", program.diagnostics);
        }
        // Files of one program are read as one, whatever they declare.
        assert!(Job::one(inputs()).unwrap().context.is_empty());
    }

    #[test]
    fn inputs_that_a_file_of_the_context_calls_are_one_program() {
        let part = |name: &str| format!("MODULE m{name}\nPROC {name}()\nENDPROC\nENDMODULE\n");
        let inputs = || vec![job("one.mod", &part("rOne")), job("two.mod", &part("rTwo"))];
        let main =
            |body: &str| Source::new("main.mod", format!("MODULE Cell\nPROC main()\n{body}\nENDPROC\nENDMODULE\n"));
        let names = |given: Vec<Source>| {
            let jobs = grouped(inputs(), &Context::from(given)).unwrap();
            jobs.into_iter().map(|job| job.name).collect::<Vec<_>>()
        };
        assert_eq!(names(vec![main("rOne;\nrTwo;")]), ["one.mod + two.mod"]);
        assert_eq!(names(vec![main("rOne;")]), ["one.mod", "two.mod"]);
        // A file that the command names twice is read once, and a cell or data of other languages call nothing.
        let given =
            vec![Source::new("one.mod", part("rOne")), Source::new("cell.src", "DEF cell()\nrOne()\nrTwo()\nEND\n")];
        assert_eq!(names([given, vec![main("rOne;\nrTwo;")]].concat()), ["one.mod + two.mod"]);
    }

    /// A TP program with statements, and with positions 1 to 3.
    fn tp(name: &str, statements: &str) -> Job {
        let mut text =
            format!("/PROG  {name}\n/ATTR\nDEFAULT_GROUP\t= 1,*,*,*,*;\n/MN\n:UFRAME_NUM=1 ;\n:UTOOL_NUM=1 ;\n");
        statements.lines().for_each(|line| text += &format!(":{line} ;\n"));
        text += "/POS\n";
        for number in 1..=3 {
            text += &format!(
                "P[{number}]{{\nGP1:\nUF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0',\nX = {number}0 mm, Y = 0 mm, Z = 0 mm, W = 180 deg, P = 0 deg, R = 0 deg\n}};\n"
            );
        }
        job(&format!("{name}.ls"), &(text + "/END\n"))
    }

    /// The first program, read with the other inputs.
    fn first_of(inputs: &[(&str, &str)]) -> deflex::program::Program {
        let jobs = grouped(inputs.iter().map(|(name, statements)| tp(name, statements)).collect(), &Context::default());
        program_alone(jobs.unwrap().swap_remove(0), &Context::default()).unwrap()
    }

    #[test]
    fn other_inputs_count_for_a_tp_program() {
        use deflex::program::{Editable, Predecessor};
        let kept = |inputs: &[(&str, &str)]| {
            let targets = first_of(inputs).targets;
            targets
                .into_iter()
                .filter(|t| matches!(t.editable, Editable::No(_)))
                .filter_map(|t| t.name)
                .collect::<Vec<_>>()
        };
        // A register that another input uses.
        let approach = "J P[1] 20% FINE\nPR[1]=P[2]\nPR[1,3]=PR[1,3]+50\nL PR[1] 400mm/sec FINE\nL P[2] 30mm/sec FINE\nL P[3] 30mm/sec FINE";
        for (other, is_kept) in [("L PR[1] 30mm/sec FINE", true), ("L PR[2] 30mm/sec FINE", false), (approach, true)] {
            let kept = kept(&[("MAIN", approach), ("MAINB", other)]);
            assert_eq!(kept.iter().any(|name| &**name == "P[2]"), is_kept, "{other}");
        }
        // A caller that counts from where this one ends.
        let cut = "J P[1] 20% FINE\nL P[2] 30mm/sec FINE\nL P[3] 30mm/sec FINE";
        let caller = "J P[1] 20% FINE\nCALL S1\nL P[2] 30mm/sec FINE INC";
        assert!(kept(&[("S1", cut), ("MAIN", caller)]).iter().any(|name| &**name == "P[3]"));
        // A caller has moved the arm.
        let sub = "L P[1] 30mm/sec FINE\nL P[2] 30mm/sec FINE";
        let start = |inputs: &[(&str, &str)]| first_of(inputs).targets[0].predecessor;
        assert_ne!(start(&[("S1", sub), ("MAIN", caller)]), start(&[("S1", sub), ("S2", cut)]));
        assert_eq!(start(&[("S1", sub), ("MAIN", caller)]), Predecessor::Unknown);
        // A frame that another input sets, if no caller of this one calls it.
        let sets = "PR[3]=LPOS-LPOS\nUFRAME[1]=PR[3]";
        let without_target = |inputs: &[(&str, &str)]| first_of(inputs).unknown.len();
        assert_eq!(without_target(&[("S1", cut), ("MAINB", sets)]), 3);
        assert_eq!(without_target(&[("S1", cut), ("SETS", sets), ("MAIN", "CALL SETS\nCALL S1")]), 0);
        // One that a caller calls does not stand for another one, which no caller of the first calls.
        let others = [("S1", cut), ("SETS", sets), ("MAIN", "CALL SETS\nCALL S1"), ("MAINB", sets)];
        assert_eq!(without_target(&others), 3);
    }

    #[test]
    fn inputs_in_which_the_same_matters_are_not_all_read_with_each() {
        let cut = "PR[1]=P[2]\nPR[1,3]=PR[1,3]+50\nL PR[1] 400mm/sec FINE\nL P[2] 30mm/sec FINE";
        let jobs = (0..20).map(|number| tp(&format!("J{number}"), cut)).collect();
        let jobs = grouped(jobs, &Context::default()).unwrap();
        assert!(jobs.iter().all(|job| job.context.len() == 1));
    }
}
