"""Fits the law of the driven path to logs of a real robot and of its virtual controller, and judges it on all of them.

    real_controller.py STUDY

STUDY is a copy of github.com/hehonglu123/ABB_Primitive_Study: an IRB 6640 that passes a corner of 30°, by MoveL and by MoveC, with and
without a turn of the tool. `execution` has logs of the virtual controller, `realrobot` those of the robot.
"""

import argparse
import csv
import json
import pathlib
import re
import subprocess
import tempfile

import numpy as np

from kinematics import base_from_flange
from program import MM, frame_mm, read_cell, rot_to_quat

CELL = """[robot]
model = "irb6640-180-2.55"
start_deg = [0, 0, 0, 0, 60, 0]

[robot.kinematics]
parallelogram = false
links = [
  { alpha_deg = 0.0, a_mm = 0.0, d_mm = 780.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 320.0, d_mm = 0.0, theta_deg = -90.0 },
  { alpha_deg = 0.0, a_mm = 1075.0, d_mm = 0.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 200.0, d_mm = 1142.5, theta_deg = 0.0 },
  { alpha_deg = 90.0, a_mm = 0.0, d_mm = 0.0, theta_deg = 0.0 },
  { alpha_deg = -90.0, a_mm = 0.0, d_mm = 200.0, theta_deg = 180.0 },
]
axis_min_deg = [-170, -65, -180, -300, -120, -360]
axis_max_deg = [170, 85, 70, 300, 120, 360]

[controller]
compensates = []

[cut]
force = "none"
"""
# With the fake link of 50 mm along the tool that the study puts between flange and tool.
TOOL_MM, TOOL_QUAT = [75.0, 0.0, 493.30127019], [np.cos(np.radians(15)), 0.0, np.sin(np.radians(15)), 0.0]
CORNERS = ["movel_30_car", "movec_30_car", "movel_30_ori", "movec_30_ori"]
FITTED = CORNERS[:2], ["v50", "v300"]
JUDGED = ["v50", "v300", "v500"]
ZONES = ["fine", "z1", "z10", "z20"]
WIDE_ZONES = ["z50", "z100", "z200", "z500"]
RIGHT_MM, RIGHT_SHARE = 0.05, 0.1


def tcp(cell, deg):
    return base_from_flange(cell, np.radians(deg)) @ frame_mm(TOOL_MM, TOOL_QUAT)


def points(text):
    """The numbers of each array in a cell of `command.csv`."""
    return [[float(x) for x in found.split(",")] for found in re.findall(r"array\(\[([^\]]*)\]", text)]


def program(study, cell, name, speed, zone):
    """The RAPID program that was run, and its corner, mm."""
    posture = np.degrees(np.loadtxt(study / f"data/{name}/Curve_js.csv", delimiter=","))
    with open(study / f"data/{name}/command.csv", newline="") as f:
        rows = list(csv.DictReader(f))
    at = [min(max(int(row["breakpoints"]) - 1, 0), len(posture) - 1) for row in rows]
    numbers = lambda values: ",".join(f"{v:.8g}" for v in values)
    target = lambda mm, k: f"[[{numbers(mm)}],[{numbers(rot_to_quat(tcp(cell, posture[k]).rot))}],[0,0,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    moves = []
    for i, row in enumerate(rows):
        goal = points(row["points"])
        if row["primitives"] == "movej_fit":
            moves.append(f"MoveAbsJ [[{numbers(np.degrees(goal[0]))}],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tA;")
        elif row["primitives"] == "movel_fit":
            moves.append(f"MoveL {target(goal[0], at[i])},{speed},{zone},tA;")
        else:
            moves.append(f"MoveC {target(goal[0], at[i - 1])},{target(goal[1], at[i])},{speed},{zone},tA;")
    tool = f"PERS tooldata tA:=[TRUE,[[{numbers(TOOL_MM)}],[{numbers(TOOL_QUAT)}]],[1,[0,0,0.001],[1,0,0,0],0,0,0]];"
    text = "MODULE M\n  " + tool + "\n  PROC main()\n    ConfL\\Off;\n    " + "\n    ".join(moves) + "\n  ENDPROC\nENDMODULE\n"
    return text, np.array(points(rows[1]["points"])[-1])


def log_rows(path):
    rows = np.genfromtxt(path, delimiter=",", skip_header=1)
    return rows[~np.isnan(rows).any(axis=1)]


def missed(path, corner):
    """Least distance of a polyline from a point."""
    a, b = path[:-1], path[1:]
    along = b - a
    share = np.clip(np.einsum("ij,ij->i", corner - a, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-12), 0, 1)
    return float(np.linalg.norm(a + share[:, None] * along - corner, axis=1).min())


def judge(study, logs, deflex, folder):
    cell_file = folder / "cell.toml"
    cell_file.write_text(CELL)
    cell = read_cell(cell_file)
    cases = [(name, speed, zone) for name in CORNERS for speed in JUDGED for zone in ZONES]
    cases += [(CORNERS[0], speed, zone) for speed in JUDGED for zone in WIDE_ZONES if (study / f"{logs}/{CORNERS[0]}/curve_exe_{speed}_{zone}.csv").exists()]
    given, corners = [], {}
    for case in cases:
        stem = folder / "_".join(case)
        text, corners[case] = program(study, cell, *case)
        stem.with_suffix(".mod").write_text(text)
        rows = log_rows(study / f"{logs}/{case[0]}/curve_exe_{case[1]}_{case[2]}.csv")
        np.savetxt(stem.with_suffix(".csv"), np.column_stack([rows[:, 0], rows[:, 2:8]]), delimiter=",", fmt="%.6f",
                   header="time_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg", comments="")
        if case[0] in FITTED[0] and case[1] in FITTED[1] and case[2] in ZONES:
            given += ["--log", stem.with_suffix(".mod"), stem.with_suffix(".csv")]
    law = folder / "law.toml"
    subprocess.run([deflex, "identify", *given, "--cell", cell_file, "-o", law, "--json", folder / "law.json"], check=True, stdout=subprocess.DEVNULL)
    found = json.loads((folder / "law.json").read_text())["path"]
    right, worst = 0, []
    for case in cases:
        stem = folder / "_".join(case)
        subprocess.run([deflex, "predict", stem.with_suffix(".mod"), "--cell", law, "--path", folder / "path.csv", "--report", folder / "r.csv", "-q"], check=True)
        with open(folder / "path.csv", newline="") as f:
            path = np.array([[float(row[axis]) for axis in ("x_mm", "y_mm", "z_mm")] for row in csv.DictReader(f)])
        measured = np.array([tcp(cell, row[2:8]).pos / MM for row in log_rows(study / f"{logs}/{case[0]}/curve_exe_{case[1]}_{case[2]}.csv")])
        was, said = missed(measured, corners[case]), missed(path, corners[case])
        is_right = abs(said - was) <= max(RIGHT_MM, RIGHT_SHARE * was)
        right += is_right
        if not is_right:
            worst.append(f"{' '.join(case)}: {was:.2f} mm, predicted {said:.2f} mm")
    return found, right, len(cases), worst


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=pathlib.Path)
    parser.add_argument("--deflex", default="target/release/deflex")
    a = parser.parse_args()
    for logs in ("execution", "realrobot"):
        with tempfile.TemporaryDirectory() as folder:
            found, right, count, worst = judge(a.study, logs, a.deflex, pathlib.Path(folder))
        print(f"{logs}: corner right in {right} of {count}\n{json.dumps(found)}")
        print("".join(f"  {line}\n" for line in worst))


if __name__ == "__main__":
    main()
