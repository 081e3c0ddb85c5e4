//! A controller's own log of its axes.

use super::Table;
use deflex_drive::{Log, LogSample};
use deflex_robot::Robot;
use deflex_text::Diagnostic;

/// Time by which a row may come late in the file, and a pause between rows that needs no reason, s: loggers that write from several threads
/// print rows in the wrong order or lose some, within some samples.
const DISORDER_S: f64 = 0.1;
/// Samples over which the speed before and after a pause is taken.
const AROUND: usize = 5;
/// Share of the lower of both speeds that the axes keep on average while rows are missing. At a steady speed it is 1; a clock that jumps by more
/// than the pause has less than half.
const KEPT: f64 = 0.5;

impl Table {
    /// The table as a log with the columns `time_s, q1_deg … q6_deg`, the angles as the robot's pendant shows them.
    ///
    /// # Errors
    /// A row without time or angles; fewer than two rows; a clock that jumps.
    #[doc(hidden)]
    pub fn log(&self, robot: &Robot) -> Result<Log, Vec<Diagnostic>> {
        let mut samples: Vec<LogSample> = Vec::with_capacity(self.rows.len());
        let mut latest = f64::NEG_INFINITY;
        for row in &self.rows {
            let (Some(time), Some(axes_deg)) = (row.time_s, row.motor_deg) else {
                let what = if row.time_s.is_none() { "`time_s` is" } else { "`q1_deg` … `q6_deg` are" };
                let message = format!("{what} missing in this row of a controller's log");
                return Err(vec![
                    self.row_error(row.line, message).help("record the angles of all axes with their time"),
                ]);
            };
            if latest - time > DISORDER_S {
                let message = format!("the time runs back by {:.3} s at this row", latest - time);
                return Err(vec![
                    self.row_error(row.line, message).help("give each run of the program as a log of its own"),
                ]);
            }
            latest = latest.max(time);
            samples.push(LogSample { time, motor: robot.motor_from_axes_deg(&axes_deg) });
        }
        samples.sort_by(|a, b| a.time.total_cmp(&b.time));
        if samples.len() < 2 {
            let message = "a controller's log needs at least two rows";
            return Err(vec![Diagnostic::error("log.rows", &self.file, message).help("record the whole run")]);
        }
        if let Some(jump) = clock_jump(&samples) {
            let at = self.rows.iter().find(|row| row.time_s == Some(samples[jump].time)).map_or(1, |row| row.line);
            let seconds = samples[jump].time - samples[jump - 1].time;
            let message = format!("the time jumps by {seconds:.3} s at this row, and the axes do not move on as far");
            return Err(vec![self.row_error(at, message).help("record this run again, or leave the log out")]);
        }
        Ok(Log { file: self.file.clone(), samples })
    }
}

/// The first sample before which the clock jumps: the axes move before and after it, and hardly in the pause.
fn clock_jump(samples: &[LogSample]) -> Option<usize> {
    let speed = |from: usize, to: usize| {
        (samples[to].motor - samples[from].motor).amax() / (samples[to].time - samples[from].time)
    };
    (1..samples.len()).find(|&i| {
        let is_pause = samples[i].time - samples[i - 1].time > DISORDER_S;
        is_pause && i > AROUND && i + AROUND < samples.len() && {
            let around = speed(i - 1 - AROUND, i - 1).min(speed(i, i + AROUND));
            around.is_finite() && speed(i - 1, i) < KEPT * around
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use deflex_robot::Joints;

    /// Axis 1 moves with 0.1 rad/s, sampled every 4 ms; from sample 50 on the clock is ahead, and the axis has moved on by an angle.
    fn log(ahead_s: f64, moved_rad: f64) -> Vec<LogSample> {
        let sample = |k: u32| {
            let [time, angle] = [4e-3, 4e-4].map(|step| step * f64::from(k));
            let (time, angle) = if k < 50 { (time, angle) } else { (time + ahead_s, angle + moved_rad) };
            LogSample { time, motor: Joints::new(angle, 0.0, 0.0, 0.0, 0.0, 0.0) }
        };
        (0..100).map(sample).collect()
    }

    #[test]
    fn a_clock_that_jumps_is_found_and_lost_rows_are_not_taken_for_it() {
        assert_eq!(clock_jump(&log(3.0, 0.0)), Some(50));
        assert_eq!(clock_jump(&log(3.0, 0.3)), None);
        assert_eq!(clock_jump(&log(0.05, 0.0)), None);
    }
}
