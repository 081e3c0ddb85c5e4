"""The samples, and the command of the same installation."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "samples"


@pytest.fixture(autouse=True)
def _at_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names in messages and summaries are paths from the repository."""
    monkeypatch.chdir(ROOT)


@pytest.fixture
def command():
    """Runs the installed command; gives what it came to."""
    name = "deflex.exe" if os.name == "nt" else "deflex"
    script = Path(sys.executable).with_name(name)

    def run(*args, code: int | None = 0) -> subprocess.CompletedProcess:
        done = subprocess.run([script, *map(str, args)], capture_output=True, timeout=600)
        assert code is None or done.returncode == code, done.stderr.decode()
        return done

    return run


@pytest.fixture(scope="session")
def long_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program that is streamed, 2 MB: the slot's path over and over."""
    head, moves, tail = split((SAMPLES / "slot/slot.mod").read_text())
    path = tmp_path_factory.mktemp("long") / "long.mod"
    path.write_text(head + moves * (2_000_000 // len(moves) + 1) + tail)
    return path


@pytest.fixture(scope="session")
def steep_cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The slot's cell, for a program that goes back to its start in one step."""
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    path.write_text((SAMPLES / "slot/cell.toml").read_text().replace("max_step_mm = 0.2", "max_step_mm = 5.0"))
    return path


def split(text: str) -> tuple[str, str, str]:
    """A program up to its first motion, its motions, and the rest."""
    lines = text.splitlines(keepends=True)
    moves = [i for i, line in enumerate(lines) if line.lstrip().startswith("Move")]
    first, last = moves[0], moves[-1] + 1
    return "".join(lines[:first]), "".join(lines[first:last]), "".join(lines[last:])
