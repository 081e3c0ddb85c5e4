"""Measurement programs: where to go, how turned, how loaded, when. Written as RAPID and cell files as a user would have them."""

import csv
import subprocess
from dataclasses import dataclass, field

import numpy as np

from kinematics import solve_path
from program import MM, Cell, Frame, frame_mm, quat_to_rot, rot_to_quat, rotvec_to_rot

DOWN = quat_to_rot([0, 0, 1, 0])  # tool pointing down, its x axis towards -x of the work object


@dataclass
class Robot:
    """A robot as a cell declares it, and where its work lies (mm, base axes). Sizes are typical of the class."""

    label: str
    parallelogram: bool
    links: list  # alpha_deg, a_mm, d_mm, theta_deg
    axis_min_deg: list
    axis_max_deg: list
    stiffness: list
    tool_mm: list
    tool_kg: float
    area_mm: list  # centre of the work
    force_n: float
    mass_kg: list = field(default_factory=list)
    cog_mm: list = field(default_factory=list)  # of each link in its own frame

    def cell(self):
        rows = np.array(self.links, float) * [np.pi / 180, MM, MM, np.pi / 180]
        return Cell(rows, self.parallelogram, frame_mm([0, 0, 0]), np.array(self.stiffness), np.radians(self.axis_min_deg),
                    np.radians(self.axis_max_deg), None, {}, {})

    def cell_toml(self):
        keys = ("alpha_deg", "a_mm", "d_mm", "theta_deg")
        links = "".join("  { " + ", ".join(f"{k} = {float(v)}" for k, v in zip(keys, row)) + " },\n" for row in self.links)
        return (f'[robot]\nmodel = "{self.label}"\n\n[robot.kinematics]\nparallelogram = {str(self.parallelogram).lower()}\n'
                f"links = [\n{links}]\naxis_min_deg = {self.axis_min_deg}\naxis_max_deg = {self.axis_max_deg}\n\n"
                f'[robot.stiffness]\njoint_nm_per_rad = {self.stiffness}\n\n[cut]\nforce = "table"\n')


ROBOTS = [
    Robot("parallel-16", True,
          [(0, 0, 615, 0), (-90, 100, 0, -90), (0, 705, 0, 0), (-90, 135, 755, 0), (90, 0, 0, 0), (-90, 0, 85, 180)],
          [-180, -90, -180, -300, -130, -360], [180, 150, 180, 300, 130, 360], [4.1e5, 3.6e5, 3.2e5, 9.5e4, 7.0e4, 5.2e4],
          [25, 0, 210], 9, [780, 0, 620], 220, [120, 60, 70, 15, 8, 12],
          [[50, 0, -200], [330, 0, 20], [50, 30, 0], [10, 0, -395], [0, 20, 0], [0, 0, 35]]),
    Robot("parallel-205", True,
          [(0, 0, 814.5, 0), (-90, 300, 0, -90), (0, 700, 0, 0), (-90, 280, 893, 0), (90, 0, 0, 0), (-90, 0, 200, 180)],
          [-180, -42, -20, -300, -120, -360], [180, 85, 120, 300, 120, 360], [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4],
          [40, 0, 310], 30, [1250, 0, 750], 420, [500, 260, 300, 60, 30, 25],
          [[100, 0, -200], [330, 0, 20], [80, 60, 0], [10, 0, -420], [0, 30, 0], [0, 0, -60]]),
    Robot("serial-60", False,
          [(0, 0, 495, 0), (-90, 175, 0, -90), (0, 900, 0, 0), (-90, 175, 960, 0), (90, 0, 0, 0), (-90, 0, 135, 180)],
          [-180, -90, -180, -400, -125, -400], [180, 150, 75, 400, 120, 400], [6.0e5, 5.2e5, 4.3e5, 1.3e5, 9.0e4, 6.5e4],
          [30, 0, 250], 15, [1150, 0, 520], 300, [160, 90, 80, 30, 12, 10],
          [[60, 0, -150], [420, 0, 30], [70, 40, 0], [10, 0, -450], [0, 25, 0], [0, 0, -40]]),
]


@dataclass
class Plan:
    """Targets of one program with the load and the time of each."""

    wobj_mm: list
    wobj_quat: np.ndarray
    points: np.ndarray  # mm
    rots: list
    speeds: np.ndarray  # mm/s
    force: np.ndarray  # N on the tool, work object axes; zero is air
    dwell_s: float = 0.0
    start_s: float = 0.0

    def times(self):
        step = np.linalg.norm(np.diff(self.points, axis=0), axis=1) / self.speeds[1:] + self.dwell_s
        return np.round(self.start_s + np.concatenate([[0], np.cumsum(step)]), 1)


def smooth(rng, scale, waves=2.0):
    """A smooth random function of two arguments in 0..1."""
    a, f, p = rng.normal(size=3), rng.uniform(0.4, waves, (3, 2)), rng.uniform(0, 6.3, 3)
    return lambda u, v: scale * float(np.sum(a * np.sin(2 * np.pi * (f @ [u, v]) + p))) / np.sqrt(3)


def place(robot, rng, lift=0.0):
    """Work object near the middle of the work area, turned a little."""
    turn = rotvec_to_rot([0, 0, rng.uniform(-0.15, 0.15)])
    return np.array(robot.area_mm) + rng.uniform(-40, 40, 3) + [0, 0, lift], turn


def raster(robot, rng, rows, columns, reverse=False, lift=0.0):
    """One zig-zag over a gently curved face: the plain program, one load, slowly varying."""
    centre, turn = place(robot, rng, lift)
    width, height = rng.uniform(240, 320), rng.uniform(420, 560)
    corner = centre - turn @ np.array([width / 2, height / 2, 0])
    level, lean_x, lean_y, spin = smooth(rng, 15), smooth(rng, 0.10), smooth(rng, 0.10), smooth(rng, 0.10)
    base = robot.force_n * np.array([0.13, 0.62, 0.77]) * ([-1, 0.3, 0.4] if reverse else [1, 1, 1])
    ripple = [smooth(rng, 0.12) for _ in range(3)]
    points, rots, force = [], [], []
    for j in range(rows):
        for i in range(columns) if j % 2 == 0 else reversed(range(columns)):
            u, v = i / (columns - 1), j / (rows - 1)
            points.append([u * width, v * height, level(u, v)])
            rots.append(DOWN @ rotvec_to_rot([lean_x(u, v), 0, 0]) @ rotvec_to_rot([0, lean_y(u, v), 0]) @ rotvec_to_rot([0, 0, spin(u, v)]))
            force.append([b * (1 + r(u, v)) for b, r in zip(base, ripple)])
    n = rows * columns
    return Plan(list(corner), rot_to_quat(turn), np.array(points), rots, np.full(n, 20.0), np.array(force))


def zigzag(robot, rng, rows=6, columns=4):
    """What a shop would measure unplanned: one zig-zag over the box of `plan_toml`, leaning otherwise in each row, a third under each load."""
    centre, turn = place(robot, rng)
    loads = np.array([[0, 0, 0], [0, 0, 1.0], [0.6, -0.5, 0.4]]) * robot.force_n
    lean = rng.uniform(0.15, 0.3)
    points, rots, force = [], [], []
    for j in range(rows):
        for i in range(columns) if j % 2 == 0 else reversed(range(columns)):
            points.append([(i / (columns - 1) - 0.5) * 400, (j / (rows - 1) - 0.5) * 560, rng.uniform(-20, 20)])
            rots.append(DOWN @ rotvec_to_rot([lean * (-1, 0, 1)[j % 3], lean * (-1, 1)[i % 2], 0]))
            force.append(loads[len(points) * 3 // (rows * columns + 1)])
    n = rows * columns
    return Plan(list(centre), rot_to_quat(turn), np.array(points), rots, np.full(n, 20.0), np.array(force), dwell_s=10.0)


def designed(robot, rng, passes=38, per_pass=8):
    """Short lines that vary everything by which effects can be distinguished, in shuffled order.

    Three areas with their own tool posture; feed along x and y, both ways; three spins about the tool axis; air, half and
    full load with forces of either sign; two speeds. Each line is approached in air.
    """
    centre, turn = place(robot, rng)
    spread = 0.13 * np.linalg.norm(robot.area_mm[:2])
    areas = [np.array([-1.0, -1.6, 0.7]) * spread, np.array([1.0, 0.0, -1.0]) * spread, np.array([-0.7, 1.6, 0.2]) * spread]
    leans = [[0.0, 0.0], [-0.10, 0.35], [0.30, -0.12]]
    lines = []
    for n in range(passes):
        lines.append(dict(area=n % 3, axis=(n // 3) % 2, way=1 if (n // 6) % 2 else -1, spin=(-1.0, 0.0, 1.0)[(n // 2) % 3],
                          load=(0.0, 0.5, 1.0, 1.0)[(n + n // 4) % 4], speed=(20.0, 60.0)[(n // 5) % 2]))
    rng.shuffle(lines)
    points, rots, force, speeds = [], [], [], []
    for line in lines:
        middle = areas[line["area"]] + rng.uniform(-1, 1, 3) * [70, 70, 25]
        along = np.array([[1.0, 0, 0], [0, 1.0, 0]][line["axis"]]) * line["way"]
        length = rng.uniform(90, 160)
        lean = np.array(leans[line["area"]]) + rng.uniform(-0.08, 0.08, 2)
        rot = DOWN @ rotvec_to_rot([lean[0], 0, 0]) @ rotvec_to_rot([0, lean[1], 0]) @ rotvec_to_rot([0, 0, line["spin"] * np.radians(45) + rng.uniform(-0.1, 0.1)])
        feed_axes = np.column_stack([along, np.cross([0, 0, 1.0], along), [0, 0, 1.0]])
        push = robot.force_n * line["load"] * np.array([-0.3, 0.6, 0.7]) * rng.choice([-1, 1], 3) * rng.uniform(0.85, 1.15, 3)
        for k in range(per_pass):
            points.append(middle + along * length * (k / (per_pass - 1) - 0.5))
            rots.append(rot)
            speeds.append(line["speed"])
            force.append(feed_axes @ push * rng.uniform(0.97, 1.03) if k else np.zeros(3))
    return Plan(list(centre), rot_to_quat(turn), np.array(points), rots, np.array(speeds), np.array(force), dwell_s=5.0)


def plan_toml(robot, rng):
    """What `deflex plan` has to know: tool, work object, and a box of 0.6 x 0.8 x 0.25 m about the middle of the work area."""
    centre, turn = place(robot, rng)
    corner = centre - turn @ np.array([300.0, 400.0, 125.0])
    force = float(robot.force_n)
    row = lambda v: "[" + ", ".join(f"{float(x):.6f}" for x in v) + "]"
    loads = [[0, 0, 0], [0, 0, force], [0.6 * force, -0.5 * force, 0.4 * force]]
    return (f"\n[tools.tMill]\ntcp_mm = {row(robot.tool_mm)}\ntcp_quat = [1.0, 0.0, 0.0, 0.0]\nmass_kg = {float(robot.tool_kg)}\ncog_mm = [0.0, 0.0, 120.0]\n"
            f"\n[wobjs.wPart]\nuframe_mm = {row(corner)}\nuframe_quat = {row(rot_to_quat(turn))}\n"
            f'\n[plan]\nwobj = "wPart"\ntool = "tMill"\nbox_mm = [[0.0, 0.0, 0.0], [600.0, 800.0, 250.0]]\ntilt_deg = 30.0\n'
            f"loads_n = [{', '.join(row(load) for load in loads)}]\nload_changes = 3\n"
            f'instrument = "position"\nnoise_mm = 0.014\neffect_mm = 0.06\n')


@dataclass
class Planned:
    """Targets that `deflex plan` chose, with their loads and times; the program is its own."""

    force: np.ndarray
    when: np.ndarray

    def times(self):
        return self.when


def planned(folder, deflex, rows=24, after=None):
    """Runs `deflex plan` on the cell of a folder, to settle what the JSON `after` left undecided: the plan and the program's text."""
    program, table = folder / "part.mod", folder / "plan.csv"
    subprocess.run([deflex, "plan", "--cell", folder / "cell.toml", "--rows", str(rows), "-o", program, "--measured", table,
                    "--json", folder / "plan.json", *(["--after", after] if after else []), "--quiet"],
                   check=True, stdout=subprocess.DEVNULL)
    with open(table, newline="") as f:
        read = list(csv.DictReader(f))
    force = np.array([[float(row[c]) for c in ("fx_n", "fy_n", "fz_n")] for row in read])
    return Planned(force, np.array([float(row["time_s"]) for row in read])), program.read_text()


def transfer(robot, rng):
    """Another program of the same cell: elsewhere, turned, otherwise loaded, later."""
    plan = raster(robot, rng, 8, 12, reverse=True, lift=rng.uniform(-120, -60))
    plan.start_s = 400.0
    return plan


def rapid(robot, plan, module="Part"):
    """The plan as a RAPID module with inline robtargets; confdata as the arm will stand there."""
    wobj = frame_mm(plan.wobj_mm, plan.wobj_quat)
    tool = frame_mm(robot.tool_mm)
    flanges = [wobj @ Frame(r, p * MM) @ tool.inv() for p, r in zip(plan.points, plan.rots)]
    motor = solve_path(robot.cell(), flanges, [(0, 0, 0, 0)] * len(flanges))
    if np.degrees(np.abs(motor[:, 4])).min() < 8 or len(set(np.sign(motor[:, 4]))) > 1:
        raise ValueError("the path comes too near a wrist singularity")
    if np.any(np.degrees(np.abs(np.diff(motor, axis=0))) > 150):
        raise ValueError("the path leaves room for another branch")
    quadrant = np.floor(motor / (np.pi / 2) + 1e-9).astype(int)
    mm = lambda v: ",".join(f"{x:.3f}" for x in v)
    quat = lambda q: ",".join(f"{x:.8f}" for x in q)
    lines = [
        "%%%", "  VERSION:1", "  LANGUAGE:ENGLISH", "%%%", f"MODULE {module}",
        f"  PERS tooldata tMill:=[TRUE,[[{mm(robot.tool_mm)}],[1,0,0,0]],[{robot.tool_kg},[0,0,120],[1,0,0,0],0,0,0]];",
        f'  PERS wobjdata wPart:=[FALSE,TRUE,"",[[{mm(plan.wobj_mm)}],[{quat(plan.wobj_quat)}]],[[0,0,0],[1,0,0,0]]];',
        "  PROC main()", "    ConfL\\Off;",
    ]
    for p, r, s, q in zip(plan.points, plan.rots, plan.speeds, quadrant):
        lines.append(f"    MoveL [[{mm(p)}],[{quat(rot_to_quat(r))}],[{q[0]},{q[3]},{q[5]},{0 if motor[0][4] >= 0 or robot.parallelogram else 1}],"
                     f"[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v{s:.0f},z1,tMill\\WObj:=wPart;")
    return "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])


def draw(robot, make, seed, module="Part"):
    """First plan of a seed's stream that the arm can run on one branch."""
    rng = np.random.default_rng(seed)
    for _ in range(50):
        plan = make(robot, rng)
        try:
            return plan, rapid(robot, plan, module)
        except (ValueError, SystemExit):
            continue
    raise RuntimeError(f"{robot.label}: no plan fits")
