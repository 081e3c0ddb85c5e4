"""The controller's own nominal kinematics: motor angles for each programmed target.

Closed form for a spherical wrist (Tang et al. Table 1 and its usual relatives), motor angles throughout.
"""

import itertools

import numpy as np

from program import Frame


def dh(row, q):
    """Modified DH (Craig): Rx(alpha) Tx(a) Rz(theta + q) Tz(d)."""
    alpha, a, d, theta = row
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta + q), np.sin(theta + q)
    return Frame(np.array([[ct, -st, 0], [ca * st, ca * ct, -sa], [sa * st, sa * ct, ca]]), np.array([a, -sa * d, ca * d]))


def base_from_flange(cell, motor):
    serial = np.linalg.solve(cell.motor_from_serial, motor)
    frame = dh(cell.links[0], serial[0])
    for row, q in zip(cell.links[1:], serial[1:]):
        frame = frame @ dh(row, q)
    return frame


def check_form(cell):
    """The closed form below holds for this shape only; anything else is refused rather than solved wrongly."""
    alpha, a, d, theta = cell.links.T
    ok = np.allclose(alpha, np.radians([0, -90, 0, -90, 90, -90]), atol=1e-9)
    ok &= np.allclose(a[[0, 4, 5]], 0) and np.allclose(d[[1, 2, 4]], 0) and np.allclose(theta[[0, 2, 3, 4]], 0) and np.isclose(theta[1], -np.pi / 2)
    if not ok:
        raise SystemExit("the plant's inverse kinematics needs an articulated arm with a spherical wrist")


def inverse(cell, flange):
    """All motor-angle solutions (up to 8, without turns) for base_from_flange."""
    _, a, d, theta = cell.links.T
    wrist = flange.pos - d[5] * flange.rot[:, 2]
    upper, fore, lift = a[2], np.hypot(a[3], d[3]), np.arctan2(a[3], d[3])
    out = []
    for shoulder in (1, -1):
        m1 = np.arctan2(shoulder * wrist[1], shoulder * wrist[0])
        r, s = shoulder * np.hypot(wrist[0], wrist[1]) - a[1], wrist[2] - d[0]
        reach = np.hypot(r, s)
        cosine = (reach**2 + upper**2 - fore**2) / (2 * upper * reach)
        if abs(cosine) > 1:
            continue
        for elbow in (1, -1):
            e2 = np.arctan2(s, r) + elbow * np.arccos(cosine)
            e3 = np.arctan2(s - upper * np.sin(e2), r - upper * np.cos(e2))
            m2, pitch = np.pi / 2 - e2, lift - e3
            arm = dh(cell.links[0], m1) @ dh(cell.links[1], m2) @ dh(cell.links[2], pitch - m2)
            m = arm.rot.T @ flange.rot @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
            for wrist_sign in (1, -1):
                m5 = np.arctan2(wrist_sign * np.hypot(m[0, 1], m[2, 1]), m[1, 1])
                m4 = np.arctan2(wrist_sign * m[2, 1], -wrist_sign * m[0, 1])
                m6 = np.arctan2(wrist_sign * m[1, 2], wrist_sign * m[1, 0]) - theta[5]
                out.append(np.array([m1, m2, pitch if cell.parallelogram else pitch - m2, m4, m5, m6]))
    return out


def copies(cell, motor):
    """The same posture with whole turns added, within the axis limits."""
    choices = [[x + t for t in (-4 * np.pi, -2 * np.pi, 0, 2 * np.pi, 4 * np.pi) if lo - 1e-9 <= x + t <= hi + 1e-9]
               for x, lo, hi in zip(motor, cell.axis_min, cell.axis_max)]
    return [np.array(c) for c in itertools.product(*choices)]


def conf_distance(motor, conf):
    """How far the quadrants are from the robtarget's confdata (axes 1, 4, 6)."""
    return sum(abs(int(np.floor(motor[axis] / (np.pi / 2) + 1e-9)) - c) for axis, c in zip((0, 3, 5), conf[:3]))


def solve_path(cell, flanges, confs):
    """Commanded motor angles along the path: first by start_deg or confdata, then nearest to the one before."""
    check_form(cell)
    out, previous = [], cell.start
    for i, (flange, conf) in enumerate(zip(flanges, confs)):
        found = [c for s in inverse(cell, flange) for c in copies(cell, s)]
        if not found:
            raise SystemExit(f"target {i + 1} is out of reach")
        if previous is None:
            best = min(found, key=lambda m: (conf_distance(m, conf), np.abs(m).max()))
        else:
            best = min(found, key=lambda m: np.linalg.norm(m - previous))
        reached = base_from_flange(cell, best)
        assert np.abs(reached.pos - flange.pos).max() < 1e-10 and np.abs(reached.rot - flange.rot).max() < 1e-8
        out.append(best)
        previous = best
    return np.array(out)
