//! Rules that hold for every kind in the registry, in every form it has.

use deflex::effects::{
    Carries, Cutting, CuttingTorque, Effect, KINDS, PartAt, PartYield, Situation, Survey, ToolFrame, UnitAt, kind,
};
use deflex::equilibrium::Arm;
use deflex::robot::{Axes, BUILTIN, Joints, Pose};
use nalgebra::{DMatrix, Matrix3, Rotation3, Translation3, Vector3};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Forward and inverse meet to 1e-9 mm.
const SAME_POSITION: f64 = 1e-12;
const SAME_ROTATION: f64 = 1e-11;

const JOINTS: [f64; 6] = [10.0, 25.0, 20.0, 30.0, 45.0, -60.0];

fn motor() -> Joints {
    Joints::from(JOINTS.map(f64::to_radians))
}

/// Every form of every kind, as a cell file would have it.
fn forms() -> Vec<Box<dyn Effect>> {
    let of_kind = |kind: &'static deflex::effects::Kind| {
        kind.forms.iter().map(|form| (kind.read)(form.parse().unwrap()).unwrap())
    };
    KINDS.iter().flat_map(of_kind).collect()
}

pub(crate) fn read(mut table: toml::Table) -> Result<Box<dyn Effect>, toml::de::Error> {
    let name = table.remove("kind").unwrap();
    (kind(name.as_str().unwrap()).unwrap().read)(table)
}

/// Every parameter at its neutral value.
fn neutral(effect: &dyn Effect) -> Box<dyn Effect> {
    effect.with_values(&effect.parameters().iter().map(|p| p.neutral).collect::<Vec<_>>())
}

/// Parameters of typical size, from numbers in −1 … 1 that are used in turn.
fn drawn(effect: &dyn Effect, shares: &[f64]) -> Box<dyn Effect> {
    let parameters = effect.parameters();
    let values = parameters.iter().zip(shares.iter().cycle());
    effect.with_values(
        &values.map(|(p, share)| (p.neutral + share * p.typical).clamp(p.bounds.0, p.bounds.1)).collect::<Vec<_>>(),
    )
}

fn arm(effects: Vec<Box<dyn Effect>>) -> Arm {
    // Scaled springs stand in the declared ones' place.
    let robot = BUILTIN.iter().find(|robot| robot.model == "irb6660-205-1.9").unwrap().robot();
    let mut all = effects;
    deflex::effects::add_implied(&mut all, &robot.axes);
    deflex::effects::add_implied_part(&mut all);
    Arm { robot, stiffness: Some(Joints::from([8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4])), effects: all }
}

/// A table under the part and a track under the robot.
static UNITS: std::sync::LazyLock<Vec<UnitAt>> = std::sync::LazyLock::new(|| {
    let at = |x, turn| Pose::from_parts(Translation3::new(x, 0.2, -0.1), Rotation3::from_euler_angles(0.1, turn, 0.2));
    vec![UnitAt::new("STN1", at(0.3, 0.4), Carries::Part), UnitAt::new("TRACK1", at(-1.2, -0.1), Carries::Robot)]
});

/// A part between two clamps, of which each takes about half of a force.
static PART: std::sync::LazyLock<PartYield> = std::sync::LazyLock::new(|| PartYield {
    compliance: Matrix3::new(4e-8, 1e-8, 0.0, 1e-8, 6e-8, 0.0, 0.0, 0.0, 2e-8),
    motions: (0..6).map(|n| Vector3::from_fn(|k, _| if k == n % 3 { 0.5 } else { 0.02 * n as f64 })).collect(),
    stiffness: DMatrix::from_fn(6, 6, |i, j| if i % 3 == j % 3 { if i == j { 1e7 } else { -1e7 } } else { 0.0 }),
});

/// A cut that has gone on for a while.
static LOADED: std::sync::LazyLock<CuttingTorque> = std::sync::LazyLock::new(|| {
    CuttingTorque::default().after(&Joints::new(-300.0, 800.0, 500.0, 50.0, -80.0, 20.0), Joints::zeros(), 20.0)
});

/// A cut at `motor` with everything that an effect may look at.
fn situation(arm: &Arm, motor: &Joints, force: Vector3<f64>) -> Situation<'static> {
    let tool = ToolFrame {
        flange_from_tcp: Pose::from_parts(
            Translation3::new(0.06, -0.02, 0.31),
            Rotation3::from_euler_angles(0.1, 0.4, -0.2),
        ),
        mass: 18.0,
        cog: Vector3::new(0.0, 0.0, 0.12),
    };
    let base_from_wobj =
        Pose::from_parts(Translation3::new(1.0, -0.4, 0.7), Rotation3::from_euler_angles(0.0, 0.02, 0.3));
    Situation {
        base_from_wobj,
        gravity: arm.robot.gravity(),
        wobj_from_tcp: base_from_wobj.inv_mul(&(arm.robot.forward(motor) * tool.flange_from_tcp)),
        tool,
        cutting: Cutting::Constant(force),
        normal: Vector3::new(0.1, -0.2, 1.0).normalize(),
        velocity: Vector3::new(0.02, -0.01, 0.003),
        cut_length: 4.0,
        time: 700.0,
        temperature: Some(27.0),
        payload: 6.0,
        units: &UNITS,
        part: Some(PartAt { yields: &PART, wobj_from_part: Rotation3::from_euler_angles(0.1, 0.2, -0.3) }),
        torque: Some(&LOADED),
    }
}

/// Whether the forward equilibrium of the inverse's command is where it was wanted.
fn lands(arm: &Arm, motor: &Joints, force: Vector3<f64>, travel: &Joints) -> Result<(), TestCaseError> {
    let names: Vec<_> = arm.effects.iter().map(|effect| effect.to_table().to_string()).collect();
    let situation = situation(arm, motor, force);
    let command = arm.command(&situation, &situation.wobj_from_tcp, motor, travel);
    let command = command.map_err(|error| TestCaseError::fail(format!("{error}: {names:?}")))?;
    let there = arm.predict(&situation, &command.commanded(travel), travel);
    let there = there.map_err(|error| TestCaseError::fail(format!("{error}: {names:?}")))?;
    let gap = there.wobj_from_tcp.translation.vector - situation.wobj_from_tcp.translation.vector;
    let where_to_look = "look at `Effect::follows_command` and `follows_load`, and at `Physics::parts`";
    prop_assert!(gap.norm() < SAME_POSITION, "the command lands off by {gap:?}: {where_to_look}: {names:?}");
    let turn = there.wobj_from_tcp.rotation * situation.wobj_from_tcp.rotation.inverse();
    prop_assert!(
        (turn.matrix() - nalgebra::Matrix3::identity()).amax() < SAME_ROTATION,
        "the command lands turned by {turn:?}: {where_to_look}: {names:?}"
    );
    Ok(())
}

#[test]
fn a_field_is_undone_where_it_acts() {
    let motor = Joints::new(0.1, 0.2, 0.1, 0.2, 0.6, 0.3);
    let force = Vector3::new(300.0, -200.0, 100.0);
    let there = situation(&arm(vec![]), &motor, force);
    let at = 1e3 * (there.base_from_wobj * there.wobj_from_tcp).translation.vector;
    let text = format!(
        "kind = 'empirical'\nreach_mm = 50.0\nwithin_mm = 20.0\nat_mm = [[{:?}, {:?}, {:?}]]\nshift_mm = [[0.2, -0.1, 0.3]]",
        at.x + 30.0,
        at.y,
        at.z
    );
    let arm = arm(vec![read(text.parse().unwrap()).unwrap()]);
    lands(&arm, &motor, force, &Joints::zeros()).unwrap();
}

fn case() -> impl Strategy<Value = (Joints, Vector3<f64>, Joints, Vec<f64>)> {
    (
        prop::array::uniform6(-0.3f64..0.3),
        prop::array::uniform3(-600.0f64..600.0),
        prop::array::uniform6(-1i8..=1),
        prop::collection::vec(-1.0f64..1.0, 31),
    )
        .prop_map(|(q, f, t, shares)| {
            (motor() + Joints::from(q), Vector3::from(f), Joints::from(t.map(f64::from)), shares)
        })
}

fn run(cases: u32, test: impl Fn(Joints, Vector3<f64>, Joints, Vec<f64>) -> Result<(), TestCaseError>) {
    let config = Config { cases, failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..Config::default() };
    TestRunner::new(config).run(&case(), |(motor, force, travel, shares)| test(motor, force, travel, shares)).unwrap();
}

#[test]
fn every_kind_has_forms_and_names_kinds_of_the_registry() {
    for kind in KINDS {
        assert!(!kind.forms.is_empty(), "{}: `KIND.forms` has no form for the tests", kind.name);
        for other in kind.nested_in.iter().chain(kind.locally_like) {
            assert!(
                KINDS.iter().any(|kind| kind.name == *other),
                "{}: `KIND.nested_in` or `locally_like` names {other}, which is no kind",
                kind.name
            );
        }
    }
}

#[test]
fn inverse_then_forward_is_identity_with_each() {
    run(40, |motor, force, travel, shares| {
        forms().iter().try_for_each(|form| lands(&arm(vec![drawn(form.as_ref(), &shares)]), &motor, force, &travel))
    });
}

#[test]
fn inverse_then_forward_is_identity_with_each_pair() {
    run(4, |motor, force, travel, shares| {
        let forms = forms();
        for (i, first) in forms.iter().enumerate() {
            for second in &forms[i..] {
                let pair = vec![drawn(first.as_ref(), &shares), drawn(second.as_ref(), &shares[7..])];
                lands(&arm(pair), &motor, force, &travel)?;
            }
        }
        Ok(())
    });
}

#[test]
fn inverse_then_forward_is_identity_with_all_at_once() {
    run(20, |motor, force, travel, shares| {
        let all = forms().iter().enumerate().map(|(i, form)| drawn(form.as_ref(), &shares[i % 7..])).collect();
        lands(&arm(all), &motor, force, &travel)
    });
}

#[test]
fn tables_round_trip() {
    run(8, |_, _, _, shares| {
        for form in forms() {
            let effect = drawn(form.as_ref(), &shares);
            let table = effect.to_table();
            prop_assert_eq!(table["kind"].as_str(), Some(effect.kind()), "look at `Listed::to_table`");
            // Through text, as the cell file has it.
            let again = read(table.to_string().parse().unwrap()).unwrap();
            let where_to_look = "look at the `serde` attributes of the table and at `Effect::numbers`";
            prop_assert_eq!(again.parameters(), effect.parameters(), "{}: {}", effect.kind(), where_to_look);
            prop_assert_eq!(again.to_table(), table, "{}", where_to_look);
        }
        Ok(())
    });
}

#[test]
fn neutral_values_change_no_bit() {
    let motor = motor();
    let travel = Joints::from([1.0, -1.0, 1.0, 0.0, -1.0, 1.0]);
    let plain = arm(vec![]);
    let mut situation = situation(&plain, &motor, Vector3::new(-120.0, 260.0, 410.0));
    // A payload or a heavy tool is a load of its own, whatever the links weigh.
    (situation.payload, situation.tool.mass) = (0.0, 0.0);
    let without = plain.predict(&situation, &motor, &travel).unwrap();
    for form in forms() {
        let with = arm(vec![neutral(form.as_ref())]).predict(&situation, &motor, &travel).unwrap();
        let where_to_look = "does something at its neutral values: look at `Effect::parameters`, and at `Physics`";
        assert_eq!(with.wobj_from_tcp, without.wobj_from_tcp, "{} {where_to_look}", form.kind());
        assert_eq!(with.motor, without.motor, "{} {where_to_look}", form.kind());
    }
}

/// A command that needs no correction is found, whatever effects there are: nothing acts, and the pose is exactly that of the
/// motor angles.
#[test]
fn neutral_values_are_inverted_without_a_load_at_an_exact_pose() {
    let axes = [[0.0; 6], JOINTS, [0.0, 0.0, 0.0, 0.0, 90.0, 0.0]];
    for form in forms() {
        for axes in axes {
            let motor = Joints::from(axes.map(f64::to_radians));
            let arm = arm(vec![neutral(form.as_ref())]);
            let mut situation = situation(&arm, &motor, Vector3::zeros());
            situation.cutting = Cutting::Air;
            (situation.payload, situation.tool.mass) = (0.0, 0.0);
            // Nothing is rounded: the frames are those of the base and the flange.
            situation.tool.flange_from_tcp = Pose::identity();
            situation.base_from_wobj = Pose::identity();
            situation.wobj_from_tcp = arm.robot.forward(&motor);
            for travel in [Joints::zeros(), Joints::repeat(1.0)] {
                let command = arm.command(&situation, &situation.wobj_from_tcp, &motor, &travel);
                let command = command.unwrap_or_else(|error| panic!("{}: {error}", form.to_table()));
                let apart = (command.commanded(&travel) - motor).amax();
                assert!(apart < 1e-12, "look at the neutral values of `Effect::parameters`: {}", form.to_table());
            }
        }
    }
}

/// What cannot move the TCP by its nature.
const IDLE: [(&str, &str); 13] = [
    // The first axis is vertical: weights do not turn it, nor does link 1's own weight turn anything.
    ("gravity", "mass_kg[0]"),
    ("gravity", "first_moment_kg_m[0][0]"),
    ("gravity", "first_moment_kg_m[0][1]"),
    ("gravity", "first_moment_kg_m[0][2]"),
    ("gravity", "compliance_rad_per_nm[0]"),
    // Links 2 and 3 turn about horizontal axes: a weight further along the axis turns them no more. Link 2's frame is
    // on its own axis.
    ("gravity", "mass_kg[1]"),
    ("gravity", "first_moment_kg_m[1][2]"),
    ("gravity", "first_moment_kg_m[2][2]"),
    // The declared springs hold: compliances stand in for them only where there are none.
    ("gravity", "compliance_rad_per_nm[1]"),
    ("gravity", "compliance_rad_per_nm[2]"),
    ("gravity", "compliance_rad_per_nm[3]"),
    ("gravity", "compliance_rad_per_nm[4]"),
    ("gravity", "compliance_rad_per_nm[5]"),
];

#[test]
fn every_parameter_moves_something() {
    let motor = motor();
    let travel = Joints::from([1.0, -1.0, 1.0, -1.0, -1.0, 1.0]);
    for form in forms() {
        let start = drawn(form.as_ref(), &[0.5]);
        let seen = |effect: Box<dyn Effect>| {
            let arm = arm(vec![effect]);
            // Enough to pass the soft width of every gear.
            let situation = situation(&arm, &motor, Vector3::new(-1200.0, 2600.0, 4100.0));
            arm.predict(&situation, &motor, &travel).unwrap().wobj_from_tcp
        };
        let there = seen(start.clone_box());
        for (i, parameter) in start.parameters().iter().enumerate() {
            let mut values: Vec<f64> = start.parameters().iter().map(|p| p.value).collect();
            values[i] += 0.3 * parameter.typical;
            let moved = (seen(start.with_values(&values)).to_homogeneous() - there.to_homogeneous()).norm();
            let still = IDLE.contains(&(form.kind(), parameter.name.as_str()));
            let where_to_look = "look at `Effect::numbers` and `Physics`, or list it in `IDLE`";
            assert!(
                still || moved > 1e-9,
                "{} {} moves nothing ({moved:e}): {where_to_look}",
                form.kind(),
                parameter.name
            );
        }
    }
}

#[test]
fn what_is_wrong_with_a_number_is_said_by_name() {
    let cases = [
        ("kind = 'backlash'\nhalf_gap_rad = [0, 0, 0]", "half_gap_rad"),
        ("kind = 'backlash'\nhalf_gap_rad = [0, -1e-5, 0, 0, 0, 0]", "`half_gap_rad[1]`"),
        ("kind = 'backlash'\nhalf_gap_rad = [0, 0, 0, 0, 0, 0]\npresliding_rad = -1e-3", "`presliding_rad`"),
        ("kind = 'hysteresis'\nfraction = [0, 0, 0, 0, 0, 0]\npresliding_rad = inf", "`presliding_rad`"),
        (
            "kind = 'backlash'\nhalf_gap_rad = [0, 0, 0, 0, 0, 0]\npresliding_rad = [0, 1, 1, 1, 1, 1]",
            "six numbers above 0",
        ),
        (
            "kind = 'empirical'\nreach = 0\nspread = [1, 1, 1]\nat_mm = []\nwrist_deg = []\nforce_n = []\nshift_mm = []",
            "`reach`",
        ),
        (
            "kind = 'empirical'\nreach = 1\nspread = [1, 1, -1]\nat_mm = []\nwrist_deg = []\nforce_n = []\nshift_mm = []",
            "`spread`",
        ),
        (
            "kind = 'empirical'\nreach = 1\nspread = [1, 1, 1]\nat_mm = []\nwrist_deg = []\nforce_n = []\nshift_mm = [[0, 0, 0]]",
            "`at_mm`",
        ),
        ("kind = 'stiffness_curve'\nform = 'cubic'\nc_per_rad2 = [-1, 0, 0, 0, 0, 0]", "`c_per_rad2[0]`"),
        ("kind = 'backlash'\nhalf_gap = [0, 0, 0, 0, 0, 0]", "half_gap_rad"),
        ("kind = 'hysteresis'\nfraction = [0, 0, 0, 0, 0, 1.5]", "`fraction[5]`"),
        ("kind = 'force_scale'\nfactor = 0", "`factor`"),
        ("kind = 'force_scale'\nfactor = nan", "finite"),
        ("kind = 'force_scale'", "factor"),
        ("kind = 'thermal_growth'\ntau_s = 0", "`tau_s`"),
        ("kind = 'thermal_growth'\ncolumn_mm = 1", "`reference_c`"),
        ("kind = 'thermal_growth'\ntau_s = 100\ncolumn_mm_per_k = 1", "`tau_s` with `column_mm`"),
        ("kind = 'stiffness_curve'\nform = 'bilinear'", "two_slope"),
        (
            "kind = 'stiffness_curve'\nform = 'two_slope'\nwidth_rad = [0, 0, 0, 0, 0, 0]\nratio = [0, 1, 1, 1, 1, 1]",
            "`ratio[0]`",
        ),
        ("kind = 'stiffness_curve'\nform = 'cubic'\nc_per_rad2 = [0, 0, 0, 0, 0, 0]\nratio = 1", "ratio"),
        ("kind = 'gear_harmonic'\nterms = [{ joint = 0, order = 2, cos_rad = 0, sin_rad = 0 }]", "`terms[0].joint`"),
        ("kind = 'gear_harmonic'\nterms = [{ joint = 1, order = 0, cos_rad = 0, sin_rad = 0 }]", "`terms[0].order`"),
        (
            "kind = 'joint_error_curve'\ncurves = [{ joint = 1, angle_deg = [0, 0], error_rad = [0, 0] }]",
            "`curves[0].angle_deg`",
        ),
        (
            "kind = 'joint_error_curve'\ncurves = [{ joint = 1, angle_deg = [0, 1], error_rad = [0] }]",
            "as many of both",
        ),
        ("kind = 'workpiece_compliance'\nmm_per_n = [1, 2]", "expected a number, or six"),
        ("kind = 'empirical'\ndegree = 1\nx_mm = []\ny_mm = []\nz_mm = []", "domain_mm"),
        ("kind = 'empirical'\nreach_mm = 50\nwithin_mm = 20\nat_mm = [[0, 0, 0]]\nshift_mm = []", "as many of both"),
        ("kind = 'empirical'\nreach_mm = 50\nwithin_mm = 0\nat_mm = []\nshift_mm = []", "`within_mm` is 0"),
        ("kind = 'tool_frame'\nd_mm = [0, 0, 0, 0]", "d_mm"),
    ];
    for (text, expected) in cases {
        let error = read(text.parse().unwrap()).unwrap_err().to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
}

#[test]
fn candidates_follow_the_data_and_do_nothing_yet() {
    let mut survey = Survey {
        axes: Axes::PARALLELOGRAM,
        stiffness_declared: true,
        part_declared: true,
        clamps: 2,
        has_force: true,
        has_cut_length: true,
        cut_mm: Some([[-100.0, 100.0], [-50.0, 50.0]]),
        has_payload: false,
        has_speed: true,
        time: Some((0.0, 1200.0)),
        temperature: Some((19.0, 31.0)),
        moving_units: vec!["STN1".to_owned()],
        motor_min: motor().add_scalar(-0.3),
        motor_max: motor().add_scalar(0.3),
    };
    let names = |survey: &Survey| -> Vec<&str> {
        KINDS.iter().filter(|kind| !(kind.candidates)(survey).is_empty()).map(|kind| kind.name).collect()
    };
    let searched = KINDS.iter().filter(|kind| kind.shape == deflex::effects::Shape::Periodic).count();
    // Where a hose is fastened has to be declared; a map is of what is left, and no candidate.
    let declared = ["cable_pull", "empirical"];
    assert!(
        names(&survey).iter().all(|name| !declared.contains(name)),
        "look at `KIND.candidates`: effects in `declared` have none"
    );
    assert_eq!(
        names(&survey).len(),
        KINDS.len() - searched - declared.len(),
        "all kinds but those whose orders are searched have candidates: look at `KIND.candidates`, or name the kind in `declared`"
    );
    for candidate in KINDS.iter().flat_map(|kind| (kind.candidates)(&survey)) {
        let shapes = ["tau_s", "compliance_rad_per_nm", "width_rad"];
        for parameter in candidate.parameters().iter().filter(|p| !shapes.iter().any(|shape| p.name.starts_with(shape)))
        {
            assert!(
                parameter.value.to_bits() == parameter.neutral.to_bits(),
                "{} {} is not neutral: look at `KIND.candidates`",
                candidate.kind(),
                parameter.name
            );
        }
    }
    (survey.has_force, survey.has_speed, survey.stiffness_declared) = (false, false, false);
    (survey.time, survey.temperature) = (None, None);
    let left = names(&survey);
    for name in [
        "joint_stiffness", "hysteresis", "tool_compliance", "force_scale", "tool_wear", "tracking_lag",
        "thermal_growth",
    ] {
        assert!(!left.contains(&name), "{name} is a candidate without its data: look at `KIND.candidates`");
    }
}
