#!/usr/bin/env python3
"""Writes facing.cls and facing.toml: 100,233 targets 2 mm apart that face a block of 600 x 400 mm, for `deflex compensate`.
The tool leans ahead by the degrees given.

A 25 mm bull-nose (corner 5 mm), passes 1.2 mm apart, 1.5 mm deep; the arm of benches/cell.toml, the stock at 0.5 mm.

    python3 benches/facing.py && time deflex compensate facing.cls --cell facing.toml -o facing.mod
"""
import math
import pathlib
import re
import sys

cell = (pathlib.Path(__file__).parent / "cell.toml").read_text()
for key, value in {"diameter_mm": "25.0", "corner_radius_mm": "5.0", "mode": '"stock"', "uframe_mm": "[1300.0, -200.0, 600.0]"}.items():
    cell = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", cell)
cell = re.sub(r"(?m)^(depth_mm|width_mm|lead_deg|tilt_deg) = .*\n", "", cell)
cell += '[stock]\nwobj = "wPart"\nbox_mm = [[0.0, 0.0, -40.0], [600.0, 400.0, 0.0]]\nresolution_mm = 0.5\n'
pathlib.Path("facing.toml").write_text(cell)

lean = math.radians(float(sys.argv[1]) if len(sys.argv) > 1 else 0.0)
axis = f"{math.sin(lean):.6f},0.000000,{math.cos(lean):.6f}"
with open("facing.cls", "w") as path:
    path.write("PARTNO/FACING\nUNITS/MM\nMULTAX/ON\nFEDRAT/3000,MMPM\n")
    for row in range(333):
        for k in range(301):
            x = 2 * (k if row % 2 == 0 else 300 - k)
            path.write(f"GOTO/{x:.3f},{1.2 * row:.3f},-1.500,{axis}\n")
    path.write("FINI\n")
