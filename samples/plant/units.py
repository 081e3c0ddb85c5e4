"""Tracks, tables, tilted tracks under gravity and stationary tools on the MuJoCo arm, against deflex.

    units.py correct DEFLEX FOLDER
    units.py identify DEFLEX FOLDER

For each scenario: a program of random targets, forces and external axes. `correct`: how far `deflex predict` is from where the arm
comes to rest, and how far from the programmed targets it comes to rest on what `deflex compensate` has written. `identify`: the
arm has an effect that its cell lacks; what `deflex identify` finds in 160 noisy rows.
"""

import csv
import json
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from arm import Arm
from kinematics import copies, inverse
from program import BUILT_IN, MM, Cell, Frame, Tool, quat_to_rot, rot_to_quat, rotvec_to_rot

ROBOT = "irb6660-205-1.9"
START_DEG = [0, 0, 20, 0, 70, 0]
TARGETS = 24
ROWS = 160
NOISE_MM = 0.015
HIDDEN = [
    {
        "kind": "gravity",
        "tool": True,
        "mass_kg": [0, 60, 50, 20, 10, 4],
        "first_moment_kg_m": [[0, 0, 0], [20, 0, 0], [8, 15, 0], [0, 0, -3], [0, 0.3, 0.5], [0, 0, 0.2]],
    },
    {"kind": "base_compliance", "rad_per_nm": [6e-8, 6e-8, 6e-8]},
    {"kind": "joint_stiffness", "scale": [1, 0.75, 1, 1, 0.7, 1]},
]
TOUCHES = 4  # each is a thousand times nearer to where the part is touched
STANDARD_GRAVITY = 9.80665  # as deflex has it
AXES = ["eax_a", "eax_b", "eax_c", "eax_d", "eax_e", "eax_f"]
EFFECTS = [
    {
        "kind": "gravity",
        "tool": True,
        "mass_kg": [300, 220, 180, 60, 30, 12],
        "first_moment_kg_m": [[20, 5, -40], [70, 2, 3], [30, 40, 5], [1, 2, -8], [0, 1, 2], [0, 0, 0.6]],
    },
    {"kind": "base_compliance", "mm_per_n": [2e-5, 3e-5, 1e-5], "rad_per_nm": [2e-8, 3e-8, 1e-8]},
    {"kind": "bearing_compliance", "rad_per_nm": [[1e-8, 2e-8], [1e-7, 2e-7], [2e-7, 1e-7], [3e-7, 1e-7], [2e-7, 3e-7], [4e-7, 3e-7]]},
    {"kind": "stiffness_curve", "form": "cubic", "c_per_rad2": [2e5] * 6},
]


def numbers(values):
    return "[" + ",".join(repr(round(float(v), 10)) for v in values) + "]"


def frame(mm=(0, 0, 0), turn=(0, 0, 0)):
    """A frame with the digits that files have."""
    quat = np.round(rot_to_quat(rotvec_to_rot(np.asarray(turn, float))), 10)
    return Frame(quat_to_rot(quat), np.asarray(mm, float) * MM)


def pose(f):
    return f"[{numbers(f.pos / MM)},{numbers(rot_to_quat(f.rot))}]"


@dataclass
class Unit:
    name: str
    axis: str
    kind: str
    carries: str
    base: Frame = field(default_factory=frame)
    direction: tuple = (0, 1, 0)
    on: str | None = None

    def moved(self, e, on):
        """Its frame in the world with the axis at `e` (mm or degrees)."""
        if self.kind == "linear":
            return on @ Frame(np.eye(3), np.array(self.direction) * e * MM) @ self.base
        return on @ self.base @ Frame(rotvec_to_rot([0, 0, np.radians(e)]), np.zeros(3))

    def toml(self):
        text = f'[[unit]]\nname = "{self.name}"\naxis = "{self.axis}"\nkind = "{self.kind}"\ncarries = "{self.carries}"\nmin = -5000.0\nmax = 5000.0\n'
        text += f'on = "{self.on}"\n' if self.on else ""
        if self.kind == "linear":
            return text + f"direction = {numbers(self.direction)}\n"
        return text + f"base_mm = {numbers(self.base.pos / MM)}\nbase_quat = {numbers(rot_to_quat(self.base.rot))}\n"


@dataclass
class Target:
    goal: Frame
    external: dict
    force: np.ndarray


class Scenario:
    """A cell with units; `part`: the unit that the work object is on."""

    def __init__(self, name, units=(), base=None, part=None, stationary=False, effects=EFFECTS):
        self.name, self.units, self.base = name, list(units), base or frame()
        self.part, self.stationary = part, stationary
        self.tool = Tool(frame([30, -20, 310], [0.02, 0.3, 0.1]), 18.0, np.array([0.01, 0.0, 0.12]))
        self.world_from_tip = frame([1350, 250, 750], [3.0, 0.1, 0.2])
        self.uframe = frame([20, 10, 200], [0.1, 0.2, 0.3]) if stationary else frame() if part else frame([1400, 100, 400], [0.01, 0.02, 0.3])
        self.oframe = frame([10, 20, 30], [0.0, 0.05, 0.5])
        kin = BUILT_IN[ROBOT]
        rows = np.array(kin["links"], float) * [np.pi / 180, MM, MM, np.pi / 180]
        stiffness = np.array([8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4])
        self.cell = Cell(rows, True, frame(), stiffness, np.radians(kin["axis_min_deg"]), np.radians(kin["axis_max_deg"]), np.radians(START_DEG), {}, {})
        self.effects = self.felt(effects)

    def felt(self, effects):
        """A tool that stands hangs on no flange."""
        return [{**e, "tool": not self.stationary} if e["kind"] == "gravity" else e for e in effects]

    def frames(self, external):
        """World from base, and world from work object where the robot does not hold it."""
        at = {None: frame()}
        for unit in self.units:
            at[unit.name] = unit.moved(external[unit.axis], at[unit.on])
        carrier = next((unit.name for unit in self.units if unit.carries == "robot"), None)
        return at[carrier] @ self.base, at[self.part] @ self.uframe @ self.oframe

    def targets(self, rng, count=TARGETS):
        external, found = {unit.axis: 0.0 for unit in self.units}, []
        for _ in range(count):
            for unit in self.units:
                external[unit.axis] += round(rng.uniform(-1, 1) * (60 if unit.kind == "linear" else 12), 3)
            base, wobj = self.frames(external)
            lean = 0.1 * rng.standard_normal(3)
            if self.stationary:
                flange = frame(np.array([1300, 100, 1050]) + rng.uniform(-80, 80, 3), lean + [0, 1.7, 0])
                goal = (base @ flange @ self.uframe @ self.oframe).inv() @ self.world_from_tip
            else:
                goal = wobj.inv() @ base @ frame(np.array([1400, 100, 800]) + rng.uniform(-120, 120, 3), lean + [0, np.pi - 0.2, 0])
            goal = Frame(quat_to_rot(np.round(rot_to_quat(goal.rot), 10)), np.round(goal.pos / MM, 3) * MM)
            found.append(Target(goal, dict(external), np.round(rng.uniform(-300, 300, 3), 1)))
        return found

    def write(self, folder, targets):
        tool = pose(self.world_from_tip if self.stationary else self.tool.flange_from_tcp)
        held, standing = ("FALSE", "TRUE") if self.stationary else ("TRUE", "FALSE")
        unit = f'FALSE,"{self.part}"' if self.part else 'TRUE,""'
        lines = [
            "MODULE T",
            f"PERS tooldata tT:=[{held},{tool},[18,[10,0,120],[1,0,0,0],0,0,0]];",
            f"PERS wobjdata wW:=[{standing},{unit},{pose(self.uframe)},{pose(self.oframe)}];",
            "PROC main()",
            "ConfL\\Off;",
        ]
        for t in targets:
            external = ",".join(repr(round(t.external[a], 4)) if a in t.external else "9E9" for a in AXES)
            lines.append(f"MoveL [{pose(t.goal)[1:-1]},[0,0,0,0],[{external}]],v20,fine,tT\\WObj:=wW;")
        (folder / f"{self.name}.mod").write_text("\n".join([*lines, "ENDPROC", "ENDMODULE", ""]))
        cell = f'[robot]\nmodel = "{ROBOT}"\nstart_deg = {START_DEG}\nbase_mm = {numbers(self.base.pos / MM)}\nbase_quat = {numbers(rot_to_quat(self.base.rot))}\n'
        cell += f"[robot.stiffness]\njoint_nm_per_rad = {numbers(self.cell.stiffness)}\n" + "".join(unit.toml() for unit in self.units)
        cell += "[limits]\nmax_correction_mm = 20.0\nmax_step_mm = 20.0\n[controller]\ncompensates = []\n"
        for effect in self.effects:
            cell += "[[effect]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in effect.items())
        (folder / f"{self.name}.toml").write_text(cell)
        rows = [f"{k + 1},{t.force[0]},{t.force[1]},{t.force[2]}\n" for k, t in enumerate(targets)]
        (folder / f"{self.name}.csv").write_text("target,fx_n,fy_n,fz_n\n" + "".join(rows))

    def arm(self, tool, base):
        """The arm on its base, wherever a track has led that."""
        arm = Arm(self.cell, tool, self.effects)
        arm.model.opt.gravity[2] = -STANDARD_GRAVITY
        body = mujoco.mj_name2id(arm.model, mujoco.mjtObj.mjOBJ_BODY, "base")
        arm.model.body_pos[body], arm.model.body_quat[body] = base.pos, rot_to_quat(base.rot)
        return arm

    def rest(self, arm, motor, force):
        return arm.rest(motor, force, np.zeros(6), np.array([0, 0, 1.0]), 0.0, np.zeros(6), 0.0)[0]

    def errors(self, targets, commanded):
        """Where the tool comes to rest in the work object, less the programmed place, mm."""
        before, out = self.cell.start, []
        for t, goal in zip(targets, commanded):
            base, wobj = self.frames(t.external)
            if self.stationary:
                wobj = self.world_from_tip @ goal.inv()
                flange_from_wobj = self.uframe @ self.oframe
                flange = base.inv() @ wobj @ flange_from_wobj.inv()
            else:
                flange = base.inv() @ wobj @ goal @ self.tool.flange_from_tcp.inv()
            found = [c for s in inverse(self.cell, flange) for c in copies(self.cell, s)]
            motor = before = min(found, key=lambda m: np.linalg.norm(m - before))
            force = wobj.rot @ t.force
            if self.stationary:
                # The tool pushes back where it touches the part, in the axes of the part: both as the arm comes to rest.
                seen = goal
                for _ in range(TOUCHES):
                    touched = Frame(np.eye(3), (flange_from_wobj @ seen).pos)
                    force = -(self.world_from_tip @ seen.inv()).rot @ t.force
                    world_from_touched = self.rest(self.arm(Tool(touched, 0.0, np.zeros(3)), base), motor, force)
                    seen = (world_from_touched @ touched.inv() @ flange_from_wobj).inv() @ self.world_from_tip
            else:
                seen = wobj.inv() @ self.rest(self.arm(self.tool, base), motor, force)
            out.append((seen.pos - t.goal.pos) / MM)
        return np.array(out)


def scenarios(effects=EFFECTS):
    slope = np.array([0.3, 0.9, 0.1])
    slope = tuple(np.round(slope / np.linalg.norm(slope), 10))
    track = Unit("TRACK1", "eax_a", "linear", "robot")
    tilted = Unit("TRACK1", "eax_a", "linear", "robot", direction=slope)
    table = Unit("STN1", "eax_b", "rotary", "part", frame([1500, 300, 500], [0.05, 0.1, 0.2]))
    tilt = Unit("TILT", "eax_c", "rotary", "part", frame([1400, -200, 550], [1.5, 0.1, 0.0]))
    turn = Unit("TURN", "eax_d", "rotary", "part", frame([0, 20, 150], [-1.5, 0.0, 0.1]), on="TILT")
    leaning = frame([10, 20, 30], [0.3, 0.2, 0.1])
    return [
        Scenario("standing", effects=effects),
        Scenario("track", [track], frame([10, 20, 30], [0, 0, 0.1]), effects=effects),
        Scenario("tilted_track", [tilted], leaning, effects=effects),
        Scenario("table", [table], part="STN1", effects=effects),
        Scenario("tilt_and_turn", [tilt, turn], part="TURN", effects=effects),
        Scenario("track_and_tilt_and_turn", [tilted, tilt, turn], frame([10, 20, 30], [0.1, 0.2, 0.1]), part="TURN", effects=effects),
        Scenario("stationary_tool", stationary=True, effects=effects),
        Scenario("stationary_tool_and_track", [tilted], frame([10, 20, 30], [0.1, 0.2, 0.1]), stationary=True, effects=effects),
    ]


def correct(deflex, folder):
    rng = np.random.default_rng(5)
    print("| scenario | error rms, mm | largest, predicted less arm, µm | largest left after compensation, µm |\n|---|---|---|---|")
    for scenario in scenarios():
        targets = scenario.targets(rng)
        scenario.write(folder, targets)
        at = str(folder / scenario.name)
        given = [f"{at}.mod", "--cell", f"{at}.toml", "--forces", f"{at}.csv"]
        subprocess.run([deflex, "predict", *given, "--report", f"{at}.report.csv"], check=True, capture_output=True)
        with open(f"{at}.report.csv", newline="") as f:
            predicted = np.array([[float(row[f"error_{axis}_mm"]) for axis in "xyz"] for row in csv.DictReader(f)])
        true = scenario.errors(targets, [t.goal for t in targets])
        subprocess.run([deflex, "compensate", *given, "-o", f"{at}.out.mod"], check=True, capture_output=True)
        written = re.findall(r"MoveL \[\[([^\]]*)\],\[([^\]]*)\]", Path(f"{at}.out.mod").read_text())
        read = lambda text: np.array([float(v) for v in text.split(",")])
        left = scenario.errors(targets, [Frame(quat_to_rot(read(quat)), read(mm) * MM) for mm, quat in written])
        largest = lambda e: 1e3 * np.linalg.norm(e, axis=1).max()
        print(f"| {scenario.name} | {rms(true):.3f} | {largest(predicted - true):.3f} | {largest(left):.3f} |", flush=True)


def identify(deflex, folder):
    rng = np.random.default_rng(7)
    print("| scenario | hidden | found, posterior | held-out error before, mm | after, mm |\n|---|---|---|---|---|")
    for hidden in HIDDEN:
        for scenario in scenarios([]):
            targets = scenario.targets(rng, ROWS)
            scenario.write(folder, targets)
            scenario.effects = scenario.felt([hidden])
            errors = scenario.errors(targets, [t.goal for t in targets])
            places = np.array([t.goal.pos for t in targets]) / MM + errors + NOISE_MM * rng.standard_normal(errors.shape)
            at = str(folder / scenario.name)
            with open(f"{at}.measured.csv", "w", newline="") as f:
                out = csv.writer(f, lineterminator="\n")
                out.writerow(["target", "x_mm", "y_mm", "z_mm", "fx_n", "fy_n", "fz_n", "time_s"])
                out.writerows([k + 1, *np.round(p, 4), *t.force, 20 * k] for k, (t, p) in enumerate(zip(targets, places)))
            run = [deflex, "identify", "--run", f"{at}.mod", f"{at}.measured.csv", "--cell", f"{at}.toml"]
            subprocess.run([*run, "-o", f"{at}.identified.toml", "--json", f"{at}.json"], check=True, capture_output=True)
            answer = json.loads(Path(f"{at}.json").read_text())
            found = ", ".join(f"{e['kind']} {e['posterior']:.2f}" for e in answer["added"]) or "nothing"
            before, after = (answer[when]["rms_mm"] for when in ("before", "after"))
            print(f"| {scenario.name} | {hidden['kind']} | {found} | {before:.3f} | {after:.3f} |", flush=True)


def rms(errors):
    return np.sqrt((errors**2).sum(1).mean())


def main():
    command, deflex, folder = {"correct": correct, "identify": identify}[sys.argv[1]], sys.argv[2], Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    command(deflex, folder)


if __name__ == "__main__":
    main()
