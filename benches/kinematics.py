#!/usr/bin/env python3
"""Times forward and inverse kinematics of a table of poses of one IRB 6640-235/2.55, in turn with the packages that are there.

  benches/kinematics.py [--poses 1000000] [--runs 3]      a table on stdout: seconds, the best of the runs

Packages: deflex, py-opw-kinematics, roboticstoolbox-python, pin (Pinocchio). What takes a pose a call from Python is timed on
fewer poses and scaled up. Every answer is held against deflex's poses before it is timed.
"""
import argparse
import importlib.metadata
import importlib.util
import time

import numpy as np

import deflex

MODEL = "irb6640-235-2.55"
# Modified Denavit-Hartenberg rows (Craig) of its data sheet: alpha degrees, a mm, d mm, theta degrees.
LINKS = [(0, 0, 780, 0), (-90, 320, 0, -90), (0, 1075, 0, 0), (-90, 200, 1142.5, 0), (90, 0, 0, 0), (-90, 0, 200, 180)]
ALIKE_MM, ALIKE_DEG = 1e-3, 1e-3  # Answers to one pose agree far better; those of another robot or branch do not agree.
CALLS = 10_000  # Poses of what takes one a call: a second or so.
NEAR_DEG = 3.0  # How far from an answer an iteration starts: a target further on the path.


def best(runs, work):
    """Seconds of the quickest run, and its answer."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        answer = work()
        times.append(time.perf_counter() - start)
    return min(times), answer


class Deflex:
    """On all cores; every pose from its own start."""

    def __init__(self):
        self.robot = deflex.Robot(MODEL)

    def forward(self, q):
        return self.robot.forward(q)

    def inverse(self, poses, near):
        return self.robot.inverse(poses, near)


class Opw:
    """Closed form; `reach` gives all branches on all cores, which is quicker than `batch_inverse` and leaves the choice to the caller."""

    def __init__(self):
        from py_opw_kinematics import KinematicModel, Robot

        model = KinematicModel(a1=320, a2=-200, b=0, c1=780, c2=1075, c3=1142.5, c4=200, offsets=(0, 0, -90, 0, 0, 0))
        self.robot = Robot(model)

    def forward(self, q):
        return self.robot.batch_forward(q).as_matrix()

    def inverse(self, poses, near):
        from scipy.spatial.transform import RigidTransform

        return self.robot.reach(RigidTransform.from_matrix(poses), threads=0)


class Toolbox:
    """Robotics Toolbox for Python: forward kinematics in C over the table, Levenberg-Marquardt a pose a call."""

    def __init__(self):
        import roboticstoolbox as rtb

        rows = [rtb.RevoluteMDH(alpha=np.radians(al), a=a, d=d, offset=np.radians(th)) for al, a, d, th in LINKS]
        self.chain = rtb.DHRobot(rows).ets()

    def forward(self, q):
        return self.chain.eval(np.radians(q))

    def inverse_of_one(self, pose, near):
        return np.degrees(self.chain.ik_LM(pose, q0=np.radians(near)).q)


class Pinocchio:
    """A pose a call, each way: forward kinematics and damped Newton steps as in its own example."""

    def __init__(self):
        import pinocchio as pin

        self.pin, self.model = pin, pin.Model()
        joint, turned = 0, np.eye(4)
        for alpha, a, d, theta in LINKS:
            x = pin.SE3(pin.utils.rotate("x", np.radians(alpha)), np.array([a, 0.0, 0.0]))
            z = pin.SE3(pin.utils.rotate("z", np.radians(theta)), np.array([0.0, 0.0, d]))
            joint = self.model.addJoint(joint, pin.JointModelRZ(), x * z, f"axis {joint + 1}")
            self.model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
        self.data, self.tip = self.model.createData(), joint

    def forward_of_one(self, q):
        self.pin.forwardKinematics(self.model, self.data, np.radians(q))
        return self.data.oMi[self.tip].homogeneous

    def inverse_of_one(self, pose, near):
        pin, q, goal = self.pin, np.radians(near), self.pin.SE3(pose)
        for _ in range(20):
            pin.forwardKinematics(self.model, self.data, q)
            error = pin.log(self.data.oMi[self.tip].actInv(goal)).vector
            if np.linalg.norm(error) < 1e-6:
                break
            step = np.linalg.solve(pin.computeJointJacobian(self.model, self.data, q, self.tip), error)
            q = pin.integrate(self.model, q, step)
        return np.degrees(q)


PACKAGES = [("deflex", "deflex", Deflex), ("py_opw_kinematics", "py-opw-kinematics", Opw)]
PACKAGES += [("roboticstoolbox", "roboticstoolbox-python", Toolbox), ("pinocchio", "pin", Pinocchio)]


def forward(peer, q, runs):
    """Seconds for all of `q`, and poses of the first ones."""
    if hasattr(peer, "forward"):
        return best(runs, lambda: peer.forward(q))
    seconds, poses = best(runs, lambda: [peer.forward_of_one(one) for one in q[:CALLS]])
    return seconds * len(q) / len(poses), np.array(poses)


def inverse(peer, poses, near, runs):
    """Seconds for all of `poses`, and axes for the first ones."""
    if hasattr(peer, "inverse"):
        return best(runs, lambda: peer.inverse(poses, near))
    pairs = list(zip(poses[:CALLS], near[:CALLS]))
    seconds, axes = best(1, lambda: [peer.inverse_of_one(*pair) for pair in pairs])
    return seconds * len(poses) / len(pairs), np.array(axes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    random = np.random.default_rng(1)
    low, high = np.array([-90, -30, -30, -60, 20, -90.0]), np.array([90, 60, 30, 60, 80, 90.0])
    q = random.uniform(low, high, (arguments.poses, 6))
    near = q + random.uniform(-NEAR_DEG, NEAR_DEG, q.shape)
    expected = deflex.Robot(MODEL).forward(q)

    print("| package | forward, s | inverse, s | axes found again |\n|---|---|---|---|")
    for module, package, peer in PACKAGES:
        if importlib.util.find_spec(module) is None:
            print(f"| {package} | not installed | | |")
            continue
        peer = peer()
        forward_s, poses = forward(peer, q, arguments.runs)
        # NaN fails as well.
        assert np.abs(poses[:CALLS] - expected[: len(poses)][:CALLS]).max() < ALIKE_MM, f"{package} has another robot"
        inverse_s, axes = inverse(peer, expected, near, arguments.runs)
        found = "all branches"
        if isinstance(axes, np.ndarray):
            close = np.abs(axes[:CALLS] - q[: len(axes)][:CALLS]).max(axis=1) < ALIKE_DEG
            assert close.any(), f"{package} has another robot"
            found = f"{close.mean():.1%}"
        print(f"| {package} {importlib.metadata.version(package)} | {forward_s:.2f} | {inverse_s:.2f} | {found} |")


if __name__ == "__main__":
    main()
