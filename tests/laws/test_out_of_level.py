"""A base that is tilted: gravity pulls another way on links and on what the tool holds, and poses alone tell it."""

import re
from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.candidates import candidates
from prup_pin.diagnosis.influence import Influence
from prup_pin.laws import Inputs
from prup_pin.laws.out_of_level import OutOfLevel
from prup_pin.mechanism import Changes
from prup_pin.recordings import Noise, Recording, add_noise
from prup_pin.simulation import Simulator, effect_named
from prup_pin.spatial import rotation_exp
from prup_pin.testing.poses import change

from ..as_written import as_written
from .bench import ROBOTS, inputs, robot

TURN = {"rx": 0.03, "ry": -0.02}
ARM = ROBOTS / "elastic_arm/elastic_arm.urdf"
NOISE = Noise(position=2e-5, rotation=5e-5)


def effects(name, *words):
    mechanism = robot(name).mechanism
    known = {
        "weight": ("self_weight", "robot", "", {"scale": 1.0}),
        "tilt": ("geometric_offset", "base", "level", TURN),
        "payload": ("payload", mechanism.tool_part, "", {"mass": 2.0}),
        "rubber": ("base_compliance", "base", "", {"translation": 1e-8, "rotation": 1e-6}),
    }
    return [effect_named(*known[word], mechanism) for word in words]


def falling(gravity, folder):
    """The elastic arm with another gravity in its file."""
    words = " ".join(repr(float(value)) for value in gravity)
    text = re.sub(r'<gravity xyz="[^"]*"/>', f'<gravity xyz="{words}"/>', ARM.read_text(encoding="utf-8"))
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return prup_pin.load(path)


def test_a_tilted_base_is_a_robot_file_with_gravity_turned_the_other_way(tmp_path):
    level = prup_pin.load(ARM)
    tilted = falling(rotation_exp(-np.array([0.03, -0.02, 0.0])) @ level.mechanism.gravity, tmp_path)
    home = np.array(list(level.home.actuators.values()))
    samples = Inputs(np.arange(2.0), np.array([home + 0.2, home - 0.3]), np.zeros((2, 6)), np.arange(2))
    poses = []
    for arm, turned in ((level, [("geometric_offset", "base", "level", TURN)]), (tilted, [])):
        part = arm.mechanism.tool_part
        words = [("self_weight", "robot", "", {"scale": 1.0}), ("payload", part, "", {"mass": 2.0}), *turned]
        poses.append(Simulator(arm, samples).run([effect_named(*each, arm.mechanism) for each in words]))
    assert np.abs(change(*poses)).max() < 1e-9


def test_what_the_tool_holds_falls_the_same_way_in_whatever_order_laws_are_given():
    simulator = Simulator(robot("ur5"), inputs("ur5"))
    words = ("weight", "payload", "rubber", "tilt")
    one, other = (simulator.run(effects("ur5", *order)) for order in (words, words[::-1]))
    assert np.abs(change(one, other)).max() < 1e-10
    assert np.abs(change(one, simulator.run(effects("ur5", *words[:3])))).max() > 1e-5


@pytest.mark.parametrize("name", ["ur5", "3prup", "six_ups"])
def test_first_order_of_a_tilt_is_the_simulations_slope(name):
    simulator = Simulator(robot(name), inputs(name))
    run = simulator.run(effects(name, "weight", "payload", "rubber"))
    small = effect_named("geometric_offset", "base", "level", {"rx": 1e-5, "ry": -2e-5}, robot(name).mechanism)
    after = [*effects(name, "weight", "payload", "rubber"), small]
    expected = change(simulator.run(after, run), run)
    found = Influence(simulator, run).change(simulator.setup(after))
    for columns in (slice(0, 3), slice(3, 6)):
        size = np.abs(expected[:, columns]).max()
        assert np.abs(found - expected)[:, columns].max() < 5e-3 * size + 1e-11


def test_it_acts_on_weight_alone_and_not_where_gravity_was_recorded():
    alone = Simulator(robot("ur5"), inputs("ur5"))
    assert np.abs(change(alone.run(effects("ur5", "tilt")), alone.run())).max() == 0
    told = inputs("ur5")
    told = replace(told, gravity=np.tile(robot("ur5").mechanism.gravity, (len(told), 1)))
    recorded = Simulator(robot("ur5"), told)
    one, other = (recorded.run(effects("ur5", *words)) for words in (("weight", "tilt"), ("weight",)))
    assert np.abs(change(one, other)).max() == 0
    of_level = [
        [each for each in candidates(robot("ur5").mechanism, given) if isinstance(each.law, OutOfLevel)]
        for given in (inputs("ur5"), told)
    ]
    assert [len(found) for found in of_level] == [1, 0]


def test_a_robot_without_gravity_has_no_level(tmp_path):
    assert not OutOfLevel().places(falling(np.zeros(3), tmp_path).mechanism)


def test_a_robot_file_can_hold_it():
    mechanism = robot("ur5").mechanism
    (tilt,) = effects("ur5", "tilt")
    changes = Changes(mechanism)
    setup = Simulator(robot("ur5"), inputs("ur5")).setup()
    assert not tilt.law.written(tilt.place, tilt.values, setup, changes)
    np.testing.assert_allclose(np.linalg.norm(changes.fall), np.linalg.norm(mechanism.gravity), rtol=1e-12)
    np.testing.assert_allclose(changes.fall[:2] / 9.81, [-0.02, -0.03], rtol=1e-2)


@pytest.mark.parametrize(
    ("degrees", "mass"),
    [
        (2.0, 0.0),
        pytest.param(2.0, 3.0, marks=pytest.mark.slow),
        pytest.param(0.0, 3.0, marks=pytest.mark.slow),
        (25.0, 0.0),
    ],
)
def test_a_tilted_base_is_told_from_what_the_tool_holds(degrees, mass):
    """Of an arm with springs at its joints: the tilt, the mass, both, and nothing else."""
    arm = prup_pin.load("ur10", joint_stiffness=2e4)
    generator = np.random.default_rng(5)
    positions = np.repeat(generator.uniform(-2, 2, (14, 6)), 3, axis=0)
    wrench = (
        generator.normal(0, [60, 60, 60, 8, 8, 8], (len(positions), 6)) * (np.arange(len(positions)) % 3 > 0)[:, None]
    )
    columns = dict(zip(arm.mechanism.actuated, positions.T, strict=True))
    asked = Recording(np.arange(float(len(positions))), positions=columns, wrench=wrench, noise=NOISE)
    words = [("self_weight", "robot", "", {"scale": 1.0})]
    words += [("geometric_offset", "base", "level", {"rx": np.radians(degrees), "ry": 0.0})] if degrees else []
    words += [("payload", "tool0", "", {"mass": mass})] if mass else []
    seen = prup_pin.simulate(arm, asked, [effect_named(*each, arm.mechanism) for each in words])
    measured = add_noise(asked.with_measurements(position=seen.position, rotation=seen.rotation), NOISE, 5)
    found = diagnose(arm, as_written(measured))
    laws = {law.physics: law for law in found.findings if law.physics not in ("self_weight", "finite_deflection")}
    assert found.verdict == "explained"
    assert set(laws) == ({"geometric_offset"} if degrees else set()) | ({"payload"} if mass else set())
    if degrees:
        assert laws["geometric_offset"].location == "base"
        np.testing.assert_allclose(laws["geometric_offset"].parameters["rx"].value, np.radians(degrees), atol=2e-3)
    if mass:
        np.testing.assert_allclose(laws["payload"].parameters["mass"].value, mass, rtol=0.02)
