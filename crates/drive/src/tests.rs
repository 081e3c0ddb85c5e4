//! Paths solved by hand, in a plane that the arm reaches easily.

use super::*;
use approx::{assert_abs_diff_eq, assert_relative_eq};
use deflex_robot::BUILTIN;
use nalgebra::{Rotation3, Translation3, Vector3};

/// A controller without smoothing and inertia, to which each test adds what it examines.
const PLAIN: PathLaw = PathLaw { zone_share: 1.0, ..PathLaw::AS_WRITTEN };

/// An arm whose tool points down at a point of a horizontal plane, mm from its middle.
struct Bench {
    robot: Robot,
}

impl Bench {
    fn new() -> Self {
        let builtin = BUILTIN.iter().find(|robot| robot.model == "irb6660-205-1.9").expect("a built-in robot");
        Self { robot: builtin.robot() }
    }

    fn at(&self, x: f64, y: f64) -> Pose {
        let down = Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI);
        Pose::from_parts(Translation3::new(1.2 + 1e-3 * x, 1e-3 * y, 0.9), down)
    }

    fn waypoint(&self, [x, y]: [f64; 2], lead: Lead, zone_mm: Option<f64>) -> Waypoint {
        let base_from_tcp = self.at(x, y);
        let near = Joints::new(0.0, 0.0, 0.0, 0.0, 0.5, 0.0);
        let motor = self.robot.inverse_near(&base_from_tcp, &near).expect("within reach");
        let zone = zone_mm.map(|mm| 1e-3 * mm);
        Waypoint { lead, base_from_tcp, flange_from_tcp: Pose::identity(), motor, feed: 0.1, zone, wait: 0.0 }
    }

    /// Two sides of a square corner at the origin, 100 mm each, at 100 mm/s.
    fn corner(&self, zone_mm: Option<f64>) -> Vec<Waypoint> {
        let line = |at, zone_mm| self.waypoint(at, Lead::Line, zone_mm);
        vec![line([-100.0, 0.0], None), line([0.0, 0.0], zone_mm), line([0.0, 100.0], None)]
    }

    /// The TCP at each sample, mm from the middle of the plane.
    fn driven(&self, law: &PathLaw, waypoints: &[Waypoint]) -> Vec<Vector3<f64>> {
        let driven = drive(&self.robot, law, waypoints).expect("within reach");
        let place = |sample: &DrivenSample| {
            1e3 * (self.robot.forward(&sample.motor).translation.vector - self.at(0.0, 0.0).translation.vector)
        };
        driven.iter().map(place).collect()
    }
}

/// An arc on which the tool keeps its orientation.
fn arc_through(via: Pose) -> Lead {
    Lead::Arc { via, turn: ArcTurn::Even }
}

/// Least distance from the middle of the plane, mm; samples lie 0.4 mm apart, and the path between them is straight.
fn nearest(path: &[Vector3<f64>]) -> f64 {
    let distance = |two: &[Vector3<f64>]| {
        let way = two[1] - two[0];
        let share =
            if way.norm_squared() > 0.0 { (-two[0].dot(&way) / way.norm_squared()).clamp(0.0, 1.0) } else { 0.0 };
        (two[0] + way * share).norm()
    };
    path.windows(2).map(distance).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_zone_rounds_a_corner_by_a_parabola() {
    let bench = Bench::new();
    // The parabola through both ends of the zone is nearest to the corner halfway to the middle of the chord: r √2 / 4.
    let path = bench.driven(&PLAIN, &bench.corner(Some(10.0)));
    assert_relative_eq!(nearest(&path), 10.0 * 2f64.sqrt() / 4.0, epsilon = 0.02);
    // A share of the zone, a zone that is wider than half the segment, and no zone.
    let half = PathLaw { zone_share: 0.5, ..PLAIN };
    assert_relative_eq!(
        nearest(&bench.driven(&half, &bench.corner(Some(10.0)))),
        5.0 * 2f64.sqrt() / 4.0,
        epsilon = 0.02
    );
    assert_relative_eq!(
        nearest(&bench.driven(&PLAIN, &bench.corner(Some(400.0)))),
        50.0 * 2f64.sqrt() / 4.0,
        epsilon = 0.02
    );
    // Samples 0.4 mm apart may lie on both sides of the corner, 0.2 mm away: the chord between them passes it by 0.14 mm.
    assert!(nearest(&bench.driven(&PLAIN, &bench.corner(None))) < 0.15);
}

#[test]
fn a_moving_average_rounds_a_corner_by_the_speed() {
    let bench = Bench::new();
    let law = PathLaw { smoothing: [0.08, 0.0], ..PLAIN };
    // The mean of the path over the average's 80 ms: each side gives a quarter of 80 ms at 100 mm/s, 2 mm, at a right angle.
    let path = bench.driven(&law, &bench.corner(Some(0.0)));
    assert_relative_eq!(nearest(&path), 2.0 * 2f64.sqrt() / 2.0 * 1.0, epsilon = 0.02);
    // At a stop the axes come to rest, whatever the smoothing.
    assert!(nearest(&bench.driven(&law, &bench.corner(None))) < 0.01);
}

#[test]
fn a_moving_average_leads_inside_an_arc() {
    let bench = Bench::new();
    let (radius, width, feed) = (50.0, 0.2, 100.0);
    let via = bench.at(0.0, radius);
    let waypoints =
        [bench.waypoint([radius, 0.0], Lead::Line, None), bench.waypoint([-radius, 0.0], arc_through(via), None)];
    let path = bench.driven(&PathLaw { smoothing: [width, 0.0], ..PLAIN }, &waypoints);
    // The mean over an arc of half angle a lies at sin(a)/a of the radius.
    let half_angle = 0.5 * feed * width / radius;
    let middle = path[path.len() / 2].norm();
    // The angles are averaged and not the positions: on an arm of a metre this bends 10 mm of path by some hundredths.
    assert_relative_eq!(middle, radius * half_angle.sin() / half_angle, epsilon = 0.02);
}

#[test]
fn a_speed_that_is_never_reached_costs_the_time_of_the_acceleration() {
    let bench = Bench::new();
    let waypoints = [bench.waypoint([0.0, 0.0], Lead::Line, None), bench.waypoint([10.0, 0.0], Lead::Line, None)];
    // 10 mm from rest to rest at 0.5 m/s²: 2 √(s/a) = 0.283 s; at 100 mm/s without inertia 0.1 s.
    let time = |law: &PathLaw| drive(&bench.robot, law, &waypoints).expect("within reach").last().map(|last| last.time);
    let slow = time(&PathLaw { acceleration: 0.5, ..PLAIN }).expect("samples");
    assert_relative_eq!(slow, 2.0 * (0.01f64 / 0.5).sqrt(), epsilon = 2.0 * SAMPLE_S);
    assert_relative_eq!(time(&PLAIN).expect("samples"), 0.1, epsilon = 2.0 * SAMPLE_S);
}

/// Half a circle of 3 mm and a quarter of a circle of 1 mm, and how fast they are driven.
#[test]
fn small_arcs_are_driven_on_their_circles() {
    let bench = Bench::new();
    for (radius, degrees) in [(3.0, 180.0f64), (1.0, 90.0)] {
        let at = |degrees: f64| {
            let angle = degrees.to_radians();
            [radius * angle.cos(), radius * angle.sin()]
        };
        let [x, y] = at(0.5 * degrees);
        let from = bench.waypoint(at(0.0), Lead::Line, None);
        let to = Waypoint { feed: 0.01, ..bench.waypoint(at(degrees), arc_through(bench.at(x, y)), None) };
        let law = PathLaw { acceleration: 10.0, ..PLAIN };
        let path = bench.driven(&law, &[from, to]);
        for two in path.windows(2) {
            assert_relative_eq!(two[0].norm(), radius, epsilon = 1e-3);
            assert!((two[1] - two[0]).norm() < 1.01 * 10.0 * SAMPLE_S, "{} mm", (two[1] - two[0]).norm());
        }
    }
}

/// From rest at 1 m/s², a place is where the acceleration puts it, also before the first of the points that are 2 mm apart.
#[test]
fn a_ramp_begins_at_rest() {
    let bench = Bench::new();
    let path = bench.driven(&PathLaw { acceleration: 1.0, ..PLAIN }, &bench.corner(None));
    for (k, place) in path.iter().take(20).enumerate() {
        let time = SAMPLE_S * k as f64;
        assert_relative_eq!(place.x, -100.0 + 1e3 * 0.5 * time * time, epsilon = 0.025);
    }
}

#[test]
fn a_corner_is_passed_as_slowly_as_the_acceleration_across_it_requires() {
    let law = PathLaw { smoothing: [0.06, 0.06], corner_acceleration: 4.0, ..PLAIN };
    let turn = 2f64.sqrt();
    let corner = |tcp: f64| Turn { tcp, ..Turn::default() };
    // With a rounding of radius r the change of velocity, √2 v at a right angle, takes 2 r / v. A parabola bends most in its middle: by
    // 1/cos² 45° more than on average.
    let (radius, speed) = (0.01, law.corner_speed(&corner(turn), 0.01));
    assert_relative_eq!(turn * speed / (2.0 * radius / speed) / 0.5, 4.0, epsilon = 1e-9);
    assert_abs_diff_eq!(law.corner_speed(&corner(turn), 0.0), 0.0);
    assert!(law.corner_speed(&corner(0.0), 0.0).is_infinite());
    // An axis that turns by 1 rad/m, in either direction, and keeps 2 rad/s²: v² = 2 · 2 · 10 mm · 1 m.
    let law = PathLaw { axis_acceleration: Joints::repeat(2.0), ..law };
    let corner = Turn { tcp: 0.0, axes: Joints::new(0.0, 0.0, -1.0, 0.0, 0.5, 0.0) };
    assert_relative_eq!(law.corner_speed(&corner, 0.01), 0.2, epsilon = 1e-12);
}

/// 100 mm/s before and after a corner that may be passed at 20 mm/s: from rest at 1 m/s², to the corner and from it at 4 m/s².
#[test]
fn the_motion_brakes_for_a_passed_corner_by_its_own_acceleration() {
    let bench = Bench::new();
    let (radius, turn) = (1e-3, 2f64.sqrt());
    // The corner speed follows from v² = 2 a r cos² 45° / √2.
    let corner_acceleration = 0.02f64.powi(2) * turn / (2.0 * radius * 0.5);
    let law = PathLaw { acceleration: 1.0, passing_acceleration: 4.0, corner_acceleration, ..PLAIN };
    let lasts = drive(&bench.robot, &law, &bench.corner(Some(1.0))).expect("within reach").last().map(|last| last.time);
    // Each ramp covers (v² - u²) / 2a and takes (v - u) / a; the parabola over 2 mm of sides at a right angle has 1.623 mm.
    let (at_stop, at_corner) = (0.1f64.powi(2) / 2.0, (0.1f64.powi(2) - 0.02f64.powi(2)) / 8.0);
    let even = (0.1 - radius - at_stop - at_corner) / 0.1;
    let expected = 2.0 * (0.1 + 0.08 / 4.0 + even) + 1.623e-3 / 0.02;
    assert_relative_eq!(lasts.unwrap_or(0.0), expected, epsilon = 2.0 * SAMPLE_S);
}

#[test]
fn no_axis_accelerates_more_than_its_limit() {
    let bench = Bench::new();
    let limited = |limit: f64| PathLaw { axis_acceleration: Joints::repeat(limit), ..PLAIN };
    let samples = |law: &PathLaw, waypoints: &[Waypoint]| drive(&bench.robot, law, waypoints).expect("within reach");
    // Axis 1 alone turns by 0.2 rad, from rest to rest at 0.5 rad/s²: 2 √(angle/a).
    let start = bench.waypoint([0.0, 0.0], Lead::Joints, None);
    let motor = start.motor + Joints::new(0.2, 0.0, 0.0, 0.0, 0.0, 0.0);
    let base_from_tcp = bench.robot.forward(&motor);
    let turn = [start, Waypoint { motor, base_from_tcp, feed: 5.0, ..start }];
    let lasts = samples(&limited(0.5), &turn).last().map_or(0.0, |last| last.time);
    assert_relative_eq!(lasts, 2.0 * (0.2f64 / 0.5).sqrt(), epsilon = 2.0 * SAMPLE_S);
    // A line at 0.5 m/s past axis 1 at a distance of d = 0.6 m. The angle atan(s/d) bends most at s = d/√3, by 3√3/(8 d²).
    let line =
        [[-600.0, -1200.0], [-600.0, 1200.0]].map(|at| Waypoint { feed: 0.5, ..bench.waypoint(at, Lead::Line, None) });
    let law = PathLaw { axis_acceleration: Joints::new(0.03, 1e3, 1e3, 1e3, 1e3, 1e3), ..PLAIN };
    let path = bench.driven(&law, &line);
    let at = path.iter().position(|place| place.y > 1e3 * 0.6 / 3f64.sqrt()).expect("on the line");
    let speed = 1e-3 * (path[at + 1].y - path[at - 1].y) / (2.0 * SAMPLE_S);
    assert_relative_eq!(speed, (0.03 * 8.0 * 0.6f64.powi(2) / 27f64.sqrt()).sqrt(), max_relative = 0.01);
    // In a smoothed corner and at its sides. The limit applies to speeding up and to turning, which may come together.
    let law = PathLaw { smoothing: [0.05, 0.05], ..limited(0.3) };
    let corner = samples(&law, &bench.corner(Some(5.0)));
    for three in corner.windows(3) {
        let bend = (three[2].motor - three[1].motor * 2.0 + three[0].motor) / SAMPLE_S.powi(2);
        assert!(bend.amax() < 2.0 * 0.3, "{} at {} s", bend.amax(), three[1].time);
    }
}

#[test]
fn axes_keep_a_line_and_a_motor_that_leads_leaves_it_where_it_speeds_up() {
    let bench = Bench::new();
    let waypoints =
        [bench.waypoint([-100.0, -50.0], Lead::Line, None), bench.waypoint([100.0, 50.0], Lead::Line, None)];
    let off = |law: &PathLaw| {
        let across = Vector3::new(-0.5, 1.0, 0.0).normalize();
        bench.driven(law, &waypoints).iter().map(|at| at.dot(&across).abs()).fold(0.0, f64::max)
    };
    let alike = PathLaw { smoothing: [0.06, 0.06], acceleration: 4.0, ..PLAIN };
    // A line is no straight line of motor angles: what its bend leaves is some micrometres.
    assert!(off(&alike) < 0.01, "{}", off(&alike));
    let apart = PathLaw { axis_lead: Joints::new(4e-4, 0.0, 0.0, 0.0, 0.0, 0.0), ..alike };
    assert!(off(&apart) > 0.05, "{}", off(&apart));
}

#[test]
fn the_program_is_found_in_a_log_with_lead_in_and_lead_out() {
    let bench = Bench::new();
    let waypoints = bench.corner(Some(10.0));
    let law = PathLaw { smoothing: [0.06, 0.06], ..PLAIN };
    let run = drive(&bench.robot, &law, &waypoints).expect("within reach");
    let elsewhere = bench.waypoint([-150.0, 20.0], Lead::Line, None).motor;
    let mut samples = Vec::new();
    let mut push = |motor: Joints| {
        #[allow(clippy::cast_precision_loss)]
        let time = 100.0 + SAMPLE_S * samples.len() as f64;
        samples.push(LogSample { time, motor });
    };
    // From elsewhere to the start, a rest there, the run, a rest at its end, and back.
    (0..50).for_each(|k| push(elsewhere + (waypoints[0].motor - elsewhere) * (f64::from(k) / 49.0)));
    (0..100).for_each(|_| push(waypoints[0].motor));
    run.iter().for_each(|sample| push(sample.motor));
    (0..100).for_each(|_| push(waypoints[2].motor));
    (0..50).for_each(|k| push(waypoints[2].motor + (elsewhere - waypoints[2].motor) * (f64::from(k) / 49.0)));
    let log = Log { file: String::new(), samples };
    let found = log.of_program(&bench.robot, &waypoints, 0.05).expect("in the log");
    let seconds = found[found.len() - 1].time - found[0].time;
    let whole = run.last().map_or(0.0, |last| last.time);
    // Ends are found to half a millimetre: at rest that is a few samples.
    assert!((whole - 0.1..=whole).contains(&seconds), "{seconds} of {whole} s");
    assert!(log.of_program(&bench.robot, &[bench.waypoint([300.0, 300.0], Lead::Line, None)], 0.05).is_none());
}

/// Tests the search alone: a law is fitted to logs that a law has made, and predicts unseen logs to a few micrometres. Whether real
/// controllers follow the law, only their logs can show.
#[test]
fn a_law_is_found_again_in_logs_that_it_made() {
    let bench = Bench::new();
    let truth = PathLaw {
        zone_share: 0.8,
        smoothing: [0.07, 0.05],
        axis_lead: Joints::new(4e-4, 3e-4, 1e-4, 0.0, -1e-4, 2e-4),
        acceleration: 5.0,
        passing_acceleration: 9.0,
        corner_acceleration: 2.0,
        ..PathLaw::TYPICAL
    };
    let runs: Vec<(Vec<Waypoint>, Log)> = [(0.05, 1.0), (0.05, 10.0), (0.2, 1.0), (0.2, 10.0), (0.1, 5.0)]
        .into_iter()
        .map(|(feed, zone_mm)| {
            let mut waypoints = bench.corner(Some(zone_mm));
            waypoints.iter_mut().for_each(|waypoint| waypoint.feed = feed);
            let driven = drive(&bench.robot, &truth, &waypoints).expect("within reach");
            let samples = driven.iter().map(|sample| LogSample { time: sample.time, motor: sample.motor }).collect();
            (waypoints, Log { file: String::new(), samples })
        })
        .collect();
    let logs: Vec<_> = runs.iter().map(|(waypoints, log)| (&waypoints[..], log)).collect();
    let found = fit_law(&bench.robot, &logs, &PLAIN.axis_acceleration).expect("five logs");
    assert_eq!((found.fitted_logs, found.held_out_logs), (4, 1));
    assert!(found.after.max_mm < 0.1 * found.before.max_mm, "{found:?}");
    assert!((found.run_time_s.measured - found.run_time_s.predicted).abs() < 0.02, "{found:?}");
    assert_eq!(fit_law(&bench.robot, &logs[..1], &PLAIN.axis_acceleration).err(), Some(LogError::OneLog));
}

/// The rest at stops is no part of the way: it is found by itself, and does not pass for smoothing. One log also waits.
#[test]
fn a_rest_at_stops_is_found_in_logs() {
    let bench = Bench::new();
    let truth = PathLaw { smoothing: [0.012, 0.012], stop: 0.15, acceleration: 5.0, ..PathLaw::TYPICAL };
    let cases = [
        (0.05, None),
        (0.05, Some(5.0)),
        (0.1, None),
        (0.2, Some(1.0)),
        (0.2, None),
        (0.1, Some(10.0)),
        (0.03, None),
        (0.2, Some(5.0)),
        (0.1, Some(1.0)),
    ];
    let runs: Vec<(Vec<Waypoint>, Log)> = cases
        .into_iter()
        .map(|(feed, zone_mm)| {
            let mut waypoints = bench.corner(zone_mm);
            waypoints.iter_mut().for_each(|waypoint| waypoint.feed = feed);
            let truth = PathLaw { stop: if feed < 0.04 { 0.9 } else { truth.stop }, ..truth };
            let driven = drive(&bench.robot, &truth, &waypoints).expect("within reach");
            let samples = driven.iter().map(|sample| LogSample { time: sample.time, motor: sample.motor }).collect();
            (waypoints, Log { file: String::new(), samples })
        })
        .collect();
    let logs: Vec<_> = runs.iter().map(|(waypoints, log)| (&waypoints[..], log)).collect();
    let found = fit_law(&bench.robot, &logs, &PLAIN.axis_acceleration).expect("nine logs");
    let rest = found.law.stop + found.law.smoothing.iter().sum::<f64>();
    assert!((rest - 0.174).abs() < 0.02, "{:?}", found.law);
    assert!(found.after.max_mm < 0.2 * found.before.max_mm, "{found:?}");
}

/// Whatever the waypoints say, the orientations of the tool in a log decide how the controller turns it on an arc.
#[test]
fn the_turn_on_an_arc_is_found_in_a_log() {
    let bench = Bench::new();
    let tilted = |[x, y]: [f64; 2], tilt: f64, lead: Lead| {
        let at = bench.at(x, y);
        let rotation = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt) * at.rotation;
        let base_from_tcp = Pose::from_parts(at.translation, rotation);
        let near = bench.waypoint([x, y], Lead::Line, None);
        let motor = bench.robot.inverse_near(&base_from_tcp, &near.motor).expect("within reach");
        Waypoint { base_from_tcp, motor, lead, ..near }
    };
    let via = Pose::from_parts(bench.at(0.0, 50.0).translation, bench.at(0.0, 0.0).rotation);
    let along = |turn: ArcTurn, tilt: f64| {
        [tilted([50.0, 0.0], 0.0, Lead::Line), tilted([-50.0, 0.0], tilt, Lead::Arc { via, turn })]
    };
    let log_of = |waypoints: &[Waypoint]| {
        let driven = drive(&bench.robot, &PathLaw { smoothing: [0.05, 0.05], ..PLAIN }, waypoints);
        let sample = |sample: DrivenSample| LogSample { time: sample.time, motor: sample.motor };
        Log { file: String::new(), samples: driven.expect("within reach").into_iter().map(sample).collect() }
    };
    for (_, turn) in ArcTurn::WORDS {
        let log = log_of(&along(turn, 0.3));
        let courses = ArcTurn::WORDS.map(|(_, way)| (way, along(way, 0.3)));
        let ways =
            courses.each_ref().map(|(turn, course)| WayOfTurning { turn: *turn, logs: vec![(&course[..], &log)] });
        assert_eq!(arc_turn(&bench.robot, &ways), Ok(Some(turn)));
    }
    // A tool that keeps its orientation does so in all ways, and lines have none.
    for waypoints in [along(ArcTurn::Even, 0.0).to_vec(), bench.corner(None)] {
        let log = log_of(&waypoints);
        let ways = ArcTurn::WORDS.map(|(_, turn)| WayOfTurning { turn, logs: vec![(&waypoints[..], &log)] });
        assert_eq!(arc_turn(&bench.robot, &ways), Ok(None));
    }
}

/// Freedom to move every end, and no more.
fn movable(waypoints: &[Waypoint]) -> Vec<Freedom> {
    vec![Freedom { end: true, counts: true, ..Freedom::default() }; waypoints.len()]
}

/// A tolerance (m) with a law that is known exactly.
fn exactly(tolerance: f64) -> Wanted {
    Wanted { tolerance, error_share: 0.0 }
}

/// The waypoints of a command, as a program has them that it was written into.
fn commanded(bench: &Bench, waypoints: &[Waypoint], motions: &[CommandedMotion]) -> Vec<Waypoint> {
    let mut command: Vec<Waypoint> = Vec::new();
    for (waypoint, motion) in waypoints.iter().zip(motions) {
        let mut push = |base_from_tcp: Pose, lead, zone| {
            let motor = bench.robot.inverse_near(&base_from_tcp, &waypoint.motor).expect("within reach");
            command.push(Waypoint { base_from_tcp, motor, lead, zone, ..*waypoint });
        };
        let moved = |pose: &Pose, by: &Vector3<f64>| {
            Pose::from_parts(Translation3::from(pose.translation.vector + by), pose.rotation)
        };
        motion.added.iter().for_each(|added| push(added.base_from_tcp, Lead::Line, Some(3e-4)));
        let lead = match waypoint.lead {
            Lead::Arc { via, turn } => Lead::Arc { via: moved(&via, &motion.via), turn },
            lead => lead,
        };
        push(moved(&waypoint.base_from_tcp, &motion.end), lead, motion.zone);
    }
    command
}

/// Largest distance (mm) of a driven path from the polyline through waypoints, and of the waypoints from the driven path.
fn farthest(bench: &Bench, driven: &[Vector3<f64>], waypoints: &[Waypoint]) -> f64 {
    let middle = bench.at(0.0, 0.0).translation.vector;
    let corners: Vec<Vector3<f64>> =
        waypoints.iter().map(|waypoint| 1e3 * (waypoint.base_from_tcp.translation.vector - middle)).collect();
    let from = |place: &Vector3<f64>, path: &[Vector3<f64>]| {
        let moved: Vec<Vector3<f64>> = path.iter().map(|at| at - place).collect();
        nearest(&moved)
    };
    let off = driven.iter().map(|place| from(place, &corners)).fold(0.0, f64::max);
    corners.iter().map(|corner| from(corner, driven)).fold(off, f64::max)
}

#[test]
fn a_corner_is_driven_within_the_tolerance_with_added_points_or_a_stop_whichever_is_quicker() {
    let bench = Bench::new();
    let tolerance = 5e-5;
    for feed in [0.05, 0.1] {
        let mut waypoints = bench.corner(Some(1.0));
        waypoints.iter_mut().for_each(|waypoint| waypoint.feed = feed);
        let with = |added_zone, stop| {
            let freedom: Vec<Freedom> = movable(&waypoints)
                .into_iter()
                .map(|freedom| Freedom { smaller_zone: Some(3e-4), added_zone, stop, ..freedom })
                .collect();
            let shaped =
                shape(&bench.robot, &PathLaw::TYPICAL, &waypoints, &freedom, exactly(tolerance)).expect("within reach");
            // The command itself, driven as a program would be.
            let command = commanded(&bench, &waypoints, &shaped.motions);
            let driven = bench.driven(&PathLaw::TYPICAL, &command);
            assert_relative_eq!(farthest(&bench, &driven, &waypoints), 1e3 * shaped.after.largest, epsilon = 2e-3);
            shaped
        };
        let (added, stopped) = (with(Some(3e-4), true), with(None, true));
        assert!(added.before.largest > 5e-4, "{}", added.before.largest);
        for shaped in [&added, &stopped] {
            assert!(shaped.after.largest <= tolerance, "{} at {feed} m/s", shaped.after.largest);
        }
        let cost = |shaped: &ShapedCommand| shaped.after.seconds - shaped.before.seconds;
        assert!(cost(&added) > 0.0 && cost(&added) <= cost(&stopped), "{} {}", cost(&added), cost(&stopped));
        // Several small corners are slower than one stop at 100 mm/s.
        assert!(stopped.motions[1].zone.is_none() && added.motions[1].zone.is_some() == (feed < 0.1));
        // Where neither is allowed, the best result of moved points alone.
        let moved = with(None, false);
        assert!(moved.after.largest > tolerance && moved.after.largest < 0.7 * moved.before.largest);
    }
}

#[test]
fn a_stop_costs_the_time_that_the_axes_take_to_come_to_rest() {
    let bench = Bench::new();
    let law = PathLaw { smoothing: [0.08, 0.04], ..PLAIN };
    let waypoints = bench.corner(Some(1.0));
    let freedom = vec![Freedom { stop: true, counts: true, ..Freedom::default() }; 3];
    let shaped = shape(&bench.robot, &law, &waypoints, &freedom, exactly(1e-4)).expect("within reach");
    // The rounding of 1 mm is (2 - arc) shorter: the parabola over 2 mm of sides at a right angle has 1.623 mm, driven in 20 ms.
    assert_relative_eq!(shaped.after.seconds - shaped.before.seconds, 0.08 + 0.04, epsilon = 2.0 * SAMPLE_S);
    assert_eq!(shaped.motions[1].zone, None);
    assert!(shaped.after.largest < 2e-5, "{}", shaped.after.largest);
}

/// A closed square, and a log of three runs of it, one after the other, with rests between them.
#[test]
fn the_first_of_several_runs_in_a_log_is_taken() {
    let bench = Bench::new();
    let corners = [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0], [0.0, 0.0]];
    let square: Vec<Waypoint> = corners.map(|at| bench.waypoint(at, Lead::Line, None)).into();
    let driven = drive(&bench.robot, &PLAIN, &square).expect("within reach");
    let lasts = driven.last().expect("samples").time;
    let run = |k: u32| driven.iter().map(move |sample| (sample.time + f64::from(k) * (lasts + 0.2), sample.motor));
    let samples: Vec<LogSample> = (0..3).flat_map(run).map(|(time, motor)| LogSample { time, motor }).collect();
    let log = Log { file: String::new(), samples };
    let found = log.of_program(&bench.robot, &square, 0.05).expect("the program");
    let [from, to] = [found[0].time, found[found.len() - 1].time];
    assert!(from < 0.2 && to <= lasts && to > lasts - 0.2, "{from} to {to} s of {lasts} s");
    // A log that begins with the second run of a longer program that ends here.
    let open = [&square[2..], &square[1..2]].concat();
    assert!(log.of_program(&bench.robot, &open, 0.05).is_some_and(|found| found[0].time < lasts));
}

/// The corner with a right angle, with stops at which the program waits: 0.5 s at the corner, and again at the same place without a motion.
#[test]
fn a_wait_takes_its_time_at_a_stop_and_the_arm_stands_still() {
    let bench = Bench::new();
    let law = PathLaw { smoothing: [0.08, 0.04], ..PLAIN };
    let seconds = |waypoints: &[Waypoint]| {
        let samples = drive(&bench.robot, &law, waypoints).expect("within reach");
        samples.last().map_or(0.0, |sample| sample.time)
    };
    let [from, corner, to] = bench.corner(None).try_into().expect("three waypoints");
    let waits = |wait: f64| Waypoint { wait, ..corner };
    let longer = seconds(&[from, waits(0.5), to]) - seconds(&[from, corner, to]);
    assert_relative_eq!(longer, 0.5, epsilon = SAMPLE_S);
    let twice = seconds(&[from, waits(0.5), waits(0.25), to]) - seconds(&[from, corner, to]);
    assert_relative_eq!(twice, 0.75, epsilon = SAMPLE_S);
    // A zone is passed without a wait, unless the next motion stops at the same place.
    let passed = Waypoint { zone: Some(1e-3), ..waits(0.5) };
    assert!(seconds(&[from, passed, to]) < seconds(&[from, corner, to]));
    assert_relative_eq!(seconds(&[from, passed, corner, to]), seconds(&[from, corner, to]), epsilon = 1e-9);
    let samples = drive(&bench.robot, &law, &[from, waits(0.5), to]).expect("within reach");
    let still = samples.windows(2).filter(|two| (two[1].motor - two[0].motor).norm() < 1e-9).count();
    assert!(still >= 120, "{still} samples of 4 ms in 0.5 s");
}

#[test]
fn what_may_not_be_changed_stays_and_what_is_driven_as_written_is_left_alone() {
    let bench = Bench::new();
    let waypoints = bench.corner(Some(1.0));
    let untouched = |shaped: &ShapedCommand| {
        shaped.motions.iter().zip(&waypoints).all(|(motion, waypoint)| {
            motion.end == Vector3::zeros() && motion.added.is_empty() && motion.zone == waypoint.zone
        })
    };
    let fixed = vec![Freedom { counts: true, ..Freedom::default() }; 3];
    let shaped = shape(&bench.robot, &PathLaw::TYPICAL, &waypoints, &fixed, exactly(5e-5)).expect("within reach");
    assert!(untouched(&shaped) && shaped.before == shaped.after && shaped.after.largest > 5e-4);
    // Samples 0.4 mm apart on both sides of a sharp corner: the chord between them passes it by 0.14 mm.
    let movable = movable(&waypoints);
    let written = shape(&bench.robot, &PathLaw::AS_WRITTEN, &waypoints, &movable, exactly(2e-4)).expect("within reach");
    assert!(untouched(&written) && written.before.largest < 1.5e-4, "{}", written.before.largest);
    // An error that does not count is no reason to move a point.
    let elsewhere = vec![Freedom { end: true, stop: true, ..Freedom::default() }; 3];
    let shaped = shape(&bench.robot, &PathLaw::TYPICAL, &waypoints, &elsewhere, exactly(5e-5)).expect("within reach");
    assert!(untouched(&shaped) && shaped.after.largest <= 0.0);
}

#[test]
fn a_curve_of_short_lines_and_an_arc_are_driven_on_their_path() {
    let bench = Bench::new();
    let law = PathLaw { smoothing: [0.1, 0.08], ..PathLaw::TYPICAL };
    // A quarter of a circle of 30 mm at 150 mm/s: the mean over time leads inside it by (v s)² / 2 r, s² = (0.1² + 0.08²) / 12.
    let at = |degrees: f64| {
        let angle = degrees.to_radians();
        [30.0 * angle.sin(), 30.0 * (1.0 - angle.cos())]
    };
    let mut lines = vec![bench.waypoint([-60.0, 0.0], Lead::Line, None)];
    lines.extend((0..=30).map(|k| bench.waypoint(at(3.0 * f64::from(k)), Lead::Line, Some(0.3))));
    lines.push(bench.waypoint([30.0, 90.0], Lead::Line, None));
    let [x, y] = at(45.0);
    let arc = vec![
        bench.waypoint([-60.0, 0.0], Lead::Line, None),
        bench.waypoint(at(0.0), Lead::Line, Some(0.3)),
        bench.waypoint(at(90.0), arc_through(bench.at(x, y)), Some(0.3)),
        bench.waypoint([30.0, 90.0], Lead::Line, None),
    ];
    for mut waypoints in [lines, arc] {
        waypoints.iter_mut().for_each(|waypoint| waypoint.feed = 0.15);
        // Points on the straight lines too: without any, a line tilts when its end is moved.
        let freedom: Vec<Freedom> = movable(&waypoints)
            .into_iter()
            .map(|freedom| Freedom { via: true, added_zone: Some(3e-4), ..freedom })
            .collect();
        let shaped = shape(&bench.robot, &law, &waypoints, &freedom, exactly(6e-5)).expect("within reach");
        let inside = 1e-3 * (150.0f64.powi(2) * (0.1f64.powi(2) + 0.08f64.powi(2)) / 12.0) / (2.0 * 30.0);
        assert!(
            shaped.before.largest > 0.8 * inside && shaped.before.largest < 1.3 * inside,
            "{} {inside}",
            shaped.before.largest
        );
        assert!(
            shaped.after.largest < 0.3 * shaped.before.largest,
            "{} {}",
            shaped.after.largest,
            shaped.before.largest
        );
        assert!(shaped.after.seconds < 1.02 * shaped.before.seconds);
    }
}

#[test]
fn a_law_that_is_not_known_well_enough_stops_at_corners_that_it_cuts_by_much() {
    let bench = Bench::new();
    // Slow enough that added points are quicker than a stop.
    let waypoints: Vec<Waypoint> =
        bench.corner(Some(1.0)).into_iter().map(|waypoint| Waypoint { feed: 0.05, ..waypoint }).collect();
    let freedom: Vec<Freedom> = movable(&waypoints)
        .into_iter()
        .map(|freedom| Freedom { smaller_zone: Some(3e-4), added_zone: Some(3e-4), stop: true, ..freedom })
        .collect();
    let zone = |error_share| {
        let wanted = Wanted { tolerance: 5e-5, error_share };
        shape(&bench.robot, &PathLaw::TYPICAL, &waypoints, &freedom, wanted).expect("within reach").motions[1].zone
    };
    // The corner is missed by more than half a millimetre: eight times 0.3 % of that are less than half of 0.05 mm. Eight times 1 % are too much for added
    // points, and 10 % are more than all of it.
    assert_eq!([0.003, 0.01, 0.1].map(zone), [Some(3e-4), None, None]);
}

/// A motor that leads its axis by c times the acceleration: on a ramp of speed that takes as long as the one moving average is wide,
/// q̈ is v/width, so that the motor is c·v/width ahead; at an even speed it is where it would be.
#[test]
fn a_motor_leads_its_axis_by_its_share_of_the_acceleration() {
    let bench = Bench::new();
    let mut waypoints =
        [bench.waypoint([-100.0, 0.0], Lead::Line, None), bench.waypoint([100.0, 0.0], Lead::Joints, None)];
    waypoints[1].feed = 0.05;
    let plain = PathLaw { smoothing: [0.06, 0.0], ..PLAIN };
    let leading = PathLaw { axis_lead: Joints::new(5e-4, 0.0, 0.0, 0.0, 0.0, 0.0), ..plain };
    let motors = |law: &PathLaw| -> Vec<f64> {
        let driven = drive(&bench.robot, law, &waypoints).expect("within reach");
        driven.iter().map(|sample| sample.motor[0]).collect()
    };
    let (plain, leading) = (motors(&plain), motors(&leading));
    let rate = (plain[200] - plain[100]) / (100.0 * SAMPLE_S);
    // 32 ms into the ramp, and long after it.
    assert_relative_eq!(leading[8] - plain[8], 5e-4 * rate / 0.06, max_relative = 1e-6);
    assert_abs_diff_eq!(leading[150], plain[150], epsilon = 1e-12);
}

#[test]
fn the_mean_of_an_even_motion_is_exact() {
    let bench = Bench::new();
    let waypoints = [[-100.0, 0.0], [100.0, 0.0]].map(|at| bench.waypoint(at, Lead::Joints, None));
    let (widths, lead) = ([0.08, 0.03], 4e-4);
    let law = PathLaw { smoothing: widths, axis_lead: Joints::repeat(lead), ..PLAIN };
    let samples = drive(&bench.robot, &law, &waypoints).expect("within reach");
    // 200 mm at 100 mm/s without inertia.
    let rate = (waypoints[1].motor - waypoints[0].motor) / 2.0;
    let moved = |at: usize| samples[at].motor - waypoints[0].motor;
    // Within the narrower window: t³ / (6 w₁ w₂) of the rate, and the lead of its acceleration, t / (w₁ w₂).
    let (time, product) = (samples[6].time, widths[0] * widths[1]);
    assert!(time > 0.0 && time < widths[1]);
    let expected = rate * ((time.powi(3) / 6.0 + lead * time) / product);
    assert_abs_diff_eq!(moved(6), expected, epsilon = 1e-12);
    // After both windows the motion is late by half of them.
    let later = samples[300].time - 0.5 * (widths[0] + widths[1]);
    assert_abs_diff_eq!(moved(300), rate * later, epsilon = 1e-12);
}

#[test]
fn a_path_that_is_sampled_sparsely_is_straight_between_its_samples() {
    let bench = Bench::new();
    let lead = Joints::new(4e-4, 2e-4, 4e-4, 1e-4, 3e-4, 1e-4);
    let law = PathLaw { axis_lead: lead, ..PathLaw::TYPICAL };
    let line = |at, zone_mm| bench.waypoint(at, Lead::Line, zone_mm);
    let arc = bench.waypoint([100.0, 100.0], arc_through(bench.at(50.0, 150.0)), None);
    let waypoints = [
        line([-100.0, 0.0], None),
        line([-20.0, 0.0], Some(1.0)),
        line([0.0, 2.0], Some(5.0)),
        line([0.0, 100.0], None),
        arc,
    ];
    let all = drive(&bench.robot, &law, &waypoints).expect("within reach");
    let sparse = sparse(&bench, &law, &waypoints, waypoints.len());
    // The arc bends and the motors lead all along it; on the straight lines most samples are left out.
    assert!(4 * sparse.len() < 3 * all.len(), "{} of {}", sparse.len(), all.len());
    assert_eq!(sparse.last().map(|last| last.time), all.last().map(|last| last.time));
    let place = |sample: &DrivenSample| bench.robot.forward(&sample.motor).translation.vector;
    for pair in sparse.windows(2) {
        let span = pair[1].time - pair[0].time;
        for between in all.iter().filter(|sample| sample.time > pair[0].time && sample.time < pair[1].time) {
            let straight = place(&pair[0]).lerp(&place(&pair[1]), (between.time - pair[0].time) / span);
            let off = 1e6 * (place(between) - straight).norm();
            assert!(off < 1.0, "{off} µm at {} s", between.time);
        }
    }
}

/// The sparse samples of waypoints that are added some at a time.
fn sparse(bench: &Bench, law: &PathLaw, waypoints: &[Waypoint], at_once: usize) -> Vec<DrivenSample> {
    let mut driver = Driver::new(&bench.robot, law);
    let mut samples = Vec::new();
    let mut parts = waypoints.chunks(at_once).peekable();
    while let Some(part) = parts.next() {
        part.iter().try_for_each(|waypoint| driver.add(waypoint)).expect("within reach");
        if parts.peek().is_none() {
            driver.end().expect("within a day");
        }
        let chosen = driver.choose(&|_, _| 0.1).expect("within a day");
        samples.extend(chosen.iter().flat_map(|periods| driver.samples_at(periods)));
        driver.forget();
    }
    samples
}

#[test]
fn a_path_that_comes_in_parts_has_the_same_samples() {
    let bench = Bench::new();
    // A wave of short lines with a stop in it, and twice a change of the feed.
    let waypoint = |k: u32| {
        let x = 0.4 * f64::from(k);
        let zone = if k == 400 { None } else { Some(1.0) };
        let feed = if (200..300).contains(&k) { 0.02 } else { 0.1 };
        Waypoint { feed, ..bench.waypoint([x - 150.0, 5.0 * (0.1 * x).sin()], Lead::Line, zone) }
    };
    let waypoints: Vec<Waypoint> = (0..700).map(waypoint).collect();
    for law in [PathLaw::TYPICAL, PathLaw { acceleration: 0.2, ..PathLaw::TYPICAL }, PathLaw::AS_WRITTEN] {
        let whole = sparse(&bench, &law, &waypoints, waypoints.len());
        assert!(whole.len() > 300, "several groups of samples");
        for at_once in [1, 7, 64, 699] {
            let parts = sparse(&bench, &law, &waypoints, at_once);
            assert_eq!(parts.len(), whole.len());
            for (part, whole) in parts.iter().zip(&whole) {
                assert_eq!((part.time, part.motor, part.waypoint), (whole.time, whole.motor, whole.waypoint));
                assert_eq!(part.share.to_bits(), whole.share.to_bits());
            }
        }
    }
}
