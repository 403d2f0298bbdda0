"""The work of the load along its path is stored in the modules, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import prup_pin
from prup_pin.errors import InputError, JointLimitWarning
from prup_pin.loaded import Conditions, LoadedPose, find_equilibria

from ..modules.examples import EXAMPLES
from .arms import EI, LENGTH, cantilever, single_module
from .test_at_rest import MACHINE
from .test_derivatives import LARGE

pytestmark = pytest.mark.filterwarnings(f"ignore::{JointLimitWarning.__module__}.{JointLimitWarning.__name__}")


@MACHINE
def test_energy_balances_on_every_machine(tmp_path, build):
    robot, pose = build(tmp_path)
    energy = robot.equilibrium(pose, LARGE).energy()
    assert energy.work > 0
    assert energy.dissipated == 0
    assert abs(energy.balance) < 1e-8 * energy.work


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] if "_beam" in kind else []) for kind in EXAMPLES]
)
def test_energy_balances_for_every_kind(tmp_path, kind):
    robot, pose = single_module(tmp_path, kind, EXAMPLES[kind][0])
    energy = robot.equilibrium(pose, LARGE, gravity=True).energy(steps=6)
    # A nut whose rows lift off has a kink on the way.
    bound = 1e-4 if kind == "preloaded_ball_nut" else 1e-7
    assert abs(energy.balance) < bound * abs(energy.stored)


@pytest.mark.parametrize("gravity", [False, True], ids=["weightless", "weighing"])
def test_energy_balances_on_the_3prup(gravity):
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=0.2, phi=-0.1)
    loaded = robot.equilibrium(pose, [300.0, -200.0, 500.0, 30.0, 40.0, -35.0], gravity=gravity)
    energy = loaded.energy()
    assert abs(energy.balance) < 1e-9 * energy.stored
    # Half the work of forces that keep their stiffness is something else.
    assert abs(0.5 * loaded.wrench @ loaded.displacement - energy.work) > 1e-3 * energy.work


def test_energy_of_an_arc(tmp_path):
    robot, pose = cantilever(tmp_path)
    moment = 2.0 * EI / LENGTH
    energy = robot.equilibrium(pose, [0, 0, 0, 0, -moment, 0]).energy()
    assert energy.stored == pytest.approx(moment**2 * LENGTH / (2 * EI), rel=1e-10)
    assert energy.work == pytest.approx(energy.stored, rel=1e-9)


def test_a_dead_moment_works_on_spins_not_on_rotation_vectors(tmp_path):
    """Bent about one axis and then twisted about another, the tool turns by no sum of the two."""
    robot, pose = cantilever(tmp_path)
    wrench = np.array([0, 0, 40.0, 60.0, -90.0, 50.0])
    loaded = robot.equilibrium(pose, wrench)
    energy = loaded.energy(steps=8)
    assert np.linalg.norm(loaded.displacement[3:]) > 0.5
    assert abs(energy.balance) < 1e-9 * energy.work


def test_friction_dissipates():
    """In the free joints, and in the guides of the driven slides."""
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=0.2, phi=-0.1)
    wrench = np.array([300.0, -200.0, 500.0, 30.0, 40.0, -35.0])
    plain = robot.equilibrium(pose, wrench)
    chain = robot._chain
    travel = plain._equilibria.state.travel[0, chain.moving]
    torques = 0.2 * np.sign(travel) * (np.abs(travel) > 1e-4)
    free = len(chain.structure.free)
    torques[free:] = 40.0 * np.sign(travel[free:])  # N, in slides beside their drives
    conditions = Conditions(wrench[None], torques=torques[None])
    found = find_equilibria(chain, [pose], np.zeros(1, int), conditions)
    resisted = replace(plain, _equilibria=found)
    assert isinstance(resisted, LoadedPose)
    energy = resisted.energy()
    assert energy.dissipated > 1e-3 * energy.work
    assert abs(energy.balance) < 1e-8 * energy.work
    assert energy.work < plain.energy().work


def test_weight_spread_along_beams_has_no_balance():
    robot = prup_pin.load("3prup")
    pose = robot.pose(z=0.4, theta=0.2, phi=-0.1)
    with pytest.raises(InputError, match="spread_weight=False"):
        robot.equilibrium(pose, np.zeros(6), gravity=True, spread_weight=True).energy()
