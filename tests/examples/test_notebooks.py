"""The notebooks run from top to bottom, in the folder that `prup-pin examples --copy` makes."""

import shutil

import nbformat
import pytest
from nbclient import NotebookClient

from .test_robots import EXAMPLES

NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path):
    for file in EXAMPLES.iterdir():
        shutil.copy(file, tmp_path)
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    assert sum(output.output_type in ("display_data", "execute_result") for output in outputs) >= 2


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_ships_without_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(code) >= 4
    assert all(cell.execution_count is None and not cell.outputs for cell in code)


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["diagnosis", "stiffness", "workspace"]
