"""The results of the commands."""

import html
import json
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, cast

from deflex import _deflex
from deflex._columns import DrivenPath, Moved, Numbers, Report, Residuals, SurfacePoints
from deflex._deflex import Cell, Diagnostic, Program

if TYPE_CHECKING:
    import pandas


class Record(dict[str, Any]):
    """An object of the command's JSON: its keys are attributes too.

    >>> Record(rms_mm=0.5).rms_mm
    0.5
    """

    # Type checkers know the declared attributes alone, so that they find a misspelt one.
    if not TYPE_CHECKING:

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


class Summary(Record):
    """The summary of a program, as in `--json`: counts of targets, and sizes in mm."""

    path: str
    targets: int
    corrected: int
    unchanged: int
    air: int
    along: int
    inserted: int
    kept: list[Record]
    unjudged: list[Record]
    max_error_mm: float
    rms_error_mm: float
    max_correction_mm: float
    max_along_mm: float
    max_remaining_mm: float
    max_kept_mm: float
    remaining_path_max_mm: float
    remaining_path_rms_mm: float
    failures: list[Record]
    sources: list[Record]


class Verdict(Record):
    """The judgement of one program, as in `deflex check --json`."""

    path: str
    targets: int
    judged: int
    air: int
    unjudged: list[Record]
    passed: bool
    verdicts: Record
    findings: list[Record]
    more_findings: int
    sources: list[Record]


class Errors(Record):
    """Errors of a cell on held-out rows."""

    rms_mm: float
    mean_mm: float
    max_mm: float


class Parameter(Record):
    """A parameter of an effect that was added, with its 95 % interval."""

    name: str
    value: float
    unit: str
    ci95: list[float]


class Added(Record):
    """An effect that was added."""

    kind: str
    posterior: float
    held_out_rms_before_mm: float
    held_out_rms_after_mm: float
    parameters: list[Parameter]
    not_told_apart_from: list[str]


class Ranked(Record):
    """A kind of effect alone."""

    kind: str
    held_out_rms_mm: float
    delta_bic: float


class Figures(Record):
    """The figures of a simulation, as in `deflex simulate --json`."""

    path: str
    resolution_mm: float
    removed_programmed_mm3: float
    removed_mm3: float
    left_mm3: float
    rms_mm: float
    mean_mm: float
    mean_signed_mm: float
    max_mm: float
    points: int
    gouge: Record
    leftover: Record
    before: Record | None
    after: Record


class _Result:
    """A result in the form of data, which can be pickled, copied and compared."""

    #: The attribute that `save` writes for each ending of a file.
    _saved: ClassVar[dict[str, str]] = {".json": "_json_text", ".html": "html"}

    def __init__(self, data: dict[str, Any]) -> None:
        self._data = data

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._data,)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Result) and type(self) is type(other) and self._data == other._data

    __hash__ = None  # type: ignore[assignment]

    @cached_property
    def json(self) -> Record:
        """The whole answer, as `--json` writes it."""
        return record(self._data["json"])

    @property
    def text(self) -> str:
        """The answer as the command prints it."""
        return cast(str, self._data["text"])

    @property
    def notes(self) -> list[Diagnostic]:
        """Notes and warnings, which the command prints on stderr."""
        return list(self._data["notes"])

    @property
    def _json_text(self) -> str:
        return cast(str, self._data["json"])

    @property
    def html(self) -> str:
        """The page, complete in one file."""
        return cast(str, self._data["page"])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the form of the answer that the ending of `path` names, all of it or nothing.

        Every result has `.json` (what `json` contains) and `.html`. `.csv` is the table of the command, `.toml` the extended cell,
        `.stl` the part that was cut, `.sarif` and `.xml` (JUnit) the findings of a check.

        >>> deflex.check("samples/slot/slot.mod", "samples/slot/cell.toml", max_error_mm=0.02).save("verdict.stl")
        Traceback (most recent call last):
        ValueError: verdict.stl: a Check is saved as .json, .html, .csv, .sarif or .xml
        """
        attribute = self._saved.get(Path(path).suffix.lower())
        if attribute is None:
            *most, last = self._saved
            raise ValueError(f"{path}: a {type(self).__name__} is saved as {', '.join(most)} or {last}")
        form: str | bytes = getattr(self, attribute)
        self._write([(Path(path), form.encode() if isinstance(form, str) else form)])

    def _write(self, files: list[tuple[Path, bytes]]) -> None:
        _deflex.write(files, *self._inputs())

    def _inputs(self) -> tuple[Program | None, Cell | None]:
        """What the result was computed from, whose files are never replaced."""
        return None, None

    def _repr_html_(self) -> str:
        return _framed(self.html)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.text.partition(chr(10))[0]}>"


class _Tabular(_Result):
    """A result with a table: the CSV file that the command's `--report` writes."""

    _saved = {**_Result._saved, ".csv": "csv"}

    @property
    def csv(self) -> str:
        """The table as the command writes it."""
        return cast(bytes, self._data["csv"]).decode()

    @cached_property
    def _columns(self) -> Any:
        return _deflex.columns(self._data["csv"])

    def to_pandas(self) -> "pandas.DataFrame":
        """The table as a data frame, with the names, units and digits of the command's `--report`. This needs pandas.

        >>> deflex.predict("samples/slot/slot.mod", "samples/slot/cell.toml").to_pandas().shape
        (81, 42)
        """
        import pandas

        return pandas.DataFrame(self._columns)


class _Run(_Tabular):
    """The result for one program."""

    def __init__(self, data: dict[str, Any], call: dict[str, Any]) -> None:
        super().__init__(data)
        self._call = call

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._data, self._call)

    @cached_property
    def report(self) -> Report:
        """The columns of the command's CSV report, one row for each target, with its names, units and digits. `unrounded` has
        all digits. The arrays are read-only.

        `target` and `line` are int64, `name` and `status` str, all others float64 of shape (N,); NaN where the report has
        no figure.
        """
        return cast(Report, self._columns)

    def _inputs(self) -> tuple[Program | None, Cell | None]:
        return self._call["program"], self._call["cell"]

    @property
    def html(self) -> str:
        """The page: the toolpath in 3-D with its errors, complete in one file. deflex processes the program again for this."""
        return _deflex.page(self._call)


class _Errors(_Run):
    """The errors of one program."""

    @cached_property
    def unrounded(self) -> Numbers:
        """The report's columns of numbers with all digits, (N,), float64: `q1_deg`, `error_x_mm`, ….

        deflex processes the program again for this. NaN where the report has no figure.
        """
        return cast(Numbers, _deflex.unrounded(self._call))

    @property
    def summary(self) -> Summary:
        """The summary of the program, as in `--json`."""
        return cast(Summary, self.json)

    def __repr__(self) -> str:
        summary = self.summary
        errors = f"{self._data['text']}; error rms {summary.rms_error_mm:.4f} mm, max {summary.max_error_mm:.4f} mm"
        return f"<{type(self).__name__} of {summary.path}: {errors}{self._remaining()}>"

    def _remaining(self) -> str:
        return ""


class Prediction(_Errors):
    """The predicted errors of a program."""

    @cached_property
    def path(self) -> DrivenPath:
        """The path that the controller drives and the loaded arm takes, by column, as `--path` writes it."""
        return cast(DrivenPath, _deflex.columns(_deflex.driven_path(self._call)))


class Check(_Run):
    """The verdict on a program: is each target, and the path to it, within tolerance and the limits of the robot?"""

    _saved = {**_Run._saved, ".sarif": "sarif", ".xml": "junit"}

    @property
    def passed(self) -> bool:
        """Whether the command would end with exit code 0."""
        return self.summary.passed

    @property
    def summary(self) -> Verdict:
        """The entry of the program in `--json`."""
        return cast(Verdict, self.json["files"][0])

    @property
    def findings(self) -> list[Record]:
        """The first findings: `file`, `line`, `column`, `code`, `message`."""
        return self.summary.findings

    @property
    def sarif(self) -> str:
        """The findings in SARIF, as `--output-format sarif` prints them."""
        return cast(str, self._data["sarif"])

    @property
    def junit(self) -> str:
        """The findings in JUnit XML, as `--output-format junit` prints them."""
        return cast(str, self._data["junit"])

    def __repr__(self) -> str:
        return f"<Check: {'passed' if self.passed else 'failed'}; {self.text.rstrip().splitlines()[-1]}>"


class Correction(_Errors):
    """A corrected program with its report."""

    @cached_property
    def files(self) -> dict[str, bytes]:
        """The bytes of the corrected program's files, by name."""
        return cast(dict[str, bytes], self._data["files"])

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
            self._write([(target, next(iter(self.files.values())))])
            return
        if target.exists() and not target.is_dir():
            raise NotADirectoryError(f"{target} is a file: the program has {len(self.files)}, which need a folder")
        self.write_into(target, self.files)

    def write_into(self, folder: str | os.PathLike[str], files: Mapping[str, bytes]) -> None:
        """Writes files by their names into a folder, which is made where missing, as one set: all or none."""
        paths = [(Path(folder) / name, data) for name, data in files.items()]
        for path, _ in paths:
            path.parent.mkdir(parents=True, exist_ok=True)
        self._write(paths)

    def _remaining(self) -> str:
        return f"; remaining at targets max {self.summary.max_remaining_mm:.6f} mm"


class _ExtendedCell(_Result):
    """A result with an extended cell."""

    _saved = {**_Result._saved, ".toml": "_cell_text"}

    @property
    def _cell_text(self) -> str:
        return cast(str, self._data["cell"])

    def __init__(self, data: dict[str, Any], name: str) -> None:
        super().__init__(data)
        self._name = name

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._data, self._name)

    @cached_property
    def cell(self) -> Cell:
        """The extended cell, with the comments of the declared one."""
        return Cell.parse(self._cell_text, self._name)


class Identification(_ExtendedCell, _Tabular):
    """The effects that a cell lacks."""

    _saved = {**_Tabular._saved, **_ExtendedCell._saved}

    @property
    def added(self) -> list[Added]:
        """The effects that were added: kind, posterior, parameters with intervals, and the effects that they may be instead."""
        found: list[Added] = self.json["added"]
        return found

    @property
    def before(self) -> Errors:
        """`rms_mm`, `mean_mm`, `max_mm` of the declared cell on held-out rows."""
        found: Errors = self.json["before"]
        return found

    @property
    def after(self) -> Errors:
        """The same of the extended cell."""
        found: Errors = self.json["after"]
        return found

    @property
    def ranking(self) -> list[Ranked]:
        """Each kind of effect alone, the best first."""
        found: list[Ranked] = self.json["ranking"]
        return found

    @property
    def advice(self) -> list[str]:
        """What to measure next, and why."""
        found: list[str] = self.json["advice"]
        return found

    @cached_property
    def residuals(self) -> Residuals:
        """The columns of the command's `--report`: residuals of each row, mm; `target` is 0 between targets."""
        return cast(Residuals, self._columns)


class _Printed(_Result):
    """A result without a page: HTML shows what the command prints."""

    @property
    def html(self) -> str:
        """What the command prints, as HTML."""
        return f"<pre>{html.escape(self.text)}</pre>"

    def _repr_html_(self) -> str:
        return self.html


class PathLaw(_ExtendedCell, _Printed):
    """The law of the path that a controller drives, from logs of its axes. The extended cell has it in `[controller.path]`."""


class Planned(_Result):
    """A planned measurement.

    Everything that `deflex plan --json` writes is in `json`: `rows`, `pairs`, `weakest`, `chance_right`, …
    """

    _saved = {**_Result._saved, ".csv": "table"}

    @property
    def program(self) -> str:
        """The program: each motion ends where a row is measured."""
        return cast(str, self._data["program"])

    @property
    def table(self) -> str:
        """The table to fill in, as CSV: target, load and time of each row, measured columns empty."""
        return cast(str, self._data["table"])


class Simulation(_Tabular):
    """The part as the loaded arm cuts it from the stock, compared with the programmed part."""

    _saved = {**_Tabular._saved, ".stl": "stl"}

    @property
    def summary(self) -> Figures:
        """The figures, as in `deflex simulate --json`: `rms_mm`, `mean_mm`, `max_mm`, `gouge`, `leftover`, `removed_mm3`, …"""
        return cast(Figures, self.json)

    @cached_property
    def report(self) -> SurfacePoints:
        """Points of the cut surface, by column: `x_mm`, `y_mm`, `z_mm` in the stock's frame and `deviation_mm` (above zero: left over), (N,)."""
        return cast(SurfacePoints, self._columns)

    @property
    def stl(self) -> bytes:
        """The part as it will be cut, binary STL, mm."""
        return cast(bytes, self._data["stl"])

    def __repr__(self) -> str:
        summary = self.summary
        return f"<Simulation: deviation of the surface rms {summary.rms_mm:.4f} mm, max {summary.max_mm:.4f} mm>"


class Difference(_Tabular):
    """What changed between two programs, target by target."""

    def __bool__(self) -> bool:
        """Whether anything changed: the command would end with exit code 1."""
        return any(self.json[key] for key in ("moved", "inserted", "other"))

    @cached_property
    def report(self) -> Moved:
        """The targets that moved, by column, with names, units and digits of the command's `--report`."""
        return cast(Moved, self._columns)


class Inspection(_Printed):
    """What deflex understands of programs."""

    @property
    def files(self) -> list[Record]:
        """A record for each file, as in `--json`: `path`, `language`, `motion_targets`, `refused`, `kept`, `tools`, …"""
        found: list[Record] = self.json["files"]
        return found
