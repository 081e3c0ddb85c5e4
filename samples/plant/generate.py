"""Makes the blind table's cells: `generate.py [-o FOLDER] [--seeds N] [--first N] [--jobs N] [--kinds a,b]`.

Each case is a folder with cell.toml, part.mod, measured.csv, transfer.mod, transfer_measured.csv and truth.json;
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
from plans import ROBOTS, designed, draw, raster, transfer
from program import read_cell, read_program

PLANS = {"designed": designed, "plain": lambda robot, rng: raster(robot, rng, 16, 18)}
NOISES = ("white", "wander")
JOINT_ERROR_STEP_DEG = 2.0


def some(rng, count, low, high, among=6):
    """`count` joints of the first `among` with a value of either sign, zeros elsewhere."""
    out = np.zeros(6)
    out[rng.choice(among, count, replace=False)] = rng.uniform(low, high, count) * rng.choice([-1, 1], count)
    return out


def joint_stiffness(rng, robot, span, s):
    return {"scale": np.clip(1 + s * some(rng, 3, 0.15, 0.4, 5), 0.35, 3.0)}


def stiffness_curve(rng, robot, span, s):
    if rng.random() < 0.6:
        width = np.abs(some(rng, 4, 1e-4, 3e-4)) * s
        return {"form": "two_slope", "width_rad": width, "ratio": np.where(width > 0, rng.uniform(0.35, 0.6, 6), 1.0)}
    return {"form": "cubic", "c_per_rad2": np.abs(some(rng, 4, 0.6e6, 2e6)) * s}


def gravity(rng, robot, span, s):
    mass = np.array(robot.mass_kg) * rng.uniform(0.7, 1.3, 6) * s
    cog = np.array(robot.cog_mm) * 1e-3 + rng.uniform(-0.02, 0.02, (6, 3))
    return {"mass_kg": mass, "first_moment_kg_m": mass[:, None] * cog}


def backlash(rng, robot, span, s):
    return {"half_gap_rad": np.abs(some(rng, 2, 3e-5, 1.5e-4, 5)) * s}


def hysteresis(rng, robot, span, s):
    return {"fraction": np.clip(np.abs(some(rng, 4, 0.06, 0.2, 5)) * s, 0, 0.6)}


def creep(rng, robot, span, s):
    return {"share": np.abs(some(rng, 4, 0.05, 0.2, 5)) * s, "after_s": float(np.exp(rng.uniform(np.log(4), np.log(60))))}


def gear_harmonic(rng, robot, span, s):
    joints = rng.choice([1, 2, 3, 5], rng.integers(1, 3), replace=False)
    return {"terms": [{"joint": int(j), "order": int(rng.integers(11, 60)), "cos_rad": float(s * rng.normal() * 7e-5), "sin_rad": float(s * rng.normal() * 7e-5)} for j in joints]}


def joint_error_curve(rng, robot, span, s):
    angle, curves = np.arange(-180, 180.1, JOINT_ERROR_STEP_DEG), []
    for j in rng.choice([1, 2, 3, 5], 2, replace=False):
        error = sum(rng.normal() * np.sin(np.radians(angle) * f + rng.uniform(0, 6.3)) for f in rng.uniform(5, 14, 3))
        curves.append({"joint": int(j), "angle_deg": angle, "error_rad": np.round(8e-5 * s * error, 10)})
    return {"curves": curves}


def zero_offset(rng, robot, span, s):
    return {"offset_rad": some(rng, 2, 1e-4, 4e-4) * s}


def link_geometry(rng, robot, span, s):
    return {"d_alpha_rad": rng.normal(0, 1.5e-4, 6) * s, "d_a_mm": rng.normal(0, 0.12, 6) * s, "d_d_mm": rng.normal(0, 0.12, 6) * s, "d_theta_rad": rng.normal(0, 1.5e-4, 6) * s}


def tool_frame(rng, robot, span, s):
    return {"d_mm": rng.normal(0, 0.1, 3) * s, "d_rad": [0.0, 0.0, 0.0]}


def work_object_frame(rng, robot, span, s):
    return {"d_mm": rng.normal(0, 0.08, 3) * s, "d_rad": rng.normal(0, 3e-4, 3) * s}


def base_compliance(rng, robot, span, s):
    return {"mm_per_n": np.array([4e-5, 4e-5, 2e-5]) * rng.uniform(0.3, 1.2, 3) * s, "rad_per_nm": np.array([1.2e-6, 1.2e-6, 4e-7]) * rng.uniform(0.4, 1.6, 3) * s}


def bearing_compliance(rng, robot, span, s):
    out = np.zeros((6, 2))
    out[:4] = rng.uniform(1e-7, 8e-7, (4, 2)) * s
    return {"rad_per_nm": out}


def tool_compliance(rng, robot, span, s):
    return {"rad_per_nm": rng.uniform(0.5e-6, 1.5e-6, 2) * s, "axial_mm_per_n": 3e-5 * s, "radial_mm_per_n": rng.uniform(1e-4, 3e-4) * s}


def workpiece_compliance(rng, robot, span, s):
    c = rng.uniform(1e-4, 5e-4) * s
    # Half of the parts yield alike everywhere, half more and more towards one side.
    return {"mm_per_n": c} if rng.random() < 0.5 else {"mm_per_n": [c, 0.0, 0.0, c / 300**2, 0.0, c / 300**2]}


def thermal_growth(rng, robot, span, s):
    return {"tau_s": span * rng.uniform(0.25, 0.7), "column_mm": rng.uniform(0.02, 0.15) * s, "upper_arm_mm": rng.uniform(0.05, 0.2) * s, "forearm_mm": rng.uniform(0.05, 0.2) * s}


def force_scale(rng, robot, span, s):
    return {"factor": float(np.clip(1 + s * rng.uniform(0.12, 0.3) * rng.choice([-1, 1]), 0.3, 2.0))}


def tool_wear(rng, robot, span, s):
    return {"per_m": rng.uniform(0.05, 0.2) * s}


def tracking_lag(rng, robot, span, s):
    return {"time_s": rng.uniform(0.001, 0.005) * s}


def joint_coupling(rng, robot, span, s):
    pairs = [(5, 4), (6, 4), (6, 5)]
    return {"terms": [{"joint": joint, "on": on, "ratio": float(s * rng.normal() * 1e-3)} for joint, on in pairs]}


def cable_pull(rng, robot, span, s):
    """A hose from the rear of the column to the elbow, a third longer or shorter than at rest over the work."""
    reach = robot.links[3][2]
    return {"stiffness_n_per_m": 300 * s, "rest_mm": rng.uniform(0.5, 0.8) * reach, "from_mm": [-0.3 * reach, rng.uniform(-150, 150), 100], "from_link": 1,
            "to_mm": [rng.uniform(50, 150), 0.2 * reach, 80], "to_link": 3}


def space_field(rng, robot, span, s):
    return {"amplitude_mm": rng.normal(0, 0.08, 3) * s, "wave_mm": rng.uniform(60, 160, 3), "phase_rad": rng.uniform(0, 6.3, 3)}


def fixture_jump(rng, robot, span, s):
    return {"at_s": span * rng.uniform(0.4, 0.6), "d_mm": rng.normal(0, 0.1, 3) * s}


def temperature_cycle(rng, robot, span, s):
    return {"period_s": span / rng.uniform(3, 7), "phase_rad": float(rng.uniform(0, 6.3)), "column_mm": 0.12 * s, "upper_arm_mm": rng.uniform(-0.2, 0.2) * s, "forearm_mm": 0.1 * s}


def cable_drag(rng, robot, span, s):
    return {"nm_per_rad2": some(rng, 4, 20, 80) * s}


# Each maker draws one effect: `span` is the run's length in s, `s` its size.
LISTED = [joint_stiffness, stiffness_curve, gravity, backlash, hysteresis, gear_harmonic, joint_error_curve, zero_offset, link_geometry,
          tool_frame, work_object_frame, base_compliance, bearing_compliance, tool_compliance, workpiece_compliance, thermal_growth,
          force_scale, tool_wear, tracking_lag, joint_coupling, creep]
UNLISTED = [space_field, fixture_jump, temperature_cycle, cable_drag]
# Pairs of different families, so that each of the two can be distinguished from the other.
PAIRS = [(gravity, backlash), (base_compliance, gear_harmonic), (thermal_growth, zero_offset), (stiffness_curve, tracking_lag), (tool_wear, tool_frame),
         (hysteresis, gravity), (workpiece_compliance, thermal_growth), (joint_stiffness, backlash), (force_scale, gear_harmonic), (tool_compliance, joint_error_curve)]


def plain_numbers(value):
    if isinstance(value, dict):
        return {k: plain_numbers(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain_numbers(v) for v in value]
    return float(f"{value:.8g}") if isinstance(value, (float, np.floating)) else value


def rms(result, other):
    return float(np.sqrt(np.mean(np.sum((result.position - other.position) ** 2, axis=1))))


def sized(make, seed, robot, span, run, clean, wanted):
    """The effect with its random shape, scaled so that it moves the TCP by about `wanted` mm rms."""
    s = 1.0
    for _ in range(3):
        effect = {"kind": make.__name__, **plain_numbers(make(np.random.default_rng(seed), robot, span, s))}
        size = rms(run([effect]), clean)
        if abs(size / wanted - 1) < 0.1:
            break
        s *= float(np.clip(wanted / max(size, 1e-6), 0.05, 20))
    return effect, size


def case(job):
    """One cell with its two programs, measured once with white and once with wandering noise."""
    root, plan_name, group, name, makers, index = job
    seed = [zlib.crc32(f"{plan_name} {name}".encode()), index]
    rng = np.random.default_rng(seed)
    robot = ROBOTS[index % len(ROBOTS)]
    plans = {"part": draw(robot, PLANS[plan_name], [*seed, 1]), "transfer": draw(robot, transfer, [*seed, 2])}
    folders = [root / plan_name / noise / f"{name}-{index:02}" for noise in NOISES]
    for folder in folders:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "cell.toml").write_text(robot.cell_toml())
        for stem, (_, text) in plans.items():
            (folder / f"{stem}.mod").write_text(text)
    cell = read_cell(folders[0] / "cell.toml")
    programs = {stem: read_program(folders[0] / f"{stem}.mod") for stem in plans}

    def run(effects, stem="part"):
        plan = plans[stem][0]
        return plant.run(cell, programs[stem], {"effect": effects}, np.round(plan.force, 2), plan.times())

    clean = run([])
    effects, sizes = [], []
    for number, make in enumerate(makers):
        effect, size = sized(make, [*seed, 10 + number], robot, clean.time[-1], run, clean, float(np.exp(rng.uniform(np.log(0.035), np.log(0.15)))))
        effects.append(effect)
        sizes.append(size)
    sigma, wander = round(rng.uniform(0.010, 0.018), 4), round(rng.uniform(0.006, 0.010), 4)
    results = {stem: run(effects, stem) if effects or stem == "transfer" else clean for stem in plans}
    rows = []
    for noise, folder in zip(NOISES, folders):
        truth = {"effect": effects, "sigma_mm": sigma, "wander_mm": wander if noise == "wander" else 0.0,
                 "effect_rms_mm": [round(s, 5) for s in sizes], "in_list": group != "unlisted"}
        (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
        for number, (stem, result) in enumerate(results.items()):
            error = plant.noise(truth, len(result.position), [*seed, 20 + number, NOISES.index(noise)])
            plant.write(folder / f"{'transfer_' if stem == 'transfer' else ''}measured.csv", result, error)
        rows.append([str(folder.relative_to(root)), plan_name, noise, group, "+".join(e["kind"] for e in effects) or "none", index,
                     robot.label, sigma, truth["wander_mm"], "+".join(f"{s:.4f}" for s in sizes)])
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("target/blind"))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed: others than those that rules were tuned on")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--kinds", help="only these, by comma: a kind, none, pair, unlisted")
    a = parser.parse_args()
    only = set(a.kinds.split(",")) if a.kinds else None
    jobs = []
    for plan in PLANS:
        for index in range(a.first, a.first + a.seeds):
            groups = [("single", m.__name__, [m]) for m in LISTED] + [("none", "none", [])]
            groups += [("pair", "pair", list(PAIRS[index % len(PAIRS)])), ("unlisted", "unlisted", [UNLISTED[index % len(UNLISTED)]])]
            jobs += [(a.output, plan, group, name, makers, index) for group, name, makers in groups if only is None or name in only]
    with multiprocessing.Pool(a.jobs) as pool:
        rows = [row for found in pool.imap(case, jobs, chunksize=1) for row in found]
    with open(a.output / "index.csv", "w", newline="") as f:
        out = csv.writer(f, lineterminator="\n")
        out.writerow(["case", "plan", "noise", "group", "kinds", "seed", "robot", "sigma_mm", "wander_mm", "effect_rms_mm"])
        out.writerows(sorted(rows))
    print(f"{len(rows)} cases in {a.output}")


if __name__ == "__main__":
    main()
