"""The examples of the documentation run: of Python's own modules and of the compiled one."""

import doctest
import importlib
import runpy
from pathlib import Path

import pytest

import deflex
from deflex import _deflex, _results, _run, _tables


@pytest.mark.parametrize("module", [deflex, _results, _run, _tables])
def test_examples_of_modules(module):
    found = doctest.testmod(module, extraglobs={"deflex": deflex})
    assert found.failed == 0 and found.attempted > 0


def test_examples_of_the_compiled_module():
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    undocumented = []
    for owner in (_deflex.Cell, _deflex.Effect, _deflex.Program, _deflex.Robot, _deflex.Diagnostic):
        for name, thing in vars(owner).items():
            if name.startswith("_"):
                continue
            doc = getattr(thing, "__doc__", None) or getattr(getattr(owner, name), "__doc__", None)
            if not doc:
                undocumented.append(f"{owner.__name__}.{name}")
                continue
            runner.run(parser.get_doctest(doc, {"deflex": deflex}, name, None, None))
    found = runner.summarize(verbose=False)
    assert not undocumented and found.failed == 0 and found.attempted > 5


@pytest.mark.parametrize("name", ["compensate.py", "kinematics.py", "identify.py"])
@pytest.mark.slow
def test_examples_run(name, capsys):
    runpy.run_path(str(Path("python/examples") / name), run_name="__main__")
    assert capsys.readouterr().out


def test_stubs_name_what_is_there():
    """Every public name of the stub is in the module, and the other way round."""
    import ast

    stub = ast.parse(Path(importlib.import_module("deflex").__file__).with_name("_deflex.pyi").read_text())
    for node in stub.body:
        if isinstance(node, ast.ClassDef) and node.name != "DeflexError":
            declared = {part.name for part in node.body if isinstance(part, ast.FunctionDef) and not part.name.startswith("_")}
            there = {name for name in vars(getattr(_deflex, node.name)) if not name.startswith("_")}
            assert declared == there, node.name
        elif isinstance(node, ast.FunctionDef):
            assert hasattr(_deflex, node.name)
