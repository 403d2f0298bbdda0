"""What is left out of a small bench test is named again, at its place: laws that any robot has a place for."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.errors import UnknownNameError
from prup_pin.recordings import LoadProgramme, Noise, RandomPoses, Recording, TestPlan, Tolerances, add_noise
from prup_pin.simulation import effect_named, simulate

from ..statics.build import RobotFile

ROBOTS = Path(__file__).parents[1] / "robots"
BOXES = {
    "six_ups": {
        **dict.fromkeys("xy", (-0.07, 0.07)),
        "z": (0.56, 0.68),
        **dict.fromkeys(("rx", "ry", "rz"), (-0.2, 0.2)),
    },
    "five_bar": {"x": (-0.05, 0.05), "y": (0.28, 0.36)},
    "3prup": {"z": (0.35, 0.45), "theta": (-0.2, 0.2), "phi": (-0.2, 0.2)},
}
#: Full force [N] and moment [N m] of each robot's loads.
LOADS = {"six_ups": (900.0, 120.0), "five_bar": (60.0, 0.0), "3prup": (80.0, 10.0)}
NOISE = Noise(position=2e-6, rotation=6e-6)


@cache
def robot(name):
    if name == "five_bar":
        return prup_pin.load(ROBOTS / "five_bar/five_bar.urdf", tool="left_point", joint_stiffness=1e4)
    return prup_pin.load("3prup" if name == "3prup" else ROBOTS / "six_ups/six_ups.urdf")


def recorded(name, *faults, poses=8, cycle=(0.0, 1.0, -1.0), seed=3):
    """A bench test of a robot that has some faults: physics, place, aspect, values."""
    force, moment = LOADS[name]
    plan = TestPlan(
        poses=(RandomPoses(poses, BOXES[name]),),
        loads=(LoadProgramme(cycle, random_directions=1, force=force, moment=moment),),
        noise=NOISE,
        robot=name,
        temperature=(18.0, 30.0),
        seed=seed,
    )
    inputs = plan.inputs(lambda at: robot(name).pose(**at).actuators)
    effects = [effect_named(*fault, robot(name).mechanism) for fault in faults]
    seen = simulate(robot(name), inputs, effects)
    return add_noise(inputs.with_measurements(position=seen.position, rotation=seen.rotation), plan.noise, seed)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        pytest.param(*("six_ups", ("thermal_growth", "leg3/drive", "", {"expansion": 1.2e-5})), marks=pytest.mark.slow),
        ("six_ups", ("thermal_growth", "leg3/drive", "from its support", {"expansion": 3e-5, "length": 0.3})),
        pytest.param(
            *("six_ups", ("geometric_offset", "leg4_seat", "loop end", {"x": 5e-5, "y": -4e-5, "z": 6e-5})),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            *("six_ups", ("geometric_offset", "leg1_s3", "seat", {"x": 5e-5, "y": -4e-5, "z": 6e-5})),
            marks=pytest.mark.slow,
        ),
        pytest.param(  # daily of an arm in test_base_point.py
            *("six_ups", ("base_compliance", "base", "", {"translation": 3e-8, "rotation": 5e-8})),
            marks=pytest.mark.slow,
        ),
        pytest.param(  # daily of the hexapod in test_two_faults.py
            *("six_ups", ("external_spring", "environment", "", {"stiffness": 4e3, "x": 0.1, "y": -0.1, "z": 0.8})),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "3prup",
            (
                "backlash",
                "leg2/R_theta_P",
                "radial by axis",
                {"half_gap_x": 6e-5, "half_gap_y": 4e-5, "closing_load": 0.5},
            ),
            marks=pytest.mark.slow,
        ),
        ("five_bar", ("geometric_offset", "right_elbow", "position", {"x": 1e-4, "y": 0.0})),
    ],
    ids=lambda value: value if isinstance(value, str) else f"{value[0]} {value[1]}",
)
def test_a_fault_is_named_at_its_place(name, fault):
    physics, place, aspect, values = fault
    # a hose pulls as weight does: of a robot that weighs nothing it is not told from one that pulls less
    weight = [("self_weight", "robot", "", {"scale": 1.0})] if physics == "external_spring" else []
    found = diagnose(robot(name), recorded(name, fault, *weight, poses=12 if name == "five_bar" else 8))
    assert found.verdict == "explained"
    (law,) = (finding for finding in found.findings if not weight or finding.physics != "self_weight")
    assert law.physics == physics
    assert (law.location, law.effect.place.aspect) == (place, aspect)
    for parameter, value in values.items():
        low, high = law.parameters[parameter].interval
        assert low - (high - low) < value < high + (high - low)
        assert high - low < 5e-5 if value == 0 else high - low < 0.5 * abs(value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("physics", "aspect", "values", "places"),
    [
        ("lead_error", "drive proportional", {"relative": 3e-4}, "leg{}/drive"),
        pytest.param("thermal_growth", "drive", {"expansion": 1.2e-5}, "leg{}/drive", marks=pytest.mark.slow),
        pytest.param("encoder_offset", "leg*_slide", {"offset": 4e-5}, "leg{}_slide", marks=pytest.mark.slow),
    ],
)
def test_what_all_legs_have_alike_is_one_finding(physics, aspect, values, places):
    found = diagnose(robot("six_ups"), recorded("six_ups", (physics, "robot", aspect, values), poses=6))
    (law,) = found.findings
    assert (law.physics, law.location, law.effect.place.aspect) == (physics, "robot", aspect)
    assert {places.format(leg) for leg in range(1, 7)} <= set(law.candidates)
    ((name, value),) = values.items()
    assert law.parameters[name].value == pytest.approx(value, rel=0.1)
    assert "each of leg1" in law.statement


@pytest.mark.slow
def test_what_legs_have_unlike_stays_one_finding_each():
    given = {"leg1/drive": 3e-4, "leg2/drive": -4e-4, "leg5/drive": 8e-4}
    faults = [("lead_error", leg, "proportional", {"relative": value}) for leg, value in given.items()]
    found = diagnose(robot("six_ups"), recorded("six_ups", *faults, poses=6))
    assert found.verdict == "explained"
    told = {law.location: law.parameters["relative"].value for law in found.findings}
    assert told == pytest.approx(given, rel=0.1)
    assert all("robot" not in law.candidates for law in found.findings)


def test_a_faultless_platform_misses_nothing():
    assert diagnose(robot("six_ups"), recorded("six_ups")).verdict == "nothing_missing"


def test_a_planar_robot_is_displaced_in_its_plane_only():
    values = {"x": 1e-4, "y": 0.0, "z": 1e-4}
    with pytest.raises(UnknownNameError, match="no parameter of geometric_offset named 'z'"):
        effect_named("geometric_offset", "right_elbow", "position", values, robot("five_bar").mechanism)


@pytest.mark.slow
def test_a_tolerance_without_effect_is_told():
    recording = recorded("six_ups", poses=5)
    object.__setattr__(recording, "tolerances", Tolerances(stiffness=0.1, inertia=0.1))
    found = diagnose(robot("six_ups"), recording)
    assert found.verdict == "nothing_missing"
    assert [text for text in found.remarks if "the tolerance inertia changes nothing here" in text]


@pytest.mark.slow
def test_a_base_that_was_measured_before_the_robot_stood_on_it_carries_all_of_its_weight():
    """Whether a base's frame is where it stands loaded or bare nobody knows: no payload stands for the difference."""
    soft = {"translation": 3e-8, "rotation": 3e-6, "settled": 0.0}
    faults = ("base_compliance", "base", "", soft), ("self_weight", "robot", "", {"scale": 1.0})
    found = diagnose(robot("six_ups"), recorded("six_ups", *faults))
    assert [item.physics for item in found.findings] == ["base_compliance", "self_weight"]
    assert found.findings[0].parameters["settled"].value < 0.3


@pytest.mark.slow
def test_a_spring_on_ground_that_gives_way_along_it_is_told_with_the_ground(tmp_path):
    """Loads along a lone slide cannot tell its spring from what it stands on."""
    file = RobotFile()
    file.link("block")
    file.held("slide", "base", "block", axis=(1, 0, 0))
    file.module("spring", "joint_spring", "slide", {"stiffness": 2e5})
    lone = file.load(tmp_path, "block")
    rng = np.random.default_rng(1)
    wrench = np.outer(rng.normal(0, 60, 48), np.eye(6)[0])
    at = {"slide": np.repeat(rng.uniform(-0.2, 0.2, 12), 4)}
    inputs = Recording(time=np.arange(48.0), positions=at, wrench=wrench, noise=NOISE)
    ground = effect_named("base_compliance", "base", "", {"translation": 5e-6, "rotation": 1e-8}, lone.mechanism)
    seen = simulate(lone, inputs, [ground])
    measured = inputs.with_measurements(position=seen.position, rotation=seen.rotation)
    (law,) = diagnose(lone, add_noise(measured, NOISE, 4)).findings
    assert {"spring", "base"} <= set(law.candidates)
    assert "base_compliance at base" in (law.physics + " at " + law.location, *law.alternatives)
