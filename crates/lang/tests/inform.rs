//! Hand-solved INFORM jobs.

use deflex_lang::Reason;
use deflex_lang::inform::{Inform, read};
use deflex_lang::ir::{Path, Program, Switch};
use deflex_lang::run::{Moved, Predecessor, run};
use deflex_lang::shared::{Editable, editable};

struct Ran {
    text: Vec<u8>,
    program: Program,
    motions: Vec<Moved>,
    edits: Vec<Editable>,
}

/// A job with eight teaching positions in user frame 1, the number of each its x, and position variables 100 to 103 in robot coordinates.
fn job(name: &str, instructions: &str) -> String {
    let mut text = format!("/JOB\r\n//NAME {name}\r\n//POS\r\n///NPOS 8,0,0,4,0,0\r\n///TOOL 3\r\n///USER 1\r\n");
    text.push_str("///POSTYPE USER\r\n///RECTAN\r\n///RCONF 1,0,0,0,0,0,0,0\r\n");
    (0..8).for_each(|i| text.push_str(&format!("C{i:05}={i}.000,2.000,-3.000,180.0000,0.0000,-90.0000\r\n")));
    text.push_str("///TOOL 0\r\n///POSTYPE ROBOT\r\n");
    (100..104).for_each(|i| text.push_str(&format!("P{i:05}={i}.000,0.000,0.000,0.0000,0.0000,0.0000\r\n")));
    text.push_str("///POSTYPE PULSE\r\n///PULSE\r\nC00008=10,20,30,40,50,60\r\n");
    text.push_str("//INST\r\n///DATE 2026/01/02 03:04\r\n///ATTR SC,RW\r\n///GROUP1 RB1\r\nNOP\r\n");
    instructions.lines().for_each(|line| text.extend([line, "\r\n"]));
    text + "END\r\n"
}

fn ran_all(texts: &[String]) -> Ran {
    let sources: Vec<&[u8]> = texts.iter().map(|text| text.as_bytes()).collect();
    let program = read(&sources, 1).unwrap_or_else(|fault| panic!("{fault:?}"));
    let outcome = run(&program, &Inform).expect("it ends");
    let edits = editable(&outcome);
    Ran { text: texts[0].clone().into(), program, motions: outcome.motions, edits }
}

fn ran(instructions: &str) -> Ran {
    ran_all(&[job("A", instructions)])
}

impl Ran {
    /// The x coordinate of each end, mm.
    fn xs(&self) -> Vec<Option<f64>> {
        let x = |motion: &Moved| motion.to.pose().map(|pose| (pose.pose().translation.x * 1e6).round() / 1e6);
        self.motions.iter().map(x).collect()
    }

    fn reasons(&self) -> Vec<Option<Reason>> {
        let why = |edit: &Editable| if let Editable::No(why) = edit { Some(*why) } else { None };
        self.edits.iter().map(why).collect()
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
fn a_position_has_its_own_tool_and_frame() {
    let ran = ran("MOVJ P100 VJ=25.00\nMOVL C00001 V=100.0 PL=0\nMOVL C1 V=12.5\nMOVL C00003 V=1.0 CR=5.0 //end\n");
    assert_eq!(ran.xs(), [100.0, 1.0, 1.0, 3.0].map(Some));
    assert_eq!(ran.edits, [Editable::Pose; 4]);
    assert_eq!(ran.tokens(), ["100.000", "1.000", "1.000", "3.000"]);
    let given = |at: usize| {
        let given = ran.motions[at].to.pose().unwrap().given.clone().unwrap();
        (given.tool.to_string(), given.frame.to_string())
    };
    assert_eq!(given(0), ("TOOL 0".to_owned(), "ROBOT".to_owned()));
    assert_eq!(given(1), ("TOOL 3".to_owned(), "USER 1".to_owned()));
    assert_eq!(ran.motions.iter().map(|m| m.speed).collect::<Vec<_>>(), [None, Some(100.0), Some(12.5), Some(1.0)]);
    assert_eq!(ran.motions.iter().map(|m| m.blend).collect::<Vec<_>>(), [None, Some(0.0), None, Some(5.0)]);
    assert_eq!((ran.motions[0].path, ran.motions[0].from), (Path::Joint, Predecessor::Start));
    assert_eq!((ran.motions[1].path, ran.motions[1].from), (Path::Linear, Predecessor::Previous));
    // Rx = 180, Rz = -90: x of the tool is -y of the frame, its z is -z.
    let turn = ran.motions[1].to.pose().unwrap().pose().rotation.to_rotation_matrix();
    let expected = nalgebra::Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    assert!((turn.matrix() - expected).norm() < 1e-12, "{turn}");
}

#[test]
fn pulses_and_positions_that_are_not_there_stay() {
    let ran =
        ran("MOVL C00008 V=1.0\nMOVL C00077 V=1.0\nMOVL P200 V=1.0\nMOVL C00001 BC00001 V=1.0\nIMOV P101 V=1.0 RF\n");
    let why = [Reason::Pulses, Reason::Unset, Reason::Unset, Reason::OtherAxes, Reason::Relative];
    assert_eq!(ran.reasons(), why.map(Some));
}

#[test]
fn a_variable_that_is_written_is_known_from_there_on() {
    let ran =
        ran("MOVL P100 V=1.0\nMOVL P101 V=1.0\nSET P101 P102\nSETE P101 (1) 2500\nMOVL P101 V=1.0\nMOVL P102 V=1.0\n");
    assert_eq!(ran.xs(), [Some(100.0), None, Some(2.5), Some(102.0)]);
    assert_eq!(ran.reasons()[1], Some(Reason::Variable));
    // The third shares the other numbers of P102 with the fourth, and each has its own x.
    assert_eq!(ran.tokens_of(2), "2500");
    assert_eq!(ran.edits[0], Editable::Pose);
}

impl Ran {
    fn tokens_of(&self, at: usize) -> &str {
        let id = self.motions[at].to.pose().and_then(|pose| pose.affine(0)).expect("a token").token;
        let span = self.program.tokens[id.0 as usize].span;
        std::str::from_utf8(&self.text[span.range()]).expect("a number is text")
    }
}

#[test]
fn a_job_that_is_not_given_may_write_any_variable_before() {
    let ran = ran(
        "MOVL P100 V=1.0\nMOVL C00001 V=1.0\nCALL JOB:OTHER-1 ARGF\"1;2\"\nMOVL C00002 V=1.0\nSFTOF\nMOVL C00003 V=1.0\n",
    );
    // It may have left a shift in force, too.
    assert_eq!(ran.xs(), [None, Some(1.0), None, Some(3.0)]);
    assert_eq!(ran.reasons(), [Some(Reason::Foreign), None, Some(Reason::Foreign), None]);
    assert_eq!(&*ran.program.foreign[0].0, "OTHER-1");
}

#[test]
fn a_position_by_an_index_holds_all_that_it_may_be() {
    let ran = ran("MOVL P100 V=1.0\nMOVL C00001 V=1.0\nMOVL P[I000] V=1.0\n");
    assert_eq!(ran.reasons(), [Some(Reason::Shared), None, Some(Reason::Computed)]);
}

#[test]
fn counted_loops_run_each_round_and_unknown_ones_are_joined() {
    let counted = ran("SET I000 0\n*LOOP\nMOVL C00001 V=1.0\nINC I000\nJUMP *LOOP IF I000<3\nMOVL C00002 V=1.0\n");
    assert_eq!(counted.xs(), [1.0, 1.0, 1.0, 2.0].map(Some));
    let by_for = ran("FOR I000=1 TO 5 STEP 2\nMOVL C00001 V=1.0\nNEXT I000\nMOVL C00002 V=1.0\n");
    assert_eq!(by_for.xs(), [1.0, 1.0, 1.0, 2.0].map(Some));
    let started = ran(
        "FOR LI000 START= 120 TO 123\nMOVL C00001 V=1.0\nNEXT LI000\nJUMP *E IFEXPRESS IN#(1)=ON ANDEXP IN#(2)=ON\nMOVL C00002 V=1.0\n*E\n",
    );
    assert_eq!(started.xs(), [1.0, 1.0, 1.0, 1.0, 2.0].map(Some));
    let awaited =
        ran("*A\nMOVL C00001 V=1.0\nJUMP *B IF IN#(1)=ON\nMOVL C00002 V=1.0\nJUMP *A\n*B\nMOVL C00003 V=1.0\n");
    assert_eq!(awaited.xs(), [1.0, 2.0, 3.0].map(Some));
    assert_eq!(
        awaited.motions.iter().map(|motion| motion.from).collect::<Vec<_>>(),
        [Predecessor::Unknown, Predecessor::Previous, Predecessor::Unknown]
    );
    let endless = ran("*A\nMOVL C00001 V=1.0\nMOVL C00002 V=1.0\nJUMP *A\n");
    assert_eq!(endless.xs(), [1.0, 2.0].map(Some));
}

#[test]
fn blocks_branch() {
    let ran = ran(
        "SET P101 P100\nIFTHENEXP B000=0\n SET P101 P102\nELSEIFEXP B000=1\n MOVL C00001 V=1.0\nELSE\n MOVL C00002 V=1.0\nENDIF\n\
         MOVL P101 V=1.0\nSWITCH B001\nCASE 1\n MOVL C00003 V=1.0\nCASE 2\n MOVL C00004 V=1.0\nDEFAULT\n MOVL C00005 V=1.0\n\
         ENDSWITCH\nWHILE IN#(1)=ON\n MOVL C00006 V=1.0\nENDWHILE\n",
    );
    assert_eq!(ran.xs(), [Some(1.0), Some(2.0), None, Some(3.0), Some(4.0), Some(5.0), Some(6.0)]);
    assert_eq!(ran.reasons()[2], Some(Reason::Branches));
}

#[test]
fn a_known_shift_along_its_own_frame_moves_positions() {
    let shifted = ran("SET P110 P101\nSFTON P102 RF\nMOVL P100 V=1.0\nMOVL C00001 V=1.0\nSFTOF\nMOVL C00002 V=1.0\n");
    assert_eq!(shifted.xs(), [Some(202.0), None, Some(2.0)]);
    assert_eq!(shifted.reasons(), [None, Some(Reason::Shift), None]);
    assert_eq!(shifted.tokens_of(0), "100.000");
    let unknown = ran(
        "SFTON P103\nSFTON P102 RF\nMOVL P100 V=1.0\nSFTOF\nWVON WEV#(1)\nMOVL C00001 V=1.0\nWVOF\nMOVL C00002 V=1.0\n",
    );
    assert_eq!(unknown.reasons(), [Some(Reason::Shift), Some(Reason::Weaves), None]);
    // Shifted and not: the numbers are different points.
    let both = ran("MOVL P100 V=1.0\nSFTON P102 RF\nMOVL P100 V=1.0\nSFTOF\n");
    assert_eq!(both.reasons(), [Some(Reason::SharedNumbers); 2]);
    // The shift itself is no position to correct.
    let itself = ran("SFTON P102 RF\nMOVL P100 V=1.0\nSFTOF\nMOVL P102 V=1.0\n");
    assert_eq!(itself.reasons(), [None, Some(Reason::Shared)]);
}

#[test]
fn a_circle_is_three_points_in_a_row() {
    let circle = ran("MOVL C00001 V=1.0\nMOVC C00002 V=1.0\nMOVC C00003 V=1.0\nMOVC C00004 V=1.0\nMOVL C00005 V=1.0\n");
    assert_eq!(circle.xs(), [1.0, 2.0, 4.0, 5.0].map(Some));
    assert_eq!(circle.motions[2].path, Path::Circular);
    let via = circle.motions[2].via.as_ref().expect("a point on the way");
    assert!((via.pose().expect("a pose").pose().translation.x - 3.0).abs() < 1e-12);
    assert_eq!(circle.edits, [Editable::Pose; 4]);
    let four = ran("MOVL C0 V=1.0\nMOVC C1 V=1.0\nMOVC C2 V=1.0\nMOVC C3 V=1.0\nMOVC C4 V=1.0\n");
    assert_eq!(four.reasons()[1..], [Some(Reason::Circles); 4]);
    let jumped = ran("MOVL C0 V=1.0\n*A\nMOVC C1 V=1.0\nMOVC C2 V=1.0\nMOVC C3 V=1.0\nJUMP *A\n");
    assert_eq!(jumped.reasons()[1..], [Some(Reason::Circles); 3]);
}

#[test]
fn called_jobs_run_in_their_place_and_are_not_edited() {
    let main = job(
        "MAIN",
        "MOVL C00001 V=1.0\nCALL JOB:SUB IF IN#(1)=ON\nMOVL C00002 V=1.0\nJUMP JOB:SUB\nMOVL C00003 V=1.0\n",
    );
    let sub = job("SUB", "MOVL C00007 V=1.0\nRET IF IN#(2)=ON\nMOVL C00006 V=1.0\n").replace("P00100", "P00200");
    let ran = ran_all(&[main, sub]);
    assert_eq!(ran.xs(), [1.0, 7.0, 6.0, 2.0, 7.0, 6.0].map(Some));
    let sources: Vec<u16> = ran.motions.iter().map(|motion| motion.place.source).collect();
    assert_eq!(sources, [0, 1, 1, 0, 1, 1]);
}

#[test]
fn a_job_that_is_called_in_another_frame_goes_elsewhere() {
    let main = job("MAIN", "MOVL C00001 V=1.0\nCALL JOB:SUB UF#(2)\nSFTOF\nMOVL C00002 V=1.0\n");
    let sub = job("SUB", "SFTOF\nMOVL C00007 V=1.0\n").replace("P00100", "P00200");
    assert_eq!(ran_all(&[main, sub]).reasons(), [None, Some(Reason::Frame), Some(Reason::Frame)]);
}

#[test]
fn a_frame_that_is_made_anew_is_not_known() {
    let ran = ran("MOVL C00001 V=1.0\nMFRAME UF#(1) PX101 PX102 PX103\nMOVL C00002 V=1.0\n");
    assert!(ran.motions.iter().all(|motion| motion.switches[Switch::Frame as usize].reason().is_some()));
    assert_eq!(ran.reasons(), [Some(Reason::Frame); 2]);
}

#[test]
fn marks_are_in_force_from_their_line_on() {
    use deflex_lang::value::Content;
    let ran = ran("MOVL C00001 V=1.0\n' Deflex AIR\nMOVL C00002 V=1.0\n'deflex cut\nMOVL C00003 V=1.0\n");
    let mark = |motion: &Moved| match &motion.switches[Switch::Mark as usize].content {
        Content::Text(word) => String::from_utf8_lossy(word).into_owned(),
        _ => String::new(),
    };
    assert_eq!(ran.motions.iter().map(mark).collect::<Vec<_>>(), ["", "air", "cut"]);
}

#[test]
fn what_is_not_understood_may_change_anything_but_a_teaching_position() {
    let ran = ran("MOVL C00001 V=1.0\nFROBNICATE P100 1\nMOVL P101 V=1.0\nMOVL C00002 V=1.0\n");
    assert_eq!(ran.reasons(), [None, Some(Reason::NotUnderstood), Some(Reason::NotUnderstood)]);
    assert_eq!(ran.program.not_understood.len(), 1);
}

#[test]
fn a_job_that_is_cut_off_is_refused() {
    for text in ["", "NOP\nEND\n", "/JOB\n//POS\nNOP\n", "/JOB\n//NAME A\n//INST\nIFTHEN B000=1\nNOP\nEND\n"] {
        assert!(read(&[text.as_bytes()], 1).is_err(), "{text}");
    }
}
