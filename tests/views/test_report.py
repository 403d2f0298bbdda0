"""The report says what the library computes, lets no name out of its place, and needs nothing but itself."""

import base64
import html
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError
from prup_pin.numbers import number, quantity
from prup_pin.views.report.pose_report import report_html
from prup_pin.views.text.answer import STIFFENED, Answer, _cells, compliance_table, stiffness_table
from prup_pin.views.text.values import workshop_text

from .chromium import DRAWN, SCALE, Browser, area, render

WRENCH = np.array([300, 0, 0, 0, 0, 100.0])
EVIL = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>&amp;"
MATH = "$\\frac$ $x_{$ \u202e"


@pytest.fixture(scope="module")
def pose(robot):
    return robot.pose(z=0.4, theta=0.436, phi=0.262)


@pytest.fixture(scope="module")
def page(robot, pose):
    return report_html(robot, pose, WRENCH, frame="star_2", notes=["a remark"])


@pytest.mark.usefixtures("without_pictures")
def test_parts_that_share_alike_are_all_named_as_the_softest(robot, pose, page):
    """Of a symmetric five-bar under a force along y both arms; of the 3-PRUP beside, one."""
    five_bar = prup_pin.load(Path(__file__).parents[2] / "examples" / "five_bar.urdf")
    facts = text_of(report_html(five_bar, five_bar.home, [0, 100.0, 0, 0, 0, 0]))
    shares = five_bar.compliance(five_bar.home).shares([0, 1.0, 0, 0, 0, 0])
    largest = [name for name, share in shares.items() if share == pytest.approx(max(shares.values()), rel=1e-9)]
    assert len(largest) == 2
    assert f"Share of each of the 2 softest parts {100 * max(shares.values()):.2f} % {', '.join(largest)}" in facts
    assert re.search(r"Share of the softest part [\d.]+ % leg\d/\w+ ", text_of(page))


def text_of(page):
    """Return a page's words."""
    return " ".join(re.sub(r"<[^>]+>", " ", re.sub(r"(?s)<(script|style).*?</\1>", " ", page)).split())


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """The 3-PRUP with markup, quotes and mathematics for names."""
    path = Path(prup_pin.load("3prup").mechanism.description.path)
    content = path.read_text(encoding="utf-8")
    names = {
        'name="3prup"': f"name={quoteattr(EVIL)}",
        "leg1_yoke": quoted("Y" + EVIL),
        "leg2_rod": quoted("L" + MATH),
        "leg2_branch": quoted("J" + EVIL),
        "leg2_closure": quoted("c" + EVIL),
        "leg1/linear_rod": quoted("leg1/" + EVIL),
        "leg3/linear_rod": quoted("leg3/" + MATH),
        "Table 1, D_LR": quoted(EVIL),
        "<note>bodies": "<note>" + escape(EVIL),
    }
    home = re.search(r"<home .*/>", content)[0]
    content = content.replace(home, home.replace('leg2_branch="0.181" ', ""))
    for old, new in names.items():
        content = re.sub(re.escape(old) + r"(?!\w)", lambda _, new=new: new, content)
    target = tmp_path_factory.mktemp("hostile") / f"{'a' * 30}.urdf"
    target.write_text(content, encoding="utf-8")
    return prup_pin.load(target)


@pytest.fixture(scope="module")
def hostile_page(hostile):
    return report_html(hostile, None, WRENCH, changes={f"leg1/{EVIL}.diameter": 0.02}, notes=[EVIL])


def quoted(name):
    return quoteattr(name, {'"': "&quot;"})[1:-1]


def words(page):
    """The page's visible words."""
    body = re.sub(r"<(script|style)\b.*?</\1>", " ", page[page.index("<body>") :], flags=re.DOTALL)
    text = html.unescape(re.sub(r"<[^>]*>", " ", body.replace("<wbr>", ""))).replace("\u2212", "-")
    return " ".join(text.split())


def scene_of(page):
    found = re.search(r' srcdoc="([^"]*)"', page)
    return html.unescape(found[1]) if found else None


# -- what it says ------------------------------------------------------------------------------------------------------


def test_it_says_what_the_library_computes(robot, pose, page):
    text, answer = words(page), Answer(robot.compliance(pose), WRENCH)
    for table in (stiffness_table(answer), compliance_table(answer)):
        for name, cells in zip(table.rows, table.cells, strict=True):
            assert f"{name} {' '.join(cells)}" in text
    moved = float(np.linalg.norm(answer.deflection[:3]))
    assert f"The tool moves {quantity(moved, 'm')} and turns" in text
    assert f"Sag {quantity(float(np.linalg.norm(robot.compliance(pose).sag()[:3])), 'm')}" in text
    ranked = sorted(answer.shares, key=lambda name: -answer.shares[name])[:10]
    places = [text.index(f"{name} ", text.index("The ten softest parts")) for name in ranked]
    assert places[:2] == sorted(places[:2])
    for name in ranked:
        assert f"{100 * answer.shares[name]:.2f} %" in text
    for part in (
        "z 400 mm",
        "leg1_slide",
        "star_2",
        "rank 12 of 12",
        "nothing: no loop is overconstrained",
        "a remark",
    ):
        assert part in text
    assert "diameter 20 mm Table 1, D_LR" in text
    for note in robot.assumptions:
        assert note in text


def test_a_rigid_part_takes_its_deflection_away(robot, pose, page):
    """The column 'if rigid' is that of a robot solved with this part rigid."""
    answer = Answer(robot.compliance(pose), WRENCH)
    name = "leg3/linear_rod"
    stiff = robot.with_parameters({f"{name}.youngs_modulus": 1e20, f"{name}.area": 1e6})
    want = stiff.compliance(stiff.pose_from_configuration(pose.q)).deflection(WRENCH)
    rest = answer.deflection - answer.compliance.parts[name] @ WRENCH
    np.testing.assert_allclose(rest, want, rtol=1e-6, atol=1e-9)
    assert f"if rigid: {quantity(float(np.linalg.norm(want[:3])), 'm')}" in words(page)


def test_values_to_change_first_are_those_that_a_changed_robot_confirms(robot, pose, page):
    """In the deformed position, with the actuators held: terminal and page give the same answer."""
    lines = Answer(robot.compliance(pose), WRENCH, robot=robot).stiffen_first
    assert lines == robot.sensitivity(pose, WRENCH).stiffen_first
    name, slope = lines[0].parameter.name, lines[0].percent
    assert name.endswith(".diameter")
    value, work = robot.parameters[name].value, []
    for factor in (0.999, 1.001):  # what follows from it is rounded in the file: two changed robots
        changed = robot.with_parameters({name: factor * value})
        there = changed.pose_from_configuration(pose.q)
        work.append(WRENCH @ changed.equilibrium(there, WRENCH).displacement)
    assert slope == pytest.approx(2 * (work[1] - work[0]) / (work[0] + work[1]) / 2e-3, rel=2e-3)
    assert not [line for line in lines if line.parameter.name.endswith("rod.area")], "an area follows its diameter"
    leg, _, _ = name.rpartition(".")
    assert f"{leg} diameter {workshop_text(value, 'm')} -{number(-slope, 3)}" in words(page)
    assert STIFFENED in words(page)


@pytest.mark.usefixtures("without_pictures")
def test_an_overconstrained_robot_has_no_column_if_rigid(robot, pose):
    locked = robot.with_locked_joints(["leg1_branch", "leg2_branch", "leg3_branch"])
    there = locked.pose_from_configuration(pose.q)
    assert there.balance.self_stress.shape[1] > 0
    text = words(report_html(locked, there, WRENCH))
    assert "if rigid" not in text
    assert "overconstrained: stiffening one part shifts load" in text
    assert "Locked joints leg1_branch leg2_branch leg3_branch" in text


@pytest.mark.parametrize(
    ("wrench", "parts"),
    [
        (None, ["none was given", "softest translation", "The tool moves per N"]),
        ({"mz": 100}, ["The tool turns", "mrad", "N m/mrad"]),
        pytest.param({"fz": -200}, ["Stiffness along the load", "N/mm"], marks=pytest.mark.slow),
        (np.zeros(6), ["under no load", "no module has a share"]),
    ],
)
@pytest.mark.usefixtures("without_pictures")
def test_any_load(robot, wrench, parts):
    text = words(report_html(robot, {"z": 0.4, "theta": 0, "phi": 0}, wrench))
    for part in parts:
        assert part in text


@pytest.mark.usefixtures("without_pictures")
def test_where_k_does_not_exist():
    robot = prup_pin.load("double_pendulum", joint_stiffness=1e4)
    text = words(report_html(robot, None, {"fx": 10}))
    assert "K does not exist" in text
    assert "under these 4 loads" in text
    assert "Compliance C" in text


def test_wrong_input(robot, pose):
    with pytest.raises(InputError, match="another pose"):
        report_html(robot, pose, WRENCH, compliance=robot.compliance(robot.home))
    with pytest.raises(InputError, match="mq"):
        report_html(robot, pose, {"mq": 1})
    with pytest.raises(prup_pin.PrupPinError, match="joint_stiffness"):
        report_html(prup_pin.load("ur5"))


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.02, "m", "20 mm"),
        (2.01e11, "Pa", "201 GPa"),
        (5.05e8, "N/m", "505 N/µm"),
        (np.inf, "Pa", "infinite"),
        (np.pi, "rad", "180°"),
        (2, "1", "2"),
        ([0.01, 0.02], "m", "10 20 mm"),
        (3.0, "kg", "3 kg"),
    ],
)
def test_units_of_the_workshop(value, unit, text):
    assert workshop_text(value, unit) == text


# -- what it is made of ------------------------------------------------------------------------------------------------


def test_it_holds_everything_and_is_small(page):
    assert len(page.encode()) < 3e6
    assert not re.findall(r"""(?:src|href|action|srcset)\s*=\s*["'](?!data:)""", page)
    assert "@import" not in page
    assert not re.findall(r"url\((?!data:)", page)
    assert "<script>" in scene_of(page)


@pytest.mark.slow
def test_a_heavy_scene_leaves_the_deflection_out_or_is_left_out(robot, pose, page, monkeypatch):
    monkeypatch.setattr("prup_pin.views.report.pose_report.SCENE_LIMIT", len(scene_of(page)) - 5000)
    lighter = report_html(robot, pose, WRENCH)
    assert "leaves out the deflection" in words(lighter)
    assert scene_of(lighter) is not None
    monkeypatch.setattr("prup_pin.views.report.pose_report.SCENE_LIMIT", 1000)
    without = report_html(robot, pose, WRENCH)
    assert "The 3-D scene is not shown: its meshes take" in words(without)
    assert scene_of(without) is None
    assert "script-src 'none'" in html.unescape(without)


@pytest.mark.slow
def test_a_real_arm_with_meshes_fits():
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    page = report_html(robot, robot.home, {"fz": -50})
    assert len(page.encode()) < 3e6
    assert scene_of(page) is not None


# -- names from files --------------------------------------------------------------------------------------------------


def elements(page):
    """Return (tag, names of its attributes) of all elements, as a browser reads them."""
    found = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attributes: found.append((tag, [name for name, _ in attributes]))
    parser.feed(page)
    return found


def test_names_from_a_robot_file_stay_text(hostile_page):
    page = hostile_page
    outside = re.sub(r' srcdoc="[^"]*"', "", page)
    assert "<script" not in outside
    assert "<img src=x" not in page
    tags = elements(page)
    assert sum(tag == "script" for tag, _ in tags) == 0
    assert sum(tag == "img" for tag, _ in tags) == 2
    assert [name for _, names in tags for name in names if name.startswith("on")] == []
    text = words(page)
    assert text.startswith(EVIL)
    assert text.count(EVIL) >= 5
    assert MATH.strip() in text
    for picture in re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", page):
        assert b"<script" not in base64.b64decode(picture)
    assert scene_of(page).count("<script>") == 2


# -- in a browser ------------------------------------------------------------------------------------------------------


class Tab(Browser):
    """A tab that also reaches into the sealed frame of the scene."""

    def open_report(self, path):
        self.call("Page.navigate", url=path.as_uri())
        self._until(lambda: self.evaluate("document.readyState") == "complete", "the page does not load")

    def frame(self):
        """Return the session of the scene's frame, once there is one."""

        def found():
            targets = self.call("Target.getTargets")["targetInfos"]
            return next((target["targetId"] for target in targets if target["type"] == "iframe"), None)

        self._until(found, "no frame with a scene")
        return self.call("Target.attachToTarget", targetId=found(), flatten=True)["sessionId"]

    def within(self, session, method, **params):
        self._count += 1
        number = self._count

        async def ask():
            message = {"id": number, "sessionId": session, "method": method, "params": params}
            await self._socket.write_message(json.dumps(message))
            return await self._receive(number)

        return self._run(ask())["result"]

    def value(self, session, script):
        return self.within(session, "Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def wait_for_scene(self):
        """Wait until the scene is drawn; its earlier complaints are collected."""
        session = self.frame()
        self._until(lambda: self.value(session, "typeof page !== 'undefined' && page !== null"), "no scene")
        for domain in ("Runtime", "Log"):
            self.within(session, f"{domain}.enable")
        self._until(lambda: self.value(session, "shownFrame") == 0, "no frame is shown")
        self.within(session, "Runtime.evaluate", expression=DRAWN, awaitPromise=True)
        return session


needs_chromium = pytest.mark.skipif(
    render.find_chromium() is None,
    reason="Chromium is not installed (Debian, Ubuntu: apt-get install chromium)",
)


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Return what pages asked of other hosts, by Chromium's own record, once it is closed. It knows frames too."""
    log, command = tmp_path / "net.json", render.command
    monkeypatch.setattr(render, "command", lambda *given: [*command(*given), f"--log-net-log={log}"])

    def addresses():
        parameters = [event.get("params") for event in json.loads(log.read_text(encoding="utf-8"))["events"]]
        requests = [item for item in parameters if isinstance(item, dict) and {"initiator", "url"} <= set(item)]
        own = "not an origin"  # Chromium's errands
        return [item["url"] for item in requests if item["initiator"] != own and re.match("http|ws|ftp", item["url"])]

    return addresses


@needs_chromium
def test_the_record_knows_what_a_sealed_frame_asks(asked, tmp_path):
    file = tmp_path / "page.html"
    inner = "<script>fetch('https://inner.invalid/').catch(() => parent.postMessage('asked', '*'))</script>"
    outer = "<script>onmessage = () => { window.asked = true; }</script><img src='http://outer.invalid/'>"
    file.write_text(f'{outer}<iframe sandbox="allow-scripts" srcdoc="{inner}"></iframe>')
    tab = Tab(str(tmp_path / "profile"), (300, 300))
    tab.open_report(file)
    tab._until(lambda: tab.evaluate("window.asked === true"), "the frame asked for nothing")
    tab.close()
    assert sorted(set(asked())) == ["http://outer.invalid/", "https://inner.invalid/"]


@needs_chromium
@pytest.mark.parametrize("width", [pytest.param(1280, marks=pytest.mark.slow), 400])
def test_a_browser_shows_it_and_asks_no_other_host(page, asked, tmp_path, width):
    file = tmp_path / "report.html"
    file.write_text(page, encoding="utf-8")
    tab = Tab(str(tmp_path / "profile"), (1280, 1100))
    try:
        shows(tab, file, width)
    finally:
        tab.close()
    assert asked() == []


def shows(tab, file, width):
    """Open the report in a window so wide: robot, scene and words are there, and nobody is asked."""
    tab.requests.clear()
    tab.call("Page.navigate", url="about:blank")
    size = {"width": width, "height": 1100, "deviceScaleFactor": SCALE, "mobile": width < 600}
    tab.call("Emulation.setDeviceMetricsOverride", **size)
    tab.open_report(file)
    assert tab.evaluate("document.documentElement.scrollWidth") == width, "the page is wider than the screen"
    assert tab.evaluate("[...document.images].every(i => i.complete && i.naturalWidth > 100)")
    tall = tab.evaluate("document.images[0].naturalHeight > document.images[0].naturalWidth")
    assert tall == (width < 600), "a phone has pictures of its own"
    tab.evaluate("document.getElementById('scene').scrollIntoView()")
    session = tab.wait_for_scene()
    assert tab.value(session, "Object.keys(viewer.scene_tree.children).length") > 5
    box = tab.evaluate(
        "(r => [r.left, r.top, r.right, r.bottom])(document.getElementById('scene').getBoundingClientRect())"
    )
    left, top, right, bottom = (round(value * SCALE) for value in box)
    seen = tab.screenshot()[max(top, 0) : bottom, left:right]
    middle = seen[seen.shape[0] // 5 : seen.shape[0] // 2, seen.shape[1] // 3 :]
    assert area(np.ptp(middle, axis=-1) > 60) > 500, "no colours where the robot stands"
    assert tab.value(session, "window.origin") == "null", "the scene is not sealed off"
    assert tab.errors == []
    assert tab.requests
    assert all(address.startswith((file.as_uri(), "data:", "about:", "blob:")) for address in tab.requests)


@pytest.mark.slow
@needs_chromium
def test_a_hostile_robot_runs_nothing(hostile_page, tmp_path, chromium):
    file = tmp_path / "report.html"
    file.write_text(hostile_page, encoding="utf-8")
    with chromium.tab(Tab, (1280, 1100)) as tab:
        guard = "window.alert = () => { window.alerted = true; };"
        tab.call("Page.addScriptToEvaluateOnNewDocument", source=guard)
        tab.open_report(file)
        session = tab.wait_for_scene()
        assert tab.evaluate("window.alerted === undefined")
        assert tab.evaluate("document.querySelectorAll('img').length") == 2
        assert tab.evaluate("document.title").startswith(EVIL)
        assert tab.value(session, "document.querySelectorAll('img').length") == 0
        assert tab.errors == []
        # even markup that came through would be stopped by the page's policy
        tab.evaluate("document.addEventListener('error', () => { window.failed = true; }, true)")
        tab.evaluate("document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=\"window.alerted = true\">')")
        tab._until(lambda: tab.evaluate("window.failed === true"), "the picture that is not there does not fail")
        assert tab.evaluate("window.alerted === undefined")


def test_a_stiff_direction_has_three_digits_in_tables_too():
    """Beside soft ones it was told with one digit, 0.02 for 0.0227."""
    size = np.array([75.57, 75.57, 0.02274, 581.1, 581.1, 50.4])
    cells = _cells(np.diag(size), np.arange(6) > 2)
    assert [cells[k][k] for k in range(6)] == ["75.57", "75.57", "0.0227", "581.1", "581.1", "50.4"]
    rounding = _cells(np.diag([*size[:2], 1e-18, *size[3:]]), np.arange(6) > 2)
    assert rounding[2][2] == "0"
