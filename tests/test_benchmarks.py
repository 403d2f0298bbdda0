"""The benchmark scripts, which no other test runs, find what they time."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[1] / "scripts"


@pytest.mark.parametrize("name", sorted(path.stem for path in SCRIPTS.glob("bench_*.py")))
def test_a_benchmark_finds_all_that_it_names(name, monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    for package in ("Pynite", "openseespy.opensees"):
        if package.partition(".")[0] in (SCRIPTS / f"{name}.py").read_text():
            pytest.importorskip(package)
    module = importlib.import_module(name)
    for text, owner, function in getattr(module, "PARTS", ()):
        assert callable(getattr(owner, function, None)), f"{text}: {owner.__name__} has no {function}"
