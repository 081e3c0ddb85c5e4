"""Corrects a program, says where it would have been worst, and judges what was written."""

import tempfile
from pathlib import Path

import numpy as np

import deflex

SAMPLES = Path(__file__).resolve().parents[2] / "samples"

cell = deflex.Cell.read(SAMPLES / "slot/cell.toml")
program = deflex.Program.read(SAMPLES / "slot/slot.mod")
done = deflex.compensate(program, cell)
print(done)

worst = int(np.argmax(done.report["error_mm"]))
print(f"worst at target {done.report['target'][worst]}, line {done.report['line'][worst]}: {done.report['error_mm'][worst]} mm")

with tempfile.TemporaryDirectory() as folder:
    written = Path(folder) / "corrected.mod"
    done.write(written)
    judged = deflex.predict(written, cell, against=program)
print(f"after the correction: {judged.summary['max_error_mm']:.6f} mm at most")
