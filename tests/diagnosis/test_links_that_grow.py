"""A gantry whose links grow as they warm up, by a simulator of its own in plain numpy."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from prup_pin.diagnosis import diagnose
from prup_pin.laws import Inputs
from prup_pin.simulation import Simulator, effect_named

from .test_guides_and_cross_talk import HIGH, JOINTS, LOW, Gantry, held, named, robot

__all__ = ["robot"]
#: The link that each joint carries, and the joint beyond it.
BEYOND = {"X_part": "Y", "Y_part": "Z", "Z_part": "C"}


@dataclass
class Warm(Gantry):
    """Links that grow, by name [1/K], at one temperature above 20 deg C [K]."""

    expansion: dict = field(default_factory=dict)
    warming: float = 0.0

    def __post_init__(self) -> None:
        for link, each in self.expansion.items():
            place = np.array(JOINTS[BEYOND[link]][1])
            self.moved[BEYOND[link]] = self.moved.get(BEYOND[link], np.zeros(3)) + each * self.warming * place


def course(seed: int, count: int) -> np.ndarray:
    """Return temperatures (count,) [deg C] of a machine that warms up, and of a hall whose doors are opened."""
    draw = np.random.default_rng(seed)
    way = np.arange(count) / count
    return 20 + 14 * (1 - np.exp(-3 * way)) + 1.5 * np.sin(draw.uniform(8, 20) * way)


def recorded(seed: int, **machine):
    """Return a recording of a machine that warms up; poses and noise of a seed are the same at all temperatures."""
    recording, _, _ = Gantry(**{key: value for key, value in machine.items() if key != "expansion"}).recording(seed)
    warm = course(seed, len(recording))
    position, turn = np.array(recording.position), Rotation.from_rotvec(np.array(recording.rotation))
    q = np.column_stack([recording.positions[name] for name in "XYZC"])
    for row, temperature in enumerate(warm):
        cold, there = (
            Warm(**{**machine, "moved": dict(machine.get("moved", {}))}, warming=degrees).placed(q[row])
            for degrees in (0.0, temperature - 20)
        )
        position[row] += there[0] - cold[0]
    return replace(recording, position=position, rotation=turn.as_rotvec(), temperature=warm)


@pytest.mark.parametrize("link", BEYOND)
def test_a_link_grows_as_the_machine_built_anew_does(robot, link):
    draw = np.random.default_rng(4)
    q, warm = draw.uniform(LOW, HIGH, (12, 4)), draw.uniform(15, 40, 12)
    wrench = draw.uniform(-1, 1, (12, 6)) * ([300.0] * 3 + [30.0] * 3)
    effect = effect_named("thermal_growth", link, "link", {"expansion": 5e-5}, robot.mechanism)
    inputs = Inputs(np.arange(12.0), q, wrench, np.arange(12), temperature=warm)
    for effects, least, most in (([effect], 0.0, 2e-7), ([], 2e-5, np.inf)):
        run = Simulator(robot, inputs).run(effects)
        places = [
            Warm(expansion={link: 5e-5}, warming=degrees - 20).loaded(*each)
            for degrees, *each in zip(warm, q, wrench, strict=True)
        ]
        assert least <= np.abs(run.position - [point for point, _ in places]).max() < most


@pytest.mark.slow
def test_a_link_that_grows_is_named_and_measured(robot):
    found = diagnose(robot, recorded(11, expansion={"Y_part": 2.4e-5}))
    assert found.verdict == "explained"
    assert named(found) == {("thermal_growth", "Y_part (link)")}
    assert found.noise.source == "declared"
    assert found.after["heldout"] < 1.1
    held(found, expansion=2.4e-5)


@pytest.mark.slow
def test_without_a_column_temperature_no_link_is_said_to_grow(robot):
    found = diagnose(robot, replace(recorded(11, expansion={"Y_part": 2.4e-5}), temperature=None))
    assert "thermal_growth" not in {item.physics for item in found.findings}
    assert not (found.verdict == "nothing_missing" and not found.premises)


@pytest.mark.slow
@pytest.mark.parametrize("fault", [pytest.param({}, marks=pytest.mark.slow), {"stiffer": {"C": 0.8}}])
def test_a_machine_that_warms_up_without_growing_has_no_such_link(robot, fault):
    found = diagnose(robot, recorded(12, **fault))
    assert "thermal_growth" not in {item.physics for item in found.findings}
    assert found.after["heldout"] < 1.1
