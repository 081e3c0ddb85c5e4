"""A thin wall is milled on the plant: `thin_wall.py [--deflex BINARY] [-o FOLDER]`.

A plate of 60 × 24 × 3 mm stands on its clamped lower edge. An end mill takes 1 mm off one side and 1 mm off the other, 1 mm deep at a time, down to
a wall of 1 mm. Writes two cells, with and without `[part.material]`, and the program; has `deflex compensate` correct it by either; mills the wall
with all three programs; and prints how far its two faces are off when the wall has sprung back.

Nothing here is deflex's. The wall is a solid of hexahedra of 20 nodes, without those that have been cut away: deflex has cells of 8 nodes with incompatible
modes on a grid of its own. The cut is a sum over half-millimetre slices of the flank, each as deep as tool and wall leave it: deflex has one place at each target.
The arm bends under the whole force and its moment. What all slices push is brought to rest together.
"""

import argparse
import itertools
import pathlib
import subprocess
import tempfile

import numpy as np

from kinematics import base_from_flange, solve_path
from program import MM, Frame, read_cell, read_program

# mm, N. The blank, its two faces when they are finished, and the lowest level that is cut.
LENGTH, HEIGHT, BLANK, FACES, DEPTH, STEP = 60.0, 24.0, 3.0, (1.0, 2.0), 24.0, 1.0
E, NU = 71000.0, 0.33
RADIUS, TEETH, FEED = 5.0, 3, 0.06
# Al 7050/7075: tangential, radial, axial; of the chip's area (N/mm²), and of its edge (N/mm).
CHIP, EDGE = np.array([796.0, 169.0, 222.0]), np.array([28.0, 31.0, 1.4])
SPACING, SLICE = 2.0, 0.5

CELL = """[robot]
model = "irb6660-205-1.9"
start_deg = [-5, 20, 20, 0, 60, 0]
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[limits]
max_correction_mm = 2.0
max_step_mm = 2.0
[controller]
compensates = []
[cut]
force = "mechanistic"
max_cutting_feed_mm_s = 100.0
[cut.cutter]
diameter_mm = 10.0
corner_radius_mm = 0.0
teeth = 3
[cut.engagement]
mode = "stock"
feed_per_tooth_mm = 0.06
[cut.coefficients]
material = "al7075"
[stock]
wobj = "wWall"
box_mm = [[0.0, 0.0, -24.0], [60.0, 3.0, 0.0]]
resolution_mm = 0.25
"""
PART = """[part]
cell_mm = 0.5
stages = 48
[part.material]
e_n_mm2 = 71000.0
nu = 0.33
[[part.clamp]]
box_mm = [[0.0, 0.0, -24.0], [60.0, 3.0, -24.0]]
stiffness_n_per_mm = [inf, inf, inf]
"""


def passes():
    """Each pass: side (0 at low y, 1 at high y), the tip's y and z, the direction along x. The wall is on the right hand: the teeth cut downwards."""
    for side in (1, 0):
        for level in range(1, round(DEPTH / STEP) + 1):
            yield side, FACES[side] + (RADIUS if side else -RADIUS), -STEP * level, 1.0 if side else -1.0


def program():
    axes = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
    text = "MODULE Wall\n  PERS tooldata tEnd:=[TRUE,[[0,0,300],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n"
    text += '  PERS wobjdata wWall:=[FALSE,TRUE,"",[[1250,-120,620],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n  PROC main()\n    ConfL\\Off;\n'

    def line(x, y, z, speed):
        return f"    MoveL [[{x:.3f},{y:.3f},{z:.3f}],[0,0,1,0],[0,0,0,0],{axes}],{speed},z0,tEnd\\WObj:=wWall;\n"

    for _, y, z, along in passes():
        there = np.arange(-8.0, LENGTH + 8.5, 4.0)
        xs = there if along > 0 else there[::-1]
        text += line(xs[0], y, 20.0, "v500") + line(xs[0], y, z, "v200")
        text += "".join(line(x, y, z, "v20") for x in xs[1:]) + line(xs[-1], y, 20.0, "v500")
    return text.replace("MoveL", "MoveJ", 1) + "  ENDPROC\nENDMODULE\n"


class Wall:
    """Deflection along y of a solid wall that is clamped along its lower edge: hexahedra of 20 nodes, 2 × 1 × 1 mm along x, y and z.

    Every pass goes along the whole wall, so that all slices of it along x are alike before and after a pass. The equations are a chain of
    equal blocks, one for the nodes at each x, and are solved from both ends.
    """

    def __init__(self):
        self.slices, self.rows, self.layers = round(LENGTH / SPACING), round(HEIGHT / STEP), round(BLANK / STEP)
        self.corners = [c for c in itertools.product((-1, 0, 1), repeat=3) if c.count(0) < 2]
        self.element = self.stiffness()
        # Nodes of a slice, in half elements (x, y, z): at its low end, within it, at its high end. The lowest are clamped.
        lattice = itertools.product((0, 1, 2), range(2 * self.layers + 1), range(1, 2 * self.rows + 1))
        nodes = sorted(n for n in lattice if sum(i % 2 for i in n) < 2)
        self.node = {n: i for i, n in enumerate(nodes)}
        self.at = [np.array([i for n, i in self.node.items() if n[0] == x]) for x in (0, 1, 2)]
        self.known = {}

    def stiffness(self):
        """Of one element, N/mm, by Gauss's rule with three points along each axis."""
        size = np.array([SPACING, STEP, STEP])
        corners = np.array(self.corners, float)
        law = np.zeros((6, 6))
        law[:3, :3] = NU
        law[range(6), range(6)] = [1 - NU] * 3 + [(1 - 2 * NU) / 2] * 3
        law *= E / ((1 + NU) * (1 - 2 * NU))

        def shapes(at):
            own = np.where(corners == 0, 1 - at**2, (1 + corners * at) / 2).prod(1)
            return np.where((corners == 0).any(1), own, own * ((corners * at).sum(1) - 2))

        points, weights = np.polynomial.legendre.leggauss(3)
        total = np.zeros((60, 60))
        for at in itertools.product(range(3), repeat=3):
            place, step = points[list(at)], 1e-4
            slope = np.array([(shapes(place + step * d) - shapes(place - step * d)) / (2 * step) for d in np.eye(3)]) * (2 / size)[:, None]
            strain = np.zeros((6, 20, 3))
            for row, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]):
                strain[row, :, i] = slope[j]
                strain[row, :, j] = slope[i]
            strain = strain.reshape(6, 60)
            total += strain.T @ law @ strain * weights[list(at)].prod() * size.prod() / 8
        return total

    def block(self, passes_done):
        """Stiffness of a slice, N/mm, its inner nodes free: low end, coupling, high end."""
        there = np.ones((self.layers, self.rows))
        for side, _, level, _ in list(passes())[:passes_done]:
            there[-1 if side else 0, self.rows + round(level / STEP)] = 0.0
        matrix = np.zeros((3 * len(self.node),) * 2)
        for y, z in itertools.product(range(self.layers), range(self.rows)):
            own = [(1 + c[0], 2 * y + 1 + c[1], 2 * z + 1 + c[2]) for c in self.corners]
            free = [k for k, n in enumerate(own) if n in self.node]
            at = (3 * np.array([self.node[own[k]] for k in free])[:, None] + np.arange(3)).ravel()
            here = (3 * np.array(free)[:, None] + np.arange(3)).ravel()
            # What is cut away is as good as nothing.
            matrix[np.ix_(at, at)] += self.element[np.ix_(here, here)] * max(there[y, z], 1e-8)
        low, inner, high = ((3 * at[:, None] + np.arange(3)).ravel() for at in self.at)
        ends = np.r_[low, high]
        matrix = matrix[np.ix_(ends, ends)] - matrix[np.ix_(ends, inner)] @ np.linalg.solve(matrix[np.ix_(inner, inner)], matrix[np.ix_(inner, ends)])
        n = len(low)
        return matrix[:n, :n], matrix[:n, n:], matrix[n:, n:]

    def compliance(self, passes_done):
        """Of each face's height at each x, mm/N, under forces there and at the next nodes to low x and to high x: [side, x, which, z, z]."""
        if passes_done not in self.known:
            first, coupling, last = self.block(passes_done)
            blocks = [first] + [first + last] * (self.slices - 1) + [last]
            ends = sorted(n for n in self.node if n[0] == 0)
            face = [[3 * ends.index((0, 2 * round(y / STEP), 2 * k)) + 1 for k in range(1, self.rows + 1)] for y in FACES]
            unit = np.eye(len(first))[:, sum(face, [])]
            # What all slices at lower x add to the block at an x; from the other end it is the mirror image.
            added, inverse = [np.zeros_like(first)], []
            for block in blocks[:-1]:
                inverse.append(np.linalg.inv(block - added[-1]))
                added.append(coupling.T @ inverse[-1] @ coupling)
            mirror = np.tile([-1.0, 1.0, 1.0], len(first) // 3)
            mirror = mirror[:, None] * mirror
            out = np.zeros((2, self.slices + 1, 3, self.rows + 1, self.rows + 1))
            for i, block in enumerate(blocks):
                moved = np.linalg.solve(block - added[i] - mirror * added[self.slices - i], unit)
                lower = -inverse[i - 1] @ (coupling @ moved) if i else moved
                for side in (0, 1):
                    own = slice(side * self.rows, (side + 1) * self.rows)
                    out[side, i, 0, 1:, 1:] = moved[face[side], own]
                    out[side, i, 1, 1:, 1:] = lower[face[side], own].T
            out[:, :, 2] = out[:, ::-1, 1]
            self.known[passes_done] = out
        return self.known[passes_done]


def cut(depth, side, ahead):
    """Mean force on the tool, N a millimetre of flank, at radial depths (mm): along x, y and the axis. The wall goes on for `ahead` mm."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 721)
    angle = (angle[1:] + angle[:-1]) / 2
    # Where a tooth is, seen with the feed along x and the wall on the right; clockwise, as seen from the spindle.
    out, forward = np.array([np.cos(angle), np.sin(angle)]), np.array([np.sin(angle), -np.cos(angle)])
    tangential, radial, axial = CHIP[:, None] * FEED * np.cos(angle) + EDGE[:, None]
    force = np.vstack([-tangential * forward - radial * out, -axial]) * TEETH / (2 * np.pi) * (angle[1] - angle[0])
    met = np.sin(angle)[None, :] < np.asarray(depth)[:, None] / RADIUS - 1
    met &= RADIUS * np.cos(angle) < ahead
    force = met @ force.T
    return force * ([1, 1, 1] if side else [-1, -1, 1])


class Mill:
    """The arm, and the wall as it is."""

    def __init__(self, cell, wall, is_rigid):
        self.cell, self.wall, self.is_rigid = cell, wall, is_rigid
        self.z = np.arange(-HEIGHT + SLICE / 2, 0, SLICE)
        self.x = np.linspace(0, LENGTH, wall.slices + 1)
        # Of each face, the free wall, mm.
        self.face = np.tile(np.array([0.0, BLANK])[:, None, None], (1, len(self.x), len(self.z)))
        knots = np.linspace(-HEIGHT, 0, wall.rows + 1)
        self.to_slices = np.array([np.interp(self.z, knots, row) for row in np.eye(len(knots))]).T
        self.depths = np.linspace(0, RADIUS, 501)

    def arm(self, motor, tool, world):
        """Shift and turn of the tip, mm and rad, work object axes, under a force (N) and moment (N mm) there: 6 × 6."""
        def tip(q):
            return world.inv() @ self.cell.world_from_base @ base_from_flange(self.cell, q) @ tool.flange_from_tcp

        at, columns = tip(motor), []
        for joint in range(6):
            moved = tip(motor + 1e-6 * np.eye(6)[joint])
            turn = moved.rot @ at.rot.T
            columns.append(np.r_[(moved.pos - at.pos) / MM, [turn[2, 1], turn[0, 2], turn[1, 0]]] / 1e-6)
        jacobian = np.array(columns).T
        return jacobian @ np.diag(1 / (self.cell.stiffness / MM)) @ jacobian.T

    def run(self, path):
        program = read_program(path)
        tools, wobjs = {**self.cell.tools, **program.tools}, {**self.cell.wobjs, **program.wobjs}
        moves = program.moves
        flanges = [self.cell.world_from_base.inv() @ wobjs[m.wobj] @ m.wobj_from_tcp @ tools[m.tool].flange_from_tcp.inv() for m in moves]
        motor = solve_path(self.cell, flanges, [m.conf for m in moves])
        cutting = [k for k, m in enumerate(moves) if m.speed_m_s < 0.1]
        starts = [k for k in cutting if k - 1 not in cutting]
        angle = np.arcsin(np.linspace(-1, (FACES[0] - RADIUS) / RADIUS, 100))
        reach = RADIUS * np.cos(angle).mean() / SPACING
        for done, ((side, _, _, along), start) in enumerate(zip(passes(), starts, strict=True)):
            end = start
            while end + 1 in cutting:
                end += 1
            own = range(start - 1, end + 1)
            tips = np.array([moves[k].wobj_from_tcp.pos / MM for k in own])
            axes = np.array([-moves[k].wobj_from_tcp.rot[:, 2] for k in own])
            order = np.argsort(tips[:, 0])
            arms = {k: self.arm(motor[k], tools[moves[k].tool], wobjs[moves[k].wobj]) for k in (start, end)}
            # From as it was before the pass to as it is after it, evenly as the tool goes along.
            before, after = (self.wall.compliance(done + n)[side] for n in (0, 1))
            for i, x in enumerate(self.x):
                at = [np.interp(x, tips[order, 0], values[order]) for values in (*tips.T, *axes.T)]
                share = x / LENGTH if tips[0, 0] < tips[-1, 0] else 1 - x / LENGTH
                arm = arms[start] * (1 - share) + arms[end] * share
                wall = before[i] * (1 - share) + after[i] * share
                # The force acts in front of where the face is left.
                wall = wall[0] * (1 - reach) + wall[1 if along < 0 else 2] * reach
                wall = self.to_slices @ wall @ self.to_slices.T * (0.0 if self.is_rigid else 1.0)
                self.settle(side, i, np.array(at), (1 - share) * LENGTH, arm, wall)
        return self

    def settle(self, side, i, at, ahead, arm, wall):
        """Brings tool and wall to rest at one place, and removes what the flank has passed."""
        sign = 1.0 if side else -1.0
        height = self.z - at[2]
        there = height > 0
        free = at[1] + at[4] * height - sign * RADIUS
        table = cut(self.depths, side, ahead) * SLICE
        # What a force on the tool at one height moves the flank at another by, and the wall, on which it acts the other way.
        zero, one = np.zeros_like(height), np.ones_like(height)
        wrench = np.array([[one, zero, zero], [zero, one, zero], [zero, zero, one], [zero, -height, zero], [height, zero, zero], [zero, zero, zero]])
        flank = np.einsum("iw,wkj->ijk", arm[1] - np.outer(height, arm[3]), wrench)
        flank_and_wall = flank.copy()
        flank_and_wall[:, :, 1] += wall
        # How deep each slice of the flank is in the material, where it is above zero: Newton's steps, for the force rises with it.
        depth = np.where(there, sign * (self.face[side][i] - free), -1.0)
        start = depth.copy()

        def left(depth):
            force = np.array([np.interp(depth, self.depths, table[:, k]) * (depth > 0) for k in range(3)]).T
            return depth - start + sign * np.einsum("ijk,jk->i", flank_and_wall, force) * there, force

        now, force = left(depth)
        for _ in range(100):
            if np.abs(now).max() < 1e-9:
                break
            cell = np.clip((depth / self.depths[1]).astype(int), 0, len(self.depths) - 2)
            slope = (table[cell + 1] - table[cell]) / self.depths[1] * (depth > 0)[:, None]
            step = np.linalg.solve(np.eye(len(depth)) + sign * np.einsum("ijk,jk->ij", flank_and_wall, slope) * there[:, None], now)
            for share in 0.5 ** np.arange(12):
                tried, by = left(depth - share * step)
                if np.linalg.norm(tried) < np.linalg.norm(now):
                    break
            depth, now, force = depth - share * step, tried, by
        else:
            raise SystemExit(f"tool and wall find no rest: {np.abs(now).max()} mm")
        cut_to = free + np.einsum("ijk,jk->i", flank, force) + wall @ force[:, 1]
        face = self.face[side][i]
        self.face[side][i] = np.where(there, sign * np.minimum(sign * face, sign * cut_to), face)

    def deviation(self):
        """Of both faces where they are cut, mm: above zero material is left."""
        cut = self.z > -DEPTH
        return np.concatenate([(FACES[0] - self.face[0][:, cut]).ravel(), (self.face[1][:, cut] - FACES[1]).ravel()])


def rms(v):
    return float(np.sqrt(np.mean(v**2)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--deflex", default="target/release/deflex")
    parser.add_argument("-o", "--out", type=pathlib.Path)
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = a.out or pathlib.Path(scratch)
        out.mkdir(parents=True, exist_ok=True)
        (out / "arm.toml").write_text(CELL)
        (out / "wall.toml").write_text(CELL + PART)
        (out / "wall.mod").write_text(program())

        def corrected(by):
            there = out / f"{by}.mod"
            words = [a.deflex, "compensate", out / "wall.mod", "--cell", out / f"{by}.toml", "-o", there, "--report", out / f"{by}.csv"]
            subprocess.run([*words, "--subdivide", "0.001", "--quiet"], check=True, stderr=subprocess.DEVNULL)
            return there

        wall = Wall()

        def milled(path, is_rigid=False):
            return Mill(read_cell(out / "arm.toml"), wall, is_rigid).run(path).deviation()

        runs = [
            ("as programmed, a wall that does not yield", milled(out / "wall.mod", True)),
            ("as programmed", milled(out / "wall.mod")),
            ("corrected for the arm", milled(corrected("arm"))),
        ]
        (out / "wall.corrected.toml").write_text(CELL + PART)
        by_part = milled(corrected("wall.corrected"))
    runs.append(("corrected for arm and part", by_part))
    print(f"{'':45}  rms (mm)  largest (mm)  rms without the last {2 * SPACING:.0f} mm at either end (mm)")
    inner = [off.reshape(2, round(LENGTH / SPACING) + 1, -1)[:, 2:-2] for _, off in runs]
    for (name, off), within in zip(runs, inner, strict=True):
        print(f"{name:45}  {rms(off):8.4f}  {np.abs(off).max():12.4f}  {rms(within):8.4f}")
    for where, (arm, part) in (("all", (runs[2][1], by_part)), ("without the ends", (inner[2], inner[3]))):
        print(f"of the deviation by the wall {100 * (1 - rms(part) / rms(arm)):.1f} % is gone ({where})")


if __name__ == "__main__":
    main()
