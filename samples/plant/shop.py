"""Makes the shop table's cells: `shop.py [-o FOLDER] [--seeds N] [--first N] [--jobs N] [--kinds a,b]`.

The blind table of generate.py is data as a laboratory takes them; this is data as shops have them: several clampings, drift, slips,
outliers, faulty columns, few rows, single axes, rows that `deflex plan` chose. The same robots, plans and effects. Each case is a folder with cell.toml, one or several
part*.mod with measured*.csv of the same ending, transfer.mod, transfer_measured.csv, transfer_exact.csv (without noise) and truth.json;
index.csv lists them. The same call gives the same bytes.
"""

import argparse
import csv
import json
import multiprocessing
import os
import pathlib
import zlib

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core a process; the matrices are tiny

import numpy as np

import plant
from generate import (UNLISTED, backlash, base_compliance, bearing_compliance, cable_pull, force_scale, gear_harmonic, gravity, hysteresis,
                      joint_coupling, joint_stiffness, link_geometry, sized, stiffness_curve, thermal_growth, tool_compliance, tool_frame, tool_wear,
                      tracking_lag, work_object_frame, workpiece_compliance, zero_offset)
from plans import ROBOTS, designed, draw, plan_toml, planned, raster, transfer, zigzag
from program import read_cell, read_program, rotvec_to_rot

PLANS = {
    "designed": designed,
    "plain": lambda robot, rng: raster(robot, rng, 16, 18),
    "short": lambda robot, rng: designed(robot, rng, passes=16, per_pass=8),
    "few": lambda robot, rng: designed(robot, rng, passes=6, per_pass=4),
    "zigzag": zigzag,
}
# What is there in the cases that want one listed effect: a spread of families.
ONE = [gravity, backlash, joint_stiffness, zero_offset, base_compliance, gear_harmonic, tool_compliance, workpiece_compliance, tool_frame,
       stiffness_curve, hysteresis, tool_wear]
# All that 24 rows of a plan could show. Seventeen: with three robots 51 seeds have each effect on each robot.
FEW_ROWS = [gravity, backlash, joint_stiffness, zero_offset, base_compliance, tool_compliance, workpiece_compliance, tool_frame,
            work_object_frame, stiffness_curve, hysteresis, tool_wear, link_geometry, bearing_compliance, thermal_growth, force_scale,
            tracking_lag]
THREES = [(gravity, backlash, tool_frame), (joint_stiffness, gear_harmonic, thermal_growth), (base_compliance, backlash, zero_offset),
          (workpiece_compliance, gear_harmonic, gravity), (hysteresis, tool_frame, tool_wear)]
TWOS = [(joint_stiffness, stiffness_curve), (gravity, base_compliance), (backlash, hysteresis), (tool_compliance, gear_harmonic), (zero_offset, tool_frame)]


def turned(force, rng):
    axis = int(rng.integers(0, 3))
    signs = np.ones(3)
    signs[axis] = -1
    return force * signs, f"f{'xyz'[axis]}_n has its sign turned"


def permuted(force, rng):
    order = [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0]][rng.integers(0, 4)]
    return force[:, order], f"force columns in the order {order}"


def crosstalk(force, rng):
    mix = np.eye(3) + rng.uniform(0.12, 0.3, (3, 3)) * rng.choice([-1, 1], (3, 3)) * (1 - np.eye(3))
    return force @ mix.T, "crosstalk of the force sensor"


FORCE_FAULTS = {"force_turned": turned, "force_permuted": permuted, "force_crosstalk": crosstalk}

# name: what the case has. `plan`, `effects` (a list to choose from by seed), `runs` clampings, and what befalls the table.
CASES = {
    "none": dict(plan="designed", effects=[()]),
    "none_drift": dict(plan="plain", effects=[()], drift=True),
    "none_jump": dict(plan="designed", effects=[()], jump=True),
    "clampings": dict(plan="short", effects=ONE, runs=3),
    "clampings_plain": dict(plan="plain", effects=ONE, runs=2, column=True),
    "clampings_none": dict(plan="short", effects=[()], runs=3),
    "offset_only": dict(plan="plain", effects=[(work_object_frame,)], size=(0.2, 0.5)),
    "offset_only_designed": dict(plan="designed", effects=[(work_object_frame,)], size=(0.2, 0.5)),
    "force_turned": dict(plan="designed", effects=[(), *ONE], force="force_turned"),
    "force_turned_plain": dict(plan="plain", effects=[(), *ONE], force="force_turned"),
    "force_permuted": dict(plan="designed", effects=[(), *ONE], force="force_permuted"),
    "force_crosstalk": dict(plan="designed", effects=[(), *ONE], force="force_crosstalk"),
    "drift": dict(plan="designed", effects=ONE, drift=True),
    "drift_plain": dict(plan="plain", effects=ONE, drift=True),
    "jump": dict(plan="designed", effects=ONE, jump=True),
    "jump_plain": dict(plan="plain", effects=ONE, jump=True),
    "outliers": dict(plan="designed", effects=ONE, outliers=(0.05, 0.15)),
    "outliers_plain": dict(plan="plain", effects=ONE, outliers=(0.05, 0.15)),
    "tails": dict(plan="designed", effects=ONE, tails=True),
    "few": dict(plan="few", effects=ONE),
    "normal": dict(plan="designed", effects=ONE, normal=True),
    "unlisted": dict(plan="designed", effects=[(u,) for u in UNLISTED]),
    "unlisted_plain": dict(plan="plain", effects=[(u,) for u in UNLISTED]),
    "unlisted_beside": dict(plan="designed", effects=[(u, e) for e in (backlash, gravity) for u in UNLISTED]),
    "pair": dict(plan="designed", effects=TWOS),
    "triple": dict(plan="designed", effects=THREES),
    "thermal_plain": dict(plan="plain", effects=[(thermal_growth,)], tie=True),
    "coarse": dict(plan="designed", effects=ONE, step=(0.01, 0.02, 0.05)),
    "sigma": dict(plan="designed", effects=[(), *ONE], sigma=True),
    "shuffled": dict(plan="designed", effects=ONE, shuffled=True),
    "partial": dict(plan="designed", effects=ONE, partial=True),
    "coupling": dict(plan="designed", effects=[(joint_coupling,)]),
    # Where a hose is fastened stands in the cell; what it pulls with is to be found.
    "hose": dict(plan="designed", effects=[(cable_pull,)], declared=lambda e: {**e, "stiffness_n_per_m": 0.0, "rest_mm": round(0.9 * e["rest_mm"])}),
    "planned": dict(plan="planned", effects=FEW_ROWS),
    # The same effects and noise on twice and four times the rows.
    "planned48": dict(plan="planned", rows=48, effects=FEW_ROWS, draws_of="planned"),
    "planned96": dict(plan="planned", rows=96, effects=FEW_ROWS, draws_of="planned"),
    # The same effects and noise on rows that were not planned.
    "unplanned": dict(plan="zigzag", effects=FEW_ROWS, draws_of="planned"),
}


def as_tuple(effects):
    return effects if isinstance(effects, tuple) else (effects,)


def case(job):
    root, name, index, deflex = job
    spec = CASES[name]
    seed = [zlib.crc32(f"shop {spec.get('draws_of', name)}".encode()), index]
    rng = np.random.default_rng(seed)
    robot = ROBOTS[index % len(ROBOTS)]
    folder = root / name / f"{index:03}"
    folder.mkdir(parents=True, exist_ok=True)
    by_deflex = spec["plan"] == "planned"
    (folder / "cell.toml").write_text(robot.cell_toml() + (plan_toml(robot, np.random.default_rng([*seed, 3])) if by_deflex else ""))
    cell = read_cell(folder / "cell.toml")
    runs = spec.get("runs", 1)
    # Clampings of one program (a column `run`) or each with its own program.
    column = spec.get("column", False)
    stems = ["part"] if runs == 1 or column else [f"part_{r + 1}" for r in range(runs)]
    own = lambda n: planned(folder, deflex, spec.get("rows", 24)) if by_deflex else draw(robot, PLANS[spec["plan"]], [*seed, 1, n])
    plans = {stem: own(n) for n, stem in enumerate(stems)}
    plans["transfer"] = draw(robot, transfer, [*seed, 2])
    programs = {}
    for stem, (_, text) in plans.items():
        (folder / f"{stem}.mod").write_text(text)
        programs[stem] = read_program(folder / f"{stem}.mod")

    def run(effects, stem=stems[0]):
        plan = plans[stem][0]
        return plant.run(cell, programs[stem], {"effect": effects}, np.round(plan.force, 2), plan.times())

    clean = run([])
    span = clean.time[-1]
    makers = as_tuple(spec["effects"][index % len(spec["effects"])])
    low, high = spec.get("size", (0.035, 0.15))
    effects, sizes = [], []
    for number, make in enumerate(makers):
        wanted = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        effect, size = sized(make, [*seed, 10 + number], robot, span, run, clean, wanted)
        effects.append(effect)
        sizes.append(size)
    sigma, wander = round(rng.uniform(0.010, 0.018), 4), round(rng.uniform(0.004, 0.010), 4)
    if rng.random() < 0.4:
        wander = 0.0
    faults, rows = [], {}
    if "declared" in spec:
        known = spec["declared"](effects[0])
        with open(folder / "cell.toml", "a") as f:
            f.write("\n[[effect]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in known.items()))
    number = 0
    for clamping in range(runs):
        stem = stems[min(clamping, len(stems) - 1)]
        result = run(effects, stem)
        count = len(result.position)
        noise_seed = [*seed, 20 + clamping]
        error = plant.noise({"sigma_mm": sigma, "wander_mm": wander}, count, noise_seed)
        position = result.position.copy()
        if runs > 1:
            turn, shift = rotvec_to_rot(rng.normal(0, 2.5e-4, 3)), rng.normal(0, 0.2, 3)
            position = position @ turn.T + shift
        if spec.get("drift"):
            along = result.time / result.time[-1]
            shape = along if rng.random() < 0.5 else (1 - np.exp(-3 * along)) / (1 - np.exp(-3))
            position += np.outer(shape, rng.normal(0, 1, 3) * rng.uniform(0.05, 0.12))
            faults.append("instrument_drift")
        if spec.get("jump"):
            at = int(count * rng.uniform(0.2, 0.8))
            shift = rng.normal(0, 1, 3)
            position[at:] += shift / np.linalg.norm(shift) * rng.uniform(0.06, 0.25)
            faults.append("fixture_slip")
        if spec.get("tails"):
            error = sigma * np.sqrt(1 / 3) * np.random.default_rng([*noise_seed, 1]).standard_t(3, (count, 3))
        if spec.get("outliers"):
            bad = rng.choice(count, int(count * rng.uniform(*spec["outliers"])), replace=False)
            away = rng.normal(0, 1, (len(bad), 3))
            error[bad] += away / np.linalg.norm(away, axis=1)[:, None] * np.exp(rng.uniform(np.log(0.1), np.log(3.0), (len(bad), 1)))
        step = spec.get("step", [0])[index % len(spec.get("step", [0]))]
        position = position + error
        if step:
            position = np.round(position / step) * step
        force = np.array(result.force)
        if "force" in spec:
            force, what = FORCE_FAULTS[spec["force"]](force, rng)
            faults.append(what)
        rows.setdefault(stem, [])
        order = rng.permutation(count) if spec.get("shuffled") else range(count)
        for k in order:
            where = [f"{result.normal[k] @ (position[k] - result.programmed[k]):.4f}"] if spec.get("normal") else [f"{v:.4f}" for v in position[k]]
            if spec.get("partial"):
                # One axis, two or all three: a gauge here, a touch there.
                kept = rng.permutation(3)[: rng.integers(1, 4)]
                where = [text if axis in kept else "" for axis, text in enumerate(where)]
            row = [k + 1, *where, *(f"{v:.2f}" for v in force[k]), f"{result.time[k]:.1f}"]
            rows[stem].append(row + ([clamping + 1] if column else []) + ([sigma] if spec.get("sigma") else []))
            number += 1
    head = ["target", *(["normal_mm"] if spec.get("normal") else ["x_mm", "y_mm", "z_mm"]), "fx_n", "fy_n", "fz_n", "time_s"]
    head += (["run"] if column else []) + (["sigma_mm"] if spec.get("sigma") else [])
    for stem, lines in rows.items():
        with open(folder / f"measured{stem[4:]}.csv", "w", newline="") as f:
            out = csv.writer(f, lineterminator="\n")
            out.writerow(head)
            out.writerows(lines)
    result = run(effects, "transfer")
    noise = plant.noise({"sigma_mm": sigma, "wander_mm": wander}, len(result.position), [*seed, 30])
    plant.write(folder / "transfer_measured.csv", result, noise)
    plant.write(folder / "transfer_exact.csv", result, 0 * noise)
    truth = {"effect": effects, "sigma_mm": sigma, "wander_mm": wander, "effect_rms_mm": [round(s, 5) for s in sizes], "faults": sorted(set(faults)),
             "tie": bool(spec.get("tie"))}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return [f"{name}/{index:03}", name, index, robot.label, "+".join(e["kind"] for e in effects) or "none", "; ".join(truth["faults"]), number, sigma, wander]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("target/shop"))
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed: others than those that rules were tuned on")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--kinds", help="only these cases, by comma")
    parser.add_argument("--deflex", type=pathlib.Path, default=pathlib.Path("target/release/deflex"), help="makes the planned cells")
    a = parser.parse_args()
    only = a.kinds.split(",") if a.kinds else list(CASES)
    jobs = [(a.output, name, index, a.deflex) for index in range(a.first, a.first + a.seeds) for name in only]
    with multiprocessing.Pool(a.jobs) as pool:
        rows = list(pool.imap(case, jobs, chunksize=1))
    with open(a.output / "index.csv", "w", newline="") as f:
        out = csv.writer(f, lineterminator="\n")
        out.writerow(["case", "kind", "seed", "robot", "effects", "faults", "rows", "sigma_mm", "wander_mm"])
        out.writerows(sorted(rows))
    print(f"{len(rows)} cases in {a.output}")


if __name__ == "__main__":
    main()
