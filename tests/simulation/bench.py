"""A small bench test of the 3-PRUP, without measurements."""

import prup_pin
from prup_pin.recordings import LoadProgramme, Noise, RandomPoses, TestPlan

BOX = {"z": (0.35, 0.45), "theta": (-0.2, 0.2), "phi": (-0.2, 0.2)}
NOISE = Noise(position=2e-6, rotation=1e-5, force=0.03, moment=0.002)


def plan(poses=2, cycle=(0.0, 1.0, -1.0), **changes):
    given = {
        "poses": (RandomPoses(poses, BOX),),
        "loads": (LoadProgramme(cycle, random_directions=1, force=60.0, moment=8.0),),
        "noise": NOISE,
        "robot": "3prup",
        "seed": 4,
    }
    return TestPlan(**{**given, **changes})


def inputs(robot, **changes):
    return plan(**changes).inputs(lambda at: robot.pose(**at).actuators)


def three_prup():
    return prup_pin.load("3prup")
