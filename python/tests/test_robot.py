"""Tables of poses, Jacobians, stiffness and forces: against the command and against each other."""

import json

import numpy as np
import pytest

import deflex

Q = np.array([[0, 0, 0, 0, 30, 0], [10, 20, -5, 30, 40, -50], [-40, 35, 15, -60, -50, 120]], dtype=float)


@pytest.fixture
def cell():
    return deflex.Cell.read("samples/slot/cell.toml")


def test_forward_is_the_command_s(command, cell, tmp_path):
    poses = cell.robot.forward(Q)
    assert poses.shape == (3, 4, 4) and poses.flags.c_contiguous
    for q, pose in zip(Q, poses):
        out = tmp_path / "pose.json"
        joints = ",".join(map(repr, q.tolist()))
        command("pose", "--cell", "samples/slot/cell.toml", f"--joints={joints}", "--json", out)
        assert pose[:3, 3].tolist() == json.loads(out.read_text())["position_mm"]


def test_inverse_comes_back(cell):
    tool = np.eye(4)
    tool[:3, 3] = [10, -3, 310]
    poses = cell.robot.forward(Q, tool=tool)
    np.testing.assert_allclose(cell.robot.inverse(poses, near=Q + 0.3, tool=tool), Q, atol=1e-9)
    path = np.linspace(Q[0], Q[1], 50)
    np.testing.assert_allclose(cell.robot.inverse(cell.robot.forward(path), near=path[:1]), path, atol=1e-9)
    far = np.eye(4)
    far[:3, 3] = 1e5
    assert np.isnan(cell.robot.inverse([far])).all()
    with pytest.raises(ValueError, match=r"poses\[0\] is no pose"):
        cell.robot.inverse([2 * np.eye(4)])
    # Arrays of any layout and type.
    turned = np.asfortranarray(Q.astype(np.float32))
    np.testing.assert_allclose(cell.robot.forward(turned), cell.robot.forward(Q), atol=1e-3)


def test_jacobian_is_the_derivative(cell):
    step = 1e-5
    for q, jacobian in zip(Q, cell.robot.jacobian(Q)):
        for axis in range(6):
            there = np.array([q, q])
            there[:, axis] += np.degrees([step, -step])
            (more, less) = cell.robot.forward(there)[:, :3, 3]
            np.testing.assert_allclose(jacobian[:3, axis], (more - less) / (2 * step), atol=1e-4)


def test_stiffness_is_what_small_forces_feel(cell):
    springs = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
    stiffness = cell.robot.stiffness(Q[1:], joint_nm_per_rad=springs)
    np.testing.assert_allclose(stiffness, stiffness.transpose(0, 2, 1), rtol=1e-6, atol=1e-3)
    jacobian = cell.robot.jacobian(Q[1:])
    yields = jacobian @ np.diag(1 / (1e3 * np.array(springs))) @ jacobian.transpose(0, 2, 1)
    np.testing.assert_allclose(stiffness @ yields, np.broadcast_to(np.eye(6), (2, 6, 6)), atol=1e-6)
    with pytest.raises(ValueError, match="stiffness is not known"):
        deflex.Robot("irb6660-205-1.9").stiffness(Q)


def test_loaded_poses(cell):
    q = Q[1:2]
    tool = cell.tool(cell.tools[0] if cell.tools else None)
    free = cell.predict_poses(q)
    np.testing.assert_allclose(free, cell.robot.forward(q, tool=tool), atol=1e-6)
    force = np.array([[30.0, -20.0, 50.0]])
    moved = cell.predict_poses(q, force)[0, :3, 3] - free[0, :3, 3]
    jacobian = cell.robot.jacobian(q, tool=tool)[0, :3]
    # Springs yield as J K^-1 J^T F, to first order.
    text = cell.to_toml()
    springs = json.loads(text.split("joint_nm_per_rad = ")[1].split("]")[0].replace("\n", "") + "]")
    np.testing.assert_allclose(moved, jacobian @ np.diag(1 / (1e3 * np.array(springs))) @ jacobian.T @ force[0], rtol=0.05)


def test_poses_on_a_turned_table(cell):
    table = """
[[unit]]
name = "TABLE"
axis = "eax_b"
kind = "rotary"
carries = "part"
base_mm = [1500.0, 0.0, 600.0]
base_quat = [1.0, 0.0, 0.0, 0.0]
min = -180.0
max = 180.0
[wobjs.wTurned]
unit = "TABLE"
"""
    on_table = deflex.Cell.parse(cell.to_toml() + table)
    assert on_table.units == ["TABLE"]
    q, up = Q[[1, 1]], np.array([[0.0, 0.0, 300.0]] * 2)
    base = on_table.predict_poses(q, up)[:, :3, 3] - [1500.0, 0.0, 600.0]
    turned = on_table.predict_poses(q, up, wobj="wTurned", units={"table": [0.0, 90.0]})[:, :3, 3]
    np.testing.assert_allclose(turned[0], base[0], atol=1e-9)
    np.testing.assert_allclose(turned[1], [base[1][1], -base[1][0], base[1][2]], atol=1e-9)
    np.testing.assert_array_equal(on_table.predict_poses(q, up, wobj="wTurned", units={"TABLE": 0})[0, :3, 3], turned[0])
    for units in (None, {"TABLE": 200.0}, {"TRACK": 0.0}, {"TABLE": [1.0]}):
        with pytest.raises(deflex.DeflexError, match="TABLE|TRACK"):
            on_table.predict_poses(q, up, wobj="wTurned", units=units)


def test_cutting_force_grows_with_the_chip():
    cut = dict(diameter_mm=20.0, teeth=4, corner_radius_mm=2.0, lead_deg=5.0, ktc_n_mm2=1800.0, krc_n_mm2=900.0, kac_n_mm2=300.0)
    one, two = deflex.cutting_force(depth_mm=2.0, feed_per_tooth_mm=[0.05, 0.1], **cut)
    np.testing.assert_allclose(two, 2 * one, rtol=1e-9)
    with pytest.raises(ValueError, match="engagement 0"):
        deflex.cutting_force(depth_mm=-1.0, feed_per_tooth_mm=0.1, **cut)
