//! The path that a controller drives, and how well its law predicts the logs, as text.

use deflex_correct::LoadedSample;
use deflex_drive::{ArcTurn, FittedLaw};
use deflex_robot::Joints;
use deflex_text::number::write_fixed;
use std::fmt::Write;

/// Numbers of decimals. Positions are printed to a tenth of a micrometre, and quaternions so that a lever of a metre
/// moves by no more.
const TIME: usize = 3;
const POSITION: usize = 4;
const QUATERNION: usize = 8;
const FEED: usize = 3;
const FORCE: usize = 3;

/// The driven and loaded path as CSV: `time_s, target, x_mm, …`, in the work object of each target.
#[must_use]
#[doc(hidden)]
pub fn path_csv(samples: &[LoadedSample]) -> Vec<u8> {
    let mut out = b"time_s,target,x_mm,y_mm,z_mm,qw,qx,qy,qz,feed_mm_s,fx_n,fy_n,fz_n\n".to_vec();
    for sample in samples {
        write_fixed(&mut out, sample.time, TIME);
        out.extend_from_slice(format!(",{}", sample.target).as_bytes());
        let (position_mm, quat) = sample.position_and_quat();
        let numbers = position_mm.map(|mm| (mm, POSITION)).into_iter().chain(quat.map(|part| (part, QUATERNION)));
        let force = [sample.force.x, sample.force.y, sample.force.z].map(|newtons| (newtons, FORCE));
        for (value, decimals) in numbers.chain([(1e3 * sample.feed, FEED)]).chain(force) {
            out.push(b',');
            write_fixed(&mut out, value, decimals);
        }
        out.push(b'\n');
    }
    out
}

/// The result of fitting the law of a controller to logs, as text.
#[must_use]
#[doc(hidden)]
pub fn path_law_text(found: &FittedLaw) -> String {
    let FittedLaw { law, before, after, run_time_s, .. } = found;
    let logs = |count: usize| if count == 1 { "1 log".to_owned() } else { format!("{count} logs") };
    let mut text = String::new();
    let _ = writeln!(
        text,
        "path of the controller: fitted to {}, judged on {} that no fit has seen",
        logs(found.fitted_logs),
        logs(found.held_out_logs)
    );
    let _ = writeln!(text, "  from the programmed path   rms {:.3} mm, largest {:.3} mm", before.rms_mm, before.max_mm);
    let _ = writeln!(text, "  from the predicted path    rms {:.3} mm, largest {:.3} mm", after.rms_mm, after.max_mm);
    let _ = writeln!(
        text,
        "  run time                   {:.2} s measured, {:.2} s predicted",
        run_time_s.measured, run_time_s.predicted
    );
    let _ = writeln!(
        text,
        "  law: zone share {:.2}, smoothing {:.0} and {:.0} ms, acceleration {:.0} mm/s² at stops, {:.0} mm/s² at passed corners and {:.0} mm/s² across the path",
        law.zone_share,
        1e3 * law.smoothing[0],
        1e3 * law.smoothing[1],
        1e3 * law.acceleration,
        1e3 * law.passing_acceleration,
        1e3 * law.corner_acceleration
    );
    if let Some(radius) = found.assumed_zone {
        let _ = writeln!(
            text,
            "  the programs state no radius of their zones: with zone_mm = {:.0} and this zone share, corners are rounded as in the logs",
            1e3 * radius
        );
    }
    if let Some(turn) = found.arc_turn {
        let how = match turn {
            ArcTurn::Even => "evenly from the start to the end",
            ArcTurn::WithPath | ArcTurn::Fixed => "with the path",
            ArcTurn::ThroughCirclePoint => "through the orientation of the circle point",
        };
        let _ = writeln!(text, "  on arcs the tool turns {how}");
    }
    let list = |values: &Joints, decimals: usize| {
        values.iter().map(|value| format!("{value:.decimals$}")).collect::<Vec<_>>().join(", ")
    };
    if law.lag == Joints::zeros() {
        let _ = writeln!(
            text,
            "  motors 1 to 6 lead their axes by {} ms² of acceleration",
            list(&(law.axis_lead * 1e6), 0)
        );
    } else {
        let _ = writeln!(text, "  lag of axes 1 to 6: {} ms", list(&(law.lag * 1e3), 1));
    }
    if found.error_share().is_none() {
        let _ = writeln!(
            text,
            "  the cell does not get this law: on logs that it has not seen, it is no better than the programmed path. Are all logs of one robot and one state of it?"
        );
    }
    text
}
