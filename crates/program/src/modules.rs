//! Groups modules (RAPID), and `.src` files with their `.dat` (KRL), into programs: files that use each other's names belong together.

use super::Language;
use super::language::CallWords;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufRead};

/// Names that a module declares for others and names that it takes from others, upper case.
#[derive(Debug)]
#[doc(hidden)]
pub struct ModuleNames {
    language: Language,
    module: String,
    declared: BTreeSet<String>,
    local: BTreeSet<String>,
    used: BTreeSet<String>,
    /// Beginnings of names that it takes from others: of procedures that it calls by a name that it puts together at run time, and of such data.
    begun: BTreeSet<String>,
}

/// Groups modules into programs, as indices, in the order of their first module.
///
/// Two modules belong together if one uses a name, or the beginning of a name, that it does not declare and exactly one other module declares.
/// Modules with the same name, or with a `main` each, are different programs.
#[must_use]
#[doc(hidden)]
pub fn group_modules(names: &[ModuleNames]) -> Vec<Vec<usize>> {
    let mut owners: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (i, module) in names.iter().enumerate() {
        for name in &module.declared {
            owners.entry(name).or_default().push(i);
        }
    }
    let mut group: Vec<usize> = (0..names.len()).collect();
    for (i, module) in names.iter().enumerate() {
        let foreign = |name: &&str| !module.declared.contains(*name) && !module.local.contains(*name);
        let used = module
            .used
            .iter()
            .map(String::as_str)
            .chain(module.begun.iter().flat_map(|beginning| names_with(&owners, beginning)));
        for name in used.filter(foreign) {
            if let Some([owner]) = owners.get(name).map(Vec::as_slice) {
                let (a, b) = (group[i], group[*owner]);
                let members: Vec<usize> = (0..names.len()).filter(|&m| group[m] == a || group[m] == b).collect();
                if a != b && fit(names, &members) {
                    for m in members {
                        group[m] = a.min(b);
                    }
                }
            }
        }
    }
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, g) in group.into_iter().enumerate() {
        groups.entry(g).or_default().push(i);
    }
    groups.into_values().collect()
}

/// The declared names with this beginning.
fn names_with<'a>(owners: &BTreeMap<&'a str, Vec<usize>>, beginning: &'a str) -> Vec<&'a str> {
    let from = owners.range(beginning..).map(|(name, _)| *name);
    from.take_while(|name| name.starts_with(beginning)).collect()
}

/// Whether modules can be loaded into one task.
fn fit(names: &[ModuleNames], members: &[usize]) -> bool {
    let mut modules = BTreeSet::new();
    let one = members.iter().all(|&m| names[m].language == names[members[0]].language);
    let distinct = members.iter().all(|&m| modules.insert(&names[m].module));
    one && distinct && members.iter().filter(|&&m| names[m].declared.contains("MAIN")).count() <= 1
}

impl ModuleNames {
    /// No names yet, for a module in this language.
    #[must_use]
    pub fn new(language: Language) -> Self {
        let none = BTreeSet::new;
        Self { language, module: String::new(), declared: none(), local: none(), used: none(), begun: none() }
    }

    /// Whether this program calls another one by its name, in a language whose programs are files of their own.
    #[must_use]
    pub fn calls(&self, other: &Self) -> bool {
        let is_called = self.language.about().calls.is_some() && self.language == other.language;
        is_called && self.module != other.module && self.used.contains(&other.module)
    }

    /// Adds the names of a file of the module, which is read a line at a time.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn read(&mut self, mut input: impl BufRead) -> io::Result<()> {
        let mut words: [String; 3] = Default::default();
        let mut line = Vec::new();
        let comment = self.language.comment();
        while input.read_until(b'\n', &mut line)? > 0 {
            words_of(&line, comment).for_each(|word| self.take(&mut words, word));
            line.clear();
        }
        Ok(())
    }

    /// Adds a word that follows three others.
    fn take(&mut self, words: &mut [String; 3], Word { text, is_beginning }: Word<'_>) {
        let word = String::from_utf8_lossy(text).to_ascii_uppercase();
        if let Some(CallWords { own, called }) = &self.language.about().calls {
            if words[2] == *own && self.module.is_empty() {
                word.clone_into(&mut self.module);
            } else if called.contains(&words[2].as_str()) {
                self.used.insert(word.clone());
            }
            words.rotate_left(1);
            words[2] = word;
            return;
        }
        let declares = if self.language == Language::Krl { self.krl(words, &word) } else { self.rapid(words, &word) };
        // `CallByVar "Path",n` calls the procedure whose name is the text with the number after it.
        let list = if is_beginning || words[2] == "CALLBYVAR" { &mut self.begun } else { &mut self.used };
        if !declares && !list.contains(&word) {
            list.insert(word.clone());
        }
        words.rotate_left(1);
        words[2] = word;
    }

    /// Whether the word is a declared name: it comes after `PROC`, or `PERS tooldata`.
    fn rapid(&mut self, words: &[String; 3], word: &str) -> bool {
        match (words[1].as_str(), words[2].as_str()) {
            (_, "MODULE" | "SYSMODULE") => word.clone_into(&mut self.module),
            (before, "PROC" | "TRAP") => self.declare(before == "LOCAL", word),
            (_, "PERS" | "CONST" | "VAR" | "FUNC" | "TASK") => {} // the type
            ("PERS" | "CONST" | "VAR" | "FUNC", _) => self.declare(words[0] == "LOCAL", word),
            _ => return false,
        }
        true
    }

    /// Whether the word is a declared name: it comes after `DEF`, `DEFFCT type`, `GLOBAL type`. Other files see the first routine and global
    /// ones.
    fn krl(&mut self, words: &[String; 3], word: &str) -> bool {
        let routine = |names: &mut Self, global: bool| {
            let first = names.module.is_empty();
            if first {
                word.clone_into(&mut names.module);
            }
            names.declare(!first && !global, word);
        };
        match [&words[0][..], &words[1], &words[2]] {
            [_, global, "DEF"] => routine(self, global == "GLOBAL"),
            [_, _, "DEFFCT"] | [_, "GLOBAL", "CONST" | "INTERRUPT"] => {} // the type
            [global, "DEFFCT", _] => routine(self, global == "GLOBAL"),
            [_, _, "DEFDAT" | "GLOBAL"] => {}
            [_, "GLOBAL", _] | ["GLOBAL", "CONST", _] => self.declare(false, word),
            _ => return false,
        }
        true
    }

    fn declare(&mut self, local: bool, name: &str) {
        let list = if local { &mut self.local } else { &mut self.declared };
        list.insert(name.to_owned());
    }
}

/// A word of a module.
struct Word<'a> {
    text: &'a [u8],
    /// Whether it is only the beginning of a name: a string to which something is added at run time.
    is_beginning: bool,
}

/// Words outside of comments, which begin with `comment`, and strings that are one word.
fn words_of(bytes: &[u8], comment: Option<u8>) -> impl Iterator<Item = Word<'_>> {
    let mut at = 0;
    let whole = |text| Word { text, is_beginning: false };
    std::iter::from_fn(move || {
        while at < bytes.len() {
            match bytes[at] {
                b if Some(b) == comment => {
                    at += bytes[at..].iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(bytes.len() - at)
                }
                b'"' => {
                    let start = at + 1;
                    let len = bytes[start..].iter().position(|&b| b == b'"').unwrap_or(bytes.len() - start);
                    at = start + len + 1;
                    // A text may name a routine: `%"Part_1"%` calls it, and so does `%"Module:Part_1"%`.
                    let text = bytes[start..start + len].rsplit(|&b| b == b':').next().unwrap_or_default();
                    let is_word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
                    if text.first().is_some_and(u8::is_ascii_alphabetic) && text.iter().all(is_word) {
                        let next = bytes.iter().skip(at).find(|b| !b.is_ascii_whitespace());
                        return Some(Word { text, is_beginning: next == Some(&b'+') });
                    }
                }
                b if b.is_ascii_alphabetic() => {
                    let word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
                    let end = at + bytes[at..].iter().position(|b| !word(b)).unwrap_or(bytes.len() - at);
                    let found = &bytes[at..end];
                    at = end;
                    return Some(whole(found));
                }
                // The rest of a number or of a word of another alphabet.
                b if b.is_ascii_digit() => {
                    at += bytes[at..].iter().position(|b| !b.is_ascii_alphanumeric()).unwrap_or(bytes.len() - at);
                }
                _ => at += 1,
            }
        }
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(texts: &[&str]) -> Vec<Vec<usize>> {
        groups_in(Language::Rapid, texts)
    }

    fn groups_in(language: Language, texts: &[&str]) -> Vec<Vec<usize>> {
        let names = |text: &&str| {
            let mut names = ModuleNames::new(language);
            names.read(text.as_bytes()).unwrap();
            names
        };
        group_modules(&texts.iter().map(names).collect::<Vec<_>>())
    }

    #[test]
    fn sources_that_call_each_other_are_one_program() {
        let main = "&ACCESS RVP\nDEF Main( )\n ; other()\n GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\n part_1()\nEND\nDEF own()\nEND\n";
        let part = "DEF part_1()\n DECL INT i\n LIN gPoint[1] C_DIS\nEND\nDEF own()\nEND\n";
        let data = "DEFDAT points PUBLIC\nDECL GLOBAL FRAME gPoint[3]\ngPoint[1]={X 1}\nENDDAT\n";
        let other = "DEF other()\n DECL INT i\n own()\nEND\n";
        assert_eq!(groups_in(Language::Krl, &[main, part, data, other]), [vec![0, 1, 2], vec![3]]);
    }

    #[test]
    fn modules_that_use_each_other_are_one_program() {
        let main = "MODULE Main\n PROC main()\n path1;\n ENDPROC\nENDMODULE\n";
        let path = "MODULE Path\n ! main\n PROC path1()\n MoveL p10,v20,z1,tMill;\n ENDPROC\nENDMODULE\n";
        let data = "MODULE Data\n PERS tooldata tMill:=[];\n TASK PERS robtarget p10:=[];\nENDMODULE\n";
        assert_eq!(groups(&[main, path, data]), [[0, 1, 2]]);
        assert_eq!(groups(&[data, path, main]), [[0, 1, 2]]);
    }

    #[test]
    fn modules_that_are_called_by_a_name_of_the_run_are_one_program() {
        let path = |n: usize| format!("MODULE J{n}\n PROC Path{n}()\n ENDPROC\nENDMODULE\n");
        let (one, two) = (path(1), path(2));
        for call in ["%\"Path\"+NumToStr(n,0)%;", "CallByVar \"Path\",n;"] {
            let main = format!("MODULE Main\n PROC main()\n {call}\n ENDPROC\nENDMODULE\n");
            assert_eq!(groups(&[&main, &one, &two]), [[0, 1, 2]], "{call}");
        }
        let main = "MODULE Main\n PROC main()\n %\"J2:Path2\"%;\n ENDPROC\nENDMODULE\n";
        assert_eq!(groups(&[main, &one, &two]), [vec![0, 2], vec![1]]);
        // A text that is no name of a procedure, and the beginning of a name that two modules declare, join nothing.
        let main = "MODULE Main\n PROC main()\n TPWrite \"Path\";\n %\"Path\"+s%;\n ENDPROC\nENDMODULE\n";
        let copy = one.replace("J1", "Copy");
        assert_eq!(groups(&[main, &one, &copy]), [[0], [1], [2]]);
    }

    #[test]
    fn programs_of_their_own_stay_apart() {
        let one = "MODULE Part\n PERS tooldata t:=[];\n PROC main()\n MoveL p,v20,z1,t;\n ENDPROC\nENDMODULE\n";
        let local =
            "MODULE Other\n LOCAL CONST robtarget p:=[];\n PROC run()\n MoveL p,v20,z1,tool0;\n ENDPROC\nENDMODULE\n";
        assert_eq!(groups(&[one, one]), [[0], [1]]);
        assert_eq!(groups(&[one, local]), [[0], [1]]);
    }

    #[test]
    fn programs_of_their_own_call_each_other() {
        let names = |language: Language, text: &str| {
            let mut names = ModuleNames::new(language);
            names.read(text.as_bytes()).unwrap();
            names
        };
        let main = names(Language::Ls, "/PROG  MAIN\n/MN\n   1:  CALL SUB_1(R[1]) ;\n   2:  !CALL OTHER ;\n/END\n");
        let [sub, other] = ["SUB_1", "OTHER"].map(|name| names(Language::Ls, &format!("/PROG {name}\n/MN\n/END\n")));
        assert!(main.calls(&sub) && !main.calls(&other) && !sub.calls(&main));
        let main = names(Language::Jbi, "/JOB\n//NAME MAIN\nNOP\nCALL JOB:SUB IF IN#(1)=ON\nEND\n");
        assert!(main.calls(&names(Language::Jbi, "/JOB\n//NAME SUB\nNOP\nEND\n")));
    }

    #[test]
    fn an_open_string_ends_with_its_line() {
        assert_eq!(groups(&["MODULE A\n TPWrite \"open"]), [[0]]);
    }
}
