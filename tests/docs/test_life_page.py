"""The page on a machine's life: four tests of an arm, and what `follow` says of them, as printed."""

import shlex

import pytest
from typer.testing import CliRunner

from prup_pin.cli import app

from .carried_out import BLOCK, ROOT

PAGE = (ROOT / "docs" / "life.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_page_is_carried_out(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runner = CliRunner()
    assert runner.invoke(app, ["examples", "--copy", "."]).exit_code == 0
    printed, names = "", {"__name__": "__main__"}
    for block in BLOCK.finditer(PAGE):
        if block["what"] == "run":
            exec(block["text"], names)
        elif block["what"] == "shell":
            for line in block["text"].splitlines():
                done = runner.invoke(app, shlex.split(line)[1:])
                assert done.exit_code == 0, f"{line}\n{done.output}"
                printed = done.output
        elif block["what"] == "printed":
            for line in block["text"].splitlines():
                assert line == "…" or line in printed.splitlines(), f"{line}\n{printed}"
