"""Robot files that give no masses, as many a public one: bodies are told by the efforts, and readings by nothing."""

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.dynamics.inertial import pseudo_inertia
from prup_pin.laws.efforts import EffortLaw
from prup_pin.recordings import Convention
from prup_pin.simulation import simulate

from .test_states_in_no_order import FRICTION, SIZES, logged


@pytest.fixture(scope="module")
def ur5():
    return prup_pin.load("ur5")


@pytest.fixture(scope="module")
def without_masses(tmp_path_factory, ur5):
    return bare(ur5, tmp_path_factory)


def bare(robot, tmp_path_factory):
    """Return an arm without the masses of its links."""
    chain, joints = robot.model.jointPlacements, []
    path = tmp_path_factory.mktemp("robots") / "bare.urdf"
    for k, name in enumerate(robot.model.names[1:], 1):
        (x, y, z), (roll, pitch, yaw) = chain[k].translation, rpy(chain[k].rotation)
        axis = " ".join(f"{value:.12g}" for value in np.ravel(robot.model.joints[k].createData().S)[3:])
        joints.append(
            f'<joint name="{name}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="{x:.12g} {y:.12g} {z:.12g}" rpy="{roll:.12g} {pitch:.12g} {yaw:.12g}"/>'
            f'<axis xyz="{axis}"/><limit lower="-6.3" upper="6.3" effort="150" velocity="4"/></joint>'
        )
    links = "".join(f'<link name="l{k}"/>' for k in range(len(joints) + 1))
    path.write_text(f'<robot name="bare">{links}{"".join(joints)}</robot>')
    return prup_pin.load(path)


def rpy(rotation):
    """Roll, pitch and yaw of a rotation matrix, as URDF has them."""
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    return np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])


@pytest.fixture(scope="module")
def told(ur5, without_masses):
    return prup_pin.diagnose(without_masses, logged(ur5, shuffled=False))


def test_friction_is_told_in_newton_metres_and_nothing_is_read_otherwise(told):
    assert told.verdict == "explained"
    assert not told.conventions
    assert not [item for item in told.findings if item.physics == "log_convention"]
    limits = {effect.place.name: effect.values["limit"] for effect in told.effects if "limit" in effect.values}
    assert list(limits.values()) == pytest.approx([FRICTION[list(limits).index(name)] for name in limits], rel=0.03)


def test_another_motion_is_foretold_to_the_noise(ur5, without_masses, told):
    other = logged(ur5, shuffled=False, seed=82)
    found = simulate(without_masses, other, told.effects)
    for k, (name, efforts) in enumerate(other.efforts.items()):
        assert np.nanstd(efforts - found.efforts[name]) == pytest.approx(SIZES[k], rel=0.25), name


def test_its_bodies_can_exist(without_masses, told):
    bodies = {joint.id: np.zeros(10) for joint in without_masses.mechanism.joints}
    for effect in told.effects:
        if isinstance(effect.law, EffortLaw) and effect.law.of_bodies:
            for joint, columns in effect.law.of_body(effect.place, without_masses.mechanism).items():
                bodies[joint] = bodies[joint] + columns @ effect.law.coefficients(effect.place, effect.values)
    for body in bodies.values():
        assert np.linalg.eigvalsh(pseudo_inertia(body)).min() > -1e-6


@pytest.mark.slow
def test_efforts_declared_to_be_as_written_are_in_no_unit_of_their_own(ur5):
    log = logged(ur5, shuffled=False, faulty=False)
    heavier = log.with_measurements(efforts={name: 5.3 * values for name, values in log.efforts.items()})
    assert [str(item) for item in prup_pin.diagnose(ur5, heavier).findings[0].conventions] == ["tau=gain:5.3"]
    declared = replace(heavier, conventions=(Convention("tau", "as_written"),))
    told = prup_pin.diagnose(ur5, declared)
    assert not [item for item in told.findings if item.physics == "log_convention"]
    assert any(item.physics == "inertial_parameters" for item in told.findings)


@pytest.mark.parametrize("seed", [80, 83])
def test_where_no_masses_are_drawn_all_links_have_some(short_arm, tmp_path_factory, seed):
    """One body, a coupling of two motors and gains of drives stood in the place of the links, which had to be light."""
    found = prup_pin.diagnose(bare(short_arm, tmp_path_factory), logged(short_arm, shuffled=False, rows=900, seed=seed))
    assert found.verdict == "explained"
    assert {(item.physics, item.location) for item in found.findings} == {
        ("coulomb_friction", "robot"),
        ("inertial_parameters", "robot"),
    }
