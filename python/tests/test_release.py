"""What a release is made with, as far as it can be tried anywhere: the check of the action, the packed pages of the manual."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the scripts are for a POSIX shell")

PATH = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])


def check(tmp_path, **env) -> subprocess.CompletedProcess:
    cell = "samples/slot/cell.toml"
    env = {"PATH": PATH, "CELL": cell, "SARIF": str(tmp_path / "out.sarif"), "GITHUB_OUTPUT": str(tmp_path / "output"), **env}
    return subprocess.run(["bash", "release/check.sh"], env=env, capture_output=True, text=True, timeout=300)


def test_the_action_gates_a_toolpath(tmp_path):
    assert check(tmp_path, PROGRAMS="samples/slot/*.mod", MAX_ERROR="10").returncode == 0
    assert (tmp_path / "output").read_text() == f"sarif={tmp_path}/out.sarif\n"
    failed = check(tmp_path, PROGRAMS="samples/slot/slot.mod", MAX_ERROR="0.01", ARGUMENTS="--quiet")
    assert failed.returncode == 1, failed.stderr
    (run,) = json.loads((tmp_path / "out.sarif").read_text())["runs"]
    assert run["results"] and run["tool"]["driver"]["name"] == "deflex"
    nothing = check(tmp_path, PROGRAMS="no/such/*.mod", MAX_ERROR="1")
    assert nothing.returncode == 2 and "no program matches" in nothing.stderr


def test_nothing_of_the_arguments_is_run(tmp_path):
    done = check(tmp_path, PROGRAMS="$(touch owned) samples/slot/slot.mod", MAX_ERROR="10", ARGUMENTS="`touch owned`")
    assert done.returncode == 2 and not Path("owned").exists()


def test_manual_and_completions_are_packed(tmp_path):
    binary = shutil.which("deflex", path=PATH)
    subprocess.run(["sh", "release/assets.sh", binary, str(tmp_path)], check=True, timeout=60)
    assert (tmp_path / "man/deflex-compensate.1").is_file()
    assert {path.name for path in (tmp_path / "completions").iterdir()} == {"deflex.bash", "_deflex", "deflex.fish", "_deflex.ps1"}


def test_the_workflow_names_what_is_there():
    """Files that the workflow and the actions run or pack are in the repository; the hook's endings are those of programs."""
    workflow = Path(".github/workflows/release.yml").read_text()
    for name in ("release/assets.sh", "release/Containerfile", ".ci/run", "THIRD-PARTY.md", "LICENSE-MIT", "LICENSE-APACHE", "CHANGELOG.md"):
        assert name in workflow and Path(name).is_file()
    assert "release/check.sh" in Path("action.yml").read_text()
    # The container's build says of the binary what the workflow gives it, and holds nothing else.
    container = Path("release/Containerfile").read_text().splitlines()
    said = [line.split()[0] for line in container if line and not line.startswith("#")]
    assert said == ["FROM", "ARG", "COPY", "WORKDIR", "ENV", "ENTRYPOINT"] and "FROM scratch" in container
    assert "--build-arg BINARY=" in workflow and "COPY ${BINARY} /deflex" in container and 'ENTRYPOINT ["/deflex"]' in container
