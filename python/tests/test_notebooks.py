"""The notebooks run from a fresh kernel."""

import os
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="deflex[notebooks] is not installed")
nbclient = pytest.importorskip("nbclient", reason="deflex[notebooks] is not installed")


def run(name: str) -> None:
    path = Path("python/notebooks") / name
    notebook = nbformat.read(path, as_version=4)
    os.environ.setdefault("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    nbclient.NotebookClient(notebook, timeout=900, kernel_name="python3").execute(cwd=str(path.parent))


@pytest.mark.slow
def test_compensate():
    run("compensate.ipynb")


@pytest.mark.slow
@pytest.mark.skipif("DEFLEX_SHARED" not in os.environ, reason="DEFLEX_SHARED names no folder with public data of real robots")
def test_calibrate_ur10():
    run("calibrate_ur10.ipynb")
