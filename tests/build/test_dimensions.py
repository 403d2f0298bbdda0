"""Builders take metres, and what they make weighs like what they say it is."""

import numpy as np
import pytest

from prup_pin import build
from prup_pin.errors import InputError

from .test_closed_forms import DELTA, FAMILIES, FIVE_BAR, PRR, RRR, STEWART

#: Lengths of parts that are far from 20 m also where they are taken for metres: said by their bars instead.
THIN = {name for sizes in FAMILIES.values() for name in sizes if name.endswith("_diameter")}


@pytest.mark.parametrize("family", FAMILIES)
def test_millimetres_are_refused_with_the_metres_that_were_meant(family):
    sizes = FAMILIES[family]
    lengths = [name for name in sizes if name not in THIN and not name.endswith(("_mass", "_stiffness"))]
    assert len(lengths) >= 3
    for name in lengths:
        meant = f"{name} = {1e3 * sizes[name]:g} m .*is it in millimetres.*{name}={sizes[name]:g}$"
        with pytest.raises(InputError, match=meant):
            getattr(build, family)(**{**sizes, name: 1e3 * sizes[name]})
    for name in THIN & set(sizes):
        with pytest.raises(
            InputError, match=f"{name} = {1e3 * sizes[name]:g} m is .*millimetres.*{name}={sizes[name]:g}$"
        ):
            getattr(build, family)(**{**sizes, name: 1e3 * sizes[name]})


def inertia_of(robot, link):
    """Return mass, and the principal moments about the centre, of the body that a link leads."""
    model = robot.model
    joint = model.frames[model.getFrameId(link)].parentJoint
    found = model.inertias[joint]
    return found.mass, np.sort(np.linalg.eigvalsh(found.inertia))


@pytest.mark.parametrize(
    ("robot", "link", "length", "diameter"),
    [
        (build.five_bar(**FIVE_BAR), "left_rod", 0.35, 0.016),
        (build.five_bar(**FIVE_BAR), "right_arm", 0.25, 0.02),
        (build.three_rrr(**RRR), "leg2_rod", 0.27, 0.016),
        (build.three_prr(**PRR), "leg3_rod", 0.35, 0.016),
        (build.delta(**DELTA), "leg3b_rod", 0.6, 0.012),
        (build.delta(**DELTA), "leg1_arm", 0.25, 0.04),
    ],
)
def test_a_rod_has_a_rods_inertia(robot, link, length, diameter):
    mass, (about, *across) = inertia_of(robot, link)
    assert mass == pytest.approx(7850 * np.pi / 4 * diameter**2 * length, rel=1e-8)
    assert across == pytest.approx(2 * [mass * (length**2 / 12 + diameter**2 / 16)], rel=1e-7)
    assert across[0] == pytest.approx(mass * length**2 / 12, rel=0.03)
    assert about == pytest.approx(mass * diameter**2 / 8, rel=1e-7)


def test_a_platform_is_a_disc_and_its_legs_are_bars():
    robot = build.stewart(**STEWART)
    lengths = np.hypot(
        0.7, np.linalg.norm(robot.home.placement("leg2_rod")[:2, 3] - robot.home.placement("leg2_yoke")[:2, 3])
    )
    mass, (_, *across) = inertia_of(robot, "leg2_cylinder")
    assert mass == pytest.approx(4.0)
    assert across == pytest.approx(2 * [4.0 * ((lengths / 2) ** 2 / 12 + 0.03**2 / 16)], rel=1e-6)
    platform = build.three_rrr(**{**RRR, "platform_mass": 2.0})
    model = platform.model
    body = model.inertias[model.frames[model.getFrameId("platform")].parentJoint]
    assert np.diagonal(body.inertia) == pytest.approx([0.005, 0.005, 0.01])


def test_what_shapes_were_taken_is_assumed():
    notes = build.five_bar(**FIVE_BAR).assumptions
    assert "inertias are those of uniform round bars: left_arm, left_rod, right_arm, right_rod" in notes
    assert "inertias are those of thin discs about z: platform" in build.three_rrr(**RRR).assumptions
    weightless = {name: value for name, value in STEWART.items() if not name.endswith("_mass")}
    assert not any("inertias are" in note for note in build.stewart(**weightless).assumptions)
