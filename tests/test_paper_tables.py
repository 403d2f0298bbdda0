"""The model as published reproduces the paper's printed numbers; the correct one does not, and breaks no symmetry."""

from itertools import product

import numpy as np
import pytest

import prup_pin

from . import paper_tables as paper

STATES = np.array(list(product((-1.0, 0.0, 1.0), repeat=6))) * paper.PERMISSIBLE


@pytest.fixture(scope="module")
def published():
    return prup_pin.load("3prup_as_published")


@pytest.fixture(scope="module")
def correct():
    return prup_pin.load("3prup")


def at(robot, z, theta, phi):
    return robot.compliance(robot.pose(z=z, theta=np.radians(theta), phi=np.radians(phi)))


def extremes(c):
    """Largest |translation| [mm], |rotation| [deg] and components over the 729 permissible wrenches."""
    deflections = STATES @ c
    deflections = np.concatenate((deflections[:, :3] * 1e3, np.degrees(deflections[:, 3:])), axis=1)
    return (
        np.linalg.norm(deflections[:, :3], axis=1).max(),
        np.linalg.norm(deflections[:, 3:], axis=1).max(),
        np.abs(deflections).max(axis=0),
    )


def agrees(value, printed):
    """True where `value` rounds to the printed digits, with 0.15 of a last digit for the inputs' own rounding."""
    digits = len(printed.partition(".")[2])
    return abs(value - float(printed)) <= 0.65 * 10**-digits


@pytest.mark.parametrize("example", range(3))
def test_table_4(correct, example):
    pose = correct.pose(**dict(zip(("z", "theta", "phi"), scaled(paper.EXAMPLES[example]), strict=True)))
    for leg, printed in enumerate(paper.TABLE_4[example], start=1):
        values = [pose.joints[f"leg{leg}_slide"]]
        values += [np.degrees(pose.joints[f"leg{leg}_{name}"]) for name in ("R_lambda", "R_phi", "R_theta")]
        for value, text in zip(values, printed, strict=True):
            digits = len(text.partition(".")[2])
            assert abs(value - float(text)) <= 0.5001 * 10**-digits, (leg, value, text)


def scaled(example):
    return example[0], np.radians(example[1]), np.radians(example[2])


@pytest.mark.parametrize("example", range(3))
def test_tables_5_and_6(published, example):
    r = at(published, *paper.EXAMPLES[example])
    for column, c in enumerate((r.bodies, r.C)):
        translation, rotation, components = extremes(c)
        assert agrees(translation, paper.TABLE_5[example][0][column])
        assert agrees(rotation, paper.TABLE_5[example][1][column])
        for value, printed in zip(components, paper.TABLE_6[example], strict=True):
            assert agrees(value, printed[column]), (value, printed[column])


def test_largest_difference_over_tables_5_and_6(published):
    differences = []
    for example in range(3):
        r = at(published, *paper.EXAMPLES[example])
        for column, c in enumerate((r.bodies, r.C)):
            translation, rotation, components = extremes(c)
            printed = [row[column] for row in (*paper.TABLE_5[example], *paper.TABLE_6[example])]
            differences += np.abs(np.array([translation, rotation, *components]) - np.array(printed, float)).tolist()
    assert max(differences) < 7e-4


@pytest.mark.parametrize("row", range(3))
def test_table_3(published, row):
    wrench, translations, rotations = paper.TABLE_3[row]
    r = at(published, *paper.TABLE_3_POSE)
    for c, translation, rotation in zip((r.bodies, r.C), translations, rotations, strict=True):
        deflection = c @ np.array(wrench, float)
        assert np.linalg.norm(deflection[:3]) * 1e3 == pytest.approx(translation, abs=5e-4)
        assert np.degrees(np.linalg.norm(deflection[3:])) == pytest.approx(rotation, abs=5e-4)


def test_lower_ends_of_the_compliance_error_range(published):
    """At z = 0.3 m the smallest of the largest deflections is at the centre."""
    centre = extremes(at(published, 0.3, 0, 0).C)
    assert f"{centre[0]:.2f}" == paper.GCER_LOWER[0]
    assert f"{centre[1]:.2f}" == paper.GCER_LOWER[1]
    for theta, phi in ((8, 0), (-8, 0), (0, 8), (0, -8)):
        around = extremes(at(published, 0.3, theta, phi).C)
        assert around[0] > centre[0]
        assert around[1] > centre[1]


def test_the_printed_sign_breaks_the_symmetry_that_the_correct_one_keeps(published, correct):
    """Errata 1: printed 4.023 and 3.932 mm along x and y in Example 1; statics gives 4.593 along both."""
    printed, right = (extremes(at(robot, *paper.EXAMPLES[0]).bodies)[2] for robot in (published, correct))
    assert printed[0] - printed[1] > 0.09
    assert right[0] == pytest.approx(4.593, abs=5e-4)
    assert right[1] == pytest.approx(right[0], rel=1e-12)
