"""Three arms as their makers' data sheets and a structural model have them. Lengths in m, angles in rad, forces in N.

The rows of each chain are modified DH (Craig), as cell files declare them. Sections of links are given by how much softer they are than the gear
of their joint: 0.1 means that bending over the link's length turns its end by a tenth of what the gear does under the same moment.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Robot:
    label: str
    parallelogram: bool
    rows_mm_deg: list  # alpha_deg, a_mm, d_mm, theta_deg
    axis_min_deg: list
    axis_max_deg: list
    stiffness: list  # N m/rad at the motors, as the cell declares it
    tool_mm: list
    tool_kg: float
    centre_mm: list  # of the work, base axes
    force_n: float  # a typical cutting force
    mass_kg: list
    cog_mm: list  # of each link, in its own frame
    beam_share: list = field(default_factory=lambda: [0.05, 0.12, 0.10, 0.0, 0.0, 0.06])
    bearing_share: list = field(default_factory=lambda: [0.10, 0.12, 0.12, 0.15, 0.12, 0.10])

    @property
    def rows(self):
        return np.array(self.rows_mm_deg, float) * [np.pi / 180, 1e-3, 1e-3, np.pi / 180]

    def serial_from_motor(self):
        """q = S m: on a parallelogram motor 3 sets the forearm's angle to link 1, not to link 2."""
        matrix = np.eye(6)
        if self.parallelogram:
            matrix[2, 1] = -1.0
        return matrix

    def cell_toml(self):
        keys = ("alpha_deg", "a_mm", "d_mm", "theta_deg")
        links = "".join("  { " + ", ".join(f"{k} = {float(v)}" for k, v in zip(keys, row)) + " },\n" for row in self.rows_mm_deg)
        return (f'[robot]\nmodel = "{self.label}"\n\n[robot.kinematics]\nparallelogram = {str(self.parallelogram).lower()}\n'
                f"links = [\n{links}]\naxis_min_deg = {self.axis_min_deg}\naxis_max_deg = {self.axis_max_deg}\n\n"
                f'[robot.stiffness]\njoint_nm_per_rad = {self.stiffness}\n\n[cut]\nforce = "table"\n')


ROBOTS = [
    Robot("rod-205", True, [(0, 0, 814.5, 0), (-90, 300, 0, -90), (0, 700, 0, 0), (-90, 280, 893, 0), (90, 0, 0, 0), (-90, 0, 200, 180)],
          [-180, -42, -20, -300, -120, -360], [180, 85, 120, 300, 120, 360], [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4],
          [40, 0, 310], 30, [1300, 0, 700], 380, [500, 260, 300, 60, 30, 25],
          [[100, 0, -200], [330, 0, 20], [80, 60, 0], [10, 0, -420], [0, 30, 0], [0, 0, -60]]),
    Robot("serial-210", False, [(0, 0, 780, 0), (-90, 320, 0, -90), (0, 1075, 0, 0), (-90, 200, 1142, 0), (90, 0, 0, 0), (-90, 0, 200, 180)],
          [-185, -65, -180, -300, -130, -360], [185, 85, 70, 300, 130, 360], [1.6e6, 1.5e6, 1.2e6, 4.2e5, 3.4e5, 1.7e5],
          [60, 0, 280], 35, [1550, 0, 800], 480, [420, 210, 220, 110, 45, 25],
          [[90, 0, -220], [480, 0, 40], [110, 70, 0], [10, 0, -480], [0, 35, 0], [0, 0, -60]]),
    Robot("rod-16", True, [(0, 0, 615, 0), (-90, 100, 0, -90), (0, 705, 0, 0), (-90, 135, 755, 0), (90, 0, 0, 0), (-90, 0, 85, 180)],
          [-180, -90, -60, -300, -130, -360], [180, 110, 120, 300, 130, 360], [4.1e5, 3.6e5, 3.2e5, 9.5e4, 7.0e4, 5.2e4],
          [25, 0, 210], 9, [820, 0, 560], 170, [120, 60, 70, 15, 8, 12],
          [[50, 0, -200], [330, 0, 20], [50, 30, 0], [10, 0, -395], [0, 20, 0], [0, 0, 35]]),
]
