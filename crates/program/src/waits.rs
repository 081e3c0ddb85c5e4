//! Statements at which a program waits between two motions.

use crate::Program;
use nom::number::complete::double;
use std::ops::Range;

/// Words between two motions after which the second may not follow the first, and `CONTINUE`, with which KRL does not wait.
const BRANCHES: [&str; 21] = [
    "IF", "ELSE", "ELIF", "ELSEIF", "ENDIF", "TEST", "CASE", "SWITCH", "SELECT", "FOR", "ENDFOR", "WHILE", "ENDWHILE",
    "LOOP", "REPEAT", "GOTO", "JMP", "JUMP", "ENDPROC", "END", "CONTINUE",
];

/// What a program waits for between two motions. The arm stands still meanwhile: the controller cannot round the corner before it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Wait {
    /// The word of the first statement that waits.
    pub word: &'static str,
    /// Sum of the times that the text states as numbers, s.
    pub seconds: f64,
}

impl Program {
    /// How the program waits between two targets; `None` if it does not, or if the second target may not follow the first.
    #[must_use]
    #[doc(hidden)]
    pub fn waits_between(&self, target: usize, next: usize) -> Option<Wait> {
        let (before, after) = (self.targets.get(target)?, self.targets.get(next)?);
        if before.source != after.source {
            return None;
        }
        self.waits_in(before.source, before.span.range().end..after.span.range().start)
    }

    /// The same between the start of a chunk, whose own text begins there, and its first target.
    #[must_use]
    #[doc(hidden)]
    pub fn waits_before(&self, target: usize, from: usize) -> Option<Wait> {
        let target = self.targets.get(target)?;
        self.waits_in(target.source, from..target.span.range().start)
    }

    fn waits_in(&self, source: u16, span: Range<usize>) -> Option<Wait> {
        let text = self.sources[usize::from(source)].bytes.get(span)?;
        let (comment, about) = (self.language.comment(), self.language.about());
        let code = text
            .split(|byte| *byte == b'\n')
            .map(|line| line.split(|byte| Some(*byte) == comment).next().unwrap_or(line));
        let mut found: Option<Wait> = None;
        for mut rest in code {
            while let Some((word, after)) = next_word(rest) {
                rest = after;
                let is = |known: &&&str| word.eq_ignore_ascii_case(known.as_bytes());
                if BRANCHES.iter().any(|known| is(&known)) {
                    return None;
                }
                let stated = is(&&about.dwell.word).then(|| seconds(after, about.dwell.before_number)).flatten();
                let waits = about.waits.iter().find(is).copied().or(stated.map(|_| about.dwell.word));
                if let Some(word) = waits {
                    found.get_or_insert(Wait { word, seconds: 0.0 }).seconds += stated.unwrap_or(0.0);
                    // What the statement waits for is no statement of its own (`WAIT FOR`).
                    let ends = after.iter().position(|byte| *byte == b';');
                    rest = ends.map_or(&[][..], |end| &after[end..]);
                }
            }
        }
        found
    }
}

/// The next word of a line, and the line after it.
fn next_word(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let is_of_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let line = &line[line.iter().position(is_of_word)?..];
    Some(line.split_at(line.iter().position(|byte| !is_of_word(byte)).unwrap_or(line.len())))
}

/// The number of seconds that the line after the first word of a statement states, if it is not an expression.
fn seconds(line: &[u8], before_number: Option<&str>) -> Option<f64> {
    let known = |word: &[u8]| before_number.is_some_and(|known| word.eq_ignore_ascii_case(known.as_bytes()));
    let line = next_word(line).filter(|(word, _)| known(word)).map_or(line, |(_, after)| after);
    let is_sign = |byte: &u8| b" \t\\=,/(".contains(byte);
    let line = &line[line.iter().position(|byte| !is_sign(byte))?..];
    let (after, seconds) = double::<_, nom::error::Error<&[u8]>>(line).ok()?;
    // `(sec)` is the unit of FANUC TP.
    let is_whole = after.trim_ascii_start().first().is_none_or(|byte| b";)(".contains(byte));
    Some(seconds).filter(|seconds| is_whole && seconds.is_finite() && *seconds > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, cl, detect, read};
    use deflex_text::Source;

    /// A program of two motions in each language, with `?` between them.
    const PROGRAMS: [(&str, &str); 5] = [
        (
            "a.mod",
            "MODULE a\nPROC main()\nMoveL [[1,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;\n?\nMoveL \
             [[2,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;\nENDPROC\nENDMODULE\n",
        ),
        (
            "a.src",
            "DEF a ( )\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.05\nLIN {X 1,Y 0,Z 0,A 0,B 0,C 0} C_DIS\n?\n\
             LIN {X 2,Y 0,Z 0,A 0,B 0,C 0}\nEND\n",
        ),
        (
            "a.ls",
            "/PROG A\n/ATTR\n/MN\n   1:L P[1] 50mm/sec CNT100 ;\n   2:  ? ;\n   3:L P[2] 50mm/sec FINE ;\n/POS\n\
             P[1]{ GP1: UF : 1, UT : 1, X = 1 mm, Y = 0 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg };\n\
             P[2]{ GP1: UF : 1, UT : 1, X = 2 mm, Y = 0 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg };\n/END\n",
        ),
        (
            "a.script",
            "def a():\n  movel(p[0.1,0,0,0,0,0],v=0.05,r=0.001)\n  ?\n  movel(p[0.2,0,0,0,0,0],v=0.05)\nend\n",
        ),
        ("a.cls", "UNITS/MM\nFEDRAT/100,MMPM\nGOTO/1,0,0,0,0,1\n?\nGOTO/2,0,0,0,0,1\nFINI\n"),
    ];

    /// The wait that a statement is between the motions of the program with this name.
    fn wait(name: &str, statement: &str) -> Option<Wait> {
        let (_, text) = PROGRAMS.iter().find(|(known, _)| *known == name).expect("a program");
        let text = text.replace('?', statement);
        let language = detect(name, text.as_bytes()).expect("a language");
        let options = ReadOptions { cl: &cl::ClOptions::default(), look: false };
        let program = read(language, vec![Source::new(name, text)], vec![], &options);
        let program = program.unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
        assert_eq!(program.targets.len(), 2, "{name}");
        program.waits_between(0, 1)
    }

    #[test]
    fn the_time_of_a_wait_is_read() {
        for (name, statement, word, seconds) in [
            ("a.mod", "WaitTime 1.5;", "WAITTIME", 1.5),
            ("a.mod", "WaitTime\\InPos,0.5;", "WAITTIME", 0.5),
            ("a.mod", "WaitTime 0.5; WaitTime 5E-1; ! WaitTime 3;", "WAITTIME", 1.0),
            ("a.mod", "WaitTime 0.5+0.1*0;", "WAITTIME", 0.0),
            ("a.mod", "WaitDI di1,1;", "WAITDI", 0.0),
            ("a.src", "WAIT SEC 0.25", "WAIT", 0.25),
            ("a.src", "WAIT FOR $IN[1]", "WAIT", 0.0),
            ("a.ls", "WAIT   1.50(sec)", "WAIT", 1.5),
            ("a.script", "sleep(0.4)", "sleep", 0.4),
            ("a.cls", "DELAY/2", "DELAY", 2.0),
        ] {
            assert_eq!(wait(name, statement), Some(Wait { word, seconds }), "{statement}");
        }
    }

    #[test]
    fn a_wait_of_unknown_time_stops_only_controllers_whose_manuals_say_so() {
        assert_eq!(wait("a.ls", "WAIT DI[1]=ON"), None);
        assert_eq!(wait("a.mod", "IF di1=1 WaitTime 1;"), None);
    }
}
