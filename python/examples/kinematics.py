"""Where the arm is stiff: the compliance along a line through the workspace, and what a force does to it."""

from pathlib import Path

import numpy as np

import deflex

SAMPLES = Path(__file__).resolve().parents[2] / "samples"

cell = deflex.Cell.read(SAMPLES / "slot/cell.toml")
robot = cell.robot
poses = np.repeat(robot.forward([[0.0, 20.0, 10.0, 0.0, 60.0, 0.0]]), 5, axis=0)
poses[:, 1, 3] += np.linspace(-300.0, 300.0, len(poses))  # mm along y
q = robot.inverse(poses, near=[[0.0, 20.0, 10.0, 0.0, 60.0, 0.0]])
stiffness = robot.stiffness(q)
loaded = cell.predict_poses(q, np.tile([0.0, 0.0, 400.0], (len(q), 1)))
free = cell.predict_poses(q)
for y, k, moved in zip(poses[:, 1, 3], stiffness, loaded[:, :3, 3] - free[:, :3, 3]):
    print(f"y = {y:7.1f} mm: {np.linalg.eigvalsh(k[:3, :3])[0]:8.0f} N/mm at least, 400 N move it {np.linalg.norm(moved):.3f} mm")

force = deflex.cutting_force(
    depth_mm=np.linspace(0.5, 2.0, 4), feed_per_tooth_mm=0.1, diameter_mm=20.0, teeth=4, corner_radius_mm=2.0, lead_deg=5.0, material="al7075"
)
print(np.round(force, 1))
