"""The results of the commands."""

import html
import json
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy.typing as npt

from deflex._deflex import Cell, Diagnostic, Done, Found
from deflex._deflex import Planned as _Planned
from deflex._deflex import Simulated as _Simulated

Report = dict[str, npt.NDArray[Any]]


class Record(dict[str, Any]):
    """An object of the command's JSON: its keys are attributes too.

    >>> Record(rms_mm=0.5).rms_mm
    0.5
    """

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]


def record(text: str) -> Record:
    """The objects of a JSON text."""
    found: Record = json.loads(text, object_hook=Record)
    return found


def _framed(page: str) -> str:
    """A whole page in a frame of a notebook."""
    return f'<iframe srcdoc="{html.escape(page)}" style="width:100%;height:720px;border:0" loading="lazy"></iframe>'


class _Run:
    """The result for one program."""

    def __init__(self, done: Done) -> None:
        self._done = done

    @cached_property
    def report(self) -> Report:
        """The columns of the command's CSV report, one row for each target, with its names, units and digits. `unrounded` has
        all digits. The arrays are read-only.

        `target` and `line` are int64, `name` and `status` str, all others float64 of shape (N,); NaN where the report has
        no figure.
        """
        return self._done.report

    @cached_property
    def unrounded(self) -> Report:
        """The report's columns of numbers with all digits, (N,), float64: `q1_deg`, `error_x_mm`, ….

        deflex processes the program again for this. NaN where the report has no figure.
        """
        return self._done.unrounded()

    @cached_property
    def summary(self) -> Record:
        """The summary of the program, as in `--json`."""
        return record(self._done.summary)

    @property
    def notes(self) -> list[Diagnostic]:
        """Notes and warnings, which the command prints on stderr."""
        return self._done.notes

    @property
    def csv(self) -> str:
        """The report as the command writes it."""
        return self._done.csv.decode()

    @property
    def html(self) -> str:
        """The page: the toolpath in 3-D with its errors, complete in one file."""
        return self._done.page()

    def _repr_html_(self) -> str:
        return _framed(self.html)

    def __repr__(self) -> str:
        summary = self.summary
        said = f"{self._done.line}; error rms {summary.rms_error_mm:.4f} mm, max {summary.max_error_mm:.4f} mm"
        return f"<{type(self).__name__} of {summary.path}: {said}{self._remaining()}>"

    def _remaining(self) -> str:
        return ""


class Prediction(_Run):
    """The predicted errors of a program."""


class Correction(_Run):
    """A corrected program with its report."""

    @cached_property
    def files(self) -> dict[str, bytes]:
        """The bytes of the corrected program's files, by name."""
        return self._done.files

    @property
    def text(self) -> str:
        """The corrected program, or the first of its files: read as UTF-8 if it is, otherwise as ISO 8859-1."""
        data = next(iter(self.files.values()))
        try:
            return data.decode()
        except UnicodeDecodeError:
            return data.decode("latin-1")

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the program to `path`, or its files into the folder `path`: all or none, by the writer of the command.

        A program of several files needs a folder, which is made where missing. Files are replaced as `deflex compensate` replaces
        them: through symbolic links and under all their names, never where they are read-only or inputs of this run
        (`DeflexError`).
        """
        target = Path(path)
        if len(self.files) == 1 and not target.is_dir():
            self._done.write([(target, next(iter(self.files.values())))], [])
            return
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(f"{target} is a file: the program has {len(self.files)}, which need a folder")
        self.write_into(target, self.files)

    def write_into(self, folder: str | os.PathLike[str], files: Mapping[str, bytes]) -> None:
        """Writes files by their names into a folder, which is made where missing, as one set: all or none."""
        paths = [(Path(folder) / name, data) for name, data in files.items()]
        for path, _ in paths:
            path.parent.mkdir(parents=True, exist_ok=True)
        self._done.write(paths, [])

    def _remaining(self) -> str:
        return f"; remaining at targets max {self.summary.max_remaining_mm:.6f} mm"


class Identification:
    """The effects that a cell lacks.

    Everything that `deflex identify --json` says stands in `json`; the most used parts are attributes.
    """

    def __init__(self, found: Found, name: str) -> None:
        self._found = found
        self._name = name

    @cached_property
    def json(self) -> Record:
        """The whole answer, as `--json` writes it."""
        return record(self._found.json)

    @property
    def added(self) -> list[Record]:
        """The effects that were added: kind, posterior, parameters with intervals, and the effects that they may be instead."""
        found: list[Record] = self.json["added"]
        return found

    @property
    def before(self) -> Record:
        """`rms_mm`, `mean_mm`, `max_mm` of the declared cell on held-out rows."""
        found: Record = self.json["before"]
        return found

    @property
    def after(self) -> Record:
        """The same of the extended cell."""
        found: Record = self.json["after"]
        return found

    @property
    def ranking(self) -> list[Record]:
        """Each kind of effect alone, the best first."""
        found: list[Record] = self.json["ranking"]
        return found

    @property
    def advice(self) -> list[str]:
        """What to measure next, and why."""
        found: list[str] = self.json["advice"]
        return found

    @cached_property
    def cell(self) -> Cell:
        """The extended cell, with the comments of the declared one."""
        return self._found.cell(self._name)

    @cached_property
    def residuals(self) -> Report:
        """The columns of the command's `--report`: residuals of each row, mm; `target` is 0 between targets."""
        return self._found.residuals

    @property
    def text(self) -> str:
        """The answer as the command prints it."""
        return self._found.text

    @property
    def csv(self) -> str:
        """The residuals as the command writes them."""
        return self._found.csv.decode()

    @property
    def html(self) -> str:
        """The page with the residuals, the effects and the remaining error, complete in one file."""
        return self._found.page()

    def _repr_html_(self) -> str:
        return _framed(self.html)

    def __repr__(self) -> str:
        return f"<Identification: {self.text.partition(chr(10))[0]}>"


class Planned:
    """A planned measurement.

    Everything that `deflex plan --json` says stands in `json`.
    """

    def __init__(self, planned: _Planned) -> None:
        self._planned = planned

    @cached_property
    def json(self) -> Record:
        """The whole plan, as `--json` writes it: `rows`, `pairs`, `weakest`, `chance_right`, …"""
        return record(self._planned.json)

    @property
    def program(self) -> str:
        """The program: each motion ends where a row is measured."""
        return self._planned.program

    @property
    def table(self) -> str:
        """The table to fill in, as CSV: target, load and time of each row, measured columns empty."""
        return self._planned.table

    @property
    def text(self) -> str:
        """The plan as the command prints it."""
        return self._planned.text

    @property
    def html(self) -> str:
        """The page, complete in one file."""
        return self._planned.page()

    def _repr_html_(self) -> str:
        return _framed(self.html)

    def __repr__(self) -> str:
        return f"<Planned: {self.text.partition(chr(10))[0]}>"


class Simulation:
    """The part as the loaded arm cuts it from the stock, compared with the programmed part."""

    def __init__(self, simulated: _Simulated) -> None:
        self._simulated = simulated

    @cached_property
    def summary(self) -> Record:
        """The figures, as in `deflex simulate --json`: `rms_mm`, `mean_mm`, `max_mm`, `gouge`, `leftover`, `removed_mm3`, …"""
        return record(self._simulated.json)

    @cached_property
    def report(self) -> Report:
        """Points of the cut surface, by column: `x_mm`, `y_mm`, `z_mm` in the stock's frame and `deviation_mm` (above zero: left over), (N,)."""
        return self._simulated.report

    @property
    def csv(self) -> str:
        """The points as the command writes them."""
        return self._simulated.csv.decode()

    @property
    def stl(self) -> bytes:
        """The part as it will be cut, binary STL, mm."""
        return self._simulated.stl

    @property
    def notes(self) -> list[Diagnostic]:
        """Notes and warnings, which the command prints on stderr."""
        return self._simulated.notes

    @property
    def text(self) -> str:
        """The figures as the command prints them."""
        return self._simulated.text

    @property
    def html(self) -> str:
        """The page: the part in 3-D, coloured by its deviation, complete in one file."""
        return self._simulated.page()

    def _repr_html_(self) -> str:
        return _framed(self.html)

    def __repr__(self) -> str:
        return f"<Simulation of {self.text.rstrip()}>"
