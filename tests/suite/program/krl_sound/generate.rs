//! Random KRL programs: two modules with their data lists.

use std::fmt::Write;

/// Names and texts of the files, in pairs of `.src` and `.dat`.
pub(super) fn program(seed: u64) -> Vec<(String, String)> {
    let mut g = Generator {
        random: seed.wrapping_mul(0x2545_F491_4F6C_DD1D) ^ 0x5851_F42D,
        out: String::new(),
        has: 0,
        room: 0,
        in_main: true,
        labels: 0,
    };
    g.has = g.bits() & g.bits();
    g.files()
}

/// What some programs have, and others have not: bits of `has`.
const EXTERNAL: u32 = 0;
const INTERRUPT: u32 = 1;
const TRIGGER: u32 = 2;
const GOTO: u32 = 3;
const UNKNOWN: u32 = 4;
const ODD: u32 = 5;
const DATA: u32 = 6;
const PARTIAL: u32 = 7;
const RELATIVE: u32 = 8;
const FUNCTIONS: u32 = 9;
const WITH: u32 = 10;
const FRAMES: u32 = 11;
const CALLS: u32 = 12;
const LOOPS: u32 = 13;
const BRANCHES: u32 = 14;
const RECURSION: u32 = 15;
const RESUME: u32 = 16;
const OWN: u32 = 17;
const TABLES: u32 = 18;
const SPLINES: u32 = 19;

struct Generator {
    random: u64,
    out: String,
    has: u64,
    /// Statements left.
    room: i32,
    in_main: bool,
    labels: u32,
}

impl Generator {
    fn bits(&mut self) -> u64 {
        // SplitMix64 (Steele, Lea, Flood 2014).
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.random ^ (self.random >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    fn has(&self, what: u32) -> bool {
        self.has >> what & 1 == 1
    }

    fn pick<'s>(&mut self, of: &[&'s str]) -> &'s str {
        of[self.below(of.len() as u64) as usize]
    }

    fn line(&mut self, text: &str) {
        self.out += text;
        self.out += "\n";
    }

    fn number(&mut self) -> String {
        let thousandths = self.below(400_000) as i64 - 200_000;
        match self.below(6) {
            0 => format!("{}", thousandths / 1000),
            1 => format!("{:.1}", thousandths as f64 / 1e3),
            _ => format!("{:.3}", thousandths as f64 / 1e3),
        }
    }

    fn pose(&mut self) -> String {
        let [x, y, z] = std::array::from_fn(|_| self.number());
        let angle = |g: &mut Self| format!("{:.2}", g.below(12_000) as f64 / 100.0 - 60.0);
        let [a, b, c] = std::array::from_fn(|_| angle(self));
        let e1 = if self.has(EXTERNAL) && self.below(2) == 0 {
            format!(",E1 {}.0", 100 * self.below(4))
        } else {
            String::new()
        };
        let kind = self.pick(&["", "", "E6POS: "]);
        format!("{{{kind}X {x},Y {y},Z {z},A {a},B {b},C {c}{e1}}}")
    }

    fn point(&mut self) -> String {
        match self.below(12) {
            0..=3 => self.pose(),
            4..=7 => format!("XP{}", 1 + self.below(4)),
            8 => format!("gP[{}]", 1 + self.below(3)),
            9 => "gX".into(),
            10 if self.has(OWN) => self.pick(&["lp", "lf"]).into(),
            11 if self.has(OWN) && !self.in_main => "p".into(),
            _ => self.pose(),
        }
    }

    fn frame(&mut self) {
        let n = 1 + self.below(3);
        let mut choices = vec![
            format!("$BASE = BASE_DATA[{n}]"),
            format!("BAS(#BASE,{n})"),
            format!("BAS(#TOOL,{n})"),
            format!("$TOOL=TOOL_DATA[{n}]"),
        ];
        if self.has(FRAMES) {
            choices.extend(
                [
                    "$BASE=fB",
                    "$BASE=$NULLFRAME",
                    "$BASE={X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 5.0}",
                    "$BASE=fB:{X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
                ]
                .map(String::from),
            );
            choices.extend(
                [
                    "BAS(#BASE,n1)", "BAS(#INITMOV,0)", "$BASE.X=50.0", "fB.X=25.0", "fB = XP2", "$IPO_MODE=#TCP",
                    "$IPO_MODE=#BASE",
                ]
                .map(String::from),
            );
            choices.push(format!("FDAT_ACT=FP{}\nBAS(#CP_PARAMS,0.1)", 1 + n % 2));
            choices.push("FDAT_ACT.BASE_NO=2".into());
        }
        if self.has(TABLES) {
            choices.extend(
                ["BASE_DATA[2]=fB", "BASE_DATA[1].Z=5.0", "TOOL_DATA[n1]=fB", "BASE_DATA[3]=$BASE"].map(String::from),
            );
        }
        let at = self.below(choices.len() as u64) as usize;
        let text = choices.swap_remove(at);
        self.line(&text);
    }

    fn motion(&mut self) {
        let point = self.point();
        let kind = self.below(20);
        let text = match kind {
            0 => format!("PTP {point} C_PTP"),
            1 => {
                let via = self.point();
                format!("CIRC {via},{point} C_DIS")
            }
            2 if self.has(PARTIAL) => self.pick(&["LIN {Z 50.0}", "LIN {X 12.5,Y 3.0}", "LIN {A 5.0}"]).into(),
            3 if self.has(PARTIAL) => "LIN {X 1.0,Y 2.0,Z 3.0}".into(),
            4 if self.has(RELATIVE) => "LIN_REL {X 5.0}".into(),
            5 if self.has(RELATIVE) => self
                .pick(&[
                    "PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}",
                    "PTP {A1 5.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0,E1 200.0}",
                ])
                .into(),
            6 if self.has(RELATIVE) => format!("CIRC {},{point}, CA 180", self.pose()),
            7 if self.has(WITH) => format!("SLIN {point} WITH $BASE=SBASE({})", 1 + self.below(3)),
            8 if self.has(WITH) => {
                format!("SLIN {point} WITH $VEL=SVEL_CP(0.5), $TOOL=STOOL2(FP1), $BASE=SBASE(FP2.BASE_NO)")
                    .replace("$VEL=SVEL_CP(0.5), ", "")
            }
            9 if self.has(SPLINES) => {
                let (head, other) = (self.pick(&["SPLINE", "SPLINE WITH $BASE=SBASE(2)"]), self.point());
                format!("{head}\nSPL {point}\nSPL {other}\nENDSPLINE")
            }
            10 if self.has(FRAMES) => format!("LIN fB:{point}"),
            11 if self.has(DATA) => self
                .pick(&[
                    "LIN {X r1,Y 0.0,Z 5.0,A 0.0,B 0.0,C 0.0}",
                    "LIN {X n1,Y 0.0,Z 5.0,A 0.0,B 0.0,C 0.0}",
                    "LIN {X r1,Y r1,Z 5.0,A 0.0,B 0.0,C 0.0}",
                ])
                .into(),
            12 if self.has(LOOPS) => "FOR i=1 TO 3\nLIN gP[i] C_DIS\nENDFOR".into(),
            13 if self.has(OWN) => self
                .pick(&[
                    "lp = XP1\nLIN lp",
                    "lf = XP2\nLIN lf",
                    "lp = gX\nlp.Z = 5.0\nLIN lp",
                    "l1 = 5\nLIN {X l1,Y 0.0,Z 5.0,A 0.0,B 0.0,C 0.0}",
                    "lr = 5.0\nLIN {X lr,Y 0.0,Z 5.0,A 0.0,B 0.0,C 0.0}",
                ])
                .into(),
            _ => format!("LIN {point} C_DIS"),
        };
        self.line(&text);
    }

    fn change(&mut self) {
        let pose = self.pose();
        let text = match self.below(22) {
            0 => "XP1 = XP2".into(),
            1 => "XP1.X = 5.0".into(),
            2 => "XP1.Z = XP1.Z + 5.0".into(),
            3 => format!("XP2 = {pose}"),
            4 => "gP[2] = XP1".into(),
            5 => "gP[n1] = XP1".into(),
            6 => "n1 = 2".into(),
            7 => "n1 = n1 + 1".into(),
            8 => "b1 = FALSE".into(),
            9 => "b1 = NOT b2 OR b1 AND b2".into(),
            10 => "r1 = 12.5".into(),
            11 => "XP3 = {X 5.0}".into(),
            12 => "gN = 3".into(),
            13 => "XP1.X = r1".into(),
            14 => format!("gX = {pose}"),
            15 => "gX.A = -30.0".into(),
            16 => "gP[1].A = -30.0".into(),
            17 => "r1 = XP3.X * 2.0".into(),
            18 => "n1 = gN".into(),
            19 => "XP4 = gX".into(),
            20 => "b2 = XP4.X > 0.0".into(),
            _ => "r1 = n1".into(),
        };
        self.line(&text);
    }

    fn condition(&mut self) -> &'static str {
        self.pick(&[
            "$IN[1]",
            "$IN[2]",
            "b1",
            "NOT b2",
            "n1 == 1",
            "gN < 2",
            "(n1 == 1) AND (gN == 2)",
            "XP1.X > 0.0",
            "b1 OR $IN[3]",
            "b1 OR b2 AND b1",
            "$TIMER[1] > 2.0",
        ])
    }

    fn block(&mut self, depth: u32, in_loop: bool) {
        let count = 1 + self.below(3);
        for _ in 0..count {
            self.statement(depth, in_loop);
        }
    }

    fn statement(&mut self, depth: u32, in_loop: bool) {
        self.room -= 1;
        if self.room < 0 {
            return;
        }
        let deeper = depth < 3;
        match self.below(30) {
            0..=9 => self.motion(),
            10..=12 => self.frame(),
            13 | 14 if self.has(DATA) => self.change(),
            15 | 16 if self.has(BRANCHES) && deeper => {
                let condition = self.condition();
                self.line(&format!("IF {condition} THEN"));
                self.block(depth + 1, in_loop);
                if self.below(2) == 0 {
                    self.line("ELSE");
                    self.block(depth + 1, in_loop);
                }
                self.line("ENDIF");
            }
            17 if self.has(BRANCHES) && deeper => {
                let subject = self.pick(&["n1", "gN", "$TIMER[1]"]);
                self.line(&format!("SWITCH {subject}\nCASE 1"));
                self.block(depth + 1, in_loop);
                self.line("CASE 2,3");
                self.block(depth + 1, in_loop);
                if self.below(2) == 0 {
                    self.line("DEFAULT");
                    self.block(depth + 1, in_loop);
                }
                self.line("ENDSWITCH");
            }
            18 | 19 if self.has(LOOPS) && deeper => {
                let head = self.pick(&[
                    "FOR i=1 TO 2", "FOR i=1 TO n1", "FOR i=3 TO 1 STEP -1", "FOR n1=1 TO 2", "WHILE $IN[4]",
                    "WHILE n1<3", "REPEAT", "LOOP", "WHILE b1",
                ]);
                self.line(head);
                if head.starts_with("FOR i") && self.below(3) == 0 {
                    self.line(if head.contains("n1") { "i = i + 1" } else { "LIN gP[i]" });
                }
                self.block(depth + 1, true);
                match &head[..3] {
                    "FOR" => self.line("ENDFOR"),
                    "WHI" => {
                        if head.contains("n1") || self.below(3) == 0 {
                            self.line("n1 = n1 + 1");
                        }
                        self.line("ENDWHILE");
                    }
                    "REP" => {
                        let until = self.pick(&["$IN[5]", "n1 > 0", "TRUE"]);
                        self.line(&format!("UNTIL {until}"));
                    }
                    _ => self.line("IF $IN[6] THEN\nEXIT\nENDIF\nENDLOOP"),
                }
            }
            20 if in_loop && self.has(LOOPS) => {
                let condition = self.condition();
                self.line(&format!("IF {condition} THEN\nEXIT\nENDIF"));
            }
            21 if self.has(BRANCHES) => {
                let condition = self.condition();
                self.line(&format!("IF {condition} THEN\nRETURN\nENDIF"));
            }
            22 | 23 if self.has(CALLS) => {
                let own = [
                    "s1()", "s2(XP1, 5.0)", "s2(gP[1], r1)", "s2(gX, 2.0)", "s3(2, XP2)", "s3(n1, gX)", "b()",
                    "s4(n1)", "s4(XP3.X)", "s5(XP1, XP1)",
                ];
                let text = if self.in_main { self.pick(&own) } else { self.pick(&["s1()", "s3(1, XP4)", "s4(gN)"]) };
                // No routine calls itself unless that is what is looked for.
                if self.in_main || self.has(RECURSION) {
                    self.line(text);
                }
            }
            24 if self.has(FUNCTIONS) => {
                let text = self.pick(&["r1 = f1(XP1)", "r1 = ABS(XP2.X)", "n1 = f1(gX)", "LIN f2()"]);
                self.line(text);
            }
            25 if self.has(UNKNOWN) => {
                let text = self.pick(&["other()", "other(XP1)", "r1 = n1\nother()"]);
                self.line(text.split('(').next().map_or("", |_| if text.contains("XP1") { "other()" } else { text }));
            }
            26 if self.has(ODD) => self.line("FOOBAR $BASE"),
            27 if self.has(TRIGGER) => self.line("TRIGGER WHEN DISTANCE=0 DELAY=0 DO tr() PRIO=-1"),
            28 if self.has(INTERRUPT) => {
                let text = self.pick(&["INTERRUPT ON 3", "INTERRUPT OFF 3"]);
                self.line(text);
            }
            29 if self.has(GOTO) && depth <= 1 && self.labels > 0 => {
                let label = 1 + self.below(u64::from(self.labels));
                let condition = self.condition();
                self.line(&format!("IF {condition} THEN\nGOTO m{label}\nENDIF"));
            }
            _ => self.motion(),
        }
    }

    fn routine(&mut self, head: &str, data: &str, room: i32) {
        self.line(head);
        self.line("DECL INT i\nDECL INT l1\nDECL REAL lr\nDECL E6POS lp\nDECL FRAME lf");
        if !data.is_empty() {
            self.line(data);
        }
        self.room = room;
        self.labels = if self.has(GOTO) { 2 } else { 0 };
        for label in 1..=self.labels.max(1) {
            self.block(0, false);
            if self.labels > 0 {
                if self.below(4) == 0 {
                    self.line(self.clone_of(label));
                }
                self.line(&format!("m{label}:"));
            }
        }
        while self.room > 0 {
            self.statement(0, false);
        }
        self.line("END");
    }

    /// A way round what follows.
    fn clone_of(&self, label: u32) -> &'static str {
        if label == 1 { "IF $IN[7] THEN\nGOTO m1\nENDIF\nRETURN" } else { "GOTO m2" }
    }

    fn files(mut self) -> Vec<(String, String)> {
        let size = 6 + self.below(14) as i32;
        let main = "DEF a( )";
        let declared =
            if self.has(INTERRUPT) { "INTERRUPT DECL 3 WHEN $IN[9]==TRUE DO isr()\nINTERRUPT ON 3" } else { "" };
        self.routine(main, declared, size);
        self.in_main = false;
        self.routine("DEF s1()", "", 4);
        self.routine("DEF s2(p:OUT, d:IN)", "DECL REAL d", 4);
        let body = self.pick(&[
            "LIN p\np.Z = p.Z + d",
            "p.X = d\nLIN p",
            "gX.Y = 5.0\nLIN p",
            "gP[1] = XP2\nLIN p\nXP1.X = 3.0\nLIN p",
        ]);
        self.out.truncate(self.out.len() - 4);
        self.line(body);
        self.line("END");
        self.routine("DEF s3(n:IN, p:IN)", "DECL INT n", 3);
        self.line("DEF s4(n:IN)\nDECL INT n\nLIN {X n,Y 1.0,Z 2.0,A 0.0,B 0.0,C 0.0}\nEND");
        self.line("DEF s5(p:OUT, q:OUT)\np.X = 7.0\nLIN q\nq.Y = 3.0\nLIN p\nEND");
        let pose = self.pose();
        let body = self.pick(&[
            "RETURN p.X",
            "IF $IN[1] THEN\nRETURN 1.0\nENDIF\nRETURN p.X",
            "gN = 2\nRETURN 1.0",
            "BAS(#BASE,2)\nRETURN 1.0",
            "s1()\nRETURN 1.0",
        ]);
        self.line(&format!("DEFFCT REAL f1(p:IN)\n{body}\nENDFCT\nDEFFCT E6POS f2()\nRETURN {pose}\nENDFCT"));
        if self.has(INTERRUPT) {
            self.line("GLOBAL DEF isr()");
            match self.below(6) {
                0 => self.motion_of_handler(),
                1 => self.frame(),
                2 => self.line("gN = 4\nb1 = FALSE"),
                3 => self.line("s1()"),
                _ => {}
            }
            if self.has(RESUME) {
                self.line("BRAKE\nRESUME");
            }
            self.line("END");
        }
        if self.has(TRIGGER) {
            self.line("GLOBAL DEF tr()");
            let text = self.pick(&["gN = 1", "BAS(#BASE,3)", "gX.X = 99.0", "b1 = TRUE", "WAIT SEC 0.1"]);
            self.line(text);
            self.line("END");
        }
        let a_src = std::mem::take(&mut self.out);
        self.line("DEFDAT a PUBLIC");
        for k in 1..=4 {
            let pose = self.pose();
            self.line(&format!("DECL E6POS XP{k}={pose}"));
        }
        self.line("DECL GLOBAL FRAME gP[3]");
        for k in 1..=3 {
            let pose = self.pose();
            let pose = pose.split(",E1").next().map_or_else(String::new, |p| format!("{}}}", p.trim_end_matches('}')));
            self.line(&format!("gP[{k}]={}", pose.replace("E6POS: ", "")));
        }
        self.line(
            "DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}\nDECL FDAT FP2={TOOL_NO 2,BASE_NO 1,IPO_FRAME #BASE}",
        );
        self.line("DECL FRAME fB={X 15.0,Y 25.0,Z 35.0,A 0.0,B 10.0,C 0.0}\nDECL INT n1=1\nDECL BOOL b1=TRUE\nDECL BOOL b2=FALSE\nDECL REAL r1=40.0\nENDDAT");
        let a_dat = std::mem::take(&mut self.out);
        self.line("DEF b( )");
        self.room = 3;
        for _ in 0..3 {
            let pose = self.pose();
            let text = self.pick(&["LIN gX", "gN = 1", "LIN gP[2]", "BAS(#BASE,1)", "LIN XB1", "gX.X = 8.0"]);
            let text = if self.below(3) == 0 { format!("LIN {pose}") } else { text.into() };
            self.line(&text);
        }
        self.line("END");
        let b_src = std::mem::take(&mut self.out);
        let (one, two) = (self.pose(), self.pose());
        let mut b_dat = format!("DEFDAT b PUBLIC\nDECL GLOBAL E6POS gX={one}\nDECL E6POS XB1={two}\n");
        let _ = writeln!(b_dat, "DECL GLOBAL INT gN=2\nENDDAT");
        [("a.src", a_src), ("a.dat", a_dat), ("b.src", b_src), ("b.dat", b_dat)].map(|(n, t)| (n.to_owned(), t)).into()
    }

    fn motion_of_handler(&mut self) {
        let pose = self.pose();
        let text = self.pick(&["LIN XP1", "LIN gX", "LIN_REL {Z 5.0}", "PTP XP4"]);
        let text = if self.below(3) == 0 { format!("LIN {pose}") } else { text.into() };
        self.line(&text);
    }
}
