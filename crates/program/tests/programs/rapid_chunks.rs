//! Compares the reader of chunks that reads RAPID by kinds of lines with the full reader. Any module of context makes a chunk read by the
//! full reader, here a module that declares nothing.

use deflex_program::rapid::{Chunks, Declared};
use deflex_program::{ChunkReader, Next, StreamableChunk};
use deflex_text::Source;
use proptest::prelude::*;
use std::io::Cursor;
use std::sync::Arc;

const HEAD: &str = "MODULE M\n  PERS tooldata tA:=[TRUE,[[0,0,300],[1,0,0,0]],[8,[0,0,100],[1,0,0,0],0,0,0]];\n  \
                    PERS tooldata tB:=[TRUE,[[0,0,200],[1,0,0,0]],[8,[0,0,100],[1,0,0,0],0,0,0]];\n  PROC main()\n";

/// A statement, a comment or an empty line.
fn line() -> impl Strategy<Value = String> {
    let word = prop::sample::select(vec!["MoveL", "moveJ", "MoveL ", "  MoveL"]);
    let end = prop::sample::select(vec![
        ",v50,z1,tA;",
        ",v50,z1,tB;",
        ",v200,fine,tA\\WObj:=wobj0;",
        ",[30,500,5000,1000],z1,TA;",
        ", v50 , z1 , tA ;",
        ",v50,z1,tA;MoveL p,v50,z1,tA;",
        ",v50,z1,tC;",
        "\\ID:=3,v50,z1,tA;",
    ]);
    let number = prop_oneof![Just("0".to_owned()), Just("+1.".to_owned()), "-?[0-9]{1,4}\\.[0-9]{0,8}"];
    let quat = prop::sample::select(vec!["1,0,0,0", "0.7071,0,0.7071,0", "0,0.6,-0.8,0", "1,1,0,0", "1,0,0"]);
    let external = prop::sample::select(vec![
        "9E9,9E9,9E9,9E9,9E9,9E9",
        "9E9, 9E+09,9E9,9E9,9E9,9E9",
        "0,9E9,9E9,9E9,9E9,9E9",
        "12.5,-3,9E9,9E9,9E9,9E9",
    ]);
    // Elements that make a program unstreamable are rare, or no generated program would be streamable.
    let motion = (word, number.clone(), number, quat, external, end).prop_map(|(word, x, y, quat, external, end)| {
        format!("{word} [[{x},{y},1],[{quat}],[0,0,0,0],[{external}]]{end}")
    });
    prop_oneof![
        12 => motion,
        1 => Just("  ! deflex air".to_owned()),
        1 => Just("! deflex cut".to_owned()),
        1 => Just("! a comment; MoveL".to_owned()),
        1 => Just(String::new()),
        1 => Just("  ConfL\\Off;".to_owned()),
        1 => Just("SetDO do1,1;".to_owned()),
        1 => Just("MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tA;".to_owned()),
    ]
}

/// Lines that differ in their pose, mostly, or in anything that a sample has to notice.
fn common() -> impl Strategy<Value = String> {
    let often = |common: &'static str, others: &[&'static str]| prop_oneof![12 => Just(common), 1 => prop::sample::select(others.to_vec())];
    let number = prop_oneof![
        8 => "-?[0-9]{1,4}\\.[0-9]{1,8}",
        1 => prop::sample::select(vec!["0", "+1.5", "-0.0", "12.", ".5", "1.5E2", "- 3", "9E9", "1.123456789012345"])
            .prop_map(str::to_owned),
    ];
    let quat = prop::sample::select(vec!["0,1,0,0", "0.7071,0,0.7071,0", "0,0.60,-0.80,0", "0 , 1, 0,0", "0,0,-1.0,0"]);
    (
        often("  ", &["", "\t", "   "]),
        (number, often(",", &[", ", " ,"]), quat, often("],[", &["] ,[", "], ["])),
        often("0,-1,0,1", &["0,-1,0,0", "0,-1,0,1 ", "0,-1.0,0,1"]),
        often(
            "9E9,9E9,9E9,9E9,9E9,9E9",
            &["9E+09,9E9,9E9,9E9,9E9,9E9", "0,9E9,9E9,9E9,9E9,9E9", "1,9E9,9E9,9E9,9E9,9E9"],
        ),
        often(
            ",v50,z1,tA;",
            &[",v200,z1,tB;", ",v50,fine,tA\\WObj:=wobj0;", ",v50,z1,tA; ", ",v50,z1,tA;\t", ",v50,z10,tA;"],
        ),
    )
        .prop_map(|(indent, (x, comma, quat, joint), conf, external, end)| {
            format!("{indent}MoveL [[{x}{comma}0,1{joint}{quat}{joint}{conf}],[{external}]]{end}")
        })
}

/// Lines that differ in digits alone, mostly.
fn alike() -> impl Strategy<Value = Vec<String>> {
    let other =
        prop_oneof![30 => Just(None), 1 => (0..120_usize, prop::sample::select(b"0159 -.,[]".to_vec())).prop_map(Some)];
    (common(), prop::collection::vec((any::<u32>(), other), 1..40)).prop_map(|(line, others)| {
        let start = line.find("[[").map_or(0, |at| at + 2);
        let end = start + line[start..].find([',', ' ']).unwrap_or(0);
        let like = |(mut digits, other): (u32, Option<(usize, u8)>)| {
            let mut bytes = line.clone().into_bytes();
            for byte in bytes[start..end].iter_mut().filter(|byte| byte.is_ascii_digit()) {
                *byte = b'0' + (digits % 10) as u8;
                digits = digits.rotate_left(7) / 3;
            }
            if let Some((at, byte)) = other {
                bytes[at % line.len()] = byte;
            }
            String::from_utf8(bytes).unwrap()
        };
        others.into_iter().map(like).collect()
    })
}

/// A program that declares these names, moves to each of them, and has others as well.
fn declared() -> impl Strategy<Value = String> {
    let often = |common: &'static str, others: &[&'static str]| prop_oneof![30 => Just(common), 1 => prop::sample::select(others.to_vec())];
    // Names that the program has for something else, or the language.
    let name = prop_oneof![60 => "[pP]_?[0-9]{1,4}", 1 => prop::sample::select(vec!["v50", "tA", "z1", "tool0", "main", "if", "pHome"]).prop_map(str::to_owned)];
    let storage = often("  CONST", &["CONST", "PERS", "LOCAL VAR", "  const", "\tCONST"]);
    let pose = (
        often("", &[" ", "+"]),
        "-?[0-9]{1,4}\\.[0-9]{1,4}",
        often("0,1,0,0", &["1,1,0,0", "0,0.6,0,-0.8", "x,0,0,0"]),
    );
    let pose = (pose, often("9E9", &["0"]), often("", &[" ", "! a target"]));
    let line = (
        often("    MoveL ", &["MoveJ ", "\tMovel  "]),
        often(",v50,z1,tA;", &[" ,v50,z1,tB;", ",v50,z1,tA; ", "\\ID:=3,v50,z1,tA;"]),
        common(),
    );
    let target = (name, storage, pose, line, 0..8);
    (prop::collection::vec(target, 1..60), any::<bool>(), prop::sample::select(vec!["\n", "\r\n", "\n"])).prop_map(|(targets, turned, end)| {
        let (mut data, mut lines) = (Vec::new(), Vec::new());
        let mut known: Vec<String> = Vec::new();
        for (name, storage, ((blank, x, quat), external, trailing), (word, after, inline), kind) in targets {
            if !known.contains(&name.to_ascii_uppercase()) {
                known.push(name.to_ascii_uppercase());
                data.push(format!("{storage} robtarget {name}:=[[{blank}{x},0,1],[{quat}],[0,-1,0,1],[{external},9E9,9E9,9E9,9E9,9E9]];{trailing}"));
            }
            let spelled = if kind == 0 { name.to_ascii_lowercase() } else { name };
            lines.push(format!("{word}{spelled}{after}"));
            lines.extend((kind == 1).then_some(inline));
        }
        if turned {
            data.reverse();
        }
        let (data, lines) = (data.join(end), lines.join(end));
        HEAD.replace("  PROC", &format!("{data}\n  PROC")).replace('\n', end) + &lines + end + "ENDPROC" + end + "ENDMODULE" + end
    })
}

proptest! {
    #[test]
    fn a_chunk_reads_like_each_of_its_statements(
        lines in prop_oneof![
            prop::collection::vec(prop_oneof![20 => common(), 1 => line()], 1..400),
            prop::collection::vec(alike(), 1..20).prop_map(|lines| lines.concat()),
        ],
        end in prop::sample::select(vec!["\n", "\r\n", "\n", "\r\r\n"]),
    ) {
        let body: String = lines.iter().map(|line| format!("{line}{end}")).collect();
        let text = format!("{HEAD}{body}ENDPROC\nENDMODULE\n");
        same(|context| Chunks::new("x.mod", text.as_bytes(), context).ok().flatten());
    }
}

proptest! {
    #[test]
    fn a_chunk_with_declarations_reads_like_each_of_its_statements(text in declared()) {
        reads_like_its_statements(&text);
    }
}

/// The context of a program that is read by kinds of lines, and that of a program whose chunks the full reader reads.
fn contexts() -> [Vec<Source>; 2] {
    [Vec::new(), vec![Source::new("c.sys", "MODULE C\nENDMODULE\n")]]
}

/// The next chunk; `None` after the last. The inner one is `None` if it proves not streamable.
fn next(chunks: &mut impl ChunkReader) -> Option<Option<StreamableChunk>> {
    match chunks.take() {
        Ok(Next::Chunk(chunk)) => Some(chunk.read()),
        _ => None,
    }
}

/// Both readers give the same for each chunk, except for the context among its sources.
fn same<C: ChunkReader>(chunks: impl Fn(&[Source]) -> Option<C>) {
    let (mut by_kind, mut full) = match contexts().map(|context| chunks(&context)) {
        [Some(by_kind), Some(full)] => (by_kind, full),
        [None, None] => return,
        _ => panic!("only one of the two readers has chunks"),
    };
    let comparable = |chunk: Option<StreamableChunk>| {
        chunk.map(|mut chunk| {
            let own = chunk.program.sources[0].clone();
            chunk.program.sources = [own].into();
            format!("{chunk:?}")
        })
    };
    loop {
        let [one, other] = [next(&mut by_kind), next(&mut full)];
        if one.is_none() && other.is_none() {
            return;
        }
        assert_eq!(one.map(comparable), other.map(comparable));
    }
}

fn reads_like_its_statements(text: &str) {
    let file = || Cursor::new(text.as_bytes());
    same(|context| Declared::sized("x.mod", file(), file(), context, 1000).ok().flatten());
}

#[test]
fn a_target_with_the_name_of_a_speed_teaches_other_chunks_nothing() {
    let names: Vec<String> = ["v50".to_owned()].into_iter().chain((0..60).map(|i| format!("p{i}"))).collect();
    reads_like_its_statements(&program_with(&names));
}

/// A program that declares these targets and moves to each of them.
fn program_with(names: &[String]) -> String {
    let target = |(i, name): (usize, &String)| {
        format!("  CONST robtarget {name}:=[[{i}.5,2,3],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n")
    };
    let data: String = names.iter().enumerate().map(target).collect();
    let lines: String = names.iter().map(|name| format!("    MoveL {name},v50,z1,tA;\n")).collect();
    HEAD.replace("  PROC", &format!("{data}  PROC")) + &lines + "ENDPROC\nENDMODULE\n"
}

/// The number of targets, and whether all chunks have the tool of the same line: only the first of a kind is read in full.
fn targets_and_sharing(mut chunks: impl ChunkReader) -> (usize, bool) {
    let (mut count, mut tools) = (0, Vec::new());
    while let Some(chunk) = next(&mut chunks) {
        let program = chunk.unwrap().program;
        count += program.targets.len();
        tools.push(Arc::clone(&program.tools[0].name));
    }
    assert!(tools.len() > 1);
    (count, tools.iter().all(|name| Arc::ptr_eq(name, &tools[0])))
}

#[test]
fn a_usual_program_with_declared_targets_is_read_by_its_kinds_of_lines() {
    let text = program_with(&(0..2000).map(|i| format!("p{i}")).collect::<Vec<_>>());
    let file = || Cursor::new(text.as_bytes());
    let read =
        |context: Vec<Source>| targets_and_sharing(Declared::new("x.mod", file(), file(), &context).unwrap().unwrap());
    assert_eq!(contexts().map(read), [(2000, true), (2000, false)]);
}

#[test]
fn a_usual_program_is_read_by_its_kinds_of_lines() {
    let line = "    MoveL [[1.5,2,3],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tA;\n";
    let text = format!("{HEAD}  ConfL\\Off;\n  ! deflex cut\n{}ENDPROC\nENDMODULE\n", line.repeat(2000));
    let read =
        |context: Vec<Source>| targets_and_sharing(Chunks::new("x.mod", text.as_bytes(), &context).unwrap().unwrap());
    assert_eq!(contexts().map(read), [(2000, true), (2000, false)]);
}
