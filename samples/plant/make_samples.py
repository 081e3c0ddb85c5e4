"""Regenerates samples/closed-loop/: `python3 samples/plant/make_samples.py`. The same call gives the same bytes."""

import json
import pathlib

import numpy as np

import plant
from plans import ROBOTS, designed, draw, transfer
from program import read_cell, read_program

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "closed-loop"
SEED = 6660
CELL = """\
# A milling cell as its integrator declares it: nominal geometry, gearbox stiffness, forces from a dynamometer.
# Tool and work object are declared in the programs. What the cell lacks is for `deflex identify` to find.

[robot]
model = "irb6660-205-1.9"

[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]   # Tang et al. Table 2

[cut]
force = "table"          # the force columns of measured.csv; a zero row is air
"""
TRUTH = {
    "effect": [{"kind": "backlash", "half_gap_rad": [0.0, 6e-5, 0.0, 0.0, 1.6e-4, 0.0]}],
    "sigma_mm": 0.012,
    "wander_mm": 0.006,
}


def main():
    FOLDER.mkdir(exist_ok=True)
    robot = ROBOTS[1]
    (FOLDER / "cell.toml").write_text(CELL)
    (FOLDER / "truth.json").write_text(json.dumps(TRUTH, indent=1) + "\n")
    cell = read_cell(FOLDER / "cell.toml")
    for number, (stem, module, make, table) in enumerate((("part", "Part", designed, "measured.csv"), ("transfer", "Transfer", transfer, "transfer_measured.csv"))):
        plan, text = draw(robot, make, [SEED, number], module)
        (FOLDER / f"{stem}.mod").write_text(text)
        program = read_program(FOLDER / f"{stem}.mod")
        result = plant.run(cell, program, TRUTH, np.round(plan.force, 2), plan.times())
        declared = plant.run(cell, program, {"effect": []}, np.round(plan.force, 2), plan.times())
        plant.write(FOLDER / table, result, plant.noise(TRUTH, len(result.position), [SEED, 10 + number]))
        rms = lambda e: np.sqrt(np.mean(np.sum(e**2, axis=1)))
        print(f"{stem}: {len(program.moves)} targets, error {rms(result.position - result.programmed):.3f} mm rms, "
              f"undeclared {rms(result.position - declared.position):.3f} mm rms")


if __name__ == "__main__":
    main()
