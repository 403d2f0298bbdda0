"""The pages on extending the package, word for word."""

import re

import pytest

from prup_pin.laws.deeds import DEEDS

from .carried_out import ROOT, carry_out, python


def test_every_kind_of_deed_is_told():
    page = (ROOT / "docs" / "add_a_law.md").read_text(encoding="utf-8")
    table = page.partition("| deed | what it does |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`([A-Z]\w+)\([^`]*\)`", table)) == {deed.__name__ for deed in DEEDS}


def contract(folder, *arguments):
    """Run contract tests in a copied tree; return how many passed."""
    printed = python(folder, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", "addopts=", *arguments)
    assert " failed" not in printed
    return int(printed.rsplit(" passed", 1)[0].split()[-1])


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A tree with another law and another module, and what the scripts of either page printed there."""
    folder = tmp_path_factory.mktemp("extended")
    return folder, [carry_out(page, folder) for page in ("docs/add_a_law.md", "docs/add_a_module.md")]


def test_a_law_is_one_file_and_one_line(extended):
    folder, ((printed,), _) = extended
    assert printed.split()[:2] == ["explained", "settling"]
    assert (folder / "settling.png").stat().st_size > 10_000


def test_a_module_is_one_file_and_one_line(extended):
    _, (_, (printed,)) = extended
    assert printed.split()[0] == "50.000"


def test_they_keep_the_contracts(extended):
    folder, _ = extended
    files = "tests/laws/test_contract.py", "tests/diagnosis/test_influence.py", "tests/modules/test_contract.py"
    names = "settling", "compose", "rubber_mount", "example"
    assert contract(folder, *files, "-k", " or ".join(names)) > 16
