"""Compares noise-free runs of the plant with measured cells that were made elsewhere: `check_practice.py PRACTICE_DIR`."""

import csv
import json
import pathlib
import sys
import time

import numpy as np

from plant import read_forces, run
from program import read_cell, read_program

for folder in sorted(p for p in pathlib.Path(sys.argv[1]).iterdir() if p.is_dir()):
    truth = json.loads((folder / "truth.json").read_text())
    for name in ("", "transfer_"):
        program = read_program(folder / f"{name.rstrip('_') or 'part'}.mod")
        measured = folder / f"{name}measured.csv"
        start = time.perf_counter()
        result = run(read_cell(folder / "cell.toml"), program, truth, *read_forces(measured, len(program.moves)))
        took = time.perf_counter() - start
        with open(measured) as f:
            rows = {int(r["target"]): [float(r[c]) for c in ("x_mm", "y_mm", "z_mm")] for r in csv.DictReader(f)}
        off = np.array([result.position[k - 1] - rows[k] for k in sorted(rows)]) * 1000
        print(f"{folder.name:18} {name or 'part_':9} sigma {truth['sigma_mm'] * 1000:.0f} um wander {truth['wander_mm'] * 1000:.0f} um | "
              f"mean {np.round(off.mean(0), 2)} um, sd {np.round(off.std(0), 2)} um, {len(off)} rows, {took:.2f} s")
