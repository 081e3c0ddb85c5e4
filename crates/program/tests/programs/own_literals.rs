//! A change of literals that have one motion each, compared with the way of all other literals.

use deflex_program::{Change, Conf, Confdata, Goal, Program, RewriteOptions, Rewritten, rapid};
use deflex_text::{Source, applied};
use proptest::prelude::*;

fn read(literals: &[String]) -> Program {
    let lines: String = literals.iter().map(|literal| format!("  MoveL {literal},v50,z1,tA;\n")).collect();
    let tool = "PERS tooldata tA:=[TRUE,[[0,0,300],[1,0,0,0]],[8,[0,0,100],[1,0,0,0],0,0,0]];";
    let text = format!("MODULE M\n{tool}\nPROC main()\n{lines}ENDPROC\nENDMODULE\n");
    rapid::read(vec![Source::new("x.mod", text)], Vec::new()).unwrap()
}

fn result(program: &Program, rewritten: &Rewritten) -> (String, String) {
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    (String::from_utf8(out).unwrap(), format!("{:?} {:?}", rewritten.written, rewritten.kept))
}

fn literal() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        8 => "-?[1-9][0-9]{0,3}\\.[0-9]{1,10}",
        1 => prop::sample::select(vec!["0", "-0.000", "+1.5", "0012.5", "1.5E2", "- 3.25", "7.", "0.0000"])
            .prop_map(str::to_owned),
    ];
    let quat = prop::sample::select(vec![
        "1,0,0,0",
        "0.7071,0,0.7071,0",
        "0.00000000, 0.6, -0.8, 0.0",
        "0,0,1.0,-0",
        "0,10E-1,0,+0",
    ]);
    let comma = prop::sample::select(vec![",", ", ", " , "]);
    (prop::array::uniform3(number), quat, comma).prop_map(|([x, y, z], quat, comma)| {
        format!("[[{x}{comma}{y}{comma}{z}],[{quat}],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")
    })
}

fn step() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(1e-5), -2.0..2.0]
}

proptest! {
    #[test]
    fn own_literals_become_what_agreed_ones_do(
        literals in prop::collection::vec(literal(), 1..9),
        steps in prop::collection::vec((prop::array::uniform3(step()), prop::array::uniform4(step()), 0..8), 9),
    ) {
        let last = "[[1,2,3],[1,0,0,0],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]".to_owned();
        let program = read(&[&literals[..], &[last]].concat());
        let mut changes: Vec<Option<Change>> = program.targets.iter().zip(&steps).map(|(target, (by, turn, kind))| {
            let Goal::Pose { position_mm, quat, conf } = target.goal else { return None };
            let quat = std::array::from_fn(|k| quat[k] + 0.1 * turn[k]);
            Some(Change {
                position_mm: std::array::from_fn(|k| position_mm[k] + by[k]),
                quat: (*kind > 2).then_some(quat),
                conf: if *kind == 7 { Some(Conf::Quarters(Confdata { cf1: 1, cf4: 0, cf6: 0, cfx: 0 })) } else { conf },
                external: (*kind == 6).then(|| Box::new([Some(by[0]), None, Some(12.5), None, None, None])),
            }).filter(|_| *kind > 0)
        }).collect();
        // A target that stays makes all of them go the way of literals with several motions.
        let last = changes.len() - 1;
        changes[last] = None;
        let stays: Vec<bool> = (0..=last).map(|i| i == last).collect();
        let [own, agreed] = [&[][..], &stays].map(|stays| {
            let options = RewriteOptions { stays, ..RewriteOptions::default() };
            result(&program, &program.rewrite(&changes, &[], &options))
        });
        prop_assert_eq!(own, agreed);
    }
}
