"""Types, stubs, examples in docstrings."""

import doctest
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

from conftest import ROOT

import flank

PACKAGE = Path(flank.__file__).parent


def modules():
    return [importlib.import_module(f"flank.{info.name}") for info in pkgutil.iter_modules([str(PACKAGE)])]


def test_types_hold():
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_stubs_are_those_of_the_module():
    done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "flank._flank"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_examples_in_docstrings_hold():
    tried = 0
    for module in [flank, *modules()]:
        failed, count = doctest.testmod(module)
        assert failed == 0, module.__name__
        tried += count
    assert tried > 10


def test_every_public_name_is_described():
    assert (PACKAGE / "py.typed").exists()
    for name in flank.__all__:
        item = getattr(flank, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(item), name
        if inspect.isfunction(item) and inspect.signature(item).parameters:
            text = inspect.getdoc(item) or ""
            assert "Parameters\n----------" in text, name
            for parameter in inspect.signature(item).parameters:
                # Parameters of one description stand in one line.
                assert re.search(rf"^[\w*, ]*\*?\*?\b{re.escape(parameter)}\b[\w*, ]*(:|$)", text, re.M), (name, parameter)
        if inspect.isclass(item):
            for attribute, value in vars(item).items():
                if not attribute.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                    assert inspect.getdoc(value), (name, attribute)
