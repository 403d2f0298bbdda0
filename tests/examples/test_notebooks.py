"""The notebooks run from top to bottom, in the folder that `prup-pin examples --copy` makes."""

import ast
import shutil
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pytest
from nbclient import NotebookClient

from .test_robots import EXAMPLES

NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


#: A kernel of its own for each takes long; cells of the others run in the process of the tests.
IN_A_KERNEL = [pytest.param(path, marks=[pytest.mark.slow] if path.stem != "workspace" else []) for path in NOTEBOOKS]
IN_PROCESS = [
    pytest.param(path, marks=[pytest.mark.slow] if path.stem == "diagnosis" else [])
    for path in NOTEBOOKS
    if path.stem != "workspace"
]


@pytest.mark.parametrize("path", IN_A_KERNEL, ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path):
    for file in filter(Path.is_file, EXAMPLES.iterdir()):
        shutil.copy(file, tmp_path)
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    assert sum(output.output_type in ("display_data", "execute_result") for output in outputs) >= 2


@pytest.mark.parametrize("path", IN_PROCESS, ids=lambda path: path.stem)
def test_its_cells_run(path, tmp_path, monkeypatch, remembered):
    for file in filter(Path.is_file, EXAMPLES.iterdir()):
        shutil.copy(file, tmp_path)
    monkeypatch.chdir(tmp_path)
    names, shown = {"__name__": "__main__"}, []
    try:
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "code":
                shown.append(run_cell(cell.source, names))
        figures = plt.get_fignums()
    finally:
        plt.close("all")
    pages = [value._repr_html_() for value in shown if hasattr(value, "_repr_html_")]
    assert len(pages) + len(figures) >= 2
    assert all(len(page) > 500 for page in pages)


def run_cell(source, names):
    """Run a cell in a notebook's names and return what it shows: the value of its last line, unless that ends in ;."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) and not source.endswith(";") else None
    exec(compile(tree, "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_ships_without_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(code) >= 4
    assert all(cell.execution_count is None and not cell.outputs for cell in code)


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["diagnosis", "stiffness", "workspace"]
