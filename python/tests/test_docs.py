"""Examples of the page about Python, and the notebooks."""

import os
import re

import nbclient
import nbformat
import pytest
from conftest import ROOT

NOTEBOOKS = sorted((ROOT / "python" / "notebooks").glob("*.ipynb"))


def test_the_page_about_python_holds(monkeypatch):
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "PYTHON.md").read_text("utf-8"), re.S)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "PYTHON.md", "exec"), names)
    assert len(blocks) >= 7


def texts(notebook) -> list[list[str]]:
    """Return the printed texts of each cell without times."""
    found = []
    for cell in notebook.cells:
        if cell.cell_type == "code" and "times" not in cell.metadata.get("tags", []):
            # A slow cell sends its text in parts.
            streams = ["".join(output.text for output in cell.outputs if output.output_type == "stream")]
            plain = [
                output.data["text/plain"]
                for output in cell.outputs
                if output.output_type == "execute_result" and "text/html" not in output.data and "image/png" not in output.data
            ]
            found.append(streams + plain)
    return found


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_prints_what_it_shows(path):
    shown = nbformat.read(path, as_version=4)
    again = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(again, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}}).execute()
    assert texts(again) == texts(shown)
    assert any(output.get("data", {}).get("image/png") for cell in shown.cells for output in cell.get("outputs", []))
    assert os.path.getsize(path) < 400_000


def test_there_are_three_notebooks():
    assert len(NOTEBOOKS) == 3
