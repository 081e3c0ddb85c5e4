//! What the tool teaches about itself.

use super::bench::{Bench, deflex};

#[test]
fn help_of_every_command() {
    let bench = Bench::new();
    let mut all = String::new();
    for command in ["", "compensate", "predict", "diff", "check", "identify", "inspect", "init", "studio", "generate"] {
        let ran = bench.run(&format!("{command} --help")).exits(0);
        assert!(ran.stderr.is_empty());
        all += &format!("$ deflex {command} --help\n{}\n", ran.stdout);
    }
    insta::assert_snapshot!(all);
}

#[test]
fn bad_usage_is_two_and_says_so_on_stderr() {
    let bench = Bench::new();
    for arguments in ["", "compensat part.mod", "compensate part.mod", "check part.mod --cell cell.toml --max-error -1"]
    {
        let ran = bench.run(arguments).exits(2);
        assert!(ran.stdout.is_empty() && !ran.stderr.is_empty(), "{arguments}");
    }
}

#[test]
fn every_built_in_robot_has_a_cell_that_reads() {
    let bench = Bench::new();
    let list = bench.run("init --list").exits(0).stdout;
    let models: Vec<&str> = list.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(models.contains(&"irb6660-205-1.9"));
    for robot in deflex::robot::BUILTIN.iter() {
        assert!(models.contains(&&robot.model[..]), "{}", robot.model);
        let text = deflex::cell::template(robot).into_bytes();
        deflex::cell::Cell::read(&deflex::text::Source::new("new.toml", text)).unwrap();
    }
    for model in ["irb6660-205-1.9", "kr300-r2700-2", "ur10e"] {
        let cell = bench.run(&format!("init --robot {model}")).exits(0).stdout;
        // No other robot's stiffness stands there.
        assert_eq!(cell.contains("8.86e5") || cell.contains("886000.0"), model == "irb6660-205-1.9", "{model}");
        bench.write("new.toml", super::init::with_stiffness(&cell));
        // Far or near, the cell itself is read: at most the target is not reached.
        let ran = bench.run("check part.mod --cell new.toml --max-error 5");
        assert!(ran.code != Some(2), "{model}: {}", ran.stderr);
    }
}

#[test]
fn an_unknown_robot_names_the_nearest() {
    let ran = Bench::new().run("init --robot irb6660-205").exits(2);
    assert!(ran.stderr.contains("did you mean `irb6660-205-1.9`?"), "{}", ran.stderr);
    let ran = Bench::new().run("init").exits(2);
    assert!(ran.stderr.contains("irb120-3-0.58") && ran.stderr.contains("[robot.kinematics]"), "{}", ran.stderr);
}

#[test]
fn the_list_of_robots_is_a_table_that_can_be_filtered() {
    let bench = Bench::new();
    let list = bench.run("init --list").exits(0).stdout;
    let head = list.lines().next().unwrap();
    assert_eq!(head.split_whitespace().collect::<Vec<_>>().join(" "), "model maker payload kg reach mm source");
    assert!(
        list.lines().any(|line| line.starts_with("irb6700-155-2.85") && line.contains("155") && line.contains("2850"))
    );
    let models = |filter: &str| -> Vec<String> {
        let list = bench.run(&format!("init --list {filter}")).exits(0).stdout;
        list.lines().skip(1).filter_map(|line| Some(line.split_whitespace().next()?.to_owned())).collect()
    };
    let of_series = models("IRB6700");
    assert!(of_series.len() == 8 && of_series.is_sorted(), "{of_series:?}");
    assert!(models("kr240").iter().all(|model| model.starts_with("kr240-")) && models("kr240").len() > 2);
    assert!(models("fanuc").contains(&"m-20ia".to_owned()));
    assert!(bench.run("init --list nothing").exits(2).stderr.contains("a model with `nothing`"));
    // As the maker writes it; a part of a name is none, and names the nearest few.
    let cell = bench.run("init --robot IRB_6700-150/3.2").exits(0).stdout;
    assert!(cell.contains("model = \"irb6700-150-3.20\""), "{cell}");
    let ran = bench.run("init --robot kr240").exits(2);
    assert!(ran.stderr.matches("kr240-").count() <= 8 && !ran.stderr.contains("irb"), "{}", ran.stderr);
    bench.write("arm.toml", "[robot]\nmodel = \"KR 240 R2900-2\"\n");
    bench.run("pose --cell arm.toml --joints 0,-90,90,0,0,0").exits(0);
    bench.write("arm.toml", "[robot]\nmodel = \"kr240\"\n");
    let ran = bench.run("pose --cell arm.toml --joints 0,-90,90,0,0,0").exits(2);
    assert!(ran.stderr.contains("arm.toml:2:9") && ran.stderr.len() < 800, "{}", ran.stderr);
}

#[test]
fn a_closed_pipe_is_no_fault() {
    let bench = Bench::new();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let arguments = ["predict", "part.mod", "--cell", "cell.toml", "--quiet"];
    let binary = deflex(&bench.path("")).get_program().to_owned();
    let status =
        std::process::Command::new(binary).args(arguments).current_dir(bench.path("")).stdout(writer).status().unwrap();
    assert!(status.success());
}
