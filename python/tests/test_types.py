"""The declared names of results are those of the results, and a type checker finds a misspelt one."""

import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

import deflex
from deflex import _columns, _results


def declared(typed: type) -> list[str]:
    return [name for base in reversed(typed.__mro__) for name in base.__dict__.get("__annotations__", {})]


def test_columns_are_those_of_the_reports(tmp_path):
    program, cell = "samples/slot/slot.mod", "samples/slot/cell.toml"
    done = deflex.compensate(program, cell)
    done.write(tmp_path / "out.mod")
    assert set(_columns.Report.__annotations__) == set(done.report)
    assert list(_columns.Numbers.__annotations__) == list(done.unrounded)
    assert list(_columns.Moved.__annotations__) == list(deflex.diff(program, tmp_path / "out.mod").report)
    kinds = {"f": _columns.Float, "i": _columns.Whole, "U": _columns.Text}
    for typed, report in ((_columns.Report, done.report), (_columns.Moved, deflex.diff(program, tmp_path / "out.mod").report)):
        for name, column in report.items():
            annotation, kind = typed.__annotations__[name], kinds[column.dtype.kind]
            assert annotation == kind or kind in get_args(annotation), name


def test_keys_are_those_of_the_results():
    program, cell = "samples/slot/slot.mod", "samples/slot/cell.toml"
    assert set(declared(_results.Summary)) == set(deflex.compensate(program, cell).summary)
    assert set(declared(_results.Verdict)) == set(deflex.check(program, cell, max_error_mm=0.1).summary)


@pytest.mark.slow
def test_keys_are_those_of_an_identification():
    folder = "samples/closed-loop"
    found = deflex.identify(runs=[(f"{folder}/part.mod", f"{folder}/measured.csv")], cell=f"{folder}/cell.toml")
    assert list(_columns.Residuals.__annotations__) == list(found.residuals)
    assert set(declared(_results.Added)) == set(found.added[0]) and set(declared(_results.Errors)) == set(found.before)
    assert set(declared(_results.Parameter)) == set(found.added[0].parameters[0])
    assert set(declared(_results.Ranked)) == set(found.ranking[0])


def test_a_type_checker_finds_a_misspelt_name(tmp_path):
    pytest.importorskip("mypy")
    wrong = ["done.report['eror_mm']", "done.summary.max_eror_mm", "done.unrounded['name']", "found.before.rms", "done.sumary"]
    right = ["done.report['error_mm'].mean()", "done.summary.max_error_mm + 1", "done.unrounded['q1_deg']", "found.before.rms_mm"]
    script = tmp_path / "script.py"
    head = "import deflex\n\ndone = deflex.compensate('a', 'b')\nfound = deflex.identify(cell='c')\n"
    script.write_text(head + "\n".join(right + wrong) + "\n")
    root = Path(__file__).resolve().parents[1]
    config = root / "pyproject.toml"
    answer = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", config, script], capture_output=True, text=True, cwd=tmp_path
    )
    lines = {int(line.split(":")[1]) for line in answer.stdout.splitlines() if ": error:" in line}
    first = 5 + len(right)
    assert lines == set(range(first, first + len(wrong))), answer.stdout
