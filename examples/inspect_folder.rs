//! Reads every RAPID file under a folder (`DEFLEX_CORPUS`) and prints one line each: for trying the
//! reader on programs that are not ours to keep.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use deflex::program::{Role, rapid, round_trip};
use deflex::text::Source;
use std::path::{Path, PathBuf};

fn main() {
    let Ok(folder) = std::env::var("DEFLEX_CORPUS") else {
        println!("set DEFLEX_CORPUS to a folder of RAPID files");
        return;
    };
    let mut files = Vec::new();
    collect(Path::new(&folder), &mut files);
    files.sort();
    println!("file\tdialect\tmotions\tends\tliterals\tarcs\tkept\tround trip\treasons");
    for path in files {
        let name = path.strip_prefix(&folder).unwrap_or(&path).display().to_string();
        let bytes = std::fs::read(&path).unwrap();
        match rapid::read(vec![Source::new(&name, bytes)], Vec::new()) {
            Err(errors) => println!("{name}\trefused\t\t\t\t\t\t\t{}", errors[0]),
            Ok(program) => {
                let trip = round_trip(&program, rapid::read);
                let ends = program.targets.iter().filter(|t| t.role == Role::End).count();
                let mut reasons: Vec<(&str, usize)> = Vec::new();
                for kept in &program.kept {
                    match reasons.iter_mut().find(|r| r.0 == kept.reason.text()) {
                        Some(reason) => reason.1 += 1,
                        None => reasons.push((kept.reason.text(), 1)),
                    }
                }
                let trip = if trip.holds() { "ok".to_owned() } else { trip.why.unwrap_or_default() };
                println!(
                    "{name}\t{}\t{}\t{ends}\t{}\t{}\t{}\t{trip}\t{reasons:?}",
                    program.dialect,
                    program.motion_targets(),
                    program.literal_targets,
                    program.arcs,
                    program.kept.len(),
                );
            }
        }
    }
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() { collect(&path, files) } else { files.push(path) }
    }
}
