"""What is printed about installing is true: a clone is all there is, and an optional package is in its extra."""

import ast
import re
from pathlib import Path

import pytest

from prup_pin.errors import MissingExtraError, imported

ROOT = Path(__file__).resolve().parents[1]


def asked_for():
    """Yield (package, extra or None) of every place in the source that can miss a package."""
    for path in sorted((ROOT / "prup_pin").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("MissingExtraError", "imported"):
                words = [item.value for item in node.args if isinstance(item, ast.Constant)]
                if words:
                    yield words[0].partition(".")[0], words[1] if len(words) > 1 else None


def test_a_package_that_is_missed_is_in_the_extra_that_the_message_names():
    project = pytest.importorskip("tomllib").loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    brought = {None: project["dependencies"], **project["optional-dependencies"]}
    names = {extra: {re.split(r"[>=<\[]", item)[0] for item in items} for extra, items in brought.items()}
    found = list(asked_for())
    assert {"yourdfpy", "example-robot-data", "llvmlite"} <= {package for package, _ in found}
    for package, extra in found:
        assert package in names[extra], f"{package} is not in {extra or 'the dependencies'}"


def test_nobody_is_told_to_fetch_a_distribution_that_does_not_exist():
    """Pages, scripts and messages install the clone's folder."""
    told = re.compile(r"pip install ['\"]?prup[_-]pin")
    paths = [path for part in ("prup_pin", "docs", "scripts", "examples") for path in (ROOT / part).rglob("*")]
    texts = {path: path.read_text(encoding="utf-8") for path in paths if path.suffix in (".py", ".md", ".sh", ".ipynb")}
    texts |= {path: path.read_text(encoding="utf-8") for path in ROOT.glob("*.md")}
    assert not [path for path, text in texts.items() if told.search(text)]
    assert "pip install prup" not in str(MissingExtraError("yourdfpy", "check"))
    assert "pip install yourdfpy (it is part of prup_pin's extra 'check')" in str(
        MissingExtraError("yourdfpy", "check")
    )


def test_what_is_missed_is_told_by_the_name_that_pip_knows():
    with pytest.raises(MissingExtraError, match="pip install nothing_of_the_kind "):
        imported("nothing_of_the_kind.binding", "compiled")
