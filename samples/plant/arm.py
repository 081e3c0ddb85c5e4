"""The real arm: a MuJoCo body tree with springs at the motors, brought to rest under its loads.

Geometry errors are built into the tree, masses hang on it, yielding parts are joints with springs. Nothing here is
linearised: the arm's position is where MuJoCo's own spring, weight and contact-force terms sum to zero.
"""

import mujoco
import numpy as np

from program import MM, Frame, rot_to_quat, rotvec_to_rot

# The rest position is accepted when a Newton step moves no joint by more than this (rad or m): 1e-9 mm at the TCP.
REST = 1e-12
NEGLIGIBLE_KG = 1e-6  # MuJoCo wants a mass on every moving body


def compliance(effects, kind, key, shape):
    """Sum of a parameter over all effects of this kind, zeros where there is none."""
    total = np.zeros(shape)
    for e in effects:
        if e["kind"] == kind:
            total += np.array(e.get(key, np.zeros(shape)), float).reshape(shape)
    return total


class Arm:
    """One robot with one tool; `rest` solves one static equilibrium."""

    def __init__(self, cell, tool, effects):
        self.cell, self.effects = cell, effects
        self.growth = [e for e in effects if e["kind"] in ("thermal_growth", "temperature_cycle")]
        self.stiffness = cell.stiffness * np.prod([e["scale"] for e in effects if e["kind"] == "joint_stiffness"] or [np.ones(6)], axis=0)
        self.curves = [e for e in effects if e["kind"] == "stiffness_curve"]
        self.fraction = compliance(effects, "hysteresis", "fraction", 6)
        self.model = mujoco.MjModel.from_xml_string(self.xml(tool))
        self.data = mujoco.MjData(self.model)
        name = lambda kind, n: mujoco.mj_name2id(self.model, kind, n)
        self.motors = np.array([self.model.jnt_qposadr[name(mujoco.mjtObj.mjOBJ_JOINT, f"q{i}")] for i in range(1, 7)])
        self.bodies = [name(mujoco.mjtObj.mjOBJ_BODY, f"link{i}") for i in range(1, 7)]
        self.tcp = name(mujoco.mjtObj.mjOBJ_BODY, "tcp")
        self.part = name(mujoco.mjtObj.mjOBJ_BODY, "part")
        self.fixture = name(mujoco.mjtObj.mjOBJ_JOINT, "fixture")
        self.cold = self.model.body_pos.copy()
        self.b = cell.motor_from_serial

    def xml(self, tool):
        """The tree as MJCF: base mount, six links (modified DH), tool holder, tool tip, and the clamped part."""
        fx = self.effects
        rows = self.cell.links.copy()
        rows[:, 0] += compliance(fx, "link_geometry", "d_alpha_rad", 6)
        rows[:, 1] += compliance(fx, "link_geometry", "d_a_mm", 6) * MM
        rows[:, 2] += compliance(fx, "link_geometry", "d_d_mm", 6) * MM
        rows[:, 3] += compliance(fx, "link_geometry", "d_theta_rad", 6)
        weights = [e for e in fx if e["kind"] == "gravity"]
        masses = compliance(fx, "gravity", "mass_kg", 6)
        moments = compliance(fx, "gravity", "first_moment_kg_m", (6, 3))

        def springs(name, kind, yields):
            """One sprung joint along or about each axis that yields at all (rad/N m or m/N)."""
            return "".join(
                f'<joint name="{name}{kind}{axis}" type="{kind}" axis="{vec}" stiffness="{1 / c!r}"/>'
                for axis, vec, c in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), (float(v) for v in yields)) if c > 0
            )

        def body(name, frame, joints, mass=0.0, cog=(0, 0, 0)):
            place = " ".join(repr(float(v)) for v in frame.pos)
            turn = " ".join(repr(float(v)) for v in rot_to_quat(frame.rot))
            at = " ".join(repr(float(v)) for v in cog)
            return (f'<body name="{name}" pos="{place}" quat="{turn}">'
                    f'<inertial pos="{at}" mass="{max(float(mass), NEGLIGIBLE_KG)!r}" diaginertia="1e-6 1e-6 1e-6"/>{joints}')

        out = body("base", self.cell.world_from_base,
                   springs("mount", "slide", compliance(fx, "base_compliance", "mm_per_n", 3) * MM)
                   + springs("mount", "hinge", compliance(fx, "base_compliance", "rad_per_nm", 3)))
        tilt = compliance(fx, "bearing_compliance", "rad_per_nm", (6, 2))
        for i, (alpha, a, d, theta) in enumerate(rows):
            frame = Frame(rotvec_to_rot([alpha, 0, 0]), np.array([a, 0, 0]))
            frame = frame @ Frame(rotvec_to_rot([0, 0, theta]), np.array([0, 0, d]))
            cog = moments[i] / masses[i] if masses[i] > 0 else np.zeros(3)
            if masses[i] <= 0 and np.any(moments[i]):
                raise SystemExit("gravity: a first moment needs a mass")
            out += body(f"link{i + 1}", frame, f'<joint name="q{i + 1}" type="hinge" axis="0 0 1"/>' + springs(f"bearing{i + 1}", "hinge", tilt[i]), masses[i], cog)

        tool_mass = tool.mass_kg if any(e.get("tool") for e in weights) else 0.0
        holder = compliance(fx, "tool_compliance", "rad_per_nm", 2)
        out += body("holder", Frame(np.eye(3), np.zeros(3)), springs("holder", "hinge", holder), tool_mass, tool.cog_m)
        error = Frame(rotvec_to_rot(compliance(fx, "tool_frame", "d_rad", 3)), compliance(fx, "tool_frame", "d_mm", 3) * MM)
        radial = compliance(fx, "tool_compliance", "radial_mm_per_n", 1)[0] * MM
        axial = compliance(fx, "tool_compliance", "axial_mm_per_n", 1)[0] * MM
        out += body("tcp", tool.flange_from_tcp @ error, springs("tip", "slide", [radial, radial, axial]))
        out += "</body>" * 9
        # The part gives way along one axis, which is turned to the surface normal at every target.
        out += body("part", Frame(np.eye(3), np.zeros(3)), '<joint name="fixture" type="slide" axis="0 0 1" stiffness="1e12"/>') + "</body>"
        # A hose pulls where it is longer than at rest.
        hoses = [e for e in fx if e["kind"] == "cable_pull"]
        for n, e in enumerate(hoses):
            for end, link in (("from", e["from_link"]), ("to", e["to_link"])):
                at = " ".join(repr(float(v) * MM) for v in e[f"{end}_mm"])
                body_start = f'<body name="{"base" if link == 0 else f"link{link}"}"'
                before, behind = out.split(body_start)
                inertia, rest = behind.split("/>", 1)
                out = before + body_start + inertia + f'/><site name="{end}{n}" pos="{at}"/>' + rest
        # A motor is a fixed tendon over the joints that it turns; its length is the motor angle.
        b = self.cell.motor_from_serial
        tendons = "".join(
            f'<fixed name="m{i + 1}">' + "".join(f'<joint joint="q{j + 1}" coef="{b[i, j]}"/>' for j in range(6) if b[i, j]) + "</fixed>" for i in range(6)
        )
        tendons += "".join(
            f'<spatial name="hose{n}" stiffness="{float(e["stiffness_n_per_m"])!r}" springlength="0 {float(e["rest_mm"]) * MM!r}">'
            f'<site site="from{n}"/><site site="to{n}"/></spatial>' for n, e in enumerate(hoses)
        )
        gravity = -9.81 if weights else 0.0
        return (f'<mujoco><compiler angle="radian"/><option gravity="0 0 {gravity}"/>'
                f"<worldbody>{out}</worldbody><tendon>{tendons}</tendon></mujoco>")

    def warm(self, time_s):
        """Links that have grown by now: column up, upper arm and forearm along themselves."""
        if not self.growth:
            return
        self.model.body_pos[:] = self.cold
        for e in self.growth:
            if e["kind"] == "thermal_growth":
                share = 1 - np.exp(-time_s / e["tau_s"])
            else:
                share = np.sin(2 * np.pi * time_s / e["period_s"] + e["phase_rad"])
            for link, local, key in ((0, [0, 0, 1], "column_mm"), (2, [1, 0, 0], "upper_arm_mm"), (3, [0, 1, 0], "forearm_mm")):
                # Body i's place in its parent: x is the common normal; row 4 is offset along +y of link 3 (alpha = -90 deg).
                self.model.body_pos[self.bodies[link]] += np.array(local) * (e.get(key, 0.0) * MM * share)

    def spring(self, twist):
        """Motor torque and tangent stiffness for the twist (command minus actual) of each gear."""
        torque, slope = self.stiffness * twist, self.stiffness.copy()
        for e in self.curves:
            if e["form"] == "two_slope":
                width, ratio = np.array(e["width_rad"], float), np.array(e["ratio"], float)
                inside = np.abs(twist) <= width
                torque += np.where(inside, (ratio - 1) * self.stiffness * twist, (ratio - 1) * self.stiffness * width * np.sign(twist))
                slope += np.where(inside, (ratio - 1) * self.stiffness, 0.0)
            else:
                c = np.array(e["c_per_rad2"], float)
                torque += self.stiffness * c * twist**3
                slope += 3 * self.stiffness * c * twist**2
        return torque, slope

    def rest(self, unloaded, force, travel, normal, part_mm_per_n, drag, time_s):
        """Pose world_from_tcp at rest, seen from the part, and the motors' twist.

        `unloaded`: motor angles at zero torque; `force`: on the tool at the TCP, world axes, N; `travel`: signs of the last
        motor motion; `normal`: surface normal in world axes; `drag`: extra motor torques, N m.
        """
        m, d = self.model, self.data
        self.warm(time_s)
        m.jnt_axis[self.fixture] = normal
        m.jnt_stiffness[self.fixture] = 1 / max(part_mm_per_n * MM, 1e-12)
        d.qpos[:] = 0
        d.qpos[self.motors] = np.linalg.solve(self.b, unloaded)
        jac, part_jac = np.zeros((3, m.nv)), np.zeros((3, m.nv))
        for _ in range(60):
            mujoco.mj_kinematics(m, d)
            mujoco.mj_comPos(m, d)
            mujoco.mj_tendon(m, d)
            mujoco.mj_passive(m, d)
            mujoco.mj_rne(m, d, 0, d.qfrc_bias)
            mujoco.mj_jac(m, d, jac, None, d.xpos[self.tcp], self.tcp)
            mujoco.mj_jac(m, d, part_jac, None, d.xpos[self.part], self.part)
            load = jac.T @ force - part_jac.T @ force - d.qfrc_bias
            on_motors = np.linalg.solve(self.b.T, load[self.motors]) + drag
            friction = -travel * self.fraction * np.abs(on_motors)
            twist = unloaded - d.ten_length[:6]
            torque, slope = self.spring(twist)
            balance = load + d.qfrc_passive
            balance[self.motors] += self.b.T @ (torque + friction + drag)
            stiffness = np.diag(np.asarray(m.jnt_stiffness, float))
            stiffness[np.ix_(self.motors, self.motors)] += self.b.T @ (slope[:, None] * self.b)
            step = np.linalg.solve(stiffness, balance)
            if np.abs(step).max() < REST:
                break
            d.qpos += step
        else:
            raise SystemExit("the arm found no rest position")
        seen = d.xpos[self.tcp] - d.xpos[self.part]
        return Frame(d.xmat[self.tcp].reshape(3, 3).copy(), seen.copy()), twist
