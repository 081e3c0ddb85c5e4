//! robot.
