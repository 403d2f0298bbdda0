"""Every command line and every block of Python on the pages runs as it is printed.

A page is read from top to bottom in a folder of its own, which holds the examples as `prup-pin examples --copy .`
leaves them. Blocks that a comment gives to `carried_out` run there. Installing and the project's own scripts are run by
scripts/stranger.sh and by .ci/run.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from prup_pin.cli import app

from .carried_out import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
_BLOCK = re.compile(r"^(?P<comment><!-- .*? -->\n)?```(?P<language>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`(prup-pin [^`]+)`")
SHELL, PYTHON = {"sh", "bash", "console"}, {"python", "py"}
#: Commands, and the lines that a page says the last one prints; … stands for those that it leaves out.
_PRINTED = re.compile(r"^```bash\n(?P<commands>[^`]*)^```\n\n```text\n(?P<lines>[^`]*)^```$", re.MULTILINE)
#: Lines that are run elsewhere: by scripts/stranger.sh, which reads them from the pages, and by .ci/run.
ELSEWHERE = re.compile(
    r"(pip install |python -m venv |source |git clone |cd |bash scripts/|python scripts/|mkdocs |jupyter )"
)


@dataclass(frozen=True)
class Block:
    """A block of a page: its language, its text, the line on which it begins."""

    language: str
    text: str
    line: int


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks that are run as printed."""
    text = page.read_text(encoding="utf-8")
    for found in _BLOCK.finditer(text):
        if found["comment"] is None and found["language"] in SHELL | PYTHON:
            yield Block(found["language"], found["text"], text.count("\n", 0, found.start("text")) + 1)


def commands(block: Block) -> list[str]:
    """Return the command lines of a block, continued lines joined."""
    lines = block.text.replace("\\\n", " ").splitlines()
    return [line.removeprefix("$ ").strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]


WITH_BLOCKS = [page for page in PAGES if any(True for _ in blocks(page))]


#: scripts/stranger.sh, a part of every .ci/run, does the same with these in an environment of its own; index.md has
#: the commands of the README.
TWICE = ("README.md", "tutorial.md", "index.md")
#: With whole diagnoses or wide sweeps; that their commands exist with these options is asked of every page.
LONG = ("diagnosis.md", "command_line.md", "sweep.md", "efforts.md", "formulas.md", "import.md")


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[pytest.mark.slow] if page.name in TWICE + LONG else []) for page in WITH_BLOCKS],
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_a_page_runs_as_printed(page, tmp_path, monkeypatch, remembered):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    runner = CliRunner()
    assert runner.invoke(app, ["examples", "--copy", "."]).exit_code == 0
    names: dict = {"__name__": "__main__"}
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.language in PYTHON:
            exec(compile(block.text, where, "exec"), names)
            continue
        for line in commands(block):
            if ELSEWHERE.match(line):
                continue
            words = shlex.split(line, comments=True)
            assert words[0] == "prup-pin", f"{where}: what is '{line}'?"
            done = runner.invoke(app, words[1:])
            assert done.exit_code == 0, f"{where}: {line}\n{done.output}"
            assert done.exception is None or isinstance(done.exception, SystemExit), f"{where}: {line}"


def printed() -> list[tuple[str, str, list[str]]]:
    """Return of each page that shows what a command prints its name, the command, and the lines shown."""
    found = [(page.name, match) for page in PAGES for match in _PRINTED.finditer(page.read_text(encoding="utf-8"))]
    return [(page, match["commands"].splitlines()[-1], match["lines"].splitlines()) for page, match in found]


@pytest.mark.parametrize(
    ("page", "line", "shown"),
    [
        pytest.param(
            *each,
            id=f"{each[0]}: {' '.join(each[1].split()[:2])}",
            # A diagnosis of a whole robot. Those of README and diagnosis.md scripts/stranger.sh makes in every .ci/run,
            # and compares.
            marks=[pytest.mark.slow] if each[1].split()[1] == "diagnose" else [],
        )
        for each in printed()
    ],
)
@pytest.mark.usefixtures("without_pictures")
def test_a_page_shows_what_its_commands_print(page, line, shown, tmp_path, monkeypatch, remembered):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    runner = CliRunner()
    assert runner.invoke(app, ["examples", "--copy", "."]).exit_code == 0
    words = shlex.split(line)
    if any(word.endswith(".csv") and not Path(word).exists() for word in words):  # the page makes it
        for block in blocks(next(each for each in PAGES if each.name == page)):
            if block.language in PYTHON:
                exec(compile(block.text, page, "exec"), {})
    said = iter(runner.invoke(app, words[1:]).stdout.splitlines())
    wanted = [text.rstrip() for text in shown if text != "…"]
    assert len(wanted) > 5
    missing = [text for text in wanted if text not in map(str.rstrip, said)]  # in this order
    assert not missing, f"{page}: {line}"


def inline() -> list[tuple[str, str]]:
    return sorted({(page.name, found) for page in PAGES for found in _INLINE.findall(page.read_text(encoding="utf-8"))})


def in_blocks() -> list[tuple[str, str]]:
    found = {(page.name, line) for page in WITH_BLOCKS for block in blocks(page) if block.language in SHELL
             for line in commands(block) if line.startswith("prup-pin ")}  # fmt: skip
    return sorted(found - set(inline()))


@pytest.mark.parametrize(("page", "line"), [*inline(), *in_blocks()])
def test_a_command_has_its_options(page, line):
    words = line.partition(" #")[0].split()
    group = get_command(app)
    assert words[1] in {*group.commands, "COMMAND"} or words[1].startswith("--"), f"{page}: {line}"
    if words[1] in group.commands:
        known = {
            name
            for parameter in group.get_command(None, words[1]).params
            for name in (*parameter.opts, *parameter.secondary_opts)
        }
        for word in words[2:]:
            option = word.partition("=")[0].rstrip(",.")
            assert not option.startswith("--") or option in {*known, "--help"}, f"{page}: {line}"


def test_the_plan_on_the_page_is_the_one_that_ships():
    page = (ROOT / "docs" / "recording_file.md").read_text(encoding="utf-8")
    assert f"```json\n{(ROOT / 'examples' / 'plan.json').read_text(encoding='utf-8')}```\n" in page


def test_blocks_and_commands_are_found():
    assert len(WITH_BLOCKS) >= 10
    found = [line for page in PAGES for block in blocks(page) if block.language in SHELL for line in commands(block)]
    assert sum(line.startswith("prup-pin ") for line in found) > 15
    assert len(inline()) > 15
    commands_shown = [(page, line.split()[1]) for page, line, _ in printed()]
    assert commands_shown[:2] == [("README.md", "stiffness"), ("README.md", "diagnose")]
    assert {("command_line.md", "simulate"), ("diagnosis.md", "diagnose")} < set(commands_shown)
    assert commands(Block("sh", "$ a \\\n  b\n# no\n\nc\n", 1)) == ["a    b", "c"]
