"""Equilibria that are looked for near others: what nears its own slowly and surely is not given up."""

import numpy as np
import pytest

from prup_pin import build
from prup_pin.errors import PrupPinError
from prup_pin.laws.inputs import Inputs
from prup_pin.simulation import Simulator, effect_named

#: Full cycles of a load.
CYCLE = np.array([0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0])


@pytest.mark.parametrize(("stiffness", "force", "seed", "offset"), [(1e4, 150.0, 5, 1e-3), (5e3, 300.0, 0, 2e-2)])
def test_a_derivative_that_samples_share_leads_all_of_them_to_their_equilibria(stiffness, force, seed, offset):
    """Bent far beside a planar robot's plane, some take more than a dozen steps, each a fifth of the one before."""
    robot = build.three_rrr(
        base_radius=0.35, platform_radius=0.1, arm=0.2, rod=0.25, motor_stiffness=stiffness, arm_diameter=0.03,
        rod_diameter=0.02, platform_mass=3.0,
    )  # fmt: skip
    rng, actuated = np.random.default_rng(seed), robot.mechanism.actuated
    home = np.array([robot.home.joints[name] for name in actuated], float).ravel()
    poses: list[np.ndarray] = []
    while len(poses) < 6:
        there = home + rng.uniform(-0.25, 0.25, 3)
        try:
            robot.pose_from_actuators(dict(zip(actuated, there.tolist(), strict=True)))
        except PrupPinError:
            continue
        poses.append(there)
    loads = rng.normal(size=(6, 6)) * np.repeat([force, 0.08 * force], 3)
    wrench = (loads[:, None] * CYCLE[:, None]).reshape(-1, 6)
    simulator = Simulator(
        robot, Inputs(np.arange(54.0), np.repeat(poses, 9, axis=0), wrench, np.repeat(np.arange(6), 9))
    )
    shifted = [effect_named("encoder_offset", actuated[0], "", {"offset": offset}, robot.mechanism)]
    near, alone = simulator.run(shifted, simulator.run(()), near=True), simulator.run(shifted)
    assert near.solved.all()
    np.testing.assert_allclose(near.position, alone.position, atol=1e-11)
