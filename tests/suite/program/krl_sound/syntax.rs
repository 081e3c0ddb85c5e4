//! KRL text to lines of words and blocks, written from KUKA's manual.

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Tok {
    Word(String),
    Num(f64),
    Mark(String),
}

pub(super) type Toks = Vec<Tok>;

#[derive(Clone, Debug)]
pub(super) struct Stmt {
    pub(super) line: u32,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug)]
pub(super) enum Kind {
    Plain(Toks),
    If(Toks, Vec<Stmt>, Vec<Stmt>),
    For(String, Toks, Toks, Option<Toks>, Vec<Stmt>),
    While(Toks, Vec<Stmt>),
    Repeat(Vec<Stmt>, Toks),
    Loop(Vec<Stmt>),
    Switch(Toks, Vec<(Toks, Vec<Stmt>)>, Vec<Stmt>),
    Spline(Toks, Vec<Stmt>),
    Label(String),
}

#[derive(Clone, Debug)]
pub(super) struct Routine {
    pub(super) file: usize,
    pub(super) name: String,
    pub(super) params: Vec<(String, bool)>,
    pub(super) data: Vec<(String, String)>,
    pub(super) body: Vec<Stmt>,
    pub(super) is_global: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Data {
    pub(super) ty: String,
    pub(super) name: String,
    pub(super) is_global: bool,
    pub(super) value: Toks,
}

#[derive(Clone, Debug, Default)]
pub(super) struct File {
    pub(super) routines: Vec<Routine>,
    pub(super) data: Vec<Data>,
    /// Elements set in a data list.
    pub(super) values: Vec<Toks>,
}

pub(super) fn words(line: &str) -> Toks {
    let text: Vec<char> = line.split(';').next().unwrap_or_default().to_uppercase().chars().collect();
    let (mut at, mut out) = (0, Vec::new());
    while at < text.len() {
        let c = text[at];
        let from = at;
        if c.is_whitespace() {
            at += 1;
        } else if c.is_ascii_digit() || c == '.' && text.get(at + 1).is_some_and(char::is_ascii_digit) {
            while at < text.len() && (text[at].is_ascii_digit() || text[at] == '.') {
                at += 1;
            }
            out.push(Tok::Num(text[from..at].iter().collect::<String>().parse().unwrap()));
        } else if c == '\'' {
            at += 1 + text[from + 1..].iter().position(|c| *c == '\'').unwrap() + 1;
            let bits: String = text[from + 2..at - 1].iter().collect();
            out.push(Tok::Num(f64::from(u32::from_str_radix(&bits, 2).unwrap())));
        } else if c.is_alphanumeric() || c == '_' || c == '$' {
            while at < text.len() && (text[at].is_alphanumeric() || text[at] == '_' || text[at] == '$') {
                at += 1;
            }
            out.push(Tok::Word(text[from..at].iter().collect()));
        } else {
            let two: String = text[from..(from + 2).min(text.len())].iter().collect();
            let mark = if ["==", "<>", "<=", ">="].contains(&&*two) { two } else { c.to_string() };
            at += mark.len();
            out.push(Tok::Mark(mark));
        }
    }
    out
}

fn is(toks: &[Tok], at: usize, word: &str) -> bool {
    matches!(toks.get(at), Some(Tok::Word(w)) if w == word)
}

fn word(toks: &[Tok], at: usize) -> String {
    if let Some(Tok::Word(w)) = toks.get(at) { w.clone() } else { String::new() }
}

struct Reader {
    lines: Vec<(u32, Toks)>,
    at: usize,
}

pub(super) fn file(text: &str, index: usize) -> File {
    let lines = text.lines().enumerate().map(|(i, line)| (i as u32 + 1, words(line)));
    let mut reader = Reader { lines: lines.filter(|(_, toks)| !toks.is_empty()).collect(), at: 0 };
    let mut out = File::default();
    while let Some((_, toks)) = reader.lines.get(reader.at).cloned() {
        reader.at += 1;
        let from = usize::from(is(&toks, 0, "GLOBAL"));
        if is(&toks, from, "DEF") || is(&toks, from, "DEFFCT") {
            let at = from + if is(&toks, from, "DEFFCT") { 2 } else { 1 };
            let mut params = Vec::new();
            for part in toks[at + 2..].split(|t| *t == Tok::Mark(",".into())).filter(|part| part.len() > 1) {
                params.push((word(part, 0), !is(part, 2, "IN")));
            }
            let mut data = Vec::new();
            let body = reader.block(&["END", "ENDFCT"], &mut data).0;
            let name = word(&toks, at);
            out.routines.push(Routine { file: index, name, params, data, body, is_global: from == 1 });
        } else if is(&toks, 0, "DEFDAT") {
            reader.data(&mut out);
        }
    }
    out
}

impl Reader {
    fn data(&mut self, out: &mut File) {
        while let Some((_, toks)) = self.lines.get(self.at).cloned() {
            self.at += 1;
            if is(&toks, 0, "ENDDAT") {
                return;
            }
            let mut at = 0;
            let mut is_global = false;
            while is(&toks, at, "DECL") || is(&toks, at, "GLOBAL") {
                is_global |= is(&toks, at, "GLOBAL");
                at += 1;
            }
            if at == 0 {
                out.values.push(toks);
                continue;
            }
            let equal = toks.iter().position(|t| *t == Tok::Mark("=".into())).map_or(toks.len(), |at| at + 1);
            let (ty, name) = (word(&toks, at), word(&toks, at + 1));
            out.data.push(Data { ty, name, is_global, value: toks[equal..].to_vec() });
        }
    }

    fn block(&mut self, ends: &[&str], data: &mut Vec<(String, String)>) -> (Vec<Stmt>, Toks) {
        let mut out = Vec::new();
        loop {
            let Some((line, toks)) = self.lines.get(self.at).cloned() else { panic!("no {ends:?}") };
            self.at += 1;
            let first = word(&toks, 0);
            if ends.contains(&&*first) {
                return (out, toks);
            }
            let rest = toks[1..].to_vec();
            let kind = match &*first {
                "DECL" => {
                    data.push((word(&toks, 1), word(&toks, 2)));
                    continue;
                }
                "IF" => {
                    let (then, end) = self.block(&["ELSE", "ENDIF"], data);
                    let otherwise = if is(&end, 0, "ELSE") { self.block(&["ENDIF"], data).0 } else { Vec::new() };
                    Kind::If(rest[..rest.len() - 1].to_vec(), then, otherwise)
                }
                "FOR" => {
                    let at = |word: &str| toks.iter().position(|t| *t == Tok::Word(word.into()));
                    let (to, step) = (at("TO").unwrap(), at("STEP"));
                    let bound = toks[to + 1..step.unwrap_or(toks.len())].to_vec();
                    let step = step.map(|at| toks[at + 1..].to_vec());
                    let body = self.block(&["ENDFOR"], data).0;
                    Kind::For(word(&toks, 1), toks[3..to].to_vec(), bound, step, body)
                }
                "WHILE" => Kind::While(rest, self.block(&["ENDWHILE"], data).0),
                "REPEAT" => {
                    let (body, end) = self.block(&["UNTIL"], data);
                    Kind::Repeat(body, end[1..].to_vec())
                }
                "LOOP" => Kind::Loop(self.block(&["ENDLOOP"], data).0),
                "SPLINE" => {
                    let with = rest.get(1..).unwrap_or_default().to_vec();
                    Kind::Spline(with, self.block(&["ENDSPLINE"], data).0)
                }
                "SWITCH" => {
                    let ends = ["CASE", "DEFAULT", "ENDSWITCH"];
                    let (mut cases, mut otherwise) = (Vec::new(), Vec::new());
                    let mut end = self.block(&ends, data).1;
                    while !is(&end, 0, "ENDSWITCH") {
                        let (body, next) = self.block(&ends, data);
                        if is(&end, 0, "CASE") {
                            cases.push((end[1..].to_vec(), body))
                        } else {
                            otherwise = body
                        }
                        end = next;
                    }
                    Kind::Switch(rest, cases, otherwise)
                }
                _ if toks.len() == 2 && toks[1] == Tok::Mark(":".into()) => Kind::Label(first),
                _ => Kind::Plain(toks),
            };
            out.push(Stmt { line, kind });
        }
    }
}
