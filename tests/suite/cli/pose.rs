//! `pose` against the makers' own zero poses, and back again.

use super::bench::Bench;
use serde_json::Value;

fn cell(model: &str) -> Bench {
    let bench = Bench::new();
    let tool = "[tools.tMill]\ntcp_mm = [0, 0, 200]\ntcp_quat = [1, 0, 0, 0]\n";
    bench.write("arm.toml", format!("[robot]\nmodel = \"{model}\"\n{tool}"));
    bench
}

fn json(bench: &Bench, arguments: &str) -> Value {
    let ran = bench.run(&format!("pose --cell arm.toml {arguments} --json")).exits(0);
    serde_json::from_str(&ran.stdout).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// KUKA's mastering pose with the arm upright: axis 2 at −90°, axis 3 at +90°. The flange looks forward, as far out as the
/// makers' drawing says: 330 + 1220 + 240 mm, at 645 + 1150 + 115 mm.
#[test]
fn a_kuka_stands_as_its_drawing_says() {
    let found = json(&cell("kr300-r2700-2"), "--joints 0,-90,90,0,0,0");
    for (is, should) in numbers(&found["position_mm"]).iter().zip([1790.0, 0.0, 1910.0]) {
        assert!((is - should).abs() < 1e-6, "{found:#}");
    }
    assert!((numbers(&found["zyx_deg"])[1] - 90.0).abs() < 1e-6, "{found:#}");
}

#[test]
fn every_solution_leads_back_to_the_target() {
    for model in ["kr300-r2700-2", "m-20ia", "gp25", "tx2-90l", "irb6660-205-1.9", "ur10e"] {
        let bench = cell(model);
        let there = json(&bench, "--tool tMill --joints 10,-20,30,20,40,-40");
        let target: Vec<String> = [&there["position_mm"], &there["quat"]]
            .into_iter()
            .flat_map(numbers)
            .map(|number| number.to_string())
            .collect();
        let back = json(&bench, &format!("--tool tMill --target {}", target.join(",")));
        let solutions = back["solutions"].as_array().unwrap();
        let first = |joints: &[f64]| {
            joints.iter().zip([10.0, -20.0, 30.0, 20.0, 40.0, -40.0]).all(|(a, b)| (a - b).abs() < 1e-5)
        };
        assert!(solutions.iter().any(|way| first(&numbers(&way["joints_deg"]))), "{model}: {back:#}");
        for way in solutions {
            let joints: Vec<String> = numbers(&way["joints_deg"]).iter().map(f64::to_string).collect();
            let again = json(&bench, &format!("--tool tMill --joints {}", joints.join(",")));
            for (is, should) in numbers(&again["position_mm"]).iter().zip(numbers(&there["position_mm"])) {
                assert!((is - should).abs() < 1e-6, "{model}: {again:#}");
            }
        }
    }
}

/// A KUKA's cell speaks of A, B, C, S and T; a FANUC's of W, P, R and CONFIG.
#[test]
fn each_controller_is_spoken_to_in_its_own_words() {
    let words = |model: &str, at: &str| cell(model).run(&format!("pose --cell arm.toml --joints {at}")).exits(0).stdout;
    // Taught points of such postures have these S and T.
    assert!(words("kr210-r2700-2", "-5,-90,95,0,40,-3").contains("S 2, T 35  (S 'B010', T 'B100011')"));
    assert!(words("m-20ia", "10,-20,-30,20,40,-200").contains("FANUC CONFIG                    'F U T, 0, 0, -1'"));
    assert!(words("irb6660-205-1.9", "10,-20,30,20,40,-40").contains("ABB confdata                    [0,0,-1,0]"));
    let bench = cell("m-20ia");
    let there = json(&bench, "--joints 10,-20,-30,20,40,-40");
    let [p, wpr] = [&there["position_mm"], &there["fixed_xyz_deg"]].map(numbers);
    let typed = format!("--target {},{},{},{},{},{}", p[0], p[1], p[2], wpr[0], wpr[1], wpr[2]);
    let first = &json(&bench, &typed)["solutions"][0];
    let near = numbers(&first["joints_deg"])
        .iter()
        .zip([10.0, -20.0, -30.0, 20.0, 40.0, -40.0])
        .all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(near && first["config"] == there["config"], "{first:#}");
}

/// The same frames in a cell by a quaternion, by A, B, C and by W, P, R.
#[test]
fn orientations_of_a_cell_are_given_in_any_of_three_ways() {
    let bench = cell("kr210-r2700-2");
    let there = json(&bench, "--joints 10,-80,100,20,40,-40");
    let [quat, abc, wpr] = [&there["quat"], &there["zyx_deg"], &there["fixed_xyz_deg"]];
    let tcp: Vec<Value> = [("quat", quat), ("abc_deg", abc), ("wpr_deg", wpr)]
        .into_iter()
        .map(|(key, value)| {
            let frames = format!(
                "[robot]\nmodel = \"kr210-r2700-2\"\nbase_{key} = {value}\n[tools.\"TOOL_DATA[1]\"]\ntcp_mm = [1, 2, 300]\n\
                 tcp_{key} = {value}\n[wobjs.\"BASE_DATA[1]\"]\nuframe_mm = [900, 0, 100]\nuframe_{key} = {value}\noframe_{key} = {value}\n"
            );
            bench.write("arm.toml", frames);
            json(&bench, "--joints 10,-80,100,20,40,-40 --tool TOOL_DATA[1] --wobj BASE_DATA[1]")
        })
        .collect();
    for other in &tcp[1..] {
        for key in ["position_mm", "quat"] {
            let off =
                numbers(&tcp[0][key]).iter().zip(numbers(&other[key])).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9, "{other:#}");
        }
    }
    let both = "[robot]\nmodel = \"kr210-r2700-2\"\nbase_abc_deg = [0, 0, 0]\nbase_wpr_deg = [0, 0, 0]\n";
    bench.write("arm.toml", both);
    let ran = bench.run("pose --cell arm.toml --joints 0,-90,90,0,0,0").exits(2);
    assert!(
        ran.stderr.contains("base_abc_deg and base_wpr_deg") && ran.stderr.contains("arm.toml:4"),
        "{}",
        ran.stderr
    );
}

/// A track under the robot moves the TCP along with it; the target is then reached with the joints that it was at zero.
#[test]
fn units_stand_where_they_are_said_to() {
    let bench = cell("irb6660-205-1.9");
    let track = "[[unit]]\nname = \"TRACK1\"\naxis = \"eax_b\"\nkind = \"linear\"\ncarries = \"robot\"\n\
                 direction = [0.0, 1.0, 0.0]\nmin = 0.0\nmax = 4000.0\n";
    bench.write("arm.toml", bench.read("arm.toml") + track);
    let still = json(&bench, "--joints 10,-20,30,20,40,-40");
    let moved = json(&bench, "--joints 10,-20,30,20,40,-40 --external 0,1250.5");
    let [a, b] = [&still, &moved].map(|found| numbers(&found["position_mm"]));
    assert!((b[0] - a[0]).abs() < 1e-9 && (b[1] - a[1] - 1250.5).abs() < 1e-9 && (b[2] - a[2]).abs() < 1e-9);
    assert_eq!((&still["units"]["TRACK1"], &moved["units"]["TRACK1"]), (&Value::from(0.0), &Value::from(1250.5)));
    assert!(
        bench.run("pose --cell arm.toml --joints 0,0,0,0,30,0").exits(0).stdout.contains("unit TRACK1 stands at 0 mm")
    );
    let ran = bench.run("pose --cell arm.toml --joints 0,0,0,0,30,0 --external 1,4001").exits(2);
    assert!(ran.stderr.contains("moves eax_a, which no [[unit]]"), "{}", ran.stderr);
    assert!(ran.stderr.contains("puts TRACK1 at 4001, which goes from 0 to 4000 mm"), "{}", ran.stderr);
}

#[test]
fn what_cannot_be_answered_is_said_with_help() {
    let bench = cell("ur10e");
    let ran = bench.run("pose --cell arm.toml --joints 1,2,3").exits(2);
    assert!(ran.stderr.contains("--joints has 3 angles, expected 6"), "{}", ran.stderr);
    let ran = bench.run("pose --cell arm.toml --target 9000,0,0,1,0,0,0").exits(2);
    assert!(ran.stderr.contains("not reached"), "{}", ran.stderr);
    let ran = bench.run("pose --cell arm.toml --target 900,0,0,1,1,0,0").exits(2);
    assert!(ran.stderr.contains("norm is 1.4142"), "{}", ran.stderr);
    let ran = bench.run("pose --cell arm.toml --joints 0,0,0,0,0,0 --tool tMil").exits(2);
    assert!(ran.stderr.contains("did you mean `tMill`"), "{}", ran.stderr);
    bench.run("pose --cell arm.toml").exits(2);
}
