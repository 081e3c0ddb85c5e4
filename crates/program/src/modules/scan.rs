//! Reads the names of a module from its text, a line at a time and without its syntax tree: the files of a batch may be long.

use crate::krl::{self, Called};
use crate::{Language, language::CallWords, rapid};
use deflex_lang::tp::Shared;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, BufRead};

/// Names that a module declares for others and names that it takes from others, upper case.
#[derive(Debug)]
#[doc(hidden)]
pub struct ModuleNames {
    pub(super) language: Language,
    pub(super) module: String,
    pub(super) declared: BTreeMap<String, Declared>,
    pub(super) local: BTreeSet<String>,
    pub(super) used: BTreeSet<String>,
    /// Beginnings of names that it takes from others: of procedures that it calls by a name that it puts together at run time, and of such data.
    pub(super) begun: BTreeSet<String>,
    /// Data outside of its routines that these may change. An element of a KRL array with a written index has the index.
    pub(super) changed: BTreeSet<String>,
    /// Data that its routines give to others, by the name of the routine that may change them. A routine without a name may be any.
    pub(super) given: BTreeMap<String, BTreeSet<String>>,
    /// Routines that change none of their parameters.
    pub(super) keeping: BTreeSet<String>,
    /// What a TP program has in common with others.
    shared: Shared,
    scan: Scan,
}

/// The override of KRL, by which the controller multiplies every speed.
pub(super) const OVERRIDE: &str = "$OV_PRO";

/// What a name is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Declared {
    Routine,
    /// RECORD, ALIAS, STRUC, ENUM.
    Type,
    /// `PERS`, which tasks share.
    Persistent {
        kind: String,
        /// Hash of the text of its value.
        value: u64,
    },
    Data,
}

/// The place that the scan has reached.
#[derive(Debug, Default)]
struct Scan {
    /// The last three words.
    words: [String; 3],
    /// What stands before the next token.
    before: Before,
    within: Within,
    /// Parameters and data of the present routine.
    own: BTreeSet<String>,
    routine: String,
    /// Whether the present routine may change a name of its own.
    changes_own: bool,
    statement: Statement,
    /// Data of a module whose declaration has not ended.
    pending: Option<Pending>,
    /// Its tokens after the name.
    value: DefaultHasher,
    list: Option<List>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Before {
    #[default]
    Nothing,
    Word,
    Mark(u8),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Within {
    #[default]
    Module,
    /// The parameters of a routine.
    Header,
    Routine,
    Record,
    /// A data list of KRL.
    DataList,
}

/// A statement, up to the present token.
#[derive(Debug, Default)]
struct Statement {
    first: String,
    /// Names in it, the first one too.
    names: Vec<String>,
    /// Names before a round bracket.
    functions: Vec<String>,
    /// Brackets that are open.
    depth: usize,
    is_longer_than_path: bool,
    is_assignment: bool,
    /// The written index of the array that it may assign.
    index: Option<String>,
    /// How many numbers it has, and whether the last one is 100.
    numbers: usize,
    is_full: bool,
    /// Whether it names the command of `BAS` that sets the override.
    has_override: bool,
}

#[derive(Debug)]
struct Pending {
    name: String,
    is_local: bool,
    what: Declared,
    has_value: bool,
}

/// A declaration of KRL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct List {
    is_global: bool,
    next: ListPart,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ListPart {
    Type,
    Names,
    /// The name of a STRUC, an ENUM or a SIGNAL, after which others follow.
    OneName,
    Rest,
}

impl ModuleNames {
    /// No names yet, for a module in this language.
    #[must_use]
    pub fn new(language: Language) -> Self {
        let none = BTreeSet::new;
        Self {
            language,
            module: String::new(),
            declared: BTreeMap::new(),
            local: none(),
            used: none(),
            begun: none(),
            changed: none(),
            given: BTreeMap::new(),
            keeping: none(),
            shared: Shared::default(),
            scan: Scan::default(),
        }
    }

    /// Whether this program calls another one by its name, in a language whose programs are files of their own.
    #[must_use]
    pub fn calls(&self, other: &Self) -> bool {
        let is_called = self.language.about().calls.is_some() && self.language == other.language;
        is_called && self.module != other.module && self.used.contains(&other.module)
    }

    /// What the program has in common with others that it does not call.
    #[must_use]
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// Adds what in another program matters to this one to what is known of others, and returns whether any of it is new. This one has `own` in common
    /// with others, with those that it calls.
    pub fn learn(&self, other: &Self, own: &Shared, known: &mut Shared) -> bool {
        self.module != other.module && own.learn(&other.shared, known)
    }

    /// Adds the names of a file of the module, which is read a line at a time.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn read(&mut self, mut input: impl BufRead) -> io::Result<()> {
        self.scan = Scan::default();
        let language = self.language;
        if language == Language::Ls {
            // Statements may have several lines.
            let mut text = Vec::new();
            input.read_to_end(&mut text)?;
            self.shared = Shared::of(&text);
            tokens_of(&text, language).for_each(|token| self.take(&token));
            return Ok(());
        }
        let mut line = Vec::new();
        while input.read_until(b'\n', &mut line)? > 0 {
            tokens_of(&line, language).for_each(|token| self.take(&token));
            self.take(&Token::Mark(b'\n'));
            line.clear();
        }
        Ok(())
    }

    fn take(&mut self, token: &Token<'_>) {
        if let Some(calls) = &self.language.about().calls {
            return self.call_word(calls, token);
        }
        if self.scan.pending.is_some() {
            token.hash(&mut self.scan.value);
        }
        let word = match *token {
            Token::Word(text) | Token::Text { text, .. } => String::from_utf8_lossy(text).to_ascii_uppercase(),
            Token::Number(number) => {
                self.number(number);
                self.scan.before = Before::Mark(b'0');
                return;
            }
            Token::Mark(mark) => {
                if self.language == Language::Krl {
                    self.krl_mark(mark)
                } else {
                    self.rapid_mark(mark)
                }
                // The end of a line is a blank in RAPID.
                if mark != b'\n' || self.language == Language::Krl {
                    self.scan.before = Before::Mark(mark);
                }
                return;
            }
        };
        let is_text = matches!(token, Token::Text { .. });
        let declares = match self.language {
            _ if is_text => false,
            Language::Krl => self.krl_word(&word),
            _ => self.rapid_word(&word),
        };
        // `CallByVar "Path",n` calls the procedure whose name is the text with the number after it.
        let is_beginning = matches!(token, Token::Text { is_beginning: true, .. }) || self.scan.words[2] == "CALLBYVAR";
        if !declares && !self.is_part() {
            let list = if is_beginning { &mut self.begun } else { &mut self.used };
            if !self.scan.own.contains(&word) && !list.contains(&word) {
                list.insert(word.clone());
            }
            self.name(&word);
        }
        self.scan.statement.has_override |= word == "OV_PRO";
        self.scan.before = Before::Word;
        self.scan.words.rotate_left(1);
        self.scan.words[2] = word;
    }

    /// A word of a program that calls others by the names of their files.
    fn call_word(&mut self, CallWords { own, called }: &CallWords, token: &Token<'_>) {
        let (Token::Word(text) | Token::Text { text, .. }) = *token else { return };
        let word = String::from_utf8_lossy(text).to_ascii_uppercase();
        let before = &self.scan.words[2];
        if before == own && self.module.is_empty() {
            word.clone_into(&mut self.module);
        } else if called.contains(&before.as_str()) {
            self.used.insert(word.clone());
        }
        self.scan.words[2] = word;
    }

    /// Whether the next word is a component, a constant of an ENUM, or the name of an optional argument.
    fn is_part(&self) -> bool {
        let names_argument = self.scan.before == Before::Mark(b'\\') && self.scan.within == Within::Routine;
        names_argument || matches!(self.scan.before, Before::Mark(b'.' | b'#'))
    }

    /// Adds a name to the present statement.
    fn name(&mut self, word: &str) {
        if self.scan.within != Within::Routine {
            return;
        }
        if self.language == Language::Rapid && self.scan.before == Before::Mark(b':') {
            // A label, or the values of a CASE.
            self.rapid_condition();
        }
        let statement = &mut self.scan.statement;
        if statement.first.is_empty() && !statement.is_longer_than_path {
            word.clone_into(&mut statement.first);
        } else if statement.depth == 0 {
            statement.is_longer_than_path = true;
        }
        if !statement.names.iter().any(|known| known == word) {
            statement.names.push(word.to_owned());
        }
    }

    fn number(&mut self, number: &[u8]) {
        let statement = &mut self.scan.statement;
        statement.numbers += 1;
        statement.is_full = number == b"100";
        if statement.depth == 1 && self.scan.before == Before::Mark(b'[') && !statement.is_longer_than_path {
            statement.index = Some(String::from_utf8_lossy(number).into_owned());
        }
    }

    /// Follows the brackets of a statement, and whether it can still be the place to which a value is assigned.
    fn bracket(&mut self, mark: u8) {
        let before = self.scan.before;
        let statement = &mut self.scan.statement;
        match mark {
            b'(' | b'[' | b'{' => {
                if mark == b'(' && before == Before::Word {
                    statement.functions.push(self.scan.words[2].clone());
                }
                statement.is_longer_than_path |= statement.depth == 0 && mark == b'(';
                statement.depth += 1;
            }
            b')' | b']' | b'}' => statement.depth = statement.depth.saturating_sub(1),
            b'.' | b':' | b'\n' | b' ' => {}
            _ if statement.is_longer_than_path => {}
            _ if statement.depth > 0 => statement.index = None,
            _ => statement.is_longer_than_path = true,
        }
    }

    fn rapid_mark(&mut self, mark: u8) {
        match (self.scan.within, mark) {
            (_, b'\n') => {}
            (Within::Header, b')') => {
                self.parameter();
                (self.scan.within, self.scan.statement) = (Within::Routine, Statement::default());
            }
            (Within::Header, b',' | b'|' | b'{') => self.parameter(),
            (Within::Routine, b'=') if self.scan.before == Before::Mark(b':') => {
                let statement = &mut self.scan.statement;
                statement.is_assignment |= statement.depth == 0 && !statement.is_longer_than_path;
                statement.is_longer_than_path = true;
            }
            (Within::Routine, b';') => self.rapid_statement(),
            (Within::Routine, _) => self.bracket(mark),
            (Within::Module, b'=') => {
                if let Some(pending) = &mut self.scan.pending {
                    pending.has_value = true;
                }
            }
            (Within::Module, b';') => {
                if let Some(Pending { name, is_local, what, has_value }) = self.scan.pending.take() {
                    let hash = self.scan.value.finish();
                    // Another module declares the value of a PERS without one.
                    match what {
                        Declared::Persistent { .. } if !has_value && !is_local => drop(self.used.insert(name)),
                        Declared::Persistent { kind, .. } => {
                            self.declare(is_local, &name, Declared::Persistent { kind, value: hash });
                        }
                        what => self.declare(is_local, &name, what),
                    }
                }
            }
            _ => {}
        }
    }

    /// The last word was the name of a parameter.
    fn parameter(&mut self) {
        if self.scan.before == Before::Word {
            let name = self.scan.words[2].clone();
            self.scan.own.insert(name);
        }
    }

    /// Whether the word declares a name or is a word of a declaration: it comes after `PROC`, or `PERS tooldata`.
    fn rapid_word(&mut self, word: &str) -> bool {
        let [first, second, last] = &self.scan.words;
        let is_local = first == "LOCAL";
        let is_routine = self.scan.within == Within::Routine;
        match (second.as_str(), last.as_str()) {
            (_, "MODULE" | "SYSMODULE") => word.clone_into(&mut self.module),
            (before, "PROC") => self.begin_routine(before == "LOCAL", word, Within::Header),
            (before, "TRAP") => self.begin_routine(before == "LOCAL", word, Within::Routine),
            ("FUNC", _) => self.begin_routine(is_local, word, Within::Header),
            (before, "RECORD") => {
                self.declare(before == "LOCAL", word, Declared::Type);
                self.scan.within = Within::Record;
            }
            ("ALIAS", _) => self.declare(is_local, word, Declared::Type),
            ("PERS" | "CONST" | "VAR", _) if is_routine => drop(self.scan.own.insert(word.to_owned())),
            ("PERS" | "CONST" | "VAR", kind) if self.scan.within == Within::Module => {
                let is_shared = second == "PERS" && first != "TASK";
                let persistent = Declared::Persistent { kind: kind.to_owned(), value: 0 };
                let what = if is_shared { persistent } else { Declared::Data };
                self.scan.value = DefaultHasher::new();
                self.scan.pending = Some(Pending { name: word.to_owned(), is_local, what, has_value: false });
            }
            (_, "FOR") if is_routine => drop(self.scan.own.insert(word.to_owned())),
            _ => match (word, self.scan.within) {
                ("ENDPROC" | "ENDFUNC" | "ENDTRAP", _) => self.end_routine(),
                ("ENDRECORD", _) => self.scan.within = Within::Module,
                // The name of a component, after its type.
                (_, Within::Record) => return self.scan.before == Before::Word && second != "RECORD",
                (
                    "THEN" | "ELSE" | "DO" | "ENDIF" | "ENDFOR" | "ENDWHILE" | "ENDTEST" | "ERROR" | "UNDO"
                    | "BACKWARD" | "DEFAULT" | "CASE",
                    Within::Routine,
                ) => {
                    self.rapid_condition();
                    return true;
                }
                // The word before is a type; the last one before a comma is the name of a parameter.
                (_, Within::Header) => {
                    if self.scan.before == Before::Word {
                        self.used.insert(last.clone());
                    }
                }
                _ => return false,
            },
        }
        true
    }

    fn begin_routine(&mut self, is_local: bool, name: &str, within: Within) {
        self.declare(is_local, name, Declared::Routine);
        let scan = &mut self.scan;
        (scan.within, scan.changes_own, scan.statement) = (within, false, Statement::default());
        scan.own.clear();
        name.clone_into(&mut scan.routine);
    }

    fn end_routine(&mut self) {
        let scan = &mut self.scan;
        if !scan.changes_own {
            self.keeping.insert(std::mem::take(&mut scan.routine));
        }
        (scan.within, scan.statement) = (Within::Module, Statement::default());
        scan.own.clear();
    }

    /// Ends a condition, or the words that begin a block.
    fn rapid_condition(&mut self) {
        let statement = std::mem::take(&mut self.scan.statement);
        self.rapid_functions(&statement);
    }

    fn rapid_functions(&mut self, statement: &Statement) {
        let unknown = statement.functions.iter().filter(|name| !rapid::changes_nothing(name.as_bytes()));
        unknown.for_each(|name| self.give(name, &statement.names));
    }

    /// Ends a statement of RAPID.
    fn rapid_statement(&mut self) {
        let statement = std::mem::take(&mut self.scan.statement);
        self.rapid_functions(&statement);
        let Statement { first, names, is_assignment, .. } = statement;
        match first.as_str() {
            _ if is_assignment => self.change(first, None),
            "VAR" | "PERS" | "CONST" | "RETURN" | "GOTO" | "RAISE" | "RETRY" | "TRYNEXT" | "EXIT" | "CONNECT" => {}
            // A call by a name of the run, or after a condition.
            "" | "IF" => self.give("", &names),
            name if rapid::changes_nothing(name.as_bytes()) => {}
            name => self.give(name, &names[1.min(names.len())..]),
        }
    }

    /// A routine may change these names.
    fn give(&mut self, routine: &str, names: &[String]) {
        for name in names {
            if self.scan.own.contains(name) {
                self.scan.changes_own = true;
            } else if name != routine {
                self.given.entry(routine.to_owned()).or_default().insert(name.clone());
            }
        }
    }

    fn change(&mut self, name: String, index: Option<String>) {
        if self.scan.own.contains(&name) {
            self.scan.changes_own = true;
        } else if !name.starts_with('$') || name == OVERRIDE {
            self.changed.insert(index.map_or(name.clone(), |index| format!("{name}[{index}]")));
        }
    }

    fn krl_mark(&mut self, mark: u8) {
        match mark {
            b'\n' => self.krl_statement(),
            b'=' => {
                let statement = &mut self.scan.statement;
                let is_place = statement.depth == 0 && !statement.is_longer_than_path && !statement.first.is_empty();
                statement.is_assignment |= is_place && self.scan.list.is_none();
                statement.is_longer_than_path = true;
            }
            _ => self.bracket(mark),
        }
    }

    /// Whether the word is a declared name: it comes after `DEF`, `DEFFCT type`, `GLOBAL type`. Other files see the first routine, global
    /// names, and all names of KUKA's own data lists.
    fn krl_word(&mut self, word: &str) -> bool {
        let [first, second, last] = &self.scan.words;
        let is_first = matches!(self.scan.before, Before::Nothing | Before::Mark(b'\n'));
        let is_global = match (second.as_str(), last.as_str()) {
            (global, "DEF") => Some(global == "GLOBAL"),
            ("DEFFCT", _) => Some(first == "GLOBAL"),
            _ => None,
        };
        if let Some(is_global) = is_global.filter(|_| self.scan.before == Before::Word) {
            let is_first = self.module.is_empty();
            if is_first {
                word.clone_into(&mut self.module);
            }
            self.begin_routine(!is_first && !is_global, word, Within::Header);
            return true;
        }
        match (last.as_str(), word) {
            ("DEFDAT", _) => {
                if self.module.is_empty() {
                    word.clone_into(&mut self.module);
                }
                self.scan.within = Within::DataList;
                return true;
            }
            (_, "END" | "ENDFCT") if is_first => self.end_routine(),
            (_, "ENDDAT") if is_first => self.scan.within = Within::Module,
            (_, "DEF" | "DEFFCT" | "INTERRUPT") => self.scan.list = None,
            ("GLOBAL", "DECL") => {}
            (_, "DECL") if is_first => self.scan.list = Some(List { is_global: false, next: ListPart::Type }),
            (_, "GLOBAL") if is_first || last == "DECL" => {
                self.scan.list = Some(List { is_global: true, next: ListPart::Type });
            }
            (_, "STRUC" | "ENUM" | "SIGNAL")
                if is_first || self.scan.list.is_some_and(|l| l.next == ListPart::Type) =>
            {
                let is_global = self.scan.list.is_some_and(|list| list.is_global);
                self.scan.list = Some(List { is_global, next: ListPart::OneName });
            }
            (_, kind) if is_first && krl::is_type(kind.as_bytes()) => {
                self.scan.list = Some(List { is_global: false, next: ListPart::Names });
            }
            // Assignments and calls follow.
            (_, "DO" | "THEN" | "ELSE") => self.scan.statement = self.krl_rest(),
            _ => return self.krl_listed(word),
        }
        true
    }

    /// Whether the word is a name of a list of declarations, or a parameter.
    fn krl_listed(&mut self, word: &str) -> bool {
        let (depth, before) = (self.scan.statement.depth, self.scan.before);
        if self.scan.within == Within::Header {
            if depth == 1 && matches!(before, Before::Mark(b'(' | b',')) {
                self.scan.own.insert(word.to_owned());
            }
            return true;
        }
        let Some(list) = self.scan.list.as_mut().filter(|_| depth == 0) else { return false };
        let is_type = list.next == ListPart::OneName;
        match list.next {
            ListPart::Type if word == "CONST" => return true,
            ListPart::Type => {
                list.next = ListPart::Names;
                return false;
            }
            ListPart::Names if matches!(before, Before::Word | Before::Mark(b',')) => {}
            ListPart::OneName => list.next = ListPart::Rest,
            ListPart::Names | ListPart::Rest => return false,
        }
        let is_global = list.is_global || self.module.starts_with('$');
        if self.scan.within == Within::Routine {
            self.scan.own.insert(word.to_owned());
        } else {
            self.declare(!is_global, word, if is_type { Declared::Type } else { Declared::Data });
        }
        true
    }

    /// Ends a line of KRL.
    fn krl_statement(&mut self) {
        if self.scan.within == Within::Header {
            self.scan.within = Within::Routine;
        }
        self.scan.list = None;
        self.scan.statement = self.krl_rest();
    }

    /// Ends a statement of KRL, and begins another one.
    fn krl_rest(&mut self) -> Statement {
        let statement = std::mem::take(&mut self.scan.statement);
        // What sets it to 100 % leaves what other programs begin with.
        let is_full = statement.is_full && statement.numbers == 1 && statement.names.len() == 1;
        let Statement { first, names, functions, is_assignment, index, has_override, .. } = statement;
        if has_override && first == "BAS" && !is_full {
            self.change(OVERRIDE.to_owned(), None);
        }
        for function in functions {
            match krl::changes(function.as_bytes()) {
                Called::Nothing => {}
                Called::Data(data) => data.iter().for_each(|name| self.change((*name).to_owned(), None)),
                Called::Arguments => self.give(&function, &names),
            }
        }
        match first.as_str() {
            "FOR" => names.into_iter().nth(1).into_iter().for_each(|counter| self.change(counter, None)),
            OVERRIDE if is_full => {}
            _ if is_assignment => self.change(first, index),
            _ => {}
        }
        Statement::default()
    }

    fn declare(&mut self, is_local: bool, name: &str, what: Declared) {
        if is_local {
            self.local.insert(name.to_owned());
        } else {
            self.declared.insert(name.to_owned(), what);
        }
    }
}

/// A token of a module.
#[derive(Hash)]
enum Token<'a> {
    Word(&'a [u8]),
    /// A string that is one word.
    Text {
        text: &'a [u8],
        /// Whether it is only the beginning of a name: something is added to it at run time.
        is_beginning: bool,
    },
    Number(&'a [u8]),
    Mark(u8),
}

/// Tokens of a line outside of comments.
fn tokens_of(bytes: &[u8], language: Language) -> impl Iterator<Item = Token<'_>> {
    let mut at = 0;
    let comment = language.comment();
    let is_word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
    let begins = move |b: u8| b.is_ascii_alphabetic() || (b == b'$' && language == Language::Krl);
    std::iter::from_fn(move || {
        while at < bytes.len() {
            let (start, rest) = (at, &bytes[at..]);
            match bytes[at] {
                b if Some(b) == comment => {
                    at += rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
                }
                b'"' => {
                    let (start, rest) = (start + 1, &rest[1..]);
                    let len = rest.iter().position(|&b| b == b'"').unwrap_or(rest.len());
                    at = start + len + 1;
                    // A text may name a routine: `%"Part_1"%` calls it, and so does `%"Module:Part_1"%`.
                    let text = bytes[start..start + len].rsplit(|&b| b == b':').next().unwrap_or_default();
                    if text.first().is_some_and(u8::is_ascii_alphabetic) && text.iter().all(is_word) {
                        let next = bytes.iter().skip(at).find(|b| !b.is_ascii_whitespace());
                        return Some(Token::Text { text, is_beginning: next == Some(&b'+') });
                    }
                    return Some(Token::Mark(b'"'));
                }
                b if begins(b) => {
                    at += 1 + rest[1..].iter().position(|b| !is_word(b)).unwrap_or(rest.len() - 1);
                    return Some(Token::Word(&bytes[start..at]));
                }
                // The rest of a number or of a word of another alphabet.
                b if b.is_ascii_digit() => {
                    at += rest.iter().position(|b| !b.is_ascii_alphanumeric()).unwrap_or(rest.len());
                    return Some(Token::Number(&bytes[start..at]));
                }
                b => {
                    at += 1;
                    if !b.is_ascii_whitespace() {
                        return Some(Token::Mark(b));
                    }
                }
            }
        }
        None
    })
}
