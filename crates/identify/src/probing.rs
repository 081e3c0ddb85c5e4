//! Rows that the robot itself measured with a touch probe in its spindle before the part was unclamped.
//!
//! Such a row is the surface as the controller reads it. It is the error of the arm that cut the place, less the error
//! of the same arm when it touches the place: without a force, in another posture, and approaching along the surface
//! normal. Errors that are equal in both states cancel. The effects of the cell act in both states, and the difference
//! is their change of the row.

use super::reading::{ELSEWHERE_MM, Reading};
use deflex_cell::Cell;
use deflex_correct::{Prepared, named_tool};
use deflex_effects::{Cutting, Presliding, Situation, ToolFrame};
use deflex_equilibrium::Dragged;
use deflex_measured::MeasuredRow;
use deflex_robot::{Joints, Pose};
use nalgebra::{Vector3, Vector6};

/// Length of the straight motion along the surface normal before the touch, mm. Measuring cycles begin it 2 to 10 mm
/// before the surface. Only friction that builds up over an angle depends on it.
const APPROACH_MM: f64 = 5.0;

/// The state of the arm when its probe touched.
#[derive(Clone, Debug)]
pub(super) struct Probing {
    tool: ToolFrame,
    /// Pose of the probe by the controller.
    wobj_from_tcp: Pose,
    /// Motor angles, rad.
    pub(super) motor: Joints,
    /// Direction of travel of each joint, from −1 to 1.
    pub(super) travel: Joints,
    /// Motor angles at the start of the motion along the normal, rad.
    from: Joints,
    /// Time of the touch, s.
    time: f64,
    /// Temperature, °C.
    temperature: Option<f64>,
}

impl Probing {
    /// The state of the arm for a row that the robot probed, at the point of the path that the row belongs to; `None`
    /// if another instrument measured the row.
    ///
    /// # Errors
    /// The row lacks something, or cannot be correct.
    pub(super) fn of(
        cell: &Cell,
        prepared: &Prepared,
        point: usize,
        row: &MeasuredRow,
    ) -> Result<Option<Self>, String> {
        let Some(name) = &row.probe_tool else { return Ok(None) };
        let tool = named_tool(cell, name)
            .map_err(|errors| errors.into_iter().map(|error| error.message).collect::<Vec<_>>().join("; "))?;
        let (Some(deg), Some(Reading::Normal(_))) = (row.motor_deg, Reading::of(row)) else {
            return Err(
                "a row with probe_tool needs normal_mm and no position, and q1_deg … q6_deg, the motor angles where the probe touched"
                    .to_owned(),
            );
        };
        if prepared.is_held(point) {
            return Err(
                "the robot holds the part at this target, and cannot probe it with a tool of its own".to_owned()
            );
        }
        let robot = &cell.arm.robot;
        let motor = robot.motor_from_axes_deg(&deg);
        let frames = robot.frames(&motor);
        let base_from_tcp = frames.base_from_flange() * tool.flange_from_tcp;
        let base_from_wobj = prepared.base_from_wobj(point);
        let wobj_from_tcp = base_from_wobj.inv_mul(&base_from_tcp);
        let there = &prepared.points[point];
        let off_mm = 1e3 * (wobj_from_tcp.translation.vector - there.reference.translation.vector).norm();
        if off_mm > ELSEWHERE_MM {
            return Err(format!(
                "by q1_deg … q6_deg the tool `{name}` was {off_mm:.0} mm from the place that the row names (at most {ELSEWHERE_MM} mm)"
            ));
        }
        let back = base_from_wobj.rotation * there.normal * (1e-3 * APPROACH_MM);
        let step = Vector6::new(back.x, back.y, back.z, 0.0, 0.0, 0.0);
        let turned = robot.jacobian(&frames, &base_from_tcp.translation.vector).lu().solve(&step);
        let Some(from) = turned.map(|turned| motor + turned) else {
            return Err("the wrist is singular where the probe touched: probe the place in another posture".to_owned());
        };
        // A row without a time is probed when the part has been cut.
        let end = prepared.points.iter().map(|point| point.time).fold(0.0, f64::max);
        let mut probing = Self {
            tool,
            wobj_from_tcp,
            motor,
            travel: Joints::zeros(),
            from,
            time: row.time_s.unwrap_or(end),
            temperature: row.temperature_c.or(there.temperature),
        };
        probing.set_presliding(&Presliding::default());
        Ok(Some(probing))
    }

    /// Sets the presliding angles.
    pub(super) fn set_presliding(&mut self, presliding: &Presliding) {
        let start = Dragged { motor: self.from, twist: Joints::zeros(), travel: Joints::zeros() };
        self.travel = start.travel_to(&self.motor, &Joints::zeros(), presliding);
    }

    /// The circumstances of the touch, from those of the cut at the same place.
    pub(super) fn situation<'a>(&self, cut: Situation<'a>) -> Situation<'a> {
        Situation {
            wobj_from_tcp: self.wobj_from_tcp,
            tool: self.tool,
            cutting: Cutting::Air,
            velocity: Vector3::zeros(),
            time: self.time,
            temperature: self.temperature,
            torque: None,
            ..cut
        }
    }

    /// Error of the probe along a normal, mm: its pose less that by the controller.
    pub(super) fn normal_error_mm(&self, wobj_from_tcp: &Pose, normal: &Vector3<f64>) -> f64 {
        1e3 * (wobj_from_tcp.translation.vector - self.wobj_from_tcp.translation.vector).dot(normal)
    }
}

#[cfg(test)]
mod tests {
    use super::super::data::Problem;
    use super::*;
    use deflex_program::rapid;
    use deflex_text::Source;

    /// One place, 1.18 m in front of the axis of joint 2. Only the spring and the backlash of this joint deflect the
    /// arm. The cut comes from a target `above_mm` above the place and has a force of 410 N along the upward normal.
    /// The place is measured by the robot itself, with the motor angles of the cut, and by another instrument.
    struct Bench {
        cell: Cell,
        above_mm: f64,
    }

    impl Bench {
        fn new(effect: &str, above_mm: f64) -> Self {
            let text = format!(
                "[robot]\nmodel = \"irb6700-150-3.20\"\n[robot.stiffness]\njoint_nm_per_rad = [1e12, 2e6, 1e12, 1e12, 1e12, 1e12]\n\
                 [tools.tProbe]\ntcp_mm = [0, 0, 150]\ntcp_quat = [1, 0, 0, 0]\n\
                 [cut]\nforce = \"constant\"\nforce_n = [0.0, 0.0, 410.0]\nframe = \"wobj\"\n{effect}"
            );
            Self { cell: Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap(), above_mm }
        }

        fn problem(&self, rows: &str) -> Result<Problem, Vec<deflex_text::Diagnostic>> {
            let target = |z: f64| {
                format!("MoveL [[0,0,{z}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,z0,tMill\\WObj:=wPart;\n")
            };
            let program = format!(
                "MODULE Part\nPERS tooldata tMill:=[TRUE,[[0,0,150],[1,0,0,0]],[4,[0,0,80],[1,0,0,0],0,0,0]];\n\
                 PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[1500,0,900],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n\
                 PROC main()\n{}{}ENDPROC\nENDMODULE\n",
                target(self.above_mm),
                target(0.0)
            );
            let program = rapid::read(vec![Source::new("part.mod", program.into_bytes())], Vec::new()).unwrap();
            let table = deflex_measured::Table::read(&Source::new("probed.csv", rows.as_bytes())).unwrap();
            Problem::of_runs(&self.cell, vec![(program, table).into()])
        }

        /// Axis angles at the place, degrees, as the pendant shows them.
        fn axes(&self) -> String {
            let problem = self.problem("target,normal_mm\n2,0\n").unwrap();
            let deg = self.cell.arm.robot.axes_deg_from_motor(&problem.rows[0].motor);
            deg.map(|deg| deg.to_string()).join(",")
        }

        /// Residuals of readings of 0 mm, mm: of the robot's own probe, and of another instrument.
        fn residuals(&self) -> [f64; 2] {
            let own = format!(
                "target,normal_mm,probe_tool,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n2,0,tProbe,{}\n",
                self.axes()
            );
            [&own[..], "target,normal_mm\n2,0\n"].map(|rows| self.problem(rows).unwrap().residual(&self.cell.arm)[0])
        }
    }

    /// Distance of the place from the axis of joint 2, which is 0.32 m in front of that of joint 1.
    const LEVER_M: f64 = 1.5 - 0.32;

    #[track_caller]
    fn near(found: f64, right: f64) {
        assert!((found - right).abs() < 2e-3 * right.abs().max(0.1), "{found} for {right}");
    }

    #[test]
    fn a_zero_offset_cancels_and_the_deflection_under_the_force_does_not() {
        let spring = 1e3 * 410.0 * LEVER_M.powi(2) / 2e6;
        let [own, other] = Bench::new("", 5.0).residuals();
        near(own, -spring);
        near(other, -spring);
        // A positive angle of joint 2 moves the tool down.
        let zero = "[[effect]]\nkind = \"zero_offset\"\noffset_rad = [0, 1e-3, 0, 0, 0, 0]\n";
        let [own, other] = Bench::new(zero, 5.0).residuals();
        near(own, -spring);
        near(other, -spring + 1e3 * LEVER_M * 1e-3);
    }

    #[test]
    fn backlash_cancels_if_the_cut_approaches_like_the_probe() {
        let gap = "[[effect]]\nkind = \"backlash\"\nhalf_gap_rad = [0, 1e-4, 0, 0, 0, 0]\n";
        let of = |above_mm: f64| {
            let [without, _] = Bench::new("", above_mm).residuals();
            let [own, other] = Bench::new(gap, above_mm).residuals();
            [own - without, other - without]
        };
        let once = 1e3 * LEVER_M * 1e-4;
        let ([own_down, other_down], [own_up, other_up]) = (of(5.0), of(-5.0));
        near(own_down, 0.0);
        near(own_up.abs(), 2.0 * once);
        near(other_down.abs(), once);
        near(other_up, -other_down);
        near(own_up, other_up - other_down);
    }

    #[test]
    fn an_incomplete_probed_row_is_reported_with_its_line() {
        let bench = Bench::new("", 5.0);
        let message = |rows: &str| {
            let error = bench.problem(rows).unwrap_err().swap_remove(0);
            assert_eq!((error.file.as_str(), error.line), ("probed.csv", 2), "{error}");
            error.message
        };
        assert!(message("target,normal_mm,probe_tool\n2,0,tProbe\n").contains("q1_deg … q6_deg"));
        let with = |tool: &str, axes: &str| {
            format!("target,normal_mm,probe_tool,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n2,0,{tool},{axes}\n")
        };
        assert!(message("target,x_mm,normal_mm,probe_tool,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n2,0,0,tProbe,0,0,0,0,30,0\n").contains("no position"));
        assert!(message(&with("tProb", &bench.axes())).contains("tProb"));
        assert!(message(&with("tProbe", "40,0,0,0,30,0")).contains("mm from the place"));
    }

    /// Friction that builds up over more than the approach is still small at the touch. The time is that of the touch.
    #[test]
    fn the_touch_has_a_travel_and_a_time_of_its_own() {
        let bench = Bench::new("", 5.0);
        let rows = format!(
            "target,normal_mm,time_s,probe_tool,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n2,0,700,tProbe,{}\n",
            bench.axes()
        );
        let mut problem = bench.problem(&rows).unwrap();
        let ran = problem.runs[0].situation(problem.rows[0].point);
        let probing = problem.rows[0].probing.clone().unwrap();
        assert!(ran.time < 1.0, "{}", ran.time);
        assert!((probing.situation(ran).time - 700.0).abs() < 1e-9);
        let sharp = probing.travel;
        problem.set_presliding(Presliding::alike(0.1));
        let soft = problem.rows[0].probing.as_ref().unwrap().travel;
        for joint in [1, 2, 4] {
            assert!((sharp[joint].abs() - 1.0).abs() < 1e-12, "{sharp}");
            assert!(soft[joint] * sharp[joint] > 0.0 && soft[joint].abs() < 0.2, "{soft}");
        }
    }
}
