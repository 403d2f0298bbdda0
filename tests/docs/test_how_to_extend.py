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
def with_law(tmp_path_factory):
    folder = tmp_path_factory.mktemp("law")
    return folder, carry_out("docs/add_a_law.md", folder)


def test_a_law_is_one_file_and_one_line(with_law):
    folder, (printed,) = with_law
    assert printed.split()[:2] == ["explained", "settling"]
    assert (folder / "settling.png").stat().st_size > 10_000


def test_the_new_law_keeps_the_contract(with_law):
    folder, _ = with_law
    files = "tests/laws/test_contract.py", "tests/diagnosis/test_influence.py"
    assert contract(folder, *files, "-k", "settling or compose") >= 11


def test_a_module_is_one_file_and_one_line(tmp_path):
    (printed,) = carry_out("docs/add_a_module.md", tmp_path)
    assert printed.split()[0] == "50.000"
    assert contract(tmp_path, "tests/modules/test_contract.py", "-k", "rubber_mount or example") > 5
