//! `--html`: one page, complete in itself, the same for any number of threads.

use super::bench::{Bench, PROGRAM};

/// What a page may not hold: anything that asks a network.
#[track_caller]
fn stands_alone(page: &str) {
    for asks in ["src=\"http", "href=\"http", "url(http", "@import", "fetch(", "XMLHttpRequest"] {
        assert!(!page.contains(asks), "{asks}");
    }
    assert!(page.contains("default-src 'none'") && page.contains("The MIT License") && page.ends_with("</html>\n"));
}

#[test]
fn every_command_draws_its_page() {
    let bench = Bench::new();
    bench.run("compensate part.mod --cell cell.toml -o out.mod --html compensate.html").exits(0);
    bench.run("predict part.apt --cell cell.toml --html predict.html").exits(0);
    bench.run("check part.mod --cell cell.toml --max-error 1 --html check.html").exits(0);
    bench.run("diff part.mod out.mod --html diff.html").exits(1);
    for name in ["compensate", "predict", "check", "diff"] {
        stands_alone(&bench.read(&format!("{name}.html")));
    }
    assert!(bench.read("check.html").contains("every target is reached and within tolerance"));
    bench.run("check part.mod --cell cell.toml --max-error 0.05 --html found.html").exits(1);
    let found = bench.read("found.html");
    assert!(found.contains("target 3: error of 0.") && found.contains("<td class=\"number\">7</td>"));
    assert!(bench.read("diff.html").contains("part.mod → out.mod"));
    let printed = bench.run("predict part.mod --cell cell.toml --html -").exits(0).stdout;
    assert!(printed.starts_with("<!DOCTYPE html>"), "{printed}");
}

#[test]
fn threads_do_not_change_a_page() {
    let bench = Bench::new();
    bench.write("second.mod", PROGRAM);
    let page = |jobs: usize| {
        bench
            .run(&format!(
                "compensate part.mod second.mod --cell cell.toml --out-dir out --html page.html --jobs {jobs}"
            ))
            .exits(0);
        bench.read("page.html")
    };
    assert_eq!(page(1), page(3));
}

#[test]
fn a_failed_run_leaves_no_page_and_no_page_takes_a_programs_place() {
    let bench = Bench::new();
    bench.write("far.mod", PROGRAM.replace("[[100,0,0]", "[[9000,0,0]"));
    bench.run("compensate far.mod --cell cell.toml -o out.mod --html page.html").exits(2);
    assert!(!bench.path("page.html").exists());
    bench.run("compensate part.mod --cell cell.toml -o out.mod --html part.mod").exits(2);
    assert_eq!(bench.read("part.mod"), PROGRAM);
}
