//! Statements of generated programs.

use super::super::table::target;
use super::{Generator, Procedure, SHIFT};

impl Generator {
    pub(super) fn block(&mut self, depth: usize) {
        let n = 1 + self.random.below(if depth == 0 { 8 } else { 3 });
        for _ in 0..n {
            self.statement(depth);
        }
    }

    pub(super) fn statement(&mut self, depth: usize) {
        if self.left == 0 {
            return;
        }
        self.left -= 1;
        match self.random.below(10) {
            0..=3 => self.move_to(),
            4 => self.change(),
            _ => self.construct(depth),
        }
    }

    pub(super) fn condition(&mut self) -> String {
        match self.random.below(8) {
            0 => "b1".into(),
            1 => format!("{}=1", self.random.of(&self.numbers.clone())),
            2 if self.any(&["functions", "moving functions"]) && !self.in_function => "f1()=1".into(),
            3 => "di1=1 AND di2=0".into(),
            4 => format!("{}>{}", self.random.of(&self.numbers.clone()), self.random.below(4)),
            _ => "di1=1".into(),
        }
    }

    pub(super) fn body(&mut self, depth: usize) {
        self.statement(depth + 1);
        if self.random.one_in(2) {
            self.statement(depth + 1);
        }
    }

    pub(super) fn construct(&mut self, depth: usize) {
        let construct = self.drawn[self.random.below(self.drawn.len())];
        match construct {
            "branches" | "functions" | "moving functions" if depth < 3 => {
                let condition = self.condition();
                if self.random.one_in(4) {
                    self.line(&format!("IF {condition} n1:=2;"));
                    return;
                }
                self.line(&format!("IF {condition} THEN"));
                self.body(depth);
                if self.random.one_in(2) {
                    self.line("ELSE");
                    self.body(depth);
                }
                self.line("ENDIF");
            }
            "loops" | "frame arrays" | "numbers" if depth < 3 => {
                self.counters += 1;
                let counter = format!("i{}", self.counters + 1);
                let range =
                    self.random.pick(&["1 TO 2", "1 TO 3", "2 TO 1", "1 TO 3 STEP 2", "3 TO 2 STEP 1", "2 TO 2"]);
                self.line(&format!("FOR {counter} FROM {range} DO"));
                self.numbers.push(counter.clone());
                self.numbers.push(counter.clone());
                self.body(depth);
                self.numbers.truncate(self.numbers.len() - 2);
                self.line("ENDFOR");
            }
            "named parts" if depth < 3 => {
                self.counters += 1;
                let (counter, p) = (self.counters + 1, self.literal_of_parts());
                self.line(&format!("FOR i{counter} FROM 1 TO 2 DO\nMoveL {p},v50,fine,t1\\WObj:=w1;"));
                self.change();
                self.line("ENDFOR");
            }
            "unknown loops" if depth < 2 => {
                self.counters += 1;
                let counter = format!("i{}", self.counters + 1);
                self.line(&format!("FOR {counter} FROM 1 TO ReadNum(com1) DO"));
                self.body(depth);
                self.line("ENDFOR");
            }
            "while" if depth < 2 => {
                if self.random.one_in(2) {
                    self.line("WHILE di1=1 DO");
                    self.body(depth);
                } else {
                    self.line("n2:=1;\nWHILE n2<=2 DO");
                    self.body(depth);
                    self.line("n2:=n2+1;\nIF n2<1 EXIT;");
                }
                self.line("ENDWHILE");
            }
            "test" if depth < 3 => {
                let value =
                    if self.random.one_in(2) { "ReadNum(com1)".into() } else { self.random.of(&self.numbers.clone()) };
                self.line(&format!("TEST {value}\nCASE 1:"));
                self.body(depth);
                self.line("CASE 2,3:");
                self.body(depth);
                if self.random.one_in(2) {
                    self.line("DEFAULT:");
                    self.body(depth);
                }
                self.line("ENDTEST");
            }
            "goto" => {
                self.labels += 1;
                let label = format!("l{}", self.labels);
                if self.random.one_in(3) {
                    self.line(&format!("{label}:"));
                    self.body(depth);
                    self.line(&format!("IF di1=1 GOTO {label};"));
                } else {
                    let condition = if self.random.one_in(4) { "TRUE" } else { "di1=1" };
                    self.line(&format!("IF {condition} GOTO {label};"));
                    self.body(depth);
                    self.line(&format!("{label}:"));
                }
            }
            "return" if !self.in_function => self.line("IF di1=1 RETURN;"),
            "exit" => self.line("IF di3=1 EXIT;"),
            "procedures" | "parameters" | "inout" | "optional" | "copies" | "hiding" | "recursion" | "local data" => {
                self.call()
            }
            "modules" if !self.in_function => {
                let call = self.random.pick(&["rN;", "N:rN;", "MoveL pN,v50,fine,t1\\WObj:=w1;"]);
                self.line(call);
            }
            "late" => {
                let call = self.random.pick(&[
                    "%\"rv1\"%;",
                    "%\"rv\"+NumToStr(n1,0)%;",
                    "%\"rv\"+NumToStr(ReadNum(com1),0)%;",
                    "s1:=\"rv2\";\n%s1%;",
                ]);
                self.line(call);
            }
            "callbyvar" => {
                let number = self.random.pick(&["1", "n1", "ReadNum(com1)"]);
                self.line(&format!("CallByVar \"rv\",{number};"));
            }
            "sync" => {
                let (t, w) = (self.random.of(&self.tools.clone()), self.random.of(&self.wobjs.clone()));
                let p = self.destination();
                self.line(&format!("MoveLSync {p},v50,fine,{t}\\WObj:={w},\"rv{}\";", 1 + self.random.0 as usize % 3));
            }
            "setdataval" => {
                let line = match self.random.below(5) {
                    0 => "SetDataVal \"q1\",p2;".to_owned(),
                    1 => "SetDataVal \"wv0\",w3;".into(),
                    2 => "SetDataVal \"tv\",t2;".into(),
                    3 => "GetDataVal \"w2\",wv1;".into(),
                    _ => "SetAllDataVal \"wobjdata\",w2;".into(),
                };
                self.line(&line);
            }
            "search" => {
                let (t, w) = (self.random.of(&self.tools.clone()), self.random.of(&self.wobjs.clone()));
                let p = self.destination();
                self.line(&format!("SearchL di5,q1,{p},v20,{t}\\WObj:={w};"));
            }
            "crobt" => self.line("q2:=CRobT(\\Tool:=t1\\WObj:=w1);"),
            "elsewhere" => {
                let mut calls =
                    vec!["rElsewhere;".to_owned(), "rProbe p1;".into(), "Special p2,v50,fine,t1\\WObj:=w2;".into()];
                calls.push(format!("rAt {};", self.literal()));
                calls.extend(self.own_wobjs.iter().map(|w| format!("rMeasure {w};")));
                calls.push("n1:=fElsewhere(n2);".into());
                let call = self.random.of(&calls);
                self.line(&call);
            }
            "raise" | "handler" if self.handled => {
                let line = self.random.pick(&["IF di6=1 RAISE 5;", "RAISE 5;", "WaitDI di7,1\\MaxTime:=2;"]);
                self.line(line);
            }
            "division" if self.handled => {
                let line = self.random.pick(&["n2:=4/(n1-1);", "n2:=4/n1;", "IF 4/n1>1 SetDO do2,1;", "n2:=4 DIV n1;"]);
                self.line(line);
                if self.random.one_in(4) {
                    let (first, second) = (self.random.pick(&["1", "2"]), self.random.pick(&["1", "2"]));
                    self.line(&format!("IF 4/n1>{first} THEN"));
                    self.change();
                    self.line("ELSE");
                    self.change();
                    self.line("ENDIF");
                    self.line(&format!("TEST 4 DIV n1\nCASE {second}:"));
                    self.change();
                    self.line("DEFAULT:");
                    self.change();
                    self.line("ENDTEST");
                }
            }
            "strings" => {
                self.line("s1:=\"a\";\nIF di1=1 s1:=s1+\"b\";\nIF s1=\"ab\" THEN");
                self.body(depth);
                self.line("ENDIF");
            }
            "marks" => {
                let mark = self.random.pick(&["! deflex air", "! a comment"]);
                self.line(mark);
            }
            _ => self.change(),
        }
    }

    pub(super) fn call(&mut self) {
        if self.from >= self.procedures.len() {
            return self.change();
        }
        let i = self.from + self.random.below(self.procedures.len() - self.from);
        self.call_of(i);
    }

    pub(super) fn call_of(&mut self, i: usize) {
        let Procedure { name, parameters } = self.procedures[i].clone();
        let (mut args, mut options) = (Vec::new(), String::new());
        for parameter in parameters {
            match parameter {
                "robtarget p" => {
                    let p = self.destination();
                    args.push(p);
                }
                "PERS wobjdata w" | "wobjdata w" => args.push(self.random.of(&self.wobjs.clone())),
                "PERS tooldata t" => args.push(self.random.of(&self.tools.clone())),
                "num k" if self.handled && self.random.one_in(3) => args.push("4 DIV n1".to_owned()),
                "num k" => args.push(self.random.pick(&["1", "2", "n1"]).to_owned()),
                "INOUT wobjdata v" => {
                    let w = if self.random.one_in(4) {
                        "wa{2}".to_owned()
                    } else {
                        self.random.of(&self.own_wobjs.clone())
                    };
                    args.push(w);
                }
                "INOUT robtarget q" => args.push(self.random.of(&self.own_targets.clone())),
                "INOUT num m" => {
                    let m = self.random.pick(&["n1", "n2", "q1.trans.z", "wv0.oframe.trans.x"]);
                    args.push(m.to_owned());
                }
                "\\switch far" if self.random.one_in(2) => options.push_str("\\far"),
                "\\num h" if self.random.one_in(2) => options.push_str("\\h:=2"),
                _ => {}
            }
        }
        self.line(&format!("{name} {}{options};", args.join(",")));
    }

    /// Something that a later motion's frames or target depend on.
    pub(super) fn change(&mut self) {
        let mut options: Vec<String> = Vec::new();
        for w in self.own_wobjs.clone() {
            options.push(format!("{w}:=w2;"));
            options.push(format!("{w}:=w3;"));
            options.push(format!("{w}.oframe.trans.x:=35;"));
            options.push(format!("{w}.oframe.trans.x:=15*ReadNum(com1);"));
            options.push(format!("{w}.uframe.rot:=OrientZYX(20,0,0);"));
            options.push(format!("Add {w}.uframe.trans.y,10;"));
            if self.has("frame functions") {
                options.push(format!("{w}:=f2();"));
            }
            if self.has("frame arrays") {
                options.push(format!("{w}:=wa{{n1}};"));
            }
        }
        for t in self.own_tools.clone() {
            options.push(format!("{t}:=t2;"));
            options.push(format!("{t}.tframe.trans.z:=60*ReadNum(com1);"));
        }
        for q in self.own_targets.clone() {
            options.push(format!("{q}:=p2;"));
            options.push(format!("{q}.trans.z:=120;"));
            options.push(format!("{q}.trans.x:=10*ReadNum(com1);"));
            options.push(format!("{q}:=Offs(p1,0,0,7);"));
            if self.has("target functions") {
                options.push(format!("{q}:=f3(p3);"));
            }
        }
        if self.any(&[
            "displacement", "branches", "loops", "goto", "handler", "trap", "late", "callbyvar", "sync", "functions",
            "return",
        ]) {
            options.push(format!("PDispSet {SHIFT};"));
            options.push("PDispOff;".into());
            options.push("PDispOff;".into());
        }
        if self.has("displacement") {
            options.push("PDispSet d1;".into());
            options.push("d1.trans.x:=20*ReadNum(com1);".into());
            options.push("d1.rot:=OrientZYX(15,0,0);".into());
        }
        if self.has("displacement by targets") {
            options.push("PDispOn\\ExeP:=p3,p2,t1\\WObj:=w1;".into());
            options.push("PDispOn\\Rot\\ExeP:=p1,p4,t1\\WObj:=w1;".into());
            options.push("PDispOff;".into());
        }
        if self.has("frame arrays") {
            options.push("wa{2}:=w3;".into());
            options.push("wa{n1}.oframe.trans.z:=12;".into());
        }
        if self.has("records") {
            options.push("rv:=rc;".into());
            options.push("rv.a:=p2;".into());
        }
        if self.has("named parts") {
            options.push("c1:=[0,0,0,0];".into());
            options.push("c1.cf6:=n1;".into());
            options.push("e1:=fe();".into());
            options.push(format!("e1:=fe();\nPDispSet {SHIFT};"));
            options.push("o1:=[0,0,1,0];".into());
            options.push("o1:=OrientZYX(0,0,170);".into());
        }
        options.push("n1:=2;".into());
        options.push("n1:=ReadNum(com1);".into());
        options.push("Incr n1;\nIF n1>3 n1:=1;".into());
        options.push("b1:=FALSE;".into());
        if self.any(&["functions", "moving functions"]) && !self.in_function {
            options.push("n2:=f1();".into());
        }
        let line = self.random.of(&options);
        self.line(&line);
    }

    pub(super) fn destination(&mut self) -> String {
        let plain = match self.random.below(10) {
            0 | 1 if self.has("named parts") => self.literal_of_parts(),
            0 | 1 => self.literal(),
            2 | 3 => format!("pa{{{}}}", 1 + self.random.below(3)),
            4 if self.any(&["loops", "frame arrays", "numbers", "parameters"]) => {
                let n = self.random.of(&self.numbers.clone());
                format!("pa{{{n}}}")
            }
            5 if self.has("unknown elements") => "pa{ReadNum(com1)}".into(),
            6 if self.has("target functions") && !self.in_function => "f3(p1)".into(),
            _ => self.random.of(&self.targets.clone()),
        };
        match self.random.below(8) {
            0 if self.any(&["offs", "loops", "numbers", "copies", "inout"]) => {
                let z = self.random.pick(&["0,0,20", "10,0,0", "n1,0,0", "0,0,5*n2", "0,5,0"]);
                format!("Offs({plain},{z})")
            }
            1 if self.has("reltool") => {
                let z = self.random.pick(&["0,0,-20", "5,0,0", "0,0,-5\\Rz:=10", "0,0,-n1", "0,0,0\\Rx:=3"]);
                format!("RelTool({plain},{z})")
            }
            2 if self.has("target components") => {
                format!(
                    "[[{},35,110],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
                    self.random.pick(&["10*n1", "20+5", "p1.trans.x", "q1.trans.y"])
                )
            }
            _ => plain,
        }
    }

    /// As post processors write them: configuration, external axes and now and then the orientation by name.
    fn literal_of_parts(&mut self) -> String {
        let (external, configuration) = ("[9E9,9E9,9E9,9E9,9E9,9E9]", "[0,0,0,0]");
        let literal = self.literal();
        match self.random.below(5) {
            0 => literal,
            1 => literal.replace(configuration, "c1"),
            2 => literal.replace("[0,0,1,0]", "o1").replace(external, "e1"),
            3 => literal.replace(external, "e1"),
            _ => literal.replace(configuration, "c1").replace(external, "e1"),
        }
    }

    pub(super) fn move_to(&mut self) {
        let mut w = self.random.of(&self.wobjs.clone());
        let mut t = self.random.of(&self.tools.clone());
        if self.has("frame arrays") && self.random.one_in(3) {
            let n = self.random.of(&self.numbers.clone());
            w = format!("wa{{{n}}}");
            if self.random.one_in(4) {
                t = format!("ta{{{}}}", self.random.pick(&["1", "2", "n2"]));
            }
        }
        if self.has("frame functions") && self.random.one_in(6) && !self.in_function {
            w = "f2()".into();
        }
        if self.random.one_in(2) {
            // Much of a program runs in one frame.
            (w, t) = ("w1".into(), "t1".into());
        }
        let p = self.destination();
        if self.has("joints") && self.random.one_in(3) {
            return self.line(&format!("MoveJ {p},v50,fine,{t}\\WObj:={w};"));
        }
        if self.has("arcs") && self.random.one_in(3) {
            let (a, b) = (self.random.pick(&["2", "3"]), self.random.pick(&["4", "5"]));
            let via = if self.random.one_in(2) { "p2".to_owned() } else { target(a.parse().unwrap_or(2)) };
            let to = if self.random.one_in(2) { "p4".to_owned() } else { target(b.parse().unwrap_or(4)) };
            return self.line(&format!(
                "MoveL {},v50,fine,t1\\WObj:=w1;\nMoveC {via},{to},v50,fine,{t}\\WObj:={w};",
                target(1)
            ));
        }
        self.line(&format!("MoveL {p},v50,fine,{t}\\WObj:={w};"));
    }
}
