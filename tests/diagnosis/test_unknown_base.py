"""Where is what no law explains? At the base where it tilts, at a joint where that turns."""

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.diagnosis.influence import Influence
from prup_pin.recordings import Noise, Recording, add_noise
from prup_pin.simulation import Simulator, effect_named
from prup_pin.spatial import rotation_exp, rotation_log

from ..as_written import as_written
from ..laws.bench import inputs, robot

NOISE = Noise(position=2e-5, rotation=5e-5)


def test_a_motion_of_the_base_moves_what_is_measured_as_a_base_that_yields():
    simulator = Simulator(robot("ur5"), inputs("ur5"))
    influence = Influence(simulator, simulator.run())
    soft = {f"{kind}_{axis}": 0.0 for kind in ("translation", "rotation") for axis in "xyz"} | {"settled": 0.0}
    effect = effect_named("base_compliance", "base", "by axis", {**soft, "rotation_y": 1e-7}, robot("ur5").mechanism)
    yielding = influence.change(simulator.setup([effect]))
    turns = yielding[:, 4]
    np.testing.assert_allclose(yielding, influence.by_base[:, :, 4] * turns[:, None], atol=1e-12)


@pytest.mark.parametrize("where", ["base", pytest.param("shoulder_lift_joint", marks=pytest.mark.slow)])
def test_what_lifts_to_one_side_is_told_where_it_does(where):
    arm = prup_pin.load("ur10", joint_stiffness=2e4)
    generator = np.random.default_rng(6)
    positions = np.repeat(generator.uniform(-2, 2, (24, 6)), 4, axis=0)
    loaded = (np.arange(len(positions)) % 4 > 0)[:, None]
    wrench = generator.normal(0, [60, 60, 60, 8, 8, 8], (len(positions), 6)) * loaded
    names = arm.mechanism.actuated
    weight = [effect_named("self_weight", "robot", "", {"scale": 1.0}, arm.mechanism)]

    def seen(actuators):
        columns = dict(zip(names, actuators.T, strict=True))
        asked = Recording(np.arange(float(len(positions))), positions=columns, wrench=wrench, noise=NOISE)
        return asked, prup_pin.simulate(arm, asked, weight)

    asked, level = seen(positions)
    moment = np.cross(level.position, wrench[:, :3])[:, 1] + wrench[:, 4]
    lifted = 2e-5 * np.maximum(moment - 20.0, 0.0)
    position, rotation = level.position, level.rotation
    if where == "base":
        turn = rotation_exp(np.outer(lifted, [0.0, 1.0, 0.0]))
        position, rotation = (turn @ position[..., None])[..., 0], rotation_log(turn @ rotation_exp(rotation))
    else:
        turned = positions.copy()
        turned[:, 1] += lifted
        position, rotation = (getattr(seen(turned)[1], name) for name in ("position", "rotation"))
    moved = as_written(asked.with_measurements(position=position, rotation=rotation), "q p r wrench")
    found = diagnose(arm, add_noise(moved, NOISE, 6))
    assert found.verdict == "unexplained"
    (unknown,) = (finding for finding in found.findings if finding.physics == "unknown")
    assert unknown.location == where
