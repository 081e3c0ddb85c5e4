//! A plan from the command line: what it writes is what the other commands read.

use super::bench::Bench;

const CELL: &str = r#"[robot]
model = "irb6660-205-1.9"
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[cut]
force = "table"
[tools.tMill]
tcp_mm = [40.0, 0.0, 310.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
[wobjs.wPart]
uframe_mm = [1000.0, -300.0, 700.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]
[plan]
wobj = "wPart"
tool = "tMill"
box_mm = [[0.0, 0.0, 0.0], [400.0, 600.0, 200.0]]
tilt_deg = 25.0
loads_n = [[0.0, 0.0, 0.0], [0.0, 0.0, 300.0]]
load_changes = 1
instrument = "position"
noise_mm = 0.015
effect_mm = 0.05
effects = ["backlash", "joint_stiffness", "gear_harmonic"]
"#;

#[test]
fn a_plan_is_a_program_and_a_table_to_fill_in() {
    let bench = Bench::new();
    bench.write("shop.toml", CELL);
    let ran = bench
        .run("plan --cell shop.toml --rows 8 -o measure.mod --measured measure.csv --json plan.json --html plan.html")
        .exits(0);
    assert!(ran.stdout.starts_with("8 rows, "), "{}", ran.stdout);
    assert!(ran.stdout.contains("note: not planned for: gear_harmonic"), "{}", ran.stdout);
    let plan: serde_json::Value = serde_json::from_str(&bench.read("plan.json")).unwrap();
    assert_eq!(plan["pairs"].as_array().unwrap().len(), 1);
    assert_eq!(plan["weakest"], plan["pairs"][0]);
    assert!(plan["load_changes"].as_u64().unwrap() <= 1);
    let chance = plan["chance_right"].as_f64().unwrap();
    assert!((0.0..=1.0).contains(&chance) && plan["simulated"].as_u64().unwrap() > 0);
    assert!(bench.read("plan.html").contains("Named rightly"));
    // Every target is reached, and the table is its program's.
    bench.run("predict measure.mod --cell shop.toml --forces measure.csv --report rows.csv").exits(0);
    assert_eq!(bench.read("rows.csv").lines().count(), 9);
    let ran = bench.run("identify --run measure.mod measure.csv --cell shop.toml").exits(2);
    assert!(ran.stderr.contains("no row has a measured position"), "{}", ran.stderr);
    // Places of that program, for what was left undecided.
    bench.write(
        "found.json",
        r#"{ "added": [{ "kind": "backlash", "not_told_apart_from": ["joint_stiffness", "unlisted"] }] }"#,
    );
    bench.run("plan --cell shop.toml --rows 8 -o next.mod --pool measure.mod --after found.json").exits(0);
    let line = |program: &str| -> Vec<String> {
        let moves = program.lines().filter(|line| line.contains("Move"));
        moves.map(|line| line.split("],").next().unwrap().trim()[5..].to_owned()).collect()
    };
    let (known, next) = (line(&bench.read("measure.mod")), line(&bench.read("next.mod")));
    assert!(next.iter().all(|place| known.contains(place)), "{known:?} {next:?}");
}

#[test]
fn what_is_no_plan_is_refused() {
    let bench = Bench::new();
    bench.write("shop.toml", CELL.split("[plan]").next().unwrap());
    let ran = bench.run("plan --cell shop.toml --rows 8 -o measure.mod").exits(2);
    assert!(ran.stderr.contains("shop.toml") && ran.stderr.contains("no [plan] section"), "{}", ran.stderr);
    bench.write("shop.toml", CELL);
    bench.write("found.json", "{}");
    let ran = bench.run("plan --cell shop.toml --rows 8 -o measure.mod --after found.json").exits(2);
    assert!(ran.stderr.contains("not the JSON of an identification"), "{}", ran.stderr);
    bench.run("plan --cell shop.toml --rows 3 -o measure.mod").exits(2);
    assert!(!bench.path("measure.mod").exists());
}

/// Each controller gets its own program, which waits at every target, stops for the operator where that is wanted, and is read
/// back with a row a target.
#[test]
fn a_plan_is_posted_for_the_controller_of_the_cell() {
    let bench = Bench::new();
    let of = |model: &str, tool: &str, wobj: &str, at: &str| {
        CELL.replace("irb6660-205-1.9", model)
            .replace("tools.tMill", &format!("tools.\"{tool}\""))
            .replace("wobjs.wPart", &format!("wobjs.\"{wobj}\""))
            .replace("\"wPart\"", &format!("\"{wobj}\""))
            .replace("\"tMill\"", &format!("\"{tool}\""))
            .replace("1000.0, -300.0, 700.0", at)
            // What is planned for does not matter here, and two effects take half as long again as one.
            .replace(r#"["backlash", "joint_stiffness", "gear_harmonic"]"#, r#"["backlash"]"#)
    };
    for (model, tool, wobj, at, file, words) in [
        (
            "irb6660-205-1.9",
            "tMill",
            "wPart",
            "1000.0, -300.0, 700.0",
            "p.mod",
            ["WaitTime 10;", "UIMsgBox \"Load 0, 0, 300 N\";"],
        ),
        (
            "kr300-r2700-2",
            "TOOL_DATA[1]",
            "BASE_DATA[1]",
            "1500.0, -300.0, 700.0",
            "p.src",
            ["WAIT SEC 10\r\n", "; Load 0, 0, 300 N\r\nHALT\r\n"],
        ),
        (
            "m-710ic-50",
            "UT 1",
            "UF 1",
            "900.0, -300.0, -100.0",
            "p.ls",
            ["WAIT 10.00(sec)", "MESSAGE[Load 0 0 300 N] ;\n"],
        ),
    ] {
        bench.write("shop.toml", of(model, tool, wobj, at));
        bench.run(&format!("plan --cell shop.toml --rows 8 -o {file} --measured p.csv --ask load")).exits(0);
        let text = bench.read(file);
        for word in words {
            assert!(text.contains(word), "{model}: {word} is missing in\n{text}");
        }
        assert_eq!(text.matches(words[0]).count(), 8, "{text}");
        bench.run(&format!("predict {file} --cell shop.toml --forces p.csv --report rows.csv")).exits(0);
        assert_eq!(bench.read("rows.csv").lines().count(), 9, "{model}");
        // The table is its program's: what is missing is what the instrument will say.
        let ran = bench.run(&format!("identify --run {file} p.csv --cell shop.toml")).exits(2);
        assert!(ran.stderr.contains("no row has a measured position"), "{}", ran.stderr);
    }
    // Names of another language are written as frames (KRL), or are refused by name.
    bench.run("plan --cell shop.toml --rows 8 -o q.src --post krl").exits(0);
    assert!(bench.read("q.src").contains("$TOOL = {X ") && bench.read("q.src").contains("$BASE = {X "));
    let ran = bench.run("plan --cell shop.toml --rows 8 -o q.mod --post rapid").exits(2);
    for refused in ["tool `UT 1`: RAPID cannot declare it", "work object `UF 1`: RAPID cannot declare it"] {
        assert!(ran.stderr.contains(refused), "{}", ran.stderr);
    }
    assert!(!bench.path("q.mod").exists());
    let ran = bench.run("plan --cell shop.toml --rows 8 -o p.mod").exits(0);
    assert!(ran.stderr.contains("the program is FANUC TP, but the ending .mod is for RAPID"), "{}", ran.stderr);
    bench.write("shop.toml", of("irb6660-205-1.9", "tMill", "wPart", "1000.0, -300.0, 700.0"));
    bench.run("plan --cell shop.toml --rows 8 -o p.mod --post rapid --ask target").exits(0);
    assert!(bench.read("p.mod").contains("UIMsgBox \"Measure, then go on.\";"));
    let ran = bench.run("plan --cell shop.toml --rows 8 -o q.ls --post ls").exits(2);
    assert!(ran.stderr.contains("tool `tMill`: a FANUC TP program has only a number for it"), "{}", ran.stderr);
}
