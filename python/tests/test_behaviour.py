"""How the module feels: errors, progress, Ctrl-C, tables, what is shown."""

import copy
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

import deflex
from deflex._tables import given


def test_errors_name_file_line_and_help():
    with pytest.raises(deflex.DeflexError) as raised:
        deflex.Cell.parse('[robot]\nmodle = "irb6660-205-1.9"\n', "mine.toml")
    first = raised.value.diagnostics[0]
    assert (first.file, first.line, first.severity) == ("mine.toml", 2, "error")
    assert "model" in (first.help or "") and first.code.startswith("cell.")
    assert "mine.toml:2" in str(raised.value) and "help:" in str(raised.value)
    with pytest.raises(deflex.DeflexError) as raised:
        deflex.Program.read("no such file.mod")
    assert raised.value.diagnostics[0].code == "io.read"


def test_a_refused_program_is_none(tmp_path):
    far = tmp_path / "far.mod"
    text = open("samples/slot/slot.mod").read()
    far.write_text(text.replace("MoveL [[", "MoveL [[9", 1))
    with pytest.raises(deflex.DeflexError) as raised:
        deflex.compensate(far, "samples/slot/cell.toml")
    assert any(error.file == str(far) and error.line > 0 for error in raised.value.diagnostics)


def test_a_corrected_program_is_not_corrected_again(tmp_path):
    done = deflex.compensate("samples/slot/slot.mod", "samples/slot/cell.toml")
    done.write(tmp_path / "out.mod")
    (tmp_path / "out.report.csv").write_text(done.csv)
    with pytest.raises(deflex.DeflexError, match="correction is in it already"):
        deflex.compensate(tmp_path / "out.mod", "samples/slot/cell.toml")
    assert deflex.compensate(tmp_path / "out.mod", "samples/slot/cell.toml", again=True).text


def test_what_is_shown():
    done = deflex.compensate("samples/slot/slot.mod", "samples/slot/cell.toml")
    assert repr(done).startswith("<Correction of samples/slot/slot.mod: 81 targets: ")
    assert done._repr_html_().startswith("<iframe srcdoc=") and "&lt;html" in done._repr_html_()
    cell = deflex.Cell.read("samples/slot/cell.toml")
    assert repr(cell).startswith("Cell('samples/slot/cell.toml', ") or repr(cell).startswith('Cell("samples/slot/cell.toml", ')
    assert cell.to_toml() == open("samples/slot/cell.toml").read()
    assert deflex.Cell.parse(cell.to_toml()).effects == cell.effects
    program = deflex.Program.read(["samples/slot/slot.mod"])
    assert program.language == "rapid" and program.motion_targets == 81 and "slot.mod" in repr(program)


def test_progress_is_told_and_its_errors_stop_the_run(long_program):
    told = []
    deflex.predict(long_program, "samples/slot/cell.toml", progress=lambda done, total: told.append((done, total)))
    total = os.path.getsize(long_program)
    assert told[-1] == (total, total) and [done for done, _ in told] == sorted(done for done, _ in told)

    def stop(done: int, total: int) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        deflex.predict(long_program, "samples/slot/cell.toml", progress=stop)


def test_an_identification_tells_its_stages_and_is_called_off():
    folder = "samples/closed-loop"
    run = {"runs": [(f"{folder}/part.mod", f"{folder}/measured.csv")], "cell": f"{folder}/cell.toml"}
    told = []
    deflex.identify(**run, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (1000, 1000) and [done for done, _ in told] == sorted(done for done, _ in told)

    def stop(done: int, total: int) -> None:
        stopped.append(done)
        raise LookupError("enough")

    # It takes longer than progress is looked at.
    stopped = []
    with pytest.raises(LookupError, match="enough"):
        deflex.identify(**run, progress=stop)
    assert len(stopped) == 1 and 0 < stopped[0] < 1000


def interrupted(run: Callable[[], object]) -> float:
    """Seconds from a Ctrl-C soon after the start to the KeyboardInterrupt."""
    sent = []

    def interrupt() -> None:
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.15, interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        run()
    return time.monotonic() - sent[0]


@pytest.mark.skipif(os.name == "nt", reason="signals are sent the Unix way")
def test_ctrl_c_stops_soon(long_program, steep_cell, tmp_path):
    longer = tmp_path / "longer.mod"
    text = long_program.read_text()
    first = text.index("MoveL")
    body, tail = text[first:].rsplit("ENDPROC", 1)[0], text[text.rindex("ENDPROC") :]
    longer.write_text(text[:first] + body * 30 + "\n  " + tail)
    # The run takes a second or more on two cores.
    assert interrupted(lambda: deflex.compensate(longer, steep_cell)) < 1.0


@pytest.mark.skipif(os.name == "nt", reason="signals are sent the Unix way")
def test_ctrl_c_stops_an_identification():
    folder = "samples/closed-loop"
    run = {"runs": [(f"{folder}/part.mod", f"{folder}/measured.csv")], "cell": f"{folder}/cell.toml"}
    assert interrupted(lambda: deflex.identify(**run)) < 1.0
    assert deflex.identify(**run).added


def test_other_threads_run_meanwhile(long_program):
    ticks = 0
    stopped = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not stopped.wait(0.005):
            ticks += 1

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    deflex.predict(long_program, "samples/slot/cell.toml")
    took = time.monotonic() - start
    stopped.set()
    thread.join()
    assert ticks > 20 * took


def test_tables_keep_every_bit():
    import pandas
    import polars

    values = [0.1, 1 / 3, -1e-17, 12345.678901234567, 2.0]
    columns = {"target": [1, 2, 3, 4, 5], "x_mm": values}
    texts = {given(table)[1] for table in (columns, pandas.DataFrame(columns), polars.DataFrame(columns))}
    assert len(texts) == 1
    fields = [line.split(",")[1] for line in texts.pop().splitlines()[1:]]
    assert [float(field) for field in fields] == values
    assert given(pandas.DataFrame({"name": ["a,b"], "x": [np.nan]}))[1] == 'name,x\n"a,b",\n'
    nullable = pandas.DataFrame({"target": pandas.array([1, None], dtype="Int64"), "holdout": [True, False]})
    assert given(nullable)[1] == "target,holdout\n1,1\n,0\n"
    assert given({"target": np.array([1, 2]), "holdout": list(np.array([True, False]))})[1] == "target,holdout\n1,1\n2,0\n"
    with pytest.raises(ValueError, match="differ in length"):
        given({"a": [1], "b": [1, 2]})


def test_wrong_arguments_say_so():
    cell = "samples/slot/cell.toml"
    with pytest.raises(ValueError, match="either runs or poses"):
        deflex.identify(cell=cell)
    with pytest.raises(ValueError, match="subdivide_mm"):
        deflex.compensate("samples/slot/slot.mod", cell, subdivide_mm=-1.0)
    with pytest.raises(ValueError, match=r"shape \(1, 5\), expected \(N, 6\)"):
        deflex.Cell.read(cell).robot.forward([[0, 0, 0, 0, 30]])
    with pytest.raises(ValueError, match="did you mean"):
        deflex.Robot("irb6660-205-1.8")


def test_a_cell_is_copied_and_sent_to_other_processes():
    cell = deflex.Cell.read("samples/slot/cell.toml")
    for twin in (pickle.loads(pickle.dumps(cell)), copy.deepcopy(cell)):
        assert (twin.to_toml(), twin.name) == (cell.to_toml(), cell.name)


def test_words_that_are_no_options_are_refused():
    cell = "samples/slot/cell.toml"
    with pytest.raises(ValueError, match="post is 'fanuc', expected one of 'rapid', 'krl', 'ls', 'ur', 'jbi', 'cl'"):
        deflex.compensate("samples/slot/slot.mod", cell, post="fanuc")
    with pytest.raises(ValueError, match="ask is 'always'"):
        deflex.plan(cell, 24, ask="always")
    with pytest.raises(ValueError, match="post is 'cl'"):
        deflex.plan(cell, 24, post="cl")
