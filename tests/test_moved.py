"""Modules that stand elsewhere now can be imported by their old names, which say the new ones."""

import importlib

import pytest

from prup_pin._moved import MOVED


@pytest.mark.parametrize(("old", "new"), MOVED.items())
def test_an_old_name_is_the_new_module_and_says_so(old, new):
    with pytest.warns(DeprecationWarning, match=rf"prup_pin\.{old} is prup_pin\.{new} now"):
        assert importlib.import_module(f"prup_pin.{old}") is importlib.import_module(f"prup_pin.{new}")
