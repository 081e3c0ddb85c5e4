#!/usr/bin/env python3
"""Makes the tables of docs/real-robots.md: identifies two public data sets of real robots, and prints Markdown.

  benches/real_robots.py DATA [--deflex PROGRAM]

DATA has ur10_A.csv and ur10_C.csv (series A and C of christianlandgraf/ipa-robot-accuracy), ur5_grid.csv (the UR5 set of
pauljac7700/serial_robots_datasets), and the cells ur10.toml and ur5.toml. Lengths in mm; all errors are rms over held-out rows.
"""
import argparse
import csv
import json
import math
import os
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
STAGES = ["tool_frame", "link_geometry", "gravity", "joint_error_curve"]
DRAWS = 20
HELD_OUT = 0.3


def read(path):
    with open(path, newline="") as f:
        return list(csv.DictReader(f))


def identify(deflex, rows, cell):
    """The answer for rows and the text of a cell, with the run's wall time, processor time (s) and peak memory (GiB)."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        with open(folder / "rows.csv", "w", newline="") as f:
            out = csv.DictWriter(f, rows[0].keys(), lineterminator="\n")
            out.writeheader()
            out.writerows(rows)
        (folder / "cell.toml").write_text(cell)
        start = time.perf_counter()
        job = subprocess.Popen([deflex, "identify", "--poses", folder / "rows.csv", "--cell", folder / "cell.toml", "-o", folder / "found.toml",
                                "--json", folder / "found.json"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(job.pid, 0)
        job.returncode = os.waitstatus_to_exitcode(status)
        if job.returncode:
            sys.exit(f"{job.args} ended with {job.returncode}")
        took = time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 2**20
        return json.loads((folder / "found.json").read_text()), took


def stages(found):
    """Error after each stage; a stage that finds nothing keeps the error before it."""
    errors = [found["before"]["rms_mm"]]
    for stage in STAGES:
        after = [a["held_out_rms_after_mm"] for a in found["added"] if a["kind"] == stage]
        errors.append(after[-1] if after else errors[-1])
    # Effects of the last stage are found in any order.
    return errors[:-1] + [found["after"]["rms_mm"]]


def held_out(rows, chosen):
    return [{**row, "holdout": int(chosen(i))} for i, row in enumerate(rows)]


def drawn(rows, seed):
    out = set(random.Random(seed).sample(range(len(rows)), round(HELD_OUT * len(rows))))
    return held_out(rows, out.__contains__)


def last(rows):
    return held_out(rows, lambda i: i >= (1 - HELD_OUT) * len(rows))


def moved(cell, tcp_mm):
    """The cell with its reflector declared farther along x."""
    shift = lambda m: f"tcp_mm = [{float(m.group(1)) + tcp_mm}"
    return re.sub(r"tcp_mm = \[([-\d.]+)", shift, cell, count=1)


def bent(cell, rng, length_mm, angle_deg):
    """The cell with links declared wrong by up to these sizes."""
    cell = re.sub(r"(a_mm|d_mm) = (-?[\d.]+)", lambda m: f"{m[1]} = {float(m[2]) + rng.uniform(-length_mm, length_mm):.4f}", cell)
    return re.sub(r"(alpha_deg|theta_deg) = (-?[\d.]+)", lambda m: f"{m[1]} = {float(m[2]) + rng.uniform(-angle_deg, angle_deg):.5f}", cell)


def seen_from(rows, away_mm, turn_deg):
    """The rows as a tracker sees them that stands elsewhere."""
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    turned = lambda x, y: {"x_mm": f"{c * x - s * y + away_mm:.5f}", "y_mm": f"{s * x + c * y:.5f}"}
    return [{**row, **turned(float(row["x_mm"]), float(row["y_mm"]))} for row in rows]


def noisy(rows, count, sigma_mm):
    rng = random.Random(count)
    shake = lambda row: {**row, **{axis: f"{float(row[axis]) + rng.gauss(0, sigma_mm):.6f}" for axis in ("x_mm", "y_mm", "z_mm")}}
    return [shake(rows[i % len(rows)]) for i in range(count)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--deflex", default=ROOT / "target/release/deflex")
    a = parser.parse_args()
    run = lambda rows, cell: identify(a.deflex, rows, cell)
    a_rows, c_rows, grid = (read(a.data / f"{name}.csv") for name in ("ur10_A", "ur10_C", "ur5_grid"))
    ur10, ur5 = ((a.data / f"{name}.toml").read_text() for name in ("ur10", "ur5"))

    (series_a, took), (series_c, _) = run(a_rows, ur10), run(c_rows, ur10)
    draws = [run(drawn(grid, seed), ur5)[0] for seed in range(DRAWS)]
    columns = [stages(series_a), stages(run(last(a_rows), ur10)[0]), stages(series_c), stages(run(last(c_rows), ur10)[0]),
               [statistics.mean(column) for column in zip(*map(stages, draws))]]
    print(f"| stage | UR10 A, {len(a_rows):,} rows | A, last 30 % | UR10 C, {len(c_rows):,} rows | C, last 30 % | UR5 grid, {len(grid):,} rows, mean of {DRAWS} draws |")
    print("|---|---|---|---|---|---|")
    for stage, errors in zip(["registered only", *(f"+ `{s}`" for s in STAGES)], zip(*columns)):
        print(f"| {stage} | " + " | ".join(f"{error:.3f}" for error in errors) + " |")
    after = [found["after"]["rms_mm"] for found in draws]
    print(f"\nUR5: {statistics.mean(after):.4f} ({min(after):.4f} to {max(after):.4f}). Drift of the run: "
          + ", ".join(f"{f.get('run_drift_rms_mm', 0):.3f}" for f in (series_a, series_c)) + f", {statistics.mean(f.get('run_drift_rms_mm', 0) for f in draws):.4f}.")
    print(f"Series A: {took[1]:.0f} s of processor time, {took[2]:.2f} GiB.\n")

    print("| rows | processor time | wall time | peak memory |\n|---|---|---|---|")
    for count in (2_000, 20_000, 200_000):
        _, (wall, processor, gib) = run(noisy(grid, count, 0.02), ur5)
        print(f"| {count:,} | {processor:.1f} s | {wall:.1f} s | {gib:.2f} GiB |")

    print("\n| fitted poses | tool and links | with curves |\n|---|---|---|")
    fitted = [row for row in c_rows if row["holdout"] == "0"]
    for count in (50, 200, 800, len(fitted)):
        some = set(map(id, random.Random(count).sample(fitted, count)))
        found, _ = run([row for row in c_rows if row["holdout"] == "1" or id(row) in some], ur10)
        print(f"| {count:,} | {stages(found)[2]:.3f} | {found['after']['rms_mm']:.3f} |")

    print("\n| start | before | after |\n|---|---|---|")
    starts = {
        "reflector declared 80 mm off": (c_rows, moved(ur10, 80.0)),
        "links declared up to 6 mm and 0.7° off": (c_rows, bent(ur10, random.Random(1), 6.0, 0.7)),
        "tracker 20 m away and turned by 140°": (seen_from(c_rows, 20_000.0, 140.0), ur10),
    }
    for name, (rows, cell) in starts.items():
        found, _ = run(rows, cell)
        print(f"| {name} | {found['before']['rms_mm']:.2f} | {found['after']['rms_mm']:.3f} |")


if __name__ == "__main__":
    main()
