"""The report of a diagnosis says what was found, lets no name out of its place, and needs nothing but itself."""

import dataclasses
import html
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.text import Text

import prup_pin
from prup_pin.diagnosis.corrected import corrected_model
from prup_pin.diagnosis.diagnosis import Detectable, Finding, FittedParameter
from prup_pin.diagnosis.efforts import EffortCurve, effort_curve_of
from prup_pin.laws import Inputs
from prup_pin.laws.deviations import deviations_of
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.laws.efforts.inertial_parameters import InertialParameters
from prup_pin.numbers import number, quantity
from prup_pin.recordings import Tolerances, read_plan
from prup_pin.simulation import Simulator, effect_named, read_model
from prup_pin.views.drawing.diagnosis_figures import _lines, marks, place_figure, within_all_95
from prup_pin.views.report import pages
from prup_pin.views.report.as_json import diagnosis_as_json
from prup_pin.views.report.diagnosis_files import write_diagnosis
from prup_pin.views.report.diagnosis_report import diagnosis_html
from prup_pin.views.report.pages import page_template
from prup_pin.views.text.diagnosis_words import (
    alternative_text,
    by_place,
    cost_text,
    ends_of,
    hidden_rows,
    parameter_texts,
    places_text,
    summary_text,
    verdict_text,
)

from .chromium import render

EVIL = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>&amp;"
needs_chromium = pytest.mark.skipif(render.find_chromium() is None, reason="Chromium is not installed")


@pytest.fixture(scope="module")
def page(diagnosed):
    robot, recording, diagnosis = diagnosed
    return diagnosis_html(diagnosis, robot, recording)


def words(page):
    body = re.sub(r"<(script|style)\b.*?</\1>", " ", page[page.index("<body>") :], flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", body.replace("<wbr>", ""))).replace("\u2212", "-").split())


def test_a_verdict_of_many_findings_tells_each_physics_once(diagnosed):
    _, _, diagnosis = diagnosed
    first = replace(diagnosis.findings[0], effect=None)
    many = [
        replace(first, physics=physics, location=f"joint_{index}")
        for physics, count in (("coulomb_friction", 5), ("effort_gain", 1), ("backlash", 2))
        for index in range(count)
    ]
    told = verdict_text(replace(diagnosis, verdict="explained", findings=tuple(many)))
    assert "coulomb friction at joint_0 and 4 more, effort gain at joint_0 and backlash at joint_0 and 1 more" in told
    few = verdict_text(replace(diagnosis, verdict="explained", findings=tuple(many[:6])))
    assert "coulomb friction at joint_4 and effort gain at joint_0" in few


def test_it_says_what_was_found(diagnosed, page):
    _, recording, diagnosis = diagnosed
    text = words(page)
    assert verdict_text(diagnosis) in text
    first = diagnosis.findings[0]
    assert f"{first.physics} at {first.location}" in text
    for name, value, interval in parameter_texts(first.parameters):
        assert f"{name} {value} {interval}" in text
    for place in first.candidates:
        assert place.partition("/")[2] in text
    assert f"Samples {len(recording)} " in text
    assert "position 2 µm rotation 10 µrad" in text
    assert "prup-pin predict corrected_model.json" in text
    for remark in diagnosis.remarks:
        assert remark in text


def test_a_mechanic_reads_at_its_top_what_is_wrong_and_what_to_do_first(diagnosed, page):
    _, _, diagnosis = diagnosed
    said, first = summary_text(diagnosis), diagnosis.findings[0]
    text = words(page)
    order = ("How much better it is now", "Where it sits", "Left out", "What was measured", "Remarks")
    assert sorted(order, key=text.index) == list(order)
    assert text.index(said) < text.index("What was measured")
    assert f"{quantity(1e-6 * diagnosis.by_channel['position']['before_um'], 'm')} (root mean square)" in said
    assert first.statement in said
    assert f"To do first: {first.remedy}, or look at leg2: " in said
    # that loads move a robot is no fault: it is told where nothing else is
    moved = Finding("finite_deflection", "robot", ("robot",), {}, 0.1, "loads move it far")
    assert "One thing accounts for it:" in summary_text(replace(diagnosis, findings=(first, moved)))
    clean = replace(diagnosis, findings=(moved,), verdict="nothing_missing")
    assert "that is no fault. Simulated in that way," in summary_text(clean)
    assert "nothing needs repair" in summary_text(clean)
    assert "Nothing is missing" in verdict_text(clean)
    assert "in its deformed position" in verdict_text(clean)
    missing = summary_text(replace(diagnosis, findings=(moved,), verdict="unexplained"))
    assert "accounts for" not in missing
    assert "No law of the library explains it: something is missing" in missing
    loud = summary_text(replace(diagnosis, after={**diagnosis.after, "heldout": 10.4}))
    assert "little more than" not in loud
    assert "10.4 times the sensors' own scatter" in loud
    assert "nothing needs repair" in summary_text(replace(diagnosis, findings=(), verdict="nothing_missing"))
    strange = replace(diagnosis, findings=(), verdict="unexplained")
    assert "No law of the library explains it: something is missing that no law describes" in summary_text(strange)


def test_each_finding_says_what_leaving_it_out_costs_and_what_to_do(diagnosed, page):
    """Shares of one residual that each add up to more than all of it read as a contradiction."""
    _, _, diagnosis = diagnosed
    first = diagnosis.findings[0]
    assert "Alone it" not in words(page)
    assert f"To do: T{first.remedy[1:]}." in words(page)
    # held out, without it: what the diagnosis says that it takes away, over what is left with it
    squares = 1 / (1 - first.heldout_gain)
    assert f"Without it the residual would be {number(squares**0.5, 3)} times as large." in words(page)
    little = replace(first, heldout_gain=1 - 1 / 1.05**2)
    assert cost_text(little) == "without it the residual would be 5 % larger"
    assert (
        cost_text(replace(first, heldout_gain=1.0)) == "without it the residual would be more than 1000 times as large"
    )
    assert cost_text(replace(first, heldout_gain=0.0)) == "other errors could compensate for it"
    unknown = replace(first, physics="unknown", effect=None, heldout_gain=0.4)
    assert cost_text(unknown) == ""  # its statement has shares of what is left


def test_what_has_no_effect_of_its_own_is_told_by_its_physics(diagnosed):
    robot, _, _ = diagnosed
    words = {item.physics for item in deviations_of(robot.mechanism)} | {"effort_gain", "inertial_parameters"}
    for physics in sorted(words | {"finite_deflection", "unknown"}):
        found = Finding(physics, "leg1", ("leg1",), {}, 0.5, "off")
        assert len(found.remedy.split()) > 4, physics
        assert "{" not in found.remedy
    rubs = next(law for law in EFFORT_LAWS if law.physics == "coulomb_friction")
    places = ("robot", "elbow", "wrist")
    many = Finding("coulomb_friction", "robot", places, {}, 0.5, "dry friction at 2 of 3 drives", law=rubs)
    assert many.remedy.startswith("feed the friction at each of these places forward in the controller")
    assert many.at_each == ("elbow", "wrist")
    masses = replace(many, physics="inertial_parameters", law=None)
    assert replace(masses, law=InertialParameters().together(())).remedy.startswith("take the masses of the corrected")
    assert replace(masses, location="elbow").remedy.startswith("weigh elbow")
    assert alternative_text(many) == []
    assert "look at the robot itself" in Finding("unknown", "robot", ("robot",), {}, 0.0, "left").remedy


def test_all_places_of_what_several_have_are_marked_by_its_number(diagnosed):
    robot, _, _ = diagnosed
    joints = tuple(robot.mechanism.actuated)
    many = Finding("coulomb_friction", "robot", ("robot", *joints), {}, 0.5, "dry friction at 3 of 3 drives")
    assert [(mark.name, mark.number) for mark in marks(robot, robot.home, [many])] == [(name, 1) for name in joints]
    alike = replace(many, location=joints[0])
    assert [mark.number for mark in marks(robot, robot.home, [alike])] == [1, 0, 0]


@pytest.mark.usefixtures("without_pictures")
def test_what_many_drives_have_is_one_line_a_joint(diagnosed):
    robot, recording, diagnosis = diagnosed
    pair = {"limit": FittedParameter(2.5, "N", (2.0, 3.0)), "presliding": FittedParameter(1e-5, "m", (0.0, 2e-5))}
    joints = ("leg1_slide", "leg2_slide", "leg3_slide")
    parameters = {f"{joint}.{key}": fitted for joint in joints for key, fitted in pair.items()}
    many = Finding("coulomb_friction", "robot", ("robot", *joints), parameters, 0.5, "dry friction at 3 of 3 drives")
    text = words(diagnosis_html(replace(diagnosis, findings=(many,)), robot, recording))
    line = "2.5 N 2 to 3 N below 20 µm 0 to 20 µm"  # no presliding would do as well
    assert f"limit presliding leg1_slide {line} leg2_slide {line} leg3_slide {line}" in text
    assert by_place(replace(many, candidates=("robot",))) == {}
    assert by_place(diagnosis.findings[0]) == {}


@pytest.mark.usefixtures("without_pictures")
def test_a_next_experiment_has_a_heading_where_there_is_one_and_a_column_for_each_pose(diagnosed):
    robot, recording, diagnosis = diagnosed
    none = diagnosis_html(replace(diagnosis, next_experiment={"why": "", "plan": {}}), robot, recording)
    assert "The next experiment" not in none
    poses = [{"actuators": dict.fromkeys(robot.mechanism.actuated, 0.1 * n)} for n in (1, 2, 3, 4)]
    plan = {"poses": poses, "loads": [{"wrench": {"fz": 7.0}}, {"wrench": {"fz": 9.0}, "poses": [1]}]}
    page = diagnosis_html(replace(diagnosis, next_experiment={"why": "", "plan": plan}), robot, recording)
    name = robot.mechanism.actuated[0]
    assert f"unit pose 1 pose 2 pose 3 pose 4 {name} mm 100 200 300 400" in words(page)
    assert "fz N 7 7 7 7" in words(page)
    assert "mx N m" not in words(page)


def test_it_is_self_contained(page):
    assert len(page) < 3_000_000
    assert "<script" not in page
    assert "default-src 'none'" in page
    for address in re.findall(r'(?:src|srcset|href)="([^"]*)"', page):
        assert address.startswith("data:image/"), address[:80]
    assert page.count("data:image/") == 2 * 4  # place, local response, samples, histograms; wide and for a phone


def test_effects_that_stayed_hidden_are_grouped(diagnosed):
    _, _, diagnosis = diagnosed
    rows = hidden_rows(diagnosis.not_detectable)
    assert len(diagnosis.not_detectable) > 3 * len(rows)
    items = [Detectable("backlash", f"leg{leg}/motor", "half_gap", leg * 1e-5, "m", "") for leg in (1, 2, 3)]
    assert hidden_rows(items) == [
        ("backlash", "leg1, leg2, leg3: motor", "half gap above 10 µm at leg1/motor to 30 µm at leg3/motor")
    ]
    items = [Detectable("stiffness_changed", "leg1/motor", "factor", 0.1, "1", "", below=True)]
    assert hidden_rows(items) == [("stiffness changed", "leg1/motor", "factor below 0.1")]
    never = Detectable("torsion", "robot", "scale", None, "1", "not visible at any size")
    assert hidden_rows([never])[0][2] == "not visible at any size"
    assert hidden_rows([Detectable("encoder_delay", "", "delay", None, "s", "no speeds")])[0][2] == "no speeds"


def test_places_fold_their_legs():
    assert places_text(["leg1/a", "leg1/b", "leg2/a", "robot"]) == "leg1, leg2: a; leg1/b; robot"


def test_no_page_breaks_a_word_where_a_space_would_do():
    """`anywhere` lets a table's columns shrink to a letter; `break-word` breaks only what fits on no line."""
    for name in ("page_style.css", "life_page.html", "fleet_page.html", "diagnosis_page.html"):
        assert "overflow-wrap: anywhere" not in (Path(pages.__file__).parent / name).read_text(encoding="utf-8"), name


def test_a_part_and_what_it_belongs_to_are_no_rivals(diagnosed):
    _, _, diagnosis = diagnosed
    names = ("joint3/drive", "joint3")
    drive = dataclasses.replace(diagnosis.findings[0], location="joint3/drive", candidates=names, alternatives=())
    assert alternative_text(drive) == ["joint3/drive is part of joint3, which may be meant as a whole"]
    joint = dataclasses.replace(drive, location="joint3", candidates=(*names, "joint30"))
    assert alternative_text(joint) == [
        "these data cannot tell joint3 from joint30",
        "of joint3, joint3/drive alone would explain as much",
    ]


def test_the_local_curve_is_that_of_the_law(diagnosed):
    """The deformation that the samples ask for is the gap, without knowing of it."""
    _, _, diagnosis = diagnosed
    response = diagnosis.findings[0].recovered
    gap = diagnosis.findings[0].parameters["half_gap"].value
    far = np.abs(response.x) > 5
    assert far.sum() > 20
    spread = np.abs(response.y[far] - np.sign(response.x[far]) * gap) / response.deviation[far]
    assert np.sqrt(np.mean(spread**2)) < 1.4
    np.testing.assert_allclose(response.law[far], np.sign(response.x[far]) * gap, atol=0.03 * gap)


def test_whitened_residuals_agree_with_the_verdict(diagnosed):
    _, _, diagnosis = diagnosed
    found = diagnosis.residuals
    assert np.sqrt(np.mean(found.after[found.exists] ** 2)) == pytest.approx(diagnosis.after["fit"], rel=0.02)
    assert np.sqrt(np.mean(found.before[found.exists] ** 2)) == pytest.approx(diagnosis.before["fit"], rel=0.02)


@pytest.mark.usefixtures("without_pictures")
def test_what_no_law_explains_is_shown_without_one(diagnosed_strange):
    robot, recording, diagnosis = diagnosed_strange
    page = diagnosis_html(diagnosis, robot, recording)
    text = words(page)
    assert "Unexplained" in text
    assert "no law of the library" in text
    assert len(page) < 3_000_000


@pytest.mark.usefixtures("without_pictures")
def test_no_name_leaves_its_place(diagnosed):
    robot, recording, diagnosis = diagnosed
    finding = dataclasses.replace(diagnosis.findings[0], statement=EVIL, candidates=(EVIL,), alternatives=(EVIL,))
    worse = dataclasses.replace(
        diagnosis,
        findings=(finding,),
        remarks=(EVIL,),
        not_detectable=(Detectable(EVIL, EVIL, EVIL, None, EVIL, EVIL),),
        next_experiment={"why": EVIL, "plan": {}},
    )
    page = diagnosis_html(worse, robot, dataclasses.replace(recording, path=EVIL, notes=EVIL))
    assert "<script>alert" not in page
    assert "<img src=x" not in page
    assert len(re.findall("<img", page)) == 4


def test_json_has_no_nan(diagnosed):
    robot, _, diagnosis = diagnosed
    none = {"fit": float("nan"), "heldout": float("inf")}
    document = diagnosis_as_json(dataclasses.replace(diagnosis, before=none), robot)
    assert document["residual"]["before"] == {"fit": None, "heldout": None}
    json.dumps(document, allow_nan=False)


def test_a_value_on_its_bound_can_be_written(diagnosed, tmp_path):
    robot, recording, diagnosis = diagnosed
    effect = diagnosis.effects[0]
    low = {item.name: item.lower for item in effect.law.quantities_at(effect.place, robot.mechanism)}
    worse = dataclasses.replace(diagnosis, effects=(dataclasses.replace(effect, values=low),))
    write_diagnosis(worse, robot, recording, tmp_path, robot_name="3prup", report=False)
    written = read_model(tmp_path / "corrected_model.json")
    assert len(written.effects) == 1
    # the same from Python, without files
    made = corrected_model(worse, robot, [recording], "3prup")
    assert [str(effect.place) for effect in made.effects] == [str(effect.place) for effect in written.effects]
    assert made.effects[0].values == pytest.approx(dict(written.effects[0].values), rel=1e-9)


def test_the_next_experiment_declares_the_same_tolerances(diagnosed, tmp_path):
    robot, recording, diagnosis = diagnosed
    one = diagnosis.next_experiment["plan"] or {"poses": [{"at": {"z": 0.4}}], "loads": [{"wrench": {"fz": 1.0}}]}
    planned = dataclasses.replace(diagnosis, next_experiment={"why": "to tell them apart", "plan": one})
    declared = dataclasses.replace(recording, tolerances=Tolerances(stiffness=0.1))
    write_diagnosis(planned, robot, declared, tmp_path, robot_name="3prup", report=False)
    assert read_plan(tmp_path / "next_experiment.json").tolerances == Tolerances(stiffness=0.1)
    write_diagnosis(planned, robot, recording, tmp_path, robot_name="3prup", report=False)
    assert read_plan(tmp_path / "next_experiment.json").tolerances == Tolerances()


@needs_chromium
@pytest.mark.parametrize("width", [1150, pytest.param(400, marks=pytest.mark.slow)])
def test_a_browser_shows_it_without_a_network(page, tmp_path, chromium, width):
    file = tmp_path / "report.html"
    file.write_text(page, encoding="utf-8")
    with chromium.tab() as tab:
        shows(tab, file, (width, 900))
        pixels = tab.screenshot()
        assert pixels.shape[1] == width
        assert (np.ptp(pixels, axis=-1) > 60).sum() > 200, "no colours"
        assert all(address.startswith((file.as_uri(), "data:", "about:", "blob:")) for address in tab.requests)


def shows(tab, file, size):
    """Open a page in a window of this size in pixels, each of which is drawn."""
    sizes = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size[0] < 600}
    tab.call("Emulation.setDeviceMetricsOverride", **sizes)
    tab.call("Page.navigate", url=file.as_uri())
    complete = f"location.href === '{file.as_uri()}' && document.readyState === 'complete'"
    tab._until(lambda: tab.evaluate(complete), "no page")


@needs_chromium
@pytest.mark.usefixtures("without_pictures")
def test_no_table_is_cut_off_on_a_screen(diagnosed, tmp_path, chromium):
    """Whatever stands in a box that scrolls sideways fits into it; on a phone the plan of five poses as well."""
    robot, recording, diagnosis = diagnosed
    wider = "[...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth).length"
    with chromium.tab() as browser:
        for width, count in ((1200, 8), (390, 5)):
            at = dict.fromkeys(robot.mechanism.actuated, 0.356789)
            load = dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), -123.456)
            plan = {"poses": [{"actuators": at}] * count, "loads": [{"wrench": load}]}
            planned = replace(diagnosis, next_experiment={"why": "to tell them apart", "plan": plan})
            file = tmp_path / f"{width}.html"
            file.write_text(diagnosis_html(planned, robot, recording), encoding="utf-8")
            shows(browser, file, (width, 900))
            assert browser.evaluate("document.querySelectorAll('table.plan th').length") > count
            assert browser.evaluate(wider) == 0
            assert browser.evaluate("document.documentElement.scrollWidth") <= width


def test_what_no_law_takes_away_is_not_drawn_with_a_laws_curve():
    """A joint that has a law and something unknown beside it: the law's curve is the law's."""
    x = np.linspace(-1, 1, 5)
    drawn = EffortCurve("elbow", "speed", x, x, np.ones(5), x, "rad/s", "N m", "coulomb_friction")
    other = EffortCurve("elbow", "speed", x, 2 * x, np.ones(5), 2 * x, "rad/s", "N m", "viscous_friction")
    own = EffortCurve("elbow", "position", x, x, np.ones(5), None, "rad", "N m")
    unknown = Finding("unknown", "elbow", ("elbow",), {}, 0.0, "something is left")
    assert effort_curve_of(unknown, SimpleNamespace(curves=(drawn,))) is None
    assert effort_curve_of(unknown, SimpleNamespace(curves=(drawn, own))) is own
    here = SimpleNamespace(curves=(own, drawn, other))
    # of two laws that one variable drives each has its own
    for curve in (drawn, other):
        assert effort_curve_of(dataclasses.replace(unknown, physics=curve.physics), here) is curve


def test_rows_of_a_marker_are_named_in_short_lines():
    assert _lines("position") == ["position"]
    assert _lines("marker leg2_bush rotation") == ["leg2_bush", "rotation"]
    assert _lines(f"marker {'x' * 60} position") == ["x" * 17 + "…", "position"]


def test_a_name_breaks_between_its_words_and_is_escaped():
    breakable = page_template("diagnosis_page.html").environment.filters["breakable"]
    assert breakable("shoulder_pan_joint") == "shoulder_<wbr>pan_<wbr>joint"
    assert breakable("a_b<script>") == "a_<wbr>b&lt;script&gt;"
    assert breakable("two words_here") == "two words_here"  # escaped by the page


def test_no_line_ends_between_a_number_and_its_unit(page):
    assert re.search(r"\d\N{NO-BREAK SPACE}µm", page)
    assert not re.search(r"\d (?:µm|mm|µrad|mrad)\b", re.sub(r"<img[^>]*>", "", page))


def test_the_band_of_a_response_holds_all_its_means_at_once():
    drawn = np.abs(np.random.default_rng(1).normal(size=(20_000, 13))).max(axis=1)
    assert np.mean(drawn < within_all_95(13)) == pytest.approx(0.95, abs=0.005)
    assert within_all_95(1) == pytest.approx(1.96, abs=0.001)


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (104e3, 1691.0, ("104", "1.69", "mm")),
        (9e3, 3.2, ("9000", "3.2", "µm")),
        (20.0, 0.41, ("20", "0.41", "µm")),
        (float("nan"), float("nan"), ("-", "-", "mm")),
    ],
)
def test_a_residual_is_told_in_the_unit_that_suits_what_is_left(before, after, told):
    assert ends_of({"before_um": before, "after_um": after}, "m") == told


def test_a_dashed_ring_is_explained_where_one_is_drawn_however_many_findings_there_are(diagnosed):
    robot, _, diagnosis = diagnosed
    own = replace(diagnosis.findings[0], location="leg1/motor", candidates=("leg1/motor",))
    for rivals, drawn in (((), False), (("leg1/motor", "leg2/ball_nut"), True)):
        found = replace(diagnosis, findings=(replace(own, candidates=rivals or own.candidates), *[own] * 12))
        said = " ".join(text.get_text() for text in place_figure(robot, found, narrow=True).findobj(Text))
        assert ("dashed ring" in said) == drawn
        assert "…" in said


@pytest.mark.slow
def test_a_flat_robots_picture_on_a_phone_is_no_higher_than_it_needs(diagnosed):
    _, _, diagnosis = diagnosed
    none = replace(diagnosis, findings=(), final=None)
    heights = [place_figure(robot, none, narrow=True).get_figheight() for robot in map(prup_pin.load, ("ur5", "3prup"))]
    assert heights[0] < 6 < heights[1] + 0.8


ARM = """<robot name="arm">
  <link name="base"/>
  <link name="column"><inertial><origin xyz="0 0 0.2"/><mass value="5"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="4"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="column"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="lift" type="revolute"><parent link="column"/><child link="upper"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="bend" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="hand_fix" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="0.4 0 0"/></joint>
  <prup_pin version="1"><tool frame="hand"/><actuated joints="turn lift bend"/>
    <module name="lift/gear" type="joint_spring" joint="lift">
      <parameter name="stiffness" value="1e5" unit="N m/rad"/></module>
    <module name="bend/gear" type="joint_spring" joint="bend">
      <parameter name="stiffness" value="5e4" unit="N m/rad"/></module>
  </prup_pin>
</robot>"""


@pytest.mark.parametrize(
    ("physics", "place", "aspect", "values"),
    [
        ("joint_compliance", "lift", "across", {"compliance": 3e-6}),
        ("link_bending", "bend", "link before", {"flexibility": 1e-5}),
    ],
)
def test_what_yields_where_the_file_has_no_module_is_drawn(physics, place, aspect, values, diagnosed, tmp_path):
    """The poses that a corrected robot takes are not those of the file's: it has modules more."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM, encoding="utf-8")
    robot = prup_pin.load(path)
    rng = np.random.default_rng(5)
    loads = rng.normal(scale=100.0, size=(8, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    inputs = Inputs(np.arange(8.0), rng.uniform(-1, 1, (8, 3)), loads, np.arange(8))
    run = Simulator(robot, inputs).run([effect_named(physics, place, aspect, values, robot.mechanism)])
    _, _, diagnosis = diagnosed
    finding = replace(diagnosis.findings[0], physics=physics, location=place, candidates=(place,))
    found = replace(diagnosis, final=run, findings=(finding,))
    said = " ".join(text.get_text() for text in place_figure(robot, found).findobj(Text))
    assert place in said
    assert "yielding" not in said  # a help of the simulation's, and no part of the robot
