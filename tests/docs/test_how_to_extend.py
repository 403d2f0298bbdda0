"""The pages on extending the package, word for word."""

import re

import pytest

from prup_pin.laws.deeds import DEEDS

from .carried_out import BLOCK, ROOT, carry_out, python


def test_every_kind_of_deed_is_told():
    page = (ROOT / "docs" / "add_a_law.md").read_text(encoding="utf-8")
    table = page.partition("| deed | what it does |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`([A-Z]\w+)\([^`]*\)`", table)) == {deed.__name__ for deed in DEEDS}


def contract(folder, *arguments):
    """Run contract tests in a copied tree; return how many passed."""
    printed = python(folder, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "addopts=", *arguments)
    assert " failed" not in printed
    return int(printed.rsplit(" passed", 1)[0].split()[-1])


PAGES = ["add_a_law.md", "add_a_module.md", "add_a_log_format.md", "add_a_channel.md"]


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A tree with all that the pages add, and what the scripts of each page printed there."""
    folder = tmp_path_factory.mktemp("extended")
    return folder, {page: carry_out(f"docs/{page}", folder) for page in PAGES}


@pytest.mark.parametrize(("page", "things"), [(PAGES[0], 2), *((page, 1) for page in PAGES[1:])])
def test_each_is_one_file_of_the_package_and_a_line_or_two(page, things):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    blocks = [(found["what"], found["text"]) for found in BLOCK.finditer(text)]
    new = [what for what, _ in blocks if what.startswith("file: prup_pin/")]
    lines = [put for what, put in blocks if what.startswith("line: prup_pin/")]
    assert len(new) == things
    assert sum(put.count("\n") for put in lines) <= 2 * things
    assert len({what.partition(",")[0] for what, _ in blocks if what.startswith("line: prup_pin/")}) == things


@pytest.mark.slow
def test_a_law_of_either_channel_is_told_and_found(extended):
    folder, printed = extended
    poses, efforts, own = printed["add_a_law.md"]
    assert poses.split()[:2] == ["explained", "settling"]
    assert (folder / "settling.png").stat().st_size > 10_000
    assert efforts.split()[:3] == ["explained", "quadratic_drag", "carriage"]
    assert own.split()[:3] == ["explained", "pulling_hose", "carriage"]
    assert "brought by  hose.py (sha256" in python(
        folder, "-m", "prup_pin", "laws", "pulling_hose", "--with", "hose.py"
    )
    assert "quadratic_drag, in efforts" in python(folder, "-m", "prup_pin", "laws", "windage")


@pytest.mark.slow
def test_a_module_is_one_file_and_one_line(extended):
    inside, own = extended[1]["add_a_module.md"]
    assert inside.split()[0] == "50.000"
    assert own.split()[0] == "-50.000"


@pytest.mark.slow
def test_a_log_format_is_read_and_refused(extended):
    said, own = extended[1]["add_a_log_format.md"]
    assert own.split() == ["time", "joint_position"]
    assert said.startswith("time joint_position[0] joint_effort[0]")
    assert "line 2" in said


@pytest.mark.slow
def test_a_channel_tells_what_no_other_does(extended):
    assert extended[1]["add_a_channel.md"][0].split()[:3] == ["nothing_missing", "explained", "stiffness_changed"]


@pytest.mark.slow
def test_they_keep_the_contracts(extended):
    folder, _ = extended
    files = "tests/laws/test_contract.py", "tests/diagnosis/test_influence.py", "tests/modules/test_contract.py"
    names = "settling", "compose", "rubber_mount", "example"
    assert contract(folder, *files, "-k", " or ".join(names)) > 16
    assert contract(folder, "tests/laws/test_effort_laws.py", "-k", "QuadraticDrag") > 12
    assert contract(folder, "tests/test_laws_are_opaque.py") > 50
