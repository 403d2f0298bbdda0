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
