//! What snapshots of fixtures have.

use deflex::program::{Goal, Program};
use deflex::text::Diagnostic;
use std::fmt::Write;

/// What is known of a program, a line for each target and for each statement that is kept.
pub(super) fn listed(program: &Program) -> String {
    let mut out = String::new();
    let round = |values: &[f64]| values.iter().map(|v| format!("{v:.3}")).collect::<Vec<_>>().join(" ");
    for (i, target) in program.targets.iter().enumerate() {
        let (tool, wobj) =
            (&program.tools[usize::from(target.tool)].name, &program.wobjs[usize::from(target.wobj)].name);
        let goal = match target.goal {
            Goal::Pose { position_mm, quat, conf } => {
                format!("{} / {}{}", round(&position_mm), round(&quat), if conf.is_some() { " near" } else { "" })
            }
            Goal::Joints { deg } => format!("joints {}", round(&deg)),
            Goal::Axis { .. } => unreachable!("no CL data"),
        };
        let _ = writeln!(
            out,
            "{} line {} {:?} {:?} {goal}; {tool} in {wobj}; {:?} mm/s, {:?}, {:?}, {:?}, {:?}",
            target.ordinal,
            target.line,
            target.role,
            target.motion,
            target.feed_mm_s,
            program.passing(i),
            target.mark,
            target.predecessor,
            target.editable
        );
    }
    for kept in &program.kept {
        let _ = writeln!(out, "kept line {}: {}", kept.line, kept.reason);
    }
    for said in &program.diagnostics {
        let _ = writeln!(out, "{said}");
    }
    out
}

/// Why a program is refused, each reason with what to do about it.
pub(super) fn refused(errors: &[Diagnostic]) -> String {
    let said = |error: &Diagnostic| format!("{error}\nhelp: {}", error.help.as_deref().unwrap_or_default());
    errors.iter().map(said).collect::<Vec<_>>().join("\n")
}
