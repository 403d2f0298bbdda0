"""A wrench sensor scatters, and nobody declared by how much: its noise reaches the poses through all that yields.

The lift is simulated here, without the package: two links in a plane, a spring in each joint, play in one of them.
"""

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Noise, Recording

LENGTHS, STIFFNESSES = np.array([0.6, 0.5]), np.array([4e4, 1.5e4])
JOINTS = ("shoulder", "elbow")
LIFT = f"""<robot name="lift">
  <link name="base"/><link name="arm"/><link name="boom"/><link name="fork"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="500" velocity="2"/></joint>
  <joint name="elbow" type="revolute"><parent link="arm"/><child link="boom"/><origin xyz="{LENGTHS[0]} 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="500" velocity="2"/></joint>
  <joint name="mount" type="fixed"><parent link="boom"/><child link="fork"/><origin xyz="{LENGTHS[1]} 0 0"/></joint>
  <prup_pin version="1"><tool frame="fork"/>
    <module name="shoulder/gear" type="joint_spring" joint="shoulder">
      <parameter name="stiffness" value="{STIFFNESSES[0]}" unit="N m/rad"/></module>
    <module name="elbow/gear" type="joint_spring" joint="elbow">
      <parameter name="stiffness" value="{STIFFNESSES[1]}" unit="N m/rad"/></module>
  </prup_pin>
</robot>
"""
#: Of the tracker [m], and of the wrench sensor [N, N m], half a per cent of the largest load.
POSITION, FORCE, MOMENT = 1e-5, 0.6, 0.18


@pytest.fixture(scope="module")
def lift(tmp_path_factory):
    path = tmp_path_factory.mktemp("lift") / "lift.urdf"
    path.write_text(LIFT)
    return prup_pin.load(path)


def places(q):
    """Return where shoulder, elbow and fork are, (3, 3): a turn about +y lowers what lies along x."""
    turns = np.cumsum(q)
    steps = LENGTHS[:, None] * np.stack((np.cos(turns), np.zeros(2), -np.sin(turns)), axis=1)
    return np.vstack(([0, 0, 0.4], np.array([0, 0, 0.4]) + np.cumsum(steps, axis=0)))


def measured(seed, gap, joint=1, poses=6, loads=40):
    """Return what is measured of a lift whose joint has a play of ± gap [rad], nothing declared."""
    rng, rows = np.random.default_rng(seed), []
    for _ in range(poses):
        q = np.array([rng.uniform(-1, 0.6), rng.uniform(0.3, 1.6)])
        for count in range(loads):
            angle, size = rng.uniform(0, 2 * np.pi), 120 * rng.uniform(0.1, 1) * (count > 0)
            force, given = size * np.array([np.cos(angle), 0, np.sin(angle)]), np.zeros(2)
            for _ in range(50):
                at = places(q + given)
                torques = np.cross(at[2] - at[:2], force)[:, 1]
                given = torques / STIFFNESSES
                given[joint] += gap * np.sign(torques[joint])
            wrench = np.concatenate((force + FORCE * rng.normal(size=3), MOMENT * rng.normal(size=3)))
            rows.append((q, wrench, places(q + given)[2] + POSITION * rng.normal(size=3)))
    positions, wrenches, tool = (np.array(column) for column in zip(*rows, strict=True))
    return Recording(
        time=np.arange(len(rows)) * 1.0,
        positions=dict(zip(JOINTS, positions.T, strict=True)),
        wrench=wrenches,
        position=tool,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "joint", "poses", "loads"),
    [
        pytest.param(2, 1, 6, 40, marks=pytest.mark.slow),
        pytest.param(3, 1, 6, 40, marks=pytest.mark.slow),
        (1, 0, 10, 12),
    ],
)
def test_play_explains_what_is_more_than_noise_only_at_the_edge_of_its_gap(lift, seed, joint, poses, loads):
    found = diagnose(lift, measured(seed, 1.2e-3, joint, poses, loads))
    assert found.verdict == "explained"
    first, *others = found.findings
    assert (first.physics, first.location) == ("backlash", f"{JOINTS[joint]}/gear")
    assert first.parameters["half_gap"].value == pytest.approx(1.2e-3, rel=5e-3)
    assert all(other.physics == "finite_deflection" for other in others)
    assert found.noise.position == pytest.approx(POSITION, rel=0.15)
    assert found.noise.force == pytest.approx(FORCE, rel=0.35)


@pytest.mark.parametrize("gap", [4e-4, pytest.param(2e-3, marks=pytest.mark.slow)])
def test_declared_noise_reaches_the_poses_through_the_gap_that_was_found(lift, gap):
    declared = Noise(position=POSITION, force=FORCE, moment=MOMENT)
    found = diagnose(lift, replace(measured(1, gap), noise=declared))
    assert found.verdict == "explained"
    assert (found.findings[0].physics, found.findings[0].location) == ("backlash", "elbow/gear")
    assert found.findings[0].parameters["half_gap"].value == pytest.approx(gap, rel=2e-2)
    assert found.noise.source == "declared"
    assert 0.9 < found.after["fit"] < 1.15


@pytest.mark.slow
def test_a_faultless_lift_has_no_sensor_of_another_gain(lift):
    """What moments the sensor reports are its noise: poses are better foretold without them."""
    found = diagnose(lift, measured(2, 0.0, poses=12, loads=12))
    assert found.verdict == "nothing_missing"
    assert not [finding for finding in found.findings if finding.physics != "finite_deflection"]
    assert found.noise.position == pytest.approx(POSITION, rel=0.15)
