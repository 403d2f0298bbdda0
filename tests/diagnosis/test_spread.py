"""A machine on which everything is off at once: told nothing, how far each kind is off and what is no measurement."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import prup_pin
from prup_pin.diagnosis import gross_errors, spread, variance_components
from prup_pin.diagnosis.calibrate import calibrated_parameters
from prup_pin.diagnosis.free_parameters import free_parameters
from prup_pin.recordings import Noise, Recording
from prup_pin.simulation import compare, simulate

from ..reference.posed_tree import PosedTree
from .test_joint_compliance import JOINTS, MARKERS, NOISE, TORSO, bench
from .test_registration import SOMEWHERE

GROSS = ((4, "left_ball"), (31, "chest"), (40, "right_ball"))
#: Where the tracker took one for the other.
EXCHANGED = 20, ("left_ball", "right_ball")


def asked(recording):
    with threadpool_limits(1, user_api="blas"):
        return importlib.import_module("prup_pin.diagnosis.prepare").prepare(
            prup_pin.load(TORSO), recording, lambda stage, share: None
        )


def drawn(seed: int = 3) -> PosedTree:
    """Return a torso with all zeros 2 degrees off, links a millimetre, markers centimetres, on gears that yield."""
    draw = np.random.default_rng(seed)
    return PosedTree(
        TORSO,
        about=dict(zip(JOINTS, np.exp(draw.uniform(*np.log((1e-4, 5e-4)), len(JOINTS))), strict=True)),
        offsets=dict(zip(JOINTS, 0.035 * draw.standard_normal(len(JOINTS)), strict=True)),
        moved={name: 1e-3 * draw.standard_normal(3) for name in JOINTS},
        targets={name: 0.03 * draw.standard_normal(3) for name in MARKERS},
        tracker=SOMEWHERE,
    )


@pytest.fixture(scope="module")
def told_nothing():
    recording = replace(bench(drawn(), 45), noise=Noise())
    markers = {name: values.copy() for name, values in recording.markers.items()}
    for sample, name in GROSS:
        markers[name][sample] += 0.05
    sample, (one, other) = EXCHANGED
    markers[one][sample], markers[other][sample] = markers[other][sample].copy(), markers[one][sample].copy()
    markers["left_ball"][7] = np.nan
    return replace(recording, markers=markers)


@pytest.fixture(scope="module")
def given(told_nothing):
    return asked(told_nothing)


def test_gross_errors_are_named_with_their_line_and_left_out(given):
    assert {(item.sample, item.channel) for item in given.spread.outliers} == {
        (sample, f"marker {name} position")
        for sample, name in (*GROSS, *((EXCHANGED[0], name) for name in EXCHANGED[1]))
    }
    told = next(text for text in given.remarks if "gross" in text)
    assert "5 gross errors" in told
    assert "line 6 (marker left_ball position, 86" in told
    told = "marker left_ball position and marker right_ball position are exchanged in line 22: "
    assert any(text.startswith(told) for text in given.remarks)
    assert not given.problem.stack.exists[4, 6:9].any()


def test_a_third_of_all_is_gross_where_nothing_lies_between_and_a_machine_where_something_does():
    squares = np.r_[np.linspace(0, 9, 20), np.full(8, 1e5)]
    assert gross_errors._stand_apart(squares, squares > 36)
    assert not gross_errors._stand_apart(np.where(np.arange(28) == 27, 1e3, squares), squares > 36)
    assert not gross_errors._stand_apart(squares[8:], squares[8:] > 36)


def test_one_gross_pose_is_told_though_a_tenth_of_all_scatters_more_widely_than_the_middle_half():
    """As a real arm's hand was seen: two dozen poses, three of them beyond six sigma of the middle half."""
    told = [0.4, 0.5, 0.5, 0.7, 0.8, 0.9, 0.9, 1, 1.1, 1.1, 1.3, 1.3, 1.7, 1.8, 2.3, 2.7, 2.8, 3.3, 3.6, 3.6, 4.6]
    far, size = gross_errors.far_off(np.square([*told, 8.3, np.nan, 8.7, 73.9]))
    assert np.flatnonzero(far).tolist() == [24]
    assert 1 < size < 16  # what the others scatter by, not what the gross one does
    alike, _ = gross_errors.far_off(np.square([*told, 65.0, 70.0, 73.9]))
    assert not alike.any()  # an eighth of all is the machine


def test_what_neighbours_in_posture_share_is_the_machine_and_no_gross_error():
    """A corner of the postures where something lets go; in it, and far from it, a tracker slips once."""
    draw = np.random.default_rng(1)
    actuators, blocks = draw.uniform(0, 1, (300, 2)) * [1.0, 30.0], np.repeat(np.arange(150), 2)
    actuators = actuators[2 * blocks]
    corner = (actuators / [1.0, 30.0] > 0.8).all(axis=1)
    off = draw.standard_normal((300, 3)) + 20.0 * corner[:, None] * [1.0, 0.5, 0.0]
    slips = [np.flatnonzero(corner)[3], np.flatnonzero(~corner)[40]]
    off[slips] = [-20.0, 0.0, 20.0]
    far = np.linalg.norm(off, axis=1) > 6
    shared = gross_errors._shared(far, off, actuators, blocks)
    assert not shared[slips].any()
    assert shared.sum() > 0.6 * corner.sum() > 5
    # samples of one block, taken while nothing moved, are no neighbours
    off[far] = 0.0
    slips = [40, 41]
    off[slips] = [0.0, 20.0, 0.0]
    assert not gross_errors._shared(np.isin(np.arange(300), slips), off, actuators, blocks).any()


def test_a_sensor_that_slips_for_a_while_along_a_way_is_not_the_machine():
    way = np.linspace(0, 6, 200)
    actuators, blocks = np.stack((np.sin(way), np.cos(way)), axis=1), np.arange(200)
    off = np.random.default_rng(1).standard_normal((200, 3))
    off[60:66, 0] += 20.0
    assert not gross_errors._shared(np.abs(off).max(axis=1) > 8, off, actuators, blocks).any()


def test_the_noise_is_that_which_the_tracker_has(given):
    assert given.problem.noise.position == pytest.approx(NOISE, rel=0.1)
    assert given.problem.noise.source == "residual"


def test_kinds_are_off_by_as_much_as_they_are(given):
    kinds = given.spread.kinds
    assert {"encoder_offset", "position", "target_position"} <= set(kinds)
    assert not {"direction", "encoder_slope"} & set(kinds)  # these are none of them
    truth = drawn()
    zeros = np.sqrt(np.mean(np.square(list(truth.offsets.values()))))
    assert kinds["encoder_offset"] == pytest.approx(zeros, rel=0.4)
    assert kinds["position"] == pytest.approx(1e-3, rel=0.4)
    assert given.spread.yielding == ("own",)


def test_calibration_that_nothing_was_told_predicts_other_poses(given):
    truth, problem = drawn(), given.within_tolerances(given.problem)
    known = {item.name: item for item in calibrated_parameters(problem, problem.first)}
    for joint in ("left_elbow", "right_lift"):
        item = known[f"{joint}.encoder_offset"]
        assert item.learned > 0.8
        assert item.value == pytest.approx(truth.offsets[joint], abs=5e-3)
    effects = [*problem.tolerances.at(problem.first.x), *given.placed.every]
    other = replace(bench(truth, 30, seed=9), noise=Noise(position=NOISE))
    left = max(item.in_noise for item in compare(other, simulate(prup_pin.load(TORSO), other, effects)))
    assert left < 5  # of hundreds: what yields has stayed out


def test_what_comes_towards_its_load_does_not_yield():
    labels = np.array(["yields own"] * 3 + ["position"])
    fit = variance_components.VarianceEstimate(
        np.ones(4),
        np.ones(2),
        np.array([2.0, -0.5, 0.1, -9.0]),
        np.diag([0.01, 0.01, 0.01, 1.0]),
        0.0,
        np.zeros((4, 0)),
    )
    assert spread._gives_way(fit, labels, "yields own")
    assert not spread._gives_way(replace(fit, mean=-fit.mean), labels, "yields own")
    assert not spread._gives_way(fit, labels, "position")


@pytest.mark.slow
def test_a_few_places_are_left_to_laws():
    tree = PosedTree(TORSO, about={"bend": 4e-4}, offsets={"left_elbow": 0.03}, tracker=SOMEWHERE)
    recording = replace(bench(tree, 45), noise=Noise())
    found = asked(recording)
    assert not found.spread.kinds
    assert {item.kind for item in found.toleranced.law.deviations} == {"frame_position", "frame_rotation"}
    assert found.problem.noise.position == pytest.approx(NOISE, rel=0.1)


# -- the equations -----------------------------------------------------------------------------------------------------


def columns(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(seed)
    return draw.standard_normal((40, 6)), draw.standard_normal(40)


def of_units(matrix: np.ndarray, right: np.ndarray, first: int) -> variance_components.SensorEquations:
    """Return a linear problem of which so many numbers come first and are of one unit, the others of another."""
    parts = (slice(None, first), slice(first, None))
    sums = [(m.T @ m, m.T @ r, r @ r, len(r)) for m, r in ((matrix[part], right[part]) for part in parts)]
    return variance_components.SensorEquations(*(np.array(each) for each in zip(*sums, strict=True)))


def test_the_likelihood_is_that_of_the_numbers_with_the_parameters_integrated_out():
    from scipy.stats import multivariate_normal  # heavy: nothing else of the package needs it

    matrix, right = columns()
    data = of_units(matrix, right, 15)
    variances, noise = np.array([0.3, 2.0, 1.0, 0.1, 5.0, 0.7]), np.array([1.7, 0.6])
    covariance = np.diag(np.repeat(noise, [15, 25])) + matrix @ np.diag(variances) @ matrix.T
    expected = -2 * multivariate_normal(cov=covariance).logpdf(right) - 40 * np.log(2 * np.pi)
    found = variance_components.posterior(data, variances, noise)
    assert found.cost == pytest.approx(expected, rel=1e-9)
    assert found.mean == pytest.approx(np.diag(variances) @ matrix.T @ np.linalg.solve(covariance, right), rel=1e-9)


def test_no_other_spread_is_likelier():
    matrix, _ = columns()
    draw = np.random.default_rng(1)
    labels = np.array(["a", "a", "a", "b", "b", "b"])
    right = matrix @ (np.array([3.0] * 3 + [0.5] * 3) * draw.standard_normal(6)) + 0.2 * draw.standard_normal(40)
    right[20:] += 0.8 * draw.standard_normal(20)
    data = of_units(matrix, right, 20)
    found = variance_components.estimated(data, np.ones(6), np.ones(2), labels, np.full(6, 1e-12), 0.0)
    for factor in (0.9, 1.1):
        for label in "ab":
            other = np.where(labels == label, factor, 1.0) * found.variances
            assert variance_components.posterior(data, other, found.noise).cost > found.cost
        for unit in range(2):
            other = np.where(np.arange(2) == unit, factor, 1.0) * found.noise
            assert variance_components.posterior(data, found.variances, other).cost > found.cost


@pytest.mark.parametrize("size", [1.0, 1e8])
def test_no_variance_is_likelier_by_rounding(size):
    """Of parameters that do nearly the same, none leaves less than the least squares that there are."""
    rng = np.random.default_rng(0)
    columns = 300 * rng.normal(size=(600, 6)) @ rng.normal(size=(6, 12)) + 1e-4 * rng.normal(size=(600, 12))
    right = columns @ (5 * rng.normal(size=12)) + rng.normal(size=600)
    data = of_units(columns, right, 300)
    least = right - columns @ np.linalg.lstsq(columns, right, rcond=None)[0]
    assert variance_components.posterior(data, np.full(12, size), np.ones(2)).cost > float(least @ least)


ARM = {  # where each joint sits on the link before it, and its axis there
    "pan": ("0 0 0.09", "0 0 1"),
    "lift": ("0 0.14 0", "0 1 0"),
    "elbow": ("0 -0.12 0.43", "0 1 0"),
    "bow": ("0 0 0.39", "0 1 0"),
    "nod": ("0 0.09 0", "0 0 1"),
    "roll": ("0 0 0.09", "0 1 0"),
}


def test_few_poses_of_an_arm_tell_the_directions_of_its_axes(tmp_path):
    """48 numbers, and 48 parameters that do some 30 different things: axes and zeros are 5 mrad off."""
    text, before = '<link name="base"/>', "base"
    for name, (origin, axis) in ARM.items():
        text += f'<link name="after_{name}"/><joint name="{name}" type="revolute"><origin xyz="{origin}"/>'
        text += f'<parent link="{before}"/><child link="after_{name}"/><axis xyz="{axis}"/>'
        text += '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        before = f"after_{name}"
    text += f'<link name="hand"/><joint name="grip" type="fixed"><origin xyz="0.02 0.3 0"/><parent link="{before}"/>'
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{text}<child link="hand"/></joint></robot>')
    draw = np.random.default_rng(6)
    tree = PosedTree(path, tilted={name: 5e-3 * draw.standard_normal(3) for name in ARM}, tracker=SOMEWHERE)
    q = tree.postures(tuple(ARM), 16, 3)
    recording = Recording(np.arange(16.0), positions=q, position=tree.seen(q, ["hand"], 1e-4, 3)["hand"])
    prepare = importlib.import_module("prup_pin.diagnosis.prepare").prepare
    spread = prepare(prup_pin.load(path, tool="hand"), recording, lambda stage, share: None).spread
    assert spread.all_over().kinds["direction"] == pytest.approx(5e-3, rel=0.5)


def test_zero_and_lead_of_one_drive_are_what_one_law_moves():
    """Alone neither explains a lead that is right in the middle of the travel: the two are one place among few."""
    robot = prup_pin.load("3prup")
    recording = Recording(np.arange(2.0), positions={name: np.full(2, 0.4) for name in robot.mechanism.actuated})
    found = free_parameters(recording, robot.mechanism, {}, loaded=False, moves=False)
    places = {kind: found.places[found.kinds == kind].tolist() for kind in ("encoder_offset", "encoder_slope")}
    assert places["encoder_offset"] == places["encoder_slope"]
    assert len(set(places["encoder_offset"])) == 3
    others = found.places[~np.isin(found.kinds, list(places))].tolist()
    assert not set(others) & set(places["encoder_offset"])
