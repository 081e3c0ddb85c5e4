//! Files that are one program, and what a program takes from other files.

use deflex_program::cl::ClOptions;
use deflex_program::{Editable, Language, ModuleGroup, ModuleNames, Program, ReadOptions, Reason, group_modules};
use deflex_text::Source;

fn groups(texts: &[&str]) -> Vec<Vec<usize>> {
    groups_in(Language::Rapid, texts)
}

fn groups_in(language: Language, texts: &[&str]) -> Vec<Vec<usize>> {
    with_context(language, texts).into_iter().map(|group| group.members).collect()
}

fn with_context(language: Language, texts: &[&str]) -> Vec<ModuleGroup> {
    with_callers(language, texts, &[])
}

/// The programs that the texts form, if the command names `given` with `--context`.
fn with_callers(language: Language, texts: &[&str], given: &[&str]) -> Vec<ModuleGroup> {
    let names = |text: &&str| {
        let mut names = ModuleNames::new(language);
        names.read(text.as_bytes()).unwrap();
        names
    };
    group_modules(&texts.iter().chain(given).map(names).collect::<Vec<_>>(), texts.len())
}

/// Members and context of each program.
fn contexts(groups: &[ModuleGroup]) -> Vec<(&[usize], &[usize])> {
    groups.iter().map(|group| (&group.members[..], &group.context[..])).collect()
}

/// The programs that the texts form, each read with its context after that of the command.
fn read(language: Language, texts: &[&str], given: &[&str]) -> Vec<Program> {
    let source = |i: &usize| Source::new(format!("{i}"), texts[*i]);
    let program = |group: ModuleGroup| {
        let given = given.iter().map(|text| Source::new("given", *text));
        let context = given.chain(group.context.iter().map(source)).chain(group.others).collect();
        let members = group.members.iter().map(source).collect();
        let options = ReadOptions { cl: &ClOptions::default(), look: false };
        deflex_program::read(language, members, context, &options).unwrap()
    };
    with_callers(language, texts, given).into_iter().map(program).collect()
}

/// How many targets of a program may be edited, and how many may not.
fn edited(program: &Program) -> [usize; 2] {
    let kept = program.targets.iter().filter(|target| matches!(target.editable, Editable::No(_))).count();
    [program.targets.len() - kept, kept + program.unknown.len()]
}

const FRAMES: &str = "PERS tooldata tM:=[TRUE,[[0,0,310],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];
    PERS wobjdata wP:=[FALSE,TRUE,\"\",[[1200,-200,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    PERS wobjdata wQ:=[FALSE,TRUE,\"\",[[1400,300,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n";
const AT: &str = "[[0,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

fn part(name: &str, data: &str, body: &str) -> String {
    format!("MODULE {name}\n{data}PROC main()\n{body}\nENDPROC\nENDMODULE\n")
}

#[test]
fn parameters_and_names_of_a_routine_are_no_names_of_the_module() {
    let job = "MODULE Job
        PROC main()\n MvL [[0,0,0]],tM,wP;\n nStep:=1;\n ENDPROC
        PROC MvL(robtarget p,PERS tooldata tM,\\INOUT num n | switch s,PERS wobjdata wP{*})
          VAR num nStep:=2;\n MoveL p,v50,fine,tM\\WObj:=wP;\n ENDPROC\nENDMODULE\n";
    let data = format!("MODULE Data\n{FRAMES} VAR num nStep;\nENDMODULE\n");
    let own = "MODULE Own\n PROC r(num nStep)\n VAR num p;\n p:=nStep;\n ENDPROC\nENDMODULE\n";
    let other = "MODULE Other\n CONST robtarget p:=[[0]];\nENDMODULE\n";
    assert_eq!(groups(&[job, &data, own, other]), [vec![0, 1], vec![2], vec![3]]);
    // Another module has the value of a PERS without one.
    let refers = part("Part", "PERS wobjdata wP;\n", "MoveL p1,v50,fine,tool0\\WObj:=wP;");
    assert_eq!(groups(&[&refers, &data]), [[0, 1]]);
}

#[test]
fn types_and_all_names_of_a_global_list_join_modules() {
    let job = part("Job", "CONST op o1:=[[0]];\nVAR level l;\n", "MoveL o1.a,v50,fine,tool0;");
    let types = "MODULE Types\n RECORD op\n robtarget a;\n robtarget b;\n ENDRECORD\nENDMODULE\n";
    let alias = "MODULE Levels\n ALIAS num level;\nENDMODULE\n";
    // A component has no meaning outside of its record.
    let other = "MODULE Other\n CONST num a:=1;\nENDMODULE\n";
    assert_eq!(groups(&[&job, types, alias, other]), [vec![0, 1, 2], vec![3]]);
    let job = "DEF job()\nLIN GR2\nLIN GR3[1]\nEND\n";
    let data =
        "DEFDAT points PUBLIC\nDECL GLOBAL E6POS GR1={X 0.0,Y 0.0},GR2={X 1.0,Y 2.0}\nDECL E6POS XP1={X 0.0}\nENDDAT\n";
    let more = "DEFDAT more PUBLIC\nGLOBAL E6POS GR[2],GR3[2]\nENDDAT\n";
    let own = "DEF own()\nDECL E6POS GR1\nLIN XP1\nEND\n";
    assert_eq!(groups_in(Language::Krl, &[job, data, more, own]), [vec![0, 1, 2], vec![3]]);
}

#[test]
fn a_data_module_counts_for_each_program_that_uses_it() {
    let body = format!("MoveL {AT},v50,fine,tM\\WObj:=wP;\nMoveL pHome,v50,fine,tM\\WObj:=wP;");
    let parts = ["Part1", "Part2", "Part3"].map(|name| part(name, "", &body));
    let data = format!("MODULE Data\n{FRAMES}CONST robtarget pHome:={AT};\nENDMODULE\n");
    let texts = [&parts[0][..], &parts[1], &parts[2], &data];
    let found = with_context(Language::Rapid, &texts);
    assert_eq!(contexts(&found), [(&[0, 3][..], &[][..]), (&[1], &[3]), (&[2], &[3])]);
    // The program of the data module knows that others read its point, and does not need their texts for that.
    assert_eq!(found.iter().filter(|group| group.others.is_some()).count(), 1);
    for program in read(Language::Rapid, &texts, &[]) {
        assert!(program.tools.iter().all(|tool| tool.data.is_some()) && program.wobjs[0].data.is_some());
        assert_eq!(edited(&program), [1, 1]);
    }
    // What several others declare and the program does not is not that of the cell.
    let own = ["Part1", "Part2"].map(|name| part(name, FRAMES, &body));
    let programs = read(Language::Rapid, &[&own[0], &own[1], &parts[2]], &[]);
    assert_eq!(programs.iter().map(edited).collect::<Vec<_>>(), [[1, 1], [1, 1], [1, 1]]);
    let lower = own[1].replace("310", "200");
    let programs = read(Language::Rapid, &[&own[0], &lower, &parts[2]], &[]);
    assert_eq!(programs.iter().map(edited).collect::<Vec<_>>(), [[1, 1], [1, 1], [0, 2]]);
    assert!(programs[2].kept.iter().any(|kept| kept.reason == Reason::Tool));
}

#[test]
fn a_routine_that_two_programs_call_is_read_with_both() {
    let calls = |name: &str, wobj: &str, frames: &str| part(name, frames, &format!("rCut {wobj};"));
    let library =
        format!("MODULE Lib\nPROC rCut(PERS wobjdata wAct)\nMoveL {AT},v50,fine,tM\\WObj:=wAct;\nENDPROC\nENDMODULE\n");
    let lower = FRAMES.replace("310", "200");
    for (second, frames, expected) in [("wQ", FRAMES, [0, 1]), ("wP", FRAMES, [1, 0]), ("wP", &lower[..], [0, 1])] {
        let [one, two] = [calls("PartA", "wP", FRAMES), calls("PartB", second, frames)];
        let texts = [&one[..], &two, &library];
        let found = with_context(Language::Rapid, &texts);
        assert_eq!(contexts(&found), [(&[0, 2][..], &[1][..]), (&[1], &[2])]);
        let programs = read(Language::Rapid, &texts, &[]);
        assert_eq!(edited(&programs[0]), expected, "{second}");
        assert!(programs.iter().all(|program| program.diagnostics.iter().all(|d| d.code != "rapid.undeclared")));
    }
}

#[test]
fn a_file_that_writes_data_counts_for_the_files_that_read_them() {
    let body = format!("wL:=wP;\nwL.oframe.trans.z:=nZ;\nMoveL {AT},v50,fine,tM\\WObj:=wL;");
    let main = part("Main", "VAR wobjdata wL;\n", &body);
    let data = format!("MODULE Data\n{FRAMES}PERS num nZ:=0;\nENDMODULE\n");
    let main = &main[..];
    let setup = |text: &str| format!("MODULE Setup\nPROC rSetup()\n{text}\nENDPROC\nENDMODULE\n");
    let writes = [
        "nZ:=GInput(gi1);",
        "IF DInput(di1)=1 nZ:=5;",
        "IF DInput(di1)=1 THEN\nIncr nZ;\nENDIF",
        "rOther nZ;",
        "TEST GInput(gi1)\nCASE 1,2:\nnZ:=5;\nENDTEST",
        "x:=fOther(nZ);",
        "SetDataVal \"nZ\",5;",
        "%\"rOther\"% nZ;",
    ];
    for text in writes {
        let programs = read(Language::Rapid, &[main, &setup(text)], &[&data]);
        assert_eq!(edited(&programs[0]), [0, 1], "{text}");
    }
    for text in
        ["x:=nZ;", "MoveL Offs(p1,0,0,nZ),v50,fine,tM\\WObj:=wP;", "TPWrite \"z\"\\Num:=nZ;", "IF nZ=1 THEN\nENDIF"]
    {
        let programs = read(Language::Rapid, &[main, &setup(text)], &[&data]);
        assert_eq!(edited(&programs[0]), [1, 0], "{text}");
    }
    // A routine that only reads its parameters changes nothing of its caller.
    let reads = "MODULE Lib\nPROC rOther(num z)\nMoveL Offs(p1,0,0,z),v50,fine,tool0;\nENDPROC\nENDMODULE\n";
    let found = with_context(Language::Rapid, &[main, &setup("rOther nZ;"), reads]);
    assert!(found.iter().all(|group| group.others.is_none()), "{found:?}");
}

#[test]
fn the_controllers_tables_belong_to_all_files() {
    let cuts =
        "DEF cuts()\nBAS(#TOOL,1)\nBAS(#BASE,2)\n$VEL.CP=0.05\nLIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}\nEND\n";
    for (text, expected) in [
        ("BASE_DATA[2]=$POS_ACT", [0, 1]),
        ("BASE_DATA[3]=$POS_ACT", [1, 0]),
        ("BASE_DATA[3]={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}", [1, 0]),
        ("BASE_DATA[1+I]={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}", [0, 1]),
        ("BASE_DATA[I]=$POS_ACT", [0, 1]),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO BASE_DATA[2].X=1 PRIO=-1", [0, 1]),
        ("MEASURE(BASE_DATA[2])", [0, 1]),
        ("IF BASE_DATA[2].X==1 THEN", [1, 0]),
        ("X=BASE_DATA[2].X", [1, 0]),
    ] {
        let end = if text.ends_with("THEN") { "ENDIF\n" } else { "" };
        let sets = format!("DEF sets()\nDECL INT I\n{text}\n{end}END\n");
        let programs = read(Language::Krl, &[cuts, &sets], &[]);
        assert_eq!(edited(&programs[0]), expected, "{text}");
    }
    let cuts = cuts.replace("#BASE,2", "#BASE,ACT");
    let config = "DEFDAT $CONFIG PUBLIC\nDECL GLOBAL INT ACT=3\nENDDAT\n";
    let programs = read(Language::Krl, &[&cuts, "DEF sets()\nACT=1\nEND\n"], &[config]);
    assert_eq!(edited(&programs[0]), [0, 1]);
}

/// What another program leaves of the controller's override, and reads of GLOBAL data, matters to this one.
#[test]
fn an_override_and_global_data_belong_to_all_files() {
    let cuts =
        "DEF cuts()\nBAS(#TOOL,1)\nBAS(#BASE,2)\n$VEL.CP=0.05\nLIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}\nEND\n";
    for (text, is_known) in [
        ("$OV_PRO=50", false),
        ("$OV_PRO=I", false),
        ("$OV_PRO=100-50", false),
        ("BAS(#OV_PRO,50)", false),
        ("IF $IN[1] THEN\n$OV_PRO=50\nENDIF", false),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OV_PRO=50", false),
        ("$OV_PRO=100", true),
        ("BAS(#OV_PRO,100)\nBAS(#VEL_CP,50)", true),
        ("I=$OV_PRO", true),
    ] {
        let sets = format!("DEF sets()\nDECL INT I\n{text}\nEND\n");
        let programs = read(Language::Krl, &[cuts, &sets], &[]);
        assert_eq!(programs[0].targets[0].feed_mm_s.is_some(), is_known, "{text}");
    }
    let [own, point] = ["{X 0.0,Y 0.0,Z Z1", "{X 0.0,Y 0.0,Z GZ"].map(|at| cuts.replace("{X 0.0,Y 0.0,Z 0.0", at));
    let own = own.replace("LIN", "GZ=Z1\nLIN");
    let data = "DEFDAT cuts PUBLIC\nDECL REAL Z1=5.0\nDECL GLOBAL REAL GZ=1.0\nENDDAT\n";
    let texts = [&format!("{own}{data}")[..], &point.replace("cuts", "other")];
    let programs = read(Language::Krl, &texts, &[]);
    assert_eq!(edited(&programs[0]), [0, 2]);
}

#[test]
fn tasks_share_the_data_that_both_declare() {
    let moves = format!("MoveL {AT},v50,fine,tM\\WObj:=wP;");
    let one = part("T1", FRAMES, &moves);
    let sets = format!("wP:=wQ;\n{moves}");
    let two = |text: &str| part("T2", FRAMES, text);
    let task = "wP.oframe.trans.z:=20;";
    assert_eq!(edited(&read(Language::Rapid, &[&one, &two(task)], &[])[0]), [0, 1]);
    assert_eq!(edited(&read(Language::Rapid, &[&one], &[&two(task)])[0]), [0, 1]);
    assert_eq!(edited(&read(Language::Rapid, &[&one, &two("x:=wP;")], &[])[0]), [1, 0]);
    let own = two(task).replace("PERS wobjdata wP", "TASK PERS wobjdata wP");
    assert_eq!(edited(&read(Language::Rapid, &[&one, &own], &[])[0]), [1, 0]);
    // Part programs that each set their own data first are corrected, unless they are tasks that wait for each other.
    let parts = [part("P1", FRAMES, &sets), part("P2", FRAMES, &sets)];
    assert_eq!(edited(&read(Language::Rapid, &[&parts[0], &parts[1]], &[])[0]), [1, 0]);
    let waits = part("P1", &format!("{FRAMES}PERS tasks tl{{2}}:=[[\"A\"],[\"B\"]];\n"), &sets);
    assert_eq!(edited(&read(Language::Rapid, &[&waits, &parts[1]], &[])[0]), [0, 1]);
}

#[test]
fn part_programs_of_a_folder_do_not_read_each_other() {
    let body = format!("MvL p1,tM,wP;\nMoveL p1,v50,fine,tM\\WObj:=wP;\nMoveL {AT},v50,fine,tool0;");
    let wrapper = "PROC MvL(robtarget p,PERS tooldata t,PERS wobjdata w)\nMoveL p,v50,fine,t\\WObj:=w;\nENDPROC\n";
    let text = |i: usize| {
        let module = part(&format!("Part{i}"), &format!("CONST robtarget p1:={AT};\n"), &body);
        module.replace("ENDMODULE", &format!("{wrapper}ENDMODULE"))
    };
    let parts: Vec<String> = (0..20).map(text).collect();
    let mut texts: Vec<&str> = parts.iter().map(String::as_str).collect();
    let data = format!("MODULE Data\n{FRAMES}ENDMODULE\n");
    texts.push(&data);
    let found = with_context(Language::Rapid, &texts);
    assert!(found[1..].iter().all(|group| group.context == [20] && group.others.is_none()), "{found:?}");
    assert!(found[0].context.is_empty());
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
fn programs_with_a_caller_in_the_context_are_one_program() {
    let members = |texts: &[&str], given: &[&str]| -> Vec<Vec<usize>> {
        with_callers(Language::Krl, texts, given).into_iter().map(|group| group.members).collect()
    };
    let cuts = |name: &str| {
        format!(
            "DEF {name}()\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[1]\nLIN {{X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}}\nEND\n"
        )
    };
    let (one, two) = (cuts("XA"), cuts("XB"));
    let cell = "DEF cell()\nLOOP\nIF $IN[1] THEN\nxa()\nENDIF\nIF $IN[2] THEN\nxb()\nENDIF\nENDLOOP\nEND\n";
    assert_eq!(members(&[&one, &two], &[cell]), [[0, 1]]);
    let programs = read(Language::Krl, &[&one, &two], &[cell]);
    assert_eq!((programs.len(), edited(&programs[0])), (1, [2, 0]));
    assert!(programs[0].diagnostics.iter().all(|d| d.code != "krl.unknown-routine"), "{:?}", programs[0].diagnostics);
    // Data that one program changes are changed for the other one too.
    let sets = one.replace("END\n", "BASE_DATA[1].X=$POS_ACT.X\nEND\n");
    assert_eq!(edited(&read(Language::Krl, &[&sets, &two], &[cell])[0]), [0, 2]);
    // The cell may call one of them by another routine of the context, or by another input.
    let first = "DEF cell()\nxa()\nmenu()\nEND\n";
    let menu = "DEF menu()\nxb()\nEND\n";
    assert_eq!(members(&[&one, &two], &[menu, first]), [[0, 1]]);
    assert_eq!(members(&[&one.replace("END\n", "menu()\nEND\n"), &two], &[menu]), [[0, 1]]);
    // A library of routines and data that several programs use joins none of them.
    let uses = ["XA", "XB"].map(|name| cuts(name).replace("END\n", "lib(XP1)\nEND\n"));
    let library = ["DEF lib(P:IN)\nWAIT SEC 1\nEND\n", "DEFDAT data PUBLIC\nDECL GLOBAL E6POS XP1={X 0.0}\nENDDAT\n"];
    assert_eq!(members(&[&uses[0], &uses[1]], &library), [[0], [1]]);
    // Neither do a copy of an input, and a call of a routine that two inputs have.
    assert_eq!(members(&[&one, &two], &[&one.replace("END\n", "xb()\nEND\n")]), [[0], [1]]);
    assert_eq!(members(&[&one, &one, &two], &[cell]), [[0], [1], [2]]);
}

#[test]
fn programs_with_a_caller_in_the_context_have_one_main() {
    let cuts = |name: &str, routine: &str| {
        let body = format!("MoveL {AT},v50,fine,tM\\WObj:=wP;");
        part(name, "", &body).replace("main()", &format!("{routine}()"))
    };
    let (one, two) = (cuts("One", "rOne"), cuts("Two", "rTwo"));
    let main = part("Cell", FRAMES, "IF DInput(di1)=1 rOne;\nIF DInput(di2)=1 rTwo;");
    let programs = read(Language::Rapid, &[&one, &two], &[&main]);
    assert_eq!((programs.len(), edited(&programs[0])), (1, [2, 0]));
    assert!(programs[0].diagnostics.iter().all(|d| d.code != "rapid.undeclared"), "{:?}", programs[0].diagnostics);
    let displaces = two.replace("ENDPROC", "PDispOn p1,tM;\nENDPROC");
    assert_eq!(edited(&read(Language::Rapid, &[&one, &displaces], &[&main])[0]), [1, 1]);
    let own = two.replace("ENDMODULE", "PROC main()\nENDPROC\nENDMODULE");
    assert_eq!(read(Language::Rapid, &[&one, &own], &[&main]).len(), 2);
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
