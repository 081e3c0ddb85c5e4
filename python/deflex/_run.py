"""The commands as functions."""

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, get_args, get_type_hints

import numpy as np
import numpy.typing as npt

from deflex import _deflex
from deflex._deflex import Cell, Program
from deflex._results import (
    Check,
    Correction,
    Difference,
    Identification,
    Inspection,
    PathLaw,
    Planned,
    Prediction,
    Simulation,
)
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


def _paths(paths: Path | Sequence[Path]) -> list[Path]:
    return [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)


def _cell(cell: Cell | Path) -> Cell:
    return cell if isinstance(cell, Cell) else Cell.read(cell)


#: The value that a run has for each option that is not given.
_DEFAULTS: dict[str, Any] = {
    **dict.fromkeys(("tool", "subdivide_mm", "name", "max_targets", "rapid_mm_s", "feed_mm_s")),
    **dict.fromkeys(("max_path_error_mm", "max_jump_mm", "max_correction_mm")),
    **dict.fromkeys(("allow_clones", "free_spin", "again", "at_targets", "allow_unjudged"), False),
    "post": "rapid",
    "max_error_mm": 0.0,
}


def _call(
    command: str,
    program: AnyProgram,
    cell: Cell | Path,
    forces: Table | None,
    against: AnyProgram | None = None,
    *,
    correct: str = "pose",
    **options: Any,
) -> dict[str, Any]:
    """A run of one program with everything that it depends on: another process can repeat it."""
    _check_words(compensate, post=options.get("post", "rapid"), correct=correct)
    for name, value in options.items():
        if name.endswith(("_mm", "_mm_s")) and value is not None and not 0 < value < float("inf"):
            raise ValueError(f"{name} is {value!r}, expected a number above 0")
    if options.get("max_targets") is not None and options["max_targets"] < 1:
        raise ValueError(f"max_targets is {options['max_targets']!r}, expected at least 1")
    return {
        "command": command,
        "program": _program(program),
        "cell": _cell(cell),
        "forces": None if forces is None else given(forces, "<forces>"),
        "against": None if against is None else _program(against),
        "position": correct == "position",
        **_DEFAULTS,
        **options,
    }


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
    call = _call("predict", program, cell, forces, against, tool=tool, free_spin=free_spin)
    return Prediction(_deflex.run(call, progress), call)


def compensate(
    program: AnyProgram,
    cell: Cell | Path,
    forces: Table | None = None,
    *,
    correct: Literal["pose", "position"] = "pose",
    tool: str | None = None,
    subdivide_mm: float | None = None,
    max_path_error_mm: float | None = None,
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
    inserts targets until at most this error remains between two of them; `max_path_error_mm` keeps the driven path of the loaded arm
    within this distance of the programmed one, for which the cell needs `[controller.path]`; `allow_clones` declares a copy of a target for each of several
    motions that use it with different corrections; `again` corrects a program that was corrected before. CL data are
    posted in the language `post` as `name`, in modules of at most `max_targets`, with `rapid_mm_s` for rapid travel and `feed_mm_s` where the file
    has no feed.

    Raises `DeflexError` if the command would end with exit code 2; there is no program then.

    >>> done = deflex.compensate("samples/slot/slot.mod", "samples/slot/cell.toml")
    >>> done.text.splitlines()[0]
    '%%%'
    """
    call = _call(
        "compensate",
        program,
        cell,
        forces,
        correct=correct,
        tool=tool,
        subdivide_mm=subdivide_mm,
        max_path_error_mm=max_path_error_mm,
        allow_clones=allow_clones,
        free_spin=free_spin,
        again=again,
        post=post,
        name=name,
        max_targets=max_targets,
        rapid_mm_s=rapid_mm_s,
        feed_mm_s=feed_mm_s,
    )
    return Correction(_deflex.run(call, progress), call)


def check(
    program: AnyProgram,
    cell: Cell | Path,
    forces: Table | None = None,
    *,
    max_error_mm: float,
    max_path_error_mm: float | None = None,
    max_jump_mm: float | None = None,
    max_correction_mm: float | None = None,
    at_targets: bool = False,
    allow_unjudged: bool = False,
    against: AnyProgram | None = None,
    correct: Literal["pose", "position"] = "pose",
    tool: str | None = None,
    free_spin: bool = False,
    progress: Progress | None = None,
) -> Check:
    """Checks whether each target, and the path to it, is within tolerance and the limits of the robot: `deflex check`.

    `program`, `forces`, `against`, `tool`, `free_spin` and `progress` are those of `predict`. The path between targets has to keep
    `max_path_error_mm`, without it `max_error_mm`; with `at_targets` it is not judged. `max_jump_mm` limits the jumps of the tip where
    the force starts, ends or turns at once; without it jumps are only reported. `max_correction_mm` limits the correction of a target,
    which is that of `compensate` with `correct` if there is no `against`. With `allow_unjudged` the check passes although targets
    cannot be judged.

    Findings are no errors: see `Check.passed`. Raises `DeflexError` if the command would end with exit code 2.

    >>> cell = deflex.Cell.read("samples/slot/cell.toml")
    >>> deflex.check("samples/slot/slot.mod", cell, max_error_mm=0.02).passed
    False
    """
    if at_targets and (max_path_error_mm is not None or max_jump_mm is not None):
        raise ValueError("at_targets judges no path: leave out max_path_error_mm and max_jump_mm")
    call = _call(
        "check",
        program,
        cell,
        forces,
        against,
        correct=correct,
        tool=tool,
        free_spin=free_spin,
        max_error_mm=max_error_mm,
        max_path_error_mm=max_path_error_mm,
        max_jump_mm=max_jump_mm,
        max_correction_mm=max_correction_mm,
        at_targets=at_targets,
        allow_unjudged=allow_unjudged,
    )
    return Check(_deflex.run(call, progress), call)


def diff(original: AnyProgram, corrected: AnyProgram) -> Difference:
    """Compares two programs target by target: `deflex diff`. The result is true if anything changed.

    >>> bool(deflex.diff("samples/slot/slot.mod", "samples/slot/slot.mod"))
    False
    """
    return Difference(_deflex.diff(_program(original), _program(corrected)))


def inspect(
    paths: Path | Sequence[Path], *, context: Path | Sequence[Path] | None = None, format: str | None = None
) -> Inspection:
    """Shows what deflex understands of programs, or of the programs in folders: `deflex inspect`.

    `context` are files that declare names. `format` is the language of programs that do not show it. Raises `DeflexError` if deflex
    understands none of the files.

    >>> deflex.inspect("samples/slot").files[0]["motion_targets"]
    81
    """
    return Inspection(_deflex.inspect(_paths(paths), _paths(() if context is None else context), format))


def init(
    robot: str | None = None, *, urdf: Path | None = None, tip: str | None = None, backup: Path | None = None
) -> str:
    """The text of a cell file to start from: `deflex init`. Replace the values that are marked `# <<`.

    `robot` is a built-in robot (`Robot.builtin()` lists them), `urdf` a robot description whose last link is `tip`, and `backup` the
    folder of a backup of an ABB controller, which may state the robot.

    >>> deflex.Cell.parse(deflex.init("irb6660-205-1.9")).robot.model
    'irb6660-205-1.9'
    """
    return _deflex.init(robot, urdf, tip, backup)


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
    call = _call("simulate", program, cell, forces, against, tool=tool, free_spin=free_spin)
    return Simulation(_deflex.simulate(call, progress))


def identify(
    runs: Iterable[tuple[AnyProgram, Table]] = (),
    poses: Table | list[Table] | tuple[Table, ...] | None = None,
    *,
    cell: Cell | Path,
    against: AnyProgram | None = None,
    tool: str | None = None,
    columns: Mapping[str, str] | None = None,
    match_mm: float | None = None,
    sparse: bool = False,
    progress: Progress | None = None,
) -> Identification:
    """Finds the effects that a cell lacks: `deflex identify`.

    `runs` are programs with what was measured on them, or `poses` measured rows with their own motor angles: paths or tables
    with the columns of a measured file (mm, degrees, N). Errors before and after are those of held-out rows, which no fit has
    seen. `against` is the program that the runs' program was corrected from: `normal_mm` and nominal places are counted from its path.
    `columns` maps the names of deflex to those of the tables: `{"target": "Punkt Nr"}`; other columns are then ignored.
    `match_mm` is the largest distance from the path of a row with `nominal_x_mm`, … and no target (5). With `sparse` the extended
    cell has only the effects that are named, fitted without the others.
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
    reading = (tool, _named(columns), match_mm)
    return Identification(_deflex.identify(pairs, rows, declared, reading, sparse, progress), declared.name)


def identify_path(
    logs: Iterable[tuple[AnyProgram, Table]],
    *,
    cell: Cell | Path,
    tool: str | None = None,
    columns: Mapping[str, str] | None = None,
) -> PathLaw:
    """Finds the law of the path that a controller drives: `deflex identify --log`.

    `logs` are programs with logs of the axes while they ran: `time_s` and `q1_deg` to `q6_deg`. `tool` and `columns` are those of
    `identify`. To add the law to a cell that `identify` has extended, give this cell.

    Raises `DeflexError` if the command would end with exit code 2.
    """
    declared = _cell(cell)
    pairs = [(_program(program), given(table, f"<log {i}>")) for i, (program, table) in enumerate(logs, 1)]
    return PathLaw(_deflex.identify_path(pairs, declared, (tool, _named(columns), None)), declared.name)


def _named(columns: Mapping[str, str] | None) -> str | None:
    return None if columns is None else ",".join(f"{ours}={theirs}" for ours, theirs in columns.items())


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
