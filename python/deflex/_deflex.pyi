"""The compiled part of the module."""

import os
from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Cell",
    "DeflexError",
    "Diagnostic",
    "Done",
    "Found",
    "Planned",
    "Program",
    "Robot",
    "Simulated",
    "compensate",
    "cutting_force",
    "identify",
    "main",
    "plan",
    "predict",
    "simulate",
    "version",
]

_Path = str | os.PathLike[str]
_Array = npt.NDArray[np.float64]
_Table = str | os.PathLike[str] | tuple[str, str]

class DeflexError(Exception):
    """The command would end with exit code 2; `diagnostics` has the messages."""

    diagnostics: list[Diagnostic]

@final
class Diagnostic:
    """A message: what is wrong, where, and what to do."""

    @property
    def code(self) -> str:
        """Stable short name."""
    @property
    def severity(self) -> str:
        """`note`, `warning` or `error`."""
    @property
    def message(self) -> str:
        """What is wrong and what was expected."""
    @property
    def help(self) -> str | None:
        """What to do."""
    @property
    def file(self) -> str:
        """File; empty if the message is not about a file."""
    @property
    def line(self) -> int:
        """Line from 1; 0 if the message is about the whole file."""
    @property
    def column(self) -> int:
        """Column in characters, from 1."""

@final
class Cell:
    """A milling cell: the nominal robot with tools, work objects and process, and the effects of the real one."""

    @staticmethod
    def read(path: _Path) -> Cell:
        """Reads and checks a cell file."""
    @staticmethod
    def parse(text: str, name: str = "cell.toml") -> Cell:
        """Checks the text of a cell file; `name` is its name in messages."""
    def to_toml(self) -> str:
        """The text of the cell file, with its comments."""
    @property
    def name(self) -> str:
        """The file."""
    @property
    def robot(self) -> Robot:
        """The arm, with the declared stiffness."""
    @property
    def tools(self) -> list[str]:
        """Names of the declared tools, upper case."""
    @property
    def wobjs(self) -> list[str]:
        """Names of the declared work objects, upper case."""
    @property
    def effects(self) -> list[str]:
        """Kinds of the effects that act, in order."""
    @property
    def units(self) -> list[str]:
        """Names of the mechanical units in addition to the robot."""
    @property
    def notes(self) -> list[Diagnostic]:
        """Warnings about values that are possible but seldom intended."""
    def tool(self, name: str | None = None) -> _Array:
        """The TCP of a tool in the flange, (4, 4), mm; without a name, that of the cell's only tool."""
    def predict_poses(
        self,
        q: npt.ArrayLike,
        forces: npt.ArrayLike | None = None,
        *,
        tool: str | None = None,
        wobj: str | None = None,
        units: dict[str, npt.ArrayLike] | None = None,
        travel: npt.ArrayLike | None = None,
        velocity: npt.ArrayLike | None = None,
        time_s: npt.ArrayLike | None = None,
        temperature_c: npt.ArrayLike | None = None,
        cut_m: npt.ArrayLike | None = None,
    ) -> _Array:
        """The actual TCP poses of the loaded arm, (N, 4, 4), mm; NaN if there is no equilibrium.

        `q` (N, 6), commanded axis angles, degrees; `forces` (N, 3) on the tool at the TCP, N. Both forces and poses are in the
        axes of the robot's base, or of the work object `wobj`. `units` has the positions of mechanical units by their names, (N,) or
        one for all, mm or degrees. Some effects need more, as an array or as one row or value for all: `travel` (N, 6), the
        direction in which each axis arrives at the pose (only signs count); `velocity` (N, 3) of the TCP, mm/s; `time_s`,
        `temperature_c` and `cut_m`, the length cut (N,). Raises `DeflexError` if one of them is missing, or if a unit is beyond
        its limits.
        """

@final
class Program:
    """The files of one program."""

    @staticmethod
    def read(
        paths: _Path | Sequence[_Path], *, context: _Path | Sequence[_Path] | None = None, format: str | None = None
    ) -> Program:
        """Reads the files of one program; `context` are files that declare names and are never written."""
    @property
    def name(self) -> str:
        """The files as they were given."""
    @property
    def language(self) -> str:
        """`rapid`, `cl`, `krl`, `ls`, `ur` or `jbi`."""
    @property
    def files(self) -> list[str]:
        """Its files."""
    @property
    def motion_targets(self) -> int:
        """Executed motions in running order, loops with known bounds expanded."""

@final
class Robot:
    """The nominal arm, as in the controller, with the joint stiffness if a cell declares it."""

    def __new__(cls, model: str) -> Robot: ...
    @staticmethod
    def builtin() -> list[str]:
        """The models of the built-in robots."""
    @property
    def model(self) -> str:
        """Name."""
    def forward(self, q: npt.ArrayLike, *, tool: npt.ArrayLike | None = None) -> _Array:
        """Poses in the base, (N, 4, 4), mm, at axis angles `q` (N, 6), degrees."""
    def inverse(
        self, poses: npt.ArrayLike, near: npt.ArrayLike | None = None, *, tool: npt.ArrayLike | None = None
    ) -> _Array:
        """Axis angles (N, 6), degrees, that reach poses (N, 4, 4), mm, in the base; NaN if none do.

        `near` (N, 6) chooses the nearest solution for each pose. With `near` (1, 6), the poses are a path that starts there, and each
        solution is the nearest to the previous one.
        """
    def jacobian(self, q: npt.ArrayLike, *, tool: npt.ArrayLike | None = None) -> _Array:
        """Jacobians (N, 6, 6): (vx, vy, vz) mm/rad, (wx, wy, wz) rad/rad, base axes, by motor angle."""
    def stiffness(
        self,
        q: npt.ArrayLike,
        *,
        tool: npt.ArrayLike | None = None,
        joint_nm_per_rad: Sequence[float] | None = None,
    ) -> _Array:
        """Cartesian stiffness (N, 6, 6): force (N) and moment (N mm) for a displacement (mm) and a rotation (rad)."""

@final
class Done:
    @property
    def files(self) -> dict[str, bytes]: ...
    @property
    def csv(self) -> bytes: ...
    @property
    def report(self) -> dict[str, npt.NDArray[Any]]: ...
    @property
    def summary(self) -> str: ...
    @property
    def line(self) -> str: ...
    @property
    def notes(self) -> list[Diagnostic]: ...
    def write(self, files: Sequence[tuple[_Path, bytes]], inputs: Sequence[_Path]) -> None: ...
    def unrounded(self) -> dict[str, npt.NDArray[Any]]: ...
    def page(self) -> str: ...

@final
class Found:
    @property
    def json(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def csv(self) -> bytes: ...
    @property
    def residuals(self) -> dict[str, npt.NDArray[Any]]: ...
    def cell(self, name: str = "cell.toml") -> Cell: ...
    def page(self) -> str: ...

@final
class Planned:
    @property
    def json(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def program(self) -> str: ...
    @property
    def table(self) -> str: ...
    def page(self) -> str: ...

@final
class Simulated:
    @property
    def json(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def csv(self) -> bytes: ...
    @property
    def report(self) -> dict[str, npt.NDArray[Any]]: ...
    @property
    def stl(self) -> bytes: ...
    @property
    def notes(self) -> list[Diagnostic]: ...
    def page(self) -> str: ...

def simulate(
    held: tuple[Program, Cell],
    forces: _Table | None,
    against: Program | None,
    asked: dict[str, Any],
    progress: Callable[[int, int], object] | None,
) -> Simulated: ...
def predict(
    held: tuple[Program, Cell],
    forces: _Table | None,
    against: Program | None,
    asked: dict[str, Any],
    progress: Callable[[int, int], object] | None,
) -> Done: ...
def compensate(
    held: tuple[Program, Cell],
    forces: _Table | None,
    asked: dict[str, Any],
    progress: Callable[[int, int], object] | None,
) -> Done: ...
def identify(
    runs: Sequence[tuple[Program, Program | None, _Table]],
    poses: Sequence[_Table],
    cell: Cell,
    read_as: tuple[str | None, str | None, float | None],
    progress: Callable[[int, int], object] | None,
) -> Found: ...
def plan(
    cell: Cell,
    rows: int,
    pool: Sequence[Program],
    after: str | None,
    written: tuple[str, str | None, str],
    progress: Callable[[int, int], object] | None,
) -> Planned: ...
def cutting_force(
    mode: str,
    cutter: tuple[float, float, int, float],
    material: str | None,
    coefficients: Sequence[float | None] | None,
    engagements: _Array,
) -> _Array: ...
def main(args: Sequence[str]) -> int: ...
def version() -> str: ...
