//! Groups modules (RAPID), and `.src` files with their `.dat` (KRL), into programs: files that use each other's names belong together. Other
//! given files count too, if they read or change what a program has, or call it.

mod scan;

use super::Language;
#[doc(hidden)]
pub use deflex_lang::tp::Shared;
use deflex_text::Source;
pub use scan::ModuleNames;
use scan::{Declared, OVERRIDE};
use std::collections::{BTreeMap, BTreeSet};

/// Modules that form a program, as indices.
#[derive(Debug)]
#[doc(hidden)]
pub struct ModuleGroup {
    /// The modules of the program.
    pub members: Vec<usize>,
    /// Other modules that are its context: those that declare what it uses, and those that call its routines.
    pub context: Vec<usize>,
    /// A context with what all other modules read and change of its data.
    pub others: Option<Source>,
}

/// Groups modules into programs, in the order of their first module.
///
/// Two modules belong together if one uses a name, or the beginning of a name, that it does not declare and exactly one other module declares.
/// Modules with the same name, or with a `main` each, are different programs: one is then context of the other.
///
/// The first `count` modules are grouped. The others are only read: they join the modules whose routines they call.
#[must_use]
#[doc(hidden)]
pub fn group_modules(names: &[ModuleNames], count: usize) -> Vec<ModuleGroup> {
    let mut modules = Modules::new(&names[..count]);
    modules.join();
    if count < names.len() {
        modules.join_by_callers(&Modules::new(names));
    }
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, g) in modules.group.iter().enumerate() {
        groups.entry(*g).or_default().push(i);
    }
    let links = Links::new(&modules);
    groups.into_values().map(|members| modules.with_context(&links, members)).collect()
}

struct Modules<'a> {
    names: &'a [ModuleNames],
    owners: BTreeMap<&'a str, Vec<usize>>,
    /// The group of each module: the index of its first module.
    group: Vec<usize>,
}

/// What modules take from modules of other groups.
struct Links<'a> {
    /// For each module, the names that others take from it, and who does.
    taken_by: Vec<Vec<(usize, &'a str)>>,
    /// For each module, the names that it takes from other groups, with the modules that declare them.
    takes: Vec<Vec<(&'a str, Vec<usize>)>>,
    /// The modules that may change data, by its name.
    changers: BTreeMap<&'a str, Vec<Change<'a>>>,
}

/// A change of data by a module.
struct Change<'a> {
    by: usize,
    /// The data, or the element of it that is changed.
    place: &'a str,
    /// The modules that declare the data; none if no given file does.
    owners: Vec<usize>,
}

/// Data of the controller that KRL programs use without naming them: tables (`BAS (#BASE,1)`) and the override.
const UNNAMED: [&str; 4] = ["BASE_DATA", "TOOL_DATA", "LOAD_DATA", OVERRIDE];

impl<'a> Modules<'a> {
    fn new(names: &'a [ModuleNames]) -> Self {
        let mut owners: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (i, module) in names.iter().enumerate() {
            for name in module.declared.keys() {
                owners.entry(name).or_default().push(i);
            }
        }
        Self { names, owners, group: (0..names.len()).collect() }
    }

    /// Joins the modules that belong together.
    fn join(&mut self) {
        for i in 0..self.names.len() {
            for name in self.foreign(i) {
                if let [owner] = self.owners_for(i, name)[..] {
                    self.unite(i, owner, None);
                }
            }
        }
    }

    /// Joins the modules whose routines a module of the context calls: only together they show from which states it calls them. `all` are
    /// these modules, and those of the context after them.
    fn join_by_callers(&mut self, all: &Self) {
        let calls: Vec<BTreeSet<usize>> = (0..all.names.len()).map(|module| all.calls(module)).collect();
        let inputs = self.names.len();
        for caller in inputs..all.names.len() {
            let (mut reached, mut open) = (BTreeSet::from([caller]), vec![caller]);
            while let Some(module) = open.pop() {
                open.extend(calls[module].iter().filter(|called| reached.insert(**called) && **called >= inputs));
            }
            reached.retain(|module| *module < inputs);
            if !reached.is_empty() {
                reached.extend((0..inputs).filter(|input| calls[*input].contains(&caller)));
            }
            let reached: Vec<usize> = reached.into_iter().collect();
            for (i, one) in reached.iter().enumerate() {
                reached[..i].iter().for_each(|other| self.unite(*other, *one, Some(&all.names[caller])));
            }
        }
    }

    /// Joins the programs of two modules, if they and the module that calls both can be loaded into one task.
    fn unite(&mut self, one: usize, other: usize, caller: Option<&ModuleNames>) {
        let (a, b) = (self.group[one], self.group[other]);
        if a == b {
            return;
        }
        let members: Vec<usize> = (0..self.names.len()).filter(|&m| self.group[m] == a || self.group[m] == b).collect();
        if fit(members.iter().map(|&m| &self.names[m]).chain(caller)) {
            for m in members {
                self.group[m] = a.min(b);
            }
        }
    }

    /// The modules whose routines a module calls.
    fn calls(&self, module: usize) -> BTreeSet<usize> {
        let called = |name: &str| match self.owners_for(module, name)[..] {
            [owner] => (self.names[owner].declared.get(name) == Some(&Declared::Routine)).then_some(owner),
            _ => None,
        };
        self.foreign(module).into_iter().filter_map(called).collect()
    }

    /// Names that a module uses and does not declare.
    fn foreign(&self, module: usize) -> Vec<&'a str> {
        let own = &self.names[module];
        let begun = own.begun.iter().flat_map(|beginning| names_with(&self.owners, beginning));
        let all = own.used.iter().map(String::as_str).chain(begun);
        all.filter(|name| !own.declared.contains_key(*name) && !own.local.contains(*name)).collect()
    }

    /// The modules of its language that may declare a name that a module uses.
    fn owners_for(&self, module: usize, name: &str) -> Vec<usize> {
        let own = &self.names[module];
        if own.declared.contains_key(name) || own.local.contains(name) {
            return vec![module];
        }
        let all = self.owners.get(name).map_or(&[][..], Vec::as_slice);
        all.iter().copied().filter(|owner| self.names[*owner].language == own.language).collect()
    }

    /// The same after the modules are joined: those of the same program come first.
    fn owners_of(&self, module: usize, name: &str) -> Vec<usize> {
        let all = self.owners_for(module, name);
        let here: Vec<usize> = all.iter().copied().filter(|owner| self.group[*owner] == self.group[module]).collect();
        if here.is_empty() { all } else { here }
    }

    /// Data outside of its routines that a module may change.
    fn changes(&self, module: usize) -> BTreeSet<&'a str> {
        let names = &self.names[module];
        let mut changes: BTreeSet<&str> = names.changed.iter().map(String::as_str).collect();
        for (routine, given) in &names.given {
            let owners = self.owners_of(module, routine);
            let keeps = !owners.is_empty() && owners.iter().all(|owner| self.names[*owner].keeping.contains(routine));
            if !keeps {
                changes.extend(given.iter().map(String::as_str));
            }
        }
        changes
    }

    /// Whether a module is part of a program with a `main`.
    fn has_main(&self, module: usize) -> bool {
        let is_main = |(m, names): (usize, &ModuleNames)| {
            self.group[m] == self.group[module] && names.declared.contains_key("MAIN")
        };
        self.names.iter().enumerate().any(is_main)
    }

    /// A program with its context.
    fn with_context(&self, links: &Links<'_>, members: Vec<usize>) -> ModuleGroup {
        let mut all: BTreeSet<usize> = members.iter().copied().collect();
        // The callers of its routines, with their callers.
        let mut open = members.clone();
        while let Some(called) = open.pop() {
            let calls = |name: &str| self.names[called].declared.get(name) == Some(&Declared::Routine);
            let callers = links.taken_by[called].iter().filter(|(_, name)| calls(name));
            open.extend(callers.map(|(caller, _)| *caller).filter(|caller| all.insert(*caller)));
        }
        // What all of them use.
        let mut open: Vec<usize> = all.iter().copied().collect();
        let mut several = BTreeSet::new();
        while let Some(user) = open.pop() {
            for (name, owners) in &links.takes[user] {
                let declared = |owner: &usize| self.names[*owner].declared.get(*name);
                let first = owners[0];
                let is_persistent = matches!(declared(&first), Some(Declared::Persistent { .. }));
                if owners.len() == 1 || is_persistent && owners.iter().all(|owner| declared(owner) == declared(&first))
                {
                    open.extend(all.insert(first).then_some(first));
                } else {
                    several.insert(*name);
                }
            }
        }
        let others = self.others(links, (&members, &all), &several);
        let context = all.into_iter().filter(|module| !members.contains(module)).collect();
        ModuleGroup { members, context, others }
    }

    /// What other modules than `all` read and change of the data of a program, and its names of which several modules declare data.
    fn others(
        &self,
        links: &Links<'_>,
        (members, all): (&[usize], &BTreeSet<usize>),
        several: &BTreeSet<&str>,
    ) -> Option<Source> {
        let language = self.names[members[0]].language;
        let (mut changed, mut shared) = (BTreeSet::new(), BTreeMap::new());
        for user in all {
            let names = &self.names[*user];
            let unnamed = UNNAMED.iter().filter(|_| language == Language::Krl).copied();
            let own = names.declared.keys().map(String::as_str);
            for name in self.foreign(*user).into_iter().chain(own).chain(unnamed) {
                let owners = self.owners_of(*user, name);
                for change in links.changers.get(name).into_iter().flatten().filter(|change| !all.contains(&change.by))
                {
                    if self.names[change.by].language != language {
                    } else if change.owners == owners || owners.iter().any(|owner| change.owners.contains(owner)) {
                        changed.insert(change.place);
                    } else if let Some(Declared::Persistent { kind, .. }) = names.declared.get(name)
                        && self.has_main(members[0])
                        && change.owners.iter().any(|owner| self.shares(*owner, name))
                    {
                        shared.insert(name, kind);
                    }
                }
            }
        }
        let read: BTreeSet<&str> = members
            .iter()
            .flat_map(|member| &links.taken_by[*member])
            .filter(|(user, _)| !all.contains(user))
            .map(|(_, name)| *name)
            .collect();
        let declared =
            several.iter().filter_map(|name| match self.names[*self.owners.get(name)?.first()?].declared.get(*name) {
                Some(Declared::Persistent { kind, .. }) => Some((*name, kind)),
                _ => None,
            });
        let declared: BTreeMap<&str, &String> = declared.collect();
        if [changed.len(), shared.len(), read.len(), declared.len()] == [0; 4] {
            return None;
        }
        let persistent = |(name, kind): (&&str, &&String)| format!("PERS {kind} {name};");
        let sets = |name: &str| format!("{name}:=deflex_value;");
        let mut lines: Vec<String> = Vec::new();
        if language == Language::Krl {
            lines.push("DEF deflex_others ( )".to_owned());
            lines.extend(changed.iter().map(|place| format!("{place}=deflex_value")));
            lines.push("END\n".to_owned());
        } else {
            lines.push("MODULE deflex_others".to_owned());
            lines.extend(declared.iter().map(persistent));
            lines.push("PROC deflex_others()".to_owned());
            lines.extend(read.iter().map(|name| format!("Write deflex_value,{name};")));
            lines.extend(changed.iter().map(|name| sets(name)));
            lines.push("ENDPROC\nENDMODULE\nMODULE deflex_tasks".to_owned());
            lines.extend(shared.iter().map(persistent));
            // Declared here and above, they have no value that is known.
            lines.extend(declared.iter().map(|(name, kind)| format!("PERS {kind} {name}:=deflex_value;")));
            lines.push("PROC deflex_tasks()".to_owned());
            lines.extend(shared.keys().map(|name| sets(name)));
            lines.push("ENDPROC\nENDMODULE\n".to_owned());
        }
        Some(Source::new("[other files]", lines.join("\n")))
    }

    /// Whether a module of a task declares a `PERS` that other tasks may declare too.
    fn shares(&self, owner: usize, name: &str) -> bool {
        matches!(self.names[owner].declared.get(name), Some(Declared::Persistent { .. })) && self.has_main(owner)
    }
}

impl<'a> Links<'a> {
    fn new(modules: &Modules<'a>) -> Self {
        let count = modules.names.len();
        let mut links =
            Self { taken_by: vec![Vec::new(); count], takes: vec![Vec::new(); count], changers: BTreeMap::new() };
        for module in 0..count {
            for name in modules.foreign(module) {
                let owners = modules.owners_of(module, name);
                if owners.is_empty() || owners.iter().any(|owner| modules.group[*owner] == modules.group[module]) {
                    continue;
                }
                owners.iter().for_each(|owner| links.taken_by[*owner].push((module, name)));
                links.takes[module].push((name, owners));
            }
            for place in modules.changes(module) {
                let name = place.split('[').next().unwrap_or(place);
                let owners = modules.owners_of(module, name);
                links.changers.entry(name).or_default().push(Change { by: module, place, owners });
            }
        }
        links
    }
}

/// The declared names with this beginning.
fn names_with<'a>(owners: &BTreeMap<&'a str, Vec<usize>>, beginning: &'a str) -> Vec<&'a str> {
    let from = owners.range(beginning..).map(|(name, _)| *name);
    from.take_while(|name| name.starts_with(beginning)).collect()
}

/// Whether modules can be loaded into one task.
fn fit<'a>(members: impl Iterator<Item = &'a ModuleNames>) -> bool {
    let members: Vec<&ModuleNames> = members.collect();
    let mut modules = BTreeSet::new();
    let one = members.iter().all(|module| module.language == members[0].language);
    let distinct = members.iter().all(|module| modules.insert(&module.module));
    one && distinct && members.iter().filter(|module| module.declared.contains_key("MAIN")).count() <= 1
}
