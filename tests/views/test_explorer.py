"""The explorer: what sliders ask is answered with the library's numbers, and the page follows."""

import base64
import json
import signal
import subprocess
import sys
import urllib.error
import urllib.request

import numpy as np
import pytest
import umsgpack
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.views.meshcat.explorer import Control, Explorer
from prup_pin.views.text.answer import Answer, stiffness_table

from .chromium import area, render

POSE = {"z": 0.37, "theta": 0.2, "phi": -0.15}
LOAD = {"fx": 250.0, "mz": 20.0}


@pytest.fixture(scope="module")
def explorer(robot):
    return Explorer(robot)


def question(pose=POSE, load=LOAD, scale=10.0, known=()):
    return json.dumps({"pose": pose, "load": load, "scale": scale, "known": [*known]})


class Viewer:
    """Keeps what a page has after what it was sent: the commands by name, and what they draw, by path."""

    def __init__(self):
        self.known, self.objects, self.places = {}, {}, {}

    def take(self, told):
        (frame,) = told["words"]["frames"]
        self.known |= told["commands"]
        self.known = {name: self.known[name] for name in frame["drawn"]}
        commands = [umsgpack.unpackb(base64.b64decode(text)) for _, text in self.known.values()]
        self.objects = {each["path"]: each["object"] for each in commands if each["type"] == "set_object"}
        self.places = {each["path"]: each["matrix"] for each in commands if each["type"] == "set_transform"}
        return self


# -- questions and answers ---------------------------------------------------------------------------------------------


def test_what_is_told_is_what_the_library_computes(robot, explorer):
    told = explorer.reply(question())
    r = robot.compliance(robot.pose(**POSE))
    table = stiffness_table(Answer(r, LOAD))
    assert [tuple(row) for row in told["matrix"]["cells"]] == list(table.cells)
    legend = told["words"]["frames"][0]["legend"]
    moved = 1e3 * np.linalg.norm(r.deflection(LOAD)[:3])
    assert f"The tool moves {moved:.3g} mm" in legend["lines"][2]
    shares = r.shares(LOAD)
    best = max(shares, key=shares.get)
    assert (legend["rows"][0]["name"], legend["rows"][0]["value"]) == (best, f"{100 * shares[best]:.1f} %")
    axes = np.linalg.eigvalsh(r.C[:3, :3]) * 1e6
    texts = [label["text"] for label in told["words"]["frames"][0]["labels"]]
    assert all(f"{value:.3g} µm/N" in texts for value in axes)
    assert told["trouble"] == ""


def test_what_was_sent_adds_up_to_the_scene(robot, explorer):
    """A browser that went through other poses, loads and none at all has what one has that comes there at once."""
    long, short = Viewer().take(explorer.message()), Viewer()
    first = dict(long.objects)
    for pose, load, scale in (
        (POSE, {}, None),
        ({"z": 0.3, "theta": 0, "phi": 0.4}, {"mx": 50}, 3.0),
        (POSE, LOAD, 25.0),
        (POSE, LOAD, 10.0),
    ):
        sent = explorer.reply(question(pose, load, scale, known=long.known))
        long.take(sent)
    short.take(explorer.message())
    short.take(explorer.reply(question(known=short.known)))
    assert long.objects == short.objects
    assert long.places == short.places
    assert "/robot/deformed/links/hub" in long.objects
    assert "/robot/links/hub" in first
    assert "/robot/links/hub" not in long.objects
    # only what differs is sent: scaling a deflection sends neither the base nor the ellipsoids
    paths = [path for path, _ in sent["commands"].values()]
    assert paths
    assert not [path for path in paths if path.startswith(("/robot/base", "/floor", "/robot/ghost"))]


def test_the_stage_stays_while_the_robot_moves(explorer):
    told = [explorer.message(), explorer.reply(question({"z": 0.3, "theta": 0.3, "phi": 0}))]
    assert told[0]["words"]["bounds"] == told[1]["words"]["bounds"]
    assert Viewer().take(told[1]).places["/robot"] == explorer.first.display_from_base.T.ravel().tolist()


def test_a_pose_out_of_reach_is_said_and_nothing_moves(explorer):
    told = explorer.reply(question({**POSE, "z": 9.0}))
    assert "cannot reach" in told["trouble"]
    assert "words" not in told
    assert explorer.reply(question())["trouble"] == ""


@pytest.mark.parametrize(
    "message",
    [
        "",
        "[",
        "[1]",
        "{}",
        "[" * 100_000,
        b"\xff",
        '{"id": 1}',
        question(pose={"z": 0.4}),
        question(pose={**POSE, "z": "a"}),
        question(load={"fx": None}),
        question(load={"fx": float("nan")}),
        question(load={"fy": 10**400}),
        question(load={"fq": 1}),
        question(scale=-1),
        question(scale=float("inf")),
    ],
)
def test_what_makes_no_sense_is_said_and_the_next_question_answered(explorer, message):
    assert explorer.reply(message)["trouble"]
    assert explorer.reply(question())["trouble"] == ""


@pytest.mark.parametrize(
    ("load", "scale", "said"),
    [
        ({"fx": 1e155}, 10.0, "fx is 1e+155; expected at most 1e+12 [N]"),
        ({"fx": 5, "mz": -1e300}, None, "mz is -1e+300; expected at most 1e+12 [N m]"),
        (LOAD, 1e300, "cannot be drawn 1e300 times larger: it would leave the picture. Expected at most"),
    ],
)
def test_what_is_too_large_is_refused_with_its_bound_and_the_next_question_answered(explorer, load, scale, said):
    trouble = explorer.reply(question(load=load, scale=scale))["trouble"]
    assert said in trouble
    bound = float(trouble.split("at most ")[1].split()[0])
    within = (load, bound) if scale == 1e300 else ({"fx": bound}, None)
    told = explorer.reply(question(POSE, *within))
    assert told["trouble"] == ""
    assert told["scale"] > 0


def test_a_slider_beside_nothing_begins_at_nothing():
    """-9.4e-13 mm would stand in a narrow box as -9.4 mm."""
    shown = Control("y", "length", -9.436e-16, -0.4, 0.4).described()
    assert (shown["value"], shown["low"], shown["high"]) == (0.0, -400.0, 400.0)
    assert Control("y", "length", -9.436e-6, -0.4, 0.4).described()["value"] == -0.009436


def test_a_joint_at_no_part_of_a_turn_is_refused_with_its_bound():
    explorer = Explorer(prup_pin.load("ur5"))
    values = {control.name: 0.0 for control in explorer.poses}
    refused = explorer.reply(question({**values, "wrist_1_joint": 1e308}, {}))
    assert refused["trouble"] == "wrist_1_joint = 1e308 rad: expected at most 1e+06 rad"
    assert explorer.reply(question(values, {}))["trouble"] == ""
    for ask in (explorer.robot.pose_from_actuators, lambda at: explorer.robot.pose(**at)):
        ask({**values, "wrist_1_joint": 6.2})
        with pytest.raises(prup_pin.InputError, match="wrist_1_joint = -1010000 rad: expected at most"):
            ask({**values, "wrist_1_joint": -1.01e6})


@pytest.mark.parametrize(
    "name", [*(pytest.param(name, marks=pytest.mark.slow) for name in ("ur5", "panda")), "double_pendulum"]
)
def test_trees_have_a_slider_for_each_joint(name):
    rigid = Explorer(prup_pin.load(name, tool="panda_hand" if name == "panda" else None))
    assert [control.name for control in rigid.poses] == list(rigid.robot.task_coordinates)
    assert rigid.loads == ()
    sprung = Explorer(prup_pin.load(name, joint_stiffness=1e4, tool="panda_hand" if name == "panda" else None))
    values = {control.name: control.low + 0.6 * (control.high - control.low) for control in sprung.poses}
    told = sprung.reply(question(values, {"fz": -20}))
    assert told["matrix"]["title"] == ("K does not exist" if name == "double_pendulum" else "Stiffness K")
    for control in sprung.poses:
        assert control.low <= control.value <= control.high


def test_a_robot_without_task_coordinates_has_a_slider_for_each_actuator(tmp_path):
    from pathlib import Path

    robot = prup_pin.load(Path(__file__).parents[1] / "robots/delta/robot.urdf", joint_stiffness=1e4, tool="centre")
    explorer = Explorer(robot)
    assert [control.name for control in explorer.poses] == list(robot.mechanism.actuated)
    values = {control.name: control.value + 0.1 for control in explorer.poses}
    told = explorer.reply(question(values, {"fz": -20}))
    assert told["trouble"] == ""
    assert told["matrix"]["title"] == "K does not exist"


# -- served ------------------------------------------------------------------------------------------------------------


def test_every_browser_has_its_own_sliders(robot):
    """An answer is a function of its question, whoever asked before."""
    explorer = Explorer(robot, robot.pose(**POSE), LOAD)
    address = explorer.serve()

    def ask(z, **headers):
        asked = urllib.request.Request(address, question({"z": z, "theta": 0, "phi": 0}).encode(), headers)
        with urllib.request.urlopen(asked, timeout=600) as answer:
            return json.load(answer)

    try:
        told = [ask(0.3), ask(0.45), ask(0.3)]
        with pytest.raises(urllib.error.HTTPError, match="403"):
            ask(0.3, Origin="http://evil.example")
    finally:
        explorer.close()
    first = explorer.message()
    values = {control["name"]: control["value"] for control in first["controls"]["groups"][0]["controls"]}
    assert values == {"z": 370, "theta": pytest.approx(11.4592), "phi": pytest.approx(-8.59437)}
    lines = [item["words"]["frames"][0]["legend"]["lines"][0] for item in told]
    assert lines == [f"z {z} mm, theta 0°, phi 0°" for z in (300, 450, 300)]
    assert told[0] == told[2]
    assert explorer.url is None


def test_live_is_served_until_interrupted(tmp_path):
    command = [sys.executable, "-m", "prup_pin", "view", "3prup", "--live", "--no-open"]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        address = process.stdout.readline().split()[1]
        with urllib.request.urlopen(address, timeout=600) as answer:
            assert b"explorer" in answer.read()
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=600)
    finally:
        process.kill()
    assert (process.returncode, errors) == (0, "")
    assert "Stopped" in rest
    assert list(tmp_path.iterdir()) == []


def test_live_and_other_ways_to_show_exclude_each_other(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for other in (["--serve"], ["--html", "a.html"]):
        done = CliRunner().invoke(app, ["view", "--live", *other])
        assert done.exit_code == 2
        assert "exclude each other" in done.stderr


# -- in a browser ------------------------------------------------------------------------------------------------------

SLIDE = """(name, value) => {
  const sliders = [...document.querySelectorAll('.control input[type=range]')];
  const slider = sliders.find((item) => item.ariaLabel.startsWith(name));
  slider.value = value;
  slider.dispatchEvent(new Event('input'));
}"""


TYPE = """(name, value) => {
  const box = [...document.querySelectorAll('input[type=number]')].find((item) => item.ariaLabel.startsWith(name));
  box.focus();
  box.value = value;
  box.dispatchEvent(new Event('input'));
}"""
BOTH = """(name) => [...document.querySelectorAll('#panel input')]
  .filter((item) => item.ariaLabel.startsWith(name)).map((item) => item.value)"""


@pytest.mark.skipif(
    render.find_chromium() is None, reason="Chromium is not installed (Debian, Ubuntu: apt-get install chromium)"
)
def test_the_page_follows_its_sliders(robot, chromium):
    """The robot, its deflection, ellipsoids, shares and K are of the sliders' pose and load; no other host is asked."""
    explorer = Explorer(robot)
    try:
        url = explorer.serve()
        with chromium.tab() as browser:
            browser.call("Emulation.setFocusEmulationEnabled", enabled=True)
            browser.open(url)
            words = "document.getElementById('legend').innerText"

            def slide(name, value):
                browser.evaluate(f"({SLIDE})({json.dumps(name)}, {value})")

            def until(part):
                browser._until(lambda: part in browser.evaluate(words), f"'{part}' does not appear")

            before = browser.picture()
            for name, value in (("z", 330), ("theta", 12), ("fx", 400), ("mz", 30)):
                slide(name, value)
            until("z 330 mm, theta 12°, phi 0°")
            until("fx 400 N, mz 30 N m")
            r = robot.compliance(robot.pose(z=0.33, theta=np.radians(12), phi=0))
            load = {"fx": 400, "mz": 30}
            table = stiffness_table(Answer(r, load))
            cells = browser.evaluate(
                "[...document.querySelectorAll('table.k tbody tr')].map(r => [...r.cells].map(c => c.textContent))"
            )
            assert [tuple(cell.replace("\u2212", "-") for cell in row[1:]) for row in cells] == list(table.cells)
            shares = r.shares(load)
            best = max(shares, key=shares.get)
            assert f"{best}\n{100 * shares[best]:.1f} %" in browser.evaluate(words)
            browser.settle()
            scene = explorer.scene(r.pose, np.array([400, 0, 0, 0, 0, 30.0]), explorer.scale)
            for path in ("robot/deformed/links/hub", "ellipsoids/translation/surface", "robot/ghost/links/hub"):
                found = browser.evaluate(
                    f"viewer.scene_tree.find({json.dumps(path.split('/'))}).object.matrix.elements"
                )
                np.testing.assert_allclose(np.reshape(found, (4, 4)).T, scene.part(path).placement, atol=1e-6)
            assert area(np.abs(browser.picture() - before).max(axis=-1) > 12) > 20_000
            slide("fy", 1e-11)  # where a slider is let go beside its middle
            assert browser.evaluate("[...document.querySelectorAll('input[aria-label^=fy]')].pop().value") == "0"
            slide("z", 900)
            until("cannot reach")
            slide("z", 400)
            until("z 400 mm")
            assert "cannot reach" not in browser.evaluate(words)

            def typed(name, text):
                """Type into a box and leave it once that has been answered; return what slider and box say while it is
                typed and afterwards, and the reason where nothing moved."""
                browser.evaluate(f"({TYPE})({json.dumps(name)}, {json.dumps(text)})")
                browser._until(lambda: not browser.evaluate("waiting"), "no answer")
                said = [browser.evaluate(f"({BOTH})({json.dumps(name)})")]
                browser.evaluate("document.activeElement.blur()")
                said.append(browser.evaluate(f"({BOTH})({json.dumps(name)})"))
                return *said, browser.evaluate("document.getElementById('trouble').textContent")

            # what is typed beyond a slider's end moves that end, and what is refused does not stay in the box
            assert typed("fx", "2000") == (["2000", "2000"], ["2000", "2000"], "")
            until("fx 2000 N")
            asked_for, kept, trouble = typed("fx", "1e155")
            assert (asked_for[1], kept) == ("1e155", ["2000", "2000"])
            assert "expected at most 1e+12 [N]" in trouble
            drawn = browser.evaluate("scale.value")
            asked_for, kept, trouble = typed("deflection", "1e300")
            assert (asked_for[-1], kept[-1]) == ("1e300", drawn)
            assert "would leave the picture" in trouble
            slide("fx", 1000)
            until("fx 1000 N")
            assert browser.evaluate("document.getElementById('trouble').textContent") == ""
            foreign = [a for a in browser.requests if not a.startswith((url, "data:", "blob:"))]
            assert foreign == []
            assert browser.errors == []
    finally:
        explorer.close()
