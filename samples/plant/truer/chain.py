"""Frames of many rows at once: rotations are (n, 3, 3), positions (n, 3). Closed-form postures of an articulated arm with a spherical wrist."""

import numpy as np


def about(axis, angle):
    """Rotation about a coordinate axis, one for each angle."""
    angle = np.atleast_1d(angle)
    c, s, out = np.cos(angle), np.sin(angle), np.zeros((len(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[:, axis, axis] = 1
    out[:, i, i] = out[:, j, j] = c
    out[:, i, j], out[:, j, i] = -s, s
    return out


def exp(v):
    """Rodrigues' formula for many rotation vectors."""
    angle = np.sqrt(np.sum(v * v, axis=-1))[..., None, None]
    k = np.zeros(v.shape[:-1] + (3, 3))
    k[..., 0, 1], k[..., 0, 2], k[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    k[..., 1, 0], k[..., 2, 0], k[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    return np.eye(3) + np.where(small, 1 - angle**2 / 6, np.sin(safe) / safe) * k + np.where(small, 0.5, (1 - np.cos(safe)) / safe**2) * (k @ k)


def quaternion(rot):
    """Unit quaternions, scalar first, by the eigenvector of the largest eigenvalue (Bar-Itzhack): no branch, no division."""
    r = rot
    k = np.zeros((len(r), 4, 4))
    k[:, 0, 0] = r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    k[:, 0, 1] = k[:, 1, 0] = r[:, 2, 1] - r[:, 1, 2]
    k[:, 0, 2] = k[:, 2, 0] = r[:, 0, 2] - r[:, 2, 0]
    k[:, 0, 3] = k[:, 3, 0] = r[:, 1, 0] - r[:, 0, 1]
    for i in range(3):
        for j in range(3):
            k[:, i + 1, j + 1] = r[:, i, j] + r[:, j, i] - (np.trace(r, axis1=1, axis2=2) if i == j else 0)
    q = np.linalg.eigh(k)[1][:, :, 3]
    return q * np.where(q[:, :1] < 0, -1, 1)


def rotation(q):
    """Rotations of quaternions, scalar first, of any length."""
    q = np.atleast_2d(np.asarray(q, float))
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    w, v = q[:, 0], q[:, 1:]
    cross = np.zeros((len(q), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    cross[:, 1, 0], cross[:, 2, 0], cross[:, 2, 1] = v[:, 2], -v[:, 1], v[:, 0]
    return np.eye(3) + 2 * w[:, None, None] * cross + 2 * cross @ cross


def step(row):
    """From a link's frame to the next joint's: rotation about x, then where the next origin lies."""
    alpha, a, d, _ = row
    return about(0, alpha)[0], np.array([a, -np.sin(alpha) * d, np.cos(alpha) * d])


def flange(robot, motor):
    """The nominal arm: rotation and position of the flange in the base."""
    serial = motor @ robot.serial_from_motor().T
    rot, pos = np.broadcast_to(np.eye(3), (len(motor), 3, 3)), np.zeros((len(motor), 3))
    for row, q in zip(robot.rows, serial.T):
        turn, offset = step(row)
        pos = pos + rot @ offset
        rot = rot @ turn @ about(2, q + row[3])
    return rot, pos


class OutOfReach(Exception):
    """The path leaves the arm's reach, its limits or its branch."""


def motors(robot, rot, pos):
    """Motor angles of flange poses along a path on one branch: the arm faces its work, elbow up, the wrist turned as at the start."""
    rows = robot.rows
    wrist = pos - rows[5, 2] * rot[:, :, 2]
    q1 = np.arctan2(wrist[:, 1], wrist[:, 0])
    out, up = np.hypot(wrist[:, 0], wrist[:, 1]) - rows[1, 1], wrist[:, 2] - rows[0, 2]
    upper, fore, cranked = rows[2, 1], np.hypot(rows[3, 1], rows[3, 2]), np.arctan2(rows[3, 1], rows[3, 2])
    reach = np.hypot(out, up)
    elbow = (upper**2 + reach**2 - fore**2) / (2 * upper * reach)
    if np.abs(elbow).max() > 0.999:
        raise OutOfReach("out of reach")
    # Angles from the horizontal: of the upper arm, and of the line from elbow to wrist.
    rise = np.arctan2(up, out) + np.arccos(elbow)
    line = np.arctan2(up - upper * np.sin(rise), out - upper * np.cos(rise))
    q2, pitch = np.pi / 2 - rise, cranked - line
    fore_rot = np.broadcast_to(np.eye(3), rot.shape)
    for row, q in zip(rows[:3], (q1, q2, pitch - q2)):
        fore_rot = fore_rot @ about(0, row[0]) @ about(2, q + row[3])
    zyz = about(0, np.pi / 2) @ np.swapaxes(fore_rot, 1, 2) @ rot
    bend = np.arctan2(np.hypot(zyz[:, 0, 2], zyz[:, 1, 2]), zyz[:, 2, 2])
    choices = []
    for sign in (1, -1):
        q4 = np.unwrap(np.arctan2(sign * zyz[:, 1, 2], sign * zyz[:, 0, 2]))
        q6 = np.unwrap(np.arctan2(sign * zyz[:, 2, 1], -sign * zyz[:, 2, 0]) - rows[5, 3])
        q4, q6 = q4 - 2 * np.pi * np.round(q4[0] / 2 / np.pi), q6 - 2 * np.pi * np.round(q6[0] / 2 / np.pi)
        choices.append(np.column_stack([q1, q2, pitch if robot.parallelogram else pitch - q2, q4, -sign * bend, q6]))
    best = min(choices, key=lambda m: np.abs(m[0, 3]))
    degrees = np.degrees(best)
    if np.any(degrees < np.array(robot.axis_min_deg) + 2) or np.any(degrees > np.array(robot.axis_max_deg) - 2):
        raise OutOfReach("beyond an axis limit")
    if np.abs(degrees[:, 4]).min() < 12:
        raise OutOfReach("near a singular wrist")
    if np.abs(np.diff(degrees, axis=0)).max(initial=0) > 150:
        raise OutOfReach("room for another branch")
    back = flange(robot, best)
    assert np.abs(back[0] - rot).max() < 1e-9 and np.abs(back[1] - pos).max() < 1e-10
    return best
