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


def test_results_are_saved_in_the_form_that_the_ending_names(tmp_path):
    program, cell = tmp_path / "slot.mod", tmp_path / "cell.toml"
    program.write_bytes(open("samples/slot/slot.mod", "rb").read())
    cell.write_bytes(open("samples/slot/cell.toml", "rb").read())
    done = deflex.check(program, cell, max_error_mm=0.1)
    forms = {"json": done._json_text, "csv": done.csv, "html": done.html, "sarif": done.sarif, "xml": done.junit}
    for ending, form in forms.items():
        done.save(tmp_path / f"verdict.{ending}")
        assert (tmp_path / f"verdict.{ending}").read_bytes() == form.encode()
    with pytest.raises(ValueError, match=r"a Check is saved as \.json, \.html, \.csv, \.sarif or \.xml"):
        done.save(tmp_path / "verdict")
    (tmp_path / "table.csv").symlink_to(program)
    with pytest.raises(deflex.DeflexError):
        done.save(tmp_path / "table.csv")
    assert program.read_bytes() == open("samples/slot/slot.mod", "rb").read()
    deflex.inspect(program).save(tmp_path / "inspection.html")
    assert "slot.mod" in (tmp_path / "inspection.html").read_text()


def test_tables_become_data_frames():
    done = deflex.predict("samples/slot/slot.mod", "samples/slot/cell.toml")
    frame = done.to_pandas()
    assert list(frame.columns) == list(done.report) and len(frame) == 81
    assert frame["error_mm"].to_numpy() == pytest.approx(done.report["error_mm"], nan_ok=True, abs=0)
    frame["error_mm"] = 0.0
    assert done.report["error_mm"].max() > 0


def test_progress_is_told_and_its_errors_stop_the_run(long_program):
    steps = []
    deflex.predict(long_program, "samples/slot/cell.toml", progress=lambda done, total: steps.append((done, total)))
    total = os.path.getsize(long_program)
    assert steps[-1] == (total, total) and [done for done, _ in steps] == sorted(done for done, _ in steps)

    def stop(done: int, total: int) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        deflex.predict(long_program, "samples/slot/cell.toml", progress=stop)


def test_an_identification_tells_its_stages_and_is_called_off():
    folder = "samples/closed-loop"
    run = {"runs": [(f"{folder}/part.mod", f"{folder}/measured.csv")], "cell": f"{folder}/cell.toml"}
    steps = []
    deflex.identify(**run, progress=lambda done, total: steps.append((done, total)))
    assert steps[-1] == (1000, 1000) and [done for done, _ in steps] == sorted(done for done, _ in steps)

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
    texts = {given(table)[1].decode() for table in (columns, pandas.DataFrame(columns), polars.DataFrame(columns))}
    assert len(texts) == 1
    fields = [line.split(",")[1] for line in texts.pop().splitlines()[1:]]
    assert [float(field) for field in fields] == values
    assert given(pandas.DataFrame({"name": ["a,b"], "x": [np.nan]}))[1] == b'name,x\n"a,b",\n'
    nullable = pandas.DataFrame({"target": pandas.array([1, None], dtype="Int64"), "holdout": [True, False]})
    assert given(nullable)[1] == b"target,holdout\n1,1\n,0\n"
    assert given({"target": np.array([1, 2]), "holdout": list(np.array([True, False]))})[1] == b"target,holdout\n1,1\n2,0\n"
    assert given({"x": [0.1, -0.0, 1e-17, 1e300, 0.5], "n": [2**40, -1, 0, 7, None]})[1] == (
        b"x,n\n0.1,1099511627776\n0,-1\n1e-17,0\n1e300,7\n0.5,\n"
    )
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
        assert twin == cell and hash(twin) == hash(cell) and twin is not cell
        assert (twin.to_toml(), twin.name) == (cell.to_toml(), cell.name)
    assert deflex.Cell.parse(cell.to_toml() + "\n", cell.name) != cell


def twins(original: object) -> list[object]:
    return [pickle.loads(pickle.dumps(original)), copy.deepcopy(original), copy.copy(original)]


def test_programs_robots_effects_and_messages_are_copied_and_compared(tmp_path):
    program = deflex.Program.read("samples/slot/slot.mod")
    cell = deflex.Cell.read("samples/closed-loop/cell.toml")
    for original in (program, deflex.Robot("irb6660-205-1.9"), cell.robot):
        for twin in twins(original):
            assert twin == original and hash(twin) == hash(original) and repr(twin) == repr(original)
    assert deflex.Robot("irb6660-205-1.9") != deflex.Robot("irb120-3-0.58") and cell.robot != deflex.Robot(cell.robot.model)
    (sent,) = pickle.loads(pickle.dumps([program]))
    assert deflex.compensate(sent, "samples/slot/cell.toml").text == deflex.compensate(program, "samples/slot/cell.toml").text
    other = tmp_path / "slot.mod"
    other.write_text(open("samples/slot/slot.mod").read() + " ")
    assert deflex.Program.read(other) != program
    for effect in cell.effects:
        assert all(twin == effect for twin in twins(effect))
    with pytest.raises(deflex.DeflexError) as raised:
        deflex.Program.read("no such file.mod")
    sent = pickle.loads(pickle.dumps(raised.value))
    assert str(sent) == str(raised.value) and sent.diagnostics == raised.value.diagnostics


def test_results_are_copied_and_compared():
    program, cell = "samples/slot/slot.mod", "samples/slot/cell.toml"
    forces = {"target": [1, 2], "fx_n": [100.0, 0.0], "fy_n": [0.0, 0.0], "fz_n": [0.0, 50.0]}
    done = deflex.compensate(program, cell)
    results = [done, deflex.predict(program, cell, forces), deflex.check(program, cell, max_error_mm=0.1)]
    results += [deflex.diff(program, program), deflex.inspect(program)]
    for result in results:
        for twin in twins(result):
            assert twin == result and repr(twin) == repr(result) and twin.html == result.html and twin.json == result.json
    assert done != deflex.compensate(program, cell, free_spin=True) and done != results[1]
    sent = pickle.loads(pickle.dumps(done))
    assert sent.files == done.files and not sent.report["error_mm"].flags.writeable
    assert (sent.unrounded["error_mm"] == done.unrounded["error_mm"]).all()


def test_effects_have_names_values_units_and_priors():
    cell = deflex.Cell.read("samples/closed-loop/cell.toml")
    text = 'kind = "backlash"\nhalf_gap_rad = [1e-4, 0.0, 0.0, 0.0, 0.0, 2e-4]\n'
    gap = deflex.Effect.parse(text, (1e-12 * np.eye(6)).tolist())
    assert gap.names[0] == "half_gap_rad[0]" and gap.units == ["rad"] * len(gap.names)
    assert gap.values[0] == 1e-4 and gap.values[5] == 2e-4 and (gap.bounds[:, 0] == 0).all()
    assert (gap.prior_mean == 0).all() and (gap.prior_std > 0).all() and (gap.covariance == 1e-12 * np.eye(6)).all()
    wider = cell.with_effects([*cell.effects, gap])
    assert wider.effects == [*cell.effects, gap] and [effect.kind for effect in wider.effects][-1] == "backlash"
    assert wider.with_effects(cell.effects).effects == cell.effects
    # What is in the file stays as it is; other values have no covariance.
    assert wider.with_effects(wider.effects) == wider
    doubled = gap.with_values(2 * gap.values)
    assert doubled.covariance is None and (doubled.values == 2 * gap.values).all()
    assert wider.with_effects([*cell.effects, doubled]).effects[-1] == doubled
    with pytest.raises(ValueError, match="expected 0"):
        gap.with_values(-gap.values)
    with pytest.raises(ValueError, match="no kind of effect"):
        deflex.Effect.parse('kind = "backslash"')
    # Twice the stiffness, half the deflection: both cells have the joints alone.
    slot = deflex.Cell.read("samples/slot/cell.toml")
    springs = next(line for line in slot.to_toml().splitlines() if line.startswith("joint_nm_per_rad"))
    numbers = np.array([float(number) for number in springs.split("[")[1].split("]")[0].split(",")])
    stiffer = slot.with_stiffness(2 * numbers)
    q, force = [[0, 20, 10, 0, 60, 0]], [[0, 0, 10.0]]
    sag = [(c.predict_poses(q, force) - c.predict_poses(q))[0, :3, 3] for c in (slot, stiffer)]
    assert np.allclose(sag[0], 2 * sag[1], rtol=1e-3) and np.linalg.norm(sag[1]) > 0


def test_words_that_are_no_options_are_refused():
    cell = "samples/slot/cell.toml"
    with pytest.raises(ValueError, match="post is 'fanuc', expected one of 'rapid', 'krl', 'ls', 'ur', 'jbi', 'cl'"):
        deflex.compensate("samples/slot/slot.mod", cell, post="fanuc")
    with pytest.raises(ValueError, match="ask is 'always'"):
        deflex.plan(cell, 24, ask="always")
    with pytest.raises(ValueError, match="post is 'cl'"):
        deflex.plan(cell, 24, post="cl")
