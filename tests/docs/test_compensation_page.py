"""The page on compensation: its script, its command and what that prints."""

import re
import shlex

from typer.testing import CliRunner

from prup_pin.cli import app

from .carried_out import BLOCK, ROOT

PAGE = (ROOT / "docs" / "compensation.md").read_text(encoding="utf-8")


def test_the_page_is_carried_out(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    blocks = [(block["what"], block["text"]) for block in BLOCK.finditer(PAGE)]
    assert [what for what, _ in blocks] == ["run", "shell", "printed", "run"]
    exec(blocks[0][1], {})
    done = CliRunner().invoke(app, shlex.split(blocks[1][1])[1:])
    assert done.exit_code == 0, done.output
    assert blocks[2][1].split() == done.stdout.split()
    assert (tmp_path / "pictures/path.svg").exists()
    exec(blocks[3][1], {})
    assert len(re.findall("leg._slide", capsys.readouterr().out)) == 3
