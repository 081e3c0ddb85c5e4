//! Robots that a cell describes by links, with limits of the elbow.

use deflex_cell::Cell;
use deflex_robot::LimitedAngle;
use deflex_text::Source;

/// Elbow limits are refused for an arm whose axis 3 is counted against the upper arm.
#[test]
fn a_cell_gives_elbow_limits_where_axis_3_is_counted_against_the_ground() {
    let cell = |coupled: bool| {
        let rows = [
            [0.0, 0.0, 0.0],
            [-90.0, 150.0, -90.0],
            [0.0, 870.0, 0.0],
            [-90.0, 170.0, 0.0],
            [90.0, 0.0, 0.0],
            [-90.0, 0.0, 0.0],
        ];
        let rows: String = rows
            .iter()
            .zip([0.0, 0.0, 0.0, 1016.0, 0.0, 175.0])
            .map(|([alpha, a, theta], d)| {
                format!("  {{ alpha_deg = {alpha}, a_mm = {a}, d_mm = {d}, theta_deg = {theta} }},\n")
            })
            .collect();
        let text = format!(
            "[robot]\nmodel = \"my arm\"\n[robot.kinematics]\nlinks = [\n{rows}]\naxis_sign = [1, 1, -1, -1, -1, -1]\n\
             coupled_23 = {coupled}\naxis_min_deg = [-180, -90, -160, -360, -125, -360]\n\
             axis_max_deg = [180, 135, 280, 360, 125, 360]\nelbow_min_deg = -80.5\nelbow_max_deg = 205\n[cut]\nforce = \"none\"\n"
        );
        Cell::read(&Source::new("cell.toml", text))
    };
    let robot = cell(true).unwrap().arm.robot;
    let motor = robot.motor_from_axes_deg(&[0.0, -80.0, -10.0, 0.0, 30.0, 0.0]);
    assert_eq!(robot.limit_violation(&motor).map(|violation| violation.angle), Some(LimitedAngle::ElbowSum));
    let errors = format!("{:?}", cell(false).unwrap_err());
    assert!(errors.contains("axis 3 is the elbow"), "{errors}");
}
