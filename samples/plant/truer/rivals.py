"""Plain rivals of `deflex identify`, on the same rows: a ridge regression and a Gaussian process; and the least error that is possible."""

import json

import numpy as np

import cells
from arm import NUMBERS, Arm, Numbers
from robots import ROBOTS

BLOCKS = 8  # that cross-validation leaves out in turn
PENALTIES = np.logspace(-5, 2, 36)  # mm²: columns are of typical size, so that the noise's variance would be right for columns that are all there is
MOST_ROWS = 700  # that a process is fitted to: its work grows as their cube


def read(path):
    """What `effect_columns` wrote: programmed and declared positions (n, 3), joints (n, 6), columns (n, 3, p)."""
    with open(path) as f:
        head = f.readline().strip().split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1, dtype=np.float32).astype(float)
    n = len(table) // 3
    return dict(programmed=table[:, 2].reshape(n, 3), declared=table[:, 3].reshape(n, 3), motor=table[::3, 4:10], columns=table[:, 10:].reshape(n, 3, -1), names=head[10:])


def rows(path):
    """Positions, forces, times of a measured file."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return table[:, 1:4], table[:, 4:7], table[:, 7]


def blocks(run, forces):
    """Groups of rows that belong together in posture, place and load: what another program would not share. By k-means from fixed starts."""
    inputs = np.hstack([run["motor"], run["programmed"], forces])
    inputs = (inputs - inputs.mean(0)) / np.maximum(inputs.std(0), 1e-6)
    centres = inputs[np.linspace(0, len(inputs) - 1, BLOCKS).astype(int)]
    for _ in range(20):
        nearest = np.argmin(((inputs[:, None] - centres) ** 2).sum(2), axis=1)
        centres = np.array([inputs[nearest == b].mean(0) if np.any(nearest == b) else centres[b] for b in range(BLOCKS)])
    return nearest


def ridge(part, other, off, forces):
    """Predicted errors of both programs beyond the declared cell, mm: one penalty over all columns, chosen on blocks left out."""
    x, p = part["columns"], part["columns"].shape[2]
    block = blocks(part, forces)
    gram = np.array([np.einsum("nij,nik->jk", x[block == b], x[block == b], optimize=True) for b in range(BLOCKS)])
    cross = np.array([np.einsum("nij,ni->j", x[block == b], off[block == b], optimize=True) for b in range(BLOCKS)])
    loss = np.zeros(len(PENALTIES))
    for b in range(BLOCKS):
        values, vectors = np.linalg.eigh(gram.sum(0) - gram[b])
        inside = vectors.T @ (cross.sum(0) - cross[b])
        fits = vectors @ (inside[:, None] / (np.maximum(values, 0)[:, None] + PENALTIES))
        left = off[block == b][:, :, None] - np.einsum("nij,jk->nik", x[block == b], fits, optimize=True)
        loss += np.sum(left**2, axis=(0, 1))
    best = PENALTIES[int(np.argmin(loss))]
    fit = np.linalg.solve(gram.sum(0) + best * np.eye(p), cross.sum(0))
    return x @ fit, other["columns"] @ fit


def process(part, other, off, forces):
    """The same of a Gaussian process over joints, place and force: one length, one size, one noise, by marginal likelihood."""
    inputs = [np.hstack([run["motor"], run["programmed"], force]) for run, force in zip((part, other), forces)]
    middle, spread = inputs[0].mean(0), inputs[0].std(0)
    spread = np.where(spread > 1e-6, spread, 1.0)
    a, b = ((v - middle) / spread for v in inputs)
    keep = np.unique(np.linspace(0, len(a) - 1, min(len(a), MOST_ROWS)).astype(int))
    mean = off.mean(0)
    y, near = off[keep] - mean, a[keep]
    apart = lambda u, v: np.maximum(np.sum(u**2, 1)[:, None] + np.sum(v**2, 1) - 2 * u @ v.T, 0)
    square = apart(near, near)
    best = (np.inf,)
    for length in (1.0, 2.0, 4.0, 8.0, 16.0):
        values, vectors = np.linalg.eigh(np.exp(-square / (2 * length**2)))
        inside = (vectors.T @ y) ** 2
        for noise in (1e-4, 1e-3, 1e-2, 1e-1):
            # The size that fits best stands in closed form once the noise is a share of it.
            total = np.maximum(values, 0) + noise
            size = np.mean(inside / total[:, None])
            cost = 1.5 * len(y) * np.log(size) + 1.5 * np.sum(np.log(total))
            if cost < best[0]:
                best = (cost, length, vectors @ ((vectors.T @ y) / total[:, None]))
    _, length, weights = best
    return tuple(mean + np.exp(-apart(v, near) / (2 * length**2)) @ weights for v in (a, b))


def least_errors(folder, step=0.05):
    """Expected rms errors (mm) of both programs for a method that knows every law of the plant: the Bayes estimate from the measured program.

    The laws are linearised at the true numbers. A number that is log-normal may be off by its whole typical value, as in a cell of which nothing is
    known; the others have the spread with which they are drawn. The forces are known. No method has a smaller expected error without knowing more.
    """
    truth = json.loads((folder / "truth.json").read_text())
    robot = next(r for r in ROBOTS if r.label == truth["robot"])
    table = [np.array(v) for v in truth["table"]]
    _, found = cells.drawn(robot, truth["seed"][:2] + [1])
    numbers = {tuple(key.split(" ")): np.array(v) for key, v in truth["z"].items()}
    taught = [np.array(v) for v in truth["taught"]]
    free = [(g, n, 1.0 / spread if how == "log" else 1.0) for g, n, _, _, spread, how in NUMBERS if truth["size"][g] > 0 and g != "sensor"]

    def run(name, numbers, taught):
        path, _, motor, _ = found[name]
        arm = Arm(robot, Numbers(numbers, truth["size"]), *table)
        arm.taught = taught
        return arm.run(motor, path.points, path.force, path.times()).ravel()

    def slopes(name):
        here, columns = run(name, numbers, taught), []
        for group, number, spread in free:
            for i in range(numbers[group, number].size):
                moved = numbers[group, number].copy()
                moved.flat[i] += step
                columns.append(spread * (run(name, numbers | {(group, number): moved}, taught) - here) / step)
        for i in range(6):
            moved = [v.copy() for v in taught]
            moved[i // 3][i % 3] += 1e-3 * step
            columns.append((run(name, numbers, moved) - here) / step)
        return np.column_stack(columns)

    part, other = slopes("part"), slopes("transfer")
    noise = np.hypot(truth["sigma_mm"], truth["wander_mm"])
    covariance = np.linalg.inv(part.T @ part / noise**2 + np.eye(part.shape[1]))
    return [float(np.sqrt(np.sum((x @ covariance) * x) / (len(x) / 3))) for x in (part, other)]
