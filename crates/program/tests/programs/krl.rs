//! Reads small KRL programs and checks the targets, the reasons and the edits.

use deflex_program::krl::read;
use deflex_program::{ArcTurn, Change, Editable, Goal, Mark, Motion, Program, Reason, RewriteOptions, Role};
use deflex_text::{Source, applied};

fn program_of(texts: &[(&str, &str)], context: &[(&str, &str)]) -> Program {
    let sources = |texts: &[(&str, &str)]| texts.iter().map(|(name, text)| Source::new(*name, *text)).collect();
    read(sources(texts), sources(context)).unwrap()
}

fn program(body: &str) -> Program {
    program_of(&[("a.src", &format!("DEF a( )\n{body}\nEND\n"))], &[])
}

fn positions(program: &Program) -> Vec<[f64; 3]> {
    let position = |target: &deflex_program::Target| match target.goal {
        Goal::Pose { position_mm, .. } => position_mm,
        _ => [f64::NAN; 3],
    };
    program.targets.iter().map(position).collect()
}

fn moved(program: &Program, by: f64) -> Vec<String> {
    let change = |target: &deflex_program::Target| match target.goal {
        Goal::Pose { position_mm, .. } => {
            Some(Change { position_mm: position_mm.map(|v| v + by), quat: None, conf: None, external: None })
        }
        _ => None,
    };
    let changes: Vec<_> = program.targets.iter().map(change).collect();
    let rewritten = program.rewrite(&changes, &[], &RewriteOptions::default());
    let write = |(source, edits): (&Source, &Vec<deflex_text::Edit>)| {
        let out = applied(&source.bytes, edits);
        String::from_utf8(out).unwrap()
    };
    program.sources.iter().zip(&rewritten.edits).map(write).collect()
}

fn reasons(program: &Program) -> Vec<Reason> {
    program.kept.iter().map(|kept| kept.reason).collect()
}

#[test]
fn inline_positions_are_edited_where_they_stand() {
    let p = program(
        "$BASE = BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\n$VEL.CP = 0.02\nLIN {X 10.0,Y -20.125, Z 0,A 90,B 0.0,C 180.0} C_DIS ; LIN {X 1}",
    );
    assert_eq!(positions(&p), [[10.0, -20.125, 0.0]]);
    assert_eq!(p.targets[0].feed_mm_s, Some(20.0));
    assert_eq!((&*p.tools[0].name, &*p.wobjs[0].name), ("TOOL_DATA[1]", "BASE_DATA[2]"));
    assert_eq!((p.targets[0].editable, p.literal_targets, p.motion_targets()), (Editable::Pose, 1, 1));
    let Goal::Pose { quat, .. } = p.targets[0].goal else { panic!() };
    // Rz(90) Rx(180): x to y, y to x, z down.
    let r = deflex_program::orientation::rotation(quat);
    assert!((r * nalgebra::Vector3::x() - nalgebra::Vector3::y()).amax() < 1e-12);
    assert!((r * nalgebra::Vector3::z() + nalgebra::Vector3::z()).amax() < 1e-12);
    let text = &moved(&p, 0.25)[0];
    assert!(text.contains("{X 10.250,Y -19.875, Z 0.250,A 90,B 0.0,C 180.0} C_DIS ; LIN {X 1}"), "{text}");
}

#[test]
fn a_number_that_loses_its_sign_is_not_joined_to_its_name() {
    let p = program("LIN {X-0.1,Y-9.0,Z 3.0,A-.2,B 0.0,C 0.0}");
    assert_eq!(positions(&p), [[-0.1, -9.0, 3.0]]);
    let texts = moved(&p, 0.5);
    assert!(texts[0].contains("{X 0.400,Y-8.500,Z 3.500,A-.2,"), "{}", texts[0]);
}

#[test]
fn points_of_the_data_list_are_edited_there() {
    let src = "&ACCESS RVP\r\nDEF a( )\r\n;FOLD LIN P1;%{PE}\r\nFDAT_ACT=FP1\r\nBAS(#CP_PARAMS,2)\r\nLIN XP1 C_DIS\r\n;ENDFOLD\r\nEND\r\n";
    let dat = "DEFDAT A\r\nDECL E6POS XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 2,T 'B1010',E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}\r\nDECL FDAT FP1={TOOL_NO 3,BASE_NO 0,IPO_FRAME #BASE,POINT2[] \" \"}\r\nENDDAT\r\n";
    let p = program_of(&[("a.src", src), ("a.dat", dat)], &[]);
    assert_eq!(positions(&p), [[1.0, 2.0, 3.0]]);
    assert_eq!(p.targets[0].name.as_deref(), Some("XP1"));
    assert_eq!((&*p.tools[0].name, &*p.wobjs[0].name), ("TOOL_DATA[3]", "$NULLFRAME"));
    assert_eq!(p.targets[0].feed_mm_s, Some(2000.0));
    let texts = moved(&p, 0.5);
    assert_eq!(texts[0], src);
    assert_eq!(texts[1], dat.replace("X 1.0,Y 2.0,Z 3.0", "X 1.500,Y 2.500,Z 3.500"));
}

#[test]
fn a_loop_over_an_array_is_one_visit_an_element() {
    let dat = "DEFDAT points PUBLIC\nDECL GLOBAL FRAME gP[3]\ngP[1]={X 1.0,Y 0.0,Z 0.0,A 1.0,B 0.0,C 0.0}\ngP[2]={X 2.0,Y 0.0,Z 0.0,A 1.0,B 0.0,C 0.0}\ngP[3]={X 3.0,Y 0.0,Z 0.0,A 1.0,B 0.0,C 0.0}\nENDDAT\n";
    let src = "DEF a()\nINT i\nFOR i = 1 TO 3\ngP[i].A=-30\nLIN gP[i] C_VEL\nENDFOR\nEND\n";
    let p = program_of(&[("a.src", src), ("points.dat", dat)], &[]);
    assert_eq!(positions(&p).iter().map(|at| at[0]).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    assert!(p.targets.iter().all(|t| t.editable == Editable::Position));
    assert_eq!(p.targets[1].name.as_deref(), Some("gP[2]"));
    assert_eq!(moved(&p, 0.5)[1].matches(".500,").count(), 9);
    let alone = program_of(&[("a.src", src)], &[("points.dat", dat)]);
    assert_eq!(alone.targets[0].editable, Editable::No(Reason::InContextFile));
}

#[test]
fn missing_components_are_those_of_the_motion_before() {
    let p = program("LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nLIN {X 4.0,Y 5.0,Z 6.0}\nLIN {Z 50.0}");
    assert_eq!(positions(&p), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [4.0, 5.0, 50.0]]);
    let editable: Vec<_> = p.targets.iter().map(|t| t.editable).collect();
    assert_eq!(editable[0], Editable::Position);
    assert!(matches!(editable[1], Editable::No(_)) && matches!(editable[2], Editable::No(_)));
}

/// The first line takes E1 from the data list, which its aggregate leaves as it is; after WITH the frames are others.
#[test]
fn an_axis_at_an_unknown_place_stays_there() {
    let src = "DEF a( )\nP={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nSLIN P WITH $BASE=SBASE(1)\nPTP Q\nEND\n";
    let dat = "DEFDAT a\nDECL E6POS P={X 4.0,Y 5.0,Z 6.0,A 0.0,B 0.0,C 0.0,E1 300.0}\nDECL E6POS Q={X 7.0,Y 8.0,Z 9.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";
    let p = program_of(&[("a.src", src), ("a.dat", dat)], &[]);
    assert_eq!(editable(&p), ['-', '-']);
    assert!(!p.targets[1].external.as_ref().unwrap().at_rest[0]);
}

#[test]
fn axes_that_only_a_handler_moves_are_in_use() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0";
    let p =
        program(&format!("INTERRUPT DECL 3 WHEN $IN[1] DO isr()\n{line},E1 0.0}}\nEND\nDEF isr()\n{line},E1 200.0}}"));
    assert!(!p.targets[0].external.as_ref().unwrap().is_at_rest());
}

#[test]
fn joint_motions_keep_status_and_turn_true() {
    let p = program(
        "PTP {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 'B010',T 35}\nLIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 6,T 50}",
    );
    let written = Some(deflex_program::Conf::Status(deflex_program::StatusAndTurn { status: 2, turn: 35 }));
    let conf = |i: usize| if let Goal::Pose { conf, .. } = p.targets[i].goal { conf } else { None };
    assert_eq!((conf(0), conf(1)), (written, None));
    assert!(p.targets.iter().all(|t| t.editable == Editable::Pose));
    let change = |conf| Some(Change { position_mm: [1.5, 2.5, 3.5], quat: None, conf, external: None });
    let options = RewriteOptions::default();
    let edits = |conf| p.rewrite(&[change(conf), None], &[], &options);
    assert_eq!((edits(None).edits[0].len(), edits(None).kept.len()), (1, 0));
    assert_eq!((edits(written).edits[0].len(), edits(written).kept.len()), (0, 1));
}

#[test]
fn arcs_have_a_via_and_splines_their_points() {
    let p = program(
        "LIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nCIRC {X 1.0,Y 1.0,Z 0.0},{X 2.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0} C_DIS\nSPLINE WITH $VEL.CP=0.5\nSPL {X 3.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDSPLINE\nCIRC {X 1.0,Y 1.0,Z 0.0},{X 2.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}, CA 360",
    );
    assert_eq!(p.targets[1].role, Role::Via);
    assert_eq!((p.targets[2].motion, p.arcs, p.targets.len()), (Motion::Circular, 2, 4));
    assert_eq!(p.targets[3].feed_mm_s, Some(500.0));
    assert_eq!(p.diagnostics.iter().filter(|diagnostic| diagnostic.code == "krl.spline").count(), 1);
    assert_eq!(reasons(&p), [Reason::CircleWithAngle]);
    assert_eq!(moved(&p, 0.5)[0].matches(".500").count(), 12);
}

#[test]
fn what_is_known_only_at_run_time_stays() {
    let line = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    for (body, reason) in [
        ("LIN_REL {X 1.0}", Reason::RelativeMotion),
        ("LIN $POS_ACT", Reason::SystemValue),
        ("P.X = $TIMER[1]\nLIN P", Reason::SystemValue),
        ("LIN XHOME", Reason::NameUndeclared),
        (&*format!("$IPO_MODE=#TCP\nLIN {line}"), Reason::RobotHoldsPart),
        (&*format!("spindle()\nLIN {line}"), Reason::Tool),
        (&*format!("PTP {}", line.replace("}", ",S 2}")), Reason::StatusUnknown),
        ("LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,E1 $TIMER[1]}", Reason::ExternalAxisUnknown),
        (&*format!("BAS(#BASE,$IN_NUM)\nLIN {line}"), Reason::Base),
    ] {
        let p = program(body);
        assert!(reasons(&p).contains(&reason), "{body}: {:?}", reasons(&p));
        assert!(p.targets.iter().all(|t| matches!(t.editable, Editable::No(_))), "{body}");
        assert_eq!(moved(&p, 0.5)[0], String::from_utf8(p.sources[0].bytes.clone()).unwrap());
    }
}

#[test]
fn frames_by_a_condition_are_unknown_after_it() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let p = program(&format!(
        "$BASE=BASE_DATA[1]\nIF $IN[1] THEN\n$BASE=BASE_DATA[2]\n{line}\nENDIF\n{line}\n$BASE=BASE_DATA[1]\n{line}"
    ));
    assert_eq!(p.targets.len(), 2);
    assert_eq!(p.motion_targets(), 3);
    assert_eq!(p.wobjs.iter().map(|w| &*w.name).collect::<Vec<_>>(), ["BASE_DATA[2]", "BASE_DATA[1]"]);
    let p = program(&format!("$BASE=BASE_DATA[1]\nLOOP\n{line}\n$BASE=BASE_DATA[2]\n{line}\nENDLOOP"));
    assert_eq!((p.targets.len(), p.motion_targets()), (1, 2));
}

#[test]
fn a_point_under_two_bases_stays_where_they_disagree() {
    let src =
        "DEF a()\n$BASE=BASE_DATA[1]\nLIN XP1\n$BASE=BASE_DATA[2]\nLIN XP1\nLIN XP2\nIF XP2.X > 0 THEN\nENDIF\nEND\n";
    let dat = "DEFDAT a\nDECL E6POS XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nDECL E6POS XP2={X 9.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";
    let p = program_of(&[("a.src", src), ("a.dat", dat)], &[]);
    assert_eq!(p.targets[2].editable, Editable::No(Reason::ReadByOthers));
    let change = |by: f64| Some(Change { position_mm: [1.0 + by, 2.0, 3.0], quat: None, conf: None, external: None });
    let rewritten = p.rewrite(&[change(0.1), change(0.2), None], &[], &RewriteOptions::default());
    assert!(rewritten.edits.iter().all(Vec::is_empty));
    assert_eq!(rewritten.kept.len(), 2);
    let agreed = p.rewrite(&[change(0.1), change(0.1), None], &[], &RewriteOptions::default());
    assert_eq!((agreed.edits[1].len(), agreed.kept.len()), (1, 0));
}

#[test]
fn routines_take_copies_and_give_back() {
    let body = "FRAME f\nf={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\ngo(f, 5.0)\nLIN f\nEND\nDEF go(p:OUT, d:IN)\nLIN p\np.Z = p.Z + d\n";
    let p = program(body);
    assert_eq!(positions(&p), [[1.0, 2.0, 3.0], [1.0, 2.0, 8.0]]);
    // Both positions depend on the same numbers, and move together.
    assert!(p.targets.iter().all(|t| t.editable == Editable::Pose));
    assert!(moved(&p, 0.5)[0].contains("f={X 1.500,Y 2.500,Z 3.500,") && moved(&p, 0.5)[0].contains("go(f, 5.0)"));
}

#[test]
fn frames_chain_where_they_are_known() {
    let p = program("LIN {X 100.0,Y 0.0,Z 0.0,A 90.0,B 0.0,C 0.0}:{X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}");
    assert!((positions(&p)[0][1] - 10.0).abs() < 1e-9 && (positions(&p)[0][0] - 100.0).abs() < 1e-9);
    // The second frame and the turn of the first one stay.
    assert_eq!(p.targets[0].editable, Editable::Position);
    assert!(
        moved(&p, 0.5)[0].contains("LIN {X 100.500,Y 0.500,Z 0.500,A 90.0,B 0.0,C 0.0}:{X 10.0,"),
        "{:?}",
        moved(&p, 0.5)
    );
}

const POINTS: &str = "DEFDAT a\nDECL E6POS XP2={X 90.0,Y 30.0,Z 5.0,A 90.0,B 0.0,C 180.0,S 2,T 10,E1 0.0}\nDECL E6POS XP3={X 150.0,Y 130.0,Z 5.0,A 0.0,B 0.0,C 180.0,S 2,T 10,E1 0.0}\nDECL E6POS XP4={X 44.0,Y 4.0,Z 4.0,A 0.0,B 0.0,C 180.0,S 2,T 10,E1 0.0}\nENDDAT\n";

fn with_points(body: &str) -> Program {
    program_of(&[("a.src", &format!("DEF a()\n{body}\nEND\n")), ("a.dat", POINTS)], &[])
}

/// The data list if the motions that cut are to be 0.5 mm farther along each axis, and the distance by which each motion moves.
fn with_air(program: &Program) -> (String, Vec<f64>) {
    let air: Vec<bool> = program.targets.iter().map(|target| target.mark == Some(Mark::Air)).collect();
    let change = |(target, air): (&deflex_program::Target, &bool)| match target.goal {
        Goal::Pose { position_mm, .. } if !air => {
            Some(Change { position_mm: position_mm.map(|v| v + 0.5), quat: None, conf: None, external: None })
        }
        _ => None,
    };
    let changes: Vec<_> = program.targets.iter().zip(&air).map(change).collect();
    let rewritten = program.rewrite(&changes, &[], &RewriteOptions { air: &air, ..RewriteOptions::default() });
    let far = positions(program).into_iter().zip(&rewritten.written).map(|(was, (is, _))| {
        let square = was.iter().zip(is).map(|(was, is)| (is - was).powi(2)).sum::<f64>();
        (square.sqrt() * 1e3).round() / 1e3
    });
    let text = applied(&program.sources[1].bytes, &rewritten.edits[1]);
    (String::from_utf8(text).unwrap(), far.collect())
}

const FRAME: &str = "{X 0,Y 0,Z -50,A 0,B 0,C 0}";

#[test]
fn an_approach_by_a_frame_goes_along() {
    for approach in [
        &format!("LIN XP2:{FRAME}")[..],
        "LIN XP2:{X 5,Y 3,Z -50,A 10,B 20,C 30}",
        &format!("LIN XP2:{FRAME}:{FRAME}"),
        "DECL E6POS X\nX=XP2\nX.Z=X.Z+50\nLIN X",
        &format!("DECL FRAME F\nF=XP2:{FRAME}\nF.Z=F.Z+5\nLIN F"),
    ] {
        let p = with_points(&format!("; deflex air\n{approach}\n; deflex cut\nLIN XP2\nLIN XP3"));
        let (text, far) = with_air(&p);
        assert!(text.contains("XP2={X 90.500,Y 30.500,Z 5.500,A 90.0"), "{approach}: {text}");
        assert_eq!(far, [0.866; 3], "{approach}");
    }
    // One that cuts needs the same numbers, and has the angles of the text.
    let p = with_points(&format!("LIN XP2:{FRAME}\nLIN XP2"));
    assert_eq!(p.targets.iter().map(|target| target.editable).collect::<Vec<_>>(), [Editable::Position; 2]);
    assert!((positions(&p)[0][2] - 55.0).abs() < 1e-9, "{:?}", positions(&p));
}

#[test]
fn numbers_in_a_frame_that_something_else_needs_stay() {
    for (what, body) in [
        ("an unknown frame", "; deflex air\nLIN XP2:XP9\n; deflex cut\nLIN XP2"),
        ("an incomplete frame", "; deflex air\nLIN XP2:{Z -50}\n; deflex cut\nLIN XP2"),
        ("a base", &*format!("LIN XP2\n$BASE=XP2:{FRAME}\nLIN XP3")),
        ("a condition", &*format!("DECL FRAME F\nF=XP2:{FRAME}\nIF F.Z>0 THEN\nHALT\nENDIF\nLIN XP2")),
        ("a product", &*format!("DECL FRAME F\nDECL REAL R\nF=XP2:{FRAME}\nR=F.Z*2\nLIN XP2")),
        ("a routine that is not given", &*format!("DECL FRAME F\nF=XP2:{FRAME}\nFOO(F)\nLIN XP2")),
        ("the second frame", "LIN {X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}:XP2\nLIN XP2"),
        ("a relative motion", &*format!("LIN XP2\nLIN_REL XP2:{FRAME}")),
    ] {
        assert!(with_air(&with_points(body)).0.contains("XP2={X 90.0,Y 30.0,Z 5.0,"), "{what}");
    }
    // A number that is a length and an angle.
    let p = program(&format!("DECL REAL R\nR=7.5\nLIN {{X R,Y 1.0,Z 5.0,A R,B 0.0,C 0.0}}:{FRAME}"));
    assert_eq!(moved(&p, 0.5)[0].as_bytes(), &*p.sources[0].bytes);
    // The angles of the first frame, although the motion cuts nothing.
    let p = with_points(&format!("; deflex air\nLIN XP2:{FRAME}\n; deflex cut\nLIN XP2"));
    assert_eq!(p.targets[1].editable, Editable::Position);
}

/// A component that is unknown and not missing is not that of the motion before.
#[test]
fn a_motion_before_one_to_a_changed_position_is_edited() {
    for change in ["XP4.Z=XP4.Z+1", "XP4.X=$POS_ACT.X", "IF $IN[1] THEN\nXP4.Z=7.0\nENDIF"] {
        let p = with_points(&format!("LIN XP2\n{change}\nLIN XP4\nLIN XP3"));
        assert_eq!(p.targets[0].editable, Editable::Pose, "{change}");
        assert!(!with_air(&p).0.contains("XP4={X 44.500"), "{change}");
    }
    for change in ["XP4={Z 1.0}", "DECL E6POS X\nX.Z=1.0\nXP4=X", "XP4.Z=XP4.Z+1\nIF $IN[1] THEN\nXP4={X 5.0}\nENDIF"] {
        let p = with_points(&format!("LIN XP2\n{change}\nLIN XP4\nLIN XP3"));
        assert_eq!(p.targets[0].editable, Editable::No(Reason::ReadByOthers), "{change}");
    }
}

#[test]
fn spline_forms_name_their_frames() {
    let src = "DEF a()\nSLIN XP1 WITH $VEL = SVEL_CP(0.5, , LCPDAT1), $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO), $IPO_MODE = SIPO_MODE(FP1.IPO_FRAME), $LOAD = SLOAD(FP1.TOOL_NO), $ACC = SACC_CP(LCPDAT1) C_SPL\nEND\n";
    let dat = "DEFDAT a\nDECL E6POS XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 6,T 50,E1 0.0}\nDECL FDAT FP1={TOOL_NO 1,BASE_NO 4,IPO_FRAME #BASE,POINT2[] \" \"}\nENDDAT\n";
    let p = program_of(&[("a.src", src), ("a.dat", dat)], &[]);
    assert_eq!((&*p.tools[0].name, &*p.wobjs[0].name), ("TOOL_DATA[1]", "BASE_DATA[4]"));
    assert_eq!((p.targets[0].feed_mm_s, p.targets[0].editable), (Some(500.0), Editable::Pose));
}

/// Whether each target's whole pose may be edited, its position alone, or nothing.
fn editable(program: &Program) -> Vec<char> {
    let letter = |target: &deflex_program::Target| match target.editable {
        Editable::Pose => 'P',
        Editable::Position => 'p',
        Editable::No(_) => '-',
    };
    program.targets.iter().map(letter).collect()
}

#[test]
fn an_orientation_that_the_controller_disregards_is_not_edited() {
    let to = |x: f64, a: f64| format!("{{X {x:.1},Y 2.0,Z 3.0,A {a:.1},B 0.0,C 0.0}}");
    let lines = format!("LIN {}\nLIN {}\nLIN {}\n", to(1.0, 0.0), to(2.0, 0.0), to(3.0, 5.0));
    let held = program(&format!("PTP {}\n$ORI_TYPE=#CONSTANT\n{lines}LIN {}", to(0.0, 0.0), to(4.0, 5.0)));
    assert_eq!(editable(&held), ['P', 'p', 'p', '-', '-'], "the robot still stands as before the first");
    assert!(!held.targets[3].located && held.kept[0].reason == Reason::OrientationType);
    let edited = &moved(&held, 0.5)[0];
    assert!(edited.contains("LIN {X 1.500,Y 2.500,Z 3.500,A 0.0,B 0.0,C 0.0}"), "{edited}");
    assert_eq!(editable(&program(&format!("$ORI_TYPE=#CONSTANT\n{lines}"))), ['-'; 3], "its start is unknown");
    assert_eq!(editable(&program(&format!("$ORI_TYPE=#JOINT\n{lines}"))), ['P'; 3]);
    assert_eq!(
        editable(&program(&format!(
            "$ORI_TYPE=#CONSTANT\nBAS(#INITMOV,0)\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[1]\n{lines}"
        ))),
        ['P'; 3]
    );
    assert_eq!(editable(&program(&format!("IF $IN[1] THEN\n$ORI_TYPE=#CONSTANT\nENDIF\n{lines}"))), ['-'; 3]);
    let with = format!("SLIN {} WITH $ORI_TYPE=#CONSTANT\nSLIN {}", to(1.0, 9.0), to(2.0, 0.0));
    assert_eq!(editable(&program(&with)), ['-', 'P'], "for one motion");
}

#[test]
fn the_orientation_of_inline_forms_is_that_of_their_data() {
    let src = "DEF a()\nFDAT_ACT=FP1\nLDAT_ACT=LCPDAT1\nBAS(#CP_PARAMS,0.1)\nLIN XP1\nEND\n";
    let kinds = |kind: &str| {
        let point = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
        let dat = format!(
            "DEFDAT a\nDECL E6POS XP1={point}\nDECL FDAT FP1={{TOOL_NO 1,BASE_NO 4,IPO_FRAME #BASE}}\nDECL LDAT LCPDAT1={{VEL 2.0,ACC 100.0,APO_DIST 100.0,APO_FAC 50.0{kind}}}\nENDDAT\n"
        );
        editable(&program_of(&[("a.src", src), ("a.dat", &dat)], &[]))
    };
    assert_eq!(kinds(",ORI_TYP #VAR"), ['P']);
    assert_eq!(kinds(",ORI_TYP #CONSTANT"), ['-']);
    assert_eq!(kinds(""), ['P'], "a controller whose BAS reads it stops");
    assert_eq!(
        editable(&program("XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nLDAT_ACT=LOTHER\nBAS(#CP_DAT)\nLIN XP1")),
        ['-']
    );
}

#[test]
fn external_axes_that_do_not_go_where_positions_say_keep_their_targets() {
    let line = |x: u8, axes: &str| format!("SLIN {{X {x}.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0{axes}}}");
    let all = |body: &str| (editable(&program(body)), reasons(&program(body)));
    let chosen = Reason::IgnoredAxis;
    // For one motion, and of the axis whose bit is set; who leaves it out has it from there.
    let first = line(1, ",E1 5.0,E2 7.0");
    let with = |bits: &str| format!("{} WITH $EX_AX_IGNORE='B{bits}'", line(2, ",E1 6.0,E2 7.0"));
    let after = line(3, ",E1 9.0,E2 7.0");
    assert_eq!(all(&format!("{first}\n{}\n{after}", with("01"))), (vec!['P', '-', 'P'], vec![chosen]));
    assert_eq!(all(&format!("{first}\n{}\n{after}", with("00"))).0, ['P'; 3]);
    assert_eq!(all(&format!("{first}\n{}\n{after}", with("100"))).0, ['P'; 3], "E3 is named nowhere");
    assert_eq!(all(&format!("{first}\n{}\n{}", with("01"), line(3, ""))).0, ['P', '-', '-']);
    let spline = format!("{first}\nSPLINE WITH $EX_AX_IGNORE='B10'\n{after}\nENDSPLINE\n{}", line(4, ",E1 1.0,E2 7.0"));
    assert_eq!(editable(&program(&spline)), ['P', '-', 'P']);
    let alone = Reason::AsynchronousAxis;
    assert_eq!(all(&format!("$ASYNC_AXIS='B1'\n{first}\n$ASYNC_AXIS=0\n{after}")), (vec!['-', 'P'], vec![alone]));
    assert_eq!(all(&format!("$ASYNC_AXIS=$ASYNC_AXIS B_AND 'B110'\n{first}")).0, ['-'], "what it was is not known");
    assert_eq!(all(&format!("$ASYNC_AXIS='B1'\n{}", line(1, ""))).0, ['P'], "no axis is named");
    assert_eq!(
        all(&format!("OTHER()\n$IPO_MODE=#BASE\nBAS(#INITMOV,0)\n$BASE=$WORLD\n$TOOL=$NULLFRAME\n{first}")).0,
        ['P']
    );
}

#[test]
fn an_arc_turns_as_the_program_says() {
    let point = |x: u8, y: u8| format!("{{X {x}.0,Y {y}.0,Z 3.0,A 0.0,B 0.0,C 0.0}}");
    let arc = format!("CIRC {},{}", point(2, 1), point(3, 0));
    let all = |set: &str| program(&format!("LIN {}\n{set}\n{arc}\nLIN {}", point(1, 0), point(9, 9)));
    let run = |set: &str| editable(&all(set));
    let turns = |p: &Program| p.targets.iter().map(|target| target.arc_turn).collect::<Vec<_>>();
    let with_path = [None, Some(ArcTurn::WithPath), Some(ArcTurn::WithPath), None];
    assert_eq!(run(""), ['P', 'p', 'P', 'P']);
    assert_eq!((run("$CIRC_TYPE=#BASE"), turns(&all("$CIRC_TYPE=#BASE"))), (vec!['P', 'p', 'P', 'P'], vec![None; 4]));
    assert_eq!((run("$CIRC_TYPE=#PATH"), &turns(&all("$CIRC_TYPE=#PATH"))[..]), (run(""), &with_path[..]));
    assert_eq!(run("IF $IN[1] THEN\n$CIRC_TYPE=#PATH\nENDIF"), ['P', '-', '-', 'P'], "lines are as they were");
    // How the wrist turns is not in the text. A constant orientation turns with the path, so that of the line after it is unknown.
    let and = |kind: &str| format!("$ORI_TYPE=#{kind}\n$CIRC_TYPE=#PATH");
    assert_eq!((run(&and("JOINT")), reasons(&all(&and("JOINT")))), (vec!['P', '-', '-', 'P'], vec![Reason::ArcTurns]));
    assert_eq!(
        (run("$ORI_TYPE=#CONSTANT"), run(&and("CONSTANT"))),
        (vec!['P', 'p', 'p', 'p'], vec!['P', '-', '-', '-'])
    );
    // One of two ways leads to the arc: it is known how it turns evenly, and not how far the path turns it.
    let either = format!("IF $IN[1] THEN\nLIN {}\nENDIF", point(0, 9));
    assert_eq!(run(&either), ['P', 'P', 'p', 'P', 'P']);
    assert_eq!(run(&format!("{either}\n$CIRC_TYPE=#PATH")), ['P', 'P', '-', '-', 'P']);
    assert_eq!(run("$CIRC_MODE.AUX_PT.ORI=#INTERPOLATE"), ['P', '-', '-', 'P']);
    let again =
        format!("$CIRC_TYPE=#PATH\nBAS(#INITMOV,0)\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\nLIN {}", point(1, 0));
    assert_eq!(run(&again), ['P', 'P', 'p', 'P', 'P']);
    let act = |kind: &str| format!("LDAT_ACT={{VEL 2.0,ORI_TYP #VAR,CIRC_TYP #{kind}}}\nBAS(#CP_DAT)");
    assert_eq!((turns(&all(&act("BASE"))), &turns(&all(&act("PATH")))[..]), (vec![None; 4], &with_path[..]));
    let with = format!("LIN {}\nS{arc} WITH $CIRC_TYPE=#PATH\nS{arc}", point(1, 0));
    let spline = program(&with);
    assert_eq!(editable(&spline), ['P', 'p', 'P', 'p', 'P']);
    let one = [None, Some(ArcTurn::WithPath), Some(ArcTurn::WithPath), None, None];
    assert_eq!(turns(&spline), one, "for one motion");
}

#[test]
fn speeds_that_something_else_may_change_are_unknown() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let feeds = |body: &str| program(body).targets.iter().map(|t| t.feed_mm_s).collect::<Vec<_>>();
    let head = "$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.02";
    for act in ["$VEL.CP=0.1", "$OV_PRO=10"] {
        let trigger = format!("{head}\nTRIGGER WHEN DISTANCE=0 DELAY=10 DO {act}\n{line}\n{line}");
        assert_eq!(feeds(&trigger), [None, None], "{act}");
        let interrupt = format!("INTERRUPT DECL 5 WHEN $IN[1] DO isr()\n{head}\n{line}\nEND\nDEF isr()\n{act}");
        assert_eq!(feeds(&interrupt), [None], "{act}");
    }
    let spline = line.replace("LIN", "SLIN");
    let timed = format!("{head}\nSPLINE\n{spline}\nTIME_BLOCK START\n{spline}\nTIME_BLOCK END=0.2\nENDSPLINE\n{line}");
    assert_eq!(feeds(&timed), [Some(20.0), None, Some(20.0)]);
}

#[test]
fn tables_that_the_program_assigns_have_the_values_of_the_last_run() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let frame = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let uses = format!("BAS(#INITMOV,0)\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[2]\n{line}");
    assert_eq!(reasons(&program(&uses)), []);
    assert_eq!(reasons(&program(&format!("BASE_DATA[2]={frame}\n{uses}"))), []);
    assert_eq!(reasons(&program(&format!("{uses}\nBASE_DATA[16]={frame}"))), []);
    for last in [
        format!("BASE_DATA[2]={frame}"),
        "BASE_DATA[2].Z=BASE_DATA[2].Z-1.0".to_owned(),
        format!("n=2\nBASE_DATA[n]={frame}"),
    ] {
        assert_eq!(reasons(&program(&format!("{uses}\n{last}"))), [Reason::Base], "{last}");
    }
}

#[test]
fn nothing_is_inserted_before_a_motion_to_which_a_stop_refers() {
    let line = "SLIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let p = program(&format!(
        "$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n{line}\nSTOP WHEN PATH=-10 IF $IN[1]\n{line}\n{line}"
    ));
    assert_eq!(p.insertions_refused(&[1, 2]), [Some(Reason::Triggered), None]);
}

#[test]
fn interrupts_and_triggers_change_at_any_moment_what_they_change() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let p = program(&format!(
        "INTERRUPT DECL 5 WHEN $IN[1] DO isr()\n$BASE=BASE_DATA[1]\n{line}\nEND\nDEF isr()\n$BASE=BASE_DATA[2]"
    ));
    assert_eq!(reasons(&p), [Reason::BaseAnyMoment]);
    // What BAS reads may change between its assignment and the call.
    for (act, edited) in [
        ("FDAT_ACT.BASE_NO=2", vec![]),
        ("FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}", vec![]),
        ("$OUT[3]=TRUE", vec!['P']),
    ] {
        let p = program(&format!(
            "INTERRUPT DECL 5 WHEN $IN[1] DO isr()\nBAS(#INITMOV,0)\nFDAT_ACT={{TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}}\nBAS(#CP_PARAMS,0.1)\n{line}\nEND\nDEF isr()\n{act}"
        ));
        assert_eq!(editable(&p), edited, "{act}");
    }
    let p = program(&format!("GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\nINTERRUPT ON 3\n{line}"));
    assert_eq!(p.targets[0].editable, Editable::Pose);
    let p = program(&format!("TRIGGER WHEN DISTANCE=0 DELAY=0 DO other() PRIO=-1\n{line}"));
    assert!(p.targets.is_empty());
}

#[test]
fn an_interrupt_that_moves_is_reported() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let warnings = |handlers: &str| {
        let p = program(&format!("INTERRUPT DECL 5 WHEN $IN[1] DO isr()\n{line}\nEND\n{handlers}"));
        p.diagnostics.iter().filter(|diagnostic| diagnostic.code == "krl.interrupt-moves").count()
    };
    assert_eq!(warnings("DEF isr()\nBRAKE\nHALT"), 0);
    assert_eq!(warnings(&format!("DEF isr()\nBRAKE\n{line}\nPTP $POS_INT")), 1);
    assert_eq!(warnings("DEF isr()\naway()\nEND\nDEF away()\nLIN_REL {Z 50.0}"), 1, "what it calls moves");
    let twice = format!("DEF isr()\n{line}\nEND\nDEF other()\nINTERRUPT DECL 6 WHEN $IN[2] DO isr()");
    assert_eq!(warnings(&twice), 1, "once");
}

#[test]
fn jumps_leave_what_the_routine_changes_unknown() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let again = format!("{line}\n$BASE=BASE_DATA[2]\nIF $IN[1] THEN\nGOTO again\nENDIF");
    let p = program(&format!("$BASE=BASE_DATA[1]\nagain:\n{again}"));
    assert_eq!(reasons(&p), [Reason::Base]);
    let set_again = program(&format!("again:\n$BASE=BASE_DATA[1]\n{again}"));
    assert_eq!((editable(&set_again), &*set_again.wobjs[0].name), (vec!['P'], "BASE_DATA[1]"));
    // Rounds that a known condition counts are run one by one.
    let counted = program(&format!(
        "INT i\ni=1\n$BASE=BASE_DATA[1]\nnext:\nIF i>1 THEN\n$BASE=BASE_DATA[3]\nENDIF\n{line}\ni=i+1\nIF i<3 THEN\nGOTO next\nENDIF"
    ));
    let bases: Vec<&str> =
        counted.targets.iter().map(|target| &*counted.wobjs[usize::from(target.wobj)].name).collect();
    assert_eq!((bases, reasons(&counted)), (vec!["BASE_DATA[1]", "BASE_DATA[3]"], vec![]));
}

const POINT: &str = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";

/// The first lines of what a KRC writes, with the packages for welding, grippers and spot guns.
#[test]
fn the_folds_of_the_controller_itself_leave_tool_and_base_known() {
    let forms = "IF A10_OPTION==#ACTIVE THEN\nINTERRUPT DECL 4 WHEN $CYCFLAG[3]==FALSE DO A10 (#APPL_ERROR )\nA10 (#APPL_INI )\nENDIF\n\
                 IF A20_OPTION==#ACTIVE THEN\nINTERRUPT DECL 5 WHEN $CYCFLAG[4]==FALSE DO A20 (#APPL_ERROR )\nENDIF\n\
                 IF H70_OPTION==#ACTIVE THEN\nINTERRUPT DECL 15 WHEN $MEAS_PULSE[1] DO H70 (6,CD0 )\nH70 (1,CD0 )\nENDIF\n\
                 USERSPOT(#INIT)\nUSER_GRP(0,DUMMY,DUMMY,GDEFAULT)\n";
    let ini = format!(
        "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\nINTERRUPT ON 3\nBAS (#INITMOV,0 )\n{forms}"
    );
    let act = "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}\nBAS(#CP_PARAMS,0.1)\n";
    let p =
        program(&format!("{ini}{act}LOOP\nWAIT FOR ($IN[1] OR NOT ($IN[2] AND ($IN[3])))\nLIN {POINT}\nEXIT\nENDLOOP"));
    assert_eq!((editable(&p), &p.diagnostics[..]), (vec!['P'], &[][..]));
    assert_eq!((&*p.tools[0].name, &*p.wobjs[0].name), ("TOOL_DATA[1]", "BASE_DATA[2]"));
    for named in ["$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[2]", "BAS(#TOOL,1)\nBAS(#BASE,2)"] {
        assert_eq!(editable(&program(&format!("{ini}{named}\nLIN {POINT}"))), ['P'], "{named}");
    }
    // A search does correct frames, and so does what the program switches on itself.
    assert!(editable(&program(&format!("{ini}H70 (2,CD1)\n{act}LIN {POINT}"))).is_empty());
    assert!(editable(&program(&format!("{ini}BASE_CORR_ON=TRUE\n{act}LIN {POINT}"))).is_empty());
    // What a file says of a routine counts more than its name.
    let own = format!(
        "GLOBAL INTERRUPT DECL 3 WHEN $IN[1] DO IR_STOPM ( )\n{act}LIN {POINT}\nEND\nDEF IR_STOPM ( )\n$BASE=BASE_DATA[7]"
    );
    assert!(editable(&program(&own)).is_empty());
}

#[test]
fn a_routine_that_is_in_no_file_may_change_the_tables_of_frames() {
    let after = |set: &str| editable(&program(&format!("other()\n$TOOL=$NULLFRAME\n{set}\nLIN {POINT}")));
    assert!(after("$BASE=BASE_DATA[1]").is_empty());
    assert!(after("BAS(#BASE,1)").is_empty());
    assert_eq!(
        after(&format!("$IPO_MODE=#BASE\n$ORI_TYPE=#VAR\nBASE_DATA[1]={POINT}\n$BASE=BASE_DATA[1]")),
        ['P'],
        "known again"
    );
    assert!(
        after(&format!("$IPO_MODE=#BASE\n$ORI_TYPE=#VAR\nBASE_DATA[1]={POINT}\n$BASE=BASE_DATA[2]")).is_empty(),
        "another"
    );
    for call in ["other()", "INTERRUPT DECL 4 WHEN $IN[1] DO other()"] {
        let warning = program(call).diagnostics.remove(0);
        assert!(warning.message.starts_with("`OTHER` is not in the files") && warning.line == 2, "{warning:?}");
    }
    let p = program("other()");
    assert!(p.diagnostics[0].help.as_ref().is_some_and(|help| help.contains("[controller] harmless")));
}

#[test]
fn a_trigger_that_sets_frames_keeps_what_follows() {
    for set in
        ["$BASE=BASE_DATA[2]", "$TOOL=TOOL_DATA[2]", "$IPO_MODE=#TCP", "$BASE.X=5.0", "$ROBROOT.X=1.0", "ARCSWITCH x"]
    {
        let body = format!("LIN {POINT}\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO {set}\nLIN {POINT}");
        let p = program(&body);
        assert_eq!(editable(&p)[0], 'P', "{set}");
        assert!(editable(&p)[1..].iter().all(|letter| *letter == '-') && p.kept.len() == 1, "{set}: {:?}", p.kept);
    }
    let output = program(&format!("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE PRIO=-1\nLIN {POINT}"));
    assert_eq!(editable(&output), ['P']);
}

#[test]
fn an_arc_in_another_frame_than_the_motion_before_stays() {
    let arc = format!("CIRC {},{}", POINT.replace("X 1.0", "X 2.0"), POINT.replace("X 1.0", "X 3.0"));
    let run = |set: &str| editable(&program(&format!("$BASE=BASE_DATA[1]\nLIN {POINT}\n{set}\n{arc}\n{arc}")));
    assert_eq!(run("$BASE=BASE_DATA[2]"), ['P', '-', '-', 'p', 'P']);
    assert_eq!(run("$TOOL=TOOL_DATA[2]"), ['P', '-', '-', 'p', 'P']);
    assert_eq!(run("$BASE=BASE_DATA[1]"), ['P', 'p', 'P', 'p', 'P'], "the same again");
    assert_eq!(run("PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}"), ['P', '-', '-', '-', 'p', 'P']);
}

/// Each round of the loop gives the routine other data of its own.
#[test]
fn data_that_a_trigger_sets_end_with_their_routine() {
    let body = |param: &str, by: &str| {
        format!(
            "INT n\nn=1\nLOOP\nsub({by})\nLIN {POINT}\nENDLOOP\nEND\nDEF sub(p:{param})\nINT k\nk=1\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO k=2\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO p=2"
        )
    };
    assert_eq!(editable(&program(&body("IN", "n"))), ['P']);
    // The caller's own variable is changed at any moment from there on.
    let lent = format!(
        "$BASE=BASE_DATA[1]\nINT n\nn=1\nsub(n)\nn=1\nIF n==2 THEN\n$BASE=BASE_DATA[2]\nENDIF\nLIN {POINT}\nEND\nDEF sub(p:OUT)\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO p=2"
    );
    assert!(editable(&program(&lent)).is_empty());
}

/// More work than a program is worth: refused, not run for ever.
#[test]
fn a_loop_whose_condition_is_a_constant_never_ends() {
    // Whatever a routine that no file has may change, TRUE is no data.
    let p = program(
        "$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\nLIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\nWHILE TRUE\nN=N+1\nFOO()\nENDWHILE",
    );
    assert_eq!((positions(&p), editable(&p)), (vec![[1.0, 2.0, 3.0]], vec!['P']));
}

#[test]
fn brackets_and_signs_without_number_are_read_to_their_end() {
    for part in ["{", "(", "-", "NOT ", "A[", "F(", "{X ", "{A{", "1+", "A:", "TRIGGER WHEN PATH=0 DO "] {
        let starts = [("", 1), ("A=", 1), ("LIN ", 2), ("LIN {X 1} WITH $VEL=", 2), ("WAIT FOR ", 1), ("RETURN ", 0)];
        for (start, motions) in starts {
            let p = program(&format!("{start}{}\nLIN {POINT}", part.repeat(20_000)));
            assert_eq!(p.motion_targets(), motions, "{start}{part}");
        }
    }
}

#[test]
fn loops_within_loops_within_loops_end() {
    let depth = 60;
    let open: String =
        (0..depth).map(|i| format!("LOOP\nr{i}=r{}\nIF $IN[1] THEN\nEXIT\nENDIF\n", (i + 7) % depth)).collect();
    let text = format!("DEF a()\n{open}{}LIN {POINT}\nEND\n", "ENDLOOP\n".repeat(depth));
    let begun = std::time::Instant::now();
    drop(read(vec![Source::new("a.src", text)], Vec::new()));
    assert!(begun.elapsed().as_secs() < 60);
}

#[test]
fn positions_that_no_controller_loads_are_faults() {
    for body in [
        "LIN {X 10.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,X 15.0}",
        "LIN {X 10.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,Q 1.0}",
        "XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nXP2=XP1\nLIN XP1 LIN XP2",
        "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0},{X 2.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}",
        "SLIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0} WITH $VEL.CP=0.1 C_SPL LIN",
    ] {
        let p = program(body);
        assert_eq!((p.faults().len(), p.targets.len()), (1, 0), "{body}: {:?}", p.kept);
    }
    for body in [
        "LIN {E6POS: X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 2,T 3,E1 0.0} C_DIS C_DIS",
        "SLIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0} WITH $VEL.CP=0.1,$APO.CDIS=5 C_SPL",
        "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0} C_PTP C_DIS",
    ] {
        let p = program(body);
        assert_eq!((p.faults().len(), p.targets.len()), (0, 1), "{body}: {:?}", p.kept);
    }
}

#[test]
fn frames_of_a_missing_configuration_are_reported() {
    let src = format!(
        "DEF a()\nFDAT_ACT=FHOME\nBAS(#PTP_PARAMS,100)\nPTP XHOME\nSPTP XHOME WITH $TOOL=STOOL2(FHOME)\nLIN {POINT}\nEND\n"
    );
    let p = program_of(&[("a.src", &src)], &[]);
    let codes: Vec<&str> = p.diagnostics.iter().map(|diagnostic| diagnostic.code).collect();
    assert_eq!((codes, editable(&p).len()), (vec!["krl.frames-elsewhere"], 0));
    let config = "DEFDAT $CONFIG\nDECL FDAT FHOME={TOOL_NO 2,BASE_NO 1,IPO_FRAME #BASE}\nE6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\nENDDAT\n";
    let p = program_of(&[("a.src", &src)], &[("$config.dat", config)]);
    assert_eq!((&p.diagnostics[..], editable(&p)), (&[][..], vec!['-', '-', 'P']));
    assert_eq!((&*p.tools[0].name, &*p.wobjs[0].name), ("TOOL_DATA[2]", "BASE_DATA[1]"));
}

#[test]
fn a_statement_that_may_fail_leaves_what_it_sets_unknown() {
    let p = program(&format!(
        "$BASE=BASE_DATA[1]\nON_ERROR_PROCEED\n$BASE=BASE_DATA[2]\nLIN {POINT}\n$BASE=BASE_DATA[2]\nLIN {POINT}"
    ));
    assert_eq!((reasons(&p), editable(&p)), (vec![Reason::Base], vec!['P']));
}

/// Who leaves components out has them from the motion before, whichever that was; all others leave it alone.
#[test]
fn the_last_motion_of_a_branch_or_a_round_is_edited() {
    let other = POINT.replace("X 1.0", "X 9.0");
    let full = |after: &str| {
        editable(&program(&format!(
            "IF $IN[1] THEN\nLIN {POINT}\nENDIF\nLOOP\nLIN {other}\nIF $IN[1] THEN\nEXIT\nENDIF\nENDLOOP\n{after}"
        )))
    };
    assert_eq!(full(""), ['P', 'P']);
    assert_eq!(full(&format!("LIN {POINT}")), ['P', 'P', 'P']);
    let part = format!("IF $IN[1] THEN\nLIN {POINT}\nELSE\nLIN {other}\nENDIF\nLIN {{Z 50.0}}\nLIN {POINT}");
    assert_eq!(editable(&program(&part)), ['-', '-', 'P']);
}

#[test]
fn marks_follow_the_run() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let p = program(&format!("; deflex air\n{line}\n;deflex cut\n{line}"));
    assert_eq!(p.targets.iter().map(|t| t.mark).collect::<Vec<_>>(), [Some(Mark::Air), Some(Mark::Cut)]);
}

#[test]
fn a_counted_loop_runs_round_by_round_where_an_unknown_condition_may_leave_it() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    for leave in ["EXIT", "RETURN"] {
        let p = program(&format!(
            "INT i\nFOR i=1 TO 2\n$BASE=BASE_DATA[i]\n{line}\nIF $IN[1] THEN\n{leave}\nENDIF\nENDFOR\n{line}"
        ));
        let bases: Vec<&str> = p.wobjs.iter().map(|wobj| &*wobj.name).collect();
        assert_eq!(bases, ["BASE_DATA[1]", "BASE_DATA[2]"], "{leave}");
        // Where EXIT leaves it, either base may be in force after it.
        let (targets, kept) = if leave == "EXIT" { (2, vec![Reason::Base]) } else { (3, vec![]) };
        assert_eq!((p.targets.len(), reasons(&p)), (targets, kept), "{leave}");
    }
}

#[test]
fn motions_that_nothing_reaches_are_said_to_stay() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    for body in ["LOOP\nGO\nENDLOOP\nGO", "GO\nRETURN\nGO", "GO\nIF FALSE THEN\nGO\nENDIF", "GOTO m\nGO\nm:\nGO"] {
        let p = program(&body.replace("GO\n", &format!("{line}\n")).replace("\nGO", &format!("\n{line}")));
        assert_eq!((p.targets.len(), reasons(&p)), (1, vec![Reason::NotReached]), "{body}");
    }
}

#[test]
fn endless_loops_are_taken_once() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    for body in
        ["LOOP\nL\nENDLOOP", "WHILE TRUE\nL\nENDWHILE", "REPEAT\nL\nUNTIL $IN[3]", "WHILE i<3\ni=i+0\nL\nENDWHILE"]
    {
        let p = program(&format!(
            "INT i\ni=1\n{}",
            body.replace('L', "#").replace("\n#\n", &format!("\n{line}\n")).replace('#', "L")
        ));
        assert_eq!(p.targets.len(), 1, "{body}");
    }
    let p = program(&format!("INT i\ni=1\nWHILE i<=3\n{line}\ni=i+1\nENDWHILE"));
    assert_eq!(p.targets.len(), 3);
}

/// Each was a wrong program without a word: found by running random programs (`tests/suite/program/krl_sound`).
#[test]
fn motions_stay_where_another_run_could_make_them_others() {
    let line = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    for (what, body) in [
        ("a variable that has two names", "FRAME f\nf=L\ntwo(f, f)\nEND\nDEF two(p:OUT, q:OUT)\np.X=7.0\nLIN q"),
        ("an INT", "INT i\ni=1\nLIN {X i,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}"),
        (
            "a TRIGGER in a routine",
            "sub()\nLIN L\nEND\nDEF sub()\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO later()\nEND\nDEF later()\n$BASE=BASE_DATA[2]",
        ),
        ("a routine that calls itself", "r()\nEND\nDEF r()\nLIN L\n$BASE=BASE_DATA[2]\nIF $IN[1] THEN\nr()\nENDIF"),
        (
            "RESUME",
            "INTERRUPT DECL 3 WHEN $IN[1] DO isr()\nsub()\nLIN L\nEND\nDEF sub()\n$BASE=BASE_DATA[2]\nHALT\n$BASE=BASE_DATA[1]\nEND\nDEF isr()\nBRAKE\nRESUME",
        ),
        ("a statement that is not known, a round before", "LOOP\nLIN L\nARCSWITCH $BASE\nENDLOOP"),
        (
            "the same in a function",
            "REAL r\nr=f()\nLIN L\nEND\nDEFFCT REAL f()\nARCSWITCH $BASE\nRETURN 1.0\nENDFCT\nDEF z()",
        ),
        (
            "OR and AND without brackets",
            "$BASE=BASE_DATA[1]\nIF TRUE OR FALSE AND FALSE THEN\n$BASE=BASE_DATA[2]\nENDIF\nLIN L",
        ),
        (
            "a handler's own motion",
            "INTERRUPT DECL 3 WHEN $IN[1] DO isr()\n$BASE=BASE_DATA[1]\nisr()\n$BASE=BASE_DATA[2]\nEND\nDEF isr()\nLIN L",
        ),
    ] {
        let p = program(
            &body
                .replace("L\n", &format!("{line}\n"))
                .replace("=L", &format!("={line}"))
                .replace(" L", &format!(" {line}")),
        );
        assert!(p.targets.iter().all(|t| matches!(t.editable, Editable::No(_))), "{what}: {:?}", p.targets);
        assert!(!p.kept.is_empty(), "{what}");
        assert_eq!(moved(&p, 0.5)[0], String::from_utf8(p.sources[0].bytes.clone()).unwrap(), "{what}");
    }
}

#[test]
fn a_position_that_may_be_incomplete_holds_the_one_before() {
    let dat = "DEFDAT a\nDECL E6POS XP3={X 1.0,Y 2.0,Z 3.0,A 4.0,B 5.0,C 6.0}\nENDDAT\n";
    let line = "LIN {X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 0.0}";
    let interrupt =
        "INTERRUPT DECL 3 WHEN $IN[9] DO isr()\nINTERRUPT ON 3\nL\nLIN XP3\nEND\nDEF isr()\ns()\nEND\nDEF s()\n";
    let of = |body: &str| {
        let src = format!("DEF a()\n{}\nEND\n", body.replace("L\n", &format!("{line}\n")));
        program_of(&[("a.src", &src), ("a.dat", dat)], &[])
    };
    for (what, body) in [
        ("an interrupt", &*format!("{interrupt}XP3={{X 5.0}}")),
        ("another branch", "POS p\nIF $IN[1] THEN\np=XP3\nELSE\np={X 5.0}\nENDIF\nL\nLIN p"),
        ("a function", "L\nLIN f()\nEND\nDEFFCT POS f()\nPOS p\np.X=5.0\nRETURN p"),
        ("a motion of a function", "REAL r\nL\nr=f()\nEND\nDEFFCT REAL f()\nLIN {X 5.0,Y 6.0,Z 7.0}\nRETURN 1.0"),
        ("a trigger", "POS p\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO p.X=5.0\nL\nLIN p"),
        ("a circle with an angle", "L\nCIRC XP3,{X 5.0},CA 90.0"),
        ("frames that may stay as they are", "L\nBAS(#INITMOV,0)\nLIN {Z 50.0}"),
        ("a base in which the robot stands elsewhere", "L\n$BASE=BASE_DATA[1]\nLIN {Z 50.0}"),
        ("parts set in a loop", "POS p\nWHILE $IN[1]\np.X=5.0\np.Y=6.0\np.Z=7.0\nL\nLIN p\np=XP3\nENDWHILE"),
        (
            "parts set of what one branch sets",
            "POS p\nIF $IN[1] THEN\np=XP3\nENDIF\np.X=5.0\np.Y=6.0\np.Z=7.0\nL\nLIN p",
        ),
        ("parts set of a point of another file", "XP9.X=5.0\nXP9.Y=6.0\nXP9.Z=7.0\nL\nLIN XP9"),
    ] {
        let p = of(body);
        assert_eq!(p.targets[0].editable, Editable::No(Reason::ReadByOthers), "{what}");
        let texts = moved(&p, 0.5);
        assert_eq!(texts[0], String::from_utf8(p.sources[0].bytes.clone()).unwrap(), "{what}");
    }
    for (what, body) in [
        ("a complete position", &*format!("{interrupt}XP3={{X 5.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}")),
        ("a part of a complete position", &*format!("{interrupt}XP3.X=5.0")),
        ("a point of another file", "L\nLIN XP9"),
        (
            "the load of a tool",
            "$LOAD={M 1.0,CM {X 0.0,Y 0.0,Z 9.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.1}}\nL\nLIN XP9",
        ),
        ("an aggregate that is no data", "L\nLIN XP9\nLIN {X 5.0}"),
    ] {
        assert_eq!(of(body).targets[0].editable, Editable::Pose, "{what}");
    }
}

#[test]
fn numbers_put_where_what_stands_is_not_known_stay() {
    let line = "LIN {X r1,Y 0.0,Z 5.0,A 0.0,B 0.0,C 0.0}";
    let full = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    for (what, body) in [
        ("a component", format!("m:\nXP1.X=r1\nIF $IN[1] THEN\nGOTO m\nENDIF\nCIRC XP1,{full}")),
        ("an INT", format!("INT i\ni=r1\nIF i>2 THEN\nLIN {full}\nENDIF")),
    ] {
        let src = format!("DEF a()\n{line}\n{body}\nEND\n");
        let dat = format!("DEFDAT a\nDECL E6POS XP1={full}\nDECL REAL r1=2.5\nENDDAT\n");
        let p = program_of(&[("a.src", &src), ("a.dat", &dat)], &[]);
        assert_eq!(moved(&p, 0.5)[1], dat, "{what}");
        assert_eq!(p.targets[0].editable, Editable::No(Reason::ReadByOthers), "{what}");
    }
}

#[test]
fn what_stands_after_a_return_is_read_where_a_label_leads_there() {
    let line = "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let p = program(&format!("IF $IN[1] THEN\nGOTO far\nENDIF\n{line}\nRETURN\nfar:\n{line}"));
    assert_eq!(p.targets.len(), 2);
}

#[test]
fn a_frame_takes_no_axes() {
    let body = "FRAME f\nLIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0,E1 100.0}\nf={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,E1 850.0}\nLIN f";
    let p = program(body);
    assert_eq!(p.targets[1].external.as_ref().unwrap().written[0], Some(100.0));
}

#[test]
fn files_that_are_none_are_refused() {
    let code = |text: &str| read(vec![Source::new("a.src", text)], Vec::new()).unwrap_err()[0].code;
    assert_eq!(code("LIN {X 1}\n"), "krl.no-routine");
    assert_eq!(code("DEF a()\nIF $IN[1] THEN\n"), "krl.truncated");
    let calls: String = (0..24).map(|k| format!("s{k}()\ns{k}()\nEND\nDEF s{k}()\n")).collect();
    assert_eq!(code(&format!("DEF a()\n{calls}END\n")), "krl.endless");
    // Rounds that are too many are one.
    assert_eq!(program("INT i,j\nFOR i=1 TO 2000\nFOR j=1 TO 2000\nENDFOR\nENDFOR").targets.len(), 0);
}

#[test]
fn what_stays_holds_its_numbers_for_others() {
    let src = "DEF a()\nLIN XP1\n$IPO_MODE=#TCP\nLIN XP1\nEND\n";
    let dat = "DEFDAT a\nDECL E6POS XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";
    let p = program_of(&[("a.src", src), ("a.dat", dat)], &[]);
    assert!(p.targets.iter().all(|t| matches!(t.editable, Editable::No(_))));
    assert_eq!(moved(&p, 0.5)[1], dat);
}

#[test]
fn numbers_that_last_are_unknown_at_the_start() {
    let src = "DEF a()\nIF first THEN\n$BASE=BASE_DATA[1]\nELSE\n$BASE=BASE_DATA[2]\nENDIF\nfirst=FALSE\nLIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nEND\n";
    let dat = "DEFDAT a\nDECL BOOL first=TRUE\nENDDAT\n";
    let p = program_of(&[("a.src", src), ("a.dat", dat)], &[]);
    assert_eq!(reasons(&p), [Reason::Base]);
}

#[test]
fn external_axes_are_in_use_where_one_is_not_at_zero() {
    let line = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0";
    let p = program(&format!("LIN {line},E1 0.0,E2 850.0}}\nLIN {line}}}"));
    let written = |i: usize| p.targets[i].external.as_ref().unwrap().written;
    assert_eq!((written(0), written(1)), ([Some(0.0), Some(850.0), None, None, None, None], written(0)));
    let rests = program(&format!("LIN {line},E1 0.0,E2 0.0}}"));
    assert!(rests.targets[0].external.as_ref().unwrap().is_at_rest());
    assert_eq!(program(&format!("LIN {line}}}")).targets[0].external, None);
}

#[test]
fn a_routine_that_only_reads_what_it_is_lent_leaves_it_known() {
    let routine = "DEF PATH(L[]:OUT,N:IN)\nE6POS L[]\nINT N,I\nFOR I=1 TO N\nLIN L[I] C_DIS\nENDFOR\nEND\n\
                   DEF CUT(PT)\nE6POS PT\nLIN PT\nEND\n";
    let points = "DEFDAT A\nDECL E6POS XA[2]\nXA[1]={X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n\
                  XA[2]={X 2.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nDECL E6POS XP={X 3.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";
    let read = |more: &str| {
        let source = format!("DEF a( )\nPATH(XA[],2)\nCUT(XP)\nEND\n{routine}{more}");
        program_of(&[("a.src", &source), ("a.dat", points)], &[])
    };
    let known = read("");
    assert_eq!(positions(&known).iter().map(|at| at[0]).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    assert!(known.targets.iter().all(|target| target.editable == Editable::Pose), "{:?}", known.targets);
    // A routine that assigns its parameter, or passes it on to one that does.
    let assigned =
        read("DEF SET(PT)\nE6POS PT\nPT.Z=5.0\nEND\nDEF ON(PT)\nE6POS PT\nSET(PT)\nEND\nDEF B()\nON(XP)\nEND\n");
    assert_eq!(positions(&assigned).len(), 2);
}

#[test]
fn quotients_of_reals_are_known_and_those_of_whole_numbers_are_not() {
    let speeds = |value: &str| {
        let body = format!("DECL REAL F\nDECL INT N\nF=3000\nN=3000\n$VEL.CP={value}\nLIN {{X 1,Y 0,Z 0,A 0,B 0,C 0}}");
        program(&body).targets[0].feed_mm_s
    };
    for known in ["50.0/1000.0", "F/60000", "N/60000.0", "3000/6E4", "F/60.0/1000"] {
        assert!(speeds(known).is_some_and(|feed| (feed - 50.0).abs() < 1e-9), "{known}: {:?}", speeds(known));
    }
    assert_eq!([speeds("N/60000"), speeds("50/0.0"), speeds("(N/7)*1.0")], [None; 3]);
}

/// A GLOBAL routine that nothing in the files calls is there for other programs: a point in what it calls would be driven to there, too.
#[test]
fn nothing_is_inserted_in_routines_that_also_run_elsewhere() {
    let position = "{X 200.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}";
    let sub = "DEF SUB(Q:IN)\nE6POS Q\nLIN Q\nEND\n";
    let text = |other: &str| {
        format!("DEF a()\nLIN {{X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}}\nSUB({position})\nEND\n{sub}{other}")
    };
    let refused = |other: &str| program_of(&[("a.src", &text(other))], &[]).insertions_refused(&[1]);
    assert_eq!(refused(""), [None]);
    assert_eq!(refused(&format!("GLOBAL DEF SVC()\nSUB({position})\nEND\n")), [Some(Reason::RunsElsewhere)]);
    let through = format!("GLOBAL DEF SVC()\nMID()\nEND\nDEF MID()\nSUB({position})\nEND\n");
    assert_eq!(refused(&through), [Some(Reason::RunsElsewhere)]);
}

#[test]
fn what_a_global_routine_without_a_caller_calls_is_kept() {
    let cut = "DEF CUT()\nLIN {X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nEND\n";
    let kept = |other: &str| {
        let text = format!("DEF a()\n$BASE={{X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}\nCUT()\nEND\n{cut}{other}");
        program_of(&[("a.src", &text)], &[]).targets[0].editable
    };
    let service = "DEF SVC()\n$BASE={X 9.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nCUT()\nEND\n";
    assert_eq!(kept(&format!("GLOBAL {service}")), Editable::No(Reason::RunsAtAnyMoment));
    // Without GLOBAL no other file can call it.
    assert_eq!(kept(service), Editable::Pose);
}

#[test]
fn an_approach_above_a_point_goes_along_with_it() {
    let p = program(
        "DECL E6POS XT\n$BASE=BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.02\nXP={X 10.0,Y 5.0,Z 3.0,A 0.0,B 0.0,C 180.0}\n\
         XT=XP\nXT.Z=XT.Z+50-0.5\nLIN XT\nLIN XP\nXT=XP\nXT.Z=XP.Z*2\nXT.X=40.0-XP.X\nLIN XT",
    );
    assert_eq!(positions(&p), [[10.0, 5.0, 52.5], [10.0, 5.0, 3.0], [30.0, 5.0, 6.0]]);
    let editable: Vec<_> = p.targets.iter().map(|target| target.editable).collect();
    let held = Editable::No(Reason::ReadByOthers);
    // The last position is no sum of a number in the text and an offset.
    assert!(editable.iter().all(|editable| *editable == held), "{editable:?}");
    let p = program(
        "DECL E6POS XT\n$BASE=BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.02\nXP={X 10.0,Y 5.0,Z 3.0,A 0.0,B 0.0,C 180.0}\n\
         XT=XP\nXT.Z=XT.Z+50-0.5\nLIN XT\nLIN XP",
    );
    assert!(p.targets.iter().all(|target| target.editable == Editable::Pose), "{:?}", p.kept);
    let change = |position_mm| Some(Change { position_mm, quat: None, conf: None, external: None });
    let changes = [change([10.25, 5.0, 52.0]), change([10.25, 5.0, 3.5])];
    let air = RewriteOptions { air: &[true, false], ..RewriteOptions::default() };
    let rewritten = p.rewrite(&changes, &[], &air);
    assert_eq!((rewritten.written[0].0, rewritten.written[1].0), ([10.25, 5.0, 53.0], [10.25, 5.0, 3.5]));
    assert_eq!((&rewritten.along[..], rewritten.kept.len()), (&[0][..], 0));
    let text = String::from_utf8(applied(&p.sources[0].bytes, &rewritten.edits[0])).unwrap();
    assert!(text.contains("XP={X 10.250,Y 5.0,Z 3.500,") && text.contains("XT.Z+50-0.5"), "{text}");
    // Two cuts at different offsets from one number need the same correction.
    let same = p.rewrite(&[change([10.0, 5.0, 52.75]), change([10.0, 5.0, 3.25])], &[], &RewriteOptions::default());
    assert_eq!((same.kept.len(), same.written[0].0), (0, [10.0, 5.0, 52.75]));
    let other = p.rewrite(&[change([10.0, 5.0, 52.75]), change([10.0, 5.0, 3.5])], &[], &RewriteOptions::default());
    assert_eq!(other.kept.iter().map(|kept| kept.1).collect::<Vec<_>>(), [Reason::SharedNumbers; 2]);
}

#[test]
fn a_position_that_the_controller_reads_does_not_use_external_axes() {
    let text = |axis: &str| {
        format!(
            "DEF a()\nGLOBAL INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO found()\n$BASE=BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.02\n\
             LIN XF\nLIN XP\nEND\nDEF found()\nXF=$POS_INT\nEND\n\
             DEFDAT a\nDECL E6POS XF={{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0,E1 {axis}}}\n\
             DECL E6POS XP={{X 2.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0,E1 0.0}}\nENDDAT\n"
        )
    };
    let at_rest = |axis: &str| {
        let p = program_of(&[("a.src", &text(axis))], &[]);
        p.targets.last().unwrap().external.as_ref().unwrap().at_rest[0]
    };
    assert!(at_rest("0.0") && !at_rest("5.0") && !at_rest("rTurn"));
}

#[test]
fn the_next_cycle_begins_with_the_override_that_this_one_left() {
    let feeds = |first: &str, last: &str| {
        let p = program(&format!(
            "$BASE=BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.02\n{first}\nLIN {{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}\n{last}"
        ));
        p.targets[0].feed_mm_s
    };
    assert_eq!(
        (feeds("", ""), feeds("", "$OV_PRO=100"), feeds("", "BAS(#OV_PRO,100)")),
        (Some(20.0), Some(20.0), Some(20.0))
    );
    assert_eq!((feeds("", "$OV_PRO=50"), feeds("", "BAS(#OV_PRO,50)")), (None, None));
    assert_eq!(feeds("$OV_PRO=50", "$OV_PRO=10"), Some(10.0));
}

#[test]
fn a_position_that_takes_components_from_a_relative_motion_holds_the_one_before() {
    let p = program(
        "$BASE=BASE_DATA[2]\n$TOOL=TOOL_DATA[1]\nLIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 180.0}\nLIN_REL {Y 20}\nLIN {Y 60,A 0,B 0,C 180}",
    );
    assert_eq!(p.targets[0].editable, Editable::No(Reason::ReadByOthers));
}

/// The next run begins with the numbers that this one has left in a point: they are not edited for another place.
#[test]
fn what_the_next_run_takes_over_stays() {
    for change in ["XP4=XP3", "XP4.X=XP3.X", "XP4.X=XP3.X+5"] {
        let is_moved = |body: String| with_air(&with_points(&body)).0.contains("XP3={X 150.500");
        assert!(!is_moved(format!("LIN XP4\nLIN XP3\n{change}")), "{change}");
        assert!(is_moved(format!("XP4=XP2\nLIN XP3\n{change}")), "{change}");
    }
}

/// Both branches set a number to the same value: it is known, and neither of the two literals is edited.
#[test]
fn a_number_that_is_the_same_on_all_paths_is_known() {
    let p = program(&format!("$VEL.CP=0.02\nIF $IN[1] THEN\n$VEL.CP=0.02\nENDIF\nLIN {POINT}"));
    assert_eq!((p.targets[0].feed_mm_s, editable(&p)), (Some(20.0), vec!['P']));
    let p = program(&format!("$VEL.CP=0.02\nIF $IN[1] THEN\n$VEL.CP=0.03\nENDIF\nLIN {POINT}"));
    assert_eq!(p.targets[0].feed_mm_s, None);
    let body = "REAL z\nIF $IN[1] THEN\nz=3.0\nELSE\nz=3.0\nENDIF\nLIN {X 1.0,Y 2.0,Z z,A 0.0,B 0.0,C 0.0}";
    let p = program(body);
    assert_eq!((positions(&p), &moved(&p, 0.5)[0]), (vec![[1.0, 2.0, 3.0]], &format!("DEF a( )\n{body}\nEND\n")));
}

/// A taught point states `E1 0.0`, and the points of a post state no axis.
#[test]
fn an_axis_that_stays_at_zero_is_known_after_a_branch() {
    let home = "PTP {A1 0,A2 -90,A3 90,A4 0,A5 60,A6 0,E1 0.0}";
    let p = with_points(&format!("{home}\nLIN {POINT}\nIF $IN[1] THEN\nLIN XP2\nENDIF\nLIN {POINT}"));
    assert_eq!(editable(&p), ['-', 'P', 'P', 'P']);
}

/// The main program of a cell repeats for ever, and runs through its points in a counted loop.
#[test]
fn a_counted_loop_within_an_endless_one_is_followed() {
    let points = "DEFDAT a\nDECL FRAME P[2]\nP[1]={X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nP[2]={X 2.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";
    let body = "DEF a()\nINT i\nLOOP\nFOR i=1 TO 2\nLIN P[i]\nENDFOR\nENDLOOP\nEND\n";
    let p = program_of(&[("a.src", body), ("a.dat", points)], &[]);
    assert_eq!((positions(&p), editable(&p)), (vec![[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], vec!['P', 'P']));
}

/// Both branches begin where the motion before them ends, and the motion after them where either of them ends.
#[test]
fn the_beginning_of_each_branch_is_known() {
    let lin = |x: u32| format!("LIN {{X {x}.0,Y 0.0,Z 0.0,A 0.0,B 90.0,C 0.0}}\n");
    let begins = |body: &str| -> Vec<Option<f64>> {
        program(body).targets.iter().map(|target| target.begins_mm.map(|at| at[0])).collect()
    };
    let branches = format!("IF $IN[1] THEN\n{}ELSE\n{}ENDIF\n{}", lin(2), lin(3), lin(4));
    assert_eq!(begins(&format!("{}{branches}", lin(1))), [None, None, Some(1.0), None]);
    // The motion at L1 comes after the one at L2.
    let back = "GOTO L2\nL1:\nLIN P2\nGOTO L3\nL2:\nLIN P1\nGOTO L1\nL3:"
        .replace("LIN P1\n", &lin(1))
        .replace("LIN P2\n", &lin(2));
    assert_eq!(begins(&format!("IF $IN[1] THEN\nGOTO L3\nENDIF\n{back}")), [Some(1.0), None]);
    // The frame in which it is counted may have changed, or is no base.
    assert_eq!(begins(&format!("{}$BASE=BASE_DATA[2]\n{branches}", lin(1))), [None; 4]);
    let in_tool = format!("$IPO_MODE=#TCP\n{}$IPO_MODE=#BASE\n{branches}", lin(1));
    assert_eq!(begins(&in_tool), [None; 4]);
}

/// The motion at L1 comes after the one at L2, which stands below it in the text: that of the present round, not the one recorded last.
#[test]
fn a_jump_back_begins_at_no_motion_of_an_earlier_round() {
    use deflex_program::Predecessor::{Start, Unknown};
    let lin = |x: &str| format!("LIN {{X {x},Y 0,Z 0,A 0,B 90,C 0}}\n");
    let body = format!(
        "INT n\n{}FOR n=1 TO 2\nIF $IN[1] THEN\nGOTO L3\nENDIF\nGOTO L2\nL1:\n{}GOTO L3\nL2:\n{}GOTO L1\nL3:\nENDFOR",
        lin("9"),
        lin("n+10"),
        lin("n")
    );
    let predecessors = |body: &str| program(body).targets.iter().map(|target| target.predecessor).collect::<Vec<_>>();
    assert_eq!(predecessors(&body), [Start, Unknown, Unknown, Unknown, Unknown]);
    // The first round ends only where the point was reached from which a later round jumps back.
    let body = format!(
        "INT n\n{}FOR n=1 TO 2\nIF $IN[1] THEN\nGOTO L2\nENDIF\nGOTO L4\nL1:\n{}IF n==1 THEN\nGOTO L4\nENDIF\nGOTO L3\nL2:\n{}\
         IF $IN[2] THEN\nGOTO L1\nENDIF\nL3:\nENDFOR\nL4:",
        lin("9"),
        lin("n+10"),
        lin("n")
    );
    let found = predecessors(&body);
    assert_eq!((found.len(), found[3]), (5, Unknown), "{found:?}");
}
