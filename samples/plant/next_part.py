"""The measured part corrects the next one: `next_part.py CELLS… [--deflex BINARY] [--points N] [--first corrected|programmed]`.

CELLS are folders of truer/cells.py. The plant cuts a first part, from the program as it is or as the declared cell corrects it. Some points of its
surface are probed (normal_mm, read to five micrometres), `deflex identify` extends the cell with them, `deflex compensate` corrects the program by
it, and the plant cuts the next part. Prints, for each cell, the deviation of both parts along the surface normal at all cut targets, mm rms.
"""

import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "truer"))

import numpy as np

import chain
import paths
from arm import Arm, Numbers
from robots import ROBOTS

READING_MM = 0.005
NUMBER = r"([-+0-9.eE]+)"
MOTION = re.compile(rf"MoveL \[\[{NUMBER},{NUMBER},{NUMBER}\],\[{NUMBER},{NUMBER},{NUMBER},{NUMBER}\].*?,v{NUMBER},")
# Forces of the plant bend its soft arms by millimetres from one target to the next.
LIMITS = "\n[limits]\nmax_step_mm = 20.0\nmax_correction_mm = 20.0\n"


def rms(v):
    return float(np.sqrt(np.mean(v**2)))


class Shop:
    """A cell of the plant: its arm, its table, and the program with what acts on it."""

    def __init__(self, folder):
        self.folder = folder
        truth = json.loads((folder / "truth.json").read_text())
        self.robot = next(r for r in ROBOTS if r.label == truth["robot"])
        draws = {tuple(key.split(" ", 1)): np.array(value) for key, value in truth["z"].items()}
        self.table = [np.array(v) for v in truth["table"]]
        self.arm = Arm(self.robot, Numbers(draws, truth["size"]), *self.table)
        self.arm.taught = tuple(np.array(v) for v in truth["taught"])
        rows = np.loadtxt(folder / "exact.csv", delimiter=",", skiprows=1)
        self.times = rows[:, 7]
        self.cut = np.any(rows[:, 4:7] != 0, axis=1)
        # The table has what the sensor reads; the arm feels what acts.
        sensor = self.arm.n["sensor"]
        reading = np.eye(3) * (1 + sensor["scale"]) + sensor["cross"] * (1 - np.eye(3))
        self.force = np.where(self.cut[:, None], (rows[:, 4:7] - sensor["zero_n"]) @ np.linalg.inv(reading), 0.0)
        self.sensed = np.loadtxt(folder / "measured.csv", delimiter=",", skiprows=1)[:, 4:7]
        self.points, quats, _ = motions(folder / "part.mod")
        self.normal = -chain.rotation(quats)[:, :, 2]

    def deviation(self, program):
        """How far the surface that a program cuts is off, out of the material, at each target, mm."""
        points, quats, speeds = motions(program)
        path = paths.Path(points, chain.rotation(quats), speeds, self.force, *self.table)
        motor = chain.motors(self.robot, *paths.flange_of(self.robot, path))
        there = self.arm.run(motor, points, self.force, self.times)
        return np.sum((there - self.points) * self.normal, axis=1)


def motions(program):
    found = np.array([[float(v) for v in m.groups()] for m in MOTION.finditer(program.read_text())])
    return found[:, :3], found[:, 3:7], found[:, 7]


def next_part(deflex, folder, count, first):
    """Deviations of the first and the next part at cut targets, mm."""
    shop = Shop(folder)
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        cell, extended, probed = scratch / "cell.toml", scratch / "extended.toml", scratch / "probed.csv"
        cell.write_text((folder / "cell.toml").read_text() + LIMITS)

        def run(*words):
            subprocess.run([deflex, *words, "--quiet"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

        def corrected(by, name):
            run("compensate", folder / "part.mod", "--cell", by, "--forces", folder / "measured.csv", "-o", scratch / name, "--report", scratch / "report.csv")
            return scratch / name

        ran = corrected(cell, "first.mod") if first == "corrected" else folder / "part.mod"
        before = shop.deviation(ran)
        rng = np.random.default_rng([7, *folder.name.encode()])
        chosen = np.sort(rng.choice(np.flatnonzero(shop.cut), min(count, int(shop.cut.sum())), replace=False))
        with open(probed, "w") as f:
            f.write("target,normal_mm,fx_n,fy_n,fz_n,sigma_mm\n")
            for k in chosen:
                fx, fy, fz = shop.sensed[k]
                f.write(f"{k + 1},{before[k] + READING_MM * rng.standard_normal():.4f},{fx:.2f},{fy:.2f},{fz:.2f},{READING_MM}\n")
        original = ["--against", folder / "part.mod"] if first == "corrected" else []
        run("identify", "--run", ran, probed, *original, "--cell", cell, "-o", extended)
        return before[shop.cut], shop.deviation(corrected(extended, "next.mod"))[shop.cut]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cells", type=pathlib.Path, nargs="+")
    parser.add_argument("--deflex", default="target/release/deflex")
    parser.add_argument("--points", type=int, default=50)
    parser.add_argument("--first", choices=["corrected", "programmed"], default="corrected")
    a = parser.parse_args()
    shares = []
    for folder in a.cells:
        before, after = next_part(a.deflex, folder, a.points, a.first)
        shares.append(rms(after) / rms(before))
        print(f"{folder}: {rms(before):.4f} -> {rms(after):.4f} mm, {shares[-1]:.2f}", flush=True)
    shares = np.array(shares)
    print(f"{np.sum(shares <= 0.2)} of {len(shares)} at most 0.2, {np.sum(shares > 1)} worse, geometric mean {np.exp(np.mean(np.log(shares))):.3f}")


if __name__ == "__main__":
    main()
