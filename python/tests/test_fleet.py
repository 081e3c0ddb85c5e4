"""Many programs over two workers, one of which is killed on the way: all results, and the bytes of one process."""

import os
import shutil
import signal
import time

import pytest

import deflex

distributed = pytest.importorskip("distributed", reason="deflex[dask] is not installed")


@pytest.fixture(scope="module")
def client():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            yield client


def pids(client) -> list[int]:
    return list(client.run(os.getpid).values())


def test_a_killed_worker_loses_nothing(client, tmp_path):
    import deflex.fleet

    programs = []
    for i in range(12):
        path = tmp_path / f"part_{i}.mod"
        shutil.copy("samples/slot/slot.mod", path)
        programs.append(path)
    refused = tmp_path / "refused.mod"
    refused.write_text("MODULE refused\n  PROC main(\nENDMODULE\n")
    before, killed = pids(client), []

    def kill(done: int, total: int) -> None:
        if not killed:
            killed.append(before[0])
            os.kill(before[0], signal.SIGKILL)

    cell = os.path.abspath("samples/slot/cell.toml")
    found = deflex.fleet.compensate([*programs, refused], cell, client=client, progress=kill)
    assert killed and [row.name for row in found.rows] == [*map(str, programs), str(refused)]
    assert [row.name for row in found.failed] == [str(refused)] and "refused.mod" in found.failed[0].error
    for path in programs:
        assert found.files[str(path)] == deflex.compensate(path, cell).files
    assert found.table["targets"][:12] == [81] * 12 and found.table["targets"][12] is None
    deadline = time.monotonic() + 30
    while len(client.scheduler_info()["workers"]) < 2 and time.monotonic() < deadline:
        time.sleep(0.2)
    assert before[0] not in pids(client)


def test_into_a_folder(client, tmp_path):
    import deflex.fleet

    out = tmp_path / "out"
    found = deflex.fleet.compensate([os.path.abspath("samples/slot/slot.mod")], deflex.Cell.read("samples/slot/cell.toml"), client=client, out_dir=out)
    assert not found.failed and found.files == {found.rows[0].name: {}}
    done = deflex.compensate("samples/slot/slot.mod", "samples/slot/cell.toml")
    assert (out / "slot.mod").read_bytes() == done.files["slot.mod"]
    assert (out / "slot.report.csv").read_text() == done.csv


def test_a_task_that_fails_otherwise_is_tried_again(client, tmp_path):
    from deflex.fleet import _mapped

    def flaky(marker):
        if not os.path.exists(marker):
            with open(marker, "w"):
                raise OSError("a share that was away")
        return {"error": None}, {"made": b"1"}

    marker = str(tmp_path / "marker")
    once = _mapped(flaky, [("a", (marker,))], client, 0, None)
    assert "a share that was away" in once.failed[0].error
    os.remove(marker)
    again = _mapped(flaky, [("a", (marker,))], client, 1, None)
    assert not again.failed and again.files == {"a": {"made": b"1"}}


@pytest.mark.slow
def test_a_fleet_is_identified(client, tmp_path):
    import deflex.fleet

    part, measured, cell = (os.path.abspath(f"samples/closed-loop/{name}") for name in ("part.mod", "measured.csv", "cell.toml"))
    foreign = tmp_path / "foreign.csv"
    foreign.write_text("target,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n100000,1,2,3,0,0,0\n")
    fleet = {f"robot {n}": ([(part, measured)], cell) for n in range(3)} | {"robot 3": ([(part, str(foreign))], cell)}
    before, steps = pids(client), []

    def kill(done: int, total: int) -> None:
        if not steps:
            os.kill(before[0], signal.SIGKILL)
        steps.append((done, total))

    found = deflex.fleet.identify(fleet, client=client, progress=kill)
    assert steps == [(done, 4) for done in range(1, 5)] and [row.name for row in found.rows] == list(fleet)
    assert [row.name for row in found.failed] == ["robot 3"] and "foreign.csv" in found.failed[0].error
    alone = deflex.identify(runs=[(part, measured)], cell=cell)
    for row in found.rows[:3]:
        assert row.added == ["backlash"] and row.after_rms_mm < row.before_rms_mm
        assert found.files[row.name] == {"cell.toml": alone.cell.to_toml().encode()}, "the bytes of one process"
