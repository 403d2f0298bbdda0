"""The static page and the live server in a real browser: everything is drawn, and nothing is asked of other hosts."""

import json

import numpy as np
import pytest

import prup_pin
from prup_pin.views.meshcat.view import view

from .chromium import SCALE, area, render

pytestmark = pytest.mark.skipif(
    render.find_chromium() is None, reason="Chromium is not installed (Debian, Ubuntu: apt-get install chromium)"
)
WRENCH = [300, 0, 0, 0, 0, 0]


@pytest.fixture(scope="module")
def browser(chromium):
    with chromium.tab() as tab:
        yield tab


@pytest.fixture(scope="module")
def three_prup():
    robot = prup_pin.load("3prup")
    return robot, robot.pose(z=0.4, theta=0.436, phi=0.262)


def pixels_of(browser, picture, points, base_to_display):
    """Return the colours where points (n, 3) of the base are seen, and whether labels leave them free."""
    there = np.asarray(points) @ base_to_display[:3, :3].T + base_to_display[:3, 3]
    flat = np.array(browser.evaluate(f"{json.dumps(there.tolist())}.map(project)"))[:, :2]
    columns, rows = np.round(flat * SCALE).astype(int).T
    assert ((columns >= 0) & (columns < picture.shape[1]) & (rows >= 0) & (rows < picture.shape[0])).all()
    return picture[rows, columns]


def hide_words(browser, display="none"):
    browser.evaluate(
        f"for (const name of ['labels', 'legend']) document.getElementById(name).style.display = '{display}'"
    )


def changed(one, other):
    return area(np.abs(one - other).max(axis=-1) > 12)


def only_here(browser, own):
    return [address for address in browser.requests if not address.startswith(("data:", "blob:", own))]


@pytest.fixture(scope="module")
def page(browser, three_prup, tmp_path_factory):
    """The static page, open in the browser: it asks for nothing."""
    robot, pose = three_prup
    shown = view(robot, pose, WRENCH)
    path = shown.save(tmp_path_factory.mktemp("page") / "view.html")
    browser.open(path.as_uri())
    assert only_here(browser, path.as_uri()) == []
    assert browser.errors == []
    return shown, path


def test_the_robot_is_drawn_where_it_must_be(browser, page):
    shown, _ = page
    hide_words(browser)
    drawn = browser.picture()
    for folder in ("robot", "modules", "drives", "frames", "wrench", "deflection", "ellipsoids", "floor"):
        browser.show(folder, False)
    empty = browser.picture()
    assert changed(drawn, empty) > 20_000
    # the background is a smooth gradient and nothing else
    assert np.abs(np.diff(empty, axis=1)[round(30 * SCALE) :]).max() <= 3
    for folder in ("robot", "modules", "drives", "frames", "wrench", "deflection", "ellipsoids", "floor"):
        browser.show(folder, True)
    scene = shown.scene
    for path in ("robot/deformed/beams/leg2/linear_rod", "robot/deformed/beams/leg2/moving_star_branch"):
        part = scene.part(path)
        points = part.shape.points[4:-4] @ part.placement[:3, :3].T + part.placement[:3, 3]
        here = pixels_of(browser, drawn, points, scene.display_from_base)
        there = pixels_of(browser, empty, points, scene.display_from_base)
        assert (np.abs(here - there).max(axis=1) > 30).mean() > 0.9, path
    # the rod with the largest share is drawn in the darkest colour of the map
    part = scene.part("robot/deformed/beams/leg2/linear_rod")
    points = part.shape.points[8:16] @ part.placement[:3, :3].T + part.placement[:3, 3]
    colours = pixels_of(browser, drawn, points, scene.display_from_base)
    red, green, blue = np.median(colours, axis=0)
    assert green < red < blue < 150


PARTS = {
    "robot/ghost": 1500,
    "robot/deformed": 7000,
    "ellipsoids/translation": 1500,
    "ellipsoids/rotation": 4000,
    "wrench/force": 400,
    "deflection": 100,
    "frames/tool": 200,
    "modules/leg1/motor": 500,
}


@pytest.mark.slow
def test_every_part_is_seen_and_can_be_switched_off(browser, page):
    hide_words(browser)
    drawn = browser.picture()
    for path, least in PARTS.items():
        browser.show(path, False)
        assert changed(drawn, browser.picture()) > least, path
        browser.show(path, True)
    assert changed(drawn, browser.picture()) < 50


def test_ghost_and_deformed_stand_apart(browser, page):
    """Each is drawn where the other is not."""
    hide_words(browser)
    others = ["robot/base", "modules", "drives", "frames", "wrench", "deflection", "ellipsoids", "floor"]
    states = ["robot/ghost", "robot/deformed"]
    for path in (*others, *states):
        browser.show(path, False)
    empty = browser.picture()
    masks = []
    for path in states:
        browser.show(path, True)
        masks.append(np.abs(browser.picture() - empty).max(axis=-1) > 12)
        browser.show(path, False)
    for path in (*others, *states):
        browser.show(path, True)
    ghost, bent = masks
    assert area(bent & ~ghost) > 0.2 * area(bent) > 1000
    assert area(ghost & ~bent) > 0.15 * area(ghost) > 500


def test_words_on_the_page(browser, page):
    hide_words(browser, "")
    browser.settle()
    words = browser.evaluate("document.body.innerText")
    for word in (
        "3prup",
        "fx 300 N",
        "times larger",
        "leg2/linear_rod",
        "38.7 %",
        "µm/N",
        "µrad/(N m)",
        "300 N",
        "leg1",
    ):
        assert word in words
    rectangles = "[...document.querySelectorAll('.label')].map(l => l.getBoundingClientRect())"
    boxes = np.array(browser.evaluate(f"{rectangles}.map(r => [r.left, r.top, r.right, r.bottom])"))
    for index, (left, top, right, bottom) in enumerate(boxes):
        for other in boxes[:index]:
            width = min(right, other[2]) - max(left, other[0])
            height = min(bottom, other[3]) - max(top, other[1])
            assert width <= 3 or height <= 3, "labels cover each other"


def test_up_is_up(browser, page):
    """The 3-PRUP's base has z downwards; gravity must point down on the screen."""
    shown, _ = page
    matrix = shown.scene.display_from_base
    points = np.array([[0, 0, 0], [0, 0, 0.6]]) @ matrix[:3, :3].T + matrix[:3, 3]
    top, bottom = browser.evaluate(f"{json.dumps(points.tolist())}.map(project)")
    assert bottom[1] > top[1] + 100


@pytest.mark.slow
def test_everything_is_in_sight_at_any_size(browser, page):
    """Where the page is opened, and where its window changes."""
    _, path = page
    try:
        for width, height in ((1200, 480), (420, 760)):
            browser.call(
                "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=SCALE, mobile=False
            )
            if width == 1200:
                browser.open(path.as_uri())
            browser._until(lambda width=width: browser.evaluate("window.innerWidth") == width, "no other size")
            browser.settle()
            flat = np.array(browser.evaluate("page.bounds.map(project)"))
            assert flat[:, 0].min() >= 0
            assert flat[:, 0].max() <= width
            assert flat[:, 1].min() >= 0
            assert flat[:, 1].max() <= height
            room = browser.evaluate("margins(window.innerWidth)")
            assert flat[:, 0].min() >= room["left"] - 2
            # and it fills what room there is
            across, up = width - room["left"], height - room["bottom"]
            assert max(np.ptp(flat[:, 0]) / across, np.ptp(flat[:, 1]) / up) > 0.6
    finally:
        browser.call("Emulation.clearDeviceMetricsOverride")
        browser.call("Page.navigate", url="about:blank")


def test_live_server(browser, three_prup):
    robot, pose = three_prup
    shown = view(robot, pose, WRENCH, serve=True)
    try:
        assert shown.url.startswith("http://127.0.0.1:")
        browser.open(shown.url)
        own = shown.url.removeprefix("http://")
        assert only_here(browser, f"http://{own}") == []
        assert "38.7 %" in browser.evaluate("document.body.innerText")
        hide_words(browser)
        first = browser.picture()
        browser.show("robot/deformed", False)
        assert changed(first, browser.picture()) > 7000
        browser.show("robot/deformed", True)
        # another pose arrives in the same tab
        shown.update(view(robot, robot.pose(z=0.3, theta=0, phi=0), WRENCH))
        browser._until(
            lambda: "z 300 mm" in browser.evaluate("document.getElementById('legend').textContent"), "no update"
        )
        hide_words(browser)
        assert changed(first, browser.picture()) > 5000
        assert browser.errors == []
    finally:
        browser.call("Page.navigate", url="about:blank")
        shown.close()


@pytest.mark.slow
def test_names_from_robot_files_are_only_text(browser, tmp_path):
    text = (prup_pin.robots.packaged_folder() / "3prup.urdf").read_text(encoding="utf-8")
    evil = "&lt;/script&gt;&lt;img src=x onerror=hacked=1&gt;"
    path = tmp_path / "evil.urdf"
    path.write_text(
        text.replace('robot name="3prup"', f'robot name="{evil}"').replace("leg2/linear_rod", f"leg2/{evil}"),
        encoding="utf-8",
    )
    robot = prup_pin.load(path)
    page = view(robot, robot.pose(z=0.4, theta=0.3, phi=0.2), WRENCH).save(tmp_path / "evil.html")
    browser.open(page.as_uri())
    assert "onerror=hacked" in browser.evaluate("document.getElementById('legend').textContent")
    assert browser.evaluate("typeof hacked") == "undefined"
    assert browser.evaluate("document.querySelectorAll('img').length") == 0
    assert only_here(browser, page.as_uri()) == []


@pytest.mark.slow
def test_a_motion_plays_what_its_frames_say(browser, three_prup, tmp_path):
    robot, pose = three_prup
    shown = view(robot, pose, WRENCH, motion="load")
    path = shown.save(tmp_path / "load.html")
    assert path.stat().st_size < 5e6
    pictures = []
    browser.open(f"{path.as_uri()}#t=0")
    hide_words(browser)
    for moment in (0, 30):
        browser.evaluate(f"time.value = {moment / shown.shown.rate}; time.dispatchEvent(new Event('input'))")
        pictures.append(browser.picture())
        hub = shown.shown.frames[moment].part("robot/deformed/links/hub").placement
        matrix = browser.evaluate(
            "viewer.scene_tree.find(['robot', 'deformed', 'links', 'hub']).object.matrix.elements"
        )
        np.testing.assert_allclose(np.reshape(matrix, (4, 4)).T, hub, atol=1e-6)
        # of all shapes of the bent rod the one of this frame is drawn
        rod = "viewer.scene_tree.find(['robot', 'deformed', 'beams', 'leg2', 'linear_rod', '<object>']).object"
        target = f"{rod}.geometry.attributes.position.array"
        drawn = np.array(browser.evaluate(f"Array.from({target})")).reshape(-1, 3)
        bent = shown.shown.frames[moment].part("robot/deformed/beams/leg2/linear_rod").shape.mesh.vertices
        np.testing.assert_allclose(drawn, bent, atol=1e-5 * np.ptp(bent))
    assert changed(*pictures) > 4000
    assert browser.errors == []


@pytest.mark.slow
def test_ur5_with_its_meshes(browser, tmp_path):
    pytest.importorskip("trimesh")
    robot = prup_pin.load("ur5", joint_stiffness=1e4)
    at = dict(zip(robot.task_coordinates, (0.4, -1.2, 1.4, -1.7, -1.57, 0.3), strict=True))
    shown = view(robot, at, [0, 0, -100, 0, 0, 0])
    browser.open(shown.save(tmp_path / "ur5.html").as_uri())
    hide_words(browser)
    drawn = browser.picture()
    for path, least in (("robot/deformed", 10_000), ("robot/base", 60)):
        browser.show(path, False)
        left = browser.picture()
        assert changed(drawn, left) > least
        drawn = left
    assert browser.errors == []
