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

from deflex import _deflex
from deflex._deflex import Cell, DeflexError, Diagnostic, Effect, Program, Robot
from deflex._deflex import version as _version
from deflex._results import (
    Check,
    Correction,
    Difference,
    Identification,
    Inspection,
    PathLaw,
    Planned,
    Prediction,
    Record,
    Simulation,
)
from deflex._run import (
    check,
    compensate,
    cutting_force,
    diff,
    identify,
    identify_path,
    init,
    inspect,
    plan,
    predict,
    simulate,
)

__version__ = _version()


def _cell(text: str, name: str) -> Cell:
    return Cell.parse(text, name)


def _effect(text: str, covariance: list[list[float]] | None) -> Effect:
    return Effect.parse(text, covariance)


def _effect_parts(effect: Effect) -> tuple[str, list[list[float]] | None]:
    return effect.to_toml(), None if effect.covariance is None else effect.covariance.tolist()


def _robot(model: str, cell: Cell | None) -> Robot:
    return Robot(model) if cell is None else cell.robot


# What can be copied and sent to other processes (pickle, copy, joblib, multiprocessing), and as what.
copyreg.pickle(Cell, lambda cell: (_cell, (cell.to_toml(), cell.name)))
copyreg.pickle(Effect, lambda effect: (_effect, _effect_parts(effect)))
copyreg.pickle(Robot, lambda robot: (_robot, _deflex.robot_parts(robot)))
copyreg.pickle(Program, lambda program: (_deflex.program_of, (_deflex.program_parts(program),)))
copyreg.pickle(Diagnostic, lambda said: (_deflex.diagnostic_of, (_deflex.diagnostic_parts(said),)))

__all__ = [
    "Cell",
    "Check",
    "Correction",
    "DeflexError",
    "Diagnostic",
    "Difference",
    "Effect",
    "Identification",
    "Inspection",
    "PathLaw",
    "Planned",
    "Prediction",
    "Program",
    "Record",
    "Robot",
    "Simulation",
    "__version__",
    "check",
    "compensate",
    "cutting_force",
    "diff",
    "identify",
    "identify_path",
    "init",
    "inspect",
    "plan",
    "predict",
    "simulate",
]
