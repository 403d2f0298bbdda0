"""A law under which equilibria are found slowly is fitted, and not given up as one at which no robot could be."""

from dataclasses import replace

import numpy as np

from prup_pin import build, load
from prup_pin.diagnosis.account import without_laws
from prup_pin.diagnosis.prepare import drawn_problem, silent
from prup_pin.errors import PrupPinError
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import effect_named, simulate

#: Full cycles of a load.
CYCLE = np.array([0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0])


def test_a_law_whose_samples_take_more_than_a_dozen_steps_to_their_equilibria_is_fitted(tmp_path):
    """Loads bend a planar robot far out of its plane; by the derivative that samples share each step is a fifth."""
    build.three_rrr(
        base_radius=0.35, platform_radius=0.1, arm=0.2, rod=0.25, motor_stiffness=1e4, arm_diameter=0.03,
        rod_diameter=0.02, platform_mass=3.0,
    ).save(tmp_path / "rrr.urdf")  # fmt: skip
    robot, rng = load(tmp_path / "rrr.urdf"), np.random.default_rng(5)
    actuated = robot.mechanism.actuated
    home = np.array([robot.home.joints[name] for name in actuated], float).ravel()
    poses: list[np.ndarray] = []
    while len(poses) < 6:
        there = home + rng.uniform(-0.25, 0.25, 3)
        try:
            robot.pose_from_actuators(dict(zip(actuated, there.tolist(), strict=True)))
        except PrupPinError:
            continue
        poses.append(there)
    loads = rng.normal(size=(6, 6)) * np.repeat([150.0, 12.0], 3)
    wrench = (loads[:, None] * CYCLE[:, None]).reshape(-1, 6)
    q = dict(zip(actuated, np.repeat(poses, 9, axis=0).T, strict=True))
    bench = Recording(np.arange(54.0), positions=q, wrench=wrench, noise=Noise(position=2e-6, rotation=1e-5))
    seen = simulate(robot, bench, [effect_named("encoder_offset", actuated[0], "", {"offset": 1e-3}, robot.mechanism)])
    log = replace(bench, position=seen.position + rng.normal(0, 2e-6, (54, 3)), rotation=seen.rotation)
    account = without_laws(drawn_problem(robot, [log], silent).prepared(), silent)
    named = {candidate.name: candidate for candidate in account.prepared.library}
    term = next(c for c in named.values() if c.law.physics == "encoder_offset" and c.place.name == actuated[0])
    fit = account.problem.refine([term.term(np.array([1e-3]))], account.problem.first)
    assert fit.chi2 < 1.3 * account.problem.count(fit)
