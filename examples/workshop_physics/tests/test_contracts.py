"""What is brought keeps the contracts of prup_pin, and is found once this package is installed."""

import json

import numpy as np
import prup_pin
from prup_pin.laws import brought_laws
from prup_pin.laws.efforts import EFFORT_LAWS
from prup_pin.testing import check_law, check_module, check_reader
from workshop_physics.json_lines import read
from workshop_physics.quadratic_drag import QuadraticDrag
from workshop_physics.rubber_mount import RubberMount


def drag(law, place, values, at):
    """The equation, written a second time: of a tree, whose joints are all driven."""
    speed = at.motion.speed[:, [at.motion.names.index(name) for name in at.driven]]
    return np.where(np.array(at.driven) == place.name, values["drag"] * np.abs(speed) * speed, 0.0)


def test_the_law_keeps_its_contract():
    check_law(QuadraticDrag, closed_form=drag)


def test_the_law_is_one_of_those_that_compete():
    (found,) = (found for found in brought_laws() if found.name == "quadratic_drag")
    assert found.source.name == "workshop-physics"
    assert found.thing in EFFORT_LAWS


def test_the_module_keeps_its_contract():
    check_module(RubberMount, {"stiffness": 1e5}, {"stiffness": 3e5})


def test_the_reader_keeps_its_contract(tmp_path):
    log = tmp_path / "run.jsonl"
    log.write_text("".join(json.dumps({"time": 0.01 * k, "q": 0.1 * k}) + "\n" for k in range(50)))
    check_reader(read, log)


def test_the_robot_is_found_and_yields_as_its_mount():
    robot = prup_pin.load("mounted_table")
    deflection = robot.compliance(robot.pose_from_actuators([0.3])).deflection([10, 0, 0, 0, 0, 0])
    assert np.allclose(deflection, [5e-5, 0, 0, 0, 0, 0], atol=1e-15)
