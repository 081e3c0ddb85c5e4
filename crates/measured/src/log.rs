//! A controller's own log of its axes.

use super::Table;
use deflex_drive::{Log, LogSample};
use deflex_robot::Robot;
use deflex_text::Diagnostic;

impl Table {
    /// The table as a log with the columns `time_s, q1_deg … q6_deg`, the angles as the robot's pendant shows them.
    ///
    /// # Errors
    /// A row without time or angles; fewer than two rows.
    #[doc(hidden)]
    pub fn log(&self, robot: &Robot) -> Result<Log, Vec<Diagnostic>> {
        let mut samples: Vec<LogSample> = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let (Some(time), Some(axes_deg)) = (row.time_s, row.motor_deg) else {
                let what = if row.time_s.is_none() { "`time_s` is" } else { "`q1_deg` … `q6_deg` are" };
                let message = format!("{what} missing in this row of a controller's log");
                return Err(vec![
                    self.row_error(row.line, message).help("record the angles of all axes with their time"),
                ]);
            };
            samples.push(LogSample { time, motor: robot.motor_from_axes_deg(&axes_deg) });
        }
        // Loggers that write from several threads can print successive samples in the wrong order.
        samples.sort_by(|a, b| a.time.total_cmp(&b.time));
        if samples.len() < 2 {
            let message = "a controller's log needs at least two rows";
            return Err(vec![Diagnostic::error("log.rows", &self.file, message).help("record the whole run")]);
        }
        Ok(Log { file: self.file.clone(), samples })
    }
}
