"""Robots and small bench tests on which laws are tried."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import prup_pin
from prup_pin.laws import LAWS, Effect, Inputs, Law, Place
from prup_pin.simulation import Simulator
from prup_pin.testing.poses import CYCLE, WRENCH, PoseBench, load_cycle

ROBOTS = Path(__file__).parents[1] / "robots"
NAMES = ("3prup", "3prup_as_published", "ur5", "five_bar", "delta", "six_ups", "lift")
ACTUATORS = {
    "3prup": [[0.40, 0.42, 0.36], [0.33, 0.35, 0.39]],
    "3prup_as_published": [[0.40, 0.42, 0.36], [0.33, 0.35, 0.39]],
    "ur5": [[0.2, -1.1, 1.4, -0.5, 0.7, 0.3], [0.4, -1.3, 1.2, -0.2, 0.5, 0.1]],
    "five_bar": [[0.2, -0.1], [-0.1, 0.2]],
    "delta": [[0.3, -0.2, 0.1], [0.1, 0.1, 0.2]],
    "six_ups": [[0.02, -0.01, 0.03, 0.0, 0.01, -0.02], [-0.01, 0.02, 0.0, 0.03, -0.02, 0.01]],
    "lift": [[0.15, 0.3, -0.6, 1.2, 0.4], [0.6, 1.5, -0.2, 0.7, -0.5]],
}


@cache
def robot(name: str) -> prup_pin.Robot:
    if name == "ur5":
        # the last two joints are rigid, so that they may turn out not to be
        soft = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint")
        return prup_pin.load("ur5", joint_stiffness=dict.fromkeys(soft, 1e4))
    if name == "five_bar":
        springs = {"left_motor": 1e4, "right_motor": 2e4}
        return prup_pin.load(ROBOTS / "five_bar/five_bar.urdf", tool="left_point", joint_stiffness=springs)
    if name == "delta":
        return prup_pin.load(ROBOTS / "delta/robot.urdf", tool="centre", joint_stiffness=2000.0)
    if name == "six_ups":
        return prup_pin.load(ROBOTS / "six_ups/six_ups.urdf")
    if name == "lift":
        return prup_pin.load(ROBOTS / "lift/lift.urdf", tool="target")
    return prup_pin.load(name)


def inputs(name: str, wrench=WRENCH, actuators=None, cycle=CYCLE) -> Inputs:
    """A load cycle in each of two poses."""
    return load_cycle(ACTUATORS[name] if actuators is None else actuators, wrench, cycle)


def bench(name: str, law: Law | None = None) -> PoseBench:
    return _bench(name, law if law is not None and "weight" in law.needs else None)


@cache
def _bench(name: str, law: Law | None) -> PoseBench:
    return PoseBench.of(robot(name), ACTUATORS[name], law)


def simulator(name: str) -> Simulator:
    return bench(name).simulator


def nominal(name: str):
    return bench(name).nominal


def effect(name: str, law: type[Law], place: str, aspect: str = "", **values: float) -> Effect:
    """Return a checked effect; values left out are those at which a fit starts."""
    found = next(item for item in LAWS if type(item) is law)
    at = Place(place, aspect)
    given = {**found.starts(at, robot(name).mechanism)[0], **values}
    return Effect(found, at, given).checked(robot(name).mechanism)
