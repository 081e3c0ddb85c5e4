//! Runs programs before and after their correction on concrete inputs and compares every motion.
//!
//! `second_reading table` prints what becomes of each hand-written construct.

#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used)]

#[path = "../tests/suite/second_reading/mod.rs"]
mod second_reading;

use deflex::correct::Options;
use second_reading::cl;
use second_reading::cl_table::CUTS;
use second_reading::compare::{Bench, Verdict, options_for, spread};
use second_reading::generate::program;
use second_reading::minimise::{minimised, whole};
use second_reading::table::cases;
use std::collections::BTreeMap;
use std::process::ExitCode;

fn main() -> ExitCode {
    // A panic is counted and shown as a verdict.
    std::panic::set_hook(Box::new(|_| {}));
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| args.get(i).map_or(default, |text| text.parse().unwrap());
    match args.first().map(String::as_str) {
        Some("table") => table(args.get(1).map(String::as_str), args.len() > 2),
        Some("random") => return random(number(1, 1000), number(2, 0), number(3, 10) as usize),
        Some("cl") => cl_table(args.get(1).map(String::as_str)),
        Some("show") => program(number(1, 0)).iter().for_each(|module| println!("{}", numbered(module))),
        _ => println!("second_reading table [NAME [SHOW]] | random [COUNT [FIRST [SHOWN]]] | show SEED | cl [NAME]"),
    }
    ExitCode::SUCCESS
}

fn numbered(text: &str) -> String {
    text.lines().enumerate().map(|(i, line)| format!("{:4} {line}\n", i + 1)).collect()
}

fn table(only: Option<&str>, show: bool) {
    let bench = Bench::new();
    for case in cases().filter(|case| only.is_none_or(|only| case.name.contains(only))) {
        let text = case.text();
        let (word, what) = match bench.judge(std::slice::from_ref(&text), 0..12, &Options::default()) {
            Verdict::Right { corrected, .. } if corrected >= case.least => ("right", format!("{corrected}")),
            Verdict::Right { corrected, left } => ("left", format!("{corrected} of {}: {left:?}", case.least)),
            Verdict::Refused(why) => ("refused", why),
            Verdict::Wrong(why) => ("WRONG", why),
            Verdict::Invalid(why) => ("INVALID", why),
        };
        println!("{word:8}{:55}{what}", case.name);
        if show {
            println!("{}", numbered(&text));
        }
    }
}

fn cl_table(only: Option<&str>) {
    for cut in CUTS.iter().filter(|cut| only.is_none_or(|only| cut.name.contains(only))) {
        let (word, what) = match cl::judge(cut) {
            Verdict::Right { .. } => ("right", String::new()),
            Verdict::Refused(why) => ("refused", why),
            Verdict::Wrong(why) => ("WRONG", why),
            Verdict::Invalid(why) => ("INVALID", why),
        };
        println!("{word:8}{:46}{what}", cut.name);
    }
}

fn random(count: u64, first: u64, shown: usize) -> ExitCode {
    /// Choices of inputs for each program.
    const INPUTS: std::ops::Range<u64> = 0..4;
    let bench = Bench::new();
    let seeds: Vec<u64> = (first..first + count).collect();
    let judge = |modules: &[String], seed: u64| bench.judge(modules, INPUTS, &options_for(modules, seed));
    let verdicts = spread(&seeds, |&seed| judge(&program(seed), seed));
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut refusals: BTreeMap<String, usize> = BTreeMap::new();
    let mut wrong = Vec::new();
    let (mut corrected, mut left) = (0, 0);
    for (seed, verdict) in seeds.iter().zip(verdicts) {
        let word = match verdict {
            Verdict::Right { corrected: c, left: l } => {
                corrected += c;
                left += l.len();
                if l.is_empty() {
                    "right, all corrected"
                } else if c > 0 {
                    "right, some left"
                } else {
                    "right, all left"
                }
            }
            Verdict::Refused(why) => {
                let code = why.rsplit('[').next().unwrap_or("").trim_end_matches(']').to_owned();
                *refusals.entry(code).or_default() += 1;
                "refused"
            }
            Verdict::Wrong(why) => {
                wrong.push((*seed, why));
                "WRONG"
            }
            Verdict::Invalid(why) => {
                if std::env::var_os("INVALID").is_some() {
                    println!("invalid {seed}: {why}");
                }
                "no program"
            }
        };
        *counts.entry(word).or_default() += 1;
    }
    println!("{counts:?}; motions corrected {corrected}, lines left {left}; refused {refusals:?}");
    let mut seen = Vec::new();
    for (seed, why) in &wrong {
        if seen.len() >= shown {
            break;
        }
        // A smaller program must differ in the same way, and not in another one.
        let kind = |why: &str| {
            (why.contains("panics"), why.contains("nothing says"), why.contains("moved by"), why.contains("said to be"))
        };
        let still = |modules: &[String]| match judge(modules, *seed) {
            Verdict::Wrong(now) => kind(&now) == kind(why) && whole(modules),
            _ => false,
        };
        let least = minimised(&program(*seed), still);
        let words: Vec<&str> = least.iter().flat_map(|m| m.split_whitespace()).collect();
        let key = words.join(" ").chars().filter(|c| !c.is_ascii_digit()).collect::<String>();
        if seen.contains(&key) {
            continue;
        }
        seen.push(key);
        let now = judge(&least, *seed);
        println!("--- seed {seed}: {why}\n    least: {now:?}");
        least.iter().for_each(|module| println!("{}", numbered(module)));
    }
    if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
