"""The page of what is promised names what is there, and all of it."""

import re
from importlib import import_module
from pathlib import Path

import prup_pin

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "public.md").read_text()
ROWS = [line.split("|")[1:3] for line in PAGE.splitlines() if line.startswith("| `prup_pin")]


def test_every_name_is_there():
    found = 0
    for modules, names in ROWS:
        homes = [import_module(name) for name in re.findall(r"`(prup_pin[.\w]*)`", modules)]
        for name in re.findall(r"`(\w+)`", names):
            assert name == "prup_pin" or any(hasattr(home, name) for home in homes), name
            found += 1
    assert found > 40


def test_what_the_package_offers_is_promised():
    first = ROWS[0][1]
    errors = {name for name in prup_pin.__all__ if name.endswith(("Error", "Warning")) or name == "Problem"}
    assert {*prup_pin.__all__} - errors == {*re.findall(r"`(\w+)`", first)}
