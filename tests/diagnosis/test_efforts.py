"""Efforts in motion: concealed arms, real and drawn recordings, one diagnosis of both channels."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from prup_pin import load
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.efforts.residuals import EffortResiduals
from prup_pin.diagnosis.efforts.unexplained import _beyond_declared
from prup_pin.diagnosis.prospects import prospects
from prup_pin.dynamics import INERTIAL
from prup_pin.dynamics.inertial import pseudo_inertia
from prup_pin.errors import InputError
from prup_pin.laws import Effect, Place
from prup_pin.laws.efforts.inertial_parameters import InertialParameters, is_impossible
from prup_pin.numbers import quantity
from prup_pin.recordings import Recording, Tolerances, read_recording
from prup_pin.simulation import CorrectedModel, simulate
from prup_pin.views.report.diagnosis_report import diagnosis_html
from prup_pin.views.text.diagnosis_words import cost_text, diagnosis_text, parameter_texts, summary_text, verdict_text
from tests.reference.concealed.efforts import draw_efforts, write

from ..as_written import as_written
from ..elsewhere import EMPS, needs_emps
from .conftest import AXIS
from .test_effort_band import changed_bodies

ROBOTS = Path(__file__).parents[1] / "robots"


def device(folder, seed, robot, effects, multiple=(6.0, 20.0)):
    """Return a concealed robot's recording, and a second one, as files would hold them."""
    write(draw_efforts(seed, robot, effects, multiple), folder, folder, "it")
    return read_recording(folder / "it.csv"), read_recording(folder / "it.heldout.csv")


def axis(n=6000, *, damping=0.0, limit=0.0, slow=0.0, drag=0.0, pinch=0.0, noise=0.5, seed=1):
    """Return a recording of the ball-screw axis at 250 Hz whose efforts are known."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) * 0.004
    q = 0.1 * np.sin(1.1 * time) + 0.05 * np.sin(2.9 * time + 1)
    v = 0.11 * np.cos(1.1 * time) + 0.145 * np.cos(2.9 * time + 1)
    a = -0.121 * np.sin(1.1 * time) - 0.4205 * np.sin(2.9 * time + 1)
    coloured = np.zeros(n)
    for row in range(1, n):
        coloured[row] = 0.9 * coloured[row - 1] + rng.normal() * noise * np.sqrt(1 - 0.81)
    tau = 95 * a + damping * v + limit * np.sign(v) + drag * v * np.abs(v) + coloured
    tau += slow * np.exp(-((v / 0.04) ** 2)) * np.sign(v)
    tau += pinch * np.sign(v) * (1 + np.sin(2 * np.pi * q / 0.12))
    q = np.round((q + 1e-8 * rng.normal(size=n)) * 1e7) / 1e7
    return Recording(time=time, positions={"carriage": q}, efforts={"carriage": tau})


def named(found):
    return {(finding.physics, finding.location) for finding in found.findings}


@pytest.mark.usefixtures("without_pictures")
def test_an_axis_as_drawn_misses_nothing(carriage):
    found = diagnose(carriage, axis())
    assert found.verdict == "nothing_missing"
    assert not found.findings
    assert found.efforts.shares["carriage"]["heldout"] < 0.05
    # efforts need no tool, nor does the page about them
    assert carriage.mechanism.tool is None
    assert "Nothing is missing" in diagnosis_html(found, carriage, axis())


@pytest.mark.parametrize(
    ("physics", "named_here"),
    [pytest.param("viscous_friction", "damping", marks=pytest.mark.slow), ("coulomb_friction", "limit")],
)
def test_where_nothing_is_missing_it_says_what_would_have_been_seen(carriage, physics, named_here):
    """The size that is told is the border: a third of it stays unseen, three times as much is found."""
    (size,) = [item.smallest for item in diagnose(carriage, axis()).seen if item.physics == physics]
    assert diagnose(carriage, axis(**{named_here: size / 3})).verdict == "nothing_missing"
    found = diagnose(carriage, axis(**{named_here: 3 * size}))
    assert named(found) == {(physics, "carriage")}
    assert found.seen == ()


def test_masses_of_links_held_together_stand_in_the_corrected_model_at_their_body(tmp_path):
    """A fixture on the table has a mass of its own, and no place of its own in a motion."""
    held = '<joint name="bolts" type="fixed"><parent link="table"/><child link="fixture"/></joint>'
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    fixture = f'<link name="fixture"><inertial><mass value="25"/>{inertia}</inertial></link>'
    text = AXIS.read_text().replace('value="95"', 'value="66"').replace("</robot>", f"{held}{fixture}</robot>")
    (tmp_path / "axis.urdf").write_text(text)
    robot = load(tmp_path / "axis.urdf")
    recording = replace(axis(), tolerances=Tolerances(mass=0.05))
    found = diagnose(robot, recording)
    assert found.verdict == "nothing_missing"
    change = {effect.place.name: effect.values["mass"] for effect in found.effects}
    assert list(change) == ["table"]
    assert 66 + 25 + change["table"] == pytest.approx(95, rel=3e-3)
    predicted = simulate(robot, recording, CorrectedModel("it", found.effects).effects)
    left = recording.efforts["carriage"] - predicted.efforts["carriage"]
    assert np.std(left[250:-250]) < 0.55


def test_friction_is_found_with_intervals_that_hold_it(carriage):
    found = diagnose(carriage, axis(damping=200.0, limit=20.0))
    assert found.verdict == "explained"
    assert named(found) == {("viscous_friction", "carriage"), ("coulomb_friction", "carriage")}
    by_word = {finding.physics: finding for finding in found.findings}
    for word, name, true in (("viscous_friction", "damping", 200.0), ("coulomb_friction", "limit", 20.0)):
        fitted = by_word[word].parameters[name]
        assert fitted.value == pytest.approx(true, rel=0.03)
        low, high = fitted.interval
        assert low < true < high or abs(fitted.value - true) < 0.01 * true


def test_friction_is_known_no_better_than_the_gain_of_its_drive_within_its_tolerance(carriage):
    """A drive that reports 6 % too much reports its friction so, too; both were told to three digits."""
    recording = axis(damping=100.0, limit=20.0)
    reported = {"carriage": 1.06 * recording.efforts["carriage"]}
    found = diagnose(carriage, replace(recording, efforts=reported, tolerances=Tolerances(effort_gain=0.1, mass=0.01)))
    by_word = {finding.physics: finding for finding in found.findings}
    for word, name, true in (("viscous_friction", "damping", 100.0), ("coulomb_friction", "limit", 20.0)):
        fitted = by_word[word].parameters[name]
        assert fitted.value == pytest.approx(1.06 * true, rel=0.03)
        assert fitted.interval[0] < true < fitted.interval[1]
    (gain,) = [remark for remark in found.remarks if "gains are off" in remark]
    off, low, high = (float(number) for number in re.findall(r"([+-][\d.]+) %?", gain.replace("(95 %: ", "("))[:3])
    assert low < 6 < high
    assert off == pytest.approx(6, abs=1)


@pytest.mark.slow
def test_friction_many_times_the_noise_is_settled_so_far_that_nothing_imitates_what_is_left(carriage):
    """A speed or a way between those that are scanned would leave what looks like a delay."""
    found = diagnose(carriage, axis(4000, limit=60.0, slow=150.0, noise=0.2))
    assert found.verdict == "explained"
    assert named(found) == {("stribeck_friction", "carriage")}
    (finding,) = found.findings
    for name, true in (("limit", 60.0), ("extra", 150.0), ("speed", 0.04)):
        fitted = finding.parameters[name]
        assert fitted.value == pytest.approx(true, rel=0.01)
        low, high = fitted.interval
        assert low < fitted.value < high
        assert 1e-4 * true < high - low < 0.05 * true
    assert "stribeck_friction at carriage; residual" in repr(found)
    assert "speed 0.0399" in str(found) or "speed 0.0400" in str(found)
    assert len(repr(found.findings)) < 2000


def by_position(recording, effort):
    """Return a recording of the axis whose drive gives an effort of its position too."""
    tau = recording.efforts["carriage"] + effort(recording.positions["carriage"])
    return recording.with_measurements(efforts={"carriage": tau})


@pytest.mark.slow
def test_a_wave_longer_than_the_travel_is_told_by_its_shape_and_predicted_beyond(carriage):
    """The axis sees 0.7 of a period; the same motion 1.6 times as wide sees more than one."""

    def wave(q):
        return 20 * np.sin(2 * np.pi * q / 0.4 + 1)

    found = diagnose(carriage, by_position(axis(3000), wave))
    assert found.verdict == "explained"
    assert named(found) == {("cogging", "carriage")}
    assert found.findings[0].parameters["period"].value == pytest.approx(0.4, rel=0.01)
    wider = axis(3000, noise=0.0)
    q = 1.6 * wider.positions["carriage"]
    wider = replace(wider, positions={"carriage": q})
    added = simulate(carriage, wider, found.effects).efforts["carriage"] - simulate(carriage, wider).efforts["carriage"]
    assert added[100:-100] == pytest.approx(wave(q)[100:-100], abs=0.5)


@pytest.mark.slow
def test_a_spring_that_leaves_structure_is_held_where_the_joint_was_not_seen(carriage):
    """Drag by the square of the speed is no law of the library: beside it what is known of a spring ends with the
    travel."""
    found = diagnose(carriage, by_position(axis(3000, drag=100.0), lambda q: 300 * q))
    assert found.verdict == "unexplained"
    springs = [effect for effect in found.effects if effect.place.aspect == "effort against position"]
    wider = axis(3000, noise=0.0)
    seen = wider.positions["carriage"]
    q = 1.6 * seen
    wider = replace(wider, positions={"carriage": q})
    added = simulate(carriage, wider, springs).efforts["carriage"] - simulate(carriage, wider).efforts["carriage"]
    held = 300 * np.clip(q, seen.min(), seen.max())
    assert added[100:-100] == pytest.approx(held[100:-100], abs=3.0)
    assert any("continued as a constant beyond the travel" in remark for remark in found.remarks)


@pytest.mark.slow
def test_a_hump_at_one_place_beside_a_spring_is_no_wave(carriage):
    """A spring that hardens and a wave together are any shape."""
    found = diagnose(carriage, by_position(axis(3000), lambda q: 900 * q + 15 * np.exp(-(((q - 0.04) / 0.03) ** 2))))
    (unknown,) = found.findings
    assert (unknown.physics, unknown.location) == ("unknown", "carriage")
    assert "follows the joint's position" in unknown.statement


@pytest.mark.slow
def test_a_spring_that_hardens_is_told_with_how_much(carriage):
    found = diagnose(carriage, by_position(axis(3000), lambda q: 300 * q + 9000 * q**3))
    assert found.verdict == "explained"
    (spring,) = found.findings
    assert (spring.physics, spring.effect.place.aspect) == ("counterbalance", "effort of a spring that hardens")
    for name, value in (("stiffness", 300.0), ("hardening", 9000.0)):
        low, high = spring.parameters[name].interval
        assert 0.99 * low < value < 1.01 * high
        assert high - low < 0.1 * value


@pytest.mark.slow
def test_waves_that_together_are_any_shape_are_none(carriage):
    found = diagnose(carriage, by_position(axis(3000), lambda q: 30 * np.exp(-(((q - 0.05) / 0.03) ** 2)) + 200 * q))
    assert found.verdict == "unexplained"
    assert "cogging" not in {finding.physics for finding in found.findings}


PENDULUM = """<robot name="pendulum"><link name="base"/>{links}<joint name="flange" type="fixed">
<parent link="link_2"/><child link="tool"/><origin xyz="0.4 0 0"/></joint><link name="tool"/></robot>"""
LINK = """<joint name="joint_{i}" type="revolute"><parent link="{parent}"/><child link="link_{i}"/>
<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="99" velocity="9"/></joint>
<link name="link_{i}"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.04"/></inertial>
</link>"""


@pytest.mark.slow
@pytest.mark.parametrize("body", [True, False])
def test_masses_that_no_body_has_are_not_named(tmp_path, body):
    """Two links move as if the outer one carried a kilogram half a metre out; or the moment of that, and no inertia."""
    links = [LINK.format(i=i, parent=parent, x=x) for i, parent, x in ((1, "base", 0), (2, "link_1", 0.4))]
    (tmp_path / "pendulum.urdf").write_text(PENDULUM.format(links="".join(links)))
    robot, rng = load(tmp_path / "pendulum.urdf", tool="tool"), np.random.default_rng(3)
    time = np.arange(2500) * 0.01
    q = np.column_stack([0.8 * np.sin(1.7 * time) + 0.4 * np.sin(4.1 * time), 0.9 * np.sin(2.3 * time + 1)])
    names = ("joint_1", "joint_2")
    positions, nothing = dict(zip(names, q.T, strict=True)), dict.fromkeys(names, np.zeros(len(q)))
    within = Tolerances(mass=0.05, inertia=0.05) if body else Tolerances()
    recording = Recording(time=time, positions=positions, efforts=nothing, tolerances=within)
    change = dict(zip(INERTIAL, [1, 0.5, 0, 0.4, 0.16, 0, 0.41, -0.2, 0, 0.25], strict=True))
    if not body:
        change = dict.fromkeys(INERTIAL, 0.0) | {"mx": 3.0, "mz": 3.0}
    law = InertialParameters()
    true = simulate(robot, recording, (Effect(law, Place("link_2", law.variant), change),)).efforts
    noisy = {name: np.nan_to_num(values) + 0.05 * rng.normal(size=len(q)) for name, values in true.items()}
    found = diagnose(robot, recording.with_measurements(efforts=noisy))
    if body:
        assert found.verdict == "explained"
        (finding,) = found.findings
        assert finding.physics == "payload"
    else:
        assert named(found) == {("unknown", "joint_2")}
        assert found.findings[0].candidates == ("joint_2", "link_2")
        assert found.efforts.shares["all"]["heldout"] < 0.1
        # nor does the corrected model hold one
        for parameters in changed_bodies(robot, found.effects):
            assert np.linalg.eigvalsh(pseudo_inertia(parameters)).min() > 0


def test_a_body_has_a_moment_of_inertia_about_every_axis_that_its_mass_is_off():
    robot = load("ur5")
    drawn = robot.mechanism.model.inertias[robot.mechanism.frame("forearm_link").joint].toDynamicParameters()
    mass = sum(float(inertia.mass) for inertia in robot.mechanism.model.inertias)
    whole = np.array([mass, 0.0, 2.0, 0.0, 4.0 / mass + 1e-9, 0, 1.0, 0, 0, 4.0 / mass + 1.0])
    short = whole * np.where(np.arange(10) == 4, 0.99, 1.0)
    exactly, nothing = np.zeros(10), np.zeros(10)
    assert not is_impossible("forearm_link", nothing, exactly, robot.mechanism)
    assert not is_impossible("forearm_link", whole - drawn, exactly, robot.mechanism)
    assert is_impossible("forearm_link", short - drawn, exactly, robot.mechanism)
    assert not is_impossible("forearm_link", short - drawn, 0.02 * whole, robot.mechanism)
    assert is_impossible("forearm_link", -1.01 * drawn, exactly, robot.mechanism)


@pytest.mark.slow
def test_a_spring_and_a_wave_of_which_little_is_seen_are_told_beside_each_other(carriage):
    found = diagnose(carriage, by_position(axis(3000, noise=2.0), lambda q: 12 * np.sin(2 * np.pi * q / 0.9 + 0.4)))
    (finding,) = found.findings
    assert finding.physics == "counterbalance"
    assert "cogging at carriage" in finding.alternatives


@pytest.mark.slow
def test_a_cable_that_drags_along_is_unknown_and_followed(carriage):
    """Two springs that slip, after 20 and 60 mm: no friction of the library turns round on so long a way."""

    def dragged(recording):
        q, out = np.asarray(recording.positions["carriage"]), 0.0
        for way, force in ((0.02, 20.0), (0.06, 30.0)):
            slip = np.zeros(len(q))
            for row in range(1, len(q)):
                slip[row] = np.clip(slip[row - 1] + (q[row] - q[row - 1]) / way, -1, 1)
            out = out + force * slip
        return recording.with_measurements(efforts={"carriage": recording.efforts["carriage"] + out})

    found = diagnose(carriage, dragged(axis(3000, noise=1.0)))
    assert found.verdict == "unexplained"
    unknown = next(finding for finding in found.findings if finding.physics == "unknown")
    assert unknown.location == "carriage"
    assert "its way since it turned round" in unknown.statement.replace("the joint's", "its")
    other = dragged(axis(2000, noise=1.0, seed=4))
    told = simulate(carriage, replace(other, efforts={"carriage": np.zeros(2000)}), found.effects).efforts["carriage"]
    plain = simulate(carriage, replace(other, efforts={"carriage": np.zeros(2000)})).efforts["carriage"]
    left, before = (np.nanstd(other.efforts["carriage"] - values) for values in (told, plain))
    assert left < 0.26 * before


def test_a_drag_that_no_law_has_is_unknown_and_named_nowhere(carriage):
    found = diagnose(carriage, axis(drag=2500.0))
    assert found.verdict == "unexplained"
    assert named(found) == {("unknown", "carriage")}
    curve = next(curve for curve in found.efforts.curves if curve.joint == "carriage")
    assert curve.y == pytest.approx(2500.0 * curve.x * np.abs(curve.x), abs=1.5)
    # what has no name is predicted all the same
    assert found.efforts.shares["carriage"]["heldout"] < 0.2 * found.efforts.shares["carriage"]["rigid"]
    again = axis(drag=2500.0, seed=6)
    left = again.efforts["carriage"] - simulate(carriage, again, found.effects).efforts["carriage"]
    assert np.std(left[100:-100]) < 1.3  # noise, and straight lines between the knots


@pytest.mark.parametrize(
    ("word", "name", "true"),
    [("backlash", "gap", 5e-4), pytest.param("coulomb_friction", "time", 8.0, marks=pytest.mark.slow)],
)
def test_a_gap_in_a_drive_and_a_gear_that_warms_up_are_named(carriage, word, name, true):
    recording = axis(limit=10.0)
    time, q = recording.time, recording.positions["carriage"]
    speed = np.gradient(q, time)
    middle, loose = q[0] - 2.5e-4, np.zeros(len(q))
    for row, here in enumerate(q):
        middle = float(np.clip(middle, here - 2.5e-4, here + 2.5e-4))
        loose[row] = abs(here - middle) < 0.249e-3
    lost = -loose * 95 * np.gradient(speed, time)
    cold = 10.0 * np.exp(-time / 8) * np.sign(speed)
    added = {"backlash": lost, "coulomb_friction": cold}[word]
    found = diagnose(carriage, recording.with_measurements(efforts={"carriage": recording.efforts["carriage"] + added}))
    assert found.verdict == "explained"
    assert {finding.physics for finding in found.findings} == {"coulomb_friction", word}
    (finding,) = (finding for finding in found.findings if finding.physics == word)
    assert finding.parameters[name].value == pytest.approx(true, rel=0.1)


@pytest.mark.slow
def test_grease_that_gets_thinner_is_no_dry_friction_that_warms_up(carriage):
    """It was told as such, with a dry friction of half its size beside a damping that stays."""
    recording = axis(limit=10.0)
    speed = np.gradient(recording.positions["carriage"], recording.time)
    thicker = 80.0 * np.exp(-recording.time / 8) * speed
    found = diagnose(
        carriage, recording.with_measurements(efforts={"carriage": recording.efforts["carriage"] + thicker})
    )
    assert found.verdict == "explained"
    values = {finding.physics: finding.parameters for finding in found.findings}
    assert set(values) == {"coulomb_friction", "viscous_friction"}
    assert values["coulomb_friction"]["limit"].value == pytest.approx(10.0, rel=0.05)
    assert values["viscous_friction"]["cold"].value == pytest.approx(80.0, rel=0.1)
    assert values["viscous_friction"]["time"].value == pytest.approx(8.0, rel=0.15)


@pytest.mark.parametrize("word", ["effort_gain", pytest.param("viscous_friction", marks=pytest.mark.slow)])
def test_what_follows_the_temperature_is_told_by_it(carriage, word):
    """Before, a torque constant that falls as motors get warm was a payload, a rotor and an offset."""
    recording = axis(limit=10.0, damping=60.0)
    temperature = 25 + 40 * (1 - np.exp(-recording.time / 9)) + 4 * np.sin(recording.time / 2.5)
    speed = np.gradient(recording.positions["carriage"], recording.time)
    drawn = recording.efforts["carriage"]
    efforts, name, true = {
        "effort_gain": (drawn * (1 + 2e-3 * (temperature - temperature[0])), "per_kelvin", 2e-3),
        "viscous_friction": (drawn + 400 * np.exp((temperature[0] - temperature) / 15) * speed, "kelvin", 15.0),
    }[word]
    found = diagnose(carriage, replace(recording, efforts={"carriage": efforts}, temperature=temperature))
    assert found.verdict == "explained"
    assert {finding.physics for finding in found.findings} == {"coulomb_friction", "viscous_friction", word}
    finding = next(item for item in found.findings if name in item.parameters)
    assert finding.physics == word
    assert finding.parameters[name].value == pytest.approx(true, rel=0.1)


@pytest.mark.slow
def test_cogging_is_where_the_joint_is_and_not_where_a_late_encoder_has_it(carriage):
    """The cogging acts before the delay, whichever came in first: beside it the delay was not found."""
    recording, late = axis(limit=10.0, noise=0.1), 20e-3
    time, q = recording.time, recording.positions["carriage"]
    cogging = 4.0 * np.sin(2 * np.pi * q / 0.1)
    reported = np.interp(time - late, time, q)
    efforts = {"carriage": recording.efforts["carriage"] + cogging}
    found = diagnose(carriage, replace(recording, positions={"carriage": reported}, efforts=efforts))
    assert found.verdict == "explained"
    values = {finding.physics: finding.parameters for finding in found.findings}
    assert set(values) == {"coulomb_friction", "cogging", "encoder_delay"}
    assert values["encoder_delay"]["delay"].value == pytest.approx(late, rel=0.05)
    assert values["cogging"]["period"].value == pytest.approx(0.1, rel=1e-2)
    assert np.hypot(values["cogging"]["sine"].value, values["cogging"]["cosine"].value) == pytest.approx(4.0, rel=0.05)


def test_a_rail_that_pinches_in_places_is_no_coulomb_friction(carriage):
    found = diagnose(carriage, axis(pinch=5.0))
    assert found.verdict == "unexplained"
    assert named(found) == {("unknown", "carriage")}
    assert "friction that follows the joint's position" in found.findings[0].statement
    assert found.findings[0].heldout_gain > 0.5


@pytest.mark.parametrize("force", [3.0, pytest.param(8.0, marks=pytest.mark.slow)])
def test_friction_that_comes_and_goes_is_no_noise_where_none_was_declared(carriage, force):
    """Its mean is nothing, and no curve follows it: only that it keeps to the motion tells it from noise."""
    recording = axis(3000)
    speed = np.gradient(recording.positions["carriage"], recording.time)
    comes = force * np.sign(speed) * (2 * (np.floor(recording.time / 2.2) % 2) - 1)
    efforts = {"carriage": recording.efforts["carriage"] + comes}
    found = diagnose(carriage, recording.with_measurements(efforts=efforts))
    assert found.verdict == "unexplained"
    (finding,) = found.findings
    assert (finding.physics, finding.location) == ("unknown", "carriage")
    assert "follows its direction by an amount that changes with time" in finding.statement
    # the same efforts at other times follow nothing, and are too much to be noise that nobody declared
    late = {"carriage": recording.efforts["carriage"] + np.roll(comes, 1000)}
    found = diagnose(carriage, recording.with_measurements(efforts=late))
    assert [(item.physics, item.location) for item in found.findings] == [("unknown", "carriage")]
    assert "follows" not in found.findings[0].statement
    assert "no noise was declared that could account for it" in found.findings[0].statement


@pytest.mark.slow
def test_a_late_encoder_is_told_where_its_joint_rubs_hard(carriage):
    """Friction turns round before the encoder says so: without that, a rotor's inertia would stand for the delay."""
    whole, late = axis(3000, limit=60.0, damping=400.0), 2
    recording = Recording(
        time=whole.time[:-late],
        positions={"carriage": np.asarray(whole.positions["carriage"])[:-late]},
        efforts={"carriage": np.asarray(whole.efforts["carriage"])[late:]},
    )
    found = diagnose(carriage, recording)
    assert found.verdict == "explained"
    words = ("coulomb_friction", "viscous_friction", "encoder_delay")
    assert named(found) == {(word, "carriage") for word in words}
    delay = next(finding for finding in found.findings if finding.physics == "encoder_delay").parameters["delay"]
    assert delay.value == pytest.approx(late * 0.004, abs=1.5e-3)
    assert found.efforts.shares["carriage"]["heldout"] < 0.015


@pytest.mark.slow
def test_the_same_recording_gives_the_same_verdict_whatever_was_asked_before(carriage):
    first = diagnose(carriage, axis(limit=20.0))
    diagnose(carriage, axis(drag=2500.0, seed=5))
    again = diagnose(load(AXIS), axis(limit=20.0))
    assert [finding.parameters for finding in first.findings] == [finding.parameters for finding in again.findings]
    assert first.after == again.after


def test_speeds_in_degrees_are_told_with_the_number_that_gave_them_away(tmp_path):
    recording, _ = device(tmp_path, 104, "ur5", [])
    wrong = {name: np.degrees(values) for name, values in recording.velocities.items()}
    if not wrong:
        wrong = {n: np.degrees(np.gradient(q, recording.time)) for n, q in recording.positions.items()}
    with pytest.raises(InputError, match=r"qd\.shoulder_pan_joint.*57\.\d+ times.*degrees"):
        diagnose(load("ur5"), replace(recording, velocities=wrong))


@pytest.mark.parametrize(
    ("robot", "seed", "physics"),
    [("ur5", 3, "coulomb_friction"), ("five_bar", 4, "rotor_inertia"), ("xarm7", 5, "payload")],
)
@pytest.mark.slow
def test_a_concealed_robot_is_told_its_place_and_physics(tmp_path, robot, seed, physics):
    recording, heldout = device(tmp_path, seed, robot, [physics])
    truth = json.loads((tmp_path / "it.truth.json").read_text())["effects"][0]
    loaded = load(ROBOTS / "weighty_five_bar" / "weighty_five_bar.urdf" if robot == "five_bar" else robot)
    found = diagnose(loaded, recording)
    assert any(f.physics == physics and set(f.candidates) & set(truth["places"]) for f in found.findings)
    predicted = simulate(loaded, heldout, CorrectedModel("it", found.effects).effects)
    for name, values in heldout.efforts.items():
        left = np.nanstd(values - predicted.efforts[name])
        assert left < 2.0 * recording.noise.effort, name


@needs_emps
def test_the_ball_screw_axis_is_friction_and_no_other_mass(carriage):
    found = diagnose(carriage, read_recording(EMPS))
    words = {finding.physics for finding in found.findings}
    assert {"viscous_friction", "coulomb_friction"} <= words
    assert not words & {"inertial_parameters", "payload", "rotor_inertia", "unknown"}
    share = found.efforts.shares["carriage"]
    assert share["rigid"] > 0.6
    assert share["heldout"] < 0.054


def test_a_recording_is_checked_before_it_is_diagnosed(carriage):
    found = prospects(carriage, axis())
    (joint,) = found.joints
    assert (joint.joint, joint.unit) == ("carriage", "m")
    assert 0.2 < joint.travel < 0.35
    assert joint.speed == pytest.approx(0.255, rel=0.05)
    assert ("rotor_inertia at carriage", "inertial_parameters at table") in found.alike


def test_a_drive_that_saturates_is_told_before(carriage):
    recording = axis()
    cut = np.clip(recording.efforts["carriage"], -25.0, 25.0)
    found = prospects(carriage, recording.with_measurements(efforts={"carriage": cut}))
    assert any("tau.carriage is at 25" in text and "saturates" in text for text in found.remarks)


@pytest.mark.parametrize("share", [pytest.param(0.9, marks=pytest.mark.slow), 0.7])
def test_what_a_drive_at_its_limit_could_not_give_is_no_physics(carriage, share):
    recording = axis(damping=300.0, limit=20.0)
    efforts = recording.efforts["carriage"]
    most = share * np.abs(efforts).max()
    found = diagnose(carriage, recording.with_measurements(efforts={"carriage": np.clip(efforts, -most, most)}))
    assert named(found) == {("viscous_friction", "carriage"), ("coulomb_friction", "carriage")}
    assert found.verdict == "explained"
    damping = next(finding for finding in found.findings if finding.physics == "viscous_friction").parameters["damping"]
    assert damping.value == pytest.approx(300, rel=0.01)
    assert any("the drive saturates" in text and "were left out" in text for text in found.remarks)
    assert not any("stands still in" in text for text in found.remarks)


def swung(seconds=12):
    """Return the recording of a ur5 that swings, with viscous friction at the shoulder."""
    robot = load("ur5")
    names, model = robot.mechanism.actuated, robot.model
    time = np.arange(0, seconds, 0.01)
    rates = 2 * np.pi * np.linspace(0.1, 0.3, 6)
    q = 0.8 * np.sin(np.outer(time, rates))
    v, a = 0.8 * rates * np.cos(np.outer(time, rates)), -0.8 * rates**2 * np.sin(np.outer(time, rates))
    data = model.createData()
    tau = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    tau[:, 1] += 6.0 * v[:, 1]
    tau += 0.1 * np.random.default_rng(1).normal(size=tau.shape)
    efforts = dict(zip(names, tau.T, strict=True))
    return Recording(time=time, positions=dict(zip(names, q.T, strict=True)), efforts=efforts)


@pytest.mark.slow
def test_a_drive_without_a_column_of_efforts_is_left_out():
    """Its friction reaches no effort that was recorded: columns of nothing must not enter a fit."""
    robot, whole = load("ur5"), as_written(swung(), "q tau")
    recording = replace(whole, efforts={k: v for k, v in whole.efforts.items() if k != "elbow_joint"})
    found = diagnose(robot, recording)
    assert named(found) == {("viscous_friction", "shoulder_lift_joint")}
    blind = replace(recording, positions={k: v for k, v in recording.positions.items() if k != "wrist_1_joint"})
    for asked in (diagnose, prospects):
        with pytest.raises(InputError, match=r"tau.wrist_1_joint was recorded, but no q.wrist_1_joint"):
            asked(robot, blind)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [0.0, pytest.param(1.7, marks=pytest.mark.slow)])
@pytest.mark.usefixtures("without_pictures")
def test_an_effort_that_was_never_logged_is_told_first_and_left_out(value):
    robot, whole = load("ur5"), as_written(swung(), "q tau")
    recording = replace(whole, efforts=whole.efforts | {"wrist_2_joint": np.full(len(whole), value)})
    found = diagnose(robot, recording)
    assert named(found) == {("viscous_friction", "shoulder_lift_joint")}
    assert found.premises[0].startswith(f"tau.wrist_2_joint stays at {value:g} in every row, while joints move")
    assert "wrist_2_joint" not in found.efforts.joints
    assert "tau.wrist_2_joint" in found.unused_columns
    assert diagnosis_text(found).startswith("tau.wrist_2_joint")
    assert " nan " not in diagnosis_html(found, robot, recording).lower()
    assert prospects(robot, recording).premises == found.premises


def test_one_row_of_efforts_is_refused_in_words():
    with pytest.raises(InputError, match=r"one row of efforts tells nothing"):
        diagnose(load("ur5"), swung().select(np.arange(1)))


@pytest.mark.slow
def test_an_effort_that_stays_at_nothing_but_for_blips_was_not_measured():
    """So do the wrists of a real robot whose drivers log their current only while it is large."""
    robot, whole = load("ur5"), as_written(swung(), "q tau")
    blips = np.zeros(len(whole))
    blips[::9] = np.round(np.random.default_rng(3).normal(0.0, 0.02, len(blips[::9])), 3)
    found = diagnose(robot, replace(whole, efforts=whole.efforts | {"wrist_2_joint": blips}))
    assert named(found) == {("viscous_friction", "shoulder_lift_joint")}
    assert found.premises[0].startswith("tau.wrist_2_joint stays at 0 in 8")
    rounded = np.round(whole.efforts["wrist_2_joint"] / 0.5) * 0.5  # mostly nothing, and still an effort
    found = diagnose(robot, replace(whole, efforts=whole.efforts | {"wrist_2_joint": rounded}))
    assert not found.premises
    assert "wrist_2_joint" in found.efforts.joints


def bumped(robot_log, joint, force=5.0, at=0.7, width=0.03):
    """Return a recording with an effort more wherever a joint passes one place."""
    q = robot_log.positions[joint]
    more = force * np.exp(-0.5 * ((q - np.quantile(q, at)) / width) ** 2)
    return replace(robot_log, efforts=robot_log.efforts | {joint: robot_log.efforts[joint] + more})


@pytest.mark.slow
def test_what_pinches_at_one_place_of_one_joint_is_not_explained():
    """Its joint is left at a few times its noise, with little of its effort, and all joints at hardly more than one."""
    robot, whole = load("ur5"), as_written(swung(30), "q tau")
    found = diagnose(robot, bumped(whole, "elbow_joint"))
    assert found.verdict == "unexplained"
    assert named(found) == {("viscous_friction", "shoulder_lift_joint"), ("unknown", "elbow_joint")}
    (unknown,) = (finding for finding in found.findings if finding.physics == "unknown")
    assert "comes back wherever it passes" in unknown.statement
    where = float(unknown.advice.partition("stands at ")[2].split()[0])
    unit = unknown.advice.partition("stands at ")[2].split()[1].rstrip(",")
    assert where * {"rad": 1.0, "mrad": 1e-3}[unit] == pytest.approx(
        np.quantile(whole.positions["elbow_joint"], 0.7), abs=0.03
    )
    assert found.efforts.shares["elbow_joint"]["heldout"] < 0.1


def test_one_joint_many_times_above_the_declared_noise_is_not_hidden_by_its_sisters():
    joints = {f"joint{k}": {"before": 9.0, "after": 3.2 if k == 3 else 0.7} for k in range(7)}
    after = float(np.sqrt(np.mean([sizes["after"] ** 2 for sizes in joints.values()])))
    left = EffortResiduals(*4 * (np.zeros((0, 7)),), {}, {"fit": after}, joints, {})
    assert after < 1.5
    (finding,) = _beyond_declared(left)
    assert finding.location == "joint3"
    assert not list(_beyond_declared(left._replace(by_joint={k: {"after": 0.9} for k in joints}, after={"fit": 0.9})))
    two = {name: {"after": {"joint1": 2.6, "joint4": 1.6}.get(name, 0.9)} for name in joints}
    assert [item.location for item in _beyond_declared(left._replace(by_joint=two))] == ["joint1", "joint4"]


def test_ten_samples_are_too_little_to_compare_and_no_law_is_blamed():
    robot, whole = load("ur5"), swung(20)
    found = diagnose(robot, whole.select(np.arange(0, 2000, 200)))
    assert found.verdict == "unexplained"
    assert verdict_text(found).startswith("There is too little to compare: 10 samples")
    assert "no law" not in summary_text(found).lower()
    assert found.findings[0].remedy.startswith("record at least")
    with pytest.raises(InputError, match=r"10 rows in 0.09 s, lasts long enough"):
        diagnose(robot, whole.select(np.arange(10)))


@pytest.mark.slow
def test_a_drift_and_a_drive_at_its_limit_are_told_where_something_is_unknown():
    robot, whole, joint = load("ur5"), as_written(swung(20), "q tau"), "elbow_joint"
    drifting = np.asarray(whole.efforts[joint]) + np.linspace(0, 8, len(whole))
    found = diagnose(robot, replace(whole, efforts=whole.efforts | {joint: drifting}))
    (unknown,) = (finding for finding in found.findings if finding.physics == "unknown")
    assert "most of it is a drift, 7.9" in unknown.statement
    assert unknown.remedy.startswith("find what changes slowly at elbow_joint")
    tau = bumped(whole, joint, 12.0, width=0.05).efforts[joint]
    most = 0.6 * np.abs(whole.efforts[joint]).max()
    found = diagnose(robot, replace(whole, efforts=whole.efforts | {joint: np.clip(tau, -most, most)}))
    (unknown,) = (finding for finding in found.findings if finding.physics == "unknown")
    assert "the effort is clipped where the drive is at its limit" in unknown.statement


@pytest.mark.slow
def test_a_way_below_what_the_encoder_shows_is_no_number(carriage):
    found = diagnose(carriage, axis(4000, limit=20.0))
    (finding,) = found.findings
    way = finding.parameters["presliding"]
    assert way.seen == pytest.approx(1e-7, rel=0.6)
    (words,) = (row for row in parameter_texts({"presliding": replace(way, value=2e-8, interval=(0.0, 5e-8))}))
    seen = quantity(way.seen, "m")
    assert words == ("presliding", f"below {seen}", f"0 to {seen}; the encoder shows no less than {seen}")
    ((_, bound, _),) = parameter_texts({"presliding": replace(way, value=2e-8, interval=(0.0, 1.5 * way.seen))})
    assert bound == f"below {quantity(1.5 * way.seen, 'm')}"
    assert "encoder" not in parameter_texts({"presliding": replace(way, value=3e-6, interval=(1e-6, 5e-6))})[0][2]


def test_what_leaving_a_law_out_costs_is_told_as_the_table_tells_what_is_left(carriage):
    """No law saves more than the robot file leaves; whitened squares said so."""
    found = diagnose(carriage, axis(4000, limit=20.0, damping=300.0, noise=0.2))
    share = found.efforts.shares["carriage"]
    friction = [finding for finding in found.findings if "friction" in finding.physics]
    assert len(friction) == 2
    assert all(1 < finding.cost < share["rigid"] / share["heldout"] for finding in friction)
    assert all("the residual of carriage would be" in cost_text(finding, ["carriage"]) for finding in friction)
    assert not any("carriage" in cost_text(finding, ["base"]) for finding in friction)
