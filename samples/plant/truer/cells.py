"""Makes cells of the truer plant: `cells.py [-o FOLDER] [--seeds N] [--first N] [--kinds kitchen,most,friction,…] [--jobs N]`.

`kitchen` has everything off at once, with physical sizes, on production programs of 300 to 1,500 rows; `most` leaves about a quarter of it out;
every other kind is one group of `arm.NUMBERS` alone. Each cell is a folder with cell.toml, part.mod, measured.csv, exact.csv, transfer.mod,
transfer_measured.csv, transfer_exact.csv (files ending in exact.csv have no noise) and truth.json. The same call gives the same bytes.
"""

import argparse
import csv
import json
import multiprocessing
import os
import pathlib
import zlib

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core a process; the matrices are tiny
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import chain
import paths
from arm import GROUPS, Arm, Numbers
from robots import ROBOTS

# What deflex calls each group: any of these names is right where the group acts.
NAMES = {
    "springs": ["joint_stiffness"], "bent": ["stiffness_curve", "joint_stiffness"], "friction": ["hysteresis", "backlash"], "play": ["backlash"],
    "creep": ["creep"], "periodic": ["gear_harmonic", "joint_error_curve"], "zeros": ["zero_offset"], "tool": ["tool_frame"],
    "links": ["link_geometry"], "frame": ["work_object_frame"], "taught": ["work_object_frame"], "weight": ["gravity"], "balancer": ["gravity"],
    "beams": ["bearing_compliance", "base_compliance", "joint_stiffness"], "bearings": ["bearing_compliance"], "mount": ["base_compliance"],
    "holder": ["tool_compliance"], "plate": ["workpiece_compliance"], "heat": ["thermal_growth"], "rod": ["joint_stiffness", "stiffness_curve"],
    "sensor": ["force_scale"],
}
# A group counts as there from this rms of what it does to the measured program, mm: a tenth of what trackers see.
THERE_MM = 0.002
ALONE = ["friction", "bent", "rod", "springs", "beams", "bearings", "creep", "heat", "plate", "balancer", "periodic", "play", "sensor"]
# Where most of these cells lie, rms of what the declared cell is off, mm.
OFF_MM = {"kitchen": (0.3, 1.0), "most": (0.3, 1.0)}
OFF_ALONE_MM = (0.06, 0.3)


def rms(v):
    return float(np.sqrt(np.mean(np.sum(v**2, axis=1))))


def instrument(rng, rows, sigma, wander, drift):
    """White noise, a wander over about ten points, and a slow drift as of a tracker that warms up, mm."""
    out = sigma * rng.standard_normal((rows, 3))
    keep, state = np.exp(-0.1), wander * rng.standard_normal(3)
    for k in range(rows):
        out[k] += state
        state = keep * state + np.sqrt(1 - keep**2) * wander * rng.standard_normal(3)
    along = np.linspace(0, 1, rows)
    shape = (1 - np.exp(-along * 3)) if rng.random() < 0.5 else along
    way = rng.normal(size=3)
    return out + drift * np.outer(shape, way / np.linalg.norm(way))


def write_rows(path, position, force, times):
    with open(path, "w", newline="") as f:
        out = csv.writer(f, lineterminator="\n")
        out.writerow(["target", "x_mm", "y_mm", "z_mm", "fx_n", "fy_n", "fz_n", "time_s"])
        for k in range(len(position)):
            out.writerow([k + 1, *(f"{v:.5f}" for v in position[k]), *(f"{v:.2f}" for v in force[k]), f"{times[k]:.2f}"])


def programs(robot, rng):
    """Two programs on one table: what is measured, and another elsewhere on it, turned and loaded otherwise, later."""
    turn = rng.uniform(-0.3, 0.3)
    table = np.round(np.array(robot.centre_mm) + rng.uniform(-60, 60, 3), 3), np.round(chain.quaternion(chain.about(2, turn))[0], 8)
    first, second = rng.choice(list(paths.FAMILIES), 2, replace=False)
    rows, other = int(np.exp(rng.uniform(np.log(300), np.log(1500)))), int(rng.uniform(150, 500))
    side = rng.uniform(0, 2 * np.pi)
    away = np.array([np.cos(side) * 110, np.sin(side) * 130, 0.0])
    spin = rng.uniform(-0.8, 0.8)
    found = {}
    for name, family, count, at, turned, size in (
        ("part", first, rows, -away + [0, 0, rng.uniform(0, 60)], spin, rng.uniform(0.8, 1.6)),
        ("transfer", second, other, away + [0, 0, rng.uniform(20, 110)], spin + rng.choice([-1, 1]) * rng.uniform(0.3, 0.9), rng.uniform(0.8, 1.6)),
    ):
        start = 0.0 if name == "part" else rng.uniform(0, 1500)
        path, quats = paths.draw(robot, rng, family, count, table, at, turned, start, rng.uniform(0.2, 2.5), size)
        motor = chain.motors(robot, *paths.flange_of(robot, path))
        found[name] = (path, quats, motor, family)
    corners = np.array([[x, y, z] for x in (-200, 0, 200) for y in (-240, 0, 240) for z in (0.0, 120.0)])
    down = paths.Path(corners, paths.frames(np.tile([0.0, 0.0, 1.0], (len(corners), 1))), np.full(len(corners), 100.0), 0 * corners, *table)
    found["corners"] = (down, None, chain.motors(robot, *paths.flange_of(robot, down)), "")
    return table, found


def drawn(robot, seed):
    for attempt in range(60):
        try:
            return programs(robot, np.random.default_rng([*seed, attempt]))
        except chain.OutOfReach:
            continue
    raise RuntimeError(f"{robot.label}: no program fits")


def play(robot, numbers, table, found, taught=None):
    """The arm with these numbers, its frame taught with itself, and where it takes both programs."""
    arm = Arm(robot, numbers, *table)
    corners = found["corners"]
    if taught is None:
        arm.teach(corners[2], corners[0].points)
    else:
        arm.taught = taught
    return arm, {name: arm.run(motor, path.points, path.force, path.times()) for name, (path, _, motor, _) in found.items() if name != "corners"}


def case(job):
    root, kind, index = job
    seed = [zlib.crc32(f"truer {kind}".encode()), index]
    rng = np.random.default_rng([*seed, 0])
    robots = [r for r in ROBOTS if kind != "rod" or r.parallelogram]
    robot = robots[index % len(robots)]
    table, found = drawn(robot, [*seed, 1])
    draws = Numbers.draw(rng, {})
    if kind == "kitchen":
        size = dict.fromkeys(GROUPS, 1.0)
    elif kind == "most":
        size = {g: float(rng.random() < 0.75) for g in GROUPS} | {"springs": 1.0}
    else:
        size = {g: float(g == kind) for g in GROUPS}
    if not robot.parallelogram:
        size["rod"] = 0.0
    low, high = OFF_MM.get(kind, OFF_ALONE_MM)
    wanted = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    declared = play(robot, Numbers(draws.z, {}), table, found)[1]
    scale = 1.0
    for _ in range(3):
        numbers = Numbers(draws.z, {g: s * scale for g, s in size.items()})
        arm, exact = play(robot, numbers, table, found)
        reading = {name: arm.read_force(found[name][0].force) for name in exact}
        off = rms(exact["part"] - declared["part"])
        if abs(off / wanted - 1) < 0.1:
            break
        # With everything off, sizes stay physical: within 0.6 and 1.6 of the typical ones.
        reach = (0.6, 1.6) if kind in OFF_MM else (0.1, 10.0)
        scale = float(np.clip(scale * wanted / max(off, 1e-6), *reach))
    folder = root / kind / f"{index:03}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cell.toml").write_text(robot.cell_toml())
    sigma, wander, drift = round(rng.uniform(0.008, 0.016), 4), round(rng.uniform(0.003, 0.008), 4), round(rng.uniform(0.0, 0.01), 4)
    for number, (name, position) in enumerate(exact.items()):
        path, quats, motor, _ = found[name]
        (folder / f"{name}.mod").write_text(paths.rapid(robot, path, quats, motor))
        noise = np.random.default_rng([*seed, 2, number])
        error = instrument(noise, len(position), sigma, wander, drift)
        sensed = reading[name] + np.where(reading[name] != 0, noise.normal(0, 1.5, reading[name].shape), 0.0) * (size.get("sensor", 0) > 0)
        prefix = "" if name == "part" else "transfer_"
        write_rows(folder / f"{prefix}measured.csv", position + error, sensed, path.times())
        write_rows(folder / f"{prefix}exact.csv", position, reading[name], path.times())
    shares = {}
    for g in [*GROUPS, "taught"]:
        if g == "taught":
            other = play(robot, numbers, table, found, (np.zeros(3), np.zeros(3)))[1]
        elif numbers.size[g] == 0:
            continue
        elif g == "sensor":
            # What a sensor says moves nothing: its share is what the declared cell makes of the wrong force.
            wrong = {n: (p, q, m, f) for n, (p, q, m, f) in found.items()}
            for n in exact:
                wrong[n] = (paths.replace(found[n][0], force=reading[n]), *found[n][1:])
            other = {n: exact[n] + v - declared[n] for n, v in play(robot, Numbers(draws.z, {}), table, wrong)[1].items()}
        else:
            other = play(robot, numbers.without(g), table, found, arm.taught)[1]
        shares[g] = {n: round(rms(exact[n] - other[n]), 5) for n in exact}
    there = {g for g, share in shares.items() if share["part"] >= THERE_MM}
    kinds = sorted({name for g in there for name in NAMES[g]})
    truth = {
        "effect": [{"kind": name} for name in kinds], "sigma_mm": sigma, "wander_mm": wander, "drift_mm": drift, "robot": robot.label,
        "families": [str(found["part"][3]), str(found["transfer"][3])], "rows": [len(exact["part"]), len(exact["transfer"])],
        "off_mm": {n: round(rms(exact[n] - declared[n]), 5) for n in exact}, "share_rms_mm": shares, "size": numbers.size,
        "z": {f"{g} {n}": v.tolist() for (g, n), v in draws.z.items()}, "taught": [v.tolist() for v in arm.taught],
        "table": [v.tolist() for v in table], "seed": seed, "faults": [],
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return [f"{kind}/{index:03}", kind, index, robot.label, *truth["families"], *truth["rows"], truth["off_mm"]["part"], truth["off_mm"]["transfer"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("target/truer"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed: others than those that rules were tuned on")
    parser.add_argument("--kinds", default="kitchen", help=f"by comma: kitchen, most, {', '.join(ALONE)}, or all")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    a = parser.parse_args()
    kinds = ["kitchen", "most", *ALONE] if a.kinds == "all" else a.kinds.split(",")
    jobs = [(a.output, kind, index) for index in range(a.first, a.first + a.seeds) for kind in kinds]
    with multiprocessing.Pool(a.jobs) as pool:
        rows = pool.map(case, jobs, chunksize=1)
    with open(a.output / "index.csv", "w", newline="") as f:
        out = csv.writer(f, lineterminator="\n")
        out.writerow(["case", "kind", "seed", "robot", "measured", "other", "rows", "other_rows", "off_mm", "other_off_mm"])
        out.writerows(sorted(rows))
    print(f"{len(rows)} cells in {a.output}")


if __name__ == "__main__":
    main()
