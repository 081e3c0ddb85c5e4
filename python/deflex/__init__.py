"""deflex corrects robot milling programs for the deflection of the arm, and identifies the causes of errors.

>>> import deflex
>>> cell = deflex.Cell.read("samples/slot/cell.toml")
>>> done = deflex.compensate("samples/slot/slot.mod", cell)
>>> done.summary.corrected
81
>>> bool(done.report["remaining_mm"].max() < 1e-3)
True

Units are those of the command and stand in the names: millimetres, degrees, newtons. A pose is a homogeneous matrix of 4 by 4
with its position in mm; motor angles are degrees as the controller counts them.
"""

import copyreg

from deflex._deflex import Cell, DeflexError, Diagnostic, Program, Robot
from deflex._deflex import version as _version
from deflex._results import Correction, Identification, Planned, Prediction, Record, Simulation
from deflex._run import compensate, cutting_force, identify, plan, predict, simulate

__version__ = _version()


def _cell(text: str, name: str) -> Cell:
    return Cell.parse(text, name)


# A cell can be copied and sent to other processes (pickle, copy, joblib, multiprocessing): as its text.
copyreg.pickle(Cell, lambda cell: (_cell, (cell.to_toml(), cell.name)))

__all__ = [
    "Cell",
    "Correction",
    "DeflexError",
    "Diagnostic",
    "Identification",
    "Planned",
    "Prediction",
    "Program",
    "Record",
    "Robot",
    "Simulation",
    "__version__",
    "compensate",
    "cutting_force",
    "identify",
    "plan",
    "predict",
    "simulate",
]
