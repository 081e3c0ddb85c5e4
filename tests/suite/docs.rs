//! The commands of the README and of `docs/` run as they stand.

use std::path::Path;
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The reader's own cell, once its lines are filled in.
const FILLED_IN: &str = "filled_in.toml";

/// The `sh` blocks of a page.
fn blocks(page: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut block: Option<Vec<String>> = None;
    for line in page.lines() {
        match &mut block {
            None if line == "```sh" => block = Some(Vec::new()),
            None => {}
            Some(_) if line == "```" => found.extend(block.take()),
            Some(lines) => lines.push(line.to_owned()),
        }
    }
    assert!(block.is_none(), "a block does not end");
    found
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            if entry.file_name() != "out" {
                copy(&entry.path(), &target);
            }
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// A folder as a user has it: the samples, and a program and a cell of their own.
fn workplace() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let samples = Path::new(ROOT).join("samples");
    copy(&samples, &folder.path().join("samples"));
    // Coarser than in the samples: the commands are what is tested, and they take a quarter of the time.
    for (cell, fine, coarse) in
        [("wall", "cell_mm = 0.8", "cell_mm = 3.2"), ("stock", "resolution_mm = 0.25", "resolution_mm = 1.0")]
    {
        let cell = folder.path().join("samples").join(cell).join("cell.toml");
        let text = std::fs::read_to_string(&cell).unwrap();
        assert!(text.contains(fine), "{}: no `{fine}`", cell.display());
        std::fs::write(cell, text.replace(fine, coarse)).unwrap();
    }
    std::fs::create_dir_all(folder.path().join("samples/out")).unwrap();
    std::fs::copy(samples.join("slot/slot.mod"), folder.path().join("part.mod")).unwrap();
    let tool = "[tools.tMill]\ntcp_mm = [12.0, -3.0, 310.0]\ntcp_quat = [1.0, 0.0, 0.0, 0.0]\n";
    let cell = std::fs::read_to_string(samples.join("slot/cell.toml")).unwrap() + tool;
    for name in ["cell.toml", FILLED_IN] {
        std::fs::write(folder.path().join(name), &cell).unwrap();
    }
    std::fs::write(folder.path().join("postures.csv"), postures(&cell)).unwrap();
    folder
}

/// Twenty postures as the pendant shows them: to 0.01° and 0.01 mm.
fn postures(cell: &str) -> String {
    let cell = deflex::cell::Cell::read(&deflex::text::Source::new("cell.toml", cell)).unwrap();
    let tool = cell.tools["TMILL"].flange_from_tcp;
    let mut csv = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n".to_owned();
    for i in 0..20 {
        let wave = |period: i32, reach: f64| 0.1003 * reach * f64::from(i * period % 20 - 10);
        let deg = [wave(3, 40.0), wave(7, 20.0), wave(9, 20.0), wave(11, 90.0), 30.0 + wave(13, 40.0), wave(17, 120.0)];
        let motor = deflex::robot::Joints::from(deg.map(f64::to_radians));
        let at = (cell.arm.robot.forward(&motor) * tool).translation.vector * 1e3;
        csv += &deg.map(|deg| format!("{deg:.2},")).concat();
        csv += &format!("{:.2},{:.2},{:.2}\n", at.x, at.y, at.z);
    }
    csv
}

/// Runs the lines of a block that call deflex or make folders, each from where `cd` has led; exit code 1 is an answer.
fn run(block: &[String], folder: &Path, page: &str) {
    let binary = Path::new(env!("CARGO_BIN_EXE_deflex")).parent().unwrap();
    let path = format!("{}:{}", binary.display(), std::env::var("PATH").unwrap());
    let text = block.join("\n").replace("\\\n", " ");
    let mut ran = 0;
    let ours = |part: &str| part.trim().starts_with("deflex ") || part.trim().starts_with("mkdir ");
    for line in text.lines().filter(|line| line.split(" && ").any(ours)) {
        // What was measured on the reader's own part is not here.
        if line.contains("part.mod measured.csv") && !line.contains("closed-loop") {
            continue;
        }
        let done = Command::new("sh")
            .args(["-c", line])
            .current_dir(folder)
            .env("PATH", &path)
            .env("HOME", folder)
            .output()
            .unwrap();
        let code = done.status.code().unwrap();
        assert!(code <= 1, "{page}: `{line}` ends with {code}:\n{}", String::from_utf8_lossy(&done.stderr));
        ran += 1;
        // The cell that `init` prints has lines to fill in; the reader has filled them in here.
        if line.contains("> cell.toml") {
            std::fs::copy(folder.join(FILLED_IN), folder.join("cell.toml")).unwrap();
        }
    }
    let calls = text.lines().any(|line| line.starts_with("deflex ") || line.contains("&& deflex "));
    assert!(ran > 0 || !calls, "{page}: nothing of a block was run");
}

#[test]
fn commands_of_the_documentation_run() {
    let mut pages = vec![Path::new(ROOT).join("README.md")];
    pages.extend(std::fs::read_dir(Path::new(ROOT).join("docs")).unwrap().map(|entry| entry.unwrap().path()));
    pages.retain(|page| page.extension().is_some_and(|ending| ending == "md"));
    let mut found = 0;
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        let folder = workplace();
        for block in blocks(&text) {
            run(&block, folder.path(), &page.display().to_string());
            found += 1;
        }
    }
    assert!(found > 5);
}

/// Links between pages lead somewhere.
#[test]
fn links_lead_to_files() {
    let root = Path::new(ROOT);
    let mut pages = vec![root.join("README.md")];
    pages.extend(std::fs::read_dir(root.join("docs")).unwrap().map(|entry| entry.unwrap().path()));
    for page in pages.iter().filter(|page| page.extension().is_some_and(|ending| ending == "md")) {
        let text = std::fs::read_to_string(page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap();
            assert!(file.is_empty() || page.parent().unwrap().join(file).exists(), "{}: {link}", page.display());
        }
    }
}

/// The book has each page once.
#[test]
fn every_page_is_in_the_summary() {
    let docs = Path::new(ROOT).join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let pages = std::fs::read_dir(&docs).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<String> = pages.filter(|name| name.ends_with(".md") && name != "SUMMARY.md").collect();
    let links = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let mut listed: Vec<String> = links.map(str::to_owned).collect();
    pages.sort();
    listed.sort();
    assert_eq!(listed, pages);
}

/// The page of effects has a row for each kind, in the order of the code.
#[test]
fn every_effect_is_documented() {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/effects.md")).unwrap();
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    let kinds: Vec<&str> = deflex::effects::KINDS.iter().map(|kind| kind.name).collect();
    assert_eq!(rows.collect::<Vec<_>>(), kinds);
    // Each row names the keys of its effect.
    for kind in deflex::effects::KINDS {
        let row = page.lines().find(|line| line.starts_with(&format!("| `{}`", kind.name))).unwrap();
        let words: std::collections::BTreeSet<&str> =
            row.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).collect();
        for form in kind.forms {
            let table: toml::Table = toml::from_str(form).unwrap();
            for key in table.keys() {
                assert!(words.contains(&**key), "docs/effects.md: `{}` has no `{key}`", kind.name);
            }
        }
    }
}

/// The page of formats has each column of a measured file.
#[test]
fn every_column_of_a_measured_file_is_documented() {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/formats.md")).unwrap();
    let section = page.split("## Measured file").nth(1).unwrap().split("\n## ").next().unwrap();
    let words: std::collections::BTreeSet<&str> =
        section.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).collect();
    let missing: Vec<&str> = deflex::measured::column_names().filter(|name| !words.contains(name)).collect();
    assert!(missing.is_empty(), "docs/formats.md, Measured file: no word of {missing:?}");
}

/// The page of limits has a row for each bound of the code, in its order, with its number and what to change.
#[test]
fn every_bound_is_documented() {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/limits-and-safety.md")).unwrap();
    let table = page.split("| counted | at most |").nth(1).unwrap().split("\n\n").next().unwrap();
    let rows: Vec<Vec<&str>> = table.lines().skip(2).map(|row| row.split('|').map(str::trim).collect()).collect();
    assert_eq!(rows.len(), deflex::limits::ALL.len());
    for (row, bound) in rows.iter().zip(deflex::limits::ALL) {
        assert_eq!([row[1], &row[2].replace(',', ""), row[3]], [bound.what, &bound.most.to_string(), bound.help]);
        assert!(!row[4].is_empty(), "{}", bound.what);
    }
}

/// Cell files on the pages are read; where only a part is shown, the sample's robot stands before it.
#[test]
fn cell_files_of_the_documentation_are_read() {
    let robot =
        "[robot]\nmodel = \"irb6660-205-1.9\"\n[robot.stiffness]\njoint_nm_per_rad = [1e6, 1e6, 1e6, 1e6, 1e6, 1e6]\n";
    let mut found = 0;
    for entry in std::fs::read_dir(Path::new(ROOT).join("docs")).unwrap() {
        let path = entry.unwrap().path();
        let Ok(page) = std::fs::read_to_string(&path) else { continue };
        for block in page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()) {
            // The tutorial's own test writes this file, step by step, and runs deflex on it.
            if block.starts_with("# cell.toml") {
                continue;
            }
            let text = if block.contains("[robot]") { block.to_owned() } else { format!("{robot}{block}") };
            let read = deflex::cell::Cell::read(&deflex::text::Source::new(path.display().to_string(), text));
            assert!(read.is_ok(), "{:?}", read.err());
            found += 1;
        }
    }
    assert!(found > 0);
}

/// The check of a new cell's kinematics: right rows leave the pendant's rounding, a wrong length shows.
#[test]
fn postures_from_the_pendant_distinguish_right_rows_from_wrong_ones() {
    let folder = workplace();
    let rms = |name: &str| {
        let arguments = ["identify", "--poses", "postures.csv", "--cell", name, "--tool", "tMill", "--json", "-", "-q"];
        let done =
            Command::new(env!("CARGO_BIN_EXE_deflex")).args(arguments).current_dir(folder.path()).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let found: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        found["before"]["rms_mm"].as_f64().unwrap()
    };
    let cell = std::fs::read_to_string(folder.path().join("cell.toml")).unwrap();
    assert!(cell.contains("a_mm = 700.0"));
    std::fs::write(folder.path().join("wrong.toml"), cell.replace("a_mm = 700.0", "a_mm = 705.0")).unwrap();
    let (right, wrong) = (rms("cell.toml"), rms("wrong.toml"));
    assert!(right < 0.3 && wrong > 0.5, "{right} mm, {wrong} mm");
}

#[test]
fn every_column_of_the_report_is_documented() {
    let mut rows: Vec<(Vec<String>, &str)> = Vec::new();
    for column in deflex::report::REPORT_COLUMNS {
        let name = format!("`{}`", column.name);
        match (column.doc, rows.last_mut()) {
            ("", Some((names, _))) => names.push(name),
            (doc, _) => rows.push((vec![name], doc)),
        }
    }
    let table: String = rows.iter().map(|(names, doc)| format!("| {} | {doc} |\n", names.join(", "))).collect();
    let formats = std::fs::read_to_string(Path::new(ROOT).join("docs/formats.md")).unwrap();
    assert!(formats.contains(&table), "docs/formats.md is to have this table:\n{table}");
}

/// The reference of the cell file has each key of the code.
#[test]
fn every_key_of_the_cell_is_documented() {
    let read = |name: &str| std::fs::read_to_string(Path::new(ROOT).join(name)).unwrap();
    let (keys, page) = (read("crates/cell/src/raw.rs"), read("docs/formats.md"));
    let section = page.split("## Cell file").nth(1).unwrap().split("## Measured file").next().unwrap();
    let fields = keys.lines().filter_map(|line| line.strip_prefix("    pub(super) ")?.split_once(": "));
    let names: Vec<&str> = fields.map(|(name, _)| name).filter(|name| !name.contains(' ')).collect();
    assert!(names.len() > 80, "{} keys", names.len());
    // Names in the code of tables and in code blocks: a name in prose explains nothing.
    let mut words = std::collections::BTreeSet::new();
    for (i, block) in section.split("```").enumerate() {
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if i % 2 == 1 {
            words.extend(block.split(|c| !is_word(c)));
        } else {
            let rows = block.lines().filter(|line| line.starts_with('|'));
            let code = rows.flat_map(|row| row.split('`').skip(1).step_by(2));
            words.extend(code.flat_map(|code| code.split(|c| !is_word(c))));
        }
    }
    let missing: Vec<&&str> = names.iter().filter(|name| !words.contains(**name)).collect();
    assert!(missing.is_empty(), "docs/formats.md, Cell file: no row has {missing:?}");
}

/// What `deflex` prints with some arguments.
fn printed(arguments: &[&str]) -> String {
    let done = Command::new(env!("CARGO_BIN_EXE_deflex")).args(arguments).output().unwrap();
    String::from_utf8(done.stdout).unwrap()
}

/// The names of the commands, or of those within a command, as its help lists them.
fn commands(of: &[&str]) -> Vec<String> {
    let help = printed(&[of, &["--help"]].concat());
    let list = help.split("Commands:\n").nth(1).unwrap_or_default().split("\n\n").next().unwrap();
    let is_name = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let names = list.lines().filter(is_name).filter_map(|line| line.split_whitespace().next());
    names.map(str::to_owned).collect()
}

/// The arguments and options in the help of a command, with their texts.
fn options(help: &str) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let mut is_listed = false;
    for line in help.lines() {
        if !line.starts_with(' ') && !line.is_empty() {
            is_listed = ["Arguments:", "Options:"].contains(&line);
        }
        let text = line.trim();
        if !is_listed || text.is_empty() || !line.starts_with(' ') {
            continue;
        }
        let indent = line.len() - line.trim_start().len();
        if indent <= 6 && text.starts_with(['-', '<', '[']) {
            let (option, text) = text.split_once("  ").unwrap_or((text, ""));
            found.push((option.to_owned(), text.trim().to_owned()));
        } else if let Some((_, all)) = found.last_mut() {
            let between = if all.is_empty() { "" } else { " " };
            *all += &format!("{between}{text}");
        }
    }
    found.retain(|(option, _)| !["-h, --help", "-V, --version"].contains(&&**option));
    found
}

/// The text of an option with its values and its default as sentences.
fn sentences(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let (text, default) = text.split_once(" [default: ").map_or((&*text, ""), |(text, rest)| (text, rest));
    let (default, values) = match default.split_once(']') {
        Some((default, rest)) => (default, rest.trim()),
        None => ("", ""),
    };
    let (text, own) = text.split_once(" [possible values: ").map_or((text, values), |(text, rest)| (text, rest));
    let values = own.trim_start_matches("[possible values: ").trim_end_matches(']');
    let (text, listed) = text.split_once(" Possible values: - ").unwrap_or((text, ""));
    let listed = listed.replace(" - ", "; ");
    let mut all = text.to_owned();
    for (what, value) in [("Values", values), ("Values", &listed), ("Default", default)] {
        if !value.is_empty() {
            all += &format!(". {what}: {value}");
        }
    }
    all
}

/// The page of options, made from the help of the commands. `UPDATE_OPTIONS=1` writes it.
#[test]
fn every_option_is_documented() {
    let mut page = "# Options\n\nThis page lists the arguments and options of each command, as `deflex COMMAND --help` prints them. A test \
                    makes it: `UPDATE_OPTIONS=1\ncargo test --test suite every_option` writes it.\n"
        .to_owned();
    let mut named: Vec<String> = Vec::new();
    for name in commands(&[]) {
        let own = commands(&[&name]);
        named.extend(if own.is_empty() { vec![name] } else { own.iter().map(|own| format!("{name} {own}")).collect() });
    }
    for name in named {
        let arguments: Vec<&str> = name.split(' ').chain(["--help"]).collect();
        let options = options(&printed(&arguments));
        assert!(!options.is_empty(), "{name}");
        page += &format!("\n## deflex {name}\n\n| option | meaning |\n|---|---|\n");
        for (option, text) in options {
            page += &format!("| `{}` | {} |\n", option.replace('|', "\\|"), sentences(&text).replace('|', "\\|"));
        }
    }
    let file = Path::new(ROOT).join("docs/options.md");
    if std::env::var_os("UPDATE_OPTIONS").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    let written = std::fs::read_to_string(file).unwrap_or_default();
    let differing = written.lines().zip(page.lines()).find(|(written, made)| written != made);
    assert!(written == page, "docs/options.md differs ({differing:?}): UPDATE_OPTIONS=1 writes it");
}

/// The reference has each command.
#[test]
fn every_command_is_documented() {
    let names = commands(&[]);
    assert!(names.len() > 10, "{names:?}");
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/reference.md")).unwrap();
    for name in names {
        assert!(page.contains(&format!("| `deflex {name}")), "docs/reference.md has no row for `{name}`");
    }
}

/// Keys of a JSON value and of all values in it, without those below a key whose own keys are names of other things.
fn keys(value: &serde_json::Value, found: &mut std::collections::BTreeSet<String>) {
    match value {
        serde_json::Value::Array(all) => all.iter().for_each(|value| keys(value, found)),
        serde_json::Value::Object(all) => {
            for (key, value) in all {
                found.insert(key.clone());
                keys(value, found);
            }
        }
        _ => {}
    }
}

/// The reference has each key of the JSON that the commands write.
#[test]
fn every_key_of_the_json_is_documented() {
    let samples = Path::new(ROOT).join("samples");
    let runs = [
        "compensate slot/slot.mod --cell slot/cell.toml -q -o /dev/null --json -",
        "predict units/units.mod --cell units/cell.toml -q --json -",
        "check slot/slot.mod --cell slot/cell.toml --max-error 0.14 -q --output-format json",
        "inspect slot/slot.mod kuka/ring.src --json",
        "simulate stock/part.mod --cell stock/cell.toml -q --json -",
        "diff slot/slot.mod blade/blade.mod -q --json -",
        "identify --run closed-loop/part.mod closed-loop/measured.csv --cell closed-loop/cell.toml -q --json -",
        "pose --cell slot/cell.toml --joints 0,0,0,0,30,0 --json",
    ];
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/reference.md")).unwrap();
    let words: std::collections::BTreeSet<&str> =
        page.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).collect();
    for run in runs {
        let done =
            Command::new(env!("CARGO_BIN_EXE_deflex")).args(run.split(' ')).current_dir(&samples).output().unwrap();
        let json: serde_json::Value =
            serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{run}: {error}"));
        let mut found = std::collections::BTreeSet::new();
        keys(&json, &mut found);
        let missing: Vec<&String> = found.iter().filter(|key| !words.contains(&***key)).collect();
        assert!(missing.is_empty(), "{run}: docs/reference.md has no word of {missing:?}");
    }
}
