"""Plays a robot controller: leads the axes along a RAPID program and logs them, as a real one would.

    controller.py log --cell cell.toml --program part.mod -o log.csv --seed 1     axes over time
    controller.py judge --cell cell.toml --program corrected.mod --against part.mod   how far the driven path is off, and its time
    controller.py pocket -o FOLDER                                                cell, programs for the logs, and a pocket

It shares no code with `deflex`. Corners are rounded within a share of the zone, and speed follows from limits of the
acceleration along the path, across it and of each axis. The axis commands go through a half-sine window (an interpolator with
limited jerk), and each axis answers as a servo of second order with feed-forward of its own quality.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

from kinematics import base_from_flange, check_form, inverse
from program import MM, Frame, read_cell, read_program, rot_to_quat, rotvec_to_rot

STEP = 0.4 * MM  # between two places of the route
TICK = 0.002  # s
LOG_EVERY = 4  # ticks between two rows of a log

# What the controller is: deflex sees its logs alone.
WINDOW_S = 0.095
ZONE_SHARE = 0.9
PATH_ACCELERATION = 4.0  # m/s²
ACROSS_ACCELERATION = 3.0  # m/s², in arcs and corners
AXIS_ACCELERATION = np.array([6.0, 6.0, 7.0, 12.0, 12.0, 18.0])  # rad/s²
SERVO_HZ = np.array([9.0, 8.0, 8.5, 12.0, 12.0, 14.0])
DAMPING = 0.9
FEED_FORWARD = np.array([0.99, 0.985, 0.985, 0.992, 0.99, 0.993])  # of the velocity
TORQUE_AHEAD = np.array([0.95, 0.93, 0.94, 0.96, 0.95, 0.96])  # of the acceleration
REST_S = 0.06  # at `fine`, after the commands have ended


def turn_between(a, b):
    """Rotation vector from one orientation to another."""
    q = rot_to_quat(b @ a.T)
    angle = 2 * np.arctan2(np.linalg.norm(q[1:]), q[0])
    return angle * q[1:] / max(np.linalg.norm(q[1:]), 1e-12)


class Leg:
    """A straight motion from one pose to another."""

    def __init__(self, start, end, feed):
        self.start, self.end, self.feed = start, end, feed
        way = end.pos - start.pos
        self.length = np.linalg.norm(way)
        self.direction = way / max(self.length, 1e-12)
        self.turn = turn_between(start.rot, end.rot)

    def pose(self, s):
        share = s / max(self.length, 1e-12)
        return Frame(rotvec_to_rot(share * self.turn) @ self.start.rot, self.start.pos + s * self.direction)


def route(legs, zones):
    """Poses, largest speeds and stops along the way: sides with a curve that touches both at each corner with a zone."""
    places = [(legs[0].start, legs[0].feed, True)]
    begin = 0.0
    for k, leg in enumerate(legs):
        zone = zones[k] if k + 1 < len(legs) else None
        reach = 0.0
        if zone is not None:
            reach = min(ZONE_SHARE * zone, 0.5 * leg.length, 0.5 * legs[k + 1].length)
        end = leg.length - reach
        for s in np.linspace(begin, end, max(2, int((end - begin) / STEP) + 2))[1:]:
            places.append((leg.pose(s), leg.feed, False))
        if zone is None:
            places[-1] = (*places[-1][:2], True)
            begin = 0.0
            continue
        after = legs[k + 1]
        cosine = np.clip(leg.direction @ after.direction, -1, 1)
        half = 0.5 * np.arccos(cosine)
        feed = min(leg.feed, after.feed)
        if half > 1e-4 and reach > 0 and np.cos(half) > 1e-2:
            # Of the curve that both sides are tangents of, as ABB describes it (a parabola): its bend is largest in the middle.
            bend = 2 * np.sin(half) / (reach * np.cos(half) ** 2)
            window = 0.25 * WINDOW_S * ACROSS_ACCELERATION / np.sin(half)
            feed = min(feed, np.sqrt(ACROSS_ACCELERATION / bend) + window)
            ends = leg.pose(end).pos, leg.end.pos, after.pose(reach).pos
            count = max(8, int(2 * reach / STEP) + 1)
            for j in range(1, count + 1):
                u = j / count
                spot = (1 - u) ** 2 * ends[0] + 2 * u * (1 - u) * ends[1] + u**2 * ends[2]
                rot = leg.pose(end + reach * u).rot if u < 0.5 else after.pose(reach * u).rot
                places.append((Frame(rot, spot), feed, False))
        begin = reach
    places[-1] = (*places[-1][:2], True)
    return places


def motors(cell, flanges):
    """Motor angles along close flange poses, on the branch of the first."""
    check_form(cell)
    out = []
    for flange in flanges:
        found = inverse(cell, flange)
        if not found:
            raise SystemExit("the route is out of reach")
        if not out:
            home = cell.start if cell.start is not None else np.zeros(6)
            found = [m + 2 * np.pi * np.round((home - m) / (2 * np.pi)) for m in found]
            out.append(min(found, key=lambda m: np.abs(m - home).max()))
            continue
        found = [m + 2 * np.pi * np.round((out[-1] - m) / (2 * np.pi)) for m in found]
        out.append(min(found, key=lambda m: np.linalg.norm(m - out[-1])))
    return np.array(out)


def timed(places, q):
    """Time at each place: speeds that the limits of path and axes allow, with a rest at each stop."""
    length = np.maximum(np.linalg.norm(np.diff([p.pos for p, _, _ in places], axis=0), axis=1), 1e-9)
    most = np.array([feed for _, feed, _ in places])
    most[:-1] = np.minimum(most[:-1], most[1:])
    # Across the path: the axes have to follow its bend.
    slope = np.diff(q, axis=0) / length[:, None]
    for k in range(1, len(places) - 1):
        # A bend at one place is spread over what the window makes of it.
        spread = 0.5 * (length[k - 1] + length[k])
        bend = np.abs(slope[k] - slope[k - 1])
        for _ in range(3):
            reach = spread + 0.35 * WINDOW_S * most[k]
            most[k] = min(most[k], np.sqrt((AXIS_ACCELERATION * reach / np.maximum(bend, 1e-9)).min()))
    most[[k for k, (_, _, stop) in enumerate(places) if stop]] = 0.0
    for k in range(1, len(most)):
        most[k] = min(most[k], np.sqrt(most[k - 1] ** 2 + 2 * PATH_ACCELERATION * length[k - 1]))
    for k in range(len(most) - 2, -1, -1):
        most[k] = min(most[k], np.sqrt(most[k + 1] ** 2 + 2 * PATH_ACCELERATION * length[k]))
    time, stamp, rows = 0.0, [0.0], [q[0]]
    for k in range(1, len(most)):
        time += length[k - 1] / max(0.5 * (most[k] + most[k - 1]), 1e-6)
        stamp.append(time)
        rows.append(q[k])
        if places[k][2]:
            time += WINDOW_S + REST_S
            stamp.append(time)
            rows.append(q[k])
    return np.array(stamp), np.array(rows)


def driven(cell, program):
    """Time and motor angles as the encoders show them."""
    tools, wobjs = {**cell.tools, **program.tools}, {**cell.wobjs, **program.wobjs}
    base = cell.world_from_base.inv()
    poses = [base @ wobjs[m.wobj] @ m.wobj_from_tcp for m in program.moves]
    legs, zones = [], []
    for before, after, move in zip(poses, poses[1:], program.moves[1:]):
        if np.linalg.norm(after.pos - before.pos) > 1e-9:
            legs.append(Leg(before, after, move.speed_m_s))
            zones.append(move.zone_m)
    flange = tools[program.moves[0].tool].flange_from_tcp.inv()
    places = route(legs, zones)
    q = motors(cell, [p @ flange for p, _, _ in places])
    stamp, rows = timed(places, q)
    settle = WINDOW_S + 0.4
    t = np.arange(0.0, stamp[-1] + settle, TICK)
    command = np.array([np.interp(t, stamp, rows[:, j]) for j in range(6)]).T
    width = int(round(WINDOW_S / TICK))
    window = np.sin(np.pi * (np.arange(width) + 0.5) / width)
    window /= window.sum()
    padded = np.vstack([np.repeat(command[:1], width, 0), command])
    smooth = np.array([np.convolve(padded[:, j], window, "full")[width : width + len(t)] for j in range(6)]).T
    # Servo: a'' = w² (r - a) + 2 d w (f r' - a') + g r'', in small steps.
    omega = 2 * np.pi * SERVO_HZ
    angle, rate, out = smooth[0].copy(), np.zeros(6), []
    speed = np.gradient(smooth, TICK, axis=0)
    torque = np.gradient(speed, TICK, axis=0)
    parts = 4
    for k in range(len(t)):
        for _ in range(parts):
            pull = omega**2 * (smooth[k] - angle) + 2 * DAMPING * omega * (FEED_FORWARD * speed[k] - rate)
            rate = rate + (TICK / parts) * (pull + TORQUE_AHEAD * torque[k])
            angle = angle + (TICK / parts) * rate
        out.append(angle.copy())
    return t, np.array(out), tools[program.moves[0].tool].flange_from_tcp


def log(cell, program, path, seed):
    """Writes the log of a run, with some rest before and after, as a signal analyser does."""
    rng = np.random.default_rng(seed)
    t, q, _ = driven(cell, program)
    rest = int(0.5 / TICK)
    q = np.vstack([np.repeat(q[:1], rest, 0), q, np.repeat(q[-1:], rest, 0)])
    t = np.arange(len(q)) * TICK
    with open(path, "w", newline="") as f:
        out = csv.writer(f, lineterminator="\n")
        out.writerow(["time_s", *(f"q{j}_deg" for j in range(1, 7))])
        for k in range(0, len(t), LOG_EVERY):
            angles = np.degrees(q[k]) + 2e-4 * rng.standard_normal(6)
            out.writerow([f"{t[k] + 2e-4 * rng.random():.4f}", *(f"{a:.5f}" for a in angles)])


def off_path(points, corners):
    """Distance of each point from a polyline, and of each of its corners from the path through the points (m)."""
    best = np.full(len(points), np.inf)
    for a, b in zip(corners, corners[1:]):
        way = b - a
        share = np.clip(((points - a) @ way) / max(way @ way, 1e-18), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * way, axis=1))
    steps = np.diff(points, axis=0)
    square = np.maximum((steps**2).sum(1), 1e-18)
    missed = []
    for corner in corners:
        share = np.clip(((corner - points[:-1]) * steps).sum(1) / square, 0, 1)
        missed.append(np.linalg.norm(points[:-1] + share[:, None] * steps - corner, axis=1).min())
    return best, np.array(missed)


def judge(cell, program, original):
    """Largest and rms distance from the original's path, largest distance of a corner from the driven path (mm), and the time (s)."""
    t, q, tool = driven(cell, program)
    points = np.array([(base_from_flange(cell, m) @ tool).pos for m in q])
    wobjs = {**cell.wobjs, **original.wobjs}
    base = cell.world_from_base.inv()
    corners = np.array([(base @ wobjs[m.wobj] @ m.wobj_from_tcp).pos for m in original.moves])
    path, missed = off_path(points, corners)
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-7
    seconds = t[np.nonzero(moves)[0][-1] + 1]
    return path.max() / MM, np.sqrt(np.mean(path**2)) / MM, missed.max() / MM, seconds


CELL = """[robot]
model = "irb6660-205-1.9"
start_deg = [0, 0, 0, 0, 60, 0]

[controller]
compensates = []

[cut]
force = "none"
"""
TOOL = "  PERS tooldata tMill:=[TRUE,[[0,0,150],[1,0,0,0]],[4,[0,0,80],[1,0,0,0],0,0,0]];\n"
WOBJ = '  PERS wobjdata wPart:=[FALSE,TRUE,"",[[1200,-100,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'


def module(name, points, speed, zone):
    """A program through points (mm, in the work object), stops at both ends."""
    lines = []
    for k, (x, y) in enumerate(points):
        passing = "fine" if k in (0, len(points) - 1) else zone
        target = f"[[{x:.3f},{y:.3f},0],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
        lines.append(f"    MoveL {target},{speed},{passing},tMill\\WObj:=wPart;\n")
    return f"MODULE {name}\n{TOOL}{WOBJ}  PROC main()\n{''.join(lines)}  ENDPROC\nENDMODULE\n"


def pocket_points(corners=40, length=36.0, step=6.0):
    """A pocket cut in parallel lines: `corners` right angles."""
    x, y, points, along = 20.0, 20.0, [(20.0, 20.0)], True
    side = 1
    while len(points) < corners + 2:
        if along:
            x += side * length
            side = -side
        else:
            y += step
        along = not along
        points.append((x, y))
    return points


def square_points(corners=40, first=26.0, grow=0.4):
    """A pocket cut in a square spiral from inside out, whose sides become longer."""
    x = y = 100.0
    points, length, heading = [(x, y)], first, np.array([1.0, 0.0])
    for _ in range(corners + 1):
        x, y = np.array([x, y]) + length * heading
        points.append((x, y))
        heading = np.array([-heading[1], heading[0]])
        length += grow * first / 4
    return points


def write_pocket(folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cell.toml").write_text(CELL)
    (folder / "zigzag.mod").write_text(module("zigzag", pocket_points(), "v50", "z1"))
    (folder / "spiral.mod").write_text(module("spiral", square_points(), "v50", "z1"))
    cell = read_cell(folder / "cell.toml")
    number = 0
    for degrees in (30, 90, 135):
        for speed in ("v30", "v50", "v100"):
            for zone in ("fine", "z0", "z1", "z5"):
                way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
                start, corner = np.array([30.0, 60.0]), np.array([90.0, 60.0])
                end = corner + 50 * way
                name = f"log{number:02}"
                (folder / f"{name}.mod").write_text(module(name, [start, corner, end], speed, zone))
                log(cell, read_program(folder / f"{name}.mod"), folder / f"{name}.csv", number)
                number += 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("log")
    one.add_argument("--seed", type=int, default=0)
    other = commands.add_parser("judge")
    other.add_argument("--against", required=True)
    for p in (one, other):
        p.add_argument("--cell", required=True)
        p.add_argument("--program", required=True)
    one.add_argument("-o", "--output", required=True)
    commands.add_parser("pocket").add_argument("-o", "--output", type=Path, required=True)
    a = parser.parse_args()
    if a.command == "pocket":
        return write_pocket(a.output)
    cell, program = read_cell(a.cell), read_program(a.program)
    if a.command == "log":
        return log(cell, program, a.output, a.seed)
    most, rms, missed, seconds = judge(cell, program, read_program(a.against))
    print(f"max_mm {most:.4f}  rms_mm {rms:.4f}  corner_mm {missed:.4f}  time_s {seconds:.2f}")


if __name__ == "__main__":
    main()
