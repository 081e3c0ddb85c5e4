"""Reads what the plant needs: RAPID motions with literal robtargets, and the cell file.

Deliberately small: only literals are read, anything computed is refused. Lengths come out in metres, angles in radians.
"""

import re
import tomllib
from dataclasses import dataclass

import numpy as np

MM = 1e-3

# Nominal modified-DH rows (alpha_deg, a_mm, d_mm, theta_deg) and joint stiffness of the one robot the samples name by model.
# Source: ABB product manual drawings for the lengths, Tang et al. Tables 1 and 2 for rows and stiffness.
BUILT_IN = {
    "irb6660-205-1.9": {
        "parallelogram": True,
        "links": [(0, 0, 814.5, 0), (-90, 300, 0, -90), (0, 700, 0, 0), (-90, 280, 893, 0), (90, 0, 0, 0), (-90, 0, 200, 180)],
        "axis_min_deg": [-180, -42, -20, -300, -120, -360],
        "axis_max_deg": [180, 85, 120, 300, 120, 360],
    }
}


@dataclass
class Frame:
    """Rigid transform `a_from_b`: rotation matrix and translation in metres."""

    rot: np.ndarray
    pos: np.ndarray

    def __matmul__(self, other):
        return Frame(self.rot @ other.rot, self.rot @ other.pos + self.pos)

    def inv(self):
        return Frame(self.rot.T, -self.rot.T @ self.pos)


def quat_to_rot(q):
    w, x, y, z = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def rot_to_quat(r):
    # The largest component first (Shepperd), so that no branch divides by a small number.
    d = np.array([1 + r[0, 0] + r[1, 1] + r[2, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2],
                  1 - r[0, 0] + r[1, 1] - r[2, 2], 1 - r[0, 0] - r[1, 1] + r[2, 2]])
    i = int(np.argmax(d))
    off = [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]
    sym = [r[1, 2] + r[2, 1], r[0, 2] + r[2, 0], r[0, 1] + r[1, 0]]
    if i == 0:
        q = [d[0], *off]
    else:
        q = [off[i - 1], 0, 0, 0]
        q[i] = d[i]
        for j in {1, 2, 3} - {i}:
            q[j] = sym[6 - i - j - 1]
    q = np.array(q) / np.linalg.norm(q)
    return q if q[0] >= 0 else -q


def rotvec_to_rot(v):
    angle = np.linalg.norm(v)
    if angle == 0:
        return np.eye(3)
    return quat_to_rot([np.cos(angle / 2), *(np.sin(angle / 2) * np.asarray(v) / angle)])


def frame_mm(mm, quat=(1, 0, 0, 0)):
    return Frame(quat_to_rot(quat), np.asarray(mm, float) * MM)


@dataclass
class Tool:
    flange_from_tcp: Frame
    mass_kg: float
    cog_m: np.ndarray


@dataclass
class Move:
    wobj_from_tcp: Frame
    conf: tuple
    speed_m_s: float
    tool: str
    wobj: str
    line: int
    zone_m: float | None = None  # radius of the zone, None for a stop


@dataclass
class Program:
    moves: list
    tools: dict
    wobjs: dict  # world_from_wobj


NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")


def literal(text):
    """Nested RAPID aggregate as lists of floats, bools and strings; None where it is not a literal."""
    tokens = re.findall(r'\[|\]|,|"[^"]*"|[^\[\],\s]+', text)
    pos = 0

    def value():
        nonlocal pos
        token = tokens[pos]
        pos += 1
        if token == "[":
            items = []
            while tokens[pos] != "]":
                if tokens[pos] == ",":
                    pos += 1
                items.append(value())
            pos += 1
            return items
        if NUMBER.match(token):
            return float(token)
        if token.upper() in ("TRUE", "FALSE"):
            return token.upper() == "TRUE"
        if token.startswith('"'):
            return token
        raise ValueError(token)

    try:
        out = value()
    except (ValueError, IndexError):
        return None
    return out if pos == len(tokens) else None


def split_args(text):
    depth, start, out = 0, 0, []
    for i, c in enumerate(text):
        depth += (c in "[(") - (c in "])")
        if c == "," and depth == 0:
            out.append(text[start:i].strip())
            start = i + 1
    return out + [text[start:].strip()]


def read_program(path):
    text = open(path, encoding="latin-1").read()
    moves, tools, wobjs, targets = [], {}, {}, {}
    declared = re.compile(r"(?:PERS|CONST|VAR|TASK\s+PERS)\s+(tooldata|wobjdata|robtarget)\s+(\w+)\s*:=\s*(.*)$", re.I | re.S)
    line = 1
    for raw in text.split(";"):
        first = line + raw[: len(raw) - len(raw.lstrip())].count("\n")
        line += raw.count("\n")
        statement = "\n".join(l for l in raw.split("\n") if not l.lstrip().startswith("!")).strip()
        found = declared.search(statement)
        if found:
            kind, name, value = found.group(1).lower(), found.group(2).lower(), literal(found.group(3))
            if value is None:
                raise SystemExit(f"{path}:{first}: {name} is not a literal")
            if kind == "tooldata":
                tools[name] = Tool(frame_mm(*value[1]), value[2][0], np.array(value[2][1]) * MM)
            elif kind == "wobjdata":
                wobjs[name] = frame_mm(*value[3]) @ frame_mm(*value[4])
            else:
                targets[name] = value
            continue
        found = re.search(r"\b(Move\w+)\s+(.*)$", statement, re.S | re.I)
        if not found:
            continue
        if found.group(1).lower() not in ("movel", "movej"):
            raise SystemExit(f"{path}:{first}: the plant runs MoveL and MoveJ only, not {found.group(1)}")
        args = split_args(found.group(2))
        point = literal(args[0]) if args[0].startswith("[") else targets.get(args[0].lower())
        if point is None:
            raise SystemExit(f"{path}:{first}: target {args[0]!r} is not a literal")
        tool, *options = [s.strip() for s in args[3].split("\\")]
        wobj = next((o.split(":=")[1].strip() for o in options if o.lower().startswith("wobj")), "wobj0")
        moves.append(Move(frame_mm(point[0], point[1]), tuple(int(c) for c in point[2]), speed(args[1]), tool.lower(), wobj.lower(), first, zone(args[2])))
    if not moves:
        raise SystemExit(f"{path}: no motion found")
    return Program(moves, tools, wobjs)


def speed(token):
    token = token.split("\\")[0]
    if token.startswith("["):
        return literal(token)[0] * MM
    if re.match(r"v\d+$", token):
        return float(token[1:]) * MM
    if token.lower() == "vmax":
        return 7.0
    raise SystemExit(f"speed {token!r} is not a literal")


def zone(token):
    token = token.split("\\")[0].strip()
    if token.lower() == "fine":
        return None
    if token.startswith("["):
        fields = literal(token)
        return None if fields[0] else fields[1] * MM
    if re.match(r"z\d+$", token):
        return max(float(token[1:]), 0.3) * MM
    raise SystemExit(f"zone {token!r} is not a literal")


@dataclass
class Cell:
    """What the controller believes: nominal geometry, declared stiffness, declared tools and work objects."""

    links: np.ndarray  # rows alpha_rad, a_m, d_m, theta_rad
    parallelogram: bool
    world_from_base: Frame
    stiffness: np.ndarray  # N m/rad at the motors
    axis_min: np.ndarray
    axis_max: np.ndarray
    start: np.ndarray | None
    tools: dict
    wobjs: dict

    @property
    def motor_from_serial(self):
        """m = B q: the parallelogram's third motor sets the forearm's angle to link 1."""
        b = np.eye(6)
        if self.parallelogram:
            b[2, 1] = 1.0
        return b


def read_cell(path):
    with open(path, "rb") as f:
        toml = tomllib.load(f)
    robot = toml["robot"]
    kin = robot.get("kinematics") or BUILT_IN.get(robot.get("model"))
    if kin is None:
        raise SystemExit(f"{path}: robot {robot.get('model')!r} is not built in; give [robot.kinematics]")
    rows = [r if isinstance(r, tuple) else (r["alpha_deg"], r["a_mm"], r["d_mm"], r["theta_deg"]) for r in kin["links"]]
    rows = np.array(rows, float) * [np.pi / 180, MM, MM, np.pi / 180]
    tools = {
        name.lower(): Tool(frame_mm(t["tcp_mm"], t.get("tcp_quat", (1, 0, 0, 0))), t.get("mass_kg", 0.0), np.array(t.get("cog_mm", [0, 0, 0])) * MM)
        for name, t in toml.get("tools", {}).items()
    }
    wobjs = {
        name.lower(): frame_mm(w.get("uframe_mm", [0, 0, 0]), w.get("uframe_quat", (1, 0, 0, 0)))
        @ frame_mm(w.get("oframe_mm", [0, 0, 0]), w.get("oframe_quat", (1, 0, 0, 0)))
        for name, w in toml.get("wobjs", {}).items()
    }
    return Cell(
        links=rows,
        parallelogram=kin.get("parallelogram", False),
        world_from_base=frame_mm(robot.get("base_mm", [0, 0, 0]), robot.get("base_quat", (1, 0, 0, 0))),
        # A cell without stiffness declares stiff motors.
        stiffness=np.array(robot.get("stiffness", {}).get("joint_nm_per_rad", [1e12] * 6), float),
        axis_min=np.radians(kin.get("axis_min_deg", [-360] * 6)),
        axis_max=np.radians(kin.get("axis_max_deg", [360] * 6)),
        start=np.radians(robot["start_deg"]) if "start_deg" in robot else None,
        tools=tools,
        wobjs={"wobj0": frame_mm([0, 0, 0]), **wobjs},
    )
