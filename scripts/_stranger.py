"""What scripts/stranger.sh does once there is an empty environment: reads the pages, and does what they say.

Knows nothing of the package: commands are run by bash, blocks of Python by the environment's interpreter, in the order
of the page; what any page says that one prints, it prints. Stops at the first thing that fails.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

PAGES = ("README.md", "docs/tutorial.md")
_BLOCK = re.compile(r"^```(bash|sh|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
#: Commands, and the lines that a page says the last one prints; … stands for those that it leaves out.
_PRINTED = re.compile(r"^```bash\n(?P<commands>[^`]*)^```\n\n```text\n(?P<lines>[^`]*)^```$", re.MULTILINE)
#: What the recording hides, as a verdict has to say it.
HIDDEN = {"physics": "backlash", "location": "leg2/ball_nut"}


class Stranger:
    """Someone at a desk, with a checkout and an interpreter."""

    def __init__(self, checkout: Path, desk: Path):
        self.checkout, self.desk = checkout, desk
        self.done: set[str] = set()
        self.printed = printed([checkout / "README.md", *sorted((checkout / "docs").rglob("*.md"))])

    def read(self, page: str) -> None:
        """Do what a page says, block by block; Python goes on where the page's last block of it ended."""
        script = ""
        self.done = {line for line in self.done if line.startswith("pip install")}
        for language, text in blocks(self.checkout / page):
            if language == "python":
                # The blocks before are run again, quietly: an interpreter that was left open would remember them.
                self.run(f"{page}: python", [sys.executable, "-c", script + text])
                script += text
            else:
                for line in lines(text):
                    self.shell(f"{page}: {line}", line)

    def shell(self, what: str, line: str) -> None:
        if line in self.done:
            return
        self.done.add(line)
        said = self.run(what, ["bash", "-c", line], self.checkout if line.startswith("pip install") else self.desk)
        for page, shown in self.printed.get(line, []):
            left = iter([text.rstrip() for text in said.splitlines()])
            missing = [text for text in shown if text not in left]  # in this order
            if missing:
                sys.exit(f"{page} shows what this does not print: {missing}\n{said}")

    def run(self, what: str, command: list[str], folder: Path | None = None) -> str:
        begun = time.monotonic()
        done = subprocess.run(command, cwd=folder or self.desk, capture_output=True, text=True, check=False)
        print(f"{time.monotonic() - begun:6.1f} s  {what}", flush=True)
        if done.returncode:
            sys.exit(f"{done.stdout[-3000:]}{done.stderr[-3000:]}\nexit code {done.returncode}: {what}")
        return done.stdout


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    for found in _BLOCK.finditer(page.read_text(encoding="utf-8")):
        yield found[1], found[2]


def printed(pages: Sequence[Path]) -> dict[str, list[tuple[str, list[str]]]]:
    """Return by command the pages that show what it prints, each with the lines that it shows."""
    found: dict[str, list[tuple[str, list[str]]]] = {}
    for page in pages:
        for block in _PRINTED.finditer(page.read_text(encoding="utf-8")):
            shown = [text.rstrip() for text in block["lines"].splitlines() if text != "…"]
            found.setdefault(lines(block["commands"])[-1], []).append((page.name, shown))
    return found


def lines(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("#")]


def main() -> None:
    stranger = Stranger(*map(Path, sys.argv[1:]))
    begun = time.monotonic()
    for page in PAGES:
        stranger.read(page)
    for robot in sorted((stranger.desk / "my_examples").glob("*.urdf")):
        stranger.shell(f"the example {robot.name}", f"prup-pin stiffness my_examples/{robot.name} --wrench fx=50,fy=20")
    verdict = json.loads((stranger.desk / "bench_diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
    first = verdict["findings"][0]
    found = {key: first[key] for key in HIDDEN}
    if verdict["verdict"] != "explained" or found != HIDDEN:
        sys.exit(f"the shipped recording hides {HIDDEN}, and the diagnosis found {verdict['verdict']}: {found}")
    if first["statement"] not in (stranger.checkout / "README.md").read_text(encoding="utf-8"):
        sys.exit(f"README quotes the diagnosis of the shipped recording, which says: {first['statement']}")
    print(f"{time.monotonic() - begun:6.1f} s  all of it")


if __name__ == "__main__":
    main()
