"""The page on design: its worked example, and what that prints."""

from .carried_out import BLOCK, ROOT

PAGE = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")


def test_the_example_is_carried_out(capsys):
    (_, script), (_, printed) = ((block["what"], block["text"]) for block in BLOCK.finditer(PAGE))
    made: dict = {}
    exec(script, made)
    assert capsys.readouterr().out.split() == printed.split()
    swept = made["stiffer"].sweep(z=0.3, theta=0.4, phi=-0.4, quantities=["C"])
    assert swept["C"].shape == (6, 6)
