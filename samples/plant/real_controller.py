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
CURVES = {"movel_smooth": "two lines, tool turning", "movec_smooth": "two arcs", "movec+movel_smooth": "arc and line", "blade": "edge of a blade, three arcs"}
NEAR_MM = 0.5  # a log begins and ends nearer than this to the ends of the programmed path


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


def log_of(study, logs, case):
    return log_rows(study / f"{logs}/{case[0]}/curve_exe_{case[1]}_{case[2]}.csv")


def driven(cell, rows, ends):
    """The TCP (mm) at the samples of a log between the ends of a path, without lead-in and lead-out."""
    places = np.array([tcp(cell, row[2:8]).pos / MM for row in rows])
    at_start, at_end = (np.flatnonzero(np.linalg.norm(places - end, axis=1) < NEAR_MM) for end in ends)
    first = at_start[-1]
    return places[first : at_end[at_end > first][0] + 1]


def write_case(study, cell, logs, case, folder):
    """Writes the program and the log of a case; returns their common stem and the corner."""
    stem = folder / "_".join(case)
    text, corner = program(study, cell, *case)
    pathlib.Path(f"{stem}.mod").write_text(text)
    rows = log_of(study, logs, case)
    np.savetxt(f"{stem}.csv", np.column_stack([rows[:, 0], rows[:, 2:8]]), delimiter=",", fmt="%.6f",
               header="time_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg", comments="")
    return stem, corner


def fit(deflex, stems, cell_file, folder):
    """The cell with the law of these logs, and what `identify` says of it."""
    law = folder / "law.toml"
    given = [word for stem in stems for word in ("--log", f"{stem}.mod", f"{stem}.csv")]
    subprocess.run([deflex, "identify", *given, "--cell", cell_file, "-o", law, "--json", folder / "law.json"], check=True, stdout=subprocess.DEVNULL)
    return law, json.loads((folder / "law.json").read_text())["path"]


def predicted(deflex, stem, cell_file, folder):
    """The predicted path of the TCP, mm."""
    subprocess.run([deflex, "predict", f"{stem}.mod", "--cell", cell_file, "--path", folder / "path.csv", "--report", folder / "r.csv", "-q"], check=True)
    with open(folder / "path.csv", newline="") as f:
        return np.array([[float(row[axis]) for axis in ("x_mm", "y_mm", "z_mm")] for row in csv.DictReader(f)])


def curves(study, deflex, folder):
    """Distance (rms, mm) of each curve's logs from the programmed and from the predicted path."""
    cell_file = folder / "cell.toml"
    cell_file.write_text(CELL)
    cell = read_cell(cell_file)
    for name, words in CURVES.items():
        fitted = [write_case(study, cell, "execution", (name, speed, zone), folder)[0] for speed in ("v50", "v300") for zone in ZONES[1:]]
        law, _ = fit(deflex, fitted, cell_file, folder)
        figures = []
        for speed in ("v500", "v1000"):
            case = name, speed, "z10"
            stem, _ = write_case(study, cell, "execution", case, folder)
            paths = [predicted(deflex, stem, by, folder) for by in (cell_file, law)]
            places = driven(cell, log_of(study, "execution", case), paths[0][[0, -1]])
            for path in paths:
                figures.append(np.sqrt(np.mean([missed(path, place) ** 2 for place in places])))
        print(f"| {words} | " + " | ".join(f"{figure:.3f} mm" for figure in figures) + " |")


def judge(study, logs, deflex, folder):
    cell_file = folder / "cell.toml"
    cell_file.write_text(CELL)
    cell = read_cell(cell_file)
    cases = [(name, speed, zone) for name in CORNERS for speed in JUDGED for zone in ZONES]
    cases += [(CORNERS[0], speed, zone) for speed in JUDGED for zone in WIDE_ZONES if (study / f"{logs}/{CORNERS[0]}/curve_exe_{speed}_{zone}.csv").exists()]
    written = {case: write_case(study, cell, logs, case, folder) for case in cases}
    fitted = [stem for case, (stem, _) in written.items() if case[0] in FITTED[0] and case[1] in FITTED[1] and case[2] in ZONES]
    law, found = fit(deflex, fitted, cell_file, folder)
    right, worst = 0, []
    for case, (stem, corner) in written.items():
        was = missed(np.array([tcp(cell, row[2:8]).pos / MM for row in log_of(study, logs, case)]), corner)
        said = missed(predicted(deflex, stem, law, folder), corner)
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
    print("| program | 500 mm/s, from the programmed path | from the predicted path | 1000 mm/s, from the programmed path | from the predicted path |")
    with tempfile.TemporaryDirectory() as folder:
        curves(a.study, a.deflex, pathlib.Path(folder))


if __name__ == "__main__":
    main()
