//! Hand-solved URScript programs.

use deflex_lang::Reason;
use deflex_lang::ir::{Path, Program, Switch};
use deflex_lang::run::{Moved, Predecessor, run};
use deflex_lang::shared::{Editable, editable};
use deflex_lang::urscript::{UrScript, read};

struct Ran {
    text: Vec<u8>,
    program: Program,
    motions: Vec<Moved>,
    edits: Vec<Editable>,
}

fn ran(text: &str) -> Ran {
    let program = read(&[text.as_bytes()], 1).unwrap_or_else(|fault| panic!("{fault:?}"));
    let outcome = run(&program, &UrScript).expect("it ends");
    let edits = editable(&outcome);
    Ran { text: text.into(), program, motions: outcome.motions, edits }
}

impl Ran {
    /// The x coordinate of each end, m.
    fn xs(&self) -> Vec<Option<f64>> {
        let x = |motion: &Moved| motion.to.pose().map(|pose| (pose.pose().translation.x * 1e6).round() / 1e6);
        self.motions.iter().map(x).collect()
    }

    /// The token of each x coordinate.
    fn tokens(&self) -> Vec<&str> {
        let token = |motion: &Moved| {
            let id = motion.to.pose().and_then(|pose| pose.affine(0)).expect("a token").token;
            let span = self.program.tokens[id.0 as usize].span;
            std::str::from_utf8(&self.text[span.range()]).expect("a number is text")
        };
        self.motions.iter().map(token).collect()
    }
}

#[test]
fn a_pose_in_a_frame_is_edited_in_its_own_numbers() {
    let ran =
        ran("def Prog():\n  global speed_ms = 0.25\n  ref_frame = p[0.1,0,0,0,0,0]\n  set_tcp(p[0,0,0.1,0,0,0])\n\
         \x20 movej([0,-1.5,1.5,-1.5,-1.5,0],1.2,0.75,0,0)\n\
         \x20 movel(pose_trans(ref_frame,p[.5,-0.2,0.3,0,3.14,0]),1.2,speed_ms,0,0.001)\nend\nProg()\n");
    assert_eq!(ran.xs(), [None, Some(0.6)]);
    assert_eq!(ran.edits, [Editable::No(Reason::Joints), Editable::Pose]);
    assert_eq!(ran.motions[1].speed, Some(0.25));
    assert_eq!(ran.motions[1].blend, Some(0.001));
    assert_eq!((ran.motions[0].from, ran.motions[1].from), (Predecessor::Start, Predecessor::Previous));
    let x = ran.motions[1].to.pose().unwrap().affine(0).unwrap();
    assert_eq!(&ran.text[ran.program.tokens[x.token.0 as usize].span.range()], b".5");
}

#[test]
fn a_frame_that_is_moved_to_as_well_stays() {
    let ran = ran("f = p[0.1,0,0,0,0,0]\nmovel(f)\nmovel(pose_trans(f, p[0.2,0,0,0,0,0]))\n");
    assert_eq!(ran.edits, [Editable::No(Reason::Shared), Editable::Pose]);
}

#[test]
fn both_branches_of_an_unknown_condition_run_and_are_joined() {
    let ran = ran(
        "def f():\n a = p[1,0,0,0,0,0]\n b = p[2,0,0,0,0,0]\n c = p[3,0,0,0,0,0]\n if get_digital_in(0):\n  movel(a)\n  c = b\n else:\n  movel(p[4,0,0,0,0,0])\n end\n movel(c)\nend\n",
    );
    assert_eq!(ran.xs(), [Some(1.0), Some(4.0), None]);
    assert_eq!(ran.edits, [Editable::Pose, Editable::Pose, Editable::No(Reason::Branches)]);
    assert_eq!(
        ran.motions.iter().map(|m| m.from).collect::<Vec<_>>(),
        [Predecessor::Start, Predecessor::Start, Predecessor::Unknown]
    );
}

#[test]
fn a_counted_loop_runs_each_round_and_a_main_loop_once() {
    let ran_ = ran("i = 0\nwhile i < 3:\n movel(p[0.1 * i, 0.2, 0.3, 0, 0, 0])\n i = i + 1\nend\n");
    assert_eq!(ran_.xs(), [Some(0.0), Some(0.1), Some(0.2)]);
    let ran_ = ran("def m():\n while True:\n  movel(p[1,0,0,0,0,0])\n  movel(p[2,0,0,0,0,0])\n end\nend\n");
    assert_eq!(ran_.xs(), [Some(1.0), Some(2.0)]);
    assert_eq!(ran_.edits, [Editable::Pose, Editable::Pose]);
    assert_eq!((ran_.motions[0].from, ran_.motions[1].from), (Predecessor::Unknown, Predecessor::Previous));
}

#[test]
fn a_counted_loop_runs_each_round_within_what_an_unknown_condition_leaves() {
    let count = |to: &str| format!("i = 0\nwhile i < {to}:\nmovel(p[0.1 * i, 0.2, 0.3, 0, 0, 0])\ni = i + 1\nend\n");
    for around in ["if get_standard_digital_in(0):\n", "while get_standard_digital_in(0):\n"] {
        let known = ran(&format!("{around}{}end\nmovel(p[i,0,0,0,0,0])\n", count("3")));
        assert_eq!(known.xs(), [Some(0.0), Some(0.1), Some(0.2), None], "{around}");
        let unknown = ran(&format!("{around}{}end\n", count("get_standard_analog_in(0)")));
        assert_eq!(unknown.xs(), [None], "{around}");
    }
    // Nothing in it ends it.
    let held = ran("done = False\nwhile not done:\nmovel(p[1,0,0,0,0,0])\nend\nmovel(p[2,0,0,0,0,0])\n");
    assert_eq!(held.xs(), [Some(1.0)]);
    // An unknown condition may leave one that is counted.
    let left = ran(
        "i = 0\nwhile i < 3:\nmovel(p[0.1 * i, 0.2, 0.3, 0, 0, 0])\nif get_standard_digital_in(0):\nbreak\nend\ni = i + 1\nend\nmovel(p[i,0,0,0,0,0])\n",
    );
    assert_eq!(left.xs(), [Some(0.0), Some(0.1), Some(0.2), None]);
}

#[test]
fn a_routine_gets_its_arguments_and_what_threads_write_is_unknown() {
    let ran = ran(
        "global n = 0\nthread t():\n while True:\n  n = n + 1\n  sync()\n end\nend\nh = run t()\ndef go(to, up=0.1):\n movel(pose_trans(to, p[0,0,up,0,0,0]))\n movel(to, v=0.1)\nend\ngo(p[1,0,0,0,0,0])\nif n == 0:\n go(p[2,0,0,0,0,0], 0.2)\nend\nmovel(p[n,0,0,0,0,0])\n",
    );
    assert_eq!(ran.xs(), [Some(1.0), Some(1.0), Some(2.0), Some(2.0), None]);
    assert_eq!(ran.edits[4], Editable::No(Reason::Thread));
}

#[test]
fn a_default_value_names_what_is_the_routines_own() {
    let ran = ran("def go(x, y=x):\n movel(p[y,0,0,0,0,0])\nend\ngo(2)\n");
    assert_eq!(ran.xs().len(), 1);
}

#[test]
fn a_routine_that_is_not_given_may_change_globals_and_the_tool() {
    let ran = ran(
        "global g = p[1,0,0,0,0,0]\nset_tcp(p[0,0,0.1,0,0,0])\nmovel(g)\ngripper_open()\nmovel(p[2,0,0,0,0,0])\nset_tcp(p[0,0,0.1,0,0,0])\nmovel(p[3,0,0,0,0,0])\nmovel(g)\n",
    );
    assert_eq!(ran.program.foreign.len(), 1);
    assert!(matches!(ran.edits[0], Editable::No(Reason::Shared)));
    assert_eq!(ran.edits[1..], [Editable::No(Reason::Tool), Editable::Pose, Editable::No(Reason::Foreign)]);
}

#[test]
fn names_of_enclosing_routines_are_not_followed() {
    let ran = ran("def a():\n x = p[1,0,0,0,0,0]\n def b():\n  movel(x)\n end\n b()\n movel(p[2,0,0,0,0,0])\nend\n");
    assert_eq!(ran.edits, [Editable::No(Reason::Scope), Editable::Pose]);
}

#[test]
fn numbers_keep_the_token_and_the_step_that_they_come_by() {
    let ran = ran("x = 0.5\nq = p[x, 0.2, 0.3, 0, 0, 0]\nq[0] = x + 0.25\nmovel(q)\n");
    assert_eq!(ran.xs(), [Some(0.75)]);
    // Both tokens decide the sum: neither is edited.
    assert_eq!(ran.edits, [Editable::No(Reason::Computed)]);
    let ran = self::ran("x = 500\nmovel(p[x / 1000, 0.2, -(0.3), 0, 0, d2r(180)])\n");
    assert_eq!(ran.edits, [Editable::No(Reason::Rounding)]);
    let ran = self::ran("x = 0.5\nmovel(p[x * 2 - 1.5, -(0.2), 0.3, 0, 0, d2r(180)])\n");
    // The sum is edited in its last summand; the other numbers of it are then fixed.
    assert_eq!((ran.xs(), &ran.edits[..]), (vec![Some(-0.5)], &[Editable::Pose][..]));
    let ran = self::ran("movel(p[0.5, -(0.2), - 0.3, 0, 0, d2r(180)])\n");
    assert_eq!(ran.edits, [Editable::Pose]);
}

#[test]
fn a_line_that_is_not_understood_may_do_anything() {
    let ran = ran("def f():\n x = p[1,0,0,0,0,0]\n x += 1 2\n movel(x)\nend\n");
    assert_eq!(ran.program.not_understood.len(), 1);
    assert_eq!(ran.edits, [Editable::No(Reason::NotUnderstood)]);
}

#[test]
fn an_inverse_keeps_the_pose_and_a_circle_has_its_way_point() {
    let ran = ran(
        "w_p=p[.1,.2,.3,0,3.1,0]\nw_q=[0,-1,1,0,0,0]\nmovej(get_inverse_kin(w_p, qnear=w_q), a=1.4, v=1.0)\nmovec(p[1,0,0,0,0,0],p[2,0,0,0,0,0],a=1,v=.1,r=0)\nmovec(p[1,0,0,0,0,0],p[3,0,0,0,0,0],mode=1)\nmovec(p[1,0,0,0,0,0],p[4,0,0,0,0,0],mode=w_q[0])\n",
    );
    assert_eq!(ran.edits, [Editable::Pose, Editable::Pose, Editable::Position, Editable::No(Reason::Tangent)]);
    assert_eq!(ran.motions[2].path, Path::Tangent);
    assert_eq!(ran.motions[0].path, Path::Joint);
    assert!(ran.motions[1].via.is_some());
    assert_eq!(ran.tokens()[0], ".1");
}

#[test]
fn what_does_not_close_is_refused() {
    for text in ["def f():\n movel(p[1,0,0,0,0,0])\n", "end\n", "switch x:\n", "if True:\n"] {
        assert!(read(&[text.as_bytes()], 1).is_err(), "{text}");
    }
    assert!(read(&["if True:\n".repeat(100_000).as_bytes()], 1).is_err());
    assert!(read(&[format!("x = {}1\n", "(".repeat(100_000)).as_bytes()], 1).is_ok());
}

#[test]
fn what_the_controller_computes_and_its_signals_leave_the_tool() {
    let knows_tool = |call: &str| {
        let ran = ran(&format!("set_tcp(p[0,0,0.1,0,0,0])\n{call}\nmovel(p[1,0,0,0,0,0])\n"));
        ran.motions[0].switches[Switch::Tool as usize].pose().is_some()
    };
    for call in [
        "J = get_jacobian([0,0,0,0,0,0])",
        "J = get_jacobian_time_derivative()",
        "M = get_mass_matrix([0,0,0,0,0,0], True)",
        "C = get_coriolis_and_centrifugal_torques()",
        "modbus_add_rw_signal(\"172.140.17.11\", 255, 5, 10, 15, 10, \"output1\")",
        "t = modbus_get_time_since_signal_invalid(\"output1\")",
        "global written = eip_writer_factory(\"101\", 88)",
        "global status = eip_reader_factory(\"111\", 44)",
    ] {
        assert!(knows_tool(call), "{call}");
    }
    assert!(!knows_tool("get_jacobians()"));
    // A torque drives the arm to where only the run shows it.
    let ran = ran("movel(p[1,0,0,0,0,0])\ndirect_torque([0,0,0,0,0,0], friction_comp=True)\nmovel(p[2,0,0,0,0,0])\n");
    assert_eq!(ran.motions[1].path, Path::Unknown(Reason::Follows));
    assert_eq!(ran.motions[2].from, Predecessor::Unknown);
    assert_eq!(ran.edits, [Editable::Pose, Editable::No(Reason::Follows), Editable::Pose]);
}
