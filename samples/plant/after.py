"""Settles what cells of shop.py leave undecided: `after.py FOLDER -o OUT [--rows N]`.

Where `deflex identify` cannot distinguish effects, `deflex plan --after` chooses further rows; they are played on the plant, measured with
fresh noise on a clamping of their own, and are in OUT together with those of the first run, as cells for `blind_table`. Needs requirements.txt
and a built deflex.
"""

import argparse
import json
import pathlib
import shutil
import subprocess

import numpy as np

import plant
from plans import planned
from program import read_cell, read_program, rotvec_to_rot

# What a part that is clamped anew is turned (rad) and shifted (mm) by, as in shop.py.
CLAMPING = (2.5e-4, 0.2)


def undecided(binary, folder, scratch):
    """Runs identify on a cell's rows; the file of its JSON if a name cannot be distinguished from others, else None."""
    found = scratch / "first.json"
    subprocess.run([binary, "identify", "--run", folder / "part.mod", folder / "measured.csv", "--cell", folder / "cell.toml",
                    "-o", scratch / "first.toml", "--json", found, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    added = json.loads(found.read_text())["added"]
    return found if any(effect["not_told_apart_from"] for effect in added) else None


def settle(binary, folder, out, rows, number):
    """Writes the cell with a second run to `out`; False where the first run left nothing undecided."""
    out.mkdir(parents=True, exist_ok=True)
    for name in ("cell.toml", "truth.json", "transfer.mod", "transfer_measured.csv", "transfer_exact.csv"):
        shutil.copyfile(folder / name, out / name)
    found = undecided(binary, folder, out)
    if found is None:
        shutil.rmtree(out)
        return False
    plan, text = planned(out, binary, rows, found)
    (out / "part.mod").unlink()
    (out / "part_2.mod").write_text(text)
    for kind in ("mod", "csv"):
        stem = {"mod": "part", "csv": "measured"}[kind]
        shutil.copyfile(folder / f"{stem}.{kind}", out / f"{stem}_1.{kind}")
    truth = json.loads((folder / "truth.json").read_text())
    result = plant.run(read_cell(folder / "cell.toml"), read_program(out / "part_2.mod"), truth, np.round(plan.force, 2), plan.times())
    rng = np.random.default_rng([91, number])
    turn, shift = rotvec_to_rot(rng.normal(0, CLAMPING[0], 3)), rng.normal(0, CLAMPING[1], 3)
    result.position = result.position @ turn.T + shift
    plant.write(out / "measured_2.csv", result, plant.noise(truth, len(result.position), [92, number]))
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    parser.add_argument("--rows", type=int, default=48, help="rows of the second run")
    parser.add_argument("--deflex", type=pathlib.Path, default=pathlib.Path("target/release/deflex"))
    a = parser.parse_args()
    paths = sorted(a.folder.glob("**/part.mod"))
    settled = [p.parent.name for n, p in enumerate(paths) if settle(a.deflex, p.parent, a.output / "after" / p.parent.name, a.rows, n)]
    print(f"{len(settled)} of {len(paths)} cells are measured again: {', '.join(settled)}")


if __name__ == "__main__":
    main()
