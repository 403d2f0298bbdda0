"""The page on export: a bench test, its diagnosis, a file for MuJoCo, and what MuJoCo leaves of another recording."""

import re
import shlex

import pytest
from typer.testing import CliRunner

from prup_pin.cli import app

from .carried_out import BLOCK, ROOT

PAGE = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")
_NUMBER = re.compile(r"\d+\.\d+")


@pytest.mark.slow
def test_the_page_is_carried_out(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runner = CliRunner()
    assert runner.invoke(app, ["examples", "--copy", "."]).exit_code == 0
    blocks = [(block["what"], block["text"]) for block in BLOCK.finditer(PAGE)]
    assert [what for what, _ in blocks] == ["run", "shell", "run", "printed"]
    exec(blocks[0][1], {"__name__": "__main__"})
    for line in blocks[1][1].splitlines():
        done = runner.invoke(app, shlex.split(line)[1:])
        assert done.exit_code == 0, f"{line}\n{done.output}"
    text = (tmp_path / "corrected.xml").read_text(encoding="utf-8")
    assert "diagnosis of monday.csv" in text
    for name in ("damping", "limit", "inertia"):
        assert len(re.findall(rf"{name} = .* \(95 %: .* to .*\)", text)) == 6, name
    assert len(re.findall(r"rotor_inertia at joint. \(effort\) \(explains 9\d.*squared residual\)", text)) == 6
    exec(blocks[2][1], {"__name__": "__main__"})
    printed = capsys.readouterr().out.splitlines()
    shown = blocks[3][1].splitlines()
    assert [line.split(":")[0] for line in printed] == [line.split(":")[0] for line in shown]
    for line, wanted in zip(printed, shown, strict=True):
        measured, predicted, by_mujoco = map(float, _NUMBER.findall(line))
        assert abs(by_mujoco / predicted - 1) < 0.03, line  # as well as predict
        assert by_mujoco < 0.105, line  # the noise of 0.1 N m
        for value, told in zip((measured, predicted, by_mujoco), map(float, _NUMBER.findall(wanted)), strict=True):
            assert abs(value / told - 1) < 0.05, f"{line}\n{wanted}"
