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
    "Effect",
    "Program",
    "Robot",
    "columns",
    "cutting_force",
    "diagnostic_of",
    "diagnostic_parts",
    "diff",
    "driven_path",
    "identify",
    "identify_path",
    "init",
    "inspect",
    "main",
    "page",
    "plan",
    "program_of",
    "program_parts",
    "read_table",
    "robot_parts",
    "run",
    "simulate",
    "table_text",
    "unrounded",
    "version",
    "write",
]

_Path = str | os.PathLike[str]
_Array = npt.NDArray[np.float64]
_Table = tuple[str, bytes]

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
    def effects(self) -> list[Effect]:
        """The effects that act, in order."""
    @property
    def units(self) -> list[str]:
        """Names of the mechanical units in addition to the robot."""
    @property
    def notes(self) -> list[Diagnostic]:
        """Warnings about values that are possible but seldom intended."""
    def with_effects(self, effects: Sequence[Effect]) -> Cell:
        """The same cell with exactly these effects. The text of an effect that is in the file already stays as it is."""
    def with_stiffness(self, joint_nm_per_rad: Sequence[float] | _Array) -> Cell:
        """The same cell with another stiffness of the six joints, N·m/rad. The factors of its `joint_stiffness` effect stay."""
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
class Effect:
    """A physical effect by which the real arm differs from the nominal one, with P parameters."""

    @staticmethod
    def parse(text: str, covariance: Sequence[Sequence[float]] | None = None) -> Effect:
        """Reads the keys of an `[[effect]]` table, with `kind`."""
    def to_toml(self) -> str:
        """The keys of its `[[effect]]` table."""
    @property
    def kind(self) -> str:
        """Name of the effect in cell files."""
    @property
    def names(self) -> list[str]:
        """Keys of the parameters in the cell file, with their index: `half_gap_rad[0]`."""
    @property
    def units(self) -> list[str]:
        """Units of the parameters."""
    @property
    def values(self) -> _Array:
        """Values of the parameters, (P,), in their units."""
    @property
    def prior_mean(self) -> _Array:
        """Means of the physical priors, (P,): the values at which the effect does nothing."""
    @property
    def prior_std(self) -> _Array:
        """Standard deviations of the physical priors, (P,): typical sizes on real robots."""
    @property
    def bounds(self) -> _Array:
        """Physical bounds, (P, 2)."""
    @property
    def covariance(self) -> _Array | None:
        """Covariance of the parameters, (P, P), if the cell states one. Effects with numbers that are not fitted one by one have more rows."""
    def with_values(self, values: Sequence[float] | _Array) -> Effect:
        """The same effect with other values of its parameters, (P,), and without covariance."""

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

_Progress = Callable[[int, int], object] | None
_Reading = tuple[str | None, str | None, float | None]

def read_table(path: _Path) -> tuple[str, bytes]: ...
def table_text(columns: Sequence[tuple[str, _Array | npt.NDArray[np.int64] | Sequence[str]]]) -> bytes: ...
def columns(csv: bytes) -> dict[str, npt.NDArray[Any]]: ...
def run(call: dict[str, Any], progress: _Progress) -> dict[str, Any]: ...
def page(call: dict[str, Any]) -> str: ...
def unrounded(call: dict[str, Any]) -> dict[str, _Array]: ...
def driven_path(call: dict[str, Any]) -> bytes: ...
def write(files: Sequence[tuple[_Path, bytes]], program: Program | None, cell: Cell | None) -> None: ...
def diff(original: Program, corrected: Program) -> dict[str, Any]: ...
def inspect(paths: Sequence[_Path], context: Sequence[_Path], format: str | None) -> dict[str, Any]: ...
def init(robot: str | None, urdf: _Path | None, tip: str | None, backup: _Path | None) -> str: ...
def simulate(call: dict[str, Any], progress: _Progress) -> dict[str, Any]: ...
def identify(
    runs: Sequence[tuple[Program, Program | None, _Table]],
    poses: Sequence[_Table],
    cell: Cell,
    reading: _Reading,
    sparse: bool,
    progress: _Progress,
) -> dict[str, Any]: ...
def identify_path(logs: Sequence[tuple[Program, _Table]], cell: Cell, reading: _Reading) -> dict[str, Any]: ...
def plan(
    cell: Cell,
    rows: int,
    pool: Sequence[Program],
    after: str | None,
    written: tuple[str, str | None, str],
    progress: _Progress,
) -> dict[str, Any]: ...
def diagnostic_parts(message: Diagnostic) -> tuple[Any, ...]: ...
def diagnostic_of(parts: tuple[Any, ...]) -> Diagnostic: ...
def program_parts(program: Program) -> tuple[Any, ...]: ...
def program_of(parts: tuple[Any, ...]) -> Program: ...
def robot_parts(robot: Robot) -> tuple[str, Cell | None]: ...
def cutting_force(
    mode: str,
    cutter: tuple[float, float, int, float],
    material: str | None,
    coefficients: Sequence[float | None] | None,
    engagements: _Array,
) -> _Array: ...
def main(args: Sequence[str]) -> int: ...
def version() -> str: ...
