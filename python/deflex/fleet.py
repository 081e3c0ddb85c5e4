"""Many programs, many robots: the same runs over the workers of a Dask cluster (`pip install deflex[dask]`).

Each file is one task. If a worker fails, another one repeats its tasks. A program that deflex refuses is a row of the table, not
an exception. The paths must be valid on the workers. The outputs are the same bytes as those of one process.

    from glob import glob
    from distributed import Client
    import deflex.fleet

    done = deflex.fleet.compensate(glob("archive/*.mod"), "cell.toml", client=Client("scheduler:8786"), out_dir="corrected")
    print(done.failed)
"""

import importlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

from deflex import _run
from deflex._deflex import Cell, DeflexError
from deflex._results import Correction, Record
from deflex._tables import Table

Path = str | os.PathLike[str]
#: Programs by their paths, with what was measured on them.
Runs = Sequence[tuple[Path | Sequence[Path], Table]]
Progress = Callable[[int, int], object]

#: How often a task is repeated if its worker fails. A refusal of deflex is not repeated.
RETRIES = 3


@dataclass(frozen=True)
class Results:
    """A table of results: a row for each file or robot, in the given order."""

    #: Rows: `name`, `error` (None where all went well), and the figures.
    rows: list[Record]
    #: By name, what was made: corrected files by their names, or the extended cell under the cell's name.
    files: dict[str, dict[str, bytes]] = field(repr=False)

    @property
    def failed(self) -> list[Record]:
        """The rows that failed; `error` has the reason."""
        return [row for row in self.rows if row["error"] is not None]

    @property
    def table(self) -> dict[str, list[Any]]:
        """The rows by column, as `pandas.DataFrame` or `polars.DataFrame` take them; None where a row has no such figure."""
        names = dict.fromkeys(name for row in self.rows for name in row)
        return {name: [row.get(name) for row in self.rows] for name in names}


def compensate(
    paths: Iterable[Path | Sequence[Path]],
    cell: Cell | Path,
    *,
    client: Any = None,
    out_dir: Path | None = None,
    retries: int = RETRIES,
    progress: Progress | None = None,
    **options: Any,
) -> Results:
    """Corrects each program: `deflex.compensate` with its `options`, as one task for each program.

    `client` is a `distributed.Client`; the current one where it is left out. With `out_dir` the workers write programs and
    reports (`NAME.report.csv`) there, as `--out-dir` does, and `Results.files` is empty; without, the programs come back.
    `progress(done, total)` receives numbers of programs.
    """
    programs: list[list[str]] = [
        [os.fspath(path)] if isinstance(path, (str, os.PathLike)) else [os.fspath(part) for part in path] for path in paths
    ]
    text, name = _cell(cell)
    folder = None if out_dir is None else os.fspath(out_dir)
    tasks = [(" + ".join(program), (program, text, name, folder, options)) for program in programs]
    return _mapped(_compensate, tasks, client, retries, progress)


def identify(
    fleet: Mapping[str, tuple[Runs, Cell | Path]],
    *,
    client: Any = None,
    retries: int = RETRIES,
    progress: Progress | None = None,
    **options: Any,
) -> Results:
    """Identifies each robot: `deflex.identify` with its `options` on the runs and the cell under its name, as one task for each robot.

    `client`, `retries` and `progress` are those of `compensate`. The extended cells come back in `Results.files`.
    """
    tasks = [(robot, (list(runs), *_cell(cell), options)) for robot, (runs, cell) in fleet.items()]
    return _mapped(_identify, tasks, client, retries, progress)


def _cell(cell: Cell | Path) -> tuple[str, str]:
    held = cell if isinstance(cell, Cell) else Cell.read(cell)
    return held.to_toml(), held.name


def _mapped(
    task: Callable[..., tuple[dict[str, Any], dict[str, bytes]]],
    tasks: list[tuple[str, tuple[Any, ...]]],
    client: Any,
    retries: int,
    progress: Progress | None,
) -> Results:
    # Imported only when it is needed, and without types.
    distributed: Any = importlib.import_module("distributed")
    client = distributed.get_client() if client is None else client
    # A run is never another's, whatever its arguments: files may have changed.
    futures = [client.submit(task, *arguments, retries=retries, pure=False) for _, arguments in tasks]
    for count, _ in enumerate(distributed.as_completed(futures), 1):
        if progress is not None:
            progress(count, len(futures))
    rows: list[Record] = []
    files: dict[str, dict[str, bytes]] = {}
    for (name, _), future in zip(tasks, futures):
        try:
            figures, made = future.result()
        except Exception as error:  # whatever came back from a worker is that program's row
            figures, made = {"error": f"{type(error).__name__}: {error}"}, {}
        rows.append(Record(name=name, **figures))
        files[name] = made
    return Results(rows, files)


def _compensate(
    program: list[str], cell: str, cell_name: str, out_dir: str | None, options: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, bytes]]:
    try:
        done = _run.compensate(program, Cell.parse(cell, cell_name), **options)
    except DeflexError as error:
        return {"error": str(error)}, {}
    figures = {key: value for key, value in done.summary.items() if isinstance(value, (int, float))}
    if out_dir is None:
        return {"error": None, **figures}, done.files
    _place(done, FilePath(out_dir))
    return {"error": None, **figures}, {}


def _place(done: Correction, folder: FilePath) -> None:
    report = str(FilePath(next(iter(done.files))).with_suffix(".report.csv"))
    done.write_into(folder, {**done.files, report: done.csv.encode()})


def _identify(
    runs: Runs, cell: str, cell_name: str, options: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, bytes]]:
    try:
        found = _run.identify(runs, cell=Cell.parse(cell, cell_name), **options)
    except DeflexError as error:
        return {"error": str(error)}, {}
    figures = {
        "error": None,
        "rows": found.json["rows"],
        "before_rms_mm": found.before["rms_mm"],
        "after_rms_mm": found.after["rms_mm"],
        "added": [effect["kind"] for effect in found.added],
        "unexplained": found.json["unexplained"]["significant"],
    }
    return figures, {FilePath(cell_name).name: found.cell.to_toml().encode()}
