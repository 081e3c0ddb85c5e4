"""The commands as functions."""

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, get_args, get_type_hints

import numpy as np
import numpy.typing as npt

from deflex import _deflex
from deflex._deflex import Cell, Program
from deflex._results import Correction, Identification, Planned, Prediction, Simulation
from deflex._tables import Table, given

Path = str | os.PathLike[str]
AnyProgram = Program | Path | Sequence[Path]
Progress = Callable[[int, int], object]


def _check_words(function: Callable[..., Any], **values: object) -> None:
    """Raises ValueError for a value that is none of the words in the Literal of its parameter."""
    for name, value in values.items():
        hint = get_type_hints(function)[name]
        # An optional parameter is a union of its Literal and None.
        words = [word for part in get_args(hint) for word in get_args(part) or (part,)]
        if value not in words and not (value is None and type(None) in words):
            raise ValueError(f"{name} is {value!r}, expected one of {', '.join(repr(w) for w in words if isinstance(w, str))}")


def _program(program: AnyProgram) -> Program:
    return program if isinstance(program, Program) else Program.read(program)


def _cell(cell: Cell | Path) -> Cell:
    return cell if isinstance(cell, Cell) else Cell.read(cell)


def _options(**options: Any) -> dict[str, Any]:
    correct = options.pop("correct", "pose")
    _check_words(compensate, post=options.get("post", "rapid"), correct=correct)
    for name in ("subdivide_mm", "rapid_mm_s", "feed_mm_s"):
        value = options.get(name)
        if value is not None and not 0 < value < float("inf"):
            raise ValueError(f"{name} is {value!r}, expected a number above 0")
    if options.get("max_targets") is not None and options["max_targets"] < 1:
        raise ValueError(f"max_targets is {options['max_targets']!r}, expected at least 1")
    defaults: dict[str, Any] = dict.fromkeys(
        ("tool", "subdivide_mm", "name", "max_targets", "rapid_mm_s", "feed_mm_s")
    )
    return {"position": correct == "position", "allow_clones": False, "free_spin": False, "again": False, "post": "rapid", **defaults, **options}


def predict(
    program: AnyProgram,
    cell: Cell | Path,
    forces: Table | None = None,
    *,
    against: AnyProgram | None = None,
    tool: str | None = None,
    free_spin: bool = False,
    progress: Progress | None = None,
) -> Prediction:
    """Predicts the errors of a program without correcting it: `deflex predict`.

    `program` is one program: a `Program`, a path, or the paths of its modules. `forces` is a path or a table with `target` and
    `fx_n`, `fy_n`, `fz_n` (N, work object axes; also `time_s`, `temperature_c`, `payload_kg`), which overrides `[cut]`.
    `against` is the original of a corrected program: errors are then relative to its targets. `tool` replaces the tool of the
    program. `free_spin` chooses the turn about the tool axis of RAPID targets for the smallest predicted error.
    `progress(done, total)` is called with bytes of the program.

    Raises `DeflexError` if the command would end with exit code 2.

    >>> deflex.predict("samples/slot/slot.mod", "samples/slot/cell.toml").summary.targets
    81
    """
    forced = None if forces is None else given(forces, "<forces>")
    original = None if against is None else _program(against)
    held = (_program(program), _cell(cell))
    return Prediction(_deflex.predict(held, forced, original, _options(tool=tool, free_spin=free_spin), progress))


def compensate(
    program: AnyProgram,
    cell: Cell | Path,
    forces: Table | None = None,
    *,
    correct: Literal["pose", "position"] = "pose",
    tool: str | None = None,
    subdivide_mm: float | None = None,
    allow_clones: bool = False,
    free_spin: bool = False,
    again: bool = False,
    post: Literal["rapid", "krl", "ls", "ur", "jbi", "cl"] = "rapid",
    name: str | None = None,
    max_targets: int | None = None,
    rapid_mm_s: float | None = None,
    feed_mm_s: float | None = None,
    progress: Progress | None = None,
) -> Correction:
    """Corrects a program so that the loaded tool reaches the programmed poses: `deflex compensate`.

    `program`, `forces`, `tool`, `free_spin` and `progress` are those of `predict`. `correct` states what changes: the whole pose or the position alone. `subdivide_mm`
    inserts targets until at most this error remains between two of them; `allow_clones` declares a copy of a target for each of several
    motions that use it with different corrections; `again` corrects a program that was corrected before. CL data are
    posted in the language `post` as `name`, in modules of at most `max_targets`, with `rapid_mm_s` for rapid travel and `feed_mm_s` where the file
    has no feed.

    Raises `DeflexError` if the command would end with exit code 2; there is no program then.

    >>> done = deflex.compensate("samples/slot/slot.mod", "samples/slot/cell.toml")
    >>> done.text.splitlines()[0]
    '%%%'
    """
    forced = None if forces is None else given(forces, "<forces>")
    options = _options(
        correct=correct,
        tool=tool,
        subdivide_mm=subdivide_mm,
        allow_clones=allow_clones,
        free_spin=free_spin,
        again=again,
        post=post,
        name=name,
        max_targets=max_targets,
        rapid_mm_s=rapid_mm_s,
        feed_mm_s=feed_mm_s,
    )
    return Correction(_deflex.compensate((_program(program), _cell(cell)), forced, options, progress))


def simulate(
    program: AnyProgram,
    cell: Cell | Path,
    forces: Table | None = None,
    *,
    against: AnyProgram | None = None,
    tool: str | None = None,
    free_spin: bool = False,
    progress: Progress | None = None,
) -> Simulation:
    """Cuts the cell's `[stock]` with the poses that the loaded arm takes: `deflex simulate`.

    `program`, `forces`, `tool` and `free_spin` are those of `predict`. `against` is the original of a corrected program: the part
    is compared with the shape that it programs, or with `[part] stl`. `progress(done, total)` is called with parts of the work.

    Raises `DeflexError` if the command would end with exit code 2.
    """
    forced = None if forces is None else given(forces, "<forces>")
    original = None if against is None else _program(against)
    held = (_program(program), _cell(cell))
    return Simulation(_deflex.simulate(held, forced, original, _options(tool=tool, free_spin=free_spin), progress))


def identify(
    runs: Iterable[tuple[AnyProgram, Table]] = (),
    poses: Table | list[Table] | tuple[Table, ...] | None = None,
    *,
    cell: Cell | Path,
    against: AnyProgram | None = None,
    tool: str | None = None,
    columns: Mapping[str, str] | None = None,
    match_mm: float | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Finds the effects that a cell lacks: `deflex identify`.

    `runs` are programs with what was measured on them, or `poses` measured rows with their own motor angles: paths or tables
    with the columns of a measured file (mm, degrees, N). Errors before and after are those of held-out rows, which no fit has
    seen. `against` is the program that the runs' program was corrected from: `normal_mm` and nominal places are counted from its path.
    `columns` maps the names of deflex to those of the tables: `{"target": "Punkt Nr"}`; other columns are then ignored.
    `match_mm` is the largest distance from the path of a row with `nominal_x_mm`, … and no target (5).
    `progress(done, total)` is called with parts of the work.

    Raises `DeflexError` if the command would end with exit code 2.
    """
    original = None if against is None else _program(against)
    pairs = [(_program(program), original, given(table, f"<run {i}>")) for i, (program, table) in enumerate(runs, 1)]
    several = poses if isinstance(poses, (list, tuple)) else [] if poses is None else [poses]
    rows = [given(table, f"<poses {i}>") for i, table in enumerate(several, 1)]
    if bool(pairs) == bool(rows):
        raise ValueError("give either runs or poses")
    declared = _cell(cell)
    named = None if columns is None else ",".join(f"{ours}={theirs}" for ours, theirs in columns.items())
    read_as = (tool, named, match_mm)
    return Identification(_deflex.identify(pairs, rows, declared, read_as, progress), declared.name)


def plan(
    cell: Cell | Path,
    rows: int,
    *,
    pool: Iterable[AnyProgram] = (),
    after: Identification | None = None,
    name: str = "plan",
    post: Literal["rapid", "krl", "ls", "ur", "jbi"] | None = None,
    ask: Literal["never", "load", "target"] = "never",
    progress: Progress | None = None,
) -> Planned:
    """Plans what to measure, so that effects can be distinguished: `deflex plan`.

    The cell's `[plan]` states where the tool may go, which loads can be applied, and the instrument. `rows` (8 to 500) is the number
    of measured places. `pool` are programs among whose targets the places are chosen. With `after`, the rows decide what an
    identification left open. `name` is the name of the program, `post` its language if it is not that of the cell's controller.
    `ask` states when the program waits for the operator. `progress(done, total)` is called with parts of the work.

    Raises `DeflexError` if the command would end with exit code 2.
    """
    if not 8 <= rows <= 500:
        raise ValueError(f"rows is {rows!r}, expected 8 to 500")
    _check_words(plan, ask=ask, post=post)
    undecided = None if after is None else json.dumps(after.json)
    programs = [_program(program) for program in pool]
    return Planned(_deflex.plan(_cell(cell), rows, programs, undecided, (name, post, ask), progress))


def cutting_force(
    *,
    depth_mm: npt.ArrayLike,
    feed_per_tooth_mm: npt.ArrayLike,
    diameter_mm: float,
    teeth: int,
    width_mm: npt.ArrayLike | None = None,
    lead_deg: npt.ArrayLike = 0.0,
    tilt_deg: npt.ArrayLike = 0.0,
    corner_radius_mm: float = 0.0,
    helix_deg: float = 0.0,
    mode: Literal["slot", "up", "down"] = "slot",
    material: str | None = None,
    ktc_n_mm2: float | None = None,
    krc_n_mm2: float | None = None,
    kac_n_mm2: float | None = None,
    kte_n_mm: float = 0.0,
    kre_n_mm: float = 0.0,
    kae_n_mm: float = 0.0,
) -> npt.NDArray[np.float64]:
    """Mean cutting force on the tool over a revolution, N, shape (N, 3): (along the feed, normal x feed, along the normal).

    The engagement's arrays broadcast to N. Names are those of the cell file's `[cut]`; the coefficients are a `material`'s or
    `ktc_n_mm2`, `krc_n_mm2`, `kac_n_mm2` with their edge forces. Without `width_mm` the width is the diameter.

    >>> cut = dict(feed_per_tooth_mm=0.1, diameter_mm=20.0, teeth=4, corner_radius_mm=2.0, lead_deg=5.0, material="al7075")
    >>> deflex.cutting_force(depth_mm=[1.0, 2.0], **cut).shape
    (2, 3)
    """
    width = diameter_mm if width_mm is None else width_mm
    columns = np.broadcast_arrays(depth_mm, width, feed_per_tooth_mm, lead_deg, tilt_deg)
    rows = np.stack([np.ravel(column).astype(float) for column in columns], axis=1)
    area = (ktc_n_mm2, krc_n_mm2, kac_n_mm2)
    given_none = all(value is None for value in area)
    if not given_none and any(value is None for value in area):
        raise ValueError("ktc_n_mm2, krc_n_mm2 and kac_n_mm2 go together")
    coefficients = None if given_none else (*area, kte_n_mm, kre_n_mm, kae_n_mm)
    cutter = (diameter_mm, corner_radius_mm, teeth, helix_deg)
    return _deflex.cutting_force(mode, cutter, material, coefficients, rows)
