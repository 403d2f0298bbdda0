"""Indices of stiffness against what they mean, and in other units."""

import numpy as np
import pytest

import prup_pin
from prup_pin.sweep.indices import along, homogenised, principal_stiffnesses, softest

from .test_sweep import FORCE, MOMENT, ROBOTS

AT = {"z": 0.35, "theta": [0.0, 0.3], "phi": [-0.2, 0.0, 0.4]}
BOX = {"force": FORCE, "moment": MOMENT}


@pytest.fixture(scope="module")
def s(robot):
    names = ["C", "K", "eigenvalues", "ksi", "translational", "rotational", "softest", "homogenised", "homogenised_ksi",
             "directional", "K_yielding", "extremes", "extreme_components", "shares"]  # fmt: skip
    return robot.sweep(**AT, quantities=names, direction="tool z", length=0.25, **BOX)


def test_the_papers_indices_are_those_of_the_raw_matrix(s):
    for index in np.ndindex(s.shape):
        values = np.linalg.eigvals(s["K"][index]).real
        np.testing.assert_allclose(s["eigenvalues"][index], np.sort(values), rtol=1e-9)
        np.testing.assert_allclose(s["ksi"][index], values.min() / values.max(), rtol=1e-9)


def test_principal_stiffnesses_are_force_by_displacement(s):
    c, lines = s["C"][1, 2], s["translational"][1, 2]
    assert (np.diff(lines) > 0).all()
    force = s["softest"][1, 2]
    moved = c[:3, :3] @ force
    np.testing.assert_allclose(moved, force / lines[0], rtol=1e-9)
    trace = np.trace(c[:3, :3]), np.trace(c[3:, 3:])
    np.testing.assert_allclose((1 / lines).sum(), trace[0], rtol=1e-12)
    np.testing.assert_allclose((1 / s["rotational"][1, 2]).sum(), trace[1], rtol=1e-12)


def test_along_the_tools_axis(robot, s):
    pose = robot.pose(z=0.35, theta=0.3, phi=0.4)
    axis = pose.base_from_tool[:3, 2]
    moved = robot.compliance(pose).deflection([*(100 * axis), 0, 0, 0])[:3] @ axis
    np.testing.assert_allclose(s["directional"][1, 2], 100 / moved, rtol=1e-10)
    other = robot.sweep(**AT, quantities=["directional"], direction=[0, 3, 4])
    line = np.array([0, 0.6, 0.8])
    np.testing.assert_allclose(1 / other["directional"][1, 2], line @ s["C"][1, 2, :3, :3] @ line, rtol=1e-12)


def test_homogenised_indices_are_the_same_in_millimetres(s):
    k = s["K"][0, 0]
    to_mm = np.diag([1e-3] * 3 + [1.0] * 3)  # N/mm, N, N mm: K' = 1e3 * T K T with wrenches in N mm
    in_mm = to_mm @ k @ to_mm * 1e3
    raw = [np.linalg.eigvalsh(matrix) for matrix in (k, in_mm)]
    assert abs(raw[0][0] / raw[0][-1]) > 100 * abs(raw[1][0] / raw[1][-1]) or not np.isclose(
        raw[0][0] / raw[0][-1], raw[1][0] / raw[1][-1]
    )
    np.testing.assert_allclose(homogenised(in_mm, 250.0) * 1e3, homogenised(k, 0.25), rtol=1e-9)
    np.testing.assert_allclose(s["homogenised"][0, 0], homogenised(k, 0.25), rtol=1e-12)
    np.testing.assert_allclose(s["homogenised_ksi"][0, 0], np.divide(*homogenised(k, 0.25)[[0, -1]]), rtol=1e-12)


def test_the_characteristic_length_is_the_default(robot):
    a = robot.sweep(**AT, quantities=["homogenised"])
    b = robot.sweep(**AT, quantities=["homogenised"], length=robot.characteristic_length)
    np.testing.assert_allclose(a["homogenised"], b["homogenised"], rtol=1e-12)


def test_stiffness_in_the_directions_that_yield(s):
    """Of a robot that yields everywhere it is K; of a planar one, the inverse of its own 3 x 3."""
    np.testing.assert_allclose(s["K_yielding"], s["K"], rtol=1e-7, atol=1e-7 * np.abs(s["K"]).max())
    five = prup_pin.load(str(ROBOTS / "five_bar" / "five_bar.urdf"), joint_stiffness=1e4)
    found = five.sweep(x=0.03, y=0.38, quantities=["C", "K_yielding"])
    c, k = found["C"], found["K_yielding"]
    assert np.linalg.matrix_rank(c, hermitian=True) < 6
    np.testing.assert_allclose(c @ k @ c, c, rtol=1e-9, atol=1e-9 * np.abs(c).max())
    rigid = np.abs(c).max(axis=1) < 1e-12 * np.abs(c).max()
    assert rigid.any()
    assert np.abs(k[rigid]).max() < 1e-6 * np.abs(k).max()


def test_what_never_yields_is_infinitely_stiff():
    block = np.diag([0.0, 2e-6, 1e-6])
    np.testing.assert_allclose(principal_stiffnesses(block), [5e5, 1e6, np.inf])
    np.testing.assert_array_equal(softest(block), [0, 1, 0])
    assert along(block, np.array([1.0, 0, 0])) == np.inf


def test_the_error_range_is_that_of_the_poses(robot, s):
    ranges = s.error_range()
    assert list(ranges) == ["translation", "rotation", "dx", "dy", "dz", "rx", "ry", "rz"]
    found = ranges["translation"]
    assert found.least == s["extremes"][..., 0].min()
    assert found.largest == s["extremes"][..., 0].max()
    again = robot.sweep(**found.at_largest, quantities=["extremes"], **BOX)
    assert again["extremes"][0] == found.largest
    with pytest.raises(prup_pin.InputError, match="needs quantities"):
        robot.sweep(**AT, quantities=["C"]).error_range()


def test_global_indices(s):
    found = s.spread("translational", 0, threshold=float(np.median(s["translational"][..., 0])))
    values = s["translational"][..., 0]
    assert (found.least, found.largest) == (values.min(), values.max())
    np.testing.assert_allclose(found.mean, values.mean())
    np.testing.assert_allclose(found.percentiles[50], np.median(values))
    np.testing.assert_allclose(found.above, 0.5)
    np.testing.assert_allclose(found.volume, 0.5 * 0.3 * 0.6)
    assert s.spread("ksi").mean == s["ksi"].mean()
    with pytest.raises(prup_pin.InputError, match="say which"):
        s.spread("translational")


def test_the_dominant_module_is_the_one_with_the_largest_share(robot, s):
    found = s.dominant()
    assert found.shape == s.shape
    names = [module.name for module in robot.mechanism.modules]
    for index in np.ndindex(s.shape):
        assert s["shares"][index][names.index(found[index])] == s["shares"][index].max()


def test_where_nothing_answers_a_region_has_no_index(robot):
    s = robot.sweep(z=0.01, theta=0.0, phi=[1.2, 1.3], quantities=["extremes"], **BOX)
    assert not s.ok.any()
    with pytest.raises(prup_pin.InputError, match="none of 2 poses"):
        s.error_range()


def test_sag_frequencies_and_buckling_are_those_of_a_single_question(robot):
    wrench = [0, 0, -500.0, 0, 0, 0]
    s = robot.sweep(z=0.35, theta=0.1, phi=[-0.2, 0.1], quantities=["sag", "frequencies"])
    loaded = robot.sweep(z=0.35, theta=0.1, phi=0.1, quantities=["sag", "buckling_margin"], wrench=wrench)
    pose = robot.pose(z=0.35, theta=0.1, phi=0.1)
    np.testing.assert_allclose(s["sag"][1], robot.compliance(pose).sag(), rtol=1e-9)
    margin = robot.equilibrium(pose, wrench).buckling_margin()
    np.testing.assert_allclose(loaded["buckling_margin"], margin, rtol=1e-6)
    np.testing.assert_allclose(loaded["sag"], s["sag"][1], rtol=1e-12)
    frequencies = s["frequencies"][1]
    assert (np.diff(frequencies) >= 0).all()
    assert 5 < frequencies[0] < 200


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"quantities": ["directional"]}, "needs direction="),
        ({"quantities": ["directional"], "direction": "tool w"}, "'tool z'"),
        ({"quantities": ["directional"], "direction": [0, 0, 0]}, "not all zero"),
        ({"quantities": ["buckling_margin"]}, "needs a load"),
        ({"quantities": ["homogenised"], "length": 0.0}, "rotations arcs"),
    ],
)
def test_what_an_index_needs_is_said(robot, asked, said):
    with pytest.raises(prup_pin.InputError, match=said):
        robot.sweep(**AT, **asked)


@pytest.mark.slow
def test_indices_are_compiled_with_the_rest(robot):
    names = ["translational", "homogenised", "directional", "softest"]
    how = {"quantities": names, "direction": "tool z"}
    # Where the robot is as soft along x as along y, none of the directions is the softest.
    at = {**AT, "theta": np.array([-0.3, 0.05, 0.2])}
    a, b = (robot.sweep(**at, **how, compiled=compiled) for compiled in (False, True))
    assert not b.remarks
    for name in names:
        np.testing.assert_allclose(a[name], b[name], rtol=1e-9, atol=1e-9)


def test_of_a_planar_robot_k_in_its_coordinates_and_indices_that_do_not_exist_are_told():
    five = prup_pin.load(str(ROBOTS / "five_bar" / "five_bar.urdf"), joint_stiffness=1e4)
    found = five.sweep(x=[0.0, 0.03], y=[0.36, 0.38], quantities=["K_task", "translational"])
    assert (found.status == "ok").all()
    assert found["K_task"].shape == (2, 2, 2, 2)
    want = five.compliance(five.pose(x=0.03, y=0.36)).K_task
    np.testing.assert_allclose(found["K_task"][1, 0], want, rtol=1e-9)
    softest_way = np.linalg.eigvalsh(want)[0]
    np.testing.assert_allclose(found["translational"][1, 0, 0], softest_way, rtol=1e-9)
    for name in ("homogenised_ksi", "homogenised", "ksi"):
        none = five.sweep(x=[0.0, 0.03], y=0.36, quantities=[name])
        assert (none.status == "no stiffness").all()
        assert np.isnan(none[name]).all()
        assert "rigid" in none.reason(0)
    half = prup_pin.load(str(ROBOTS / "five_bar" / "five_bar.urdf"), joint_stiffness={"left_motor": 1e4})
    none = half.sweep(x=[0.0, 0.03], y=0.36, quantities=["K_task"])
    assert (none.status == "no stiffness").all()
    assert "no K in x, y" in none.reason(1)
