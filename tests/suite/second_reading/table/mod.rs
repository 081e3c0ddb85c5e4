//! Constructs of RAPID, a program each: what a correction may do to it is decided by running it.

mod changes;
mod control;
mod frames;
mod plain;
mod shared;

/// A construct in a module with two tools (`t1`, `t2`), three work objects (`w1` to `w3`) and targets `@1` to `@9`.
pub struct Case {
    pub name: &'static str,
    /// Fewest executed motions that are corrected on some inputs; what is known is no reason to leave alone.
    pub least: usize,
    pub data: &'static str,
    pub main: &'static str,
    pub routines: &'static str,
}

const fn case(
    name: &'static str,
    least: usize,
    data: &'static str,
    main: &'static str,
    routines: &'static str,
) -> Case {
    Case { name, least, data, main, routines }
}

pub const PRELUDE: &str = r#"PERS tooldata t1:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];
PERS tooldata t2:=[TRUE,[[70,0,330],[0.9848078,0,0.1736482,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];
PERS wobjdata w1:=[FALSE,TRUE,"",[[1200,100,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata w2:=[FALSE,TRUE,"",[[1150,-200,650],[0.8660254,0,0,0.5]],[[0,0,0],[1,0,0,0]]];
PERS wobjdata w3:=[FALSE,TRUE,"",[[1250,150,550],[0.9238795,0,0,-0.3826834]],[[10,20,0],[1,0,0,0]]];
"#;

const ORIENTATIONS: [&str; 3] = ["0,0,1,0", "0.0871557,0,0.9961947,0", "0,0.1305262,0.9914449,0"];

/// The robtarget that `@digit` stands for.
pub fn target(digit: u32) -> String {
    let (x, y, z) = (20 * digit, 35 * (digit % 4), 100 + 15 * (digit % 3));
    let turn = ORIENTATIONS[digit as usize % 3];
    format!("[[{x},{y},{z}],[{turn}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")
}

impl Case {
    /// The module, an instruction a line.
    pub fn text(&self) -> String {
        let body = format!("{}\nPROC main()\n{}\nENDPROC\n{}\n", self.data, self.main, self.routines);
        module(&body)
    }
}

/// A module with the prelude, `@n` in words, an instruction a line.
pub fn module(body: &str) -> String {
    let mut out = format!("MODULE M\n{PRELUDE}");
    let mut chars = body.chars().peekable();
    while let Some(c) = chars.next() {
        match (c, chars.peek().and_then(|next| next.to_digit(10))) {
            ('@', Some(digit)) => {
                chars.next();
                out.push_str(&target(digit));
            }
            (';', _) => out.push_str(";\n"),
            _ => out.push(c),
        }
    }
    out + "ENDMODULE\n"
}

/// Every construct.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    [plain::CASES, frames::CASES, changes::CASES, shared::CASES, control::CASES].into_iter().flatten()
}
