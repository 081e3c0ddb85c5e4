// A loaded arm, the cut at a target and its motor angles. Examples in the documentation of the equilibrium include this block as their first line.
{
    use deflex_effects::{Cutting, Situation, ToolFrame, declared_springs};
    let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
    let motor = robot.motor_from_axes_deg(&robot.home_deg());
    let flange_from_tcp = deflex_robot::Pose::translation(0.0, 0.0, 0.3);
    let tool = ToolFrame { flange_from_tcp, mass: 18.0, cog: [0.0, 0.0, 0.1].into() };
    let in_air = Situation::in_air(tool, robot.forward(&motor) * flange_from_tcp);
    let situation = Situation { cutting: Cutting::Constant([0.0, 300.0, 0.0].into()), ..in_air };
    let stiffness = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]; // N·m/rad, at the motors
    let effects = vec![declared_springs(&robot.axes)];
    (deflex_equilibrium::Arm { stiffness: Some(stiffness.into()), effects, robot }, situation, motor)
}
