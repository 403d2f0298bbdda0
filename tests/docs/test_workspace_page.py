"""The page on workspaces: its example, and its numbers."""

from .carried_out import BLOCK, ROOT

PAGE = (ROOT / "docs" / "workspace.md").read_text(encoding="utf-8")


def test_the_example_is_carried_out(capsys):
    ((_, script),) = ((block["what"], block["text"]) for block in BLOCK.finditer(PAGE))
    exec(script, {})
    printed = capsys.readouterr().out
    assert printed.startswith("<Workspace in theta, phi: 1.")
    assert "leg1_slide" in printed


def test_the_table_holds_what_the_tests_hold():
    for line in (
        "| as published, grid of 5° | 4.47 to 15.72 | 1.85 to 4.75 |",
        "| correct, grid of 5° | 4.85 to 17.48 | 1.88 to 5.18 |",
    ):
        assert line in PAGE
