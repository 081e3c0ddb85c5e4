"""Production programs: rasters, pockets, five-axis patches, lines in several areas; each with the forces of a cutter, written as RAPID.

Points are mm in the work object, whose origin is the middle of the table; the tool axis points from tip to spindle.
"""

from dataclasses import dataclass, replace

import numpy as np

import chain

TABLE_MM = (640.0, 760.0)


@dataclass
class Path:
    points: np.ndarray
    rots: np.ndarray
    speed_mm_s: np.ndarray
    force: np.ndarray  # on the tool, work object axes, N; zero in air
    table_mm: np.ndarray  # where the work object stands, base axes
    table_quat: np.ndarray
    start_s: float = 0.0
    dwell_s: float = 0.0  # at each target, while the instrument reads

    def times(self):
        step = np.linalg.norm(np.diff(self.points, axis=0), axis=1) / self.speed_mm_s[1:] + self.dwell_s
        return np.round(self.start_s + np.concatenate([[0.0], np.cumsum(step)]), 2)


def waves(rng, scale, most=2.5):
    """A smooth random function of a place in mm."""
    f, phase, share = rng.uniform(-most, most, (4, 2)) * 2 * np.pi / 500, rng.uniform(0, 6.3, 4), rng.normal(size=4) / 2
    return lambda x, y: scale * np.sum(share * np.sin(np.multiply.outer(x, f[:, 0]) + np.multiply.outer(y, f[:, 1]) + phase), axis=-1)


def resampled(corners, step):
    """Points on a polyline, at most `step` apart, corners among them."""
    out = [corners[:1]]
    for a, b in zip(corners, corners[1:]):
        n = max(1, int(np.ceil(np.linalg.norm(b - a) / step)))
        out.append(a + (b - a) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(out)


def zigzag(width, height, rows):
    """Corners of lines along x, one after the other along y."""
    y = np.linspace(-height / 2, height / 2, rows)
    x = np.where(np.arange(rows) % 2 == 0, -1, 1)[:, None] * np.array([1, -1]) * width / 2
    return np.column_stack([x.ravel(), np.repeat(y, 2), np.zeros(2 * rows)])


def raster(rng, rows):
    """A gently curved face, line by line."""
    width, height = rng.uniform(220, 420), rng.uniform(220, 420)
    lines = int(np.clip(np.sqrt(rows / rng.uniform(0.8, 2.5)), 6, 40))
    points = resampled(zigzag(width, height, lines), max(width * lines / rows, 4.0))
    level = waves(rng, rng.uniform(4, 18))
    points[:, 2] += level(points[:, 0], points[:, 1])
    return points, leaned(rng, points, 0.06), np.ones(len(points), bool)


def pocket(rng, rows):
    """Rectangles from the middle outwards, level by level, with plunges and a move back in air between them."""
    width, height, levels, rings = rng.uniform(160, 320), rng.uniform(160, 320), int(rng.integers(2, 5)), int(rng.integers(4, 8))
    way = rng.choice([-1, 1])
    corners, cuts = [], []
    for level in range(levels):
        z = -level * rng.uniform(4, 10)
        corners.append([0, 0, 25.0])
        for ring in range(1, rings + 1):
            w, h = width / 2 * ring / rings, height / 2 * ring / rings
            corners += [[-w, -h * way, z], [w, -h * way, z], [w, h * way, z], [-w, h * way, z], [-w, -h * way, z]]
        corners.append([-w, -h * way, 25.0])
    corners = np.array(corners)
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()
    points = resampled(corners, max(length / rows, 4.0))
    cuts = points[:, 2] < 1.0
    return points, leaned(rng, points, 0.02), cuts


def blade(rng, rows):
    """A five-axis patch of a twisted surface, flow line by flow line, all one way or to and fro, the tool leading by a constant angle."""
    length, height = rng.uniform(260, 440), rng.uniform(120, 240)
    lines = int(np.clip(np.sqrt(rows / rng.uniform(1.5, 4)), 6, 30))
    one_way, radius, twist, lead = rng.random() < 0.5, rng.uniform(350, 700), rng.uniform(-0.25, 0.25), rng.uniform(0.10, 0.25)
    per = max(6, rows // lines)
    out, axes, cuts = [], [], []
    for line, v in enumerate(np.linspace(-0.5, 0.5, lines)):
        u = np.linspace(-0.5, 0.5, per) * (1 if one_way or line % 2 == 0 else -1)
        bend = u * length / radius
        turn = twist * u
        x, z = radius * np.sin(bend), radius * (np.cos(bend) - 1)
        out.append(np.column_stack([x, v * height * np.cos(turn), z + v * height * np.sin(turn)]))
        axes.append(np.column_stack([np.sin(bend), -np.sin(turn), np.cos(bend) * np.cos(turn)]))
        cuts.append(np.ones(per, bool))
        if one_way and line + 1 < lines:
            lifted = out[-1][[-1, 0]] + [[0, 0, 40], [0, 0, 40]]
            out.append(lifted)
            axes.append(axes[-1][[-1, 0]])
            cuts.append(np.zeros(2, bool))
    points, axis, cuts = np.concatenate(out), np.concatenate(axes), np.concatenate(cuts)
    axis += lead * np.array([1.0, 0, 0]) + 0.04 * np.column_stack([waves(rng, 1)(points[:, 0], points[:, 1]) for _ in range(3)])
    return points, frames(axis / np.linalg.norm(axis, axis=1, keepdims=True)), cuts


def lines(rng, rows):
    """Slots and edges in several areas, each turned and leaning its own way, approached in air."""
    count = int(rng.integers(8, 20))
    per = max(5, rows // count - 2)
    out, rots, cuts = [], [], []
    for _ in range(count):
        middle = rng.uniform(-1, 1, 3) * [200, 240, 30]
        heading, length = rng.uniform(0, 2 * np.pi), rng.uniform(90, 200)
        along = np.array([np.cos(heading), np.sin(heading), 0])
        line = middle + along * length * np.linspace(-0.5, 0.5, per)[:, None]
        lifted = lambda p: p + [0, 0, 45.0]
        out.append(np.concatenate([lifted(line[:1]), line, lifted(line[-1:])]))
        lean = rng.uniform(-0.3, 0.3, 2)
        axis = np.array([lean[0], lean[1], 1.0])
        turned = frames((axis / np.linalg.norm(axis))[None]) @ chain.about(2, rng.uniform(-0.6, 0.6))
        rots.append(np.repeat(turned, per + 2, axis=0))
        cuts.append(np.array([False, *[True] * per, False]))
    return np.concatenate(out), np.concatenate(rots), np.concatenate(cuts)


FAMILIES = {"raster": raster, "pocket": pocket, "blade": blade, "lines": lines}


def frames(axis):
    """Rotations whose z axis goes into the material, against the tool axis, and whose x axis points about along −x of the table."""
    z = -axis
    x = np.array([-1.0, 0, 0]) - z * (z @ np.array([-1.0, 0, 0]))[:, None]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def leaned(rng, points, size):
    """Tool upright but for a slow lean of this size (rad), constant and along the path."""
    lean = np.column_stack([waves(rng, size)(points[:, 0], points[:, 1]) for _ in range(2)]) + rng.normal(0, size, 2)
    axis = np.column_stack([lean, np.ones(len(points))])
    return frames(axis / np.linalg.norm(axis, axis=1, keepdims=True))


def cutter_force(axial_mm, radial_share, per_tooth_mm, up, helix=0.6, edge=25.0, tangential=900.0, radial=0.35, thrust=0.25):
    """Mean force on a cylindrical mill over one turn: along the feed, square to it (to the left), along the tool axis (towards the spindle), N.

    Chip thickness h = f sin(angle); tangential, radial and axial components of K h + K_edge on each tooth, summed over the arc in cut. Two teeth.
    """
    angle = np.linspace(0, np.pi, 181)[None]
    depth = np.arccos(1 - 2 * np.clip(radial_share, 0.02, 1.0))[:, None]
    inside = (angle <= depth) if up else (angle >= np.pi - depth)
    chip = per_tooth_mm * np.sin(angle)
    ft = axial_mm[:, None] * (tangential * chip + edge) * inside
    fr, fa = radial * ft, thrust * np.tan(helix) * ft
    # Seen from above, feed along x, the cutter turns clockwise: on the tool the chip pushes against the turn and towards the centre.
    along = -ft * np.cos(angle) - fr * np.sin(angle)
    across = ft * np.sin(angle) - fr * np.cos(angle)
    return 2 / (2 * np.pi) * np.trapezoid(np.stack([along, across, fa], axis=-1), angle[0], axis=1)


def forces(rng, points, rots, cuts, size_n):
    """Forces of a cutter whose engagement changes slowly along the path, and more at corners; nothing in air. `size_n` is their rms in cut."""
    chord = np.diff(points, axis=0, prepend=points[:1])
    chord[0] = chord[1]
    feed = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-9)
    axis = -rots[:, :, 2]
    feed = feed - axis * np.sum(feed * axis, axis=1, keepdims=True)
    feed /= np.maximum(np.linalg.norm(feed, axis=1, keepdims=True), 1e-3)
    axial = np.clip(1 + waves(rng, 0.3)(points[:, 0], points[:, 1]), 0.3, 2.0)
    turn = np.concatenate([[0], np.arccos(np.clip(np.sum(feed[1:] * feed[:-1], axis=1), -1, 1))])
    radial = np.clip(rng.uniform(0.2, 0.7) + waves(rng, 0.1)(points[:, 0], points[:, 1]) + 0.25 * (turn > 0.5), 0.05, 1.0)
    force = cutter_force(axial, radial, rng.uniform(0.05, 0.2), up=rng.random() < 0.5, thrust=rng.uniform(-0.6, 1.2))
    force = force[:, :1] * feed + force[:, 1:2] * np.cross(axis, feed) + force[:, 2:] * axis
    force[~cuts] = 0
    return np.round(force * size_n / max(np.sqrt(np.mean(np.sum(force[cuts] ** 2, axis=1))), 1e-9), 2)


def draw(robot, rng, family, rows, table, at_mm, spin, start_s, dwell_s, size):
    """One program that the arm can run, or `OutOfReach`. Numbers are rounded as the program states them."""
    points, rots, cuts = FAMILIES[family](rng, rows)
    turn = chain.about(2, spin)[0]
    points, rots = points @ turn.T + at_mm, turn @ rots @ chain.about(2, -spin * rng.uniform(0.0, 1.0))[0]
    force = forces(rng, points, rots, cuts, size * robot.force_n)
    speed = np.where(cuts, rng.choice([10.0, 15.0, 20.0, 30.0]), 100.0)
    points, quats = np.round(points, 3), np.round(chain.quaternion(rots), 8)
    path = Path(points, chain.rotation(quats), speed, force, *table, start_s, dwell_s)
    return path, quats


def flange_of(robot, path):
    """Where the controller puts the flange, base axes, m."""
    table = chain.rotation(path.table_quat)[0]
    rot = table @ path.rots
    pos = (path.table_mm + path.points @ table.T) * 1e-3
    return rot, pos - rot @ (np.array(robot.tool_mm) * 1e-3)


def rapid(robot, path, quats, motor):
    """The program as a module with inline targets; confdata as the arm stands there."""
    quadrant = np.floor(motor / (np.pi / 2) + 1e-9).astype(int)
    mm = lambda v: ",".join(f"{x:.3f}" for x in v)
    quat = lambda q: ",".join(f"{x:.8f}" for x in q)
    behind = 0 if motor[0, 4] >= 0 or robot.parallelogram else 1
    out = [
        "%%%", "  VERSION:1", "  LANGUAGE:ENGLISH", "%%%", "MODULE Part",
        f"  PERS tooldata tMill:=[TRUE,[[{mm(robot.tool_mm)}],[1,0,0,0]],[{robot.tool_kg},[0,0,120],[1,0,0,0],0,0,0]];",
        f'  PERS wobjdata wTable:=[FALSE,TRUE,"",[[{mm(path.table_mm)}],[{quat(path.table_quat)}]],[[0,0,0],[1,0,0,0]]];',
        "  PROC main()", "    ConfL\\Off;",
    ]
    for p, r, s, q in zip(path.points, quats, path.speed_mm_s, quadrant):
        out.append(f"    MoveL [[{mm(p)}],[{quat(r)}],[{q[0]},{q[3]},{q[5]},{behind}],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v{s:.0f},z1,tMill\\WObj:=wTable;")
    return "\n".join([*out, "  ENDPROC", "ENDMODULE", ""])
