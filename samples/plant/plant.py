"""Plays the real cell: runs a RAPID program on an elastic MuJoCo arm and writes what a tracker would have measured.

    plant.py run --cell cell.toml --program part.mod --truth truth.json --forces measured.csv -o out.csv --seed 1
"""

import argparse
import csv
import json
from dataclasses import dataclass

import numpy as np

from arm import Arm
from kinematics import solve_path
from program import MM, Frame, read_cell, read_program, rot_to_quat, rotvec_to_rot

TRAVEL = 1e-7  # rad: less motion than this is a stop, and keeps the direction before it
WANDER_POINTS = 10.0  # correlation length of the slow wander


@dataclass
class Result:
    """One row a target, in the target's work object frame; lengths in mm."""

    programmed: np.ndarray
    position: np.ndarray
    rotation: list
    normal: np.ndarray
    force: np.ndarray | None
    time: np.ndarray
    motor: np.ndarray  # commanded, rad


def travel_signs(motor):
    """Direction of each motor into each target, held through stops, 0 before the first motion."""
    signs = np.zeros_like(motor)
    for k in range(1, len(motor)):
        step = motor[k] - motor[k - 1]
        signs[k] = np.where(np.abs(step) > TRAVEL, np.sign(step), signs[k - 1])
    return signs


def path_time(moves):
    """Time from a cold start: path length over feed."""
    t = [0.0]
    for a, b in zip(moves, moves[1:]):
        t.append(t[-1] + np.linalg.norm(b.wobj_from_tcp.pos - a.wobj_from_tcp.pos) / b.speed_m_s)
    return np.array(t)


def feeds(moves, world):
    """Unit chord into each target (out of it at the first), in work object axes."""
    points = np.array([w.rot @ m.wobj_from_tcp.pos + w.pos for m, w in zip(moves, world)])
    chords = np.diff(points, axis=0)
    chords = np.vstack([chords[:1], chords])
    for k in range(1, len(chords)):
        if np.linalg.norm(chords[k]) < 1e-9:
            chords[k] = chords[k - 1]
    length = np.linalg.norm(chords, axis=1)
    return np.array([w.rot.T @ c / max(n, 1e-12) for w, c, n in zip(world, chords, length)]), length


def gear_angles(effects, commanded, travel):
    """Motor angles with no torque on them: what the gears make of the command."""
    m = commanded.copy()
    for e in effects:
        if e["kind"] == "zero_offset":
            m += e["offset_rad"]
        elif e["kind"] == "backlash":
            m -= travel * np.array(e["half_gap_rad"])
        elif e["kind"] == "gear_harmonic":
            for t in e["terms"]:
                j = t["joint"] - 1
                m[j] += t["cos_rad"] * np.cos(t["order"] * commanded[j]) + t["sin_rad"] * np.sin(t["order"] * commanded[j])
        elif e["kind"] == "joint_coupling":
            for t in e["terms"]:
                m[t["joint"] - 1] += t["ratio"] * commanded[t["on"] - 1]
        elif e["kind"] == "joint_error_curve":
            for c in e["curves"]:
                j = c["joint"] - 1
                m[j] += np.interp(np.degrees(commanded[j]), c["angle_deg"], c["error_rad"])
    return m


def part_compliance(effects, x, y):
    """How far the clamped part gives way along the normal (mm/N) where it is touched (x, y in mm)."""
    total = 0.0
    for e in effects:
        if e["kind"] == "workpiece_compliance":
            coefficients = np.atleast_1d(e["mm_per_n"])
            total += float(coefficients @ np.array([1, x, y, x * x, x * y, y * y])[: len(coefficients)])
        elif e["kind"] == "thin_wall":  # a cantilever plate clamped at x = 0
            total += e["mm_per_n"] * (max(x, 0.0) / e["length_mm"]) ** 3
    return total


def beyond_list(effects, x, y, time_s):
    """Shifts (mm, work object axes) that no listed effect describes."""
    shift = np.zeros(3)
    for e in effects:
        if e["kind"] == "space_field":
            shift += np.array(e["amplitude_mm"]) * np.sin(2 * np.pi * np.array([x, y, x + y]) / e["wave_mm"] + np.array(e["phase_rad"]))
        elif e["kind"] == "fixture_jump" and time_s >= e["at_s"]:
            shift += e["d_mm"]
    return shift


def run(cell, program, truth, force=None, time=None):
    """The program's targets as they come out without measurement noise.

    `force`: N on the tool, work object axes, one row a target (NaN or zero is air); `time`: s.
    """
    effects, moves = truth["effect"], program.moves
    tools, wobjs = {**cell.tools, **program.tools}, {**cell.wobjs, **program.wobjs}
    for m in moves:
        if m.tool not in tools or m.wobj not in wobjs:
            raise SystemExit(f"line {m.line}: tool {m.tool} or work object {m.wobj} is declared nowhere")
    world = [wobjs[m.wobj] for m in moves]
    feed, chord = feeds(moves, world)
    time = path_time(moves) if time is None else np.asarray(time, float)

    def command(wobj_from_tcp, k):
        return cell.world_from_base.inv() @ world[k] @ wobj_from_tcp @ tools[moves[k].tool].flange_from_tcp.inv()

    confs = [m.conf for m in moves]
    motor = solve_path(cell, [command(m.wobj_from_tcp, k) for k, m in enumerate(moves)], confs)
    travel = travel_signs(motor)
    commanded = motor
    delay = sum(e["time_s"] for e in effects if e["kind"] == "tracking_lag")
    if delay:
        # When the target's command is due, the arm still follows the command of `delay` ago: a little back along the path.
        late = [Frame(m.wobj_from_tcp.rot, m.wobj_from_tcp.pos - m.speed_m_s * delay * feed[k]) for k, m in enumerate(moves)]
        commanded = solve_path(cell, [command(f, k) for k, f in enumerate(late)], confs)

    moved = [(Frame(rotvec_to_rot(e.get("d_rad", [0, 0, 0])), np.array(e.get("d_mm", [0, 0, 0]), float) * MM)) for e in effects if e["kind"] == "work_object_frame"]
    factor = np.prod([e["factor"] for e in effects if e["kind"] == "force_scale"])
    creeping = [e for e in effects if e["kind"] == "creep"]
    crept = [np.zeros(6) for _ in creeping]  # twist of each gear that has been followed so far, rad
    arms, cut_m, position, rotation, normals = {}, 0.0, [], [], []
    for k, move in enumerate(moves):
        if move.tool not in arms:
            arms[move.tool] = Arm(cell, tools[move.tool], effects)
        arm = arms[move.tool]
        load = np.zeros(3) if force is None else np.nan_to_num(np.asarray(force[k], float))
        if k and np.any(load):
            cut_m += chord[k]
        worn = 1 + sum(e["per_m"] * cut_m for e in effects if e["kind"] == "tool_wear")
        normal = -move.wobj_from_tcp.rot[:, 2]
        x, y = move.wobj_from_tcp.pos[:2] / MM
        drag = np.zeros(6)
        for e in effects:
            if e["kind"] == "cable_drag":
                drag += np.array(e["nm_per_rad2"]) * motor[k][3] * motor[k][5]
        unloaded = gear_angles(effects, commanded[k], travel[k])

        def rest(crept):
            angle = unloaded - sum((np.array(e["share"]) * c for e, c in zip(creeping, crept)), np.zeros(6))
            return arm.rest(angle, world[k].rot @ load * worn * factor, travel[k], world[k].rot @ normal,
                            part_compliance(effects, x, y), drag, time[k])

        if creeping:
            # The twist hardly depends on what has crept: the load alone decides it.
            _, twist = rest(crept)
            waited = time[k] - time[k - 1] if k else 0.0
            crept = [twist + (c - twist) * np.exp(-waited / e["after_s"]) for e, c in zip(creeping, crept)]
        world_from_tcp, _ = rest(crept)
        true_wobj = world[k]
        for d in moved:
            true_wobj = true_wobj @ d
        seen = true_wobj.inv() @ world_from_tcp
        position.append(seen.pos / MM + beyond_list(effects, x, y, time[k]))
        rotation.append(seen.rot)
        normals.append(normal)
    programmed = np.array([m.wobj_from_tcp.pos for m in moves]) / MM
    return Result(programmed, np.array(position), rotation, np.array(normals), force, time, motor)


def noise(truth, rows, seed):
    """White noise on each axis plus a slow first-order wander (mm)."""
    rng = np.random.default_rng(seed)
    out = truth.get("sigma_mm", 0.0) * rng.standard_normal((rows, 3))
    keep = np.exp(-1 / WANDER_POINTS)
    wander, sd = rng.standard_normal(3) * truth.get("wander_mm", 0.0), truth.get("wander_mm", 0.0)
    for k in range(rows):
        out[k] += wander
        wander = keep * wander + np.sqrt(1 - keep**2) * sd * rng.standard_normal(3)
    return out


def read_forces(path, rows):
    """Forces and times by target number; targets that the table leaves out are air."""
    force, time = np.zeros((rows, 3)), np.full(rows, np.nan)
    with open(path, newline="") as f:
        for row in csv.DictReader(f):
            k = int(row["target"]) - 1
            if not 0 <= k < rows:
                raise SystemExit(f"{path}: target {k + 1} is not in the program")
            force[k] = [float(row.get(c) or 0) for c in ("fx_n", "fy_n", "fz_n")]
            if row.get("time_s"):
                time[k] = float(row["time_s"])
    return force, None if np.isnan(time).any() else time


def write(path, result, error, normal_only=False, orientation=False, against=None):
    """The measured file in the form that `deflex` reads."""
    position = result.position + error
    columns = ["target"] + (["normal_mm"] if normal_only else ["x_mm", "y_mm", "z_mm"])
    columns += ["qw", "qx", "qy", "qz"] if orientation else []
    columns += (["fx_n", "fy_n", "fz_n"] if result.force is not None else []) + ["time_s"]
    intended = result.programmed if against is None else against
    with open(path, "w", newline="") as f:
        out = csv.writer(f, lineterminator="\n")
        out.writerow(columns)
        for k in range(len(position)):
            if normal_only:
                row = [f"{result.normal[k] @ (position[k] - intended[k]):.4f}"]
            else:
                row = [f"{v:.4f}" for v in position[k]]
            if orientation:
                row += [f"{v:.8f}" for v in rot_to_quat(result.rotation[k])]
            if result.force is not None:
                row += [f"{v:.2f}" for v in result.force[k]]
            out.writerow([k + 1, *row, f"{result.time[k]:.1f}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p = parser.add_subparsers(dest="command", required=True).add_parser("run", help="run a program on the plant")
    p.add_argument("--cell", required=True)
    p.add_argument("--program", required=True)
    p.add_argument("--truth", required=True, help="JSON: the effects that are really there, sigma_mm, wander_mm")
    p.add_argument("--forces", default="none", help="CSV with target, fx_n, fy_n, fz_n and optionally time_s; or none")
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--noise-free", action="store_true")
    p.add_argument("--normal", action="store_true", help="write normal_mm instead of x, y, z")
    p.add_argument("--orientation", action="store_true", help="write qw, qx, qy, qz as well")
    p.add_argument("--against", help="original program: print the error against its targets (rms, mean, max of the 3-D norm)")
    p.add_argument("-o", "--output", required=True)
    a = parser.parse_args()
    cell, program = read_cell(a.cell), read_program(a.program)
    with open(a.truth) as f:
        truth = json.load(f)
    force, time = (None, None) if a.forces == "none" else read_forces(a.forces, len(program.moves))
    result = run(cell, program, truth, force, time)
    error = np.zeros_like(result.position) if a.noise_free else noise(truth, len(result.position), a.seed)
    against = None
    if a.against:
        against = np.array([m.wobj_from_tcp.pos for m in read_program(a.against).moves]) / MM
        off = np.linalg.norm(result.position + error - against, axis=1)
        print(f"rms_mm {np.sqrt(np.mean(off**2)):.5f}  mean_mm {off.mean():.5f}  max_mm {off.max():.5f}")
    write(a.output, result, error, a.normal, a.orientation, against)


if __name__ == "__main__":
    main()
