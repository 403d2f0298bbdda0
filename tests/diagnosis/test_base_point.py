"""About which point does a base tilt? About its origin where that will do, else about a point beside it."""

import numpy as np
import pytest

import prup_pin
from prup_pin.diagnosis import diagnose
from prup_pin.recordings import Noise, Recording
from prup_pin.spatial import rotation_exp, rotation_log

NOISE = Noise(position=5e-6, rotation=2e-5)
SLOW = [pytest.mark.slow]


def standing_on(arm, way, turning, point, poses=14):
    """Return a bench test of an arm whose base moves at a point by way (3,) per force and turns by turning (3,)."""
    rng = np.random.default_rng(4)
    q = np.repeat(rng.uniform(-1.5, 1.5, (poses, 6)), 5, axis=0)
    each = rng.normal(size=(poses, 6)) * [150, 150, 150, 25, 25, 25]
    wrench = np.concatenate([np.outer((0.0, 0.5, 1.0, -0.5, -1.0), row) for row in each])
    seen, turns = [], []
    for row, load in zip(q, wrench, strict=True):
        pose = arm.pose_from_actuators(row)
        at, moved = pose.base_from_tool, arm.compliance(pose).deflection(load)
        place, turned = at[:3, 3] + moved[:3], rotation_exp(moved[3:]) @ at[:3, :3]
        lean = rotation_exp(np.multiply(turning, load[3:] + np.cross(place - point, load[:3])))
        seen.append(point + lean @ (place - point) + np.multiply(way, load[:3]))
        turns.append(rotation_log(lean @ turned))
    return Recording(
        time=np.arange(len(q), dtype=float),
        positions=dict(zip(arm.mechanism.actuated, q.T, strict=True)),
        wrench=wrench,
        position=np.array(seen) + rng.normal(0, NOISE.position, (len(q), 3)),
        rotation=np.array(turns) + rng.normal(0, NOISE.rotation, (len(q), 3)),
        noise=NOISE,
    )


@pytest.mark.parametrize(
    ("way", "turning", "point", "aspect"),
    [
        # a pedestal: gears, gains and encoders of a sound arm were accused beside an unknown part
        pytest.param([0, 0, 0], [4e-6, 1.7e-6, 0], [0.0, 0.0, -0.3], "about a point", id="below", marks=SLOW),
        pytest.param([0, 0, 0], [2.5e-6, 2.5e-6, 0], [0.15, 0.0, 0.0], "about a point", id="beside", marks=SLOW),
        pytest.param([0, 0, 0], [4e-6, 1.7e-6, 1e-6], [0.0, 0.0, 0.0], "by axis", id="at the origin", marks=SLOW),
        # of 0.8 m: it tilts about its middle, and moves by a twelfth of its height squared times its tilt
        pytest.param([1.6e-7, 1.6e-7, 0], [3e-6, 3e-6, 1e-6], [0.0, 0.0, -0.4], "by axis, about a point", id="column"),
    ],
)  # fmt: skip
def test_a_base_tilts_about_the_point_about_which_it_does(way, turning, point, aspect):
    arm = prup_pin.load("ur10", joint_stiffness=1e5)
    found = diagnose(arm, standing_on(arm, way, turning, np.array(point)))
    assert found.verdict == "explained"
    (law,) = found.findings
    assert (law.physics, law.location, law.effect.place.aspect) == ("base_compliance", "base", aspect)
    told = law.effect.values
    turned = [told[f"rotation_{axis}"] for axis in "xyz"]
    np.testing.assert_allclose(turned, turning, atol=1e-7)
    if "point" in aspect:
        np.testing.assert_allclose([told[axis] for axis in "xyz"], point, atol=0.03)
    if "axis" in aspect:
        np.testing.assert_allclose([told[f"translation_{axis}"] for axis in "xyz"], way, atol=3e-8)
    assert not [text for text in law.alternatives if "stiffness_changed" in text]
