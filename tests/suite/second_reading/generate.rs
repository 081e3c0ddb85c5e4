//! Random RAPID programs of all the constructs that decide where a motion goes.
//!
//! Each program draws a few of the constructs, so that what they do to what is known does not hide among all the others.

mod statements;

use super::table::{PRELUDE, target};

/// SplitMix64.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x2545_F491_4F6C_DD1D) ^ 0x5851_F42D_4C95_7F2D)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    fn pick<'a>(&mut self, from: &[&'a str]) -> &'a str {
        from[self.below(from.len())]
    }

    fn of(&mut self, from: &[String]) -> String {
        from[self.below(from.len())].clone()
    }
}

/// Constructs that a program may draw.
const CONSTRUCTS: &[&str] = &[
    "frame arrays",
    "frame variables",
    "tool variables",
    "displacement",
    "displacement by targets",
    "branches",
    "loops",
    "unknown loops",
    "while",
    "test",
    "goto",
    "return",
    "procedures",
    "parameters",
    "inout",
    "optional",
    "functions",
    "moving functions",
    "frame functions",
    "target functions",
    "trap",
    "handler",
    "raise",
    "late",
    "callbyvar",
    "setdataval",
    "sync",
    "search",
    "crobt",
    "elsewhere",
    "target variables",
    "target components",
    "named parts",
    "named parts",
    "unknown elements",
    "offs",
    "reltool",
    "arcs",
    "joints",
    "records",
    "hiding",
    "cell names",
    "modules",
    "uncalled",
    "copies",
    "strings",
    "exit",
    "numbers",
    "marks",
    "local data",
    "division",
    "recursion",
];

const SHIFT: &str = "[[40,0,0],[0.9659258,0,0,0.2588190]]";

struct Generator {
    random: Random,
    drawn: Vec<&'static str>,
    out: String,
    /// What is in scope: names of each type.
    numbers: Vec<String>,
    targets: Vec<String>,
    wobjs: Vec<String>,
    tools: Vec<String>,
    /// Which may be assigned.
    own_wobjs: Vec<String>,
    own_tools: Vec<String>,
    own_targets: Vec<String>,
    procedures: Vec<Procedure>,
    /// Procedures from this on may be called: none calls itself.
    from: usize,
    labels: usize,
    left: usize,
    handled: bool,
    counters: usize,
    in_function: bool,
}

#[derive(Clone)]
struct Procedure {
    name: String,
    parameters: Vec<&'static str>,
}

/// A program's modules.
pub fn program(seed: u64) -> Vec<String> {
    let mut random = Random::new(seed);
    let mut drawn = Vec::new();
    for _ in 0..2 + random.below(5) {
        drawn.push(random.pick(CONSTRUCTS));
    }
    let mut generator = Generator {
        random,
        drawn,
        out: String::new(),
        numbers: Vec::new(),
        targets: Vec::new(),
        wobjs: ["w1", "w2", "w3"].map(str::to_owned).to_vec(),
        tools: ["t1", "t1", "t2"].map(str::to_owned).to_vec(),
        own_wobjs: Vec::new(),
        own_tools: Vec::new(),
        own_targets: Vec::new(),
        procedures: Vec::new(),
        from: 0,
        labels: 0,
        left: 0,
        handled: false,
        counters: 0,
        in_function: false,
    };
    generator.modules()
}

const FRAME: [&str; 3] = [
    "[FALSE,TRUE,\"\",[[1200,100,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]",
    "[FALSE,TRUE,\"\",[[1150,-200,650],[0.8660254,0,0,0.5]],[[0,0,0],[1,0,0,0]]]",
    "[FALSE,TRUE,\"\",[[1250,0,600],[0.9238795,0,0,-0.3826834]],[[15,0,5],[1,0,0,0]]]",
];
const TOOL: [&str; 2] = [
    "[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]]",
    "[TRUE,[[70,0,330],[0.9848078,0,0.1736482,0]],[5,[0,0,80],[1,0,0,0],0,0,0]]",
];

impl Generator {
    fn has(&self, construct: &str) -> bool {
        self.drawn.contains(&construct)
    }

    fn line(&mut self, text: &str) {
        self.out.push_str(text);
        self.out.push('\n');
    }

    fn literal(&mut self) -> String {
        target(1 + self.random.below(9) as u32)
    }

    fn modules(&mut self) -> Vec<String> {
        self.line("MODULE M");
        self.out.push_str(PRELUDE);
        self.data();
        let procedures =
            if self.any(&["procedures", "parameters", "inout", "optional", "recursion", "hiding", "modules"]) {
                1 + self.random.below(3)
            } else {
                0
            };
        for i in 0..procedures {
            let mut parameters = Vec::new();
            for (construct, parameter) in [
                ("parameters", "robtarget p"),
                ("parameters", "PERS wobjdata w"),
                ("parameters", "PERS tooldata t"),
                ("parameters", "num k"),
                ("copies", "robtarget p"),
                ("copies", "wobjdata w"),
                ("inout", "INOUT wobjdata v"),
                ("inout", "INOUT robtarget q"),
                ("inout", "INOUT num m"),
                ("optional", "\\switch far"),
                ("optional", "\\num h"),
            ] {
                if self.has(construct) && self.random.one_in(2) && !parameters.contains(&parameter) {
                    // One name once.
                    let name = |p: &str| p.rsplit(' ').next().unwrap_or("").to_owned();
                    if !parameters.iter().any(|known| name(known) == name(parameter)) {
                        parameters.push(parameter);
                    }
                }
            }
            self.procedures.push(Procedure { name: format!("r{i}"), parameters });
        }
        self.main();
        for i in 0..procedures {
            self.procedure(i);
        }
        self.fixed_routines();
        self.line("ENDMODULE");
        let mut modules = vec![std::mem::take(&mut self.out)];
        if self.has("modules") {
            // Names of its own, and some that hide the first module's.
            let (a, b) = (self.literal(), self.literal());
            let other = format!(
                "MODULE N\nLOCAL PERS wobjdata w1:={};\nLOCAL CONST robtarget p1:={a};\nCONST robtarget pN:={b};\n\
                 PROC rN()\nMoveL p1,v50,fine,t1\\WObj:=w1;\nENDPROC\n\
                 LOCAL PROC r0()\nMoveL pN,v50,fine,t1\\WObj:=w2;\nENDPROC\nENDMODULE\n",
                FRAME[2]
            );
            modules.push(other);
        }
        modules
    }

    fn any(&self, constructs: &[&str]) -> bool {
        constructs.iter().any(|c| self.has(c))
    }

    fn data(&mut self) {
        for i in 1..=4 {
            let (storage, literal) = (self.random.pick(&["CONST", "CONST", "PERS"]), self.literal());
            self.line(&format!("{storage} robtarget p{i}:={literal};"));
            self.targets.push(format!("p{i}"));
        }
        let all: Vec<String> = (0..3).map(|_| self.literal()).collect();
        self.line(&format!("CONST robtarget pa{{3}}:=[{}];", all.join(",")));
        self.line("VAR num n1:=1;\nVAR num n2:=2;\nVAR bool b1:=TRUE;\nVAR string s1;\nVAR intnum i1;");
        self.numbers.extend(["n1".to_owned(), "n2".to_owned()]);
        if self.any(&["target variables", "target components", "inout", "search", "crobt", "setdataval"]) {
            for i in 1..=2 {
                let literal = self.literal();
                self.line(&format!("VAR robtarget q{i}:={literal};"));
                self.targets.push(format!("q{i}"));
                self.own_targets.push(format!("q{i}"));
            }
        }
        if self.any(&["frame variables", "inout", "trap", "handler", "setdataval", "frame functions", "goto"]) {
            for (i, frame) in FRAME[..2].iter().enumerate() {
                let storage = self.random.pick(&["VAR", "PERS"]);
                self.line(&format!("{storage} wobjdata wv{i}:={frame};"));
                self.wobjs.push(format!("wv{i}"));
                self.own_wobjs.push(format!("wv{i}"));
            }
        }
        if self.has("cell names") {
            self.line(&format!("VAR wobjdata wCell:={};\nVAR tooldata tCell:={};", FRAME[1], TOOL[1]));
            self.own_wobjs.push("wCell".into());
            self.own_tools.push("tCell".into());
        }
        if self.random.one_in(4) || self.has("cell names") {
            self.wobjs.push("wCell".into());
            self.tools.push("tCell".into());
        }
        if self.any(&["tool variables", "setdataval"]) {
            self.line(&format!("VAR tooldata tv:={};", TOOL[0]));
            self.tools.push("tv".into());
            self.own_tools.push("tv".into());
        }
        if self.any(&["frame arrays", "numbers", "inout"]) {
            self.line(&format!("PERS wobjdata wa{{3}}:=[{}];", FRAME.join(",")));
            self.line(&format!("PERS tooldata ta{{2}}:=[{}];", TOOL.join(",")));
            self.wobjs.extend(["wa{1}", "wa{2}"].map(str::to_owned));
        }
        if self.has("records") {
            let (a, b) = (self.literal(), self.literal());
            self.line(&format!(
                "RECORD pair\nrobtarget a;\nrobtarget b;\nENDRECORD\nCONST pair rc:=[{a},{b}];\nVAR pair rv:=[{b},{a}];"
            ));
            self.targets.extend(["rc.a", "rc.b", "rv.a"].map(str::to_owned));
        }
        if self.has("copies") {
            self.line("CONST robtarget pc:=p1;");
            self.targets.push("pc".into());
        }
        if self.has("named parts") {
            let storage = self.random.pick(&["VAR", "PERS"]);
            self.line(&format!("{storage} extjoint e1:=[9E9,9E9,9E9,9E9,9E9,9E9];\nVAR confdata c1:=[0,0,0,0];"));
            self.line("VAR orient o1:=[0,0,1,0];");
        }
        if self.any(&["displacement", "numbers"]) {
            self.line("VAR pose d1:=[[10,20,0],[1,0,0,0]];");
        }
    }

    fn main(&mut self) {
        let handled = self.any(&["handler", "raise", "search", "division", "sync"]);
        self.line("PROC main()");
        if self.has("local data") {
            self.local_data();
        }
        if self.has("trap") {
            self.line("CONNECT i1 WITH tr;\nISignalDI di9,1,i1;");
        }
        self.left = 5 + self.random.below(14);
        self.handled = handled;
        self.block(0);
        self.move_to();
        if handled {
            self.handler();
        }
        self.line("ENDPROC");
        self.wobjs.retain(|w| w != "wl");
        self.targets.retain(|p| p != "pl");
    }

    fn local_data(&mut self) {
        let literal = self.literal();
        match self.random.below(5) {
            0 => self.line(&format!("VAR wobjdata w1:={};", FRAME[2])),
            1 => self.line(&format!("VAR tooldata t1:={};", TOOL[1])),
            2 => self.line(&format!("VAR robtarget p1:={literal};")),
            3 => self.line(&format!("VAR wobjdata wCell:={};", FRAME[1])),
            _ => {
                self.line(&format!("VAR wobjdata wl:={};", FRAME[1]));
                self.line(&format!("VAR robtarget pl:={literal};"));
                // Only this routine knows them.
                self.wobjs.push("wl".into());
                self.targets.push("pl".into());
            }
        }
    }

    fn handler(&mut self) {
        self.line("ERROR");
        self.handled = false;
        match self.random.below(5) {
            0 => self.change(),
            1 => self.move_to(),
            _ => {}
        }
        let end = if self.in_function {
            "RETURN 2;"
        } else {
            self.random.pick(&["TRYNEXT;", "TRYNEXT;", "RETURN;", "RAISE;"])
        };
        self.line(end);
    }

    fn procedure(&mut self, i: usize) {
        let before = (self.targets.clone(), self.wobjs.clone(), self.tools.clone(), self.numbers.clone());
        let own = (self.own_targets.clone(), self.own_wobjs.clone());
        let Procedure { name, parameters } = self.procedures[i].clone();
        let mut header = String::new();
        for parameter in &parameters {
            let separator = if header.is_empty() || parameter.starts_with('\\') { "" } else { "," };
            header.push_str(separator);
            header.push_str(parameter);
        }
        self.line(&format!("PROC {name}({header})"));
        if self.has("hiding") || self.has("local data") {
            self.local_data();
        }
        for parameter in &parameters {
            match *parameter {
                "robtarget p" => self.targets.extend(["p".to_owned(), "p".to_owned()]),
                "PERS wobjdata w" | "wobjdata w" => self.wobjs.extend(["w".to_owned(), "w".to_owned()]),
                "PERS tooldata t" => self.tools.push("t".into()),
                "num k" => self.numbers.push("k".into()),
                "INOUT wobjdata v" => {
                    self.wobjs.push("v".into());
                    self.own_wobjs.push("v".into());
                }
                "INOUT robtarget q" => {
                    self.targets.push("q".into());
                    self.own_targets.push("q".into());
                }
                "INOUT num m" => self.numbers.push("m".into()),
                _ => {}
            }
        }
        self.from = i + 1;
        let handled = self.any(&["handler", "raise", "division"]) && self.random.one_in(2);
        self.left = 2 + self.random.below(5);
        self.handled = handled;
        for parameter in &parameters {
            if *parameter == "\\switch far" {
                self.line("IF Present(far) THEN");
                self.statement(3);
                self.line("ENDIF");
            } else if *parameter == "\\num h" {
                self.line("IF Present(h) THEN");
                self.line("n1:=h;");
                self.line("ENDIF");
            }
        }
        if self.has("copies") && parameters.contains(&"wobjdata w") && self.random.one_in(2) {
            self.line("w.oframe.trans.x:=30;");
        }
        self.block(1);
        self.move_to();
        if self.has("recursion") && i + 1 == self.procedures.len() {
            self.line("Incr n2;\nIF n2<5 THEN");
            self.call_of(i);
            self.line("ENDIF");
        }
        if handled {
            self.handler();
        }
        self.line("ENDPROC");
        (self.targets, self.wobjs, self.tools, self.numbers) = before;
        (self.own_targets, self.own_wobjs) = own;
        self.from = self.procedures.len();
    }

    fn fixed_routines(&mut self) {
        self.from = self.procedures.len();
        self.in_function = true;
        if self.any(&["functions", "moving functions"]) {
            self.line("FUNC num f1()");
            let handled = self.any(&["raise", "handler"]);
            self.handled = handled;
            if self.has("moving functions") {
                self.move_to();
            }
            match self.random.below(4) {
                0 => {}
                1 => self.line("n2:=2;"),
                _ => self.change(),
            }
            if self.random.one_in(3) {
                self.line("IF di1=1 RETURN 1;");
            }
            if handled {
                self.line("IF di2=1 RAISE 7;");
            }
            self.line("RETURN 2;");
            if handled {
                self.handler();
            }
            self.line("ENDFUNC");
        }
        if self.has("frame functions") {
            self.line("FUNC wobjdata f2()");
            let (a, b) = (self.random.pick(&["w1", "w2"]), self.random.pick(&["w2", "w3"]));
            self.line(&format!("IF di1=1 RETURN {a};"));
            self.line(&format!("RETURN {b};\nENDFUNC"));
        }
        if self.has("named parts") {
            self.line("FUNC extjoint fe()\nRETURN [9E9,9E9,9E9,9E9,9E9,9E9];\nENDFUNC");
        }
        if self.has("target functions") {
            self.line("FUNC robtarget f3(robtarget q)");
            let body = self.random.pick(&[
                "RETURN q;",
                "RETURN Offs(q,0,0,5);",
                "q.trans.z:=q.trans.z+5;\nRETURN q;",
                "IF di1=1 RETURN p1;\nRETURN q;",
            ]);
            self.line(body);
            self.line("ENDFUNC");
        }
        self.in_function = false;
        if self.has("trap") {
            self.line("TRAP tr");
            self.handled = false;
            match self.random.below(4) {
                0 => self.line("SetDO do1,1;"),
                1 => self.move_to(),
                2 => self.line("n1:=3;\nb1:=FALSE;"),
                _ => self.change(),
            }
            self.line("ENDTRAP");
        }
        if self.any(&["late", "callbyvar", "sync"]) {
            for i in 1..=3 {
                self.line(&format!("PROC rv{i}()"));
                match self.random.below(4) {
                    0 => {}
                    1 => self.move_to(),
                    _ => self.change(),
                }
                self.line("ENDPROC");
            }
        }
        if self.has("uncalled") {
            self.line("PROC rService()");
            self.move_to();
            self.change();
            self.move_to();
            self.line("ENDPROC");
        }
    }
}
