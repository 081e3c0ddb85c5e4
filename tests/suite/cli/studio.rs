//! The window: its command line, and what it is given to show. What it does is tested in `crates/studio` and in a browser.

use super::bench::{Bench, deflex};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Stdio};

/// What the window answers about the command to a request with the key of its address.
fn facts(address: &str) -> Value {
    let (url, key) = address.trim().split_once("/#").unwrap();
    let host = url.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET /api/facts HTTP/1.1\r\nhost: {host}\r\nx-deflex-key: {key}\r\nconnection: close\r\n\r\n")
        .unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    serde_json::from_str(text.split_once("\r\n\r\n").unwrap().1).unwrap()
}

#[test]
fn the_window_shows_what_the_command_has() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_deflex"));
    let command = command.args(["studio", "--no-browser"]).arg(folder.path());
    let mut window = command.stdout(Stdio::piped()).spawn().unwrap();
    let mut address = String::new();
    BufReader::new(window.stdout.take().unwrap()).read_line(&mut address).unwrap();
    let facts = facts(&address)["program"].clone();
    window.kill().unwrap();
    window.wait().unwrap();
    assert_eq!(facts["robots"].as_array().unwrap().len(), deflex::robot::BUILTIN.len());
    assert!(facts["materials"].as_array().unwrap().contains(&"al7075".into()));
    assert!(facts["columns"].as_array().unwrap().contains(&"nominal_z_mm".into()));
    assert!(facts["languages"].as_array().unwrap().iter().any(|language| language["word"] == "krl"));
    // Its sections are no robot's own.
    let template = facts["template"].as_str().unwrap();
    assert!(template.starts_with("[limits]") && template.contains("# [stock]") && !template.contains("[robot"));
}

#[test]
fn a_window_that_cannot_open_says_why() {
    let bench = Bench::new();
    let missing = bench.run("studio nowhere --no-browser").exits(2);
    assert!(missing.stderr.contains("io.read") && missing.stderr.contains("nowhere"), "{}", missing.stderr);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let refused = bench.run(&format!("studio . --no-browser --port {port}")).exits(2);
    assert!(refused.stderr.contains("studio.port"), "{}", refused.stderr);
    bench.run("studio . --port 0").exits(2);
}

#[test]
fn messages_for_a_program_are_one_object_a_line() {
    let folder = tempfile::tempdir().unwrap();
    let cell = deflex::cell::template(&deflex::robot::BUILTIN[0]);
    std::fs::write(folder.path().join("cell.toml"), cell.replace("diameter_mm", "diametre_mm")).unwrap();
    let pose = ["pose", "--cell", "cell.toml", "--joints", "0,0,0,0,0,0"];
    let of = |arguments: &[&str], expected: i32| {
        let ran = deflex(folder.path()).args(arguments).env("DEFLEX_MESSAGES", "json").output().unwrap();
        assert_eq!(ran.status.code(), Some(expected));
        let text = String::from_utf8(ran.stderr).unwrap();
        text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()).collect::<Vec<_>>()
    };
    let said = |expected: i32| of(&pose, expected);
    let missing = of(&["pose", "--joints", "0,0,0,0,0,0"], 2);
    assert!(
        missing[0]["code"] == "usage.arguments" && missing[0]["message"].as_str().unwrap().ends_with("--cell <CELL>")
    );
    let [wrong] = &said(2)[..] else { panic!("one message") };
    let line = 1 + cell.lines().position(|line| line.starts_with("diameter_mm")).unwrap();
    assert_eq!((wrong["severity"].as_str(), wrong["file"].as_str()), (Some("error"), Some("cell.toml")));
    assert_eq!((wrong["line"].as_u64(), wrong["column"].as_u64()), (Some(line as u64), Some(1)));
    assert!(wrong["help"].as_str().unwrap().contains("diameter_mm"));
    // `pose` reports what is doubtful, as other commands do.
    std::fs::write(folder.path().join("cell.toml"), cell.replace("mass_kg = 18.0", "mass_kg = 18000.0")).unwrap();
    let doubts = said(0);
    assert!(doubts.iter().any(|doubt| doubt["code"] == "cell.example"), "{doubts:?}");
    assert!(doubts.iter().any(|doubt| doubt["message"].as_str().unwrap().contains("it looks like g")), "{doubts:?}");
}
