"""Links between the pages lead somewhere."""

import re
from pathlib import Path

import pytest

from .carried_out import ROOT

PAGES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "examples/EXAMPLES.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
_LINK = re.compile(r"(?<!`)\[[^\]]*\]\(([^)\s]+)\)")
_FILE = re.compile(r"`(?:python |bash )?((?:\w+/)+[\w.]*)[`: ]")
_FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Return what a page's headings are called in links, as GitHub does it."""
    headings = re.findall(r"^#+ +(.*)$", _FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_relative_link_leads_to_a_file_and_a_heading(page):
    for target in _LINK.findall(_FENCE.sub("", page.read_text(encoding="utf-8"))):
        if re.match(r"\w+:", target):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), f"{page.name}: {target} is not there"
        if anchor:
            assert anchor in anchors(there), f"{page.name}: {target}: {there.name} has no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_is_named_is_there(page):
    """In `backticks`, from the project's folder or from the package's; pages that write files name those as well."""
    text = page.read_text(encoding="utf-8")
    written = set(re.findall(r"^<!-- file: (\S+) -->", text, re.MULTILINE))
    for path in set(_FILE.findall(_FENCE.sub("", text))) - written:
        assert (ROOT / path).exists() or (ROOT / "prup_pin" / path).exists(), f"{page.name}: {path} is not there"


def test_links_are_found():
    """The pattern sees links and pictures, and nothing in blocks of code."""
    assert _LINK.findall("see [a page](a.md#b) and ![one](c.png)") == ["a.md#b", "c.png"]
    found = [link for page in PAGES for link in _LINK.findall(_FENCE.sub("", page.read_text(encoding="utf-8")))]
    assert len(found) > 30
    assert any("#" in link for link in found)
    assert _FILE.findall("`a/b.py` `c/` `d/e.md: f` `bash x/y.sh` `1/k` `w`") == [
        "a/b.py",
        "c/",
        "d/e.md",
        "x/y.sh",
        "1/k",
    ]
