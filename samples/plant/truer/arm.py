"""The arm at rest under its loads: gears with memory, bearings that tilt, links that bend and twist, a part on clamps.

Nothing is linearised and no formula is shared with `src/` or with the MuJoCo plant: each yielding place turns the wrench that reaches it into
a small displacement, the chain is laid out again with these displacements, and so on until it stays where it is. What has a memory (friction,
play, creep, heat) runs along the path at every pass. Units: m, rad, N, s.

Every law has numbers with a typical size (`NUMBERS`); a cell has those of its group times `size[group]`.
"""

from dataclasses import dataclass

import numpy as np

import chain

GRAVITY = 9.80665
PASSES, SETTLED_M = 30, 1e-9
STEEL_PER_K = 12e-6

# group, name, shape, typical value, spread, how: "normal" has mean `typical` and standard deviation `spread`; "log" is typical · exp(spread · z).
# Angles in rad, lengths in m. Shares of compliance are of the joint's declared 1/k.
NUMBERS = [
    ("springs", "log_softer", 6, 0.0, 0.12, "normal"),  # ln of true over declared compliance
    ("bent", "softer_one_way", 6, 0.0, 0.07, "normal"),  # share by which one flank is softer than the other
    ("bent", "soft_zone_rad", 6, 4e-5, 0.5, "log"),  # what the gear gives before it is stiff
    ("bent", "soft_zone_width_rad", 6, 1.2e-4, 0.4, "log"),  # twist of a stiff gear at which it is
    ("friction", "lost_rad", 6, 4e-5, 0.5, "log"),  # constant friction torque over stiffness
    ("friction", "lost_share", 6, 0.07, 0.4, "log"),  # of the twist: friction that grows with torque
    ("friction", "slip_rad", 6, 1.5e-3, 0.7, "log"),  # travel in which friction turns (presliding)
    ("play", "half_gap_rad", 6, 2.5e-5, 0.5, "log"),
    ("play", "width_rad", 6, 4e-4, 0.5, "log"),  # travel from one flank to the other
    ("creep", "share", 6, 0.05, 0.4, "log"),
    ("creep", "after_s", 6, 25.0, 0.5, "log"),
    ("periodic", "wave_rad", (6, 2), 0.0, 1.5e-5, "normal"),  # cosine and sine of the gear's meshing order
    ("periodic", "eccentric_rad", (6, 4), 0.0, 4e-5, "normal"),  # cosine and sine, once and twice a turn
    ("periodic", "loaded", 6, 0.4, 0.4, "log"),  # growth of the wave at a twist of 1e-3 rad
    ("zeros", "zero_rad", 6, 0.0, 1e-4, "normal"),
    ("tool", "tool_m", 3, 0.0, 0.08e-3, "normal"),
    ("links", "length_m", (6, 2), 0.0, 0.07e-3, "normal"),  # of a and d of each row
    ("links", "angle_rad", (6, 2), 0.0, 7e-5, "normal"),  # of alpha and theta
    ("frame", "place_m", 3, 0.0, 0.08e-3, "normal"),
    ("frame", "turn_rad", 3, 0.0, 2e-4, "normal"),
    ("weight", "left", 6, 0.13, 0.35, "log"),  # share of each link's weight that the controller does not make up for
    ("balancer", "torque_share", 1, 2.5e-4, 0.4, "log"),  # largest torque of the gas spring that is not made up for, over the stiffness of joint 2
    ("balancer", "reach", 1, 0.55, 0.2, "log"),  # its lever on link 2 over the distance of its foot
    ("beams", "softness", 6, 1.0, 0.3, "log"),  # of `Robot.beam_share`
    ("bearings", "softness", (6, 2), 1.0, 0.35, "log"),  # of `Robot.bearing_share`
    ("mount", "turn_share", 3, 0.08, 0.4, "log"),  # of the declared compliance of joint 1
    ("mount", "push_m_n", 3, 1.5e-8, 0.4, "log"),
    ("holder", "taper_rad_nm", 2, 5e-7, 0.4, "log"),
    ("holder", "beam_m_n", 1, 1e-7, 0.5, "log"),  # of the tool's tip
    ("plate", "clamp_m_n", 4, 6e-8, 0.5, "log"),  # of the clamps at the table's corners
    ("plate", "bend_m_n", 1, 1e-7, 0.5, "log"),  # of the middle between them
    ("plate", "side_m_n", 2, 2e-8, 0.4, "log"),
    ("heat", "kelvin", 3, 7.0, 0.35, "log"),  # of column, upper arm, forearm, at the end
    ("heat", "arm_s", 1, 1800.0, 0.4, "log"),
    ("heat", "gear_s", 1, 260.0, 0.4, "log"),  # the masses whose heat the arm takes
    ("heat", "spindle_m", 1, 3.5e-5, 0.4, "log"),
    ("heat", "spindle_s", 1, 300.0, 0.4, "log"),
    ("rod", "share", 1, 0.25, 0.25, "log"),  # of joint 3's compliance that is the rod's
    ("sensor", "scale", 3, 0.0, 0.05, "normal"),
    ("sensor", "cross", (3, 3), 0.0, 0.01, "normal"),
    ("sensor", "zero_n", 3, 0.0, 2.0, "normal"),
]
GROUPS = list(dict.fromkeys(n[0] for n in NUMBERS))
# Numbers that are a size of their group's effect (others are shapes): these are multiplied by `size[group]`.
SHAPES = {"soft_zone_width_rad", "slip_rad", "width_rad", "after_s", "loaded", "reach", "arm_s", "gear_s", "spindle_s"}
MESH = np.array([57, 63, 61, 50, 43, 51])  # waves of each gear a turn of the joint


@dataclass
class Numbers:
    """What is off in one cell: `z` of each number (0 is typical), and the size of each group (0: nothing of it is there)."""

    z: dict
    size: dict

    @staticmethod
    def draw(rng, size):
        return Numbers({(g, n): rng.normal(size=shape) for g, n, shape, *_ in NUMBERS}, dict(size))

    def of(self, group):
        """The group's numbers by name."""
        found = {}
        for g, name, _, typical, spread, how in NUMBERS:
            if g == group:
                value = typical + spread * self.z[g, name] if how == "normal" else typical * np.exp(spread * self.z[g, name])
                found[name] = value * (1 if name in SHAPES else self.size.get(g, 0.0))
        return found

    def without(self, group):
        return Numbers(self.z, {**self.size, group: 0.0})


def dahl(angle, width, start):
    """Friction's state in −1…1 along a path: it turns over a travel of `width`, and stays where nothing moves."""
    state, out = start, np.empty_like(angle)
    step = np.diff(angle, axis=0, prepend=angle[:1])
    way, left = np.sign(step), np.exp(-np.abs(step) / width)
    for k in range(len(angle)):
        state = way[k] + (state - way[k]) * left[k] if k else state
        state = np.where(way[k] == 0, out[k - 1], state) if k else state
        out[k] = state
    return out


def stop(angle, width, start):
    """Where a gear lies in its play, −1…1: it crosses in a straight line over a travel of 2 · width."""
    state, out = start, np.empty_like(angle)
    step = np.diff(angle, axis=0, prepend=angle[:1]) / width
    for k in range(len(angle)):
        state = np.clip(state + step[k], -1, 1)
        out[k] = state
    return out


def late(value, after, times):
    """A first-order lag of what the path brings, from rest."""
    state, out = np.zeros(value.shape[1]), np.empty_like(value)
    left = np.exp(-np.diff(times, prepend=times[:1])[:, None] / after)
    for k in range(len(value)):
        state = value[k] + (state - value[k]) * left[k]
        out[k] = state
    return out


def beam(force, moment, offset, turn, push_share, torsion):
    """End displacement and turn of a link that bends over `offset` under a force and a moment at its end.

    `turn`: rad/(N m) of a pure moment over the whole length (L/EI); `torsion`: the same about the link's own axis; `push_share`: a shaft's area.
    """
    length = np.linalg.norm(offset)
    e = offset / length
    lengthwise = lambda v: np.sum(v * e, axis=1, keepdims=True) * e
    square = lambda v: v - lengthwise(v)
    turned = torsion * lengthwise(moment) + turn * square(moment) + turn * length / 2 * np.cross(e, force)
    moved = turn * length**2 / 3 * square(force) + turn * push_share**2 * lengthwise(force) + turn * length / 2 * np.cross(moment, e)
    return moved, turned


class Arm:
    """One cell: the robot, what is off, and where its table really stands."""

    def __init__(self, robot, numbers, table_mm, table_quat):
        self.robot, self.numbers = robot, numbers
        self.table = chain.rotation(table_quat)[0], np.asarray(table_mm, float) * 1e-3
        self.taught = np.zeros(3), np.zeros(3)  # by which the frame was moved when it was taught with this very arm, m and rad
        n = {g: numbers.of(g) for g in GROUPS}
        self.n = n
        self.softness = np.exp(n["springs"]["log_softer"]) / np.array(robot.stiffness)
        rows = robot.rows.copy()
        rows[:, 0] += n["links"]["angle_rad"][:, 0]
        rows[:, 3] += n["links"]["angle_rad"][:, 1]
        rows[:, 1] += n["links"]["length_m"][:, 0]
        rows[:, 2] += n["links"]["length_m"][:, 1]
        self.rows = rows

    def gears(self, command, torque, times):
        """Angles after the gears, in motor coordinates, with everything that gears do. `torque` from the arm on each, N m."""
        n, k = self.n, np.array(self.robot.stiffness)
        soft = np.broadcast_to(self.softness, command.shape).copy()
        if self.robot.parallelogram:
            share = n["rod"]["share"][0]
            skew = command[:, 2] - command[:, 1]
            soft[:, 2] *= 1 - share + share / np.cos(skew) ** 2
        twist = soft * torque * (1 + n["bent"]["softer_one_way"] * np.tanh(torque / k / 5e-5))
        twist += n["bent"]["soft_zone_rad"] * np.tanh(torque / k / n["bent"]["soft_zone_width_rad"])
        elastic = twist
        moved = command + twist
        friction = dahl(moved, n["friction"]["slip_rad"], self.start[0])
        play = stop(moved, n["play"]["width_rad"], self.start[1])
        out = command + n["zeros"]["zero_rad"] + twist
        out += late(n["creep"]["share"] * elastic, n["creep"]["after_s"], times)
        out -= friction * (n["friction"]["lost_rad"] + n["friction"]["lost_share"] * np.abs(elastic))
        out -= play * n["play"]["half_gap_rad"]
        wave, once = n["periodic"]["wave_rad"], n["periodic"]["eccentric_rad"]
        growth = 1 + n["periodic"]["loaded"] * np.abs(elastic) / 1e-3
        out += growth * (wave[:, 0] * np.cos(MESH * command) + wave[:, 1] * np.sin(MESH * command))
        for order in (1, 2):
            out += once[:, 2 * order - 2] * np.cos(order * command) + once[:, 2 * order - 1] * np.sin(order * command)
        return out

    @property
    def start(self):
        """Where friction and play stand when the program begins: what came before is in no file."""
        return np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0]), np.array([-1.0, 1.0, -1.0, 1.0, 1.0, -1.0])

    def warmth(self, times):
        """Growth of column, upper arm, forearm (m) and of the spindle (m) at each time since a cold start."""
        heat = self.n["heat"]
        slow, fast = heat["arm_s"][0], heat["gear_s"][0]
        share = 1 - (slow * np.exp(-times / slow) - fast * np.exp(-times / fast)) / (slow - fast)
        lengths = np.array([self.robot.rows[0, 2], self.robot.rows[2, 1], self.robot.rows[3, 2]])
        return np.outer(share, STEEL_PER_K * heat["kelvin"] * lengths), heat["spindle_m"][0] * (1 - np.exp(-times / heat["spindle_s"][0]))

    def balancer(self, angle):
        """Torque of the gas spring on joint 2: a spring from the column to link 2, whose pressure rises as it shortens."""
        foot, lever = 1.0, self.n["balancer"]["reach"][0]
        length = np.sqrt(foot**2 + lever**2 - 2 * foot * lever * np.cos(angle + np.pi / 2))
        pressure = (length / np.sqrt(foot**2 + lever**2)) ** 1.3
        torque = pressure * foot * lever * np.sin(angle + np.pi / 2) / length
        return self.n["balancer"]["torque_share"][0] * self.robot.stiffness[1] * torque / (lever * foot)

    def run(self, motor, points_mm, force, times):
        """Where the tool tip is, seen from the part, in the work object's axes (mm) at each commanded posture under each force (N)."""
        robot, n, count = self.robot, self.n, len(motor)
        table_rot, table_pos = self.table
        true_rot = table_rot @ chain.exp(n["frame"]["turn_rad"] + self.taught[1])
        true_pos = table_pos + table_rot @ (n["frame"]["place_m"] + self.taught[0])
        push = force @ true_rot.T
        grown, spindle = self.warmth(times)
        left = n["weight"]["left"]
        weights = np.append(left * np.array(robot.mass_kg), left[5] * robot.tool_kg) * GRAVITY
        cogs = np.vstack([np.array(robot.cog_mm) * 1e-3, [0.0, 0.0, 0.12]])
        tip = np.array(robot.tool_mm) * 1e-3 + n["tool"]["tool_m"]
        declared = 1 / np.array(robot.stiffness)
        serial_declared = declared.copy()
        zero = lambda *shape: np.zeros((count, *shape))
        torque = zero(6)
        base_turn, base_push, tilt = zero(3), zero(3), zero(6, 3)
        bend_move, bend_turn, taper, tool_move, tool_turn = zero(6, 3), zero(6, 3), zero(3), zero(3), zero(3)
        before = np.full((count, 3), np.inf)
        for _ in range(PASSES):
            serial = self.gears(motor, torque, times) @ robot.serial_from_motor().T
            rot, pos = chain.exp(base_turn), base_push
            joints, frames, ends = [], [], []
            for i in range(6):
                turn, offset = chain.step(self.rows[i])
                offset = np.broadcast_to(offset, (count, 3)).copy()
                offset += {0: np.outer(grown[:, 0], [0, 0, 1]), 2: np.outer(grown[:, 1], [1, 0, 0]), 3: np.outer(grown[:, 2], [0, 1, 0])}.get(i, 0.0)
                if i:
                    offset = offset + bend_move[:, i - 1]
                pos = pos + np.einsum("nij,nj->ni", rot, offset)
                ends.append(pos)
                rot = rot @ (chain.exp(bend_turn[:, i - 1]) if i else np.eye(3)) @ turn @ chain.about(2, serial[:, i] + self.rows[i, 3]) @ chain.exp(tilt[:, i])
                joints.append(pos)
                frames.append(rot)
            nose_rot = rot @ chain.exp(taper)
            reach = np.broadcast_to(tip, (count, 3)) + tool_move
            reach = reach + np.outer(spindle, [0, 0, 1])
            where = pos + np.einsum("nij,nj->ni", nose_rot, reach)
            # What reaches each place: the cut at the tip, and weights from the tool inwards.
            total, about_base = push.copy(), np.cross(where, push)
            wrench = [None] * 6
            bodies = [(6, pos + nose_rot @ cogs[6])] + [(i, joints[i] + frames[i] @ cogs[i]) for i in range(5, -1, -1)]
            tool_force = push.copy()
            for i, at in bodies:
                weight = np.array([0, 0, -weights[i]])
                total, about_base = total + weight, about_base + np.cross(at, weight)
                if i < 6:
                    wrench[i] = (total, about_base)
            local = lambda i, v: np.einsum("nji,nj->ni", frames[i], v)
            moments = [local(i, wrench[i][1] - np.cross(joints[i], wrench[i][0])) for i in range(6)]
            serial_torque = np.column_stack([m[:, 2] for m in moments])
            serial_torque[:, 1] += self.balancer(motor[:, 1])
            torque = serial_torque @ robot.serial_from_motor()
            for i in range(6):
                moment = moments[i][:, :2]
                size = np.linalg.norm(moment, axis=1, keepdims=True)
                # Rollers bed in: twice as soft at first, and stiffer the more they carry.
                soft = robot.bearing_share[i] * declared[i] * n["bearings"]["softness"][i] * (1 + 1 / (1 + size / (2e-4 / declared[i])))
                tilt[:, i, :2] = soft * moment
            for i in range(5):
                offset = chain.step(self.rows[i + 1])[1]
                share = robot.beam_share[i] * n["beams"]["softness"][i] * declared[i]
                if np.linalg.norm(offset) < 0.02 or share == 0:
                    continue
                # The end of a link carries what is beyond it; half of its own weight hangs there too.
                f, about_origin = wrench[i + 1]
                f = f + [0, 0, -weights[i] / 2]
                m = local(i, about_origin - np.cross(ends[i + 1], wrench[i + 1][0]))
                bend_move[:, i], bend_turn[:, i] = beam(local(i, f), m, offset, share, 0.08, 1.3 * share)
            base_turn = (about_base + 0.0) * (n["mount"]["turn_share"] * declared[0])
            base_push = total * n["mount"]["push_m_n"]
            on_tool = np.einsum("nji,nj->ni", nose_rot, tool_force)
            at_nose = np.cross(np.broadcast_to(tip, (count, 3)), on_tool)
            taper = np.column_stack([at_nose[:, :2] * n["holder"]["taper_rad_nm"], np.zeros(count)])
            length = np.linalg.norm(tip)
            tool_move, _ = beam(on_tool, np.zeros((count, 3)), tip, 3 * n["holder"]["beam_m_n"][0] / length**2, 0.01, 0.0)
            if np.abs(where - before).max() < SETTLED_M:
                break
            before = where
        else:
            raise RuntimeError("the arm found no rest")
        self.torque = torque
        seen = (where - true_pos) @ true_rot
        return (seen + self.plate(points_mm, force)) * 1e3

    def plate(self, points_mm, force):
        """How far the reaction has pushed the part from where it was clamped: m, work object axes."""
        n = self.n["plate"]
        half = np.array([400.0, 450.0])
        u = points_mm[:, :2] / half
        # A rigid plate on four clamps takes a force where it acts: each clamp carries its share, and the plate tips.
        share = np.stack([(1 + sx * u[:, 0]) * (1 + sy * u[:, 1]) / 4 for sx in (-1, 1) for sy in (-1, 1)], axis=1)
        normal = share**2 @ n["clamp_m_n"] + n["bend_m_n"][0] * np.prod(np.cos(np.clip(u, -1, 1) * np.pi / 2), axis=1) ** 2
        return np.column_stack([force[:, 0] * n["side_m_n"][0], force[:, 1] * n["side_m_n"][1], force[:, 2] * normal])

    def read_force(self, force):
        """What the sensor makes of the force; air is air, for its reading is set to zero there."""
        n = self.n["sensor"]
        read = force * (1 + n["scale"]) + force @ (n["cross"] * (1 - np.eye(3))) + n["zero_n"]
        return np.where(np.any(force != 0, axis=1)[:, None], read, 0.0)

    def teach(self, motor, points_mm):
        """Teaches the table's frame with this arm, cold and unloaded, at some places: what is off on average is in the frame then."""
        self.taught = np.zeros(3), np.zeros(3)
        frame = self.n["frame"]
        kept = dict(frame)
        frame["place_m"], frame["turn_rad"] = np.zeros(3), np.zeros(3)
        off = self.run(motor, points_mm, np.zeros((len(motor), 3)), np.zeros(len(motor))) - points_mm
        self.n["frame"] = kept
        p = points_mm
        turn = np.zeros((len(p), 3, 3))
        turn[:, 0, 1], turn[:, 0, 2], turn[:, 1, 2] = p[:, 2], -p[:, 1], p[:, 0]
        turn[:, 1, 0], turn[:, 2, 0], turn[:, 2, 1] = -p[:, 2], p[:, 1], -p[:, 0]
        design = np.concatenate([np.broadcast_to(np.eye(3), turn.shape), turn], axis=2).reshape(-1, 6)
        fit = np.linalg.lstsq(design, off.ravel(), rcond=None)[0]
        self.taught = fit[:3] * 1e-3, fit[3:]
