"""The user's files, memory and processes are safe: one writer, bounds before memory, threads after fork."""

import multiprocessing
import os

import numpy as np
import pytest

import deflex

PROGRAM, CELL = "samples/slot/slot.mod", "samples/slot/cell.toml"


@pytest.fixture
def done(tmp_path):
    """A correction of a copy of the sample."""
    original = tmp_path / "part.mod"
    original.write_bytes(open(PROGRAM, "rb").read())
    return deflex.compensate(original, CELL)


def test_write_is_the_writer_of_the_command(done, tmp_path):
    there, link, hard = tmp_path / "there.mod", tmp_path / "link.mod", tmp_path / "hard.mod"
    there.write_text("old")
    link.symlink_to(there)
    os.link(there, hard)
    done.write(link)
    assert link.is_symlink() and there.read_text() == hard.read_text() == done.text
    assert there.stat().st_ino == hard.stat().st_ino
    done.write("/dev/null")
    assert not os.path.isfile("/dev/null")
    assert not [name for name in os.listdir(tmp_path) if name.startswith((".deflex", "deflex-unfinished"))]


def test_write_replaces_neither_inputs_nor_read_only_files(done, tmp_path):
    original = (tmp_path / "part.mod").read_bytes()
    os.link(tmp_path / "part.mod", tmp_path / "same.mod")
    locked = tmp_path / "locked.mod"
    locked.write_text("old")
    locked.chmod(0o444)
    for name in ("part.mod", "same.mod", "locked.mod"):
        with pytest.raises(deflex.DeflexError) as raised:
            done.write(tmp_path / name)
        assert raised.value.diagnostics[0].code == "io.write"
    assert (tmp_path / "part.mod").read_bytes() == original and locked.read_text() == "old"
    with pytest.raises(deflex.DeflexError):
        done.write(CELL)


@pytest.mark.parametrize("call", ["forward", "jacobian", "inverse"])
def test_a_view_of_any_number_of_rows_is_counted_first(call):
    robot = deflex.Robot("irb6660-205-1.9")
    shape = (4, 4) if call == "inverse" else (6,)
    endless = np.broadcast_to(np.zeros(shape), (100_000_000_000, *shape))
    with pytest.raises((ValueError, MemoryError), match="rows of an array"):
        getattr(robot, call)(endless)


def _forked(queue):
    robot = deflex.Robot("irb6660-205-1.9")
    done = deflex.compensate(PROGRAM, CELL)
    queue.put((float(robot.forward(np.zeros((5000, 6)))[0, 0, 3]), done.text))


def test_a_forked_child_computes_what_its_parent_does():
    here = float(deflex.Robot("irb6660-205-1.9").forward(np.zeros((5000, 6)))[0, 0, 3])
    text = deflex.compensate(PROGRAM, CELL).text
    fork = multiprocessing.get_context("fork")
    queue = fork.Queue()
    children = [fork.Process(target=_forked, args=(queue,)) for _ in range(3)]
    for child in children:
        child.start()
    try:
        assert [queue.get(timeout=120) for _ in children] == [(here, text)] * 3
    finally:
        for child in children:
            child.join(10)
            child.kill()


def test_names_that_begin_with_a_dash_are_names(tmp_path, monkeypatch, command):
    """The guard of the command line holds for the module's command too."""
    (tmp_path / "--forces=.h.mod").write_text(open(PROGRAM).read())
    cell = os.path.abspath(CELL)
    monkeypatch.chdir(tmp_path)
    ran = command("check", "--cell", cell, "--max-error", "0.01", "--forces=.h.mod", code=2)
    assert b"reads as an option" in ran.stderr
