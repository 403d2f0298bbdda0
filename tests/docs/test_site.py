"""The documentation site holds every page, and the reference every public name; building it is scripts/test.sh's."""

import re

import pytest
import yaml

import prup_pin
from prup_pin.modules import KINDS

from .carried_out import ROOT

DOCS = ROOT / "docs"


class Loader(yaml.SafeLoader):
    """MkDocs' own tags say nothing here."""


Loader.add_multi_constructor("!", lambda loader, suffix, node: None)
SITE = yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), Loader)


def pages(nav):
    if isinstance(nav, str):
        return [nav]
    entries = nav.values() if isinstance(nav, dict) else nav
    return [page for entry in entries for page in pages(entry)]


def test_every_page_has_its_place():
    listed = pages(SITE["nav"])
    there = [path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")]
    assert sorted(listed) == sorted(there)


def test_pictures_load_quickly():
    """The bound is that of scripts/pictures.py."""
    source = (ROOT / "scripts" / "pictures.py").read_text(encoding="utf-8")
    (most,) = map(int, re.findall(r"^LARGEST = ([\d_]+)", source, re.MULTILINE))
    sizes = {path.name: path.stat().st_size for path in (DOCS / "pictures").glob("*.png")}
    assert len(sizes) > 10
    assert not {name: size for name, size in sizes.items() if size > most}


def test_a_reader_finds_the_words_of_the_field():
    """Search leads to pages whose headings and text hold a word."""
    text = (DOCS / "words.md").read_text(encoding="utf-8")
    for word in (
        "Manipulability",
        "condition number",
        "VJM",
        "MSA",
        "virtual joint method",
        "Jacobian",
        "eigenfrequency",
    ):
        assert word.lower() in text.lower(), word
    rows = re.findall(r"^\| (\*\*.*) \| (.*) \|$", text, re.MULTILINE)
    assert len(rows) > 20
    assert all(re.search(r"\]\(|`|above|same", told) for _, told in rows)


def test_the_page_on_trials_says_what_their_tables_say():
    """Counts such as 43/45, and the number of devices, stand in the page that a row leads to."""
    text = (DOCS / "trials.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[.*\]\((\w+\.md)\) \| (.*) \| (\d+) \|$", text, re.MULTILINE)
    assert len(rows) >= 6
    alarms = asked_alarms = right = single = 0
    for page, counts, devices in rows:
        tables = (DOCS / page).read_text(encoding="utf-8")
        found = re.findall(r"\d+/\d+", counts)
        assert len(found) == 3
        assert re.search(rf"\b{devices}\b", tables)
        assert not [count for count in found if f"({count};" not in tables], page
        (told, faults), (none, asked) = (map(int, count.split("/")) for count in found[:2])
        alarms, asked_alarms, right, single = alarms + none, asked_alarms + asked, right + told, single + faults
    assert f"Right are {right} of {single}, {100 * right / single:.0f} %." in text
    how_many = ("No false alarm", "There was one false alarm", f"There were {alarms} false alarms")[min(alarms, 2)]
    assert f"{how_many} in {asked_alarms} devices" in text
    behind = {path.name for path in DOCS.glob("*_trials.md")}
    assert behind <= set(re.findall(r"\((\w+_trials\.md)\)", text)), "a page of tables that no reader is led to"


def test_warnings_are_errors():
    assert SITE["strict"] is True
    assert set(SITE["validation"].values()) == {"warn"}


REFERENCE = "".join(path.read_text(encoding="utf-8") for path in (DOCS / "reference").glob("*.md"))
TOLD = set(re.findall(r"^::: (?:\w+\.)*(\w+)$", REFERENCE, re.MULTILINE))


@pytest.mark.parametrize("name", prup_pin.__all__)
def test_a_public_name_is_in_the_reference(name):
    assert name in TOLD or name in vars(prup_pin.errors)


def test_every_kind_of_module_is_in_the_reference():
    assert {type(kind).__name__ for kind in KINDS} <= TOLD | {"BeamAsPublished"}
    assert {"Law", "Effect", "Place"} <= TOLD


def test_what_arguments_are_is_a_list_in_the_reference(monkeypatch):
    pytest.importorskip("griffe")
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    from docstrings import markdown

    text = """Return it all.

    mass: in kg, of <b>
    all; size (n,) [m]: how large, see a: b.

    Raises InputError: never."""
    items = "- `mass`: in kg, of &lt;b> all\n- `size` (n,) [m]: how large, see a: b."
    assert markdown(text, {"mass", "size", "a"}) == f"Return it all.\n\n{items}\n\nRaises InputError: never."
