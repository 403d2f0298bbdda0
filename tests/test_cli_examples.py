"""`prup-pin examples`: what ships to begin with, listed and copied."""

import subprocess
import sys
from pathlib import Path

from prup_pin.robots import examples_folder

FILES = [path for path in examples_folder().iterdir() if path.is_file()]


def test_every_file_is_listed_with_what_it_is(run):
    done = run("examples")
    assert done.exit_code == 0
    rows = {words[0]: words[1:] for line in done.stdout.splitlines() if (words := line.split())}
    for path in FILES:
        assert rows[path.name], path.name
    assert " ".join(rows["six_ups.urdf"]).startswith("A 6-UPS platform")
    assert " ".join(rows["diagnosis.ipynb"]) == "a notebook: What did the simulation leave out?"
    assert rows["plan.json"] == ["a", "test", "plan"]
    assert "prup-pin examples --copy DIR" in done.stdout


def test_they_are_copied_as_they_are_and_again_without_harm(run, tmp_path):
    folder = tmp_path / "new" / "folder"
    for _ in range(2):
        done = run("examples", "--copy", folder)
        assert done.exit_code == 0, done.output
        copied = {path.name: path.read_bytes() for path in folder.iterdir()}
        assert copied == {path.name: path.read_bytes() for path in FILES}
    assert "bench.csv" in copied


def test_a_file_of_ones_own_is_never_replaced(run, tmp_path):
    (tmp_path / "bench.csv").write_text("mine")
    done = run("examples", "--copy", tmp_path)
    assert done.exit_code == 2
    assert "has other files of these names: bench.csv. Nothing was copied" in " ".join(done.output.split())
    assert [path.name for path in tmp_path.iterdir()] == ["bench.csv"]
    assert (tmp_path / "bench.csv").read_text() == "mine"


def test_a_disk_that_is_full_leaves_nothing_and_the_next_call_copies(run, tmp_path):
    limited = (
        "import resource, runpy, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)); "
        f"sys.argv = ['prup-pin', 'examples', '--copy', {str(tmp_path)!r}]; "
        "runpy.run_module('prup_pin', run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", limited], capture_output=True, text=True)
    assert done.returncode == 2, done.stderr
    assert "nothing was copied" in " ".join(done.stderr.split())
    assert not list(tmp_path.iterdir())
    assert run("examples", "--copy", tmp_path).exit_code == 0
    assert (tmp_path / "bench.csv").read_bytes() == (examples_folder() / "bench.csv").read_bytes()


def test_a_file_is_no_folder(run, tmp_path):
    (tmp_path / "file").write_text("")
    done = run("examples", "--copy", tmp_path / "file")
    assert done.exit_code == 2
    assert "is not a folder" in " ".join(done.output.split())


def test_examples_are_copied_into_a_clone(tmp_path):
    """README's own commands are typed there: no example is called as a file of the clone is."""
    clone = Path(__file__).resolve().parents[1]
    there = {path.name for path in clone.iterdir()}
    assert not there & {path.name for path in FILES}


def test_what_is_copied_names_nothing_that_only_a_clone_has():
    for path in FILES:
        assert "scripts/" not in path.read_text(encoding="utf-8"), path.name
