"""The pages on extending the package, word for word."""

import pytest

from .carried_out import carry_out, python


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
    _, (printed,) = with_law
    assert printed.split()[:2] == ["explained", "settling"]


def test_the_new_law_keeps_the_contract(with_law):
    folder, _ = with_law
    assert contract(folder, "tests/laws/test_contract.py", "-k", "Settling or compose") > 20
    assert contract(folder, "tests/diagnosis/test_influence.py", "-k", "settling") >= 1
