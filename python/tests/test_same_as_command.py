"""Every figure of the module is the command's, bit for bit."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

import deflex

SAMPLES = [("slot/slot.mod", "slot"), ("blade/blade.aptsource", "blade"), ("stock/part.mod", "stock")]


def same_report(report: dict, text: str) -> None:
    """The arrays hold the very figures of a CSV report."""
    rows = list(csv.DictReader(io.StringIO(text)))
    assert rows and list(report) == list(rows[0])
    for name, column in report.items():
        fields = [row[name] for row in rows]
        if column.dtype.kind == "U":
            assert column.tolist() == fields
        elif column.dtype.kind == "i":
            assert column.tolist() == [int(field) for field in fields]
        else:
            expected = np.array([float(field) if field else np.nan for field in fields])
            assert column.dtype == np.float64 and column.tobytes() == expected.tobytes(), name


def same_numbers(run) -> None:
    """What is not rounded rounds to the report, and is not rounded: sizes are those of their components to the last bits."""
    import numpy

    numbers, report = run.unrounded, run.report
    assert list(numbers) == [name for name, column in report.items() if column.dtype == float]
    for name, column in numbers.items():
        assert numpy.allclose(column, report[name], rtol=0, atol=5.01e-4, equal_nan=True), name
        assert not column.flags.writeable and not report[name].flags.writeable
    size = numpy.sqrt(sum(numbers[f"error_{axis}_mm"] ** 2 for axis in "xyz"))
    assert numpy.allclose(size, numbers["error_mm"], rtol=1e-15, atol=0)
    assert not numpy.allclose(report["error_mm"], numbers["error_mm"], rtol=1e-15, atol=0)


def same_summary(summary: dict, file: Path) -> None:
    (written,) = json.loads(file.read_text())["files"]
    assert dict(summary) == written


@pytest.mark.parametrize("program, folder", SAMPLES)
def test_compensate(program, folder, command, tmp_path):
    cell = f"samples/{folder}/cell.toml"
    done = deflex.compensate(f"samples/{program}", cell)
    written, report, summary = (tmp_path / name for name in ("out.mod", "out.csv", "out.json"))
    # To stdout the program has the name of its own file, as here.
    printed = command("compensate", f"samples/{program}", "--cell", cell, "--report", report, "--json", summary)
    (data,) = done.files.values()
    assert data == printed.stdout
    assert done.csv == report.read_text()
    same_report(done.report, report.read_text())
    same_numbers(done)
    same_summary(done.summary, summary)
    done.write(written)
    assert written.read_bytes() == printed.stdout
    assert done.text.encode() == printed.stdout


@pytest.mark.parametrize("program, folder", SAMPLES[:1])
def test_predict(program, folder, command, tmp_path):
    cell = f"samples/{folder}/cell.toml"
    report, summary, page = (tmp_path / name for name in ("out.csv", "out.json", "out.html"))
    command("predict", f"samples/{program}", "--cell", cell, "--report", report, "--json", summary, "--html", page)
    held = deflex.Program.read(f"samples/{program}")
    found = deflex.predict(held, deflex.Cell.read(cell))
    same_report(found.report, report.read_text())
    same_summary(found.summary, summary)
    assert found.html == page.read_text()


def test_options_are_the_command_s(command, tmp_path):
    program, cell, written = "samples/slot/slot.mod", "samples/slot/cell.toml", tmp_path / "out.mod"
    commands = {
        ("--free-spin",): {"free_spin": True},
        ("--correct", "position"): {"correct": "position"},
        ("--subdivide", "0.0001"): {"subdivide_mm": 1e-4},
    }
    texts = set()
    for arguments, options in commands.items():
        command("compensate", program, "--cell", cell, *arguments, "-o", written)
        texts.add(written.read_text())
        assert deflex.compensate(program, cell, **options).text == written.read_text(), arguments
    assert len(texts) == len(commands)


def test_a_long_program_is_streamed_to_the_same_bytes(long_program, steep_cell, command, tmp_path):
    written, report = tmp_path / "out.mod", tmp_path / "out.csv"
    args = ("--cell", steep_cell)
    page = tmp_path / "out.html"
    command("compensate", long_program, *args, "-o", written, "--report", report, "--html", page)
    done = deflex.compensate(long_program, steep_cell)
    assert next(iter(done.files.values())) == written.read_bytes()
    assert done.csv == report.read_text()
    same_numbers(done)
    assert done.html == page.read_text()
    judged = tmp_path / "judged.csv"
    command("predict", written, *args, "--against", long_program, "--report", judged)
    again = deflex.predict(written, steep_cell, against=long_program)
    assert again.csv == judged.read_text()


def test_forces_from_a_file_and_from_a_frame(command, tmp_path):
    import pandas

    cell, program = "samples/closed-loop/cell.toml", "samples/closed-loop/transfer.mod"
    measured = "samples/closed-loop/transfer_measured.csv"
    report = tmp_path / "out.csv"
    command("predict", program, "--cell", cell, "--forces", measured, "--report", report)
    frame = pandas.read_csv(measured)
    for forces in (measured, frame, {name: frame[name] for name in ("target", "fx_n", "fy_n", "fz_n", "time_s") if name in frame}):
        assert deflex.predict(program, cell, forces).csv == report.read_text()


@pytest.mark.slow
def test_identify(command, tmp_path):
    import pandas

    cell, program, measured = (f"samples/closed-loop/{name}" for name in ("cell.toml", "part.mod", "measured.csv"))
    answer, extended, report = tmp_path / "found.json", tmp_path / "cell.toml", tmp_path / "residuals.csv"
    command("identify", "--run", program, measured, "--cell", cell, "-o", extended, "--json", answer, "--report", report)
    found = deflex.identify(runs=[(program, measured)], cell=cell)
    assert found.json == json.loads(answer.read_text())
    assert found.cell.to_toml() == extended.read_text()
    same_report(found.residuals, report.read_text())
    assert found.added[0].kind == "backlash" and found.after.rms_mm < found.before.rms_mm
    assert found.ranking[0]["kind"] and "backlash" in repr(found) and "<iframe" in found._repr_html_()
    # The same rows from a frame: the same answer, but for the name and the hash of what was measured.
    framed = deflex.identify(runs=[(deflex.Program.read(program), pandas.read_csv(measured))], cell=deflex.Cell.read(cell))
    for key in ("added", "before", "after", "ranking", "noise_mm"):
        assert framed.json[key] == found.json[key], key


def test_simulate(command, tmp_path):
    program, cell = "samples/stock/part.mod", tmp_path / "cell.toml"
    # Coarser than the sample's own stock.
    text = Path("samples/stock/cell.toml").read_text()
    cell.write_text(text.replace("resolution_mm = 0.25", "resolution_mm = 1.0"))
    names = ("report", "json", "html", "stl")
    out = {name: tmp_path / f"out.{name}" for name in names}
    command("simulate", program, "--cell", cell, *(part for name in names for part in (f"--{name}", out[name])))
    shares = []
    found = deflex.simulate(program, cell, progress=lambda done, total: shares.append(done / total))
    assert found.csv == out["report"].read_text() and found.stl == out["stl"].read_bytes()
    assert found.html == out["html"].read_text() and found._repr_html_().startswith("<iframe")
    same_report(found.report, out["report"].read_text())
    same_summary(found.summary, out["json"])
    assert shares[-1] == 1 and shares == sorted(shares) and "rms" in repr(found)


def test_columns_of_other_names(command, tmp_path):
    cell, program, measured = (f"samples/closed-loop/{name}" for name in ("cell.toml", "part.mod", "measured.csv"))
    head, rows = Path(measured).read_text().split("\n", 1)
    table = tmp_path / "table.csv"
    table.write_text(head.replace("x_mm", "X Ist", 1) + ",Bemerkung\n" + rows.replace("\n", ",\n"))
    with pytest.raises(deflex.DeflexError, match="Bemerkung|X Ist"):
        deflex.identify(runs=[(program, table)], cell=cell)
    found = deflex.identify(runs=[(program, table)], cell=cell, columns={"x_mm": "X Ist"})
    assert found.before.rms_mm == deflex.identify(runs=[(program, measured)], cell=cell).before.rms_mm


def test_cl_data_in_other_languages(command, tmp_path):
    program, cell = "samples/blade/blade.aptsource", "samples/blade/cell.toml"
    for post, ending in (("krl", "src"), ("ls", "ls"), ("ur", "script"), ("jbi", "JBI"), ("cl", "aptsource")):
        written = tmp_path / post
        answer = command("compensate", program, "--cell", cell, "--post", post, "--out-dir", written, code=None)
        if answer.returncode:
            with pytest.raises(deflex.DeflexError):
                deflex.compensate(program, cell, post=post)
            continue
        done = deflex.compensate(program, cell, post=post)
        assert done.files and all((written / name).read_bytes() == data for name, data in done.files.items()), ending
    with pytest.raises(ValueError, match="expected"):
        deflex.compensate(program, cell, post="apt")


def test_plan(command, tmp_path):
    text = Path("samples/blade/cell.toml").read_text()
    cell = tmp_path / "cell.toml"
    cell.write_text(
        text + '\n[plan]\nwobj = "wPart"\ntool = "tMill"\nbox_mm = [[0, 0, 0], [200, 200, 80]]\ntilt_deg = 20.0\n'
        'loads_n = [[0, 0, 0], [0, 0, 300]]\nload_changes = 1\ninstrument = "position"\nnoise_mm = 0.02\neffect_mm = 0.05\n'
        'effects = ["backlash", "gravity"]\n'
    )
    written, table, answer = (tmp_path / name for name in ("plan.mod", "plan.csv", "plan.json"))
    command("plan", "--cell", cell, "--rows", 12, "-o", written, "--measured", table, "--json", answer)
    shares = []
    planned = deflex.plan(cell, 12, progress=lambda done, total: shares.append(done / total))
    assert planned.program == written.read_text() and planned.table == table.read_text()
    assert planned.json == json.loads(answer.read_text())
    assert shares[-1] == 1 and len(planned.json.rows) == 12
    with pytest.raises(ValueError, match="8 to 500"):
        deflex.plan(cell, 3)


def test_the_command_is_the_module(command):
    assert command("--version").stdout.decode().split() == ["deflex", deflex.__version__]
    assert b"deflex compensate" in command("--help").stdout
    command("predict", "samples/slot/slot.mod", code=2)
    assert "usage" in command("predict", code=2).stderr.decode().lower()


@pytest.mark.parametrize("options", [{"max_error_mm": 0.1}, {"max_error_mm": 5.0, "max_correction_mm": 0.05}, {"max_error_mm": 1.0, "at_targets": True}])
def test_check(options, command, tmp_path):
    program, cell = "samples/slot/slot.mod", "samples/slot/cell.toml"
    report, answer, page = (tmp_path / name for name in ("out.csv", "out.json", "out.html"))
    words = [f"--{name.removesuffix('_mm').replace('_', '-')}" for name in options]
    args = [part for word, value in zip(words, options.values()) for part in ((word,) if value is True else (word, value))]
    base = ("check", program, "--cell", cell, *args)
    printed = command(*base, "--json", answer, "--report", report, "--html", page, code=None)
    found = deflex.check(program, cell, **options)
    assert found.passed == (printed.returncode == 0) and found.text.encode() == printed.stdout
    assert found.json == json.loads(answer.read_text())
    assert found.html == page.read_text()
    same_report(found.report, report.read_text())
    for form in ("sarif", "junit"):
        assert getattr(found, form).encode() == command(*base, "--output-format", form, code=None).stdout


def test_check_of_a_long_program_and_against_its_original(long_program, steep_cell, command, tmp_path):
    answer, report = tmp_path / "out.json", tmp_path / "out.csv"
    args = ("--cell", steep_cell, "--max-error", 0.05, "--json", answer, "--report", report)
    command("check", long_program, *args, code=1)
    found = deflex.check(long_program, steep_cell, max_error_mm=0.05)
    assert not found.passed and found.json == json.loads(answer.read_text()) and found.csv == report.read_text()
    done = deflex.compensate("samples/slot/slot.mod", "samples/slot/cell.toml")
    done.write(tmp_path / "out.mod")
    judged = {"against": "samples/slot/slot.mod", "max_error_mm": 0.05}
    assert deflex.check(tmp_path / "out.mod", "samples/slot/cell.toml", **judged).passed


def test_an_unreachable_target_is_a_finding(command, tmp_path):
    far = tmp_path / "far.mod"
    far.write_text(Path("samples/slot/slot.mod").read_text().replace("MoveL [[", "MoveL [[9999", 1))
    answer = tmp_path / "out.json"
    command("check", far, "--cell", "samples/slot/cell.toml", "--max-error", 1, "--json", answer, code=1)
    found = deflex.check(far, "samples/slot/cell.toml", max_error_mm=1.0)
    assert not found.passed and found.json == json.loads(answer.read_text())


def test_diff(command, tmp_path):
    original, corrected = "samples/slot/slot.mod", tmp_path / "out.mod"
    deflex.compensate(original, "samples/slot/cell.toml").write(corrected)
    report, answer, page = (tmp_path / name for name in ("out.csv", "out.json", "out.html"))
    printed = command("diff", original, corrected, code=1).stdout
    command("diff", original, corrected, "--report", report, "--json", answer, "--html", page, code=1)
    found = deflex.diff(original, corrected)
    assert found and found.text.encode() == printed and found.csv == report.read_text()
    assert found.json == json.loads(answer.read_text()) and found.html == page.read_text()
    assert len(found.report["shift_mm"]) == len(found.json["moved"])
    assert not deflex.diff(original, original)


def test_inspect(command, tmp_path):
    answer = tmp_path / "out.json"
    printed = command("inspect", "samples/slot", "samples/blade", "--json", answer).stdout
    found = deflex.inspect(["samples/slot", "samples/blade"])
    assert found.text.encode() == printed and found.json == json.loads(answer.read_text())
    command("inspect", "samples/slot/cell.toml", code=2)
    with pytest.raises(deflex.DeflexError, match="recognised"):
        deflex.inspect("samples/slot/cell.toml")


def test_init(command, tmp_path):
    assert deflex.init("irb6660-205-1.9").encode() == command("init", "--robot", "irb6660-205-1.9").stdout
    command("init", "--robot", "irb6660-205-1.8", code=2)
    with pytest.raises(deflex.DeflexError, match="no built-in robot"):
        deflex.init("irb6660-205-1.8")
    with pytest.raises(deflex.DeflexError, match="cannot be read"):
        deflex.init(backup=tmp_path)
    with pytest.raises(ValueError, match="give robot"):
        deflex.init()


PATH_LAW = "\n[controller.path]\nzone_share = 0.5\nsmoothing_s = [0.02, 0.02]\nacceleration_mm_s2 = 3000.0\n"


def test_the_driven_path(command, tmp_path):
    program, cell, path = "samples/slot/slot.mod", tmp_path / "cell.toml", tmp_path / "path.csv"
    cell.write_text(Path("samples/slot/cell.toml").read_text() + PATH_LAW)
    command("predict", program, "--cell", cell, "--path", path)
    same_report(deflex.predict(program, cell).path, path.read_text())
    written = tmp_path / "out.mod"
    done = command("compensate", program, "--cell", cell, "--max-path-error", 0.3, "-o", written, code=None)
    if done.returncode:
        with pytest.raises(deflex.DeflexError):
            deflex.compensate(program, cell, max_path_error_mm=0.3)
    else:
        assert deflex.compensate(program, cell, max_path_error_mm=0.3).text == written.read_text()


@pytest.mark.slow
def test_identify_sparse(command, tmp_path):
    cell, program, measured = (f"samples/closed-loop/{name}" for name in ("cell.toml", "part.mod", "measured.csv"))
    answer, extended = tmp_path / "found.json", tmp_path / "cell.toml"
    command("identify", "--run", program, measured, "--cell", cell, "--sparse", "-o", extended, "--json", answer)
    found = deflex.identify(runs=[(program, measured)], cell=cell, sparse=True)
    assert found.json == json.loads(answer.read_text()) and found.cell.to_toml() == extended.read_text()


def test_a_log_of_another_program_is_refused(tmp_path):
    log = {"time_s": [0.0, 0.1, 0.2], **{f"q{axis}_deg": [0.0, 0.0, 0.0] for axis in range(1, 7)}}
    logs = [("samples/slot/slot.mod", log)] * 2
    with pytest.raises(deflex.DeflexError):
        deflex.identify_path(logs, cell="samples/slot/cell.toml")
