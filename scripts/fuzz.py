"""Damaged robot files, recordings, model files and command lines, for a minute, by the seed of the day.

    python scripts/fuzz.py [--seconds 60] [--seed 20261122]

Each must end in an answer without NaN or in one clear error, exit code 2. The smallest case that does neither is shown,
with the seed that makes it again; the exit code is then 1.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
import time
import warnings
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path

import hypothesis
from hypothesis import strategies as st
from typer.testing import CliRunner

from prup_pin.cli import app

ROOT = Path(__file__).resolve().parent.parent
#: What people and programs put where a number or a name should be.
ODD = (
    "",
    "0",
    "-1",
    "1e-300",
    "1e300",
    "1e9",
    "nan",
    "inf",
    "1,5",
    "a",
    "0 0 0",
    "1 2",
    "\u00b5",
    "x" * 400,
    "-0.0",
    "<",
)
ROBOTS = ("five_bar.urdf", "elastic_arm.urdf", "gantry.urdf", "three_rrr.urdf")
RECORDING = """time,q.left_motor,q.right_motor,w.fx,w.fy,p.x,p.y,r.z
0,1.2,1.9,0,0,0.1,0.4,0
1,1.2,1.9,10,0,0.1,0.4,0
2,1.2,1.9,0,20,0.1,0.4,0
"""
MODEL = {
    "format": "prup_pin corrected model",
    "version": 1,
    "robot": str(ROOT / "examples" / "five_bar.urdf"),
    "effects": [],
    "noise": {"position_noise": 2e-6},
    "notes": "",
}
WORDS = (
    *("stiffness", "info", "check", "kinds", "laws", "robots", "3prup", "ur5", "nope", "--at", "--wrench", "--tool"),
    *(
        "--joint-stiffness",
        "--set",
        "--lock",
        "--frame",
        "--actuators",
        "--home",
        "--variant",
        "--actuated",
        "--json",
        "-",
    ),
    *(
        "z=0.4",
        "theta=10deg",
        "elbow_joint=40deg",
        "fx=300",
        "mz=1e300",
        "1e4",
        "1e-308",
        "a=b",
        "=",
        ",",
        "",
        "\x00",
        "~x/y",
    ),
    *("leg1_branch", "leg1/linear_rod.diameter=0", "tool0", "x" * 300, "0.35,0.51,0.36", "as_published", "--", "-1"),
)


def invoked(arguments: list[str]) -> None:
    """Run a command line; raise AssertionError where it ends in neither an answer nor an error of ours."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        done = CliRunner(env={"COLUMNS": "100"}).invoke(app, arguments)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code in (0, 2), f"exit code {done.exit_code}: {arguments}"
    assert done.exit_code == 0 or done.stderr.strip(), f"an error without a word: {arguments}"
    if done.exit_code == 0 and "--json" in arguments and done.stdout.startswith("{"):
        json.loads(done.stdout, parse_constant=lambda word: (_ for _ in ()).throw(AssertionError(f"{word} in JSON")))


@st.composite
def damaged(draw: st.DrawFn, text: str, pattern: str) -> str:
    """Return a text in which up to three of the places that a pattern finds hold something odd."""
    for _ in range(draw(st.integers(1, 3))):
        places = list(re.finditer(pattern, text))
        if not places:
            break
        start, end = draw(st.sampled_from(places)).span(1)
        text = text[:start] + draw(st.sampled_from(ODD)) + text[end:]
    return text


def cases(folder: Path) -> dict[str, Callable[[], None]]:
    """Return what is tried, by name: functions of hypothesis."""

    @hypothesis.given(st.sampled_from(ROBOTS), st.data())
    def robot_files(name: str, data: st.DataObject) -> None:
        text = data.draw(damaged((ROOT / "examples" / name).read_text(encoding="utf-8"), r'="([^"]*)"'))
        (folder / "robot.urdf").write_text(text, encoding="utf-8")
        invoked(["stiffness", str(folder / "robot.urdf"), "--json", "-"])
        invoked(["check", str(folder / "robot.urdf")])

    @hypothesis.given(st.data())
    def recordings(data: st.DataObject) -> None:
        text = data.draw(damaged(RECORDING, r"(?:^|[,\n])([^,\n]+)"))
        (folder / "bench.csv").write_text(text, encoding="utf-8")
        robot = str(ROOT / "examples" / "five_bar.urdf")
        out = str(folder / "out.csv")
        invoked(["simulate", str(folder / "bench.csv"), "--robot", robot, "--out", out])

    @hypothesis.given(st.data())
    def model_files(data: st.DataObject) -> None:
        (folder / "bench.csv").write_text(RECORDING, encoding="utf-8")
        text = data.draw(damaged(json.dumps(MODEL), r"[:\[] ?(\"[^\"]*\"|[\d.e-]+|\[\])"))
        (folder / "model.json").write_text(text, encoding="utf-8")
        invoked(["predict", str(folder / "model.json"), str(folder / "bench.csv"), "--out", str(folder / "out.csv")])

    @hypothesis.given(st.lists(st.sampled_from(WORDS), min_size=1, max_size=6))
    def command_lines(words: list[str]) -> None:
        if "--json" not in words or words[-1] != "--json":
            kept = [word for word in words if word not in ("--json",)]
            invoked(kept)

    return {function.__name__: function for function in (robot_files, recordings, model_files, command_lines)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=int(datetime.now(timezone.utc).strftime("%Y%m%d")))
    given = parser.parse_args()
    settings = hypothesis.settings(
        max_examples=10, deadline=None, database=None, suppress_health_check=list(hypothesis.HealthCheck)
    )
    begun, batch = time.monotonic(), 0
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() - begun < given.seconds:
            tried = cases(Path(folder))
            for name, function in tried.items():
                seed = given.seed * 1000 + batch
                try:
                    hypothesis.seed(seed)(settings(function))()
                except BaseException as error:
                    if isinstance(error, KeyboardInterrupt):
                        raise
                    print(f"fuzz: {name}, --seed {given.seed}, batch {batch}: {error!r}")
                    for note in getattr(error, "__notes__", ()):
                        print(f"  {note[:2000]}")
                    return 1
            batch += 1
    print(f"fuzz: {batch} batches of {len(tried)} x 10 cases by seed {given.seed}: answers and clear errors, no more")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
