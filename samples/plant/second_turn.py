"""Turns the loop twice on cells of shop.py: `second_turn.py FOLDER [--seconds N]`.

First turn: identify on what was measured, correct the program, play the corrected program on the plant, measure it. Second turn:
identify again, from the extended cell and those rows. Compared is what another program's targets are predicted to: `transfer.mod`
without noise, by the declared cell, by the cell of the first turn, by that of the second. Needs requirements.txt and a built deflex.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import tempfile
import time

import numpy as np

import plant
from program import read_cell, read_program

# A change of the transfer figure below this share and this much (mm) is none: intervals of what is refitted move it so.
SAME = (0.02, 5e-4)


def deflex(binary, *arguments):
    return subprocess.run([binary, *map(str, arguments), "--quiet"], capture_output=True, text=True)


def of_first_run(measured, forces):
    """The rows of a table's first run: another program is cut once."""
    with open(measured, newline="") as f:
        rows = list(csv.DictReader(f))
    with open(forces, "w", newline="") as f:
        out = csv.DictWriter(f, rows[0].keys(), lineterminator="\n")
        out.writeheader()
        out.writerows(row for row in rows if row.get("run") == rows[0].get("run"))
    return forces


def transfer(binary, folder, cell, scratch):
    """Predicted minus played on another program, mm rms; NaN where the cell has no answer."""
    report = scratch / "transfer.csv"
    report.unlink(missing_ok=True)
    deflex(binary, "predict", folder / "transfer.mod", "--cell", cell, "--forces", folder / "transfer_measured.csv", "--report", report)
    if not report.exists():
        return float("nan")
    with open(report, newline="") as f:
        predicted = {int(row["target"]): row for row in csv.DictReader(f)}
    gaps = []
    with open(folder / "transfer_exact.csv", newline="") as f:
        for row in csv.DictReader(f):
            there = predicted[int(row["target"])]
            gaps.append(sum((float(row[f"{k}_mm"]) - float(there[f"{k}_mm"]) - float(there[f"error_{k}_mm"])) ** 2 for k in "xyz"))
    return float(np.sqrt(np.mean(gaps)))


def turn_twice(binary, folder, number, scratch):
    """Names and transfer figures of one cell, or why there are none."""
    truth = json.loads((folder / "truth.json").read_text())
    cells = [folder / "cell.toml", scratch / "first.toml", scratch / "second.toml"]
    names = []
    program, measured = folder / "part.mod", folder / "measured.csv"
    for turn in (1, 2):
        found = scratch / f"{turn}.json"
        done = deflex(binary, "identify", "--run", program, measured, "--cell", cells[turn - 1], "-o", cells[turn], "--json", found)
        if not cells[turn].exists():
            return None, f"turn {turn}: {done.stderr.strip()[:200]}"
        names.append([added["kind"] for added in json.loads(found.read_text())["added"]])
        if turn == 2:
            break
        corrected, forces = scratch / "corrected.mod", of_first_run(measured, scratch / "forces.csv")
        done = deflex(binary, "compensate", program, "--cell", cells[1], "--forces", forces, "-o", corrected)
        if not corrected.exists():
            return None, f"compensate: {done.stderr.strip()[:200]}"
        plan = read_program(corrected)
        force, when = plant.read_forces(forces, len(plan.moves))
        result = plant.run(read_cell(folder / "cell.toml"), plan, truth, force, when)
        program, measured = corrected, scratch / "again.csv"
        plant.write(measured, result, plant.noise(truth, len(result.position), [77, number]))
    return (truth, names, [transfer(binary, folder, cell, scratch) for cell in cells]), None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--deflex", type=pathlib.Path, default=pathlib.Path("target/release/deflex"))
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no further cell after so long")
    a = parser.parse_args()
    counts = {"worse": 0, "same": 0, "better": 0, "no answer": 0}
    until = time.monotonic() + a.seconds
    for number, path in enumerate(sorted(a.folder.glob("**/part.mod"))):
        if time.monotonic() > until:
            break
        with tempfile.TemporaryDirectory() as scratch:
            done, why = turn_twice(a.deflex, path.parent, number, pathlib.Path(scratch))
        if done is None:
            counts["no answer"] += 1
            print(path.parent.relative_to(a.folder), why, flush=True)
            continue
        truth, names, (declared, first, second) = done
        slack = SAME[0] * first + SAME[1]
        verdict = "worse" if second > first + slack else "better" if second < first - slack else "same"
        counts[verdict] += 1
        there = "+".join(effect["kind"] for effect in truth["effect"]) or "none"
        print(f"{path.parent.relative_to(a.folder)} {verdict}: {there}; found {names[0]}, then {names[1]}; "
              f"transfer {declared:.4f} -> {first:.4f} -> {second:.4f} mm", flush=True)
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))


if __name__ == "__main__":
    main()
